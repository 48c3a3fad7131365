"""EDS files of CiA 402 drives that differ from each other, and benches with one."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from hil.bench import BenchFile
from hil.bench.drive_config import Cia402DriveTable
from hil.errors import BlockedError

COUNTS: Final = 4000
NODE: Final = 5
NAMES: Final[dict[int, tuple[int, Any]]] = {
    0x1000: (7, "0x00020192"), 0x1001: (5, 0), 0x1005: (7, "0x80"), 0x1006: (7, 0), 0x1017: (6, 0),
    0x100C: (6, 0), 0x100D: (5, 0), 0x1014: (7, "$NODEID+0x80"), 0x603F: (6, 0), 0x6007: (3, 0),
    0x6040: (6, 0), 0x6041: (6, 0), 0x6060: (2, 0), 0x6061: (2, 0), 0x6064: (4, 0), 0x606C: (4, 0),
    0x6077: (3, 0), 0x607A: (4, 0), 0x607F: (7, 5000), 0x6080: (7, 5000), 0x6083: (7, 90000),
    0x6084: (7, 90000), 0x6085: (7, 90000), 0x60A9: (7, "0x00B44700"), 0x60FD: (7, 0), 0x60FF: (4, 0),
    0x6502: (7, "0x3EF"),
}  # fmt: skip


def drive_eds(
    *,
    without: Collection[int] = (),
    changed: Mapping[int, Any] | Iterable[tuple[int, Any]] = (),
    fixed: Collection[int] = (),
    records: Mapping[int, Sequence[int]] | None = None,
    count: int = 4,
    read_only: Collection[int] = (),
    fixed_ids: Collection[int] = (),
    more: str = "",
    limits: Mapping[int, tuple[int, int]] | Iterable[tuple[int, tuple[int, int]]] = (),
    encoder: Sequence[int] = (COUNTS, 1),
) -> str:
    """Return the EDS of a drive.

    Args:
        without: Objects that it lacks.
        changed: Index -> default.
        fixed: Communication records whose PDOs cannot be changed.
        records: Mapping record -> its default mapping.
        count: PDOs of each direction.
        read_only: Objects that cannot be written.
        fixed_ids: Communication records whose identifier alone cannot be written.
        more: Other sections.
        limits: Index -> lowest and highest value.
        encoder: 608Fh.

    """
    records, changed, limits = records or {}, dict(changed), dict(limits)
    text = "[DeviceInfo]\nVendorName=Plans\n\n"
    for index, (kind, default) in NAMES.items():
        if index not in without:
            access = "ro" if index in read_only else "rw"
            text += (
                f"[{index:04X}]\nParameterName=Object {index:04X}\nDataType={kind}\nAccessType={access}\n"
                f"PDOMapping=1\nDefaultValue={changed.get(index, default)}\n\n"
            )
        if index in limits:
            low, high = limits[index]
            text = f"{text.rstrip()}\nLowLimit={low}\nHighLimit={high}\n\n"
    if 0x60C1 not in without:
        text += members(0x60C1, 4, [0], access="rw")
    text += members(0x608F, 7, encoder, access="ro" if 0x608F in read_only else "rw")
    if 0x60C2 not in without:
        text += members(0x60C2, 5, [4], access="rw").replace("SubNumber=2", "SubNumber=3") + (
            "[60C2sub2]\nParameterName=Index\nDataType=2\nAccessType=rw\nPDOMapping=0\nDefaultValue=-3\n\n"
        )
    for number in range(count):
        for communication, mapping, cob in ((0x1400, 0x1600, 0x200), (0x1800, 0x1A00, 0x180)):
            access = "const" if communication + number in fixed else "rw"
            default = records.get(mapping + number, [])
            cob_id = f"$NODEID+0x{cob + 0x100 * number:X}"
            record = members(communication + number, 7, [cob_id, 1], access=access, kinds=(7, 5))
            if communication + number in fixed_ids:
                record = record.replace("DataType=7\nAccessType=rw", "DataType=7\nAccessType=ro")
            text += record
            entries = [*default, *[0] * ((len(default) if access == "const" else 4) - len(default))]
            text += members(mapping + number, 7, entries, access=access, length=len(default))
    return text + more


def members(
    index: int,
    kind: int,
    values: Sequence[Any],
    *,
    access: str,
    kinds: Sequence[int] = (),
    length: int | None = None,
) -> str:
    """Return the sections of a record or array."""
    text = f"[{index:04X}]\nParameterName=Record {index:04X}\nObjectType=9\nSubNumber={len(values) + 1}\n\n"
    text += (
        f"[{index:04X}sub0]\nParameterName=Count\nDataType=5\nAccessType={access}\nPDOMapping=0\n"
        f"DefaultValue={len(values) if length is None else length}\n\n"
    )
    for sub, value in enumerate(values, 1):
        one = kinds[sub - 1] if kinds else kind
        text += (
            f"[{index:04X}sub{sub:X}]\nParameterName=Sub {sub}\nDataType={one}\nAccessType={access}\n"
            f"PDOMapping=1\nDefaultValue={value}\n\n"
        )
    return text


def bench_of(folder: Path, eds: str, keys: str = "") -> BenchFile:
    """Return a bench with an axis behind a drive of an EDS, which is written into a folder."""
    (folder / "plan.eds").write_text(eds)
    return BenchFile(
        str(folder / "bench.toml"),
        '[bench]\nname = "plan"\n[segment.can0]\n[drive.d]\nsegment = "can0"\n'
        f'node_id = {NODE}\neds = "plan.eds"\n{keys}'
        '[axis.a]\ndrive = "d"\n[axis.a.variables]\n'
        f'"Sensor[1].Parameter.StepsPerRevolution" = {COUNTS}\n'
        '"Sensor[1].Parameter.FineResolutionXist1" = 0\n',
    )


def built(file: BenchFile) -> Any:
    """Return the started bench; one that cannot be used is a failure here, and no reason to skip."""
    try:
        return file.build()
    except BlockedError as error:
        raise AssertionError(str(error)) from error


def plan_of(file: BenchFile) -> Any:
    """Return how the controller uses the drive."""
    table = file.config.drive["d"]
    assert isinstance(table, Cia402DriveTable)
    return table.plan()
