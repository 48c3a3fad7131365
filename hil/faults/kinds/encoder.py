"""Faults of encoders: of the motor encoder of a drive, and of encoders that are
devices of their own (C402-312).
"""

from __future__ import annotations

from functools import partial
from typing import Final

from hil.faults import seams
from hil.faults._kind import (
    Family,
    FaultType,
    Held,
    Once,
    SupplyCut,
    find_encoder,
    find_own_encoder,
    toggled,
)
from hil.faults._parameters import Environment, Parameter

ALARM_BITS: Final = {"position_error": 0, **{f"manufacturer_{bit}": bit for bit in range(12, 16)}}
"""Alarms by name: bits of 6503h."""
WARNING_BITS: Final = {
    "frequency_exceeded": 0,
    "light_control_reserve": 1,
    "cpu_watchdog": 2,
    "operating_time_limit": 3,
    "battery_charge": 4,
    "reference_point_not_reached": 5,
    **{f"manufacturer_{bit}": bit for bit in range(12, 16)},
}
"""Warnings by name: bits of 6505h."""


# -- kinds -----------------------------------------------------------------------------------------------

_REFUSED: Final[dict[Environment, str]] = {
    "hardware": "a physical encoder has no seam for this; it would need a test adapter between encoder and "
    "bus"
}
_DRIVE_REFUSED: Final[dict[Environment, str]] = {
    "hardware": "a physical drive has no seam for this; it would need switched I/O or a test adapter on the "
    "machine"
}
_kind: Final = partial(FaultType, target="encoder", refused=_REFUSED)

