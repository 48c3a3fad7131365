"""The PROFIdrive axis on Modbus: its telegram in process data registers, parameters in registers and by data
record 47.

A register map (`fieldbus.modbus.load_map`) says what stands where (PD-286 to PD-337). What a client writes is
handed to the drive when it comes, and acts in the next cycle of the drive, which runs by itself; what a
client reads is of that moment. Import this module, not the package, for it: it loads pymodbus.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final

from emulators.drive.profidrive.bus_drive import DriveOnBus
from emulators.drive.profidrive.modbus_config import ProfidriveModbusConfig
from emulators.drive.profidrive.parameters.access import ChannelError, ParameterChannel
from fieldbus.clock import MS, Scheduler, seconds_to_ns
from fieldbus.errors import ConfigurationError, UnsupportedFaultError
from fieldbus.history import History
from fieldbus.modbus import (
    DEFAULT_LIMITS,
    ConnectionLimits,
    DriveMap,
    ExceptionCode,
    ModbusServer,
    Parity,
    PtyServer,
    RtuStation,
    SerialFormat,
    TcpStation,
    exception_text,
    load_map,
)
from fieldbus.profidrive.errors import ParameterAccessError
from fieldbus.profidrive.requests import ParameterError

if TYPE_CHECKING:
    import numpy as np

    from fieldbus.clock import Timer
    from fieldbus.modbus import SerialLine, SocketNetwork, TcpLink

_CYCLE_PRIORITY: Final = 2
"""The bus cycle follows the servo step and the control cycle of the same instant."""
RATES: Final = (4800, 9600, 19200, 38400, 57600, 76800, 93750, 115200, 187500)
"""Rates of the serial line, bit/s (PD-289)."""
_CHARACTER_DELAY_NS: Final = {
    38400: 750_000, 57600: 556_000, 76800: 417_000, 93750: 341_000, 115200: 278_000, 187500: 171_000,
}  # fmt: skip
"""Longest pause within a frame by rate (PD-291); below it is 1.5 characters."""
_BITS: Final = 11


class ProfidriveModbusDrive(DriveOnBus):
    """An emulated PROFIdrive axis as a Modbus server, with all that a test can do to it and its machine.

    It is off until `power_on`; the machine moves from the start. One of `listen`, `attach` and
    `open_terminal` puts it on its bus; without it the server can be asked directly.

    Args:
        scheduler: Time of the bench; a realtime scheduler for real connections.
        config: Registers and drive.
        name: Name of the drive on the line and in the history.
        history: Log; None for none.
        rng: Source of the encoder's noise; None: the encoder cannot be made noisy.

    Raises:
        ConfigurationError: The configuration does not fit together, or the register map has not enough
            process data registers for the telegram.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        config: ProfidriveModbusConfig,
        *,
        name: str,
        history: History | None = None,
        rng: np.random.Generator | None = None,
    ) -> None:
        file = load_map(config.map)
        limit_ms = config.setpoint_monitoring_ms
        settings = replace(
            config.drive.settings,
            setpoint_monitoring_ms=float(file.timeout_ms) if limit_ms is None else limit_ms,
        )
        own = replace(config.drive, settings=settings, isochronous=bool(config.drive.isochronous))
        super().__init__(scheduler, own, name=name, history=history, rng=rng)
        self.modbus_config = config
        drive = self.drive
        drive.watched_by_transport = True
        # A warning may be set up to be a fault; it keeps its number.
        drive.faults.fault_codes = {**file.warnings, **file.faults}
        drive.faults.warning_codes = file.warnings
        store = self.parameters.store
        store.set(918, config.unit)
        store.save()
        store.writers[2024] = self._check_time
        self.channel = ParameterChannel(
            self.parameters.server,
            latency_ns=config.parameter_latency_ns,
            available=lambda: drive.powered,
        )
        """Parameter channel of data record 47."""
        self.registers = DriveMap(scheduler, self, file, telegram=drive.telegram, channel=self.channel)
        """What the registers mean."""
        self.server = ModbusServer(
            self.registers.registers,
            unit=config.unit,
            functions=file.functions,
            limits=file.limits,
            identification={number: text.encode() for number, text in file.identification.items()} or None,
        )
        """Answers requests."""
        self.station: RtuStation | TcpStation[Any] | PtyServer | None = None
        """Where it is on the bus."""
        self._terminal: PtyServer | None = None
        self._limits_ns = (0, 0)
        """Longest character delay and shortest pause of the line."""
        self._boot_timer: Timer | None = None
        scheduler.every(own.cycle_ns, drive.cycle, priority=_CYCLE_PRIORITY)

    def trace_row(self) -> tuple[float, ...]:
        """Return the present values of `trace_columns`; position and velocity
        are those of the true mechanics.
        """
        return self._trace_values()

    # -- bus -------------------------------------------------------------------------------------------

    def listen(
        self, network: TcpLink | SocketNetwork, *, limits: ConnectionLimits = DEFAULT_LIMITS
    ) -> TcpStation[Any]:
        """Serve a TCP network; every unit is answered, and every process data register
        keeps the time-out off (PD-292).

        Raises:
            ConfigurationError: The drive is on a bus already.

        """
        self._be_free()
        self.server.unit = None
        self.registers.watch_all = True
        self.station = station = TcpStation(
            self.scheduler,
            network,
            self.server,
            processing_ns=self.modbus_config.processing_ns,
            limits=limits,
        )
        station.online = self._online
        return station

    def attach(self, line: SerialLine, format_: SerialFormat | None = None) -> RtuStation:
        """Hang the drive on a serial line.

        Args:
            line: The line.
            format_: Rate and parity of the drive where they are not those of the line.

        Raises:
            ConfigurationError: The drive is on a bus already, or it has not this rate or characters (PD-289).

        """
        self._be_free()
        rate = line.format if format_ is None else format_
        _check_format(rate)
        self.station = station = RtuStation(
            self.scheduler,
            line,
            self.server,
            name=self.name,
            format_=format_,
            lenient=False,
            processing_ns=self.modbus_config.processing_ns,
        )
        self._limits_ns = (_CHARACTER_DELAY_NS.get(rate.baud, rate.t15_ns), rate.t35_ns)
        self._apply_times()
        station.online = self._online
        return station

    def open_terminal(self, format_: SerialFormat | None = None) -> PtyServer:
        """Open a pseudo-terminal that any program takes for its serial port (`path`); `close` takes it away.

        Raises:
            ConfigurationError: The drive is on a bus already, or it has not this rate or characters (PD-289).
            OSError: The system has no pseudo-terminal left.

        """
        self._be_free()
        rate = SerialFormat() if format_ is None else format_
        _check_format(rate)
        self.station = self._terminal = station = PtyServer(
            self.scheduler, self.server, format_=rate, processing_ns=self.modbus_config.processing_ns
        )
        station.online = self._online
        self._apply_times()
        return station

    def close(self) -> None:
        """Take the pseudo-terminal away, if there is one; harmless to repeat."""
        if self._terminal is not None:
            self._terminal.close()

    # Times of the serial line, p2024 (PD-291).

    def _check_time(self, sub_index: int, value: float) -> None:
        time_ns = round(value * MS)
        if isinstance(self.station, RtuStation) and time_ns:
            delay_ns, pause_ns = self._limits_ns
            if (sub_index == 1 and time_ns > delay_ns) or (sub_index == 2 and time_ns < pause_ns):
                raise ParameterAccessError("this time is not possible at this rate", ParameterError.LIMIT)
        # The store keeps the value behind this.
        self.scheduler.at(self.scheduler.now, self._apply_times)

    def _apply_times(self) -> None:
        station = self.station
        if station is None or isinstance(station, TcpStation):
            return
        longest, delay, pause = (round(value * MS) for value in self.parameters.store.values(2024, 0, 3))
        station.longest_processing_ns = longest
        if isinstance(station, RtuStation):
            station.assembler.t15_ns = delay or self._limits_ns[0]
            station.assembler.t35_ns = pause or self._limits_ns[1]

    def _be_free(self) -> None:
        if self.station is not None:
            raise ConfigurationError("bus of the drive", self.name, "one bus")

    def set_analog_input(self, number: int, percent: float) -> None:
        """Let an analog input show a value; see `Terminals.set_analog_input`."""
        self.parameters.terminals.set_analog_input(number, percent)

    # -- life ------------------------------------------------------------------------------------------

    @property
    def _online(self) -> bool:
        return self.drive.powered and self._boot_timer is None

    def power_on(self) -> None:
        """Switch the control supply on; the saved parameters are loaded."""
        if self.drive.powered:
            return
        self.parameters.memory.restart()
        if self.server.unit is not None:
            self.server.unit = int(self.parameters.store.value(918))
        self.registers.restart()
        self.channel.reset()
        if self.modbus_config.boot_time_ms:
            self._boot_timer = self.scheduler.after(round(self.modbus_config.boot_time_ms * MS), self._booted)
        self._show_supply()

    def _booted(self) -> None:
        self._boot_timer = None
        self._show_supply()

    def power_off(self) -> None:
        """Switch everything off at once: the motor coasts, all but the saved parameters is lost."""
        if self._boot_timer is not None:
            self._boot_timer.cancel()
            self._boot_timer = None
        self.drive.power_off()
        self._show_supply()

    def _show_supply(self) -> None:
        if self.station is not None:
            self.station.online = self._online

    # -- the drive as its registers see it -------------------------------------------------------------

    def accessed(self) -> None:
        """Keep the process data from timing out (PD-292)."""
        self.drive.accessed()

    def request(self, data: bytes) -> bytes:
        """Answer a request of base mode parameter access."""
        return self.parameters.server.request(data)

    # -- faults ----------------------------------------------------------------------------------------

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
        self._on_bus().silent = silent

    def delay_responses(self, delay_s: float) -> None:
        """Answer this long after the request, s.

        Raises:
            UnsupportedFaultError: The drive is on no bus.
            ConfigurationError: The time is negative.

        """
        if not delay_s >= 0.0:
            raise ConfigurationError("delay_s", delay_s, ">= 0")
        self._on_bus().processing_ns = seconds_to_ns(delay_s)

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
        """Restart as after a dip of the supply: silence for `boot_s`, then
        service again; the motor coasts.
        """
        self.power_off()
        self.scheduler.after(seconds_to_ns(boot_s), self.power_on)

    def _on_bus(self) -> RtuStation | TcpStation[Any] | PtyServer:
        if self.station is None:
            raise UnsupportedFaultError(f"{self.name}: the drive is on no Modbus link")
        return self.station


def _check_format(format_: SerialFormat) -> None:
    if format_.baud not in RATES:
        raise ConfigurationError("serial line, baud", format_.baud, ", ".join(map(str, RATES)))
    if format_.bits != _BITS:
        parity = "no parity" if format_.parity is Parity.NONE else f"{format_.parity.value} parity"
        raise ConfigurationError(
            "serial line, characters",
            f"{format_.bits} bits, {parity}",
            f"{_BITS} bits: parity and 1 stop bit, or 2 stop bits",
        )
