"""Touch probe of an axis: its position at an edge of the latch input, or at the zero mark."""

from __future__ import annotations

from enum import IntEnum
from typing import TYPE_CHECKING

from motion.nc.device import HARDWARE_SYNC
from motion.nc.errors import BLOCK_MODE, NO_ERROR

if TYPE_CHECKING:
    from motion.drives.mark import MarkSearch
    from motion.nc.device import Device
    from motion.nc.encoder import Encoder


class ProbeSource(IntEnum):
    """What latches the position."""

    ZERO_MARK = HARDWARE_SYNC
    LATCH_POSITIVE = HARDWARE_SYNC + 1
    """Rising edge of the latch input."""
    LATCH_NEGATIVE = HARDWARE_SYNC + 2
    """Falling edge."""


class TouchProbe:
    """The touch probe of an axis.

    Args:
        device: Its hardware.
        encoder: Its encoder.

    """

    def __init__(self, device: Device, encoder: Encoder) -> None:
        self._device = device
        self._encoder = encoder
        self._search: MarkSearch | None = None
        self._window: tuple[float, float] | None = None
        self.active = False
        """An edge is waited for."""
        self.valid = False
        """A position has been latched (`ExternalLatchValid`)."""
        self.position = 0.0
        """Latched position, position unit; once `valid`."""
        self.count = 0
        """Latched positions so far."""

    def start(self, source: ProbeSource, window: tuple[float, float] | None = None) -> int:
        """Wait for an edge; returns an error code, 0 for none.

        Args:
            source: What latches.
            window: First and last position of an edge that counts, position unit; None: every one does.

        """
        search = self._device.search(source)
        if search is None or (search.searching and search is not self._search):
            return BLOCK_MODE
        self.cancel()
        self.valid = False
        self._window = window
        self._search = search
        self.active = True
        search.start()
        return NO_ERROR

    def cancel(self) -> None:
        """Wait no more."""
        if self._search is not None:
            self._search.cancel()
            self._search = None
            self.active = False

    def step(self) -> None:
        """Look whether an edge has come; once per cycle while `active`."""
        search = self._search
        if search is None:
            return
        if search.failed:
            search.start()
        elif search.found:
            position = self._encoder.position_of(search.value)
            window = self._window
            if window is not None and not window[0] <= position <= window[1]:
                search.start()
                return
            self.position, self.valid, self._search = position, True, None
            self.active = False
            self.count += 1
