"""`hil emulate` on a real SocketCAN interface, driven by programs of others in other processes.

The unmodified `canopen` library and can-utils (`candump`, `cansend`) are the controllers. Everything here
runs in real time on a machine that may be slow: the tests wait for what must come and never measure how fast
it comes.
"""

from __future__ import annotations

import re
import signal
import subprocess
import time
from pathlib import Path

import canopen
import pytest

from emulators.drive.cia402 import EDS_PATH
from testcases.interop_master import REVOLUTION, RPM, LibraryMaster
from testcases.processes import PATIENCE_S, Reader, hil_command, program

pytestmark = pytest.mark.vcan

NODE = 9
OTHER_NODE = 10

BENCH = """
[bench]
name = "a drive for somebody else's controller"
kind = "live"
cycle_ms = 20
servo_period_us = 2000

[segment.can0]
interface = "socketcan"
channel = "the command line replaces it"

[drive.spindle]
segment = "can0"
node_id = NODE
velocity_time_constant_ms = 8.0
sync_loss = "warning"
missing_setpoints = 0

[drive.spindle.mechanics]
negative_stop_mm = -1000000.0
positive_stop_mm = 1000000.0

[drive.spindle.switches]
negative_limit_mm = -900000.0
positive_limit_mm = 900000.0
"""


def start_emulation(directory: Path, channel: str, node: int = NODE) -> Reader:
    """Start `hil emulate` and wait until it is ready."""
    bench = directory / "bench.toml"
    bench.write_text(BENCH.replace("NODE", str(node)), encoding="utf-8")
    command = [*hil_command(), "emulate", str(bench), "--interface", "socketcan", "--channel", channel]
    emulation = Reader(command, stream="stderr")
    emulation.wait_for(rf"^spindle: cia402, node {node}, on socketcan {channel}$")
    emulation.wait_for("^ready")
    return emulation


@pytest.fixture(scope="module")
def emulation(vcan_channel, tmp_path_factory):
    """One process of emulated drives for the tests of this file; each test resets the node."""
    emulation = start_emulation(tmp_path_factory.mktemp("emulate"), vcan_channel)
    yield emulation
    assert emulation.end(signal.SIGTERM) == 0


# -- the canopen library as the controller
# ----------------------------------------------------------------------


@pytest.fixture
def master(emulation, vcan_channel):
    """The library with its own threads on a socket of its own."""
    network = canopen.Network()
    network.connect(interface="socketcan", channel=vcan_channel)
    try:
        master = LibraryMaster(network, NODE, str(EDS_PATH), sleep=time.sleep, patience_s=PATIENCE_S)
        master.be_patient(10.0)
        master.node.nmt.state = "RESET"
        master.until(lambda: 0 in master.error_control, "boot-up after reset node")
        master.commission(cycle_ms=20, heartbeat_ms=200)
        yield master
        master.close()
    finally:
        network.disconnect()


