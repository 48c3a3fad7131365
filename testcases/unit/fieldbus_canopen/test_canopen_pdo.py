"""Transmission types, events and lengths of the slave's PDOs."""

from __future__ import annotations

import itertools

import pytest

from fieldbus.can import CanFrame
from fieldbus.canopen import AbortCode, NmtCommand, SdoAbort, pdo_engine

EMCY = 0x085
TPDO1 = 0x185
TPDO2 = 0x285
TPDO3 = 0x385


def sync(bench, data: str = "", count: int = 1) -> None:
    bench.run(0.5)  # SYNC would overtake what is queued
    for _ in range(count):
        bench.send(0x080, data)
        bench.run(1)


def codes(bench) -> list[str]:
    return [data[1::-1].hex() for data in bench.take(EMCY)]


# -- RPDO
# -----------------------------------------------------------------------------------------------------


@pytest.mark.requirement("C301-005", "C301-043", "C301-044")
@pytest.mark.parametrize("kind", [254, 255])
def test_event_driven_rpdo_is_effective_at_once(bench, kind):
    """RPDO types 254 and 255 take effect on reception, and the device's callback is called then."""
    seen = []
    bench.slave.on_write(0x6040, 0, lambda value: seen.append((value, bench.slave.get(0x6040))))
    bench.write(0x1400, 2, kind, 1)
    bench.nmt(NmtCommand.START)
    bench.send(0x205, "0F 00")
    bench.run()
    assert bench.slave.get(0x6040) == 0x0F
    assert seen == [(0x0F, 0)]


@pytest.mark.exhaustive
@pytest.mark.requirement("C301-035", "C301-038", "C301-039")
@pytest.mark.parametrize("kind", [0, 1, 240])
def test_synchronous_rpdo_is_effective_with_the_next_sync(bench, kind):
    """A synchronous RPDO waits for the next SYNC; a later one overwrites it; a SYNC without one repeats
    nothing.
    """
    seen = []
    bench.write(0x1401, 2, kind, 1)
    bench.slave.on_write(0x60FF, 0, seen.append)
    bench.nmt(NmtCommand.START)
    bench.send(0x305, "0F 00 01 00 00 00 09")
    bench.send(0x305, "0F 00 02 00 00 00 09")
    bench.run()
    assert bench.slave.get(0x60FF) == 0
    sync(bench)
    assert bench.slave.get(0x60FF) == 2
    sync(bench)
    assert seen == [2]
    assert bench.slave.get(0x6060) == 9


@pytest.mark.requirement("C301-035")
def test_synchronous_window(bench):
    """With 1007h an RPDO that comes after the window is discarded; one within it counts, and one before any
    SYNC.
    """
    bench.write(0x1007, 0, 2000, 4)
    bench.nmt(NmtCommand.START)
    bench.run(10)
    bench.send(0x305, "0F 00 06 00 00 00 09")
    sync(bench)
    assert bench.slave.get(0x60FF) == 6
    bench.send(0x305, "0F 00 07 00 00 00 09")
    sync(bench)
    assert bench.slave.get(0x60FF) == 7
    bench.run(2)
    bench.send(0x305, "0F 00 08 00 00 00 09")
    bench.run()
    sync(bench)
    assert bench.slave.get(0x60FF) == 7


@pytest.mark.requirement("C301-054", "C301-127")
@pytest.mark.parametrize(
    ("can_id", "short", "good"), [(0x205, "0F", "0F 00"), (0x305, "0F 00 01", "0F 00 03 00 00 00 09")]
)
def test_short_rpdo(bench, can_id, short, good):
    """A short RPDO is not processed and gives EMCY 8210h once; a correct one ends it, and the next is new."""
    bench.nmt(NmtCommand.START)
    bench.take()
    for data in (short, short, ""):
        bench.send(can_id, data)
        sync(bench)
    assert bench.slave.get(0x6040) == 0
    assert codes(bench) == ["8210"]
    bench.send(can_id, good)
    sync(bench)
    assert bench.slave.get(0x6040) == 0x0F
    assert codes(bench) == ["0000"]
    bench.send(can_id, short)
    sync(bench)
    assert codes(bench) == ["8210"]


