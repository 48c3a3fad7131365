"""What is fuzzed, and what has to hold whatever comes: the promises of
docs/explanation/development.md, layer by layer.
"""

from __future__ import annotations

import math
import re
import struct
from collections import deque
from collections.abc import Callable, Iterable
from copy import copy
from functools import cache, partial
from typing import Any, Final

import numpy as np

from fieldbus.can import CanFrame, CanMedium, HookResult
from fieldbus.canopen import BootState, CanopenMaster, CanopenSlave, NmtState, NodeSetup, Parameter, PdoSetup
from fieldbus.canopen.decode import FrameDecoder
from fieldbus.canopen.sdo_server import SdoServer
from fieldbus.canopen.store import ObjectStore
from fieldbus.cia402 import DriveState, decode_state
from fieldbus.clock import MS, S, VirtualScheduler
from fieldbus.history import Event, History
from hil.bench.drives import object_dictionary
from testcases.fuzz.engine import Target
from testcases.fuzz.frames import NODE, frames

Take = Callable[[bytes], None]

_READ_DEVICE_TYPE: Final = bytes.fromhex("40 00 10 00 00 00 00 00")
_DEVICE_TYPE: Final = bytes.fromhex("43 00 10 00 92 01 02 00")
_RESET_NODE: Final = CanFrame(0, bytes((0x81, NODE)))
_UNCONFIGURED: Final = 255


def promise(holds: object, what: str) -> None:
    """Raise unless it holds."""
    if not holds:
        raise AssertionError(what)


# ------------------------------------------------------------------------------------------------- SDO server


def sdo() -> Take:
    """Return the server alone, over the dictionary of the servo drive; an input is a row of requests."""
    store = ObjectStore(object_dictionary(), NODE)
    server = SdoServer(store)

    def take(data: bytes) -> None:
        server.reset()
        for start in range(0, len(data), 8):
            answers = server.request(data[start : start + 8])
            promise(len(answers) <= 127, "more segments than a block has")
            promise(all(len(answer) == 8 for answer in answers), "an answer that has not eight bytes")
        server.request(bytes.fromhex("80 00 00 00 00 00 00 08"))
        promise(server.request(_READ_DEVICE_TYPE) == [_DEVICE_TYPE], "a plain request is not answered")
        promise(not server.active, "an expedited upload leaves a transfer behind")

    return take


# ------------------------------------------------------------------------------------------------- slave, LSS


class Loose:
    """A segment of one node without a medium: what is received goes in at once, what is sent is judged at
    once.
    """

    name = "loose"
    bitrate = 1_000_000
    online = True

    def __init__(self) -> None:
        self.scheduler = VirtualScheduler()
        self.heard: deque[CanFrame] = deque(maxlen=16)
        self.sent = 0
        self.judge: Callable[[CanFrame], None] = lambda frame: None
        self.receive: Callable[[CanFrame, int], None] = lambda frame, time_ns: None

    def attach(self, name: str, receive: Callable[[CanFrame, int], None]) -> Loose:
        self.receive = receive
        return self

    def send(self, frame: CanFrame) -> None:
        self.sent += 1
        promise(len(frame.data) <= 8, "a frame of more than eight bytes")
        promise(0 <= frame.can_id <= (0x1FFFFFFF if frame.extended else 0x7FF), "an identifier out of range")
        self.judge(frame)
        self.heard.append(frame)

    def send_all(self, frames: Iterable[CanFrame]) -> None:
        for frame in frames:
            self.send(frame)

    def detach(self) -> None:
        pass

    def feed(self, data: bytes) -> None:
        """Let a course of frames come."""
        for frame, pause_ns in frames(data):
            before = self.sent
            self.receive(frame, self.scheduler.now)
            promise(self.sent - before <= 300, "a flood of answers to one frame")
            if pause_ns:
                self.scheduler.run_for(pause_ns)


