"""The process image of an I/O station, and what can break at its channels."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.random import default_rng

from emulators.io import (
    AnalogInput,
    AnalogOutput,
    CounterInput,
    DigitalInput,
    DigitalOutput,
    ModbusIoStation,
)
from fieldbus.clock import MS, S, VirtualScheduler
from fieldbus.errors import ConfigurationError, UnsupportedFaultError
from fieldbus.history import History
from fieldbus.modbus import (
    Outcome,
    RtuClient,
    RtuStation,
    SerialFormat,
    SerialLine,
    TcpClient,
    TcpLink,
    TcpStation,
)
from fieldbus.modbus.io_image import IoImage


class Rig:
    def __init__(self, transport="tcp", **options):
        self.scheduler = VirtualScheduler()
        self.history = History(self.scheduler)
        self.arrived = []
        self.count = 0
        rng = default_rng(1)
        self.station = ModbusIoStation(
            self.scheduler,
            digital_inputs=[DigitalInput(self.scheduler, filter_ms=0.0) for _ in range(18)],
            digital_outputs=[DigitalOutput(lambda on, n=n: self.arrived.append((n, on))) for n in range(17)],
            analog_inputs=[
                AnalogInput(self.scheduler, bipolar=True, rng=rng),
                AnalogInput(self.scheduler, 4, 20, wire_break_below=3.6),
            ],
            analog_outputs=[
                AnalogOutput(on_change=lambda v, n=n: self.arrived.append((f"a{n}", v)), rng=rng)
                for n in range(2)
            ],
            counters=[CounterInput(lambda: self.count)],
            name="io",
            history=self.history,
            **options,
        )
        if transport == "rtu":
            line = SerialLine(self.scheduler, format_=SerialFormat(115_200))
            RtuStation(self.scheduler, line, self.station.server)
            self.client = RtuClient(self.scheduler, line, retries=0)
        else:
            link = TcpLink(self.scheduler)
            TcpStation(self.scheduler, link, self.station.server)
            self.client = TcpClient(
                self.scheduler, lambda handler: link.connect("client", handler), retries=0
            )

    def exchange(self, digital=0, analog=(0, 0)):
        image = self.station.image
        job = self.client.submit(image.request(image.pack_outputs(digital, analog)))
        assert self.scheduler.run_until(lambda: job.result, 10 * S)
        if job.result.outcome is not Outcome.DONE:
            return job.result.outcome
        return image.unpack_inputs(job.result.response.values)


@pytest.mark.requirement("MODB-020")
@pytest.mark.parametrize("transport", ["tcp", "rtu"])
def test_one_request_for_everything(transport):
    """Function 23 brings all outputs and fetches all inputs; the outputs are written first."""
    rig = Rig(transport)
    rig.station.output(16).on_change = rig.station.input(17).set
    rig.station.input(0).set(True)
    rig.station.analog_input(0).set(-5.0)
    rig.station.analog_input(1).set(12.0)
    rig.count = -3
    assert rig.exchange(1 << 16 | 0b10, (13824, -27648)) == (1 << 17 | 1, [-13824, 13824], [-3])
    assert rig.arrived == [(1, True), ("a0", 5.0), ("a1", -10.0)]
    rig.count = 0x8000_0001
    assert rig.exchange(1 << 16) == (1 << 17 | 1, [-13824, 13824], [-0x7FFF_FFFF])


@pytest.mark.exhaustive
@given(st.data())
def test_the_image_loses_nothing(data):
    """Whatever the numbers of channels: what is packed comes out again."""
    small = st.integers(0, 40)
    image = IoImage(
        digital_inputs=data.draw(small),
        digital_outputs=data.draw(small),
        analog_inputs=data.draw(st.integers(0, 9)),
        analog_outputs=data.draw(st.integers(0, 9)),
        counters=data.draw(st.integers(0, 9)),
    )
    word, long = st.integers(-32768, 32767), st.integers(-(2**31), 2**31 - 1)
    digital = data.draw(st.integers(0, 2**image.digital_inputs - 1))
    analog = data.draw(st.lists(word, min_size=image.analog_inputs, max_size=image.analog_inputs))
    counters = data.draw(st.lists(long, min_size=image.counters, max_size=image.counters))
    words = image.pack_inputs(digital, analog, counters)
    assert len(words) == image.input_words
    assert all(0 <= one <= 0xFFFF for one in words)
    assert image.unpack_inputs(words) == (digital, analog, counters)
    digital = data.draw(st.integers(0, 2**image.digital_outputs - 1))
    analog = data.draw(st.lists(word, min_size=image.analog_outputs, max_size=image.analog_outputs))
    words = image.pack_outputs(digital, analog)
    assert (len(words), image.unpack_outputs(words)) == (image.output_words, (digital, analog))


def test_an_image_with_one_direction():
    """Without outputs the request reads alone, without inputs it writes alone, without channels there is
    none.
    """
    assert IoImage(digital_inputs=1).request([]).function == 3
    assert IoImage(digital_outputs=1).request([1]).function == 16
    assert IoImage().request([]) is None
    with pytest.raises(ConfigurationError):
        IoImage(counters=63)
    with pytest.raises(ConfigurationError):
        IoImage(analog_outputs=122)


def test_stuck_and_broken_channels():
    """A stuck input or output has its level whatever comes, a broken wire carries none; after the repair the
    present one counts.
    """
    rig = Rig()
    station = rig.station
    station.hold("input", 0, True)
    station.input(1).set(True)
    station.break_wire("input", 1, True)
    assert rig.exchange()[0] == 1
    station.hold("input", 0, None)
    station.break_wire("input", 1, False)
    assert rig.exchange()[0] == 2
    station.hold("output", 0, False)
    station.break_wire("output", 1, True)
    rig.exchange(0b111)
    assert rig.arrived == [(2, True)]
    station.hold("output", 0, None)
    station.break_wire("output", 1, False)
    assert rig.arrived[1:] == [(0, True), (1, True)]
    station.hold("output", 3, True)
    assert rig.arrived[-1] == (3, True)


def test_a_stuck_input_passes_the_filter_too():
    """A level that comes by a fault takes as long as one that comes by the wire."""
    scheduler = VirtualScheduler()
    channel = DigitalInput(scheduler, filter_ms=3.0)
    channel.hold(True)
    scheduler.run_for(3 * MS - 1)
    assert not channel.value
    scheduler.run_for(1)
    assert channel.value


def test_analog_channels_break():
    """Offset, gain, noise from the seeded stream, a value that stands, a broken wire: on inputs and
    outputs.
    """
    rig = Rig()
    station = rig.station
    station.analog_input(0).set(5.0)
    for fault, word in (({"offset": 1.0}, 16589), ({"gain": 0.5}, 6912), ({}, 13824)):
        station.disturb("analog_input", 0, **fault)
        assert rig.exchange()[1][0] == word
    station.disturb("analog_input", 0, noise=0.1)
    seen = {rig.exchange()[1][0] for _ in range(20)}
    assert len(seen) > 10
    assert max(abs(word - 13824) for word in seen) <= 277
    station.hold("analog_input", 0, -2.5)
    assert rig.exchange()[1][0] == -6912
    station.hold("analog_input", 0, None)
    station.disturb("analog_input", 0)
    station.analog_input(1).set(12.0)
    station.break_wire("analog_input", 1, True)
    assert rig.exchange()[1] == [13824, 32767]
    rig.exchange(analog=(13824, 0))
    station.disturb("analog_output", 0, offset=-0.5, gain=1.1)
    assert rig.arrived[-1] == ("a0", pytest.approx(5.0))
    station.break_wire("analog_output", 0, True)
    assert rig.arrived[-1] == ("a0", 0.0)
    station.break_wire("analog_output", 0, False)
    station.disturb("analog_output", 0)
    station.hold("analog_output", 0, 3.0)
    rig.exchange(analog=(27648, 0))
    assert rig.arrived[-1] == ("a0", 3.0)
    with pytest.raises(UnsupportedFaultError):
        station.disturb("analog_input", 1, noise=1.0)
    with pytest.raises(ConfigurationError):
        station.disturb("input", 1, offset=1.0)


def test_swapped_wires():
    """Two channels of a kind that are swapped show and get each other's signal, until they are swapped
    back.
    """
    rig = Rig()
    station = rig.station
    station.input(3).set(True)
    station.swap("input", 3, 5)
    assert rig.exchange()[0] == 1 << 5
    station.swap("input", 3, 5)
    assert rig.exchange()[0] == 1 << 3
    rig.exchange(0b1)
    station.swap("output", 0, 1)
    assert rig.arrived[-2:] == [(1, True), (0, False)]
    rig.exchange(0b10)
    assert rig.arrived[-2:] == [(1, False), (0, True)]
    rig.exchange(0b10, analog=(27648, 0))
    station.swap("analog_output", 0, 1)
    assert rig.arrived[-2:] == [("a1", 10.0), ("a0", 0.0)]


def test_the_counter():
    """A counter wraps at 32 bits, stands while its wire is broken, and has lost what passed then."""
    rig = Rig()
    rig.count = 100
    assert rig.exchange()[2] == [100]
    rig.station.break_wire("counter", 0, True)
    rig.count = 150
    assert rig.exchange()[2] == [100]
    rig.station.break_wire("counter", 0, False)
    rig.count = 160
    assert rig.exchange()[2] == [110]
    rig.station.counter(0).set(0x7FFF_FFFF)
    rig.count = 161
    assert rig.exchange()[2] == [-0x8000_0000]


def test_a_station_without_supply():
    """It answers nothing and its outputs are off at once; afterwards its counters begin at 0."""
    rig = Rig()
    rig.count = 5
    rig.exchange(0b1, (27648, 0))
    rig.station.power_off()
    assert rig.arrived[-2:] == [(0, False), ("a0", 0.0)]
    assert rig.exchange() is Outcome.TIMEOUT
    rig.station.power_on()
    assert rig.exchange(0b1)[2] == [0]
    assert rig.arrived[-1] == (0, True)
    assert [event.data["on"] for event in rig.history.select(kind="station.power")] == [False, True]


def test_the_watchdog_counts_the_image():
    """Writing the image keeps the outputs alive; without it they take their substitutes, and the log says
    so.
    """
    rig = Rig(watchdog_ms=20.0)
    for _ in range(10):
        rig.exchange(0b1, (27648, 0))
        rig.scheduler.run_for(10 * MS)
    assert rig.station.output(0).level
    rig.scheduler.run_for(20 * MS)
    assert not rig.station.output(0).level
    assert rig.arrived[-1] == ("a0", 0.0)
    assert len(list(rig.history.select(kind="station.substituted"))) == 1
    row = dict(zip([name for name, _ in rig.station.trace_columns], rig.station.trace_row(), strict=True))
    assert (row["outputs"], row["substituted"], row["ao0"], row["count0"]) == (0, True, 0.0, 0)


def test_channels_that_do_not_exist():
    """A wrong number or kind says what there is."""
    station = Rig().station
    with pytest.raises(ConfigurationError, match=r"0\.\.17"):
        station.input(18)
    with pytest.raises(ConfigurationError, match="analog_output"):
        station.hold("relay", 0, True)
