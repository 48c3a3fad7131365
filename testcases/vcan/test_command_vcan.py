"""`hil vcan` where the kernel has the module: an interface that is there, and one made for the command."""

import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.vcan


def hil_vcan(*arguments, folder):
    return subprocess.run(
        [sys.executable, "-m", "hil.cli", "vcan", "--where", "host", *arguments],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )


def test_an_interface_that_is_there_is_taken_and_left(vcan_channel, tmp_path):
    """The command gets the interface of the machine, and it is there afterwards."""
    done = hil_vcan("-i", vcan_channel, "--", "cansend", vcan_channel, "123#", folder=tmp_path)
    assert (done.returncode, done.stderr) == (0, f"hil vcan: {vcan_channel} on this machine\n")
    assert Path(f"/sys/class/net/{vcan_channel}").exists()


def test_an_interface_is_made_and_removed(vcan_channel, tmp_path):
    """What `ip link` can create is there for the command, as well as one that exists, and gone after it."""
    script = "cansend hiltest1 1#; test -e /sys/class/net/$HIL_VCAN_2 || exit 9; exit 5"
    done = hil_vcan("-i", vcan_channel, "-i", "hiltest1", "--", "sh", "-c", script, folder=tmp_path)
    assert done.returncode == 5, done.stderr
    assert not Path("/sys/class/net/hiltest1").exists()


def test_an_interface_of_another_kind_is_refused(tmp_path):
    """An interface that is not CAN is not taken, and the message says so."""
    done = hil_vcan("-i", "lo", "--", "true", folder=tmp_path)
    assert done.returncode == 69
    assert "on this machine: lo is there, but is not a CAN interface" in done.stderr
