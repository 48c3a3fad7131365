"""Reading EDS and DCF files as they come: sections and keys with their lines, and
values by data type (CiA 306).

Vendors' files differ in encoding, case and number format. What can be understood is, with a note
where the file contradicts itself; whatever cannot is refused with file, section and key, because a
default that silently became 0 would be found on the machine only.
"""

from __future__ import annotations

import re
from os import PathLike, fspath
from pathlib import Path
from typing import Final, NoReturn

from fieldbus.canopen.dictionary import (
    INTEGERS,
    OPAQUE_SIZES,
    REALS,
    UNICODE_STRING,
    VISIBLE_STRING,
    Value,
    integer,
    relative,
)
from fieldbus.errors import ConfigurationError

_COMMENT: Final = re.compile(r"\s;.*$")
_HEADER: Final = re.compile(r"\[\s*([^\]]+?)\s*\]\s*([;#].*)?$")
_REMARK: Final = re.compile(r"\s#.*$")
"""Behind a number: `0x09 # Record`."""
_WRAPPED: Final = re.compile(r"""(["']?)([^."']+)(\.0*)?\1""")
"""A whole number in quotes or with a decimal point: `"0x10"`, `1000.0`."""
_DAYS_AND_MS: Final = re.compile(r"(\d+)\s+(\d+)")
_TIME_MS_BITS: Final = 28
_SUFFIX: Final = re.compile(r"(?<=[\d.])[fF]$")
"""Of a real number as C writes it: `0.0f`."""
_HEX_BYTES: Final = re.compile(r"(0[xX])?([0-9A-Fa-f]{2}\s*)*")


