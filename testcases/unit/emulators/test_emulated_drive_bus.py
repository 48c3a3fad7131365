"""The drive on the bus with the canopen library: commissioning, life, communication errors, whole stories."""

from __future__ import annotations

from dataclasses import replace

import canopen
import pytest
from canopen.profiles.p402 import BaseNode402

from emulators.drive.cia402 import EDS_PATH, DriveConfig, EncoderConfig
from emulators.drive.thermal_config import ThermalConfig
from fieldbus.canopen import NmtCommand, NmtState, PumpedNetwork, SdoAbort, virtual_time
from fieldbus.cia402 import DriveState as S
from fieldbus.clock import MS
from fieldbus.errors import ConfigurationError

REV = 131072


@pytest.fixture
def network(bench):
    network = PumpedNetwork(bench.medium)
    yield network
    network.disconnect()


@pytest.fixture
def node(network):
    return network.add_node(1, str(EDS_PATH))


@pytest.mark.exhaustive
def test_identification(bench, node):
    """Device type, name, identity and modes are read over SDO, the long name by segmented upload."""
    sdo = node.sdo
    assert sdo[0x1000].raw == 0x00020192
    assert sdo[0x1008].raw == "Emulated servo drive CiA 402"
    assert sdo[0x1018][2].raw == 0x402
    assert sdo[0x6502].raw == 0x3EF
    assert sdo[0x67FF].raw == 0x00020192


@pytest.mark.exhaustive
def test_every_readable_object_can_be_read(bench, node):
    """An SDO upload of each entry of the EDS succeeds, or says that there is no data (empty error field)."""
    refusals = {}
    for index, thing in sorted(node.object_dictionary.indices.items()):
        for sub, entry in sorted(getattr(thing, "subindices", {0: thing}).items()):
            if index >= 0x1000 and entry.access_type != "wo":
                try:
                    node.sdo.upload(index, sub)
                except canopen.SdoAbortedError as refusal:
                    refusals[index, sub] = refusal.code
    assert refusals == {(0x1003, sub): 0x08000024 for sub in range(1, 9)}


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-018", "C402-019", "C402-024")
def test_the_master_of_the_canopen_library_drives_it(bench, network):
    """`BaseNode402`, written by others, enables the drive, moves it in profile position and resets a
    fault.
    """
    node = network.add_node(BaseNode402(1, str(EDS_PATH)))
    with virtual_time(bench.scheduler):
        node.nmt.state = "PRE-OPERATIONAL"
        node.setup_402_state_machine()
        node.nmt.state = "OPERATIONAL"
        # The library takes a TPDO for periodic as soon as it has come twice, and waits for it then.
        node.sdo[0x1800][5].raw = 20
        bench.run(0.05)
        # RPDO2, which the library uses for the mode, carries control word 0 besides.
        node.op_mode = "PROFILED POSITION"
        assert bench.read(0x6061) == 1
        node.state = "OPERATION ENABLED"
        assert bench.state is S.OPERATION_ENABLED
        node.sdo[0x6081].raw = 1_200_000
        node.sdo[0x607A].raw = 3 * REV
        node.controlword = 0x1F
        bench.run(1.5)
        assert node.sdo[0x6064].raw == pytest.approx(3 * REV, abs=1)
        bench.drive.raise_fault(0x4310)
        bench.run(0.05)
        assert node.state == "FAULT"
        node.reset_from_fault()
        assert bench.state is not S.FAULT
        node.state = "OPERATION ENABLED"
        assert bench.state is S.OPERATION_ENABLED


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-541", "STP-542", "STP-010", "STP-544")
def test_story_of_a_quick_stop(bench, ramp_of):
    """Commission, enable, csv ramp to 1800 rpm, Quick stop by PDO: 300 ms and 45.0 mm at the load."""
    bench.start_cyclic(9)
    bench.word = 0x06
    bench.run(0.012)
    assert bench.status & 0x6F == 0x21
    bench.enable_cyclic()
    for step in range(1, 151):
        bench.target = step * 12_000
        bench.run(0.004)
    bench.run(0.1)
    assert bench.drive.mechanics.velocity == pytest.approx(0.3, rel=1e-5)
    samples = bench.observe()
    bench.word = 0x02
    bench.run(0.5)
    duration, travel = ramp_of(samples)
    assert duration == pytest.approx(0.300, abs=0.00026)
    assert travel * 1000 == pytest.approx(45.0, rel=0.005)
    assert bench.state is S.SWITCH_ON_DISABLED
    assert bench.transitions() == [1, 2, 3, 4, 11, 12]


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-014", "C402-016", "C301-019")
def test_story_of_a_fault(bench):
    """Fault in motion: EMCY, TPDO3 with 603Fh and 1001h, stop, Fault; reset over PDO and enable again."""
    errors = []
    bench.master.subscribe(0x381, lambda data, _time: errors.append(data.hex()))
    bench.start_cyclic(9)
    bench.enable_cyclic()
    bench.target = 600_000
    bench.run(0.3)
    bench.drive.raise_fault(0x7305)
    bench.run(0.02)
    assert bench.emcys == [(0x7305, 0x21)]
    assert errors == ["000000", "057321"]
    assert bench.state is S.FAULT
    bench.word, bench.target = 0x80, 0
    bench.run(0.02)
    assert errors[-1] == "000000"
    bench.run(3.0)
    bench.enable_cyclic()


