"""Data of the NC dialect: parameters and error codes."""

from __future__ import annotations

import json
from functools import cache
from importlib.resources import files
from typing import Any


@cache
def load(name: str) -> Any:
    """Return the content of a data file of this package."""
    return json.loads((files(__name__) / f"{name}.json").read_text(encoding="utf-8"))
