"""Faults of PROFIdrive telegrams: a filter between the profile and the bus that carries it.

An axis of the bench has it in its port, on the controller's side, so that one seam serves CAN and Modbus,
emulated and physical drives. In front of somebody else's controller the emulated drive has it. Several
faults of a direction work one after the other, in the order in which they came.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Final

from fieldbus.errors import ConfigurationError
from hil.faults._kind import Action, Family, FaultType, Injection, drive_meant, find_drive
from hil.faults._parameters import Parameter
from hil.faults.kinds import _places as places
from hil.faults.seams import (
    BenchWithAxes,
    BenchWithDrivesOfAxes,
    BenchWithPorts,
    Part,
    TelegramDevice,
    TelegramPort,
    offers,
)

if TYPE_CHECKING:
    from fieldbus.profidrive.telegrams import Layout, Telegram

Filter = Callable[[bytes], bytes | None]
"""Makes another telegram, or none, of a telegram."""

DIRECTIONS: Final = ("actual", "setpoint")
_SIGN_WORDS: Final = {"setpoint": ("STW2", "STW2_ENC", "CU_STW1"), "actual": ("ZSW2", "ZSW2_ENC", "CU_ZSW1")}
_SIGN_VALUES: Final = 15


# -- the port --------------------------------------------------------------------------------------------


def _find_port(injection: Injection) -> TelegramPort:
    """Return the port by which the bench leads the drive; without one the drive itself."""
    port = _port_of_bench(injection)
    if port is None:
        drive = find_drive(injection)
        if not offers(drive, TelegramPort):
            injection.refuse(
                f"{drive.name} is led by no axis of the bench, and is no PROFIdrive drive in this process"
            )
        return drive
    if not offers(port, TelegramPort):
        injection.refuse(f"{port.name} is controlled by no PROFIdrive telegram")
    return port


def _port_of_bench(injection: Injection) -> Part | None:
    """Return the controller's port to the drive that is meant; None: somebody else leads it."""
    bench = injection.bench
    if not offers(bench, BenchWithPorts):
        return None
    axes = bench.axis_names if offers(bench, BenchWithAxes) else ()
    drives = [bench.drive_of(name) for name in axes] if offers(bench, BenchWithDrivesOfAxes) else []
    led = [name for name in drives if offers(bench.port(name), TelegramPort)]
    meant = drive_meant(injection, led or drives)
    try:
        return bench.port(meant)
    except ConfigurationError:
        return None  # no port: `find_drive` says if there is no such drive either


class _FilterChain:
    """The filters of one direction of a port; it is in the port only while there is one."""

    def __init__(self) -> None:
        self.filters: tuple[Filter, ...] = ()

    def __call__(self, frame: bytes) -> bytes | None:
        result: bytes | None = frame
        for one in self.filters:
            if result is None:
                return None
            result = one(result)
        return result


def _seam_of(port: TelegramPort, setpoint: bool) -> Filter | None:
    return port.setpoint_seam if setpoint else port.actual_seam


def _set_seam(port: TelegramPort, setpoint: bool, seam: Filter | None) -> None:
    if setpoint:
        port.setpoint_seam = seam
    else:
        port.actual_seam = seam


def _filter_action(injection: Injection, port: TelegramPort, *, setpoint: bool, work: Filter) -> Action:
    """Return the action that puts a filter into one direction and reports what it changes."""
    hits = 0
    hits_left = injection.count

    def filtered(frame: bytes) -> bytes | None:
        nonlocal hits, hits_left
        if hits_left == 0:
            return frame
        result = work(frame)
        if result == frame:
            return frame
        hits += 1
        injection.report_hit(hits, change="nothing" if result is None else _difference(frame, result))
        if hits_left is not None:
            hits_left -= 1
            if hits_left == 0:
                scheduler = injection.bench.scheduler
                scheduler.at(scheduler.now, injection.ended)
        return result

    def begin() -> None:
        chain = _seam_of(port, setpoint)
        if not isinstance(chain, _FilterChain):
            chain = _FilterChain()
        chain.filters = (*chain.filters, filtered)
        _set_seam(port, setpoint, chain)

    def finish() -> None:
        chain = _seam_of(port, setpoint)
        if isinstance(chain, _FilterChain):
            chain.filters = tuple(one for one in chain.filters if one is not filtered)
            if not chain.filters:
                _set_seam(port, setpoint, None)

    return Action(port.name, begin, finish)


