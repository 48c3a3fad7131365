"""Virtual and simulated axes: setpoints become actual values without a drive (CFG sections 7 and 8, VAR-126
to VAR-129).

A virtual axis repeats its setpoints, which the program sees after T_ipo + T_servo (CFG-151). A simulated one
delays them as the control loop and a simplified drive would: T_ipo + T_servo + T_vtc + T_addPtc with velocity
precontrol, T_ipo + 1 / Kv + T_addPtc without it and T_servo more with DSC.
"""

from __future__ import annotations

from collections import deque
from math import exp
from typing import TYPE_CHECKING, Final

from typing_extensions import override

from motion.drives.port import STW1, ZSW1, DrivePort
from motion.kernel.feedback import VALID, Feedback
from motion.kernel.mechanics import INCREMENTAL
from motion.kernel.position_control import LEAST_GAIN, LONGEST_DELAY, PositionControl

if TYPE_CHECKING:
    from collections.abc import Callable

    from motion.kernel.cell import Cell
    from motion.kernel.mechanics import EncoderScale
    from motion.kernel.modulo import Modulo
    from motion.kernel.setpoint_filter import DynamicFilter

POWER_ON_INCREMENTS: Final = 240
"""Increments that an absolute encoder of such an axis shows at power-on (CFG-153)."""

_OPERATE: Final = STW1.ON | STW1.NO_OFF2 | STW1.NO_OFF3 | STW1.ENABLE_OPERATION
_READY: Final = int(ZSW1.READY_TO_SWITCH_ON | ZSW1.NO_OFF2 | ZSW1.NO_OFF3 | ZSW1.CONTROL_REQUESTED)
_OPERATING: Final = int(_READY | ZSW1.READY | ZSW1.OPERATION_ENABLED)


class SimulatedPort(DrivePort):
    """In place of the drive: always there, and in operation as soon as it is commanded (CFG-132, CFG-164)."""

    __slots__ = ("_cycle", "_operating", "_unit_per_rpm", "controlled", "feedbacks")

    def __init__(self, cycle_s: float, rpm_per_unit: float) -> None:
        super().__init__()
        self.simulated = True
        self.link_ok = True
        self.zsw1 = _READY
        self.feedbacks: tuple[SimulatedFeedback, ...] = ()
        """Encoders that move with the axis."""
        self.controlled = False
        """The controller has moved the axis in this cycle."""
        self._cycle = cycle_s
        self._unit_per_rpm = 1.0 / rpm_per_unit
        self._operating = False

    @override
    def read(self) -> None:
        pass  # nothing is read

    @override
    def set_torque_range(self, upper: float, lower: float) -> None:
        pass  # an ideal motor needs no torque, and the drive gets none (STP-159)

    @override
    def limit_torque(self, share: float | None) -> None:
        pass

    @override
    def write(self, stw1: int, speed_rpm: float, torque_nm: float = 0.0) -> None:
        # A speed setpoint without position control moves the axis by what it is worth.
        self._operating = stw1 & _OPERATE == _OPERATE
        self.zsw1 = _OPERATING if self._operating else _READY
        self.actual_speed_rpm = speed_rpm if self._operating else 0.0
        if self.controlled:
            self.controlled = False
        elif speed_rpm and self._operating:
            velocity = speed_rpm * self._unit_per_rpm
            for feedback in self.feedbacks:
                feedback.take(feedback.position + velocity * self._cycle, velocity)


