"""Retain data: positions of axes over a restart of the system (NC-049 to NC-054)."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Final
from zlib import crc32

from fieldbus.errors import HilError
from motion.nc.encoder import Retained

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

NONE: Final = 0
STORE_ONLY: Final = 1
LOAD_STORE: Final = 2
LOAD_IF_AVAILABLE: Final = 3
"""Index of the texts of `task.retain_data`."""
_HEADER: Final = b"NC retain data 1 crc32 "


class RetainDataError(HilError):
    """Retain data are missing or corrupt; says which of both, and where."""


class StartAbortedError(HilError):
    """The NC did not start, because it has to load retain data that are missing or corrupt (NC-052)."""


class RetainStore:
    """Where retain data are between two runs of the system.

    Args:
        path: File; None: they are kept as long as this object.

    """

    def __init__(self, path: Path | None = None) -> None:
        self._path = path
        self._kept: bytes | None = None

    @property
    def content(self) -> bytes | None:
        """What is stored, as bytes; None: nothing. A test deletes, shortens or changes it."""
        if self._path is None:
            return self._kept
        try:
            return self._path.read_bytes()
        except FileNotFoundError:
            return None

    @content.setter
    def content(self, content: bytes | None) -> None:
        if self._path is None:
            self._kept = content
        elif content is None:
            self._path.unlink(missing_ok=True)
        else:
            self._path.write_bytes(content)

    def write(self, values: Mapping[str, Retained]) -> None:
        """Store the positions of axes by name."""
        rows = {name: {"position": one.position, "raw": one.raw} for name, one in values.items()}
        body = json.dumps(rows, sort_keys=True, indent=1).encode()
        self.content = _HEADER + f"{crc32(body):08x}\n".encode() + body

    def read(self) -> dict[str, Retained]:
        """Return the stored positions by name of the axis.

        Raises:
            RetainDataError: They are missing or corrupt.

        """
        content = self.content
        place = "retain data" if self._path is None else f"retain data {self._path}"
        if content is None:
            raise RetainDataError(f"{place}: missing")
        header, newline, body = content.partition(b"\n")
        if not newline or header != _HEADER + f"{crc32(body):08x}".encode():
            raise RetainDataError(f"{place}: corrupt, the checksum is wrong")
        try:
            rows = json.loads(body)
            return {name: Retained(float(row["position"]), int(row["raw"])) for name, row in rows.items()}
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise RetainDataError(f"{place}: corrupt, {error}") from None
