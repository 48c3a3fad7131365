"""What a test can do to the Modbus side of a drive (PD-349, MODB-043)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from emulators.drive.profidrive.parameter_channel import ChannelError
from fieldbus.clock import seconds_to_ns
from fieldbus.errors import ConfigurationError, UnsupportedFaultError
from fieldbus.modbus import ExceptionCode, exception_text

if TYPE_CHECKING:
    from emulators.drive.profidrive.parameter_channel import ParameterChannel
    from fieldbus.clock import Scheduler
    from fieldbus.modbus import ModbusServer, PtyServer, RtuStation, TcpStation


class ModbusFaults:
    """Exceptions, silence, late responses, errors of the parameter channel. The drive has the attributes
    named here.
    """

    __slots__ = ()

    if TYPE_CHECKING:
        name: str
        scheduler: Scheduler
        server: ModbusServer
        channel: ParameterChannel
        station: RtuStation | TcpStation[Any] | PtyServer | None

        def power_on(self) -> None:
            """Switch the control supply on."""

        def power_off(self) -> None:
            """Switch everything off at once."""

    def refuse_requests(self, code: int | None, function: int | None = None) -> None:
        """Answer every request (of one function) with an exception code; None = serve them again.

        Raises:
            ConfigurationError: There is no such exception code (MODB-022 to MODB-031).

        """
        if code is None:
            self.server.exception_hook = None
            return
        known = [int(one) for one in ExceptionCode]
        if code not in known:
            raise ConfigurationError(
                "exception code", code, ", ".join(f"{one} ({exception_text(one)})" for one in known)
            )
        self.server.exception_hook = lambda _unit, pdu: code if function in (None, pdu[0]) else 0

    def suppress_modbus_responses(self, silent: bool) -> None:
        """Carry requests out without answering them, or answer again.

        Raises:
            UnsupportedFaultError: The drive is on no bus.

        """
        self._station().silent = silent

    def delay_responses(self, delay_s: float) -> None:
        """Answer this long after the request, s.

        Raises:
            UnsupportedFaultError: The drive is on no bus.
            ConfigurationError: The time is negative.

        """
        if not delay_s >= 0.0:
            raise ConfigurationError("delay_s", delay_s, ">= 0")
        self._station().processing_ns = seconds_to_ns(delay_s)

    def fail_parameter_channel(self, code: int | None) -> None:
        """Answer every request of data record 47 with an error of the channel, 1..5; None = serve them again.

        Raises:
            ConfigurationError: There is no such error (PD-329 to PD-333).

        """
        known = [int(one) for one in ChannelError]
        if code is not None and code not in known:
            raise ConfigurationError("error of the parameter channel", code, ", ".join(map(str, known)))
        self.channel.injected = code or 0

    def reset_node(self, boot_s: float) -> None:
        """Restart as after a dip of the supply: silence for `boot_s`, then service again; the motor
        coasts.
        """
        self.power_off()
        self.scheduler.after(seconds_to_ns(boot_s), self.power_on)

    def _station(self) -> RtuStation | TcpStation[Any] | PtyServer:
        if self.station is None:
            raise UnsupportedFaultError(f"{self.name}: the drive is on no Modbus link")
        return self.station
