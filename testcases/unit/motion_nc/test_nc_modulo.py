"""Modulo positioning, row by row of the tables of the specification."""

import pytest

from motion.nc.modulo import Direction, ModuloTargetError, modulo_distance, modulo_move

_POSITIVE, _NEGATIVE, _SHORTEST = Direction.POSITIVE, Direction.NEGATIVE, Direction.SHORTEST
_INVALID = "target position invalid"
TURNS = {  # direction, start, target, additional turns, way or error
    686: (_POSITIVE, 110.0, 10.0, 0, 0.0),
    687: (_POSITIVE, 110.9, 10.0, 0, -0.9),
    688: (_POSITIVE, 112.0, 10.0, 0, 98.0),
    689: (_POSITIVE, 95.0, 10.0, 0, 15.0),
    690: (_POSITIVE, 110.0, 110.0, 0, _INVALID),
    691: (_POSITIVE, 110.0, 10.0, 3, 300.0),
    692: (_POSITIVE, 110.9, 10.0, 3, 299.1),
    693: (_POSITIVE, 112.0, 10.0, 3, 398.0),
    694: (_POSITIVE, 95.0, 10.0, 3, 315.0),
    695: (_POSITIVE, 110.0, 110.0, 3, _INVALID),
    696: (_NEGATIVE, 110.0, 10.0, 0, 0.0),
    697: (_NEGATIVE, 109.9, 10.0, 0, 0.1),
    698: (_NEGATIVE, 108.0, 10.0, 0, -98.0),
    699: (_NEGATIVE, 95.0, 10.0, 0, -85.0),
    700: (_NEGATIVE, 110.0, 110.0, 0, _INVALID),
    701: (_NEGATIVE, 410.0, 10.0, 3, -300.0),
    702: (_NEGATIVE, 409.9, 10.0, 3, -299.9),
    703: (_NEGATIVE, 408.0, 10.0, 3, -398.0),
    704: (_NEGATIVE, 495.0, 10.0, 3, -385.0),
    705: (_NEGATIVE, 410.0, 110.0, 3, _INVALID),
    706: (_SHORTEST, 440.0, 50.0, 0, 10.0),
    707: (_SHORTEST, 440.0, 10.0, 0, -30.0),
    708: (_SHORTEST, 440.0, 50.0, 1, "invalid additional turns"),
}
MOVES = {  # direction, start, target, way
    709: (_POSITIVE, 90.0, 0.0, 270.0),
    710: (_POSITIVE, 90.0, 360.0, 630.0),
    711: (_POSITIVE, 90.0, 720.0, 990.0),
    712: (_NEGATIVE, 90.0, 0.0, -90.0),
    713: (_NEGATIVE, 90.0, 360.0, -450.0),
    714: (_SHORTEST, 90.0, 0.0, -90.0),
    715: (_POSITIVE, 90.9, 90.0, -0.9),
    716: (_POSITIVE, 91.1, 90.0, 358.9),
    717: (_POSITIVE, 88.9, 90.0, 1.1),
    718: (_POSITIVE, 90.9, 450.0, 359.1),
    719: (_POSITIVE, 91.1, 450.0, 718.9),
    720: (_NEGATIVE, 89.1, 90.0, 0.9),
    721: (_NEGATIVE, 88.9, 90.0, -358.9),
    722: (_NEGATIVE, 91.1, 450.0, -361.1),
}


@pytest.mark.requirement(*(f"NC-{row}" for row in TURNS), "NC-682")
def test_turns(subtests):
    """Direction, start, target and additional turns give the way of the table; what is impossible is
    refused.
    """
    for row, (direction, start, target, turns, expected) in TURNS.items():
        with subtests.test(f"NC-{row}"):
            arguments = {"factor": 100.0, "tolerance": 1.0, "direction": direction, "turns": turns}
            if isinstance(expected, str):
                with pytest.raises(ModuloTargetError, match=expected):
                    modulo_distance(start, target, **arguments)
            else:
                assert modulo_distance(start, target, **arguments) == pytest.approx(expected, abs=1e-9)


@pytest.mark.requirement(*(f"NC-{row}" for row in MOVES))
def test_moves(subtests):
    """A target of a turn or more contains the additional turns."""
    for row, (direction, start, target, expected) in MOVES.items():
        with subtests.test(f"NC-{row}"):
            way = modulo_move(start, target, factor=360.0, tolerance=1.0, direction=direction)
            assert way == pytest.approx(expected, abs=1e-9)
    with pytest.raises(ModuloTargetError):
        modulo_move(90.0, 360.0, factor=360.0, tolerance=1.0, direction=_SHORTEST)


@pytest.mark.requirement("NC-684")
def test_half_a_turn():
    """Half a turn goes in positive direction; the tolerance compares with the slack of rounding."""
    half = modulo_distance(10.0, 60.0, factor=100.0, tolerance=0.0, direction=_SHORTEST)
    assert half == pytest.approx(50.0)
    assert modulo_distance(60.0, 10.0, factor=100.0, tolerance=0.0, direction=_SHORTEST) == pytest.approx(
        50.0
    )
    for beyond, way in ((5e-10, -1.0), (2e-9, 99.0)):
        found = modulo_distance(11.0 + beyond, 10.0, factor=100.0, tolerance=1.0, direction=_POSITIVE)
        assert found == pytest.approx(way, abs=1e-6)
