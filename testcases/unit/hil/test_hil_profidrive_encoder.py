"""PROFIdrive encoders in a bench: devices of their own with telegrams 81 to 84, second encoders of drives,
their errors.
"""

from __future__ import annotations

import math

import canopen
import pytest

from fieldbus.canopen import PumpedNetwork
from fieldbus.errors import ConfigurationError, UnsupportedFaultError
from fieldbus.profidrive.words import ENCODER_ERRORS
from hil.bench import BenchFile, BenchFileError, load_bench
from hil.faults import Injector

pytestmark = pytest.mark.exhaustive

ENCODERS = """
[encoder.wheel]
segment = "can0"
node_id = 20
profile = "profidrive"
on = "drive1"
mounting = "load"
type = "incremental_rotary"
steps_per_revolution = 1024
mm_per_revolution = 100.0

[encoder.wheel.profidrive]
telegram = {telegram}
fine_xist1_bits = 8
reference_speed = 600.0

[encoder.scale]
segment = "can0"
node_id = 21
profile = "profidrive"
on = "drive1"
mounting = "load"
type = "absolute_linear"
measuring_step_um = 20.0

[encoder.own]
segment = "can0"
node_id = 22
profile = "profidrive"
type = "multi_turn"

[encoder.own.profidrive]
sign_of_life = false

[encoder.own.shaft]
speed_rpm = 600.0
"""
SECOND = """
[drive.drive1.encoder2]
type = "incremental_linear"
measuring_step_um = 20.0
"""
SEARCH, READ, MEASURE, ABSOLUTE, PARK, ACKNOWLEDGE = 0x0011, 0x0020, 0x0080, 0x2000, 0x4000, 0x8000
FINE = 1024 * 256


def build(telegram=83, extra="", name="reference"):
    return BenchFile("own.toml", load_bench(name).text + ENCODERS.format(telegram=telegram) + extra).build(
        seed=3
    )


def build_second(telegram=106):
    text = load_bench("profidrive").text.replace("telegram = 105", f"telegram = {telegram}")
    return BenchFile("own.toml", text.replace("[axis.axis1]\n", f"{SECOND}\n[axis.axis1]\n")).build(seed=3)


def move(bench, speed, seconds):
    power = bench.axis().power()
    assert bench.run_until(power.status, timeout=2.0)
    bench.axis().move_velocity(speed)
    bench.run_for(seconds)


# -- devices of their own
# ----------------------------------------------------------------------------------------------


@pytest.mark.requirement(
    "PD-010", "PD-011", "PD-012", "PD-013", "PD-084", "PD-126", "CFG-236", "CFG-237", "CFG-306"
)
@pytest.mark.parametrize("telegram", [81, 82, 83, 84])
def test_every_telegram_on_the_bus(telegram):
    """Position, speed and the other words come with every SYNC; the wheel of 100 mm follows the true load to
    the increment.
    """
    with build(telegram) as bench:
        port = bench.encoder_port("wheel")
        move(bench, 250.0, 0.6)
        bench.run_for(0.002)  # the cycle of the controller is half a bus cycle behind SYNC
        at = (
            [time for time, _, frame, _ in bench.segment().log if frame.can_id == 0x80][-1]
            // 4_000_000
            * 0.004
        )
        metres = bench.trace()["drive1.position"].at(at)
        start = bench.trace()["drive1.position"].values[0]
        now = port.increments
        assert now == pytest.approx((metres - start) / 0.1 * FINE, abs=1)
        assert port.link_ok
        assert not port.sensor_fault
        # 250 mm/s are 2.5 turns per second, 150 of 600 rpm.
        assert port.speed == (None if telegram == 81 else pytest.approx(0.25, abs=0.001))
        word = port.actual("ZSW2_ENC")
        assert word & 0x0FFF == 0x0200
        assert word >> 12 != 0
        lengths = {}
        for _, _, frame, _ in list(bench.segment().log)[-200:]:
            lengths[frame.can_id] = len(frame.data)
        words = {81: 6, 82: 7, 83: 8, 84: 10}[telegram]
        assert [lengths.get(0x180 + 0x100 * n + 20) for n in range(3)] == [
            8,
            2 * min(words - 4, 4),
            4 if words == 10 else None,
        ]


