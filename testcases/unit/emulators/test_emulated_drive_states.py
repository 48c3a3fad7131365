"""The drive's states with real ramps: option codes, quick stop, halt, faults, supply, brake."""

from __future__ import annotations

from dataclasses import replace

import pytest

from emulators.drive.cia402 import BrakeConfig, DriveConfig, SafetyConfig, SwitchesConfig
from fieldbus.canopen import NmtCommand, SdoAbort
from fieldbus.cia402 import DriveState as S
from fieldbus.errors import UnsupportedFaultError

SLOW, QUICK = (0.600, 0.0900), (0.300, 0.0450)
"""Duration (s) and travel (m) of the reference axis from 1800 rpm on 6084h and 6085h."""


def assert_ramp(samples, ramp_of, expected) -> None:
    duration, travel = ramp_of(samples)
    assert duration == pytest.approx(expected[0], abs=0.0005)
    assert travel == pytest.approx(expected[1], rel=0.005)


def assert_torque_limit_stop(samples, bench) -> None:
    """The axis stands after the time that 6 Nm need, within the tail of the velocity loop."""
    stop = next(time for time, _, velocity in samples if abs(velocity) < 0.003) - samples[0][0]
    assert 0.010 < stop < 0.03


@pytest.mark.requirement("C402-054", "C402-055", "C402-058", "STP-010", "STP-544")
@pytest.mark.parametrize(
    ("option", "expected"),
    [(1, SLOW), (2, QUICK), (3, None), (4, None), (5, SLOW), (6, QUICK), (7, None), (8, None)],
)
def test_quick_stop_ramps(bench, ramp_of, option, expected):
    """605Ah 1..8: the load stops on 6084h, 6085h or the torque limit, then leaves Quick stop active or
    stays.
    """
    bench.write(0x605A, option)
    bench.spin()
    samples = bench.observe()
    bench.control(0x02, 0.001)
    assert bench.state is S.QUICK_STOP_ACTIVE
    assert bench.status & 0x6F == 0x07
    bench.run(0.8)
    if expected:
        assert_ramp(samples, ramp_of, expected)
    else:
        assert_torque_limit_stop(samples, bench)
    if option <= 4:
        assert bench.state is S.SWITCH_ON_DISABLED
        assert not bench.drive.core.enabled
    else:
        assert bench.state is S.QUICK_STOP_ACTIVE
        assert bench.drive.core.enabled
        bench.control(0x0F, 0.5)
        assert bench.state is S.OPERATION_ENABLED
        assert bench.drive.core.speed_rpm == pytest.approx(1800, rel=1e-3)


@pytest.mark.requirement("C402-053")
def test_quick_stop_option_zero_coasts(bench):
    """605Ah = 0: torque off in the same step, Switch on disabled at once, the axis coasts."""
    bench.write(0x605A, 0)
    bench.spin()
    bench.write(0x6040, 0x02)
    assert bench.state is S.SWITCH_ON_DISABLED
    assert bench.drive.core.torque == 0.0
    bench.run(0.1)
    assert bench.drive.core.speed_rpm > 1500


@pytest.mark.requirement("C402-009", "C402-059", "C402-060", "STP-543", "STP-011")
def test_shutdown_ramp(make_bench, ramp_of):
    """605Bh = 1: ramp 6084h in Operation enabled, Ready to switch on at standstill; 0: coasting Ready."""
    bench = make_bench()
    bench.spin()
    samples = bench.observe()
    bench.control(0x06, 0.1)
    assert bench.state is S.OPERATION_ENABLED
    bench.run(0.7)
    assert_ramp(samples, ramp_of, SLOW)
    assert bench.state is S.READY_TO_SWITCH_ON
    bench = make_bench()
    bench.write(0x605B, 0)
    bench.spin()
    bench.control(0x06, 0.001)
    assert bench.state is S.READY_TO_SWITCH_ON
    bench.run(0.1)
    assert bench.drive.core.speed_rpm > 1500


