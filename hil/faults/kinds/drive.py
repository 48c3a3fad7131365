"""Faults of a drive: of its supply, its power stage, its state machine, its status word, and its
CANopen node.
"""

from __future__ import annotations

from functools import partial
from typing import Final

from fieldbus.clock import US
from fieldbus.errors import ConfigurationError
from hil.faults import seams
from hil.faults._kind import Action, Custom, Family, FaultType, Held, Injection, Once, SupplyCut, toggled
from hil.faults._parameters import Environment, Parameter, Values

_COMMANDED: Final = (2, 3, 4, 15, 16)
"""Transitions by command."""

_TRIP: Final = Once(
    seams.TripsOnFaults, lambda drive, p: drive.raise_fault(p.integer("code"), persistent=False)
)
_LASTING_TRIP: Final = Held(
    seams.KeepsFaultCauses,
    lambda drive, p: drive.raise_fault(p.integer("code"), persistent=True),
    lambda drive, p: drive.clear_fault_cause(p.integer("code")),
    per=("code",),
    repeat=True,
)


def _trip(injection: Injection) -> Action:
    return (_LASTING_TRIP if injection.values.flag("persistent") else _TRIP)(injection)


def _check_transition(kind: str, values: Values) -> None:
    if values.integer("transition") not in _COMMANDED:
        raise ConfigurationError(
            f"{kind}.parameters.transition", values.get("transition"), ", ".join(map(str, _COMMANDED))
        )


# -- kinds -----------------------------------------------------------------------------------------------

_REFUSED: Final[dict[Environment, str]] = {
    "hardware": "a physical drive has no seam for this; it would need switched I/O or a test adapter on the "
    "machine"
}
_kind: Final = partial(FaultType, target="drive", refused=_REFUSED)

