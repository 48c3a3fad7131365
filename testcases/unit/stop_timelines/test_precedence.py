"""Every pair of stops in both orders, on the words of the telegram (sections 8.12 and 10)."""

from __future__ import annotations

from collections import Counter

import pytest

from motion.s7.axis import AxisState
from testcases.campaigns._superseding import COLUMNS, MATRIX
from testcases.unit.stop_timelines.telegram_record import CYCLE_S, StopBench

ALARMS = {
    "alarm-1": (533, 1),
    "alarm-2": (104, 2),
    "alarm-3": (321, 3),
    "alarm-4": (521, 4),
    "alarm-7": (521, 4),
}
AXIS_RAMP = {
    "stop-3": 1000.0,
    "alarm-1": 1000.0,
    "stop-2": 2000.0,
    "alarm-2": 2000.0,
    "power-2": 2000.0,
    "stop-0": 4000.0,
    "alarm-3": 4000.0,
    "power-0": 4000.0,
}
"""Deceleration of the ramps that the axis makes, mm/s2; alarm 533 takes that of the job."""
PATTERN = {1: 0x047E, 3: 0x047C, 5: 0x047A, 7: 0x047B}
AFTERWARDS = {1: [0x047E], 3: [0x047C], 5: [0x047A], 7: [0x047B, 0x0478]}
DISABLES = {"alarm-2", "alarm-3", "alarm-4", "alarm-7"}


def pairs():
    """Return a parameter for every cell; where reaction 4 takes part, with the values of
    RemoveEnableReaction in turn, so that every outcome meets every value.
    """
    turn: Counter[str] = Counter()
    for line in MATRIX.strip().splitlines():
        identifier, active, *letters = line.split()
        for new, letter in zip(COLUMNS, letters, strict=True):
            if letter == "-":
                continue
            values: tuple[int, ...] = (
                (7,)
                if active == "alarm-7"
                else (1, 3, 5)
                if active == "alarm-4"
                else (1, 3, 5, 7)
                if new == "alarm-4"
                else (5,)
            )
            if letter != "R" and not (letter == "P" and new == "alarm-4"):  # these are few
                side = f"{letter} {'alarm-4' if active == 'alarm-4' else new}"
                values = (values[turn[side] % len(values)],)
                turn[side] += 1
            for value in values:
                yield pytest.param(
                    active,
                    new,
                    letter,
                    value,
                    id=f"{active}-{new}-16#{value}",
                    marks=pytest.mark.requirement(identifier, *EXTRA.get((active[:5], new[:5]), ())),
                )


EXTRA = {
    ("alarm", "stop-"): ("STP-253", "STP-438"),
    ("stop-", "alarm"): ("STP-253", "STP-436", "STP-437"),
    ("power", "stop-"): ("STP-575",),
    ("stop-", "power"): ("STP-498", "STP-499", "STP-500"),
    ("alarm", "power"): ("STP-396",),
    ("power", "alarm"): ("STP-503",),
}


def give(bench, what):
    """Give a stop; returns the job of an MC_Stop."""
    kind, number = what.split("-")
    if kind == "stop":
        return bench.axis.stop(int(number), Deceleration=1000.0, Jerk=10000.0)
    if kind == "power":
        bench.axis.power(False, stop_mode=int(number))
    else:
        bench.alarm(*ALARMS[what])
    return None


def expected_words(active, new, letter, value):
    """Return the control words from the first stop on."""
    disables = {active, new} & DISABLES or "power" in active + new
    ramp_end = [0x047F, 0x047E] if disables else [0x047F]
    quick = [0x047F, 0x047B, 0x0478, 0x047E]
    if letter in "2W":
        first = PATTERN[value]
        return [0x047B, 0x0478] if letter == "W" else list(dict.fromkeys([first, 0x047C]))
    if letter == "R":
        further = PATTERN[value] & 0x047B
        return (
            [0x047F, 0x047B, 0x047C]
            if value == 3
            else list(dict.fromkeys([0x047F, 0x047B, further, 0x0478, 0x047E]))
        )
    winner = new if letter == "N" else active
    if winner in AXIS_RAMP:
        return ramp_end
    if winner == "power-1":
        return quick
    if winner == "power-3":
        return [0x047F, 0x047C]
    return ([0x047F] if active not in ("alarm-4", "alarm-7") else []) + AFTERWARDS[value]