@pytest.mark.requirement("C402-006", "C402-061", "C402-062", "C402-023")
def test_disable_operation_ramp(make_bench, ramp_of):
    """605Ch = 1: ramp 6084h, Switched on at standstill; 0: coasting Switched on."""
    bench = make_bench()
    bench.spin(-1800)
    samples = bench.observe()
    bench.control(0x07, 0.8)
    assert_ramp(samples, ramp_of, (SLOW[0], -SLOW[1]))
    assert bench.state is S.SWITCHED_ON
    bench = make_bench()
    bench.write(0x605C, 0)
    bench.spin()
    bench.control(0x07, 0.001)
    assert bench.state is S.SWITCHED_ON
    assert not bench.drive.core.enabled


def test_shutdown_ramp_taken_back(bench):
    """Enable operation in the middle of the ramp continues with the setpoint."""
    bench.spin()
    bench.control(0x06, 0.2)
    assert bench.drive.core.speed_rpm < 1300
    bench.control(0x0F, 0.5)
    assert bench.state is S.OPERATION_ENABLED
    assert bench.drive.core.speed_rpm == pytest.approx(1800, rel=1e-3)


@pytest.mark.requirement("C402-010", "STP-545")
def test_disable_voltage_coasts(bench):
    """Disable voltage: torque zero and Switch on disabled at once."""
    bench.spin()
    bench.write(0x6040, 0x00)
    assert (bench.state, bench.drive.core.torque) == (S.SWITCH_ON_DISABLED, 0.0)
    mechanics = bench.drive.mechanics
    speed = mechanics.velocity
    bench.run(0.1)
    assert 0.8 * speed < mechanics.velocity < speed


@pytest.mark.requirement("C402-063", "C402-064", "C402-065", "C402-066", "C402-036", "C402-076")
@pytest.mark.parametrize(("option", "expected"), [(1, SLOW), (2, QUICK), (3, None), (4, None)])
def test_halt(bench, ramp_of, option, expected):
    """605Dh: bit 8 stops on the chosen ramp, the drive stays enabled; bit 10 at standstill; release goes
    on.
    """
    bench.write(0x605D, option)
    bench.spin()
    samples = bench.observe()
    bench.control(0x010F, 0.005)
    assert not bench.status & 0x400
    bench.run(0.8)
    if expected:
        assert_ramp(samples, ramp_of, expected)
    else:
        assert_torque_limit_stop(samples, bench)
    assert bench.state is S.OPERATION_ENABLED
    assert bench.status & 0x400
    bench.control(0x0F, 0.5)
    assert bench.drive.core.speed_rpm == pytest.approx(1800, rel=1e-3)


def test_halt_before_enabling(bench):
    """A drive that is enabled with bit 8 = 1 stands still until bit 8 goes."""
    bench.set_mode(3)
    bench.write(0x60FF, 500_000)
    for word in (0x06, 0x07, 0x10F):
        bench.control(word, 0.05)
    assert bench.state is S.OPERATION_ENABLED
    assert bench.drive.mechanics.velocity == 0.0
    bench.control(0x0F, 0.5)
    assert bench.drive.core.speed_rpm == pytest.approx(500, rel=1e-3)


