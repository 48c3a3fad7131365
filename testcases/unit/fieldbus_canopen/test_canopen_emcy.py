"""EMCY, error register and error history of the slave."""

from __future__ import annotations

import itertools

import pytest

from fieldbus.canopen import AbortCode, NmtCommand
from fieldbus.canopen.emcy import QUEUE_LIMIT, register_bits

EMCY = 0x085


def frames(bench, milliseconds: float = 5) -> list[str]:
    bench.run(milliseconds)
    return [data.hex(" ").upper() for data in bench.take(EMCY)]


@pytest.mark.requirement("C301-003", "C301-108", "C301-112")
def test_frame_of_an_error(bench):
    """An EMCY carries code, error register and five manufacturer bytes; 1001h reads the same."""
    assert bench.slave.emcy(0x8611, 0x20, b"\x02\x03")
    assert frames(bench) == ["11 86 21 02 03 00 00 00"]
    assert bench.read(0x1001) == 0x21


@pytest.mark.requirement("C301-109")
def test_an_error_is_sent_once_until_it_has_gone(bench):
    """A present error is not sent again unless asked for; after its end it is new."""
    assert bench.slave.emcy(0x8611)
    assert not bench.slave.emcy(0x8611)
    assert len(frames(bench)) == 1
    assert bench.slave.emcy(0x8611, repeat=True)
    assert len(frames(bench)) == 1
    assert bench.slave.emcy_clear(0x8611)
    assert not bench.slave.emcy_clear(0x8611)
    assert bench.slave.emcy(0x8611)
    assert frames(bench) == ["00 00 00 00 00 00 00 00", "11 86 21 00 00 00 00 00"]


@pytest.mark.requirement("C301-109", "C301-114")
def test_end_of_one_of_two_errors_shows_what_remains(bench):
    """When one error ends, 0000h carries the remaining register; when the last ends, 00h."""
    bench.slave.emcy(0x2310)
    bench.slave.emcy(0x4310)
    bench.slave.emcy_clear(0x2310)
    bench.slave.emcy_clear(0x4310)
    assert frames(bench) == [
        "10 23 03 00 00 00 00 00",
        "10 43 0B 00 00 00 00 00",
        "00 00 09 00 00 00 00 00",
        "00 00 00 00 00 00 00 00",
    ]


def test_clearing_all(bench):
    """Without a code all errors end, with one frame; when there is none, nothing is sent."""
    bench.slave.emcy(0x2310)
    bench.slave.emcy(0x4310)
    assert bench.slave.emcy_clear()
    assert not bench.slave.emcy_clear()
    assert frames(bench)[2:] == ["00 00 00 00 00 00 00 00"]


@pytest.mark.requirement("C301-112", "C402-308")
@pytest.mark.parametrize(
    ("code", "bits"),
    [
        (0x1000, 0x01), (0x2310, 0x03), (0x3220, 0x05), (0x4310, 0x09), (0x5510, 0x01), (0x6010, 0x01),
        (0x7121, 0x21), (0x8130, 0x11), (0x8250, 0x11), (0x8311, 0x21), (0x8611, 0x21), (0x8A00, 0x21),
        (0x9000, 0x01), (0xF001, 0x01), (0xFF80, 0x81), (0x0000, 0x00),
    ],
)  # fmt: skip
def test_register_bits_by_code(code, bits):
    """Each group of codes sets its bit of 1001h and always bit 0."""
    assert register_bits(code) == bits


@pytest.mark.requirement("C301-112")
def test_reserved_bit_of_the_register(bench):
    """Bit 6 of 1001h stays 0 and bit 0 is always set, whatever the device asks for."""
    bench.slave.emcy(0xFF00, 0xFE)
    assert bench.read(0x1001) == 0xBF


@pytest.mark.requirement("C301-108")
def test_stopped_holds_emcys_back(bench):
    """In Stopped nothing is sent; what has happened is sent on leaving it."""
    bench.nmt(NmtCommand.STOP)
    bench.slave.emcy(0x8611)
    assert frames(bench) == []
    bench.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
    assert frames(bench) == ["11 86 21 00 00 00 00 00"]


@pytest.mark.requirement("C301-110", "C301-143")
def test_inhibit_time_queues(bench):
    """1015h in 100 us keeps EMCYs apart; none is lost and the order is kept."""
    bench.write(0x1015, 0, 100, 2)
    for code in range(0xFF01, 0xFF09):
        bench.slave.emcy(code)
    bench.received.clear()
    bench.run(100)
    times = bench.times(EMCY)
    assert all(later - earlier > 9.9 for earlier, later in itertools.pairwise(times))
    assert [data[0] for data in bench.take(EMCY)] == list(range(1, 9))


