"""A CiA 402 drive without an axis, and a plain CANopen master that leads it object by object."""

from __future__ import annotations

from struct import pack
from typing import Final

from fieldbus.canopen import NmtCommand
from hil.bench import BenchFile
from hil.campaign import CaseContext
from hil.errors import BlockedError

NODE: Final = 5
DRIVE: Final = "drive1"
REV: Final = 4000
"""Increments per revolution of the motor, and per 10 mm of the slide."""
BENCH: Final = BenchFile(
    "led servo",
    f"""
[bench]
name = "led servo"
kind = "virtual"
cycle_ms = 4

[segment.can0]
bitrate = 1_000_000

[drive.drive1]
segment = "can0"
node_id = {NODE}
increments_per_revolution = {REV}
index_increments = 777
heartbeat_ms = 0

[drive.drive1.mechanics]
coulomb_friction_n = 0.0
viscous_friction_n_per_m_s = 0.0

[drive.drive1.switches]
home_from_mm = -30.0
home_to_mm = -12.5
negative_limit_mm = -45.0
positive_limit_mm = 61.0
input_filter_ms = 0.0
hysteresis_mm = 0.25
probe1_from_mm = 20.0
probe1_to_mm = 30.0
""",
)
"""A slide of 10 mm per revolution without friction; switches at places that are not alike."""


