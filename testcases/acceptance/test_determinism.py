"""The same bench, case and seed leave the same bytes: in one process, in another one, whatever the hash
seed.
"""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from hil.bench import load_bench
from hil.campaign import CaseSettings, execute_case
from testcases.campaigns import fault_reactions

pytestmark = pytest.mark.exhaustive

RANDOM_CASE = "fault-reactions/limit-switch-bounces"
"""A case that draws from a seeded stream."""

PROGRAM = f"""
from hil.bench import load_bench
from hil.campaign import CaseSettings, execute_case
from testcases.campaigns import fault_reactions
case = fault_reactions.CAMPAIGN[{RANDOM_CASE!r}]
print(execute_case(case, load_bench("reference"), CaseSettings(seed=7)).result.trace_digest)
"""


def digest(seed: int, identifier: str = RANDOM_CASE) -> str:
    case = fault_reactions.CAMPAIGN[identifier]
    return execute_case(case, load_bench("reference"), CaseSettings(seed=seed)).result.trace_digest


@pytest.mark.requirement("CFG-592")
def test_twenty_runs_leave_the_same_trace():
    """Twenty runs of one case with one seed have one digest; another seed has another."""
    assert len({digest(7) for _ in range(20)}) == 1
    assert digest(7) != digest(8)


@pytest.mark.parametrize("hash_seed", ["0", "4711"])
def test_another_process_leaves_the_same_trace(hash_seed):
    """A process of its own, with another hash seed, leaves the same trace."""
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        env={**os.environ, "PYTHONHASHSEED": hash_seed},
        capture_output=True,
        text=True,
        check=True,
    )

    assert digest(7) == done.stdout.strip()


@pytest.mark.parametrize(
    "identifier",
    [
        "fault-reactions/node-off/constant",
        "fault-reactions/corrupted-frames",
        "fault-reactions/jam/accelerating",
    ],
)
def test_faults_are_repeatable(identifier):
    """Power loss, bit errors and blocked mechanics leave the same trace twice."""
    assert digest(3, identifier) == digest(3, identifier)
