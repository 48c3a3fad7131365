"""ADS without sockets: requests as bytes, answers by the description of the protocol."""

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldbus.ads import (
    AdsError,
    Frame,
    FrameReader,
    Group,
    MalformedFrameError,
    Member,
    Structure,
)
from fieldbus.ads.frames import MOST_DATA
from testcases.campaigns._ads_client import (
    ADD,
    CONTROL,
    DELETE,
    OWN,
    PEER,
    READ,
    STATE,
    WRITE,
    Client,
    type_entries,
)


def test_values_by_handle_and_address():
    """A handle of a name reads and writes its value, upper and lower case alike; a released one is
    unknown.
    """
    client = Client()
    handle = client.handle("main.SPEED")
    assert client.read(Group.SYMBOL_VALUE_BY_HANDLE, handle, 8) == (0, struct.pack("<d", 12.5))
    assert client.write(Group.SYMBOL_VALUE_BY_HANDLE, handle, struct.pack("<d", 7.0)) == 0
    assert client.speed == 7.0
    word = client.memory.find("MAIN.Image.Word")
    assert client.read(word_group := Group.PLC_DATA, word.offset, 2) == (0, b"\2\3")
    assert client.write(word_group, word.offset, b"\xaa\xbb") == 0
    assert client.image == b"\0\1\xaa\xbb\4\5\6\7"
    assert client.write(Group.SYMBOL_RELEASE_HANDLE, 0, struct.pack("<I", handle)) == 0
    assert client.read(Group.SYMBOL_VALUE_BY_HANDLE, handle, 8)[0] == AdsError.SYMBOL_NOT_FOUND


def test_wrong_requests_are_answered_with_their_code():
    """Every way of asking wrongly has its error code, and changes nothing."""
    client = Client()
    speed, flag = client.memory.find("MAIN.Speed").offset, client.memory.find("MAIN.Flag").offset
    handle = client.handle("MAIN.Speed")
    group = Group.PLC_DATA
    assert client.read(0x9999, 0, 4)[0] == AdsError.INVALID_GROUP
    assert client.read(group, 4000, 1)[0] == AdsError.INVALID_OFFSET
    assert client.read(group, speed, 9)[0] == AdsError.INVALID_SIZE
    assert client.read(group, speed, 1 << 30)[0] == AdsError.INVALID_SIZE
    assert client.read(Group.SYMBOL_VALUE_BY_HANDLE, handle, 9)[0] == AdsError.INVALID_SIZE
    assert client.write(group, flag, b"\0") == AdsError.INVALID_ACCESS
    assert client.write(group, speed, b"") == AdsError.INVALID_SIZE
    assert client.write(group, speed, struct.pack("<d", -1.0)) == AdsError.INVALID_DATA
    assert client.write(Group.SYMBOL_VALUE_BY_HANDLE, handle, b"\0" * 4) == AdsError.INVALID_SIZE
    for by_name in (Group.SYMBOL_HANDLE_BY_NAME, Group.SYMBOL_INFO_BY_NAME_EX, Group.SYMBOL_VALUE_BY_NAME):
        assert client.read_write(by_name, 0, 64, b"MAIN.Spead\0")[0] == AdsError.SYMBOL_NOT_FOUND
    assert client.ask(READ, b"\0" * 4) == (0, struct.pack("<I", AdsError.INVALID_SIZE))
    assert client.ask(WRITE, struct.pack("<III", group, speed, 8) + b"\0")[1] == struct.pack(
        "<I", AdsError.INVALID_SIZE
    )
    assert client.ask(99)[1] == struct.pack("<I", AdsError.SERVICE_NOT_SUPPORTED)
    assert client.ask(STATE, port=900) == (AdsError.PORT_NOT_FOUND, b"")
    assert client.ask(STATE, net=PEER) == (AdsError.MACHINE_NOT_FOUND, b"")
    assert (client.speed, client.flag) == (12.5, True)


