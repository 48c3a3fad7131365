"""Object dictionaries from EDS and DCF files (CiA 306)."""

from __future__ import annotations

import re
from collections.abc import Mapping
from copy import copy
from functools import lru_cache
from os import PathLike, fspath
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from fieldbus.canopen.compact_pdos import add_compact_pdos
from fieldbus.canopen.dictionary import (
    DOMAIN,
    INTEGERS,
    OCTET_STRING,
    OPAQUE_SIZES,
    REALS,
    UNICODE_STRING,
    VISIBLE_STRING,
    relative,
    share_entries,
)
from fieldbus.canopen.eds_file import EdsFile, EdsSection
from fieldbus.errors import ConfigurationError

if TYPE_CHECKING:
    import canopen

_OBJECT: Final = re.compile(r"[0-9a-f]{4}")
_MEMBER: Final = re.compile(r"([0-9a-f]{4})\s*sub\s*([0-9a-f]{1,2})")

_NULL: Final = 0
_DOMAIN: Final = 2
_DEFINITIONS: Final = (5, 6)
_VAR: Final = 7
_ARRAY: Final = 8
_RECORD: Final = 9
_TYPE_NAMES: Final = {
    "null": _NULL, "domain": _DOMAIN, "deftype": 5, "defstruct": 6, "var": _VAR, "array": _ARRAY,
    "record": _RECORD, "rec": _RECORD,
}  # fmt: skip
"""Object types as some tools write them."""
_DATA_TYPE_NAMES: Final = {
    "boolean": 0x01, "integer8": 0x02, "integer16": 0x03, "integer32": 0x04, "unsigned8": 0x05,
    "unsigned16": 0x06, "unsigned32": 0x07, "real32": 0x08, "visible_string": 0x09, "octet_string": 0x0A,
    "unicode_string": 0x0B, "time_of_day": 0x0C, "time_difference": 0x0D, "domain": 0x0F,
    "integer24": 0x10, "real64": 0x11, "integer40": 0x12, "integer48": 0x13, "integer56": 0x14,
    "integer64": 0x15, "unsigned24": 0x16, "unsigned40": 0x18, "unsigned48": 0x19, "unsigned56": 0x1A,
    "unsigned64": 0x1B,
}  # fmt: skip
"""Data types of CiA 301 by name (C301-014)."""

_ACCESS: Final = ("ro", "wo", "rw", "rwr", "rww", "const")
_KNOWN_TYPES: Final = frozenset(
    (*INTEGERS, *REALS, *OPAQUE_SIZES, VISIBLE_STRING, OCTET_STRING, UNICODE_STRING, DOMAIN)
)
_FIRST_OBJECT: Final = 0x1000
_MOST_ELEMENTS: Final = 0xFE
_NO_DOWNLOAD: Final = 1
_NOTES: Final = "_notes"
"""Attribute of a dictionary: what `notes_of` returns."""

_DEVICE_INFO: Final[tuple[tuple[str, str, type], ...]] = (
    ("VendorName", "vendor_name", str),
    ("VendorNumber", "vendor_number", int),
    ("ProductName", "product_name", str),
    ("ProductNumber", "product_number", int),
    ("RevisionNumber", "revision_number", int),
    ("OrderCode", "order_code", str),
    ("SimpleBootUpMaster", "simple_boot_up_master", bool),
    ("SimpleBootUpSlave", "simple_boot_up_slave", bool),
    ("Granularity", "granularity", int),
    ("DynamicChannelsSupported", "dynamic_channels_supported", bool),
    ("GroupMessaging", "group_messaging", bool),
    ("NrOfRXPDO", "nr_of_RXPDO", int),
    ("NrOfTXPDO", "nr_of_TXPDO", int),
    ("LSS_Supported", "LSS_supported", bool),
)
_BITRATES_K: Final = (10, 20, 50, 125, 250, 500, 800, 1000)


def load_dictionary(path: str | PathLike[str], node_id: int | None = None) -> canopen.ObjectDictionary:
    """Read an EDS or DCF file into an object dictionary of the `canopen` library.

    Encodings (UTF-8, UTF-16, Windows), upper and lower case of keys, arrays in compact form and data types
    that nobody knows (taken for domains) are dealt with. Everything that cannot be understood is an error:
    the library would skip a number that it cannot read.

    Args:
        path: File with the ending .eds or .dcf.
        node_id: Node-ID for defaults relative to it; default: the one that the file names, if any.

    Raises:
        ConfigurationError: The file cannot be read, is no EDS, or describes no object; the message names
            section and key.

    """
    where = fspath(path)
    if Path(where).suffix.lower() not in (".eds", ".dcf"):
        raise ConfigurationError("object dictionary", where, "a file with the ending .eds or .dcf")
    file = EdsFile(path)
    dictionary: canopen.ObjectDictionary = _Reader(file, node_id).dictionary
    vars(dictionary)[_NOTES] = tuple(file.notes)
    if not any(index >= _FIRST_OBJECT for index in dictionary.indices):
        raise ConfigurationError("object dictionary", where, "an EDS that describes objects from 1000h on")
    return dictionary


