"""Generated programs as cases of a campaign: what a search would try first, so that they can judge defects.

They are drawn without running anything: half of them for machines with one to three axes, the others for
benches that are there.
"""

from __future__ import annotations

import json
import random
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Final

from hil.configurations import CONFIGURATION
from hil.fuzz._configuration import MACHINE
from hil.fuzz._files import program_text, write_files
from hil.fuzz._program import Program
from hil.fuzz._regressions import MODULE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hypothesis.strategies import SearchStrategy

LONGEST: Final = 24
"""Steps of a program: twice as many as in `hil fuzz`, whose programs go on from one another."""
_CAMPAIGN_TEXT: Final = '''"""Generated programs that judge defects."""

from pathlib import Path

from hil.fuzz import regressions

CAMPAIGN = regressions(Path(__file__).parent, "programs", complete=False)
'''
PROGRAMS_OF_A_MACHINE: Final = 3
"""So many programs share a machine: each of them is built once to see what can be done on it."""


def write_programs(folder: Path, number: int, seed: int, benches: Sequence[str]) -> Path:
    """Draw programs, write them as a campaign of kept programs, and return its file.

    Args:
        folder: Where to; it is made when it is not there, and files of another draw in it are deleted.
        number: How many.
        seed: Of the draw and of the benches; the same one gives the same programs.
        benches: References of benches; half of the programs run on them, the others on configurations.

    Raises:
        CannotRunError: Nothing can be written there.

    """
    files = {MODULE: _CAMPAIGN_TEXT}
    for at, (bench, program) in enumerate(_drawn(number, seed, benches)):
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


def _drawn(number: int, seed: int, benches: Sequence[str]) -> list[tuple[str, Program]]:
    """Return programs with their benches."""
    from hil.campaign import load_bench_file
    from hil.fuzz._machines import Machine, axes_of, machine_names, on_machines
    from hil.fuzz._strategies import UNCHANGED

    found: list[tuple[str, Program]] = []
    half = (number + 1) // 2 if benches else number
    names = machine_names(seed, -(-half // PROGRAMS_OF_A_MACHINE))
    for program in _examples(on_machines(names, LONGEST), half, seed):
        name = program.configuration.parts[MACHINE]["name"]
        found.append((f"{CONFIGURATION}{name}", Program(program.steps)))
    dice = random.Random(f"benches {seed}")  # noqa: S311 - repeatable, not secret
    order = dice.sample(list(benches), len(benches))
    left = number - len(found)
    for at, bench in enumerate(order):
        share = len(range(at, left, len(order)))
        if not share:
            continue
        with load_bench_file(bench).build(seed=seed) as sample:
            strategy = Machine.of(sample, axes_of(sample)).programs(LONGEST, UNCHANGED)
        found += [(bench, program) for program in _examples(strategy, share, seed + at)]
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