@pytest.mark.requirement("PD-171", "PD-172", "PD-147", "CFG-302", "CFG-304")
def test_absolute_values_are_those_of_the_machine():
    """A scale with its zero in the middle: G1_XIST2 is the place in steps * 2^9, and G1_XIST1 begins with it
    in steps * 2^11.
    """
    with build() as bench:
        port = bench.encoder_port("scale")
        port.g1_stw = ABSOLUTE
        bench.run_for(0.02)
        steps = (bench.trace()["drive1.position"].values[-1] + 1.0) / 20e-6
        assert port.actual("G1_ZSW") == ABSOLUTE
        assert port.actual("G1_XIST2") % 2**32 == pytest.approx(steps * 2**9, abs=1)
        assert port.increments % 2**32 == pytest.approx(steps * 2**11, abs=1)
        move(bench, 200.0, 0.5)
        trace = bench.trace()
        coordinate, xist1 = trace["scale.coordinate"].values, trace["scale.g1_xist1"].values
        assert coordinate[-1] > 1.05
        assert abs(xist1 % 2**32 - coordinate / 20e-6 * 2**11)[2:].max() <= 0.2 * 0.0041 / 20e-6 * 2**11


@pytest.mark.requirement("PD-130")
def test_a_shaft_of_its_own_and_no_clock():
    """Without sign of life the counter is 0 and the link is good all the same; the shaft turns, and a test
    turns it otherwise.
    """
    with build() as bench:
        port = bench.encoder_port("own")
        bench.run_for(0.1)
        assert port.actual("ZSW2_ENC") >> 12 == 0
        before = port.increments
        bench.run_for(0.4)
        counts = 8192 << 11
        assert (port.increments - before) % 2**32 == pytest.approx(4.0 * counts, rel=1e-6)
        bench.encoder("own").turn_shaft(0.0)
        bench.encoder("own").place_shaft(math.pi)
        bench.run_for(0.02)
        still = port.increments
        bench.run_for(0.1)
        assert port.increments == still


@pytest.mark.requirement("PD-153", "PD-154", "PD-155", "PD-156", "PD-141", "PD-142")
def test_reference_mark_over_the_bus():
    """Search, wait, read: the mark of the wheel is shown in the format of G1_XIST1, the state is recorded."""
    with build() as bench:
        port = bench.encoder_port("wheel")
        move(bench, 250.0, 0.1)
        port.g1_stw = SEARCH
        assert bench.run_until(lambda: port.actual("G1_ZSW") == 1, 0.1)
        assert bench.run_until(lambda: port.actual("G1_ZSW") == 0, 1.0)
        port.g1_stw = 0
        bench.run_for(0.02)
        port.g1_stw = READ | 1
        bench.run_for(0.02)
        assert port.actual("G1_ZSW") == 0x0010
        start = bench.trace()["drive1.position"].values[0]
        assert (port.actual("G1_XIST2") + start / 0.1 * FINE) % FINE == pytest.approx(0, abs=1)
        states = {bench.trace()["wheel.state"].text_at(time / 100) for time in range(int(bench.now_s * 100))}
        assert {text.split(" ")[0] for text in states} >= {"SD1", "SD5", "SD4"}


@pytest.mark.requirement("PD-157", "PD-158", "PD-159", "PD-160", "PD-144")
def test_flying_measurement_over_the_bus():
    """An edge of a probe is latched where the encoder is at that instant."""
    with build() as bench:
        port = bench.encoder_port("wheel")
        move(bench, 250.0, 0.1)
        port.g1_stw = MEASURE | 0x11
        bench.run_for(0.02)
        assert port.actual("G1_ZSW") & 0xFF == 1
        bench.encoder("wheel").device.probe_edge(1, True)
        metres = bench.drive().mechanics.position
        bench.run_for(0.02)
        port.g1_stw = MEASURE
        bench.run_for(0.02)
        port.g1_stw = MEASURE | READ | 1
        bench.run_for(0.02)
        assert port.actual("G1_ZSW") & 0xFF == 0x10
        start = bench.trace()["drive1.position"].values[0]
        assert port.actual("G1_XIST2") == pytest.approx((metres - start) / 0.1 * FINE, abs=1)


