"""Emulated bus adapters: what stands between a program that speaks to an adapter and a CAN segment.

`SlcanAdapter` is the protocol of serial-line adapters alone, bytes in and bytes out. `SlcanDevice` connects
one to a segment and to a pseudo-terminal, which any program opens as it would `/dev/ttyACM0`.
"""

from emulators.adapter._acceptance import AcceptanceFilter
from emulators.adapter._device import SlcanDevice
from emulators.adapter._slcan import ChannelState, SlcanAdapter, StatusFlag
from fieldbus.pty_line import PtyLine

__all__ = ["AcceptanceFilter", "ChannelState", "PtyLine", "SlcanAdapter", "SlcanDevice", "StatusFlag"]
