"""`hil envelope`: a motion broken at every cycle; table, page, and one branch alone."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Final

from fieldbus.errors import ConfigurationError, UnknownNameError
from hil._commands.durations import parse_duration
from hil._commands.terminal import CaseProgress, console, print_json, quiet_stdout
from hil.campaign import load_bench_file
from hil.envelope import MEASURES, Envelope, load_envelope, stimulus_from_text, sweep, witness
from hil.errors import CannotRunError
from hil.faults import CATALOGUE
from reports.html.envelope import write_envelope

if TYPE_CHECKING:
    from hil.bench.bench import Bench

USUAL: Final = ("operator.disable", "operator.halt", "operator.stop", "drive.fault:code=0x2310", "drive.sto")
"""Stimuli where none are given."""
Body = Callable[["Bench"], object]


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


def own_motion(reference: str) -> tuple[str, Body, Body | None]:
    """Return name, motion and what goes before it of a file: `FILE.py` or `FILE.py:NAME`.

    Raises:
        CannotRunError: There is no such file or function, or it cannot be imported.

    """
    path, _, name = reference.partition(":")
    file = Path(path)
    spec = importlib.util.spec_from_file_location(f"hil_envelope_{file.stem}", file)
    if spec is None or spec.loader is None or not file.is_file():
        raise CannotRunError(f"{path}: no Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise CannotRunError(f"{path} cannot be imported: {type(error).__name__}: {error}") from error
    wanted = name or "motion"
    motion = getattr(module, wanted, None)
    if not callable(motion):
        functions = [
            one for one, value in vars(module).items() if callable(value) and not one.startswith("_")
        ]
        raise UnknownNameError(path, wanted, "a function", functions)
    before = getattr(module, "before", None)
    return f"{file.name}:{wanted}", motion, before if callable(before) else None


def usual_motion(axis: str, to: float, velocity: float) -> tuple[str, Body, Body]:
    """Return name, motion and what goes before it: enable, set to zero, move to a position."""

    def before(bench: Bench) -> None:
        name = axis or bench.axis_names[0]
        if bench.config.axis[name].controller == "nc":
            nc = bench.axis(name, controller="nc")
            bench.wait_until(nc.power().status, 5.0, f"{name} is enabled")
            nc.set_position(0.0)
            bench.run_for(0.05)
            return
        handle = bench.axis(name)
        bench.wait_until(handle.power().status, 5.0, f"{name} is enabled")
        bench.wait_until(handle.home(0.0, mode=0).done, 1.0, f"{name} is homed")

    def motion(bench: Bench) -> None:
        name = axis or bench.axis_names[0]
        if bench.config.axis[name].controller == "nc":
            done = bench.axis(name, controller="nc").move_absolute(to, Velocity=velocity).done
        else:
            done = bench.axis(name).move_absolute(to, Velocity=velocity).done
        bench.wait_until(done, 60.0, f"{name} is at {to:g}")

    return f"MC_MoveAbsolute to {to:g} at {velocity:g}/s", motion, before


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
    seed: int,
    jobs: int,
    budget: str,
    report: Path,
    resume: bool,
    cycle: int | None,
    against: Path | None,
    as_json: bool,
) -> int:
    """Sweep, tell, return the exit code: 1 when a rule was broken or a copy came to no end."""
    chosen = list(stimuli) or list(USUAL)
    if "all" in chosen:
        chosen = [*(one for one in chosen if one != "all"), *USUAL[:3], *all_faults()]
    name, motion, before = own_motion(own) if own else usual_motion(axis, to, velocity)
    if cycle is not None:
        return _one(
            bench,
            motion=motion,
            before=before,
            stimuli=chosen,
            cycle=cycle,
            seed=seed,
            watch=watch,
            report=report,
            as_json=as_json,
        )
    with quiet_stdout(as_json):
        file = load_bench_file(bench or None)
        other = None if against is None else load_envelope(against)
        with CaseProgress(1, "branches") as progress:
            envelope = sweep(
                file,
                motion,
                [stimulus_from_text(one) for one in chosen],
                before=before,
                every=1 if every == "cycle" else parse_every(every),
                seed=seed,
                watch_s=watch,
                jobs=jobs,
                budget_s=parse_duration("--budget", budget) or None,
                folder=report,
                resume=resume,
                name=name,
                on_branch=lambda done, planned: progress.step(done, f"{planned - done} left"),
            )
    page = write_envelope(
        report / "envelope.html", envelope.to_json(), [(one.name, one.unit) for one in MEASURES.values()]
    )
    if as_json:
        print_json({**_summary(envelope), "report": str(page)})
    else:
        _tell(envelope, other, page)
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


def _tell(envelope: Envelope, other: Envelope | None, page: Path) -> None:
    out = console()

    def say(text: str) -> None:
        out.print(text, markup=False, soft_wrap=True)

    say(
        f"{len(envelope.branches)} branches off {envelope.cycles} cycles of {envelope.motion}, "
        f"{len(envelope.stimuli)} stimuli"
    )
    if envelope.skipped:
        say(f"{envelope.skipped} branches left out: the budget was used up")
    for axis in envelope.axes:
        for measure in MEASURES:
            if not any(branch.value(measure, axis) is not None for branch in envelope.branches):
                continue
            worst = envelope.worst(measure, axis=axis)
            say(
                f"{axis} {measure.replace('_', ' ')}: {worst.value:.4g} {worst.unit} at "
                f"{worst.branch.time_s:.3f} s (cycle {worst.branch.cycle}), {worst.branch.stimulus}: "
                f"{worst.branch.reaction}"
            )
    say(f"the reaction changes between {len(envelope.cliffs)} pairs of neighbouring instants")
    for stimulus, reason in envelope.refused.items():
        say(f"not possible: {stimulus}: {reason}")
    for branch in envelope.failures[:5]:
        say(f"broken at {branch.time_s:.3f} s, {branch.stimulus}: {branch.error or '; '.join(branch.broken)}")
    if len(envelope.failures) > 5:
        say(f"and {len(envelope.failures) - 5} more: the page lists them")
    if other is not None:
        for row in other.compared(envelope):
            if row.first != row.second:
                values = [
                    "none" if value is None else f"{value:.4g} {row.unit}"
                    for value in (row.first, row.second)
                ]
                say(f"{row.stimulus}, {row.axis} {row.measure.replace('_', ' ')}: {values[0]} -> {values[1]}")
    say(f"page: {page}")


def _one(
    bench: str,
    *,
    motion: Body,
    before: Body | None,
    stimuli: list[str],
    cycle: int,
    seed: int,
    watch: float,
    report: Path,
    as_json: bool,
) -> int:
    """Run one branch alone, and keep its trace."""
    if len(stimuli) != 1:
        raise ConfigurationError("--stimulus", ", ".join(stimuli), "exactly one together with --cycle")
    with quiet_stdout(as_json):
        file = load_bench_file(bench or None)
        found = witness(file, motion, stimuli[0], cycle, before=before, seed=seed, watch_s=watch)
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
