"""How the controller uses a CiA 402 drive: mode, PDOs, parameters and units, from what its EDS allows.

Without an EDS it is the standard plan: cyclic synchronous velocity, one RPDO, two synchronous TPDOs and one
by event. An EDS may lack objects, have PDOs that cannot be mapped otherwise, or modes that do not include it;
the plan then takes what is there, and says what is lost.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
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
    MODE_PV: "mode pv: setpoints step with the cycle, nothing between them; OFF1 is a ramp of the controller",
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
_SENT: Final = (CONTROL, MODE, TARGET_VELOCITY, TARGET_POSITION, TARGET_TORQUE, INTERPOLATION_DATA)
"""What the controller has a value for in every cycle."""
PROFILE_ACCELERATION: Final = 0x608300
PROFILE_DECELERATION: Final = 0x608400
_ABORT_CONNECTION: Final = 0x600700
_FAULT: Final = 1
_MAX_TORQUE: Final = 0x607200
_INVALID: Final = 1 << 31
_MOST_ENTRIES: Final = 64
_FIRST_COB: Final = {False: (0x200, 0x300, 0x400, 0x500), True: (0x180, 0x280, 0x380, 0x480)}
_SYNCHRONOUS: Final = 1
_BY_EVENT: Final = 255
_MILLI_RPM: Final = 0xFDB44700
_UNIT: Final = 0x60A900
_MAX_ACCELERATION: Final = 0x60C500
_MAX_DECELERATION: Final = 0x60C600
_COASTS: Final = {
    0x605A00: "OFF3 (quick stop)",
    0x605B00: "OFF1 (shutdown)",
    0x605C00: "disable operation",
    0x605E00: "a fault",
}
"""Option codes; 0 takes the torque away at once."""


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
    ramps_off1: bool = False
    """Mode pv: the controller makes the ramp of OFF1, so that the drive's own (6084h) can be steep."""
    limits_torque: bool = True
    """The drive has a torque limit that can be written (6072h)."""
    faults_outside_operation: bool = False
    """The drive takes leaving Operational for a fault (6007h = 1) until it is told otherwise."""
    fault_at_start: bool = False
    """Nothing keeps the drive from doing so (6007h is missing or read-only): the fault is acknowledged."""
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


@dataclass
class Answers:
    """What a drive has shown on the bus and its EDS does not say."""

    values: dict[int, int] = field(default_factory=dict)
    """What entries hold, by key."""
    fixed: set[int] = field(default_factory=set)
    """Keys of entries that it refuses to change."""
    absent: set[int] = field(default_factory=set)
    """Keys of entries that it does not have."""
    unmappable: set[tuple[int, bool]] = field(default_factory=set)
    """Objects that it refuses to map, by key and whether into a TPDO."""

    def apply(self, entries: dict[int, Entry]) -> None:
        """Let entries, which are nobody else's, be as the drive has shown."""
        for key in self.absent:
            entries.pop(key, None)
        for key in self.fixed & entries.keys():
            entries[key].writable = False
        for key, value in self.values.items():
            entry = entries.get(key)
            if entry is not None and entry.integer:
                entry.default, entry.given = entry.coerce(value), True
        for key, transmit in self.unmappable:
            if key in entries:
                setattr(entries[key], "maps_transmit" if transmit else "maps_receive", False)


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
    fixed: frozenset[int]
    """Keys of what cannot be written of its two records."""
    free: bool
    """Its mapping can be written."""
    capacity: int
    silent: bool
    """Its identifier can be made invalid."""
    content: list[int] = field(default_factory=list)
    used: bool = False

    @property
    def name(self) -> str:
        """As in TPDO1."""
        return f"{'T' if self.transmit else 'R'}PDO{self.number}"


Mapped = Mapping[tuple[bool, int], Sequence[int]]
"""Objects that PDOs shall carry, by key: (transmit, number) -> keys."""