@pytest.mark.requirement("C301-110")
def test_emcy_switched_off(bench):
    """With bit 31 of 1014h nothing is sent, neither then nor later; register and history go on."""
    assert bench.write(0x1014, 0, 0x80000085, 4) == 0
    bench.slave.emcy(0x8611)
    assert frames(bench) == []
    assert bench.read(0x1001) == 0x21
    assert bench.read(0x1003, 1) == 0x8611
    bench.write(0x1014, 0, 0x85, 4)
    assert frames(bench) == []


@pytest.mark.requirement("C301-012", "C301-143")
def test_identifier_of_the_emcy(bench):
    """1014h moves the EMCY; a valid identifier changes only by way of invalid, and restricted ones are
    refused.
    """
    assert bench.write(0x1014, 0, 0xA5, 4) == AbortCode.DEVICE_STATE
    assert bench.write(0x1014, 0, 0x800000A5, 4) == 0
    assert bench.write(0x1014, 0, 0x585, 4) == AbortCode.VALUE
    assert bench.write(0x1014, 0, 0xA5, 4) == 0
    bench.take()
    bench.slave.emcy(0x8611)
    bench.run()
    assert [frame.can_id for _, frame in bench.received] == [0xA5]


def test_queue_has_an_end(bench):
    """A flood beyond the queue is counted as lost and does not eat memory."""
    bench.nmt(NmtCommand.STOP)
    for code in range(0xFF00, 0xFF00 + QUEUE_LIMIT + 10):
        bench.slave.emcy(code)
    bench.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
    assert len(frames(bench, 50)) == QUEUE_LIMIT
    assert bench.slave.errors.lost == 10


@pytest.mark.requirement("C301-111", "C301-135")
def test_history_1003h(bench):
    """1003h holds the newest error first, drops the oldest, and counts its entries in sub-index 0."""
    assert bench.read(0x1003, 0) == 0
    for number in range(1, 6):
        bench.slave.emcy(0x2310 + number, None, bytes((number, 0x10)))
    assert bench.read(0x1003, 0) == 4
    assert [bench.read(0x1003, sub) for sub in range(1, 5)] == [
        0x10052315,
        0x10042314,
        0x10032313,
        0x10022312,
    ]


@pytest.mark.requirement("C301-107", "C301-111")
def test_empty_history_entry(bench):
    """Reading an entry of 1003h that is not filled gives 08000024h."""
    bench.slave.emcy(0x8611)
    assert -bench.read(0x1003, 2) == AbortCode.NO_DATA


@pytest.mark.requirement("C301-111")
def test_history_is_cleared_by_writing_zero(bench):
    """Writing 0 to 1003h:0 empties the history and leaves the error register; any other value is refused."""
    bench.slave.emcy(0x8611)
    assert bench.write(0x1003, 0, 1, 1) == AbortCode.VALUE
    assert bench.read(0x1003, 0) == 1
    assert bench.write(0x1003, 0, 0, 1) == 0
    assert bench.read(0x1003, 0) == 0
    assert -bench.read(0x1003, 1) == AbortCode.NO_DATA
    assert bench.read(0x1001) == 0x21


def test_reset_communication_keeps_device_errors(bench):
    """Reset communication ends communication errors; an error of the device stays in the register."""
    bench.slave.emcy(0x8611)
    bench.slave.emcy(0x8130)
    bench.nmt(NmtCommand.RESET_COMMUNICATION)
    assert bench.slave.errors.active == {0x8611: 0x21}
    assert bench.read(0x1001) == 0x21
    assert bench.read(0x1003, 0) == 0
    bench.nmt(NmtCommand.RESET_NODE)
    assert bench.read(0x1001) == 0


def test_error_register_in_an_event_driven_tpdo(bench):
    """A TPDO that maps code and register is sent once, with both, when an error comes."""
    bench.map_pdo(3, [0x603F0010, 0x10010008], 255, transmit=True, cob_id=0x40000385)
    bench.nmt(NmtCommand.START)
    bench.run(5)
    bench.take()
    bench.slave.set(0x603F, 0, 0x8611)
    bench.slave.emcy(0x8611)
    bench.run(5)
    assert bench.take(0x385) == [bytes.fromhex("11 86 21")]


def test_history_events(bench):
    """Errors and their ends are events of the bench's log."""
    bench.slave.emcy(0x8611)
    bench.slave.emcy_clear(0x8611)
    kinds = [(event.kind, event.data["code"]) for event in bench.history.select(kind="emcy.")]
    assert kinds == [("emcy.raised", 0x8611), ("emcy.cleared", 0x8611)]