def _judge_for(slave: CanopenSlave) -> Callable[[CanFrame], None]:
    """Return what holds for every frame that a slave sends (table of A2, C301-012)."""
    boot_id, sdo_id = 0x700 + NODE, 0x580 + NODE

    def judge(frame: CanFrame) -> None:
        state, can_id = slave.nmt_state, frame.can_id
        if can_id in {boot_id, 0x7E4} or frame.extended:
            return
        promise(state != NmtState.STOPPED, f"{frame!r} in Stopped")
        if can_id == sdo_id:
            return
        restricted = can_id <= 0x7F or 0x101 <= can_id <= 0x180 or 0x581 <= can_id <= 0x5FF
        restricted = restricted or 0x601 <= can_id <= 0x67F or can_id >= 0x6E0
        promise(not restricted, f"{frame!r} has an identifier that is restricted")

    return judge


def slave() -> Take:
    """Return the slave with the dictionary of the servo drive, without the drive."""
    segment = Loose()
    node = CanopenSlave(segment.scheduler, segment, object_dictionary(), NODE, name="node")
    segment.judge = _judge_for(node)
    node.power_on()

    def take(data: bytes) -> None:
        segment.feed(data)  # to a node that has just been reset
        promise(node.nmt_state in set(NmtState), "an NMT state that does not exist")
        node.store.stored.clear()
        segment.receive(_RESET_NODE, segment.scheduler.now)
        segment.heard.clear()
        segment.receive(CanFrame(0x600 + NODE, _READ_DEVICE_TYPE), segment.scheduler.now)
        promise(CanFrame(0x580 + NODE, _DEVICE_TYPE) in segment.heard, "no answer after a reset")

    return take


def lss() -> Take:
    """Return a slave without a node-ID."""
    segment = Loose()
    node = CanopenSlave(segment.scheduler, segment, object_dictionary(), _UNCONFIGURED, name="node")
    delivered = copy(node.lss.stored)
    named = False

    def judge(frame: CanFrame) -> None:
        nonlocal named
        named = named or node.node_id != _UNCONFIGURED
        promise(named or frame.can_id == 0x7E4, f"{frame!r} from a node without a node-ID")

    segment.judge = judge

    def take(data: bytes) -> None:
        nonlocal named
        node.power_off()
        node.store.stored.clear()
        node.lss.stored = copy(delivered)
        node.power_on()
        named = False
        promise(node.node_id == _UNCONFIGURED, "a node that does not forget its node-ID")
        segment.feed(data)
        promise(1 <= node.node_id <= 127 or node.node_id == _UNCONFIGURED, "a node-ID that does not exist")

    return take


# ------------------------------------------------------------------------------------------------- master


def master() -> Take:
    """Return a controller that takes one node into service; the input is what comes from the bus
    meanwhile.
    """
    segment = Loose()
    scheduler = segment.scheduler
    controller = CanopenMaster(scheduler, segment)
    pdo = PdoSetup(True, 1, 0x180 + NODE, 1, (0x60410010, 0x60640020))
    node = controller.add_node(
        NodeSetup(
            NODE,
            "drive1",
            device_profile=402,
            prepare=(Parameter(0x6040, 0, 0, 2),),
            pdos=(pdo,),
            parameters=(Parameter(0x6085, 0, 1000, 4), Parameter(0x1017, 0, 50, 2)),
            store=True,
            heartbeat_timeout_ms=120,
        )
    )
    honest = False
    device = ObjectStore(object_dictionary(), NODE)
    server = SdoServer(device)

    def judge(frame: CanFrame) -> None:
        if frame.can_id == 0:
            promise(
                frame.data in (bytes((0x80, NODE)), bytes((0x01, NODE))), f"{frame!r}: no command of a boot"
            )
            return
        promise(
            frame.can_id == 0x600 + NODE and len(frame.data) == 8,
            f"{frame!r} is not for a controller to send",
        )
        if honest:
            for answer in server.request(frame.data):
                scheduler.post(partial(segment.receive, CanFrame(0x580 + NODE, answer), scheduler.now))

    segment.judge = judge

    def take(data: bytes) -> None:
        nonlocal honest
        honest = False
        node.stop()
        node.boot()
        segment.feed(data)
        # Whatever has happened: a device that starts again and answers as the standard says is taken in.
        honest = True
        server.reset()
        device.load(application=True)
        segment.receive(CanFrame(0x700 + NODE, b"\0"), scheduler.now)
        scheduler.run_for(5 * MS)
        promise(node.boot_state is BootState.STARTING, f"{node.boot_state} after a boot-up: {node.failure}")
        segment.receive(CanFrame(0x180 + NODE, bytes(8)), scheduler.now)
        promise(node.in_service, f"{node.boot_state} after a PDO")
        promise(device.values[0x608500] == 1000, "a parameter was not written")
        promise(len(node.emcys) <= 254, "EMCYs without end")

    return take


