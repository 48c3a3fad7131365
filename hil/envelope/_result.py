"""The result of a sweep: branches, worst points, cliffs; as JSON and CSV, and compared with another one."""

from __future__ import annotations

import csv
import importlib
import io
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

from fieldbus.errors import ConfigurationError, UnknownNameError
from hil.campaign import Token
from hil.envelope._measures import MEASURES, Measure
from hil.errors import CannotRunError, HilError

RESULT_FILE: Final = "envelope.json"
_FORMAT: Final = 1


class EnvelopeFileError(HilError):
    """A file is no readable envelope."""


@dataclass(frozen=True)
class Branch:
    """One copy: when it was broken with what, and what came of it."""

    cycle: int
    """Cycle of the motion, from 0 on."""
    time_s: float
    """Time since the start of the motion, s."""
    stimulus: str
    reaction: str
    """Alarms, states and broken rules in words; equal words are the same class of reaction."""
    measures: Mapping[str, Mapping[str, float]]
    """By axis and name of the measure; empty where the copy came to no end."""
    rest: Mapping[str, float]
    """Where the machine of each axis came to rest, mm or deg."""
    broken: tuple[str, ...]
    """Rules that hold in every run and were broken here."""
    error: str
    """Why the copy came to no end; empty: it did."""
    digest: str
    """Digest of its trace."""

    def value(self, measure: str, axis: str) -> float | None:
        """Return a measure; None where there is none."""
        return self.measures.get(axis, {}).get(measure)

    def to_json(self) -> dict[str, Any]:
        """Return the branch as JSON values."""
        return {
            "cycle": self.cycle,
            "time_s": self.time_s,
            "stimulus": self.stimulus,
            "reaction": self.reaction,
            "measures": {axis: dict(values) for axis, values in self.measures.items()},
            "rest": dict(self.rest),
            "broken": list(self.broken),
            "error": self.error,
            "digest": self.digest,
        }


@dataclass(frozen=True)
class Cliff:
    """Two neighbouring instants whose reactions are of different classes."""

    stimulus: str
    before: Branch
    after: Branch

    @property
    def sharp(self) -> bool:
        """Whether they are one cycle apart."""
        return self.after.cycle - self.before.cycle == 1


@dataclass(frozen=True)
class Worst:
    """The greatest value of a measure, and the branch that has it; it compares with a number."""

    value: float
    unit: str
    axis: str
    branch: Branch

    def __float__(self) -> float:
        return self.value

    def __lt__(self, limit: float) -> bool:
        return self.value < limit

    def __le__(self, limit: float) -> bool:
        return self.value <= limit

    def __gt__(self, limit: float) -> bool:
        return self.value > limit

    def __ge__(self, limit: float) -> bool:
        return self.value >= limit


@dataclass(frozen=True)
class Margin:
    """How near a machine comes to a limit: at the worst instant of the worst stimulus."""

    limit: str
    """`positive end stop`, `guard at 150`."""
    position: float
    """Of the limit, mm or deg."""
    left: float
    """From the place at rest to the limit, mm or deg; negative: beyond it."""
    branch: Branch


@dataclass(frozen=True)
class EnvelopeDifference:
    """The worst value of a measure in two envelopes, by stimulus."""

    stimulus: str
    measure: str
    axis: str
    first: float | None
    second: float | None
    """None: no branch of the stimulus has the measure."""
    unit: str


