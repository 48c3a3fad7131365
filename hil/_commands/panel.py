"""`hil panel`: the axis control panel in a terminal, or from a script on standard input."""

from __future__ import annotations

import selectors
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, Final, TextIO

from fieldbus.clock import RealtimeScheduler
from fieldbus.errors import ConfigurationError, HilError
from hil._commands.terminal import console
from hil.campaign import load_bench_file
from motion.s7.commissioning import Optimisation, TestStep, precautions
from reports.html.tuning import write_tuning

_TICK_S: Final = 0.05
"""How often a panel on a terminal lets time pass."""
_LONGEST_S: Final = 3600.0
_AFTER_COMMAND: Final = 4
"""Cycles that pass after a line of a script, so that it has acted when the next one is read."""


class PanelSession:
    """The commands of a panel on one axis of a bench.

    Args:
        bench: A bench that has been brought up.
        axis: Name of the axis; empty for the only one.
        monitoring_s: Monitoring time of the life sign, s.
        plot: Where an optimisation writes its page.
        write: Takes what is to be shown.

    """

    def __init__(
        self, bench: Any, axis: str, *, monitoring_s: float, plot: Path, write: Callable[[str], object]
    ) -> None:
        self._bench = bench
        self._axis = bench.axis(axis or None)
        self._plot = plot
        self._write = write
        self.panel = self._axis.control_panel(monitoring_s=monitoring_s)
        self.ended = False
        self._seen: object = None
        panel = self.panel
        self.commands: dict[str, tuple[str, str, Callable[..., object]]] = {
            "take": ("", "take the axis from the user program", self._take),
            "release": ("", "disable the axis and give it back", panel.release),
            "enable": ("", "enable the axis", panel.enable),
            "disable": ("", "stop and disable it", panel.disable),
            "ack": ("", "acknowledge alarms", panel.acknowledge),
            "velocity": ("V", "velocity at slider 100 %, axis unit/s", self._setter("velocity")),
            "acceleration": ("A", "acceleration, axis unit/s2", self._setter("acceleration")),
            "deceleration": ("D", "deceleration, axis unit/s2", self._setter("deceleration")),
            "jerk": ("J", "jerk, axis unit/s3", self._setter("jerk")),
            "adjust": ("P", "velocity adjustment, 1 to 200 %", self._setter("adjust")),
            "slide": ("S", "slider, -100 to 100 %; 0 ends the job", panel.slide),
            "jog": ("[S]", "jog; slider, % (100)", panel.jog),
            "rel": ("D [S]", "move by a distance; slider, % (100)", panel.move_relative),
            "abs": ("P [S]", "move to a position; slider, % (100)", panel.move_absolute),
            "home": ("[P] [S]", "home actively; home position (0), slider", panel.home),
            "set": ("P", "make this the actual position", panel.set_position),
            "adjust-encoder": ("P", "adjust the absolute encoder to a position", panel.adjust_encoder),
            "stop": ("", "stop with the greatest deceleration", panel.stop),
            "optimise": ("D V A [TOL]", "optimise the position controller with a test step", self._optimise),
            "status": ("", "the pages of the axis", lambda: self._write(self._axis.diagnosis().text())),
            "wait": ("S", "let seconds pass", self._wait),
            "help": ("", "this list", self._help),
            "quit": ("", "give the axis back and end", self._quit),
        }

    def line(self) -> str:
        """Return the state of axis and panel in one line."""
        axis, panel = self._axis, self.panel
        parts = [
            f"{self._bench.now_s:9.3f} s",
            "panel" if panel.active else "program",
            axis.state.name.lower(),
            f"velocity {axis.var('ActualVelocity' if axis.has_position else 'Velocity'):.4g}",
        ]
        if axis.has_position:
            parts.insert(3, f"position {axis.var('ActualPosition'):.6g}")
        return "  ".join([*parts, *self._notes()])

    def _notes(self) -> list[str]:
        """Return what an operator needs besides state and position: failed job, alarm, loss of control."""
        panel, notes = self.panel, []
        job = panel.job
        if job is not None and job.Error:
            notes.append(f"{job.instruction} refused or ended with {job.ErrorID:04X}h")
        pending = self._axis.alarms.engine.highest
        if pending is not None and pending.number:
            notes.append(f"alarm {pending.number} {pending.text}")
        if panel.error_id:
            notes.append(f"{panel.error_id:04X}h {panel.message}")
        elif panel.message and not panel.active:
            notes.append(panel.message)
        return notes

    def changed(self) -> bool:
        """Return whether something has happened since the last call that no line was typed for."""
        now = (self.panel.active, self._axis.state, tuple(self._notes()))
        before, self._seen = self._seen, now
        return now != before

    def execute(self, text: str) -> None:
        """Carry out one line.

        Raises:
            ConfigurationError: There is no such command, or its values are no numbers.
            HilError: What the panel says to it.

        """
        words = text.partition("#")[0].split()
        if not words:
            return
        name, *values = words
        if name not in self.commands:
            raise ConfigurationError("command", name, f"one of {', '.join(self.commands)}")
        usage, _, act = self.commands[name]
        most = len(usage.split())
        least = len([one for one in usage.split() if not one.startswith("[")])
        if not least <= len(values) <= most:
            raise ConfigurationError(f"values of {name}", " ".join(values), usage or "none")
        try:
            numbers = [float(value) for value in values]
        except ValueError as error:
            raise ConfigurationError(f"values of {name}", " ".join(values), f"numbers: {usage}") from error
        act(*numbers)

    def let_pass(self, cycles: int = _AFTER_COMMAND) -> None:
        """Let some cycles pass."""
        self._bench.run_for(cycles * self._bench.runtime.cycle_ns * 1e-9)

    def close(self) -> None:
        """Give the axis back, and wait until that is done."""
        if self.panel.active:
            self.panel.release()
            self._bench.run_until(lambda: not self.panel.active, timeout=10.0)
            self._write(self.line())
        self.panel.disconnect()

    def _setter(self, name: str) -> Callable[[float], None]:
        return lambda value: setattr(self.panel, name, value)

    def _take(self) -> None:
        self.panel.take_control()
        missing = precautions(self._axis.object)
        if missing:
            text = f"not active, and recommended before the axis moves: {'; '.join(missing)}"
            console().print(text, markup=False, soft_wrap=True)

    def _wait(self, seconds: float) -> None:
        if not 0.0 <= seconds <= _LONGEST_S:
            raise ConfigurationError("wait", seconds, f"0 to {_LONGEST_S:g} s")
        self._bench.run_for(seconds)

    def _help(self) -> None:
        for name, (usage, text, _) in self.commands.items():
            self._write(f"  {name + ' ' + usage:24} {text}")

    def _quit(self) -> None:
        self.ended = True

    def _optimise(
        self, distance: float, velocity: float, acceleration: float, tolerance: float = 0.0
    ) -> None:
        step = TestStep(distance, velocity, acceleration, tolerance)
        routine = Optimisation(
            self.panel,
            self._bench.runtime,
            lambda condition, seconds: self._bench.scheduler.run_until(condition, round(seconds * 1e9)),
            step,
        )
        try:
            found = routine.run()
        finally:
            for number, one in enumerate(routine.attempts, start=1):
                self._write(
                    f"  {number:3}  Kv {one.kv:8.3f}/s  Kpc {one.kpc:3.0f} %  T "
                    f"{1000 * one.time_constant:4.0f} ms  "
                    f"overshoot {one.overshoot:8.4f}  settled after {one.settling_s:6.3f} s  "
                    f"{'good' if one.good else 'overshoots'}"
                )
        unit = self._axis.variables.unit("Position")
        page = write_tuning(self._plot, found.attempts, axis=self._axis.name, unit=unit)
        self._write(
            f"recommended: {', '.join(f'{path} = {value:.6g}' for path, value in found.start_values.items())}"
        )
        self._write(f"plot: {page}")


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
        session = PanelSession(machine, axis, monitoring_s=monitoring_s, plot=plot, write=_tell)
        interactive = source.isatty()
        lines = _typed(source, machine, session) if interactive else source
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


def _tell(text: str) -> None:
    """Write a line; a terminal that has been closed does not keep the axis from being given back."""
    with suppress(OSError):
        print(text, flush=True)  # noqa: T201 - this is the answer


def _typed(source: TextIO, machine: Any, session: PanelSession) -> Iterator[str]:
    """Yield lines as they are typed; meanwhile time passes, and events are printed."""
    virtual = not isinstance(machine.scheduler, RealtimeScheduler)
    selector = selectors.DefaultSelector()
    selector.register(source, selectors.EVENT_READ)
    _tell(f"{session.line()}\n(help lists the commands)")
    session.changed()
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
