"""The unmodified canopen library on a segment, in virtual and in real time."""

from __future__ import annotations

import threading
import time
from functools import partial
from struct import pack, unpack
from types import SimpleNamespace

import canopen
import pytest
from canopen.profiles.p402 import BaseNode402

from fieldbus.can import CanFrame, CanMedium, HookResult
from fieldbus.canopen import CanopenSlave, NmtCommand, NmtState, PumpedNetwork, virtual_time
from fieldbus.canopen.virtual_time import EPOCH_S
from fieldbus.cia402 import DriveState
from fieldbus.clock import MS, RealtimeScheduler, S
from fieldbus.errors import BusError


@pytest.fixture
def network(bench):
    with PumpedNetwork(bench.segment) as network:
        yield network


@pytest.fixture
def node(network, kit):
    return network.add_node(kit.NODE, kit.dictionary(kit.NODE))


# -- SDO
# ------------------------------------------------------------------------------------------------------


@pytest.mark.requirement("C301-057", "C301-060")
@pytest.mark.parametrize(
    ("index", "value"),
    [
        (0x6060, -2),
        (0x6040, 0xBEEF),
        (0x2006, -(1 << 23)),
        (0x6083, 0xFFFFFFFF),
        (0x60FF, -(1 << 31)),
        (0x2008, 0.5),
    ],
)
def test_expedited_by_the_library(node, index, value):
    """Numbers of one to four bytes written by the library's client are read back by it unchanged."""
    node.sdo[index].raw = value
    assert node.sdo[index].raw == value


@pytest.mark.exhaustive
@pytest.mark.requirement("C301-058", "C301-059", "C301-061")
@pytest.mark.parametrize("text", ["seven77", "fourteen bytes", "a string that needs several segments", "x"])
def test_segmented_by_the_library(bench, node, text):
    """Strings pass in segments in both directions."""
    node.sdo.download(0x2001, 0, text.encode(), force_segment=True)
    assert bench.slave.get(0x2001) == text
    assert node.sdo[0x2001].raw == text


def test_64_bit_number_by_the_library(node):
    """An INTEGER64 goes in two segments."""
    node.sdo[0x2007].raw = -(1 << 60)
    assert node.sdo[0x2007].raw == -(1 << 60)


@pytest.mark.requirement("C301-063", "C301-065", "C301-066", "C301-068", "C301-069")
@pytest.mark.parametrize("count", [1, 7, 8, 888, 889, 890, 3000])
@pytest.mark.parametrize("crc", [True, False])
def test_block_transfer_by_the_library(bench, node, count, crc):
    """Block transfers with the library's client, with and without CRC, around the borders of segment and
    block.
    """
    content = bytes((7 * number + 3) & 0xFF for number in range(count))
    with node.sdo.open(0x2002, 0, "wb", size=count, block_transfer=True, request_crc_support=crc) as stream:
        stream.write(content)
    assert bench.slave.get(0x2002) == content
    with node.sdo.open(0x2002, 0, "rb", block_transfer=True, request_crc_support=crc) as stream:
        assert stream.read() == content


@pytest.mark.exhaustive
def test_block_transfer_survives_a_lost_segment(bench, node):
    """When a segment is lost on the bus, server and library agree on what to repeat."""
    content = bytes(range(256)) * 6  # the library cannot repeat segments of the last block
    seen = []

    def drop(frame, sender, _time_ns):
        if sender == "canopen" and frame.data[0] == 20 and not seen:
            seen.append(frame)
            return HookResult.drop()
        return None

    bench.segment.add_hook(drop)
    with node.sdo.open(0x2002, 0, "wb", size=len(content), block_transfer=True) as stream:
        stream.write(content)
    assert seen
    assert bench.slave.get(0x2002) == content


@pytest.mark.requirement("C301-087", "C301-086", "C301-085", "C301-098")
@pytest.mark.parametrize(
    ("index", "data", "code"),
    [
        (0x5000, b"\0", 0x06020000),
        (0x6041, b"\0\0", 0x06010002),
        (0x2003, None, 0x06010001),
        (0x2000, b"\x09\0", 0x06090031),
    ],
)
def test_aborts_reach_the_library(node, index, data, code):
    """The library raises the abort code that the slave has sent."""
    transfer = (
        partial(node.sdo.upload, index, 0) if data is None else partial(node.sdo.download, index, 0, data)
    )
    with pytest.raises(canopen.SdoAbortedError) as caught:
        transfer()
    assert caught.value.code == code


