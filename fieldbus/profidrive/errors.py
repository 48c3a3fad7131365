"""What can be wrong with a telegram or a parameter request."""

from __future__ import annotations

from fieldbus.errors import BusError


class TelegramError(BusError):
    """A frame does not fit its telegram, or a telegram cannot be made as asked."""
