"""`hil vcan`: names, what is missing in words, exit codes; a command of another project on a real bus."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from hil.cli import main
from hil.vcan import UnavailableError, interface_names, variables
from hil.vcan._tools import tool
from hil.vcan._uml import check_installed, init_script, modules_in_order


def test_modules_are_loaded_after_those_that_they_need(tmp_path):
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
    order = [path.relative_to(tmp_path).as_posix() for path in modules_in_order(tmp_path)]
    assert order == [
        *("net/can.ko", "net/can-raw.ko", "net/can-bcm.ko", "net/can-gw.ko.xz"),
        *("dev/helper.ko", "dev/can-dev.ko", "vcan.ko"),
    ]


def test_a_kernel_without_can_is_named(tmp_path):
    """A kernel whose modules lack CAN is refused with the name of the module."""
    (tmp_path / "modules.dep").write_text("net/other.ko:\n")
    with pytest.raises(UnavailableError, match=r"has no module can$"):
        modules_in_order(tmp_path)


def test_missing_programs_are_named_with_their_packages(monkeypatch):
    """Without user-mode Linux the message says what to install."""
    monkeypatch.setattr("hil.vcan._uml.tool", lambda name: None)
    with pytest.raises(UnavailableError, match="apt-get install user-mode-linux kmod iproute2"):
        check_installed()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["-i", "can 0", "--", "true"], "--interface: 'can 0' is not allowed; allowed: 1 to 15 letters"),
        (["-i", "a", "-i", "a", "--", "true"], "--interface: 'a' is not allowed; allowed: each name once"),
        (["-i", "a", "-i", "b", "-n", "1", "--", "true"], "--count: 1 is not allowed; allowed: 2 "),
        (["-n", "17", "--", "true"], "--count: 17 is not allowed; allowed: 1 (names that are given) to 16"),
        (["--where", "moon", "--", "true"], "--where: 'moon' is not allowed; allowed: auto, host or uml"),
        (["--timeout=-1", "--", "true"], "--timeout"),
        ([], "Missing argument 'COMMAND'"),
    ],
    ids=lambda value: "_".join(value) if isinstance(value, list) else "",
)
def test_bad_arguments_are_refused(arguments, message, capsys):
    """Bad arguments end with exit code 2 and a message that names value and rule."""
    assert main(["vcan", *arguments]) == 2
    assert message in capsys.readouterr().err


@pytest.mark.exhaustive
def test_a_program_that_is_not_there_is_reported_before_anything_boots(capsys, tmp_path):
    """Exit codes 127 and 126 as of a shell: no such program, or it may not be executed."""
    (tmp_path / "data.txt").write_text("1")
    assert main(["vcan", "--", "no-such-program"]) == 127
    assert capsys.readouterr().err == "hil vcan: no-such-program: no such command\n"
    assert main(["vcan", "--", str(tmp_path / "data.txt")]) == 126
    assert capsys.readouterr().err == f"hil vcan: {tmp_path / 'data.txt'}: not executable\n"


@pytest.mark.exhaustive
def test_the_command_gets_its_interface_or_the_reasons_are_reported():
    """Either the command runs here and finds the name in HIL_VCAN, or it ends with 69 and the reason; nothing
    is left behind.
    """
    check = "import os, sys; sys.exit(0 if os.environ['HIL_VCAN'] == 'hiltest0' else 3)"
    options = ("-i", "hiltest0", "--where", "host")
    done = subprocess.run(
        [sys.executable, "-m", "hil.cli", "vcan", *options, "--", sys.executable, "-c", check],
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        assert done.returncode == 69
        assert "no SocketCAN interface hiltest0 to be had\n  on this machine: `ip link" in done.stderr
    assert not Path("/sys/class/net/hiltest0").exists()


@pytest.mark.parametrize(
    ("given", "count", "names"),
    [
        ([], 0, ["vcan0"]),
        ([], 3, ["vcan0", "vcan1", "vcan2"]),
        (["can9"], 2, ["can9", "can10"]),
        (["bus"], 2, ["bus", "bus1"]),
        (["b1", "b0"], 4, ["b1", "b0", "b2", "b3"]),
        (["a" * 15], 2, ["a" * 15, "a" * 14 + "1"]),
    ],
)
def test_interfaces_without_a_name_are_numbered_on(given, count, names):
    """They go on from the last name, in the 15 characters that a name may have, and never take one twice."""
    assert interface_names(given, count) == names


def test_names_are_in_the_environment():
    """HIL_VCAN and its like name all interfaces; the bus of python-can is set unless the user has set one."""
    assert variables(["can7", "can8"], {}) == {
        "HIL_VCAN": "can7",
        "HIL_VCAN_2": "can8",
        "CAN_INTERFACE": "socketcan",
        "CAN_CHANNEL": "can7",
    }
    assert variables(["can7"], {"CAN_INTERFACE": "virtual"}) == {"HIL_VCAN": "can7"}


def test_all_interfaces_are_made_inside(tmp_path):
    """The init script creates every interface and hands the environment to the command."""
    script = init_script(["echo", "a b"], ["can7", "can8"], {"X": "1 2", "a-b": "3"}, tmp_path, [])
    assert "export X='1 2'\n" in script
    assert "a-b" not in script
    assert "for name in can7 can8; do" in script
    assert "setsid echo 'a b' <" in script


FOREIGN = """
import subprocess, sys, can
with can.Bus() as bus, can.Bus(channel="can8", interface="socketcan") as far:
    for number in range(3):
        bus.send(can.Message(arbitration_id=0x181, data=[number], is_extended_id=False))
    subprocess.run(["cansend", "can7", "601#4041600000000000"], check=True)
    answer = bus.recv(20.0)
    print(f"{answer.arbitration_id:X}", bytes(answer.data).hex(), sys.stdin.read().strip())
    print("nothing on the other bus" if far.recv(0.0) is None else "crosstalk", file=sys.stderr)
