"""A page with the attempts of an optimisation of a position controller: what every
setting did, as curves and numbers.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

_COLOURS: Final = ("#0b62a4", "#c0392b", "#2e7d32", "#7b4fa3", "#b26a00", "#00838f", "#ad1457", "#546e7a")


def write_tuning(path: Path, attempts: list[Any] | tuple[Any, ...], *, axis: str, unit: str) -> Path:
    """Write a page that needs no network: position and deviation of every attempt, overshoot and settling
    time over them.

    Args:
        path: File to be written; its folder is made.
        attempts: In the order in which they were made, each with `kv` in 1/s, `kpc` in percent,
            `time_constant` and `settling_s` in s, `overshoot` in `unit`, `good`, and arrays of one length:
            `time_s`, `setpoint`, `actual` in `unit`.
        axis: Name of the axis.
        unit: Position unit.

    Returns:
        `path`.

    """
    from plotly.graph_objects import Figure, Scatter
    from plotly.subplots import make_subplots

    figure: Figure = make_subplots(
        rows=3,
        cols=1,
        vertical_spacing=0.09,
        subplot_titles=("position", "actual position - setpoint", "attempts"),
        specs=[[{}], [{}], [{"secondary_y": True}]],
    )
    last = len(attempts) - 1
    for number, one in enumerate(attempts):
        name = f"{number + 1}: Kv {one.kv:.3g}/s, Kpc {one.kpc:g} %, T {1000 * one.time_constant:g} ms"
        shown: Any = True if number in (0, last) else "legendonly"
        colour = _COLOURS[number % len(_COLOURS)]
        look = {"line": {"color": colour}, "legendgroup": name, "visible": shown}
        figure.add_scatter(
            x=one.time_s,
            y=one.setpoint,
            line={"color": colour, "dash": "dot"},
            legendgroup=name,
            visible=shown,
            showlegend=False,
            name=f"{number + 1}: setpoint",
            row=1,
            col=1,
        )
        figure.add_scatter(x=one.time_s, y=one.actual, name=name, row=1, col=1, **look)
        deviation = one.actual - one.setpoint
        figure.add_scatter(x=one.time_s, y=deviation, name=name, showlegend=False, row=2, col=1, **look)
    numbers = list(range(1, len(attempts) + 1))
    labels = [f"Kv {one.kv:.4g}/s, Kpc {one.kpc:g} %, T {1000 * one.time_constant:g} ms" for one in attempts]
    symbols = ["circle" if one.good else "x" for one in attempts]
    figure.add_trace(
        Scatter(
            x=numbers,
            y=[one.overshoot for one in attempts],
            name=f"overshoot, {unit}",
            text=labels,
            mode="lines+markers",
            marker={"symbol": symbols, "size": 9},
        ),
        row=3,
        col=1,
    )
    figure.add_trace(
        Scatter(
            x=numbers,
            y=[one.settling_s for one in attempts],
            name="settling time, s",
            text=labels,
            mode="lines+markers",
            marker={"symbol": symbols, "size": 9},
        ),
        row=3,
        col=1,
        secondary_y=True,
    )
    best = attempts[-1]
    figure.update_layout(
        title=f"Position controller of {axis}: Kv {best.kv:.4g}/s, Kpc {best.kpc:g} %, T "
        f"{1000 * best.time_constant:g} ms",
        height=1000,
        template="plotly_white",
    )
    figure.update_xaxes(title_text="time, s", row=2, col=1)
    figure.update_xaxes(title_text="attempt (x: it overshoots)", row=3, col=1)
    figure.update_yaxes(title_text=unit, row=1, col=1)
    figure.update_yaxes(title_text=unit, row=2, col=1)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.write_html(path, include_plotlyjs=True, full_html=True)
    return path
