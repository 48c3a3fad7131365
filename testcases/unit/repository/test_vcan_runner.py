"""The program that provides a CAN interface: what it decides before anything boots."""

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

RUNNER = Path(__file__).resolve().parents[2] / "vcan" / "run.py"


@pytest.fixture(scope="module")
def runner():
    spec = importlib.util.spec_from_file_location("vcan_runner", RUNNER)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_modules_are_loaded_after_those_that_they_need(runner, tmp_path):
    """Dependencies come from `modules.dep`, each module once, and before every module that needs it."""
    (tmp_path / "modules.dep").write_text(
        "net/can.ko:\n"
        "net/can-raw.ko: net/can.ko\n"
        "net/can-bcm.ko: net/can.ko\n"
        "net/can-gw.ko.xz: net/can.ko\n"
        "dev/helper.ko:\n"
        "dev/can-dev.ko: dev/helper.ko\n"
        "vcan.ko: dev/can-dev.ko dev/helper.ko\n"
    )
    order = [path.relative_to(tmp_path).as_posix() for path in runner.modules_in_order(tmp_path)]
    assert order == [
        *("net/can.ko", "net/can-raw.ko", "net/can-bcm.ko", "net/can-gw.ko.xz"),
        *("dev/helper.ko", "dev/can-dev.ko", "vcan.ko"),
    ]


def test_a_kernel_without_can_is_named(runner, tmp_path):
    """A kernel whose modules lack CAN is refused with the name of the module."""
    (tmp_path / "modules.dep").write_text("net/other.ko:\n")
    with pytest.raises(runner.UnavailableError, match=r"has no module can$"):
        runner.modules_in_order(tmp_path)


def test_missing_programs_are_named_with_their_packages(runner, tmp_path, monkeypatch):
    """Without user-mode Linux the message says what to install."""
    monkeypatch.setattr(runner, "tool", lambda name: None)
    with pytest.raises(runner.UnavailableError, match="apt-get install user-mode-linux kmod iproute2"):
        runner.uml_command(["true"], "vcan0", tmp_path, 64)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["--interface", "can 0", "--", "true"],
            "--interface 'can 0' is not allowed; allowed: 1 to 15 letters",
        ),
        (["--timeout", "0", "--", "true"], "--timeout 0 is not allowed; allowed: more than 0 s"),
        ([], "the following arguments are required: command"),
    ],
)
def test_bad_arguments_are_refused(arguments, message):
    """Bad arguments end with exit code 2 and a message that names value and rule."""
    done = subprocess.run([sys.executable, RUNNER, *arguments], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert message in done.stderr


def test_the_command_gets_its_interface_or_the_reasons_are_told():
    """Either the command runs and finds the name in HIL_VCAN, or the exit code is 69 and the reasons are
    given.
    """
    check = "import os, sys; sys.exit(0 if os.environ['HIL_VCAN'] == 'hiltest0' else 3)"
    done = subprocess.run(
        [
            sys.executable,
            RUNNER,
            "--interface",
            "hiltest0",
            "--where",
            "host",
            "--",
            sys.executable,
            "-c",
            check,
        ],
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        assert done.returncode == 69
        assert "no SocketCAN interface hiltest0 to be had:\n  on this machine: " in done.stderr
    assert not Path("/sys/class/net/hiltest0").exists()


@pytest.mark.parametrize(("interface", "far"), [("vcan0", "vcan0b"), ("a" * 15, "a" * 14 + "b")])
def test_the_second_interface_has_a_name_that_the_kernel_takes(runner, interface, far):
    """It is called like the first with a letter behind, in the 15 characters that an interface may have."""
    assert runner.far_name(interface) == far


def test_both_interfaces_are_made_and_named_inside(runner, tmp_path):
    """The init script creates both and tells the command their names."""
    script = runner.init_script(["true"], "can7", tmp_path, [])
    assert "export HIL_VCAN=can7\n" in script
    assert "export HIL_VCAN_FAR=can7b\n" in script
    assert "for name in can7 can7b; do" in script
