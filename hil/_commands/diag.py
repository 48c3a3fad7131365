"""`hil diag`: what the axes and external encoders of a bench say about themselves, on a fresh bench or in the
middle of a case.
"""

from __future__ import annotations

import sys
from contextlib import redirect_stdout
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from hil._built import listen
from hil._commands._test_run import arguments_of_test
from hil._commands.terminal import console, print_json, quiet_stdout
from hil.campaign import CaseContext, Token, load_bench_file, load_campaign
from hil.errors import BlockedError, TokenError
from motion.s7.controller import ControllerDiagnosis

if TYPE_CHECKING:
    from hil.bench.bench import Bench
    from hil.protocols import Bench as ProtocolBench
    from hil.protocols import BenchFile
    from motion.s7.diagnostics import Diagnosis


def show_diagnosis(
    bench: str, *, token: str, at_s: float | None, after_s: float, axis: str, as_json: bool
) -> int:
    """Dump the diagnosis of the axes of a bench; returns the exit code.

    Args:
        bench: Bench file or embedded name; empty for the default one, or for the one of the token.
        token: Token of a case to be repeated; empty for a bench that is only brought up.
        at_s: Bench time within the case, s; None for its end.
        after_s: Time that a bench without a case runs first, s.
        axis: Name of the only axis or external encoder that is wanted; empty for all.
        as_json: Whether JSON is wanted.

    Raises:
        TokenError: The token is none, or its case is gone.
        ConfigurationError: There is no such axis.

    """
    with quiet_stdout(as_json):
        found, note = _of_case(token, bench, at_s, axis) if token else _of_bench(bench, after_s, axis)
    if as_json:
        print_json(
            {
                "note": note,
                "axes": [one.as_dict() for one in found.objects],
                "controller": found.controller.as_dict(),
            }
        )
        return 0
    console().print(note, markup=False)
    for text in (*(one.text() for one in found.objects), found.controller.text()):
        print(text)  # noqa: T201 - this is the answer
        print()  # noqa: T201
    return 0


class _Snapshot(NamedTuple):
    objects: list[Diagnosis]
    controller: ControllerDiagnosis


def _snapshot(bench: Bench, axis: str) -> _Snapshot:
    return _Snapshot(_of_objects(bench, axis), bench.controller.diagnosis())


def _of_objects(bench: Bench, axis: str) -> list[Diagnosis]:
    encoders = list(bench.external_encoder_names)
    if axis in encoders:
        return [bench.external_encoder(axis).diagnosis()]
    names = [axis] if axis else list(bench.axis_names)
    found = [bench.axis(name).diagnosis() for name in names]
    return found if axis else found + [bench.external_encoder(name).diagnosis() for name in encoders]


def _of_bench(reference: str, after_s: float, axis: str) -> tuple[_Snapshot, str]:
    bench_file = load_bench_file(reference or None)
    with bench_file.build(seed=0) as bench:
        bench.run_for(after_s)
        return _snapshot(bench, axis), f"{bench_file.name} at {bench.now_s:.3f} s"


def _of_case(text: str, reference: str, at_s: float | None, axis: str) -> tuple[_Snapshot, str]:
    token = Token.decode(text)
    if token.program is not None:
        raise TokenError("the token of a fuzz program; hil diag repeats cases of campaigns")
    if token.test_file:
        return _of_test(token, reference, at_s, axis)
    bench_file = load_bench_file(reference or token.bench or None)
    campaign = load_campaign(token.campaign)
    if token.case not in campaign:
        raise TokenError(f"{token.campaign} has no case {token.case!r} any more")
    case = campaign[token.case]
    taken: list[tuple[_Snapshot, float]] = []
    with bench_file.build(seed=token.seed) as bench:

        def take() -> None:
            if not taken:
                taken.append((_snapshot(bench, axis), bench.now_s))

        if at_s is not None:
            if at_s * 1e9 <= bench.scheduler.now:
                raise TokenError(f"--at {at_s:g}: the bench is ready only after {bench.now_s:.3f} s")
            bench.scheduler.at(round(at_s * 1e9), take)
        ending = "ended"
        try:
            case.call(CaseContext(bench, seed=token.seed))
        except (AssertionError, BlockedError) as error:
            ending = f"stopped with: {error}"
        if at_s is not None and not taken:
            raise TokenError(f"--at {at_s:g}: the case {ending} at {bench.now_s:.3f} s already")
        take()
    found, moment = taken[0]
    return found, f"{case.identifier} on {bench_file.name} at {moment:.3f} s"


def _of_test(token: Token, reference: str, at_s: float | None, axis: str) -> tuple[_Snapshot, str]:
    """Repeat a test of pytest in this process, and look at the bench that it builds last."""
    import pytest

    taken: list[tuple[_Snapshot, float, str]] = []
    ready_s: list[float] = []

    def on_bench(bench: ProtocolBench, bench_file: BenchFile[ProtocolBench]) -> None:
        from hil.bench.bench import Bench

        assert isinstance(bench, Bench)  # only bench files of the product announce what they build
        taken.clear()
        ready_s[:] = [bench.now_s]

        def take() -> None:
            if not taken:
                taken.append((_snapshot(bench, axis), bench.now_s, bench_file.name))

        if at_s is None:
            bench.on_close(take)
        elif at_s * 1e9 > bench.scheduler.now:
            bench.scheduler.at(round(at_s * 1e9), take)

    arguments = arguments_of_test(replace(token, bench=reference or token.bench))
    sys.path.insert(0, str(Path.cwd()))  # as `python -m pytest` does
    stop = listen(on_bench)
    try:
        with redirect_stdout(sys.stderr):
            pytest.main([*arguments, "-q", "--no-header", "--no-summary", "--tb=no"])
    finally:
        stop()
        sys.path.pop(0)
    if not taken:
        why = "built no bench"
        if ready_s:
            early = at_s is not None and at_s <= ready_s[0]
            why = f"has a bench that is ready only after {ready_s[0]:.3f} s" if early else "ended before"
        raise TokenError(f"--at {at_s:g}: {token.case} {why}" if at_s is not None else f"{token.case} {why}")
    found, moment, name = taken[0]
    return found, f"{token.case} on {name} at {moment:.3f} s"
