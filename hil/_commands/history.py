"""`hil history`: earlier runs, what changed between two of them, and the past of a case."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from hil._commands.terminal import print_json
from hil.errors import CannotRunError
from reports import Comparison, History, PastRun, compare_runs, replay_command
from reports.model import Verdict
from reports.text import duration, quantity

_ACTIONS: Final = "list; compare A B; show CASE; prune"
_SHOWN: Final = 20


def show_history(words: list[str], *, file: Path, keep: int, every: bool, as_json: bool) -> int:
    """Do the action; returns the exit code: 1 when a comparison has new failures."""
    action, *rest = words or ["list"]
    wanted = {"list": (0,), "compare": (0, 1, 2), "show": (1,), "prune": (0,)}.get(action)
    if wanted is None or len(rest) not in wanted:
        raise CannotRunError(f"hil history {' '.join(words)}: not possible; allowed: {_ACTIONS}")
    with History(file) as history:
        if action == "list":
            return _list(history, as_json=as_json)
        if action == "show":
            return _show(history, rest[0], as_json=as_json)
        if action == "prune":
            gone = history.prune(keep)
            _answer({"deleted": gone}, f"{gone} runs deleted, the last {keep} stay", as_json=as_json)
            return 0
        names = [*rest, "last"] if len(rest) == 1 else rest or ["last-1", "last"]
        base, now = (history.find(name) for name in names)
        return _compare(compare_runs(history, now, base), every=every, as_json=as_json)


def _answer(plain: object, text: str, *, as_json: bool) -> None:
    if as_json:
        print_json(plain)
    else:
        print(text)  # noqa: T201 - the answer


def _plain(run: PastRun) -> dict[str, object]:
    names = (
        "number",
        "started",
        "title",
        "seed",
        "bench",
        "version",
        "state",
        "passed",
        "failed",
        "blocked",
        "errors",
        "simulated_s",
        "wall_s",
        "trace_digest",
    )
    return {**{name: getattr(run, name) for name in names}, "interrupted": bool(run.interrupted)}


def _list(history: History, *, as_json: bool) -> int:
    runs = history.runs()
    lines = [
        (
            f"{'run':>4}  {'started':25}  {'passed':>6} {'failed':>6} {'errors':>6} {'blocked':>7}  "
            f"{'took':>10}  title"
        )
    ]
    lines += [
        f"{run.number:4}  {run.started:25}  {run.passed:6} {run.failed:6} {run.errors:6} {run.blocked:7}  "
        f"{duration(run.wall_s):>10}  {run.title} on {run.bench}, seed {run.seed}"
        + (" (interrupted)" if run.interrupted else "")
        for run in runs
    ]
    _answer([_plain(run) for run in runs], "\n".join(lines), as_json=as_json)
    return 0


def _show(history: History, case: str, *, as_json: bool) -> int:
    past = history.past(case)
    if not past:
        raise CannotRunError(f"{history.path}: no run has a case {case!r}")
    runs = {run.number: run for run in history.runs()}
    lines = [
        f"{one.run:4}  {runs[one.run].started:25}  {one.verdict.value:7}  {duration(one.wall_s):>10}  "
        f"{one.trace_digest[:12]:12}  {one.headline}"
        for one in past
    ]
    plain = [
        {
            "run": one.run,
            "started": runs[one.run].started,
            "verdict": one.verdict.value,
            "headline": one.headline,
            "simulated_s": one.simulated_s,
            "wall_s": one.wall_s,
            "trace_digest": one.trace_digest,
            "token": one.token,
        }
        for one in past
    ]
    last = past[0]
    if last.verdict is not Verdict.PASSED and last.token:
        lines.append(f"repeat the last one with: {replay_command(last.token)}")
    _answer(plain, "\n".join(lines), as_json=as_json)
    return 0


def _compare(found: Comparison, *, every: bool, as_json: bool) -> int:
    if as_json:
        print_json(found.as_dict())
        return 1 if found.new_failures else 0
    base = found.base
    assert base is not None
    head = (
        f"run {found.now.number} ({found.now.started}) against run {base.number} ({base.started}): "
        f"{found.common} cases "
        f"in common, {found.same_traces} traces the same bit for bit"
    )
    lines = [head]
    if (base.bench_digest, base.seed) != (found.now.bench_digest, found.now.seed):
        lines.append("bench or seed differ: numbers of signals are not compared")
    for name, cases in [*found.changes().items(), ("new", found.appeared), ("vanished", found.vanished)]:
        reasons = [
            f"  {case}" + (f": {found.reasons[case]}" if case in found.reasons else "") for case in cases
        ]
        lines += _part(name, reasons, every=every)
    slower = [
        f"  {one.identifier}: {duration(one.now_s)}, expected {duration(one.before_s)}"
        for one in found.slower
    ]
    lines += _part("slower", slower, every=every)
    drift = [
        f"  {one.identifier}: {one.name} {quantity(one.before, one.unit)} -> {quantity(one.now, one.unit)}"
        for one in found.drift
    ]
    lines += _part("drifted", drift, every=every)
    if len(lines) == 1:
        lines.append("nothing has changed")
    print("\n".join(lines))  # noqa: T201 - the answer
    return 1 if found.new_failures else 0


def _part(name: str, rows: list[str], *, every: bool) -> list[str]:
    if not rows:
        return []
    shown = rows if every else rows[:_SHOWN]
    more = [f"  and {len(rows) - len(shown)} more (--all shows them)"] if len(shown) < len(rows) else []
    return [f"{name}: {len(rows)}", *shown, *more]
