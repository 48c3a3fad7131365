"""Backlash compensation: setpoint operation, follow-up, first motion, settings that change."""

from __future__ import annotations

import pytest

from motion.drives.simulated import SimulatedDrivePort

FULL = 131072
SIZE = 0.2


class Load:
    """What the motor moves, with play between the two: it follows the flank that is touched."""

    def __init__(self, port, play=SIZE):
        self._port = port
        self._play = play
        self.position = 0.0

    @property
    def motor(self):
        return self._port._angle / 6.283185307179586 * 10.0

    def follow(self):
        """At positive motion the load is where the motor is, at negative motion the play ahead of it."""
        self.position = min(max(self.position, self.motor), self.motor + self._play)


def rig_of(make_rig, *, play=SIZE, homed=True, **backlash):
    settings = {"Enable": True, "Size": SIZE, "Velocity": 0.0, **backlash}
    rig = make_rig(
        variables={f"Sensor[1].Backlash.{name}": value for name, value in settings.items()}
        | {"PositioningMonitoring.Window": 0.01, "FollowingError.MinValue": 5.0}
    )
    assert isinstance(rig.port, SimulatedDrivePort)
    rig.load = Load(rig.port, play)
    rig.runtime.after_cycle.append(rig.load.follow)
    rig.enabled()
    if homed:
        move(rig, 5.0)
        rig.until(rig.axis.home(100.0).done)
        rig.origin = rig.load.position - 100.0
    return rig


def move(rig, distance, **inputs):
    rig.until(rig.axis.move_relative(distance, Velocity=50.0, **inputs).done, 20.0)
    rig.run(0.3)


def passing(rig):
    return rig.axis.var("StatusWord2.X2")


class TestSetpoint:
    """Reversals of a controlled axis."""

    @pytest.mark.requirement("CFG-543", "CFG-614")
    def test_without_compensation(self, make_rig):
        """Without it the load misses the position that the axis shows by the backlash."""
        rig = rig_of(make_rig, Enable=False)
        move(rig, -10.0)
        assert rig.axis.var("ActualPosition") == pytest.approx(90.0, abs=0.005)
        assert rig.load.position - rig.origin == pytest.approx(90.0 + SIZE, abs=0.005)

    @pytest.mark.requirement("CFG-554", "CFG-552", "CFG-553", "CFG-544", "CFG-614", "VAR-062", "VAR-152")
    def test_with_compensation(self, make_rig):
        """From 100 back by 10 mm: the motor travels 10.2 mm, the load stands at 90, and X2 is TRUE on the
        first 0.2 mm.
        """
        rig = rig_of(make_rig)
        start = rig.load.motor
        assert not passing(rig)
        ways = []
        rig.runtime.after_cycle.append(lambda: ways.append((passing(rig), start - rig.load.motor)))
        move(rig, -10.0)
        assert start - rig.load.motor == pytest.approx(10.0 + SIZE, abs=0.005)
        assert rig.load.position - rig.origin == pytest.approx(90.0, abs=0.005)
        assert rig.axis.var("ActualPosition") == pytest.approx(90.0, abs=0.005)
        inside = [way for on, way in ways if on]
        assert inside
        assert max(inside) <= SIZE + 0.3
        assert not passing(rig)
        assert all(not on for on, way in ways if way > SIZE + 0.3)

    @pytest.mark.requirement("CFG-555")
    def test_speed_at_the_reversal(self, make_rig):
        """Without precontrol the reversal adds Kv times the size: 20 1/s times 0.2 mm are 4 mm/s."""
        rig = rig_of(make_rig)
        rig.axis.write("PositionControl.Kpc", 0.0)
        rig.run(0.5)
        rig.axis.move_relative(-0.001, Velocity=0.01)
        speeds = []
        for _ in range(20):
            rig.cycles(1)
            speeds.append(abs(rig.axis.var("VelocitySetpoint")))
        assert max(speeds) == pytest.approx(20.0 * SIZE, rel=0.05)

    @pytest.mark.requirement("CFG-556", "CFG-549", "VAR-152")
    def test_velocity(self, make_rig):
        """With 2 mm/s the actual value is adjusted within 0.1 s, with 4 mm/s in half of it."""
        times = []
        for rate in (2.0, 4.0):
            rig = rig_of(make_rig, Velocity=rate)
            rig.axis.write("PositionControl.Kv", 0.001)
            rig.axis.write("PositionControl.Kpc", 0.0)
            rig.run(0.1)
            before = rig.axis.var("ActualPosition")
            rig.axis.move_relative(-0.001, Velocity=0.001)
            shown = []
            for _ in range(60):
                rig.cycles(1)
                shown.append(rig.axis.var("ActualPosition") - before)
            assert shown[-1] == pytest.approx(SIZE, abs=0.002)
            times.append(0.004 * sum(1 for one in shown if 0.001 < one < SIZE - 0.002))
        assert times == pytest.approx([0.1, 0.05], abs=0.012)

    @pytest.mark.requirement("CFG-557", "CFG-614")
    def test_too_large(self, make_rig):
        """A size that is larger than the play lets the load overshoot the target by the excess."""
        rig = rig_of(make_rig, play=0.15)
        move(rig, -10.0)
        assert rig.load.position - rig.origin == pytest.approx(90.0 - 0.05, abs=0.005)

    @pytest.mark.requirement("CFG-559")
    def test_same_direction(self, make_rig):
        """Two jobs in one direction: nothing is compensated, the motor travels the distances."""
        rig = rig_of(make_rig)
        start = rig.load.motor
        seen = []
        rig.runtime.after_cycle.append(lambda: seen.append(passing(rig)))
        move(rig, 10.0)
        move(rig, 10.0)
        assert not any(seen)
        assert rig.load.motor - start == pytest.approx(20.0, abs=0.005)

    @pytest.mark.requirement("CFG-560")
    def test_ten_reversals(self, make_rig):
        """Every reversal is compensated once: after ten of them the load is where it belongs."""
        rig = rig_of(make_rig)
        for number in range(10):
            move(rig, -10.0 if number % 2 == 0 else 10.0)
            assert rig.load.position - rig.origin == pytest.approx(
                90.0 if number % 2 == 0 else 100.0, abs=0.006
            )


