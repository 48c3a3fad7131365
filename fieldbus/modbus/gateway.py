"""A gateway from TCP to a serial line: requests of any number of connections, one after the other, to the
units behind it.
"""

from __future__ import annotations

from typing import Final, Generic

from fieldbus.clock import Scheduler
from fieldbus.errors import ConfigurationError
from fieldbus.modbus._pymodbus import exception_response
from fieldbus.modbus.client import Job, Outcome, Result
from fieldbus.modbus.codes import BROADCAST, WRITING, ExceptionCode
from fieldbus.modbus.framing import TcpSplitter, tcp_frame
from fieldbus.modbus.pdu import decode_request, is_well_formed
from fieldbus.modbus.rtu_client import RtuClient
from fieldbus.modbus.server import SERVED
from fieldbus.modbus.stations import DEFAULT_LIMITS, ConnectionLimits, End, Network, RequestTimer

_HIGHEST_UNIT: Final = 247
_X: Final = ExceptionCode


class TcpGateway(Generic[End]):
    """A Modbus TCP server in front of a serial line.

    A unit that does not answer is exception 0B; a unit that there cannot be, or a line that the gateway is
    not on, 0A; more requests than the gateway keeps, 06. Responses and exceptions of the units go through as
    they are. A broadcast, unit 0, is carried out without a response. What is no request is answered by the
    gateway: 01 and 03.

    Args:
        network: Where the connections come from.
        master: The gateway's place on the line, which nobody else uses.
        scheduler: Time.
        waiting: Most requests that are kept, 1..255; a further one is refused.
        limits: What its clients may ask of it.

    Raises:
        ConfigurationError: `waiting` is out of its range.

    """

    def __init__(
        self,
        network: Network[End],
        master: RtuClient,
        scheduler: Scheduler,
        *,
        waiting: int = 16,
        limits: ConnectionLimits = DEFAULT_LIMITS,
    ) -> None:
        if not 1 <= waiting <= 255:
            raise ConfigurationError("gateway, waiting", waiting, "1..255")
        self.master = master
        self.scheduler = scheduler
        self.limits = limits
        self._most = waiting
        self._kept = 0
        self.ends: list[End] = []
        """Its ends of the open connections."""
        network.listen(self._accept)

    def _accept(self, end: End) -> _Passage[End] | None:
        if len(self.ends) >= self.limits.connections:
            return None
        self.ends.append(end)
        return _Passage(self, end)

    def ask(self, end: End, transaction: int, unit: int, pdu: bytes) -> None:
        """Pass a request on; its response goes to `end`, if that is still open."""

        def answer(response: bytes) -> None:
            if end.open:
                end.send(tcp_frame(transaction, unit, response))

        code = self._refusal(unit, pdu)
        if code is not None:
            if unit != BROADCAST:
                answer(exception_response(pdu[0] & 0x7F, code))
            return
        self._kept += 1

        def done(result: Result) -> None:
            self._kept -= 1
            if unit == BROADCAST:
                return
            if result.outcome in (Outcome.DONE, Outcome.EXCEPTION):
                answer(job.response_pdu)
            else:
                answer(exception_response(pdu[0] & 0x7F, _X.GATEWAY_TARGET_FAILED))

        job: Job = self.master.submit(decode_request(pdu), unit, done)

    def _refusal(self, unit: int, pdu: bytes) -> int | None:
        if pdu[0] not in SERVED:
            return _X.ILLEGAL_FUNCTION
        if not is_well_formed(pdu):
            return _X.ILLEGAL_DATA_VALUE
        if unit > _HIGHEST_UNIT or not self.master.port.online:
            return _X.GATEWAY_PATH_UNAVAILABLE
        if unit == BROADCAST and pdu[0] not in WRITING:
            return _X.ILLEGAL_FUNCTION
        if self._kept >= self._most:
            return _X.SERVER_DEVICE_BUSY
        return None


class _Passage(Generic[End]):
    """A connection of a gateway."""

    def __init__(self, gateway: TcpGateway[End], end: End) -> None:
        self._gateway = gateway
        self._end = end
        self._splitter = TcpSplitter()
        self._timer = RequestTimer(gateway.scheduler, gateway.limits.request_ns, self._close)

    def opened(self) -> None:
        """Nothing to do: a server waits."""

    def receive(self, data: bytes) -> None:
        """Pass on what is complete; a wrong header ends the connection (MODB-037)."""
        frames = self._splitter.feed(data)
        self._timer.look(self._splitter.pending, completed=bool(frames))
        for transaction, unit, pdu in frames:
            self._gateway.ask(self._end, transaction, unit, pdu)
        if self._splitter.broken and self._end.open:
            self._close()

    def _close(self) -> None:
        self._end.close()
        self.closed("closed")

    def closed(self, reason: str) -> None:  # noqa: ARG002 - whatever the reason
        """Forget the connection; transfers in progress continue without it."""
        self._timer.stop()
        if self._end in self._gateway.ends:
            self._gateway.ends.remove(self._end)
