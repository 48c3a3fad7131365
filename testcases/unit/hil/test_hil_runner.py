"""The runner: order, seeds, journal, processes, interruption, resume; and how campaigns are found."""

import dataclasses
import re

import pytest

from hil._commands.durations import parse_duration
from hil.campaign import SHIPPED, Runner, RunOptions, case_seed, find_campaigns, select_cases
from hil.campaign._discover import Selected, load_campaign
from hil.campaign._files import folder_name
from hil.campaign._runner import shard
from hil.errors import CampaignNotFoundError, CannotRunError
from hil.record import Trace
from reports import StoreError, merge_runs, run_digest
from reports.model import Verdict
from reports.store import load_run, stored_cases

pytestmark = pytest.mark.exhaustive

TOY = "testcases.unit.hil.toycampaign"
EXPECTED = {
    "toy/move-50": "passed", "toy/move-100": "passed", "toy/move-200": "passed", "toy/wrong": "failed",
    "toy/blocked": "blocked", "toy/broken": "error", "toy/chance": "passed",
}  # fmt: skip


def toy_cases(name="CAMPAIGN", **selection):
    found = [entry for entry in find_campaigns([TOY]) if entry.reference.endswith(f":{name}")]
    return select_cases(found, **selection)


def run(cases, **options):
    return Runner(cases, RunOptions(**options)).run()


# -- finding
# --------------------------------------------------------------------------------------------------------


def test_campaigns_are_found_in_modules_files_and_directories(tmp_path):
    """The same campaign is found by module, by file and by directory, and once only."""
    by_module = find_campaigns([TOY, TOY])
    assert [entry.reference for entry in by_module] == [f"{TOY}:CAMPAIGN", f"{TOY}:FATAL"]
    file = tmp_path / "mine.py"
    file.write_text("from hil import Campaign\nMINE = Campaign('mine')\nMINE.case('a')(lambda ctx: None)\n")
    (tmp_path / "test_not.py").write_text("raise SystemError('a test is not imported')  # Campaign(\n")
    (tmp_path / "helper.py").write_text("raise SystemError('a file without campaigns is not imported')\n")
    for reference in (file, tmp_path):
        (found,) = find_campaigns([str(reference)])
        assert found.reference == f"{file}:MINE"
        assert load_campaign(found.reference) is found.campaign


@pytest.mark.parametrize(
    ("reference", "words"),
    [
        ("no.such.module", "no such file, directory or module"),
        ("no/such/file.py", "no such file or directory"),
        ("hil.errors", "defines no Campaign"),
        ("testcases.unit.hil", "defines no Campaign"),
    ],
)
def test_what_leads_nowhere_is_reported(reference, words):
    """A reference without campaigns is named, with what would have been accepted."""
    with pytest.raises(CampaignNotFoundError, match=words) as caught:
        find_campaigns([reference] if reference != "testcases.unit.hil" else ["hil.protocols"])
    assert "Give a short name (`hil run` lists them), a Python file" in str(caught.value)


def test_a_file_that_cannot_be_imported_is_reported(tmp_path):
    """A mistake in a campaign file is reported with file and reason, and the file can be corrected and run
    again.
    """
    file = tmp_path / "bad.py"
    file.write_text("from hil import Campaign\nraise KeyError('oops')  # Campaign(\n")
    with pytest.raises(CannotRunError, match=r"bad\.py cannot be imported: KeyError: 'oops'"):
        find_campaigns([str(file)])
    file.write_text("from hil import Campaign\nC = Campaign('c')\n")
    assert len(find_campaigns([str(file)])) == 1
    text = tmp_path / "bad.txt"
    text.write_text("")
    with pytest.raises(CampaignNotFoundError, match="no Python file"):
        find_campaigns([str(text)])
    with pytest.raises(CannotRunError, match="nothing to run"):
        find_campaigns([])


def test_cases_are_selected_by_text_tag_and_name():
    """Text in name or title, all of the tags, or names; an empty selection is an error."""
    assert [item.case.identifier for item in toy_cases(pattern="MOVE-1")] == ["toy/move-100"]
    assert [item.case.identifier for item in toy_cases(pattern="trip at 50")] == ["toy/move-50"]
    assert len(toy_cases(tags=("toy",))) == len(EXPECTED)
    assert [item.case.identifier for item in toy_cases(identifiers=("toy/wrong",))] == ["toy/wrong"]
    with pytest.raises(CannotRunError, match="none of 7 cases"):
        toy_cases(tags=("toy", "other"))
    with pytest.raises(CannotRunError, match="no case 'toy/x'"):
        toy_cases(identifiers=("toy/x",))


