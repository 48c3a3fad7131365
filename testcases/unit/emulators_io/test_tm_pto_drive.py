"""TM PTO: frames, states, ramps, limits and worked numbers of the drive part."""

from __future__ import annotations

import math
from typing import get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st

from emulators.drive.pto_settings import Signals
from emulators.io.tm_pto import PtoConfig, PtoModule, PulseGenerator
from fieldbus.clock import MS, S, VirtualScheduler
from fieldbus.errors import ConfigurationError
from fieldbus.profidrive import pto_telegram, telegram
from testcases.campaigns._pto_rig import RUN, S1, S2, S3, S4, S5A, S5B, SEQUENCE, Rig, channel_of

STATES = {S1: 0x0040, S2: 0x0001, S3: 0x0003, S4: 0x0007, S5A: 0x0007, S5B: 0x0007}


@pytest.mark.requirement("PTO-029", "PTO-036", "PTO-037", "PTO-039")
def test_frames():
    """8 and 16 bytes in the device variant, 10 and 18 in the standard one; another length is refused."""
    assert (pto_telegram().setpoint.length, pto_telegram().actual.length) == (8, 16)
    assert (telegram(3).setpoint.length, telegram(3).actual.length) == (10, 18)
    for variant, right in (("device", 8), ("standard", 10)):
        rig = Rig(variant=variant)
        for length in (0, 7, 8, 9, 10, 18):
            assert rig.module.receive(0, bytes(length)) is (length == right)
        assert rig.channel.refused == 5


