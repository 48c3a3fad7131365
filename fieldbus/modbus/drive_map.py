"""A drive with a register map: process data words, parameters, the DS47 channel and
the mailbox (PD-286 to PD-337).
"""

from __future__ import annotations

from collections.abc import Sequence
from struct import Struct
from typing import Final, Protocol

from fieldbus.clock import Scheduler
from fieldbus.errors import ConfigurationError
from fieldbus.modbus.codes import ExceptionCode
from fieldbus.modbus.map_file import BlockFile, MapFile
from fieldbus.modbus.registers import Area, Block, NoAnswer, RegisterMap, RegisterRefusal, WordOrder
from fieldbus.profidrive import Telegram
from fieldbus.profidrive.errors import ParameterAccessError
from fieldbus.profidrive.requests import (
    Address,
    Refusal,
    Request,
    RequestId,
    Values,
    decode_answer,
    pack_values,
    size_of,
    unpack_values,
)

_MAILBOX_READ, _MAILBOX_WRITE, _MAILBOX_ERROR, _MAILBOX_DONE = 0x01, 0x02, 0x03, 0x10
_MAILBOX_ORDER, _MAILBOX_LENGTH, _MAILBOX_DATA = 3, 4, 10
_INTERNAL: Final = 0xFF
"""Error code of a parameter access whose answer is not understood."""


class ProcessDataDevice(Protocol):
    """What a drive is to a bus that carries its telegram in words."""

    def receive(self, frame: bytes) -> None:
        """Take a telegram of the controller, words with the high byte first."""

    def transmit(self) -> bytes | None:
        """Return the telegram to the controller with the values of now; None: the request stays
        unanswered.
        """

    def accessed(self) -> None:
        """Take note that a register was read or written which keeps the process
        data from timing out (PD-292).
        """

    def request(self, data: bytes) -> bytes:
        """Answer a request of base mode parameter access (PD-199 to PD-230)."""


class RegisterChannel(Protocol):
    """A parameter channel in registers: data record 47 (PD-326)."""

    @property
    def first(self) -> int:
        """Number of its first register."""

    def write(self, first: int, values: Sequence[int], now_ns: int) -> bool:
        """Take registers; return False, without effect, while it is busy."""

    def read(self, first: int, count: int, now_ns: int) -> list[int]:
        """Return registers."""


