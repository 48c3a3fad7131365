"""Personalities: how a family of drives differs from the profile, as a data file.

A personality is a TOML file. Those that come with the product are in the folder `personalities/`
and are chosen by name; a path chooses a file of your own:

    name = "my-drive"
    summary = "One line for people."

    [quirks]                  # fields of `Quirks`
    single_setpoint = true

    [drive]                   # home_offset, self_test_s
    home_offset = "vendor"

    [objects]                 # other defaults of objects, "INDEX:SUB" hexadecimal
    "1800:2" = 1

    [refusals]                # entries that take no value, whatever the EDS says, with the SDO abort code
    "1A02:3" = 0x06040041

    [emcy.8611]               # instead of this EMCY code of the profile
    code = 0x8611
    data = "0200"

    [sources]                 # where each deviation is documented: "quirks.single_setpoint", "emcy", ...
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cache
from pathlib import Path
from typing import Any, Final

from emulators.drive.cia402.config import DriveConfig
from emulators.drive.cia402.quirks import EmcyCode, Quirks
from fieldbus.errors import ConfigurationError
from fieldbus.toml_text import parsed_toml

FOLDER: Final = Path(__file__).with_name("personalities")
"""Where the personalities of the product stand."""

_TABLES: Final = ("name", "summary", "quirks", "drive", "objects", "refusals", "emcy", "sources")
_DRIVE_KEYS: Final[Mapping[str, type | tuple[type, ...]]] = {
    "home_offset": str,
    "self_test_s": (int, float),
}


@dataclass(frozen=True, kw_only=True)
class Personality:
    """A family of drives.

    Args:
        name: Lower-case words with hyphens.
        summary: One line for people.
        quirks: Deviations in behaviour.
        drive: Fields of `DriveConfig` that it sets.
        objects: Other defaults of objects, by (index, sub-index).
        refusals: SDO abort codes of entries that take no value, by (index, sub-index).
        emcy: What is sent instead of an EMCY code of the profile.
        sources: Where each deviation is documented, by "quirks.NAME", "drive.NAME", "objects", "refusals",
            "emcy".

    """

    name: str
    summary: str
    quirks: Quirks = field(default_factory=Quirks)
    drive: Mapping[str, Any] = field(default_factory=dict)
    objects: Mapping[tuple[int, int], int] = field(default_factory=dict)
    refusals: Mapping[tuple[int, int], int] = field(default_factory=dict)
    emcy: Mapping[int, EmcyCode] = field(default_factory=dict)
    sources: Mapping[str, str] = field(default_factory=dict)

    @property
    def deviations(self) -> tuple[str, ...]:
        """Names under which `sources` says where a deviation is documented."""
        standard = Quirks()
        return (
            *(
                f"quirks.{one.name}"
                for one in fields(Quirks)
                if getattr(self.quirks, one.name) != getattr(standard, one.name)
            ),
            *(f"drive.{name}" for name in self.drive),
            *(["objects"] if self.objects else []),
            *(["refusals"] if self.refusals else []),
            *(["emcy"] if self.emcy else []),
        )

    def apply(self, config: DriveConfig) -> DriveConfig:
        """Return `config` with this personality; what `config` says itself of objects and home offset wins.

        Raises:
            ConfigurationError: A value does not fit the drive.

        """
        changes = dict(self.drive)
        offset = changes.pop("home_offset", None)
        if offset not in (None, "profile", "vendor"):
            raise ConfigurationError("drive.home_offset", offset, "profile, vendor")
        if offset is not None and config.homing.offset is None:
            changes["homing"] = replace(config.homing, offset=offset)
        return replace(
            config,
            personality=self.name,
            quirks=self.quirks,
            emcy=self.emcy,
            objects={**self.objects, **config.objects},
            refusals=self.refusals,
            **changes,
        )


def personality_names() -> tuple[str, ...]:
    """Return the names of the personalities that come with the product."""
    return tuple(sorted(file.stem for file in FOLDER.glob("*.toml")))


def load_personality(reference: str | Path) -> Personality:
    """Return a personality by name, or from a file.

    Args:
        reference: A name of `personality_names`, or a path that ends in `.toml`.

    Raises:
        ConfigurationError: There is none, or its content is not usable; the message says where and what
            is allowed.

    """
    text = str(reference)
    if text.endswith(".toml"):
        return _load(Path(text))
    return _shipped(text)


@cache
def _shipped(name: str) -> Personality:
    """Return a personality of the product; its file does not change while it
    runs, and every bench asks for it.
    """
    if name not in personality_names():
        raise ConfigurationError("personality", name, f"{', '.join(personality_names())}, or a file *.toml")
    return _load(FOLDER / f"{name}.toml")


def _load(file: Path) -> Personality:
    text = str(file)
    try:
        content = parsed_toml(f"personality: {file.name}", file.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigurationError("personality", text, f"a readable file ({error.strerror})") from None
    except UnicodeDecodeError as error:
        raise ConfigurationError("personality", text, f"TOML ({error})") from None
    return _parse(content, file.name)


def _parse(content: Mapping[str, Any], where: str) -> Personality:
    for key in content:
        if key not in _TABLES:
            raise ConfigurationError(f"{where}: {key}", content[key], ", ".join(_TABLES))
    for key in ("name", "summary"):
        if not isinstance(content.get(key), str) or not content[key]:
            raise ConfigurationError(f"{where}: {key}", content.get(key), "a text")
    if not re.fullmatch(r"[a-z0-9]+(-[a-z0-9]+)*", content["name"]):
        raise ConfigurationError(f"{where}: name", content["name"], "lower-case words with hyphens")
    for key in _TABLES[2:]:
        if not isinstance(content.get(key, {}), Mapping):
            raise ConfigurationError(f"{where}: {key}", content[key], "a table")
    personality = Personality(
        name=content["name"],
        summary=content["summary"],
        quirks=_quirks(content.get("quirks", {}), where),
        drive=_drive(content.get("drive", {}), where),
        objects=_objects(content.get("objects", {}), f"{where}: objects"),
        refusals=_refusals(content.get("refusals", {}), f"{where}: refusals"),
        emcy=_emcy(content.get("emcy", {}), where),
        sources=_sources(content.get("sources", {}), where),
    )
    for name in personality.sources:
        if name not in personality.deviations:
            raise ConfigurationError(
                f"{where}: sources",
                name,
                ", ".join(personality.deviations) or "nothing: there is no deviation",
            )
    personality.apply(DriveConfig())
    return personality


def _quirks(table: Mapping[str, Any], where: str) -> Quirks:
    known = {one.name: getattr(Quirks(), one.name) for one in fields(Quirks)}
    for name, value in table.items():
        if name not in known:
            raise ConfigurationError(f"{where}: quirks.{name}", value, ", ".join(known))
        default = known[name]
        number = isinstance(value, (int, float)) and not isinstance(value, bool)
        good = (
            isinstance(value, bool)
            if isinstance(default, bool)
            else number
            if isinstance(default, float)
            else number and isinstance(value, int)
        )
        if not good:
            raise ConfigurationError(f"{where}: quirks.{name}", value, f"a value like {default!r}")
    try:
        return Quirks(**table)
    except ConfigurationError as error:
        raise ConfigurationError(f"{where}: quirks.{error.where}", error.value, error.allowed) from None


def _drive(table: Mapping[str, Any], where: str) -> dict[str, Any]:
    for name, value in table.items():
        kind = _DRIVE_KEYS.get(name)
        if kind is None:
            raise ConfigurationError(f"{where}: drive.{name}", value, ", ".join(_DRIVE_KEYS))
        if not isinstance(value, kind) or (kind is not bool and isinstance(value, bool)):
            raise ConfigurationError(f"{where}: drive.{name}", value, "a value of another type")
    return dict(table)


def _objects(table: Mapping[str, Any], where: str) -> dict[tuple[int, int], int]:
    objects = {}
    for key, value in table.items():
        match = re.fullmatch(r"([0-9A-Fa-f]{4}):([0-9A-Fa-f]{1,2})", key)
        if match is None:
            raise ConfigurationError(where, key, 'keys like "1800:2", hexadecimal')
        if not isinstance(value, int) or isinstance(value, bool):
            raise ConfigurationError(f"{where}.{key}", value, "a whole number")
        objects[int(match[1], 16), int(match[2], 16)] = value
    return objects


def _refusals(table: Mapping[str, Any], where: str) -> dict[tuple[int, int], int]:
    codes = _objects(table, where)
    for (index, sub), code in codes.items():
        if not 0x05000000 <= code <= 0x08FFFFFF:
            raise ConfigurationError(
                f"{where}.{index:04X}:{sub:X}", f"{code:08X}h", "an SDO abort code, 05000000h to 08FFFFFFh"
            )
    return codes


def _emcy(table: Mapping[str, Any], where: str) -> dict[int, EmcyCode]:
    codes = {}
    for key, entry in table.items():
        place = f"{where}: emcy.{key}"
        if not re.fullmatch(r"[0-9A-Fa-f]{4}", key) or not int(key, 16):
            raise ConfigurationError(place, key, "an EMCY code of the profile, four hexadecimal digits")
        if not isinstance(entry, Mapping) or set(entry) - {"code", "register", "data"}:
            raise ConfigurationError(place, entry, "a table with code, register, data")
        code, register, data = entry.get("code", int(key, 16)), entry.get("register"), entry.get("data", "")
        if not isinstance(code, int) or not isinstance(register, int | None) or not isinstance(data, str):
            raise ConfigurationError(place, dict(entry), "code and register numbers, data hexadecimal text")
        try:
            codes[int(key, 16)] = EmcyCode(code=code, register=register, data=bytes.fromhex(data))
        except ValueError:
            raise ConfigurationError(f"{place}.data", data, "hexadecimal text") from None
        except ConfigurationError as error:
            raise ConfigurationError(f"{place}: {error.where}", error.value, error.allowed) from None
    return codes


def _sources(table: Mapping[str, Any], where: str) -> dict[str, str]:
    for name, text in table.items():
        if not isinstance(text, str) or not text:
            raise ConfigurationError(f"{where}: sources.{name}", text, "a text")
    return dict(table)
