"""Wireshark's Modbus dissectors read what a client and the PROFIdrive axis have said, and mean what our
decoder means.
"""

from __future__ import annotations

import json
import shutil
import subprocess
from collections import Counter

import pytest

from emulators.drive.profidrive.faults import catalogue as numbers
from fieldbus.modbus import Request, RtuDecoder, TcpDecoder, TcpSplitter, function_text, unwrap_rtu
from fieldbus.modbus.export import write_serial_capture, write_tcp_capture
from testcases.unit.emulators_profidrive.modbus_rig import ACKNOWLEDGE, RUN, UNIT, ModbusRig

FIELDS = {
    "transaction": "mbtcp.trans_id",
    "unit": "mbtcp.unit_id",
    "rtu_unit": "mbrtu.unit_id",
    "crc": "mbrtu.crc16.status",
    "function": "modbus.func_code",
    "exception": "modbus.exception_code",
    "reference": "modbus.reference_num",
    "count": "modbus.word_cnt",
    "register": "modbus.regnum16",
    "value": "modbus.regval_uint16",
    "malformed": "_ws.malformed",
    "expert": "_ws.expert.message",
}


def dissect(path, *options):
    """Return one dictionary of lists per packet of a capture."""
    program = shutil.which("tshark")
    if program is None:
        pytest.fail("tshark is missing (Debian: apt-get install tshark)", pytrace=False)
    words = [word for field in FIELDS.values() for word in ("-e", field)]
    done = subprocess.run(
        [program, "-r", path, *options, "-T", "json", *words], check=True, capture_output=True, text=True
    )
    packets = [packet["_source"]["layers"] for packet in json.loads(done.stdout)]
    return [{name: packet[field] for name, field in FIELDS.items() if field in packet} for packet in packets]


def exchange(link):
    """A client that enables the axis, turns it, loses it to a fault, acknowledges, reads parameters, and asks
    nonsense.
    """
    rig = ModbusRig(link)
    rig.enable()
    rig.keep(0.2, RUN, 0x0800)
    rig.write_one(40101, 0xF000)
    rig.drive.raise_fault(numbers.OVERCURRENT)
    rig.read(40400, 8)
    rig.keep(0.1, ACKNOWLEDGE, 0)
    rig.write(40601, 1, 0x2F0A, 0x8001, 0x0101, 0x1001, 0x0002, 0x0000)
    rig.scheduler.run_for(50_000_000)
    rig.read(40601, 16)
    for request in (
        Request(3, 5000, 1),
        Request(4, 99, 1),
        Request(6, 109, 1, (1,)),
        Request(16, 600, 123, (0,) * 123),
    ):
        rig.ask(request)
    for code in (5, 6, 7, 8, 10, 11):
        rig.drive.refuse_requests(code)
        rig.read(40110)
    rig.drive.refuse_requests(None)
    rig.read(40100, 20)
    return rig


def compare(seen, pdus, words):
    """Hold what Wireshark has found in each frame against the bytes and against the words of our decoder."""
    reported: Counter[str] = Counter()
    assert len(seen) == len(pdus) == len(words)
    asked = None
    for one, pdu, text in zip(seen, pdus, words, strict=True):
        assert "malformed" not in one, text
        assert "not understood" not in text
        function = int(one["function"][0])
        assert function == pdu[0] & 0x7F
        if "exception" in one:
            reported["exception"] += 1
            assert pdu[0] & 0x80
            assert f"{int(one['exception'][0]):02X}h" in text
            continue
        assert not pdu[0] & 0x80
        assert function_text(function) in text
        if " request " in text:
            reported["request"] += 1
            asked = pdu
            assert int(one["reference"][0]) == pdu[1] << 8 | pdu[2]
            if function == 16:
                assert int(one["count"][0]) == pdu[3] << 8 | pdu[4]
        if "value" in one:
            reported["values"] += 1
            data = {3: pdu[2:], 16: pdu[6:], 6: pdu[3:]}[function]
            found = [int(value, 0) for value in one["value"]]
            assert found == [data[at] << 8 | data[at + 1] for at in range(0, len(data), 2)]
            first = asked[1] << 8 | asked[2]
            assert [int(at) for at in one.get("register", [first])] == list(range(first, first + len(found)))
    return reported


@pytest.mark.requirement(
    "MODB-013",
    "MODB-015",
    "MODB-018",
    "MODB-022",
    "MODB-023",
    "MODB-024",
    "MODB-025",
    "MODB-026",
    "MODB-027",
    "MODB-028",
    "MODB-029",
    "MODB-030",
    "MODB-031",
    "MODB-036",
)
def test_tcp(tmp_path):
    """Every ADU is one packet to it, well formed and with nothing to remark; function, registers, values,
    codes agree.
    """
    rig = exchange("tcp")
    seen = dissect(
        write_tcp_capture(rig.link.log, tmp_path / "bus.pcap"),
        "-o",
        "ip.check_checksum:TRUE",
        "-o",
        "tcp.check_checksum:TRUE",
    )
    assert not [one for one in seen if "malformed" in one]
    remarks = {text for one in seen for text in one.get("expert", ())}
    # The handshake is always worth a remark to it, and so is a response that is an exception.
    assert all("Connection" in text or "Exception" in text for text in remarks), remarks
    streams = {True: TcpSplitter(), False: TcpSplitter()}
    decoder = TcpDecoder()
    frames, words = [], []
    for segment in rig.link.log:
        from_server = segment.sender == "server"
        frames += streams[from_server].feed(segment.data)
        words += decoder.text(segment.data, from_server=from_server)
    adus = [one for one in seen if "function" in one]
    assert [(int(one["transaction"][0]), int(one["unit"][0])) for one in adus] == [
        (f[0], f[1]) for f in frames
    ]
    reported = compare(adus, [frame[2] for frame in frames], words)
    assert reported["exception"] == 10
    assert reported["request"] > 40
    assert reported["values"] > 30


@pytest.mark.requirement("MODB-005", "MODB-006", "MODB-013", "MODB-018", "MODB-022")
def test_rtu(tmp_path):
    """Every frame of the line is well formed to it, with the right checksum and unit; functions and codes
    agree.
    """
    rig = exchange("rtu")
    path = write_serial_capture(rig.link.log, tmp_path / "line.pcap")
    seen = dissect(
        path,
        "-o",
        'uat:user_dlts:"User 0 (DLT=147)","mbrtu","0","","0",""',
        "-o",
        "mbrtu.crc_verification:TRUE",
    )
    decoder = RtuDecoder()
    words = [decoder.text(frame.data) for frame in rig.link.log]
    contents = [unwrap_rtu(frame.data) for frame in rig.link.log]
    assert [int(one["rtu_unit"][0]) for one in seen] == [unit for unit, _ in contents]
    assert {unit for unit, _ in contents} == {UNIT}
    assert all(one["crc"] == ["1"] for one in seen)
    reported: Counter[str] = Counter()
    for one, (_, pdu), text in zip(seen, contents, words, strict=True):
        assert "malformed" not in one, text
        assert int(one["function"][0]) == pdu[0] & 0x7F
        assert ("exception" in one) == bool(pdu[0] & 0x80)
        if "exception" in one:
            reported["exception"] += 1
            assert f"{int(one['exception'][0]):02X}h" in text
    assert reported["exception"] == 10