@pytest.mark.requirement("PTO-020", "PTO-040", "PTO-041", "PTO-042", "PTO-043", "PTO-044")
@pytest.mark.parametrize(
    ("nsoll", "maximum", "rpm", "hertz"),
    [
        (0x4000, 3000, 3000.0, 10_000.0),
        (-0x4000, 3000, -3000.0, -10_000.0),
        (0x2000, 3000, 1500.0, 5000.0),
        (1, 3000, 3000 / 16384, 10_000 / 16384),
        (0x7FFF, 6000, 5999.81689, 19_999.3896),
        (-0x8000, 6000, -6000.0, -20_000.0),
        (0x7FFF, 3000, 3000.0, 10_000.0),
        (-0x8000, 3000, -3000.0, -10_000.0),
        (0, 3000, 0.0, 0.0),
    ],
)
def test_setpoint(nsoll, maximum, rpm, hertz):
    """N2 of the reference speed becomes a frequency of the pulses, held at the maximum speed."""
    rig = Rig(ramp_stop_ms=1, maximum_speed=maximum)
    rig.start(nsoll, seconds=0.1)
    assert rig.hertz == pytest.approx(hertz, rel=1e-7)
    assert rig.channel.speed_rpm == pytest.approx(rpm, rel=1e-7)
    assert rig.got["NIST_A"] == max(-0x8000 * maximum // 6000, min(0x8000 * maximum // 6000, nsoll))
    assert bool(rig.zsw1 & 0x0400) is (abs(rpm) >= maximum or rpm == 0.0)


@pytest.mark.requirement("PTO-037", "PTO-031")
def test_standard_variant():
    """The 32-bit setpoint counts with all its bits."""
    rig = Rig(variant="standard", ramp_stop_ms=1)
    rig.start(0x2000_0001, seconds=0.1)
    assert rig.channel.speed_rpm == pytest.approx(3000 * 0x2000_0001 / 0x4000_0000, rel=1e-12)
    assert rig.got["NIST_B"] == 0x2000_0001
    assert rig.got["ZSW2"] == 0


@pytest.mark.requirement("PTO-010", "PTO-021", "PTO-022")
@pytest.mark.parametrize(
    ("increments", "kind", "lowest", "highest"),
    [
        (200, "pulse_direction", 0.03, 6000.0),
        (10_000, "pulse_direction", 0.0006, 1200.0),
        (10_000, "ab_fourfold", 0.0006, 4800.0),
        (1_000_000, "ab", 6e-6, 12.0),
    ],
)
def test_range_of_the_maximum_speed(increments, kind, lowest, highest):
    """From 0.1 Hz to the smaller of twice the reference speed and 200 kHz; beyond it is refused."""
    for good in (lowest, highest):
        channel_of(increments=increments, signals=kind, maximum_speed=good)
    for bad in (lowest * 0.999, highest * 1.001):
        with pytest.raises(ConfigurationError, match="maximum_speed"):
            channel_of(increments=increments, signals=kind, maximum_speed=bad)


@pytest.mark.parametrize(
    "wrong",
    [
        {"increments": 0},
        {"increments": 1_000_001},
        {"reference_speed_rpm": 0.5},
        {"ramp_stop_ms": 0},
        {"quick_stop_ms": 65_536},
        {"reversal_pause_ms": 2},
        {"input_delay_ms": 0.2},
        {"sign_tolerance": 0},
    ],
    ids=lambda wrong: next(iter(wrong)),
)
@pytest.mark.requirement("PTO-007", "PTO-008", "PTO-009", "PTO-012", "PTO-013", "PTO-016", "PTO-017")
def test_configuration_is_checked(wrong):
    """A value out of its range is refused by its name."""
    with pytest.raises(ConfigurationError, match=next(iter(wrong))):
        channel_of(**wrong)


# -- states --------------------------------------------------------------------------------------------


@pytest.mark.requirement(
    "PTO-102", "PTO-138", "PTO-139", "PTO-140", "PTO-141", "PTO-155", "PTO-157", "PTO-101"
)
def test_enable_sequence():
    """Step by step to S4 with the reference patterns of ZSW1; bit 10 at standstill."""
    rig = Rig()
    patterns = [
        (0, S1, 0x0240),
        (0x0450, S1, 0x0240),
        (0x0456, S2, 0x0231),
        (0x0457, S3, 0x0233),
        (0x045F, S4, 0x0237),
    ]
    for word, state, pattern in patterns:
        assert rig(word) is state
        assert rig.zsw1 & ~0x0500 == pattern
        assert rig.zsw1 & 0x0400
        assert bool(rig.zsw1 & 0x0100) is (state is S4)


@pytest.mark.requirement("PTO-156", "PTO-162", "PTO-161", "PTO-144", "PTO-066")
def test_other_sequences():
    """Standard patterns work; ON together with the stops is not enough; several steps at once take a cycle
    each.
    """
    rig = Rig()
    assert [rig(word) for word in (0x0400, 0x047E, 0x047F, 0x047F)] == [S1, S2, S3, S4]
    rig = Rig()
    rig(0x0450)
    for _ in range(5):
        assert rig(0x0457) is S1
        assert rig.zsw1 & ~0x0500 == 0x0270
    assert rig(0x0456) is S2
    assert [rig(0x045F), rig(0x045F)] == [S3, S4]


# From, control word, next state, pulses afterwards (None: a ramp is running).
ROWS = [
    ("PTO-143", 2, 0x0456, S2),
    ("PTO-145", 2, 0x0457, S3),
    ("PTO-146", 3, 0x045F, S4),
    ("PTO-147", 4, 0x0457, S3),
    ("PTO-150", 3, 0x0456, S2),
    *(("PTO-151", number, word, S1) for number in (2, 3, 4) for word in (0x045D, 0x005F)),
    *(("PTO-153", number, 0x045B, S1) for number in (2, 3)),
]


@pytest.mark.requirement(*sorted({row[0] for row in ROWS}), "PTO-056", "PTO-059", "PTO-062")
@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row[0]}-S{row[1]}-{row[2]:04X}")
def test_transition_without_ramp(row):
    """The control word leads into the state at once; no pulse comes any more, and ED falls outside of S4."""
    _, number, word, state = row
    rig = Rig(use_ed=True, ramp_stop_ms=1)
    for step in SEQUENCE[:number]:
        rig(step, nsoll=0x4000)
    if number == 4:
        rig(seconds=0.1)
        assert rig.hertz == 10_000
    rig(word)
    assert rig.channel.state is state
    if state is not S4:
        before = rig.count
        assert rig.hertz == 0
        assert not rig.channel.ed
        rig(seconds=0.1)
        assert rig.count == before


