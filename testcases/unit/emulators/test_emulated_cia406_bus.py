"""The encoder on the bus: PDOs and their times, speed, cams, work area, alarms, warnings, life."""

from __future__ import annotations

import itertools
import math
import struct

import canopen
import pytest
from hypothesis import given
from hypothesis import strategies as st

from emulators.drive.cia402 import CiA402Drive, DriveConfig
from emulators.encoder import Mounting
from emulators.encoder.cia406 import CiA406Encoder, EncoderDeviceConfig, EncoderType
from fieldbus.can import CanFrame, CanMedium
from fieldbus.canopen import AbortCode, CanopenMaster, NmtCommand, NmtState
from fieldbus.clock import MS, VirtualScheduler
from fieldbus.errors import ConfigurationError, UnsupportedFaultError
from testcases.unit.emulators.encoderbench import NODE, EncoderBench
from testcases.unit.emulators.test_drive_fuzz import Fuzzer

TPDO1, TPDO2, TPDO3, TPDO4 = 0x187, 0x287, 0x387, 0x487
TURN = 2 * math.pi


# -- PDOs ----------------------------------------------------------------------------------------------------------


@pytest.mark.requirement("C406-012", "C301-019", "C406-009")
def test_without_cyclic_timer_tpdo1_is_sent_once():
    """On entering Operational TPDO1 is sent once; with 6200h = 0 neither time nor motion sends it again."""
    bench = EncoderBench()
    bench.count(1234)
    bench.start()
    bench.encoder.turn_shaft(TURN)
    bench.run(0.5)
    assert [data for _, data in bench.frames(TPDO1)] == [struct.pack("<i", 1234)]


