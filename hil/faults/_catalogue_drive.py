"""The catalogue: faults of the drive itself."""

from __future__ import annotations

from typing import Final

from hil.faults._parameters import FaultType, Parameter

_NO_HAND: Final = (
    "a physical drive has no seam for this; it would need switched I/O or a test adapter on the machine"
)

DRIVE_FAULTS: Final[tuple[FaultType, ...]] = (
    FaultType(
        "drive.fault", "The drive trips with an EMCY code", "drive", "drive internals",
        (
            Parameter("code", "int", "EMCY error code, or number of a fault of a PROFIdrive axis", minimum=0x0001, maximum=0xFFFF, required=True),
            Parameter("persistent", "bool", "The cause stays, and refuses a fault reset, until the fault is removed", default=False),
        ),
        refused={"hardware": _NO_HAND},
        example={"kind": "drive.fault", "target": "drive1", "parameters": {"code": 0x2310}},
    ),
    FaultType(
        "drive.sto", "The safe-torque-off input opens: torque off at once, no fault", "drive", "drive internals",
        refused={"hardware": _NO_HAND}, example={"kind": "drive.sto", "target": "drive1", "duration_s": 0.5},
    ),
    FaultType(
        "drive.power_off", "The node vanishes from the bus without a word; it boots again at the end", "drive", "CANopen node",
        refused={"hardware": _NO_HAND}, example={"kind": "drive.power_off", "target": "drive1", "duration_s": 2.0},
    ),
    FaultType(
        "drive.heartbeat_loss", "The drive goes on working but sends no heartbeat", "drive", "CANopen service",
        refused={"hardware": _NO_HAND}, remark="frame.drop of the heartbeat does the same to a physical drive",
        example={"kind": "drive.heartbeat_loss", "target": "drive1", "duration_s": 1.0},
    ),
    FaultType(
        "drive.ss1", "The safe-stop-1 input opens: quick stop, then safe torque off", "drive", "drive internals",
        refused={"hardware": _NO_HAND},
        example={"kind": "drive.ss1", "target": "drive1", "duration_s": 0.5},
    ),
    FaultType(
        "drive.interlock", "The interlock opens (60FDh bit 3); what the drive does is configured in its bench file", "drive", "drive internals",
        refused={"hardware": _NO_HAND}, remark="the bench file has to wire it: safety.interlock",
        example={"kind": "drive.interlock", "target": "drive1", "duration_s": 0.5},
    ),
    FaultType(
        "drive.mains_off", "The mains are away: the DC link lives on its charge and on braking energy, then 3220h", "drive", "drive supply",
        refused={"hardware": _NO_HAND},
        example={"kind": "drive.mains_off", "target": "drive1", "duration_s": 0.5},
    ),
    FaultType(
        "drive.brown_out", "The voltage of the mains dips: below its threshold the DC link is undervoltage, above it there is less power", "drive", "drive supply",
        (
            Parameter("mains_percent", "float", "What is left of the voltage", "%", 1.0, 100.0, required=True),
        ),
        refused={"hardware": _NO_HAND}, remark="depth is mains_percent, length is duration_s; drive.mains_off takes all of it, drive.reset and drive.power_off the control supply too",
        example={"kind": "drive.brown_out", "target": "drive1", "duration_s": 0.3, "parameters": {"mains_percent": 50.0}},
    ),
    FaultType(
        "drive.phase_loss", "One phase of the mains is missing: warning, and 3130h after a time in operation", "drive", "drive supply",
        refused={"hardware": _NO_HAND},
        example={"kind": "drive.phase_loss", "target": "drive1", "duration_s": 0.5},
    ),
    FaultType(
        "drive.dc_link", "The DC link is held at a voltage: missing (bit 4), too low or too high", "drive", "drive supply",
        (
            Parameter("voltage_V", "float", "Voltage", "V", 0.0, 5000.0, default=0.0),
        ),
        refused={"hardware": _NO_HAND},
        example={"kind": "drive.dc_link", "target": "drive1", "duration_s": 0.5, "parameters": {"voltage_V": 0.0}},
    ),
    FaultType(
        "drive.chopper_failure", "The brake chopper does not conduct: braking energy raises the DC link", "drive", "drive supply",
        refused={"hardware": _NO_HAND},
        example={"kind": "drive.chopper_failure", "target": "drive1", "duration_s": 0.5},
    ),
    FaultType(
        "drive.overtemperature", "A temperature sensor shows a value: warning and fault by its thresholds", "drive", "drive internals",
        (
            Parameter("part", "text", "Which sensor", default="motor", choices=("motor", "power_stage")),
            Parameter("temperature_C", "float", "What it shows", "degC", -60.0, 1000.0, required=True),
        ),
        refused={"hardware": _NO_HAND},
        example={"kind": "drive.overtemperature", "target": "drive1", "duration_s": 0.5, "parameters": {"part": "motor", "temperature_C": 150.0}},
    ),
    FaultType(
        "drive.torque_limit", "The drive gives less torque than it should", "drive", "drive internals",
        (
            Parameter("share", "float", "Share of the rated torque", minimum=0.0, maximum=10.0, required=True),
        ),
        refused={"hardware": _NO_HAND},
        example={"kind": "drive.torque_limit", "target": "drive1", "duration_s": 0.5, "parameters": {"share": 0.2}},
    ),
    FaultType(
        "drive.brake_stuck", "The holding brake does not open, or does not close", "drive", "drive internals",
        (
            Parameter("closed", "bool", "Stuck closed; false: stuck open", required=True),
        ),
        refused={"hardware": _NO_HAND}, remark="the bench file has to fit a brake: brake.torque_nm",
        example={"kind": "drive.brake_stuck", "target": "drive1", "duration_s": 0.5, "parameters": {"closed": True}},
    ),
    FaultType(
        "drive.brake_slip", "The closed holding brake slips", "drive", "drive internals",
        (
            Parameter("share", "float", "Share of its torque that is left", minimum=0.0, maximum=1.0, required=True),
        ),
        refused={"hardware": _NO_HAND}, remark="the bench file has to fit a brake: brake.torque_nm",
        example={"kind": "drive.brake_slip", "target": "drive1", "duration_s": 0.5, "parameters": {"share": 0.1}},
    ),
    FaultType(
        "drive.slow_ramp", "Ramps of the drive are flatter than set", "drive", "drive internals",
        (
            Parameter("share", "float", "Share of the slope that is left", minimum=0.001, maximum=1.0, required=True),
        ),
        refused={"hardware": _NO_HAND},
        example={"kind": "drive.slow_ramp", "target": "drive1", "duration_s": 0.5, "parameters": {"share": 0.5}},
    ),
    FaultType(
        "drive.local_control", "Somebody takes the control at the drive: bit 9 = 0, control words are ignored", "drive", "state machine",
        refused={"hardware": _NO_HAND},
        example={"kind": "drive.local_control", "target": "drive1", "duration_s": 0.5},
    ),
    FaultType(
        "drive.refuse_transition", "The drive does not make a transition by command", "drive", "state machine",
        (
            Parameter("transition", "int", "Number of the transition: 2, 3, 4, 15 or 16", minimum=2, maximum=16, required=True),
        ),
        refused={"hardware": _NO_HAND},
        example={"kind": "drive.refuse_transition", "target": "drive1", "duration_s": 0.5, "parameters": {"transition": 4}},
    ),
    FaultType(
        "drive.switch_on_disabled", "The drive falls to Switch on disabled by itself, without fault; the motor coasts", "drive", "state machine",
        lasting=False, refused={"hardware": _NO_HAND},
        example={"kind": "drive.switch_on_disabled", "target": "drive1"},
    ),
    FaultType(
        "drive.warning", "The drive warns without cause: bit 7", "drive", "status word",
        refused={"hardware": _NO_HAND},
        example={"kind": "drive.warning", "target": "drive1", "duration_s": 0.5},
    ),
    FaultType(
        "drive.statusword_stuck", "The status word stands still", "drive", "status word",
        refused={"hardware": _NO_HAND},
        example={"kind": "drive.statusword_stuck", "target": "drive1", "duration_s": 0.5},
    ),
    FaultType(
        "drive.statusword_bits", "Bits of the status word are shown wrong", "drive", "status word",
        (
            Parameter("set", "int", "Bits shown as 1", minimum=0, maximum=0xFFFF, default=0),
            Parameter("clear", "int", "Bits shown as 0", minimum=0, maximum=0xFFFF, default=0),
        ),
        refused={"hardware": _NO_HAND},
        example={"kind": "drive.statusword_bits", "target": "drive1", "duration_s": 0.5, "parameters": {"clear": 0x0200}},
    ),
    FaultType(
        "drive.target_toggle", "Bit 10 (target reached) toggles without motion", "drive", "status word",
        (
            Parameter("period_s", "float", "Distance of its changes", "s", 0.001, 10.0, default=0.02),
        ),
        refused={"hardware": _NO_HAND},
        example={"kind": "drive.target_toggle", "target": "drive1", "duration_s": 0.5, "parameters": {"period_s": 0.02}},
    ),
    FaultType(
        "drive.mode_display", "6061h shows another mode than the one in force", "drive", "status word",
        (
            Parameter("mode", "int", "What it shows", minimum=-128, maximum=127, required=True),
        ),
        refused={"hardware": _NO_HAND},
        example={"kind": "drive.mode_display", "target": "drive1", "duration_s": 0.5, "parameters": {"mode": 1}},
    ),
    FaultType(
        "drive.reset", "The node restarts in operation: silence, boot-up, Pre-operational; the motor coasts", "drive", "CANopen node",
        (
            Parameter("boot_s", "float", "From the reset to the boot-up frame", "s", 0.0, 10.0, default=0.1),
        ),
        lasting=False, refused={"hardware": _NO_HAND},
        example={"kind": "drive.reset", "target": "drive1", "parameters": {"boot_s": 0.1}},
    ),
    FaultType(
        "drive.heartbeat_late", "Heartbeats come later than their period says", "drive", "CANopen service",
        (
            Parameter("delay_s", "float", "Added to the period", "s", 0.001, 60.0, required=True),
        ),
        refused={"hardware": _NO_HAND},
        example={"kind": "drive.heartbeat_late", "target": "drive1", "duration_s": 0.5, "parameters": {"delay_s": 0.2}},
    ),
    FaultType(
        "drive.clock_drift", "The clock of the drive runs fast or slow: its cycles, ramps, times, heartbeats and time stamps", "drive", "clock of the node",
        (
            Parameter("drift_ppm", "float", "By how much it is fast; negative: slow", "ppm", -100000.0, 100000.0, required=True),
        ),
        refused={"hardware": _NO_HAND}, remark="at the end it is as fast as the others again, but not set",
        example={"kind": "drive.clock_drift", "target": "drive1", "duration_s": 0.5, "parameters": {"drift_ppm": 200.0}},
    ),
    FaultType(
        "drive.clock_jitter", "The cycles of the drive begin late by a random time, and so do the frames that it sends by itself", "drive", "clock of the node",
        (
            Parameter("jitter_us", "float", "Longest delay; each is drawn evenly from 0 to it, from the seeded stream", "us", 0.0, 10000.0, required=True),
        ),
        refused={"hardware": _NO_HAND},
        example={"kind": "drive.clock_jitter", "target": "drive1", "duration_s": 0.5, "parameters": {"jitter_us": 50.0}},
    ),
    FaultType(
        "drive.sdo_abort", "SDO accesses are aborted", "drive", "CANopen service",
        (
            Parameter("code", "int", "Abort code", minimum=1, maximum=0xFFFFFFFF, default=0x08000000),
            Parameter("index", "int", "Index that is refused; 0: every one", minimum=0, maximum=0xFFFF, default=0),
        ),
        refused={"hardware": _NO_HAND},
        example={"kind": "drive.sdo_abort", "target": "drive1", "duration_s": 0.5, "parameters": {"code": 0x06010000, "index": 0x6060}},
    ),
    FaultType(
        "drive.sdo_timeout", "SDO requests are not answered", "drive", "CANopen service",
        refused={"hardware": _NO_HAND},
        example={"kind": "drive.sdo_timeout", "target": "drive1", "duration_s": 0.5},
    ),
    FaultType(
        "drive.emcy_storm", "EMCYs over and over, without any change of state", "drive", "CANopen service",
        (
            Parameter("code", "int", "EMCY error code", minimum=1, maximum=0xFFFF, default=0xFF00),
            Parameter("period_s", "float", "Distance of the EMCYs", "s", 0.0002, 10.0, default=0.002),
        ),
        refused={"hardware": _NO_HAND},
        example={"kind": "drive.emcy_storm", "target": "drive1", "duration_s": 0.5, "parameters": {"code": 0xFF00, "period_s": 0.002}},
    ),
)  # fmt: skip
