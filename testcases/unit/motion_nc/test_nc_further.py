"""Further rules of NC axes: emergency stop, bounds of the velocity, decoupling, overflow in every reference
system, modulo starts, external steps, symbols.
"""

import pytest

from fieldbus.errors import ConfigurationError
from motion.nc.blocks import JogMode
from motion.nc.device import PortDevice
from motion.nc.encoder import Encoder
from motion.nc.modulo import Direction, modulo_move
from motion.nc.parameters import ParameterSet, catalogue
from motion.nc.process_image import ProcessImage
from motion.nc.symbols import symbol_names
from testcases.unit.motion_nc.nc_rig import Plant, Rig, T

pytestmark = pytest.mark.exhaustive


@pytest.mark.requirement("NC-011", "NC-012")
def test_emergency_stop(subtests):
    """Both reactions, at standstill, slow and fast: a ramp that locks the axis, or no output at once; the log
    says which.
    """
    for velocity in (0.0, 5.0, 1500.0):
        for ramp in (True, False):
            with subtests.test(velocity=velocity, ramp=ramp):
                rig = Rig(axis__fast_deceleration=6000.0, axis__fast_jerk=1e6, axis__position_lag_max=50.0)
                rig.enabled()
                if velocity:
                    rig.until(rig.handle.move_velocity(velocity, Acceleration=9000.0, Jerk=1e6).in_velocity)
                rig.handle.emergency_stop(ramp=ramp)
                rig.cycles()
                events = [one for one in rig.history.events if one.kind == "axis.emergency_stop"]
                assert events[-1].data["reaction"] == ("ramp" if ramp else "zero output")
                if not ramp:
                    assert rig.device.velocity == 0.0
                    assert rig.handle.error_id == 0x4B00
                    continue
                steepest = 0.0
                while not rig.status("NotMoving"):
                    rig.cycles()
                    steepest = max(steepest, -rig.generator.a)
                assert steepest == pytest.approx(6000.0 if velocity > 100.0 else steepest)
                rig.cycles(300)
                assert rig.device.velocity == pytest.approx(0.0, abs=0.2)
                refused = rig.handle.move_velocity(5.0)
                rig.cycles(2)
                assert refused.ErrorID == 0x42EF
                rig.handle.reset()
                rig.cycles(3)
                rig.until(rig.handle.move_velocity(5.0).in_velocity)


@pytest.mark.requirement("NC-030", "NC-100")
def test_two_bounds_of_the_velocity():
    """Maximum Velocity bounds commands, the output limitation the output, each on its own; the ceiling of the
    output is Reference Velocity over Output Ratio, and more is a mistake of the parameters.
    """
    rig = Rig(drv__output_limit_max=0.1, axis__maximum_velocity=1000.0, axis__position_lag_max=1e6).enabled()
    rig.until(rig.handle.move_velocity(1000.0).in_velocity)
    rig.cycles(50)
    assert rig.device.velocity == pytest.approx(220.0)
    refused = rig.handle.move_velocity(1000.1)
    rig.cycles(2)
    assert refused.ErrorID == 0x4359
    rig = Rig(axis__position_lag_max=1e6, ctrl__output_limit=1.0).enabled()
    rig.until(rig.handle.move_velocity(2000.0).in_velocity)
    rig.device.position -= 1000.0
    rig.cycles(3)
    assert rig.device.velocity == pytest.approx(2200.0)
    assert rig.handle.error_id == 0
    with pytest.raises(ConfigurationError, match="Reference Velocity"):
        ParameterSet({"axis.reference_velocity": 1000.0, "axis.maximum_velocity": 1000.1})
    ParameterSet(
        {"axis.reference_velocity": 1000.0, "axis.maximum_velocity": 1250.0, "drv.output_ratio": 0.8}
    )


@pytest.mark.requirement("NC-027")
def test_reaching_of_the_target_is_checked():
    """With target position monitoring a command is done when its target is reached, not before."""
    rig = Rig(ctrl__velocity_precontrol_weight=0.0, ctrl__pos_kv=5.0, axis__position_lag_max=100.0).enabled()
    move = rig.handle.move_absolute(50.0, Velocity=100.0)
    while not move.done():
        rig.cycles()
        inside = abs(rig.axis.position - 50.0) <= 2.0
        arrived = rig.generator.s == 50.0
    assert inside
    assert rig.status("InTargetPosition")
    assert arrived


