"""Defect seeding: patches that are made and undone, cases in order, fates of defects, the command."""

import inspect
import json
from dataclasses import replace
from xml.etree import ElementTree as ET

import pytest

from fieldbus.clock import RealtimeScheduler
from fieldbus.errors import ConfigurationError
from hil.cli import main
from hil.mutants import Edit, Judge, Mutant, TargetChangedError, find_judges, in_order, seeded, watched
from testcases.unit.hil import toymutants as toy

TOY = "testcases.unit.hil.toymutants"


def call(capsys, *arguments):
    code = main(["mutants", *(str(argument) for argument in arguments)])
    captured = capsys.readouterr()
    return code, captured.out, captured.err


# -- patches
# -----------------------------------------------------------------------------------------------------------


def seen():
    """Return what the toy product answers."""
    brake = toy.SafeBrake()
    return brake.open(), brake.holds, toy.Brake.slope(4.0, 2.0), toy.twice(3)


@pytest.mark.parametrize(
    ("mutant", "answers"),
    [
        (toy.CAUGHT, (1, False, 0.5, 6)),
        (toy.STAYS_CLOSED, (0, True, 2.0, 6)),
        (toy.BRANCH, (2, False, 2.0, 6)),
        (toy.PROPERTY, (1, True, 2.0, 6)),
        (toy.CLOSURE, (1, False, 2.0, 5)),
    ],
    ids=lambda value: value.name if isinstance(value, Mutant) else "",
)
def test_a_defect_is_in_force_inside_and_gone_outside(mutant, answers):
    """Static methods, properties, `super()`, branches and closures: the change acts, tells that it is
    reached, and is undone.
    """
    reached = set()
    held = toy.twice  # what is held before the change has it too
    with seeded(mutant, reached):
        assert reached == set()
        assert seen() == answers
        assert reached == {mutant.name}
        assert held(3) == answers[3]
    assert seen() == (1, False, 2.0, 6)
    assert "__mutant_reached__" not in vars(toy)


def test_watching_changes_nothing():
    """Places of several defects of one function tell that they are reached, and the function does what it
    did.
    """
    reached = set()
    with watched([toy.STAYS_CLOSED, toy.SURVIVES, toy.BRANCH, toy.UNREACHED], reached):
        assert seen() == (1, False, 2.0, 6)
        assert reached == {"stays-closed", "survives", "branch"}
        reached.clear()
        brake = toy.SafeBrake()
        brake.closed = False
        assert brake.open() == 0
        assert reached == set(), "the changed branch was not taken"


def test_a_defect_is_undone_when_a_case_raises():
    """An exception takes the change back as well."""
    with pytest.raises(NameError), seeded(toy.RAISES, set()):
        toy.count(1)
    assert toy.count(1) == 1


@pytest.mark.parametrize(
    ("target", "old", "new", "words"),
    [
        (f"{TOY}:count", "done += 7", "done += 8", "0 times, not once"),
        (f"{TOY}:count", "done", "undone", "times, not once"),
        (f"{TOY}:counting_down", "done", "undone", "counting_down"),
        (f"{TOY}:Brake", "closed", "open", "not a function"),
        ("testcases.unit.hil.nowhere:count", "done", "undone", "nowhere"),
        (f"{TOY}:count", "done += 1", "done +=", "cannot be compiled"),
        (f"{TOY}:count", "def count(steps):", "def count(steps=1):", "in no statement"),
        (f"{TOY}:twice", "value * factor", "value * 2", "other variables from outside"),
    ],
)
@pytest.mark.parametrize(
    "act", [seeded, lambda mutant, reached: watched([mutant], reached)], ids=["seed", "watch"]
)
def test_a_change_of_the_product_is_noticed(act, target, old, new, words):
    """A target that is gone, or does not read as the catalogue says, ends in an error that names both."""
    mutant = Mutant("x", "machine", "x", (Edit(target, old, new),))
    with pytest.raises(TargetChangedError, match=words), act(mutant, set()):
        pass


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"area": "kitchen"}, "area"),
        ({"edits": ()}, "at least one"),
        ({"edits": (Edit("m:f", "a", "a"),)}, "else than"),
    ],
)
def test_a_wrong_entry_of_a_catalogue_is_refused(change, words):
    """Area and changes of a mutant are checked when it is made."""
    with pytest.raises(ConfigurationError, match=words):
        replace(toy.CAUGHT, **change)


# -- order
# ------------------------------------------------------------------------------------------------------------


