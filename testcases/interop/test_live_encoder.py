"""Encoders in the process of the emulated drives: on the bus of somebody else's controller, and behind the
pipe.
"""

from __future__ import annotations

import can
import pytest

from hil.bench import load_bench
from hil.bench.bench_file import parse
from hil.bench.drive_host import DriveHost
from hil.bench.remote_calls import RemoteError
from hil.cli import main

PATIENCE_S = 60.0


def with_encoders(channel: str) -> str:
    """Return the live bench on python-can's virtual bus, with an encoder on its drive and one by itself."""
    text = load_bench("live").text.replace('"socketcan"', '"virtual"').replace('"vcan0"', f'"{channel}"')
    assert f'"{channel}"' in text
    return f"""{text}
[encoder.scale]
segment = "can0"
node_id = 22
type = "absolute_linear"
on = "drive1"
mounting = "load"

[encoder.own]
segment = "can0"
node_id = 23
"""


def read_position(host: DriveHost, controller: can.BusABC, node: int) -> int:
    """Upload 6004h as a controller of one's own would."""
    controller.send(
        can.Message(arbitration_id=0x600 + node, data=bytes.fromhex("4004600000000000"), is_extended_id=False)
    )
    answers: list[bytes] = []

    def answered() -> bool:
        message = controller.recv(0)
        if message is not None and message.arbitration_id == 0x580 + node:
            answers.append(bytes(message.data))
        return bool(answers)

    assert host.run_until(answered, PATIENCE_S) or answered()
    assert answers[0][:4] == bytes.fromhex("43046000")
    return int.from_bytes(answers[0][4:], "little", signed=True)


def test_encoders_live_with_their_drives(request):
    """The host of the drives holds encoders too: they boot, answer, take faults by the pipe's commands, are
    recorded.
    """
    channel = request.node.name
    with can.Bus(interface="virtual", channel=channel) as controller:
        host = DriveHost(parse(with_encoders(channel), "own"))
        try:
            assert host.run_until(lambda: host.booted, PATIENCE_S)
            assert read_position(host, controller, 22) == 1_000_000
            host.execute({"call": "jump_encoder", "drive": "scale", "args": [-5]})
            assert read_position(host, controller, 22) == 999_995
            host.execute({"call": "place_shaft", "drive": "own", "args": [3.15]})
            assert read_position(host, controller, 23) == 4107
            for call, device in (("raise_fault", "scale"), ("turn_shaft", "drive1"), ("slave", "own")):
                with pytest.raises(RemoteError, match="unknown command"):
                    host.execute({"call": call, "drive": device, "args": [1]})
            host.run_until(lambda: False, 0.1)
            recorded = host.execute({"call": "fetch", "kwargs": {"rows": {}, "events": 0}})
            assert set(recorded["groups"]) == {"drive1", "scale", "own"}
        finally:
            host.close()


@pytest.mark.exhaustive
def test_hil_emulate_brings_encoders(request, tmp_path, capsys):
    """`hil emulate` names the encoders of a bench file as well as the drives."""
    channel = request.node.name
    path = tmp_path / "bench.toml"
    path.write_text(with_encoders(channel), encoding="utf-8")
    assert main(["emulate", str(path), "-i", "virtual", "-c", channel, "--for", "0.2"]) == 0
    lines = capsys.readouterr().err.splitlines()
    assert lines[:3] == [
        f"drive1: cia402, node 5, on virtual {channel}",
        f"scale: cia406, node 22, on virtual {channel}",
        f"own: cia406, node 23, on virtual {channel}",
    ]