@pytest.mark.requirement("C402-014", "C402-015", "C402-067", "C402-068", "C402-069", "C402-070", "C402-071")
@pytest.mark.parametrize(("option", "expected"), [(0, "coast"), (1, SLOW), (2, QUICK), (3, None), (4, None)])
def test_fault_reaction(bench, ramp_of, option, expected):
    """605Eh: a fault in motion stops as chosen in Fault reaction active, then Fault; EMCY, 603Fh and 1001h
    tell it.
    """
    bench.write(0x605E, option)
    bench.spin()
    samples = bench.observe()
    bench.drive.raise_fault(0x4310)
    if expected == "coast":
        assert (bench.state, bench.drive.core.torque) == (S.FAULT, 0.0)
    else:
        assert bench.state is S.FAULT_REACTION_ACTIVE
        bench.run(0.8)
        if expected:
            assert_ramp(samples, ramp_of, expected)
        else:
            assert_torque_limit_stop(samples, bench)
    bench.run(0.01)
    assert bench.state is S.FAULT
    assert bench.status & 0x4F == 0x08
    assert bench.emcys == [(0x4310, 0x09)]
    assert (bench.read(0x603F), bench.read(0x1001), bench.read(0x1003, 1) & 0xFFFF) == (0x4310, 0x09, 0x4310)


@pytest.mark.requirement("C402-016", "C402-028", "C301-109", "STP-546")
def test_fault_reset(bench):
    """Bit 7 edge resets when the cause is gone: EMCY 0000h, 603Fh and 1001h clear; not before."""
    bench.to_state(S.OPERATION_ENABLED)
    bench.drive.raise_fault(0x7120, persistent=True)
    bench.run(0.05)
    bench.control(0x80)
    assert bench.state is S.FAULT
    bench.drive.clear_fault_cause()
    bench.run(0.01)
    assert bench.state is S.FAULT
    bench.control(0x00)
    bench.control(0x80)
    assert bench.state is S.SWITCH_ON_DISABLED
    assert bench.emcys == [(0x7120, 0x21), (0, 0)]
    assert (bench.read(0x603F), bench.read(0x1001)) == (0, 0)
    bench.enable(3)


def test_two_faults(bench):
    """A second fault sends its own EMCY; the reset ends both with one EMCY 0000h each."""
    bench.drive.raise_fault(0x4310)
    bench.drive.raise_fault(0x2310)
    bench.run(0.01)
    assert (bench.read(0x603F), bench.read(0x1003)) == (0x2310, 2)
    bench.control(0x80)
    assert bench.emcys == [(0x4310, 0x09), (0x2310, 0x0B), (0, 0x03), (0, 0)]
    assert bench.state is S.SWITCH_ON_DISABLED


def test_a_fault_of_the_power_stage_coasts(bench):
    """A short circuit leaves no torque to brake with, whatever 605Eh says."""
    bench.spin()
    bench.drive.raise_fault(0x2320)
    assert (bench.state, bench.drive.core.torque) == (S.FAULT, 0.0)


@pytest.mark.requirement("C402-030")
def test_safe_torque_off(bench):
    """STO: coasting, Switch on disabled without fault, warning bit; transition 2 refused until release."""
    bench.spin()
    bench.drive.set_sto(True)
    assert (bench.state, bench.drive.core.torque) == (S.SWITCH_ON_DISABLED, 0.0)
    assert bench.status & 0x90 == 0x90
    bench.control(0x06)
    assert bench.state is S.SWITCH_ON_DISABLED
    assert bench.emcys == []
    bench.drive.set_sto(False)
    bench.run(0.002)
    assert bench.state is S.READY_TO_SWITCH_ON
    assert not bench.status & 0x80


@pytest.mark.requirement("C402-030")
def test_safe_torque_off_as_fault(make_bench):
    """The other configuration: STO in operation is fault FF80h, which needs STO gone and a reset."""
    bench = make_bench(DriveConfig(safety=SafetyConfig(sto="fault")))
    bench.enable(3)
    bench.drive.set_sto(True)
    bench.run(0.002)
    assert (bench.state, bench.emcys) == (S.FAULT, [(0xFF80, 0x81)])
    bench.control(0x80)
    assert bench.state is S.FAULT
    bench.drive.set_sto(False)
    bench.control(0x00)
    bench.control(0x80)
    assert bench.state is S.SWITCH_ON_DISABLED


