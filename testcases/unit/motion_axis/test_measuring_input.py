"""Measuring inputs: what they measure, and what homing makes of their jobs (OVR section 3.3)."""

from __future__ import annotations

import pytest

from motion.drives.simulated import SimulatedDrivePort
from motion.s7.handles import MeasuringInputHandle
from motion.s7.measuring_input import CENTRAL, TELEGRAM, MeasuringInput, measured_object
from testcases.catalogue import each
from testcases.unit.motion_axis.conftest import CYCLE, ZERO_MARK, Rig

PER_MM = 13107.2
"""Increments per millimetre."""
RISES, FALLS = (10.0, 50.0, 90.0), (30.0, 70.0)
INACTIVE, WAITING, OCCURRED, FAILED = range(4)


def measuring(kind=TELEGRAM, *, cpu="S7-1500T", velocity=100.0, correction_ms=0.0, **variables):
    """An axis at constant velocity from 0 on, and a measuring input of its drive with these edges, mm."""
    edges = tuple([round(place * PER_MM) for place in places] for places in (RISES, FALLS))
    port = SimulatedDrivePort(cycle_s=CYCLE, zero_marks=[ZERO_MARK], probe_edges=edges)
    rig = Rig(port=port, cpu=cpu, variables=variables).enabled()
    one = MeasuringInput(
        "mark",
        measured_object(rig.axis.object),
        kind=kind,
        correction_ms=correction_ms,
        aborts_for_homing=cpu.endswith("V7"),
        cpu=cpu,
        history=rig.history,
    )
    rig.runtime.add_measuring_input(one)
    rig.axis.object.on_homing.append(one.end_for_homing)
    rig.mark = MeasuringInputHandle(rig.runtime, one)
    rig.axis.home(0.0)
    rig.cycles(2)
    if velocity:
        rig.axis.move_velocity(velocity)
    return rig


MODES = {0: (10.0, None), 1: (30.0, None), 2: (10.0, 30.0), 3: (10.0, 30.0), 4: (30.0, 50.0)}


@pytest.mark.requirement("CFG-200")
def test_what_is_measured(subtests):
    """Each mode has its edges, exact to the increment whatever the cycle is; variables and outputs agree."""
    for label, (mode,) in each(list(MODES)):
        with subtests.test(label):
            rig = measuring()
            job = rig.mark.measure(mode)
            rig.cycles(2)
            assert (job.Busy, rig.mark.var("Status")) == (True, WAITING)
            rig.until(job.done, 3.0)
            first, second = MODES[mode]
            assert job.MeasuredValue1 == pytest.approx(first, abs=1e-3)
            assert rig.mark.var("MeasuredValues.MeasuredValue1") == job.MeasuredValue1
            if second is not None:
                assert job.MeasuredValue2 == pytest.approx(second, abs=1e-3)
            assert (rig.mark.var("Status"), rig.mark.var("StatusWord.X1")) == (OCCURRED, False)


def test_a_correction_time():
    """The signal comes 20 ms behind the edge: at 100 mm/s the position is 2 mm less."""
    rig = measuring(correction_ms=20.0)
    rig.run(0.2)
    job = rig.mark.measure(1)
    rig.until(job.done, 3.0)
    assert job.MeasuredValue1 == pytest.approx(28.0, abs=0.02)


@pytest.mark.parametrize(
    ("start", "end", "found"),
    [(40.0, 60.0, 50.0), (60.0, 40.0, 50.0), (15.0, 25.0, None), (95.0, 99.0, None)],
)
def test_a_measuring_range(start, end, found):
    """Only edges within it count, in whatever order its ends are given; an axis that leaves it without one
    ends the job with alarm 752.
    """
    rig = measuring()
    job = rig.mark.measure(0, MeasuringRange=True, StartPosition=start, EndPosition=end)
    rig.until(job.ended, 3.0)
    if found is None:
        assert (job.ErrorID, rig.alarms_of("mark"), rig.mark.var("Status")) == (0x8001, [752], FAILED)
    else:
        assert job.MeasuredValue1 == pytest.approx(found, abs=1e-3)


def test_a_measuring_range_over_the_edge_of_a_modulo_range():
    """From 60 over 100, which is 0, to 15: of the edges at 50 and 90 the second one counts."""
    rig = measuring(**{"Modulo.Enable": True, "Modulo.Length": 100.0})
    rig.run(0.3)
    job = rig.mark.measure(0, MeasuringRange=True, StartPosition=60.0, EndPosition=15.0)
    rig.until(job.ended, 5.0)
    assert job.MeasuredValue1 == pytest.approx(90.0, abs=1e-3)


def test_cyclic_measuring():
    """It goes on until it is aborted, and counts; an input in the telegram of the axis cannot do it."""
    rig = measuring(CENTRAL)
    job = rig.mark.measure_cyclic(2)
    rig.run(1.2)
    assert (job.Busy, job.MeasuredValue1Counter, job.MeasuredValue2Counter) == (True, 3, 2)
    assert (job.MeasuredValue1, job.MeasuredValue2) == (
        pytest.approx(90.0, abs=1e-3),
        pytest.approx(70.0, abs=1e-3),
    )
    assert (job.LostEdgeCounter1, job.LostEdgeCounter2) == (0, 0)
    end = rig.mark.abort()
    rig.cycles(2)
    assert (job.CommandAborted, end.Done, rig.mark.var("Status")) == (True, True, INACTIVE)
    other = measuring(TELEGRAM)
    refused = other.mark.measure_cyclic(0)
    other.cycles(2)
    assert (refused.ErrorID, other.alarms_of("mark")) == (0x8001, [755])
    again = other.mark.measure(0)
    other.cycles(2)
    assert again.ErrorID == 0x8001  # until it is acknowledged
    other.until(other.mark.reset().done)
    other.until(other.mark.measure(0).done, 3.0)


