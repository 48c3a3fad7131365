#!/usr/bin/env python3
"""Run a command where a SocketCAN interface exists.

    python testcases/vcan/run.py [options] -- <command> [arguments...]

The command finds the name of the interface in the environment variable HIL_VCAN, and that of a second one,
not connected to it, in HIL_VCAN_FAR. Three ways, in this order:

1. the interface ($HIL_VCAN, else vcan0) exists on this machine: the command runs here;
2. it can be created here with `ip link` (the kernel has the vcan module, and we are root or have sudo):
   it is created, the command runs here, the interface is removed again;
3. user-mode Linux, an ordinary program of the Debian package `user-mode-linux`, boots on this machine's own
   file system, loads the CAN modules that come with it, and runs the command inside: the same files at the
   same paths, the same Python environment, but one processor, no network and slow system calls.

Exit code: that of the command; 124 when the time ran out; 69 when no way is open (the message says what to
install); 70 when user-mode Linux ended before the command did. Needs nothing but the standard library.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import re
import shlex
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

EXIT_TIMEOUT = 124
EXIT_UNAVAILABLE = 69
EXIT_CRASHED = 70

MODULES = ("can", "can-raw", "can-bcm", "can-gw", "vcan")
"""Modules to load in user-mode Linux, before what `modules.dep` adds to them."""
MODULES_ROOT = Path("/usr/lib/uml/modules")
PACKAGES = {"linux.uml": "user-mode-linux", "insmod": "kmod", "ip": "iproute2"}
"""Programs that user-mode Linux needs, and the Debian packages that have them."""

BEGIN = "::hil-vcan begin::"
END = "::hil-vcan end::"

ARPHRD_CAN = 280
IFF_UP = 1


class UnavailableError(Exception):
    """This way to an interface is closed; the message says why."""


# -------------------------------------------------------------------------------------------- on this machine


def tool(name: str) -> str | None:
    """Return the path of a program, also where an ordinary user's PATH lacks the sbin directories."""
    return shutil.which(name) or shutil.which(name, path="/usr/local/sbin:/usr/sbin:/sbin:/usr/bin:/bin")


def as_root(*command: str) -> list[str]:
    """Return `command` so that it runs with root's rights, without ever asking for a password."""
    path = tool(command[0])
    if path is None:
        raise UnavailableError(f"{command[0]} is not installed")
    if os.geteuid() == 0:
        return [path, *command[1:]]
    sudo = tool("sudo")
    if sudo is None:
        raise UnavailableError("not root, and sudo is not installed")
    return [sudo, "-n", path, *command[1:]]


def execute_as_root(*command: str) -> None:
    done = subprocess.run(
        as_root(*command), check=False, capture_output=True, text=True, stdin=subprocess.DEVNULL
    )
    if done.returncode:
        said = (done.stderr or done.stdout).strip().splitlines() or [f"exit code {done.returncode}"]
        raise UnavailableError(f"{' '.join(command)}: {said[-1]}")


def far_name(interface: str) -> str:
    """Return the name of the second interface."""
    return interface[:14] + "b"


def check_socket(interface: str) -> None:
    """Open a raw CAN socket on `interface`: the proof that programs can use it."""
    try:
        with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as probe:
            probe.bind((interface,))
    except OSError as error:
        raise UnavailableError(f"a CAN socket on {interface}: {error.strerror or error}") from error


def open_on_host(interface: str) -> bool:
    """Provide `interface` on this machine; return whether it had to be created.

    Raises:
        UnavailableError: It does not exist and cannot be created.

    """
    system = Path("/sys/class/net") / interface
    if system.exists():
        kind = int((system / "type").read_text())
        if kind != ARPHRD_CAN:
            raise UnavailableError(f"{interface} is not a CAN interface")
        if not int((system / "flags").read_text(), 0) & IFF_UP:
            execute_as_root("ip", "link", "set", interface, "up")
        check_socket(interface)
        return False
    execute_as_root("ip", "link", "add", "dev", interface, "type", "vcan")
    try:
        execute_as_root("ip", "link", "set", interface, "up")
        check_socket(interface)
    except UnavailableError:
        remove_from_host(interface)
        raise
    return True