@pytest.mark.requirement("C402-029", "C402-040")
def test_loss_of_the_dc_link(make_bench):
    """DC link lost: fault 3220h from Operation enabled, Switch on disabled without fault from Switched on;
    bit 4.
    """
    bench = make_bench()
    bench.to_state(S.SWITCHED_ON)
    assert bench.status & 0x10
    bench.drive.set_dc_link_voltage(100.0)
    assert (bench.state, bench.emcys) == (S.SWITCH_ON_DISABLED, [])
    assert not bench.status & 0x10
    assert bench.read(0x6079) == 100_000
    bench.control(0x06)
    bench.control(0x07)
    assert bench.state is S.READY_TO_SWITCH_ON
    bench.drive.restore_dc_link()
    bench.run(0.002)
    assert bench.state is S.SWITCHED_ON
    bench = make_bench()
    bench.spin()
    bench.drive.set_dc_link_voltage(100.0)
    bench.run(0.002)
    assert (bench.state, bench.emcys) == (S.FAULT, [(0x3220, 0x05)])
    bench.control(0x80)
    assert bench.state is S.FAULT
    bench.drive.restore_dc_link()
    bench.control(0x00)
    bench.control(0x80)
    assert bench.state is S.SWITCH_ON_DISABLED


def test_overvoltage_is_a_fault_in_any_state(bench):
    """Too much DC link voltage is fault 3210h, also while the motor is off."""
    bench.drive.set_dc_link_voltage(850.0)
    bench.run(0.002)
    assert (bench.state, bench.emcys) == (S.FAULT, [(0x3210, 0x05)])


@pytest.mark.requirement("C402-043", "C402-311")
def test_local_control(bench):
    """Local control: bit 9 = 0, control words are ignored; back in remote control the word counts again."""
    bench.drive.set_local_control(True)
    assert not bench.status & 0x200
    bench.control(0x06)
    assert bench.state is S.SWITCH_ON_DISABLED
    bench.drive.set_local_control(False)
    assert bench.status & 0x200
    assert bench.state is S.READY_TO_SWITCH_ON


@pytest.mark.requirement("C402-020")
def test_enable_operation_from_ready_shows_switched_on(bench):
    """000Fh in Ready: the status word shows Switched on before Operation enabled."""
    words = []
    bench.master.subscribe(0x181, lambda data, _time: words.append(int.from_bytes(data[:2], "little") & 0x6F))
    bench.master.nmt(NmtCommand.START, 1)
    bench.run(0.01)
    bench.control(0x06)
    bench.control(0x0F, 0.02)
    assert words == [0x40, 0x21, 0x23, 0x27]
    assert bench.transitions() == [1, 2, 3, 4]


@pytest.mark.requirement("C402-173")
def test_power_on_delay_and_brake_opening(make_bench):
    """Transition 3 takes the power-on delay; while the brake opens bit 2 is 1 and the axis waits."""
    config = DriveConfig(
        power_on_delay_ms=50.0, brake=BrakeConfig(torque_nm=4.0, opening_time_ms=100.0, closing_time_ms=30.0)
    )
    bench = make_bench(config)
    bench.set_mode(3)
    bench.write(0x60FF, 600)
    bench.control(0x06)
    bench.control(0x07, 0.045)
    assert bench.state is S.READY_TO_SWITCH_ON
    bench.run(0.01)
    assert bench.state is S.SWITCHED_ON
    bench.control(0x0F, 0.095)
    assert bench.state is S.OPERATION_ENABLED
    assert bench.drive.core.brake.closed
    assert bench.drive.mechanics.velocity == 0.0
    bench.run(0.3)
    assert bench.drive.core.speed_rpm == pytest.approx(600, rel=1e-3)


