"""Faults of the user program at a cam: it writes into a cam that an axis may be following."""

from __future__ import annotations

from typing import Final

from fieldbus.errors import UnknownNameError
from hil.faults import seams
from hil.faults._kind import Action, Custom, Family, FaultType, Injection
from hil.faults._parameters import Parameter


def _overwrite(injection: Injection) -> Action:
    bench, name = injection.bench, injection.target
    known = bench.cam_names if seams.offers(bench, seams.BenchWithCams) else ()
    if not known:
        injection.refuse("the bench has no cams")
    if name and name not in known:
        raise UnknownNameError(f"{injection.kind.name}: target", name, "a cam", known)
    name = name or known[0]
    assert seams.offers(bench, seams.BenchWithCams)  # it has names of cams
    cam, shift = bench.cam(name), injection.values.number("shift")
    interpolates = injection.values.flag("interpolate")

    def write(more: float) -> None:
        cam.shift_following_values(more)
        if interpolates:
            cam.interpolate()

    return Action(name, lambda: write(shift), lambda: write(-shift))


FAMILY: Final = Family(
    kinds=(
        FaultType(
            "cam.overwrite",
            "The program writes into a cam: all following values are shifted",
            Custom(_overwrite),
            seam="data block of the cam",
            target="cam",
            parameters=(
                Parameter(
                    "shift",
                    "float",
                    "What is added to every following value",
                    minimum=-1e6,
                    maximum=1e6,
                    required=True,
                ),
                Parameter(
                    "interpolate",
                    "bool",
                    "The program calls MC_InterpolateCam as well; a cam in use refuses it (16#80AB)",
                    default=True,
                ),
            ),
            example={"target": "knife", "parameters": {"shift": 2.0}, "duration_s": 0.5},
            text="""
        All valid points and segments get other following values, as by a recipe that is loaded too early. An
        axis that follows the cam keeps its function; the next job has the new one, once it has been
        interpolated. At the end of the fault the former values are written.
        """,
        ),
    ),
)
