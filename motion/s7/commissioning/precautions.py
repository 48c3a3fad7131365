"""What should be active before somebody moves an axis by hand or by setpoints
of his own (COM-027, MIN-008).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from motion.s7.axis import TechnologyAxis

_WATCHED: Final = {
    "PositionLimits_HW.Active": "hardware limit switches",
    "PositionLimits_SW.Active": "software limit switches",
    "FollowingError.EnableMonitoring": "monitoring of the following error",
}


def precautions(axis: TechnologyAxis) -> tuple[str, ...]:
    """Return what is recommended and not active, in words with its variable; nothing of it is demanded.

    Software limit switches that are active do not act before the axis is homed, which is reported as well. An
    emergency stop within reach is the operator's own.

    Args:
        axis: A speed axis has nothing of this, and gets an empty tuple.

    """
    if not axis.has_position:
        return ()
    read = axis.variables.read
    missing = [f"{words} ({path})" for path, words in _WATCHED.items() if not read(path)]
    if read("PositionLimits_SW.Active") and not axis.var("StatusWord.X5"):
        missing.append("software limit switches act when the axis is homed (StatusWord.X5)")
    return tuple(missing)
