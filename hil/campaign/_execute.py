"""Running one case: fresh bench, function, expectations, always-on checkers, verdict."""

from __future__ import annotations

import gc
import time
import traceback
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

from hil.bench.cam_drawings import cam_drawings
from hil.campaign._case import Case
from hil.campaign._context import CaseContext
from hil.campaign._evidence import (
    MESSAGE_WINDOW,
    build_alarms,
    build_faults,
    build_messages,
    build_signals,
    build_story,
)
from hil.campaign._limits import limit_simulated, limit_wall
from hil.campaign._reaction import reaction_of, shown_to_go_on, tried_to_go_on
from hil.campaign._token import Token
from hil.errors import BlockedError, CaseEndedError, CaseTimeoutError, UnsupportedFaultError
from hil.expect import describe, run_checkers
from hil.protocols import ProfiledBench, TimedBench, VariableBench
from hil.record import Difference, Trace, first_difference, homing_drawings
from reports.model import CaseResult, Check, Reaction, Verdict

if TYPE_CHECKING:
    from hil.bench.bench import Bench
    from hil.protocols import BenchFile

REPEATABLE: Final = "repeatable"
"""Name of the check that `--twice` adds."""


_PROFILE_PREFIXES: Final = {"cia402": "C402-", "profidrive": "PD-"}
"""Profile of a drive -> what the identifiers of its requirements begin with."""


@dataclass(frozen=True)
class Execution:
    """A case that has run."""

    result: CaseResult
    trace: Trace | None
    """None when the bench could not even be built."""
    late_s: float = 0.0
    """By how much a live bench was later than it allows in a failed run, s; 0 otherwise."""


LIVE_REPETITIONS: Final = 2
"""How often a case that failed on a live bench which was too late is repeated before it counts as blocked."""


@dataclass(frozen=True)
class CaseSettings:
    """How a case is run."""

    seed: int = 0
    """Seed of the case."""
    token: str = ""
    twice: bool = False
    """Run it a second time and compare the traces."""
    message_window: int = MESSAGE_WINDOW


def execute_case(case: Case, bench_file: BenchFile[Bench], settings: CaseSettings) -> Execution:
    """Run a case on a fresh bench and return its result with the trace; never raises what the case raises.

    Args:
        case: The case.
        bench_file: Builds the bench (`hil.protocols.BenchFile`).
        settings: Seed and options.

    """
    first = _run_and_clear(case, bench_file, settings)
    repetitions = LIVE_REPETITIONS
    while first.late_s and repetitions:
        repetitions -= 1
        first = _run_and_clear(case, bench_file, settings)
    if first.late_s:
        first.result.verdict = Verdict.BLOCKED
        first.result.message = (
            f"the machine was {first.late_s:.3f} s late, more than the bench allows, in "
            f"{LIVE_REPETITIONS + 1} runs; "
            f"the last of them: {first.result.message}"
        )
    if not settings.twice or first.trace is None:
        return first
    second = _run_and_clear(case, bench_file, replace(settings, twice=False))
    _judge_repetition(first, second)
    return first


def _judge_repetition(first: Execution, second: Execution) -> None:
    """Add the check that both runs left the same trace; a difference makes
    the case an error of the harness.
    """
    result = first.result
    result.wall_s += second.result.wall_s
    difference: Difference | None = None
    if first.trace is not None and second.trace is not None:
        if first.trace.digest() == second.trace.digest():
            result.checks.append(
                Check(
                    REPEATABLE,
                    Verdict.PASSED,
                    "the same trace in both runs",
                    f"digest {result.trace_digest[:16]}",
                    sentence="Both runs left the same trace",
                )
            )
            return
        difference = first_difference(first.trace, second.trace)
    observed = (
        "the second run could not be made" if second.trace is None else f"first difference {difference}"
    )
    result.checks.append(
        Check(
            REPEATABLE,
            Verdict.FAILED,
            "the same trace in both runs",
            observed,
            None if difference is None else difference.time_s,
            sentence=f"The two runs did not leave the same trace: {observed}",
        )
    )
    result.verdict = Verdict.ERROR
    result.message = f"not repeatable: {observed}" + (f"; {result.message}" if result.message else "")


