"""`hil panel` as a person uses it: the program itself behind a pseudo-terminal, with a keyboard and a
screen.
"""

from __future__ import annotations

import fcntl
import os
import pty
import select
import signal
import struct
import subprocess
import sys
import termios

import pytest

from testcases.processes import PATIENCE_S, hil_command

pytestmark = pytest.mark.exhaustive


def _own_terminal():
    """Make standard input the terminal of a program that hears its signals, whoever started the tests."""
    fcntl.ioctl(0, termios.TIOCSCTTY, 0)
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)


class Terminal:
    """The program on a terminal of its own."""

    def __init__(self, *arguments: str) -> None:
        self.keyboard, side = pty.openpty()
        self.process = subprocess.Popen(
            [*hil_command(), *arguments],
            stdin=side,
            stdout=side,
            stderr=side,
            start_new_session=True,
            preexec_fn=_own_terminal,  # noqa: PLW1509 - the tests have no threads
            env={**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)},
        )
        os.close(side)
        self.screen = ""
        self._seen = 0

    def type(self, text):
        os.write(self.keyboard, text.encode())

    def shows(self, text):
        """Wait for `text` behind what has been waited for before."""
        while text not in self.screen[self._seen :]:
            ready, _, _ = select.select([self.keyboard], [], [], PATIENCE_S)
            assert ready, self.screen
            try:
                self.screen += os.read(self.keyboard, 65536).decode()
            except OSError:
                pytest.fail(f"it has ended:\n{self.screen}")
        self._seen = self.screen.index(text, self._seen) + len(text)

    def code(self):
        return self.process.wait(PATIENCE_S)


@pytest.fixture
def start():
    """Start the panel on a bench; what still runs afterwards is ended."""
    opened = []

    def on(bench):
        terminal = Terminal("panel", bench)
        opened.append(terminal)
        terminal.shows("help lists the commands")
        terminal.type("take\nenable\n")
        terminal.shows("panel  standstill")  # told without a key, when it has come
        return terminal

    yield on
    for terminal in opened:
        if terminal.process.poll() is None:
            terminal.process.kill()
            terminal.process.wait()


@pytest.mark.requirement("COM-023", "COM-048", "COM-049", "COM-073", "COM-070")
def test_a_session(start):
    """Take, enable, jog, move, be refused, resize, give back: every line is answered, and what happens is
    told by itself.
    """
    terminal = start("profidrive")
    terminal.type("velocity 40\njog 50\n")
    terminal.shows("motion")
    fcntl.ioctl(terminal.keyboard, termios.TIOCSWINSZ, struct.pack("HHHH", 8, 30, 0, 0))
    terminal.type("slide 0\n")
    terminal.shows("panel  standstill")
    for line, answer in (
        ("rel -5", "panel  motion"),
        ("", "panel  standstill"),  # it arrives without a key
        ("fly", "'fly' is not allowed"),
        ('rel "', "numbers: D [S]"),
        ("velocity nan", "a number above 0"),
        ("rel 1 2 3", "allowed: D [S]"),
        ("slide 130", "-100 to 100 %"),
        ("abs 5", "MC_MoveAbsolute refused or ended with 8001h  alarm 321"),
        ("jog", "not enabled in the panel"),
        ("ack", "panel  standstill"),
        ("release", "program  disabled"),
        ("jog", "does not have master control"),
    ):
        terminal.type(f"{line}\n")
        terminal.shows(answer)
    terminal.type("quit\n")
    assert terminal.code() == 0


@pytest.mark.requirement("COM-070", "COM-031")
@pytest.mark.parametrize(
    ("how", "code"),
    [("ctrl-c", 2), ("ctrl-d", 0), ("closed", 2)],
)
def test_the_end_in_the_middle_of_a_motion(start, how, code):
    """Ctrl-C, end of input and the closing of the terminal stop the axis, give it back, and leave no
    traceback.
    """
    terminal = start("reference")
    terminal.type("jog\n")
    terminal.shows("panel  motion")
    if how == "closed":
        os.close(terminal.keyboard)
    else:
        terminal.type({"ctrl-c": "\x03", "ctrl-d": "\x04"}[how])
        terminal.shows("program  disabled")
        assert "Traceback" not in terminal.screen
    assert terminal.code() == code


@pytest.mark.parametrize(("reader", "told"), [("full", "No space left on device"), ("gone", "")])
def test_output_that_cannot_be_written(reader, told):
    """What could not be written is no success and no failed case; that a reader has gone needs no word."""
    if reader == "full":
        target = os.open("/dev/full", os.O_WRONLY)
    else:
        end, target = os.pipe()
        os.close(end)
    with os.fdopen(target) as stdout:
        program = subprocess.run(
            [*hil_command(), "personalities"],
            stdout=stdout,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)},
        )
    assert program.returncode == 2
    assert program.stderr.count("\n") == bool(told)
    assert told in program.stderr
