"""External setpoints and the fast axis stop."""

from itertools import pairwise

import pytest

from testcases.unit.motion_nc.nc_rig import Rig, T

pytestmark = pytest.mark.exhaustive


class Feeder:
    """A PLC program that writes a packet in every cycle."""

    def __init__(self, rig, packets):
        self.rig, self.packets, self.at = rig, packets, 0
        rig.runtime.call(self)

    def __call__(self):
        if self.at < len(self.packets):
            written = self.rig.ref.PlcToNc
            written.ExtSetPos, written.ExtSetVelo, written.ExtSetDirection = self.packets[self.at]
            self.at += 1


def _packets(cycles, velocity=100.0, start=0.0):
    return [(start + velocity * T * (number + 1), velocity, 1) for number in range(cycles)]


def _enable(rig, position=0.0, start_type=1):
    block = rig.handle.external_enable(position, start_type=start_type)
    rig.until(block.ended)
    return block.ErrorID


@pytest.mark.requirement("NC-565", "NC-566", "NC-579", "NC-580", "NC-584")
def test_feeding():
    """Packets with a direction are the setpoints, absolute or from the position of the start; others are
    ignored; the target alone moves nothing and arms the windows.
    """
    for start_type, base in ((1, 0.0), (2, 50.0)):
        rig = Rig().enabled()
        rig.until(rig.handle.move_absolute(50.0, Velocity=200.0).done)
        start = 50.0 if start_type == 1 else 0.0
        rig.ref.PlcToNc.ExtSetPos = start
        target = 60.0 if start_type == 1 else 10.0
        assert _enable(rig, target, start_type) == 0
        rig.cycles(5)
        assert rig.status("ExtSetPointGenEnabled")
        assert rig.axis.motion.s == 50.0
        assert not rig.status("InPositionArea")
        Feeder(rig, [(999.0, 1.0, 0)] * 5 + _packets(50, start=start) + [(60.0 - base, 0.0, 1)] * 3)
        rig.cycles(20)
        assert rig.axis.motion.s == pytest.approx(50.0 + 14 * 0.2, abs=0.41)
        assert rig.axis.motion.v == 100.0
        rig.cycles(100)
        assert rig.axis.motion.s == pytest.approx(60.0)
        assert rig.axis.position == pytest.approx(60.0, abs=0.1)
        assert rig.status("InTargetPosition")


@pytest.mark.requirement("NC-567", "NC-568", "NC-569", "NC-570")
def test_preconditions(subtests):
    """An axis with an error, without an enable, without its drive, or coupled refuses external setpoints."""
    for reason in ("error", "enable", "plus", "minus", "drive", "coupled"):
        with subtests.test(reason):
            rig = Rig().enabled()
            other = Rig(with_=rig)
            other.enabled()
            if reason == "error":
                rig.axis.raise_error(0x4550)
            elif reason == "enable":
                rig.handle.power(False)
            elif reason in {"plus", "minus"}:
                rig.handle.power(positive=reason != "plus", negative=reason != "minus")
            elif reason == "drive":
                rig.handle.power(False)
                rig.cycles(3)
                rig.device.write = lambda outputs: None  # it does not come into operation
                rig.device.operating = False
                rig.handle.power()
            else:
                rig.until(rig.handle.gear_in(other.handle).in_gear)
            rig.cycles(3)
            code = _enable(rig)
            assert code != 0
            assert (code == 0x4650) is (reason == "drive")
            rig.cycles()
            assert not rig.status("ExtSetPointGenEnabled")
            if reason == "coupled":
                rig.until(rig.handle.gear_out().done)
                assert _enable(rig) == 0


@pytest.mark.requirement("NC-571", "NC-572", "NC-785")
def test_disabled_by_events(subtests):
    """An error, a reset and a toggle of the enable end it."""
    for reason in ("error", "reset", "enable"):
        with subtests.test(reason):
            rig = Rig().enabled()
            assert _enable(rig) == 0
            Feeder(rig, _packets(2000))
            rig.cycles(20)
            if reason == "error":
                rig.axis.raise_error(0x4550)
            elif reason == "reset":
                rig.handle.reset()
            else:
                rig.handle.power(False)
                rig.cycles(3)
                rig.handle.power(True)
            rig.cycles(5)
            assert not rig.status("ExtSetPointGenEnabled")
            at = rig.axis.motion.s
            rig.cycles(20)
            assert rig.axis.motion.s == pytest.approx(at, abs=0.01)