def test_symbol_table():
    """The upload is as long as its info says, and every entry has address, size, type and texts of its
    symbol.
    """
    client = Client()
    number, size = struct.unpack("<II", client.read(Group.SYMBOL_UPLOAD_INFO, 0, 8)[1])
    code, table = client.read(Group.SYMBOL_UPLOAD, 0, size)
    assert (code, number, len(table)) == (0, 4, size)
    found = {}
    while table:
        length, group, offset, count, kind, _, *texts = struct.unpack_from("<IIIIIIHHH", table)
        names, place = [], 30
        for text in texts:
            names.append(table[place : place + text].decode())
            assert table[place + text] == 0
            place += text + 1
        found[names[0]] = (group, offset, count, kind, *names[1:])
        table = table[length:]
    word = client.memory.find("MAIN.Image.Word").offset
    assert found["MAIN.Image.Word"] == (Group.PLC_DATA, word, 2, 18, "UINT", "")
    assert found["MAIN.Flag"][2:] == (1, 33, "BOOL", "read only")
    assert found["MAIN.Image"][3] == 65
    entry = client.read_write(Group.SYMBOL_INFO_BY_NAME_EX, 0, 0xFFFF, b"MAIN.Flag\0")[1]
    assert entry == client.memory.find("MAIN.Flag").entry()


def test_sum_commands():
    """A sum command answers every one of its requests on its own."""
    client = Client()
    speed, flag = client.memory.find("MAIN.Speed").offset, client.memory.find("MAIN.Flag").offset
    asked = b"".join(struct.pack("<III", Group.PLC_DATA, *one) for one in ((speed, 8), (9999, 4), (flag, 1)))
    code, data = client.read_write(Group.SUM_READ, 3, 25, asked)
    assert code == 0
    assert struct.unpack_from("<III", data) == (0, AdsError.INVALID_OFFSET, 0)
    assert data[12:] == struct.pack("<d", 12.5) + b"\0" * 4 + b"\1"
    asked = struct.pack("<IIIIII", Group.PLC_DATA, speed, 8, Group.PLC_DATA, flag, 1) + struct.pack(
        "<d?", 3.0, False
    )
    assert client.read_write(Group.SUM_WRITE, 2, 8, asked) == (
        0,
        struct.pack("<II", 0, AdsError.INVALID_ACCESS),
    )
    assert client.speed == 3.0
    names = [b"MAIN.Flag\0", b"MAIN.No\0"]
    asked = b"".join(
        struct.pack("<IIII", Group.SYMBOL_HANDLE_BY_NAME, 0, 4, len(one)) for one in names
    ) + b"".join(names)
    code, data = client.read_write(Group.SUM_READ_WRITE, 2, 24, asked)
    assert struct.unpack_from("<IIII", data) == (0, 4, AdsError.SYMBOL_NOT_FOUND, 0)
    for group in (Group.SUM_READ, Group.SUM_WRITE, Group.SUM_READ_WRITE):
        for number, content in ((0, b""), (501, b"\0" * 12 * 501), (2, b"\0" * 13)):
            assert client.read_write(group, number, 100, content)[0] == AdsError.INVALID_SIZE


