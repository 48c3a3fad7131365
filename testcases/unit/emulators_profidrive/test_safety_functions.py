"""Safety functions of the axis as its telegrams show them: safe stops, standstill, speed, direction,
position, brake.
"""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from emulators.drive.machine import BrakeConfig
from emulators.drive.profidrive import AxisState, ProfidriveConfig
from emulators.drive.safety_config import SafeMotionConfig
from fieldbus.errors import ConfigurationError
from fieldbus.profidrive import TelegramError, telegram
from fieldbus.profidrive.words import S_ZSW1B, ZSW1
from testcases.unit.emulators_profidrive.profidrive_rig import READY, RUN, Rig

CYCLE_S = 0.004
STO, SS1, SS2, SOS, SLS = 0x0001, 0x0002, 0x0004, 0x0008, 0x0010
SOS_SELECTED, SLS_SELECTED, EVENT, MESSAGE = 0x0020, 0x0040, 0x0080, 0x8000
OPEN_BRAKE = 0x1000


def build(number=105, *, channel=701, brake=0.0, **safety):
    """Return the reference axis (10 mm per revolution, 0.5 s on OFF3 from 3000 rpm) with a safety information
    channel.
    """
    config = ProfidriveConfig.reference(telegram=number)
    return Rig(
        replace(
            config,
            safety_telegram=channel,
            safety=SafeMotionConfig(**safety),
            brake=BrakeConfig(torque_nm=brake),
        )
    )


def time_to_standstill(rig, rpm, **signals):
    """Return how long the axis goes on moving under the telegram that has led it, s."""
    cycles = 0
    while abs(rig.drive.core.speed_rpm) > 1.0:
        rig.cycle(RUN, **{**rig.speed(rpm), **signals})
        cycles += 1
        assert cycles < 1000
    return cycles * CYCLE_S


# -- safe stopping -------------------------------------------------------------------------------------


@pytest.mark.requirement("CFG-443", "CFG-471", "CFG-472", "CFG-439")
def test_safe_torque_off_coasts_and_shows_bit_0():
    """STO takes the pulses at once without a fault: friction alone brakes. Bit 0 is 1 as long as it is in
    force.
    """
    rig = build()
    rig.turn(1500.0)
    assert rig.actual["S_ZSW1B"] == 0
    rig.drive.safety.set_sto(True)
    rig.cycle(RUN, count=5, **rig.speed(1500.0))
    assert rig.actual["S_ZSW1B"] == STO
    assert rig.drive.state is AxisState.S1
    assert rig.drive.core.torque == 0.0
    assert rig.drive.core.speed_rpm > 1000.0
    assert not rig.actual["ZSW1"] & (ZSW1.FAULT | ZSW1.NO_OFF2)
    rig.drive.safety.set_sto(False)
    assert rig.cycle(READY)["S_ZSW1B"] == 0


@pytest.mark.requirement("CFG-444", "CFG-473", "CFG-474")
def test_safe_stop_1_brakes_on_the_off3_ramp_and_ends_in_safe_torque_off():
    """From 1500 of 3000 rpm half of p1135 passes; bit 1 all the time, bit 0 from standstill on; no start
    afterwards.
    """
    rig = build(ss1_time_ms=1000.0)
    rig.turn(1500.0)
    rig.drive.safety.set_ss1(True)
    rig.cycle(RUN, **rig.speed(1500.0))
    assert rig.actual["S_ZSW1B"] == SS1
    assert rig.drive.state is AxisState.S5B
    assert not rig.actual["ZSW1"] & ZSW1.NO_OFF3
    assert time_to_standstill(rig, 1500.0) == pytest.approx(0.25, abs=0.02)
    rig.cycle(RUN, count=50, **rig.speed(1500.0))
    assert rig.actual["S_ZSW1B"] == SS1 | STO
    rig.cycle(READY, count=5)
    rig.cycle(RUN, count=50, **rig.speed(1500.0))
    assert abs(rig.drive.core.speed_rpm) < 1.0
    rig.drive.safety.set_ss1(False)
    assert rig.cycle(READY, count=2)["S_ZSW1B"] == 0