class DriveMap:
    """The registers of a drive.

    Args:
        scheduler: Time.
        device: The drive.
        file: Which registers there are.
        telegram: The telegram of the drive. What is written after its words is only stored; what is read
            there is 0.
        channel: The parameter channel; needed when the file has the hook `ds47`.
        watch_all: Whether every process data register keeps the time-out off, as over TCP, or the number
            in the file.
        drive_object: DO-ID of the parameters that registers and mailbox reach.

    Raises:
        ConfigurationError: The file has a parameter channel and the drive none, or not enough process
            data registers.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        device: ProcessDataDevice,
        file: MapFile,
        *,
        telegram: Telegram,
        channel: RegisterChannel | None = None,
        watch_all: bool = False,
        drive_object: int = 1,
    ) -> None:
        self._scheduler = scheduler
        self._device = device
        self._channel = channel
        self._watched = file.watched
        self._drive_object = drive_object
        self._low_first = low_first = file.word_order == "low_first"
        self._places = tuple(
            layout.places(low_word_first=low_first) for layout in (telegram.setpoint, telegram.actual)
        )
        self._frames = (Struct(f">{telegram.setpoint.words}H"), Struct(f">{telegram.actual.words}H"))
        self._reference = 0
        self.watch_all = watch_all
        """Whether every process data register keeps the time-out off."""
        self.error_code = 0
        """Of the last failed access to a parameter by register (PD-323)."""
        self.registers = RegisterMap(
            file.name,
            word_order=WordOrder(file.word_order),
            partial_writes=file.partial_writes,
        )
        makers = {
            "setpoints": self._setpoints,
            "actual_values": self._actual_values,
            "ds47": self._ds47,
            "mailbox": self._mailbox,
            "error_code": self._error_code,
        }
        for entry in file.block:
            block = Block(
                entry.register_ - file.first,
                entry.count,
                name=entry.hook or f"register {entry.register_}",
                writable=entry.writable,
            )
            if entry.words == 1:  # of a long value its hook knows the limits
                block.minimum, block.maximum = _limits(entry)
            if entry.hook is not None:
                makers[entry.hook](block)
            elif entry.parameter is not None:
                self._parameter(block, entry)
            self.registers.add(Area.HOLDING_REGISTERS, block)

    def restart(self) -> None:
        """Forget what clients have written, as after power-on."""
        self.error_code = 0
        for block in self.registers.blocks(Area.HOLDING_REGISTERS):
            block.values[:] = [0] * block.count

    # ------------------------------------------------------------------------------------------- process data

    def _bytes(self, words: Sequence[int]) -> bytes:
        order = "little" if self._low_first else "big"
        return b"".join(word.to_bytes(2, order) for word in words)  # type: ignore[arg-type]

    def _words(self, data: bytes) -> list[int]:
        order = "little" if self._low_first else "big"
        data += bytes(len(data) % 2)
        return [int.from_bytes(data[at : at + 2], order) for at in range(0, len(data), 2)]  # type: ignore[arg-type]

    def _setpoints(self, block: Block) -> None:
        places, to_frame = self._places[0], self._frames[0]
        if len(places) > block.count:
            raise ConfigurationError(
                "telegram, setpoints",
                f"{len(places)} words",
                f"at most {block.count} in {self.registers.name}",
            )

        def write(offset: int, values: Sequence[int]) -> None:
            self._seen(offset)
            image = [*block.values[:offset], *values, *block.values[offset + len(values) :]]
            self._device.receive(to_frame.pack(*[image[place] for place in places]))

        def read(offset: int, count: int) -> Sequence[int]:
            self._seen(offset)
            return block.values[offset : offset + count]

        block.write, block.read = write, read

    def _actual_values(self, block: Block) -> None:
        places, from_frame = self._places[1], self._frames[1]
        if len(places) > block.count:
            raise ConfigurationError(
                "telegram, actual values",
                f"{len(places)} words",
                f"at most {block.count} in {self.registers.name}",
            )
        rest = (0,) * (block.count - len(places))

        def read(offset: int, count: int) -> Sequence[int]:
            self._seen(offset)
            frame = self._device.transmit()
            if frame is None:
                raise NoAnswer
            found = from_frame.unpack(frame)
            return (*[found[place] for place in places], *rest)[offset : offset + count]

        block.read = read
        block.writable = False

    def _seen(self, offset: int) -> None:
        if self.watch_all or self._watched is None or offset < self._watched:
            self._device.accessed()

    # --------------------------------------------------------------------------------------------- parameters

    def _ask(
        self, service: int, address: Address, values: tuple[Values, ...] = ()
    ) -> Values | Refusal | None:
        self._reference = self._reference % 0xFF + 1
        request = Request(self._reference, service, self._drive_object, (address,), values)
        try:
            results = decode_answer(self._device.request(request.encode())).results
        except ParameterAccessError:
            return Refusal(_INTERNAL)
        return results[0] if len(results) == 1 else Refusal(_INTERNAL)

    def _value(self, address: Address) -> Values:
        found = self._ask(RequestId.READ, address)
        if isinstance(found, Values) and found.values:
            return found
        self.error_code = found.error if isinstance(found, Refusal) else _INTERNAL
        raise RegisterRefusal(ExceptionCode.SERVER_DEVICE_FAILURE)

    def _store(self, address: Address, values: Values) -> None:
        refused = self._ask(RequestId.WRITE, address, (values,))
        if isinstance(refused, Refusal):
            self.error_code = refused.error
            raise RegisterRefusal(ExceptionCode.SERVER_DEVICE_FAILURE)

    def _parameter(self, block: Block, entry: BlockFile) -> None:
        number = entry.parameter or 0
        size = entry.words
        low, high = value_range(entry)
        lowest, highest = _limits(entry)
        high_first = self.registers.word_order is WordOrder.HIGH_FIRST

        def address(place: int) -> Address:
            return Address(
                number, entry.sub_index + place, 1
            )  # one element: also right for what is no array (PD-208)

        def shown(place: int) -> int:
            """Return what the registers of a place show, saturated (PD-294)."""
            value = self._value(address(place)).values[0]
            if isinstance(value, bytes) or value != value:  # noqa: PLR0124 - not a number
                self.error_code = _INTERNAL
                raise RegisterRefusal
            return round(min(max(value * entry.scale, low), high))

        def words(value: int) -> tuple[int, ...]:
            if size == 1:
                return (value & 0xFFFF,)
            halves = (value >> 16 & 0xFFFF, value & 0xFFFF)
            return halves if high_first else halves[::-1]

        def read(offset: int, count: int) -> Sequence[int]:
            first = offset // size
            found = [
                word for place in range(first, -(-(offset + count) // size)) for word in words(shown(place))
            ]
            return found[offset - first * size :][:count]

        def store(place: int, raw: int) -> None:
            if entry.signed and raw >> 16 * size - 1:
                raw -= 1 << 16 * size
            if not lowest <= raw <= highest:
                raise RegisterRefusal
            present = self._value(address(place))  # has the format
            value = raw / entry.scale
            kept = value if isinstance(present.values[0], float) else round(value)
            self._store(address(place), Values(present.code, (kept,)))

        def write(offset: int, values: Sequence[int]) -> None:
            at = offset
            while at < offset + len(values):
                place, half = divmod(at, size)
                new = list(values[at - offset : at - offset + size - half])
                if len(new) < size:  # half of a long value: the other half stays
                    image = list(words(shown(place)))
                    image[half : half + len(new)] = new
                else:
                    image = new
                ordered = image if high_first else image[::-1]
                store(place, ordered[0] if size == 1 else ordered[0] << 16 | ordered[1])
                at += len(new)

        bit = entry.bit
        if bit is None:
            block.read, block.write = read, write
            return

        def read_bits(offset: int, count: int) -> Sequence[int]:
            value = int(self._value(Address(number, 0, 1)).values[0]) >> bit + offset
            return [value >> place & 1 for place in range(count)]

        block.read = read_bits
        block.writable = False

    def _error_code(self, block: Block) -> None:
        block.read = lambda _offset, _count: [self.error_code]
        block.writable = False

    # ------------------------------------------------------------------------------------------ DS47 (PD-326)

    def _ds47(self, block: Block) -> None:
        channel = self._channel
        if channel is None:
            raise ConfigurationError("register map", "hook ds47", "a drive with a parameter channel")
        scheduler = self._scheduler
        first = channel.first

        def write(offset: int, values: Sequence[int]) -> None:
            if not channel.write(first + offset, values, scheduler.now):
                raise RegisterRefusal  # a request is being carried out

        def read(offset: int, count: int) -> Sequence[int]:
            return channel.read(first + offset, count, scheduler.now)

        block.read, block.write = read, write

    # ------------------------------------------------------------------------------------------------ mailbox

    def _mailbox(self, block: Block) -> None:
        state: dict[str, int] = {}

        def write(offset: int, values: Sequence[int]) -> None:
            if offset <= _MAILBOX_LENGTH < offset + len(values):
                state.pop("length", None)
            if not offset <= _MAILBOX_ORDER < offset + len(values):
                return
            image = [*block.values[:offset], *values, *block.values[offset + len(values) :]]
            order = image[_MAILBOX_ORDER]
            try:
                length = self._carry_out(order, image, block)
            except RegisterRefusal:
                length = None
            # The map stores what was written after this; the state is shown when it is read.
            state["now"] = _MAILBOX_ERROR if length is None else _MAILBOX_DONE
            if length is not None and order == _MAILBOX_READ:
                state["length"] = length

        def read(offset: int, count: int) -> Sequence[int]:
            words = list(block.values)
            words[_MAILBOX_ORDER] = state.get("now", words[_MAILBOX_ORDER])
            if "length" in state:
                words[_MAILBOX_LENGTH] = state["length"]
            return words[offset : offset + count]

        block.read, block.write = read, write

    def _carry_out(self, order: int, image: list[int], block: Block) -> int:
        """Carry out the order in the mailbox; return the length of what was read, in bytes."""
        elements = max(1, image[2])
        if elements > 0xFF:
            raise RegisterRefusal
        address = Address(image[0], image[1], elements)
        if order not in (_MAILBOX_READ, _MAILBOX_WRITE):
            raise RegisterRefusal
        present = self._value(address)
        size = size_of(present.code) or 1
        space = 2 * (block.count - _MAILBOX_DATA)
        if order == _MAILBOX_READ:
            data = b"".join(pack_values(present.code, (value,))[::-1] for value in present.values)
            if len(data) > space:
                raise RegisterRefusal
            words = self._words(data)
            block.values[_MAILBOX_DATA : _MAILBOX_DATA + len(words)] = words
            return len(data)
        data = self._bytes(image[_MAILBOX_DATA:])[: image[_MAILBOX_LENGTH]]
        if not data or len(data) != size * len(present.values):
            raise RegisterRefusal
        parts = tuple(
            unpack_values(present.code, data[at : at + size][::-1])[0] for at in range(0, len(data), size)
        )
        self._store(address, Values(present.code, parts))
        return 0


def value_range(entry: BlockFile) -> tuple[int, int]:
    """Return the lowest and highest number that the registers of a value can show."""
    bits = 16 * entry.words
    return (-(1 << bits - 1), (1 << bits - 1) - 1) if entry.signed else (0, (1 << bits) - 1)


def _limits(entry: BlockFile) -> tuple[int, int]:
    low, high = value_range(entry)
    return (
        low if entry.minimum is None else entry.minimum,
        high if entry.maximum is None else entry.maximum,
    )