@pytest.mark.requirement("PD-151", "PD-168", "PD-148")
def test_parking_over_the_bus():
    """Parked: 4000h and zeros for at least 100 ms, not to be relied on; then it counts on."""
    with build() as bench:
        port = bench.encoder_port("own")
        port.g1_stw = PARK
        bench.run_for(0.02)
        assert (port.actual("G1_ZSW"), port.increments, port.sensor_fault) == (PARK, 0, True)
        port.g1_stw = 0
        bench.run_for(0.05)
        assert port.actual("G1_ZSW") == PARK
        bench.run_for(0.06)
        assert port.actual("G1_ZSW") == 0
        assert port.increments


@pytest.mark.requirement("PD-129", "PD-185", "PD-084")
def test_a_controller_that_counts_no_more():
    """When the sign of life of the controller stands still the encoder shows 0F02h and its fault bit."""
    with build() as bench:
        port = bench.encoder_port("wheel")
        bench.run_for(0.1)
        bench.runtime.after_cycle.remove(port.read)
        stuck = bytes((0x00, 0x14, 0x00, 0x00))  # control by PLC, and the same counter for ever
        bench.on_cycle(lambda: (bench.network().send(0x200 + 20, stuck), port._take()))
        bench.run_for(0.05)
        assert (port.actual("G1_ZSW"), port.actual("G1_XIST2")) == (0x8000, 0x0F02)
        assert port.actual("ZSW2_ENC") & 8
        assert [
            event.data["code"] for event in bench.trace().select(kind="encoder.error", source="wheel")
        ] == [0x0F02]


ASKS = {0x0003: PARK, 0x0004: SEARCH, 0x0006: MEASURE | 0x11, 0x0008: ABSOLUTE, 0x000A: ABSOLUTE}
"""What the controller asks for where an error needs it."""


@pytest.mark.requirement(
    "PD-175",
    "PD-176",
    "PD-177",
    "PD-178",
    "PD-179",
    "PD-180",
    "PD-181",
    "PD-182",
    "PD-183",
    "PD-184",
    "PD-185",
    "PD-186",
    "PD-152",
    "PD-164",
    "PD-165",
    "PD-149",
    "PD-349",
)
@pytest.mark.parametrize("code", ENCODER_ERRORS, ids=lambda code: f"{code:04X}h")
def test_every_error_can_be_injected(code):
    """`encoder.error` shows the code in G1_XIST2 with bit 15, EMCY, record and event; repaired and
    acknowledged it is gone.
    """
    with build() as bench:
        port = bench.encoder_port("scale")
        faults = Injector(bench)
        if code in {0x0005, 0x0007}:
            # A value has to be shown for its retrieval to be aborted.
            encoder = bench.encoder("scale")
            mode = MEASURE if code == 7 else 0
            port.g1_stw = mode | 0x11
            bench.run_for(0.02)
            if mode:
                encoder.device.probe_edge(1, True)
            else:
                encoder.interface.reference_mark(1, 1000)
            bench.run_for(0.02)
            port.g1_stw = mode
            bench.run_for(0.02)
            port.g1_stw = mode | READ | 1
            bench.run_for(0.02)
            assert port.actual("G1_ZSW") & 0xFF == 0x10
        else:
            port.g1_stw = ASKS.get(code, 0)
        armed = faults.inject("encoder.error", "scale", code=code)
        bench.run_for(0.05)
        assert (port.actual("G1_ZSW"), port.actual("G1_XIST2")) == (0x8000, code)
        assert port.sensor_fault
        assert bench.trace()["scale.error"].text_at(bench.now_s).startswith(f"{code:04X}h")
        emcys = [event.data["code"] for event in bench.history.events if event.kind == "emcy.raised"]
        assert emcys == [0x7300]
        armed.remove()
        port.g1_stw = ACKNOWLEDGE
        bench.run_for(0.02)
        port.g1_stw = 0
        bench.run_for(0.02)
        assert port.actual("G1_ZSW") in {0, PARK}
        assert port.actual("ZSW2_ENC") & 8  # the fault situation waits for STW2_ENC bit 7
        port.acknowledges = True
        bench.run_for(0.02)
        assert not port.actual("ZSW2_ENC") & 8
        assert [event.data["code"] for event in bench.trace().select(kind="encoder.error")] == [code, 0]


