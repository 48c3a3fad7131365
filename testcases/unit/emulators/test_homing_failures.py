"""Homing runs that fail, are interrupted or halted, and what becomes of the coordinates afterwards."""

from __future__ import annotations

import math
from functools import partial
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from emulators.drive.cia402 import HomingConfig
from fieldbus.canopen import SdoAbort
from fieldbus.cia402 import DriveState
from fieldbus.clock import MS
from fieldbus.errors import UnsupportedFaultError
from testcases.unit.emulators.homing_rig import (
    COUNTS,
    FAST_MM_S,
    LEAD_MM,
    LIMIT_MM,
    SLOW_MM_S,
    STOP_MM,
    home,
    machine,
    prepare,
)

CAM = (-5.0, 5.0)
TO_THE_RIGHT = (5.0, math.inf)
TO_THE_LEFT = (-math.inf, -5.0)


def fails(run) -> None:
    """Check that a run has ended with bit 13, EMCY 8612h, at rest, enabled, away from the end stops."""
    run.bench.run(0.01)
    assert run.statuses[-1] == 0b101
    assert run.bench.emcys == [(0x8612, 0x21)]
    assert run.bench.state is DriveState.OPERATION_ENABLED
    assert abs(run.samples[-1][2]) < 0.1
    assert not run.drive.axis.homed


# -- switches ------------------------------------------------------------------------------------------


@pytest.mark.requirement("C402-136", "C402-135")
@pytest.mark.parametrize(
    ("method", "cam", "start", "stuck"),
    [
        (3, TO_THE_RIGHT, 0.0, False),
        (4, TO_THE_RIGHT, 20.0, True),
        (5, TO_THE_LEFT, 0.0, False),
        (6, TO_THE_LEFT, -20.0, True),
        (19, TO_THE_RIGHT, 20.0, True),
        (22, TO_THE_LEFT, 30.0, False),
    ],
)
def test_limit_switch_ends_a_search_with_a_one_sided_switch(make_bench, method, cam, start, stuck):
    """3 to 6, 19 to 22: the limit switch is reached first, because the home switch is stuck: error, in motion
    100, then 101.
    """
    bench = make_bench(machine(start_mm=start, home=cam))
    bench.drive.force_input("home", stuck)
    run = home(bench, method)
    fails(run)
    assert run.statuses == [0b000, 0b100, 0b101]
    assert LIMIT_MM - 0.3 < abs(run.samples[-1][1]) < STOP_MM


@pytest.mark.requirement("C402-136", "C402-137", "C402-311")
@pytest.mark.parametrize("method", [*range(7, 15), *range(23, 31)])
def test_second_limit_switch_ends_a_search_for_a_cam(make_bench, method):
    """7 to 14, 23 to 30 with a dead home switch: the first limit switch reverses, the second is the error."""
    bench = make_bench(machine(start_mm=10.0, home=CAM))
    bench.drive.force_input("home", False)
    run = home(bench, method)
    fails(run)
    limits = [name for _, name in run.edges if name.endswith("up")]
    assert limits == (["+ PLS up", "- NLS up"] if method % 16 < 11 else ["- NLS up", "+ PLS up"])
    assert all(abs(velocity) < FAST_MM_S * 1.03 for _, _, velocity in run.samples)


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-137", "C402-311")
@pytest.mark.parametrize("method", [7, 9, 12, 14, 24])
def test_home_switch_that_stays_active(make_bench, method):
    """A home switch that is stuck active never shows the home edge: error at a limit switch."""
    bench = make_bench(machine(start_mm=10.0, home=CAM))
    bench.drive.force_input("home", True)
    fails(home(bench, method))


@pytest.mark.requirement("C402-137")
@pytest.mark.parametrize("method", [1, 2, 5, 7, 14, 18])
def test_both_limit_switches(make_bench, method):
    """Both limit switches active: no run begins; one that goes on ends."""
    bench = make_bench(machine(start_mm=20.0, home=CAM))
    bench.drive.force_input("negative_limit", True)
    bench.drive.force_input("positive_limit", True)
    run = home(bench, method)
    fails(run)
    assert run.samples[-1][1] == pytest.approx(20.0, abs=1e-3)
    bench = make_bench(machine(start_mm=20.0, home=CAM))
    run = prepare(bench, method)
    run.command(0x1F)
    bench.run(0.05)
    bench.drive.force_input("negative_limit", True)
    bench.drive.force_input("positive_limit", True)
    run.to_end(1.0)
    fails(run)


