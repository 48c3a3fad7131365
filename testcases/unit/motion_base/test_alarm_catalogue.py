"""The catalogue of technology alarms and error identifications."""

import pytest

from motion.s7.alarms import AlarmError, alarm, catalogue, error_ids, error_text, severity, stop_mode_severity
from motion.s7.variables import VariableStore

AXES = ("SpeedAxis", "PositioningAxis", "SynchronousAxis")

ERROR_BITS = {
    0: [201, 202, 203, 204],
    1: [101, 104, 105, 106, 107, 108, 109, 114, 343],
    2: [113, 304, 305, 306, 307, 308, 542, 612],
    3: [321, 323],
    4: [421],
    5: [411, 412],
    7: [431],
    8: [533, 534],
    9: [531],
    10: [341, 342],
    11: [521],
    12: [541],
    13: [401, 550],
    14: [601, 603, 608],
    15: [102, 103, 552],
}
"""Axis alarms of each bit of the error word."""

WARNING_BITS = {1: [110], 3: [322], 6: [501, 502, 503, 504, 511, 551], 11: [522], 15: [111, 112]}
"""Axis alarms of each bit of the warning word."""

REACTIONS = {
    2: [104, 307, 341, 601, 608, 533],
    3: [304, 305, 306, 321, 342],
    4: [
        101,
        102,
        103,
        105,
        106,
        107,
        108,
        109,
        113,
        114,
        201,
        203,
        204,
        308,
        323,
        343,
        401,
        411,
        412,
        421,
        431,
        521,
        531,
        534,
        541,
        542,
        552,
        603,
        612,
    ],
    5: [550],
    0: [110, 111, 112, 202, 322, 501, 502, 503, 504, 511, 522, 551],
}
"""Axis alarms of each usual reaction."""


def of_axes():
    """Return the alarms that an axis can have."""
    return [entry for entry in catalogue().values() if set(entry.applies_to) & set(AXES)]


def test_size_and_order():
    """The catalogue has all 96 alarms and 162 error identifications, in ascending order."""
    assert len(catalogue()) == 96
    assert list(catalogue()) == sorted(catalogue())
    assert len(error_ids()) == 162


@pytest.mark.requirement(
    "TA-021",
    "TA-022",
    "VAR-070",
    "VAR-071",
    "VAR-072",
    "VAR-073",
    "VAR-074",
    "VAR-075",
    "VAR-076",
    "VAR-077",
    "VAR-078",
    "VAR-079",
    "VAR-080",
    "VAR-081",
    "VAR-082",
    "VAR-083",
    "VAR-084",
)
@pytest.mark.parametrize(("field", "expected"), [("error_bit", ERROR_BITS), ("warning_bit", WARNING_BITS)])
def test_word_bits(field, expected):
    """Every axis alarm sets the bit of its group, and no other bit is used."""
    found = {}
    for entry in of_axes():
        bit = getattr(entry, field)
        if bit is not None:
            found.setdefault(bit, []).append(entry.number)

    assert found == expected


def test_usual_reactions():
    """Every axis alarm has the reaction of the list."""
    found = {}
    for entry in of_axes():
        found.setdefault(entry.reaction_of("SynchronousAxis"), []).append(entry.number)

    assert {reaction: sorted(numbers) for reaction, numbers in found.items()} == {
        reaction: sorted(numbers) for reaction, numbers in REACTIONS.items()
    }


@pytest.mark.parametrize(
    ("number", "reactions", "stays_enabled"),
    [(531, (4, 3), (3,)), (533, (2, 1), (1, 2)), (534, (4, 3), (3,))],
)
def test_configurable_reactions(number, reactions, stays_enabled):
    """The limit switch alarms can be configured; after these of their reactions the axis stays enabled."""
    assert (alarm(number).reactions, alarm(number).stays_enabled) == (reactions, stays_enabled)


def test_no_other_alarm_keeps_the_axis_enabled():
    """All other alarms with one of the stop reactions disable the axis."""
    assert [entry.number for entry in catalogue().values() if entry.stays_enabled] == [531, 533, 534]


@pytest.mark.requirement("VAR-087")
def test_restart_alarms():
    """These axis alarms need a restart; where that depends on the cause (531) the catalogue says so."""
    assert [entry.number for entry in of_axes() if entry.restart] == [
        101,
        102,
        103,
        105,
        107,
        109,
        113,
        114,
        201,
        202,
        203,
    ]
    assert [entry.number for entry in catalogue().values() if entry.restart is None] == [531]