@pytest.mark.exhaustive
def test_timeout_is_simulated_time(bench, node):
    """Without a slave the client gives up after its time-out in simulated time, at once in real time."""
    bench.slave.power_off()
    node.sdo.RESPONSE_TIMEOUT = 3600
    before = bench.scheduler.now
    started = time.monotonic()
    with pytest.raises(canopen.SdoCommunicationError):
        node.sdo[0x1000].raw  # noqa: B018 - reading is the transfer
    assert bench.scheduler.now - before == 3600 * S
    assert time.monotonic() - started < 60


def test_late_answer_is_not_taken_for_the_next(bench, node):
    """An answer that comes after its time-out is forgotten; the next transfer gets its own."""
    bench.slave.sdo_response_delay_ns = 400 * MS
    with pytest.raises(canopen.SdoCommunicationError):
        node.sdo[0x6083].raw  # noqa: B018 - reading is the transfer
    bench.slave.sdo_response_delay_ns = 0
    bench.run(1000)
    assert node.sdo[0x1000].raw == 0x20192


@pytest.mark.exhaustive
def test_additional_sdo_channel(bench, node):
    """A client added to the node later waits in simulated time like the first."""
    node.sdo[0x1201][1].raw = 0x6C0
    node.sdo[0x1201][2].raw = 0x6D0
    client = node.add_sdo(0x6C0, 0x6D0)
    client.network = node.network
    assert client.upload(0x1000, 0) == pack("<I", 0x20192)


def test_waiting_in_a_callback_is_refused(bench, node):
    """A transfer from inside a callback is refused with a message that says why, instead of hanging."""
    errors = []

    def on_emcy(_entry):
        try:
            node.sdo[0x603F].raw  # noqa: B018 - reading is the transfer
        except BusError as error:
            errors.append(str(error))

    node.emcy.add_callback(on_emcy)
    bench.slave.emcy(0x8611)
    bench.run()
    assert len(errors) == 1
    assert "callback must not wait" in errors[0]
    bench.run()
    assert node.sdo[0x1001].raw == 0x21


# -- NMT, EMCY, PDO, SYNC
# -------------------------------------------------------------------------------------


@pytest.mark.requirement("C301-016", "C301-022")
def test_wait_for_bootup(bench, node):
    """`wait_for_bootup` returns with the boot-up after a reset, and gives up in simulated time without
    one.
    """
    bench.slave.boot_time_ns = 2 * S
    node.nmt.state = "RESET"
    before = bench.scheduler.now
    node.nmt.wait_for_bootup(10)
    assert 2 * S <= bench.scheduler.now - before < 2.1 * S
    assert node.nmt.state == "PRE-OPERATIONAL"
    with pytest.raises(canopen.nmt.NmtError):
        node.nmt.wait_for_bootup(5)


def test_wait_for_bootup_is_not_prolonged_by_heartbeats(bench, node):
    """Heartbeats that come in while waiting for a boot-up do not move the time-out."""
    node.sdo[0x1017].raw = 100
    before = bench.scheduler.now
    with pytest.raises(canopen.nmt.NmtError):
        node.nmt.wait_for_bootup(2)
    assert bench.scheduler.now - before < 3 * S


@pytest.mark.requirement("C301-023")
def test_wait_for_heartbeat(bench, node):
    """`wait_for_heartbeat` returns the state with the next heartbeat."""
    node.sdo[0x1017].raw = 500
    node.nmt.state = "OPERATIONAL"
    before = bench.scheduler.now
    assert node.nmt.wait_for_heartbeat(2) == "OPERATIONAL"
    assert bench.scheduler.now - before <= 500 * MS
    node.sdo[0x1017].raw = 0
    with pytest.raises(canopen.nmt.NmtError):
        node.nmt.wait_for_heartbeat(2)