class EdsSection:
    """One section; keys are found whatever their case.

    Args:
        file: Name of the file, for messages.
        name: Name of the section as written.
        line: Its line.
        notes: Takes what was understood although the file should say it otherwise.

    """

    __slots__ = ("_file", "_keys", "_notes", "line", "name")

    def __init__(self, file: str, name: str, line: int, notes: list[str]) -> None:
        self._file = file
        self._notes = notes
        self._keys: dict[str, str] = {}
        self.name = name
        self.line = line

    def add(self, key: str, value: str, line: int) -> None:
        """Take a key; of several of the same name the first counts, as for most tools."""
        first = self._keys.setdefault(key.lower(), value)
        if first != value:
            self.note(key, f"line {line} repeats it with {value!r}; {first!r}, which comes first, counts")

    def note(self, key: str, text: str) -> None:
        """Note what was understood although the file should say it otherwise."""
        self._notes.append(f"[{self.name}]" + (f" {key}" if key else "") + f": {text}")

    def items(self) -> dict[str, str]:
        """Return all keys, in lower case, with their values."""
        return self._keys

    def text(self, key: str) -> str:
        """Return a value, empty when it is missing."""
        return self._keys.get(key.lower(), "")

    def required(self, key: str) -> str:
        """Return a value that has to be there."""
        value = self.text(key)
        if not value:
            self.refuse(key, value, "a value; the key is missing or empty")
        return value

    def number(self, key: str, default: int, *, low: int = 0, high: int = 0xFFFFFFFF) -> int:
        """Return a whole number; `default` when it is missing or empty."""
        text = self.text(key)
        if not text:
            return default
        try:
            value = integer(self._plain(key, text))
        except ValueError:
            self.refuse(key, text, "a whole number, decimal or with 0x")
        if not low <= value <= high:
            self.refuse(key, text, f"{low} to {high}")
        return value

    def value(self, key: str, data_type: int, node_id: int | None) -> Value | None:
        """Return a value of an entry.

        Args:
            key: `DefaultValue`, `ParameterValue`, `LowLimit`, `HighLimit`, or a sub-index of a list.
            data_type: CiA 301 type code.
            node_id: What $NODEID stands for; None = a relative value is not calculated.

        Returns:
            None when it is missing, empty, or relative to an unknown node-ID.

        """
        text = self.text(key)
        if not text and data_type != VISIBLE_STRING:
            return None
        if data_type in (VISIBLE_STRING, UNICODE_STRING):
            return text if key.lower() in self._keys else None
        if data_type in REALS:
            return self._real(key, text, data_type)
        if data_type in INTEGERS or data_type in OPAQUE_SIZES:
            return self._whole(key, text, data_type, node_id)
        if _HEX_BYTES.fullmatch(text):
            return bytes.fromhex(text.removeprefix("0x").removeprefix("0X"))
        return text.encode("latin-1", errors="replace")

    def limit(self, key: str, data_type: int, node_id: int | None) -> Value | None:
        """Return a limit of an entry; None, with a note, where it is beyond the type and limits nothing.

        Args:
            key: `LowLimit` or `HighLimit`.
            data_type: CiA 301 type code of a number.
            node_id: See `value`.

        """
        try:
            return self.value(key, data_type, node_id)
        except ConfigurationError:
            text = self.text(key)
            if not _is_whole(text):
                raise
            self.note(key, f"{text} is beyond the data type and limits nothing")
            return None

    def _plain(self, key: str, text: str) -> str:
        """Return a whole number as written, without what tools and people put around it."""
        number, found = _REMARK.subn("", text)
        if found:
            self.note(key, f"{text!r} has a remark; {number!r} counts")
        wrapped = _WRAPPED.fullmatch(number)
        if wrapped is None or wrapped[2] == number:
            return number
        self.note(key, f"{number!r} is no whole number as it should be written; {wrapped[2]} counts")
        return wrapped[2]

    def _real(self, key: str, text: str, data_type: int) -> float:
        bits, coder = REALS[data_type]
        try:
            if text[:2].lower() == "0x":  # the pattern of the number
                return float(coder.unpack(int(text, 16).to_bytes(bits // 8, "little"))[0])
            return float(_SUFFIX.sub("", text.replace(",", ".")))
        except (ValueError, OverflowError):
            self.refuse(key, text, f"a number, or the {bits}-bit pattern of one with 0x")

    def _whole(self, key: str, text: str, data_type: int, node_id: int | None) -> int | None:
        bits = INTEGERS[data_type][0] if data_type in INTEGERS else 8 * OPAQUE_SIZES[data_type]
        signed = data_type in INTEGERS and INTEGERS[data_type][1]
        text = self._plain(key, text)
        moment = _DAYS_AND_MS.fullmatch(text) if data_type in OPAQUE_SIZES else None
        if moment is not None:  # days, and ms of the day in the lower 32 bits (C301-013)
            days, ms = int(moment[1]), int(moment[2])
            if days >> 16 or ms >> _TIME_MS_BITS:
                self.refuse(key, text, "days of 16 bits and ms of 28 bits")
            return days << 32 | ms
        try:
            base = relative(text)
            value = integer(text) if base is None else base + (node_id or 0)
        except ValueError:
            self.refuse(key, text, "a whole number (decimal, 0x, or with $NODEID)")
        low = -(1 << bits - 1) if signed else 0
        if not low <= value < 1 << bits:
            self.refuse(key, text, f"a number of {bits} bit{'s' if bits > 1 else ''}")
        if base is not None and node_id is None:
            return None
        if signed and value >> bits - 1 == 1:
            value -= 1 << bits  # the pattern of a negative number
        return value

    def refuse(self, key: str, value: str, allowed: str) -> NoReturn:
        """Refuse a value of this section.

        Raises:
            ConfigurationError: Always.

        """
        where = f"{self._file}: [{self.name}]" + (f" {key}" if key else "")
        raise ConfigurationError(where, value, allowed) from None


class EdsFile:
    """A file, cut into sections.

    Args:
        path: The file.

    Raises:
        ConfigurationError: It cannot be read, or is not built of sections and keys.

    """

    def __init__(self, path: str | PathLike[str]) -> None:
        self.name = fspath(path)
        self.notes: list[str] = []
        """What was understood although the file should say it otherwise."""
        self.sections: dict[str, EdsSection] = {}
        """By name in lower case, in the order of the file."""
        try:
            content = Path(path).read_bytes()
        except OSError as reason:
            raise ConfigurationError(
                "eds", self.name, "an EDS or DCF", problem=f"cannot be read ({reason.strerror})"
            ) from reason
        self._split(_decode(content))

    def section(self, name: str) -> EdsSection:
        """Return a section; an empty one when there is none."""
        return self.sections.get(name.lower()) or EdsSection(self.name, name, 0, self.notes)

    def _split(self, text: str) -> None:
        section: EdsSection | None = None
        for line, raw in enumerate(text.splitlines(), 1):
            content = raw.strip("\ufeff\0\x1a \t")  # of old systems a file ends with 1Ah
            if not content or content[0] in ";#":
                continue
            if content.startswith("["):
                match = _HEADER.match(content)
                if match is None:
                    self._refuse(line, content, "a well-formed section header, [name]")
                name = match[1]
                section = EdsSection(self.name, name, line, self.notes)
                first = self.sections.setdefault(name.lower(), section)
                if first is not section:
                    section = first
                    section.note("", f"line {line} repeats the section; both count as one")
                continue
            key, equals, value = content.partition("=")
            if not equals:
                self._refuse(line, content, "a well-formed EDS: sections, comments, and lines of key=value")
            if section is None:
                self._refuse(line, content, "a well-formed EDS, which begins with a section")
            section.add(key.strip(), _COMMENT.sub("", " " + value).strip(), line)

    def _refuse(self, line: int, content: str, allowed: str) -> NoReturn:
        raise ConfigurationError(f"{self.name}: line {line}", content, allowed)


def _is_whole(text: str) -> bool:
    try:
        integer(text)
    except ValueError:
        return False
    return True


def _decode(content: bytes) -> str:
    """Return the text: UTF-8 or UTF-16 where it is, else the Windows character set that most tools write."""
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return content.decode("utf-16", errors="replace")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("cp1252", errors="replace")
