"""Defects judged by files of tests, and by what these claim."""

from __future__ import annotations

import json
import textwrap
from pathlib import Path

import pytest

from hil.cli import main
from hil.mutants._mechanical import _identifiers

pytestmark = pytest.mark.exhaustive

TESTS = """
    import pytest

    from testcases.unit.hil import toymutants as toy


    @pytest.mark.requirement("MC-001")
    def test_opens():
        assert toy.SafeBrake().open() == 1


    @pytest.mark.requirement("MC-002")
    def test_slope():
        assert toy.Brake.slope(4.0, 2.0) == 2.0
"""
DEFECTS = """
    from dataclasses import replace

    from testcases.unit.hil import toymutants as toy

    MUTANTS = [
        replace(toy.CAUGHT, name="claimed", requirements=("MC-002",), likely=()),
        replace(toy.CAUGHT, name="unclaimed", requirements=("MC-003",), likely=()),
        replace(toy.STAYS_CLOSED, requirements=("MC-001",), likely=()),
        replace(toy.SURVIVES, requirements=("MC-001",), likely=()),
    ]
"""


@pytest.mark.parametrize(
    ("judge", "noticed"),
    [("tests", {"claimed", "unclaimed", "stays-closed"}), ("marks", {"claimed", "stays-closed"})],
)
def test_files_of_tests_judge(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    judge: str,
    noticed: set[str],
) -> None:
    """A defect is noticed if a test fails; by marks only if that test claims what the changed code is for. A
    file that is not green by itself judges nothing. The catch names what the test claims.
    """
    monkeypatch.chdir(tmp_path)
    (tmp_path / "test_of_toys.py").write_text(textwrap.dedent(TESTS), "utf-8")
    (tmp_path / "test_red.py").write_text("def test_red():\n    assert False\n", "utf-8")
    (tmp_path / "defects.py").write_text(textwrap.dedent(DEFECTS), "utf-8")
    code = main(
        [
            "mutants",
            "--catalogue",
            "defects.py",
            "--judge",
            judge,
            "--campaign",
            ".",
            "--json",
            "--report",
            "out",
        ]
    )
    found = {one["name"]: one for one in json.loads(capsys.readouterr().out)}
    assert {name for name, one in found.items() if one["status"] == "caught"} == noticed
    assert code == 1
    assert found["claimed"]["broken"] == ["MC-002"]
    assert "test_slope: AssertionError: assert 0.5" in found["claimed"]["message"]
    assert found["stays-closed"]["caught_by"] == ["test_of_toys.py"]


def test_there_are_no_tests(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Outside of a checkout the command says where the tests are."""
    monkeypatch.chdir(tmp_path)
    assert main(["mutants", "--mechanical", "1", "--area", "motion.setpoint", "--judge", "tests"]) == 2
    assert "there are no test files in testcases" in capsys.readouterr().err


def test_identifiers_that_code_names() -> None:
    """One identifier, several, and those in a row."""
    assert _identifiers("As MC-064 says (MC-052 to MC-054, STP-009).") == (
        "MC-064", "MC-052", "MC-053", "MC-054", "STP-009",
    )  # fmt: skip
    assert _identifiers("16#8001, X-1 and S7-1500") == ()