@pytest.mark.requirement("TA-023")
def test_classes():
    """Warnings have a bit of the warning word only, and alarms with an error bit are F, or R where they need
    a restart.
    """
    for entry in catalogue().values():
        assert (entry.error_bit is None) != (entry.warning_bit is None)
        expected = "W" if entry.error_bit is None else "R" if entry.restart else "F"
        assert entry.alarm_class == expected
        if entry.alarm_class == "W":
            assert set(entry.reactions) <= {0}


@pytest.mark.requirement("VAR-095", "TA-012")
def test_external_encoder_shows_ten():
    """An external encoder shows 10 where an axis shows 4, and no other reaction but 0."""
    for entry in catalogue().values():
        if "ExternalEncoder" in entry.applies_to:
            assert entry.reaction_of("ExternalEncoder") == (10 if entry.reactions[0] == 4 else 0)


@pytest.mark.requirement("TA-012")
@pytest.mark.parametrize(
    ("number", "object_type", "reaction"),
    [
        (101, "OutputCam", 6),
        (701, "CamTrack", 7),
        (750, "MeasuringInput", 8),
        (101, "Cam", 9),
        (900, "LeadingAxisProxy", 13),
    ],
)
def test_other_objects(number, object_type, reaction):
    """Objects without an axis show the reaction that ends their processing."""
    assert alarm(number).reaction_of(object_type) == reaction


@pytest.mark.parametrize("kind", [*AXES[:2], "ExternalEncoder"])
def test_bits_exist_in_the_words_of_the_object(kind):
    """A bit that an alarm sets has the same name in the word of every object that can have the alarm."""
    store = VariableStore(kind)
    words = {name: store.describe(name).bits for name in ("ErrorWord", "WarningWord")}

    for entry in catalogue().values():
        if kind in entry.applies_to:
            word, bit = (
                ("ErrorWord", entry.error_bit)
                if entry.error_bit is not None
                else ("WarningWord", entry.warning_bit)
            )
            assert words[word][bit] == entry.bit_name, entry.number


@pytest.mark.requirement("TA-013")
def test_causes():
    """The supplementary value numbers the causes from 1; others leave the text alone."""
    entry = alarm(541)

    assert (
        entry.describe(1)
        == "Positioning monitoring error: target window not reached within the tolerance time"
    )
    assert (
        entry.describe(2)
        == "Positioning monitoring error: target window left again within the minimum dwell time"
    )
    assert entry.describe() == entry.describe(3) == entry.describe(-1) == "Positioning monitoring error"
    assert not any(cause.startswith("...") for each in catalogue().values() for cause in each.causes)


def test_unknown_alarm():
    """An unknown number is refused."""
    with pytest.raises(AlarmError, match="there is no technology alarm 999"):
        alarm(999)


@pytest.mark.parametrize(
    ("value", "part"),
    [
        (0x0000, "no error"),
        (0x8001, "a technology alarm occurred"),
        (0x800E, "restart refused because the TO is enabled"),
        (0x800F, "the TO is disabled, or MC_Stop is active"),
    ],
)
def test_error_texts(value, part):
    """An error identification is shown in the notation of the controller, with its meaning."""
    assert error_text(value).startswith(f"16#{value:04X}: ")
    assert part in error_text(value)


def test_unknown_error_id():
    """An unknown identification is named as such."""
    assert error_text(0x1234) == "16#1234: unknown error identification"


@pytest.mark.requirement("TA-004", "STP-432", "STP-433", "STP-434", "STP-435")
def test_severity():
    """Remove enable, tracking, emergency stop, maximum dynamics, current dynamics, none; MC_Stop on the same
    scale.
    """
    assert sorted(range(6), key=severity) == [0, 1, 2, 3, 5, 4]
    assert len({severity(reaction) for reaction in range(6)}) == 6
    assert [stop_mode_severity(mode) for mode in (0, 2, 3)] == [severity(3), severity(2), severity(1)]


def test_no_such_severity():
    """Unknown reactions and modes are refused."""
    with pytest.raises(AlarmError, match="99 is no alarm reaction"):
        severity(99)
    with pytest.raises(AlarmError, match="1 is no mode of MC_Stop; there are 0, 2 and 3"):
        stop_mode_severity(1)
