"""The matrix file: read, checked against its vocabulary, and never half understood."""

from __future__ import annotations

import importlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, Final

from fieldbus.errors import ConfigurationError, UnknownKeyError, UnknownNameError
from fieldbus.toml_text import toml_content
from hil.campaign._case import SIMULATED_LIMIT_S, WALL_LIMIT_S, slug
from hil.campaign._shipped import VOCABULARY
from hil.errors import CannotRunError
from hil.matrix._vocabulary import Vocabulary

BENCH: Final = "bench"
_KEYS: Final = (
    "title",
    "vocabulary",
    "tags",
    "requirements",
    "signals",
    "reduction",
    "seeds",
    "simulated_limit_s",
    "wall_limit_s",
    "factors",
    "exclude",
    "case",
    "bench",
)
_CASE_KEYS: Final = ("name", "title", "tags", "requirements")
_BENCH_KEYS: Final = ("drive", "transport", "file")
REDUCTIONS: Final = '"full", "pairwise" or a whole number N >= 1 for N-wise'


@dataclass(frozen=True)
class Exclusion:
    """Combinations that are left out: those with one of the values for every factor here."""

    values: Mapping[str, frozenset[str]]
    reason: str

    def applies(self, values: Mapping[str, str]) -> bool:
        """Return whether a combination, as far as it is known, is left out."""
        return all(values.get(name) in wanted for name, wanted in self.values.items())


@dataclass(frozen=True)
class NamedCase:
    """A combination that is run whatever the reduction says."""

    name: str
    title: str
    values: Mapping[str, str]
    tags: tuple[str, ...]
    requirements: tuple[str, ...]


@dataclass(frozen=True)
class MatrixFile:
    """A matrix file as read."""

    title: str
    vocabulary: Vocabulary
    factors: Mapping[str, tuple[str, ...]]
    strength: int | None
    """Every so many values meet; None: all combinations."""
    exclusions: tuple[Exclusion, ...]
    cases: tuple[NamedCase, ...]
    benches: Mapping[tuple[str, str], str]
    seeds: int
    tags: tuple[str, ...]
    requirements: tuple[str, ...]
    signals: tuple[str, ...]
    simulated_limit_s: float
    wall_limit_s: float


def read_matrix(path: Path) -> MatrixFile:
    """Read a matrix file.

    Raises:
        ConfigurationError: It is no TOML, or something in it is not allowed; the message names file, key,
            value and what is allowed.
        CannotRunError: Its vocabulary cannot be imported.

    """
    content = toml_content(path)
    return _Reader(path).read(content)