@pytest.mark.requirement("C406-009", "C406-026", "C301-048")
@pytest.mark.parametrize("period_ms", [1, 7, 100])
def test_cyclic_timer(period_ms):
    """6200h and 1800h:5 are one number, whichever is written; TPDO1 comes with that period and fresh positions."""
    bench = EncoderBench()
    bench.put(0x6200, period_ms)
    assert bench.get(0x1800, 5) == period_ms
    bench.start()
    bench.encoder.turn_shaft(10 * TURN)
    begin = bench.scheduler.now
    bench.run(0.7)
    frames = bench.frames(TPDO1, begin)
    times = [time_ns for time_ns, _ in frames]
    assert all(abs(new - old - period_ms * MS) < MS // 20 for old, new in itertools.pairwise(times))
    assert len(frames) == pytest.approx(700 / period_ms, abs=1)
    positions = [struct.unpack("<i", data)[0] for _, data in frames]
    step = 8192 * 10 * period_ms / 1000
    assert all(abs(new - old - step) < 12 for old, new in itertools.pairwise(positions))
    bench.put(0x1800, 0, 5)
    assert bench.get(0x6200) == 0
    begin = bench.scheduler.now
    bench.run(0.3)
    assert bench.frames(TPDO1, begin) == []


@pytest.mark.requirement("C406-026", "C301-018")
def test_cyclic_timer_follows_its_twin_through_resets():
    """Reset communication takes 1800h:5 back, and 6200h with it; saving the communication keeps both."""
    bench = EncoderBench()
    bench.put(0x6200, 20)
    bench.master.nmt(NmtCommand.RESET_COMMUNICATION, NODE)
    bench.run(0.01)
    assert (bench.get(0x6200), bench.get(0x1800, 5)) == (0, 0)
    bench.put(0x6200, 20)
    bench.put(0x1010, 0x65766173, 2)
    bench.restart()
    assert (bench.get(0x6200), bench.get(0x1800, 5)) == (20, 20)


@pytest.mark.requirement("C406-010", "C406-011", "C301-056")
def test_synchronous_pdos():
    """TPDO2 comes with every SYNC, TPDO3 after it was switched on, with position and speed of one instant."""
    bench = EncoderBench()
    bench.put(0x1802, 0x40000387, 1)
    bench.start()
    bench.encoder.turn_shaft(10 * TURN)
    bench.run(0.01)
    bench.master.start_sync(5 * MS)
    begin = bench.scheduler.now
    bench.run(0.1)
    second, third = bench.frames(TPDO2, begin), bench.frames(TPDO3, begin)
    assert len(second) == len(third) == len(bench.frames(0x80, begin)) >= 20
    for (_, short), (_, long) in zip(second, third, strict=True):
        assert long[:4] == short
        assert struct.unpack("<h", long[4:])[0] in (81, 82)


@pytest.mark.requirement("C406-027", "C406-033", "C406-038", "C406-040", "C301-044")
def test_states_are_sent_when_they_change():
    """TPDO4, once switched on, is sent when a cam, the area, an alarm or a warning changes, and not otherwise."""
    bench = EncoderBench()
    bench.put(0x1803, 0x40000487, 1)
    bench.put(0x6301, 1, 1)
    bench.put(0x6310, 1000, 1)
    bench.put(0x6320, 2000, 1)
    bench.put(0x6402, 3000, 1)
    bench.start()
    begin = bench.scheduler.now
    for steps in (500, 1500, 1600, 2500, 3500):
        bench.count(steps)
    bench.encoder.inject_warnings(0x10)
    bench.run(0.002)
    bench.encoder.inject_alarms(0x1)
    bench.run(0.002)
    assert [data.hex(" ") for _, data in bench.frames(TPDO4, begin)] == [
        "01 00 00 00 00 00",
        "00 00 00 00 00 00",
        "00 03 00 00 00 00",
        "00 03 00 00 10 00",
        "00 03 01 00 10 00",
    ]


# -- motion --------------------------------------------------------------------------------------------------------


@pytest.mark.requirement("C406-022", "C406-023", "C406-052")
@pytest.mark.parametrize(
    ("interval", "multiplier", "divider", "speed"),
    [(1, 1, 1, 82), (10, 1, 1, 819), (10, 3, 1, 2457), (100, 1, 10, 819), (100, 10, 1, 32767)],
)
def test_speed_is_the_way_of_an_interval(interval, multiplier, divider, speed):
    """10 rev/s of 8192 steps: steps in the interval of 6031h times multiplier by divider, held at the end of its type."""
    bench = EncoderBench()
    for sub, value in ((2, interval), (3, multiplier), (4, divider)):
        bench.put(0x6031, value, sub)
    for direction in (1, -1):
        bench.encoder.turn_shaft(direction * 10 * TURN)
        bench.run(0.3)
        low, high = sorted(
            (direction * speed, direction * (speed + (0 if speed == 32767 else -1 * multiplier)))
        )
        assert low - 2 <= bench.get(0x6030, 1) <= high + 2
        assert abs(bench.get(0x6040, 1)) <= 1


@pytest.mark.requirement("C406-022", "C406-023")
def test_speed_of_the_raw_value():
    """Source 0 takes the speed of the scaled position, source 1 that of the raw one."""
    bench = EncoderBench()
    bench.put(0x6031, 100, 2)
    bench.put(0x6001, 1024)
    bench.encoder.turn_shaft(TURN)
    bench.run(0.3)
    assert bench.get(0x6030, 1) == pytest.approx(102.4, abs=1)
    bench.put(0x6031, 1, 1)
    bench.run(0.01)
    assert bench.get(0x6030, 1) == pytest.approx(819.2, abs=1)
    for sub, value in ((1, 2), (2, 0), (2, 1001), (3, 0), (4, 0)):
        with pytest.raises(canopen.SdoAbortedError):
            bench.put(0x6031, value, sub)


@pytest.mark.requirement("C406-024", "C406-025")
def test_acceleration_and_jerk():
    """On a ramp of 100 rev/s² the acceleration is 81.92 steps in (10 ms)², without jerk; at its begin the jerk has its sign."""
    bench = EncoderBench()
    bench.put(0x6031, 10, 2)
    bench.run(0.05)
    bench.encoder.turn_shaft(20 * TURN, 0.2)
    bench.run(0.015)
    assert bench.encoder.channels[0].jerk > 10
    bench.run(0.1)
    assert bench.get(0x6040, 1) == pytest.approx(81.92, abs=2)
    assert abs(bench.get(0x6050, 1)) <= 4
    bench.encoder.turn_shaft(0.0, 0.1)
    bench.run(0.05)
    assert bench.get(0x6040, 1) < -80


@pytest.mark.requirement("C406-018", "C406-022", "C406-024")
def test_motion_of_a_slide_is_in_millimetres():
    """A linear encoder shows speed in steps of 0.01 mm/s times 6005h:2 and acceleration in mm/s² times 6005h:3."""
    bench = EncoderBench(kind=EncoderType.ABSOLUTE_LINEAR, measuring_step_nm=100, length_m=1.0, start=0.1)
    bench.put(0x6031, 20, 2)
    bench.encoder.turn_shaft(0.5, 0.5)
    bench.run(0.25)
    assert bench.get(0x6040, 1) == pytest.approx(1000, abs=1)
    bench.run(0.4)
    assert bench.get(0x6030, 1) == pytest.approx(500, abs=1)
    bench.put(0x6005, 50, 2)
    bench.run(0.005)
    assert bench.get(0x6030, 1) == pytest.approx(1000, abs=1)


# -- cams and work area --------------------------------------------------------------------------------------------


class CamOracle:
    """A cam as the profile describes it, one position after the other."""

    def __init__(self, low: int, high: int, play: int) -> None:
        self.range, self.play, self.active = (low, high), play, False

    def at(self, position: int) -> bool:
        low, high = self.range
        play = self.play if self.active else 0
        self.active = low - play <= position <= high + play
        return self.active


@pytest.mark.requirement("C406-027", "C406-028", "C406-029", "C406-030", "C406-031", "C406-032", "C406-049")
@given(data=st.data())
def test_cams(data):
    """All eight cams at any places, with hysteresis on leaving, polarity and enable, against a model of the rule."""
    bench = EncoderBench(steps_per_revolution=1000, revolutions=1)
    place = st.integers(0, 999)
    enable, polarity = data.draw(st.integers(0, 255)), data.draw(st.integers(0, 255))
    cams = [(data.draw(place), data.draw(place), data.draw(st.integers(0, 60))) for _ in range(8)]
    bench.put(0x6301, enable, 1)
    bench.put(0x6302, polarity, 1)
    for cam, (low, high, play) in enumerate(cams):
        bench.put(0x6310 + cam, low, 1)
        bench.put(0x6320 + cam, high, 1)
        bench.put(0x6330 + cam, play, 1)
    bench.restart_cams()
    oracles = [CamOracle(*cam) for cam in cams]
    for position in data.draw(st.lists(place, min_size=1, max_size=8)):
        bench.count(position)
        wanted = sum(oracle.at(position) << cam for cam, oracle in enumerate(oracles))
        assert bench.get(0x6300, 1) == (wanted ^ polarity) & enable


@pytest.mark.requirement("C406-049", "C406-028", "C406-029")
def test_disabled_cam_is_zero_whatever_its_polarity():
    """Enable 0 gives state 0; enabled and inverted, the bit is set outside of the cam."""
    bench = EncoderBench()
    bench.put(0x6310, 100, 1)
    bench.put(0x6320, 200, 1)
    bench.put(0x6302, 1, 1)
    assert bench.get(0x6300, 1) == 0
    bench.put(0x6301, 1, 1)
    assert bench.get(0x6300, 1) == 1
    bench.count(150)
    assert bench.get(0x6300, 1) == 0
    states = [event.data["state"] for event in bench.history.select(kind="encoder.cams")]
    assert states == [1, 0]


@pytest.mark.requirement("C406-033", "C406-034")
def test_work_area():
    """Beyond the high limit bits 0 and 1, below the low one bits 0 and 2; the limits cannot cross."""
    bench = EncoderBench()
    bench.put(0x6401, 1000, 1)
    bench.put(0x6402, 2000, 1)
    states = []
    for steps in (999, 1000, 2000, 2001):
        bench.count(steps)
        states.append(bench.get(0x6400, 1))
    assert states == [0b101, 0, 0, 0b011]
    for index, value in ((0x6401, 2001), (0x6402, 999)):
        with pytest.raises(canopen.SdoAbortedError) as caught:
            bench.put(index, value, 1)
        assert caught.value.code == AbortCode.MAXIMUM_BELOW_MINIMUM


# -- alarms and warnings -------------------------------------------------------------------------------------------


@pytest.mark.requirement("C406-050", "C406-051", "C406-038", "C301-108", "C301-109")
def test_alarm_holds_the_position_and_sends_an_emcy():
    """Position error: EMCY 1000h with register 21h, 6004h keeps its value; with the cause it goes, EMCY 0000h."""
    bench = EncoderBench()
    bench.count(500)
    bench.encoder.inject_alarms(1)
    bench.run(0.002)
    bench.count(900)
    assert (bench.position, bench.get(0x6503), bench.get(0x1001)) == (500, 1, 0x21)
    bench.encoder.inject_alarms(0x9001)
    bench.run(0.002)
    bench.encoder.inject_alarms(0)
    bench.run(0.002)
    assert (bench.position, bench.get(0x6503), bench.get(0x1001)) == (900, 0, 0)
    assert bench.emcys == [
        (0x1000, 0x21), (0xFF0C, 0x21), (0xFF0F, 0x21), (0, 0x21), (0, 0x21), (0, 0),
    ]  # fmt: skip


@pytest.mark.requirement("C406-050", "C406-038")
def test_slide_beyond_its_scale_is_a_position_error():
    """An absolute linear encoder that leaves its scale raises the alarm by itself, keeps the last position, and recovers."""
    bench = EncoderBench(kind=EncoderType.ABSOLUTE_LINEAR, length_m=0.1, start=0.09)
    bench.encoder.turn_shaft(0.1)
    bench.run(0.2)
    assert bench.get(0x6503) == 1
    assert 99_900 <= bench.position <= 99_999
    bench.encoder.place_shaft(0.05)
    bench.run(0.002)
    assert (bench.get(0x6503), bench.position) == (0, 50_000)
    assert bench.emcys == [(0x1000, 0x21), (0, 0)]


@pytest.mark.requirement("C406-050", "C406-040")
@pytest.mark.parametrize("told", [False, True])
def test_warnings(told):
    """A warning leaves the position valid; an EMCY comes only where that is configured."""
    bench = EncoderBench(warning_emcy=told)
    for bit in range(6):
        bench.encoder.inject_warnings(1 << bit)
        bench.run(0.002)
        assert bench.get(0x6505) == 1 << bit
    bench.count(77)
    assert bench.position == 77
    bench.encoder.inject_warnings(0)
    bench.run(0.002)
    assert bench.get(0x6505) == 0
    assert bench.emcys == ([(0xFF20, 0x21)] * 6 + [(0, 0)] if told else [])


@pytest.mark.requirement("C406-040", "C406-043", "C406-008")
def test_causes_of_warnings():
    """Too fast, too long in operation, reference mark not passed yet: each sets its own bit by itself."""
    fast = EncoderBench(max_speed=10 * TURN)
    fast.encoder.turn_shaft(9 * TURN)
    fast.run(0.1)
    assert fast.get(0x6505) == 0
    fast.encoder.turn_shaft(11 * TURN)
    fast.run(0.1)
    assert fast.get(0x6505) == 1
    old = EncoderBench(operating_time_h=99.95, operating_time_limit_h=100.0)
    assert (old.get(0x6508), old.get(0x6505)) == (999, 0)
    old.run(200.0)
    assert (old.get(0x6508), old.get(0x6505)) == (1000, 8)
    old.restart()
    assert old.get(0x6508) == 1000, "operating time is not lost with the supply"
    lost = EncoderBench(kind=EncoderType.INCREMENTAL_ROTARY_COUNTING, zero_mark=0.25)
    assert lost.get(0x6505) == 0x20
    lost.count(2000)
    assert lost.get(0x6505) == 0x20
    lost.count(2100)
    assert lost.get(0x6505) == 0


@pytest.mark.requirement("C406-039", "C406-041")
def test_only_supported_bits_can_be_brought_about():
    """Alarms beyond 6504h and warnings beyond 6506h are refused, but for the bits of the manufacturer."""
    bench = EncoderBench()
    assert (bench.get(0x6504), bench.get(0x6506)) == (1, 0x3F)
    for call, word in ((bench.encoder.inject_alarms, 2), (bench.encoder.inject_warnings, 0x40)):
        with pytest.raises(ConfigurationError):
            call(word)


# -- faults of the sensor ------------------------------------------------------------------------------------------


@pytest.mark.requirement("C402-312")
def test_faults_of_the_sensor():
    """Freeze, jump, noise, reversal and lost steps show in 6004h as they would on the shaft."""
    bench = EncoderBench(steps_per_revolution=1000)
    encoder = bench.encoder
    bench.count(100)
    encoder.freeze_encoder(True)
    bench.count(300)
    assert bench.position == 100
    encoder.freeze_encoder(False)
    assert bench.position == 300
    encoder.jump_encoder(50)
    assert bench.position == 350
    encoder.set_encoder_noise(3)
    seen = {bench.position for _ in range(200)}
    assert seen == set(range(347, 354))
    encoder.set_encoder_noise(0)
    encoder.reverse_encoder(True)
    bench.count(400)
    assert bench.position == 250
    encoder.reverse_encoder(False)
    encoder.lose_encoder_steps(10)
    bench.count(500)
    assert bench.position == 250 + 90
    encoder.lose_encoder_steps(0)
    bench.count(600)
    assert bench.position == 250 + 190


@pytest.mark.requirement("C402-312", "C406-009")
def test_faults_of_the_device():
    """Preset, overflow, a wrong cycle of TPDO1 and back to the right one; alarms and warnings bit by bit."""
    bench = EncoderBench()
    bench.put(0x6200, 10)
    bench.start()
    bench.encoder.preset_encoder(123)
    assert bench.position == 123
    bench.encoder.near_overflow(5)
    assert bench.position == 33554432 - 5
    bench.encoder.near_overflow(-4)
    assert bench.position == 4
    counts = []
    for period in (25, 0, None):
        bench.encoder.force_cycle_time(period)
        begin = bench.scheduler.now
        bench.run(0.105)
        counts.append(len(bench.frames(TPDO1, begin + 1 * MS)))
    assert counts == [4, 0, 10]
    bench.encoder.preset_encoder(33554432 + 3)
    assert bench.position == 3
    bench.encoder.set_alarm(0, True)
    bench.encoder.set_alarm(14, True)
    bench.encoder.set_alarm(0, False)
    bench.encoder.set_warning(4, True)
    bench.run(0.002)
    assert (bench.get(0x6503), bench.get(0x6505)) == (0x4000, 0x10)
    mounted = CiA406Encoder(
        bench.scheduler, bench.medium, EncoderDeviceConfig(node_id=9), Mounting(lambda: 0.0), name="other"
    )
    with pytest.raises(UnsupportedFaultError, match="no shaft"):
        mounted.turn_shaft(1.0)


# -- life ----------------------------------------------------------------------------------------------------------


@pytest.mark.requirement("C301-015", "C301-016", "C301-022", "C301-023")
def test_the_encoder_is_a_node_like_the_drive():
    """The same commands at the same times bring the same boot-ups, heartbeats and states out of encoder and drive."""

    def lives_of(make) -> list[tuple[int, str]]:
        scheduler = VirtualScheduler()
        medium = CanMedium(scheduler)
        device = make(scheduler, medium)
        master = CanopenMaster(scheduler, medium)
        device.power_on()
        device.slave.store.write(0x1017, 0, (20).to_bytes(2, "little"))
        for command in (0x01, 0x02, 0x80, 0x01, 0x82, 0x81, 0x55):
            scheduler.run_for(50 * MS)
            master.nmt(command, NODE)
            if command in (0x82, 0x81):
                scheduler.run_for(5 * MS)
                device.slave.store.write(0x1017, 0, (20).to_bytes(2, "little"))
        device.power_off()
        scheduler.run_for(50 * MS)
        device.power_on()
        scheduler.run_for(50 * MS)
        return [(time, frame.data.hex()) for time, _, frame, _ in medium.log if frame.can_id == 0x700 + NODE]

    drive = lives_of(lambda s, m: CiA402Drive(s, m, DriveConfig.reference(node_id=NODE), name="drive"))
    encoder = lives_of(
        lambda s, m: CiA406Encoder(
            s, m, EncoderDeviceConfig(node_id=NODE), Mounting(lambda: 0.0), name="encoder"
        )
    )
    assert [data for _, data in encoder] == [data for _, data in drive]
    assert len(encoder) > 15
    # Frames of the drive's own PDOs may delay a heartbeat by a frame or two.
    assert all(abs(mine[0] - other[0]) < 0.5 * MS for mine, other in zip(encoder, drive, strict=True))


@pytest.mark.parametrize(
    "kind", [EncoderType.MULTI_TURN, EncoderType.MULTI_SENSOR, EncoderType.INCREMENTAL_LINEAR]
)
def test_no_frames_bring_the_encoder_down(kind):
    """20 000 random and mutated frames each: no exception, finite signals, and after reset node the encoder answers."""
    bench = EncoderBench(kind=kind)
    bench.network.disconnect()
    slave = bench.encoder.slave
    objects = sorted((key >> 8, key & 0xFF) for key in slave.store.entries)
    fuzzer = Fuzzer(406, objects + [pair for pair in objects if pair[0] >= 0x6000] * 4)
    operational = 0
    bench.encoder.turn_shaft(0.3)
    for number in range(400):
        for _ in range(50):
            frame = fuzzer.frame()
            if not frame.remote and frame.can_id == 0x601:
                frame = CanFrame(0x600 + NODE, frame.data)
            bench.medium.inject(frame, sender="fuzzer")
        bench.run(0.008)
        operational += slave.nmt_state is NmtState.OPERATIONAL
        assert all(math.isfinite(value) for value in bench.encoder.trace_row())
        if number % 50 == 49:
            slave.store.stored.clear()
            bench.master.nmt(NmtCommand.RESET_NODE, NODE)
            bench.run(0.005)
            bench.master.nmt(NmtCommand.START, NODE)
    assert operational > 100
    slave.store.stored.clear()
    bench.master.nmt(NmtCommand.RESET_NODE, NODE)
    bench.run(2.0)
    assert bench.encoder.peek(0x1000) == kind.device_type
    assert 0 <= bench.encoder.peek(0x6004) < bench.encoder.scaling.total


def test_foreign_eds(tmp_path):
    """An EDS with fewer objects will do; one without 6004h is refused with what is missing."""
    from emulators.encoder.cia406 import eds_text

    sections = eds_text("rotary").split("\n\n")
    lean = [part for part in sections if not part.startswith(("[6031", "[6200", "[6400", "[6008"))]
    path = tmp_path / "lean.eds"
    path.write_text("\n\n".join(lean), encoding="ascii")
    bench = EncoderBench(eds=path)
    bench.encoder.turn_shaft(TURN)
    bench.run(0.1)
    assert bench.position == pytest.approx(819 + 16, abs=20)
    path = tmp_path / "none.eds"
    path.write_text("\n\n".join(part for part in sections if not part.startswith("[6004")), encoding="ascii")
    with pytest.raises(ConfigurationError, match="6004h"):
        EncoderBench(eds=path)


# -- beside the drive ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("steps", "sign"), [(131072, 1), (8192, 1), (8192, -1), (1000, 1)])
def test_encoder_and_drive_on_one_shaft_agree(make_bench, steps, sign):
    """While the axis moves, every 6004h is the drive's 6064h of the same SYNC, within the coarser resolution."""
    bench = make_bench(DriveConfig.reference())
    mechanics = bench.drive.mechanics
    encoder = CiA406Encoder(
        bench.scheduler,
        bench.medium,
        EncoderDeviceConfig(
            node_id=2, steps_per_revolution=steps, revolutions=4096 if steps < 131072 else 4000
        ),
        Mounting(lambda: mechanics.motor_angle, ratio=sign, offset=2 * math.pi * 100),
        name="encoder",
    )
    encoder.power_on()
    bench.master.nmt(NmtCommand.START, 2)
    bench.start_cyclic()
    bench.enable_cyclic()
    begin = bench.scheduler.now
    for speed in (600_000, -900_000, 1_500_000, 0):
        bench.target = speed
        bench.run(0.1)
    seen: dict[int, dict[int, int]] = {}
    number = 0
    for time_ns, _, frame, _ in bench.medium.log:
        if time_ns < begin:
            continue
        if frame.can_id == 0x80:
            number += 1
        elif frame.can_id == 0x181:
            seen.setdefault(number, {})[1] = struct.unpack_from("<i", frame.data, 2)[0]
        elif frame.can_id == 0x282:
            seen.setdefault(number, {})[2] = struct.unpack("<i", frame.data)[0]
    pairs = [(both[1] / 131072, both[2] / steps) for both in seen.values() if len(both) == 2]
    assert len(pairs) > 90
    assert max(abs(drive) for drive, _ in pairs) > 0.5
    assert all(abs(external - 100 - sign * drive) <= 0.5 / steps + 1 / 131072 for drive, external in pairs)
