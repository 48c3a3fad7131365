"""A pane: one subject of the cockpit, with its messages and its state."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hil.bench.bench import Bench
    from hil.cockpit.client import Client
    from hil.cockpit.messages import Message

Handler = Callable[[Any, "Client"], object]
"""Carries out a message of one kind; what it returns is the value of the reply."""


class Pane:
    """What every pane has. Everything is called in the thread of the bench; nothing may wait."""

    name: str = ""
    """Key of its description and its state in what the page gets."""

    @property
    def handlers(self) -> Mapping[type[Message], Handler]:
        """The kinds of messages that it takes, and what carries each out."""
        return {}

    def begin(self, bench: Bench) -> None:
        """Take up a bench that has been brought up."""

    def end(self) -> None:
        """Let go of the bench, which is still up but will be closed; harmless without one."""

    def pulse(self, now_s: float) -> None:
        """Look after things: called after every slice of bench time and some ten times a second in a pause.

        Args:
            now_s: Monotonic time, s.

        """

    def description(self) -> object:
        """Return what holds as long as the bench does, as JSON."""
        return None

    def state(self) -> object:
        """Return what changes, as JSON; it goes to all pages ten times a second."""
        return None

    def given_up(self) -> None:
        """Give back what the operator has, who has released control."""

    def gone(self, client: Client) -> None:
        """Forget a page whose connection has ended."""
