"""Encoders of the bench file: place on the machine, record, start, frames in words, faults."""

from __future__ import annotations

import math
import struct

import canopen
import numpy as np
import pytest

from fieldbus.canopen import PumpedNetwork
from fieldbus.clock import MS
from hil.bench import BenchFile, BenchFileError, load_bench
from hil.errors import ConfigurationError, UnsupportedFaultError
from hil.faults import Injector, after, on_event, velocity
from hil.faults.kinds.encoder import ALARM_BITS, WARNING_BITS

ENCODERS = """
[encoder.motor]
segment = "can0"
node_id = 20
on = "drive1"
steps_per_revolution = 131072
revolutions = 1024
offset_deg = 36000.0
cyclic_timer_ms = 10

[encoder.wheel]
segment = "can0"
node_id = 21
on = "drive1"
mounting = "load"
mm_per_revolution = 100.0
gear_numerator = 2
reversed = true
offset_deg = 36000.0

[encoder.scale]
segment = "can0"
node_id = 22
type = "absolute_linear"
on = "drive1"
mounting = "load"

[encoder.own]
segment = "can0"
node_id = 23
type = "incremental_rotary_counting"

[encoder.own.shaft]
speed_rpm = 600.0
"""
REFERENCE = load_bench("reference").text


def build(extra: str = ENCODERS, **options):
    return BenchFile("own.toml", REFERENCE + extra).build(**options)


def move(bench, speed: float, seconds: float) -> None:
    axis = bench.axis()
    power = axis.power()
    assert bench.run_until(power.status, timeout=2.0)
    axis.move_velocity(speed)
    bench.run_for(seconds)


@pytest.fixture
def bench():
    with build() as one:
        yield one


# -- place
# ---------------------------------------------------------------------------------------------------------


@pytest.mark.exhaustive
def test_each_encoder_shows_where_the_machine_is(bench):
    """Motor side, load side, scale and own shaft: the recorded positions follow the true mechanics all the
    way.
    """
    move(bench, 200.0, 1.0)
    trace = bench.trace()
    metres = trace["drive1.position"].values
    assert metres.max() > 0.1

    def off(name: str, wanted: np.ndarray) -> float:
        return float(np.abs(trace[f"{name}.position_value"].values[1:] - wanted[1:]).max())

    assert off("motor", (100 + metres / 0.010) * 131072) <= 1
    assert off("wheel", (100 - 2 * metres / 0.1) * 8192) <= 1
    assert off("scale", (1.0 + metres) * 1e6) <= 1
    own = trace["own.position_value"]
    assert own.values[-1] == pytest.approx(own.time_s[-1] * 10 * 8192, abs=100)
    assert trace["scale.speed_value"].values[-1] == pytest.approx(200, abs=2)


@pytest.mark.exhaustive
def test_profile_of_an_own_shaft():
    """The shaft goes through its profile, with linear changes of speed, and repeats it."""
    extra = """
[encoder.own]
segment = "can0"
node_id = 23
[encoder.own.shaft]
profile = [[0.5, 120.0], [0.5, 120.0], [0.0, -60.0], [1.0, 0.0]]
repeat = true
"""
    with build(extra) as bench:
        bench.run_for(6.0 - bench.now_s)
        coordinate = bench.trace()["own.coordinate"]
        turns = [coordinate.at(time_s) / (2 * math.pi) for time_s in (0.5, 1.0, 1.5, 2.0, 4.0, 6.0)]
    # 120 rpm are 2 turns per second: 0.5 turns on the ramp, 1 at speed, 0.5 back while it runs down from -60
    # rpm.
    assert turns == pytest.approx([0.5, 1.5, 1.5 - 0.375, 1.0, 2.0, 3.0], abs=0.01)


@pytest.mark.exhaustive
def test_own_shaft_is_moved_by_a_test(bench):
    """`turn_shaft` and `place_shaft` move the shaft of an encoder; one on a machine has none."""
    own = bench.encoder("own")
    own.turn_shaft(0.0)
    own.place_shaft(math.pi)
    bench.run_for(0.1)
    start = bench.trace()["own.coordinate"].values[-1]
    own.turn_shaft(-2 * math.pi, 0.2)
    bench.run_for(1.0)
    assert start == pytest.approx(math.pi)
    assert bench.trace()["own.coordinate"].values[-1] == pytest.approx(math.pi - 0.9 * 2 * math.pi, abs=0.03)
    with pytest.raises(UnsupportedFaultError, match="no shaft of its own"):
        bench.encoder("scale").turn_shaft(1.0)