def notes_of(dictionary: canopen.ObjectDictionary) -> tuple[str, ...]:
    """Return what was understood in the file of a dictionary although it should say it otherwise."""
    notes: tuple[str, ...] = vars(dictionary).get(_NOTES, ())
    return notes


def shared_dictionary(path: str | PathLike[str], node_id: int | None = None) -> canopen.ObjectDictionary:
    """Return what `load_dictionary` does, read once per process as long as the file stays the same.

    All who ask for the file get the same object: nobody may change it.

    Raises:
        ConfigurationError: See `load_dictionary`.

    """
    where = fspath(path)
    try:
        state = Path(where).stat()
    except OSError:
        return load_dictionary(where, node_id)  # says what is wrong
    return _dictionary_of(where, node_id, (state.st_mtime_ns, state.st_size, state.st_ino))


@lru_cache(maxsize=64)
def _dictionary_of(path: str, node_id: int | None, _state: tuple[int, ...]) -> canopen.ObjectDictionary:
    dictionary = load_dictionary(path, node_id)
    share_entries(dictionary)
    return dictionary


def _location(section: EdsSection) -> str | None:
    """Return where an entry is stored, for the library: `StorageLocation`, a key of tools, or RAM for what
    is not to be downloaded (bit 0 of `ObjFlags`).
    """
    if section.number("ObjFlags", 0) & _NO_DOWNLOAD:
        return "RAM"
    return section.text("StorageLocation") or None


def _name(section: EdsSection) -> str:
    """Return the name of an object or entry; one without is called as its section."""
    name = section.text("ParameterName")
    if name:
        return name
    section.note("ParameterName", f"it has no name and is called {section.name!r}")
    return section.name


def _object_type(section: EdsSection) -> int:
    """Return the type of an object as a number, which some tools write as a word."""
    named = _by_name(section, "ObjectType", _TYPE_NAMES)
    return section.number("ObjectType", _VAR) if named is None else named


def _by_name(section: EdsSection, key: str, names: Mapping[str, int]) -> int | None:
    """Return the number of a name in lower case; None for what is none."""
    text = section.text(key)
    named = names.get(text.lower())
    if named is not None:
        section.note(key, f"{text!r} is taken as {named}")
    return named


