"""CAN frames of a CANopen segment as text, by the PDO mappings in effect (C301-164)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Final, NamedTuple

from fieldbus import cia406
from fieldbus.can.frame import CanFrame
from fieldbus.canopen.abort import SdoAbort
from fieldbus.canopen.decode_sdo import SdoListener
from fieldbus.canopen.dictionary import INTEGERS, Entry, ObjectValue, readable_entries
from fieldbus.canopen.nmt import (
    COB_EMCY,
    COB_ERROR_CONTROL,
    COB_NMT,
    COB_RPDO,
    COB_SDO_CLIENT,
    COB_SDO_SERVER,
    COB_SYNC,
    COB_TPDO,
    NmtCommand,
    NmtState,
)
from fieldbus.canopen.store import SAVE
from fieldbus.cia402 import MODE_NAMES, OBJECT_NAMES, describe_controlword, describe_statusword, emcy_text

if TYPE_CHECKING:
    import canopen

_COMMANDS: Final = {
    NmtCommand.START: "start",
    NmtCommand.STOP: "stop",
    NmtCommand.ENTER_PRE_OPERATIONAL: "enter pre-operational",
    NmtCommand.RESET_NODE: "reset",
    NmtCommand.RESET_COMMUNICATION: "reset communication",
}
_STATES: Final = {
    NmtState.INITIALISING: "boot-up",
    NmtState.STOPPED: "Stopped",
    NmtState.OPERATIONAL: "Operational",
    NmtState.PRE_OPERATIONAL: "Pre-operational",
}
_HEXADECIMAL: Final = frozenset(
    (0x1001, 0x1002, 0x603F, 0x6040, 0x6041, 0x60B8, 0x60B9, 0x60FD, 0x60FE, 0x6502, 0x60A9)
)


class PdoField(NamedTuple):
    """An object in a PDO."""

    object_index: int
    sub: int
    first_bit: int
    """Counted from bit 0 of the first byte."""
    bits: int
    name: str
    number: int
    """Its bits as an unsigned number."""
    text: str
    """Its value in words."""


class FrameDecoder:
    """Turns frames into words.

    The mapping in effect is that of the dictionaries until SDO writes that the decoder has seen change it:
    give it all frames in order, with `observe` for those whose text is not needed.

    Args:
        names: Node-ID -> name; other nodes are called "node 5".
        dictionaries: Node-ID -> object dictionary, for object names, types and default mappings.

    """

    def __init__(
        self,
        names: Mapping[int, str] | None = None,
        dictionaries: Mapping[int, canopen.ObjectDictionary] | None = None,
    ) -> None:
        self._names = dict(names or {})
        self._dictionaries = dict(dictionaries or {})
        self._nodes: dict[int, _Node] = {}
        self._pdos: dict[int, tuple[_Node, str, list[int]]] = {}
        self._lengths: dict[int, int] = {}
        self._fields: dict[int, tuple[int, int, tuple[_Field, ...]]] = {}
        """Identifier of a PDO -> node-ID, bits, and what is where."""
        self._emcy: dict[int, _Node] = {}
        self._sync = COB_SYNC
        for node_id in sorted({*self._names, *self._dictionaries}):
            self._node(node_id)
        self._index()

    def name(self, node_id: int) -> str:
        """Return the name of a node."""
        return self._names.get(node_id, f"node {node_id}")

    def set_mapping(
        self, node_id: int, values: Mapping[tuple[int, int], int], *, stored: bool = True
    ) -> None:
        """Give values of communication objects that the decoder has not seen being written.

        Args:
            node_id: The node.
            values: (index, sub-index) -> value of 1005h, 1014h, 1400h to 1BFFh; others do no harm.
            stored: The node has them in its memory: they are in effect after a boot-up too.

        """
        self._node(node_id).take(
            {index << 8 | sub: value for (index, sub), value in values.items()}, stored=stored
        )
        self._index()

    def set_words(
        self, node_id: int, first_index: int, count: int, describe: Callable[[int, Sequence[int]], list[str]]
    ) -> None:
        """Say what is in free process data words: consecutive objects of 16 bits, sub-index 0.

        Args:
            node_id: The node.
            first_index: Object of the first word.
            count: Number of words.
            describe: Gets the number of the first word of a run (from 0) and the words; returns their texts.

        """
        self._node(node_id).words.append((first_index, count, describe))

    def observe(self, frame: CanFrame) -> None:
        """Learn from a frame without describing it; quick for frames that teach nothing."""
        if frame.fd:
            return
        service = frame.can_id & 0x780
        if service in (COB_SDO_CLIENT, COB_SDO_SERVER) or (
            service == COB_ERROR_CONTROL and frame.data == b"\0"
        ):
            self.decode(frame)

    def mapped(self, frame: CanFrame) -> tuple[int, list[tuple[int, int]]] | None:
        """Return node-ID and values of a PDO by the mapping in effect: pairs of
        index << 8 | sub-index and number.

        Signed where the dictionary says so; what a short frame does not hold is left out. None: the frame is
        no PDO.
        """
        if frame.remote or frame.extended or frame.fd:
            return None
        fields = self._fields.get(frame.can_id)
        if fields is None:
            return None
        node_id, bits, places = fields
        word, length = int.from_bytes(frame.data, "little"), 8 * len(frame.data)
        found = []
        for key, offset, mask, sign, end in places:
            if end > length and bits > length:
                break
            number = word >> offset & mask
            if number & sign:
                number -= mask + 1
            found.append((key, number))
        return node_id, found

    def fields(self, frame: CanFrame) -> list[PdoField]:
        """Return what is where in a PDO by the mapping in effect, as far as it is long; empty: it is none."""
        pdo = None if frame.remote or frame.extended else self._pdos.get(frame.can_id)
        if pdo is None:
            return []
        node, _, mapping = pdo
        word, offset, found = int.from_bytes(frame.data, "little"), 0, []
        for raw in mapping:
            index, sub, bits = raw >> 16, raw >> 8 & 0xFF, raw & 0xFF
            if offset + bits > 8 * len(frame.data):
                break
            number = word >> offset & (1 << bits) - 1
            # A free word of process data says by itself what it holds.
            texts = node.describe_words([raw], number, bits)
            data = number.to_bytes((bits + 7) // 8, "little")
            name = texts[0].partition(" = ")[0] if texts else node.object_name(index, sub)
            text = texts[0].partition(" = ")[2] if texts else node.value_text(index, sub, data)
            if index >= 0x1000:
                found.append(PdoField(index, sub, offset, bits, name, number, text))
            offset += bits
        return found

    def value_text(self, node_id: int, index: int, sub: int, data: bytes) -> str:
        """Return the content of an entry of a node in words, as far as its meaning is known."""
        return self._node(node_id).value_text(index, sub, data)

    def mapped_length(self, can_id: int) -> int:
        """Return how many bytes a PDO has by the mapping in effect; 0 for what is none."""
        return self._lengths.get(can_id, 0)

    def mapping_seen(self, can_id: int) -> bool:
        """Return whether the mapping of a PDO was written in what the decoder has seen since the boot-up."""
        pdo = self._pdos.get(can_id)
        return pdo is not None and pdo[0].mapping_seen(pdo[1])

    def emcy_node(self, can_id: int) -> int:
        """Return the node-ID to which the identifier of an EMCY belongs; 0 when it is none."""
        node = self._emcy.get(can_id)
        if node is not None:
            return node.node_id
        return can_id - COB_EMCY if COB_EMCY < can_id < COB_EMCY + 0x80 and can_id != self._sync else 0

    @property
    def sync_id(self) -> int:
        """Identifier of SYNC."""
        return self._sync

    @property
    def pdo_ids(self) -> dict[int, int]:
        """Identifiers of PDOs in effect, with the node-ID that each belongs to."""
        return {can_id: node.node_id for can_id, (node, _, _) in self._pdos.items()}

    def decode(self, frame: CanFrame) -> str:
        """Describe a frame, and learn from it; frames of no known service are given in hexadecimal."""
        if frame.extended or frame.fd:  # CANopen has classical frames with 11-bit identifiers
            return repr(frame)
        can_id, data = frame.can_id, frame.data
        if frame.remote:
            return self._remote(can_id)
        if can_id == COB_NMT:
            return self._nmt(data)
        if can_id == self._sync:
            return f"SYNC {data[0]}" if data else "SYNC"
        pdo = self._pdos.get(can_id)
        if pdo is not None:
            return self._pdo(*pdo, data)
        if can_id in self._emcy or COB_EMCY < can_id < COB_EMCY + 0x80:
            return self._emergency(can_id, data)
        service, node_id = can_id & 0x780, can_id & 0x7F
        if service == COB_ERROR_CONTROL and node_id:
            return self._error_control(node_id, data)
        if service in (COB_SDO_CLIENT, COB_SDO_SERVER) and node_id:
            return self._sdo(node_id, data, request=service == COB_SDO_CLIENT)
        if can_id == 0x100:
            return "TIME"
        return repr(frame)

    # -- services
    # ---------------------------------------------------------------------------------------------

    def _nmt(self, data: bytes) -> str:
        if len(data) != 2:
            return f"NMT malformed {data.hex(' ').upper()}"
        command = _COMMANDS.get(data[0], f"command {data[0]:02X}h")  # type: ignore[call-overload]  # plain int key
        return f"NMT {command} all nodes" if data[1] == 0 else f"NMT {command} {_numbered(data[1])}"

    def _emergency(self, can_id: int, data: bytes) -> str:
        node = self._emcy.get(can_id)
        name = self.name(can_id - COB_EMCY) if node is None else node.name
        if len(data) != 8:
            return f"EMCY {name} malformed {data.hex(' ').upper()}"
        code = int.from_bytes(data[:2], "little")
        text = f"EMCY {name} {code:04X}h {emcy_text(code)}, register {data[2]:02X}h"
        return f"{text}, data {data[3:].hex(' ').upper()}" if any(data[3:]) else text

    def _error_control(self, node_id: int, data: bytes) -> str:
        name = self.name(node_id)
        if len(data) != 1:
            return f"error control {name} malformed {data.hex(' ').upper()}"
        state = data[0] & 0x7F
        if data[0] == 0:
            node = self._nodes.get(node_id)
            if node is not None:
                node.reset()
                self._index()
            return f"boot-up {name}"
        word = _STATES.get(state, f"state {state}")  # type: ignore[call-overload]  # plain int key
        return f"heartbeat {name} {word}" + (", toggle" if data[0] & 0x80 else "")

    def _remote(self, can_id: int) -> str:
        if can_id & 0x780 == COB_ERROR_CONTROL:
            return f"guarding request {self.name(can_id & 0x7F)}"
        pdo = self._pdos.get(can_id)
        if pdo is not None:
            return f"request for {pdo[1]} {pdo[0].name}"
        return f"remote frame {can_id:03X}h"

    def _pdo(self, node: _Node, title: str, mapping: list[int], data: bytes) -> str:
        parts: list[str] = []
        word, offset = int.from_bytes(data, "little"), 0
        if node.words:
            described = node.describe_words(mapping, word, 8 * len(data))
            if described:
                return f"{title} {node.name}: {', '.join(described)}"
        for raw in mapping:
            index, sub, bits = raw >> 16, raw >> 8 & 0xFF, raw & 0xFF
            if offset + bits > 8 * len(data):
                parts.append("too short")
                break
            number = word >> offset & (1 << bits) - 1
            offset += bits
            if index >= 0x1000:
                parts.append(node.describe(index, sub, number.to_bytes((bits + 7) // 8, "little")))
        if 8 * len(data) > offset:
            rest = data[(offset + 7) // 8 :]
            plural = "" if len(rest) == 1 else "s"
            parts.append(f"{len(rest)} byte{plural} more" if mapping else rest.hex(" ").upper())
        return f"{title} {node.name}: {', '.join(parts)}" if parts else f"{title} {node.name}"

    def _sdo(self, node_id: int, data: bytes, *, request: bool) -> str:
        node = self._node(node_id)
        text, written = node.sdo.decode(data, request=request)
        if written is not None:
            node.learn(*written)
            if 0x1400 <= written[0] < 0x1C00 or written[0] in (0x1005, 0x1014):
                self._index()
        return f"SDO {node.name} {text}"

    # -- what is known
    # ----------------------------------------------------------------------------------------

    def _node(self, node_id: int) -> _Node:
        node = self._nodes.get(node_id)
        if node is None:
            node = self._nodes[node_id] = _Node(node_id, self.name(node_id), self._dictionaries.get(node_id))
            self._index()
        return node

    def _index(self) -> None:
        """Make the tables of identifiers from the values of all nodes."""
        self._pdos.clear()
        self._lengths.clear()
        self._fields.clear()
        self._emcy.clear()
        for node in self._nodes.values():
            emcy = node.values.get(0x101400, COB_EMCY + node.node_id)
            if not emcy >> 31:
                self._emcy[emcy & 0x7FF] = node
            self._sync = node.values.get(0x100500, self._sync) & 0x7FF or COB_SYNC
            for base in node.pdo_records():
                key = base << 8
                cob_id = node.values.get(key | 1)
                if cob_id is None or cob_id >> 31 or not cob_id & 0x7FF:
                    continue
                title = f"{'RPDO' if base < 0x1800 else 'TPDO'}{(base & 0x1FF) + 1}"
                mapping_key = (base + 0x200) << 8
                count = min(node.values.get(mapping_key, 0), 64)
                mapping = [node.values.get(mapping_key | sub, 0) for sub in range(1, count + 1)]
                self._pdos[cob_id & 0x7FF] = (node, title, mapping)
                bits = sum(raw & 0xFF for raw in mapping)
                self._lengths[cob_id & 0x7FF] = (bits + 7) // 8
                self._fields[cob_id & 0x7FF] = node.node_id, bits, tuple(_fields(node.entries, mapping))


_Field = tuple[int, int, int, int, int]
"""Key, first bit, mask, bit of the sign (0: it has none), first bit behind it."""


def _fields(entries: Mapping[int, Entry], mapping: Sequence[int]) -> Iterator[_Field]:
    offset = 0
    for raw in mapping:
        bits = raw & 0xFF
        entry = entries.get(raw >> 8)
        signed = entry is not None and entry.integer and entry.signed and bits > 0
        yield raw >> 8, offset, (1 << bits) - 1, 1 << bits - 1 if signed else 0, offset + bits
        offset += bits


class _Node:
    """What the decoder knows of one node."""

    def __init__(self, node_id: int, name: str, dictionary: canopen.ObjectDictionary | None) -> None:
        self.node_id = node_id
        self.name = name
        self.entries: dict[int, Entry] = {} if dictionary is None else readable_entries(dictionary, node_id)
        self._defaults: dict[int, ObjectValue] = {
            key: entry.default
            for key, entry in self.entries.items()
            if entry.index < 0x2000 and entry.integer
        }
        if dictionary is None:
            for number in range(4):
                self._defaults[0x1400 + number << 8 | 1] = COB_RPDO[number] + node_id
                self._defaults[0x1800 + number << 8 | 1] = COB_TPDO[number] + node_id
        device_type = self._defaults.get(0x100000, 0)
        self._encoder = device_type & 0xFFFF == cia406.PROFILE
        self._stored: dict[int, ObjectValue] = {}
        self.values: dict[int, ObjectValue] = dict(self._defaults)
        self.words: list[tuple[int, int, Callable[[int, Sequence[int]], list[str]]]] = []
        """Free process data words: first index, count, description."""
        self.sdo = SdoListener(self)
        self._written: set[int] = set()
        """Mapping records that were written since the boot-up."""

    def mapping_seen(self, title: str) -> bool:
        """Return whether the mapping of RPDO or TPDO `title` was written since the boot-up."""
        return (0x1600 if title[0] == "R" else 0x1A00) + int(title[4:]) - 1 in self._written

    def describe_words(self, mapping: Sequence[int], content: int, bits: int) -> list[str]:
        """Return the signals of a PDO that holds consecutive free words and
        nothing else; empty when it does not.
        """
        for first_index, count, describe in self.words:
            begin = (mapping[0] >> 16) - first_index if mapping else -1
            wanted = [first_index + begin + number << 16 | 0x10 for number in range(len(mapping))]
            fits = begin >= 0 and begin + len(mapping) <= count
            if fits and list(mapping) == wanted and 16 * len(mapping) == bits:
                return describe(begin, [content >> 16 * number & 0xFFFF for number in range(len(mapping))])
        return []

    def pdo_records(self) -> list[int]:
        """Return the indices of the communication records with a known identifier."""
        return [
            key >> 8
            for key in self.values
            if key & 0xFF == 1 and 0x14 <= key >> 16 <= 0x1B and not key >> 17 & 1
        ]

    def take(self, values: Mapping[int, int], *, stored: bool) -> None:
        """Take known values."""
        self.values.update(values)
        if stored:
            self._stored.update(values)

    def learn(self, index: int, sub: int, data: bytes) -> None:
        """Take a successful write."""
        if index >= 0x2000:
            return
        if 0x1600 <= index < 0x1800 or index >= 0x1A00:
            self._written.add(index)
        value = int.from_bytes(data, "little")
        if index == 0x1010:
            if value == SAVE and sub in (1, 2):
                self._stored = {
                    key: held for key, held in self.values.items() if key >> 8 not in (0x1010, 0x1011)
                }
        elif index == 0x1011:
            self._stored = {}
        else:
            self.values[index << 8 | sub] = value

    def reset(self) -> None:
        """Take stored or default values, as the node does before its boot-up."""
        self.values = self._defaults | self._stored
        self._written.clear()
        self.sdo.reset()

    def describe(self, index: int, sub: int, data: bytes) -> str:
        """Return name and value of an object."""
        return f"{self.object_name(index, sub)} {self.value_text(index, sub, data)}"

    def object_name(self, index: int, sub: int) -> str:
        """Return the name of an object, its numbers if there is none."""
        entry = self.entries.get(index << 8 | sub)
        # An encoder has objects of its own under numbers that mean something else in a drive.
        name = (cia406.OBJECT_NAMES if self._encoder and index >= 0x6000 else OBJECT_NAMES).get(index)
        if name is not None:
            return f"{name}:{sub}" if sub else name
        if entry is not None:
            return entry.name
        return f"{index:04X}h:{sub}" if sub else f"{index:04X}h"

    def value_text(self, index: int, sub: int, data: bytes) -> str:
        """Return a value in words as far as its meaning is known."""
        entry = self.entries.get(index << 8 | sub)
        unsigned = int.from_bytes(data, "little")
        if self._encoder and index >= 0x6000:
            if index in cia406.HEXADECIMAL:
                words = cia406.describe_flags(index, unsigned)
                return f"{unsigned:0{2 * len(data)}X}h" + (f" ({words})" if words else "")
            return self._plain(entry, unsigned, data)
        if index == 0x6040 and len(data) == 2:
            return f"{unsigned:04X}h ({describe_controlword(unsigned)})"
        if index == 0x6041 and len(data) == 2:
            return f"{unsigned:04X}h ({describe_statusword(unsigned)})"
        if index in (0x6060, 0x6061) and unsigned in MODE_NAMES:
            return f"{unsigned} ({MODE_NAMES[unsigned]})"
        if index in (0x1010, 0x1011) and len(data) == 4:
            return repr(data.decode("ascii", errors="replace"))
        if index in _HEXADECIMAL or 0x1400 <= index < 0x1C00 or index in (0x1005, 0x1014, 0x1016):
            return f"{unsigned:0{2 * len(data)}X}h"
        return self._plain(entry, unsigned, data)

    @staticmethod
    def _plain(entry: Entry | None, unsigned: int, data: bytes) -> str:
        """Return a value without special meaning, by its type."""
        if entry is None:
            return f"{unsigned:0{2 * len(data)}X}h" if data else "empty"
        if entry.integer and len(data) == entry.size:
            low = INTEGERS[entry.data_type][0]
            return str(unsigned - (1 << low) if entry.signed and unsigned >> (low - 1) else unsigned)
        try:
            value = entry.decode(data)
        except SdoAbort:
            return data.hex(" ").upper()
        return value.hex(" ").upper() if isinstance(value, bytes) else f"{value!r}"


def _numbered(node_id: int) -> str:
    return f"node {node_id}"
