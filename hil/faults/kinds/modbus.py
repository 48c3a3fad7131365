"""Faults of Modbus segments: a hook in the virtual network or line that picks its frames, and what
becomes of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Final, Literal

from fieldbus.clock import seconds_to_ns
from fieldbus.errors import ConfigurationError, UnsupportedFaultError
from hil.faults._kind import Action, Custom, Family, FaultType, Injection, Work, override_action
from hil.faults._overrides import Override
from hil.faults._parameters import Environment, Parameter, Values
from hil.faults.seams import (
    BenchWithSegments,
    BenchWithStations,
    ModbusDevice,
    ModbusSegment,
    Part,
    SerialWire,
    TcpCable,
    offers,
)

if TYPE_CHECKING:
    from fieldbus.clock import Timer
    from fieldbus.modbus import Change

_CONTROLLER: Final = "controller"
_HEADER: Final = 7
"""Bytes of the header on TCP, the unit included."""
Link = Literal["modbus_tcp", "modbus_rtu"]


# -- the segment and its servers -------------------------------------------------------------------------


def _find_segment(injection: Injection, link: Link | None) -> ModbusSegment:
    """Return the segment that is meant, without a target the first Modbus segment; checked for the
    link it needs.
    """
    bench = injection.bench
    name = injection.target or None
    if name is None and offers(bench, BenchWithSegments):
        candidates = (injection.bench.segment(one) for one in bench.segment_names)
        name = next((one.name for one in candidates if _on_modbus(one)), None)
    segment: Part = injection.bench.segment(name)
    if not _on_modbus(segment):
        injection.refuse(f"{segment.name} is no Modbus segment")
    modbus: ModbusSegment = injection.bench.segment(name)
    injection.check_environment(modbus)
    if link is not None and modbus.kind != link:
        raise UnsupportedFaultError(
            f"{injection.kind.name} cannot be injected on {modbus.name}: it needs a segment of "
            f'kind = "{link}"'
        )
    return modbus


def _on_modbus(segment: object) -> bool:
    return offers(segment, ModbusSegment) and segment.kind.startswith("modbus")


def _servers(injection: Injection, segment: ModbusSegment) -> tuple[str, ...]:
    """Return the drives and stations that are concerned."""
    wanted = injection.values.text("drive")
    if wanted and wanted not in segment.server_names:
        raise injection.wrong("drive", f"{', '.join(segment.server_names)} (on {segment.name})")
    return (wanted,) if wanted else segment.server_names


def _refuse_count(injection: Injection) -> None:
    if injection.count is not None:
        raise ConfigurationError(
            "fault.count", injection.count, f"nothing: {injection.kind.name} hits no frames"
        )


class _Choice:
    """Says which of the matching frames are hit, and counts them."""

    def __init__(self, injection: Injection) -> None:
        values = injection.values
        self._injection = injection
        self._first = values.integer("first")
        self._every = values.integer("every")
        self._chance = values.number("probability")
        self._rng = injection.bench.rng(injection.stream) if self._chance < 1.0 else None
        self._left = injection.count
        self._seen = 0
        self._hits = 0

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
        self._hits += 1
        self._injection.report_hit(self._hits, change=text)
        if self._left is not None:
            self._left -= 1
            if self._left == 0:
                scheduler = self._injection.bench.scheduler
                scheduler.at(scheduler.now, self._injection.ended)


# -- frames ----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Frame:
    """A frame on a link."""

    sender: str
    data: bytes
    line: bool
    """On a serial line; False: on a network."""
    request: bool

    @property
    def pdu(self) -> int:
        """Where its PDU begins."""
        return 1 if self.line else _HEADER

    def sealed(self, data: bytes) -> bytes:
        """Return other content, on a line with the CRC of it."""
        if not self.line:
            return data
        from fieldbus.modbus.framing import crc16

        return data[:-2] + crc16(data[:-2])


Treatment = Callable[[Frame, Values], "tuple[Change | None, str]"]
"""Returns what becomes of a frame, and that in a text; None: it does not fit."""


@dataclass(frozen=True)
class HitModbusFrames:
    """The effect of a kind that does something to frames which pass a virtual link.

    Args:
        treatment: Says what becomes of a frame.
        link: Link that it needs; None: any.
        requests: It hits requests, whatever the parameters.
        merge: A frame is held back and comes with the next one of its sender.

    """

    treatment: Treatment
    link: Link | None = None
    requests: bool = False
    merge: bool = False
    needs: None = None

    def __call__(self, injection: Injection) -> Action:
        """Return the action of one fault."""
        segment = _find_segment(injection, self.link)
        servers, choice = _servers(injection, segment), _Choice(injection)
        values, line = injection.values, segment.kind == "modbus_rtu"
        requests = self.requests or values.text("direction") == "request"
        function = values.integer("function")
        held: dict[str, bytes] = {}
        remove_hook: list[Work] = []

        def matches(frame: Frame) -> bool:
            if frame.request is not requests or len(frame.data) <= frame.pdu:
                return False
            if not frame.request and frame.sender not in servers:
                return False
            return not function or frame.data[frame.pdu] & 0x7F == function

        def hook(sender: str, data: bytes, _time_ns: int) -> Change | None:
            waiting = held.pop(sender, b"")
            if waiting:
                return _change(data=waiting + data)
            frame = Frame(sender, data, line, request=sender == _CONTROLLER)
            if not matches(frame) or not choice.hit():
                return None
            change, text = self.treatment(frame, values)
            if change is not None:
                if self.merge:
                    held[sender] = data
                choice.done(text)
            return change

        def finish() -> None:
            if remove_hook:
                remove_hook.pop()()

        return Action(segment.name, lambda: remove_hook.append(segment.add_hook(hook)), finish)


def _change(
    *, drop: bool = False, data: bytes | None = None, delay_ns: int = 0, reset: bool = False
) -> Change:
    """Return what becomes of a frame; the library is imported when a frame is hit."""
    from fieldbus.modbus import hooks

    return hooks.Change(drop=drop, data=data, delay_ns=delay_ns, reset=reset)


def _break_crc(frame: Frame, _values: Values) -> tuple[Change, str]:
    return _change(data=frame.data[:-1] + bytes((frame.data[-1] ^ 0xFF,))), "CRC wrong"


def _truncate(frame: Frame, values: Values) -> tuple[Change | None, str]:
    length = values.integer("length")
    if length >= len(frame.data):
        return None, ""
    return _change(data=frame.data[:length]), f"{len(frame.data)} bytes become {length}"


def _hold_back(_frame: Frame, _values: Values) -> tuple[Change, str]:
    return _change(drop=True), "held back for the next one"


def _set_unit(frame: Frame, unit: int) -> tuple[Change, str]:
    data, at = frame.data, frame.pdu - 1
    changed = frame.sealed(data[:at] + bytes((unit,)) + data[at + 1 :])
    return _change(data=changed), f"unit {data[at]} becomes {unit}"


def _change_unit(frame: Frame, values: Values) -> tuple[Change, str]:
    return _set_unit(frame, values.integer("unit"))


def _broadcast(frame: Frame, _values: Values) -> tuple[Change, str]:
    return _set_unit(frame, 0)


def _change_transaction(frame: Frame, values: Values) -> tuple[Change, str]:
    old = int.from_bytes(frame.data[:2])
    new = (old + values.integer("step")) % 0x10000
    return _change(data=new.to_bytes(2) + frame.data[2:]), f"transaction {old} becomes {new}"


def _drop(_frame: Frame, _values: Values) -> tuple[Change, str]:
    return _change(drop=True), "lost"


def _delay(_frame: Frame, values: Values) -> tuple[Change, str]:
    delay_s = values.number("delay_s")
    return _change(delay_ns=seconds_to_ns(delay_s)), f"{delay_s:g} s later"


def _reset(_frame: Frame, _values: Values) -> tuple[Change, str]:
    return _change(reset=True), "connection reset"


def _corrupt(frame: Frame, values: Values) -> tuple[Change | None, str]:
    """Change a register of a frame that has so many."""
    data, register = frame.data, values.integer("register")
    first = _first_register(data[frame.pdu], request=frame.request)
    end = len(data) - (2 if frame.line else 0)
    at = frame.pdu + (first or 0) + 2 * register
    if first is None or at + 2 > end:
        return None, ""
    old = int.from_bytes(data[at : at + 2])
    new = old ^ values.integer("mask")
    changed = frame.sealed(data[:at] + new.to_bytes(2) + data[at + 2 :])
    return _change(data=changed), f"register {register}: {old:04X} becomes {new:04X}"


def _first_register(function: int, *, request: bool) -> int | None:
    """Return where in a PDU the registers begin; None where there are none."""
    return {6: 3, 16: 6, 23: 10}.get(function) if request else {3: 2, 4: 2, 6: 3, 23: 2}.get(function)


# -- servers, cables, lines ------------------------------------------------------------------------------


def _exceptions(injection: Injection) -> Action:
    """Return the action that lets the servers of drives and stations refuse requests."""
    from fieldbus.modbus import ExceptionCode

    segment = _find_segment(injection, None)
    servers = _servers(injection, segment)
    choice, values = _Choice(injection), injection.values
    code, function = values.integer("code"), values.integer("function")
    known = [int(one) for one in ExceptionCode]
    if code not in known:
        raise injection.wrong("code", ", ".join(map(str, known)))

    def refuse(_unit: int, pdu: bytes) -> int:
        if (function and pdu[0] != function) or not choice.hit():
            return 0
        choice.done(f"function {pdu[0]:02X}: exception {code:02X}")
        return code

    return override_action(
        segment.name, *(_hook_override(injection, segment, name, refuse) for name in servers)
    )


def _hook_override(
    injection: Injection, segment: ModbusSegment, name: str, refuse: Callable[[int, bytes], int]
) -> Override[Callable[[int, bytes], int]]:
    """Return the override of the exceptions of the server of a drive or a station."""
    bench = injection.bench
    device: Part
    if offers(bench, BenchWithStations) and name in bench.station_names:
        device = bench.station(name)
    else:
        device = injection.bench.drive(name)
    server = injection.require(device, ModbusDevice).server
    usual = server.exception_hook

    def install(hook: Callable[[int, bytes], int] | None) -> None:
        server.exception_hook = hook

    return injection.override(
        (segment.name, "exceptions", name),
        refuse,
        lambda hooks: install(hooks[-1]),
        lambda: install(usual),
    )


def _cut(injection: Injection) -> Action:
    """Return the action that cuts the cables of drives and stations on a network."""
    segment = _find_segment(injection, "modbus_tcp")
    _refuse_count(injection)

    def cable(name: str) -> Override[bool]:
        link = segment.link(name)
        if not offers(link, TcpCable):
            injection.refuse(f"{name} has no virtual connection")

        def switch(cut: bool) -> None:
            link.cut = cut

        return injection.override(
            (segment.name, "link", name), True, lambda _: switch(True), lambda: switch(False)
        )

    return override_action(segment.name, *map(cable, _servers(injection, segment)))


def _noise(injection: Injection) -> Action:
    """Return the action of a node that sends random bytes on a line at random times, when it is free."""
    segment, scheduler, values = (
        _find_segment(injection, "modbus_rtu"),
        injection.bench.scheduler,
        injection.values,
    )
    _refuse_count(injection)
    line = segment.link()
    if not offers(line, SerialWire):
        injection.refuse(f"{segment.name} has no virtual line")
    length, period_s = values.integer("bytes"), values.number("period_s")
    rng = injection.bench.rng(injection.stream)
    port = line.attach("noise", _Deaf())
    timer: Timer | None = None

    def wait() -> None:
        nonlocal timer
        timer = scheduler.after(seconds_to_ns(float(rng.exponential(period_s))) + 1, send)

    def send() -> None:
        if not line.busy:
            port.send(rng.bytes(length))
        wait()

    def stop() -> None:
        if timer is not None:
            timer.cancel()

    return Action(segment.name, wait, stop)


class _Deaf:
    """A listener on a line that ignores everything."""

    def started(self, time_ns: int) -> None:
        """Ignore the begin of a transmission."""

    def received(self, data: bytes, damaged: bool, time_ns: int) -> None:
        """Ignore a byte."""


# -- kinds -----------------------------------------------------------------------------------------------

_NO_LINK: Final = (
    "it needs the bytes of a virtual network or line, which real sockets and ports do not show in time"
)
_REFUSED: Final[dict[Environment, str]] = {"live": _NO_LINK, "hardware": _NO_LINK}
_DRIVE: Final = Parameter(
    "drive", "text", "Only frames to and from this drive or station; empty: all of the segment", default=""
)
_FUNCTION: Final = Parameter(
    "function", "int", "Only this function code; 0: every one", minimum=0, maximum=127, default=0
)
_WAY: Final = Parameter(
    "direction", "text", "Which frames", default="response", choices=("request", "response")
)
_PICK: Final = (
    Parameter(
        "first",
        "int",
        "First matching frame that is hit, counted from the application",
        minimum=1,
        maximum=1_000_000_000,
        default=1,
    ),
    Parameter(
        "every", "int", "Then hit every n-th matching frame", minimum=1, maximum=1_000_000_000, default=1
    ),
    Parameter(
        "probability",
        "float",
        "Chance that a frame so chosen is hit, drawn from the seeded stream",
        minimum=0.0,
        maximum=1.0,
        default=1.0,
    ),
)
_CHOICE: Final = (_DRIVE, _WAY, _FUNCTION, *_PICK)
_ON_LINE: Final = "on a serial line"
_ON_NETWORK: Final = "on a network (TCP)"
_kind: Final = partial(FaultType, seam="Modbus link", target="segment", refused=_REFUSED, counted=True)

FAMILY: Final = Family(
    kinds=(
        _kind(
            "modbus.crc",
            "Frames have a wrong CRC",
            HitModbusFrames(_break_crc, "modbus_rtu"),
            parameters=_CHOICE,
            remark=_ON_LINE,
            example={"count": 3, "parameters": {}},
            text="""
            Frames on a serial line have a wrong CRC: no node answers or uses them.
            """,
        ),
        _kind(
            "modbus.truncate",
            "Frames are cut off",
            HitModbusFrames(_truncate),
            parameters=(
                *_CHOICE,
                Parameter(
                    "length",
                    "int",
                    "Bytes that are left, the envelope included",
                    minimum=1,
                    maximum=260,
                    required=True,
                ),
            ),
            example={"count": 1, "parameters": {"length": 4}},
            text="""
            Frames are cut off. Over TCP what follows is then taken for their rest.
            """,
        ),
        _kind(
            "modbus.merge",
            "A frame is held back and comes with the next one, without a pause between",
            HitModbusFrames(_hold_back, merge=True),
            parameters=_CHOICE,
            example={"count": 1, "parameters": {}},
            text="""
            A frame is held back and comes together with the next one of its sender: an invalid frame on a
            line, two frames in one segment over TCP.
            """,
        ),
        _kind(
            "modbus.unit",
            "Frames carry a wrong unit",
            HitModbusFrames(_change_unit),
            parameters=(
                *_CHOICE,
                Parameter("unit", "int", "The unit that they carry", minimum=0, maximum=255, required=True),
            ),
            example={"count": 3, "parameters": {"unit": 77}},
        ),
        _kind(
            "modbus.transaction",
            "Frames carry a wrong transaction identifier",
            HitModbusFrames(_change_transaction, "modbus_tcp"),
            parameters=(
                *_CHOICE,
                Parameter("step", "int", "By how much it is wrong", minimum=1, maximum=0xFFFF, default=1),
            ),
            remark=_ON_NETWORK,
            example={"count": 3, "parameters": {}},
            text="""
            Frames on a network carry a wrong transaction identifier: the controller discards such
            answers.
            """,
        ),
        _kind(
            "modbus.exception",
            "The drive answers with an exception and does not do what it is asked",
            Custom(_exceptions),
            parameters=(
                _DRIVE,
                _FUNCTION,
                *_PICK,
                Parameter(
                    "code", "int", "Exception code 01 to 08, 0A, 0B", minimum=1, maximum=11, required=True
                ),
            ),
            example={"duration_s": 0.1, "parameters": {"code": 4}},
            text="""
            The drive answers with an exception, and does not do what it is asked.
            """,
        ),
        _kind(
            "modbus.drop",
            "Requests do not arrive, or are carried out and not answered",
            HitModbusFrames(_drop),
            parameters=_CHOICE,
            example={"count": 2, "parameters": {}},
            text="""
            Requests do not arrive; or they are carried out and the response does not arrive.
            """,
        ),
        _kind(
            "modbus.delay",
            "Frames come later",
            HitModbusFrames(_delay),
            parameters=(
                *_CHOICE,
                Parameter(
                    "delay_s", "float", "How much later", unit="s", minimum=1e-06, maximum=60.0, required=True
                ),
            ),
            example={"duration_s": 0.1, "parameters": {"delay_s": 0.002}},
        ),
        _kind(
            "modbus.corrupt",
            "A register has another content, in a frame that is otherwise right",
            HitModbusFrames(_corrupt),
            parameters=(
                *_CHOICE,
                Parameter(
                    "register",
                    "int",
                    "Number of the register among those of the frame, from 0",
                    minimum=0,
                    maximum=124,
                    default=0,
                ),
                Parameter(
                    "mask", "int", "Bits of it that are inverted", minimum=1, maximum=0xFFFF, default=65535
                ),
            ),
            example={"duration_s": 0.1, "parameters": {"register": 0, "mask": 0x0008, "function": 3}},
            fuzzed=False,
            text="""
            A register has another content in a frame that is right otherwise: what Modbus cannot notice.
            Frames without so many registers are left alone.
            """,
        ),
        _kind(
            "modbus.broadcast",
            "Requests go to all units (unit 0) instead of the drive: none answers",
            HitModbusFrames(_broadcast, "modbus_rtu", requests=True),
            parameters=(
                _DRIVE,
                _FUNCTION,
                *_PICK,
            ),
            remark=_ON_LINE,
            example={"count": 3, "parameters": {}},
            text="""
            Requests on a line go to unit 0: all units carry out writes, none answers.
            """,
        ),
        _kind(
            "modbus.noise",
            "Bytes on the line between frames, from the seeded stream",
            Custom(_noise),
            parameters=(
                Parameter("bytes", "int", "How many at a time", minimum=1, maximum=256, default=3),
                Parameter(
                    "period_s", "float", "Mean distance", unit="s", minimum=0.0001, maximum=60.0, default=0.02
                ),
            ),
            remark=_ON_LINE,
            example={"duration_s": 0.1, "parameters": {"period_s": 0.05}},
            text="""
            A node sends random bytes on the line whenever it is free, at random times.
            """,
        ),
        _kind(
            "modbus.reset",
            "The connection is reset in place of a frame; the controller connects again",
            HitModbusFrames(_reset, "modbus_tcp"),
            parameters=_CHOICE,
            remark=_ON_NETWORK,
            example={"count": 1, "parameters": {}},
            text="""
            The connection is reset in place of a frame. The controller connects again.
            """,
        ),
        _kind(
            "modbus.cut",
            "The cable is cut, and neither side notices; what was sent arrives when it is connected again",
            Custom(_cut),
            parameters=(_DRIVE,),
            remark=_ON_NETWORK,
            example={"duration_s": 0.1, "parameters": {}},
            text="""
            The cable of a network is cut, and neither side notices. What was sent arrives when it is
            connected again.
            """,
        ),
    ),
    title="Modbus networks and lines",
    text="""
    The kinds `modbus.*` need a virtual segment of `kind = "modbus_tcp"` or `"modbus_rtu"`; without a
    target the first one is meant. `crc`, `broadcast` and `noise` need a line, `transaction`, `reset`
    and `cut` a network. `count` says how many frames are hit, and every hit reports what has become of
    the frame. The log of the segment shows them as they went on the link.
    """,
)
