"""The sequence of a two-speed axis: bytes, states and times of the examples of the specification."""

import pytest

from motion.nc.parameters import ParameterSet
from motion.nc.two_speed import TwoSpeed

T = 0.01
FAST, SLOW = 200.0, 20.0
BYTES = {0x80: 0x80, 0x40: 0x40, 0x41: 0x49, 0x42: 0x45, 0x44: 0x46, 0x48: 0x4A}
VELOCITY = {0x41: -FAST, 0x42: -SLOW, 0x44: SLOW, 0x48: FAST}
VALUES = {
    "creep_distance_pos": 100.0,
    "creep_distance_neg": 80.0,
    "braking_distance_pos": 10.0,
    "braking_distance_neg": 8.0,
    "brake_delay_pos": 0.2,
    "brake_delay_neg": 0.3,
    "delay_fast_to_slow": 0.15,
    "creep_distance_stop": 20.0,
    "brake_release_delay": 0.1,
}


class Axis:
    """A sequence and a machine that has the commanded speed at once."""

    def __init__(self, position=0.0, **values):
        given = {**VALUES, **values}
        self.sequence = TwoSpeed(
            ParameterSet({f"drv.{key}": value for key, value in given.items()}), cycle_s=T
        )
        self.position = position
        self.override = 100.0
        self.rows = []
        """(byte, state, position, cycle) whenever byte or state change."""
        self.cycle = 0

    def start(self, target, velocity=100.0):
        error = self.sequence.start(self.position, target, velocity)
        self.note()
        return error

    def note(self):
        sequence = self.sequence
        row = (sequence.control_byte, sequence.state)
        assert sequence.ext_control_byte == BYTES[row[0]]
        assert sequence.image == bytes(8) + bytes((row[0], BYTES[row[0]], 0, 0))
        if not self.rows or self.rows[-1][:2] != row:
            self.rows.append((*row, self.position, self.cycle))

    def run(self, cycles=None):
        for _ in range(cycles or 20000):
            self.cycle += 1
            self.position += VELOCITY.get(self.sequence.control_byte, 0.0) * T
            self.sequence.step(self.position, self.override)
            self.note()
            if cycles is None and self.sequence.state == 0:
                return self
        assert cycles is not None, "the sequence does not end"
        return self

    @property
    def steps(self):
        return [row[:2] for row in self.rows]

    def times(self):
        return [(row[3] - self.rows[0][3]) * T for row in self.rows]


@pytest.mark.requirement(*(f"NC-{number}" for number in (*range(619, 649), 652, *range(654, 664), 606, 609)))
def test_example_1(subtests):
    """A to B in both directions: brake, fast, pause, slow, delay, brake, at their distances and times."""
    for sign, fast, slow, creep, braking, delay in (
        (1.0, 0x48, 0x44, 100.0, 10.0, 0.2),
        (-1.0, 0x41, 0x42, 80.0, 8.0, 0.3),
    ):
        for pulse in (0.0, 5.0):
            with subtests.test(sign=sign, pulse=pulse):
                axis = Axis(pulse_time_pos=pulse, pulse_time_neg=pulse)
                assert axis.sequence.control_byte == 0x80
                assert axis.start(sign * 1000.0) == 0
                axis.run()
                assert axis.steps == [
                    (0x40, 21), (fast, 21), (0x40, 22), (slow, 23), (0x40, 24), (0x80, 0),
                ]  # fmt: skip
                times = axis.times()
                assert times[1] == pytest.approx(0.1)
                assert times[3] - times[2] == pytest.approx(0.15)
                assert times[5] - times[4] == pytest.approx(delay)
                assert axis.rows[2][2] == pytest.approx(sign * (1000.0 - creep), abs=1e-6)
                assert axis.rows[4][2] == pytest.approx(sign * (1000.0 - braking), abs=1e-6)