@pytest.mark.requirement("NC-089")
def test_dynamics_are_magnitudes():
    """Dynamic values are unsigned, as parameters and at blocks; the jerk is the derivative of the
    acceleration.
    """
    for key in ("maximum_acceleration", "default_deceleration", "default_jerk", "fast_jerk"):
        with pytest.raises(ConfigurationError, match=key):
            ParameterSet({f"axis.{key}": -1.0})
    rig = Rig().enabled()
    for name in ("Acceleration", "Deceleration", "Jerk"):
        refused = rig.handle.move_absolute(10.0, Velocity=10.0, **{name: -5.0})
        rig.cycles(2)
        assert refused.ErrorID == 0x4B06
    rig.handle.move_velocity(500.0, Acceleration=1000.0, Jerk=4000.0)
    rig.cycles(2)
    for _ in range(50):
        before = rig.generator.a
        rig.cycles()
        assert (rig.generator.a - before) / T == pytest.approx(4000.0)


@pytest.mark.requirement("NC-095")
def test_decoupling_with_acceleration(subtests):
    """A slave that is decoupled while it accelerates stays within Maximum Velocity and keeps its direction:
    jerk, acceleration or deceleration are raised for it.
    """
    for ratio, master_velocity, braking in ((1.0, 900.0, False), (1.0, 900.0, True), (3.0, 600.0, False)):
        with subtests.test(ratio=ratio, braking=braking):
            master = Rig()
            slave = Rig(with_=master, axis__maximum_velocity=1000.0, axis__position_lag_max=500.0)
            master.enabled()
            slave.enabled()
            slave.handle.gear_in(master.handle, ratio)
            master.cycles(2)
            move = master.handle.move_velocity(
                master_velocity, Acceleration=3000.0, Deceleration=3000.0, Jerk=20_000.0
            )
            if braking:
                master.until(move.in_velocity)
                master.handle.move_velocity(1.0, Deceleration=3000.0, Jerk=20_000.0)
                master.until(lambda slave=slave: slave.axis.motion.v < 100.0)
            else:
                least = 1100.0 if ratio > 1.0 else 850.0
                master.until(lambda slave=slave, least=least: slave.axis.motion.v > least)
            slave.handle.gear_out()
            master.cycles(2)
            at = slave.axis.motion.v
            fastest, slowest = at, at
            for _ in range(600):
                master.cycles()
                fastest, slowest = max(fastest, slave.axis.motion.v), min(slowest, slave.axis.motion.v)
            assert slowest > 0.0 or not braking
            assert slowest >= -1e-9
            assert fastest <= max(1000.0, at) * 1.02
            assert slave.axis.motion.v <= 1000.0 + 1e-6


@pytest.mark.requirement("NC-095")
def test_decoupling_above_the_maximum():
    """A slave that is decoupled above Maximum Velocity is brought below it with the maximum deceleration."""
    master = Rig()
    slave = Rig(
        with_=master, axis__maximum_velocity=500.0, axis__default_jerk=1e6, axis__position_lag_max=500.0
    )
    master.enabled()
    slave.enabled()
    slave.handle.gear_in(master.handle, 3.0)
    master.cycles(2)
    master.until(master.handle.move_velocity(400.0).in_velocity)
    slave.handle.gear_out()
    steepest = 0.0
    for _ in range(100):
        master.cycles()
        steepest = max(steepest, -slave.axis.motion.a)
    assert slave.axis.motion.v == pytest.approx(500.0)
    assert steepest == pytest.approx(15000.0, rel=0.01)


