"""A kind of fault: one definition that says what it is called, what it takes, what it does, and how it ends.

A kind is a `FaultType`. Its effect is a function, checked by mypy, on the protocol
of a seam (`hil.faults.seams`):

    FaultType(
        "drive.sto",
        "The safe-torque-off input opens: torque off at once, no fault",
        Held(HasSafeTorqueOff, lambda drive, _: drive.set_sto(True), lambda drive, _: drive.set_sto(False)),
        seam="drive internals",
        target="drive",
        example={"target": "drive1", "duration_s": 0.5},
    )

The command line, the page of the handbook, and what the process of emulated drives may be asked are
derived from it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any, Generic, Literal, NoReturn, Protocol, TypeVar

from fieldbus.clock import seconds_to_ns
from fieldbus.errors import ConfigurationError, MissingValueError, UnsupportedFaultError
from hil.errors import NotNamedError
from hil.faults._overrides import Override, OverrideStack, newest, shared
from hil.faults._parameters import ENVIRONMENTS, Environment, Parameter, Scalar, Values
from hil.faults.seams import (
    BenchWithAxes,
    BenchWithDrives,
    BenchWithDrivesOfAxes,
    BenchWithEncoders,
    BenchWithSecondEncoders,
    HasSupply,
    Part,
    Physical,
    offers,
    require,
)

if TYPE_CHECKING:
    from fieldbus.clock import Timer
    from hil.faults._trigger import OnFrame
    from hil.protocols import Bench
    from reports.json_types import JsonObject

T = TypeVar("T")
S = TypeVar("S")
Work = Callable[[], None]
TargetKind = Literal[
    "segment", "drive", "axis", "switch", "mechanics", "encoder", "station", "controller", "cam", "proxy"
]


@dataclass(frozen=True)
class Action:
    """Applying a fault and ending it."""

    target: str
    """Name of the part that it hits."""
    apply: Work
    remove: Work | None = None
    """Ends it; None when there is nothing to end."""
    apply_at_frame: Callable[[OnFrame, Work], Work] | None = None
    """Waits for a frame and applies the fault so that this very frame is hit; returns the function
    that ends waiting.

    None: the fault cannot do that itself.
    """


class ReportHit(Protocol):
    """Logs a frame or telegram that is hit."""

    def __call__(self, hit: int, **data: Scalar) -> None:
        """Log the hit with its number."""


@dataclass(frozen=True, kw_only=True)
class Injection:
    """One fault that is to be injected: what its effect needs to know."""

    bench: Bench
    kind: FaultType
    target: str
    """Name that was given; empty: the only part, or the default one."""
    values: Values
    count: int | None
    """How many frames or telegrams are hit; None: no limit."""
    has_end: bool
    """Whether a duration or a trigger ends it."""
    stream: str
    """Name of its random stream."""
    ended: Work
    """To be called when it ends by itself."""
    report_hit: ReportHit

    def refuse(self, reason: str) -> NoReturn:
        """Raise `UnsupportedFaultError`: this bench cannot inject the fault."""
        raise UnsupportedFaultError(f"{self.kind.name} cannot be injected: {reason}")

    def wrong(self, parameter: str, allowed: str, value: Scalar | None = None) -> ConfigurationError:
        """Return the error that a parameter, or a part of its value, is not allowed on this bench."""
        shown = self.values.get(parameter) if value is None else value
        return ConfigurationError(f"{self.kind.name}.parameters.{parameter}", shown, allowed)

    def check_environment(self, part: object) -> None:
        """Raise `UnsupportedFaultError` when the kind cannot be injected where a part lives."""
        where = environment(self.bench, part)
        reason = self.kind.injectable(where)
        if reason:
            raise UnsupportedFaultError(f"{self.kind.name} cannot be injected on a {where} bench: {reason}")

    def require(self, part: Part, seam: type[T]) -> T:
        """Return a part as what the kind needs; `UnsupportedFaultError` if it lacks something."""
        return require(part, seam, self.kind.name)

    def override(
        self,
        key: tuple[Scalar | None, ...],
        setting: S,
        operate: Callable[[Sequence[S]], object],
        restore: Callable[[], object],
        *,
        effective: Callable[[Sequence[S]], object] = newest,
        repeat: bool = False,
    ) -> Override[S]:
        """Return an override of what the key names: the part first, then what is operated there."""
        stack = shared(
            self.bench,
            key,
            lambda: OverrideStack(operate, restore, effective=effective, repeat=repeat),
        )
        return Override(stack, setting)


def environment(bench: Bench, part: object) -> Environment:
    """Return where a part of the bench lives: `virtual`, `live` (emulated elsewhere) or `hardware`."""
    if offers(part, Physical) and part.physical:
        return "hardware"
    return "virtual" if bench.kind == "virtual" else "live"


def override_action(target: str, *overrides: Override[S]) -> Action:
    """Return the action that applies and removes overrides together."""

    def apply() -> None:
        for one in overrides:
            one.apply()

    def remove() -> None:
        for one in overrides:
            one.remove()

    return Action(target, apply, remove)


# -- the part that is hit --------------------------------------------------------------------------------


def find_drive(injection: Injection) -> Part:
    """Return the drive that is meant; without a name the only one."""
    drive: Part = injection.bench.drive(drive_meant(injection))
    injection.check_environment(drive)
    return drive


def drive_meant(injection: Injection, names: Sequence[str] | None = None) -> str | None:
    """Return the name of the drive that is meant; None: the bench has no names.

    Args:
        injection: The fault.
        names: Drives that can be meant; None: all.

    Raises:
        NotNamedError: An axis is named, or nothing where there are several drives.

    """
    bench, target = injection.bench, injection.target
    where = f"{injection.kind.name}: target"
    if not target:
        if names is None:
            names = bench.drive_names if offers(bench, BenchWithDrives) else ()
        if len(names) > 1:
            raise NotNamedError(where, "drive", names)
        return names[0] if names else None
    if _is_axis(bench, target) and offers(bench, BenchWithDrivesOfAxes):
        raise NotNamedError(f"{where} {target!r} is an axis", "drive", [bench.drive_of(target)])
    return target


def find_axis(injection: Injection) -> Part:
    """Return the axis that is meant; without a name the only one.

    Raises:
        NotNamedError: A drive is named, or nothing where there are several axes.

    """
    bench, target = injection.bench, injection.target
    where = f"{injection.kind.name}: target"
    names = bench.axis_names if offers(bench, BenchWithAxes) else ()
    if not target and len(names) > 1:
        raise NotNamedError(where, "axis", names)
    if target and target not in names and offers(bench, BenchWithDrivesOfAxes):
        moved = [name for name in names if bench.drive_of(name) == target]
        if moved:
            raise NotNamedError(f"{where} {target!r} is a drive", "axis", moved)
    axis: Part = bench.axis(target or None)
    return axis


def _is_axis(bench: Bench, name: str) -> bool:
    return offers(bench, BenchWithAxes) and name in bench.axis_names


def encoder_names(bench: Bench) -> tuple[str, ...]:
    """Return the names of the encoders that are devices of their own."""
    return tuple(bench.encoder_names) if offers(bench, BenchWithEncoders) else ()


def find_encoder(injection: Injection) -> Part:
    """Return the encoder that is meant: of a drive, by its name or without one, or a device of its own."""
    bench, target = injection.bench, injection.target
    if offers(bench, BenchWithEncoders) and (
        target in bench.encoder_names
        or (offers(bench, BenchWithSecondEncoders) and target in bench.second_encoder_names)
    ):
        encoder: Part = bench.encoder(target)
        injection.check_environment(encoder)
        return encoder
    return find_drive(injection)


def find_own_encoder(injection: Injection) -> Part:
    """Return the encoder that is meant; without a name the first one that is a device of its own."""
    bench = injection.bench
    own = encoder_names(bench)
    if not injection.target and own and offers(bench, BenchWithEncoders):
        encoder: Part = bench.encoder(None)
        injection.check_environment(encoder)
    else:
        encoder = find_encoder(injection)
    if encoder.name not in own:
        injection.refuse(
            f"{encoder.name} is no encoder with a node of its own; there are: {', '.join(own) or 'none'}"
        )
    return encoder


# -- effects ---------------------------------------------------------------------------------------------


class Effect(Protocol):
    """What a kind of fault does."""

    @property
    def needs(self) -> type | None:
        """Protocol that the part has to offer; None: it is found out otherwise."""

    def __call__(self, injection: Injection) -> Action:
        """Return the action of one fault.

        Raises:
            UnsupportedFaultError: The bench cannot inject it; the message says why.
            ConfigurationError: It names a part that the bench does not have.

        """


@dataclass(frozen=True)
class Held(Generic[T]):
    """A state of a part that is held until the fault is removed; overlapping faults stack.

    Args:
        needs: Protocol of the seam.
        begin: Brings the part into the state, given the parameters.
        end: Brings it out of it.
        per: Parameters that distinguish targets at the same part, an input for example.
        repeat: A new fault acts also when the state is held already: the part may have recovered.
        find: Finds the part.

    """

    needs: type[T]
    begin: Callable[[T, Values], object]
    end: Callable[[T, Values], object]
    per: tuple[str, ...] = ()
    repeat: bool = False
    find: Callable[[Injection], Part] = find_drive

    def __call__(self, injection: Injection) -> Action:
        """Return the action of one fault."""
        values, found = injection.values, self.find(injection)
        part = injection.require(found, self.needs)
        override = injection.override(
            (found.name, injection.kind.name, *map(values.get, self.per)),
            values,
            lambda settings: self.begin(part, settings[-1]),
            lambda: self.end(part, values),
            repeat=self.repeat,
        )
        return override_action(found.name, override)


@dataclass(frozen=True)
class Summed(Generic[T]):
    """A quantity at a part; those of overlapping faults add up, as forces do.

    Args:
        needs: Protocol of the seam.
        parameter: Name of the quantity.
        set: Sets the sum; 0 when no fault is left.
        find: Finds the part.

    """

    needs: type[T]
    parameter: str
    set: Callable[[T, float], object]
    find: Callable[[Injection], Part] = find_drive

    def __call__(self, injection: Injection) -> Action:
        """Return the action of one fault."""
        found = self.find(injection)
        part = injection.require(found, self.needs)
        override = injection.override(
            (found.name, injection.kind.name),
            injection.values.number(self.parameter),
            lambda settings: self.set(part, sum(settings)),
            lambda: self.set(part, 0.0),
            effective=sum,
        )
        return override_action(found.name, override)


@dataclass(frozen=True)
class Once(Generic[T]):
    """Something that happens to a part and is over at once.

    Args:
        needs: Protocol of the seam.
        happen: Lets it happen, given the parameters.
        find: Finds the part.

    """

    needs: type[T]
    happen: Callable[[T, Values], object]
    find: Callable[[Injection], Part] = find_drive

    def __call__(self, injection: Injection) -> Action:
        """Return the action of one fault."""
        found = self.find(injection)
        part = injection.require(found, self.needs)

        def apply() -> None:
            self.happen(part, injection.values)

        return Action(found.name, apply)


def toggled(
    needs: type[T], set_active: Callable[[T, bool], object], find: Callable[[Injection], Part] = find_drive
) -> Held[T]:
    """Return the effect of a state that a call with True begins and one with False ends."""
    return Held(
        needs, lambda part, _: set_active(part, True), lambda part, _: set_active(part, False), find=find
    )


@dataclass(frozen=True)
class SupplyCut:
    """The control supply of a part is off until the fault is removed."""

    find: Callable[[Injection], Part] = find_drive
    needs: type[HasSupply] = HasSupply

    def __call__(self, injection: Injection) -> Action:
        """Return the action of one fault."""
        found = self.find(injection)
        part = injection.require(found, self.needs)
        override = injection.override(
            (found.name, "supply"), True, lambda _: part.power_off(), part.power_on, repeat=True
        )
        return override_action(found.name, override)


@dataclass(frozen=True)
class Custom:
    """An effect of its own.

    Args:
        make: Returns the action of one fault.
        needs: Protocol that the part has to offer, where it is one.

    """

    make: Callable[[Injection], Action]
    needs: type | None = None

    def __call__(self, injection: Injection) -> Action:
        """Return the action of one fault."""
        return self.make(injection)


def bouncing(
    injection: Injection, target: str, level: Override[bool] | Override[float], final: bool
) -> Action:
    """Return the action that toggles an input with intervals from the seeded stream and leaves it at
    its final level.

    The parameters are `pulses`, `shortest_s` and `longest_s`.
    """
    scheduler, values = injection.bench.scheduler, injection.values
    rng = injection.bench.rng(injection.stream)
    edges = 2 * values.integer("pulses")
    timers: list[Timer] = []

    def apply() -> None:
        # The first edge goes to the final level, and an even number of further edges ends there.
        level.change(final)
        when, state = scheduler.now, final
        timers.clear()
        for interval in rng.uniform(values.number("shortest_s"), values.number("longest_s"), edges):
            when += seconds_to_ns(float(interval))
            state = not state
            timers.append(scheduler.at(when, partial(level.change, state)))

    def remove() -> None:
        for timer in timers:
            timer.cancel()
        level.remove()

    return Action(target, apply, remove)


# -- the definition of a kind ----------------------------------------------------------------------------


@dataclass(frozen=True)
class FaultType:
    """The definition of a kind of fault."""

    name: str
    summary: str
    """One sentence without the full stop."""
    effect: Effect
    _: KW_ONLY
    seam: str
    """Where in the bench the fault is applied."""
    target: TargetKind
    """What kind of thing is hit; switch, mechanics and encoder are addressed by the name of their
    drive, an encoder with a node of its own by its own."""
    parameters: tuple[Parameter, ...] = ()
    lasting: bool = True
    """Whether it stays until removed; False: it is over the moment it is applied."""
    refused: Mapping[Environment, str] = field(default_factory=dict)
    """Where it cannot be injected, and why."""
    remark: str = ""
    example: Mapping[str, Any] = field(default_factory=dict)
    """Target, end, count and parameters of an example."""
    text: str = ""
    """What the handbook says in place of the summary."""
    check_values: Callable[[str, Values], None] | None = None
    """Raises `ConfigurationError` for parameters that contradict each other."""
    counted: bool = False
    """Whether `count` says how many frames or telegrams are hit."""
    fuzzed: bool = True
    """Whether a fuzz search injects it.

    It leaves out what the reference benches do not have; what needs the name of a node, or silences the bus
    until nothing is left to see; drives that show something wrong or do not follow commands; wrong clocks,
    under which no rule can hold; milder forms of other kinds; and kinds without a visible effect.
    """

    def __post_init__(self) -> None:
        object.__setattr__(self, "example", {"kind": self.name, **self.example})

    def parameter(self, name: str) -> Parameter:
        """Return the description of a parameter; `ConfigurationError` when there is none."""
        for parameter in self.parameters:
            if parameter.name == name:
                return parameter
        allowed = ", ".join(parameter.name for parameter in self.parameters) or "no parameters"
        raise ConfigurationError(f"{self.name}.parameters", name, allowed)

    def has(self, parameter: str) -> bool:
        """Return whether the kind has a parameter."""
        return any(one.name == parameter for one in self.parameters)

    def check(self, values: Mapping[str, object]) -> dict[str, Scalar]:
        """Return the given parameters, validated, in the order of the definition.

        Raises:
            ConfigurationError: Unknown name, wrong type, outside the range, a required one is missing,
                or they contradict each other.

        """
        for name in values:
            self.parameter(name)
        checked: dict[str, Scalar] = {}
        for parameter in self.parameters:
            if parameter.name in values:
                checked[parameter.name] = parameter.check(f"{self.name}.parameters", values[parameter.name])
            elif parameter.required:
                raise MissingValueError(f"{self.name}.parameters.{parameter.name}", parameter.allowed)
        if self.check_values is not None:
            self.check_values(self.name, self.values(checked))
        return checked

    def values(self, given: Mapping[str, Scalar]) -> Values:
        """Return checked parameters with the defaults of those that are not given."""
        return Values(self.parameters, given)

    def injectable(self, environment: Environment) -> str:
        """Return why the fault cannot be injected there; empty when it can."""
        return self.refused.get(environment, "")

    @property
    def example_call(self) -> str:
        """The example as a call of the injector."""
        example = self.example
        options = {key: example[key] for key in ("duration_s", "count") if key in example}
        arguments = [repr(self.name), *([repr(example["target"])] if example.get("target") else [])]
        arguments += [
            f"{name}={value!r}" for name, value in {**options, **example.get("parameters", {})}.items()
        ]
        return f"faults.inject({', '.join(arguments)})".replace("'", '"')

    def to_dict(self) -> JsonObject:
        """Return the description as JSON values."""
        return {
            "name": self.name,
            "summary": self.summary,
            "target": self.target,
            "targets": [self.target],
            "seam": self.seam,
            "lasting": self.lasting,
            "parameters": [parameter.to_dict() for parameter in self.parameters],
            "benches": {
                environment: {
                    "injectable": not self.injectable(environment),
                    "reason": self.injectable(environment),
                }
                for environment in ENVIRONMENTS
            },
            "remark": self.remark,
            "example": dict(self.example),
        }


@dataclass(frozen=True)
class Family:
    """Kinds that stand together in the handbook."""

    kinds: tuple[FaultType, ...]
    title: str = ""
    """Heading above them; empty: they follow the ones before without one."""
    text: str = ""
    """What they have in common."""
    shared: tuple[Parameter, ...] = ()
    """Parameters that all of them have, described once below the text."""


def check_intervals(kind: str, values: Values) -> None:
    """Raise `ConfigurationError` if `shortest_s` is longer than `longest_s`."""
    if values.number("shortest_s") > values.number("longest_s"):
        raise ConfigurationError(
            f"{kind}.parameters.shortest_s",
            values.get("shortest_s"),
            f"at most longest_s = {values.number('longest_s'):g} s",
        )
