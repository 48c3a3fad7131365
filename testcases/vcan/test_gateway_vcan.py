"""Two real interfaces: bridges by our process and by the kernel, and what happens to an interface under a
bench.
"""

from __future__ import annotations

import os
import signal
import socket
import struct
import subprocess
import time

import can
import pytest

from fieldbus.can import CanFrame, HookResult
from fieldbus.can.gateway import Gateway, GatewayRule, Modification, XorChecksum
from fieldbus.can.live import LiveSegment
from fieldbus.clock import MS, RealtimeScheduler, S
from fieldbus.errors import BusError, UnsupportedFaultError
from fieldbus.history import History
from hil.bench import BenchFile
from hil.faults import Injector
from testcases.physical_support import emulate, run_round_trip
from testcases.processes import program

pytestmark = pytest.mark.vcan

WAIT = 20 * S
PATIENCE_S = 20.0
SETTLE_S = 0.1


@pytest.fixture(scope="session", autouse=True)
def _administrator():
    """Fail, and do not skip, where the network cannot be configured."""
    if os.geteuid() != 0:
        pytest.fail(
            "rules of the kernel's gateway need root: hil vcan --count 2 --where uml -- pytest -m vcan",
            pytrace=False,
        )


@pytest.fixture
def near(vcan_channel):
    with can.Bus(interface="socketcan", channel=vcan_channel) as bus:
        yield bus


@pytest.fixture
def far(far_channel):
    with can.Bus(interface="socketcan", channel=far_channel) as bus:
        yield bus


def message(can_id, data=b"", **options):
    return can.Message(arbitration_id=can_id, data=data, **{"is_extended_id": False, **options})


def heard(bus, count=1):
    """Return what a bus hears, and make sure that it is not more than `count`."""
    found = []
    end = time.monotonic() + PATIENCE_S
    while len(found) < count and time.monotonic() < end:
        received = bus.recv(0.1)
        if received is not None:
            found.append((received.arbitration_id, bytes(received.data)))
    assert bus.recv(SETTLE_S) is None
    return found


# -- the gateway of the kernel
# -------------------------------------------------------------------------------------

DATA = bytes.fromhex("1122334455667788")
MODIFICATIONS = [
    ((), None, 0x123, DATA),
    (
        (Modification("AND", data=b"\x0f\xf0\xff\xff\xff\xff\xff\xff"),),
        None,
        0x123,
        bytes.fromhex("0120334455667788"),
    ),
    ((Modification("OR", data=b"\x80"),), None, 0x123, bytes.fromhex("9122334455667788")),
    ((Modification("XOR", data=b"\xff" * 8),), None, 0x123, bytes.fromhex("eeddccbbaa998877")),
    ((Modification("SET", data=b"\x01\x02"),), None, 0x123, b"\x01\x02" + bytes(6)),
    ((Modification("SET", length=2),), None, 0x123, DATA[:2]),
    ((Modification("SET", can_id=0x321),), None, 0x321, DATA),
    ((Modification("XOR", can_id=0x00F, data=b"\x01"),), None, 0x12C, b"\x10" + DATA[1:]),
    ((Modification("AND", can_id=0x7F0, length=4),), None, 0x120, b""),  # 8 AND 4
    (
        (Modification("OR", data=b"\x0f"), Modification("SET", can_id=0x200, length=3)),
        XorChecksum(0, 1, 2, 0x55),
        0x200,
        bytes([0x1F, 0x22, 0x1F ^ 0x22 ^ 0x55]),
    ),
]


@pytest.mark.parametrize(("modifications", "checksum", "can_id", "data"), MODIFICATIONS)
def test_the_kernel_changes_frames(
    near, far, vcan_channel, far_channel, modifications, checksum, can_id, data
):
    """AND, OR, XOR and SET on identifier, length and data, and a checksum that is set right afterwards."""
    rule = GatewayRule(vcan_channel, far_channel, modifications=modifications, checksum=checksum)
    with Gateway() as gateway:
        gateway.add(rule)
        near.send(message(0x123, DATA))
        assert heard(far) == [(can_id, data)]
        [count] = gateway.counts()
        assert (count.source, count.destination, count.handled) == (vcan_channel, far_channel, 1)
        far.send(message(0x123, DATA))
        assert heard(near, 0) == []
    near.send(message(0x123, DATA))
    assert heard(far, 0) == []