@pytest.mark.exhaustive
@pytest.mark.requirement("C301-020", "C402-077", "C402-050", "C301-026")
def test_heartbeat_loss_is_a_fault(bench, node):
    """1016h set, heartbeat gone, 6007h = 1: EMCY 8130h, fault reaction on the ramp, reset only when it is
    back.
    """
    node.sdo[0x1016][1].raw = 127 << 16 | 50
    bench.master.produce_heartbeat(20 * MS)
    bench.spin(600)
    bench.master.produce_heartbeat(0)
    bench.run(0.06)
    assert bench.state is S.FAULT_REACTION_ACTIVE
    bench.run(0.3)
    assert bench.state is S.FAULT
    assert bench.emcys == [(0x8130, 0x11)]
    assert bench.read(0x603F) == 0x8130
    bench.control(0x80)
    assert bench.state is S.FAULT
    bench.master.produce_heartbeat(20 * MS)
    bench.run(0.05)
    bench.control(0x00)
    bench.control(0x80)
    assert bench.state is S.SWITCH_ON_DISABLED


@pytest.mark.requirement("C402-049", "C402-051", "C402-052", "C402-077")
@pytest.mark.parametrize(
    ("option", "state", "moves"),
    [(0, S.OPERATION_ENABLED, True), (2, S.SWITCH_ON_DISABLED, True), (3, S.SWITCH_ON_DISABLED, False)],
)
def test_abort_connection_options_in_motion(bench, option, state, moves):
    """6007h = 0 goes on, 2 coasts, 3 makes a quick stop."""
    bench.write(0x6007, option)
    bench.write(0x1016, 127 << 16 | 50, 1)
    bench.master.produce_heartbeat(20 * MS)
    bench.spin(600)
    bench.master.produce_heartbeat(0)
    bench.run(0.3)
    assert bench.state is state
    assert (abs(bench.drive.mechanics.velocity) > 0.01) is moves


@pytest.mark.requirement("C402-077")
@pytest.mark.parametrize(
    ("option", "state"),
    [(0, S.SWITCHED_ON), (1, S.FAULT), (2, S.SWITCH_ON_DISABLED), (3, S.SWITCH_ON_DISABLED)],
)
@pytest.mark.parametrize("command", [NmtCommand.STOP, NmtCommand.ENTER_PRE_OPERATIONAL])
def test_leaving_operational_without_torque(bench, option, state, command):
    """Leaving Operational in Switched on only changes the state, as 6007h says."""
    bench.write(0x6007, option)
    bench.master.nmt(NmtCommand.START, 1)
    bench.run(0.01)
    bench.control(0x06)
    bench.control(0x07)
    bench.master.nmt(command, 1)
    bench.run(0.01)
    assert bench.state is state


@pytest.mark.requirement("C301-049")
def test_overdue_rpdo(bench):
    """1400h:5: an RPDO that does not come in time is EMCY 8250h and 6007h."""
    bench.write(0x1400, 20, 5)
    bench.master.nmt(NmtCommand.START, 1)
    bench.run(0.01)
    bench.master.send(0x201, b"\x06\x00")
    bench.run(0.01)
    assert bench.state is S.READY_TO_SWITCH_ON
    bench.run(0.05)
    assert (bench.state, bench.emcys) == (S.FAULT, [(0x8250, 0x11)])


@pytest.mark.requirement("C301-018", "C301-022")
def test_reset_node_restarts_the_application(bench):
    """Reset node: torque off, defaults, Switch on disabled after boot-up; an incremental encoder forgets."""
    boots = []
    bench.master.on_bootup(1, lambda: boots.append(bench.scheduler.now))
    bench.write(0x6083, 1_234_000)
    bench.spin(600)
    assert bench.read(0x6064) > 1000
    bench.master.nmt(NmtCommand.RESET_NODE, 1)
    bench.run(0.01)
    assert len(boots) == 1
    assert bench.drive.core.torque == 0.0
    assert bench.state is S.SWITCH_ON_DISABLED
    assert bench.read(0x6083) == 3_000_000
    assert bench.read(0x6061) == 0
    assert 0 < bench.read(0x6064) < REV
    bench.run(3.0)
    bench.enable(3)