@pytest.mark.requirement("C402-137")
@pytest.mark.parametrize("method", [1, 2, 3, 4, 5, 6, 7, 14, 17, 18, 30])
def test_a_switch_that_is_not_there(make_bench, method):
    """A method whose switch is not wired fails at once, without motion."""
    run = home(make_bench(machine(start_mm=20.0, limits=False)), method)
    fails(run)
    assert max(abs(velocity) for _, _, velocity in run.samples) < 0.1


@pytest.mark.requirement("C402-137", "C402-311")
@pytest.mark.parametrize(("method", "start"), [(1, 0.0), (2, 0.0), (7, 20.0), (11, -20.0)])
def test_limit_switches_that_are_swapped(make_bench, method, start):
    """The switch of the wrong side comes in motion: error, before the end stop is reached."""
    bench = make_bench(machine(start_mm=start, home=CAM))
    bench.drive.swap_limit_switches(True)
    run = home(bench, method)
    fails(run)
    assert all(abs(position) < STOP_MM for _, position, _ in run.samples)


@pytest.mark.requirement("C402-168", "C402-311")
def test_swapped_limit_switches_come_back(make_bench):
    """Exchanged wires show at once, with the filter too, and are put right again."""
    for filter_ms in (0.0, 2.0):
        bench = make_bench(machine(start_mm=-50.0, input_filter_ms=filter_ms))
        seen = []
        for swapped in (True, True, False, False):
            bench.drive.swap_limit_switches(swapped)
            bench.run(0.003)
            seen.append(bench.read(0x60FD) & 3)
        assert seen == [2, 2, 1, 1]
        bench.drive.swap_limit_switches(True)
        bench.drive.mechanics.place(0.0)
        bench.run(0.003)
        assert bench.read(0x60FD) & 3 == 0
    with pytest.raises(UnsupportedFaultError, match="negative_limit"):
        make_bench(machine(limits=False)).drive.swap_limit_switches(True)


@pytest.mark.requirement("C402-137")
def test_a_dead_limit_switch_ends_at_the_end_stop_as_an_error(make_bench):
    """Method 1 with a limit switch that never comes: the axis is blocked by the stop; error after the
    detection time.
    """
    bench = make_bench(machine(start_mm=-40.0))
    bench.drive.force_input("negative_limit", False)
    run = home(bench, 1)
    fails(run)
    assert run.samples[-1][1] == pytest.approx(-STOP_MM, abs=0.5)


@pytest.mark.requirement("C402-137")
@pytest.mark.parametrize(("index", "value"), [(4, 300), (5, 2000)])
def test_time_and_way_are_limited(make_bench, index, value):
    """2010h:4 (ms) and 2010h:5 (position units) end a search that finds nothing."""
    bench = make_bench(machine(start_mm=0.0))
    bench.write(0x2010, value, index)
    run = home(bench, 1)
    fails(run)
    way = abs(run.samples[-1][1])
    if index == 4:
        assert FAST_MM_S * 0.25 < way < FAST_MM_S * 0.35
    else:
        assert 5.0 <= way < 6.0
    assert bench.read(0x2010, 4) == (300 if index == 4 else 60_000)


@pytest.mark.requirement("C402-136", "C402-311")
@pytest.mark.parametrize(("method", "start"), [(33, 30.0), (34, -30.0), (1, -40.0), (7, -10.0), (-1, 50.0)])
def test_index_that_does_not_come(make_bench, method, start):
    """Without zero mark: error one and a half revolutions behind the place from where it is looked for."""
    bench = make_bench(machine(start_mm=start, home=CAM if method > 0 else None, limits=method > 0))
    bench.drive.suppress_index(True)
    run = home(bench, method)
    fails(run)
    final = run.samples[-1][1]
    if method in (33, 34):
        assert abs(final - start) == pytest.approx(1.5 * LEAD_MM, abs=0.1)
    # The next run, with the zero mark, takes the error back.
    bench.drive.suppress_index(False)
    run.command(0x0F)
    bench.run(0.01)
    run.statuses.clear()
    run.command(0x1F)
    bench.until(lambda: 0b011 in run.statuses, 61.0)
    assert bench.emcys == [(0x8612, 0x21), (0, 0)]


