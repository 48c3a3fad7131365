"""Rules about the words of a drive, its error register and its EMCYs: each says what the drive does."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from hil.expect._words import where_code
from hil.expect.rules._definition import Flags, Judged, Rule, last_true, spread
from hil.expect.rules._views import RESTARTS, DriveView

_STATUS: Final[Mapping[str, tuple[int, int]]] = {
    "switch_on_disabled": (0x4F, 0x40),
    "ready_to_switch_on": (0x6F, 0x21),
    "switched_on": (0x6F, 0x23),
    "operation_enabled": (0x6F, 0x27),
    "quick_stop_active": (0x6F, 0x07),
    "fault_reaction_active": (0x4F, 0x0F),
    "fault": (0x4F, 0x08),
}
"""Mask and value of 6041h in each state (C402-039)."""
_SHOWN_BY_FAULTS: Final = (
    "drive.statusword_stuck",
    "drive.statusword_bits",
    "drive.boot",
)
_WARNING: Final = 1 << 7
_BOOT_NS: Final = 1_000_000_000
"""Time in which a drive that was restarted may still be starting, ns."""
_VOLTAGE: Final = 1 << 4
_REMOTE: Final = 1 << 9
_LIMITED: Final = 1 << 11


def _warned(drive: DriveView) -> tuple[Flags, Flags]:
    """Return the samples in which the drive has warnings by its events, and those in which they tell: not
    behind a start of the drive until the next one.
    """
    flags, known = np.zeros(len(drive.time_s), dtype=bool), np.ones(len(drive.time_s), dtype=bool)
    warned, restarted_ns = False, -_BOOT_NS
    for entry in drive.whole.events.of(drive.name, "drive.warning", "nmt.state", "fault.applied"):
        first = drive.index_of(entry.time_ns)
        if entry.kind == "drive.warning":
            warned = bool(entry.data.get("warnings"))
            # What comes while the drive starts is forgotten when it is up.
            flags[first:], known[first:] = warned, entry.time_ns - restarted_ns >= _BOOT_NS
        elif entry.data.get("to") == "INITIALISING" or entry.data.get("fault") in RESTARTS:
            known[first:] = not warned
            restarted_ns = entry.time_ns
    return flags, known


def _is_on(drive: DriveView) -> Flags:
    """Return the samples in which a drive is on and ready."""
    if drive.has("nmt_state"):
        return ~spread(drive["nmt_state"] == 0, 1, 2)
    return np.ones(len(drive.time_s), dtype=bool)


def _state_word(drive: DriveView) -> Judged | None:
    if not drive.has("statusword", "state"):
        return None
    word = drive.word("statusword")
    wrong = np.zeros(len(word), dtype=bool)
    known = np.zeros(len(word), dtype=bool)
    for state, (mask, value) in _STATUS.items():
        inside = drive.in_states(state)
        known |= inside
        wrong |= inside & (word & mask != value)
    return Judged(drive.time_s, known, wrong, lambda at: f"6041h = {word[at]:04X}h in another state")


STATE_WORD: Final = Rule(
    name="state in 6041h",
    says="6041h shows the state in which the drive is",
    requirements=("C402-039",),
    tolerance="none",
    judge=_state_word,
    excused_by=_SHOWN_BY_FAULTS,
    recovery_cycles=3,
    live=True,
)


def _warning_bit(drive: DriveView) -> Judged | None:
    if drive.has("statusword", "state"):
        word, judged = drive.word("statusword"), ~drive.in_states("not_ready_to_switch_on")
    elif drive.has("drive_zsw1", "warning_number"):
        word = drive.word("drive_zsw1")
        judged = word != 0
    else:
        return None
    warned, known = _warned(drive)
    shown = word & _WARNING != 0
    judged &= (
        known
        & _is_on(drive)
        & ~drive.near(drive.whole.events.of(drive.name, "drive.warning", "drive.state"), 1, 1)
    )
    return Judged(
        drive.time_s,
        judged,
        judged & (shown != warned),
        lambda at: (
            "bit 7 is set without a warning" if shown[at] else "bit 7 is not set, and a warning is active"
        ),
    )


WARNING_BIT: Final = Rule(
    name="warning bit",
    says="bit 7 of the status word is set while a warning is active, and falls with it",
    requirements=("C402-041", "PD-067", "PD-138"),
    tolerance="a sample",
    judge=_warning_bit,
    excused_by=(*_SHOWN_BY_FAULTS, "drive.warning"),
    recovery_cycles=3,
)


def _remote_bit(drive: DriveView) -> Judged | None:
    if not drive.has("statusword", "state", "nmt_state"):
        return None
    word = drive.word("statusword")
    judged = ~drive.in_states("not_ready_to_switch_on") & _is_on(drive)
    return Judged(
        drive.time_s,
        judged,
        judged & (word & _REMOTE == 0),
        lambda _at: "bit 9 is 0, and nobody has taken control",
    )


REMOTE_BIT: Final = Rule(
    name="remote bit",
    says="bit 9 of 6041h is 1 while the control word is processed",
    requirements=("C402-043",),
    tolerance="none",
    judge=_remote_bit,
    excused_by=(*_SHOWN_BY_FAULTS, "drive.local_control"),
    recovery_cycles=3,
    live=True,
)

_SUPPLY: Final = (
    "drive.mains_off",
    "drive.brown_out",
    "drive.phase_loss",
    "drive.dc_link",
    "drive.chopper_failure",
)


def _voltage_bit(drive: DriveView) -> Judged | None:
    if not drive.has("statusword", "state") or drive.number("standard") != 1.0:
        return None
    word = drive.word("statusword")
    judged = drive.in_states("ready_to_switch_on", "switched_on", "operation_enabled") & _is_on(drive)
    return Judged(
        drive.time_s, judged, judged & (word & _VOLTAGE == 0), lambda _at: "bit 4 is 0, and the supply is on"
    )


VOLTAGE_BIT: Final = Rule(
    name="voltage bit",
    says="bit 4 of 6041h is 1 while the power stage has its supply",
    requirements=("C402-040",),
    tolerance="none",
    judge=_voltage_bit,
    excused_by=(*_SHOWN_BY_FAULTS, *_SUPPLY),
    recovery_s=1.0,
)

_CSV: Final = 9


def _follows_bit(drive: DriveView) -> Judged | None:
    if not drive.has("statusword", "state", "mode", "controlword"):
        return None
    if drive.number("standard") != 1.0:
        return None
    word = drive.word("statusword")
    led = drive.in_states("operation_enabled") & (drive.word("mode") == _CSV)
    led &= drive.word("controlword") & 0x010F == 0x000F
    led = last_true(led, 2)
    opening_s = drive.number("brake_opening_s") or 0.0
    if opening_s:
        led = last_true(led, int(np.ceil(opening_s / drive.whole.cycle_s)) + 2)
    led &= word & _LIMITED == 0
    follows = word & 1 << 12 != 0
    idle = drive.in_states(
        "switch_on_disabled", "ready_to_switch_on", "switched_on", "fault", "fault_reaction_active"
    )
    extra = idle & (word & (1 << 10 | 1 << 12 | 1 << 13) != 0)
    reserved = (led | idle) & (word & (1 << 8 | 1 << 14 | 1 << 15) != 0)
    broken = (led & ~follows) | extra | reserved
    return Judged(
        drive.time_s,
        led | idle,
        broken,
        lambda at: f"6041h = {word[at]:04X}h with controlword {drive.word('controlword')[at]:04X}h",
    )


FOLLOWS_BIT: Final = Rule(
    name="bits of the mode in 6041h",
    says="in csv bit 12 is set while the drive follows; without operation bits 8, 10, 12 to 15 are 0",
    requirements=("C402-042", "C402-046", "C402-048", "C402-102"),
    tolerance="two cycles, and the opening time of the brake",
    judge=_follows_bit,
    excused_by=(
        *_SHOWN_BY_FAULTS,
        "drive.target_toggle",
        "drive.local_control",
        "drive.brake",
        "can.",
        "frame.",
    ),
    recovery_cycles=5,
)


_PATTERNS: Final[Mapping[str, tuple[int, int]]] = {
    "s1": (0x47, 0x40),
    "s2": (0x47, 0x01),
    "s3": (0x47, 0x03),
    "s4": (0x47, 0x07),
    "s5": (0x43, 0x03),
}


def _in_state_of_profile(drive: DriveView, begin: str) -> Flags:
    signal = drive.whole.trace[f"{drive.name}.state"]
    codes = [code for code, text in signal.enum.items() if text.lower().startswith(begin)]
    return where_code(np.rint(signal.values), codes)


def _zsw1_state(drive: DriveView) -> Judged | None:
    if not drive.has("drive_zsw1", "drive_stw1", "drive_zsw2", "state", "fault_number"):
        return None
    word, stw1, zsw2 = drive.word("drive_zsw1"), drive.word("drive_stw1"), drive.word("drive_zsw2")
    wrong = np.zeros(len(word), dtype=bool)
    judged = word != 0
    for begin, (mask, value) in _PATTERNS.items():
        wrong |= _in_state_of_profile(drive, begin) & (word & mask != value)
    fault = drive["fault_number"] != 0
    changes = drive.near(drive.whole.events.of(drive.name, "drive.fault", "drive.fault_acknowledged"), 1, 1)
    wrong |= ~changes & ((word & 1 << 3 != 0) != fault)
    wrong |= word & 1 << 9 == 0
    # OFF2 and OFF3 that are commanded show as active.
    wrong |= (stw1 & 1 << 1 == 0) & (word & 1 << 4 != 0)
    wrong |= (stw1 & 1 << 2 == 0) & (word & 1 << 5 != 0)
    wrong |= _in_state_of_profile(drive, "s4") & (word & 1 << 4 == 0)
    pulses = zsw2 & 1 << 10 != 0
    off = _in_state_of_profile(drive, "s1") | _in_state_of_profile(drive, "s2")
    wrong |= off & pulses
    return Judged(
        drive.time_s,
        judged,
        judged & wrong,
        lambda at: (
            f"ZSW1 = {word[at]:04X}h, ZSW2 = {zsw2[at]:04X}h with STW1 = {stw1[at]:04X}h, "
            f"fault {drive['fault_number'][at]:.0f}"
        ),
    )


ZSW1_STATE: Final = Rule(
    name="ZSW1 and ZSW2",
    says="ZSW1 shows state, fault, OFF2 and OFF3 as they are, and ZSW2.10 the pulses",
    requirements=("PD-060", "PD-061", "PD-062", "PD-063", "PD-064", "PD-065", "PD-066", "PD-069", "PD-083"),
    tolerance="a sample around a fault",
    judge=_zsw1_state,
    excused_by=(*_SHOWN_BY_FAULTS, "telegram."),
    recovery_cycles=3,
)


def _zsw1_direction(drive: DriveView) -> Judged | None:
    if not drive.has("drive_zsw1", "motor_speed", "brake_closed", "warning_number"):
        return None
    if (drive.number("telegram") or 0) in (0, 7, 9, 110, 111):
        return None
    word, speed = drive.word("drive_zsw1"), drive["motor_speed"]
    turning = (np.abs(speed) > 20.0) & (word != 0)
    turning[1:] &= np.sign(speed[1:]) == np.sign(speed[:-1])
    broken = turning & ((word & 1 << 14 != 0) != (speed > 0.0))
    return Judged(
        drive.time_s,
        turning,
        broken,
        lambda at: f"ZSW1.14 = {int(word[at]) >> 14 & 1} at {speed[at]:.4g} rpm",
    )


ZSW1_DIRECTION: Final = Rule(
    name="direction in ZSW1",
    says="ZSW1.14 is 1 while the motor turns in positive direction",
    requirements=("PD-074",),
    tolerance="20 rpm, and the sample of a reversal",
    judge=_zsw1_direction,
    excused_by=(*_SHOWN_BY_FAULTS, "encoder.", "mechanics."),
    recovery_s=0.2,
)


def _zsw1_brake(drive: DriveView) -> Judged | None:
    if not drive.has("drive_zsw1", "brake_closed") or not drive.number("brake_torque_nm"):
        return None
    if (drive.number("telegram") or 0) in (0, 7, 9, 110, 111):
        return None
    word, closed = drive.word("drive_zsw1"), drive["brake_closed"] != 0
    changes = spread(np.concatenate(([False], closed[1:] != closed[:-1])), 2, 2)
    judged = (word != 0) & ~changes
    shown = word & 1 << 12 != 0
    opening = spread(np.concatenate(([False], shown[1:] != shown[:-1])), 2, _cycles(drive))
    judged &= ~opening
    return Judged(
        drive.time_s,
        judged,
        judged & (shown == closed),
        lambda at: f"ZSW1.12 = {int(shown[at])} with the brake {'closed' if closed[at] else 'open'}",
    )


def _cycles(drive: DriveView) -> int:
    longest = max(drive.number("brake_opening_s") or 0.0, drive.number("brake_closing_s") or 0.0)
    return int(np.ceil(longest / drive.whole.cycle_s)) + 2


ZSW1_BRAKE: Final = Rule(
    name="brake in ZSW1",
    says="ZSW1.12 says whether the holding brake is open",
    requirements=("PD-072",),
    tolerance="the opening and closing time",
    judge=_zsw1_brake,
    excused_by=(*_SHOWN_BY_FAULTS, "drive.brake_stuck", "drive.brake_slip", "safety."),
    recovery_s=0.5,
)


def _register_bits(code: int) -> int:
    """Return the bits of 1001h that go with an error code: always the generic one."""
    high = code >> 8
    if 0x20 <= high <= 0x2F:
        return 0x03
    if 0x30 <= high <= 0x3F:
        return 0x05
    if 0x40 <= high <= 0x4F:
        return 0x09
    if high in (0x81, 0x82):
        return 0x11
    if 0xF0 <= high <= 0xFF:
        return 0x81
    return 0x21 if 0x70 <= high <= 0x7F or 0x84 <= high <= 0x8F else 0x01


def _emcy_register(drive: DriveView) -> Judged | None:
    if drive.number("cia402") is None or drive.number("standard") != 1.0:
        return None
    active: dict[int, int] = {}
    found = []
    events = drive.whole.events.of(drive.name, "emcy.raised", "emcy.cleared", "nmt.state")
    for entry in sorted(events, key=lambda one: one.time_ns):
        if entry.kind == "nmt.state":
            if entry.data.get("to") == "PRE_OPERATIONAL" and entry.data.get("from") == "INITIALISING":
                active.clear()
            continue
        code, register = int(entry.data.get("code") or 0), int(entry.data.get("register") or 0)
        if entry.kind == "emcy.raised":
            active[code] = _register_bits(code)
        else:
            active.pop(code, None)
        expected = 0
        for bits in active.values():
            expected |= bits
        text = ""
        if register != expected:
            text = f"1001h = {register:02X}h with {code:04X}h, {expected:02X}h by the active errors"
        found.append((entry.time_ns * 1e-9, text))
    return Judged.of_list(found) if found else None


EMCY_REGISTER: Final = Rule(
    name="error register",
    says="1001h has the bits of all active errors, and is 0 without one",
    requirements=("C301-112",),
    tolerance="none",
    judge=_emcy_register,
    excused_by=("drive.emcy_storm",),
    recovery_s=1e9,
    live=True,
)


def _emcy_frames(drive: DriveView) -> Judged | None:
    if drive.node is None:
        return None
    bus, node = drive.node
    frames = drive.whole.frames.of(bus, 0x80 + node)
    events = drive.whole.events
    emitted = sorted(events.of(drive.name, "emcy.raised", "emcy.cleared"), key=lambda one: one.time_ns)
    if not emitted and not len(frames.lengths):
        return None
    found = []
    sent = [
        (when, int.from_bytes(data[:2], "little"), data[2]) for when, data in frames.each() if len(data) == 8
    ]
    taken = 0
    for when, code, register in sent:
        text = f"EMCY {code:04X}h with 1001h = {register:02X}h, which the node has not raised"
        for at in range(taken, len(emitted)):
            entry = emitted[at]
            own = int(entry.data.get("code") or 0) if entry.kind == "emcy.raised" else 0
            if entry.time_ns * 1e-9 <= when + 1e-9 and own == code and entry.data.get("register") == register:
                text, taken = "", at + 1
                break
        found.append((when, text))
    return Judged.of_list(found) if found else None


EMCY_FRAMES: Final = Rule(
    name="EMCY",
    says="every EMCY on the bus is an error that the node has raised or taken back, with its register",
    requirements=("C301-108", "C301-109"),
    tolerance="none",
    judge=_emcy_frames,
    excused_by=("drive.emcy_storm", "frame.", "can."),
    recovery_s=1.0,
)


def _acknowledged(drive: DriveView) -> Judged | None:
    # Drives of some personalities reset their faults themselves.
    if not drive.has("controlword", "statusword", "state") or drive.number("standard") == 0.0:
        return None
    bit = drive.word("controlword") & 1 << 7 != 0
    edge = np.zeros(len(bit), dtype=bool)
    edge[1:] = bit[1:] & ~bit[:-1]
    near = spread(edge, 2, 2)
    found = []
    for entry in drive.whole.events.of(drive.name, "drive.state"):
        states = str(entry.data.get("from", "")).lower(), str(entry.data.get("to", "")).lower()
        at = drive.index_of(entry.time_ns)
        if states != ("fault", "switch on disabled") or not 2 <= at < len(bit) - 2:
            continue
        text = "" if near[at] else "the fault is reset without an edge of bit 7 of the controlword"
        found.append((entry.time_ns * 1e-9, text))
    return Judged.of_list(found) if found else None


ACKNOWLEDGED: Final = Rule(
    name="reset of faults",
    says="a CiA 402 drive leaves Fault by a rising edge of bit 7 of its controlword alone",
    requirements=("C402-015", "C402-016"),
    tolerance="two samples",
    judge=_acknowledged,
    excused_by=("can.", "frame.", "drive.boot", "drive.sync", "controller."),
    recovery_cycles=5,
)


def _error_code(drive: DriveView) -> Judged | None:
    if not drive.has("error_code", "state"):
        return None
    code = drive.word("error_code")
    events = drive.whole.events.of(drive.name, "emcy.raised", "drive.fault")
    first = drive.index_of(events[0].time_ns) if events else len(code)
    before = np.arange(len(code)) < first - 1
    inside = last_true(drive.in_states("fault"), 2)
    broken = (before & (code != 0)) | (inside & (code == 0))
    return Judged(
        drive.time_s,
        before | inside,
        broken,
        lambda at: f"603Fh = {code[at]:04X}h {'in the state Fault' if inside[at] else 'before any error'}",
    )


ERROR_CODE: Final = Rule(
    name="error code",
    says="603Fh is 0 as long as there was no error, and names one in the state Fault",
    requirements=("C402-014", "C402-176"),
    tolerance="two samples",
    judge=_error_code,
    excused_by=("drive.boot",),
    recovery_cycles=3,
)

DRIVE_RULES: Final[tuple[Rule[DriveView], ...]] = (
    STATE_WORD,
    WARNING_BIT,
    REMOTE_BIT,
    VOLTAGE_BIT,
    FOLLOWS_BIT,
    ZSW1_STATE,
    ZSW1_DIRECTION,
    ZSW1_BRAKE,
    EMCY_REGISTER,
    EMCY_FRAMES,
    ACKNOWLEDGED,
    ERROR_CODE,
)
