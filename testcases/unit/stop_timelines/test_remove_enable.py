"""Alarm reaction 4 behind a PROFIdrive telegram: patterns, timelines, enabling again (section 8.8)."""

from __future__ import annotations

from functools import cache

import pytest

from motion.s7.axis import AxisState
from testcases.unit.motion_axis.conftest import Rig
from testcases.unit.stop_timelines.telegram_record import (
    CYCLE_S,
    StopBench,
    after,
    before,
    end,
    event,
    step,
    steps,
    when,
)

ALARM = 521
"""Following error: reaction 4, its cause is over with the stop."""
VALUES = (1, 3, 5, 7)
ACKNOWLEDGED_MS = {1: 800, 3: 2000, 5: 800, 7: 800}


@cache
def removed(value):
    """Return the record of a travelling axis whose enable is removed, acknowledged long after its standstill,
    and moved again.
    """
    with StopBench(variables={"Actor.RemoveEnableReaction": value}).travelling() as bench:
        bench.now()
        bench.alarm(ALARM)
        bench.run(0.04)
        bench.watch("late", bench.axis.move_velocity(50.0))
        bench.run(ACKNOWLEDGED_MS[value] / 1000.0 - 0.04)
        bench.watch("reset", bench.axis.reset())
        bench.run(0.2)
        bench.watch("again", bench.axis.move_velocity(50.0))
        bench.run(0.2)
        bench.telegrams()
        return bench


WORDS = {
    # value: at the alarm, when the drive is off, ZSW1 of the ramp, ZSW1 at rest, its state at rest
    1: (0x047E, 0x047E, 0x0233, 0x0231, "S2"),
    3: (0x047C, 0x047C, 0x0260, 0x0260, "S1"),
    5: (0x047A, 0x047A, 0x0213, 0x0250, "S1"),
    7: (0x047B, 0x0478, 0x0213, 0x0240, "S1"),
}
PATTERN_ID = {1: "STP-363 STP-354", 3: "STP-364 STP-353", 5: "STP-365 STP-352", 7: "STP-366 STP-351"}
ALARMED = {"status": False, "busy": True, "reaction": 4, "number": ALARM}
enabled_again = when(lambda row: row.reaction == 0 and row.status)


def timeline(value):
    """Return the steps for a value of `Actor.RemoveEnableReaction`; those of 16#7 are printed, the others
    follow from STP-375.
    """
    first, last, ramp, rest, state = WORDS[value]
    printed = value == 7
    halfway = {1: after(300), 3: after(600), 5: after(152), 7: after(152)}[value]

    def ids(identifier):
        return f"{identifier if printed else 'STP-375'} {PATTERN_ID[value]}"

    coasts = value == 3
    moving = {
        "on": "1" if coasts else "1 14",
        "off": "0 6 7 14" if coasts else "0 6 7",
        "nset": (0.0, 0.001),
        "follows": True,
        "in_operation": False,
        **ALARMED,
    }
    return [
        step(
            ids("STP-368"),
            before,
            stw1=0x047F,
            zsw1=0x0237,
            state="S4",
            on="0",
            off="1",
            setpoint=(300.0, 0.001),
            status=True,
            busy=True,
            job_move="Busy",
        ),
        step(
            ids("STP-369") + " STP-376 STP-348 STP-346",
            event,
            stw1=first,
            nset=(0.0, 0.001),
            on="1",
            off="0",
            follows=True,
            job_move="Error 8001",
            **ALARMED,
        ),
        step(
            ids("STP-370"),
            after(4),
            stw1=first,
            zsw1=ramp,
            state="S1" if coasts else "S5",
            pulses=not coasts,
            **moving,
        ),
        step(ids("STP-370"), halfway, stw1=first, zsw1=ramp, state="S1" if coasts else "S5", **moving),
        step(ids("STP-369") + " STP-252", after(44), job_late="Error 8001"),
        step(
            ids("STP-371"),
            when(lambda row: row.zsw1 & 0x0006 == 0),
            stw1=last,
            zsw1=rest if value != 7 else 0x0250,
            pulses=False,
            **ALARMED,
        ),
        step(
            ids("STP-371"),
            when(lambda row: row.x >> 7 & 1),
            stw1=last,
            zsw1=rest,
            state=state,
            on="1 6 7",
            off="0",
            **ALARMED,
        ),
        step(
            ids("STP-372"),
            when(lambda row: row.reaction == 0),
            stw1=0x047E,
            off="1",
            number=0,
            job_reset="Done",
        ),
        step(
            ids("STP-373"),
            enabled_again,
            stw1=0x047F,
            zsw1=0x0237,
            state="S4",
            on="0 6",
            in_operation=True,
            busy=True,
        ),
        step(ids("STP-374"), enabled_again, on="6", setpoint=(0.0, 0.001), job_move="Error 8001"),
        step(ids("STP-374"), end, on="0 10", job_again="Busy", nact=(50.0, 1.0), job_move="Error 8001"),
    ]


