"""How likely a choice is among others."""

from __future__ import annotations

from typing import TypeVar

from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

Drawn = TypeVar("Drawn")


def whole(strategy: SearchStrategy[Drawn]) -> SearchStrategy[Drawn]:
    """Return a strategy that counts as one choice in `one_of`, whatever it chooses from itself; a mapped one
    counts as all of its own.
    """
    return st.tuples(strategy).map(lambda drawn: drawn[0])
