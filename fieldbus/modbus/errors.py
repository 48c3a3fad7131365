"""Exceptions of this package."""

from __future__ import annotations

from fieldbus.errors import HilError


class ModbusError(HilError):
    """Something of Modbus cannot be done or understood."""


class ResponseError(ModbusError):
    """Bytes that are no response to the request that was made; the message says why."""
