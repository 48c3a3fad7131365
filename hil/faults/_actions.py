"""What a fault does to the bench: one action per kind, with the way back."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, Final, NamedTuple

from fieldbus.clock import US, seconds_to_ns
from fieldbus.errors import HilError, UnsupportedFaultError
from hil.faults._action import Action, refuse_unless_supported
from hil.faults._claims import Claim, total
from hil.faults._encoder_kinds import ALARM_BITS, OWN_DEVICE_NAMES, WARNING_BITS
from hil.faults._fault import Fault
from hil.protocols import Bench


def _method(part: Any, name: str, fault: Fault) -> Callable[..., Any]:
    method = getattr(part, name, None)
    if not callable(method):
        raise UnsupportedFaultError(
            f"{fault.kind} cannot be injected: {getattr(part, 'name', part)!s} offers no {name}()"
        )
    return method  # type: ignore[no-any-return]  # getattr on a part of any make


Value = Callable[[str], Any]


class _Pair(NamedTuple):
    """A fault that is one call of the drive, and another one back."""

    method: str
    on: Callable[[Value], tuple[Any, ...]] = lambda _value: (True,)
    """Arguments of the call, from the parameters of the fault."""
    off: tuple[Any, ...] | None = (False,)
    """Arguments of the call back; None: it is over the moment it is applied."""
    end: str = ""
    """Method of the call back, where it is another one."""
    adds: bool = False
    """Several of them add up, as forces do; else the newest counts."""


_PAIRS: Final[dict[str, _Pair]] = {
    "drive.sto": _Pair("set_sto"),
    "drive.ss1": _Pair("set_ss1"),
    "safety.ss2": _Pair("set_ss2"),
    "safety.sos": _Pair("set_sos"),
    "safety.sbc": _Pair("set_sbc"),
    "safety.sls": _Pair("set_sls", lambda value: (value("level"),), (None,)),
    "safety.sdi": _Pair("set_sdi", lambda value: (1 if value("direction") == "positive" else -1,), (None,)),
    "safety.slp": _Pair("set_slp", lambda value: (value("range"),), (None,)),
    "safety.acknowledge": _Pair("acknowledge_safety", lambda _value: (), None),
    "drive.interlock": _Pair("open_interlock"),
    "drive.heartbeat_loss": _Pair("stop_heartbeat"),
    "drive.heartbeat_late": _Pair("delay_heartbeat", lambda value: (value("delay_s"),), (0.0,)),
    "drive.mains_off": _Pair("disconnect_mains"),
    "drive.brown_out": _Pair(
        "set_mains_voltage_share", lambda value: (value("mains_percent") / 100.0,), (1.0,)
    ),
    "drive.phase_loss": _Pair("disconnect_phase"),
    "drive.dc_link": _Pair("set_dc_link_voltage", lambda value: (value("voltage_V"),), (), "restore_dc_link"),
    "drive.chopper_failure": _Pair("disable_chopper"),
    "drive.torque_limit": _Pair("limit_torque", lambda value: (value("share"),), (None,)),
    "drive.brake_stuck": _Pair("set_brake_stuck", lambda value: (value("closed"),), (None,)),
    "drive.brake_slip": _Pair("set_brake_torque_share", lambda value: (value("share"),), (1.0,)),
    "drive.slow_ramp": _Pair("scale_ramps", lambda value: (value("share"),), (1.0,)),
    "drive.local_control": _Pair("set_local_control"),
    "drive.refuse_transition": _Pair("refuse_transitions", lambda value: (value("transition"),), ()),
    "drive.switch_on_disabled": _Pair("force_switch_on_disabled", lambda _value: (), None),
    "drive.warning": _Pair("force_warning"),
    "drive.statusword_stuck": _Pair("freeze_statusword"),
    "drive.statusword_bits": _Pair(
        "override_statusword_bits", lambda value: (value("set"), value("clear")), (0, 0)
    ),
    "drive.target_toggle": _Pair("toggle_target_reached", lambda value: (value("period_s"),), (None,)),
    "drive.mode_display": _Pair("override_mode_display", lambda value: (value("mode"),), (None,)),
    "drive.reset": _Pair("reset_node", lambda value: (value("boot_s"),), None),
    "drive.sdo_abort": _Pair("abort_sdo", lambda value: (value("code"), value("index")), (None,)),
    "drive.sdo_timeout": _Pair("suppress_sdo_responses"),
    "drive.emcy_storm": _Pair("repeat_emcy", lambda value: (value("code"), value("period_s")), (None,)),
    "drive.clock_drift": _Pair("set_clock_drift", lambda value: (value("drift_ppm"),), (0.0,)),
    "drive.clock_jitter": _Pair("set_clock_jitter", lambda value: (round(value("jitter_us") * US),), (0,)),
    "terminal.ready_stuck": _Pair("force_ready", lambda value: (value("level"),), (None,)),
    "pto.output_short": _Pair("short_outputs", lambda value: (True, value("channel")), (), "restore_outputs"),
    "pto.supply_off": _Pair("disconnect_load_supply"),
    "pto.module_fault": _Pair("unplug_module"),
    "pto.encoder_error": _Pair(
        "report_encoder_error", lambda value: (value("code"), True), (), "clear_encoder_error"
    ),
    "pto.step_loss": _Pair("lose_steps", lambda value: (value("periods"),), None),
    "mechanics.jam": _Pair("jam"),
    "switch.swapped": _Pair("swap_limit_switches"),
    "mechanics.friction": _Pair("set_added_friction", lambda value: (value("force_N"),), (0.0,), adds=True),
    "mechanics.slip": _Pair("slip_coupling", lambda value: (value("revolutions"),), None),
    "mechanics.coupling_break": _Pair("break_coupling", lambda value: (value("motor_share"),), None),
    "mechanics.backlash": _Pair(
        "set_added_backlash", lambda value: (value("backlash_mm") / 1000.0, value("growth_s")), (0.0,)
    ),
    "mechanics.load_step": _Pair("set_load_force", lambda value: (value("force_N"),), (0.0,), adds=True),
}


_OTHER_METHODS: Final = {"drive.overtemperature": "force_temperature"}


def offered(drive: Any, kind: str) -> bool:
    """Return whether a drive, perhaps of a bench of one's own, has what a kind of fault needs."""
    pair = _PAIRS.get(kind)
    method = _OTHER_METHODS.get(kind) if pair is None else pair.method
    return method is None or callable(getattr(drive, method, None))


