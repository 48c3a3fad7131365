"""Drive component beyond the velocity output, and controllers beyond P: smoothing, time compensation, valve
tables, torque, controller types, observer.
"""

from itertools import pairwise
from math import exp, pi

import pytest

from fieldbus.errors import ConfigurationError
from motion.nc.controller import Controller
from motion.nc.device import POSITION, TORQUE
from motion.nc.drive import Drive
from motion.nc.encoder import Encoder
from motion.nc.parameters import ParameterSet, RefusedParameterError, catalogue
from motion.nc.tables import LINEAR, SPLINE, Table, TableSpace
from motion.nc.torque import Observer, VelocityController
from testcases.unit.motion_nc.nc_rig import Plant, Rig, T

pytestmark = pytest.mark.exhaustive

P = "Position controller P"
PP = "Position controller with two P constants (with Ka)"
PID = "Position controller PID (with Ka)"
PPID = "Position P and velocity PID controller (Torque)"
OBS = "Position P and velocity PI controller with Observer (Torque)"
TWO = "Two speed controller"
STP = "Stepper controller"
SER = "SERCOS controller (Position by SERCOS)"
TYPES = (P, PP, PID, PPID, OBS, TWO, STP, SER)


def _values(values):
    return {key.replace("__", "."): value for key, value in values.items()}


def _drive(cycle_s=T, tables=None, **values):
    return Drive(ParameterSet(_values(values)), cycle_s=cycle_s, tables=tables)


# -- smoothing and time compensation of the position output


@pytest.mark.requirement("NC-356", "NC-357", "NC-373")
def test_moving_average():
    """Off, the output is the set position; a moving average of 20 ms at 1 ms spreads a step over 20."""
    drive = _drive(cycle_s=0.001)
    assert [drive.position(s, 0.0, 0.0) for s in (0.0, 20.0, -3.0)] == [0.0, 20.0, -3.0]
    drive = _drive(cycle_s=0.001, drv__smoothing_type="Moving Average", drv__smoothing_time=0.02)
    drive.position(0.0, 0.0, 0.0)
    outputs = [drive.position(20.0, 0.0, 0.0) for _ in range(25)]
    assert outputs == pytest.approx([min(float(n), 20.0) for n in range(1, 26)])
    ramp = [drive.position(20.0 + n, 0.0, 0.0) for n in range(1, 60)]
    assert [after - before for before, after in pairwise(ramp[25:])] == pytest.approx([1.0] * 33)
    assert ramp[-1] == pytest.approx(20.0 + 59.0 - 9.5)  # the mean of the last 20


@pytest.mark.requirement("NC-358", "NC-374")
def test_p_tn(subtests):
    """P-Tn is a chain of equal PT1 stages: with order 2 the response has no step in its slope."""
    for order in (1, 2, 3):
        with subtests.test(order=order):
            drive = _drive(drv__smoothing_type="P-Tn", drv__smoothing_time=0.01, drv__smoothing_order=order)
            drive.position(0.0, 0.0, 0.0)
            stages = [0.0] * order
            for _ in range(40):
                value = 10.0
                for number in range(order):
                    value = stages[number] = stages[number] + (value - stages[number]) / 6.0
                assert drive.position(10.0, 0.0, 0.0) == pytest.approx(value)
    with pytest.raises(ConfigurationError, match="smoothing_order"):
        _drive(drv__smoothing_order=0)


@pytest.mark.requirement("NC-372")
def test_smoothing_shows_as_following_error():
    """The filter acts on the position output alone: its delay is following error."""
    errors = []
    for values in ({}, {"drv__smoothing_type": "Moving Average", "drv__smoothing_time": 0.02}):
        rig = _position_rig(**values)
        rig.until(rig.handle.move_velocity(100.0).in_velocity)
        rig.cycles(50)
        errors.append(rig.axis.following_error)
        assert rig.generator.v == 100.0
    assert errors[1] - errors[0] == pytest.approx(100.0 * 0.009, rel=0.01)


