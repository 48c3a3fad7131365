"""What a search does with what it has seen: situations, descendants, a corpus, several processes, regression
cases.
"""

import importlib
import json

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.bench import load_bench
from hil.campaign import CaseSettings, Token, execute_case, load_campaign
from hil.cli import main
from hil.errors import CannotRunError
from hil.faults import Fault
from hil.fuzz import (
    Break,
    Corpus,
    Do,
    Program,
    Wait,
    by_family,
    keep_program,
    program_token,
    regressions,
    run_program,
    search,
    situations_of,
)
from hil.fuzz._situations import FAMILIES
from hil.fuzz._strategies import descendants
from reports.model import Verdict
from testcases.unit.hil.toybench import BENCH, DOUBLE, found_defect

pytestmark = pytest.mark.exhaustive

DOUBLE_NAME = "testcases.unit.hil.toybench:DOUBLE"
BENCH_NAME = "testcases.unit.hil.toybench:BENCH"
MOVE = Program((Do("power_on"), Wait(0.3), Do("move_velocity", {"velocity": 100.0}), Wait(0.2)))
TRIP = Program((*MOVE.steps, Break(Fault("drive.fault", parameters={"code": 0x2310})), Wait(0.4)))


# -- situations
# -----------------------------------------------------------------------------------------------------


def test_situations_tell_what_came_together():
    """States, instructions, faults and alarms are reported with the state of the axis in which they came."""
    reached = situations_of(run_program(TRIP, BENCH).trace)
    assert {situation[0] for situation in reached} <= set(FAMILIES)
    assert ("job", "MC_MoveVelocity", "STANDSTILL") in reached
    assert ("fault", "drive.fault", "MOTION") in reached
    assert any(
        situation[:3] == ("alarm", "421", "4") and situation[-1] == "drive.fault" for situation in reached
    )
    assert reached > situations_of(run_program(MOVE, BENCH).trace)
    assert sum(by_family(reached).values()) == len(reached)


def test_a_second_alarm_and_a_refused_job_are_situations():
    """An alarm together with another, and an ErrorID, count on their own."""
    both = Program(
        (
            *MOVE.steps,
            Break(Fault("axis.alarm", parameters={"number": 421, "reaction": 4})),
            Break(Fault("axis.alarm", parameters={"number": 521, "reaction": 4})),
            Wait(0.1),
            Do("move_velocity", {"velocity": 10.0}),
        )
    )
    reached = situations_of(run_program(both, load_bench("reference")).trace)
    assert ("together", "521", "421") in reached
    assert any(situation[:2] == ("refused", "MC_MoveVelocity") for situation in reached)


# -- descendants
# ----------------------------------------------------------------------------------------------------


@settings(max_examples=200)
@given(st.data())
def test_descendants_are_programs_of_bounded_length(data):
    """Whatever is left out, put in, repeated, swapped or joined: steps of the parents and of the strategy,
    not too many.
    """
    step = st.just(Do("halt"))
    child = data.draw(descendants([MOVE, TRIP], step, longest=5))
    assert 1 <= len(child.steps) <= 5
    assert all(one in TRIP.steps or one == Do("halt") for one in child.steps)


# -- corpus
# ---------------------------------------------------------------------------------------------------------


def test_a_search_goes_on_from_its_corpus(tmp_path):
    """What reached something new is kept; the next search runs it first and knows what it had reached."""
    folder = tmp_path / "corpus"
    first = search(BENCH, cases=16, seed=1, on_new=Corpus(folder).keep)
    corpus = Corpus(folder)
    assert 0 < len(corpus.programs) <= 16
    again = search(BENCH, cases=len(corpus.programs), seed=1, parents=corpus.programs)
    assert again.reached == first.reached
    assert again.known == len(again.reached)
    more = search(BENCH, cases=32, seed=2, parents=corpus.programs)
    # other benches, of another seed: what these programs reach there
    there = search(BENCH, cases=len(corpus.programs), seed=2, parents=corpus.programs)
    assert more.known == len(there.reached)
    assert more.reached > there.reached


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{", "cannot be read as a program"),
        ("3", "is no program: program: 3"),
        ('[{"do": "dance"}]', "dance.*power_on"),
    ],
)
def test_a_wrong_file_in_the_corpus_is_named(tmp_path, text, words):
    """A file that is no program is not passed over in silence."""
    (tmp_path / "wrong.json").write_text(text, encoding="utf-8")
    with pytest.raises(CannotRunError, match=f"wrong.json.*{words}"):
        Corpus(tmp_path)
    with pytest.raises(CannotRunError, match="no folder"):
        Corpus(tmp_path / "wrong.json")


