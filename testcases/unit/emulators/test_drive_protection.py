"""Heat, supply, brake and safety inputs of the emulated drive."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from emulators.drive import DcLink, SupplyConfig, ThermalConfig, ThermalModel, ThermalNode
from emulators.drive.cia402 import (
    BrakeConfig,
    DriveConfig,
    DriveWarning,
    LinearAxisConfig,
    RotaryAxisConfig,
    SafetyConfig,
)
from fieldbus.cia402 import DriveState as S
from fieldbus.errors import ConfigurationError

REFERENCE = DriveConfig.reference()


def with_parts(**parts):
    return replace(REFERENCE, **parts)


# -- DC link alone -------------------------------------------------------------------------------------


def test_braking_energy_raises_the_voltage_as_the_capacitor_says():
    """20 J into 500 uF at 560 V give sqrt(V^2 + 2 E / C), whatever the step; the rectifier lets nothing
    out.
    """
    for steps in (1, 100):
        link = DcLink(SupplyConfig(standby_w=0.0))
        for _ in range(steps):
            link.update(-1000.0, 0.02 / steps)
        assert link.voltage_V == pytest.approx(math.sqrt(560.0**2 + 2 * 20.0 / 500e-6), rel=1e-9)


def test_discharge_without_mains_takes_the_time_of_the_energy_balance():
    """Without mains the drive's own 15 W bring 560 V down to 400 V within C (560^2 - 400^2) / (2 P)."""
    link = DcLink()
    link.mains_on = False
    time_s = 0.0
    while not link.low:
        link.update(0.0, 0.001)
        time_s += 0.001
    assert time_s == pytest.approx(500e-6 * (560.0**2 - 400.0**2) / 30.0, abs=0.002)
    link.mains_on = True
    for _ in range(100):
        link.update(0.0, 0.001)
    assert link.voltage_V == 560.0
    assert link.settled


def test_load_lets_the_rectified_voltage_sag():
    """Under load the DC link stays below its nominal voltage, with one phase missing twice as far."""
    sag = []
    for missing in (False, True):
        link = DcLink()
        link.phase_missing = missing
        for _ in range(200):
            link.update(560.0, 0.001)
        sag.append(560.0 - link.voltage_V)
    assert sag == pytest.approx([10.0, 20.0], rel=1e-3)


def test_the_chopper_burns_what_the_motor_returns():
    """The chopper keeps the voltage between its thresholds; its mean power is that of the braking motor."""
    link = DcLink(SupplyConfig(chopper_rated_w=1e6))
    burnt = 0.0
    for _ in range(2000):
        link.update(-2000.0, 0.001)
        assert link.voltage_V < 730.0
        burnt += link.chopper_power_W * 0.001
    stored = 0.5 * 500e-6 * (link.voltage_V**2 - 560.0**2)
    assert burnt + stored == pytest.approx((2000.0 - 15.0) * 2.0, rel=1e-6)


def test_an_overloaded_or_broken_chopper_lets_the_voltage_rise():
    """A resistor that is too hot is switched off until it has cooled; then the voltage rises without
    bound.
    """
    link = DcLink(SupplyConfig(chopper_rated_w=50.0, chopper_time_constant_s=5.0))
    while not link.chopper_overloaded:
        link.update(-2000.0, 0.001)
        assert not link.high
    while not link.high:
        link.update(-2000.0, 0.001)
    while link.chopper_overloaded:
        link.update(0.0, 0.1)
    assert link.chopper_load < 0.8
    broken = DcLink()
    broken.chopper_failed = True
    while not broken.high:
        broken.update(-2000.0, 0.001)


@pytest.mark.parametrize(
    "values",
    [
        {"nominal_v": 300.0},
        {"capacitance_uf": 0.0},
        {"chopper_off_v": 730.0},
        {"chopper_on_v": 900.0},
        {"standby_w": -1.0},
    ],
)
def test_impossible_supplies_are_refused(values):
    """Voltages have to be in order, the rest positive."""
    with pytest.raises(ConfigurationError):
        SupplyConfig(**values)


# -- heat alone ----------------------------------------------------------------------------------------


def test_temperature_is_of_first_order():
    """At rated load the part ends at ambient + rise; after one time constant it has done 63 % of it, whatever
    the step.
    """
    for steps in (1, 60):
        node = ThermalNode(rise_K=80.0, time_constant_s=60.0, ambient_C=25.0, warning_C=120.0, fault_C=140.0)
        for _ in range(steps):
            node.advance(1.0, 60.0 / steps)
        assert node.temperature_C == pytest.approx(25.0 + 80.0 * (1.0 - math.exp(-1.0)))
    node.forced_C = 130.0
    assert (node.warm, node.hot) == (True, False)