@pytest.mark.requirement("C301-054", "C301-127")
def test_long_rpdo(bench):
    """Of a long RPDO the mapped bytes are taken; EMCY 8220h tells it once."""
    bench.nmt(NmtCommand.START)
    bench.take()
    bench.send(0x205, "1F 00 55 66")
    bench.send(0x205, "0F 00 55 66")
    bench.run()
    assert bench.slave.get(0x6040) == 0x0F
    assert codes(bench) == ["8220"]
    bench.send(0x205, "0F 00")
    bench.run()
    assert codes(bench) == ["0000"]


@pytest.mark.requirement("C301-049", "C301-130")
def test_rpdo_timeout(bench):
    """The deadline of an RPDO runs from its first reception; missing it gives EMCY 8250h and tells the
    device.
    """
    reasons = []
    bench.slave.on_communication_error.append(reasons.append)
    bench.write(0x1400, 5, 20, 2)
    bench.nmt(NmtCommand.START)
    bench.take()
    bench.run(200)
    assert reasons == []
    for _ in range(5):
        bench.send(0x205, "0F 00")
        bench.run(15)
    assert reasons == []
    bench.run(100)
    assert reasons == ["rpdo_timeout"]
    assert codes(bench) == ["8250"]
    bench.send(0x205, "0F 00")
    bench.run(5)
    assert codes(bench) == ["0000"]
    bench.run(100)
    assert reasons == ["rpdo_timeout"] * 2


@pytest.mark.requirement("C301-109")
@pytest.mark.parametrize("remedy", ["no deadline", "invalid", "comes again", "reset"])
def test_end_of_an_rpdo_timeout(bench, remedy):
    """The error of an overdue RPDO ends when it comes, is no longer watched, no longer valid, or with a
    reset.
    """
    bench.write(0x1400, 5, 20, 2)
    bench.nmt(NmtCommand.START)
    bench.send(0x205, "0F 00")
    bench.run(50)
    assert bench.slave.errors.active == {0x8250: 0x11}
    if remedy == "no deadline":
        bench.write(0x1400, 5, 0, 2)
    elif remedy == "invalid":
        bench.write(0x1400, 1, 0x80000205, 4)
    elif remedy == "comes again":
        bench.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
        assert bench.slave.errors.active == {0x8250: 0x11}
        bench.nmt(NmtCommand.START)
        bench.send(0x205, "0F 00")
        bench.run(5)
    else:
        bench.nmt(NmtCommand.RESET_COMMUNICATION)
        bench.write(0x1400, 5, 20, 2)
        bench.nmt(NmtCommand.START)
        bench.send(0x205, "0F 00")
        bench.run(50)
        assert bench.slave.errors.active == {0x8250: 0x11}  # it is watched again
        bench.nmt(NmtCommand.RESET_COMMUNICATION)
    assert bench.slave.errors.active == {}


def test_one_length_error_replaces_the_other(bench):
    """When a short frame is followed by a long one, the first error has ended."""
    bench.nmt(NmtCommand.START)
    bench.send(0x205, "0F")
    bench.send(0x205, "0F 00 55")
    bench.run()
    assert bench.slave.errors.active == {0x8220: 0x11}


def test_length_error_is_new_after_a_reset(bench):
    """After reset communication a wrong length is reported again."""
    for _ in range(2):
        bench.nmt(NmtCommand.START)
        bench.take()
        bench.send(0x205, "0F")
        bench.run()
        assert codes(bench) == ["8210"]
        bench.nmt(NmtCommand.RESET_COMMUNICATION)


def test_length_error_ends_with_the_pdo(bench):
    """An RPDO made invalid takes its length error with it."""
    bench.nmt(NmtCommand.START)
    bench.send(0x205, "0F")
    bench.run()
    assert bench.slave.errors.active == {0x8210: 0x11}
    bench.write(0x1400, 1, 0x80000205, 4)
    assert bench.slave.errors.active == {}


def test_rpdo_deadline_ends_with_operational(bench):
    """Outside Operational no RPDO is overdue."""
    reasons = []
    bench.write(0x1400, 5, 20, 2)
    bench.nmt(NmtCommand.START)
    bench.send(0x205, "0F 00")
    bench.run(5)
    bench.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
    bench.slave.on_communication_error.append(reasons.append)
    bench.run(100)
    assert reasons == []


