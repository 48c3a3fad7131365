"""Faults of Modbus segments: a hook in the virtual network or line that picks its frames, and what becomes of
them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final

from fieldbus.clock import seconds_to_ns
from fieldbus.errors import ConfigurationError, UnsupportedFaultError
from hil.faults._action import Action, refuse_unless_supported
from hil.faults._claims import Claim, all_of
from hil.faults._fault import Fault
from hil.protocols import Bench

if TYPE_CHECKING:
    from fieldbus.modbus import Change

Work = Callable[[], None]
Note = Callable[[int, str], None]

_CONTROLLER: Final = "controller"
_ON_LINE: Final = ("modbus.crc", "modbus.broadcast", "modbus.noise")
_ON_NETWORK: Final = ("modbus.transaction", "modbus.reset", "modbus.cut")
_WITHOUT_COUNT: Final = ("modbus.noise", "modbus.cut")
_HEADER: Final = 7
"""Bytes of the header on TCP, the unit included."""


def modbus_action(bench: Bench, fault: Fault, stream: str, ended: Work, note: Note) -> Action:
    """Return the action of a `modbus.` fault.

    Args:
        bench: The bench.
        fault: What to do.
        stream: Name of the random stream of this fault.
        ended: Called when `count` frames have been hit.
        note: Called at every hit, with its number and what has become of the frame.

    Raises:
        UnsupportedFaultError: The segment is no Modbus segment, of another kind, or not virtual.
        ConfigurationError: The drive is not on it, or an option does not fit.

    """
    segment = _segment(bench, fault)
    refuse_unless_supported(bench, fault, segment)
    line = segment.kind == "modbus_rtu"
    if fault.kind in (_ON_NETWORK if line else _ON_LINE):
        needed = "modbus_tcp" if line else "modbus_rtu"
        raise UnsupportedFaultError(
            f'{fault.kind} cannot be injected on {segment.name}: it needs a segment of kind = "{needed}"'
        )
    if fault.kind in _WITHOUT_COUNT and fault.count is not None:
        raise ConfigurationError("fault.count", fault.count, f"nothing: {fault.kind} hits no frames")
    servers = _servers(fault, segment)
    if fault.kind == "modbus.noise":
        return _Noise(bench, segment, fault, stream)
    if fault.kind == "modbus.cut":
        return _cut(bench, segment, servers)
    choice = _Choice(bench, fault, stream, ended, note)
    if fault.kind == "modbus.exception":
        return _Exceptions(bench, segment, fault, servers, choice)
    return _Frames(segment, fault, servers, choice, line=line)


def _segment(bench: Bench, fault: Fault) -> Any:
    """Return the segment that is meant: without a target the first Modbus segment."""
    name = fault.target or next(
        (
            one
            for one in getattr(bench, "segment_names", ())
            if hasattr(bench.segment(one), "add_hook")
            and str(getattr(bench.segment(one), "kind", "")).startswith("modbus")
        ),
        None,
    )
    segment = bench.segment(name)
    if not str(getattr(segment, "kind", "")).startswith("modbus"):
        raise UnsupportedFaultError(f"{fault.kind} cannot be injected: {segment.name} is no Modbus segment")
    return segment


def _servers(fault: Fault, segment: Any) -> tuple[str, ...]:
    """Return the drives and stations that are concerned."""
    there: tuple[str, ...] = segment.server_names
    if fault.kind == "modbus.noise":
        return there
    wanted = str(fault.value("drive"))
    if wanted and wanted not in there:
        raise ConfigurationError(
            f"{fault.kind}.parameters.drive", wanted, f"{', '.join(there)} (on {segment.name})"
        )
    return (wanted,) if wanted else there


class _Choice:
    """Says which of the matching frames are hit, and counts them."""

    __slots__ = ("_bench", "_chance", "_ended", "_every", "_first", "_left", "_note", "_rng", "_seen", "hits")

    def __init__(self, bench: Bench, fault: Fault, stream: str, ended: Work, note: Note) -> None:
        value = fault.value
        self._bench = bench
        self._ended = ended
        self._note = note
        self._first: int = value("first")
        self._every: int = value("every")
        self._chance: float = value("probability")
        self._rng = bench.rng(stream) if self._chance < 1.0 else None
        self._left = fault.count
        self._seen = 0
        self.hits = 0

    def hit(self) -> bool:
        """Say whether the frame that matches now is hit."""
        if self._left == 0:
            return False
        self._seen += 1
        if self._seen < self._first or (self._seen - self._first) % self._every:
            return False
        return self._rng is None or bool(self._rng.random() < self._chance)

    def done(self, text: str) -> None:
        """Take note of a hit."""
        self.hits += 1
        self._note(self.hits, text)
        if self._left is not None:
            self._left -= 1
            if self._left == 0:
                scheduler = self._bench.scheduler
                scheduler.at(scheduler.now, self._ended)


class _Frames(Action):
    """Change the frames that pass a virtual link."""

    __slots__ = (
        "_choice",
        "_fault",
        "_held",
        "_line",
        "_remove",
        "_request",
        "_segment",
        "_servers",
        "_wanted",
    )

    def __init__(
        self, segment: Any, fault: Fault, servers: tuple[str, ...], choice: _Choice, *, line: bool
    ) -> None:
        super().__init__(str(segment.name), self._begin, self._finish)
        self._segment = segment
        self._fault = fault
        self._servers = servers
        self._choice = choice
        self._line = line
        self._request = fault.kind == "modbus.broadcast" or fault.value("direction") == "request"
        self._wanted: int = fault.value("function")
        self._held: dict[str, bytes] = {}
        self._remove: Work | None = None

    def _begin(self) -> None:
        self._remove = self._segment.add_hook(self._hook)

    def _finish(self) -> None:
        if self._remove is not None:
            self._remove()
            self._remove = None

    def _hook(self, sender: str, data: bytes, time_ns: int) -> Change | None:  # noqa: ARG002 - signature of a hook
        from fieldbus.modbus import Change

        held = self._held.pop(sender, b"")
        if held:
            return Change(data=held + data)
        if not self._matches(sender, data) or not self._choice.hit():
            return None
        change, text = self._treat(sender, data)
        if change is not None:
            self._choice.done(text)
        return change

    def _matches(self, sender: str, data: bytes) -> bool:
        if (sender == _CONTROLLER) is not self._request:
            return False
        start = 1 if self._line else _HEADER
        if len(data) <= start:
            return False
        if sender != _CONTROLLER and sender not in self._servers:
            return False
        return not self._wanted or data[start] & 0x7F == self._wanted

    def _treat(self, sender: str, data: bytes) -> tuple[Change | None, str]:
        from fieldbus.modbus import Change

        value = self._fault.value
        match self._fault.kind:
            case "modbus.crc":
                return Change(data=data[:-1] + bytes((data[-1] ^ 0xFF,))), "CRC wrong"
            case "modbus.truncate":
                length: int = value("length")
                if length >= len(data):
                    return None, ""
                return Change(data=data[:length]), f"{len(data)} bytes become {length}"
            case "modbus.merge":
                self._held[sender] = data
                return Change(drop=True), "held back for the next one"
            case "modbus.unit" | "modbus.broadcast":
                unit = 0 if self._request and self._fault.kind == "modbus.broadcast" else value("unit")
                at = 0 if self._line else _HEADER - 1
                return Change(data=self._sealed(data[:at] + bytes((unit,)) + data[at + 1 :])), (
                    f"unit {data[at]} becomes {unit}"
                )
            case "modbus.transaction":
                old = int.from_bytes(data[:2])
                new = (old + value("step")) % 0x10000
                return Change(data=new.to_bytes(2) + data[2:]), f"transaction {old} becomes {new}"
            case "modbus.drop":
                return Change(drop=True), "lost"
            case "modbus.delay":
                return Change(delay_ns=seconds_to_ns(value("delay_s"))), f"{value('delay_s'):g} s later"
            case "modbus.reset":
                return Change(reset=True), "connection reset"
            case _:
                return self._corrupted(data)

    def _corrupted(self, data: bytes) -> tuple[Change | None, str]:
        """Change a register of a frame that has so many."""
        from fieldbus.modbus import Change

        start = 1 if self._line else _HEADER
        first = _first_register(data[start], request=self._request)
        end = len(data) - (2 if self._line else 0)
        at = start + (first or 0) + 2 * int(self._fault.value("register"))
        if first is None or at + 2 > end:
            return None, ""
        old = int.from_bytes(data[at : at + 2])
        new = old ^ int(self._fault.value("mask"))
        changed = self._sealed(data[:at] + new.to_bytes(2) + data[at + 2 :])
        return Change(data=changed), f"register {self._fault.value('register')}: {old:04X} becomes {new:04X}"

    def _sealed(self, data: bytes) -> bytes:
        """Return a frame of a line with the CRC of its content."""
        if not self._line:
            return data
        from fieldbus.modbus.framing import crc16

        return data[:-2] + crc16(data[:-2])


def _first_register(function: int, *, request: bool) -> int | None:
    """Return where in a PDU the registers begin; None where there are none."""
    return {6: 3, 16: 6, 23: 10}.get(function) if request else {3: 2, 4: 2, 6: 3, 23: 2}.get(function)


class _Exceptions(Action):
    """Let the servers of drives and stations refuse requests."""

    __slots__ = ("_choice", "_claims", "_code", "_wanted")

    def __init__(
        self, bench: Bench, segment: Any, fault: Fault, names: tuple[str, ...], choice: _Choice
    ) -> None:
        from fieldbus.modbus import ExceptionCode

        super().__init__(str(segment.name), self._begin, self._finish)
        self._code: int = fault.value("code")
        known = [int(one) for one in ExceptionCode]
        if self._code not in known:
            raise ConfigurationError(
                "modbus.exception.parameters.code", self._code, ", ".join(map(str, known))
            )
        self._choice = choice
        self._wanted: int = fault.value("function")
        self._claims = [_hook_of(bench, segment, name) for name in names]

    def _begin(self) -> None:
        for claim in self._claims:
            claim.lay(self._refuse)

    def _finish(self) -> None:
        for claim in self._claims:
            claim.withdraw()

    def _refuse(self, _unit: int, pdu: bytes) -> int:
        if (self._wanted and pdu[0] != self._wanted) or not self._choice.hit():
            return 0
        self._choice.done(f"function {pdu[0]:02X}: exception {self._code:02X}")
        return self._code


def _hook_of(bench: Any, segment: Any, name: str) -> Claim:
    """Return the claim on the exceptions of the server of a drive or a station."""
    device = bench.station(name) if name in getattr(bench, "station_names", ()) else bench.drive(name)
    server = device.server
    usual = server.exception_hook

    def install(hook: Any) -> None:
        server.exception_hook = hook

    return Claim(bench, (str(segment.name), "exceptions", name), install, lambda: install(usual))


def _cut(bench: Bench, segment: Any, servers: tuple[str, ...]) -> Action:
    def claim(name: str) -> Claim:
        link = segment.link(name)

        def switch(cut: bool) -> None:
            link.cut = cut

        return Claim(bench, (str(segment.name), "link", name), switch, lambda: switch(False), (True,))

    return all_of(str(segment.name), [claim(name) for name in servers])


class _Noise(Action):
    """A disturber on a line: random bytes at random instants, when nobody talks."""

    __slots__ = ("_bench", "_bytes", "_line", "_period_s", "_port", "_rng", "_timer")

    def __init__(self, bench: Bench, segment: Any, fault: Fault, stream: str) -> None:
        super().__init__(str(segment.name), self._next, self._stop)
        self._bench = bench
        self._line = segment.link()
        self._bytes: int = fault.value("bytes")
        self._period_s: float = fault.value("period_s")
        self._rng = bench.rng(stream)
        self._port = self._line.attach("noise", _Deaf())
        self._timer: Any = None

    def _next(self) -> None:
        wait_ns = seconds_to_ns(float(self._rng.exponential(self._period_s))) + 1
        self._timer = self._bench.scheduler.after(wait_ns, self._make)

    def _make(self) -> None:
        if not self._line.busy:
            self._port.send(self._rng.bytes(self._bytes))
        self._next()

    def _stop(self) -> None:
        if self._timer is not None:
            self._timer.cancel()


class _Deaf:
    """Hears nothing."""

    def started(self, time_ns: int) -> None:
        """See `SerialListener.started`."""

    def received(self, data: bytes, damaged: bool, time_ns: int) -> None:
        """See `SerialListener.received`."""
