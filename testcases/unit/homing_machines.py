"""Machines for active homing as Hypothesis draws them, where it has to end on them, and what has to hold at
the end.
"""

from __future__ import annotations

from math import ceil, floor

from hypothesis import assume
from hypothesis import strategies as st

LIMIT = 150.0
"""Place of the positive limit switch, mm; the negative one is opposite."""
PITCH = 10.0
HOME = 1000.0
SEARCH = 40.0
"""Highest homing velocity, mm/s."""
ZERO_MARK, CAM, INPUT = range(3)


def clearance(cycle_s):
    """Return the way from a limit switch to the stop behind it, mm (HOM-111): what 150 mm/s need with 1000
    mm/s², after four cycles.
    """
    return 150.0 * 4 * cycle_s + 150.0**2 / (2 * 1000.0)


@st.composite
def machines(draw):
    """A cam between the limit switches, a start anywhere between them, and every setting of active homing."""
    low = draw(st.floats(-LIMIT + 10.0, LIMIT - 15.0))
    return {
        "cam": (low, low + draw(st.floats(3.0, min(60.0, LIMIT - 10.0 - low)))),
        "start": draw(st.floats(-LIMIT + 1.0, LIMIT - 1.0)),
        "phase": draw(st.floats(0.0, PITCH)),
        "mode": draw(st.sampled_from([ZERO_MARK, CAM, INPUT])),
        "direction": draw(st.sampled_from([1, -1])),
        "approach": draw(st.sampled_from([1, -1])),
        "positive_side": draw(st.booleans()),
        "reversal": draw(st.booleans()),
        "velocity": draw(st.floats(20.0, 150.0)),
    }


@st.composite
def broken_machines(draw):
    """As above, with a cam of any place and width, a start also on a limit switch, and something wrong with
    the switches.
    """
    machine = draw(machines())
    low = draw(st.floats(-LIMIT - 30.0, LIMIT + 20.0))
    wrong = draw(
        st.sampled_from(
            ["nothing", "no cam", "cam always on", "limits exchanged", "both limits on", "inverted cam"]
        )
    )
    # Who stands on an exchanged switch from the start on cannot know it: he leaves it the wrong way round.
    depth = -1.0 if wrong == "limits exchanged" else 5.0
    machine |= {
        "cam": (low, low + draw(st.floats(0.5, 200.0))),
        "start": draw(st.floats(-LIMIT - depth, LIMIT + depth)),
        "wrong": wrong,
    }
    return machine


def variables(machine):
    """Return the configuration of an axis for a machine."""
    return {
        "Sensor[1].ActiveHoming.Mode": machine["mode"],
        "Sensor[1].ActiveHoming.Direction": int(machine["direction"] < 0),
        "Sensor[1].ActiveHoming.SideInput": machine["positive_side"],
        "Homing.ApproachDirection": machine["approach"] < 0,
        "Homing.AutoReversal": machine["reversal"],
        "DynamicDefaults.Jerk": 0.0,
        "DynamicDefaults.Deceleration": 1000.0,
        "DynamicDefaults.Acceleration": 1000.0,
        "Homing.ApproachVelocity": machine["velocity"],
        "Homing.ReferencingVelocity": min(SEARCH, machine["velocity"]),
        "PositionLimits_HW.Active": True,
        "PositionLimits_HW.ApproachBehavior": 1,
    }


def next_mark(place, direction, phase):
    """Return the zero mark met first from a place."""
    turns = (place - phase) / PITCH
    return phase + PITCH * (floor(turns) + 1 if direction > 0 else ceil(turns) - 1)


def expected_mark(machine, beyond):
    """Return the place of the mark on which the axis has to be homed; None: there is none between the
    switches.

    Args:
        machine: See `machines`.
        beyond: How far behind a limit switch the axis comes to rest at most, mm.

    """
    direction = machine["direction"]
    if machine["mode"] == INPUT:
        return machine["cam"][1] if machine["positive_side"] else machine["cam"][0]
    begin = machine["start"]
    if machine["mode"] == CAM:
        begin = machine["cam"][1] if direction > 0 else machine["cam"][0]
    mark = next_mark(begin, direction, machine["phase"])
    if abs(mark) < LIMIT:
        return mark
    # Without a cam the search begins again at the other end.
    return (
        None
        if machine["mode"] == CAM
        else next_mark(-direction * (LIMIT + beyond), direction, machine["phase"])
    )


