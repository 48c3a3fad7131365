"""Technology objects: positioning axis, speed axis, external encoder."""

from motion.axis.axis import PositioningAxis, SpeedAxis, TechnologyAxis
from motion.axis.external_encoder import ExternalEncoder
from motion.axis.state import AxisState

__all__ = ["AxisState", "ExternalEncoder", "PositioningAxis", "SpeedAxis", "TechnologyAxis"]
