"""`hil qualify`: page and ReqIF file of one run, with what is not claimed and what is left open."""

from __future__ import annotations

import io
import json
from contextlib import redirect_stdout
from pathlib import Path

import pytest
from reqif.cli.cli_arg_parser import ValidateCommandConfig
from reqif.commands.validate.validate import ValidateCommand

from hil._own_catalogue import load_catalogue
from hil.campaign import Token
from hil.cli import main
from hil.mutants import Judge, Seeder, SeedingOptions
from reports.coverage import RequirementRow
from reports.errors import ReportError
from reports.model import PRODUCT_DIGEST, CaseResult, Check, RequirementInfo, RunResult, Verdict
from reports.qualification import NOT_CLAIMED, load_peers
from reports.reqif import write_reqif
from reports.store import load_run, save_run

TIME = "2026-11-27T22:00:00+00:00"
ODD = 'braking < 12 mm & "no" jerk, Straße'


def _case(name: str, verdict: Verdict, *requirements: str) -> CaseResult:
    check = Check("stops", verdict, "at rest", "at rest", requirements=list(requirements))
    case = CaseResult(name, name, verdict, "group", checks=[check], requirements=list(requirements))
    case.trace_digest, case.message = f"digest of {name}", f"why {name}"
    return case


@pytest.fixture
def folder(tmp_path) -> Path:
    """A run of a passed, a failed and a blocked case."""
    environment = {"python": "3.11", PRODUCT_DIGEST: "state of the run"}
    run = RunResult("Stops", 7, "our bench", "[bench]\n", environment, TIME)
    run.requirements = [RequirementInfo("STP-001", ODD, "1", "spec")]
    run.cases = [
        _case("stops/one", Verdict.PASSED, "STP-001"),
        _case("stops/two", Verdict.FAILED, "STP-014"),
        _case("stops/three", Verdict.BLOCKED),
    ]
    one = Token("stops/one", 7, "our.campaign:STOPS", "our other bench", "digest of the other bench")
    run.cases[0].token = one.encode()
    save_run(tmp_path / "run", run)
    return tmp_path / "run"


def test_the_page_says_what_is_there_and_what_is_not(folder, tmp_path, capsys):
    """Versions, digests, cases, clauses and defects with who caught them are on the page, in front of it what
    it does not claim; what is left open is said on the page and by the command, which ends with 1.
    """
    defects = [
        {
            "name": "off2-as-off3",
            "title": "brakes",
            "status": "caught",
            "caught_by": ["stops/one"],
            "how": "failed",
            "message": "it never stopped",
            "broken": ["STP-002"],
            "changes": [{"target": "motion.x:stop", "old": "a < b", "new": "a > b"}],
        },
        {"name": "late", "title": "one late", "status": "survived", "caught_by": []},
    ]
    (tmp_path / "drawn").mkdir()
    about = {"mutants": defects, "seed": 4711, "baseline_cases": 12, "product": "of another state"}
    about["baseline_left_out"] = 3
    (tmp_path / "drawn" / "mutants.json").write_text(json.dumps(about))
    peers = tmp_path / "peers.xml"
    peers.write_text(
        '<testsuites><testsuite><testcase classname="testcases.peers.test_edcon" name="a">'
        '<properties><property name="software" value="festo-edcon 0.9"/></properties></testcase>'
        '<testcase classname="testcases.peers.test_edcon" name="b"><skipped/></testcase>'
        '<testcase classname="testcases.peers.test_mbpoll" name="c"><failure/></testcase>'
        "</testsuite></testsuites>"
    )
    arguments = ["--mechanical", str(tmp_path / "drawn"), "--peers", str(peers), "--no-reqif", "--json"]
    assert main(["qualify", str(folder), *arguments]) == 1
    captured = capsys.readouterr()
    found = json.loads(captured.out)
    page = Path(found["page"]).read_text(encoding="utf-8")
    left = [
        "1 cases were blocked: the bench could not do what they need.",
        "1 cases have failed or ended with an error.",
        "Defects drawn from the source: 1 of 2 were not noticed.",
        "test_mbpoll: 1 tests have failed.",
        "test_edcon: 1 tests were left out.",
        "Defects drawn from the source: 3 cases judged nothing, their time was used up.",
        "test_mbpoll: the version of its software is not recorded.",
        "Defects drawn from the source: they were not put into the product that the run was made with.",
        "The product has changed since the run: the digests of its packages are not those of the run.",
    ]
    assert [text for text in left if text not in found["open"] or text not in page] == []
    assert all(f"open: {text}" in captured.err for text in found["open"])
    assert (found["reqif"], found["not_passed"]) == ("", 2)
    shown = ["3.11", "digest of stops/one", "why stops/two", "off2-as-off3", "survived", "SHA-256 of motion"]
    shown += [
        "test_mbpoll",
        found["trace_digest"],
        "STP-001",
        "festo-edcon 0.9",
        "12 cases judged",
        "Seed 4711",
    ]
    shown += [
        "failed (STP-002): it never stopped",
        "motion.x:stop: a &lt; b -&gt; a &gt; b",
        "state of the run",
    ]
    shown += ["our.campaign:STOPS", "our other bench", "digest of the other bench", "not those of the run"]
    shown += ["Known limits of the tool", "elasticity of the drive train"]
    assert [text for text in shown if text not in page] == []
    places = [page.index(text[:40]) for text in NOT_CLAIMED]
    assert max(places) < page.index("digest of stops/one")
    assert "<script" not in page


