"""`hil panel`: the axis control panel in a terminal, or from a script on standard input."""

from __future__ import annotations

import os
import selectors
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Final, TextIO

from fieldbus.clock import RealtimeScheduler
from fieldbus.errors import HilError
from hil._commands.terminal import console
from hil.campaign import load_bench_file
from hil.panel import NcPanelSession, PanelSession

if TYPE_CHECKING:
    from hil.bench.bench import Bench

_TICK_S: Final = 0.05
"""How often a panel on a terminal lets time pass."""


def run_panel(bench: str, *, axis: str, monitoring_s: float, plot: Path, stdin: TextIO | None = None) -> int:
    """Run the panel until its input ends; returns the exit code.

    On a terminal time passes as on the clock. A script lets it pass with `wait`, and ends with the first line
    that cannot be carried out (exit code 1).

    Args:
        bench: Bench file or embedded name; empty for the default one.
        axis: Name of the axis; empty for the only one.
        monitoring_s: Monitoring time of the life sign, s.
        plot: Where an optimisation writes its page.
        stdin: Where lines come from; default standard input.

    """
    source = stdin or sys.stdin
    with load_bench_file(bench or None).build(seed=0) as machine:
        session = _session(machine, axis, monitoring_s=monitoring_s, plot=plot)
        interactive = source.isatty()
        lines = _lines(source, machine, session) if interactive else source
        try:
            for number, text in enumerate(lines, start=1):
                try:
                    session.execute(text)
                except HilError as error:
                    place = "" if interactive else f"line {number}: "
                    console().print(f"{place}{error}", markup=False, soft_wrap=True)
                    if not interactive:
                        return 1
                session.let_pass()
                if text.strip():
                    _tell(session.line())
                    session.changed()
                if session.ended:
                    break
        finally:
            session.close()
    return 0


def _session(machine: Bench, axis: str, *, monitoring_s: float, plot: Path) -> PanelSession | NcPanelSession:
    """Return the panel that an axis has by its make."""
    if (axis or next(iter(machine.config.axis), "")) in machine.nc_axis_names:
        return NcPanelSession(machine.axis(axis or None, controller="nc"), time=machine, write=_tell)
    return PanelSession(machine, axis, monitoring_s=monitoring_s, plot=plot, write=_tell, advise=_advise)


def _advise(text: str) -> None:
    console().print(text, markup=False, soft_wrap=True)


def _tell(text: str) -> None:
    """Write a line; a terminal that has been closed does not keep the axis from being given back."""
    with suppress(OSError):
        print(text, flush=True)  # noqa: T201 - this is the answer


def _lines(source: TextIO, machine: Bench, session: PanelSession | NcPanelSession) -> Iterator[str]:
    """Return the lines that a person types: with prompt and live values where the screen can show them."""
    _tell(f"{session.line()}\n(help lists the commands)")
    session.changed()
    if source is sys.stdin and sys.stdout.isatty() and os.environ.get("TERM", "dumb") != "dumb":
        from hil._commands._panel_screen import typed

        return typed(machine, session, tell=_tell)
    return _typed(source, machine, session)


def _typed(source: TextIO, machine: Bench, session: PanelSession | NcPanelSession) -> Iterator[str]:
    """Yield lines as they are typed; meanwhile time passes, and events are printed."""
    virtual = not isinstance(machine.scheduler, RealtimeScheduler)
    selector = selectors.DefaultSelector()
    selector.register(source, selectors.EVENT_READ)
    while True:
        while not selector.select(_TICK_S if virtual else 0.0):
            machine.run_for(_TICK_S)
            if session.changed():
                _tell(session.line())
        try:
            text = source.readline()
        except OSError:  # the terminal has been closed
            return
        if not text:
            return
        yield text
