"""Write the names of the tests with the mark `vcan` into a file that pytest takes as `@file`.

    python testcases/vcan/select_tests.py <output> [paths or pytest options...]

Collecting imports every test file, which takes long in user-mode Linux; so it is done before, outside.
"""

from __future__ import annotations

import sys
from pathlib import Path

import pytest


class Selection:
    """Pytest plugin that remembers the selected tests."""

    def __init__(self) -> None:
        self.names: list[str] = []

    def pytest_collection_finish(self, session: pytest.Session) -> None:
        """See pytest."""
        self.names = [item.nodeid for item in session.items]


def main(output: str, *arguments: str) -> int:
    """Collect and write; return pytest's exit code, which tells of an empty selection too."""
    selection = Selection()
    options = ("-m", "vcan", "--collect-only", "-qq", "-p", "no:cacheprovider")
    code = pytest.main([*options, *arguments], [selection])
    Path(output).write_text("".join(f"{name}\n" for name in selection.names), encoding="utf-8")
    return int(code)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