@pytest.mark.requirement("C301-018")
def test_reset_communication_keeps_the_application(bench):
    """Reset communication restores 1000h..1FFFh only; the drive stays where it was."""
    bench.write(0x6083, 1_234_000)
    bench.write(0x1017, 100)
    bench.control(0x06)
    bench.master.nmt(NmtCommand.RESET_COMMUNICATION, 1)
    bench.run(0.01)
    assert bench.read(0x1017) == 0
    assert bench.read(0x6083) == 1_234_000
    assert bench.state is S.READY_TO_SWITCH_ON
    assert bench.drive.slave.nmt_state is NmtState.PRE_OPERATIONAL


def test_nmt_of_the_master_is_no_missing_heartbeat(make_bench, subtests):
    """Stop and Pre-operational with 6007h = 1: Fault with EMCY 8100h, which waits while the node is stopped;
    a reset sends no EMCY at all.
    """
    for command, at_once, later in (
        (NmtCommand.STOP, [], [(0x8100, 0x11)]),
        (NmtCommand.ENTER_PRE_OPERATIONAL, [(0x8100, 0x11)], [(0x8100, 0x11)]),
        (NmtCommand.RESET_NODE, [], []),
        (NmtCommand.RESET_COMMUNICATION, [], []),
    ):
        with subtests.test(command.name):
            bench = make_bench(DriveConfig.reference())
            bench.enable(3)
            bench.master.nmt(NmtCommand.START, 1)
            bench.run(0.01)
            bench.master.nmt(command, 1)
            bench.run(0.5)
            assert bench.emcys == at_once
            bench.master.nmt(NmtCommand.ENTER_PRE_OPERATIONAL, 1)
            bench.run(0.01)
            assert bench.emcys == later
            reset = command is NmtCommand.RESET_NODE
            assert bench.state is (S.SWITCH_ON_DISABLED if reset else S.FAULT)


@pytest.mark.requirement("C301-140", "C301-141")
def test_stored_parameters_survive_power_off(bench):
    """1010h keeps parameters over power-off, 1011h brings the defaults back; refused while the power stage is
    on.
    """
    bench.write(0x6083, 1_234_000)
    bench.write(0x60FF, 5000)
    bench.write(0x1010, 0x65766173, 1)
    bench.enable(3)
    with pytest.raises(SdoAbort) as refusal:
        bench.write(0x1010, 0x65766173, 1)
    assert refusal.value.code == 0x08000022
    bench.drive.power_off()
    bench.run(0.05)
    assert bench.state is S.NOT_READY_TO_SWITCH_ON
    bench.drive.power_on()
    bench.run(0.01)
    assert (bench.read(0x6083), bench.read(0x60FF)) == (1_234_000, 0)
    bench.write(0x1011, 0x64616F6C, 1)
    bench.master.nmt(NmtCommand.RESET_NODE, 1)
    bench.run(0.01)
    assert bench.read(0x6083) == 3_000_000


@pytest.mark.requirement("C406-008")
@pytest.mark.parametrize(("kind", "keeps"), [("incremental", False), ("absolute", True)])
def test_position_over_power_off(make_bench, kind, keeps):
    """A multi-turn encoder keeps position and homing over power-off, even if moved; an incremental one loses
    both.
    """
    bench = make_bench(replace(DriveConfig.reference(), encoder=EncoderConfig(kind=kind)))
    bench.configure({0x6098: 37, 0x607C: -5000})
    bench.enable(6)
    bench.control(0x1F)
    assert bench.read(0x6064) == 5000
    bench.drive.power_off()
    bench.run(0.01)
    bench.drive.mechanics.place(0.020)
    bench.run(0.01)
    bench.drive.power_on()
    bench.run(0.01)
    assert bench.read(0x6064) == (5000 + 2 * REV if keeps else 0)


def test_power_off_in_motion_coasts_in_silence(bench):
    """Power-off: torque off, no frame any more, the machine coasts on."""
    bench.write(0x1017, 10)
    bench.spin(1800)
    bench.drive.power_off()
    assert bench.drive.core.torque == 0.0
    frames = len(bench.medium.log)
    speed = bench.drive.mechanics.velocity
    bench.run(0.2)
    assert len(bench.medium.log) == frames
    assert 0.0 < bench.drive.mechanics.velocity < speed


def test_boot_time(make_bench):
    """The boot-up frame and Switch on disabled come after the boot time."""
    bench = make_bench(replace(DriveConfig.reference(), boot_time_ms=300.0), power=False)
    boots = []
    bench.master.on_bootup(1, lambda: boots.append(bench.scheduler.now))
    bench.drive.power_on()
    bench.run(0.25)
    assert (bench.state, boots) == (S.NOT_READY_TO_SWITCH_ON, [])
    bench.run(0.1)
    assert bench.state is S.SWITCH_ON_DISABLED
    assert len(boots) == 1


