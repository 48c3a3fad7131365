"""`hil report`: the report of runs that are there already, of one or of several in one."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from hil._commands.run import exit_code, finish, tell
from hil._commands.terminal import print_json
from hil._outputs import check_summary, give_summary, kept
from hil._requirements import own_requirements
from hil.campaign._runner import clear_run
from reports import load_run, merge_runs, summary
from reports.merge import in_order
from reports.passes import curves_of
from reports.store import JOURNAL_FILE, RUN_FILE


def report_runs(
    sources: Sequence[Path],
    directory: Path,
    *,
    history: str,
    digest: str,
    against: Path | None,
    as_json: bool,
    catalogue: Path | None = None,
) -> int:
    """Merge the runs in `sources` into `directory`, write the report, and return the exit code of `hil run`.

    A single source that is the folder itself gets a new report. A run that the history has already is not
    recorded again. The curves of the run in `against` can be laid under those of the same cases.
    """
    own = own_requirements(catalogue)
    check_summary(digest, as_json=as_json)
    if [source.resolve() for source in sources] == [directory.resolve()]:
        run = load_run(directory, lazy=True)
        run.cases = in_order(run.cases, run.planned)
    else:
        if directory.resolve() not in {source.resolve() for source in sources} and (
            (directory / RUN_FILE).exists() or (directory / JOURNAL_FILE).exists()
        ):
            clear_run(directory)
        run = merge_runs(sources, directory)
    background = kept(run, directory, history)
    earlier = {} if against is None else curves_of(load_run(against, lazy=True), f"run in {against}")
    paths = finish(run, directory, background, earlier, own)
    give_summary(digest, run, background, paths)
    if as_json:
        print_json(summary(run, report=str(paths.report), junit=str(paths.junit)))
    tell(run, paths, background)
    return exit_code(run)
