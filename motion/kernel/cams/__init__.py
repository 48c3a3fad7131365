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
from motion.kernel.cams.laws import Characteristics, Law
from motion.kernel.cams.pieces import BezierPiece, Piece, Point, Polynomial, Segment, Values
from motion.kernel.cams.scaled import APPENDING, CYCLIC, ONCE, ScaledCurve
from motion.kernel.cams.transitions import (
    APPROXIMATION,
    LAWS,
    Elements,
    End,
    LawError,
    LawKind,
    law_between,
    law_elements,
    proposed,
    selectable,
    transition,
)

__all__ = [
    "APPENDING",
    "APPROXIMATION",
    "CYCLIC",
    "LAWS",
    "NEAREST",
    "NEGATIVE",
    "ONCE",
    "POSITIVE",
    "PULLED_TOGETHER",
    "BezierPiece",
    "Boundary",
    "CamError",
    "Characteristics",
    "Curve",
    "Elements",
    "EmptyCamError",
    "End",
    "Interpolation",
    "InvalidCamError",
    "Inverse",
    "Law",
    "LawError",
    "LawKind",
    "Piece",
    "Point",
    "Polynomial",
    "ScaledCurve",
    "Segment",
    "Values",
    "interpolate",
    "law_between",
    "law_elements",
    "proposed",
    "selectable",
    "transition",
]
