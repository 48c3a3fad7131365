"""Rules about synchronous operation judge every trace: each of them finds the defect that it is about, put
into the recording of a sound run. The expectation `follows` judges positions alone.
"""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from fieldbus.errors import ConfigurationError
from fieldbus.history import Event
from hil.bench import load_bench
from hil.expect import evaluate, event, follows, run_checkers
from hil.record import Trace
from reports.model import Check, Verdict
from testcases.unit.hil.test_hil_checkers import doctored

pytestmark = pytest.mark.exhaustive


@pytest.fixture(scope="module")
def run() -> Trace:
    """A gear with a shift, a cam and velocity gearing behind one axis, and both followers leave it."""
    with load_bench("synchronous").build(seed=1) as bench:
        leader, first, second = (bench.axis(name) for name in bench.axis_names)
        for axis in (leader, first, second):
            bench.wait_until(axis.power().status, 3.0)
            bench.wait_until(axis.home(0.0).done, 1.0)
        cam = bench.cam("swing")
        bench.wait_until(cam.interpolate().done, 1.0)
        leader.move_velocity(100.0)
        bench.wait_until(first.gear_in(leader, -1, 2).in_gear, 2.0)
        bench.run_for(0.2)
        first.gear_out(-1000.0, MasterStopDistance=5.0)
        bench.wait_until(first.gear_out(0.0, SyncProfileReference=5).done, 1.0)
        bench.run_for(0.02)
        bench.wait_until(second.cam_in(first, cam, ApplicationMode=1, SyncProfileReference=2).in_sync, 2.0)
        bench.run_for(0.1)
        bench.wait_until(first.phasing_relative(5.0).done, 2.0)
        bench.wait_until(second.offset_relative(3.0, 20.0).done, 5.0)
        bench.wait_until(second.cam_out(5.0, MasterStopDistance=5.0).done, 3.0)
        bench.run_for(0.1)
        bench.wait_until(second.gear_in_velocity(first, 1, 2).in_sync, 2.0)
        bench.run_for(0.05)
        second.power(False)
        bench.run_for(0.3)
        return bench.trace()


def failed(trace: Trace) -> list[Check]:
    """Return the rules that a trace breaks."""
    return [check for check in run_checkers(trace) if check.verdict is Verdict.FAILED]


def test_a_sound_run_breaks_no_rule(run):
    """All rules that judge followers have something to judge, and none is broken."""
    assert failed(run) == []
    seen = {check.name for check in run_checkers(run)}
    assert {
        "follower_a on its function",
        "follower_b on its function",
        "leading value of follower_b",
        "synchronous jobs of follower_a",
        "follower_b after desynchronising",
    } <= seen


def nothing_else(trace: Trace, name: str, text: str) -> None:
    """Check that one rule is broken, and says what is wrong."""
    (check,) = [one for one in failed(trace) if one.name == name]
    assert text in check.observed