@pytest.mark.requirement("NC-010")
def test_master_and_slave_change_places():
    """A slave becomes the master of its master while both move: neither velocity steps."""
    a = Rig()
    b = Rig(with_=a)
    a.enabled()
    b.enabled()
    b.handle.gear_in(a.handle, 2.0)
    a.until(a.handle.move_velocity(100.0).in_velocity)
    a.cycles(20)
    b.handle.gear_out()
    a.cycles(2)
    gear = a.handle.gear_in(b.handle, 1.0, 2.0)
    places = []
    for _ in range(100):
        a.cycles()
        assert a.axis.motion.v == pytest.approx(100.0)
        assert b.axis.motion.v == pytest.approx(200.0)
        places.append((a.axis.motion.s, b.axis.motion.s))
    assert gear.in_gear()
    assert (a.axis.nc_to_plc.CoupleState, b.axis.nc_to_plc.CoupleState) == (3, 1)
    b.until(b.handle.halt().done)
    a.cycles(2)
    assert a.axis.motion.v == 0.0


@pytest.mark.requirement("NC-204")
def test_old_dead_time_compensation():
    """A value of the old dead-time compensation is a warning and delays nothing."""
    texts = "\n".join(ParameterSet({"axis.dead_time_compensation": 0.01}).warnings())
    assert "axis.dead_time_compensation" in texts
    assert "dead_time" not in "\n".join(ParameterSet().warnings())
    paths = []
    for value in (0.0, 0.01):
        rig = Rig(axis__dead_time_compensation=value).enabled()
        rig.handle.move_velocity(100.0)
        paths.append([rig.cycles() or rig.device.velocity for _ in range(50)])
    assert paths[0] == paths[1]


@pytest.mark.requirement("NC-231")
def test_gain_and_reference_velocity_online():
    """In velocity mode Kv and Reference Velocity act as soon as they are written."""
    rig = Rig(ctrl__pos_kv=10.0, drv__type="KL4XXX", axis__position_lag_max=50.0).enabled()
    rig.device.frozen = True
    rig.device.position = -2.0
    rig.device.frozen = False
    rig.cycles()
    assert rig.axis.drive.control == pytest.approx(10.0 * rig.axis.following_error)
    rig.handle.write_parameter("ctrl.pos_kv", 30.0)
    rig.cycles()
    assert rig.axis.drive.control == pytest.approx(30.0 * rig.axis.following_error)
    rig.until(rig.handle.move_velocity(110.0).in_velocity)
    rig.cycles(300)
    assert rig.axis.drive.output == pytest.approx(0.05, rel=0.01)
    rig.handle.write_parameter("axis.reference_velocity", 4400.0)
    rig.cycles()
    assert rig.axis.drive.output == pytest.approx(0.025, rel=0.01)


# -- encoder


def _encoder(**values):
    return Encoder(
        ParameterSet({key.replace("__", "."): value for key, value in values.items()}),
        cycle_s=T,
        io_cycle_s=T,
    )


@pytest.mark.requirement("NC-246")
def test_derived_values():
    """Velocity and acceleration are derived from the position; other quantities use the same scaling."""
    encoder = _encoder(
        enc__encoder_mask=0xFFFF,
        enc__scaling_numerator=0.5,
        enc__encoder_mode="POSVELOACC",
        enc__filter_time_velocity=0.0,
        enc__filter_time_acceleration=0.0,
    )
    encoder.update(100)
    encoder.update(104)
    assert (encoder.position, encoder.velocity) == (52.0, pytest.approx(2.0 / T))
    encoder.update(112)
    assert encoder.acceleration == pytest.approx((4.0 - 2.0) / T / T)


@pytest.mark.requirement("NC-259", "NC-261", "NC-777")
def test_overflow_in_every_reference_system(subtests):
    """Incremental systems and the modulo one count overflows, ABSOLUTE has a run-time error, the ranges allow
    a single one; the mask need not be that of the encoder.
    """
    choices = catalogue()["enc.reference_system"].choices
    assert len(choices) == 6
    allowed = {
        "INCREMENTAL": 9,
        "INCREMENTAL (singleturn absolute)": 9,
        "ABSOLUTE": 0,
        "ABSOLUTE MULTITURN RANGE (with single overflow)": 1,
        "ABSOLUTE SINGLETURN RANGE (with single overflow)": 1,
        "ABSOLUTE (modulo)": 9,
    }
    assert set(choices) == set(allowed)
    for system, most in allowed.items():
        for sign, code in ((1, 0x4451), (-1, 0x4450)):
            with subtests.test(system, sign=sign):
                encoder = _encoder(
                    enc__reference_system=system,
                    enc__encoder_mask=999,
                    enc__encoder_sub_mask=999,
                    enc__scaling_numerator=0.1,
                    axis__soft_limit_min=0.0,
                    axis__soft_limit_max=90.0,
                    axis__soft_limit_min_enable=True,
                    axis__soft_limit_max_enable=True,
                )
                raw = 500
                assert encoder.update(raw) == 0
                start = encoder.position
                errors = 0
                for step in range(1, 31):
                    raw = (raw + sign * 100) % 1000
                    found = encoder.update(raw)
                    overflows = (500 + sign * 100 * step) // 1000
                    if abs(overflows) > most:
                        assert found == code
                        errors += 1
                        break
                    assert found == 0
                    assert encoder.position == pytest.approx(start + sign * step * 10.0)
                assert errors == (most < 9)


