"""Positions after days of travel: to the increment, by integers, over any number of overflows of the counter
(§5.10.7).
"""

from __future__ import annotations

from fractions import Fraction
from math import floor

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from motion.kernel.feedback import VALID
from motion.s7.axis import PositioningAxis
from motion.s7.units import farthest_position, travel_time_s
from motion.setpoint import SetpointGenerator
from testcases.unit.motion_axis.conftest import REFERENCE, Rig, SimulatedDrivePort

ROTARY = {
    "Properties.MotionType": 1,
    "Units.LengthUnit": 1005,
    "Units.VelocityUnit": 1521,
    "Modulo.Enable": True,
    "Modulo.Length": 360.0,
    "Modulo.StartValue": 0.0,
}


class CountingPort(SimulatedDrivePort):
    """A drive whose encoder shows a count of the test, cut to its width as the telegram has it."""

    __slots__ = ("bits", "signed", "total")

    def __init__(self, bits=32, *, signed=True, total=0):
        super().__init__(cycle_s=0.004)
        self.bits, self.signed, self.total = bits, signed, total

    def read(self):
        super().read()
        full = 1 << self.bits
        self.encoder_increments = (
            (self.total + full // 2) % full - full // 2 if self.signed else self.total % full
        )


def object_with(port, **variables):
    """A technology object whose inputs are read by hand: nothing moves it but the count."""
    start = {
        name: value for name, value in REFERENCE.items() if "Limits" not in name and "Defaults" not in name
    }
    axis = PositioningAxis("axis1", port, cycle_ns=4_000_000, variables=start | variables)
    for _ in range(3):
        axis.cycle()
    return axis


def gear(motor, load):
    return {"LoadGear.Numerator": motor, "LoadGear.Denominator": load}


def counted(axis):
    """Return the position that the data block shows, exactly, axis unit, from its cycle and its place."""
    length = Fraction(repr(axis.var("Modulo.Length")))
    return axis.var("ActualModuloCycle") * length + Fraction(axis.var("ActualPosition"))


FORMATS = {
    "telegram 3, 2048 lines, fine 11": (
        32,
        {"Sensor[1].Parameter.StepsPerRevolution": 2048, "Sensor[1].Parameter.FineResolutionXist1": 11},
    ),
    "telegram 83, 23 bit": (32, {"Sensor[1].Parameter.StepsPerRevolution": 1 << 23}),
    "CiA 402, 17 bit": (32, {"Sensor[1].Parameter.StepsPerRevolution": 131072}),
    "odd lines": (
        32,
        {"Sensor[1].Parameter.StepsPerRevolution": 3600, "Sensor[1].Parameter.FineResolutionXist1": 2},
    ),
    "gear 7 : 3": (
        32,
        {"Sensor[1].Parameter.StepsPerRevolution": 2048, "Sensor[1].Parameter.FineResolutionXist1": 11}
        | gear(7, 3),
    ),
    "gear 97 : 13": (32, {"Sensor[1].Parameter.StepsPerRevolution": 5000} | gear(97, 13)),
    "width of the encoder": (
        22,
        {
            "Sensor[1].Parameter.StepsPerRevolution": 2048,
            "Sensor[1].Parameter.FineResolutionXist1": 11,
            "Sensor[1].Parameter.BehaviorGx_XIST1": 0,
        },
    ),
    "width of a multi-turn encoder": (
        28,
        {
            "Sensor[1].Parameter.StepsPerRevolution": 65536,
            "Sensor[1].Parameter.DeterminableRevolutions": 4096,
            "Sensor[1].Type": 1,
            "Sensor[1].Parameter.BehaviorGx_XIST1": 0,
        },
    ),
}


@pytest.mark.requirement("LIM-098", "LIM-102")
@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize("name", FORMATS)
def test_a_thousand_million_revolutions(name, direction):
    """The counter overflows in every second reading; behind 10^9 revolutions the position is that of the
    count, to the increment.
    """
    bits, parameters = FORMATS[name]
    port = CountingPort(bits)
    axis = object_with(port, **ROTARY | parameters)
    feedback = axis.feedback
    increment = feedback.scale.exact_increment
    assert increment * feedback.scale.fine * parameters["Sensor[1].Parameter.StepsPerRevolution"] == Fraction(
        360
    ) / (Fraction(parameters.get("LoadGear.Numerator", 1), parameters.get("LoadGear.Denominator", 1)))
    revolutions = 10**9
    way = int(revolutions * 360 / increment)
    step = (1 << (feedback.scale.bits - 1)) - 7
    readings = min(2000, way // step)
    for _ in range(readings):
        port.total += direction * step
        port.read()
        feedback.update()
    # The rest of the way as one leap of the test, of which the counter shows whole overflows: the count is an
    # integer of any length.
    leap = (way // (1 << feedback.scale.bits) - readings) * (1 << feedback.scale.bits)
    if leap > 0:
        feedback._count += direction * leap
        port.total += direction * leap
    port.total += direction * 12345
    port.read()
    feedback.update()
    assert feedback.state == VALID
    expected = port.total * increment
    assert abs(expected) > 0.5 * revolutions * 360
    deviation = (counted(axis) - expected) / increment
    assert abs(deviation) < Fraction(1, 1000)  # nothing but the place as an LREAL
    assert axis.var("ActualModuloCycle") == floor(expected / 360)


@pytest.mark.exhaustive
@pytest.mark.requirement("LIM-098", "LIM-102")
@settings(max_examples=60)
@given(
    steps=st.integers(2, 1 << 23), motor=st.integers(1, 1000), load=st.integers(1, 1000),
    length=st.sampled_from([360.0, 0.1, 1.0, 7.3, 1e6]), start=st.sampled_from([0.0, -180.0, 12.345]),
    ways=st.lists(st.integers(-(2**31) + 1, 2**31 - 1), max_size=20), turns=st.integers(-(10**12), 10**12),
)  # fmt: skip
def test_any_gear_and_any_way(steps, motor, load, length, start, ways, turns):
    """Whatever gear, range and way: cycle and place are those of the integer count."""
    port = CountingPort()
    axis = object_with(
        port,
        **ROTARY
        | gear(motor, load)
        | {
            "Sensor[1].Parameter.StepsPerRevolution": steps,
            "Modulo.Length": length,
            "Modulo.StartValue": start,
        },
    )
    feedback = axis.feedback
    for way in ways:
        port.total += way
        port.read()
        feedback.update()
    feedback._count += turns << 32
    port.total += turns << 32
    exact = port.total * Fraction(360) * Fraction(load, motor) / steps
    shown = Fraction(axis.var("ActualPosition"))
    inside = exact - axis.var("ActualModuloCycle") * Fraction(repr(length))
    assert abs(shown - inside) <= Fraction(length) / 10**9
    assert start <= float(shown) <= start + length


@pytest.mark.exhaustive
@pytest.mark.requirement("LIM-098")
def test_the_time_of_a_long_motion_is_counted():
    """Many cycles with constant velocity: the setpoint is velocity times time, and no sum of as many
    roundings.
    """
    gen = SetpointGenerator()
    gen.set_state(0.0, 431.7)
    for _ in range(300_000):
        gen.advance(0.004)
    exact = Fraction(431.7) * 300_000 * Fraction(0.004)
    assert abs(Fraction(gen.s) - exact) < Fraction(1, 10**9)
    ahead = gen.peek(0.004)
    gen.advance(0.004)
    assert ahead == (gen.s, gen.v, gen.a)


@pytest.mark.requirement("LIM-099", "LIM-100")
def test_largest_position_and_travel_time():
    """9.0E12, with six decimals 9.0E9; at 20 m/min 4.5E8 minutes, with six decimals 4.5E5; twice as fast half
    of it.
    """
    mm, mm_fine = 1013, 1536
    assert (farthest_position(mm), farthest_position(mm_fine)) == (9.0e12, 9.0e9)
    velocity = 20_000.0 / 60.0
    assert travel_time_s(velocity, mm) / 60.0 == pytest.approx(4.5e8)
    assert travel_time_s(velocity, mm_fine) / 60.0 == pytest.approx(4.5e5)
    assert travel_time_s(2.0 * velocity, mm) / 60.0 == pytest.approx(2.25e8)


def travelled(position, *, kind=0):
    """An enabled rig that has travelled to `position`, at rest there, with the following error not
    watched.
    """
    rig = Rig(variables={"FollowingError.EnableMonitoring": False, "Sensor[1].Type": kind})
    rig.cycles(3)
    feedback = rig.axis.feedback
    feedback._count += round(Fraction(position) / feedback.scale.exact_increment)
    feedback.update()
    rig.enabled()
    return rig


@pytest.mark.requirement("LIM-101", "LIM-103")
def test_homing_begins_the_travel_again():
    """At the largest position 307 stops the axis; homed again to 0 it travels on, and its steps are
    increments again.
    """
    rig = travelled(9.0e12)
    job = rig.axis.move_velocity(100.0)
    rig.until(lambda: rig.axis.var("ErrorDetail.Number") == 307)
    assert job.Error
    rig.run(1.0)
    rig.axis.home(0.0)
    rig.cycles(2)
    rig.until(rig.axis.reset().done)
    rig.until(rig.axis.power_instance.status)
    rig.until(rig.axis.move_relative(20.0).done)
    feedback = rig.axis.feedback
    moved = rig.port.encoder_increments
    before = feedback.position
    rig.port.turn(3 * 6.283185307179586 / 131072)
    rig.axis.power(False)
    rig.cycles(1)
    counts = rig.port.encoder_increments - moved
    assert feedback.position - before == pytest.approx(counts * feedback.scale.increment, abs=1e-12)
    assert rig.axis.var("ErrorDetail.Number") == 0


@pytest.mark.requirement("LIM-101")
def test_adjusting_begins_the_travel_again():
    """An absolute encoder: adjusted with the position that is known, the axis travels on, and the offset is
    kept.
    """
    rig = travelled(9.0e12, kind=1)
    rig.axis.move_velocity(100.0)
    rig.until(lambda: rig.axis.var("ErrorDetail.Number") == 307)
    rig.run(1.0)
    rig.axis.home(25.0, mode=7)
    rig.cycles(2)
    rig.until(rig.axis.reset().done)
    rig.until(rig.axis.power_instance.status)
    assert rig.axis.var("ActualPosition") == pytest.approx(25.0, abs=0.01)
    rig.until(rig.axis.move_relative(20.0).done)
    assert rig.axis.var("ActualPosition") == pytest.approx(45.0, abs=0.01)
    assert rig.axis.var("StatusSensor[1].Adjusted") == 1


@pytest.mark.requirement("LIM-102")
@pytest.mark.parametrize("kind", [0, 1])
def test_many_shifts_leave_nothing_behind(kind):
    """A shift there and back again, over and over, with numbers that have no binary form: the position is
    where it was.
    """
    port = CountingPort(total=123_456)
    axis = object_with(port, **{"Sensor[1].Type": kind})
    feedback = axis.feedback
    before = feedback.position
    for _ in range(100_000):
        feedback.shift(0.1)
        feedback.shift(-0.1)
    feedback.update()
    assert feedback.position == pytest.approx(before, abs=1e-9)