@pytest.mark.exhaustive
@pytest.mark.parametrize(("active", "new", "letter", "value"), list(pairs()))
def test_pair(active, new, letter, value):
    """Who brakes and how, what the MC_Stop jobs show, the words from the first to the last, and how it
    ends.
    """
    with StopBench(variables={"Actor.RemoveEnableReaction": value}).travelling() as bench:
        bench.now()
        first = give(bench, active)
        bench.cycles(2 if active == "power-3" else 6)
        second_at = len(bench.rows)
        second = give(bench, new)
        bench.run(0.02)
        early = [
            None if job is None else (job.Busy, job.CommandAborted, job.Error) for job in (first, second)
        ]
        bench.run(1.9 if letter == "2" or 3 in (value, int(active[-1]), int(new[-1])) else 0.8)
        rows = bench.telegrams()

        # the jobs
        if second is not None:
            wins = letter == "N"
            assert early[1] == (wins, letter == "A", letter == "E")
            assert second.Done is wins
            if letter == "E":
                assert second.ErrorID == 0x800F
        if first is not None:
            loses = letter == "N"
            assert early[0] == (not loses, loses, False)
            assert first.Done is not loses
            assert not first.Error

        # the words
        assert [f"{word:04X}" for word in bench.sequence("stw1")] == [
            f"{word:04X}" for word in expected_words(active, new, letter, value)
        ]

        # the ramp
        winner = new if letter == "N" else active
        if winner in AXIS_RAMP:
            slopes = [row.acceleration for row in rows[second_at + 1 :] if row.setpoint > 0.0]
            if AXIS_RAMP[winner] >= AXIS_RAMP.get(active, 0.0):
                assert min(slopes) == pytest.approx(-AXIS_RAMP[winner], rel=0.05)
            else:  # Enable = FALSE takes over whatever brakes; MaxJerk leads from 4000 towards 2000 mm/s2
                assert slopes[10] - slopes[0] == pytest.approx(20_000.0 * 10 * CYCLE_S, rel=0.05)
        else:
            braking = {"power-1": 5, "power-3": 3}.get(winner, value)
            if letter == "2" or (letter == "R" and value == 3):
                braking = 3
            at = bench.first(lambda row: row.zsw1 & 0x0004 == 0, second_at)
            slope = (rows[at + 15].nact - rows[at + 5].nact) / (10 * CYCLE_S)
            low, high = {1: (-520, -480), 3: (-350, -150), 5: (-1050, -950), 7: (-1050, -950)}[braking]
            assert low < slope < high
            assert rows[at + 5].pulses is (braking != 3)

        # the end
        disabled = bool({active, new} & DISABLES) or "power" in active + new
        alarm = "alarm" in active + new
        assert rows[-1].status is not disabled
        assert rows[-1].busy is ("power" not in active + new)
        assert bool(rows[-1].x & 0x2) is alarm
        assert abs(rows[-1].nact) < 0.1
        if disabled:
            assert bench.axis.state is (AxisState.ALARM_DISABLED if alarm else AxisState.DISABLED)
        else:
            assert bench.axis.state is (AxisState.ALARM_STANDSTILL if alarm else AxisState.STOP_HOLD)


