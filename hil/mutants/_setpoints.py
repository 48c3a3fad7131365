"""Defects of setpoints: profiles, superimposed motion, MotionIn, several encoders, external encoders, control
panel.
"""

from __future__ import annotations

from functools import partial
from typing import Final

from hil.mutants._mutant import Mutant, defect

_PLANNING: Final = "motion.s7.axis.motion:MotionControl"
_GENERATOR: Final = "motion.setpoint.generator:SetpointGenerator"
_SUPERPOSITION: Final = "motion.kernel.superposition:Superposition"
_FEEDBACK: Final = "motion.kernel.feedback:EncoderFeedback"
_ENCODER: Final = "motion.s7.axis.external_encoder:ExternalEncoder"
_PANEL: Final = "motion.s7.commissioning.panel:ControlPanel"

_defect = partial(defect, area="axis")

MUTANTS: Final[tuple[Mutant, ...]] = (
    # -- profiles --
    _defect(
        "positioning-without-jerk-limit",
        "A positioning is planned without jerk limit",
        f"{_GENERATOR}.start_position",
        "jerk=jerk,",
        "jerk=0.0,",
        ids=("STP-012", "MC-094"),
        likely=("limits/software/positive/positioning/current",),
    ),
    _defect(
        "acceleration-limit-for-braking",
        "A velocity is reduced with the acceleration instead of the deceleration",
        "motion.setpoint.velocity:velocity_phases",
        "_leg(phases, v, target, direction, way, start, 0.0, deceleration, jerk)",
        "_leg(phases, v, target, direction, way, start, 0.0, acceleration, jerk)",
        ids=("MC-296",),
        likely=("axis-motion/slows-down",),
    ),
    _defect(
        "superseding-drops-acceleration",
        "A job that supersedes another one begins without the present acceleration",
        f"{_GENERATOR}.start_velocity",
        "            self.a,\n",
        "            0.0,\n",
        ids=("STP-119", "STP-120"),
        likely=("stop-modes/halt/accelerating@reference", "motion-in/overridden/velocity/halt"),
    ),
    # -- superimposed --
    _defect(
        "superimposed-without-room",
        "A superimposed motion gets the whole velocity limit, whatever the basic motion has of it",
        f"{_SUPERPOSITION}._velocity_left",
        "return max(0.0, self._limit() - present)",
        "return self._limit()",
        ids=("MC-352",),
        likely=("axis-motion/superimposed-room",),
    ),
    _defect(
        "interpolation-one-servo-cycle-late",
        "Between two interpolator cycles the setpoint begins with the same point twice",
        "motion.kernel.fine_interpolation:FineInterpolation.advance",
        "self.s, self.v = self._points[self._step - 1]",
        "self.s, self.v = self._points[max(self._step - 2, 0)]",
        ids=("CFG-152",),
        likely=("interpolator/constant-travel",),
    ),
    # -- several encoders, backlash --
    _defect(
        "encoder-switch-not-bumpless",
        "MC_SetSensor Mode 0 takes the position of the other encoder as it is",
        "motion.s7.axis.axis:TechnologyAxis.set_sensor",
        "if mode in (SWITCH_BUMPLESS, TRANSFER):",
        "if mode == TRANSFER:",
        ids=("CFG-325", "CFG-330"),
        likely=("two-encoders/switched/0",),
    ),
    _defect(
        "encoder-switch-unsmoothed",
        "The difference of two encoders acts at once when the axis switches between them",
        "motion.s7.axis.axis:TechnologyAxis.set_sensor",
        "if step and servo.controlled and servo.position_controlled:",
        "if step and not servo.position_controlled:",
        ids=("CFG-329",),
        likely=("two-encoders/switched/1",),
    ),
    _defect(
        "transfer-from-the-operative-encoder",
        "MC_SetSensor Mode 3 transfers the position of the axis whatever ReferenceSensor says",
        "motion.s7.axis.axis:TechnologyAxis.set_sensor",
        "target.transfer(servo.sensors[reference - 1].position)",
        "target.transfer(present.position)",
        ids=("CFG-328",),
        likely=("two-encoders/switched/3",),
    ),
    _defect(
        "backlash-in-the-wrong-direction",
        "The backlash is added at the flank where it has to be taken away",
        "motion.kernel.backlash:Backlash._by_setpoint",
        "end = 0.0 if direction > 0.0 else size",
        "end = size if direction > 0.0 else 0.0",
        ids=("CFG-554",),
        likely=("backlash/reversal/*",),
    ),
    _defect(
        "backlash-never-shown",
        "StatusWord2.X2 is not shown while the motor passes the backlash",
        "motion.kernel.backlash:Backlash._by_setpoint",
        "self._rest = size",
        "self._rest = 0.0",
        ids=("CFG-553",),
        likely=("backlash/reversal/forward",),
    ),
    # -- MotionIn --
    _defect(
        "motion-in-velocity-not-integrated",
        "MC_MotionInVelocity leaves the position setpoint where it is",
        f"{_PLANNING}.take_vector",
        "gen.set_state(gen.s + velocity * cycle_s, velocity, job.acceleration)",
        "gen.set_state(gen.s, velocity, job.acceleration)",
        ids=("MIN-001", "MC-473"),
        likely=("motion-in/velocity-followed/forward/position-control",),
    ),
    _defect(
        "motion-in-acceleration-dropped",
        "The acceleration of MC_MotionInPosition does not reach the setpoint",
        f"{_PLANNING}.take_vector",
        "gen.set_state(position + job.distance, velocity, job.acceleration)",
        "gen.set_state(position + job.distance, velocity, 0.0)",
        ids=("MIN-001", "MC-474"),
        likely=("motion-in/position-followed/forward/given",),
    ),
    _defect(
        "motion-in-velocity-as-derivative",
        "Position control takes the velocity of MC_MotionInPosition for the derivative of its position",
        f"{_PLANNING}.take_vector",
        "servo.controller.given = True",
        "servo.controller.given = False",
        ids=("MIN-022",),
        likely=("motion-in/velocity-without-way",),
    ),
    _defect(
        "motion-in-exceeds-one-sided",
        "StatusMotionIn.X0 is shown for positive velocities only",
        f"{_PLANNING}.motion_in_exceeds",
        "abs(self.gen.v) > self._limits.max_velocity.value",
        "self.gen.v > self._limits.max_velocity.value",
        ids=("MIN-005",),
        likely=("motion-in/beyond-limits/velocity-backwards",),
    ),
    _defect(
        "superimposed-values-from-zero",
        "MC_MotionInSuperimposed starts again at zero after an earlier superimposed motion",
        f"{_SUPERPOSITION}.give",
        "self._zero = self.part.s",
        "self._zero = 0.0",
        ids=("MIN-033",),
        likely=("motion-in/superimposed-halted/motion-in-superimposed", "motion-in/superimposed-halted/*"),
    ),
    _defect(
        "superimposed-distance-lost",
        "A superimposed motion that is ended takes its distance back",
        f"{_SUPERPOSITION}.freeze",
        "self.part.set_state(self.part.s, 0.0)",
        "self.part.set_state(0.0, 0.0)",
        ids=("MIN-040",),
        likely=("motion-in/superimposed-halted/halt-superimposed", "motion-in/released/superimposed/*"),
    ),
    # -- external encoder --
    _defect(
        "encoder-overflow-jumps",
        "The end of the range of an encoder on the bus is taken for a way",
        "motion.drives.cia406:Cia406Port.read",
        "self.encoder_increments += (value - self._last + half) % self._range - half",
        "self.encoder_increments += value - self._last",
        ids=("CFG-018",),
        likely=("external-encoder/overflow/drum",),
    ),
    _defect(
        "encoder-homed-after-new-reference",
        "An external incremental encoder that has been switched off and on counts as homed",
        f"{_ENCODER}.cycle",
        "feedback.lost_reference = False\n            self.homed = False",
        "feedback.lost_reference = False",
        ids=("HOM-179",),
        likely=("external-encoder/supply/wheel", "external-encoder/error-code/wheel/*"),
    ),
    _defect(
        "encoder-link-unwatched",
        "An external encoder whose telegrams stay away raises no alarm 431",
        f"{_ENCODER}.cycle",
        "not port.link_ok and self._was_linked,",
        "not port.link_ok and not self._was_linked,",
        ids=("TA-020",),
        likely=("external-encoder/frames-lost/wheel/many",),
    ),
    _defect(
        "encoder-standstill-at-once",
        "StatusWord.X7 of an external encoder comes without its dwell time",
        f"{_ENCODER}._watch_standstill",
        "self.standstill = self._standstill_time >= self._dwell.value - 1e-9",
        "self.standstill = self._standstill_time > 0.0",
        ids=("DIA-081", "MON-050"),
        likely=("external-encoder/follows/wheel/forward",),
    ),
    _defect(
        "encoder-offset-not-kept",
        "The adjustment of an absolute encoder is not stored: it is lost with the next restart",
        "motion.kernel.feedback:Feedback.keep_offset",
        "self._abs_offset.value = self._offset",
        "self._abs_offset.value = self._abs_offset.value",
        ids=("HOM-017", "HOM-018"),
        likely=("external-encoder/restart/drum", "external-encoder/restart/*"),
    ),
    # -- control panel --
    _defect(
        "life-sign-unwatched",
        "A control panel without a sign of life keeps the axis",
        f"{_PANEL}._cycle",
        "> self._monitoring_ns:",
        "> 1000 * self._monitoring_ns:",
        ids=("COM-024", "COM-025"),
        likely=("commissioning/connection-lost/relative",),
    ),
    _defect(
        "panel-keeps-override",
        "The override of the slider is lost when the panel gives the axis back",
        f"{_PANEL}._end",
        'axis.write("Override.Velocity", self._last_slider)',
        'axis.write("Override.Velocity", 100.0)',
        ids=("COM-041",),
        likely=("commissioning/slider/37", "commissioning/session/forward"),
    ),
    _defect(
        "tried-values-stay",
        "Values that were tried in the panel stay when it gives the axis back",
        f"{_PANEL}._take_back",
        "self.axis.write(path, value)",
        "self.axis.write(path, self.axis.variables.read(path))",
        ids=("COM-071",),
        likely=("commissioning/tried-values/released",),
    ),
    _defect(
        "panel-takes-a-moving-axis",
        "The panel takes an axis that the program is still stopping",
        f"{_PANEL}.take_control",
        "if axis.enabling.enable or axis.state not in _OFF:",
        "if axis.enabling.enable:",
        ids=("COM-022",),
        likely=("commissioning/refused/disabling",),
    ),
    _defect(
        "panel-coasts",
        "The panel switches the torque off instead of stopping with the greatest deceleration",
        f"{_PANEL}._give_back",
        "self._power.set(Enable=False, StopMode=MAX_DYNAMICS)",
        "self._power.set(Enable=False, StopMode=3)",
        ids=("COM-031", "COM-033"),
        likely=("commissioning/operator/covered/jog", "commissioning/connection-lost/relative"),
    ),
    _defect(
        "panel-jogs-forward-only",
        "A slider below zero jogs forward",
        f"{_PANEL}.jog",
        'inputs = {"JogForward": slider > 0.0, "JogBackward": slider < 0.0, **dynamics}',
        'inputs = {"JogForward": slider != 0.0, "JogBackward": False, **dynamics}',
        ids=("COM-048",),
        likely=("commissioning/session/backward", "commissioning/slider/-37"),
    ),
    _defect(
        "gain-recommended-unreduced",
        "The optimisation recommends the gain at the edge of oscillation",
        "motion.s7.commissioning.optimisation:Optimisation.run",
        "kv = _SHARE * gain",
        "kv = gain",
        ids=("COM-062",),
        likely=("commissioning/optimisation",),
    ),
)
