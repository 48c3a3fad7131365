"""A curve over its leading value with its derivatives, as a picture: for the page of a case and the handbook.

The geometry is calculated here; what comes out are elements as nested lists, `[tag, attributes, children]`,
as of a homing. Each quantity has a panel of its own, one below the other.
"""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Final, NamedTuple

from reports.cams import CamDrawing
from reports.json_types import Json, JsonObject

Node = list[Json]

_WIDTH: Final = 640.0
_LEFT: Final = 74.0
_RIGHT: Final = 624.0
_TOP: Final = 10.0
_PANEL: Final = 92.0
_GAP: Final = 14.0
_BOTTOM: Final = 26.0


class Panel(NamedTuple):
    """One quantity."""

    label: str
    values: Sequence[float]
    points: Sequence[tuple[float, float]] = ()
    """Given points, each drawn as a dot."""


def picture(x: Sequence[float], panels: Sequence[Panel], *, label: str) -> Node:
    """Return a picture of quantities over a leading value.

    Args:
        x: Leading values, ascending, at least two.
        panels: Quantities with as many values.
        label: What the leading value is called.

    """
    low, high = x[0], x[-1]
    scale = (_RIGHT - _LEFT) / (high - low)
    nodes: list[Json] = []
    top = _TOP
    for number, panel in enumerate(panels):
        nodes += _panel(panel, [_LEFT + (one - low) * scale for one in x], top, number, (low, scale))
        top += _PANEL + _GAP
    base = top - _GAP
    for place, anchor, value in ((_LEFT, "start", low), (_RIGHT, "end", high)):
        nodes.append(text_node(place, base + 16.0, short(value), anchor))
    nodes.append(text_node(0.5 * (_LEFT + _RIGHT), base + 16.0, label, "middle"))
    height = base + _BOTTOM
    return ["svg", {"class": "curve-svg", "viewBox": f"0 0 {_WIDTH:g} {height:g}", "role": "img"}, nodes]


def _panel(
    panel: Panel, places: Sequence[float], top: float, number: int, of_x: tuple[float, float]
) -> list[Json]:
    given = [y for _, y in panel.points]
    low, high = min(0.0, *panel.values, *given), max(0.0, *panel.values, *given)
    # What is 0 but for rounding is 0.
    low, high = (0.0 if abs(one) < 1e-9 * (high - low) else one for one in (low, high))
    if high - low < 1e-12:
        low, high = -1.0, 1.0
    scale = _PANEL / (high - low)

    def at(y: float) -> float:
        return top + (high - y) * scale

    points = " ".join(f"{px:.1f},{at(y):.1f}" for px, y in zip(places, panel.values, strict=True))
    nodes: list[Json] = [
        [
            "rect",
            attributes(x=_LEFT, y=top, width=_RIGHT - _LEFT, height=_PANEL) | {"class": "curve-frame"},
            [],
        ],
        ["line", attributes(x1=_LEFT, x2=_RIGHT, y1=at(0.0), y2=at(0.0)) | {"class": "curve-zero"}, []],
        ["polyline", {"points": points, "class": f"curve-line curve-{number % 4}"}, []],
    ]
    nodes += [
        [
            "circle",
            attributes(cx=_LEFT + (px - of_x[0]) * of_x[1], cy=at(y), r=2.6) | {"class": "curve-point"},
            [],
        ]
        for px, y in panel.points
    ]
    nodes += [
        text_node(_LEFT - 6.0, top + 10.0, short(high), "end"),
        text_node(_LEFT - 6.0, top + _PANEL, short(low), "end"),
        text_node(_LEFT + 6.0, top + 14.0, panel.label, "start"),
    ]
    return nodes


def attributes(**values: float) -> dict[str, Json]:
    """Return numbers as attributes of an element, with one decimal place."""
    return {key: f"{value:.1f}" for key, value in values.items()}


def text_node(x: float, y: float, text: str, anchor: str) -> Json:
    """Return a text at a place; `anchor` says which end of it is there: start, middle, end."""
    return ["text", attributes(x=x, y=y) | {"text-anchor": anchor}, [text]]


def short(value: float) -> str:
    """Return a number with four digits and a proper minus sign."""
    return f"{value:.4g}".replace("-", "\N{MINUS SIGN}")


def cam_payload(cam: CamDrawing) -> JsonObject:
    """Return title, picture and text alternative of a cam, for the page."""
    given = [(point[0], point[1]) for point in cam.points]
    panels = [
        Panel("following value", cam.y, given),
        Panel("first derivative", cam.first),
        Panel("second derivative", cam.second),
    ]
    ranges = ", ".join(f"{one.label} {short(min(one.values))} to {short(max(one.values))}" for one in panels)
    return {
        "title": f"Cam {cam.name}",
        "sub": cam.text,
        "alt": f"Cam {cam.name}, {cam.text}: {ranges}",
        "svg": picture(cam.x, panels, label="leading value"),
    }


def markup(node: Json) -> str:
    """Return a picture as SVG text, for a page that is no program: every text is escaped."""
    if not isinstance(node, list):
        return escape(str(node))
    tag, attributes, children = node
    assert isinstance(attributes, dict)  # as `picture` makes them
    assert isinstance(children, list)
    given = "".join(f' {key}="{escape(str(value), quote=True)}"' for key, value in attributes.items())
    return f"<{tag}{given}>{''.join(map(markup, children))}</{tag}>"
