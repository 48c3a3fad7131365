"""Disabling with MC_Power behind a PROFIdrive telegram, step by step as printed (sections 8.3 to 8.6)."""

from __future__ import annotations

from functools import cache

import pytest

from testcases.unit.stop_timelines.telegram_record import (
    CYCLE_S,
    StopBench,
    after,
    answer,
    before,
    drive_off,
    end,
    event,
    setpoint_zero,
    step,
    steps,
    when,
)

BEFORE = {
    "setpoint": (300.0, 0.001),
    "nset": (300.0, 0.5),
    "stw1": 0x047F,
    "zsw1": 0x0237,
    "state": "S4",
    "on": "0 10 12",
    "in_operation": True,
    "status": True,
    "busy": True,
    "job_move": "Busy",
}
ON = {"status": True, "busy": True}
OFF = {"status": False, "busy": False, "in_operation": False}

standstill = when(lambda row: not row.pulses, plus=1)
"""The first answer of a drive that has taken its pulses away."""
off = when(lambda row: not row.busy)
"""The disabling is complete."""


@cache
def disabled(stop_mode, **drive):
    """Return the record of a travelling axis that is disabled with a stop mode."""
    with StopBench(drive=drive).travelling() as bench:
        bench.now()
        bench.axis.power(False, stop_mode=stop_mode)
        bench.cycles(10)
        bench.watch("late", bench.axis.move_velocity(50.0))
        bench.run(2.0 if stop_mode == 3 else 0.6)
        bench.telegrams()
        return bench


