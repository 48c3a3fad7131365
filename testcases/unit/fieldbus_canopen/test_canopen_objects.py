"""Communication objects and abort codes row by row, with the unmodified `canopen` library as client where it
can.
"""

from __future__ import annotations

import random
from binascii import crc_hqx

import canopen
import pytest
from canopen.sdo.exceptions import SdoAbortedError
from hypothesis import given
from hypothesis import strategies as st

from fieldbus.canopen import ABORT_TEXTS, AbortCode, NmtCommand, PumpedNetwork, SdoAbort
from fieldbus.canopen.sdo_server import SdoServer


@pytest.fixture
def node(bench, kit):
    with PumpedNetwork(bench.segment) as network:
        yield network.add_node(kit.NODE, kit.dictionary(kit.NODE))


# -- identifiers and objects
# ----------------------------------------------------------------------------------


@pytest.mark.requirement("C301-005", "C301-006", "C301-007", "C301-008", "C301-151")
@pytest.mark.parametrize("number", [1, 2, 3, 4])
def test_predefined_identifiers_of_the_pdos(bench, kit, number):
    """PDO 1 to 4 listen and send on 200h, 300h, 400h, 500h and 180h, 280h, 380h, 480h plus the node-ID, when
    made valid.
    """
    transmit, receive = 0x080 + 0x100 * number + kit.NODE, 0x100 + 0x100 * number + kit.NODE
    assert bench.slave.get(0x1400 + number - 1, 1) & 0x7FF == receive
    assert bench.slave.get(0x1800 + number - 1, 1) & 0x7FF == transmit
    bench.map_pdo(number, [0x60830020], 255, transmit=False, cob_id=receive)
    bench.map_pdo(number, [0x60640020], 255, transmit=True, cob_id=0x40000000 | transmit)
    bench.nmt(NmtCommand.START)
    bench.run(5)
    bench.take()
    bench.send(receive, (0x1000 + number).to_bytes(4, "little"))
    bench.slave.set(0x6064, 0, -number)
    bench.run()
    assert bench.slave.get(0x6083) == 0x1000 + number
    assert bench.take(transmit) == [(-number).to_bytes(4, "little", signed=True)]


@pytest.mark.exhaustive
@pytest.mark.requirement("C301-151")
def test_eight_pdos_in_each_direction(bench):
    """The emulated device has eight PDOs each way; the last one works as the first does, the ninth does not
    exist.
    """
    assert (len(bench.slave.pdos.receive), len(bench.slave.pdos.transmit)) == (8, 8)
    bench.map_pdo(8, [0x60830020], 255, transmit=False, cob_id=0x3A0)
    bench.nmt(NmtCommand.START)
    bench.send(0x3A0, b"\x07\0\0\0")
    bench.run()
    assert bench.slave.get(0x6083) == 7
    assert bench.read(0x1408, 1) == -AbortCode.NO_OBJECT


@pytest.mark.requirement("C301-152")
@pytest.mark.parametrize("index", [0x1F50, 0x1F51])
def test_program_download_does_not_exist(bench, index):
    """Program download and control are answered with 06020000h, reading as writing."""
    assert bench.read(index, 1) == -AbortCode.NO_OBJECT
    assert bench.write(index, 1, 0, 4) == AbortCode.NO_OBJECT


@pytest.mark.requirement("C301-134")
def test_manufacturer_status_register(kit):
    """1002h is read-only for the bus, and a TPDO may carry it."""
    od = kit.dictionary()
    status = canopen.objectdictionary.ODVariable("Manufacturer status", 0x1002, 0)
    status.data_type, status.access_type, status.pdo_mappable = 0x07, "ro", True
    od.add_object(status)
    bench = kit.Bench(od)
    bench.slave.power_on()
    bench.run()
    assert bench.read(0x1002) == 0
    assert bench.write(0x1002, 0, 1, 4) == AbortCode.READ_ONLY
    bench.map_pdo(1, [0x10020020], 255, transmit=True, cob_id=0x40000185)
    bench.nmt(NmtCommand.START)
    bench.run(5)
    bench.take()
    bench.slave.set(0x1002, 0, 0xCAFE)
    bench.run()
    assert bench.take(0x185) == [b"\xfe\xca\0\0"]