class _Reader:
    """Builds the dictionary of one file."""

    def __init__(self, file: EdsFile, node_id: int | None) -> None:
        from canopen import objectdictionary

        library: Any = objectdictionary
        self._library = library
        self._file = file
        self.dictionary: Any = library.ObjectDictionary()
        self._node_id = node_id
        self._read_device()
        self._read_dummies()
        for name, section in file.sections.items():
            if _OBJECT.fullmatch(name):
                self._read_object(section, int(name, 16))
        for name, section in file.sections.items():
            match = _MEMBER.fullmatch(name)
            if match is not None:
                self._read_member(section, int(match[1], 16), int(match[2], 16))
        add_compact_pdos(library, self.dictionary, file.section("DeviceInfo"), self._node_id)

    # -- the device
    # -------------------------------------------------------------------------------------------

    def _read_device(self) -> None:
        device = self._file.section("DeviceInfo")
        information = self.dictionary.device_information
        for key, attribute, kind in _DEVICE_INFO:
            if kind is str:
                if key.lower() in device.items():
                    setattr(information, attribute, device.text(key))
            elif device.text(key):
                setattr(information, attribute, kind(device.number(key, 0)))
        for rate in _BITRATES_K:
            if device.number(f"BaudRate_{rate}", 0):
                information.allowed_baudrates.add(rate * 1000)
        # The specification spells it with one m; tools know both.
        for name in ("DeviceComissioning", "DeviceCommissioning"):
            commissioning = self._file.section(name)
            rate = commissioning.number("Baudrate", 0)
            if rate:
                self.dictionary.bitrate = rate * 1000
            if self._node_id is None and commissioning.text("NodeID"):
                self._node_id = commissioning.number("NodeID", 1, high=255) or None
                if self._node_id is None:
                    commissioning.note("NodeID", "0 is no node-ID; the file names none")
        self.dictionary.node_id = self._node_id
        comments = self._file.section("Comments")
        lines = range(1, comments.number("Lines", 0, high=9999) + 1)
        self.dictionary.comments = "\n".join(comments.text(f"Line{line}") for line in lines)

    def _read_dummies(self) -> None:
        usage = self._file.section("DummyUsage")
        for code in range(1, 8):
            key = f"Dummy{code:04d}"
            if usage.number(key, 0):
                variable = self._library.ODVariable(key, code, 0)
                variable.data_type = code
                variable.access_type = "const"
                self.dictionary.add_object(variable)

    # -- objects
    # ----------------------------------------------------------------------------------------------

    def _read_object(self, section: EdsSection, index: int) -> None:
        kind = _object_type(section)
        thing: Any
        if kind in (_NULL, *_DEFINITIONS):
            return
        if kind in (_VAR, _DOMAIN):
            thing = self._variable(section, index, 0, domain=kind == _DOMAIN)
        elif kind == _ARRAY:
            thing = self._library.ODArray(_name(section), index)
        elif kind == _RECORD:
            thing = self._library.ODRecord(_name(section), index)
        else:
            section.refuse("ObjectType", section.text("ObjectType"), "2, 5, 6, 7, 8 or 9")
        if kind in (_ARRAY, _RECORD):
            thing.storage_location = _location(section)
            count = section.number("CompactSubObj", 0, high=255)
            if count > _MOST_ELEMENTS:
                section.note(
                    "CompactSubObj", f"{count} is above the highest sub-index; {_MOST_ELEMENTS} counts"
                )
                count = _MOST_ELEMENTS
            if count:
                self._fill(thing, section, count)
        self.dictionary.add_object(thing)

    def _fill(self, array: Any, section: EdsSection, count: int) -> None:
        """Write out an array in compact form, with the names and values of its elements."""
        index = array.index
        highest = self._library.ODVariable("Number of entries", index, 0)
        highest.data_type = 0x05
        highest.access_type = "ro"
        highest.default, highest.default_raw = count, str(count)
        array.add_member(highest)
        names = self._file.section(f"{index:04X}Name")
        values = self._file.section(f"{index:04X}Value")
        template = self._variable(section, index, 1)
        for sub in range(1, count + 1):
            element = copy(template)
            element.subindex = sub
            element.name = names.text(str(sub)) or (template.name if sub == 1 else f"{template.name} {sub}")
            if values.text(str(sub)):
                self._set_value(element, "default", values, str(sub))
            array.add_member(element)

    def _read_member(self, section: EdsSection, index: int, sub: int) -> None:
        thing = self.dictionary.indices.get(index)
        if thing is None:
            if f"{index:04x}" in self._file.sections:
                return  # member of a definition
            section.refuse("", section.name, f"a member of an object; there is no [{index:04X}]")
        if not hasattr(thing, "subindices"):
            section.refuse("", section.name, f"a member of an array or record; [{index:04X}] is a variable")
        if _object_type(section) != _NULL:
            thing.add_member(self._variable(section, index, sub))

    def _variable(self, section: EdsSection, index: int, sub: int, *, domain: bool = False) -> Any:
        variable = self._library.ODVariable(_name(section), index, sub)
        variable.storage_location = _location(section)
        # DataType and AccessType of a domain may be left out.
        if not (domain and not section.text("DataType")):
            section.required("DataType")
        code = _by_name(section, "DataType", _DATA_TYPE_NAMES)
        if code is None:
            code = section.number("DataType", DOMAIN, high=0xFFFF)
        variable.data_type = self._data_type(section, code)
        access = section.text("AccessType").lower() if domain else section.required("AccessType").lower()
        variable.access_type = access or "rw"
        if variable.access_type not in _ACCESS:
            section.refuse("AccessType", section.text("AccessType"), ", ".join(_ACCESS))
        variable.pdo_mappable = bool(section.number("PDOMapping", 0))
        if variable.data_type in INTEGERS or variable.data_type in REALS:
            variable.min = section.limit("LowLimit", variable.data_type, self._node_id)
            variable.max = section.limit("HighLimit", variable.data_type, self._node_id)
        self._set_value(variable, "default", section, "DefaultValue")
        self._set_value(variable, "value", section, "ParameterValue")
        # Not of the standard, but the library knows them.
        if section.text("Factor"):
            try:
                variable.factor = section.value("Factor", 0x11, None)
            except ConfigurationError:
                section.note("Factor", f"{section.text('Factor')!r} is no number and is left out")
        variable.description = section.text("Description")
        variable.unit = section.text("Unit")
        return variable

    def _data_type(self, section: EdsSection, code: int) -> int:
        """Return the type; one of the manufacturer's own stands for what its
        definition says, or for a domain.
        """
        if code in _KNOWN_TYPES:
            return code
        definition = self._file.section(f"{code:X}sub1")
        if definition.text("DefaultValue"):
            return definition.number("DefaultValue", DOMAIN, high=0xFFFF)
        if not code:
            section.refuse("DataType", section.text("DataType"), "a data type")
        return DOMAIN

    def _set_value(self, variable: Any, attribute: str, section: EdsSection, key: str) -> None:
        text = section.text(key)
        value = section.value(key, variable.data_type, self._node_id)
        if value is None and not text:
            return
        setattr(variable, attribute, value)
        setattr(variable, f"{attribute}_raw", text)
        if attribute == "default" and variable.data_type in INTEGERS and relative(text) is not None:
            variable.relative = True