def _run_and_clear(case: Case, bench_file: BenchFile[Bench], settings: CaseSettings) -> Execution:
    """Run a case and free its bench at once: a web of references to itself, a dozen of which take thrice as
    long together.
    """
    collects = gc.isenabled()
    gc.disable()  # until the case is over nearly all that it makes is in use
    try:
        return _run_once(case, bench_file, settings)
    finally:
        if collects:
            gc.enable()
            gc.collect(0)


def _run_once(case: Case, bench_file: BenchFile[Bench], settings: CaseSettings) -> Execution:
    started = time.perf_counter()
    result = CaseResult(
        identifier=case.identifier,
        title=case.title,
        verdict=Verdict.PASSED,
        group=case.group,
        tags=list(case.tags),
        requirements=list(case.requirements),
        seed=settings.seed,
        token=settings.token,
        controller=case.controller,
    )
    context: CaseContext | None = None
    trace: Trace | None = None
    late_s = 0.0
    if case.refusal:
        result.verdict, result.message = Verdict.BLOCKED, case.refusal
        result.requirements = []
        return Execution(result, None)
    try:
        with limit_wall(case.wall_limit_s), bench_file.build(seed=settings.seed) as bench:
            context = CaseContext(bench, seed=settings.seed)
            limit_simulated(bench, case.simulated_limit_s)
            result.requirements = requirements_here(case.requirements, _profiles(bench))
            result.verdict, result.message = _call(case, context)
            context.faults.note_waiting()
            trace = context.trace()
            judged = _judge(case, context, trace, result)
            names = set(trace.names())
            seen, others = trace.looked_at & names, names - trace.looked_at
            if isinstance(bench, VariableBench):
                read, unread = bench.outputs(trace.looked_at)
                seen, others = seen | read, others | unread
            result.looked_at, result.not_looked_at = sorted(seen), sorted(others)
            if result.verdict is Verdict.FAILED:
                late_s = _lateness(bench)
                result.message = "; ".join([result.message, *context.faults.waiting_summary()])
            collect_evidence(
                context, trace, result, signals=case.signals, judged=judged, window=settings.message_window
            )
            context.faults.remove_all()
            if case.controller:
                result.reaction = _reaction(context, trace, result)
    except (BlockedError, UnsupportedFaultError) as error:
        result.verdict, result.message = Verdict.BLOCKED, str(error)
    except (CaseTimeoutError, CaseEndedError) as error:
        result.verdict, result.message = Verdict.ERROR, str(error)
    except Exception as error:  # noqa: BLE001 - whatever breaks outside the case is an error of the harness
        result.verdict, result.message = Verdict.ERROR, _text_of(error)
    result.wall_s = time.perf_counter() - started
    return Execution(result, trace, late_s)


def _reaction(context: CaseContext, trace: Trace, result: CaseResult) -> Reaction | None:
    """Return what the axis made of the fault or stop, and what it takes to move again, which is tried on the
    bench where the case has not shown it.
    """
    bench = context.bench
    axis = next(iter(bench.config.axis), "")
    if not axis:
        return None
    found = reaction_of(trace, context.story, axis=axis, drive=bench.config.axis[axis].drive)
    if found is not None:
        passed = result.verdict is Verdict.PASSED
        found.go_on = shown_to_go_on(context.story, found, passed=passed) or tried_to_go_on(
            bench, axis, disabled=found.cause.startswith("MC_Power")
        )
    return found


