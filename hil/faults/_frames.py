"""Faults of frames: a hook in the segment that picks its victims, and a foreign node that talks."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final

from fieldbus.clock import seconds_to_ns
from fieldbus.errors import ConfigurationError, UnsupportedFaultError
from hil.faults._action import Action, refuse_unless_supported
from hil.faults._fault import Fault, parse_payload
from hil.faults._trigger import OnFrame
from hil.faults._watch import frame_matcher, message_id
from hil.protocols import Bench

if TYPE_CHECKING:
    from numpy.random import Generator

    from fieldbus.can.frame import CanFrame
    from fieldbus.clock import Scheduler

Work = Callable[[], None]

_RIVAL: Final = "rival"
_TWIN: Final = "twin"
_STRANGER: Final = "fault"
_FOREIGN: Final = (_STRANGER, _RIVAL, _TWIN, "load", "babbler")
"""Senders that faults bring with them."""


def _treatment(fault: Fault, segment: Any, scheduler: Scheduler, rng: Generator) -> Callable[[CanFrame], Any]:
    """Return what is done to a frame that is hit."""
    from fieldbus.can.bitstream import BitError
    from fieldbus.can.frame import CanFrame
    from fieldbus.can.hooks import HookResult

    match fault.kind:
        case "frame.drop":
            fixed = HookResult.drop()
        case "frame.delay":
            fixed = HookResult.delay(seconds_to_ns(fault.value("delay_s")))
        case "frame.jitter":
            jitter_ns = seconds_to_ns(fault.value("jitter_s"))
            return lambda _frame: HookResult.delay(int(rng.integers(1, jitter_ns, endpoint=True)))
        case "frame.drift":
            share = fault.value("drift_ppm") * 1e-6
            begun: list[int] = []

            def fall_behind(_frame: CanFrame) -> HookResult:
                if not begun:
                    begun.append(scheduler.now)
                return HookResult.delay(max(round((scheduler.now - begun[0]) * share), 1))

            return fall_behind
        case "frame.corrupt":
            names = [name.strip() for name in str(fault.value("nodes")).split(",") if name.strip()]
            known = [port.name for port in segment.ports]
            for name in names:
                if name not in known:
                    raise ConfigurationError("frame.corrupt.parameters.nodes", name, ", ".join(known))
            error = BitError(fault.value("field"), fault.value("bit"), frozenset(names) if names else None)
            fixed = HookResult.corrupt(fault.value("attempts"), error)
        case "frame.duplicate":
            fixed = HookResult.duplicate(fault.value("copies"))
        case "frame.length":
            length = fault.value("length")
            return lambda frame: HookResult.replace(
                CanFrame(frame.can_id, frame.data[:length].ljust(length, b"\0"), extended=frame.extended)
            )
        case "frame.lose_arbitration":
            rival = CanFrame(fault.value("rival_id"))

            def outdo(_frame: CanFrame) -> None:
                for _ in range(fault.value("rivals")):
                    segment.inject(rival, sender=_RIVAL)

            return outdo
        case "frame.collide":
            given = parse_payload("frame.collide.parameters.data", fault.value("data"))

            def collide(frame: CanFrame) -> None:
                data = given or bytes(byte ^ 0xFF for byte in frame.data)
                segment.inject(CanFrame(frame.can_id, data, extended=frame.extended), sender=_TWIN)

            return collide
        case _:
            data = parse_payload("frame.replace.parameters.data", fault.value("data"))
            return lambda frame: HookResult.replace(CanFrame(frame.can_id, data, extended=frame.extended))
    return lambda frame: fixed  # noqa: ARG005 - the same for every frame


def selected_identifier(bench: Bench, fault: Fault, segment: str) -> tuple[int, int]:
    """Return the identifier that the parameters select, and the bits of it that count; 0 bits: every
    frame.
    """
    message, can_id = fault.value("message"), fault.value("can_id")
    mask: int = fault.value("mask") if message or can_id is not None else 0
    wanted = message_id(bench, fault.value("drive"), message, segment) if message else can_id or 0
    return wanted & mask, mask


def _known_sender(segment: Any, fault: Fault) -> str:
    """Return the sender that the fault names, checked: of one that nobody is no frame would ever be hit.

    Raises:
        ConfigurationError: No node of the segment has this name.
        UnsupportedFaultError: It is a live bus, where frames of others are known by the side from which
            they come.

    """
    name: str = fault.value("sender")
    sides = getattr(segment, "sides", ())
    known = [part.name for part in (*getattr(segment, "ports", ()), *sides)]
    if not name or not known or name in (*known, *_FOREIGN):
        return name
    if sides:
        raise UnsupportedFaultError(
            f"{fault.kind} cannot be injected: on {segment.name} senders are known as {', '.join(known)}, "
            f"not as {name!r}"
        )
    raise ConfigurationError(
        f"{fault.kind}.parameters.sender",
        name,
        f"{', '.join(known)}, or {', '.join(_FOREIGN)} of other faults",
    )


class FrameAction(Action):
    """Do something to the frames that the parameters select.

    Args:
        bench: The bench.
        fault: What to do.
        stream: Name of the random stream of this fault.
        ended: Called when `count` frames have been hit.
        note: Called at every hit with its number and the identifier of the frame.

    """

    __slots__ = (
        "_active",
        "_bench",
        "_can_id",
        "_chance",
        "_counter",
        "_ended",
        "_every",
        "_first",
        "_hits_left",
        "_mask",
        "_note",
        "_on_trigger",
        "_remove_hook",
        "_rng",
        "_segment",
        "_sender",
        "_treat",
        "_trigger_matches",
        "hits",
    )

    def __init__(
        self, bench: Bench, fault: Fault, stream: str, ended: Work, note: Callable[[int, int], None]
    ) -> None:
        self._segment = bench.segment(fault.target or None)
        refuse_unless_supported(bench, fault, self._segment)
        super().__init__(str(self._segment.name), self._begin, self._finish)
        value = fault.value
        self._bench = bench
        self._ended = ended
        self._note = note
        self._treat = _treatment(fault, self._segment, bench.scheduler, bench.rng(f"{stream}.treatment"))
        self._can_id, self._mask = selected_identifier(bench, fault, self._segment.name)
        self._sender: str = _known_sender(self._segment, fault)
        self._first: int = value("first")
        self._every: int = value("every")
        self._chance: float = value("probability")
        self._rng = bench.rng(stream) if self._chance < 1.0 else None
        self._hits_left = fault.count
        self._counter = 0
        self._active = False
        self._remove_hook: Work | None = None
        self._trigger_matches: Callable[[Any], bool] | None = None
        self._on_trigger: Work | None = None
        self.hits = 0
        """Frames hit so far."""

    def arm_with(self, trigger: OnFrame, apply: Work) -> Work:
        """Begin with the frame that fulfils `trigger`, that frame included; returns the function that ends
        waiting.
        """
        self._trigger_matches = frame_matcher(self._bench, trigger, self._segment.name)
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

    def _hook(self, frame: CanFrame, sender: str, time_ns: int) -> Any:  # noqa: ARG002 - signature of a hook
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
        self.hits += 1
        self._note(self.hits, frame.can_id)
        result = self._treat(frame)
        if self._hits_left is not None:
            self._hits_left -= 1
            if self._hits_left == 0:
                # Taken out of the segment only after it has finished asking its hooks about this frame.
                self._active = False
                scheduler = self._bench.scheduler
                scheduler.at(scheduler.now, self._ended)
        return result


class InjectAction(Action):
    """A foreign node that sends `count` frames, or floods until removed.

    Args:
        bench: The bench.
        fault: What to send.
        ended: Called when `count` frames have been sent.

    """

    __slots__ = ("_bench", "_ended", "_frame", "_left", "_period_ns", "_segment", "_timer")

    def __init__(self, bench: Bench, fault: Fault, ended: Work) -> None:
        from fieldbus.can.frame import CanFrame

        self._segment = bench.segment(fault.target or None)
        refuse_unless_supported(bench, fault, self._segment)
        super().__init__(str(self._segment.name), self._send, self._stop)
        self._bench = bench
        self._ended = ended
        data = parse_payload("frame.inject.parameters.data", fault.value("data"))
        self._frame = CanFrame(fault.value("can_id"), data, extended=fault.value("extended"))
        self._period_ns = seconds_to_ns(fault.value("period_s"))
        endless = fault.count is None and (fault.duration_s is not None or fault.until is not None)
        self._left = None if endless else fault.count or 1
        self._timer: Any = None

    def _send(self) -> None:
        self._segment.inject(self._frame, sender=_STRANGER)
        if self._left is not None:
            self._left -= 1
            if self._left == 0:
                self._ended()
                return
        self._timer = self._bench.scheduler.after(self._period_ns, self._send)

    def _stop(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