def test_the_motor_holds_until_the_brake_has_closed(make_bench):
    """After a ramp the pulses stay on for the closing time, so that a hanging load does not drop."""
    machine = DriveConfig.reference()
    config = replace(
        machine,
        mechanics=replace(machine.mechanics, gravity_n=-400.0),
        brake=BrakeConfig(torque_nm=4.0, opening_time_ms=20.0, closing_time_ms=50.0),
    )
    bench = make_bench(config)
    bench.spin(600)
    bench.control(0x06, 0.2 + 0.02)
    assert bench.state is S.OPERATION_ENABLED
    bench.until(lambda: bench.state is S.READY_TO_SWITCH_ON, 1.0)
    position = bench.drive.mechanics.position
    bench.run(0.5)
    assert bench.drive.core.brake.closed
    assert bench.drive.mechanics.position == pytest.approx(position, abs=1e-6)


@pytest.mark.requirement("STP-579")
def test_the_brake_closes_at_speed_when_the_torque_goes(make_bench):
    """Coasting with a brake: it closes at speed and stops the axis, unless it is held open by 60FEh."""
    config = DriveConfig(brake=BrakeConfig(torque_nm=4.0, closing_time_ms=10.0))
    bench = make_bench(config)
    bench.write(0x60FF, 1800)
    bench.enable(3)
    bench.run(0.5)
    bench.control(0x00, 0.1)
    assert bench.drive.mechanics.velocity == 0.0
    bench = make_bench(config)
    bench.write(0x60FE, 1, 2)
    bench.write(0x60FF, 1800)
    bench.enable(3)
    bench.run(0.5)
    bench.control(0x00, 0.1)
    assert bench.drive.mechanics.velocity > 0.2


@pytest.mark.requirement("C402-031")
def test_the_state_machine_works_in_pre_operational(bench):
    """Control by SDO in NMT Pre-operational leads to Operation enabled."""
    assert bench.drive.slave.nmt_state.name == "PRE_OPERATIONAL"
    bench.enable(3)


@pytest.mark.requirement("C402-073")
@pytest.mark.parametrize(
    ("index", "allowed"),
    [
        (0x6007, range(4)),
        (0x605A, range(9)),
        (0x605B, range(2)),
        (0x605C, range(2)),
        (0x605D, range(1, 5)),
        (0x605E, range(5)),
    ],
)
def test_reserved_option_codes_are_refused(bench, index, allowed):
    """Every value outside the list of an option code is 06090030h and leaves the object alone."""
    for value in range(-3, 20):
        if value in allowed:
            bench.write(index, value)
            assert bench.read(index) == value
            continue
        before = bench.read(index)
        with pytest.raises(SdoAbort) as refusal:
            bench.write(index, value)
        assert refusal.value.code == 0x06090030
        assert bench.read(index) == before


@pytest.mark.requirement("C402-075")
def test_zero_decelerations_stand_for_the_maximum(bench, ramp_of):
    """6085h = 0: the quick stop uses 60C6h."""
    bench.write(0x6085, 0)
    bench.write(0x60C6, 12_000_000)
    bench.spin()
    samples = bench.observe()
    bench.control(0x02, 0.5)
    assert_ramp(samples, ramp_of, (0.150, 0.0225))


@pytest.mark.requirement("C402-168")
def test_inputs_follow_the_switches(make_bench):
    """60FDh bits 0, 1, 2 are the limit switches and the home switch; forced inputs win."""
    bench = make_bench(
        DriveConfig.reference(start_position_mm=-520.0, switches=SwitchesConfig(input_filter_ms=0.0))
    )
    assert bench.read(0x60FD) == 0b100
    bench.drive.mechanics.place(-0.58)
    assert bench.read(0x60FD) == 0b101
    bench.drive.mechanics.place(0.58)
    assert bench.read(0x60FD) == 0b010
    bench.drive.force_input("positive_limit", False)
    bench.drive.force_input("home", True)
    assert bench.read(0x60FD) == 0b100
    bench.drive.force_input("positive_limit", None)
    bench.drive.force_input("home", None)
    bench.drive.invert_input("home", True)
    assert bench.read(0x60FD) == 0b110


