"""EDS and DCF files of the product in the strict mode of dcf-tools, the EDS checker of lely-core."""

import subprocess
import sys
from pathlib import Path

import pytest

from hil.cli import main

pytestmark = pytest.mark.peers

ROOT = Path(__file__).resolve().parents[2]
SHIPPED = sorted((ROOT / "emulators").rglob("*.eds"))


def check(path):
    """Return what the checker says; nothing: the file is good."""
    done = subprocess.run(
        [sys.executable, "-c", "from dcf.cli import main; main()", "-n", "5", str(path)],
        capture_output=True,
        text=True,
        check=False,
    )
    return done.stdout + done.stderr + (f"exit code {done.returncode}" if done.returncode else "")


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_shipped_files_are_good(path):
    """The EDS of every emulated device has nothing that the checker does not know."""
    assert check(path) == ""


@pytest.mark.parametrize("options", [[], ["--dcf"]], ids=["eds", "dcf"])
@pytest.mark.parametrize("bench", ["reference", "profidrive"])
def test_exported_files_are_good(bench, options, tmp_path):
    """So does what `hil eds` writes."""
    path = tmp_path / "exported.eds"
    assert main(["eds", bench, *options, "--output", str(path)]) == 0
    assert check(path) == ""


def test_the_checker_finds_mistakes(tmp_path):
    """A key of another tool is found: the checker is strict."""
    path = tmp_path / "wrong.eds"
    path.write_text(SHIPPED[0].read_text().replace("AccessType=", "StorageLocation=RAM\nAccessType=", 1))
    assert "invalid entry" in check(path)