FAMILY: Final = Family(
    kinds=(
        _kind(
            "encoder.freeze",
            "The reported position no longer changes",
            toggled(seams.HasEncoder, lambda encoder, active: encoder.freeze_encoder(active), find_encoder),
            seam="encoder",
            example={"target": "drive1", "duration_s": 0.1},
        ),
        _kind(
            "encoder.jump",
            "The reported position jumps and stays displaced",
            Once(
                seams.HasJumpingEncoder,
                lambda encoder, p: encoder.jump_encoder(p.integer("increments")),
                find=find_encoder,
            ),
            seam="encoder",
            parameters=(
                Parameter(
                    "increments",
                    "int",
                    "Displacement, signed",
                    unit="increments",
                    minimum=-(2**31),
                    maximum=2**31 - 1,
                    required=True,
                ),
            ),
            lasting=False,
            example={"target": "drive1", "parameters": {"increments": 20000}},
        ),
        _kind(
            "encoder.noise",
            "Every sample is disturbed by a random number of steps, from the seeded stream",
            Held(
                seams.HasNoisyEncoder,
                lambda encoder, p: encoder.set_encoder_noise(p.integer("increments")),
                lambda encoder, _: encoder.set_encoder_noise(0),
                find=find_encoder,
            ),
            seam="encoder",
            parameters=(
                Parameter(
                    "increments",
                    "int",
                    "Largest disturbance, either way",
                    unit="increments",
                    minimum=1,
                    maximum=1048576,
                    required=True,
                ),
            ),
            example={"target": "drive1", "duration_s": 0.5, "parameters": {"increments": 8}},
            fuzzed=False,
            text="""
            Every sample is disturbed by up to so many increments either way, evenly, from the seeded
            stream.
            """,
        ),
        _kind(
            "encoder.reverse",
            "The encoder counts the other way round, from the present position on",
            toggled(
                seams.HasReversibleEncoder,
                lambda encoder, active: encoder.reverse_encoder(active),
                find_encoder,
            ),
            seam="encoder",
            remark="a drive that controls with it runs away",
            example={"target": "encoder1", "duration_s": 0.2},
            fuzzed=False,
            text="""
            The encoder counts the other way round, from the present position on. A drive that controls
            with it runs away.
            """,
        ),
        _kind(
            "encoder.step_loss",
            "One of so many steps of the motion is not counted, and stays missing",
            Held(
                seams.HasLossyEncoder,
                lambda encoder, p: encoder.lose_encoder_steps(p.integer("every")),
                lambda encoder, _: encoder.lose_encoder_steps(0),
                find=find_encoder,
            ),
            seam="encoder",
            parameters=(
                Parameter(
                    "every",
                    "int",
                    "Steps of which one is lost",
                    unit="increments",
                    minimum=2,
                    maximum=2**31 - 1,
                    default=1000,
                ),
            ),
            example={"target": "encoder1", "duration_s": 1.0, "parameters": {"every": 100}},
            fuzzed=False,
            text="""
            One of so many steps of the motion is not counted. What was missed stays missed; an absolute
            encoder has its true position again when it is powered on again.
            """,
        ),
        _kind(
            "encoder.index_missing",
            "The index of the encoder does not come",
            toggled(seams.HasIndex, lambda encoder, active: encoder.suppress_index(active), find_encoder),
            seam="encoder",
            example={"target": "drive1"},
            text="""
            The index (zero mark) of the encoder does not come: homing on it ends with an error, a touch
            probe waits, an incremental encoder of its own goes on warning that its reference point is not
            reached. An absolute encoder of its own has no index: the fault is refused.
            """,
        ),
        _kind(
            "encoder.drift",
            "The reported position drifts away and stays displaced at the end",
            Held(
                seams.HasDriftingEncoder,
                lambda encoder, p: encoder.set_encoder_drift(p.number("increments_per_s")),
                lambda encoder, _: encoder.set_encoder_drift(0.0),
                find=find_encoder,
            ),
            seam="encoder",
            parameters=(
                Parameter(
                    "increments_per_s",
                    "float",
                    "Speed of the drift, signed",
                    unit="increments/s",
                    minimum=-1000000000.0,
                    maximum=1000000000.0,
                    required=True,
                ),
            ),
            refused=_DRIVE_REFUSED,
            example={"target": "drive1", "duration_s": 1.0, "parameters": {"increments_per_s": 5000.0}},
            fuzzed=False,
            text="""
            The reported position drifts away from the shaft and stays displaced at the end.
            """,
        ),
        _kind(
            "encoder.scale",
            "The encoder counts too much or too little of the motion, and stays displaced at the end",
            Held(
                seams.HasScaledEncoder,
                lambda encoder, p: encoder.set_encoder_scale(p.number("factor")),
                lambda encoder, _: encoder.set_encoder_scale(1.0),
                find=find_encoder,
            ),
            seam="encoder",
            parameters=(
                Parameter(
                    "factor",
                    "float",
                    "What it counts of an increment",
                    minimum=0.01,
                    maximum=100.0,
                    required=True,
                ),
            ),
            refused=_DRIVE_REFUSED,
            remark="every loop uses it: there is no following error, and the load goes elsewhere",
            example={"target": "drive1", "parameters": {"factor": 0.9}},
            fuzzed=False,
            text="""
            The encoder counts too much or too little of the motion, as with a wrong number of steps per
            revolution. Every loop uses it: there is no following error, and the load goes too far or not
            far enough. At the end it stays displaced.
            """,
        ),
        _kind(
            "encoder.wire_break",
            ("The signal of the encoder is lost; the drive detects it and coasts with 7305h, absolute 7320h"),
            toggled(
                seams.HasEncoderWire, lambda encoder, active: encoder.break_encoder_wire(active), find_encoder
            ),
            seam="encoder",
            refused=_DRIVE_REFUSED,
            remark="an incremental encoder has lost its reference afterwards",
            example={"target": "drive1", "duration_s": 0.5},
            fuzzed=False,
            text="""
            The signal of the encoder is lost: the value is frozen, the drive coasts with 7305h (absolute
            7320h). After the repair an incremental encoder has lost its reference.
            """,
        ),
        _kind(
            "encoder.error",
            "An encoder with a PROFIdrive interface shows an error (Gx_ZSW bit 15, code in Gx_XIST2)",
            Held(
                seams.ReportsEncoderErrors,
                lambda encoder, p: encoder.set_encoder_error(p.integer("code"), True),
                lambda encoder, p: encoder.set_encoder_error(p.integer("code"), False),
                per=("code",),
                find=find_encoder,
            ),
            seam="encoder words",
            parameters=(Parameter("code", "int", "Code", minimum=1, maximum=0x1001, required=True),),
            remark="0003h to 0008h and 000Ah come when the controller asks for what they abort",
            example={"target": "drive1", "duration_s": 0.5, "parameters": {"code": 1}},
            fuzzed=False,
            text="""
            An encoder with a PROFIdrive interface - that of an axis (`drive1`), its second one
            (`drive1.encoder2`), or a device of its own - shows an error: Gx_ZSW bit 15, the code in
            Gx_XIST2, until its cause is gone and it is acknowledged. Codes are 0001h, 0002h, 0F01h,
            0F02h, 0F04h, 1001h, and those that come when the controller asks for what they abort: 0003h
            parking, 0004h and 0005h reference mark, 0006h and 0007h flying measurement, 0008h and 000Ah
            absolute value.
            """,
        ),
    ),
)

