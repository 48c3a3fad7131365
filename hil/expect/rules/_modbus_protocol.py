"""Rules about Modbus servers, from the frames of a link alone: they hold for a device of the bench as for
anybody else's.
"""

from __future__ import annotations

from typing import Final

from fieldbus.modbus.bus_log import ModbusFrame
from hil.expect.rules._definition import Excuses, Judged, Rule
from hil.expect.rules._views import TraceView

_MOST: Final = {1: 2000, 2: 2000, 3: 125, 4: 125, 15: 1968, 16: 123, 23: 125}
"""Largest quantities by function (Modbus Application Protocol V1.1b3, section 6)."""
_EXCEPTIONS: Final = frozenset((1, 2, 3, 4, 5, 6, 7, 8, 10, 11))
_ECHOED: Final = {5: 5, 6: 5, 15: 5, 16: 5, 22: 7}
"""Bytes of the request that the response repeats."""
_LONGEST: Final = 253
_HEADER: Final = 7


class ModbusView:
    """A Modbus link.

    Args:
        whole: The trace.
        name: Of the link.

    """

    def __init__(self, whole: TraceView, name: str) -> None:
        self.whole = whole
        self.name = name

    @property
    def excuses(self) -> Excuses:
        """All faults of the trace."""
        return self.whole.excuses((*self.whole.axes, *self.whole.drives))

    def frames(self) -> list[tuple[float, ModbusFrame]]:
        """Return requests and responses that nothing has disturbed, with the time of their end in s."""
        return [
            (time_ns * 1e-9, frame)
            for time_ns, _, frame, error in self.whole.trace.raw_frames(self.name)
            if not error and isinstance(frame, ModbusFrame) and frame.data
        ]


def checksum(data: bytes) -> int:
    """Return the CRC-16 of a frame on a serial line, shifted in bit by bit (MODB-006)."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0xA001 if crc & 1 else 0)
    return crc


def wrong_envelope(frame: ModbusFrame) -> str:
    """Return what is wrong around a PDU: MBAP header or CRC; empty: nothing."""
    data = frame.data
    if frame.protocol == "modbus_tcp":
        if len(data) < _HEADER + 1 or data[2:4] != b"\0\0":
            return f"header {data[:_HEADER].hex(' ')}"
        told = data[4] << 8 | data[5]
        return "" if told == len(data) - 6 else f"length {told} in the header of {len(data) - 6} bytes"
    if len(data) < 4:
        return f"a frame of {len(data)} bytes"
    sent = data[-2] | data[-1] << 8
    found = checksum(data[:-2])
    return "" if sent == found else f"CRC {sent:04X}h, {found:04X}h is right"


def wrong_response(asked: bytes, pdu: bytes) -> str:
    """Return what a response has that its request does not allow; empty: nothing."""
    if len(asked) < 1 or asked == b"\0":
        return f"{pdu[:8].hex(' ')} answers nothing"
    if not 2 <= len(pdu) <= _LONGEST:
        return f"a response of {len(pdu)} bytes"
    function = asked[0]
    if pdu[0] == function | 0x80:
        if len(pdu) != 2 or pdu[1] not in _EXCEPTIONS:
            return f"exception {pdu[1:].hex(' ')}"
        return ""
    if pdu[0] != function:
        return f"function {pdu[0]} in place of {function}"
    count = asked[3] << 8 | asked[4] if len(asked) >= 5 else 0
    most = _MOST.get(function)
    if most is not None and not 1 <= count <= most:
        return f"function {function} with a quantity of {count} is carried out"
    if function in (1, 2, 3, 4, 23):
        size = (count + 7) // 8 if function <= 2 else 2 * count
        if pdu[1] != size or len(pdu) != 2 + size:
            return f"{len(pdu) - 2} bytes, {pdu[1]} announced, for a quantity of {count}"
        if function <= 2 and count % 8 and pdu[-1] >> count % 8:
            return f"bits behind the last of {count}"
    elif function in _ECHOED and pdu != asked[: _ECHOED[function]]:
        return f"{pdu.hex(' ')} does not repeat {asked[: _ECHOED[function]].hex(' ')}"
    elif function == 8 and pdu[:3] != asked[:3]:
        return f"{pdu[:3].hex(' ')} does not repeat the sub-function {asked[1:3].hex(' ')}"
    elif function == 43 and pdu[1:3] != asked[1:3]:
        return f"{pdu[1:3].hex(' ')} does not repeat {asked[1:3].hex(' ')}"
    return ""


def _responses(link: ModbusView) -> Judged | None:
    found: list[tuple[float, str]] = []
    for when, frame in link.frames():
        text = wrong_envelope(frame)
        if not text and frame.asked:
            text = wrong_response(frame.asked, frame.pdu)
        if text or frame.asked:
            found.append((when, text and f"unit {frame.can_id}: {text}"))
    return Judged.of_list(found) if found else None


RESPONSES: Final = Rule(
    name="Modbus response",
    says="header or CRC are right, and a response fits its request: function, exception code, byte count, "
    "what it repeats",
    requirements=("MODB-006", "MODB-012", "MODB-024"),
    tolerance="none",
    judge=_responses,
    excused_by=("modbus.", "telegram.", "drive.", "io."),
    recovery_s=1.0,
    live=True,
)

MODBUS_RULES: Final[tuple[Rule[ModbusView], ...]] = (RESPONSES,)