STOPS = [  # identifier, control word, share of the maximum, time, pulses, end
    ("PTO-058", 0x045E, 1.0, 5.0, 25_000, S2),
    ("PTO-058", 0x045E, 0.5, 2.5, 6250, S2),
    ("PTO-057", 0x045B, 1.0, 1.0, 5000, S1),
    ("PTO-057", 0x045B, 0.5, 0.5, 1250, S1),
]


@pytest.mark.exhaustive
@pytest.mark.requirement(
    "PTO-149", "PTO-152", "PTO-165", "PTO-264", "PTO-046", *sorted({row[0] for row in STOPS})
)
@pytest.mark.parametrize("row", STOPS, ids=lambda row: f"{row[0]}-{row[2]}")
def test_stop_ramps(row):
    """OFF1 and OFF3 brake linearly within their time, pulse for pulse; ED falls and the state changes at
    standstill.
    """
    _, word, share, seconds, pulses, end = row
    rig = Rig(use_ed=True)
    rig.start(int(0x4000 * share), seconds=6)
    rig(word)
    began, before = rig.scheduler.now, rig.count
    assert bool(rig.zsw1 & 0x0020) is (word != 0x045B)
    while rig.channel.state not in {S1, S2}:
        assert rig.channel.ed
        assert rig.zsw1 & 0x0047 == 0x0007
        gone = (rig.scheduler.now - began) / S
        assert rig.hertz == pytest.approx(10_000 * share * (1 - gone / seconds), abs=0.01)
        rig()
    assert rig.channel.state is end
    assert (rig.scheduler.now - began) / S == pytest.approx(seconds, abs=0.0041)
    assert rig.count - before == pulses
    assert not rig.channel.ed


@pytest.mark.exhaustive
@pytest.mark.requirement("PTO-064", "PTO-065", "PTO-265")
def test_taking_stops_back():
    """OFF1 can be taken back on the ramp, OFF3 cannot."""
    rig = Rig()
    rig.start(0x4000, seconds=6)
    assert rig(0x045E, cycles=100) is S5A
    assert rig(RUN) is S4
    rig(seconds=6)
    assert rig.hertz == 10_000
    assert rig(0x045B, cycles=10) is S5B
    assert rig(RUN, cycles=10) is S5B
    assert rig(seconds=2) is S1
    assert rig.zsw1 & 0x0040


@pytest.mark.requirement("PTO-063")
@pytest.mark.parametrize(("word", "state"), [(0x0450, S1), (0x0452, S5B), (0x0456, S5A), (0x0457, S3)])
def test_priority(word, state):
    """OFF2 goes before OFF3 before OFF1 before disable operation."""
    rig = Rig()
    rig.start(0x4000, seconds=1)
    assert rig(word) is state


@pytest.mark.exhaustive
@pytest.mark.requirement("PTO-060", "PTO-061", "PTO-069")
def test_ramp_generator_and_setpoint_enable():
    """Without bit 4 pulses stop at once, without bit 6 by the ramp; both stay in S4 and go on from there."""
    rig = Rig()
    rig.start(0x4000, seconds=6)
    assert rig(0x044F) is S4
    assert rig.hertz == 0
    rig(RUN, cycles=251)
    assert rig.hertz == pytest.approx(2000)
    rig(seconds=5)
    assert rig(0x041F, cycles=251) is S4
    assert rig.hertz == pytest.approx(8000)
    rig(seconds=4.1)
    assert rig.hertz == 0
    rig(RUN, cycles=251)
    assert rig.hertz == pytest.approx(2000)
    idle = Rig()
    for word in SEQUENCE[:3]:
        idle(word, nsoll=0x4000, cycles=20)
    assert idle.count == 0


