"""Modbus clients of others behind one face: libmodbus (its library, and the program mbpoll) and pymodbus.

Addresses are those of the wire. A refusal raises `RefusedError` with the words of the client.
"""

from __future__ import annotations

import ctypes
import re
import shutil
import subprocess

import pytest
from pymodbus.client import ModbusSerialClient, ModbusTcpClient

from testcases.peers.real_drive import UNIT, RealDrive


class RefusedError(Exception):
    """An exception response, as the client tells it."""


class Mbpoll:
    """The program mbpoll, once per request."""

    def __init__(self, device: RealDrive) -> None:
        program = shutil.which("mbpoll")
        if program is None:
            pytest.fail("mbpoll is missing (Debian: apt-get install mbpoll)", pytrace=False)
        link = ["-m", "tcp", "-p", str(device.port), device.host]
        if device.path:
            link = ["-m", "rtu", "-b", "19200", "-P", "even", device.path]
        self._link = link
        self._command = [program, "-a", str(UNIT), "-0", "-1", "-o", "5", "-t", "4"]

    def _run(self, address: int, *more: str) -> str:
        done = subprocess.run(
            [*self._command, "-r", str(address), *more[:2], *self._link, *more[2:]],
            check=False,
            capture_output=True,
            text=True,
            timeout=60,
        )
        said = done.stdout + done.stderr
        if done.returncode or "failed" in said:
            raise RefusedError(said)
        return said

    def read(self, address: int, count: int) -> list[int]:
        said = self._run(address, "-c", str(count))
        found = dict(re.findall(r"^\[(\d+)\]:\s+(\d+)", said, re.MULTILINE))
        return [int(found[str(at)]) for at in range(address, address + count)]

    def write(self, address: int, *values: int) -> None:
        self._run(address, "-o", "5", "--", *map(str, values))

    def close(self) -> None:
        pass


class Libmodbus:
    """The library libmodbus, by its C interface."""

    def __init__(self, device: RealDrive) -> None:
        try:
            library = ctypes.CDLL("libmodbus.so.5", use_errno=True)
        except OSError:
            pytest.fail("libmodbus is missing (Debian: apt-get install libmodbus5)", pytrace=False)
        self._library = library
        library.modbus_new_tcp.restype = library.modbus_new_rtu.restype = ctypes.c_void_p
        library.modbus_new_tcp.argtypes = [ctypes.c_char_p, ctypes.c_int]
        library.modbus_new_rtu.argtypes = [
            ctypes.c_char_p,
            ctypes.c_int,
            ctypes.c_char,
            ctypes.c_int,
            ctypes.c_int,
        ]
        library.modbus_strerror.restype = ctypes.c_char_p
        for name in ("connect", "close", "free"):
            getattr(library, f"modbus_{name}").argtypes = [ctypes.c_void_p]
        library.modbus_set_slave.argtypes = [ctypes.c_void_p, ctypes.c_int]
        library.modbus_set_response_timeout.argtypes = [ctypes.c_void_p, ctypes.c_uint32, ctypes.c_uint32]
        words = [ctypes.c_void_p, ctypes.c_int, ctypes.c_int, ctypes.POINTER(ctypes.c_uint16)]
        library.modbus_read_registers.argtypes = library.modbus_write_registers.argtypes = words
        library.modbus_write_register.argtypes = [ctypes.c_void_p, ctypes.c_int, ctypes.c_uint16]
        if device.path:
            self._context = library.modbus_new_rtu(device.path.encode(), 19200, b"E", 8, 1)
        else:
            self._context = library.modbus_new_tcp(device.host.encode(), device.port)
        assert self._context
        self._check(library.modbus_set_slave(self._context, UNIT))
        self._check(library.modbus_set_response_timeout(self._context, 5, 0))
        self._check(library.modbus_connect(self._context))

    def _check(self, result: int) -> None:
        if result < 0:
            raise RefusedError(self._library.modbus_strerror(ctypes.get_errno()).decode())

    def read(self, address: int, count: int) -> list[int]:
        words = (ctypes.c_uint16 * count)()
        self._check(self._library.modbus_read_registers(self._context, address, count, words))
        return list(words)

    def write(self, address: int, *values: int) -> None:
        if len(values) == 1:
            self._check(self._library.modbus_write_register(self._context, address, values[0]))
            return
        words = (ctypes.c_uint16 * len(values))(*values)
        self._check(self._library.modbus_write_registers(self._context, address, len(values), words))

    def close(self) -> None:
        self._library.modbus_close(self._context)
        self._library.modbus_free(self._context)


class Pymodbus:
    """The client of pymodbus."""

    def __init__(self, device: RealDrive) -> None:
        if device.path:
            # no parity: a pseudo-terminal has none, and pyserial insists on what it asks for
            self._client = ModbusSerialClient(device.path, baudrate=19200, parity="N", timeout=5, retries=0)
        else:
            self._client = ModbusTcpClient(device.host, port=device.port, timeout=5, retries=0)
        assert self._client.connect()

    @staticmethod
    def _checked(answer):
        if answer.isError():
            raise RefusedError(f"exception {answer.exception_code}")
        return answer

    def read(self, address: int, count: int) -> list[int]:
        return self._checked(
            self._client.read_holding_registers(address, count=count, device_id=UNIT)
        ).registers

    def write(self, address: int, *values: int) -> None:
        if len(values) == 1:
            self._checked(self._client.write_register(address, values[0], device_id=UNIT))
        else:
            self._checked(self._client.write_registers(address, list(values), device_id=UNIT))

    def close(self) -> None:
        self._client.close()


CLIENTS = {"mbpoll": Mbpoll, "libmodbus": Libmodbus, "pymodbus": Pymodbus}
