"""ADS: an AMS/TCP device with memory, symbols and notifications, as a core without sockets, and its
server.
"""

from __future__ import annotations

from fieldbus.ads.codes import (
    NC_PORT,
    PLC_PORT,
    SYSTEM_PORT,
    TCP_PORT,
    TYPES,
    AdsError,
    AdsState,
    Command,
    Group,
    TransMode,
)
from fieldbus.ads.frames import Frame, FrameReader, MalformedFrameError, net_id
from fieldbus.ads.server import AdsServer
from fieldbus.ads.session import AdsSession, Port
from fieldbus.ads.symbols import Area, Member, Memory, Structure, Symbol, size_of, variable

__all__ = [
    "NC_PORT",
    "PLC_PORT",
    "SYSTEM_PORT",
    "TCP_PORT",
    "TYPES",
    "AdsError",
    "AdsServer",
    "AdsSession",
    "AdsState",
    "Area",
    "Command",
    "Frame",
    "FrameReader",
    "Group",
    "MalformedFrameError",
    "Member",
    "Memory",
    "Port",
    "Structure",
    "Symbol",
    "TransMode",
    "net_id",
    "size_of",
    "variable",
]
