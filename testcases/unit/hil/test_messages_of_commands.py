"""What commands say when something is in the way: a full disk, no CAN interface, a wrong kind of file."""

import resource
import socket
import subprocess
import sys

import pytest

from hil.cli import main


def test_a_bench_file_is_no_campaign(tmp_path, capsys):
    """`hil run bench.toml` says what the file is and which commands take it."""
    path = tmp_path / "bench.toml"
    path.write_text('[bench]\nname = "cell"\n[segment.can0]\n[drive.d]\nsegment = "can0"\nnode_id = 1\n')
    assert main(["run", str(path)]) == 2
    said = capsys.readouterr().err
    assert f"{path} is a bench file, no campaign: check it with `hil check {path}`" in said
    assert f"pytest --hil-bench {path}" in said


@pytest.mark.exhaustive
def test_a_disk_that_takes_no_more_names_the_file(tmp_path):
    """Whatever file cannot be written to its end is named, in one line, with exit code 2."""

    def little():
        resource.setrlimit(resource.RLIMIT_FSIZE, (4096, resource.RLIM_INFINITY))

    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "motion_hil",
            "run",
            "stop_modes",
            "-k",
            "halt",
            "--report",
            str(tmp_path / "r"),
        ],
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=little,
    )
    assert done.returncode == 2
    last = done.stderr.splitlines()[-1]
    assert last.startswith(f"hil: {tmp_path / 'r'}/")
    assert last.endswith(": File too large")
    assert "Traceback" not in done.stderr


def test_a_missing_can_interface_names_what_there_is_instead(capsys):
    """Without SocketCAN, or without this interface, the message has ways that need neither."""
    assert main(["emulate", "live", "--channel", "hilnone0", "--for", "0.1"]) == 2
    said = capsys.readouterr().err
    for way in ("`hil vcan --`", "`udp_multicast`", "`hil emulate --adapter slcan`"):
        assert way in said


def _free_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


@pytest.mark.exhaustive
def test_drives_of_a_virtual_bench_are_served_at_a_fixed_port(capsys):
    """`--port` is where the first drive with Modbus TCP answers."""
    port = _free_port()
    assert main(["emulate", "profidrive_tcp", "--port", str(port), "--for", "0.2"]) == 0
    assert f"Modbus TCP on 127.0.0.1:{port}" in capsys.readouterr().err


def test_a_port_needs_a_drive_on_modbus_tcp(capsys):
    """A bench without such a drive refuses the option."""
    assert main(["emulate", "reference", "--port", "5020"]) == 2
    assert "--port: 5020 is not allowed; allowed: for drives on Modbus TCP only" in capsys.readouterr().err