def test_every_campaign_of_the_package_is_registered():
    """What is in `testcases.campaigns` has a short name, and only that."""
    found = {entry.reference.removesuffix(":CAMPAIGN") for entry in find_campaigns(["testcases.campaigns"])}
    modules = {
        reference if reference.endswith(".toml") else reference.partition(":")[0] for reference in found
    }
    assert modules == {shipped.reference for shipped in SHIPPED}


# -- running
# ----------------------------------------------------------------------------------------------------------


def test_results_come_in_case_order_with_every_verdict(tmp_path):
    """Every case has its result, in order; the journal holds the same."""
    seen = []
    runner = Runner(
        toy_cases(),
        RunOptions(directory=tmp_path),
        on_result=lambda result, done, total: seen.append((done, total)),
    )
    result = runner.run()
    assert {case.identifier: case.verdict.value for case in result.cases} == EXPECTED
    assert [case.identifier for case in result.cases] == list(EXPECTED)
    assert seen == [(number, 7) for number in range(1, 8)]
    assert result.bench_name == "toy bench"
    assert "[bench]" in result.bench_text
    stored = load_run(tmp_path)
    assert [case.trace_digest for case in stored.cases] == [case.trace_digest for case in result.cases]
    assert not stored.interrupted


def test_the_seed_of_a_case_does_not_depend_on_the_selection():
    """A case draws the same numbers alone and among others, and other ones with another seed of the run."""

    def drawn(cases, seed):
        result = next(case for case in run(cases, seed=seed).cases if case.identifier == "toy/chance")
        return next(check.value for check in result.checks if check.name == "drawn")

    assert drawn(toy_cases(), 1) == drawn(toy_cases(pattern="chance"), 1)
    assert drawn(toy_cases(pattern="chance"), 1) != drawn(toy_cases(pattern="chance"), 2)
    assert case_seed(1, "a") != case_seed(1, "b")
    assert case_seed(1, "a") == 1097006557


def test_processes_give_the_same_results_as_one(tmp_path):
    """Two worker processes give the same verdicts, traces and order as the run in this process."""
    alone = run(toy_cases(), seed=3)
    shared = run(toy_cases(), seed=3, jobs=2, directory=tmp_path)
    assert [(c.identifier, c.verdict, c.trace_digest) for c in shared.cases] == [
        (c.identifier, c.verdict, c.trace_digest) for c in alone.cases
    ]
    assert sorted(stored_cases(tmp_path)) == sorted(EXPECTED)


def test_a_process_that_dies_loses_its_case_only(tmp_path):
    """A case that kills its process is an error; the cases around it have their results."""
    result = run(toy_cases("FATAL"), jobs=2, directory=tmp_path)
    assert [(case.identifier, case.verdict) for case in result.cases] == [
        ("fatal/first", Verdict.PASSED),
        ("fatal/exit", Verdict.ERROR),
        ("fatal/last", Verdict.PASSED),
    ]
    assert "process that ran this case died" in result.cases[1].message


def interrupting(cases, at):
    """Return the cases with one replaced by a case that is interrupted by the user."""

    def interrupted(ctx):
        raise KeyboardInterrupt

    changed = list(cases)
    changed[at] = Selected(
        dataclasses.replace(cases[at].case, function=interrupted, parameters={}), cases[at].campaign
    )
    return changed


def test_an_interruption_leaves_what_ran_and_the_run_can_be_resumed(tmp_path):
    """Ctrl-C ends the run with the results so far; resuming runs the rest, and the whole equals an unbroken
    run.
    """
    cases = toy_cases()
    broken_off = run(interrupting(cases, 2), directory=tmp_path, seed=4)
    assert broken_off.interrupted
    assert [case.identifier for case in broken_off.cases] == list(EXPECTED)[:2]
    assert load_run(tmp_path).interrupted

    ran = []
    resumed = Runner(
        cases,
        RunOptions(directory=tmp_path, seed=4, resume=True),
        on_result=lambda result, *_: ran.append(result.identifier),
    ).run()
    assert ran == list(EXPECTED)[2:]
    assert not load_run(tmp_path).interrupted
    assert [c.trace_digest for c in resumed.cases] == [c.trace_digest for c in run(cases, seed=4).cases]