def test_i2t_of_a_changing_torque_is_that_of_its_square():
    """The mean square counts: half the time 2 Nm is as 1.41 Nm all the time."""
    pulsed, steady = (ThermalModel(rated_torque_Nm=2.0, time_constant_s=1.0) for _ in range(2))
    for _ in range(1000):
        pulsed.update(2.0, 0.001)
        pulsed.update(0.0, 0.001)
        steady.advance(2.0, 0.002)
    assert pulsed.utilisation == pytest.approx(steady.utilisation, rel=1e-3)


# -- in the drive --------------------------------------------------------------------------------------


@pytest.mark.requirement("C402-160", "C402-041")
def test_overload_warns_trips_and_has_to_recover(make_bench):
    """A blocked motor: warning bit 7 with its cause, fault 2310h; no reset before i2t is back at 100 %."""
    bench = make_bench(with_parts(thermal=ThermalConfig(i2t_time_constant_s=2.0)))
    bench.enable(3)
    bench.write(0x60FF, 1_000_000)
    bench.drive.jam(True)
    bench.until(lambda: bench.status & 0x80)
    assert bench.read(0x2100) == bench.read(0x1002) == DriveWarning.MOTOR_OVERLOAD
    assert 997 < bench.read(0x2102, 1) <= 1050
    assert bench.state is S.OPERATION_ENABLED
    assert bench.read(0x603F) == 0, "a warning leaves 603Fh alone"
    bench.until(lambda: bench.state is S.FAULT)
    assert bench.emcys == [(0x2310, 0x03)]
    bench.control(0x80)
    assert bench.state is S.FAULT
    bench.run(1.0)
    bench.control(0x00)
    bench.control(0x80)
    assert bench.state is S.SWITCH_ON_DISABLED
    texts = [event.data["text"] for event in bench.history.select(kind="drive.warning")]
    assert texts == ["motor overload", ""]


@pytest.mark.requirement("C402-160", "C402-045")
def test_overload_can_limit_the_torque_instead(make_bench):
    """`limit`: at 100 % the torque falls to the rated one, bit 11 and the warning show it; below 90 % it is
    free again.
    """
    bench = make_bench(
        with_parts(thermal=ThermalConfig(i2t_time_constant_s=1.0, overload="limit"), blocked_time_ms=0.0)
    )
    bench.enable(3)
    bench.write(0x60FF, 1_000_000)
    bench.drive.jam(True)
    bench.until(lambda: bench.read(0x6077) == 3000, 0.1)
    assert bench.read(0x2102, 4) == 0xFFFF
    bench.run(1.0)
    assert bench.emcys == []
    assert bench.read(0x6077) == 1000
    assert bench.read(0x2102, 4) == 1000
    assert bench.status & 0x880 == 0x880
    assert bench.read(0x2100) & DriveWarning.DERATED
    bench.drive.jam(False)
    bench.run(1.0)
    assert not bench.status & 0x880


@pytest.mark.requirement("C402-160")
def test_the_power_stage_has_an_overload_of_its_own(make_bench):
    """A weak power stage on a strong motor trips with 2350h."""
    bench = make_bench(with_parts(thermal=ThermalConfig(stage_overload=1.0, stage_overload_time_s=1.0)))
    bench.enable(3)
    bench.write(0x60FF, 1_000_000)
    bench.drive.jam(True)
    bench.run(0.5)
    assert bench.emcys == [(0x2350, 0x03)]


@pytest.mark.requirement("C402-302", "C402-041")
@pytest.mark.parametrize(
    ("part", "code", "warm", "hot"), [("motor", 0x4310, 125.0, 141.0), ("stage", 0x4210, 90.0, 96.0)]
)
def test_temperatures(make_bench, part, code, warm, hot):
    """Warm is a warning, hot a fault that stays until the part is below its warning; 2101h shows the
    temperature.
    """
    bench = make_bench()
    bench.spin()
    node = getattr(bench.drive.protection, part)
    sub = 1 if part == "motor" else 2
    assert bench.read(0x2101, sub) == pytest.approx(250, abs=5)
    node.forced_C = warm
    bench.run(0.02)
    assert bench.read(0x2101, sub) == round(warm * 10)
    assert (bench.state, bench.status & 0x80) == (S.OPERATION_ENABLED, 0x80)
    node.forced_C = hot
    bench.run(1.0)
    assert (bench.state, bench.emcys) == (S.FAULT, [(code, 0x09)])
    node.forced_C = warm
    bench.control(0x80)
    assert bench.state is S.FAULT
    node.forced_C = None
    bench.control(0x00)
    bench.control(0x80)
    assert bench.state is S.SWITCH_ON_DISABLED
    bench.run(0.01)
    assert not bench.status & 0x80


