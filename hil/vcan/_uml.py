"""User-mode Linux: a Linux kernel as an ordinary program, on the file system of this machine.

It boots the files of this machine under the same paths, loads the CAN modules that come with it, creates the
interfaces and runs the command: one processor, no network but `lo`, slow system calls.
"""

from __future__ import annotations

import contextlib
import os
import re
import shlex
import shutil
import stat
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from hil.vcan._tools import UnavailableError, kill_group, tool

MODULES: Final = ("can", "can-raw", "can-bcm", "can-gw", "vcan")
"""Modules to load, before what `modules.dep` adds to them."""
_MODULES_ROOT: Final = Path("/usr/lib/uml/modules")
_PACKAGES: Final = {"linux.uml": "user-mode-linux", "insmod": "kmod", "ip": "iproute2"}
"""Programs that user-mode Linux needs, and the Debian packages that have them."""

_READY: Final = b"::hil-vcan ready::"
_END: Final = b"::hil-vcan end::"
_BOOT_LIMIT_S: Final = 120.0
_POWER_OFF_S: Final = 5.0
_OUT, _ERR = "tty1", "tty2"
"""Consoles of user-mode Linux that carry standard output and standard error of the command."""


class BootError(Exception):
    """User-mode Linux ended before the command did, or never came up; the message has its last words."""


class CommandTimeoutError(Exception):
    """The command took longer than it may."""


def modules_in_order(release: Path) -> list[Path]:
    """Return the files of `MODULES` and of what they need, each after the modules that it needs.

    Args:
        release: Folder with the modules of one kernel and its `modules.dep`.

    Raises:
        UnavailableError: The kernel lacks one.

    """
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


def _stdin() -> str:
    """Return the file that standard input is; what is no file on the disk does not reach inside."""
    with contextlib.suppress(OSError, ValueError):
        if stat.S_ISREG(os.fstat(sys.stdin.fileno()).st_mode):
            found = Path(f"/proc/self/fd/{sys.stdin.fileno()}").readlink()
            if found.is_file():
                return str(found)
    return "/dev/null"


def init_script(
    command: Sequence[str],
    names: Sequence[str],
    environment: dict[str, str],
    state: Path,
    modules: Sequence[Path],
) -> str:
    """Return the program that is process 1 inside: it prepares the system, runs `command` and powers off.

    Args:
        command: What to run.
        names: Of the interfaces.
        environment: Of the command.
        state: Folder of this run on the disk.
        modules: Files of modules, in the order in which they are loaded.

    """
    inside = {
        **environment,
        "HIL_VCAN_WHERE": "host",  # for a `hil vcan` inside
        # the machine's temporary directory stays visible, but a file system in memory is faster and leaves
        # nothing
        "TMPDIR": "/dev/shm",
        "PYTHONUNBUFFERED": "1",
        "COLUMNS": str(shutil.get_terminal_size((120, 24)).columns),
    }
    if sys.stdout.isatty():
        inside.setdefault("FORCE_COLOR", "1")
    exports = "\n".join(
        f"export {name}={shlex.quote(value)}" for name, value in sorted(inside.items()) if name.isidentifier()
    )
    inserts = "\n".join(f"insmod {shlex.quote(str(module))}" for module in modules)
    code, devices = shlex.quote(str(state / "exit")), shlex.quote(str(state / "dev"))
    return f"""#!/bin/sh
{exports}
mount -t proc proc /proc
mount -t sysfs sys /sys
mount -t devtmpfs dev {devices}
[ -e /dev/null ] || mount -t devtmpfs dev /dev
mkdir -p /dev/pts /dev/shm
mount -t devpts -o mode=620,ptmxmode=666 devpts /dev/pts
mount -t tmpfs -o mode=1777 shm /dev/shm
echo localhost > /proc/sys/kernel/hostname
{inserts}
ip link set lo up
for name in {shlex.join(names)}; do
  ip link add dev $name type vcan
  ip link set $name up
done
cd {shlex.quote(str(Path.cwd()))}
cd {devices}
stty raw < {_OUT}
stty raw < {_ERR}
mkfifo out err
cat out > {_OUT} & out=$!
cat err > {_ERR} & err=$!
exec 3> out 4> err
cd "$OLDPWD"
echo {_READY.decode()}
setsid {shlex.join(command)} < {shlex.quote(_stdin())} >&3 2>&4 3>&- 4>&- &
pid=$!
wait $pid
echo $? > {code}.part
kill -KILL -$pid 2> /dev/null
exec 3>&- 4>&-
(sleep 2; kill -KILL $out $err) 2> /dev/null &
wait $out $err
mv {code}.part {code}
sync
echo {_END.decode()}
echo o > /proc/sysrq-trigger
sleep 10
"""


def _memory_directory(state: Path, memory_bytes: int) -> Path:
    """Return where the file with the memory of user-mode Linux goes: in memory, if it fits
    (not in most containers).
    """
    shared = Path("/dev/shm")
    if shared.is_dir() and os.access(shared, os.W_OK) and shutil.disk_usage(shared).free > memory_bytes:
        return shared
    return state