@pytest.mark.requirement("C402-161")
@pytest.mark.parametrize("direction", [1, -1])
def test_limit_switch_stops_the_axis(make_bench, direction):
    """Motion into a limit switch: stop with 6085h, bit 11, stays enabled; further in is refused, out is
    allowed.
    """
    bench = make_bench(
        DriveConfig.reference(
            start_position_mm=400.0 * direction, switches=SwitchesConfig(input_filter_ms=0.0)
        )
    )
    bench.spin(1200 * direction)
    bench.until(lambda: bench.read(0x60FD) & 3, 2.0)
    edge = bench.drive.mechanics.position
    assert abs(edge) == pytest.approx(0.55, abs=1e-3)
    bench.run(0.5)
    assert bench.drive.mechanics.velocity == pytest.approx(0.0, abs=1e-5)
    expected = 0.2**2 / 2.0 / 1.0
    assert abs(bench.drive.mechanics.position - edge) == pytest.approx(expected, rel=0.02)
    assert bench.state is S.OPERATION_ENABLED
    assert bench.status & 0x800
    bench.write(0x60FF, -300_000 * direction)
    bench.run(1.0)
    assert bench.read(0x60FD) & 3 == 0
    assert not bench.status & 0x800
    assert bench.drive.core.speed_rpm == pytest.approx(-300 * direction, rel=1e-3)


def test_limit_switch_as_fault_or_left_to_the_controller(make_bench):
    """The other reactions: fault 8612h, or nothing at all."""
    reference = DriveConfig.reference(start_position_mm=450.0)
    bench = make_bench(replace(reference, limit_switch_reaction="fault"))
    bench.spin(600)
    bench.until(lambda: bench.state is S.FAULT, 3.0)
    assert bench.emcys == [(0x8612, 0x21)]
    bench = make_bench(replace(reference, limit_switch_reaction="none"))
    bench.spin(600)
    bench.until(lambda: bench.read(0x60FD) & 2, 3.0)
    bench.run(0.1)
    assert bench.drive.core.speed_rpm == pytest.approx(600, rel=1e-2)
    assert not bench.status & 0x800


def test_a_switch_that_is_not_fitted_cannot_be_forced(make_bench):
    """Forcing an input without switch is refused with a reason."""
    bench = make_bench(DriveConfig.reference(switches=SwitchesConfig(home_mm=None)))
    with pytest.raises(UnsupportedFaultError, match=r"'home'.*negative_limit, positive_limit"):
        bench.drive.force_input("home", True)


@pytest.mark.requirement("C402-311")
def test_injected_lies(bench):
    """Frozen status word, refused transition, stopped heartbeat."""
    heartbeats = []
    bench.master.subscribe(0x701, lambda data, _time: heartbeats.append(data[0]))
    bench.write(0x1017, 10)
    bench.run(0.1)
    assert len(heartbeats) >= 9
    bench.drive.stop_heartbeat(True)
    bench.run(0.001)
    count = len(heartbeats)
    bench.run(0.1)
    assert len(heartbeats) == count
    bench.drive.refuse_transitions(2)
    bench.control(0x06)
    assert bench.state is S.SWITCH_ON_DISABLED
    bench.drive.refuse_transitions()
    before = bench.status
    bench.drive.freeze_statusword(True)
    bench.control(0x06)
    assert (bench.state, bench.status) == (S.READY_TO_SWITCH_ON, before)
    bench.drive.freeze_statusword(False)
    assert bench.status & 0x6F == 0x21


def test_home_switch_can_be_configured(make_bench):
    """The reference axis takes any home switch, or none."""
    bench = make_bench(DriveConfig.reference(switches=SwitchesConfig(home_from_mm=-10.0, home_to_mm=10.0)))
    assert bench.read(0x60FD) == 0b100
    assert (
        "home" not in make_bench(DriveConfig.reference(switches=SwitchesConfig(home_mm=None))).drive.switches
    )