def admissible(machine, beyond):
    """Leave out machines whose mark nobody could tell: next to a limit switch, under the start, or at the end
    of the cam.
    """
    mark = expected_mark(machine, beyond)
    # A mark next to a limit switch is no admissible placement: the axis passes it before it stands.
    assume(mark is None or abs(mark) < LIMIT - 8.0 or machine["mode"] == ZERO_MARK)
    low, high = machine["cam"]
    first = next_mark(machine["start"], machine["direction"], machine["phase"])
    assume(
        machine["mode"] != ZERO_MARK
        or (abs(LIMIT - abs(first)) > 8.0 and abs(first - machine["start"]) > 0.5)
    )
    assume(machine["mode"] != ZERO_MARK or abs(off_a_mark(machine["start"], machine["phase"])) > 0.5)
    after = high if machine["direction"] > 0 else low
    behind = next_mark(after, machine["direction"], machine["phase"])
    assume(machine["mode"] != CAM or (abs(behind - after) > 2.0 and abs(LIMIT - abs(behind)) > 8.0))


def right_mark_or_right_alarm(machine, *, job, homed_on, alarms, axis, cycle_s):
    """Assert that an admissible machine was homed on its mark, or with the right alarms where there is none.

    Args:
        machine: See `machines`.
        job: The ended `MC_Home`.
        homed_on: Place of the mark that the axis has assumed: place of the load less the shown distance
            from it.
        alarms: Numbers in the order in which they came.
        axis: Its handle.
        cycle_s: Application cycle.

    """
    mark = expected_mark(machine, clearance(cycle_s))
    first = next_mark(machine["start"], machine["direction"], machine["phase"])
    low, high = machine["cam"]
    if job.Done:
        if machine["mode"] == ZERO_MARK and abs(first) > LIMIT:
            # It has been looked for from the other end, wherever the axis turned there.
            assert abs(off_a_mark(homed_on, machine["phase"])) < 0.01
            assert homed_on * machine["direction"] < -LIMIT + PITCH
        else:
            tolerance = 3.0 * SEARCH * cycle_s if machine["mode"] == INPUT else 0.01
            if machine["mode"] == INPUT and high - low < 30.0:
                tolerance = 3.0 * machine["velocity"] * cycle_s  # not slowed down yet (HOM-106)
            assert mark is not None
            assert abs(homed_on - mark) <= tolerance
        assert axis.var("StatusWord.X5") is True
        assert alarms == []
        return
    assert job.ErrorID == 0x8001
    assert axis.var("StatusWord.X5") is False
    assert axis.var("ErrorWord.X10") is True
    if machine["reversal"]:
        assert mark is None
        assert alarms[0] == 342
    else:
        assert alarms == [531, 342]


def off_a_mark(place, phase):
    """Return the distance from the nearest zero mark, mm."""
    turns = (place - phase) / PITCH
    return (turns - round(turns)) * PITCH


def honest_end(machine, *, job, homed_on, alarms, axis, cycle_s):
    """Assert what holds on any machine, however broken: homed on something real, or an alarm and not homed;
    nothing goes on.

    Arguments are those of `right_mark_or_right_alarm`.
    """
    assert axis.var("StatusWord.X11") is False
    assert abs(axis.var("ActualVelocity")) < 0.1  # an increment per cycle
    if not job.Done:
        assert (job.Error, job.ErrorID) == (True, 0x8001)
        assert set(alarms) <= {531, 342}
        assert alarms
        return
    assert axis.var("StatusWord.X5") is True
    if machine["mode"] != INPUT:
        assert abs(off_a_mark(homed_on, machine["phase"])) < 0.01
        return
    side = machine["positive_side"] is not (machine["wrong"] == "inverted cam")
    edge = machine["cam"][1] if side else machine["cam"][0]
    assert machine["wrong"] not in ("no cam", "cam always on")
    # With the wrong level the side of the input is an edge of the other kind: one of the two it has to be.
    edges = machine["cam"] if machine["wrong"] == "inverted cam" else (edge,)
    assert min(abs(homed_on - one) for one in edges) <= 3.0 * machine["velocity"] * cycle_s + 0.1
