"""The controller's memory card: adjustment data of absolute encoders outlive the controller (HOM-158 to
HOM-162, MC-465 to MC-472).
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final, TypedDict

from motion.kernel.mechanics import INCREMENTAL
from motion.s7.axis.jobs import ERROR_CARD_FULL, ERROR_CARD_PROTECTED, ERROR_CARD_WRITE

if TYPE_CHECKING:
    from fieldbus.history import History, Scalar
    from motion.s7.axis import TechnologyAxis
    from motion.s7.axis.external_encoder import ExternalEncoder

FOLDER: Final = "UserFiles"
FILE: Final = "AbsEncoderData.dat"
USED: Final = "AbsEncoderData.bak"

_OFFSET: Final = "AbsEncoderOffset"
_CODES: Final = {
    errno.ENOSPC: ERROR_CARD_FULL,
    errno.EDQUOT: ERROR_CARD_FULL,
    errno.EROFS: ERROR_CARD_PROTECTED,
    errno.EACCES: ERROR_CARD_PROTECTED,
    errno.EPERM: ERROR_CARD_PROTECTED,
}


class MemoryCard:
    """A card, which is a folder.

    Args:
        folder: Root of the card; made with the first save.
        history: Log that serves as diagnostic buffer; None for none.

    """

    def __init__(self, folder: Path, history: History | None = None) -> None:
        self.folder = folder
        self._history = history

    @property
    def file(self) -> Path:
        """Where the adjustment data are."""
        return self.folder / FOLDER / FILE

    def save(self, objects: Sequence[TechnologyAxis | ExternalEncoder]) -> int:
        """Write the adjustment of all absolute encoders; returns 0, or the
        ErrorID of what went wrong (HOM-204).
        """
        content = _content(objects)
        text = json.dumps({"sha256": _checksum(content), **content}, indent=1, sort_keys=True)
        draft = self.file.with_suffix(".tmp")
        try:
            self.file.parent.mkdir(parents=True, exist_ok=True)
            with draft.open("w", encoding="utf-8") as stream:
                stream.write(text)
                stream.flush()
                os.fsync(stream.fileno())
            draft.replace(self.file)  # whole, or not at all
        except OSError as error:
            return _CODES.get(error.errno or 0, ERROR_CARD_WRITE)
        self._tell("controller.encoder_data_saved", objects=len(content["objects"]))
        return 0

    def restore(self, objects: Sequence[TechnologyAxis | ExternalEncoder]) -> bool:
        """Give the adjustments back to a controller that has none; says whether it has happened.

        Nothing is restored, and an entry of the log says why, if the data are damaged or belong
        to other objects or encoders (HOM-159, HOM-162). Afterwards the file is renamed and
        cannot be used again (HOM-160).
        """
        try:
            text = self.file.read_text(encoding="utf-8")
        except FileNotFoundError:
            return False
        except (OSError, UnicodeDecodeError) as error:
            return self._refuse(f"{FILE} cannot be read: {error}")
        try:
            saved = json.loads(text)
            expected = saved.pop("sha256")
        except (ValueError, KeyError, AttributeError, TypeError):
            return self._refuse(f"{FILE} is damaged")
        if expected != _checksum(saved):
            return self._refuse(f"{FILE} is damaged: its checksum is wrong")
        reason = _difference(saved, _content(objects))
        if reason:
            return self._refuse(reason)
        for one in objects:
            sensors = saved["objects"][one.name]["sensors"]
            for sensor, values in sensors.items():
                one.variables.set_internal(f"{sensor}.{_OFFSET}", values["offset"])
                one.variables.set_internal(f"{sensor}.Adjusted", values["adjusted"])
            if sensors:
                one.apply_configuration()
        self.file.replace(self.file.with_name(USED))
        self._tell("controller.encoder_data_restored", objects=len(saved["objects"]))
        return True

    def _refuse(self, reason: str) -> bool:
        self._tell("controller.encoder_data_refused", reason=reason)
        return False

    def _tell(self, kind: str, **facts: Scalar) -> None:
        if self._history is not None:
            self._history.emit("controller", kind, **facts)


class _Adjustment(TypedDict):
    """Adjustment of an absolute encoder."""

    offset: float
    adjusted: bool


class _Entry(TypedDict):
    """What is saved of a technology object."""

    type: str
    configuration: dict[str, float]
    sensors: dict[str, _Adjustment]


class _Content(TypedDict):
    """What the file holds, in addition to its checksum."""

    version: int
    objects: dict[str, _Entry]


def _content(objects: Sequence[TechnologyAxis | ExternalEncoder]) -> _Content:
    """Return names, encoder configurations and adjustments of all objects."""
    return {"version": 1, "objects": {one.name: _entry(one) for one in objects}}


def _entry(one: TechnologyAxis | ExternalEncoder) -> _Entry:
    store = one.variables
    configuration = {
        path: store.read(path)
        for path in store.paths()
        if path.startswith("Sensor") and not path.endswith("Existent")
    }
    sensors: dict[str, _Adjustment] = {}
    for path in store.paths():
        sensor, _, name = path.rpartition(".")
        if name != _OFFSET:
            continue
        kind = store.read(f"{sensor.removeprefix('Status')}.Type")
        if kind != INCREMENTAL:
            sensors[sensor] = {"offset": store.read(path), "adjusted": store.read_bool(f"{sensor}.Adjusted")}
    return {"type": one.object_type, "configuration": configuration, "sensors": sensors}


def _checksum(content: _Content) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _difference(saved: _Content, present: _Content) -> str:
    """Return why saved data do not fit the present objects; empty if they do."""
    there, here = saved["objects"], present["objects"]
    if len(there) != len(here):
        return f"{len(there)} technology objects were saved, there are {len(here)}"
    for name in there:
        if name not in here:
            return f"the saved technology object {name!r} does not exist"
        if there[name]["type"] != here[name]["type"]:
            return f"{name} was a {there[name]['type']}"
        before, now = there[name]["configuration"], here[name]["configuration"]
        for path in sorted({*before, *now}):
            if before.get(path) != now.get(path):
                return f"{name}: {path} was {before.get(path)!r} and is {now.get(path)!r}"
    return ""
