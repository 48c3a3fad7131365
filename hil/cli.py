"""The command `hil`. Only what `--help` needs is imported here; every command
loads its own parts when it runs.

Exit codes: 0 everything passed, 1 cases failed, 2 it could not run (or was interrupted).
"""

from __future__ import annotations

import errno
import os
import sys
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import typer

from hil._interrupt import asked, interruptible, note
from motion_hil import explain, hidden

_COMPLETE = "_HIL_COMPLETE"
"""Environment variable with which a shell asks for completions."""
_CLICK_INTERRUPTED = 130
"""What the command framework makes of Ctrl-C."""

app = typer.Typer(
    name="hil",
    help="Hardware-in-the-loop benches for motion control: run campaigns, inject faults, replay, fuzz.",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


# -- completion in a shell


def _fault_names(incomplete: str) -> list[str]:
    from hil.faults import CATALOGUE

    return [entry.name for entry in CATALOGUE if entry.name.startswith(incomplete)]


def _bench_names(incomplete: str) -> list[str]:
    from hil.bench import EMBEDDED

    files = [str(path) for path in sorted(Path().glob("*.toml"))]
    return [name for name in (*EMBEDDED, *files) if name.startswith(incomplete)]


def _bench_words(incomplete: str) -> list[str]:
    from hil.bench import EMBEDDED

    return [name for name in ("list", "show", *EMBEDDED) if name.startswith(incomplete)]


def _campaign_names(incomplete: str) -> list[str]:
    from hil.campaign import SHIPPED

    files = [str(path) for path in sorted(Path().glob("*.py"))]
    return [name for name in (*(one.name for one in SHIPPED), *files) if name.startswith(incomplete)]


# -- options of several commands

BenchOption = Annotated[
    str,
    typer.Option(
        "--bench",
        "-b",
        metavar="B",
        help="Bench file, embedded name or module:NAME; default: embedded.",
        autocompletion=_bench_names,
    ),
]
ReportOption = Annotated[
    Path, typer.Option("--report", "-r", metavar="DIR", help="Folder for report and evidence.")
]
ResumeOption = Annotated[
    bool, typer.Option("--resume", help="Go on with the run that is in the report folder.")
]
ClusterOption = Annotated[
    str, typer.Option("--cluster", metavar="ADDRESS", help="Run on the workers of this dask scheduler.")
]
SeedOption = Annotated[int, typer.Option("--seed", "-s", help="Seed of the run.")]
JsonOption = Annotated[
    bool, typer.Option("--json", help="Result as JSON on standard output, with nothing else on it.")
]
VerboseOption = Annotated[bool, typer.Option("--verbose", "-v", help="A line for each case.")]
BudgetOption = Annotated[
    str,
    typer.Option(
        "--budget",
        metavar="TIME",
        help="Begin nothing after this time (5m, 1h30m); say what was left out.",
    ),
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
CatalogueOption = Annotated[
    Path | None,
    typer.Option(
        "--catalogue", metavar="FILE", help="Requirements of your own, CSV or ReqIF; they come first."
    ),
]


# -- commands


def _show_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        from fieldbus import core_build

        print(f"motion-hil {version('motion-hil')}, {core_build.described()}")
        raise typer.Exit


@app.callback()
def _options(
    *,
    version: Annotated[
        bool,
        typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version and end."),
    ] = False,
) -> None:
    pass


@app.command()
def demo(
    *,
    report: ReportOption = Path("hil-report"),
    seed: SeedOption = 0,
    jobs: JobsOption = "1",
    twice: TwiceOption = False,
    evidence: EvidenceOption = "failed",
    history: HistoryOption = "",
    summary: SummaryOption = "",
    verbose: VerboseOption = False,
    as_json: JsonOption = False,
) -> None:
    """Run the main campaign on the embedded bench and write the report."""
    from hil._commands.run import RunRequest, parse_jobs, run_campaigns

    request = RunRequest(
        report=report,
        seed=seed,
        jobs=parse_jobs(jobs),
        twice=twice,
        evidence=evidence,
        as_json=as_json,
        demo=True,
        history=history,
        summary=summary,
        verbose=verbose,
    )
    raise typer.Exit(run_campaigns(request))


@app.command()
def run(
    campaigns: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[CAMPAIGNS]...",
            help="Short names, files, directories or modules; none: list the shipped campaigns.",
            autocompletion=_campaign_names,
        ),
    ] = None,
    *,
    bench: BenchOption = "",
    report: ReportOption = Path("hil-report"),
    seed: SeedOption = 0,
    jobs: JobsOption = "1",
    twice: TwiceOption = False,
    select: Annotated[
        str, typer.Option("--select", "-k", help="Only cases with this text in name or title.")
    ] = "",
    tag: Annotated[
        list[str] | None, typer.Option("--tag", "-t", help="Only cases with this tag; may be repeated.")
    ] = None,
    resume: ResumeOption = False,
    last_failed: Annotated[
        bool,
        typer.Option(
            "--last-failed",
            help="Only cases that failed or broke in the report folder; with --resume: these again.",
        ),
    ] = False,
    shard: Annotated[
        str,
        typer.Option("--shard", metavar="I/N", help="Only the I-th of N parts; the parts make the whole."),
    ] = "",
    time_limit: Annotated[
        float, typer.Option("--time-limit", metavar="S", min=0.0, help="Wall time of every case; 0: its own.")
    ] = 0.0,
    budget: BudgetOption = "",
    cluster: ClusterOption = "",
    configurations: Annotated[
        str,
        typer.Option(
            "--configurations",
            metavar="PAIRWISE",
            help="pairwise: cases on machines that differ in many ways; pairwise:N: each case on N of them.",
        ),
    ] = "",
    controllers: Annotated[
        str,
        typer.Option(
            "--controllers",
            metavar="MAKES",
            help=(
                "nc: cases on axes of an NC; s7,nc: on both, compared in the report; default: as the "
                "bench says."
            ),
        ),
    ] = "",
    list_only: Annotated[bool, typer.Option("--list", help="Show the cases and run nothing.")] = False,
    watch: Annotated[
        bool,
        typer.Option("--watch", help="Show the run in the browser: progress, failures, stop and resume."),
    ] = False,
    watch_port: Annotated[
        int, typer.Option("--watch-port", min=0, max=65535, help="Port of its page; 0: any that is free.")
    ] = 0,
    unread: Annotated[
        bool,
        typer.Option("--unread", help="List the signals, variables and bits that nothing looked at."),
    ] = False,
    evidence: EvidenceOption = "failed",
    history: HistoryOption = "",
    summary: SummaryOption = "",
    catalogue: CatalogueOption = None,
    verbose: VerboseOption = False,
    as_json: JsonOption = False,
) -> None:
    """Run campaigns and write the report."""
    from hil._commands.durations import parse_duration
    from hil._commands.run import RunRequest, list_campaigns, list_cases, parse_jobs, run_campaigns

    if not campaigns:
        raise typer.Exit(list_campaigns(as_json=as_json, asked=list_only))
    request = RunRequest(
        paths=tuple(campaigns),
        bench=bench,
        report=report,
        seed=seed,
        jobs=parse_jobs(jobs),
        twice=twice,
        select=select,
        tags=tuple(tag or ()),
        resume=resume,
        last_failed=last_failed,
        shard=shard,
        wall_limit_s=time_limit,
        budget_s=parse_duration("--budget", budget),
        cluster=cluster,
        evidence=evidence,
        as_json=as_json,
        history=history,
        summary=summary,
        catalogue=catalogue,
        configurations=configurations,
        controllers=controllers,
        unread=unread,
        verbose=verbose,
        watch_port=watch_port if watch else None,
    )
    raise typer.Exit(list_cases(request) if list_only else run_campaigns(request))