@dataclass(frozen=True)
class Envelope:
    """What a sweep found."""

    bench: str
    bench_digest: str
    motion: str
    seed: int
    watch_s: float
    start_s: float
    cycle_s: float
    cycles: int
    """Cycles of the motion."""
    stimuli: tuple[str, ...]
    refused: Mapping[str, str]
    """Stimuli that the bench cannot take, with the reason."""
    skipped: int
    """Branches that were planned and not run, because the budget was used up."""
    axes: tuple[str, ...]
    units: Mapping[str, str]
    """Unit of positions, by axis: mm or deg."""
    positions: Mapping[str, tuple[float, ...]]
    """Position of the undisturbed motion at every cycle, by axis."""
    stops: Mapping[str, tuple[float, float]]
    """Mechanical end stops by axis, same unit."""
    branches: tuple[Branch, ...]
    """Ordered by stimulus and cycle."""
    source: Mapping[str, Any] = field(default_factory=dict)
    """Bench and motion as they are found again; empty: they cannot be."""
    rest_s: float | None = None
    """Time at rest after which a copy was ended, s; None: all were watched to the end."""
    guards: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    """Positions that the machine of an axis must not reach, by axis, same unit as the end stops."""

    def unit(self, measure: str, axis: str) -> str:
        """Return the unit of a measure of an axis."""
        unit = _known(measure).unit
        return self.units.get(axis, "") if unit == "position" else unit

    def of(self, stimulus: str) -> list[Branch]:
        """Return the branches of a stimulus, by time.

        Raises:
            UnknownNameError: There is no such stimulus.

        """
        if stimulus not in self.stimuli:
            raise UnknownNameError("envelope", stimulus, "a stimulus", self.stimuli)
        return [branch for branch in self.branches if branch.stimulus == stimulus]

    def worst(self, measure: str, *, axis: str | None = None, stimulus: str | None = None) -> Worst:
        """Return the greatest value of a measure: `assert envelope.worst("stop_distance") < 12.0`.

        Args:
            measure: `MEASURES` has the names.
            axis: None: of any axis.
            stimulus: None: of any.

        Raises:
            ConfigurationError: There is no such measure, axis or stimulus, or no branch that has it.

        """
        _known(measure)
        axes = self.axes if axis is None else (axis,)
        if axis is not None and axis not in self.axes:
            raise UnknownNameError("envelope", axis, "an axis", self.axes)
        found: list[tuple[float, str, Branch]] = [
            (value, one, branch)
            for branch in (self.branches if stimulus is None else self.of(stimulus))
            for one in axes
            if (value := branch.value(measure, one)) is not None
        ]
        if not found:
            raise ConfigurationError("envelope", measure, "a measure that at least one branch has")
        value, name, branch = max(found, key=lambda one: one[0])
        return Worst(value, self.unit(measure, name), name, branch)

    def ranked(self, measure: str, axis: str, most: int = 10) -> list[Branch]:
        """Return the branches with the greatest values of a measure, the worst of each stimulus first."""
        _known(measure)
        per_stimulus = [
            max(branches, key=lambda one: one.value(measure, axis) or 0.0)
            for found in self._by_stimulus().values()
            if (branches := [one for one in found if one.value(measure, axis) is not None])
        ]
        return sorted(per_stimulus, key=lambda one: -(one.value(measure, axis) or 0.0))[:most]

    @property
    def cliffs(self) -> list[Cliff]:
        """Neighbouring instants between which the class of the reaction changes."""
        found: list[Cliff] = []
        for stimulus, branches in self._by_stimulus().items():
            found.extend(
                Cliff(stimulus, left, right)
                for left, right in pairwise(branches)
                if left.reaction != right.reaction
            )
        return found

    def _by_stimulus(self) -> dict[str, list[Branch]]:
        """Return all branches by their stimulus, in one pass: there can be tens of thousands."""
        found: dict[str, list[Branch]] = {stimulus: [] for stimulus in self.stimuli}
        for branch in self.branches:
            found[branch.stimulus].append(branch)
        return found

    @property
    def failures(self) -> list[Branch]:
        """Branches in which a rule was broken, or which came to no end."""
        return [branch for branch in self.branches if branch.broken or branch.error]

    def token(self, branch: Branch) -> str:
        """Return the replay token of a branch, for `hil replay`; empty: its motion has no name."""
        if not self.source:
            return ""
        return Token(
            f"{self.motion}, {branch.stimulus} in cycle {branch.cycle}",
            self.seed,
            bench=self.source["bench"],
            bench_digest=self.bench_digest,
            branch={
                "motion": self.source["motion"],
                "stimulus": branch.stimulus,
                "cycle": branch.cycle,
                "watch_s": self.watch_s,
                "rest_s": self.rest_s,
                "digest": branch.digest,
            },
        ).encode()

    def compared(self, other: Envelope) -> list[EnvelopeDifference]:
        """Return the worst values of the stimuli that both have, side by side; `beside` lists the others."""
        axes = [axis for axis in self.axes if axis in other.axes]
        first, second = self._worst_values(), other._worst_values()
        return [
            EnvelopeDifference(
                stimulus,
                measure,
                axis,
                first.get((stimulus, axis, measure)),
                second.get((stimulus, axis, measure)),
                self.unit(measure, axis),
            )
            for stimulus in self.stimuli
            if stimulus in other.stimuli
            for axis in axes
            for measure in MEASURES
        ]

    def beside(self, other: Envelope) -> list[str]:
        """Return the stimuli and axes that only this envelope has, in words: with the reason where the other
        bench cannot take a stimulus.
        """
        found = []
        for stimulus in self.stimuli:
            if stimulus in other.refused:
                found.append(f"{stimulus} (not possible there: {other.refused[stimulus]})")
            elif stimulus not in other.stimuli:
                found.append(stimulus)
        return [*found, *(f"axis {axis}" for axis in self.axes if axis not in other.axes)]

    def margins(self, axis: str) -> list[Margin]:
        """Return what is left to each end stop and guard of an axis, where its machine comes nearest to it at
        rest; a limit above the start of the motion is an upper one.

        Raises:
            UnknownNameError: There is no such axis.

        """
        if axis not in self.axes:
            raise UnknownNameError("envelope", axis, "an axis", self.axes)
        limits = dict(zip(("negative end stop", "positive end stop"), self.stops.get(axis, ()), strict=False))
        limits |= {f"guard at {place:g}": place for place in self.guards.get(axis, ())}
        rests = [(branch.rest[axis], branch) for branch in self.branches if axis in branch.rest]
        if not rests:
            return []
        start = self.positions[axis][0]
        highest, lowest = max(rests, key=lambda one: one[0]), min(rests, key=lambda one: one[0])
        return [
            Margin(name, place, place - highest[0], highest[1])
            if place > start
            else Margin(name, place, lowest[0] - place, lowest[1])
            for name, place in limits.items()
        ]

    def _worst_values(self) -> dict[tuple[str, str, str], float]:
        """Return the greatest value by stimulus, axis and measure, in one pass over the branches."""
        found: dict[tuple[str, str, str], float] = {}
        for branch in self.branches:
            for axis, measures in branch.measures.items():
                for measure, value in measures.items():
                    key = branch.stimulus, axis, measure
                    found[key] = max(found.get(key, value), value)
        return found

    # -- files

    def to_json(self) -> dict[str, object]:
        """Return the envelope as JSON values, with the worst points of every axis and all cliffs."""
        return {
            "format": _FORMAT,
            "bench": self.bench,
            "bench_digest": self.bench_digest,
            "motion": self.motion,
            "source": dict(self.source),
            "seed": self.seed,
            "watch_s": self.watch_s,
            "rest_s": self.rest_s,
            "start_s": self.start_s,
            "cycle_s": self.cycle_s,
            "cycles": self.cycles,
            "stimuli": list(self.stimuli),
            "refused": dict(self.refused),
            "skipped": self.skipped,
            "axes": list(self.axes),
            "units": dict(self.units),
            "positions": {axis: list(values) for axis, values in self.positions.items()},
            "stops": {axis: list(values) for axis, values in self.stops.items()},
            "guards": {axis: list(values) for axis, values in self.guards.items()},
            "margins": {
                axis: [
                    {
                        "limit": one.limit,
                        "position": one.position,
                        "left": one.left,
                        "stimulus": one.branch.stimulus,
                        "cycle": one.branch.cycle,
                        "time_s": one.branch.time_s,
                    }
                    for one in self.margins(axis)
                ]
                for axis in self.axes
            },
            "branches": [one.to_json() for one in self.branches],
            "worst": {
                axis: [
                    {**one.to_json(), "token": self.token(one)}
                    for one in self.ranked(next(iter(MEASURES)), axis)
                ]
                for axis in self.axes
            },
            "cliffs": [
                {"stimulus": one.stimulus, "before": one.before.to_json(), "after": one.after.to_json()}
                for one in self.cliffs
            ],
        }

    def rows(self) -> tuple[list[str], list[list[Any]]]:
        """Return the names of columns, and a row for every branch and axis; None: it has no such measure."""
        rows = []
        for branch in self.branches:
            for axis in self.axes:
                values = branch.measures.get(axis, {})
                rows.append(
                    [branch.stimulus, branch.cycle, branch.time_s, axis, self.units.get(axis, "")]
                    + [values.get(name) for name in MEASURES]
                    + [branch.reaction]
                )
        return ["stimulus", "cycle", "time_s", "axis", "position_unit", *MEASURES, "reaction"], rows

    def csv(self) -> str:
        """Return the rows as text."""
        out = io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        names, rows = self.rows()
        writer.writerow(names)
        for row in rows:
            writer.writerow([f"{one:.6g}" if isinstance(one, float) else one for one in row])
        return out.getvalue()

    def save_parquet(self, path: str | Path) -> Path:
        """Write the rows as a Parquet file; returns its path.

        Raises:
            CannotRunError: pyarrow is not installed.

        """
        table, parquet = parquet_library()
        names, rows = self.rows()
        file = Path(path)
        file.parent.mkdir(parents=True, exist_ok=True)
        columns = list(zip(*rows, strict=True)) if rows else [()] * len(names)
        parquet.write_table(table.table(dict(zip(names, columns, strict=True))), file)
        return file

    def save(self, folder: str | Path) -> Path:
        """Write `envelope.json` and `envelope.csv` into a folder; returns the first."""
        place = Path(folder)
        place.mkdir(parents=True, exist_ok=True)
        (place / "envelope.csv").write_text(self.csv(), encoding="utf-8")
        file = place / RESULT_FILE
        file.write_text(json.dumps(self.to_json(), sort_keys=True, indent=1) + "\n", encoding="utf-8")
        return file


