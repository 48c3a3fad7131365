"""Position formation of the encoders: code sequence, scaling, preset, range, what survives a loss of
supply.
"""

from __future__ import annotations

import math
from fractions import Fraction

import canopen
import pytest
from hypothesis import given
from hypothesis import strategies as st

from emulators.encoder.cia406 import EncoderDeviceConfig, EncoderType
from fieldbus.canopen import AbortCode
from fieldbus.errors import ConfigurationError
from testcases.unit.emulators.encoderbench import EncoderBench

TOO_HIGH, TOO_LOW, WRONG = AbortCode.VALUE_HIGH, AbortCode.VALUE_LOW, AbortCode.VALUE


def refused(bench: EncoderBench, index: int, value: int, sub: int | None = None) -> int:
    with pytest.raises(canopen.SdoAbortedError) as caught:
        bench.put(index, value, sub)
    return caught.value.code


def expected(
    steps: int, *, resolution: int, turns: int, units: int, total: int, offset: int, scaling: bool, back: bool
) -> int:
    """Return 6004h by the formula of the profile in exact fractions, without the product's integers."""
    revolutions = Fraction(-steps if back else steps, resolution)
    revolutions -= turns * math.floor(revolutions / turns)
    if not scaling:
        return int(revolutions * resolution + offset) % (resolution * turns)
    return (math.floor(revolutions * units) + offset) % total


# -- formula -------------------------------------------------------------------------------------------


@pytest.mark.exhaustive
@pytest.mark.requirement("C406-003", "C406-004", "C406-005", "C406-007")
@given(data=st.data())
def test_position_is_the_formula_of_the_profile(data):
    """Any resolution, range, scaling, code sequence, preset and place: 6004h and 600Ch are the calculated
    numbers.
    """
    resolution = data.draw(st.sampled_from([4, 360, 1000, 8192, 65536]))
    turns = data.draw(st.sampled_from([1, 3, 16, 4096]))
    units = data.draw(st.integers(1, resolution))
    total = data.draw(st.integers(1, units * turns))
    scaling, back = data.draw(st.booleans()), data.draw(st.booleans())
    places = st.integers(-3 * resolution * turns, 3 * resolution * turns)
    bench = EncoderBench(steps_per_revolution=resolution, revolutions=turns)
    bench.put(0x6001, units)
    bench.put(0x6002, total)
    bench.put(0x6000, 4 * scaling + back)
    rules = {
        "resolution": resolution,
        "turns": turns,
        "units": units,
        "total": total,
        "scaling": scaling,
        "back": back,
    }
    offset = 0
    for _ in range(3):
        steps = data.draw(places)
        bench.count(steps)
        assert bench.position == expected(steps, offset=offset, **rules)
        assert bench.get(0x600C) == steps % (resolution * turns)
        preset = data.draw(st.integers(0, (total if scaling else resolution * turns) - 1))
        bench.put(0x6003, preset)
        offset = preset - expected(steps, offset=0, **(rules | {"total": resolution * turns}))
        assert bench.get(0x6509) == offset
        assert bench.position == preset
        assert bench.get(0x6008) % (total if scaling else resolution * turns) == preset


@pytest.mark.requirement("C406-003", "C406-052")
def test_code_sequence_turns_the_direction_round():
    """With bit 0 of 6000h the position falls and the speed is negative while the shaft turns forward."""
    bench = EncoderBench()
    for word, sign in ((4, 1), (5, -1)):
        bench.put(0x6000, word)
        assert bench.get(0x6500) == word
        bench.put(0x6003, 100_000)
        bench.encoder.turn_shaft(20.0)
        bench.run(0.1)
        assert (bench.position - 100_000) * sign > 2000
        assert bench.get(0x6030, 1) * sign > 20
        bench.encoder.turn_shaft(0.0)


@pytest.mark.requirement("C406-014", "C406-015", "C406-016", "C406-013")
def test_values_that_are_refused():
    """6000h: unknown bits; 6001h: 1 to 6501h; 6002h: 1 to 6001h times 6502h; 6003h: 0 to 6002h - 1."""
    bench = EncoderBench()
    assert [refused(bench, 0x6000, word) for word in (0x0008, 0x0010, 0x1004, 0x8000)] == [WRONG] * 4
    assert (refused(bench, 0x6001, 0), refused(bench, 0x6001, 8193)) == (TOO_LOW, TOO_HIGH)
    bench.put(0x6001, 1000)
    assert bench.get(0x6002) == 1000 * 4096, "the range falls to what there is"
    assert (refused(bench, 0x6002, 0), refused(bench, 0x6002, 1000 * 4096 + 1)) == (TOO_LOW, TOO_HIGH)
    bench.put(0x6002, 5000)
    assert (refused(bench, 0x6003, -1), refused(bench, 0x6003, 5000)) == (TOO_LOW, TOO_HIGH)
    bench.put(0x6003, 4999)
    assert bench.position == 4999


