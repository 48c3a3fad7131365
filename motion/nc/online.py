"""The online view of an axis and what can be done in it: enabling, keys, functions, coupling, compensation
(section 11), and the online view of its encoder (section 12.5).

Its motions are prepared by the SVB task (NC-055). While a PLC is linked and runs it has priority: they are
refused then (NC-230).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Final

from fieldbus.errors import ConfigurationError
from motion.nc.commands import CONTINUOUS, ENDLESS, POSITION, STOP, Command, CommandState
from motion.nc.errors import BLOCK_MODE, BLOCK_NOT_PERMITTED, BLOCK_PARAMETER, NO_ERROR
from motion.nc.interface import FULL_OVERRIDE, Control, State
from motion.nc.modulo import Direction, ModuloTargetError, modulo_move

if TYPE_CHECKING:
    from collections.abc import Callable

    from fieldbus.clock import Scheduler
    from motion.nc.axis import NcAxis
    from motion.nc.axis_ref import AxisRef
    from motion.nc.parameters import ParameterSet

ENABLES: Final = int(Control.ENABLE | Control.FEED_PLUS | Control.FEED_MINUS)
_FAST: Final = "axis.manual_velocity_fast"
_SLOW: Final = "axis.manual_velocity_slow"
MANUAL_KEYS: Final = {"F1": (-1.0, _FAST), "F2": (-1.0, _SLOW), "F3": (1.0, _SLOW), "F4": (1.0, _FAST)}
"""Direction and velocity of the keys that move while they are pressed (NC-232 to NC-235)."""
KEYS: Final = (*MANUAL_KEYS, "F5", "F6", "F8", "F9")
START_MODES: Final = ("absolute", "relative", "endless +", "endless -", "modulo", "reversing")
"""Modes of the extended start (NC-240)."""


@dataclass(frozen=True)
class OnlineView:
    """What the online dialog shows (NC-218 to NC-228); positions and velocities as they are displayed."""

    actual_position: float
    setpoint_position: float
    lag_distance: float
    lag_min: float
    """Lowest following error since reset."""
    lag_max: float
    """Highest following error since reset."""
    actual_velocity: float
    setpoint_velocity: float
    override: float
    """Percent."""
    total_output: float
    """Output to the drive, percent."""
    control_output: float
    """Share of the position control in it, percent."""
    error: int
    """Error code of the axis."""
    ready: bool
    calibrated: bool
    has_job: bool
    not_moving: bool
    moving_fw: bool
    moving_bw: bool
    coupled: bool
    in_target_position: bool
    in_position_range: bool
    controller: bool
    feed_fw: bool
    feed_bw: bool
    position_unit: str
    velocity_unit: str


@dataclass(frozen=True)
class EncoderView:
    """What the online dialog of the encoder shows (NC-291 to NC-298)."""

    position: float
    uncorrected_position: float
    """Before position correction and filter."""
    correction: float
    hard_increments: int
    """Counter of the hardware."""
    soft_increments: tuple[int, int]
    """Counter of the NC: upper and lower 32 bit."""
    modulo_position: float
    modulo_turns: int
    latch_difference: float
    """Way between reference cam and sync event in the last homing."""
    calibrated: bool


def _percent(value: float, full: float) -> float:
    return 100.0 * value / full if full else 0.0


class Online:
    """The online dialog of an axis.

    Args:
        ref: `AXIS_REF` of the axis.
        scheduler: Time.
        plc_has_priority: Whether a PLC is linked to the axis and runs.
        axis_of: Returns the axis of a name, for couplings.

    """

    def __init__(
        self,
        ref: AxisRef,
        *,
        scheduler: Scheduler,
        plc_has_priority: Callable[[], bool],
        axis_of: Callable[[str], NcAxis],
    ) -> None:
        self._ref = ref
        self._scheduler = scheduler
        self._plc_has_priority = plc_has_priority
        self._axis_of = axis_of
        self._pressed = ""
        self._command: Command | None = None
        self._started = 0
        self._reversing: tuple[float, float] | None = None
        self._velocity = 0.0
        self.target_position = 0.0
        """Field *Target Position*, position unit."""
        self.target_velocity = 0.0
        """Field *Target Velocity*, position unit/s."""
        self.error_id = NO_ERROR
        """Error code with which the last command was refused; 0: it was not."""
        self.last_time = 0.0
        """Duration of the last motion, s (*Last Time*)."""

    @property
    def _axis(self) -> NcAxis:
        return self._ref.axis

    # -- what is shown

    def view(self) -> OnlineView:
        """Return what the dialog shows now."""
        axis = self._axis
        parameters, image, control = axis.parameters, axis.nc_to_plc, axis.plc_to_nc.ControlDWord
        state = image.StateDWord
        position_factor = 1000.0 if parameters.read("axis.display_position_um") else 1.0
        velocity_factor = 60.0 if parameters.read("axis.display_velocity_mm_min") else 1.0
        unit = str(parameters.read("axis.unit"))
        modulo = parameters.read("axis.display_modulo")
        drive, lag = axis.drive, axis.monitoring

        def shown(absolute: float, in_turn: float) -> float:
            return (in_turn if modulo else absolute) * position_factor

        return OnlineView(
            actual_position=shown(image.ActPos, image.ModuloActPos),
            setpoint_position=shown(image.SetPos, image.ModuloSetPos),
            lag_distance=image.PosDiff * position_factor,
            lag_min=lag.lag_min * position_factor,
            lag_max=lag.lag_max * position_factor,
            actual_velocity=image.ActVelo * velocity_factor,
            setpoint_velocity=image.SetVelo * velocity_factor,
            override=min(_percent(axis.plc_to_nc.Override, FULL_OVERRIDE), 100.0),
            total_output=drive.output * 100.0,
            control_output=_percent(drive.control, drive.full),
            error=image.ErrorCode,
            ready=bool(state & State.OPERATIONAL),
            calibrated=bool(state & State.HOMED),
            has_job=bool(state & State.HAS_JOB),
            not_moving=bool(state & State.NOT_MOVING),
            moving_fw=bool(state & State.POSITIVE_DIRECTION),
            moving_bw=bool(state & State.NEGATIVE_DIRECTION),
            coupled=image.CoupleState in {2, 3},
            in_target_position=bool(state & State.IN_TARGET_POSITION),
            in_position_range=bool(state & State.IN_POSITION_AREA),
            controller=bool(control & Control.ENABLE),
            feed_fw=bool(control & Control.FEED_PLUS),
            feed_bw=bool(control & Control.FEED_MINUS),
            position_unit=f"u{unit}" if position_factor != 1.0 else unit,
            velocity_unit=f"{unit}/min" if velocity_factor != 1.0 else f"{unit}/s",
        )

    def reset_extremes(self) -> None:
        """Begin again with the extreme values of the lag distance (NC-220)."""
        self._axis.monitoring.reset_extremes()

    def encoder(self) -> EncoderView:
        """Return what the dialog of the encoder shows now."""
        axis = self._axis
        encoder = axis.encoder
        turns, in_turn = encoder.modulo(encoder.position)
        return EncoderView(
            position=encoder.position,
            uncorrected_position=encoder.uncorrected,
            correction=encoder.correction,
            hard_increments=encoder.hard_increments,
            soft_increments=(encoder.soft_increments >> 32, encoder.soft_increments & 0xFFFFFFFF),
            modulo_position=in_turn,
            modulo_turns=turns,
            latch_difference=axis.homing.latch_difference,
            calibrated=encoder.homed,
        )

    # -- enabling and keys

    def set_enabling(
        self, *, controller: bool, feed_fw: bool, feed_bw: bool, override: float = 100.0
    ) -> None:
        """Set enables and override, percent; the next transfer of a running PLC overwrites them (NC-013,
        NC-229).
        """
        inputs = self._axis.plc_to_nc
        word = inputs.ControlDWord & ~ENABLES
        word |= Control.ENABLE if controller else 0
        word |= Control.FEED_PLUS if feed_fw else 0
        word |= Control.FEED_MINUS if feed_bw else 0
        inputs.ControlDWord = word
        inputs.Override = round(min(max(override, 0.0), 100.0) * (FULL_OVERRIDE / 100.0))

    def all(self) -> None:
        """Set all enables and 100 % (button *All*)."""
        self.set_enabling(controller=True, feed_fw=True, feed_bw=True)

    def press(self, key: str) -> int:
        """Press a key of `KEYS`; F1 to F4 move until `release`. Returns an error code, 0 for none.

        Raises:
            ConfigurationError: There is no such key.

        """
        if key not in KEYS:
            raise ConfigurationError("key", key, ", ".join(KEYS))
        if self._plc_has_priority():
            return BLOCK_NOT_PERMITTED
        axis = self._axis
        manual = MANUAL_KEYS.get(key)
        if manual is not None:
            sign, velocity = manual
            self._pressed = key
            return self._move(ENDLESS, sign, axis.parameters.cell(velocity).value)
        if key == "F5":
            return self._move(POSITION, self.target_position, self.target_velocity)
        if key == "F6":
            return self.stop()
        if key == "F8":
            axis.prepared.append(axis.reset)
        else:
            axis.homing.request()
            home = axis.parameters.cell("enc.home_position").value
            axis.prepared.append(partial(self._take, lambda: axis.homing.start(home)))
        return NO_ERROR

    def release(self, key: str) -> None:
        """Release a key: a motion of F1 to F4 ends."""
        if key == self._pressed:
            self._pressed = ""
            self.stop()

    # -- functions

    def start(
        self,
        mode: str,
        *,
        velocity: float,
        target: float | None = None,
        second_target: float | None = None,
        acceleration: float = 0.0,
        deceleration: float = 0.0,
        jerk: float = 0.0,
    ) -> int:
        """Start a motion (*Extended Start*, NC-240); returns an error code, 0 for none.

        Args:
            mode: One of `START_MODES`.
            velocity: Position unit/s.
            target: Position, or distance, position unit; not for endless motions.
            second_target: The other end of `reversing`.
            acceleration: 0.0 for the default, likewise the others.
            deceleration: Position unit/s2.
            jerk: Position unit/s3.

        Raises:
            ConfigurationError: There is no such mode, or a target that it needs is missing.

        """
        if mode not in START_MODES:
            raise ConfigurationError("start mode", mode, ", ".join(START_MODES))
        endless = mode.startswith("endless")
        if target is None and not endless:
            raise ConfigurationError("start, target", None, f"a position: mode {mode!r} needs it")
        if mode == "reversing" and second_target is None:
            raise ConfigurationError("start, second_target", None, "a position: mode 'reversing' needs it")
        if self._plc_has_priority():
            return BLOCK_NOT_PERMITTED
        self._reversing = None
        dynamics = (acceleration, deceleration, jerk)
        if endless:
            return self._move(ENDLESS, 1.0 if mode.endswith("+") else -1.0, velocity, dynamics)
        assert target is not None  # see above
        if mode == "modulo":
            return self._move_modulo(target, velocity, dynamics)
        if mode == "reversing" and second_target is not None:
            self._reversing = (second_target, target)
            self._velocity = velocity
        return self._move(POSITION, target, velocity, dynamics, relative=mode == "relative")

    def _move_modulo(self, target: float, velocity: float, dynamics: tuple[float, float, float]) -> int:
        axis = self._axis
        try:
            way = modulo_move(
                axis.motion.generator.s,
                target,
                factor=axis.parameters.cell("enc.modulo_factor").value,
                tolerance=axis.parameters.cell("enc.modulo_tolerance_window").value,
                direction=Direction.POSITIVE,
            )
        except ModuloTargetError:
            return BLOCK_PARAMETER
        return self._move(POSITION, way, velocity, dynamics, relative=True)

    def stop(self) -> int:
        """Stop the axis, reversing and raw output included; returns an error code, 0 for none."""
        axis = self._axis
        if self._plc_has_priority():
            return BLOCK_NOT_PERMITTED
        self._reversing = None
        axis.raw_output = None
        deceleration, jerk = axis.stop_dynamics(0.0, 0.0)
        axis.prepared.append(
            partial(
                self._give,
                Command(STOP, acceleration=deceleration, deceleration=deceleration, jerk=jerk),
            )
        )
        return NO_ERROR

    def raw_output(self, percent: float) -> int:
        """Output a share of full scale, percent, without position control until `stop` (NC-241); returns an
        error code, 0 for none.
        """
        axis = self._axis
        if self._plc_has_priority() or axis.encoder_only or axis.two_speed:
            return BLOCK_NOT_PERMITTED
        if not axis.closed or axis.motion.active is not None or axis.coupling.master is not None:
            return BLOCK_MODE
        axis.raw_output = percent / 100.0
        return NO_ERROR

    def set_actual_position(self, position: float, *, relative: bool = False) -> None:
        """Give the present place another position, or shift it (NC-242, NC-299)."""
        self._axis.set_position(position, relative=relative)

    def set_calibration(self, calibrated: bool) -> None:
        """Set or reset the calibration flag by hand (NC-298)."""
        axis = self._axis
        if calibrated:
            axis.homing.complete()
        else:
            axis.encoder.homed = False

    def set_target_position(self, target: float) -> int:
        """Change the target of the motion that runs (NC-243); returns an error code, 0 for none."""
        if self._plc_has_priority():
            return BLOCK_NOT_PERMITTED
        axis = self._axis
        if axis.motion.active is None:
            return BLOCK_MODE
        axis.prepared.append(partial(self._take, lambda: axis.change_target(target)))
        return NO_ERROR

    # -- coupling and compensation

    def couple(self, master: str, ratio: float = 1.0) -> int:
        """Couple the axis linearly to a master (*Couple*, NC-244); returns an error code, 0 for none."""
        return self._axis.couple(self._axis_of(master), ratio)

    def change_factor(self, ratio: float) -> int:
        """Change the ratio while coupled (*Change Factor*); returns an error code, 0 for none."""
        coupling = self._axis.coupling
        if coupling.master is None or ratio == 0.0:
            return BLOCK_NOT_PERMITTED if ratio else BLOCK_PARAMETER
        coupling.set_ratio(ratio)
        return NO_ERROR

    def decouple(self) -> int:
        """Dissolve the coupling (*Decouple*); returns an error code, 0 for none."""
        if self._axis.coupling.master is None:
            return BLOCK_NOT_PERMITTED
        self._axis.decouple()
        return NO_ERROR

    def compensate(self, distance: float, velocity: float) -> int:
        """Add a distance to the motion that runs (*Compensation*, NC-245); returns an error code, 0 for
        none.
        """
        acceleration, deceleration, jerk = self._axis.dynamics(0.0, 0.0, 0.0)
        return self._axis.superimpose(
            Command(
                POSITION,
                velocity=velocity,
                acceleration=acceleration,
                deceleration=deceleration,
                jerk=jerk,
                target=distance,
            )
        )

    # -- motions

    def step(self) -> None:
        """Look at the motion that runs; once per cycle of the NC."""
        command = self._command
        if command is None or not command.ended:
            return
        self._command = None
        self.last_time = (self._scheduler.now - self._started) * 1e-9
        if self._reversing is not None and command.state is CommandState.DONE:
            target, self._reversing = self._reversing[0], self._reversing[::-1]
            self._move(POSITION, target, self._velocity)
        else:
            self._reversing = None

    def _move(
        self,
        kind: int,
        target: float,
        velocity: float,
        dynamics: tuple[float, float, float] = (0.0, 0.0, 0.0),
        *,
        relative: bool = False,
    ) -> int:
        acceleration, deceleration, jerk = self._axis.dynamics(*dynamics)
        command = Command(
            kind,
            velocity=velocity,
            acceleration=acceleration,
            deceleration=deceleration,
            jerk=jerk,
            target=target,
            relative=relative,
        )
        self._axis.prepared.append(partial(self._give, command))
        return NO_ERROR

    def _give(self, command: Command) -> None:
        self._take(lambda: self._axis.submit(command))
        if not self.error_id and command.kind in {POSITION, ENDLESS, CONTINUOUS}:
            self._command = command
            self._started = self._scheduler.now

    def _take(self, submit: Callable[[], int]) -> None:
        self.error_id = submit()


def fill_dynamics(parameters: ParameterSet, *, time_s: float, steepness: float = 1.0) -> None:
    """Set the default dynamics from the time to Maximum Velocity, as the dialog does (NC-217).

    Args:
        parameters: Parameters of the axis; only the three defaults change.
        time_s: Time to Maximum Velocity with constant acceleration, s.
        steepness: Slider: the acceleration is reached in `time_s / steepness`, 1 or more.

    Raises:
        ConfigurationError: The time is not above 0, or the steepness below 1.

    """
    if not time_s > 0.0:
        raise ConfigurationError("acceleration time", time_s, "above 0 s")
    if not steepness >= 1.0:
        raise ConfigurationError("steepness", steepness, "1 or more")
    acceleration = parameters.cell("axis.maximum_velocity").value / time_s
    parameters.write_all(
        {
            "axis.default_acceleration": acceleration,
            "axis.default_deceleration": acceleration,
            "axis.default_jerk": acceleration * steepness / time_s,
        }
    )