@pytest.mark.requirement("NC-573", "NC-574", "NC-576", "NC-577", "NC-578", "NC-784")
def test_types():
    """With a positioning only the relative type is allowed; again with the same type is a new target, with
    another one an error that leaves the generation alone; ending what does not run is an error.
    """
    for start_type in (1, 2):
        rig = Rig().enabled()
        assert _enable(rig, 5.0, start_type) == 0
        assert _enable(rig, 7.0, start_type) == 0
        assert rig.axis.motion.target == 7.0
        assert _enable(rig, 9.0, 3 - start_type) == 0x42E2
        rig.cycles()
        assert rig.status("ExtSetPointGenEnabled")
        assert rig.axis.motion.target == 7.0
    rig = Rig().enabled()
    move = rig.handle.move_absolute(100.0, Velocity=20.0)
    rig.cycles(50)
    assert _enable(rig, 5.0, 1) != 0
    rig.cycles()
    assert not rig.status("ExtSetPointGenEnabled")
    assert _enable(rig, 5.0, 2) == 0
    before = rig.axis.motion.s
    rig.ref.PlcToNc.ExtSetPos, rig.ref.PlcToNc.ExtSetDirection = 3.0, 1
    rig.cycles(2)
    assert rig.axis.motion.s == pytest.approx(before + 3.0, abs=0.1)
    assert move.Busy
    rig = Rig().enabled()
    block = rig.handle.external_disable()
    rig.until(block.ended)
    assert block.ErrorID == 0x42E3


@pytest.mark.requirement("NC-575", "NC-203")
def test_commands_on_top():
    """A positioning is refused while external setpoints run, unless the axis allows it; then it ends them."""
    for allowed in (False, True):
        rig = Rig(axis__allow_commands_ext_setpoint=allowed).enabled()
        assert _enable(rig) == 0
        move = rig.handle.move_absolute(10.0, Velocity=50.0)
        rig.cycles(3)
        assert move.ErrorID == (0 if allowed else 0x42E2)
        assert rig.status("ExtSetPointGenEnabled") is not allowed
        if allowed:
            rig.until(move.done)


@pytest.mark.requirement("NC-581", "NC-582", "NC-583")
def test_last_packet():
    """When the direction falls to 0, or at the end, one more packet is taken; without it the last one may
    be lost.
    """
    rig = Rig().enabled()
    assert _enable(rig) == 0
    Feeder(rig, [(1.0, 0.0, 1), (2.0, 0.0, 0), (3.0, 0.0, 0), (4.0, 0.0, 0)])
    rig.cycles(10)
    assert rig.axis.motion.s == 2.0
    assert rig.axis.external.packets == 2
    rig.ref.PlcToNc.ExtSetPos = 2.5
    rig.cycles(3)
    assert rig.axis.motion.s == 2.0
    rig.until(rig.handle.external_disable().done)
    rig.cycles(1)
    assert rig.axis.motion.s == 2.5
    assert not rig.status("ExtSetPointGenEnabled")
    rig.ref.PlcToNc.ExtSetPos = 3.0
    rig.cycles(5)
    assert rig.axis.motion.s == 2.5
    assert rig.axis.external.packets == 3


