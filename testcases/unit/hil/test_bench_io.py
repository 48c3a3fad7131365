"""I/O stations, analog drives and stepper drives of a bench file: wiring, messages, faults, record,
campaigns.
"""

from __future__ import annotations

import pytest

from fieldbus.errors import ConfigurationError, UnsupportedFaultError
from hil.bench import load_bench
from hil.bench.bench import Bench
from hil.bench.bench_file import BenchFileError, parse, read
from hil.campaign import CaseSettings, execute_case, load_campaign
from hil.faults import Injector
from reports.model import Verdict
from testcases.campaigns import stop_modes
from testcases.stop_sample import sampled_stops

pytestmark = pytest.mark.exhaustive

ANALOG, STEPPER = read("analog")[1], read("stepper")[1]
STATION_AT_A_SERVO = """
[segment.net0]
kind = "modbus_tcp"

[station.io]
segment = "net0"
digital_inputs = ["", "drive1.negative_limit", "drive1.positive_limit", "drive1.home"]
analog_inputs = 1
counters = ["drive1.encoder"]
input_filter_ms = 1.0
"""


def built(text, seed=1):
    """Return the bench of a file's text."""
    return Bench(parse(text, "bench.toml"), seed=seed)


def travelling(bench, velocity=300.0):
    """Enable the axis and bring it to constant travel."""
    axis = bench.axis()
    power = axis.power()
    assert bench.run_until(power.status, 3.0)
    job = axis.move_velocity(velocity)
    assert bench.run_until(job.in_velocity, 3.0)
    bench.run_for(0.1)
    return axis, power


# -- stop modes
# ------------------------------------------------------------------------------------------------------

CASES = [
    pytest.param(
        name, case, id=f"{name}-{case.identifier}", marks=pytest.mark.requirement(*case.requirements)
    )
    for name in ("analog", "stepper")
    for stop, phase in sampled_stops()
    for case in [stop_modes.CAMPAIGN[f"stop-modes/{stop}/{phase}"]]
]


@pytest.fixture(scope="module")
def files():
    """Return the embedded benches."""
    return {name: load_bench(name) for name in ("analog", "stepper")}


@pytest.mark.requirement("STP-297", "STP-330", "STP-332", "STP-377", "STP-398")
@pytest.mark.parametrize(("name", "case"), CASES)
def test_stop_modes(name, case, files):
    """Every stop, and every ramp in every phase, pass on an analog drive and on a stepper motor, with all
    always-on checkers.
    """
    result = execute_case(case, files[name], CaseSettings(seed=1)).result
    assert result.verdict is Verdict.PASSED, result.message


@pytest.mark.parametrize("name", ["analog", "stepper"])
def test_same_seed_same_trace(name):
    """Two runs of the same motion leave the same bytes."""
    digests = set()
    for _ in range(2):
        with load_bench(name).build(seed=3) as bench:
            travelling(bench)
            digests.add(bench.trace().digest())
    assert len(digests) == 1


# -- stations
# --------------------------------------------------------------------------------------------------------


def test_a_station_is_part_of_the_bench():
    """Channels by number, columns in the record, requests in the log of the segment, events by its name."""
    with load_bench("analog").build(seed=1) as bench:
        axis, power = travelling(bench)
        assert bench.station_names == ("io",)
        assert bench.station("io").input(0).value
        assert bench.station().output(0).level
        assert bench.station().analog_output(0).value == pytest.approx(6.0, abs=0.02)
        bench.station().input(2).set(True)
        bench.run_for(0.05)
        assert axis.var("ErrorDetail.Number") == 531
        with pytest.raises(ConfigurationError, match=r"0\.\.3"):
            bench.station().input(4)
        with pytest.raises(ConfigurationError, match="io"):
            bench.station("oi")
        trace = bench.trace()
        assert {"io.inputs", "io.outputs", "io.ao0", "io.count0", "io.powered", "io.substituted"} <= set(
            trace.names()
        )
        assert "io" in bench.component_names
        assert any(frame.bus == "net0" for frame in trace.frames)
        assert [event.kind for event in bench.history.events if event.source == "io"] == ["station.up"]
    del power