def parquet_library() -> tuple[Any, Any]:
    """Return `pyarrow` and `pyarrow.parquet`.

    Raises:
        CannotRunError: They are not installed.

    """
    try:
        return importlib.import_module("pyarrow"), importlib.import_module("pyarrow.parquet")
    except ModuleNotFoundError as error:
        raise CannotRunError(
            f"a Parquet file needs pyarrow, which is not installed ({error}): pip install "
            "'motion-hil[parquet]'"
        ) from error


def _known(measure: str) -> Measure:
    if measure not in MEASURES:
        raise UnknownNameError("envelope", measure, "a measure", MEASURES)
    return MEASURES[measure]


def load_envelope(path: str | Path) -> Envelope:
    """Read the `envelope.json` of a folder, or the file itself.

    Raises:
        EnvelopeFileError: It cannot be read, or is no envelope.

    """
    file = Path(path)
    file = file / RESULT_FILE if file.is_dir() else file
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
        if content["format"] != _FORMAT:
            raise EnvelopeFileError(f"{file}: format {content['format']!r} is not {_FORMAT}")
        return Envelope(
            bench=content["bench"],
            bench_digest=content["bench_digest"],
            motion=content["motion"],
            source=content.get("source", {}),
            seed=content["seed"],
            watch_s=content["watch_s"],
            rest_s=content.get("rest_s"),
            guards={axis: tuple(places) for axis, places in content.get("guards", {}).items()},
            start_s=content["start_s"],
            cycle_s=content["cycle_s"],
            cycles=content["cycles"],
            stimuli=tuple(content["stimuli"]),
            refused=content["refused"],
            skipped=content["skipped"],
            axes=tuple(content["axes"]),
            units=content["units"],
            positions={axis: tuple(values) for axis, values in content["positions"].items()},
            stops={axis: (low, high) for axis, (low, high) in content["stops"].items()},
            branches=tuple(
                Branch(
                    cycle=one["cycle"],
                    time_s=one["time_s"],
                    stimulus=one["stimulus"],
                    reaction=one["reaction"],
                    measures=one["measures"],
                    rest=one["rest"],
                    broken=tuple(one["broken"]),
                    error=one["error"],
                    digest=one["digest"],
                )
                for one in content["branches"]
            ),
        )
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise EnvelopeFileError(f"{file}: no readable envelope: {error}") from error
