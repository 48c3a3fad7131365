"""An ADS device, request by request: values by name, handle and address, sums, notifications, tables of
symbols and data types, state, and every way of asking wrongly.
"""

from __future__ import annotations

import struct
from typing import Final

from fieldbus.ads import AdsError, FrameReader, Group, MalformedFrameError, Member, Structure
from fieldbus.ads.frames import MOST_DATA, Frame
from hil.campaign import Campaign, CaseContext
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
from testcases.campaigns.support import equal, same

CAMPAIGN: Final = Campaign(
    "ads device", controller="", tags=("ads",), bench="testcases.campaigns.can_bus:BENCH"
)
DATA, BY_HANDLE, BY_NAME = Group.PLC_DATA, Group.SYMBOL_VALUE_BY_HANDLE, Group.SYMBOL_HANDLE_BY_NAME


def real(value: float) -> bytes:
    """Return an LREAL."""
    return struct.pack("<d", value)


@CAMPAIGN.case("values")
def values(ctx: CaseContext) -> None:
    """A value by handle, by name in any case, and by address, and parts of an area; a handle that is released
    is unknown.
    """
    client = Client()
    handle = client.handle("main.SPEED")
    same(ctx, "by handle", client.read(BY_HANDLE, handle, 8), (0, real(12.5)))
    same(ctx, "written by handle", client.write(BY_HANDLE, handle, real(7.0)), 0)
    equal(ctx, "speed", client.speed, 7.0)
    found = client.read_write(Group.SYMBOL_VALUE_BY_NAME, 0, 8, b"Main.Speed\0")
    same(ctx, "by name", found, (0, real(7.0)))
    word, speed = client.memory.find("MAIN.Image.Word"), client.memory.find("MAIN.Speed")
    same(ctx, "part of an area", client.read(DATA, word.offset, 2), (0, b"\2\3"))
    same(ctx, "a byte of it", client.read(DATA, word.offset + 1, 1), (0, b"\3"))
    same(ctx, "written", client.write(DATA, word.offset, b"\xaa\xbb"), 0)
    same(ctx, "area", bytes(client.image), b"\0\1\xaa\xbb\4\5\6\7")
    same(ctx, "its last byte", client.write(DATA, word.offset + 5, b"\xcc"), 0)
    same(ctx, "area", bytes(client.image), b"\0\1\xaa\xbb\4\5\6\xcc")
    same(ctx, "beyond its end", client.read(DATA, word.offset + 5, 2)[0], AdsError.INVALID_SIZE)
    same(ctx, "by address", client.read(DATA, speed.offset, 8), (0, real(7.0)))
    same(ctx, "released", client.write(Group.SYMBOL_RELEASE_HANDLE, 0, struct.pack("<I", handle)), 0)
    same(ctx, "by a released handle", client.read(BY_HANDLE, handle, 8)[0], AdsError.SYMBOL_NOT_FOUND)
    handles = {client.handle("MAIN.Flag") for _ in range(1024)}
    same(ctx, "most handles", len(handles) > 0, True)
    code = client.read_write(BY_NAME, 0, 4, b"MAIN.Flag\0")[0]
    same(ctx, "one more", code, AdsError.NO_MORE_HANDLES)


