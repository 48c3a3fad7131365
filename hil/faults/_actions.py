"""What a fault does to the bench: one action per kind, with the way back."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, Final, NamedTuple

from fieldbus.clock import seconds_to_ns
from fieldbus.errors import HilError, UnsupportedFaultError
from hil.faults._encoder_kinds import ALARM_BITS, OWN_DEVICE_NAMES, WARNING_BITS
from hil.faults._fault import Fault
from hil.faults._parameters import Environment
from hil.protocols import Bench

Work = Callable[[], None]


class Action:
    """Applying a fault and taking it back.

    Args:
        target: Resolved name of what is broken.
        apply: Breaks it.
        remove: Mends it; None when there is nothing to mend.

    """

    __slots__ = ("apply", "remove", "target")

    def __init__(self, target: str, apply: Work, remove: Work | None) -> None:
        self.target = target
        self.apply = apply
        self.remove = remove


def environment(bench: Bench, part: Any) -> Environment:
    """Return where a part of the bench lives: `virtual`, `live` (emulated elsewhere) or `hardware`."""
    if getattr(part, "physical", False):
        return "hardware"
    return "virtual" if bench.kind == "virtual" else "live"


def refuse_unless_supported(bench: Bench, fault: Fault, part: Any) -> None:
    """Raise `UnsupportedFaultError` when the catalogue says that the fault cannot be injected there."""
    where = environment(bench, part)
    reason = fault.entry.injectable(where)
    if reason:
        raise UnsupportedFaultError(f"{fault.kind} cannot be injected on a {where} bench: {reason}")


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
    "drive.mains_off": _Pair("cut_mains"),
    "drive.phase_loss": _Pair("cut_phase"),
    "drive.dc_link": _Pair("set_dc_link_voltage", lambda value: (value("voltage_V"),), (), "restore_dc_link"),
    "drive.chopper_failure": _Pair("break_chopper"),
    "drive.torque_limit": _Pair("limit_torque", lambda value: (value("share"),), (None,)),
    "drive.brake_stuck": _Pair("stick_brake", lambda value: (value("closed"),), (None,)),
    "drive.brake_slip": _Pair("slip_brake", lambda value: (value("share"),), (1.0,)),
    "drive.slow_ramp": _Pair("scale_ramps", lambda value: (value("share"),), (1.0,)),
    "drive.local_control": _Pair("set_local_control"),
    "drive.refuse_transition": _Pair("refuse_transitions", lambda value: (value("transition"),), ()),
    "drive.switch_on_disabled": _Pair("fall_to_switch_on_disabled", lambda _value: (), None),
    "drive.warning": _Pair("show_warning"),
    "drive.statusword_stuck": _Pair("freeze_statusword"),
    "drive.statusword_bits": _Pair("lie_in_statusword", lambda value: (value("set"), value("clear")), (0, 0)),
    "drive.target_toggle": _Pair("toggle_target_reached", lambda value: (value("period_s"),), (None,)),
    "drive.mode_display": _Pair("show_mode_as", lambda value: (value("mode"),), (None,)),
    "drive.reset": _Pair("reset_node", lambda value: (value("boot_s"),), None),
    "drive.sdo_abort": _Pair("abort_sdo", lambda value: (value("code"), value("index")), (None,)),
    "drive.sdo_timeout": _Pair("silence_sdo"),
    "drive.emcy_storm": _Pair("storm_emcy", lambda value: (value("code"), value("period_s")), (None,)),
    "terminal.ready_stuck": _Pair("force_ready", lambda value: (value("level"),), (None,)),
    "pto.output_short": _Pair("short_outputs", lambda value: (True, value("channel")), (), "mend_outputs"),
    "pto.supply_off": _Pair("cut_supply"),
    "pto.module_fault": _Pair("fail_module"),
    "pto.encoder_error": _Pair(
        "report_encoder_error", lambda value: (value("code"), True), (), "heal_encoder"
    ),
    "pto.step_loss": _Pair("lose_steps", lambda value: (value("periods"),), None),
    "mechanics.jam": _Pair("jam"),
    "switch.swapped": _Pair("swap_limit_switches"),
    "mechanics.friction": _Pair("add_friction", lambda value: (value("force_N"),), (0.0,)),
    "mechanics.slip": _Pair("slip_coupling", lambda value: (value("revolutions"),), None),
    "mechanics.coupling_break": _Pair("break_coupling", lambda value: (value("motor_share"),), None),
    "mechanics.load_step": _Pair("load_force", lambda value: (value("force_N"),), (0.0,)),
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
        return Action(name, lambda: begin(*on), None if off is None else lambda: end(*off))
    match fault.kind:
        case "drive.fault":
            trip = _method(drive, "raise_fault", fault)
            persistent = bool(value("persistent"))
            clear = _method(drive, "clear_fault_cause", fault) if persistent else None
            return Action(name, lambda: trip(value("code"), persistent=persistent), clear)
        case "drive.overtemperature":
            force = _method(drive, "force_temperature", fault)
            part = value("part")
            return Action(name, lambda: force(part, value("temperature_C")), lambda: force(part, None))
        case "drive.power_off":
            return Action(name, _method(drive, "power_off", fault), _method(drive, "power_on", fault))
        case "switch.press":
            force = _method(drive, "force_input", fault)
            return Action(name, lambda: force(value("input"), True), lambda: force(value("input"), None))
        case "switch.stuck":
            force = _method(drive, "force_input", fault)
            return Action(
                name, lambda: force(value("input"), value("state")), lambda: force(value("input"), None)
            )
        case "switch.inverted":
            invert = _method(drive, "invert_input", fault)
            return Action(name, lambda: invert(value("input"), True), lambda: invert(value("input"), False))
        case "switch.bounce":
            bounce = _Bounce(bench, fault, _method(drive, "force_input", fault), stream)
            return Action(name, bounce.apply, bounce.remove)
        case "probe.pulse":
            force = _method(drive, "force_input", fault)
            return Action(name, lambda: _pulse(bench, force, value("input"), value("width_s")), None)
    raise UnsupportedFaultError(f"{fault.kind} has no action at a drive")


def encoder_action(bench: Bench, fault: Fault) -> Action:
    """Return the action of a fault at an encoder: that of a drive, or a device of its own.

    The target is the name of either; without one the first drive is meant, or the first encoder with a node of its own for
    kinds that need one.

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

    def pair(method: str, on: tuple[Any, ...], off: tuple[Any, ...]) -> Action:
        call = _method(device, method, fault)
        return Action(name, lambda: call(*on), lambda: call(*off))

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
            return pair("miss_index", (True,), (False,))
        case "encoder.jump":
            return once("jump_encoder", int(value("increments")))
        case "encoder.noise":
            return pair("set_encoder_noise", (value("increments"),), (0,))
        case "encoder.reverse":
            return pair("reverse_encoder", (True,), (False,))
        case "encoder.drift":
            return pair("drift_encoder", (value("increments_per_s"),), (0.0,))
        case "encoder.scale":
            return pair("scale_encoder", (value("factor"),), (1.0,))
        case "encoder.wire_break":
            return pair("break_encoder", (True,), (False,))
        case "encoder.error":
            code = int(value("code"))
            return pair("set_encoder_error", (code, True), (code, False))
        case "encoder.step_loss":
            return pair("lose_encoder_steps", (value("every"),), (0,))
        case "encoder.preset":
            return once("preset_encoder", int(value("value")))
        case "encoder.overflow":
            margin = int(value("margin"))
            return once("near_overflow", margin if value("end") == "upper" else -margin)
        case "encoder.alarm":
            bit = ALARM_BITS[str(value("alarm"))]
            return pair("set_alarm", (bit, True), (bit, False))
        case "encoder.warning":
            bit = WARNING_BITS[str(value("warning"))]
            return pair("set_warning", (bit, True), (bit, False))
        case "encoder.cycle":
            return pair("force_cycle_time", (value("period_ms"),), (None,))
        case "encoder.power_off":
            return Action(name, _method(device, "power_off", fault), _method(device, "power_on", fault))
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
    return Action(
        str(axis.name),
        lambda: cause(number, True, reaction=reaction),
        lambda: cause(number, False, reaction=reaction),
    )


