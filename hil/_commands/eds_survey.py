"""`hil eds FILE...`: is the EDS of a device right, and what becomes of it here?"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Final

from fieldbus.errors import ConfigurationError, HilError
from hil._commands.terminal import console, print_json
from hil.errors import CannotRunError

if TYPE_CHECKING:
    from fieldbus.canopen.store import ObjectStore

_ENDINGS: Final = (".eds", ".dcf")
_NODE: Final = 5
_DRIVE: Final = 402
_COUNTS: Final = 4096
"""Increments per revolution where a file leaves them open."""
_PDOS: Final = ((0x1400, 0x1600, True), (0x1800, 0x1A00, False))
_MODES: Final[dict[int, tuple[str, tuple[int, ...]]]] = {
    0: ("pp", (0x607A, 0x6081, 0x6083, 0x6084)),
    1: ("vl", (0x6042, 0x6044)),
    2: ("pv", (0x60FF, 0x606C)),
    3: ("tq", (0x6071, 0x6077)),
    5: ("hm", (0x6098, 0x6099, 0x609A)),
    6: ("ip", (0x60C1, 0x60C2)),
    7: ("csp", (0x607A, 0x6064, 0x60C2)),
    8: ("csv", (0x60FF, 0x606C, 0x60C2)),
    9: ("cst", (0x6071, 0x6077, 0x60C2)),
}
"""Bit of 6502h -> mode and the objects without which it cannot be commanded (C402-042)."""
_COMMAND: Final = (0x6040, 0x6041, 0x6060, 0x6061)


@dataclass(frozen=True)
class Survey:
    """What is to be said of one file."""

    file: str
    refused: str = ""
    """Why it cannot be read; empty: it can."""
    profile: int = 0
    """Low word of 1000h; 0: none."""
    objects: int = 0
    notes: list[str] = field(default_factory=list)
    """What the file says otherwise than the standards, and how it was taken."""
    missing: list[str] = field(default_factory=list)
    """What a CiA 402 drive has to have and the file has not."""
    contradictions: list[str] = field(default_factory=list)
    drive: str = ""
    """What becomes of it as an emulated drive with the controller of the product; empty: it is no drive."""
    works: bool = True
    """The controller commissions the drive and moves it; true for what is no drive."""

    @property
    def good(self) -> bool:
        """Whether the file can be read, lacks nothing and does not contradict itself."""
        return not (self.refused or self.missing or self.contradictions)


def is_survey(names: Sequence[str]) -> bool:
    """Return whether the arguments of `hil eds` are files or folders to look at, not a bench."""
    return bool(names) and all(Path(name).suffix.lower() in _ENDINGS or Path(name).is_dir() for name in names)


def survey_files(names: Sequence[str], *, as_json: bool) -> int:
    """Look at every file and say what was found; returns the exit code: 1 when there is something wrong.

    Args:
        names: EDS and DCF files, and folders with such files at any depth.
        as_json: As JSON.

    Raises:
        CannotRunError: There is no such file.

    """
    found = [_survey(path) for path in _files(names)]
    if as_json:
        print_json({"files": [{**asdict(one), "good": one.good} for one in found], **_counts(found)})
    else:
        out = console()
        for one in found:
            for line in _lines(one):
                out.print(line, markup=False, highlight=False, soft_wrap=True)
        counts = _counts(found)
        out.print(
            f"{counts['readable']} of {len(found)} can be read, {counts['good']} are without a finding; "
            f"{counts['working']} of {counts['drives']} drives are commissioned and moved",
            markup=False,
            highlight=False,
            soft_wrap=True,
        )
    return 0 if all(one.good for one in found) else 1


def _files(names: Sequence[str]) -> list[Path]:
    files: list[Path] = []
    for name in names:
        path = Path(name)
        if path.is_dir():
            files += sorted(
                one for one in path.rglob("*") if one.suffix.lower() in _ENDINGS and one.is_file()
            )
        elif path.exists():
            files.append(path)
        else:
            raise CannotRunError(f"{name}: no such file")
    if not files:
        raise CannotRunError(f"{', '.join(names)}: no EDS or DCF in there")
    return files


def _counts(found: Sequence[Survey]) -> dict[str, int]:
    drives = [one for one in found if one.drive]
    return {
        "readable": sum(not one.refused for one in found),
        "good": sum(one.good for one in found),
        "drives": len(drives),
        "working": sum(one.works for one in drives),
    }


def _lines(one: Survey) -> Iterator[str]:
    if one.refused:
        yield f"{one.file}: refused"
        yield f"    {one.refused}"
        return
    kind = f"profile {one.profile}" if one.profile else "no device profile"
    yield f"{one.file}: {kind}, {one.objects} objects" + (f"; {one.drive}" if one.drive else "")
    for title, texts in (
        ("missing", one.missing),
        ("contradiction", one.contradictions),
        ("note", one.notes),
    ):
        yield from (f"    {title}: {text}" for text in texts)


def _survey(path: Path) -> Survey:
    from fieldbus.canopen import load_dictionary, notes_of
    from fieldbus.canopen.store import ObjectStore

    try:
        dictionary = load_dictionary(path)
        store = ObjectStore(dictionary, _NODE)
        store.predefine(_NODE)
    except ConfigurationError as error:
        return Survey(str(path), refused=str(error).removeprefix(f"{path}: "))
    indices = {entry.index for entry in store.entries.values()}
    profile = _value(store, 0x1000) & 0xFFFF
    is_drive = 0x6040 in indices
    drive, works = _tried(path) if is_drive else ("", True)
    return Survey(
        str(path),
        profile=profile,
        objects=len(indices),
        notes=list(notes_of(dictionary)),
        missing=list(_missing(store, indices)) if is_drive or profile == _DRIVE else [],
        contradictions=list(_contradictions(store, indices)),
        drive=drive,
        works=works,
    )


def _value(store: ObjectStore, index: int, sub: int = 0) -> int:
    """Return the default of a whole number; 0 where there is none."""
    entry = store.entries.get(index << 8 | sub)
    return int(entry.default) if entry is not None and entry.integer else 0


def _missing(store: ObjectStore, indices: set[int]) -> Iterator[str]:
    for index in _COMMAND:
        if index not in indices:
            yield f"{index:04X}h, without which no CiA 402 drive can be commanded"
    supported = _value(store, 0x6502)
    for bit, (mode, needed) in _MODES.items():
        absent = [index for index in needed if index not in indices]
        if supported >> bit & 1 and absent:
            names = ", ".join(f"{index:04X}h" for index in absent)
            yield f"{names}, which mode {mode} (6502h bit {bit}) needs"


def _contradictions(store: ObjectStore, indices: set[int]) -> Iterator[str]:
    from fieldbus.canopen.abort import SdoAbort
    from fieldbus.canopen.pdo_mapping import check_mapping

    for entry in store.entries.values():
        low, high = entry.low, entry.high
        where = f"{entry.index:04X}h:{entry.sub}"
        if low is not None and high is not None and low > high:
            yield f"{where}: the low limit {low} is above the high limit {high}"
        elif entry.given and entry.integer and entry.index >= 0x2000:
            number = int(entry.default)
            if (low is not None and number < low) or (high is not None and number > high):
                limits = f"{'' if low is None else low}..{'' if high is None else high}"
                yield f"{where}: the default {number} is beyond the limits {limits}"
    for communication, mapping, receive in _PDOS:
        for number in range(0x200):
            if communication + number not in indices:
                continue
            name = f"{'R' if receive else 'T'}PDO{number + 1}"
            if mapping + number not in indices:
                yield f"{name}: {communication + number:04X}h has no mapping {mapping + number:04X}h"
                continue
            raw = [
                _value(store, mapping + number, sub) for sub in range(1, _value(store, mapping + number) + 1)
            ]
            if raw and raw[0] and len(raw) <= 64:
                try:
                    check_mapping(store, raw, receive=receive)
                except SdoAbort as reason:
                    shown = ", ".join(f"{value:08X}h" for value in raw)
                    yield f"{name}: the default mapping {shown} is not possible: {reason}"


def _tried(path: Path) -> tuple[str, bool]:
    """Bring the drive up with an axis on a virtual bench and move it a revolution."""
    from emulators.drive.cia402 import CiA402Drive
    from emulators.drive.cia402.vendor_eds import VendorEds
    from hil.bench import BenchFile
    from hil.bench.drive_config import Cia402DriveTable

    try:
        counts = VendorEds(path).increments_per_revolution or _COUNTS
        text = (
            '[bench]\nname = "survey"\n[segment.can0]\n'
            f'[drive.d]\nsegment = "can0"\nnode_id = {_NODE}\neds = {json.dumps(str(path.resolve()))}\n'
            f"increments_per_revolution = {counts}\n"
            '[axis.a]\ndrive = "d"\n[axis.a.variables]\n'
            f'"Sensor[1].Parameter.StepsPerRevolution" = {counts}\n'
            '"Sensor[1].Parameter.FineResolutionXist1" = 0\n'
        )
        with BenchFile(str(path.resolve().with_suffix(".toml")), text).build() as bench:
            axis, drive = bench.axis(), bench.drive()
            assert isinstance(drive, CiA402Drive)
            power = axis.power()
            if not bench.run_until(lambda: bool(power.Status), 2.0):
                return f"as a drive: commissioned, but not enabled ({drive.state.name})", False
            before = drive.mechanics.motor_angle
            job = axis.move_relative(10.0)
            bench.run_until(job.done, 5.0)
            bench.run_for(0.2)
            turned = drive.mechanics.motor_angle - before
            table = bench.config.drive["d"]
            assert isinstance(table, Cia402DriveTable)
            costs = "".join(f"; {text}" for text in table.plan().notes)
            if not job.Done or abs(turned - 2.0 * math.pi) > 0.02:
                return (
                    f"as a drive: enabled, but a move of one revolution turned it by {turned:.3f} rad{costs}",
                    False,
                )
            return f"as a drive: commissioned, enabled and moved{costs}", True
    except HilError as error:
        return f"as a drive: {' '.join(str(error).split())}", False
