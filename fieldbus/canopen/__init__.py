"""CANopen: slave stack, master services, and the `canopen` library on a CAN segment of a bench (CiA 301).

`CanopenSlave` is the device side, `CanopenMaster` the controller's: cyclic services, SDO clients, and nodes
that are taken into service and supervised. `PumpedNetwork` puts the unmodified `canopen` library on a
segment, for tools and as an independent second implementation.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from fieldbus.canopen.abort import ABORT_TEXTS, AbortCode, SdoAbort
from fieldbus.canopen.boot import BootFailure, BootState
from fieldbus.canopen.decode import FrameDecoder
from fieldbus.canopen.eds import load_dictionary, notes_of, shared_dictionary
from fieldbus.canopen.eds_text import DeviceEds, write_eds_files
from fieldbus.canopen.master import CanopenMaster
from fieldbus.canopen.nmt import NmtCommand, NmtState
from fieldbus.canopen.node import Emcy, NodeUser, RemoteNode
from fieldbus.canopen.node_setup import NodeSetup, Parameter, PdoSetup
from fieldbus.canopen.sdo_client import SdoClient, SdoJob
from fieldbus.canopen.slave import CanopenSlave
from fieldbus.canopen.virtual_time import virtual_time

if TYPE_CHECKING:
    from fieldbus.canopen.network import PumpedNetwork

__all__ = [
    "ABORT_TEXTS",
    "AbortCode",
    "BootFailure",
    "BootState",
    "CanopenMaster",
    "CanopenSlave",
    "DeviceEds",
    "Emcy",
    "FrameDecoder",
    "NmtCommand",
    "NmtState",
    "NodeSetup",
    "NodeUser",
    "Parameter",
    "PdoSetup",
    "PumpedNetwork",
    "RemoteNode",
    "SdoAbort",
    "SdoClient",
    "SdoJob",
    "load_dictionary",
    "notes_of",
    "shared_dictionary",
    "virtual_time",
    "write_eds_files",
]


def __getattr__(name: str) -> type[PumpedNetwork]:
    """Import `PumpedNetwork` when it is asked for: the library behind it takes half a second to load."""
    if name == "PumpedNetwork":
        from fieldbus.canopen.network import PumpedNetwork

        return PumpedNetwork
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