@CAMPAIGN.case("wrong")
def wrong(ctx: CaseContext) -> None:
    """Every way of asking wrongly has its error code, and changes nothing."""
    client = Client()
    speed, flag = client.memory.find("MAIN.Speed").offset, client.memory.find("MAIN.Flag").offset
    handle = client.handle("MAIN.Speed")
    for group, offset, length, code in (
        (0x9999, 0, 4, AdsError.INVALID_GROUP),
        (DATA, 4000, 1, AdsError.INVALID_OFFSET),
        (DATA, speed, 9, AdsError.INVALID_SIZE),
        (DATA, speed, 1 << 30, AdsError.INVALID_SIZE),
        (BY_HANDLE, handle, 9, AdsError.INVALID_SIZE),
        (BY_HANDLE, handle + 77, 8, AdsError.SYMBOL_NOT_FOUND),
    ):
        same(ctx, f"reading {length} of {group:X}h {offset}", client.read(group, offset, length)[0], code)
    for group, offset, value, code in (
        (DATA, flag, b"\0", AdsError.INVALID_ACCESS),
        (DATA, speed, b"", AdsError.INVALID_SIZE),
        (DATA, speed, real(-1.0), AdsError.INVALID_DATA),
        (BY_HANDLE, handle, bytes(4), AdsError.INVALID_SIZE),
        (0x9999, 0, b"\0", AdsError.INVALID_GROUP),
    ):
        same(ctx, f"writing {value.hex()} to {group:X}h {offset}", client.write(group, offset, value), code)
    for group in (BY_NAME, Group.SYMBOL_INFO_BY_NAME_EX, Group.SYMBOL_VALUE_BY_NAME):
        found = client.read_write(group, 0, 64, b"MAIN.Spead\0")[0]
        same(ctx, f"an unknown name by {group:X}h", found, AdsError.SYMBOL_NOT_FOUND)
    short = struct.pack("<I", AdsError.INVALID_SIZE)
    same(ctx, "a short request", client.ask(READ, bytes(4)), (0, short))
    same(
        ctx,
        "less data than announced",
        client.ask(WRITE, struct.pack("<III", DATA, speed, 8) + b"\0")[1],
        short,
    )
    unknown = struct.pack("<I", AdsError.SERVICE_NOT_SUPPORTED)
    same(ctx, "an unknown command", client.ask(99)[1], unknown)
    same(ctx, "an unknown port", client.ask(STATE, port=900), (AdsError.PORT_NOT_FOUND, b""))
    same(ctx, "an unknown machine", client.ask(STATE, net=PEER), (AdsError.MACHINE_NOT_FOUND, b""))
    same(ctx, "values", (client.speed, client.flag), (12.5, True))


@CAMPAIGN.case("sums")
def sums(ctx: CaseContext) -> None:
    """A sum command answers each of its requests on its own, with its data where they belong."""
    client = Client()
    speed, flag = client.memory.find("MAIN.Speed").offset, client.memory.find("MAIN.Flag").offset
    asked = b"".join(struct.pack("<III", DATA, *one) for one in ((speed, 8), (9999, 4), (flag, 1)))
    code, data = client.read_write(Group.SUM_READ, 3, 25, asked)
    same(ctx, "read: codes", (code, struct.unpack_from("<III", data)), (0, (0, AdsError.INVALID_OFFSET, 0)))
    same(ctx, "read: data", data[12:], real(12.5) + bytes(4) + b"\1")
    asked = struct.pack("<IIIIII", DATA, speed, 8, DATA, flag, 1) + struct.pack("<d?", 3.0, False)
    wanted = (0, struct.pack("<II", 0, AdsError.INVALID_ACCESS))
    same(ctx, "write", client.read_write(Group.SUM_WRITE, 2, 8, asked), wanted)
    same(ctx, "values", (client.speed, client.flag), (3.0, True))
    names = [b"MAIN.Flag\0", b"MAIN.No\0"]
    heads = b"".join(struct.pack("<IIII", BY_NAME, 0, 4, len(one)) for one in names)
    code, data = client.read_write(Group.SUM_READ_WRITE, 2, 24, heads + b"".join(names))
    same(ctx, "read and write", struct.unpack_from("<IIII", data), (0, 4, AdsError.SYMBOL_NOT_FOUND, 0))
    handle = int.from_bytes(data[16:20], "little")
    same(ctx, "the handle of it", client.read(BY_HANDLE, handle, 1), (0, b"\1"))
    for group in (Group.SUM_READ, Group.SUM_WRITE, Group.SUM_READ_WRITE):
        for number, content in ((0, b""), (501, bytes(12 * 501)), (2, bytes(13))):
            found = client.read_write(group, number, 100, content)[0]
            same(ctx, f"{number} requests in {len(content)} bytes", found, AdsError.INVALID_SIZE)


