"""Targets of modulo positioning (NC-678 to NC-722)."""

from __future__ import annotations

from enum import IntEnum
from math import floor
from typing import Final

_SLACK: Final = 1e-9


class Direction(IntEnum):
    """`MC_Direction`."""

    POSITIVE = 1
    SHORTEST = 2
    NEGATIVE = 3
    CURRENT = 4


class ModuloTargetError(Exception):
    """The target of a modulo command is not possible; says why."""


def modulo_distance(
    start: float, target: float, *, factor: float, tolerance: float, direction: Direction, turns: int = 0
) -> float:
    """Return the way from `start` to a modulo target, position unit, signed.

    Args:
        start: Present set position, without modulo.
        target: Position within one turn, 0 up to below `factor`.
        factor: Length of a turn.
        tolerance: Window around the start within which the shortest way is taken (NC-682).
        direction: Positive, negative or shortest way.
        turns: Additional turns in that direction.

    Raises:
        ModuloTargetError: The target lies outside of a turn, or the shortest way is to have additional turns.

    """
    if not 0.0 <= target < factor:
        raise ModuloTargetError("target position invalid")
    place = start - floor(start / factor) * factor
    forward = (target - place) % factor
    if factor - forward <= _SLACK or forward <= _SLACK:
        forward = 0.0  # rounding makes no turn
    shortest = forward if forward <= factor / 2.0 + _SLACK else forward - factor
    if direction == Direction.SHORTEST:
        if turns:
            raise ModuloTargetError("invalid additional turns")
        return shortest
    sign = 1.0 if direction == Direction.POSITIVE else -1.0
    if abs(shortest) <= tolerance + _SLACK:
        way = shortest
    elif sign > 0.0:
        way = forward
    else:
        way = forward - factor if forward > 0.0 else 0.0
    return way + sign * turns * factor


def modulo_move(
    start: float, target: float, *, factor: float, tolerance: float, direction: Direction
) -> float:
    """Return the way of `MC_MoveModulo`, whose target of `factor` or more contains the turns.

    Raises:
        ModuloTargetError: The target is negative, or is a turn or more with the shortest way.

    """
    turns = floor(target / factor)
    if turns < 0:
        raise ModuloTargetError("target position invalid")
    return modulo_distance(
        start, target - turns * factor, factor=factor, tolerance=tolerance, direction=direction, turns=turns
    )
