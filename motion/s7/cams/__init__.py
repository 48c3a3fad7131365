"""Cam technology objects: points, segments, interpolated function (CAM section 12)."""

from motion.s7.cams.arrays import PointArray, SegmentArray
from motion.s7.cams.cam import Cam
from motion.s7.cams.data import CAM_TYPES, CamData, CamType
from motion.s7.cams.elements import SEGMENT_FIELDS, segment_of, segment_values

__all__ = [
    "CAM_TYPES",
    "SEGMENT_FIELDS",
    "Cam",
    "CamData",
    "CamType",
    "PointArray",
    "SegmentArray",
    "segment_of",
    "segment_values",
]
