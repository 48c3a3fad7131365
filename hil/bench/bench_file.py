"""Reading a bench file: every mistake is reported with the file, the key, the value and what is allowed."""

from __future__ import annotations

import hashlib
from importlib.resources import files
from pathlib import Path
from typing import Any, Final

from pydantic import ValidationError

from fieldbus.errors import ConfigurationError
from fieldbus.toml_text import TomlError, parsed_toml
from hil.bench._agreement import disagreements
from hil.bench._messages import messages
from hil.bench.config import BenchConfig

EMBEDDED: Final = (
    "reference",
    "speed",
    "fast",
    "live",
    "profidrive",
    "profidrive_tcp",
    "profidrive_rtu",
    "analog",
    "stepper",
    "synchronous",
    "flying_shear",
    "rotary_knife",
    "winder",
    "line_shaft",
)
"""Benches that ship with the product, usable by name."""
_ANCHORED: Final = {
    "drive": ("eds", "storage", "map"),
    "device": ("eds", "storage"),
    "cam": ("points_file",),
}
"""Keys of tables by name that may be files relative to the bench file."""
_NAMED: Final = (
    "segment",
    "drive",
    "encoder",
    "device",
    "station",
    "axis",
    "external_encoder",
    "cam",
    "controller",
    "proxy",
)
"""Tables by name."""


def _anchor_files(data: dict[str, Any], folder: Path) -> None:
    """Make the names of files relative to the folder of the bench file; what is
    no text is left to the checks.
    """
    bench = data.get("bench")
    if isinstance(bench, dict):
        _anchor(bench, "memory_card", folder)
    nc = data.get("nc")
    if isinstance(nc, dict):
        _anchor(nc, "retain_file", folder)
    for kind, keys in _ANCHORED.items():
        tables = data.get(kind)
        for table in tables.values() if isinstance(tables, dict) else ():
            for key in keys if isinstance(table, dict) else ():
                _anchor(table, key, folder)


def _anchor(table: dict[str, Any], key: str, folder: Path) -> None:
    value = table.get(key)
    if isinstance(value, str) and value and (key != "map" or value.endswith(".toml")):
        table[key] = str(folder / value)


class BenchFileError(ConfigurationError):
    """The bench file cannot be used; the message lists every mistake with file,
    key, value and what is allowed.
    """

    def __init__(self, source: str, message: str) -> None:
        super(ConfigurationError, self).__init__(message)
        self.where = source
        self.value = None
        self.allowed = ""


def parse(text: str, source: str) -> BenchConfig:
    """Return the validated content of a bench file.

    Args:
        text: The file's content.
        source: Its name, for messages.

    Raises:
        BenchFileError: It is no TOML, or a value is wrong.

    """
    try:
        data = parsed_toml(source, text)
    except TomlError as error:
        raise BenchFileError(source, str(error)) from None
    _anchor_files(data, Path(source).parent)
    context = {"folder": Path(source).parent if source not in EMBEDDED else None}
    try:
        config = BenchConfig.model_validate(data, context=context)
    except ValidationError as error:
        lines = messages(BenchConfig, source, error)
        lines += [f"{source}: {text}" for text in _of_the_rest(data, error, context)]
        raise BenchFileError(source, "\n".join(lines)) from None
    if mistakes := disagreements(config):
        raise BenchFileError(source, "\n".join(f"{source}: {text}" for text in mistakes))
    return config


def _of_the_rest(data: dict[str, Any], error: ValidationError, context: dict[str, Path | None]) -> list[str]:
    """Return what tables without a mistake of their own say of each other that cannot be right; nothing where
    the mistakes are not in tables by name.
    """
    wrong = {problem["loc"][:2] for problem in error.errors()}
    if any(len(place) < 2 or place[0] not in _NAMED for place in wrong):
        return []
    right = {
        kind: {name: table for name, table in tables.items() if (kind, name) not in wrong}
        if kind in _NAMED
        else tables
        for kind, tables in data.items()
    }
    try:
        config = BenchConfig.model_validate(right, context=context)
    except ValidationError:
        return []
    return disagreements(config, {".".join(map(str, place)) for place in wrong})


def read(path: str | Path | None) -> tuple[str, str]:
    """Return (source name, text) of a bench file, an embedded bench by name, or the reference bench for None.

    Raises:
        BenchFileError: There is no such file or embedded bench.

    """
    name = "reference" if path is None or path == "" else str(path)
    if name in EMBEDDED:
        return name, (files("hil.bench") / "data" / f"{name}.toml").read_text(encoding="utf-8")
    file = Path(name)
    try:
        return name, file.read_text(encoding="utf-8")
    except OSError as error:
        raise BenchFileError(
            name, f"{name}: cannot be read ({error.strerror}); embedded benches are: {', '.join(EMBEDDED)}"
        ) from None
    except UnicodeDecodeError:
        raise BenchFileError(name, f"{name}: this is not UTF-8 text") from None


def digest(text: str, config: BenchConfig | None = None) -> str:
    """Return the SHA-256 of a bench file's text, hexadecimal; of the EDS files that it names, too."""
    total = hashlib.sha256(text.encode())
    for path in [] if config is None else config.source_files:
        total.update(path.read_bytes())
    return total.hexdigest()
