"""`hil init`: a bench and a test of one's own."""

import pytest

from hil._commands.init import BUSES, ask
from hil.bench import load_bench
from hil.bench.rules import findings
from hil.cli import main

pytest_plugins = ["pytester"]


@pytest.mark.exhaustive
def test_every_drive_and_bus_makes_a_bench_that_keeps_the_rules(tmp_path, capsys, subtests):
    """Whatever is chosen, `hil check` has nothing to say about it."""
    for drive, buses in BUSES.items():
        for bus in buses:
            with subtests.test(f"{drive} on {bus}"):
                folder = tmp_path / drive / bus
                assert main(["init", str(folder), "--axis", "x", "--axis", f"z={drive}/{bus}"]) == 0
                assert findings(load_bench(folder / "bench.toml").config) == []
                assert main(["check", str(folder / "bench.toml")]) == 0
                capsys.readouterr()


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    "axes",
    [[], ["x", "z=profidrive/modbus_tcp"], ["s=tm_pto", "a=analog"], ["x", "z=profidrive/modbus_rtu"]],
    ids=" ".join,
)
def test_what_is_written_passes_at_once(pytester, axes):
    """The test passes on the bench, from another folder as well."""
    folder = pytester.mkdir("machine")
    assert main(["init", str(folder), *(word for axis in axes for word in ("--axis", axis))]) == 0
    result = pytester.runpytest_inprocess("-p", "no:cacheprovider", str(folder))
    result.assert_outcomes(passed=2 * max(1, len(axes)))


def test_nothing_is_overwritten(tmp_path, capsys):
    """A file that is there already stays, and the other one is not written."""
    test = tmp_path / "test_bench.py"
    test.write_text("mine")
    assert main(["init", str(tmp_path), "--axis", "x"]) == 2
    assert "test_bench.py is there already" in capsys.readouterr().err
    assert test.read_text() == "mine"
    assert not (tmp_path / "bench.toml").exists()


@pytest.mark.parametrize(
    ("axes", "words"),
    [
        (["z=profidrve"], "'profidrve' is not a profile of a drive; similar: profidrive"),
        (["z=cia402/modbus_tcp"], "'modbus_tcp' is not a bus of cia402; allowed: can"),
        (["9z"], "allowed: NAME, NAME=DRIVE or NAME=DRIVE/BUS"),
        (["x", "x"], "each name once"),
        (["can0"], "axis.can0: a segment has this name already"),
    ],
)
def test_wishes_that_cannot_be(tmp_path, capsys, axes, words):
    """Nothing is written, and the message says what there is."""
    folder = tmp_path / "machine"
    assert main(["init", str(folder), *(word for axis in axes for word in ("--axis", axis))]) == 2
    assert words in capsys.readouterr().err
    assert not folder.exists()


def test_questions():
    """Who is asked names the axes, and for each a drive, and a bus where there are several."""
    answers = iter(["x, z", "cia402", "profidrive", "modbus_rtu"])
    asked = []

    def answer(question, default):
        asked.append((question, default))
        return next(answers)

    wishes = ask(answer)
    assert [(one.name, one.drive, one.bus) for one in wishes] == [
        ("x", "cia402", "can"),
        ("z", "profidrive", "modbus_rtu"),
    ]
    assert len(asked) == 4