@pytest.mark.exhaustive
@pytest.mark.requirement("CFG-447", "CFG-613")
def test_taking_the_enable_away_disturbs_safe_stop_1():
    """With the control word kept the ramp is completed; with OFF2 in between the axis coasts from there."""
    kept, disturbed = (
        build(ss1_time_ms=1000.0),
        build(ss1_time_ms=1000.0),
    )
    for rig, word in ((kept, RUN), (disturbed, RUN & ~0x02)):
        rig.turn(1500.0)
        rig.drive.safety.set_ss1(True)
        rig.cycle(RUN, count=20, **rig.speed(1500.0))
        rig.cycle(word, count=60, **rig.speed(1500.0))
    assert abs(kept.drive.core.speed_rpm) < 5.0
    assert disturbed.drive.core.speed_rpm > 500.0


@pytest.mark.exhaustive
@pytest.mark.requirement("CFG-445", "CFG-477", "CFG-478", "CFG-481", "CFG-482", "CFG-442")
def test_safe_stop_2_brakes_and_stays_under_control():
    """SS2 brakes on the OFF3 ramp; then the standstill is monitored in operation, and after its end setpoints
    act again.
    """
    rig = build(ss2_time_ms=1000.0)
    rig.turn(1500.0)
    rig.drive.safety.set_ss2(True)
    rig.cycle(RUN, **rig.speed(1500.0))
    assert rig.actual["S_ZSW1B"] == SS2
    # Operation enabled stays, and "no quick stop" is 0 though the controller has not asked for one (CFG-448).
    assert rig.actual["ZSW1"] & 0x0067 == 0x0007
    assert rig.actual["S_V_LIMIT_B"] == 0
    assert time_to_standstill(rig, 1500.0) == pytest.approx(0.25, abs=0.02)
    rig.cycle(RUN, count=10, **rig.speed(1500.0))
    place = rig.drive.core.position
    rig.cycle(RUN, count=100, **rig.speed(1500.0))
    assert rig.actual["S_ZSW1B"] == SS2 | SOS | SOS_SELECTED
    assert rig.drive.state is AxisState.S4
    assert rig.drive.core.position == pytest.approx(place, abs=0.01)
    rig.drive.safety.set_ss2(False)
    rig.cycle(RUN, count=100, **rig.speed(1500.0))
    assert rig.actual["S_ZSW1B"] == 0
    assert rig.actual["ZSW1"] & ZSW1.NO_OFF3
    assert rig.drive.core.speed_rpm == pytest.approx(1500.0, abs=1.0)


@pytest.mark.requirement("CFG-445", "CFG-481")
def test_a_drive_that_is_moved_at_monitored_standstill_trips():
    """A force that shifts the load by more than the tolerance after SS2 leads to SS1, then STO, and a safety
    message.
    """
    rig = build(sos_tolerance_mm=0.5, ss1_time_ms=200.0)
    rig.turn(300.0)
    rig.drive.safety.set_ss2(True)
    rig.cycle(RUN, count=100)
    rig.drive.mechanics.apply_force(20_000.0)
    rig.cycle(RUN, count=10)
    assert rig.actual["S_ZSW1B"] & (EVENT | MESSAGE | SS1) == EVENT | MESSAGE | SS1
    assert rig.actual["ZSW1"] & ZSW1.WARNING
    rig.drive.mechanics.apply_force(0.0)
    rig.cycle(RUN, count=100)
    assert rig.actual["S_ZSW1B"] & STO
    assert rig.drive.faults.warns(1707)
    rig.drive.safety.set_ss2(False)
    assert rig.cycle(READY, count=5)["S_ZSW1B"] & (MESSAGE | STO) == MESSAGE | STO
    rig.drive.safety.acknowledge()
    assert rig.cycle(READY, count=5)["S_ZSW1B"] == 0


