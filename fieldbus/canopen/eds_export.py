"""EDS and DCF of a device as it is: its dictionary, its defaults, its configuration (CiA 306)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Final

from fieldbus.canopen.dictionary import (
    BOOLEAN,
    STORED_IN_RAM,
    UNICODE_STRING,
    VISIBLE_STRING,
    Entry,
    ObjectValue,
)
from fieldbus.canopen.eds_text import EdsInfo, head_lines
from fieldbus.canopen.store import NOT_STORED
from fieldbus.errors import ConfigurationError

if TYPE_CHECKING:
    from fieldbus.canopen.slave import CanopenSlave

_FIRST_OBJECT: Final = 0x1000


def device_eds(
    slave: CanopenSlave, *, dcf: bool = False, file_name: str = "", bitrate: int | None = None
) -> str:
    """Return the EDS of a device, or the DCF.

    Defaults are those of the device, which may differ from those of the EDS that it was made of; defaults
    relative to the node-ID stay so. A DCF also has the node-ID, the bit rate, and the present value of every
    entry that 1010h would save: written into another device of the kind, they give it the same configuration.

    Args:
        slave: The device.
        dcf: DCF in place of EDS.
        file_name: Name for `[FileInfo]`; default: the name of the device with the ending.
        bitrate: Bit rate of its segment, bit/s, for a device that has none of its own; None = unknown.

    Raises:
        ConfigurationError: A text of the device cannot be part of such a file.

    """
    name = file_name or f"{slave.name}.{'dcf' if dcf else 'eds'}"
    return "\n".join(_lines(slave, name, dcf=dcf, bitrate=bitrate)) + "\n"


def _lines(slave: CanopenSlave, file_name: str, *, dcf: bool, bitrate: int | None) -> Iterator[str]:
    store = slave.store
    dictionary = store.dictionary
    device = dictionary.device_information
    indices = sorted({entry.index for entry in store.entries.values()})
    identity = {
        sub: store.entries[key].default if (key := 0x101800 | sub) in store.entries else 0
        for sub in (1, 2, 3)
    }
    yield from head_lines(
        indices,
        EdsInfo(
            file_name=file_name,
            description=device.product_name or slave.name,
            product_name=device.product_name or slave.name,
            product_number=_first(device.product_number, identity[2]),
            comment=dictionary.comments or "",
            vendor_name=device.vendor_name or "",
            vendor_number=_first(device.vendor_number, identity[1]),
            revision_number=_first(device.revision_number, identity[3]),
            order_code=device.order_code or "",
            bitrates_k=tuple(sorted(rate // 1000 for rate in device.allowed_baudrates)),
            lss=slave.lss.enabled,
        ),
    )
    if dcf:
        bitrate = slave.settings.bitrate or bitrate or dictionary.bitrate
        yield from (
            "[DeviceComissioning]",
            f"NodeID={slave.node_id}",
            f"NodeName={slave.name}",
            *([f"Baudrate={bitrate // 1000}"] if bitrate else []),
            "CANopenManager=0",
            "",
        )
    for index in indices:
        thing: Any = dictionary.indices[index]
        members = getattr(thing, "subindices", None)
        section = f"{index:04X}"
        if members is None:
            yield f"[{section}]"
            yield from _entry_lines(slave, store.entries[index << 8], thing, dcf=dcf)
            continue
        yield f"[{section}]"
        yield f"ParameterName={_text(thing.name, section)}"
        yield f"ObjectType=0x{8 if type(thing).__name__ == 'ODArray' else 9:X}"
        yield f"SubNumber=0x{len(members):X}"
        yield ""
        for sub in sorted(members):
            yield f"[{section}sub{sub:X}]"
            yield from _entry_lines(slave, store.entries[index << 8 | sub], members[sub], dcf=dcf)


def _entry_lines(slave: CanopenSlave, entry: Entry, variable: Any, *, dcf: bool) -> Iterator[str]:
    where = f"{entry.index:04X}h:{entry.sub}"
    yield f"ParameterName={_text(variable.name, where)}"
    yield "ObjectType=0x7"
    yield f"DataType=0x{entry.data_type:04X}"
    yield f"AccessType={variable.access_type}"
    if entry.base is not None and entry.default == entry.base + slave.node_id:
        yield f"DefaultValue=$NODEID+0x{entry.base:X}"
    elif entry.given:
        yield f"DefaultValue={_value(entry, entry.default, where)}"
    yield f"PDOMapping={int(bool(variable.pdo_mappable))}"
    if str(variable.storage_location or "").upper() in STORED_IN_RAM:
        yield "ObjFlags=0x1"
    for key, limit in (("LowLimit", variable.min), ("HighLimit", variable.max)):
        if limit is not None:
            yield f"{key}={_value(entry, limit, where)}"
    for key, extra in (("Description", variable.description), ("Unit", variable.unit)):
        if extra:
            yield f"{key}={_text(extra, where)}"
    if variable.factor != 1:
        yield f"Factor={variable.factor!r}"
    if dcf and _configurable(slave, entry):
        yield f"ParameterValue={_value(entry, slave.values[entry.key], where)}"
    yield ""


def _configurable(slave: CanopenSlave, entry: Entry) -> bool:
    store = slave.store
    return (
        entry.storable
        and entry.index not in NOT_STORED
        and entry.key not in store.volatile
        and entry.key not in store.commands
    )


def _value(entry: Entry, value: ObjectValue, where: str) -> str:
    if entry.data_type in (VISIBLE_STRING, UNICODE_STRING):
        return _text(str(value), where)
    if entry.real is not None:
        return repr(float(value))
    if entry.data_type == BOOLEAN:
        return str(int(bool(value)))
    if entry.integer:
        return str(value) if -10 < value < 10 or entry.signed else f"0x{value:X}"
    if entry.size:  # a time, which tools take for a number
        return f"0x{int.from_bytes(value, 'little'):X}"
    return bytes(value).hex()


def _text(text: str, where: str) -> str:
    """Return a text that a line can carry."""
    if text != text.strip() or not text.isprintable() or " ;" in text or text.startswith(";"):
        raise ConfigurationError(
            where,
            text,
            "a text that a line of an EDS can carry: printable, without blanks at its ends and comments",
        )
    return text


def _first(declared: int | None, default: ObjectValue) -> int:
    return int(default) if declared is None else declared
