"""The rules that hold in every run: silent on a good run, loud on a doctored one."""

import numpy as np
import pytest

from fieldbus.history import Event
from hil.bench import load_bench
from hil.expect import ALWAYS_ON, run_checkers
from hil.expect._nc_rules import check_nc_axes
from hil.expect._setpoint_rules import (
    check_acceleration_setpoint,
    check_position_continuity,
    check_stop_travel,
)
from hil.expect._synchronous_rules import check_synchronous_operation
from hil.expect.checkers import (
    check_drive_status_words,
    check_drive_transitions,
    check_job_outputs,
    check_jobs_and_alarms,
    check_motion_while_disabled,
    check_setpoint_continuity,
    check_status_words,
)
from hil.expect.rules import judge
from hil.faults import Injector
from hil.record import Trace
from reports.model import Verdict
from testcases.unit.hil.toybench import ToyBench


def run(defect="", script=None):
    bench = ToyBench(seed=3, defect=defect)
    axis = bench.axis()
    axis.power()
    bench.run_until(lambda: axis.state == "STANDSTILL", 1.0)
    (script or standard)(bench, axis)
    return bench.trace()


def standard(bench, axis):
    """Move, stop, move, trip, reset, move, switch off."""
    axis.move_absolute(30.0)
    bench.run_for(0.6)
    axis.move_velocity(200.0)
    bench.run_for(0.5)
    Injector(bench).inject("drive.fault", code=0x2310)
    bench.run_for(0.5)
    axis.reset()
    bench.run_for(0.3)
    axis.move_velocity(-100.0)
    bench.run_for(0.3)
    axis.power(False, stop_mode=3)
    bench.run_for(1.0)


def doctored(trace, signal, change, *, keep_events=True):
    """Return a trace with one column changed by `change(values, times)`."""
    component, _, column = signal.partition(".")
    groups = []
    for group in trace.groups:
        values = group.values.copy()
        if group.name == component:
            index = [name for name, _ in group.columns].index(column)
            values[:, index] = change(values[:, index].copy(), group.time_ns * 1e-9)
        groups.append(group._replace(values=values))
    events = trace.events if keep_events else ()
    return Trace(groups, events=events, constants=trace.constants, end_ns=trace.end_ns)


def verdicts(checker, trace):
    return {check.name: check.verdict for check in checker(trace)}


def failed(checker, trace):
    return [name for name, verdict in verdicts(checker, trace).items() if verdict is Verdict.FAILED]


@pytest.fixture(scope="module")
def good():
    return run()


def test_a_good_run_breaks_no_rule(good):
    """A run with moves, a fault, a reset and a coast passes all rules, and every rule had something to
    judge.
    """
    checks = run_checkers(good)
    assert [check.name for check in checks if check.verdict is not Verdict.PASSED] == []
    for checker in ALWAYS_ON:
        # Drives of PROFIdrive, whole setpoint chains, bus logs and benches of a file are judged elsewhere.
        elsewhere = (
            check_acceleration_setpoint,
            check_position_continuity,
            check_stop_travel,
            check_synchronous_operation,
            check_nc_axes,
            judge,
        )
        name = checker.__name__
        if "profidrive" not in name and "check_log" not in name and checker not in elsewhere:
            assert checker(good), checker.__name__


def test_every_rule_names_a_requirement(good):
    """A rule without an identifier would be somebody's opinion."""
    assert all(check.requirements for check in run_checkers(good))


def test_an_empty_trace_has_nothing_to_judge():
    """Where there is no axis and no drive there is no check, and no crash."""
    assert run_checkers(Trace([])) == []


def test_two_outputs_of_one_job_are_found():
    """A job that shows Error and Done is found, whichever comes first."""

    def script(bench, axis):
        axis.move_velocity(50.0)
        Injector(bench).inject("axis.alarm", number=521, reaction=4)
        bench.run_for(0.2)

    assert failed(check_job_outputs, run("done_and_error", script)) == ["job outputs"]
    events = [
        Event(0, "axis1", "job.started", {"job": "a"}),
        Event(5, "axis1", "job.done", {"job": "a"}),
        Event(9, "axis1", "job.aborted", {"job": "a"}),
    ]
    assert failed(check_job_outputs, Trace([], events=events)) == ["job outputs"]
    again = [
        *events[:2],
        Event(6, "axis1", "job.started", {"job": "a"}),
        Event(7, "axis1", "job.aborted", {"job": "a"}),
    ]
    assert failed(check_job_outputs, Trace([], events=again)) == []