class SimulatedFeedback(Feedback):
    """An encoder that shows what it is given, one application cycle later.

    Args:
        source: Port of the axis.
        scale: Ratios and format of the encoder that is simulated.
        abs_offset: As in `Feedback`.
        before: The same encoder before a restart; None after power-on.

    """

    def __init__(
        self, source: SimulatedPort, scale: EncoderScale, abs_offset: Cell[float], before: Feedback | None
    ) -> None:
        super().__init__(source, scale, abs_offset)
        self.state = VALID
        if scale.kind != INCREMENTAL:
            self._offset = abs_offset.value
            fine = scale.increment * scale.fine
            self.position = abs(fine) * POWER_ON_INCREMENTS + abs_offset.value
            if isinstance(before, SimulatedFeedback):
                self.position = before.position  # a restart is no power-on
        self._next_position = self.position
        self._next_velocity = 0.0

    def take(self, position: float, velocity: float) -> None:
        """Say what the next cycle is to see."""
        self._next_position = position
        self._next_velocity = velocity

    @override
    def update(self) -> None:
        self.last_velocity = self.velocity
        self.position = self._next_position
        self.velocity = self._next_velocity

    @override
    def ahead(self, raw: int) -> float:
        return 0.0  # there are no counts

    @property
    @override
    def travel(self) -> float:
        return 0.0

    @override
    def place(self, modulo: Modulo) -> tuple[int, float]:
        return modulo.cycle(self.position), modulo.wrap(self.position)

    @override
    def shift(self, offset: float) -> None:
        self.position += offset
        if self.scale.kind == INCREMENTAL:
            self._offset = self.position - self.compensation
        else:
            self._offset += offset
        self._next_position += offset


class VirtualControl(PositionControl):
    """Takes the place of the position controller: setpoints become actual values, nothing is controlled
    (CFG-138 to CFG-148). `MC_Servo` takes the setpoint that `MC_Interpolator` has formed one cycle before.

    Args:
        port: Port of the axis.
        cycle_s: Servo cycle, s.
        acceleration: Returns the acceleration of the setpoints, behind the filter.
        dynamic_filter: What the setpoints pass before; None = nothing.

    """

    def __init__(
        self,
        port: SimulatedPort,
        *,
        cycle_s: float,
        acceleration: Callable[[], float],
        dynamic_filter: DynamicFilter | None = None,
    ) -> None:
        super().__init__(dynamic_filter)
        self._port = port
        self._feedbacks = port.feedbacks
        self._cycle = cycle_s
        self._given_acceleration = acceleration
        self.actual_acceleration = 0.0
        """`ActualAcceleration`, as old as the actual position (CFG-142)."""
        self._next_acceleration = self._waiting_acceleration = 0.0
        self._setpoint = self._waiting = self._waiting_velocity = 0.0

    @property
    @override
    def precontrolled_lag_s(self) -> float:
        return self._cycle

    @override
    def reset(self, position: float, velocity: float = 0.0) -> None:
        self._setpoint = position
        if self.filter is not None:
            self.filter.reset(position, velocity)
            position -= velocity * self.filter.delay_s
        self._waiting = position
        self._waiting_velocity = velocity
        self.actual_acceleration = self._next_acceleration = self._waiting_acceleration = 0.0

    @override
    def shift(self, offset: float) -> None:
        if self.filter is not None:
            self.filter.shift(offset)
        self._setpoint += offset
        self._waiting += offset

    @override
    def absorb(self, step: float) -> None:
        pass  # all encoders of such an axis agree

    @override
    def tracked(self, actual: float) -> float:
        """Return the last setpoint: nothing keeps the axis from getting there, and followers of the setpoint
        see no step back (SYN-482).
        """
        return self._setpoint

    @override
    def follow(self, position: float) -> None:
        self._pass_on(position, 0.0, 0.0)

    @override
    def step(self, position: float, velocity: float, actual: float) -> float:
        self._port.controlled = True
        self._pass_on(position, velocity, self._given_acceleration())
        return 0.0

    def _pass_on(self, position: float, velocity: float, acceleration: float) -> None:
        """Make the setpoint of one cycle ago the next actual value."""
        self._setpoint = position
        if self.filter is not None:
            position, velocity = self.filter.step(position, velocity)
        for feedback in self._feedbacks:
            feedback.take(self._waiting, self._waiting_velocity)
        self._waiting = position
        self._waiting_velocity = velocity
        self.actual_acceleration = self._next_acceleration
        self._next_acceleration = self._waiting_acceleration
        self._waiting_acceleration = acceleration