@CAMPAIGN.case("notifications")
def notifications(ctx: CaseContext) -> None:
    """Cyclic ones come in their cycle and not before, the others with a change, looked for in their cycle;
    deleted ones come no more; there is a limit.
    """
    client = Client()
    speed = client.memory.find("MAIN.Speed").offset

    def add(mode: int, cycle_ms: float) -> int:
        data = struct.pack("<IIIIII16x", DATA, speed, 8, mode, 0, round(cycle_ms * 10_000))
        code, handle = struct.unpack("<II", client.ask(ADD, data)[1])
        return handle if code == 0 else -code

    cyclic, changed = add(3, 10.0), add(4, 0.0)
    same(ctx, "an unknown mode", add(9, 0.0), -AdsError.MODE_NOT_SUPPORTED)

    def samples(at_ms: float) -> list[tuple[int, float]]:
        client.sent.clear()
        client.session.sample(round(at_ms * 1e6))
        found = []
        for frame in client.sent:
            size, stamps, stamp, count, handle, length = struct.unpack_from("<IIQIII", frame.data)
            head = (frame.command, frame.flags, size, stamps, count, length)
            same(ctx, "head of a notification", head, (8, 4, len(frame.data) - 4, 1, 1, 8))
            same(ctx, "its time stamp", stamp, 125_911_584_000_000_000 + round(at_ms * 10_000))
            found.append((handle, struct.unpack_from("<d", frame.data, 28)[0]))
        return found

    same(ctx, "at once", samples(0), [(cyclic, 12.5), (changed, 12.5)])
    same(ctx, "in between", samples(5), [])
    client.speed = 1.0
    same(ctx, "with a change", samples(9.9), [(changed, 1.0)])
    same(ctx, "at the end of the cycle", samples(10), [(cyclic, 1.0)])
    same(ctx, "before the next", samples(19.9), [])
    same(ctx, "at the next", samples(20), [(cyclic, 1.0)])
    gone = struct.pack("<I", AdsError.NOTIFICATION_HANDLE_INVALID)
    same(ctx, "deleted", client.ask(DELETE, struct.pack("<I", cyclic))[1], bytes(4))
    same(ctx, "deleted again", client.ask(DELETE, struct.pack("<I", cyclic))[1], gone)
    client.speed = 2.0
    same(ctx, "afterwards", samples(50), [(changed, 2.0)])
    left = sum(add(4, 0.0) > 0 for _ in range(600))
    equal(ctx, "notifications that have room", left + 1, 512)
    same(ctx, "one more", add(4, 0.0), -AdsError.NO_MORE_HANDLES)


