"""The following position over the leading position of an axis that follows another one, as a picture: for the
page of a case. Each phase of synchronous operation has a colour of its own.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray

from reports.html.curves import Node, attributes, short, text_node
from reports.html.signals import base_name, component
from reports.json_types import Json, JsonObject
from reports.model import Signal

_WIDTH: Final = 640.0
_LEFT: Final = 74.0
_RIGHT: Final = 624.0
_TOP: Final = 30.0
_HEIGHT: Final = 260.0
_POINTS: Final = 600
"""Points of a curve, about."""
_PHASES: Final = ("waiting", "synchronising", "synchronous", "desynchronising", "simulated")
"""Phases by their number in the recording, from 1 on; a colour each."""
_NEEDED: Final = ("sync_phase", "leading_position", "function_position", "actual_position")

Numbers = NDArray[np.float64]


def following_payloads(signals: Iterable[Signal]) -> list[JsonObject]:
    """Return title, picture and text alternative for every axis that followed something."""
    axes: dict[str, dict[str, Signal]] = {}
    for signal in signals:
        axes.setdefault(component(signal.name), {})[base_name(signal.name)] = signal
    found = []
    for axis, own in axes.items():
        if any(name not in own for name in _NEEDED):
            continue
        phase, x, y, actual = (own[name].values for name in _NEEDED)
        if len({len(one) for one in (phase, x, y, actual)}) != 1:
            continue
        follows = np.isfinite(x) & (phase >= 1.0)
        if np.count_nonzero(follows) > 1 and np.ptp(x[follows]) > 0.0:
            found.append(_payload(axis, own["function_position"].unit, phase, np.stack([x, y, actual])))
    return found


def _payload(axis: str, unit: str, phase: Numbers, curves: Numbers) -> JsonObject:
    """Return the picture of one axis; `curves` has leading, following and actual position as rows."""
    follows = np.isfinite(curves[0]) & (phase >= 1.0)
    x, y, actual = curves
    ranges = (float(x[follows].min()), float(x[follows].max()))
    both = np.concatenate([y[follows], actual[follows]])
    heights = (float(both.min()), float(both.max()))
    if heights[1] - heights[0] < 1e-9:
        heights = (heights[0] - 1.0, heights[1] + 1.0)
    scale_x = (_RIGHT - _LEFT) / (ranges[1] - ranges[0])
    scale_y = _HEIGHT / (heights[1] - heights[0])
    places = np.stack([_LEFT + (x - ranges[0]) * scale_x, _TOP + (heights[1] - y) * scale_y])
    real = np.stack([places[0], _TOP + (heights[1] - actual) * scale_y])
    frame = attributes(x=_LEFT, y=_TOP, width=_RIGHT - _LEFT, height=_HEIGHT)
    nodes: list[Json] = [["rect", frame | {"class": "curve-frame"}, []]]
    step = max(1, int(np.count_nonzero(follows)) // _POINTS)
    nodes += [_line(real[:, part], "follow-actual", step) for part in _runs(follows)]
    seen = []
    for number, name in enumerate(_PHASES, 1):
        parts = list(_runs(follows & (np.round(phase) == number)))
        nodes += [_line(places[:, part], f"follow-{number}", step) for part in parts]
        if parts:
            seen.append((number, name))
    for place, (number, name) in enumerate(seen):
        left = _LEFT + 6.0 + 112.0 * place
        nodes.append(
            [
                "line",
                attributes(x1=left, x2=left + 16.0, y1=16.0, y2=16.0) | {"class": f"follow-{number}"},
                [],
            ]
        )
        nodes.append(text_node(left + 20.0, 20.0, name, "start"))
    bottom = _TOP + _HEIGHT
    nodes += [
        text_node(_LEFT - 6.0, _TOP + 10.0, short(heights[1]), "end"),
        text_node(_LEFT - 6.0, bottom, short(heights[0]), "end"),
        text_node(_LEFT, bottom + 16.0, short(ranges[0]), "start"),
        text_node(_RIGHT, bottom + 16.0, short(ranges[1]), "end"),
        text_node(0.5 * (_LEFT + _RIGHT), bottom + 16.0, "leading position", "middle"),
        text_node(_LEFT - 6.0, _TOP - 8.0, unit, "end"),
    ]
    view = f"0 0 {_WIDTH:g} {bottom + 26.0:g}"
    words = ", ".join(name for _, name in seen)
    return {
        "title": f"{axis} over its leading value",
        "sub": "by its function, coloured by phase; the actual position in grey",
        "alt": (
            f"Position of {axis} over the leading one, {short(ranges[0])} to {short(ranges[1])}: {words}; "
            f"following position {short(heights[0])} to {short(heights[1])} {unit}"
        ),
        "svg": ["svg", {"class": "curve-svg", "viewBox": view, "role": "img"}, nodes],
    }


def _runs(flags: NDArray[np.bool_]) -> Iterator[slice]:
    """Return the runs of true flags, each with the sample behind it so that lines meet."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], flags, [False])).astype(np.int8)))
    for start, end in zip(edges[::2], edges[1::2], strict=True):
        yield slice(int(start), int(end))


def _line(places: Numbers, kind: str, step: int) -> Node:
    last = places.shape[1] - 1
    chosen = [*range(0, last, step), last]
    points = " ".join(f"{places[0, one]:.1f},{places[1, one]:.1f}" for one in chosen)
    return ["polyline", {"points": points, "class": kind}, []]