FAMILY: Final = Family(
    kinds=(
        _kind(
            "drive.fault",
            "The drive trips with an EMCY code",
            Custom(_trip, needs=seams.KeepsFaultCauses),
            seam="drive internals",
            parameters=(
                Parameter(
                    "code",
                    "int",
                    "EMCY error code, or number of a fault of a PROFIdrive axis",
                    minimum=1,
                    maximum=0xFFFF,
                    required=True,
                ),
                Parameter(
                    "persistent",
                    "bool",
                    "The cause stays, and refuses a fault reset, until the fault is removed",
                    default=False,
                ),
            ),
            example={"target": "drive1", "parameters": {"code": 0x2310}},
            text="""
            The drive trips: EMCY, 603Fh, transition 13, fault reaction as 605Eh says. After faults of
            power stage, DC link and encoder it coasts.
            """,
        ),
        _kind(
            "drive.sto",
            "The safe-torque-off input opens: torque off at once, no fault",
            toggled(seams.HasSafeTorqueOff, lambda drive, active: drive.set_sto(active)),
            seam="drive internals",
            example={"target": "drive1", "duration_s": 0.5},
            text="""
            The safe-torque-off input opens: torque off at once, *Switch on disabled*, no fault.
            """,
        ),
        _kind(
            "drive.power_off",
            "The node disappears from the bus without a last message; it boots again at the end",
            SupplyCut(),
            seam="CANopen node",
            example={"target": "drive1", "duration_s": 2.0},
            text="""
            The node disappears from the bus without a last message, the motor coasts. It boots again at
            the end of the fault.
            """,
        ),
        _kind(
            "drive.heartbeat_loss",
            "The drive goes on working but sends no heartbeat",
            toggled(seams.SendsHeartbeat, lambda drive, active: drive.stop_heartbeat(active)),
            seam="CANopen service",
            remark="frame.drop of the heartbeat does the same to a physical drive",
            example={"target": "drive1", "duration_s": 1.0},
            text="""
            The drive goes on working but sends no heartbeat. `frame.drop` of `heartbeat` does the same to
            a physical drive.
            """,
        ),
        _kind(
            "drive.ss1",
            "The safe-stop-1 input opens: quick stop, then safe torque off",
            toggled(seams.HasSafeStop1, lambda drive, active: drive.set_ss1(active)),
            seam="drive internals",
            example={"target": "drive1", "duration_s": 0.5},
            text="""
            The input of safe stop 1 opens: quick stop, then safe torque off, as `[drive.NAME.safety]`
            says. At the end both are released.
            """,
        ),
        _kind(
            "drive.interlock",
            "The interlock opens (60FDh bit 3); what the drive does is configured in its bench file",
            toggled(seams.HasInterlock, lambda drive, active: drive.open_interlock(active)),
            seam="drive internals",
            remark="the bench file has to wire it: safety.interlock",
            example={"target": "drive1", "duration_s": 0.5},
            fuzzed=False,
            text="""
            The interlock opens: 60FDh bit 3 falls, and the drive does what `interlock` in
            `[drive.NAME.safety]` says. It has to be wired there.
            """,
        ),
        _kind(
            "drive.mains_off",
            "The mains are off: the DC link is fed by its charge and by braking energy, then 3220h",
            toggled(seams.HasMains, lambda drive, active: drive.disconnect_mains(active)),
            seam="drive supply",
            example={"target": "drive1", "duration_s": 0.5},
            text="""
            The mains are off. The DC link is fed by its charge and by braking energy; below its threshold
            3220h in operation, *Switch on disabled* from *Switched on*, bit 4 = 0. At the end the mains
            charge it again.
            """,
        ),
        _kind(
            "drive.brown_out",
            (
                "The voltage of the mains dips: below its threshold the DC link is undervoltage, above it"
                " there is less power"
            ),
            Held(
                seams.HasMainsVoltage,
                lambda drive, p: drive.set_mains_voltage_share(p.number("mains_percent") / 100.0),
                lambda drive, _: drive.set_mains_voltage_share(1.0),
            ),
            seam="drive supply",
            parameters=(
                Parameter(
                    "mains_percent",
                    "float",
                    "What is left of the voltage",
                    unit="%",
                    minimum=1.0,
                    maximum=100.0,
                    required=True,
                ),
            ),
            remark=(
                "depth is mains_percent, length is duration_s; drive.mains_off takes all of it, "
                "drive.reset and drive.power_off the control supply too"
            ),
            example={"target": "drive1", "duration_s": 0.3, "parameters": {"mains_percent": 50.0}},
            fuzzed=False,
            text="""
            The voltage of the mains dips, as deep as `mains_percent` says and as long as `duration_s`.
            Above the undervoltage threshold of the DC link there is only less of it; below, a drive in
            operation trips (3220h, F30003). `drive.mains_off` switches the mains off, `drive.power_off`
            the control supply too; `drive.reset` is a dip of the control supply.
            """,
        ),
        _kind(
            "drive.phase_loss",
            "One phase of the mains is missing: warning, and 3130h after a time in operation",
            toggled(seams.HasMainsPhases, lambda drive, active: drive.disconnect_phase(active)),
            seam="drive supply",
            example={"target": "drive1", "duration_s": 0.5},
            text="""
            One phase of the mains is missing: warning at once, 3130h after `phase_loss_time_ms` in
            operation.
            """,
        ),
        _kind(
            "drive.dc_link",
            "The DC link is held at a voltage: missing (bit 4), too low or too high",
            Held(
                seams.HasDcLink,
                lambda drive, p: drive.set_dc_link_voltage(p.number("voltage_V")),
                lambda drive, _: drive.restore_dc_link(),
            ),
            seam="drive supply",
            parameters=(
                Parameter(
                    "voltage_V", "float", "Voltage", unit="V", minimum=0.0, maximum=5000.0, default=0.0
                ),
            ),
            example={"target": "drive1", "duration_s": 0.5, "parameters": {"voltage_V": 0.0}},
            text="""
            The DC link is held at a voltage: 0 = missing, low is 3220h in operation, high is 3210h in any
            state.
            """,
        ),
        _kind(
            "drive.chopper_failure",
            "The brake chopper does not conduct: braking energy raises the DC link",
            toggled(seams.HasBrakeChopper, lambda drive, active: drive.disable_chopper(active)),
            seam="drive supply",
            example={"target": "drive1", "duration_s": 0.5},
            text="""
            The brake chopper does not conduct: what a braking motor returns raises the DC link until
            3210h.
            """,
        ),
        _kind(
            "drive.overtemperature",
            "A temperature sensor shows a value: warning and fault by its thresholds",
            Held(
                seams.HasTemperatureSensors,
                lambda drive, p: drive.force_temperature(p.text("part"), p.number("temperature_C")),
                lambda drive, p: drive.force_temperature(p.text("part"), None),
                per=("part",),
            ),
            seam="drive internals",
            parameters=(
                Parameter("part", "text", "Which sensor", default="motor", choices=("motor", "power_stage")),
                Parameter(
                    "temperature_C",
                    "float",
                    "What it shows",
                    unit="degC",
                    minimum=-60.0,
                    maximum=1000.0,
                    required=True,
                ),
            ),
            example={
                "target": "drive1",
                "duration_s": 0.5,
                "parameters": {"part": "motor", "temperature_C": 150.0},
            },
            text="""
            The sensor of motor or power stage shows a temperature: warning and fault (4310h, 4210h) by
            the thresholds of `[drive.NAME.thermal]`.
            """,
        ),
        _kind(
            "drive.torque_limit",
            "The drive gives less torque than it should",
            Held(
                seams.LimitsTorque,
                lambda drive, p: drive.limit_torque(p.number("share")),
                lambda drive, _: drive.limit_torque(None),
            ),
            seam="drive internals",
            parameters=(
                Parameter(
                    "share", "float", "Share of the rated torque", minimum=0.0, maximum=10.0, required=True
                ),
            ),
            example={"target": "drive1", "duration_s": 0.5, "parameters": {"share": 0.2}},
            fuzzed=False,
            text="""
            The drive gives less torque than it should; bit 11 shows it.
            """,
        ),
        _kind(
            "drive.brake_stuck",
            "The holding brake does not open, or does not close",
            Held(
                seams.HasHoldingBrake,
                lambda drive, p: drive.set_brake_stuck(p.flag("closed")),
                lambda drive, _: drive.set_brake_stuck(None),
            ),
            seam="drive internals",
            parameters=(Parameter("closed", "bool", "Stuck closed; false: stuck open", required=True),),
            remark="the bench file has to fit a brake: brake.torque_nm",
            example={"target": "drive1", "duration_s": 0.5, "parameters": {"closed": True}},
            fuzzed=False,
            text="""
            The holding brake does not open, or does not close, and the drive reports nothing. The bench
            file has to fit a brake.
            """,
        ),
        _kind(
            "drive.brake_slip",
            "The closed holding brake slips",
            Held(
                seams.HasWearingBrake,
                lambda drive, p: drive.set_brake_torque_share(p.number("share")),
                lambda drive, _: drive.set_brake_torque_share(1.0),
            ),
            seam="drive internals",
            parameters=(
                Parameter(
                    "share",
                    "float",
                    "Share of its torque that is left",
                    minimum=0.0,
                    maximum=1.0,
                    required=True,
                ),
            ),
            remark="the bench file has to fit a brake: brake.torque_nm",
            example={"target": "drive1", "duration_s": 0.5, "parameters": {"share": 0.1}},
            fuzzed=False,
            text="""
            The closed holding brake holds with a share of its torque. The bench file has to fit a brake.
            """,
        ),
        _kind(
            "drive.slow_ramp",
            "Ramps of the drive are flatter than set",
            Held(
                seams.HasRamps,
                lambda drive, p: drive.scale_ramps(p.number("share")),
                lambda drive, _: drive.scale_ramps(1.0),
            ),
            seam="drive internals",
            parameters=(
                Parameter(
                    "share",
                    "float",
                    "Share of the slope that is left",
                    minimum=0.001,
                    maximum=1.0,
                    required=True,
                ),
            ),
            example={"target": "drive1", "duration_s": 0.5, "parameters": {"share": 0.5}},
            fuzzed=False,
            text="""
            Ramps of the drive itself (OFF1, OFF3, quick stop, fault reaction, its own profiles) are
            flatter than set.
            """,
        ),
        _kind(
            "drive.local_control",
            "The drive is switched to local control: bit 9 = 0, control words are ignored",
            toggled(seams.HasLocalControl, lambda drive, active: drive.set_local_control(active)),
            seam="state machine",
            example={"target": "drive1", "duration_s": 0.5},
            fuzzed=False,
        ),
        _kind(
            "drive.refuse_transition",
            "The drive does not make a transition by command",
            Held(
                seams.MakesTransitions,
                lambda drive, p: drive.refuse_transitions(p.integer("transition")),
                lambda drive, _: drive.refuse_transitions(),
            ),
            seam="state machine",
            parameters=(
                Parameter(
                    "transition",
                    "int",
                    "Number of the transition: 2, 3, 4, 15 or 16",
                    minimum=2,
                    maximum=16,
                    required=True,
                ),
            ),
            example={"target": "drive1", "duration_s": 0.5, "parameters": {"transition": 4}},
            check_values=_check_transition,
            text="""
            The drive does not make one of the transitions by command: 2, 3, 4, 15 or 16. At the end the
            control word counts again.
            """,
        ),
        _kind(
            "drive.switch_on_disabled",
            "The drive changes to Switch on disabled by itself, without fault; the motor coasts",
            Once(seams.CanDisableItself, lambda drive, _: drive.force_switch_on_disabled()),
            seam="state machine",
            lasting=False,
            example={"target": "drive1"},
            text="""
            The drive changes to *Switch on disabled* by itself, without fault and EMCY; the motor coasts.
            """,
        ),
        _kind(
            "drive.warning",
            "The drive warns without cause: bit 7",
            toggled(seams.ShowsWarnings, lambda drive, active: drive.force_warning(active)),
            seam="status word",
            example={"target": "drive1", "duration_s": 0.5},
            text="""
            Bit 7 without a cause (bit 31 of 2100h). The state does not change.
            """,
        ),
        _kind(
            "drive.statusword_stuck",
            "The status word is frozen",
            toggled(seams.ShowsStatusword, lambda drive, active: drive.freeze_statusword(active)),
            seam="status word",
            example={"target": "drive1", "duration_s": 0.5},
            fuzzed=False,
            text="""
            6041h is frozen, whatever happens.
            """,
        ),
        _kind(
            "drive.statusword_bits",
            "Bits of the status word are shown wrong",
            Held(
                seams.ShowsStatuswordBits,
                lambda drive, p: drive.override_statusword_bits(p.integer("set"), p.integer("clear")),
                lambda drive, _: drive.override_statusword_bits(0, 0),
            ),
            seam="status word",
            parameters=(
                Parameter("set", "int", "Bits shown as 1", minimum=0, maximum=0xFFFF, default=0),
                Parameter("clear", "int", "Bits shown as 0", minimum=0, maximum=0xFFFF, default=0),
            ),
            example={"target": "drive1", "duration_s": 0.5, "parameters": {"clear": 0x0200}},
            fuzzed=False,
            text="""
            Bits of 6041h are shown as 1 or as 0, whatever they should be.
            """,
        ),
        _kind(
            "drive.target_toggle",
            "Bit 10 (target reached) toggles without motion",
            Held(
                seams.ShowsTargetReached,
                lambda drive, p: drive.toggle_target_reached(p.number("period_s")),
                lambda drive, _: drive.toggle_target_reached(None),
            ),
            seam="status word",
            parameters=(
                Parameter(
                    "period_s",
                    "float",
                    "Distance of its changes",
                    unit="s",
                    minimum=0.001,
                    maximum=10.0,
                    default=0.02,
                ),
            ),
            example={"target": "drive1", "duration_s": 0.5, "parameters": {"period_s": 0.02}},
            fuzzed=False,
            text="""
            Bit 10 (target reached) toggles though nothing moves.
            """,
        ),
        _kind(
            "drive.mode_display",
            "6061h shows another mode than the one in force",
            Held(
                seams.ShowsMode,
                lambda drive, p: drive.override_mode_display(p.integer("mode")),
                lambda drive, _: drive.override_mode_display(None),
            ),
            seam="status word",
            parameters=(Parameter("mode", "int", "What it shows", minimum=-128, maximum=127, required=True),),
            example={"target": "drive1", "duration_s": 0.5, "parameters": {"mode": 1}},
            fuzzed=False,
        ),
        _kind(
            "drive.reset",
            "The node restarts in operation: silence, boot-up, Pre-operational; the motor coasts",
            Once(seams.RestartsNode, lambda drive, p: drive.reset_node(p.number("boot_s"))),
            seam="CANopen node",
            parameters=(
                Parameter(
                    "boot_s",
                    "float",
                    "From the reset to the boot-up frame",
                    unit="s",
                    minimum=0.0,
                    maximum=10.0,
                    default=0.1,
                ),
            ),
            lasting=False,
            example={"target": "drive1", "parameters": {"boot_s": 0.1}},
            text="""
            The node restarts in operation: silence, boot-up frame, Pre-operational; the motor coasts.
            """,
        ),
        _kind(
            "drive.heartbeat_late",
            "Heartbeats come later than their period says",
            Held(
                seams.DelaysHeartbeat,
                lambda drive, p: drive.delay_heartbeat(p.number("delay_s")),
                lambda drive, _: drive.delay_heartbeat(0.0),
            ),
            seam="CANopen service",
            parameters=(
                Parameter(
                    "delay_s",
                    "float",
                    "Added to the period",
                    unit="s",
                    minimum=0.001,
                    maximum=60.0,
                    required=True,
                ),
            ),
            example={"target": "drive1", "duration_s": 0.5, "parameters": {"delay_s": 0.2}},
            fuzzed=False,
            text="""
            Every heartbeat comes later than its period says.
            """,
        ),
        _kind(
            "drive.clock_drift",
            (
                "The clock of the drive runs fast or slow: its cycles, ramps, times, heartbeats and time "
                "stamps"
            ),
            Held(
                seams.HasClock,
                lambda drive, p: drive.set_clock_drift(p.number("drift_ppm")),
                lambda drive, _: drive.set_clock_drift(0.0),
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
            example={"target": "drive1", "duration_s": 0.5, "parameters": {"drift_ppm": 200.0}},
            fuzzed=False,
            text="""
            The clock of the drive runs fast or slow against those of the others: servo and control cycle,
            ramps, delays, heartbeats, SYNC window and time stamps are the drive's own, and its grid
            slides along that of the bus. Targets that it gets are reached at the times of its own clock.
            At the end it runs as the others do and stays apart by what has come together. `frame.drift`
            on SYNC is the same seen from the other side: the controller's clock. A resonator of 100 ppm
            is usual.
            """,
        ),
        _kind(
            "drive.clock_jitter",
            (
                "The cycles of the drive begin late by a random time, and so do the frames that it sends "
                "by itself"
            ),
            Held(
                seams.HasUnsteadyClock,
                lambda drive, p: drive.set_clock_jitter(round(p.number("jitter_us") * US)),
                lambda drive, _: drive.set_clock_jitter(0),
            ),
            seam="clock of the node",
            parameters=(
                Parameter(
                    "jitter_us",
                    "float",
                    "Longest delay; each is drawn evenly from 0 to it, from the seeded stream",
                    unit="us",
                    minimum=0.0,
                    maximum=10000.0,
                    required=True,
                ),
            ),
            example={"target": "drive1", "duration_s": 0.5, "parameters": {"jitter_us": 50.0}},
            fuzzed=False,
            text="""
            The cycles of the drive begin late, each by its own random time: an operating system under
            load. What it does in them, and sends by itself, is late with them. `frame.jitter` moves
            frames alone.
            """,
        ),
        _kind(
            "drive.sdo_abort",
            "SDO accesses are aborted",
            Held(
                seams.AbortsSdo,
                lambda drive, p: drive.abort_sdo(p.integer("code"), p.integer("index")),
                lambda drive, _: drive.abort_sdo(None),
            ),
            seam="CANopen service",
            parameters=(
                Parameter("code", "int", "Abort code", minimum=1, maximum=0xFFFFFFFF, default=0x08000000),
                Parameter(
                    "index",
                    "int",
                    "Index that is refused; 0: every one",
                    minimum=0,
                    maximum=0xFFFF,
                    default=0,
                ),
            ),
            example={
                "target": "drive1",
                "duration_s": 0.5,
                "parameters": {"code": 0x06010000, "index": 0x6060},
            },
            fuzzed=False,
            text="""
            SDO accesses to an index, or to all, are aborted with a code.
            """,
        ),
        _kind(
            "drive.sdo_timeout",
            "SDO requests are not answered",
            toggled(seams.AnswersSdo, lambda drive, active: drive.suppress_sdo_responses(active)),
            seam="CANopen service",
            example={"target": "drive1", "duration_s": 0.5},
        ),
        _kind(
            "drive.emcy_storm",
            "EMCYs again and again, without any change of state",
            Held(
                seams.SendsEmcy,
                lambda drive, p: drive.repeat_emcy(p.integer("code"), p.number("period_s")),
                lambda drive, _: drive.repeat_emcy(None),
            ),
            seam="CANopen service",
            parameters=(
                Parameter("code", "int", "EMCY error code", minimum=1, maximum=0xFFFF, default=0xFF00),
                Parameter(
                    "period_s",
                    "float",
                    "Distance of the EMCYs",
                    unit="s",
                    minimum=0.0002,
                    maximum=10.0,
                    default=0.002,
                ),
            ),
            example={
                "target": "drive1",
                "duration_s": 0.5,
                "parameters": {"code": 0xFF00, "period_s": 0.002},
            },
            fuzzed=False,
            text="""
            EMCYs again and again, without a change of state; EMCY 0000h at the end.
            """,
        ),
    ),
)
