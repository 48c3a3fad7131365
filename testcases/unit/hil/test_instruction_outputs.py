"""Judging the outputs of an instruction call by call, as the campaign `instructions` does it."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from testcases.campaigns._instruction_outputs import Call, violation

EDGE = SimpleNamespace(inputs=("Execute",))
LEVEL = SimpleNamespace(inputs=("Enable",), CommandAborted=False)
JOG = SimpleNamespace(inputs=("JogForward",))


def calls(text):
    """Return calls from words: `E` the level, `B` Busy, `A` Active, `D` Done, `X` CommandAborted, `!` Error
    with 16#8001, `?` Error without ErrorID, `V` in velocity.
    """
    return [
        Call(
            "E" in word, "B" in word, "A" in word, "D" in word, "X" in word, "!" in word or "?" in word,
            0x8001 if "!" in word else 0, "V" in word,
        )
        for word in text.split()
    ]  # fmt: skip


GOOD = {
    "done while Execute is held": "- EB EBA EBA ED ED - -",
    "done after Execute has fallen": "- EB B BA D - -",
    "refused": "E! E! - -",
    "started again while busy": "EB B EB B D -",
    "started again in the call in which it ends": "EB B D EB D",
    "in velocity until it is aborted": "EB EBV BV X -",
}
BAD = {
    "MC-071": "EB EBD",
    "MC-072": "EA",
    "MC-073": "E?",
    "MC-303": "EB EV",
    "MC-058": "- E",
    "MC-066": "EB ED EBD",
    "MC-067": "EB ED D",
    "MC-064": "EB EB E",
    "MC-054": "EB EBA EB",
    "MC-052": "- - B",
}


@pytest.mark.parametrize("words", GOOD.values(), ids=GOOD)
def test_what_the_specification_prints_is_no_violation(words):
    """Sequences of the specification are judged good."""
    assert violation(EDGE, calls(words)) is None


def test_every_rule_of_an_edge_is_found_broken(subtests):
    """Each rule of the state machine of an `Execute` job has a sequence that breaks it, and is named."""
    for identifier, words in BAD.items():
        with subtests.test(identifier):
            found = violation(EDGE, calls(words))
            assert found is not None
            assert found[0] in {identifier, "MC-071"}
            assert "call" in found[1]
    assert violation(EDGE, calls("EB ED D"))[0] == "MC-067"
    assert violation(EDGE, calls("EB ED E"))[0] == "MC-066"


def test_an_enable_job(subtests):
    """What has failed or was aborted is shown until the level falls, and nothing after that."""
    for words, identifier in (
        ("EB EB EX EX - -", None), ("E! E! -", None), ("EB B B -", None),
        ("E", "MC-082"), ("EB EX EB", "MC-085"), ("EB EX X", "MC-083"), ("EB E", "MC-082"),
    ):  # fmt: skip
        with subtests.test(words):
            found = violation(LEVEL, calls(words))
            assert (found and found[0]) == identifier
    assert violation(JOG, calls("EB E")) is None, "Busy of MC_MoveJog falls when another job takes over"