def test_fault_methods_of_an_encoder_of_its_own():
    """Freeze, jump, sign of life, supply: the controller sees what the encoder does."""
    with build() as bench:
        port = bench.encoder_port("wheel")
        faults = Injector(bench)
        move(bench, 100.0, 0.3)
        with_freeze = faults.inject("encoder.freeze", "wheel", duration_s=0.1)
        bench.run_for(0.05)
        held = port.increments
        bench.run_for(0.04)
        assert port.increments == held
        bench.run_for(0.1)
        assert with_freeze.over
        assert port.increments > held
        before = port.increments
        faults.inject("encoder.jump", "wheel", increments=500_000)
        bench.run_for(0.012)
        assert port.increments - before > 500_000
        bench.encoder("wheel").freeze_sign_of_life(True)
        bench.run_for(0.05)
        assert not port.link_ok
        bench.encoder("wheel").freeze_sign_of_life(False)
        restarts = port.encoder_restarts
        faults.inject("encoder.power_off", "wheel", duration_s=0.1)
        bench.run_for(0.5)
        assert port.link_ok
        assert port.encoder_restarts == restarts + 1
        assert port.increments < before + 100_000  # it began at zero again, without the jump
        with pytest.raises(UnsupportedFaultError, match="offers no set_alarm"):
            faults.inject("encoder.alarm", "wheel")


@pytest.mark.requirement("PD-188", "PD-192", "PD-193", "PD-343")
def test_its_parameters_over_sdo():
    """23D3h is r0979, 239Ah the telegram, 23C5h profile 3 version 4.1; a library reads them with the EDS."""
    from emulators.encoder.profidrive.eds import EDS

    assert EDS.path.read_text(encoding="ascii") == EDS.text()
    with build() as bench, PumpedNetwork(bench.segment(), name="tool") as network:
        sdo = network.add_node(21, canopen.import_od(str(EDS.path), 21)).sdo
        assert [sdo[0x23D3][at].raw for at in range(1, 7)] == [0x5112, 0xC000_0003, 20_000, 11, 9, 1]
        assert sdo[0x239A].raw == 81
        assert sdo[0x23C5].raw == 0x0329


def test_same_bytes_twice():
    """Two runs with noise leave the same trace."""

    def run():
        with build() as bench:
            Injector(bench).inject("encoder.noise", "wheel", increments=50)
            move(bench, 100.0, 0.2)
            return bench.trace().digest()

    assert run() == run()


EXTERNAL = """
[external_encoder.ext]
encoder = "wheel"

[external_encoder.ext.variables]
"Properties.MotionType" = 1
"""


@pytest.mark.requirement("CFG-198", "PD-012", "CFG-016")
@pytest.mark.parametrize("telegram", [81, 83])
def test_an_external_encoder_reads_it(telegram):
    """A technology object takes resolution and fine bits over and shows place and velocity of the wheel; its
    error is alarm 411.
    """
    with build(telegram, EXTERNAL) as bench:
        encoder = bench.external_encoder("ext")
        assert bench.run_until(encoder.power().status, timeout=1.0)
        move(bench, 250.0, 0.5)
        assert encoder.var("ActualVelocity") == pytest.approx(900.0, rel=0.01)
        before, metres = encoder.var("ActualPosition"), bench.drive().mechanics.position
        bench.run_for(0.2)
        turned = (bench.drive().mechanics.position - metres) / 0.1 * 360.0
        assert encoder.var("ActualPosition") - before == pytest.approx(turned, abs=0.5)
        Injector(bench).inject("encoder.error", "wheel", code=0x0001, duration_s=0.1)
        bench.run_for(0.05)
        assert bench.encoder_port("wheel").sensor_fault
        bench.run_for(0.5)
        assert not bench.encoder_port("wheel").sensor_fault
        alarms = [event.data["number"] for event in bench.trace().select(kind="alarm.raised", source="ext")]
        assert alarms == [411]


