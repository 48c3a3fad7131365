"""The encoder interface Gx row by row of its transition table, with every error code, parking, home positions
and the formats of its words.
"""

from __future__ import annotations

from typing import Final

from fieldbus.profidrive import ENCODER_ERRORS
from hil.campaign import Campaign, CaseContext
from testcases.campaigns._encoder_rows import (
    ABSOLUTE,
    ACKNOWLEDGE,
    ACTIVATE,
    FUNCTION_1,
    FUNCTION_2,
    FUNCTION_3,
    FUNCTION_4,
    HOME,
    INTO,
    MEASURE,
    MEASURING,
    MS,
    PARK,
    READ,
    ROWS,
    SD1,
    SD2,
    SD3,
    SD4,
    SD5,
    SD7,
    SD10,
    SD11,
    SD12,
    SEARCH,
    SHIFT,
    Rig,
)
from testcases.campaigns.support import equal, same

CAMPAIGN: Final = Campaign(
    "encoder states", controller="", tags=("encoder", "telegram"), bench="testcases.campaigns.can_bus:BENCH"
)
_IN: Final = {0x0003: PARK, 0x0008: ABSOLUTE, 0x000A: ABSOLUTE}
"""Control words in which lasting errors show; the others show at once or in a state."""
_WITH: Final = {0x0004: SD5, 0x0005: SD4, 0x0006: SD10, 0x0007: SD11}
"""States that these errors abort."""


@CAMPAIGN.case(
    "transitions", requirements=tuple(sorted({one for row in ROWS for one in row[0] if one[:2] == "PD"}))
)
def transitions(ctx: CaseContext) -> None:
    """From each state, with what happens, each control word leads where the table says and shows its bits."""
    for ids, before, happens, word, after, zsw in ROWS:
        rig = Rig()
        INTO[before](rig)
        what = f"{before.name} with {word:04X}h{'' if happens is None else f' after {happens.__name__}'}"
        same(ctx, f"state before {what}", rig.gx.state, before)
        if happens is not None:
            happens(rig)
        rig(word)
        same(ctx, f"state after {what}", rig.gx.state, after, *ids)
        same(ctx, f"Gx_ZSW after {what}", rig.zsw, zsw, *ids)


@CAMPAIGN.case("parking", requirements=("PD-151", "PD-168", "PD-169"))
def parking(ctx: CaseContext) -> None:
    """While it parks nothing but bit 14 is shown; it lasts 100 ms at least, not a cycle longer, and goes
    before an error.
    """
    rig = Rig()
    rig.turn(700)
    rig(ABSOLUTE)
    same(ctx, "words", rig.words, (0x2000, 700 * 16, 700 * 2), "PD-169")
    for word in (PARK | ABSOLUTE | MEASURING, PARK | HOME, PARK | ACKNOWLEDGE | SEARCH):
        rig(word)
        same(ctx, "words while parking", rig.words, (0x4000, 0, 0), "PD-151")
    rig = Rig()
    rig(PARK)
    began = rig.now
    while rig(0) is SD12:
        pass
    equal(ctx, "time of parking, ms", (rig.now - began) / MS, 100, "PD-168")
    rig = Rig()
    rig.gx.set_error(0x0001)
    same(ctx, "state", rig(PARK), SD12, "PD-151")


@CAMPAIGN.case("marks", requirements=("PD-141", "PD-142", "PD-143", "PD-155", "PD-173"))
def marks(ctx: CaseContext) -> None:
    """A zero mark is latched where it is, in the format of Gx_XIST1, the first of two; further marks have a
    value each.
    """
    for first, last, counter in ((60, 150, 150), (50, 1150, 1150), (90, 101, 101)):
        rig = Rig()
        rig.turn(first)
        rig(SEARCH)
        same(ctx, "Gx_ZSW while it searches", rig.zsw, 0x0001, "PD-141")
        rig.turn(last)
        rig(SEARCH)
        same(ctx, "state and Gx_ZSW behind the mark", (rig.gx.state, rig.zsw), (SD5, 0), "PD-142")
        rig(0)
        rig(READ | FUNCTION_1)
        same(ctx, "words", rig.words, (0x0010, counter * 16, 100 * 16), "PD-173")
        rig(0)
        same(ctx, "value afterwards", (rig.gx.state, rig.xist2), (SD1, 0), "PD-142")
    rig = Rig()
    rig.turn(60)
    rig(SEARCH)
    rig.turn(99)
    rig(SEARCH)
    same(ctx, "Gx_ZSW before the mark", rig.zsw, 0x0001, "PD-141")
    rig = Rig(reference_marks=4)
    functions = (FUNCTION_1, FUNCTION_2, FUNCTION_3, FUNCTION_4)
    rig(ACTIVATE | sum(functions))
    same(ctx, "four searches", rig.zsw, 0x000F, "PD-143")
    for number, function in enumerate(functions[1:], 2):
        rig.gx.reference_mark(number, 10 * number)
        rig(ACTIVATE | sum(functions))
        equal(ctx, f"search {number} is over", rig.zsw & function, 0, "PD-143")
    rig.turn(150)
    rig(ACTIVATE | sum(functions))
    rig(0)
    for number, function in enumerate(functions, 1):
        rig(READ | function)
        value = 100 if number == 1 else 10 * number
        same(ctx, f"value {number}", rig.words[::2], (function << 4, value * 16), "PD-143")
        rig(0)


