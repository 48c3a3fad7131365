"""Faults of the segment as a whole and of the CAN controllers on it."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING, Any, Final

from fieldbus.clock import MS, S, seconds_to_ns
from fieldbus.errors import BusError, ConfigurationError, UnsupportedFaultError
from hil.faults._action import Action, refuse_unless_supported
from hil.faults._claims import Claim, all_of
from hil.faults._fault import Fault, parse_payload
from hil.faults._live_segment import break_bridge, live_babble
from hil.protocols import Bench

if TYPE_CHECKING:
    from fieldbus.can import CanFrame, MediumPort

_LOAD_NODE: Final = "load"
_QUEUED_AHEAD: Final = 2
_CATCH_UP_NS: Final = 100 * MS


def _names(fault: Fault) -> list[str]:
    return [name.strip() for name in str(fault.value("nodes")).split(",") if name.strip()]


def _ports(segment: Any, fault: Fault) -> list[MediumPort]:
    """Return the nodes that a fault names; all if it names none."""
    ports: list[MediumPort] = list(segment.ports)
    if not any(parameter.name == "nodes" for parameter in fault.entry.parameters):
        wanted = [str(fault.value("node"))]
    else:
        wanted = _names(fault) or [port.name for port in ports]
    by_name = {port.name: port for port in ports}
    for name in wanted:
        if name not in by_name:
            where = "node" if "node" in fault.parameters else "nodes"
            raise ConfigurationError(
                f"{fault.kind}.parameters.{where}", name, ", ".join(by_name) or "no nodes"
            )
    return [by_name[name] for name in wanted]


def _far_side(segment: Any, fault: Fault) -> list[MediumPort]:
    """Return the nodes that a break of the cable cuts off; somebody has to be left on the other side."""
    ports = _ports(segment, fault)
    if len(set(ports)) == len(segment.ports):
        key = "nodes" if "nodes" in fault.parameters else "node"
        raise ConfigurationError(
            f"{fault.kind}.parameters.{key}",
            fault.value(key),
            f"some of {', '.join(port.name for port in segment.ports)}, not all: a break has two sides",
        )
    return ports


def segment_action(bench: Bench, fault: Fault, stream: str) -> Action:
    """Return the action of a `can.` fault.

    Args:
        bench: The bench.
        fault: What to do.
        stream: Name of the random stream of this fault.

    Raises:
        UnsupportedFaultError: The segment is not virtual.
        ConfigurationError: A node that the segment does not have.

    """
    segment = bench.segment(fault.target or None)
    refuse_unless_supported(bench, fault, segment)
    live = hasattr(segment, "sides")
    if live and fault.kind in ("can.cable_break", "can.unplug"):
        return break_bridge(segment, fault)
    if live and fault.kind == "can.babble":
        return live_babble(bench, segment, fault)
    if not hasattr(segment, "flip_bit") and not live:
        raise UnsupportedFaultError(f"{fault.kind} cannot be injected: {segment.name} is no virtual segment")
    value = fault.value
    match fault.kind:
        case "can.noise":
            return _Noise(bench, segment, fault, stream)
        case "can.stuck_dominant" | "can.stuck_recessive":
            level = int(fault.kind == "can.stuck_recessive")
            hold = segment.hold_level
            return Claim(bench, (segment.name, "level"), hold, lambda: hold(None), (level,))
        case "can.cable_break" | "can.unplug":
            return _Break(segment, _far_side(segment, fault))
        case "can.babble":
            return _Babble(bench, segment, fault)
        case "can.load":
            return _Load(bench, segment, fault, stream)
        case "can.no_ack":
            return _each(bench, segment, fault, lambda port, on: port.set_acknowledge(on), (False, True))
        case "can.wrong_bitrate":
            return _each(
                bench, segment, fault, lambda port, rate: port.set_bitrate(rate), (value("bitrate"), None)
            )
        case "can.overload":
            return _each(
                bench,
                segment,
                fault,
                lambda port, count: port.set_overload_frames(count),
                (value("frames"), 0),
            )
        case "can.receive_delay":
            return _each(bench, segment, fault, _delay, (seconds_to_ns(value("delay_s")), 0))
        case "can.transmit_overrun":
            usual = _ports(segment, fault)[0].tx_buffers
            return _each(bench, segment, fault, _shorten, (value("buffers"), usual))
        case "can.bus_off":
            return _bus_off(bench, segment, fault)
    raise UnsupportedFaultError(f"{fault.kind} has no action at a segment")


def _each(
    bench: Bench,
    segment: Any,
    fault: Fault,
    change: Callable[[MediumPort, Any], object],
    values: tuple[Any, Any],
) -> Action:
    """Return the action that changes one thing at every node that a fault names: to the first value, and back
    to the second.
    """
    wrong, usual = values

    def claim(port: MediumPort) -> Claim:
        def operate(value: Any) -> None:
            if not port.detached:
                change(port, value)

        return Claim(bench, (segment.name, fault.kind, port.name), operate, lambda: operate(usual), (wrong,))

    return all_of(segment.name, [claim(port) for port in _ports(segment, fault)])


def _delay(port: MediumPort, delay_ns: int) -> None:
    port.receive_delay_ns = delay_ns


def _shorten(port: MediumPort, buffers: int) -> None:
    port.tx_buffers = buffers


class _Break(Action):
    """Cuts the cable, and mends it."""

    __slots__ = ("_mend", "_ports", "_segment")

    def __init__(self, segment: Any, ports: list[MediumPort]) -> None:
        super().__init__(segment.name, self._cut, self._join)
        self._segment = segment
        self._ports = ports
        self._mend: Callable[[], None] | None = None

    def _cut(self) -> None:
        try:
            self._mend = self._segment.cut([port.name for port in self._ports])
        except BusError as error:
            raise UnsupportedFaultError(f"the cable cannot be broken there: {error}") from error

    def _join(self) -> None:
        if self._mend is not None:
            self._mend()
            self._mend = None


def _bus_off(bench: Bench, segment: Any, fault: Fault) -> Action:
    """Return the action that puts a node into bus-off."""
    (port,) = _ports(segment, fault)
    usual = port.auto_recovery

    def leave(automatic: bool) -> None:
        port.auto_recovery = automatic
        port.set_error_counters(tec=256)

    def recover() -> None:
        port.auto_recovery = usual
        port.recover()

    automatic = fault.value("recovery") == "automatic"
    return Claim(bench, (segment.name, fault.kind, port.name), leave, recover, (automatic,), anew=True)


class _Noise(Action):
    """Inverts bits at random; the distance of two wrong bits has a geometric distribution."""

    __slots__ = ("_bench", "_names", "_rate", "_rng", "_segment", "_timer")

    def __init__(self, bench: Bench, segment: Any, fault: Fault, stream: str) -> None:
        super().__init__(segment.name, self._next, self._stop)
        self._bench = bench
        self._segment = segment
        self._rate = float(fault.value("bit_error_rate"))
        self._names = [port.name for port in _ports(segment, fault)] if _names(fault) else None
        self._rng = bench.rng(stream)
        self._timer: Any = None

    def _next(self) -> None:
        bits = int(self._rng.geometric(self._rate))
        self._timer = self._bench.scheduler.after(bits * S // self._segment.bitrate, self._flip)

    def _flip(self) -> None:
        self._segment.flip_bit(self._names)
        self._next()

    def _stop(self) -> None:
        self._timer.cancel()


class _Babble(Action):
    """Keeps a foreign node's queue filled."""

    __slots__ = ("_bench", "_frame", "_node", "_period_ns", "_segment", "_timer")

    def __init__(self, bench: Bench, segment: Any, fault: Fault) -> None:
        from fieldbus.can import CanFrame, frame_time_ns

        super().__init__(segment.name, self._begin, self._stop)
        self._bench = bench
        self._segment = segment
        self._node = str(fault.value("node"))
        data = parse_payload("can.babble.parameters.data", fault.value("data"))
        self._frame = CanFrame(fault.value("can_id"), data, extended=fault.value("extended"))
        self._period_ns = frame_time_ns(self._frame, segment.bitrate)
        self._timer: Any = None

    def _begin(self) -> None:
        for _ in range(_QUEUED_AHEAD):
            self._segment.inject(self._frame, sender=self._node)
        self._send()

    def _send(self) -> None:
        if self._segment.injected(self._node) < _QUEUED_AHEAD:
            self._segment.inject(self._frame, sender=self._node)
        self._timer = self._bench.scheduler.after(self._period_ns, self._send)

    def _stop(self) -> None:
        self._timer.cancel()
        self._segment.withdraw(self._node)


