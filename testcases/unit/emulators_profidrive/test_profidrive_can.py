"""The telegram on CAN: words on PDOs, latched by SYNC; SDO, EMCY, loss of the bus; from the frames alone."""

from __future__ import annotations

from struct import pack, unpack

import pytest

from emulators.drive.profidrive import (
    EDS,
    EDS_PATH,
    ProfidriveCanDrive,
    ProfidriveConfig,
    ProfidriveNodeConfig,
)
from emulators.drive.profidrive.faults import catalogue as numbers
from fieldbus.can import CanFrame, CanMedium
from fieldbus.canopen.nmt import NmtCommand, NmtState
from fieldbus.clock import MS, VirtualScheduler
from fieldbus.errors import ConfigurationError
from fieldbus.history import History
from fieldbus.profidrive import ZSW1, to_n2, to_n4

NODE = 9
WORDS = {"setpoint": 10, "actual": 10}  # telegram 105


class Station:
    """A drive on a segment with telegram 105 on three PDOs in each direction, and a controller made of
    frames.
    """

    def __init__(self):
        self.scheduler = VirtualScheduler()
        self.history = History(self.scheduler)
        self.segment = CanMedium(self.scheduler, name="can0")
        config = ProfidriveNodeConfig(node_id=NODE, drive=ProfidriveConfig.reference(telegram=105))
        self.drive = ProfidriveCanDrive(
            self.scheduler, self.segment, config, name="drive", history=self.history
        )
        self.received: dict[int, list[bytes]] = {}
        self.port = self.segment.attach("controller", self._take)
        self.drive.power_on()
        self.scheduler.run_for(MS)
        self._map()
        self.sign = 0
        self.send(0, bytes((NmtCommand.START, NODE)))

    def _take(self, frame, _time_ns):
        self.received.setdefault(frame.can_id, []).append(frame.data)

    def _map(self):
        values = self.drive.slave.store.write
        for number in range(3):
            for communication, mapping, base, first, words in (
                (0x1400, 0x1600, 0x200, 0x5800, WORDS["setpoint"]),
                (0x1800, 0x1A00, 0x180, 0x5810, WORDS["actual"]),
            ):
                cob_id = base + 0x100 * number + NODE
                chosen = range(4 * number, min(words, 4 * number + 4))
                values(communication + number, 1, pack("<I", cob_id | 1 << 31))
                values(mapping + number, 0, b"\0")
                for sub, word in enumerate(chosen, 1):
                    values(mapping + number, sub, pack("<I", first + word << 16 | 0x10))
                values(mapping + number, 0, bytes((len(chosen),)))
                values(communication + number, 2, b"\1")
                values(communication + number, 1, pack("<I", cob_id))

    def send(self, can_id, data):
        self.port.send(CanFrame(can_id, data))
        self.scheduler.run_for(MS // 4)

    def cycle(self, stw1, *, count=1, without=(), **signals):
        """Send the telegram and SYNC; returns the answer as signals."""
        layout = self.drive.drive.telegram
        for _ in range(count):
            self.sign = self.sign % 15 + 1
            frame = layout.setpoint.encode({"STW1": stw1, "STW2": self.sign << 12, **signals})
            words = unpack(">10H", frame)
            for number in range(3):
                part = words[4 * number : 4 * number + 4]
                if number not in without:
                    self.send(0x200 + 0x100 * number + NODE, pack(f"<{len(part)}H", *part))
            self.send(0x80, b"")
            self.scheduler.run_for(4 * MS - self.scheduler.now % (4 * MS))
        data = b"".join(self.received[0x180 + 0x100 * number + NODE][-1] for number in range(3))
        return layout.actual.decode(pack(">10H", *unpack("<10H", data)))


@pytest.fixture
def station():
    return Station()


@pytest.mark.requirement("PD-338", "PD-340", "PD-341")
def test_the_telegram_stands_in_words_on_pdos(station):
    """Ten words in three PDOs enable the axis and set its speed; the answer comes in three PDOs of the same
    SYNC.
    """
    station.cycle(0x047E, count=40)
    answer = station.cycle(0x047F, count=100, NSOLL_B=to_n4(0.2))

    assert answer["ZSW1"] & 0x47 == 7
    assert answer["NIST_B"] == pytest.approx(to_n4(0.2), rel=1e-3)
    assert [len(station.received[0x180 + 0x100 * n + NODE][-1]) for n in range(3)] == [8, 8, 4]


@pytest.mark.requirement("PD-030", "PD-127")
def test_a_telegram_with_a_missing_pdo_is_not_taken_over(station):
    """One PDO missing makes the whole telegram missing: old setpoints stay, and the sign of life counts a
    failure.
    """
    station.cycle(0x047E, count=40)
    station.cycle(0x047F, count=50, NSOLL_B=to_n4(0.2))
    for number in range(3):
        station.cycle(0x047F, without=(number,), NSOLL_B=to_n4(-0.5))
        assert station.drive.drive.sign_of_life.counter == 10
        assert station.drive.core.speed_rpm == pytest.approx(600.0, abs=1.0)
        station.cycle(0x047F, count=12, NSOLL_B=to_n4(0.2))
    station.cycle(0x047F, count=2, without=(1,), NSOLL_B=to_n4(0.2))
    assert station.drive.drive.faults.number == numbers.SIGN_OF_LIFE


def test_a_fault_sends_an_emcy_with_its_number_and_its_end(station):
    """The EMCY has the code of the catalogue and the fault number in its data; acknowledging ends it with
    0000h.
    """
    station.cycle(0x047E, count=40)
    station.drive.raise_fault(numbers.OVERVOLTAGE)
    station.cycle(0x047E)
    assert unpack("<HBH", station.received[0x80 + NODE][-1][:5]) == (0x3210, 0x05, numbers.OVERVOLTAGE)
    assert station.drive.slave.get(0x2853) == numbers.OVERVOLTAGE
    assert not station.cycle(0x04FE)["ZSW1"] & ZSW1.FAULT
    assert station.received[0x80 + NODE][-1][:3] == b"\0\0\0"
    assert station.drive.slave.get(0x2853) == 0


@pytest.mark.exhaustive
@pytest.mark.requirement("PD-345")
@pytest.mark.parametrize(
    ("option", "number", "enabled"), [(0, 0, True), (1, 8700, False), (2, 8700, False), (3, 8700, True)]
)
def test_leaving_operational_acts_as_6007h_says(station, option, number, enabled):
    """NMT stop in operation: nothing, fault and pulses off, pulses off, or quick stop."""
    station.cycle(0x047E, count=40)
    station.cycle(0x047F, count=60, NSOLL_B=to_n4(0.2))
    station.drive.slave.store.write(0x6007, 0, pack("<h", option))
    station.send(0, bytes((NmtCommand.ENTER_PRE_OPERATIONAL, NODE)))
    sent = [int.from_bytes(data[:2], "little") for data in station.received.get(0x80 + NODE, [])]
    assert sent == ([0x8100] if option else [])
    assert station.drive.drive.faults.number == number
    assert station.drive.core.enabled is enabled


def test_reset_node_is_a_restart(station):
    """NMT reset node takes the pulses, forgets faults, and the axis waits for control again."""
    station.cycle(0x047E, count=40)
    station.cycle(0x047F, count=5)
    station.drive.raise_fault(numbers.EXTERNAL)
    station.send(0, bytes((NmtCommand.RESET_NODE, NODE)))
    assert not station.drive.core.enabled
    assert not station.drive.drive.faults.present
    assert not station.drive.drive.controlled_cyclically
    assert station.drive.slave.nmt_state is NmtState.PRE_OPERATIONAL


def test_hostile_frames_are_survived(station):
    """PDOs of wrong lengths never stop the node; when the clock is back, what it missed is acknowledged and
    work goes on.
    """
    station.cycle(0x047E, count=40)
    for can_id in (0x200 + NODE, 0x300 + NODE, 0x400 + NODE):
        for length in range(9):
            station.send(can_id, bytes(range(length)))
    assert station.cycle(0x047E, count=40)["ZSW1"] & ZSW1.FAULT
    assert station.drive.drive.faults.number == numbers.CLOCK_FAILURE
    station.cycle(0x04FE)
    station.cycle(0x047E, count=2)
    assert station.cycle(0x047F, count=3)["ZSW1"] & 0x4F == 7


def test_the_eds_agrees_with_the_object_table():
    """The file that ships is that of the table."""
    assert EDS_PATH.read_text(encoding="ascii") == EDS.text()


def test_a_telegram_that_is_too_long_for_the_objects_is_refused():
    """More than 16 words have no objects."""
    config = ProfidriveConfig(
        telegram=999, free_setpoint=("STW1", "STW2"), free_actual=("ZSW1", *["FREE"] * 16)
    )
    with pytest.raises(ConfigurationError, match="16 words"):
        ProfidriveCanDrive(
            VirtualScheduler(),
            CanMedium(VirtualScheduler(), name="c"),
            ProfidriveNodeConfig(drive=config),
            name="d",
        )


@pytest.mark.requirement("PD-339")
def test_the_predefined_connection_set():
    """Without any mapping: RPDO1 control word, RPDO2 with the speed too, TPDO1 status word, TPDO2 with the
    speed.
    """
    scheduler = VirtualScheduler()
    segment = CanMedium(scheduler, name="can0")
    config = ProfidriveNodeConfig(node_id=NODE, drive=ProfidriveConfig.reference(telegram=1))
    drive = ProfidriveCanDrive(scheduler, segment, config, name="drive")
    heard: dict[int, bytes] = {}
    port = segment.attach("controller", lambda frame, _time: heard.update({frame.can_id: frame.data}))
    drive.power_on()
    scheduler.run_for(10 * MS)
    port.send(CanFrame(0, bytes((NmtCommand.START, NODE))))
    for word, cycles in ((0x047E, 20), (0x047F, 100)):
        for _ in range(cycles):
            port.send(CanFrame(0x200 + NODE, pack("<H", word)))
            port.send(CanFrame(0x300 + NODE, pack("<Hh", word, to_n2(0.2))))
            scheduler.run_for(4 * MS)
    status, speed = unpack("<Hh", heard[0x280 + NODE])
    assert unpack("<H", heard[0x180 + NODE]) == (status,)
    assert status & 0x47 == 7
    assert speed == pytest.approx(to_n2(0.2), rel=1e-2)
    assert drive.core.speed_rpm == pytest.approx(600.0, rel=1e-2)
    for number in range(3, 9):  # the others are not valid
        for index in (0x1400, 0x1800):
            assert int.from_bytes(drive.slave.store.read(index + number - 1, 1), "little") & 1 << 31