def requirements_here(requirements: Sequence[str], profiles: Iterable[str]) -> list[str]:
    """Return the requirements of a case that a bench can check: none of a profile that no drive of it has.

    Args:
        requirements: Identifiers that the case names.
        profiles: Profiles of the drives of the bench; none where it does not tell.

    """
    known = set(profiles)
    absent = tuple(prefix for profile, prefix in _PROFILE_PREFIXES.items() if known and profile not in known)
    return [identifier for identifier in requirements if not identifier.startswith(absent)]


def _profiles(bench: object) -> frozenset[str]:
    return bench.profiles if isinstance(bench, ProfiledBench) else frozenset()


def _lateness(bench: object) -> float:
    """Return by how much a live bench was later than it allows, s: then timing says
    nothing about what was tested.
    """
    if not isinstance(bench, TimedBench):
        return 0.0
    return bench.lateness_s if bench.lateness_s > bench.allowed_lateness_s else 0.0


def _call(case: Case, context: CaseContext) -> tuple[Verdict, str]:
    """Run the function; return the verdict that its way of ending means."""
    try:
        case.call(context)
    except (BlockedError, UnsupportedFaultError) as error:
        return Verdict.BLOCKED, str(error)
    except CaseTimeoutError as error:
        return Verdict.ERROR, str(error)
    except AssertionError as error:
        return Verdict.FAILED, str(error) or _text_of(error)
    except KeyboardInterrupt:
        raise
    except (Exception, SystemExit) as error:  # noqa: BLE001 - a broken case must not end the run
        return Verdict.ERROR, _text_of(error)
    return Verdict.PASSED, ""


def _text_of(error: BaseException) -> str:
    """Return type, text and innermost place of an exception."""
    frames = traceback.extract_tb(error.__traceback__)
    place = f" at {frames[-1].filename}:{frames[-1].lineno} in {frames[-1].name}" if frames else ""
    return f"{type(error).__name__}: {error}{place}"


def _judge(case: Case, context: CaseContext, trace: Trace, result: CaseResult) -> list[str]:
    """Evaluate what the case expects and what every run must obey; returns the
    signals of what does not hold.
    """
    checks = list(context.checks)
    judged: list[str] = []
    if result.verdict is not Verdict.BLOCKED:
        for expectation in context.expectations:
            found = expectation.evaluate(trace)
            checks.extend(found)
            if any(check.verdict is not Verdict.PASSED for check in found):
                judged.extend(expectation.signals_on(trace))
    without = set(case.without)
    checks.extend(check for check in run_checkers(trace) if not without & set(check.requirements))
    result.checks = checks
    bad = [check for check in checks if check.verdict is not Verdict.PASSED]
    if result.verdict is Verdict.PASSED and bad:
        broken = any(check.verdict is Verdict.ERROR for check in bad)
        result.verdict = Verdict.ERROR if broken else Verdict.FAILED
        result.message = "; ".join(describe(check) for check in bad[:3])
        if len(bad) > 3:
            result.message += f"; and {len(bad) - 3} more"
    return [*judged, *(check.signal for check in bad if check.signal)]


def collect_evidence(
    context: CaseContext,
    trace: Trace,
    result: CaseResult,
    *,
    signals: Sequence[str] = (),
    judged: Sequence[str] = (),
    window: int = MESSAGE_WINDOW,
) -> None:
    """Fill a result with story, alarms, faults, messages, signals and digest;
    its checks must be there already.
    """
    result.simulated_s = trace.end_s
    result.trace_digest = trace.digest()
    result.story = build_story(trace, context.story, result.checks)
    result.alarms = build_alarms(trace)
    result.faults = build_faults(trace, context.faults.armed)
    result.messages = build_messages(trace, context.bench.decode, window)
    result.signals = build_signals(trace, signals, judged=judged)
    result.homings = homing_drawings(trace)
    result.cams = cam_drawings(context.bench)


def make_token(case: Case, *, seed: int, campaign: str, bench: str, bench_digest: str) -> str:
    """Return the replay token of a case."""
    return Token(case.identifier, seed, campaign, bench, bench_digest).encode()
