"""The CiA 402 master of the `canopen` library, unmodified, commissions and moves the emulated drive in
virtual time.

The library was written by others from the same profiles: where it and the drive agree, neither is right by
accident.
"""

from __future__ import annotations

import math

import canopen
import pytest
from canopen.nmt import NmtError

from emulators.input_filter import INPUT_FILTER_MS
from fieldbus.cia402 import DriveState
from testcases.interop_master import (
    CONTROL,
    IMMEDIATELY,
    REACHED,
    REVOLUTION,
    RPM,
    SETPOINTS,
    STATUS,
    VALUES,
)

pytestmark = pytest.mark.exhaustive


@pytest.fixture
def ready(master):
    """The master with a commissioned drive in Switch on disabled."""
    master.commission()
    yield master
    master.close()


# -- commissioning
# --------------------------------------------------------------------------------------------


def test_the_library_finds_the_drive(station, master):
    """The library's scanner finds the node by its SDO answers, and reads what it is (long name:
    segmented).
    """
    master.network.scanner.search()
    station.run(0.1)
    assert master.network.scanner.nodes == [station.node_id]
    assert master.node.sdo["Device type"].raw == 0x00020192
    assert master.node.sdo["Manufacturer device name"].raw == "Emulated servo drive CiA 402"


@pytest.mark.requirement("C301-016", "C301-018", "C301-022")
def test_reset_communication(station, master):
    """On the library's reset communication the drive boots up, forgets 1017h, and is Pre-operational for the
    library.
    """
    master.node.sdo[0x1017].raw = 10
    master.node.nmt.wait_for_heartbeat(0.1)
    master.node.nmt.state = "RESET COMMUNICATION"
    master.error_control.clear()
    assert master.node.nmt.state == "INITIALISING"
    master.node.nmt.wait_for_bootup(1.0)
    assert master.node.nmt.state == "PRE-OPERATIONAL"
    station.run(0.1)
    assert master.error_control == [0]


@pytest.mark.requirement("C301-046", "C301-051", "C301-052")
def test_pdo_mapping_by_the_library_is_what_the_drive_has(station, ready):
    """What the library's PDO classes wrote is read back by a second, fresh node of the library."""
    master = ready
    network = master.network
    fresh = canopen.RemoteNode(station.node_id, master.node.object_dictionary)
    network.add_node(fresh)
    fresh.pdo.read()
    node = station.node_id
    for pdo, objects, cob_id in (
        (fresh.rpdo[1], CONTROL, 0x200 + node),
        (fresh.rpdo[2], SETPOINTS, 0x300 + node),
        (fresh.tpdo[1], STATUS, 0x180 + node),
        (fresh.tpdo[2], VALUES, 0x280 + node),
    ):
        assert pdo.enabled
        assert pdo.cob_id == cob_id
        assert tuple(variable.index for variable in pdo) == objects
    enabled = [(maps, n) for maps in ("rpdo", "tpdo") for n in range(1, 9) if getattr(fresh, maps)[n].enabled]
    assert enabled == [("rpdo", 1), ("rpdo", 2), ("tpdo", 1), ("tpdo", 2)]


@pytest.mark.requirement("C301-039")
def test_synchronous_pdos_follow_the_sync_of_the_library(station, ready):
    """Both TPDOs come once per SYNC of the library's producer, after it, and stop with it."""
    log = station.medium.log

    def seen():
        return [frame.can_id for _, _, frame, _ in log if frame.can_id < 0x700]

    log.clear()
    station.scheduler.run_until(lambda: 0x285 in seen(), 20_000_000)
    log.clear()
    station.run(0.1)
    assert seen() == [0x080, 0x185, 0x285] * 10
    ready.network.sync.stop()
    log.clear()
    station.run(0.1)
    assert seen() == []


@pytest.mark.requirement("C301-023")
def test_heartbeat_is_heard_by_the_library(station, ready):
    """The library knows the drive's state by its heartbeat, and misses it when the drive is off."""
    nmt = ready.node.nmt
    assert nmt.wait_for_heartbeat(0.2) == "OPERATIONAL"
    ready.error_control.clear()
    station.run(1.0)
    assert ready.error_control == [5] * 10
    nmt.state = "STOPPED"
    assert nmt.wait_for_heartbeat(0.2) == "STOPPED"
    station.drive.power_off()
    with pytest.raises(NmtError):
        nmt.wait_for_heartbeat(1.0)
    station.drive.power_on()
    nmt.wait_for_bootup(1.0)


