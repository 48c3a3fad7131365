"""The encoder interface Gx: every row of its transition table, every error code, and what holds for any
control words.
"""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from emulators.encoder import AbsoluteEncoder
from emulators.encoder.profidrive import EncoderAbilities, EncoderFormat, EncoderInterface
from fieldbus.errors import ConfigurationError
from fieldbus.profidrive import ENCODER_ERRORS
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
    OPERATING,
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
    measured_before,
)


@pytest.mark.requirement(*sorted({identifier for row in ROWS for identifier in row[0]}))
@pytest.mark.parametrize(
    "row",
    ROWS,
    ids=lambda row: f"{row[0][0]}-{row[1].name}-{row[2].__name__ if row[2] else ''}-{row[3]:04X}",
)
def test_transition(row):
    """From the state, with what happens, the control word leads into the state of the table and shows its
    bits.
    """
    _, before, happens, word, after, zsw = row
    rig = Rig()
    INTO[before](rig)
    assert rig.gx.state is before
    if happens is not None:
        happens(rig)
    rig(word)
    assert rig.gx.state is after
    assert rig.zsw == zsw


TABLE = {(row[1], row[4]) for row in ROWS} | {
    (SD1, SD4),  # PD-155, tested with the whole sequence
    *((state, SD12) for state in OPERATING),
}


@pytest.mark.requirement("PD-151", "PTO-219", "PD-169")
def test_parking_shows_nothing_else():
    """While parking only bit 14 is set and both values are 0, whatever else is requested; it ends in SD1
    (PD-151).
    """
    rig = Rig()
    rig.turn(700)
    rig(ABSOLUTE)
    assert rig.xist1 == 700 * 16
    assert rig.xist2 == 700 * 2
    for _ in range(3):
        rig(PARK | ABSOLUTE | MEASURING)
        assert rig.words == (0x4000, 0, 0)
    rig(ABSOLUTE)
    assert rig.words == (0x4000, 0, 0)
    rig.turn(710)
    rig.stop_waiting()
    rig(ABSOLUTE)
    assert rig.words == (0x2000, 710 * 16, 710 * 2)


@pytest.mark.requirement("PD-168", "PTO-247")
def test_parking_is_shown_for_100_ms():
    """The request is taken back after 4 ms; 100 ms after the beginning parking ends, not one cycle
    earlier.
    """
    rig = Rig()
    rig(PARK)
    began = rig.now
    while rig(0) is SD12:
        assert rig.now - began < 100 * MS
    assert rig.now - began == 100 * MS


@pytest.mark.requirement("PTO-248", "PD-151")
def test_parking_goes_before_an_error():
    """An error and a parking request in the same cycle: parking."""
    rig = Rig()
    rig.gx.set_error(0x0001)
    assert rig(PARK) is SD12


@pytest.mark.requirement("PD-155", "PTO-224", "PD-173", "PD-143", "PD-141", "PD-142")
def test_reference_mark_search():
    """The mark is latched where it is, not where the encoder stands at the next cycle, in the format of
    Gx_XIST1.
    """
    rig = Rig()
    rig(SEARCH)
    assert rig.zsw == 0x0001
    rig.turn(60)
    rig(SEARCH)
    assert rig.zsw == 0x0001
    rig.turn(163)
    rig.turn(190)
    rig(SEARCH)
    assert (rig.gx.state, rig.zsw) == (SD5, 0)
    rig(0)
    assert rig(READ | FUNCTION_1) is SD4
    assert rig.words == (0x0010, 190 * 16, 100 * 16)
    assert rig(0) is SD1
    assert rig.xist2 == 0


def test_second_mark_is_not_taken():
    """Of two marks before the reading the first counts."""
    rig = Rig()
    rig(SEARCH)
    rig.turn(150)
    rig.turn(1150)
    rig(0, READ | FUNCTION_1)
    assert rig.xist2 == 100 * 16


@pytest.mark.requirement("PD-143")
def test_further_reference_marks():
    """Function n searches reference mark n; each has its own value."""
    rig = Rig(reference_marks=4)
    rig(ACTIVATE | 0b1111)
    rig.gx.reference_mark(3, 333)
    rig(0)
    assert rig.zsw == 0b1011
    rig.gx.reference_mark(2, 222)
    rig.gx.reference_mark(4, 444)
    rig.turn(150)
    assert rig(0) is SD1
    for function, place in ((1, 100), (2, 222), (4, 333), (8, 444)):
        assert rig(READ | function) is SD4
        assert (rig.zsw, rig.xist2) == (function << 4, place * 16)
        rig(0)


