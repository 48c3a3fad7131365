"""How the HTML report scales: a large made-up run, the time to build its report, and what a browser takes to
use it.

    python -m testcases.benchmarks.report_scale [--cases 5000] [--source hil-report] [--folder DIR]

The cases are those of a real run, repeated: signals scaled and shifted in time differently in each, some
verdicts turned. Without `--source` the campaign `stop_modes` runs first. Figures come as JSON on standard
output.
"""

from __future__ import annotations

import argparse
import dataclasses
import hashlib
import json
import resource
import shutil
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from hil._requirements import complete
from hil.campaign import Runner, RunOptions, find_campaigns, select_cases
from hil.campaign._runner import clear_run
from reports import (
    HISTORY_FILE,
    CaseResult,
    RunResult,
    Verdict,
    finish_run,
    load_run,
    remember,
    start_run,
    write_case,
    write_report,
)
from reports.store import RUN_FILE

_READY = "return document.querySelectorAll('#cases tbody tr').length > 0"
_FILTER = """
const box = document.querySelector("#f-q");
const began = performance.now();
box.value = arguments[0];
box.dispatchEvent(new Event("input"));
document.body.offsetHeight;
return performance.now() - began;
"""


def variation(case: CaseResult, number: int) -> CaseResult:
    """Return a case that is like another one but equal to none."""
    rng = np.random.default_rng(number)
    scale, noise = 1 + 0.2 * rng.random(), 1e-4 * rng.random()
    signals = [
        signal
        if signal.enum or not signal.unit
        else dataclasses.replace(
            signal,
            values=signal.values * scale
            + noise * np.ptp(signal.values) * rng.normal(size=len(signal.values)),
        )
        for signal in case.signals
    ]
    changed = dataclasses.replace(
        case,
        identifier=f"{case.identifier}/{number:05d}",
        title=f"{case.title}, variation {number}",
        seed=number,
        signals=signals,
        trace_digest=hashlib.sha256(f"{case.trace_digest}{number}".encode()).hexdigest(),
        wall_s=case.wall_s * scale,
    )
    if number % 97 == 0 and case.checks:
        first, *others = case.checks
        changed.verdict = Verdict.FAILED
        changed.checks = [
            dataclasses.replace(first, verdict=Verdict.FAILED, observed="something else"),
            *others,
        ]
    return changed


def large_run(source: RunResult, cases: int, folder: Path) -> RunResult:
    """Return a run of as many cases, made of those of another one, as it is when its journal is in a
    folder.
    """
    run = dataclasses.replace(source, title=f"{cases} cases made of {len(source.cases)}", cases=[])
    if (folder / RUN_FILE).exists():
        clear_run(folder)
    start_run(folder, run)
    for number in range(cases):
        run.cases.append(write_case(folder, variation(source.cases[number % len(source.cases)], number)))
    finish_run(folder)
    complete(run)
    return run


def browse(page: Path) -> dict[str, float]:
    """Return what Chromium takes to open the list, to filter it and to open a case."""
    from selenium import webdriver

    options = webdriver.ChromeOptions()
    for flag in ("--headless=new", "--no-sandbox", "--disable-gpu", "--enable-precise-memory-info"):
        options.add_argument(flag)
    options.binary_location = str(shutil.which("chromium"))
    driver = webdriver.Chrome(
        options=options, service=webdriver.ChromeService(str(shutil.which("chromedriver")))
    )
    try:
        driver.get("about:blank")
        driver.get(page.as_uri())
        assert driver.execute_script(_READY), "the list is not there when the page has loaded"
        timing = driver.execute_script("return performance.getEntriesByType('navigation')[0].toJSON()")
        filters = [driver.execute_script(_FILTER, text) for text in ("standstill", "failed", "zzz", "")]
        sort = driver.execute_script(
            "const t = performance.now(); document.querySelector('[data-sort=n]').click(); "
            "document.body.offsetHeight;"
            "return performance.now() - t;"
        )
        driver.execute_cdp_cmd("HeapProfiler.collectGarbage", {})
        heap = driver.execute_script("return performance.memory.usedJSHeapSize")
        began = time.perf_counter()
        driver.execute_script("document.querySelector('#cases tbody tr a.id').click()")
        while not driver.find_elements("css selector", ".checks, .story"):
            pass
        words = time.perf_counter() - began
        while not driver.find_elements("css selector", ".curve canvas"):
            pass
        return {
            "list_usable_s": round(timing["loadEventEnd"] / 1e3, 3),
            "filter_ms": round(max(filters), 1),
            "sort_ms": round(sort, 1),
            "heap_mb": round(heap / 1e6, 1),
            "case_words_s": round(words, 3),
            "case_plot_s": round(time.perf_counter() - began, 3),
        }
    finally:
        driver.quit()


def main(arguments: list[str] | None = None) -> int:
    """Measure, print figures, return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--cases", type=int, default=5000)
    parser.add_argument("--source", type=Path, help="report folder of the run whose cases are repeated")
    parser.add_argument(
        "--folder", type=Path, help="where the large report goes; default: a folder that is deleted again"
    )
    chosen = parser.parse_args(arguments)
    if chosen.source is not None:
        source = load_run(chosen.source)
    else:
        cases = select_cases(find_campaigns(["testcases.campaigns.stop_modes"]))
        source = Runner(cases, RunOptions()).run()
    with tempfile.TemporaryDirectory() as scratch:
        folder = chosen.folder or Path(scratch)
        run = large_run(source, chosen.cases, folder)
        wall, cpu = time.perf_counter(), time.process_time()
        background = remember(run, folder / HISTORY_FILE)
        recorded = time.perf_counter() - wall
        paths = write_report(run, folder, background=background)
        figures: dict[str, float] = {
            "cases": len(run.cases),
            "build_s": round(time.perf_counter() - wall, 1),
            "of_it_history_s": round(recorded, 1),
            "build_cpu_s": round(time.process_time() - cpu, 1),
            "peak_memory_mb": round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024),
            "page_mb": round(paths.report.stat().st_size / 1e6, 1),
            "data_mb": round(sum(file.stat().st_size for file in folder.glob("report-data/*")) / 1e6, 1),
        }
        figures.update(browse(paths.report))
    json.dump(figures, sys.stdout, indent=1)
    print()
    return 0


if __name__ == "__main__":
    sys.exit(main())