@pytest.mark.requirement("DIA-102")
def test_the_telegram_of_an_external_encoder():
    """`diagnosis` shows the words on the wire: control and status word, both values of the encoder."""
    with build(83, '[external_encoder.ext]\nencoder = "scale"\n') as bench:
        port = bench.encoder_port("scale")
        port.g1_stw = ABSOLUTE
        move(bench, 250.0, 0.2)
        words = bench.external_encoder("ext").diagnosis().telegram
        assert list(words) == ["STW2_ENC", "G1_STW", "ZSW2_ENC", "G1_ZSW", "G1_XIST1", "G1_XIST2"]
        assert words["G1_XIST1"] == port.actual("G1_XIST1") != 0
        assert words["G1_XIST2"] == port.actual("G1_XIST2") != 0
        assert (words["G1_STW"], words["G1_ZSW"] & ABSOLUTE) == (ABSOLUTE, ABSOLUTE)


@pytest.mark.requirement("TA-013", "TA-020")
def test_why_the_link_to_an_encoder_is_lost():
    """431 of the external encoder names its cause: the sign of life (4), the station (3)."""
    with build(83, EXTERNAL) as bench:
        encoder, wheel = bench.external_encoder("ext"), bench.encoder("wheel")
        assert bench.run_until(encoder.power().status, timeout=1.0)
        infos = []
        for break_it in (True, False):
            if break_it:
                wheel.freeze_sign_of_life(True)
            else:
                Injector(bench).inject("encoder.power_off", "wheel", duration_s=0.2)
            assert bench.run_until(lambda: encoder.var("ErrorDetail.Number") == 431, 0.2)
            infos.append(encoder.object.engine.highest.info)
            wheel.freeze_sign_of_life(False)
            bench.run_for(1.0)
            encoder.reset()
            bench.run_for(0.1)
            assert encoder.var("ErrorWord") == 0
        assert infos == [4, 3]


@pytest.mark.requirement("CFG-531", "CFG-532")
@pytest.mark.parametrize("inverse", [False, True])
def test_the_direction_of_counting(inverse):
    """G1_XIST1 falls while the axis moves positive: `Sensor.InverseDirection` turns the position round, not
    the count.
    """
    text = f'{EXTERNAL}"Sensor.InverseDirection" = {str(inverse).lower()}\n'
    with build(81, text) as bench:
        Injector(bench).inject("encoder.reverse", "wheel")
        encoder, port = bench.external_encoder("ext"), bench.encoder_port("wheel")
        bench.run_for(0.02)
        count = port.increments
        move(bench, 250.0, 0.5)
        assert port.increments < count
        assert encoder.var("ActualVelocity") == pytest.approx(900.0 if inverse else -900.0, rel=0.02)


NARROW = """
[encoder.counter]
segment = "can0"
node_id = 20
profile = "profidrive"
type = "incremental_rotary"
steps_per_revolution = 256

[encoder.counter.profidrive]
fine_xist1_bits = 8
counter_bits = 16

[encoder.counter.shaft]
speed_rpm = 600.0

[external_encoder.ext]
encoder = "counter"

[external_encoder.ext.variables]
"Properties.MotionType" = 1
"Sensor.Parameter.BehaviorGx_XIST1" = {behavior}
"""


@pytest.mark.requirement("PD-171", "CFG-309", "CFG-311")
@pytest.mark.parametrize("behavior", [0, 1])
def test_a_counter_of_16_bits(behavior):
    """It wraps at 65535: with BehaviorGx_XIST1 = 0 the position goes on, with 1 it jumps back by a revolution
    each time.
    """
    with BenchFile(
        "own.toml", load_bench("reference").text + NARROW.format(behavior=behavior)
    ).build() as bench:
        encoder = bench.external_encoder("ext")
        bench.run_for(0.02)
        start, before = bench.now_s, encoder.var("ActualPosition")
        seen = set()
        for _ in range(100):
            bench.run_for(0.004)
            seen.add(bench.encoder_port("counter").increments)
        assert 0 <= min(seen) < max(seen) <= 0xFFFF
        moved = encoder.var("ActualPosition") - before
        turned = (bench.now_s - start) * 3600.0
        if behavior == 0:
            assert moved == pytest.approx(turned, abs=1.0)
        else:
            assert abs(moved) <= 360.0


