"""A drive on a CAN segment in virtual time with a small controller, for the tests of the emulated drive."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from struct import pack
from typing import Any

import numpy as np
import pytest

from emulators.drive.cia402 import CiA402Drive, DriveConfig
from fieldbus.can import CanMedium
from fieldbus.canopen import CanopenMaster, NmtCommand
from fieldbus.cia402 import DriveState
from fieldbus.clock import MS
from testcases.rigs import VirtualRig

SYNC_NS = 4 * MS


class DriveBench(VirtualRig):
    """One emulated drive (node 1) and a controller that owns the bus.

    `write` and `read` use the drive's SDO rules without the bus delay; `cycle` sends the reference bench's
    cyclic RPDO.
    """

    def __init__(self, config: DriveConfig, *, power: bool = True, seed: int = 1) -> None:
        super().__init__(cycle_ns=SYNC_NS)
        self.medium = CanMedium(self.scheduler, history=self.history)
        self.drive = CiA402Drive(
            self.scheduler,
            self.medium,
            config,
            name="drive",
            history=self.history,
            rng=np.random.default_rng(seed),
        )
        self.master = CanopenMaster(self.scheduler, self.medium, history=self.history)
        self.emcys: list[tuple[int, int]] = []
        self.master.on_emcy(1, lambda code, register, _data: self.emcys.append((code, register)))
        self.word = 0
        self.target = 0
        self.mode = 9
        self.sending = True
        self._next_rpdo: Any = None
        if power:
            self.drive.power_on()
            self.run(0.002)

    # -- objects -------------------------------------------------------------------------------------------

    def write(self, index: int, value: int, sub: int = 0) -> None:
        """Write as an SDO download does; raises SdoAbort as the drive answers."""
        entry = self.drive.slave.store.entry(index, sub)
        data = value.to_bytes(entry.size, "little", signed=value < 0)
        self.drive.slave.store.write(index, sub, data, expedited=True)

    def read(self, index: int, sub: int = 0) -> int:
        """Read as an SDO upload does."""
        entry = self.drive.slave.store.entry(index, sub)
        return int.from_bytes(self.drive.slave.store.read(index, sub), "little", signed=entry.signed)

    def configure(self, values: Mapping[int, int]) -> None:
        for index, value in values.items():
            self.write(index, value)

    @property
    def status(self) -> int:
        return self.read(0x6041)

    @property
    def state(self) -> DriveState:
        return self.drive.state

    def control(self, word: int, wait: float = 0.002) -> None:
        """Write 6040h and let the drive work for a moment."""
        self.write(0x6040, word)
        self.run(wait)

    def set_mode(self, mode: int) -> None:
        self.write(0x6060, mode)
        self.run(0.002)

    def enable(self, mode: int | None = None) -> None:
        """Go to Operation enabled by SDO."""
        if mode is not None:
            self.set_mode(mode)
        for word in (0x06, 0x07, 0x0F):
            self.control(word)
        assert self.state is DriveState.OPERATION_ENABLED

    def to_state(self, state: DriveState) -> None:
        """Bring a drive that has just been powered on into a state."""
        if state in (DriveState.FAULT, DriveState.FAULT_REACTION_ACTIVE):
            if state is DriveState.FAULT_REACTION_ACTIVE:
                self.spin()
            self.drive.raise_fault(0x4310)
        else:
            words = {
                DriveState.SWITCH_ON_DISABLED: (),
                DriveState.READY_TO_SWITCH_ON: (0x06,),
                DriveState.SWITCHED_ON: (0x06, 0x07),
                DriveState.OPERATION_ENABLED: (0x06, 0x07, 0x0F),
                DriveState.QUICK_STOP_ACTIVE: (),
            }[state]
            for word in words:
                self.control(word)
            if state is DriveState.QUICK_STOP_ACTIVE:
                self.spin()
                self.control(0x02)
        assert self.state is state

    def spin(self, rpm: float = 1800.0) -> None:
        """Turn the motor in profile velocity mode."""
        self.write(0x6083, 60_000_000)
        self.enable(3)
        self.write(0x60FF, round(rpm * 1000))
        self.run(abs(rpm) / 60000.0 + 0.1)
        assert self.drive.core.speed_rpm == pytest.approx(rpm, rel=1e-3)

    # -- cyclic operation ----------------------------------------------------------------------------------

    def map_rpdo(self, number: int, objects: tuple[int, ...], kind: int = 1) -> None:
        self._map(0x1400 + number - 1, 0x1600 + number - 1, 0x101 + 0x100 * number, objects, kind)

    def map_tpdo(self, number: int, objects: tuple[int, ...], kind: int = 1) -> None:
        self._map(0x1800 + number - 1, 0x1A00 + number - 1, 0x40000081 + 0x100 * number, objects, kind)

    def _map(self, record: int, mapping: int, cob_id: int, objects: tuple[int, ...], kind: int) -> None:
        self.write(record, cob_id | 1 << 31, 1)
        self.write(mapping, 0)
        for sub, value in enumerate(objects, 1):
            self.write(mapping, value, sub)
        self.write(mapping, len(objects))
        self.write(record, kind, 2)
        self.write(record, cob_id, 1)

    def start_cyclic(self, mode: int = 9, period_ns: int = SYNC_NS) -> None:
        """Map the PDOs of the reference bench, start SYNC and send RPDO1 half a cycle after it."""
        target = {8: 0x607A0020, 9: 0x60FF0020, 10: 0x60710010}[mode]
        self.mode = mode
        self._code = "<HhB" if mode == 10 else "<HiB"
        for number in (2, 3, 4):
            self.write(0x1400 + number - 1, 1 << 31, 1)
            self.write(0x1800 + number - 1, 3 << 30, 1)
        self.map_rpdo(1, (0x60400010, target, 0x60600008))
        self.map_tpdo(1, (0x60410010, 0x60640020, 0x60770010))
        self.map_tpdo(2, (0x606C0020, 0x60FD0020))
        self.map_tpdo(3, (0x603F0010, 0x10010008), 255)
        self.write(0x60C2, period_ns // MS, 1)
        self.master.nmt(NmtCommand.START, 1)
        self.master.start_sync(period_ns)
        self._next_rpdo = self.scheduler.every(period_ns, self._send, phase_ns=period_ns // 2)
        self.run(0.02)

    def _send(self) -> None:
        if self.sending:
            self.master.send(0x201, pack(self._code, self.word, self.target, self.mode))

    def enable_cyclic(self) -> None:
        for word in (0x06, 0x07, 0x0F):
            self.word = word
            self.run(0.012)
        assert self.state is DriveState.OPERATION_ENABLED

    # -- observation -----------------------------------------------------------------------------------------

    def observe(self) -> list[tuple[float, float, float]]:
        """Note (time s, position, velocity) of the true load after every servo step from now on."""
        samples: list[tuple[float, float, float]] = []
        mechanics = self.drive.mechanics
        scheduler = self.scheduler
        scheduler.every(
            self.drive.config.servo_period_ns,
            lambda: samples.append((scheduler.now / 1e9, mechanics.position, mechanics.velocity)),
            priority=5,
        )
        return samples

    def transitions(self) -> list[int]:
        return [int(event.data["transition"]) for event in self.history.select(kind="drive.state")]


def measure_ramp(samples: list[tuple[float, float, float]]) -> tuple[float, float]:
    """Return duration (s) and travel of the stop in samples that begin at constant speed and end at rest."""
    start = samples[0][2]
    first = next(i for i, sample in enumerate(samples) if abs(sample[2] - start) > 1e-4 * abs(start)) - 1
    last = next(i for i in range(first, len(samples)) if abs(samples[i][2]) < 1e-4 * abs(start))
    return samples[last][0] - samples[first][0], samples[last][1] - samples[first][1]


@pytest.fixture
def make_bench() -> Callable[..., DriveBench]:
    """Return a factory of benches; default: the reference axis, powered on."""

    def make(config: DriveConfig | None = None, **options: Any) -> DriveBench:
        return DriveBench(DriveConfig.reference() if config is None else config, **options)

    return make


@pytest.fixture(scope="session")
def make_bench_factory() -> Callable[[DriveConfig], DriveBench]:
    """Return `DriveBench`, for tests that make a bench per example."""
    return DriveBench


@pytest.fixture
def bench(make_bench: Callable[..., DriveBench]) -> DriveBench:
    """Return the reference axis, powered on, in Switch on disabled."""
    return make_bench()


@pytest.fixture
def ramp_of() -> Callable[[list[tuple[float, float, float]]], tuple[float, float]]:
    """Return the function that measures a stop."""
    return measure_ramp