def test_the_kernel_picks_frames(near, far, vcan_channel, far_channel):
    """A rule may hold for some identifiers or for all but those: what no rule holds for is dropped."""
    with Gateway() as gateway:
        chosen = GatewayRule(vcan_channel, far_channel, 0x180, 0x780)
        others = GatewayRule(vcan_channel, far_channel, 0x180, 0x780, inverted=True)
        for rule, passing in ((chosen, [0x181, 0x1FF]), (others, [0x080, 0x205])):
            gateway.add(rule)
            for can_id in (0x080, 0x181, 0x1FF, 0x205):
                near.send(message(can_id))
            assert [one for one, _ in heard(far, 2)] == passing
            gateway.remove(rule)
            gateway.remove(rule)
        assert gateway.counts() == []


def test_the_kernel_limits_hops(near, far, vcan_channel, far_channel):
    """Two rules in opposite directions make no circle: a frame is passed on once, or as often as the rules
    allow.
    """
    there, back = GatewayRule(vcan_channel, far_channel), GatewayRule(far_channel, vcan_channel)
    with Gateway() as gateway:
        gateway.add(there)
        gateway.add(back)
        near.send(message(0x123))
        assert heard(far) == [(0x123, b"")]
        assert heard(near, 0) == []


def test_cangw_sees_our_rules_and_we_see_its(far_channel, vcan_channel, near, far):
    """The program of can-utils lists our rules in its own words, and a rule that it has added does what it
    says.
    """
    cangw = program("cangw")
    with Gateway() as gateway:
        change = Modification("SET", can_id=0x333, length=4, data=DATA)
        gateway.add(
            GatewayRule(
                vcan_channel,
                far_channel,
                0x123,
                0x7FF,
                modifications=(change,),
                checksum=XorChecksum(0, 2, 3),
            )
        )
        listed = subprocess.run([cangw, "-L"], capture_output=True, text=True, check=False).stdout
        assert f"cangw -A -s {vcan_channel} -d {far_channel} -e" in listed
        assert "-f 123:7FF" in listed
        assert "-m SET:ILD:333.4.1122334455667788" in listed.replace("SET:IDL", "SET:ILD")
        assert "-x 0:2:3:0" in listed
    rule = ["-s", vcan_channel, "-d", far_channel, "-e", "-f", "123:7FF", "-m", "SET:D:0.0.AABB000000000000"]
    subprocess.run([cangw, "-A", *rule], check=True, timeout=PATIENCE_S)
    try:
        near.send(message(0x123, b"\x01\x02"))
        assert heard(far) == [(0x123, b"\xaa\xbb")]
        with Gateway() as gateway:
            assert [one.handled for one in gateway.counts()] == [1]
    finally:
        subprocess.run([cangw, "-D", *rule], check=True, timeout=PATIENCE_S)


def test_the_kernel_says_what_it_refuses(vcan_channel):
    """An interface that does not exist is named."""
    with Gateway() as gateway, pytest.raises(BusError, match="there is no interface 'nosuch0'"):
        gateway.add(GatewayRule(vcan_channel, "nosuch0"))


# -- benches
# ------------------------------------------------------------------------------------------------------

OBSERVER = """
[bench]
name = "between"
kind = "live"

[segment.can0]
interface = "socketcan"
channel = "{near}"
bridge = {{ channel = "{far}", gateway = "{gateway}" }}

[drive.x]
segment = "can0"
node_id = 5
device = "physical"
"""


@pytest.fixture
def observer(request, vcan_channel, far_channel):
    text = OBSERVER.format(near=vcan_channel, far=far_channel, gateway=request.param)
    with BenchFile("own.toml", text).build() as bench:
        yield bench


@pytest.mark.parametrize("observer", ["bench", "kernel"], indirect=True)
def test_faults_between_strangers_on_real_interfaces(observer, near, far):
    """Frames pass both ways; dropping and replacing hit one identifier of one direction, and end when they
    are removed.
    """
    faults = Injector(observer)

    def exchange():
        near.send(message(0x205, b"\x0f\x00"))
        far.send(message(0x185, b"\x37\x02"))
        far.send(message(0x285, b"\x01"))
        observer.run_for(SETTLE_S)
        return heard(far, 1), sorted(heard(near, 2))

    everything = ([(0x205, b"\x0f\x00")], [(0x185, b"\x37\x02"), (0x285, b"\x01")])
    assert exchange() == everything
    armed = faults.inject("frame.replace", drive="x", message="tpdo1", data="08 00 00")
    assert exchange() == (everything[0], [(0x185, b"\x08\x00\x00"), (0x285, b"\x01")])
    armed.remove()
    assert [event.data["hit"] for event in observer.history.select(kind="fault.hit")] == [1]
    assert exchange() == everything
    armed = faults.inject("frame.drop", drive="x", message="tpdo1", sender=far.channel)
    near.send(message(0x205))
    far.send(message(0x185))
    observer.run_for(SETTLE_S)
    assert (heard(far, 1), heard(near, 0)) == ([(0x205, b"")], [])
    armed.remove()
    assert exchange() == everything