@app.command()
def report(
    runs: Annotated[
        list[Path], typer.Argument(metavar="DIR...", help="Report folders of runs, shards for example.")
    ],
    *,
    report: ReportOption = Path("hil-report"),
    against: Annotated[
        Path | None,
        typer.Option("--against", metavar="DIR", help="Report folder of a run to compare its cases with."),
    ] = None,
    history: HistoryOption = "",
    summary: SummaryOption = "",
    catalogue: CatalogueOption = None,
    as_json: JsonOption = False,
) -> None:
    """Write one report of runs that are there already; several are merged."""
    from hil._commands.report import report_runs

    raise typer.Exit(
        report_runs(
            runs,
            report,
            history=history,
            digest=summary,
            against=against,
            as_json=as_json,
            catalogue=catalogue,
        )
    )


@app.command()
def history(
    words: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[list | compare [A] [B] | show CASE | prune]", help="What to do; default: list."
        ),
    ] = None,
    *,
    file: Annotated[Path, typer.Option("--history", metavar="FILE", help="The history.")] = Path(
        "hil-report/history.sqlite"
    ),
    keep: Annotated[int, typer.Option("--keep", min=1, help="Runs that prune leaves.")] = 100,
    every: Annotated[bool, typer.Option("--all", help="Show every line of a comparison.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Show earlier runs, compare two of them, follow a case through them."""
    from hil._commands.history import show_history

    raise typer.Exit(show_history(words or [], file=file, keep=keep, every=every, as_json=as_json))


@app.command()
def emulate(
    bench: Annotated[str, typer.Argument(metavar="BENCH", help="Bench file or embedded name.")],
    *,
    interface: Annotated[
        str,
        typer.Option(
            "--interface",
            "-i",
            metavar="I",
            help="python-can interface; default: the bench file's, else socketcan.",
        ),
    ] = "",
    channel: Annotated[
        str,
        typer.Option(
            "--channel", "-c", metavar="C", help="Channel of it; default: the bench file's, else vcan0."
        ),
    ] = "",
    option: Annotated[
        list[str] | None,
        typer.Option("--option", "-o", metavar="KEY=VALUE", help="Option of the interface; may be repeated."),
    ] = None,
    adapter: Annotated[
        str,
        typer.Option(
            "--adapter",
            "-a",
            metavar="A",
            help="slcan: bring a serial-line adapter on a pseudo-terminal too.",
        ),
    ] = "",
    link: Annotated[
        str,
        typer.Option(
            "--link", metavar="PATH", help="Symbolic link to the device file of the adapter or line."
        ),
    ] = "",
    host: Annotated[
        str, typer.Option("--host", metavar="H", help="Address of drives on Modbus TCP; default: loopback.")
    ] = "",
    port: Annotated[
        int,
        typer.Option(
            "--port",
            metavar="N",
            min=0,
            max=65535,
            help="TCP port of the first drive on Modbus TCP; the next ones follow.",
        ),
    ] = 0,
    ads: Annotated[
        bool,
        typer.Option(
            "--ads", help="Serve the NC of the bench to ADS clients instead, at --host and --port (48898)."
        ),
    ] = False,
    net_id: Annotated[str, typer.Option("--net-id", metavar="ID", help="AMS NetID of it.")] = "127.0.0.1.1.1",
    fault: Annotated[
        list[str] | None,
        typer.Option(
            "--fault",
            "-x",
            metavar="TEXT",
            help="Fault between the controller and the drives, or in a drive: KIND[@TARGET][:KEY=VALUE,...]; "
            "may be repeated.",
        ),
    ] = None,
    seed: SeedOption = 0,
    duration: Annotated[
        float, typer.Option("--for", metavar="S", help="End after S seconds; 0: with Ctrl-C.")
    ] = 0.0,
) -> None:
    """Run the emulated drives of a bench on a live bus, for a controller of your own."""
    if ads:
        from hil._commands.ads import serve_ads

        given = (interface, channel, *(option or ()), adapter, link, *(fault or ()))
        if any(given):
            raise typer.BadParameter(
                "--ads serves the bench as its file describes it: no other bus, adapter, link or fault"
            )
        raise typer.Exit(serve_ads(bench, host=host, port=port, net=net_id, seed=seed, duration_s=duration))
    from hil._commands.emulate import Place, emulate_bench

    raise typer.Exit(
        emulate_bench(
            bench,
            Place(interface, channel, tuple(option or ()), host, port),
            adapter=adapter,
            link=link,
            faults=tuple(fault or ()),
            seed=seed,
            duration_s=duration,
        )
    )


@app.command()
def eds(
    names: Annotated[
        list[str],
        typer.Argument(
            metavar="BENCH [DEVICE] | FILE...",
            help="Bench file or embedded name, and a device of it (default: the first one); "
            "or EDS and DCF files or folders to look at.",
        ),
    ],
    *,
    dcf: Annotated[
        bool, typer.Option("--dcf", help="DCF: with node-ID, bit rate and the values that can be stored.")
    ] = False,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FILE", help="File; default: standard output.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Write the EDS or DCF of an emulated device, or look whether EDS files are right."""
    from hil._commands.eds import write_eds
    from hil._commands.eds_survey import is_survey, survey_files

    if is_survey(names):
        if dcf or output is not None:
            raise typer.BadParameter("--dcf and --output write the file of a device of a bench")
        raise typer.Exit(survey_files(names, as_json=as_json))
    if as_json:
        raise typer.BadParameter("--json is for EDS and DCF files to look at")
    if len(names) > 2:
        raise typer.BadParameter("a bench and one device of it, or EDS and DCF files and folders")
    raise typer.Exit(write_eds(names[0], "".join(names[1:]), dcf=dcf, output=output))


@app.command()
def commission(
    bench: Annotated[str, typer.Argument(metavar="BENCH", help="Bench file or embedded name.")],
    *,
    write: Annotated[
        bool, typer.Option("--write", help="Do it: start the bench, a live one on its bus.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Show what the controller sets up in CiA 402 drives."""
    from hil._commands.commission import commission as show_plan

    raise typer.Exit(show_plan(bench, write=write, as_json=as_json))


@app.command()
def check(
    bench: Annotated[str, typer.Argument(metavar="BENCH", help="Bench file or embedded name.")],
    build: Annotated[
        bool, typer.Option("--build/--no-build", help="Also bring the bench up (virtual benches).")
    ] = True,
    ignore: Annotated[
        list[str] | None,
        typer.Option("--ignore", metavar="RULE", help="A rule that does not count; may be repeated."),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Validate a bench file, compare its tables, and bring the bench up for a second."""
    from hil._commands.check import check_bench

    raise typer.Exit(check_bench(bench, build=build, as_json=as_json, ignored=ignore or ()))


@app.command()
def init(
    folder: Annotated[
        Path, typer.Argument(metavar="[DIR]", help="Folder for bench.toml and test_bench.py.")
    ] = Path(),
    *,
    axis: Annotated[
        list[str] | None,
        typer.Option(
            "--axis",
            "-a",
            metavar="NAME=DRIVE/BUS",
            help="An axis: x, x=cia402, z=profidrive/modbus_tcp; may be repeated; without it you are asked.",
        ),
    ] = None,
) -> None:
    """Write a bench file and a test of your own that pass at once; nothing is overwritten."""
    from hil._commands.init import init_bench

    raise typer.Exit(init_bench(folder, axis or ()))


@app.command()
def diag(
    bench: Annotated[str, typer.Argument(metavar="[BENCH]", help="Bench file or embedded name.")] = "",
    *,
    token: Annotated[str, typer.Option("--token", "-t", help="Repeat this case and look into it.")] = "",
    at: Annotated[
        float | None,
        typer.Option("--at", metavar="SECONDS", help="Bench time within the case; default: its end."),
    ] = None,
    after: Annotated[
        float, typer.Option("--after", min=0.0, help="Without a case: seconds to run first.")
    ] = 0.0,
    axis: Annotated[str, typer.Option("--axis", help="Only this axis or external encoder.")] = "",
    as_json: JsonOption = False,
) -> None:
    """Show what axes and external encoders say about themselves: status, motion, alarms, values, telegram."""
    from hil._commands.diag import show_diagnosis

    raise typer.Exit(show_diagnosis(bench, token=token, at_s=at, after_s=after, axis=axis, as_json=as_json))


@app.command()
def panel(
    bench: Annotated[str, typer.Argument(metavar="[BENCH]", help="Bench file or embedded name.")] = "",
    *,
    axis: Annotated[str, typer.Option("--axis", help="This axis; default: the only one.")] = "",
    monitoring: Annotated[
        float, typer.Option("--monitoring", min=0.1, help="Monitoring time of the life sign, s.")
    ] = 2.0,
    plot: Annotated[Path, typer.Option("--plot", metavar="FILE", help="Page of an optimisation.")] = Path(
        "hil-optimisation.html"
    ),
) -> None:
    """Commission an axis by hand, or from a script on standard input: enable, jog, home, move, optimise."""
    from hil._commands.panel import run_panel

    raise typer.Exit(run_panel(bench, axis=axis, monitoring_s=monitoring, plot=plot))


@app.command()
def cockpit(
    bench: Annotated[
        str,
        typer.Argument(metavar="[BENCH]", help="Bench file or embedded name.", autocompletion=_bench_names),
    ] = "",
    *,
    port: Annotated[int, typer.Option("--port", min=0, max=65535, help="Port; 0: any that is free.")] = 8791,
    host: Annotated[
        str,
        typer.Option(
            "--host", metavar="ADDRESS", help="Listen here in place of the loopback; needs --token-file."
        ),
    ] = "",
    token_file: Annotated[
        Path | None,
        typer.Option("--token-file", metavar="FILE", help="File with the token, in place of a new one."),
    ] = None,
    allow_motion: Annotated[
        bool, typer.Option("--allow-motion", help="Axes with a physical drive may be moved.")
    ] = False,
    show: Annotated[
        bool, typer.Option("--open", help="Open the page in the browser of this machine.")
    ] = False,
    replay: Annotated[
        str,
        typer.Option(
            "--replay",
            metavar="TOKEN",
            help="Token of a case: the bench stands in the middle of it at first.",
        ),
    ] = "",
    at: Annotated[
        float | None, typer.Option("--at", min=0.0, help="Bench time within the case, s; default: its end.")
    ] = None,
    seed: SeedOption = 0,
) -> None:
    """Serve a bench to the browser: commission, drive, watch and measure it there."""
    from hil._commands.cockpit import run_cockpit

    raise typer.Exit(
        run_cockpit(
            bench,
            host=host,
            port=port,
            token_file=token_file,
            allow_motion=allow_motion,
            show=show,
            seed=seed,
            replay=replay,
            at_s=at,
        )
    )


@app.command()
def replay(
    token: Annotated[str, typer.Argument(metavar="TOKEN", help="Token of a case, from report or terminal.")],
    report: ReportOption = Path("hil-report-replay"),
    force: Annotated[bool, typer.Option("--force", help="Also when the bench file has changed.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Repeat one case exactly."""
    from hil._commands.replay import replay_token

    raise typer.Exit(replay_token(token, report=report, force=force, as_json=as_json))


@app.command()
def judge(
    log: Annotated[
        Path,
        typer.Argument(
            metavar="LOG", help="Bus log (candump .log, .asc, .blf, .pcap, ...), or trace.npz of a case."
        ),
    ],
    *,
    expect: Annotated[
        Path, typer.Option("--expect", "-e", metavar="FILE", help="Python file with the expectations.")
    ],
    bench: BenchOption = "",
    report: ReportOption = Path("hil-report-judge"),
    channel: Annotated[
        list[str] | None,
        typer.Option(
            "--channel", "-c", metavar="SEGMENT=CHANNEL", help="Channel of the log; may be repeated."
        ),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Judge a recording of a machine, or a saved trace, by the expectations of a file."""
    from hil._commands.judge import JudgeRequest, judge_log

    request = JudgeRequest(
        log=log, expect=expect, bench=bench, report=report, channels=tuple(channel or ()), as_json=as_json
    )
    raise typer.Exit(judge_log(request))


@app.command()
def export(
    trace: Annotated[Path, typer.Argument(metavar="TRACE", help="trace.npz of a case.")],
    *,
    output: Annotated[
        Path,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="Signals: .mf4, .csv, .npz; frames: .log, .asc, .blf, .pcap, .pcapng.",
        ),
    ],
    signal: Annotated[
        list[str] | None,
        typer.Option(
            "--signal", metavar="NAME", help="Only these signals; * as in file names; may be repeated."
        ),
    ] = None,
    bus: Annotated[
        str, typer.Option("--bus", metavar="SEGMENT", help="Segment whose frames are written.")
    ] = "",
    as_json: JsonOption = False,
) -> None:
    """Write a saved trace, or its frames, for other tools."""
    from hil._commands.export import export_trace

    raise typer.Exit(export_trace(trace, output, signals=tuple(signal or ()), bus=bus, as_json=as_json))


@app.command()
def fuzz(
    *,
    cases: Annotated[int, typer.Option("--cases", "-n", min=1, help="Number of programs.")] = 100,
    seed: SeedOption = 0,
    bench: BenchOption = "",
    steps: Annotated[int, typer.Option("--steps", min=1, max=200, help="Longest program, in steps.")] = 12,
    configurations: Annotated[
        bool | None,
        typer.Option(
            "--configurations/--no-configurations",
            help="Change the bench file too: units, cycles, dynamics, drive, ...; default: unless a bench is "
            "given, which also puts half of the programs on machines with one to three axes.",
        ),
    ] = None,
    axes: Annotated[
        int,
        typer.Option("--axes", min=1, help="Axes that get instructions, gears and cams among them."),
    ] = 1,
    jobs: JobsOption = "1",
    corpus: Annotated[
        Path | None,
        typer.Option("--corpus", metavar="DIR", help="Begin with the programs in this folder, add new ones."),
    ] = None,
    pairs: Annotated[
        bool,
        typer.Option(
            "--pairs", help="Run every pair of fault kinds of the bench, in each order, in place of a search."
        ),
    ] = False,
    kinds: Annotated[
        list[str] | None,
        typer.Option(
            "--kind",
            metavar="KIND",
            help="With --pairs: only these kinds of faults; may be repeated.",
            autocompletion=_fault_names,
        ),
    ] = None,
    shard: Annotated[
        str,
        typer.Option("--shard", metavar="I/N", help="With --pairs: only the I-th of N parts."),
    ] = "",
    report: ReportOption = Path("hil-report-fuzz"),
    as_json: JsonOption = False,
) -> None:
    """Generate programs of jobs and faults, check invariants, shrink what breaks one."""
    from hil._commands.fuzz import fuzz_bench, fuzz_pairs
    from hil._commands.run import parse_jobs, parse_shard

    if pairs:
        part = parse_shard(shard)
        raise typer.Exit(
            fuzz_pairs(bench=bench, seed=seed, kinds=kinds or (), part=part, report=report, as_json=as_json)
        )
    raise typer.Exit(
        fuzz_bench(
            cases=cases,
            seed=seed,
            bench=bench,
            steps=steps,
            configurations=configurations,
            axes=axes,
            jobs=parse_jobs(jobs),
            corpus=corpus,
            report=report,
            as_json=as_json,
        )
    )


@app.command()
def envelope(
    bench: Annotated[
        str,
        typer.Argument(
            metavar="BENCH", help="Bench file or embedded name, in virtual time.", autocompletion=_bench_names
        ),
    ] = "reference",
    *,
    own: Annotated[
        str,
        typer.Option(
            "--motion", metavar="FILE.py[:NAME]", help="Test code: `motion(bench)`, and `before(bench)`."
        ),
    ] = "",
    axis: Annotated[str, typer.Option("--axis", "-a", metavar="NAME", help="Axis that moves.")] = "",
    to: Annotated[float, typer.Option("--to", metavar="POSITION", help="Move from 0 to here.")] = 100.0,
    velocity: Annotated[float, typer.Option("--velocity", metavar="V", help="With this velocity.")] = 200.0,
    stimuli: Annotated[
        list[str] | None,
        typer.Option(
            "--stimulus",
            "-x",
            metavar="KIND[@TARGET][:KEY=VALUE,...]",
            help="Fault or operator action, any number of times; all: every kind of fault.",
        ),
    ] = None,
    every: Annotated[
        str,
        typer.Option(
            "--every",
            metavar="N",
            help="cycle, every so many cycles, or auto: coarse, then where it changes.",
        ),
    ] = "cycle",
    watch: Annotated[
        float, typer.Option("--watch", metavar="S", help="Time that each branch is watched, s.")
    ] = 1.0,
    until_rest: Annotated[
        float | None,
        typer.Option(
            "--until-rest",
            metavar="S",
            help="End a branch when all has been disabled, at rest and without an event for so long.",
        ),
    ] = None,
    seed: SeedOption = 1,
    jobs: JobsOption = "0",
    cluster: ClusterOption = "",
    budget: Annotated[
        str,
        typer.Option("--budget", metavar="TIME", help="Stop after 90s, 10m, 1h, and say what is left out."),
    ] = "",
    report: ReportOption = Path("hil-report-envelope"),
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with the branches in the report folder.")
    ] = False,
    cycle: Annotated[
        int | None,
        typer.Option(
            "--cycle", metavar="N", help="Run one branch alone, with one stimulus, and keep its trace."
        ),
    ] = None,
    guards: Annotated[
        list[str] | None,
        typer.Option(
            "--guard",
            metavar="[AXIS=]POSITION",
            help="Position that a machine must not reach, mm or deg, any number of times.",
        ),
    ] = None,
    against: Annotated[
        Path | None,
        typer.Option("--against", metavar="DIR", help="Compare with the envelope in this folder."),
    ] = None,
    parquet: Annotated[
        bool, typer.Option("--parquet", help="Write the table as envelope.parquet, too.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Break a motion at every cycle, and show the worst stop."""
    from hil._commands.envelope import envelope_of
    from hil._commands.run import parse_jobs

    raise typer.Exit(
        envelope_of(
            bench=bench,
            own=own,
            axis=axis,
            to=to,
            velocity=velocity,
            stimuli=list(stimuli or []),
            every=every,
            watch=watch,
            until_rest=until_rest,
            seed=seed,
            jobs=parse_jobs(jobs),
            cluster=cluster,
            budget=budget,
            report=report,
            resume=resume,
            cycle=cycle,
            guards=list(guards or []),
            against=against,
            parquet=parquet,
            as_json=as_json,
        )
    )


@app.command()
def keep(
    token: Annotated[str, typer.Argument(metavar="TOKEN", help="Token of a program, from `hil fuzz`.")],
    folder: Annotated[
        Path, typer.Option("--in", metavar="DIR", help="Folder of the regression cases.")
    ] = Path("regressions"),
    title: Annotated[str, typer.Option("--title", help="What the case is about.")] = "",
    as_json: JsonOption = False,
) -> None:
    """Make a regression case of a program that a search has found."""
    from hil._commands.keep import keep as keep_token

    raise typer.Exit(keep_token(token, folder=folder, title=title, as_json=as_json))


@app.command()
def mutants(
    names: Annotated[
        list[str] | None, typer.Argument(metavar="[NAMES]...", help="Only these defects; default: all.")
    ] = None,
    *,
    area: Annotated[
        list[str] | None,
        typer.Option(
            "--area",
            help="Only defects of this area, with --mechanical and --unreached of this package or module; "
            "may be repeated.",
        ),
    ] = None,
    campaign: Annotated[
        list[str] | None,
        typer.Option(
            "--campaign",
            metavar="C",
            help="Cases that judge: file, directory or module, perhaps with @BENCH; may be repeated.",
        ),
    ] = None,
    catalogue: Annotated[
        str,
        typer.Option(
            "--catalogue",
            metavar="FILE[:NAME]",
            help="Defects of your own: a file or module with a list of Mutant.",
        ),
    ] = "",
    every: Annotated[
        bool, typer.Option("--all", help="Run every case that can notice a defect, not only until the first.")
    ] = False,
    limit: Annotated[
        float,
        typer.Option(
            "--limit", metavar="S", min=0.0, help="Processor time of a case; 0: from what it takes without."
        ),
    ] = 0.0,
    mechanical: Annotated[
        int,
        typer.Option(
            "--mechanical", metavar="N", help="Draw N defects from the source of motion, emulators, fieldbus."
        ),
    ] = 0,
    judge: Annotated[
        str,
        typer.Option(
            "--judge",
            metavar="J",
            help="Who judges: campaigns; fuzz: the programs that a search of this seed begins with; tests: "
            "files of tests; marks: of these the tests that claim a requirement that the changed code names.",
        ),
    ] = "campaigns",
    programs: Annotated[
        int, typer.Option("--programs", min=1, metavar="N", help="Programs with --judge fuzz.")
    ] = 200,
    cases: Annotated[
        int,
        typer.Option(
            "--cases",
            metavar="K",
            help="At most K cases for a defect, as different as can be; 0: 40 with --mechanical, else all.",
        ),
    ] = 0,
    only_list: Annotated[bool, typer.Option("--list", help="Show the defects and run nothing.")] = False,
    unreached: Annotated[
        bool,
        typer.Option(
            "--unreached",
            help="Show the statements of --area that no case comes to, without any defect.",
        ),
    ] = False,
    resume: ResumeOption = False,
    last_failed: Annotated[
        bool,
        typer.Option(
            "--last-failed",
            help="Only defects that were not caught in the report folder; with --resume: these again.",
        ),
    ] = False,
    report: Annotated[
        Path | None,
        typer.Option("--report", "-r", metavar="DIR", help="Folder for mutants.json, .md, .html and .xml."),
    ] = None,
    budget: BudgetOption = "",
    coverage: Annotated[
        Path,
        typer.Option(
            "--coverage",
            metavar="FILE",
            help="Keeps which statements each case comes to; only cases that may have changed run again.",
        ),
    ] = Path(".hil/coverage.jsonl"),
    seed: SeedOption = 0,
    jobs: JobsOption = "1",
    as_json: JsonOption = False,
) -> None:
    """Switch on defects one at a time and show which case notices each."""
    from fieldbus import core_build

    core_build.restart_pure()
    from hil._commands.durations import parse_duration
    from hil._commands.mutants import MutantsRequest, seed_defects, show_unreached
    from hil._commands.run import parse_jobs

    request = MutantsRequest(
        names=tuple(names or ()),
        areas=tuple(area or ()),
        campaigns=tuple(campaign or ()),
        catalogue=catalogue,
        report=report,
        seed=seed,
        jobs=parse_jobs(jobs),
        limit_s=limit,
        every_case=every,
        resume=resume,
        last_failed=last_failed,
        only_list=only_list,
        as_json=as_json,
        mechanical=mechanical,
        judge=judge,
        programs=programs,
        most_cases=cases or ({"campaigns": 40, "fuzz": 0}.get(judge, 12) if mechanical else 0),
        coverage=coverage,
        budget_s=parse_duration("--budget", budget),
    )
    raise typer.Exit(show_unreached(request) if unreached else seed_defects(request))


@app.command()
def qualify(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Report folder of the run.")],
    *,
    mutants: Annotated[
        Path | None,
        typer.Option(
            "--mutants", metavar="DIR", help="Report folder of hil mutants; default: that of the run."
        ),
    ] = None,
    mechanical: Annotated[
        Path | None,
        typer.Option("--mechanical", metavar="DIR", help="Report folder of hil mutants --mechanical."),
    ] = None,
    peers: Annotated[
        Path | None,
        typer.Option("--peers", metavar="FILE", help="JUnit file of tests with software of others."),
    ] = None,
    catalogue: Annotated[
        Path | None,
        typer.Option("--catalogue", metavar="FILE", help="Requirements of your own, *.csv or *.reqif."),
    ] = None,
    directory: Annotated[
        Path | None,
        typer.Option("--report", "-r", metavar="DIR", help="Folder to write to; default: that of the run."),
    ] = None,
    reqif: Annotated[
        bool, typer.Option("--reqif/--no-reqif", help="Write the requirements with their verdicts as ReqIF.")
    ] = True,
    as_json: JsonOption = False,
) -> None:
    """Collect from one run what a laboratory asks of a tool: one page and a ReqIF file."""
    from hil._commands.qualify import qualify_run

    raise typer.Exit(
        qualify_run(
            folder,
            mutants=mutants,
            mechanical=mechanical,
            peers=peers,
            catalogue=catalogue,
            directory=directory,
            reqif=reqif,
            as_json=as_json,
        )
    )


@app.command()
def museum(
    words: Annotated[
        list[str] | None,
        typer.Argument(metavar="[list | show NAME | run NAMES...]", help="What to do; default: list."),
    ] = None,
    *,
    as_json: JsonOption = False,
) -> None:
    """Show published defects of real products, and run the cases that catch them."""
    from fieldbus import core_build

    core_build.restart_pure()
    from hil._commands.museum import show_museum

    raise typer.Exit(show_museum(words or [], as_json=as_json))


@app.command()
def benchmark(
    as_json: JsonOption = False,
    seconds: Annotated[
        float, typer.Option("--seconds", min=0.1, max=3600.0, help="Simulated time of each measurement.")
    ] = 5.0,
) -> None:
    """Measure the speed of this machine with the embedded benches."""
    from hil._commands.benchmark import measure_speed

    raise typer.Exit(measure_speed(seconds=seconds, as_json=as_json))


@app.command()
def requirements(
    folder: Annotated[
        Path | None,
        typer.Argument(metavar="[DIR]", help="Report folder of a run; default: what pytest recorded here."),
    ] = None,
    *,
    prefix: Annotated[
        list[str] | None,
        typer.Option("--prefix", "-p", help="Only this family, STP of STP-303; may be repeated."),
    ] = None,
    missing: Annotated[bool, typer.Option("--missing", help="Also list what is not covered.")] = False,
    catalogue: CatalogueOption = None,
    as_json: JsonOption = False,
    rerun: Annotated[
        bool, typer.Option("--rerun", help="Run the test-suite first, whatever is recorded.")
    ] = False,
) -> None:
    """Show which requirements passing tests cover."""
    from hil._commands.requirements import show_requirements

    raise typer.Exit(
        show_requirements(
            folder, prefixes=prefix or [], missing=missing, as_json=as_json, rerun=rerun, catalogue=catalogue
        )
    )


@app.command()
def faults(
    name: Annotated[
        str,
        typer.Argument(
            metavar="[NAME]",
            help="Only this kind: frame.drop, a family such as frame, or a pattern with *.",
            autocompletion=_fault_names,
        ),
    ] = "",
    *,
    as_json: JsonOption = False,
) -> None:
    """Show the catalogue of faults, or one kind of them."""
    from hil._commands.faults import show_faults

    raise typer.Exit(show_faults(name, as_json=as_json))


@app.command()
def variables(
    pattern: Annotated[
        str,
        typer.Argument(
            metavar="[PATTERN]", help="Part of a path, or a path with * as in file names; default: all."
        ),
    ] = "",
    *,
    object_type: Annotated[
        str,
        typer.Option(
            "--object", metavar="TYPE", help="PositioningAxis, SynchronousAxis, SpeedAxis or ExternalEncoder."
        ),
    ] = "PositioningAxis",
    as_json: JsonOption = False,
) -> None:
    """Show the variables of axes and external encoders: type, access, unit, range, default, meaning."""
    from hil._commands.variables import show_variables

    raise typer.Exit(show_variables(pattern, object_type=object_type, as_json=as_json))


@app.command()
def benches(
    words: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[list | show NAME]", help="What to do; default: list.", autocompletion=_bench_words
        ),
    ] = None,
    *,
    as_json: JsonOption = False,
) -> None:
    """List the benches that ship with the product, or print the file of one."""
    from hil._commands.benches import show_benches

    raise typer.Exit(show_benches(words or [], as_json=as_json))


@app.command()
def personalities(
    files: Annotated[
        list[str] | None, typer.Argument(metavar="[FILES]...", help="Files of your own to check and show.")
    ] = None,
    *,
    as_json: JsonOption = False,
) -> None:
    """Show how emulated drives can differ from the profile."""
    from hil._commands.personalities import show_personalities

    raise typer.Exit(show_personalities(files or [], as_json=as_json))


@app.command(context_settings={"allow_interspersed_args": False})
def vcan(
    command: Annotated[list[str], typer.Argument(metavar="COMMAND", help="What to run.")],
    *,
    interface: Annotated[
        list[str] | None,
        typer.Option(
            "--interface",
            "-i",
            metavar="NAME",
            envvar="HIL_VCAN",
            help="Name of an interface, else vcan0; may be repeated.",
        ),
    ] = None,
    count: Annotated[
        int,
        typer.Option(
            "--count", "-n", min=0, help="Number of interfaces; those without a name are numbered on."
        ),
    ] = 0,
    where: Annotated[
        str,
        typer.Option(
            "--where",
            envvar="HIL_VCAN_WHERE",
            help="host: only on this machine; uml: only in user-mode Linux; auto: what is possible.",
        ),
    ] = "auto",
    timeout: Annotated[
        float,
        typer.Option("--timeout", metavar="S", min=0.0, help="Longest time of the command; 0: no limit."),
    ] = 0.0,
    memory: Annotated[
        int, typer.Option("--memory", metavar="MIB", min=64, help="Memory of user-mode Linux.")
    ] = 1024,
) -> None:
    """Run any command where a SocketCAN interface exists, without rights: `hil vcan -- candump vcan0`.

    The interface of this machine is taken if it is there, or created with `ip link` if that is allowed; else
    user-mode Linux boots on the files of this machine and runs the command. The command finds the names in
    HIL_VCAN, HIL_VCAN_2, ...; python-can takes the first one where a program names no bus.

    Exit code: that of the command; 69: no way to an interface (the message says what to install); 70:
    user-mode Linux broke off; 124: the time was up.
    """
    from hil._commands.vcan import run_with_interfaces

    raise typer.Exit(
        run_with_interfaces(
            command,
            names=interface or [],
            count=count,
            where=where,
            timeout_s=timeout,
            memory_mib=memory,
        )
    )


@app.command()
def schema() -> None:
    """Print the JSON Schema of the bench file, with which editors complete and check its keys."""
    from hil._commands.schema import show_schema

    raise typer.Exit(show_schema())


def main(arguments: list[str] | None = None) -> int:
    """Run `hil` and return its exit code; the console script calls `sys.exit` with it."""
    code = _run(arguments)
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError as error:
            from hil.errors import CannotRunError

            # Or Python tries it again when it ends, and makes a code of its own of it.
            with Path(os.devnull).open("w") as nowhere:
                os.dup2(nowhere.fileno(), stream.fileno())
            if error.errno in {errno.EPIPE, errno.EIO}:  # the reader has gone
                code = code or 2
            else:
                code = _failure(CannotRunError(f"standard output could not be written: {error.strerror}"))
    return code


def _run(arguments: list[str] | None) -> int:
    if text := hidden():
        print(f"hil: {text}", file=sys.stderr)
        return 2
    command = typer.main.get_command(app)
    try:
        # Not standalone: click would end with 1 on Ctrl-C, which here means that cases failed.
        with interruptible(last=arguments is None):
            outcome = command.main(args=arguments, prog_name="hil", standalone_mode=False)
    except SystemExit as end:
        if _COMPLETE in os.environ:  # the shell has asked for completions, and has them
            return int(end.code or 0)
        # click ends so, with a code that here means that cases failed, when nobody reads on: `hil faults |
        # head -1`
        return 2
    except KeyboardInterrupt:
        note()
        outcome = _CLICK_INTERRUPTED
    except Exception as error:  # noqa: BLE001 - sorted out below, unknown ones are raised again
        if type(error).__name__ != "Abort":
            return _failure(error)
        note()
        outcome = _CLICK_INTERRUPTED
    if (
        outcome == _CLICK_INTERRUPTED and asked()
    ):  # it may also be the exit code of a command that `hil vcan` ran
        with suppress(OSError):  # the terminal may be what has ended
            print("interrupted", file=sys.stderr)
        return 2
    return outcome if isinstance(outcome, int) else 0


def _failure(error: Exception) -> int:
    """Print what went wrong in one paragraph; a programming error of ours keeps its traceback."""
    show = getattr(error, "show", None)
    if callable(show):
        show()
        return int(getattr(error, "exit_code", 2)) or 2
    from fieldbus.errors import HilError

    if not isinstance(error, HilError):
        from reports.errors import ReportError

        if text := explain(error):
            print(f"hil: {text}", file=sys.stderr)
            return 2
        if not isinstance(error, (ReportError, OSError)):
            raise error
        if isinstance(error, OSError) and error.filename is not None:
            print(f"hil: {error.filename}: {error.strerror}", file=sys.stderr)
            return 2
    print(f"hil: {error}", file=sys.stderr)
    return 2


if __name__ == "__main__":
    sys.exit(main())
