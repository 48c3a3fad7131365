"""`[device.NAME]` of the bench file, and the files that drives and devices name."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from hil.bench.modbus_config import anchor_map

if TYPE_CHECKING:
    from hil.bench.config import BenchConfig


class DeviceSection(BaseModel):
    """`[device.NAME]`: an emulated CANopen device of any kind, made of its EDS."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    segment: str
    node_id: Annotated[int, Field(ge=1, le=126)]
    eds: Annotated[str, Field(min_length=1)]
    """EDS or DCF file, relative to the bench file."""
    storage: str | None = None
    """File of its stored parameters, relative to the bench file; None = no file."""

    @property
    def device(self) -> Literal["emulated"]:
        """What a drive's section says with this key."""
        return "emulated"

    @property
    def profile(self) -> str:
        """What it is, in words."""
        return self.eds


def check_devices(config: BenchConfig) -> None:
    """Check what devices say of other tables, and that no two devices share a memory.

    Raises:
        ValueError: With the place, the value and what is allowed.

    """
    owners = {
        **{(drive.segment, drive.node_id): f"drive.{name}" for name, drive in config.drive.items()},
        **{(encoder.segment, encoder.node_id): f"encoder.{name}" for name, encoder in config.encoder.items()},
    }
    tables: tuple[tuple[str, Any], ...] = (
        ("segment", config.segment),
        ("drive", config.drive),
        ("encoder", config.encoder),
        ("axis", config.axis),
    )
    files: dict[str, str] = {}
    for name, drive in config.drive.items():
        _own_file(files, f"drive.{name}", drive.storage)
    for name, device in config.device.items():
        where = f"device.{name}"
        if "." in name or not name.strip():
            raise ValueError(f"device.{name!r}: a name is not empty and has no dot; signals are NAME.COLUMN")
        for kind, names in tables:
            if name in names:
                raise ValueError(f"{where}: a {kind} has this name already; signals are told apart by it")
        if device.segment not in config.segment:
            raise ValueError(
                f"{where}.segment: {device.segment!r} is not a segment; there are: "
                f"{', '.join(config.segment)}"
            )
        owner = owners.setdefault((device.segment, device.node_id), where)
        if owner != where:
            raise ValueError(f"{where}.node_id: {device.node_id} is already taken by {owner}")
        _own_file(files, where, device.storage)


def _own_file(files: dict[str, str], where: str, storage: str | None) -> None:
    if storage is not None and files.setdefault(storage, where) != where:
        raise ValueError(f"{where}.storage: {storage!r} is already the file of {files[storage]}")


def anchor_files(data: dict[str, Any], folder: Path) -> None:
    """Make the names of files relative to the folder of the bench file; what is no text is left to the
    checks.
    """
    bench = data.get("bench")
    if isinstance(bench, dict) and isinstance(bench.get("memory_card"), str) and bench["memory_card"]:
        bench["memory_card"] = str(folder / bench["memory_card"])
    for kind in ("drive", "device"):
        sections = data.get(kind)
        for section in sections.values() if isinstance(sections, dict) else ():
            for key in ("eds", "storage"):
                if isinstance(section, dict) and isinstance(section.get(key), str) and section[key]:
                    section[key] = str(folder / section[key])
            if isinstance(section, dict) and kind == "drive":
                anchor_map(section, folder)


def eds_files(config: BenchConfig) -> list[Path]:
    """Return the EDS files and register maps that a bench is made of, as far as they are there."""
    names = [drive.eds for drive in config.drive.values()]
    names += [drive.map for drive in config.drive.values() if drive.map.endswith(".toml")]
    names += [device.eds for device in config.device.values()]
    return [Path(name) for name in names if name is not None and Path(name).is_file()]
