"""A fault as one word of a command line."""

import re

import pytest

from fieldbus.errors import ConfigurationError
from hil._commands.envelope import all_faults
from hil.envelope import stimulus_from_text
from hil.faults import Fault, after, fault_from_text


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("drive.fault@x:code=0x2310", Fault("drive.fault", "x", parameters={"code": 0x2310})),
        (
            "frame.delay : drive = x, message = tpdo1, delay_s = 0.01, at_s = 2, duration_s = 1.5, count = 3",
            Fault(
                "frame.delay",
                trigger=after(2.0),
                duration_s=1.5,
                count=3,
                parameters={"drive": "x", "message": "tpdo1", "delay_s": 0.01},
            ),
        ),
    ],
)
def test_a_text_is_a_fault(text, fault):
    """Kind, target and parameters, with time, duration and count of the fault itself."""
    assert fault_from_text(text, where="--fault") == fault


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("frame.dorp", "similar: frame.drop"),
        ("frame.drop:drive", "'frame.drop:drive' is not allowed; allowed: KIND[@TARGET][:KEY=VALUE,...]"),
        ("drive.fault:code=0x2310,at_s=soon", "drive.fault.at_s: 'soon' is not allowed; allowed: a number"),
        ("frame.drop:count=1.5", "a whole number"),
    ],
)
def test_a_text_that_is_none(text, says):
    """What is wrong, and what is allowed."""
    with pytest.raises(ConfigurationError, match=re.escape(says)):
        fault_from_text(text, where="--fault")


def test_every_kind_can_be_written_and_read_again(subtests):
    """The example of every kind of fault as a word, and the word that a stimulus of it gives, say the same; a
    text that looks like a number stays one.
    """
    for text in all_faults():
        with subtests.test(text=text):
            stimulus = stimulus_from_text(text)
            assert stimulus_from_text(str(stimulus)) == stimulus
    assert stimulus_from_text("frame.inject:can_id=5,data=8001").parameters == {"can_id": 5, "data": "8001"}