def remove_from_host(interface: str) -> None:
    """Take away an interface that `open_on_host` created."""
    subprocess.run(as_root("ip", "link", "del", interface), check=False, capture_output=True)


def run_on_host(command: list[str], interfaces: list[str], timeout_s: float) -> int:
    """Run `command` here with its output going straight to ours."""
    environment = {**os.environ, **dict(zip(("HIL_VCAN", "HIL_VCAN_FAR"), interfaces, strict=False))}
    process = subprocess.Popen(command, env=environment, start_new_session=True)
    try:
        return process.wait(timeout_s)
    except subprocess.TimeoutExpired:
        print(f"{PROGRAM}: the command took longer than {timeout_s:g} s", file=sys.stderr)
        return EXIT_TIMEOUT
    finally:
        kill_group(process)


def kill_group(process: subprocess.Popen[bytes]) -> None:
    """End a process with everything that it started."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


# ----------------------------------------------------------------------------------------- in user-mode Linux


def modules_in_order(release: Path) -> list[Path]:
    """Return the files of `MODULES` and of what they need, each after the modules that it needs."""
    depends: dict[str, list[str]] = {}
    for line in (release / "modules.dep").read_text().splitlines():
        file, _, needed = line.partition(":")
        depends[file] = needed.split()
    by_name = {re.sub(r"\.ko(\..*)?$", "", Path(file).name): file for file in depends}
    order: list[str] = []
    for module in MODULES:
        if module not in by_name:
            raise UnavailableError(f"{release} has no module {module}")
        # modprobe's rule: the last module of a line has to go in first
        order += [
            file for file in (*reversed(depends[by_name[module]]), by_name[module]) if file not in order
        ]
    return [release / file for file in order]


def init_script(command: list[str], interface: str, state: Path, modules: list[Path]) -> str:
    """Return the program that is process 1 inside: it prepares the system, runs `command` and powers off."""
    environment = {
        **{name: value for name, value in os.environ.items() if name.isidentifier()},
        "HIL_VCAN": interface,
        "HIL_VCAN_FAR": far_name(interface),
        "HIL_VCAN_WHERE": "host",  # for a run.py inside
        # the host's temporary directory stays visible, but a file system in memory is faster and leaves
        # nothing
        "TMPDIR": "/dev/shm",
        "PYTHONUNBUFFERED": "1",
        "COLUMNS": str(shutil.get_terminal_size((120, 24)).columns),
    }
    if sys.stdout.isatty():
        environment.setdefault("FORCE_COLOR", "1")
    exports = "\n".join(f"export {name}={shlex.quote(value)}" for name, value in sorted(environment.items()))
    inserts = "\n".join(f"insmod {shlex.quote(str(module))}" for module in modules)
    exit_file = shlex.quote(str(state / "exit"))
    return f"""#!/bin/sh
{exports}
export PATH="$PATH:/usr/local/sbin:/usr/sbin:/sbin:/usr/bin:/bin"
mount -t proc proc /proc
mount -t sysfs sys /sys
[ -e /dev/null ] || mount -t devtmpfs dev /dev
mkdir -p /dev/pts /dev/shm
mount -t devpts -o mode=620,ptmxmode=666 devpts /dev/pts
mount -t tmpfs -o mode=1777 shm /dev/shm
echo localhost > /proc/sys/kernel/hostname
{inserts}
ip link set lo up
for name in {interface} {far_name(interface)}; do
  ip link add dev $name type vcan
  ip link set $name up
