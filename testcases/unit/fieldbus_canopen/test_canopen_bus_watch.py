"""Collisions of identifiers, and the EMCY codes of CiA 301 on the bus."""

from __future__ import annotations

import pytest

from fieldbus.canopen import FrameDecoder, NmtCommand
from fieldbus.cia402 import emcy_text


def emcys(bench):
    return [int.from_bytes(data[:2], "little") for data in bench.take(0x085)]


@pytest.mark.requirement("C301-125")
@pytest.mark.parametrize("can_id", [0x085, 0x185, 0x285, 0x585, 0x705])
def test_another_node_with_an_own_identifier(bench, can_id):
    """A frame of another node with an identifier that this one sends is 8150h, once, and over a second after
    the last.
    """
    bench.nmt(NmtCommand.START)
    bench.run(5)
    bench.take()
    for _ in range(5):
        bench.send(can_id, bytes(1))
        bench.run(300)
    assert emcys(bench) == [0x8150]
    assert bench.slave.bus_watch.collisions == 5
    bench.run(1000)
    assert emcys(bench) == [0]
    assert bench.read(0x1001) == 0
    bench.send(can_id, bytes(1))
    bench.run()
    assert emcys(bench) == [0x8150]


@pytest.mark.requirement("C301-125")
def test_identifiers_of_others_do_not_collide(bench):
    """What other nodes send, and requests to this one, are no collisions; nor is an identifier that has moved
    away.
    """
    bench.nmt(NmtCommand.START)
    bench.write(0x1014, 0, 0x80000085, 4)
    bench.write(0x1014, 0, 0xA5, 4)
    bench.take()
    for can_id in (0x000, 0x080, 0x100, 0x086, 0x186, 0x205, 0x586, 0x605, 0x706, 0x7E5, 0x085, 0x485):
        bench.send(can_id, bytes(8) if can_id else b"")
    bench.ask(0x705, remote=True, dlc=1)
    bench.run(10)
    assert bench.slave.bus_watch.collisions == 0


@pytest.mark.requirement("C301-125")
def test_collision_ends_with_a_reset(bench):
    """Reset communication ends the error and its timer."""
    bench.send(0x705, b"\x05")
    bench.run()
    assert emcys(bench) == [0x8150]
    bench.nmt(NmtCommand.RESET_COMMUNICATION)
    bench.run(3000)
    assert bench.read(0x1001) == 0
    assert emcys(bench) == []


@pytest.mark.requirement(
    "C301-114", "C301-115", "C301-116", "C301-117", "C301-118", "C301-119", "C301-120", "C301-126", "C301-131"
)
@pytest.mark.parametrize(
    ("codes", "register"),
    [
        ((0x1000, 0x5000, 0x6000, 0x6100, 0x6200, 0x6300, 0x8000, 0x9000, 0xF001), 0x01),
        ((0x2000, 0x2100, 0x2200, 0x2300, 0x2310), 0x03),
        ((0x3000, 0x3100, 0x3200, 0x3300, 0x3210), 0x05),
        ((0x4000, 0x4100, 0x4200, 0x4210), 0x09),
        (
            (0x8100, 0x8110, 0x8120, 0x8130, 0x8140, 0x8150, 0x8200, 0x8210, 0x8220, 0x8230, 0x8240, 0x8250),
            0x11,
        ),
        ((0x7000, 0x7300), 0x21),
        ((0xFF01, 0xFFFF), 0x81),
    ],
)
def test_emcy_codes_on_the_bus(bench, codes, register):
    """Every group of error codes is sent with the bits of its group in 1001h, has words, and ends with
    0000h.
    """
    decoder = FrameDecoder({5: "drive1"})
    for code in codes:
        bench.received.clear()
        bench.slave.emcy(code, data=b"\x01\x02")
        bench.run()
        (frame,) = [frame for _, frame in bench.received]
        assert frame.data == code.to_bytes(2, "little") + bytes((register, 1, 2, 0, 0, 0)), f"{code:04X}"
        assert emcy_text(code).split(" (")[0]
        assert f"{code:04X}h" in decoder.decode(frame)
        bench.received.clear()
        bench.slave.emcy_clear(code)
        bench.run()
        assert [frame.data for _, frame in bench.received] == [bytes(8)]
