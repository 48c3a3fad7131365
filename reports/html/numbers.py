"""Samples to short text: fewer points with every extreme kept, then quantised differences in base 64 digits.

A report of many cases is mostly numbers. Written as decimals a sample costs 8 to 18 characters, as float32 in
base 64 5.3; quantised to a millionth of its range and stored as the difference of a smooth curve it costs 1
to 3. The digits are those of source maps: 5 bits each, the sixth says that another one follows, the lowest
bit of the number is its sign.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_DIGITS: Final = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_".ljust(256)
"""Characters of the numbers below 64, as a table for `bytes.translate`."""
_LEVELS: Final = 2e-6
"""Greatest quantum as a part of the range of a signal; the decimal quantum is up to ten times finer."""


def thin(time_s: Floats, values: Floats, points: int, focus_s: Sequence[float]) -> NDArray[np.intp]:
    """Choose the samples to keep, ascending.

    Every bucket of time keeps its first, smallest, greatest sample, so no peak is lost; a part
    of the budget goes to all samples nearest to the moments of interest (faults, alarms,
    failed checks), which stay complete.

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
    places = edges[:-1, None] + np.arange(int(np.diff(edges).max()))
    inside = places < edges[1:, None]
    places = np.minimum(places, size - 1)
    finite = np.isfinite(values)
    keep[edges[:-1]] = True
    for sign in (1.0, -1.0):
        extremes = np.where(inside & finite[places], sign * values[places], np.inf).argmin(axis=1)
        keep[edges[:-1] + extremes] = True
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
        `{"n", "c"}` for a constant; `{"n", "q", "b", "o", "d"}` for quantised differences: quantum as a
        decimal
        exponent `q`, the first numbers `b` in quanta, the order `o` (1 or 2) and the digits `d`; `{"n", "f",
        "a"}` for little-endian float32 in base 64, to be added to `a`, where samples are missing or infinite.

    """
    return encode_all([(values, quantum)])[0]


def encode_all(columns: Sequence[tuple[Floats, float | None]]) -> list[dict[str, Any]]:
    """Return `encode` of many columns: all at once, since a column is short
    and a call of NumPy is not free.
    """
    found: list[dict[str, Any]] = [{"n": 0, "c": 0}] * len(columns)
    filled = [place for place, (values, _quantum) in enumerate(columns) if len(values)]
    if not filled:
        return found
    flat = np.concatenate([columns[place][0] for place in filled])
    starts = _starts([len(columns[place][0]) for place in filled])
    lows = np.minimum.reduceat(flat, starts).tolist()
    highs = np.maximum.reduceat(flat, starts).tolist()
    counts = np.logical_and.reduceat(flat == np.rint(flat), starts).tolist()
    chosen: list[int] = []
    exponents: list[int] = []
    for place, low, high, whole in zip(filled, lows, highs, counts, strict=True):
        values, quantum = columns[place]
        if low == high and math.isfinite(low):
            found[place] = {"n": len(values), "c": low}
            continue
        exponent = _exponent(low, high, quantum, whole=whole)
        if exponent is None:
            found[place] = _floats(values)
        else:
            chosen.append(place)
            exponents.append(exponent)
    if chosen:
        quantised = _quantised([columns[place][0] for place in chosen], exponents)
        for place, plain in zip(chosen, quantised, strict=True):
            found[place] = plain
    return found


def _exponent(low: float, high: float, quantum: float | None, *, whole: bool) -> int | None:
    """Return the decimal exponent of the quantum for samples between two
    limits; None where there can be none.

    `whole`: all samples are whole numbers, which stay exact unless a quantum is given.
    """
    if not (math.isfinite(low) and math.isfinite(high)):
        return None
    finest = (high - low) * _LEVELS if quantum is None else quantum * 1.0000001
    if not 0 < finest < math.inf:  # a subnormal range, or one beyond the largest float
        return None
    exponent = math.floor(math.log10(finest))
    if quantum is None and whole and high - low <= 2**41:
        exponent = 0  # counts and encoder increments stay exact
    peak = max(abs(low), abs(high))
    if exponent < 290 and peak > 2**50 * 10.0**exponent:
        # A small change on a large offset: as fine as a float is.
        exponent = math.ceil(math.log10(peak / 2**50))
    return exponent if -300 < exponent < 290 else None


def _quantised(columns: Sequence[Floats], exponents: Sequence[int]) -> list[dict[str, Any]]:
    """Return the objects of columns of at least two samples, of differences of
    the first or second order each.
    """
    # Multiply or divide by a whole power of ten: that is exact to the last digit, 10**-6 itself is not.
    scaled = [
        values * 10.0**-exponent if exponent < 0 else values / 10.0**exponent
        for values, exponent in zip(columns, exponents, strict=True)
    ]
    whole = np.rint(np.concatenate(scaled)).astype(np.int64)
    sizes = [len(values) for values in columns]
    starts = _starts(sizes)
    first = np.zeros_like(whole)
    np.subtract(whole[1:], whole[:-1], out=first[1:])
    first[starts] = 0
    second = np.zeros_like(whole)
    np.subtract(first[1:], first[:-1], out=second[1:])
    second[starts] = 0
    second[starts + 1] = 0
    one, two = _fold(first), _fold(second)
    width_one, width_two = _widths(one), _widths(two)
    # What has no difference before it has the width of a zero, and is not written.
    length_one = np.add.reduceat(width_one, starts) - 1
    length_two = np.add.reduceat(width_two, starts) - 2
    twice = (np.array(sizes) > 2) & (length_two < length_one)
    everywhere = np.repeat(twice, sizes)
    used = np.ones(len(whole), dtype=bool)
    used[starts] = False
    used[starts[twice] + 1] = False
    digits = _digits(np.where(everywhere, two, one)[used], np.where(everywhere, width_two, width_one)[used])
    ends = np.where(twice, length_two, length_one).cumsum().tolist()
    found = []
    end = 0
    for size, exponent, start, second_order, next_end in zip(
        sizes, exponents, starts.tolist(), twice.tolist(), ends, strict=True
    ):
        base = [int(whole[start]), int(first[start + 1])] if second_order else [int(whole[start])]
        found.append({"n": size, "q": exponent, "b": base, "o": 1 + second_order, "d": digits[end:next_end]})
        end = next_end
    return found


def decode(plain: dict[str, Any]) -> Floats:
    """Return the samples again: the reference for the JavaScript of the report."""
    size = plain["n"]
    if "c" in plain:
        return np.full(size, float(plain["c"]))
    if "f" in plain:
        return np.frombuffer(base64.b64decode(plain["f"]), dtype="<f4").astype(np.float64) + float(plain["a"])
    digits = {code: value for value, code in enumerate(_DIGITS[:64])}
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


def _starts(sizes: Sequence[int]) -> NDArray[np.intp]:
    """Return where each of several columns begins that stand one after the other."""
    starts = np.zeros(len(sizes), dtype=np.intp)
    np.cumsum(sizes[:-1], out=starts[1:])
    return starts


def _fold(numbers: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the numbers with their signs as lowest bits: of at most 2**54, for none is beyond 2**53."""
    return (np.abs(numbers) << 1) | (numbers < 0)


def _widths(folded: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the number of digits that each number takes."""
    bits = np.frexp(folded.astype(np.float64))[1].astype(np.int64)
    return np.maximum(1, (bits + 4) // 5)


def _digits(folded: NDArray[np.int64], widths: NDArray[np.int64]) -> str:
    """Return the digits of all numbers, lowest first."""
    most = int(widths.max())
    codes = np.empty((len(folded), most), dtype=np.uint8)
    rest = folded
    for place in range(most):
        codes[:, place] = rest & 31
        rest = rest >> 5
    used = np.arange(most) < widths[:, None]
    codes[:, :-1] |= used[:, 1:].view(np.uint8) << np.uint8(5)
    return str(codes[used].tobytes().translate(_DIGITS), "ascii")


def _floats(values: Floats) -> dict[str, Any]:
    finite = values[np.isfinite(values)]
    low = float(finite.min()) if len(finite) else 0.0
    offset = low if len(finite) and abs(low) > 100 * (float(finite.max()) - low) else 0.0
    with np.errstate(over="ignore"):  # beyond float32 is beyond the plot
        content = (values - offset).astype("<f4").tobytes()
    return {"n": len(values), "f": base64.b64encode(content).decode("ascii"), "a": offset}