def test_switches_of_any_drive_at_a_station():
    """Switches and encoder of a CiA 402 drive can be wired to a station, and its axis may take the switches
    from there.
    """
    text = (
        read("reference")[1].replace('drive = "drive1"\n', 'drive = "drive1"\ninputs = "io"\n')
        + STATION_AT_A_SERVO
    )
    with built(text) as bench:
        axis, _ = travelling(bench)
        assert bench.station().counter(0).count == bench.drive().encoder.increments
        Injector(bench).inject("switch.stuck", input="positive_limit", state=True)
        bench.run_for(0.02)
        assert bench.station().input(2).value
        assert axis.var("ErrorDetail.Number") == 531
    with built(text) as bench:
        axis, _ = travelling(bench)
        Injector(bench).inject("io.wire_break", "io", number=2)
        Injector(bench).inject("switch.stuck", input="positive_limit", state=True)
        bench.run_for(0.1)
        assert bench.drive().digital_inputs.value & 2
        assert axis.var("ErrorDetail.Number") == 0  # what is at the drive does not count for this axis


@pytest.mark.requirement("TA-020", "DIA-024", "DIA-063", "VAR-083")
def test_a_station_with_switches_fails():
    """401 with reaction 4 and X13: an axis in operation cannot read its switches; a disabled one does not
    mind.
    """
    text = (
        read("reference")[1].replace('drive = "drive1"\n', 'drive = "drive1"\ninputs = "io"\n')
        + STATION_AT_A_SERVO
    )
    with built(text) as bench:
        Injector(bench).inject("io.power_off", "io", duration_s=0.2)
        bench.run_for(0.5)
        assert bench.axis().var("ErrorWord") == 0
        axis, power = travelling(bench)
        Injector(bench).inject("io.power_off", "io", duration_s=2.0)
        assert bench.run_until(lambda: axis.var("ErrorDetail.Number") == 401, 0.5)
        bench.run_for(1.0)
        assert (axis.var("ErrorDetail.Reaction"), axis.var("ErrorWord")) == (4, 1 << 13)
        assert axis.diagnosis().pages["errors"]["I/O"] is True
        (raised,) = bench.trace().select(kind="alarm.raised", source="axis1")
        assert raised.data["info"] == 2
        axis.reset()
        bench.run_for(0.1)
        assert axis.var("ErrorDetail.Number") == 401  # the station is still away
        bench.run_for(2.0)
        axis.reset()
        assert bench.run_until(power.status, 1.0)
        assert axis.var("ErrorWord") == 0


def test_two_stations_on_a_serial_line():
    """Stations share a line under different units; the exchange of a cycle takes as long as the line
    needs.
    """
    text = (
        ANALOG.replace('kind = "modbus_tcp"', 'kind = "modbus_rtu"\nbaud = 115200')
        .replace("cycle_ms = 4", "cycle_ms = 24")
        .replace("watchdog_ms = 20.0", "watchdog_ms = 200.0")
        + '\n[station.door]\nsegment = "net0"\nunit = 2\ndigital_inputs = ["", ""]\n'
    )
    text = text.replace('"FollowingError.MinValue" = 2.0', '"FollowingError.MinValue" = 20.0').replace(
        '"FollowingError.MaxValue" = 10.0', '"FollowingError.MaxValue" = 40.0'
    )
    text = text.replace('"PositionControl.Kv" = 20.0', '"PositionControl.Kv" = 5.0')
    with built(text) as bench:
        axis, _ = travelling(bench, 100.0)
        bench.station("door").input(1).set(True)
        bench.run_for(0.1)
        assert bench.station_link("door").input(1)
        assert axis.var("ErrorDetail.Number") == 0