TIMELINES = {f"16#{value}": timeline(value) for value in VALUES}


@pytest.mark.exhaustive
@pytest.mark.parametrize(("timeline", "step"), steps(TIMELINES))
def test_step(timeline, step):
    """What the step prints is on the wire, in the status word and at the outputs of the jobs."""
    step.check(removed(int(timeline[-1])))


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("value", "words", "answers", "states"),
    [
        pytest.param(
            1,
            [0x047E, 0x04FE, 0x047E, 0x047F],
            [0x0237, 0x0233, 0x0231, 0x0233, 0x0237],
            ["S4", "S5", "S2", "S3", "S4"],
            marks=pytest.mark.requirement("STP-363", "STP-375", "STP-350"),
        ),
        pytest.param(
            3,
            [0x047C, 0x04FC, 0x047E, 0x047F],
            [0x0237, 0x0260, 0x0231, 0x0233, 0x0237],
            ["S4", "S1", "S2", "S3", "S4"],
            marks=pytest.mark.requirement("STP-364", "STP-375", "STP-350", "STP-288"),
        ),
        pytest.param(
            5,
            [0x047A, 0x04FA, 0x047E, 0x047F],
            [0x0237, 0x0213, 0x0250, 0x0231, 0x0233, 0x0237],
            ["S4", "S5", "S1", "S2", "S3", "S4"],
            marks=pytest.mark.requirement("STP-365", "STP-375", "STP-350", "STP-288"),
        ),
        pytest.param(
            7,
            [0x047B, 0x0478, 0x04F8, 0x047E, 0x047F],
            [0x0237, 0x0213, 0x0250, 0x0240, 0x0231, 0x0233, 0x0237],
            ["S4", "S5", "S1", "S2", "S3", "S4"],
            marks=pytest.mark.requirement(
                "STP-366", "STP-371", "STP-372", "STP-362", "STP-350", "STP-288", "STP-005"
            ),
        ),
    ],
)
def test_words_of_a_stop(value, words, answers, states):
    """All words of both directions from the alarm to the enabled axis; bit 7 is the acknowledgement."""
    bench = removed(value)
    assert [f"{word:04X}" for word in bench.sequence("stw1")] == [f"{word:04X}" for word in words]
    assert [f"{word:04X}" for word in bench.sequence("zsw1")] == [f"{word:04X}" for word in answers]
    assert bench.states() == states


