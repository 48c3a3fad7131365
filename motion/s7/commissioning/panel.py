"""The axis control panel: an operator takes an axis from the user program, enables, jogs, homes and moves it
(§6.2 to §6.8).
"""

from __future__ import annotations

from math import inf
from typing import TYPE_CHECKING, Any, Final, NotRequired, TypedDict, TypeVar

from fieldbus.clock import S, Timer
from fieldbus.errors import ConfigurationError, HilError
from motion.s7.axis import TechnologyAxis
from motion.s7.axis.state import AxisState
from motion.s7.controller import OperatingState
from motion.s7.instructions import (
    Instruction,
    MC_Halt,
    MC_Home,
    MC_MoveAbsolute,
    MC_MoveJog,
    MC_MoveRelative,
    MC_Power,
    MC_Reset,
)

if TYPE_CHECKING:
    from motion.s7.runtime import Runtime

ALARM_LIFE_SIGN: Final = 204
"""The same as a technology alarm, raised when the axis is off, so that it does not weaken the stop (TA-019).
"""
ERROR_LIFE_SIGN: Final = 0x8013
"""The panel has not given a sign of life within the monitoring time (MC-005)."""
MAX_DYNAMICS: Final = 2
"""`MC_Power.StopMode` with which the panel disables: the greatest deceleration (COM-031)."""
_SHARE: Final = 0.1
"""Share of the limits with which velocity and acceleration begin (COM-038)."""
_ADJUST: Final = (1.0, 200.0)
_FULL: Final = 100.0
_OFF: Final = (AxisState.DISABLED, AxisState.ALARM_DISABLED)

_T = TypeVar("_T", bound=Instruction)


class _Dynamics(TypedDict):
    """Inputs of a job of the panel."""

    Velocity: float
    Acceleration: float
    Deceleration: float
    Jerk: float
    Direction: NotRequired[int]


class CommissioningError(HilError):
    """The control panel cannot do that now; the text says why."""


def _dynamic_value(name: str, text: str, *, zero: bool = False) -> property:
    """Return a property for a dynamic value of the panel that takes numbers above 0 only, or 0 too."""

    def get(self: ControlPanel) -> float:
        return self._values[name]

    def change(self: ControlPanel, value: float) -> None:
        if not (0.0 < value < inf or (zero and value == 0.0)):
            raise ConfigurationError(name, value, "a number of 0 or more" if zero else "a number above 0")
        self._values[name] = float(value)

    return property(get, change, doc=text)


