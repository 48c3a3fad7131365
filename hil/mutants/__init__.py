"""Defect seeding: plausible defects of drive, mechanics, bus and controller, switched on one at a time, to be
caught by campaigns.

A defect is data (`Mutant`): a place in the product, the present text and the text that replaces it. `Seeder`
runs the campaigns without any defect first, and then each defect in a process of its own until a case is red.
A defect that no case notices points at a missing expectation. `draw` takes defects from the source by a
program.
"""

from __future__ import annotations

from hil.mutants._catalogue import CATALOGUE, load_catalogue, select_mutants
from hil.mutants._coverage import Coverage
from hil.mutants._mechanical import draw
from hil.mutants._mutant import AREAS, PACKAGES, Edit, Mutant, defect
from hil.mutants._patch import TargetChangedError, seeded, watched
from hil.mutants._plan import Judge, find_judges, hinted, in_order
from hil.mutants._results import (
    Credit,
    Share,
    Stored,
    as_run,
    catalogue_table,
    credits_of,
    load_stored,
    markdown,
    shares,
    store,
)
from hil.mutants._seeding import MutantResult, Seeder, Seeding, SeedingOptions
from hil.mutants._tests import find_test_files
from hil.mutants._unreached import ModuleReach, line_ranges, reach
from hil.mutants._worker import Outcome

__all__ = [
    "AREAS",
    "CATALOGUE",
    "PACKAGES",
    "Coverage",
    "Credit",
    "Edit",
    "Judge",
    "ModuleReach",
    "Mutant",
    "MutantResult",
    "Outcome",
    "Seeder",
    "Seeding",
    "SeedingOptions",
    "Share",
    "Stored",
    "TargetChangedError",
    "as_run",
    "catalogue_table",
    "credits_of",
    "defect",
    "draw",
    "find_judges",
    "find_test_files",
    "hinted",
    "in_order",
    "line_ranges",
    "load_catalogue",
    "load_stored",
    "markdown",
    "reach",
    "seeded",
    "select_mutants",
    "shares",
    "store",
    "watched",
]