@pytest.mark.exhaustive
def test_node_guarding_by_the_library(bench, node):
    """The library's guarding requests are remote frames; the slave answers, and life guarding is content."""
    reasons = []
    bench.slave.on_communication_error.append(reasons.append)
    node.sdo[0x100C].raw = 50
    node.sdo[0x100D].raw = 2
    states = []
    node.nmt.add_heartbeat_callback(states.append)
    node.nmt.start_node_guarding(0.05)
    bench.run(500)
    assert reasons == []
    assert states == [0x7F] * len(states)
    assert len(states) >= 10
    node.nmt.stop_node_guarding()
    bench.run(500)
    assert reasons == ["life_guarding"]


@pytest.mark.requirement("C301-108")
def test_emcy_wait(bench, node):
    """`emcy.wait` returns the EMCY waited for, passes over others, and gives up in simulated time."""
    bench.scheduler.after(100 * MS, lambda: bench.slave.emcy(0x2310))
    bench.scheduler.after(200 * MS, lambda: bench.slave.emcy(0x8611, None, b"\x01\x02"))
    found = node.emcy.wait(0x8611, timeout=1)
    assert (found.code, found.register, found.data) == (0x8611, 0x23, b"\x01\x02\0\0\0")
    assert [entry.code for entry in node.emcy.active] == [0x2310, 0x8611]
    before = bench.scheduler.now
    assert node.emcy.wait(timeout=5) is None
    assert bench.scheduler.now - before == 5 * S


def remap(node) -> None:
    for pdo in (*node.tpdo.values(), *node.rpdo.values()):
        pdo.read()
    tpdo, rpdo = node.tpdo[2], node.rpdo[2]
    tpdo.clear()
    for index in (0x6041, 0x6064, 0x6077):
        tpdo.add_variable(index)
    rpdo.clear()
    for index in (0x6040, 0x60FF, 0x6060):
        rpdo.add_variable(index)
    for pdo in (tpdo, rpdo):
        pdo.trans_type = 1
        pdo.enabled = True
        pdo.save()


@pytest.mark.requirement("C301-006", "C301-035", "C301-039", "C301-052")
def test_pdo_configuration_and_traffic_by_the_library(bench, network, node):
    """The library reads and writes PDO mappings, sends RPDOs periodically, and waits for TPDOs driven by its
    SYNC.
    """
    remap(node)
    node.nmt.state = "OPERATIONAL"
    network.sync.start(0.01)
    bench.slave.on_sync.append(lambda _time: bench.slave.set(0x6064, 0, bench.slave.get(0x60FF) + 1))
    node.rpdo[2]["Target velocity"].raw = 1234
    node.rpdo[2].start(0.01)
    assert node.tpdo[2].wait_for_reception(0.1) is not None
    node.tpdo[2].wait_for_reception(0.1)
    assert node.tpdo[2].wait_for_reception(0.1) == pytest.approx(EPOCH_S + bench.scheduler.now / S)
    assert node.tpdo[2]["Position actual value"].raw == 1235
    node.rpdo[2]["Target velocity"].raw = -5
    bench.run(50)
    assert node.tpdo[2]["Position actual value"].raw == -4
    assert node.tpdo[2].period == pytest.approx(0.01, rel=1e-3)
    node.rpdo[2].stop()
    network.sync.stop()
    bench.run(5)
    assert node.tpdo[2].wait_for_reception(0.1) is None


def test_remote_request_by_the_library(bench, node):
    """A PDO request of the library is a remote frame and is answered."""
    node.sdo[0x1800][1].raw = 0x80000185
    node.sdo[0x1800][1].raw = 0x00000185
    node.tpdo[1].read()
    node.nmt.state = "OPERATIONAL"
    bench.run(5)
    bench.slave.values[0x604100] = 0x0237
    node.tpdo[1].remote_request()
    node.tpdo[1].wait_for_reception(1)
    assert node.tpdo[1]["Statusword"].raw == 0x0237


def test_periodic_message(bench, network):
    """`send_periodic` sends at once and then every period without drift; `update` and `stop` work."""
    task = network.send_periodic(0x123, b"\x01", 0.01)
    bench.received.clear()
    bench.run(45)
    task.update(b"\x02")
    bench.run(50)
    task.stop()
    task.stop()
    bench.run(100)
    times = bench.times(0x123)
    assert len(times) == 10
    assert times[-1] - times[0] == pytest.approx(90, abs=0.01)
    assert b"".join(bench.take(0x123)) == b"\x01" * 5 + b"\x02" * 5


