"""What a copy of the bench is broken with: a kind of fault or an operator action, as a value."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from fieldbus.errors import ConfigurationError, UnknownNameError
from hil.envelope._actions import ACTIONS, first_axis
from hil.faults import CATALOGUE, Fault, Injector, at
from hil.faults._parameters import Scalar
from hil.faults._text import number, split_text

if TYPE_CHECKING:
    from hil.bench.bench import Bench

_NEVER_S = 1e6


@dataclass(frozen=True)
class Stimulus:
    """A fault (`hil faults` has the kinds) or an operator action (`ACTIONS`), applied at once.

    Raises:
        ConfigurationError: There is no such kind or parameter, or it cannot have the value.

    """

    kind: str
    target: str = ""
    """Part of the bench: a drive, segment or axis; empty: the only one."""
    parameters: Mapping[str, Scalar] = field(default_factory=dict)
    duration_s: float | None = None
    """A fault that lasts is taken back after this time; None: it stays."""

    def __post_init__(self) -> None:
        if self.kind in ACTIONS:
            object.__setattr__(self, "parameters", ACTIONS[self.kind].check(self.parameters))
            if self.duration_s is not None:
                raise ConfigurationError(
                    f"{self.kind}.duration_s", self.duration_s, "nothing: it is no fault"
                )
        elif any(entry.name == self.kind for entry in CATALOGUE):
            self._fault()
        else:
            names = [*ACTIONS, *(entry.name for entry in CATALOGUE)]
            raise UnknownNameError("envelope", self.kind, "a fault or operator action", names)

    def __hash__(self) -> int:
        return hash(str(self))

    def __str__(self) -> str:
        """Return it as `stimulus_from_text` reads it: `drive.fault@drive1:code=8976`."""
        values = [f"{key}={value}" for key, value in self.parameters.items()]
        if self.duration_s is not None:
            values.append(f"duration_s={self.duration_s:g}")
        target = f"@{self.target}" if self.target else ""
        return f"{self.kind}{target}" + (":" + ",".join(values) if values else "")

    def _fault(self, *, never: bool = False) -> Fault:
        if never:
            return Fault(self.kind, self.target, at(_NEVER_S), None, self.duration_s, None, self.parameters)
        return Fault(self.kind, self.target, duration_s=self.duration_s, parameters=dict(self.parameters))

    def check(self, bench: Bench) -> None:
        """Make sure that a bench can take it, without applying it.

        Raises:
            ConfigurationError: The bench has no such part.
            UnsupportedFaultError: The bench cannot inject the fault; the message says why.

        """
        if self.kind in ACTIONS:
            if self.target and self.target not in bench.config.axis:
                raise UnknownNameError("envelope", self.target, "an axis", list(bench.config.axis))
            return
        injector = Injector(bench)
        injector.arm(self._fault(never=True))
        injector.remove_all()

    def apply(self, bench: Bench) -> None:
        """Apply it at the present time."""
        action = ACTIONS.get(self.kind)
        if action is None:
            Injector(bench).arm(self._fault())
            return
        axis = self.target or first_axis(bench)
        bench.history.emit(axis, "envelope.action", action=self.kind, **self.parameters)
        action.act(bench, axis, self.parameters)


def stimulus_from_text(text: str) -> Stimulus:
    """Read `KIND[@TARGET][:KEY=VALUE,...]`: `drive.fault@drive1:code=0x2310`, `operator.disable:stop_mode=2`,
    `drive.sto:duration_s=0.5`.

    Raises:
        ConfigurationError: It is written otherwise, or as of `Stimulus`.

    """
    kind, target, parameters = split_text(text, where="envelope")
    duration_s = number(parameters, "duration_s", kind)
    return Stimulus(kind, target, parameters, duration_s)