def _difference(before: bytes, after: bytes) -> str:
    """Return what has changed, by words of the telegram, or the length."""
    if len(before) != len(after):
        return f"{len(before) // 2} words become {len(after) // 2}"
    return ", ".join(
        f"PZD{at // 2 + 1} {before[at : at + 2].hex().upper()} becomes {after[at : at + 2].hex().upper()}"
        for at in range(0, len(before), 2)
        if before[at : at + 2] != after[at : at + 2]
    )


# -- signals ---------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class AtSignal:
    """The effect of a kind on one signal, word or bit of a telegram.

    Args:
        change: Returns what becomes of a telegram, as a number, given the fault and the place of the signal.

    """

    change: Callable[[Injection, Telegram, places.Place], places.Change]
    needs: None = None

    def __call__(self, injection: Injection) -> Action:
        """Return the action of one fault."""
        port, values = _find_port(injection), injection.values
        telegram = port.telegram
        place = places.find_place(
            telegram,
            values.text("signal"),
            values.text("direction"),
            f"{injection.kind.name}.parameters.signal",
        )
        change = self.change(injection, telegram, place)
        length = _layout(telegram, setpoint=place.setpoint).length

        def work(frame: bytes) -> bytes:
            if len(frame) != length:
                return frame  # another fault has cut it
            return change(int.from_bytes(frame)).to_bytes(length)

        return _filter_action(injection, port, setpoint=place.setpoint, work=work)


def _layout(telegram: Telegram, *, setpoint: bool) -> Layout:
    return telegram.setpoint if setpoint else telegram.actual


def _stick(injection: Injection, _telegram: Telegram, place: places.Place) -> places.Change:
    held = injection.values.optional_integer("value")
    if held is not None and not -(1 << place.bits) // 2 <= held <= place.mask:
        raise injection.wrong("value", f"a value of {place.bits} bit")
    return places.stuck(place, held)


def _flip(injection: Injection, _telegram: Telegram, place: places.Place) -> places.Change:
    return places.flipped(place, _bits(injection, "mask", place))


def _override(injection: Injection, _telegram: Telegram, place: places.Place) -> places.Change:
    return places.overridden(place, _bits(injection, "set", place), _bits(injection, "clear", place))


def _bits(injection: Injection, name: str, place: places.Place) -> int:
    """Return a mask, checked: it fits the place."""
    mask = injection.values.integer(name)
    if mask > place.mask:
        raise injection.wrong(name, f"bits of {place.name}: 0..{place.mask:X}h")
    return mask


def _swap(injection: Injection, telegram: Telegram, place: places.Place) -> places.Change:
    values = injection.values
    other = places.find_place(
        telegram, values.text("other"), values.text("direction"), f"{injection.kind.name}.parameters.other"
    )
    if other.bits != place.bits or other.setpoint is not place.setpoint:
        raise injection.wrong("other", f"{place.bits} bit in the direction of {place.name}")
    return places.swapped(place, other)


def _displace(injection: Injection, _telegram: Telegram, place: places.Place) -> places.Change:
    normalised, values = places.normalised(place), injection.values
    if values.get("counts" if normalised else "percent"):
        right, other = ("percent", "counts") if normalised else ("counts", "percent")
        raise injection.wrong(other, f"0: {place.name} takes {right}")
    counts = places.percent_of(place, values.number("percent")) if normalised else values.integer("counts")
    return places.displaced(place, counts)


def _scale(injection: Injection, _telegram: Telegram, place: places.Place) -> places.Change:
    return places.scaled(place, injection.values.number("factor"))


# -- whole telegrams -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class AtTelegram:
    """The effect of a kind on whole telegrams of one direction.

    Args:
        make: Returns what becomes of every telegram.
        as_sent: Whether an emulated drive can do it to what it sends itself.

    """

    make: Callable[[Injection, Telegram], Filter]
    as_sent: bool = True
    needs: None = None

    def __call__(self, injection: Injection) -> Action:
        """Return the action of one fault."""
        port = _find_port(injection)
        work = self.make(injection, port.telegram)
        setpoint = injection.values.text("direction") == "setpoint"
        if not (self.as_sent or setpoint) and offers(port, TelegramDevice):
            injection.refuse("what a drive sends is as long as its PDOs, or as the request asks for")
        return _filter_action(injection, port, setpoint=setpoint, work=work)