@CAMPAIGN.case("tables")
def tables(ctx: CaseContext) -> None:
    """The tables of symbols and data types are as long as they say; entries have address, size, type, texts
    and members, and are found by name.
    """
    client = Client()
    members = (Member("Word", "UINT", 2), Member("Rest", "UDINT", 4), Member("On", "BOOL", 0))
    client.memory.declare(Structure("IMAGE", 8, members))
    number, size = struct.unpack("<II", client.read(Group.SYMBOL_UPLOAD_INFO, 0, 8)[1])
    code, table = client.read(Group.SYMBOL_UPLOAD, 0, size)
    same(ctx, "code, symbols, length", (code, number, len(table)), (0, 4, size))
    found: dict[str, tuple[object, ...]] = {}
    while table:
        length, group, offset, count, kind, _, *texts = struct.unpack_from("<IIIIIIHHH", table)
        names, place = [], 30
        for text in texts:
            names.append(table[place : place + text].decode())
            same(ctx, "end of a text", table[place + text], 0)
            place += text + 1
        found[names[0]] = (group, offset, count, kind, *names[1:])
        table = table[length:]
    word, speed = client.memory.find("MAIN.Image.Word").offset, client.memory.find("MAIN.Speed").offset
    same(ctx, "entry of a part", found["MAIN.Image.Word"], (DATA, word, 2, 18, "UINT", ""))
    same(ctx, "entry with a comment", found["MAIN.Flag"][2:], (1, 33, "BOOL", "read only"))
    same(ctx, "entry of a number", found["MAIN.Speed"], (DATA, speed, 8, 5, "LREAL", ""))
    same(ctx, "type of an area", found["MAIN.Image"][3], 65)
    entry = client.read_write(Group.SYMBOL_INFO_BY_NAME_EX, 0, 0xFFFF, b"MAIN.Flag\0")[1]
    same(ctx, "entry by name", entry, client.memory.find("MAIN.Flag").entry())
    info = struct.unpack("<6I", client.read(Group.SYMBOL_UPLOAD_INFO_2, 0, 24)[1])
    code, table = client.read(Group.DATA_TYPE_UPLOAD, 0, info[3])
    same(ctx, "code, length, symbols", (code, len(table), info[:2]), (0, info[3], (number, size)))
    types = {one[0]: one[1:] for one in type_entries(table, info[2])}
    same(ctx, "number of types", len(types), info[2])
    same(ctx, "LREAL", types["LREAL"], ("", 8, 0, 5, 1, []))
    inner = [
        ("Word", "UINT", 2, 2, 18, 2, []),
        ("Rest", "UDINT", 4, 4, 19, 2, []),
        ("On", "BOOL", 1, 0, 33, 2, []),
    ]
    same(ctx, "IMAGE", types["IMAGE"], ("", 8, 0, 65, 1, inner))
    code, entry = client.read_write(Group.DATA_TYPE_INFO_BY_NAME_EX, 0, 0xFFFFFFFF, b"image\0")
    same(ctx, "type by name", (code, type_entries(entry, 1)[0][0]), (0, "IMAGE"))
    code = client.read_write(Group.DATA_TYPE_INFO_BY_NAME_EX, 0, 99, b"NONE\0")[0]
    same(ctx, "an unknown type", code, AdsError.SYMBOL_NOT_FOUND)


@CAMPAIGN.case("state")
def state(ctx: CaseContext) -> None:
    """State and device info; a control command reaches the device; frames come in any pieces, what is none
    ends the stream.
    """
    client = Client()
    same(ctx, "state", client.ask(STATE), (0, struct.pack("<IHH", 0, 5, 0)))
    same(ctx, "control", client.ask(CONTROL, struct.pack("<HHI", 6, 0, 0))[1], bytes(4))
    same(ctx, "state afterwards", client.ask(STATE), (0, struct.pack("<IHH", 0, 6, 0)))
    same(ctx, "device info", client.ask(1)[1], struct.pack("<IBBH16s", 0, 3, 1, 0, b"Plc30 App"))
    frame = Frame(OWN, 851, PEER, 1, STATE, 4, 0, 5, b"\1\2\3")
    reader = FrameReader()
    found = [one for byte in frame.pack() * 3 for one in reader.feed(bytes((byte,)))]
    same(ctx, "frames out of single bytes", found, [frame] * 3)
    same(ctx, "frames out of one piece", FrameReader().feed(frame.pack() * 2), [frame] * 2)
    for content in (
        b"GET / HTTP/1.1\r\n",
        struct.pack("<HI", 0, 31),
        struct.pack("<HI", 0, 33 + MOST_DATA),
        frame.pack()[:26] + b"\7" + frame.pack()[27:],
    ):
        malformed = 0
        try:
            FrameReader().feed(content)
        except MalformedFrameError:
            malformed = 1
        equal(ctx, f"{content[:6].hex()} is malformed", malformed, 1)


