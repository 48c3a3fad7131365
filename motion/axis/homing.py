"""Direct homing: the coordinate system shifts, nothing moves (HOM-139 to HOM-147; modulo axes CFG-112 to CFG-123)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from motion.axis.axis import PositioningAxis

_ADJUSTS: Final = (6, 7, 13)


def home_directly(axis: PositioningAxis, mode: int, position: float) -> None:
    """Carry out a direct homing.

    On a modulo axis the new place is reached over the shortest distance, which decides what becomes of the counter; with mode
    7 the counter is 0.

    Args:
        axis: The axis.
        mode: 0 absolute, 1 relative, 6 and 7 as 1 and 0 for an absolute encoder, 11 and 12 set the position setpoint, 13 as
            0 for an incremental encoder.
        position: Position in the axis unit.

    """
    modulo = axis.modulo
    feedback = axis.feedback
    if mode in (0, 7, 13):
        offset = position - feedback.position
    elif mode in (1, 6, 12):
        offset = position
    else:
        offset = position - axis.motion.total.s
    if modulo.enabled:
        offset = modulo.wrap(position) - feedback.position if mode == 7 else modulo.shortest(offset)
    shift_coordinates(axis, offset)
    axis.homed = True
    number = axis.operative_sensor
    if mode in _ADJUSTS:
        axis.variables.set_internal(f"StatusSensor[{number}].Adjusted", 1)
    if mode in (6, 7):
        feedback.keep_offset()
    if axis.history is not None:
        axis.history.emit(axis.name, "axis.homed", mode=mode, offset=offset)


def shift_coordinates(axis: PositioningAxis, offset: float) -> None:
    """Let every position of the axis grow by `offset`, setpoints and actual values alike."""
    motion = axis.motion
    axis.feedback.shift(offset)
    motion.gen.shift(offset)
    if motion.superimposed is not None:
        motion.superimposed.refresh()
    axis.controller.shift(offset)
    axis.limits.shift(offset)
    axis.torque.shift(offset)
    job = motion.job
    if job is not None and job.busy and job.relative:
        job.target += offset
    motion.replan()
