"""NC axes on every kind of drive of the product, and on an encoder, with every interface."""

from importlib.resources import files

import pytest

from emulators.drive.analog_config import AnalogConfig, AnalogSettings
from fieldbus.errors import ConfigurationError
from hil.bench import Bench
from hil.bench.bench_file import parse
from motion.nc.process_image import DRIVE_IN
from motion.nc.retain import StartAbortedError

pytestmark = pytest.mark.exhaustive

_CAN = """
[bench]
name = "feeder"
kind = "virtual"
cycle_ms = 2
[segment.can0]
bitrate = 1_000_000
[drive.motor]
segment = "can0"
node_id = 5
{drive}
[axis.x]
controller = "nc"
drive = "motor"
{axis}
[axis.x.parameters]
{parameters}
"""


def _bench(drive="", axis="", more="", **parameters):
    lines = {"ctrl.pos_kv": 20.0, **{key.replace("__", "."): value for key, value in parameters.items()}}
    text = "\n".join(
        f'"{key}" = {str(value).lower() if isinstance(value, bool) else repr(value)}'
        for key, value in lines.items()
        if value is not None
    )
    return Bench(parse(_CAN.format(drive=drive, axis=axis, parameters=text) + more, "bench.toml"))


def _shipped(name):
    """A bench of the product with an NC axis in place of its technology object."""
    text = files("hil.bench.data").joinpath(f"{name}.toml").read_text()
    head = text[: text.index("[axis.axis1]")]
    axis = '[axis.x]\ncontroller = "nc"\ndrive = "drive1"\nparameters = { "ctrl.pos_kv" = 10.0 }\n'
    return Bench(parse(head + axis, f"{name}.toml"))


@pytest.mark.requirement("NC-006", "NC-008", "NC-479")
def test_every_drive(subtests):
    """The same commands with the same meaning on CiA 402, PROFIdrive, analog and stepper drives, on CAN,
    Modbus and terminals: PTP mode and position control after the start, moves that arrive.
    """
    for name in ("reference", "profidrive", "profidrive_tcp", "profidrive_rtu", "analog", "stepper"):
        with subtests.test(name), _shipped(name) as bench:
            x = bench.axis("x")
            bench.wait_until(x.power().status, 2.0)
            bench.run_for(0.1)
            assert x.ref.NcToPlc.StateDWord & (1 << 25 | 1 << 20) == 1 << 25 | 1 << 20
            move = x.move_absolute(60.0, Velocity=80.0)
            bench.wait_until(move.done, 4.0)
            bench.run_for(0.3)
            trace = bench.trace()
            assert x.position == pytest.approx(60.0, abs=0.05)
            assert max(trace["x.set_velocity"].values) == pytest.approx(80.0)
            assert max(abs(trace["x.following_error"].values)) < 5.0
            x.power(False)
            bench.run_for(0.2)
            assert not x.operational
            bench.wait_until(x.power().status, 2.0)
            bench.wait_until(x.move_absolute(0.0, Velocity=80.0).done, 4.0)


@pytest.mark.requirement("NC-481", "NC-790", "NC-375", "NC-362", "NC-404")
def test_position_interface(subtests):
    """A drive in csp controls the position: the gain of the NC changes no output; with Extern the following
    error is that of the drive (60F4h).
    """
    outputs = []
    for kv in (1.0, 100.0):
        for extern in (False, True):
            with (
                subtests.test(kv=kv, extern=extern),
                _bench(
                    axis='interface = "position"',
                    ctrl__pos_kv=kv,
                    drv__following_error_calculation="Extern" if extern else "Intern",
                    axis__position_lag_max=50.0,
                ) as bench,
            ):
                x = bench.axis("x")
                bench.wait_until(x.power().status, 1.0)
                move = x.move_absolute(100.0, Velocity=200.0)
                sent = []
                for _ in range(600):
                    bench.run_for(0.002)
                    words = x.object.device.words
                    sent.append(words["607Ah"])
                    if extern:
                        scaling = x.object.encoder.scaling
                        assert x.object.following_error == pytest.approx(words["60F4h"] * scaling)
                    else:
                        error = x.object.motion.s - x.position
                        assert x.object.following_error == pytest.approx(error)
                bench.wait_until(move.done, 3.0)
                assert x.position == pytest.approx(100.0, abs=0.02)
                assert words["6060h"] == 8
                outputs.append(sent)
    assert all(sent == outputs[0] for sent in outputs[1:])