def test_missing_results_are_told(folder, tmp_path, capsys):
    """A folder without results of defects, and a file that is no JUnit file, are said by name; without any
    the page says that nothing shows that a case can be red.
    """
    assert main(["qualify", str(folder), "--mutants", str(tmp_path), "--no-reqif"]) == 2
    assert "is no report folder of `hil mutants --report`" in capsys.readouterr().err
    (tmp_path / "no.xml").write_text("<testsuite>")
    assert main(["qualify", str(folder), "--peers", str(tmp_path / "no.xml"), "--no-reqif"]) == 2
    assert "this is no JUnit file" in capsys.readouterr().err
    (tmp_path / "odd.xml").write_text('<!DOCTYPE a [<!ENTITY b "c">]><a/>')
    with pytest.raises(ReportError, match="entities"):
        load_peers(tmp_path / "odd.xml")
    (tmp_path / "begun").mkdir()
    (tmp_path / "begun" / "mutants.json").write_text('{"mutants": [], "interrupted": true}')
    assert main(["qualify", str(folder), "--mutants", str(tmp_path / "begun"), "--no-reqif"]) == 1
    told = capsys.readouterr().err
    assert "Seeded defects: none was judged" in told
    assert "Seeded defects: the run was interrupted" in told
    assert main(["qualify", str(folder), "--no-reqif"]) == 1
    assert "nothing shows that a case can be red" in capsys.readouterr().err


def test_the_reqif_file_is_valid_and_can_be_read_again(tmp_path):
    """It keeps to the schema of the OMG and to its own references; identifiers and clauses come back as they
    were, whatever signs they have.
    """
    rows = [
        RequirementRow("STP-001", ODD, "1", "spec", True, [("stops/one", Verdict.PASSED)]),
        RequirementRow("our rule/7 ü", "", "", "", False, []),
    ]
    path = write_reqif(rows, tmp_path / "out.reqif", title="A & B", time=TIME, tool="motion-hil 1")
    with redirect_stdout(io.StringIO()) as said, pytest.raises(SystemExit) as ended:
        ValidateCommand.execute(ValidateCommandConfig(str(path), use_reqif_schema=True))
    assert ended.value.code == 0, said.getvalue()
    assert [(one.identifier, one.title) for one in load_catalogue(path)] == [
        ("STP-001", ODD),
        ("our rule/7 ü", ""),
    ]
    text = path.read_text(encoding="utf-8")
    assert 'THE-VALUE="stops/one: passed"' in text
    assert 'THE-VALUE="not tested"' in text


def test_a_run_and_its_defects_say_which_product_they_are_of(tmp_path, monkeypatch, capsys):
    """A run of this product, and defects that were seeded into it, are not said to be of another."""
    monkeypatch.chdir(tmp_path)
    assert main(["run", "testcases.campaigns.canopen_services", "-k", "expedited-1", "--report", "run"]) == 0
    defect = {"name": "late", "status": "caught", "caught_by": ["one"]}
    digest = load_run("run").environment[PRODUCT_DIGEST]
    Path("run", "mutants.json").write_text(json.dumps({"mutants": [defect], "product": digest}))
    capsys.readouterr()
    main(["qualify", "run", "--no-reqif", "--json"])
    found = json.loads(capsys.readouterr().out)
    assert [text for text in found["open"] if "product" in text] == []
    page = Path(found["page"]).read_text(encoding="utf-8")
    assert page.count(digest) == 2
    assert "testcases.campaigns.canopen_services:" in page
    assert Seeder([], [Judge("a", "b", "")], SeedingOptions()).so_far().as_dict()["product"] == digest
