"""Do the compiled core and ordinary Python give the same traces? As many cases and programs as a time allows.

    python -m testcases.cores [--budget 30m] [--jobs N] [--source NAME]... [--start N]

Goes round through the campaigns of `hil demo`, the matrix files, the Python campaigns on their own
benches and on others, and programs of `hil fuzz` on every bench, a small part of each at a time. Each
part runs pure with one seed of hashes, then compiled with another one; digests of signals, bus log and
event log are compared. In the end a table says for every source what was compared, of how much.
`--start` begins at another part, so that a next run goes on where one has ended. The exit code is 1 when
anything differs.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field

from hil.campaign import SHIPPED
from testcases.digests import RUNS, digests_of, run_and_read, tell

BENCHES = (
    "reference", "fast", "speed", "profidrive", "profidrive_tcp", "profidrive_rtu", "analog", "stepper",
    "synchronous", "flying_shear", "rotary_knife", "winder", "line_shaft", "nc-axes:reference",
)  # fmt: skip
"""Benches whose fuzz programs are compared."""
PROGRAMS = 200
"""Fuzz programs of each bench that make up the whole."""
PIECE = 10
"""Programs of a part."""
PARTS = 200
"""Parts of the campaigns on their own benches, of matrix files and of the runs on other benches."""
CORES = (("pure", "1"), ("compiled", "2"))
"""`HIL_CORE`, and the seed of hashes with which it runs."""


@dataclass
class Source:
    """Where cases come from."""

    name: str
    parts: int
    run: Callable[[int], dict[str, str]]
    """Runs a part, from 0, with the core that the environment names; returns digests by case."""
    done: int = 0
    compared: int = 0
    differing: list[str] = field(default_factory=list)


def sources(jobs: str) -> list[Source]:
    """Return all of them."""

    def part(*, matrix: bool) -> Callable[[int], dict[str, str]]:
        names = [one.name for one in SHIPPED if one.matrix is matrix]
        return lambda number: run_and_read(["run", *names, "--shard", f"{number + 1}/{PARTS}"], "", jobs)

    def other(number: int) -> dict[str, str]:
        result: dict[str, str] = {}
        for campaigns, bench in RUNS[1:]:
            result |= digests_of(campaigns, bench, f"{number + 1}/{PARTS}", jobs)
        return result

    return [
        Source("hil demo", 1, lambda _number: run_and_read(["demo"], "", jobs)),
        Source("matrix files", PARTS, part(matrix=True)),
        Source("Python campaigns", PARTS, part(matrix=False)),
        Source("campaigns on other benches", PARTS, other),
        *(Source(f"fuzz {name}", PROGRAMS // PIECE, _fuzzing(name)) for name in BENCHES),
    ]


def _fuzzing(bench: str) -> Callable[[int], dict[str, str]]:
    def run(number: int) -> dict[str, str]:
        command = [sys.executable, "-m", "testcases.cores", "--programs", bench, str(number)]
        done = subprocess.run(command, check=False, capture_output=True, text=True)
        if done.returncode:
            sys.exit(f"{' '.join(command)}\n{done.stdout}{done.stderr}")
        found: dict[str, str] = json.loads(done.stdout)
        return found

    return run


def programs(bench: str, number: int) -> dict[str, str]:
    """Run `PIECE` fuzz programs and return a digest of each."""
    from hil.campaign import load_bench_file
    from hil.fuzz import FuzzOutcome, search

    digests: dict[str, str] = {}

    def note(count: int, outcome: FuzzOutcome | None) -> None:
        assert outcome is not None
        digests[f"program {number}.{count}"] = f"{outcome.violation} {outcome.trace.digest()}"

    search(load_bench_file(bench), cases=PIECE, seed=number, bench=bench, on_run=note)
    return digests


def compare(every: list[Source], budget_s: float, start: int) -> int:
    """Compare until the time is over, and return the exit code."""
    ends = time.monotonic() + budget_s
    waiting = [(source, number) for number in range(PARTS) for source in every if number < source.parts]
    for source, number in waiting:
        if time.monotonic() >= ends:
            break
        if number < start and source.parts > 1:
            continue
        found = []
        for core, hash_seed in CORES:
            os.environ.update(HIL_CORE=core, PYTHONHASHSEED=hash_seed)
            found.append(source.run(number))
        pure, compiled = found
        wrong = sorted(one for one in pure.keys() | compiled.keys() if pure.get(one) != compiled.get(one))
        if wrong:
            first, second = ({name: one[name] for name in wrong if name in one} for one in found)
            tell(first, second, ("pure", "compiled"))
        source.done += 1
        source.compared += len(pure)
        source.differing += wrong
    print(f"{'source':32} {'parts':>11} {'compared':>9} {'differ':>7}")
    for source in every:
        parts = f"{source.done} of {source.parts}"
        print(f"{source.name:32} {parts:>11} {source.compared:9} {len(source.differing):7}")
    print(f"{sum(one.compared for one in every)} compared, {sum(len(one.differing) for one in every)} differ")
    return 1 if any(one.differing for one in every) or not any(one.compared for one in every) else 0


def seconds(text: str) -> float:
    """Return a duration: `90s`, `30m`, `2h`."""
    units = {"s": 1.0, "m": 60.0, "h": 3600.0}
    try:
        return float(text[:-1]) * units[text[-1:]]
    except (KeyError, ValueError):
        raise argparse.ArgumentTypeError(f"{text!r} is no time such as 90s, 30m, 2h") from None


def main() -> int:
    """Run the command line and return the exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    every = sources("1")
    parser.add_argument("--budget", type=seconds, default="30m", help="no part begins later; default 30m")
    parser.add_argument("--jobs", default="1", help="processes of the campaigns, default 1")
    parser.add_argument("--start", type=int, default=0, help="number of the first part, from 0")
    parser.add_argument(
        "--source", action="append", choices=[one.name for one in every], help="only this one"
    )
    parser.add_argument("--programs", nargs=2, metavar=("BENCH", "PART"), help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.programs:
        print(json.dumps(programs(arguments.programs[0], int(arguments.programs[1]))))
        return 0
    every = [one for one in sources(arguments.jobs) if one.name in (arguments.source or (one.name,))]
    return compare(every, arguments.budget, arguments.start)


if __name__ == "__main__":
    sys.exit(main())