@pytest.mark.requirement("NC-746", "NC-279")
def test_position_that_cannot_be_initialised():
    """Without end positions a range system cannot place its position: 0x4465 and not homed."""
    rig = Rig(
        device=Plant,
        enc__reference_system="ABSOLUTE MULTITURN RANGE (with single overflow)",
    )
    rig.cycles(3)
    assert rig.handle.error_id == 0x4465
    assert not rig.axis.homed
    assert rig.status("Error")


@pytest.mark.requirement("NC-317")
def test_not_homed():
    """An axis that is not homed shows a position that is not the true one; Homed is the only sign of it."""
    rig = Rig()
    rig.device.position = 80.0
    rig.axis.encoder.begin(0, None)
    rig.enabled()
    move = rig.handle.move_absolute(rig.axis.position + 1.0, Velocity=10.0)
    rig.until(move.done)
    assert not rig.status("Homed")
    assert not rig.status("Error")
    rig.handle.home(5.0, mode=1)
    rig.cycles(3)
    assert rig.status("Homed")
    assert rig.axis.position == pytest.approx(5.0, abs=0.001)


@pytest.mark.requirement("NC-330")
def test_direct_inputs_of_terminals(subtests):
    """MDP 703 and 733: inputs 1 and 2 are E1 and E2 of the terminal, the others those of nState8."""
    for kind, source, direct, inputs, cam in (
        ("MDP_703", 1, 0b01, 0, True),
        ("MDP_733", 2, 0b10, 0, True),
        ("MDP_703", 1, 0, 0b01, False),
        ("MDP_703", 3, 0b11, 0b100, True),
        ("DS402_MDP742", 1, 0b01, 0, False),
        ("DS402_MDP742", 2, 0, 0b10, True),
    ):
        with subtests.test(kind, source=source):
            rig = Rig(drv__type=kind, enc__homing_sensor_source=f"Digital Input {source}")
            rig.device.direct_inputs, rig.device.digital_inputs = direct, inputs
            assert rig.axis.homing.cam is cam

    class Port:
        """A port with inputs."""

        zsw1, link_ok, sensor_fault, sign_lost = 0x0200, True, False, False
        actual_torque_nm, encoder_increments, encoder_restarts, following_error = 0.0, 0, 0, 0
        inputs = 0b111
        analog = False

        def read(self):
            """Do nothing."""

    device = PortDevice(Port(), rpm_per_unit=1.0, direct_inputs=True)
    device.read()
    assert (device.direct_inputs, device.digital_inputs) == (0b11, 0b100)


# -- modulo


