"""`hil judge`: expectations on what was recorded somewhere else, a bus log of a machine or a saved trace."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Final

from hil._commands.run import exit_code, finish, tell
from hil._commands.terminal import console, print_json, quiet_stdout
from hil.campaign import environment_facts, load_bench_file
from hil.errors import CannotRunError, RecordingError
from hil.expect import Expectation, describe, run_checkers
from hil.record import Trace
from reports.json_types import JsonObject
from reports.model import CaseResult, Check, RunResult, Verdict
from reports.summary import summary
from reports.text import check_sentence, margin

if TYPE_CHECKING:
    from hil.logs import LogTrace
    from hil.record import BusFrame

_SAVED_FRAMES: Final = 2_000_000
_FORM: Final = (
    "a list EXPECTATIONS of expectations of hil.expect, a dictionary of such lists by case, or a function "
    "expectations(trace) that returns one of them"
)


@dataclass(frozen=True)
class JudgeRequest:
    """What `hil judge` is asked for."""

    log: Path
    expect: Path
    bench: str = ""
    report: Path = Path("hil-report-judge")
    channels: tuple[str, ...] = ()
    """SEGMENT=CHANNEL each."""
    as_json: bool = False


@dataclass
class _Recording:
    trace: Trace
    decode: Callable[[BusFrame], str] = repr
    notes: list[str] = field(default_factory=list)
    bench_name: str = ""
    bench_text: str = ""


def judge_log(request: JudgeRequest) -> int:
    """Judge a recording, write the report, and return the exit code of `hil run`.

    Raises:
        CannotRunError: The log or the file of expectations cannot be used; the message says why.

    """
    started = datetime.now(UTC).isoformat(timespec="seconds")
    with quiet_stdout(request.as_json):
        recording = _read(request)
        wanted, without = read_expectations(request.expect, recording.trace)
        if recording.trace.from_log:
            recording.notes.append(_rules_text(recording.trace))
        run = RunResult(
            title=f"{request.log.name} judged by {request.expect.name}",
            seed=0,
            bench_name=recording.bench_name,
            bench_text=recording.bench_text,
            environment=environment_facts(),
            started=started,
        )
        for name, expectations in wanted.items():
            run.cases.append(_judge(request, recording, name, expectations, without))
        request.report.mkdir(parents=True, exist_ok=True)
        paths = finish(run, request.report)
        saved = _save(recording.trace, request)
    if request.as_json:
        print_json(
            {
                **summary(run, report=str(paths.report), junit=str(paths.junit)),
                "trace": "" if saved is None else str(saved),
                "notes": recording.notes,
                "cases": [
                    {"case": case.identifier, "verdict": case.verdict.value, "checks": _plain(case.checks)}
                    for case in run.cases
                ],
            }
        )
    _tell(run, recording)
    tell(run, paths)
    if saved is not None:
        console().print(f"trace: {saved}", markup=False)
    return exit_code(run)


def _save(trace: Trace, request: JudgeRequest) -> Path | None:
    """Save what was decoded next to the report; None for what was a saved trace before.

    A log of millions of frames is saved without them: they are in the log.
    """
    if not trace.from_log:
        return None
    if sum(len(trace.raw_frames(bus)) for bus in trace.buses) > _SAVED_FRAMES:
        trace = trace.without_frames()
    return trace.save(request.report / "trace.npz")[0]


def _rules_text(trace: Trace) -> str:
    """Return which of the rules that hold in every run a log can be judged by."""
    judged = [check.name for check in run_checkers(trace)]
    verdict = f"are judged: {', '.join(judged)}" if judged else "cannot be judged at all"
    return f"of the rules that hold in every run {verdict}; the others need what a log does not hold"


def _plain(checks: Sequence[Check]) -> list[JsonObject]:
    return [
        {
            "name": check.name,
            "verdict": check.verdict.value,
            "sentence": check_sentence(check),
            "expected": check.expected,
            "observed": check.observed,
            "time_s": check.time_s,
            "value": check.value,
            "unit": check.unit,
            "low": check.low,
            "high": check.high,
            "margin": margin(check),
            "requirements": check.requirements,
        }
        for check in checks
    ]


def _tell(run: RunResult, recording: _Recording) -> None:
    out = console()
    for note in recording.notes:
        out.print(f"note: {note}", markup=False, style="yellow")
    for case in run.cases:
        out.print(f"{case.verdict.value}  {case.identifier}", markup=False)
        for check in case.checks:
            if check.verdict is not Verdict.PASSED:
                out.print(f"  {describe(check)}", markup=False)


def _read(request: JudgeRequest) -> _Recording:
    path = request.log
    if path.suffix in (".npz", ".json"):
        try:
            trace = Trace.load(path)
        except RecordingError as error:
            raise CannotRunError(str(error)) from error
        return _Recording(trace)
    from hil.logs import read_bus_log, trace_of_log

    log = read_bus_log(path)
    decoded: LogTrace = trace_of_log(
        log, load_bench_file(request.bench), channels=_channels(request.channels)
    )
    return _Recording(decoded.trace, decoded.decode, decoded.notes, decoded.bench_name, decoded.bench_text)


def _channels(given: Sequence[str]) -> dict[str, str]:
    pairs = {}
    for text in given:
        segment, sign, channel = text.partition("=")
        if not sign or not segment:
            raise CannotRunError(
                f"--channel {text!r} is not allowed; allowed: SEGMENT=CHANNEL, such as can0=vcan1"
            )
        pairs[segment] = channel
    return pairs


def read_expectations(path: Path, trace: Trace) -> tuple[dict[str, list[Expectation]], set[str]]:
    """Return the expectations of a Python file by case, and the requirements whose rules it does without.

    Raises:
        CannotRunError: There is no such file, it cannot be imported, or holds something else.

    """
    from hil.campaign._discover import import_file

    if not path.is_file() or path.suffix != ".py":
        what = "is no Python file" if path.exists() else "does not exist"
        raise CannotRunError(f"--expect {path}: the file {what}; it holds {_FORM}")
    module = import_file(path)
    found: object = getattr(module, "EXPECTATIONS", None)
    function = getattr(module, "expectations", None)
    if found is None and callable(function):
        found = function(trace)
    if found is None:
        raise CannotRunError(f"--expect {path}: the file does not say what to expect; it holds {_FORM}")
    cases = found if isinstance(found, Mapping) else {path.stem: found}
    result: dict[str, list[Expectation]] = {}
    for name, listed in cases.items():
        content = [listed] if isinstance(listed, Expectation) else listed
        if not isinstance(content, (list, tuple)) or not content:
            raise CannotRunError(f"--expect {path}: {name!r} is {content!r}; allowed: {_FORM}, not empty")
        for one in content:
            if not isinstance(one, Expectation):
                raise CannotRunError(
                    f"--expect {path}: {name!r} holds {one!r}, which is no expectation of hil.expect"
                )
        result[str(name)] = list(content)
    if not result:
        raise CannotRunError(f"--expect {path}: the dictionary is empty; the file holds {_FORM}")
    return result, {str(one) for one in getattr(module, "WITHOUT", ())}


def _judge(
    request: JudgeRequest,
    recording: _Recording,
    name: str,
    expectations: Sequence[Expectation],
    without: set[str],
) -> CaseResult:
    from hil.campaign._evidence import build_alarms, build_messages, build_signals, build_story

    begun = time.perf_counter()
    trace = recording.trace
    checks: list[Check] = []
    judged: list[str] = []
    for expectation in expectations:
        found = expectation.evaluate(trace)
        checks += found
        if any(check.verdict is not Verdict.PASSED for check in found):
            judged += expectation.signals_on(trace)
    checks += [check for check in run_checkers(trace) if not without & set(check.requirements)]
    result = CaseResult(name, f"{request.log.name}: {name}", _verdict(checks), group=request.expect.stem)
    bad = [check for check in checks if check.verdict is not Verdict.PASSED]
    result.message = "; ".join(describe(check) for check in bad[:3])
    if len(bad) > 3:
        result.message += f"; and {len(bad) - 3} more"
    result.checks = checks
    result.simulated_s = trace.end_s
    result.trace_digest = trace.digest()
    result.story = build_story(trace, [], checks)
    result.alarms = build_alarms(trace)
    judged += [check.signal for check in bad if check.signal]
    times = [check.time_s for check in bad if check.time_s is not None]
    result.messages = build_messages(trace, recording.decode, times_s=times)
    result.signals = build_signals(trace, judged=judged)
    result.wall_s = time.perf_counter() - begun
    return result


def _verdict(checks: Sequence[Check]) -> Verdict:
    """Return the worst: an error, then a failure, then what this recording could not answer."""
    for verdict in (Verdict.ERROR, Verdict.FAILED, Verdict.BLOCKED):
        if any(check.verdict is verdict for check in checks):
            return verdict
    return Verdict.PASSED