# -- controller
# ----------------------------------------------------------------------------------------------------


@pytest.mark.exhaustive
@pytest.mark.requirement("C406-009", "C406-010", "C301-016")
def test_encoders_are_started_and_send(bench):
    """All encoders are Operational when the bench is ready: TPDO2 with every SYNC, TPDO1 by its own timer."""
    assert [bench.encoder(name).slave.nmt_state.name for name in bench.encoder_names] == ["OPERATIONAL"] * 4
    begin = bench.scheduler.now
    bench.run_for(0.4)
    counts: dict[int, int] = {}
    for time_ns, _, frame, _ in bench.segment().log:
        if time_ns > begin:
            counts[frame.can_id] = counts.get(frame.can_id, 0) + 1
    assert [counts[0x280 + node] for node in (20, 21, 22, 23)] == [counts[0x80]] * 4 == [100] * 4
    assert counts[0x194] == 40
    assert 0x195 not in counts


@pytest.mark.exhaustive
def test_encoder_is_started_again_after_a_loss_of_supply(bench):
    """After its boot-up the encoder gets NMT start, and an incremental one begins at zero."""
    faults = Injector(bench)
    faults.inject("encoder.power_off", "own", duration_s=0.1)
    bench.run_for(0.05)
    assert bench.trace()["own.nmt_state"].text_at(bench.now_s) == "INITIALISING"
    bench.run_for(0.06)
    assert bench.encoder("own").slave.nmt_state.name == "OPERATIONAL"
    assert bench.encoder("own").channels[0].position < 0.02 * 10 * 8192


@pytest.mark.exhaustive
def test_encoder_and_commissioning_tools(bench):
    """The canopen library configures an encoder on the running bench by its EDS."""
    from emulators.encoder.cia406 import EDS

    with PumpedNetwork(bench.segment(), name="tool") as network:
        sdo = network.add_node(22, canopen.import_od(str(EDS["linear"].path), 22)).sdo
        sdo[0x6003].raw = 5000
        assert sdo[0x6004].raw == 5000
        assert sdo[0x1000].raw == 0x00080196
    assert bench.trace().select(kind="encoder.preset", source="scale")


@pytest.mark.exhaustive
@pytest.mark.requirement("C301-164")
def test_frames_in_words(bench):
    """Frames of an encoder are described with its own objects, those of the drive with the drive's, where
    numbers collide.
    """
    from fieldbus.can import CanFrame

    assert bench.decode(CanFrame(0x280 + 20, struct.pack("<i", -5))) == "TPDO2 motor: Position value -5"
    assert (
        bench.decode(CanFrame(0x600 + 22, bytes.fromhex("4040600100000000")))
        == "SDO scale read 6040h:1 Acceleration value:1"
    )
    answer = bench.decode(CanFrame(0x580 + 22, bytes.fromhex("4B40600107000000")))
    assert answer.endswith("Acceleration value:1 = 7")
    drive = bench.decode(CanFrame(0x600 + 5, bytes.fromhex("2B4060000F000000")))
    assert "Controlword = 000Fh (enable operation)" in drive
    warning = bench.decode(CanFrame(0x600 + 23, bytes.fromhex("4005650000000000")))
    warning = bench.decode(CanFrame(0x580 + 23, bytes.fromhex("4B05650021000000")))
    assert warning.endswith("Warnings = 0021h (frequency exceeded, reference point not reached)")
    assert bench.decode(CanFrame(0x80 + 22, bytes.fromhex("0010210100000000"))).startswith("EMCY scale 1000h")


@pytest.mark.exhaustive
def test_same_bytes_twice():
    """Two runs with encoders, noise included, leave the same trace."""

    def run() -> str:
        with build(seed=3) as bench:
            Injector(bench).inject("encoder.noise", "wheel", increments=5)
            move(bench, 100.0, 0.3)
            return bench.trace().digest()

    assert run() == run()


