"""Frames in words."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldbus.can.frame import CanFrame
from fieldbus.canopen import FrameDecoder, NmtCommand, PumpedNetwork

pytestmark = pytest.mark.exhaustive


def frame(can_id: int, data: str = "", **options) -> CanFrame:
    return CanFrame(can_id, bytes.fromhex(data), **options)


@pytest.fixture
def decoder(kit):
    return FrameDecoder({5: "drive1"}, {5: kit.dictionary(5)})


@pytest.mark.requirement("C301-164")
@pytest.mark.parametrize(
    ("can_id", "data", "text"),
    [
        (0x000, "01 05", "NMT start node 5"),
        (0x000, "82 00", "NMT reset communication all nodes"),
        (0x000, "77 05", "NMT command 77h node 5"),
        (0x000, "01", "NMT malformed 01"),
        (0x080, "", "SYNC"),
        (0x080, "07", "SYNC 7"),
        (0x085, "11 86 21 00 00 00 00 00", "EMCY drive1 8611h following error, register 21h"),
        (0x085, "00 00 00 00 00 00 00 00", "EMCY drive1 0000h error reset or no error, register 00h"),
        (
            0x085,
            "80 FF 81 01 02 00 00 00",
            "EMCY drive1 FF80h manufacturer-specific, register 81h, data 01 02 00 00 00",
        ),
        (
            0x086,
            "30 81 11 00 00 00 00 00",
            "EMCY node 6 8130h life guarding or heartbeat error, register 11h",
        ),
        (0x705, "00", "boot-up drive1"),
        (0x705, "05", "heartbeat drive1 Operational"),
        (0x709, "FF", "heartbeat node 9 Pre-operational, toggle"),
        (0x205, "0F 00", "RPDO1 drive1: Controlword 000Fh (enable operation)"),
        (
            0x305,
            "0F 00 40 77 1B 00 09",
            (
                "RPDO2 drive1: Controlword 000Fh (enable operation), Target velocity 1800000, Modes of "
                "operation 9 (csv)"
            ),
        ),
        (
            0x305,
            "0F 00 FE FF FF FF FF",
            "RPDO2 drive1: Controlword 000Fh (enable operation), Target velocity -2, Modes of operation -1",
        ),
        (0x305, "0F 00", "RPDO2 drive1: Controlword 000Fh (enable operation), too short"),
        (0x205, "0F 00 55", "RPDO1 drive1: Controlword 000Fh (enable operation), 1 byte more"),
        (
            0x285,
            "37 06 FF FF FF FF",
            "TPDO2 drive1: Statusword 0637h (Operation enabled), Position actual value -1",
        ),
        (0x605, "23 83 60 00 E8 03 00 00", "SDO drive1 write 6083h Profile acceleration = 1000"),
        (0x585, "80 41 60 00 02 00 01 06", "SDO drive1 abort 06010002h read-only (6041h Statusword)"),
        (0x605, "40 08 10 00 00 00 00 00", "SDO drive1 read 1008h Device name"),
        (0x585, "4B 41 60 00 50 02 00 00", "SDO drive1 read 6041h Statusword = 0250h (Switch on disabled)"),
        (0x605, "23 00 14 01 05 02 00 80", "SDO drive1 write 1400h:1 Record_1400: COB-ID = 80000205h"),
        (0x605, "23 10 10 01 73 61 76 65", "SDO drive1 write 1010h:1 Store parameters:1 = 'save'"),
        (0x605, "2B 00 50 00 01 00 00 00", "SDO drive1 write 5000h = 0001h"),
        (0x605, "40 00", "SDO drive1 malformed 40 00"),
        (0x100, "00 00 00 00 00 00", "TIME"),
    ],
)
def test_single_frames(decoder, can_id, data, text):
    """Each service is named with its node, its objects and its values."""
    assert decoder.decode(frame(can_id, data)) == text


def test_frames_of_no_service(decoder):
    """What belongs to no known service is given as it is."""
    assert decoder.decode(frame(0x123, "01 02")) == "<CanFrame 123#01 02>"
    assert decoder.decode(frame(0x12345, "01", extended=True)) == "<CanFrame 00012345#01>"


def test_remote_frames(decoder):
    """Guarding and PDO requests are recognised."""
    assert decoder.decode(frame(0x705, remote=True)) == "guarding request drive1"
    assert decoder.decode(frame(0x185, remote=True)) == "request for TPDO1 drive1"


@pytest.mark.requirement("C301-164")
def test_mapping_is_learned_from_sdo(bench, decoder):
    """A remapping seen on the bus is in force for the frames that follow it, and only when the node has
    confirmed it.
    """
    bench.map_pdo(2, [0x60640020, 0x60770010], 1, transmit=True, cob_id=0x400002A5)
    assert bench.write(0x1800, 1, 0x40000186, 4) != 0  # refused: still valid under 185h
    bench.nmt(NmtCommand.START)
    bench.send(0x080)
    bench.run()
    texts = [decoder.decode(item) for _, _, item, error in bench.segment.log if not error]
    assert texts[-1] == "TPDO2 drive1: Position actual value 0, Torque actual value 0"
    assert (
        decoder.decode(frame(0x185, "21 02"))
        == "TPDO1 drive1: Statusword 0221h (Ready to switch on, no voltage)"
    )
    assert decoder.decode(frame(0x285, "00")) == "<CanFrame 285#00>"


def test_boot_up_takes_the_stored_mapping(bench, decoder):
    """After a boot-up the mapping is the stored one, else the default."""
    bench.map_pdo(1, [0x60600008], 255, transmit=False, cob_id=0x225)
    bench.nmt(NmtCommand.RESET_COMMUNICATION)
    for _, _, item, _ in bench.segment.log:
        decoder.observe(item)
    assert decoder.decode(frame(0x205, "06 00")) == "RPDO1 drive1: Controlword 0006h (shutdown)"
    bench.segment.log.clear()
    bench.map_pdo(1, [0x60600008], 255, transmit=False, cob_id=0x225)
    bench.write(0x1010, 1, 0x65766173, 4)
    bench.nmt(NmtCommand.RESET_NODE)
    for _, _, item, _ in bench.segment.log:
        decoder.observe(item)
    assert decoder.decode(frame(0x225, "06")) == "RPDO1 drive1: Modes of operation 6 (hm)"


def test_mapping_can_be_set(kit):
    """A mapping that was set before the log begins is given with `set_mapping`."""
    decoder = FrameDecoder({5: "drive1"}, {5: kit.dictionary(5)})
    decoder.set_mapping(5, {(0x1A00, 0): 2, (0x1A00, 1): 0x60610008, (0x1A00, 2): 0x606C0020})
    text = "TPDO1 drive1: Modes of operation display 9 (csv), Velocity actual value -10"
    assert decoder.decode(frame(0x185, "09 F6 FF FF FF")) == text
    decoder.observe(frame(0x705, "00"))
    assert decoder.decode(frame(0x185, "09 F6 FF FF FF")) == text
    decoder.set_mapping(5, {(0x1A00, 0): 1}, stored=False)
    decoder.observe(frame(0x705, "00"))
    assert decoder.decode(frame(0x185, "09 F6 FF FF FF")) == text


def test_node_without_dictionary():
    """Without a dictionary PDOs are named by the predefined identifiers once the node is known, values in
    hexadecimal.
    """
    decoder = FrameDecoder({7: "axis"})
    assert decoder.decode(frame(0x187, "37 02")) == "TPDO1 axis: 37 02"
    decoder.set_mapping(7, {(0x1A00, 0): 2, (0x1A00, 1): 0x60410010, (0x1A00, 2): 0x30000108})
    assert (
        decoder.decode(frame(0x187, "37 02 FF"))
        == "TPDO1 axis: Statusword 0237h (Operation enabled), 3000h:1 FFh"
    )


def conversation(bench, decoder, action) -> list[str]:
    start = len(bench.segment.log)
    action()
    bench.run(5)
    return [decoder.decode(item) for _, _, item, _ in bench.segment.log[start:]]


def test_segmented_transfers(bench, kit, decoder):
    """Segments are recognised, and the whole value is reported with the last one."""
    with PumpedNetwork(bench.segment) as network:
        node = network.add_node(kit.NODE, kit.dictionary(kit.NODE))

        def write():
            node.sdo[0x2001].raw = "a longer text"

        assert conversation(bench, decoder, write) == [
            "SDO drive1 write 2001h Long string segmented, 13 bytes",
            "SDO drive1 ready for 2001h Long string",
            "SDO drive1 segment",
            "SDO drive1 segment received",
            "SDO drive1 segment, last: 2001h Long string = 'a longer text'",
            "SDO drive1 segment received, written",
        ]
        assert conversation(bench, decoder, lambda: node.sdo[0x2001].raw)[-1] == (
            "SDO drive1 segment, last: 2001h Long string = 'a longer text'"
        )


def test_block_transfers(bench, kit, decoder):
    """Block segments are not mistaken for other commands, in both directions, and the end is found."""
    content = bytes(range(250, 256)) * 40
    bench.slave.set(0x2002, 0, content)
    with PumpedNetwork(bench.segment) as network:
        node = network.add_node(kit.NODE, kit.dictionary(kit.NODE))

        def write():
            with node.sdo.open(0x2002, 0, "wb", size=len(content), block_transfer=True) as stream:
                stream.write(content)

        def read():
            with node.sdo.open(0x2002, 0, "rb", block_transfer=True) as stream:
                stream.read()

        texts = conversation(bench, decoder, write)
        assert texts[:2] == [
            "SDO drive1 write 2002h Domain in blocks, 240 bytes",
            "SDO drive1 ready for 2002h Domain in blocks of 127",
        ]
        assert texts[2] == "SDO drive1 block segment 1"
        assert texts[-4:-2] == ["SDO drive1 block segment 35, last", "SDO drive1 block received up to 35"]
        assert texts[-2].startswith("SDO drive1 block end: 2002h Domain = FA FB FC")
        assert texts[-1] == "SDO drive1 written 2002h Domain"
        texts = conversation(bench, decoder, read)
        assert texts[0] == "SDO drive1 read 2002h Domain in blocks of 127"
        assert texts[-4:] == [
            "SDO drive1 block segment 35, last",
            "SDO drive1 block received up to 35",
            "SDO drive1 block end, CRC",
            "SDO drive1 block end",
        ]
        assert conversation(bench, decoder, lambda: node.sdo[0x6083].raw)[-1] == (
            "SDO drive1 read 6083h Profile acceleration = 1000"
        )


_DECODERS: list[FrameDecoder] = []


@pytest.fixture(autouse=True)
def _shared(kit):
    if not _DECODERS:
        _DECODERS.append(FrameDecoder({5: "drive1"}, {5: kit.dictionary(5)}))


@given(
    frames=st.lists(
        st.tuples(
            st.sampled_from([0, 0x80, 0x85, 0x100, 0x185, 0x205, 0x285, 0x305, 0x585, 0x605, 0x705])
            | st.integers(0, 0x7FF),
            st.binary(max_size=8),
            st.booleans(),
        ),
        max_size=20,
    )
)
def test_any_frames_are_decoded(frames):
    """No sequence of frames makes the decoder raise, and each gives a line."""
    decoder = _DECODERS[0]
    for can_id, data, remote in frames:
        assert decoder.decode(CanFrame(can_id, b"" if remote else data, remote=remote))