@pytest.mark.parametrize(
    ("value", "seconds", "travel"),
    [
        pytest.param(
            1, 0.600, 90.0, marks=pytest.mark.requirement("STP-011", "STP-246", "STP-375", "STP-354")
        ),
        pytest.param(
            5, 0.300, 45.0, marks=pytest.mark.requirement("STP-010", "STP-246", "STP-375", "STP-352")
        ),
        pytest.param(
            7, 0.300, 45.0, marks=pytest.mark.requirement("STP-010", "STP-246", "STP-371", "STP-351")
        ),
    ],
)
def test_ramp(value, seconds, travel):
    """The ramp is the drive's: p1121 or p1135, from the actual speed; nothing is put out meanwhile."""
    bench = removed(value)
    duration, way = bench.ramp("nact")
    assert duration == pytest.approx(seconds, abs=2 * CYCLE_S)
    assert way == pytest.approx(travel, abs=300.0 * 2 * CYCLE_S)


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-353", "STP-246", "STP-014")
def test_coasting_takes_what_the_mechanics_take():
    """With 16#3 the axis rolls out as it does after StopMode 3, cycle for cycle."""
    with StopBench().travelling() as bench:
        bench.now()
        bench.axis.power(False, stop_mode=3)
        bench.run(1.5)
        rolled = [round(row.nact) for row in bench.telegrams()[bench.edge + 2 : bench.edge + 300]]
    bench = removed(3)
    assert [round(row.nact) for row in bench.rows[bench.edge + 1 : bench.edge + 299]] == rolled


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-367", "STP-289", "STP-547")
@pytest.mark.parametrize("value", [5, 7])
def test_no_coasting_before_standstill(value):
    """While ZSW1 shows S5, STW1.1 and STW1.3 are 1, and the pulses are on until the drive stands."""
    bench = removed(value)
    braking = [row for row in bench.rows[bench.edge :] if row.zsw1 & 0x0067 == 0x0003]
    assert len(braking) > 70
    assert all(row.stw1 & 0x000A == 0x000A for row in braking)
    stopped = bench.first(lambda row: not row.pulses)
    assert abs(bench.rows[stopped].actual_velocity) < 3.0


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-367", "STP-319", "STP-290")
@pytest.mark.parametrize("give", ["alarm", "power"])
def test_the_drive_says_when_it_stands(give):
    """An axis whose standstill window is wide is at rest early; OFF2 still waits for ZSW1.1 = ZSW1.2 = 0."""
    with StopBench(variables={"StandstillSignal.VelocityThreshold": 60.0}).travelling() as bench:
        bench.now()
        if give == "alarm":
            bench.alarm(ALARM)
        else:
            bench.axis.power(False, stop_mode=1)
        bench.run(0.5)
        rows = bench.telegrams()
        assert rows[bench.first(lambda row: row.x >> 7 & 1)].state == "S5"
        withdrawn = bench.first(lambda row: not row.stw1 & 0x2)
        assert rows[withdrawn].zsw1 & 0x0006 == 0
        assert rows[withdrawn].zsw1 & 0x027F == 0x0250
        assert not any(row.state == "S5" and not row.pulses for row in rows)


