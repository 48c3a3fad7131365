"""What an operator can do to an axis in the middle of a motion."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from fieldbus.errors import ConfigurationError

if TYPE_CHECKING:
    from hil.bench.bench import Bench
    from hil.faults._parameters import Scalar


@dataclass(frozen=True)
class OperatorAction:
    """An instruction that is given to an axis."""

    name: str
    text: str
    """What it does, for help and handbook."""
    parameters: Mapping[str, tuple[Scalar, ...]]
    """Values that each parameter may have; the first is the default."""
    act: Callable[[Bench, str, Mapping[str, Scalar]], object]
    """Does it: bench, name of the axis, parameters."""

    def check(self, given: Mapping[str, Scalar]) -> dict[str, Scalar]:
        """Return all parameters.

        Raises:
            ConfigurationError: There is no such parameter, or it cannot have the value.

        """
        for key, value in given.items():
            if key not in self.parameters:
                names = ", ".join(self.parameters) or "none"
                raise ConfigurationError(f"{self.name}.{key}", value, f"parameters of {self.name}: {names}")
            if value not in self.parameters[key]:
                raise ConfigurationError(
                    f"{self.name}.{key}", value, ", ".join(str(one) for one in self.parameters[key])
                )
        return {key: given.get(key, values[0]) for key, values in self.parameters.items()}


def first_axis(bench: Bench) -> str:
    """Return the first axis of a bench, technology objects before axes of an NC."""
    return (*bench.axis_names, *bench.nc_axis_names)[0]


def _is_nc(bench: Bench, axis: str) -> bool:
    return bench.config.axis[axis].controller == "nc"


def _disable(bench: Bench, axis: str, values: Mapping[str, Scalar]) -> object:
    if _is_nc(bench, axis):
        return bench.axis(axis, controller="nc").power(False)
    return bench.axis(axis).power(False, stop_mode=int(values["stop_mode"] or 0))


def _halt(bench: Bench, axis: str, _: Mapping[str, Scalar]) -> object:
    return (bench.axis(axis, controller="nc") if _is_nc(bench, axis) else bench.axis(axis)).halt()


def _stop(bench: Bench, axis: str, values: Mapping[str, Scalar]) -> object:
    if _is_nc(bench, axis):
        return bench.axis(axis, controller="nc").stop()
    return bench.axis(axis).stop(mode=int(values["mode"] or 0))


ACTIONS: Final[dict[str, OperatorAction]] = {
    one.name: one
    for one in (
        OperatorAction(
            "operator.disable",
            "`MC_Power` with `Enable` FALSE; an NC axis has no stop mode.",
            {"stop_mode": (0, 1, 2, 3)},
            _disable,
        ),
        OperatorAction("operator.halt", "`MC_Halt`.", {}, _halt),
        OperatorAction("operator.stop", "`MC_Stop`; an NC axis has no mode.", {"mode": (0, 2, 3)}, _stop),
    )
}
"""Operator actions by name."""