@pytest.mark.requirement("C402-139", "C402-311")
@pytest.mark.parametrize(("filter_ms", "home_mm"), [(0.0, CAM[0]), (10.0, CAM[1] + 0.25)])
def test_bouncing_home_switch(make_bench, filter_ms, home_mm):
    """Method 26: a bounce at the left edge is taken for the right edge without input filter, and not noticed
    with it.
    """
    bench = make_bench(machine(start_mm=-20.0, home=CAM, servo_us=250, input_filter_ms=filter_ms))
    run = prepare(bench, 26)
    force = bench.drive.force_input
    switch = bench.drive.switches["home"]
    bounced = []

    def bounce():
        if switch.actuated and not bounced:
            bounced.append(True)
            for delay_ms, state in ((2, False), (4, True), (5, False), (6, None)):
                bench.scheduler.after(delay_ms * MS, partial(force, "home", state))

    bench.scheduler.every(250_000, bounce, priority=7)
    run.command(0x1F)
    bench.until(lambda: run.statuses, 0.1)
    run.to_end()
    assert bounced
    assert run.statuses[-1] == 0b011
    assert run.home_counts / COUNTS * LEAD_MM == pytest.approx(home_mm, abs=0.5)


# -- commands ------------------------------------------------------------------------------------------


@pytest.mark.requirement("C402-134", "C402-135")
def test_interrupted_and_started_again(make_bench):
    """Bit 4 = 0 stops the search (001); a new rising edge starts it again and it finds home."""
    bench = make_bench(machine(start_mm=20.0, home=CAM))
    run = prepare(bench, 7)
    assert bench.status & 0x3400 == 0x0400
    run.command(0x1F)
    bench.run(0.1)
    run.command(0x0F)
    run.to_end(1.0)
    assert run.statuses == [0b000, 0b001]
    stopped = run.samples[-1]
    assert abs(stopped[2]) < 0.1
    bench.run(0.2)
    assert run.samples[-1][1] == pytest.approx(stopped[1], abs=1e-3)
    assert not bench.emcys
    run.command(0x1F)
    bench.until(lambda: run.statuses[-1] == 0b011, 61.0)
    assert run.home_counts % COUNTS == 0


@pytest.mark.requirement("C402-134", "C402-076", "C402-036")
def test_halt_and_on(make_bench):
    """Bit 8 stops per 605Dh without ending the run; its release searches on; bit 4 taken back meanwhile ends
    it.
    """
    bench = make_bench(machine(start_mm=-30.0, home=CAM))
    run = prepare(bench, 24)
    run.command(0x1F)
    bench.run(0.1)
    run.command(0x11F)
    run.to_end(2.0)
    assert run.statuses == [0b000, 0b001]
    assert abs(run.samples[-1][2]) < 0.1
    run.command(0x1F)
    bench.until(lambda: run.statuses[-1] == 0b011, 61.0)
    assert run.home_counts / COUNTS * LEAD_MM == pytest.approx(CAM[0], abs=0.2)
    run.command(0x0F)
    bench.run(0.01)
    assert run.statuses[-1] == 0b011, "a result stays when the start bit goes"
    run.command(0x1F)
    bench.run(0.05)
    run.command(0x11F)
    bench.run(0.1)
    run.command(0x10F)
    bench.run(0.01)
    place = run.samples[-1][1]
    run.command(0x0F)
    bench.run(0.2)
    assert run.samples[-1][1] == pytest.approx(place, abs=0.01)
    assert run.statuses[-1] == 0b001


def test_fault_ends_a_run(make_bench):
    """A fault in the search: it is over, and enabling with the start bit still set does not start another."""
    bench = make_bench(machine(start_mm=20.0, home=CAM))
    run = prepare(bench, 33)
    run.command(0x1F)
    bench.run(0.1)
    bench.drive.raise_fault(0x4310)
    bench.until(lambda: bench.state is DriveState.FAULT, 2.0)
    run.command(0x80)
    bench.run(0.01)
    for word in (0x16, 0x17, 0x1F):
        run.command(word)
        bench.run(0.01)
    assert bench.state is DriveState.OPERATION_ENABLED
    place = run.samples[-1][1]
    bench.run(0.3)
    assert run.samples[-1][1] == pytest.approx(place, abs=1e-3)
    assert not bench.drive.axis.homed


@pytest.mark.requirement("C402-141", "C402-119", "C402-125", "C402-128", "C402-262")
def test_methods_are_listed(make_bench):
    """60E3h lists what 6098h takes: 15, 16, 31, 32, 36 and all else is refused with 06090030h."""
    bench = make_bench(machine())
    listed = [bench.read(0x60E3, sub) for sub in range(1, bench.read(0x60E3) + 1)]
    assert listed == [-4, -3, -2, -1, *range(1, 15), *range(17, 31), 33, 34, 35, 37]
    for method in range(-128, 128):
        if method in listed or method == 0:
            bench.write(0x6098, method)
            continue
        with pytest.raises(SdoAbort) as refusal:
            bench.write(0x6098, method)
        assert refusal.value.code == 0x06090030


