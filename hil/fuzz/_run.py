"""Running a fuzz program on a bench: invariants in every cycle, rules on the trace when it has ended."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final

from fieldbus.errors import ConfigurationError
from hil.campaign import CaseContext, Token
from hil.campaign._execute import collect_evidence
from hil.errors import BlockedError, CaseTimeoutError, ExpectationFailedError, UnsupportedFaultError
from hil.expect import ALWAYS_ON, SEARCH_RULES, run_checkers, undecided_until
from hil.faults import Fault, Injector
from hil.fuzz._device_hands import DeviceHands
from hil.fuzz._device_jobs import DEVICE_JOBS
from hil.fuzz._hands import Hands, hands_of
from hil.fuzz._invariants import Invariant, NamedJob, OneJobOutput, Violation, default_invariants
from hil.fuzz._program import REMOVE_FAULTS, Break, Program, Step, Wait
from hil.record import Trace
from reports.model import CaseResult, Check, Verdict

if TYPE_CHECKING:
    from hil.bench.bench import Bench
    from hil.protocols import BenchFile

InvariantFactory = Callable[["Bench"], list[Invariant]]
STEP_S: Final = 0.012
"""Bench time after every instruction, so that its edge is seen."""
DEVICES: Final = " devices"
"""Whose hands ask the devices: no axis has this name."""
SETTLE_S: Final = 1.0
"""Bench time after the last step."""
_RULES: Final = (*ALWAYS_ON, *SEARCH_RULES)


class _BrokenError(Exception):
    """Ends a program when an invariant is broken."""

    def __init__(self, violation: Violation) -> None:
        super().__init__(str(violation))
        self.violation = violation


@dataclass
class FuzzOutcome:
    """What a program has shown."""

    program: Program
    seed: int
    violation: Violation | None
    """The first broken invariant; None when all held."""
    skipped: list[str]
    """Steps that this bench cannot do."""
    trace: Trace
    result: CaseResult
    """The same as a case; see `evidence` of `run_program`."""

    def as_case(self, identifier: str = "") -> CaseResult:
        """Return the outcome as a case under a name."""
        self.result.identifier = identifier or self.program.name
        return self.result


def run_program(
    program: Program,
    bench_file: BenchFile[Bench],
    *,
    seed: int = 0,
    invariants: InvariantFactory = default_invariants,
    evidence: bool = True,
) -> FuzzOutcome:
    """Run a program on a fresh bench until an invariant breaks or it ends; then judge its trace by the rules.

    An exception out of the product counts as a broken invariant too: nothing that
    a program can say may crash it.

    Args:
        program: What to do.
        bench_file: Builds the bench.
        seed: Seed of the bench.
        invariants: Makes the invariants for a bench.
        evidence: Whether there is evidence (story, messages, signals) also when nothing is broken. It takes a
            fifth of the time.

    Raises:
        ConfigurationError: The configuration of the program is refused for this bench.
        CannotRunError: The program has a configuration, and the bench comes from no bench file.

    """
    bench_file = program.configuration.applied_to(bench_file)
    try:
        bench = bench_file.build(seed=seed)
    except ConfigurationError:
        raise
    except Exception as error:  # noqa: BLE001 - a bench that is described validly has to come up
        return _not_up(program, seed, error)
    with bench:
        context = CaseContext(bench, seed=seed)
        watched = invariants(bench)
        violation, skipped = _run_in(context, program, watched)
        trace = context.trace()
        checks = run_checkers(trace, _RULES)
        if violation is None:
            violation = _first_broken(trace, checks)
        result = _result(program, seed, violation, watched, checks)
        if evidence or violation is not None:
            collect_evidence(context, trace, result)
        return FuzzOutcome(program, seed, violation, skipped, trace, result)


def check_program(
    context: CaseContext,
    program: Program,
    *,
    complete: bool = True,
    invariants: InvariantFactory = default_invariants,
) -> None:
    """Run a program in a case of a campaign: all invariants and rules of a search have to hold.

    Args:
        context: Of the case.
        program: What to do.
        complete: Whether every step has to be possible; otherwise those that are not are left out.
        invariants: Makes the invariants for a bench.

    Raises:
        ExpectationFailedError: An invariant is broken; the case ends *failed*.
        BlockedError: The bench cannot do a step of the program; without it nothing would be said by the rest.

    """
    watched = invariants(context.bench)
    violation, skipped = _run_in(context, program, watched)
    trace = context.trace()
    found = run_checkers(trace, SEARCH_RULES)
    if violation is None:
        violation = _first_broken(trace, found)
    context.checks.extend(_checks(watched, violation, found))
    if violation is not None:
        raise ExpectationFailedError(str(violation))
    if skipped and complete:
        raise BlockedError(f"a step of the program is not possible on this bench: {skipped[0]}")


def _run_in(
    context: CaseContext, program: Program, watched: Sequence[Invariant]
) -> tuple[Violation | None, list[str]]:
    """Run a program on the bench of a context; returns the first broken invariant and the steps left out."""
    skipped: list[str] = []
    _install(context.bench, watched)
    jobs: list[NamedJob] = next((one.jobs for one in watched if isinstance(one, OneJobOutput)), [])
    hands: dict[str, Hands] = {}
    try:
        for step in program.steps:
            _perform(step, context, hands, jobs.append, skipped)
        context.run_for(SETTLE_S)
        horizon_s = undecided_until(context.trace())
        if horizon_s > context.now_s:
            context.run_for(horizon_s - context.now_s + SETTLE_S / 10)
    except _BrokenError as broken:
        return broken.violation, skipped
    except CaseTimeoutError:
        raise
    except Exception as error:  # noqa: BLE001 - whatever escapes is the finding
        return Violation("no crash", context.now_s, _crash(error)), skipped
    return None, skipped


def _install(bench: Bench, watched: Sequence[Invariant]) -> None:
    def look() -> None:
        for invariant in watched:
            problem = invariant.cycle()
            if problem:
                now_s = bench.scheduler.now * 1e-9
                raise _BrokenError(Violation(invariant.name, now_s, problem, invariant.requirements))

    for invariant in watched:
        bench.history.listen(invariant.event)
    bench.on_cycle(look)


def _of_first_axis(fault: Fault, bench: Any) -> Fault:
    """Return a fault without target as one of the first axis or its drive: a search looks at these."""
    of_drive = fault.entry.target in {"drive", "switch", "mechanics", "encoder"}
    if fault.target or not (of_drive or fault.entry.target == "axis"):
        return fault
    axis = bench.axis()
    if not of_drive:
        return replace(fault, target=axis.name)
    return replace(fault, target=bench.drive_of(axis.name)) if hasattr(bench, "drive_of") else fault


def injectable(fault: Fault, bench: Bench) -> bool:
    """Return whether a bench takes a fault on its first axis; the fault acts on it for a moment."""
    injector = Injector(bench)
    try:
        injector.arm(_of_first_axis(fault, bench))
    except (UnsupportedFaultError, BlockedError, ConfigurationError):
        return False
    injector.remove_all()
    return True


def _perform(
    step: Step,
    context: CaseContext,
    hands: dict[str, Hands],
    watch: Callable[[NamedJob], object],
    skipped: list[str],
) -> None:
    if isinstance(step, Wait):
        context.run_for(step.seconds)
        return
    if isinstance(step, Break):
        try:
            context.faults.arm(_of_first_axis(step.fault, context.bench))
        except (UnsupportedFaultError, BlockedError, ConfigurationError) as error:
            _skip(step, error, context, skipped)
        return
    context.do(str(step))
    if step.job == REMOVE_FAULTS:
        context.faults.remove_all()
    else:
        whose = DEVICES if step.job in DEVICE_JOBS else step.axis
        try:
            if whose not in hands:
                hands[whose] = (
                    DeviceHands(context.bench)
                    if whose == DEVICES
                    else hands_of(context.bench, step.axis, watch)
                )
            hands[whose].do(step)
        except ConfigurationError as error:
            _skip(step, error, context, skipped)
    context.run_for(STEP_S)


def _skip(step: Step, error: Exception, context: CaseContext, skipped: list[str]) -> None:
    """Take note of a step that the bench cannot do: an instruction, or a word of
    a telegram, that is not there.
    """
    skipped.append(f"{step}: {error}")
    context.observe(f"skipped: {error}")


def _first_broken(trace: Trace, checks: Sequence[Check]) -> Violation | None:
    """Return the rule that was broken first; None when all held."""
    failed = [check for check in checks if check.verdict is not Verdict.PASSED]
    if not failed:
        return None
    first = min(failed, key=lambda check: float("inf") if check.time_s is None else check.time_s)
    when = trace.end_s if first.time_s is None else first.time_s
    return Violation(
        first.name, when, f"expected {first.expected}; {first.observed}", tuple(first.requirements)
    )


def _not_up(program: Program, seed: int, error: Exception) -> FuzzOutcome:
    """Return the outcome of a program whose bench has not even started."""
    violation = Violation("the bench comes up", 0.0, _crash(error), ("STP-015", "STP-030"))
    return FuzzOutcome(program, seed, violation, [], Trace(()), _result(program, seed, violation, (), ()))


def _crash(error: Exception) -> str:
    place = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__}: {error} at {place.filename}:{place.lineno}"


def _result(
    program: Program,
    seed: int,
    violation: Violation | None,
    watched: Sequence[Invariant],
    rules: Sequence[Check],
) -> CaseResult:
    result = CaseResult(
        identifier=program.name,
        title="Fuzz program",
        verdict=Verdict.PASSED if violation is None else Verdict.FAILED,
        message="" if violation is None else str(violation),
        group="fuzz",
        tags=["fuzz"],
        seed=seed,
    )
    result.checks.extend(_checks(watched, violation, rules))
    return result


def _checks(watched: Sequence[Invariant], violation: Violation | None, rules: Sequence[Check]) -> list[Check]:
    """Return invariants and rules as checks of a case; a violation that is no rule's comes last."""
    checks = list(rules)
    checks += [
        Check(
            invariant.name,
            Verdict.PASSED,
            "in every cycle",
            "held",
            requirements=list(invariant.requirements),
        )
        for invariant in watched
        if violation is None or violation.invariant != invariant.name
    ]
    if violation is not None and all(check.name != violation.invariant for check in rules):
        checks.append(
            Check(
                violation.invariant,
                Verdict.FAILED,
                "in every cycle",
                violation.text,
                violation.time_s,
                requirements=list(violation.requirements),
            )
        )
    return checks


def program_token(program: Program, *, seed: int, bench: str = "", bench_digest: str = "") -> str:
    """Return the replay token of a program."""
    return Token(program.name, seed, "", bench, bench_digest, program.to_json()).encode()