def test_likely_cases_come_first_and_the_quick_ones_of_the_rest():
    """Order: patterns of the catalogue as they stand there, then by time; cases that do not get there are
    left out.
    """
    one, two, three, four = (Judge(f"c/{name}", "m:C", "b") for name in ("one", "two", "three", "four"))
    reached = {judge: frozenset({"x"}) for judge in (one, two, three)}
    mutant = replace(toy.CAUGHT, name="x", likely=("c/thr*@b", "c/*@other"))
    order = in_order(mutant, [one, two, three, four], reached, {one: 2.0, two: 1.0, three: 9.0, four: 0.1})
    assert order == [three, two, one]


def test_a_campaign_is_judged_on_the_bench_given_with_it():
    """`module@bench` runs all cases there, without it each on the bench it is written for."""
    own = find_judges([f"{TOY}:CAMPAIGN".partition(":")[0]])
    assert {judge.bench for judge in own} == {toy.BENCH}
    given = find_judges([f"{TOY}@reference"])
    assert {judge.name for judge in given} >= {"toy-product/brake@reference"}


# -- the command
# -------------------------------------------------------------------------------------------------------


@pytest.fixture
def green(monkeypatch, tmp_path):
    """A campaign without its red sister, importable in worker processes."""
    (tmp_path / "green.py").write_text(f"from {TOY} import CAMPAIGN\n")
    monkeypatch.chdir(tmp_path)
    return "green.py"


@pytest.mark.exhaustive
def test_every_defect_caught(capsys, green, tmp_path):
    """All caught: exit code 0, a JSON list with name, cases and time, and the table in the report folder."""
    code, out, err = call(
        capsys, "--catalogue", f"{TOY}:MUTANTS", "--campaign", green, "--jobs", 2, "--json", "--report", "rep"
    )
    assert code == 0, err
    found = json.loads(out)
    assert [entry["name"] for entry in found] == [mutant.name for mutant in toy.MUTANTS]
    for entry in found:
        assert isinstance(entry["caught_by"], list)
        assert len(entry["caught_by"]) == 1
        assert entry["seconds"] > 0.0
        assert entry["status"] == "caught"
    by_name = {entry["name"]: entry for entry in found}
    assert by_name["slope-inverted"]["caught_by"] == [f"toy-product/slope@{toy.BENCH}"]
    assert by_name["slope-inverted"]["how"] == "failed"
    assert by_name["raises"]["how"] == "error"
    assert "6 of 6 caught" in err
    stored = json.loads((tmp_path / "rep" / "mutants.json").read_text())
    assert stored["mutants"] == found
    assert (stored["caught"], stored["survived"], stored["baseline_cases"]) == (6, 0, 3)
    table = (tmp_path / "rep" / "mutants.md").read_text()
    assert all(f"`{mutant.name}`" in table for mutant in toy.MUTANTS)
    assert "slope-inverted" in (tmp_path / "rep" / "mutants.html").read_text()


@pytest.mark.exhaustive
def test_what_cases_come_to_is_kept(capsys, green, tmp_path):
    """A second run measures no case that no catch rests on; a changed campaign is measured again."""
    arguments = ["survives", "--catalogue", f"{TOY}:FATES", "--campaign", green]
    for measured, text in ((3, ""), (0, ""), (3, "# changed\n")):
        with (tmp_path / "green.py").open("a") as file:
            file.write(text)
        code, _, err = call(capsys, *arguments)
        assert (code, f"baseline: 3 cases green, {measured} of them run" in err) == (1, True), err
    code, _, err = call(capsys, "slope-inverted", *arguments[1:])
    assert (code, "1 of them run" in err) == (0, True), "the case that caught it ran without it, too"
    (tmp_path / ".hil" / "coverage.jsonl").write_text("[]\n")
    code, _, err = call(capsys, *arguments)
    assert (code, "keeps no coverage of cases" in err) == (2, True)


@pytest.mark.exhaustive
def test_statements_that_no_case_comes_to(capsys, green):
    """A module that no case uses is unreached as a whole, one that every bench uses in part; code of real
    time counts in neither.
    """
    areas = ("--area", "emulators.repetition", "--area", "fieldbus.clock")
    code, out, err = call(capsys, "--unreached", "--campaign", green, *areas, "--json")
    assert code == 1, err
    by_module = {entry["module"]: entry for entry in json.loads(out)}
    unused, used = by_module["emulators.repetition"], by_module["fieldbus.clock"]
    assert len(unused["unreached"]) == unused["statements"] > 10
    assert 0 < len(used["unreached"]) < used["statements"]
    source, first = inspect.getsourcelines(RealtimeScheduler)
    assert not set(range(first, first + len(source))) & set(used["unreached"])
    whole = f"emulators.repetition: {unused['statements']} of {unused['statements']}: lines "
    assert whole in err
    assert "reached by none of 3 cases" in err


