"""What a recorder takes from an axis in every cycle: setpoints, actual values, position control, words
(MON-053, CTL-049).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from motion.s7.axis.axis import TechnologyAxis

TRACE_COLUMNS: Final[tuple[tuple[str, str], ...]] = (
    ("position_setpoint", "mm"),
    ("velocity_setpoint", "mm/s"),
    ("acceleration_setpoint", "mm/s2"),
    ("actual_position", "mm"),
    ("actual_velocity", "mm/s"),
    ("following_error", "mm"),
    ("actual_speed", "rpm"),
    ("speed_output", "rpm"),
    ("actual_torque", "Nm"),
    ("status_word", ""),
    ("status_word2", ""),
    ("error_word", ""),
    ("warning_word", ""),
    ("alarm_number", ""),
    ("alarm_reaction", ""),
    ("state", ""),
    ("stw1", ""),
    ("zsw1", ""),
    ("power_status", ""),
    ("power_busy", ""),
    ("power_enable", ""),
    ("in_operation", ""),
    ("communication_ok", ""),
    ("filtered_position", "mm"),
    ("balanced_position", "mm"),
    ("control_difference", "mm"),
    ("permitted_following_error", "mm"),
    ("additive_torque", "Nm"),
)
"""Name and unit of every value, for an axis in mm with a standard motor."""

_NO_CONTROL: Final = (0.0, 0.0, 0.0, 0.0, 0.0)
"""What a speed axis shows of position control."""


def trace_row(axis: TechnologyAxis) -> tuple[float, ...]:
    """Return the values of `TRACE_COLUMNS` for the present cycle."""
    gen = axis.motion.total if axis.fine is None or not axis.facts.controlled else axis.fine
    port = axis.port
    engine = axis.alarms.engine
    has_position = axis.has_position
    return (
        gen.s,
        gen.v,
        gen.a,
        axis.feedback.position,
        axis.actual_velocity,
        axis.controller.following_error if has_position else 0.0,
        port.actual_speed_rpm,
        axis.speed_output_rpm,
        port.actual_torque_nm,
        axis.status_word,
        axis.status_word2,
        engine.error_word,
        engine.warning_word,
        engine.number,
        engine.reaction,
        axis.state,
        axis.stw1_sent,
        port.zsw1,
        axis.power_status_shown,
        axis.enabling.busy,
        axis.enabling.enable,
        axis.in_operation,
        axis.communication_ok,
        *(_control(axis, gen.s) if has_position else _NO_CONTROL),
    )


def _control(axis: TechnologyAxis, setpoint: float) -> tuple[float, float, float, float, float]:
    """Return the nodes of position control between `setpoint` and the output, axis unit; and the additive
    torque, Nm.
    """
    controller = axis.controller
    dynamic_filter = controller.filter
    return (
        setpoint if dynamic_filter is None else dynamic_filter.position,
        controller.balanced_position,
        controller.control_difference,
        axis.monitoring.permitted_following_error(axis.motion.total.v),
        axis.torque.total_additive_nm,
    )
