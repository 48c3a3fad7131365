"""Alarm reactions 1, 2 and 3 behind a PROFIdrive telegram, and what every alarm does to the enable (sections
8.7 and 8.9).
"""

from __future__ import annotations

from functools import cache

import pytest

from hil.faults import Injector
from motion.s7.alarms import alarm
from motion.s7.axis import AxisState
from testcases.unit.stop_timelines.telegram_record import (
    CYCLE_S,
    StopBench,
    after,
    before,
    drive_off,
    end,
    event,
    setpoint_zero,
    step,
    steps,
    when,
)

ALARMS = {
    "reaction 1": (533, 1),
    "reaction 2": (104, 2),
    "reaction 3": (321, 3),
    "533": (533, 2),
    "531": (531, 3),
    "534": (534, 3),
}
"""Reaction 1 has only 533, which leaves the axis enabled, as 531 and 534 do with reaction 3."""
RAMP_S = {1: 0.400, 2: 0.250, 3: 0.075}
TRAVEL_MM = {1: 60.0, 2: 37.5, 3: 11.25}
ACKNOWLEDGED_MS = 800


@cache
def alarmed(name):
    """Return the record of a travelling axis with an alarm that is acknowledged at standstill, and that is
    moved again.
    """
    with StopBench().travelling() as bench:
        bench.now()
        bench.alarm(*ALARMS[name])
        bench.run(0.04)
        bench.watch("late", bench.axis.move_velocity(50.0))
        bench.run(0.46)
        bench.watch("refused", bench.axis.move_velocity(-50.0))
        bench.run(ACKNOWLEDGED_MS / 1000.0 - 0.5)
        bench.watch("reset", bench.axis.reset())
        bench.until(bench.jobs["reset"].done)
        bench.until(bench.power.status)
        bench.watch("again", bench.axis.move_velocity(-50.0))
        bench.run(0.3)
        bench.telegrams()
        return bench


def disabling(name):
    """Return the timeline of section 8.9."""
    number, reaction = ALARMS[name]
    shown = {"reaction": reaction, "number": number, "busy": True}
    acknowledged = when(lambda row: row.reaction == 0)
    return [
        step(
            "STP-390",
            before,
            stw1=0x047F,
            zsw1=0x0237,
            on="0",
            off="1",
            setpoint=(300.0, 0.001),
            job_move="Busy",
        ),
        step(
            "STP-390 STP-482",
            event,
            on="0 1 14",
            off="10 12",
            status=True,
            job_move="Error 8001",
            state="S4",
            **shown,
        ),
        step(
            "STP-391 STP-454",
            after(40),
            stw1=0x047F,
            zsw1=0x0237,
            state="S4",
            on="0 1 14",
            status=True,
            in_operation=True,
            **shown,
        ),
        step("STP-391 STP-252 STP-454", after(44), job_late="Error 8001"),
        step(
            "STP-392", setpoint_zero, stw1=0x047E, on="0 1", off="14", status=True, nset=(0.0, 0.001), **shown
        ),
        step(
            "STP-392",
            when(lambda row: row.setpoint == 0.0, plus=1),
            stw1=0x047E,
            zsw1=0x0233,
            in_operation=False,
            **shown,
        ),
        step(
            "STP-393 STP-485 STP-344 STP-290",
            drive_off,
            stw1=0x047E,
            zsw1=0x0231,
            state="S2",
            on="1 6",
            off="0",
            follows=True,
            status=False,
            **shown,
        ),
        step(
            "STP-393 STP-456",
            after(700),
            stw1=0x047E,
            zsw1=0x0231,
            on="1 6 7",
            off="0",
            follows=True,
            status=False,
            **shown,
        ),
        step("STP-393 STP-456", after(510), job_refused="Error 8001"),
        step("STP-394", acknowledged, off="1", number=0, job_reset="Done"),
        step(
            "STP-394 STP-493",
            when(_enabled_again),
            stw1=0x047F,
            zsw1=0x0237,
            state="S4",
            on="0",
            status=True,
            busy=True,
        ),
        step("STP-394", end, on="0 10", job_again="Busy", nact=(-50.0, 1.0)),
    ]


