"""The panel of an NC axis: the keys F1 to F9 and the online view of its dialog (NC-218 to NC-242)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Final, Protocol

from fieldbus.errors import ConfigurationError
from hil.panel._words import help_lines, parse
from motion.nc.blocks import JogMode, MC_Home, MC_Jog, MC_MoveAbsolute, MC_Stop
from motion.nc.errors import error_text

if TYPE_CHECKING:
    from motion.nc.blocks import Block, ExecuteBlock
    from motion.nc.handles import NcAxisHandle
    from motion.nc.online import OnlineView

_AFTER_COMMAND: Final = 4
"""Cycles that pass after a line of a script, so that it has acted when the next one is read."""
_LONGEST_S: Final = 3600.0
JOGS: Final = {
    "f1": (JogMode.MC_JOGMODE_STANDARD_FAST, True),
    "f2": (JogMode.MC_JOGMODE_STANDARD_SLOW, True),
    "f3": (JogMode.MC_JOGMODE_STANDARD_SLOW, False),
    "f4": (JogMode.MC_JOGMODE_STANDARD_FAST, False),
}
"""Key -> velocity, and whether it moves in negative direction (NC-232 to NC-235)."""


class BenchTime(Protocol):
    """Time of a bench, and its cycles."""

    @property
    def now_s(self) -> float:
        """Time of the bench, s."""

    @property
    def cycle_ns(self) -> int:
        """Cycle of the bus, ns."""

    def run_for(self, seconds: float) -> None:
        """Let time pass."""

    def run_until(self, predicate: Callable[[], object], timeout: float) -> bool:
        """Let time pass until a condition holds; returns whether it did within `timeout`, s."""

    def on_cycle(self, callback: Callable[[], object]) -> Callable[[], None]:
        """Call a function at the end of every cycle; returns what ends that."""


class NcPanelSession:
    """The commands of a panel on one NC axis.

    Args:
        axis: The axis, on a bench that has been brought up.
        time: Time of the bench.
        write: Takes what is to be shown.

    """

    keys: Final[Mapping[str, str]] = {key: key for key in ("f1", "f2", "f3", "f4", "f5", "f6", "f8", "f9")}
    """Function keys of a terminal, and the commands that they give."""

    def __init__(self, axis: NcAxisHandle, *, time: BenchTime, write: Callable[[str], object]) -> None:
        self._axis = axis
        self._time = time
        self._write = write
        self.ended = False
        self._seen: object = None
        run, ref = self._axis.run, self._axis.ref
        self._jog = run(MC_Jog(ref))
        self._move = run(MC_MoveAbsolute(ref))
        self._stop = run(MC_Stop(ref))
        self._homing = run(MC_Home(ref))
        self._pressed = ""
        self.job: Block | None = None
        """Block that the last command has started or changed; None: it was none."""
        self._target = self._axis.position
        self._velocity = float(self._number("axis.manual_velocity_slow"))
        self._dynamics = dict.fromkeys(("Acceleration", "Deceleration", "Jerk"), 0.0)
        self._untrack = time.on_cycle(self._track)
        unit = self._unit = str(self._axis.read_parameter("axis.unit"))
        self.commands: dict[str, tuple[str, str, Callable[..., object]]] = {
            "enable": ("[OVERRIDE]", "controller and both feed enables, override in % (100)", self._enable),
            "set": (
                "C FW BW [OVERRIDE]",
                "each enable, 0 or 1: controller, forward, backward",
                self._set,
            ),
            "disable": ("", "take all enables away", lambda: self._set(0.0, 0.0, 0.0)),
            "target": ("P", f"field Target Position, {unit}", self._field("_target")),
            "velocity": ("V", f"field Target Velocity, {unit}/s", self._field("_velocity")),
            "acceleration": ("A", f"{unit}/s2; 0: that of the axis", self._dynamic("Acceleration")),
            "deceleration": ("D", f"{unit}/s2; 0: that of the axis", self._dynamic("Deceleration")),
            "jerk": ("J", f"{unit}/s3; 0: that of the axis", self._dynamic("Jerk")),
            "f1": (
                "[S]",
                "--: fast in negative direction, for S or until `release`",
                self._key("f1"),
            ),
            "f2": ("[S]", "-: slow in negative direction", self._key("f2")),
            "f3": ("[S]", "+: slow in positive direction", self._key("f3")),
            "f4": ("[S]", "++: fast in positive direction", self._key("f4")),
            "release": ("", "release the key F1 to F4", self._release),
            "f5": ("", "start to Target Position with Target Velocity", self._start),
            "f6": ("", "stop", self._stops),
            "f8": ("", "reset", self._reset),
            "f9": ("", "calibrate: home with the parameters of the axis", self._home),
            "cam": ("C", "cam of the PLC for F9, 0 or 1", self._cam),
            "position": ("P", f"set the actual position, {unit}", self._set_position),
            "status": ("", "the online view", lambda: [self._write(line) for line in self.view()]),
            "wait": ("S", "let seconds pass", self._wait),
            "help": ("", "this list", lambda: [self._write(line) for line in help_lines(self.commands)]),
            "quit": ("", "take the enables away and end", self._quit),
        }

    @property
    def target(self) -> float:
        """Field Target Position, position unit."""
        return self._target

    @property
    def move_inputs(self) -> dict[str, float]:
        """Velocity and dynamics with which `f5` starts, by the names of the inputs of the block."""
        return {"Velocity": self._velocity, **self._dynamics}

    @property
    def stop_inputs(self) -> dict[str, float]:
        """Dynamics with which `f6` stops, by the names of the inputs of the block."""
        return {name: self._dynamics[name] for name in ("Deceleration", "Jerk")}

    def _number(self, key: str) -> float:
        return float(self._axis.object.parameters.cell(key).value)

    def _track(self) -> None:
        if self._stop.ended():
            self._stop.set(Execute=False)

    def _give(self, block: ExecuteBlock, **inputs: float) -> None:
        """Start a block, again if it was started before."""
        block.set(Execute=False)
        self.let_pass(2)
        block.set(Execute=True, **inputs)
        self.job = block

    # -- what is shown
    # ----------------------------------------------------------------------------------------

    @staticmethod
    def _length(value: float, view: OnlineView) -> str:
        digits = 1 if view.position_unit.startswith("u") else 4
        return f"{value + 0.0:.{digits}f} {view.position_unit}"

    @staticmethod
    def _speed(value: float, view: OnlineView) -> str:
        digits = 3 if view.velocity_unit.endswith("/min") else 4
        return f"{value + 0.0:.{digits}f} {view.velocity_unit}"

    @staticmethod
    def _words(*flags: tuple[bool, str]) -> str:
        return ", ".join(text for flag, text in flags if flag) or "-"

    def _log_status(self) -> str:
        view = self._axis.online.view()
        return self._words(
            (view.ready, "Ready"),
            (view.calibrated, "Calibrated"),
            (view.has_job, "Has Job"),
            (view.not_moving, "NOT Moving"),
            (view.moving_fw, "Moving Fw"),
            (view.moving_bw, "Moving Bw"),
        )

    def view(self) -> list[str]:
        """Return the online view, a line for each of its fields."""
        view = self._axis.online.view()
        low, high = (self._length(value, view).split(" ")[0] for value in (view.lag_min, view.lag_max))
        lag = f"{view.lag_distance + 0.0:.4f} ({low}, {high}) {view.position_unit}"
        physical = self._words(
            (view.coupled, "Coupled Mode"),
            (view.in_target_position, "In Target Pos."),
            (view.in_position_range, "In Pos. Range"),
        )
        enables = self._words(
            (view.controller, "Controller"), (view.feed_fw, "Feed Fw"), (view.feed_bw, "Feed Bw")
        )
        output = f"{view.total_output + 0.0:.2f} / {view.control_output + 0.0:.2f} %"
        return [
            f"  {'Actual Position':24} {self._length(view.actual_position, view)}",
            f"  {'Setpoint Position':24} {self._length(view.setpoint_position, view)}",
            f"  {'Lag Distance (min/max)':24} {lag}",
            f"  {'Actual Velocity':24} {self._speed(view.actual_velocity, view)}",
            f"  {'Setpoint Velocity':24} {self._speed(view.setpoint_velocity, view)}",
            f"  {'Override':24} {view.override:.4f} %",
            f"  {'Total / Control Output':24} {output}",
            f"  {'Error':24} {error_text(view.error) if view.error else '0'}",
            f"  {'Status (log.)':24} {self._log_status()}",
            f"  {'Status (phys.)':24} {physical}",
            f"  {'Enabling':24} {enables}",
            f"  {'Target':24} {self._target:.4f} {self._unit}, {self._velocity:.4f} {self._unit}/s",
        ]

    def prompt(self) -> str:
        """Return axis, state and the unit of its positions."""
        return f"{self._axis.name} {self._log_status()} {self._unit}> "

    def values(self) -> list[str]:
        """Return position, velocity and lag with their units."""
        view = self._axis.online.view()
        return [
            f"position {self._length(view.actual_position, view)}",
            f"velocity {self._speed(view.actual_velocity, view)}",
            f"lag {view.lag_distance + 0.0:.4f} {view.position_unit}",
        ]

    def notes(self) -> list[str]:
        """Return what an operator needs besides: error, refused start, key that is held."""
        notes = []
        if self._axis.error_id:
            notes.append(f"error {error_text(self._axis.error_id)}: f8 resets it")
        for name, block in (
            ("start", self._move),
            (self._pressed, self._jog),
            ("stop", self._stop),
            ("homing", self._homing),
        ):
            if block.Error and block.ErrorID != self._axis.error_id:
                notes.append(f"{name} refused, {error_text(block.ErrorID)}")
        if self._pressed:
            notes.append(f"{self._pressed} is held until `release` or f6")
        return notes

    def line(self) -> str:
        """Return the state of the axis in one line."""
        return "  ".join([f"{self._time.now_s:9.3f} s", self._log_status(), *self.values(), *self.notes()])

    def changed(self) -> bool:
        """Return whether something has happened since the last call that no line was typed for."""
        now = (self._log_status(), tuple(self.notes()))
        before, self._seen = self._seen, now
        return now != before

    # -- what is done
    # -----------------------------------------------------------------------------------------

    def execute(self, text: str) -> None:
        """Carry out one line.

        Raises:
            ConfigurationError: There is no such command, or its values are no numbers or not allowed.

        """
        found = parse(text, self.commands)
        if found is not None:
            name, numbers = found
            self.job = None
            self.commands[name][2](*numbers)

    def let_pass(self, cycles: int = _AFTER_COMMAND) -> None:
        """Let some cycles pass."""
        self._time.run_for(cycles * self._time.cycle_ns * 1e-9)

    def close(self) -> None:
        """Stop the axis and take its enables away."""
        self._release()
        if self._axis.operational:
            self._stops()
            self._time.run_until(lambda: self._axis.object.motion.standing, timeout=10.0)
        self._axis.power(False, positive=False, negative=False)
        self.let_pass()
        self._untrack()

    def _enable(self, override: float = 100.0) -> None:
        self._set(1.0, 1.0, 1.0, override)

    def _set(self, controller: float, forward: float, backward: float, override: float = 100.0) -> None:
        for name, value in (("C", controller), ("FW", forward), ("BW", backward)):
            if value not in (0.0, 1.0):
                raise ConfigurationError(name, value, "0 or 1")
        if not 0.0 <= override <= 100.0:
            raise ConfigurationError("OVERRIDE", override, "0 to 100 %")
        self.job = self._axis.power(
            controller == 1.0, positive=forward == 1.0, negative=backward == 1.0, override=override
        )

    def _field(self, name: str) -> Callable[[float], None]:
        return lambda value: setattr(self, name, value)

    def _dynamic(self, name: str) -> Callable[[float], None]:
        def set_(value: float) -> None:
            if not value >= 0.0:
                raise ConfigurationError(name.lower(), value, "0 or more")
            self._dynamics[name] = value

        return set_

    def _key(self, key: str) -> Callable[..., None]:
        def press(seconds: float | None = None) -> None:
            self._release()
            mode, backwards = JOGS[key]
            self._jog.set(Mode=mode, JogForward=not backwards, JogBackwards=backwards)
            self._pressed = key
            self.job = self._jog
            if seconds is not None:
                self._wait(seconds)
                self._release()

        return press

    def _release(self) -> None:
        if self._pressed:
            self._jog.set(JogForward=False, JogBackwards=False)
            self._pressed = ""
            self.let_pass(2)

    def _start(self) -> None:
        self._release()
        self._give(self._move, Position=self._target, **self.move_inputs)

    def _stops(self) -> None:
        self._release()
        self._give(self._stop, **self.stop_inputs)

    def _reset(self) -> None:
        self._axis.online.reset_extremes()
        self._move.set(Execute=False)
        self.job = self._axis.reset()

    def _home(self) -> None:
        self._release()
        self._give(self._homing)

    def _set_position(self, position: float) -> None:
        self.job = self._axis.set_position(position)

    def _cam(self, state: float) -> None:
        if state not in (0.0, 1.0):
            raise ConfigurationError("cam", state, "0 or 1")
        self._homing.set(bCalibrationCam=state == 1.0)

    def _wait(self, seconds: float) -> None:
        if not 0.0 <= seconds <= _LONGEST_S:
            raise ConfigurationError("wait", seconds, f"0 to {_LONGEST_S:g} s")
        self._time.run_for(seconds)

    def _quit(self) -> None:
        self.ended = True