@pytest.mark.requirement("NC-364", "NC-365", "NC-366", "NC-367", "NC-368")
def test_time_compensation_of_the_output():
    """The position output is brought forward by cycles, a fixed time and a time stamp, with velocity or with
    acceleration too.
    """
    values = {"drv__time_comp_task_cycles": 1.0, "drv__time_comp_additional": 1000.0}
    assert _drive(**values).position(100.0, 1000.0, 500.0) == 100.0
    drive = _drive(drv__time_comp_mode="ON (with velocity)", **values)
    assert drive.position(100.0, 1000.0, 500.0) == pytest.approx(103.0)
    drive = _drive(drv__time_comp_mode="ON (with velocity and acceleration)", **values)
    assert drive.position(100.0, 1000.0, 5000.0) == pytest.approx(103.0 + 0.5 * 5000.0 * 0.003**2)
    for cycle, delay in ((0.002, 0.0065), (0.001, 0.0035)):
        drive = _drive(
            cycle_s=cycle,
            drv__time_comp_mode="ON (with velocity)",
            drv__time_comp_task_cycles=1.0,
            drv__time_comp_cycles=2.0,
            drv__time_comp_additional=500.0,
        )
        assert drive.dead_time() == pytest.approx(delay)
        assert drive.dead_time(0.004) == pytest.approx(delay)
        assert drive.position(0.0, 1.0, 0.0, 0.004) == pytest.approx(delay)
    drive = _drive(
        drv__time_comp_mode="ON (with velocity)",
        drv__time_comp_absolute=True,
        drv__time_comp_task_cycles=0.0,
    )
    assert drive.position(0.0, 1000.0, 0.0, 0.004) == pytest.approx(4.0)


@pytest.mark.requirement("NC-287", "NC-290")
def test_time_stamps_of_the_encoder():
    """With absolute time stamps the age of the value is part of the dead time that is compensated."""
    for absolute, expected in ((False, 100.0), (True, 103.0)):
        encoder = Encoder(
            ParameterSet(
                {
                    "enc.encoder_mask": 0xFFFFFFFF,
                    "enc.scaling_numerator": 0.001,
                    "enc.time_comp_mode": "ON (with velocity)",
                    "enc.time_comp_absolute": absolute,
                }
            ),
            cycle_s=T,
            io_cycle_s=T,
        )
        encoder.update(98_000)
        encoder.update(100_000, 0.0, 0.003)  # 1000 mm/s
        assert encoder.position == pytest.approx(expected)


# -- torque and acceleration


@pytest.mark.requirement("NC-346", "NC-347", "NC-348", "NC-410")
def test_actual_torque():
    """ActTorque is the raw value times its factor, filtered; its derivative has a filter of its own."""
    rig = Rig(drv__input_scaling_torque=0.1).enabled()
    rig.device.torque = 500.0
    rig.cycles()
    assert rig.ref.NcToPlc.ActTorque == pytest.approx(50.0)
    rig.handle.write_parameter("drv.input_scaling_torque", 0.0)
    rig.cycles()
    assert rig.ref.NcToPlc.ActTorque == 0.0
    drive = _drive(drv__input_scaling_torque=1.0, drv__input_filter_torque=0.01)
    drive.take_torque(0.0)
    drive.take_torque(60.0)
    assert drive.actual_torque == pytest.approx(10.0)
    drive = _drive(drv__input_scaling_torque=1.0, drv__input_filter_torque_derivative=0.01)
    for cycle in range(1, 30):
        drive.take_torque(6.0 * cycle)
        expected = 3000.0 * (1.0 - (5.0 / 6.0) ** cycle)
        assert drive.actual_torque_derivative == pytest.approx(expected)


