"""Clients of others lead the PROFIdrive axis over Modbus TCP and RTU, in real time."""

from __future__ import annotations

import time

import pytest

from emulators.drive.profidrive.faults import catalogue as numbers
from emulators.drive.profidrive.modbus_config import ProfidriveModbusConfig
from testcases.peers.modbus_clients import CLIENTS, RefusedError
from testcases.peers.real_drive import UNIT, real_drive, slow_servo

CONTROL, SPEED, STATUS, ACTUAL, FAULTS, CHANNEL, RAMP = 99, 100, 109, 110, 399, 600, 321
READY, RUN, ACKNOWLEDGE = 0x047E, 0x047F, 0x04FE
LONGEST_S = 10.0


@pytest.fixture(params=["tcp", "rtu"])
def device(request):
    with real_drive(request.param) as made:
        yield made


@pytest.fixture(params=CLIENTS)
def client(request, device):
    made = CLIENTS[request.param](device)
    yield made
    made.close()


def until(client, address, holds):
    """Read one register until it is as wanted; returns it."""
    end = time.monotonic() + LONGEST_S
    while True:
        (word,) = client.read(address, 1)
        if holds(word):
            return word
        assert time.monotonic() < end, f"register {40001 + address} is {word:04X}h"


@pytest.mark.requirement(
    "PD-286", "PD-295", "PD-296", "PD-299", "PD-300", "PD-311", "PD-321", "PD-326", "PD-328"
)
def test_they_lead_the_axis(client, device):
    """Switch on, turn, a fault, its acknowledgement, parameters by register and by data record 47."""
    client.write(CONTROL, READY)
    until(client, STATUS, lambda word: word & 0x4F == 0x01)
    client.write(CONTROL, RUN, 0x1000)
    until(client, STATUS, lambda word: word & 0x4F == 0x07)
    until(client, ACTUAL, lambda word: abs(word - 0x1000) < 16)
    assert device.do(lambda: device.drive.core.speed_rpm) == pytest.approx(750.0, abs=2.0)

    device.do(lambda: device.drive.raise_fault(numbers.OVERCURRENT))
    assert until(client, STATUS, lambda word: word & 8) & 0x47 == 0x40
    assert client.read(FAULTS, 2) == [numbers.OVERCURRENT, 0]
    client.write(CONTROL, READY)
    client.write(CONTROL, ACKNOWLEDGE)
    until(client, STATUS, lambda word: not word & 8)
    assert client.read(FAULTS, 1) == [0]

    client.write(RAMP, 150)
    assert device.do(lambda: device.drive.drive.settings.ramp_up_s) == pytest.approx(1.5)
    assert client.read(RAMP, 1) == [150]

    client.write(CHANNEL, 0x0001, 0x2F0A, 0x8001, 0x0101, 0x1001, 1120, 0x0000)
    until(client, CHANNEL, lambda word: word == 2)
    assert client.read(CHANNEL, 7) == [
        0x0002,
        0x2F0A,
        0x8001,
        0x0101,
        0x0801,
        0x3FC0,
        0x0000,
    ]  # 1.5 as a float
    client.write(CHANNEL, 0x0001, 0x2F10, 0x8002, 0x0101, 0x1001, 1121, 0, 0x0801, 0x4080, 0)
    until(client, CHANNEL, lambda word: word == 2)
    assert client.read(CHANNEL, 4) == [0x0002, 0x2F04, 0x8002, 0x0101]
    assert device.do(lambda: device.drive.drive.settings.ramp_down_s) == 4.0


@pytest.mark.requirement("PD-335", "PD-337", "MODB-022", "MODB-023", "MODB-025")
def test_they_understand_refusals(client):
    """An unknown register is 02, a display that is written 04, a value out of its limits 04."""
    words = {
        2: ("Illegal data address", "exception 2"),
        4: ("Slave device or server failure", "exception 4"),
    }
    for what, code in (
        (lambda: client.read(5000, 1), 2),
        (lambda: client.read(CONTROL + 19, 3), 2),
        (lambda: client.write(STATUS, 1), 4),
        (lambda: client.write(RAMP, 65001), 4),
    ):
        with pytest.raises(RefusedError) as found:
            what()
        assert any(text in str(found.value) for text in words[code]), found.value


@pytest.mark.requirement("PD-349", "MODB-026", "MODB-027", "MODB-028", "MODB-029", "MODB-030", "MODB-031")
def test_they_understand_every_exception_code(client, device):
    """Each code of the standard, asked for by a fault, has the meaning of the standard to them."""
    texts = {
        5: "Acknowledge",
        6: "Slave device or server is busy",
        7: "Negative acknowledge",
        8: "Memory parity error",
        10: "Gateway path unavailable",
        11: "Target device failed to respond",
    }
    for code, text in texts.items():
        device.do(lambda code=code: device.drive.refuse_requests(code))
        with pytest.raises(RefusedError) as found:
            client.read(STATUS, 1)
        assert text in str(found.value) or str(found.value) == f"exception {code}"
    device.do(lambda: device.drive.refuse_requests(None))
    assert len(client.read(STATUS, 2)) == 2


@pytest.mark.requirement("PD-280", "PD-292", "MODB-042")
@pytest.mark.parametrize("link", ["tcp", "rtu"])
def test_a_client_that_goes_away(link):
    """After p2040 without process data the axis stops with F01910, whatever has become of the connection."""
    config = ProfidriveModbusConfig(unit=UNIT, drive=slow_servo(), setpoint_monitoring_ms=500.0)
    with real_drive(link, config) as device:
        client = CLIENTS["libmodbus"](device)
        client.write(CONTROL, READY)
        until(client, STATUS, lambda word: word & 1)
        client.write(CONTROL, RUN, 0x1000)
        until(client, ACTUAL, lambda word: abs(word - 0x1000) < 16)
        client.close()
        time.sleep(1.0)
        assert device.do(lambda: device.drive.drive.faults.number) == numbers.SETPOINT_TIMEOUT
        assert not device.do(lambda: device.drive.core.enabled)