@pytest.mark.requirement("OVR-043")
def test_measuring_jobs_among_themselves(subtests):
    """A new job aborts the running one, of either kind; so does MC_AbortMeasuringInput."""
    for label, (old, new) in each(["measure", "measure_cyclic"], ["measure", "measure_cyclic", "abort"]):
        with subtests.test(label):
            rig = measuring(CENTRAL, velocity=0.0)
            first = getattr(rig.mark, old)()
            rig.cycles(2)
            second = getattr(rig.mark, new)()
            rig.cycles(2)
            assert (first.CommandAborted, first.Busy, second.Error) == (True, False, False)
            assert second.Done if new == "abort" else second.Busy


ENDS, LEAVES = (2, 3, 5, 8, 9, 10), (0, 1, 6, 7, 11, 12, 13)


@pytest.mark.requirement(
    "OVR-041", "OVR-042", "OVR-044", "OVR-003", "OVR-119", "SYN-284", "SYN-285", "SYN-461", "SYN-477",
    "HOM-079", "MC-006",
)  # fmt: skip
def test_homing_over_measuring(subtests):
    """Modes that look for a mark, and mode 9, end a measuring job: 16#80A3, in V7 CommandAborted; and they
    run; those that set the position leave it alone. While one looks for its mark no measuring job
    starts.
    """
    for label, (cpu, kind, mode) in each(
        ["S7-1500T", "S7-1500T V8", "S7-1500T V7"], ["measure", "measure_cyclic"], [*ENDS, *LEAVES]
    ):
        with subtests.test(label):
            rig = measuring(CENTRAL, cpu=cpu, velocity=0.0)
            job = getattr(rig.mark, kind)(1)
            rig.cycles(2)
            home = rig.axis.home(1.0, mode=mode)
            rig.cycles(2)
            if home.Error:
                assert mode in (6, 7, 13)  # for absolute encoders
            if mode in LEAVES:
                assert job.Busy
                continue
            assert not home.Error
            assert (home.Busy, home.Done) == (mode != 9, mode == 9)
            if cpu.endswith("V7"):
                assert (job.CommandAborted, job.Error) == (True, False)
            else:
                assert (job.CommandAborted, job.ErrorID) == (False, 0x80A3)
            late = getattr(rig.mark, kind)(1)
            rig.cycles(2)
            assert (late.ErrorID == 0x80A3) is (mode != 9)


@pytest.mark.requirement("MC-638")
def test_a_restart_ends_measuring_jobs():
    """With 16#800D; values and counters are gone, and it works again."""
    rig = measuring(CENTRAL)
    first = rig.mark.measure(0)
    rig.until(first.done, 3.0)
    job = rig.mark.measure_cyclic(0)
    rig.cycles(2)
    rig.mark.reset(restart=True)
    rig.cycles(2)
    rig.run(0.1)
    assert (job.ErrorID, rig.mark.var("MeasuredValues.MeasuredValue1")) == (0x800D, 0.0)
    rig.until(rig.mark.measure(1).done, 3.0)


def test_wrong_inputs():
    """Modes that there are not, and positions that are no numbers."""
    rig = measuring(CENTRAL, velocity=0.0)
    for start, inputs, error in (
        ("measure", {"Mode": 5}, 0x800A),
        ("measure", {"Mode": -1}, 0x800A),
        ("measure_cyclic", {"Mode": 3}, 0x800A),
        ("measure", {"MeasuringRange": True, "StartPosition": float("nan")}, 0x8009),
    ):
        job = getattr(rig.mark, start)()
        job.set(**inputs)
        rig.cycles(2)
        assert (job.ErrorID, job.Busy) == (error, False)
    second = MeasuringInput(
        "second", measured_object(rig.axis.object), probe=2, cpu="S7-1500T", history=rig.history
    )
    rig.runtime.add_measuring_input(second)
    refused = MeasuringInputHandle(rig.runtime, second).measure()
    rig.cycles(2)
    assert (refused.ErrorID, rig.alarms_of("second")) == (0x8001, [754])


def test_one_measuring_job_per_encoder():
    """While one measuring input waits for an edge, another one of the same encoder is refused with alarm
    753.
    """
    rig = measuring(CENTRAL, velocity=0.0)
    second = MeasuringInput(
        "second", measured_object(rig.axis.object), kind=CENTRAL, cpu="S7-1500T", history=rig.history
    )
    rig.runtime.add_measuring_input(second)
    first = rig.mark.measure()
    rig.cycles(2)
    refused = MeasuringInputHandle(rig.runtime, second).measure()
    rig.cycles(2)
    assert (refused.ErrorID, rig.alarms_of("second"), first.Busy) == (0x8001, [753], True)
