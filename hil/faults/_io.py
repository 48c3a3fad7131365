"""What a fault does to the channels of an I/O station."""

from __future__ import annotations

from functools import partial
from typing import Any

from fieldbus.errors import UnsupportedFaultError
from hil.faults._action import Action, refuse_unless_supported
from hil.faults._actions import Bounce
from hil.faults._claims import Claim, each
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
        return Claim(bench, (name, "supply"), station.power_off, station.power_on, anew=True)
    number = int(value("number"))
    if fault.kind == "io.bounce":
        return Bounce(
            bench, fault, _stuck(bench, station, "input", number), stream, level=bool(value("level"))
        )
    kind = str(value("channel"))
    station.channel(kind, number)
    if fault.kind == "io.stuck":
        return _stuck(bench, station, kind, number, float(value("value")))
    if fault.kind == "io.wire_break":
        cut = partial(station.break_wire, kind, number)
        return Claim(bench, (name, "wire", kind, number), cut, partial(cut, False), (True,))
    if fault.kind == "io.swapped":
        pair = number, int(value("other"))
        station.channel(kind, pair[1])
        wire = partial(station.rewire, kind)
        return Claim(bench, (name, "wires", kind), wire, partial(wire, ()), pair, combine=each)

    def disturb(offset: float = 0.0, gain: float = 1.0, noise: float = 0.0) -> None:
        station.disturb(kind, number, offset=offset, gain=gain, noise=noise)

    wrong = value("offset_V"), value("gain"), value("noise_V")
    return Claim(bench, (name, "disturbance", kind, number), disturb, disturb, wrong)


def _stuck(bench: Bench, station: Any, kind: str, number: int, value: float = 0.0) -> Claim:
    """Return the claim of a value at a channel."""
    station.channel(kind, number)
    stick = partial(station.hold, kind, number)
    return Claim(bench, (str(station.name), "stuck", kind, number), stick, partial(stick, None), (value,))