done
cut -d' ' -f1 /proc/uptime > {shlex.quote(str(state / "uptime"))}
cd {shlex.quote(str(Path.cwd()))}
echo {shlex.quote(BEGIN)}
{{ {shlex.join(command)}; echo $? > {exit_file}.part; }} < /dev/null 2>&1 | cat
mv {exit_file}.part {exit_file}
sync
echo {shlex.quote(END)}
echo o > /proc/sysrq-trigger
sleep 10
"""


def memory_directory(state: Path, memory_bytes: int) -> Path:
    """Return where the memory of user-mode Linux lies as a file: in memory, if there is room (not in most
    containers).
    """
    shared = Path("/dev/shm")
    if shared.is_dir() and os.access(shared, os.W_OK) and shutil.disk_usage(shared).free > memory_bytes:
        return shared
    return state


def uml_command(command: list[str], interface: str, state: Path, memory_mib: int) -> list[str]:
    """Write what the boot needs into `state` and return the command that boots.

    Raises:
        UnavailableError: Something is not installed.

    """
    missing = [package for program, package in PACKAGES.items() if tool(program) is None]
    if missing:
        raise UnavailableError(
            f"not installed: {' '.join(missing)} (Debian: apt-get install {' '.join(missing)})"
        )
    binary = tool("linux.uml")
    assert binary is not None
    version = subprocess.run([binary, "--version"], check=True, capture_output=True, text=True).stdout.strip()
    release = MODULES_ROOT / version
    if not (release / "modules.dep").exists():
        raise UnavailableError(f"{binary} is Linux {version}, but {release} with its modules does not exist")
    init = state / "init"
    init.write_text(init_script(command, interface, state, modules_in_order(release)))
    init.chmod(0o755)
    return [
        *(binary, f"mem={memory_mib}M", "rootfstype=hostfs", "rootflags=/", "rw", f"init={init}", "quiet"),
        *("con=null", "con0=null,fd:1", f"uml_dir={state}", "umid=hil", "panic=1"),
    ]


class Console:
    """Passes on what the command prints, and keeps what the kernel said before and after."""

    def __init__(self) -> None:
        self.kernel: list[str] = []
        self.inside = False
        self.ended = threading.Event()

    def copy(self, descriptor: int) -> None:
        """Read lines until the end of the stream."""
        with os.fdopen(descriptor, "rb", buffering=0, closefd=False) as stream:
            rest = b""
            while piece := stream.read(65536):
                *lines, rest = (rest + piece).replace(b"\r\n", b"\n").split(b"\n")
                for line in lines:
                    self._line(line)
                if self.inside and rest and not rest.startswith(b":") and not rest.endswith(b"\r"):
                    self._write(rest)  # progress dots have no end of line yet
                    rest = b""

    def _line(self, line: bytes) -> None:
        text = line.decode(errors="replace")
        if text == BEGIN:
            self.inside = True
        elif text.endswith(END):
            if text != END:
                self._write(line[: -len(END)])
            self.inside = False
            self.ended.set()
        elif self.inside:
            self._write(line + b"\n")
        else:
            self.kernel.append(text)

    @staticmethod
    def _write(data: bytes) -> None:
        sys.stdout.buffer.write(data)
        sys.stdout.buffer.flush()


def run_in_uml(command: list[str], interface: str, timeout_s: float, memory_mib: int) -> int:
    """Boot user-mode Linux, run `command` in it and return its exit code.

    Raises:
        UnavailableError: Something is not installed.

    """
    temporary = tempfile.gettempdir()
    # /dev and /proc are other file systems inside
    state = Path(
        tempfile.mkdtemp(prefix="hil-vcan-", dir="/tmp" if temporary.startswith("/dev") else temporary)
    )
    try:
        boot = uml_command(command, interface, state, memory_mib)
        environment = {**os.environ, "TMPDIR": str(memory_directory(state, memory_mib << 20))}
        started = time.monotonic()
        process = subprocess.Popen(
            boot,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            process_group=0,
        )
        assert process.stdout is not None
        # When we are killed, the pipe closes and the guard takes its whole process group along.
        guard = subprocess.Popen(
            ["/bin/sh", "-c", "read line; kill -KILL 0"], stdin=subprocess.PIPE, process_group=process.pid
        )
        console = Console()
        reader = threading.Thread(target=console.copy, args=(process.stdout.fileno(),), daemon=True)
        reader.start()
        try:
            while process.poll() is None and time.monotonic() - started < timeout_s:
                if console.ended.wait(0.2):
                    break
            timed_out = process.poll() is None and not console.ended.is_set()
            if not timed_out:
                # should powering off hang, everything is written by now
                with contextlib.suppress(subprocess.TimeoutExpired):
                    process.wait(5)
        finally:
            kill_group(process)
            guard.communicate()
            reader.join(5)
            process.stdout.close()
        if timed_out:
            print(f"{PROGRAM}: the command took longer than {timeout_s:g} s", file=sys.stderr)
            return EXIT_TIMEOUT
        exit_file = state / "exit"
        if not exit_file.exists():
            print(
                f"{PROGRAM}: user-mode Linux ended before the command did. Its last words:", file=sys.stderr
            )
            print("\n".join(f"  {line}" for line in console.kernel[-40:]), file=sys.stderr)
            return EXIT_CRASHED
        return int(exit_file.read_text())
    finally:
        shutil.rmtree(state, ignore_errors=True)


# ------------------------------------------------------------------------------------------------ the program

PROGRAM = "run.py"


def parse(arguments: list[str]) -> argparse.Namespace:
    summary = (__doc__ or "").partition("\n")[0]
    parser = argparse.ArgumentParser(
        prog=PROGRAM, description=summary, usage="%(prog)s [options] -- command ..."
    )
    parser.add_argument(
        "--interface", default=os.environ.get("HIL_VCAN") or "vcan0", help="default: $HIL_VCAN or vcan0"
    )
    parser.add_argument(
        "--where", choices=("auto", "host", "uml"), default=os.environ.get("HIL_VCAN_WHERE") or "auto"
    )
    parser.add_argument("--timeout", type=float, default=900.0, metavar="SECONDS", help="default: 900")
    parser.add_argument(
        "--memory", type=int, default=1024, metavar="MIB", help="of user-mode Linux; default: 1024"
    )
    parser.add_argument("command", nargs="+", help="what to run")
    options = parser.parse_args(arguments)
    if not re.fullmatch(r"[A-Za-z0-9_.-]{1,15}", options.interface):
        parser.error(
            f"--interface {options.interface!r} is not allowed; allowed: 1 to 15 letters, digits, _ . -"
        )
    if options.timeout <= 0:
        parser.error(f"--timeout {options.timeout:g} is not allowed; allowed: more than 0 s")
    return options


def main(arguments: list[str]) -> int:
    options = parse(arguments)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
    reasons: list[str] = []
    if options.where in ("auto", "host"):
        try:
            created = [options.interface] if open_on_host(options.interface) else []
        except UnavailableError as error:
            reasons.append(f"on this machine: {error}")
        else:
            print(f"{PROGRAM}: {options.interface} of this machine", flush=True)
            usable, far = [options.interface], far_name(options.interface)
            try:
                if open_on_host(far):
                    created.append(far)
                usable.append(far)
            except UnavailableError as error:
                print(f"{PROGRAM}: no second interface: {error}", file=sys.stderr)
            try:
                return run_on_host(options.command, usable, options.timeout)
            finally:
                for name in created:
                    remove_from_host(name)
    if options.where in ("auto", "uml"):
        try:
            print(f"{PROGRAM}: {options.interface} in user-mode Linux", flush=True)
            return run_in_uml(options.command, options.interface, options.timeout, options.memory)
        except UnavailableError as error:
            reasons.append(f"in user-mode Linux: {error}")
    print(f"{PROGRAM}: no SocketCAN interface {options.interface} to be had:", file=sys.stderr)
    print("\n".join(f"  {reason}" for reason in reasons), file=sys.stderr)
    return EXIT_UNAVAILABLE


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
