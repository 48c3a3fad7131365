"""Options that several commands of `hil` have."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

BenchOption = Annotated[
    str,
    typer.Option(
        "--bench", "-b", metavar="B", help="Bench file, embedded name or module:NAME; default: embedded."
    ),
]
ReportOption = Annotated[
    Path, typer.Option("--report", "-r", metavar="DIR", help="Folder for report and evidence.")
]
ResumeOption = Annotated[
    bool, typer.Option("--resume", help="Go on with the run that is in the report folder.")
]
SeedOption = Annotated[int, typer.Option("--seed", "-s", help="Seed of the run.")]
JsonOption = Annotated[
    bool, typer.Option("--json", help="Result as JSON on standard output, with nothing else on it.")
]
JobsOption = Annotated[
    str,
    typer.Option("--jobs", "-j", metavar="N", help="Worker processes; 0 or auto: one for every processor."),
]
TwiceOption = Annotated[bool, typer.Option("--twice", help="Run every case twice and compare the traces.")]
EvidenceOption = Annotated[
    str, typer.Option("--evidence", help="Keep traces and bus logs of: failed, all or none of the cases.")
]
HistoryOption = Annotated[
    str,
    typer.Option(
        "--history",
        metavar="FILE",
        help="History of runs; default: history.sqlite in the report folder; or none.",
    ),
]
SummaryOption = Annotated[
    str,
    typer.Option(
        "--summary", metavar="FILE", help="Summary in markdown; -: standard output; auto: for GitHub Actions."
    ),
]
