"""Touch probe: what is latched, when, and with which exactness, against the motion of the true machine."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from emulators.drive.cia402 import DriveConfig, SwitchesConfig
from fieldbus.canopen import NmtCommand, SdoAbort
from fieldbus.clock import S

COUNTS = 131072
LEAD_M = 0.010
STEP_NS = 250_000
ON, CONTINUOUS, POSITIVE, NEGATIVE = 0x01, 0x02, 0x10, 0x20
VALUES = {(1, "positive"): 0x60BA, (1, "negative"): 0x60BB, (2, "positive"): 0x60BC, (2, "negative"): 0x60BD}
STAMPS = {key: 0x60D1 + place for place, key in enumerate(VALUES)}
COUNTERS = {key: 0x60D5 + place for place, key in enumerate(VALUES)}


def config(**switches: float) -> DriveConfig:
    return DriveConfig.reference(switches=SwitchesConfig(**switches))


def moving(make_bench, rpm: float, configuration: DriveConfig | None = None, *, settle: bool = True):
    """Return a bench whose motor turns, and the true motion from the start: (time s, position m, velocity
    m/s).
    """
    bench = make_bench(config() if configuration is None else configuration)
    samples = bench.observe()
    bench.write(0x6083, 1_200_000)  # 1200 rpm/s
    bench.enable(3)
    bench.write(0x60FF, round(rpm * 1000))
    if settle:
        bench.run(abs(rpm) / 1200 + 0.05)
    return bench, samples


def true_increments(samples, time_ns: int) -> float:
    """Return the place of the shaft at an instant between two samples: the velocity is linear in between."""
    first = next(k for k in range(len(samples) - 1) if samples[k + 1][0] * S >= time_ns - 0.5)
    (start_s, position, velocity), (end_s, _, end_velocity) = samples[first], samples[first + 1]
    elapsed = time_ns / S - start_s
    bend = (end_velocity - velocity) / (end_s - start_s)
    return (position + (velocity + 0.5 * bend * elapsed) * elapsed) / LEAD_M * COUNTS


def press(bench, name: str, state: bool | None, at_ns: int) -> None:
    bench.scheduler.at(at_ns, partial(bench.drive.force_input, name, state))


@pytest.mark.requirement("C402-142", "C402-145", "C402-146", "C402-147", "C402-149", "C402-152", "C402-259")
@pytest.mark.parametrize("probe", [1, 2])
@pytest.mark.parametrize("edge", ["positive", "negative"])
@pytest.mark.parametrize("rpm", [1500.0, -700.0])
def test_the_latch_belongs_to_the_instant(make_bench, probe, edge, rpm):
    """An edge anywhere between two servo instants latches the position of that instant, to the increment, and
    its time.
    """
    bench, samples = moving(make_bench, rpm, settle=False)
    shift = 8 * (probe - 1)
    selected = POSITIVE if edge == "positive" else NEGATIVE
    if edge == "negative":
        bench.drive.force_input(f"probe{probe}", True)
    for offset_ns in (
        1,
        60_000,
        125_001,
        249_999,
        0,
    ):  # while it accelerates: the position is not linear in time
        bench.write(0x60B8, 0)
        bench.write(0x60B8, (ON | selected) << shift)
        at_ns = (bench.scheduler.now // STEP_NS + 40) * STEP_NS + offset_ns
        press(bench, f"probe{probe}", edge == "positive", at_ns)
        press(bench, f"probe{probe}", edge != "positive", at_ns + 3_000_000)
        bench.run(0.025)
        latched = bench.read(VALUES[probe, edge])
        assert latched == pytest.approx(true_increments(samples, at_ns), abs=1.0)
        assert bench.read(STAMPS[probe, edge]) == at_ns & 0xFFFFFFFF
        assert bench.read(0x60B9) >> shift & 7 == (3 if edge == "positive" else 5)
    assert bench.read(COUNTERS[probe, edge]) == 5
    untouched = [key for key in VALUES if key != (probe, edge)]
    assert all(bench.read(VALUES[key]) == 0 == bench.read(COUNTERS[key]) for key in untouched)
    assert abs(samples[-1][2] - samples[0][2]) > 0.02, (
        "the motion has to be fast enough to tell instants apart"
    )


@pytest.mark.exhaustive
@settings(deadline=None, max_examples=25)
@given(
    rpm=st.floats(60.0, 2500.0),
    sign=st.sampled_from([1, -1]),
    offset=st.floats(0.2, 0.9),
    width=st.floats(1e-6, 0.02),
)
def test_a_workpiece_edge_is_latched_where_it_is(make_bench_factory, rpm, sign, offset, width):
    """A cam on the travel, even one narrower than a servo step: both edges are latched at their places, at
    the time of passing.
    """
    low = sign * offset * 0.02
    low, high = (low, low + width) if sign > 0 else (low - width, low)
    bench, samples = moving(
        make_bench_factory,
        sign * rpm,
        config(probe2_from_mm=1000.0 * low, probe2_to_mm=1000.0 * high),
        settle=False,
    )
    bench.write(0x60B8, (ON | POSITIVE | NEGATIVE) << 8)
    bench.until(lambda: bench.read(0x60B9) == 0x0700, 10.0)
    entered, left = (low, high) if sign > 0 else (high, low)
    stamps = []
    for edge, place in (("positive", entered), ("negative", left)):
        assert bench.read(VALUES[2, edge]) == math.floor(place / LEAD_M * COUNTS + 0.5)
        stamps.append(bench.read(STAMPS[2, edge]))
        assert true_increments(samples, stamps[-1]) == pytest.approx(place / LEAD_M * COUNTS, abs=1.0)
    assert stamps[0] <= stamps[1]


@pytest.mark.requirement("C402-143", "C402-150")
@pytest.mark.parametrize("probe", [1, 2])
@pytest.mark.parametrize("continuous", [False, True])
@pytest.mark.parametrize("edges", [POSITIVE, NEGATIVE, POSITIVE | NEGATIVE])
def test_first_event_and_continuous(make_bench, probe, continuous, edges):
    """First event: value and counter are frozen until the probe is switched off and on; continuous: every
    edge counts.
    """
    bench, _ = moving(make_bench, 300.0)
    shift = 8 * (probe - 1)
    function = ON | edges | (CONTINUOUS if continuous else 0)
    name = f"probe{probe}"
    bench.write(0x60B8, function << shift)
    seen = {"positive": [], "negative": []}
    for _ in range(3):
        for state, edge in ((True, "positive"), (False, "negative")):
            bench.drive.force_input(name, state)
            bench.run(0.004)
            seen[edge].append(bench.read(VALUES[probe, edge]))
            assert bool(bench.read(0x60B9) >> shift & 0x80) is state
    for edge, bit in (("positive", POSITIVE), ("negative", NEGATIVE)):
        values = seen[edge]
        stored = bool(edges & bit)
        assert bench.read(COUNTERS[probe, edge]) == (0 if not stored else 3 if continuous else 1)
        assert len(set(values)) == (1 if not (stored and continuous) else 3)
        assert bool(values[0]) is stored
        assert bool(bench.read(0x60B9) >> shift & (2 if edge == "positive" else 4)) is stored
    taken = [bench.read(index) for index in VALUES.values()]
    bench.write(0x60B8, 0)
    assert bench.read(0x60B9) == 0
    assert [bench.read(index) for index in VALUES.values()] == taken, "values stay when the probe is off"
    bench.drive.force_input(name, True)
    bench.drive.force_input(name, False)
    bench.run(0.002)
    assert [bench.read(index) for index in VALUES.values()] == taken, "a probe that is off latches nothing"
    bench.write(0x60B8, function << shift)
    bench.drive.force_input(name, True)
    bench.drive.force_input(name, False)
    bench.run(0.002)
    changed = sum(
        a != b for a, b in zip(taken, (bench.read(index) for index in VALUES.values()), strict=True)
    )
    assert changed == edges.bit_count()


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-150", "C402-260")
def test_counters_wrap(make_bench):
    """60D5h to 60D8h are 16 bits wide and begin again at 0."""
    bench = make_bench()
    bench.write(0x60B8, ON | CONTINUOUS | POSITIVE)
    bench.drive.slave.set(0x60D5, 0, 0xFFFE)
    counts = []
    for _ in range(3):
        bench.drive.force_input("probe1", True)
        bench.drive.force_input("probe1", False)
        bench.run(0.001)
        counts.append(bench.read(0x60D5))
    assert counts == [0xFFFF, 0, 1]


@pytest.mark.requirement("C402-151")
def test_changes_while_on_have_no_effect(make_bench):
    """Edge, source and continuous bits and 60D0h are looked at when the probe is switched on, not later."""
    bench, _ = moving(make_bench, 300.0)
    bench.write(0x60B8, ON | POSITIVE)
    bench.write(0x60B8, ON | CONTINUOUS | NEGATIVE | 0x04)
    bench.write(0x60D0, 2, 1)
    for _ in range(2):
        bench.drive.force_input("probe1", True)
        bench.run(0.002)
        bench.drive.force_input("probe1", False)
        bench.drive.force_input("probe2", True)
        bench.run(0.002)
        bench.drive.force_input("probe2", False)
    bench.run(1.0)
    assert [bench.read(index) for index in COUNTERS.values()] == [1, 0, 0, 0]
    bench.write(0x60B8, CONTINUOUS | NEGATIVE | 0x08)
    bench.write(0x60B8, ON | CONTINUOUS | NEGATIVE | 0x08)
    bench.drive.force_input("probe2", True)
    bench.run(0.002)
    bench.drive.force_input("probe2", False)
    bench.run(0.002)
    assert [bench.read(index) for index in COUNTERS.values()] == [1, 1, 0, 0]


@pytest.mark.requirement("C402-144", "C402-152")
@pytest.mark.parametrize(("bits", "source"), [(0x04, None), (0x08, 5), (0x08, 6)])
@pytest.mark.parametrize("rpm", [600.0, -600.0])
def test_index_as_source(make_bench, bits, source, rpm):
    """The index of the encoder: continuous events one revolution apart, at the mark, 100 ms apart at 600
    rpm.
    """
    configuration = config()
    mark = 4321
    configuration = replace(configuration, encoder=replace(configuration.encoder, zero_mark_counts=mark))
    bench, samples = moving(make_bench, rpm, configuration)
    if source is not None:
        bench.write(0x60D0, source, 1)
    bench.write(0x60B8, ON | CONTINUOUS | POSITIVE | NEGATIVE | bits)
    events = []
    for _ in range(4):
        counted = bench.read(0x60D5)
        bench.until(lambda counted=counted: bench.read(0x60D5) != counted, 0.2)
        events.append((bench.read(0x60BA), bench.read(0x60D1)))
    assert all(position % COUNTS == mark for position, _ in events)
    for (position, stamp), (next_position, next_stamp) in pairwise(events):
        assert next_position - position == math.copysign(COUNTS, rpm)
        assert next_stamp - stamp == pytest.approx(0.1 * S, rel=2e-3)
    assert true_increments(samples, events[-1][1]) == pytest.approx(events[-1][0], abs=1.0)
    assert bench.read(0x60D6) == 0, "a zero mark is an event with a positive edge only"
    bench.write(0x60B8, 0)
    bench.run(0.3)
    assert bench.read(0x60D5) == 4


@pytest.mark.requirement("C402-144", "C402-152")
def test_both_probes_on_one_input(make_bench):
    """60D0h lets probe 2 watch probe input 1: positive edge in one probe, negative in the other."""
    bench, _ = moving(make_bench, 300.0)
    bench.write(0x60D0, 1, 2)
    bench.write(0x60B8, ON | POSITIVE | (ON | NEGATIVE | 0x08) << 8)
    bench.drive.force_input("probe1", True)
    bench.run(0.010)
    bench.drive.force_input("probe1", False)
    bench.run(0.002)
    way = bench.read(0x60BD) - bench.read(0x60BA)
    assert way == pytest.approx(5 * COUNTS * 0.010, abs=2)


@pytest.mark.requirement("C402-148")
def test_manufacturer_bits_mean_nothing_here(make_bench):
    """Bits 6, 7, 14 and 15 of 60B8h are taken and change nothing."""
    bench = make_bench()
    bench.write(0x60B8, 0xC0C0)
    assert bench.read(0x60B9) == 0
    bench.write(0x60B8, 0xC0C0 | ON | POSITIVE)
    assert bench.read(0x60B9) == 0x01
    bench.drive.force_input("probe1", True)
    bench.run(0.001)
    assert bench.read(0x60B9) == 0x83


@pytest.mark.requirement("C402-144", "C402-258")
def test_reserved_sources_are_refused(make_bench):
    """Source 3 in 60B8h and values of 60D0h that the profile does not know: 06090030h, and nothing is
    switched on.
    """
    bench = make_bench()
    for index, value, sub in (
        (0x60B8, 0x0D, 0),
        (0x60B8, 0x0D00, 0),
        (0x60D0, 3, 1),
        (0x60D0, 0, 2),
        (0x60D0, -1, 1),
    ):
        with pytest.raises(SdoAbort) as refusal:
            bench.write(index, value, sub)
        assert refusal.value.code == 0x06090030
    assert bench.read(0x60B9) == 0


@pytest.mark.requirement("C402-149", "C402-138", "C402-165")
def test_values_are_in_user_units(make_bench):
    """Latched values have feed constant, polarity and home offset of 6064h: at standstill they are 6064h."""
    bench = make_bench()
    bench.write(0x6092, 10000, 1)
    bench.write(0x607E, 0x80)
    bench.drive.mechanics.place(0.01234)
    bench.write(0x607C, 500)
    bench.write(0x6098, 37)
    bench.enable(6)
    bench.control(0x1F)
    bench.control(0)
    bench.drive.mechanics.place(0.02)
    bench.write(0x60B8, ON | POSITIVE)
    bench.drive.force_input("probe1", True)
    bench.run(0.001)
    assert bench.read(0x60BA) == bench.read(0x6064) == -500 - 7660


@pytest.mark.requirement("C402-168")
def test_probe_levels_are_inputs(make_bench):
    """60FDh bits 16 and 17 show the probe inputs, whether a probe is on or not."""
    bench = make_bench(config(probe1_from_mm=1.0, probe1_to_mm=2.0))
    assert bench.read(0x60FD) >> 16 == 0
    bench.drive.mechanics.place(0.0015)
    assert bench.read(0x60FD) >> 16 == 1
    bench.drive.force_input("probe2", True)
    assert bench.read(0x60FD) >> 16 == 3
    bench.drive.mechanics.place(0.0)
    assert bench.read(0x60FD) >> 16 == 2


@pytest.mark.requirement("C402-249", "C402-250", "C402-251", "C402-294")
def test_probe_by_pdo(make_bench):
    """60B8h from an RPDO, 60B9h and 60BAh in TPDO8 with SYNC: the value comes with its status bit."""
    bench = make_bench()
    frames = []
    bench.write(0x1407, 0x80000401, 1)
    bench.write(0x1607, 0)
    bench.write(0x1607, 0x60B80010, 1)
    bench.write(0x1607, 1)
    bench.write(0x1407, 0x00000401, 1)
    bench.write(0x1807, 0x40000482, 1)
    bench.master.subscribe(0x482, lambda data, _time: frames.append(data))
    bench.master.nmt(NmtCommand.START, 1)
    bench.master.start_sync(4_000_000)
    bench.drive.mechanics.place(0.003)
    bench.run(0.01)
    bench.master.send(0x401, bytes((ON | POSITIVE, 0)))
    bench.run(0.01)
    bench.drive.force_input("probe1", True)
    bench.run(0.01)
    value = round(0.3 * COUNTS)
    assert frames[0] == bytes(6)
    assert frames[-1] == bytes((0x83, 0)) + value.to_bytes(4, "little")


@pytest.mark.exhaustive
def test_reset_and_power_off_switch_the_probes_off(make_bench):
    """After reset node and power-off no probe is on, and an index that comes is nobody's."""
    for restart in ("reset", "power"):
        bench, _ = moving(make_bench, 600.0)
        bench.write(0x60B8, ON | CONTINUOUS | POSITIVE | 0x04)
        bench.run(0.15)
        assert bench.read(0x60D5) > 0
        if restart == "reset":
            bench.master.nmt(NmtCommand.RESET_NODE, 1)
        else:
            bench.drive.power_off()
            bench.drive.power_on()
        bench.run(0.5)
        assert (bench.read(0x60B8), bench.read(0x60B9), bench.read(0x60D5)) == (0, 0, 0)


