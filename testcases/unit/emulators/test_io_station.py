"""Channels of an I/O station, and the station on a virtual line and link."""

import pytest

from emulators.io import AnalogInput, AnalogOutput, DigitalInput, DigitalOutput, ModbusIoStation
from fieldbus.clock import MS, S, VirtualScheduler
from fieldbus.errors import ConfigurationError
from fieldbus.modbus import (
    Outcome,
    Request,
    RtuClient,
    RtuStation,
    SerialLine,
    TcpClient,
    TcpLink,
    TcpStation,
)


@pytest.fixture
def scheduler():
    return VirtualScheduler()


class Rig:
    def __init__(self, scheduler, transport, **options):
        self.scheduler = scheduler
        self.inputs = [DigitalInput(scheduler, filter_ms=3.0) for _ in range(10)]
        self.outputs = [DigitalOutput() for _ in range(9)] + [DigitalOutput(substitute=None)]
        self.analog_in = [AnalogInput(scheduler), AnalogInput(scheduler, 4, 20, wire_break_below=3.6)]
        self.analog_out = [AnalogOutput(), AnalogOutput(substitute=None)]
        self.station = ModbusIoStation(
            scheduler,
            digital_inputs=self.inputs,
            digital_outputs=self.outputs,
            analog_inputs=self.analog_in,
            analog_outputs=self.analog_out,
            **options,
        )
        if transport == "rtu":
            line = SerialLine(scheduler)
            RtuStation(scheduler, line, self.station.server)
            self.client = RtuClient(scheduler, line)
        else:
            link = TcpLink(scheduler)
            TcpStation(scheduler, link, self.station.server)
            self.client = TcpClient(scheduler, lambda handler: link.connect("client", handler))

    def ask(self, *request):
        job = self.client.submit(Request(*request))
        assert self.scheduler.run_until(lambda: job.result, 10 * S)
        assert job.result.outcome is Outcome.DONE, job.result.text
        return job.result.response.values


@pytest.fixture(params=["rtu", "tcp"])
def rig(request, scheduler):
    return Rig(scheduler, request.param)


@pytest.mark.requirement("MODB-012", "MODB-013", "MODB-017", "MODB-018")
def test_channels_over_the_bus(rig):
    """Inputs are read, outputs written and read back, over either link."""
    rig.inputs[3].set(True)
    rig.scheduler.run_for(10 * MS)
    assert rig.ask(2, 0, 10) == (0, 0, 0, 1, 0, 0, 0, 0, 0, 0)
    rig.ask(15, 1, 3, (1, 0, 1))
    assert [one.value for one in rig.outputs[:5]] == [False, True, False, True, False]
    assert rig.ask(1, 0, 5) == (0, 1, 0, 1, 0)
    rig.analog_in[0].set(5.0)
    rig.analog_in[1].set(20.0)
    assert rig.ask(4, 0, 2) == (13824, 27648)
    rig.ask(16, 0, 2, (13824, 0x10000 - 13824))
    assert [one.value for one in rig.analog_out] == [5.0, -5.0]
    assert rig.ask(3, 0, 2) == (13824, 0x10000 - 13824)


@pytest.mark.parametrize(("length_us", "seen"), [(2999, False), (3001, True)])
def test_the_input_filter(scheduler, length_us, seen):
    """A pulse shorter than the filter is not seen, a longer one is, later by the filter time."""
    channel = DigitalInput(scheduler, filter_ms=3.0)
    course = []
    scheduler.every(MS // 10, lambda: course.append(channel.value))
    channel.set(True)
    scheduler.run_for(length_us * 1000)
    channel.set(False)
    scheduler.run_for(20 * MS)
    assert any(course) is seen
    assert not channel.value
    plain = DigitalInput(scheduler, filter_ms=0)
    plain.set(True)
    assert plain.value


def test_bouncing_is_filtered(scheduler):
    """A contact that bounces counts from its last bounce on."""
    channel = DigitalInput(scheduler, filter_ms=3.0)
    for _ in range(10):
        channel.set(True)
        scheduler.run_for(MS)
        channel.set(False)
        scheduler.run_for(MS)
    channel.set(True)
    scheduler.run_for(3 * MS - 1)
    assert not channel.value
    scheduler.run_for(1)
    assert channel.value


def test_analog_range_and_smoothing(scheduler):
    """27648 is the range, overflow and underflow have their own words, a broken wire is an overflow; 63 %
    after a time constant.
    """
    channel = AnalogInput(scheduler, 4, 20, wire_break_below=3.6)
    for value, word in (
        (4, 0),
        (12, 13824),
        (20, 27648),
        (22.81, 32504),
        (23, 32767),
        (3.7, -518),
        (3.5, 32767),
    ):
        channel.set(value)
        assert channel.word == word
    assert channel.wire_broken
    bipolar = AnalogInput(scheduler, bipolar=True)
    for value, word in ((-10, -27648), (-11.9, -32768), (-1, -2765)):
        bipolar.set(value)
        assert bipolar.word == word
    unipolar = AnalogInput(scheduler)
    unipolar.set(-5)
    assert unipolar.word == -32768
    smooth = AnalogInput(scheduler, smoothing_ms=10)
    smooth.set(10.0)
    scheduler.run_for(10 * MS)
    assert smooth.word == round(27648 * (1 - 2.718281828459045**-1))
    scheduler.run_for(S)
    assert smooth.word == 27648


def test_the_watchdog(scheduler):
    """Without a write for the time the outputs take their substitutes or keep their values; reading does not
    help.
    """
    rig = Rig(scheduler, "tcp", watchdog_ms=100)
    scheduler.run_for(S)
    assert not rig.station.substituted
    rig.ask(15, 0, 10, (1,) * 10)
    rig.ask(16, 0, 2, (100, 200))
    scheduler.run_for(50 * MS)
    rig.ask(15, 0, 1, (1,))
    scheduler.run_for(80 * MS)
    assert not rig.station.substituted
    rig.ask(1, 0, 1)
    scheduler.run_for(50 * MS)
    assert rig.station.substituted
    assert [one.value for one in rig.outputs] == [False] * 9 + [True]
    assert [one.word for one in rig.analog_out] == [0, 200]
    rig.ask(15, 0, 1, (1,))
    assert rig.outputs[0].value
    assert not rig.station.substituted


def test_what_an_output_does_is_reported():
    """A change of an output calls back once per change."""
    seen = []
    output = DigitalOutput(seen.append)
    for level in (True, True, False):
        output.set(level)
    assert seen == [True, False]


def test_bad_settings_are_refused(scheduler):
    """Filters, ranges, times and numbers of channels that cannot be say what is allowed."""
    bad = [
        lambda: DigitalInput(scheduler, filter_ms=-1),
        lambda: DigitalInput(scheduler, filter_ms=1001),
        lambda: AnalogInput(scheduler, 5, 5),
        lambda: AnalogInput(scheduler, smoothing_ms=-1),
        lambda: AnalogInput(scheduler).set(float("nan")),
        lambda: AnalogOutput(1, 0),
        lambda: ModbusIoStation(scheduler, watchdog_ms=-1),
        lambda: ModbusIoStation(scheduler, digital_outputs=[DigitalOutput()] * 513),
    ]
    for make in bad:
        with pytest.raises(ConfigurationError):
            make()