def in_phase(trace: Trace, axis: str, number: int) -> float:
    """Return a time in the middle of the first stretch in a phase, s."""
    phase = trace[f"{axis}.sync_phase"]
    here = phase.time_s[np.round(phase.values) == number]
    return float(here[min(len(here) // 2, 20)])


def test_a_follower_beside_its_gear_is_found(run):
    """A setpoint a hundredth of a millimetre beside the gear is found, one by rounding is not; so is a
    function that is not that of the ratio.
    """
    when = in_phase(run, "follower_a", 3)
    name = "follower_a on its function"
    for signal in ("position_setpoint", "function_position"):
        moved = doctored(run, f"follower_a.{signal}", lambda s, t: np.where(t > when, s + 0.01, s))
        nothing_else(moved, name, "mm")
    still = doctored(run, "follower_a.function_position", lambda s, t: np.where(t > when, s + 1e-8, s))
    assert failed(still) == []
    nothing_else(with_event(run, "axis.follows", "follower_a", numerator=-2), name, "in place of")


def test_a_follower_beside_its_cam_is_found(run):
    """Positions and velocities are judged by the points of the cam; a cam that says nothing is not judged."""
    when = in_phase(run, "follower_b", 3)
    name = "follower_b on its function"
    for signal, change in (("function_position", 0.01), ("velocity_setpoint", 0.1)):
        moved = doctored(run, f"follower_b.{signal}", lambda s, t, by=change: np.where(t > when, s + by, s))
        nothing_else(moved, name, "in place of")
    nothing_else(with_event(run, "axis.follows", "follower_b", slave_scaling=1.01), name, "in place of")
    silent = with_event(run, "cam.interpolated", "swing", function="")
    assert (
        failed(doctored(silent, "follower_b.function_position", lambda s, t: np.where(t < 1.0, s + 1, s)))
        == []
    )


def test_another_leading_value_than_that_of_the_leading_axis_is_found(run):
    """A leading value that is not the setpoint of the leading axis is found, with both numbers."""
    when = in_phase(run, "follower_b", 3)
    moved = doctored(run, "follower_b.leading_shift", lambda s, t: np.where(t > when, s + 0.01, s))
    nothing_else(moved, "leading value of follower_b", "while follower_a gives")


def test_a_second_end_of_a_synchronous_job_is_found(run):
    """A job ends once, never with an end that it does not have, and is not synchronous afterwards."""
    name = "synchronous jobs of follower_b"
    end = next(e for e in run.events if e.kind == "job.done" and e.data["instruction"] == "MC_CamOut")
    cam = next(e for e in run.events if e.kind == "job.aborted" and e.data["instruction"] == "MC_CamIn")
    for extra, text in (
        (Event(end.time_ns + 10, end.source, "job.aborted", dict(end.data)), "a second end"),
        (Event(cam.time_ns + 10, cam.source, "job.synchronous", dict(cam.data)), "has ended before"),
    ):
        nothing_else(with_events(run, [*run.events, extra]), name, text)
    done = [Event(e.time_ns, e.source, "job.done", e.data) if e is cam else e for e in run.events]
    assert failed(with_events(run, done)) == []  # a cam that is run once has Done
    gear = next(
        e for e in run.events if e.kind == "job.aborted" and e.data["instruction"] == "MC_GearInVelocity"
    )
    endless = [Event(e.time_ns, e.source, "job.done", e.data) if e is gear else e for e in run.events]
    nothing_else(with_events(run, endless), name, "Done, which MC_GearInVelocity does not have")
    nothing_else(with_events(run, [e for e in run.events if e is not gear]), name, "out of operation")


def test_motion_after_desynchronising_is_found(run):
    """A setpoint that moves after MC_CamOut has ended is found, until another job begins."""
    end = next(e for e in run.events if e.kind == "job.done" and e.data["instruction"] == "MC_CamOut")
    since = end.time_ns * 1e-9
    moved = doctored(
        run, "follower_b.velocity_setpoint", lambda s, t: np.where((t > since) & (t < since + 0.02), 1.0, s)
    )
    nothing_else(moved, "follower_b after desynchronising", "1 mm/s after follower_b.MC_CamOut_1 has ended")


def with_events(trace: Trace, events: list[Event]) -> Trace:
    """Return a trace with other events."""
    changed = doctored(trace, "follower_a.leading_shift", lambda s, _: s)
    changed.events = tuple(sorted(events, key=lambda one: one.time_ns))
    return changed


def with_event(trace: Trace, kind: str, source: str, **data: object) -> Trace:
    """Return a trace in which the first event of a kind says something else."""
    first = next(e for e in trace.events if (e.kind, e.source) == (kind, source))
    other = Event(first.time_ns, first.source, first.kind, {**first.data, **data})
    return with_events(trace, [other if e is first else e for e in trace.events])


def test_an_axis_that_follows_another_one_by_its_positions(run):
    """The ways of both axes and the ratio say it, whatever the zero; a function of the leading position does
    as well. The message says by how much it is off.
    """
    cam = json.loads(str(next(e for e in run.events if e.kind == "cam.interpolated").data["function"]))

    zero = run["follower_b.leading_zero"].at(in_phase(run, "follower_b", 3))

    def swing(x: float) -> float:
        place = (x - zero) % 100.0
        _, _, origin, *a = next(piece for piece in cam if piece[0] <= place <= piece[1])
        return sum(factor * (place - origin) ** power for power, factor in enumerate(a[:7]))

    begun = event("job.synchronous", "follower_a", instruction="MC_GearIn")
    gear = follows(
        "follower_a", "leader", -0.5, since=begun.plus(0.02), until=begun.plus(0.2), tolerance=0.05
    )
    moved = doctored(run, "leader.actual_position", lambda s, _: s + 40.0)
    for trace in (run, moved):
        (check,) = evaluate(trace, [gear])
        assert check.verdict is Verdict.PASSED, check.observed
    wrong = evaluate(run, [replace(gear, law=-0.52)])[0]
    assert (wrong.verdict, wrong.unit) == (Verdict.FAILED, "mm")
    assert "ahead of what leader asks for" in wrong.sentence
    camming = event("job.synchronous", "follower_b", instruction="MC_CamIn")
    law = follows(
        "follower_b.position_setpoint", "follower_a.position_setpoint", swing, since=camming, tolerance=1e-6,
        until=event("job.started", "follower_b", instruction="MC_OffsetRelative"),
    )  # fmt: skip
    assert [check.verdict for check in evaluate(run, [law])] == [Verdict.PASSED]
    with pytest.raises(ConfigurationError, match=r"follows.law: True is not allowed"):
        follows("a", "b", True, since=0.0)
