"""The corpora and a fixed number of their mutations hold every promise; and the engine finds what is
broken.
"""

from __future__ import annotations

import random

import pytest

from testcases.fuzz.engine import Target, add_to_corpus, inputs, mutate, read_corpus, run
from testcases.fuzz.frames import LONGEST, encode, frames
from testcases.fuzz.targets import targets

INPUTS = {
    "medium": 6,
    "sdo": 2_000,
    "slave": 300,
    "master": 150,
    "lss": 500,
    "drive": 35,
    "encoder": 200,
    "slcan": 500,
    "decoder": 1_000,
    "parameters": 100,
    "modbus": 150,
    "telegram": 60,
    "modbus_client": 100,
    "modbus_drive": 80,
}
"""Inputs per target in the test suite, about a quarter of a second each; `python -m testcases.fuzz run` for
as many as wanted.
"""


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", targets())
def test_no_promise_is_broken(name):
    """Corpus and mutations of it, always the same ones."""
    target = targets()[name]
    assert read_corpus(target.path), "a target without a corpus"
    failure = run(target, INPUTS[name], seed=20_261)
    assert failure is None, f"{failure.error}; python -m testcases.fuzz once {name} {failure.data.hex()}"


def test_the_engine_finds_and_shortens(tmp_path, monkeypatch):
    """A target that fails on one course of bytes is found from a harmless corpus, and the input shortened to
    the core.
    """
    monkeypatch.setattr("testcases.fuzz.engine.CORPUS", tmp_path)

    def make():
        def take(data: bytes) -> None:
            if b"\x81" in data and b"\x7f" in data:
                raise ZeroDivisionError("both")

        return take

    target = Target("toy", "a toy", make)
    add_to_corpus(target.path, [bytes(20)], "harmless")
    failure = run(target, 20_000, seed=1)
    assert failure is not None
    assert sorted(failure.data) == [0x7F, 0x81]
    assert failure.error == "ZeroDivisionError: both"


def test_a_failure_that_needs_what_came_before_says_so(tmp_path, monkeypatch):
    """A target that carries something over from input to input cannot be shortened; the failure tells."""
    monkeypatch.setattr("testcases.fuzz.engine.CORPUS", tmp_path)

    def make():
        seen = []

        def take(data: bytes) -> None:
            seen.append(data)
            if len(seen) > 50:
                raise RuntimeError("full")

        return take

    failure = run(Target("toy", "a toy", make), 100, seed=1)
    assert failure is not None
    assert "only after the inputs before it" in failure.error


def test_inputs_are_repeatable():
    """One seed gives the same inputs, another seed others."""
    corpus = [bytes(range(40)), b"abc"]
    first = list(inputs(corpus, 300, 7))
    assert first == list(inputs(corpus, 300, 7))
    assert first[:2] == corpus
    assert first != list(inputs(corpus, 300, 8))
    assert len(set(first)) > 250


def test_frames_come_back_as_encoded():
    """What `encode` writes, `frames` reads; anything else is read as some frames without an error."""
    course = [(0x605, "4000100000000000"), (0x123, "01"), (0x000, "0105"), (0x080, "")]
    read = [(frame.can_id, frame.data.hex()) for frame, _ in frames(encode(*course))]
    assert read == course
    generator = random.Random(1)
    for _ in range(500):
        data = mutate(generator, encode(*course), bytes(100))
        assert len(list(frames(data))) <= LONGEST


def test_a_corpus_is_not_doubled(tmp_path):
    """Inputs that are there already are not added again."""
    path = tmp_path / "one.txt"
    assert add_to_corpus(path, [b"\x01", b"\x02", b"\x01"], "first") == 2
    assert add_to_corpus(path, [b"\x02", b"\x03"], "second") == 1
    assert read_corpus(path) == [b"\x01", b"\x02", b"\x03"]
