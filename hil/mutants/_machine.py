"""Defects of encoders, mechanics, brake and switches."""

from __future__ import annotations

from functools import partial
from typing import Final

from hil.mutants._mutant import Edit, Mutant, defect

_ENCODER: Final = "emulators.encoder._encoder"
_AXIS: Final = "emulators.mechanics._axis:AxisMechanics"
_SWITCH: Final = "emulators.mechanics._switch:SwitchModel"
_BRAKE: Final = "emulators.drive.brake:HoldingBrake"
_CORE: Final = "emulators.drive.core:ServoCore"

_defect = partial(defect, area="machine")

MUTANTS: Final[tuple[Mutant, ...]] = (
    _defect(
        "zero-mark-one-turn-late",
        "The zero mark is reported one revolution too far in positive direction",
        f"{_ENCODER}:RotaryEncoder._look_for_zero_mark",
        "turn = turn_before + 1 if after > before else turn_before",
        "turn = turn_before + 2 if after > before else turn_before",
        ids=("HOM-082",),
        likely=("homing/zero-mark/positive/*", "homing/cam/positive/*"),
    ),
    _defect(
        "zero-mark-negative-missed",
        "Zero marks are noticed in positive direction only",
        f"{_ENCODER}:RotaryEncoder._look_for_zero_mark",
        "if turn_before == turn_after:",
        "if turn_before >= turn_after:",
        ids=("HOM-085",),
        likely=("homing/zero-mark/negative/*", "homing/cam/negative/*"),
    ),
    _defect(
        "encoder-forgets-jump",
        "A slip of the encoder is shown for one sample only",
        f"{_ENCODER}:RotaryEncoder.jump",
        "self._set_offset(self._offset_increments + int(increments))",
        "self._offset += int(increments) * self._rad_per_inc",
        ids=("STP-559",),
        likely=("fault-reactions/encoder-jump/*",),
    ),
    _defect(
        "frozen-encoder-moves",
        "A frozen encoder still follows its shaft",
        f"{_ENCODER}:RotaryEncoder._sample_special",
        "if not self._frozen:",
        "if self._frozen is not None:",
        ids=("MON-038",),
        likely=("fault-reactions/encoder-frozen/*",),
    ),
    _defect(
        "shaft-jam-for-one-step",
        "A jammed shaft is held for one step only",
        f"{_AXIS}._settle",
        "contact or self._jammed",
        "contact",
        ids=("STP-536",),
        likely=("fault-reactions/jam/*",),
    ),
    _defect(
        "friction-does-not-brake",
        "Friction does not brake a coasting axis",
        f"{_AXIS}._refresh_forces",
        "(self._coulomb + self._brake",
        "(self._brake",
        ids=("STP-014",),
        likely=("stop-modes/power-3/*",),
    ),
    _defect(
        "gear-ratio-twice",
        "The torque of the motor reaches the load with twice the force",
        f"{_AXIS}.__init__",
        "self._force_per_torque = 1.0 / self.ratio",
        "self._force_per_torque = 2.0 / self.ratio",
        ids=("STP-311",),
        likely=("axis-signals/follows@reference",),
    ),
    _defect(
        "load-step-sign",
        "A force from outside acts in the wrong direction",
        f"{_AXIS}._refresh_forces",
        "self._load_force = self._gravity + self._external",
        "self._load_force = self._gravity - self._external",
        ids=("STP-536",),
        likely=("fault-reactions/load-step", "axis-faults/enabling/pushed/*"),
    ),
    _defect(
        "switch-falls-back-late",
        "A passed switch stays actuated until the other end of its range",
        f"{_SWITCH}.update",
        "if not low - hysteresis <= position <= high + hysteresis:",
        "if not low - hysteresis <= position:",
        ids=("LIM-034",),
        likely=("homing/cam/*", "homing/input/*"),
    ),
    _defect(
        "stuck-switch-works",
        "A stuck switch still works",
        f"{_SWITCH}._settle",
        "state = self._actuated is not self._inverted if self._forced is None else self._forced",
        "state = self._actuated is not self._inverted",
        ids=("LIM-034",),
        likely=("fault-reactions/limit-switch-stuck", "homing/cam-stuck-*"),
    ),
    _defect(
        "torque-limit-one-sided",
        "The negative torque limit has the value of the positive one with the wrong sign",
        f"{_CORE}.set_torque_limits",
        "self._limit_low = -negative_Nm",
        "self._limit_low = -10.0 * negative_Nm",
        ids=("STP-148",),
        likely=(
            "fault-reactions/encoder-jump/-131072@profidrive",
            "fault-reactions/overload",
        ),
    ),
    Mutant(
        "encoder-samples-before-step",
        "machine",
        "The encoder shows the angle before the servo step, one period late",
        (
            Edit(
                f"{_CORE}.step",
                "angle = self._sample(self._step_mechanics(self.torque, self._period))",
                "angle = self._sample(self._mechanics.motor_angle)\n        "
                "self._step_mechanics(self.torque, self._period)",
            ),
            Edit(f"{_CORE}.calm", "if self._stop_pending or", "if True or"),  # steps are made one by one
        ),
        ("CTL-001",),
        ("axis-signals/follows@reference",),
    ),
)