TIMELINES = {
    "StopMode 0": [
        step("STP-302", before, **BEFORE),
        step("STP-303", event, off="10", on="0", job_move="CommandAborted", state="S4", **ON),
        step("STP-303", answer, stw1=0x047F, zsw1=0x0237, off="10 12", on="0 14"),
        step("STP-304", answer, acceleration=(-4000.0, 1.0)),
        step(
            "STP-304",
            after(40),
            stw1=0x047F,
            zsw1=0x0237,
            state="S4",
            on="0 14",
            acceleration=(-4000.0, 1.0),
            **ON,
        ),
        step("STP-304 STP-251", after(40), job_late="Error 800F"),
        step("STP-305", setpoint_zero, stw1=0x047E, off="14", nset=(0.0, 0.001), state="S4", **ON),
        step(
            "STP-305",
            when(lambda row: row.setpoint == 0.0, plus=1),
            stw1=0x047E,
            zsw1=0x0233,
            state="S5",
            **ON,
        ),
        step("STP-306", standstill, stw1=0x047E, zsw1=0x0231, state="S2", in_operation=False),
        step(
            "STP-307 STP-290 STP-294",
            drive_off,
            zsw1=0x0231,
            stw1=0x047E,
            off="0",
            on="6",
            follows=True,
            **OFF,
        ),
        step(
            "STP-307 STP-287 STP-293",
            end,
            zsw1=0x0231,
            stw1=0x047E,
            state="S2",
            on="6 7",
            off="0",
            follows=True,
            **OFF,
        ),
    ],
    "StopMode 1": [
        step("STP-314", before, **BEFORE),
        step("STP-315", event, off="10", on="0 14", job_move="CommandAborted", **ON),
        step("STP-315", answer, stw1=0x047B, nset=(0.0, 0.001), follows=True, on="14", state="S4", **ON),
        step("STP-316", after(8), stw1=0x047B, zsw1=0x0213, state="S5", in_operation=False, on="0 14", **ON),
        step(
            "STP-317",
            after(160),
            stw1=0x047B,
            zsw1=0x0213,
            state="S5",
            nset=(0.0, 0.001),
            nact=(150.0, 5.0),
            number=0,
            follows=True,
            on="0 14",
            in_operation=False,
            **ON,
        ),
        step("STP-317 STP-251", after(160), job_late="Error 800F"),
        step("STP-318", standstill, zsw1=0x0250, state="S1", pulses=False, **ON),
        step("STP-319", drive_off, stw1=0x0478, off="14", **ON),
        step(
            "STP-319",
            when(lambda row: row.zsw1 & 0x0006 == 0, plus=1),
            stw1=0x0478,
            zsw1=0x0240,
            state="S1",
            **ON,
        ),
        step("STP-320 STP-294", off, stw1=0x047E, on="6", off="0", follows=True, **OFF),
        step(
            "STP-320 STP-287 STP-293",
            end,
            stw1=0x047E,
            zsw1=0x0231,
            state="S2",
            on="6 7",
            off="0",
            follows=True,
            **OFF,
        ),
    ],
    "StopMode 2": [
        step("STP-326", before, **BEFORE),
        step("STP-326", event, off="10", on="0", job_move="CommandAborted", state="S4", **ON),
        step("STP-326", answer, stw1=0x047F, zsw1=0x0237, off="12", on="0 14", setpoint=(300.0, 0.2), **ON),
        step(
            "STP-327",
            after(104),
            setpoint=(200.0, 2 * 8.0),
            acceleration=(-2000.0, 1.0),
            stw1=0x047F,
            state="S4",
            on="0 14",
        ),
        step(
            "STP-327",
            after(152),
            setpoint=(100.0, 2 * 8.0),
            acceleration=(-2000.0, 161.0),
            stw1=0x047F,
            zsw1=0x0237,
            on="14",
        ),
        step("STP-327", after(200), acceleration=(-1000.0, 161.0), stw1=0x047F, on="14", **ON),
        step("STP-327 STP-251", after(52), job_late="Error 800F"),
        step("STP-328", setpoint_zero, stw1=0x047E, off="14", nset=(0.0, 0.001), state="S4", **ON),
        step("STP-328", when(lambda row: row.setpoint == 0.0, plus=1), zsw1=0x0233, in_operation=False),
        step(
            "STP-329 STP-290 STP-294",
            drive_off,
            stw1=0x047E,
            zsw1=0x0231,
            state="S2",
            on="6",
            off="0",
            follows=True,
            **OFF,
        ),
        step(
            "STP-329 STP-287 STP-293",
            end,
            stw1=0x047E,
            zsw1=0x0231,
            state="S2",
            on="6 7",
            off="0",
            follows=True,
            **OFF,
        ),
    ],
    "StopMode 3": [
        step("STP-336", before, **BEFORE),
        step("STP-336", event, off="10", job_move="CommandAborted", **ON),
        step("STP-336", answer, stw1=0x047C, nset=(0.0, 0.001), off="10 14", follows=True, **ON),
        step("STP-337", after(8), stw1=0x047C, zsw1=0x0260, state="S1", pulses=False, in_operation=False),
        step(
            "STP-338 STP-290 STP-294",
            drive_off,
            stw1=0x047C,
            zsw1=0x0260,
            on="6",
            off="0 7 14",
            follows=True,
            nact=(300.0, 2.0),
            **OFF,
        ),
        step("STP-338 STP-251", after(48), job_late="Error 800F", nact=(290.0, 5.0)),
        step(
            "STP-339 STP-288",
            end,
            stw1=0x047C,
            zsw1=0x0260,
            state="S1",
            on="6 7",
            follows=True,
            nact=(0.0, 0.01),
            **OFF,
        ),
    ],
}


@pytest.mark.exhaustive
@pytest.mark.parametrize(("timeline", "step"), steps(TIMELINES))
def test_step(timeline, step):
    """What the step prints is on the wire, in the status word and at the outputs of the jobs."""
    step.check(disabled(int(timeline[-1])))