@pytest.mark.requirement("C402-133", "C402-137")
def test_speed_zero_finds_nothing(make_bench):
    """6099h = 0 cannot move the axis: error, no motion, no exception."""
    bench = make_bench(machine(home=CAM))
    bench.write(0x6099, 0, 2)
    fails(home(bench, 33))


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-133")
def test_jerk_limited_homing(make_bench):
    """6086h = 3: the acceleration of a homing run has the slope of 60A4h; the home position is the same."""
    homes = []
    for profile in (0, 3):
        bench = make_bench(machine(start_mm=20.0, home=CAM, servo_us=250))
        bench.configure({0x6086: profile})
        bench.write(0x60A4, 60_000_000, 1)  # 10^-3 rpm/s2: 10 mm per 60 rpm
        bench.write(0x609A, 6_000_000)
        run = home(bench, 11)
        homes.append(run.home_counts)
        if profile:
            speeds = [velocity for _, _, velocity in run.samples]
            accelerations = [(b - a) / 0.001 for a, b in zip(speeds[:-4:4], speeds[4::4], strict=False)]
            jerks = [abs(b - a) / 0.001 for a, b in pairwise(accelerations)]
            assert sorted(jerks)[-20] < 3.0 * 10_000.0
    assert homes[0] == homes[1]


# -- coordinates ---------------------------------------------------------------------------------------


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-138")
@pytest.mark.parametrize(("option", "sign"), [("profile", -1), ("vendor", 1)])
@pytest.mark.parametrize("method", [1, 23, 34, -4])
def test_home_offset(make_bench, option, sign, method):
    """6064h would be -607Ch (or +607Ch) at the home position, whatever the method; nothing moves to zero."""
    limits = method > 0
    places = []
    for offset in (0, 1234):
        bench = make_bench(
            machine(
                start_mm=20.0, home=CAM if limits else None, limits=limits, homing=HomingConfig(offset=option)
            )
        )
        bench.write(0x607C, offset)
        home(bench, method)
        places.append(bench.read(0x6064))
    assert places[1] - places[0] == pytest.approx(sign * 1234, abs=1)


@pytest.mark.requirement("C402-138", "C402-135")
@pytest.mark.parametrize("method", [1, 24, 37])
def test_move_to_zero_as_an_option(make_bench, method):
    """homing.move = zero: attained first (010), then position zero is reached (011)."""
    bench = make_bench(machine(start_mm=10.0, home=CAM, homing=HomingConfig(move="zero")))
    bench.write(0x607C, 500)
    run = home(bench, method)
    assert bench.read(0x6064) == pytest.approx(0, abs=1)
    assert run.statuses[-2:] == [0b010, 0b011]
    assert max(abs(v) for _, _, v in run.samples[-20:]) < 0.5


@pytest.mark.requirement("C402-138")
def test_move_to_zero_heeds_limit_switches(make_bench):
    """Position zero beyond the limit switch is not reached: homing error at the switch, home stays known."""
    bench = make_bench(machine(start_mm=12.0, home=CAM, homing=HomingConfig(move="zero")))
    bench.write(0x607C, round(100.0 / LEAD_MM * COUNTS))
    run = home(bench, 34)
    assert run.statuses[-1] == 0b101
    assert bench.emcys == [(0x8612, 0x21)]
    assert LIMIT_MM - 0.1 < run.samples[-1][1] < STOP_MM
    assert run.home_counts == 2 * COUNTS


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-165")
def test_polarity_does_not_turn_homing_round(make_bench):
    """607Eh reverses 6064h and velocities, not the directions of a homing method nor its limit switches."""
    for method in (7, 21, 34):
        runs = []
        for polarity in (0x00, 0xC0):
            bench = make_bench(machine(start_mm=20.0, home=CAM if method != 21 else TO_THE_LEFT))
            bench.write(0x607E, polarity)
            run = home(bench, method)
            runs.append(([name for _, name in run.edges], run.samples[-1][1]))
            assert run.statuses[-1] == 0b011
        assert runs[0][0] == runs[1][0]
        assert runs[0][1] == pytest.approx(runs[1][1], abs=1e-3)


