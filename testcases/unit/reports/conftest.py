"""Runs to report on."""

from __future__ import annotations

import pytest

from reports import RunResult
from testcases import sample_run as samples


@pytest.fixture(scope="module")
def run() -> RunResult:
    """45 cases with every verdict; not to be changed by a test."""
    return samples.sample_run(samples=300)


@pytest.fixture(scope="module")
def hostile() -> RunResult:
    """Every text tries to break out of its surroundings; not to be changed by a test."""
    return samples.hostile_run()
