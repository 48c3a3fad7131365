"""The controller's cyclic CANopen services."""

from __future__ import annotations

import pytest

from fieldbus.can import CanFrame, CanMedium
from fieldbus.canopen import CanopenMaster, NmtCommand, NmtState
from fieldbus.clock import MS, VirtualScheduler
from fieldbus.errors import ConfigurationError
from fieldbus.history import History


class Line:
    """A master, and a listener that speaks raw frames."""

    def __init__(self) -> None:
        self.scheduler = VirtualScheduler()
        self.segment = CanMedium(self.scheduler)
        self.history = History(self.scheduler)
        self.master = CanopenMaster(self.scheduler, self.segment, history=self.history)
        self.heard: list[tuple[int, CanFrame]] = []
        self.port = self.segment.attach(
            "listener", lambda frame, time_ns: self.heard.append((time_ns, frame))
        )

    def send(self, can_id: int, data: str = "", **options) -> None:
        self.port.send(CanFrame(can_id, bytes.fromhex(data), **options))
        self.run(1)

    def run(self, milliseconds: float) -> None:
        self.scheduler.run_for(round(milliseconds * MS))


@pytest.fixture
def line():
    return Line()


@pytest.mark.requirement("C301-001", "C301-016")
def test_nmt_frame(line):
    """A node control command is two bytes on identifier 0: command and node."""
    line.master.nmt(NmtCommand.START, 5)
    line.master.nmt(NmtCommand.STOP)
    line.run(1)
    assert [frame for _, frame in line.heard] == [CanFrame(0, b"\x01\x05"), CanFrame(0, b"\x02\x00")]


@pytest.mark.parametrize(("command", "node"), [(0, 5), (3, 5), (0x83, 0), (1, -1), (1, 128), (2, 300)])
def test_nmt_command_that_does_not_exist_is_refused(line, command, node):
    """A command or node-ID that NMT does not have is a mistake of the caller, named with what there is;
    nothing is sent.
    """
    with pytest.raises(ConfigurationError, match=r"NMT (command: .* 01h START|node: .* 1\.\.127)"):
        line.master.nmt(command, node)
    line.run(1)
    assert line.heard == []


