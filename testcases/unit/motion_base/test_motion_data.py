"""The data files of the motion runtime."""

import json
import subprocess
import sys

import pytest

from motion.s7.data import load


def test_files_are_self_contained():
    """The data name the public documents they come from and no place of work."""
    text = json.dumps([load("to_variables"), load("technology_alarms")])

    for word in ("seed", "§", "/work", ".txt", ".md"):
        assert word not in text


@pytest.mark.exhaustive
def test_loading_needs_nothing_but_the_files():
    """Variables and alarms load without the YAML library that made the data, and without numpy."""
    program = (
        "import sys; from motion.s7.variables import VariableStore; from motion.s7.alarms import catalogue;"
        "VariableStore('PositioningAxis'); catalogue();"
        "print(sorted({'yaml', 'numpy', 'pydantic', 'ruckig'} & set(sys.modules)))"
    )

    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)

    assert done.stdout.strip() == "[]"