@pytest.mark.requirement(
    "NC-109", *(f"NC-{number}" for number in range(114, 120)), "NC-121", "NC-774", "NC-113"
)
def test_signal_types(subtests):
    """Edges stop once, levels for as long as they are there; the state at the start is no edge."""
    table = {  # stop at 0 -> 1, at 1 -> 0, at constant 0, at constant 1
        "OFF (default)": (False, False, False, False),
        "Rising Edge": (True, False, False, False),
        "Falling Edge": (False, True, False, False),
        "Both Edges": (True, True, False, False),
        "High Active": (True, False, False, True),
        "Low Active": (False, True, True, False),
    }
    for kind, (rising, falling, low, high) in table.items():
        with subtests.test(kind):
            for first, then, stops in (
                (False, True, rising),
                (True, False, falling),
                (False, False, low),
                (True, True, high),
            ):
                rig = Rig(axis__fast_axis_stop_signal_type=kind)
                rig.device.fast_stop = first
                rig.enabled()
                move = rig.handle.move_velocity(100.0)
                rig.cycles(60)
                level = (kind == "High Active" and first) or (kind == "Low Active" and not first)
                assert move.Error is level
                assert any(rig.history.select(kind="axis.fast_stop")) is level
                if level:
                    assert move.ErrorID == 0x42EF
                    assert rig.axis.motion.s == 0.0
                    continue
                assert rig.generator.v > 0.0
                rig.device.fast_stop = then
                rig.cycles(400)
                assert (rig.generator.v == 0.0) is stops
                again = rig.handle.move_velocity(100.0)
                rig.cycles(3)
                held = (kind == "High Active" and then) or (kind == "Low Active" and not then)
                assert again.Error is held


@pytest.mark.requirement("NC-110", "NC-111", "NC-112", "NC-122")
def test_fast_dynamics():
    """The stop has its own deceleration and jerk, or the defaults; it ends without an error and aborts the
    command.
    """
    for values, deceleration, jerk in (
        ({"axis__fast_deceleration": 8000.0, "axis__fast_jerk": 1e6}, 8000.0, 1e6),
        ({"axis__fast_jerk": 1e6}, 1500.0, 1e6),
        ({"axis__fast_deceleration": 8000.0}, 8000.0, 2250.0),
    ):
        rig = Rig(axis__fast_axis_stop_signal_type="Rising Edge", **values).enabled()
        move = rig.handle.move_velocity(1000.0, Acceleration=9000.0, Jerk=1e6)
        rig.until(move.in_velocity)
        rig.device.fast_stop = True
        steepest = fastest = last = 0.0
        for _ in range(1000):
            rig.cycles()
            a = rig.generator.a
            steepest, fastest, last = min(steepest, a), max(fastest, abs(a - last) / T), a
        assert steepest >= -deceleration - 1e-6
        assert steepest == pytest.approx(-deceleration, rel=1e-6) or jerk < 1e5
        assert fastest <= jerk + 1e-3
        assert fastest >= 0.9 * min(jerk, deceleration / T)
        assert rig.generator.v == 0.0
        assert move.CommandAborted
        assert not rig.axis.error
        rig.until(rig.handle.move_relative(5.0, Velocity=50.0).done)


@pytest.mark.requirement("NC-035")
def test_a_stop_brakes_external_setpoints(subtests):
    """Whatever stops an axis that the PLC leads ends the generation, and brakes from its velocity on its
    ramp.
    """

    def stop(rig):
        rig.handle.stop(Deceleration=500.0, Jerk=1e6)

    def feed(rig):
        rig.handle.power(positive=False)

    def fast(rig):
        rig.device.fast_stop = True

    for how, deceleration in ((stop, 500.0), (feed, 400.0), (fast, 300.0)):
        with subtests.test(how.__name__):
            rig = Rig(
                axis__fast_axis_stop_signal_type="Rising Edge",
                axis__fast_deceleration=300.0,
                axis__fast_jerk=1e6,
                axis__default_deceleration=400.0,
                axis__default_jerk=1e6,
            ).enabled()
            rig.handle.external_enable(0.0)
            rig.cycles(2)
            packet = rig.ref.PlcToNc

            def write(packet=packet):
                packet.ExtSetVelo, packet.ExtSetDirection = 100.0, 1
                packet.ExtSetPos += 100.0 * T

            rig.runtime.call(write)
            rig.cycles(100)
            assert rig.axis.motion.v == 100.0
            how(rig)
            velocities = []
            for _ in range(300):
                rig.cycles()
                velocities.append(rig.axis.motion.v)
            steepest = max(a - b for a, b in pairwise(velocities)) / T
            assert steepest == pytest.approx(deceleration, rel=0.01)
            assert velocities[-1] == 0.0
            assert not rig.status("ExtSetPointGenEnabled")
            assert not rig.axis.error
