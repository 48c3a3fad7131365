"""Why a trigger has not fired, in words."""

from __future__ import annotations

from typing import Final

from hil.faults._trigger import InCondition, InState, OnEvent, SignalCrossing, Trigger
from hil.protocols import Bench
from hil.record import Signal

_DAILY: Final = {
    "actual_position": "position",
    "actual_velocity": "velocity",
    "actual_torque": "torque",
    "following_error": "following error",
}


def why_not_fired(bench: Bench, trigger: Trigger, armed_ns: int) -> str:
    """Return what came in place of what a trigger waits for: `velocity of x peaked at 0, asked 45 mm/s`.

    Args:
        bench: The bench.
        trigger: Its signals have a component.
        armed_ns: Since when it waits.

    """
    if isinstance(trigger, SignalCrossing):
        return _crossing(_since(bench, trigger.signal, armed_ns), trigger)
    if isinstance(trigger, InCondition):
        signal = _since(bench, trigger.signal, armed_ns)
        asked = str(trigger).removeprefix(f"when {trigger.signal} ")
        if len(signal) == 0 or trigger.ones or trigger.zeros:
            return f"{_name(signal)} never was as asked: {asked}"
        low, high = signal.values.min(), signal.values.max()
        return f"{_name(signal)} was between {low:g} and {high:g}, asked {asked} {signal.unit}".rstrip()
    if isinstance(trigger, InState):
        states = [
            entry.data.get("to")
            for entry in bench.history.events
            if entry.source == trigger.component and trigger.applies(entry.kind)
        ]
        last = f", it is in {states[-1]}" if states else ""
        return f"{trigger.component} did not come into state {trigger.state}{last}"
    if isinstance(trigger, OnEvent):
        selector = trigger.selector
        seen = sum(entry.time_ns >= armed_ns for entry in selector.select(bench.history.events))
        times = "did not happen" if not seen else f"happened {seen} time{'s' if seen > 1 else ''} only"
        return f"{selector} {times}"
    return str(trigger)


def _since(bench: Bench, name: str, armed_ns: int) -> Signal:
    return bench.recorder.trace()[name].between(armed_ns * 1e-9, bench.scheduler.now * 1e-9)


def _name(signal: Signal) -> str:
    component, _, column = signal.name.partition(".")
    return f"{_DAILY[column]} of {component}" if column in _DAILY else signal.name


def _crossing(signal: Signal, trigger: SignalCrossing) -> str:
    name, asked = _name(signal), f"asked {trigger.value:g} {signal.unit}".rstrip()
    if len(signal) == 0:
        return f"no time has passed since, {asked}"
    low, high = float(signal.values.min()), float(signal.values.max())
    if high < trigger.value:
        return f"{name} peaked at {high:.4g}, {asked}"
    if low > trigger.value:
        return f"{name} fell to {low:.4g} at the lowest, {asked}"
    if trigger.direction == "any":
        return f"{name} stayed at {low:.4g}, {asked}"
    other = "falling" if trigger.direction == "rising" else "rising"
    return f"{name} passed {trigger.value:g} {other} only, asked {trigger.direction}"
