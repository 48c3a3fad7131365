"""Telegram layouts against the word tables of the specification, and the codec by its properties."""

from __future__ import annotations

import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fieldbus.profidrive import (
    NUMBERS,
    SIGNALS,
    STW1,
    WITH_750,
    Layout,
    TelegramError,
    describe_word,
    free_telegram,
    pto_telegram,
    telegram,
)
from testcases.catalogue import each

D = "double word"
W = "word"

# Words of both directions as the tables print them: (signal, width), in order.
ENCODER_1 = [("G1_ZSW", W), ("G1_XIST1", D), ("G1_XIST2", D)]
ENCODER_2 = [("G2_ZSW", W), ("G2_XIST1", D), ("G2_XIST2", D)]
OUT_2 = [("STW1", W), ("NSOLL_B", D), ("STW2", W)]
IN_2 = [("ZSW1", W), ("NIST_B", D), ("ZSW2", W)]
OUT_102 = [*OUT_2, ("MOMRED", W), ("G1_STW", W)]
IN_102 = [*IN_2, ("MELDW", W), *ENCODER_1]
DSC = [("XERR", D), ("KPC", D)]
MDI = [("MDI_TARPOS", D), ("MDI_VELOCITY", D), ("MDI_ACC", W), ("MDI_DEC", W)]
WORDS = {
    1: ([("STW1", W), ("NSOLL_A", W)], [("ZSW1", W), ("NIST_A", W)]),
    2: (OUT_2, IN_2),
    3: ([*OUT_2, ("G1_STW", W)], [*IN_2, *ENCODER_1]),
    4: ([*OUT_2, ("G1_STW", W), ("G2_STW", W)], [*IN_2, *ENCODER_1, *ENCODER_2]),
    5: ([*OUT_2, ("G1_STW", W), *DSC], [*IN_2, *ENCODER_1]),
    6: ([*OUT_2, ("G1_STW", W), ("G2_STW", W), *DSC], [*IN_2, *ENCODER_1, *ENCODER_2]),
    7: ([("STW1", W), ("SATZANW", W)], [("ZSW1", W), ("AKTSATZ", W)]),
    9: (
        [("STW1", W), ("SATZANW", W), ("STW2", W), *MDI, ("MDI_MOD", W)],
        [("ZSW1", W), ("AKTSATZ", W), ("ZSW2", W), ("XIST_A", D)],
    ),
    102: (OUT_102, IN_102),
    103: ([*OUT_102, ("G2_STW", W)], [*IN_102, *ENCODER_2]),
    105: ([*OUT_102, *DSC], IN_102),
    106: ([*OUT_102, ("G2_STW", W), *DSC], [*IN_102, *ENCODER_2]),
    110: (
        [("STW1", W), ("SATZANW", W), ("POS_STW", W), ("STW2", W), ("OVERRIDE", W), *MDI, ("MDI_MOD", W)],
        [("ZSW1", W), ("AKTSATZ", W), ("POS_ZSW", W), ("ZSW2", W), ("MELDW", W), ("XIST_A", D)],
    ),
    111: (
        [("STW1", W), ("POS_STW1", W), ("POS_STW2", W), ("STW2", W), ("OVERRIDE", W), *MDI, ("FREE", W)],
        [
            ("ZSW1", W),
            ("POS_ZSW1", W),
            ("POS_ZSW2", W),
            ("ZSW2", W),
            ("MELDW", W),
            ("XIST_A", D),
            ("NIST_B", D),
            ("FAULT_CODE", W),
            ("WARN_CODE", W),
            ("FREE", W),
        ],
    ),
    81: ([("STW2_ENC", W), ("G1_STW", W)], [("ZSW2_ENC", W), *ENCODER_1]),
    82: ([("STW2_ENC", W), ("G1_STW", W)], [("ZSW2_ENC", W), *ENCODER_1, ("NIST_A", W)]),
    83: ([("STW2_ENC", W), ("G1_STW", W)], [("ZSW2_ENC", W), *ENCODER_1, ("NIST_B", D)]),
    390: ([("CU_STW1", W), ("A_DIGITAL", W)], [("CU_ZSW1", W), ("E_DIGITAL", W)]),
    391: (
        [("CU_STW1", W), ("A_DIGITAL", W), ("MT_STW", W)],
        [
            ("CU_ZSW1", W),
            ("E_DIGITAL", W),
            ("MT_ZSW", W),
            ("MT1_ZS_F", W),
            ("MT1_ZS_S", W),
            ("MT2_ZS_F", W),
            ("MT2_ZS_S", W),
        ],
    ),
    394: (
        [("CU_STW1", W), ("A_DIGITAL", W), ("A_DIGITAL_1", W)],
        [("CU_ZSW1", W), ("E_DIGITAL", W), ("E_DIGITAL_1", W)],
    ),
    750: ([("M_ADD1", W), ("M_LIMIT_POS", W), ("M_LIMIT_NEG", W)], [("M_ACT", W)]),
}

