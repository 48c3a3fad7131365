"""CAN frames."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable
from typing import Final

FD_LENGTHS: Final = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)
"""Bytes of a CAN FD frame by its data length code (CANP-074)."""


class CanFrame:
    """A CAN data or remote frame. Immutable by convention; frames are shared between receivers.

    Args:
        can_id: Identifier, 0..7FFh, or 0..1FFFFFFFh with `extended`.
        data: 0 to 8 bytes, of CAN FD also 12, 16, 20, 24, 32, 48 or 64; empty for a remote frame.
        extended: 29-bit identifier.
        remote: Remote frame; `dlc` then says how many bytes are asked for. CAN FD has none.
        dlc: Data length code 0..15 as sent; default: that of the length of `data` (CANP-010).
        fd: Frame of CAN FD.
        brs: CAN FD: the data phase has the data bit rate.
        esi: CAN FD: the sender is error-passive.

    """

    __slots__ = ("bits", "brs", "can_id", "data", "dlc", "esi", "extended", "fd", "key", "remote")

    def __init__(
        self,
        can_id: int,
        data: bytes = b"",
        *,
        extended: bool = False,
        remote: bool = False,
        dlc: int | None = None,
        fd: bool = False,
        brs: bool = False,
        esi: bool = False,
    ) -> None:
        self.can_id = can_id
        self.data = data
        self.extended = extended
        self.remote = remote
        self.fd = fd
        self.brs = brs
        self.esi = esi
        if dlc is not None:
            self.dlc = dlc
        else:
            self.dlc = bisect_left(FD_LENGTHS, len(data)) if fd else len(data)
        self.key = 0
        """Arbitration field as `fieldbus.can.timing.arbitration_key` returns it, once `bits` is known."""
        self.bits = 0
        """Bits of a classical frame on the wire, kept by `fieldbus.can.timing`; 0 until they are known."""

    def with_data(self, data: bytes) -> CanFrame:
        """Return a data frame of the same kind and identifier with other data."""
        return CanFrame(self.can_id, data, extended=self.extended, fd=self.fd, brs=self.brs, esi=self.esi)

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, CanFrame)
            and self.can_id == other.can_id
            and self.data == other.data
            and self.extended == other.extended
            and self.remote == other.remote
            and self.dlc == other.dlc
            and self.fd == other.fd
            and self.brs == other.brs
            and self.esi == other.esi
        )

    def __hash__(self) -> int:
        return hash((self.can_id, self.data, self.extended, self.remote, self.dlc))

    def __repr__(self) -> str:
        width = 8 if self.extended else 3
        body = f"R{self.dlc}" if self.remote else self.data.hex(" ").upper()
        mark = f"##{self.brs | self.esi << 1:X} " if self.fd else "#"
        return f"<CanFrame {self.can_id:0{width}X}{mark}{body}>"


FrameReceiver = Callable[[CanFrame, int], None]
"""Called with a received frame and the time of its end, ns."""
