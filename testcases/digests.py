"""The trace digests of all shipped cases: proof that a change of structure leaves behaviour alone.

    python -m testcases.digests record FILE [--part I/N]     run all shipped cases, write their digests
    python -m testcases.digests compare FILE [--part I/N]    run them again, name every case that differs
    python -m testcases.digests cores [--part I/N]           run them pure and compiled, name every case that differs
                                          [--jobs N]         processes, default one per processor
                                          [--bench NAME]     only the cases of a run in `RUNS`, `own` for the first

A digest covers signals, bus log and event log of a case, so equal digests mean equal behaviour to the bit. With
`--part 1/20` every twentieth case is run, which takes seconds instead of minutes; a file recorded in full
serves for parts too. `compare` ends with 1 when anything differs.
"""  # noqa: E501

from __future__ import annotations

import argparse
import csv
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

CAMPAIGNS = Path(__file__).parent / "campaigns"
ENCODERS = "testcases.campaigns.external_encoder"
RUNS = (
    (("",), ""),  # everything on its own bench
    (("axis_faults", "commissioning", "control", "drive_faults", "fault_reactions", "homing", "limits", "monitoring",  # noqa: E501
      "motion_in", "stop_modes"), "profidrive"),
    (("stop_modes",), "profidrive_tcp"),
    (("stop_modes",), "profidrive_rtu"),
    (("stop_modes",), "analog"),
    (("stop_modes",), "stepper"),
    (("external_encoder",), f"{ENCODERS}:REFERENCE"),
    (("external_encoder",), f"{ENCODERS}:PROFIDRIVE"),
)  # fmt: skip
"""Campaigns and the bench they run on; no bench: that of the case."""


def digests_of(campaigns: tuple[str, ...], bench: str, part: str, jobs: str) -> dict[str, str]:
    """Run cases and return `bench, group, identifier: verdict, digest`."""
    paths = [str(CAMPAIGNS / f"{name}.py" if name else CAMPAIGNS) for name in campaigns]
    return run_and_read(["run", *paths, *(["--shard", part] if part else [])], bench, jobs)


def run_and_read(what: list[str], bench: str, jobs: str) -> dict[str, str]:
    """Run `hil` with these arguments and return the digests of the cases; none if no case is left."""
    with tempfile.TemporaryDirectory() as folder:
        command = [
            sys.executable, "-m", "hil.cli", *what, "--report", folder, "-j", jobs,
            "--evidence", "none", "--history", "none", *(["--bench", bench] if bench else []),
        ]  # fmt: skip
        done = subprocess.run(
            command, check=False, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )
        table = Path(folder) / "cases.csv"
        if "no case is left for shard" in done.stdout:
            return {}
        if not table.exists():
            sys.exit(f"no result from: {' '.join(command)}\n{done.stdout}")
        with table.open(encoding="utf-8", newline="") as file:
            return {
                f"{bench or 'own'}, {row['group']}, {row['identifier']}": f"{row['verdict']} {row['trace_digest']}"  # noqa: E501
                for row in csv.DictReader(file)
            }


def all_digests(arguments: argparse.Namespace) -> dict[str, str]:
    """Run all shipped cases, or those that the command line asks for."""
    result: dict[str, str] = {}
    for campaigns, bench in RUNS:
        if arguments.bench in (None, bench or "own"):
            result |= digests_of(campaigns, bench, arguments.part, arguments.jobs)
    return result


def main() -> int:
    """Run the command line and return the exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("action", choices=("record", "compare", "cores"))
    parser.add_argument("file", type=Path, nargs="?")
    parser.add_argument("--part", default="", help="I/N: run only the I-th of N parts")
    parser.add_argument("--jobs", default="auto", help="number of processes")
    parser.add_argument("--bench", choices=["own", *dict.fromkeys(bench for _, bench in RUNS if bench)])
    arguments = parser.parse_args()
    if arguments.action == "cores":
        return compare_cores(arguments)
    if arguments.file is None:
        parser.error("FILE is missing")
    now = all_digests(arguments)
    if arguments.action == "record":
        arguments.file.write_text(json.dumps(now, indent=0, sort_keys=True), encoding="utf-8")
        print(f"{len(now)} digests written to {arguments.file}")
        return 0
    before: dict[str, str] = json.loads(arguments.file.read_text("utf-8"))
    some = arguments.part or arguments.bench
    wanted = {name: before[name] for name in now if name in before} if some else before
    return tell(wanted, now, ("before", "now"))


def compare_cores(arguments: argparse.Namespace) -> int:
    """Run pure, then compiled with another hash seed; return the exit code."""
    found = []
    for core, hash_seed in (("pure", "1"), ("compiled", "2")):
        os.environ.update(HIL_CORE=core, PYTHONHASHSEED=hash_seed)
        found.append(all_digests(arguments))
    return tell(found[0], found[1], ("pure", "compiled"))


def tell(one: dict[str, str], other: dict[str, str], names: tuple[str, str]) -> int:
    """Print which cases differ and return the exit code."""
    differing = [name for name in one.keys() | other.keys() if one.get(name) != other.get(name)]
    for name in sorted(differing)[:40]:
        first, second = (digests.get(name, "not there")[:24] for digests in (one, other))
        print(f"{name}: {names[0]} {first}, {names[1]} {second}")
    print(f"{len(other)} cases, {len(differing)} differ")
    return 1 if differing or not other else 0


if __name__ == "__main__":
    sys.exit(main())