COUNTS = {
    1: (2, 2),
    2: (4, 4),
    3: (5, 9),
    4: (6, 14),
    5: (9, 9),
    6: (10, 14),
    7: (2, 2),
    9: (10, 5),
    20: (2, 6),
    81: (2, 6),
    82: (2, 7),
    83: (2, 8),
    84: (2, 10),
    102: (6, 10),
    103: (7, 15),
    105: (10, 10),
    106: (11, 15),
    110: (12, 7),
    111: (12, 12),
    112: (17, 12),
    390: (2, 2),
    391: (3, 7),
    392: (3, 15),
    393: (4, 21),
    394: (3, 3),
    395: (4, 25),
    700: (0, 3),
    701: (2, 5),
    750: (3, 1),
}
"""Words out and in as the tables state them."""


def reference(rows, values):
    """Return the frame by the plain meaning of the table: word after word, high byte first."""
    out = b""
    for (name, width), value in zip(rows, values, strict=True):
        size = 2 if width == W else 4
        out += (0 if name == "FREE" else value & ((1 << 8 * size) - 1)).to_bytes(size, "big")
    return out


def check_number_of_words(number):
    assert (telegram(number).setpoint.words, telegram(number).actual.words) == COUNTS[number]


@pytest.mark.requirement(
    *(f"PD-{number:03}" for number in (*range(1, 29),)), *(f"CFG-{n}" for n in range(225, 242))
)
def test_number_of_words(subtests):
    """Every telegram has as many words in both directions as its table says."""
    for label, values in each(COUNTS):
        with subtests.test(label):
            check_number_of_words(*values)


def test_every_telegram_is_in_the_tables():
    """No telegram is left out of the comparison above."""
    assert set(NUMBERS) == set(COUNTS)


@pytest.mark.exhaustive
@pytest.mark.requirement(
    "CFG-204",
    "CFG-205",
    "CFG-206",
    "CFG-207",
    "CFG-208",
    "CFG-209",
    "CFG-210",
    "CFG-211",
    "CFG-212",
    "CFG-213",
    "CFG-214",
    "CFG-218",
    "CFG-219",
    "PTO-030",
    "PTO-031",
    "PTO-032",
    "PTO-033",
    "PTO-034",
    "PTO-035",
    "PTO-036",
    "PD-348",
)
@pytest.mark.parametrize("number", WORDS)
@settings(max_examples=20)
@given(data=st.data())
def test_every_word_stands_where_the_table_says(number, data):
    """Arbitrary values come out in the order, width and byte order of the table, and back."""
    for layout, rows in zip((telegram(number).setpoint, telegram(number).actual), WORDS[number], strict=True):
        values = {}
        for name, width in rows:
            signed = SIGNALS[name] != "word"
            bits = 16 if width == W else 32
            low = -(1 << (bits - 1)) if signed else 0
            values[name] = data.draw(st.integers(low, low + (1 << bits) - 1))
        values.pop("FREE", None)
        frame = layout.encode(values)
        assert frame == reference(rows, [values.get(name, 0) for name, _ in rows])
        assert layout.decode(frame) == values
        assert layout.unpack(frame) == tuple(values.get(name, 0) for name, _ in rows)
        assert layout.pack(*(values.get(name, 0) for name, _ in rows)) == frame
        at = 0
        for name, width in rows:
            if name != "FREE":
                assert layout.offset(name) == at
            at += 2 if width == W else 4


@pytest.mark.exhaustive
@pytest.mark.requirement("PD-030")
@given(number=st.sampled_from(NUMBERS), data=st.binary(max_size=60))
def test_a_frame_of_another_length_is_refused(number, data):
    """A frame is decoded if and only if it has the length of the telegram; a trace shows it in either
    case.
    """
    layout = telegram(number).actual
    if len(data) == layout.length:
        layout.decode(data)
    else:
        with pytest.raises(TelegramError, match=f"{len(data)} bytes"):
            layout.decode(data)
        with pytest.raises(struct.error):
            layout.unpack(data)
    assert layout.describe(data)