# ------------------------------------------------------------------------------------------------- decoder


def decoder() -> Take:
    """Return the bus monitor, which reads what others send."""
    monitor = FrameDecoder({NODE: "drive1"}, {NODE: object_dictionary()})

    def take(data: bytes) -> None:
        for frame, _ in frames(data):
            promise(monitor.decode(frame), "no words for a frame")

    return take


# ------------------------------------------------------------------------------------------------- drive


TRANSITIONS: Final = {
    (DriveState.NOT_READY_TO_SWITCH_ON, DriveState.SWITCH_ON_DISABLED),
    (DriveState.SWITCH_ON_DISABLED, DriveState.READY_TO_SWITCH_ON),
    (DriveState.READY_TO_SWITCH_ON, DriveState.SWITCHED_ON),
    (DriveState.SWITCHED_ON, DriveState.OPERATION_ENABLED),
    (DriveState.OPERATION_ENABLED, DriveState.SWITCHED_ON),
    (DriveState.SWITCHED_ON, DriveState.READY_TO_SWITCH_ON),
    (DriveState.READY_TO_SWITCH_ON, DriveState.SWITCH_ON_DISABLED),
    (DriveState.OPERATION_ENABLED, DriveState.READY_TO_SWITCH_ON),
    (DriveState.OPERATION_ENABLED, DriveState.SWITCH_ON_DISABLED),
    (DriveState.SWITCHED_ON, DriveState.SWITCH_ON_DISABLED),
    (DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE),
    (DriveState.QUICK_STOP_ACTIVE, DriveState.SWITCH_ON_DISABLED),
    (DriveState.FAULT_REACTION_ACTIVE, DriveState.FAULT),
    (DriveState.FAULT, DriveState.SWITCH_ON_DISABLED),
    (DriveState.QUICK_STOP_ACTIVE, DriveState.OPERATION_ENABLED),
    *((state, DriveState.FAULT_REACTION_ACTIVE) for state in DriveState if state != DriveState.FAULT),
    *((state, DriveState.NOT_READY_TO_SWITCH_ON) for state in DriveState),  # reset node
}
"""C402-001 to -017."""

WITH_TORQUE: Final = {
    DriveState.OPERATION_ENABLED,
    DriveState.QUICK_STOP_ACTIVE,
    DriveState.FAULT_REACTION_ACTIVE,
}


def drive() -> Take:
    """Return the whole emulated drive on a segment, its motor running when the input begins."""
    from emulators.drive.cia402 import CiA402Drive, DriveConfig

    def take(data: bytes) -> None:
        scheduler = VirtualScheduler()
        history = History(scheduler)
        medium = CanMedium(scheduler, keep_log=False)
        medium.attach("listener", lambda frame, time_ns: None)
        unit = CiA402Drive(
            scheduler,
            medium,
            DriveConfig.reference(node_id=NODE),
            name="drive",
            history=history,
            rng=np.random.default_rng(1),
        )

        def judge(event: Event) -> None:
            if event.kind == "drive.state":
                step = (event.data["from"], event.data["to"])
                promise(step in _NAMED, f"transition {step[0]} -> {step[1]}")

        history.listen(judge)
        unit.power_on()
        scheduler.run_for(5 * MS)
        store = unit.slave.store
        for index, content in ((0x6060, b"\x03"), (0x60FF, struct.pack("<i", 100_000))):
            store.write(index, 0, content)
        for word in (0x06, 0x07, 0x0F):
            store.write(0x6040, 0, word.to_bytes(2, "little"))
            scheduler.run_for(2 * MS)
        promise(unit.state is DriveState.OPERATION_ENABLED, "cannot be enabled")
        for frame, pause_ns in frames(data):
            medium.inject(frame, sender="fuzzer")
            scheduler.run_for(max(pause_ns, 200_000))
            word = int.from_bytes(store.read(0x6041, 0), "little")
            promise(decode_state(word) is unit.state, f"statusword {word:04X}h in {unit.state}")
            promise(unit.state in WITH_TORQUE or not unit.core.enabled, f"torque in {unit.state}")
            promise(all(math.isfinite(value) for value in unit.trace_row()), "a value that is no number")
        store.stored.clear()
        medium.inject(_RESET_NODE, sender="fuzzer")
        scheduler.run_for(S)
        promise(store.read(0x1000, 0) == _DEVICE_TYPE[4:], "no device type after a reset")
        promise(
            unit.state in (DriveState.SWITCH_ON_DISABLED, DriveState.FAULT), f"{unit.state} after a reset"
        )

    return take


