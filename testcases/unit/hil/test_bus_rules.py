"""Rules of the bus alone: silent on what the standard allows, loud on every answer, time and state that it
does not.
"""

from __future__ import annotations

from binascii import crc_hqx
from typing import Final

import pytest

from fieldbus.can import CanFrame
from fieldbus.modbus import rtu_frame
from fieldbus.modbus.bus_log import ModbusFrame
from hil.expect.rules import BUS_RULES, MODBUS_RULES, judge
from hil.record import Trace
from reports.model import Verdict

REMOTE: Final = "remote"
BOOT: Final = "1 703 00\n"


def _trace(text: str, **constants: float) -> Trace:
    """Return a bus log of lines with time in ms, identifier and bytes, or `remote`; node 3 and its master."""
    log = []
    for line in filter(None, text.splitlines()):
        time, identifier, *rest = line.split()
        can_id = int(identifier, 16)
        node = can_id & 0x7F == 3 and can_id >> 7 not in (4, 6, 8, 10, 12) and rest != [REMOTE]
        data = b"" if rest == [REMOTE] else bytes.fromhex("".join(rest))
        frame = CanFrame(can_id, data, remote=rest == [REMOTE])
        log.append((round(float(time) * 1e6), "node" if node else "master", frame, ""))
    end_ns = log[-1][0] + 1_000_000
    return Trace(
        [], events=[], frames={"can0": log}, constants={"can0.bitrate": 1e6, **constants}, end_ns=end_ns
    )


def _broken(trace: Trace) -> dict[str, str]:
    """Return what is wrong by the name of the rule."""
    return {
        check.name.removesuffix(" of can0"): check.observed
        for check in judge(trace)
        if check.verdict is not Verdict.PASSED
    }


NAME: Final = b"Emulated"
CRC: Final = crc_hqx(NAME, 0).to_bytes(2, "little").hex()
DIALOGUES: Final = {
    "expedited": """
        10 603 40 00 10 00 00 00 00 00
        11 583 43 00 10 00 92 01 02 00
        20 603 2B 17 10 00 F4 01 00 00
        21 583 60 17 10 00 00 00 00 00
        30 603 40 01 10 00 00 00 00 00
        31 583 4F 01 10 00 11 00 00 00""",
    "segments": """
        10 603 40 08 10 00 00 00 00 00
        11 583 41 08 10 00 08 00 00 00
        20 603 60 00 00 00 00 00 00 00
        21 583 00 45 6D 75 6C 61 74 65
        30 603 70 00 00 00 00 00 00 00
        31 583 1D 64 00 00 00 00 00 00
        40 603 21 00 20 00 05 00 00 00
        41 583 60 00 20 00 00 00 00 00
        50 603 05 01 02 03 04 05 00 00
        51 583 20 00 00 00 00 00 00 00""",
    "blocks": f"""
        10 603 A4 08 10 00 02 00 00 00
        11 583 C6 08 10 00 08 00 00 00
        20 603 A3 00 00 00 00 00 00 00
        21 583 01 45 6D 75 6C 61 74 65
        22 583 82 64 00 00 00 00 00 00
        30 603 A2 02 02 00 00 00 00 00
        31 583 D9 {CRC} 00 00 00 00 00
        40 603 A1 00 00 00 00 00 00 00
        50 603 C6 00 20 00 08 00 00 00
        51 583 A4 00 20 00 7F 00 00 00
        52 603 01 45 6D 75 6C 61 74 65
        53 603 82 64 00 00 00 00 00 00
        54 583 A2 02 7F 00 00 00 00 00
        55 603 D9 {CRC} 00 00 00 00 00
        56 583 A1 00 00 00 00 00 00 00""",
    "aborts": """
        10 603 40 FF 5F 00 00 00 00 00
        11 583 80 FF 5F 00 00 00 02 06
        20 603 60 00 00 00 00 00 00 00
        21 583 80 FF 5F 00 01 00 04 05
        30 603 40 08 10 00 00 00 00 00
        31 583 41 08 10 00 08 00 00 00
        40 603 70 00 00 00 00 00 00 00
        41 583 80 08 10 00 00 00 03 05
        50 603 40 08 10 00 00 00 00 00
        51 583 41 08 10 00 08 00 00 00
        900 583 80 08 10 00 00 00 04 05""",
}


