"""`hil diag`: the pages of a bench, and of a case at a given time."""

import json

import pytest

from hil.bench import load_bench
from hil.campaign import Token
from hil.cli import main
from testcases.unit.hil.test_hil_profidrive import bench, enabled

CAMPAIGN = "testcases.campaigns.stop_modes:CAMPAIGN"


def call(capsys, *arguments):
    code = main([str(argument) for argument in arguments])
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def test_a_fresh_bench(capsys):
    """Every axis with its pages; text for a person, JSON for a program."""
    code, out, _ = call(capsys, "diag", "profidrive")
    assert code == 0
    assert "[x] communication with the drive" in out
    assert "ZSW2" in out
    code, out, _ = call(capsys, "diag", "profidrive", "--json", "--after", "0.5")
    content = json.loads(out)
    assert code == 0
    assert content["axes"][0]["axis status"]["enabled"] is False
    assert content["axes"][0]["telegram"]["STW1"].startswith("047Eh")


def test_a_case_at_a_time(capsys):
    """The case is repeated up to the time: the axis is in motion there, and stands at the end."""
    case = "stop-modes/halt/constant"
    token = Token(case=case, seed=1, campaign=CAMPAIGN).encode()
    code, out, _ = call(capsys, "diag", "--token", token, "--at", "0.9", "--json")
    assert code == 0
    axis = json.loads(out)["axes"][0]
    assert axis["state"] in {"MOTION", "HALTING"}
    assert axis["axis status"]["enabled"] is True
    code, out, _ = call(capsys, "diag", "--token", token, "--json")
    assert json.loads(out)["axes"][0]["motion status"]["standstill"] is True


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["nowhere.toml"], "nowhere.toml"),
        (["reference", "--axis", "y"], "axis1"),
        (["--token", "nonsense"], "token"),
        (["--token", "TOKEN", "--at", "0.0001"], "ready only after"),
        (["--token", "TOKEN", "--at", "900"], "already"),
        (["--token", "GONE"], "no case"),
    ],
)
def test_what_cannot_be_shown_is_told(capsys, arguments, told):
    """Exit code 2 and a message that names it."""
    tokens = {
        "TOKEN": Token(case="stop-modes/halt/constant", seed=1, campaign=CAMPAIGN).encode(),
        "GONE": Token(case="stop-modes/none", seed=1, campaign=CAMPAIGN).encode(),
    }
    code, _, err = call(capsys, "diag", *[tokens.get(one, one) for one in arguments])
    assert code == 2
    assert told in err


@pytest.mark.requirement("DIA-100", "DIA-101")
def test_telegram_of_the_drive():
    """Sent and received words are those of the wire: control and status words, setpoint, actual speed, encoder."""
    with bench() as machine:
        axis = enabled(machine)
        axis.move_velocity(250.0)
        machine.run_for(1.0)
        words = axis.diagnosis().telegram
        slave = machine.drive().slave
        assert words["NSOLL_B"] >> 16 & 0xFFFF == slave.get(0x5801) & 0xFFFF
        assert words["ZSW1"] == axis.object.port.zsw1
        assert words["NIST_B"] / 0x4000_0000 * 3000.0 == pytest.approx(1500.0, abs=1.0)
        assert words["G1_XIST1"] == axis.object.port.encoder_increments
        assert {"ZSW2", "G1_ZSW", "G1_XIST2"} <= set(words)


def test_a_cia_402_drive_shows_the_words_that_the_axis_speaks():
    """Behind CiA 402 the axis still speaks control and status words."""
    with load_bench("reference").build(seed=1) as machine:
        assert set(machine.axis().diagnosis().telegram) == {"STW1", "ZSW1"}
