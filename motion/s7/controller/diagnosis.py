"""What the controller says about itself: its operating state and the newest
entries of its diagnostics buffer.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from motion.s7.controller.diagnostics_buffer import DiagnosticsEntry


@dataclass(frozen=True)
class ControllerDiagnosis:
    """A snapshot of the controller.

    Args:
        state: Name of the operating state.
        entries: The newest entries of the diagnostics buffer, oldest first.

    """

    state: str
    entries: tuple[DiagnosticsEntry, ...]

    def as_dict(self) -> dict[str, object]:
        """Return everything in types that JSON knows, the newest entry first."""
        return {
            "state": self.state,
            "diagnostics buffer": [entry.as_dict() for entry in reversed(self.entries)],
        }

    def text(self) -> str:
        """Return lines for a person, the newest entry first."""
        lines = [f"controller  {self.state}", "", "diagnostics buffer"]
        return "\n".join([*lines, *(map(str, reversed(self.entries)) if self.entries else ["  empty"])])