@pytest.mark.requirement("NC-349", "NC-350", "NC-351", "NC-352", "NC-369")
def test_torque_and_acceleration_output():
    """Torque and acceleration go out scaled and delayed; with factors of 0.0 neither exists."""
    drive = _drive()
    assert not drive.feeds_forward
    drive.give_torque(5.0)
    drive.give_acceleration(1500.0)
    assert drive.torque == drive.acceleration == 0.0
    drive = _drive(drv__output_scaling_torque=10.0, drv__output_scaling_acceleration=0.02)
    assert drive.feeds_forward
    drive.give_torque(5.0)
    drive.give_acceleration(1500.0)
    assert drive.torque == 50.0
    assert drive.acceleration == pytest.approx(30.0)
    drive = _drive(
        drv__output_scaling_torque=1.0,
        drv__output_delay_torque=0.004,
        drv__output_scaling_acceleration=1.0,
        drv__output_delay_acceleration=0.004,
    )
    seen = []
    for value in (0.0, 0.0, 7.0, 7.0, 7.0, 7.0):
        drive.give_torque(value)
        drive.give_acceleration(value)
        assert drive.torque == drive.acceleration
        seen.append(drive.torque)
    assert seen == [0.0, 0.0, 0.0, 0.0, 7.0, 7.0]  # the step of cycle k in cycle k + 2
    rig = Rig(drv__output_scaling_acceleration=0.02, drv__output_scaling_torque=10.0).enabled()
    rig.handle.move_velocity(500.0, Acceleration=1500.0, Jerk=1e7)
    rig.ref.PlcToNc.ExtTorque = 3.0
    rig.cycles(10)
    assert rig.axis.outputs.acceleration == pytest.approx(30.0)
    assert rig.axis.outputs.torque == pytest.approx(30.0)
    assert rig.ref.NcToPlc.SetTorque == 3.0


# -- valve characteristic


@pytest.mark.requirement("NC-353", "NC-354", "NC-355", "NC-370", "NC-371", "NC-043")
def test_valve_characteristic():
    """The output goes through the table: linear or spline, boundary values outside, an offset, both
    directions on their own; cams and valves share their ids.
    """
    tables = TableSpace()
    cam = tables.add(Table("cam", [(0.0, 0.0), (360.0, 100.0)]))
    valve = tables.add(Table("valve", [(-0.8, -0.5), (0.0, 0.0), (0.5, 0.2), (1.0, 1.0)]))
    assert (cam, valve) == (1, 2)
    with pytest.raises(ConfigurationError, match="no other table"):
        tables.add(Table("cam", [(0.0, 0.0), (1.0, 1.0)]), 2)
    assert tables.get(1, "valve") is None
    drive = _drive(tables=tables, drv__valve_table_id=valve)
    for share, output in ((0.75, 0.6), (0.5, 0.2), (-0.4, -0.25), (-0.8, -0.5), (-1.0, -0.5), (1.5, 1.0)):
        drive.step(share * 2200.0, 0.0)
        assert drive.output == pytest.approx(output)
    linear = _drive(tables=tables)
    linear.step(0.75 * 2200.0, 0.0)
    assert linear.output == pytest.approx(0.75)
    spline = Table("valve", [(0.0, 0.0), (0.5, 0.2), (1.0, 1.0)])
    assert spline.value(0.75, LINEAR) == pytest.approx(0.6)
    natural = 0.6 - 1.2 * 0.25**2 * 0.75  # second derivative 2.4 in the middle, 0 at the ends
    assert spline.value(0.75, SPLINE) == pytest.approx(natural, abs=0.02)
    assert spline.value(0.75, SPLINE) != pytest.approx(0.6, abs=1e-3)
    for x, y in spline.points:
        assert spline.value(x, SPLINE) == pytest.approx(y)
    drive = _drive(drv__valve_offset=0.05)
    drive.step(0.0, 0.0)
    assert drive.output == pytest.approx(0.05)


@pytest.mark.requirement("NC-371", "NC-751")
def test_change_of_the_valve_table():
    """The id changes without controller enable only: 0x4652; one that there is not is refused as well."""
    rig = Rig()
    number = rig.runtime.tables.add(Table("valve", [(-1.0, -1.0), (1.0, 1.0)]))
    with pytest.raises(ConfigurationError, match=r"drv\.valve_table_id"):
        rig.handle.write_parameter("drv.valve_table_id", 7)
    rig.handle.write_parameter("drv.valve_table_id", number)
    rig.enabled()
    with pytest.raises(RefusedParameterError, match="0x4652") as refused:
        rig.handle.write_parameter("drv.valve_table_id", 0)
    assert refused.value.error_id == 0x4652
    assert rig.handle.read_parameter("drv.valve_table_id") == number
    rig.handle.power(False)
    rig.cycles(3)
    rig.handle.write_parameter("drv.valve_table_id", 0)