@pytest.mark.requirement("CFG-214", "CFG-235")
def test_supplement():
    """750 stands behind the telegrams that it may supplement, and behind no other."""
    both = telegram(105).with_supplement()
    assert both.setpoint.names == (*telegram(105).setpoint.names, "M_ADD1", "M_LIMIT_POS", "M_LIMIT_NEG")
    assert both.actual.names[-1] == "M_ACT"
    assert (both.number, both.setpoint.words, both.actual.words) == (105, 13, 11)
    for number in NUMBERS:
        if number not in WITH_750:
            with pytest.raises(TelegramError, match="supplement"):
                telegram(number).with_supplement()


@pytest.mark.requirement("PD-029")
def test_free_configuration():
    """A free telegram takes any signals behind STW1 and ZSW1; mistakes are named."""
    free = free_telegram(["STW1", "NSOLL_B", "M_ADD1"], ["ZSW1", "NIST_B", "MELDW", "M_ACT"])
    assert (free.number, free.setpoint.length, free.actual.length) == (999, 8, 10)
    for setpoint, actual, part in (
        (["NSOLL_B"], ["ZSW1"], "begins with STW1"),
        (["STW1", "NSOLL_X"], ["ZSW1"], "no signal 'NSOLL_X'"),
        (["STW1", "STW2", "STW2"], ["ZSW1"], "twice"),
    ):
        with pytest.raises(TelegramError, match=part):
            free_telegram(setpoint, actual)


@pytest.mark.requirement("PTO-023", "PTO-024", "PTO-025", "PTO-026", "PTO-027", "PTO-028", "PTO-029")
def test_telegram_of_the_pulse_module():
    """The pulse module has 8 bytes out and 16 in, with 16-bit speeds."""
    pto = pto_telegram()
    assert (pto.setpoint.length, pto.actual.length) == (8, 16)
    assert [pto.setpoint.offset(name) for name in ("STW1", "NSOLL_A", "STW2_ENC", "G1_STW")] == [0, 2, 4, 6]
    offsets = [("ZSW1", 0), ("NIST_A", 2), ("ZSW2_ENC", 4), ("G1_ZSW", 6), ("G1_XIST1", 8), ("G1_XIST2", 12)]
    assert [(name, pto.actual.offset(name)) for name, _ in offsets] == offsets


def test_facts_about_telegrams():
    """Encoders, dynamic servo control and sign of life follow from the signals."""
    assert [telegram(number).encoders for number in (1, 2, 3, 4, 81, 106)] == [0, 0, 1, 2, 1, 2]
    assert [number for number in NUMBERS if telegram(number).dsc] == [5, 6, 105, 106]
    assert [number for number in (1, 2, 3, 7, 9, 81, 390, 750) if telegram(number).isochronous] == [
        2,
        3,
        9,
        81,
        390,
    ]


def test_mistakes_are_named():
    """Unknown telegrams and signals, and values out of range, are reported with what is allowed."""
    with pytest.raises(TelegramError, match=r"no telegram 8; there are: 1, 2, 3"):
        telegram(8)
    layout = telegram(3).setpoint
    with pytest.raises(
        TelegramError, match="XERR is not in this telegram; it has: STW1, NSOLL_B, STW2, G1_STW"
    ):
        layout.encode({"XERR": 1})
    with pytest.raises(TelegramError, match="STW1: 65536 is outside"):
        layout.encode({"STW1": 0x10000})
    assert layout.encode({"STW2": -1})[6:8] == b"\xff\xff"
    with pytest.raises(TelegramError, match="G1_XIST1 is not in this telegram"):
        layout.offset("G1_XIST1")
    assert repr(Layout(["STW1"])) == "Layout(STW1)"


@pytest.mark.requirement("PD-045", "PD-046", "PD-047", "PD-048", "PD-052", "PD-054", "PD-082", "PD-142")
def test_words_for_a_trace():
    """Bits are shown by name, normalised values in percent, the sign of life as a number."""
    assert describe_word("STW1", 0x047F) == (
        "047Fh ON NO_OFF2 NO_OFF3 ENABLE_OPERATION RAMP_ENABLE RAMP_RELEASE SETPOINT_ENABLE CONTROL_BY_PLC"
    )
    assert describe_word("STW2", 0xA080) == "A080h PARKING sign of life 10"
    assert describe_word("G1_STW", 0x0011) == "0011h FUNCTION_1 command 1"
    text = telegram(2).setpoint.describe(
        telegram(2).setpoint.encode({"STW1": STW1.ON, "NSOLL_B": -0x2000_0000})
    )
    assert text == "STW1 0001h ON, NSOLL_B -50.0000 %, STW2 0000h sign of life 0"
    assert "3 bytes in place of 8" in telegram(2).setpoint.describe(b"abc")
