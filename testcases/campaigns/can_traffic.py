"""Drawn traffic on the virtual CAN segment, compared with a model that reads every bit, and with itself.

A segment computes good frames as a whole and follows the bits only where something is wrong. Both ways have
to come to the same: times, receivers, counters and states are those of a plain model of ISO 11898-1 whatever
bits are wrong for whom, and a segment that is followed bit by bit all the time has the same log as one that
is not.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from fieldbus.can import CanFrame, CanMedium
from hil.campaign import Campaign, CaseContext
from testcases.campaigns import _can_model
from testcases.campaigns.support import equal

CAMPAIGN: Final = Campaign(
    "can traffic", controller="", tags=("can",), bench="testcases.campaigns.can_bus:BENCH"
)
US: Final = 1_000
LONGEST_BITS: Final = 4_000
"""Traffic that lasts longer goes on for ever: a frame that nobody acknowledges."""
RULES: Final = tuple(f"CANP-{number:03d}" for number in (5, 6, 7, 10, 11, 13, 27, *range(33, 55)))
Flips = Mapping[int, frozenset[str] | None]


def content(frame: CanFrame) -> tuple[int, bool, bool, int, bytes]:
    """Return everything that a frame carries."""
    return frame.can_id, frame.extended, frame.remote, frame.dlc, bytes(frame.data)


class Twin:
    """A segment at 1 Mbit/s, so that a bit is a microsecond, with the nodes of a model.

    Args:
        ctx: The case.
        nodes: The nodes, with the frames that they are going to send.
        flips: Bits that are read wrongly, and by whom; None: by all.

    """

    def __init__(self, ctx: CaseContext, nodes: Iterable[Any], flips: Flips) -> None:
        own: Any = ctx.bench.segment("can0")
        self.scheduler = own.scheduler
        self.begun_ns = self.scheduler.now
        self.medium = CanMedium(self.scheduler, name="lab")
        self.ports: dict[str, Any] = {}
        self.received: dict[str, list[tuple[float, object]]] = {}
        self.sent: dict[str, list[tuple[float, object]]] = {}
        self.states: dict[str, list[str]] = {}
        for node in nodes:
            self._attach(node)
        for time, names in flips.items():
            self.scheduler.at(self.begun_ns + time * US, lambda names=names: self.medium.flip_bit(names))

    def _at(self, time_ns: int) -> float:
        return (time_ns - self.begun_ns) / US

    def _attach(self, node: Any) -> None:
        received = self.received.setdefault(node.name, [])
        sent = self.sent.setdefault(node.name, [])
        states = self.states.setdefault(node.name, [])
        port = self.medium.attach(
            node.name,
            lambda frame, time_ns: received.append((self._at(time_ns), content(frame))),
            confirm=lambda frame, time_ns: sent.append((self._at(time_ns), frame)),
            auto_recovery=False,
            one_shot=node.one_shot,
        )
        port.set_error_counters(tec=node.tec, rec=node.rec)
        port.on_state.append(lambda _old, new: states.append(new.value))
        port.set_acknowledge(node.acknowledges)
        port.set_overload_frames(node.overloads)
        self.ports[node.name] = port
        for time, frame in node.frames:
            self.scheduler.at(self.begun_ns + time * US, lambda frame=frame: port.send(frame))


def differences(ctx: CaseContext, make: Callable[[], list[Any]], flips: Flips) -> list[str] | None:
    """Let segment and model run until nothing happens any more; return where they differ, None for traffic
    that never ends.
    """
    nodes = make()
    twin = Twin(ctx, make(), flips)
    levels = _can_model.run(nodes, flips, at_most=LONGEST_BITS)
    if levels is None:
        for port in twin.ports.values():
            port.online = False
        ctx.run_for(600e-6)
        return None
    ctx.run_for((len(levels) + 20) * 1e-6)
    found = []
    for node in nodes:
        port = twin.ports[node.name]
        pairs = {
            "receives": (twin.received[node.name], node.received),
            "sends": (twin.sent[node.name], node.sent),
            "counters": ((port.tec, port.rec), (min(node.tec, 256), node.rec)),
            "state": ((port.state.value, twin.states[node.name]), (node.state, node.states)),
            "waiting": (port.pending, 0),
        }
        found += [
            f"{node.name} {what}: {is_} in place of {wanted}"
            for what, (is_, wanted) in pairs.items()
            if is_ != wanted
        ]
    return found


class Comparison:
    """Counts what was compared, and keeps the first differences.

    Args:
        ctx: The case.

    """

    def __init__(self, ctx: CaseContext) -> None:
        self._ctx = ctx
        self._texts: list[str] = []
        self._count = 0

    def add(self, what: str, found: list[str] | None) -> None:
        """Take the differences of one piece of traffic; None: it had no end."""
        if found is not None:
            self._count += 1
            self._texts += [f"{what}: {text}" for text in found]

    def expect(self, least: int, *ids: str) -> None:
        """Expect no difference in so many pieces of traffic at least."""
        first = f", the first: {self._texts[0]}" if self._texts else ""
        equal(self._ctx, f"differences in {self._count} pieces of traffic{first}", len(self._texts), 0, *ids)
        equal(self._ctx, f"pieces of traffic that end: at least {least}", self._count >= least, 1)


# -- against the model ---------------------------------------------------------------------------------------

IDS: Final = (0x000, 0x001, 0x07F, 0x0F0, 0x123, 0x555, 0x5F0, 0x7FF)
BORDERS: Final = (0, 0, 0, 1, 8, 95, 96, 119, 120, 126, 127, 128, 135, 200, 247, 248, 254, 255)
"""Error counters at and next to each border of ISO 11898-1, 12.1.4."""


def drawn_frame(draw: random.Random, can_id: int | None = None) -> CanFrame:
    """Return a frame of any kind, with up to three bytes or a DLC above 8."""
    base = draw.choice(IDS) if can_id is None else can_id
    extended, remote = draw.random() < 0.4, draw.random() < 0.3
    dlc = draw.choice((0, 1, 2, 3, 3, 8, 9, 15))
    size = 0 if remote else min(dlc, 8)
    data = draw.choice((bytes(size), b"\xff" * size, draw.randbytes(size), draw.randbytes(size)))
    identifier = base << 18 | draw.choice((0, 1, 0x3FFFF, draw.getrandbits(18))) if extended else base
    return CanFrame(identifier, data, extended=extended, remote=remote, dlc=dlc)


def drawn_nodes(draw: random.Random) -> list[dict[str, Any]]:
    """Return two to four nodes with counters, options and frames, as arguments of the model."""
    nodes = []
    for name in "abcd"[: draw.randint(2, 4)]:
        times = sorted({draw.choice((0, 0, 1, 30, 60, 61, 130, 131)) for _ in range(draw.randint(0, 2))})
        nodes.append(
            {
                "name": name,
                "frames": [(time, drawn_frame(draw)) for time in times],
                "tec": draw.choice(BORDERS),
                "rec": draw.choice(BORDERS),
                "acknowledges": draw.random() < 0.8,
                "overloads": draw.choice((0, 0, 0, 1, 2)),
                "one_shot": draw.random() < 0.3,
            }
        )
    return nodes


@CAMPAIGN.product(
    "model/{seed}",
    parameters={"seed": (1, 2, 3, 4)},
    title="drawn traffic with wrong bits, seed {seed}",
    requirements=RULES,
)
def model(ctx: CaseContext, seed: int) -> None:
    """Whatever bits are wrong, and for whom: ends, receivers, counters and states are those of the model."""
    draw = random.Random(seed)
    comparison = Comparison(ctx)
    for number in range(15):
        nodes = drawn_nodes(draw)
        names = [node["name"] for node in nodes]
        flips = {}
        for _ in range(draw.choice((0, 1, 1, 2, 4))):
            some = frozenset(draw.sample(names, draw.randint(1, len(names))))
            flips[draw.randint(0, 260)] = draw.choice((None, some, some))
        comparison.add(
            f"traffic {number} with wrong bits {flips}",
            differences(ctx, lambda nodes=nodes: [_can_model.Node(**node) for node in nodes], flips),
        )
    comparison.expect(5, *RULES)


SHORT: Final = CanFrame(0x0F1, b"\x12")
STATES: Final = {
    "all-active": ((0, 0), (0, 0), (0, 0)),
    "passive-sender": ((128, 0), (0, 0), (0, 0)),
    "passive-receiver": ((0, 0), (0, 128), (0, 0)),
    "all-passive": ((128, 0), (0, 128), (0, 200)),
    "nearly-passive": ((127, 0), (0, 127), (0, 120)),
    "nearly-off": ((248, 0), (0, 0), (0, 0)),
}
"""Transmit and receive counters of three nodes."""
WHO: Final = (None, frozenset("a"), frozenset("b"), frozenset("bc"))


@CAMPAIGN.product(
    "every-bit/{states}",
    parameters={"states": tuple(STATES)},
    title="a wrong bit at every place of a frame, {states}",
    requirements=RULES,
)
def every_bit(ctx: CaseContext, states: str) -> None:
    """From the bit before SOF to the third bit of idle; for all, the sender, one receiver, both in turn."""
    comparison = Comparison(ctx)
    first = tuple(STATES).index(states)
    for place in range(78):
        who = WHO[(place + first) % 4]

        def nodes() -> list[Any]:
            frames = {"a": [(5, SHORT)], "b": [(9, CanFrame(0x700))]}
            return [
                _can_model.Node(name, frames.get(name, []), tec=tec, rec=rec)
                for name, (tec, rec) in zip("abc", STATES[states], strict=True)
            ]

        comparison.add(f"bit {place} wrong for {who}", differences(ctx, nodes, {4 + place: who}))
    comparison.expect(60, *RULES)


@CAMPAIGN.case("second-error", requirements=("CANP-048", "CANP-049", "CANP-050"))
def second_error(ctx: CaseContext) -> None:
    """A second wrong bit at every place of an error frame: bit error of the flag, dominant bits behind it."""
    comparison = Comparison(ctx)
    for place in range(30):
        for number, states in enumerate((((0, 0), (0, 0)), ((120, 0), (0, 120)))):

            def nodes(states: Any = states) -> list[Any]:
                return [
                    _can_model.Node(name, [(0, SHORT)] if name == "a" else [], tec=tec, rec=rec)
                    for name, (tec, rec) in zip("ab", states, strict=True)
                ]

            who = WHO[(place + number) % 3]
            comparison.add(
                f"bits 20 and {21 + place} wrong", differences(ctx, nodes, {20: None, 21 + place: who})
            )
    comparison.expect(40, "CANP-048", "CANP-049", "CANP-050")


# -- whole frames against single bits ------------------------------------------------------------------------


@dataclass
class Way:
    """A segment that carries the same traffic as another one.

    Args:
        medium: It.
        begun_ns: When its traffic has begun, ns.

    """

    medium: CanMedium
    begun_ns: int
    received: dict[str, list[object]] = field(default_factory=dict)
    sent: dict[str, list[object]] = field(default_factory=dict)
    states: dict[str, list[object]] = field(default_factory=dict)
    errors: list[object] = field(default_factory=list)

    def attach(self, name: str, **options: Any) -> None:
        """Connect a node; what it receives, sends and becomes is kept with its time."""
        heard = self.received.setdefault(name, [])
        sent = self.sent.setdefault(name, [])
        states = self.states.setdefault(name, [])
        port = self.medium.attach(
            name,
            lambda frame, at_ns: heard.append((at_ns - self.begun_ns, content(frame), frame.fd, frame.brs)),
            confirm=lambda frame, at_ns: sent.append((at_ns - self.begun_ns, content(frame))),
            **options,
        )
        port.on_state.append(
            lambda old, new: states.append((self.medium.scheduler.now - self.begun_ns, old, new))
        )

    def view(self) -> dict[str, object]:
        """Return everything that a user sees of it."""
        own = [port for port in self.medium.ports if port.name != "ear"]
        return {
            "log": [
                (at_ns - self.begun_ns, sender, content(frame), error)
                for at_ns, sender, frame, error in self.medium.log
            ],
            "received": self.received,
            "sent": self.sent,
            "states": self.states,
            "counters": [(port.name, port.tec, port.rec, port.state) for port in own],
            "waiting": [(port.name, port.pending, port.overruns) for port in own],
            "errors": self.errors,
        }


def _step(draw: random.Random, names: str, *, fd: bool) -> tuple[str, Callable[[CanMedium], None]]:
    """Return what happens at one instant, and how it is done."""
    name = draw.choice(names)
    kind = draw.choice(("send",) * 8 + ("burst", "burst", "flush", "withdraw"))
    if kind == "flush":
        return f"{name} flushes", lambda medium: medium.port(name).flush()
    own = 0x100 + 0x40 * names.index(name)
    frames = [drawn_frame(draw, own + draw.randint(0, 3)) for _ in range(1 if kind == "send" else 4)]
    if kind == "withdraw":
        wanted = {(frame.can_id, frame.extended) for frame in frames}
        return f"{name} withdraws", lambda medium: medium.port(name).withdraw(wanted)
    if fd:
        frames = [
            CanFrame(one.can_id, one.data * 4, extended=one.extended, fd=True, brs=draw.random() < 0.5)
            if not one.remote and draw.random() < 0.5 and len(one.data) in (0, 2, 3, 8)
            else one
            for one in frames
        ]
    return f"{name} sends", lambda medium: medium.port(name).send_all(frames)


@CAMPAIGN.product(
    "ways/{kind}-{seed}",
    parameters={"kind": ("classical", "fd"), "seed": (1, 2)},
    title="whole frames and single bits come to the same, {kind}, seed {seed}",
    requirements=("CANP-027", "CANP-030", "CANP-031", "CANP-042", "CANP-051"),
)
def ways(ctx: CaseContext, kind: str, seed: int) -> None:
    """Nodes that send, fall silent, become passive, come and go: a segment with a listener of another bit
    rate, which has to be followed bit by bit, has the log of one without.
    """
    draw = random.Random(f"{kind} {seed}")
    fd = kind == "fd"
    comparison = Comparison(ctx)
    own: Any = ctx.bench.segment("can0")
    for number in range(8):
        both = []
        names = "abcd"[: draw.randint(2, 4)]
        counters = {name: (draw.choice(BORDERS[:-1]), draw.choice(BORDERS)) for name in names}
        for bitwise in (False, True):
            medium = CanMedium(own.scheduler, name="lab", data_bitrate=1_000_000 if fd else None)
            way = Way(medium, own.scheduler.now)
            medium.bus_error_listeners.append(
                lambda at_ns, port, code, frame, place, way=way: way.errors.append(
                    (at_ns - way.begun_ns, port, code, content(frame) if frame else None, place)
                )
            )
            for name in names:
                way.attach(name, auto_recovery=False, fd=fd)
                medium.port(name).set_error_counters(tec=counters[name][0], rec=counters[name][1])
            if number % 2:
                # It comes back after 128 pauses of 11 bits, between the frames of the others.
                way.attach("z", auto_recovery=True, fd=fd)
                medium.port("z").set_error_counters(tec=256)
            if bitwise:
                medium.attach("ear", lambda _frame, _at: None, listen_only=True).set_bitrate(999_000)
            both.append(way)
        at_ns = own.scheduler.now
        steps = []
        for _ in range(draw.randint(10, 30)):
            text, act = _step(draw, names, fd=fd)
            sends = text.endswith("sends")
            at_ns += draw.choice((0, 0, 1, 50, 58, 61, 100, 200, 400)) * US
            moment = at_ns if sends else at_ns + US // 2
            steps.append(f"{(moment - own.scheduler.now) / US} {text}")
            for way in both:
                own.scheduler.at(moment, lambda act=act, way=way: act(way.medium))
        ctx.run_for((at_ns - own.scheduler.now) * 1e-9 + 3e-3)
        for way in both:
            for port in way.medium.ports:
                port.online = False
        ctx.run_for(600e-6)
        views = [way.view() for way in both]
        comparison.add(
            f"traffic {number}",
            [
                f"{what}: {_first_difference(views[0][what], views[1][what])} ({steps})"
                for what in views[0]
                if views[0][what] != views[1][what]
            ],
        )
    comparison.expect(8, "CANP-030", "CANP-031")


def _first_difference(one: Any, other: Any) -> str:
    """Return the first entries in which two values differ."""
    if isinstance(one, dict):
        name = next(name for name in one if one[name] != other[name])
        return f"{name} {_first_difference(one[name], other[name])}"
    if isinstance(one, list):
        place = next((at for at, pair in enumerate(zip(one, other, strict=False)) if pair[0] != pair[1]), -1)
        if place < 0:
            return f"{len(one)} entries and {len(other)}"
        return f"entry {place}: {one[place]} and {other[place]}"
    return f"{one} and {other}"