@pytest.mark.parametrize(
    ("old", "new", "legal"),
    [
        ("SWITCH_ON_DISABLED", "READY_TO_SWITCH_ON", True),
        ("Ready to switch on", "Switched on", True),
        ("SWITCHED_ON", "OPERATION_ENABLED", True),
        ("OPERATION_ENABLED", "SWITCH_ON_DISABLED", True),
        ("OPERATION_ENABLED", "FAULT_REACTION_ACTIVE", True),
        ("FAULT_REACTION_ACTIVE", "FAULT", True),
        ("FAULT", "SWITCH_ON_DISABLED", True),
        ("SWITCHED_ON", "FAULT", True),
        ("FAULT", "NOT_READY_TO_SWITCH_ON", True),
        ("SWITCH_ON_DISABLED", "OPERATION_ENABLED", False),
        ("SWITCH_ON_DISABLED", "SWITCHED_ON", False),
        ("FAULT", "OPERATION_ENABLED", False),
        ("FAULT", "READY_TO_SWITCH_ON", False),
        ("OPERATION_ENABLED", "FAULT", False),
        ("QUICK_STOP_ACTIVE", "READY_TO_SWITCH_ON", False),
        ("FAULT_REACTION_ACTIVE", "SWITCH_ON_DISABLED", False),
    ],
)
def test_transitions_of_the_drive(old, new, legal):
    """The transitions of the profile are legal in any spelling, all others are found."""
    trace = Trace([], events=[Event(0, "drive1", "drive.state", {"from": old, "to": new})])
    assert (failed(check_drive_transitions, trace) == []) is legal


def test_a_drive_that_moves_without_torque_is_found():
    """Motion that coasting does not explain is found: from rest, and growing while coasting."""
    script = lambda bench, axis: (axis.power(False, stop_mode=1), bench.run_for(1.0))  # noqa: E731 - two lines in one
    assert failed(check_motion_while_disabled, run("creeps_without_torque", script))
    coasting = lambda bench, axis: (  # noqa: E731 - as above
        axis.move_velocity(300.0),
        bench.run_for(0.5),
        axis.power(False, stop_mode=3),
        bench.run_for(0.3),
    )
    trace = run(script=coasting)
    assert failed(check_motion_while_disabled, trace) == []
    faster = doctored(trace, "drive1.velocity", lambda v, t: np.where(t > trace.end_s - 0.1, v * 1.5, v))
    assert failed(check_motion_while_disabled, faster)


def test_an_axis_that_creeps_away_slowly_is_found(good):
    """Displacement is found even where the velocity is too small to show."""
    moved = doctored(good, "drive1.position", lambda p, t: np.where(t > good.end_s - 0.05, p + 0.0002, p))
    assert failed(check_motion_while_disabled, moved)


def test_a_force_from_outside_excuses_motion():
    """An axis without torque that a load pushes does move; that is no fault of the drive."""

    def script(bench, axis):
        axis.power(False, stop_mode=1)
        bench.run_for(0.5)
        Injector(bench).inject("mechanics.load_step", force_N=100.0, duration_s=0.05)
        bench.run_for(2.0)

    trace = run(script=script)
    assert np.abs(trace["drive1.velocity"].values).max() > 0.1
    assert failed(check_motion_while_disabled, trace) == []
    unexplained = Trace(trace.groups, constants=trace.constants, end_ns=trace.end_ns)
    assert failed(check_motion_while_disabled, unexplained)


def test_a_rebound_from_an_end_stop_excuses_motion(good):
    """At an end stop whose place the bench states an axis may spring back."""
    moved = doctored(good, "drive1.position", lambda p, t: np.where(t > good.end_s - 0.05, p + 0.0002, p))
    moved.constants["drive1.positive_stop"] = float(moved["drive1.position"].values[-30])
    assert failed(check_motion_while_disabled, moved) == []