@pytest.mark.requirement("PTO-050", "PTO-053", "PTO-055", "PTO-071", "PTO-072", "PTO-073")
def test_bits_that_are_not_evaluated():
    """STW1 5, 8, 9, 11 to 15 and the bits of STW2_ENC change nothing."""
    rig = Rig()
    rig.start(0x2000, seconds=3)
    reference = rig.got
    rig.stw2 = 0x0FFF
    for word in (0x047F, 0x055F, 0x065F, 0xFC5F):
        rig(word)
        assert rig.channel.state is S4
        assert {**rig.got, "G1_XIST1": 0} == {**reference, "G1_XIST1": 0}


@pytest.mark.requirement("PTO-158", "PTO-159", "PTO-160", "PTO-148", "PTO-163")
def test_drive_enable_and_drive_ready():
    """ED comes with enable operation, S4 waits for DR; a drop longer than the filter leads to S3 and back."""
    rig = Rig(use_ed=True, use_dr=True, ramp_stop_ms=1, input_delay_ms=0.1)
    for word in SEQUENCE:
        assert not rig.channel.ed
        rig(word, nsoll=0x4000)
    assert rig.channel.state is S3
    assert rig.channel.ed
    assert rig.zsw1 & 0x0007 == 0x0003
    rig(seconds=0.2)
    assert rig.count == 0
    rig.channel.drive_input("DR", True)
    assert rig() is S4
    rig(seconds=0.1)
    before = rig.count
    rig.channel.drive_input("DR", False)
    rig.scheduler.run_for(90_000)
    rig.channel.drive_input("DR", True)
    assert rig() is S4
    assert rig.count - before == pytest.approx(41, abs=1)
    rig.channel.drive_input("DR", False)
    rig.scheduler.run_for(1 * MS)
    stopped = rig.count
    rig.channel.drive_input("DR", True)
    assert rig() is S3
    assert rig.channel.ed
    assert rig.count == stopped
    assert rig() is S4
    ready = Rig(use_ed=True, use_dr=True)
    ready.channel.drive_input("DR", True)
    assert [ready(word) for word in SEQUENCE] == [S1, S2, S3, S4]


# -- pulses --------------------------------------------------------------------------------------------


@pytest.mark.requirement("PTO-164", "PTO-067", "PTO-120")
def test_ramp_numbers():
    """0 to 3000 rpm in 5 s: 600 rpm after 1 s, 25 000 pulses in all; half the setpoint is 5 kHz."""
    rig = Rig()
    rig.start(0x4000)
    rig(seconds=1)
    assert rig.channel.speed_rpm == pytest.approx(600)
    assert rig.got["NIST_A"] == round(0x4000 * 0.2)
    rig(seconds=4)
    assert rig.hertz == 10_000
    assert rig.got["G1_XIST1"] == 25_000
    rig(nsoll=0x2000)
    rig(seconds=3)
    assert rig.hertz == 5000


@pytest.mark.requirement("PTO-121", "PTO-122", "PTO-124")
def test_count_and_wrap():
    """Pulses count with their sign; the counter wraps at 32 bits."""
    generator = PulseGenerator()
    generator.steer(0, 1000.0, 1e12)
    generator.advance(200 * MS)
    generator.steer(200 * MS, -1000.0, 1e12)
    generator.advance(250 * MS + 10)
    assert generator.count == 150
    rig = Rig(start_value=0x7FFF_FFFF, ramp_stop_ms=1)
    rig.start()
    assert rig.got["G1_XIST1"] == 0x7FFF_FFFF
    seen = []
    rig.channel.at_count(1, lambda: seen.append(rig.channel.interface.step(0, 0)[1]))
    rig(nsoll=0x4000, cycles=2)
    assert seen == [-0x8000_0000]