class _Valve(Plant):
    """A hydraulic axis: its velocity is no linear function of the output."""

    def write(self, outputs):
        super().write(outputs)
        share = self.velocity / 2200.0
        self.velocity = 2200.0 * share * abs(share)


@pytest.mark.requirement("NC-370")
def test_hydraulic_axis():
    """Through its table a hydraulic axis can be handled like a servo axis: the following error is that of a
    linear one.
    """
    errors = []
    for with_table in (False, True):
        rig = Rig(device=_Valve, axis__position_lag_max=500.0)
        if with_table:
            points = [((n / 50.0) * abs(n / 50.0), n / 50.0) for n in range(-50, 51)]
            number = rig.runtime.tables.add(Table("valve", points))
            rig.handle.write_parameter("drv.valve_table_id", number)
        rig.enabled()
        rig.until(rig.handle.move_velocity(300.0).in_velocity)
        rig.cycles(200)
        errors.append(abs(rig.axis.following_error))
    assert errors[0] > 20.0
    assert errors[1] < 1.5


# -- tolerance of drive errors


@pytest.mark.requirement("NC-359", "NC-376", "NC-377")
def test_error_tolerance_by_drive_type(subtests):
    """SERCOS drives have the C1D tolerance, all others the general one; only the own one counts."""
    for kind, own, other in (
        ("SERCOS", "drv__c1d_error_tolerance", "drv__error_tolerance"),
        ("DS402_MDP742", "drv__error_tolerance", "drv__c1d_error_tolerance"),
    ):
        for key, moves in ((own, True), (other, False)):
            with subtests.test(kind, key=key):
                rig = Rig(drv__type=kind, **{key: "IGNORE SELECTED ERRORS"}).enabled()
                rig.until(rig.handle.move_velocity(50.0).in_velocity)
                rig.device.fault = rig.device.keeps_following = True
                rig.cycles(5)
                assert rig.status("DriveDeviceError")
                assert rig.handle.error_id == (0 if moves else 0x4650)
                assert (rig.generator.v == 50.0) is moves


@pytest.mark.requirement("NC-360", "NC-549", "NC-165")
def test_single_choices():
    """Drive mode, controller mode and setpoint generator have one text each; any other is refused."""
    for key, only in (
        ("drv.drive_mode", "STANDARD"),
        ("ctrl.controller_mode", "STANDARD"),
        ("axis.setpoint_generator_type", "7 Phases (optimized)"),
    ):
        assert catalogue()[key].choices == (only,)
        with pytest.raises(ConfigurationError, match=key):
            ParameterSet({key: "OTHER"})
    rig = Rig().enabled()
    move = rig.handle.move_absolute(1900.0, Velocity=1000.0, Jerk=5000.0)
    signs, last = [], 0.0
    while not move.done():
        rig.cycles()
        a = rig.generator.a
        jerk = (a - last) / T
        last = a
        sign = 0 if abs(jerk) < 4000.0 else 1 if jerk > 0.0 else -1
        if abs(jerk) in (0.0, pytest.approx(5000.0)) and (not signs or signs[-1] != sign):
            signs.append(sign)
    assert signs[signs.index(1) :][:7] == [1, 0, -1, 0, -1, 0, 1]


# -- position interface


class _Positions(Plant):
    """A drive that takes positions and is there a cycle later."""

    def __init__(self, scaling):
        super().__init__(scaling)
        self.interface = POSITION
        self.wanted = 0

    def read(self):
        if self.operating:
            self.raw = self.wanted

    def write(self, outputs):
        super().write(outputs)
        self.wanted = outputs.position


def _position_rig(**values):
    return Rig(device=_Positions, **values).enabled()