def drive_action(bench: Bench, fault: Fault, stream: str) -> Action:
    """Return the action of a fault at a drive, its switches or mechanics.

    Args:
        bench: The bench.
        fault: What to do.
        stream: Name of the random stream of this fault.

    """
    drive = bench.drive(fault.target or None)
    refuse_unless_supported(bench, fault, drive)
    name = str(drive.name)
    value = fault.value

    pair = _PAIRS.get(fault.kind)
    if pair is not None:
        begin = _method(drive, pair.method, fault)
        end = _method(drive, pair.end or pair.method, fault)
        on, off = pair.on(value), pair.off
        if off is None:
            return Action(name, partial(begin, *on), None)
        return Claim(
            bench, (name, pair.method), begin, partial(end, *off), on, combine=total if pair.adds else None
        )
    match fault.kind:
        case "drive.fault":
            trip, code = _method(drive, "raise_fault", fault), value("code")
            if not value("persistent"):
                return Action(name, partial(trip, code, persistent=False), None)
            clear = _method(drive, "clear_fault_cause", fault)
            return Claim(
                bench,
                (name, "fault", code),
                partial(trip, code, persistent=True),
                partial(clear, code),
                anew=True,
            )
        case "drive.overtemperature":
            force, part = _method(drive, "force_temperature", fault), value("part")
            return Claim(
                bench,
                (name, "temperature", part),
                partial(force, part),
                partial(force, part, None),
                (value("temperature_C"),),
            )
        case "drive.power_off":
            return _supply(bench, fault, drive)
        case "switch.inverted":
            invert, switch = _method(drive, "invert_input", fault), value("input")
            return Claim(
                bench,
                (name, "polarity", switch),
                partial(invert, switch, True),
                partial(invert, switch, False),
            )
    switch = value("input")
    force = _method(drive, "force_input", fault)
    level = value("state") if fault.kind == "switch.stuck" else True
    claim = Claim(
        bench, (name, "input", switch), partial(force, switch), partial(force, switch, None), (level,)
    )
    match fault.kind:
        case "switch.press" | "switch.stuck":
            return claim
        case "switch.bounce":
            return Bounce(bench, fault, claim, stream, level=bool(value("state")))
        case "probe.pulse":
            return Action(name, partial(_pulse, bench, claim, value("width_s")), None)
    raise UnsupportedFaultError(f"{fault.kind} has no action at a drive")


