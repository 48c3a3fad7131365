"""Multiplex PDOs of the slave, in destination and in source address mode."""

from __future__ import annotations

from struct import pack

import pytest

from fieldbus.canopen import AbortCode, NmtCommand, load_dictionary
from fieldbus.errors import ConfigurationError

DAM, SAM = 0xFF, 0xFE

LISTS = """
[1FA0]
ParameterName=Scanner list
ObjectType=8
DataType=0x0007
AccessType=rw
CompactSubObj=2

[1FD0]
ParameterName=Dispatcher list
ObjectType=8
DataType=0x001B
AccessType=rw
CompactSubObj=2
"""


def multiplex(bench, index, kind):
    """Make the PDO of a communication record a multiplex PDO."""
    cob_id = 0x40000000 if index >= 0x1800 else 0
    cob_id |= {0x1400: 0x205, 0x1800: 0x185}[index]
    assert bench.write(index, 1, 0x80000000 | cob_id, 4) == 0
    assert bench.write(index, 2, 254, 1) == 0
    assert bench.write(index + 0x200, 0, kind, 1) == 0
    assert bench.write(index, 1, cob_id, 4) == 0
    bench.nmt(NmtCommand.START)
    bench.run(5)
    bench.take()


def frame(head, index, sub, value):
    return pack("<BHBI", head, index, sub, value)


@pytest.mark.requirement("C301-051")
@pytest.mark.parametrize(("node", "taken"), [(5, True), (0, True), (6, False)])
def test_destination_mode_writes_the_object_that_the_frame_names(bench, node, taken):
    """A DAM frame for this node, or for all, writes its object; one for another node does nothing."""
    seen = []
    bench.slave.on_write(0x60FF, 0, seen.append)
    multiplex(bench, 0x1400, DAM)
    bench.send(0x205, frame(0x80 | node, 0x60FF, 0, 1234))
    bench.run()
    assert bench.slave.get(0x60FF) == (1234 if taken else 0)
    assert seen == ([1234] if taken else [])
    assert bench.take(0x085) == []


@pytest.mark.requirement("C301-051")
def test_destination_mode_takes_the_length_of_the_object(bench):
    """An object of two bytes takes two of the four; its limits hold, and a refused value is no error of the
    PDO.
    """
    multiplex(bench, 0x1400, DAM)
    bench.send(0x205, frame(0x85, 0x6040, 0, 0xABCD0006))
    bench.send(0x205, frame(0x85, 0x2000, 0, 9))
    bench.run()
    assert (bench.slave.get(0x6040), bench.slave.get(0x2000)) == (6, 3)
    assert bench.take(0x085) == []


@pytest.mark.requirement("C301-128")
@pytest.mark.parametrize("place", [(0x4711, 0), (0x6040, 1), (0x6041, 0), (0x6083 + 0x100, 0), (0x2007, 0)])
def test_destination_that_is_not_there(bench, place):
    """A destination that does not exist, is read-only or longer than four bytes is reported by 8230h, once
    until one is found.
    """
    multiplex(bench, 0x1400, DAM)
    for _ in range(3):
        bench.send(0x205, frame(0x85, *place, 1))
        bench.run()
    assert [data[:3] for data in bench.take(0x085)] == [b"\x30\x82\x11"]
    bench.send(0x205, frame(0x85, 0x6040, 0, 6))
    bench.run()
    assert [data[:3] for data in bench.take(0x085)] == [b"\0\0\0"]
    bench.send(0x205, frame(0x85, *place, 1))
    bench.run()
    assert [data[:3] for data in bench.take(0x085)] == [b"\x30\x82\x11"]


@pytest.mark.requirement("C301-051", "C301-054")
def test_short_multiplex_pdo(bench):
    """A multiplex PDO has eight bytes; a shorter one is a length error."""
    multiplex(bench, 0x1400, DAM)
    bench.send(0x205, frame(0x85, 0x6040, 0, 6)[:7])
    bench.run()
    assert [data[:2] for data in bench.take(0x085)] == [b"\x10\x82"]
    assert bench.slave.get(0x6040) == 0


@pytest.mark.requirement("C301-051")
def test_frames_of_the_other_mode_are_ignored(bench):
    """A record in destination mode does not take source frames."""
    multiplex(bench, 0x1400, DAM)
    bench.send(0x205, frame(0x05, 0x6040, 0, 6))
    bench.run()
    assert bench.slave.get(0x6040) == 0


