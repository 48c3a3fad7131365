"""Zero mark of a CiA 402 drive: touch probe 1 on the index, over SDO (60B8h to 60BAh).

The drive latches the position, so it does not matter that the transfers take a few cycles.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from motion.drives.mark import MarkSearch

if TYPE_CHECKING:
    from collections.abc import Callable

    from fieldbus.canopen.master import CanopenMaster
    from fieldbus.canopen.sdo_client import SdoJob

_FUNCTION: Final = 0x60B8
_STATUS: Final = 0x60B9
_OFF: Final = bytes(2)
INDEX: Final = (0x0015, 0x60BA, 0x0002)
INPUT_RISES: Final = (0x0011, 0x60BA, 0x0002)
INPUT_FALLS: Final = (0x0021, 0x60BB, 0x0004)
SECOND_RISES: Final = (0x1100, 0x60BC, 0x0200)
SECOND_FALLS: Final = (0x2100, 0x60BD, 0x0400)
"""What latches: value of 60B8h (probe on, first event, source and edge), object of the position, bit of 60B9h
that says that it is there.
"""


class ProbeMarkSearch(MarkSearch):
    """Searches the zero mark with touch probe 1, or an edge of probe 1 or 2. The port calls `ask` once per
    cycle while `waiting`.

    Args:
        master: The controller's CANopen services on the segment of the drive.
        node_id: The drive.
        event: `INDEX`, `INPUT_RISES`, `INPUT_FALLS`, `SECOND_RISES` or `SECOND_FALLS`.

    """

    def __init__(self, master: CanopenMaster, node_id: int, event: tuple[int, int, int] = INDEX) -> None:
        super().__init__()
        self._master = master
        self._node_id = node_id
        function, self._position, self._stored = event
        self._on = function.to_bytes(2, "little")
        self._generation = 0
        self.waiting = False
        """The probe is on, and no answer is on its way."""
        self.on_begin: Callable[[ProbeMarkSearch], object] | None = None
        """Called when it begins to look."""
        self.convert: Callable[[int], int] | None = None
        """Returns the encoder, increments, at a position of the drive; None: that is the same."""

    def _begin(self) -> None:
        self._generation += 1
        self.waiting = False
        mine = self._generation
        if self.on_begin is not None:
            self.on_begin(self)

        def switched_on(job: SdoJob) -> None:
            if mine != self._generation:
                return
            if job.ok:
                self.waiting = True
            else:
                self.supported = job.timed_out  # an answer that refuses it says that there is no touch probe
                self._fail()

        client = self._master.sdo(self._node_id)
        client.download(_FUNCTION, 0, _OFF)
        client.download(_FUNCTION, 0, self._on, switched_on)

    def _end(self) -> None:
        self._generation += 1
        self.waiting = False
        self._master.sdo(self._node_id).download(_FUNCTION, 0, _OFF)

    def ask(self) -> None:
        """Ask whether the index has been passed."""
        self.waiting = False
        mine = self._generation
        client = self._master.sdo(self._node_id)

        def on_status(job: SdoJob) -> None:
            if mine != self._generation:
                return
            if not job.ok:
                self._fail()
            elif job.value & self._stored:
                client.upload(self._position, 0, read)
            else:
                self.waiting = True

        def read(job: SdoJob) -> None:
            if mine != self._generation:
                return
            client.download(_FUNCTION, 0, _OFF)
            if job.ok:
                value = job.value
                position = value - (1 << 32) if value >> 31 else value
                self._finish(position if self.convert is None else self.convert(position))
            else:
                self._fail()

        client.upload(_STATUS, 0, on_status)