@pytest.mark.parametrize("observer", ["kernel"], indirect=True)
@pytest.mark.parametrize(
    ("kind", "options", "reason"),
    [
        ("frame.delay", {"delay_s": 0.01}, "only passes on, drops and changes"),
        ("frame.duplicate", {}, "only passes on, drops and changes"),
        ("frame.drop", {"count": 3}, "does not count frames"),
        ("frame.drop", {"probability": 0.5}, "treats all frames of an identifier alike: probability"),
        ("frame.drop", {"every": 2}, "treats all frames of an identifier alike: every"),
        ("frame.corrupt", {}, "bit errors need access"),
    ],
)
def test_what_the_kernel_cannot_do_is_refused(observer, kind, options, reason):
    """A rule cannot delay, repeat, count or draw lots: the fault is refused with what is missing."""
    with pytest.raises(UnsupportedFaultError, match=reason):
        Injector(observer).inject(kind, can_id=0x185, **options)


@pytest.mark.parametrize("observer", ["kernel"], indirect=True)
def test_two_faults_of_one_direction_are_refused(observer):
    """A rule leaves out one pattern of identifiers; the second fault says so, and works when the first has
    gone.
    """
    faults = Injector(observer)
    first = faults.inject("frame.drop", can_id=0x185)
    with pytest.raises(UnsupportedFaultError, match="one fault at a time"):
        faults.inject("frame.drop", can_id=0x285)
    first.remove()
    faults.inject("frame.drop", can_id=0x285)


def test_a_bench_takes_its_rules_along(near, far, vcan_channel, far_channel):
    """After the bench nothing passes any more."""
    with BenchFile("own.toml", OBSERVER.format(near=vcan_channel, far=far_channel, gateway="kernel")).build():
        near.send(message(0x100))
        assert heard(far) == [(0x100, b"")]
    near.send(message(0x100))
    assert heard(far, 0) == []
    with Gateway() as gateway:
        assert gateway.counts() == []


def test_physical_drive_beyond_a_bridge(vcan_channel, far_channel, tmp_path):
    """Enable, home, move, stop and a lost bus against a drive of another process, on the far side of a
    bridge.
    """
    drives = emulate(tmp_path, {"interface": "socketcan", "channel": far_channel})
    try:
        place = {"interface": "socketcan", "channel": vcan_channel, "bridge": {"channel": far_channel}}
        run_round_trip(tmp_path, place)
        assert drives.end(signal.SIGTERM) == 0
    finally:
        drives.kill()


# -- an interface under a segment
# -----------------------------------------------------------------------------------


@pytest.mark.parametrize("gateway", ["bench", "kernel"])
def test_frames_of_can_fd_pass_a_bridge(vcan_channel, far_channel, gateway):
    """On a segment with `data_bitrate` frames of CAN FD pass in both directions, intact, beside classic
    ones; a drop by the identifier hits either kind, and then all pass again.
    """
    scheduler = RealtimeScheduler()
    scheduler.every(10 * MS, lambda: None)
    segment = LiveSegment.open(
        scheduler,
        interface="socketcan",
        channel=vcan_channel,
        bridge={"channel": far_channel, "gateway": gateway},
        name="can0",
        fd_bitrate=2_000_000,
    )
    frames = [
        message(0x321, bytes(range(64)), is_fd=True, bitrate_switch=True),
        message(0x1ABCDEF0, bytes(12), is_fd=True, is_extended_id=True),
        message(0x322, b"classic"),
    ]
    wanted = [(one.arbitration_id, bytes(one.data)) for one in frames]

    def passed(source, sink, count):
        for one in frames:
            source.send(one)
        found = []
        scheduler.run_until(lambda: _take(sink, found) >= count, WAIT)
        scheduler.run_for(50 * MS)
        _take(sink, found)
        return [(one.arbitration_id, bytes(one.data)) for one in found]

    try:
        with (
            can.Bus(interface="socketcan", channel=vcan_channel, fd=True) as near,
            can.Bus(interface="socketcan", channel=far_channel, fd=True) as far,
        ):
            assert passed(near, far, 3) == wanted
            assert passed(far, near, 3) == wanted
            if segment.kernel is not None:
                treatment = segment.kernel.treat(0x321, 0x7FF)
                with pytest.raises(UnsupportedFaultError, match="one fault at a time"):
                    segment.kernel.check_free()
                assert passed(near, far, 2) == wanted[1:]
                treatment.withdraw()
                assert passed(near, far, 3) == wanted
    finally:
        segment.close()