def test_a_run_is_resumed_with_its_own_seed_only(tmp_path):
    """Results of different seeds are not mixed."""
    cases = toy_cases(pattern="chance")
    run(cases, directory=tmp_path, seed=4)
    with pytest.raises(CannotRunError, match="seed 4"):
        run(cases, directory=tmp_path, seed=5, resume=True)


def test_a_new_run_replaces_an_old_one_and_leaves_other_files_alone(tmp_path):
    """A report folder is used again; files that no run has made stay."""
    (tmp_path / "notes.txt").write_text("mine")
    run(toy_cases(), directory=tmp_path, evidence="all")
    assert (tmp_path / "evidence" / "toy_move-50" / "trace.npz").exists()
    run(toy_cases(pattern="chance"), directory=tmp_path, evidence="none")
    assert [case.identifier for case in load_run(tmp_path).cases] == ["toy/chance"]
    assert not (tmp_path / "evidence").exists()
    assert (tmp_path / "notes.txt").read_text() == "mine"


def test_evidence_files_of_failed_cases(tmp_path):
    """By default failed cases leave trace and bus log; the result names them and they are whole."""
    result = run(toy_cases(), directory=tmp_path)
    by_name = {case.identifier: case for case in result.cases}
    assert by_name["toy/move-50"].files == {}
    files = by_name["toy/wrong"].files
    assert set(files) == {"trace columns", "trace events and frames", "bus log (candump)"}
    trace = Trace.load(tmp_path / files["trace columns"])
    assert trace.digest() == by_name["toy/wrong"].trace_digest
    lines = (tmp_path / files["bus log (candump)"]).read_text().splitlines()
    assert lines[0].startswith("(946684800.000")
    assert len(lines) == len([frame for frame in trace.frames if not frame.error])


def test_bus_logs_are_read_by_the_readers_of_others(tmp_path):
    """python-can reads the bus log and finds the same frames."""
    can = pytest.importorskip("can")
    result = run(toy_cases(pattern="wrong"), directory=tmp_path)
    path = tmp_path / result.cases[0].files["bus log (candump)"]
    trace = Trace.load(tmp_path / result.cases[0].files["trace columns"])
    path.rename(path.with_suffix(".candump.log"))
    with can.CanutilsLogReader(str(path.with_suffix(".candump.log"))) as reader:
        messages = list(reader)
    assert [(m.arbitration_id, bytes(m.data)) for m in messages] == [
        (f.can_id, f.data) for f in trace.frames if not f.error
    ]
    assert messages[-1].timestamp - 946684800 == pytest.approx(trace.frames[-1].time_ns * 1e-9, abs=1e-5)


def test_no_worker_is_no_run():
    """A run with less than no workers is refused; none means one for every processor."""
    with pytest.raises(CannotRunError, match="1 or more, or 0 for all processors"):
        run(toy_cases(), jobs=-1)
    assert {case.identifier: case.verdict.value for case in run(toy_cases(), jobs=0).cases} == EXPECTED


def test_every_result_has_a_token_that_leads_back():
    """The token of a result names its campaign, case, seed and bench."""
    from hil.campaign import Token

    (result,) = run(toy_cases(pattern="chance"), seed=9).cases
    token = Token.decode(result.token)
    assert (token.case, token.campaign) == ("toy/chance", f"{TOY}:CAMPAIGN")
    assert token.seed == case_seed(9, "toy/chance") == result.seed
    assert token.bench == "testcases.unit.hil.toybench:BENCH"


# -- parts of a run
# -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("count", range(1, 8))
def test_shards_have_no_case_in_common_and_are_the_whole_together(count):
    """Every case is in one shard, whatever the number of shards, and always in the same one."""
    cases = toy_cases()
    parts = [shard(cases, (number, count)) for number in range(1, count + 1)]

    assert sorted(item.case.identifier for part in parts for item in part) == sorted(EXPECTED)
    assert parts == [shard(toy_cases(), (number, count)) for number in range(1, count + 1)]
    assert max(map(len, parts)) - min(map(len, parts)) <= 1


@pytest.mark.parametrize("part", [(0, 4), (5, 4), (8, 8)])
def test_a_shard_that_is_not_there_is_reported(part):
    """A number out of range, and more shards than cases, are refused."""
    with pytest.raises(CannotRunError, match=rf"shard {part[0]}/{part[1]}"):
        shard(toy_cases(), part)