def _enabled_again(row):
    return row.reaction == 0 and row.status


def staying_enabled(name):
    """Return the same for an alarm that keeps the axis enabled (section 8.9.1)."""
    number, reaction = ALARMS[name]
    rule = {531: "STP-589", 533: "STP-590", 534: "STP-591"}[number]
    shown = {"reaction": reaction, "number": number, "busy": True, "status": True, "in_operation": True}
    return [
        step(f"STP-390 {rule}", event, on="0 1 14", off="10 12", job_move="Error 8001", state="S4", **shown),
        step(f"STP-391 {rule}", after(40), stw1=0x047F, zsw1=0x0237, state="S4", on="0 1 14", **shown),
        step(f"{rule} STP-597", setpoint_zero, stw1=0x047F, zsw1=0x0237, on="0 1 6", off="14", **shown),
        step(f"{rule} STP-597", after(700), stw1=0x047F, zsw1=0x0237, state="S4", on="0 1 6 7", **shown),
        step(f"{rule} STP-597", after(510), job_refused="Error 8001", **shown),
        step(
            f"{rule} STP-598",
            when(lambda row: row.reaction == 0),
            stw1=0x047F,
            zsw1=0x0237,
            on="0 6",
            off="1",
            status=True,
            busy=True,
        ),
        step("STP-598", end, stw1=0x047F, on="0 10", job_again="Busy", nact=(-50.0, 1.0)),
    ]


TIMELINES = {name: disabling(name) for name in ("reaction 2", "reaction 3")} | {
    name: staying_enabled(name) for name in ("reaction 1", "533", "531", "534")
}


@pytest.mark.exhaustive
@pytest.mark.parametrize(("timeline", "step"), steps(TIMELINES))
def test_step(timeline, step):
    """What the step prints is on the wire, in the status word and at the outputs of the jobs."""
    step.check(alarmed(timeline))


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    "name",
    [
        pytest.param("reaction 1", marks=pytest.mark.requirement("STP-012", "STP-243", "STP-386", "STP-391")),
        pytest.param("reaction 2", marks=pytest.mark.requirement("STP-009", "STP-244", "STP-387", "STP-391")),
        pytest.param("reaction 3", marks=pytest.mark.requirement("STP-008", "STP-245", "STP-388", "STP-391")),
        pytest.param("533", marks=pytest.mark.requirement("STP-590")),
        pytest.param("531", marks=pytest.mark.requirement("STP-589")),
        pytest.param("534", marks=pytest.mark.requirement("STP-591")),
    ],
)
def test_ramp(name):
    """Duration and travel of the setpoint, which the drive follows from the first to the last telegram."""
    bench = alarmed(name)
    duration, way = bench.ramp("setpoint")
    reaction = ALARMS[name][1]
    assert duration == pytest.approx(RAMP_S[reaction], abs=2 * CYCLE_S)
    assert way == pytest.approx(TRAVEL_MM[reaction], abs=300.0 * 2 * CYCLE_S)
    standing = bench.first(lambda row: row.setpoint == 0.0)
    assert max(abs(row.nset - row.setpoint) for row in bench.rows[bench.edge : standing]) < 1.0


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("name", "words", "states"),
    [
        pytest.param(
            "reaction 2",
            [0x047F, 0x047E, 0x04FE, 0x047E, 0x047F],
            ["S4", "S2", "S3", "S4"],
            marks=pytest.mark.requirement("STP-389", "STP-392", "STP-394", "STP-511"),
        ),
        pytest.param(
            "reaction 3",
            [0x047F, 0x047E, 0x04FE, 0x047E, 0x047F],
            ["S4", "S5", "S2", "S3", "S4"],
            marks=pytest.mark.requirement("STP-389", "STP-392", "STP-394", "STP-511"),
        ),
        *(
            pytest.param(
                name, [0x047F, 0x04FF, 0x047F], ["S4"], marks=pytest.mark.requirement(rule, "STP-598")
            )
            for name, rule in (
                ("reaction 1", "STP-590"),
                ("533", "STP-590"),
                ("531", "STP-589"),
                ("534", "STP-591"),
            )
        ),
    ],
)
def test_words_of_a_stop(name, words, states):
    """ON is withdrawn at the end of the ramp, or never; bit 7 is the acknowledgement."""
    bench = alarmed(name)
    assert [f"{word:04X}" for word in bench.sequence("stw1")] == [f"{word:04X}" for word in words]
    assert bench.states() == states


