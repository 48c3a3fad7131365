"""The panel of an S7 axis: the commands of an operator on the axis control panel (section 6 of the
commissioning specification).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from fieldbus.errors import ConfigurationError
from hil.panel._words import help_lines, parse
from motion.s7.alarms import error_text
from motion.s7.axis.jobs import ERROR_ALARM
from motion.s7.commissioning import Optimisation, TestStep, precautions
from motion.s7.instructions import (
    MC_CamIn,
    MC_CamOut,
    MC_GearIn,
    MC_GearOut,
    MC_MoveJog,
    MC_OffsetRelative,
    MC_PhasingRelative,
)
from reports.html.tuning import write_tuning

if TYPE_CHECKING:
    from hil.bench.bench import Bench
    from motion.s7.commissioning import ControlPanel

_LONGEST_S: Final = 3600.0
_LOOKING: Final = ("help", "status", "wait")
"""Commands after which the answer to an earlier one still stands."""
_SWITCHES: Final = {
    "StatusWord.X17": "hardware -",
    "StatusWord.X18": "hardware +",
    "StatusWord.X15": "software -",
    "StatusWord.X16": "software +",
}
"""Limit switches that are active or passed."""
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
        advise: Takes what is recommended before the axis moves.
        alive: Whether the panel gives signs of life by itself; else who shows it does (`panel.heartbeat`).

    """

    keys: Final[Mapping[str, str]] = {}
    """Function keys of a terminal, and the commands that they give: none."""

    def __init__(
        self,
        bench: Bench,
        axis: str,
        *,
        monitoring_s: float,
        plot: Path,
        write: Callable[[str], object],
        advise: Callable[[str], object],
        alive: bool = True,
    ) -> None:
        self._bench = bench
        self._plot = plot
        self._write = write
        self._advise = advise
        self._monitoring_s = monitoring_s
        self._alive = alive
        self._panels: dict[str, ControlPanel] = {}
        """Of every axis that has been chosen."""
        self.ended = False
        self._seen: object = None
        self._read: object = None
        """Job whose error has been read."""
        self._choose(axis)

    def _choose(self, name: str) -> None:
        """Let commands go to another axis; the one before keeps what it does.

        Raises:
            ConfigurationError: There is no such axis.

        """
        self._axis = self._bench.axis(name or None)
        if self._axis.name not in self._panels:
            self._panels[self._axis.name] = self._axis.control_panel(
                monitoring_s=self._monitoring_s, alive=self._alive
            )
        self.panel = panel = self._panels[self._axis.name]
        length, speed, ramp = (self.unit(name) for name in ("Length", "Velocity", "Acceleration"))
        self.commands: dict[str, tuple[str, str, Callable[..., object]]] = {
            "take": ("", "take the axis from the user program", self._take),
            "release": ("", "disable the axis and give it back", panel.release),
            "enable": ("", "enable the axis", panel.enable),
            "disable": ("", "stop and disable it", panel.disable),
            "ack": ("", "acknowledge alarms; what they disabled stays off until `enable`", self._acknowledge),
            "velocity": ("V", f"velocity at slider 100 %, {speed}", self._setter("velocity")),
            "acceleration": ("A", f"acceleration, {ramp}", self._setter("acceleration")),
            "deceleration": ("D", f"deceleration, {ramp}", self._setter("deceleration")),
            "jerk": ("J", f"jerk, {self.unit('Jerk')}; 0: none is limited", self._setter("jerk")),
            "adjust": ("P", "velocity adjustment, 1 to 200 %", self._setter("adjust")),
            "slide": ("S", "slider, -100 to 100 %; 0 ends the job", panel.slide),
            "jog": ("[S]", "jog until `slide 0`; slider, % (100), below 0 backward", self._jog),
            "rel": ("D [S]", f"move by a distance, {length}; slider, % (100)", panel.move_relative),
            "abs": ("P [S]", f"move to a position, {length}; slider, % (100)", panel.move_absolute),
            "home": ("[P] [S]", f"home actively; home position (0 {length}), slider", panel.home),
            "set": ("P", f"make this the actual position, {length}", panel.set_position),
            "adjust-encoder": ("P", f"adjust the absolute encoder to this, {length}", panel.adjust_encoder),
            "stop": ("", "stop with the greatest deceleration", panel.stop),
            **self._following(),
            "optimise": ("D V A [TOL]", "optimise the position controller with a test step", self._optimise),
            "status": ("", "the pages of the axis", lambda: self._write(self._axis.diagnosis().text())),
            "wait": ("S", "let seconds pass", self._wait),
            "help": ("", "this list", self._help),
            "quit": ("", "give the axis back and end", self._quit),
        }

    def _following(self) -> dict[str, tuple[str, str, Callable[..., object]]]:
        """Return the commands for several axes: to another one, and of an axis that follows others."""
        several = len(self._bench.axis_names) > 1
        commands: dict[str, tuple[str, str, Callable[..., object]]] = {}
        if several:
            text = f"commands to another axis: {', '.join(self._bench.axis_names)}"
            commands["axis"] = ("NAME", text, self._choose)
        leaders = [one.name for one in self._axis.object.leading_objects]
        if not leaders:
            return commands
        axis, follow = self._axis.object, self.panel.follow
        length = self.unit("Length")

        def leader(name: str) -> Any:
            if name not in leaders:
                raise ConfigurationError("leading object", name, f"one of {', '.join(leaders)}")
            bench = self._bench
            return (bench.axis(name) if name in bench.axis_names else bench.external_encoder(name)).object

        def gear(name: str, numerator: float = 1.0, denominator: float = 1.0) -> None:
            ratio: dict[str, Any] = {
                "RatioNumerator": round(numerator),
                "RatioDenominator": round(denominator),
            }
            follow(MC_GearIn(axis, Master=leader(name), Execute=True, **ratio))

        def cam(name: str, of: str) -> None:
            known = self._bench.cam_names
            if of not in known:
                raise ConfigurationError("cam", of, f"one of {', '.join(known) or 'none'}")
            handle = self._bench.cam(of)
            if handle.curve is None:
                handle.interpolate()
                self.let_pass()
            how: dict[str, Any] = {"ApplicationMode": 1, "SyncProfileReference": 2}
            follow(MC_CamIn(axis, Master=leader(name), Cam=handle.object, Execute=True, **how))

        def out(kind: type[MC_GearOut | MC_CamOut]) -> Callable[..., None]:
            def leave(place: float, distance: float = 0.0) -> None:
                over = {"MasterStopDistance": distance} if distance else {"SyncProfileReference": 0}
                follow(kind(axis, Execute=True, SlavePosition=place, **over))

            return leave

        def phase(shift: float) -> None:
            follow(MC_PhasingRelative(axis, Master=axis.leader, Execute=True, PhaseShift=shift))

        def offset(by: float, distance: float) -> None:
            follow(MC_OffsetRelative(axis, Execute=True, Offset=by, OffsetDistance=distance))

        stop = f"leave the gear and stop at P, {length}, over the way W of the leading value"
        move = f"shift the following value by O, {length}, over the way W of the leading value"
        return commands | {
            "gear": ("LEADER [N] [D]", f"follow {' or '.join(leaders)} with the ratio N : D (1 : 1)", gear),
            "gear-out": ("P [W]", stop, out(MC_GearOut)),
            "cam": ("LEADER CAM", "follow by a cam again and again, beginning where both are", cam),
            "cam-out": ("P [W]", "leave the cam, as `gear-out`", out(MC_CamOut)),
            "phase": ("S", "shift the leading value by S, its unit", phase),
            "offset": ("O W", move, offset),
        }

    def unit(self, quantity: str) -> str:
        """Return the unit of a quantity of the axis: Length, Velocity, Acceleration or Jerk."""
        path = {
            "Length": "Position" if self._axis.has_position else "Velocity",
            "Velocity": "DynamicLimits.MaxVelocity",
            "Acceleration": "DynamicLimits.MaxAcceleration",
            "Jerk": "DynamicLimits.MaxJerk",
        }[quantity]
        return str(self._axis.variables.unit(path))

    def prompt(self) -> str:
        """Return axis, state, who has it, and the unit of its positions."""
        state = self._axis.state.name.lower().replace("_", " ")
        return f"{self._axis.name} {state}{'' if self.panel.active else ' (program)'} {self.unit('Length')}> "

    def values(self) -> list[str]:
        """Return position, velocity and following error with their units, and the limit switches."""
        axis = self._axis
        shown = [f"velocity {self._value('ActualVelocity' if axis.has_position else 'Velocity', '.4g')}"]
        if axis.has_position:
            shown.insert(0, f"position {self._value('ActualPosition', '.6g')}")
            shown.append(f"following error {self._value('StatusPositioning.FollowingError', '.3g')}")
            job = axis.object.motion.synchronous_job
            if job is not None:
                shown.append(f"{'synchronous' if job.synchronous else 'synchronises'} ({job.instruction})")
            active = [name for path, name in _SWITCHES.items() if axis.var(path)]
            shown.append(f"limit switches {', '.join(active) or 'free'}")
        return shown

    def _value(self, path: str, form: str) -> str:
        # + 0.0: no minus in front of a rounded zero
        return f"{float(format(self._axis.var(path), form)) + 0.0:{form}} {self._axis.variables.unit(path)}"

    def line(self) -> str:
        """Return the state of axis and panel in one line."""
        who = "panel" if self.panel.active else "program"
        state = self._axis.state.name.lower().replace("_", " ")
        name = [self._axis.name] if len(self._panels) > 1 else []
        return "  ".join([f"{self._bench.now_s:9.3f} s", *name, who, state, *self.values(), *self.notes()])

    def notes(self) -> list[str]:
        """Return what an operator needs besides state and values: failed job, alarm, motion that continues
        until it is ended, loss of control.
        """
        panel, notes = self.panel, []
        job = panel.job
        pending = self._axis.alarms.engine.highest
        alarm = f"alarm {pending.number}: {pending.text}" if pending and pending.number else ""
        if job is not None and job.Error and job is not self._read:
            reason = alarm if alarm and job.ErrorID == ERROR_ALARM else error_text(job.ErrorID)
            notes.append(f"{job.instruction} failed, {reason}")
        elif alarm:
            notes.append(alarm)
        if panel.acknowledging:
            notes.append("the acknowledgement waits until the drive is off")
        if isinstance(job, MC_MoveJog) and job.Busy and panel.slider:
            notes.append(f"jogs at slider {panel.slider:g} % until `slide 0`")
        if panel.error_id:
            notes.append(f"control was lost, {error_text(panel.error_id)} ({panel.message})")
        elif panel.message and not panel.active:
            notes.append(f"control was returned: {panel.message}")
        return notes

    def changed(self) -> bool:
        """Return whether something has happened since the last call that no line was typed for."""
        now = (self.panel.active, self._axis.state, tuple(self.notes()))
        before, self._seen = self._seen, now
        return now != before

    def execute(self, text: str) -> None:
        """Carry out one line.

        Raises:
            ConfigurationError: There is no such command, or its values are no numbers.
            HilError: What the panel says to it.

        """
        found = parse(text, self.commands)
        if found is None:
            return
        name, numbers = found
        if name not in _LOOKING and not self._axis.alarms.engine.number:
            self._read = self.panel.job
        self.commands[name][2](*numbers)

    def let_pass(self, cycles: int = _AFTER_COMMAND) -> None:
        """Let some cycles pass."""
        self._bench.run_for(cycles * self._bench.runtime.cycle_ns * 1e-9)

    def close(self) -> None:
        """Give all axes back, and wait until that is done."""
        held = [name for name, panel in self._panels.items() if panel.active]
        for name in held:
            self._panels[name].release()
        if held:
            self._bench.run_until(lambda: not any(self._panels[name].active for name in held), timeout=10.0)
        for name in held:
            self._choose(name)
            self._write(self.line())
        for panel in self._panels.values():
            panel.disconnect()

    def _acknowledge(self) -> None:
        disabled = self._axis.enabling.alarmed
        self.panel.acknowledge()
        self._read = self.panel.job
        if disabled:
            self._write("the alarm has disabled the axis: it stays off until `enable`")

    def _jog(self, slider: float = 100.0) -> None:
        job = self.panel.jog(slider)
        if slider:
            velocity = job.Velocity * abs(slider) / 100.0
            way = "forward" if slider > 0.0 else "backward"
            self._write(
                f"jogs {way} at {velocity:g} {self.unit('Velocity')} until `slide 0` or `stop`; "
                "`slide S` changes velocity and direction"
            )

    def _setter(self, name: str) -> Callable[[float], None]:
        return lambda value: setattr(self.panel, name, value)

    def _take(self) -> None:
        self.panel.take_control()
        missing = precautions(self._axis.object)
        if missing:
            self._advise(f"not active, and recommended before the axis moves: {'; '.join(missing)}")

    def _wait(self, seconds: float) -> None:
        if not 0.0 <= seconds <= _LONGEST_S:
            raise ConfigurationError("wait", seconds, f"0 to {_LONGEST_S:g} s")
        self._bench.run_for(seconds)

    def _help(self) -> None:
        for line in help_lines(self.commands):
            self._write(line)

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
        unit = self.unit("Length")
        page = write_tuning(self._plot, found.attempts, axis=self._axis.name, unit=unit)
        self._write(
            f"recommended: {', '.join(f'{path} = {value:.6g}' for path, value in found.start_values.items())}"
        )
        self._write(f"plot: {page}")
