"""Modbus: requests and responses, register maps, server, clients, and both links in simulated time.

Knows no device and no axis. Servers and clients do no I/O: bytes and time go in, bytes and results come out.
Importing this package loads pymodbus and pydantic, which takes some tenths of a second.
"""

from __future__ import annotations

from fieldbus.modbus.bus_log import LogEntry, ModbusFrame, SerialLog, TcpLog
from fieldbus.modbus.client import Job, Outcome, Result
from fieldbus.modbus.codes import (
    LIMITS,
    Diagnostic,
    ExceptionCode,
    Function,
    exception_text,
    function_text,
)
from fieldbus.modbus.decode import RtuDecoder, TcpDecoder
from fieldbus.modbus.drive_map import DriveMap, ProcessDataDevice
from fieldbus.modbus.errors import ModbusError, ResponseError
from fieldbus.modbus.framing import (
    RtuResponder,
    TcpFrame,
    TcpResponder,
    TcpSplitter,
    crc16,
    rtu_frame,
    tcp_frame,
    unwrap_rtu,
)
from fieldbus.modbus.gateway import TcpGateway
from fieldbus.modbus.hooks import Change, LinkHook
from fieldbus.modbus.map_file import MapFile, load_map
from fieldbus.modbus.pdu import (
    Request,
    Response,
    decode_request,
    decode_response,
    encode_response,
    is_well_formed,
)
from fieldbus.modbus.process_data import ProcessDataRegisters, process_data
from fieldbus.modbus.pty_server import PtyServer
from fieldbus.modbus.registers import Area, Block, RegisterMap, RegisterRefusal, WordOrder
from fieldbus.modbus.rtu_client import RtuClient
from fieldbus.modbus.serial_line import (
    FrameAssembler,
    Parity,
    SerialFormat,
    SerialFrame,
    SerialLine,
    SerialPort,
)
from fieldbus.modbus.server import ModbusServer
from fieldbus.modbus.sockets import SocketNetwork
from fieldbus.modbus.stations import DEFAULT_LIMITS, ConnectionLimits, RtuStation, TcpStation
from fieldbus.modbus.tcp_client import TcpClient
from fieldbus.modbus.tcp_link import TcpEnd, TcpLink, TcpSegment

__all__ = [
    "DEFAULT_LIMITS",
    "LIMITS",
    "Area",
    "Block",
    "Change",
    "ConnectionLimits",
    "Diagnostic",
    "DriveMap",
    "ExceptionCode",
    "FrameAssembler",
    "Function",
    "Job",
    "LinkHook",
    "LogEntry",
    "MapFile",
    "ModbusError",
    "ModbusFrame",
    "ModbusServer",
    "Outcome",
    "Parity",
    "ProcessDataDevice",
    "ProcessDataRegisters",
    "PtyServer",
    "RegisterMap",
    "RegisterRefusal",
    "Request",
    "Response",
    "ResponseError",
    "Result",
    "RtuClient",
    "RtuDecoder",
    "RtuResponder",
    "RtuStation",
    "SerialFormat",
    "SerialFrame",
    "SerialLine",
    "SerialLog",
    "SerialPort",
    "SocketNetwork",
    "TcpClient",
    "TcpDecoder",
    "TcpEnd",
    "TcpFrame",
    "TcpGateway",
    "TcpLink",
    "TcpLog",
    "TcpResponder",
    "TcpSegment",
    "TcpSplitter",
    "TcpStation",
    "WordOrder",
    "crc16",
    "decode_request",
    "decode_response",
    "encode_response",
    "exception_text",
    "function_text",
    "is_well_formed",
    "load_map",
    "process_data",
    "rtu_frame",
    "tcp_frame",
    "unwrap_rtu",
]