@pytest.mark.requirement("PD-143", "PD-144", "PTO-250")
@pytest.mark.parametrize(
    ("function", "probe", "up"), [(1, 1, True), (2, 1, False), (4, 2, True), (8, 2, False)]
)
def test_each_measuring_function(function, probe, up):
    """Functions 1 to 4 are the rising and falling edge of probe 1 and 2: each takes its edge alone, once."""
    rig = Rig()
    rig(MEASURE | ACTIVATE | function)
    for other in (1, 2):
        for rise in (True, False):
            if (other, rise) != (probe, up):
                rig.edge(1, probe=other, rising=rise)
    rig(MEASURE | ACTIVATE | function)
    assert rig.zsw & 0xFF == function
    rig.edge(4321, probe=probe, rising=up)
    rig.edge(5000, probe=probe, rising=up)
    rig(MEASURE | ACTIVATE | function)
    assert rig.zsw & 0xFF == 0
    rig(MEASURE | READ | function)
    assert rig.zsw & 0xFF == function << 4
    assert rig.xist2 == 4321 * 16


def test_probe_levels():
    """Bits 8 and 9 show the levels of the probes in the mode of measurement, and in that mode alone."""
    rig = Rig()
    rig.edge(probe=2)
    rig(MEASURE)
    assert rig.zsw == 0x0200
    rig.edge(probe=1)
    rig(MEASURE)
    assert rig.zsw == 0x0300
    rig(0)
    assert rig.zsw == 0
    rig.edge(probe=2, rising=False)
    rig(MEASURE)
    assert rig.zsw == 0x0100


@pytest.mark.requirement("PTO-249")
def test_new_activation_forgets():
    """A value that was found and not read is gone when its function is activated again."""
    rig = Rig()
    measured_before(rig)
    rig(MEASURE | ACTIVATE | FUNCTION_1)
    assert rig(MEASURE | READ | FUNCTION_1) is SD10
    assert rig(MEASURE | READ | FUNCTION_2) is SD11
    assert rig.xist2 == 9 * 16


@pytest.mark.requirement("PD-145", "PD-146", "PD-171")
def test_home_position():
    """Set makes the absolute value the home position, shift adds it, once per request; Gx_XIST1 goes on as it
    was.
    """
    rig = Rig()
    rig.turn(700)
    rig.gx.home_steps = 5000
    rig(HOME | ABSOLUTE, HOME | ABSOLUTE)
    assert rig.words == (0x3000, 700 * 16, 5000 * 2)
    rig(ABSOLUTE)
    rig.turn(720)
    rig(HOME | SHIFT | ABSOLUTE, HOME | SHIFT | ABSOLUTE)
    assert rig.words == (0x3000, 720 * 16, 10020 * 2)
    rig(ABSOLUTE)
    rig(HOME | SHIFT | ABSOLUTE)
    assert rig.xist2 == 15020 * 2
    rig(ABSOLUTE, HOME | SHIFT | ABSOLUTE)
    assert rig.xist2 == 4020 * 2  # 16 turns of 1000 steps are the range


@pytest.mark.requirement("PD-171")
def test_preset_of_the_encoder_profile():
    """In the encoder profile the preset moves Gx_XIST1 as well."""
    rig = Rig(preset_counter=True)
    rig.turn(700)
    rig.gx.home_steps = 40
    rig(HOME)
    assert rig.xist1 == 40 * 16
    rig(0)
    rig.turn(701)
    rig(HOME | SHIFT)
    assert rig.xist1 == 81 * 16


@pytest.mark.requirement("PD-147", "PD-169", "PTO-250")
def test_priority_of_xist2():
    """Parking before error before a latched value before the absolute value."""
    rig = Rig()
    rig.turn(150)
    rig(ABSOLUTE)
    assert rig.words == (0x2000, 150 * 16, 300)
    rig(ABSOLUTE | MEASURING)
    assert (rig.zsw, rig.xist2) == (0x2003, 300)
    rig.edge(7)
    rig(ABSOLUTE | MEASURE | READ | FUNCTION_1)
    assert (rig.zsw, rig.xist2) == (0x0112, 7 * 16)
    rig.gx.report(0x1001)
    rig(ABSOLUTE | MEASURE | READ | FUNCTION_1)
    assert (rig.zsw, rig.xist2) == (0x8000, 0x1001)
    rig(ABSOLUTE | ACKNOWLEDGE)
    assert (rig.zsw, rig.xist2) == (0x0800, 0)
    rig(PARK | ABSOLUTE)
    assert rig.words == (0x4000, 0, 0)


@pytest.mark.requirement("PD-150", "PD-170")
def test_absolute_value_before_communication():
    """The absolute value can be there before the first control word; afterwards bit 13 follows the
    request.
    """
    encoder = AbsoluteEncoder(turns=16, counts_per_revolution=1000)
    encoder.power_on(0.77 * math.tau)
    form = EncoderFormat(periods=1000, shift_xist1=4, shift_xist2=1, revolutions=16)
    gx = EncoderInterface(encoder, form, EncoderAbilities(absolute_at_start=True))
    assert gx.words() == (0x2000, 0, 770 * 2)
    assert gx.step(0, 0) == (0, 0, 0)
    assert EncoderInterface(encoder, form).words() == (0, 0, 0)