def test_a_safe_stop_2_without_effect_takes_the_torque():
    """A ramp that is not kept (the drive's torque is too small) is a message with STO."""
    rig = build(ss2_time_ms=300.0)
    rig.turn(1500.0)
    rig.drive.torque.cap(injected_Nm=0.05)
    rig.drive.safety.set_ss2(True)
    rig.cycle(RUN, count=60, **rig.speed(1500.0))
    assert rig.actual["S_ZSW1B"] & (STO | MESSAGE) == STO | MESSAGE
    assert rig.drive.faults.warns(1706)


@pytest.mark.exhaustive
@pytest.mark.requirement("CFG-452", "CFG-453", "CFG-475", "CFG-476")
@pytest.mark.parametrize("halted", [True, False])
def test_safe_stop_1_external_leaves_the_braking_to_the_controller(halted):
    """SS1E with a delay of 2 s: nothing happens at first; STO at 2.0 s, at standstill or while the axis still
    turns.
    """
    rig = build(ss1_time_ms=2000.0, ss1_external=True)
    rig.turn(1500.0)
    rig.drive.safety.set_ss1(True)
    rig.cycle(RUN, count=100, **rig.speed(1500.0))
    assert rig.actual["S_ZSW1B"] == SS1
    assert rig.actual["ZSW1"] & ZSW1.NO_OFF3
    assert rig.drive.core.speed_rpm == pytest.approx(1500.0, abs=1.0)
    rpm = 0.0 if halted else 1500.0
    rig.cycle(RUN, count=398, **rig.speed(rpm))
    assert rig.actual["S_ZSW1B"] == SS1
    rig.cycle(RUN, count=4, **rig.speed(rpm))
    assert rig.actual["S_ZSW1B"] == SS1 | STO
    assert (abs(rig.drive.core.speed_rpm) < 1.0) is halted


@pytest.mark.requirement("CFG-452", "CFG-479", "CFG-480", "CFG-441")
def test_safe_stop_2_external_shows_itself_in_the_third_word():
    """SS2E: bit 11 of S_ZSW3B, no braking; the standstill is monitored when the delay has passed."""
    rig = build(ss2_external=True, ss2_time_ms=400.0)
    rig.turn(600.0)
    rig.drive.safety.set_ss2(True)
    rig.cycle(RUN, count=50, **rig.speed(600.0))
    assert (rig.actual["S_ZSW1B"], rig.actual["S_ZSW3B"]) == (0, 0x0800)
    assert rig.drive.core.speed_rpm == pytest.approx(600.0, abs=1.0)
    rig.cycle(RUN, count=80)
    assert (rig.actual["S_ZSW1B"], rig.actual["S_ZSW3B"]) == (SOS | SOS_SELECTED, 0x0800)
    rig.drive.safety.set_ss2(False)
    rig.cycle(RUN)
    assert (rig.actual["S_ZSW1B"], rig.actual["S_ZSW3B"]) == (0, 0)


@pytest.mark.requirement("CFG-452", "CFG-481", "CFG-482")
@pytest.mark.parametrize("halted", [True, False])
def test_safe_operating_stop_monitors_after_its_delay(halted):
    """SOS brakes nothing; who has not stopped within the delay is stopped with SS1 and then STO."""
    rig = build(sos_delay_ms=400.0, ss1_time_ms=500.0)
    rig.turn(600.0)
    rig.drive.safety.set_sos(True)
    rig.cycle(RUN, count=90, **rig.speed(0.0 if halted else 600.0))
    assert rig.actual["S_ZSW1B"] == SOS_SELECTED
    rig.cycle(RUN, count=30, **rig.speed(0.0 if halted else 600.0))
    word = rig.actual["S_ZSW1B"]
    if halted:
        assert word == SOS_SELECTED | SOS
    else:
        assert word & (SOS | EVENT | MESSAGE) == SOS | EVENT | MESSAGE
        rig.cycle(RUN, count=150, **rig.speed(600.0))
        assert rig.actual["S_ZSW1B"] & STO


