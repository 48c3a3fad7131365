"""An emulated drive on a real Modbus link, its scheduler running in a thread, so that programs that wait can
talk to it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from threading import Event, Thread
from typing import Any

from emulators.drive.profidrive import DriveSettings, ProfidriveConfig
from emulators.drive.profidrive.config import POSITION_TELEGRAMS
from emulators.drive.profidrive.modbus import ProfidriveModbusDrive
from emulators.drive.profidrive.modbus_config import ProfidriveModbusConfig
from fieldbus.clock import MS, RealtimeScheduler, S
from fieldbus.modbus import SocketNetwork

UNIT = 5
SETTINGS = DriveSettings(operating_mode=1, ramp_up_s=0.2, ramp_down_s=0.2, quick_stop_s=0.1)


class RealDrive:
    """A drive over TCP on loopback (`host`, `port`) or on a pseudo-terminal (`path`)."""

    def __init__(self, link: str, config: ProfidriveModbusConfig) -> None:
        self.scheduler = RealtimeScheduler()
        self.drive = ProfidriveModbusDrive(self.scheduler, config, name="drive")
        self.network: SocketNetwork | None = None
        self.host, self.port, self.path = "", 0, ""
        if link == "tcp":
            self.network = SocketNetwork(self.scheduler)
            self.drive.listen(self.network)
            self.host, self.port = self.network.serve()
        else:
            self.path = self.drive.open_terminal().path
        self.drive.power_on()

    def do(self, what: Callable[[], Any]) -> Any:
        """Run something on the scheduler's thread and return its result."""
        found: list[Any] = []
        done = Event()

        def act() -> None:
            found.append(what())
            done.set()

        self.scheduler.post(act)
        assert done.wait(10.0), "the scheduler does not run"
        return found[0]

    def close(self) -> None:
        self.drive.close()
        if self.network is not None:
            self.network.close()


def slow_servo(telegram: int = 1, **options: Any) -> ProfidriveConfig:
    """A drive whose servo runs every 0.5 ms, which is enough for whoever talks to it in real time."""
    settings = replace(SETTINGS, operating_mode=2) if telegram in POSITION_TELEGRAMS else SETTINGS
    return ProfidriveConfig(
        telegram=telegram, settings=settings, servo_period_ns=MS // 2, cycle_ns=4 * MS, **options
    )


@contextmanager
def real_drive(link: str, config: ProfidriveModbusConfig | None = None) -> Iterator[RealDrive]:
    chosen = config or ProfidriveModbusConfig(unit=UNIT, drive=slow_servo(), setpoint_monitoring_ms=0.0)
    device = RealDrive(link, chosen)
    over = Event()
    thread = Thread(target=lambda: device.scheduler.run_until(over.is_set, 600 * S), daemon=True)
    thread.start()
    try:
        yield device
    finally:
        device.scheduler.post(over.set)
        thread.join()
        device.close()