def test_trace_row_matches_its_columns(bench):
    """The recorder's row has one float-like value per column, in the order of the columns."""
    bench.spin(600)
    row = bench.drive.trace_row()
    names = [name for name, _ in bench.drive.trace_columns]
    assert len(row) == len(names) == 17
    values = dict(zip(names, row, strict=True))
    assert values["velocity"] == pytest.approx(0.1, rel=1e-3)
    assert values["motor_speed"] == pytest.approx(600, rel=1e-3)
    assert values["position"] == bench.drive.mechanics.position
    assert values["encoder_increments"] == bench.drive.encoder.increments
    assert (values["controlword"], values["state"], values["mode"]) == (0x0F, 4, 3)
    assert values["statusword"] == bench.status
    assert values["brake_closed"] == 0
    for value in row:
        float(value)


def test_encoder_faults_reach_the_bus(bench):
    """A jump of the encoder is in 6064h, a frozen encoder makes the speed zero and the drive accelerate."""
    before = bench.read(0x6064)
    bench.drive.jump_encoder(5000)
    bench.run(0.002)
    assert bench.read(0x6064) == before + 5000
    bench.spin(300)
    bench.drive.freeze_encoder(True)
    bench.run(0.05)
    assert bench.read(0x606C) == 0
    assert bench.drive.mechanics.motor_speed > 400 * 0.105
    bench.drive.freeze_encoder(False)
    bench.drive.set_encoder_noise(4)
    bench.run(0.5)
    assert bench.drive.mechanics.motor_speed == pytest.approx(300 * 0.10472, rel=0.2)


@pytest.mark.requirement("C402-160")
def test_overload_and_blocked_motor(make_bench):
    """Too much torque for too long is fault 2310h; a blocked motor at the torque limit is 7121h if
    watched.
    """
    bench = make_bench(replace(DriveConfig.reference(), thermal=ThermalConfig(i2t_time_constant_s=2.0)))
    bench.enable(3)
    bench.write(0x60FF, 1_000_000)
    bench.drive.jam(True)
    bench.run(1.0)
    assert bench.emcys == [(0x2310, 0x03)]
    bench = make_bench(replace(DriveConfig.reference(), blocked_time_ms=200.0))
    bench.enable(3)
    bench.write(0x60FF, 1_000_000)
    bench.drive.jam(True)
    bench.run(0.5)
    assert bench.emcys == [(0x7121, 0x21)]


@pytest.mark.exhaustive
def test_two_runs_are_identical(make_bench):
    """The same story with the same seed gives the same trace and the same frames, bit by bit."""

    def story() -> tuple[list[tuple[float, ...]], list[tuple[int, str, str]]]:
        bench = make_bench(seed=5)
        rows = []
        bench.scheduler.every(4 * MS, lambda: rows.append(bench.drive.trace_row()), phase_ns=1 * MS)
        bench.start_cyclic(9)
        bench.enable_cyclic()
        bench.drive.set_encoder_noise(2)
        bench.target = 700_000
        bench.run(0.4)
        bench.drive.raise_fault(0x4310)
        bench.run(0.4)
        frames = [(entry[0], entry[1], entry[2].data.hex()) for entry in bench.medium.log]
        return rows, frames

    assert story() == story()


@pytest.mark.exhaustive
def test_any_eds_can_be_used(make_bench, tmp_path):
    """A drive with another EDS, here one without touch probe and factor group, works with built-in
    defaults.
    """
    text = EDS_PATH.read_text(encoding="ascii")
    sections = text.split("\n\n")
    removed = ("[60B", "[608F", "[6091", "[6092", "[60E", "[60C8", "[60C9", "[6079", "[60F4")
    kept = [section for section in sections if not section.startswith(removed)]
    eds = tmp_path / "small.eds"
    eds.write_text("\n\n".join(kept), encoding="ascii")
    bench = make_bench(replace(DriveConfig.reference(), eds=eds))
    with pytest.raises(SdoAbort):
        bench.read(0x6092, 1)
    bench.spin(600)
    bench.configure({0x6081: 600_000})
    bench.set_mode(1)
    bench.write(0x607A, 20 * REV)
    bench.control(0x1F, 3.0)
    assert bench.drive.mechanics.position == pytest.approx(0.2, abs=1e-5)


def test_an_eds_of_something_else_is_refused(make_bench, tmp_path):
    """An EDS without control word is refused with its reason."""
    sections = EDS_PATH.read_text(encoding="ascii").split("\n\n")
    eds = tmp_path / "other.eds"
    eds.write_text("\n\n".join(text for text in sections if not text.startswith("[6040")), encoding="ascii")
    with pytest.raises(ConfigurationError, match="6040h"):
        make_bench(replace(DriveConfig.reference(), eds=eds))
