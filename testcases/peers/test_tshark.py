"""Wireshark's CANopen dissector reads the bus log of a bench, frame by frame, and means the same as our own
decoder.
"""

from __future__ import annotations

import json
import shutil
import subprocess
from collections import Counter

import canopen
import pytest

from fieldbus.can.export import write_log
from fieldbus.canopen import PumpedNetwork
from hil.bench import load_bench
from hil.logs import read_bus_log

NODE = 5
FIELDS = {
    "can_id": "can.id",
    "function": "canopen.function_code",
    "index": "canopen.sdo.main_idx",
    "sub": "canopen.sdo.sub_idx",
    "abort": "canopen.sdo.abort_code",
    "emcy": "canopen.em.err_code",
    "state": "canopen.nmt_guard.state",
    "command": "canopen.nmt_ctrl.cd",
    "malformed": "_ws.malformed",
    "expert": "_ws.expert.message",
}


def dissect(path):
    """Return one dictionary of the fields above per frame of a log."""
    program = shutil.which("tshark")
    if program is None:
        pytest.fail("tshark is missing (Debian: apt-get install tshark)", pytrace=False)
    options = [word for field in FIELDS.values() for word in ("-e", field)]
    done = subprocess.run(
        [program, "-r", path, "-d", "can.subdissector,canopen", "-T", "json", *options],
        check=True,
        capture_output=True,
        text=True,
    )
    packets = [packet["_source"]["layers"] for packet in json.loads(done.stdout)]
    return [
        {name: packet[field][0] for name, field in FIELDS.items() if field in packet} for packet in packets
    ]


def number(text):
    """Return the number that tshark shows, decimal or hexadecimal."""
    return int(text, 0)


@pytest.fixture(scope="module")
def run():
    """A bench that enables, moves, trips, and is asked for objects that it has and has not; its log and
    decoder.
    """
    with load_bench("reference").build(seed=0) as bench:
        segment = bench.segment()
        with PumpedNetwork(segment, name="stranger") as network:
            sdo = network.add_node(NODE, canopen.ObjectDictionary()).sdo
            sdo.upload(0x1008, 0)
            sdo.download(0x6403, 0, b"a text that takes several segments")
            for index, sub in ((0x5FFF, 0), (0x607D, 9)):
                with pytest.raises(canopen.SdoAbortedError):
                    sdo.upload(index, sub)
            with sdo.open(0x6403, 0, "wb", size=300, block_transfer=True) as stream:
                stream.write(bytes(range(0x20, 0x70)) * 3 + bytes(60))
        power = bench.axis().power()
        bench.run_until(power.status, 2.0)
        bench.axis().move_velocity(50.0)
        bench.run_for(0.2)
        bench.drive().raise_fault(0x2310)
        bench.run_for(0.3)
        yield bench, bench.trace().raw_frames("can0")


@pytest.mark.requirement("C301-164")
@pytest.mark.parametrize("suffix", [".log", ".blf", ".pcap", ".pcapng"])
def test_every_frame_is_well_formed(run, tmp_path, suffix):
    """All log formats are read in full, and no frame is malformed or remarkable to Wireshark."""
    _, frames = run
    seen = dissect(write_log(frames, tmp_path / f"bus{suffix}"))
    assert [number(one["can_id"]) for one in seen] == [frame.can_id for _, _, frame, _ in frames]
    assert not [one for one in seen if "malformed" in one or "expert" in one]
    assert all("function" in one for one in seen)


def test_what_wireshark_writes_is_read(run, tmp_path):
    """Logs that Wireshark's editcap has written again, as pcap, pcap with nanoseconds and pcapng, are the
    same logs.
    """
    _, frames = run
    own = write_log(frames, tmp_path / "own.pcapng", channel="vcan2")
    wanted = [(time_ns, frame) for time_ns, _, frame, _ in frames]
    for kind, unit_ns in (("pcapng", 1), ("nsecpcap", 1), ("pcap", 1000)):
        path = tmp_path / f"{kind}.pcapng"
        subprocess.run(["editcap", "-F", kind, own, path], check=True)
        log = read_bus_log(path)
        ((channel, entries),) = log.channels.items()
        assert channel == ("vcan2" if kind == "pcapng" else "")
        assert [(t // unit_ns, frame) for t, _, frame, _ in entries] == [
            (t // unit_ns, frame) for t, frame in wanted
        ]


@pytest.mark.requirement(
    "C301-001", "C301-003", "C301-005", "C301-006", "C301-009", "C301-010", "C301-062", "C301-164"
)
def test_the_dissector_means_what_our_decoder_means(run, tmp_path):
    """Object, abort code, error code and state that Wireshark reads stand in the words of our decoder as
    well.
    """
    bench, frames = run
    seen = dissect(write_log(frames, tmp_path / "bus.log"))
    reported: Counter[str] = Counter()
    initiates = {1, 2, 4}  # command specifiers whose frames carry an object
    for one, (_, _, frame, _) in zip(seen, frames, strict=True):
        words = bench.decode(frame)
        assert "malformed" not in words
        # Wireshark takes the data of the segments of a block for requests of their own.
        if "index" in one and frame.data[0] >> 5 in initiates and "segment" not in words:
            reported["object"] += 1
            assert f"{number(one['index']):04X}h" in words
        if "abort" in one:
            reported["abort"] += 1
            assert f"{number(one['abort']):08X}h" in words
        if "emcy" in one:
            reported["emergency"] += 1
            assert f"{number(one['emcy']):04X}h" in words
        if "state" in one:
            reported["error control"] += 1
        if "command" in one:
            reported["node control"] += 1
    assert reported["object"] > 20
    assert reported["abort"] == 2
    assert reported["emergency"] >= 1
    assert reported["error control"] > 5
    assert reported["node control"] >= 1
