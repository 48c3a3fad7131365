"""A drive behind a register map: process data words, parameters, the DS47 channel and the mailbox (PD-286 to PD-337)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final, Protocol

from fieldbus.clock import MS, Scheduler
from fieldbus.modbus.codes import ExceptionCode
from fieldbus.modbus.map_file import BlockFile, MapFile
from fieldbus.modbus.registers import Area, Block, RegisterMap, RegisterRefusal, WordOrder
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

_DS47: Final = 0x2F
_LONGEST_DS47: Final = 240
_WRITTEN, _STARTED, _READY = 0, 1, 2
_WRONG_LENGTH, _WRONG_FUNCTION, _NOT_READY = 1, 3, 4
_MAILBOX_READ, _MAILBOX_WRITE, _MAILBOX_ERROR, _MAILBOX_DONE = 0x01, 0x02, 0x03, 0x10
_MAILBOX_ORDER, _MAILBOX_LENGTH, _MAILBOX_DATA = 3, 4, 10
_INTERNAL: Final = 0xFF
"""Error code of a parameter access whose answer nobody understands."""


class ProcessDataDevice(Protocol):
    """What a drive is to a bus that carries its telegram in words."""

    def receive(self, frame: bytes) -> None:
        """Take a telegram of the controller, words with the high byte first."""

    def transmit(self) -> bytes:
        """Return the telegram to the controller with the values of now."""

    def request(self, data: bytes) -> bytes:
        """Answer a request of base mode parameter access (PD-199 to PD-230)."""


class DriveMap:
    """The registers of a drive.

    Args:
        scheduler: Time.
        device: The drive.
        file: Which registers there are.
        telegram_bytes: Length of the telegram from the controller; what is written behind it is only stored.
        on_timeout: Called when process data stays out for `timeout_ms` (F01910, PD-292), once until it comes again.
        processing_ns: Until a request of DS47 is answered, ns.
        watch_all: Whether every process data register counts for the time-out, as over TCP, or the number in the file.
        drive_object: DO-ID of the parameters that registers and mailbox reach.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        device: ProcessDataDevice,
        file: MapFile,
        *,
        telegram_bytes: int,
        on_timeout: Callable[[], object] | None = None,
        processing_ns: int = 10 * MS,
        watch_all: bool = False,
        drive_object: int = 1,
    ) -> None:
        self._scheduler = scheduler
        self._device = device
        self._telegram_bytes = telegram_bytes
        self._on_timeout = on_timeout
        self._processing_ns = processing_ns
        self._watched = None if watch_all else file.watched
        self._drive_object = drive_object
        self._low_first = file.byte_order == "low_first"
        self._reference = 0
        self._accessed_ns = 0
        self._watching = False
        self.timeout_ms = file.timeout_ms
        """Time-out of the process data, ms; 0 = off."""
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
            "timeout": self._timeout,
            "error_code": self._error_code,
        }
        for entry in file.block:
            low = entry.minimum if entry.minimum is not None else -0x8000 if entry.signed else 0
            high = entry.maximum if entry.maximum is not None else 0x7FFF if entry.signed else 0xFFFF
            block = Block(
                entry.register_ - file.first, entry.count,
                name=entry.hook or f"register {entry.register_}", writable=entry.writable, minimum=low, maximum=high,
            )  # fmt: skip
            if entry.hook is not None:
                makers[entry.hook](block)
            elif entry.parameter is not None:
                self._parameter(block, entry)
            self.registers.add(Area.HOLDING_REGISTERS, block)

    # -------------------------------------------------------------------------------------------------- process data

    def _bytes(self, words: Sequence[int]) -> bytes:
        order = "little" if self._low_first else "big"
        return b"".join(word.to_bytes(2, order) for word in words)  # type: ignore[arg-type]

    def _words(self, data: bytes) -> list[int]:
        order = "little" if self._low_first else "big"
        data += bytes(len(data) % 2)
        return [int.from_bytes(data[at : at + 2], order) for at in range(0, len(data), 2)]  # type: ignore[arg-type]

    def _setpoints(self, block: Block) -> None:
        def write(offset: int, values: Sequence[int]) -> None:
            self._seen(offset)
            image = [*block.values[:offset], *values, *block.values[offset + len(values) :]]
            self._device.receive(self._bytes(image)[: self._telegram_bytes])

        def read(offset: int, count: int) -> Sequence[int]:
            self._seen(offset)
            return block.values[offset : offset + count]

        block.write, block.read = write, read

    def _actual_values(self, block: Block) -> None:
        def read(offset: int, count: int) -> Sequence[int]:
            self._seen(offset)
            words = self._words(self._device.transmit())[: block.count]
            words += [0] * (block.count - len(words))
            return words[offset : offset + count]

        block.read = read
        block.writable = False

    def _seen(self, offset: int) -> None:
        if self._watched is not None and offset >= self._watched:
            return
        self._accessed_ns = self._scheduler.now
        if not self._watching and self.timeout_ms:
            self._watching = True
            self._scheduler.after(self.timeout_ms * MS, self._look)

    def _look(self) -> None:
        due_ns = self._accessed_ns + self.timeout_ms * MS
        if self.timeout_ms and self._scheduler.now < due_ns:
            self._scheduler.at(due_ns, self._look)
            return
        self._watching = False
        if self.timeout_ms and self._on_timeout is not None:
            self._on_timeout()

    def _timeout(self, block: Block) -> None:
        def read(offset: int, count: int) -> Sequence[int]:
            return [self.timeout_ms & 0xFFFF, self.timeout_ms >> 16][offset : offset + count]

        def write(offset: int, values: Sequence[int]) -> None:
            words = [self.timeout_ms & 0xFFFF, self.timeout_ms >> 16]
            words[offset : offset + len(values)] = values
            self.timeout_ms = words[0] | words[1] << 16

        block.read, block.write = read, write

    # ---------------------------------------------------------------------------------------------------- parameters

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
        low, high = (-0x8000, 0x7FFF) if entry.signed else (0, 0xFFFF)

        def address(offset: int) -> Address:
            return Address(entry.parameter or 0, entry.sub_index + offset, 1 if entry.count > 1 else 0)

        def read(offset: int, count: int) -> Sequence[int]:
            words = []
            for number in range(offset, offset + count):
                value = self._value(address(number)).values[0]
                if isinstance(value, bytes) or value != value:  # noqa: PLR0124 - not a number
                    self.error_code = _INTERNAL
                    raise RegisterRefusal
                words.append(round(min(max(value * entry.scale, low), high)))
            return words

        def write(offset: int, values: Sequence[int]) -> None:
            for number, word in enumerate(values, offset):
                raw = word - 0x10000 if entry.signed and word & 0x8000 else word
                present = self._value(address(number))  # tells the format
                value = raw / entry.scale
                kept = value if isinstance(present.values[0], float) else round(value)
                self._store(address(number), Values(present.code, (kept,)))

        block.read, block.write = read, write

    def _error_code(self, block: Block) -> None:
        block.read = lambda _offset, _count: [self.error_code]
        block.writable = False

    # ------------------------------------------------------------------------------------------------ DS47 (PD-326)

    def _ds47(self, block: Block) -> None:
        pending: list[bytes] = []
        last = [_DS47 << 8, _NOT_READY]

        def answer(request: bytes) -> None:
            if not pending or pending[0] is not request:
                return  # another request has replaced it
            pending.clear()
            show(self._device.request(request)[:_LONGEST_DS47])

        def show(data: bytes) -> None:
            data += bytes(len(data) % 2)
            words = [int.from_bytes(data[at : at + 2], "big") for at in range(0, len(data), 2)]
            put([_READY, _DS47 << 8 | len(data), *words])

        def put(words: Sequence[int]) -> None:
            block.values[:] = [*words, *[0] * (block.count - len(words))]

        def write(offset: int, values: Sequence[int]) -> None:
            image = [*block.values[:offset], *values, *block.values[offset + len(values) :]]
            if offset or values[0] != _STARTED:
                return  # stored by the map
            pending.clear()
            function, length = image[1] >> 8, image[1] & 0xFF
            sent = b"".join(word.to_bytes(2, "big") for word in image[2:])
            if function != _DS47 or not 0 < length <= _LONGEST_DS47:
                wrong = _WRONG_FUNCTION if function != _DS47 else _WRONG_LENGTH
                self._scheduler.at(self._scheduler.now, lambda: put([_READY, *last[:1], wrong]))
                return
            request = sent[:length]
            pending.append(request)
            self._scheduler.after(self._processing_ns, lambda: answer(request))

        def read(offset: int, count: int) -> Sequence[int]:
            if pending:
                return [_STARTED, *last, *[0] * (block.count - 3)][offset : offset + count]
            return block.values[offset : offset + count]

        block.read, block.write = read, write

    # ------------------------------------------------------------------------------------------------------- mailbox

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
            # The map stores what was written behind this; the state is shown when it is read.
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
        """Do what the mailbox was told; return the length of what was read, in bytes."""
        elements = image[2] if image[2] > 1 else 0
        if elements > 0xFF:
            raise RegisterRefusal
        address = Address(image[0], image[1], elements)
        if order not in (_MAILBOX_READ, _MAILBOX_WRITE):
            raise RegisterRefusal
        present = self._value(address)
        size = size_of(present.code) or 1
        room = 2 * (block.count - _MAILBOX_DATA)
        if order == _MAILBOX_READ:
            data = b"".join(pack_values(present.code, (value,))[::-1] for value in present.values)
            if len(data) > room:
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