def test_bench_without_encoders_has_none():
    """Asking for an encoder that is not there says so."""
    with load_bench("reference").build() as bench:
        assert bench.encoder_names == ()
        with pytest.raises(ConfigurationError, match="encoder"):
            bench.encoder()
        with pytest.raises(UnsupportedFaultError, match="no encoder with a node"):
            Injector(bench).inject("encoder.preset", "drive1", value=1)


def test_an_encoder_without_index_cannot_miss_it(bench):
    """Refused for absolute encoders, at once or when the trigger comes, and then there is nothing to take
    back.
    """
    injector = Injector(bench)
    with pytest.raises(UnsupportedFaultError, match="wheel: an absolute encoder has no index"):
        injector.inject("encoder.index_missing", "wheel")
    armed = injector.inject("encoder.index_missing", "wheel", trigger=after(0.01))
    with pytest.raises(UnsupportedFaultError, match="no index"):
        bench.run_for(0.02)
    assert armed.over
    assert not armed.active
    injector.remove_all()


# -- faults
# --------------------------------------------------------------------------------------------------------


@pytest.mark.requirement("C402-312")
@pytest.mark.parametrize("target", ["drive1", "scale"])
def test_sensor_faults_hit_drive_and_encoder(target):
    """Freeze and jump show in the value of the encoder that is named, and in no other."""
    columns = {"drive1": "drive1.encoder_increments", "scale": "scale.position_value"}
    other = columns["scale" if target == "drive1" else "drive1"]
    with build() as bench:
        faults = Injector(bench)
        before = {name: bench.trace()[name].values[-1] for name in columns.values()}
        faults.inject("encoder.jump", target, increments=700)
        bench.run_for(0.02)
        after = bench.trace()
        assert after[columns[target]].values[-1] == before[columns[target]] + 700
        assert after[other].values[-1] == before[other]
        armed = faults.inject("encoder.freeze", target, duration_s=0.05)
        assert armed.target == target
        bench.run_for(0.1)
        assert armed.over


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-312")
def test_faults_of_an_encoder_while_the_axis_moves(bench):
    """Freeze, noise, reversal and lost steps between trigger and end, measured on the scale against the true
    machine.
    """
    faults = Injector(bench)
    move(bench, 100.0, 0.5)

    def error() -> np.ndarray:
        trace = bench.trace()
        return (
            trace["scale.position_value"].values[-20:] - (1.0 + trace["drive1.position"].values[-20:]) * 1e6
        )

    assert np.abs(error()).max() <= 1
    frozen = faults.inject("encoder.freeze", "scale")
    bench.run_for(0.1)
    assert np.diff(error()) == pytest.approx(-400, abs=2)
    frozen.remove()
    noisy = faults.inject("encoder.noise", "scale", increments=20)
    bench.run_for(0.1)
    assert 5 < np.abs(error()).max() <= 21
    assert np.std(error()) > 3
    noisy.remove()
    lossy = faults.inject("encoder.step_loss", "scale", every=10)
    bench.run_for(0.1)
    assert error()[-1] == pytest.approx(-1000, abs=50)  # of 10 mm, less what has moved since the last sample
    lossy.remove()
    bench.run_for(0.1)
    assert error()[-1] == pytest.approx(-1000, abs=2)
    assert np.abs(np.diff(error())).max() <= 1
    reverse = faults.inject("encoder.reverse", "scale")
    bench.run_for(0.1)
    assert np.diff(error()) == pytest.approx(-800, abs=3)
    reverse.remove()


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-312")
def test_preset_during_motion_and_overflow(bench):
    """A preset that a velocity triggers, and an overflow: the position jumps, then wraps at the end of
    6002h.
    """
    faults = Injector(bench)
    faults.inject("encoder.preset", "scale", trigger=velocity(50.0), value=123_456)
    faults.inject("encoder.overflow", "scale", trigger=on_event("encoder.preset", "scale"), margin=2)
    move(bench, 100.0, 0.5)
    values = bench.trace()["scale.position_value"].values
    assert values.max() < 2_000_000
    wraps = np.flatnonzero(np.diff(values) < -1_000_000)
    assert len(wraps) == 0 or values[wraps[0] + 1] < 1000
    assert values[-1] < 100_000, "it has wrapped and counts from zero"
    assert [event.data["value"] for event in bench.history.select(kind="encoder.preset")] == [
        123_456,
        1_999_998,
    ]


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-312", "C406-050")
def test_alarm_and_warning_bits(bench):
    """Alarm and warning come with the fault and go with it, as signal, event and EMCY; two at a time keep
    apart.
    """
    faults = Injector(bench)
    alarm = faults.inject("encoder.alarm", "scale")
    battery = faults.inject("encoder.warning", "scale", warning="battery_charge")
    light = faults.inject("encoder.warning", "scale", warning="light_control_reserve")
    bench.run_for(0.02)
    trace = bench.trace()
    assert (trace["scale.alarms"].values[-1], trace["scale.warnings"].values[-1]) == (1, 0b10010)
    battery.remove()
    alarm.remove()
    bench.run_for(0.02)
    trace = bench.trace()
    assert (trace["scale.alarms"].values[-1], trace["scale.warnings"].values[-1]) == (0, 0b00010)
    light.remove()
    codes = [event.data["code"] for event in trace.select(kind="emcy.raised", source="scale")]
    assert codes == [0x1000]
    for kind, bits in (("alarm", ALARM_BITS), ("warning", WARNING_BITS)):
        for name, bit in bits.items():
            one = faults.inject(f"encoder.{kind}", "scale", **{kind: name})
            bench.run_for(0.008)
            assert bench.trace()[f"scale.{kind}s"].values[-1] == 1 << bit
            one.remove()


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-312", "C402-310")
def test_missing_and_late_tpdos(bench):
    """`frame.drop` takes TPDOs of an encoder away by their name; `encoder.cycle` changes the period of
    TPDO1.
    """
    faults = Injector(bench)
    begin = bench.scheduler.now
    faults.inject("frame.drop", count=3, drive="motor", message="tpdo1")
    faults.inject("encoder.cycle", "motor", trigger=on_event("fault.removed"), duration_s=0.2, period_ms=50)
    bench.run_for(0.4)
    times = [
        time // MS for time, _, frame, _ in bench.segment().log if time > begin and frame.can_id == 0x194
    ]
    gaps = np.diff(times)
    assert gaps[:2] == pytest.approx(50, abs=1)
    assert gaps[6:] == pytest.approx(10, abs=1)
    with pytest.raises(ConfigurationError, match="rpdo1"):
        faults.inject("frame.drop", drive="motor", message="rpdo1")