def plan_drive(
    entries: Mapping[int, Entry],
    *,
    node_id: int,
    mode: str = "auto",
    velocity_unit_rpm: float,
    increments_per_unit: float,
    mapped: Mapped | None = None,
    also: Sequence[int] = (),
) -> DrivePlan:
    """Return how to use a drive with the entries of an EDS.

    Args:
        entries: Of the EDS, for the node-ID.
        node_id: 1..127.
        mode: `auto`: the best mode that the drive has; else a name of `MODES`.
        velocity_unit_rpm: Velocity unit of the drive as it is, rpm.
        increments_per_unit: Increments of the encoder in a position unit of the drive as it is.
        mapped: The mapping that a user wants; a direction of which it says nothing is planned.
        also: Further objects to be sent in every cycle, by key, where there is room.

    Raises:
        ConfigurationError: No mode can be commanded with the PDOs of the drive; says what each lacks. Or a
            wanted mapping is not possible.

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
        groups = {
            False: ((CONTROL, _TARGET[candidate], MODE),),
            True: (
                (STATUS, POSITION, TORQUE),
                (VELOCITY, INPUTS),
                (FAULT_CODE, _ERROR_REGISTER),
                *((key,) for key in also),
            ),
        }
        lacking: list[int] = []
        for transmit in (False, True):
            asked = {at: keys for at, keys in (mapped or {}).items() if at[0] == transmit}
            if asked:
                _place_as_asked(entries, slots[transmit], asked)
                carried = {raw >> 8 for slot in slots[transmit] if slot.used for raw in slot.content}
                lacking += [key for group in groups[transmit] for key in group if key not in carried]
            else:
                lacking += _place(entries, slots[transmit], groups[transmit], transmit=transmit)
        missing = [key for key in lacking if key in (CONTROL, _TARGET[candidate], STATUS, POSITION)]
        if missing:
            reasons.append(f"{name}: {', '.join(_why_not(entries, missing))}")
            continue
        return _plan(entries, slots, candidate, lacking, (velocity_unit_rpm, increments_per_unit))
    raise ConfigurationError(
        "drive", mode, "a mode that the drive has and its PDOs can command", problem="; ".join(reasons)
    )


def _why_not(entries: Mapping[int, Entry], missing: Sequence[int]) -> Iterator[str]:
    """Yield why no PDO carries objects."""
    free: list[str] = []
    for key in missing:
        entry = entries.get(key)
        if entry is None:
            yield f"{named(key)} does not exist"
        elif not _mappable(entry, transmit=key in (STATUS, POSITION)):
            yield f"{named(key)} cannot be mapped"
        elif not entry.integer:
            yield f"{named(key)} is no whole number"
        else:
            free.append(named(key))
    if free:
        yield f"no PDO carries {', '.join(free)}"


def named(key: int) -> str:
    """Return an object as it is written: `6040h`, `60C1h:1`."""
    return f"{key >> 8:04X}h" + (f":{key & 0xFF}" if key & 0xFF else "")


def _plan(
    entries: Mapping[int, Entry],
    slots: Mapping[bool, Sequence[_Slot]],
    mode: int,
    lacking: Sequence[int],
    units: tuple[float, float],
) -> DrivePlan:
    velocity_unit_rpm, increments_per_unit = units
    writable = {key: entry for key, entry in entries.items() if entry.writable and entry.integer}
    sets_units = _UNIT in writable and _fits(writable[_UNIT], _MILLI_RPM)
    scaled = all(key in writable for key in (0x608F01, 0x608F02, 0x609201, 0x609202))
    used = [slot for some in slots.values() for slot in some if slot.used]
    uses: dict[bool, list[PdoUse]] = {False: [], True: []}
    for slot in used:
        signed = tuple(_signed(entries, raw) for raw in slot.content)
        uses[slot.transmit].append(PdoUse(slot.cob_id, tuple(slot.content), signed))
    return DrivePlan(
        mode=mode,
        receive=tuple(uses[False]),
        transmit=tuple(uses[True]),
        setups=tuple(one for some in slots.values() for slot in some for one in _setup(slot)),
        writable=writable,
        velocity_unit_rpm=0.001 if sets_units else velocity_unit_rpm,
        sets_units=sets_units,
        increments_per_unit=1.0 if scaled else increments_per_unit,
        is_402=_number(entries, 0x100000) & 0xFFFF in (0, 402),
        ramps_off1=mode == MODE_PV and PROFILE_DECELERATION in writable,
        limits_torque=_MAX_TORQUE in writable,
        faults_outside_operation=_ABORT_CONNECTION in writable
        and _number(entries, _ABORT_CONNECTION) == _FAULT,
        fault_at_start=_ABORT_CONNECTION not in writable
        and (_ABORT_CONNECTION not in entries or _number(entries, _ABORT_CONNECTION) == _FAULT),
        notes=tuple(_notes(entries, used, mode, lacking, None if sets_units else velocity_unit_rpm)),
    )


def _setup(slot: _Slot) -> Iterator[PdoSetup]:
    """Yield what is written for a PDO, if anything."""
    if slot.used:
        setup = PdoSetup(
            slot.transmit, slot.number, slot.cob_id, slot.kind, tuple(slot.content), fixed=slot.fixed
        )
        if setup.wanted:
            yield setup
    elif slot.silent:
        yield PdoSetup(slot.transmit, slot.number, slot.cob_id)


def _notes(
    entries: Mapping[int, Entry],
    used: Sequence[_Slot],
    mode: int,
    lacking: Sequence[int],
    unit_rpm: float | None,
) -> Iterator[str]:
    """Yield what is lost against the standard plan."""
    writable = {key for key, entry in entries.items() if entry.writable and entry.integer}
    if mode == MODE_PV:
        yield from _costs_of_pv(entries, writable)
    elif _COSTS[mode]:
        yield _COSTS[mode]
    yield from (text for key, text in _LOST.items() if key in lacking)
    if unit_rpm is not None:
        yield f"60A9h cannot be written: velocities in units of {unit_rpm:g} rpm"
    if 0x101700 not in writable:
        guarded = 0x100C00 in writable and 0x100D00 in writable
        yield "1017h cannot be written: " + ("node guarding" if guarded else "nobody notices a lost drive")
    if 0x60C201 not in writable and mode != MODE_PV:
        yield "60C2h cannot be written: the drive interpolates with the time that it has"
    if mode == MODE_CSP:
        for key in (_MAX_ACCELERATION, _MAX_DECELERATION):
            if _number(entries, key):
                yield f"mode csp: {named(key)} is {_number(entries, key)} units: steeper ramps lag behind"
    for key, what in _COASTS.items():
        if key in entries and key not in writable and not _number(entries, key):
            yield f"{named(key)} is 0 and cannot be written: with {what} the drive coasts"
    for slot in used:
        if not slot.free:
            carried = ", ".join(named(raw >> 8) for raw in slot.content)
            yield f"{slot.name} is used as the drive has it: {carried}"
        kind = ((0x1800 if slot.transmit else 0x1400) + slot.number - 1) << 8 | 2
        if kind in slot.fixed and kind in entries and _number(entries, kind) != slot.kind:
            yield f"{slot.name} keeps the transmission type {_number(entries, kind)}"


def _costs_of_pv(entries: Mapping[int, Entry], writable: Container[int]) -> Iterator[str]:
    """Yield what it means that the drive ramps its setpoint itself."""
    if PROFILE_DECELERATION in writable:
        yield _COSTS[MODE_PV]
    for key, what in ((PROFILE_ACCELERATION, "acceleration"), (PROFILE_DECELERATION, "deceleration")):
        entry = entries.get(key)
        if key in writable and entry is not None and entry.high is not None:
            if entry.high < entry.type_range[1]:
                yield f"mode pv: {named(key)} is at most {entry.high} units: steeper ramps lag behind"
        elif key not in writable:
            off1 = ", also with OFF1" if key == PROFILE_DECELERATION else ""
            value = _number(entries, key)
            yield (
                f"mode pv: {named(key)} cannot be written: the drive keeps its {what}{off1} "
                f"({f'{value} units' if value else 'not known'})"
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
        cob, count = entries.get(communication | 1), entries.get(mapping)
        if cob is None or count is None or not (cob.writable or not int(cob.default) & _INVALID):
            continue
        keys = [mapping | sub for sub in range(1, _MOST_ENTRIES + 1) if mapping | sub in entries]
        free = count.writable and bool(keys) and all(entries[key].writable for key in keys)
        own = _FIRST_COB[transmit][number - 1] + node_id
        content = [int(entries[key].default) for key in keys]
        length = int(count.default)
        kind = communication | 2
        found.append(
            _Slot(
                number,
                transmit,
                own if cob.writable else int(cob.default) & 0x7FF,
                _SYNCHRONOUS,
                frozenset(
                    key
                    for key in (communication | 1, kind, mapping, *keys)
                    if key not in entries or not entries[key].writable or (not free and key in keys)
                ),
                free,
                len(keys),
                cob.writable,
                [] if free else [raw for raw in content[: length or len(content)] if raw],
            )
        )
    return found


def _place_as_asked(
    entries: Mapping[int, Entry], slots: Sequence[_Slot], asked: Mapping[tuple[bool, int], Sequence[int]]
) -> None:
    """Put objects into the PDOs that a user has named.

    Raises:
        ConfigurationError: A PDO does not exist, is fixed to something else or cannot carry an object.

    """
    there = {slot.number: slot for slot in slots}
    for (transmit, number), keys in asked.items():
        where = f"pdo.{'t' if transmit else 'r'}pdo{number}"
        shown = ", ".join(named(key) for key in keys)
        slot = there.get(number)
        if slot is None:
            names = ", ".join(one.name for one in slots) or "none"
            raise ConfigurationError(where, shown, f"a PDO of the drive: {names}")
        content: list[int] = []
        for key in keys:
            entry = entries.get(key)
            if entry is None:
                raise ConfigurationError(where, named(key), "an object of the drive")
            if not (entry.bits and entry.integer and _mappable(entry, transmit=transmit)):
                raise ConfigurationError(where, named(key), f"an object that a {slot.name[:4]} can carry")
            if not transmit and key not in _SENT:
                raise ConfigurationError(
                    where, named(key), f"what the controller sends: {', '.join(named(one) for one in _SENT)}"
                )
            content.append(entry.index << 16 | entry.sub << 8 | entry.bits)
        if not slot.free and content != slot.content:
            has = ", ".join(named(raw >> 8) for raw in slot.content)
            raise ConfigurationError(where, shown, f"{has}: the drive does not let {slot.name} be mapped")
        bits = sum(raw & 0xFF for raw in content)
        if bits > 64 or len(content) > slot.capacity:
            raise ConfigurationError(
                where, f"{len(content)} objects of {bits} bits", f"{slot.capacity} objects, 64 bits"
            )
        slot.content, slot.used = content, True
        slot.kind = _kind(slot)


def _kind(slot: _Slot) -> int:
    """Return the transmission type: by event for what says why a drive has failed, else with SYNC."""
    keys = {raw >> 8 for raw in slot.content}
    return _BY_EVENT if slot.transmit and keys and keys <= {FAULT_CODE, _ERROR_REGISTER} else _SYNCHRONOUS


def _place(
    entries: Mapping[int, Entry],
    slots: Sequence[_Slot],
    groups: Sequence[Sequence[int]],
    *,
    transmit: bool,
) -> list[int]:
    """Put groups of objects into PDOs, each into one of its own where there is one; return what is left.

    An object that a PDO with a fixed mapping carries stays there.
    """
    lacking: list[int] = []
    for group in groups:
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
            if entry is None or not (entry.bits and entry.integer and _mappable(entry, transmit=transmit)):
                lacking.append(key)
                continue
            room = [slot for slot in ([empty] if empty else []) if _room(slot, entry)]
            room += [slot for slot in slots if slot.free and slot.used and _room(slot, entry)]
            if not room:
                lacking.append(key)
                continue
            room[0].content.append(entry.index << 16 | entry.sub << 8 | entry.bits)
            room[0].used = True
    for slot in slots:
        slot.kind = _kind(slot)
    return lacking


def _mappable(entry: Entry, *, transmit: bool) -> bool:
    return entry.maps_transmit if transmit else entry.maps_receive


def _room(slot: _Slot, entry: Entry) -> bool:
    return len(slot.content) < slot.capacity and sum(raw & 0xFF for raw in slot.content) + entry.bits <= 64