@pytest.mark.exhaustive
def test_a_motor_gets_hot_by_work_and_stays_hot_without_supply(make_bench):
    """Rated torque for a long time heats by 80 K; power-off forgets i2t but not the heat."""
    mechanics = RotaryAxisConfig(load_torque=-2.0, coulomb_friction=0.0)
    bench = make_bench(
        DriveConfig(mechanics=mechanics, thermal=ThermalConfig(motor_time_constant_s=2.0, motor_loss_w=0.0))
    )
    bench.enable(3)
    bench.run(10.0)
    assert bench.read(0x2101, 1) == pytest.approx(1050, abs=10)
    bench.drive.power_off()
    bench.run(2.0)
    bench.drive.power_on()
    bench.run(0.002)
    assert bench.read(0x2101, 1) == pytest.approx(250 + 800 * math.exp(-1.0), abs=10)
    assert bench.read(0x2102, 1) == 0


@pytest.mark.requirement("C402-300")
def test_braking_shows_in_the_dc_link(make_bench):
    """A heavy load that is braked fast raises 6079h by its kinetic energy less what friction and windings
    take.
    """
    bench = make_bench(
        with_parts(
            mechanics=replace(REFERENCE.mechanics, coulomb_friction_n=0.0, viscous_friction_n_per_m_s=0.0),
            supply=SupplyConfig(standby_w=0.0),
            thermal=ThermalConfig(motor_loss_w=0.0),
        )
    )
    bench.write(0x6085, 60_000_000)
    bench.spin()
    energy = 0.5 * bench.drive.mechanics.motor_inertia * bench.drive.core.velocity**2
    bench.control(0x02, 0.1)
    assert bench.drive.core.standing
    assert bench.read(0x6079) == pytest.approx(1000.0 * math.sqrt(560.0**2 + 2 * energy / 500e-6), rel=5e-3)


@pytest.mark.requirement("C402-300", "C402-305")
@pytest.mark.parametrize(("failed", "first"), [(True, 0x3210), (False, 0x7112)])
def test_braking_against_a_chopper_that_gives_up(make_bench, failed, first):
    """A driving load: without chopper 3210h; a resistor that gets too hot is 7112h, and then the voltage
    rises as well.
    """
    bench = make_bench(
        DriveConfig(
            mechanics=RotaryAxisConfig(load_torque=5.0, coulomb_friction=0.0),
            rated_torque_nm=5.0,
            supply=SupplyConfig(chopper_rated_w=20.0),
            thermal=ThermalConfig(motor_loss_w=0.0),
            objects={(0x6083, 0): 60000, (0x605E, 0): 1, (0x6084, 0): 600},
        )
    )
    bench.drive.disable_chopper(failed)
    bench.enable(3)
    bench.write(0x60FF, 2000)
    bench.until(lambda: bench.emcys, 20.0)
    assert bench.emcys[0][0] == first
    assert bench.read(0x6079) >= (700_000 if first == 0x7112 else 780_000)
    bench.until(lambda: 0x3210 in dict(bench.emcys), 5.0)
    assert bench.state is S.FAULT


@pytest.mark.requirement("C402-029", "C402-040", "C402-299")
def test_mains_lost_and_back(make_bench):
    """Mains lost: warning at once, the DC link lives on its charge, then 3220h in operation; bit 4 follows
    the voltage.
    """
    bench = make_bench()
    bench.enable(3)
    bench.drive.disconnect_mains(True)
    bench.run(0.01)
    assert bench.read(0x2100) == DriveWarning.MAINS_MISSING
    assert bench.read(0x2103, 1) == 1
    assert bench.status & 0x90 == 0x90
    bench.until(lambda: bench.state is S.FAULT, 4.0)
    bench.run(0.01)
    assert bench.emcys == [(0x3220, 0x05)]
    assert not bench.status & 0x10
    assert bench.read(0x6079) < 400_000
    bench.control(0x80)
    assert bench.state is S.FAULT, "the DC link is still empty"
    bench.drive.disconnect_mains(False)
    bench.run(0.1)
    assert bench.status & 0x10
    bench.control(0x00)
    bench.control(0x80)
    assert bench.state is S.SWITCH_ON_DISABLED
    assert bench.read(0x2100) == 0