@pytest.mark.requirement("C301-076")
def test_limits_hold_for_pdos(bench):
    """A value outside the limits of the EDS is not taken from a PDO either; the other objects of the PDO
    are.
    """
    bench.map_pdo(3, [0x20000010, 0x60400010], 255, transmit=False, cob_id=0x405)
    bench.nmt(NmtCommand.START)
    bench.send(0x405, "09 00 0F 00")
    bench.run()
    assert (bench.slave.get(0x2000), bench.slave.get(0x6040)) == (3, 0x0F)
    bench.send(0x405, "05 00 1F 00")
    bench.run()
    assert (bench.slave.get(0x2000), bench.slave.get(0x6040)) == (5, 0x1F)


def test_device_refuses_a_value_from_a_pdo(bench):
    """A callback that refuses a PDO's value leaves the object as it was and the others untouched by that."""

    def refuse(value):
        if value == 5:
            raise SdoAbort(AbortCode.VALUE)

    bench.slave.on_write(0x6060, 0, refuse)
    bench.nmt(NmtCommand.START)
    bench.send(0x305, "0F 00 64 00 00 00 05")
    sync(bench)
    assert (bench.slave.get(0x60FF), bench.slave.get(0x6060)) == (100, 0)


def test_two_rpdos_on_one_identifier(bench):
    """Two RPDOs with the same identifier both take the frame."""
    bench.map_pdo(3, [0x60600008, 0x00050008], 255, transmit=False, cob_id=0x205)
    bench.nmt(NmtCommand.START)
    bench.send(0x205, "08 00")
    bench.run()
    assert (bench.slave.get(0x6040), bench.slave.get(0x6060)) == (8, 8)


def test_rpdo_with_a_29_bit_identifier(bench):
    """Bit 29 of the COB-ID makes it a 29-bit identifier, which no 11-bit frame of the same number reaches."""
    bench.map_pdo(3, [0x60400010], 255, transmit=False, cob_id=0x20000405)
    bench.nmt(NmtCommand.START)
    bench.send(0x405, "0F 00")
    bench.run()
    assert bench.slave.get(0x6040) == 0
    bench.send(0x405, "0F 00", extended=True)
    bench.run()
    assert bench.slave.get(0x6040) == 0x0F


# -- TPDO
# -----------------------------------------------------------------------------------------------------


@pytest.mark.requirement("C301-039")
@pytest.mark.parametrize(("kind", "expected"), [(1, 12), (2, 6), (3, 4), (240, 0)])
def test_every_nth_sync(bench, kind, expected):
    """Types 1 to 240 send with every n-th SYNC."""
    bench.write(0x1801, 2, kind, 1)
    bench.nmt(NmtCommand.START)
    sync(bench, count=12)
    assert len(bench.take(TPDO2)) == expected


@pytest.mark.requirement("C301-038")
def test_synchronous_acyclic(bench):
    """Type 0 sends with the SYNC after a change, once, with the value at the SYNC."""
    bench.write(0x1801, 2, 0, 1)
    bench.nmt(NmtCommand.START)
    sync(bench, count=3)
    assert bench.take(TPDO2) == []
    bench.slave.set(0x6064, 0, 1)
    bench.run()
    bench.slave.set(0x6064, 0, 2)
    bench.run()
    assert bench.take(TPDO2) == []
    sync(bench, count=3)
    assert bench.take(TPDO2) == [bytes.fromhex("00 00 02 00 00 00")]


