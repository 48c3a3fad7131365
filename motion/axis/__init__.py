"""Technology objects: positioning axis and speed axis."""

from motion.axis.axis import PositioningAxis, SpeedAxis, TechnologyAxis
from motion.axis.state import AxisState

__all__ = ["AxisState", "PositioningAxis", "SpeedAxis", "TechnologyAxis"]