@pytest.mark.requirement("C402-003", "C402-004", "C402-005", "C402-091")
def test_library_moves_in_profile_position(master, emulation):
    """`BaseNode402` enables the drive in the other process and moves it to a target and back."""
    since = len(emulation.lines)
    master.enable("PROFILED POSITION")
    emulation.wait_for(r"spindle  drive\.state  Switched on -> Operation enabled", since=since)
    master.move_to(5 * REVOLUTION)
    assert master.position == pytest.approx(5 * REVOLUTION, abs=REVOLUTION // 100)
    master.move_to(-2 * REVOLUTION, relative=True)
    assert master.position == pytest.approx(3 * REVOLUTION, abs=REVOLUTION // 100)
    master.node.state = "SWITCH ON DISABLED"
    emulation.wait_for(r"-> Switch on disabled", since=since)


@pytest.mark.requirement("C402-097", "C402-012", "C402-058")
def test_library_moves_in_profile_velocity(master):
    """Two speeds in profile velocity, then a quick stop that stays in Quick stop active."""
    master.enable("PROFILED VELOCITY")
    begin = master.position
    master.run_at(300)
    assert master.velocity == pytest.approx(300 * RPM, rel=0.05)
    assert master.position > begin
    master.run_at(-300)
    turned = master.position
    master.until(lambda: master.position < turned - REVOLUTION, "motion in negative direction")
    master.node.state = "QUICK STOP ACTIVE"
    master.until(lambda: abs(master.velocity) < 2 * RPM, "standstill")
    assert master.node.state == "QUICK STOP ACTIVE"


@pytest.mark.requirement("C402-129", "C402-135", "C402-138")
def test_library_homes(master):
    """Homing on the present position sets 6064h to the negative home offset."""
    master.enable("HOMING")
    # The library takes "not started yet" for "interrupted" when the answer is late: then it is asked again.
    master.until(lambda: master.home(37, offset=5000), "homing")
    assert master.node.is_homed()
    master.until(lambda: abs(master.position + 5000) <= 20, "position of the home point")


@pytest.mark.requirement("C402-101")
def test_library_moves_in_cyclic_velocity(master):
    """Cyclic setpoints by the kernel's periodic messages, which the library sets up: the drive follows."""
    master.start_cyclic(0x60FF, 0, period_s=0.02)
    master.enable("CYCLIC SYNCHRONOUS VELOCITY")
    master.follow(0x60FF, [n * 10 * RPM for n in range(31)])
    master.until(lambda: abs(master.velocity - 300 * RPM) < 15 * RPM, "300 rpm")
    begin = master.position
    master.until(lambda: master.position > begin + 2 * REVOLUTION, "two revolutions")
    master.follow(0x60FF, [n * 10 * RPM for n in range(30, -1, -1)])
    master.until(lambda: abs(master.velocity) < 2 * RPM, "standstill")
    assert master.node.state == "OPERATION ENABLED"


@pytest.mark.requirement("C301-026", "C301-123", "C402-050", "C402-016")
def test_library_sees_and_resets_a_fault(master, emulation):
    """The drive misses a heartbeat that the library sent: EMCY 8130h and Fault; with the heartbeat back it is
    reset.
    """
    since = len(emulation.lines)
    heartbeat = master.network.send_periodic(0x77F, b"\x05", 0.1)
    # Monitoring begins with the first heartbeat after this; the time is long, because the machine may be
    # slow.
    master.node.sdo[0x1016][1].raw = 127 << 16 | 3000
    master.enable("PROFILED VELOCITY")
    master.run_at(120)
    heartbeat.stop()
    master.until(lambda: [error.code for error in master.node.emcy.active] == [0x8130], "EMCY 8130h")
    emulation.wait_for(r"spindle  drive\.fault  code 8130h", since=since)
    # The error behaviour 1029h has taken the node to Pre-operational, without PDOs: the word comes by SDO.
    master.until(lambda: master.node.sdo[0x6041].raw & 0x4F == 0x08, "Fault")
    assert master.node.sdo[0x603F].raw == 0x8130
    heartbeat = master.network.send_periodic(0x77F, b"\x05", 0.1)
    master.node.sdo[0x60FF].raw = 0
    master.node.nmt.state = "OPERATIONAL"
    master.until(lambda: master.node.state == "FAULT", "status word by TPDO")
    # The heartbeat has to be there before the fault can be reset.
    master.until(lambda: _reset(master), "reset of the fault")
    assert master.node.emcy.active == []
    assert master.node.state == "OPERATION ENABLED"
    heartbeat.stop()


def _reset(master: LibraryMaster) -> bool:
    try:
        master.node.reset_from_fault()
    except RuntimeError:
        return False
    return bool(master.node.state == "OPERATION ENABLED")


# -- candump and cansend as the controller
# ------------------------------------------------------------------------


class CanUtils:
    """`candump` records, `cansend` sends."""

    PROBE = "7FE#"

    def __init__(self, channel: str) -> None:
        self.channel = channel
        self._cansend = program("cansend")
        self.dump = Reader([program("candump"), "-L", channel], stream="stdout")
        # candump does not say when it listens: call until it answers
        end = time.monotonic() + PATIENCE_S
        # the drive's heartbeat may be the first that it shows
        while not any(self.PROBE in line for line in self.dump.lines) and time.monotonic() < end:
            self.send(self.PROBE)
            time.sleep(0.05)
        self.dump.wait_for(self.PROBE)

    def send(self, frame: str) -> None:
        subprocess.run([self._cansend, self.channel, frame], check=True, timeout=PATIENCE_S)

    def ask(self, frame: str, answer: str) -> re.Match[str]:
        """Send a frame and return the match of `answer`, a pattern for what candump shows after it."""
        since = len(self.dump.lines)
        self.send(frame)
        return self.dump.wait_for(rf" {self.channel} {answer}", since=since)

    def read(self, index: int) -> int:
        """Read an INTEGER32 by SDO."""
        low, high = index & 0xFF, index >> 8
        found = self.ask(
            f"{0x600 + NODE:03X}#40{low:02X}{high:02X}0000000000",
            rf"{0x580 + NODE:03X}#43{low:02X}{high:02X}00([0-9A-F]{{8}})$",
        )
        return int.from_bytes(bytes.fromhex(found[1]), "little", signed=True)

    def until(self, condition, what: str) -> None:
        end = time.monotonic() + PATIENCE_S
        while not condition():
            assert time.monotonic() < end, f"waited in vain: {what}"


@pytest.fixture
def utils(emulation, vcan_channel):
    utils = CanUtils(vcan_channel)
    yield utils
    utils.dump.kill()
    print("\n".join(utils.dump.lines))  # pytest shows it when the test fails


def sdo(request: str) -> str:
    return f"{0x600 + NODE:03X}#{request}"


def sdo_answer(data: str) -> str:
    return f"{0x580 + NODE:03X}#{data}$"


def status(state: int) -> str:
    """Return a pattern for TPDO1 whose status word shows the state, whatever its upper byte and bits 4 and 7
    are.
    """
    low = "|".join(f"{byte:02X}" for byte in range(256) if byte & 0x6F == state)
    return rf"{0x180 + NODE:03X}#({low})[0-9A-F]{{2}}$"


@pytest.mark.requirement(
    "C301-016", "C301-022", "C301-057", "C301-060", "C402-018", "C402-019", "C402-024", "C402-039", "C402-097"
)
def test_candump_and_cansend_drive_it(utils):
    """With nothing but cansend the drive is started, enabled, run at 120 rpm and stopped; candump shows its
    answers.
    """
    rpdo = f"{0x200 + NODE:03X}#"
    boot_up = f"{0x700 + NODE:03X}#00$"
    assert utils.ask(f"000#81{NODE:02X}", boot_up)
    assert utils.ask(sdo("4000100000000000"), sdo_answer("4300100092010200"))
    assert utils.ask(sdo("2B171000F4010000"), sdo_answer("6017100000000000"))
    utils.dump.wait_for(f"{0x700 + NODE:03X}#7F$")
    assert utils.ask(sdo("2F60600003000000"), sdo_answer("6060600000000000"))
    assert utils.ask(sdo("2383600080841E00"), sdo_answer("6083600000000000"))  # 2000 rpm/s
    assert utils.ask(sdo("23FF6000C0D40100"), sdo_answer("60FF600000000000"))  # 120 rpm
    assert utils.ask(f"000#01{NODE:02X}", status(0x40))
    utils.dump.wait_for(f"{0x700 + NODE:03X}#05$")
    assert utils.ask(f"{rpdo}0600", status(0x21))
    assert utils.ask(f"{rpdo}0700", status(0x23))
    begin = utils.read(0x6064)
    assert utils.ask(f"{rpdo}0F00", status(0x27))
    utils.until(lambda: utils.read(0x606C) == pytest.approx(120_000, rel=0.02), "120 rpm")
    first = utils.read(0x6064)
    assert first > begin
    utils.until(lambda: utils.read(0x6064) > first + REVOLUTION, "a revolution")
    assert utils.ask(sdo("23FF600000000000"), sdo_answer("60FF600000000000"))
    utils.until(lambda: abs(utils.read(0x606C)) < 500, "standstill")
    rest = utils.read(0x6064)
    assert utils.read(0x6064) == pytest.approx(rest, abs=20)
    assert utils.ask(f"{rpdo}0000", status(0x40))


@pytest.mark.requirement("C301-087", "C301-096", "C301-086")
def test_candump_shows_the_aborts(utils):
    """What cansend asks for wrongly is answered with the abort code."""
    for request, answer in (
        ("4000500000000000", "8000500000000206"),
        ("4018100500000000", "8018100511000906"),
        ("2300100001000000", "8000100002000106"),
    ):
        assert utils.ask(sdo(request), sdo_answer(answer))


# -- the end
# ------------------------------------------------------------------------------------------------------


def test_sigterm_ends_the_emulation_cleanly(vcan_channel, tmp_path):
    """SIGTERM ends `hil emulate` with exit code 0 and no traceback, and the node is gone from the bus."""
    question, answer = (
        f"{0x600 + OTHER_NODE:03X}#4000100000000000",
        f"{0x580 + OTHER_NODE:03X}#4300100092010200",
    )
    emulation = start_emulation(tmp_path, vcan_channel, OTHER_NODE)
    utils = CanUtils(vcan_channel)
    try:
        assert utils.ask(question, answer)
        assert emulation.end(signal.SIGTERM) == 0
        assert not any("Traceback" in line for line in emulation.lines)
        utils.send(question)
        assert utils.ask(utils.PROBE, utils.PROBE)
        assert sum(answer in line for line in utils.dump.lines) == 1
    finally:
        emulation.kill()
        utils.dump.kill()
