"""The type of what is written as JSON."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeAlias

Json: TypeAlias = "bool | int | float | str | Sequence[Json] | Mapping[str, Json] | None"
"""A value of a JSON document."""
JsonObject: TypeAlias = dict[str, Json]
"""A JSON object that is being made."""
