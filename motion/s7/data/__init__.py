"""Facts of the technology objects as data: their variables, alarms and error identifications."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any


def load(name: str) -> Any:
    """Return the content of the data file `name` of this package (without suffix)."""
    return json.loads((Path(__file__).parent / f"{name}.json").read_bytes())