@pytest.mark.requirement("CFG-483", "PD-056")
@pytest.mark.parametrize(("sbc", "held"), [(True, True), (False, False)])
def test_safe_brake_control_closes_the_brake_against_bit_12(sbc, held):
    """STW1 bit 12 holds the brake open without any condition; with SBC it closes with STO all the same."""
    rig = build(brake=10.0, sbc=sbc)
    rig.enable()
    brake = rig.drive.core.brake
    rig.cycle(RUN | OPEN_BRAKE, count=5)
    rig.cycle(READY | OPEN_BRAKE, count=50)
    assert rig.drive.state is AxisState.S2
    assert not brake.closed
    rig.drive.safety.set_sto(True)
    rig.cycle(READY | OPEN_BRAKE, count=5)
    assert brake.closed is held
    rig.drive.safety.set_sto(False)
    rig.cycle(READY | OPEN_BRAKE, count=5)
    assert not brake.closed
    rig.cycle(READY, count=5)
    assert brake.closed


@pytest.mark.requirement("CFG-483")
def test_selected_safe_brake_control_is_an_off2():
    """SBC alone takes the pulses and closes the brake, whatever the speed is."""
    rig = build(brake=10.0)
    rig.turn(600.0)
    rig.drive.safety.set_sbc(True)
    rig.cycle(RUN | OPEN_BRAKE, count=3, **rig.speed(600.0))
    assert rig.drive.core.brake.closed
    assert rig.drive.state is AxisState.S1
    assert rig.actual["S_ZSW1B"] == STO


# -- safe motion monitoring ----------------------------------------------------------------------------


@pytest.mark.exhaustive
@pytest.mark.requirement(
    "CFG-457", "CFG-458", "CFG-459", "CFG-463", "CFG-485", "CFG-486", "CFG-487", "CFG-488"
)
def test_safely_limited_speed_with_a_controller_that_reacts():
    """Level 1 of 250 mm/s with 80 %: S_V_LIMIT_B is 1200 rpm of 3000, 1999 999Ah, 200 mm/s; at that speed
    nothing trips.
    """
    rig = build(sls_limits_mm_s=(250.0,), sls_factor_percent=80.0, sls_delay_ms=200.0)
    rig.turn(2400.0)
    assert rig.actual["S_V_LIMIT_B"] == 0x4000_0000  # p1082
    rig.drive.safety.set_sls(1)
    rig.cycle(RUN, count=10, **rig.speed(2400.0))
    assert rig.actual["S_ZSW1B"] == SLS_SELECTED
    assert rig.actual["S_V_LIMIT_B"] == pytest.approx(0x1999_999A, abs=1)
    rig.cycle(RUN, count=300, **rig.speed(1200.0))
    assert rig.actual["S_ZSW1B"] == SLS_SELECTED | SLS
    assert rig.drive.core.speed_rpm == pytest.approx(1200.0, abs=1.0)
    rig.drive.safety.set_sls(None)
    rig.cycle(RUN, count=300, **rig.speed(2400.0))
    assert rig.actual["S_ZSW1B"] == 0
    assert rig.drive.core.speed_rpm == pytest.approx(2400.0, abs=1.0)