_NAMED: Final = {(old.text, new.text) for old, new in TRANSITIONS}


# ------------------------------------------------------------------------------------------------- encoder


def encoder() -> Take:
    """Return a multi-turn encoder on a turning shaft."""
    from emulators.encoder import Mounting
    from emulators.encoder.cia406 import CiA406Encoder, EncoderDeviceConfig

    segment = Loose()
    angle = [0.0]
    unit = CiA406Encoder(
        segment.scheduler,
        segment,
        EncoderDeviceConfig(node_id=NODE),
        Mounting(lambda: angle[0]),
        name="encoder",
    )
    segment.judge = _judge_for(unit.slave)
    unit.power_on()
    device_type = b"\x43\x00\x10\x00" + unit.slave.store.read(0x1000, 0)

    def take(data: bytes) -> None:
        angle[0] += 1.0
        segment.feed(data)  # to an encoder that has just been reset
        unit.sample()
        store = unit.slave.store
        position = int.from_bytes(store.read(0x6004, 0), "little", signed=True)
        total = int.from_bytes(store.read(0x6002, 0), "little") or 1 << 32
        promise(-(1 << 31) <= position < max(total, 1 << 31), f"position {position} of {total} steps")
        promise(all(math.isfinite(value) for value in unit.trace_row()), "a value that is no number")
        unit.slave.store.stored.clear()
        segment.receive(_RESET_NODE, segment.scheduler.now)
        segment.heard.clear()
        segment.receive(CanFrame(0x600 + NODE, _READ_DEVICE_TYPE), segment.scheduler.now)
        promise(CanFrame(0x580 + NODE, device_type) in segment.heard, "no answer after a reset")

    return take


# ------------------------------------------------------------------------------------------------- adapter


_ANSWER: Final = re.compile(
    rb"(?:\x07|[zZ]?\r|V[0-9A-F]{4}\r|N[0-9A-Za-z]{4}\r|F[0-9A-F]{2}\r|A\r"
    rb"|[tr][0-9A-F]{3}[0-8](?:[0-9A-F]{2}){0,10}\r|[TR][0-9A-F]{8}[0-8](?:[0-9A-F]{2}){0,10}\r)*"
)


def slcan() -> Take:
    """Return the serial-line adapter; an input is the text of a program, in pieces, with frames of the bus
    between them.
    """
    from emulators.adapter import SlcanAdapter

    def take(data: bytes) -> None:
        sent: list[CanFrame] = []

        def transmit(frame: CanFrame) -> bool:
            promise(
                len(frame.data) <= 8 and frame.can_id <= (0x1FFFFFFF if frame.extended else 0x7FF), "no frame"
            )
            sent.append(frame)
            return len(sent) % 7 != 0

        adapter = SlcanAdapter(transmit, bitrate=500_000)
        for number, piece in enumerate(data.split(b"\xff")):
            answer = adapter.feed(piece)
            promise(_ANSWER.fullmatch(answer), f"answer {answer!r}")
            answer = adapter.deliver(CanFrame(number, piece[:8]), number * MS, free=100)
            promise(_ANSWER.fullmatch(answer), f"delivery {answer!r}")
        adapter.feed(b"\rC\r")
        promise(adapter.feed(b"V\r").startswith(b"V"), "no version after a close")

    return take


