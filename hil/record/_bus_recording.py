"""The frames of one bus: the newest in the log of its segment, the older ones on disk when they are many."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Final

from fieldbus.can.frame import CanFrame
from fieldbus.growing_log import GrowingLog
from hil.record._frames import PackedFrames
from hil.record._stored_log import StoredLog

if TYPE_CHECKING:
    from fieldbus.growing_log import Store
    from hil.record._frames import BusFrame, FrameLog

_CAN_BYTES: Final = 330
_MADE_BYTES: Final = 1000
"""What an entry with its frame takes in memory, about; one that was made of others (Modbus) with these."""


class BusRecording:
    """The recording of a bus.

    Args:
        log: The growing list of its frames, or what returns it.
        drop: Removes so many entries from the begin of the list; None: nothing goes to disk.
        held: Number of entries in memory, where `log` has to make them first; None: what `log` returns.

    """

    def __init__(
        self,
        log: FrameLog | Callable[[], FrameLog],
        drop: Callable[[int], None] | None = None,
        held: Callable[[], int] | None = None,
    ) -> None:
        self._log = log if callable(log) else lambda: log
        self._drop = drop
        self._held = held
        self._whole: GrowingLog[tuple[int, str, BusFrame, str]] | None = None

    def entries(self) -> FrameLog:
        """Return all frames so far."""
        newest = self._log()
        return newest if self._whole is None else self._whole

    @property
    def memory(self) -> int:
        """What the frames in memory take, about, bytes."""
        if self._drop is None:
            return 0
        return len(self._log()) * _CAN_BYTES if self._held is None else self._held() * _MADE_BYTES

    def __len__(self) -> int:
        """Number of frames in memory that can go to disk."""
        return 0 if self._drop is None else len(self._log())

    def store(self, count: int) -> None:
        """Write the oldest frames in memory to disk.

        Args:
            count: How many; 0 or less: none.

        Raises:
            RecordingError: The disk is full.

        """
        newest = self._log()
        if self._drop is None or count <= 0 or not isinstance(newest, list):
            return
        if self._whole is None:
            self._whole = GrowingLog(newest)
        on_can = isinstance(newest[0][2], CanFrame)
        self._whole.move(count, _packed if on_can else StoredLog, self._drop)

    def forget(self) -> None:
        """Drop all frames."""
        newest = self._log()
        if self._whole is not None:
            self._whole.forget_stored()
        if self._drop is not None:
            self._drop(len(newest))
        elif isinstance(newest, list):
            newest.clear()


def _packed() -> Store[tuple[int, str, BusFrame, str]]:
    return PackedFrames(in_memory=0)
