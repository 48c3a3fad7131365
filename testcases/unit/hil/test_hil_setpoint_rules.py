"""Rules about setpoints and MC_Power that judge every run: silent on real runs, loud on the smallest seeded
defect.
"""

import numpy as np
import pytest

from hil.bench import load_bench
from hil.expect._setpoint_rules import (
    check_acceleration_setpoint,
    check_position_continuity,
    check_stop_travel,
)
from hil.expect.checkers import check_status_words
from hil.record import Trace
from reports.model import Verdict
from testcases.unit.hil.test_hil_checkers import doctored

STOPS = {
    "emergency": lambda axis: axis.power(False, stop_mode=0),
    "maximum": lambda axis: axis.power(False, stop_mode=2),
    "reaction 3": lambda axis: axis.object.alarms.raise_alarm(304, reaction=3),
    "reaction 2": lambda axis: axis.object.alarms.raise_alarm(104, reaction=2),
}


def stopped(stop, velocity=300.0):
    with load_bench("reference").build() as bench:
        axis = bench.axis()
        power = axis.power()
        assert bench.run_until(power.status, 2.0)
        axis.move_velocity(velocity)
        bench.run_for(0.8)
        STOPS[stop](axis)
        bench.run_for(0.6)
        return bench.trace()


@pytest.fixture(scope="module")
def trace():
    """An emergency stop from 300 mm/s on the reference bench."""
    return stopped("emergency")


def only(checks):
    (check,) = checks
    return check


def begin_of(trace, state="DISABLING_RAMP"):
    return next(e.time_ns for e in trace.select(kind="axis.state") if e.data["to"] == state) * 1e-9


@pytest.mark.exhaustive
@pytest.mark.requirement("MC-568")
def test_a_position_setpoint_that_jumps_is_found(trace):
    """A step that the velocity does not explain is found: one beyond v * T and the tolerance fails, one
    within passes.
    """
    good = only(check_position_continuity(trace))
    assert good.verdict is Verdict.PASSED
    # At 300 mm/s a cycle of 4 ms goes 1.2 mm; the greatest acceleration of 4000 mm/s2 adds 0.064 mm.
    for step, verdict in ((0.06, Verdict.PASSED), (0.07, Verdict.FAILED), (-3.0, Verdict.FAILED)):
        moved = doctored(
            trace, "axis1.position_setpoint", lambda s, t, step=step: np.where(t > 0.7, s + step, s)
        )
        check = only(check_position_continuity(moved))
        assert check.verdict is verdict, step
        if verdict is Verdict.FAILED:
            assert check.time_s == pytest.approx(0.702, abs=0.004)
            assert check.value > check.high


@pytest.mark.requirement("MC-568")
def test_without_position_control_the_setpoint_is_the_actual_position(trace):
    """The same step with StatusWord.X28 is one of the machine, and not of the setpoint."""
    moved = doctored(trace, "axis1.position_setpoint", lambda s, t: np.where(t > 0.7, s + 3.0, s))
    free = doctored(moved, "axis1.status_word", lambda s, _: s + (1 << 28))
    assert only(check_position_continuity(moved)).verdict is Verdict.FAILED
    assert only(check_position_continuity(free)).verdict is Verdict.PASSED


@pytest.mark.requirement("STP-239", "STP-241")
def test_an_acceleration_beyond_the_limits_is_found(trace):
    """A setpoint a thousandth and a bit above the greatest configured acceleration is found, one at the limit
    is not.
    """
    assert only(check_acceleration_setpoint(trace)).verdict is Verdict.PASSED
    for value, verdict in (
        (4000.0, Verdict.PASSED),
        (4005.0, Verdict.FAILED),
        (float("nan"), Verdict.FAILED),
    ):
        wrong = doctored(
            trace,
            "axis1.acceleration_setpoint",
            lambda a, t, value=value: np.where(abs(t - 0.7) < 0.003, -value, a),
        )
        assert only(check_acceleration_setpoint(wrong)).verdict is verdict, value


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-239", "STP-241", "STP-244", "STP-245")
@pytest.mark.parametrize("stop", STOPS)
def test_a_stop_that_takes_more_way_than_its_ramp_is_found(stop):
    """Each ramp of the axis is judged by its own formula; a ramp that brakes with a part of its deceleration
    goes too far.

    Of a stop by `MC_Power` the words do not say which ramp it is: the longer one is the limit.
    """
    trace = stopped(stop)
    assert only(check_stop_travel(trace)).verdict is Verdict.PASSED
    # The same run, judged against limits under which it should have braked harder: the defect of a ramp that
    # is too flat.
    harder = {
        name: value / (0.15 if stop == "emergency" else 0.6) if name.endswith("deceleration") else value
        for name, value in trace.constants.items()
    }
    if stop != "reaction 3":
        harder["axis1.max_jerk"] = trace.constants["axis1.max_jerk"] * (100 if stop == "emergency" else 4)
    flat = Trace(trace.groups, events=trace.events, constants=harder, end_ns=trace.end_ns)
    check = only(check_stop_travel(flat))
    assert check.verdict is Verdict.FAILED
    assert "more than" in check.observed
    assert check.time_s == pytest.approx(0.8, abs=0.3)


@pytest.mark.exhaustive
def test_a_setpoint_that_goes_on_in_a_stop_is_found():
    """A ramp that holds its velocity for 60 ms more before it brakes is found."""
    trace = stopped("reaction 3")
    begin = begin_of(trace, "ALARM_RAMP")

    def late(values, times):
        held = values.copy()
        delay = 15
        index = int(np.searchsorted(times, begin))
        held[index + delay :] = values[index:-delay]
        held[index : index + delay] = values[index - 1]
        return held

    assert only(check_stop_travel(doctored(trace, "axis1.velocity_setpoint", late))).verdict is Verdict.FAILED


@pytest.mark.exhaustive
def test_a_setpoint_of_the_wrong_sign_goes_too_far(trace):
    """Nothing is judged without limits of the bench, and the reverse direction is judged alike."""
    assert check_stop_travel(Trace(trace.groups, events=trace.events, end_ns=trace.end_ns)) == []
    assert only(check_stop_travel(stopped("emergency", velocity=-300.0))).verdict is Verdict.PASSED


@pytest.mark.requirement("STP-508", "STP-509")
@pytest.mark.parametrize(
    ("columns", "rules"),
    [
        (("power_busy",), {"MC_Power outputs of axis1", "MC_Power busy of axis1"}),
        (("power_status", "power_busy"), {"MC_Power busy of axis1", "MC_Power off of axis1"}),
    ],
)
def test_outputs_of_mc_power_that_contradict_its_input_are_found(trace, columns, rules):
    """Busy that goes while Enable is there breaks STP-509, both outputs gone with Enable breaks STP-508; two
    cycles suffice.
    """

    def names(recording):
        return {c.name for c in check_status_words(recording) if c.verdict is Verdict.FAILED}

    assert names(trace) == set()
    wrong = trace
    for column in columns:
        wrong = doctored(wrong, f"axis1.{column}", lambda v, t: np.where(abs(t - 0.7) < 0.004, 0.0, v))
    assert names(wrong) == rules
