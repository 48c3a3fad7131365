"""All CANopen devices of a bench, object by object, as their own EDS says: defaults straight after power-on
and after each kind of reset, access, lengths, ranges, what is written, stored and restored.

The devices, and what is expected of them, come from the bench file and the dictionaries: the campaign runs on
any virtual bench with CANopen devices.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any, Final

from fieldbus.canopen import NmtCommand
from hil.bench import BenchFile
from hil.campaign import Campaign, CaseContext
from testcases.campaigns._readout import Device, Item, Place, Readout, devices, told

BENCH: Final = BenchFile(
    "canopen devices",
    """
[bench]
name = "canopen devices"
kind = "virtual"
cycle_ms = 4

[segment.can0]
bitrate = 1_000_000

[drive.servo]
segment = "can0"
node_id = 5
increments_per_revolution = 4000
heartbeat_ms = 130
max_speed_rpm = 2750
off1_ramp_s = 0.8
off3_ramp_s = 0.3
rated_torque_nm = 2.5

[drive.profidrive]
profile = "profidrive"
telegram = 105
segment = "can0"
node_id = 6

[drive.pulses]
profile = "tm_pto"
segment = "can0"
node_id = 7
increments_per_revolution = 2000

[drive.signal]
profile = "tm41"
segment = "can0"
node_id = 8
increments_per_revolution = 4096

[encoder.rotary]
segment = "can0"
node_id = 21
type = "multi_turn"
steps_per_revolution = 1000
revolutions = 16

[encoder.linear]
segment = "can0"
node_id = 22
type = "absolute_linear"
measuring_step_um = 0.5
length_mm = 600.0
offset_mm = 123.0

[encoder.heads]
segment = "can0"
node_id = 23
type = "multi_sensor"
heartbeat_ms = 0