def test_scanner_finds_the_slave(bench, network):
    """The library's node search sees the slave's answer."""
    network.scanner.search(10)
    bench.run(50)
    assert network.scanner.nodes == [5]


def test_store_and_load_configuration_by_the_library(bench, node):
    """`store`, `restore` and `load_configuration` of the library work on the slave."""
    node.sdo[0x6083].raw = 77
    node.store()
    node.nmt.state = "RESET"
    node.nmt.wait_for_bootup(1)
    assert node.sdo[0x6083].raw == 77
    node.restore()
    node.nmt.state = "RESET"
    node.nmt.wait_for_bootup(1)
    assert node.sdo[0x6083].raw == 1000
    node.object_dictionary[0x6083].value = 55
    node.load_configuration()
    assert bench.slave.get(0x6083) == 55


def test_time_producer_and_lss_use_the_bench_time(bench, network):
    """TIME carries the time of the bench, not of the computer, and the LSS master's pauses are simulated."""
    bench.run(5000)
    bench.received.clear()
    network.time.transmit()
    bench.run(1)
    milliseconds, days = unpack("<LH", bench.take(0x100)[0])
    assert days == 16 * 365 + 4
    assert milliseconds == pytest.approx(bench.scheduler.now / MS, abs=2)
    started, before = time.monotonic(), bench.scheduler.now
    listener = bench.segment.attach("lss", lambda frame, _time: None)
    bench.scheduler.every(MS, lambda: listener.send(CanFrame(0x7E4, b"\x4f" + bytes(7))))
    assert network.lss.fast_scan() == (True, [0, 0, 0, 0])
    assert bench.scheduler.now - before > 1 * S
    assert time.monotonic() - started < 60


@pytest.mark.exhaustive
def test_malformed_frames_are_counted(bench, network, node):
    """Frames too short for the library are counted and harm nothing; errors of the user's own code are
    his.
    """
    for can_id, data in ((0x085, "11 86"), (0x705, ""), (0x000, "01")):
        bench.send(can_id, data)
    bench.run()
    assert network.malformed == 3
    assert node.sdo[0x1000].raw == 0x20192

    def broken(_can_id, _data, _stamp):
        pack("<B", 1000)

    network.subscribe(0x123, broken)
    bench.send(0x123)
    with pytest.raises(Exception, match="ubyte format requires"):
        bench.run()


def test_disconnected_network(bench, network):
    """After `disconnect` periodic messages have ended, and sending is refused with a reason."""
    network.sync.start(0.01)
    network.disconnect()
    network.disconnect()
    bench.received.clear()
    bench.run(50)
    assert bench.take() == []
    with pytest.raises(BusError, match="disconnected"):
        network.nmt.state = "OPERATIONAL"


# -- virtual time
# ---------------------------------------------------------------------------------------------


def test_virtual_time_shows_the_scheduler(bench):
    """Inside the context the library's modules see the scheduler's time; sleeping lets it pass; after it all
    is back.
    """
    import canopen.emcy
    import canopen.nmt

    with virtual_time(bench.scheduler, poll_ns=0) as clock:
        assert canopen.nmt.time is clock
        start = canopen.nmt.time.monotonic()
        canopen.nmt.time.sleep(1.5)
        assert canopen.nmt.time.monotonic() - start == pytest.approx(1.5)
        assert canopen.emcy.time.time() == EPOCH_S + bench.scheduler.now / S
        with virtual_time(bench.scheduler):
            assert canopen.nmt.time is not clock
        assert canopen.nmt.time is clock
    assert canopen.nmt.time is time


def test_virtual_time_ends_with_an_exception(bench):
    """The modules are restored when the body fails."""
    import canopen.nmt

    with pytest.raises(KeyError), virtual_time(bench.scheduler):
        raise KeyError
    assert canopen.nmt.time is time


