"""Configurations of the bench: machines that differ in many ways at once, so few of them that every two
differences meet.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.configurations._names import name_of, read_name
from hil.configurations._plan import Plan, plan
from hil.configurations.factors import CONFIGURATION, FACTORS, Factor, Row, differing, objection
from hil.configurations.needs import ANY, Needs

if TYPE_CHECKING:
    from hil.configurations._configuration import Configuration

__all__ = [
    "ANY",
    "CONFIGURATION",
    "FACTORS",
    "Configuration",
    "Factor",
    "Needs",
    "Plan",
    "Row",
    "differing",
    "name_of",
    "objection",
    "plan",
    "read_name",
]

if not TYPE_CHECKING:

    def __getattr__(name: str) -> object:
        """Load `Configuration` when it is first used: it brings the bench file along."""
        if name != "Configuration":
            raise AttributeError(f"module 'hil.configurations' has no attribute {name!r}")
        from hil.configurations._configuration import Configuration

        return Configuration