def _sign_place(injection: Injection, telegram: Telegram) -> places.Place | None:
    """Return where the sign of life is; None in a telegram without."""
    direction = injection.values.text("direction")
    layout = _layout(telegram, setpoint=direction == "setpoint")
    for name in _SIGN_WORDS[direction]:
        if name in layout.names:
            found = places.find_place(telegram, f"{name}.12", direction, injection.kind.name)
            return found._replace(name=f"{name}.12..15", bits=4)
    return None


def _freeze(injection: Injection, telegram: Telegram) -> Filter:
    counts = injection.values.text("sign_of_life") == "counts"
    sign = _sign_place(injection, telegram) if counts else None
    held: bytes | None = None

    def work(frame: bytes) -> bytes:
        nonlocal held
        if held is None:
            held = frame
        if sign is None or len(held) != len(frame):
            return held
        return sign.write(int.from_bytes(held), sign.read(int.from_bytes(frame))).to_bytes(len(frame))

    return work


def _delay(injection: Injection, _telegram: Telegram) -> Filter:
    cycles = injection.values.integer("cycles")
    waiting: deque[bytes] = deque()

    def work(frame: bytes) -> bytes | None:
        waiting.append(frame)
        return waiting.popleft() if len(waiting) > cycles else None

    return work


def _lose(_injection: Injection, _telegram: Telegram) -> Filter:
    return lambda _frame: None


def _change_length(injection: Injection, _telegram: Telegram) -> Filter:
    more = 2 * injection.values.integer("words")
    if not more:
        raise injection.wrong("words", "-32..32, not 0")

    def work(frame: bytes) -> bytes:
        return frame + bytes(more) if more > 0 else frame[: max(0, len(frame) + more)]

    return work


def _disturb_sign_of_life(injection: Injection, telegram: Telegram) -> Filter:
    sign = _sign_place(injection, telegram)
    if sign is None:
        injection.refuse(f"telegram {telegram.number} has no sign of life")
    place, step = sign, injection.values.integer("step")

    def jump(frame: int) -> int:
        value = place.read(frame)
        return place.write(frame, (value - 1 + step) % _SIGN_VALUES + 1) if value else frame

    how = injection.values.text("how")
    change = jump if how == "jump" else places.stuck(place, None if how == "freeze" else 0)
    return lambda frame: change(int.from_bytes(frame)).to_bytes(len(frame))


def _lose_control(injection: Injection, telegram: Telegram) -> Filter:
    setpoint = injection.values.text("direction") == "setpoint"
    name = _layout(telegram, setpoint=setpoint).names[0]
    bit = places.find_place(telegram, f"{name}.{10 if setpoint else 9}", "", injection.kind.name)
    change = places.stuck(bit, 0)
    return lambda frame: change(int.from_bytes(frame)).to_bytes(len(frame))


# -- kinds -----------------------------------------------------------------------------------------------

_REMARK: Final = (
    "needs a PROFIdrive drive that an axis of the bench controls, or an emulated one in front of somebody"
    " else's controller; with an axis, what passes on the bus is true in the direction from the drive, and"
    " disturbed in the direction to it"
)
_SIGNAL: Final = Parameter(
    "signal",
    "text",
    (
        "Name in the telegram, with a bit or without: ZSW1.3, NIST_B, G1_STW; or a word by "
        "its number: PZD2, PZD2.15"
    ),
    required=True,
)
_DIRECTION: Final = Parameter(
    "direction",
    "text",
    "actual: from the drive; setpoint: to it. For words by number; the name of a signal implies it",
    default="actual",
    choices=("actual", "setpoint"),
)
_TELEGRAM_DIRECTION: Final = Parameter(
    "direction",
    "text",
    "actual: from the drive; setpoint: to it",
    default="actual",
    choices=("actual", "setpoint"),
)
_kind: Final = partial(FaultType, seam="telegram words", target="drive", remark=_REMARK, counted=True)

