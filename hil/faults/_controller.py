"""Faults of the controller itself: its operating state and its supply."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final

from fieldbus.clock import MS
from fieldbus.errors import ConfigurationError, UnsupportedFaultError
from hil.faults._actions import Action, refuse_unless_supported

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
    apply: Callable[[], None]
    match fault.kind:
        case "controller.stop":
            apply, remove = lambda: controller.stop("fault"), controller.run
        case "controller.breakpoint":
            apply, remove = lambda: _break(controller), controller.run
        case "controller.overrun":
            return _overrun(fault, controller.levels)
        case "controller.stall":
            apply, remove = lambda: controller.levels.stall(True), lambda: controller.levels.stall(False)
        case _:
            apply, remove = controller.power_off, controller.power_on
    return Action(_NAME, apply, remove)


def _break(controller: Any) -> None:
    """Let the program meet a breakpoint, where it runs at that moment."""
    if controller.state.value != "RUN":
        raise UnsupportedFaultError(
            f"controller.breakpoint cannot be injected: the controller is in {controller.state.value}, and no program runs"
        )
    controller.breakpoint()


def _overrun(fault: Fault, levels: Any) -> Action:
    """Let a level take long, and afterwards as long as before."""
    servo = fault.value("level") == "servo"
    time_ns = round(float(fault.value("time_ms")) * MS)
    before: list[int] = []

    def take(nanoseconds: int) -> None:
        if servo:
            levels.set_computing_time(servo_ns=nanoseconds)
        else:
            levels.set_computing_time(interpolator_ns=nanoseconds)

    def apply() -> None:
        before.append(levels.computing_time[0 if servo else 1])
        take(time_ns)

    return Action(_NAME, apply, lambda: take(before.pop()))