# -- what else happens during the ramp
# ----------------------------------------------------------------------------------------------


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-345", "MC-167")
@pytest.mark.parametrize("mode", [0, 1, 2, 3])
def test_stop_mode_has_no_say(mode):
    """Whatever StopMode is set, reaction 2 brakes with the maximum dynamics and never coasts."""
    with StopBench().travelling() as bench:
        bench.axis.power(True, stop_mode=mode)
        bench.cycles(3)
        bench.now()
        bench.alarm(104)
        bench.run(0.5)
        bench.telegrams()
        assert bench.ramp("setpoint")[0] == pytest.approx(0.250, abs=2 * CYCLE_S)
        assert bench.sequence("stw1") == [0x047F, 0x047E]


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-347", "STP-483")
@pytest.mark.parametrize(
    ("first", "second", "seconds"),
    [(1, 2, 0.288), (1, 3, 0.1625), (2, 3, 0.150), (2, 1, 0.250), (3, 1, 0.075), (3, 2, 0.075)],
)
def test_two_alarms(first, second, seconds):
    """The more severe reaction takes the ramp over after 100 ms, a less severe one changes nothing;
    ErrorDetail shows the former.
    """
    numbers = {1: (533, 1), 2: (104, 2), 3: (321, 3)}
    with StopBench().travelling() as bench:
        bench.now()
        bench.alarm(*numbers[first])
        bench.cycles(25 if second > first else 5)
        bench.alarm(*numbers[second])
        bench.run(0.6)
        bench.telegrams()
        duration, _ = bench.ramp("setpoint")
        assert duration == pytest.approx(seconds, abs=2 * CYCLE_S)
        assert bench.rows[-1].reaction == max(first, second)
        # One of the two disables: so does the end of the ramp, although 533 alone would not (STP-590).
        assert bench.sequence("stw1") == [0x047F, 0x047E]
        assert bench.axis.state is AxisState.ALARM_DISABLED


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-395", "STP-486")
@pytest.mark.parametrize("name", ["reaction 1", "reaction 2", "reaction 3"])
def test_acknowledged_during_the_ramp(name):
    """The ramp is completed, the drive stays on; a job is accepted from the acknowledgement on."""
    with StopBench().travelling() as bench:
        bench.now()
        bench.alarm(*ALARMS[name])
        bench.until(bench.axis.reset().done)
        assert bench.axis.state is AxisState.ALARM_RAMP
        bench.run(0.6)
        bench.telegrams()
        assert bench.sequence("stw1") == [0x047F, 0x04FF, 0x047F]
        assert bench.ramp("setpoint")[0] == pytest.approx(RAMP_S[ALARMS[name][1]], abs=2 * CYCLE_S)
        assert all(row.status for row in bench.rows[bench.edge :])
        assert bench.axis.state is AxisState.STANDSTILL
    with StopBench().travelling() as bench:
        bench.alarm(*ALARMS[name])
        bench.until(bench.axis.reset().done)
        job = bench.axis.move_velocity(80.0)
        bench.until(job.in_velocity)