@pytest.mark.requirement("NC-597", "NC-595")
def test_correction_with_a_position_interface():
    """A correction moves the machine by its negative and does not show as a following error."""
    with _bench(axis='interface = "position"', axis__position_correction=True) as bench:
        x = bench.axis("x")
        bench.wait_until(x.power().status, 1.0)
        bench.wait_until(x.move_absolute(10.0, Velocity=50.0).done, 3.0)
        bench.run_for(0.2)
        machine = bench.drive("motor").mechanics
        before = machine.position
        x.ref.PlcToNc.PositionCorrection = 0.2
        bench.run_for(0.3)
        assert (machine.position - before) * 1000.0 == pytest.approx(-0.2, abs=0.01)
        assert x.position == pytest.approx(10.0, abs=0.01)
        assert abs(x.object.following_error) < 0.01
        assert x.object.encoder.uncorrected == pytest.approx(9.8, abs=0.01)


def test_dynamic_servo_control():
    """Telegram 5 with the position interface: XERR and KPC reach the drive, which controls the position."""
    drive = 'profile = "profidrive"\ntelegram = 5'
    with _bench(drive=drive, axis='interface = "position"', ctrl__pos_kv=30.0) as bench:
        x = bench.axis("x")
        bench.wait_until(x.power().status, 1.0)
        move = x.move_absolute(50.0, Velocity=100.0)
        bench.run_for(0.3)
        words = x.object.device.words
        assert words["KPC"] != 0
        assert words["NSOLL_B"] > 0
        bench.wait_until(move.done, 3.0)
        assert x.position == pytest.approx(50.0, abs=0.02)


@pytest.mark.requirement("NC-546")
def test_torque_interface(subtests):
    """A drive in cst gets torques: the NC controls position and velocity, with and without an observer."""
    for kind in (
        "Position P and velocity PID controller (Torque)",
        "Position P and velocity PI controller with Observer (Torque)",
    ):
        with (
            subtests.test(kind),
            _bench(
                axis='interface = "torque"',
                ctrl__type=kind,
                ctrl__pos_kv=15.0,
                ctrl__velo_kv=0.5,
                ctrl__velo_tn=0.05,
                ctrl__velo_i_limit=1.0,
                axis__position_lag_max=20.0,
            ) as bench,
        ):
            x = bench.axis("x")
            bench.wait_until(x.power().status, 1.0)
            bench.wait_until(x.move_absolute(50.0, Velocity=100.0).done, 4.0)
            bench.run_for(0.5)
            assert x.position == pytest.approx(50.0, abs=0.1)
            assert x.object.device.words["6060h"] == 10
            trace = bench.trace()
            assert max(abs(trace["x.following_error"].values)) < 5.0


@pytest.mark.requirement("NC-120", "NC-113")
def test_fast_stop_by_an_input(subtests):
    """An input of the drive stops the axis within the SAF task, earlier than MC_Stop of a PLC with the same
    deceleration that sees the same input.
    """
    ends = {}
    for way in ("fast", "plc"):
        with (
            subtests.test(way),
            _bench(
                drive="[drive.motor.switches]\nhome_mm = 30.0\n",  # active up to there
                axis='fast_stop_input = "home"',
                axis__fast_axis_stop_signal_type="Falling Edge" if way == "fast" else "OFF (default)",
                axis__fast_deceleration=4000.0,
                axis__fast_jerk=1e6,
            ) as bench,
        ):
            x = bench.axis("x")
            bench.wait_until(x.power().status, 1.0)
            bench.run_for(0.1)
            move = x.move_velocity(100.0, Acceleration=5000.0, Jerk=1e6)
            if way == "plc":
                bench.wait_until(lambda x=x: not x.object.device.digital_inputs & 4, 2.0)
                x.stop(Deceleration=4000.0, Jerk=1e6)
            bench.wait_until(move.aborted, 2.0)
            bench.run_for(0.3)
            trace = bench.trace()
            assert min(trace["x.set_acceleration"].values) == pytest.approx(-4000.0, rel=0.01)
            assert x.object.motion.v == 0.0
            assert not x.error_id
            ends[way] = x.object.motion.s
    assert ends["plc"] - ends["fast"] >= 100.0 * 0.002 - 1e-6


