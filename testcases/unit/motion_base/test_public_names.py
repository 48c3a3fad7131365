"""The public names of the controller."""

import subprocess
import sys

import pytest

import motion


def test_every_public_name_is_there():
    """What `motion` names can be imported from it; anything else is an AttributeError."""
    for name in motion.__all__:
        assert getattr(motion, name).__name__ == name
    assert not hasattr(motion, "TwinCat")


@pytest.mark.exhaustive
def test_importing_the_package_loads_no_dialect():
    """A user of profiles or ports does not pay for the S7 controller."""
    code = "import sys, motion, motion.setpoint, motion.kernel.servo_axis; print('motion.s7' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
