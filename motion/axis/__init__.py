"""Technology objects: speed axis, positioning axis, synchronous axis, external encoder."""

from motion.axis.axis import PositioningAxis, SpeedAxis, SynchronousAxis, TechnologyAxis
from motion.axis.external_encoder import ExternalEncoder
from motion.axis.state import AxisState

__all__ = [
    "AxisState",
    "ExternalEncoder",
    "PositioningAxis",
    "SpeedAxis",
    "SynchronousAxis",
    "TechnologyAxis",
]