@pytest.mark.exhaustive
@pytest.mark.requirement("PTO-167", "PTO-101")
@pytest.mark.parametrize(
    ("hertz", "pulses", "reached"),
    [(0.05, False, True), (0.2, True, False), (10_000.0, True, True), (9990.0, True, False)],
)
def test_lowest_frequency(hertz, pulses, reached):
    """Below 0.1 Hz there are no pulses; bit 10 says that, and that the maximum is reached."""
    rig = Rig(variant="standard", ramp_stop_ms=1)
    rig.start(round(0x4000_0000 * hertz / 10_000))
    rig(seconds=12 if hertz < 1 else 0.1)
    assert (rig.count > 0) is pulses
    assert bool(rig.zsw1 & 0x0400) is reached


@pytest.mark.requirement("PTO-068", "PTO-007")
@pytest.mark.parametrize("pause_ms", [0, 1, 4, 10])
def test_reversal(pause_ms):
    """The speed ramps through zero, and the pause lies between the two directions."""
    generator = PulseGenerator(pause_ns=pause_ms * MS)
    generator.steer(0, 10_000.0, 100_000.0)
    generator.advance(S)
    generator.steer(S, -10_000.0, 100_000.0)
    turn = S + 100 * MS
    generator.advance(turn)
    assert generator.frequency == 0.0
    assert not generator.negative
    generator.advance(turn + pause_ms * MS)
    top = generator.count
    assert generator.frequency == 0.0
    generator.advance(turn + pause_ms * MS + 50 * MS)
    assert generator.frequency == pytest.approx(-5000)
    assert generator.negative
    assert generator.count == pytest.approx(top - 125, abs=1)


@pytest.mark.requirement("PTO-007")
def test_pause_after_a_stop():
    """After a stop without a ramp the other direction waits for what is left of the pause, the same one does
    not.
    """
    for sign, wait in ((-1, 6), (1, 0)):
        generator = PulseGenerator(pause_ns=10 * MS)
        generator.steer(0, 1000.0, 1e12)
        generator.advance(S)
        generator.halt(S)
        generator.steer(S + 4 * MS, sign * 1000.0, 1e12)
        assert generator.time_of(generator.count + sign) == pytest.approx(S + (4 + wait + 1) * MS, abs=10)


