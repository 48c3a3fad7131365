"""Faults of the controller itself: its operating state and its supply."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final
from weakref import WeakKeyDictionary

from fieldbus.clock import MS
from fieldbus.errors import ConfigurationError, UnsupportedFaultError
from hil.faults._action import Action, refuse_unless_supported

if TYPE_CHECKING:
    from hil.faults._fault import Fault
    from hil.protocols import Bench

_NAME: Final = "controller"


def controller_action(bench: Bench, fault: Fault) -> Action:
    """Return the action of a fault of the controller.

    Raises:
        UnsupportedFaultError: The bench is not the controller of any axis.
        ConfigurationError: The target is another one.

    """
    if fault.target not in ("", _NAME):
        raise ConfigurationError(f"{fault.kind}: target", fault.target, f"{_NAME}, or nothing")
    controller: Any = getattr(bench, "controller", None)
    if controller is None or not getattr(bench, "axis_names", ()):
        raise UnsupportedFaultError(
            f"{fault.kind} cannot be injected: somebody else is the controller of this bench"
        )
    refuse_unless_supported(bench, fault, controller)
    held = _HELD.setdefault(controller, _Held())
    match fault.kind:
        case "controller.stop":
            return Action(_NAME, lambda: held.stop(controller), lambda: held.go_on(controller))
        case "controller.breakpoint":
            return _breakpoint(controller, held)
        case "controller.overrun":
            return _overrun(fault, controller.levels, held)
        case "controller.stall":
            return Action(_NAME, lambda: held.stall(controller, True), lambda: held.stall(controller, False))
        case _:
            return Action(_NAME, lambda: held.cut(controller), lambda: held.supply(controller))


@dataclass(slots=True)
class _Held:
    """What the faults of one controller hold at present: they may overlap, and the last that ends gives it
    free.
    """

    stops: int = 0
    cuts: int = 0
    stalls: int = 0
    times: dict[bool, list[int]] = field(default_factory=lambda: {True: [], False: []})
    """For MC_Servo (True) and MC_Interpolator: the time without faults, then that of every fault, ns."""

    def stop(self, controller: Any) -> None:
        self.stops += 1
        controller.stop("fault")

    def go_on(self, controller: Any) -> None:
        self.stops -= 1
        if not self.stops and controller.state.value != "power off":
            controller.run()

    def cut(self, controller: Any) -> None:
        self.cuts += 1
        controller.power_off()

    def supply(self, controller: Any) -> None:
        self.cuts -= 1
        if self.cuts:
            return
        controller.power_on()
        if self.stops:
            controller.stop("fault")

    def stall(self, controller: Any, stalled: bool) -> None:
        self.stalls += 1 if stalled else -1
        controller.levels.stall(self.stalls > 0)


_HELD: Final[WeakKeyDictionary[Any, _Held]] = WeakKeyDictionary()


def _breakpoint(controller: Any, held: _Held) -> Action:
    """Let the program meet a breakpoint; where none runs it meets none, and nothing goes on afterwards."""
    met: list[bool] = []

    def apply() -> None:
        met.append(controller.state.value == "RUN")
        if met[0]:
            held.stops += 1
            controller.breakpoint()

    def remove() -> None:
        if met.pop():
            held.go_on(controller)

    return Action(_NAME, apply, remove)


def _overrun(fault: Fault, levels: Any, held: _Held) -> Action:
    """Let a level take long, and afterwards as long as before, or as another fault still wants it."""
    servo = fault.value("level") == "servo"
    time_ns = round(float(fault.value("time_ms")) * MS)
    times = held.times[servo]

    def take() -> None:
        if servo:
            levels.set_computing_time(servo_ns=times[-1])
        else:
            levels.set_computing_time(interpolator_ns=times[-1])

    def apply() -> None:
        if not times:
            times.append(levels.computing_time[0 if servo else 1])
        times.append(time_ns)
        take()

    def remove() -> None:
        times.remove(time_ns)
        take()
        if len(times) == 1:
            times.clear()

    return Action(_NAME, apply, remove)