@CAMPAIGN.case("groups")
def groups(ctx: CaseContext) -> None:
    """State as data, version and place of symbols, values by a handle that is too short or unknown; answers
    and what nobody understands.
    """
    client = Client()
    client.state = 0x0102
    for offset, length, wanted in (
        (0, 2, (0, b"\2\1")),
        (0, 4, (0, b"\2\1\0\0")),
        (2, 2, (0, b"\0\0")),
        (3, 1, (0, b"\0")),
        (4, 1, (AdsError.INVALID_OFFSET, b"")),
        (2, 3, (AdsError.INVALID_SIZE, b"")),
    ):
        same(
            ctx,
            f"state, {length} bytes from {offset}",
            client.read(Group.DEVICE_DATA, offset, length),
            wanted,
        )
    same(ctx, "version", client.read(Group.SYMBOL_VERSION, 0, 1), (0, b"\1"))
    same(ctx, "nothing of it", client.read(Group.SYMBOL_VERSION, 0, 0), (0, b""))
    speed = client.memory.find("MAIN.Speed")
    place = struct.pack("<III", DATA, speed.offset, 8)
    for length, wanted in ((12, place), (0xFFFF_FFFF, place), (4, place[:4])):
        found = client.read_write(Group.SYMBOL_INFO_BY_NAME, 0, length, b"MAIN.Speed\0")
        same(ctx, f"place of a symbol, {length} bytes", found, (0, wanted))
    for group in (Group.SYMBOL_INFO_BY_NAME, Group.SYMBOL_VALUE_BY_NAME, Group.SYMBOL_INFO_BY_NAME_EX):
        found = client.read_write(group, 0, 99, b"MAIN.None\0")
        same(ctx, f"no such symbol, {group.name}", found, (AdsError.SYMBOL_NOT_FOUND, b""))
    handle = client.handle("MAIN.Speed")
    same(ctx, "half of it", client.read(BY_HANDLE, handle, 4), (0, real(12.5)[:4]))
    same(ctx, "more than it has", client.read(BY_HANDLE, handle, 9), (AdsError.INVALID_SIZE, b""))
    same(ctx, "no such handle", client.read(BY_HANDLE, handle + 1, 8), (AdsError.SYMBOL_NOT_FOUND, b""))
    same(
        ctx, "no such handle written", client.write(BY_HANDLE, handle + 1, real(1)), AdsError.SYMBOL_NOT_FOUND
    )
    same(ctx, "half written", client.write(BY_HANDLE, handle, b"1234"), AdsError.INVALID_SIZE)
    same(ctx, "no such group", client.read(0x1234, 0, 1), (AdsError.INVALID_GROUP, b""))
    same(ctx, "no such group written", client.write(0x1234, 0, b"1"), AdsError.INVALID_GROUP)
    found = client.read_write(0x1234, 0, 1, b"1")
    same(ctx, "no such group read and written", found, (AdsError.INVALID_GROUP, b""))
    for command, data in (
        (READ, bytes(11)),
        (WRITE, struct.pack("<III", DATA, 0, 3) + b"12"),
        (CONTROL, struct.pack("<HHI", 5, 0, 2) + b"1"),
        (DELETE, bytes(3)),
    ):
        error, answer = client.ask(command, data)
        same(
            ctx,
            f"command {command} of a wrong size",
            (error, answer),
            (0, struct.pack("<I", AdsError.INVALID_SIZE)),
        )
    error, answer = client.ask(99)
    same(ctx, "no such command", (error, answer), (0, struct.pack("<I", AdsError.SERVICE_NOT_SUPPORTED)))
    client.sent.clear()
    for flags in (5, 1, 0):
        client.session.receive(Frame(OWN, 851, PEER, 30000, READ, flags, 0, 77, bytes(12)).pack())
    same(ctx, "what is no request has no answer", len(client.sent), 0)


