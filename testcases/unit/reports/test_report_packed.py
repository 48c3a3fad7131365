"""Packed lists: equal to what they hold, and small."""

import pickle
import sys

import pytest

from reports.model import CaseResult, Message, Step, Verdict
from reports.packed import Packed, pack_case
from reports.store import load_run, start_run, write_case
from testcases.sample_run import sample_run

pytestmark = pytest.mark.exhaustive

MESSAGES = [
    Message(n * 1e-3, "can", 0x181, "00 01", "drive1", "TPDO1 drive1: Statusword 0237h") for n in range(200)
]


def test_a_packed_list_is_the_list_and_a_tenth_of_it():
    """Length, items, slices, order and equality are those of the list; two packed lists are read by turns."""
    packed, other = Packed(MESSAGES), Packed(["a", "b"])

    assert packed == MESSAGES
    assert packed == MESSAGES
    assert packed != MESSAGES[1:]
    assert [packed[n].time_s for n in (0, -1)] == [0.0, 0.199]
    assert (list(other), packed[3:5], other[1]) == (["a", "b"], MESSAGES[3:5], "b")
    assert len(packed) == 200
    assert sys.getsizeof(packed._content) * 3 < len(pickle.dumps(MESSAGES))


def test_a_case_with_packed_lists_is_stored_as_any_other(tmp_path):
    """A case is packed once, empty lists stay as they are, and the journal holds the same lines."""
    case = CaseResult(
        "a", "A", Verdict.PASSED, story=[Step(0.0, "do", "x", {"n": 1})], messages=list(MESSAGES)
    )
    pack_case(case)
    story = case.story
    pack_case(case)
    assert case.story is story
    run = sample_run()
    start_run(tmp_path, run)
    write_case(tmp_path, case)

    assert load_run(tmp_path).cases[0].messages == MESSAGES
    (lazy,) = load_run(tmp_path, lazy=True).cases
    assert isinstance(lazy.story, Packed)
    assert not isinstance(lazy.messages, list)
    assert (lazy.story, lazy.messages, lazy.alarms) == (case.story, MESSAGES, [])