@pytest.mark.requirement("C301-016")
def test_no_sdo_while_stopped(station, ready):
    """A stopped drive does not answer the library's SDO client; started again it does."""
    ready.node.nmt.state = "STOPPED"
    with pytest.raises(canopen.SdoCommunicationError):
        ready.node.sdo[0x1000].raw  # noqa: B018 - reading is the transfer
    ready.node.nmt.state = "OPERATIONAL"
    assert ready.node.sdo[0x1000].raw == 0x00020192


@pytest.mark.requirement("C402-141", "C402-090")
def test_refusals_reach_the_library(station, ready):
    """The library refuses a mode by 6502h; the drive itself refuses mode and homing method with an abort
    code.
    """
    station.drive.slave.values[0x650200] &= ~0x8  # a drive without profile torque
    with pytest.raises(TypeError, match="PROFILED TORQUE"):
        ready.node.op_mode = "PROFILED TORQUE"
    for index, value in ((0x6060, 4), (0x6060, 11), (0x6098, 16)):
        with pytest.raises(canopen.SdoAbortedError) as refusal:
            ready.node.sdo[index].raw = value
        assert refusal.value.code == 0x06090030


# -- state machine
# --------------------------------------------------------------------------------------------


@pytest.mark.requirement("C402-003", "C402-004", "C402-005", "C402-039")
def test_enable_in_one_assignment(station, ready):
    """`node.state = "OPERATION ENABLED"` takes the drive through transitions 2, 3 and 4."""
    before = len(station.transitions())
    ready.node.op_mode = "PROFILED POSITION"
    ready.node.state = "OPERATION ENABLED"
    assert station.transitions()[before:] == [2, 3, 4]
    assert station.drive.state is DriveState.OPERATION_ENABLED
    assert ready.node.state == "OPERATION ENABLED"


@pytest.mark.requirement(
    "C402-005", "C402-006", "C402-007", "C402-008", "C402-009", "C402-010", "C402-011", "C402-039"
)
def test_every_transition_that_the_library_can_ask_for(station, ready):
    """Each assignment of a state makes the one transition of the profile, and the library sees the state."""
    before = len(station.transitions())
    for state in (
        "READY TO SWITCH ON",  # 2
        "SWITCH ON DISABLED",  # 7
        "SWITCHED ON",  # 2, 3
        "READY TO SWITCH ON",  # 6
        "SWITCHED ON",  # 3
        "SWITCH ON DISABLED",  # 10
        "OPERATION ENABLED",  # 2, 3, 4
        "SWITCHED ON",  # 5
        "OPERATION ENABLED",  # 4
        "READY TO SWITCH ON",  # 8
        "OPERATION ENABLED",  # 3, 4
        "SWITCH ON DISABLED",  # 9
    ):
        ready.node.state = state
        assert ready.node.state == state
    assert station.transitions()[before:] == [2, 7, 2, 3, 6, 3, 10, 2, 3, 4, 5, 4, 8, 3, 4, 9]


@pytest.mark.requirement("C402-012", "C402-058", "C402-017")
def test_quick_stop_that_stays(station, ready):
    """With 605Ah = 6 the drive stops, stays in Quick stop active, and the library takes it back (transition
    16).
    """
    ready.enable("PROFILED VELOCITY")
    ready.run_at(1200)
    before = len(station.transitions())
    ready.node.state = "QUICK STOP ACTIVE"
    assert ready.node.state == "QUICK STOP ACTIVE"
    station.run(0.5)
    assert ready.velocity == pytest.approx(0, abs=RPM)
    assert ready.node.state == "QUICK STOP ACTIVE"
    ready.node.sdo[0x60FF].raw = 0
    ready.node.state = "OPERATION ENABLED"
    assert station.transitions()[before:] == [11, 16]


@pytest.mark.requirement("C402-012", "C402-013", "C402-055")
def test_quick_stop_that_switches_off(station, master):
    """With 605Ah = 2 the drive brakes with 6085h, which the library sees, and ends in Switch on disabled."""
    master.commission(quick_stop=2)
    master.enable("PROFILED VELOCITY")
    master.run_at(1200)
    start = station.drive.mechanics.position
    before = len(station.transitions())
    master.node.state = "QUICK STOP ACTIVE"
    master.until(lambda: master.node.state == "SWITCH ON DISABLED", "end of the quick stop")
    assert station.transitions()[before:] == [11, 12]
    # 1200 rpm with 12000 rpm/s: 100 ms and 1 revolution of 10 mm, after at most one SYNC period of 2 mm more.
    assert 10.0 <= 1000 * (station.drive.mechanics.position - start) <= 12.1
    master.close()


# -- motion
# ---------------------------------------------------------------------------------------------------


