"""A CiA 402 drive on a segment of its own, whose objects are written and read without the bus: any
configuration of the emulator, without a bench file.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from emulators.drive.cia402 import CiA402Drive, DriveConfig
from fieldbus.can import CanMedium
from fieldbus.canopen import CanopenMaster
from fieldbus.canopen.abort import SdoAbort
from fieldbus.clock import VirtualScheduler
from fieldbus.history import History
from hil.campaign import CaseContext
from testcases.campaigns.support import equal

REV: Final = 131_072
"""Increments of a revolution, and position units of the reference configuration."""


class Servo:
    """The drive, and what is expected of it.

    Args:
        ctx: The case.
        config: The drive; None: that of the reference axis.
        objects: Numbers that are written after the start.

    """

    def __init__(
        self, ctx: CaseContext, config: DriveConfig | None = None, objects: Mapping[Any, int] | None = None
    ) -> None:
        self.ctx = ctx
        self.scheduler = VirtualScheduler()
        self.medium = CanMedium(self.scheduler)
        self.history = History(self.scheduler)
        self.drive = CiA402Drive(
            self.scheduler,
            self.medium,
            DriveConfig.reference() if config is None else config,
            name="servo",
            history=self.history,
        )
        self.master = CanopenMaster(self.scheduler, self.medium)
        self.emcys: list[int] = []
        self.master.on_emcy(self.drive.config.node_id, lambda code, _register, _data: self.emcys.append(code))
        self.drive.power_on()
        self.run(0.002)
        self.configure(objects or {})

    def run(self, seconds: float) -> None:
        """Let time pass."""
        self.scheduler.run_for(round(seconds * 1e9))

    # -- objects --------------------------------------------------------------------------------------------

    def write(self, index: int, value: int, sub: int = 0) -> int:
        """Write a number and return the abort code; 0: it was taken."""
        store = self.drive.slave.store
        try:
            entry = store.entry(index, sub)
            data = (value & (1 << 8 * entry.size) - 1).to_bytes(entry.size, "little")
            store.write(index, sub, data, expedited=True)
        except SdoAbort as abort:
            return int(abort.code)
        return 0

    def configure(self, objects: Mapping[Any, int]) -> None:
        """Write numbers, by index or (index, sub-index)."""
        for key, value in objects.items():
            index, sub = key if isinstance(key, tuple) else (key, 0)
            code = self.write(index, value, sub)
            if code:
                self.equal(f"abort code of {index:04X}h:{sub} = {value}", code, 0)

    def read(self, index: int, sub: int = 0) -> int:
        """Return a number."""
        entry = self.drive.slave.store.entry(index, sub)
        return int.from_bytes(self.drive.slave.store.read(index, sub), "little", signed=entry.signed)

    # -- the drive ------------------------------------------------------------------------------------------

    def control(self, word: int, seconds: float = 0.002) -> None:
        """Write 6040h and let the drive act."""
        self.write(0x6040, word)
        self.run(seconds)

    def enable(self, mode: int, word: int = 0x0F) -> None:
        """Go to *Operation enabled* in a mode."""
        self.write(0x6060, mode)
        self.run(0.002)
        for one in (0x06, 0x07, word):
            self.control(one)
        self.bits(0x6F, 0x27)

    def until(self, mask: int, value: int, limit_s: float, text: str) -> float:
        """Wait until bits of the status word have a value; expects them in time, and returns how long, s."""
        begun = self.scheduler.now
        while self.read(0x6041) & mask != value and self.scheduler.now - begun < limit_s * 1e9:
            self.run(0.001)
        took = (self.scheduler.now - begun) / 1e9
        self.equal(f"{text}: bits {mask:04X}h of the status word", self.read(0x6041) & mask, value)
        return took

    @property
    def rpm(self) -> float:
        """Speed of the motor."""
        return float(self.drive.core.speed_rpm)

    @property
    def turns(self) -> float:
        """Place of the motor, revolutions."""
        return float(self.drive.core.position) / 6.283185307179586

    # -- expectations ---------------------------------------------------------------------------------------

    def equal(self, what: str, found: float, wanted: float, *ids: str, within: float = 0.0) -> None:
        """Expect a number."""
        equal(self.ctx, what, found, wanted, *ids, within=within)

    def bits(self, mask: int, value: int, *ids: str) -> None:
        """Expect bits of the status word now."""
        self.equal(f"bits {mask:04X}h of the status word", self.read(0x6041) & mask, value, *ids)

    def shows(self, index: int, wanted: float, *ids: str, sub: int = 0, within: float = 0.0) -> None:
        """Expect the value of an object now."""
        self.equal(f"{index:04X}h:{sub}", self.read(index, sub), wanted, *ids, within=within)

    def refuses(self, index: int, value: int, code: int, *ids: str, sub: int = 0) -> None:
        """Expect an abort code, and that nothing has changed."""
        before = self.read(index, sub)
        self.equal(f"abort code of {index:04X}h:{sub} = {value}", self.write(index, value, sub), code, *ids)
        self.equal(f"{index:04X}h:{sub} is unchanged", self.read(index, sub), before, *ids)

    def events(self, kind: str) -> list[Any]:
        """Return the events of a kind."""
        return [one for one in self.history.events if one.kind == kind]
