"""Signals of PROFIdrive telegrams as text: hexadecimal with the meaning of the bits, normalised values in
percent and in their unit.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from fieldbus.profidrive.telegrams import SIGNALS
from fieldbus.profidrive.words import describe_word

if TYPE_CHECKING:
    from fieldbus.profidrive import Layout
    from hil.bench.drive_config import ProfidriveCanTable, ProfidriveModbusTable

_WORDS: Final = {"word": 1, "n2": 1, "int32": 2, "n4": 2, "int64": 4}
_ONE: Final = {"n2": 0x4000, "n4": 0x4000_0000}
_SPEEDS: Final = frozenset({"NSOLL_A", "NSOLL_B", "NIST_A", "NIST_B", "NIST_A_GLATT"})
_TORQUES: Final = frozenset({"M_ADD1", "M_LIMIT_POS", "M_LIMIT_NEG", "M_ACT", "MIST_GLATT"})
_STATES: Final = {
    0x40: "S1 switching on inhibited", 0x01: "S2 ready for switching on", 0x07: "S4 operation",
}  # fmt: skip
_OFFS: Final = ((0x0002, "OFF2"), (0x0004, "OFF3"), (0x0001, "OFF1"), (0x0008, "operation disabled"))
_RAMP: Final = ((0x0010, "ramp generator off"), (0x0020, "ramp generator held"), (0x0040, "no setpoint"))
_EXTRAS: Final = ((0x0080, "acknowledge"), (0x0100, "jog 1"), (0x0200, "jog 2"))


def command(stw1: int) -> str:
    """Return what a control word in speed mode asks for: `operate`, `OFF1`, `OFF2`,
    ... (PD-045 to PD-054, PD-114).
    """
    if not stw1 & 0x0400:
        return "no control by PLC"
    first = next((text for bit, text in _OFFS if not stw1 & bit), "")
    parts = [first] if first else [text for bit, text in _RAMP if not stw1 & bit] or ["operate"]
    return ", ".join([*parts, *(text for bit, text in _EXTRAS if stw1 & bit)])


def state(zsw1: int) -> str:
    """Return the state that a status word in speed mode shows, with fault, warning
    and control (PD-060 to PD-069).
    """
    bits = zsw1 & 0x47
    if bits == 0x03:
        text = "S3 switched on or S5 ramp stop" if zsw1 & 0x20 else "S5 quick stop"
    else:
        text = _STATES.get(bits, "no state")
    extras = [word for bit, word in ((0x0008, "fault"), (0x0080, "warning")) if zsw1 & bit]
    return ", ".join([text, *extras, *([] if zsw1 & 0x0200 else ["no control requested"])])


class SignalTexts:
    """Describes the process data words of one direction of a telegram.

    Args:
        layout: Which signal stands where.
        reference_speed_rpm: 100 % of a speed (p2000).
        reference_torque_nm: 100 % of a torque (p2003).

    """

    def __init__(self, layout: Layout, *, reference_speed_rpm: float, reference_torque_nm: float) -> None:
        self._speed = reference_speed_rpm
        self._torque = reference_torque_nm
        self._place: list[tuple[int, str, int]] = []
        at = 0
        for name in layout.names:
            size = _WORDS[SIGNALS[name]]
            self._place.append((at, name, size))
            at += size

    def describe(self, first: int, words: Sequence[int]) -> list[str]:
        """Return the signals that are in some of the words, the first of them
        being word `first` of the telegram.
        """
        texts = []
        end = first + len(words)
        for at, name, size in self._place:
            low, high = max(at, first), min(at + size, end)
            if low >= high or name == "FREE":
                continue
            number = 0
            for word in words[low - first : high - first]:
                number = number << 16 | word & 0xFFFF
            if high - low == size:
                texts.append(f"{name} = {self._value(name, number, 16 * size)}")
            else:  # the rest is in another frame
                of = ", ".join(str(part - at + 1) for part in range(low, high))
                texts.append(f"{name} word {of} of {size} = {number:0{4 * (high - low)}X}h")
        return texts

    def _value(self, name: str, number: int, bits: int) -> str:
        kind = SIGNALS[name]
        raw = f"{number:0{bits // 4}X}h"
        if name == "STW1":
            return f"{raw} ({command(number)})"
        if name == "ZSW1":
            return f"{raw} ({state(number)})"
        if kind == "word":
            return describe_word(name, number)
        signed = number - (1 << bits) if number >> (bits - 1) else number
        if kind not in _ONE:
            return f"{raw} ({signed})"
        share = signed / _ONE[kind]
        text = f"{100.0 * share:.4g} %"
        if name in _SPEEDS:
            text += f", {share * self._speed:.5g} rpm"
        elif name in _TORQUES:
            text += f", {share * self._torque:.4g} Nm"
        return f"{raw} ({text})"


def signal_words(drive: ProfidriveCanTable | ProfidriveModbusTable, layout: Layout) -> SignalTexts:
    """Return the texts for one direction of the telegram of a drive."""
    return SignalTexts(
        layout,
        reference_speed_rpm=drive.reference_speed_rpm,
        reference_torque_nm=drive.reference_torque_nm,
    )