def test_merged_shards_are_the_whole_run(tmp_path):
    """The merged run has the digest, the order and the evidence of a run in one piece; until then it is
    unfinished.
    """
    cases = toy_cases()
    whole = run(cases, directory=tmp_path / "whole", seed=6)
    for number in (1, 2, 3):
        run(cases, directory=tmp_path / f"part{number}", seed=6, shard=(number, 3), jobs=number)
    parts = [tmp_path / "part3", tmp_path / "part1", tmp_path / "part2"]

    assert merge_runs(parts[:2], tmp_path / "some").interrupted
    merged = merge_runs(parts, tmp_path / "all")
    assert not merged.interrupted
    assert [c.identifier for c in merged.cases] == list(EXPECTED)
    assert run_digest(merged) == run_digest(whole)
    assert merged.bench_text == whole.bench_text
    for name in next(c for c in merged.cases if c.identifier == "toy/wrong").files.values():
        assert (tmp_path / "all" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()


def test_only_what_belongs_together_is_merged(tmp_path):
    """Runs of different seeds, no runs, and a run into itself are refused."""
    for seed in (1, 2):
        run(toy_cases(pattern="chance"), directory=tmp_path / str(seed), seed=seed)
    for sources, words in [
        (["1", "2"], "seed 2"),
        (["1", "none"], "no run here"),
        (["1", "out"], "merged into itself"),
        ([], "nothing to merge"),
    ]:
        with pytest.raises(StoreError, match=words):
            merge_runs([tmp_path / name for name in sources], tmp_path / "out")


def test_a_resumed_run_is_of_the_same_part(tmp_path):
    """A shard is resumed as that shard; failed cases are run again where that is asked for."""
    cases = toy_cases()
    run(cases, directory=tmp_path, shard=(1, 2))
    with pytest.raises(CannotRunError, match="holds shard 1/2; it cannot be resumed with a whole run"):
        run(cases, directory=tmp_path, resume=True)

    run(cases, directory=tmp_path)
    ran = []
    options = RunOptions(directory=tmp_path, resume=True, repeat_failed=True)
    again = Runner(cases, options, on_result=lambda result, *_: ran.append(result.identifier)).run()
    assert ran == ["toy/wrong", "toy/broken"]
    assert {case.identifier: case.verdict.value for case in again.cases} == EXPECTED


@pytest.mark.parametrize("left", ["cases.jsonl", "run.json"])
def test_a_folder_that_was_left_half_cleared_is_used_again(tmp_path, left):
    """A run that was killed while it replaced another one does not block the folder."""
    run(toy_cases(pattern="chance"), directory=tmp_path)
    for name in {"cases.jsonl", "run.json"} - {left}:
        (tmp_path / name).unlink()
    assert run(toy_cases(pattern="chance"), directory=tmp_path).count(Verdict.PASSED) == 1


def test_no_two_cases_share_the_folder_of_their_evidence():
    """Names that differ only in what no file name can hold, or far behind, have folders of their own; plain
    ones are read as they are.
    """
    names = [
        "toy/a_b",
        "toy/a/b",
        "toy/a//b",
        "toy_a/b",
        "toy/ä",
        "toy/ö",
        "toy/" + "l" * 300,
        "toy/" + "l" * 301,
        "..",
        "/",
        "",
    ]
    folders = [folder_name(name) for name in names]

    assert folders[1] == "toy_a_b"
    assert len(set(folders)) == len(names)
    for folder in folders:
        assert re.fullmatch(r"[A-Za-z0-9-][A-Za-z0-9._-]{0,140}", folder), folder


def test_a_budget_ends_a_run_and_resume_goes_on(tmp_path):
    """No case begins after the time; the first of every family came before the second of any; the rest runs
    with resume.
    """
    first = run(toy_cases(), directory=tmp_path, budget_s=1e-9)
    assert (first.interrupted, len(first.cases)) == (True, 1)
    whole = run(toy_cases(), directory=tmp_path, resume=True, budget_s=1e6)
    assert not whole.interrupted
    assert {case.identifier: case.verdict.value for case in whole.cases} == EXPECTED


@pytest.mark.parametrize(("text", "seconds"), [("", 0.0), ("90s", 90.0), ("5m", 300.0), ("1h30m", 5400.0)])
def test_a_time_of_the_command_line(text, seconds):
    """Hours, minutes and seconds."""
    assert parse_duration("--budget", text) == seconds


@pytest.mark.parametrize("text", ["five", "0", "-1m", "5 m", "m"])
def test_what_is_no_time_is_refused(text):
    """The message says what is allowed."""
    with pytest.raises(CannotRunError, match=r"--budget '.*' is not allowed; allowed: a time such as"):
        parse_duration("--budget", text)