class SimulatedControl(PositionControl):
    """Delays the setpoints as loop and drive would (CFG-166 to CFG-171): dead
    time, then a lag of first order.

    Args:
        port: Port of the axis.
        kv: Gain of the position controller, 1/s.
        kpc: Velocity precontrol, percent.
        time_constant: Time constant of the speed loop, s.
        additional: Further delay of the drive, s.
        in_drive: The drive closes the loop (DSC).
        cycle_s: Servo cycle, s.
        dynamic_filter: What the setpoints pass before; None = nothing.

    """

    def __init__(
        self,
        port: SimulatedPort,
        *,
        kv: Cell[float],
        kpc: Cell[float],
        time_constant: Cell[float],
        additional: Cell[float],
        in_drive: bool,
        cycle_s: float,
        dynamic_filter: DynamicFilter | None = None,
    ) -> None:
        super().__init__(dynamic_filter)
        self._port = port
        self._feedbacks = port.feedbacks
        self._kv = kv
        self._kpc = kpc
        self._time_constant = time_constant
        self._additional = additional
        self._in_drive = in_drive
        self._cycle = cycle_s
        self._lagged = 0.0
        self._past: deque[float] = deque([0.0, 0.0], maxlen=2)

    def _delays(self) -> tuple[float, float]:
        """Return dead time beyond the first cycle in cycles, and the lag in s."""
        dead: float = min(self._additional.value / self._cycle, float(LONGEST_DELAY))
        if self._kpc.value > 0.0:
            return dead + 1.0, self._time_constant.value
        return dead + (1.0 if self._in_drive else 0.0), 1.0 / max(self._kv.value, LEAST_GAIN)

    @property
    @override
    def precontrolled_lag_s(self) -> float:
        dead, lag = self._delays()
        return dead * self._cycle + lag  # all delay of the model

    @override
    def reset(self, position: float, velocity: float = 0.0) -> None:
        if self.filter is not None:
            self.filter.reset(position, velocity)
            position -= velocity * self.filter.delay_s
        dead, lag = self._delays()
        depth = int(dead) + 3
        step = velocity * self._cycle
        self._past = deque((position - step * (depth - 1 - at) for at in range(depth)), maxlen=depth)
        self._lagged = position - velocity * (lag + dead * self._cycle)

    @override
    def shift(self, offset: float) -> None:
        if self.filter is not None:
            self.filter.shift(offset)
        for at in range(len(self._past)):
            self._past[at] += offset
        self._lagged += offset

    @override
    def absorb(self, step: float) -> None:
        pass  # all encoders of such an axis agree

    @override
    def follow(self, position: float) -> None:
        for feedback in self._feedbacks:
            feedback.take(position, 0.0)
        self.reset(position)
        self.following_error = self.control_difference = 0.0

    @override
    def step(self, position: float, velocity: float, actual: float) -> float:
        if self.filter is not None:
            position, velocity = self.filter.step(position, velocity)
        dead, lag = self._delays()
        depth = int(dead) + 3
        past = self._past
        if past.maxlen != depth:
            padding = [past[0]] * max(0, depth - len(past))
            past = self._past = deque([*padding, *past], maxlen=depth)
        past.append(position)
        whole = int(dead)
        rest = dead - whole
        newest = depth - 1 - whole
        delayed = past[newest] + (past[newest - 1] - past[newest]) * rest
        before = past[newest - 1] + (past[newest - 2] - past[newest - 1]) * rest
        step = delayed - before
        last = self._lagged
        if lag > 0.0:
            # The exact answer to a ramp of this cycle, so that constant travel lags by exactly the time
            # constant.
            behind = step * lag / self._cycle
            target = delayed - behind
            self._lagged = target + (last + step - target) * exp(-self._cycle / lag)
        else:
            self._lagged = delayed
        speed = (self._lagged - last) / self._cycle
        self._port.controlled = True
        for feedback in self._feedbacks:
            feedback.take(self._lagged, speed)
        self.balanced_position = position
        precontrolled = self._kpc.value > 0.0
        self.following_error = self.control_difference = 0.0 if precontrolled else delayed - self._lagged
        self.gain = self._kv.value
        self.precontrol = self._kpc.value * 0.01 * velocity
        return self.gain * self.control_difference + self.precontrol
