"""Catalogues of requirements of the user's own: CSV, ReqIF, report, `hil requirements`."""

import json

import pytest

from hil._own_catalogue import load_catalogue
from hil._requirements import complete, own_requirements
from hil.cli import main
from hil.errors import CannotRunError
from reports.coverage import family_of, prefix_totals, requirement_matrix
from testcases.sample_run import sample_run

pytest_plugins = ["pytester"]

CSV = 'Identifier;Title;Section\nMC-12;The door stops every axis;Door\n\nMC-13;"It stays; where it is";Door\n'
DAY = 'LAST-CHANGE="2026-01-01T00:00:00Z"'


def _definition(number, name):
    kind = "ATTRIBUTE-DEFINITION-STRING"
    reference = "<DATATYPE-DEFINITION-STRING-REF>s</DATATYPE-DEFINITION-STRING-REF>"
    return f'<{kind} IDENTIFIER="a{number}" {DAY} LONG-NAME="{name}"><TYPE>{reference}</TYPE></{kind}>'


def _object(name, values):
    texts = "".join(
        f'<ATTRIBUTE-VALUE-STRING THE-VALUE="{value}"><DEFINITION>'
        f"<ATTRIBUTE-DEFINITION-STRING-REF>{attribute}</ATTRIBUTE-DEFINITION-STRING-REF></DEFINITION></ATTRIBUTE-VALUE-STRING>"
        for attribute, value in values.items()
    )
    kind = "<TYPE><SPEC-OBJECT-TYPE-REF>type</SPEC-OBJECT-TYPE-REF></TYPE>"
    return f'<SPEC-OBJECT IDENTIFIER="{name}" {DAY}>{kind}<VALUES>{texts}</VALUES></SPEC-OBJECT>'


def _node(name, below=""):
    reference = f"<OBJECT><SPEC-OBJECT-REF>{name}</SPEC-OBJECT-REF></OBJECT>"
    children = f"<CHILDREN>{below}</CHILDREN>" if below else ""
    return f'<SPEC-HIERARCHY IDENTIFIER="h-{name}" {DAY}>{reference}{children}</SPEC-HIERARCHY>'


REQIF = f"""<?xml version="1.0" encoding="UTF-8"?>
<REQ-IF xmlns="http://www.omg.org/spec/ReqIF/20110401/reqif.xsd">
<THE-HEADER><REQ-IF-HEADER IDENTIFIER="h"><CREATION-TIME>2026-01-01T00:00:00Z</CREATION-TIME>
<REQ-IF-TOOL-ID>t</REQ-IF-TOOL-ID><REQ-IF-VERSION>1.0</REQ-IF-VERSION><SOURCE-TOOL-ID>t</SOURCE-TOOL-ID>
<TITLE>x</TITLE></REQ-IF-HEADER></THE-HEADER>
<CORE-CONTENT><REQ-IF-CONTENT>
<DATATYPES><DATATYPE-DEFINITION-STRING IDENTIFIER="s" {DAY} LONG-NAME="S" MAX-LENGTH="999"/></DATATYPES>
<SPEC-TYPES><SPEC-OBJECT-TYPE IDENTIFIER="type" {DAY} LONG-NAME="Requirement"><SPEC-ATTRIBUTES>
{_definition(1, "ReqIF.ForeignID")}{_definition(2, "ReqIF.Name")}{_definition(3, "ReqIF.ChapterName")}
</SPEC-ATTRIBUTES></SPEC-OBJECT-TYPE><SPECIFICATION-TYPE IDENTIFIER="st" {DAY} LONG-NAME="Spec"/></SPEC-TYPES>
<SPEC-OBJECTS>{_object("o0", {"a3": "Door"})}
{_object("o1", {"a1": "MC-12", "a2": "The door stops every axis"})}</SPEC-OBJECTS>
<SPECIFICATIONS><SPECIFICATION IDENTIFIER="sp" {DAY} LONG-NAME="x">
<TYPE><SPECIFICATION-TYPE-REF>st</SPECIFICATION-TYPE-REF></TYPE>
<CHILDREN>{_node("o0", _node("o1"))}</CHILDREN></SPECIFICATION></SPECIFICATIONS>
</REQ-IF-CONTENT></CORE-CONTENT></REQ-IF>
"""


def test_a_csv_file_is_read_by_the_names_of_its_columns(tmp_path):
    """Comma, semicolon or tab, quotes, empty lines and capital letters are as spreadsheets write them."""
    path = tmp_path / "own.csv"
    path.write_text(CSV, encoding="utf-8-sig")
    assert [tuple(one) for one in load_catalogue(path)] == [
        ("MC-12", "The door stops every axis", "Door"),
        ("MC-13", "It stays; where it is", "Door"),
    ]
    path.write_text("id\nR1\nR2\n")
    assert [one.identifier for one in load_catalogue(path)] == ["R1", "R2"]