@pytest.mark.requirement("NC-338", "NC-344", "NC-416")
def test_position_output_in_increments():
    """A position goes out as increments by the scaling of the encoder, past the overflow of 32 bit; its own
    factor changes nothing.
    """
    for factor in (1.0, 2.0):
        rig = _position_rig(drv__output_scaling_position=factor)
        rig.until(rig.handle.move_absolute(12.3456, Velocity=50.0).done)
        assert rig.axis.outputs.position == 123_456
    rig = Rig(device=_Positions)
    rig.device.raw = rig.device.wanted = 0x7FFFFFF0
    rig.enabled()
    start = rig.axis.position
    rig.until(rig.handle.move_relative(0.01, Velocity=10.0).done)
    assert rig.axis.outputs.position == 0x7FFFFFF0 + 100 - (1 << 32)
    rig.device.raw = rig.axis.outputs.position
    rig.cycles(2)
    assert rig.axis.position == pytest.approx(start + 0.01)


@pytest.mark.requirement("NC-362")
def test_following_error_of_the_drive():
    """Extern: the following error is what the drive reports, whatever the actual position is."""
    rig = _position_rig(drv__following_error_calculation="Extern")
    rig.device.lag = 12345
    rig.cycles()
    assert rig.ref.NcToPlc.PosDiff == pytest.approx(1.2345)
    rig.handle.write_parameter("drv.following_error_calculation", "Intern")
    rig.cycles()
    assert rig.ref.NcToPlc.PosDiff == 0.0


# -- controller types


_ROWS = {
    482: ("axis.position_lag_monitoring", TYPES),
    483: ("axis.position_lag_max", TYPES),
    484: ("axis.position_lag_filter_time", TYPES),
    485: ("ctrl.pos_dead_band", (PP, PID, OBS)),
    486: ("ctrl.pos_kv", (P, PID, PPID, OBS)),
    487: ("ctrl.pos_kv_standstill", (PP,)),
    488: ("ctrl.pos_kv_moving", (PP,)),
    489: ("ctrl.pos_ti_tn", (PID,)),
    490: ("ctrl.pos_tv", (PID,)),
    491: ("ctrl.pos_td", (PID,)),
    492: ("ctrl.pos_i_limit", (PID,)),
    493: ("ctrl.pos_d_limit", (PID,)),
    494: ("ctrl.pos_i_disable_moving", (PID,)),
    495: ("ctrl.pos_vdyn", (PP,)),
    496: ("ctrl.ka", (PP, PID, PPID, OBS)),
    497: ("ctrl.velocity_precontrol_weight", TYPES),
    498: ("ctrl.velo_kv", (PPID, OBS)),
    499: ("ctrl.velo_tn", (PPID, OBS)),
    500: ("ctrl.velo_tv", (PPID,)),
    501: ("ctrl.velo_td", (PPID,)),
    502: ("ctrl.velo_d_limit", (PPID,)),
    503: ("ctrl.velo_i_limit", (PPID, OBS)),
    504: ("ctrl.obs_filter_t", (OBS,)),
    505: ("ctrl.obs_mode", (OBS,)),
    506: ("ctrl.obs_kt", (OBS,)),
    507: ("ctrl.obs_jm", (OBS,)),
    508: ("ctrl.obs_f0", (OBS,)),
    509: ("ctrl.obs_kc", (OBS,)),
    510: ("ctrl.controller_mode", TYPES),
    511: ("ctrl.auto_offset", (P, PP)),
    512: ("ctrl.offset_timer", (P, PP)),
    513: ("ctrl.offset_limit", (P, PP)),
    514: ("ctrl.kcp", (P, PP, PID)),
    515: ("ctrl.output_limit", (P, PP, PID, PPID, OBS)),
}


