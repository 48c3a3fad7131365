"""`hil schema`: the JSON Schema of the bench file."""

from __future__ import annotations

import json
import sys


def show_schema() -> int:
    """Print the schema; returns the exit code."""
    from hil.bench.schema import json_schema

    sys.stdout.write(json.dumps(json_schema(), indent=2, ensure_ascii=False) + "\n")
    return 0
