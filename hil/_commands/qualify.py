"""`hil qualify`: what a laboratory asks of a tool, collected from one run into one page and a ReqIF file."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from importlib import metadata
from pathlib import Path
from typing import Final

from hil._commands.terminal import console, print_json
from hil._digests import PACKAGES, package_digest, product_digest
from hil._known_limits import known_limits
from hil._requirements import complete, own_requirements
from hil.campaign import Token
from hil.errors import CannotRunError, TokenError
from reports import load_run
from reports.errors import ReportError
from reports.html.qualification import write_qualification
from reports.model import RunResult
from reports.qualification import Defects, PeerResult, Source, load_peers, qualify
from reports.reqif import write_reqif
from reports.seeding import load_seeding

PAGE_FILE: Final = "qualification.html"
REQIF_FILE: Final = "qualification.reqif"


def qualify_run(
    folder: Path,
    *,
    mutants: Path | None,
    mechanical: Path | None,
    peers: Path | None,
    catalogue: Path | None,
    directory: Path | None,
    reqif: bool,
    as_json: bool,
) -> int:
    """Write page and ReqIF file; returns the exit code, 1 if a case of the run has not passed.

    Args:
        folder: Report folder of the run.
        mutants: Folder of `hil mutants --report`; None: that of the run, if it has results there.
        mechanical: The same of drawn defects.
        peers: JUnit file of tests with software of others.
        catalogue: Requirements of the user.
        directory: Folder to write to; None: that of the run.
        reqif: Whether to write the ReqIF file.
        as_json: Result as JSON on standard output.

    Raises:
        CannotRunError: A result that is named is not there or cannot be read.
        ReportError: The run cannot be read, or ReqIF has no library.

    """
    run = load_run(folder, lazy=True)
    complete(run, own_requirements(catalogue))
    found = qualify(
        run,
        product=[(name, package_digest(name)) for name in PACKAGES],
        product_digest=product_digest(),
        known_limits=known_limits(),
        sources=_sources(run),
        bench_digest=hashlib.sha256(run.bench_text.encode()).hexdigest(),
        defects=[
            *_defects("Seeded defects", mutants or folder, needed=mutants is not None),
            *(
                _defects("Defects drawn from the source", mechanical, needed=True)
                if mechanical is not None
                else []
            ),
        ],
        peers=_peers(peers),
    )
    target = folder if directory is None else directory
    page = write_qualification(found, target / PAGE_FILE)
    exchange: Path | None = None
    if reqif:
        tool = f"motion-hil {metadata.version('motion-hil')}"
        exchange = write_reqif(found.rows, target / REQIF_FILE, title=run.title, time=run.started, tool=tool)
    out = console()
    for text in found.limits:
        out.print(f"open: {text}", style="yellow", markup=False)
    out.print(f"page: {page}" + ("" if exchange is None else f", requirements: {exchange}"), markup=False)
    if as_json:
        print_json(
            {
                "page": str(page),
                "reqif": "" if exchange is None else str(exchange),
                "trace_digest": found.digest,
                "open": found.limits,
                "requirements": len(found.rows),
                "touched": len(found.touched),
                "not_passed": len(found.open_cases),
            }
        )
    return 1 if found.open_cases else 0


def _defects(title: str, folder: Path, *, needed: bool) -> Sequence[Defects]:
    seeding = load_seeding(folder)
    if seeding is None:
        if needed:
            raise CannotRunError(
                f"{folder} has no results of defects: it is no report folder of `hil mutants --report`"
            )
        return ()
    return (Defects(title, seeding),)


def _sources(run: RunResult) -> list[Source]:
    """Return campaigns and benches of a run, as the tokens of its cases have them."""
    counts: dict[tuple[str, str, str], int] = {}
    for case in run.cases:
        try:
            token = Token.decode(case.token)
        except TokenError:  # it cannot be repeated: a test of pytest, or results of another program
            key = ("", "", "")
        else:
            key = (token.campaign, token.bench or run.bench_name, token.bench_digest)
        counts[key] = counts.get(key, 0) + 1
    return [Source(*key, count) for key, count in sorted(counts.items())]


def _peers(path: Path | None) -> list[PeerResult]:
    if path is None:
        return []
    try:
        return load_peers(path)
    except ReportError as error:
        raise CannotRunError(str(error)) from error