@pytest.mark.requirement(*(f"NC-{row}" for row in range(482, 516)))
def test_parameters_of_controller_types(subtests):
    """A controller type has its parameters; another one is refused, at the start and online."""
    for row, (key, types) in _ROWS.items():
        one = catalogue()[key]
        if one.type == "bool":
            value = not one.default
        elif one.type == "enum":
            value = one.choices[-1]
        else:
            value = one.default * 0.5 + 0.01
        for kind in TYPES:
            with subtests.test(row, kind=kind):
                parameters = ParameterSet({"ctrl.type": kind})
                assert parameters.present(key) is (kind in types)
                if kind in types:
                    parameters.write(key, value)
                    assert parameters.read(key) == value
                    assert ParameterSet({"ctrl.type": kind, key: value}).read(key) == value
                else:
                    with pytest.raises(ConfigurationError, match=key):
                        parameters.write(key, value)
                    assert parameters.read(key) == one.default
                    with pytest.raises(ConfigurationError, match=key):
                        ParameterSet({"ctrl.type": kind, key: value})


def _controller(kind, **values):
    return Controller(ParameterSet({"ctrl.type": kind, **_values(values)}), cycle_s=T)


@pytest.mark.requirement("NC-480", "NC-533", "NC-531")
def test_following_error_by_feedforward():
    """With full feedforward the stationary following error is 0, without it is velocity over Kv."""
    for weight, error in ((1.0, 0.0), (0.0, 50.0)):
        rig = Rig(ctrl__velocity_precontrol_weight=weight, axis__position_lag_max=100.0).enabled()
        rig.until(rig.handle.move_velocity(1000.0).in_velocity)
        rig.cycles(500)
        travel = 1000.0 * T  # the plant moves a cycle later
        assert rig.axis.following_error == pytest.approx(error or travel, abs=travel * 1.01)
    for kind in (PID, PPID, OBS):
        controller = _controller(kind, ctrl__pos_kv=2.0)
        assert controller.step(0.0, 0.0, 3.0, has_job=False) == pytest.approx(6.0)


@pytest.mark.requirement("NC-531")
def test_limits_of_the_parts():
    """I and D limits are shares of full scale at the output ratio; the integrator waits at the output limit;
    Td of 0 gives the quotient of differences.
    """
    values = {"ctrl__pos_kv": 1.0, "ctrl__pos_ti_tn": 0.001, "ctrl__pos_i_limit": 0.1}
    controller = _controller(PID, drv__output_ratio=0.8, **values)
    for _ in range(2000):
        output = controller.step(0.0, 0.0, 5.0, has_job=False)
    assert output == pytest.approx(5.0 + 0.1 * 2200.0 / 0.8)
    controller = _controller(PID, **{**values, "ctrl__pos_i_limit": 1.0}, ctrl__output_limit=0.05)
    for _ in range(2000):
        output = controller.step(0.0, 0.0, 5.0, has_job=False)
    assert output == pytest.approx(0.05 * 2200.0, abs=5.0 * T / 0.001 + 1e-9)
    controller = _controller(PID, ctrl__pos_kv=2.0, ctrl__pos_tv=0.01, ctrl__pos_d_limit=1.0)
    controller.step(0.0, 0.0, 0.0, has_job=False)
    assert controller.step(0.0, 0.0, 1.0, has_job=False) == pytest.approx(2.0 + 2.0 * 0.01 / T)
    assert controller.step(0.0, 0.0, 1.0, has_job=False) == pytest.approx(2.0)


def _velocity(kind=PPID, **values):
    return VelocityController(ParameterSet({"ctrl.type": kind, **_values(values)}), cycle_s=T)


