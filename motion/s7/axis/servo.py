"""What `MC_Servo` does with an axis: read, close the loop, write; once per servo cycle."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Final

from motion.drives.port import STW1
from motion.s7.axis.assembly import AxisAssembly

if TYPE_CHECKING:
    from motion.drives.encoder import EncoderPort
    from motion.drives.port import DrivePort
    from motion.kernel.feedback import Feedback
    from motion.kernel.fine_interpolation import FineInterpolation
    from motion.kernel.superposition import Superposition
    from motion.s7.axis.enabling import EnableControl
    from motion.s7.axis.motion import MotionControl
    from motion.s7.axis.state import StateFacts
    from motion.setpoint import SetpointGenerator

_AT_REST_RPM: Final = 1.0
"""Motor speed below which a speed axis counts as standing."""
_ROUNDING: Final = 1.0 + 1e-9
"""A speed that is above the limit by rounding only is not limited (CTL-107)."""
ALARM_SPEED_LIMITED: Final = 504


class ServoCycle(AxisAssembly):
    """Base of `TechnologyAxis`, which fills in what is declared here; see there."""

    facts: StateFacts
    enabling: EnableControl
    motion: MotionControl
    fine: FineInterpolation | None
    feedback: Feedback
    communication_ok: bool
    in_operation: bool
    at_rest: bool
    actual_velocity: float
    speed_output_rpm: float
    stw1_sent: int
    station_inputs: Callable[[DrivePort], bool] | None
    _other_ports: list[EncoderPort | DrivePort]

    def read_inputs(self) -> None:
        """Take over what has arrived, and what the program has assigned."""
        if self.variables.latch():
            self.motion.limits_assigned = True
            if self.has_position:
                self._leading = self.leading_value.in_use()
        port = self.port
        port.read()
        if self.station_inputs is not None:
            self.alarms.watch_inputs(self.station_inputs(port))
        for other in self._other_ports:
            other.read()
        if self._adapting is not None:
            self._adapting.step()
            port = self.port
        zsw1 = port.zsw1
        self.communication_ok = port.link_ok and zsw1 & 0x0208 == 0x0200
        self.in_operation = zsw1 & 0x0204 == 0x0204 and not zsw1 & 0x0008
        if self.has_position:
            for sensor in self.sensors:
                sensor.update()
            for backlash in self.backlashes:
                if backlash.enabled.value or backlash.used:
                    backlash.step()
            feedback = self.feedback
            self.actual_velocity = velocity = feedback.velocity
            rest = self._rest_threshold.value
            self.at_rest = -rest <= velocity <= rest
            if feedback.lost_reference:
                feedback.lost_reference = False
                self.homed = False
        else:
            # Without a link the last value says nothing: it counts as 0, as the velocity of an encoder does.
            rpm = port.actual_speed_rpm if port.link_ok else 0.0
            self.actual_velocity = rpm / self.mechanics.rpm_per_unit
            self.at_rest = -_AT_REST_RPM <= rpm <= _AT_REST_RPM

    def close_loop(self, setpoint: SetpointGenerator | Superposition | FineInterpolation) -> float:
        """Control the position to `setpoint`; returns the velocity to be put out, axis unit per second."""
        controller = self.controller
        position = self.feedback.position
        output = controller.step(setpoint.s, setpoint.v, position)
        if self._dsc:
            # The drive closes the loop around what it has measured since (CFG-194).
            output = controller.precontrol
            self.port.control_position(
                controller.control_difference / self.mechanics.increment, controller.gain
            )
        return output

    def write_outputs(self, output: float) -> None:
        """Send control word, speed for the velocity `output` and torques."""
        enabling, motion = self.enabling, self.motion
        speed = output * self.mechanics.rpm_per_unit
        limit = self._max_speed
        if not -limit <= speed <= limit:
            if not -limit * _ROUNDING <= speed <= limit * _ROUNDING:
                self.alarms.warn(ALARM_SPEED_LIMITED)
            speed = limit if speed > 0.0 else -limit
        self.speed_output_rpm = speed
        stw1 = enabling.stw1 | STW1.ACKNOWLEDGE if enabling.acknowledge_drive else enabling.stw1
        words = self.control_words
        if words.busy:
            words.step()
        if words.owned_stw1:
            stw1 = stw1 & ~words.owned_stw1 | words.user_stw1
        self.stw1_sent = stw1
        torque = self.torque
        if torque.sends:
            leads = motion.position_controlled and self.facts.controlled and not enabling.switching_off
            self.port.write(stw1, speed, torque.output_nm(self._given_acceleration() if leads else 0.0))
        else:
            self.port.write(stw1, speed)

    def _given_acceleration(self) -> float:
        """Return the acceleration of the setpoints as the position controller gets them (CTL-054)."""
        dynamic_filter = self.controller.filter
        if dynamic_filter is None or not dynamic_filter.smooths:
            return self.motion.total.a
        return dynamic_filter.acceleration

    def servo(self) -> None:
        """Run one servo cycle without `MC_Interpolator`: it is not due, or late. Its decisions and its
        setpoints stand.
        """
        self.read_inputs()
        output = 0.0
        if self.facts.controlled and not self.enabling.switching_off:
            motion = self.motion
            setpoint = motion.total if self.fine is None else self.fine.advance()
            if not self.has_position:
                output = setpoint.v
            elif motion.position_controlled:
                output = self.close_loop(setpoint)
            else:
                self.controller.follow(self.feedback.position)
                output = setpoint.v
        else:
            if self.enabling.catching:
                output = self.actual_velocity
            if not self.facts.controlled:
                self.motion.gen.set_state(self.feedback.position, 0.0)
            if self.has_position:
                self.controller.follow(self.feedback.position)
        self.write_outputs(output)