@pytest.mark.requirement("C402-091")
def test_profile_position(station, ready):
    """A move of 10 revolutions reaches its target in the time of its trapezoid."""
    ready.enable("PROFILED POSITION")
    begin = station.scheduler.now
    ready.move_to(10 * REVOLUTION)
    elapsed_s = (station.scheduler.now - begin) / 1e9
    station.run(0.05)
    assert ready.position == pytest.approx(10 * REVOLUTION, abs=2)
    # 20 rev/s, up with 100 rev/s2 and down with 50 rev/s2: 10 / 20 + 20 / 2 * (1 / 100 + 1 / 50) s, and the
    # bus.
    assert 0.8 <= elapsed_s < 0.9
    assert station.drive.mechanics.position == pytest.approx(0.100, abs=1e-6)


@pytest.mark.requirement("C402-093")
def test_profile_position_relative(ready):
    """Relative targets add up, in both directions."""
    ready.enable("PROFILED POSITION")
    for distance in (2, 3, -4):
        ready.move_to(distance * REVOLUTION, relative=True)
    ready.sleep(0.05)
    assert ready.position == pytest.approx(REVOLUTION, abs=2)


@pytest.mark.requirement("C402-092")
def test_a_new_setpoint_replaces_the_running_one(station, ready):
    """With "change immediately" the drive turns round before it has reached the first target."""
    ready.enable("PROFILED POSITION")
    ready.give_setpoint(20 * REVOLUTION)
    station.run(0.2)
    highest = ready.position
    assert highest > 2 * REVOLUTION
    ready.give_setpoint(-REVOLUTION, IMMEDIATELY)
    ready.until(lambda: ready.status_bit(REACHED), "second target")
    assert ready.position == pytest.approx(-REVOLUTION, abs=2)


@pytest.mark.requirement("C402-036", "C402-076")
def test_halt_and_on(station, ready):
    """Halt stops the move with bit 10 set; taken back, the drive goes on to its target."""
    ready.enable("PROFILED POSITION")
    ready.give_setpoint(20 * REVOLUTION)
    station.run(0.3)
    ready.node.controlword = 0x010F
    ready.until(lambda: ready.status_bit(REACHED), "stop")
    assert ready.node.state == "OPERATION ENABLED"
    assert abs(ready.position) < 15 * REVOLUTION
    ready.node.controlword = 0x000F
    ready.until(lambda: not ready.status_bit(REACHED), "motion")
    ready.until(lambda: ready.status_bit(REACHED), "target")
    assert ready.position == pytest.approx(20 * REVOLUTION, abs=2)


@pytest.mark.requirement("C402-097")
def test_profile_velocity(station, ready):
    """The drive ramps with 6083h and 6084h to speeds in both directions, and the library sees the speed."""
    ready.enable("PROFILED VELOCITY")
    begin = station.scheduler.now
    ready.run_at(600)
    # 600 rpm with 6000 rpm/s, the window time of 606Eh, and the bus.
    assert 0.1 <= (station.scheduler.now - begin) / 1e9 < 0.2
    assert ready.velocity == pytest.approx(600 * RPM, rel=0.005)
    ready.run_at(-300)
    assert ready.velocity == pytest.approx(-300 * RPM, rel=0.005)
    ready.run_at(0)
    before = ready.position
    station.run(0.2)
    assert ready.position == pytest.approx(before, abs=2)


@pytest.mark.requirement("C402-127", "C402-129", "C402-134", "C402-135", "C402-138")
@pytest.mark.parametrize("method", [35, 37])
def test_homing_on_the_present_position(station, ready, method):
    """The library's `homing` succeeds where it stands; 6064h becomes the negative home offset without any
    motion.
    """
    ready.enable("PROFILED POSITION")
    ready.move_to(3 * REVOLUTION)
    station.run(0.05)
    place = station.drive.mechanics.position
    assert ready.home(method, offset=5000)
    assert ready.node.op_mode == "HOMING"
    assert ready.position == pytest.approx(-5000, abs=2)
    assert ready.node.is_homed()
    station.run(0.2)
    assert station.drive.mechanics.position == pytest.approx(place, abs=1e-7)


LATE_MM = 2.0 * INPUT_FILTER_MS / 1000.0
"""Way at 2 mm/s, the speed of the edge, within the filter of the input."""


