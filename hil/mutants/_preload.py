"""Imports the whole product, for processes that are copies of the one that has done so: an import is most of
a case's time.
"""

from __future__ import annotations

import importlib
import pkgutil
from contextlib import suppress
from types import ModuleType

import emulators
import fieldbus
import hil.bench
import hil.campaign
import hil.expect
import hil.faults
import hil.record
import motion

# Imported here although nothing uses it: the processes do.
import hil.mutants._worker  # isort: skip


def _import_all(package: ModuleType) -> None:
    for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
        with suppress(ImportError):  # what an optional package or another system is needed for
            importlib.import_module(module.name)


for _package in (fieldbus, emulators, motion, hil.bench, hil.campaign, hil.expect, hil.faults, hil.record):
    _import_all(_package)
