"""A telegram that comes in several TPDOs, four of its words in each."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Final

from fieldbus.profidrive.telegrams import swap_words

if TYPE_CHECKING:
    from fieldbus.canopen.master import CanopenMaster

WORDS_PER_PDO: Final = 4
"""Words of a telegram that fit into a PDO."""


class TelegramPdos:
    """Puts the actual values together that a node sends behind a SYNC.

    Parts of different SYNCs never make one telegram: a position of 32 bits may have its halves in two PDOs,
    and on a busy bus the last PDO comes after the controller has read.

    Args:
        master: Its TPDOs 1 and following are subscribed.
        node_id: CANopen node, 1..127.
        words: Words of the telegram, 1..16.

    """

    def __init__(self, master: CanopenMaster, node_id: int, words: int) -> None:
        self._parts = [
            bytes(2 * min(WORDS_PER_PDO, words - first)) for first in range(0, words, WORDS_PER_PDO)
        ]
        self._all_seen = (1 << len(self._parts)) - 1
        self._seen = 0
        self._sync = 0
        self._whole: bytes | None = None
        self._master = master
        for number in range(len(self._parts)):
            master.subscribe(0x180 + 0x100 * number + node_id, self._receiver(number), apart=True)

    def __len__(self) -> int:
        """Return the number of PDOs."""
        return len(self._parts)

    def forget(self) -> None:
        """Wait for all of them again."""
        self._seen = 0
        self._whole = None

    def take(self) -> bytes | None:
        """Return the last telegram of which all PDOs have come behind one SYNC; None: it was taken before."""
        whole = self._whole
        if whole is None:
            return None
        self._whole = None
        return swap_words(whole)

    def _receiver(self, number: int) -> Callable[[bytes, int], None]:
        parts = self._parts
        size = len(parts[number])
        bit = 1 << number

        def receive(data: bytes, _time_ns: int) -> None:
            if len(data) != size:
                return
            sync = self._master.sync_count
            if sync != self._sync:
                self._sync = sync
                self._seen = 0
            parts[number] = data
            self._seen |= bit
            if self._seen == self._all_seen:
                self._whole = b"".join(parts)

        return receive
