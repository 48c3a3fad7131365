"""From a matrix file to a campaign."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Final

from fieldbus.errors import ConfigurationError
from hil.campaign._case import Campaign, Case, slug
from hil.campaign._context import CaseContext
from hil.matrix._combine import Combined, combine
from hil.matrix._file import BENCH, MatrixFile, read_matrix
from hil.matrix._vocabulary import Vocabulary

MOST_CASES: Final = 100_000
"""Cases of one matrix: some hours of computing."""
MOST_COMBINATIONS: Final = 20_000_000
"""Combinations that are looked through; some minutes."""
_NO_BENCH = "no bench has this drive and transport"


def load_matrix(path: str | Path) -> Campaign:
    """Return the campaign that a matrix file describes.

    Raises:
        ConfigurationError: Something in the file is not allowed, or no combination is left; the message names
            file, key, value and what is allowed.
        CannotRunError: Its vocabulary cannot be imported.

    """
    matrix = read_matrix(Path(path))
    total = math.prod(map(len, matrix.factors.values()))
    if total > MOST_COMBINATIONS:
        raise ConfigurationError(
            f"{path}: factors",
            f"{total} combinations",
            f"at most {MOST_COMBINATIONS} to choose from: name fewer values",
        )
    found = combinations_of(matrix)
    if len(found.rows) * matrix.seeds > MOST_CASES:
        raise ConfigurationError(
            f"{path}: factors",
            f"more than {MOST_CASES} cases",
            'at most that many: name fewer values, exclude more, reduction = "pairwise" or fewer seeds',
        )
    if not found.rows and not matrix.cases:
        raise ConfigurationError(
            f"{path}: factors",
            f"{sum(found.left_out.values())} combinations, all of them left out",
            "at least one combination that no [[exclude]] and nothing else speaks against",
        )
    campaign = Campaign(
        matrix.title, tags=matrix.tags, requirements=matrix.requirements, signals=matrix.signals
    )
    for case in [*_named_cases(matrix, path), *_combined_cases(matrix, found)]:
        if case.identifier in campaign:
            raise ConfigurationError(
                f"{path}: case", case.identifier, "a name that no combination of the factors has"
            )
        campaign.add(case)
    return campaign


def combinations_of(matrix: MatrixFile) -> Combined:
    """Return the combinations of a matrix: how many there are, and why which were left out."""
    most = MOST_CASES // matrix.seeds
    return combine(matrix.factors, lambda values: _objection(matrix, values), matrix.strength, most=most)


def _named_cases(matrix: MatrixFile, path: str | Path) -> Iterator[Case]:
    for named in matrix.cases:
        values = {**matrix.vocabulary.defaults, **named.values}
        reason = _objection(matrix, values, exclusions=False)
        if reason:
            raise ConfigurationError(f"{path}: case {named.name}", dict(named.values), f"not: {reason}")
        yield from _cases(matrix, named.name, values, named.title, tags=named.tags, own=named.requirements)


def _combined_cases(matrix: MatrixFile, found: Combined) -> Iterator[Case]:
    for row in found.rows:
        name = "/".join(_part(factor, value) for factor, value in row.items())
        yield from _cases(matrix, name, {**matrix.vocabulary.defaults, **row}, "", tags=tuple(row.values()))


def _cases(
    matrix: MatrixFile,
    name: str,
    values: Mapping[str, str],
    title: str,
    *,
    tags: tuple[str, ...],
    own: tuple[str, ...] = (),
) -> Iterator[Case]:
    """Yield the case of a combination, once for each seed."""
    vocabulary = matrix.vocabulary
    tags = tuple(tag for tag in tags if tag not in {"", "none"} and not tag.endswith(".toml"))
    for number in range(1, matrix.seeds + 1):
        again = f"/{number}" if matrix.seeds > 1 else ""
        yield Case(
            identifier=f"{slug(matrix.title)}/{slug(name)}{again}",
            title=(title or vocabulary.title(values)) + (f", run {number}" if again else ""),
            group=matrix.title,
            function=partial(_run, vocabulary, dict(values)),
            tags=tuple(dict.fromkeys([*matrix.tags, *tags])),
            requirements=tuple(dict.fromkeys([*matrix.requirements, *vocabulary.requirements(values), *own])),
            bench=_bench_of(matrix, values),
            signals=matrix.signals,
            simulated_limit_s=matrix.simulated_limit_s,
            wall_limit_s=matrix.wall_limit_s,
        )


def _run(vocabulary: Vocabulary, values: Mapping[str, str], ctx: CaseContext) -> None:
    vocabulary.run(ctx, values)


def _part(factor: str, value: str) -> str:
    """Return a value as part of an identifier; of a bench file only its name."""
    return Path(value).stem if factor == BENCH and value.endswith(".toml") else value


def _bench_of(matrix: MatrixFile, values: Mapping[str, str]) -> str:
    if BENCH in values:
        return values[BENCH]
    if "drive" in values and "transport" in values:
        return matrix.benches[values["drive"], values["transport"]]
    return ""


def _objection(matrix: MatrixFile, values: Mapping[str, str], *, exclusions: bool = True) -> str:
    if exclusions:
        for exclusion in matrix.exclusions:
            if exclusion.applies(values):
                return exclusion.reason
    if (
        "drive" in values
        and "transport" in values
        and (values["drive"], values["transport"]) not in matrix.benches
    ):
        return _NO_BENCH
    return matrix.vocabulary.impossible(values)