def test_simulation_axis_and_encoder_axis_of_a_bench():
    """Without drive an axis is simulated; with an encoder it is an encoder axis, which leads others."""
    more = """
[encoder.tacho]
profile = "cia406"
segment = "can0"
node_id = 20
[encoder.tacho.shaft]
speed_rpm = 60.0
[axis.v]
controller = "nc"
[axis.e]
controller = "nc"
encoder = "tacho"
[axis.e.parameters]
"enc.scaling_numerator" = 0.01
[nc]
licence = "TF5000"
svb_ms = 4
[nc.parameters]
"task.watchdog_cycles" = 7
"""
    with _bench(more=more) as bench:
        x, v, e = bench.axis("x"), bench.axis("v"), bench.axis("e")
        assert bench.nc.svb_cycles == 2
        assert v.read_parameter("task.watchdog_cycles") == 7
        bench.wait_until(v.power().status, 1.0)
        gear = v.gear_in(e, 0.5)
        bench.wait_until(gear.in_gear, 1.0)
        first, leading = v.position, e.position
        bench.run_for(0.5)
        assert e.position != leading
        assert v.position - first == pytest.approx(0.5 * (e.position - leading), rel=0.02)
        assert not x.operational


def test_mistakes_of_the_file(subtests):
    """Wrong interfaces, encoders, tables and places of parameters are reported with what is allowed."""
    for changes, words in (
        ({"axis": 'encoder = "tacho"'}, "a drive or an encoder of its own"),
        ({"drive": 'profile = "profidrive"\ntelegram = 3', "axis": 'interface = "position"'}, "no position"),
        ({"task__watchdog_cycles": 5}, r"\[nc.parameters\]"),
        ({"more": '[nc]\nlicence = "TF5001"'}, "TF5010"),
        ({"more": '[nc.parameters]\n"axis.maximum_velocity" = 5.0'}, r"\[axis.NAME.parameters\]"),
        ({"more": "[nc.valve_table.one]\npoints = [[0.0, 0.0], [1.0, 1.0]]"}, "a number of 1 or more"),
        ({"more": "[nc.valve_table.1]\npoints = [[0.0, 0.0], [0.0, 1.0]]"}, "x rising"),
        ({"more": '[axis.y]\ncontroller = "nc"\nencoder = "none"'}, "encoder"),
        ({"more": '[axis.y]\ncontroller = "nc"\ninterface = "torque"'}, "needs a drive"),
        ({"ctrl__velo_kv": 3.0}, "velo_kv"),
    ):
        with subtests.test(words), pytest.raises(ConfigurationError, match=words):
            _bench(**changes)


@pytest.mark.requirement("NC-079", "NC-332", "NC-333", "NC-379")
def test_a_link_sets_the_types(subtests):
    """The link of a drive sets types, scaling and masks of the axis, and links its process images."""
    for name, drive_type, linked in (
        ("reference", "DS402_MDP742", "6041h low"),
        ("profidrive", "DS402_MDP742", "ZSW1 low"),
        ("analog", "KL4XXX", None),
    ):
        with subtests.test(name), _shipped(name) as bench:
            x = bench.axis("x")
            assert x.read_parameter("drv.type") == drive_type
            assert x.read_parameter("enc.type") == "Hardware encoder"
            assert x.read_parameter("axis.axis_type").startswith("CANopen DS402")
            assert x.read_parameter("enc.scaling_numerator") == 10.0
            assert x.read_parameter("enc.encoder_sub_mask") == x.read_parameter("enc.scaling_denominator") - 1
            assert x.read_parameter("axis.reference_velocity") == pytest.approx(500.0)
            assert x.image.links(DRIVE_IN).get("nState1") == linked


@pytest.mark.requirement("NC-763")
def test_invalid_bus_data():
    """The data of a drive can be made invalid for a number of cycles: a flag up to three, an error beyond."""
    with _bench() as bench:
        x = bench.axis("x")
        bench.wait_until(x.power().status, 1.0)
        for cycles, error in ((1, 0), (3, 0), (4, 0x4655)):
            x.object.device.invalid_cycles = cycles
            seen = 0
            for _ in range(8):
                bench.run_for(0.002)
                seen += bool(x.ref.NcToPlc.StateDWord & 1 << 30)
            assert seen >= cycles - 1
            assert x.error_id == error


@pytest.mark.requirement("NC-764", "NC-729")
def test_recording():
    """Every SAF cycle is recorded under AxisName.ParameterName: values, status words, outputs, error code."""
    with _bench(axis='interface = "position"') as bench:
        x = bench.axis("x")
        bench.wait_until(x.power().status, 1.0)
        bench.wait_until(x.move_absolute(5.0, Velocity=50.0).done, 2.0)
        trace = bench.trace()
        for name in (
            "set_position", "actual_position", "set_velocity", "actual_velocity", "set_acceleration",
            "following_error", "state_dword", "op_mode_dword", "output", "output_data", "output_control",
            "error_code",
        ):  # fmt: skip
            assert len(trace[f"x.{name}"].values) == len(trace["x.set_position"].values) > 100
        assert trace["x.output_data"].values[-1] == x.object.outputs.position
        assert trace["x.output_control"].values[-1] == 1
        times = trace["x.set_position"].time_s
        assert times[-1] - times[-2] == pytest.approx(0.002)