@pytest.mark.requirement("C301-137")
def test_cycle_period_and_window(node):
    """1006h and 1007h are 0 from the factory, in microseconds, and keep what is written."""
    assert (node.sdo[0x1006].raw, node.sdo[0x1007].raw) == (0, 0)
    node.sdo[0x1006].raw = 4000
    node.sdo[0x1007].raw = 2000
    assert (node.sdo[0x1006].raw, node.sdo[0x1007].raw) == (4000, 2000)


@pytest.mark.requirement("C301-138")
def test_names_of_the_device(bench, node):
    """1008h is constant and comes in segments when it is longer than four bytes; 1009h in one frame."""
    bench.received.clear()
    assert node.sdo[0x1008].raw == "Emulated_servo_drive"
    assert bench.take(0x585)[0][0] == 0x41
    assert node.sdo[0x1009].raw == "A1"
    with pytest.raises(SdoAbortedError, match="06010002"):
        node.sdo.download(0x1008, 0, b"name")


@pytest.mark.requirement("C301-149")
@pytest.mark.parametrize("behaviour", [0, 1, 2])
def test_error_behaviour_is_kept(node, behaviour):
    """1029h:1 is 0 from the factory and takes the values of the standard."""
    assert node.sdo[0x1029][1].raw == 0
    node.sdo[0x1029][1].raw = behaviour
    assert node.sdo[0x1029][1].raw == behaviour


# -- abort codes
# ----------------------------------------------------------------------------------------------


@pytest.mark.requirement(
    "C301-077",
    "C301-078",
    "C301-083",
    "C301-084",
    "C301-090",
    "C301-091",
    "C301-092",
    "C301-101",
    "C301-102",
    "C301-103",
    "C301-104",
    "C301-105",
    "C301-106",
    "C301-107",
)
@pytest.mark.parametrize("code", list(AbortCode))
def test_every_abort_code_reaches_the_client(bench, node, code):
    """Whatever code the device gives for a read or a write, the library's client gets exactly that, and
    nothing is stored.
    """

    def refuse(*_value):
        raise SdoAbort(code)

    bench.slave.on_write(0x6083, 0, refuse)
    bench.slave.on_read(0x6083, 0, refuse)
    with pytest.raises(SdoAbortedError) as caught:
        node.sdo[0x6083].raw = 1
    assert caught.value.code == code
    with pytest.raises(SdoAbortedError) as caught:
        node.sdo.upload(0x6083, 0)
    assert caught.value.code == code
    assert bench.slave.get(0x6083) == 1000
    assert ABORT_TEXTS[code]


@pytest.mark.requirement("C301-084")
def test_entry_without_any_access(kit):
    """An entry that may neither be read nor written is 06010000h both ways."""
    od = kit.dictionary()
    od[0x6083].access_type = ""
    bench = kit.Bench(od)
    bench.slave.power_on()
    bench.run()
    assert bench.read(0x6083) == -AbortCode.ACCESS
    assert bench.write(0x6083, 0, 1, 4) == AbortCode.ACCESS


@pytest.mark.exhaustive
@pytest.mark.requirement("C301-091")
def test_pdo_whose_mapping_forbids_itself(kit):
    """A PDO with a default mapping that its own dictionary does not allow cannot be made valid: 06040047h,
    until remapped.
    """
    od = kit.dictionary()
    od[0x1602][0].default = 1
    od[0x1602][1].default = 0x60410010  # read-only, so that nothing may write it
    bench = kit.Bench(od)
    bench.slave.power_on()
    bench.run()
    assert bench.write(0x1402, 1, 0x405, 4) == AbortCode.INTERNAL
    assert bench.write(0x1602, 0, 0, 1) == 0
    assert bench.write(0x1602, 1, 0x60400010, 4) == 0
    assert bench.write(0x1602, 0, 1, 1) == 0
    assert bench.write(0x1402, 1, 0x405, 4) == 0


@pytest.mark.requirement("C301-012", "C301-101", "C301-150")
def test_identifiers_of_a_second_sdo_server(bench):
    """A second server takes no restricted identifier, none that a server has already, and no other one while
    it is valid.
    """
    for can_id in (0x000 + 1, 0x07F, 0x101, 0x180, 0x581, 0x5FF, 0x601, 0x67F, 0x6E0, 0x701, 0x780, 0x7FF):
        assert bench.write(0x1201, 1, can_id, 4) == AbortCode.VALUE, f"{can_id:03X}"
    assert bench.write(0x1201, 1, 0x20000690, 4) == AbortCode.VALUE
    assert bench.write(0x1201, 1, 0x6C0, 4) == 0
    assert bench.write(0x1201, 2, 0x6C0, 4) == AbortCode.NO_RESOURCE
    assert bench.write(0x1201, 1, 0x6C1, 4) == AbortCode.DEVICE_STATE
    assert bench.write(0x1201, 1, 0x800006C0, 4) == 0
    assert bench.write(0x1201, 1, 0x6C1, 4) == 0


