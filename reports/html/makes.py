"""Makes of controllers side by side: what each made of the same fault, as a table and as curves laid over
each other.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from reports.html.numbers import thin
from reports.json_types import JsonObject
from reports.model import CaseResult, Reaction, RunResult, Signal
from reports.text import own_title, quantity

WORDS: Final = {"s7": "S7 technology object", "nc": "NC axis"}
_BETWEEN: Final = "@"
_BEFORE_S: Final = 0.1
_LEAST_S: Final = 0.4
_MOST_S: Final = 4.0
_POINTS: Final = 300
WIDTH, HEIGHT = 340, 150
_LEFT, _RIGHT, _TOP, _BOTTOM = 44, 8, 10, 20
_LINE: Final = 0.06
"""Share of the distance of two ticks."""
_MUCH: Final = 0.1
"""Share by which a way is longer that is worth a look."""
_OPEN: Final = 3
"""Pairs whose curves are shown at first."""

Floats = NDArray[np.float64]


def pairs(run: RunResult) -> list[list[CaseResult]]:
    """Return the cases that ran on more than one make, the makes of each next to each other."""
    found: dict[str, list[CaseResult]] = {}
    for case in run.cases:
        if case.controller:
            found.setdefault(case.identifier.partition(_BETWEEN)[0], []).append(case)
    return [cases for cases in found.values() if len(cases) > 1]


def side_by_side(run: RunResult) -> list[JsonObject]:
    """Return what the page shows of every pair; empty: no case ran on two makes."""
    shown = [_pair(cases) for cases in pairs(run)]
    # A case that only one make has is worth less of the reader's attention.
    shown.sort(key=lambda pair: not pair["both"])
    for number, pair in enumerate(shown):
        pair["open"] = number < _OPEN
        pair["anchor"] = f"pair-{number + 1}"
    return shown


def _pair(cases: Sequence[CaseResult]) -> JsonObject:
    reactions = [case.reaction for case in cases if case.reaction is not None]
    first = reactions[0] if reactions else None
    return {
        "name": cases[0].identifier.partition(_BETWEEN)[0],
        "title": own_title(cases[0]),
        "cause": first.cause if first else "",
        "velocity": quantity(round(abs(first.velocity), 1), "mm/s") if first else "",
        "makes": [_make(case) for case in cases],
        "both": len(reactions) == len(cases),
        "change": _change(reactions),
        "plots": _plots(cases) if len(reactions) > 1 else [],
    }


def _change(reactions: Sequence[Reaction]) -> JsonObject:
    """Return by how much longer way and time of the last make are than those of the first; empty texts where
    one of them did not stop.
    """
    changes: JsonObject = {"distance": "", "stop": "", "much": False}
    if len(reactions) < 2:
        return changes
    first, last = reactions[0], reactions[-1]
    if first.distance is not None and last.distance is not None:
        longer = last.distance - first.distance
        changes["distance"] = f"{longer:+.2f} mm"
        changes["much"] = abs(longer) > _MUCH * max(first.distance, last.distance)
    if first.stop_s is not None and last.stop_s is not None:
        changes["stop"] = f"{(last.stop_s - first.stop_s) * 1000:+.0f} ms"
    return changes


def _make(case: CaseResult) -> JsonObject:
    reaction = case.reaction
    facts: JsonObject = {
        "key": case.controller,
        "words": WORDS.get(case.controller, case.controller),
        "verdict": case.verdict.value,
        "identifier": case.identifier,
        "message": case.message,
        "shown": reaction is not None,
    }
    if reaction is None:
        return facts
    return {
        **facts,
        "speed": quantity(round(abs(reaction.velocity), 1), "mm/s"),
        "code": reaction.code or "none",
        "number": reaction.code.partition(":")[0].partition(" (")[0] or "none",
        "response": reaction.response or ("goes on" if _moves_on(reaction) else "as commanded"),
        "delay": _time(reaction.delay_s) or "-",
        "stop": _time(reaction.stop_s) or ("moves on" if _moves_on(reaction) else "stood already"),
        "distance": "-" if reaction.distance is None else f"{reaction.distance:.2f} mm",
        "go_on": reaction.go_on or "not tried",
    }


def _moves_on(reaction: Reaction) -> bool:
    return reaction.stop_s is None and abs(reaction.velocity) > 1.0


def _time(value: float | None) -> str:
    return "" if value is None else f"{value * 1000:.0f} ms"


def _plots(cases: Sequence[CaseResult]) -> list[JsonObject]:
    end_s = _LEAST_S
    for case in cases:
        reaction = case.reaction
        if reaction is not None:
            end_s = max(end_s, 1.25 * (reaction.stop_s or 0.0), 1.5 * (reaction.delay_s or 0.0))
    window = (-_BEFORE_S, min(end_s, _MOST_S))
    plots = []
    for title, unit, signal, factor, relative in (
        ("Velocity of the machine", "mm/s", "{drive}.velocity", 1000.0, False),
        ("Way since the cause", "mm", "{drive}.position", 1000.0, True),
        ("Following error", "mm", "{axis}.following_error", 1.0, False),
    ):
        curves = []
        for case in cases:
            found = _curve(case, signal, factor, window, relative=relative)
            if found is not None:
                curves.append((case, *found))
        if len(curves) > 1:
            plots.append(_plot(title, unit, curves, window))
    return plots


def _curve(
    case: CaseResult, name: str, factor: float, window: tuple[float, float], *, relative: bool
) -> tuple[Floats, Floats] | None:
    """Return times from the cause on and values of a signal of a case; None: it is not there."""
    reaction = case.reaction
    if reaction is None:
        return None
    wanted = name.format(drive=reaction.drive, axis=reaction.axis)
    signal: Signal | None = next((one for one in case.signals if one.name == wanted), None)
    if signal is None or not len(signal.time_s):
        return None
    time_s = np.asarray(signal.time_s) - reaction.begin_s
    values = np.asarray(signal.values) * factor
    if relative:
        values = values - values[max(int(np.searchsorted(time_s, 0.0, side="right")) - 1, 0)]
    inside = (time_s >= window[0]) & (time_s <= window[1]) & np.isfinite(values)
    if int(inside.sum()) < 2:
        return None
    time_s, values = time_s[inside], values[inside]
    kept = thin(time_s, values, _POINTS, [0.0])
    return time_s[kept], values[kept]


def _plot(
    title: str,
    unit: str,
    curves: Sequence[tuple[CaseResult, Floats, Floats]],
    window: tuple[float, float],
) -> JsonObject:
    low = min(float(values.min()) for _, _, values in curves)
    high = max(float(values.max()) for _, _, values in curves)
    low, high = min(low, 0.0), max(high, 0.0)
    if high - low < 1e-3:
        low, high = low - 0.5, high + 0.5
    step = _step((high - low) / 3.0)
    # What is beyond the last tick by less than a line is wide does not ask for one more.
    low, high = math.floor(low / step + _LINE) * step, math.ceil(high / step - _LINE) * step

    def x(time_s: float) -> float:
        share = (time_s - window[0]) / (window[1] - window[0])
        return round(_LEFT + share * (WIDTH - _LEFT - _RIGHT), 1)

    def y(value: float) -> float:
        return round(_TOP + (high - value) / (high - low) * (HEIGHT - _TOP - _BOTTOM), 1)

    every = _step((window[1] - window[0]) / 4.0)
    numbers = range(math.ceil(window[0] / every), math.floor(window[1] / every) + 1)
    ticks = [number * every for number in numbers]
    levels = round((high - low) / step)
    lines: list[JsonObject] = []
    for case, time_s, values in curves:
        delay_s = case.reaction.delay_s if case.reaction is not None else None
        mark = None
        if delay_s is not None and window[0] <= delay_s <= window[1]:
            mark = [x(delay_s), y(float(np.interp(delay_s, time_s, values)))]
        lines.append(
            {
                "key": case.controller,
                "points": " ".join(
                    f"{x(float(a))},{y(float(b))}" for a, b in zip(time_s, values, strict=True)
                ),
                "mark": mark,
            }
        )
    return {
        "title": title,
        "unit": unit,
        "lines": lines,
        "zero": x(0.0),
        "x": [[x(tick), f"{tick:g}" if abs(tick) > 1e-9 else "0"] for tick in ticks],
        "y": [[y(low + number * step), f"{low + number * step:g}"] for number in range(levels + 1)],
    }


def _step(rough: float) -> float:
    """Return a round distance of ticks of about this size."""
    power = float(10.0 ** math.floor(math.log10(rough)))
    return next(factor * power for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= rough * 0.999)
