"""A PROFIdrive drive without an axis: the test writes and reads the signals of its telegram.

    master = bench.telegram("drive1")
    master.send(STW1=0x047E)
    bench.run_for(0.1)
    master["ZSW1"]

In every application cycle the last answer is taken and the telegram is sent; signals stay as they are until
`send` changes them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from fieldbus.clock import MS, S
from fieldbus.errors import ConfigurationError
from hil.bench.drive_config import ProfidriveCanTable, ProfidriveModbusTable
from hil.bench.startup import LINK_TIMEOUT_NS, commission
from hil.errors import BlockedError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from fieldbus.canopen.master import CanopenMaster
    from fieldbus.clock import Scheduler
    from fieldbus.profidrive import Telegram
    from hil.bench.config import BenchConfig
    from hil.bench.drive_ports import DrivePorts, TelegramPort


class TelegramMaster:
    """Controls a drive by the signals of its telegram.

    Args:
        port: Carries the telegram; `cycle` has to be called once per application cycle.

    """

    def __init__(self, port: TelegramPort) -> None:
        self._port = port
        self._places = {name: at for at, name in enumerate(port.telegram.setpoint.names) if name != "FREE"}
        self._row = [0] * len(port.telegram.setpoint.names)
        # Limits of 200 % and an override of 100 %: what a telegram without them has.
        for name, value in (
            ("M_LIMIT_POS", 0x7FFF),
            ("M_LIMIT_NEG", -0x8000),
            ("OVERRIDE", 0x4000),
            ("MDI_ACC", 0x4000),
            ("MDI_DEC", 0x4000),
        ):
            if name in self._places:
                self._row[self._places[name]] = value

    @property
    def telegram(self) -> Telegram:
        """Layout of both directions."""
        return self._port.telegram

    @property
    def link_ok(self) -> bool:
        """Whether the drive is in service and answers."""
        return self._port.link_ok

    def send(self, **signals: int) -> None:
        """Set signals of the telegram, from the next application cycle on.

        Args:
            signals: By name, as the wire has them; a word may be signed or unsigned. The sign of life in
                STW2 is the master's.

        Raises:
            ConfigurationError: The telegram has no such signal.
            TelegramError: A value is out of the range of its signal.

        """
        for name in signals:
            if name not in self._places:
                raise ConfigurationError("signal of the telegram", name, ", ".join(self._places))
        layout = self._port.telegram.setpoint
        frame = layout.unpack(layout.encode(signals))
        for name in signals:
            at = self._places[name]
            self._row[at] = frame[at]

    @property
    def sent(self) -> Mapping[str, int]:
        """Signals to the drive, by name."""
        return {name: self._row[at] for name, at in self._places.items()}

    @property
    def actual(self) -> Mapping[str, int]:
        """Signals of the last answer, by name; zeros before the first one."""
        return {name: self._port.actual(name) for name in self._port.telegram.actual.names if name != "FREE"}

    def __getitem__(self, name: str) -> int:
        """Return a signal of the last answer.

        Raises:
            ConfigurationError: The telegram has no such signal.

        """
        return self._port.actual(name)

    def cycle(self) -> None:
        """Take the answer and send the telegram."""
        self._port.read()
        self._port.write_words(self._row)


def lead(
    config: BenchConfig,
    name: str,
    *,
    ports: DrivePorts,
    master: CanopenMaster | None,
    scheduler: Scheduler,
    on_cycle: Callable[[Callable[[], object]], object],
) -> TelegramMaster:
    """Take a drive without an axis into service and return its master; bench time
    passes until the drive answers.

    Args:
        config: The bench file.
        name: Name of the drive.
        ports: The controller's ports; gets the one to this drive.
        master: CANopen services on the segment of the drive; None on Modbus.
        scheduler: Time of the bench.
        on_cycle: Calls a function in every application cycle.

    Raises:
        ConfigurationError: There is no such drive, it has an axis, or it has no telegram.
        BlockedError: It is on a live CAN segment without an axis, where somebody else is the controller, or
            it did not come up.

    """
    if name not in config.drive:
        raise ConfigurationError("bench drive", name, ", ".join(config.drive))
    section = config.drive[name]
    if not isinstance(section, ProfidriveCanTable | ProfidriveModbusTable):
        raise ConfigurationError(
            f"drive.{name}.profile", section.profile, "profidrive: another drive has no telegram"
        )
    for axis, row in config.axis.items():
        if row.drive == name:
            raise ConfigurationError(f"drive {name}", f"leads axis {axis}", "a drive without an axis")
    foreign = master is not None and not config.leads(section.segment)
    if foreign and config.bench.kind == "live":
        raise BlockedError(f"somebody else is the controller on segment {section.segment}")
    ports.add(name)
    port = ports.telegram_port(name)
    if master is not None and foreign:
        master.start_sync(config.bench.cycle_ms * MS, 0)
    if master is not None and isinstance(section, ProfidriveCanTable) and section.heartbeat_ms:
        master.produce_heartbeat(section.heartbeat_ms * MS)
    telegram = TelegramMaster(port)
    commission(scheduler, ports, [name])
    on_cycle(telegram.cycle)
    if not scheduler.run_until(lambda: port.link_ok, LINK_TIMEOUT_NS):
        raise BlockedError(f"no cyclic data from {name} within {LINK_TIMEOUT_NS // S} s")
    return telegram
