"""Faults of CAN frames: a hook in the segment that picks the frames it hits,
and a foreign node that sends.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Final

from fieldbus.can.bitstream import FIELDS, BitError
from fieldbus.can.frame import CanFrame
from fieldbus.can.hooks import HookResult
from fieldbus.clock import seconds_to_ns
from fieldbus.errors import ConfigurationError, UnsupportedFaultError
from hil.faults._kind import Action, Custom, Family, FaultType, Injection, Work
from hil.faults._parameters import Parameter, Values
from hil.faults._payload import check_identifiers, check_payload, parse_payload
from hil.faults._watch import frame_matcher, message_id
from hil.faults.seams import (
    FrameSegment,
    KernelGateway,
    KernelRule,
    LiveSegment,
    SegmentWithKernelGateway,
    SegmentWithNodes,
    offers,
)

if TYPE_CHECKING:
    from numpy.random import Generator

    from fieldbus.clock import Timer
    from hil.faults._trigger import OnFrame

Treatment = Callable[[CanFrame], HookResult | None]
"""What is done to a frame that is hit; None lets it pass."""

_RIVAL: Final = "rival"
_TWIN: Final = "twin"
_STRANGER: Final = "fault"
_FOREIGN: Final = (_STRANGER, _RIVAL, _TWIN, "load", "babbler")
"""Senders that faults bring with them."""


@dataclass(frozen=True)
class HitFrames:
    """The effect of a kind that does something to the frames which its parameters select.

    Args:
        treatment: Returns what is done to every frame that is hit. Given the fault, the segment, and a
        random stream.
        in_kernel: Whether the gateway of the kernel can do it too: it drops frames or replaces their payload.

    """

    treatment: Callable[[Injection, FrameSegment, Generator], Treatment]
    in_kernel: bool = False
    needs: None = None

    def __call__(self, injection: Injection) -> Action:
        """Return the action of one fault."""
        segment: FrameSegment = injection.bench.segment(injection.target or None)
        if offers(segment, SegmentWithKernelGateway) and segment.kernel is not None:
            injection.check_environment(segment)
            return _KernelFrames(injection, segment, segment.kernel, possible=self.in_kernel).action()
        return _Frames(injection, segment, self.treatment).action()


def _always(result: HookResult) -> Treatment:
    return lambda _frame: result


def _drop(_injection: Injection, _segment: FrameSegment, _rng: Generator) -> Treatment:
    return _always(HookResult.drop())


def _delay(injection: Injection, _segment: FrameSegment, _rng: Generator) -> Treatment:
    return _always(HookResult.delay(seconds_to_ns(injection.values.number("delay_s"))))


def _jitter(injection: Injection, _segment: FrameSegment, rng: Generator) -> Treatment:
    longest_ns = seconds_to_ns(injection.values.number("jitter_s"))
    return lambda _frame: HookResult.delay(int(rng.integers(1, longest_ns, endpoint=True)))


def _drift(injection: Injection, _segment: FrameSegment, _rng: Generator) -> Treatment:
    scheduler = injection.bench.scheduler
    share = injection.values.number("drift_ppm") * 1e-6
    begun: list[int] = []

    def fall_behind(_frame: CanFrame) -> HookResult:
        if not begun:
            begun.append(scheduler.now)
        return HookResult.delay(max(round((scheduler.now - begun[0]) * share), 1))

    return fall_behind


def _corrupt(injection: Injection, segment: FrameSegment, _rng: Generator) -> Treatment:
    values = injection.values
    nodes = values.names("nodes")
    known = _node_names(segment)
    for node in nodes:
        if node not in known:
            raise injection.wrong("nodes", ", ".join(known), node)
    error = BitError(values.text("field"), values.integer("bit"), frozenset(nodes) if nodes else None)
    return _always(HookResult.corrupt(values.integer("attempts"), error))


def _duplicate(injection: Injection, _segment: FrameSegment, _rng: Generator) -> Treatment:
    return _always(HookResult.duplicate(injection.values.integer("copies")))


def _replace(injection: Injection, _segment: FrameSegment, _rng: Generator) -> Treatment:
    data = parse_payload(injection.kind.name, injection.values)
    return lambda frame: HookResult.replace(frame.with_data(data))


def _length(injection: Injection, _segment: FrameSegment, _rng: Generator) -> Treatment:
    length = injection.values.integer("length")
    return lambda frame: HookResult.replace(frame.with_data(frame.data[:length].ljust(length, b"\0")))


def _lose_arbitration(injection: Injection, segment: FrameSegment, _rng: Generator) -> Treatment:
    rival, rivals = CanFrame(injection.values.integer("rival_id")), injection.values.integer("rivals")

    def outdo(_frame: CanFrame) -> None:
        for _ in range(rivals):
            segment.inject(rival, sender=_RIVAL)

    return outdo


def _collide(injection: Injection, segment: FrameSegment, _rng: Generator) -> Treatment:
    given = parse_payload(injection.kind.name, injection.values)

    def collide(frame: CanFrame) -> None:
        data = given or bytes(byte ^ 0xFF for byte in frame.data)
        segment.inject(frame.with_data(data), sender=_TWIN)

    return collide


# -- which frames are hit --------------------------------------------------------------------------------


def _node_names(segment: FrameSegment) -> list[str]:
    return [port.name for port in segment.ports] if offers(segment, SegmentWithNodes) else []


def _selected_identifier(injection: Injection, segment: FrameSegment) -> tuple[int, int]:
    """Return the identifier that the parameters select, and the bits of it
    that count; 0 bits: every frame.
    """
    values = injection.values
    message, can_id = values.text("message"), values.optional_integer("can_id")
    mask = values.integer("mask") if message or can_id is not None else 0
    wanted = (
        message_id(injection.bench, values.text("drive"), message, segment.name) if message else can_id or 0
    )
    return wanted & mask, mask


def _known_sender(injection: Injection, segment: FrameSegment) -> str:
    """Return the sender that the fault names, checked: an unknown sender would never match.

    Raises:
        ConfigurationError: No node of the segment has this name.
        UnsupportedFaultError: It is a live bus, where frames of others are known by the side from
        which they come.

    """
    name = injection.values.text("sender")
    sides = [side.name for side in segment.sides] if offers(segment, LiveSegment) else []
    known = [*_node_names(segment), *sides]
    if not name or not known or name in (*known, *_FOREIGN):
        return name
    if sides:
        injection.refuse(f"on {segment.name} senders are known as {', '.join(known)}, not as {name!r}")
    raise injection.wrong("sender", f"{', '.join(known)}, or {', '.join(_FOREIGN)} of other faults")


class _Frames:
    """Does something to the frames that the parameters of a fault select.

    Args:
        injection: The fault.
        segment: Where it acts.
        treatment: Returns what is done to a frame.

    """

    def __init__(
        self,
        injection: Injection,
        segment: FrameSegment,
        treatment: Callable[[Injection, FrameSegment, Generator], Treatment],
    ) -> None:
        self._injection = injection
        self._segment = segment
        injection.check_environment(segment)
        bench, values = injection.bench, injection.values
        self._treat = treatment(injection, segment, bench.rng(f"{injection.stream}.treatment"))
        self._can_id, self._mask = _selected_identifier(injection, segment)
        self._sender = _known_sender(injection, segment)
        self._first = values.integer("first")
        self._every = values.integer("every")
        self._chance = values.number("probability")
        self._rng = bench.rng(injection.stream) if self._chance < 1.0 else None
        self._hits_left = injection.count
        self._counter = 0
        self._hits = 0
        self._active = False
        self._remove_hook: Work | None = None
        self._trigger_matches: Callable[[CanFrame], bool] | None = None
        self._on_trigger: Work | None = None

    def action(self) -> Action:
        """Return the action."""
        return Action(self._segment.name, self._begin, self._finish, self._begin_at_frame)

    def _begin_at_frame(self, trigger: OnFrame, apply: Work) -> Work:
        """Begin with the frame that fulfils `trigger`, that frame included; returns the function that
        ends waiting.
        """
        self._trigger_matches = frame_matcher(self._injection.bench, trigger, self._segment.name)
        self._on_trigger = apply
        self._hook_up()
        return self._stop_waiting

    def _stop_waiting(self) -> None:
        self._on_trigger = None
        if not self._active:
            self._unhook()

    def _hook_up(self) -> None:
        if self._remove_hook is None:
            self._remove_hook = self._segment.add_hook(self._hook)

    def _unhook(self) -> None:
        if self._remove_hook is not None:
            self._remove_hook()
            self._remove_hook = None

    def _begin(self) -> None:
        self._active = True
        self._hook_up()

    def _finish(self) -> None:
        self._active = False
        self._unhook()

    def _hook(self, frame: CanFrame, sender: str, _time_ns: int) -> HookResult | None:
        if not self._active:
            apply = self._on_trigger
            if apply is None or self._trigger_matches is None or not self._trigger_matches(frame):
                return None
            apply()
        if (frame.can_id & self._mask) != self._can_id or (self._sender and sender != self._sender):
            return None
        self._counter = counter = self._counter + 1
        if counter < self._first or (counter - self._first) % self._every:
            return None
        if self._rng is not None and self._rng.random() >= self._chance:
            return None
        self._hits += 1
        self._injection.report_hit(self._hits, can_id=frame.can_id)
        result = self._treat(frame)
        if self._hits_left is not None:
            self._hits_left -= 1
            if self._hits_left == 0:
                # Taken out of the segment only after it has finished asking its hooks about this frame.
                self._active = False
                scheduler = self._injection.bench.scheduler
                scheduler.at(scheduler.now, self._injection.ended)
        return result


_NEUTRAL: Final = {"first": 1, "every": 1, "probability": 1.0}
"""Parameters of the selection that the gateway of the kernel does not have, with the values that it does."""


class _KernelFrames:
    """Drops or replaces the selected frames by a rule of the kernel.

    Args:
        injection: The fault.
        segment: Where it acts.
        gateway: The gateway of the kernel.
        possible: Whether it can do what the kind says.

    Raises:
        UnsupportedFaultError: The kernel cannot do that; the message says what it lacks.

    """

    def __init__(
        self, injection: Injection, segment: FrameSegment, gateway: KernelGateway, *, possible: bool
    ) -> None:
        values = injection.values
        where = f"{injection.kind.name} cannot be injected by the gateway of the kernel: it"
        if not possible:
            raise UnsupportedFaultError(
                f'{where} only passes on, drops and changes; set gateway = "bench" at the bridge of '
                f"{segment.name}"
            )
        if injection.count is not None:
            raise UnsupportedFaultError(f"{where} does not count frames; give an end in place of count")
        for name, neutral in _NEUTRAL.items():
            if values.get(name) != neutral:
                raise UnsupportedFaultError(
                    f"{where} treats all frames of an identifier alike: {name} is not possible"
                )
        self._injection = injection
        self._segment = segment
        self._gateway = gateway
        self._can_id, self._mask = _selected_identifier(injection, segment)
        self._sender = values.text("sender")
        self._data = (
            parse_payload(injection.kind.name, injection.values) if injection.kind.has("data") else None
        )
        gateway.check_free(self._sender)
        self._rule: KernelRule | None = None

    def action(self) -> Action:
        """Return the action."""
        return Action(self._segment.name, self._begin, self._finish)

    def _begin(self) -> None:
        self._rule = self._gateway.treat(self._can_id, self._mask, sender=self._sender, data=self._data)

    def _finish(self) -> None:
        if self._rule is not None:
            self._rule.withdraw()
            if self._rule.hits:
                self._injection.report_hit(self._rule.hits, can_id=self._can_id)
            self._rule = None


def _inject(injection: Injection) -> Action:
    """Return the action of a foreign node that sends `count` frames, or floods until it is removed."""
    segment: FrameSegment = injection.bench.segment(injection.target or None)
    injection.check_environment(segment)
    values, scheduler = injection.values, injection.bench.scheduler
    message = CanFrame(
        values.integer("can_id"),
        parse_payload(injection.kind.name, injection.values),
        extended=values.flag("extended"),
    )
    period_ns = seconds_to_ns(values.number("period_s"))
    left = None if injection.count is None and injection.has_end else injection.count or 1
    timer: Timer | None = None

    def send() -> None:
        nonlocal left, timer
        segment.inject(message, sender=_STRANGER)
        if left is not None:
            left -= 1
            if left == 0:
                injection.ended()
                return
        timer = scheduler.after(period_ns, send)

    def stop() -> None:
        nonlocal timer
        if timer is not None:
            timer.cancel()
            timer = None

    return Action(segment.name, send, stop)


# -- kinds -----------------------------------------------------------------------------------------------

_LOCAL: Final = (
    "on a live bus only frames that a local port sends or receives, or that pass a bridge, can be touched"
)
_NO_WIRE: Final = "bit errors need access to the bits of the wire, which a bus adapter does not give"
_NO_RACE: Final = "a bus adapter cannot start a frame in the very bit in which another node starts"
_SELECTION: Final = (
    Parameter(
        "drive",
        "text",
        (
            "Drive, encoder or device of the segment whose identifiers `message` names; empty: "
            "the default drive, or the first on the segment"
        ),
        default="",
    ),
    Parameter(
        "message",
        "text",
        (
            "A message of it: `rpdo1` to `rpdo4`, `tpdo1` to `tpdo4`, `sync`, `emcy`, `heartbeat`, "
            "`controller_heartbeat`, `sdo_rx`, `sdo_tx`, `nmt`; empty: `can_id` counts"
        ),
        default="",
    ),
    Parameter(
        "can_id",
        "int",
        "Identifier to hit; without it and without a message every frame is hit",
        minimum=0,
        maximum=0x1FFFFFFF,
    ),
    Parameter(
        "mask",
        "int",
        "Bits of the identifier that are compared",
        minimum=0,
        maximum=0x1FFFFFFF,
        default=0x1FFFFFFF,
    ),
    Parameter(
        "sender",
        "text",
        "Only frames of this node (`drive1`, `controller`, ...); empty: of every node",
        default="",
    ),
    Parameter(
        "first",
        "int",
        "First matching frame that is hit, counted from the application",
        minimum=1,
        maximum=1_000_000_000,
        default=1,
    ),
    Parameter(
        "every", "int", "Then hit every n-th matching frame", minimum=1, maximum=1_000_000_000, default=1
    ),
    Parameter(
        "probability",
        "float",
        "Chance that a frame so chosen is hit, drawn from the seeded stream",
        minimum=0.0,
        maximum=1.0,
        default=1.0,
    ),
)


def _check_selection(kind: str, values: Values) -> None:
    if values.text("message") and values.get("can_id") is not None:
        raise ConfigurationError(
            f"{kind}.parameters.can_id", values.get("can_id"), "nothing, because message is given"
        )


def _check_replacement(kind: str, values: Values) -> None:
    check_payload(kind, values)
    _check_selection(kind, values)


def _check_injected(kind: str, values: Values) -> None:
    check_payload(kind, values)
    check_identifiers(kind, values, "can_id")


_kind: Final = partial(FaultType, seam="CAN medium", target="segment", counted=True)

FAMILY: Final = Family(
    kinds=(
        _kind(
            "frame.drop",
            "Frames never reach the wire; their sender believes they were sent",
            HitFrames(_drop, in_kernel=True),
            parameters=_SELECTION,
            remark=_LOCAL,
            example={"target": "can0", "count": 3, "parameters": {"message": "tpdo1"}},
            check_values=_check_selection,
            text="""
            Frames never reach the wire. Their sender believes that they were sent.
            """,
        ),
        _kind(
            "frame.delay",
            "Frames reach the wire later",
            HitFrames(_delay),
            parameters=(
                *_SELECTION,
                Parameter(
                    "delay_s", "float", "How much later", unit="s", minimum=1e-06, maximum=10.0, required=True
                ),
            ),
            remark=_LOCAL,
            example={"duration_s": 0.1, "parameters": {"message": "rpdo1", "delay_s": 0.006}},
            check_values=_check_selection,
            text="""
            Frames reach the wire later. Frames behind them may overtake.
            """,
        ),
        _kind(
            "frame.jitter",
            "Frames reach the wire later by a random time: a clock that jitters, of SYNC for example",
            HitFrames(_jitter),
            parameters=(
                *_SELECTION,
                Parameter(
                    "jitter_s",
                    "float",
                    "Longest delay; each is drawn evenly from 0 to it, from the seeded stream",
                    unit="s",
                    minimum=1e-06,
                    maximum=10.0,
                    required=True,
                ),
            ),
            remark=_LOCAL,
            example={"duration_s": 0.5, "parameters": {"message": "sync", "jitter_s": 0.0005}},
            check_values=_check_selection,
            text="""
            Frames reach the wire later by a random time: a clock that jitters. On SYNC it moves the
            instant at which every drive samples.
            """,
        ),
        _kind(
            "frame.drift",
            "Frames come later and later: the clock of their sender is slow against the others",
            HitFrames(_drift),
            parameters=(
                *_SELECTION,
                Parameter(
                    "drift_ppm",
                    "float",
                    "By how much it is slow, from the first frame that is hit on",
                    unit="ppm",
                    minimum=0.1,
                    maximum=100000.0,
                    required=True,
                ),
            ),
            remark=_LOCAL,
            example={"duration_s": 2.0, "parameters": {"message": "sync", "drift_ppm": 500.0}},
            check_values=_check_selection,
            text="""
            Frames come later and later: the clock of their sender is slow against those of the others. On
            SYNC the bus cycle drifts away from the servo cycles of the drives. Only the wire is late:
            what the sender calculates stays on its grid.
            """,
        ),
        _kind(
            "frame.corrupt",
            "A bit error at one place of the frame; kind of error and counters follow from the place",
            HitFrames(_corrupt),
            parameters=(
                *_SELECTION,
                Parameter(
                    "attempts",
                    "int",
                    "Transmission attempts in a row that are hit",
                    minimum=1,
                    maximum=255,
                    default=1,
                ),
                Parameter(
                    "field", "text", "Field that is hit; stuff: a stuff bit", default="crc", choices=FIELDS
                ),
                Parameter(
                    "bit",
                    "int",
                    "Number of the bit in the field, MSB first; negative: from its end",
                    minimum=-64,
                    maximum=63,
                    default=-1,
                ),
                Parameter(
                    "nodes",
                    "text",
                    "Names of the nodes that read the bit wrongly, with commas between; empty: all",
                    default="",
                ),
            ),
            refused={"live": _NO_WIRE, "hardware": _NO_WIRE},
            example={"count": 5, "parameters": {"message": "tpdo1", "attempts": 2}},
            check_values=_check_selection,
            text="""
            A bit of the frame is read inverted. The kind of the error, the length of its flags and the
            error counters follow from the place: most fields make a bit error of the sender, `ack_slot` a
            missing acknowledge, a CRC that only one receiver (`nodes`) reads wrongly a CRC error, the
            last bit of `eof` a frame that is received twice. A frame without such a bit passes. Enough
            errors in a row take the sender to bus-off.
            """,
        ),
        _kind(
            "frame.duplicate",
            "Frames are sent more than once",
            HitFrames(_duplicate),
            parameters=(
                *_SELECTION,
                Parameter("copies", "int", "Additional copies", minimum=1, maximum=16, default=1),
            ),
            remark=_LOCAL,
            example={"count": 1, "parameters": {"message": "rpdo1"}},
            check_values=_check_selection,
            text="""
            Frames are sent more than once, directly one after the other.
            """,
        ),
        _kind(
            "frame.replace",
            "The payload is exchanged before the frame reaches the wire",
            HitFrames(_replace, in_kernel=True),
            parameters=(
                *_SELECTION,
                Parameter("data", "text", "New payload, hexadecimal, 0 to 8 bytes", required=True),
            ),
            remark=_LOCAL,
            example={"count": 1, "parameters": {"message": "tpdo1", "data": "3702 00000000"}},
            check_values=_check_replacement,
            text="""
            The payload is exchanged before the frame reaches the wire. Length included.
            """,
        ),
        _kind(
            "frame.length",
            "Frames are cut off, or padded with zeros, before they reach the wire",
            HitFrames(_length),
            parameters=(
                *_SELECTION,
                Parameter("length", "int", "Bytes that are left", minimum=0, maximum=8, required=True),
            ),
            remark=_LOCAL,
            example={"count": 1, "parameters": {"message": "tpdo1", "length": 3}},
            check_values=_check_selection,
            text="""
            Frames are cut off, or padded with zeros. An RPDO that is too short is EMCY 8210h and not
            processed, one that is too long is 8220h and processed; the controller counts a wrong TPDO as
            missing.
            """,
        ),
        _kind(
            "frame.inject",
            "A foreign node sends a frame, once or again and again (flooding)",
            Custom(_inject),
            parameters=(
                Parameter("can_id", "int", "Identifier", minimum=0, maximum=0x1FFFFFFF, required=True),
                Parameter("data", "text", "Payload, hexadecimal, 0 to 8 bytes", default=""),
                Parameter("extended", "bool", "29-bit identifier", default=False),
                Parameter(
                    "period_s",
                    "float",
                    "Distance of repetitions; count says how many",
                    unit="s",
                    minimum=5e-05,
                    maximum=3600.0,
                    default=0.001,
                ),
            ),
            example={"count": 100, "parameters": {"can_id": 0, "data": "8001"}},
            check_values=_check_injected,
            text="""
            A foreign node sends a frame, `count` times at a distance of `period_s`. Without `count` once;
            with `duration_s` or `until` and without `count` until that ends.
            """,
        ),
        _kind(
            "frame.lose_arbitration",
            "Rivals start together with the frame and win the arbitration",
            HitFrames(_lose_arbitration),
            parameters=(
                *_SELECTION,
                Parameter("rivals", "int", "Frames that win in a row", minimum=1, maximum=10000, default=1),
                Parameter("rival_id", "int", "Identifier of the rivals", minimum=0, maximum=0x7FF, default=1),
            ),
            refused={"live": _NO_RACE, "hardware": _NO_RACE},
            example={"count": 5, "parameters": {"message": "tpdo1", "rivals": 20}},
            check_values=_check_selection,
            text="""
            Rivals start in the same bit as the frame and win the arbitration, `rivals` times in a row.
            The frame goes out behind them.
            """,
        ),
        _kind(
            "frame.collide",
            "A second node sends the same identifier with other content at the same time",
            HitFrames(_collide),
            parameters=(
                *_SELECTION,
                Parameter(
                    "data", "text", "Payload of the other, hexadecimal; empty: the inverse", default=""
                ),
            ),
            refused={"live": _NO_RACE, "hardware": _NO_RACE},
            example={"count": 1, "parameters": {"message": "tpdo1"}},
            check_values=_check_replacement,
            fuzzed=False,
            text="""
            A second node sends the same identifier with other content at the same time, as two nodes with
            one node-ID do: bit errors for both until one of them is error-passive and gives up.
            """,
        ),
    ),
    title="Which frames are hit",
    text="""
    All kinds that treat frames of others (`frame.*` but `frame.inject`) select them by these
    parameters. `message` and `can_id` exclude each other. With a physical drive `drive` has to be
    given. On a live bus only frames that a node of this process sends or receives can be hit;
    everything that the controller has to do with is among them. On a live segment with a bridge every
    frame between its two sides can be hit, whatever node sends it; `sender` is then the channel from
    which it comes. If the kernel is the bridge (`gateway = "kernel"`), `frame.drop` and
    `frame.replace` hit all frames of an identifier, without `count`, `first`, `every` and
    `probability`; `fault.hit` comes once, at the end, with the number of frames replaced.
    """,
    shared=_SELECTION,
)