@pytest.mark.exhaustive
def test_fates_of_defects(capsys, green, monkeypatch):
    """Survivors and defects that never run make it 1; what hangs, is deaf to its limit, or kills its process
    is caught.
    """
    monkeypatch.setattr("hil.mutants._worker.RESERVE_S", 0.5)
    code, out, err = call(
        capsys,
        "--catalogue",
        f"{TOY}:FATES",
        "--campaign",
        green,
        "--jobs",
        2,
        "--json",
        "--limit",
        1,
        "--report",
        "rep",
    )
    assert code == 1
    suite = ET.parse("rep/mutants.xml").getroot()
    failed = [case.get("name") for case in suite.iter("testcase") if case.find("failure") is not None]
    skipped = [case.get("name") for case in suite.iter("testcase") if case.find("skipped") is not None]
    assert (len(failed), len(skipped), len(list(suite.iter("testcase")))) == (2, 1, 7), (failed, skipped)
    fates = {entry["name"]: (entry["status"], entry["how"]) for entry in json.loads(out)}
    assert fates == {
        "slope-inverted": ("caught", "failed"),
        "survives": ("survived", ""),
        "explained": ("explained", ""),
        "hangs": ("caught", "hung"),
        "deaf": ("caught", "hung"),
        "crashes": ("caught", "crashed"),
        "unreached": ("never ran", ""),
    }
    assert "4 of 7 caught" in err


def test_an_explained_survivor_is_no_failure(capsys, green):
    """A survivor whose reason stands in the catalogue is listed, with exit code 0."""
    code, out, _ = call(capsys, "explained", "--catalogue", f"{TOY}:FATES", "--campaign", green, "--json")
    assert code == 0
    (entry,) = json.loads(out)
    assert entry["caught_by"] == []
    assert entry["explained"]


def test_a_survivor_that_changes_a_trace_lacks_an_expectation(capsys, green, tmp_path):
    """Of a survivor it is said whether the trace of a case differs from that without the defect, also when
    the latter was measured by an earlier run.
    """
    arguments = ["--catalogue", f"{TOY}:SURVIVORS", "--campaign", green, "--json", "--report", "rep"]
    for _ in range(2):
        code, out, err = call(capsys, *arguments)
        changed = {entry["name"]: entry["changed_trace_of"] for entry in json.loads(out)}
        assert (code, changed) == (1, {"survives": [], "shown": [f"toy-product/slope@{toy.BENCH}"]})
        assert "shown: none of 1 cases notices it; it changes the trace of toy-product/slope" in err
        assert "survives: none of 1 cases notices it; all traces stay as they are" in err
    table = (tmp_path / "rep" / "mutants.md").read_text()
    assert "it changes the trace of toy-product/slope" in table


@pytest.mark.exhaustive
def test_more_cases_are_tried_where_a_defect_makes_a_difference(capsys, monkeypatch, tmp_path):
    """A case that comes to the changed statement with the same result on both sides cannot notice it. When
    those tried leave no trace, the others in which the result differs have their turn; of a defect that
    never makes a difference it is said.
    """
    (tmp_path / "borders.py").write_text(f"from {TOY} import BORDERS\n")
    monkeypatch.chdir(tmp_path)
    arguments = ["--catalogue", f"{TOY}:AT_BORDERS", "--campaign", "borders.py", "--cases", 1, "--json"]
    code, out, err = call(capsys, *arguments)
    border, none = json.loads(out)
    assert code == 1, err
    assert border["caught_by"] == [f"borders/near@{toy.BENCH}"]
    assert (border["cases_run"], border["cases_looked_at"], border["cases_with_a_difference"]) == (2, 2, 1)
    assert (none["cases_run"], none["cases_looked_at"], none["cases_with_a_difference"]) == (1, 2, 0)
    assert "in none of 2 cases does it make a difference where it is" in err
    assert "looked for a difference in 2/2 cases" in err
    assert none["nearest"] == [f"borders/far@{toy.BENCH}"]
    assert f"nearest: borders/far@{toy.BENCH}" in err


@pytest.mark.exhaustive
def test_all_goes_on_after_the_first_catch(capsys, green):
    """With --all every case that can notice a defect is run, also behind one that killed its process."""
    catalogue = f"{TOY}:FATES"
    code, out, _ = call(
        capsys, "crashes", "slope-inverted", "--catalogue", catalogue, "--campaign", green, "--all", "--json"
    )
    assert code == 0
    for entry in json.loads(out):
        assert entry["cases_run"] == entry["cases_reaching_it"]


