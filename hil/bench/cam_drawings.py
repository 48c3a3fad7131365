"""From the cams of a bench to what the report draws of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from reports.cams import CamDrawing

if TYPE_CHECKING:
    from motion.s7.cam_handle import CamHandle

_SAMPLES: Final = 360
_POINTS: Final = 200
"""More points than these are no longer drawn each."""


def cam_drawings(bench: Any) -> list[CamDrawing]:
    """Return a drawing of every cam of a bench that is interpolated; benches of other makes may have none."""
    found = []
    for name in getattr(bench, "cam_names", ()):
        cam: CamHandle = bench.cam(name)
        curve = cam.curve
        if curve is None:
            continue
        step = curve.period / _SAMPLES
        x = [curve.start + number * step for number in range(_SAMPLES)] + [curve.end]
        values = [curve.evaluate(one) for one in x]
        points = cam.object.data.points
        shown = points if len(points) <= _POINTS and not cam.object.data.changed else []
        found.append(
            CamDrawing(
                cam.name,
                cam.summary().partition(": ")[2],
                x,
                [one[0] for one in values],
                [one[1] for one in values],
                [one[2] for one in values],
                [[one.x, one.y] for one in shown],
            )
        )
    return found
