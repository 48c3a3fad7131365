"""Cams, work area, alarms, warnings and injected faults of the encoder."""

from __future__ import annotations

import math

import canopen
import pytest
from hypothesis import given
from hypothesis import strategies as st

from emulators.encoder import Mounting
from emulators.encoder.cia406 import CiA406Encoder, EncoderDeviceConfig, EncoderType
from fieldbus.canopen import AbortCode
from fieldbus.clock import MS
from fieldbus.errors import ConfigurationError, UnsupportedFaultError
from testcases.unit.emulators.encoderbench import EncoderBench

TPDO1, TPDO2, TPDO3, TPDO4 = 0x187, 0x287, 0x387, 0x487
TURN = 2 * math.pi


# -- cams and work area --------------------------------------------------------------------------------


class CamOracle:
    """A cam as the profile describes it, one position after the other."""

    def __init__(self, low: int, high: int, play: int) -> None:
        self.range, self.play, self.active = (low, high), play, False

    def at(self, position: int) -> bool:
        low, high = self.range
        play = self.play if self.active else 0
        self.active = low - play <= position <= high + play
        return self.active


@pytest.mark.exhaustive
@pytest.mark.requirement("C406-027", "C406-028", "C406-029", "C406-030", "C406-031", "C406-032", "C406-049")
@given(data=st.data())
def test_cams(data):
    """All eight cams at any places, with hysteresis on leaving, polarity and enable, against a model of the
    rule.
    """
    bench = EncoderBench(steps_per_revolution=1000, revolutions=1)
    place = st.integers(0, 999)
    enable, polarity = data.draw(st.integers(0, 255)), data.draw(st.integers(0, 255))
    cams = [(data.draw(place), data.draw(place), data.draw(st.integers(0, 60))) for _ in range(8)]
    bench.put(0x6301, enable, 1)
    bench.put(0x6302, polarity, 1)
    for cam, (low, high, play) in enumerate(cams):
        bench.put(0x6310 + cam, low, 1)
        bench.put(0x6320 + cam, high, 1)
        bench.put(0x6330 + cam, play, 1)
    bench.restart_cams()
    oracles = [CamOracle(*cam) for cam in cams]
    for position in data.draw(st.lists(place, min_size=1, max_size=8)):
        bench.count(position)
        wanted = sum(oracle.at(position) << cam for cam, oracle in enumerate(oracles))
        assert bench.get(0x6300, 1) == (wanted ^ polarity) & enable


@pytest.mark.requirement("C406-049", "C406-028", "C406-029")
def test_disabled_cam_is_zero_whatever_its_polarity():
    """Enable 0 gives state 0; enabled and inverted, the bit is set outside of the cam."""
    bench = EncoderBench()
    bench.put(0x6310, 100, 1)
    bench.put(0x6320, 200, 1)
    bench.put(0x6302, 1, 1)
    assert bench.get(0x6300, 1) == 0
    bench.put(0x6301, 1, 1)
    assert bench.get(0x6300, 1) == 1
    bench.count(150)
    assert bench.get(0x6300, 1) == 0
    states = [event.data["state"] for event in bench.history.select(kind="encoder.cams")]
    assert states == [1, 0]


@pytest.mark.requirement("C406-033", "C406-034")
def test_work_area():
    """Beyond the high limit bits 0 and 1, below the low one bits 0 and 2; the limits cannot cross."""
    bench = EncoderBench()
    bench.put(0x6401, 1000, 1)
    bench.put(0x6402, 2000, 1)
    states = []
    for steps in (999, 1000, 2000, 2001):
        bench.count(steps)
        states.append(bench.get(0x6400, 1))
    assert states == [0b101, 0, 0, 0b011]
    for index, value in ((0x6401, 2001), (0x6402, 999)):
        with pytest.raises(canopen.SdoAbortedError) as caught:
            bench.put(index, value, 1)
        assert caught.value.code == AbortCode.MAXIMUM_BELOW_MINIMUM


# -- alarms and warnings -------------------------------------------------------------------------------


@pytest.mark.requirement("C406-050", "C406-051", "C406-038", "C301-108", "C301-109")
def test_alarm_holds_the_position_and_sends_an_emcy():
    """Position error: EMCY 1000h with register 21h, 6004h keeps its value; with the cause it goes, EMCY
    0000h.
    """
    bench = EncoderBench()
    bench.count(500)
    bench.encoder.inject_alarms(1)
    bench.run(0.002)
    bench.count(900)
    assert (bench.position, bench.get(0x6503), bench.get(0x1001)) == (500, 1, 0x21)
    bench.encoder.inject_alarms(0x9001)
    bench.run(0.002)
    bench.encoder.inject_alarms(0)
    bench.run(0.002)
    assert (bench.position, bench.get(0x6503), bench.get(0x1001)) == (900, 0, 0)
    assert bench.emcys == [
        (0x1000, 0x21),
        (0xFF0C, 0x21),
        (0xFF0F, 0x21),
        (0, 0x21),
        (0, 0x21),
        (0, 0),
    ]


@pytest.mark.requirement("C406-050", "C406-038")
def test_slide_beyond_its_scale_is_a_position_error():
    """An absolute linear encoder that leaves its scale raises the alarm by itself, keeps the last position,
    and recovers.
    """
    bench = EncoderBench(kind=EncoderType.ABSOLUTE_LINEAR, length_mm=100.0, start=0.09)
    bench.encoder.turn_shaft(0.1)
    bench.run(0.2)
    assert bench.get(0x6503) == 1
    assert 99_900 <= bench.position <= 99_999
    bench.encoder.place_shaft(0.05)
    bench.run(0.002)
    assert (bench.get(0x6503), bench.position) == (0, 50_000)
    assert bench.emcys == [(0x1000, 0x21), (0, 0)]