@pytest.mark.requirement("NC-679", "NC-683", "NC-685", "NC-788")
def test_modulo_starts_near_the_target(subtests):
    """A start one increment before, inside, at and beyond the tolerance window: only beyond it a directed
    move goes a whole turn; after a reset the set position is the actual one.
    """
    for start, way in (
        (89.9999, 0.0001),
        (90.5, -0.5),
        (91.0, -1.0),
        (91.0001, 358.9999),
        (88.9, 1.1),
    ):
        with subtests.test(start=start):
            rig = Rig(enc__modulo_tolerance_window=1.0, axis__maximum_velocity=2000.0)
            rig.device.position = start
            rig.enabled()
            rig.device.frozen = False
            move = rig.handle.move_modulo(90.0, Velocity=2000.0, Acceleration=1e5, Deceleration=1e5, Jerk=1e7)
            rig.until(move.done)
            assert rig.axis.motion.s == pytest.approx(start + way, abs=1e-6)
    rig = Rig(enc__modulo_tolerance_window=1.0).enabled()
    rig.until(rig.handle.move_absolute(90.0, Velocity=100.0).done)
    rig.axis.raise_error(0x4550)
    rig.device.position = 90.4  # coasted beyond the target
    rig.cycles(2)
    rig.until(rig.handle.reset().done)
    rig.enabled()
    rig.until(rig.handle.move_modulo(90.0, Velocity=100.0).done)
    assert rig.axis.motion.s == pytest.approx(90.0)
    for target in (0.0, 90.0, 359.0):
        for start in (-400.0, -1.0, 12.3, 725.0):
            for direction in (Direction.POSITIVE, Direction.NEGATIVE, Direction.SHORTEST):
                way = modulo_move(start, target, factor=360.0, tolerance=1.0, direction=direction)
                assert (start + way - target) % 360.0 == pytest.approx(0.0, abs=1e-6) or (
                    start + way - target
                ) % 360.0 == pytest.approx(360.0, abs=1e-6)
                assert abs(way) <= (180.0 if direction is Direction.SHORTEST else 360.0)


# -- limits, external setpoints, interface


@pytest.mark.requirement("NC-775", "NC-132")
def test_limits_and_what_passes_them():
    """A command beyond a limit is refused, a jog stops at it, a position correction passes it."""
    rig = Rig(
        axis__soft_limit_max=20.0,
        axis__soft_limit_max_enable=True,
        axis__position_correction=True,
    ).enabled()
    refused = rig.handle.move_absolute(20.5, Velocity=50.0)
    rig.cycles(2)
    assert refused.ErrorID == 0x4461
    rig.handle.jog(JogMode.MC_JOGMODE_STANDARD_FAST)
    rig.cycles(600)
    assert rig.generator.s == pytest.approx(20.0)
    rig.ref.PlcToNc.PositionCorrection = -3.0
    rig.cycles(500)
    assert rig.device.position == pytest.approx(23.0, abs=0.01)
    assert rig.handle.error_id == 0


@pytest.mark.requirement("NC-585")
def test_external_steps():
    """Setpoints from outside may be faster than Maximum Velocity; a step beyond it by more than 10 % is
    passed on with a warning, and the lag monitoring catches it.
    """
    rig = Rig(axis__maximum_velocity=100.0, axis__position_lag_max=1.0).enabled()
    rig.handle.external_enable(0.0)
    rig.cycles(2)
    inputs = rig.ref.PlcToNc
    position = 0.0

    def feed(velocity, cycles):
        nonlocal position
        for _ in range(cycles):
            position += velocity * T
            inputs.ExtSetPos, inputs.ExtSetVelo, inputs.ExtSetDirection = position, velocity, 1
            rig.cycles()

    def warnings():
        return sum(one.kind == "axis.setpoint_step" for one in rig.history.events)

    feed(109.0, 50)
    assert warnings() == 0
    assert rig.axis.motion.v == 109.0
    feed(112.0, 50)
    assert warnings() == 1  # of steps in a row the first
    assert rig.axis.motion.s == pytest.approx(position, abs=0.3)
    feed(100.0, 5)
    position += 5.0
    feed(100.0, 5)
    assert warnings() == 2
    assert rig.axis.motion.s == pytest.approx(position, abs=0.3)
    feed(100.0, 20)
    assert rig.handle.error_id in {0, 0x4550}