sys.exit(7)
"""
BOTH = """
sleep 500 &
candump -L -n 4 can7 > dump.log &
until grep -q can7 /proc/net/can/rcvlist_all; do sleep 0.1; done
{python} foreign.py < input.txt; code=$?
wait $!; exit $code
"""


@pytest.mark.exhaustive
@pytest.mark.skipif(
    tool("linux.uml") is None or tool("candump") is None, reason="needs user-mode-linux and can-utils"
)
def test_a_script_of_another_project_in_user_mode_linux(tmp_path):
    """In an empty folder a python-can script that names no bus talks with candump and cansend; exit code,
    input, output and errors are those of the command; its files stay, what it left running is gone.
    """
    (tmp_path / "foreign.py").write_text(FOREIGN)
    (tmp_path / "input.txt").write_text("from a file\n")
    (tmp_path / "both.sh").write_text(BOTH.format(python=sys.executable))
    command = [sys.executable, "-m", "hil.cli", "vcan", "--where", "uml", "-i", "can7", "-n", "2"]
    temporary = tmp_path / "tmp"
    temporary.mkdir()
    done = subprocess.run(
        [*command, "--timeout", "300", "--", "sh", "both.sh"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(map(os.path.abspath, filter(None, sys.path)))}
        | {"TMPDIR": str(temporary)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout, done.stderr.splitlines()) == (
        7,
        "601 4041600000000000 from a file\n",
        ["hil vcan: can7 and can8 in user-mode Linux", "nothing on the other bus"],
    )
    dump = (tmp_path / "dump.log").read_text().splitlines()
    assert [line.split()[1:] for line in dump] == [
        ["can7", frame] for frame in ("181#00", "181#01", "181#02", "601#4041600000000000")
    ]
    assert not list(temporary.iterdir())


@pytest.mark.exhaustive
@pytest.mark.skipif(tool("linux.uml") is None, reason="needs user-mode-linux")
def test_a_command_whose_time_is_up(tmp_path):
    """It ends with 124 and a sentence, and nothing of it is left."""
    done = subprocess.run(
        [sys.executable, "-m", "hil.cli", "vcan", "--where", "uml", "--timeout", "1", "--", "sleep", "500"],
        env={**os.environ, "TMPDIR": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 124
    assert done.stderr.endswith("hil vcan: the command took longer than 1 s\n")
    assert not list(tmp_path.iterdir())


@pytest.mark.exhaustive
def test_the_module_needs_no_library(tmp_path):
    """`hil.vcan` imports with the standard library alone: `./run` asks before anything is installed."""
    root = Path(__file__).resolve().parents[3]
    for name in ("hil", "fieldbus"):
        (tmp_path / name).symlink_to(root / name)
    code = "import sys; sys.path.insert(0, sys.argv[1]); import hil.vcan; hil.vcan.interface_names(['a'])"
    subprocess.run([sys.executable, "-I", "-S", "-c", code, str(tmp_path)], check=True)
