"""A PROFIdrive drive that no axis moves, led by a test through the words of its telegram.

    master = bench.telegram("drive1")
    master.send(STW1=0x047E)
    bench.run_for(0.1)
    master["ZSW1"]

In every application cycle the last answer is taken and the telegram is sent; signals stay as they are until
`send` changes them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from fieldbus.clock import MS, S
from fieldbus.errors import ConfigurationError
from hil.bench._startup import BenchNotReadyError, commission
from hil.errors import BlockedError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from fieldbus.profidrive import Telegram
    from hil.bench.bench import Bench
    from motion.drives.profidrive_can import ProfidriveCanPort
    from motion.drives.profidrive_modbus import ProfidriveModbusPort


_LINK_TIMEOUT_NS: Final = 5 * S


class TelegramMaster:
    """Leads a drive by the signals of its telegram.

    Args:
        port: Carries the telegram; who owns this calls `cycle` once per application cycle.

    """

    def __init__(self, port: ProfidriveCanPort | ProfidriveModbusPort) -> None:
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


def lead(bench: Bench, name: str) -> TelegramMaster:
    """Take a drive without an axis into service and return its master; bench time passes until the drive
    answers.

    Raises:
        ConfigurationError: There is no such drive, it has an axis, or it is none with a telegram.
        BlockedError: It is on a live CAN segment without an axis: somebody else is the controller there.
        BenchNotReadyError: The drive did not come up.

    """
    config = bench.config
    if name not in config.drive:
        raise ConfigurationError("bench drive", name, ", ".join(config.drive))
    section = config.drive[name]
    if section.profile != "profidrive":
        raise ConfigurationError(
            f"drive.{name}.profile", section.profile, "profidrive: another drive has no telegram"
        )
    for axis, row in config.axis.items():
        if row.drive == name:
            raise ConfigurationError(f"drive {name}", f"leads axis {axis}", "a drive without an axis")
    foreign = not config.leads(section.segment) and not config.segment[section.segment].on_modbus
    if foreign and bench.kind == "live":
        raise BlockedError(f"somebody else is the controller on segment {section.segment}")
    port, controller = bench.lead_drive(name)
    if controller is not None and foreign:
        controller.start_sync(bench.cycle_ns, 0)
    if controller is not None and section.heartbeat_ms:
        controller.produce_heartbeat(section.heartbeat_ms * MS)
    master = TelegramMaster(port)
    commission(bench.scheduler, [port], None)
    bench.on_cycle(master.cycle)
    if not bench.scheduler.run_until(lambda: master.link_ok, _LINK_TIMEOUT_NS):
        raise BenchNotReadyError(f"no cyclic data from {name} within {_LINK_TIMEOUT_NS // S} s")
    return master