@pytest.mark.requirement("NC-586")
def test_external_setpoints_of_a_slow_plc():
    """A PLC with twice the cycle of the SAF task makes a staircase: the following error ripples."""
    ripples = []
    for plc_cycles in (1, 2):
        rig = Rig(plc_cycles=plc_cycles).enabled()
        rig.handle.external_enable(0.0)
        rig.cycles(4)
        state = {"position": 0.0}
        inputs = rig.ref.PlcToNc

        def program(state=state, inputs=inputs, plc_cycles=plc_cycles):
            state["position"] += 100.0 * T * plc_cycles
            inputs.ExtSetPos, inputs.ExtSetVelo, inputs.ExtSetDirection = state["position"], 100.0, 1

        rig.runtime.call(program)
        rig.cycles(200)
        steps, errors = [], []
        for _ in range(20):
            before = rig.axis.motion.s
            rig.cycles()
            steps.append(round(rig.axis.motion.s - before, 9))
            errors.append(rig.axis.following_error)
        ripples.append((len(set(steps)), max(errors) - min(errors)))
    assert ripples[0][0] == 1
    assert ripples[1][0] == 2
    assert ripples[1][1] > ripples[0][1] + 0.05


@pytest.mark.requirement("NC-754")
def test_freshness_of_both_structures():
    """Two fixed structures with counters: frozen on either side, they show it byte by byte."""
    for phase in range(4):
        rig = Rig(task__watchdog_cycles=3).enabled()
        rig.until(rig.handle.move_velocity(20.0).in_velocity)
        rig.cycles(phase)
        before = rig.axis.plc_to_nc.PlcCycleCount
        rig.cycles(2)
        assert (rig.axis.plc_to_nc.PlcCycleCount - before) & 0xFF == 2
        assert rig.axis.plc_to_nc.pack()[106] == rig.axis.plc_to_nc.PlcCycleCount
        rig.runtime.plc_running = False
        rig.cycles(1)
        kept = rig.axis.plc_to_nc.pack()
        rig.cycles(3)
        assert rig.axis.plc_to_nc.pack() == kept
        rig.cycles(1)
        assert rig.axis.plc_to_nc.pack() == bytes(128)
        rig = Rig(task__watchdog_cycles=3).enabled()
        rig.cycles(phase)
        counts = [rig.ref.NcToPlc.OpModeDWord >> 24]
        rig.cycles()
        counts.append(rig.ref.NcToPlc.OpModeDWord >> 24)
        assert (counts[1] - counts[0]) & 0xFF == 1
        rig.runtime.links[rig.axis.name].to_plc_stalled = True
        rig.cycles(3)
        assert rig.ref.NcToPlc.StateDWord & 1
        rig.cycles(1)
        assert rig.ref.NcToPlc.pack() == bytes(256)
        assert rig.axis.operational


# -- symbols and images


@pytest.mark.requirement("NC-048", "NC-068")
def test_symbols():
    """Symbols exist while Create Symbols is on; the generic part follows the language unless fixed."""
    rig = Rig()
    names = list(symbol_names(rig.axis, language="de"))
    assert "Axes.x.SetPos" in names
    assert "Axes.x.enc.scaling_numerator" in names
    assert len(names) == len(set(names)) > 180
    rig.handle.write_parameter("task.symbol_names_fixed", False)
    assert "Achsen.x.SetPos" in set(symbol_names(rig.axis, language="de"))
    assert "Axes.x.SetPos" in set(symbol_names(rig.axis))
    rig.handle.write_parameter("axis.create_symbols", False)
    assert not list(symbol_names(rig.axis))


@pytest.mark.requirement("NC-042", "NC-040")
def test_image_of_the_saf_task():
    """The image of the NC is that of its SAF task: inputs and outputs of every axis as of the last cycle."""
    rig = Rig().enabled()
    other = Rig(with_=rig).enabled()
    rig.until(rig.handle.move_velocity(40.0).in_velocity)
    image = rig.runtime.image()
    assert set(image) == {
        f"{axis}.{part}.{way}"
        for axis in ("x", other.axis.name)
        for part in ("encoder", "drive")
        for way in ("inputs", "outputs")
    }
    assert all(len(one) == 40 for one in image.values())
    own = ProcessImage(rig.axis)
    assert image["x.encoder.inputs"] == own.pack_encoder_inputs()
    assert image["x.encoder.outputs"] == own.pack_encoder_outputs()
    assert image["x.drive.inputs"] == own.pack_drive_inputs() != own.pack_drive_outputs()
    assert image["x.drive.outputs"] == own.pack_drive_outputs()
    rig.cycles()
    assert rig.runtime.image()["x.encoder.inputs"] != image["x.encoder.inputs"]
