"""TIME of the slave: consumer, producer, and the rules of 1012h."""

from __future__ import annotations

from struct import pack, unpack

import pytest

from fieldbus.canopen import AbortCode, NmtCommand, PumpedNetwork
from fieldbus.errors import ConfigurationError

DAY_MS = 86_400_000


@pytest.mark.requirement("C301-004", "C301-142")
def test_consumer_sets_the_clock_and_the_clock_goes_on(bench):
    """A TIME frame sets the device's clock, which then goes on with the bench and over midnight."""
    seen = []
    bench.slave.time.on_time.append(lambda milliseconds, days: seen.append((milliseconds, days)))
    assert bench.slave.time.time_of_day() is None
    assert bench.write(0x1012, 0, 0x80000100, 4) == 0
    bench.send(0x100, pack("<IH", DAY_MS - 1000, 4711))
    bench.run()
    assert seen == [(DAY_MS - 1000, 4711)]
    milliseconds, days = bench.slave.time.time_of_day()
    assert (milliseconds - (DAY_MS - 1000) < 5, days) == (True, 4711)
    bench.run(1500)
    milliseconds, days = bench.slave.time.time_of_day()
    assert (490 < milliseconds < 510, days) == (True, 4712)


@pytest.mark.requirement("C301-004")
def test_consumer_takes_the_time_of_the_library(bench):
    """The `canopen` library's TIME producer sets the clock to the time that it was given to send."""
    bench.write(0x1012, 0, 0x80000100, 4)
    with PumpedNetwork(bench.segment) as network:
        network.time.transmit(441763200 + 3 * 86400 + 3661)
        bench.run(1)
    milliseconds, days = bench.slave.time.time_of_day()
    assert (milliseconds // 1000, days) == (3661, 3)


@pytest.mark.requirement("C301-142")
def test_no_consumer_without_bit_31(bench):
    """With the default 100h, and with bit 30 alone, TIME frames are nothing to the device."""
    for cob_id in (0x100, 0x40000100):
        assert bench.write(0x1012, 0, cob_id, 4) == 0
        bench.send(0x100, pack("<IH", 1, 1))
        bench.run()
        assert bench.slave.time.time_of_day() is None


@pytest.mark.requirement("C301-004")
@pytest.mark.parametrize("data", [b"", bytes(5), bytes(7), pack("<IH", DAY_MS, 0)])
def test_malformed_time_is_counted(bench, data):
    """A TIME frame of another length than six, or beyond the end of the day, is ignored and counted."""
    bench.write(0x1012, 0, 0x80000100, 4)
    bench.send(0x100, data)
    bench.run()
    assert (bench.slave.time.time_of_day(), bench.slave.time.malformed) == (None, 1)


@pytest.mark.requirement("C301-004")
def test_reserved_bits_of_the_milliseconds_do_not_count(bench):
    """Only 28 bits are milliseconds."""
    bench.write(0x1012, 0, 0x80000100, 4)
    bench.send(0x100, pack("<IH", 0xF0000000 | 1234, 1))
    bench.run(0.2)
    assert bench.slave.time.time_of_day() == (1234, 1)


@pytest.mark.requirement("C301-004", "C301-142")
def test_producer(bench):
    """A producer (bit 30) sends its clock in six bytes, in Pre-operational and Operational only, and only
    once it is set.
    """
    time = bench.slave.time
    assert bench.write(0x1012, 0, 0x40000123, 4) == AbortCode.VALUE
    assert bench.write(0x1012, 0, 0x40000080, 4) == 0
    assert not time.produce()
    time.set_time(3_600_000, 10)
    bench.take()
    assert time.produce()
    bench.run(1)
    (frame,) = [frame for _, frame in bench.received]
    assert (frame.can_id, unpack("<IH", frame.data)) == (0x080, (3_600_000, 10))
    bench.nmt(NmtCommand.STOP)
    assert not time.produce()
    bench.nmt(NmtCommand.START)
    assert time.produce()
    assert bench.write(0x1012, 0, 0x80, 4) == 0
    assert not time.produce()


@pytest.mark.requirement("C301-012", "C301-142")
def test_identifier_of_time(bench):
    """Restricted identifiers are refused; the identifier changes only while the node neither sends nor takes
    TIME.
    """
    for can_id in (0x000, 0x07F, 0x101, 0x180, 0x600 + 1, 0x701, 0x7FF):
        assert bench.write(0x1012, 0, 0x80000000 | can_id, 4) == AbortCode.VALUE
    assert bench.write(0x1012, 0, 0x80000100, 4) == 0
    assert bench.write(0x1012, 0, 0x80000200, 4) == AbortCode.DEVICE_STATE
    assert bench.write(0x1012, 0, 0x200, 4) == 0
    assert bench.write(0x1012, 0, 0x80000200, 4) == 0
    bench.send(0x200, pack("<IH", 5, 6))
    bench.run()
    assert bench.slave.time.time_of_day()[1] == 6


@pytest.mark.parametrize(("milliseconds", "days"), [(-1, 0), (DAY_MS, 0), (0, -1), (0, 65536)])
def test_clock_out_of_range(bench, milliseconds, days):
    """A time that TIME cannot carry is refused where it is given."""
    with pytest.raises(ConfigurationError):
        bench.slave.time.set_time(milliseconds, days)


def test_power_off_forgets_the_time(bench):
    """The clock has no battery."""
    bench.slave.time.set_time(0, 0)
    bench.slave.power_off()
    assert bench.slave.time.time_of_day() is None