def test_looking_at_the_clock_lets_time_pass(bench):
    """A loop that only polls the clock ends in virtual time."""
    before = bench.scheduler.now
    with virtual_time(bench.scheduler) as clock:
        end = clock.monotonic() + 0.1
        while clock.monotonic() < end:
            pass
    assert 100 * MS <= bench.scheduler.now - before < 102 * MS


@pytest.mark.exhaustive
def test_sleep_in_a_callback_is_refused(bench):
    """A callback cannot sleep, and for it the time stands still."""
    with virtual_time(bench.scheduler) as clock:
        looks = []
        bench.scheduler.after(0, lambda: looks.extend((clock.time(), clock.time())))
        bench.run(1)
        assert looks[0] == looks[1]
        bench.scheduler.after(0, lambda: clock.sleep(1))
        with pytest.raises(BusError, match="must not wait"):
            bench.run(1)


class MiniDrive:
    """Just enough of CiA 402 to be commissioned: follows the controlword with a delay of 2 ms."""

    def __init__(self, bench) -> None:
        self.slave = bench.slave
        self.scheduler = bench.scheduler
        self.state = DriveState.SWITCH_ON_DISABLED
        self.slave.on_write(0x6040, 0, lambda word: self.scheduler.after(2 * MS, lambda: self.command(word)))
        self.slave.on_write(
            0x6060, 0, lambda mode: self.scheduler.after(2 * MS, lambda: self.slave.set(0x6061, 0, mode))
        )
        self.show()

    def show(self) -> None:
        self.slave.set(0x6041, 0, 0x0210 | self.state.bits)

    def command(self, word: int) -> None:
        state = self.state
        if state == DriveState.FAULT:
            if word & 0x80:
                state = DriveState.SWITCH_ON_DISABLED
        elif not word & 2:
            state = DriveState.SWITCH_ON_DISABLED
        elif not word & 4:
            state = (
                DriveState.QUICK_STOP_ACTIVE
                if state == DriveState.OPERATION_ENABLED
                else DriveState.SWITCH_ON_DISABLED
            )
        elif not word & 1:
            state = DriveState.READY_TO_SWITCH_ON
        elif state != DriveState.SWITCH_ON_DISABLED:
            state = (
                DriveState.OPERATION_ENABLED
                if word & 8 and state >= DriveState.SWITCHED_ON
                else DriveState.SWITCHED_ON
            )
        self.state = state
        self.show()


@pytest.mark.parametrize("cyclic", [False, True])
def test_p402_commissions_a_drive_in_virtual_time(bench, network, kit, cyclic):
    """The library's CiA 402 master takes a drive to Operation enabled and back, with event-driven or cyclic
    PDOs.
    """
    drive = MiniDrive(bench)
    node = BaseNode402(kit.NODE, kit.dictionary(kit.NODE))
    network.add_node(node)
    with virtual_time(bench.scheduler):
        remap(node)
        unused = 1 if cyclic else 2
        for pdo in (node.tpdo[unused], node.rpdo[unused]):
            pdo.enabled = False
            pdo.save()
        node.nmt.state = "PRE-OPERATIONAL"
        node.setup_402_state_machine()
        node.nmt.state = "OPERATIONAL"
        if cyclic:
            network.sync.start(0.01)
            node.rpdo[2].start(0.01)
        else:
            # The library takes a TPDO for periodic as soon as it has come twice, and waits for it then.
            node.sdo[0x1800][5].raw = 20
        node.op_mode = "PROFILED VELOCITY"
        node.state = "OPERATION ENABLED"
        assert drive.state == DriveState.OPERATION_ENABLED
        assert bench.slave.get(0x6061) == 3
        node.state = "QUICK STOP ACTIVE"
        assert drive.state == DriveState.QUICK_STOP_ACTIVE
        node.state = "SWITCH ON DISABLED"
        drive.state = DriveState.FAULT
        drive.show()
        bench.run(20)
        assert node.is_faulted()
        node.reset_from_fault()
        assert drive.state == DriveState.OPERATION_ENABLED
    assert bench.scheduler.now < 5 * S


