"""SYNC of the slave: consumer, counter, monitoring, producer."""

from __future__ import annotations

import itertools

import pytest

from fieldbus.canopen import AbortCode, NmtCommand

EMCY = 0x085


@pytest.mark.requirement("C301-002")
def test_order_within_a_sync(bench):
    """At SYNC the RPDOs take effect, then the device is called, then the TPDOs are sampled."""
    bench.nmt(NmtCommand.START)
    seen = []

    def on_sync(time_ns):
        seen.append((time_ns == bench.scheduler.now, bench.slave.get(0x6040)))
        bench.slave.values[0x606400] = 42

    bench.slave.on_sync.append(on_sync)
    bench.send(0x305, "0F 00 10 27 00 00 09")
    bench.run()
    bench.take()
    bench.send(0x080)
    bench.run()
    assert seen == [(True, 0x0F)]
    assert bench.take(0x285) == [bytes.fromhex("00 00 2A 00 00 00")]


def test_sync_reaches_the_device_in_pre_operational(bench):
    """SYNC is a service of Pre-operational too, and not of Stopped."""
    seen = []
    bench.slave.on_sync.append(seen.append)
    bench.send(0x080)
    bench.run()
    assert len(seen) == 1
    bench.nmt(NmtCommand.STOP)
    bench.send(0x080)
    bench.run()
    assert len(seen) == 1


@pytest.mark.requirement("C301-031")
def test_identifier_of_sync(bench):
    """1005h moves the SYNC that the device listens to; restricted identifiers are refused."""
    seen = []
    bench.slave.on_sync.append(seen.append)
    assert bench.write(0x1005, 0, 0x90, 4) == 0
    bench.send(0x080)
    bench.send(0x090)
    bench.run()
    assert len(seen) == 1
    assert bench.write(0x1005, 0, 0x601, 4) == AbortCode.VALUE


@pytest.mark.requirement("C301-034", "C301-129")
def test_unexpected_length_is_reported_once_and_used(bench):
    """A SYNC with data where none is expected gives one EMCY 8240h, and is used all the same; a good one ends
    it.
    """
    bench.nmt(NmtCommand.START)
    bench.take()
    for data in ("01", "02", "", "03"):
        bench.send(0x080, data)
        bench.run()
    assert len(bench.take(0x285)) == 4
    codes = [data[:2].hex() for data in bench.take(EMCY)]
    assert codes == ["4082", "0000", "4082"]


@pytest.mark.requirement("C301-033")
def test_counter_overflow_object(bench):
    """1019h takes 0 and 2 to 240, and only while 1006h is 0."""
    for value in (1, 241, 255):
        assert bench.write(0x1019, 0, value, 1) == AbortCode.VALUE
    for value in (0, 2, 240):
        assert bench.write(0x1019, 0, value, 1) == 0
    bench.write(0x1006, 0, 1000, 4)
    assert bench.write(0x1019, 0, 4, 1) == AbortCode.DEVICE_STATE


@pytest.mark.requirement("C301-034")
def test_counter_is_expected_with_1019h(bench):
    """With 1019h the SYNC must carry one byte."""
    bench.write(0x1019, 0, 4, 1)
    bench.take()
    bench.send(0x080, "01")
    bench.run()
    assert bench.take(EMCY) == []
    bench.send(0x080)
    bench.run()
    assert bench.take(EMCY)[0][:2].hex() == "4082"


def test_missing_sync_is_reported(bench):
    """In Operational a gap of more than 1.5 periods of 1006h is reported once per gap and counted."""
    lost = []
    bench.slave.sync.on_lost.append(lambda: lost.append(bench.scheduler.now))
    bench.write(0x1006, 0, 4000, 4)
    bench.nmt(NmtCommand.START)
    bench.run(50)
    assert lost == []
    for _ in range(5):
        bench.send(0x080)
        bench.run(4)
    assert lost == []
    last = bench.slave.sync.time_ns
    bench.run(100)
    assert lost == [last + 6_000_000]
    bench.send(0x080)
    bench.run(100)
    assert len(lost) == bench.slave.sync.lost == 2
    bench.send(0x080)
    bench.run(1)
    bench.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
    bench.run(100)
    assert len(lost) == 2


@pytest.mark.requirement("C301-031", "C301-032")
def test_sync_producer(bench):
    """With 1005h bit 30 and a period the device produces SYNC and follows it itself."""
    seen = []
    bench.slave.on_sync.append(seen.append)
    bench.write(0x1006, 0, 10_000, 4)
    bench.nmt(NmtCommand.START)
    assert bench.write(0x1005, 0, 0x40000080, 4) == 0
    bench.received.clear()
    seen.clear()
    bench.run(100)
    times = bench.times(0x080)
    assert len(times) == len(seen) == 10
    assert all(abs(later - earlier - 10) < 0.01 for earlier, later in itertools.pairwise(times))
    assert len(bench.take(0x285)) == 10
    assert bench.write(0x1005, 0, 0x40000081, 4) == AbortCode.DEVICE_STATE
    assert bench.write(0x1005, 0, 0x00000080, 4) == 0
    bench.received.clear()
    bench.run(50)
    assert bench.times(0x080) == []


@pytest.mark.requirement("C301-033")
def test_produced_counter(bench):
    """A producer with 1019h counts from 1 to its value, and from 1 again after Stopped."""
    bench.write(0x1019, 0, 3, 1)
    bench.write(0x1006, 0, 10_000, 4)
    bench.write(0x1005, 0, 0x40000080, 4)
    bench.run(43)
    assert b"".join(bench.take(0x080)) == bytes((1, 2, 3, 1, 2))
    bench.nmt(NmtCommand.STOP)
    bench.take()
    bench.run(50)
    assert bench.take(0x080) == []
    bench.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
    bench.run(25)
    assert bench.take(0x080)[0] == b"\x01"


def test_period_that_would_fill_the_bus(bench):
    """A SYNC period shorter than two frames is refused with 06090032h; 0 is off."""
    assert bench.write(0x1006, 0, 99, 4) == AbortCode.VALUE_LOW
    assert bench.write(0x1006, 0, 100, 4) == 0
    assert bench.write(0x1006, 0, 0, 4) == 0
