"""The examples of `docs/reference/interoperation.md` run as they stand there."""

import re
from pathlib import Path

import pytest

pytestmark = pytest.mark.exhaustive

PAGE = Path(__file__).resolve().parents[2] / "docs" / "reference" / "interoperation.md"
EXAMPLES = re.findall(r"^```python\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


def test_there_are_examples():
    """The page has its three complete programs."""
    assert len(EXAMPLES) == 3


@pytest.mark.parametrize("example", EXAMPLES, ids=["canopen", "python-can", "homing"])
def test_example_runs(example):
    """A complete program of the page runs, and its assertions hold."""
    exec(compile(example, str(PAGE), "exec"), {"__name__": "__main__"})