@pytest.mark.exhaustive
def test_heartbeat_of_an_encoder(bench):
    """The heartbeat stays away as long as the fault lasts."""
    Injector(bench).inject("encoder.heartbeat_loss", "motor", duration_s=1.0)
    begin = bench.scheduler.now
    bench.run_for(1.5)
    times = [time for time, _, frame, _ in bench.segment().log if time > begin and frame.can_id == 0x714]
    assert len(times) == 5
    assert times[0] - begin >= 1000 * MS


ALONE = """
[bench]
name = "encoder alone"
kind = "{kind}"

[segment.can0]
{interface}
[encoder.own]
segment = "can0"
node_id = 23

[encoder.own.shaft]
speed_rpm = 60.0
"""


def test_bench_of_encoders_alone():
    """A virtual bench without drives starts its encoders and sends SYNC; what needs a drive says that there
    is none.
    """
    with BenchFile("own.toml", ALONE.format(kind="virtual", interface="")).build() as bench:
        bench.run_for(1.0)
        ids = [frame.can_id for _, _, frame, _ in bench.segment().log]
        assert ids.count(0x80) == ids.count(0x280 + 23) > 200
        assert bench.trace()["own.position_value"].values[-1] > 8000
        with pytest.raises(ConfigurationError, match="no drive"):
            bench.drive()
        with pytest.raises(ConfigurationError, match="no axis"):
            bench.axis()
    with pytest.raises(BenchFileError, match="neither a drive nor an encoder"):
        BenchFile("own.toml", '[bench]\nname = "x"\n[segment.can0]\n')