@pytest.mark.parametrize("name", DIALOGUES)
def test_an_answer_with_a_wrong_byte_breaks_the_dialogue(name: str, subtests: pytest.Subtests) -> None:
    """Sound dialogues pass; of every answer each byte that the standard fixes may not be another, no answer
    may be left out of the middle, and none may come twice.
    """
    text = BOOT + DIALOGUES[name].strip()
    assert _broken(_trace(text)) == {}
    lines = text.splitlines()
    for place, line in enumerate(lines):
        time, can_id, *data = line.split()
        if can_id != "583":
            continue
        payload = bytes.fromhex("".join(data))
        free = _free_bytes(payload)
        for at in set(range(8)) - free:
            wrong = bytearray(payload)
            wrong[at] ^= 0x55
            changed = [*lines[:place], f"{time} 583 {wrong.hex()}", *lines[place + 1 :]]
            with subtests.test(line=place, byte=at):
                assert "SDO dialogue" in _broken(_trace("\n".join(changed)))
        with subtests.test(line=place, twice=True):
            twice = [*lines[: place + 1], f"{float(time) + 0.5} 583 {payload.hex()}", *lines[place + 1 :]]
            assert "SDO dialogue" in _broken(_trace("\n".join(twice)))


def _free_bytes(payload: bytes) -> set[int]:
    """Return the bytes of an answer that no rule can know: values, sizes, texts, block sizes."""
    command = payload[0]
    if command == 0x80:
        return {b"\0\0\2\6": {4, 5, 6, 7}, b"\1\0\4\5": {1, 2, 3}}.get(payload[4:], set())
    if command & 0xE3 == 0x43:
        return set(range(4, 8 - (command >> 2 & 3)))
    if command & 0xFB == 0xA0:
        return {4}
    if command == 0xA2:
        return {2}
    if command >> 5 == 2 or command & 0xF9 == 0xC0:
        return {4, 5, 6, 7}
    if command in (0x00, 0x01):
        return set(range(1, 8))
    return {1} if command in (0x1D, 0x82) else set()