# -- errors --------------------------------------------------------------------------------------------------

LEADS_TO = {0x0003: PARK, 0x0008: ABSOLUTE, 0x000A: ABSOLUTE}
ABORTS = {0x0004: SD5, 0x0005: SD4, 0x0006: SD10, 0x0007: SD11}
HOLDS = {SD4: READ | FUNCTION_1, SD5: SEARCH, SD10: MEASURING, SD11: MEASURE | READ | FUNCTION_1}


@pytest.mark.requirement(
    *(f"PD-{number}" for number in range(175, 187)), "PTO-198", "PTO-200", "PTO-243", "PTO-262"
)
@pytest.mark.parametrize("code", ENCODER_ERRORS, ids=lambda code: f"{code:04X}h")
def test_lasting_fault(code):
    """Every code: it comes where its cause matters, stays through an acknowledgement with the cause, and goes
    without.
    """
    rig = Rig()
    if code not in ABORTS:
        rig.turn(150)
    word = LEADS_TO.get(code, 0)
    state = ABORTS.get(code, SD1)
    INTO[state](rig)
    word |= HOLDS.get(state, 0)
    rig.gx.set_error(code)
    if code in LEADS_TO:
        assert rig(0) is SD1
    assert rig(word) is SD3
    assert (rig.zsw, rig.xist2) == (0x8000, code)
    if code in ABORTS:  # the function has ended, and so has what aborted it
        assert rig(word | ACKNOWLEDGE) is SD2
        assert (rig.zsw, rig.xist2) == (0x0800, 0)
        return
    if code == 0x0001:  # without a valid position nothing can be acknowledged
        assert rig(word | ACKNOWLEDGE) is SD3
    else:
        assert rig(word | ACKNOWLEDGE) is SD2
        assert (rig.zsw, rig.xist2) == (0x8800, code)
        assert rig(word) is SD3
        assert (rig.zsw, rig.xist2) == (0x8000, code)
    rig.gx.clear_error(code)
    assert rig(0) is SD3
    assert rig.xist2 == code
    assert rig(ACKNOWLEDGE) is SD2
    assert (rig.zsw, rig.xist2) == (0x0800, 0)
    assert rig(0) is SD1
    assert rig.words == (0, 150 * 16, 0)


@pytest.mark.requirement("PTO-201")
@pytest.mark.parametrize("code", ENCODER_ERRORS, ids=lambda code: f"{code:04X}h")
def test_reported_once(code):
    """An error without a lasting cause is shown until it is acknowledged; a second one meanwhile changes
    nothing.
    """
    rig = Rig()
    rig.gx.report(code)
    rig(0)
    assert (rig.zsw, rig.xist2) == (0x8000, code)
    rig.gx.report(0x0F02 if code != 0x0F02 else 0x0002)
    rig(0)
    assert rig.xist2 == code
    rig(ACKNOWLEDGE)
    assert (rig.zsw, rig.xist2) == (0x0800, 0)
    assert rig(0) is SD1


def test_unknown_code_is_refused():
    """Only codes of the profile can be brought about; the message lists them."""
    with pytest.raises(ConfigurationError, match="0F02h"):
        Rig().gx.set_error(0x0042)
    with pytest.raises(ConfigurationError, match="0F02h"):
        Rig().gx.report(0x0042)


ABORTING = [
    ("PTO-172", SD5, SEARCH | FUNCTION_2, 0x0004),
    ("PTO-173", SD5, SEARCH | MEASURE, 0x0004),
    ("PTO-174", SD4, READ | FUNCTION_1 | MEASURE, 0x0005),
    ("PTO-179", SD10, MEASURING | FUNCTION_3, 0x0006),
    ("PTO-179", SD10, MEASURING & ~MEASURE, 0x0006),
    ("PTO-180", SD11, READ | FUNCTION_1, 0x0007),
    ("PTO-077", SD1, ACTIVATE | FUNCTION_2, 0x0004),
    ("PTO-078", SD1, ACTIVATE | FUNCTION_3, 0x0004),
    ("PTO-079", SD1, ACTIVATE | FUNCTION_4, 0x0004),
    ("PTO-078", SD1, MEASURE | ACTIVATE | FUNCTION_3, 0x0006),
    ("PTO-079", SD1, MEASURE | ACTIVATE | FUNCTION_4, 0x0006),
    ("PTO-083", SD1, SHIFT, 0x0F01),
    ("PTO-084", SD1, HOME, 0x0F01),
    ("PTO-085", SD1, ABSOLUTE, 0x0008),
    ("PTO-134", SD1, PARK, 0x0003),
    ("PTO-176", SD1, 0x40, 0x0F01),
]