FAMILY: Final = Family(
    kinds=(
        _kind(
            "telegram.stuck",
            "A signal, a word or a bit is stuck at a value",
            AtSignal(_stick),
            parameters=(
                _SIGNAL,
                _DIRECTION,
                Parameter(
                    "value",
                    "int",
                    "Value; not given: the one of the first telegram that is hit",
                    minimum=-(2**31),
                    maximum=0xFFFFFFFF,
                ),
            ),
            example={"target": "drive1", "duration_s": 0.1, "parameters": {"signal": "ZSW1.3", "value": 1}},
            text="""
            A signal, a word or a bit is stuck at a value: that of the first telegram which is hit, if
            none is given.
            """,
        ),
        _kind(
            "telegram.flip",
            "Bits arrive inverted",
            AtSignal(_flip),
            parameters=(
                _SIGNAL,
                _DIRECTION,
                Parameter(
                    "mask",
                    "int",
                    "Bits of the signal that are inverted; 0: all",
                    minimum=0,
                    maximum=0xFFFFFFFF,
                    default=0,
                ),
            ),
            example={"target": "drive1", "duration_s": 0.1, "parameters": {"signal": "STW1.2"}},
            text="""
            Bits arrive inverted: a single one, those of a mask, or all of the signal.
            """,
        ),
        _kind(
            "telegram.bits",
            "Bits of a word are overridden: shown as 1 or as 0, whatever they are",
            AtSignal(_override),
            parameters=(
                _SIGNAL,
                _DIRECTION,
                Parameter("set", "int", "Bits shown as 1", minimum=0, maximum=0xFFFFFFFF, default=0),
                Parameter("clear", "int", "Bits shown as 0", minimum=0, maximum=0xFFFFFFFF, default=0),
            ),
            example={
                "target": "drive1",
                "duration_s": 0.1,
                "parameters": {"signal": "ZSW1", "set": 0x0080, "clear": 0x0100},
            },
            text="""
            Bits of a word are overridden: some are shown as 1, some as 0, whatever they are.
            """,
        ),
        _kind(
            "telegram.swap",
            "Two signals, words or bits of the same length are exchanged",
            AtSignal(_swap),
            parameters=(
                _SIGNAL,
                Parameter("other", "text", "The other one, of the same direction", required=True),
                _DIRECTION,
            ),
            example={
                "target": "drive1",
                "duration_s": 0.1,
                "parameters": {"signal": "PZD2", "other": "PZD3", "direction": "setpoint"},
            },
            text="""
            Two signals, words or bits of the same length and direction are exchanged.
            """,
        ),
        _kind(
            "telegram.offset",
            "A signal is displaced",
            AtSignal(_displace),
            parameters=(
                _SIGNAL,
                _DIRECTION,
                Parameter(
                    "percent",
                    "float",
                    "For normalised signals (N2, N4), of 100 % = 4000h; they end at their limits",
                    unit="%",
                    minimum=-400.0,
                    maximum=400.0,
                    default=0.0,
                ),
                Parameter(
                    "counts",
                    "int",
                    "For all others; it wraps as the signal does",
                    minimum=-(2**31),
                    maximum=2**31 - 1,
                    default=0,
                ),
            ),
            example={
                "target": "drive1",
                "duration_s": 0.1,
                "parameters": {"signal": "NIST_B", "percent": 5.0},
            },
            text="""
            A signal is displaced. Normalised ones (`NIST_B`, `NSOLL_B`, `MOMRED`) take `percent` and end
            at their limits, all others `counts`, and wrap.
            """,
        ),
        _kind(
            "telegram.scale",
            "A signal has a wrong scale",
            AtSignal(_scale),
            parameters=(
                _SIGNAL,
                _DIRECTION,
                Parameter(
                    "factor",
                    "float",
                    "By which it is multiplied; it ends at its limits",
                    minimum=-100.0,
                    maximum=100.0,
                    required=True,
                ),
            ),
            example={
                "target": "drive1",
                "duration_s": 0.1,
                "parameters": {"signal": "NSOLL_B", "factor": 0.5},
            },
            text="""
            A signal is multiplied; it ends at its limits.
            """,
        ),
        _kind(
            "telegram.freeze",
            "Stale data: the telegram repeats what it was when the fault came",
            AtTelegram(_freeze),
            parameters=(
                _TELEGRAM_DIRECTION,
                Parameter(
                    "sign_of_life",
                    "text",
                    "What its sign of life does",
                    default="stands",
                    choices=("stands", "counts"),
                ),
            ),
            example={
                "target": "drive1",
                "duration_s": 0.1,
                "parameters": {"direction": "actual", "sign_of_life": "counts"},
            },
            text="""
            Stale data: the telegram of the moment is repeated. With `counts` its sign of life goes on, so
            that only the following error monitoring notices.
            """,
        ),
        _kind(
            "telegram.late",
            "Telegrams are late by a number of cycles: for so long nothing comes, then all in order",
            AtTelegram(_delay),
            parameters=(
                _TELEGRAM_DIRECTION,
                Parameter(
                    "cycles", "int", "How many", unit="bus cycles", minimum=1, maximum=1000, required=True
                ),
            ),
            example={"target": "drive1", "duration_s": 0.1, "parameters": {"cycles": 2}},
            text="""
            Telegrams are late by so many cycles: for so long nothing comes, then all of them in order. At
            the end those under way are lost.
            """,
        ),
        _kind(
            "telegram.lost",
            "No telegram is handed over: the provider's status is bad",
            AtTelegram(_lose),
            parameters=(_TELEGRAM_DIRECTION,),
            example={"target": "drive1", "duration_s": 0.1, "parameters": {"direction": "setpoint"}},
            text="""
            No telegram is handed over, as with a bad status of its provider. An emulated drive that somebody
            else controls sends no TPDO with words of it, and leaves the Modbus request for it unanswered.
            """,
        ),
        _kind(
            "telegram.length",
            "The telegram has a wrong length",
            AtTelegram(_change_length, as_sent=False),
            parameters=(
                _TELEGRAM_DIRECTION,
                Parameter(
                    "words",
                    "int",
                    "Words too many, or (negative) too few",
                    unit="words",
                    minimum=-32,
                    maximum=32,
                    required=True,
                ),
            ),
            example={"target": "drive1", "duration_s": 0.1, "parameters": {"words": -1}},
            text="""
            The telegram has too many or too few words. One that comes is not taken over; one that goes
            has its PDO shorter, which the drive reports, or, longer, is cut to what the PDOs hold. What an
            emulated drive sends to somebody else's controller has the length of its PDOs or of the request.
            """,
        ),
        _kind(
            "telegram.sign_of_life",
            "The sign of life (bits 12..15 of STW2 or ZSW2) stands still, jumps, or is 0",
            AtTelegram(_disturb_sign_of_life),
            parameters=(
                _TELEGRAM_DIRECTION,
                Parameter(
                    "how", "text", "What it does", default="freeze", choices=("freeze", "jump", "zero")
                ),
                Parameter(
                    "step", "int", "jump: by how much, in its range 1..15", minimum=1, maximum=14, default=5
                ),
            ),
            example={
                "target": "drive1",
                "duration_s": 0.1,
                "parameters": {"direction": "actual", "how": "freeze"},
            },
            text="""
            Bits 12 to 15 of `STW2` or `ZSW2` stand still, are displaced within 1..15 (`jump`), or are 0.
            """,
        ),
        _kind(
            "telegram.control_lost",
            "The drive requests no control (ZSW1.9 = 0), or the controller gives it away (STW1.10 = 0)",
            AtTelegram(_lose_control),
            parameters=(_TELEGRAM_DIRECTION,),
            example={"target": "drive1", "duration_s": 0.1, "parameters": {"direction": "actual"}},
        ),
    ),
    title="Telegrams of a PROFIdrive drive",
    text="""
    The kinds `telegram.*` act between the profile and the bus that carries it, in the port of the
    axis: on every transport, at emulated and physical drives, in both directions. `count` says how
    many telegrams are hit; every hit reports what has become of it. What passes on the bus is true in
    the direction from the drive, and disturbed in the direction to it. Where somebody else controls an
    emulated drive (`hil emulate --fault`, a drive without an axis in the process of the test), the drive
    itself has the fault: what passes on the bus is disturbed in the direction from it. The trace shows
    what the axis reads (`axis1.zsw1`) next to what the drive does (`drive1.drive_zsw1`). Several faults
    at once work one after the other.
    """,
)