# -- second encoders
# ----------------------------------------------------------------------------------------------------


@pytest.mark.requirement(
    "CFG-207", "CFG-209", "CFG-211", "CFG-213", "CFG-228", "CFG-230", "CFG-232", "CFG-234"
)
@pytest.mark.parametrize("telegram", [4, 6, 103, 106])
def test_a_second_encoder_in_the_bench_file(telegram):
    """The axis moves with encoder 1, and G2_XIST1 shows the scale on its load, in the telegram and in the
    record.
    """
    with build_second(telegram) as bench:
        move(bench, 250.0, 0.5)
        trace = bench.trace()
        place = trace["drive1.position"].values
        shown = trace["drive1.g2_xist1"].values
        first = shown[5] / 2048 * 20e-6 - place[5]
        assert place[-1] - place[0] > 0.05
        assert abs(shown / 2048 * 20e-6 - place - first)[5:].max() < 0.25 * 0.004 + 1e-6
        assert bench.axis().port.actual("G2_ZSW") == 0
        assert bench.axis().port.actual("G2_XIST1") % 2**32 > 0


@pytest.mark.requirement("CFG-319", "CFG-603")
def test_its_faults_leave_the_axis_alone():
    """Errors, a broken wire, freezing: only G2 shows them; the axis goes on without an alarm."""
    with build_second() as bench:
        move(bench, 100.0, 0.3)
        port = bench.axis().port
        faults = Injector(bench)
        armed = faults.inject("encoder.error", "drive1.encoder2", code=0x1001)
        bench.run_for(0.02)
        # Bit 11 says that the axis, which reads both encoders, is acknowledging it.
        assert (port.actual("G2_ZSW") & ~0x0800, port.actual("G2_XIST2")) == (0x8000, 0x1001)
        armed.remove()
        faults.inject("encoder.wire_break", "drive1.encoder2", duration_s=0.1)
        faults.inject("encoder.freeze", "drive1.encoder2", duration_s=0.1)
        bench.run_for(0.3)
        assert bench.trace()["drive1.warning_number"].values.max() == 32410
        assert not list(bench.trace().select(kind="alarm.raised"))
        assert abs(bench.drive().mechanics.velocity) == pytest.approx(0.1, abs=1e-3)
        with pytest.raises(ConfigurationError, match="no encoder"):
            bench.encoder("drive2.encoder2")


@pytest.mark.requirement("CFG-604")
def test_an_error_of_the_first_one_stops_the_axis():
    """The same kind at the drive hits G1: alarm 411."""
    with build_second() as bench:
        move(bench, 100.0, 0.3)
        Injector(bench).inject("encoder.error", "drive1", code=0x0001)
        bench.run_for(0.1)
        assert [event.data["number"] for event in bench.trace().select(kind="alarm.raised")] == [411]
        bench.run_for(1.0)
        assert not bench.drive().core.enabled


def build_both(telegram=106):
    text = load_bench("profidrive").text.replace("telegram = 105", f"telegram = {telegram}")
    axis = f'{SECOND}\n[axis.axis1]\nencoders = ["drive1", "drive1.encoder2"]\n'
    return BenchFile("own.toml", text.replace("[axis.axis1]\n", axis)).build(seed=3)


