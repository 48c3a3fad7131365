"""The whole page: a self-contained HTML file that works from `file://` without a network.

Its content security policy allows nothing but the scripts of the page itself, named by their hashes: text of
a run that slipped through the escaping could still not run, and no library can load anything. The page of a
large run has its cases in a folder next to it (`reports.html.bundle`) and may load scripts from there too.
"""

from __future__ import annotations

import base64
import hashlib
from collections import Counter
from collections.abc import Iterable, Mapping
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final
from urllib.parse import quote, urlencode

from reports.compare import Background
from reports.coverage import (
    NO_FAULT,
    Matrix,
    fault_reaction_matrix,
    fault_state_matrix,
    fault_stop_matrix,
    not_looked_at,
    prefix_totals,
    requirement_matrix,
    stop_modes,
    value_pairs,
    with_stop,
)
from reports.html.bundle import EMBEDDED_LIMIT, Bundle, pack
from reports.html.makes import HEIGHT, WIDTH, WORDS, side_by_side
from reports.html.overview import overview
from reports.html.packing import packed
from reports.html.payload import index_entry, script_json
from reports.json_types import JsonObject
from reports.model import CaseResult, Earlier, RunResult, Verdict
from reports.seeding import Seeding
from reports.summary import run_digest
from reports.text import VERDICTS, duration, headline, own_title, run_state

_STYLES: Final = ("style.css", "case.css", "homing.css", "curves.css", "makes.css")
_SCRIPTS: Final = (
    "core.js", "list.js", "requirements.js", "overlay.js", "plot.js", "homing.js", "curves.js", "case.js",
    "main.js",
)  # fmt: skip
_PLAIN_ROWS: Final = 500
_MAKE_ROWS: Final = (
    ("Speed at the cause", "speed"),
    ("Alarm or error", "code"),
    ("It came after", "delay"),
    ("Controller", "response"),
    ("Machine stands after", "stop"),
    ("Way until then", "distance"),
    ("To go on", "go_on"),
)
"""What is compared of makes of controllers, and where it is found."""


def render_html(
    run: RunResult,
    path: str | Path,
    *,
    points: int = 2000,
    embedded: int = EMBEDDED_LIMIT,
    background: Background | None = None,
    seeding: Seeding | None = None,
    earlier: Mapping[str, Earlier] | None = None,
) -> Path:
    """Write the report and return its path.

    Args:
        run: The run.
        path: File to write; evidence links count from its folder.
        points: About how many samples of a signal stay in the plot (at least 100). Extremes and the
            surroundings of faults, alarms and failed checks always stay.
        embedded: Characters of packed case data up to which the page is one file; beyond them the cases go
            into a folder next to it, `report-data` of `report.html`.
        background: Earlier runs, for trend and changes.
        seeding: Defects seeded on purpose, for their table.
        earlier: Runs of the cases to compare with, by identifier; default: the last passes of the background.

    Raises:
        ValueError: `points` is below 100.

    """
    if points < 100:
        raise ValueError(f"points: {points} is not allowed; allowed: 100 and more")
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    passes = earlier or (background.passes if background else {})
    bundle = pack(run, target, points=points, passes=passes, limit=embedded)
    changes = background.comparison.by_case() if background else {}
    target.write_bytes(
        _page(run, bundle, overview(run, background, seeding), changes).encode("utf-8", "replace")
    )
    return target


