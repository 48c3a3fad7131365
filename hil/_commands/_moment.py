"""A case or test again, from its token, up to an instant, and its bench as it stands there."""

from __future__ import annotations

import sys
from collections.abc import Callable, Generator
from contextlib import ExitStack, redirect_stdout
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from hil._built import listen
from hil._commands._test_run import arguments_of_test
from hil.campaign import CaseContext, Token, load_bench_file, load_campaign
from hil.errors import BlockedError, TokenError

if TYPE_CHECKING:
    from hil.bench.bench import Bench
    from hil.protocols import Bench as ProtocolBench
    from hil.protocols import BenchFile

T = TypeVar("T")
Use = Callable[["Bench", str], T]
"""Gets the bench, whose time stands still, and what it is: `stop-modes/halt on reference at 0.150 s`.

It may let time go on; the bench is closed behind it.
"""


class _ReachedError(BaseException):
    """The instant has come; no `Exception`, which a case may take for its own."""


def _reach() -> None:
    raise _ReachedError


def at_moment(text: str, use: Use[T], *, at_s: float | None = None, reference: str = "") -> T:
    """Repeat what a token stands for, and use its bench as it is at an instant.

    Args:
        text: Token of a case, a test of pytest or a fuzz program.
        use: What is done with the bench.
        at_s: Bench time within the case, s; None for its end.
        reference: Bench in place of that of the token; empty: that of the token.

    Raises:
        TokenError: The token is none, its case is gone, or the case is over before the instant.

    """
    token = Token.decode(text)
    if token.test_file:
        return _of_test(token, use, at_s, reference)
    bench, what = bench_at_moment(token, at_s=at_s, reference=reference)
    with bench:
        return use(bench, what)


def bench_at_moment(token: Token, *, at_s: float | None = None, reference: str = "") -> tuple[Bench, str]:
    """Repeat a case or a fuzz program, and return its bench as it is at an instant, with what it is.

    Args:
        token: Of a case or a program.
        at_s: Bench time within the case, s; None for its end.
        reference: Bench in place of that of the token; empty: that of the token.

    Raises:
        TokenError: It is the token of a test of pytest, the case is gone, or it is over before the instant.

    """
    if token.test_file:
        raise TokenError(f"{token.case} is a test of pytest, which closes its bench by itself")
    bench_file = load_bench_file(reference or token.bench or None)
    call: Callable[[CaseContext], object]
    if token.program is not None:
        from hil.fuzz import Program
        from hil.fuzz._run import check_program

        program = Program.from_json(token.program)
        bench_file = program.configuration.applied_to(bench_file)
        steps = Program(program.steps)
        name, call = token.case, lambda context: check_program(context, steps)
    else:
        campaign = load_campaign(token.campaign)
        if token.case not in campaign:
            raise TokenError(f"{token.campaign} has no case {token.case!r} any more")
        case = campaign[token.case]
        name, call = case.identifier, case.call
    with ExitStack() as stack:
        bench = stack.enter_context(bench_file.build(seed=token.seed))
        if at_s is not None:
            if at_s * 1e9 <= bench.scheduler.now:
                raise TokenError(f"--at {at_s:g}: the bench is ready only after {bench.now_s:.3f} s")
            bench.scheduler.at(round(at_s * 1e9), _reach)
        ending = "ended"
        try:
            call(CaseContext(bench, seed=token.seed))
        except _ReachedError:
            ending = ""
        except (AssertionError, BlockedError) as error:
            ending = f"stopped with: {error}"
        if at_s is not None and ending:
            raise TokenError(f"--at {at_s:g}: the case {ending} at {bench.now_s:.3f} s already")
        stack.pop_all()  # the caller closes it
    return bench, f"{name} on {bench_file.name} at {bench.now_s:.3f} s"


def _of_test(token: Token, use: Use[T], at_s: float | None, reference: str) -> T:
    """Repeat a test of pytest in this process, and use the bench that it builds last."""
    import pytest

    built: list[tuple[Bench, str]] = []
    ready_s: list[float] = []
    found: list[T] = []

    def take(bench: Bench, name: str) -> None:
        if not found:
            found.append(use(bench, f"{token.case} on {name} at {bench.now_s:.3f} s"))

    def on_bench(bench: ProtocolBench, bench_file: BenchFile[ProtocolBench]) -> None:
        from hil.bench.bench import Bench

        assert isinstance(bench, Bench)  # only bench files of the product announce what they build
        built[:] = [(bench, bench_file.name)]
        ready_s[:] = [bench.now_s]
        if at_s is None:
            bench.on_close(lambda: take(bench, bench_file.name) if built[-1][0] is bench else None)
        elif at_s * 1e9 > bench.scheduler.now:
            bench.scheduler.at(round(at_s * 1e9), _reach)

    class Stop:
        """Uses the bench in the middle of the test, while its fixtures are alive."""

        @pytest.hookimpl(wrapper=True)
        def pytest_pyfunc_call(self) -> Generator[None, object, object]:
            try:
                return (yield)
            except _ReachedError:
                take(*built[-1])
                return True

    arguments = arguments_of_test(replace(token, bench=reference or token.bench))
    sys.path.insert(0, str(Path.cwd()))  # as `python -m pytest` does
    stop = listen(on_bench)
    try:
        with redirect_stdout(sys.stderr):
            pytest.main([*arguments, "-q", "--no-header", "--no-summary", "--tb=no"], plugins=[Stop()])
    finally:
        stop()
        sys.path.pop(0)
    if not found:
        why = "built no bench"
        if ready_s:
            early = at_s is not None and at_s <= ready_s[0]
            why = f"has a bench that is ready only after {ready_s[0]:.3f} s" if early else "ended before"
        raise TokenError(f"--at {at_s:g}: {token.case} {why}" if at_s is not None else f"{token.case} {why}")
    return found[0]