OWN_DEVICES: Final = Family(
    kinds=(
        _kind(
            "encoder.preset",
            "A preset is written, even during motion",
            Once(
                seams.HasPreset,
                lambda encoder, p: encoder.preset_encoder(p.integer("value")),
                find=find_own_encoder,
            ),
            seam="encoder device",
            parameters=(
                Parameter(
                    "value",
                    "int",
                    "Preset, taken into the range of 6002h",
                    unit="steps",
                    minimum=0,
                    maximum=2**31 - 1,
                    default=0,
                ),
            ),
            lasting=False,
            remark="over the bus a controller can do the same to a physical encoder",
            example={"target": "encoder1", "parameters": {"value": 1000}},
            fuzzed=False,
            text="""
            A preset (6003h) is written, even during motion.
            """,
        ),
        _kind(
            "encoder.overflow",
            "The position is placed just before an end of its range, so that the next motion wraps it",
            Once(
                seams.HasRange,
                lambda encoder, p: encoder.move_near_overflow(
                    p.integer("margin") if p.text("end") == "upper" else -p.integer("margin")
                ),
                find=find_own_encoder,
            ),
            seam="encoder device",
            parameters=(
                Parameter(
                    "margin",
                    "int",
                    "Distance to that end",
                    unit="steps",
                    minimum=1,
                    maximum=2**31 - 1,
                    default=10,
                ),
                Parameter(
                    "end", "text", "Which end of the range", default="upper", choices=("upper", "lower")
                ),
            ),
            lasting=False,
            example={"target": "encoder1", "parameters": {"margin": 5}},
            fuzzed=False,
            text="""
            The position is placed just before an end of its range (6002h), by a preset, so that the next
            motion that way wraps it.
            """,
        ),
        _kind(
            "encoder.alarm",
            "The encoder reports that its position cannot be relied on, and holds it",
            Held(
                seams.ReportsAlarms,
                lambda encoder, p: encoder.set_alarm(ALARM_BITS[p.text("alarm")], True),
                lambda encoder, p: encoder.set_alarm(ALARM_BITS[p.text("alarm")], False),
                per=("alarm",),
                find=find_own_encoder,
            ),
            seam="encoder device",
            parameters=(
                Parameter(
                    "alarm", "text", "Which alarm", default="position_error", choices=tuple(ALARM_BITS)
                ),
            ),
            example={"target": "encoder1", "duration_s": 0.5},
            fuzzed=False,
            text="""
            The encoder reports that its position cannot be relied on (6503h, EMCY), and holds the last
            one.
            """,
        ),
        _kind(
            "encoder.warning",
            "The encoder warns; its position is good",
            Held(
                seams.ReportsWarnings,
                lambda encoder, p: encoder.set_warning(WARNING_BITS[p.text("warning")], True),
                lambda encoder, p: encoder.set_warning(WARNING_BITS[p.text("warning")], False),
                per=("warning",),
                find=find_own_encoder,
            ),
            seam="encoder device",
            parameters=(
                Parameter("warning", "text", "Which warning", required=True, choices=tuple(WARNING_BITS)),
            ),
            example={"target": "encoder1", "parameters": {"warning": "battery_charge"}},
            fuzzed=False,
            text="""
            The encoder warns (6505h); its position is good.
            """,
        ),
        _kind(
            "encoder.cycle",
            "TPDO1 is sent with a wrong cycle time",
            Held(
                seams.SendsCyclically,
                lambda encoder, p: encoder.force_cycle_time(p.integer("period_ms")),
                lambda encoder, _: encoder.force_cycle_time(None),
                find=find_own_encoder,
            ),
            seam="CANopen service",
            parameters=(
                Parameter(
                    "period_ms",
                    "int",
                    "Wrong cycle time; 0: never by time",
                    unit="ms",
                    minimum=0,
                    maximum=0xFFFF,
                    required=True,
                ),
            ),
            example={"target": "encoder1", "duration_s": 0.5, "parameters": {"period_ms": 40}},
            fuzzed=False,
        ),
        _kind(
            "encoder.clock_drift",
            "The clock of the encoder runs fast or slow: its cycle, heartbeats, measured speeds",
            Held(
                seams.HasClock,
                lambda encoder, p: encoder.set_clock_drift(p.number("drift_ppm")),
                lambda encoder, _: encoder.set_clock_drift(0.0),
                find=find_own_encoder,
            ),
            seam="clock of the node",
            parameters=(
                Parameter(
                    "drift_ppm",
                    "float",
                    "By how much it is fast; negative: slow",
                    unit="ppm",
                    minimum=-100000.0,
                    maximum=100000.0,
                    required=True,
                ),
            ),
            remark="at the end it is as fast as the others again, but not set",
            example={"target": "encoder1", "duration_s": 0.5, "parameters": {"drift_ppm": -500.0}},
            fuzzed=False,
            text="""
            The clock of the encoder runs fast or slow: TPDOs by time, heartbeats, and the speeds that it
            measures.
            """,
        ),
        _kind(
            "encoder.power_off",
            "The encoder disappears from the bus without a last message; it boots again at the end",
            SupplyCut(find=find_own_encoder),
            seam="CANopen node",
            example={"target": "encoder1", "duration_s": 0.5},
            fuzzed=False,
            text="""
            The encoder disappears from the bus without a last message. It boots again at the end of the
            fault, and is started again.
            """,
        ),
        _kind(
            "encoder.heartbeat_loss",
            "The encoder goes on working but sends no heartbeat",
            toggled(
                seams.SendsHeartbeat, lambda encoder, active: encoder.stop_heartbeat(active), find_own_encoder
            ),
            seam="CANopen service",
            remark="frame.drop of the heartbeat does the same to a physical encoder",
            example={"target": "encoder1", "duration_s": 1.0},
            fuzzed=False,
            text="""
            The encoder goes on working but sends no heartbeat. `frame.drop` of `heartbeat` does the same
            to a physical encoder.
            """,
        ),
    ),
    title="Encoders with a node of their own",
    text="""
    The kinds above hit the motor encoder of a drive, or an encoder that is a device of its own
    (`[encoder.NAME]`), by the name of either. Those that follow need a device of its own; without a
    target the first one of the bench file is meant. A missing TPDO is `frame.drop`:

    ```python
    faults.inject("frame.drop", count=3, drive="encoder1", message="tpdo1")
    ```
    """,
)
