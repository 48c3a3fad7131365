"""One branch of an envelope as a case: from its replay token, with checks, evidence and report."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from hil.campaign import Case, CaseSettings, Token, execute_case
from hil.envelope._branching import Branching
from hil.envelope._motion import motion_from
from hil.envelope._stimulus import stimulus_from_text
from hil.errors import TokenError
from reports.model import Check, Verdict

if TYPE_CHECKING:
    from hil.bench.bench import Bench
    from hil.campaign import CaseContext, Execution
    from hil.protocols import BenchFile


def replay_branch(token: Token, text: str, bench_file: BenchFile[Bench]) -> Execution:
    """Run the branch that a token names, and compare its trace with that of the sweep.

    Args:
        token: Of a branch.
        text: The same, for the result.
        bench_file: The bench of the sweep.

    Raises:
        TokenError: The token has no branch, or one that lacks something.
        CannotRunError: The file of the motion is not there or cannot be imported.

    """
    branch: dict[str, Any] = dict(token.branch or {})
    try:
        motion, stimulus = motion_from(branch["motion"]), stimulus_from_text(str(branch["stimulus"]))
        cycle, watch_s, digest = int(branch["cycle"]), float(branch["watch_s"]), str(branch["digest"])
        rest_s = None if branch.get("rest_s") is None else float(branch["rest_s"])
    except (KeyError, TypeError, ValueError) as error:
        raise TokenError(f"the replay token is damaged: its branch lacks {error}") from error
    branching = Branching(
        bench_file, motion, [stimulus], seed=token.seed, watch_s=watch_s, rest_s=rest_s, rules=True
    )

    def run(context: CaseContext) -> None:
        branching.disturbed(context.bench, (cycle, 0))

    case = Case(token.case, f"{motion.name}, {stimulus} in cycle {cycle}", "envelope", run)
    execution = execute_case(case, bench_file, CaseSettings(seed=token.seed, token=text))
    same = execution.trace is not None and execution.trace.digest() == digest
    result = execution.result
    result.checks.append(
        Check(
            "as in the sweep",
            Verdict.PASSED if same else Verdict.FAILED,
            f"digest {digest[:16]}",
            f"digest {result.trace_digest[:16]}",
            sentence="The trace is that of the sweep"
            if same
            else "The trace is not that of the sweep: bench, motion or product have changed since",
        )
    )
    if not same and result.verdict is Verdict.PASSED:
        result.verdict, result.message = Verdict.FAILED, result.checks[-1].sentence
    return execution