def test_a_failing_program_of_the_corpus_is_found_at_once_and_shrunk():
    """A program that was sound once and is not any more is the first finding, without the steps that do not
    matter.
    """
    trip = Break(Fault("drive.sto", duration_s=0.02))
    long = Program((Do("power_on"), Wait(0.3), Wait(0.02), trip, Do("stop"), Wait(0.1), Do("halt")))
    report = search(DOUBLE, cases=50, parents=[MOVE, long], bench=DOUBLE_NAME)
    assert report.cases == 2
    assert report.failure.violation.invariant == "one job output"
    assert len(report.failure.program.steps) < len(long.steps)


# -- processes
# ------------------------------------------------------------------------------------------------------


def test_the_number_of_processes_changes_nothing(tmp_path, monkeypatch):
    """The same programs, situations and finding, from one process and from two; whatever modules this one has
    loaded.
    """
    (tmp_path / "many_constants.py").write_text(f"NUMBERS = {list(range(2000))}", encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    importlib.import_module("many_constants")
    one = search(BENCH, cases=30, seed=4, bench=BENCH_NAME)
    two = search(BENCH, cases=30, seed=4, bench=BENCH_NAME, jobs=2)
    assert (two.cases, two.reached, two.never) == (one.cases, one.reached, one.never)
    with pytest.raises(CannotRunError, match="reference of its bench"):
        search(BENCH, cases=30, jobs=2)
    with pytest.raises(CannotRunError, match="1 or more"):
        search(BENCH, cases=30, jobs=0)


# -- regression cases
# -----------------------------------------------------------------------------------------------


def test_a_finding_becomes_a_case_by_one_command(tmp_path, capsys, monkeypatch):
    """`hil keep` writes program and campaign; `hil run` fails on the defect and passes where there is
    none.
    """
    monkeypatch.chdir(tmp_path)
    found = found_defect()
    assert main(["keep", found.token, "--title", "Done and Error together", "--json"]) == 0
    kept = json.loads(capsys.readouterr().out)
    assert not kept["passes"]
    assert "one job output" in kept["message"]
    campaign = load_campaign(str(tmp_path / "regressions" / "regressions.py") + ":CAMPAIGN")
    (case,) = campaign.cases
    assert (case.title, case.bench, case.seed) == ("Done and Error together", DOUBLE_NAME, 2)
    assert main(["run", "regressions/regressions.py", "--json"]) == 1
    failed = execute_case(case, DOUBLE, CaseSettings(seed=case.seed)).result
    assert failed.verdict is Verdict.FAILED
    assert failed.message.startswith("one job output broken at")
    sound = execute_case(case, BENCH, CaseSettings(seed=case.seed)).result
    assert sound.verdict is Verdict.PASSED
    assert {check.name for check in sound.checks} >= {"one job output", "rest of axis1 after an alarm"}


def test_only_programs_are_kept(tmp_path):
    """The token of a case is refused: the case is in its campaign."""
    token = Token("stop-modes/halt", 1, "testcases.campaigns.stop_modes", "reference", "")
    with pytest.raises(CannotRunError, match="stop_modes"):
        keep_program(token, tmp_path, "")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"seed": "one"}, "seed is 'one', but has to be of type int"),
        ({"program": [{"do": "dance"}]}, "dance"),
        ({"note": ""}, "an object with title, bench, seed, program"),
    ],
)
def test_a_wrong_regression_is_named(tmp_path, change, words):
    """File and key stand in the message."""
    token = Token.decode(program_token(MOVE, seed=3, bench=BENCH_NAME))
    file = keep_program(token, tmp_path, "moves")
    assert len(regressions(tmp_path)) == 1
    file.write_text(json.dumps({**json.loads(file.read_text()), **change}), encoding="utf-8")
    with pytest.raises(CannotRunError, match=f"{file.name}.*{words}"):
        regressions(tmp_path)
