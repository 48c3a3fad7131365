"""`hil envelope`: a motion broken at every cycle; table, page, and one branch alone."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from fieldbus.errors import ConfigurationError
from hil._commands.durations import parse_duration
from hil._commands.terminal import CaseProgress, console, print_json, quiet_stdout
from hil.campaign import load_bench_file
from hil.envelope import (
    MEASURES,
    Envelope,
    EnvelopeDifference,
    Motion,
    load_envelope,
    move_absolute,
    own_motion,
    parquet_library,
    stimulus_from_text,
    sweep,
    witness,
)
from hil.errors import CannotRunError
from hil.faults import CATALOGUE
from reports.html.envelope import write_envelope

USUAL: Final = ("operator.disable", "operator.halt", "operator.stop", "drive.fault:code=0x2310", "drive.sto")
"""Stimuli where none are given."""


def parse_every(text: str) -> int:
    """Return the step of cycles; `auto`: 0, coarse first.

    Raises:
        ConfigurationError: It is neither.

    """
    if text == "auto":
        return 0
    if not text.isdecimal() or int(text) < 1:
        raise ConfigurationError("--every", text, "a number of cycles from 1 on, cycle, or auto")
    return int(text)


def parse_guards(texts: list[str], axis: str) -> dict[str, list[float]]:
    """Return the positions of guards by axis, from `[AXIS=]POSITION`.

    Args:
        texts: As given.
        axis: Axis of those without one; empty: the first axis of the bench.

    Raises:
        ConfigurationError: A position is no number.

    """
    found: dict[str, list[float]] = {}
    for text in texts:
        name, _, place = text.rpartition("=")
        try:
            found.setdefault(name or axis, []).append(float(place))
        except ValueError:
            raise ConfigurationError("--guard", text, "[AXIS=]POSITION, mm or deg") from None
    return found


def all_faults() -> list[str]:
    """Return every kind of fault with the parameters of its example."""
    found = []
    for entry in CATALOGUE:
        values = dict(entry.example.get("parameters", {}))
        if "duration_s" in entry.example:
            values["duration_s"] = entry.example["duration_s"]
        tail = ",".join(f"{key}={value}" for key, value in values.items())
        found.append(entry.name + (f":{tail}" if tail else ""))
    return found


def envelope_of(
    *,
    bench: str,
    own: str,
    axis: str,
    to: float,
    velocity: float,
    stimuli: list[str],
    every: str,
    watch: float,
    until_rest: float | None,
    seed: int,
    jobs: int,
    cluster: str,
    budget: str,
    report: Path,
    resume: bool,
    cycle: int | None,
    guards: list[str],
    against: Path | None,
    parquet: bool,
    as_json: bool,
) -> int:
    """Sweep, tell, return the exit code: 1 when a rule was broken or a copy came to no end."""
    chosen = list(stimuli) or list(USUAL)
    if "all" in chosen:
        chosen = [*(one for one in chosen if one != "all"), *USUAL[:3], *all_faults()]
    motion = own_motion(own) if own else move_absolute(axis, to, velocity)
    if cycle is not None:
        return _one(
            bench,
            motion=motion,
            stimuli=chosen,
            cycle=cycle,
            seed=seed,
            watch=watch,
            until_rest=until_rest,
            report=report,
            as_json=as_json,
        )
    if parquet:
        parquet_library()
    with quiet_stdout(as_json):
        other = None if against is None else load_envelope(against)
        with CaseProgress(1, "branches") as progress:
            envelope = sweep(
                bench or "reference",
                motion,
                [stimulus_from_text(one) for one in chosen],
                every=1 if every == "cycle" else parse_every(every),
                seed=seed,
                watch_s=watch,
                rest_s=until_rest,
                jobs=jobs,
                cluster=cluster,
                budget_s=parse_duration("--budget", budget) or None,
                guards=parse_guards(guards, axis),
                folder=report,
                resume=resume,
                on_branch=lambda done, planned: progress.step(done, f"{planned - done} left"),
            )
        if not envelope.branches:
            raise CannotRunError(
                f"no branch was run within --budget {budget}: give it more time, with --resume"
            )
        if parquet:
            envelope.save_parquet(report / "envelope.parquet")
    changed = [] if other is None else [row for row in other.compared(envelope) if row.first != row.second]
    one_sided = [] if other is None else _one_sided(other, envelope)
    page = write_envelope(
        report / "envelope.html",
        envelope.to_json(),
        [(one.name, one.unit) for one in MEASURES.values()],
        [_in_words(row) for row in changed],
        "" if other is None else f"{other.bench}, {other.motion}",
        one_sided=one_sided,
    )
    if as_json:
        print_json({**_summary(envelope), "report": str(page)})
    else:
        _tell(envelope, changed, one_sided, page)
    return 1 if envelope.failures else 0


def _summary(envelope: Envelope) -> dict[str, object]:
    worst: dict[str, object] = {}
    for axis in envelope.axes:
        for measure in MEASURES:
            if any(branch.value(measure, axis) is not None for branch in envelope.branches):
                found = envelope.worst(measure, axis=axis)
                worst[f"{axis}.{measure}"] = {
                    "value": found.value,
                    "unit": found.unit,
                    "stimulus": found.branch.stimulus,
                    "cycle": found.branch.cycle,
                    "token": envelope.token(found.branch),
                }
    return {
        "branches": len(envelope.branches),
        "cycles": envelope.cycles,
        "skipped": envelope.skipped,
        "refused": dict(envelope.refused),
        "cliffs": len(envelope.cliffs),
        "failures": len(envelope.failures),
        "worst": worst,
    }


def _tell(envelope: Envelope, changed: list[EnvelopeDifference], one_sided: list[str], page: Path) -> None:
    out = console()

    def say(text: str) -> None:
        out.print(text, markup=False, soft_wrap=True)

    say(
        f"{len(envelope.branches)} branches off {envelope.cycles} cycles of {envelope.motion}, "
        f"{len(envelope.stimuli)} stimuli"
    )
    if envelope.skipped:
        say(f"{envelope.skipped} branches left out: the budget was used up")
    moved = [axis for axis in envelope.axes if _moves(envelope, axis)]
    for axis in moved:
        for measure in MEASURES:
            if not any(branch.value(measure, axis) is not None for branch in envelope.branches):
                continue
            worst = envelope.worst(measure, axis=axis)
            say(
                f"{axis} {measure.replace('_', ' ')}: {worst.value:.4g} {worst.unit} at "
                f"{worst.branch.time_s:.3f} s (cycle {worst.branch.cycle}), {worst.branch.stimulus}: "
                f"{worst.branch.reaction}"
            )
        for margin in envelope.margins(axis):
            where = "left to" if margin.left > 0.0 else "beyond"
            say(
                f"{axis}: {abs(margin.left):.4g} {envelope.units[axis]} {where} its {margin.limit}: "
                f"{margin.branch.stimulus} at {margin.branch.time_s:.3f} s"
            )
    if len(moved) < len(envelope.axes):
        say(f"at rest in every branch: {', '.join(axis for axis in envelope.axes if axis not in moved)}")
    say(f"the reaction changes between {len(envelope.cliffs)} pairs of neighbouring instants")
    for stimulus, reason in envelope.refused.items():
        say(f"not possible: {stimulus}: {reason}")
    for branch in envelope.failures[:5]:
        say(f"broken at {branch.time_s:.3f} s, {branch.stimulus}: {branch.error or '; '.join(branch.broken)}")
    if len(envelope.failures) > 5:
        say(f"and {len(envelope.failures) - 5} more: the page lists them")
    for row in changed:
        stimulus, measure, before, now = _in_words(row)
        say(f"{stimulus}, {measure}: {before} -> {now}")
    for text in one_sided:
        say(text)
    say(f"page: {page}")


def _moves(envelope: Envelope, axis: str) -> bool:
    """Return whether the machine of an axis moves in any branch, or in the undisturbed motion."""
    positions = envelope.positions.get(axis, ())
    ways = [branch.value("stop_distance", axis) or 0.0 for branch in envelope.branches]
    return max(positions, default=0.0) > min(positions, default=0.0) or max(ways, default=0.0) > 0.0


def _one_sided(other: Envelope, envelope: Envelope) -> list[str]:
    """Return what only one of two envelopes has, in words."""
    return [
        *(f"only in the other envelope: {text}" for text in other.beside(envelope)),
        *(f"only in this envelope: {text}" for text in envelope.beside(other)),
    ]


def _in_words(row: EnvelopeDifference) -> tuple[str, str, str, str]:
    first, second = (
        "no branch has it" if value is None else f"{value:.4g} {row.unit}"
        for value in (row.first, row.second)
    )
    return row.stimulus, f"{row.axis} {row.measure.replace('_', ' ')}", first, second


def _one(
    bench: str,
    *,
    motion: Motion,
    stimuli: list[str],
    cycle: int,
    seed: int,
    watch: float,
    until_rest: float | None,
    report: Path,
    as_json: bool,
) -> int:
    """Run one branch alone, and keep its trace."""
    if len(stimuli) != 1:
        raise ConfigurationError("--stimulus", ", ".join(stimuli), "exactly one together with --cycle")
    with quiet_stdout(as_json):
        file = load_bench_file(bench or None)
        found = witness(file, motion, stimuli[0], cycle, seed=seed, watch_s=watch, rest_s=until_rest)
    archive, _ = found.trace.save(report / "witness")
    if as_json:
        print_json({**found.row, "bench": bench, "trace": str(archive)})
    else:
        out = console()
        out.print(f"{stimuli[0]} in cycle {cycle}: {found.row['reaction']}", markup=False, soft_wrap=True)
        for axis, values in found.row["measures"].items():
            for name, value in values.items():
                out.print(f"{axis} {name.replace('_', ' ')}: {value:.4g}", markup=False)
        out.print(f"trace: {archive}", markup=False)
    return 1 if found.row["broken"] or found.row["error"] else 0
