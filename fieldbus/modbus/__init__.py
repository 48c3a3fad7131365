"""Modbus: requests and responses, a server without I/O, register maps. Knows no device and no axis.

Importing this package loads pymodbus (0.1 s).
"""

from __future__ import annotations

from fieldbus.modbus.codes import (
    LIMITS,
    Diagnostic,
    ExceptionCode,
    Function,
    exception_text,
    function_text,
)
from fieldbus.modbus.errors import ModbusError, ResponseError
from fieldbus.modbus.framing import (
    RtuFace,
    TcpFace,
    TcpFrame,
    TcpSplitter,
    crc16,
    rtu_frame,
    tcp_frame,
    unwrap_rtu,
)
from fieldbus.modbus.pdu import (
    Request,
    Response,
    decode_request,
    decode_response,
    encode_response,
    is_well_formed,
)
from fieldbus.modbus.registers import Area, Block, RegisterMap, RegisterRefusal, WordOrder
from fieldbus.modbus.server import ModbusServer

__all__ = [
    "LIMITS",
    "Area",
    "Block",
    "Diagnostic",
    "ExceptionCode",
    "Function",
    "ModbusError",
    "ModbusServer",
    "RegisterMap",
    "RegisterRefusal",
    "Request",
    "Response",
    "ResponseError",
    "RtuFace",
    "TcpFace",
    "TcpFrame",
    "TcpSplitter",
    "WordOrder",
    "crc16",
    "decode_request",
    "decode_response",
    "encode_response",
    "exception_text",
    "function_text",
    "is_well_formed",
    "rtu_frame",
    "tcp_frame",
    "unwrap_rtu",
]