# -- the examples with their numbers
# -----------------------------------------------------------------------------------------------


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-439", "STP-443", "STP-484")
def test_example_1():
    """Reaction 2, 100 ms later MC_Stop Mode 0: 150 ms and 31.7 mm in all, Done, then disabled; no job while
    the alarm is pending.
    """
    with StopBench().travelling() as bench:
        bench.now()
        bench.alarm(104)
        bench.cycles(24)
        stop = bench.watch("stop", bench.axis.stop(0))
        bench.run(0.5)
        rows = bench.telegrams()
        duration, travel = bench.ramp("setpoint")
        assert duration == pytest.approx(0.150, abs=2 * CYCLE_S)
        assert travel == pytest.approx(31.7, abs=300.0 * 2 * CYCLE_S)
        done = bench.first(lambda row: row.jobs.get("stop", {}).get("Done"))
        assert rows[done].setpoint == 0.0
        off = bench.first(lambda row: not row.status)
        assert off > done
        assert rows[off].busy
        stop.set(Execute=False)
        bench.cycles(3)
        job = bench.axis.move_velocity(20.0)
        bench.cycles(2)
        assert job.ErrorID == 0x8001


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-440")
def test_example_2():
    """MC_Stop Mode 3, 100 ms later reaction 2: MC_Stop is aborted, about 288 ms in all instead of 400."""
    with StopBench().travelling() as bench:
        bench.now()
        stop = bench.axis.stop(3, Deceleration=1000.0, Jerk=10000.0)
        bench.cycles(25)
        assert bench.rows[-1].setpoint == pytest.approx(250.0, abs=5.0)
        bench.alarm(104)
        bench.run(0.5)
        bench.telegrams()
        assert (stop.CommandAborted, stop.Error) == (True, False)
        assert bench.ramp("setpoint")[0] == pytest.approx(0.288, abs=2 * CYCLE_S)


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-442")
def test_alarm_of_equal_severity_during_mc_stop():
    """The ramp of MC_Stop goes on to its Done; then the alarm disables."""
    with StopBench().travelling() as bench:
        bench.now()
        bench.watch("stop", bench.axis.stop(2))
        bench.cycles(10)
        bench.alarm(104)
        bench.run(0.6)
        rows = bench.telegrams()
        assert bench.ramp("setpoint")[0] == pytest.approx(0.250, abs=2 * CYCLE_S)
        done = bench.first(lambda row: row.jobs["stop"]["Done"])
        off = bench.first(lambda row: row.stw1 & 0x04FF == 0x047E)
        assert done <= off <= done + 1
        assert (rows[-1].status, rows[-1].busy) == (False, True)


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-445", "STP-576")
def test_an_emergency_ramp_that_is_flatter():
    """EmergencyDeceleration 1000 below MaxDeceleration 2000: MC_Stop Mode 0 takes reaction 2 over and brakes
    less.
    """
    with StopBench(variables={"DynamicDefaults.EmergencyDeceleration": 1000.0}).travelling() as bench:
        bench.now()
        bench.alarm(104)
        bench.cycles(25)
        stop = bench.axis.stop(0)
        bench.run(0.8)
        rows = bench.telegrams()
        assert stop.Done
        assert rows[bench.edge + 24].acceleration == pytest.approx(-2000.0, abs=100.0)
        assert rows[bench.edge + 40].acceleration == pytest.approx(-1000.0, abs=1.0)
        # The emergency ramp begins with the actual velocity, which lags behind the setpoint by the transport
        # delay.
        assert bench.ramp("setpoint")[0] == pytest.approx(0.100 + 216.0 / 1000.0, abs=3 * CYCLE_S)


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-481", "STP-577")
@pytest.mark.parametrize(
    ("number", "reaction", "words", "state"),
    [
        (533, 1, [0x047F], AxisState.ALARM_STANDSTILL),
        (104, 2, [0x047E], AxisState.ALARM_DISABLED),
        (321, 3, [0x047E], AxisState.ALARM_DISABLED),
        (521, 4, [0x047B, 0x0478], AxisState.ALARM_DISABLED),
    ],
)
def test_alarm_while_mc_stop_holds(number, reaction, words, state):
    """Nothing moves; the drive is switched off, or stays on where the alarm lets it."""
    with StopBench().travelling() as bench:
        bench.until(bench.axis.stop(2).done)
        bench.run(0.1)
        bench.now()
        bench.alarm(number, reaction)
        bench.run(0.2)
        rows = bench.telegrams()
        assert bench.sequence("stw1") == words
        assert bench.axis.state is state
        assert max(abs(row.nact) for row in rows[bench.edge :]) < 0.1


@pytest.mark.requirement("STP-444")
@pytest.mark.parametrize("mode", [0, 2, 3])
@pytest.mark.parametrize("braking", [True, False])
def test_mc_stop_while_the_enable_is_removed(mode, braking):
    """Turned away with CommandAborted and no error, while the drive brakes and when it stands."""
    with StopBench().travelling() as bench:
        bench.alarm(521)
        bench.run(0.1 if braking else 0.8)
        stop = bench.axis.stop(mode)
        bench.cycles(2)
        assert (stop.CommandAborted, stop.Error, stop.Busy) == (True, False, False)