def check_installed() -> tuple[str, list[Path]]:
    """Return the program of user-mode Linux and the modules to load.

    Raises:
        UnavailableError: Something is not installed.

    """
    missing = [package for program, package in _PACKAGES.items() if tool(program) is None]
    if missing:
        wanted = " ".join(missing)
        raise UnavailableError(f"not installed: {wanted} (Debian: sudo apt-get install {wanted})")
    binary = str(tool("linux.uml"))
    version = subprocess.run([binary, "--version"], check=True, capture_output=True, text=True).stdout.strip()
    release = _MODULES_ROOT / version
    if not (release / "modules.dep").exists():
        raise UnavailableError(f"{binary} is Linux {version}, but {release} with its modules does not exist")
    return binary, modules_in_order(release)


class _Stream:
    """Reads what comes out of a pipe until its end, in a thread of its own."""

    def __init__(self, take: Callable[[bytes], None]) -> None:
        self._take = take
        reading, self.inside = os.pipe()
        self._thread = threading.Thread(target=self._copy, args=(reading,), daemon=True)

    def start(self) -> None:
        """Read from now on; the process that writes has its end of the pipe."""
        os.close(self.inside)
        self._thread.start()

    def _copy(self, descriptor: int) -> None:
        with os.fdopen(descriptor, "rb", buffering=0) as stream:
            while piece := stream.read(65536):
                self._take(piece)

    def join(self) -> None:
        """Wait until everything has been passed on."""
        self._thread.join(_POWER_OFF_S)


class _Console:
    """What the kernel says, with the marks of the init script in it."""

    def __init__(self) -> None:
        self.ready = threading.Event()
        self.ended = threading.Event()
        self._text = b""

    def take(self, piece: bytes) -> None:
        self._text = (self._text + piece)[-65536:]
        if _READY in self._text:
            self.ready.set()
        if _END in self._text:
            self.ended.set()

    def last_words(self) -> str:
        lines = self._text.decode(errors="replace").replace("\r", "").splitlines()
        return "\n".join(f"  {line}" for line in lines[-40:])


class _Passing:
    """Passes output on to a stream of ours, until nobody reads it any more."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self.broken = False

    def take(self, piece: bytes) -> None:
        view = memoryview(piece)
        while view and not self.broken:
            try:
                view = view[os.write(self._descriptor, view) :]
            except OSError:
                self.broken = True


def run_in_uml(
    command: Sequence[str],
    names: Sequence[str],
    environment: dict[str, str],
    *,
    timeout_s: float,
    memory_mib: int,
) -> int:
    """Boot user-mode Linux, run `command` in it and return its exit code.

    Args:
        command: What to run.
        names: Of the interfaces.
        environment: Of the command.
        timeout_s: Longest time of boot and command, s; 0: no limit.
        memory_mib: Memory of user-mode Linux, MiB.

    Raises:
        UnavailableError: Something is not installed.
        BootError: It ended before the command did, or did not come up.
        CommandTimeoutError: The command took longer than it may.

    """
    binary, modules = check_installed()
    temporary = tempfile.gettempdir()
    # /dev and /proc are other file systems inside
    place = "/tmp" if temporary.startswith("/dev") else temporary
    state = Path(tempfile.mkdtemp(prefix="hil-vcan-", dir=place))
    try:
        (state / "dev").mkdir()
        init = state / "init"
        init.write_text(init_script(command, names, environment, state, modules))
        init.chmod(0o755)
        console, out, err = _Console(), _Passing(1), _Passing(2)
        streams = [_Stream(one.take) for one in (console, out, err)]
        boot = [
            *(binary, f"mem={memory_mib}M", "rootfstype=hostfs", "rootflags=/", "rw", f"init={init}"),
            *("quiet", "con=null", "con0=null,fd:1", f"con1=null,fd:{streams[1].inside}"),
            *(f"con2=null,fd:{streams[2].inside}", f"uml_dir={state}", "umid=hil", "panic=1"),
        ]
        process = subprocess.Popen(
            boot,
            env={**os.environ, "TMPDIR": str(_memory_directory(state, memory_mib << 20))},
            stdin=subprocess.DEVNULL,
            stdout=streams[0].inside,
            stderr=subprocess.STDOUT,
            process_group=0,
            pass_fds=[one.inside for one in streams[1:]],
        )
        # When we are killed, the pipe closes and the guard takes its whole process group along.
        guard = subprocess.Popen(
            ["/bin/sh", "-c", "read line; kill -KILL 0"], stdin=subprocess.PIPE, process_group=process.pid
        )
        for one in streams:
            one.start()
        began = time.monotonic()
        try:
            while process.poll() is None and not console.ended.wait(0.1) and not (out.broken or err.broken):
                passed = time.monotonic() - began
                if timeout_s and passed > timeout_s:
                    raise CommandTimeoutError
                if not console.ready.is_set() and passed > _BOOT_LIMIT_S:
                    raise BootError(
                        f"user-mode Linux did not come up within {_BOOT_LIMIT_S:g} s. Its last words:\n"
                        + console.last_words()
                    )
            if console.ended.is_set():
                # should powering off hang, everything is written by now
                with contextlib.suppress(subprocess.TimeoutExpired):
                    process.wait(_POWER_OFF_S)
        finally:
            kill_group(process)
            guard.communicate()
            for one in streams:
                one.join()
        if out.broken or err.broken:
            raise BrokenPipeError
        if not (state / "exit").exists():
            raise BootError(
                f"user-mode Linux ended before the command did. Its last words:\n{console.last_words()}"
            )
        return int((state / "exit").read_text())
    finally:
        shutil.rmtree(state, ignore_errors=True)