@pytest.mark.requirement("C301-002")
def test_sync_is_on_the_grid_and_first(line):
    """SYNC starts at k * period + phase, before whatever else happens at that instant."""
    before = []
    line.scheduler.every(4 * MS, lambda: before.append(line.master.sync_count), phase_ns=1 * MS)
    line.master.start_sync(4 * MS, 1 * MS)
    line.run(22)
    assert before == [1, 2, 3, 4, 5, 6]
    ends = [time_ns for time_ns, frame in line.heard if frame.can_id == 0x080]
    assert [time_ns // MS for time_ns in ends] == [1, 5, 9, 13, 17, 21]
    assert len({time_ns % MS for time_ns in ends}) == 1
    line.master.start_sync(10 * MS, 3 * MS)
    line.run(20)
    assert line.master.sync_count == 8
    line.master.stop_sync()
    line.run(20)
    assert line.master.sync_count == 8


@pytest.mark.requirement("C301-033")
def test_sync_counter(line):
    """With a counter SYNC carries 1 to the overflow value and begins again; other values are refused."""
    line.master.start_sync(MS, counter_overflow=3)
    line.run(6.5)
    assert b"".join(frame.data for _, frame in line.heard) == bytes((1, 2, 3, 1, 2, 3, 1))
    for value in (1, 241):
        with pytest.raises(ConfigurationError, match="counter_overflow"):
            line.master.start_sync(MS, counter_overflow=value)


@pytest.mark.requirement("C301-010", "C301-023")
def test_own_heartbeat(line):
    """The heartbeat of the controller comes at once and then with its period, until it is stopped."""
    line.run(3.3)
    line.master.produce_heartbeat(10 * MS)
    line.run(35)
    assert [frame for _, frame in line.heard] == [CanFrame(0x77F, b"\x05")] * 4
    line.master.produce_heartbeat(0)
    line.heard.clear()
    line.run(50)
    assert line.heard == []


@pytest.mark.requirement("C301-026", "C301-027")
def test_watched_heartbeat(line):
    """Monitoring starts with the first heartbeat, a loss is reported once, the first heartbeat after it
    tells the state again.
    """
    events: list[object] = []
    end = line.master.watch_heartbeat(5, 20 * MS, lambda: events.append("lost"), events.append)
    line.run(100)
    assert events == []
    for state in ("7F", "7F", "05"):
        line.send(0x705, state)
        line.run(15)
    assert events == [0x7F, 0x05]
    line.run(100)
    assert events == [0x7F, 0x05, "lost"]
    line.send(0x705, "05")
    assert events[3:] == [0x05]
    line.send(0x705, "00")
    line.run(100)
    assert events[4:] == [0x00]  # a boot-up is no loss
    end()
    line.send(0x705, "05")
    line.run(100)
    assert len(events) == 5
    assert [event.kind for event in line.history.events] == ["heartbeat.lost", "heartbeat.back"]


@pytest.mark.requirement("C301-026")
def test_loss_comes_exactly_after_the_timeout(line):
    """The loss is reported one timeout after the last heartbeat."""
    lost = []
    line.master.watch_heartbeat(5, 20 * MS, lambda: lost.append(line.scheduler.now))
    last = []
    line.master.subscribe(0x705, lambda _data, time_ns: last.append(time_ns))
    for _ in range(3):
        line.send(0x705, "05")
        line.run(10)
    line.run(100)
    assert lost == [last[-1] + 20 * MS]


@pytest.mark.parametrize(
    ("node", "timeout_ns", "where"), [(0, 1, "node"), (128, 1, "node"), (5, 0, "timeout_ns")]
)
def test_bad_watches_are_refused(line, node, timeout_ns, where):
    """Node and timeout are checked at once."""
    with pytest.raises(ConfigurationError, match=where):
        line.master.watch_heartbeat(node, timeout_ns)


@pytest.mark.requirement("C301-003", "C301-108")
def test_emcy_callback(line):
    """An EMCY is given as code, register and manufacturer bytes; a frame of another length is ignored."""
    seen = []
    remove = line.master.on_emcy(5, lambda *emcy: seen.append(emcy))
    line.send(0x085, "11 86 21 01 02 03 04 05")
    line.send(0x085, "11 86 21")
    line.send(0x086, "10 23 03 00 00 00 00 00")
    assert seen == [(0x8611, 0x21, b"\x01\x02\x03\x04\x05")]
    assert [event.data for event in line.history.select(kind="emcy.received")] == [
        {"node": 5, "code": 0x8611, "register": 0x21}
    ]
    remove()
    line.send(0x085, "11 86 21 01 02 03 04 05")
    assert len(seen) == 1


@pytest.mark.requirement("C301-022")
def test_bootup_callback(line):
    """A boot-up is the byte 00h; heartbeats are none."""
    seen = []
    line.master.on_bootup(5, lambda: seen.append(line.scheduler.now))
    line.send(0x705, "7F")
    line.send(0x705, "")
    assert seen == []
    line.send(0x705, "00")
    assert len(seen) == 1


def test_subscriptions(line):
    """Several callbacks on one identifier are called in order; removing one leaves the others; remote frames
    do not count.
    """
    seen = []
    first = line.master.subscribe(0x185, lambda data, _time: seen.append(("first", data)))
    line.master.subscribe(0x185, lambda data, _time: seen.append(("second", data)))
    line.send(0x185, "01")
    first()
    first()
    line.send(0x185, "02")
    line.port.send(CanFrame(0x185, remote=True))
    line.port.send(CanFrame(0x185, b"\x03", extended=True))
    line.run(1)
    assert seen == [("first", b"\x01"), ("second", b"\x01"), ("second", b"\x02")]


def test_callback_may_end_its_own_subscription(line):
    """A callback that removes itself while it is called does not disturb the others."""
    seen = []

    def once(data, _time):
        remove()
        seen.append(data)

    remove = line.master.subscribe(0x185, once)
    line.master.subscribe(0x185, lambda data, _time: seen.append(data))
    line.send(0x185, "01")
    line.send(0x185, "02")
    assert seen == [b"\x01", b"\x01", b"\x02"]


@pytest.mark.requirement("C301-028")
def test_remote_frames_can_be_sent(bench):
    """The master asks for guarding with a remote frame, and the slave answers it."""
    master = CanopenMaster(bench.scheduler, bench.segment)
    states = []
    master.subscribe(0x705, lambda data, _time: states.append(data[0]))
    for _ in range(3):
        master.send_remote(0x705, 1)
        bench.run(2)
    assert states == [0x7F, 0xFF, 0x7F]


@pytest.mark.requirement("C301-019", "C301-035", "C301-036")
def test_one_cycle_between_master_and_slave(bench):
    """What is sampled at SYNC k is with the master in the same cycle; what it sends then is effective at SYNC
    k + 1.
    """
    master = CanopenMaster(bench.scheduler, bench.segment)
    slave = bench.slave
    effective, sampled = [], []
    slave.on_write(0x60FF, 0, lambda value: effective.append((bench.scheduler.now // MS, value)))
    slave.on_sync.append(lambda time_ns: slave.values.__setitem__(0x606400, time_ns // MS))
    master.subscribe(
        0x285, lambda data, time_ns: sampled.append((time_ns // MS, int.from_bytes(data[2:6], "little")))
    )
    master.nmt(NmtCommand.START, 5)
    bench.run(2)
    start = bench.scheduler.now // MS
    master.start_sync(4 * MS)

    def application():
        now = bench.scheduler.now // MS
        master.send(0x305, b"\x0f\0" + now.to_bytes(4, "little") + b"\x09")

    bench.scheduler.every(4 * MS, application, phase_ns=2 * MS)
    bench.run(20)
    assert slave.nmt_state == NmtState.OPERATIONAL
    first = (start + 3) // 4 * 4
    assert sampled[:3] == [(first + 4 * k, first + 4 * k) for k in range(3)]
    assert effective[:3] == [(value + 2, value) for _, value in effective[:3]]


@pytest.mark.parametrize("node_id", [0, 128])
def test_bad_node_id_is_refused(line, node_id):
    """A master's node-ID is 1 to 127."""
    with pytest.raises(ConfigurationError, match="node_id"):
        CanopenMaster(line.scheduler, line.segment, name="other", node_id=node_id)
