"""Non-volatile memory of a device in a file, so that it survives the process
(C301-018, C301-140, C301-158).
"""

from __future__ import annotations

import hashlib
import json
import os
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

from fieldbus.canopen.abort import SdoAbort
from fieldbus.canopen.dictionary import Value
from fieldbus.canopen.lss import LssSettings, LssSlave
from fieldbus.canopen.nmt import UNCONFIGURED
from fieldbus.canopen.store import ObjectStore
from fieldbus.errors import ConfigurationError, HilError

FORMAT: Final = 1


class MemoryFailureError(HilError):
    """The file could not be written; the device answers with a hardware error."""


class ParameterFile:
    """A file with the stored parameters of one device: JSON, protected by a checksum, replaced as a whole.

    Args:
        path: The file; it need not exist yet, its folder has to.

    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)

    def load(self, store: ObjectStore, lss: LssSlave) -> None:
        """Take over what the file holds; a file that does not exist is an empty memory.

        Raises:
            ConfigurationError: The file cannot be read, is damaged, belongs to another device, or its
                folder is missing.

        """
        try:
            text = self.path.read_text(encoding="utf-8")
        except FileNotFoundError:
            if not self.path.absolute().parent.is_dir():
                raise self._refuse("a file in an existing folder") from None
            return
        except (OSError, UnicodeDecodeError) as error:
            raise self._refuse(f"a readable file of stored parameters ({error})") from None
        try:
            content = json.loads(text)
            body = content["memory"]
            if content["format"] != FORMAT:
                raise self._refuse(f"a file of format {FORMAT}, not {content['format']!r}")
            if content["sha256"] != _digest(body):
                raise self._refuse(
                    "an undamaged file (its checksum is wrong); remove it for factory settings"
                )
            if body["device"] != _identity(store):
                raise self._refuse(
                    f"the memory of this device (vendor, product {_identity(store)}), not of {body['device']}"
                )
            values = {_key(name): value for name, value in body["values"].items()}
            store.stored = {key: self._value(store, key, value) for key, value in values.items()}
            store.restoring = {int(area): bool(soon) for area, soon in body["restore"].items()}
            store.extra = dict(body.get("extra", {}))
            node_id, bitrate = body["lss"]["node_id"], body["lss"]["bitrate"]
            if node_id is not None and not (1 <= int(node_id) <= 127 or node_id == UNCONFIGURED):
                raise self._refuse(f"a file with a node-ID of 1 to 127, not {node_id}")
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise self._refuse(f"a file of stored parameters ({type(error).__name__}: {error})") from None
        if node_id is not None:
            lss.stored = LssSettings(int(node_id), None if bitrate is None else int(bitrate))
            lss.settings_stored = True

    def save(self, store: ObjectStore, lss: LssSlave) -> None:
        """Replace the file; a crash in between leaves the old one.

        Raises:
            MemoryFailureError: It cannot be written.

        """
        body: dict[str, Any] = {
            "device": _identity(store),
            "lss": {
                "node_id": lss.stored.node_id if lss.settings_stored else None,
                "bitrate": lss.stored.bitrate,
            },
            "restore": {str(area): soon for area, soon in sorted(store.restoring.items())},
            "values": {
                f"{key >> 8:04X}:{key & 0xFF:02X}": store.entries[key].encode(value).hex()
                for key, value in sorted(store.stored.items())
            },
        }
        if store.extra:
            body["extra"] = store.extra
        text = json.dumps({"format": FORMAT, "sha256": _digest(body), "memory": body}, indent=1)
        draft = self.path.with_name(f".{self.path.name}.{os.getpid()}")
        try:
            with draft.open("w", encoding="utf-8") as file:
                file.write(text + "\n")
                file.flush()
                os.fsync(file.fileno())
            draft.replace(self.path)
        except OSError as error:
            with suppress(OSError):
                draft.unlink()
            raise MemoryFailureError(f"{self.path}: cannot be written ({error.strerror})") from error

    def _value(self, store: ObjectStore, key: int, text: Any) -> Value:
        entry = store.entries.get(key)
        if entry is None:
            raise self._refuse(f"a memory that fits the EDS, which has no {key >> 8:04X}h:{key & 0xFF}")
        try:
            return entry.decode(bytes.fromhex(text))
        except SdoAbort as reason:
            raise self._refuse(
                f"a memory that fits the EDS; {key >> 8:04X}h:{key & 0xFF}: {reason}"
            ) from None

    def _refuse(self, allowed: str) -> ConfigurationError:
        return ConfigurationError("storage", str(self.path), allowed)


def _identity(store: ObjectStore) -> list[int]:
    """Return vendor-ID and product code: what a memory may not be exchanged between."""
    return [store.entries[key].default if key in store.entries else 0 for key in (0x101801, 0x101802)]  # type: ignore[misc]


def _digest(body: Any) -> str:
    return hashlib.sha256(json.dumps(body, sort_keys=True).encode()).hexdigest()


def _key(name: str) -> int:
    index, _, sub = name.partition(":")
    return int(index, 16) << 8 | int(sub, 16)
