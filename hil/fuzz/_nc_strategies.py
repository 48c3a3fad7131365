"""Hypothesis strategies for the blocks of NC axes."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Final

from hypothesis import strategies as st

from hil.fuzz._nc_jobs import COUPLED, ONLINE, PACKET, RELEASE
from motion.nc.blocks import HomingMode, JogMode, MC_GearIn
from motion.nc.commands import BufferMode
from motion.nc.library import COMMANDS
from motion.nc.modulo import Direction

if TYPE_CHECKING:
    from hypothesis.strategies import SearchStrategy

    from fieldbus.history import Scalar

Inputs = Mapping[str, "SearchStrategy[Scalar | None]"]
_PULSES: Final = ("MC_Stop", "MC_Jog", "MC_Home", "MC_BacklashCompensation", "MC_PositionCorrectionLimiter")
"""Blocks that do something as long as an input is TRUE."""


def _grid(low: int, high: int, step: float) -> SearchStrategy[float]:
    return st.integers(low, high).map(lambda number: round(number * step, 6))


def _names(*members: BufferMode | Direction | HomingMode | JogMode) -> SearchStrategy[str]:
    return st.sampled_from([one.name for one in members])


def block_inputs(masters: Sequence[str] = ()) -> dict[str, Inputs]:
    """Return what is drawn for the parameters of the instructions; one that is None is left out.

    Args:
        masters: Axes that this one may be coupled to; none: it has no instructions of coupled axes.

    """
    position, distance = _grid(-30, 30, 5.0), _grid(-20, 20, 5.0)
    velocity = {"Velocity": st.sampled_from([0.0, 0.5, 40.0, 100.0, 200.0, 400.0])}
    how: dict[str, SearchStrategy[Scalar | None]] = {
        **velocity,
        "Jerk": st.sampled_from([None, None, 20_000.0]),
        "Deceleration": st.sampled_from([None, None, 600.0, 3000.0]),
        "BufferMode": st.one_of(st.none(), _names(*BufferMode)),
    }
    through = {**how, "EndVelocity": st.sampled_from([0.0, 30.0, 150.0])}
    ways = _names(*Direction)
    enables = {
        key: st.sampled_from([True, True, True, False])
        for key in ("Enable", "Enable_Positive", "Enable_Negative")
    }
    known: dict[str, Inputs] = {
        "MC_Power": {**enables, "Override": st.sampled_from([None, None, 0.0, 30.0, 100.0])},
        "MC_SetPosition": {"Position": position, "Mode": st.booleans()},
        "MC_Home": {
            "Position": position,
            "HomingMode": _names(*HomingMode),
            "bCalibrationCam": st.booleans(),
        },
        "MC_MoveAbsolute": {"Position": position, **how},
        "MC_MoveRelative": {"Distance": distance, **how},
        "MC_MoveAdditive": {"Distance": distance, **how},
        "MC_MoveModulo": {"Position": st.sampled_from([0.0, 20.0, 350.0, 380.0]), "Direction": ways, **how},
        "MC_MoveVelocity": {"Direction": ways, **how},
        "MC_MoveContinuousAbsolute": {"Position": position, **through},
        "MC_MoveContinuousRelative": {"Distance": distance, **through},
        "MC_MoveSuperImposed": {"Distance": distance, "VelocityDiff": velocity["Velocity"]},
        "MC_Jog": {
            "JogForward": st.booleans(),
            "JogBackwards": st.booleans(),
            "Mode": _names(*JogMode),
            "Position": _grid(0, 4, 2.5),
            **velocity,
        },
        "MC_ExtSetPointGenEnable": {"Position": position, "PositionType": st.sampled_from([1.0, 2.0])},
        "MC_BacklashCompensation": {"Enable": st.just(True), "Backlash": st.sampled_from([-0.2, 0.5])},
        "MC_PositionCorrectionLimiter": {
            "Enable": st.just(True),
            "PositionCorrectionValue": st.sampled_from([-1.0, 0.5]),
        },
        RELEASE: {"block": st.sampled_from(_PULSES)},
        PACKET: {
            "position": position,
            "velocity": _grid(-10, 10, 10.0),
            "direction": st.integers(-1, 1),
        },
    }
    for name in COMMANDS:
        known.setdefault(name, {})
    if masters:
        known[MC_GearIn.block] = {
            "Master": st.sampled_from(list(masters)),
            "RatioNumerator": st.sampled_from([1.0, 2.0, -1.0, 0.5]),
        }
    else:
        for name in COUPLED:
            del known[name]
    return known


def parameter_values() -> SearchStrategy[dict[str, Scalar]]:
    """Return the parameters of an instruction that writes a parameter of the axis."""
    pairs = [(key, value) for key, values in ONLINE.items() for value in values]
    return st.sampled_from(pairs).map(
        lambda pair: {"key": pair[0], "value": pair[1] if isinstance(pair[1], str) else json.dumps(pair[1])}
    )
