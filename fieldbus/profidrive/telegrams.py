"""Telegrams as data: which signal is in which word (PD-001 to PD-032, CFG-193
to CFG-247, PTO-023 to PTO-036).

All words are big-endian; a double word has its high word first. *Setpoint* is the direction from the
controller to the drive, *actual* the way back.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from struct import Struct
from typing import Final, Literal

from fieldbus.profidrive.errors import TelegramError
from fieldbus.profidrive.words import describe_word

Kind = Literal["word", "n2", "int32", "n4", "int64"]

_CODES: Final[dict[Kind, tuple[str, int]]] = {
    "word": ("H", 1), "n2": ("h", 1), "int32": ("i", 2), "n4": ("i", 2), "int64": ("q", 4),
}  # fmt: skip
_RANGES: Final[dict[Kind, tuple[int, int]]] = {
    "word": (0, 0xFFFF), "n2": (-0x8000, 0x7FFF), "int32": (-(1 << 31), (1 << 31) - 1),
    "n4": (-(1 << 31), (1 << 31) - 1), "int64": (-(1 << 63), (1 << 63) - 1),
}  # fmt: skip

SIGNALS: Final[dict[str, Kind]] = {
    **dict.fromkeys(
        (
            "STW1",
            "ZSW1",
            "STW2",
            "ZSW2",
            "STW2_ENC",
            "ZSW2_ENC",
            "G1_STW",
            "G1_ZSW",
            "G2_STW",
            "G2_ZSW",
            "MELDW",
            "SATZANW",
            "AKTSATZ",
            "POS_STW",
            "POS_ZSW",
            "POS_STW1",
            "POS_STW2",
            "POS_ZSW1",
            "POS_ZSW2",
            "POS_ZSW3",
            "MDI_MOD",
            "FAULT_CODE",
            "WARN_CODE",
            "CU_STW1",
            "CU_ZSW1",
            "A_DIGITAL",
            "A_DIGITAL_1",
            "E_DIGITAL",
            "E_DIGITAL_1",
            "MT_STW",
            "MT_ZSW",
            "MT_DIAG",
            "MELD_NAMUR",
            "S_STW1B",
            "S_STW3B",
            "S_ZSW1B",
            "S_ZSW2B",
            "S_ZSW3B",
            "FREE",
            *(f"MT_ZSB{number}" for number in range(1, 5)),
            *(f"MT_ZS_{number}" for number in range(1, 17)),
            *(f"MT{number}_ZS_{edge}" for number in range(1, 9) for edge in "FS"),
        ),
        "word",
    ),
    **dict.fromkeys(
        (
            "NSOLL_A",
            "NIST_A",
            "NIST_A_GLATT",
            "IAIST_GLATT",
            "MIST_GLATT",
            "PIST_GLATT",
            "MOMRED",
            "OVERRIDE",
            "MDI_ACC",
            "MDI_DEC",
            "M_ADD1",
            "M_LIMIT_POS",
            "M_LIMIT_NEG",
            "M_ACT",
            "E_ANALOG",
        ),
        "n2",
    ),
    **dict.fromkeys(("NSOLL_B", "NIST_B", "S_V_LIMIT_B"), "n4"),
    **dict.fromkeys(
        (
            "G1_XIST1",
            "G1_XIST2",
            "G2_XIST1",
            "G2_XIST2",
            "XERR",
            "KPC",
            "MDI_TARPOS",
            "MDI_VELOCITY",
            "XIST_A",
            "VIST_A",
            "MDI_ACC_32",
            "MDI_DEC_32",
            "REF_COORDINATE",
            "RESERVED_32",
        ),
        "int32",
    ),
    "G1_XIST3": "int64",
}
"""Kind of every signal: `word` bits or unsigned, `n2`, `n4` normalised, `int32`, `int64` signed."""


class Layout:
    """One direction of a telegram.

    Args:
        signals: Signal names in their order; each may stand once, `FREE` any number of times.

    Raises:
        TelegramError: A signal is unknown or stands twice.

    """

    def __init__(self, signals: Sequence[str]) -> None:
        for name in signals:
            if name not in SIGNALS:
                raise TelegramError(f"there is no signal {name!r}; signals are: {', '.join(sorted(SIGNALS))}")
            if name != "FREE" and list(signals).count(name) > 1:
                raise TelegramError(f"signal {name} stands twice in {', '.join(signals)}")
        self.names: Final = tuple(signals)
        """Signal names in their order."""
        self._struct = Struct(">" + "".join(_CODES[SIGNALS[name]][0] for name in signals))
        self.length: Final = self._struct.size
        """Bytes."""
        self.words: Final = self._struct.size // 2
        """16-bit words."""
        self._supply: Final = {name: 0 for name in signals if name != "FREE"}
        self.pack: Final[Callable[..., bytes]] = self._struct.pack
        """Returns the frame for all values in the order of `names`; the quick way for the cycle.

        Raises:
            struct.error: A value is out of the range of its signal, or not all are given.

        """
        self.unpack: Final[Callable[[bytes], tuple[int, ...]]] = self._struct.unpack
        """Returns all values in the order of `names`.

        Raises:
            struct.error: The frame has another length.

        """

    def encode(self, values: Mapping[str, int]) -> bytes:
        """Return the frame for values by name; a signal that is not given is 0.

        Words may be given as signed or unsigned numbers.

        Raises:
            TelegramError: A name does not belong to the telegram, or a value is out of its range.

        """
        row = dict(self._supply)
        for name, value in values.items():
            if name not in row:
                raise TelegramError(f"{name} is not in this telegram; it has: {', '.join(row)}")
            low, high = _RANGES[SIGNALS[name]]
            if SIGNALS[name] == "word" and -0x8000 <= value < 0:
                value += 0x10000  # noqa: PLW2901
            if not low <= value <= high:
                raise TelegramError(f"{name}: {value} is outside {low}..{high}")
            row[name] = value
        return self._struct.pack(*(row[name] if name != "FREE" else 0 for name in self.names))

    def decode(self, data: bytes) -> dict[str, int]:
        """Return the values by name.

        Raises:
            TelegramError: The frame has another length (PD-030).

        """
        if len(data) != self.length:
            raise TelegramError(f"{len(data)} bytes are not the {self.length} of {', '.join(self.names)}")
        return {
            name: value
            for name, value in zip(self.names, self._struct.unpack(data), strict=True)
            if name != "FREE"
        }

    def offset(self, name: str) -> int:
        """Return the first byte of a signal.

        Raises:
            TelegramError: The telegram has no such signal.

        """
        at = 0
        for one in self.names:
            if one == name:
                return at
            at += 2 * _CODES[SIGNALS[one]][1]
        raise TelegramError(f"{name} is not in this telegram; it has: {', '.join(self.names)}")

    def places(self, *, low_word_first: bool) -> tuple[int, ...]:
        """Return for each word where it stands on a link: where it is, or with
        the low word of a signal first.
        """
        found: list[int] = []
        for name in self.names:
            size = _CODES[SIGNALS[name]][1]
            own = range(len(found), len(found) + size)
            found += reversed(own) if low_word_first else own
        return tuple(found)

    def describe(self, data: bytes) -> str:
        """Return a frame in words for a trace; one of a wrong length in hexadecimal, with the mistake."""
        if len(data) != self.length:
            return f"{data.hex(' ').upper()} ({len(data)} bytes in place of {self.length})"
        return ", ".join(f"{name} {describe_value(name, value)}" for name, value in self.decode(data).items())

    def __add__(self, other: Layout) -> Layout:
        """Return this layout with another one behind it, as a supplementary telegram is appended."""
        return Layout((*self.names, *other.names))

    def __repr__(self) -> str:
        return f"Layout({', '.join(self.names)})"


def describe_value(name: str, value: int) -> str:
    """Return the value of a signal for a person: bits by name, normalised values in percent."""
    kind = SIGNALS[name]
    if kind == "word":
        return describe_word(name, value)
    if kind == "n2":
        return f"{value / 0x4000 * 100.0:.2f} %"
    if kind == "n4":
        return f"{value / 0x4000_0000 * 100.0:.4f} %"
    return str(value)


def swap_words(data: bytes) -> bytes:
    """Return words with their bytes the other way round: CANopen has the low byte of a word first, a telegram
    the high one (PD-343).

    Raises:
        ValueError: It is no whole number of words.

    """
    words = array("H", data)
    words.byteswap()
    return words.tobytes()


class Telegram:
    """A telegram: its number and both directions."""

    def __init__(self, number: int, setpoint: Layout, actual: Layout) -> None:
        self.number: Final = number
        self.setpoint: Final = setpoint
        """From the controller to the drive."""
        self.actual: Final = actual
        """From the drive to the controller."""

    @property
    def encoders(self) -> int:
        """Number of encoders whose values it carries."""
        return sum(f"G{number}_STW" in self.setpoint.names for number in (1, 2))

    @property
    def dsc(self) -> bool:
        """Whether it carries the signals of dynamic servo control."""
        return "XERR" in self.setpoint.names

    @property
    def isochronous(self) -> bool:
        """Whether it has a sign of life, which isochronous operation needs (CFG-243)."""
        return any(name in self.setpoint.names for name in ("STW2", "STW2_ENC", "CU_STW1"))

    def with_supplement(self, number: int = 750) -> Telegram:
        """Return this telegram with a supplementary one behind it (CFG-214).

        Raises:
            TelegramError: The supplement is none, or this telegram does not take it.

        """
        if number not in _SUPPLEMENTED or self.number not in _SUPPLEMENTED[number]:
            rules = "; ".join(
                f"{one} supplements {', '.join(map(str, sorted(of)))}" for one, of in _SUPPLEMENTED.items()
            )
            raise TelegramError(f"telegram {number} does not supplement telegram {self.number}; {rules}")
        other = telegram(number)
        return Telegram(self.number, self.setpoint + other.setpoint, self.actual + other.actual)

    def __repr__(self) -> str:
        return f"Telegram({self.number})"


WITH_750: Final = frozenset({1, 2, 3, 4, 5, 6, 102, 103, 105, 106})
"""Telegrams that 750 may supplement (CFG-214)."""
SAFETY_TELEGRAMS: Final = (700, 701)
"""Supplements with the safety information channel (PD-028)."""
_WITH_SAFETY: Final = WITH_750 | {7, 9, 20, 110, 111, 112, 999}
_SUPPLEMENTED: Final = {750: WITH_750, 700: _WITH_SAFETY, 701: _WITH_SAFETY}

_ENCODER_1: Final = "G1_ZSW G1_XIST1 G1_XIST2"
_ENCODER_2: Final = "G2_ZSW G2_XIST1 G2_XIST2"
_SPEED: Final = "STW1 NSOLL_B STW2"
_SPEED_BACK: Final = "ZSW1 NIST_B ZSW2"
_REDUCED: Final = f"{_SPEED} MOMRED"
_REDUCED_BACK: Final = f"{_SPEED_BACK} MELDW"
_PROBES: Final = {
    count: " ".join(f"MT{n}_ZS_F MT{n}_ZS_S" for n in range(1, count + 1)) for count in (2, 6, 8)
}

_TABLE: Final[dict[int, tuple[str, str]]] = {
    1: ("STW1 NSOLL_A", "ZSW1 NIST_A"),
    2: (_SPEED, _SPEED_BACK),
    3: (f"{_SPEED} G1_STW", f"{_SPEED_BACK} {_ENCODER_1}"),
    4: (f"{_SPEED} G1_STW G2_STW", f"{_SPEED_BACK} {_ENCODER_1} {_ENCODER_2}"),
    5: (f"{_SPEED} G1_STW XERR KPC", f"{_SPEED_BACK} {_ENCODER_1}"),
    6: (f"{_SPEED} G1_STW G2_STW XERR KPC", f"{_SPEED_BACK} {_ENCODER_1} {_ENCODER_2}"),
    7: ("STW1 SATZANW", "ZSW1 AKTSATZ"),
    9: ("STW1 SATZANW STW2 MDI_TARPOS MDI_VELOCITY MDI_ACC MDI_DEC MDI_MOD", "ZSW1 AKTSATZ ZSW2 XIST_A"),
    20: ("STW1 NSOLL_A", "ZSW1 NIST_A_GLATT IAIST_GLATT MIST_GLATT PIST_GLATT MELD_NAMUR"),
    81: ("STW2_ENC G1_STW", f"ZSW2_ENC {_ENCODER_1}"),
    82: ("STW2_ENC G1_STW", f"ZSW2_ENC {_ENCODER_1} NIST_A"),
    83: ("STW2_ENC G1_STW", f"ZSW2_ENC {_ENCODER_1} NIST_B"),
    84: ("STW2_ENC G1_STW", "ZSW2_ENC G1_ZSW G1_XIST3 G1_XIST2 NIST_B"),
    102: (f"{_REDUCED} G1_STW", f"{_REDUCED_BACK} {_ENCODER_1}"),
    103: (f"{_REDUCED} G1_STW G2_STW", f"{_REDUCED_BACK} {_ENCODER_1} {_ENCODER_2}"),
    105: (f"{_REDUCED} G1_STW XERR KPC", f"{_REDUCED_BACK} {_ENCODER_1}"),
    106: (f"{_REDUCED} G1_STW G2_STW XERR KPC", f"{_REDUCED_BACK} {_ENCODER_1} {_ENCODER_2}"),
    110: (
        "STW1 SATZANW POS_STW STW2 OVERRIDE MDI_TARPOS MDI_VELOCITY MDI_ACC MDI_DEC MDI_MOD",
        "ZSW1 AKTSATZ POS_ZSW ZSW2 MELDW XIST_A",
    ),
    111: (
        "STW1 POS_STW1 POS_STW2 STW2 OVERRIDE MDI_TARPOS MDI_VELOCITY MDI_ACC MDI_DEC FREE",
        "ZSW1 POS_ZSW1 POS_ZSW2 ZSW2 MELDW XIST_A NIST_B FAULT_CODE WARN_CODE FREE",
    ),
    112: (
        (
            "STW1 POS_STW1 POS_STW2 STW2 OVERRIDE MDI_TARPOS MDI_VELOCITY MDI_ACC_32 MDI_DEC_32 RESERVED_32 "
            "REF_COORDINATE"
        ),
        "ZSW1 POS_ZSW1 POS_ZSW2 ZSW2 POS_ZSW3 XIST_A VIST_A MELDW FAULT_CODE WARN_CODE",
    ),
    390: ("CU_STW1 A_DIGITAL", "CU_ZSW1 E_DIGITAL"),
    391: ("CU_STW1 A_DIGITAL MT_STW", f"CU_ZSW1 E_DIGITAL MT_ZSW {_PROBES[2]}"),
    392: ("CU_STW1 A_DIGITAL MT_STW", f"CU_ZSW1 E_DIGITAL MT_ZSW {_PROBES[6]}"),
    393: (
        "CU_STW1 A_DIGITAL MT_STW A_DIGITAL_1",
        f"CU_ZSW1 E_DIGITAL MT_ZSW {_PROBES[8]} E_DIGITAL_1 E_ANALOG",
    ),
    394: ("CU_STW1 A_DIGITAL A_DIGITAL_1", "CU_ZSW1 E_DIGITAL E_DIGITAL_1"),
    395: (
        "CU_STW1 A_DIGITAL MT_STW A_DIGITAL_1",
        "CU_ZSW1 E_DIGITAL E_DIGITAL_1 MT_ZSW MT_DIAG MT_ZSB1 MT_ZSB2 MT_ZSB3 MT_ZSB4 "
        + " ".join(f"MT_ZS_{number}" for number in range(1, 17)),
    ),
    700: ("", "S_ZSW1B S_V_LIMIT_B"),
    701: ("S_STW1B S_STW3B", "S_ZSW1B S_ZSW2B S_V_LIMIT_B S_ZSW3B"),
    750: ("M_ADD1 M_LIMIT_POS M_LIMIT_NEG", "M_ACT"),
}

NUMBERS: Final = tuple(_TABLE)
"""Numbers of all telegrams with a fixed layout."""
FREE_CONFIGURATION: Final = 999
"""Number of a telegram whose layout the user gives (PD-029)."""


@cache
def telegram(number: int) -> Telegram:
    """Return a telegram by its number.

    Raises:
        TelegramError: There is no such telegram with a fixed layout.

    """
    rows = _TABLE.get(number)
    if rows is None:
        raise TelegramError(f"there is no telegram {number}; there are: {', '.join(map(str, NUMBERS))}")
    return Telegram(number, Layout(rows[0].split()), Layout(rows[1].split()))


def free_telegram(setpoint: Sequence[str], actual: Sequence[str]) -> Telegram:
    """Return a telegram of free configuration (PD-029).

    Raises:
        TelegramError: A signal is unknown or doubled, or the first words are not STW1 and ZSW1.

    """
    if list(setpoint[:1]) != ["STW1"] or list(actual[:1]) != ["ZSW1"]:
        raise TelegramError("a free telegram begins with STW1 and ZSW1")
    return Telegram(FREE_CONFIGURATION, Layout(setpoint), Layout(actual))


def pto_telegram() -> Telegram:
    """Return telegram 3 as the TM PTO understands it: 16-bit speeds and the encoder's second words (PTO-023
    to PTO-029).
    """
    return Telegram(
        3,
        Layout(["STW1", "NSOLL_A", "STW2_ENC", "G1_STW"]),
        Layout(f"ZSW1 NIST_A ZSW2_ENC {_ENCODER_1}".split()),
    )
