"""`hil benchmark`: simulated seconds per second of processor time, fault cases per minute, and
parts against other libraries.
"""

from __future__ import annotations

import gc
import time
from typing import TYPE_CHECKING

from fieldbus import core_build
from hil._commands._axis_measurement import axis_cycles, follower_cycles
from hil._commands._cockpit_measurement import cockpit_figures, missing
from hil._commands._measurements import (
    Figure,
    can_frames,
    can_ports,
    cost_per_axis,
    geared_speed,
    moving_benches,
    position_plans,
    sdo_uploads,
    speed,
)
from hil._commands._modbus_measurement import modbus_requests
from hil._commands.terminal import CaseProgress, print_json, quiet_stdout
from hil.campaign import Campaign, CaseContext, CaseSettings, execute_case
from hil.errors import CannotRunError
from hil.expect import alarm, event, standstill
from reports.model import Verdict

if TYPE_CHECKING:
    from hil.bench.bench import Bench
    from hil.protocols import BenchFile

_CAMPAIGN = Campaign("benchmark")
_CASES = 20


@_CAMPAIGN.case("drive-fault", title="Drive fault at constant velocity")
def _fault_case(ctx: CaseContext) -> None:
    """A typical fault case: enable, move, trip, watch the stop."""
    axis = ctx.axis
    power = axis.power()
    ctx.wait_until(power.status, 2.0, "enabled")
    axis.move_velocity(300.0)
    ctx.run_for(0.5)
    ctx.inject("drive.fault", code=0x2310)
    ctx.run_for(1.0)
    ctx.expect(alarm(421, reaction=4, within_s=0.05, since=event("fault.applied")))
    ctx.expect(standstill(by=event("fault.applied").plus(0.8)))


def measure_speed(*, seconds: float, as_json: bool) -> int:
    """Measure and print; returns the exit code.

    Args:
        seconds: Simulated time of each measurement of a bench.
        as_json: Print JSON on standard output and nothing else.

    Raises:
        CannotRunError: A measurement could not be made.

    """
    from hil.bench import load_bench

    figures: list[Figure] = []
    with quiet_stdout(as_json), CaseProgress(16, "benchmark") as progress:
        reference = load_bench("reference")
        for number, (name, config) in enumerate(moving_benches().items()):
            progress.step(number, name)
            gc.collect()
            factor, load = speed(config, seconds)
            figures.append(Figure(name, factor, "simulated s / s"))
        figures.append(Figure("bus_load_4axes_cia402_2ms", load, "%"))
        progress.step(8, "cost of an axis")
        figures.extend(cost_per_axis(reference.config, seconds))
        progress.step(9, "fault cases")
        figures.append(Figure("fault_cases_per_minute", _cases_per_minute(reference), "cases/min"))
        for number, (name, compare) in enumerate(
            (
                ("axis cycles", axis_cycles),
                ("CAN frames", can_frames),
                ("CAN ports", can_ports),
                ("SDO uploads", sdo_uploads),
                ("position plans", position_plans),
                ("Modbus requests", modbus_requests),
            ),
            10,
        ):
            progress.step(number, name)
            figures.extend(compare())
        figures.extend(follower_cycles())
        factor = geared_speed(load_bench("line_shaft").config, seconds)
        figures.append(Figure("sim_factor_9axes_geared_4ms", factor, "simulated s / wall s"))
        progress.step(16, "cockpit")
        skipped = missing()
        figures.extend([] if skipped else cockpit_figures(seconds))
    if core_build.kind() == core_build.COMPILED:
        # The same figures of both builds stand side by side in one table.
        figures = [figure._replace(name=f"{figure.name}_compiled") for figure in figures]
    if as_json:
        rows = [{"name": f.name, "value": round(f.value, 2), "unit": f.unit} for f in figures]
        print_json([*rows, *([{"name": "cockpit", "skipped": skipped}] if skipped else [])])
    else:
        for figure in figures:
            digits = 2 if figure.unit == "times" else 1
            print(f"{figure.name:36} {figure.value:>12,.{digits}f} {figure.unit}")  # noqa: T201 - the answer
        if skipped:
            print(f"cockpit_...: not measured, because {skipped}")  # noqa: T201 - the answer
    return 0


def _cases_per_minute(bench_file: BenchFile[Bench]) -> float:
    started = time.perf_counter()
    for seed in range(_CASES):
        outcome = execute_case(_CAMPAIGN.cases[0], bench_file, CaseSettings(seed=seed)).result
        if outcome.verdict is not Verdict.PASSED:
            raise CannotRunError(f"the fault case of the benchmark did not pass: {outcome.message}")
    return _CASES / (time.perf_counter() - started) * 60.0