@pytest.mark.requirement("PTO-006", "PTO-123")
def test_signal_types():
    """Levels of the terminals: pulse and direction, up or down, and A before B in positive direction."""
    generator = PulseGenerator()
    generator.steer(0, 1000.0, 1e12)
    rows = {kind: [] for kind in get_args(Signals)}
    for quarter in range(4):
        generator.advance(S + quarter * MS // 4 + MS // 8)
        for kind, row in rows.items():
            row.append(generator.levels(kind))
    assert rows["pulse_direction"] == [(True, False)] * 2 + [(False, False)] * 2
    assert rows["up_down"] == [(True, False)] * 2 + [(False, False)] * 2
    assert rows["ab"] == [(False, False), (True, False), (True, True), (False, True)]
    edges = []
    for step in range(5):
        generator.advance(2 * S + step * MS)
        edges.append((generator.count % 4, generator.levels("ab_fourfold")))
    cycle = {0: (False, False), 1: (True, False), 2: (True, True), 3: (False, True)}
    assert all(levels == cycle[count] for count, levels in edges)
    assert len({count for count, _ in edges}) == 4
    generator.steer(3 * S, -1000.0, 1e12)
    generator.advance(4 * S + MS // 2 + MS // 8)
    assert generator.levels("pulse_direction")[1]
    assert generator.levels("up_down")[0] is False


TARGETS = st.lists(
    st.tuples(
        st.floats(-20_000, 20_000),
        st.sampled_from([2000.0, 50_000.0, 1e6]),
        st.integers(1, 20),
        st.booleans(),
    ),
    min_size=1,
    max_size=15,
)


@pytest.mark.exhaustive
@pytest.mark.requirement("PTO-312", "PTO-291")
@given(TARGETS, st.sampled_from([0, 1, 4, 10]))
def test_count_is_the_integral(targets, pause_ms):
    """The count stays within a pulse of the integral of the frequency, whatever is commanded; asking often
    changes nothing.
    """
    generator = PulseGenerator(pause_ns=pause_ms * MS)
    coarse = PulseGenerator(pause_ns=pause_ms * MS)
    now, integral = 0, 0.0
    tick = 10_000
    for target, slope, cycles, halt in targets:
        for one in (generator, coarse):
            if halt:
                one.halt(now)
            else:
                one.steer(now, target, slope)
        before = generator.frequency
        for _ in range(cycles * 100):
            now += tick
            generator.advance(now)
            integral += 0.5 * (before + generator.frequency) * tick / S
            before = generator.frequency
    coarse.advance(now)
    # The trapezoids of the oracle miss the bends of the frequency by less than this.
    slack = 1.0 + sum(0.01 + abs(2e4) * tick / S for _ in targets)
    assert abs(generator.count - integral) <= slack
    assert coarse.count == pytest.approx(generator.count, abs=1)


@pytest.mark.exhaustive
@pytest.mark.requirement("PTO-292")
@given(st.floats(200, 20_000), st.sampled_from([5000.0, 1e6]), st.integers(1, 2000), st.booleans())
def test_time_of_a_count(target, slope, count, back):
    """The time that is given for a count is the instant at which it is reached, not a nanosecond before it by
    much.
    """
    sign = -1 if back else 1
    generator = PulseGenerator()
    generator.steer(0, sign * target, slope)
    due = generator.time_of(sign * count)
    assert generator.time_of(-sign) is None
    probe = PulseGenerator()
    probe.steer(0, sign * target, slope)
    probe.advance(due - 1000)
    assert abs(probe.count) < count
    probe.advance(due)
    assert abs(probe.count) == count


# -- everything at random ------------------------------------------------------------------------------

WORDS = st.sampled_from(
    [*SEQUENCE, RUN, RUN, RUN, 0x045E, 0x045B, 0x045D, 0x0457, 0x044F, 0x041F, 0x005F, 0x04DF, 0]
)


@pytest.mark.exhaustive
@pytest.mark.requirement("PTO-311", "PTO-266")
@given(
    st.lists(
        st.tuples(WORDS | st.integers(0, 0xFFFF), st.integers(-0x8000, 0x7FFF), st.integers(1, 30)),
        max_size=30,
    )
)
def test_any_control_words(steps):
    """The bits are those of the state in every cycle; pulses in S4 and on the stop ramps only; S1 is left
    with ON = 0 only.
    """
    rig = Rig(ramp_stop_ms=50, quick_stop_ms=20)
    for word, nsoll, cycles in steps:
        for _ in range(cycles):
            state, count = rig.channel.state, rig.count
            rig(word, nsoll=nsoll)
            after = rig.channel.state
            assert rig.zsw1 & 0x0047 == STATES[after]
            if rig.count != count:
                assert state in {S4, S5A, S5B}
            if state is S1 and after is not S1:
                assert after is S2
                assert not word & 1
            if after not in {S4, S5A, S5B}:
                assert rig.hertz == 0
            assert abs(rig.hertz) <= 10_000 * (1 + 1e-9)


def test_two_channels_are_needed():
    """A module has two channels, and a channel a watchdog of one cycle at least."""
    with pytest.raises(ConfigurationError, match="channels"):
        PtoModule(VirtualScheduler(), [PtoConfig()])
    with pytest.raises(ConfigurationError, match="watchdog"):
        PtoModule(VirtualScheduler(), [PtoConfig()] * 2, watchdog_cycles=0)
    assert math.isclose(PtoConfig().frequency(3000), 10_000)
