"""One axis between its setpoints and its drive, in the order of a cycle.

```
 job, leading value ->  basic  -> superimposed -> total -> fine -> controller.filter -> controller -> port
 or user program                                    |                                      ^
                                          limits look ahead                             feedback
```

| place | part | step |
|---|---|---|
| source | `basic`: a profile advances it, or something else sets its state | `advance`, `set_state` |
| superimposed motion | `superimposed`, a `Setpoint` over `basic` | `advance` |
| end of the interpolator | `total`, the last `Setpoint` of the chain; limits look ahead with `total.peek` | |
| fine interpolation | `fine`, where the interpolator is slower than the servo | `begin`, `advance` |
| filter | `controller.filter` | by the controller |
| position control | `controller` | `step` |
| drive | `port` | `write` |

What comes next has its place here. A synchronous function sets the state of `basic` in every cycle from a
`LeadingValue`, as a user program does with `MC_MotionInPosition`. A position correction from outside is a
`Setpoint` over the present `total`, and becomes `total`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from motion.kernel.feedback import NO_FEEDBACK, VALID, EncoderSource, Feedback
from motion.kernel.fine_interpolation import FineInterpolation
from motion.kernel.mechanics import Mechanics
from motion.kernel.modulo import NO_MODULO, Modulo
from motion.kernel.simulation import SimulatedPort, VirtualControl
from motion.setpoint import Setpoint, SetpointGenerator

if TYPE_CHECKING:
    from collections.abc import Sequence

    from motion.drives.encoder import EncoderPort
    from motion.drives.port import DrivePort
    from motion.kernel.backlash import Backlash
    from motion.kernel.cell import Cell
    from motion.kernel.position_control import PositionControl
    from motion.kernel.superposition import Superposition

_AT_REST_RPM: Final = 1.0
"""Motor speed below which an axis without positions counts as standing."""
_STANDS: Final = 1e-6
"""Position units per second that are none, whatever the standstill threshold is."""
_ROUNDING: Final = 1.0 + 1e-9
"""A speed that is above the limit by rounding only is not limited (CTL-107)."""


class ServoAxis:
    """One axis between its setpoints and its drive: the stages above, in the order of a cycle.

    Args:
        port: Coupling to the drive.
        encoder_ports: Where the values of the encoders come from, in their order; empty without positions.
        cycle_s: Servo cycle, s.
        ratio: Servo cycles in an interpolator cycle, 1 or more.
        rest: Velocity up to which the axis counts as standing, position unit per
            second; None without positions.

    """

    def __init__(
        self,
        port: DrivePort,
        encoder_ports: Sequence[EncoderPort | DrivePort],
        *,
        cycle_s: float,
        ratio: int,
        rest: Cell[float] | None,
    ) -> None:
        self.cycle_s = cycle_s
        self.interpolator_s = cycle_s * ratio
        self.has_position = rest is not None
        # -- connection
        self.drive_port = port
        """Connection to the drive, also while it is not used."""
        self.port: DrivePort = port
        """Connection in use: that to the drive, or a simulated one."""
        self.encoder_ports = tuple(encoder_ports)
        self.other_ports: tuple[EncoderPort | DrivePort, ...] = tuple(
            one for one in encoder_ports if one is not port
        )
        """Connections of encoders that are not read with the drive."""
        self.simulated = False
        """No device is used."""
        self.virtual = False
        """It repeats its setpoints: nothing is simulated either."""
        # -- ratios
        self.mechanics = Mechanics(1.0)
        self.modulo: Modulo = NO_MODULO
        self.delay_s = 2.0 * cycle_s
        """Time from a setpoint to the actual value that it makes, without the lag of the drive, s."""
        self.max_speed = 0.0
        """Highest output speed, rpm; of a linear motor m/min."""
        # -- actual values
        self.sensors: tuple[Feedback, ...] = ()
        """All encoders, in the order of the object."""
        self.backlashes: tuple[Backlash, ...] = ()
        """Compensation of the encoders that sit on the motor."""
        self.operative_sensor = 1
        """Number of the encoder in position control, from 1 on."""
        self.feedback: Feedback = NO_FEEDBACK
        """That encoder."""
        self.encoder_apart: EncoderSource | None = None
        """Its connection, where it is not that to the drive."""
        self.homed = False
        """Positions are those of the machine."""
        self.communication_ok = False
        self.in_operation = False
        """The drive executes setpoints."""
        self.actual_velocity = 0.0
        """Position unit per second, of an axis without positions rpm of the load."""
        self.at_rest = True
        self._rest = rest
        # -- setpoints
        self.basic = SetpointGenerator()
        """Setpoint of the basic motion."""
        self.superimposed: Superposition | None = None
        self.total: Setpoint = self.basic
        """Setpoint of the axis: that of the basic motion, or its sum with the superimposed one."""
        self.fine = FineInterpolation(ratio, cycle_s) if ratio > 1 else None
        """Points on the way between two setpoints of the interpolator; None: it runs in every servo cycle."""
        self.setpoint_due = False
        """The setpoint of this cycle still has to be formed."""
        self.controlled = False
        """The axis forms the setpoints, and its position controller may be closed."""
        self.position_controlled = False
        # -- control and outputs
        self.controller: PositionControl = VirtualControl(
            SimulatedPort(cycle_s, 1.0), cycle_s=cycle_s, acceleration=self.given_acceleration
        )
        self.in_drive = False
        """The drive closes the position loop (dynamic servo control)."""
        self.speed_output_rpm = 0.0

    @property
    def sensor_valid(self) -> bool:
        """Whether the actual position is valid; True without an encoder."""
        return not self.has_position or self.feedback.state == VALID

    @property
    def rest_velocity(self) -> float:
        """Velocity up to which the axis counts as standing, position unit per second."""
        return _STANDS if self._rest is None else max(self._rest.value, _STANDS)

    @property
    def setpoint_delay_s(self) -> float:
        """Time by which a setpoint that is taken from the actual values has to be ahead of them, s.

        It is the transport delay and, with velocity precontrol, the time constant of the drive. Between
        reading the actual values and the setpoint of the same cycle it is one cycle less, because the
        setpoint still advances.
        """
        delay = self.delay_s - self.cycle_s if self.setpoint_due else self.delay_s
        if not self.has_position:
            return delay
        controller = self.controller
        if controller.filter is not None:
            delay += controller.filter.delay_s
        return delay + controller.precontrolled_lag_s

    def setpoint(self) -> tuple[float, float, float]:
        """Return position, velocity and acceleration setpoint of the axis."""
        total = self.total
        return total.s, total.v, total.a

    def leading_setpoint(self) -> tuple[float, float, float]:
        """Return what followers of the setpoint get: it follows the actual value where the axis does not
        form it (SYN-294), and has no position without position control (SYN-026).
        """
        total = self.total
        if self.controlled:
            return (total.s if self.position_controlled else 0.0), total.v, total.a
        return total.s, self.actual_velocity, 0.0

    def power_down(self) -> None:
        """Show what an axis shows whose controller has no supply."""
        self.communication_ok = self.in_operation = False
        self.at_rest = True
        self.actual_velocity = self.speed_output_rpm = 0.0

    # -- a cycle

    def take_actual_values(self) -> None:
        """Form the actual values from what the ports have read."""
        port = self.port
        zsw1 = port.zsw1
        self.communication_ok = port.link_ok and zsw1 & 0x0208 == 0x0200
        self.in_operation = zsw1 & 0x0204 == 0x0204 and not zsw1 & 0x0008
        rest = self._rest
        if rest is None:
            # Without a link the last value says nothing: it counts as 0, as the velocity of an encoder does.
            rpm = port.actual_speed_rpm if port.link_ok else 0.0
            self.actual_velocity = rpm / self.mechanics.rpm_per_unit
            self.at_rest = -_AT_REST_RPM <= rpm <= _AT_REST_RPM
            return
        for sensor in self.sensors:
            sensor.update()
        for backlash in self.backlashes:
            if backlash.enabled.value or backlash.used:
                closed = self.controlled and self.position_controlled and backlash.feedback is self.feedback
                if backlash.step(self.total.v if closed else None):
                    self.homed = False
        feedback = self.feedback
        self.actual_velocity = velocity = feedback.velocity
        threshold = rest.value
        self.at_rest = -threshold <= velocity <= threshold
        if feedback.lost_reference:
            feedback.lost_reference = False
            self.homed = False

    def close_loop(self, s: float, v: float) -> float:
        """Control the position to the setpoint `s`, `v`; returns the velocity to output."""
        controller = self.controller
        output = controller.step(s, v, self.feedback.position)
        if self.in_drive:
            # The drive closes the loop around what it has measured since (CFG-194).
            output = controller.precontrol
            self.port.control_position(
                controller.control_difference / self.mechanics.increment, controller.gain
            )
        return output

    def limit_speed(self, velocity: float) -> bool:
        """Output `velocity`; returns whether the highest speed limits it."""
        speed = velocity * self.mechanics.rpm_per_unit
        limit = self.max_speed
        limited = False
        if not -limit <= speed <= limit:
            limited = not -limit * _ROUNDING <= speed <= limit * _ROUNDING
            speed = limit if speed > 0.0 else -limit
        self.speed_output_rpm = speed
        return limited

    def given_acceleration(self) -> float:
        """Return the acceleration of the setpoints as the position controller gets them (CTL-054)."""
        dynamic_filter = self.controller.filter
        if dynamic_filter is None or not dynamic_filter.smooths:
            return self.total.a
        return dynamic_filter.acceleration

    def take_sensor(self, number: int, quantum: float) -> None:
        """Control the position with encoder `number` from now on; `quantum`: see `PositionControl`."""
        self.operative_sensor = number
        self.feedback = self.sensors[number - 1]
        source = self.feedback.source
        self.encoder_apart = None if source is self.port else source
        self.controller.quantum = quantum

    def take_actual_position(self, velocity: float, acceleration: float = 0.0) -> None:
        """Put the setpoint as far ahead of the actual position as `velocity` carries it during the delay."""
        position = self.feedback.position
        if self.virtual:
            position = self.controller.tracked(position)
        else:
            position += velocity * self.setpoint_delay_s
        # The interpolator is ahead by the rest of its cycle.
        ahead = 0.0 if self.fine is None else self.fine.restart(position, velocity)
        self.basic.set_state(position + ahead, velocity, acceleration)
        if self.has_position:
            self.controller.reset(position, velocity)