# -- the value
# ------------------------------------------------------------------------------------------------------------


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-356", "STP-357")
def test_value_written_during_a_stop_counts_for_the_next_one():
    """16#3 during a running OFF3: Done, the variable shows it, the ramp goes on; the next stop is OFF2."""
    with StopBench().travelling() as bench:
        bench.now()
        bench.alarm(ALARM)
        bench.run(0.1)
        written = bench.axis.write_parameter(1020, 3)
        bench.until(written.done)
        assert bench.axis.var("Actor.RemoveEnableReaction") == 3
        bench.run(0.6)
        bench.until(bench.axis.reset().done)
        bench.until(bench.power.status)
        bench.axis.move_velocity(100.0)
        bench.run(0.4)
        second = len(bench.rows)
        bench.alarm(ALARM)
        bench.run(0.1)
        bench.telegrams()
        assert bench.sequence("stw1")[:2] == [0x047B, 0x0478]
        assert bench.ramp("nact")[0] == pytest.approx(0.300, abs=2 * CYCLE_S)
        assert bench.sequence("stw1", second) == [0x047C]
        assert bench.states(second) == ["S4", "S1"]


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-357", "STP-385")
@pytest.mark.parametrize("value", [1, 3, 5])
def test_value_written_during_a_quick_stop_does_not_let_it_coast(value):
    """The quick stop of 16#7 runs; another value and Enable = FALSE change nothing about it."""
    with StopBench().travelling() as bench:
        bench.now()
        bench.alarm(ALARM)
        bench.run(0.1)
        bench.until(bench.axis.write_parameter(1020, value).done)
        power = bench.axis.power(False, stop_mode=3)
        bench.until(power.off)
        bench.run(0.1)
        bench.telegrams()
        assert bench.sequence("stw1") == [0x047B, 0x0478]
        assert bench.ramp("nact")[0] == pytest.approx(0.300, abs=2 * CYCLE_S)


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-355", "STP-570")
@pytest.mark.parametrize("value", [0, 2, 4, 6, 8, 15])
def test_invalid_value_is_refused(value):
    """MC_WriteParameter ends with an error, the old value stays and acts."""
    with StopBench(variables={"Actor.RemoveEnableReaction": 5}).travelling(100.0) as bench:
        job = bench.axis.write_parameter(1020, value)
        bench.cycles(4)
        assert job.Error
        assert bench.axis.var("Actor.RemoveEnableReaction") == 5
        bench.now()
        bench.alarm(ALARM)
        bench.run(0.05)
        bench.telegrams()
        assert bench.sequence("stw1") == [0x047A]


@pytest.mark.requirement("STP-349")
@pytest.mark.parametrize("kind", ["VirtualAxis.Mode", "Simulation.Mode"])
def test_value_means_nothing_without_a_drive(kind):
    """A virtual or simulated axis stops the same whatever the value, and its drive gets no telegram."""
    seen = []
    for value in VALUES:
        rig = Rig(variables={kind: 1, "Actor.RemoveEnableReaction": value})
        rig.port.write(0x0123, 45.0)
        rig.travelling()
        since = len(rig.rows)
        rig.axis.alarms.raise_alarm(ALARM)
        rig.cycles(10)
        assert rig.port.written == (0x0123, 45.0)
        seen.append(
            (
                rig.column("actual_velocity")[since:],
                rig.column("state")[since + 2 :],  # a ramp of a virtual axis ends with its actual value
                rig.axis.power_instance.Status,
            )
        )
    assert seen.count(seen[0]) == 4
    assert seen[0][0][-1] == 0.0