@pytest.mark.requirement("C406-007")
@pytest.mark.parametrize(("index", "value"), [(0x6000, 5), (0x6000, 0), (0x6001, 4096), (0x6002, 10_000)])
def test_another_scaling_makes_the_preset_invalid(index, value):
    """Writing another value to 6000h, 6001h or 6002h sets the offset to zero; writing the same one does
    not.
    """
    bench = EncoderBench()
    bench.put(0x6003, 777)
    bench.put(index, bench.get(index))
    assert bench.get(0x6509) == 777
    before = bench.get(index)
    bench.put(index, value)
    assert bench.get(0x6509) == 0
    bench.put(index, before)
    bench.restart()
    assert bench.get(0x6509) == 0, "nor does it come back from the memory with the old scaling"


@pytest.mark.requirement("C406-006")
def test_preset_in_motion_jumps_with_the_next_sample():
    """A preset is accepted while the shaft turns, and no speed is seen in its jump."""
    bench = EncoderBench()
    bench.encoder.turn_shaft(2 * math.pi * 10)
    bench.run(0.2)
    speed = bench.get(0x6030, 1)
    assert speed in (81, 82)
    bench.put(0x6003, 5_000_000)
    assert 5_000_000 <= bench.position < 5_000_200
    bench.run(0.001)
    assert bench.get(0x6030, 1) in (81, 82)


@pytest.mark.requirement("C406-015")
def test_overflow_at_the_end_of_the_range():
    """Behind 6002h - 1 comes 0, and before 0 comes 6002h - 1, in the middle of the turns too."""
    bench = EncoderBench(steps_per_revolution=1000, revolutions=16)
    bench.put(0x6002, 2500)
    positions = []
    for steps in (2498, 2499, 2500, 2501, 5000, -1, -2):
        bench.count(steps)
        positions.append(bench.position)
    # -1 is raw step 15999: 16000 is no multiple of 2500, so that there is a gap at the end of the turns.
    assert positions == [2498, 2499, 0, 1, 0, 15999 % 2500, 15998 % 2500]
    bench.encoder.move_near_overflow(1)
    assert bench.position == 2499
    bench.count(-1)
    assert bench.position == 0


# -- kinds ---------------------------------------------------------------------------------------------

ROTARY = {"steps_per_revolution": 1000, "revolutions": 16}
LINEAR = {"measuring_step_um": 1.0, "length_mm": 20.0}
# kind: position after 2600 steps, after power-off and on there, after another -700 steps during power-off
KINDS = {
    EncoderType.SINGLE_TURN: (ROTARY, 600, 600, 900),
    EncoderType.MULTI_TURN: (ROTARY, 2600, 2600, 1900),
    EncoderType.SINGLE_TURN_COUNTING: (ROTARY, 2600, 2600, 2900),
    EncoderType.INCREMENTAL_ROTARY: (ROTARY, 600, 0, 0),
    EncoderType.INCREMENTAL_ROTARY_COUNTING: (ROTARY, 2600, 0, 0),
    EncoderType.INCREMENTAL_LINEAR: (LINEAR, 2600, 0, 0),
    EncoderType.INCREMENTAL_LINEAR_COUNTING: (LINEAR, 2600, 0, 0),
    EncoderType.ABSOLUTE_LINEAR: (LINEAR, 2600, 2600, 1900),
    EncoderType.CYCLIC_LINEAR: (LINEAR, 2600, 2600, 1900),
    EncoderType.MULTI_SENSOR: (LINEAR | {"sensor_places_m": (0.0, 0.01)}, 2600, 2600, 1900),
}


@pytest.mark.requirement("C406-001", "C406-008", "C301-132")
@pytest.mark.parametrize("kind", EncoderType)
def test_what_each_kind_knows_after_power_on(kind):
    """Absolute encoders show their place at once, incremental ones begin at zero.

    Turns counted by electronics are kept, and are wrong when the shaft was turned by more than half a turn
    without supply.
    """
    config, before, same, moved = KINDS[kind]
    bench = EncoderBench(kind=kind, **config)
    assert bench.get(0x1000) == kind << 16 | 0x196
    for steps in (800, 1600, 2600):
        bench.count(steps)
    assert bench.position == before
    bench.restart()
    assert bench.position == same
    bench.encoder.power_off()
    bench.shaft.place(1900 * bench.step)
    bench.encoder.power_on()
    bench.run(0.002)
    assert bench.position == moved


