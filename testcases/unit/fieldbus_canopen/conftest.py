"""A drive-like object dictionary, a slave on a CAN segment, and shorthand for frames."""

from __future__ import annotations

from functools import cache
from io import StringIO
from types import SimpleNamespace
from typing import Any

import canopen
import pytest

from fieldbus.can import CanFrame, CanMedium
from fieldbus.canopen import CanopenSlave
from fieldbus.clock import MS, VirtualScheduler
from fieldbus.history import History
from testcases.campaigns._small_drive import eds_text

NODE = 5


def dictionary(node_id: int | None = None) -> canopen.ObjectDictionary:
    """Return the object dictionary of the test drive, as the library reads it."""
    source = StringIO(eds_text())
    source.name = "drive.eds"
    return canopen.objectdictionary.import_od(source, node_id)


@cache
def _shared_dictionary() -> canopen.ObjectDictionary:
    return dictionary()


class Bench:
    """One slave on a segment, and a tester that speaks raw frames."""

    def __init__(
        self, od: canopen.ObjectDictionary | None = None, *, node_id: int = NODE, **options: Any
    ) -> None:
        self.scheduler = VirtualScheduler()
        self.history = History(self.scheduler)
        self.segment = CanMedium(self.scheduler)
        od = _shared_dictionary() if od is None else od
        self.slave = CanopenSlave(
            self.scheduler, self.segment, od, node_id, name="drive1", history=self.history, **options
        )
        self.received: list[tuple[int, CanFrame]] = []
        self.port = self.segment.attach(
            "tester", lambda frame, time_ns: self.received.append((time_ns, frame))
        )

    def run(self, milliseconds: float = 2) -> None:
        self.scheduler.run_for(round(milliseconds * MS))

    def send(self, can_id: int, data: bytes | str = b"", **options: Any) -> None:
        payload = bytes.fromhex(data) if isinstance(data, str) else data
        self.port.send(CanFrame(can_id, payload, **options))

    def ask(self, can_id: int, data: bytes | str = b"", **options: Any) -> list[CanFrame]:
        """Send a frame, run 5 ms, return what the slave has sent since."""
        self.received.clear()
        self.send(can_id, data, **options)
        self.run(5)
        return [frame for _, frame in self.received]

    def take(self, can_id: int | None = None) -> list[bytes]:
        """Return and forget the payloads received with an identifier, or all."""
        taken = [frame.data for _, frame in self.received if can_id is None or frame.can_id == can_id]
        self.received = [item for item in self.received if can_id is not None and item[1].can_id != can_id]
        return taken

    def times(self, can_id: int) -> list[float]:
        """Return the times in ms of the frames received with an identifier."""
        return [time_ns / MS for time_ns, frame in self.received if frame.can_id == can_id]

    def sdo(self, data: bytes | str) -> bytes:
        """Send one SDO request and return the only answer."""
        answers = [frame for frame in self.ask(0x600 + NODE, data) if frame.can_id == 0x580 + NODE]
        assert len(answers) == 1, answers
        return answers[0].data

    def write(self, index: int, sub: int, value: int, size: int) -> int:
        """Write expedited; return 0 or the abort code."""
        head = bytes((0x23 | (4 - size) << 2,)) + index.to_bytes(2, "little") + bytes((sub,))
        answer = self.sdo(head + (value & (1 << 8 * size) - 1).to_bytes(size, "little").ljust(4, b"\0"))
        assert answer[1:4] == head[1:4]
        if answer[0] == 0x80:
            return int.from_bytes(answer[4:], "little")
        assert answer[0] == 0x60
        return 0

    def read(self, index: int, sub: int = 0) -> int:
        """Read expedited; return the unsigned value, or the negated abort code."""
        answer = self.sdo(b"\x40" + index.to_bytes(2, "little") + bytes((sub, 0, 0, 0, 0)))
        assert answer[1:4] == index.to_bytes(2, "little") + bytes((sub,))
        if answer[0] == 0x80:
            return -int.from_bytes(answer[4:], "little")
        return int.from_bytes(answer[4 : 8 - (answer[0] >> 2 & 3)], "little")

    def nmt(self, command: int, node: int = NODE) -> None:
        self.send(0, bytes((command, node)))
        self.run(1)

    def map_pdo(self, number: int, entries: list[int], kind: int, *, transmit: bool, cob_id: int) -> None:
        """Remap a PDO in the order of the standard; `cob_id` is what becomes valid at the end."""
        index = (0x1800 if transmit else 0x1400) + number - 1
        assert self.write(index, 1, 0xC0000000 | cob_id, 4) == 0
        assert self.write(index + 0x200, 0, 0, 1) == 0
        for sub, entry in enumerate(entries, 1):
            assert self.write(index + 0x200, sub, entry, 4) == 0
        assert self.write(index + 0x200, 0, len(entries), 1) == 0
        assert self.write(index, 2, kind, 1) == 0
        assert self.write(index, 1, cob_id, 4) == 0


@pytest.fixture
def bench() -> Bench:
    """A powered slave in Pre-operational; the boot-up frame has passed."""
    bench = Bench()
    bench.slave.power_on()
    bench.run()
    return bench


@pytest.fixture(scope="session")
def kit() -> SimpleNamespace:
    """What tests need to build their own benches."""
    return SimpleNamespace(Bench=Bench, dictionary=dictionary, eds_text=eds_text, NODE=NODE)