def _take(bus, found):
    while (received := bus.recv(0)) is not None:
        found.append(received)
    return len(found)


class Desk:
    """A live segment on an interface that can be taken down, and a foreign socket on the same."""

    def __init__(self, channel):
        self.channel = channel
        self.scheduler = RealtimeScheduler()
        self.scheduler.every(10 * MS, lambda: None)  # conditions are looked at after events
        self.history = History(self.scheduler)
        self.segment = LiveSegment.open(
            self.scheduler, interface="socketcan", channel=channel, name="can0", history=self.history
        )
        self.received = []
        self.port = self.segment.attach("node", lambda frame, _time_ns: self.received.append(frame))

    def set(self, state):
        subprocess.run([program("ip"), "link", "set", self.channel, state], check=True, timeout=PATIENCE_S)

    def reported(self):
        return [event.data["status"] for event in self.history.select(kind="can.status")]


@pytest.fixture
def desk(far_channel):
    desk = Desk(far_channel)
    yield desk
    desk.segment.close()
    desk.set("up")


def test_an_interface_that_goes_down_and_comes_back(desk):
    """One DOWN for as long as the interface is down, whether or not somebody tries to send, and one UP
    afterwards.
    """
    desk.port.send(CanFrame(0x100))
    desk.set("down")
    assert desk.scheduler.run_until(lambda: desk.segment.down, WAIT)
    for _ in range(4):
        desk.scheduler.run_for(150 * MS)
        with pytest.raises(BusError, match="Network is down"):
            desk.port.send(CanFrame(0x101))
    assert desk.reported() == ["DOWN"]
    desk.set("up")
    assert desk.scheduler.run_until(lambda: not desk.segment.down, WAIT)
    desk.port.send(CanFrame(0x102))
    with can.Bus(interface="socketcan", channel=desk.channel) as foreign:
        foreign.send(message(0x200))
        assert desk.scheduler.run_until(lambda: CanFrame(0x200) in desk.received, WAIT)
    assert desk.reported() == ["DOWN", "UP"]


def test_fd_and_error_frames_of_an_interface(desk):
    """CAN FD frames are counted and reported once, error frames are events with their meaning; the next frame
    arrives.
    """
    with (
        can.Bus(interface="socketcan", channel=desk.channel, fd=True) as foreign,
        socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as raw,
    ):
        raw.bind((desk.channel,))
        for _ in range(3):
            foreign.send(message(0x100, bytes(64), is_fd=True))
        raw.send(struct.pack("=IB3x8s", 0x2000_0088, 8, bytes([0, 0, 4, 0, 0, 0, 0, 0])))
        raw.send(struct.pack("=IB3x8s", 0x2000_0004, 8, bytes([0, 0x20, 0, 0, 0, 0, 0, 0])))
        foreign.send(message(0x200))
        assert desk.scheduler.run_until(lambda: desk.received, WAIT)
    assert desk.received == [CanFrame(0x200)]
    assert desk.segment.ignored == {"fd": 3, "garbled": 0}
    reported = [
        (event.kind, event.data.get("code") or event.data.get("status")) for event in desk.history.events
    ]
    assert reported == [
        ("can.ignored", None),
        ("can.bus_error", "BIT_STUFFING_ERROR"),
        ("can.status", "ERROR_PASSIVE"),
    ]


def test_order_through_a_bridge_of_our_own(near, far, vcan_channel, far_channel):
    """A burst from either side keeps its order, without a fault and with one that lets everything pass."""
    scheduler = RealtimeScheduler()
    bridge = {"channel": far_channel}
    with LiveSegment.open(scheduler, interface="socketcan", channel=vcan_channel, bridge=bridge) as segment:
        numbers = list(range(0x100, 0x140))
        for number in numbers:
            near.send(message(number))
        assert [one for one, _ in heard(far, len(numbers))] == numbers
        segment.add_hook(lambda frame, sender, time_ns: HookResult.drop() if frame.can_id & 1 else None)
        for number in numbers:
            far.send(message(number))
        scheduler.run_for(500 * MS)
        assert [one for one, _ in heard(near, len(numbers) // 2)] == numbers[::2]