# -- long transfers
# -------------------------------------------------------------------------------------------


@pytest.mark.exhaustive
@pytest.mark.requirement(
    "C301-059", "C301-061", "C301-063", "C301-064", "C301-065", "C301-066", "C301-068", "C301-069"
)
@pytest.mark.parametrize("block", [False, True])
def test_domain_of_100_kilobytes(bench, node, block):
    """100 000 bytes travel in both directions through the library's client, in segments and in blocks with
    CRC.
    """
    content = random.Random(3).randbytes(100_000)
    node.sdo.RESPONSE_TIMEOUT = 5.0
    with node.sdo.open(0x2002, 0, "wb", size=len(content), block_transfer=block) as stream:
        stream.write(content)
    assert bench.slave.get(0x2002) == content
    with node.sdo.open(0x2002, 0, "rb", block_transfer=block) as stream:
        assert stream.read() == content


class Memory:
    """One object of any length."""

    def __init__(self, content=b""):
        self.content = content

    def read(self, _index, _sub):
        return self.content

    def check_write(self, _index, _sub, _size):
        return 1 << 20

    def write(self, _index, _sub, data, **_options):
        self.content = data


def upload_in_blocks(server, lost, sizes):
    """Fetch an object as a client does whose segments with the numbers in `lost` (counted over all) do not
    arrive.

    Returns the content, or the abort code.
    """
    (answer,) = server.request(b"\xa4\x02\x20\x00" + bytes((next(sizes), 0, 0, 0)))
    assert answer[0] & 0xE1 == 0xC0
    expected = int.from_bytes(answer[4:], "little")
    received = bytearray()
    segments = server.request(b"\xa3" + bytes(7))
    number = 0
    while True:
        acknowledged = 0
        last = False
        for segment in segments:
            number += 1
            if number in lost:
                continue
            if segment[0] & 0x7F == acknowledged + 1:
                acknowledged += 1
                received += segment[1:]
                last = bool(segment[0] & 0x80)
        segments = server.request(bytes((0xA2, acknowledged, next(sizes), 0, 0, 0, 0, 0)))
        if segments and segments[0][0] == 0x80:
            return int.from_bytes(segments[0][4:], "little")
        if last:
            break
    (end,) = segments
    assert end[0] & 0xE3 == 0xC1
    unused = end[0] >> 2 & 7
    content = bytes(received[: len(received) - unused])
    assert len(content) == expected
    assert int.from_bytes(end[1:3], "little") == crc_hqx(content, 0)
    assert server.request(b"\xa1" + bytes(7)) == []
    return content


@pytest.mark.exhaustive
@pytest.mark.requirement("C301-066", "C301-067", "C301-068", "C301-070")
@given(content=st.binary(min_size=1, max_size=400), lost=st.sets(st.integers(1, 60)), data=st.data())
def test_block_upload_survives_any_losses(content, lost, data):
    """Whichever segments are lost, and whatever block sizes the client asks for, the upload ends in the very
    bytes.
    """

    def sizes():
        while True:
            yield data.draw(st.integers(1, 127))

    server = SdoServer(Memory(content))
    assert upload_in_blocks(server, lost, sizes()) == content
    assert not server.active


@pytest.mark.exhaustive
@pytest.mark.requirement("C301-080", "C301-081")
@given(
    content=st.binary(min_size=1, max_size=100),
    acknowledged=st.integers(0, 255),
    size=st.integers(0, 255),
)
def test_block_upload_with_any_acknowledge(content, acknowledged, size):
    """An acknowledge that cannot be is aborted with its code; any other goes on with segments or the end."""
    server = SdoServer(Memory(content))
    server.request(b"\xa4\x02\x20\x00\x05\0\0\0")
    sent = len(server.request(b"\xa3" + bytes(7)))
    answers = server.request(bytes((0xA2, acknowledged, size, 0, 0, 0, 0, 0)))
    if acknowledged > sent:
        assert answers == [b"\x80\x02\x20\x00\x03\x00\x04\x05"]
    elif not 1 <= size <= 127:
        assert answers == [b"\x80\x02\x20\x00\x02\x00\x04\x05"]
    else:
        assert answers
        assert answers[0][0] != 0x80