@pytest.mark.requirement("PD-187", *sorted({row[0] for row in ABORTING}))
@pytest.mark.parametrize("row", ABORTING, ids=lambda row: f"{row[0]}-{row[1].name}-{row[2]:04X}")
def test_unsupported_or_aborted(row):
    """With one mark, one probe and nothing else, what is not supported and what contradicts a running
    function is an error.
    """
    _, state, word, code = row
    rig = Rig(incremental=True, measuring=2, home=False, parking=False)
    INTO[state](rig)
    assert rig.gx.state is state
    assert rig(word) is SD3
    assert (rig.zsw, rig.xist2) == (0x8000, code)


@pytest.mark.requirement("PD-187", "PTO-189", "PTO-191", "PTO-192", "PTO-193", "PTO-194")
@pytest.mark.parametrize(("state", "code"), [(SD5, 4), (SD4, 5), (SD10, 6), (SD11, 7), (SD1, 0), (SD7, 0)])
def test_controller_stops(state, code):
    """A stop of the controller ends what runs with the error of the phase; where nothing runs, nothing
    happens.
    """
    rig = Rig()
    INTO[state](rig)
    rig.gx.abort()
    rig(HOLDS.get(state, HOME if state is SD7 else 0))
    assert rig.gx.error == code
    assert (rig.gx.state is SD3) is bool(code)


@pytest.mark.requirement("PD-176")
def test_zero_mark_monitoring():
    """Lost increments between two zero marks are found with the second mark."""
    rig = Rig(zero_mark_tolerance=2)
    for place in (500, 1500, 2500, 1900, 2600):
        rig.turn(place)
        assert rig(0) is SD1
    rig.encoder.lose_steps(100)
    rig.turn(3500)
    assert rig(0) is SD3
    assert rig.xist2 == 0x0002


# -- any control word ----------------------------------------------------------------------------------

WORDS = st.one_of(
    st.integers(0, 0xFFFF),
    st.builds(
        lambda functions, command, measure, rest: functions | command << 4 | measure << 7 | rest,
        st.integers(0, 15),
        st.integers(0, 4),
        st.integers(0, 1),
        st.sampled_from([0, 0, 0, HOME, ABSOLUTE, PARK, ACKNOWLEDGE]),
    ),
)
STEPS = st.lists(
    st.tuples(
        WORDS,
        st.integers(-1500, 1500),
        st.sampled_from([None, (1, True), (1, False), (2, True), (2, False), 1, 2, 0x1001, -1, -2, -0x1001]),
        st.sampled_from([4 * MS, 60 * MS]),
    ),
    max_size=60,
)


def allowed(before, after):
    return before is after or (before, after) in TABLE


@pytest.mark.exhaustive
@pytest.mark.requirement(
    "PTO-211", "PTO-212", "PTO-213", "PTO-214", "PTO-215", "PTO-216", "PTO-217", "PTO-218", "PTO-313"
)
@given(STEPS)
def test_any_sequence(steps):
    """Only transitions of the table; the bits say the state; an error code if and only if bit 15 or 11;
    Gx_XIST1 continuous.
    """
    rig = Rig(start=0xFFFF_FF00)
    place = home = 0
    for word, way, event, time in steps:
        before = rig.gx.state
        place += way
        rig.turn(place)
        if isinstance(event, tuple):
            rig.edge(place, probe=event[0], rising=event[1])
        elif event is not None:
            (rig.gx.set_error if event > 0 else rig.gx.clear_error)(abs(event))
        rig.now += time
        zsw, xist1, xist2 = rig.words = rig.gx.step(word, rig.now)
        state = rig.gx.state
        assert allowed(before, state)
        assert bool(zsw & 0x4000) is (state is SD12)
        assert bool(zsw & 0x0800) is (state is SD2)
        assert bool(zsw & 0x1000) is (state is SD7)
        assert bool(zsw & 0x00F0) is (state in {SD4, SD11})
        assert zsw & 0x0400 == 0
        if state is SD3:
            assert zsw == 0x8000
        elif state is not SD2:
            assert not zsw & 0x8000
        if zsw & 0x8000:
            assert xist2 in ENCODER_ERRORS
        if zsw & 0x000F:
            assert state in {SD5, SD10, SD11}
        if state is SD12:
            assert zsw == 0x4000
            assert xist1 == xist2 == 0
        elif rig.gx.valid:
            assert xist1 == ((place * 16 - 0x100 + 0x8000_0000) % 0x1_0000_0000) - 0x8000_0000
        if state is SD7 and before is not SD7 and not word & 0x0800:
            home = -place  # the home position 0 has been set here
        if zsw & 0x2000:
            assert xist2 == (place + home) % 16000 * 2
        elif state in {SD1, SD5, SD7, SD10}:
            assert xist2 == 0
