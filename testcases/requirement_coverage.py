"""Compare which requirements the tests check, before and after a change to the tests.

    python -m testcases.requirement_coverage record before.json
    python -m testcases.requirement_coverage compare before.json

Collects all tests of the checkout, whatever their marks, and runs none. `compare` lists every requirement
that fewer test functions name than before, and ends with 1 when one of them is named by none.
"""

from __future__ import annotations

import json
import sys
from collections import defaultdict
from pathlib import Path

import pytest


class Marks:
    """Pytest plugin that notes the test functions that name a requirement."""

    def __init__(self) -> None:
        self.functions: dict[str, set[str]] = defaultdict(set)
        self.tests = 0

    @pytest.hookimpl(tryfirst=True)  # before tests are deselected
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """See pytest."""
        self.tests = len(items)
        for item in items:
            for marker in item.iter_markers("requirement"):
                for identifier in marker.args:
                    self.functions[identifier].add(item.nodeid.partition("[")[0])


def collect() -> Marks:
    """Collect all tests of the checkout."""
    marks = Marks()
    root = Path(__file__).resolve().parent
    code = pytest.main(["--collect-only", "-qq", "-m", "", "-p", "no:cacheprovider", str(root)], [marks])
    if code:
        raise SystemExit(int(code))
    return marks


def main(command: str, file: str) -> int:
    """Record, or compare; return the exit code."""
    marks = collect()
    now = {identifier: sorted(functions) for identifier, functions in sorted(marks.functions.items())}
    if command == "record":
        text = json.dumps({"tests": marks.tests, "requirements": now}, indent=1)
        Path(file).write_text(text, encoding="utf-8")
        return 0
    recorded = json.loads(Path(file).read_text(encoding="utf-8"))
    before = recorded["requirements"]
    for identifier, functions in before.items():
        count = len(now.get(identifier, ()))
        if count < len(functions):
            print(f"{identifier}: {len(functions)} -> {count} functions")
            print(
                "".join(f"    {name}\n" for name in functions if name not in now.get(identifier, ())), end=""
            )
    lost = sorted(set(before) - set(now))
    print(f"tests: {recorded['tests']} -> {marks.tests}; requirements: {len(before)} -> {len(now)}")
    print(f"lost: {', '.join(lost) or 'none'}; new: {', '.join(sorted(set(now) - set(before))) or 'none'}")
    return 1 if lost else 0


if __name__ == "__main__":
    if len(sys.argv) != 3 or sys.argv[1] not in ("record", "compare"):
        sys.exit(__doc__)
    sys.exit(main(*sys.argv[1:]))