# -- digital outputs -----------------------------------------------------------------------------------


@pytest.mark.requirement("C402-169", "C402-270")
def test_outputs_have_a_mask(make_bench):
    """An output is on when its bit is set in 60FEh:1 and enabled in 60FEh:2; the trace and the history show
    it.
    """
    bench = make_bench()
    column = [name for name, _ in bench.drive.trace_columns].index("outputs")
    for value, mask, outputs in (
        (0xFFFF0000, 0, 0),
        (0xFFFF0000, 0x50000, 0x50000),
        (0x10000, 0x50000, 0x10000),
        (0, 0x50000, 0),
    ):
        bench.write(0x60FE, value, 1)
        bench.write(0x60FE, mask, 2)
        bench.run(0.002)
        assert bench.drive.parameters.outputs == outputs
        assert bench.drive.trace_row()[column] == outputs
    events = [event.data["outputs"] for event in bench.history.select(kind="drive.outputs")]
    assert events == [0x50000, 0x10000, 0]


@pytest.mark.requirement("C402-169")
def test_brake_bit(make_bench):
    """Bit 0 of 60FEh sets the brake of an enabled drive, and holds it open while the drive is off."""
    reference = DriveConfig.reference()
    bench = make_bench(replace(reference, brake=replace(reference.brake, torque_nm=10.0)))
    brake = bench.drive.core.brake
    assert brake.closed
    bench.write(0x60FE, 1, 2)
    bench.run(0.002)
    assert not brake.closed, "masked and 0: held open"
    bench.write(0x60FE, 1, 1)
    bench.run(0.002)
    assert brake.closed
    bench.write(0x60FE, 0, 2)
    bench.write(0x60FE, 0, 1)
    bench.enable(3)
    assert not brake.closed, "without mask the drive commands its brake"
    bench.write(0x60FE, 1, 1)
    bench.write(0x60FE, 1, 2)
    bench.run(0.002)
    assert brake.closed
    bench.write(0x60FF, 100_000)
    bench.run(0.05)
    assert bench.drive.mechanics.position == pytest.approx(0.0, abs=1e-6)
