"""Every command and code block of tutorial, guides and README does what the page says."""

import pytest

from testcases.pages import ROOT, PageRun, blocks
from testcases.prepared import PreparedCommands

pytestmark = pytest.mark.exhaustive

ELSEWHERE = {"docs/guides/continuous-integration.md"}
"""Recipes of other programs, run by `test_ci_recipes.py`."""
PAGES = [
    "README.md",
    *(
        page
        for part in ("tutorial", "guides")
        for path in sorted((ROOT / "docs" / part).glob("*.md"))
        if (page := str(path.relative_to(ROOT))) not in ELSEWHERE
    ),
]


@pytest.fixture(scope="module")
def prepared(tmp_path_factory):
    """The folder of commands that start quickly. README is run with the installed ones."""
    commands = PreparedCommands(tmp_path_factory.mktemp("commands"))
    yield commands.folder
    commands.close()


@pytest.mark.parametrize("page", PAGES)
def test_page_works_in_an_empty_folder(page, prepared, tmp_path, subtests):
    """The blocks of a page, in their order, in an empty folder, do what the page says."""
    run = PageRun(tmp_path, None if page == "README.md" else prepared)
    for block in blocks(page):
        with subtests.test(block.place):
            run.run(block)
