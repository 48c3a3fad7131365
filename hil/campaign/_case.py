"""Cases and campaigns: what is to be run, as data and functions. Nothing here runs anything."""

from __future__ import annotations

import importlib
import inspect
import itertools
import re
import string
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Final

from fieldbus.errors import ConfigurationError
from hil.bench.makes import NC_BENCH
from hil.campaign._controllers import CONTROLLERS, Counterpart, NotApplicable, Rule
from hil.configurations.factors import CONFIGURATION
from hil.configurations.needs import ANY, Needs

if TYPE_CHECKING:
    from hil.campaign._context import CaseContext

CaseFunction = Callable[..., object]
Requirements = Sequence[str] | Callable[..., Iterable[str]]
Needed = Mapping[str, str | Sequence[str]]
"""What a case needs of a bench, as `hil.configurations.Needs.of` reads it."""

SIMULATED_LIMIT_S: Final = 120.0
WALL_LIMIT_S: Final = 300.0
ON: Final = "@"
"""Between the identifier of a case and the name of the configuration, or the make of the controller, that it
runs on.
"""


def slug(text: str) -> str:
    """Return `text` as part of an identifier: lower case, parts joined by dashes, `/` and `.` kept."""
    return re.sub(r"[^a-z0-9/._]+", "-", text.lower()).strip("-")


@dataclass(frozen=True)
class Case:
    """One test case; made by the decorators of `Campaign`."""

    identifier: str
    """Stable name, unique in a run: `stop-modes/mc-power-0/constant`."""
    title: str
    group: str
    function: CaseFunction
    """Called with a `CaseContext` and the parameters."""
    parameters: Mapping[str, object] = field(default_factory=dict)
    tags: tuple[str, ...] = ()
    requirements: tuple[str, ...] = ()
    bench: str = ""
    """Bench that the case is written for; used when the user names none."""
    signals: tuple[str, ...] = ()
    """Signals kept in the report; empty: the usual ones; `("*",)`: all."""
    without: tuple[str, ...] = ()
    """Requirement identifiers whose always-on checkers do not apply to this case."""
    simulated_limit_s: float = SIMULATED_LIMIT_S
    wall_limit_s: float = WALL_LIMIT_S
    seed: int | None = None
    """Seed of the bench where it belongs to the case; None: made from the seed of the run and the identifier.
    """

    needs: Needs = ANY
    """What it needs of a configuration that it is to run on."""
    controller: str = ""
    """Make of the controller that the user asked for, one of `CONTROLLERS`; empty: that of the bench."""
    refusal: str = ""
    """Why it cannot run on that make; empty: it can."""
    own_numbers: bool = False
    """Its numbers are those of its bench, so that it runs on no configuration."""

    def on(self, configuration: str) -> Case:
        """Return the case as it runs on a configuration.

        Args:
            configuration: Name of a configuration.

        """
        make = NC_BENCH if self.bench.startswith(NC_BENCH) else ""
        return replace(
            self,
            identifier=f"{self.identifier}{ON}{configuration}",
            bench=f"{make}{CONFIGURATION}{configuration}",
        )

    def call(self, context: CaseContext) -> None:
        """Run the function of the case."""
        self.function(context, **self.parameters)


