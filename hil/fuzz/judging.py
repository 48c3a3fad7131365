"""Generated programs as cases of a campaign: what a search would try first, so that they can judge defects.

They are drawn without running anything: half of them for machines with one to three axes, the others for the
embedded benches.
"""

from __future__ import annotations

import json
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Final

from hil.configurations import CONFIGURATION
from hil.fuzz._configuration import MACHINE
from hil.fuzz._files import program_text, write_files
from hil.fuzz._program import Program
from hil.fuzz._regressions import CAMPAIGN_TEXT, MODULE

if TYPE_CHECKING:
    from hypothesis.strategies import SearchStrategy

LONGEST: Final = 12
"""Steps of a program, as of `hil fuzz`."""
_BENCHES: Final = ("reference", "profidrive", "profidrive_tcp", "analog", "stepper", "speed")
"""Embedded benches of the programs without another machine, in turn."""


def write_programs(folder: Path, number: int, seed: int) -> Path:
    """Draw programs, write them as a campaign of kept programs, and return its file.

    Args:
        folder: Where to; it is made when it is not there, and files of another draw in it are deleted.
        number: How many.
        seed: Of the draw and of the benches; the same one gives the same programs.

    Raises:
        CannotRunError: Nothing can be written there.

    """
    files = {MODULE: CAMPAIGN_TEXT}
    for at, (bench, program) in enumerate(_drawn(number, seed)):
        head = "".join(
            f" {json.dumps(key)}: {json.dumps(value)},\n"
            for key, value in (("title", f"Fuzz program {at}"), ("bench", bench), ("seed", seed))
        )
        files[f"{at:04}.json"] = f'{{\n{head} "program": {program_text(program, " ")}\n}}\n'
    for old in folder.glob("*.json"):
        if old.name not in files:
            old.unlink()
    write_files(folder, files)
    return folder / MODULE


def _drawn(number: int, seed: int) -> list[tuple[str, Program]]:
    """Return programs with their benches."""
    from hil.campaign import load_bench_file
    from hil.fuzz._machines import Machine, machine_names, on_machines
    from hil.fuzz._strategies import UNCHANGED

    found: list[tuple[str, Program]] = []
    for program in _examples(on_machines(machine_names(seed), LONGEST), (number + 1) // 2, seed):
        name = program.configuration.parts[MACHINE]["name"]
        found.append((f"{CONFIGURATION}{name}", Program(program.steps)))
    left = number - len(found)
    for at, bench in enumerate(_BENCHES):
        share = len(range(at, left, len(_BENCHES)))
        if not share:
            continue
        with load_bench_file(bench).build(seed=seed) as sample:
            strategy = Machine.of(sample).programs(LONGEST, UNCHANGED)
        found += [(bench, program) for program in _examples(strategy, share, seed)]
    return found


def _examples(strategy: SearchStrategy[Program], number: int, seed: int) -> list[Program]:
    """Return programs as a search draws them, the shortest left out."""
    import hypothesis
    from hypothesis.errors import HypothesisWarning

    from hil.fuzz._provider import BACKEND

    drawn: list[Program] = []

    def take(program: Program) -> None:
        drawn.append(program)

    settings = hypothesis.settings(
        max_examples=number + number // 4 + 10,
        deadline=None,
        database=None,
        derandomize=False,
        suppress_health_check=list(hypothesis.HealthCheck),
        phases=(hypothesis.Phase.generate,),
        backend=BACKEND,
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", HypothesisWarning)
        hypothesis.seed(seed)(settings(hypothesis.given(strategy)(take)))()
    different = {program.name: program for program in drawn}.values()
    return sorted(different, key=lambda program: -len(program.steps))[:number]
