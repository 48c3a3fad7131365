"""Rules about CANopen nodes, from the frames of the bus alone: they hold for a device of the bench as for
anybody else's.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator
from itertools import islice, pairwise
from operator import itemgetter
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hil.expect.rules._bus_views import (
    OPERATIONAL,
    PREPARED,
    STARTING,
    STOPPED,
    BusView,
    Sent,
    Setting,
    State,
    between,
)
from hil.expect.rules._can_length import INTERMISSION_BITS, length_of
from hil.expect.rules._definition import Describe, Flags, Judged, Numbers, Rule
from hil.expect.rules._frames import closely_behind
from hil.expect.rules._sdo_dialogue import Dialogue

_DISTURBED: Final = (
    "frame.", "can.", "drive.", "encoder.", "io.", "telegram.", "controller.", "pto.", "proxy.",
)  # fmt: skip
_RECOVERY_S: Final = 1.0
_FOLLOWS_BITS: Final = 180
"""A frame that ends so soon behind another may follow it at once."""
_STATES: Final = {
    OPERATIONAL: "Operational",
    STOPPED: "Stopped",
    PREPARED: "Pre-operational",
    STARTING: "boot-up",
}
_TPDOS: Final = (0x180, 0x280, 0x380, 0x480)
Found = list[tuple[float, str]]


def _judged(found: Found) -> Judged | None:
    return Judged.of_list(sorted(found, key=itemgetter(0))) if found else None


# -- SDO -----------------------------------------------------------------------------------------------------


def _sdo(bus: BusView) -> Judged | None:
    found: Found = []
    for node in bus.nodes:
        answers = bus.sent(0x580 + node)
        if not answers or not bus.alone(node, 0x580 + node):
            continue
        requests = bus.sent(0x600 + node)
        both = sorted(
            [(one.time_s, False, one.data) for one in requests]
            + [(one.time_s, True, one.data) for one in answers]
        )
        starts = [
            one.begin_s for one in bus.states(node) if one.state in (STARTING, STOPPED) or not one.commanded
        ]
        talk = Dialogue()
        for when, answers_it, data in both:
            while starts and starts[0] < when:
                # A restart, or Stopped, drops the transfer without a word.
                starts.pop(0)
                talk = Dialogue()
            if answers_it:
                wrong = talk.answer(data)
                found.append((when, wrong and f"node {node}: {wrong}"))
            else:
                talk.request(data)
    return _judged(found)


SDO: Final = Rule(
    name="SDO dialogue",
    says="every answer of an SDO server fits the request, segment and block in front of it",
    requirements=("C301-057", "C301-059", "C301-061", "C301-064", "C301-067", "C301-069", "C301-072"),
    tolerance="none",
    judge=_sdo,
    excused_by=_DISTURBED,
    recovery_s=_RECOVERY_S,
    live=True,
)


# -- NMT, boot-up, heartbeat ---------------------------------------------------------------------------------


def _troubled(bus: BusView, node: int, since_s: float, time_s: float) -> bool:
    """Return whether the node has told a communication error in a time: 1029h may have changed its state."""
    return any(
        len(one.data) > 1 and one.data[1] in (0x81, 0x82)
        for one in between(bus.sent(0x80 + node), since_s, time_s)
    )


def _shown(bus: BusView) -> Judged | None:
    found: Found = []
    for node in bus.nodes:
        if not bus.alone(node, 0x700 + node):
            continue
        states = bus.states(node)
        for when, data in bus.sent(0x700 + node):
            if len(data) != 1:
                found.append((when, f"node {node}: error control with {len(data)} bytes"))
                continue
            told = bus.state_at(states, when)
            if data == b"\0" or told is None or told.state == STARTING:
                continue
            state = data[0] & 0x7F
            right = state == told.state or _troubled(bus, node, told.begin_s, when)
            text = f"node {node} shows state {state} in place of {told.state} ({_STATES[told.state]})"
            found.append((when, "" if right else text))
    return _judged(found)


NMT_STATE: Final = Rule(
    name="NMT state",
    says="heartbeat and guarding answer show the state that the last NMT command or boot-up has led to",
    requirements=("C301-016", "C301-017", "C301-022", "C301-023"),
    tolerance="1.5 ms and six frames behind a command, 100 ms on a live bus and in logs; not behind a "
    "communication error (1029h)",
    judge=_shown,
    excused_by=_DISTURBED,
    recovery_s=_RECOVERY_S,
    live=True,
)


def _silence(bus: BusView) -> Judged | None:
    found: Found = []
    for node in bus.nodes:
        states = bus.states(node)
        for begin, state, end_s in _intervals(bus, states):
            names = {
                STOPPED: {0x580: "an SDO answer", 0x80: "an EMCY", **dict.fromkeys(_TPDOS, "a PDO")},
                PREPARED: dict.fromkeys(_TPDOS, "a PDO"),
                STARTING: {0x580: "an SDO answer", 0x80: "an EMCY", **dict.fromkeys(_TPDOS, "a PDO")},
            }.get(state.state, {})
            for base, what in names.items():
                if not bus.alone(node, base + node):
                    continue
                if state.state == PREPARED and not state.commanded:
                    continue
                frames = bus.frames(base + node)
                found.append((begin, ""))
                found += [
                    (when, f"node {node} sends {what} in {_STATES[state.state]}")
                    for when in frames.time_s[frames.between(begin, end_s)][:3].tolist()
                ]
    return _judged(found)


def _intervals(bus: BusView, states: list[State]) -> Iterator[tuple[float, State, float]]:
    """Return the times in which a node is in a state for sure."""
    for state, following in zip(states, [*states, None][1:], strict=True):
        end_s = bus.end_s if following is None else following.begin_s
        begin_s = state.begin_s + bus.settle_s
        if begin_s < end_s:
            yield begin_s, state, end_s


SILENT: Final = Rule(
    name="services of a state",
    says="no PDO in Pre-operational, in Stopped and before the boot-up no SDO, EMCY and PDO of a node",
    requirements=("C301-016", "C301-056", "C301-022"),
    tolerance="1.5 ms and six frames behind a command, 100 ms on a live bus and in logs",
    judge=_silence,
    excused_by=_DISTURBED,
    recovery_s=_RECOVERY_S,
    live=True,
)


def _boot_ups(bus: BusView) -> Judged | None:
    found: Found = []
    for node in bus.nodes:
        states = bus.states(node)
        for state, following in pairwise(states):
            if state.state == STARTING and following.begin_s - state.begin_s > 1.0:
                found.append((state.begin_s, f"node {node} sends no boot-up after a reset"))
            elif state.state == STARTING:
                found.append((state.begin_s, ""))
    return _judged(found)


BOOT_UP: Final = Rule(
    name="boot-up",
    says="a node that is reset sends its boot-up within a second",
    requirements=("C301-022",),
    tolerance="none",
    judge=_boot_ups,
    excused_by=_DISTURBED,
    recovery_s=_RECOVERY_S,
)


def _wrong_periods(bus: BusView, frames: list[Sent], period_s: float, who: str) -> Found:
    """Return the distances of frames that are to come in a period."""
    most = max(6 * bus.frame_s, 0.02 * period_s if bus.whole.trace.from_log else 0.0)
    found: Found = []
    waited_s = 0.0
    for one, other in pairwise(frames):
        off = other.time_s - one.time_s - period_s + waited_s
        waited_s = 0.0
        if off > most and bus.busy(other.time_s - off, other.time_s):
            off, waited_s = 0.0, off
        text = f"{who} comes after {1000 * (off + period_s):.3f} ms in place of {1000 * period_s:.3f} ms"
        found.append((other.time_s, text if abs(off) > most else ""))
    return found


def _heartbeats(bus: BusView) -> Judged | None:
    found: Found = []
    for node in bus.nodes:
        if not bus.alone(node, 0x700 + node):
            continue
        beats = [one for one in bus.sent(0x700 + node) if one.data != b"\0"]
        for begin_s, end_s, value in bus.settings(node, 0x1017, 0):
            some = between(beats, begin_s, end_s)
            if value == 0:
                # Guarding answers are asked for.
                asked = bus.asked(0x700 + node)
                late = [one for one in between(some, begin_s + bus.settle_s, end_s) if not asked]
                found += [(one.time_s, f"node {node} sends a heartbeat with 1017h = 0") for one in late]
                continue
            period_s = value * 1e-3
            found += _wrong_periods(bus, [Sent(begin_s, b""), *some], period_s, f"heartbeat of node {node}")
            due_s = (some[-1].time_s if some else begin_s) + period_s
            if end_s == bus.end_s or any(one.begin_s == end_s and one.commanded for one in bus.states(node)):
                ended = end_s > due_s + 6 * bus.frame_s
                found.append((due_s, f"heartbeats of node {node} end" if ended else ""))
    return _judged(found)


HEARTBEAT: Final = Rule(
    name="heartbeat time",
    says="the heartbeats of a node come in the time that was written to its 1017h, with 0 none",
    requirements=("C301-023",),
    tolerance="six frames, and as long as one frame follows the other on the bus",
    judge=_heartbeats,
    excused_by=_DISTURBED,
    recovery_s=_RECOVERY_S,
)


def _consumers(bus: BusView) -> Judged | None:
    """Both ends of the consumer time: 8130h when a watched node falls silent, and not before."""
    found: Found = []
    for node in bus.nodes:
        emcys = [one for one in bus.sent(0x80 + node) if one.data[:2] == b"\x30\x81"]
        guarded = bool(bus.settings(node, 0x100C, 0))
        states = bus.states(node)
        due: list[tuple[float, bool]] = []
        sure = True
        watching = False
        for sub in range(1, 9):
            for begin_s, end_s, value in bus.settings(node, 0x1016, sub):
                other, time_s = value >> 16 & 0x7F, (value & 0xFFFF) * 1e-3
                if not other or not time_s:
                    continue
                watching = True
                beats = between(bus.sent(0x700 + other), begin_s, end_s)
                sure = sure and len(bus.whole.frames.senders(bus.name, 0x700 + other)) <= 1
                for one, following in zip(beats, [*beats, None][1:], strict=True):
                    next_s = end_s if following is None else following.time_s
                    if one.data[:1] not in (b"", b"\0") and next_s - one.time_s > time_s - bus.frame_s:
                        certain = next_s - one.time_s > time_s + bus.settle_s
                        due.append((one.time_s + time_s, certain))
        if not sure or guarded or not watching:
            continue
        lost = False
        for when, sure_of_it in sorted(due):
            state = bus.state_at(states, when)
            near = [one for one in emcys if abs(one.time_s - when) < bus.settle_s]
            if sure_of_it and not lost and state is not None and state.state in (OPERATIONAL, PREPARED):
                wrong = not near and not bus.settings(node, 0x1014, 0)
                found.append(
                    (when, f"node {node} does not tell a missing heartbeat (8130h)" if wrong else "")
                )
            lost = True
        for one in emcys:
            right = any(abs(one.time_s - when) < bus.settle_s for when, _ in due)
            found.append(
                (one.time_s, "" if right else f"node {node} misses a heartbeat (8130h) that is not due")
            )
    return _judged(found)


CONSUMER: Final = Rule(
    name="heartbeat consumer",
    says="8130h comes when a watched node is silent for the time that was written to 1016h, and not before",
    requirements=("C301-026", "C301-123"),
    tolerance="1.5 ms and six frames",
    judge=_consumers,
    excused_by=_DISTURBED,
    recovery_s=_RECOVERY_S,
)


def _guarding(bus: BusView) -> Judged | None:
    found: Found = []
    for node in bus.nodes:
        asked = bus.asked(0x700 + node)
        if not asked or not bus.alone(node, 0x700 + node):
            continue
        answers = bus.sent(0x700 + node)
        starts = [one.begin_s for one in bus.states(node) if one.state == STARTING or not one.commanded]
        toggle: int | None = None
        for when in asked:
            at = bisect_right(answers, when, key=lambda one: one.time_s)
            if at == len(answers) or answers[at].time_s - when > bus.settle_s or answers[at].data == b"\0":
                continue
            if starts and starts[0] < when:
                toggle = 0
                starts = [one for one in starts if one > when]
            bit = answers[at].data[0] >> 7
            found.append(
                (
                    when,
                    "" if toggle in (None, bit) else f"guarding answer of node {node} with toggle bit {bit}",
                )
            )
            toggle = bit ^ 1
    return _judged(found)


GUARDING: Final = Rule(
    name="guarding toggle bit",
    says="bit 7 of the guarding answers changes from answer to answer and begins with 0",
    requirements=("C301-028",),
    tolerance="none",
    judge=_guarding,
    excused_by=_DISTURBED,
    recovery_s=_RECOVERY_S,
    live=True,
)


# -- EMCY ----------------------------------------------------------------------------------------------------

_REGISTER: Final = (
    (0x2000, 0x2FFF, 0x02),
    (0x3000, 0x3FFF, 0x04),
    (0x4000, 0x4FFF, 0x08),
    (0x8100, 0x82FF, 0x10),
)
"""Codes and the bit of 1001h that belongs to them (CiA 301, table 26)."""


def _emcys(bus: BusView) -> Judged | None:
    found: Found = []
    for node in bus.nodes:
        if not bus.alone(node, 0x80 + node):
            continue
        for when, data in bus.sent(0x80 + node):
            if len(data) != 8:
                found.append((when, f"node {node}: EMCY with {len(data)} bytes"))
                continue
            code, register = data[0] | data[1] << 8, data[2]
            wanted = 0 if not code >> 8 else 1
            # All bits but the first are optional; the emulated devices have them.
            for low, high, bit in () if bus.real else _REGISTER:
                if low <= code <= high:
                    wanted |= bit
            text = f"node {node}: EMCY {code:04X}h with register {register:02X}h, {wanted:02X}h is missing"
            found.append((when, text if register & wanted != wanted else ""))
    return _judged(found)


EMCY: Final = Rule(
    name="EMCY and register",
    says="an EMCY has eight bytes, and its register the bits of its code",
    requirements=("C301-109", "C301-112"),
    tolerance="on a live bus and in logs bit 0 alone, because the others are optional",
    judge=_emcys,
    excused_by=("frame.", "drive.emcy_storm"),
    recovery_s=_RECOVERY_S,
    live=True,
)


# -- PDO and SYNC --------------------------------------------------------------------------------------------


def _value_at(values: list[Setting], begin_s: float, end_s: float) -> int | None:
    """Return the value that holds all through a time; None: none does."""
    return next((one.value for one in values if one.begin_s <= begin_s and one.end_s >= end_s), None)


def _tpdos(bus: BusView) -> Judged | None:
    looked = _Looked()
    syncs = bus.frames(0x80).time_s
    for node in bus.nodes:
        for number in range(4):
            can_ids = bus.settings(node, 0x1800 + number, 1)
            if not can_ids:
                continue
            kinds, counts = bus.settings(node, 0x1800 + number, 2), bus.settings(node, 0x1A00 + number, 0)
            times = bus.settings(node, 0x1800 + number, 5)
            pauses = bus.settings(node, 0x1800 + number, 3)
            starts = bus.settings(node, 0x1800 + number, 6)
            for begin_s, state, end_s in _intervals(bus, bus.states(node)):
                if state.state != OPERATIONAL or not state.commanded:
                    continue
                for setting in can_ids:
                    from_s, to_s = max(begin_s, setting.begin_s), min(end_s, setting.end_s)
                    if setting.value >> 31 or setting.value & 0x3FFFF800 or from_s >= to_s:
                        continue
                    if not bus.alone(node, setting.value & 0x7FF):
                        continue
                    frames = bus.frames(setting.value & 0x7FF)
                    within = frames.between(from_s, to_s)
                    pdo = _Pdo(f"TPDO{number + 1} of node {node}", frames.time_s[within], from_s, to_s)
                    count = _value_at(counts, from_s, to_s)
                    entries = [
                        bus.settings(node, 0x1A00 + number, sub) for sub in range(1, min(count or 0, 8) + 1)
                    ]
                    parts = [_value_at(one, from_s, to_s) for one in entries]
                    if count and count <= 8 and None not in parts:
                        size = -(-sum((one or 0) & 0xFF for one in parts) // 8)
                        _mapped(looked, pdo, frames.lengths[within], size)
                    kind = _value_at(kinds, from_s, to_s)
                    if kind is not None and 1 <= kind <= 240:
                        if not starts or _value_at(starts, from_s, to_s) == 0:
                            _cyclic(looked, bus, pdo, syncs, kind)
                    elif kind is not None and kind >= 254:
                        timer, pause = _value_at(times, from_s, to_s), _value_at(pauses, from_s, to_s)
                        _by_event(looked, bus, pdo, (timer or 0) * 1e-3, (pause or 0) * 1e-4)
    return looked.judged()


class _Looked:
    """Frames that were looked at, most of which are right."""

    def __init__(self) -> None:
        self._right: list[Numbers] = []
        self.wrong: Found = []

    def add(self, times: Numbers, wrong: Flags, describe: Describe) -> None:
        """Add frames: when they ended, which are wrong, and what is wrong with one."""
        if not wrong.any():
            self._right.append(times)
            return
        self._right.append(times[~wrong])
        self.wrong += [(float(times[at]), describe(at)) for at in np.flatnonzero(wrong).tolist()]

    def judged(self) -> Judged | None:
        """Return what was found; None: nothing was looked at."""
        if not self.wrong and not sum(map(len, self._right)):
            return None
        return Judged.of_times(self._right, sorted(self.wrong, key=itemgetter(0)))


class _Pdo(NamedTuple):
    """Frames of a transmit PDO while its settings hold and the node is Operational."""

    name: str
    times: Numbers
    """When they ended, s."""
    begin_s: float
    end_s: float


def _mapped(looked: _Looked, pdo: _Pdo, lengths: NDArray[np.uint8], size: int) -> None:
    """Look at the lengths of a PDO: that of its mapping, bytes."""
    looked.add(
        pdo.times, lengths != size, lambda at: f"{pdo.name} with {lengths[at]} bytes, {size} are mapped"
    )


def _cyclic(looked: _Looked, bus: BusView, pdo: _Pdo, syncs: Numbers, kind: int) -> None:
    """Look at a PDO that comes with every n-th SYNC: not more and not less often."""
    name, times, begin_s, end_s = pdo
    last_sync = np.searchsorted(syncs, times, side="right") - 1
    early = int(np.searchsorted(last_sync, 0))
    looked.wrong += [(when, f"{name} comes without a SYNC") for when in times[:early].tolist()]
    since = np.diff(last_sync[early:], prepend=last_sync[early : early + 1] - kind)
    looked.add(
        times[early:], since != kind, lambda at: f"{name} comes after {since[at]} SYNCs, {kind} are set"
    )
    behind = int(np.searchsorted(syncs, end_s - bus.settle_s)) - 1
    last = int(last_sync[-1]) if early < len(times) else int(np.searchsorted(syncs, begin_s)) - 1
    missed = behind - last
    if missed > kind:
        looked.wrong.append(
            (float(syncs[behind]), f"{name} does not come with {missed} SYNCs, {kind} are set")
        )


def _by_event(looked: _Looked, bus: BusView, pdo: _Pdo, timer_s: float, pause_s: float) -> None:
    """Look at an event-driven PDO: not sooner than its inhibit time, not later than its timer."""
    name, times, begin_s, end_s = pdo
    waits_s = 3 * bus.frame_s
    gaps = np.diff(times)
    soon = gaps < (pause_s - waits_s if pause_s else 0.0)
    late = gaps > (timer_s + waits_s if timer_s > pause_s else np.inf)
    pause, timer = f"inhibit time is {1000 * pause_s:.1f}", f"event timer is {1000 * timer_s:.0f}"
    looked.add(
        times[1:],
        soon | late,
        lambda at: f"{name} comes after {1000 * gaps[at]:.2f} ms, its {pause if soon[at] else timer} ms",
    )
    if timer_s > pause_s:
        last_s = float(times[-1]) if len(times) else begin_s
        if end_s - last_s > timer_s + waits_s:
            looked.wrong.append(
                (last_s + timer_s, f"{name} does not come, its event timer is {1000 * timer_s:.0f} ms")
            )


TPDO: Final = Rule(
    name="transmit PDOs",
    says="a PDO has the length of its mapping, comes with every n-th SYNC of its type, keeps event timer and "
    "inhibit time",
    requirements=("C301-039", "C301-047", "C301-048", "C301-051"),
    tolerance="three frames; settings as written by SDO in the trace",
    judge=_tpdos,
    excused_by=_DISTURBED,
    recovery_s=_RECOVERY_S,
)

# -- the wire ------------------------------------------------------------------------------------------------

_LOOKED_AT: Final = 4000
"""Frames at the begin of a log among which those that follow closely are looked for."""
_MEASURED: Final = 24
"""Different frames whose length is measured: one with each identifier and length."""


def _lengths(bus: BusView) -> Judged | None:
    if bus.bitrate is None or bus.whole.trace.from_log:
        return None
    found: Found = []
    bit_ns = 1e9 / bus.bitrate
    some = closely_behind(bus.whole.trace.can_log(bus.name), _FOLLOWS_BITS * bit_ns, _LOOKED_AT)
    for gap_ns, (end_ns, _, frame, _) in islice(some, _MEASURED):
        gap, least = gap_ns / bit_ns, INTERMISSION_BITS + length_of(frame)
        wrong = (
            gap < least - 0.5 and f"{frame} ends {gap:.1f} bits behind the frame before it, it has {least}"
        )
        found.append((end_ns * 1e-9, f"{wrong} with the intermission" if wrong else ""))
    return _judged(found)


LENGTHS: Final = Rule(
    name="frames and their length",
    says="no frame ends sooner behind another than its bits with stuff bits and intermission take",
    requirements=("CANP-008", "CANP-014", "CANP-015", "CANP-017"),
    tolerance="half a bit; of the first frames of a log, one with each identifier and length",
    judge=_lengths,
    excused_by=_DISTURBED,
    recovery_s=_RECOVERY_S,
)

BUS_RULES: Final[tuple[Rule[BusView], ...]] = (
    LENGTHS,
    SDO,
    NMT_STATE,
    SILENT,
    BOOT_UP,
    HEARTBEAT,
    CONSUMER,
    GUARDING,
    EMCY,
    TPDO,
)