# -- faults
# ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "parameters", "number"),
    [
        ("io.stuck", {"channel": "input", "number": 0, "value": 0.0}, 421),
        ("io.wire_break", {"channel": "input", "number": 0}, 421),
        ("io.wire_break", {"channel": "output", "number": 0}, 421),
        ("io.stuck", {"channel": "input", "number": 2, "value": 1.0}, 531),
        ("io.bounce", {"number": 2, "pulses": 3}, 531),
        ("io.swapped", {"channel": "input", "number": 0, "other": 2}, 421),
        ("io.wire_break", {"channel": "counter"}, 521),
        ("io.analog", {"gain": -1.0}, 521),
        ("io.power_off", {}, 431),
        ("terminal.ready_stuck", {"level": False}, 421),
        ("drive.fault", {"code": 0x2310}, 421),
        ("drive.sto", {}, 421),
    ],
)
def test_faults_of_a_station_and_what_the_axis_says(kind, parameters, number):
    """Each fault leads to the alarm that a technician would see, and leaves its mark in the log."""
    with load_bench("analog").build(seed=1) as bench:
        axis, _ = travelling(bench)
        Injector(bench).inject(kind, **parameters)
        bench.run_for(0.6)
        numbers = [event.data["number"] for event in bench.history.select(kind="alarm.raised")]
        assert number in numbers, numbers
        assert axis.var("StatusWord.X1")
        assert [event.data["fault"] for event in bench.history.select(kind="fault.applied")] == [kind]


@pytest.mark.parametrize(
    ("kind", "parameters"),
    [
        ("io.stuck", {"channel": "input", "number": 0, "value": 1.0}),
        ("io.analog", {"offset_V": 0.05}),
        ("io.analog", {"noise_V": 0.02}),
        ("io.bounce", {"number": 3}),
        ("io.swapped", {"channel": "input", "number": 1, "other": 3}),
    ],
)
def test_faults_that_an_axis_lives_with(kind, parameters):
    """A small drift is controlled away, a stuck ready signal is not seen while the drive is ready; afterwards
    all is right.
    """
    with load_bench("analog").build(seed=1) as bench:
        axis, _ = travelling(bench)
        Injector(bench).inject(kind, duration_s=0.3, **parameters)
        bench.run_for(0.25)
        assert axis.var("ErrorDetail.Number") == 0
        if "offset_V" in parameters:
            speed = bench.drive().mechanics.velocity * 1000.0
            assert speed == pytest.approx(300.0, abs=0.5)
            # 0.05 V are 2.5 mm/s, which Kv = 20/s makes of an eighth of a millimetre
            assert axis.var("StatusServo.ControlDifference") == pytest.approx(-0.125, abs=0.03)
        bench.run_for(0.5)
        assert axis.var("StatusServo.ControlDifference") == pytest.approx(0.0, abs=0.02)


def test_outputs_that_are_stuck():
    """An enable that cannot be taken away: the drive holds 0 V with its torque, and the record shows both."""
    with load_bench("analog").build(seed=1) as bench:
        axis, power = travelling(bench)
        Injector(bench).inject("io.stuck", channel="output", number=0, value=1.0)
        axis.power(False, stop_mode=1)
        bench.run_for(1.0)
        assert not power.Status
        assert bench.drive().core.enabled
        trace = bench.trace()
        assert trace["io.outputs"].values[-1] == 1
        assert trace["drive1.setpoint_voltage"].values[-1] == 0.0