@pytest.mark.requirement("NC-610", "NC-611", "NC-612", "NC-613", "NC-614", "NC-616")
def test_speeds(subtests):
    """Fast needs a velocity above 50 and an override above 50 %; no velocity is an error."""
    for velocity, override, fast in (
        (50.1, 100.0, True),
        (50.0, 100.0, False),
        (0.1, 100.0, False),
        (100.0, 50.1, True),
        (100.0, 50.0, False),
        (100.0, 0.01, False),
        (50.0, 50.0, False),
    ):
        with subtests.test(velocity=velocity, override=override):
            axis = Axis()
            axis.override = override
            assert axis.start(1000.0, velocity) == 0
            axis.run(15)
            assert axis.steps[-1] == (0x48 if fast else 0x44, 21)
    for velocity in (0.0, -1.0):
        axis = Axis()
        assert axis.start(1000.0, velocity) == 0x4359
        axis.run(50)
        assert axis.steps == [(0x80, 0)]


@pytest.mark.requirement("NC-608")
def test_short_way():
    """A way up to the braking distance of its direction does not start; a longer one does."""
    for way, starts in ((10.0, False), (10.001, True), (-8.0, False), (-8.001, True), (0.0, False)):
        axis = Axis()
        assert axis.start(way) == 0
        axis.run(3)
        assert (axis.sequence.state != 0) is starts
        assert axis.sequence.braked is not starts


@pytest.mark.requirement("NC-615", "NC-617", "NC-653")
def test_override_zero():
    """In the main phase the axis stands with the brake on after its delay; resumes with what holds then."""
    axis = Axis()
    axis.start(1000.0)
    axis.run(100)
    axis.override = 0.009
    axis.run(60)
    axis.override = 40.0
    axis.run(40)
    assert axis.steps == [
        (0x40, 21), (0x48, 21), (0x40, 20), (0x80, 20), (0x40, 21), (0x44, 21),
    ]  # fmt: skip
    times = axis.times()
    assert times[3] - times[2] == pytest.approx(0.2)
    assert times[5] - times[4] == pytest.approx(0.1)
    axis.run()
    assert axis.steps[-1] == (0x80, 0)
    assert axis.position == pytest.approx(990.0, abs=0.3)


@pytest.mark.requirement("NC-618")
def test_override_zero_while_braking():
    """A braking phase that has begun is not influenced."""
    plain = Axis()
    plain.start(1000.0)
    plain.run()
    for index in (2, 3, 4):
        axis = Axis()
        axis.start(1000.0)
        axis.run(plain.rows[index][3] + 1)
        axis.override = 0.0
        axis.run()
        assert axis.rows == plain.rows


@pytest.mark.requirement("NC-664", "NC-666")
def test_slow_start():
    """Within the creep distance, or with slow travel before it, there is no pause."""
    axis = Axis()
    axis.start(60.0)
    axis.run()
    assert axis.steps == [(0x40, 21), (0x44, 23), (0x40, 24), (0x80, 0)]
    axis = Axis()
    axis.override = 50.0
    axis.start(300.0)
    axis.run()
    assert axis.steps == [(0x40, 21), (0x44, 21), (0x44, 23), (0x40, 24), (0x80, 0)]
    assert axis.rows[2][2] == pytest.approx(200.0, abs=0.3)


@pytest.mark.requirement("NC-665", "NC-787")
def test_braking_distance_passed_in_the_pause():
    """Slow travel is skipped when the way is used up in the pause."""
    axis = Axis()
    axis.start(300.0)
    while axis.sequence.state != 22:
        axis.run(1)
    axis.position = 295.0
    axis.run()
    assert axis.steps[-3:] == [(0x40, 22), (0x40, 24), (0x80, 0)]