# time from the alarm to the end of the ramp, words; the disabling comes 40 ms after the alarm
DISABLED_MEANWHILE = [
    # reaction, StopMode, words, whose ramp
    (1, 0, [0x047F, 0x047E], "emergency"),
    (1, 1, [0x047F, 0x047B, 0x0478, 0x047E], "OFF3"),
    (1, 2, [0x047F, 0x047E], "maximum"),
    (1, 3, [0x047F, 0x047C], "coast"),
    (2, 0, [0x047F, 0x047E], "emergency"),
    (2, 1, [0x047F, 0x047B, 0x0478, 0x047E], "OFF3"),
    (2, 2, [0x047F, 0x047E], "unchanged"),
    (2, 3, [0x047F, 0x047C], "coast"),
    (3, 0, [0x047F, 0x047E], "unchanged"),
    (3, 1, [0x047F, 0x047B, 0x0478, 0x047E], "OFF3"),
    (3, 2, [0x047F, 0x047E], "unchanged"),
    (3, 3, [0x047F, 0x047C], "coast"),
]


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-396", "STP-519", "STP-520", "STP-521")
@pytest.mark.parametrize(("reaction", "mode", "words", "ramp"), DISABLED_MEANWHILE)
def test_disabled_during_the_ramp(reaction, mode, words, ramp):
    """Quick stop and coasting act at once, a ramp only if it is more severe; at the end Busy and Status are
    FALSE.
    """
    with StopBench().travelling() as bench:
        bench.now()
        bench.alarm(*ALARMS[f"reaction {reaction}"])
        bench.cycles(10)
        second = len(bench.rows)
        power = bench.axis.power(False, stop_mode=mode)
        bench.until(power.off)
        bench.run(0.02)
        rows = bench.telegrams()
        assert bench.sequence("stw1") == words
        if ramp == "unchanged":
            assert bench.ramp("setpoint")[0] == pytest.approx(RAMP_S[reaction], abs=2 * CYCLE_S)
        elif ramp == "emergency":
            assert rows[second + 3].acceleration == pytest.approx(-4000.0, abs=1.0)
        elif ramp == "maximum":
            slopes = [row.acceleration for row in rows[second:]]
            assert min(slopes) == pytest.approx(-2000.0, abs=80.0)
        elif ramp == "OFF3":
            at = bench.first(lambda row: row.state == "S5", second)
            slope = (rows[at + 5].nact - rows[at + 1].nact) / (4 * CYCLE_S)
            assert slope == pytest.approx(-1000.0, abs=50.0)
        else:
            at = bench.first(lambda row: not row.pulses, second)
            assert abs(rows[at].nact) > 50.0 or reaction == 3
        assert (power.Status, power.Busy) == (False, False)
        assert rows[-1].x & 0x3 == 0x2
        assert bench.axis.state is AxisState.ALARM_DISABLED


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-397", "STP-574", "STP-487")
@pytest.mark.parametrize("name", ["reaction 1", "reaction 2", "reaction 3"])
def test_link_lost_during_the_ramp(name):
    """Alarm 431 with reaction 4 takes over; the drive brakes by itself when it misses the telegrams."""
    with StopBench().travelling() as bench:
        bench.now()
        bench.alarm(*ALARMS[name])
        bench.cycles(6)
        Injector(bench.machine).inject("telegram.lost", "drive1", direction="setpoint")
        Injector(bench.machine).inject("telegram.lost", "drive1", direction="actual")
        bench.run(1.0)
        assert bench.axis.state in (AxisState.ALARM_DRIVE_STOP, AxisState.ALARM_DISABLED)
        assert (bench.axis.var("ErrorDetail.Number"), bench.axis.var("ErrorDetail.Reaction")) == (431, 4)
        assert not bench.power.Status
        assert bench.power.Busy
        assert abs(bench.machine.drive().mechanics.velocity) < 0.001
        assert not bench.machine.drive().core.enabled


# -- every alarm
# ------------------------------------------------------------------------------------------------------------