@pytest.mark.requirement("C406-001", "C406-018")
def test_ranges_of_linear_encoders():
    """Behind the end of its scale a length wraps, is counted on, repeats its code, or cannot be read at
    all.
    """
    shown = {}
    for kind in (
        EncoderType.INCREMENTAL_LINEAR,
        EncoderType.INCREMENTAL_LINEAR_COUNTING,
        EncoderType.CYCLIC_LINEAR,
        EncoderType.ABSOLUTE_LINEAR,
    ):
        bench = EncoderBench(kind=kind, **LINEAR)
        bench.count(19_990)
        bench.count(20_010)
        shown[kind] = bench.position, bench.get(0x6503)
    assert list(shown.values()) == [(10, 0), (20_010, 0), (10, 0), (19_990, 1)]


@pytest.mark.exhaustive
@pytest.mark.requirement("C406-018", "C406-013", "C406-015")
@given(
    step_nm=st.sampled_from([1000, 1500, 5000, 7919, 20_000]),
    steps=st.integers(0, 19_999),
    back=st.booleans(),
)
def test_linear_scaling(step_nm, steps, back):
    """The position of a linear encoder counts steps of 6005h:1 (0.001 µm), in the measuring direction of bit
    3.
    """
    bench = EncoderBench(kind=EncoderType.CYCLIC_LINEAR, **LINEAR)
    bench.put(0x6005, step_nm, 1)
    bench.put(0x6000, 4 + 8 * back)
    bench.count(steps)
    there = (-steps if back else steps) % 20_000
    total = 20_000_000 // step_nm
    assert bench.get(0x6002) == total
    assert bench.position == math.floor(Fraction(there * 1000, step_nm)) % total


@pytest.mark.requirement("C406-018", "C406-013")
def test_refusals_of_linear_encoders():
    """No position step below the measuring step, no zero steps, no code sequence: a slide has a measuring
    direction.
    """
    bench = EncoderBench(kind=EncoderType.ABSOLUTE_LINEAR, **LINEAR)
    assert refused(bench, 0x6005, 999, 1) == TOO_LOW
    assert [refused(bench, 0x6005, 0, sub) for sub in (2, 3, 4)] == [TOO_LOW] * 3
    assert refused(bench, 0x6000, 5) == WRONG


@pytest.mark.requirement("C406-021", "C406-047", "C406-009")
def test_sensors_of_a_multi_sensor_device():
    """Each channel has its own position, preset and offset; 6003h, 6004h and 6509h are those of the first."""
    bench = EncoderBench(
        kind=EncoderType.MULTI_SENSOR, measuring_step_um=1.0, length_mm=1000.0, sensor_places_m=(0.0, 0.25)
    )
    bench.count(5000)
    assert [bench.get(0x6020, sub) for sub in (1, 2)] == [5000, 255_000]
    bench.put(0x6010, 100, 2)
    assert [bench.get(0x6020, sub) for sub in (1, 2)] == [5000, 100]
    assert [bench.get(0x650C, sub) for sub in (1, 2)] == [0, 100 - 255_000]
    bench.put(0x6003, 7)
    assert [bench.get(0x6020, 1), bench.position, bench.get(0x6509)] == [7, 7, 7 - 5000]
    bench.put(0x6031, 1, 2)
    bench.encoder.turn_shaft(0.05)
    bench.run(0.05)
    assert [bench.get(0x6030, sub) for sub in (1, 2)] == [50, 50]
    bench.restart()
    assert bench.get(0x650C, 2) == 100 - 255_000


@pytest.mark.requirement("C406-019")
def test_high_precision_position_is_not_folded():
    """6008h counts on where 6004h is folded into 6002h, and 6009h presets both in 64 bits."""
    bench = EncoderBench(steps_per_revolution=1000, revolutions=16)
    bench.put(0x6002, 2500)
    bench.count(6001)
    assert (bench.get(0x6008), bench.position) == (6001, 1001)
    for value in (10**12 + 7, -(10**12) - 7):
        bench.put(0x6009, value)
        assert (bench.get(0x6008), bench.position) == (value, value % 2500)
    assert refused(bench, 0x6009, 1 << 62 | 1) == TOO_HIGH