def test_a_reqif_file_gives_its_objects_and_headings(tmp_path):
    """Objects keep the order of the specification; a heading is the section of what is below it."""
    path = tmp_path / "own.reqif"
    path.write_text(REQIF)
    assert [tuple(one) for one in load_catalogue(path)] == [("MC-12", "The door stops every axis", "Door")]


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("own.csv", "number,title\n1,x\n", "line 1: no column has the identifiers; allowed: identifier, id"),
        ("own.csv", "id,title\nA-1,x\nA-1,y\n", "line 3: 'A-1' is in line 2 already"),
        ("own.csv", "id,title\n,x\n", "line 2: the identifier is empty"),
        ("own.csv", "id,title\n", "there is no requirement in it"),
        ("own.txt", "id\nA-1\n", "a file *.csv or *.reqif"),
        ("own.reqif", "<REQ-IF>", "this is no ReqIF file"),
        ("own.reqif", '<!DOCTYPE a [<!ENTITY b "c">]><REQ-IF/>', "no document type and no entities"),
    ],
)
def test_a_catalogue_that_cannot_be_used_is_refused_with_file_and_line(tmp_path, name, text, words):
    """The message names the file, the place in it, and what is wrong."""
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(CannotRunError) as caught:
        load_catalogue(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert words in str(caught.value)


@pytest.mark.exhaustive
def test_own_requirements_lead_the_report(tmp_path):
    """They come first in matrix and totals, and count as known; families that no case touches are folded."""
    path = tmp_path / "own.csv"
    path.write_text("id,title\nZZ-2,Own\nZZ-1,Own too\n")
    run = sample_run()
    run.cases[0].requirements.append("ZZ-2")
    complete(run, own_requirements(path))
    rows = requirement_matrix(run)
    assert [(row.identifier, row.known, row.own) for row in rows[:2]] == [
        ("ZZ-2", True, True),
        ("ZZ-1", True, True),
    ]
    totals = prefix_totals(rows)
    assert (totals[0].prefix, totals[0].own, totals[0].known) == ("ZZ", True, 2)
    assert {total.touched for total in totals[1:]} == {True, False}
    assert [family_of(one) for one in ("STP-303", "R12", "SYS.3", "door")] == ["STP", "R", "SYS", "door"]


@pytest.mark.exhaustive
def test_the_command_lists_own_families_first_and_folds_the_others(pytester, capsys):
    """`hil requirements --catalogue` after pytest: covered ones of the user, the rest in one line."""
    pytester.makepyfile(
        test_door='import pytest\n\n@pytest.mark.requirement("DOOR-12")\ndef test_door():\n    """Stops."""\n'
    )
    (pytester.path / "own.csv").write_text(CSV.replace("MC", "DOOR"))
    pytester.runpytest_inprocess("-p", "no:cacheprovider").assert_outcomes(passed=1)
    capsys.readouterr()
    assert main(["requirements", "--catalogue", "own.csv"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split() == ["DOOR", "1", "of", "2", "50.0", "%"]
    assert "families of the product, of which nothing is covered" in lines[1]
    assert main(["requirements", "--catalogue", "own.csv", "--prefix", "DOOR", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {
        "prefixes": {"DOOR": {"total": 2, "covered": 1}},
        "uncovered": ["DOOR-13"],
    }
    assert main(["run", "stop_modes", "--catalogue", "none.csv"]) == 2
    assert "none.csv: cannot be read" in capsys.readouterr().err


@pytest.mark.exhaustive
def test_pytest_refuses_a_wrong_catalogue_before_any_test(pytester):
    """The mistake is one line with file and place, and nothing runs, with option and setting alike."""
    pytester.makepyfile("def test_nothing(bench):\n    raise AssertionError('ran')\n")
    (pytester.path / "own.csv").write_text("number,title\n1,x\n")
    pytester.makeini("[pytest]\nhil_catalogue = own.csv\n")
    for option in ((), ("--hil-catalogue", "own.csv")):
        done = pytester.runpytest_inprocess("-p", "no:cacheprovider", "--hil-report", "report", *option)
        assert done.ret == pytest.ExitCode.USAGE_ERROR
        done.stderr.fnmatch_lines(["*own.csv: line 1: no column has the identifiers*"])
        done.stdout.no_fnmatch_line("*ran*")
