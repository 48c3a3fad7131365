"""Faults of PROFIdrive telegrams: a filter between the profile and the bus that carries it, on the
controller's side.

Both directions pass the port of the axis, whatever the bus is and whoever the drive is, so that one seam
serves CAN and Modbus, emulated and physical drives. Several faults of a direction work one after the other,
in the order of their coming.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any, Final, Protocol

from fieldbus.errors import ConfigurationError, UnsupportedFaultError
from hil.faults import _telegram_words as words
from hil.faults._action import Action
from hil.faults._fault import Fault
from hil.protocols import Bench

Work = Callable[[], None]
Filter = Callable[[bytes], bytes | None]
Note = Callable[[int, str], None]

_SIGN_WORDS: Final = {"setpoint": ("STW2", "STW2_ENC", "CU_STW1"), "actual": ("ZSW2", "ZSW2_ENC", "CU_ZSW1")}
_SIGN_VALUES: Final = 15


class _Port(Protocol):
    """What a fault needs of the port of an axis."""

    name: str
    telegram: Any
    setpoint_seam: Filter | None
    actual_seam: Filter | None


class TelegramAction(Action):
    """Put a filter into one direction of a drive's telegram.

    Args:
        bench: The bench.
        fault: What to do.
        ended: Called when `count` telegrams have been hit.
        note: Called at every hit, with its number and what has become of the telegram.

    Raises:
        UnsupportedFaultError: No axis of the bench leads the drive by a telegram.
        ConfigurationError: The telegram has no such signal, or the values do not fit it.

    """

    __slots__ = (
        "_bench",
        "_direction",
        "_ended",
        "_filter",
        "_hits_left",
        "_note",
        "_port",
        "_stage",
        "hits",
    )

    def __init__(self, bench: Bench, fault: Fault, ended: Work, note: Note) -> None:
        self._port = port = _port(bench, fault)
        super().__init__(port.name, self._begin, self._finish)
        self._bench = bench
        self._ended = ended
        self._note = note
        self._direction, self._filter = _filter(fault, port.telegram)
        self._hits_left = fault.count
        self._stage: _Stage | None = None
        self.hits = 0
        """Telegrams hit so far."""

    def _begin(self) -> None:
        self._stage = _stages(self._port, self._direction).add(self._work)

    def _finish(self) -> None:
        if self._stage is not None:
            self._stage.remove()
            self._stage = None

    def _work(self, frame: bytes) -> bytes | None:
        if self._hits_left == 0:
            return frame
        result = self._filter(frame)
        if result == frame:
            return frame
        self.hits += 1
        self._note(self.hits, "nothing" if result is None else _difference(frame, result))
        if self._hits_left is not None:
            self._hits_left -= 1
            if self._hits_left == 0:
                scheduler = self._bench.scheduler
                scheduler.at(scheduler.now, self._ended)
        return result


class _Stage:
    """One filter in a row of them."""

    __slots__ = ("_row", "work")

    def __init__(self, row: _Row, work: Filter) -> None:
        self._row = row
        self.work = work

    def remove(self) -> None:
        self._row.drop(self)


class _Row:
    """All filters of one direction of a port; it stands in the port only while there is one."""

    __slots__ = ("_attribute", "_port", "_stages")

    def __init__(self, port: _Port, attribute: str) -> None:
        self._port = port
        self._attribute = attribute
        self._stages: tuple[_Stage, ...] = ()

    def add(self, work: Filter) -> _Stage:
        stage = _Stage(self, work)
        self._stages = (*self._stages, stage)
        setattr(self._port, self._attribute, self)
        return stage

    def drop(self, stage: _Stage) -> None:
        self._stages = tuple(one for one in self._stages if one is not stage)
        if not self._stages:
            setattr(self._port, self._attribute, None)

    def __call__(self, frame: bytes) -> bytes | None:
        result: bytes | None = frame
        for stage in self._stages:
            if result is None:
                return None
            result = stage.work(result)
        return result


def _stages(port: _Port, direction: str) -> _Row:
    attribute = f"{direction}_seam"
    row = getattr(port, attribute)
    return row if isinstance(row, _Row) else _Row(port, attribute)


def _port(bench: Bench, fault: Fault) -> _Port:
    """Return the port by which an axis of the bench leads the drive."""
    port_of = getattr(bench, "port", None)
    if port_of is None:
        raise UnsupportedFaultError(f"{fault.kind} cannot be injected: this bench shows no ports of its axes")
    port = port_of(fault.target or None)
    if not hasattr(port, "actual_seam"):
        raise UnsupportedFaultError(
            f"{fault.kind} cannot be injected: {port.name} is led by no PROFIdrive telegram"
        )
    result: _Port = port
    return result


def _filter(fault: Fault, telegram: Any) -> tuple[str, Filter]:
    """Return the direction and what is done to every telegram there."""
    value = fault.value
    kind = fault.kind.partition(".")[2]
    direction: str = value("direction")
    if kind in _WHOLE:
        return direction, _WHOLE[kind](fault, telegram)
    place = words.find_place(telegram, value("signal"), direction, f"{fault.kind}.parameters.signal")
    change = _change(fault, telegram, kind, place)
    length = (telegram.setpoint if place.setpoint else telegram.actual).length

    def work(frame: bytes) -> bytes:
        if len(frame) != length:
            return frame  # another fault has cut it
        return change(int.from_bytes(frame)).to_bytes(length)

    return "setpoint" if place.setpoint else "actual", work


def _change(fault: Fault, telegram: Any, kind: str, place: words.Place) -> words.Change:
    value = fault.value
    match kind:
        case "stuck":
            held = value("value")
            if held is not None and not -(1 << place.bits) // 2 <= held <= place.mask:
                raise ConfigurationError(
                    f"{fault.kind}.parameters.value", held, f"a value of {place.bits} bit"
                )
            return words.stuck(place, held)
        case "flip":
            _fits(fault, "mask", place)
            return words.flipped(place, value("mask"))
        case "bits":
            _fits(fault, "set", place)
            _fits(fault, "clear", place)
            return words.lying(place, value("set"), value("clear"))
        case "swap":
            where = f"{fault.kind}.parameters.other"
            other = words.find_place(telegram, value("other"), value("direction"), where)
            if other.bits != place.bits or other.setpoint is not place.setpoint:
                raise ConfigurationError(
                    where, value("other"), f"{place.bits} bit in the direction of {place.name}"
                )
            return words.swapped(place, other)
        case "offset":
            return words.displaced(place, _counts(fault, place))
        case _:
            return words.scaled(place, value("factor"))


def _fits(fault: Fault, name: str, place: words.Place) -> None:
    if fault.value(name) > place.mask:
        raise ConfigurationError(
            f"{fault.kind}.parameters.{name}", fault.value(name), f"bits of {place.name}: 0..{place.mask:X}h"
        )


def _counts(fault: Fault, place: words.Place) -> int:
    """Return the offset in counts, from the parameter that the signal has."""
    normalised = words.normalised(place)
    other = "counts" if normalised else "percent"
    if fault.value(other):
        right = "percent" if normalised else "counts"
        raise ConfigurationError(
            f"{fault.kind}.parameters.{other}", fault.value(other), f"0: {place.name} takes {right}"
        )
    return words.percent_of(place, fault.value("percent")) if normalised else (int(fault.value("counts")))


# -- whole telegrams
# -------------------------------------------------------------------------------------------------


def _sign_place(fault: Fault, telegram: Any, direction: str) -> words.Place | None:
    """Return where the sign of life stands; None in a telegram without."""
    layout = telegram.setpoint if direction == "setpoint" else telegram.actual
    for name in _SIGN_WORDS[direction]:
        if name in layout.names:
            found = words.find_place(telegram, f"{name}.12", direction, fault.kind)
            return found._replace(name=f"{name}.12..15", bits=4)
    return None


def _freeze(fault: Fault, telegram: Any) -> Filter:
    sign = None
    if fault.value("sign_of_life") == "counts":
        sign = _sign_place(fault, telegram, fault.value("direction"))
    held: bytes | None = None

    def work(frame: bytes) -> bytes:
        nonlocal held
        if held is None:
            held = frame
        if sign is None or len(held) != len(frame):
            return held
        return sign.write(int.from_bytes(held), sign.read(int.from_bytes(frame))).to_bytes(len(frame))

    return work


def _late(fault: Fault, telegram: Any) -> Filter:  # noqa: ARG001 - all makers are called alike
    cycles: int = fault.value("cycles")
    waiting: deque[bytes] = deque()

    def work(frame: bytes) -> bytes | None:
        waiting.append(frame)
        return waiting.popleft() if len(waiting) > cycles else None

    return work


def _lost(fault: Fault, telegram: Any) -> Filter:  # noqa: ARG001
    return lambda frame: None  # noqa: ARG005 - whatever it is


def _length(fault: Fault, telegram: Any) -> Filter:  # noqa: ARG001
    more = 2 * int(fault.value("words"))
    if not more:
        raise ConfigurationError(f"{fault.kind}.parameters.words", 0, "-32..32, not 0")

    def work(frame: bytes) -> bytes:
        return frame + bytes(more) if more > 0 else frame[: max(0, len(frame) + more)]

    return work


def _sign_of_life(fault: Fault, telegram: Any) -> Filter:
    direction: str = fault.value("direction")
    sign = _sign_place(fault, telegram, direction)
    if sign is None:
        raise UnsupportedFaultError(
            f"{fault.kind} cannot be injected: telegram {telegram.number} has no sign of life"
        )
    step: int = fault.value("step")
    match fault.value("how"):
        case "freeze":
            change = words.stuck(sign, None)
        case "zero":
            change = words.stuck(sign, 0)
        case _:

            def change(frame: int) -> int:
                value = sign.read(frame)
                return sign.write(frame, (value - 1 + step) % _SIGN_VALUES + 1) if value else frame

    return lambda frame: change(int.from_bytes(frame)).to_bytes(len(frame))


def _control_lost(fault: Fault, telegram: Any) -> Filter:
    setpoint = fault.value("direction") == "setpoint"
    names = (telegram.setpoint if setpoint else telegram.actual).names
    bit = words.find_place(telegram, f"{names[0]}.{10 if setpoint else 9}", "", fault.kind)
    change = words.stuck(bit, 0)
    return lambda frame: change(int.from_bytes(frame)).to_bytes(len(frame))


_WHOLE: Final[dict[str, Callable[[Fault, Any], Filter]]] = {
    "freeze": _freeze,
    "late": _late,
    "lost": _lost,
    "length": _length,
    "sign_of_life": _sign_of_life,
    "control_lost": _control_lost,
}


def _difference(before: bytes, after: bytes) -> str:
    """Return what has changed, word by word, or the length."""
    if len(before) != len(after):
        return f"{len(before) // 2} words become {len(after) // 2}"
    return ", ".join(
        f"PZD{at // 2 + 1} {before[at : at + 2].hex().upper()} becomes {after[at : at + 2].hex().upper()}"
        for at in range(0, len(before), 2)
        if before[at : at + 2] != after[at : at + 2]
    )
