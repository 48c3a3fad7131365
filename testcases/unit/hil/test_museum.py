"""The museum of field errors: every entry is caught by its case, the page is that of the entries, the command
lists, shows and runs.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from fieldbus.errors import ConfigurationError
from hil.cli import main
from hil.museum import judge_entry, load_museum
from hil.museum.handbook import with_entries
from hil.mutants import CATALOGUE

PAGE = Path(__file__).parents[3] / "docs" / "museum" / "field-errors.md"
LEAST = 25
OF_A_DRIVE = "first-target-is-zero"


@pytest.mark.exhaustive
def test_every_entry_is_caught(subtests):
    """The case of an entry passes without its defect and fails with it, and the defect was reached."""
    for entry in load_museum().values():
        with subtests.test(entry.name):
            found = judge_entry(entry)
            assert found.caught, (found.clean, found.defective, found.reached)
            assert found.noticed


def test_every_entry_tells_its_story(subtests):
    """At least 25 published defects; each names where it is published and has all three texts."""
    museum = load_museum()
    assert len(museum) >= LEAST
    for entry in museum.values():
        with subtests.test(entry.name):
            assert all(source.url.startswith("https://") and source.who for source in entry.sources)
            assert min(map(len, (entry.happened, entry.on_the_bus, entry.found_by))) >= 40


def test_the_page_has_the_entries():
    """docs/museum/field-errors.md has the entries as they are; `python -m hil.museum.handbook` writes it."""
    text = PAGE.read_text(encoding="utf-8")
    assert with_entries(text) == text


@pytest.mark.exhaustive
def test_the_command_runs_an_entry(capsys):
    """`hil museum run` says which case has caught a defect, also one that a personality of a drive makes."""
    assert main(["museum", "run", OF_A_DRIVE, "--json"]) == 0
    captured = capsys.readouterr()
    (found,) = json.loads(captured.out)
    assert found["caught"]
    assert (found["clean"], found["defective"]) == ("passed", "failed")
    assert f"caught {OF_A_DRIVE}: cia402-modes/first-target failed" in captured.err
    assert "1 of 1 caught" in captured.err


def test_the_command_lists_and_shows(capsys):
    """`hil museum` lists all entries, `show` prints the page of one, an unknown name is told with the nearest
    one.
    """
    assert main(["museum", "--json"]) == 0
    assert [one["name"] for one in json.loads(capsys.readouterr().out)] == list(load_museum())
    assert main(["museum", "show", OF_A_DRIVE]) == 0
    shown = capsys.readouterr().out
    assert "# In csp the drive jumps to position 0" in shown
    assert "issues/125" in shown
    assert main(["museum", "show", "first-target-is-zer"]) == 2
    assert OF_A_DRIVE in capsys.readouterr().err
    assert main(["museum", "stroll"]) == 2
    assert "allowed: list, show NAME, run" in capsys.readouterr().err


@pytest.mark.exhaustive
def test_a_defect_that_nothing_notices_is_told():
    """An entry whose case stays green with the defect, or never comes to it, is not caught."""
    entry = load_museum()["modulo-move-lost"]
    unmoved = judge_entry(replace(entry, defect=CATALOGUE["encoder-overflow-jumps"]))
    assert (unmoved.defective, unmoved.reached, unmoved.caught) == ("passed", False, False)
    unnoticed = judge_entry(replace(entry, defect=CATALOGUE["velocity-after-gap"]))
    assert (unnoticed.defective, unnoticed.caught) == ("passed", False)


def test_an_entry_has_one_way_to_be_shown():
    """A seeded defect or a bench, not both and not neither; at least one source; a chapter of the museum."""
    entry = load_museum()["modulo-move-lost"]
    for change in ({"defect": None}, {"defective_bench": "reference"}, {"sources": ()}, {"area": "toys"}):
        with pytest.raises(ConfigurationError):
            replace(entry, **change)