STANDSTILL_DWELL_S = 0.02


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("mode", "words", "answers", "states"),
    [
        pytest.param(
            0,
            [0x047F, 0x047E],
            [0x0237, 0x0233, 0x0231],
            ["S4", "S5", "S2"],
            marks=pytest.mark.requirement("STP-305", "STP-306", "STP-289"),
        ),
        pytest.param(
            1,
            [0x047F, 0x047B, 0x0478, 0x047E],
            [0x0237, 0x0213, 0x0250, 0x0240, 0x0231],
            ["S4", "S5", "S1", "S2"],
            marks=pytest.mark.requirement("STP-318", "STP-319", "STP-320", "STP-005", "STP-289"),
        ),
        pytest.param(
            2,
            [0x047F, 0x047E],
            [0x0237, 0x0233, 0x0231],
            ["S4", "S2"],
            marks=pytest.mark.requirement("STP-328", "STP-289"),
        ),
        pytest.param(
            3,
            [0x047F, 0x047C],
            [0x0237, 0x0260],
            ["S4", "S1"],
            marks=pytest.mark.requirement("STP-337", "STP-288"),
        ),
    ],
)
def test_words_of_a_stop(mode, words, answers, states):
    """All words of both directions in their order; a drive that already stands is in S5 for less than a
    cycle.
    """
    bench = disabled(mode)
    assert [f"{word:04X}" for word in bench.sequence("stw1")] == [f"{word:04X}" for word in words]
    assert [f"{word:04X}" for word in bench.sequence("zsw1")] == [f"{word:04X}" for word in answers]
    assert bench.states() == states


@pytest.mark.parametrize(
    ("mode", "value", "seconds", "travel"),
    [
        pytest.param(
            0,
            "setpoint",
            0.075,
            11.25,
            marks=pytest.mark.requirement("STP-008", "STP-239", "STP-301", "STP-304"),
        ),
        pytest.param(
            1, "nact", 0.300, 45.0, marks=pytest.mark.requirement("STP-010", "STP-240", "STP-311", "STP-317")
        ),
        pytest.param(
            2,
            "setpoint",
            0.250,
            37.5,
            marks=pytest.mark.requirement("STP-009", "STP-241", "STP-324", "STP-327"),
        ),
    ],
)
def test_ramp(mode, value, seconds, travel):
    """Duration and travel of the ramp: that of the setpoint where the axis makes it, that of NIST_B where the
    drive does.
    """
    bench = disabled(mode)
    duration, way = bench.ramp(value)
    assert duration == pytest.approx(seconds, abs=2 * CYCLE_S)
    assert way == pytest.approx(travel, abs=300.0 * 2 * CYCLE_S)
    if mode != 1:  # the drive follows: what it puts out is the setpoint, later by the transport delay
        assert max(abs(row.nset - row.setpoint) for row in bench.rows[bench.edge :]) < 1.0


@pytest.mark.requirement("STP-307", "STP-320", "STP-329", "STP-339", "STP-412")
@pytest.mark.parametrize("mode", [0, 1, 2, 3])
def test_standstill_signal(mode):
    """X7 comes when the actual velocity has been in its window for the dwell time, and not before."""
    bench = disabled(mode)
    inside = bench.first(lambda row: abs(row.actual_velocity) <= 2.0)
    signal = bench.first(lambda row: row.x >> 7 & 1)
    assert (signal - inside) * CYCLE_S == pytest.approx(STANDSTILL_DWELL_S, abs=CYCLE_S)


@pytest.mark.requirement("STP-312", "STP-295", "STP-458", "STP-459", "STP-507", "STP-508")
@pytest.mark.parametrize("mode", [0, 1, 2, 3])
def test_status_and_busy_fall_together(mode):
    """Both stay until the drive has said that it is off, and fall in the same cycle."""
    bench = disabled(mode)
    complete = bench.first(lambda row: not row.busy)
    assert all(row.status and row.busy and row.x & 1 for row in bench.rows[bench.edge : complete])
    assert not any(row.status or row.busy or row.x & 1 for row in bench.rows[complete:])
    assert bench.rows[complete].zsw1 & 0x0006 == 0
    assert all(
        row.zsw1 & 0x0006 for row in bench.rows[bench.edge : bench.first(lambda row: not row.zsw1 & 0x0006)]
    )
