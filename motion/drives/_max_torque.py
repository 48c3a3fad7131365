"""Torque limit of a CiA 402 drive in 6072h, which is no process data here: it is
read and written by SDO (MC-585).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Callable

    from fieldbus.canopen.master import CanopenMaster
    from fieldbus.canopen.sdo_client import SdoJob

_MAX_TORQUE: Final = 0x6072
_LARGEST: Final = 0xFFFF


class MaxTorque:
    """Keeps 6072h at the limit that is wanted; nothing waits, one transfer runs at a time.

    What the drive had before comes back when the limit ends, and a drive that has
    started again gets the limit again.

    Args:
        master: The controller's CANopen services.
        node_id: The drive.
        refused: Called with the reason when the drive does not take the limit.

    """

    def __init__(self, master: CanopenMaster, node_id: int, refused: Callable[[str], object]) -> None:
        self._master = master
        self._node_id = node_id
        self._refused = refused
        self._original: int | None = None
        self._sent: int | None = None
        self._busy = False
        self._generation = 0
        self.wanted: int | None = None
        """Limit, thousandths of the rated torque; None = the drive's own."""

    def want(self, permille: int | None) -> None:
        """Let this be the limit from now on; None = what the drive had."""
        self.wanted = None if permille is None else min(permille, _LARGEST)
        self._go_on()

    def drive_restarted(self) -> None:
        """Take note that the drive has its own value again."""
        self._original = self._sent = None
        self._busy = False
        self._generation += 1
        if self.wanted is not None:
            self._go_on()

    def _go_on(self) -> None:
        if self._busy:
            return
        client = self._master.sdo(self._node_id)
        mine = self._generation
        if self._original is None:
            if self.wanted is not None:
                self._busy = True
                client.upload(
                    _MAX_TORQUE, 0, lambda job: self._read(job) if mine == self._generation else None
                )
            return
        value = self._original if self.wanted is None else self.wanted
        if value != self._sent:
            self._busy = True
            self._sent = value
            client.download(
                _MAX_TORQUE,
                0,
                value.to_bytes(2, "little"),
                lambda job: self._written(job) if mine == self._generation else None,
            )

    def _read(self, job: SdoJob) -> None:
        self._busy = False
        if not job.ok:
            self._refused(job.reason)
            return
        self._original = self._sent = job.value
        self._go_on()

    def _written(self, job: SdoJob) -> None:
        self._busy = False
        if not job.ok:
            self._sent = None
            self._refused(job.reason)
            return
        self._go_on()
