"""`hil emulate`: its messages, its end, and that it can run for weeks. On SocketCAN: `testcases/vcan`."""

from __future__ import annotations

import base64
import os
import re
import signal
import threading
import time

import can
import pytest

from fieldbus.can import CanFrame
from fieldbus.can.live import LiveSegment
from fieldbus.clock import RealtimeScheduler
from fieldbus.errors import BusError
from fieldbus.history import History
from hil.bench import load_bench
from hil.bench.bench_file import parse
from hil.bench.drive_host import DriveHost
from hil.cli import main

PATIENCE_S = 60.0

PHYSICAL = """
[bench]
name = "hardware only"
kind = "live"
[segment.can0]
interface = "socketcan"
channel = "can0"
[drive.drive1]
segment = "can0"
node_id = 5
device = "physical"
"""
TWO_SEGMENTS = """
[bench]
name = "two segments"
[segment.left]
[segment.right]
[drive.drive1]
segment = "left"
node_id = 5
[drive.drive2]
segment = "right"
node_id = 5
"""
WRONG_VALUE = TWO_SEGMENTS.replace("node_id = 5", "node_id = 500", 1)

DEVICE_TYPE = can.Message(arbitration_id=0x605, data=bytes.fromhex("4000100000000000"), is_extended_id=False)


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("text", "arguments", "message"),
    [
        (None, ["nosuch.toml"], "nosuch.toml: cannot be read"),
        (WRONG_VALUE, [], r"bench\.toml: drive\.drive1\.node_id: 500 is not allowed"),
        (PHYSICAL, [], "'hardware only' has no emulated drive"),
        (
            TWO_SEGMENTS,
            ["-i", "virtual", "-c", "x"],
            "drive1 and drive2 are both node 5: .* virtual x is one bus",
        ),
        (None, ["live", "-i", "nonsense"], "can0: nonsense vcan0 cannot be opened: Unknown interface"),
        (None, ["live", "-i", "socketcan", "-c", "nosuch0"], "can0: socketcan nosuch0 cannot be opened: "),
        (None, ["live", "-o", "port"], "--option: 'port' is not allowed; allowed: KEY=VALUE"),
        (None, ["live", "-o", "channel=x", "-i", "virtual"], "--option: 'channel=x' is not allowed"),
        (None, ["live", "-o", "port=1"], "allowed: together with --interface or --channel"),
        (
            None,
            ["live", "-i", "udp_multicast", "-c", "239.74.163.2", "-o", "port=65536"],
            r"can0: udp_multicast 239\.74\.163\.2 cannot be opened: ",
        ),
        (
            None,
            ["profidrive_tcp", "-i", "socketcan"],
            "--interface: 'socketcan' is not allowed; allowed: for drives on CAN only",
        ),
        (
            None,
            ["profidrive_rtu", "-a", "slcan"],
            "--adapter: 'slcan' is not allowed; allowed: for drives on CAN only",
        ),
        (None, ["live", "--adapter", "pcan"], "--adapter: 'pcan' is not allowed; allowed: slcan"),
        (
            None,
            ["live", "--link", "tty"],
            (
                "--link: 'tty' is not allowed; allowed: a path, together with --adapter or a drive on a "
                "Modbus line"
            ),
        ),
        (
            None,
            ["live", "-a", "slcan", "--link", "/nosuch/tty"],
            "--link /nosuch/tty: No such file or directory",
        ),
        (
            None,
            ["live", "--for", "-1"],
            "--for: -1.0 is not allowed; allowed: a number of seconds, 0 or more",
        ),
        (None, ["live", "--for", "nan"], "--for: nan is not allowed"),
        (None, ["live", "--for", "inf"], "--for: inf is not allowed"),
    ],
    ids=lambda value: "-".join(value)[:40] if isinstance(value, list) else "",
)
def test_mistakes_are_reported_in_one_line(tmp_path, capsys, text, arguments, message):
    """What cannot work ends with exit code 2 and one line that says what and where."""
    bench = tmp_path / "bench.toml"
    if text is not None:
        bench.write_text(text, encoding="utf-8")
        arguments = [str(bench), *arguments]
    assert main(["emulate", *arguments]) == 2
    reported = capsys.readouterr()
    assert reported.out == ""
    (line,) = [line for line in reported.err.splitlines() if line.startswith("hil: ")]
    assert re.search(message, line)
    assert "Traceback" not in reported.err