class Campaign:
    """A named collection of cases, filled by decorators.

    Args:
        title: Name; its slug begins the identifiers of the cases.
        tags: Tags of all cases.
        requirements: Identifiers of the specification that every case checks.
        bench: Bench that the cases are written for (an embedded name or a path),
            used when the user names none.
        signals: Signals kept in the report; empty: the usual ones.
        needs: What its cases need of a configuration: values by name of a factor.
        controller: Make of controller that its cases are written for, a word of `--controllers`; empty: they
            lead their devices as a plain master.

    Raises:
        ConfigurationError: The title has neither letters nor digits, or there is no such make.

    """

    def __init__(
        self,
        title: str,
        *,
        tags: Sequence[str] = (),
        requirements: Sequence[str] = (),
        bench: str = "",
        signals: Sequence[str] = (),
        needs: Needed | None = None,
        controller: str = next(iter(CONTROLLERS)),
    ) -> None:
        if controller and controller not in CONTROLLERS:
            raise ConfigurationError("campaign controller", controller, ", ".join(CONTROLLERS))
        if not slug(title):
            raise ConfigurationError("campaign title", title, "a text with letters or digits")
        self.title = title
        self.tags = tuple(tags)
        self.requirements = tuple(requirements)
        self.bench = bench
        self.signals = tuple(signals)
        self.needs = Needs.of(needs or {})
        self.controller = controller
        self._cases: dict[str, Case] = {}
        self._rules: dict[str, Rule | str] = {}

    @property
    def cases(self) -> tuple[Case, ...]:
        """The cases in the order of their definition."""
        return tuple(self._cases.values())

    def __getitem__(self, identifier: str) -> Case:
        name, *places = identifier.split(ON)
        case = self._cases[name]
        for where in places:
            case = self.on_controller(case, where) if where in CONTROLLERS else case.on(where)
        return case

    def __contains__(self, identifier: object) -> bool:
        return isinstance(identifier, str) and identifier.partition(ON)[0] in self._cases

    def __len__(self) -> int:
        return len(self._cases)

    def __repr__(self) -> str:
        return f"<Campaign {self.title!r}, {len(self._cases)} cases>"

    def says_of(self, controller: str, rule: Rule | str) -> None:
        """Say what the cases are on another make of controller.

        Args:
            controller: The make, one of `CONTROLLERS`.
            rule: Tells it of a case; or `package.module:NAME`, which is imported when it is asked.

        """
        self._rules[controller] = rule

    def on_controller(self, case: Case, controller: str) -> Case:
        """Return a case as it runs on a make of controller.

        Args:
            case: One of this campaign.
            controller: The make, one of `CONTROLLERS`.

        """
        first = next(iter(CONTROLLERS))
        there = replace(case, controller=controller)
        if controller != first:
            there = replace(there, identifier=f"{case.identifier}{ON}{controller}")
        own, what = self.controller or first, CONTROLLERS[controller]
        if controller == own:
            return there
        if not self.controller or own != first:
            case_is = f"is written for {CONTROLLERS[own]}" if self.controller else "is led by a plain master"
            return replace(there, requirements=(), refusal=f"not applicable to {what}: the case {case_is}")
        rule = self._rules.get(controller)
        if isinstance(rule, str):
            module, _, attribute = rule.partition(":")
            rule = self._rules[controller] = getattr(importlib.import_module(module), attribute)
        name = case.identifier.removeprefix(f"{slug(self.title)}/")
        found = rule(name, case.parameters) if callable(rule) else None
        if isinstance(found, Counterpart):
            return replace(
                there,
                function=found.function,
                parameters=found.parameters,
                requirements=found.requirements,
                title=found.title or case.title,
                without=(),
                needs=case.needs & Needs.of(found.needs or {}),
                own_numbers=found.needs is None,
            )
        if isinstance(found, NotApplicable):
            return replace(there, requirements=(), refusal=f"not applicable to {what}: {found.reason}")
        reason = f"no case is written for {what}: those of {self.title!r} are about {CONTROLLERS[own]}"
        return replace(there, requirements=(), refusal=reason)

    def add(self, case: Case) -> None:
        """Add a case.

        Raises:
            ConfigurationError: A case of this name exists already.

        """
        if case.identifier in self._cases:
            raise ConfigurationError(
                "case identifier", case.identifier, "a name that no other case of the campaign has"
            )
        self._cases[case.identifier] = case

    def case(
        self,
        name: str,
        *,
        title: str = "",
        tags: Sequence[str] = (),
        requirements: Requirements = (),
        signals: Sequence[str] = (),
        without: Sequence[str] = (),
        simulated_limit_s: float = SIMULATED_LIMIT_S,
        wall_limit_s: float = WALL_LIMIT_S,
        needs: Needed | None = None,
    ) -> Callable[[CaseFunction], CaseFunction]:
        """Register the decorated function as a case.

        Args:
            name: Rest of the identifier after the campaign's own slug.
            title: What is tested; default the first line of the docstring.
            tags: Further tags.
            requirements: Further identifiers.
            signals: Signals kept in the report, in place of those of the campaign.
            without: Requirements whose always-on checkers do not apply.
            simulated_limit_s: Limit of bench time, s.
            wall_limit_s: Limit of wall time, s.
            needs: What it needs of a configuration on top of what the campaign needs.

        """
        return self.product(
            name,
            title=title,
            tags=tags,
            requirements=requirements,
            signals=signals,
            without=without,
            simulated_limit_s=simulated_limit_s,
            wall_limit_s=wall_limit_s,
            needs=needs,
            parameters={},
        )

    def product(
        self,
        name: str,
        *,
        parameters: Mapping[str, Iterable[object]] | Iterable[Mapping[str, object]],
        title: str = "",
        tags: Sequence[str] = (),
        requirements: Requirements = (),
        signals: Sequence[str] = (),
        without: Sequence[str] = (),
        simulated_limit_s: float = SIMULATED_LIMIT_S,
        wall_limit_s: float = WALL_LIMIT_S,
        needs: Needed | Callable[..., Needed] | None = None,
    ) -> Callable[[CaseFunction], CaseFunction]:
        """Register the decorated function once for every combination of parameters.

        Args:
            name: As of `case`, with every parameter as a placeholder: `mc-power-{mode}/{phase}`.
            parameters: Values by name (all combinations, the last name varying fastest), or the
                combinations themselves.
            title: As of `case`, may hold placeholders.
            tags: Further tags, may hold placeholders.
            requirements: Further identifiers, or a function of the parameters that returns them.
            signals: As of `case`.
            without: As of `case`.
            simulated_limit_s: As of `case`.
            wall_limit_s: As of `case`.
            needs: As of `case`, or a function of the parameters that returns it.

        Raises:
            ConfigurationError: The name does not tell the combinations apart, or a limit is not positive.

        """
        combinations = list(_combinations(parameters))
        for limit, value in (("simulated_limit_s", simulated_limit_s), ("wall_limit_s", wall_limit_s)):
            if not value > 0:
                raise ConfigurationError(f"case {name}.{limit}", value, "a number > 0 s")

        def register(function: CaseFunction) -> CaseFunction:
            default_title = (inspect.getdoc(function) or name).splitlines()[0].rstrip(".")
            for values in combinations:
                own = requirements(**values) if callable(requirements) else requirements
                needed = needs(**values) if callable(needs) else needs
                self.add(
                    Case(
                        identifier=f"{slug(self.title)}/{slug(_fill(name, values))}",
                        title=_fill(title or default_title, values),
                        group=self.title,
                        function=function,
                        parameters=values,
                        tags=tuple(dict.fromkeys([*self.tags, *(_fill(tag, values) for tag in tags)])),
                        requirements=tuple(dict.fromkeys([*self.requirements, *own])),
                        bench=self.bench,
                        signals=tuple(signals) or self.signals,
                        without=tuple(without),
                        simulated_limit_s=simulated_limit_s,
                        wall_limit_s=wall_limit_s,
                        needs=self.needs & Needs.of(needed or {}),
                    )
                )
            return function

        return register


def _combinations(
    parameters: Mapping[str, Iterable[object]] | Iterable[Mapping[str, object]],
) -> Iterable[dict[str, object]]:
    if isinstance(parameters, Mapping):
        names = list(parameters)
        for values in itertools.product(*(list(parameters[name]) for name in names)):
            yield dict(zip(names, values, strict=True))
    else:
        for combination in parameters:
            yield dict(combination)


def _fill(text: str, values: Mapping[str, object]) -> str:
    """Put parameter values into their placeholders; texts with other braces stay as they are."""
    if not values:
        return text
    try:
        return string.Formatter().vformat(text, (), values)
    except (KeyError, ValueError, IndexError) as error:
        raise ConfigurationError("case name or title", text, f"placeholders {', '.join(values)}") from error
