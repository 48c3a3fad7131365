"""The encoder on the bus: PDOs and their times, speed, life, and with a drive on one shaft."""

from __future__ import annotations

import itertools
import math
import struct

import canopen
import pytest

from emulators.drive.cia402 import CiA402Drive, DriveConfig
from emulators.encoder import Mounting
from emulators.encoder.cia406 import CiA406Encoder, EncoderDeviceConfig, EncoderType
from fieldbus.can import CanFrame, CanMedium
from fieldbus.canopen import AbortCode, CanopenMaster, NmtCommand, NmtState
from fieldbus.clock import MS, VirtualScheduler
from fieldbus.errors import ConfigurationError
from testcases.unit.emulators.encoderbench import NODE, EncoderBench
from testcases.unit.emulators.test_drive_fuzz import Fuzzer

TPDO1, TPDO2, TPDO3, TPDO4 = 0x187, 0x287, 0x387, 0x487
TURN = 2 * math.pi


# -- PDOs ----------------------------------------------------------------------------------------------


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
    """6200h and 1800h:5 are one number, whichever is written; TPDO1 comes with that period and fresh
    positions.
    """
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
    """TPDO4, once switched on, is sent when a cam, the area, an alarm or a warning changes, and not
    otherwise.
    """
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


@pytest.mark.requirement("C406-019", "C406-020", "C301-052")
def test_wide_and_raw_positions_in_a_pdo():
    """6008h fills a PDO with 64 bits, 600Ch goes unscaled together with a position, both with the value of
    the SYNC.
    """
    bench = EncoderBench()
    bench.put(0x6001, 4096)
    bench.put(0x6009, -(10**10))
    for record, objects in ((0x1802, (0x60080040,)), (0x1803, (0x60040020, 0x600C0020))):
        bench.put(record, 0xC0000000 | 0x187 + 0x100 * (record - 0x1800), 1)
        bench.put(record, 1, 2)
        bench.put(record + 0x200, 0, 0)
        for sub, value in enumerate(objects, 1):
            bench.put(record + 0x200, value, sub)
        bench.put(record + 0x200, len(objects), 0)
        bench.put(record, 0x40000000 | 0x187 + 0x100 * (record - 0x1800), 1)
    bench.start()
    bench.count(3001)
    bench.master.start_sync(10 * MS)
    bench.run(0.02)
    assert bench.frames(TPDO3)[-1][1] == struct.pack("<q", -(10**10) + 1500)
    folded = (-(10**10) + 1500) % (4096 * 4096)
    assert bench.frames(TPDO4)[-1][1] == struct.pack("<iI", folded, 3001)


@pytest.mark.exhaustive
@pytest.mark.requirement(
    "C406-002", "C406-036", "C406-037", "C406-042", "C406-043", "C406-045", "C406-046", "C406-048", "C301-146"
)
@pytest.mark.parametrize(
    ("config", "resolution", "turns"),
    [
        ({"steps_per_revolution": 360, "revolutions": 16}, 360, 16),
        ({"steps_per_revolution": 360, "kind": EncoderType.SINGLE_TURN}, 360, 1),
        ({"kind": EncoderType.ABSOLUTE_LINEAR, "measuring_step_um": 0.5, "length_mm": 100.0}, 500, None),
    ],
)
def test_what_the_device_says_of_itself(config, resolution, turns):
    """Resolution, turns, range, serial number, profile version 3.1, class C3: as configured, read over the
    bus.
    """
    bench = EncoderBench(serial_number=4711, operating_time_h=12.3, **config)
    assert bench.get(0x6501) == resolution
    largest = 199_999 if turns is None else 360 * turns - 1
    if turns is not None:
        assert bench.get(0x6502) == turns
    assert [bench.get(0x650A, sub) for sub in (1, 2, 3)] == [0, 0, largest]
    assert bench.get(0x6002) == largest + 1
    assert (bench.get(0x650B), bench.get(0x1018, 4)) == (4711, 4711)
    assert bench.get(0x6507) & 0xFFFF == 0x0301
    assert bench.get(0x650E) & 0xF == 3
    assert bench.get(0x6508) == 123
    with pytest.raises(canopen.SdoAbortedError) as caught:
        bench.node.sdo.download(0x6004, 0, bytes(4))
    assert caught.value.code == AbortCode.READ_ONLY


# -- motion --------------------------------------------------------------------------------------------


@pytest.mark.requirement("C406-022", "C406-023", "C406-052")
@pytest.mark.parametrize(
    ("interval", "multiplier", "divider", "speed"),
    [(1, 1, 1, 82), (10, 1, 1, 819), (10, 3, 1, 2457), (100, 1, 10, 819), (100, 10, 1, 32767)],
)
def test_speed_is_the_way_of_an_interval(interval, multiplier, divider, speed):
    """10 rev/s of 8192 steps: steps in the interval of 6031h times multiplier by divider, held at the end of
    its type.
    """
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
    """On a ramp of 100 rev/s² the acceleration is 81.92 steps in (10 ms)², without jerk; at its begin the
    jerk has its sign.
    """
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
    """A linear encoder shows speed in steps of 0.01 mm/s times 6005h:2 and acceleration in mm/s² times
    6005h:3.
    """
    bench = EncoderBench(kind=EncoderType.ABSOLUTE_LINEAR, measuring_step_um=0.1, length_mm=1000.0, start=0.1)
    bench.put(0x6031, 20, 2)
    bench.encoder.turn_shaft(0.5, 0.5)
    bench.run(0.25)
    assert bench.get(0x6040, 1) == pytest.approx(1000, abs=1)
    bench.run(0.4)
    assert bench.get(0x6030, 1) == pytest.approx(500, abs=1)
    bench.put(0x6005, 50, 2)
    bench.run(0.005)
    assert bench.get(0x6030, 1) == pytest.approx(1000, abs=1)


# -- life ----------------------------------------------------------------------------------------------


@pytest.mark.requirement("C301-015", "C301-016", "C301-022", "C301-023")
def test_the_encoder_is_a_node_like_the_drive():
    """The same commands at the same times bring the same boot-ups, heartbeats and states out of encoder and
    drive.
    """

    def lives_of(make) -> list[tuple[int, str]]:
        scheduler = VirtualScheduler()
        medium = CanMedium(scheduler)
        device = make(scheduler, medium)
        CanopenMaster(scheduler, medium)
        device.power_on()
        device.slave.store.write(0x1017, 0, (20).to_bytes(2, "little"))
        for command in (0x01, 0x02, 0x80, 0x01, 0x82, 0x81, 0x55):
            scheduler.run_for(50 * MS)
            medium.inject(CanFrame(0, bytes((command, NODE))), sender="controller")
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


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    "kind", [EncoderType.MULTI_TURN, EncoderType.MULTI_SENSOR, EncoderType.INCREMENTAL_LINEAR]
)
def test_no_frames_bring_the_encoder_down(kind):
    """20 000 random and mutated frames each: no exception, finite signals, and after reset node the encoder
    answers.
    """
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
    from emulators.encoder.cia406 import EDS

    sections = EDS["rotary"].text().split("\n\n")
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


# -- with a drive ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("steps", "sign"), [(131072, 1), (8192, 1), (8192, -1), (1000, 1)])
def test_encoder_and_drive_on_one_shaft_agree(make_bench, steps, sign):
    """While the axis moves, every 6004h is the drive's 6064h of the same SYNC, within the coarser
    resolution.
    """
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
