"""The control panel on the screen of a terminal: prompt with line editing, history and completion, and live
values below it.
"""

from __future__ import annotations

import asyncio
import os
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Final, Protocol

from prompt_toolkit import PromptSession
from prompt_toolkit.application import get_app
from prompt_toolkit.completion import WordCompleter
from prompt_toolkit.formatted_text import StyleAndTextTuples
from prompt_toolkit.history import FileHistory, History, InMemoryHistory
from prompt_toolkit.key_binding import KeyBindings, KeyPressEvent
from prompt_toolkit.patch_stdout import patch_stdout
from prompt_toolkit.shortcuts import CompleteStyle

from fieldbus.clock import RealtimeScheduler
from hil._interrupt import note

if TYPE_CHECKING:
    from hil.bench.bench import Bench

_TICK_S: Final = 0.05
"""How often a bench in virtual time may run on."""
_SLICE_S: Final = 0.01
"""How long a live bench keeps the keyboard waiting."""
_LAG_S: Final = 0.5
"""Time that a bench in virtual time makes up for at once when the machine was busy."""


class Screen(Protocol):
    """What the screen shows of a session."""

    commands: dict[str, tuple[str, str, Callable[..., object]]]

    @property
    def keys(self) -> Mapping[str, str]:
        """Function keys, and the commands that they give."""

    def prompt(self) -> str:
        """Return the text in front of what is typed."""

    def values(self) -> list[str]:
        """Return the live values."""

    def notes(self) -> list[str]:
        """Return what has to be noticed."""

    def line(self) -> str:
        """Return the state in one line."""

    def changed(self) -> bool:
        """Return whether something has happened since the last call."""


def typed(machine: Bench, session: Screen, *, tell: Callable[[str], object]) -> Iterator[str]:
    """Yield lines as they are typed; meanwhile time passes as on the clock, and events are printed.

    Args:
        machine: The bench.
        session: What is shown.
        tell: Prints a line.

    """
    prompts: PromptSession[str] = PromptSession(
        history=_history(),
        completer=_completer(session),
        complete_while_typing=False,
        complete_style=CompleteStyle.MULTI_COLUMN,
        bottom_toolbar=lambda: _toolbar(session),
        key_bindings=_bindings(session),
        refresh_interval=0.1,
    )
    live = isinstance(machine.scheduler, RealtimeScheduler)

    async def pass_time() -> None:
        before = time.monotonic()
        while True:
            await asyncio.sleep(0.0 if live else _TICK_S)
            now = time.monotonic()
            try:
                machine.run_for(_SLICE_S if live else min(now - before, _LAG_S))
                if session.changed():
                    tell(session.line())
            except Exception as error:  # noqa: BLE001 - raised again where the line is waited for
                get_app().exit(exception=error)
                return
            before = now

    def begin() -> None:
        get_app().create_background_task(pass_time())

    while True:
        try:
            with patch_stdout():
                text = prompts.prompt(session.prompt, pre_run=begin)
        except EOFError:
            return
        except KeyboardInterrupt:  # Ctrl-C is a key here, not a signal
            note()
            raise
        yield text


def _bindings(session: Screen) -> KeyBindings:
    """Let a function key give its command at once, whatever is typed."""
    bindings = KeyBindings()

    def bind(key: str, command: str) -> None:
        @bindings.add(key)
        def _(event: KeyPressEvent) -> None:
            event.current_buffer.text = command
            event.current_buffer.validate_and_handle()

    for key, command in session.keys.items():
        bind(key, command)
    return bindings


def _completer(session: Screen) -> WordCompleter:
    """Complete the first word of a line, with what the command does next to it."""
    meanings = {name: f"{usage}  {text}".strip() for name, (usage, text, _) in session.commands.items()}
    return WordCompleter(list(meanings), meta_dict=dict(meanings), sentence=True)


def _toolbar(session: Screen) -> StyleAndTextTuples:
    shown: StyleAndTextTuples = [("", "  ".join(session.values()))]
    notes = session.notes()
    if notes:
        shown += [("", "\n"), ("fg:ansired", "  ".join(notes))]
    return shown


def _history() -> History:
    """Return the lines of earlier sessions, or a history of this one where there is no place for a file."""
    state = os.environ.get("XDG_STATE_HOME") or "~/.local/state"
    with suppress(OSError, RuntimeError):
        file = Path(state).expanduser() / "hil" / "panel-history"
        file.parent.mkdir(parents=True, exist_ok=True)
        with file.open("ab"):
            return FileHistory(str(file))
    return InMemoryHistory()
