"""Process data words of a telegram as objects of a CANopen slave, four in a PDO at most (PD-338 to PD-341).

Each word is an object: 5800h and following to the device, 5810h and following from it. At SYNC the words of
all RPDOs become one telegram, if every RPDO that carries some of them has come; the words of the answer go
into the TPDOs of the same SYNC.
"""

from __future__ import annotations

from operator import eq, itemgetter
from struct import Struct
from typing import TYPE_CHECKING

from emulators.drive.profidrive.canopen import objects
from fieldbus.errors import ConfigurationError
from fieldbus.profidrive import Telegram

if TYPE_CHECKING:
    from fieldbus.canopen.pdo import ReceivePdo
    from fieldbus.canopen.slave import CanopenSlave


class ProcessWords:
    """The words of one telegram in the objects of a slave.

    Args:
        slave: Whose objects they are.
        telegram: Layout of both directions.

    Raises:
        ConfigurationError: The telegram has more than 16 words in a direction.

    """

    __slots__ = (
        "_carriers",
        "_counts",
        "_from_words",
        "_gather",
        "_keys_in",
        "_keys_out",
        "_slave",
        "_to_frame",
        "_touches",
    )

    def __init__(self, slave: CanopenSlave, telegram: Telegram) -> None:
        out, back = telegram.setpoint.words, telegram.actual.words
        for words in (out, back):
            if words > objects.WORDS:
                raise ConfigurationError("telegram", f"{words} words", f"at most {objects.WORDS} words")
        self._slave = slave
        self._keys_in = tuple(objects.RECEIVE_WORD + word << 8 for word in range(out))
        self._keys_out = tuple(objects.SEND_WORD + word << 8 for word in range(back))
        first, *others = self._keys_in
        self._gather = itemgetter(first, *others) if others else lambda values: (values[first],)
        self._to_frame = Struct(f">{out}h")
        self._from_words = Struct(f">{back}h")
        self._carriers: tuple[ReceivePdo, ...] = ()
        self._counts: tuple[int, ...] = ()
        self._touches = False

    def begin(self) -> None:
        """Find the PDOs that carry the words, when the slave has become operational."""
        pdos = self._slave.pdos
        words = frozenset(self._keys_in)
        self._carriers = tuple(
            pdo for pdo in pdos.receive if pdo.valid and not words.isdisjoint(pdo.layout.keys)
        )
        self._counts = tuple(pdo.effective for pdo in self._carriers)
        answers = frozenset(self._keys_out)
        self._touches = any(
            pdo.valid and pdo.event_driven and not answers.isdisjoint(pdo.layout.keys)
            for pdo in pdos.transmit
        )

    def take(self) -> bytes | None:
        """Return the telegram that has come since the last call; None: not all of it has."""
        counts = tuple([pdo.effective for pdo in self._carriers])
        before = self._counts
        self._counts = counts
        if not counts or any(map(eq, counts, before)):
            return None
        return self._to_frame.pack(*self._gather(self._slave.values))

    def give(self, frame: bytes) -> None:
        """Let an answer go with the next TPDOs."""
        words = self._from_words.unpack(frame)
        self._slave.values.update(zip(self._keys_out, words))  # noqa: B905 - as many as the struct has
        if self._touches:
            for key in self._keys_out:
                self._slave.pdos.touch(key)