@pytest.mark.requirement("NC-534", "NC-535", "NC-536", "NC-537", "NC-538", "NC-539")
def test_velocity_controller():
    """P, I and D part of the velocity loop with their times and limits."""
    one = _velocity(ctrl__velo_kv=0.1)
    assert [one.step(50.0, 0.0, 0.0, 0.0) for _ in range(3)] == pytest.approx([5.0] * 3)
    one = _velocity(ctrl__velo_kv=0.1, ctrl__velo_tn=0.1)
    assert one.step(50.0, 0.0, 0.0, 0.0) == pytest.approx(5.0 + 5.0 * T / 0.1)
    for _ in range(1000):
        output = one.step(50.0, 0.0, 0.0, 0.0)
    assert output == pytest.approx(5.0 + 10.0)
    for _ in range(1000):
        output = one.step(-50.0, 0.0, 0.0, 0.0)
    assert output == pytest.approx(-15.0)
    one = _velocity(ctrl__velo_kv=0.1, ctrl__velo_tv=0.02, ctrl__velo_td=0.01, ctrl__velo_d_limit=1.0)
    parts = [one.step(50.0, 0.0, 0.0, 0.0) - 5.0 for _ in range(6)]
    assert parts[0] == pytest.approx(0.1 * 0.02 * 50.0 / (0.01 + T))
    assert [after / before for before, after in pairwise(parts)] == pytest.approx([0.01 / (0.01 + T)] * 5)
    one = _velocity(ctrl__velo_kv=0.1, ctrl__velo_tv=1.0)
    assert one.step(1e6, 0.0, 0.0, 0.0) - 1e5 == pytest.approx(10.0)
    assert _velocity(ctrl__velo_kv=0.1).step(1e3, 0.0, 0.0, 0.0) == pytest.approx(100.0)


def _observer(**values):
    parameters = ParameterSet({"ctrl.type": OBS, **_values(values)})
    one = Observer(parameters, cycle_s=T)
    one.reset(0.0, 0.0)
    return one


@pytest.mark.requirement("NC-540", "NC-542", "NC-543", "NC-544", "NC-545", "NC-548")
def test_observer():
    """The model accelerates by Kt over Jm; the measurement corrects it with a double pole at f0, by Kc; the
    estimate is filtered.
    """
    plain = {"ctrl__obs_kc": 0.0, "ctrl__obs_filter_t": 0.0}
    accelerations = []
    for values in ({}, {"ctrl__obs_kt": 2.0}, {"ctrl__obs_jm": 2.0}):
        one = _observer(**plain, **values)
        assert one.step(1e6, 1.0) == pytest.approx(one.gain * T)  # Kc 0: the measurement does not count
        accelerations.append(one.velocity / T)
    assert accelerations[0] == pytest.approx(1.0 / 1e-4 / (2.0 * pi))
    assert accelerations[1:] == pytest.approx([accelerations[0] * 2.0, accelerations[0] / 2.0])
    for f0 in (5.0, 20.0):
        one = _observer(ctrl__obs_f0=f0, ctrl__obs_filter_t=0.0)
        errors = []
        position = 0.0
        for _ in range(3000):
            position += 10.0 * T
            errors.append(10.0 - one.step(position, 0.0))
        assert abs(errors[-1]) < 1e-9
        pole = 1.0 / (1.0 + 2.0 * pi * f0 * T)
        # A double pole: the error falls as n p^n in the end.
        late = int(4.0 / (f0 * T))
        ratio = errors[late + 1] / errors[late]
        assert ratio == pytest.approx(pole, rel=0.06)
        assert pole == pytest.approx(exp(-2.0 * pi * f0 * T), rel=0.05)
    filtered, direct = _observer(ctrl__obs_filter_t=0.008), _observer(ctrl__obs_filter_t=0.0)
    wanted = 0.0
    for cycle in range(1, 50):
        value = direct.step(0.1 * cycle, 0.0)
        wanted += 0.2 * (value - wanted)
        assert filtered.step(0.1 * cycle, 0.0) == pytest.approx(wanted)


class _Motor(Plant):
    """A drive that takes a torque: a mass with friction."""

    def __init__(self, scaling):
        super().__init__(scaling)
        self.interface = TORQUE
        self.speed = 0.0

    def read(self):
        self.position += self.speed * T
        self.raw = round(self.position / self.scaling)

    def write(self, outputs):
        super().write(outputs)
        torque = outputs.torque if self.operating else 0.0
        self.torque = torque
        self.speed += (torque * 40.0 - 8.0 * self.speed) * T