BEATS: Final = "10 603 2B 17 10 00 14 00 00 00\n11 583 60 17 10 00 00 00 00 00\n"
MAPPED: Final = """
2 603 23 00 18 01 83 01 00 00
2.2 583 60 00 18 01 00 00 00 00
2.4 603 2F 00 18 02 {kind} 00 00 00
2.6 583 60 00 18 02 00 00 00 00
2.8 603 2B 00 18 05 {timer} 00 00 00
3.0 583 60 00 18 05 00 00 00 00
3.2 603 2B 00 18 03 {pause} 00 00
3.4 583 60 00 18 03 00 00 00 00
3.6 603 23 00 1A 01 10 00 41 60
3.8 583 60 00 1A 01 00 00 00 00
4.0 603 2F 00 1A 00 01 00 00 00
4.2 583 60 00 1A 00 00 00 00 00
4.4 000 01 03
"""
CYCLIC: Final = (
    BOOT + MAPPED.format(kind="02", timer="00", pause="00 00") + "10 080\n20 080\n20.2 183 00 00\n30 080\n"
)
BY_EVENT: Final = BOOT + MAPPED.format(kind="FF", timer="1E", pause="64 00") + "10 183 00 00\n"
WATCHED: Final = """
1 703 00
2 603 23 16 10 01 32 00 63 00
2.2 583 60 16 10 01 00 00 00 00
3 763 05
40 763 05
"""
GUARDED: Final = "1 703 00\n10 703 remote\n10.2 703 7F\n20 703 remote\n20.2 703 FF\n30 703 remote\n"
CASES: Final = {
    "frames and their length": (
        "1 080\n1.124 185 00 00 00 00 00 00 00 00\n1.175 080\n",
        {
            "1 080\n1.123 185 00 00 00 00 00 00 00 00\n": "123.0 bits behind",
            "1 185 00\n1.050 080\n": "50.0 bits behind",
        },
    ),
    "NMT state": (
        BOOT + "5 000 01 03\n10 703 05\n20 000 02 00\n30 703 04\n40 000 80 03\n40.3 703 04\n50 703 7F\n",
        {
            BOOT + "5 000 01 03\n10 703 7F\n": "state 127 in place of 5",
            BOOT + "5 000 01 04\n10 703 05\n": "state 5 in place of 127",
            BOOT + "5 000 02 03\n10 703 05\n": "state 5 in place of 4",
            BOOT + "5 000 01 03\n10 703 05 00\n": "with 2 bytes",
        },
    ),
    "services of a state": (
        BOOT + "5 000 01 03\n10 183 00\n20 000 02 03\n21 183 00\n30 703 04\n",
        {
            BOOT + "5 000 02 03\n10 183 00\n": "a PDO in Stopped",
            BOOT + "5 000 02 03\n10 583 43 00 10 00 00 00 00 00\n": "an SDO answer in Stopped",
            BOOT + "5 000 80 03\n10 283 00\n": "a PDO in Pre-operational",
            BOOT + "5 000 81 03\n10 083 00 00 00 00 00 00 00 00\n": "an EMCY in boot-up",
        },
    ),
    "boot-up": (
        BOOT + "5 000 81 03\n900 703 00\n",
        {BOOT + "5 000 82 03\n1100 703 00\n": "no boot-up"},
    ),
    "heartbeat time": (
        BOOT + BEATS + "31 703 7F\n51.2 703 7F\n71 703 7F\n",
        {
            BOOT + BEATS + "31 703 7F\n55 703 7F\n": "24.000 ms in place of 20.000 ms",
            BOOT + BEATS + "31 703 7F\n47 703 7F\n": "16.000 ms in place of 20.000 ms",
            BOOT + BEATS + "31 703 7F\n60 000 01 03\n": "end",
            BOOT + BEATS.replace(" 14 ", " 00 ") + "31 703 7F\n": "1017h = 0",
        },
    ),
    "heartbeat consumer": (
        WATCHED + "90 083 30 81 11 00 00 00 00 00\n120 703 7F\n",
        {
            WATCHED + "90.2 703 7F\n120 703 7F\n": "does not tell a missing heartbeat",
            WATCHED + "70 083 30 81 11 00 00 00 00 00\n80 763 05\n": "not due",
            WATCHED
            + "110 083 30 81 11 00 00 00 00 00\n": "does not tell a missing heartbeat (8130h); 2 times",
        },
    ),
    "guarding toggle bit": (
        GUARDED + "30.2 703 7F\n",
        {GUARDED + "30.2 703 FF\n": "toggle bit 1"},
    ),
    "EMCY and register": (
        BOOT + "5 083 10 23 03 00 00 00 00 00\n9 083 00 00 00 00 00 00 00 00\n",
        {
            BOOT + "5 083 10 23 01 00 00 00 00 00\n": "03h is missing",
            BOOT + "5 083 10 32 05 00 00\n": "with 5 bytes",
            BOOT + "5 083 30 81 01 00 00 00 00 00\n": "11h is missing",
        },
    ),
    "transmit PDOs": (
        CYCLIC + "40 080\n40.2 183 00 00\n50 080\n",
        {
            CYCLIC + "30.2 183 00 00\n40 080\n": "after 1 SYNCs, 2 are set",
            CYCLIC + "40 080\n50 080\n50.2 183 00 00\n": "after 3 SYNCs, 2 are set",
            CYCLIC + "40 080\n40.2 183 00\n": "1 bytes, 2 are mapped",
            CYCLIC + "40 080\n50 080\n60 080\n70 080\n": "does not come",
            BY_EVENT + "25 183 00 00\n50 183 00 00\n90 183 00 00\n": "after 40.00 ms",
            BY_EVENT + "16 183 00 00\n": "inhibit time is 10.0 ms",
            BY_EVENT + "25 183 00 00\n80 703 05\n": "does not come, its event timer is 30 ms",
        },
    ),
}


