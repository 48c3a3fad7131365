"""What can be wrong with a telegram or a parameter request."""

from __future__ import annotations

from fieldbus.errors import BusError


class TelegramError(BusError):
    """A frame does not fit its telegram, or a telegram cannot be made as asked."""


class ParameterAccessError(BusError):
    """Bytes that are no parameter request or answer, or one that cannot be made as asked.

    Args:
        message: What is wrong.
        error: Error number with which the drive answers.

    """

    def __init__(self, message: str, error: int = 0x18) -> None:
        super().__init__(message)
        self.error = error