@pytest.mark.requirement("C301-036")
@pytest.mark.parametrize("kind", [1, 0])
@pytest.mark.parametrize(("window_us", "sent"), [(0, True), (250, False), (1500, True)])
def test_synchronous_tpdo_behind_the_window_is_not_sent(bench, kind, window_us, sent):
    """A TPDO that the bus has not taken when the window of 1007h ends is not sent in that cycle; what is
    event-driven waits on.
    """
    bench.map_pdo(3, [0x606C0020], kind, transmit=True, cob_id=0x40000385)
    bench.map_pdo(1, [0x60410010], 255, transmit=True, cob_id=0x40000185)
    bench.write(0x1007, 0, window_us, 4)
    busy = bench.segment.attach("busy", lambda _frame, _time_ns: None)
    bench.nmt(NmtCommand.START)
    bench.run()
    bench.take()
    for cycle in range(2):
        bench.slave.set(0x606C, 0, 7 + cycle)
        bench.send(0x80)
        if not cycle:
            busy.send_all([CanFrame(0x081, bytes(8)) for _ in range(8)])
        bench.slave.set(0x6041, 0, 100 + cycle)
        bench.run(4)
        late = [bytes([7 + cycle, 0, 0, 0])] if sent or cycle else []
        assert bench.take(TPDO3) == late
        assert bench.take(0x185) == [bytes([100 + cycle, 0])]


@pytest.mark.requirement("C301-036", "C301-056", "C402-174")
def test_synchronous_sampling_is_one_instant(bench):
    """All objects of all synchronous TPDOs are sampled at the SYNC, not when their frame gets the bus."""
    bench.map_pdo(3, [0x606C0020], 1, transmit=True, cob_id=0x40000385)
    bench.nmt(NmtCommand.START)
    tick = bench.scheduler.every(1000, lambda: bench.slave.values.__setitem__(0x606400, bench.scheduler.now))
    bench.slave.on_read(0x606C, 0, lambda: bench.slave.values[0x606400])
    bench.run()
    bench.take()
    sync(bench)
    tick.cancel()
    (second,), (third,) = bench.take(TPDO2), bench.take(TPDO3)
    assert second[2:] == third


@pytest.mark.requirement("C301-044", "C301-056")
@pytest.mark.parametrize("kind", [254, 255])
def test_event_driven_tpdo_follows_changes(bench, kind):
    """A change of a mapped object sends the TPDO; setting the same value again does not."""
    bench.write(0x1800, 2, kind, 1)
    bench.nmt(NmtCommand.START)
    bench.take()
    for value in (1, 1, 2):
        bench.slave.set(0x6041, 0, value)
        bench.run()
    bench.slave.set(0x6064, 0, 99)
    bench.run()
    assert bench.take() == [b"\x01\0", b"\x02\0"]


def test_changes_of_one_instant_make_one_tpdo(bench):
    """Several changes within one instant send one frame, with all of them; a change taken back sends none."""
    bench.map_pdo(3, [0x603F0010, 0x60610008], 255, transmit=True, cob_id=0x40000385)
    bench.nmt(NmtCommand.START)
    bench.run()
    bench.take()
    bench.slave.set(0x603F, 0, 0x8611)
    bench.slave.set(0x6061, 0, 8)
    bench.run()
    assert bench.take() == [bytes.fromhex("11 86 08")]
    bench.slave.set(0x6061, 0, 9)
    bench.slave.set(0x6061, 0, 8)
    bench.run()
    assert bench.take() == []


def test_direct_writes_need_a_word(bench):
    """After a direct write to `values` the TPDO is sent on `notify_change` or `trigger_tpdos`, if it
    changed.
    """
    bench.nmt(NmtCommand.START)
    bench.take()
    bench.slave.values[0x604100] = 1
    bench.run()
    assert bench.take() == []
    bench.slave.notify_change(0x6041)
    bench.run()
    assert bench.take() == [b"\x01\0"]
    bench.slave.values[0x604100] = 2
    bench.slave.trigger_tpdos()
    bench.run()
    bench.slave.trigger_tpdos()
    bench.run()
    assert bench.take() == [b"\x02\0"]
    bench.slave.trigger_tpdo(1)
    bench.run()
    assert bench.take() == [b"\x02\0"]


def test_values_written_by_the_bus_are_changes_too(bench):
    """An SDO or RPDO write to an object that an event-driven TPDO maps sends that TPDO."""
    bench.map_pdo(3, [0x60400010], 255, transmit=True, cob_id=0x40000385)
    bench.nmt(NmtCommand.START)
    bench.run()
    bench.take()
    bench.write(0x6040, 0, 6, 2)
    bench.send(0x205, "07 00")
    bench.send(0x205, "07 00")
    bench.run()
    assert bench.take(TPDO3) == [b"\x06\0", b"\x07\0"]


