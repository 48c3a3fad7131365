"""Simulated seconds per second of processor time, also on a machine that is busy with other work.

    python -m testcases.benchmarks.least_times [NAME...] [--rounds N] [--json]

A bench does the same in every run. It runs several times in slices of 20 ms, of every slice the least time
counts, and the sum of these is what the machine takes when nobody disturbs it: within 1 % from call to call
where medians differ by 15 %. `NAME` is one of the `sim_factor_...axis...` of `hil benchmark`; all without.
`HIL_CORE=pure` measures ordinary Python where a compiled core is installed. Compare two checkouts by turns.
"""

from __future__ import annotations

import argparse
import gc
import json
import time
from itertools import repeat
from math import inf

from fieldbus import core_build
from hil._commands._measurements import MovingBench, moving_benches

SLICES = 100
SLICE_S = 0.02


def factors(names: list[str], rounds: int) -> dict[str, float]:
    """Return simulated seconds per second of processor time by name; the benches take turns."""
    configs = moving_benches()
    least = {name: [inf] * SLICES for name in names}
    for _ in repeat(None, rounds):
        for name, times in least.items():
            moving = MovingBench(configs[name])
            with moving.bench:
                moving.advance(0.5)
                gc.collect()
                gc.disable()
                for number in range(SLICES):
                    started = time.process_time()
                    moving.advance(SLICE_S)
                    times[number] = min(times[number], time.process_time() - started)
                gc.enable()
    return {name: SLICES * SLICE_S / sum(times) for name, times in least.items()}


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    known = list(moving_benches())
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(known))
    parser.add_argument("--rounds", type=int, default=8, help="runs of each bench, default 8")
    parser.add_argument("--json", action="store_true", help="print JSON")
    arguments = parser.parse_args()
    wrong = [name for name in arguments.names if name not in known]
    if wrong:
        parser.error(f"{', '.join(wrong)}: allowed are {', '.join(known)}")
    found = factors(arguments.names or known, arguments.rounds)
    if arguments.json:
        print(json.dumps({"core": core_build.kind(), **found}))
        return
    print(core_build.described())
    for name, factor in found.items():
        print(f"{name:36} {factor:8.1f} simulated s / processor s {1000.0 / factor:8.1f} us/ms")


if __name__ == "__main__":
    main()