def _page(run: RunResult, bundle: Bundle, overview: JsonObject, changes: Mapping[str, str]) -> str:
    """Return the page as text; lone surrogates in it become question marks when it is written."""
    import jinja2
    from markupsafe import Markup

    environment = jinja2.Environment(
        loader=jinja2.FunctionLoader(_resource),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    program = _library() + '\n(() => {\n"use strict";\n' + "\n".join(map(_resource, _SCRIPTS)) + "})();"
    requirement_rows = requirement_matrix(run)
    place = {case.identifier: index for index, case in enumerate(run.cases)}
    makes = side_by_side(run)
    keys = list(dict.fromkeys(case.controller for case in run.cases if case.controller))
    state = run_state(run)
    title, text = _verdict_words(run, state)
    context: dict[str, object] = {
        "run": run,
        "state": state,
        "state_icon": {"failed": "failed", "passed": "passed"}.get(state, "blocked"),
        "verdict_title": title,
        "verdict_text": text,
        "totals": [(verdict.value, run.count(verdict)) for verdict in VERDICTS],
        "simulated": duration(sum(case.simulated_s for case in run.cases)),
        "wall": duration(sum(case.wall_s for case in run.cases)),
        "rows": _plain_rows(run),
        "selections": _selections(run, changes),
        "matrices": _matrices(run),
        "stop_matrices": _stop_matrices(run),
        "prefix_rows": [
            {
                "prefix": total.prefix,
                "touched": total.touched,
                "link": "#/requirements?" + urlencode({"p": total.prefix}, errors="replace"),
                "numbers": [
                    total.known,
                    total.passed,
                    total.failed,
                    total.blocked,
                    total.untested,
                    total.orphaned,
                ],
                "parts": [
                    ("passed", total.passed),
                    ("failed", total.failed),
                    ("blocked", total.blocked),
                    ("untested", total.untested),
                ],
            }
            for total in prefix_totals(requirement_rows)
        ],
        "facts": _facts(run),
        "bundle": bundle,
        "overview": overview,
        "makes": makes,
        "make_words": [(key, WORDS.get(key, key)) for key in keys],
        "make_rows": _MAKE_ROWS,
        "make_size": (WIDTH, HEIGHT),
        "style": Markup("".join(_resource(name) for name in _STYLES)),  # noqa: S704 (a file of this package)
        "script_sources": Markup(  # noqa: S704 (base 64 and constants)
            _hash(program) + (" 'self' file:" if bundle.folder else "")
        ),
        "program": Markup(program),  # noqa: S704 (files of this package)
        "index": _json([index_entry(case, changes.get(case.identifier, "")) for case in run.cases]),
        "requirements": packed(
            [
                [
                    row.identifier,
                    row.title,
                    row.section,
                    row.document,
                    row.verdict.value if row.verdict else "untested",
                    row.known,
                    [[place[name], verdict.value] for name, verdict in row.cases],
                    row.own,
                ]
                for row in requirement_rows
            ]
        ),
        "payloads": bundle.texts,
    }
    return environment.get_template("report.html.j2").render(context)


def _json(value: object) -> Any:
    from markupsafe import Markup

    return Markup(script_json(value))  # noqa: S704 (escaped by script_json)


def _resource(name: str) -> str:
    return (files("reports.html") / "templates" / name).read_text("utf-8")


def _library() -> str:
    """Return uPlot, which draws the curves: 120 kB that are in the page as they are.

    The file is found without an import of its package, which would load IPython.
    """
    package = find_spec("uplot")
    assert package is not None  # a dependency
    assert package.submodule_search_locations is not None
    return Path(package.submodule_search_locations[0], "static", "uPlot.iife.js").read_text("utf-8").strip()


def _hash(script: str) -> str:
    digest = hashlib.sha256(script.encode("utf-8")).digest()
    return f"'sha256-{base64.b64encode(digest).decode('ascii')}'"


def _gravity(item: tuple[int, CaseResult]) -> tuple[int, int]:
    return VERDICTS.index(item[1].verdict), item[0]


def _plural(count: int, word: str) -> str:
    return f"{count} {word}" if count == 1 else f"{count} {word}s"


def _verdict_words(run: RunResult, state: str) -> tuple[str, str]:
    """Return the headline of the run and the sentence below it."""
    total = len(run.cases)
    failed, errors, blocked = (run.count(verdict) for verdict in VERDICTS[:3])
    rest = []
    if state == "failed":
        bad = [f"{failed} failed"] * bool(failed) + [_plural(errors, "error")] * bool(errors)
        title = f"{' and '.join(bad)}"
        causes = Counter(headline(case) for case in run.cases if case.verdict is Verdict.FAILED)
        groups = {case.group for case in run.cases if case.verdict in {Verdict.FAILED, Verdict.ERROR}} - {""}
        rest.append(
            f"of {_plural(total, 'case')}"
            + (f", in {', '.join(sorted(groups))}" if 0 < len(groups) <= 4 else "")
        )
        if failed > len(causes) > 0:
            rest.append(f"{len(causes)} different reasons" if len(causes) > 1 else "all for the same reason")
    elif state == "passed":
        title = (
            "All passed"
            if run.count(Verdict.PASSED) == total
            else f"{run.count(Verdict.PASSED)} passed, none failed"
        )
        groups = {case.group for case in run.cases} - {""}
        rest.append(_plural(total, "case") + (f" in {len(groups)} groups" if len(groups) > 1 else ""))
    else:
        title = {"interrupted": "Interrupted", "empty": "Nothing was shown"}[state]
        rest.append(
            _plural(total, "case") + " so far, none failed" if state == "interrupted" else "no case passed"
        )
    if blocked:
        rest.append(f"{blocked} blocked: the bench was not as {'it' if blocked == 1 else 'they'} needed it")
    if run.interrupted and state == "failed":
        rest.append("the run was interrupted, cases are missing")
    return title, "; ".join(rest) + "."


def _plain_rows(run: RunResult) -> list[JsonObject]:
    """Return the list for a reader without JavaScript, bad cases first: all, or as many as anybody reads."""
    ordered = sorted(enumerate(run.cases), key=_gravity)[:_PLAIN_ROWS]
    return [
        {
            "identifier": case.identifier,
            "link": quote(case.identifier, safe="/", errors="replace"),
            "title": own_title(case),
            "verdict": case.verdict.value,
            "headline": headline(case),
        }
        for _index, case in ordered
    ]


def _selections(run: RunResult, changes: Mapping[str, str]) -> list[tuple[str, str, list[str]]]:
    def several(values: Iterable[str]) -> list[str]:
        return sorted({value for value in values if value})

    return [
        ("g", "Group", several(case.group for case in run.cases)),
        ("tag", "Tag", several(tag for case in run.cases for tag in case.tags)),
        ("f", "Fault", several(fault.kind for case in run.cases for fault in case.faults)),
        ("c", "Change", several(changes.get(case.identifier, "") for case in run.cases)),
        ("m", "Stop", several(mode for case in run.cases for mode in stop_modes(case))),
    ]


def _matrices(run: RunResult) -> list[JsonObject]:
    return [
        _matrix("Fault against reaction", fault_reaction_matrix(run), "r"),
        _matrix("Fault against axis state", fault_state_matrix(run), "s"),
        _matrix("Fault against way to stop", fault_stop_matrix(run), "m"),
    ]


def _stop_matrices(run: RunResult) -> list[tuple[str, JsonObject]]:
    """Return fault against reaction for every way in which an axis was commanded to stop, without the
    rows never tried.
    """
    modes = dict.fromkeys(mode for case in run.cases for mode in stop_modes(case))
    found = []
    for mode in sorted(modes):
        matrix = fault_reaction_matrix(with_stop(run, mode))
        matrix.rows = [
            row for row in matrix.rows if any((row, column) in matrix.cells for column in matrix.columns)
        ]
        if matrix.rows:
            found.append((mode, _matrix("Fault against reaction", matrix, "r", m=mode)))
    return found


def _matrix(title: str, matrix: Matrix, key: str, **also: str) -> JsonObject:
    """Return a matrix for the template; `also` is what its links filter by in any case."""
    rows: list[JsonObject] = []
    for name in matrix.rows:
        cells: list[JsonObject | None] = []
        found: set[str] = set()
        for column in matrix.columns:
            cell = matrix.cell(name, column)
            found.update(cell.cases)
            if cell.verdict is None:
                cells.append(None)
                continue
            counts = ", ".join(
                f"{cell.count(verdict)} {verdict.value}" for verdict in VERDICTS if cell.count(verdict)
            )
            cells.append(
                {
                    "verdict": cell.verdict.value,
                    "counts": [
                        (verdict.value, cell.count(verdict)) for verdict in VERDICTS if cell.count(verdict)
                    ],
                    "notes": " ".join(cell.notes[:3]) + (" …" if len(cell.notes) > 3 else ""),
                    "hint": f"{name}, {column}: {counts}",
                    "link": _filter(name, **{key: column}, **also),
                }
            )
        rows.append(
            {
                "name": name,
                "cells": cells,
                "total": len(found),
                "link": _filter(name, **also),
            }
        )
    return {
        "title": title,
        "columns": matrix.columns,
        "rows": rows,
        "tried": matrix.tried,
        "possible": matrix.possible,
    }


def _filter(fault: str, **values: str) -> str:
    """Return the address of the list with just the cases of a cell."""
    return "#/cases?" + urlencode({"f": "-" if fault == NO_FAULT else fault, **values}, errors="replace")


def _facts(run: RunResult) -> list[tuple[str, str]]:
    return [
        ("Title", run.title),
        ("Bench", run.bench_name),
        ("Started", run.started),
        ("Seed", str(run.seed)),
        ("Trace digest", run_digest(run)),
        ("Cases", str(len(run.cases))),
        ("Interrupted", "yes, cases are missing" if run.interrupted else "no"),
        *_reach(run),
    ]


def _reach(run: RunResult) -> list[tuple[str, str]]:
    """Return what the run has not looked at, and how different its machines were."""
    rows = []
    unseen = not_looked_at(run)
    if unseen:
        rows.append(("Signals that no check looked at", ", ".join(unseen)))
    pairs, missed = value_pairs(run)
    if pairs or missed:
        more = f"; {missed} more in cases that were blocked or broke" if missed else ""
        rows.append(("Pairs of values of the configurations", f"{pairs}{more}"))
    return rows
