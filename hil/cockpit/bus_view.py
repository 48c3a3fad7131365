"""The buses of a bench: decoded frames with a filter, a frame bit by bit, and the objects of nodes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from enum import IntFlag
from typing import TYPE_CHECKING, Final

from emulators.drive.profidrive.parameters.definitions import factory_definitions
from fieldbus.can.frame import CanFrame
from fieldbus.canopen.dictionary import BOOLEAN, UNICODE_STRING, VISIBLE_STRING, Entry, entries_of
from fieldbus.cia402 import Controlword, Statusword
from fieldbus.errors import ConfigurationError
from fieldbus.profidrive import STW1, ZSW1
from hil.bench.drives import build_decoder
from hil.cockpit.parameter_rows import parameter_rows
from hil.cockpit.steps import parameter_port

if TYPE_CHECKING:
    from collections.abc import Sequence

    from emulators.drive.profidrive import ParameterDefinition
    from fieldbus.canopen.decode import FrameDecoder, PdoField
    from fieldbus.modbus import ModbusFrame
    from hil.bench.bench import Bench
    from hil.bench.segments import Segment
    from reports.json_types import JsonObject

MOST_ROWS: Final = 500
"""Frames in one answer."""
_MOST_LOOKED_AT: Final = 100_000
"""Frames that one request goes back by."""
_MOST_DECODED: Final = 4000
"""Frames that one request decodes, so that a filter does not hold up the bench."""
_TYPES: Final = {
    0x01: "BOOLEAN",
    0x02: "INTEGER8",
    0x03: "INTEGER16",
    0x04: "INTEGER32",
    0x05: "UNSIGNED8",
    0x06: "UNSIGNED16",
    0x07: "UNSIGNED32",
    0x08: "REAL32",
    0x09: "VISIBLE_STRING",
    0x0A: "OCTET_STRING",
    0x0B: "UNICODE_STRING",
    0x0F: "DOMAIN",
    0x11: "REAL64",
    0x15: "INTEGER64",
    0x1B: "UNSIGNED64",
}
_WORDS: Final[Mapping[str, type[IntFlag | STW1 | ZSW1]]] = {
    "controlword": Controlword,
    "statusword": Statusword,
    "STW1": STW1,
    "ZSW1": ZSW1,
}
"""Names of the bits of words, by how a field with one begins."""


class BusView:
    """The buses of a bench.

    Args:
        bench: The bench.

    """

    def __init__(self, bench: Bench) -> None:
        self._bench = bench
        self._decoders: dict[str, FrameDecoder] = {}
        self._entries: dict[str, dict[int, Entry]] = {}

    # -- frames ---------------------------------------------------------------------------------------------

    def rows(
        self, segment: str, since: int, *, words: str = "", cyclic: bool = True, most: int = 200
    ) -> JsonObject:
        """Return frames of a segment from a number on, the newest ones where there are too many.

        Args:
            segment: Its name.
            since: Number of the first frame, from 0; negative: the newest ones.
            words: Words that all have to be in identifier, sender or meaning.
            cyclic: Whether SYNC and PDOs are shown.
            most: Rows at most.

        Raises:
            ConfigurationError: There is no such segment.

        """
        log = self._log(segment)
        end = len(log)
        wanted = words.lower().split()
        budget = _MOST_DECODED if wanted else most
        skipped = frozenset() if cyclic else self._cyclic(segment)
        chosen: list[int] = []
        number = end
        while number > max(since, end - _MOST_LOOKED_AT, 0) and len(chosen) < budget:
            number -= 1
            if not skipped or log[number][2].can_id not in skipped:
                chosen.append(number)
        rows = []
        for place in reversed(chosen):  # in order: decoding learns from what it sees
            row = self._row(segment, place, log[place])
            shown = f"{row['id']} {row['sender']} {row['text']}".lower()
            if all(word in shown for word in wanted):
                rows.append(row)
        return {"next": end, "rows": rows[-most:], "left_out": max(0, number - since) if since >= 0 else 0}

    def _cyclic(self, segment: str) -> frozenset[int]:
        """Return the identifiers of SYNC and PDOs."""
        if segment not in self._bench.network_names:
            return frozenset()
        decoder = self._decoder(segment)
        return frozenset((decoder.sync_id, *decoder.pdo_ids))

    def _row(
        self, segment: str, number: int, entry: tuple[int, str, CanFrame | ModbusFrame, str]
    ) -> JsonObject:
        time_ns, sender, frame, error = entry
        can = isinstance(frame, CanFrame)
        return {
            "number": number,
            "time_s": time_ns * 1e-9,
            "id": f"{frame.can_id:0{8 if frame.extended else 3}X}" if can else str(frame.can_id),
            "sender": sender,
            "length": frame.dlc,
            "data": frame.data.hex(" ").upper(),
            "text": self._bench.decode(frame, segment=segment),
            "error": error,
        }

    def details(self, segment: str, number: int) -> JsonObject:
        """Return a frame with its fields and their bits.

        Raises:
            ConfigurationError: There is no such segment or frame.

        """
        log = self._log(segment)
        if not 0 <= number < len(log):
            raise ConfigurationError("frame", number, f"0 to {len(log) - 1}")
        entry = log[number]
        row = self._row(segment, number, entry)
        frame = entry[2]
        fields: list[JsonObject] = []
        if isinstance(frame, CanFrame):
            fields = [_field(one) for one in self._decoder(segment).fields(frame)]
        if not fields:
            fields = [
                {
                    "name": f"byte {place}",
                    "object": "",
                    "first": 8 * place,
                    "bits": 8,
                    "hex": f"{byte:02X}h",
                    "text": str(byte),
                    "set": [bit for bit in range(8) if byte >> bit & 1],
                    "names": {},
                }
                for place, byte in enumerate(frame.data)
            ]
        return {**row, "fields": fields}

    def _segment(self, name: str) -> Segment:
        if name not in self._bench.segment_names:
            raise ConfigurationError("segment", name, f"one of {', '.join(self._bench.segment_names)}")
        return self._bench.segment(name)

    def _log(self, name: str) -> Sequence[tuple[int, str, CanFrame | ModbusFrame, str]]:
        self._segment(name)
        return self._bench.recorder.frames(name)

    def _decoder(self, segment: str) -> FrameDecoder:
        if segment not in self._decoders:
            self._decoders[segment] = build_decoder(
                self._bench.config, self._bench.ports.can, segment=segment
            )
        return self._decoders[segment]

    # -- objects --------------------------------------------------------------------------------------------

    @property
    def nodes(self) -> tuple[str, ...]:
        """Names of the nodes whose objects the controller can reach by SDO."""
        config = self._bench.config
        reached = {*self._bench.ports.can, *(name for name in config.encoder)}
        return tuple(
            name
            for name, table in config.nodes.items()
            if not config.segment[table.segment].on_modbus and name in reached
        )

    @property
    def on_modbus(self) -> dict[str, str]:
        """Nodes on Modbus, and why their parameters cannot be reached; empty: they can."""
        config = self._bench.config
        on_modbus = {name for name, table in config.segment.items() if table.on_modbus}
        return {
            name: self._no_parameters(name)
            for name, table in {**config.drive, **config.station}.items()
            if getattr(table, "segment", None) in on_modbus
        }

    def _no_parameters(self, name: str) -> str:
        if name not in self._bench.ports.by_name:
            return "it has registers and bits, and no parameters"
        try:
            parameter_port(self._bench, name)
        except ConfigurationError:
            return "its register map has no parameter channel (data record 47)"
        if self._bench.config.drive[name].device == "physical":
            return "the list of the parameters of a physical drive on Modbus is not known here"
        return ""

    def objects(self, node: str) -> list[JsonObject]:
        """Return the entries of the dictionary of a node, by its EDS, or the parameters of a drive on Modbus.

        Raises:
            ConfigurationError: There is no such node, or it has none.

        """
        if node in self.on_modbus:
            return list(parameter_rows(self._parameters(node)))
        return [_described(one) for _, one in sorted(self._dictionary(node).items())]

    def parameter(self, node: str, number: int, index: int) -> ParameterDefinition:
        """Return a parameter of a drive on Modbus.

        Raises:
            ConfigurationError: There is no such drive, parameter or element.

        """
        found = next((one for one in self._parameters(node) if one.number == number), None)
        if found is None or index >= found.elements:
            raise ConfigurationError("parameter", f"{number}[{index}]", f"a parameter of {node}")
        return found

    def _parameters(self, node: str) -> tuple[ParameterDefinition, ...]:
        reason = self.on_modbus.get(node, "it is not on Modbus")
        if reason:
            raise ConfigurationError("node", node, f"a drive with a parameter channel; of this one {reason}")
        return factory_definitions()

    def entry(self, node: str, index: int, sub: int) -> Entry:
        """Return an entry of a node.

        Raises:
            ConfigurationError: There is no such node or entry.

        """
        found = self._dictionary(node).get(index << 8 | sub)
        if found is None:
            raise ConfigurationError("object", f"{index:04X}h:{sub}", f"an object of the EDS of {node}")
        return found

    def encoded(self, node: str, index: int, sub: int, text: str) -> bytes:
        """Return the bytes that a text stands for, checked by type, access and limits of the EDS.

        Raises:
            ConfigurationError: The entry is read-only, or the text is no value of it; the message says what
                is allowed.

        """
        entry = self.entry(node, index, sub)
        where = f"{node} {index:04X}h:{sub} {entry.name}"
        if not entry.writable:
            raise ConfigurationError(where, text, "nothing: it is read-only")
        if entry.integer:
            return entry.encode(_integer(entry, where, text))
        if entry.real is not None:
            return entry.encode(_number(entry, where, text))
        if entry.data_type in (VISIBLE_STRING, UNICODE_STRING):
            return entry.encode(text)
        try:
            content = bytes.fromhex(text)
        except ValueError:
            raise ConfigurationError(where, text, "bytes in hexadecimal: 01 A0 FF") from None
        if entry.size and len(content) != entry.size:
            raise ConfigurationError(where, text, f"{entry.size} bytes in hexadecimal")
        return content

    def value_text(self, node: str, index: int, sub: int, data: bytes) -> str:
        """Return the content of an entry in words."""
        segment = self._bench.config.nodes[node].segment
        return self._decoder(segment).value_text(self._bench.config.nodes[node].node_id, index, sub, data)

    def _dictionary(self, node: str) -> dict[int, Entry]:
        if node not in self.nodes:
            raise ConfigurationError("node", node, f"one of {', '.join(self.nodes) or 'none on CAN'}")
        if node not in self._entries:
            table = self._bench.config.nodes[node]
            self._entries[node] = entries_of(table.dictionary(), table.node_id)
        return self._entries[node]


def _field(one: PdoField) -> JsonObject:
    width = (one.bits + 3) // 4
    names: dict[str, str] = {}
    for begin, flags in _WORDS.items():
        if one.name.lower().startswith(begin.lower()):
            names = {str(bit): name for bit, name in _bit_names(flags)}
    return {
        "name": one.name,
        "object": f"{one.object_index:04X}h:{one.sub:02X}h",
        "first": one.first_bit,
        "bits": one.bits,
        "hex": f"{one.number:0{width}X}h",
        "text": one.text,
        "set": [bit for bit in range(one.bits) if one.number >> bit & 1],
        "names": names,
    }


def _bit_names(flags: type[IntFlag | STW1 | ZSW1]) -> Iterator[tuple[int, str]]:
    """Yield bit and name of the members that are a single bit; the first name of each."""
    seen: set[int] = set()
    for member in flags:
        value = int(member)
        bit = value.bit_length() - 1
        if value and value & (value - 1) == 0 and bit not in seen:
            seen.add(bit)
            yield bit, str(member.name).lower().replace("_", " ")


def _described(entry: Entry) -> JsonObject:
    default = entry.default
    access = f"{'r' if entry.readable else ''}{'w' if entry.writable else ''}"
    low, high = entry.low, entry.high
    if entry.integer and entry.writable:
        low, high = _limits(entry)
    return {
        "index": entry.index,
        "sub": entry.sub,
        "object": f"{entry.index:04X}h:{entry.sub:02X}h",
        "name": entry.name,
        "type": _TYPES.get(entry.data_type, f"type {entry.data_type:02X}h"),
        "access": access or "none",
        "default": default.hex(" ").upper() if isinstance(default, bytes) else default,
        "low": low,
        "high": high,
    }


def _limits(entry: Entry) -> tuple[float, float]:
    low, high = (0, 1) if entry.data_type == BOOLEAN else entry.type_range
    return (low if entry.low is None else entry.low), (high if entry.high is None else entry.high)


def _integer(entry: Entry, where: str, text: str) -> int:
    low, high = _limits(entry)
    allowed = f"a whole number {low:.0f} to {high:.0f}, or as 0x1F or 1Fh"
    plain = text.strip().replace("_", "")
    try:
        number = int(plain[:-1], 16) if plain[-1:] in ("h", "H") else int(plain, 0)
    except ValueError:
        raise ConfigurationError(where, text, allowed) from None
    if not low <= number <= high:
        raise ConfigurationError(where, text, allowed)
    return number


def _number(entry: Entry, where: str, text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    low = -math.inf if entry.low is None else entry.low
    high = math.inf if entry.high is None else entry.high
    if not (math.isfinite(number) and low <= number <= high):
        raise ConfigurationError(where, text, f"a number {low:g} to {high:g}")
    return number