def _pulse(bench: Bench, force: Callable[..., Any], name: str, width_s: float) -> None:
    """Actuate an input for `width_s`."""
    force(name, True)
    bench.scheduler.after(seconds_to_ns(width_s), partial(force, name, None))


class _Bounce:
    """A switch that toggles with intervals from a seeded stream."""

    __slots__ = ("_bench", "_fault", "_force", "_rng", "_timers")

    def __init__(self, bench: Bench, fault: Fault, force: Callable[..., Any], stream: str) -> None:
        self._bench = bench
        self._fault = fault
        self._force = force
        self._rng = bench.rng(stream)
        self._timers: list[Any] = []

    def apply(self) -> None:
        value = self._fault.value
        name, final = value("input"), bool(value("state"))
        edges = 2 * int(value("pulses"))
        intervals = self._rng.uniform(float(value("shortest_s")), float(value("longest_s")), edges)
        # The first edge goes to the final state, and an even number of further edges ends there.
        self._force(name, final)
        when = self._bench.scheduler.now
        state = final
        self._timers = []
        for interval in intervals:
            when += seconds_to_ns(float(interval))
            state = not state
            self._timers.append(self._bench.scheduler.at(when, partial(self._force, name, state)))

    def remove(self) -> None:
        for timer in self._timers:
            timer.cancel()
        self._force(self._fault.value("input"), None)