@pytest.mark.requirement("C406-050", "C406-040")
@pytest.mark.parametrize("reported", [False, True])
def test_warnings(reported):
    """A warning leaves the position valid; an EMCY comes only where that is configured."""
    bench = EncoderBench(warning_emcy=reported)
    for bit in range(6):
        bench.encoder.inject_warnings(1 << bit)
        bench.run(0.002)
        assert bench.get(0x6505) == 1 << bit
    bench.count(77)
    assert bench.position == 77
    bench.encoder.inject_warnings(0)
    bench.run(0.002)
    assert bench.get(0x6505) == 0
    assert bench.emcys == ([(0xFF20, 0x21)] * 6 + [(0, 0)] if reported else [])


@pytest.mark.exhaustive
@pytest.mark.requirement("C406-040", "C406-043", "C406-008")
def test_causes_of_warnings():
    """Too fast, too long in operation, reference mark not passed yet: each sets its own bit by itself."""
    fast = EncoderBench(max_speed_rpm=600.0)
    fast.encoder.turn_shaft(9 * TURN)
    fast.run(0.1)
    assert fast.get(0x6505) == 0
    fast.encoder.turn_shaft(11 * TURN)
    fast.run(0.1)
    assert fast.get(0x6505) == 1
    old = EncoderBench(operating_time_h=99.95, operating_time_limit_h=100.0)
    assert (old.get(0x6508), old.get(0x6505)) == (999, 0)
    old.run(200.0)
    assert (old.get(0x6508), old.get(0x6505)) == (1000, 8)
    old.restart()
    assert old.get(0x6508) == 1000, "operating time is not lost with the supply"
    lost = EncoderBench(kind=EncoderType.INCREMENTAL_ROTARY_COUNTING, zero_mark=0.25)
    assert lost.get(0x6505) == 0x20
    lost.count(2000)
    assert lost.get(0x6505) == 0x20
    lost.count(2100)
    assert lost.get(0x6505) == 0


@pytest.mark.requirement("C406-039", "C406-041")
def test_only_supported_bits_can_be_brought_about():
    """Alarms beyond 6504h and warnings beyond 6506h are refused, but for the bits of the manufacturer."""
    bench = EncoderBench()
    assert (bench.get(0x6504), bench.get(0x6506)) == (1, 0x3F)
    for call, word in ((bench.encoder.inject_alarms, 2), (bench.encoder.inject_warnings, 0x40)):
        with pytest.raises(ConfigurationError):
            call(word)


# -- faults of the sensor ------------------------------------------------------------------------------


@pytest.mark.requirement("C402-312")
def test_faults_of_the_sensor():
    """Freeze, jump, noise, reversal and lost steps show in 6004h as they would on the shaft."""
    bench = EncoderBench(steps_per_revolution=1000)
    encoder = bench.encoder
    bench.count(100)
    encoder.freeze_encoder(True)
    bench.count(300)
    assert bench.position == 100
    encoder.freeze_encoder(False)
    assert bench.position == 300
    encoder.jump_encoder(50)
    assert bench.position == 350
    encoder.set_encoder_noise(3)
    seen = {bench.position for _ in range(200)}
    assert seen == set(range(347, 354))
    encoder.set_encoder_noise(0)
    encoder.reverse_encoder(True)
    bench.count(400)
    assert bench.position == 250
    encoder.reverse_encoder(False)
    encoder.lose_encoder_steps(10)
    bench.count(500)
    assert bench.position == 250 + 90
    encoder.lose_encoder_steps(0)
    bench.count(600)
    assert bench.position == 250 + 190


@pytest.mark.requirement("C402-312", "C406-009")
def test_faults_of_the_device():
    """Preset, overflow, a wrong cycle of TPDO1 and back to the right one; alarms and warnings bit by bit."""
    bench = EncoderBench()
    bench.put(0x6200, 10)
    bench.start()
    bench.encoder.preset_encoder(123)
    assert bench.position == 123
    bench.encoder.move_near_overflow(5)
    assert bench.position == 33554432 - 5
    bench.encoder.move_near_overflow(-4)
    assert bench.position == 4
    counts = []
    for period in (25, 0, None):
        bench.encoder.force_cycle_time(period)
        begin = bench.scheduler.now
        bench.run(0.105)
        counts.append(len(bench.frames(TPDO1, begin + 1 * MS)))
    assert counts == [4, 0, 10]
    bench.encoder.preset_encoder(33554432 + 3)
    assert bench.position == 3
    bench.encoder.set_alarm(0, True)
    bench.encoder.set_alarm(14, True)
    bench.encoder.set_alarm(0, False)
    bench.encoder.set_warning(4, True)
    bench.run(0.002)
    assert (bench.get(0x6503), bench.get(0x6505)) == (0x4000, 0x10)
    mounted = CiA406Encoder(
        bench.scheduler, bench.medium, EncoderDeviceConfig(node_id=9), Mounting(lambda: 0.0), name="other"
    )
    with pytest.raises(UnsupportedFaultError, match="no shaft"):
        mounted.turn_shaft(1.0)
