"""Technology objects: speed axis, positioning axis, synchronous axis, external encoder."""

from motion.s7.axis.axis import PositioningAxis, SpeedAxis, SynchronousAxis, TechnologyAxis
from motion.s7.axis.external_encoder import ExternalEncoder
from motion.s7.axis.state import AxisState

__all__ = [
    "AxisState",
    "ExternalEncoder",
    "PositioningAxis",
    "SpeedAxis",
    "SynchronousAxis",
    "TechnologyAxis",
]
