"""The program mbpoll (libmodbus) against the server, over TCP and on a pseudo-terminal."""

from __future__ import annotations

import re
import shutil
import subprocess

import pytest

from fieldbus.modbus import Area
from testcases.unit.fieldbus_modbus.real_server import real_device


@pytest.fixture
def device():
    with real_device() as made:
        yield made


@pytest.fixture(params=["tcp", "rtu"])
def mbpoll(request, device):
    """Return a function that runs the program once and returns the values that it shows by address, and all
    it says.
    """
    program = shutil.which("mbpoll")
    if program is None:
        pytest.fail("mbpoll is missing (Debian: apt-get install mbpoll)", pytrace=False)
    link = ["-m", "tcp", "-p", str(device.port), device.host]
    if request.param == "rtu":
        link = ["-m", "rtu", "-b", "19200", "-P", "even", device.path]

    def run(*options):
        before, behind = options, ()
        if "--" in options:
            cut = options.index("--")
            before, behind = options[:cut], options[cut + 1 :]
        done = subprocess.run(
            [program, "-a", "5", "-0", "-1", "-o", "5", *before, *link, *behind],
            check=False,
            capture_output=True,
            text=True,
            timeout=60,
        )
        values = re.findall(r"^\[(\d+)\]:\s+(\S+)", done.stdout, re.MULTILINE)
        return {int(at): int(value, 0) for at, value in values}, done.stdout + done.stderr, done.returncode

    return run


@pytest.mark.requirement("MODB-012", "MODB-013")
def test_it_reads_everything(mbpoll):
    """Coils, discrete inputs, input and holding registers have the values of the device."""
    bits = {at: int(at % 3 == 0) for at in range(10, 30)}
    assert mbpoll("-t", "0", "-r", "10", "-c", "20")[0] == bits
    assert mbpoll("-t", "1", "-r", "10", "-c", "20")[0] == bits
    words = {at: 0x1000 + at for at in range(10, 135)}
    assert mbpoll("-t", "3:hex", "-r", "10", "-c", "125")[0] == words
    assert mbpoll("-t", "4:hex", "-r", "10", "-c", "125")[0] == words


@pytest.mark.requirement("MODB-014", "MODB-015", "MODB-017", "MODB-018")
def test_it_writes(mbpoll, device):
    """One and several coils and registers arrive."""
    registers = device.server.registers
    for values in ([7], [8, 9, 10]):
        *_, code = mbpoll("-t", "4", "-r", "20", "--", *map(str, values))
        assert code == 0
        assert [registers.get(Area.HOLDING_REGISTERS, 20 + n) for n in range(len(values))] == values
    for values in ([1], [0, 1, 1]):
        *_, code = mbpoll("-t", "0", "-r", "20", "--", *map(str, values))
        assert code == 0
        assert [registers.get(Area.COILS, 20 + n) for n in range(len(values))] == values


@pytest.mark.requirement("MODB-023", "MODB-008")
def test_it_understands_refusals_and_silence(mbpoll):
    """An unknown address is an illegal data address to it, another unit a time-out."""
    assert "Illegal data address" in mbpoll("-t", "4", "-r", "5000")[1]
    assert "timed out" in mbpoll("-a", "9", "-o", "0.3", "-t", "4", "-r", "10")[1]
