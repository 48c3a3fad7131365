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
import time

import pyte
import pytest

from testcases.processes import PATIENCE_S, hil_command

pytestmark = pytest.mark.realtime


ROWS, COLUMNS = 30, 150


def _own_terminal():
    """Make standard input the terminal of a program that hears its signals, whoever started the tests."""
    fcntl.ioctl(0, termios.TIOCSCTTY, 0)
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)


class Display(pyte.Screen):
    """A screen that answers when it is asked for the position of its cursor."""

    def __init__(self, keyboard: int) -> None:
        super().__init__(COLUMNS, ROWS)
        self._keyboard = keyboard

    def write_process_input(self, data):
        os.write(self._keyboard, data.encode())


class Terminal:
    """The program on a terminal of its own."""

    def __init__(self, *arguments: str, kind: str = "dumb", state: str = "") -> None:
        self.keyboard, side = pty.openpty()
        fcntl.ioctl(side, termios.TIOCSWINSZ, struct.pack("HHHH", ROWS, COLUMNS, 0, 0))
        self.process = subprocess.Popen(
            [*hil_command(), *arguments],
            stdin=side,
            stdout=side,
            stderr=side,
            start_new_session=True,
            preexec_fn=_own_terminal,  # noqa: PLW1509 - the tests have no threads
            env={**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
            | {"TERM": kind, "XDG_STATE_HOME": state},
        )
        os.close(side)
        self.screen = ""
        self._seen = 0
        self._display = Display(self.keyboard)
        self._stream = pyte.ByteStream(self._display)

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

    def displays(self, *texts, below=""):
        """Wait until every text stands on the screen, as it looks to a person, and below the last line with
        `below`; return the screen from there on.
        """
        end = time.monotonic() + PATIENCE_S
        while not all(text in self._below(below) for text in texts):
            ready, _, _ = select.select([self.keyboard], [], [], PATIENCE_S)
            if not ready or time.monotonic() > end:
                pytest.fail(f"{texts} in\n" + "\n".join(self._display.display))
            try:
                self._stream.feed(os.read(self.keyboard, 65536))
            except OSError:
                pytest.fail("it has ended:\n" + "\n".join(self._display.display))
        return self._below(below)

    def _below(self, text):
        shown = "\n".join(self._display.display)
        if not text:
            return shown
        return shown[shown.rindex(text) :] if text in shown else ""

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
        terminal.shows("panel  standstill")  # shown without a key, when it has come
        return terminal

    yield on
    for terminal in opened:
        if terminal.process.poll() is None:
            terminal.process.kill()
            terminal.process.wait()


@pytest.mark.requirement("COM-023", "COM-048", "COM-049", "COM-073", "COM-070")
def test_a_session(start):
    """Take, enable, jog, move, be refused, resize, give back: every line is answered, and what happens is
    reported by itself.
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
        ("abs 5", "MC_MoveAbsolute failed, alarm 321: Absolute positioning"),
        ("jog", "not enabled in the panel"),
        ("ack", "it stays off until `enable`"),
        ("enable", "panel  standstill"),
        ("release", "control was returned: by command"),
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


@pytest.mark.parametrize(("reader", "reported"), [("full", "No space left on device"), ("gone", "")])
def test_output_that_cannot_be_written(reader, reported):
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
    assert program.stderr.count("\n") == bool(reported)
    assert reported in program.stderr


@pytest.fixture
def screen(tmp_path):
    """Start the panel on a terminal with a screen; what still runs afterwards is ended."""
    opened = []

    def on(bench):
        opened.append(Terminal("panel", bench, kind="xterm", state=str(tmp_path)))
        return opened[-1]

    yield on
    for terminal in opened:
        if terminal.process.poll() is None:
            terminal.process.kill()
            terminal.process.wait()


@pytest.mark.requirement("STP-033")
def test_a_session_on_the_screen(screen, tmp_path):
    """The prompt has axis, state and unit; live values stand below it; jog says how long it goes on; an error
    goes away with its acknowledgement, which switches nothing on; arrow up brings the last line back.
    """
    terminal = screen("profidrive")
    terminal.displays("axis1 disabled (program) mm> ", "position 0 mm  velocity 0 mm/s  following error 0 mm")
    terminal.type("take\renable\r")
    terminal.displays("axis1 standstill mm> ", "limit switches free")
    terminal.type("velocity 40\rjog 50\r")
    terminal.displays(
        "jogs forward at 20 mm/s until `slide 0` or `stop`", "jogs at slider 50 % until `slide 0`"
    )
    terminal.displays("axis1 motion mm> ", "\nposition ", "\njogs at slider 50 %")
    terminal.type("slide 0\r")
    terminal.displays("axis1 standstill mm> ")
    terminal.type("abs 5\r")
    terminal.displays(
        "axis1 alarm disabled mm> ", "\nMC_MoveAbsolute failed, alarm 321: Absolute positioning"
    )
    terminal.type("ack\r")
    shown = terminal.displays("axis1 disabled mm> ", "\nposition ", below="it stays off until `enable`")
    assert "321" not in shown
    assert "failed" not in shown
    terminal.type("\x1b[A\x1b[A")
    terminal.displays("axis1 disabled mm> abs 5")
    terminal.type("\x7f" * 5 + "opti\t")
    terminal.displays("axis1 disabled mm> optimise")
    terminal.type("\x15fly\r")
    terminal.displays("'fly' is not allowed")
    terminal.type("quit\r")
    assert terminal.code() == 0

    again = screen("profidrive")
    again.displays("axis1 disabled (program) mm> ")
    again.type("\x1b[A\x1b[A")
    again.displays("mm> fly")
    again.type("\x03")
    assert again.code() == 2


@pytest.mark.requirement("COM-070", "COM-031")
@pytest.mark.parametrize(("how", "code"), [("ctrl-c", 2), ("ctrl-d", 0), ("closed", 2), ("killed", 2)])
def test_the_end_on_the_screen(screen, how, code):
    """Ctrl-C, Ctrl-D, the closing of the terminal and SIGTERM in the middle of a motion stop the axis and
    give it back, without a traceback.
    """
    terminal = screen("reference")
    terminal.displays("axis1 disabled (program) mm> ")
    terminal.type("take\renable\r")
    terminal.displays("axis1 standstill mm> ")
    terminal.type("jog\r")
    terminal.displays("axis1 motion mm> ")
    if how == "closed":
        os.close(terminal.keyboard)
    elif how == "killed":
        terminal.process.send_signal(signal.SIGTERM)
    else:
        terminal.type({"ctrl-c": "\x03", "ctrl-d": "\x04"}[how])
    if how != "closed":
        assert "Traceback" not in terminal.displays("program  disabled")
    assert terminal.code() == code
