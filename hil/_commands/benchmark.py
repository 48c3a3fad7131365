"""`hil benchmark`: simulated seconds per wall second, and fault cases per minute, on this machine."""

from __future__ import annotations

import time
from typing import Any

from hil._commands.terminal import CaseProgress, print_json, quiet_stdout
from hil.campaign import Campaign, CaseContext, CaseSettings, execute_case
from hil.errors import CannotRunError
from hil.expect import alarm, event, standstill
from reports.model import Verdict

_CAMPAIGN = Campaign("benchmark")
_CASES = 10


@_CAMPAIGN.case("drive-fault", title="Drive fault at constant velocity")
def _fault_case(ctx: CaseContext) -> None:
    """A typical fault case: enable, move, trip, watch the stop."""
    axis = ctx.axis
    power = axis.power()
    ctx.wait_until(lambda: power.Status, 2.0, "enabled")
    axis.move_velocity(300.0)
    ctx.run_for(0.5)
    ctx.inject("drive.fault", code=0x2310)
    ctx.run_for(1.0)
    ctx.expect(alarm(421, reaction=4, within_s=0.05, since=event("fault.applied")))
    ctx.expect(standstill(by=event("fault.applied").plus(0.8)))


def _with_axes(config: Any, count: int) -> Any:
    """Return a bench configuration with `count` copies of its only drive and axis."""
    drive, axis = next(iter(config.drive.values())), next(iter(config.axis.values()))
    drives = {
        f"drive{i}": drive.model_copy(update={"node_id": drive.node_id + i - 1}) for i in range(1, count + 1)
    }
    axes = {f"axis{i}": axis.model_copy(update={"drive": f"drive{i}"}) for i in range(1, count + 1)}
    return config.model_copy(update={"drive": drives, "axis": axes})


def _speed(config: Any, seconds: float) -> float:
    """Return simulated seconds per wall second with all axes moving."""
    from hil.bench.bench import Bench

    with Bench(config, seed=0) as bench:
        axes = [bench.axis(name) for name in config.axis]
        powers = [axis.power() for axis in axes]
        if not bench.run_until(lambda: all(power.Status for power in powers), 3.0):
            raise CannotRunError("the axes of the benchmark could not be enabled")
        jobs = [axis.move_absolute(100.0) for axis in axes]
        target, spent, passed = 100.0, 0.0, 0.0
        while passed < seconds:
            started = time.perf_counter()
            bench.run_for(0.25)
            spent += time.perf_counter() - started
            passed += 0.25
            if all(job.Done for job in jobs):
                target = -target
                jobs = [axis.move_absolute(target) for axis in axes]
        return passed / spent


def measure_speed(*, seconds: float, as_json: bool) -> int:
    """Measure and print; returns the exit code."""
    from hil.bench import load_bench

    results: list[dict[str, object]] = []
    with quiet_stdout(as_json), CaseProgress(4, "benchmark") as progress:
        fast, reference = load_bench("fast"), load_bench(None)
        measurements = [
            ("one axis, 1 ms bus cycle", fast.config),
            ("one axis, 4 ms bus cycle", reference.config),
            ("four axes, 4 ms bus cycle", _with_axes(reference.config, 4)),
        ]
        for number, (name, config) in enumerate(measurements, 1):
            progress.step(number - 1, name)
            results.append(
                {"name": name, "value": round(_speed(config, seconds), 2), "unit": "simulated s / wall s"}
            )
        progress.step(3, "fault cases")
        started = time.perf_counter()
        for seed in range(_CASES):
            outcome = execute_case(_CAMPAIGN.cases[0], reference, CaseSettings(seed=seed)).result
            if outcome.verdict is Verdict.ERROR:
                raise CannotRunError(f"the fault case of the benchmark could not be run: {outcome.message}")
        minutes = (time.perf_counter() - started) / 60
        results.append(
            {"name": "fault cases, one process", "value": round(_CASES / minutes, 1), "unit": "1/min"}
        )
    if as_json:
        print_json(results)
    else:
        for entry in results:
            print(f"{entry['name']:28} {entry['value']:>10} {entry['unit']}")  # noqa: T201 - the answer
    return 0