class Node:
    """A node as a plain master has it: objects by SDO, NMT commands, and the frames on the segment.

    Args:
        ctx: The case.
        node: Its node-ID.

    """

    def __init__(self, ctx: CaseContext, node: int = NODE) -> None:
        self._ctx = ctx
        self.node = node
        self._master = ctx.bench.network()
        self._sdo = self._master.sdo(node)
        self._sizes: dict[tuple[int, int], int] = {}
        self.frames: list[tuple[float, int, bytes]] = []
        """Time in s, identifier and data of what came under the identifiers of `listen`."""

    # -- objects --------------------------------------------------------------------------------------------

    def upload(self, index: int, sub: int = 0, *, block: bool = False) -> bytes | int:
        """Return the bytes of an object, or the abort code."""
        job = self._sdo.upload(index, sub, block=block)
        self._ctx.wait_until(job.done, 10.0, f"{index:04X}h:{sub} is read")
        return job.data if job.ok else job.abort_code

    def download(self, index: int, sub: int, data: bytes, *, block: bool | None = None) -> int:
        """Write bytes and return the abort code; 0: they were taken."""
        job = self._sdo.download(index, sub, data, block=block)
        self._ctx.wait_until(job.done, 10.0, f"{index:04X}h:{sub} is written")
        return job.abort_code

    def read(self, index: int, sub: int = 0, *, signed: bool = True) -> int:
        """Return an object as a number.

        Raises:
            BlockedError: The node has no such object.

        """
        data = self.upload(index, sub)
        if isinstance(data, int):
            raise BlockedError(f"{index:04X}h:{sub} cannot be read: {data:08X}h")
        self._sizes[index, sub] = len(data)
        return int.from_bytes(data, "little", signed=signed)

    def try_write(self, index: int, value: int, sub: int = 0) -> int:
        """Write a number and return the abort code; 0: it was taken."""
        if (index, sub) not in self._sizes:
            self.read(index, sub)
        size = self._sizes[index, sub]
        return self.download(index, sub, (value & (1 << 8 * size) - 1).to_bytes(size, "little"))

    def write(self, index: int, value: int, sub: int = 0) -> None:
        """Write a number.

        Raises:
            BlockedError: The node refuses it.

        """
        if code := self.try_write(index, value, sub):
            raise BlockedError(f"{index:04X}h:{sub} = {value} is refused: {code:08X}h")

    def configure(self, objects: dict[int | tuple[int, int], int]) -> None:
        """Write numbers."""
        for key, value in objects.items():
            index, sub = key if isinstance(key, tuple) else (key, 0)
            self.write(index, value, sub)

    # -- what the case measures -----------------------------------------------------------------------------

    def shows(
        self, index: int, wanted: float, *ids: str, sub: int = 0, within: float = 0.0, signed: bool = True
    ) -> None:
        """Expect the value of an object now."""
        self.equal(f"{index:04X}h:{sub}", self.read(index, sub, signed=signed), wanted, *ids, within=within)

    def equal(self, what: str, value: float, wanted: float, *ids: str, within: float = 0.0) -> None:
        """Expect a number."""
        self._ctx.measure(what, value, low=wanted - within, high=wanted + within, requirements=ids)

    def refuses(self, index: int, value: int, code: int, *ids: str, sub: int = 0) -> None:
        """Expect an abort code, 0 for none, and that a refused value is not there afterwards."""
        before = self.upload(index, sub)
        found = self.try_write(index, value, sub)
        self.equal(f"abort code of {index:04X}h:{sub} = {value}", found, code, *ids)
        if code:
            self.equal(f"{index:04X}h:{sub} is unchanged", self.upload(index, sub) == before, 1, *ids)

    def bits(self, mask: int, value: int, *ids: str) -> None:
        """Expect bits of the status word now."""
        word = self.read(0x6041, signed=False)
        self.equal(f"bits {mask:04X}h of the status word", word & mask, value, *ids)

    # -- frames ---------------------------------------------------------------------------------------------

    def nmt(self, command: NmtCommand, node: int | None = None) -> None:
        """Send an NMT command; it acts a moment later."""
        self._ctx.do(f"NMT command {command.name}")
        self._master.nmt(command, self.node if node is None else node)
        self._ctx.run_for(0.002)

    def send(self, cob_id: int, data: bytes) -> None:
        """Send a frame; it arrives a moment later."""
        self._master.send(cob_id, data)
        self._ctx.run_for(0.001)

    def listen(self, *cob_ids: int) -> None:
        """Keep what comes under identifiers from now on."""
        for cob_id in cob_ids:
            self._master.subscribe(
                cob_id,
                lambda data, time_ns, cob_id=cob_id: self.frames.append((time_ns / 1e9, cob_id, bytes(data))),
            )

    def taken(self, cob_id: int) -> list[bytes]:
        """Return what has come under an identifier, and forget it."""
        found = [data for _, one, data in self.frames if one == cob_id]
        self.frames = [frame for frame in self.frames if frame[1] != cob_id]
        return found

    def times(self, cob_id: int) -> list[float]:
        """Return when something has come under an identifier, s."""
        return [time_s for time_s, one, _ in self.frames if one == cob_id]

    def ask(self, cob_id: int, data: bytes, answer: int) -> bytes:
        """Send a frame and return the first answer; empty: there is none."""
        self.taken(answer)
        self.send(cob_id, data)
        self._ctx.run_for(0.02)
        found = self.taken(answer)
        return found[0] if found else b""

    def map_pdo(self, number: int, objects: tuple[int, ...], kind: int, *, transmit: bool) -> None:
        """Map a PDO in the order of the standard."""
        record = (0x1800 if transmit else 0x1400) + number - 1
        base = (0x80 if transmit else 0x100) + 0x100 * number
        self.write(record, 1 << 31 | base + self.node, 1)
        self.write(record + 0x200, 0)
        for sub, entry in enumerate(objects, 1):
            self.write(record + 0x200, entry, sub)
        self.write(record + 0x200, len(objects))
        self.write(record, kind, 2)
        self.write(record, base + self.node, 1)

    # -- the drive ------------------------------------------------------------------------------------------

    def control(self, word: int, wait_s: float = 0.004) -> None:
        """Write 6040h and let the drive act."""
        self.write(0x6040, word)
        self._ctx.run_for(wait_s)

    def enable(self, mode: int) -> None:
        """Go to *Operation enabled* in a mode.

        Raises:
            ExpectationFailedError: The drive does not come there.

        """
        self._ctx.do(f"enable the drive in mode {mode}")
        self.write(0x6060, mode)
        for word in (0x06, 0x07, 0x0F):
            self.control(word)
        self.bits(0x6F, 0x27, "C402-018")

    def until(self, mask: int, value: int, limit_s: float, text: str) -> float:
        """Poll the status word until bits have a value; return how long that took, s.

        Raises:
            ExpectationFailedError: It did not happen in time.

        """
        begun = self._ctx.now_s
        while self.read(0x6041, signed=False) & mask != value:
            if self._ctx.now_s - begun > limit_s:
                self._ctx.wait_until(lambda: False, 0.0, text)
            self._ctx.run_for(0.001)
        return self._ctx.now_s - begun


def words(*numbers: int) -> bytes:
    """Return little-endian words of 16 bits."""
    return b"".join(pack("<H", number & 0xFFFF) for number in numbers)