@pytest.mark.requirement("C301-051")
def test_producer_in_destination_mode(bench):
    """The device sends an object to a node it names, in Operational, with a PDO that is in this mode."""
    assert not bench.slave.send_multiplexed(1, 9, 0x2000, 0, b"\x01")
    multiplex(bench, 0x1800, DAM)
    assert bench.slave.send_multiplexed(1, 9, 0x6040, 1, b"\x34\x12")
    assert not bench.slave.send_multiplexed(2, 9, 0x6040, 1, b"\x34\x12")
    bench.run()
    assert bench.take(0x185) == [b"\x89\x40\x60\x01\x34\x12\0\0"]
    for arguments in (
        (128, 0x6040, 0, b""),
        (1, 0x10000, 0, b""),
        (1, 0x6040, 256, b""),
        (1, 0x6040, 0, bytes(5)),
    ):
        with pytest.raises(ConfigurationError):
            bench.slave.send_multiplexed(1, *arguments)


@pytest.fixture
def listed(kit, tmp_path):
    """A slave whose dictionary has scanner and dispatcher list."""
    path = tmp_path / "drive.eds"
    path.write_text(kit.eds_text() + LISTS)
    bench = kit.Bench(load_dictionary(path))
    bench.slave.power_on()
    bench.run()
    return bench


@pytest.mark.requirement("C301-051")
def test_producer_in_source_mode_sends_what_has_changed(listed):
    """Objects of the scanner list are sent with the own node-ID when they change, whoever changes them, and
    no others.
    """
    bench = listed
    assert bench.write(0x1FA0, 1, 0x01606400, 4) == 0
    assert bench.write(0x1FA0, 2, 0x01604000, 4) == 0
    multiplex(bench, 0x1800, SAM)
    bench.slave.set(0x6064, 0, -2)
    bench.slave.set(0x606C, 0, 7)
    bench.run()
    assert bench.take(0x185) == [b"\x05\x64\x60\x00\xfe\xff\xff\xff"]
    bench.slave.set(0x6064, 0, -2)
    bench.write(0x6040, 0, 6, 2)
    bench.run()
    assert bench.take(0x185) == [b"\x05\x40\x60\x00\x06\0\0\0"]
    bench.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
    bench.slave.set(0x6064, 0, 5)
    bench.run()
    assert bench.take(0x185) == []


@pytest.mark.requirement("C301-051")
def test_consumer_in_source_mode_follows_its_dispatcher_list(listed):
    """A source frame is stored where the dispatcher list says for this node, index and sub-index; others are
    ignored.
    """
    bench = listed
    # Two sub-indices of 3000h from 2 on, of node 9, go to 607Dh from 1 on.
    with_block = 2 << 56 | 0x607D << 40 | 1 << 32 | 0x3000 << 16 | 2 << 8 | 9
    bench.slave.store.write(0x1FD0, 1, with_block.to_bytes(8, "little"))
    bench.slave.store.write(0x1FD0, 2, (0x6040 << 40 | 0x3001 << 16 | 9).to_bytes(8, "little"))
    for sub in (1, 2):
        bench.slave.store.entries[0x607D00 | sub].maps_receive = True
    multiplex(bench, 0x1400, SAM)
    for head, index, sub, value in (
        (9, 0x3000, 2, 11),
        (9, 0x3000, 3, 22),
        (9, 0x3000, 4, 33),
        (9, 0x3000, 1, 44),
        (8, 0x3000, 2, 55),
        (9, 0x3001, 0, 6),
        (0x89, 0x3001, 0, 7),
    ):
        bench.send(0x205, frame(head, index, sub, value))
    bench.run()
    assert [bench.slave.get(0x607D, 1), bench.slave.get(0x607D, 2), bench.slave.get(0x6040)] == [11, 22, 6]
    assert bench.take(0x085) == []


@pytest.mark.requirement("C301-051")
def test_multiplex_pdos_are_event_driven(bench):
    """A synchronous PDO cannot become a multiplex PDO, nor a multiplex PDO synchronous."""
    assert bench.write(0x1401, 1, 0x80000305, 4) == 0
    assert bench.write(0x1601, 0, DAM, 1) == AbortCode.PARAMETER
    assert bench.write(0x1401, 2, 255, 1) == 0
    assert bench.write(0x1601, 0, DAM, 1) == 0
    assert bench.write(0x1401, 2, 1, 1) == AbortCode.PARAMETER
