"""What a fault does to the channels of an I/O station."""

from __future__ import annotations

from functools import partial
from typing import Any

from fieldbus.clock import seconds_to_ns
from fieldbus.errors import UnsupportedFaultError
from hil.faults._actions import Action, refuse_unless_supported
from hil.faults._fault import Fault
from hil.protocols import Bench


def io_action(bench: Bench, fault: Fault, stream: str) -> Action:
    """Return the action of a fault at an I/O station.

    Args:
        bench: The bench.
        fault: What to do.
        stream: Name of the random stream of this fault.

    Raises:
        ConfigurationError: The station has no such channel.
        UnsupportedFaultError: The bench has no station.

    """
    find = getattr(bench, "station", None)
    if find is None or not getattr(bench, "station_names", ()):
        raise UnsupportedFaultError(f"{fault.kind} cannot be injected: this bench has no I/O station")
    station = find(fault.target or None)
    refuse_unless_supported(bench, fault, station)
    name, value = str(station.name), fault.value
    if fault.kind == "io.power_off":
        return Action(name, station.power_off, station.power_on)
    number = int(value("number"))
    if fault.kind == "io.bounce":
        station.input(number)
        bounce = _Bounce(bench, fault, station, number, stream)
        return Action(name, bounce.apply, bounce.remove)
    kind = str(value("channel"))
    station.channel(kind, number)
    if fault.kind == "io.stuck":
        stuck = float(value("value"))
        return Action(
            name, lambda: station.stick(kind, number, stuck), lambda: station.stick(kind, number, None)
        )
    if fault.kind == "io.wire_break":
        return Action(
            name,
            lambda: station.break_wire(kind, number, True),
            lambda: station.break_wire(kind, number, False),
        )
    if fault.kind == "io.swapped":
        swap = partial(station.swap, kind, number, int(value("other")))
        station.channel(kind, int(value("other")))
        return Action(name, swap, swap)
    disturb = partial(station.disturb, kind, number)
    wrong = {"offset": value("offset_V"), "gain": value("gain"), "noise": value("noise_V")}
    return Action(name, lambda: disturb(**wrong), disturb)


class _Bounce:
    """A digital input that toggles with intervals from a seeded stream."""

    __slots__ = ("_bench", "_fault", "_number", "_rng", "_station", "_timers")

    def __init__(self, bench: Bench, fault: Fault, station: Any, number: int, stream: str) -> None:
        self._bench = bench
        self._fault = fault
        self._station = station
        self._number = number
        self._rng = bench.rng(stream)
        self._timers: list[Any] = []

    def apply(self) -> None:
        value = self._fault.value
        level = bool(value("level"))
        edges = 2 * int(value("pulses"))
        intervals = self._rng.uniform(float(value("shortest_s")), float(value("longest_s")), edges)
        self._stick(level)
        when = self._bench.scheduler.now
        self._timers = []
        for interval in intervals:
            when += seconds_to_ns(float(interval))
            level = not level
            self._timers.append(self._bench.scheduler.at(when, partial(self._stick, level)))

    def _stick(self, level: bool | None) -> None:
        self._station.stick("input", self._number, level)

    def remove(self) -> None:
        for timer in self._timers:
            timer.cancel()
        self._stick(None)