def encoder_action(bench: Bench, fault: Fault) -> Action:
    """Return the action of a fault at an encoder: that of a drive, or a device of its own.

    The target is the name of either; without one the first drive is meant, or the first encoder with a node
    of its own for kinds that need one.

    Args:
        bench: The bench.
        fault: What to do.

    """
    own = tuple(getattr(bench, "encoder_names", ()))
    second = getattr(bench, "second_encoder_names", ())
    if (
        fault.target in second
        or fault.target in own
        or (not fault.target and own and fault.kind in OWN_DEVICE_NAMES)
    ):
        device = bench.encoder(fault.target or None)  # type: ignore[attr-defined]  # a bench of one's own may have none
    else:
        device = bench.drive(fault.target or None)
    refuse_unless_supported(bench, fault, device)
    name = str(device.name)
    value = fault.value

    def pair(method: str, on: tuple[Any, ...], off: tuple[Any, ...], *key: Any) -> Action:
        call = _method(device, method, fault)
        return Claim(bench, (name, method, *key), call, partial(call, *off), on)

    def once(method: str, argument: int) -> Action:
        call = _method(device, method, fault)
        return Action(name, lambda: call(argument), None)

    if fault.kind in OWN_DEVICE_NAMES and name not in own:
        raise UnsupportedFaultError(
            f"{fault.kind} cannot be injected: {name} is no encoder with a node of its own; "
            f"there are: {', '.join(own) or 'none'}"
        )
    match fault.kind:
        case "encoder.freeze":
            return pair("freeze_encoder", (True,), (False,))
        case "encoder.index_missing":
            return pair("suppress_index", (True,), (False,))
        case "encoder.jump":
            return once("jump_encoder", int(value("increments")))
        case "encoder.noise":
            return pair("set_encoder_noise", (value("increments"),), (0,))
        case "encoder.reverse":
            return pair("reverse_encoder", (True,), (False,))
        case "encoder.drift":
            return pair("set_encoder_drift", (value("increments_per_s"),), (0.0,))
        case "encoder.scale":
            return pair("set_encoder_scale", (value("factor"),), (1.0,))
        case "encoder.wire_break":
            return pair("break_encoder_wire", (True,), (False,))
        case "encoder.error":
            code = int(value("code"))
            return pair("set_encoder_error", (code, True), (code, False), code)
        case "encoder.step_loss":
            return pair("lose_encoder_steps", (value("every"),), (0,))
        case "encoder.preset":
            return once("preset_encoder", int(value("value")))
        case "encoder.overflow":
            margin = int(value("margin"))
            return once("move_near_overflow", margin if value("end") == "upper" else -margin)
        case "encoder.alarm":
            bit = ALARM_BITS[str(value("alarm"))]
            return pair("set_alarm", (bit, True), (bit, False), bit)
        case "encoder.warning":
            bit = WARNING_BITS[str(value("warning"))]
            return pair("set_warning", (bit, True), (bit, False), bit)
        case "encoder.cycle":
            return pair("force_cycle_time", (value("period_ms"),), (None,))
        case "encoder.clock_drift":
            return pair("set_clock_drift", (value("drift_ppm"),), (0.0,))
        case "encoder.power_off":
            return _supply(bench, fault, device)
        case "encoder.heartbeat_loss":
            return pair("stop_heartbeat", (True,), (False,))
    raise UnsupportedFaultError(f"{fault.kind} has no action at an encoder")


def alarm_action(bench: Bench, fault: Fault) -> Action:
    """Return the action that raises a technology alarm in the controller (STP-551).

    Raises:
        UnsupportedFaultError: The object cannot have this alarm, or not with this reaction.

    """
    axis = bench.axis(fault.target or None)
    alarms = getattr(axis, "alarms", None)
    number, reaction = fault.value("number"), fault.value("reaction")
    check = getattr(getattr(alarms, "engine", None), "check", None)
    if check is not None:
        try:
            check(number, reaction)
        except HilError as error:
            raise UnsupportedFaultError(f"{fault.kind} cannot be injected: {error}") from error
    if not fault.value("persistent"):
        call = _method(alarms, "raise_alarm", fault)
        return Action(str(axis.name), lambda: call(number, reaction=reaction), None)
    cause = _method(alarms, "set_cause", fault)

    def act(wanted: int | None) -> None:
        cause(number, True, reaction=wanted)

    return Claim(bench, (str(axis.name), "cause", number), act, partial(cause, number, False), (reaction,))


def _supply(bench: Bench, fault: Fault, device: Any) -> Action:
    """Return the action that takes the supply away from a device, and gives it back."""
    off, on = _method(device, "power_off", fault), _method(device, "power_on", fault)
    return Claim(bench, (str(device.name), "supply"), off, on, anew=True)


def _pulse(bench: Bench, claim: Claim, width_s: float) -> None:
    """Actuate an input for `width_s`."""
    claim.lay()
    bench.scheduler.after(seconds_to_ns(width_s), claim.withdraw)


class Bounce(Action):
    """An input that toggles with intervals from a seeded stream, and stays at its last level.

    Args:
        bench: The bench.
        fault: Number of pulses, shortest and longest interval.
        claim: On the input; its argument is the level.
        stream: Name of the random stream.
        level: Last level.

    """

    __slots__ = ("_bench", "_claim", "_edges", "_level", "_limits_s", "_rng", "_timers")

    def __init__(self, bench: Bench, fault: Fault, claim: Claim, stream: str, *, level: bool) -> None:
        super().__init__(claim.target, self._begin, self._finish)
        self._bench = bench
        self._claim = claim
        self._level = level
        self._edges = 2 * int(fault.value("pulses"))
        self._limits_s = float(fault.value("shortest_s")), float(fault.value("longest_s"))
        self._rng = bench.rng(stream)
        self._timers: list[Any] = []

    def _begin(self) -> None:
        # The first edge goes to the final level, and an even number of further edges ends there.
        self._claim.lay(self._level)
        when = self._bench.scheduler.now
        level = self._level
        self._timers = []
        for interval in self._rng.uniform(*self._limits_s, self._edges):
            when += seconds_to_ns(float(interval))
            level = not level
            self._timers.append(self._bench.scheduler.at(when, partial(self._claim.lay, level)))

    def _finish(self) -> None:
        for timer in self._timers:
            timer.cancel()
        self._claim.withdraw()