@pytest.mark.requirement("CFG-464", "CFG-611")
@pytest.mark.parametrize("reaction", ["sto", "ss1", "ss2"])
def test_safely_limited_speed_with_a_controller_that_does_not_react(reaction):
    """Above 250 mm/s (1500 rpm) after the delay the drive stops by itself, as configured, and waits for a
    safe acknowledgement.
    """
    rig = build(sls_delay_ms=100.0, sls_reaction=reaction, ss1_time_ms=1000.0)
    rig.turn(1600.0)
    rig.drive.safety.set_sls(1)
    rig.cycle(RUN, count=24, **rig.speed(1600.0))
    assert not rig.drive.safety.event
    rig.cycle(RUN, count=5, **rig.speed(1600.0))
    expected = {"sto": AxisState.S1, "ss1": AxisState.S5B, "ss2": AxisState.S4}[reaction]
    assert rig.drive.state is expected
    assert rig.actual["S_ZSW1B"] & (EVENT | MESSAGE) == EVENT | MESSAGE
    assert rig.drive.faults.warns(1714)
    assert not rig.actual["ZSW1"] & ZSW1.FAULT
    rig.cycle(RUN, count=100, **rig.speed(1600.0))
    assert rig.drive.state is (AxisState.S4 if reaction == "ss2" else AxisState.S1)
    rig.drive.safety.set_sls(None)
    assert rig.cycle(RUN)["S_ZSW1B"] & MESSAGE
    # Selecting and deselecting STO acknowledges safely, too.
    rig.drive.safety.set_sto(True)
    rig.drive.safety.set_sto(False)
    assert rig.cycle(READY, count=3)["S_ZSW1B"] == 0


@pytest.mark.requirement("CFG-460")
def test_the_limit_of_a_rotary_axis_is_that_of_its_motor():
    """Levels 1 to 4 show in bits 9 and 10; with gear 10:1 a limit of 900 degrees/s is 1500 rpm of the
    motor.
    """
    from emulators.drive.machine import RotaryAxisConfig

    config = replace(
        ProfidriveConfig.reference(),
        mechanics=RotaryAxisConfig(gear_ratio=10.0),
        safety_telegram=700,
        safety=SafeMotionConfig(
            sls_limits_mm_s=(1e3, 2e3, math.radians(900e3), 50e3), sls_factor_percent=100.0
        ),
    )
    from emulators.drive.profidrive import ProfidriveDrive
    from fieldbus.clock import VirtualScheduler

    drive = ProfidriveDrive(VirtualScheduler(), config, name="drive")
    drive.power_on()
    levels = []
    for level in (1, 2, 3, 4):
        drive.safety.set_sls(level)
        answer = drive.telegram.actual.decode(drive.transmit())
        levels.append(answer["S_ZSW1B"] >> 9 & 3)
        if level == 3:
            assert answer["S_V_LIMIT_B"] == pytest.approx(0x2000_0000, abs=1)
    assert levels == [0, 1, 2, 3]
    with pytest.raises(ConfigurationError, match=r"1\.\.4"):
        drive.safety.set_sls(5)


@pytest.mark.exhaustive
@pytest.mark.requirement(
    "CFG-467", "CFG-468", "CFG-490", "CFG-491", "CFG-492", "CFG-493", "CFG-442", "CFG-611"
)
@pytest.mark.parametrize(("direction", "bit"), [(1, 0x1000), (-1, 0x2000)])
def test_safe_direction(direction, bit):
    """Only the selected direction is permitted: motion against it, still there after the delay, is stopped by
    the drive.
    """
    good, bad = build(sdi_delay_ms=100.0), build(sdi_delay_ms=100.0)
    for rig, rpm in ((good, 300.0 * direction), (bad, -300.0 * direction)):
        rig.turn(rpm)
        rig.drive.safety.set_sdi(direction)
        rig.cycle(RUN, count=24, **rig.speed(rpm))
        assert rig.actual["S_ZSW1B"] == bit
        assert rig.actual["S_ZSW2B"] == {0x1000: 0x0100, 0x2000: 0x0200}[bit]
        assert rig.actual["S_V_LIMIT_B"] == 0
        rig.cycle(RUN, count=100, **rig.speed(rpm))
    assert good.actual["S_ZSW1B"] == bit
    assert bad.actual["S_ZSW1B"] & (bit | STO | EVENT | MESSAGE) == bit | STO | EVENT | MESSAGE
    assert bad.drive.faults.warns(1716)
    good.drive.safety.set_sdi(None)
    assert good.cycle(RUN)["S_ZSW1B"] == 0