# ------------------------------------------------------------------------------------------------- medium


def medium() -> Take:
    """Return a segment with nodes that send, leave, return and are disturbed; an input is a row of two-byte
    orders.
    """

    def take(data: bytes) -> None:
        scheduler = VirtualScheduler()
        segment = CanMedium(scheduler, keep_log=True)
        received: dict[str, list[tuple[int, int]]] = {f"n{number}": [] for number in range(4)}
        sent: dict[str, int] = dict.fromkeys(received, 0)

        def receiver(name: str) -> Callable[[CanFrame, int], None]:
            return lambda frame, time_ns: received[name].append((time_ns, frame.can_id))

        ports = [segment.attach(name, receiver(name)) for name in received]
        disturbed: list[Any] = []

        def hook(frame: CanFrame, sender: str, time_ns: int) -> Any:
            return disturbed.pop(0) if disturbed else None

        segment.add_hook(hook)
        for order, value in zip(data[:200:2], data[1:200:2], strict=False):
            port = ports[order & 3]
            action = order >> 2 & 7
            if action <= 2 and port.online:
                port.send(CanFrame(value << 3 | order >> 5, bytes(value & 7)))
                sent[port.name] += 1
            elif action == 3:
                scheduler.run_for(value * 10_000)
            elif action == 4:
                disturbed.append(HookResult.corrupt(1 + value % 20))
            elif action == 5:
                disturbed.append(HookResult.drop() if value & 1 else HookResult.delay(value * 1000 + 1))
            elif action == 6:
                port.online = not port.online
            elif action == 7:
                port.recover()
            for one in ports:
                promise(0 <= one.tec <= 400, f"TEC {one.tec}")
                promise(0 <= one.rec <= 140, f"REC {one.rec}")
        for port in ports:
            port.online = True
        # Enough for all that waits. Not longer, because nodes that send the same frame at the same time never
        # get an acknowledgement, and repeat it for ever.
        scheduler.run_for(50 * MS)
        for name, course in received.items():
            times = [time_ns for time_ns, _ in course]
            promise(times == sorted(times), f"{name} received out of order")
            promise(len(set(times)) == len(times), f"{name} received two frames at once")
        starts = -1
        for end_ns, *_ in segment.log:
            promise(end_ns > starts, "two frames on the wire at once")
            starts = end_ns
        good = sum(1 for _, _, _, error in segment.log if not error)
        promise(good <= sum(sent.values()), "more frames than were sent")

    return take


@cache
def targets() -> dict[str, Target]:
    """Return all targets by name."""
    from testcases.fuzz.modbus_drive_target import modbus_drive  # these need `promise`
    from testcases.fuzz.modbus_targets import modbus, modbus_client
    from testcases.fuzz.parameter_target import parameters
    from testcases.fuzz.telegram_targets import telegrams

    listed = [
        Target(
            "medium", "CAN segment: sending, arbitration, errors, bus-off, nodes that come and go", medium
        ),
        Target("sdo", "SDO server: expedited, segmented and block transfers", sdo),
        Target("slave", "CANopen slave: every service, with time passing", slave),
        Target("master", "controller: taking a node into service, SDO client, supervision", master),
        Target("lss", "LSS slave without a node-ID", lss),
        Target("drive", "CiA 402 drive with its motor running", drive),
        Target("encoder", "CiA 406 encoder", encoder),
        Target("slcan", "serial-line adapter", slcan),
        Target("decoder", "bus monitor", decoder),
        Target("parameters", "PROFIdrive parameter access to axes at work", parameters),
        Target("telegram", "PROFIdrive telegrams: drive, encoder, port of the controller", telegrams),
        Target("modbus", "Modbus server behind TCP and on a serial line", modbus),
        Target(
            "modbus_client", "Modbus clients of both links, and the words of what they get", modbus_client
        ),
        Target("modbus_drive", "PROFIdrive axis behind its register maps", modbus_drive),
    ]
    return {target.name: target for target in listed}
