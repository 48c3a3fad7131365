"""The encoder interface Gx with an encoder and a clock, and its transition table row by row."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final

from emulators.encoder import AbsoluteEncoder, IncrementalEncoder
from emulators.encoder.profidrive import EncoderAbilities, EncoderFormat, EncoderInterface, EncoderState

MS = 1_000_000
SD1, SD2, SD3, SD4, SD5, SD7, SD10, SD11, SD12 = EncoderState
FUNCTION_1, FUNCTION_2, FUNCTION_3, FUNCTION_4 = 1, 2, 4, 8
ACTIVATE, READ, CANCEL = 0x10, 0x20, 0x30
MEASURE = 0x80
SHIFT, HOME, ABSOLUTE, PARK, ACKNOWLEDGE = 0x800, 0x1000, 0x2000, 0x4000, 0x8000
SEARCH = ACTIVATE | FUNCTION_1
MEASURING = MEASURE | ACTIVATE | FUNCTION_1 | FUNCTION_2


class Rig:
    """An interface with an absolute multi-turn encoder of 1000 steps, and the time in cycles of 4 ms."""

    def __init__(self, *, start: int = 0, incremental: bool = False, **abilities: Any) -> None:
        self.encoder: AbsoluteEncoder | IncrementalEncoder = (
            IncrementalEncoder(counts_per_revolution=1000, zero_mark_counts=100)
            if incremental
            else AbsoluteEncoder(turns=16, counts_per_revolution=1000, zero_mark_counts=100)
        )
        self.form = EncoderFormat(
            periods=1000,
            shift_xist1=4,
            shift_xist2=1,
            revolutions=0 if incremental else 16,
            start_value=start,
        )
        self.gx = EncoderInterface(self.encoder, self.form, EncoderAbilities(**abilities))
        self.now = 0
        self.words = self.gx.words()

    def __call__(self, *words: int) -> EncoderState:
        """Step with control words; returns the last state."""
        for word in words:
            self.now += 4 * MS
            self.words = self.gx.step(word, self.now)
        return self.gx.state

    @property
    def zsw(self) -> int:
        return self.words[0]

    @property
    def xist1(self) -> int:
        return self.words[1]

    @property
    def xist2(self) -> int:
        return self.words[2]

    def turn(self, steps: float) -> None:
        """Turn to a place, steps; the zero mark at 100 is passed on the way."""
        self.encoder.sample(steps * math.tau / 1000)

    def edge(self, steps: int = 7, *, probe: int = 1, rising: bool = True) -> None:
        self.gx.probe_edge(probe, rising, steps)

    def stop_waiting(self) -> None:
        """Let 100 ms pass with the last word."""
        self.now += 100 * MS


def normal(_: Rig) -> None:
    """Nothing: it begins there."""


def acknowledging(rig: Rig) -> None:
    rig.gx.report(0x1001)
    rig(0, ACKNOWLEDGE)


def failed(rig: Rig) -> None:
    rig.gx.report(0x1001)
    rig(0)


def reference_shown(rig: Rig) -> None:
    waiting_for_mark(rig)
    rig.turn(150)
    rig(0, READ | FUNCTION_1)


def waiting_for_mark(rig: Rig) -> None:
    rig(SEARCH)


def homing(rig: Rig) -> None:
    rig(HOME)


def measuring(rig: Rig) -> None:
    rig(MEASURING)


def measured_shown(rig: Rig) -> None:
    measuring(rig)
    rig.edge()
    rig(MEASURE | READ | FUNCTION_1)


def parked(rig: Rig) -> None:
    rig(PARK)


INTO: Final[dict[EncoderState, Callable[[Rig], None]]] = {
    SD1: normal,
    SD2: acknowledging,
    SD3: failed,
    SD4: reference_shown,
    SD5: waiting_for_mark,
    SD7: homing,
    SD10: measuring,
    SD11: measured_shown,
    SD12: parked,
}
OPERATING = (SD1, SD4, SD5, SD7, SD10, SD11)


def find_mark(rig: Rig) -> None:
    rig.turn(150)


def rising(rig: Rig) -> None:
    rig.edge()


def both_edges(rig: Rig) -> None:
    rig.edge()
    rig.edge(9, rising=False)


def falling(rig: Rig) -> None:
    rig.edge(9, rising=False)


def broken(rig: Rig) -> None:
    rig.gx.set_error(0x0001)


def broken_code_only(rig: Rig) -> None:
    rig.gx.set_error(0x0002)


def invalid(rig: Rig) -> None:
    rig.gx.valid = False


def wait(rig: Rig) -> None:
    rig.stop_waiting()


def measured_before(rig: Rig) -> None:
    rig(MEASURING)
    both_edges(rig)
    rig(MEASURE)


# Row: identifiers, from, what happens before, control word, to, Gx_ZSW there.
Row = tuple[tuple[str, ...], EncoderState, Callable[[Rig], None] | None, int, EncoderState, int]
ROWS: Final[list[Row]] = [
    *((("PD-151", "PTO-222"), state, None, PARK, SD12, 0x4000) for state in OPERATING),
    *((("PD-152", "PTO-223"), state, broken, 0, SD3, 0x8000) for state in OPERATING),
    *(
        (("PD-152", "PTO-223", "PTO-245"), state, None, command << 4, SD3, 0x8000)
        for state in OPERATING
        for command in (4, 5, 6, 7)
    ),
    (("PD-153", "PTO-226"), SD1, None, SEARCH, SD5, 0x0001),
    (("PD-153",), SD1, None, ACTIVATE, SD1, 0),
    (("PD-154", "PTO-227"), SD5, find_mark, 0, SD1, 0),
    (("PD-154", "PTO-227"), SD5, None, 0, SD5, 0x0001),
    (("PD-154", "PTO-246"), SD5, find_mark, SEARCH, SD5, 0),
    (("PD-154", "PTO-228"), SD5, None, CANCEL | FUNCTION_1, SD1, 0),
    (("PD-155",), SD1, None, READ | FUNCTION_1, SD1, 0),
    (("PD-156", "PTO-225"), SD4, None, 0, SD1, 0),
    (("PD-156",), SD4, None, READ | FUNCTION_1, SD4, 0x0010),
    (("PD-157", "PTO-230"), SD1, None, MEASURING, SD10, 0x0003),
    (("PD-158", "PTO-231"), SD10, None, MEASURE | CANCEL, SD1, 0),
    (("PD-158", "PTO-232"), SD10, both_edges, MEASURE, SD1, 0),
    (("PD-158", "PTO-232"), SD10, rising, MEASURE, SD10, 0x0102),
    (("PTO-235",), SD10, both_edges, MEASURE | ACTIVATE | FUNCTION_3, SD10, 0x0004),
    (("PD-159", "PTO-236"), SD10, rising, MEASURE | READ | FUNCTION_1, SD11, 0x0112),
    (("PD-159", "PTO-236"), SD10, falling, MEASURE | READ | FUNCTION_2, SD11, 0x0021),
    (("PD-159",), SD10, falling, MEASURE | READ | FUNCTION_1, SD10, 0x0001),
    (("PD-159", "PTO-233"), SD1, measured_before, MEASURE | READ | FUNCTION_2, SD11, 0x0020),
    (("PD-160", "PTO-234"), SD11, falling, MEASURE, SD1, 0),
    (("PD-160", "PTO-234"), SD11, None, MEASURE | CANCEL, SD1, 0x0100),
    (("PD-161", "PTO-237"), SD11, None, MEASURE, SD10, 0x0102),
    (("PD-161", "PTO-237"), SD11, None, MEASURE | ACTIVATE | FUNCTION_3, SD10, 0x0106),
    (("PTO-238",), SD11, falling, MEASURE | READ | FUNCTION_2, SD11, 0x0020),
    (("PD-162", "PTO-229"), SD1, None, HOME, SD7, 0x1000),
    (("PD-162", "PTO-229"), SD1, None, HOME | SHIFT, SD7, 0x1000),
    (("PD-163", "PTO-229"), SD7, None, 0, SD1, 0),
    (("PD-163",), SD7, None, HOME, SD7, 0x1000),
    (("PD-164", "PTO-239"), SD3, None, ACKNOWLEDGE, SD2, 0x0800),
    (("PD-164", "PTO-239"), SD3, broken_code_only, ACKNOWLEDGE, SD2, 0x8800),
    (("PTO-244",), SD3, invalid, ACKNOWLEDGE, SD3, 0x8000),
    (("PD-165", "PTO-240"), SD2, None, 0, SD1, 0),
    (("PD-165",), SD2, None, ACKNOWLEDGE, SD2, 0x0800),
    (("PD-166", "PTO-241"), SD2, broken_code_only, 0, SD3, 0x8000),
    (("PD-167", "PTO-242"), SD2, None, PARK, SD12, 0x4000),
    (("PD-167", "PTO-242"), SD3, None, PARK, SD12, 0x4000),
    (("PD-167", "PTO-242"), SD2, invalid, 0, SD12, 0x4000),
    (("PD-167", "PTO-242"), SD3, invalid, 0, SD12, 0x4000),
    (("PD-168", "PTO-243"), SD12, wait, 0, SD1, 0),
    (("PD-168", "PTO-243"), SD12, wait, PARK, SD12, 0x4000),
    (("PD-168", "PTO-247"), SD12, None, 0, SD12, 0x4000),
]
