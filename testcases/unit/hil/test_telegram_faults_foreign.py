"""Faults of telegrams where somebody else's controller leads the emulated PROFIdrive drive."""

from __future__ import annotations

import canopen
import pytest

from fieldbus.canopen import PumpedNetwork, virtual_time
from fieldbus.errors import UnsupportedFaultError
from hil.bench import load_bench
from hil.faults import Injector

BENCH = """
[bench]
name = "a drive for anybody"

[segment.can0]

[drive.drive1]
profile = "profidrive"
segment = "can0"
node_id = 5
"""
READY, RUN = 0x047E, 0x047F


class Foreign:
    """A controller made with the `canopen` library: telegram 3 in two PDOs of either direction."""

    def __init__(self, bench, network, clock):
        self.clock, self.network = clock, network
        self.node = node = network.add_node(canopen.RemoteNode(5, canopen.ObjectDictionary()))
        self.sign = 0
        self.seen = []
        for index, base, words in ((0x1400, 0x5800, (4, 1)), (0x1800, 0x5810, (4, 5))):
            at = base
            for number, count in enumerate(words):
                cob = (0x200 if index == 0x1400 else 0x180) + 0x100 * number + 5
                self.put(index + number, 1, cob | 1 << 31, 4)
                self.put(index + number, 2, 1, 1)
                self.put(index + 0x200 + number, 0, 0, 1)
                for sub in range(1, min(count, 4) + 1):
                    self.put(index + 0x200 + number, sub, (at << 16) | 0x10, 4)
                    at += 1
                self.put(index + 0x200 + number, 0, min(count, 4), 1)
                self.put(index + number, 1, cob, 4)
        network.subscribe(0x185, lambda _cob, data, _at: self.seen.append(bytes(data)))
        node.nmt.state = "OPERATIONAL"
        clock.sleep(0.02)

    def put(self, index, sub, value, length):
        self.node.sdo.download(index, sub, value.to_bytes(length, "little"))

    def cycle(self, stw1, *, count=1, speed=0):
        """Make cycles of 4 ms; return the first TPDO of each that has one: ZSW1, NIST_B, ZSW2."""
        self.seen.clear()
        for _ in range(count):
            self.sign = self.sign % 15 + 1
            words = (stw1, speed >> 16 & 0xFFFF, speed & 0xFFFF, self.sign << 12)
            self.network.send_message(0x205, b"".join(word.to_bytes(2, "little") for word in words))
            self.network.send_message(0x305, bytes(2))
            self.network.send_message(0x80, b"")
            self.clock.sleep(0.004)
        return [int.from_bytes(data[:2], "little") for data in self.seen]


def built(folder, text=BENCH):
    file = folder / "bench.toml"
    file.write_text(text)
    return load_bench(str(file)).build(seed=1)


@pytest.fixture
def bench(tmp_path):
    with built(tmp_path) as machine:
        yield machine


@pytest.fixture
def controller(bench):
    with PumpedNetwork(bench.segment()) as network, virtual_time(bench.scheduler) as clock:
        clock.sleep(0.1)
        yield Foreign(bench, network, clock)


@pytest.mark.exhaustive
def test_a_controller_of_others_meets_every_kind_of_it(bench, controller):
    """What the drive sends is lost, late, stale, false; what it is to take is lost or false; and then it is
    right again.
    """
    faults = Injector(bench)
    controller.cycle(READY, count=50)
    assert controller.cycle(RUN, count=100)[-1] & 0x47 == 0x07

    armed = faults.inject("telegram.lost", count=3)
    assert len(controller.cycle(RUN, count=10)) == 7
    assert armed.over

    armed = faults.inject("telegram.late", cycles=2)
    assert len(controller.cycle(RUN, count=10)) == 8
    armed.remove()

    armed = faults.inject("telegram.stuck", signal="ZSW1.3", value=1)
    assert all(zsw1 & 8 for zsw1 in controller.cycle(RUN, count=5))
    armed.remove()
    assert not any(zsw1 & 8 for zsw1 in controller.cycle(RUN, count=5))

    armed = faults.inject("telegram.freeze")
    controller.cycle(RUN, count=5)
    assert len({data[6:8] for data in controller.seen}) == 1
    armed.remove()
    controller.cycle(RUN, count=5)
    assert len({data[6:8] for data in controller.seen}) == 5

    armed = faults.inject("telegram.bits", signal="STW1", direction="setpoint", clear=0x0001)
    assert controller.cycle(RUN, count=200)[-1] & 0x04 == 0
    armed.remove()
    hits = list(bench.history.select(kind="fault.hit"))
    assert hits[0].data["change"] == "nothing"
    assert hits[-1].data["change"] == "PZD1 047F becomes 047E"

    controller.cycle(READY, count=50)
    assert controller.cycle(RUN, count=100)[-1] & 0x47 == 0x07
    faults.inject("telegram.lost", direction="setpoint")
    for _ in range(50):
        zsw1 = controller.cycle(RUN, count=10)[-1]
    assert zsw1 & 0x08  # the drive has noticed that nothing comes any more
    assert (bench.drive().setpoint_seam is None, bench.drive().actual_seam) == (False, None)


def test_what_a_drive_cannot_do_to_its_own_telegrams_is_refused(bench, tmp_path):
    """The length of what it sends is that of PDOs; a CiA 402 drive has no telegram."""
    with pytest.raises(UnsupportedFaultError, match="as long as its PDOs"):
        Injector(bench).inject("telegram.length", words=-1)
    text = BENCH.replace('profile = "profidrive"\n', "")
    with (
        built(tmp_path, text) as other,
        pytest.raises(UnsupportedFaultError, match="drive1 is led by no axis"),
    ):
        Injector(other).inject("telegram.lost")
