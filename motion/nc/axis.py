"""An NC axis: its components in the order of a cycle, its error, its cyclic image."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from motion.nc.commands import ENDLESS, POSITION, STOP, BufferMode, Command, CommandState
from motion.nc.controller import Controller
from motion.nc.coupling import Coupling
from motion.nc.device import POSITION as POSITION_INTERFACE
from motion.nc.device import TORQUE as TORQUE_INTERFACE
from motion.nc.device import VELOCITY as VELOCITY_INTERFACE
from motion.nc.device import DriveOutputs, SimulatedDevice
from motion.nc.discrete import Discrete
from motion.nc.drive import DIGITAL, FULL_TORQUE, Drive
from motion.nc.encoder import Encoder
from motion.nc.errors import (
    BLOCK_NOT_PERMITTED,
    BLOCK_PARAMETER,
    BLOCK_STOPPED,
    CONSEQUENTIAL,
    DRIVE_DATA_INVALID,
    DRIVE_LIFE_COUNTER,
    DRIVE_NOT_READY,
    ENCODER_DATA_INVALID,
    ENCODER_FAULT,
    EXTERNAL_ACTIVE,
    LIMIT_MAX,
    LIMIT_MAX_AT_START,
    LIMIT_MAX_INVALID,
    LIMIT_MIN,
    LIMIT_MIN_AT_START,
    LIMIT_MIN_INVALID,
    MOVEMENT_TOO_SMALL,
    NO_CONTROLLER_ENABLE,
    NO_ERROR,
    NO_FEED_MINUS,
    NO_FEED_PLUS,
    STOP_ACTIVE,
    TABLE_CHANGE,
    VELOCITY_NOT_ALLOWED,
    error_text,
)
from motion.nc.external import ExternalSetpoints
from motion.nc.fast_stop import FastStop
from motion.nc.filters import Pt1
from motion.nc.homing import Homing
from motion.nc.interface import FULL_OVERRIDE, NcToPlc, OpMode, PlcToNc
from motion.nc.monitoring import Monitoring
from motion.nc.motion import STANDS, Motion
from motion.nc.path import AxisLimits
from motion.nc.superposed import Superposed
from motion.nc.tables import TableSpace
from motion.nc.torque import VelocityController
from motion.nc.touch_probe import TouchProbe

if TYPE_CHECKING:
    from collections.abc import Callable

    from fieldbus.history import History
    from motion.nc.coupling import CoupledAxis
    from motion.nc.device import Device
    from motion.nc.encoder import Retained
    from motion.nc.interpolation import AxisGroup
    from motion.nc.parameters import ParameterSet, Value

_ENABLE: Final = 0x1
_FEED_PLUS: Final = 0x2
_FEED_MINUS: Final = 0x4
_FEEDS: Final = _FEED_PLUS | _FEED_MINUS
_SLACK: Final = 1e-9
_RESET_S: Final = 0.2
"""Time that a drive has to clear its fault after a reset, s."""
INVALID_CYCLES: Final = 3
"""Cycles with invalid data without an error (NC-427)."""
TRACE_COLUMNS: Final = (
    ("set_position", "mm"),
    ("set_velocity", "mm/s"),
    ("set_acceleration", "mm/s2"),
    ("actual_position", "mm"),
    ("actual_velocity", "mm/s"),
    ("following_error", "mm"),
    ("output", ""),
    ("output_data", ""),
    ("output_control", ""),
    ("state_dword", ""),
    ("op_mode_dword", ""),
    ("error_code", ""),
    ("override", ""),
)


class NcAxis:
    """One axis of the NC.

    Args:
        name: Its name.
        number: `AxisId`, from 1 on.
        parameters: Its parameters and those of its components.
        device: Its hardware.
        saf_cycle_s: Cycle of the SAF task, s; that of the axis is `axis.cycle_divider` times as long.
        encoder_only: It is an encoder axis: without drive and controller (NC-058).
        two_speed: It is a discrete axis (NC-061).
        missing_resources: It should have hardware and is not linked: it is not operational (NC-014).
        tables: Tables of the NC; None: there are none.
        history: Event log, or None.

    """

    def __init__(
        self,
        name: str,
        *,
        number: int,
        parameters: ParameterSet,
        device: Device,
        saf_cycle_s: float,
        encoder_only: bool = False,
        two_speed: bool = False,
        missing_resources: bool = False,
        tables: TableSpace | None = None,
        history: History | None = None,
    ) -> None:
        self.name = name
        self.number = number
        self.parameters = parameters
        self.device = device
        self.history = history
        cell = parameters.cell
        self.divider = int(cell("axis.cycle_divider").value)
        self.phase = int(cell("axis.cycle_modulo").value)
        self.cycle_s = cycle_s = saf_cycle_s * self.divider
        """Cycle of the axis, s (NC-077)."""
        self.encoder_only = encoder_only
        """It has an encoder and neither drive nor controller."""
        self.two_speed = two_speed
        """It is a discrete axis."""
        self.missing_resources = missing_resources
        self.disabled = bool(parameters.read("axis.disabled"))
        """It is not executed (NC-067)."""
        self.persistent = bool(parameters.read("axis.data_persistence"))
        """It takes part in the retain data (NC-205)."""
        self.retained: Retained | None = None
        """What was kept of it, for the definition of its position."""
        self.prepared: list[Callable[[], object]] = []
        """Commands that wait for the SVB task (`SvbEntries`)."""
        self._simulated = device if isinstance(device, SimulatedDevice) else None
        self._outputs = DriveOutputs()
        self._interface = device.interface
        self.encoder = Encoder(parameters, cycle_s=cycle_s, io_cycle_s=saf_cycle_s, signed=device.signed)
        self.tables = tables or TableSpace()
        """Tables of the NC."""
        self.drive = Drive(parameters, cycle_s=cycle_s, saf_cycle_s=saf_cycle_s, tables=self.tables)
        self.controller = Controller(
            parameters, cycle_s=cycle_s, analog=parameters.read("drv.type") not in DIGITAL
        )
        self.velocity_controller = VelocityController(parameters, cycle_s=cycle_s)
        """Velocity loop of the torque controllers."""
        self.monitoring = Monitoring(parameters, cycle_s=cycle_s)
        self.motion = Motion(parameters, cycle_s=cycle_s)
        self.discrete: Discrete | None = None
        """Execution of the commands of a discrete axis; None: it is none."""
        if two_speed:
            self.motion.plans = False
            self.discrete = Discrete(parameters, self.motion, cycle_s=cycle_s)
        self._group: AxisGroup | None = None
        self._group_stops: list[Command] = []
        """Stops that have been given to the group and wait for its standstill."""
        self._path_before = 0.0
        self.raw_output: float | None = None
        """Share of full scale that is output without position control; None: it is controlled (NC-241)."""
        self.plc_to_nc = PlcToNc()
        """Image on the side of the NC."""
        self.nc_to_plc = NcToPlc()
        """Image on the side of the NC."""
        self.nc_to_plc.AxisId = number
        self.operational = False
        self.error_id = NO_ERROR
        self.following_error = 0.0
        self.drive_error = False
        """The drive reports an error (`DriveDeviceError`)."""
        self.external = ExternalSetpoints(self.plc_to_nc, self.motion)
        self.coupling = Coupling(parameters, self.motion, cycle_s=cycle_s)
        self.probe = TouchProbe(device, self.encoder)
        """Touch probe."""
        self.superposed = Superposed(self.motion, self.coupling, cycle_s=cycle_s)
        self.fast_stop = FastStop(parameters)
        self._allow_slave = cell("axis.allow_commands_slave")
        self._allow_external = cell("axis.allow_commands_ext_setpoint")
        self.homing = Homing(
            parameters,
            motion=self.motion,
            encoder=self.encoder,
            device=device,
            inputs=self.plc_to_nc,
            submit=self.submit,
            shift=self.shift,
        )
        self._maximum_velocity = cell("axis.maximum_velocity")
        self._default_acceleration = cell("axis.default_acceleration")
        self._default_deceleration = cell("axis.default_deceleration")
        self._default_jerk = cell("axis.default_jerk")
        self._low_on = cell("axis.soft_limit_min_enable")
        self._low = cell("axis.soft_limit_min")
        self._high_on = cell("axis.soft_limit_max_enable")
        self._high = cell("axis.soft_limit_max")
        self._correction_on = cell("axis.position_correction")
        self._correction_filter = Pt1(cell("axis.position_correction_filter_time"), cycle_s)
        sercos = parameters.read("drv.type") == "SERCOS"
        self._tolerance = cell("drv.c1d_error_tolerance" if sercos else "drv.error_tolerance")
        self._inverted = cell("drv.invert_motor_polarity")
        self._kv = cell("ctrl.pos_kv")
        self._extern = cell("drv.following_error_calculation")
        self._maximum_acceleration = cell("axis.maximum_acceleration")
        self._maximum_deceleration = cell("axis.maximum_deceleration")
        parameters.guards["drv.valve_table_id"] = self._table_refusal
        self._op_mode_cells = tuple(
            (cell(key), int(bit))
            for key, bit in (
                ("axis.position_range_monitoring", OpMode.POSITION_AREA_MONITORING),
                ("axis.target_position_monitoring", OpMode.TARGET_POSITION_MONITORING),
                ("axis.motion_monitoring", OpMode.MOTION_MONITORING),
                ("axis.in_target_alarm", OpMode.IN_TARGET_ALARM),
                ("axis.position_lag_monitoring", OpMode.POSITION_LAG_MONITORING),
                ("axis.soft_limit_min_enable", OpMode.SOFT_LIMIT_MIN_MONITORING),
                ("axis.soft_limit_max_enable", OpMode.SOFT_LIMIT_MAX_MONITORING),
                ("axis.position_correction", OpMode.POSITION_CORRECTION),
                ("axis.allow_commands_slave", OpMode.ALLOW_SLAVE_COMMANDS),
                ("axis.allow_commands_ext_setpoint", OpMode.ALLOW_EXT_SET_AXIS_COMMANDS),
                ("drv.looping_enable", OpMode.LOOP_MODE),
                ("axis.error_propagation_mode", OpMode.DELAYED_ERROR_REACTION),
            )
        )
        self._modulo = cell("enc.modulo_factor")
        self._motion_watch = cell("axis.motion_monitoring")
        self._torque_out = cell("drv.output_scaling_torque")
        self._acceleration_out = cell("drv.output_scaling_acceleration")
        self._torque_in = cell("drv.input_scaling_torque")
        # What a cycle needs of the parameters, as of their last change.
        self._taken = -1
        self._op_mode = 0
        self._scales_in = self._scales_out = self._corrects = False
        self._watches_limits = self._watches_motion = self._watches_fast_stop = False
        self._cycles = 0
        self._closed = False
        self._enabled = False
        self._invalid = 0
        self.invalid_cycles = INVALID_CYCLES
        """Cycles with invalid data without an error (NC-427)."""
        self._seen_valid = False
        self._unsettled = True
        """The device was not healthy in the last cycle: it is looked at whatever it says now."""
        self._restarts = 0
        self._reset = 0
        self._last_dynamics: tuple[float, float] | None = None
        self._last_output = 0.0

    # -- what a program asks ---------------------------------------------------------------------------------

    @property
    def error(self) -> bool:
        """Whether the axis has an error (`Error`)."""
        return self.error_id != NO_ERROR

    @property
    def resetting(self) -> bool:
        """Whether a reset waits for the drive."""
        return self._reset > 0

    @property
    def position(self) -> float:
        """Actual position, position unit."""
        return self.encoder.position

    @property
    def homed(self) -> bool:
        """Whether the reference to the machine is known (`Homed`)."""
        return self.encoder.homed

    def dynamics(self, acceleration: float, deceleration: float, jerk: float) -> tuple[float, float, float]:
        """Return acceleration, deceleration and jerk of a command: 0.0 stands for the default (NC-091);
        maxima are not checked (NC-093).
        """
        return (
            acceleration or self._default_acceleration.value,
            deceleration or self._default_deceleration.value,
            jerk or self._default_jerk.value,
        )

    def stop_dynamics(self, deceleration: float, jerk: float) -> tuple[float, float]:
        """Return deceleration and jerk of a stop: what is not above 0 is that of the last one (NC-724)."""
        last = self._last_dynamics or (self._default_deceleration.value, self._default_jerk.value)
        return (
            deceleration if deceleration > 0.0 else last[0],
            jerk if jerk > 0.0 else last[1],
        )

    def submit(self, command: Command) -> int:
        """Take a motion command.

        Returns:
            The error code with which it is refused, 0 when it is accepted.

        """
        refused = self._refused(command)
        if refused:
            command.state = CommandState.ERROR
            command.error_id = refused
            self._emit("command.refused", error_id=refused, text=error_text(refused))
            return refused
        if self._group is not None:
            self._group.stop()
            command.state = CommandState.ACTIVE
            self._group_stops.append(command)
            return NO_ERROR
        if self.coupling.master is not None:
            self.decouple()
        if self.external.enabled:
            self.external.cancel(moving=command.kind == STOP)
        self.raw_output = None
        if command.kind != STOP:
            self._last_dynamics = command.deceleration, command.jerk
            self.monitoring.new_target()
        self.motion.submit(command)
        return NO_ERROR

    def _table_refusal(self, number: Value) -> tuple[int, str] | None:
        """Refuse another valve table while the axis is enabled (NC-371), and one that there is not."""
        if self._enabled:
            return TABLE_CHANGE, "a change without controller enable"
        if number and self.tables.get(int(number), "valve") is None:
            known = [str(one) for one, table in self.tables if table.kind == "valve"]
            return BLOCK_PARAMETER, f"0 or the id of a valve table: {', '.join(known) or 'there is none'}"
        return None

    def superimpose(self, command: Command) -> int:
        """Add a distance to what the axis does; returns an error code, 0 for none (NC-245).

        Maximum Velocity does not bound it (NC-032).
        """
        if self.error:
            return self.error_id
        if not self._closed or self.two_speed or self.encoder_only:
            return BLOCK_NOT_PERMITTED if self.two_speed or self.encoder_only else NO_CONTROLLER_ENABLE
        if self.external.enabled:
            return EXTERNAL_ACTIVE
        if self.motion.locked or self.fast_stop.active:
            return STOP_ACTIVE
        if not command.velocity > 0.0:
            return VELOCITY_NOT_ALLOWED
        if missing := self._feed_missing(command.target):
            return missing
        self.superposed.start(command)
        return NO_ERROR

    def emergency_stop(self, *, ramp: bool) -> None:
        """Stop for an emergency; the event `axis.emergency_stop` says how (NC-011).

        Args:
            ramp: Brake on the ramp of the fast axis stop and lock the axis; FALSE: no output at once.

        """
        self._emit("axis.emergency_stop", reaction="ramp" if ramp else "zero output")
        if not ramp or self.coupling.master is not None or self._group is not None:
            self.raise_error(BLOCK_STOPPED)
            return
        self.external.cancel(moving=True)
        self.superposed.abort(CommandState.ABORTED, NO_ERROR)
        fast = self.fast_stop
        self.motion.submit(
            Command(
                STOP,
                acceleration=fast.deceleration,
                deceleration=fast.deceleration,
                jerk=fast.jerk,
                locks=True,
            )
        )

    def prepare(self) -> None:
        """Execute what waits for the SVB task (NC-055)."""
        prepared, self.prepared = self.prepared, []
        for command in prepared:
            command()

    def change_target(self, target: float) -> int:
        """Change the target of the positioning that runs, on the fly; returns an error code, 0 for none
        (NC-243).
        """
        active = self.motion.active
        if active is None or active.kind != POSITION or self.two_speed:
            return BLOCK_NOT_PERMITTED
        return self.submit(
            Command(
                POSITION,
                velocity=active.velocity,
                acceleration=active.acceleration,
                deceleration=active.deceleration,
                jerk=active.jerk,
                target=target,
            )
        )

    def _refused(self, command: Command) -> int:
        motion = self.motion
        if self.encoder_only:
            return BLOCK_NOT_PERMITTED
        if self.error:
            return self.error_id
        if command.kind == STOP and (command.locks or not motion.locked):
            return NO_ERROR
        if motion.locked or self.fast_stop.active:
            return STOP_ACTIVE
        if self._group is not None:
            return BLOCK_NOT_PERMITTED
        if self.coupling.master is not None and not self._allow_slave.value:
            return BLOCK_NOT_PERMITTED
        if self.external.enabled and not self._allow_external.value:
            return EXTERNAL_ACTIVE
        if not self._enabled:
            return NO_CONTROLLER_ENABLE
        if not self._closed:
            return DRIVE_NOT_READY
        if not 0.0 < command.velocity <= self._maximum_velocity.value:
            return VELOCITY_NOT_ALLOWED
        if command.end_velocity > self._maximum_velocity.value:
            return VELOCITY_NOT_ALLOWED
        if self.discrete is not None:
            refused = self.discrete.sequence.refusal(command.velocity)
            if refused:
                return refused
        start = motion.generator.s
        if command.buffer_mode is not BufferMode.Aborting:
            start = motion.last_target
        if command.kind == ENDLESS:
            direction = command.target
        else:
            target = start + command.target if command.relative else command.target
            way = target - start
            direction = float((way > 0.0) - (way < 0.0))
            if 0.0 < abs(way) < self.encoder.scaling * (1.0 - _SLACK):
                return MOVEMENT_TOO_SMALL
            if outside := self._target_outside(start, target, direction):
                return outside
        if missing := self._feed_missing(direction):
            return missing
        if command.kind == ENDLESS and not motion.limits_off:
            if direction > 0.0 and self._high_on.value and start > self._high.value:
                return LIMIT_MAX_AT_START
            if direction < 0.0 and self._low_on.value and start < self._low.value:
                return LIMIT_MIN_AT_START
        return NO_ERROR

    def _feed_missing(self, direction: float) -> int:
        """Return the error code of a direction without feed enable; 0: there is one, or no direction."""
        control = self.plc_to_nc.ControlDWord
        if direction > 0.0 and not control & _FEED_PLUS:
            return NO_FEED_PLUS
        if direction < 0.0 and not control & _FEED_MINUS:
            return NO_FEED_MINUS
        return NO_ERROR

    def _target_outside(self, start: float, target: float, direction: float) -> int:
        """Compare a target with the software limits; a way back into the permitted range is accepted
        (NC-131).
        """
        if self.motion.limits_off:
            return NO_ERROR
        low, high = self._low.value, self._high.value
        if self._low_on.value and self._high_on.value and low > high:
            return LIMIT_MIN_INVALID if direction < 0.0 else LIMIT_MAX_INVALID
        if self._low_on.value and target < low and not (start < low and direction > 0.0):
            return LIMIT_MIN_AT_START
        if self._high_on.value and target > high and not (start > high and direction < 0.0):
            return LIMIT_MAX_AT_START
        return NO_ERROR

    def reset(self) -> None:
        """Clear the error: the set position takes the actual one; the drive is acknowledged (NC-151)."""
        if self.error:
            self._emit("axis.reset", error_id=self.error_id)
        self.error_id = NO_ERROR
        self._reset = max(1, round(_RESET_S / self.cycle_s))
        self._invalid = 0
        if self.homing.busy:
            self.homing.abort()
        self.external.cancel()
        self.superposed.abort(CommandState.ABORTED, NO_ERROR)
        self.motion.abort(CommandState.ABORTED, NO_ERROR)
        self._follow_actual()
        self._reset_control()
        self.monitoring.reset()

    def _reset_control(self) -> None:
        encoder = self.encoder
        self.controller.reset()
        self.drive.restart()
        self.velocity_controller.reset(encoder.position, encoder.velocity)

    def set_position(self, position: float, *, relative: bool = False) -> None:
        """Give the present place another position; the following error stays (NC-242)."""
        self.shift(position if relative else position - self.encoder.position)

    def shift(self, offset: float) -> None:
        """Move the coordinate system; neither the axis nor what is coupled to it moves."""
        self._emit("axis.position_set", offset=offset)
        self.encoder.shift(offset)
        self.motion.shift(offset)
        self.velocity_controller.observer.position += offset
        self.coupling.shift(offset)
        for slave in self.coupling.slaves:
            slave.coupling.master_shifted(offset)

    # -- interpolation

    @property
    def place(self) -> float:
        """Set position, position unit."""
        return self.motion.s

    @property
    def path_limits(self) -> AxisLimits:
        """What the axis may do in an interpolation group (NC-174, NC-175)."""
        cell = self.parameters.cell
        return AxisLimits(
            rapid=cell("axis.rapid_traverse_velocity").value,
            reference=cell("axis.reference_velocity").value,
            maximum=self._maximum_velocity.value,
            acceleration=self._maximum_acceleration.value,
            deceleration=self._maximum_deceleration.value,
            jump_factor=cell("axis.velo_jump_factor").value,
            tolerance_ball=cell("axis.tolerance_ball_aux").value,
        )

    def enter_group(self, group: AxisGroup) -> int:
        """Follow the path of a group from now on; returns an error code, 0 for none."""
        if self.error:
            return self.error_id
        if not self._closed:
            return NO_CONTROLLER_ENABLE
        busy = self.motion.active is not None or self.external.enabled or self.coupling.master is not None
        if busy or self.two_speed or self.encoder_only or self._group is not None:
            return BLOCK_NOT_PERMITTED
        self._group = group
        self._path_before = self.motion.s
        self.motion.has_target = False
        return NO_ERROR

    def leave_group(self, *, stopped: bool) -> None:
        """Be a PTP axis again; `stopped`: the group stands at the end of its path, or of a stop."""
        self._group = None
        self._end_group_stops(CommandState.DONE if stopped else CommandState.ABORTED, NO_ERROR)
        self.motion.place(self.motion.s)

    def _end_group_stops(self, state: CommandState, error_id: int) -> None:
        for command in self._group_stops:
            command.state, command.error_id = state, error_id
        self._group_stops.clear()

    def follow_path(self, s: float, v: float, a: float) -> None:
        """Take over the set values of this cycle from the group."""
        self.motion.generator.set_state(s, v, a)

    # -- coupling and external setpoints

    def couple(self, master: NcAxis, ratio: float) -> int:
        """Follow `master` with `ratio`; returns an error code, 0 for none (NC-059, NC-607)."""
        if self.encoder_only or self.two_speed or master.two_speed:
            return BLOCK_NOT_PERMITTED
        if self.error or master.error:
            return self.error_id or master.error_id
        leader: CoupledAxis | None = master
        while leader is not None:
            if leader is self:
                return BLOCK_PARAMETER
            leader = leader.coupling.master
        if ratio == 0.0 or self.motion.locked or self.external.enabled:
            return BLOCK_PARAMETER if ratio == 0.0 else BLOCK_NOT_PERMITTED
        self.motion.abort(CommandState.ABORTED, NO_ERROR)
        self.motion.has_target = False
        self.coupling.couple(self, master, ratio)
        return NO_ERROR

    def decouple(self) -> None:
        """Be a master again: the motion goes on with its present velocity (NC-036).

        Where the present acceleration would lead beyond Maximum Velocity, or turn the direction around, the
        jerk is raised; a velocity above the maximum is reduced with the maximum deceleration (NC-095).
        """
        self.coupling.leave(self)
        generator = self.motion.generator
        velocity = abs(generator.v)
        if not velocity or not self._closed:
            return
        direction = 1.0 if generator.v > 0.0 else -1.0
        highest = self._maximum_velocity.value
        deceleration = self._default_deceleration.value
        jerk = self._default_jerk.value
        rise = generator.a * direction
        if velocity > highest:
            deceleration = max(deceleration, self._maximum_deceleration.value)
        room = max(highest - velocity, 0.0) if rise > 0.0 else velocity
        if rise and rise * rise > 2.0 * jerk * room:
            jerk = rise * rise / (2.0 * room) if room > _SLACK * highest else 0.0
        acceleration = max(self._default_acceleration.value, abs(rise))
        self.motion.submit(
            Command(
                ENDLESS,
                velocity=min(velocity, highest),
                acceleration=acceleration,
                deceleration=max(deceleration, abs(rise)),
                jerk=jerk,
                target=direction,
            )
        )

    def enable_external(self, start_type: int, target: float) -> int:
        """Let the PLC generate the setpoints; returns an error code, 0 for none (NC-567 to NC-577)."""
        control = self.plc_to_nc.ControlDWord
        if start_type not in {1, 2}:
            return BLOCK_PARAMETER
        if self.encoder_only or self.two_speed or self.superposed.command is not None:
            return BLOCK_NOT_PERMITTED
        if self.error:
            return self.error_id
        if not self._enabled:
            return NO_CONTROLLER_ENABLE
        if not control & _FEED_PLUS:
            return NO_FEED_PLUS
        if not control & _FEED_MINUS:
            return NO_FEED_MINUS
        if not self._closed:
            return DRIVE_NOT_READY
        if self.coupling.master is not None:
            return BLOCK_NOT_PERMITTED
        refused = self.external.enable(start_type, target)
        if not refused:
            self.monitoring.new_target()
        return refused

    def _spread_error(self) -> None:
        """Bring an error to the axes that are coupled (NC-210, NC-211)."""
        coupling = self.coupling
        if coupling.error_for_master(error=self.error) and coupling.master is not None:
            coupling.master.raise_error(CONSEQUENTIAL)
        if self.error:
            for slave in coupling.slaves:
                slave.raise_error(CONSEQUENTIAL)

    @property
    def closed(self) -> bool:
        """Whether its set values lead a slave: it is controlled, or an encoder axis."""
        return self._closed or (self.encoder_only and self.operational)

    @property
    def located(self) -> bool:
        """Whether its position is known, from valid data of the encoder."""
        return self.encoder.started

    def raise_error(self, error_id: int) -> None:
        """Put the axis into error: it is shut down without a ramp (NC-148)."""
        if self.error:
            return
        self.error_id = error_id
        group = self._group
        if group is not None:
            self._group = None
            self._end_group_stops(CommandState.ERROR, error_id)
            group.fail(self.name)
        self.raw_output = None
        self.superposed.abort(CommandState.ERROR, error_id)
        self.motion.abort(CommandState.ERROR, error_id)
        if self.discrete is not None:
            self.discrete.abort()
        self.external.cancel()
        self.motion.place(self.motion.s)
        self.motion.has_target = False
        self.monitoring.no_target()
        if self.homing.busy:
            self.homing.abort(error_id)
        self._emit("axis.error", error_id=error_id, text=error_text(error_id))

    def _emit(self, kind: str, **data: str | float | bool) -> None:
        if self.history is not None:
            self.history.emit(self.name, kind, **data)

    # -- a cycle ---------------------------------------------------------------------------------------------

    def cycle(self) -> None:
        """Run one cycle of the axis: inputs, commands, setpoint, control, monitoring, outputs.

        The task has let the device read its inputs before.
        """
        self._cycles += 1
        if self._taken != self.parameters.changes:
            self._take_parameters()
        device = self.device
        if device.encoder_valid:
            self._take_actual_values(device)
        healthy = device.valid and device.encoder_valid and device.operating
        if not healthy or device.fault or device.encoder_fault or self._unsettled:
            self._supervise_device(device)
        if self.probe.active:
            self.probe.step()
        if self.encoder_only:
            self._cycle_encoder()
            return
        inputs = self.plc_to_nc
        control = inputs.ControlDWord
        enable = control & _ENABLE != 0
        motion = self.motion
        if self._enabled and not enable:
            moves = motion.active is not None or self._group is not None
            if (moves or self.superposed.command is not None) and not self.error:
                self.raise_error(NO_CONTROLLER_ENABLE)
        self._enabled = enable
        closed = enable and device.operating and self.error_id == NO_ERROR
        if closed and not self._closed:
            # The loop closes where the axis is (NC-685).
            self._follow_actual()
            self._reset_control()
            self.monitoring.reset()
        self._closed = closed
        self.operational = closed
        if closed:
            written = inputs.Override
            override = 1.0 if written >= FULL_OVERRIDE else written / FULL_OVERRIDE
            if override != motion.override:
                motion.set_override(override)
                self.superposed.set_override()
            fast_stop = self.fast_stop
            if self._watches_fast_stop:
                self._watch_fast_stop(fast_stop, device)
            else:
                fast_stop.last = device.fast_stop
            if control & _FEEDS != _FEEDS:
                self._watch_feed()
            if self.discrete is not None:
                self._cycle_discrete(self.discrete, override)
            else:
                self._generate()
                if self.error_id:
                    self.drive.off()
                elif self.raw_output is not None:
                    self._output_raw(self.raw_output)
                else:
                    self._control()
        else:
            self.external.cancel()
            self.superposed.abort(CommandState.ABORTED, NO_ERROR)
            self.raw_output = None
            if self.discrete is not None:
                self.discrete.abort()
            if self.error_id == NO_ERROR:
                self._follow_actual()
                if motion.active is not None:  # a stop, which is accepted at any time (NC-035)
                    motion.finish(motion.active, arrived=False, in_target=False)
            self.following_error = motion.s - self.encoder.position
            self.drive.off()
        self._send(enable=enable)
        if self.error_id or self.coupling.master is not None:
            self._spread_error()
        self._publish()

    def _generate(self) -> None:
        """Form the setpoint of this cycle."""
        motion = self.motion
        if self.homing.busy:
            self.homing.step()
        before = 0.0 if self._simulated is None else motion.s
        if self._group is not None:
            before = self._path_before
            self._path_before = motion.s
        elif self.coupling.master is not None:
            late = self.coupling.step(self.encoder.velocity)
            if late:
                self.raise_error(late)
                return
        else:
            motion.step()
            if self.external.enabled:
                self.external.step()
                if self.external.jumps(self._maximum_velocity.value * self.cycle_s):
                    self._emit("axis.setpoint_step", step=self.external.step_size)
        if self.superposed.command is not None:
            self.superposed.step()
        if self._simulated is not None:
            self._simulated.follow(motion.s - before)

    def _cycle_encoder(self) -> None:
        """Let the set values of an encoder axis be its actual ones (NC-060)."""
        encoder = self.encoder
        self.operational = self.error_id == NO_ERROR and self.device.encoder_valid
        self.motion.generator.set_state(encoder.position, encoder.velocity, encoder.acceleration)
        self.following_error = 0.0
        self._spread_error()
        self._publish()

    def _cycle_discrete(self, discrete: Discrete, override: float) -> None:
        """Run the two-speed sequence; the set values are the actual ones."""
        motion, encoder, monitoring = self.motion, self.encoder, self.monitoring
        position = encoder.position
        discrete.follow(position, encoder.velocity)
        if self.homing.busy:
            self.homing.step()
        discrete.step(position, override)
        self.following_error = 0.0
        active = motion.active
        found = NO_ERROR
        if motion.has_target:
            found = monitoring.watch_target(
                position - motion.target, arrived=discrete.stands, alarm=active is None
            )
        else:
            monitoring.no_target()
        found = found or monitoring.watch_motion(
            position, moving=discrete.direction != 0, held=discrete.direction == 0
        )
        if found:
            self.raise_error(found)

    def _output_raw(self, share: float) -> None:
        """Output a fixed share of full scale; the set position follows the axis (NC-241)."""
        self._follow_actual()
        self._outputs.velocity = self.drive.raw(share)

    def _take_parameters(self) -> None:
        """Take over what has changed of the parameters."""
        self._taken = self.parameters.changes
        self._op_mode = 0 if self._simulated is None else int(OpMode.SIMULATION_AXIS)
        for cell, bit in self._op_mode_cells:
            if cell.value:
                self._op_mode |= bit
        self.nc_to_plc.modulo_factor = self._modulo.value
        self._corrects = self._correction_on.value != 0.0
        if not self._corrects:
            self._correction_filter.value = 0.0
        self._scales_in = self._scales_in or self._torque_in.value != 0.0
        self._scales_out = self._torque_out.value != 0.0 or self._acceleration_out.value != 0.0
        self._watches_limits = self._low_on.value != 0.0 or self._high_on.value != 0.0
        self._watches_motion = self._motion_watch.value != 0.0
        self._watches_fast_stop = self.fast_stop.watches

    def _take_actual_values(self, device: Device) -> None:
        encoder = self.encoder
        correction = 0.0
        if self._corrects:
            correction = self._correction_filter.step(self.plc_to_nc.PositionCorrection)
        if device.restarts != self._restarts:
            self._restarts = device.restarts
            if self._seen_valid:
                position = encoder.uncorrected
                encoder.begin(device.raw, None)
                encoder.shift(position - encoder.uncorrected)
        error = NO_ERROR
        if not encoder.started:
            error = encoder.begin(device.raw, self.retained)
        error = encoder.update(device.raw, correction, device.input_age) or error
        if error:
            self.raise_error(error)
        if self._scales_in:
            self.drive.take_torque(device.torque)

    def _supervise_device(self, device: Device) -> None:
        if self.missing_resources:
            self.raise_error(ENCODER_FAULT if self.encoder_only else DRIVE_NOT_READY)
        if device.valid and device.encoder_valid:
            self._invalid = 0
            self._seen_valid = True
            self.drive_error = device.fault
            if device.encoder_fault and not self._reset:
                self.raise_error(ENCODER_FAULT)
            elif device.fault and not (self._tolerance.value and device.operating):
                if self._enabled and not self._reset:
                    self.raise_error(DRIVE_NOT_READY)
            elif self._closed and not device.operating:
                self.raise_error(DRIVE_NOT_READY)
        elif self._seen_valid:
            self._invalid += 1
            if self._invalid > self.invalid_cycles:
                if device.life_lost:
                    self.raise_error(DRIVE_LIFE_COUNTER)
                else:
                    encoder = self.encoder_only or device.valid
                    self.raise_error(ENCODER_DATA_INVALID if encoder else DRIVE_DATA_INVALID)
        self._unsettled = (
            self.missing_resources or not self._seen_valid or self._invalid != 0 or self.drive_error
        )

    def _follow_actual(self) -> None:
        self.motion.place(self.encoder.position)
        self.following_error = 0.0

    def _watch_fast_stop(self, fast_stop: FastStop, device: Device) -> None:
        """Stop a motion for the fast axis stop."""
        motion = self.motion
        if fast_stop.step(device.fast_stop) and (not motion.stopped or self._is_led):
            self._emit("axis.fast_stop")
            if self._let_go():
                motion.stop(fast_stop.deceleration, fast_stop.jerk)

    def _watch_feed(self) -> None:
        """Stop a motion whose direction has lost its feed enable (NC-028, NC-029)."""
        motion = self.motion
        velocity = motion.generator.v + motion.offset_v
        active = motion.active
        if self.discrete is not None and active is not None:
            velocity = float(self.discrete.direction)
        missing = self._feed_missing(velocity)
        if not missing:
            return
        if self.coupling.master is not None:
            self.raise_error(missing)
        elif self._is_led or (active is not None and active.kind != STOP):
            self._emit("axis.feed_missing", error_id=missing, text=error_text(missing))
            if self._let_go():
                deceleration, jerk = self.stop_dynamics(0.0, 0.0)
                if active is not None:
                    deceleration, jerk = active.deceleration, active.jerk
                motion.stop(deceleration, jerk)

    @property
    def _is_led(self) -> bool:
        """Whether something else than a command moves the axis: master, path, external setpoints, superposed
        motion.
        """
        return (
            self.coupling.master is not None
            or (self._group is not None and not self._group.stopping)
            or self.external.enabled
            or self.superposed.command is not None
        )

    def _let_go(self) -> bool:
        """End whatever else than a command moves the axis; returns whether it has to brake by itself."""
        if self._group is not None:
            self._group.stop()
            return False
        if self.coupling.master is not None:
            self.decouple()
        self.external.cancel(moving=True)
        self.superposed.abort(CommandState.ABORTED, NO_ERROR)
        return True

    def _control(self) -> None:
        motion, encoder, monitoring, drive = self.motion, self.encoder, self.monitoring, self.drive
        generator = motion.generator
        s, v, a = generator.s + motion.offset, generator.v + motion.offset_v, generator.a + motion.offset_a
        position = encoder.position
        error = s - position
        active = motion.active
        led = self.coupling.master is not None
        interface = self._interface
        outputs = self._outputs
        if interface == POSITION_INTERFACE:
            device = self.device
            target = drive.position(s - encoder.correction, v, a, device.output_lead)
            outputs.position = encoder.raw_of(target)
            outputs.velocity = -v if self._inverted.value else v
            outputs.gain = self._kv.value
            drive.output = v / drive.full
            if self._extern.value:
                error = encoder.increments_to_units(device.lag)
        else:
            controller = self.controller
            control = controller.step(v, a, error, has_job=active is not None)
            if led:
                control += self.coupling.correction(error)
            if interface == TORQUE_INTERFACE:
                velocity = controller.feedforward + drive.limited(control)
                drive.torque_step(
                    self.velocity_controller.step(velocity, encoder.derivative, position, drive.actual_torque)
                )
                outputs.torque = drive.torque
            else:
                outputs.velocity = drive.step(controller.feedforward, control)
                if self._scales_out:
                    drive.give_acceleration(a)
                    drive.give_torque(self.plc_to_nc.ExtTorque)
                    outputs.torque, outputs.acceleration = drive.torque, drive.acceleration
        self.following_error = error
        found = monitoring.watch_lag(error)
        arrived = False
        if motion.has_target:
            arrived = generator.done and motion.arrived
            found = found or monitoring.watch_target(
                position - motion.target,
                arrived=arrived,
                alarm=active is not None and active.kind == POSITION,
            )
        elif active is None and not motion.stopped and not led:
            monitoring.watch_target(error, arrived=True, alarm=False)
        else:
            monitoring.no_target()
        if self._watches_motion:
            found = found or monitoring.watch_motion(
                position,
                moving=active is not None and not (active.ended or arrived),
                held=self.plc_to_nc.Override == 0 and motion.standing,
            )
        if self._watches_limits and active is not None:
            found = found or self._limit_passed()
        if found:
            self.raise_error(found)
            drive.off()
        elif active is not None:
            in_target = arrived and (monitoring.reached or not monitoring.target_on)
            motion.finish(active, arrived=arrived, in_target=in_target)

    def _limit_passed(self) -> int:
        """Compare the set position with the software limits, in the direction of motion (NC-744)."""
        motion = self.motion
        if motion.limits_off or motion.active is None:
            return NO_ERROR
        position, velocity = motion.generator.s, motion.generator.v
        if velocity < 0.0 and self._low_on.value and position < self._low.value - 1e-6:
            return LIMIT_MIN
        if velocity > 0.0 and self._high_on.value and position > self._high.value + 1e-6:
            return LIMIT_MAX
        return NO_ERROR

    def _send(self, *, enable: bool) -> None:
        outputs = self._outputs
        if self._reset:
            device = self.device
            waits = self.drive_error or (device.mute and enable and not device.operating)
            self._reset = self._reset - 1 if waits else 0
        if not self._closed or self.error_id:
            outputs.velocity = outputs.torque = outputs.acceleration = 0.0
            if self._interface == POSITION_INTERFACE:
                outputs.position = self.device.raw
        if self.discrete is not None:
            outputs.image = self.discrete.image
        outputs.enable = enable
        # Every second cycle: a drive acknowledges with an edge.
        outputs.reset = self._reset & 2 != 0
        self.device.write(outputs)

    def repeat_outputs(self) -> None:
        """Send the outputs again in a SAF cycle in which the axis is not executed (NC-075)."""
        if not self.encoder_only:
            self.device.write(self._outputs)

    @property
    def universal(self) -> bool:
        """Whether the drive is of the type Universal (NC-416)."""
        return self.parameters.read("drv.type") == "UNIVERSAL"

    @property
    def maximum_velocity(self) -> float:
        """Maximum Velocity, position unit/s."""
        return self._maximum_velocity.value

    @property
    def outputs(self) -> DriveOutputs:
        """What the axis has given to its device last."""
        return self._outputs

    def _publish(self) -> None:
        """Fill the image for the PLC: states, and `StateDWord` bit by bit (NC-440 to NC-471)."""
        image, motion, encoder, monitoring = self.nc_to_plc, self.motion, self.encoder, self.monitoring
        generator, active, discrete = motion.generator, motion.active, self.discrete
        coupling, homing, probe = self.coupling, self.homing, self.probe
        s, v = generator.s + motion.offset, generator.v + motion.offset_v
        standing = generator.done and -STANDS <= v <= STANDS
        state = motion.axis_state(standing=standing) if discrete is None else discrete.sequence.state
        word = 0
        if coupling.master is not None:
            word = 1 << 5
            if coupling.delaying:
                word |= 1 << 6
        elif self._group is None:
            word = 1 << 25
        if self._closed:
            word |= 1 << 20
        if self.operational:
            word |= 1
        if encoder.homed:
            word |= 1 << 1
        if monitoring.in_area:
            word |= 1 << 3
        if monitoring.in_target:
            word |= 1 << 4
        if motion.stopped:
            word |= 1 << 7
        superposed = self.superposed.command is not None
        if superposed:
            word |= 1 << 13
        if active is not None:
            image.CmdNo = active.number & 0xFFFF
            image.CmdState = int(active.state)
            if active.state < CommandState.DONE:
                word |= 1 << 8
                if active.kind == ENDLESS:
                    word |= 1 << 19
            elif standing and discrete is None and not superposed:
                word |= 1 << 2
            if active.locks:
                word |= 1 << 29
        elif standing and discrete is None and not superposed:
            word |= 1 << 2
        direction = v
        if discrete is not None:
            direction = float(discrete.direction)
            if discrete.stands:
                word |= 1 << 2
        if direction > 0.0:
            word |= 1 << 9
        elif direction < 0.0:
            word |= 1 << 10
        if homing.busy:
            word |= 1 << 11
        if state == 3:
            word |= 1 << 12
        if self.external.enabled:
            word |= 1 << 14
        request = self.plc_to_nc.AxisModeRequest
        if request != image.AxisModeConfirmation:
            word |= 1 << 15
            image.AxisModeConfirmation = request
        if probe.valid:
            word |= 1 << 16
        if motion.new_target:
            word |= 1 << 17
            motion.new_target = False
        if motion.missed:
            word |= 1 << 18
        if motion.queue:
            word |= 1 << 24
        uncorrected = encoder.uncorrected
        if self._watches_limits:
            if self._low_on.value and uncorrected <= self._low.value:
                word |= 1 << 26
            if self._high_on.value and uncorrected >= self._high.value:
                word |= 1 << 27
        if self.drive_error:
            word |= 1 << 28
        if self._invalid:
            word |= 1 << 30
        if self.error_id:
            word |= 1 << 31
        image.StateDWord = word
        word = self._op_mode | (self._cycles & 0xFF) << 24
        if homing.application_request:
            word |= OpMode.NC_APPLICATION_REQUEST
        image.OpModeDWord = word
        image.ErrorCode = self.error_id
        image.AxisState = state if coupling.master is None else 13
        image.HomingState = homing.state
        image.SafEntries = len(motion.queue)
        image.SvbEntries = len(self.prepared)
        image.ActPos = encoder.position
        image.ActVelo = encoder.velocity
        image.ActAcc = encoder.acceleration
        image.PosDiff = self.following_error
        image.SetPos = s
        image.SetVelo = v
        image.SetAcc = generator.a + motion.offset_a
        image.CoupleState = coupling.state if coupling.master is not None or coupling.slaves else 0
        image.TargetPos = motion.target
        image.ActPosWithoutPosCorrection = uncorrected
        image.TouchProbeCounter = probe.count
        if self._scales_in:
            image.ActTorque = self.drive.actual_torque
            image.ActTorqueDerivative = self.drive.actual_torque_derivative
        if self._interface == TORQUE_INTERFACE:
            image.SetTorque = self.drive.output * FULL_TORQUE
        elif self._torque_out.value:
            image.SetTorque = self.plc_to_nc.ExtTorque

    def _output_data(self) -> float:
        """Return what a drive gets that takes no velocity: increments, `nDataOut4`, control bytes."""
        outputs, interface = self._outputs, self._interface
        if self.discrete is not None:
            return self.discrete.image[8] | self.discrete.image[9] << 8
        if interface == POSITION_INTERFACE:
            return outputs.position
        return outputs.torque if interface == TORQUE_INTERFACE else outputs.velocity

    def trace_row(self) -> tuple[float, ...]:
        """Return the values of `TRACE_COLUMNS` for the present cycle."""
        encoder, image, outputs = self.encoder, self.nc_to_plc, self._outputs
        data: float = outputs.velocity
        if self._interface != VELOCITY_INTERFACE:
            data = self._output_data()
        override = self.plc_to_nc.Override
        return (
            image.SetPos,
            image.SetVelo,
            image.SetAcc,
            encoder.position,
            encoder.velocity,
            self.following_error,
            self.drive.output,
            data,
            outputs.enable | outputs.reset << 1,
            image.StateDWord,
            image.OpModeDWord,
            self.error_id,
            1.0 if override >= FULL_OVERRIDE else override / FULL_OVERRIDE,
        )