[encoder.words]
segment = "can0"
node_id = 24
profile = "profidrive"
type = "multi_turn"
""",
)
CAMPAIGN: Final = Campaign(
    "device objects", controller="", tags=("canopen",), bench="testcases.campaigns.device_objects:BENCH"
)
LOAD, SAVE = 0x64616F6C, 0x65766173
MISSING, NO_SUB, READ_ONLY, WRITE_ONLY = 0x06020000, 0x06090011, 0x06010002, 0x06010001
TOO_HIGH, TOO_LOW, NO_DATA = 0x06090031, 0x06090032, 0x08000024
LENGTH, TOO_LONG, TOO_SHORT = 0x06070010, 0x06070012, 0x06070013
STORE, RESTORE, ERRORS = 0x1010, 0x1011, 0x1003
BOOT_S: Final = 0.08
"""Time within which every device has booted and tested itself."""
WORDS: Final = range(0x5800, 0x5820)
"""Telegram words of a PROFIdrive device, which are no settings."""
SIGN_OF_LIFE: Final = (0x1001, 0x1003, 0x2853)
"""Where a PROFIdrive encoder says that it has missed telegrams, which the controller of the bench sends."""
GOES_ON: Final = (0x1012, 0x1013, 0x2106, *WORDS)
"""Objects that show a time that goes on, or signs of life."""


# -- what the bench file says of a device ------------------------------------------------------------------


def _of_servo(section: Any, bench: Any) -> dict[Place, int]:
    """A CiA 402 drive of the product: velocities in 10^-3 rpm, positions in increments."""
    speed, counts = round(section.max_speed_rpm * 1000), section.increments_per_revolution
    ramp, quick = round(speed / section.off1_ramp_s), round(speed / section.off3_ramp_s)
    given = {
        (0x6041, 0): 0x0250,
        **dict.fromkeys(((0x2101, 1), (0x2101, 2)), 250),
        (0x6076, 0): round(section.rated_torque_nm * 1000),
        (0x6079, 0): round(section.supply.nominal_v * 1000),
        (0x607F, 0): speed,
        (0x6080, 0): round(section.max_speed_rpm),
        (0x6081, 0): speed // 3,
        (0x6085, 0): quick,
        **dict.fromkeys(((0x6083, 0), (0x6084, 0), (0x609A, 0)), ramp),
        **dict.fromkeys(((0x608F, 1), (0x6090, 1), (0x6092, 1)), counts),
        (0x6099, 1): speed // 15,
        (0x6099, 2): speed // 150,
        (0x60A9, 0): 0xFDB44700,
        (0x60C2, 1): bench.cycle_ms,
        (0x60C2, 2): -3,
        **dict.fromkeys(((0x60C5, 0), (0x60C6, 0)), 60_000_000),
        (0x6510, 1): bench.servo_period_ns // 1000,
    }
    standing = (0x6043, 0x6044, 0x6062, 0x6063, 0x6064, 0x6069, 0x606B, 0x606C, 0x6074, 0x6077, 0x6078)
    given |= {(index, 0): 0 for index in (*standing, 0x60F4, 0x60FA, 0x60FC, 0x60FD)}
    return given | {(0x60E4, 1): 0, (0x60E5, 1): 0}


def _of_encoder(section: Any, bench: Any) -> dict[Place, int]:
    """A CiA 406 encoder at the place where its shaft begins."""
    del bench
    given: dict[Place, int] = {(0x1017, 0): section.heartbeat_ms, (0x650B, 0): 1}
    if section.linear:
        step = section.measuring_step_um / 1000.0
        total, place = (
            round(section.length_mm / step),
            round((0.5 * section.length_mm if section.offset_mm is None else section.offset_mm) / step),
        )
        given |= {(0x6002, 0): total, (0x650A, 3): total - 1}
        given |= dict.fromkeys(((0x6005, 1), (0x6501, 0)), round(step * 1e6))
        given |= dict.fromkeys(((0x6004, 0), (0x6008, 0), (0x600C, 0), (0x6020, 1)), place)
        given[0x6020, 2] = (place + total // 4) % total
        return given
    steps, turns = section.steps_per_revolution, section.revolutions
    total = steps * turns
    given |= {(0x6001, 0): steps, (0x6002, 0): total, (0x6501, 0): steps, (0x6502, 0): turns}
    return given | {(0x650A, 3): total - 1}


def _of_words(section: Any, bench: Any) -> dict[Place, int | None]:
    """A PROFIdrive device: PNU 922 and PNU 979; its telegram says what the PDOs carry."""
    del bench
    given: dict[Place, int | None] = {
        (index, sub): None for index in range(0x1A00, 0x1A08) for sub in range(9)
    }
    given |= {(index, 1): None for index in range(0x1800, 0x1808)}
    given |= {(0x23D3, sub): None for sub in range(1, 11)}
    if hasattr(section, "steps_per_revolution"):
        given |= {(0x1017, 0): section.heartbeat_ms, (0x239A, 0): section.profidrive.telegram}
        given |= {(0x23D3, 3): section.steps_per_revolution, (0x23D3, 6): section.revolutions}
    return given


FROM_BENCH: Final[Mapping[str, Callable[[Any, Any], Mapping[Place, int | None]]]] = {
    "cia402": _of_servo,
    "cia406": _of_encoder,
    "profidrive": _of_words,
}
"""Values that follow from the table of a device in the bench file, by its profile; None: nothing is said."""


def expected(device: Device) -> dict[Place, Any]:
    """Return what the entries of a device begin with; entries of which nothing is said are not in it."""
    found = {place: item.default for place, item in device.items.items() if item.default is not None}
    own = getattr(device.section, "eds", None) is None
    given = FROM_BENCH.get(device.section.profile) if own else None
    if given is not None:
        found |= {
            place: value
            for place, value in given(device.section, device.ctx.bench.config.bench).items()
            if place in device.items
        }
    return {place: value for place, value in found.items() if value is not None and place[0] not in GOES_ON}


# -- cases -------------------------------------------------------------------------------------------------


@CAMPAIGN.case("as-delivered")
def as_delivered(ctx: CaseContext) -> None:
    """Straight after power-on every entry has the default of the EDS or what the bench file says; after
    communication reset, node reset, and a power cycle it has the same.
    """
    ctx.run_for(BOOT_S)
    for device in devices(ctx):
        fresh = device.readout()
        device.none("straight after power-on", _other_than_delivered(device, fresh), "C301-018", "C301-085")
        led = device.section.profile == "profidrive" and device.name in ctx.bench.encoder_names
        for command in (NmtCommand.RESET_COMMUNICATION, NmtCommand.RESET_NODE):
            device.nmt(command)
            ctx.run_for(BOOT_S)
            but = (*GOES_ON, *(SIGN_OF_LIFE if led else ()))
            device.same(f"after {command.name}", device.readout(), fresh, "C301-018", but=but)
        device.off_and_on()
        device.same("after a power cycle", device.readout(), fresh, "C301-018", but=GOES_ON)


def _other_than_delivered(device: Device, fresh: Readout) -> Iterator[str]:
    begins = expected(device)
    for place, item in device.items.items():
        found = fresh[place]
        if not item.readable:
            wanted: bytes | int = WRITE_ONLY
        elif place[0] == ERRORS and place[1]:
            wanted = NO_DATA
        elif isinstance(found, int) or place in begins:
            wanted = item.packed(begins.get(place, 0))
        elif item.size and len(found) != item.size:
            wanted = bytes(item.size)
        else:
            continue
        if found != wanted:
            yield told(item.text, found, wanted)


@CAMPAIGN.case("access", requirements=("C301-085", "C301-086"))
def access(ctx: CaseContext) -> None:
    """What can only be read takes nothing; lengths, ends of ranges and sub-indices are checked; what was
    refused has changed nothing.
    """
    ctx.run_for(BOOT_S)
    for device in devices(ctx):
        before = device.readout()
        device.none("entries that there are not", _not_there(device), "C301-085")
        device.none("access", _wrongly_taken(device, before), "C301-085", "C301-086")
        device.same("after all refusals", device.readout(), before, "C301-086", but=GOES_ON)


def _not_there(device: Device) -> Iterator[str]:
    highest: dict[int, int] = {}
    for index, sub in device.items:
        highest[index] = max(highest.get(index, 0), sub)
    for index, sub in highest.items():
        found = device.upload(index, sub + 1) if sub < 0xFF else NO_SUB
        if found != NO_SUB:
            yield told(f"{index:04X}h:{sub + 1}", found, NO_SUB)
    for index in {0x1004, 0x1FFF, 0x5FFF, 0x67FD, 0xA000} - set(highest):
        for found in (device.upload(index), device.download(index, 0, b"\0")):
            if found != MISSING:
                yield told(f"{index:04X}h", found, MISSING)


def _wrongly_taken(device: Device, before: Readout) -> Iterator[str]:
    for place, item in device.items.items():
        content = before[place]
        tries: list[tuple[bytes, tuple[int, ...]]] = []
        if not item.writable:
            tries.append((content if isinstance(content, bytes) and content else b"\0", (READ_ONLY,)))
        elif item.size:
            tries.append((bytes(item.size + 1), (LENGTH, TOO_LONG)))
            if item.size > 1:
                tries.append((bytes(item.size - 1), (LENGTH, TOO_SHORT)))
        if item.writable and item.whole:
            low, high = item.range
            for limit, value, code in ((item.low, low - 1, TOO_LOW), (item.high, high + 1, TOO_HIGH)):
                if limit is not None and item.number(item.packed(value)) == value:
                    tries.append((item.packed(value), (code,)))
        for data, codes in tries:
            found = device.download(*place, data)
            if found not in codes:
                yield told(f"abort code of {item.text} = {data[::-1].hex()}", found, codes[0])


# -- what is written ---------------------------------------------------------------------------------------

CONTROLS: Final = (0x6040, 0x6060)
"""Objects that move a drive."""
EVENT_TIMER: Final = 0x6200
"""Of an encoder, the same as 1800h:5."""
APPLICATION: Final = 0x2000
"""Objects from here on belong to the application; those before describe communication."""
SETPOINTS: Final = (0x6042, 0x6052, 0x6071, 0x607A, *range(0x60B0, 0x60B9), 0x60C1, 0x60C4, 0x60FF)
"""Set-points, and places in their buffer: nothing that is stored."""
ORDERS: Final = (ERRORS, STORE, RESTORE, 0x1014, 0x1200, 0x1280, 0x1F80, 0x2107)
"""Objects that order something when they are written, and the identifiers of the services in use."""
PDOS: Final = range(0x1400, 0x1C00)


def _settings(device: Device) -> Iterator[Item]:
    """Return the whole numbers that can be written without an order, a motion or a change of the PDOs."""
    for (index, _), item in device.items.items():
        if (
            item.writable
            and item.readable
            and item.whole
            and index not in (*CONTROLS, *ORDERS, *PDOS, *WORDS)
        ):
            yield item


def _write_others(device: Device) -> tuple[dict[Place, bytes], list[str]]:
    """Write another value to every setting: the first that is taken of some near to the present one.

    Returns:
        What was taken, and where the entry did not show it straight afterwards.

    """
    taken, wrong = {}, []
    for item in _settings(device):
        content = device.upload(*item.place)
        if isinstance(content, int):
            continue
        now, (low, high) = item.number(content), item.range
        for value in (now + 1, now - 1, now + 2, now // 2, 0, 1, 2):
            if value == now or not low <= value <= high:
                continue
            data = item.packed(value)
            if device.download(*item.place, data):
                continue
            taken[item.place] = data
            found = device.upload(*item.place)
            if found != data:
                wrong.append(told(item.text, found, data))
            break
    return taken, wrong


@CAMPAIGN.case("written")
def written(ctx: CaseContext) -> None:
    """What is written is shown; a node reset takes it back, stored it is kept over a power cycle, and what
    was restored counts from the next start on.
    """
    ctx.run_for(BOOT_S)
    for device in devices(ctx):
        fresh = device.readout()
        taken, wrong = _write_others(device)
        device.none("shown after it was written", wrong)
        full = device.readout()
        device.nmt(NmtCommand.RESET_COMMUNICATION)
        ctx.run_for(BOOT_S)
        half = {place: fresh[place] if place[0] < APPLICATION else content for place, content in full.items()}
        but = (*GOES_ON, *SIGN_OF_LIFE, EVENT_TIMER)
        device.same("after RESET_COMMUNICATION", device.readout(), half, "C301-018", but=but)
        device.nmt(NmtCommand.RESET_NODE)
        ctx.run_for(BOOT_S)
        device.same("after RESET_NODE", device.readout(), fresh, "C301-018", but=GOES_ON)
        taken, _ = _write_others(device)
        if (STORE, 1) not in device.items:
            continue
        full = device.readout()
        device.equal("abort code of storing", device.download(STORE, 1, SAVE.to_bytes(4, "little")), 0)
        device.off_and_on()
        kept = device.readout()
        lost = (
            told(device.items[place].text, kept[place], full[place])
            for place in taken
            if place[0] not in SETPOINTS and kept[place] != full[place]
        )
        device.none("stored", lost, "C301-140")
        device.equal("abort code of restoring", device.download(RESTORE, 1, LOAD.to_bytes(4, "little")), 0)
        device.same("before the next start", device.readout(), kept, "C301-141", but=GOES_ON)
        device.off_and_on()
        device.same("after restoring", device.readout(), fresh, "C301-141", but=GOES_ON)
