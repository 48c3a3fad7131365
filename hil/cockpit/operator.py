"""Who operates: one page at a time has control, the others watch."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Final

from hil.cockpit.messages import MessageError

if TYPE_CHECKING:
    from hil.cockpit.client import Client

LIFE_S: Final = 1.0
"""Age of the last sign of life from which on the operator counts as away, s; a page gives ten in a second
(COM-024).
"""
OLDEST_S: Final = 2.0
"""Age of what the page of the operator shows from which on the operator counts as away, s: over a slow
connection signs of life may be in time, and the picture is not.
"""


class Control:
    """The page that has control, if one has."""

    def __init__(self) -> None:
        self.client: Client | None = None

    def take(self, client: Client) -> None:
        """Give control to a page.

        Raises:
            MessageError: Another page has it.

        """
        if self.client is not None and self.client is not client:
            raise MessageError(f"{self.client.name} has control; it has to release it first")
        client.alive()
        self.client = client

    def release(self, client: Client) -> bool:
        """Take control away from a page that had it; returns whether it had."""
        had = self.client is client
        if had:
            self.client = None
        return had

    def need(self, client: Client) -> None:
        """Refuse what only the operator may do.

        Raises:
            MessageError: The page does not have control.

        """
        if self.client is not client:
            who = "nobody has it" if self.client is None else f"{self.client.name} has it"
            raise MessageError(f"take control first; {who}")

    @property
    def present(self) -> bool:
        """Whether the operator has given a sign of life in time, before a picture that is not old."""
        client, now_s = self.client, time.monotonic()
        return client is not None and now_s - client.life_s <= LIFE_S and now_s - client.shown_s <= OLDEST_S
