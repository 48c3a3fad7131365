"""Samples to short text: fewer points with every extreme kept, then quantised differences in base 64 digits.

A report of many cases is mostly numbers. Written as decimals a sample costs 8 to 18 characters, as float32 in base 64
5.3; quantised to a millionth of its range and stored as the difference of a smooth curve it costs 1 to 3. The digits are
those of source maps: 5 bits each, the sixth says that another one follows, the lowest bit of the number is its sign.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_DIGITS: Final = np.frombuffer(
    b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_", dtype=np.uint8
)
_LEVELS: Final = 2e-6
"""Greatest quantum as a part of the range of a signal; the decimal quantum is up to ten times finer."""


def thin(time_s: Floats, values: Floats, points: int, focus_s: Sequence[float]) -> NDArray[np.intp]:
    """Choose the samples to keep, ascending.

    Every bucket of time keeps its first, smallest, greatest sample, so no peak is lost; a part of the budget
    goes to all samples nearest to the moments of interest (faults, alarms, failed checks), which stay complete.

    Args:
        time_s: Ascending times [s].
        values: Samples; NaN marks a gap.
        points: About how many samples may stay; shorter signals are kept whole.
        focus_s: Moments of interest [s].

    Returns:
        Indices into both arrays; always holds the first and the last one.

    """
    size = len(values)
    if size <= points:
        return np.arange(size)
    keep = np.zeros(size, dtype=bool)
    keep[[0, -1]] = True
    near = [index for moment in focus_s if (index := int(np.searchsorted(time_s, moment))) < size]
    near = list(dict.fromkeys(near))[:16]
    half = points // 4 // max(1, len(near)) // 2
    for index in near:
        keep[max(0, index - half) : index + half + 1] = True
    buckets = max(1, (points - int(keep.sum())) // 3)
    edges = np.linspace(0, size, buckets + 1).astype(np.intp)
    finite = np.isfinite(values)
    low = np.where(finite, values, np.inf)
    high = np.where(finite, values, -np.inf)
    for start, end in pairwise(edges.tolist()):
        if end > start:
            keep[start] = True
            keep[start + int(np.argmin(low[start:end]))] = True
            keep[start + int(np.argmax(high[start:end]))] = True
    # A gap must stay one: keep the samples at both of its edges.
    edge = np.flatnonzero(finite[1:] != finite[:-1])
    if len(edge) <= points:
        keep[edge] = True
        keep[edge + 1] = True
    return np.flatnonzero(keep)


def encode(values: Floats, quantum: float | None = None) -> dict[str, Any]:
    """Return the shortest JSON object that holds the samples to within half a quantum.

    Args:
        values: Samples.
        quantum: Resolution; by default a power of ten below `2e-6` of the range.

    Returns:
        `{"n", "c"}` for a constant; `{"n", "q", "b", "o", "d"}` for quantised differences: quantum as a decimal
        exponent `q`, the first numbers `b` in quanta, the order `o` (1 or 2) and the digits `d`; `{"n", "f", "a"}`
        for little-endian float32 in base 64, to be added to `a`, where samples are missing or infinite.

    """
    size = len(values)
    if size == 0:
        return {"n": 0, "c": 0}
    if not np.isfinite(values).all():
        return _floats(values)
    low, high = float(values.min()), float(values.max())
    if low == high:
        return {"n": size, "c": low}
    finest = (high - low) * _LEVELS if quantum is None else quantum * 1.0000001
    if not 0 < finest < math.inf:  # a subnormal range, or one beyond the largest float
        return _floats(values)
    exponent = math.floor(math.log10(finest))
    if quantum is None and high - low <= 2**41 and np.array_equal(values, np.rint(values)):
        exponent = 0  # counts and encoder increments stay exact
    peak = max(abs(low), abs(high))
    if (
        exponent < 290 and peak > 2**50 * 10.0**exponent
    ):  # a small change on a large offset: as fine as a float is
        exponent = math.ceil(math.log10(peak / 2**50))
    if not -300 < exponent < 290:
        return _floats(values)
    # Multiply or divide by a whole power of ten: that is exact to the last digit, 10**-6 itself is not.
    scaled = values * 10.0**-exponent if exponent < 0 else values / 10.0**exponent
    whole = np.rint(scaled).astype(np.int64)
    first = np.diff(whole)
    second = np.diff(first)
    one, two = _fold(first), _fold(second)
    if size > 2 and _length(two) < _length(one):
        return {"n": size, "q": exponent, "b": [int(whole[0]), int(first[0])], "o": 2, "d": _digits(two)}
    return {"n": size, "q": exponent, "b": [int(whole[0])], "o": 1, "d": _digits(one)}


def decode(plain: dict[str, Any]) -> Floats:
    """Return the samples again: the reference for the JavaScript of the report."""
    size = plain["n"]
    if "c" in plain:
        return np.full(size, float(plain["c"]))
    if "f" in plain:
        return np.frombuffer(base64.b64decode(plain["f"]), dtype="<f4").astype(np.float64) + float(plain["a"])
    digits = {int(code): value for value, code in enumerate(_DIGITS)}
    numbers, number, scale = [], 0, 1
    for code in plain["d"].encode("ascii"):
        digit = digits[code]
        number += (digit & 31) * scale
        scale *= 32
        if digit < 32:
            numbers.append(-(number >> 1) if number & 1 else number >> 1)
            number, scale = 0, 1
    whole = np.array([plain["b"][-1], *numbers], dtype=np.int64).cumsum()
    if plain["o"] == 2:
        whole = np.array([plain["b"][0], *whole], dtype=np.int64).cumsum()
    exponent = int(plain["q"])
    samples = whole.astype(np.float64)
    return samples / 10.0**-exponent if exponent < 0 else samples * 10.0**exponent


def _fold(numbers: NDArray[np.int64]) -> NDArray[np.unsignedinteger]:
    """Return the numbers with their signs as lowest bits, as narrow as they may be."""
    folded = (np.abs(numbers).astype(np.uint64) << np.uint64(1)) | (numbers < 0).astype(np.uint64)
    return folded.astype(np.uint32) if len(folded) == 0 or folded.max() < 2**32 else folded


def _width(folded: NDArray[np.unsignedinteger]) -> int:
    return max(1, -(-int(folded.max()).bit_length() // 5)) if len(folded) else 0


def _length(folded: NDArray[np.unsignedinteger]) -> int:
    """Return the number of digits that the numbers take."""
    return sum(int(np.count_nonzero(folded >= 32**place)) for place in range(1, _width(folded))) + len(folded)


def _digits(folded: NDArray[np.unsignedinteger]) -> str:
    width = _width(folded)
    if width == 0:
        return ""
    kind = folded.dtype.type
    parts = folded[:, None] >> (np.arange(width, dtype=folded.dtype) * kind(5))[None, :]
    more = parts > kind(31)
    codes = (parts & kind(31)).astype(np.uint8) | (more.astype(np.uint8) << np.uint8(5))
    used = np.ones_like(more)
    used[:, 1:] = more[:, :-1]
    return str(_DIGITS[codes[used]].tobytes(), "ascii")


def _floats(values: Floats) -> dict[str, Any]:
    finite = values[np.isfinite(values)]
    low = float(finite.min()) if len(finite) else 0.0
    offset = low if len(finite) and abs(low) > 100 * (float(finite.max()) - low) else 0.0
    with np.errstate(over="ignore"):  # beyond float32 is beyond the plot
        content = (values - offset).astype("<f4").tobytes()
    return {"n": len(values), "f": base64.b64encode(content).decode("ascii"), "a": offset}
