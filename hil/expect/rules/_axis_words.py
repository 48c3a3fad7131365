"""Rules about the words of a technology object: a bit means what its sign says, in both directions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from hil.expect._base import pending_alarms
from hil.expect.rules._definition import Flags, Judged, Rule, spread
from hil.expect.rules._views import CONTROLLED, AxisView

_RESERVED: Final[Mapping[str, int]] = {
    "status_word": 1 << 19 | 1 << 20,
    "status_word2": 0xFFFF_FF00,
    "error_word": ~0xFFBF & 0xFFFF_FFFF,
    "warning_word": ~(1 << 1 | 1 << 3 | 1 << 6 | 1 << 11 | 1 << 14 | 1 << 15) & 0xFFFF_FFFF,
}
"""Bits without a meaning, which read 0; those of synchronous operation have one (VAR-060)."""
_ERROR_BITS: Final[Mapping[int, tuple[int, ...]]] = {
    0: (201, 202, 203, 204),
    1: (101, 104, 105, 106, 107, 108, 109, 114, 343),
    2: (113, 304, 305, 306, 307, 308, 542, 612),
    3: (321, 323),
    4: (421,),
    5: (411, 412),
    7: (431,),
    8: (533, 534),
    9: (531,),
    10: (341, 342),
    11: (521,),
    12: (541,),
    13: (401, 550),
    14: (601, 603, 608),
    15: (102, 103, 552),
}
"""Bit of `ErrorWord` and the alarms that set it."""
_WARNING_BITS: Final[Mapping[int, tuple[int, ...]]] = {
    1: (110,),
    3: (322,),
    6: (501, 502, 503, 504, 511, 551),
    11: (522,),
    15: (111, 112),
}
_REACTIONS: Final[Mapping[int, tuple[int, ...]]] = {
    **dict.fromkeys((110, 111, 112, 202, 322, 501, 502, 503, 504, 511, 522, 551), (0,)),
    533: (1, 2),
    **dict.fromkeys((104, 307, 341), (2,)),
    **dict.fromkeys((304, 305, 306, 321, 342), (3,)),
    **dict.fromkeys((531, 534), (3, 4)),
    **dict.fromkeys((101, 102, 103, 105, 106, 107, 108, 109, 113, 201, 203, 204), (4,)),
    **dict.fromkeys((308, 323, 343, 401, 411, 412, 421, 431, 521, 541, 542, 552), (4,)),
    550: (5,),
}
"""Reaction of every alarm of an axis."""
_EFFECT: Final = (4, 5, 3, 2, 1, 0)
"""Reactions, the one with the highest effect first (TA-004)."""


def _words(axis: AxisView) -> bool:
    return axis.has("status_word", "error_word", "warning_word", "state")


def _reserved(axis: AxisView) -> Judged | None:
    columns = [column for column in _RESERVED if axis.has(column)]
    if not columns:
        return None
    wrong = np.zeros(len(axis.time_s), dtype=np.int64)
    for column in columns:
        wrong |= axis.word(column) & _RESERVED[column]
    return Judged(
        axis.time_s,
        np.ones(len(wrong), dtype=bool),
        wrong != 0,
        lambda at: "; ".join(
            f"{column} = 16#{int(axis[column][at]):08X}"
            for column in columns
            if int(axis[column][at]) & _RESERVED[column]
        ),
    )


RESERVED: Final = Rule(
    name="reserved bits",
    says="bits of StatusWord, ErrorWord and WarningWord without a meaning are 0",
    requirements=("VAR-226", "TA-022"),
    tolerance="none",
    judge=_reserved,
    live=True,
)


def _motion_bits(axis: AxisView) -> Judged | None:
    columns = ("velocity_setpoint", "acceleration_setpoint", "stw1")
    if not _words(axis) or not axis.has(*columns) or axis.number("interpolator_s") is not None:
        return None
    v, a = axis["velocity_setpoint"], axis["acceleration_setpoint"]
    led = axis.in_states(*CONTROLLED) & (axis.word("stw1") & 1 != 0)
    events = axis.whole.events
    led &= ~axis.near(events.of(axis.name, "axis.state", "job.active", "axis.homed", "job.started"), 1, 1)
    if axis.drive is None:
        return None
    constant = a == 0.0
    faster = ~constant & (a * v > 0.0)
    slower = ~constant & (a * v < 0.0)
    shown = axis.word("status_word") >> 12 & 7
    expected = np.where(constant, 1, np.where(faster, 2, np.where(slower, 4, shown)))
    names = {1: "constant velocity", 2: "accelerating", 4: "decelerating"}
    return Judged(
        axis.time_s,
        led,
        led & (shown != expected),
        lambda at: (
            f"StatusWord shows {names.get(int(shown[at]), 'none or several')} in place of "
            f"{names[int(expected[at])]} at {v[at]:.5g} {axis.unit('velocity_setpoint')} and "
            f"{a[at]:.5g} {axis.unit('acceleration_setpoint')}"
        ),
    )


MOTION_BITS: Final = Rule(
    name="motion bits",
    says="X12 constant velocity, X13 accelerating, X14 decelerating are as the setpoint moves",
    requirements=("VAR-040", "VAR-041", "VAR-042", "VAR-055"),
    tolerance="none; not judged in a cycle with a change of state or a new job",
    judge=_motion_bits,
    excused_by=("controller.",),
    recovery_cycles=3,
    live=True,
)


def _standstill(axis: AxisView) -> Judged | None:
    if not _words(axis) or not axis.has("actual_velocity") or axis.number("interpolator_s") is not None:
        return None
    threshold = axis.number_over_time("StandstillSignal.VelocityThreshold")
    dwell = axis.number_over_time("StandstillSignal.MinDwellTime")
    if threshold is None or dwell is None:
        return None
    speed, shown = np.abs(axis["actual_velocity"]), axis.bit(7)
    slow = (speed < threshold) | (speed == 0.0)
    # Samples in a row below the threshold, this one included.
    index = np.arange(len(slow))
    since = index - np.maximum.accumulate(np.where(slow, -1, index))
    needed = np.maximum(np.ceil(dwell / axis.cycle_s - 1e-6), 1.0)
    cycles = int(needed.max())
    may = since >= needed
    before = np.concatenate(([False], shown[:-1]))
    early = shown & ~before & ~may
    late = ~shown & (since >= needed + 2)
    fast = shown & (speed > 1.1 * threshold * (1.0 + 1e-9) + 1e-12)
    dropped = before & ~shown & (speed <= threshold)
    judged = ~spread(axis.in_states("restarting"), 1, cycles + 3)
    judged[0] = False
    events = axis.whole.events
    unsettled = events.all("controller.state", "controller.initialised") + events.of(
        axis.name, "axis.adaption"
    )
    judged &= ~axis.near(unsettled, 1, cycles + 3)
    judged &= ~spread(axis.gaps & (index > 0), 1, cycles + 3)
    broken = judged & (early | late | fast | dropped)

    def describe(at: int) -> str:
        what = "comes" if early[at] else "does not come" if late[at] else "goes" if dropped[at] else "stays"
        return (
            f"X7 {what} at {speed[at]:.4g} {axis.unit('actual_velocity')}, "
            f"{since[at]} cycles below {threshold[at]:g}"
        )

    return Judged(axis.time_s, judged, broken, describe)


STANDSTILL: Final = Rule(
    name="standstill bit",
    says="X7 comes when the actual velocity was below its threshold for the dwell time, not before, and "
    "goes with 110 % of the threshold",
    requirements=("VAR-035", "VAR-059", "MON-048", "MON-050"),
    tolerance="two cycles late, none early",
    judge=_standstill,
    excused_by=("controller.",),
    recovery_s=0.1,
)


def _alarm_spans(axis: AxisView) -> list[tuple[int, int, int, int]]:
    return list(pending_alarms(axis.whole.trace, axis.name))


def _word_of_alarms(axis: AxisView, column: str, bits: Mapping[int, tuple[int, ...]]) -> Judged | None:
    if not _words(axis):
        return None
    places = {number: bit for bit, numbers in bits.items() for number in numbers}
    axis.note_bits(column, bits)
    count = len(axis.time_s)
    must, may = np.zeros(count, dtype=np.int64), np.zeros(count, dtype=np.int64)
    for raised_ns, cleared_ns, number, _ in _alarm_spans(axis):
        bit = places.get(number)
        if bit is None:
            continue
        first, last = axis.index_of(raised_ns), axis.index_of(cleared_ns)
        must[first + 1 : max(last - 1, 0)] |= 1 << bit
        may[max(first - 1, 0) : last + 2] |= 1 << bit
    word = axis.word(column)
    judged = ~spread(axis.in_states("restarting"), 1, 2)
    wrong = (must & ~word) | (word & ~may)
    return Judged(
        axis.time_s,
        judged,
        judged & (wrong != 0),
        lambda at: f"{column} = 16#{int(word[at]):04X} with the alarms of 16#{int(must[at]):04X} pending",
    )


ERROR_WORD: Final[Rule[AxisView]] = Rule(
    name="ErrorWord",
    says="every bit of ErrorWord is that of a pending alarm, and the bit of every pending alarm is set",
    requirements=("TA-001", "TA-021", "DIA-103"),
    tolerance="a cycle",
    judge=lambda axis: _word_of_alarms(axis, "error_word", _ERROR_BITS),
    excused_by=("controller.",),
    recovery_cycles=3,
    live=True,
)
WARNING_WORD: Final[Rule[AxisView]] = Rule(
    name="WarningWord",
    says="every bit of WarningWord is that of a pending warning, and falls with it",
    requirements=("TA-002",),
    tolerance="a cycle",
    judge=lambda axis: _word_of_alarms(axis, "warning_word", _WARNING_BITS),
    excused_by=("controller.",),
    recovery_cycles=3,
    live=True,
)


def _error_detail(axis: AxisView) -> Judged | None:
    if not axis.has("alarm_number", "alarm_reaction", "state"):
        return None
    spans = _alarm_spans(axis)
    count = len(axis.time_s)
    number, reaction = axis.word("alarm_number"), axis.word("alarm_reaction")
    rank = np.full(count, len(_EFFECT) + 1)
    expected = np.zeros(count, dtype=np.int64)
    near = np.zeros(count, dtype=bool)
    for raised_ns, cleared_ns, _, what in spans:
        first, last = axis.index_of(raised_ns), axis.index_of(cleared_ns)
        near[max(first - 1, 0) : first + 2] = True
        near[max(last - 1, 0) : last + 2] = True
        own = _EFFECT.index(what) if what in _EFFECT else len(_EFFECT)
        part = slice(first, last)
        better = own < rank[part]
        expected[part] = np.where(better, what, expected[part])
        rank[part] = np.minimum(rank[part], own)
    pending = rank <= len(_EFFECT)
    judged = ~near & ~spread(axis.in_states("restarting"), 1, 2)
    broken = judged & ((pending != (number != 0)) | (reaction != np.where(pending, expected, 0)))
    return Judged(
        axis.time_s,
        judged,
        broken,
        lambda at: (
            f"ErrorDetail shows alarm {number[at]} with reaction {reaction[at]}, the greatest effect is "
            f"{expected[at]}"
            if pending[at]
            else f"ErrorDetail shows alarm {number[at]}, none is pending"
        ),
    )


ERROR_DETAIL: Final = Rule(
    name="ErrorDetail",
    says="ErrorDetail shows the pending alarm with the greatest effect, and zeros without one",
    requirements=("TA-003", "TA-004"),
    tolerance="a cycle",
    judge=_error_detail,
    excused_by=("controller.",),
    recovery_cycles=3,
    live=True,
)


def _reaction(axis: AxisView) -> Judged | None:
    found = []
    for entry in axis.whole.events.of(axis.name, "alarm.raised"):
        number, reaction = int(entry.data.get("number") or 0), int(entry.data.get("reaction") or 0)
        known = _REACTIONS.get(number)
        wrong = known is not None and reaction not in known
        found.append(
            (
                entry.time_ns * 1e-9,
                f"alarm {number} has reaction {reaction} in place of {known}" if wrong else "",
            )
        )
    return Judged.of_list(found) if found else None


REACTION: Final = Rule(
    name="reactions of alarms",
    says="every alarm has the reaction of the list",
    requirements=("TA-001", "TA-015", "TA-017"),
    tolerance="none",
    judge=_reaction,
    excused_by=("axis.alarm",),
    live=True,
)


_POSITIONING: Final = ("MC_MoveAbsolute", "MC_MoveRelative")
_COMMANDS: Final[tuple[tuple[int, str, tuple[str, ...], str], ...]] = (
    (8, "status_word", _POSITIONING, "VAR-036"),
    (9, "status_word", ("MC_MoveJog",), "VAR-037"),
    (10, "status_word", ("MC_MoveVelocity",), "VAR-038"),
    (11, "status_word", ("MC_Home",), "VAR-039"),
    (23, "status_word", ("MC_MoveSuperimposed",), "VAR-047"),
    (31, "status_word", ("MC_MotionInVelocity", "MC_MotionInPosition"), "VAR-054"),
    (6, "status_word2", ("MC_MotionInSuperimposed",), "VAR-063"),
    (7, "status_word2", ("MC_HaltSuperimposed",), "VAR-064"),
)
"""Bits that show a job in control."""


def _command_bits(axis: AxisView) -> Judged | None:
    if not _words(axis) or not axis.has("status_word2"):
        return None
    count = len(axis.time_s)
    active: dict[str, Flags] = {}
    edges = np.zeros(count, dtype=bool)
    events = axis.whole.events
    found = events.of(axis.name, "job.active", "job.done", "job.aborted", "job.error")
    begun: dict[object, tuple[int, str]] = {}
    for entry in sorted(found, key=lambda one: one.time_ns):
        at = axis.index_of(entry.time_ns)
        edges[max(at - 1, 0) : at + 1 + axis.ratio] = True
        instruction = str(entry.data.get("instruction"))
        if entry.kind == "job.active":
            begun[entry.data.get("job")] = (at, instruction)
        else:
            first, instruction = begun.pop(entry.data.get("job"), (at, instruction))
            active.setdefault(instruction, np.zeros(count, dtype=bool))[first:at] = True
    for first, instruction in begun.values():
        active.setdefault(instruction, np.zeros(count, dtype=bool))[first:] = True
    none = np.zeros(count, dtype=bool)
    wrong = np.full(count, -1)
    for place, (bit, column, instructions, _) in enumerate(_COMMANDS):
        if axis.drive is None and instructions == ("MC_Home",):
            continue  # there is nothing to search, whatever the mode (HOM-031)
        expected = none
        for instruction in instructions:
            expected = expected | active.get(instruction, none)
        differs = axis.bit(bit, column) != expected
        wrong[differs] = place
    judged = ~edges & ~spread(axis.in_states("restarting"), 2, 2)

    def describe(at: int) -> str:
        bit, column, instructions, _ = _COMMANDS[wrong[at]]
        state = "is set without" if axis.bit(bit, column)[at] else "is not set with"
        return f"{column}.X{bit} {state} {' or '.join(instructions)} in control"

    return Judged(axis.time_s, judged, judged & (wrong >= 0), describe)


COMMAND_BITS: Final = Rule(
    name="command bits",
    says="X8 to X11, X23, X31 and StatusWord2.X6, X7 show exactly the jobs that are in control",
    requirements=tuple(one for *_, one in _COMMANDS),
    tolerance="the cycle of the change and one on either side",
    judge=_command_bits,
    excused_by=("controller.",),
    recovery_cycles=3,
    live=True,
)


_QUIET: Final = ("disabled", "enabling", "standstill", "stop_hold", "alarm_standstill", "alarm_disabled")
_ENABLED: Final = (*CONTROLLED, "disabling_quick", "disabling_coast")


def _enable_bits(axis: AxisView) -> Judged | None:
    if not _words(axis) or not axis.has("power_status"):
        return None
    enabled, status = axis.bit(0), axis["power_status"] != 0
    changes = axis.near(axis.whole.events.of(axis.name, "axis.state", "power.status"), 1, 1)
    state = axis.in_states(*_ENABLED)
    broken = ~changes & ((enabled != state) | (status != state))
    return Judged(
        axis.time_s,
        ~changes,
        broken,
        lambda at: f"X0 = {int(enabled[at])}, MC_Power.Status = {int(status[at])}",
    )


ENABLE_BIT: Final = Rule(
    name="enable bit",
    says="X0 and MC_Power.Status are set while the axis is enabled, stops by the drive included",
    requirements=("VAR-028", "STP-507"),
    tolerance="a cycle",
    judge=_enable_bits,
    excused_by=("controller.",),
    recovery_cycles=3,
    live=True,
)


def _done_bit(axis: AxisView) -> Judged | None:
    if not _words(axis):
        return None
    done, panel = axis.bit(6), axis.bit(4)
    changes = axis.near(axis.whole.events.of(axis.name, "axis.state", "panel.control"), 1, axis.ratio)
    quiet = axis.in_states(*_QUIET)
    judged = ~changes & ~panel
    return Judged(
        axis.time_s,
        judged,
        judged & (done != quiet),
        lambda at: "X6 is set during a motion" if done[at] else "X6 is not set, and no job moves the axis",
    )


DONE_BIT: Final = Rule(
    name="done bit",
    says="X6 is set while no job moves the axis and no stop is on its way, and only then",
    requirements=("VAR-034",),
    tolerance="a cycle",
    judge=_done_bit,
    excused_by=("controller.",),
    recovery_cycles=3,
    live=True,
)


def _in_operation(axis: AxisView) -> Judged | None:
    """An axis that leads its setpoints needs a drive that follows them."""
    if not _words(axis) or not axis.has("in_operation", "communication_ok"):
        return None
    led = axis.in_states("standstill", "motion", "halting", "stopping", "stop_hold", "enable_ramp")
    lost = led & (axis["in_operation"] == 0)
    long = lost.copy()
    for step in range(1, 2 * axis.ratio + 1):
        long[step:] &= lost[:-step]
        long[:step] = False
    return Judged(
        axis.time_s,
        led,
        long,
        lambda _at: "the drive is not in operation for three cycles, and there is no alarm",
    )


IN_OPERATION: Final = Rule(
    name="drive in operation",
    says="an axis whose drive leaves operation takes note of it at once",
    requirements=("TA-020", "STP-559"),
    tolerance="three cycles, of a slower interpolator two of its own",
    judge=_in_operation,
    excused_by=("controller.",),
    recovery_cycles=5,
)

AXIS_RULES: Final[tuple[Rule[AxisView], ...]] = (
    RESERVED,
    MOTION_BITS,
    STANDSTILL,
    ENABLE_BIT,
    DONE_BIT,
    COMMAND_BITS,
    ERROR_WORD,
    WARNING_WORD,
    ERROR_DETAIL,
    REACTION,
    IN_OPERATION,
)