@pytest.mark.requirement("C301-047")
def test_inhibit_time(bench):
    """Transmissions keep the inhibit time; changes within it are sent once, with the last value, at its
    end.
    """
    bench.write(0x1800, 1, 0xC0000185, 4)
    bench.write(0x1800, 3, 100, 2)
    bench.write(0x1800, 1, 0x40000185, 4)
    bench.nmt(NmtCommand.START)
    bench.run(50)
    bench.received.clear()
    for value in range(1, 31):
        bench.slave.set(0x6041, 0, value)
        bench.run(1)
    bench.run(20)
    times = bench.times(TPDO1)
    assert all(9.99 < later - earlier < 10.2 for earlier, later in itertools.pairwise(times))
    assert [data[0] for data in bench.take(TPDO1)] == [1, 10, 20, 30]


@pytest.mark.requirement("C301-047")
def test_inhibit_time_does_not_hold_synchronous_tpdos(bench):
    """Synchronous TPDOs go with their SYNC whatever the inhibit time."""
    bench.write(0x1801, 1, 0xC0000285, 4)
    bench.write(0x1801, 3, 1000, 2)
    bench.write(0x1801, 1, 0x40000285, 4)
    bench.nmt(NmtCommand.START)
    sync(bench, count=5)
    assert len(bench.take(TPDO2)) == 5


@pytest.mark.requirement("C301-048")
def test_event_timer(bench):
    """The event timer sends after n ms without another transmission; each transmission restarts it; 0 is
    off.
    """
    bench.write(0x1800, 5, 20, 2)
    bench.nmt(NmtCommand.START)
    bench.received.clear()
    bench.run(10)
    bench.slave.set(0x6041, 0, 1)
    bench.run(55)
    times = bench.times(TPDO1)
    assert len(times) == 3
    assert [round(later - earlier) for earlier, later in itertools.pairwise(times)] == [20, 20]
    bench.write(0x1800, 5, 0, 2)
    bench.received.clear()
    bench.run(100)
    assert bench.times(TPDO1) == []


def test_event_timer_may_change_in_operational(bench):
    """A new event timer counts from the moment of writing and sends nothing by itself."""
    bench.nmt(NmtCommand.START)
    bench.run(5)
    bench.take()
    bench.write(0x1800, 5, 50, 2)
    assert bench.take(TPDO1) == []
    bench.run(100)
    assert len(bench.take(TPDO1)) == 2


@pytest.mark.requirement("C301-050")
def test_sync_start_value(bench):
    """With a start value the PDO begins at the SYNC with that counter and goes on every n-th from there."""
    bench.write(0x1019, 0, 10, 1)
    bench.write(0x1801, 1, 0xC0000285, 4)
    bench.write(0x1801, 2, 2, 1)
    bench.write(0x1801, 6, 4, 1)
    bench.write(0x1801, 1, 0x40000285, 4)
    bench.nmt(NmtCommand.START)
    sent = []
    for turn in range(20):
        bench.take()
        counter = turn % 10 + 1
        sync(bench, f"{counter:02X}")
        if bench.take(TPDO2):
            sent.append(turn + 1)
    assert sent == [4, 6, 8, 10, 12, 14, 16, 18, 20]


@pytest.mark.requirement("C301-041", "C301-042", "C301-055")
def test_remote_requests(bench):
    """Type 253 samples on request, type 252 gives what the last SYNC sampled; neither is sent by SYNC or
    change.
    """
    for kind, expected in ((253, 7), (252, 5)):
        bench.map_pdo(3, [0x60640020], kind, transmit=True, cob_id=TPDO3)
        bench.nmt(NmtCommand.START)
        bench.slave.set(0x6064, 0, 5)
        sync(bench)
        bench.slave.set(0x6064, 0, 7)
        bench.run()
        assert bench.take(TPDO3) == []
        assert [frame.data[0] for frame in bench.ask(TPDO3, remote=True)] == [expected]
        bench.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)


@pytest.mark.requirement("C301-041")
def test_remote_request_before_the_first_sync(bench):
    """Type 252 has nothing to give before the first SYNC."""
    bench.map_pdo(3, [0x60640020], 252, transmit=True, cob_id=TPDO3)
    bench.nmt(NmtCommand.START)
    assert bench.ask(TPDO3, remote=True) == []