# -- memory --------------------------------------------------------------------------------------------


@pytest.mark.requirement("C406-005")
def test_preset_is_remembered_at_once():
    """The offset survives a loss of supply without 1010h; an incremental encoder forgets it."""
    bench = EncoderBench()
    bench.count(1000)
    bench.put(0x6003, 50)
    bench.restart()
    assert (bench.position, bench.get(0x6509)) == (50, -950)
    counting = EncoderBench(kind=EncoderType.INCREMENTAL_ROTARY_COUNTING)
    counting.put(0x6003, 50)
    counting.restart()
    assert (counting.position, counting.get(0x6509)) == (0, 0)


@pytest.mark.requirement("C406-005", "C406-007", "C301-140", "C301-141")
def test_offset_belongs_to_its_scaling():
    """An offset of a scaling that was not saved is dropped with it; one that was saved with it stays;
    defaults end it.
    """
    bench = EncoderBench()
    bench.count(8192)
    bench.put(0x6001, 4096)
    bench.put(0x6003, 50)
    bench.restart()
    assert (bench.get(0x6001), bench.get(0x6509), bench.position) == (8192, 0, 8192)
    bench.put(0x6001, 4096)
    bench.put(0x6003, 50)
    bench.put(0x1010, 0x65766173, 1)
    bench.restart()
    assert (bench.get(0x6001), bench.get(0x6509), bench.position) == (4096, 50 - 4096, 50)
    bench.put(0x1011, 0x64616F6C, 1)
    bench.restart()
    assert (bench.get(0x6001), bench.get(0x6509), bench.position) == (8192, 0, 8192)


@pytest.mark.requirement("C301-018", "C406-007")
def test_resets():
    """Reset communication leaves the position formation alone; reset node begins as after power-on."""
    bench = EncoderBench()
    bench.put(0x6001, 4096)
    bench.put(0x6003, 99)
    bench.master.nmt(0x82, 7)
    bench.run(0.01)
    assert (bench.get(0x6001), bench.position) == (4096, 99)
    bench.master.nmt(0x81, 7)
    bench.run(0.01)
    assert (bench.get(0x6001), bench.position) == (8192, 0)
    counting = EncoderBench(kind=EncoderType.SINGLE_TURN_COUNTING)
    for turns in range(1, 4):
        counting.count(turns * 8192)
    counting.master.nmt(0x81, 7)
    counting.run(0.01)
    assert counting.position == 3 * 8192


# -- mounting and configuration ------------------------------------------------------------------------


def test_mounting():
    """Gear, direction, place of the zero and play stand between shaft and encoder."""
    geared = EncoderBench(steps_per_revolution=1000, mounting={"ratio": -0.5, "offset": math.pi})
    geared.shaft.place(2 * math.pi)
    geared.run(0.002)
    assert geared.position == 0
    geared.shaft.place(0.0)
    geared.run(0.002)
    assert geared.position == 500
    worn = EncoderBench(steps_per_revolution=1000, mounting={"backlash": 2 * math.pi / 100})
    shown = []
    for steps in (100, 103, 98, 94, 93, 80, 85, 91):
        worn.count(steps)
        shown.append(worn.position)
    assert shown == [95, 98, 98, 98, 98, 85, 85, 86]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"node_id": 0}, "node_id: 0 is not allowed"),
        ({"steps_per_revolution": 2}, "steps_per_revolution"),
        ({"revolutions": 70_000}, "revolutions"),
        ({"steps_per_revolution": 1 << 24}, "revolutions.*at most"),
        ({"kind": EncoderType.ABSOLUTE_LINEAR, "length_mm": 3000.0, "measuring_step_um": 0.001}, "length_mm"),
        ({"kind": EncoderType.ABSOLUTE_LINEAR, "length_mm": math.nan}, "length_mm"),
        ({"kind": EncoderType.MULTI_SENSOR, "sensor_places_m": (0.0,)}, "sensor_places_m"),
        ({"max_speed_rpm": -1.0}, "max_speed_rpm"),
        ({"zero_mark": 1.0}, "zero_mark"),
        ({"serial_number": -1}, "serial_number"),
        ({"boot_time_s": -1.0}, "boot_time_s"),
        ({"measuring_step_um": 0.0}, "measuring_step_um"),
        ({"measuring_step_um": 0.0004}, "measuring_step_um"),
    ],
)
def test_configuration_that_cannot_be(options, words):
    """A wrong value is named with what is allowed."""
    with pytest.raises(ConfigurationError, match=words):
        EncoderDeviceConfig(**options)
