"""The npm package ads-client against `hil emulate --ads`: it reads structures by uploaded data types."""

import json
import os
import signal
import subprocess
from pathlib import Path

import pytest

from testcases.processes import Reader, hil_command

NET = "5.71.3.10.1.1"
HERE = Path(__file__).parent


@pytest.fixture(scope="module")
def seen(node_modules):
    """What the client has seen, once for all tests."""
    port = 20_000 + os.getpid() % 10_000
    command = [*hil_command(), "emulate", "nc-axes:reference", "--ads", "--port", str(port), "--net-id", NET]
    served = Reader(command, stream="stderr")
    try:
        served.wait_for("ready")
        client = ["node", str(HERE / "ads_client.js"), str(node_modules), "127.0.0.1", str(port), NET]
        done = subprocess.run(client, check=False, capture_output=True, text=True, timeout=60)
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout.splitlines()[-1])
    finally:
        served.end(signal.SIGINT)


def test_structures_by_uploaded_data_types(seen):
    """The client finds symbols and data types, and reads and writes the process images as structures."""
    assert seen["info"]["deviceName"] == "Plc30 App"
    assert seen["symbols"] > 150
    assert {"plctonc_axis_ref", "nctoplc_axis_ref", "lreal", "bool"} <= set(seen["types"])
    assert seen["before"]["ActPos"] == 0.0
    assert seen["before"]["AxisId"] == 1
    assert seen["after"]["ActPos"] == pytest.approx(20.0, abs=0.1)
    assert seen["after"]["SetPos"] == 20.0
    assert seen["after"]["StateDWord"] & 0x1
    assert (seen["written"], seen["packet"]) == (0, 7.5)


def test_values_on_change_and_errors(seen):
    """Changes of a value come in their order; wrong requests have the codes that the client knows."""
    changes = seen["changes"]
    assert len(changes) > 5
    rising = [value for value in changes if value < 19.0]
    assert rising == sorted(set(rising))
    assert (seen["unknown"], seen["refused"]) == (0x710, 0x704)
    assert seen["sum"] == [0, 0x702]
