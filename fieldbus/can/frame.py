"""CAN frames."""

from __future__ import annotations

from collections.abc import Callable


class CanFrame:
    """A classical CAN data or remote frame. Immutable by convention; frames are shared between receivers.

    Args:
        can_id: Identifier, 0..7FFh, or 0..1FFFFFFFh with `extended`.
        data: 0 to 8 bytes; empty for a remote frame.
        extended: 29-bit identifier.
        remote: Remote frame; `dlc` then says how many bytes are asked for.
        dlc: Data length code 0..15 as sent; default the length of `data` (CANP-010).

    """

    __slots__ = ("can_id", "data", "dlc", "extended", "remote", "timing")

    def __init__(
        self,
        can_id: int,
        data: bytes = b"",
        *,
        extended: bool = False,
        remote: bool = False,
        dlc: int | None = None,
    ) -> None:
        self.can_id = can_id
        self.data = data
        self.extended = extended
        self.remote = remote
        self.dlc = len(data) if dlc is None else dlc
        self.timing: tuple[int, int] | None = None  # kept by `fieldbus.can.timing.note_timing`

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, CanFrame)
            and self.can_id == other.can_id
            and self.data == other.data
            and self.extended == other.extended
            and self.remote == other.remote
            and self.dlc == other.dlc
        )

    def __hash__(self) -> int:
        return hash((self.can_id, self.data, self.extended, self.remote, self.dlc))

    def __repr__(self) -> str:
        width = 8 if self.extended else 3
        body = f"R{self.dlc}" if self.remote else self.data.hex(" ").upper()
        return f"<CanFrame {self.can_id:0{width}X}#{body}>"


FrameReceiver = Callable[[CanFrame, int], None]
"""Called with a received frame and the time of its end, ns."""
