"""The same fault for both makes of controllers: what each makes of it is measured, stored and shown next to
each other.
"""

import json
import re

import pytest

from hil._commands.run import RunRequest, list_cases, run_campaigns
from hil.errors import CannotRunError
from reports.html.makes import side_by_side
from reports.html.payload import index_entry
from reports.store import load_run

pytestmark = pytest.mark.exhaustive


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Run three cases on both makes."""
    folder = tmp_path_factory.mktemp("compared")
    for select, report in (("stop-modes/power-", "stops"), ("drive-fault/3210/constant", "faults")):
        names = ("stop_modes",) if report == "stops" else ("fault_reactions",)
        request = RunRequest(
            paths=names,
            controllers="s7,nc",
            report=folder / report,
            select=select,
            tags=("constant",),
            history="none",
        )
        assert run_campaigns(request) == 0
    return folder


def test_facts_of_both_makes(run):
    """Alarm and error code come from the log, time and way of the stop from the machine, and going on is
    tried.
    """
    s7, nc = load_run(run / "faults").cases
    assert (s7.identifier + "@nc", s7.controller, nc.controller) == (nc.identifier, "s7", "nc")
    assert s7.reaction.code.startswith("alarm 421")
    assert s7.reaction.response == "reaction 4 (remove enable)"
    assert nc.reaction.code == "0x4650 (Drive not ready)"
    for case in (s7, nc):
        reaction = case.reaction
        assert case.verdict.value == "passed"
        assert reaction.cause == "drive.fault on drive1"
        assert reaction.velocity == pytest.approx(300.0, abs=0.5)
        assert 0.0 < reaction.delay_s <= 0.012
        # 3210h takes the torque: friction alone brakes, whatever the controller.
        assert reaction.stop_s == pytest.approx(1.214, abs=0.01)
        assert reaction.distance == pytest.approx(175.0, abs=1.0)
        assert reaction.go_on.startswith("MC_Reset; ")


def test_what_it_takes_to_go_on(run):
    """MC_Power off is a command for one make and an error for the other; what has no counterpart says why."""
    cases = {case.identifier: case for case in load_run(run / "stops").cases}
    assert cases["stop-modes/power-0/constant"].reaction.go_on == "MC_Power Enable = TRUE"
    assert cases["stop-modes/power-0/constant@nc"].reaction.go_on == "MC_Reset and MC_Power with a new edge"
    absent = cases["stop-modes/power-1/constant@nc"]
    assert absent.verdict.value == "blocked"
    assert absent.reaction is None
    assert "has no StopMode" in absent.message


def test_the_page(run):
    """Pairs that both makes have come first, with a table and curves over the same axes; nothing is drawn
    that is not a number.
    """
    shown = side_by_side(load_run(run / "stops"))
    assert [pair["both"] for pair in shown] == [True, False, False, False]
    first = shown[0]
    assert [plot["title"] for plot in first["plots"]] == [
        "Velocity of the machine",
        "Way since the cause",
        "Following error",
    ]
    for plot in first["plots"]:
        assert [line["key"] for line in plot["lines"]] == ["s7", "nc"]
        for line in plot["lines"]:
            assert re.fullmatch(r"(-?[\d.]+,-?[\d.]+ ?)+", line["points"])
    assert [make["stop"] for make in first["makes"]] == ["110 ms", "610 ms"]
    page = (run / "stops" / "report.html").read_text()
    assert 'id="view-makes"' in page
    assert "Controller enable missing" in page
    assert page.count("<polyline") == 6
    # The table of all pairs: ways and times, and by how much the second make's are longer.
    ways = [make["distance"] for make in first["makes"]]
    longer = float(ways[1].split()[0]) - float(ways[0].split()[0])
    assert first["change"]["stop"] == "+500 ms"
    assert float(first["change"]["distance"].split()[0]) == pytest.approx(longer, abs=0.011)
    assert first["change"]["much"]
    assert shown[1]["change"] == {"distance": "", "stop": "", "much": False}
    assert first["makes"][1]["number"] == "0x4356"
    for pair in shown:
        assert f'<details id="{pair["anchor"]}"' in page
        assert f'data-pair="{pair["anchor"]}"' in page
    nc = next(case for case in load_run(run / "faults").cases if case.controller == "nc")
    assert index_entry(nc)["al"] == ["0x4650 shut down without a ramp"]


def test_a_run_of_one_make_has_no_such_page(tmp_path):
    """Without makes to compare the report is as it was."""
    request = RunRequest(
        paths=("stop_modes",), select="halt/standstill", report=tmp_path, controllers="nc", history="none"
    )
    assert run_campaigns(request) == 0
    assert 'id="view-makes"' not in (tmp_path / "report.html").read_text()


def test_makes_that_there_are_not(tmp_path, capsys):
    """A wrong make is refused with those that there are; configurations take one make at a time; a bench of
    NC axes runs the NC's cases by itself and has no other make.
    """
    for makes in ("s8", "nc,nc", "s7;nc"):
        with pytest.raises(CannotRunError, match="s7, nc"):
            list_cases(RunRequest(paths=("stop_modes",), controllers=makes))
    with pytest.raises(CannotRunError, match="one make at a time"):
        list_cases(RunRequest(paths=("stop_modes",), controllers="s7,nc", configurations="pairwise:1"))
    bench = tmp_path / "nc.toml"
    bench.write_text(
        '[bench]\nname = "x"\nkind = "virtual"\n[segment.can0]\nbitrate = 1_000_000\n[drive.d]\n'
        'segment = "can0"\nnode_id = 5\n[axis.x]\ncontroller = "nc"\ndrive = "d"\n'
    )
    with pytest.raises(CannotRunError, match="technology objects"):
        list_cases(RunRequest(paths=("stop_modes",), controllers="s7,nc", bench=str(bench)))
    capsys.readouterr()
    assert list_cases(RunRequest(paths=("stop_modes",), bench=str(bench), as_json=True)) == 0
    assert all(case["identifier"].endswith("@nc") for case in json.loads(capsys.readouterr().out))
