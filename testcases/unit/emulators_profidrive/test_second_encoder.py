"""G2 of the axis: a second encoder on load or motor, with its own format, mounting and faults."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from emulators.drive.machine import SwitchesConfig
from emulators.drive.profidrive import AxisState, DriveParameters, ProfidriveConfig
from emulators.drive.second_encoder_config import LinearSecondEncoder, RotarySecondEncoder
from emulators.encoder.profidrive import p979
from fieldbus.errors import ConfigurationError, UnsupportedFaultError
from fieldbus.profidrive import to_kpc
from fieldbus.profidrive.words import ENCODER_ERRORS
from testcases.unit.emulators_profidrive.profidrive_rig import READY, RUN, SYNCHRONISED, Rig

SEARCH, READ, MEASURE, ABSOLUTE, PARK, ACKNOWLEDGE = 0x0011, 0x0020, 0x0080, 0x2000, 0x4000, 0x8000
SCALE = LinearSecondEncoder(type="incremental_linear", offset_mm=0.0)
"""A scale of 2 m with lines of 20 um."""
ABSOLUTE_SCALE = replace(SCALE, type="absolute_linear")
WHEEL = RotarySecondEncoder(
    type="incremental_rotary", steps_per_revolution=1024, fine_xist1_bits=8, fine_xist2_bits=4
)


def build(telegram=106, form=SCALE, *, switches=None, **encoder):
    config = ProfidriveConfig.reference(telegram=telegram)
    if switches is not None:
        config = replace(config, switches=switches)
    return Rig(replace(config, encoder2=replace(form, **encoder)))


def signed(value):
    return (value + (1 << 31)) % (1 << 32) - (1 << 31)


@pytest.mark.requirement(
    "PD-004", "PD-006", "PD-015", "PD-017", "CFG-207", "CFG-209", "CFG-211", "CFG-213", "CFG-302"
)
@pytest.mark.parametrize("telegram", [4, 6, 103, 106])
def test_a_scale_on_the_load(telegram):
    """G2_XIST1 counts the way of the load in 20 um / 2^11, while G1_XIST1 goes on counting the motor."""
    rig = build(telegram)
    rig.cycle(READY, count=SYNCHRONISED)
    place, first, second = rig.drive.mechanics.position, rig.actual["G1_XIST1"], rig.actual["G2_XIST1"]
    rig.turn(900.0)
    way = rig.drive.mechanics.position
    rig.drive.cycle()
    actual = rig.drive.telegram.actual.decode(rig.drive.transmit())
    assert signed(actual["G2_XIST1"] - second) == pytest.approx((way - place) / 20e-6 * 2048, abs=1)
    assert signed(actual["G1_XIST1"] - first) == pytest.approx((way - place) / 0.010 * 2048 * 2048, abs=1)
    assert actual["G2_ZSW"] == 0


@pytest.mark.requirement("PD-004")
@pytest.mark.parametrize(
    ("mounting", "ratio", "keys"),
    [
        ("motor", 1.0, {}),
        ("motor", -0.5, {"gear_denominator": 2, "reversed": True}),
        ("load", 2.0 * math.pi / 0.1, {"mm_per_revolution": 100.0}),
    ],
)
def test_a_rotary_one_with_its_own_gear_and_direction(mounting, ratio, keys):
    """On the motor shaft, through a gear the other way round, or as a wheel of 100 mm on the load."""
    rig = build(form=WHEEL, mounting=mounting, **keys)
    rig.cycle(READY, count=SYNCHRONISED)
    mechanics = rig.drive.mechanics
    start = mechanics.motor_angle if mounting == "motor" else mechanics.position
    rig.turn(300.0)
    rig.drive.cycle()
    actual = rig.drive.telegram.actual.decode(rig.drive.transmit())
    moved = (mechanics.motor_angle if mounting == "motor" else mechanics.position) - start
    assert signed(actual["G2_XIST1"]) == pytest.approx(moved * ratio / math.tau * 1024 * 256, abs=1)


@pytest.mark.exhaustive
@pytest.mark.requirement("PD-147", "PD-170", "PD-169", "CFG-304")
def test_an_absolute_one_knows_its_place():
    """An absolute scale shows place + offset in steps * 2^9 in G2_XIST2, and again after a loss of supply
    elsewhere.
    """
    rig = build(form=ABSOLUTE_SCALE, offset_mm=1000.0)
    for rpm in (300.0, -200.0):
        rig.turn(rpm)
        rig.drive.power_off()
        rig.scheduler.run_for(1_000_000_000)  # it coasts
        rig.drive.power_on()
        rig.cycle(READY, count=SYNCHRONISED, G2_STW=ABSOLUTE)
        where = rig.drive.mechanics.position + 1.0
        assert rig.actual["G2_ZSW"] == ABSOLUTE
        assert rig.actual["G2_XIST2"] % (1 << 32) == pytest.approx(where / 20e-6 * 512, abs=1)
        assert rig.actual["G2_XIST1"] == pytest.approx(where / 20e-6 * 2048, abs=1)


@pytest.mark.requirement("PD-188", "PD-194", "PD-255", "CFG-300", "CFG-301", "CFG-303")
def test_p979_tells_both():
    """Two encoders in the header, the second from sub-index 11 on; parameter 979 shows the same."""
    rig = build(form=ABSOLUTE_SCALE)
    row = p979(*rig.config.encoder_formats)
    assert row[0] == 0x5212
    assert row[1:6] == (0xC000_0000, 2048, 11, 9, 0)
    assert row[11:16] == (0xC000_0003, 20_000, 11, 9, 1)
    store = DriveParameters(rig.drive).store
    assert tuple(store.value(979, at) for at in range(31)) == row
    assert p979(*ProfidriveConfig.reference().encoder_formats)[0] == 0x5112


@pytest.mark.requirement("PD-141", "PD-142", "PD-143", "PD-153", "PD-154", "PD-155")
def test_its_own_reference_mark():
    """The zero mark of a wheel on the load is found by G2 alone, to the increment, and shown in its
    format.
    """
    rig = build(form=WHEEL, mm_per_revolution=50.0, zero_mark=1000)
    rig.turn(600.0)
    rig.cycle(RUN, G2_STW=SEARCH, count=300, **rig.speed(600.0))
    assert (rig.actual["G1_ZSW"], rig.actual["G2_ZSW"]) == (0, 0)
    rig.cycle(RUN, G2_STW=0, **rig.speed(600.0))
    rig.cycle(RUN, G2_STW=READ | 1, **rig.speed(600.0))
    assert (rig.actual["G1_ZSW"], rig.actual["G2_ZSW"]) == (0, 0x0010)
    assert rig.actual["G2_XIST2"] % (1024 * 256) == 1000


@pytest.mark.requirement("PD-143", "PD-157", "PD-158", "PD-159", "PD-173")
@pytest.mark.parametrize("mounting", ["load", "motor"])
def test_probes_are_latched_by_both(mounting):
    """One edge of a probe is latched in the increments of each encoder, where it was and not where the cycle
    is.
    """
    edge = 0.0123
    rig = build(
        form=SCALE if mounting == "load" else WHEEL,
        mounting=mounting,
        switches=SwitchesConfig(probe1_from_mm=edge * 1000.0, probe1_to_mm=20.0),
    )
    rig.enable()
    command = MEASURE | 0x11
    for _ in range(400):
        rig.cycle(RUN, G1_STW=command, G2_STW=command, **rig.speed(600.0))
    show = MEASURE | READ | 1
    rig.cycle(RUN, G1_STW=MEASURE, G2_STW=MEASURE, **rig.speed(600.0))
    rig.cycle(RUN, G1_STW=show, G2_STW=show, **rig.speed(600.0))
    assert (rig.actual["G1_ZSW"] & 0xFF, rig.actual["G2_ZSW"] & 0xFF) == (0x10, 0x10)
    turns = edge / 0.010
    assert rig.actual["G1_XIST2"] == pytest.approx(turns * 2048 * 2048, abs=1)
    second = edge / 20e-6 * 2048 if mounting == "load" else turns * 1024 * 256
    assert rig.actual["G2_XIST2"] == pytest.approx(second, abs=1)


@pytest.mark.requirement("PD-148", "PD-151", "PD-168", "PD-082")
def test_parking_one_leaves_the_other():
    """G2 parks by itself; with the axis (STW2 bit 7) both are parked."""
    rig = build()
    rig.turn(300.0)
    rig.cycle(RUN, G2_STW=PARK, count=2, **rig.speed(300.0))
    assert (rig.actual["G1_ZSW"], rig.actual["G2_ZSW"], rig.actual["G2_XIST1"]) == (0, PARK, 0)
    assert rig.drive.state is AxisState.S4
    rig.cycle(RUN, count=30, **rig.speed(300.0))
    assert rig.actual["G2_ZSW"] == 0
    rig.cycle(READY, count=60, STW2=0x80)
    assert (rig.actual["G1_ZSW"], rig.actual["G2_ZSW"]) == (PARK, PARK)


@pytest.mark.requirement("PD-149", "PD-152", "PD-164", "PD-165", "CFG-319")
def test_its_errors_do_not_stop_the_axis():
    """Every code is shown in G2_XIST2 until it is acknowledged; the axis goes on turning, G1 knows nothing of
    it.
    """
    rig = build(form=ABSOLUTE_SCALE)
    rig.turn(300.0)
    second = rig.drive.second
    at_once = [code for code in ENCODER_ERRORS if code not in {3, 4, 5, 6, 7, 8, 10}]
    for code in at_once:
        second.set_encoder_error(code, True)
        rig.cycle(RUN, count=2, **rig.speed(300.0))
        assert (rig.actual["G2_ZSW"], rig.actual["G2_XIST2"]) == (0x8000, code)
        second.set_encoder_error(code, False)
        rig.cycle(RUN, G2_STW=ACKNOWLEDGE, count=2, **rig.speed(300.0))
        rig.cycle(RUN, count=2, **rig.speed(300.0))
        assert rig.actual["G2_ZSW"] == 0
    assert rig.drive.state is AxisState.S4
    assert rig.actual["G1_ZSW"] == 0
    with pytest.raises(ConfigurationError, match="4711"):
        second.set_encoder_error(0x4711, True)


def test_a_broken_wire_is_a_warning():
    """The value stands, G2 shows 0001h, the drive warns and goes on; after the repair it can be
    acknowledged.
    """
    rig = build()
    rig.turn(300.0)
    rig.drive.second.break_encoder_wire(True)
    rig.cycle(RUN, count=5, **rig.speed(300.0))
    assert (rig.actual["G2_ZSW"], rig.actual["G2_XIST2"]) == (0x8000, 1)
    assert rig.drive.faults.warns(32410)
    assert rig.drive.state is AxisState.S4
    rig.drive.second.break_encoder_wire(False)
    rig.cycle(RUN, G2_STW=ACKNOWLEDGE, count=2, **rig.speed(300.0))
    rig.cycle(RUN, count=2, **rig.speed(300.0))
    assert rig.actual["G2_ZSW"] == 0
    assert not rig.drive.faults.warnings


def test_fault_methods():
    """Freeze, jump, reverse, lost steps and a missing mark hit the second encoder alone."""
    rig = build(form=WHEEL, mounting="motor")
    rig.turn(300.0)
    second = rig.drive.second
    assert second.name == "drive.encoder2"

    def moved(cycles=10):
        before = rig.actual["G2_XIST1"]
        rig.cycle(RUN, count=cycles, **rig.speed(300.0))
        return signed(rig.actual["G2_XIST1"] - before)

    usual = moved()
    assert usual == pytest.approx(0.04 * 5 * 1024 * 256, rel=0.01)
    second.freeze_encoder(True)
    moved(1)
    assert moved() == 0
    second.freeze_encoder(False)
    moved(1)
    second.jump_encoder(100_000)
    assert moved() == pytest.approx(usual + 100_000, rel=0.01)
    second.reverse_encoder(True)
    assert moved() == pytest.approx(-usual, rel=0.01)
    second.reverse_encoder(False)
    second.lose_encoder_steps(2)
    assert moved() == pytest.approx(usual / 2, rel=0.01)
    second.suppress_index(True)
    rig.cycle(RUN, G2_STW=SEARCH, count=100, **rig.speed(300.0))
    assert rig.actual["G2_ZSW"] == 1
    with pytest.raises(UnsupportedFaultError, match=r"drive\.encoder2: an absolute encoder has no index"):
        build(form=ABSOLUTE_SCALE).drive.second.suppress_index(True)
    assert rig.drive.core.speed_rpm == pytest.approx(300.0, abs=0.5)


def test_play_of_its_coupling():
    """With play the scale follows only after the load has gone through it, in both directions."""
    rig = build(backlash_mm=2.0)
    rig.enable()
    rig.cycle(RUN, count=200, **rig.speed(60.0))
    forth = signed(rig.actual["G2_XIST1"]) / 2048 * 20e-6
    assert rig.drive.mechanics.position - forth == pytest.approx(0.001, abs=1e-4)
    rig.cycle(RUN, count=400, **rig.speed(-60.0))
    back = signed(rig.actual["G2_XIST1"]) / 2048 * 20e-6
    assert back - rig.drive.mechanics.position == pytest.approx(0.001, abs=1e-4)


@pytest.mark.requirement("PD-151", "PD-004")
def test_without_one_it_is_parked():
    """A telegram with G2 and no second encoder shows 4000h and zeros."""
    rig = Rig(replace(ProfidriveConfig.reference(), telegram=106))
    rig.turn(300.0)
    assert [rig.actual[name] for name in ("G2_ZSW", "G2_XIST1", "G2_XIST2")] == [0x4000, 0, 0]


@pytest.mark.requirement("PD-197")
def test_dynamic_servo_control_with_the_second_encoder():
    """XERR in increments of encoder 2 (p1192 = 2) is converted with p1193: the load goes as far as it
    says.
    """
    rig = build(106)
    settings = rig.drive.settings
    settings.dsc_encoder = 2
    settings.dsc_factor = (2048 * 2048 / 0.010) / (2048 / 20e-6)
    rig.drive.refresh()
    rig.enable()
    start = rig.drive.mechanics.position
    target = rig.actual["G2_XIST1"] + round(0.001 / 20e-6 * 2048)
    for _ in range(400):
        rig.cycle(RUN, XERR=signed(target - rig.actual["G2_XIST1"]), KPC=to_kpc(100.0))
    assert rig.drive.mechanics.position - start == pytest.approx(0.001, abs=2e-6)


def test_refusals():
    """What does not fit is named."""
    for form, key, value in (
        (WHEEL, "mounting", "gear"),
        (SCALE, "mounting", "motor"),
        (WHEEL, "gear_numerator", 0),
        (WHEEL, "zero_mark", 1 << 31),
        (WHEEL, "backlash_deg", -1.0),
        (SCALE, "length_mm", 0.0),
    ):
        with pytest.raises(ConfigurationError, match=key):
            replace(form, **{key: value})
    with pytest.raises(ConfigurationError, match="p1192"):
        replace(ProfidriveConfig.reference().settings, dsc_encoder=3)