@pytest.mark.requirement("C402-029", "C402-004")
def test_mains_lost_out_of_operation(make_bench):
    """Without DC link: Switched on falls to Switch on disabled without fault, and transition 3 waits for the
    voltage.
    """
    bench = make_bench()
    bench.to_state(S.SWITCHED_ON)
    bench.drive.disconnect_mains(True)
    bench.run(4.0)
    assert (bench.state, bench.emcys) == (S.SWITCH_ON_DISABLED, [])
    bench.control(0x06)
    bench.control(0x07)
    assert bench.state is S.READY_TO_SWITCH_ON
    bench.drive.disconnect_mains(False)
    bench.run(0.1)
    assert bench.state is S.SWITCHED_ON


@pytest.mark.requirement("C402-299")
def test_a_missing_phase(make_bench):
    """A missing phase is a warning, and 3130h after its time in operation; while it is missing there is no
    reset.
    """
    bench = make_bench()
    bench.to_state(S.READY_TO_SWITCH_ON)
    bench.drive.disconnect_phase(True)
    bench.run(2.0)
    assert (bench.emcys, bench.read(0x2100)) == ([], DriveWarning.PHASE_MISSING)
    bench.control(0x07)
    bench.control(0x0F)
    bench.run(0.45)
    assert bench.state is S.OPERATION_ENABLED
    bench.run(0.1)
    assert bench.emcys == [(0x3130, 0x05)]
    bench.control(0x80)
    assert bench.state is S.FAULT
    bench.drive.disconnect_phase(False)
    bench.control(0x00)
    bench.control(0x80)
    assert bench.state is S.SWITCH_ON_DISABLED


# -- safety --------------------------------------------------------------------------------------------


@pytest.mark.requirement("C402-030")
def test_safe_stop_1_brakes_and_then_takes_the_torque(make_bench):
    """SS1: quick stop, torque off at standstill, no enabling while the input is there, no fault."""
    bench = make_bench(with_parts(safety=SafetyConfig(ss1_time_ms=400.0)))
    bench.spin()
    bench.drive.set_ss1(True)
    bench.run(0.05)
    assert bench.state is S.QUICK_STOP_ACTIVE
    assert bench.drive.core.speed_rpm == pytest.approx(1800.0 - 300.0, abs=10.0)
    assert bench.read(0x2108) == 0b1100
    assert bench.read(0x2100) == DriveWarning.SAFE_STOP
    bench.run(0.26)
    assert (bench.state, bench.drive.sto_active) == (S.SWITCH_ON_DISABLED, True)
    assert bench.emcys == []
    bench.control(0x06)
    assert bench.state is S.SWITCH_ON_DISABLED
    bench.drive.set_ss1(False)
    bench.run(0.002)
    assert (bench.state, bench.read(0x2108)) == (S.READY_TO_SWITCH_ON, 0)


@pytest.mark.requirement("C402-030")
def test_the_ramp_of_safe_stop_1_is_monitored(make_bench):
    """A quick stop that is slower than safe stop 1 allows: torque off and FF81h, which needs the input
    released.
    """
    bench = make_bench(with_parts(safety=SafetyConfig(ss1_time_ms=200.0)))
    bench.spin()
    bench.write(0x6085, 500_000)
    bench.drive.set_ss1(True)
    bench.run(0.1)
    assert (bench.state, bench.emcys) == (S.FAULT, [(0xFF81, 0x81)])
    assert (bench.drive.core.torque, bench.drive.sto_active) == (0.0, True)
    bench.control(0x80)
    assert bench.state is S.FAULT
    bench.drive.set_ss1(False)
    bench.control(0x00)
    bench.control(0x80)
    assert bench.state is S.SWITCH_ON_DISABLED


@pytest.mark.requirement("C402-030")
def test_safe_stop_1_by_time_only(make_bench):
    """Not monitored: the torque goes when the time is over, standstill or not, and that is no fault."""
    bench = make_bench(with_parts(safety=SafetyConfig(ss1_time_ms=200.0, ss1_monitored=False)))
    bench.spin()
    bench.write(0x6085, 500_000)
    bench.drive.set_ss1(True)
    bench.run(0.19)
    assert bench.state is S.QUICK_STOP_ACTIVE
    bench.run(0.02)
    assert (bench.state, bench.drive.sto_active, bench.emcys) == (S.SWITCH_ON_DISABLED, True, [])


@pytest.mark.requirement("C402-017", "C402-030")
def test_safe_stop_1_cannot_be_left_by_transition_16(make_bench):
    """In a quick stop that stays enabled, 000Fh does not lead back to operation while safe stop 1 is
    demanded.
    """
    bench = make_bench(with_parts(safety=SafetyConfig(ss1_time_ms=500.0, ss1_monitored=False)))
    bench.spin()
    bench.write(0x605A, 6)
    bench.drive.set_ss1(True)
    bench.run(0.4)
    assert bench.drive.core.standing
    bench.control(0x0F)
    assert (bench.state, bench.drive.core.enabled) == (S.QUICK_STOP_ACTIVE, True)
    bench.run(0.2)
    assert (bench.state, bench.drive.sto_active) == (S.SWITCH_ON_DISABLED, True)


