"""The page as a file: self-contained, closed, escaped, of bearable size."""

from __future__ import annotations

import base64
import dataclasses
import hashlib
import json
import re
from html.parser import HTMLParser
from importlib.metadata import distribution
from importlib.resources import files

import numpy as np
import pytest

from reports import CaseResult, RunResult, Signal, Verdict, render_html
from reports.html.packing import unpacked
from testcases.sample_run import HOSTILE

pytestmark = pytest.mark.exhaustive


class Page(HTMLParser):
    """Everything that a browser would see as element, attribute, script or text."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str]]] = []
        self.scripts: list[tuple[dict[str, str], str]] = []
        self.words: list[str] = []
        self._open: list[str] | None = None
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        if tag == "script":
            self._open = []

    def handle_endtag(self, tag):
        if tag == "script":
            self.scripts.append((self.elements_of("script")[-1], "".join(self._open)))
            self._open = None

    def handle_data(self, data):
        (self.words if self._open is None else self._open).append(data)

    def elements_of(self, tag: str) -> list[dict[str, str]]:
        return [attributes for name, attributes in self.elements if name == tag]

    def json(self, identifier: str):
        (text,) = [text for attributes, text in self.scripts if attributes.get("id") == identifier]
        return json.loads(text) if text.startswith(("{", "[")) else unpacked(text)


@pytest.fixture(scope="module")
def text(run, tmp_path_factory) -> str:
    return render_html(run, tmp_path_factory.mktemp("html") / "report.html").read_text("utf-8")


@pytest.fixture(scope="module")
def page(text) -> Page:
    return Page(text)


def test_nothing_is_loaded_from_anywhere(page):
    """No element names a resource outside the file: it works offline from `file://`."""
    for tag, attributes in page.elements:
        for name in ("src", "srcset", "data", "poster", "action", "background"):
            assert name not in attributes, (tag, attributes)
        if "href" in attributes:
            assert re.match(r"#|data:,$", attributes["href"]), (tag, attributes)
    assert {tag for tag, _ in page.elements}.isdisjoint({"iframe", "object", "embed", "img", "base"})


def test_policy_admits_exactly_the_scripts_of_the_page(page):
    """The content security policy forbids every connection and names the executed scripts by their hashes."""
    (policy,) = [
        meta["content"]
        for meta in page.elements_of("meta")
        if meta.get("http-equiv") == "Content-Security-Policy"
    ]
    assert "default-src 'none'" in policy
    assert "http" not in policy
    hashes = set(re.findall(r"'sha256-([^']+)'", policy))
    code = [text for attributes, text in page.scripts if "type" not in attributes]
    assert {base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in code} == hashes
    assert not any(name.startswith("on") for _tag, attributes in page.elements for name in attributes)


def test_plot_library_is_there_once_and_not_ours(page, text):
    """The library stands in the page as its makers published it, a single time, with its name and version."""
    (program,) = [text for attributes, text in page.scripts if "type" not in attributes]
    published = next(
        path for path in distribution("uplot-python").files or [] if path.name == "uPlot.iife.js"
    )
    assert program.startswith(published.read_text("utf-8").strip())
    assert text.count("github.com/leeoniya/uPlot (v1.") == 1
    assert "MIT Licensed" in program


def test_verdict_and_reasons_are_readable_without_script(page):
    """Totals, every case with its verdict and every headline are plain text of the page."""
    words = " ".join(page.words)
    assert "4 failed and 1 error" in words
    assert "Alarm 521 expected within 20 ms, came after 48 ms" in words
    rows = [
        attributes for attributes in page.elements_of("tr") if attributes.get("class", "").startswith("row-")
    ]
    assert len(rows) == 45
    assert [row["class"] for row in rows[:5]] == ["row-failed"] * 4 + ["row-error"]


def test_every_case_is_embedded_in_order(run, page):
    """Index and payloads agree with the run."""
    assert [entry["id"] for entry in page.json("data-index")] == [case.identifier for case in run.cases]
    for number, case in enumerate(run.cases):
        plain = page.json(f"data-case-{number}")
        assert (plain["id"], plain["v"], len(plain["checks"])) == (
            case.identifier,
            case.verdict.value,
            len(case.checks),
        )


def test_large_run_has_its_cases_next_to_the_page(run, page, tmp_path):
    """Beyond the limit every case is a script of one call with the data that a small page embeds; the page is
    whole else.
    """
    path = render_html(run, tmp_path / "report.html", embedded=100_000)
    large = Page(path.read_text("utf-8"))
    folder = tmp_path / "report-data"
    (head,) = large.elements_of("html")
    assert (head["data-folder"], len(large.scripts)) == ("report-data", 3)
    assert {file.name for file in folder.iterdir()} == {f"{n}.js" for n in range(len(run.cases))}
    for number in range(len(run.cases)):
        start, _, rest = (folder / f"{number}.js").read_text("utf-8").partition(f",{number},")
        assert start == f'hilData("{head["data-key"]}"'
        assert unpacked(rest.removesuffix(");\n").strip('"')) == page.json(f"data-case-{number}")
    assert large.json("data-index") == page.json("data-index")


def test_folder_of_an_earlier_run_goes_and_foreign_files_stay(run, tmp_path):
    """A report that is written again leaves no case of the one before; what is not ours is not touched."""
    path = render_html(run, tmp_path / "report.html", embedded=0)
    other = render_html(dataclasses.replace(run, title="other"), tmp_path / "other.html", embedded=0)
    keys = [Page(one.read_text("utf-8")).elements_of("html")[0]["data-key"] for one in (path, other)]
    assert keys[0] != keys[1]
    notes = tmp_path / "report-data" / "notes.txt"
    notes.write_text("mine")
    render_html(dataclasses.replace(run, cases=run.cases[:2]), path, embedded=0)
    assert {file.name for file in notes.parent.iterdir()} == {"notes.txt", "0.js", "1.js"}
    notes.unlink()
    render_html(run, path)
    assert not notes.parent.exists()


def test_hostile_texts_stay_texts(hostile, tmp_path):
    """No text of a run becomes an element, an attribute, a template expression or the end of a script."""
    raw = render_html(hostile, tmp_path / "r.html").read_bytes()
    bad = Page(raw.decode("utf-8"))
    good = Page(
        render_html(dataclasses.replace(hostile, title="t", cases=[]), tmp_path / "g.html").read_text("utf-8")
    )
    assert {tag for tag, _ in bad.elements} <= {tag for tag, _ in good.elements} | {
        "tr",
        "td",
        "a",
        "span",
        "small",
        "div",
        "button",
        "b",
        "i",
        "option",
        "tbody",
    }
    assert not any(name.startswith("on") for _tag, attributes in bad.elements for name in attributes)
    assert not any("javascript:" in attributes.get("href", "") for _tag, attributes in bad.elements)
    assert len(bad.scripts) == 3 + len(hostile.cases)
    words = " ".join(bad.words)
    for text in HOSTILE:
        assert text.encode("utf-8", "replace").decode() in words.replace("\r", "") or "\x00" in text
    assert [entry["id"] for entry in bad.json("data-index")] == [
        text.encode("utf-8", "replace").decode() for text in HOSTILE
    ]


def test_links_of_the_list_name_the_case(hostile, run, tmp_path):
    """The address of a case decodes to its identifier, whatever characters that has."""
    from urllib.parse import unquote

    for number, what in enumerate((run, hostile)):
        page = Page(render_html(what, tmp_path / f"{number}.html").read_text("utf-8"))
        links = [
            unquote(link["href"].removeprefix("#/case/"))
            for link in page.elements_of("a")
            if link["href"].startswith("#/case/")
        ]
        assert set(links) == {case.identifier.encode("utf-8", "replace").decode() for case in what.cases}


@pytest.mark.parametrize(
    ("verdicts", "interrupted", "state", "title"),
    [
        (["passed"] * 3, False, "passed", "All passed"),
        (["passed", "blocked"], False, "passed", "1 passed, none failed"),
        (["failed", "passed"], False, "failed", "1 failed"),
        (["error", "error"], False, "failed", "2 errors"),
        (["passed"], True, "interrupted", "Interrupted"),
        ([], False, "empty", "Nothing was shown"),
        (["blocked"], False, "empty", "Nothing was shown"),
    ],
)
def test_headline_of_the_run(verdicts, interrupted, state, title, tmp_path):
    """Red, green or neither is decided by the verdicts; a run that shows nothing is not green."""
    run = RunResult(
        "t",
        1,
        "b",
        "",
        {},
        "",
        [CaseResult(f"c{n}", "", Verdict(word)) for n, word in enumerate(verdicts)],
        interrupted=interrupted,
    )
    page = Page(render_html(run, tmp_path / "r.html").read_text("utf-8"))
    assert page.elements_of("html")[0]["class"] == f"state-{state}"
    assert title in " ".join(page.words)


def test_page_of_sixty_cases_is_below_ten_megabytes(tmp_path):
    """60 cases, 25 signals, 1500 samples: even pure noise, which nothing can compress, stays within
    bounds.
    """
    rng = np.random.default_rng(7)
    time = np.arange(1500) * 1e-3
    run = RunResult("t", 1, "b", "", {}, "")
    for number in range(60):
        signals = [Signal(f"axis1.s{index}", "mm", time, rng.normal(size=1500)) for index in range(25)]
        run.cases.append(CaseResult(f"c{number}", "", Verdict.PASSED, signals=signals))
    assert render_html(run, tmp_path / "r.html").stat().st_size < 10e6


def test_same_run_gives_the_same_bytes(run, text, tmp_path):
    """The report is a function of the run."""
    assert render_html(run, tmp_path / "again.html").read_text("utf-8") == text


def test_too_few_points_are_refused(run, tmp_path):
    """A useless resolution is named before anything is written."""
    with pytest.raises(ValueError, match="points: 99 is not allowed; allowed: 100 and more"):
        render_html(run, tmp_path / "r.html", points=99)
    assert not list(tmp_path.iterdir())


def _luminance(colour: str) -> float:
    if len(colour) == 4:
        colour = "#" + "".join(2 * digit for digit in colour[1:])
    channels = [int(colour[place : place + 2], 16) / 255 for place in (1, 3, 5)]
    linear = [value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4 for value in channels]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_contrast_is_sufficient(scheme):
    """Every pair of text and ground that the page uses reaches 4.5 : 1 (WCAG 2 AA), in both colour
    schemes.
    """
    style = (files("reports.html") / "templates" / "style.css").read_text("utf-8")
    light, _, rest = style.partition("@media screen and (prefers-color-scheme: dark)")
    colours = dict(re.findall(r"--([a-z0-9-]+): (#[0-9a-f]{3,6});", light))
    if scheme == "dark":
        colours |= dict(re.findall(r"--([a-z0-9-]+): (#[0-9a-f]{3,6});", rest.partition("} }")[0]))
    pairs = [(ink, ground) for ink in ("ink", "dim", "link") for ground in ("bg", "card", "hover")]
    pairs += [(name, ground) for name in ("ok", "bad", "block", "err") for ground in (f"{name}-bg", "card")]
    pairs += [("l-ink", f"l-{kind}") for kind in ("off", "ready", "run", "stop", "bad", "n")]
    pairs += [
        (name, "card") for name in ("fault", "alarm", "limit", "none", "s-set", "s-act", "s-3", "s-4")
    ] + [("bg", "ink"), ("ink", "mark")]
    for ink, ground in pairs:
        low, high = sorted((_luminance(colours[ink]), _luminance(colours[ground])))
        assert (high + 0.05) / (low + 0.05) >= 4.5, (ink, ground)