def test_every_rule_of_the_bus_notices_what_it_forbids(subtests: pytest.Subtests) -> None:
    """A sound log breaks no rule; each log against one of them breaks it, with the words for it."""
    assert sorted(rule.name for rule in BUS_RULES) == sorted((*CASES, "SDO dialogue"))
    for name, (sound, wrong) in CASES.items():
        with subtests.test(name):
            trace = _trace(sound)
            assert _broken(trace) == {}
            assert f"{name} of can0" in {check.name for check in judge(trace)}
        for text, words in wrong.items():
            with subtests.test(name, words=words):
                assert words in _broken(_trace(text)).get(name, "nothing")


SLOW: Final = (
    BOOT + "5 000 80 03\n90 183 00\n95 703 05\n",
    BOOT + "5 083 10 32 01 00 00 00 00 00\n",
    "1 000 81 03\n2500 703 00\n",
)
"""What real devices do: act late on a command, leave optional bits of 1001h alone, boot long."""


def test_devices_of_others_may_be_slow_and_leave_out_what_is_optional(subtests: pytest.Subtests) -> None:
    """On a live bench the rules allow what CiA 301 leaves open, and no more."""
    for text in SLOW:
        with subtests.test(text):
            assert _broken(_trace(text)) != {}
            assert _broken(_trace(text, **{"bench.live": 1.0})) == {}
    late = BOOT + "5 000 80 03\n115 183 00\n120 703 05\n"
    found = _broken(_trace(late, **{"bench.live": 1.0}))
    assert sorted(found) == ["NMT state", "services of a state"]
    bad = _broken(_trace(BOOT + "5 083 10 32 04 00 00 00 00 00\n", **{"bench.live": 1.0}))
    assert "01h is missing" in bad["EMCY and register"]


REQUESTS: Final = {
    "01 000A 0009": (
        "01 02 24 01",
        ("01 02 24 03", "01 01 24", "01 03 24 01 00", "02 02 24 01", "81 09"),
    ),
    "03 000A 0002": ("03 04 100A 100B", ("03 04 100A", "03 02 100A 100B", "04 04 100A 100B", "83 00")),
    "06 000A ABCD": ("06 000A ABCD", ("06 000B ABCD", "06 000A ABCE", "06 000A")),
    "10 000A 0001 02 ABCD": ("10 000A 0001", ("10 000A 0002", "10 000A 0001 02")),
    "16 000A 00F2 0025": ("16 000A 00F2 0025", ("16 000A 00F2 0024",)),
    "08 0000 A537": ("08 0000 A537", ("08 0001 A537",)),
    "2B 0E 01 00": ("2B 0E 01 01 00 00 00", ("2B 0D 01 01 00 00 00",)),
    "03 000A 007E": ("83 03", ("03 FC" + 126 * "0000",)),
    "00": ("", ("03 02 0001",)),
}
"""Requests, right responses and wrong ones."""


def _link(asked: str, answer: str, *, spoil: bool = False, protocol: str = "modbus_rtu") -> Trace:
    pdu = bytes.fromhex(answer)
    if protocol == "modbus_tcp":
        data = b"\0\7\0\0" + (len(pdu) + 1 + spoil).to_bytes(2, "big") + b"\5" + pdu
    else:
        data = rtu_frame(5, pdu)
        data = data[:-1] + bytes((data[-1] ^ spoil,))
    frame = ModbusFrame(protocol, data, bytes.fromhex(asked))
    return Trace([], events=[], frames={"net0": [(1_000_000, "drive1", frame, "")]}, end_ns=2_000_000)


def test_the_rule_of_modbus_notices_what_it_forbids(subtests: pytest.Subtests) -> None:
    """A response that fits passes on a line and over TCP; each wrong one, CRC and header break the rule."""
    (rule,) = MODBUS_RULES

    def broken(trace: Trace) -> bool:
        return any(
            check.name.startswith(rule.name) and check.verdict is not Verdict.PASSED for check in judge(trace)
        )

    for asked, (right, wrong) in REQUESTS.items():
        for protocol in ("modbus_rtu", "modbus_tcp"):
            with subtests.test(asked, protocol=protocol):
                assert not right or not broken(_link(asked, right, protocol=protocol))
                assert not right or broken(_link(asked, right, protocol=protocol, spoil=True))
                assert [text for text in wrong if not broken(_link(asked, text, protocol=protocol))] == []