@pytest.mark.requirement("NC-649", "NC-650", "NC-667", "NC-668", "NC-669", "NC-670", "NC-671")
def test_looping(subtests):
    """With a looping distance the target is approached from one side; creep refers to the reversal."""
    legs = {1: (0x48, 0x44, 100.0, 10.0, 0.2), -1: (0x41, 0x42, 80.0, 8.0, 0.3)}
    for loop in (30.0, -30.0):
        for start, target in ((0.0, 1000.0), (1000.0, 0.0)):
            with subtests.test(loop=loop, target=target):
                axis = Axis(start, looping_enable=True, looping_distance=loop)
                axis.start(target)
                axis.run()
                direction = 1 if target > start else -1
                fast, slow, creep, braking, delay = legs[direction]
                steps = [(0x40, 21), (fast, 21), (0x40, 22), (slow, 23), (0x40, 24)]
                if loop * direction < 0.0:
                    assert axis.steps == [*steps, (0x80, 0)]
                    assert axis.rows[2][2] == pytest.approx(target - direction * creep, abs=1e-6)
                    continue
                _, back, _, back_braking, _ = legs[-direction]
                assert axis.steps == [*steps, (back, 23), (0x40, 24), (0x80, 0)]
                assert axis.rows[2][2] == pytest.approx(target + loop - direction * creep, abs=1e-6)
                assert axis.rows[4][2] == pytest.approx(target + loop - direction * braking, abs=1e-6)
                assert axis.times()[5] - axis.times()[4] == pytest.approx(delay)
                assert axis.rows[6][2] == pytest.approx(target + direction * back_braking, abs=0.21)
    axis = Axis(looping_enable=False, looping_distance=30.0)
    axis.start(1000.0)
    axis.run()
    assert len(axis.steps) == 6


@pytest.mark.requirement("NC-651", "NC-738")
def test_looping_distance_too_small():
    """A looping distance below the braking distance is an error at the start."""
    for loop, error in ((9.9, 0x435E), (-9.9, 0x435E), (10.0, 0)):
        axis = Axis(looping_enable=True, looping_distance=loop)
        assert axis.start(1000.0) == error


@pytest.mark.requirement("NC-673", "NC-674", "NC-675", "NC-645")
def test_stop_in_fast_travel(subtests):
    """A stop goes through pause, creep for its distance and brake, in the direction of travel, without
    looping.
    """
    for sign, slow in ((1.0, 0x44), (-1.0, 0x42)):
        with subtests.test(sign=sign):
            axis = Axis(looping_enable=True, looping_distance=sign * 30.0)
            axis.start(sign * 1000.0)
            axis.run(100)
            axis.sequence.stop(axis.position)
            axis.note()
            at = axis.position
            axis.run()
            assert axis.steps[2:] == [(0x40, 22), (slow, 23), (0x40, 24), (0x80, 0)]
            times = axis.times()
            assert times[3] - times[2] == pytest.approx(0.15)
            assert (axis.position - at) * sign == pytest.approx(20.0, abs=0.21)


@pytest.mark.requirement("NC-676")
def test_stop_in_slow_travel():
    """The creep distance of a stop counts from the call; the normal end wins where it is nearer."""
    for before, way in ((500.0, 20.0), (975.0, 15.0)):
        axis = Axis()
        axis.override = 50.0
        axis.start(1000.0)
        while axis.position < before:
            axis.run(1)
        at = axis.position
        axis.sequence.stop(at)
        axis.note()
        axis.run()
        assert axis.steps[-3:] == [(0x44, 23), (0x40, 24), (0x80, 0)]
        assert axis.position - at == pytest.approx(way, abs=0.3)


@pytest.mark.requirement("NC-636")
def test_bytes_belong_together():
    """One speed bit at most, complementary brake bits, in every cycle of every sequence."""
    for loop in (False, True):
        for cycles in range(0, 900, 30):
            axis = Axis(looping_enable=loop, looping_distance=30.0)
            axis.start(300.0)
            for cycle in range(900):
                axis.override = 0.0 if cycles <= cycle < cycles + 10 else 100.0
                axis.run(1)
                byte = axis.sequence.control_byte
                assert (byte & 0x0F).bit_count() <= 1
                assert (byte >> 6) in {1, 2}
                assert axis.sequence.ext_control_byte >> 6 == byte >> 6