@pytest.mark.requirement("NC-541", "NC-547")
def test_torque_axis(subtests):
    """A torque controller positions the axis; off, the loop uses the derivative of the position, with the
    Luenberger mode the estimate from position and current.
    """
    for kind, mode in ((PPID, None), (OBS, "OFF"), (OBS, "LUENBERGER")):
        with subtests.test(kind, mode=mode):
            values = {} if mode is None else {"ctrl__obs_mode": mode, "ctrl__obs_kt": 40.0 * 2e-4 * pi}
            rig = Rig(
                device=_Motor,
                ctrl__type=kind,
                ctrl__pos_kv=10.0,
                ctrl__velo_kv=1.0,
                ctrl__velo_tn=0.05,
                ctrl__velo_i_limit=1.0,
                drv__output_scaling_torque=1.0,
                drv__input_scaling_torque=1.0,
                axis__position_lag_max=50.0,
                **values,
            ).enabled()
            loop = rig.axis.velocity_controller
            assert loop.observing is (mode == "LUENBERGER")
            move = rig.handle.move_absolute(50.0, Velocity=100.0)
            rig.cycles(300)
            used, derivative = loop.velocity, rig.axis.encoder.derivative
            assert (used == derivative) is (mode != "LUENBERGER")
            assert used == pytest.approx(100.0, rel=0.3)
            rig.until(move.done)
            rig.cycles(300)
            assert rig.axis.position == pytest.approx(50.0, abs=0.05)


@pytest.mark.requirement("NC-556", "NC-557")
def test_acceleration_feedforward_by_measurement():
    """Ka from the following errors of a run makes those of the next run clearly smaller."""

    class Lag(Plant):
        """A drive whose velocity follows with a delay of first order."""

        def write(self, outputs):
            before = self.velocity
            super().write(outputs)
            if self.operating:
                self.velocity = before + (self.velocity - before) * T / (T + 0.004)

    def run(ka):
        rig = Rig(
            device=Lag, ctrl__type=PP, ctrl__pos_kv_standstill=20.0, ctrl__pos_kv_moving=20.0, ctrl__ka=ka
        ).enabled()
        move = rig.handle.move_absolute(
            600.0, Velocity=500.0, Acceleration=1500.0, Deceleration=1500.0, Jerk=1e6
        )
        by_phase = {}
        while not move.done():
            rig.cycles()
            a = rig.generator.a
            if abs(a) == pytest.approx(1500.0):
                by_phase.setdefault(a > 0.0, []).append(rig.axis.following_error)
        return {phase: errors[len(errors) // 2] for phase, errors in by_phase.items()}

    first = run(0.0)
    assert first[True] > 0.05
    assert first[False] < -0.05
    ka = (20.0 * first[True] / 1500.0 + 20.0 * first[False] / -1500.0) / 2.0
    second = run(ka)
    for phase in (True, False):
        assert abs(second[phase]) < 0.35 * abs(first[phase])


@pytest.mark.requirement("NC-550", "NC-559", "NC-560", "NC-564", "NC-789")
def test_auto_offset_of_an_axis(subtests):
    """On an analog drive with drift the following error goes to 0 as a PT1; off, it stays; held, it is
    frozen; on a digital drive nothing changes.
    """

    class Drift(Plant):
        """A drive whose zero is off."""

        def read(self):
            self.position += 10.0 * T
            super().read()

    for kind, on, error in (("KL4XXX", True, 0.0), ("KL4XXX", False, -0.5), ("SERCOS", True, -0.5)):
        with subtests.test(kind, on=on):
            rig = Rig(device=Drift, drv__type=kind, ctrl__auto_offset=on, ctrl__offset_timer=0.2).enabled()
            rig.cycles(1500)
            assert rig.axis.following_error == pytest.approx(error, abs=0.02)
            offset = rig.axis.controller.offset
            assert offset == pytest.approx(-10.0 if error == 0.0 else 0.0, abs=0.2)
            if error == 0.0:
                move = rig.handle.move_velocity(500.0)
                rig.until(move.in_velocity)
                at = rig.axis.controller.offset
                rig.cycles(300)
                assert rig.axis.controller.offset == at  # feedforward above 1 % of full scale