@CAMPAIGN.case("probes", requirements=("PD-157", "PD-158", "PD-159", "PD-173"))
def probes(ctx: CaseContext) -> None:
    """Each edge of either probe has its function and its value; the levels have their bits; an edge that
    nobody waits for is none.
    """
    rig = Rig()
    for number, place in ((1, 11), (2, 22)):
        rig.edge(place, probe=number)
        rig(MEASURE)
    same(ctx, "Gx_ZSW with both levels", rig.zsw, 0x0300)
    for number in (1, 2):
        rig.edge(5, probe=number, rising=False)
    rig(MEASURE)
    same(ctx, "Gx_ZSW without them", rig.zsw, 0)
    functions = {(1, True): FUNCTION_1, (1, False): FUNCTION_2, (2, True): FUNCTION_3, (2, False): FUNCTION_4}
    rig(MEASURE | ACTIVATE | sum(functions.values()))
    same(ctx, "four functions", rig.zsw & 0xFF, 0x0F, "PD-157")
    left = 0x0F
    for place, ((number, rising), function) in enumerate(functions.items(), 31):
        rig.edge(place, probe=number, rising=rising)
        rig(MEASURE | ACTIVATE | sum(functions.values()))
        left &= ~function
        equal(ctx, "functions that wait", rig.zsw & 0x0F, left, "PD-158")
        rig.edge(99, probe=number, rising=rising)
    for place, function in enumerate(functions.values(), 31):
        rig(MEASURE | READ | function)
        same(ctx, "state", rig.gx.state, SD11, "PD-159")
        same(ctx, "bit and value", (rig.zsw & 0xF0, rig.xist2), (function << 4, place * 16), "PD-159")
    rig(MEASURE)
    same(ctx, "state in the end", rig.gx.state, SD1, "PD-158")


@CAMPAIGN.case("errors", requirements=("PD-152", "PD-164", "PD-165", "PD-166", "PD-169"))
def errors(ctx: CaseContext) -> None:
    """Each code that happens once, and each that lasts: shown until it is acknowledged, and again while its
    cause lasts.
    """
    for code in ENCODER_ERRORS:
        rig = Rig()
        rig.gx.report(code)
        rig(0)
        same(
            ctx, f"words with {code:04X}h", (rig.gx.state, rig.zsw, rig.xist2), (SD3, 0x8000, code), "PD-169"
        )
        rig(0, 0, ABSOLUTE)
        same(ctx, "words later", (rig.zsw & 0x8000, rig.xist2), (0x8000, code), "PD-152")
        rig(ACKNOWLEDGE)
        same(ctx, "acknowledging", (rig.gx.state, rig.zsw, rig.xist2), (SD2, 0x0800, 0), "PD-164")
        rig(0)
        same(ctx, "acknowledged", (rig.gx.state, rig.zsw, rig.xist2), (SD1, 0, 0), "PD-165")
    for code in ENCODER_ERRORS:
        rig = Rig()
        if code in _WITH:
            INTO[_WITH[code]](rig)
        rig.gx.set_error(code)
        word = _IN.get(code, 0)
        rig(word)
        same(
            ctx, f"words with {code:04X}h that lasts", (rig.zsw & 0x8000, rig.xist2), (0x8000, code), "PD-152"
        )
        if code in _WITH or code == 0x0001:
            continue
        rig(ACKNOWLEDGE | word)
        same(ctx, "acknowledging", (rig.gx.state, rig.zsw & 0x8800), (SD2, 0x8800), "PD-164")
        rig(word)
        same(ctx, "again", (rig.gx.state, rig.xist2), (SD3, code), "PD-166")
        rig.gx.clear_error(code)
        rig(ACKNOWLEDGE, 0)
        same(ctx, "without its cause", (rig.gx.state, rig.zsw), (SD1, 0), "PD-165")


@CAMPAIGN.case("home", requirements=("PD-162", "PD-163", "PD-171"))
def home(ctx: CaseContext) -> None:
    """Bit 12 sets the position or, with bit 11, shifts it, once for each edge; the counter follows only where
    it is asked to.
    """
    for counter in (False, True):
        for word, wanted in ((HOME, 250), (HOME | SHIFT, 700 + 250)):
            rig = Rig(preset_counter=counter)
            rig.turn(700)
            rig(ABSOLUTE)
            rig.gx.home_steps = 250
            rig(word | ABSOLUTE)
            same(ctx, "state", rig.gx.state, SD7, "PD-162")
            rig(word | ABSOLUTE, ABSOLUTE)
            same(ctx, "absolute value", rig.words[::2], (0x2000, wanted * 2), "PD-162")
            equal(ctx, "counter", rig.xist1, (wanted if counter else 700) * 16, "PD-171")
            rig.turn(710)
            rig(ABSOLUTE)
            equal(ctx, "absolute value later", rig.xist2, (wanted + 10) * 2, "PD-162")
    same(ctx, "state of one that cannot", Rig(home=False)(HOME), SD3, "PD-162")
    same(ctx, "state of an incremental one", Rig(incremental=True)(HOME), SD3, "PD-162")


@CAMPAIGN.case("counter", requirements=("PD-171", "PD-172", "PD-173"))
def counter(ctx: CaseContext) -> None:
    """Gx_XIST1 goes on over the range of the encoder and its own 32 bits; Gx_XIST2 wraps with the encoder."""
    rig = Rig()
    for place in (0, 400, 800, 15_600, 15_999, 16_300):
        for step in range(0, place, 400):
            rig.turn(step)
            rig(ABSOLUTE)
        rig.turn(place)
        rig(ABSOLUTE)
        equal(ctx, f"Gx_XIST2 at {place}", rig.xist2, place % 16_000 * 2, "PD-173")
    before = rig.xist1
    rig.turn(16_400)
    rig(ABSOLUTE)
    equal(ctx, "Gx_XIST1 goes on", rig.xist1 - before, 100 * 16, "PD-171")
    shown = Rig(incremental=True)(ABSOLUTE)
    same(ctx, "state of an incremental one that is asked for an absolute value", shown, SD3, "PD-152")