@pytest.mark.requirement("NC-757", "NC-550", "NC-563")
def test_analog_drive_with_drift(subtests):
    """An analog drive has drift, dead zone and polarity; the automatic offset of the axis takes the drift
    away.
    """
    errors = {}
    for auto in (False, True):
        with subtests.test(auto=auto):
            text = files("hil.bench.data").joinpath("analog.toml").read_text()
            head = text[: text.index("[axis.axis1]")] + "[drive.drive1.analog]\noffset_v = 0.02\n"
            axis = (
                '[axis.x]\ncontroller = "nc"\ndrive = "drive1"\n[axis.x.parameters]\n"ctrl.pos_kv" = 10.0\n'
                f'"ctrl.auto_offset" = {str(auto).lower()}\n"ctrl.offset_timer" = 0.3\n'
            )
            with Bench(parse(head + axis, "analog.toml")) as bench:
                x = bench.axis("x")
                bench.wait_until(x.power().status, 2.0)
                bench.run_for(3.0)
                errors[auto] = x.object.following_error
    assert abs(errors[False]) == pytest.approx(0.1, rel=0.1)  # 1 mm/s at a gain of 10
    assert abs(errors[True]) < 0.01
    config = AnalogConfig(analog=AnalogSettings(offset_v=0.1, dead_zone_v=0.2, inverted=True))
    assert [config.speed_rpm(volts) for volts in (0.05, 0.9)] == [0.0, pytest.approx(-300.0)]


@pytest.mark.requirement("NC-205", "NC-762")
def test_retain_data_of_a_bench(tmp_path, subtests):
    """A bench with a file of retain data finds the position of its axis again at the next start; without the
    file the axis is not referenced, and Load/Store does not start.
    """

    def bench(mode):
        more = (
            f'[nc]\nretain_file = "{tmp_path / "retain.dat"}"\n[nc.parameters]\n"task.retain_data" = "{mode}"'
        )
        return _bench(
            more=more,
            enc__reference_system="INCREMENTAL (singleturn absolute)",
            axis__data_persistence=True,
        )

    with bench("Load (if available)/Store") as first:
        x = first.axis("x")
        first.run_for(0.05)
        assert not x.homed
        x.set_position(77.0)
        first.run_for(0.05)
    for mode in ("Load/Store", "Load (if available)/Store", "Store only"):
        with subtests.test(mode), bench(mode) as again:
            again.run_for(0.05)
            x = again.axis("x")
            restored = mode != "Store only"
            assert x.homed is restored
            assert x.position == pytest.approx(77.0 if restored else 0.0, abs=0.01)
    (tmp_path / "retain.dat").write_bytes(b"broken")
    with pytest.raises(StartAbortedError, match="corrupt"):
        bench("Load/Store")


@pytest.mark.requirement("NC-759", "NC-353")
def test_hydraulic_drive_with_a_valve_table(subtests):
    """An analog drive may have the characteristic of a valve, with dead band and kink; a valve table that
    undoes it makes the axis follow like a linear one.
    """
    text = files("hil.bench.data").joinpath("analog.toml").read_text()
    head = text[: text.index("[axis.axis1]")]
    head += (
        "[drive.drive1.analog]\n"
        "characteristic = [[-1.0, -1.0], [-0.5, -0.2], [-0.1, 0.0], [0.1, 0.0], [0.5, 0.2], [1.0, 1.0]]\n"
        "[nc.valve_table.3]\n"
        "points = [[-1.0, -1.0], [-0.2, -0.5], [-0.001, -0.1], "
        "[0.0, 0.0], [0.001, 0.1], [0.2, 0.5], [1.0, 1.0]]\n"
    )
    errors = {}
    for table in (0, 3):
        with subtests.test(table=table):
            axis = (
                '[axis.x]\ncontroller = "nc"\ndrive = "drive1"\n[axis.x.parameters]\n"ctrl.pos_kv" = 10.0\n'
                f'"axis.position_lag_max" = 500.0\n"drv.valve_table_id" = {table}\n'
            )
            with Bench(parse(head + axis, "analog.toml")) as bench:
                x = bench.axis("x")
                bench.wait_until(x.power().status, 2.0)
                x.move_velocity(200.0)
                bench.run_for(1.5)
                errors[table] = abs(x.object.following_error)
    assert errors[0] > 5.0
    assert errors[3] < 1.5
    with pytest.raises(ConfigurationError, match="rising"):
        AnalogSettings(characteristic=((0.0, 0.0), (0.0, 1.0)))