def test_a_step_of_the_setpoint_is_found(good):
    """A setpoint that jumps further than the limits allow in one cycle is found, with the size of the
    step.
    """

    def jump(values, times):
        values[np.searchsorted(times, 0.45) :] += 20.0
        return values

    assert failed(check_setpoint_continuity, good) == []
    assert failed(check_setpoint_continuity, doctored(good, "axis1.velocity_setpoint", jump))
    unknown = Trace(good.groups, events=good.events, end_ns=good.end_ns)
    assert check_setpoint_continuity(unknown) == [], "without the limits nothing can be judged"


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-239", "STP-244")
@pytest.mark.parametrize(("landing", "found"), [(0.0, True), (0.98, False)])
def test_a_setpoint_that_jumps_with_the_state_is_found(landing, found):
    """At a change of state the setpoint may start again among the actual velocities, and nowhere else: gone
    at once is no ramp.
    """
    with load_bench("reference").build(seed=1) as bench:
        axis = bench.axis()
        power = axis.power()
        assert bench.run_until(power.status, 2.0)
        axis.move_velocity(200.0)
        bench.run_for(0.4)
        axis.power(False, stop_mode=0)
        bench.run_for(0.3)
        trace = bench.trace()
    stop_s = next(
        e.time_ns * 1e-9
        for e in trace.select(source="axis1", kind="axis.state")
        if e.data["to"] == "DISABLING_RAMP"
    )

    def jump(values, times):
        first = int(np.searchsorted(times, stop_s - 1e-9))
        values[first:] = np.minimum(values[first:], landing * values[first - 1])
        return values

    assert failed(check_setpoint_continuity, trace) == []
    (check,) = check_setpoint_continuity(doctored(trace, "axis1.velocity_setpoint", jump))
    assert (check.verdict is Verdict.FAILED) is found
    assert (check.value > 1.01 * check.high) is found


def test_a_drive_of_another_profile_is_not_judged_by_cia_402():
    """A *Fault* followed by *Standby* is the affair of an analog drive."""
    changes = [
        Event(n, "drive1", "drive.state", {"from": a, "to": b})
        for n, (a, b) in enumerate([("Standby", "Fault"), ("Fault", "Standby")])
    ]
    assert check_drive_transitions(Trace([], events=changes, end_ns=9)) == []


def set_bits(mask):
    return lambda v, t: (v.astype(np.int64) | mask).astype(float)


def clear_bits(mask):
    return lambda v, t: (v.astype(np.int64) & ~mask).astype(float)


@pytest.mark.parametrize(
    ("signal", "change", "rule"),
    [
        ("axis1.power_busy", lambda v, t: v * 0, "MC_Power outputs"),
        ("axis1.status_word", set_bits(1 << 13 | 1 << 14), "motion bits"),
        ("axis1.status_word", set_bits(2), "error bits"),
        ("axis1.status_word", set_bits(2), "error bit and alarms"),
        ("axis1.status_word", clear_bits(2), "error bit and alarms"),
        ("axis1.status_word", clear_bits(2), "reaction"),
        ("axis1.error_word", lambda v, t: v * 0, "error bits"),
        ("axis1.alarm_number", lambda v, t: v * 0, "error bits"),
        ("axis1.stw1", lambda v, t: np.where(t < 0.3, 0x047E, 0x047F), None),
        ("axis1.stw1", lambda v, t: v * 0 + 0x047E, "control word in a ramp"),
        ("axis1.zsw1", set_bits(0x40), "switching on"),
    ],
)
def test_words_that_contradict_each_other_are_found(signal, change, rule):
    """Each contradiction between the words of an axis breaks the rule about it."""

    def script(bench, axis):
        axis.move_velocity(200.0)
        bench.run_for(0.4)
        axis.stop()
        bench.run_for(0.2)
        Injector(bench).inject("axis.alarm", number=521, reaction=4)
        bench.run_for(0.5)

    names = failed(check_status_words, doctored(run(script=script), signal, change))
    assert (f"{rule} of axis1" in names) if rule else names == []


@pytest.mark.exhaustive
def test_a_job_that_survives_an_alarm_is_found():
    """A motion job that stays busy while an alarm with a stop reaction is pending is found; MC_Stop is
    excepted.
    """
    trace = run()
    alarm_ns = next(trace.select(kind="alarm.raised")).time_ns

    def with_job(instruction):
        job = {"job": "x", "instruction": instruction}
        events = [Event(alarm_ns - 1000, "axis1", "job.started", job), *trace.events]
        return Trace(trace.groups, events=sorted(events, key=lambda e: e.time_ns), end_ns=trace.end_ns)

    assert failed(check_jobs_and_alarms, with_job("MC_MoveVelocity")) == ["jobs under alarms of axis1"]
    assert failed(check_jobs_and_alarms, with_job("MC_Stop")) == []


def test_a_statusword_outside_of_the_profile_is_found(good):
    """A statusword that shows none of the eight states is found."""
    assert failed(check_drive_status_words, doctored(good, "drive1.statusword", lambda v, t: v * 0 + 0x0001))
