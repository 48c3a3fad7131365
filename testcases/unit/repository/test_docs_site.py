"""The pages of docs/ become a site: complete, with links that lead somewhere, and without the network."""

import json
import re
import subprocess
import sys
import zlib

import pytest
import typer

import hil
import hil.campaign
import hil.expect
import hil.faults
import hil.fuzz
import hil.logs
import hil.matrix
import hil.testing
import reports
from hil.cli import app
from testcases.pages import ROOT

pytestmark = pytest.mark.exhaustive

PUBLIC = (hil, hil.campaign, hil.expect, hil.faults, hil.fuzz, hil.logs, hil.matrix, hil.testing, reports)

LIGHT = ("-D", "toc_object_entries=0")
"""Without every method in the contents of every page: a fifth of the time, and nothing that is checked."""


def test_site(tmp_path, subtests):
    """The site is built without a broken link and without a page that nothing leads to, and is complete."""
    done = subprocess.run(
        [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", *LIGHT, "docs", str(tmp_path)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    for check in (
        asks_for_nothing_from_the_network,
        search_finds_words_of_every_part,
        public_names_are_in_the_reference,
        commands_are_in_the_reference,
    ):
        with subtests.test(check.__doc__):
            check(tmp_path)


def asks_for_nothing_from_the_network(site):
    """No page loads a script, a style, a font or a picture from anywhere but the site."""
    loaded = re.compile(r"<(?:script|img|link)\b[^>]*(?:src|href)=\"((?:https?:)?//[^\"]+)")
    pages = list(site.rglob("*.html"))
    styles = "".join(path.read_text(encoding="utf-8") for path in site.rglob("*.css"))

    assert len(pages) > 40
    assert {found for path in pages for found in loaded.findall(path.read_text(encoding="utf-8"))} == set()
    assert re.findall(r"(?:@import|url\()\s*[\"']?(?:https?:)?//", styles) == []


def search_finds_words_of_every_part(site):
    """The index of the search has words from tutorial, guides, reference and explanation."""
    index = (site / "searchindex.js").read_text(encoding="utf-8")
    names = json.loads(re.search(r"docnames:(\[.*?\])|\"docnames\":(\[.*?\])", index)[0].partition(":")[2])

    assert {name.partition("/")[0] for name in names} >= {"tutorial", "guides", "reference", "explanation"}
    assert all(word in index for word in ("standstil", "hypothesi", "personalit"))


def public_names_are_in_the_reference(site):
    """Every name that a public package exports is on a Python page, those of `hil` perhaps under the package
    that they come from.
    """
    packed = (site / "objects.inv").read_bytes().split(b"\n", 4)[4]
    documented = {line.partition(" ")[0] for line in zlib.decompress(packed).decode().splitlines()}
    documented |= {f"hil.{name.rpartition('.')[2]}" for name in documented}
    missing = [
        f"{package.__name__}.{name}"
        for package in PUBLIC
        for name in package.__all__
        if f"{package.__name__}.{name}" not in documented
    ]

    assert missing == []


def commands_are_in_the_reference(site):
    """Every command stands on the page of commands, with all its options."""
    text = re.sub(r"<[^>]+>", "", (site / "reference" / "commands.html").read_text(encoding="utf-8"))
    commands = typer.main.get_command(app).commands

    assert [name for name in commands if f"hil {name}" not in text] == []
    options = {
        option
        for one in commands.values()
        for parameter in one.params
        for option in parameter.opts
        if "-" in option
    }
    assert [option for option in sorted(options) if option not in text] == []