class TestFollowing:
    """An axis that is not controlled, moved from outside."""

    def turned(self, rig, distance):
        """Turn the motor by hand; the drive is off."""
        rig.port.turn(distance / 10.0 * 6.283185307179586)
        rig.cycles(2)
        return rig.axis.var("ActualPosition")

    @pytest.mark.requirement("CFG-562", "CFG-563", "CFG-561")
    def test_reversal(self, make_rig):
        """+1.0 mm, then -0.15 mm: the position holds; another -0.25 mm: it has moved by -0.20 mm."""
        rig = rig_of(make_rig)
        rig.until(rig.axis.power(False).off)
        rig.cycles(2)
        at = self.turned(rig, 1.0)
        assert at == pytest.approx(101.0, abs=0.01)
        assert self.turned(rig, -0.15) == pytest.approx(at, abs=1e-4)
        assert passing(rig)
        assert self.turned(rig, -0.25) == pytest.approx(at - 0.20, abs=1e-3)
        assert not passing(rig)


class TestFirstMotion:
    """Before the whole backlash has been passed once."""

    @pytest.mark.requirement("CFG-564", "CFG-565", "VAR-153")
    @pytest.mark.parametrize(("first", "compensated"), [(0.1, False), (5.0, True), (-5.0, True)])
    def test_first_reversal(self, make_rig, first, compensated):
        """After a first motion shorter than the backlash a reversal is not compensated, after a longer one it
        is.
        """
        rig = rig_of(make_rig, homed=False)
        move(rig, first)
        before = rig.load.motor
        back = -3.0 if first > 0.0 else 3.0
        move(rig, back)
        extra = abs(rig.load.motor - before) - 3.0
        assert extra == pytest.approx(SIZE if compensated else 0.0, abs=0.005)

    @pytest.mark.requirement("CFG-551", "CFG-589", "VAR-152")
    @pytest.mark.parametrize(("name", "value"), [("Enable", False), ("Size", 0.3)])
    def test_changed_settings(self, make_rig, name, value):
        """Enable and Size act at once, and the axis has to be homed again; Velocity does not matter for
        that.
        """
        rig = rig_of(make_rig)
        rig.axis.write("Sensor[1].Backlash.Velocity", 3.0)
        rig.cycles(3)
        assert rig.axis.var("StatusWord.X5") is True
        rig.axis.write(f"Sensor[1].Backlash.{name}", value)
        rig.cycles(3)
        assert rig.axis.var("StatusWord.X5") is False

    @pytest.mark.requirement("CFG-574")
    def test_measuring_the_backlash(self, make_rig):
        """The procedure with compensation off: to A, on, back to the same shown value: the load differs by
        the backlash.
        """
        rig = rig_of(make_rig, Enable=False)
        move(rig, 10.0)
        shown, a = rig.axis.var("ActualPosition"), rig.load.position
        move(rig, 1.0)
        rig.until(rig.axis.move_absolute(shown).done, 10.0)
        rig.run(0.3)
        assert rig.axis.var("ActualPosition") == pytest.approx(shown, abs=0.002)
        assert abs(a - rig.load.position) == pytest.approx(SIZE, abs=0.005)


@pytest.mark.requirement("LIM-098")
def test_a_gap_of_the_encoder_adds_nothing(make_rig):
    """While no value comes the position stays where it was, compensation included, and it is there
    afterwards.
    """
    rig = rig_of(make_rig)
    move(rig, 20.0)
    move(rig, -10.0)
    before = rig.axis.var("ActualPosition")
    assert rig.axis.feedback.compensation
    rig.port.link = False
    for _ in range(20):
        rig.cycles(1)
        assert rig.axis.var("ActualPosition") == before
    rig.port.link = True
    rig.cycles(3)
    assert rig.axis.var("ActualPosition") == pytest.approx(before, abs=0.001)
