"""What cases need of a bench, in the words of the factors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from fieldbus.errors import ConfigurationError, UnknownNameError
from hil.configurations.factors import FACTORS, Row

_NOT: Final = "not "


@dataclass(frozen=True)
class Needs:
    """What a case needs of a bench: the values of factors with which it can run.

    `Needs.of({"bus": "can", "motion": ("linear", "rotary"), "load": "not heavy"})` reads what a campaign
    says.
    """

    allowed: Mapping[str, frozenset[str]] = field(default_factory=dict)
    """Values by name of the factor; a factor that is missing may have any value."""

    @classmethod
    def of(cls, given: Mapping[str, str | Sequence[str]]) -> Needs:
        """Read needs.

        Args:
            given: By name of a factor the value that is needed, or several of which one is needed; `not`
                before a value excludes it.

        Raises:
            UnknownNameError: There is no such factor.
            ConfigurationError: A factor has no such value, or none is left.

        """
        allowed: dict[str, frozenset[str]] = {}
        for name, words in given.items():
            if name not in FACTORS:
                raise UnknownNameError("needs", name, "a factor of configurations", FACTORS)
            known = FACTORS[name].values
            texts = [words] if isinstance(words, str) else list(words)
            wanted, excluded = set[str](), set[str]()
            for text in texts:
                value = text.removeprefix(_NOT)
                if value not in known:
                    raise ConfigurationError(
                        f"needs.{name}", text, ", ".join(known) + f', or one of them after "{_NOT.strip()}"'
                    )
                (excluded if text.startswith(_NOT) else wanted).add(value)
            allowed[name] = frozenset((wanted or set(known)) - excluded)
            if not allowed[name]:
                raise ConfigurationError(f"needs.{name}", words, "at least one value that is left")
        return cls(allowed)

    def __and__(self, other: Needs) -> Needs:
        """Return what somebody needs who has both needs."""
        both = dict(self.allowed)
        for name, values in other.allowed.items():
            both[name] = both.get(name, values) & values
        return Needs(both)

    def __hash__(self) -> int:
        return hash(frozenset(self.allowed.items()))

    def refusal(self, row: Row) -> str:
        """Return why a configuration, as far as it is known, does not serve; empty: it does."""
        for name, values in self.allowed.items():
            if name in row and row[name] not in values:
                return f"needs {self._words(name)}"
        return ""

    def _words(self, name: str) -> str:
        return f"{name} {' or '.join(value for value in FACTORS[name].values if value in self.allowed[name])}"

    def __str__(self) -> str:
        return ", ".join(self._words(name) for name in self.allowed)


ANY: Final = Needs()
"""Every bench serves."""