def test_encoders_of_somebody_elses_network_are_left_alone(request):
    """On a live segment without an axis the bench sends neither NMT nor SYNC; the encoder is started by its
    controller.
    """
    interface = f'interface = "virtual"\nchannel = "{request.node.name}"\n'
    text = ALONE.format(kind="live", interface=interface).replace(
        "[encoder.own.shaft]\nspeed_rpm = 60.0\n", ""
    )
    text = text.replace("node_id = 23", 'node_id = 23\ndevice = "physical"')
    with BenchFile("own.toml", text).build() as bench:
        bench.run_for(0.1)
        assert [frame for _, _, frame, _ in bench.segment().log] == []
        with pytest.raises(UnsupportedFaultError, match="physical encoder"):
            bench.encoder()


# -- bench file
# ----------------------------------------------------------------------------------------------------

HEAD = '[encoder.a]\nsegment = "can0"\nnode_id = 20\n'


@pytest.mark.parametrize(
    ("extra", "words"),
    [
        (HEAD.replace("can0", "can9"), r"encoder.a.segment: 'can9' is not a segment; there are: can0"),
        (HEAD.replace("20", "5"), r"encoder.a.node_id: 5 is already taken by drive.drive1"),
        (
            HEAD + HEAD.replace("encoder.a", "encoder.b"),
            r"encoder.b.node_id: 20 is already taken by encoder.a",
        ),
        (HEAD.replace("encoder.a", "encoder.drive1"), r"encoder.drive1: a drive has this name already"),
        (HEAD.replace("encoder.a", "encoder.axis1"), r"encoder.axis1: an axis has this name already"),
        (HEAD.replace("encoder.a", 'encoder."a.b"'), r"encoder.'a.b': a name is not empty and has no dot"),
        (HEAD + 'on = "drive9"\n', r"encoder.a.on: 'drive9' is not a drive; there are: drive1"),
        (
            HEAD + 'type = "resolver"\n',
            r"encoder.a.type: 'resolver' is not allowed; allowed: 'single_turn', .*'multi_sensor'",
        ),
        (
            HEAD + "length_mm = 3.0\n",
            r"encoder.a.length_mm: a rotary encoder .* has none; it is a key of a linear encoder",
        ),
        (
            HEAD + 'type = "absolute_linear"\nrevolutions = 3\n',
            r"encoder.a.revolutions: a linear encoder .* has none; it is a key of a rotary encoder",
        ),
        (HEAD + 'type = "absolute_linear"\non = "drive1"\n', r"encoder.a.mounting: 'motor' is not allowed"),
        (HEAD + 'mounting = "load"\n', r"encoder.a.mounting: 'load' needs the drive"),
        (
            HEAD + 'on = "drive1"\nmm_per_revolution = 3.0\n',
            r"encoder.a.mm_per_revolution: only with mounting",
        ),
        (
            HEAD + 'on = "drive1"\n[encoder.a.shaft]\nspeed_rpm = 3.0\n',
            r"encoder.a.shaft: the encoder sits on drive1",
        ),
        (
            HEAD + "[encoder.a.shaft]\nspeed_mm_s = 3.0\n",
            r"encoder.a.shaft.speed_mm_s: the shaft of a rotary encoder has none; .* linear encoder",
        ),
        (
            HEAD + "[encoder.a.shaft]\nspeed_rpm = 3.0\nprofile = [[1.0, 2.0]]\n",
            r"encoder.a.shaft.profile: give either",
        ),
        (HEAD + "[encoder.a.shaft]\nrepeat = true\n", r"encoder.a.shaft.repeat: true needs a profile"),
        (HEAD + "[encoder.a.shaft]\nprofile = [[-1.0, 2.0]]\n", r"encoder.a.shaft.profile"),
        (
            HEAD + "[encoder.a.shaft]\nspeed = 1.0\n",
            r"unknown key; did you mean speed_rpm\? allowed: profile, repeat, speed_rpm",
        ),
        (
            HEAD + "steps_per_revolution = 16777216\n",
            r"encoder.a.revolutions: 4096 is not allowed.*2147483648 steps",
        ),
        (HEAD + 'device = "physical"\n', r"encoder.a: a virtual bench cannot hold a physical encoder"),
        (HEAD + "speed = 1\n", r"encoder.a.speed: unknown key; allowed: profile, device, segment"),
    ],
)
def test_mistakes_in_the_bench_file(extra, words):
    """Every mistake is reported with key, value and what is allowed."""
    with pytest.raises(BenchFileError, match=words):
        BenchFile("own.toml", REFERENCE + extra)