@pytest.mark.requirement("CFG-282", "CFG-315", "CFG-207", "CFG-209", "CFG-211", "CFG-213")
@pytest.mark.parametrize("telegram", [4, 6, 103, 106])
def test_the_axis_reads_both_encoders_of_its_telegram(telegram):
    """Sensor[2] is the scale behind G2: both positions follow the load, each with its own resolution."""
    with build_both(telegram) as bench:
        axis = bench.axis()
        bench.run_for(0.1)
        start = [axis.var(f"StatusSensor[{n}].Position") for n in (1, 2)]
        before = bench.drive().mechanics.position
        move(bench, 200.0, 0.5)
        assert bench.run_until(axis.halt().done, 2.0)
        bench.run_for(0.2)
        way = (bench.drive().mechanics.position - before) * 1000.0
        moved = [
            axis.var(f"StatusSensor[{n}].Position") - place for n, place in zip((1, 2), start, strict=True)
        ]
        assert way > 50.0
        assert moved == pytest.approx([way, way], abs=0.02)


@pytest.mark.requirement("CFG-319", "CFG-603")
def test_the_encoder_that_does_not_lead_may_fail():
    """Its error shows in StatusSensor[2] alone; after the repair it is valid again, and the axis has moved
    on all the time.
    """
    with build_both() as bench:
        axis = bench.axis()
        move(bench, 100.0, 0.3)
        assert axis.var("StatusSensor[2].State") == 2
        Injector(bench).inject("encoder.error", "drive1.encoder2", code=0x0002, duration_s=0.1)
        bench.run_for(0.05)
        assert axis.var("StatusSensor[2].State") != 2
        assert axis.var("StatusSensor[1].State") == 2
        bench.run_for(0.2)
        assert axis.var("StatusSensor[2].State") == 2
        assert abs(bench.drive().mechanics.velocity) == pytest.approx(0.1, abs=1e-3)
        assert not list(bench.trace().select(kind="alarm.raised"))


def test_a_second_encoder_that_is_not_in_the_telegram():
    """The axis cannot read what is not there."""
    with pytest.raises(
        BenchFileError, match=r"'drive1.encoder2' needs encoder2 of 'drive1' and one of its telegrams 4, 6"
    ):
        build_both(105)


# -- mistakes
# ------------------------------------------------------------------------------------------------------------

HEAD = '[encoder.a]\nsegment = "can0"\nnode_id = 20\nprofile = "profidrive"\n'


@pytest.mark.parametrize(
    ("extra", "words"),
    [
        (
            HEAD + 'type = "multi_sensor"\n',
            r"encoder.a.type: 'multi_sensor' is not allowed; allowed: 'incremental_linear', .*'single_turn'",
        ),
        (
            HEAD + "cyclic_timer_ms = 5\n",
            r"encoder.a.cyclic_timer_ms: a rotary encoder with profile = .profidrive. has none; .*cia406",
        ),
        (
            HEAD.replace("profidrive", "cia406") + "[encoder.a.profidrive]\ntelegram = 81\n",
            r"encoder.a.profidrive: .* has none",
        ),
        (
            HEAD + "[encoder.a.profidrive]\ntelegram = 3\n",
            r"encoder.a.profidrive.telegram: 3 is not allowed; allowed: 81, 82",
        ),
        (
            HEAD + "[encoder.a.profidrive]\nfine_xist2_bits = 12\n",
            r"encoder.a: .*shift_xist2: 12 is not allowed",
        ),
        (HEAD + "[encoder.a.profidrive]\nzero_mark = 2147483647\n", r"encoder.a: zero_mark_counts"),
        (
            '[drive.drive1.encoder2]\ntype = "incremental_linear"\n',
            r"drive.drive1.encoder2: a drive with profile = .cia402. has none",
        ),
    ],
)
def test_mistakes_in_the_bench_file(extra, words):
    """Every mistake is reported with key, value and what is allowed."""
    with pytest.raises(BenchFileError, match=words):
        BenchFile("own.toml", load_bench("reference").text + extra)


def test_mistakes_of_a_second_encoder():
    """A linear encoder measures the load."""
    text = load_bench("profidrive").text
    wrong = '[drive.drive1.encoder2]\ntype = "incremental_linear"\nmounting = "motor"\n\n[axis.axis1]\n'
    with pytest.raises(BenchFileError, match="load for a linear encoder"):
        BenchFile("own.toml", text.replace("[axis.axis1]\n", wrong))