def test_notifications():
    """Cyclic ones come in their cycle, the others when the value has changed; a deleted one comes no more."""
    client = Client()
    speed = client.memory.find("MAIN.Speed").offset

    def add(mode, cycle_ns):
        data = struct.pack("<IIIIII16x", Group.PLC_DATA, speed, 8, mode, 0, cycle_ns // 100)
        code, handle = struct.unpack("<II", client.ask(ADD, data)[1])
        return handle if code == 0 else -code

    cyclic, changed = add(3, 10_000_000), add(4, 0)
    assert add(9, 0) == -AdsError.MODE_NOT_SUPPORTED

    def samples(now_ns):
        client.sent.clear()
        client.session.sample(now_ns)
        found = []
        for frame in client.sent:
            assert (frame.command, frame.flags) == (8, 4)
            size, stamps, stamp, count, handle, length = struct.unpack_from("<IIQIII", frame.data)
            assert (size, stamps, count, length) == (len(frame.data) - 4, 1, 1, 8)
            assert stamp == 125_911_584_000_000_000 + now_ns // 100
            found.append((handle, struct.unpack_from("<d", frame.data, 28)[0]))
        return found

    assert samples(0) == [(cyclic, 12.5), (changed, 12.5)]
    assert samples(5_000_000) == []
    client.speed = 1.0
    assert samples(9_000_000) == [(changed, 1.0)]
    assert samples(10_000_000) == [(cyclic, 1.0)]
    assert client.ask(DELETE, struct.pack("<I", cyclic))[1] == struct.pack("<I", 0)
    assert client.ask(DELETE, struct.pack("<I", cyclic))[1] == struct.pack(
        "<I", AdsError.NOTIFICATION_HANDLE_INVALID
    )
    client.speed = 2.0
    assert samples(30_000_000) == [(changed, 2.0)]


def test_limits_of_a_connection():
    """Handles and notifications of one connection are limited."""
    client = Client()
    speed = client.memory.find("MAIN.Speed").offset
    data = struct.pack("<IIIIII16x", Group.PLC_DATA, speed, 8, 4, 0, 0)
    codes = {struct.unpack("<II", client.ask(ADD, data)[1])[0] for _ in range(513)}
    assert codes == {0, AdsError.NO_MORE_HANDLES}
    for _ in range(1024):
        client.handle("MAIN.Flag")
    assert client.read_write(Group.SYMBOL_HANDLE_BY_NAME, 0, 4, b"MAIN.Flag\0")[0] == AdsError.NO_MORE_HANDLES


def test_state_and_control():
    """State and device info are read; a control command reaches the device."""
    client = Client()
    assert client.ask(STATE) == (0, struct.pack("<IHH", 0, 5, 0))
    assert client.ask(CONTROL, struct.pack("<HHI", 6, 0, 0))[1] == struct.pack("<I", 0)
    assert client.state == 6
    assert client.ask(1)[1] == struct.pack("<IBBH16s", 0, 3, 1, 0, b"Plc30 App")


def test_frames_in_pieces():
    """Frames are found in any pieces of the stream; what is none, or too long, ends it."""
    frame = Frame(OWN, 851, PEER, 1, STATE, 4, 0, 5, b"")
    reader = FrameReader()
    data = frame.pack() * 3
    assert [one for byte in data for one in reader.feed(bytes([byte]))] == [frame] * 3
    for wrong in (
        b"GET / HTTP/1.1\r\n",
        struct.pack("<HI", 0, 31),
        struct.pack("<HI", 0, 33 + MOST_DATA),
        frame.pack()[:26] + b"\7" + frame.pack()[27:],
    ):
        with pytest.raises(MalformedFrameError):
            FrameReader().feed(wrong)


@given(command=st.integers(0, 12), data=st.binary(max_size=64), port=st.sampled_from([851, 852]))
def test_no_request_breaks_the_device(command, data, port):
    """Whatever a request holds, it is answered, and the device goes on."""
    client = Client()
    client.session.receive(Frame(OWN, port, PEER, 1, command, 4, 0, 5, data).pack())
    assert len(client.sent) == 1
    client.session.sample(0)
    assert client.ask(STATE)[0] == 0


def test_data_types_are_uploaded():
    """The table of data types is as long as its info says; a structure has its members with their places, and
    is found by name.
    """
    client = Client()
    client.memory.declare(
        Structure(
            "IMAGE", 8, (Member("Word", "UINT", 2), Member("Rest", "UDINT", 4), Member("On", "BOOL", 0))
        )
    )
    info = struct.unpack("<6I", client.read(Group.SYMBOL_UPLOAD_INFO_2, 0, 24)[1])
    code, table = client.read(Group.DATA_TYPE_UPLOAD, 0, info[3])
    assert (code, len(table), info[0]) == (0, info[3], 4)
    types = {entry[0]: entry[1:] for entry in type_entries(table, info[2])}
    assert len(types) == info[2]
    assert types["LREAL"] == ("", 8, 0, 5, 1, [])
    assert types["IMAGE"] == (
        "",
        8,
        0,
        65,
        1,
        [
            ("Word", "UINT", 2, 2, 18, 2, []),
            ("Rest", "UDINT", 4, 4, 19, 2, []),
            ("On", "BOOL", 1, 0, 33, 2, []),
        ],
    )
    code, entry = client.read_write(Group.DATA_TYPE_INFO_BY_NAME_EX, 0, 0xFFFFFFFF, b"image\0")
    assert (code, type_entries(entry, 1)[0][0]) == (0, "IMAGE")
    assert (
        client.read_write(Group.DATA_TYPE_INFO_BY_NAME_EX, 0, 99, b"NONE\0")[0] == AdsError.SYMBOL_NOT_FOUND
    )


def test_sums_of_reads_with_lengths():
    """Each value has its code and its length; in the second kind the values that failed take no place."""
    client = Client()
    speed, flag = client.memory.find("MAIN.Speed").offset, client.memory.find("MAIN.Flag").offset
    group = Group.PLC_DATA
    asked = struct.pack("<9I", group, speed, 8, group, 4000, 4, group, flag, 1)
    heads = struct.pack("<6I", 0, 8, AdsError.INVALID_OFFSET, 0, 0, 1)
    value = struct.pack("<d", 12.5)
    assert client.read_write(Group.SUM_READ_EX, 3, 99, asked) == (0, heads + value + bytes(4) + b"\1")
    assert client.read_write(Group.SUM_READ_EX_2, 3, 99, asked) == (0, heads + value + b"\1")
    for number in (0, 2, 4, 501):
        assert client.read_write(Group.SUM_READ_EX, number, 99, asked)[0] == AdsError.INVALID_SIZE


def test_sums_of_notifications():
    """Notifications are added and deleted together, each with its own code and handle; what was not there
    changes nothing.
    """
    client = Client()
    speed = client.memory.find("MAIN.Speed").offset

    def attributes(offset, mode):
        return struct.pack("<6I16x", Group.PLC_DATA, offset, 8, mode, 0, 0)

    asked = attributes(speed, 4) + attributes(4000, 4) + attributes(speed, 9) + attributes(speed, 3)
    code, answer = client.read_write(Group.SUM_ADD_NOTIFICATION, 4, 32, asked)
    results = list(struct.iter_unpack("<II", answer))
    assert code == 0
    assert [one for one, _ in results] == [0, AdsError.INVALID_OFFSET, AdsError.MODE_NOT_SUPPORTED, 0]
    first, last = results[0][1], results[3][1]
    client.sent.clear()
    client.session.sample(0)
    assert [struct.unpack_from("<I", frame.data, 20)[0] for frame in client.sent] == [first, last]
    asked = struct.pack("<III", first, 4711, last)
    assert client.read_write(Group.SUM_DELETE_NOTIFICATION, 3, 12, asked) == (
        0,
        struct.pack("<III", 0, AdsError.NOTIFICATION_HANDLE_INVALID, 0),
    )
    client.sent.clear()
    client.session.sample(10_000_000)
    assert client.sent == []
    for group, size in ((Group.SUM_ADD_NOTIFICATION, 40), (Group.SUM_DELETE_NOTIFICATION, 4)):
        assert client.read_write(group, 2, 99, bytes(size))[0] == AdsError.INVALID_SIZE
    nested = struct.pack("<IIII", Group.SUM_ADD_NOTIFICATION, 1, 8, 40) + attributes(speed, 4)
    data = client.read_write(Group.SUM_READ_WRITE, 1, 99, nested)[1]
    assert struct.unpack("<II", data) == (AdsError.INVALID_GROUP, 0)


def test_clients_may_ask_for_more_than_there_is():
    """What is named by name may be asked for with the greatest length; an unknown name keeps its code."""
    client = Client()
    for group in (Group.SYMBOL_INFO_BY_NAME_EX, Group.SYMBOL_VALUE_BY_NAME, Group.SYMBOL_HANDLE_BY_NAME):
        assert client.read_write(group, 0, 0xFFFFFFFF, b"MAIN.Speed\0")[0] == 0
        assert client.read_write(group, 0, 0xFFFFFFFF, b"MAIN.None\0")[0] == AdsError.SYMBOL_NOT_FOUND


def test_the_state_is_data_too():
    """State and device state are read at F100h, and a change of the state is told to who has asked for it."""
    client = Client()
    group = Group.DEVICE_DATA
    assert client.read(group, 0, 4) == (0, struct.pack("<HH", 5, 0))
    assert client.read(group, 2, 2) == (0, bytes(2))
    assert client.read(group, 2, 4)[0] == AdsError.INVALID_SIZE
    assert client.read(group, 4, 1)[0] == AdsError.INVALID_OFFSET
    assert client.ask(ADD, struct.pack("<6I16x", group, 0, 4, 4, 0, 0))[1][:4] == bytes(4)
    client.sent.clear()
    for now, state in enumerate((5, 5, 6, 6)):
        client.state = state
        client.session.sample(now)
    assert [struct.unpack_from("<H", frame.data, 28)[0] for frame in client.sent] == [5, 6]
    assert client.ask(ADD, struct.pack("<6I16x", 0x9999, 0, 4, 4, 0, 0))[1][:4] == struct.pack(
        "<I", AdsError.INVALID_GROUP
    )
