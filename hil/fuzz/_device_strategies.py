"""Hypothesis strategies for what is asked of devices."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from fieldbus.canopen.nmt import NmtCommand
from hil.fuzz._program import Do, Step, Wait

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.fuzz._devices import Devices, Entry, Led, Node, Server

_CONTROL: Final = (0x06, 0x07, 0x0F, 0x0F, 0x1F, 0x3F, 0x5F, 0x7F, 0x02, 0x00, 0x80, 0x10F, 0x0B)
"""Control words of CiA 402: the way to operation, new setpoints, quick stop, fault reset, halt."""
_MODES: Final = (1, 1, 2, 3, 4, 6, 6, 7, 8, 9, 10, 0, -1)
_STW1: Final = (
    0x047E,
    0x047F,
    0x047F,
    0x04FE,
    0x047D,
    0x047B,
    0x0477,
    0x046F,
    0x045F,
    0x043F,
    0x057F,
    0x067F,
)
"""Control words of PROFIdrive: off, operation, acknowledge, OFF2, OFF3, operation inhibited, ramp off, ramp
frozen, setpoint off, jogging.
"""
CONTROL_WORD, MODE = 0x6040, 0x6060
_MOTION: Final = range(0x6042, 0x6100)
"""Objects that rule how a drive moves."""


def _number(value: int, size: int) -> str:
    return (value & (1 << 8 * size) - 1).to_bytes(size, "little").hex()


def _write(node: Node, entry: Entry, data: str) -> Step:
    return Do("sdo_write", {"device": node.name, "index": entry.index, "sub": entry.sub, "data": data})


def _values(entry: Entry) -> SearchStrategy[str]:
    """Return contents for an object: what it has, and numbers small and large."""
    size = len(entry.start) // 2
    if not size:
        return st.binary(max_size=12).map(bytes.hex)
    top = (1 << 8 * size) - 1
    known = [
        0,
        1,
        2,
        3,
        5,
        7,
        10,
        35,
        100,
        500,
        2000,
        20_000,
        100_000,
        top,
        top >> 1,
        (top >> 1) + 1,
        top - 99,
    ]
    numbers = st.sampled_from([one for one in known if one <= top]).map(lambda one: _number(one, size))
    return st.one_of(numbers, st.just(entry.start))


def _reads(node: Node) -> SearchStrategy[Step]:
    readable = [one for one in node.entries if one.readable]
    return st.builds(
        lambda one, block: Do("sdo_read", {"device": node.name, "index": one.index, "sub": one.sub, **block}),
        st.sampled_from(readable),
        st.sampled_from([{}, {}, {}, {"block": True}]),
    )


def _refused(node: Node) -> SearchStrategy[Step]:
    """Return requests that have to be refused: no such object or member, wrong length, no such command."""
    entries = st.sampled_from(node.entries)
    lengths = st.sampled_from(["", "00"])
    return st.one_of(
        st.builds(
            lambda one, by: Do(
                "sdo_read", {"device": node.name, "index": one.index, "sub": (one.sub + by) & 0xFF}
            ),
            entries,
            st.sampled_from([1, 2, 100]),
        ),
        st.builds(
            lambda one, more: _write(
                node, one, (one.start + more) if more else one.start[2:] or "0000000000"
            ),
            st.sampled_from(
                [one for one in node.entries if one.start and one.parameter] or list(node.entries)
            ),
            lengths,
        ),
        st.builds(
            lambda command, one: Do(
                "sdo_frame",
                {
                    "device": node.name,
                    "data": (bytes((command,)) + one.index.to_bytes(2, "little") + bytes((one.sub,))).hex()
                    + "00000000",
                },
            ),
            st.sampled_from([0x00, 0x10, 0x60, 0x70, 0x80, 0xA0, 0xA2, 0xC1, 0xE0]),
            entries,
        ),
    )


def _of_node(node: Node) -> list[SearchStrategy[Step]]:
    """Return what is asked of a node, each kind as likely as another."""
    same = [one for one in node.entries if one.parameter and one.start and one.readable]
    found = [_reads(node), _refused(node)]
    if same:
        found.append(st.sampled_from(same).map(lambda one: _write(node, one, one.start)))
    if node.led:
        return found
    writable = [one for one in node.entries if one.writable]
    if writable:
        found.append(_any_write(node, writable))
    commands = [one for one in NmtCommand.__members__ for _ in range(3 if one == "START" else 1)]
    found += [
        st.sampled_from(commands).map(lambda one: Do("nmt", {"device": node.name, "command": one})),
        st.sampled_from([0.0, 2.0, 4.0, 4.0, 10.0]).map(
            lambda one: Do("sync", {"device": node.name, "period_ms": one})
        ),
        st.builds(
            lambda base, data: Do("can_frame", {"device": node.name, "can_id": base, "data": data.hex()}),
            st.sampled_from(
                [one + node.number for one in (0x200, 0x300, 0x400, 0x500, 0x700)] + [0x7E5, 0x100]
            ),
            st.binary(max_size=8),
        ),
    ]
    motion = [one for one in writable if one.index in _MOTION]
    if node.servo:
        control = st.sampled_from(_CONTROL).map(lambda one: written(node, CONTROL_WORD, one, 2))
        found += [control, control]
        if any(one.index == MODE for one in writable):
            found.append(st.sampled_from(_MODES).map(lambda one: written(node, MODE, one, 1)))
        found += [_any_write(node, motion)] * 3
    return found


def _any_write(node: Node, entries: Sequence[Entry]) -> SearchStrategy[Step]:
    return st.sampled_from(list(entries)).flatmap(
        lambda one: _values(one).map(lambda data: _write(node, one, data))
    )


def written(node: Node, index: int, number: int, size: int) -> Step:
    """Return a step that writes a number of so many bytes to an object."""
    return Do("sdo_write", {"device": node.name, "index": index, "data": _number(number, size)})


def _of_server(server: Server) -> list[SearchStrategy[Step]]:
    addresses = st.one_of(st.integers(0, 130), st.integers(290, 620), st.integers(0, 0xFFFF))
    found: list[SearchStrategy[Step]] = []
    if server.spare:
        found.append(
            st.builds(
                lambda function, address, quantity: Do(
                    "modbus",
                    {"device": server.name, "function": function, "address": address, "quantity": quantity},
                ),
                st.sampled_from([1, 2, 3, 3, 4]),
                addresses,
                st.sampled_from([1, 1, 2, 5, 20]),
            )
        )
    if server.numbers:
        found.append(
            st.builds(
                lambda number, element: Do(
                    "parameter_read", {"device": server.name, "number": number, "element": element}
                ),
                st.sampled_from(list(server.numbers)),
                st.sampled_from([0, 0, 0, 1, 2, 99]),
            )
        )
    return found


def _of_led(led: Led) -> list[SearchStrategy[Step]]:
    control = st.sampled_from(_STW1).map(
        lambda one: Do("signal", {"device": led.name, "name": "STW1", "value": one})
    )
    others = [one for one in led.signals if one[0] not in {"STW1", "STW2"}]
    found: list[SearchStrategy[Step]] = [control, control]
    if others:
        signals = st.sampled_from(others).flatmap(
            lambda one: st.sampled_from(one[1]).map(
                lambda value: Do("signal", {"device": led.name, "name": one[0], "value": value})
            )
        )
        found += [signals] * 3
    return found


def device_steps(devices: Devices) -> list[SearchStrategy[Step]]:
    """Return what programs ask of devices: a strategy for each device that its controller leads, and several
    for one that the program leads itself.
    """
    found: list[SearchStrategy[Step]] = []
    for node in devices.nodes:
        own = _of_node(node)
        found += [st.one_of(own)] if node.led else [st.one_of(own)] * 3
    found += [st.one_of(own) for server in devices.servers if (own := _of_server(server))]
    for led in devices.led:
        found += [st.one_of(_of_led(led))] * 3
    return found


def device_preamble(devices: Devices) -> tuple[Step, ...]:
    """Return the steps by which drives without an axis come into operation."""
    found: list[Step] = []
    for node in devices.nodes:
        if not node.led:
            found.append(Do("nmt", {"device": node.name, "command": "START"}))
            if node.servo:
                found.append(Do("sync", {"device": node.name}))
                found += [written(node, CONTROL_WORD, one, 2) for one in (0x06, 0x07, 0x0F)]
    for value in (0x047E, 0x047F):
        found += [Do("signal", {"device": led.name, "name": "STW1", "value": value}) for led in devices.led]
        if devices.led:
            found.append(Wait(0.2))
    return tuple(found)
