"""How many fault cases a run makes in a minute, with journal, evidence, history and report.

    python -m testcases.benchmarks.fault_cases [--cases 600] [--jobs 2] [--bench reference]

Every case is 2 s of bench time: enable, move, a fault at a moment of its own, judged afterwards. What is
timed is what `hil run` does. Seconds of processor time do not depend on what else the machine is doing;
`cases_per_minute_cpu` is what as many processors as there are workers would make of them with nothing else to
do, the report on one of them. Figures come as JSON on standard output.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, Final

from hil._commands.run import finish
from hil._commands.terminal import CaseProgress
from hil._outputs import kept
from hil.campaign import Campaign, CaseContext, Runner, RunOptions, find_campaigns, select_cases
from hil.expect import alarm, event, standstill
from reports.model import Verdict
from reports.store import load_run

SIMULATED_S: Final = 2.0
_FAULTS: Final[dict[str, tuple[str, dict[str, Any], int]]] = {
    "trip": ("drive.fault", {"code": 0x2310}, 421),
    "motor-hot": ("drive.fault", {"code": 0x4310}, 421),
    "nmt-stop": ("frame.inject", {"can_id": 0, "data": "0200", "count": 1}, 431),
    "encoder-fault": ("drive.fault", {"code": 0x7305}, 411),
    "wire-break": ("encoder.wire_break", {}, 411),
    "actual-values-lost": ("frame.drop", {"message": "tpdo1"}, 431),
    "unplugged": ("can.unplug", {"node": "drive1"}, 431),
    "short-circuit": ("can.stuck_dominant", {}, 431),
    "supply-lost": ("drive.power_off", {}, 431),
    "jam": ("mechanics.jam", {}, 521),
}
"""Fault, its parameters, and the alarm that it ends in, by name."""

CAMPAIGN: Final = Campaign("fault cases", bench="reference")


@CAMPAIGN.product(
    "{fault}/{velocity}/{moment_ms}",
    parameters={
        "moment_ms": range(400, 1000, 50), "velocity": [50, 100, 200, 300, 400], "fault": list(_FAULTS),
    },
    title="{fault} at {velocity} mm/s, {moment_ms} ms after the start",
)  # fmt: skip
def fault_case(ctx: CaseContext, moment_ms: int, velocity: int, fault: str) -> None:
    """A fault in motion, and what the axis makes of it."""
    kind, options, number = _FAULTS[fault]
    power = ctx.axis.power()
    ctx.wait_until(lambda: power.Status, 0.35, "enabled")
    ctx.axis.move_velocity(float(velocity))
    ctx.run_for(moment_ms * 1e-3 - ctx.now_s)
    ctx.inject(kind, **options)
    ctx.run_for(SIMULATED_S - ctx.now_s)
    ctx.expect(alarm(number, reaction=4, within_s=0.2, since=event("fault.applied")))
    ctx.expect(standstill(by=event("fault.applied").plus(0.9)))


def _cpu_s(who: int) -> float:
    used = resource.getrusage(who)
    return used.ru_utime + used.ru_stime


def measure(cases: int, jobs: int, bench: str, folder: Path) -> dict[str, float]:
    """Run as many cases as `hil run` does and return the figures.

    Raises:
        SystemExit: A case is not what it should be: the figures would be of something else.

    """
    wall, own, workers = time.perf_counter(), _cpu_s(resource.RUSAGE_SELF), _cpu_s(resource.RUSAGE_CHILDREN)
    selected = select_cases(find_campaigns(["testcases.benchmarks.fault_cases"]))[:cases]
    with CaseProgress(len(selected)) as progress:
        options = RunOptions(bench=bench, jobs=jobs, directory=folder)
        run = Runner(selected, options, on_result=progress.case_done).run()
    ran_s, ran_own = time.perf_counter() - wall, _cpu_s(resource.RUSAGE_SELF) - own
    paths = finish(run, folder, kept(run, folder, ""))
    own, workers = _cpu_s(resource.RUSAGE_SELF) - own, _cpu_s(resource.RUSAGE_CHILDREN) - workers
    wall = time.perf_counter() - wall
    wrong = [case for case in load_run(folder, lazy=True).cases if case.verdict is not Verdict.PASSED]
    wrong += [case for case in run.cases if not abs(case.simulated_s - SIMULATED_S) < 1e-6]
    if wrong:
        raise SystemExit(
            f"{wrong[0].identifier}: {wrong[0].verdict.value}, {wrong[0].simulated_s} s, {wrong[0].message}"
        )
    busy = jobs or os.cpu_count() or 1
    free_s = (workers + ran_own) / busy + own - ran_own
    return {
        "cases": len(run.cases),
        "simulated_s": round(sum(case.simulated_s for case in run.cases), 3),
        "jobs": busy,
        "wall_s": round(wall, 1),
        "of_it_report_s": round(wall - ran_s, 1),
        "cases_per_minute_wall": round(len(run.cases) * 60.0 / wall, 1),
        "cpu_workers_s": round(workers, 1),
        "cpu_command_s": round(ran_own, 1),
        "cpu_report_s": round(own - ran_own, 1),
        "cpu_ms_per_case": round((own + workers) * 1e3 / len(run.cases), 1),
        "cases_per_minute_cpu": round(len(run.cases) * 60.0 / free_s, 1),
        "peak_memory_mb": round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024),
        "peak_memory_worker_mb": round(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024),
        "report_mb": round(paths.report.stat().st_size / 1e6, 1),
    }


def main(arguments: list[str] | None = None) -> int:
    """Measure, print figures, return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--cases", type=int, default=600, help="number of cases, at most 600")
    parser.add_argument("--jobs", type=int, default=2, help="worker processes")
    parser.add_argument("--bench", default="", help="another bench of one drive on CAN")
    chosen = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory(prefix="hil-benchmark-") as folder:
        json.dump(measure(chosen.cases, chosen.jobs, chosen.bench, Path(folder)), sys.stdout, indent=1)
    print()
    return 0


if __name__ == "__main__":
    sys.exit(main())