def _watch(group: int, offset: int, length: int, mode: int = 4, cycle: int = 0) -> bytes:
    return struct.pack("<IIIIII16s", group, offset, length, mode, 0, cycle, b"")


@CAMPAIGN.case("sums-of-notifications")
def sums_of_notifications(ctx: CaseContext) -> None:
    """Several notifications are added and ended at once, each with a code of its own; samples say what has
    changed, by change or by cycle.
    """
    client = Client()
    speed, flag = client.memory.find("MAIN.Speed"), client.memory.find("MAIN.Flag")
    handle = client.handle("MAIN.Speed")
    rows = (
        (_watch(DATA, speed.offset, 8), 0),
        (_watch(DATA, flag.offset, 1, mode=3, cycle=10_000), 0),
        (_watch(BY_HANDLE, handle, 8), 0),
        (_watch(BY_HANDLE, handle + 9, 8), AdsError.SYMBOL_NOT_FOUND),
        (_watch(BY_HANDLE, handle, 9), AdsError.INVALID_SIZE),
        (_watch(Group.SYMBOL_UPLOAD, 0, 8), AdsError.INVALID_GROUP),
        (_watch(DATA, 0xFFFF_0000, 8), None),
        (_watch(DATA, speed.offset, 8, mode=99), AdsError.MODE_NOT_SUPPORTED),
    )
    data = b"".join(row for row, _ in rows)
    code, found = client.read_write(Group.SUM_ADD_NOTIFICATION, len(rows), 8 * len(rows), data)
    same(ctx, "code of all", code, 0)
    pairs = list(struct.iter_unpack("<II", found))
    for (one, number), (_, wanted) in zip(pairs, rows, strict=True):
        same(
            ctx,
            "code and handle",
            (one != 0 if wanted is None else one == wanted, number > 0),
            (True, wanted == 0),
        )
    handles = [number for one, number in pairs if not one]
    same(ctx, "each handle once", len(set(handles)), 3)
    for count, given in ((0, b""), (2, rows[0][0]), (1, data), (501, rows[0][0] * 501)):
        found = client.read_write(Group.SUM_ADD_NOTIFICATION, count, 8, given)
        same(ctx, f"{count} with {len(given)} bytes", found, (AdsError.INVALID_SIZE, b""))
        found = client.read_write(Group.SUM_DELETE_NOTIFICATION, count, 8, given)
        same(ctx, f"{count} ended with {len(given)} bytes", found, (AdsError.INVALID_SIZE, b""))

    def sampled(ms: float) -> list[int]:
        client.sent.clear()
        client.session.sample(round(ms * 1e6))
        return [struct.unpack_from("<I", one.data, 20)[0] for one in client.sent]

    first, cyclic, by_handle = handles
    same(ctx, "at first all", sampled(0.0), handles)
    same(ctx, "nothing has changed", sampled(0.5), [])
    same(ctx, "its cycle is over", sampled(1.0), [cyclic])
    client.speed = 3.0
    same(ctx, "changed", sampled(1.5), [first, by_handle])
    same(ctx, "value", client.sent[0].data[28:], real(3.0))
    same(ctx, "time", struct.unpack_from("<Q", client.sent[0].data, 8)[0] % 10_000_000_000 % 100_000, 15_000)
    client.write(Group.SYMBOL_RELEASE_HANDLE, 0, struct.pack("<I", handle))
    client.speed = 4.0
    same(ctx, "the handle may be released", sampled(2.0), [first, cyclic, by_handle])
    gone = struct.pack("<III", first, 999, by_handle)
    code, found = client.read_write(Group.SUM_DELETE_NOTIFICATION, 3, 12, gone)
    wanted = (0, int(AdsError.NOTIFICATION_HANDLE_INVALID), 0)
    same(ctx, "ended", (code, struct.unpack("<III", found)), (0, wanted))
    client.speed = 5.0
    same(ctx, "what is left", sampled(3.0), [cyclic])