@pytest.mark.requirement("PTO-305", "PTO-306")
@pytest.mark.parametrize(
    ("kind", "parameters", "numbers"),
    [
        ("pto.output_short", {}, {411, 421}),
        ("pto.output_short", {"channel": 1}, {411, 421}),
        ("pto.supply_off", {}, {411, 421}),
        ("pto.module_fault", {}, {421}),
        ("pto.encoder_error", {"code": 1}, {411}),
        ("terminal.ready_stuck", {"level": False}, {421}),
        ("drive.power_off", {}, {431}),
        ("drive.fault", {"code": 1}, {421}),
    ],
)
def test_faults_of_a_pulse_module(kind, parameters, numbers):
    """Each fault of the module raises its alarms; when it is over the axis can be acknowledged and works
    again.
    """
    with load_bench("stepper").build(seed=1) as bench:
        axis, power = travelling(bench)
        faults = Injector(bench)
        faults.inject(kind, **({} if kind == "drive.fault" else {"duration_s": 0.3}), **parameters)
        bench.run_for(0.2)
        raised = {event.data["number"] for event in bench.history.select(kind="alarm.raised")}
        assert numbers <= raised
        bench.run_for(1.0)
        axis.reset()
        assert bench.run_until(power.status, 2.0)


@pytest.mark.requirement("PTO-280", "PTO-310")
@pytest.mark.parametrize(("kind", "parameters"), [("pto.step_loss", {"periods": 10}), ("mechanics.jam", {})])
def test_lost_steps_are_seen_in_the_record_only(kind, parameters):
    """No alarm; the record has the increments that are lost, and the position of the load with that of the
    axis.
    """
    with load_bench("stepper").build(seed=1) as bench:
        axis, _ = travelling(bench, 100.0)
        Injector(bench).inject(kind, **parameters)
        bench.run_for(0.5)
        assert axis.var("ErrorDetail.Number") == 0
        trace = bench.trace()
        behind = trace["axis1.actual_position"].values[-1] - trace["drive1.position"].values[-1] * 1000.0
        assert behind > 1.5
        if kind == "pto.step_loss":
            assert trace["drive1.lost_increments"].values[-1] == 10 * 4 * 10
        else:
            assert trace["drive1.out_of_step"].values[-1]


def test_an_encoder_on_the_shaft_of_a_stepper_motor():
    """An encoder with `mounting = "motor"` reads the shaft that the pulses turn, lost steps included."""
    encoder = """
[encoder.shaft]
segment = "can0"
node_id = 40
on = "drive1"
mounting = "motor"
steps_per_revolution = 4000
"""
    with built(STEPPER + encoder) as bench:
        travelling(bench, 100.0)
        Injector(bench).inject("pto.step_loss", periods=10)
        bench.run_for(0.5)
        trace = bench.trace()
        revolutions = trace["drive1.position"].values / 0.010
        shown = trace["shaft.position_value"].values / 4000.0
        assert revolutions[-1] > 5.0
        assert shown[-1] - shown[1] == pytest.approx(revolutions[-1] - revolutions[1], abs=0.05)
        assert trace["axis1.actual_position"].values[-1] / 10.0 - revolutions[-1] > 0.15


@pytest.mark.parametrize(
    ("module", "identifier", "reason"),
    [
        ("drive_faults", "drive-faults/trip/encoder-wire/standstill", "needs a drive with profile cia402 or"),
        ("cia402_drive", "cia402-drive/sync-lost/standstill", "drive1 is on net0"),
        ("commissioning", "commissioning/wire-break/jog", "drive1 has analog"),
        ("fault_reactions", "fault-reactions/corrupted-frames", "needs a drive on CAN"),
    ],
)
def test_cases_for_another_drive_are_blocked(module, identifier, reason, files):
    """A shipped case that an analog drive cannot have ends blocked, with what it needs."""
    case = load_campaign(f"testcases.campaigns.{module}:CAMPAIGN")[identifier]
    result = execute_case(case, files["analog"], CaseSettings(seed=1)).result
    assert (result.verdict, reason in result.message) == (Verdict.BLOCKED, True), result.message


def test_faults_where_there_is_nothing_to_break():
    """A bench without stations, a drive without pulses, a channel that does not exist: refused with the
    reason.
    """
    with load_bench("reference").build(seed=1) as bench:
        faults = Injector(bench)
        with pytest.raises(UnsupportedFaultError, match="no I/O station"):
            faults.inject("io.power_off")
        with pytest.raises(UnsupportedFaultError, match="short_outputs"):
            faults.inject("pto.output_short")
    with load_bench("analog").build(seed=1) as bench, pytest.raises(ConfigurationError, match=r"0\.\.0"):
        Injector(bench).inject("io.stuck", channel="output", number=1)


