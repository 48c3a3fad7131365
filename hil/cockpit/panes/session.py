"""The session: what was done, as steps, and saved as a test or a matrix file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field

from hil.cockpit.matrix_text import write_matrix
from hil.cockpit.messages import Message, MessageError
from hil.cockpit.pane import Handler, Pane
from hil.cockpit.panes.axis import AxisAway, AxisCommand, AxisJog, StopAll
from hil.cockpit.panes.time_control import ReleaseControl, RunToEvent, RunToSignal, RunToTime
from hil.cockpit.session import Session
from hil.cockpit.steps import Remark
from hil.cockpit.written_test import WrittenTest, bench_for_test, save_bench, save_text, write_test

if TYPE_CHECKING:
    from hil.bench.bench import Bench
    from hil.cockpit.client import Client
    from hil.cockpit.machine import Machine
    from hil.cockpit.recording import AxisRecorder, StepLog
    from hil.cockpit.written_test import Recorded

_Name = Annotated[str, Field(min_length=1, max_length=80, pattern=r"^[\w .,()/+-]+$")]
_Form = Literal["pytest", "matrix"]
_MOST_SHOWN = 500


class HoldSession(Message):
    """Hold the session as it is now, to be written."""

    operates = False
    kind: Literal["session.hold"]


class SessionSteps(Message):
    """Ask for the steps from a number on, from 0."""

    operates = False
    kind: Literal["session.steps"]
    since: Annotated[int, Field(ge=0, le=2**53 - 1)] = 0


class WriteSession(Message):
    """Write the session that is held: the text comes as the reply."""

    operates = False
    aside = True
    kind: Literal["session.write"]
    form: _Form
    name: _Name
    title: Annotated[str, Field(max_length=200)] = ""


class SaveSession(Message):
    """Save the text that was written last into the working folder."""

    aside = True
    kind: Literal["session.save"]
    name: _Name


class SessionPane(Pane):
    """Records what is done, and writes it.

    Args:
        machine: Has the bench, and tells of every message that was carried out.
        folder: Where files are saved.
        recorders: Returns what records the commands of each axis of the bench that is up.

    """

    name = "session"

    def __init__(
        self, machine: Machine, folder: Path, recorders: Callable[[StepLog], dict[str, AxisRecorder]]
    ) -> None:
        self._machine = machine
        self._recorders = recorders
        self._folder = folder
        self._session: Session | None = None
        self._axes: dict[str, AxisRecorder] = {}
        self._held: Recorded | None = None
        self._written: tuple[str, str] | None = None
        """Form and text of what was written last."""
        self._bench = ("", "")
        """Bench of what was written last, and the text of its file where it has to be saved, too."""
        machine.carried_out.append(self._follow)

    def the_session(self) -> Session:
        """Return the session.

        Raises:
            MessageError: No bench is up.

        """
        if self._session is None:
            raise MessageError("no bench is up: start one in the view Bench")
        return self._session

    @property
    def handlers(self) -> Mapping[type[Message], Handler]:
        """What it takes."""
        return {
            SessionSteps: self._steps,
            HoldSession: self._hold,
            WriteSession: self._write,
            SaveSession: self._save,
        }

    def begin(self, bench: Bench) -> None:
        """Begin a new session."""
        self._session = Session(bench)
        self._axes = self._recorders(self._session)

    def end(self) -> None:
        """End the session."""
        self._session = None
        self._axes = {}

    def _follow(self, _: Client, message: Message, time_ns: int) -> None:
        """Record a message of another pane."""
        axes, session = self._axes, self._session
        if session is None:
            return
        match message:
            case AxisCommand():
                axes[message.axis].command(message.command, message.values, time_ns)
            case AxisJog():
                axes[message.axis].jog(message.slider, time_ns)
            case StopAll() | AxisAway():
                self._stopped(time_ns)
            case ReleaseControl():
                for one in axes.values():
                    one.released(time_ns)
            case RunToTime():
                session.note(Remark(f"until {message.time_s:g} s"), time_ns=time_ns)
            case RunToSignal():
                text = f"until {message.signal} {message.compare} {message.value:g}"
                session.note(Remark(text), time_ns=time_ns)
            case RunToEvent():
                of = f" of {message.source}" if message.source else ""
                session.note(Remark(f"until {message.event}{of}"), time_ns=time_ns)
            case _:
                pass

    def _hold(self, _: HoldSession, __: Client) -> int:
        if self._machine.replays:
            raise MessageError(
                "this bench began in the middle of a case, so that its session cannot be done again from the "
                "start; Reset bench begins one that can"
            )
        self._held = self.the_session().recorded(self._machine.bench_file)
        return len(self._held.steps)

    def _write(self, message: WriteSession, _: Client) -> object:
        held = self._held
        if held is None:
            raise MessageError("nothing is held: the message session.hold comes first")
        bench, own = bench_for_test(held.bench_file, message.name)
        if message.form == "matrix":
            written = WrittenTest(write_matrix(held, bench=bench, title=message.name), ())
        else:
            written = write_test(held, name=message.name, bench=bench, title=message.title)
        self._written = (message.form, written.text)
        self._bench = (bench, own)
        notes = [*written.notes]
        if own:
            notes.append(f"the bench was changed here: its file is saved as {bench} next to the test")
        return {"text": written.text, "notes": notes}

    def _save(self, message: SaveSession, _: Client) -> str:
        if self._written is None:
            raise MessageError("nothing has been written yet")
        form, text = self._written
        name, own = self._bench
        if own:
            save_bench(own, self._folder / name)
        return str(save_text(text, self._folder, message.name, ending="py" if form == "pytest" else "toml"))

    def pulse(self, now_s: float) -> None:  # noqa: ARG002 - it looks every time
        """Record what follows from commands later on."""
        for one in self._axes.values():
            one.look()

    def _stopped(self, time_ns: int) -> None:
        for one in self._axes.values():
            one.stopped(time_ns)

    def operator_away(self) -> None:
        """Record that everything was stopped because the operator is away."""
        if self._session is not None:
            self._stopped(self._session.now_ns)

    def disabled(self, axis: str) -> None:
        """Record that an axis was disabled because the operator gave no sign of life."""
        if self._session is not None:
            self._axes[axis].released(self._session.now_ns)

    def _steps(self, message: SessionSteps, _: Client) -> object:
        return self.the_session().to_dicts(message.since)[-_MOST_SHOWN:]

    def state(self) -> object:
        """Return the number of steps; a page asks for those that it has not."""
        return None if self._session is None else {"count": len(self._session.steps)}
