"""A page about a stop envelope: reach over the motion, heat map, worst points, cliffs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

Content = Mapping[str, Any]
"""The values of an `envelope.json`."""
_INK: Final = "#7a8592"
"""Text of plots: readable on a light and on a dark page."""


def write_envelope(
    path: Path,
    content: Content,
    measures: Sequence[tuple[str, str]],
    compared: Sequence[Sequence[str]] = (),
    other: str = "",
    *,
    one_sided: Sequence[str] = (),
) -> Path:
    """Write a page that needs no network.

    Args:
        path: File to be written; its folder is made.
        content: The values of an `envelope.json`.
        measures: Name and unit of every measure; `position` stands for the unit of the axis. The first one
            is shown first, and orders the worst points.
        compared: Stimulus, axis with measure, worst value in another envelope, and in this one.
        other: Name of the other envelope.
        one_sided: What only one of the two has, in words.

    Returns:
        `path`.

    """
    from jinja2 import Environment, PackageLoader, select_autoescape
    from markupsafe import Markup

    environment = Environment(loader=PackageLoader("reports.html"), autoescape=select_autoescape(["j2"]))
    axes = []
    for number, name in enumerate(content["axes"]):
        unit = content["units"][name]
        named = [(one, unit if kind == "position" else kind) for one, kind in measures]
        axes.append(
            {
                "name": name,
                "reach": Markup(_reach(content, name, script=number == 0)),  # noqa: S704 - made by plotly
                "heat": Markup(_heat(content, name, named)),  # noqa: S704 - made by plotly
                "measures": [f"{one}, {kind}" for one, kind in named],
                "margins": [_margin(one, unit) for one in content["margins"][name]],
                "worst": [_worst(one, name, named) for one in content["worst"][name]],
            }
        )
    page = environment.get_template("envelope.html.j2").render(
        title=content["motion"],
        e=content,
        axes=axes,
        cliffs=[_cliff(one) for one in content["cliffs"]],
        compared=compared,
        other=other,
        one_sided=one_sided,
        failures=[
            {
                "stimulus": one["stimulus"],
                "at": f"{one['time_s']:.3f} s",
                "text": one["error"] or "; ".join(one["broken"]),
            }
            for one in content["branches"]
            if one["error"] or one["broken"]
        ],
        style=Markup((files("reports.html") / "templates/style.css").read_text("utf-8")),  # noqa: S704 - a file of ours
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(page, encoding="utf-8")
    return path


def _value(branch: Content, axis: str, measure: str) -> float | None:
    value: float | None = branch["measures"].get(axis, {}).get(measure)
    return value


def _by_stimulus(content: Content) -> dict[str, list[Content]]:
    found: dict[str, list[Content]] = {name: [] for name in content["stimuli"]}
    for branch in content["branches"]:
        found[branch["stimulus"]].append(branch)
    return found


def _look(figure: Any, height: int) -> None:
    figure.update_layout(
        height=height,
        margin={"l": 70, "r": 20, "t": 40, "b": 50},
        paper_bgcolor="rgba(0,0,0,0)",
        plot_bgcolor="rgba(0,0,0,0)",
        font={"color": _INK},
        legend={"orientation": "h", "y": -0.2},
    )
    figure.update_xaxes(gridcolor="rgba(122,133,146,.25)", zeroline=False)
    figure.update_yaxes(gridcolor="rgba(122,133,146,.25)", zeroline=False)


def _html(figure: Any, *, script: bool) -> str:
    text: str = figure.to_html(include_plotlyjs=script, full_html=False, config={"displaylogo": False})
    return text


def _between(
    branches: Sequence[Content], cycles: NDArray[np.float64], of: Callable[[Content], float | None]
) -> NDArray[np.float64]:
    """Return a value of a stimulus at every cycle: measured, or in a straight line between its neighbours."""
    known = [(branch["cycle"], value) for branch in branches if (value := of(branch)) is not None]
    if not known:
        return np.full(len(cycles), np.nan)
    return np.interp(cycles, [cycle for cycle, _ in known], [value for _, value in known])


def _reach(content: Content, axis: str, *, script: bool) -> str:
    """Return the plot of the motion, with the places where the machine comes to rest, and the end stops."""
    from plotly.graph_objects import Figure

    figure: Figure = Figure()
    cycle, positions, unit = content["cycle_s"], content["positions"][axis], content["units"][axis]
    times = [cycle * number for number in range(len(positions))]
    cycles = np.array(sorted({float(branch["cycle"]) for branch in content["branches"]}))
    rows = _by_stimulus(content)
    names = list(rows)
    places = np.array(
        [_between(branches, cycles, lambda one: one["rest"].get(axis)) for branches in rows.values()]
    )
    low, high = np.nanmin(places, axis=0), np.nanmax(places, axis=0)
    for side, values, filled in (("lowest", low, None), ("highest", high, "tonexty")):
        place = places.argmin(axis=0) if filled is None else places.argmax(axis=0)
        figure.add_scatter(
            x=cycles * cycle,
            y=values,
            mode="lines",
            line={"width": 1, "color": "rgba(217,119,6,.8)"},
            fill=filled,
            fillcolor="rgba(217,119,6,.22)",
            showlegend=filled is not None,
            name="where the machine comes to rest",
            text=[f"{side}: {names[at]}" for at in place],
            hovertemplate="%{text}<br>%{y:.4g} " + unit + "<extra></extra>",
        )
    figure.add_scatter(x=times, y=positions, mode="lines", name="undisturbed motion")
    for limit in content["margins"][axis]:
        if limit["limit"].startswith("guard") or low.min() - 50.0 < limit["position"] < high.max() + 50.0:
            figure.add_hline(
                y=limit["position"],
                line={"dash": "dash", "color": "#c81e2b"},
                annotation_text=limit["limit"],
            )
    _look(figure, 380)
    figure.update_xaxes(title_text="instant of the stimulus, s")
    figure.update_yaxes(title_text=f"position, {unit}")
    return _html(figure, script=script)


def _heat(content: Content, axis: str, measures: Sequence[tuple[str, str]]) -> str:
    """Return the heat map over instant and stimulus, with a menu of the measures."""
    from plotly.graph_objects import Figure

    rows = _by_stimulus(content)
    cycles = np.array(sorted({float(branch["cycle"]) for branch in content["branches"]}))
    figure: Figure = Figure()
    buttons = []
    for number, (measure, unit) in enumerate(measures):
        figure.add_heatmap(
            x=cycles * content["cycle_s"],
            y=list(rows),
            z=[
                _between(branches, cycles, partial(_value, axis=axis, measure=measure))
                for branches in rows.values()
            ],
            visible=number == 0,
            colorscale="YlOrRd",
            colorbar={"title": unit},
            hovertemplate="%{y}<br>%{x:.3f} s: %{z:.4g} " + unit + "<extra></extra>",
        )
        buttons.append(
            {
                "label": measure.replace("_", " "),
                "method": "update",
                "args": [{"visible": [one == number for one in range(len(measures))]}],
            }
        )
    _look(figure, 160 + 26 * max(len(rows), 4))
    figure.update_layout(
        updatemenus=[{"buttons": buttons, "x": 0, "xanchor": "left", "y": 1.0, "yanchor": "bottom"}]
    )
    figure.update_xaxes(title_text="instant of the stimulus, s")
    figure.update_yaxes(automargin=True)
    return _html(figure, script=False)


def _worst(branch: Content, axis: str, measures: Sequence[tuple[str, str]]) -> dict[str, object]:
    return {
        "stimulus": branch["stimulus"],
        "at": f"cycle {branch['cycle']}, {branch['time_s']:.3f} s",
        "values": [
            "" if (value := _value(branch, axis, name)) is None else f"{value:.4g}" for name, _ in measures
        ],
        "reaction": branch["reaction"],
        "token": branch["token"],
    }


def _margin(margin: Content, unit: str) -> dict[str, object]:
    return {
        "limit": margin["limit"],
        "position": f"{margin['position']:.4g} {unit}",
        "left": f"{margin['left']:.4g} {unit}",
        "beyond": margin["left"] <= 0.0,
        "stimulus": margin["stimulus"],
        "at": f"cycle {margin['cycle']}, {margin['time_s']:.3f} s",
    }


def _cliff(cliff: Content) -> dict[str, str]:
    before, after = cliff["before"], cliff["after"]
    return {
        "stimulus": cliff["stimulus"],
        "between": f"{before['time_s']:.3f} and {after['time_s']:.3f} s",
        "before": before["reaction"],
        "after": after["reaction"],
    }
