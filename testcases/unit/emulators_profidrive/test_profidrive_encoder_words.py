"""G1 of the axis: reference mark and probes on the machine of the drive, parking, errors, formats."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from emulators.drive.machine import SwitchesConfig
from emulators.drive.profidrive import AxisState, ProfidriveConfig
from emulators.encoder.profidrive import p979
from fieldbus.clock import MS
from fieldbus.errors import ConfigurationError
from testcases.unit.emulators_profidrive.profidrive_rig import RUN, Rig

SEARCH, READ, MEASURE = 0x0011, 0x0020, 0x0080
PARK, ACKNOWLEDGE = 0x4000, 0x8000
FINE = 2048 << 11


def increments_of(rig, position_m):
    """Return G1_XIST1 at a position of the load, from the true machine alone."""
    turns = position_m / rig.drive.mechanics.ratio / math.tau
    start = rig.config.mechanics.start_position_mm / 1000.0 / rig.drive.mechanics.ratio / math.tau
    return (turns - start) * FINE


@pytest.mark.requirement("PD-143", "PD-153", "PD-154", "PD-155", "PD-173")
def test_reference_mark():
    """The zero mark is passed within a cycle and shown to the increment; the next revolution has it again."""
    config = ProfidriveConfig.reference()
    rig = Rig(replace(config, encoder=replace(config.encoder, zero_mark_counts=700)))
    rig.turn(600.0)
    values = []
    for _ in range(2):
        for word in (SEARCH, SEARCH):
            rig.cycle(RUN, G1_STW=word, count=30, **rig.speed(600.0))
        assert rig.actual["G1_ZSW"] == 0
        rig.cycle(RUN, G1_STW=0, **rig.speed(600.0))
        rig.cycle(RUN, G1_STW=READ | 1, **rig.speed(600.0))
        assert rig.actual["G1_ZSW"] == 0x0010
        values.append(rig.actual["G1_XIST2"])
        rig.cycle(RUN, G1_STW=0, **rig.speed(600.0))
    start = increments_of(rig, 0.0)  # G1_XIST1 where the machine is at zero
    for value in values:
        assert (value - round(start) - (700 << 11)) % FINE in {0, 1, FINE - 1}
    assert values[1] > values[0]
    assert values[0] <= rig.actual["G1_XIST1"]


@pytest.mark.requirement("PD-143", "PD-157", "PD-158", "PD-159", "PD-173")
def test_probes_on_the_travel():
    """Both edges of a workpiece are latched where they are, not where the axis stands at the next cycle."""
    config = ProfidriveConfig.reference()
    here = config.mechanics.start_position_mm
    workpiece = SwitchesConfig(probe1_from_mm=here + 12.3, probe1_to_mm=here + 17.7)
    rig = Rig(replace(config, switches=workpiece))
    switch = rig.drive.train.switches["probe1"]
    speed = rig.speed(600.0)
    rig.enable()
    rig.cycle(RUN, G1_STW=MEASURE | 0x13, **speed)
    assert rig.actual["G1_ZSW"] & 0xFF == 0x0003
    for _ in range(800):
        rig.cycle(RUN, G1_STW=MEASURE | 0x13, **speed)
        if not rig.actual["G1_ZSW"] & 3:
            break
    rig.cycle(RUN, G1_STW=MEASURE, **speed)
    for function, edge in ((1, switch.low), (2, switch.high)):
        rig.cycle(RUN, G1_STW=MEASURE | READ | function, **speed)
        assert rig.actual["G1_ZSW"] & 0xFF == function << 4
        assert rig.actual["G1_XIST2"] == pytest.approx(increments_of(rig, edge), abs=1)


@pytest.mark.requirement("PD-143")
@pytest.mark.parametrize("late_ns", [0, 100_000, 249_999])
def test_probe_by_hand(late_ns):
    """An edge that the load has no part in is latched at its instant, also between two servo steps; its level
    shows in bit 9.
    """
    rig = Rig()
    rig.turn(600.0)
    speed = rig.speed(600.0)
    rig.cycle(RUN, G1_STW=MEASURE | 0x14, **speed)
    before = rig.actual["G1_XIST1"]
    elapsed = rig.config.cycle_ns  # since the encoder was read for the answer
    rig.scheduler.run_for(MS + late_ns)
    rig.drive.train.switches["probe2"].forced = True
    rig.scheduler.run_for(rig.config.cycle_ns - MS - late_ns)
    rig.cycle(RUN, G1_STW=MEASURE | READ | 4, **speed)
    rig.cycle(RUN, G1_STW=MEASURE | READ | 4, **speed)
    assert rig.actual["G1_ZSW"] == 0x0240
    way = 10.0 * (elapsed + MS + late_ns) / 1e9 * FINE
    assert rig.actual["G1_XIST2"] - before == pytest.approx(way, rel=1e-3)


@pytest.mark.requirement("PD-151", "PD-168", "PD-144")
def test_parking_does_not_stop_the_drive():
    """Parking hides the encoder from the controller, the motor runs on; afterwards the count has gone on."""
    rig = Rig()
    rig.turn(600.0)
    before = rig.actual["G1_XIST1"]
    cycles = rig.cycle(RUN, G1_STW=PARK, count=30, **rig.speed(600.0))
    assert (cycles["G1_ZSW"], cycles["G1_XIST1"], cycles["G1_XIST2"]) == (PARK, 0, 0)
    rig.cycle(RUN, **rig.speed(600.0))
    assert rig.actual["G1_ZSW"] == 0
    assert rig.drive.state is AxisState.S4
    assert rig.actual["G1_XIST1"] - before == pytest.approx(10.0 * 31 * 0.004 * FINE, rel=1e-2)


@pytest.mark.requirement("PD-152", "PD-164", "PD-165", "PD-184")
def test_errors_and_their_acknowledgement():
    """What the drive does not do is 0F01h; a brought-about error persists until its cause is gone and it is
    acknowledged.
    """
    rig = Rig()
    rig.enable()
    for word in (0x1000, 0x0800, 0x0040):
        rig.cycle(RUN, G1_STW=word)
        assert (rig.actual["G1_ZSW"], rig.actual["G1_XIST2"]) == (0x8000, 0x0F01)
        rig.cycle(RUN, G1_STW=ACKNOWLEDGE)
        rig.cycle(RUN)
        assert rig.actual["G1_ZSW"] == 0
    rig.drive.encoder_words.set_error(0x0002)
    rig.cycle(RUN, G1_STW=ACKNOWLEDGE, count=2)
    assert (rig.actual["G1_ZSW"], rig.actual["G1_XIST2"]) == (0x8800, 0x0002)
    rig.drive.encoder_words.clear_error(0x0002)
    rig.cycle(RUN, G1_STW=ACKNOWLEDGE)
    assert (rig.actual["G1_ZSW"], rig.actual["G1_XIST2"]) == (0x0800, 0)
    rig.cycle(RUN)
    assert rig.actual["G1_ZSW"] == 0


@pytest.mark.requirement("PD-172", "PD-147", "PD-190", "PD-191", "PD-192", "PD-193")
def test_absolute_encoder():
    """An absolute encoder begins with its value in both words; P979 tells the formats; an incremental one has
    none: 0008h.
    """
    config = ProfidriveConfig.reference(start_position_mm=12.3)
    absolute = replace(config, encoder=replace(config.encoder, kind="absolute", turns=4096))
    rig = Rig(absolute)
    rig.cycle(RUN, G1_STW=0x2000)
    steps = (rig.drive.mechanics.motor_angle / math.tau * 2048) % (4096 * 2048)
    assert rig.actual["G1_ZSW"] == 0x2000
    assert rig.actual["G1_XIST1"] % 2**32 == pytest.approx(steps * 2**11 % 2**32, abs=1)
    assert rig.actual["G1_XIST2"] % 2**32 == pytest.approx(steps * 2**9, abs=1)
    assert p979(absolute.encoder_format)[1:6] == (0xC000_0002, 2048, 11, 9, 4096)
    other = Rig(config)
    other.cycle(RUN, G1_STW=0x2000)
    assert (other.actual["G1_ZSW"], other.actual["G1_XIST2"]) == (0x8000, 0x0008)


def test_format_has_to_fit():
    """An absolute value that needs more than 32 bits is refused with the configuration."""
    config = ProfidriveConfig.reference()
    with pytest.raises(ConfigurationError, match="shift_xist2"):
        replace(config, encoder=replace(config.encoder, kind="absolute", turns=8192))