@pytest.mark.requirement("C402-105", "C402-120", "C402-121", "C402-126", "C402-134", "C402-135", "C402-138")
@pytest.mark.parametrize(
    ("method", "start_mm", "home_mm"),
    [
        (1, -540.0, -540.0),
        (17, -548.0, -549.5 + LATE_MM),
        (21, -503.0, -499.5 + LATE_MM),
        (33, 3.0, 0.0),
        (34, 3.0, 10.0),
    ],
)
def test_homing_with_motion(station, ready, method, start_mm, home_mm):
    """The library's `homing` finds limit switch, home switch and index of the reference axis, and learns it
    at the end.
    """
    station.drive.power_off()
    station.drive.mechanics.place(start_mm / 1000)
    station.drive.power_on()
    station.run(0.1)
    ready.commission()
    ready.enable("HOMING")
    ready.node.sdo[0x6099][1].raw = 60 * RPM
    ready.node.sdo[0x6099][2].raw = 12 * RPM
    ready.node.sdo[0x609A].raw = 3000 * RPM
    assert ready.home(method, offset=-REVOLUTION)
    assert ready.node.is_homed()
    station.run(0.2)
    place_mm = home_mm + 10.0 * (ready.position - REVOLUTION) / REVOLUTION
    assert 1000 * station.drive.mechanics.position == pytest.approx(place_mm, abs=0.003)


@pytest.mark.requirement("C402-136", "C402-137")
def test_homing_that_finds_nothing(station, ready):
    """The library reports a failure when the home switch is dead and the limit switch comes; it hears
    8612h.
    """
    station.drive.force_input("home", False)
    station.drive.force_input("negative_limit", True)
    ready.enable("HOMING")
    assert not ready.home(5)
    assert not ready.node.is_homed()
    station.run(0.05)
    assert [error.code for error in ready.node.emcy.log] == [0x8612]


@pytest.mark.requirement("C402-130", "C402-135")
def test_homing_without_a_method_fails(ready):
    """Homing method 0 ends in a homing error, which the library reports as a failure."""
    ready.enable("HOMING")
    assert not ready.home(0)
    assert not ready.node.is_homed()
    assert ready.home(35)


@pytest.mark.requirement("C402-100", "C402-046")
def test_cyclic_synchronous_position(station, ready):
    """Positions sent by the library's periodic RPDO are followed with the transport delay of the bus,
    smoothly.
    """
    begin = ready.position
    ready.start_cyclic(0x607A, begin, period_s=0.01)
    ready.enable("CYCLIC SYNCHRONOUS POSITION")
    targets = [begin + round(REVOLUTION * (1 - math.cos(math.pi * n / 100))) for n in range(101)]
    seen = ready.follow(0x607A, targets + [targets[-1]] * 5)
    assert ready.status_bit(1 << 12), "the drive does not follow"
    station.run(0.1)
    assert ready.position == pytest.approx(begin + 2 * REVOLUTION, abs=2)
    # Written before SYNC n, latched by it, reached at SYNC n + 1; one more when the RPDO's phase makes it
    # miss SYNC n.
    lag = min(
        range(1, 5),
        key=lambda k: max(abs(a - b) for a, b in zip(targets[20:80], seen[20 + k :], strict=False)),
    )
    assert lag in (1, 2)
    assert max(abs(a - b) for a, b in zip(targets, seen[lag:], strict=False)) < 0.01 * REVOLUTION
    assert station.drive.slave.get(0x2000, 2) == 0, "missing setpoints"


@pytest.mark.requirement("C402-101", "C402-046")
def test_cyclic_synchronous_velocity(station, ready):
    """Velocities sent by the library's periodic RPDO are followed; the position is their integral."""
    ready.start_cyclic(0x60FF, 0, period_s=0.01)
    ready.enable("CYCLIC SYNCHRONOUS VELOCITY")
    begin = ready.position
    ramp = [n * 20 * RPM for n in range(31)]  # to 600 rpm in 0.3 s
    ready.follow(0x60FF, [*ramp, *[600 * RPM] * 30])
    assert ready.status_bit(1 << 12), "the drive does not follow"
    assert ready.velocity == pytest.approx(600 * RPM, rel=0.005)
    ready.follow(0x60FF, [*reversed(ramp), *[0] * 20])
    # 10 rev/s for 0.3 s and two ramps of 0.3 s.
    assert ready.position - begin == pytest.approx(6 * REVOLUTION, rel=0.05)
    assert ready.velocity == pytest.approx(0, abs=RPM)
    assert station.drive.slave.get(0x2000, 2) == 0, "missing setpoints"


