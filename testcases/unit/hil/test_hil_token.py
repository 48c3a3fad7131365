"""Replay tokens: whole, compact, and suspicious of everything that is not one."""

import base64
import json
import zlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.campaign import Token
from hil.errors import TokenError

pytestmark = pytest.mark.exhaustive


@given(
    case=st.text(min_size=1),
    seed=st.integers(0, 2**63),
    campaign=st.text(),
    bench=st.text(),
    program=st.none() | st.lists(st.fixed_dictionaries({"wait": st.floats(0, 60)})),
)
def test_a_token_has_all_that_it_was_made_of(case, seed, campaign, bench, program):
    """Every field comes back from the text."""
    token = Token(case, seed, campaign, bench, "ab" * 32, program)
    assert Token.decode(token.encode()) == token


def test_a_token_survives_being_pasted():
    """Line breaks and blanks that a terminal or mail puts in do no harm."""
    text = Token("stop-modes/x", 7, "testcases.campaigns.stop_modes:CAMPAIGN").encode()
    assert text.startswith("HIL1-")
    assert Token.decode(f"  {text[:20]}\n {text[20:]} ").case == "stop-modes/x"
    assert set(text) <= set("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_")


def pack(content):
    return "HIL1-" + base64.urlsafe_b64encode(zlib.compress(json.dumps(content).encode())).decode().rstrip(
        "="
    )


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "no replay token"),
        ("HIL2-abc", "no replay token"),
        ("HIL1-", "damaged|cut off"),
        ("HIL1-!!!!", "damaged"),
        ("HIL1-AAAA", "damaged"),
        (Token("case", 1).encode()[:-4], "damaged|cut off"),
        (pack([1, 2]), "lacks"),
        (pack({"case": "x"}), "lacks"),
        (pack({"case": 5, "seed": 1}), "damaged: case"),
        (pack({"case": "x", "seed": True}), "damaged: seed"),
        (pack({"case": "x", "seed": 1, "shell": "rm"}), "does not know"),
        (pack({"case": "x", "seed": 1, "program": "rm"}), "damaged: program"),
        (pack({"case": "x" * 5_000_000, "seed": 1}), "cut off or too long"),
    ],
)
def test_what_is_no_token_is_refused(text, words):
    """A foreign, cut, changed or oversized text is refused with a reason."""
    with pytest.raises(TokenError, match=words):
        Token.decode(text)
