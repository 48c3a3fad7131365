"""From a matrix file to a campaign."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any, Final

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


class MatrixCampaign(Campaign):
    """A campaign that a matrix file describes.

    Args:
        path: The file.

    Raises:
        ConfigurationError: As of `read_matrix`; or nothing is left of the matrix.

    """

    def __init__(self, path: Path) -> None:
        matrix = read_matrix(path)
        super().__init__(
            matrix.title, tags=matrix.tags, requirements=matrix.requirements, signals=matrix.signals
        )
        self._path = path
        total = math.prod(map(len, matrix.factors.values()))
        if total > MOST_COMBINATIONS:
            raise ConfigurationError(
                f"{path}: factors",
                f"{total} combinations",
                f"at most {MOST_COMBINATIONS} to choose from: name fewer words",
            )
        self.combined = combined(matrix)
        """What came of the factors: how many combinations there are, and why which were left out."""
        if len(self.combined.rows) * matrix.seeds > MOST_CASES:
            raise ConfigurationError(
                f"{path}: factors",
                f"more than {MOST_CASES} cases",
                'at most that many: name fewer words, exclude more, choose reduction = "pairwise" or '
                "fewer seeds",
            )
        if not self.combined.rows and not matrix.cases:
            raise ConfigurationError(
                f"{path}: factors",
                f"{sum(self.combined.left_out.values())} combinations, all of them left out",
                "at least one combination that no [[exclude]] and nothing else speaks against",
            )
        for named in matrix.cases:
            values = {**matrix.vocabulary.defaults, **named.values}
            reason = _objection(matrix, values, exclusions=False)
            if reason:
                raise ConfigurationError(f"{path}: case {named.name}", dict(named.values), f"not: {reason}")
            self._add(matrix, named.name, values, named.title, tags=named.tags, own=named.requirements)
        for row in self.combined.rows:
            name = "/".join(_part(factor, value) for factor, value in row.items())
            self._add(matrix, name, {**matrix.vocabulary.defaults, **row}, "", tags=tuple(row.values()))

    def _add(
        self,
        matrix: MatrixFile,
        name: str,
        values: Mapping[str, str],
        title: str,
        *,
        tags: tuple[str, ...],
        own: tuple[str, ...] = (),
    ) -> None:
        vocabulary = matrix.vocabulary
        tags = tuple(tag for tag in tags if tag not in {"", "none"} and not tag.endswith(".toml"))
        for number in range(1, matrix.seeds + 1):
            again = f"/{number}" if matrix.seeds > 1 else ""
            identifier = f"{slug(matrix.title)}/{slug(name)}{again}"
            if identifier in self:
                raise ConfigurationError(
                    f"{self._path}: case", identifier, "a name that no combination of the factors has"
                )
            self.add(
                Case(
                    identifier=identifier,
                    title=(title or vocabulary.title(values)) + (f", run {number}" if again else ""),
                    group=matrix.title,
                    function=partial(_run, vocabulary, dict(values)),
                    parameters={},
                    tags=tuple(dict.fromkeys([*self.tags, *tags])),
                    requirements=tuple(
                        dict.fromkeys([*self.requirements, *vocabulary.requirements(values), *own])
                    ),
                    bench=_bench_of(matrix, values),
                    signals=self.signals,
                    simulated_limit_s=matrix.simulated_limit_s,
                    wall_limit_s=matrix.wall_limit_s,
                )
            )


def _run(vocabulary: Vocabulary, values: Mapping[str, str], ctx: CaseContext) -> Any:
    return vocabulary.run(ctx, values)


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


def combined(matrix: MatrixFile) -> Combined:
    """Return the combinations of a matrix."""
    most = MOST_CASES // matrix.seeds
    return combine(matrix.factors, lambda values: _objection(matrix, values), matrix.strength, most=most)


def load_matrix(path: str | Path) -> MatrixCampaign:
    """Return the campaign that a matrix file describes.

    Raises:
        ConfigurationError: Something in the file is not allowed; the message names file, key, value and
            what is allowed.
        CannotRunError: Its vocabulary cannot be imported.

    """
    return MatrixCampaign(Path(path))
