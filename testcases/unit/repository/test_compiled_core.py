"""What is compiled is a closed group of modules that exist, and a compiled core is used only if it fits the
sources.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path

import pytest

from fieldbus import core_build

ROOT = Path(core_build.__file__).resolve().parents[1]
CHECKOUT = Path(__file__).resolve().parents[3]


def ask(folder: Path, wanted: str) -> subprocess.CompletedProcess[str]:
    """Import the product with what lies in a folder as compiled core, and print what runs."""
    environment = {**os.environ, "HIL_CORE": wanted, "PYTHONPATH": f"{folder}{os.pathsep}{ROOT}"}
    program = "from fieldbus import core_build; import fieldbus.clock; print(core_build.described())"
    return subprocess.run(
        [sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=False
    )


def write_core(folder: Path, **changes: object) -> None:
    core = folder / core_build.PACKAGE
    core.mkdir()
    (core / "__init__.py").touch()
    clock = ROOT / "fieldbus" / "clock.py"
    content = {
        "modules": [],
        "python": EXTENSION_SUFFIXES[0],
        "sources": {"fieldbus/clock.py": [0, core_build.source_digest(clock)]},
    }
    (core / core_build.MANIFEST).write_text(json.dumps(content | changes))


def test_what_is_compiled_is_a_closed_group_of_modules_that_exist(monkeypatch):
    """Every module of core.toml exists, and no ordinary class inherits from a compiled one."""
    monkeypatch.syspath_prepend(str(CHECKOUT))
    from compile_core import compiled_modules

    found = compiled_modules()
    assert "emulators.drive.core" in found
    assert "emulators.drive.keys" not in found


def test_a_compiled_core_that_fits_is_used(tmp_path):
    """Times of files do not count, their content does; `pure` leaves it aside."""
    write_core(tmp_path)
    assert ask(tmp_path, "auto").stdout.startswith("compiled (0 modules of ")
    assert ask(tmp_path, "pure").stdout == "pure (HIL_CORE=pure)\n"


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"sources": {"fieldbus/clock.py": [0, "another"]}}, "made from another fieldbus/clock.py"),
        ({"sources": {"fieldbus/gone.py": [0, "another"]}}, "made with fieldbus/gone.py, which is not there"),
        ({"python": ".cpython-27.so"}, "is for .cpython-27.so"),
    ],
)
def test_a_compiled_core_that_does_not_fit_is_not_used_and_said(tmp_path, changes, reason):
    """With `auto` the program runs pure and says why; with `compiled` nothing is imported."""
    write_core(tmp_path, **changes)
    done = ask(tmp_path, "auto")
    assert done.stdout.startswith("pure (the compiled core ")
    assert reason in done.stderr
    refused = ask(tmp_path, "compiled")
    assert refused.returncode
    assert reason in refused.stderr


def test_what_the_variable_may_say(tmp_path):
    """Another value than the three, and `compiled` without a compiled core, are refused."""
    assert "'fast' is not one of auto, pure, compiled" in ask(tmp_path, "fast").stderr
    if core_build.described() != "pure (HIL_CORE=pure)":
        return
    assert ask(tmp_path, "auto").returncode == 0
