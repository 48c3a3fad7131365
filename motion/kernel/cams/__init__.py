"""Cams: a following value for every leading value, from points and segments, and laws of motion."""

from motion.kernel.cams.curve import Curve
from motion.kernel.cams.interpolation import (
    PULLED_TOGETHER,
    Boundary,
    CamError,
    EmptyCamError,
    Interpolation,
    InvalidCamError,
    interpolate,
)
from motion.kernel.cams.inverse import NEAREST, NEGATIVE, POSITIVE, Inverse
from motion.kernel.cams.pieces import BezierPiece, Piece, Point, Polynomial, Segment, Values
from motion.kernel.cams.scaled import APPENDING, CYCLIC, ONCE, ScaledCurve

__all__ = [
    "APPENDING",
    "CYCLIC",
    "NEAREST",
    "NEGATIVE",
    "ONCE",
    "POSITIVE",
    "PULLED_TOGETHER",
    "BezierPiece",
    "Boundary",
    "CamError",
    "Curve",
    "EmptyCamError",
    "Interpolation",
    "InvalidCamError",
    "Inverse",
    "Piece",
    "Point",
    "Polynomial",
    "ScaledCurve",
    "Segment",
    "Values",
    "interpolate",
]
