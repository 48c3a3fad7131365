"""How the controller uses a CiA 402 drive: mode, PDOs, parameters and units, from what its EDS allows.

Without an EDS it is the standard plan: cyclic synchronous velocity, one RPDO, two synchronous TPDOs and one
by event. An EDS may lack objects, have PDOs that cannot be mapped otherwise, or modes that do not include it;
the plan then takes what is there, and says what is lost.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from fieldbus.canopen.dictionary import Entry
from fieldbus.canopen.node_setup import PdoSetup
from fieldbus.errors import ConfigurationError
from motion.drives._canopen import Row

MODE_PV: Final = 3
MODE_IP: Final = 7
MODE_CSP: Final = 8
MODE_CSV: Final = 9
MODE_CST: Final = 10
MODES: Final[Mapping[str, int]] = {"csv": MODE_CSV, "csp": MODE_CSP, "ip": MODE_IP, "pv": MODE_PV}
"""Modes in which the controller can move a drive by velocities, by name, the best one first."""
_BY_NAME: Final[Mapping[str, int]] = {**MODES, "cst": MODE_CST}
_SUPPORTED_BIT: Final = {MODE_PV: 2, MODE_IP: 6, MODE_CSP: 7, MODE_CSV: 8, MODE_CST: 9}
_COSTS: Final = {
    MODE_CSV: "",
    MODE_PV: "mode pv: the ramps 6083h and 6084h of the drive limit the dynamics; the axis follows later",
    MODE_CSP: "mode csp: the drive controls the position; its own following error comes on top of the axis's",
    MODE_IP: "mode ip: as csp; setpoints reach the drive through 60C1h:1",
    MODE_CST: "",
}

CONTROL: Final = 0x604000
STATUS: Final = 0x604100
MODE: Final = 0x606000
POSITION: Final = 0x606400
VELOCITY: Final = 0x606C00
TORQUE: Final = 0x607700
INPUTS: Final = 0x60FD00
FAULT_CODE: Final = 0x603F00
FOLLOWING_ERROR: Final = 0x60F400
_ERROR_REGISTER: Final = 0x100100
TARGET_VELOCITY: Final = 0x60FF00
TARGET_POSITION: Final = 0x607A00
TARGET_TORQUE: Final = 0x607100
INTERPOLATION_DATA: Final = 0x60C101
_TARGET: Final = {
    MODE_CSV: TARGET_VELOCITY,
    MODE_PV: TARGET_VELOCITY,
    MODE_CSP: TARGET_POSITION,
    MODE_IP: INTERPOLATION_DATA,
    MODE_CST: TARGET_TORQUE,
}

_LOST: Final = {
    VELOCITY: "606Ch cannot be mapped: the axis calculates the velocity from positions",
    TORQUE: "6077h cannot be mapped: the actual torque is not seen",
    INPUTS: "60FDh cannot be mapped: switches at the drive are not seen",
    FAULT_CODE: "603Fh cannot be mapped: the fault code comes with the EMCY",
    FOLLOWING_ERROR: "60F4h cannot be mapped: the following error of the drive is not seen",
}
_FIRST_COB: Final = {False: (0x200, 0x300, 0x400, 0x500), True: (0x180, 0x280, 0x380, 0x480)}
_SYNCHRONOUS: Final = 1
_BY_EVENT: Final = 255
_MILLI_RPM: Final = 0xFDB44700
_UNIT: Final = 0x60A900


@dataclass(frozen=True)
class PdoUse:
    """A PDO that the cycle uses.

    Args:
        cob_id: CAN identifier.
        entries: Mapped objects, `index << 16 | sub-index << 8 | bits`.
        signed: For every object, whether it has a sign.

    """

    cob_id: int
    entries: tuple[int, ...]
    signed: tuple[bool, ...]


@dataclass(frozen=True)
class DrivePlan:
    """What the controller sets up in a drive, and how it uses it."""

    mode: int = MODE_CSV
    receive: tuple[PdoUse, ...] = ()
    """Empty: the standard PDOs."""
    transmit: tuple[PdoUse, ...] = ()
    setups: tuple[PdoSetup, ...] = ()
    writable: Mapping[int, Entry] | None = None
    """Objects that may be written, by key; None: all of the standard plan."""
    velocity_unit_rpm: float = 0.001
    """Size of a velocity unit of the drive, rpm."""
    sets_units: bool = True
    """The controller sets 60A9h to 10^-3 rpm, and 608Fh and 6092h to increments."""
    increments_per_unit: float = 1.0
    """Increments of the encoder in a position unit of the drive."""
    is_402: bool = True
    """1000h says that the device is a drive."""
    notes: tuple[str, ...] = ()
    """What is lost against the standard plan."""

    def rows(self, rows: Iterable[Row]) -> list[Row]:
        """Return the parameters of the standard plan that the drive takes, with the lengths that it has."""
        if self.writable is None:
            return list(rows)
        taken: list[Row] = []
        for index, sub, value, _size in rows:
            entry = self.writable.get(index << 8 | sub)
            if entry is not None and _fits(entry, value):
                taken.append((index, sub, value, entry.size))
        return taken


STANDARD: Final = DrivePlan()


def _fits(entry: Entry, value: int) -> bool:
    low, high = entry.type_range
    number = value if low <= value <= high or value >= 0 else value & (1 << entry.bits) - 1
    low = low if entry.low is None else max(low, int(entry.low))
    high = high if entry.high is None else min(high, int(entry.high))
    return low <= number <= high or (entry.signed and number > high and entry.high is None)


@dataclass
class _Slot:
    """A PDO of the drive."""

    number: int
    transmit: bool
    cob_id: int
    kind: int
    configurable: bool
    """Identifier and transmission type can be written."""
    free: bool
    """Its mapping can be written."""
    capacity: int
    content: list[int] = field(default_factory=list)
    used: bool = False


def plan_drive(
    entries: Mapping[int, Entry],
    *,
    node_id: int,
    mode: str = "auto",
    velocity_unit_rpm: float,
    increments_per_unit: float,
    also: Sequence[int] = (),
) -> DrivePlan:
    """Return how to use a drive with the entries of an EDS.

    Args:
        entries: Of the EDS, for the node-ID.
        node_id: 1..127.
        mode: `auto`: the best mode that the drive has; else a name of `MODES`.
        velocity_unit_rpm: Velocity unit of the drive as it is, rpm.
        increments_per_unit: Increments of the encoder in a position unit of the drive as it is.
        also: Further objects to be sent in every cycle, by key, where there is room.

    Raises:
        ConfigurationError: No mode can be commanded with the PDOs of the drive; says what each lacks.

    """
    supported = _number(entries, 0x650200)
    wanted = list(MODES.values()) if mode == "auto" else [_BY_NAME[mode]]
    reasons: list[str] = []
    for candidate in wanted:
        name = next(one for one, code in _BY_NAME.items() if code == candidate)
        if supported and not supported >> _SUPPORTED_BIT[candidate] & 1:
            reasons.append(f"{name}: 6502h = {supported:08X}h does not have it")
            continue
        slots = {transmit: _slots(entries, node_id, transmit=transmit) for transmit in (False, True)}
        lacking = _place(entries, slots[False], [(CONTROL, _TARGET[candidate])], (MODE,))
        lacking += _place(
            entries,
            slots[True],
            [(STATUS, POSITION)],
            (TORQUE,),
            ((VELOCITY, INPUTS), (FAULT_CODE, _ERROR_REGISTER), *((key,) for key in also)),
        )
        missing = [key for key in lacking if key in (CONTROL, _TARGET[candidate], STATUS, POSITION)]
        if missing:
            objects = ", ".join(f"{key >> 8:04X}h" for key in missing)
            reasons.append(f"{name}: no PDO carries {objects}")
            continue
        return _plan(entries, slots, candidate, lacking, (velocity_unit_rpm, increments_per_unit))
    raise ConfigurationError(
        "drive", mode, "a mode that the drive has and its PDOs can command", problem="; ".join(reasons)
    )


def _plan(
    entries: Mapping[int, Entry],
    slots: Mapping[bool, Sequence[_Slot]],
    mode: int,
    lacking: Sequence[int],
    units: tuple[float, float],
) -> DrivePlan:
    velocity_unit_rpm, increments_per_unit = units
    writable = {key: entry for key, entry in entries.items() if entry.writable and entry.integer}
    notes = [_COSTS[mode]] if _COSTS[mode] else []
    notes += [text for key, text in _LOST.items() if key in lacking]
    sets_units = _UNIT in writable and _fits(writable[_UNIT], _MILLI_RPM)
    if not sets_units:
        notes.append(f"60A9h cannot be written: velocities in units of {velocity_unit_rpm:g} rpm")
    scaled = all(key in writable for key in (0x608F01, 0x608F02, 0x609201, 0x609202))
    if 0x101700 not in writable:
        guarded = 0x100C00 in writable and 0x100D00 in writable
        notes.append(
            "1017h cannot be written: " + ("node guarding" if guarded else "nobody notices a lost drive")
        )
    if 0x60C201 not in writable and mode != MODE_PV:
        notes.append("60C2h cannot be written: the drive interpolates with the time that it has")
    setups: list[PdoSetup] = []
    uses: dict[bool, list[PdoUse]] = {False: [], True: []}
    for transmit, some in slots.items():
        for slot in some:
            if slot.used:
                uses[transmit].append(
                    PdoUse(
                        slot.cob_id, tuple(slot.content), tuple(_signed(entries, raw) for raw in slot.content)
                    )
                )
            if slot.configurable and (slot.free or not slot.used):
                setups.append(
                    PdoSetup(transmit, slot.number, slot.cob_id, slot.kind, tuple(slot.content))
                    if slot.used
                    else PdoSetup(transmit, slot.number, slot.cob_id)
                )
            elif slot.used:
                notes.append(
                    f"{'T' if transmit else 'R'}PDO{slot.number} is used as the drive has it: "
                    + ", ".join(f"{raw >> 16:04X}h" for raw in slot.content)
                )
    return DrivePlan(
        mode=mode,
        receive=tuple(uses[False]),
        transmit=tuple(uses[True]),
        setups=tuple(setups),
        writable=writable,
        velocity_unit_rpm=0.001 if sets_units else velocity_unit_rpm,
        sets_units=sets_units,
        increments_per_unit=1.0 if scaled else increments_per_unit,
        is_402=_number(entries, 0x100000) & 0xFFFF in (0, 402),
        notes=tuple(notes),
    )


def _number(entries: Mapping[int, Entry], key: int) -> int:
    entry = entries.get(key)
    return int(entry.default) if entry is not None and entry.integer else 0


def _signed(entries: Mapping[int, Entry], raw: int) -> bool:
    entry = entries.get(raw >> 8)
    return entry is not None and entry.signed


def _slots(entries: Mapping[int, Entry], node_id: int, *, transmit: bool) -> list[_Slot]:
    """Return the first four PDOs of a direction, as far as the drive has them."""
    found: list[_Slot] = []
    for number in range(1, 5):
        communication = (0x1800 if transmit else 0x1400) + number - 1 << 8
        mapping = (0x1A00 if transmit else 0x1600) + number - 1 << 8
        cob, kind, count = (entries.get(key) for key in (communication | 1, communication | 2, mapping))
        if cob is None or count is None:
            continue
        members = [entries[mapping | sub] for sub in range(1, 65) if mapping | sub in entries]
        free = count.writable and bool(members) and all(one.writable for one in members)
        configurable = cob.writable and kind is not None and kind.writable
        default = [int(one.default) for one in members[: int(count.default) if not free else 0]]
        given = int(cob.default) & 0x7FF
        own = _FIRST_COB[transmit][number - 1] + node_id
        found.append(
            _Slot(
                number,
                transmit,
                own if configurable or not given else given,
                _SYNCHRONOUS,
                configurable,
                free and configurable,
                len(members),
                [raw for raw in default if raw],
            )
        )
    return found


def _place(
    entries: Mapping[int, Entry],
    slots: Sequence[_Slot],
    first: Sequence[tuple[int, ...]],
    more: Sequence[int] = (),
    others: Sequence[tuple[int, ...]] = (),
) -> list[int]:
    """Put objects into PDOs: `first`, with `more` where there is room, then the others; return what is left.

    An object that a PDO with a fixed mapping carries stays there.
    """
    lacking: list[int] = []
    for at, group in enumerate((*(tuple(one) + tuple(more) for one in first), *others)):
        empty = next((slot for slot in slots if slot.free and not slot.used), None)
        for key in group:
            fixed = next(
                (slot for slot in slots if not slot.free and any(raw >> 8 == key for raw in slot.content)),
                None,
            )
            if fixed is not None:
                fixed.used = True
                continue
            entry = entries.get(key)
            if (
                entry is None
                or not entry.bits
                or not _mappable(entry, transmit=slots[0].transmit if slots else True)
            ):
                lacking.append(key)
                continue
            room = [slot for slot in ([empty] if empty else []) if _room(slot, entry)]
            room += [slot for slot in slots if slot.free and slot.used and _room(slot, entry)]
            if not room:
                lacking.append(key)
                continue
            slot = room[0]
            slot.content.append(entry.index << 16 | entry.sub << 8 | entry.bits)
            slot.used = True
            if FAULT_CODE in group and at:
                slot.kind = _BY_EVENT if slot is empty else slot.kind
    return lacking


def _mappable(entry: Entry, *, transmit: bool) -> bool:
    return entry.maps_transmit if transmit else entry.maps_receive


def _room(slot: _Slot, entry: Entry) -> bool:
    return len(slot.content) < slot.capacity and sum(raw & 0xFF for raw in slot.content) + entry.bits <= 64
