"""`hil diag`: what the axes and external encoders of a bench say about themselves, on a fresh bench or in the
middle of a case.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from hil._commands._moment import at_moment
from hil._commands.terminal import console, print_json, quiet_stdout
from hil.campaign import load_bench_file
from motion.s7.controller import ControllerDiagnosis

if TYPE_CHECKING:
    from hil.bench.bench import Bench
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
        if token:
            found, note = at_moment(
                token, lambda built, what: (_snapshot(built, axis), what), at_s=at_s, reference=bench
            )
        else:
            found, note = _of_bench(bench, after_s, axis)
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
