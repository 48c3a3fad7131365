"""Stop envelopes: a motion is run once, and at every cycle of it the bench is copied and broken.

`sweep` runs a motion, forks the process at the end of every application cycle, applies a fault, stop or
operator action in the copy, lets the copy run on, and measures: stop distance, stop time, overshoot, peak
torque, reaction time, and what the reaction was. The result is an `Envelope`: a table over instant and
stimulus, its worst points, and the instants between which the reaction changes.
"""

from __future__ import annotations

from hil.envelope._actions import ACTIONS
from hil.envelope._adaptive import Grid
from hil.envelope._branching import Witness
from hil.envelope._measures import MEASURES, Measure
from hil.envelope._motion import Motion, motion_of, move_absolute, own_motion
from hil.envelope._replay import replay_branch
from hil.envelope._result import (
    Branch,
    Cliff,
    Envelope,
    EnvelopeDifference,
    Margin,
    load_envelope,
    parquet_library,
)
from hil.envelope._stimulus import Stimulus, stimulus_from_text
from hil.envelope._sweep import sweep, witness

__all__ = [
    "ACTIONS",
    "MEASURES",
    "Branch",
    "Cliff",
    "Envelope",
    "EnvelopeDifference",
    "Grid",
    "Margin",
    "Measure",
    "Motion",
    "Stimulus",
    "Witness",
    "load_envelope",
    "motion_of",
    "move_absolute",
    "own_motion",
    "parquet_library",
    "replay_branch",
    "stimulus_from_text",
    "sweep",
    "witness",
]
