"""Parts of a bench by name, and the identifiers of its nodes."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

from fieldbus.errors import ConfigurationError, UnknownNameError
from hil.bench.segments import MASTER_NODE

if TYPE_CHECKING:
    from collections.abc import Mapping

    from hil.bench.config import BenchConfig


_T = TypeVar("_T")


def named(kind: str, parts: Mapping[str, _T], name: str | None) -> _T:
    """Return a part by name, or the first one.

    Args:
        kind: What the parts are, for the message.
        parts: Parts by name.
        name: Name of the part; None: the first one.

    Raises:
        ConfigurationError: There is no such part.

    """
    if not parts:
        raise ConfigurationError("bench", kind if name is None else name, f"this bench has no {kind}")
    if name is None:
        return next(iter(parts.values()))
    if name not in parts:
        article = "an" if kind[0] in "ae" else "a"
        raise UnknownNameError("bench", name, f"the name of {article} {kind}", parts)
    return parts[name]


def nodes_on(config: BenchConfig, segment: str) -> tuple[str, ...]:
    """Return the names of the drives, encoders and devices on a segment, in this order."""
    return tuple(name for name, section in config.devices.items() if section.segment == segment)


def cob_ids(config: BenchConfig, name: str) -> dict[str, int]:
    """Return the identifiers that a drive, an encoder or a device uses; a CiA 406 encoder has no RPDOs.

    Raises:
        ConfigurationError: There is no such node.

    """
    if name not in config.devices:
        raise ConfigurationError("drive", name, ", ".join(config.devices) or "no nodes")
    if name not in config.nodes:
        raise ConfigurationError("drive", name, "a node on CAN; this one is on Modbus")
    encoder = config.encoder.get(name)
    node = config.nodes[name].node_id
    ids = {
        "nmt": 0,
        "sync": 0x80,
        "emcy": 0x80 + node,
        "heartbeat": 0x700 + node,
        "sdo_rx": 0x600 + node,
        "sdo_tx": 0x580 + node,
        "controller_heartbeat": 0x700 + MASTER_NODE,
    }
    for number in range(1, 5):
        ids[f"tpdo{number}"] = 0x080 + 0x100 * number + node
        if encoder is None or (encoder.profile == "profidrive" and number == 1):
            ids[f"rpdo{number}"] = 0x100 + 0x100 * number + node
    return ids


def component_names(config: BenchConfig) -> tuple[str, ...]:
    """Return the names of everything that reports its state in the history."""
    tables = (
        config.axis,
        config.external_encoder,
        config.cam,
        config.measuring_input,
        config.proxy,
        config.drive,
        config.encoder,
        config.device,
        config.station,
        config.segment,
    )
    return (*(name for table in tables for name in table), "controller", "adapter")