@pytest.mark.exhaustive
def test_a_run_that_was_ended_goes_on(capsys, green, monkeypatch, tmp_path):
    """Ctrl-C keeps what is known, exit code 2; --resume judges the others alone; --last-failed those that
    were not caught.
    """
    arguments = ["--catalogue", f"{TOY}:FEW", "--campaign", green, "--json", "--report", "rep"]
    reported = []

    def tell(_, result, done, total):
        reported.append(f"{done}/{total} {result.mutant.name}")
        if len(reported) == 1:
            raise KeyboardInterrupt

    with monkeypatch.context() as during:
        during.setattr("hil._commands.mutants._Progress.mutant", tell)
        code, out, err = call(capsys, *arguments)
        assert code == 2
        assert "interrupted; --resume goes on" in err
        assert [entry["name"] for entry in json.loads(out)] == ["slope-inverted"]
        file = tmp_path / "rep" / "mutants.json"
        assert json.loads(file.read_text())["interrupted"] is True
        code, out, _ = call(capsys, *arguments, "--resume")
        assert code == 1, "one has survived"
        assert reported == ["1/3 slope-inverted", "2/3 stays-closed", "3/3 survives"]
        found = json.loads(out)
        assert [entry["status"] for entry in found] == ["caught", "caught", "survived"]
        assert json.loads(file.read_text())["mutants"] == found
        reported[:] = ["again"]
        code, out, _ = call(capsys, *arguments, "--resume", "--last-failed")
        assert (code, reported[1:], json.loads(out)[:2]) == (1, ["3/3 survives"], found[:2])
        reported[:] = ["only"]
        code, out, _ = call(capsys, *arguments, "--last-failed")
        assert (code, reported[1:], [entry["name"] for entry in json.loads(out)]) == (
            1,
            ["1/1 survives"],
            ["survives"],
        )
    code, _, err = call(capsys, *arguments, "--resume", "--seed", 5)
    assert (code, "holds a run with seed 0" in err) == (2, True)
    code, _, err = call(
        capsys, *arguments[:2], "--campaign", f"{TOY}@reference", "--report", "rep", "--resume"
    )
    assert (code, "other cases have judged" in err) == (2, True)


@pytest.mark.exhaustive
def test_a_file_is_a_catalogue(capsys, green, tmp_path):
    """A file in the current folder, with or without a name in it, is a catalogue as a module is."""
    text = f"from {TOY} import CAUGHT, SURVIVES\nMUTANTS = [CAUGHT]\nOTHERS = [SURVIVES]\n"
    (tmp_path / "our_own_defects.py").write_text(text)
    for reference, name in (
        ("our_own_defects.py", "slope-inverted"),
        ("our_own_defects.py:OTHERS", "survives"),
        ("our_own_defects:MUTANTS", "slope-inverted"),
    ):
        code, out, _ = call(capsys, "--catalogue", reference, "--campaign", green, "--list", "--json")
        assert (code, [entry["name"] for entry in json.loads(out)]) == (0, [name])
    code, _, err = call(capsys, "--catalogue", "our_own_defects.py", "--campaign", green)
    assert (code, "1 of 1 caught" in err) == (0, True)


def test_a_red_baseline_stops_everything(capsys):
    """A case that fails without a defect can judge none: it says so, with exit code 2."""
    code, _, err = call(capsys, "stays-closed", "--catalogue", f"{TOY}:MUTANTS", "--campaign", TOY)
    assert code == 2
    assert "red without any defect: red/red" in err
    assert "caught" not in err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["no-such-defect"], "no mutant 'no-such-defect'"),
        (["off2-as-off1"], "did you mean"),
        (["--area", "kitchen"], "cia402, profidrive, axis, nc, machine, bus"),
        (["--catalogue", "nowhere:X"], "nowhere"),
        (["--catalogue", "nowhere.py"], "there is no file"),
        (["--catalogue", f"{TOY}:NO_LIST"], "no list"),
        (["--campaign", "no.such.module"], "no campaign"),
        (["--campaign", "testcases.campaigns.stop_modes@live"], "real time"),
        (["changed", "--catalogue", f"{TOY}:CHANGED_LIST"], "CHANGED_LIST"),
        (["--catalogue", f"{TOY}:CHANGED_ONES", "--campaign", TOY], "0 times, not once"),
        (["--resume"], "--report DIR"),
        (["--last-failed", "--report", "nowhere"], "does not exist"),
    ],
)
def test_what_cannot_run_is_reported(capsys, arguments, words):
    """Wrong names end with 2 and say what is allowed."""
    code, _, err = call(capsys, *arguments)
    assert code == 2
    assert words in err


@pytest.mark.exhaustive
def test_list(capsys):
    """--list shows names, places and requirements and runs nothing."""
    code, out, _ = call(capsys, "--catalogue", f"{TOY}:FATES", "--list")
    assert code == 0
    assert "slope-inverted  [machine; STP-559]" in out
    assert f"in {TOY}:Brake.slope" in out
    assert "not caught: what is logged" in out
    code, out, _ = call(capsys, "survives", "--catalogue", f"{TOY}:FATES", "--list", "--json")
    assert [entry["name"] for entry in json.loads(out)] == ["survives"]