# -- messages
# --------------------------------------------------------------------------------------------------------

WRONG = [
    (
        ANALOG.replace('segment = "net0"\ndigital', 'segment = "net1"\ndigital'),
        "'net1' is not a segment on Modbus; there are: net0",
    ),
    (
        ANALOG.replace('"drive1.home"]', '"drive1.door"]'),
        "station.io.digital_inputs[3]: 'drive1.door' is no terminal for it",
    ),
    (
        ANALOG.replace("input_filter_ms = 0.1", "input_filters_ms = [6.4, 6.4]"),
        "station.io.input_filters_ms: 2 values; allowed: one for each of the 4 digital_inputs",
    ),
    (ANALOG.replace('"drive1.home"]', '"drive2.home"]'), "'drive2' is not a drive; there are: drive1"),
    (
        ANALOG.replace('"drive1.home"]', '"drive1.ready"]'),
        "'drive1.ready' is wired to station.io.digital_inputs[0] already",
    ),
    (
        ANALOG.replace('analog_outputs = ["drive1.setpoint"]', 'analog_outputs = [""]'),
        "its setpoint is wired to no station",
    ),
    (
        ANALOG.replace('counters = ["drive1.encoder"]', "counters = []"),
        "a positioning axis needs the encoder",
    ),
    (
        ANALOG.replace("off3_ramp_s = 0.5", "off3_ramp_s = 0.5\nnode_id = 5"),
        'node_id: a drive with profile = "analog" has none',
    ),
    (
        ANALOG.replace("off3_ramp_s = 0.5", 'off3_ramp_s = 0.5\nencoder = "absolute"'),
        "allowed: 'incremental'",
    ),
    (ANALOG.replace("[station.io]", "[station.net0]"), "a segment has this name already"),
    (ANALOG.replace("[station.io]", '[station."i.o"]'), "has no dot"),
    (
        ANALOG.replace('type = "positioning"', 'type = "positioning"\ninputs = "oi"'),
        "'oi' is not a station; there are: io",
    ),
    (
        ANALOG + '\n[segment.net1]\nkind = "modbus_tcp"\n[station.b]\nsegment = "net1"\ndigital_outputs = '
        '["drive1.enable"]\n',
        "wired to station.io.digital_outputs[0] already",
    ),
    (
        STEPPER.replace("node_id = 5", "node_id = 5\ntelegram = 105"),
        'telegram: a drive with profile = "tm_pto" has none',
    ),
    (
        STEPPER.replace("increments_per_revolution = 2000", "increments_per_revolution = 2001"),
        "stepper increments: 2001",
    ),
    (
        STEPPER.replace("increments_per_revolution = 2000", "increments_per_revolution = 10000"),
        "maximum_speed: 3000.0",
    ),
    (
        read("reference")[1] + "\n[drive.drive1.tm_pto]\nuse_ed = false\n",
        'it is a key of a drive with profile = "tm_pto"',
    ),
    (
        read("reference")[1].replace('drive = "drive1"\n', 'drive = "drive1"\ninputs = "io"\n')
        + STATION_AT_A_SERVO.replace("drive1.negative_limit", "")
        .replace("drive1.positive_limit", "")
        .replace("drive1.home", ""),
        "no switch of 'drive1' is wired to station.io",
    ),
]


@pytest.mark.parametrize(("text", "message"), WRONG, ids=[message[:40] for _, message in WRONG])
def test_mistakes_are_reported(text, message):
    """Every mistake in stations, wires and profiles is reported with place, value and what is allowed."""
    with pytest.raises(BenchFileError) as caught:
        parse(text, "bench.toml")
    assert message in str(caught.value)