class ControlPanel:
    """Commissioning of one axis by hand: `panel = bench.axis("axis1").control_panel()`.

    The commands return at once; the panel acts in the application cycle like a user program. Velocities are
    those of the panel times the slider times `adjust` (COM-035).

    Args:
        runtime: The cycle of the controller.
        axis: A speed or positioning axis.
        monitoring_s: Time without a sign of life after which the axis is stopped and given back, s; 1 to
            2 s suit (COM-024).

    Raises:
        ConfigurationError: The object is an external encoder (CFG-065), or the time is not above 0.

    """

    def __init__(self, runtime: Runtime, axis: TechnologyAxis, *, monitoring_s: float = 2.0) -> None:
        if not isinstance(axis, TechnologyAxis):
            raise ConfigurationError("control panel", axis.name, "a speed, positioning or synchronous axis")
        if not monitoring_s > 0.0:
            raise ConfigurationError("monitoring_s", monitoring_s, "a time above 0 s")
        self._runtime = runtime
        self.axis = axis
        self._monitoring_ns = round(monitoring_s * S)
        self._beat_ns = 0
        self._timer: Timer | None = None
        self._instances: list[Instruction] = []
        self._power: MC_Power | None = None
        self._returning = ""
        self._acknowledging = False
        self._kept: dict[str, float] = {}
        self._slider = 0.0
        self._last_slider: float | None = None
        self.job: Any = None
        """Instance of the last motion or homing job, with its outputs."""
        self.error_id = 0
        """16#8013 after control was lost because the sign of life was missing; 0 otherwise."""
        self.message = ""
        """Why control was returned, in words."""
        limits = axis.variables.read
        self._values: dict[str, float] = {
            "velocity": _SHARE * limits("DynamicLimits.MaxVelocity"),
            "acceleration": _SHARE * limits("DynamicLimits.MaxAcceleration"),
            "deceleration": limits("DynamicLimits.MaxDeceleration"),
            "jerk": limits("DynamicLimits.MaxJerk"),
        }
        self._adjust = _FULL

    velocity = _dynamic_value("velocity", "Velocity of jobs at slider 100 %, axis unit per second, above 0.")
    acceleration = _dynamic_value("acceleration", "Acceleration, axis unit per second squared, above 0.")
    deceleration = _dynamic_value("deceleration", "Deceleration, axis unit per second squared, above 0.")
    jerk = _dynamic_value("jerk", "Jerk, axis unit per second cubed; 0 = none is limited.", zero=True)

    # -- master control
    # -------------------------------------------------------------------------------------------

    @property
    def active(self) -> bool:
        """Whether the panel has master control (`StatusWord.X4`)."""
        return self.axis.master is self

    @property
    def enabled(self) -> bool:
        """Whether the axis is enabled by the panel."""
        return self._power is not None and self._power.Status

    def take_control(self) -> None:
        """Take the axis from the user program; life-sign monitoring begins (COM-022, COM-023).

        Raises:
            CommissioningError: The controller is not in RUN, the user program has the axis enabled, or
                another panel has it.

        """
        axis = self.axis
        if self.active:
            return
        if axis.master is not None:
            raise CommissioningError(f"{axis.name}: another panel has master control")
        state = self._runtime.controller.state
        if state is not OperatingState.RUN:
            raise CommissioningError(f"{axis.name}: the controller is in {state.value}, not in RUN")
        if axis.enabling.enable or axis.state not in _OFF:
            raise CommissioningError(f"{axis.name}: the user program has it enabled (MC_Power.Enable)")
        axis.master = self
        self.error_id = 0
        self.message = self._returning = ""
        self._last_slider = None
        self._slider = 0.0
        self._power = self._own(MC_Power(axis, name=f"{axis.name}.panel.MC_Power", StopMode=MAX_DYNAMICS))
        self._beat_ns = self._runtime.scheduler.now
        self._runtime.uncall(self._cycle)
        self._runtime.call(self._cycle)
        self._tell("taken")

    def release(self) -> None:
        """Disable the axis and give it back to the user program when it is off
        (COM-070); harmless without control.
        """
        if self.active:
            self._give_back("by command")
        else:
            self._take_back()  # after STOP no cycle of the program has done it yet

    def heartbeat(self) -> None:
        """Give a sign of life."""
        self._beat_ns = self._runtime.scheduler.now

    def keep_alive(self, period_s: float) -> None:
        """Give signs of life every `period_s` s from now on, as the tool of an operator does.

        Raises:
            ConfigurationError: The period is not above 0.

        """
        if not period_s > 0.0:
            raise ConfigurationError("period_s", period_s, "a time above 0 s")
        self.disconnect()
        self.heartbeat()
        self._timer = self._runtime.scheduler.every(round(period_s * S), self.heartbeat)

    def disconnect(self) -> None:
        """Give no more signs of life: the connection is lost."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def look_away(self) -> None:
        """The operator does not see the panel any more: stop with the greatest deceleration, keep control
        (COM-029, COM-030).
        """
        if self.active:
            self.stop()

    def cover(self) -> None:
        """A dialog covers the panel: stop with the greatest deceleration and give control back (COM-033)."""
        if self.active:
            self._give_back("the panel was covered")

    def _give_back(self, reason: str, error_id: int = 0) -> None:
        if self._returning:
            return
        self._returning = self.message = reason
        self._acknowledging = False
        self.error_id = error_id
        self._slider = 0.0
        if self._power is not None:
            self._power.set(Enable=False, StopMode=MAX_DYNAMICS)

    def _end(self) -> None:
        """Give the axis back: it is off."""
        axis = self.axis
        self._take_back()
        if self._last_slider is not None:
            axis.write("Override.Velocity", self._last_slider)  # COM-041
        axis.master = None
        self._leave()
        self._tell("returned")
        if self.error_id == ERROR_LIFE_SIGN:
            axis.alarms.raise_alarm(ALARM_LIFE_SIGN, info=1)

    def _take_back(self) -> None:
        """Give the variables that were tried their former values again (COM-071)."""
        for path, value in self._kept.items():
            self.axis.write(path, value)
        self._kept = {}

    def _leave(self) -> None:
        self._instances = []
        self._power = None
        self._acknowledging = False
        self._runtime.uncall(self._cycle)

    def _tell(self, what: str) -> None:
        history = self._runtime.history
        if history is not None:
            history.emit(
                self.axis.name, "panel.control", what=what, reason=self.message, error_id=self.error_id
            )

    # -- cycle
    # ------------------------------------------------------------------------------------------------------

    def _cycle(self) -> None:
        axis = self.axis
        if not self.active:
            # The controller has taken the axis for itself: STOP, or loss of supply.
            self.message = "the controller left RUN"
            self._take_back()
            self._leave()
            self._tell("returned")
            return
        if self._runtime.scheduler.now - self._beat_ns > self._monitoring_ns:
            self._give_back("no sign of life within the monitoring time", ERROR_LIFE_SIGN)
        power = self._power
        if self._acknowledging and power is not None and axis.state is not AxisState.ALARM_DRIVE_STOP:
            self._acknowledge(power)
        for instance in self._instances:
            instance()
        if self._returning and power is not None and power.off() and axis.state in _OFF:
            self._end()
            return
        self._instances = [
            one for one in self._instances if one is power or one.Busy or one is self.job or _starts(one)
        ]

    def _own(self, instance: _T) -> _T:
        instance.master = self
        self._instances.append(instance)
        return instance

    # -- what an operator does
    # ----------------------------------------------------------------------------------------

    def _need_control(self, *, enabled: bool = False) -> None:
        if not self.active or self._returning:
            raise CommissioningError(f"{self.axis.name}: the panel does not have master control")
        if enabled and not self.enabled:
            raise CommissioningError(f"{self.axis.name}: it is not enabled in the panel")

    def enable(self) -> None:
        """Enable the axis, with position control where it has a position.

        Raises:
            CommissioningError: The panel does not have control.

        """
        self._need_control()
        if self._power is not None:
            self._power.set(Enable=True)

    def disable(self) -> None:
        """Stop with the greatest deceleration and disable the axis; control is kept."""
        self._need_control()
        self._slider = 0.0
        if self._power is not None:
            self._power.set(Enable=False)

    def acknowledge(self) -> None:
        """Acknowledge the alarms of the axis; if one has disabled it, it stays off until `enable` is called.

        `MC_Power` would switch the drive on again as soon as the alarm is acknowledged, if its `Enable` had
        stayed TRUE (STP-033): so the panel takes it away first. While the drive still brakes by itself, the
        acknowledgement waits until it is off (STP-381).
        """
        self._need_control()
        self._acknowledging = True

    @property
    def acknowledging(self) -> bool:
        """Whether an acknowledgement waits for the drive to be off."""
        return self._acknowledging

    def _acknowledge(self, power: MC_Power) -> None:
        if self.axis.enabling.alarmed:
            power.set(Enable=False)
        self._acknowledging = False
        self._own(MC_Reset(self.axis, Execute=True))

    @property
    def adjust(self) -> float:
        """Correction of the configured velocity, 1 to 200 % (COM-040)."""
        return self._adjust

    @adjust.setter
    def adjust(self, percent: float) -> None:
        low, high = _ADJUST
        if not low <= percent <= high:
            raise ConfigurationError("adjust", percent, f"{low:g} to {high:g} %")
        self._adjust = float(percent)

    @property
    def slider(self) -> float:
        """Position of the slider, -100 to 100 %; 0 = released."""
        return self._slider

    def slide(self, percent: float) -> None:
        """Move the slider: a running job gets faster or slower; released (0) it ends it (COM-036).

        Raises:
            ConfigurationError: The position is not between -100 and 100 %.
            CommissioningError: The panel does not have control.

        """
        self._need_control()
        self._set_slider(percent)
        job = self.job
        if isinstance(job, MC_MoveJog):
            job.set(JogForward=percent > 0.0, JogBackward=percent < 0.0)
        elif percent == 0.0 and job is not None and job.Busy:
            self._halt(self.deceleration, self.jerk)

    def _set_slider(self, percent: float) -> None:
        if not -_FULL <= percent <= _FULL:
            raise ConfigurationError("slider", percent, "-100 to 100 %")
        self._slider = percent
        if percent != 0.0:
            self._last_slider = abs(percent)
            self.axis.write("Override.Velocity", abs(percent))

    def jog(self, slider: float = _FULL) -> MC_MoveJog:
        """Jog: a slider above 0 forward, below 0 backward, 0 = stop (COM-048).

        Raises:
            ConfigurationError, CommissioningError: As `slide`; or the axis is not enabled.

        """
        self._need_control(enabled=True)
        self._set_slider(slider)
        dynamics, forward, backward = self._dynamics(), slider > 0.0, slider < 0.0
        if isinstance(self.job, MC_MoveJog) and self.job in self._instances:
            self.job.set(JogForward=forward, JogBackward=backward, **dynamics)
        else:
            self.job = self._own(MC_MoveJog(self.axis, JogForward=forward, JogBackward=backward, **dynamics))
        return self.job

    def move_relative(self, distance: float, slider: float = _FULL) -> MC_MoveRelative:
        """Move by `distance`, axis unit; a slider below 0 goes the other way (COM-049)."""
        self._need_control(enabled=True)
        self._set_slider(slider)
        way = distance if slider > 0.0 else -distance
        self.job = self._own(MC_MoveRelative(self.axis, Execute=True, Distance=way, **self._dynamics()))
        return self.job  # type: ignore[no-any-return]

    def move_absolute(self, position: float, slider: float = _FULL) -> MC_MoveAbsolute:
        """Move to `position`, axis unit; on a modulo axis forward, with a slider below
        0 backward (COM-050, COM-051).
        """
        self._need_control(enabled=True)
        axis = self.axis
        self._set_slider(slider)
        inputs = self._dynamics()
        if axis.modulo.enabled:
            position = axis.modulo.wrap(position)
            inputs["Direction"] = 1 if slider > 0.0 else 2
        self.job = self._own(MC_MoveAbsolute(axis, Execute=True, Position=position, **inputs))
        return self.job  # type: ignore[no-any-return]

    def home(self, position: float = 0.0, slider: float = _FULL) -> MC_Home:
        """Home actively as configured, with the dynamics of the panel: `MC_Home` Mode 3 (COM-042)."""
        self._need_control(enabled=True)
        self._set_slider(slider)
        job = MC_Home(self.axis, Execute=True, Mode=3, Position=position)
        dynamics = self._dynamics()
        job.dynamics = (dynamics["Acceleration"], dynamics["Deceleration"], dynamics["Jerk"])
        self.job = self._own(job)
        return job

    def set_position(self, position: float) -> MC_Home:
        """Make `position` the actual position: `MC_Home` Mode 0 (COM-043)."""
        return self._home_directly(0, position)

    def adjust_encoder(self, value: float, *, relative: bool = False) -> MC_Home:
        """Adjust the absolute encoder to a position (`MC_Home` Mode 7) or by an offset
        (Mode 6) (COM-044 to COM-046).
        """
        return self._home_directly(6 if relative else 7, value)

    def _home_directly(self, mode: int, position: float) -> MC_Home:
        self._need_control(enabled=True)
        self.job = self._own(MC_Home(self.axis, Execute=True, Mode=mode, Position=position))
        return self.job  # type: ignore[no-any-return]

    def follow(self, instance: _T) -> _T:
        """Start an instance that follows a leading value, leaves it or shifts it; the slider does not act on
        it.

        Raises:
            CommissioningError: The panel does not have control, or the axis is not enabled.

        """
        self._need_control(enabled=True)
        self.job = self._own(instance)
        return instance

    def stop(self) -> MC_Halt:
        """Stop with the greatest deceleration; control and enable are kept."""
        self._need_control()
        read = self.axis.variables.read
        return self._halt(read("DynamicLimits.MaxDeceleration"), read("DynamicLimits.MaxJerk"))

    def _halt(self, deceleration: float, jerk: float) -> MC_Halt:
        self._slider = 0.0
        if isinstance(self.job, MC_MoveJog):
            self.job.set(JogForward=False, JogBackward=False)
        return self._own(MC_Halt(self.axis, Execute=True, Deceleration=deceleration, Jerk=jerk))

    def _dynamics(self) -> _Dynamics:
        """Return the inputs of a job, within the dynamic limits of the axis (COM-039)."""
        read = self.axis.variables.read
        return {
            "Velocity": min(self.velocity * self._adjust * 0.01, read("DynamicLimits.MaxVelocity")),
            "Acceleration": min(self.acceleration, read("DynamicLimits.MaxAcceleration")),
            "Deceleration": min(self.deceleration, read("DynamicLimits.MaxDeceleration")),
            "Jerk": min(self.jerk, read("DynamicLimits.MaxJerk")),
        }

    def try_value(self, path: str, value: float) -> None:
        """Assign a variable until control is returned; then it has its former value again (COM-071).

        Raises:
            CommissioningError: The panel does not have control.
            ConfigurationError: There is no such variable.

        """
        self._need_control()
        self._kept.setdefault(path, self.axis.variables.read(path))
        self.axis.write(path, value)


def _starts(instance: Instruction) -> bool:
    """Whether an instance has been made and not been called to its end yet."""
    ended = getattr(instance, "ended", None)
    if ended is not None:
        return not ended()
    return not (getattr(instance, "Done", False) or instance.Error)