class _Load(Action):
    """A foreign node that sends random frames; each is followed by as much time as makes the load."""

    __slots__ = ("_bench", "_due_ns", "_extended", "_ids", "_lengths", "_rng", "_segment", "_share", "_timer")

    def __init__(self, bench: Bench, segment: Any, fault: Fault, stream: str) -> None:
        super().__init__(segment.name, self._begin, self._stop)
        value = fault.value
        self._bench = bench
        self._segment = segment
        self._share = float(value("load_percent")) / 100.0
        self._ids = int(value("lowest_id")), int(value("highest_id"))
        self._lengths = int(value("shortest")), int(value("longest"))
        self._extended = bool(value("extended"))
        self._rng = bench.rng(stream)
        self._due_ns = 0
        self._timer: Any = None

    def _begin(self) -> None:
        self._due_ns = self._bench.scheduler.now
        self._send()

    def _send(self) -> None:
        from fieldbus.can import frame_time_ns

        frame = self._draw()
        with suppress(BusError):  # the adapter of a live bus may be at its limit
            self._segment.inject(frame, sender=_LOAD_NODE)
        # From when the frame was due, so that the lateness of a real clock does not add up; but no flood
        # after a pause.
        now = self._bench.scheduler.now
        if now - self._due_ns > _CATCH_UP_NS:
            self._due_ns = now
        self._due_ns += round(frame_time_ns(frame, self._segment.bitrate) / self._share)
        self._timer = self._bench.scheduler.at(max(self._due_ns, now), self._send)

    def _draw(self) -> CanFrame:
        from fieldbus.can import CanFrame

        rng = self._rng
        can_id = int(rng.integers(self._ids[0], self._ids[1] + 1))
        data = rng.bytes(int(rng.integers(self._lengths[0], self._lengths[1] + 1)))
        return CanFrame(can_id, data, extended=self._extended)

    def _stop(self) -> None:
        self._timer.cancel()
        self._segment.withdraw(_LOAD_NODE)