@pytest.mark.exhaustive
def test_it_answers_and_ends_with_a_signal(capsys, request):
    """It says when it is ready, answers on the bus, tells state changes, and ends with exit code 0 on
    SIGTERM.
    """
    channel = request.node.name
    answers = []

    def controller():
        try:
            with can.Bus(interface="virtual", channel=channel) as bus:
                end = time.monotonic() + PATIENCE_S
                while not answers and time.monotonic() < end:
                    bus.send(DEVICE_TYPE)
                    message = bus.recv(0.2)
                    if message is not None and message.arbitration_id == 0x585:
                        answers.append(message.data.hex())
                        bus.send(can.Message(arbitration_id=0, data=b"\x01\x05", is_extended_id=False))
                        time.sleep(0.5)
        finally:
            os.kill(os.getpid(), signal.SIGTERM)

    before = signal.getsignal(signal.SIGTERM)
    thread = threading.Thread(target=controller)
    thread.start()
    try:
        code = main(["emulate", "live", "--interface", "virtual", "--channel", channel])
    finally:
        thread.join()
    assert code == 0
    assert answers == ["4300100092010200"]
    lines = capsys.readouterr().err.splitlines()
    assert lines[:2] == [f"drive1: cia402, node 5, on virtual {channel}", "ready; end with Ctrl-C"]
    assert any(line.endswith("drive1  drive.nmt  PRE_OPERATIONAL -> OPERATIONAL") for line in lines[2:])
    assert signal.getsignal(signal.SIGTERM) is before


@pytest.mark.exhaustive
def test_it_ends_by_itself(capsys, request):
    """After the time of --for it ends with exit code 0."""
    assert main(["emulate", "live", "-i", "virtual", "-c", request.node.name, "--for", "0.2"]) == 0
    assert "ready" in capsys.readouterr().err


@pytest.mark.parametrize("record", [True, False])
def test_without_a_record_nothing_grows(request, record):
    """The host of `hil emulate` keeps neither frames nor events nor signals, that of a bench events and
    signals, from any number on.
    """
    reported = []
    with can.Bus(interface="virtual", channel=request.node.name) as controller:
        place = {"interface": "virtual", "channel": request.node.name}
        host = DriveHost(load_bench("live").config, place=place, record=record)
        try:
            host.history.listen(lambda event: reported.append(event.data.get("to")))
            assert host.run_until(lambda: host.booted, PATIENCE_S)
            controller.send(can.Message(arbitration_id=0, data=b"\x01\x05", is_extended_id=False))
            assert host.run_until(lambda: "OPERATIONAL" in reported, PATIENCE_S)
            host.run_until(lambda: False, 0.1)
            assert not host.segments["can0"].log
            assert bool(host.history.events) is record
            fetch = {"call": "fetch", "kwargs": {"rows": {}, "events": 1}}
            found = host.execute(fetch)
            assert bool(found["groups"]) is record
            assert not found["more"]
            for name, group in found["groups"].items():
                content = base64.b64decode(group["content"])
                fetch["kwargs"]["rows"] = {name: 1}
                later = base64.b64decode(host.execute(fetch)["groups"][name]["content"])
                assert later.startswith(content[8 * (1 + len(group["columns"])) :])
        finally:
            host.close()


def test_defaults_of_the_drive_fit_its_bench_file(request):
    """A controller that writes no parameters gets the ramps of the bench file: OFF1, OFF3 and the cycle."""
    config = load_bench("live").config
    place = {"interface": "virtual", "channel": request.node.name}
    host = DriveHost(config, place=place, record=False)
    try:
        section = config.drive["drive1"]
        get = host.devices.drives["drive1"].slave.get
        assert get(0x60A9) == 0xFDB44700  # 10^-3 rpm
        assert get(0x6083) == get(0x6084) == 1000 * section.max_speed_rpm / section.off1_ramp_s
        assert get(0x6085) == 1000 * section.max_speed_rpm / section.off3_ramp_s
        assert get(0x607F) == 1000 * section.max_speed_rpm
        assert 0 < get(0x6081) <= get(0x607F)
        assert (get(0x60C2, 1), get(0x60C2, 2)) == (config.bench.cycle_ms, -3)
    finally:
        host.close()


@pytest.mark.parametrize("lossy", [False, True])
def test_a_bus_that_fails_does_not_end_a_lossy_segment(lossy):
    """A frame that the bus refuses is an error for a controller and a loss for a device; both find it in the
    history.
    """
    scheduler = RealtimeScheduler()
    history = History(scheduler)
    bus = can.Bus(interface="virtual", channel="failing")
    with LiveSegment(scheduler, bus, history=history, lossy=lossy) as segment:
        port = segment.attach("device", lambda _frame, _time_ns: None)
        bus.shutdown()
        if lossy:
            port.send(CanFrame(0x705, b"\x7f"))
        else:
            with pytest.raises(BusError):
                port.send(CanFrame(0x705, b"\x7f"))
        assert [event.data["status"] for event in history.select(kind="can.status")] == ["DOWN"]


def test_a_bus_that_cannot_be_opened_leaves_nothing_open(request):
    """When the second segment fails, the first one is closed again."""
    text = TWO_SEGMENTS.replace('name = "two segments"', 'name = "two"\nkind = "live"')
    text = text.replace("[segment.left]", '[segment.left]\ninterface = "virtual"\nchannel = "left"')
    text = text.replace("[segment.right]", '[segment.right]\ninterface = "nonsense"\nchannel = "right"')
    before = set(threading.enumerate())
    with pytest.raises(BusError, match="right: nonsense right cannot be opened"):
        DriveHost(parse(text, request.node.name))
    assert set(threading.enumerate()) <= before
