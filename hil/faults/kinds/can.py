"""Faults of a CAN segment as a whole, and of the CAN controllers on it."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Final, Generic, TypeVar

from fieldbus.can.frame import CanFrame
from fieldbus.can.timing import frame_time_ns
from fieldbus.clock import MS, S, seconds_to_ns
from fieldbus.errors import BusError, ConfigurationError, UnsupportedFaultError
from hil.faults._kind import Action, Custom, Family, FaultType, Injection, Work, override_action
from hil.faults._overrides import Override
from hil.faults._parameters import Environment, Parameter, Values
from hil.faults._payload import check_identifiers, check_payload, parse_payload
from hil.faults.seams import BridgedSegment, BusSegment, CanPort, LiveSegment, VirtualSegment, offers

if TYPE_CHECKING:
    from fieldbus.clock import Timer

V = TypeVar("V")
_LOAD_NODE: Final = "load"
_QUEUED_AHEAD: Final = 2
_CATCH_UP_NS: Final = 100 * MS
_LIVE_BABBLE_PERIOD_NS: Final = MS


# -- the segment and its nodes ---------------------------------------------------------------------------


def _segment(injection: Injection) -> BusSegment:
    """Return the segment that is meant, checked: virtual or live."""
    segment: BusSegment = injection.bench.segment(injection.target or None)
    injection.check_environment(segment)
    if not offers(segment, LiveSegment) and not offers(segment, VirtualSegment):
        injection.refuse(f"{segment.name} is no virtual segment")
    return segment


def _bitrate(injection: Injection, segment: BusSegment) -> int:
    """Return the bit rate of a segment, bit/s."""
    if segment.bitrate is None:
        injection.refuse(f"the bit rate of {segment.name} is not known")
    return segment.bitrate


def _virtual(injection: Injection) -> VirtualSegment:
    """Return the segment that is meant, checked: virtual."""
    segment = _segment(injection)
    if not offers(segment, VirtualSegment):
        injection.refuse(f"{segment.name} is no virtual segment")
    return segment


def _ports(injection: Injection, segment: VirtualSegment) -> list[CanPort]:
    """Return the nodes that a fault names; all if it names none."""
    values, by_name = injection.values, {port.name: port for port in segment.ports}
    key = "nodes" if injection.kind.has("nodes") else "node"
    wanted = values.names("nodes") or list(by_name) if key == "nodes" else [values.text("node")]
    for name in wanted:
        if name not in by_name:
            raise injection.wrong(key, ", ".join(by_name) or "no nodes", name)
    return [by_name[name] for name in wanted]


@dataclass(frozen=True)
class AtNodes(Generic[V]):
    """The effect of a kind that sets one thing at every node that the fault names.

    Args:
        setting: What is set, from the parameters.
        set: Sets it at a node.
        usual: What it is without a fault, asked for when the fault is armed.

    """

    setting: Callable[[Values], V]
    set: Callable[[CanPort, V], object]
    usual: Callable[[CanPort], V]
    needs: None = None

    def __call__(self, injection: Injection) -> Action:
        """Return the action of one fault."""
        segment = _virtual(injection)
        setting = self.setting(injection.values)

        def set_if_there(port: CanPort, value: V) -> None:
            if not port.detached:
                self.set(port, value)

        def override(port: CanPort) -> Override[V]:
            return injection.override(
                (segment.name, injection.kind.name, port.name),
                setting,
                lambda settings: set_if_there(port, settings[-1]),
                partial(set_if_there, port, self.usual(port)),
            )

        return override_action(segment.name, *map(override, _ports(injection, segment)))


def _set_receive_delay(port: CanPort, delay_ns: int) -> None:
    port.receive_delay_ns = delay_ns


def _set_buffers(port: CanPort, buffers: int) -> None:
    port.tx_buffers = buffers


def _bus_off(injection: Injection) -> Action:
    """Return the action that puts a node into bus-off."""
    segment = _virtual(injection)
    (port,) = _ports(injection, segment)
    usual = port.auto_recovery

    def leave(automatic: bool) -> None:
        port.auto_recovery = automatic
        port.set_error_counters(tec=256)

    def recover() -> None:
        port.auto_recovery = usual
        port.recover()

    override = injection.override(
        (segment.name, injection.kind.name, port.name),
        injection.values.text("recovery") == "automatic",
        lambda settings: leave(settings[-1]),
        recover,
        repeat=True,
    )
    return override_action(segment.name, override)


# -- the wire --------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class HeldLevel:
    """The effect of a bus that stays at a level: 0 dominant, 1 recessive."""

    level: int
    needs: None = None

    def __call__(self, injection: Injection) -> Action:
        """Return the action of one fault."""
        segment = _virtual(injection)
        override = injection.override(
            (segment.name, "level"),
            self.level,
            lambda settings: segment.hold_level(settings[-1]),
            lambda: segment.hold_level(None),
        )
        return override_action(segment.name, override)


def _noise(injection: Injection) -> Action:
    """Return the action that inverts bits at random; the distance of two wrong
    bits has a geometric distribution.
    """
    segment, bench = _virtual(injection), injection.bench
    rate = injection.values.number("bit_error_rate")
    nodes = [port.name for port in _ports(injection, segment)] if injection.values.names("nodes") else None
    rng = bench.rng(injection.stream)
    timer: Timer | None = None

    def wait() -> None:
        nonlocal timer
        bits = int(rng.geometric(rate))
        timer = bench.scheduler.after(bits * S // segment.bitrate, flip)

    def flip() -> None:
        segment.flip_bit(nodes)
        wait()

    def stop() -> None:
        if timer is not None:
            timer.cancel()

    return Action(segment.name, wait, stop)


def _break(injection: Injection) -> Action:
    """Return the action that breaks the cable: between nodes, or between the sides of a live bridge."""
    segment = _segment(injection)
    key = "nodes" if injection.kind.has("nodes") else "node"
    cut: Callable[[], Work]
    if offers(segment, LiveSegment):
        if not offers(segment, BridgedSegment) or not segment.bridged:
            raise UnsupportedFaultError(
                f"{injection.kind.name} cannot be injected on {segment.name}: it needs access to the cable, "
                "or a bridge of the bench"
            )
        sides = [side.name for side in segment.sides]
        for name in (one.strip() for one in injection.values.text(key).split(",")):
            if name not in sides:
                raise injection.wrong(key, ", ".join(sides), name)
        cut = segment.cut
    else:
        medium = _virtual(injection)
        ports = _ports(injection, medium)
        if len({port.name for port in ports}) == len(medium.ports):
            names = ", ".join(port.name for port in medium.ports)
            raise injection.wrong(key, f"some of {names}, not all: a break has two sides")

        def cut() -> Work:
            try:
                return medium.cut([port.name for port in ports])
            except BusError as error:
                raise UnsupportedFaultError(f"the cable cannot be broken there: {error}") from error

    join: list[Work] = []

    def remove() -> None:
        if join:
            join.pop()()

    return Action(segment.name, lambda: join.append(cut()), remove)


# -- foreign nodes ---------------------------------------------------------------------------------------


def _babble(injection: Injection) -> Action:
    """Return the action of a babbling node.

    On a virtual segment its queue is never empty. On a live one it sends in bursts, because no timer
    of a program comes as often as a frame on the wire: every millisecond as many frames as the wire
    could carry, or the adapter takes.
    """
    segment, scheduler, values = _segment(injection), injection.bench.scheduler, injection.values
    node = values.text("node")
    frame = CanFrame(
        values.integer("can_id"),
        parse_payload(injection.kind.name, values),
        extended=values.flag("extended"),
    )
    frame_ns = frame_time_ns(frame, _bitrate(injection, segment))
    timer: Timer | None = None

    if offers(segment, VirtualSegment):
        medium, period_ns = segment, frame_ns

        def begin() -> None:
            for _ in range(_QUEUED_AHEAD):
                medium.inject(frame, sender=node)
            send()

        def send_some() -> None:
            if medium.injected(node) < _QUEUED_AHEAD:
                medium.inject(frame, sender=node)

        def stop() -> None:
            if timer is not None:
                timer.cancel()
            medium.withdraw(node)

    else:
        period_ns = _LIVE_BABBLE_PERIOD_NS
        burst = max(1, period_ns // frame_ns)

        def begin() -> None:
            send()

        def send_some() -> None:
            with suppress(BusError):  # the adapter's queue is full, which is what was wanted
                for _ in range(burst):
                    segment.inject(frame, sender=node)

        def stop() -> None:
            if timer is not None:
                timer.cancel()

    def send() -> None:
        nonlocal timer
        send_some()
        timer = scheduler.after(period_ns, send)

    return Action(segment.name, begin, stop)


def _load(injection: Injection) -> Action:
    """Return the action of a node that sends random frames; each is followed by as much time as makes
    the load.
    """
    segment, scheduler, values = _segment(injection), injection.bench.scheduler, injection.values
    share, bitrate = values.number("load_percent") / 100.0, _bitrate(injection, segment)
    lowest_id, highest_id = values.integer("lowest_id"), values.integer("highest_id")
    shortest, longest = values.integer("shortest"), values.integer("longest")
    extended = values.flag("extended")
    rng = injection.bench.rng(injection.stream)
    due_ns = 0
    timer: Timer | None = None

    def draw() -> CanFrame:
        can_id = int(rng.integers(lowest_id, highest_id + 1))
        data = rng.bytes(int(rng.integers(shortest, longest + 1)))
        return CanFrame(can_id, data, extended=extended)

    def begin() -> None:
        nonlocal due_ns
        due_ns = scheduler.now
        send()

    def send() -> None:
        nonlocal due_ns, timer
        frame = draw()
        with suppress(BusError):  # the adapter of a live bus may be at its limit
            segment.inject(frame, sender=_LOAD_NODE)
        # From when the frame was due, so that the lateness of a real clock does not add up; but no flood
        # after a pause.
        now = scheduler.now
        if now - due_ns > _CATCH_UP_NS:
            due_ns = now
        due_ns += round(frame_time_ns(frame, bitrate) / share)
        timer = scheduler.at(max(due_ns, now), send)

    def stop() -> None:
        if timer is not None:
            timer.cancel()
        segment.withdraw(_LOAD_NODE)

    return Action(segment.name, begin, stop)


def _check_babble(kind: str, values: Values) -> None:
    check_payload(kind, values)
    check_identifiers(kind, values, "can_id")


def _check_load(kind: str, values: Values) -> None:
    check_identifiers(kind, values, "lowest_id", "highest_id")
    for lower, upper in (("lowest_id", "highest_id"), ("shortest", "longest")):
        if values.integer(lower) > values.integer(upper):
            raise ConfigurationError(
                f"{kind}.parameters.{lower}", values.get(lower), f"at most {upper} = {values.get(upper)}"
            )


# -- kinds -----------------------------------------------------------------------------------------------

_NO_WIRE: Final = "it needs access to the bits of the wire, which a bus adapter does not give"
_NO_NODE: Final = "it needs access to the CAN controller of the node, which a bus adapter does not give"
_NO_CABLE: Final = "it needs access to the cable"
_BRIDGE: Final = (
    "on a live segment with a bridge, whose sides are the nodes; without one it needs access to the cable"
)
_NODE: Final = Parameter("node", "text", "Name of the node on the segment", required=True)
_NODES: Final = Parameter(
    "nodes", "text", "Names of the nodes that are concerned, with commas between; empty: all", default=""
)


def _nowhere_else(reason: str) -> dict[Environment, str]:
    return {"live": reason, "hardware": reason}


_kind: Final = partial(FaultType, target="segment")

FAMILY: Final = Family(
    kinds=(
        _kind(
            "can.noise",
            "Bits are read inverted at random, with a bit error rate",
            Custom(_noise),
            seam="CAN medium",
            parameters=(
                Parameter(
                    "bit_error_rate",
                    "float",
                    "Chance of each bit, drawn from the seeded stream",
                    minimum=1e-09,
                    maximum=0.05,
                    required=True,
                ),
                _NODES,
            ),
            refused=_nowhere_else(_NO_WIRE),
            example={"target": "can0", "duration_s": 0.1, "parameters": {"bit_error_rate": 0.001}},
            text="""
            Bits are read inverted at random, idle ones included. The distances of two wrong bits come
            from the seeded stream.
            """,
        ),
        _kind(
            "can.stuck_dominant",
            "The bus stays dominant: CAN_H to supply, or a transceiver that is stuck",
            HeldLevel(0),
            seam="CAN medium",
            refused=_nowhere_else(_NO_CABLE),
            example={"duration_s": 0.002},
            fuzzed=False,
            text="""
            The bus stays dominant. A sender goes bus-off after about 260 bits; receivers become
            error-passive.
            """,
        ),
        _kind(
            "can.stuck_recessive",
            "The bus stays recessive: CAN_H and CAN_L shorted",
            HeldLevel(1),
            seam="CAN medium",
            refused=_nowhere_else(_NO_CABLE),
            example={"duration_s": 0.05},
            fuzzed=False,
            text="""
            The bus stays recessive, CAN_H and CAN_L are shorted. A sender counts up to bus-off; the other
            nodes notice nothing.
            """,
        ),
        _kind(
            "can.cable_break",
            "The cable breaks: the named nodes go on among themselves, and so do the others",
            Custom(_break),
            seam="CAN medium",
            parameters=(
                Parameter(
                    "nodes", "text", "Names of the nodes of one side, with commas between", required=True
                ),
            ),
            remark=_BRIDGE,
            example={"target": "can0", "duration_s": 0.5, "parameters": {"nodes": "drive1"}},
            fuzzed=False,
            text="""
            The cable breaks between two groups of nodes. Each goes on by itself: acknowledges within the
            group, error-passive nodes that are alone. Frames of both sides are in the log. At the end the
            two sides meet in whatever they are doing. On a live segment with a bridge the two sides are
            its own, and `nodes` is the channel of one; without a bridge the fault is refused.
            """,
        ),
        _kind(
            "can.unplug",
            "The connector of a node is pulled: it runs on, alone on its bus",
            Custom(_break),
            seam="CAN medium",
            parameters=(_NODE,),
            remark=_BRIDGE,
            example={"duration_s": 0.5, "parameters": {"node": "drive1"}},
            fuzzed=False,
            text="""
            The connector of a node is pulled: a cable break with one node on the other side. The node
            runs on, unlike with `drive.power_off`. On a live segment with a bridge `node` is the channel
            of one of its sides.
            """,
        ),
        _kind(
            "can.babble",
            "A babbling node sends frame after frame without a pause",
            Custom(_babble),
            seam="CAN medium",
            parameters=(
                Parameter(
                    "can_id",
                    "int",
                    "Identifier; a low one keeps all other nodes from the bus",
                    minimum=0,
                    maximum=0x1FFFFFFF,
                    default=1,
                ),
                Parameter("data", "text", "Payload, hexadecimal, 0 to 8 bytes", default=""),
                Parameter("extended", "bool", "29-bit identifier", default=False),
                Parameter("node", "text", "Name of the sender in the log", default="babbler"),
            ),
            remark="on a live bus in bursts, a millisecond long each, or as many frames as the adapter takes",
            example={"duration_s": 0.05, "parameters": {"can_id": 1}},
            check_values=_check_babble,
            fuzzed=False,
            text="""
            A babbling node sends frame after frame without a pause. On a live bus it does so in bursts of
            a millisecond each, or as the adapter takes them.
            """,
        ),
        _kind(
            "can.load",
            "A foreign node loads the bus with random frames",
            Custom(_load),
            seam="CAN medium",
            parameters=(
                Parameter(
                    "load_percent",
                    "float",
                    "Share of the time that these frames alone occupy the bus",
                    unit="%",
                    minimum=0.1,
                    maximum=100.0,
                    required=True,
                ),
                Parameter(
                    "lowest_id", "int", "Lowest identifier", minimum=0, maximum=0x1FFFFFFF, default=0x6E0
                ),
                Parameter(
                    "highest_id", "int", "Highest identifier", minimum=0, maximum=0x1FFFFFFF, default=0x6FF
                ),
                Parameter("shortest", "int", "Least number of data bytes", minimum=0, maximum=8, default=0),
                Parameter("longest", "int", "Greatest number of data bytes", minimum=0, maximum=8, default=8),
                Parameter("extended", "bool", "29-bit identifiers", default=False),
            ),
            remark="on a live bus the load that the frames make at the bit rate of the bench file",
            example={"duration_s": 0.5, "parameters": {"load_percent": 40.0}},
            check_values=_check_load,
            text="""
            A foreign node loads the bus with frames of random identifiers, lengths and content from the
            seeded stream. They keep the share of time on average; while others have the bus they wait. On
            a live bus the bit rate of the bench file says how much time a frame takes.
            """,
        ),
        _kind(
            "can.no_ack",
            "Nodes receive without acknowledging",
            AtNodes(
                lambda _: False, lambda port, acknowledges: port.set_acknowledge(acknowledges), lambda _: True
            ),
            seam="CAN controller",
            parameters=(_NODES,),
            refused=_nowhere_else(_NO_NODE),
            example={"duration_s": 0.01},
            fuzzed=False,
            text="""
            Nodes receive without acknowledging. A frame that no node acknowledges is repeated by its
            sender.
            """,
        ),
        _kind(
            "can.wrong_bitrate",
            "A node works at another bit rate",
            AtNodes(
                lambda p: p.optional_integer("bitrate"),
                lambda port, rate: port.set_bitrate(rate),
                lambda _: None,
            ),
            seam="CAN controller",
            parameters=(
                _NODE,
                Parameter(
                    "bitrate",
                    "int",
                    "Its bit rate",
                    unit="bit/s",
                    minimum=1000,
                    maximum=1_000_000,
                    required=True,
                ),
            ),
            refused=_nowhere_else(_NO_NODE),
            example={"duration_s": 0.05, "parameters": {"node": "drive1", "bitrate": 250000}},
            fuzzed=False,
            text="""
            A node reads and sends with another bit rate. It destroys the frames of others with its error
            flags until it is error-passive.
            """,
        ),
        _kind(
            "can.bus_off",
            "A node goes bus-off at once",
            Custom(_bus_off),
            seam="CAN controller",
            parameters=(
                _NODE,
                Parameter(
                    "recovery",
                    "text",
                    "When it begins to recover: at the removal of the fault, or by itself",
                    default="at removal",
                    choices=("at removal", "automatic"),
                ),
            ),
            refused=_nowhere_else(_NO_NODE),
            example={"duration_s": 0.1, "parameters": {"node": "drive1"}},
            fuzzed=False,
            text="""
            A node goes bus-off at once. It recovers after 128 times 11 recessive bits, counted from the
            removal of the fault or from the beginning.
            """,
        ),
        _kind(
            "can.overload",
            "A slow receiver asks for overload frames behind every frame that it receives",
            AtNodes(
                lambda p: p.integer("frames"),
                lambda port, count: port.set_overload_frames(count),
                lambda _: 0,
            ),
            seam="CAN controller",
            parameters=(
                _NODE,
                Parameter("frames", "int", "Overload frames in succession", minimum=1, maximum=2, default=1),
            ),
            refused=_nowhere_else(_NO_NODE),
            example={"duration_s": 0.1, "parameters": {"node": "drive1", "frames": 2}},
            fuzzed=False,
            text="""
            A slow receiver asks for one or two overload frames behind every frame that it receives.
            """,
        ),
        _kind(
            "can.receive_delay",
            "A node gets its frames later",
            AtNodes(lambda p: seconds_to_ns(p.number("delay_s")), _set_receive_delay, lambda _: 0),
            seam="CAN controller",
            parameters=(
                _NODE,
                Parameter(
                    "delay_s", "float", "How much later", unit="s", minimum=1e-06, maximum=10.0, required=True
                ),
            ),
            refused=_nowhere_else(_NO_NODE),
            example={"duration_s": 0.1, "parameters": {"node": "drive1", "delay_s": 0.003}},
            fuzzed=False,
            text="""
            A node gets its frames later than they end on the bus, in their order.
            """,
        ),
        _kind(
            "can.transmit_overrun",
            "The transmit queue of a node is too short: what does not fit is lost",
            AtNodes(lambda p: p.integer("buffers"), _set_buffers, lambda port: port.tx_buffers),
            seam="CAN controller",
            parameters=(
                _NODE,
                Parameter("buffers", "int", "Frames that may wait", minimum=1, maximum=256, default=1),
            ),
            refused=_nowhere_else(_NO_NODE),
            example={"duration_s": 0.1, "parameters": {"node": "drive1"}},
            fuzzed=False,
            text="""
            The transmit queue of a node is too short: what does not fit is lost and reported by the event
            `can.overrun`.
            """,
        ),
    ),
)