class _Reader:
    def __init__(self, path: Path) -> None:
        self._path = path

    def read(self, content: Mapping[str, object]) -> MatrixFile:
        self._only("", content, _KEYS)
        title = content.get("title")
        if not isinstance(title, str) or not slug(title):
            raise self._wrong("title", title, "a text with letters or digits")
        vocabulary = self._vocabulary(content.get("vocabulary", VOCABULARY))
        factors = self._factors(content.get("factors"), vocabulary)
        seeds = content.get("seeds", 1)
        if not isinstance(seeds, int) or isinstance(seeds, bool) or not 1 <= seeds <= 1000:
            raise self._wrong("seeds", seeds, "a whole number from 1 to 1000")
        tables = self._tables("exclude", content.get("exclude", []))
        return MatrixFile(
            title=title,
            vocabulary=vocabulary,
            factors=factors,
            strength=self._strength(content.get("reduction", "full")),
            exclusions=tuple(self._exclusion(key, table, factors) for key, table in tables),
            cases=self._cases(self._tables("case", content.get("case", [])), factors, vocabulary),
            benches={**vocabulary.benches, **self._benches(self._tables("bench", content.get("bench", [])))},
            seeds=seeds,
            tags=self._texts("tags", content.get("tags", [])),
            requirements=self._texts("requirements", content.get("requirements", [])),
            signals=self._texts("signals", content.get("signals", [])),
            simulated_limit_s=self._seconds(content, "simulated_limit_s", SIMULATED_LIMIT_S),
            wall_limit_s=self._seconds(content, "wall_limit_s", WALL_LIMIT_S),
        )

    def _wrong(self, key: str, value: object, allowed: str) -> ConfigurationError:
        return ConfigurationError(f"{self._path}: {key}", value, allowed)

    def _unknown(self, key: str, value: object, what: str, known: Sequence[str]) -> UnknownNameError:
        return UnknownNameError(f"{self._path}: {key}", value, what, known)

    def _only(self, key: str, table: Mapping[str, object], allowed: Sequence[str]) -> None:
        for name in table:
            if name not in allowed:
                raise UnknownKeyError(f"{self._path}: {f'{key}.{name}'.lstrip('.')}", name, allowed)

    def _tables(self, key: str, value: object) -> list[tuple[str, Mapping[str, object]]]:
        if not isinstance(value, list) or not all(isinstance(entry, dict) for entry in value):
            raise self._wrong(key, value, f"tables [[{key}]]")
        return [(f"{key}[{number}]", entry) for number, entry in enumerate(value, start=1)]

    def _texts(self, key: str, value: object) -> tuple[str, ...]:
        if not isinstance(value, list) or not all(isinstance(entry, str) and entry for entry in value):
            raise self._wrong(key, value, "a list of texts")
        return tuple(value)

    def _seconds(self, content: Mapping[str, object], key: str, default: float) -> float:
        value = content.get(key, default)
        if not isinstance(value, int | float) or isinstance(value, bool) or not value > 0:
            raise self._wrong(key, value, "a number > 0 s")
        return float(value)

    def _strength(self, value: object) -> int | None:
        if value == "full":
            return None
        if value == "pairwise":
            return 2
        if not isinstance(value, int) or isinstance(value, bool) or value < 1:
            raise self._wrong("reduction", value, REDUCTIONS)
        return value

    def _vocabulary(self, reference: object) -> Vocabulary:
        module, separator, name = str(reference).partition(":")
        if not separator:
            raise self._wrong("vocabulary", reference, "module:NAME")
        try:
            found: Any = getattr(importlib.import_module(module), name)
        except (ImportError, AttributeError) as error:
            raise CannotRunError(f"{self._path}: vocabulary {reference!r}: {error}") from error
        if not isinstance(found, Vocabulary):
            raise self._wrong("vocabulary", reference, "an object with the members of hil.matrix.Vocabulary")
        return found

    def _factors(self, value: object, vocabulary: Vocabulary) -> dict[str, tuple[str, ...]]:
        if not isinstance(value, dict) or not value:
            raise self._wrong(
                "factors", value, f"a table with factors: {', '.join([BENCH, *vocabulary.factors])}"
            )
        factors: dict[str, tuple[str, ...]] = {}
        for name, words in value.items():
            key = f"factors.{name}"
            if name == BENCH:
                factors[name] = tuple(self._bench(entry) for entry in self._texts(key, words))
            elif name in vocabulary.factors:
                factors[name] = self._values(key, words, vocabulary.factors[name])
            else:
                raise UnknownKeyError(f"{self._path}: {key}", name, [BENCH, *vocabulary.factors])
            if not factors[name]:
                raise self._wrong(key, words, "at least one value")
            if len(set(factors[name])) < len(factors[name]):
                raise self._wrong(key, words, "every value once")
        self._choose_bench(factors)
        missing = [
            name
            for name in vocabulary.factors
            if name not in {*factors, *vocabulary.defaults, "drive", "transport"}
        ]
        if missing:
            raise self._wrong(
                "factors", ", ".join(factors), f"also {', '.join(missing)}, which have no default"
            )
        return factors

    def _choose_bench(self, factors: Mapping[str, object]) -> None:
        by_parts = {"drive", "transport"} & set(factors)
        if BENCH in factors and by_parts:
            raise self._wrong("factors", ", ".join(factors), "either bench, or drive and transport")
        if len(by_parts) == 1:
            raise self._wrong("factors", ", ".join(factors), "drive and transport together")

    def _values(self, key: str, value: object, allowed: Mapping[str, str]) -> tuple[str, ...]:
        """Return the values that a list names, with its patterns (`*`, `?`, `[...]`) filled in."""
        found: list[str] = []
        texts = self._texts(key, [value] if isinstance(value, str) else value)
        for number, text in enumerate(texts, start=1):
            place = key if isinstance(value, str) else f"{key}[{number}]"
            if any(sign in text for sign in "*?["):
                fitting = [word for word in allowed if fnmatchcase(word, text)]
                if not fitting:
                    raise self._wrong(place, text, f"a pattern that fits one of {', '.join(allowed)}")
                found += [word for word in fitting if word not in found]
            elif text in allowed:
                found.append(text)
            else:
                raise self._unknown(place, text, f"a value of {key.rpartition('.')[2]}", [*allowed])
        return tuple(found)

    def _bench(self, text: str) -> str:
        """Return the reference of a bench; the path of a file counts from the matrix file."""
        path = self._path.parent / text
        return str(path) if text.endswith(".toml") and path.exists() else text

    def _benches(self, tables: list[tuple[str, Mapping[str, object]]]) -> dict[tuple[str, str], str]:
        found: dict[tuple[str, str], str] = {}
        for key, table in tables:
            self._only(key, table, _BENCH_KEYS)
            texts: dict[str, str] = {}
            for name in _BENCH_KEYS:
                text = table.get(name)
                if not isinstance(text, str) or not text:
                    raise self._wrong(f"{key}.{name}", text, "a text")
                texts[name] = text
            found[texts["drive"], texts["transport"]] = self._bench(texts["file"])
        return found

    def _exclusion(
        self, key: str, table: Mapping[str, object], factors: Mapping[str, Sequence[str]]
    ) -> Exclusion:
        self._only(key, table, [*factors, "reason"])
        reason = table.get("reason")
        if not isinstance(reason, str) or not reason:
            raise self._wrong(f"{key}.reason", reason, "a text that says why these combinations are left out")
        values: dict[str, frozenset[str]] = {}
        for name, words in table.items():
            if name == "reason":
                continue
            allowed = factors[name]
            if name == BENCH and isinstance(words, str):
                words = [words]  # noqa: PLW2901
            if name == BENCH and isinstance(words, Sequence):
                words = [self._bench(word) for word in words]  # noqa: PLW2901
            values[name] = frozenset(self._values(f"{key}.{name}", words, dict.fromkeys(allowed, "")))
        if not values:
            raise self._wrong(key, dict(table), f"at least one of {', '.join(factors)}")
        return Exclusion(values, reason)

    def _cases(
        self,
        tables: list[tuple[str, Mapping[str, object]]],
        factors: Mapping[str, Sequence[str]],
        vocabulary: Vocabulary,
    ) -> tuple[NamedCase, ...]:
        found: dict[str, NamedCase] = {}
        for key, table in tables:
            allowed = [*dict.fromkeys([BENCH, *vocabulary.factors])]
            self._only(key, table, [*_CASE_KEYS, *allowed])
            name = table.get("name")
            if not isinstance(name, str) or not slug(name) or slug(name) in found:
                raise self._wrong(f"{key}.name", name, "a text with letters or digits that no other case has")
            values: dict[str, str] = {}
            for factor in allowed:
                if factor not in table:
                    if factor in factors and len(factors[factor]) == 1:
                        values[factor] = factors[factor][0]
                    elif factor in factors and factor not in vocabulary.defaults:
                        raise self._wrong(f"{key}.{factor}", None, f"one of {', '.join(factors[factor])}")
                    continue
                text = table[factor]
                if factor == BENCH:
                    values[factor] = self._bench(str(text))
                elif not isinstance(text, str) or text not in vocabulary.factors[factor]:
                    known = [*vocabulary.factors[factor]]
                    raise self._unknown(f"{key}.{factor}", text, f"a value of {factor}", known)
                else:
                    values[factor] = text
            found[slug(name)] = NamedCase(
                slug(name),
                str(table.get("title", "")),
                values,
                self._texts(f"{key}.tags", table.get("tags", [])),
                self._texts(f"{key}.requirements", table.get("requirements", [])),
            )
        return tuple(found.values())