# -- enabling again
# ------------------------------------------------------------------------------------------------------------


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-381", "MC-158", "STP-033")
@pytest.mark.parametrize("value", VALUES)
def test_enabling_in_the_right_order_moves_nothing(value):
    """Reaction 0 and X7 awaited, then Enable: the axis stays where it stands."""
    with StopBench(variables={"Actor.RemoveEnableReaction": value}).travelling(200.0) as bench:
        bench.alarm(ALARM)
        bench.until(lambda: bench.axis.var("StatusWord.X7"))
        bench.axis.power(False)
        bench.until(bench.power.off)
        bench.until(bench.axis.reset().done)
        assert bench.axis.var("ErrorDetail.Reaction") == 0
        bench.run(0.1)
        assert not bench.power.Status
        place = bench.axis.var("ActualPosition")
        bench.axis.power(True)
        bench.until(bench.power.status)
        bench.run(0.2)
        window = bench.axis.var("PositioningMonitoring.Window")
        assert abs(bench.axis.var("ActualPosition") - place) < min(window, 0.01)


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-382", "STP-489", "STP-568", "MC-158")
def test_acknowledging_an_off1_ramp():
    """At 100 ms ON comes back, S5 goes to S4 while the axis moves, and it settles after a bounded
    compensating motion.
    """
    with StopBench(variables={"Actor.RemoveEnableReaction": 1}).travelling() as bench:
        bench.now()
        bench.alarm(ALARM)
        bench.run(0.1)
        bench.watch("reset", bench.axis.reset())
        bench.until(bench.power.status)
        assert bench.axis.state is AxisState.ENABLE_RAMP
        speed = bench.axis.actual_velocity
        captured = bench.axis.var("ActualPosition")
        bench.run(0.5)
        bench.telegrams()
        assert bench.sequence("stw1") == [0x047E, 0x04FE, 0x047E, 0x047F]
        assert bench.states() == ["S4", "S5", "S4"]
        assert speed > 200.0
        # MaxDeceleration without jerk limit, and what the transport delay adds.
        assert bench.axis.var("ActualPosition") - captured == pytest.approx(
            speed**2 / 2 / 2000.0, abs=speed * 3 * CYCLE_S
        )
        assert bench.axis.state is AxisState.STANDSTILL
        assert abs(bench.axis.actual_velocity) < 0.1


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-383", "STP-490", "STP-568")
@pytest.mark.parametrize(
    ("value", "states"),
    [
        (3, ["S4", "S1", "S2", "S3", "S4"]),
        (5, ["S4", "S5", "S1", "S2", "S3", "S4"]),
        (7, ["S4", "S5", "S1", "S2", "S3", "S4"]),
    ],
)
def test_acknowledging_a_stop_that_cannot_be_interrupted(value, states):
    """The alarm goes at once, but the drive comes through S1, S2 and S3 to S4, after a quick stop from
    standstill.
    """
    with StopBench(variables={"Actor.RemoveEnableReaction": value}).travelling() as bench:
        bench.now()
        bench.alarm(ALARM)
        bench.run(0.1)
        reset = bench.axis.reset()
        bench.until(reset.done)
        assert bench.axis.var("ErrorDetail.Number") == 0
        assert not bench.power.Status
        bench.until(bench.power.status)
        bench.run(0.5)
        rows = bench.telegrams()
        assert bench.states() == states
        on = bench.first(lambda row: row.state == "S4", bench.edge + 10)
        if value != 3:
            assert abs(rows[on].nact) < 1.0
        assert all(row.stw1 & 0x2 for row in rows[bench.edge :] if row.state == "S5")
        assert bench.axis.state is AxisState.STANDSTILL
        assert not any(event.data["number"] != ALARM for event in bench.events("alarm.raised"))


@pytest.mark.exhaustive
@pytest.mark.requirement(
    "STP-384", "STP-385", "STP-569", "STP-491", "STP-492", "MC-155", "MC-156", "STP-522", "STP-523"
)
@pytest.mark.parametrize("mode", [0, 1, 2, 3])
@pytest.mark.parametrize("value", VALUES)
def test_disabling_during_the_stop(value, mode):
    """16#7: the quick stop ends first, STW1.1 stays 1 until standstill. Any other value: OFF2 at once, the
    axis coasts.
    """
    with StopBench(variables={"Actor.RemoveEnableReaction": value}).travelling() as bench:
        bench.alarm(ALARM)
        bench.run(0.1)
        bench.now()
        power = bench.axis.power(False, stop_mode=mode)
        bench.until(power.off)
        bench.run(0.1)
        rows = bench.telegrams()
        first = WORDS[value][0]
        if value == 7:
            assert bench.sequence("stw1") == [0x047B, 0x0478]
            assert bench.states() == ["S5", "S1"]
            assert abs(rows[bench.first(lambda row: row.state == "S1")].actual_velocity) < 3.0
        else:
            assert bench.sequence("stw1") == ([first] if first != 0x047C else []) + [0x047C]
            assert rows[bench.edge + 1].stw1 & 0x04FF == 0x047C
            assert not rows[bench.edge + 2].pulses
            assert rows[bench.edge + 2].nact > 150.0
        assert bench.axis.state is AxisState.ALARM_DISABLED
        assert (power.Status, power.Busy) == (False, False)
        bench.until(bench.axis.reset().done)
        bench.run(0.1)
        assert bench.axis.state is AxisState.DISABLED