@pytest.mark.exhaustive
@pytest.mark.requirement("C301-046", "C301-055")
def test_remote_requests_are_answered_only_where_allowed(bench):
    """With COB-ID bit 30 set a request is not answered; with it clear event-driven TPDOs answer."""
    bench.nmt(NmtCommand.START)
    assert bench.ask(TPDO1, remote=True) == []
    bench.write(0x1800, 1, 0x80000185, 4)
    bench.write(0x1800, 1, 0x00000185, 4)
    assert [frame.data for frame in bench.ask(TPDO1, remote=True)] == [b"\0\0"]
    bench.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
    assert bench.ask(TPDO1, remote=True) == []


def test_remote_request_of_a_synchronous_tpdo(bench):
    """A synchronous TPDO answers a request with what it sampled at the last SYNC."""
    bench.map_pdo(3, [0x60640020], 1, transmit=True, cob_id=TPDO3)
    bench.nmt(NmtCommand.START)
    bench.slave.set(0x6064, 0, 5)
    assert [frame.data[0] for frame in bench.ask(TPDO3, remote=True)] == [5]
    sync(bench)
    bench.slave.set(0x6064, 0, 7)
    assert [frame.data[0] for frame in bench.ask(TPDO3, remote=True)] == [5]


def test_tpdo_with_a_29_bit_identifier(bench):
    """A TPDO with bit 29 goes out as an extended frame, also with every SYNC."""
    bench.map_pdo(3, [0x60640020], 1, transmit=True, cob_id=0x60012345)
    bench.nmt(NmtCommand.START)
    bench.received.clear()
    sync(bench, count=2)
    assert [frame.extended for _, frame in bench.received if frame.can_id == 0x12345] == [True, True]


def test_read_callback_is_asked_when_a_tpdo_samples(bench):
    """A TPDO takes the value of a read callback; a callback registered later counts at once."""
    bench.nmt(NmtCommand.START)
    bench.slave.on_read(0x6064, 0, lambda: 0x01020304)
    sync(bench)
    assert bench.take(TPDO2)[-1] == bytes.fromhex("00 00 04 03 02 01")


@pytest.mark.requirement("C301-056")
def test_callbacks_count_whenever_they_are_registered(bench):
    """A callback that comes before the boot, in Pre-operational or in Operational is asked from then on."""
    asked = []
    bench.slave.on_read(0x6041, 0, lambda: 0x1234)
    bench.nmt(NmtCommand.START)
    assert bench.take(TPDO1) == [b"\x34\x12"]
    bench.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
    bench.slave.on_read(0x6041, 0, lambda: 0x5678)
    bench.slave.on_write(0x6040, 0, lambda value: asked.append(("early", value)))
    bench.received.clear()
    bench.nmt(NmtCommand.START)
    assert bench.take(TPDO1) == [b"\x78\x56"]
    bench.slave.on_write(0x6040, 0, lambda value: asked.append(("late", value)))
    bench.send(0x205, "0F 00")
    bench.run()
    assert asked == [("early", 0x0F), ("late", 0x0F)]


def test_pdos_are_built_once_for_all_callbacks(bench, monkeypatch):
    """However many callbacks a device registers before it is Operational, its PDOs are built once for
    them.
    """
    built = []
    original = pdo_engine.sampler
    monkeypatch.setattr(pdo_engine, "sampler", lambda *args: built.append(args) or original(*args))
    for _ in range(50):
        bench.slave.on_read(0x6041, 0, lambda: 1)
    bench.nmt(NmtCommand.START)
    assert len(built) == len(bench.slave.pdos.transmit)


def test_values_outside_the_type_do_not_stop_the_cycle(bench):
    """A TPDO holds device values at the end of their type and rounds fractions."""
    bench.nmt(NmtCommand.START)
    bench.take()
    bench.slave.values[0x606400] = 1 << 40
    sync(bench)
    bench.slave.values[0x606400] = -1.6
    sync(bench)
    assert [data[2:].hex() for data in bench.take(TPDO2)] == ["ffffff7f", "feffffff"]