@pytest.mark.exhaustive
@pytest.mark.requirement("CFG-470", "CFG-494", "CFG-495", "CFG-496", "CFG-440", "CFG-611")
def test_safely_limited_position():
    """Outside the selected range the drive stops by itself; S_ZSW2B shows selection and range."""
    rig = build(slp_ranges_mm=((-100.0, 100.0), (-100.0, 500.0)), slp_delay_ms=0.0)
    rig.turn(600.0)
    rig.drive.safety.set_slp(2)
    assert rig.cycle(RUN, **rig.speed(600.0))["S_ZSW2B"] == 0x0090
    while rig.drive.mechanics.position < 0.49:
        rig.cycle(RUN, **rig.speed(600.0))
        assert not rig.drive.safety.event
    rig.cycle(RUN, count=100, **rig.speed(600.0))
    assert rig.drive.faults.warns(1715)
    assert rig.actual["S_ZSW1B"] & STO
    assert 0.5 < rig.drive.mechanics.position < 0.53
    rig.drive.safety.set_slp(None)
    assert rig.cycle(READY)["S_ZSW2B"] == 0


def test_messages_do_not_outlive_the_supply_but_selections_do():
    """After power-off and on the reaction is gone, and a selected function monitors again."""
    rig = build(sls_delay_ms=0.0, sls_reaction="sto")
    rig.turn(1600.0)
    rig.drive.safety.set_sls(1)
    rig.cycle(RUN, count=5, **rig.speed(1600.0))
    assert rig.actual["S_ZSW1B"] & MESSAGE
    rig.drive.power_off()
    rig.scheduler.run_for(2_000_000_000)  # it coasts
    rig.drive.power_on()
    assert rig.cycle(READY, count=2)["S_ZSW1B"] == SLS_SELECTED | SLS
    assert not rig.drive.faults.warnings


# -- safe brake test -----------------------------------------------------------------------------------

SELECT, START, NEGATIVE = 0x0001, 0x0002, 0x0008


@pytest.mark.requirement("CFG-454", "CFG-455", "CFG-456", "CFG-484", "CFG-612")
@pytest.mark.parametrize("direction", [0, NEGATIVE])
@pytest.mark.parametrize("strong", [True, False])
def test_the_brake_is_tested(strong, direction):
    """The drive pulls with 3 Nm at the closed brake: one of 5 Nm holds and is good, one of 1 Nm slips and is
    not.
    """
    rig = build(brake=5.0 if strong else 1.0, sbt_torque_nm=3.0, sbt_time_ms=400.0)
    rig.enable()
    place = rig.drive.mechanics.position
    rig.cycle(RUN, S_STW3B=SELECT | direction)
    assert rig.actual["S_ZSW3B"] == 0x0001
    rig.cycle(RUN, S_STW3B=SELECT | START | direction, count=50)
    if strong:
        assert rig.actual["S_ZSW3B"] == 0x0009
        assert rig.drive.core.torque == pytest.approx(-3.0 if direction else 3.0)
        assert rig.drive.core.brake.closed
        assert rig.actual["ZSW1"] & (ZSW1.OPERATION_ENABLED | ZSW1.NO_OFF3) == 0x0024
        rig.cycle(RUN, S_STW3B=SELECT | START | direction, count=120)
    assert rig.actual["S_ZSW3B"] == (0x0031 if strong else 0x0021)
    moved = rig.drive.mechanics.position - place
    if strong:
        assert moved == pytest.approx(0.0, abs=1e-5)
    else:
        assert abs(moved) > 0.001
        assert (moved > 0) is (direction == 0)
    # Afterwards setpoints act again, and the next selection begins with nothing.
    assert rig.cycle(RUN, count=50)["S_ZSW3B"] == 0
    rig.cycle(RUN, count=100, **rig.speed(300.0))
    assert rig.drive.core.speed_rpm == pytest.approx(300.0, abs=0.5)
    ended = [event.data["good"] for event in rig.history.events if event.kind == "drive.brake_test"]
    assert ended == [strong]


