"""Words for what is on a link, from its log or from a live line."""

from __future__ import annotations

from collections import OrderedDict
from typing import Final

from fieldbus.modbus.codes import BROADCAST, function_text
from fieldbus.modbus.errors import ResponseError
from fieldbus.modbus.framing import TcpSplitter, unwrap_rtu
from fieldbus.modbus.pdu import Request, decode_request, decode_response, is_well_formed
from fieldbus.modbus.server import SERVED

_REMEMBERED: Final = 64


def _request(pdu: bytes) -> Request | None:
    return decode_request(pdu) if pdu and pdu[0] in SERVED and is_well_formed(pdu) else None


def _unknown(pdu: bytes) -> str:
    return f"{function_text(pdu[0])}, not understood: {pdu.hex(' ')}" if pdu else "empty"


def request_text(pdu: bytes) -> str:
    """Return the PDU of a request as text; any bytes have one."""
    request = _request(pdu)
    return _unknown(pdu) if request is None else f"request {request}"


def response_text(asked: bytes, pdu: bytes) -> str:
    """Return the PDU of a response as text.

    Args:
        asked: PDU of the request; what is none stands for one that is not known.
        pdu: The response.

    """
    request = _request(asked)
    if request is None:
        return f"unsolicited response: {pdu.hex(' ')}"
    try:
        return f"response {decode_response(request, pdu)}"
    except ResponseError as error:
        return f"response that does not fit: {error}"


class RtuDecoder:
    """Decodes the frames of a serial line in their order.

    A frame does not say whether it is a request or a response; one that answers the
    frame before it is a response.
    """

    def __init__(self) -> None:
        self._asked: tuple[int, Request] | None = None

    def text(self, frame: bytes) -> str:
        """Return a frame as text; any bytes have one."""
        content = unwrap_rtu(frame)
        if content is None:
            self._asked = None
            return f"broken frame: {frame.hex(' ')}"
        unit, pdu = content
        asked, self._asked = self._asked, None
        if asked is not None and asked[0] == unit:
            try:
                return f"unit {unit} response {decode_response(asked[1], pdu)}"
            except ResponseError:
                pass  # then it is the next request
        request = _request(pdu)
        who = "broadcast" if unit == BROADCAST else f"unit {unit}"
        if request is None:
            return f"{who} {_unknown(pdu)}"
        self._asked = (unit, request)
        return f"{who} request {request}"


class TcpDecoder:
    """Decodes the two streams of one connection; any segments."""

    def __init__(self) -> None:
        self._client = TcpSplitter()
        self._server = TcpSplitter()
        self._asked: OrderedDict[tuple[int, int], Request] = OrderedDict()

    def text(self, data: bytes, *, from_server: bool) -> list[str]:
        """Return the frames that are complete with this segment, as text."""
        splitter = self._server if from_server else self._client
        was_broken = splitter.broken
        out = []
        for transaction, unit, pdu in splitter.feed(data):
            head = f"transaction {transaction} unit {unit}"
            asked = self._asked.pop((transaction, unit), None) if from_server else None
            if from_server:
                out.append(f"{head} {self._response(asked, pdu)}")
                continue
            request = _request(pdu)
            if request is None:
                out.append(f"{head} {_unknown(pdu)}")
                continue
            self._asked[transaction, unit] = request
            if len(self._asked) > _REMEMBERED:
                self._asked.popitem(last=False)
            out.append(f"{head} request {request}")
        if splitter.broken and not was_broken:
            out.append("wrong header: nothing after it can be read")
        return out

    @staticmethod
    def _response(asked: Request | None, pdu: bytes) -> str:
        if asked is None:
            return f"unsolicited response: {pdu.hex(' ')}"
        try:
            return f"response {decode_response(asked, pdu)}"
        except ResponseError as error:
            return f"response that does not fit: {error}"
