"""Arrays of the user program from which `MC_CopyCamData` copies."""

from __future__ import annotations

from collections.abc import Iterable

from motion.kernel.cams import Point, Segment


class _Bounds:
    """Index range and place of an array.

    Args:
        length: Number of elements.
        lower: Index of the first one.
        optimised: Whether its data block has optimised access (CAM-091).

    """

    def __init__(self, length: int, lower: int, *, optimised: bool) -> None:
        self.lower = lower
        """Index of the first element."""
        self.upper = lower + length - 1
        """Index of the last element."""
        self.optimised = optimised
        """Whether its data block has optimised access."""


class PointArray:
    """`ARRAY[*] OF TO_Cam_Struct_PointData` in a data block.

    Args:
        elements: Points, or pairs of leading and following value.
        lower: Index of the first one.
        optimised: Whether the data block has optimised access; otherwise the array cannot be used (16#80E9).

    """

    def __init__(
        self, elements: Iterable[Point | tuple[float, float]], lower: int = 1, *, optimised: bool = True
    ) -> None:
        self.elements: list[Point] = [
            one if isinstance(one, Point) else Point(float(one[0]), float(one[1])) for one in elements
        ]
        """The points; the program may change them."""
        self.bounds = _Bounds(len(self.elements), lower, optimised=optimised)


class SegmentArray:
    """`ARRAY[*] OF TO_Cam_Struct_SegmentData` in a data block.

    Args:
        elements: Segments.
        lower: Index of the first one.
        optimised: Whether the data block has optimised access; otherwise the array cannot be used (16#80EA).

    """

    def __init__(self, elements: Iterable[Segment], lower: int = 1, *, optimised: bool = True) -> None:
        self.elements: list[Segment] = list(elements)
        """The segments; the program may change them."""
        self.bounds = _Bounds(len(self.elements), lower, optimised=optimised)