def test_safe_stop_1_without_torque_is_safe_torque_off(make_bench):
    """Where there is nothing to brake safe torque off follows at once."""
    bench = make_bench()
    bench.to_state(S.SWITCHED_ON)
    bench.drive.set_ss1(True)
    assert (bench.state, bench.drive.sto_active) == (S.SWITCH_ON_DISABLED, True)


@pytest.mark.requirement("C402-168")
@pytest.mark.parametrize(
    ("reaction", "state", "emcys"),
    [
        ("inhibit", S.SWITCH_ON_DISABLED, []),
        ("quick_stop", S.QUICK_STOP_ACTIVE, []),
        ("fault", S.FAULT_REACTION_ACTIVE, [(0x9000, 0x01)]),
    ],
)
def test_interlock(make_bench, reaction, state, emcys):
    """60FDh bit 3 is 1 while the interlock is closed; open it acts as configured and keeps the drive from
    being enabled.
    """
    bench = make_bench(with_parts(safety=SafetyConfig(interlock=reaction)))
    assert bench.read(0x60FD) & 8
    bench.spin()
    bench.drive.open_interlock(True)
    bench.run(0.002)
    assert bench.state is state
    assert bench.emcys == emcys
    assert not bench.read(0x60FD) & 8
    bench.run(1.0)
    bench.control(0x80)
    bench.control(0x06)
    assert bench.state is (S.FAULT if reaction == "fault" else S.SWITCH_ON_DISABLED)
    bench.drive.open_interlock(False)
    bench.control(0x00)
    bench.control(0x80)
    bench.control(0x06)
    assert bench.state is S.READY_TO_SWITCH_ON


# -- brake ---------------------------------------------------------------------------------------------

HANGING = LinearAxisConfig(gravity_n=-400.0, coulomb_friction_n=0.0)


@pytest.mark.requirement("C402-173")
def test_a_brake_holds_a_hanging_load_through_power_off(make_bench):
    """Gravity pulls with 0.64 Nm at the motor: the closed brake holds it without power, and enabling does not
    drop it.
    """
    bench = make_bench(
        with_parts(
            mechanics=HANGING, brake=BrakeConfig(torque_nm=3.0, opening_time_ms=50.0, closing_time_ms=30.0)
        )
    )
    bench.run(0.5)
    assert bench.drive.mechanics.position == 0.0
    bench.enable(3)
    bench.run(0.5)
    bench.control(0x06)
    bench.run(0.5)
    assert bench.drive.mechanics.position == pytest.approx(0.0, abs=2e-4)
    bench.drive.power_off()
    bench.run(0.5)
    assert bench.drive.mechanics.position == pytest.approx(0.0, abs=2e-3)


@pytest.mark.parametrize(
    ("how", "moves"), [("sound", False), ("stuck open", True), ("slips", True), ("slips a little", False)]
)
def test_a_brake_that_does_not_hold(make_bench, how, moves):
    """Stuck open, or worn so far that its torque is less than that of the load: the load falls when the
    torque goes.
    """
    bench = make_bench(with_parts(mechanics=HANGING, brake=BrakeConfig(torque_nm=3.0)))
    bench.enable(3)
    brake = bench.drive.core.brake
    if how == "stuck open":
        brake.set_stuck(False)
    elif how.startswith("slips"):
        brake.set_torque_share(0.1 if how == "slips" else 0.5)
    bench.control(0x00)
    bench.run(0.3)
    assert (bench.drive.mechanics.position < -0.01) is moves
    column = [name for name, _ in bench.drive.trace_columns].index("brake_closed")
    assert bench.drive.trace_row()[column] == (how != "stuck open")


def test_a_brake_that_does_not_open(make_bench):
    """Stuck closed: the drive believes it open and works against it until following error or overload
    tell.
    """
    bench = make_bench(
        with_parts(brake=BrakeConfig(torque_nm=10.0), thermal=ThermalConfig(i2t_time_constant_s=1.0))
    )
    bench.drive.core.brake.set_stuck(True)
    bench.enable(3)
    bench.write(0x60FF, 1_000_000)
    bench.run(1.0)
    assert bench.drive.mechanics.position == 0.0
    assert bench.emcys == [(0x2310, 0x03)]