KEPT, RAMPED, AT_ONCE, TRACKED, NOTHING = (
    "kept enabled",
    "disabled at standstill",
    "disabled at once",
    "tracking",
    "nothing",
)
TABLE = [
    ("STP-589", [(531, 3)], KEPT),
    ("STP-590", [(533, 1), (533, 2)], KEPT),
    ("STP-591", [(534, 3)], KEPT),
    ("STP-592", [(number, 2) for number in (104, 307, 341, 601, 608)], RAMPED),
    ("STP-593", [(number, 3) for number in (304, 305, 306, 321, 342)], RAMPED),
    (
        "STP-594",
        [
            (number, 4)
            for number in (
                101,
                102,
                103,
                105,
                106,
                107,
                108,
                109,
                113,
                114,
                201,
                203,
                204,
                308,
                323,
                343,
                401,
                411,
                412,
                421,
                431,
                521,
                541,
                542,
                552,
                603,
                612,
                531,
                534,
            )
        ],
        AT_ONCE,
    ),
    ("STP-595", [(550, 5)], TRACKED),
    (
        "STP-596",
        [(number, 0) for number in (110, 111, 112, 322, 501, 502, 503, 504, 511, 522, 551, 202)],
        NOTHING,
    ),
]
OF_SYNCHRONOUS_AXES = (114, 601, 603, 608, 612)
WARNINGS = (110, 111, 112, 322, 501, 502, 503, 504, 511, 522, 551)


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("number", "reaction", "effect"),
    [
        pytest.param(
            number,
            reaction,
            effect,
            id=f"{number}-{reaction}",
            marks=pytest.mark.requirement(identifier, "STP-342", "STP-343"),
        )
        for identifier, alarms, effect in TABLE
        for number, reaction in alarms
        if number not in OF_SYNCHRONOUS_AXES
    ],
)
def test_every_alarm(number, reaction, effect):
    """X0, Status and the words on the wire, in the cycle of the alarm, while it brakes, and afterwards."""
    with StopBench().travelling(100.0) as bench:
        bench.now()
        configurable = number in (531, 533, 534)
        bench.alarm(number, reaction if configurable else None)
        bench.run(0.5)
        rows = bench.telegrams()[bench.edge :]
        assert rows[0].number == number
        assert rows[0].reaction == reaction
        assert bool(rows[-1].x & 0x2) is (
            number not in WARNINGS
        )  # X1: a pending alarm of class F or R (STP-513)
        enabled = {(row.x & 1, row.status) for row in rows}
        words = bench.sequence("stw1")
        if effect == NOTHING:
            assert enabled == {(1, True)}
            assert words == [0x047F]
            assert bench.jobs["move"].Busy
            assert rows[-1].nact == pytest.approx(100.0, abs=1.0)
            return
        assert bench.jobs["move"].ErrorID == 0x8001
        assert all(row.busy for row in rows)
        if effect == KEPT:
            assert enabled == {(1, True)}
            assert words == [0x047F]
            assert abs(rows[-1].nact) < 0.1
        elif effect == RAMPED:
            assert words == [0x047F, 0x047E]
            assert all(row.status for row in rows if row.setpoint != 0.0)
            assert (rows[-1].x & 1, rows[-1].status) == (0, False)
        elif effect == AT_ONCE:
            assert enabled == {(0, False)}
            assert words == [0x047B, 0x0478]
        else:
            assert enabled == {(0, False)}
            assert words == [0x047F]
            assert {row.output for row in rows} == {0.0}


@pytest.mark.requirement("STP-592", "STP-594")
@pytest.mark.parametrize("number", OF_SYNCHRONOUS_AXES)
def test_alarms_of_synchronous_axes(number):
    """They have the reaction of the table, and none of them leaves the axis enabled."""
    reaction = next(reaction for _, alarms, _ in TABLE for one, reaction in alarms if one == number)
    assert alarm(number).reactions == (reaction,)
    assert alarm(number).stays_enabled == ()
