"""Limit switches of a bench: filter, instant of evaluation, way behind the switch, width, contact, bus, I/O
station.
"""

from __future__ import annotations

import pytest

from fieldbus.errors import ConfigurationError
from hil.bench.bench import Bench
from hil.bench.bench_file import parse, read
from hil.expect import golden
from hil.faults import Injector
from testcases.unit.hil.homing_bench import homing_bench

MS = 1_000_000
CYCLE_MS = 4.0
ACQUISITION_MS = 2.0
"""From sampling at SYNC to the application cycle that uses the value (T_i)."""
DISABLING = {"PositionLimits_HW.ApproachBehavior": 0}


def raised(bench, number=531):
    return [one for one in bench.history.select(kind="alarm.raised") if one.data["number"] == number]


def reference(switches="", axis="", bench=""):
    """Return the reference bench with more keys in its tables."""
    text = read("reference")[1].replace("[drive.drive1.switches]\n", f"[drive.drive1.switches]\n{switches}\n")
    text = text.replace('drive = "drive1"\n', f'drive = "drive1"\n{axis}\n')
    return Bench(parse(text.replace("cycle_ms = 4\n", f"cycle_ms = 4\n{bench}\n"), "bench.toml"), seed=1)


def delay_ms(bench, offset_ms, side="positive"):
    """Press a switch at an offset into the cycle; return the time until 531; everything is as before then."""
    drive, axis = bench.drive(), bench.axis()
    cycle = bench.cycle_ns
    at = (bench.scheduler.now // cycle + 2) * cycle + round(offset_ms * MS)
    bench.scheduler.at(at, lambda: drive.force_input(f"{side}_limit", True))
    before = len(raised(bench))
    assert bench.run_until(lambda: len(raised(bench)) > before, 0.2)
    found = (raised(bench)[-1].time_ns - at) / MS
    drive.force_input(f"{side}_limit", None)
    bench.run_for(0.05)
    assert bench.run_until(axis.reset().done, 1.0)
    return found


@pytest.mark.requirement("LIM-026", "LIM-027")
@pytest.mark.parametrize(
    ("keys", "filters_ms"),
    [
        ("", {"positive": 6.4, "negative": 6.4}),
        ("input_filter_ms = 3.0", {"positive": 3.0, "negative": 3.0}),
        ("negative_limit_filter_ms = 12.8", {"positive": 6.4, "negative": 12.8}),
        ("input_filter_ms = 20.0\npositive_limit_filter_ms = 0.1", {"positive": 0.1, "negative": 20.0}),
    ],
)
def test_detection_takes_the_filter_and_one_cycle(keys, filters_ms):
    """531 after the filter of this input (6.4 ms unless given) and at most one cycle: over 0.1 ms before SYNC
    it is that cycle, 0.1 ms behind it the next one; T_i of this bus comes on top.
    """
    bench = reference(keys)
    bench.run_for(0.05)
    for side, filter_ms in filters_ms.items():
        sync = -filter_ms % CYCLE_MS
        for offset_ms, rest_ms in ((-0.1, 0.1), (0.1, CYCLE_MS - 0.1), (2.0, CYCLE_MS - 2.0)):
            found = delay_ms(bench, sync + offset_ms, side)
            assert found == pytest.approx(filter_ms + rest_ms + ACQUISITION_MS, abs=0.02)


@pytest.mark.requirement("LIM-025")
@pytest.mark.parametrize("update", ["servo", "program"])
def test_process_image(update):
    """With the process image of a program that is called every fifth cycle a change waits for that
    program.
    """
    bench = reference("input_filter_ms = 0.0", f'inputs_update = "{update}"', "program_cycles = 5")
    bench.run_for(0.1)
    delays = [delay_ms(bench, 4.0 * cycle + 0.5) for cycle in range(5)]
    if update == "servo":
        assert max(delays) <= CYCLE_MS + ACQUISITION_MS
    else:
        assert 4 * CYCLE_MS < max(delays) <= 6 * CYCLE_MS + ACQUISITION_MS
        assert len({round(one, 6) for one in delays}) > 2


STATION = """
[segment.net0]
kind = "modbus_tcp"
[station.io]
segment = "net0"
digital_inputs = ["drive1.negative_limit", "drive1.positive_limit"]
"""


@pytest.mark.exhaustive
@pytest.mark.requirement("LIM-105")
@pytest.mark.parametrize("place", ["drive", "station"])
def test_what_a_digital_input_can_do(place, subtests):
    """Inputs of a drive and of a station: level, filter of 6.4 ms, stuck at either level, wire break, bounce,
    exchanged wires.
    """
    text = read("reference")[1]
    if place == "station":
        text = text.replace('drive = "drive1"', 'drive = "drive1"\ninputs = "io"') + STATION
    bench = Bench(parse(text, "bench.toml"), seed=1)
    bench.run_for(0.1)
    axis, drive, injector = bench.axis(), bench.drive(), Injector(bench)

    def reached(after_s=0.03):
        bench.run_for(after_s)
        return [side for side, bit in (("negative", 17), ("positive", 18)) if axis.var(f"StatusWord.X{bit}")]

    def fault(kind, state=None, **parameters):
        if place == "drive":
            return injector.inject(
                f"switch.{kind}", "drive1", input=f"{side}_limit", state=state, **parameters
            )
        if state is not None:
            parameters |= {"value": float(state)} if kind == "stuck" else {"level": state}
        number = ("negative", "positive").index(side)
        return injector.inject(f"io.{kind}", "io", number=number, **parameters)

    def travel(to_mm):
        drive.mechanics.place(to_mm / 1000.0)

    for side, behind_mm in (("negative", -555.0), ("positive", 555.0)):
        with subtests.test(side, part="filter"):
            travel(behind_mm)
            assert reached(0.0063) == []
            assert reached(0.0101) == [side]
            travel(0.0)
            assert reached(0.0063) == [side]
            assert reached() == []
        with subtests.test(side, part="stuck"):
            stuck = fault("stuck", True)
            assert reached() == [side]
            stuck.remove()
            assert reached() == []
            stuck = fault("stuck", False)
            travel(behind_mm)
            assert reached() == []
            stuck.remove()
            assert reached() == [side]
        if place == "station":
            with subtests.test(side, part="wire break"):
                broken = fault("wire_break")
                assert reached() == []
                broken.remove()
                assert reached() == [side]
        travel(0.0)
        reached()
        with subtests.test(side, part="level"):
            drive.invert_input(f"{side}_limit", True)
            assert reached() == [side]
            travel(behind_mm)
            assert reached() == []
            travel(0.0)
            drive.invert_input(f"{side}_limit", False)
            assert reached() == []
        with subtests.test(side, part="bounce"):
            bounce = fault("bounce", True, pulses=20, shortest_s=0.004, longest_s=0.006)
            assert reached(0.15) == []
            assert reached(0.15) == [side]
            bounce.remove()
            assert reached() == []
    with subtests.test(part="swap"):
        drive.swap_limit_switches(True)
        travel(-555.0)
        assert reached() == ["positive"]
        drive.swap_limit_switches(False)
        assert reached() == ["negative"]


@pytest.mark.requirement("LIM-028")
def test_a_pulse_shorter_than_the_filter_is_not_seen():
    """6.3 ms with a filter of 6.4 ms, again and again: nothing; 12 ms: 531."""
    bench = homing_bench("reference", switches={"input_filter_ms": 6.4})
    drive = bench.drive()
    bench.run_for(0.05)
    for length_s, seen in ((0.0063, 0), (0.012, 1)):
        for _ in range(6):
            drive.force_input("positive_limit", True)
            bench.run_for(length_s)
            drive.force_input("positive_limit", False)
            bench.run_for(0.0071)
        assert bool(raised(bench)) is bool(seen)


@pytest.mark.requirement("LIM-029")
def test_clearance_by_formula():
    """The printed example: 500 mm/s, 6.4 ms, 4 ms and 10000 mm/s2 need 17.7 mm."""
    assert golden.switch_clearance(500.0, 10_000.0, filter_s=0.0064, cycle_s=0.004) == pytest.approx(17.7)
    with pytest.raises(ConfigurationError, match=r"filter_s.*a time >= 0 s"):
        golden.switch_clearance(500.0, 10_000.0, filter_s=-0.1)


@pytest.mark.exhaustive
@pytest.mark.requirement("LIM-029", "LIM-104")
@pytest.mark.parametrize(("filter_ms", "enough"), [(6.4, True), (6.4, False), (0.0, True)])
def test_way_behind_the_switch(filter_ms, enough):
    """With the way that the formula asks for the load stands in front of the end stop; with less it hits it;
    a short filter needs less.
    """
    velocity, braking = 400.0, 4000.0
    seconds = {"filter_s": filter_ms / 1000.0, "cycle_s": 0.004}
    clear = golden.switch_clearance(
        velocity, braking, **seconds, detection_s=0.010
    )  # T_i, T_o, interpolation
    if not enough:
        clear = golden.switch_clearance(velocity, braking, filter_s=seconds["filter_s"]) - 1.0
    bench = homing_bench(
        "reference",
        switches={"positive_limit_mm": 200.0, "input_filter_ms": filter_ms},
        mechanics={"positive_stop_mm": 200.0 + clear},
    )
    assert bench.run_until(bench.axis().power().status, 2.0)
    bench.axis().move_velocity(velocity, Acceleration=2000.0, Jerk=0.0)
    assert bench.run_until(lambda: bool(raised(bench)), 2.0)
    assert bench.run_until(lambda: bench.drive().mechanics.velocity <= 0.0, 1.0)
    bench.run_for(0.05)
    farthest = float(max(bench.trace()["drive1.position"].values)) * 1000.0
    assert (farthest < 200.0 + clear) is enough
    if enough:
        assert farthest > 200.0 + golden.stop_distance(velocity, braking)


@pytest.mark.exhaustive
@pytest.mark.requirement("LIM-006", "LIM-045", "LIM-046", "LIM-104")
def test_a_traversable_switch_of_some_width():
    """10 mm wide and passed with 300 mm/s: the input is gone, X18 stays, until the load is back over the
    switch.
    """
    bench = homing_bench(
        "reference",
        switches={"positive_limit_mm": 150.0, "limit_width_mm": 10.0},
        variables=DISABLING | {"PositionLimits_HW.Mode": 1},
    )
    axis, mechanics = bench.axis(), bench.drive().mechanics
    assert bench.run_until(axis.power().status, 2.0)
    axis.move_velocity(300.0)
    assert bench.run_until(lambda: bool(raised(bench)), 2.0)
    bench.run_for(0.6)
    assert mechanics.position > 0.165
    assert not bench.drive().inputs & 2
    assert axis.var("StatusWord.X18")
    assert bench.run_until(axis.reset().done, 1.0)
    assert bench.run_until(axis.power_instance.status, 1.0)
    axis.move_velocity(-100.0)
    assert bench.run_until(lambda: mechanics.position < 0.158, 2.0)
    assert bench.drive().inputs & 2
    assert axis.var("StatusWord.X18")
    assert bench.run_until(lambda: mechanics.position < 0.148, 2.0)
    assert not axis.var("StatusWord.X18")
    assert len(raised(bench)) == 1


@pytest.mark.exhaustive
@pytest.mark.requirement("LIM-006")
def test_a_switch_that_is_too_narrow_is_missed():
    """1 mm at 500 mm/s lasts 2 ms, less than a cycle: a machine that is built so has no limit switch at that
    speed.
    """
    seen = []
    for velocity in (100.0, 490.0):
        bench = homing_bench(
            "reference",
            switches={"positive_limit_mm": 150.25, "limit_width_mm": 0.25, "hysteresis_mm": 0.0},
            variables={"PositionLimits_HW.Mode": 1},
        )
        assert bench.run_until(bench.axis().power().status, 2.0)
        bench.axis().move_velocity(velocity, Acceleration=2000.0, Jerk=0.0)
        assert bench.run_until(lambda: bench.drive().mechanics.position > 0.2 or raised(bench), 3.0)  # noqa: B023 - called at once
        seen.append(bool(raised(bench)))
    assert seen[1] is False


@pytest.mark.exhaustive
@pytest.mark.requirement("LIM-024", "LIM-104")
@pytest.mark.parametrize("name", ["reference", "profidrive"])
def test_normally_closed_contacts(name):
    """Active low: nothing at rest, 531 where the load opens a contact, and as soon as a wire breaks."""
    low = {"PositionLimits_HW.MinSwitchLevel": False, "PositionLimits_HW.MaxSwitchLevel": False}
    bench = homing_bench(
        name,
        switches={"positive_limit_mm": 60.0, "normally_closed": True},
        variables=low | {"PositionLimits_HW.ApproachBehavior": 1},
    )
    axis, drive = bench.axis(), bench.drive()
    assert bench.run_until(axis.power().status, 2.0)
    assert drive.inputs & 3 == 3
    axis.move_velocity(200.0, Jerk=0.0)
    assert bench.run_until(lambda: bool(raised(bench)), 2.0)
    assert axis.var("StatusWord.X18")
    bench.run_for(0.3)
    assert bench.run_until(axis.reset().done, 1.0)
    assert bench.run_until(axis.move_relative(-40.0).done, 3.0)
    assert not axis.var("StatusWord.X18")
    drive.force_input("negative_limit", False)  # its wire breaks
    bench.run_for(0.02)
    assert len(raised(bench)) == 2
    assert axis.var("StatusWord.X17")
    drive.force_input("negative_limit", None)
    drive.invert_input("positive_limit", True)  # wired to the other contact of the switch
    bench.run_for(0.02)
    assert axis.var("StatusWord.X18")
    drive.invert_input("positive_limit", False)
    bench.run_for(0.02)
    assert not axis.var("StatusWord.X18")


@pytest.mark.requirement("LIM-106", "LIM-104")
@pytest.mark.parametrize("name", ["reference", "profidrive", "profidrive_tcp", "analog"])
def test_the_switches_belong_to_the_machine(name):
    """The same switch, pressed in the same way, stops the axis on any bus, and through an I/O station."""
    bench = Bench(parse(read(name)[1], "bench.toml"), seed=1)
    axis = bench.axis()
    bench.run_for(0.2)
    for switch, bit in (("negative_limit", 17), ("positive_limit", 18)):
        bench.drive().force_input(switch, True)
        assert bench.run_until(lambda: axis.var(f"StatusWord.X{bit}"), 0.2)  # noqa: B023 - called at once
        bench.drive().force_input(switch, None)
        bench.run_for(0.1)
    assert len(raised(bench)) >= 1


@pytest.mark.requirement("LIM-106")
def test_inputs_of_a_cia402_drive():
    """60FDh: bit 0 negative, bit 1 positive, bit 2 home."""
    bench = homing_bench("reference")
    drive, sdo = bench.drive(), bench.node("drive1").sdo
    bench.run_for(0.05)
    for bit, name in enumerate(("negative_limit", "positive_limit", "home")):
        drive.force_input(name, True)
        bench.run_for(0.01)
        job = sdo.upload(0x60FD)
        assert bench.run_until(job.done, 1.0)
        assert int.from_bytes(job.data, "little") & 7 == 1 << bit
        drive.force_input(name, None)
        bench.run_for(0.01)
