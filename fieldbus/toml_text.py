"""Reading TOML of a user, with advice on what cannot be read, and on numbers that are written as texts."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any, Final

from fieldbus.errors import ConfigurationError

_COMMA: Final = re.compile(r"([^\s={\[,#][^={\[,#]*?)\s*=\s*([+-]?\d+),(\d+)")
"""`key = 4,5`, also within an inline table."""
_NUMBER: Final = re.compile(r"\s*([+-]?\d+)(?:[.,](\d+))?\s*")
_BRACKETS: Final = re.compile(r"\s*(\w+\[\d+\][\w.]*)\s*=")


class TomlError(ConfigurationError):
    """A file is no TOML; the message has file, line and remedy, where the reason is known."""

    def __init__(self, where: str, message: str) -> None:
        super(ConfigurationError, self).__init__(f"{where}: {message}")
        self.where = where
        self.value = None
        self.allowed = "TOML"


def toml_content(path: Path) -> dict[str, Any]:
    """Return the content of a TOML file.

    Raises:
        ConfigurationError: It cannot be read, or is no TOML.

    """
    try:
        return parsed_toml(str(path), path.read_text(encoding="utf-8"))
    except OSError as error:
        raise TomlError(str(path), f"cannot be read ({error.strerror})") from None
    except UnicodeDecodeError:
        raise TomlError(str(path), "this is not UTF-8 text") from None


def parsed_toml(where: str, text: str) -> dict[str, Any]:
    """Return the content of a text in TOML.

    Args:
        where: File, for the message.
        text: The text.

    Raises:
        TomlError: It is no TOML.

    """
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise TomlError(where, _reason(text, error)) from None


def _reason(text: str, error: tomllib.TOMLDecodeError) -> str:
    found = re.search(r"at line (\d+)", str(error))
    line = text.splitlines()[int(found[1]) - 1] if found is not None else ""
    if comma := _COMMA.search(line):
        key, whole, decimals = comma.groups()
        return (
            f"line {found[1] if found else 1}: {key}: {whole},{decimals} is not allowed; "
            f"allowed: a number with a decimal point: {key} = {whole}.{decimals}"
        )
    path = _BRACKETS.match(line)
    hint = f'; quote the path: "{path[1]}"' if path is not None else ""
    return f"this is not valid TOML: {error}{hint}"


def number_hint(value: object) -> str:
    """Return how to write a number that stands in a text: `: 4.5, without quotes`; empty: there is none."""
    found = _NUMBER.fullmatch(value) if isinstance(value, str) else None
    if found is None:
        return ""
    return f": {found[1]}{f'.{found[2]}' if found[2] else ''}, without quotes"