@pytest.mark.exhaustive
def test_real_time(kit):
    """The same classes work on a realtime scheduler, where time-outs are those of the wall clock."""
    scheduler = RealtimeScheduler()
    segment = CanMedium(scheduler, name="realtime")
    slave = CanopenSlave(scheduler, segment, kit.dictionary(), kit.NODE, name="drive1", boot_time_ns=20 * MS)
    with PumpedNetwork(segment) as network:
        node = network.add_node(kit.NODE, kit.dictionary(kit.NODE))
        slave.power_on()
        node.nmt.wait_for_bootup(5)
        node.sdo[0x2001].raw = "in real time"
        assert slave.get(0x2001) == "in real time"
        with virtual_time(scheduler) as clock:
            begin, before = time.monotonic(), clock.monotonic()
            clock.sleep(0.05)
            while clock.monotonic() < before + 0.1:
                pass
            assert time.monotonic() - begin >= 0.09
        slave.power_off()
        started = time.monotonic()
        with pytest.raises(canopen.SdoCommunicationError):
            node.sdo[0x1000].raw  # noqa: B018 - reading is the transfer
        assert time.monotonic() - started >= 0.3


@pytest.mark.exhaustive
def test_p402_in_real_time(kit):
    """On a realtime scheduler the library's polling loops run the scheduler inside `virtual_time`, in one
    thread.
    """
    scheduler = RealtimeScheduler()
    segment = CanMedium(scheduler, name="p402 in real time")
    slave = CanopenSlave(scheduler, segment, kit.dictionary(), kit.NODE, name="drive1")
    drive = MiniDrive(SimpleNamespace(slave=slave, scheduler=scheduler))
    with PumpedNetwork(segment) as network, virtual_time(scheduler):
        node = BaseNode402(kit.NODE, kit.dictionary(kit.NODE))
        network.add_node(node)
        slave.power_on()
        drive.show()
        node.nmt.wait_for_bootup(5)
        remap(node)
        for pdo in (node.tpdo[1], node.rpdo[1]):
            pdo.enabled = False
            pdo.save()
        node.setup_402_state_machine()
        node.nmt.state = "OPERATIONAL"
        network.sync.start(0.005)
        node.rpdo[2].start(0.005)
        node.state = "OPERATION ENABLED"
        assert drive.state == DriveState.OPERATION_ENABLED


@pytest.mark.exhaustive
def test_nmt_command_to_all(bench, network, node):
    """The network's own NMT object commands all nodes."""
    network.nmt.send_command(NmtCommand.START)
    bench.run()
    assert bench.slave.nmt_state == NmtState.OPERATIONAL
    assert node.nmt.state != "STOPPED"


@pytest.mark.exhaustive
def test_library_over_python_can(kit):
    """The library with its own network, threads and python-can's notifier talks to the slave over the hil
    interface.
    """
    scheduler = RealtimeScheduler()
    segment = CanMedium(scheduler, name="canopen-over-python-can")
    slave = CanopenSlave(scheduler, segment, kit.dictionary(), kit.NODE, name="drive1", boot_time_ns=50 * MS)
    content = bytes(range(256)) * 4
    stop = threading.Event()
    with canopen.Network() as network:
        network.connect(interface="hil", channel=segment.name)
        node = network.add_node(kit.NODE, kit.dictionary(kit.NODE))
        node.sdo.RESPONSE_TIMEOUT = 5
        runner = threading.Thread(target=scheduler.run_until, args=(stop.is_set, 120 * S))
        runner.start()
        try:
            scheduler.post(slave.power_on)
            node.nmt.wait_for_bootup(10)
            node.sdo[0x2001].raw = "by way of python-can"
            assert node.sdo[0x2001].raw == "by way of python-can"
            with node.sdo.open(0x2002, 0, "wb", size=len(content), block_transfer=True) as stream:
                stream.write(content)
            with node.sdo.open(0x2002, 0, "rb", block_transfer=True) as stream:
                assert stream.read() == content
            with pytest.raises(canopen.SdoAbortedError):
                node.sdo[0x6041].raw = 1
            node.sdo[0x1017].raw = 20
            node.nmt.state = "OPERATIONAL"
            assert node.nmt.wait_for_heartbeat(10) == "OPERATIONAL"
        finally:
            stop.set()
            scheduler.post(lambda: None)
            runner.join(30)
    assert slave.nmt_state == NmtState.OPERATIONAL