@pytest.mark.requirement("C402-104")
def test_cyclic_setpoints_that_stop_are_noticed(station, ready):
    """When the library's periodic RPDO ends in csv, the drive reports it (EMCY 8250h by 6007h = 1) and
    stops.
    """
    ready.start_cyclic(0x60FF, 0, period_s=0.01)
    ready.enable("CYCLIC SYNCHRONOUS VELOCITY")
    ready.follow(0x60FF, [300 * RPM] * 20)
    ready.node.rpdo[2].stop()
    error = ready.node.emcy.wait(0x8250, timeout=0.1)
    assert error is not None
    ready.until(lambda: ready.node.state == "FAULT", "fault")
    station.run(0.05)
    assert ready.velocity == pytest.approx(0, abs=RPM)


@pytest.mark.requirement("C301-037")
def test_loss_of_sync_is_noticed(station, ready):
    """When the library's SYNC producer ends in csv, the drive raises 8700h within two periods of 1006h and
    stops.
    """
    ready.node.sdo[0x1006].raw = 10_000
    ready.start_cyclic(0x60FF, 0, period_s=0.01)
    ready.enable("CYCLIC SYNCHRONOUS VELOCITY")
    ready.follow(0x60FF, [300 * RPM] * 20)
    ready.network.sync.stop()
    error = ready.node.emcy.wait(0x8700, timeout=0.02)
    assert error is not None
    station.run(0.5)
    assert ready.node.sdo[0x6041].raw & 0x4F == 0x08
    assert ready.node.sdo[0x603F].raw == 0x8700


# -- faults
# ---------------------------------------------------------------------------------------------------


@pytest.mark.requirement("C402-014", "C402-015", "C402-016", "C301-108", "C301-109", "C301-111")
def test_fault_and_reset(station, ready):
    """A fault in motion: the library hears the EMCY, sees Fault, reads 603Fh and 1003h, resets and moves
    again.
    """
    ready.enable("PROFILED VELOCITY")
    ready.run_at(600)
    node = ready.node
    before = len(station.transitions())
    station.scheduler.after(50_000_000, lambda: station.drive.raise_fault(0x4310))
    error = node.emcy.wait(0x4310, timeout=1.0)
    assert (error.code, error.register) == (0x4310, 0x09)
    assert node.emcy.active == [error]
    ready.until(lambda: node.state == "FAULT", "fault")
    assert node.sdo[0x603F].raw == 0x4310
    assert node.sdo[0x1003][1].raw & 0xFFFF == 0x4310
    assert ready.velocity == pytest.approx(0, abs=RPM)
    node.sdo[0x60FF].raw = 0
    node.reset_from_fault()
    assert node.emcy.active == []
    assert [entry.code for entry in node.emcy.log] == [0x4310, 0x0000]
    assert node.sdo[0x1001].raw == 0
    assert node.state == "OPERATION ENABLED"
    assert station.transitions()[before:] == [13, 14, 15, 2, 3, 4]
    ready.run_at(300)


@pytest.mark.requirement("C402-016")
def test_fault_whose_cause_is_there_cannot_be_reset(station, ready):
    """While the cause lasts the library's reset fails; afterwards the same call succeeds."""
    ready.enable("PROFILED POSITION")
    station.drive.raise_fault(0x4310, persistent=True)
    station.run(0.05)
    with pytest.raises(RuntimeError, match="Timeout"):
        ready.node.reset_from_fault()
    assert station.drive.state is DriveState.FAULT
    station.drive.clear_fault_cause()
    # The library has left bit 7 set: a new rising edge is needed.
    ready.node.reset_from_fault()
    assert station.drive.state is DriveState.OPERATION_ENABLED


@pytest.mark.requirement("C301-026", "C402-050", "C301-123")
def test_heartbeat_of_the_library_is_missed(station, ready):
    """The drive watches a heartbeat that the library sends periodically; when it ends, EMCY 8130h and
    fault.
    """
    ready.node.sdo[0x1016][1].raw = 127 << 16 | 100
    heartbeat = ready.network.send_periodic(0x77F, b"\x05", 0.05)
    ready.enable("PROFILED VELOCITY")
    ready.run_at(600)
    heartbeat.stop()
    error = ready.node.emcy.wait(0x8130, timeout=0.2)
    assert error is not None
    ready.until(lambda: station.drive.state is DriveState.FAULT, "fault")


def test_the_story_is_the_same_every_time(new_pair):
    """Commissioning and a move by the library leave the same frames at the same nanoseconds in every run."""
    logs = []
    for number in (1, 2):
        with new_pair(f"can{number}") as (station, master):
            master.commission()
            master.enable("PROFILED POSITION")
            master.move_to(REVOLUTION)
            master.close()
            logs.append([(time_ns, frame) for time_ns, _, frame, _ in station.medium.log])
    assert len(logs[0]) > 300
    assert logs[0] == logs[1]