@pytest.mark.exhaustive
@settings(deadline=None, max_examples=60)
@given(data=st.data())
def test_any_parameters_and_commands_leave_a_working_drive(make_bench_factory, data):
    """Whatever a controller writes before and during runs: no exception, and a homing run with sound
    parameters succeeds.
    """
    bench = make_bench_factory(
        machine(
            start_mm=data.draw(st.floats(-44.0, 44.0)),
            home=CAM,
            homing=HomingConfig(move=data.draw(st.sampled_from(["none", "zero"]))),
        )
    )
    run = prepare(
        bench, data.draw(st.sampled_from([*range(-4, 0), *range(1, 15), *range(17, 31), 33, 34, 35, 37]))
    )
    numbers = st.sampled_from([0, 1, 1000, 600_000, 0x7FFFFFFF, 0xFFFFFFFF])
    places = st.sampled_from(
        [
            (0x6099, 1),
            (0x6099, 2),
            (0x609A, 0),
            (0x607F, 0),
            (0x60C5, 0),
            (0x2010, 3),
            (0x2010, 4),
            (0x2010, 5),
            (0x60A4, 1),
        ]
    )
    for _ in range(data.draw(st.integers(1, 12))):
        match data.draw(st.sampled_from(["write", "word", "input", "index", "method", "profile"])):
            case "write":
                index, sub = data.draw(places)
                bench.write(index, data.draw(numbers), sub)
            case "word":
                run.command(data.draw(st.sampled_from([0x0F, 0x1F, 0x10F, 0x11F, 0x0B, 0x07])))
            case "input":
                name = data.draw(st.sampled_from(["negative_limit", "positive_limit", "home"]))
                bench.drive.force_input(name, data.draw(st.sampled_from([True, False, None])))
            case "index":
                bench.drive.suppress_index(data.draw(st.booleans()))
            case "method":
                bench.write(0x6098, data.draw(st.sampled_from([-3, 1, 7, 12, 24, 33, 37])))
            case "profile":
                bench.write(0x6086, data.draw(st.sampled_from([0, 3])))
        bench.run(data.draw(st.sampled_from([0.001, 0.02, 0.15])))
    for name in ("negative_limit", "positive_limit", "home"):
        bench.drive.force_input(name, None)
    bench.drive.suppress_index(False)
    bench.drive.power_off()
    bench.run(2.0)
    bench.drive.mechanics.place(0.010)
    bench.drive.power_on()
    bench.run(0.01)
    assert home(bench, 7).statuses[-1] == 0b011


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-140")
def test_software_limits_are_off_during_homing(make_bench):
    """607Dh does not shorten a search: it leads through positions that the limits forbid, before and after
    the first homing.
    """
    bench = make_bench(machine(start_mm=30.0, home=CAM))
    bench.write(0x607D, 100, 2)
    bench.write(0x607D, -100, 1)
    assert home(bench, 7).statuses[-1] == 0b011
    assert bench.drive.axis.homed
    run = prepare(bench, 10)
    run.command(0x0F)
    bench.run(0.01)
    run.command(0x1F)
    bench.until(lambda: run.statuses and run.statuses[-1] == 0b011, 61.0)
    assert run.home_counts == COUNTS


@pytest.mark.requirement("C402-138", "C402-089", "C402-100")
@pytest.mark.parametrize("method", [1, 9, 34])
def test_hand_over_to_csp(make_bench, method):
    """6064h and 6062h jump by the same shift while homing ends; csp takes over with 607Ah = 6064h without any
    motion.
    """
    bench = make_bench(machine(start_mm=20.0, home=CAM))
    bench.write(0x607C, -7777)
    run = prepare(bench, method)
    jumps = []
    last = [bench.read(0x6064), bench.read(0x6062)]

    def watch():
        now = [bench.read(0x6064), bench.read(0x6062)]
        if abs(now[0] - last[0]) > 1000:
            jumps.append((now[0] - last[0], now[1] - last[1]))
        last[:] = now

    bench.scheduler.every(1_000_000, watch, priority=6)
    run.command(0x1F)
    bench.until(lambda: run.statuses, 0.1)
    run.to_end()
    assert len(jumps) == 1
    assert jumps[0][0] == pytest.approx(jumps[0][1], abs=60)
    place = run.samples[-1][1]
    bench.write(0x6060, 8)
    bench.write(0x607A, bench.read(0x6064))
    bench.run(0.3)
    assert bench.read(0x6061) == 8
    assert bench.state is DriveState.OPERATION_ENABLED
    assert max(abs(position - place) for _, position, _ in run.samples[-290:]) < 2 * LEAD_MM / COUNTS


def test_slow_speed_is_that_of_the_index_search(make_bench):
    """The rig's own figures: a search for the index runs at 6099h:2, one for a switch at 6099h:1."""
    bench = make_bench(machine(start_mm=20.0, home=CAM))
    run = home(bench, 11)
    assert max(abs(velocity) for _, _, velocity in run.samples) == pytest.approx(FAST_MM_S, rel=0.02)
    run = home(make_bench(machine(start_mm=20.0)), 33)
    assert max(abs(velocity) for _, _, velocity in run.samples) == pytest.approx(SLOW_MM_S, rel=0.02)
