"""A device with every area: addresses 10 to 2209 of each, values that tell their address."""

from __future__ import annotations

import pytest

from fieldbus.modbus import Area, Block, ModbusServer, RegisterMap

START, COUNT = 10, 2200
IDENTIFICATION = {0: b"ACME", 1: b"D-1", 2: b"1.0", 4: b"drive", 0x80: b"extra"}


def new_map(**options) -> RegisterMap:
    registers = RegisterMap("device", **options)
    for area in Area:
        block = registers.add(area, Block(START, COUNT, name=area.value))
        bits = area in (Area.COILS, Area.DISCRETE_INPUTS)
        block.values[:] = [(START + n) % 3 == 0 if bits else 0x1000 + START + n for n in range(COUNT)]
    return registers


@pytest.fixture
def registers() -> RegisterMap:
    return new_map()


@pytest.fixture
def server(registers) -> ModbusServer:
    return ModbusServer(registers, unit=5, identification=IDENTIFICATION)
