"""What a node tells: emergency messages, and the calls that the user of a node gets."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from fieldbus.cia402 import emcy_text


class Emcy(NamedTuple):
    """An emergency message of a node (C301-108)."""

    time_ns: int
    code: int
    register: int
    """Error register 1001h."""
    data: bytes
    """Five manufacturer-specific bytes."""

    @property
    def text(self) -> str:
        """What the code means."""
        return emcy_text(self.code)


class NodeUser(Protocol):
    """Who depends on a node; told of what concerns the use of it. Everything is called within callbacks."""

    def node_restarted(self) -> None:
        """The node has started anew: what it knew is gone."""

    def node_in_service(self) -> None:
        """The node is checked, configured and Operational."""

    def node_lost(self, reason: str) -> None:
        """The node must not be relied on any more."""

    def node_state(self, state: int) -> None:
        """The node reports another NMT state."""

    def node_emcy(self, code: int) -> None:
        """The node has sent an EMCY."""
