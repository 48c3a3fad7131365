"""Object dictionaries from EDS and DCF files."""

from __future__ import annotations

from configparser import Error as ParserError
from configparser import RawConfigParser
from copy import copy
from os import PathLike, fspath
from pathlib import Path
from typing import TYPE_CHECKING

from fieldbus.errors import ConfigurationError

if TYPE_CHECKING:
    import canopen


def load_dictionary(path: str | PathLike[str], node_id: int | None = None) -> canopen.ObjectDictionary:
    """Read an EDS or DCF file.

    The parser is that of the `canopen` library; arrays in compact form (`CompactSubObj`), of which the library
    keeps the first element only, are completed here.

    Args:
        path: File with the ending .eds or .dcf.
        node_id: Node-ID for defaults relative to it; default: the one that the file names, if any.

    Raises:
        ConfigurationError: The file cannot be read, is no EDS, or describes no object.

    """
    from canopen.objectdictionary import ObjectDictionaryError, import_od

    where = fspath(path)
    if Path(where).suffix.lower() not in (".eds", ".dcf"):
        raise ConfigurationError("object dictionary", where, "a file with the ending .eds or .dcf")
    try:
        with Path(where).open(encoding="utf-8", errors="replace") as file:
            dictionary = import_od(file, node_id)
        _complete_compact_arrays(dictionary, Path(where))
    except OSError as reason:
        raise ConfigurationError(
            "object dictionary", where, f"a readable file ({reason.strerror})"
        ) from reason
    except (ParserError, ObjectDictionaryError, KeyError, ValueError) as reason:
        raise ConfigurationError("object dictionary", where, f"a well-formed EDS ({reason})") from reason
    if not any(index >= 0x1000 for index in dictionary.indices):
        raise ConfigurationError("object dictionary", where, "an EDS that describes objects from 1000h on")
    return dictionary


def _complete_compact_arrays(dictionary: canopen.ObjectDictionary, path: Path) -> None:
    parser = RawConfigParser(inline_comment_prefixes=(";",))
    parser.optionxform = str  # type: ignore[assignment,method-assign]  # the documented way to keep upper case
    parser.read_string(path.read_text(encoding="utf-8", errors="replace"))
    for section in parser.sections():
        count = int(parser.get(section, "CompactSubObj", fallback="0") or "0", 0)
        if not count or len(section) != 4:
            continue
        array = dictionary.indices.get(int(section, 16))
        if array is None or 1 not in getattr(array, "subindices", {}):
            continue
        array.subindices[0].default = count
        array.subindices[0].access_type = "ro"
        template = array.subindices[1]
        for sub in range(2, count + 1):
            if sub not in array.subindices:
                element = copy(template)
                element.subindex = sub
                element.name = f"{template.name} {sub}"
                array.add_member(element)