@pytest.mark.requirement("CFG-455")
def test_a_brake_test_needs_an_axis_at_rest():
    """In motion, or without operation, it does not begin; deselected or switched off it ends without a
    result.
    """
    rig = build(brake=5.0, sbt_torque_nm=3.0)
    rig.turn(300.0)
    assert rig.cycle(RUN, S_STW3B=SELECT | START, count=3, **rig.speed(300.0))["S_ZSW3B"] == 0x0001
    rig.cycle(RUN, count=100)
    assert rig.cycle(RUN, S_STW3B=SELECT | START, count=5)["S_ZSW3B"] == 0x0009
    assert rig.cycle(READY, S_STW3B=SELECT | START, count=50)["S_ZSW3B"] == 0x0001
    assert rig.drive.core.brake.closed
    rig.cycle(RUN, count=5)
    rig.cycle(RUN, S_STW3B=SELECT | START, count=5)
    assert rig.cycle(RUN, count=5)["S_ZSW3B"] == 0
    assert not rig.drive.core.brake.closed
    assert not [event for event in rig.history.events if event.kind == "drive.brake_test"]


# -- telegrams and configuration -----------------------------------------------------------------------


@pytest.mark.requirement("PD-028", "CFG-241")
@pytest.mark.parametrize(
    ("channel", "setpoints", "actual"),
    [
        (700, (), ("S_ZSW1B", "S_V_LIMIT_B")),
        (701, ("S_STW1B", "S_STW3B"), ("S_ZSW1B", "S_ZSW2B", "S_V_LIMIT_B", "S_ZSW3B")),
    ],
)
def test_the_channel_follows_the_telegram(channel, setpoints, actual):
    """700 brings three words, 701 two there and five back, behind the telegram and behind 750."""
    config = replace(ProfidriveConfig.reference(), torque_telegram=True, safety_telegram=channel)
    chosen = config.build_telegram()
    assert chosen.setpoint.names[-len(setpoints) - 3 :] == (
        "M_ADD1",
        "M_LIMIT_POS",
        "M_LIMIT_NEG",
        *setpoints,
    )
    assert chosen.actual.names[-len(actual) - 1 :] == ("M_ACT", *actual)
    assert chosen.actual.words == 11 + {700: 3, 701: 5}[channel]


def test_refusals():
    """What cannot be configured is named."""
    with pytest.raises(ConfigurationError, match="700, 701"):
        replace(ProfidriveConfig.reference(), safety_telegram=702)
    with pytest.raises(TelegramError, match="701 does not supplement telegram 81"):
        telegram(81).with_supplement(701)
    for key, value in (
        ("sls_limits_mm_s", ()),
        ("sls_limits_mm_s", (1.0,) * 5),
        ("sls_limits_mm_s", (0.0,)),
        ("sls_factor_percent", 0.0),
        ("sls_factor_percent", 110.0),
        ("slp_ranges_mm", ((1.0, 1.0),)),
        ("slp_ranges_mm", ((0.0, 1.0),) * 3),
        ("sls_reaction", "off"),
        ("ss2_time_ms", 0.0),
        ("sos_delay_ms", -1.0),
        ("sdi_tolerance_mm", math.inf),
    ):
        with pytest.raises(ConfigurationError, match=key):
            SafeMotionConfig(**{key: value})
    drive = build().drive
    with pytest.raises(ConfigurationError, match="1, -1"):
        drive.safety.set_sdi(2)
    with pytest.raises(ConfigurationError, match="slp_ranges"):
        drive.safety.set_slp(1)


def test_words_by_name():
    """A trace names the bits of the channel."""
    from fieldbus.profidrive import describe_word

    assert (
        describe_word("S_ZSW1B", int(S_ZSW1B.SS2_ACTIVE | S_ZSW1B.SOS_ACTIVE))
        == "000Ch SS2_ACTIVE SOS_ACTIVE"
    )
