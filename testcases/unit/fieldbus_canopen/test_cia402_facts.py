"""CiA 402 states, commands, modes and texts."""

from __future__ import annotations

import pytest

from fieldbus.cia402 import (
    EMCY_TEXTS,
    STATE_MASKS,
    Command,
    Controlword,
    DriveState,
    Mode,
    Statusword,
    decode_command,
    decode_state,
    describe_controlword,
    describe_statusword,
    emcy_text,
)

# The pattern column of the profile's state table; x = not looked at, bits 6 5 4 3 2 1 0 (4 never looked at).
PATTERNS = {
    DriveState.NOT_READY_TO_SWITCH_ON: "0xx0000",
    DriveState.SWITCH_ON_DISABLED: "1xx0000",
    DriveState.READY_TO_SWITCH_ON: "01x0001",
    DriveState.SWITCHED_ON: "01x0011",
    DriveState.OPERATION_ENABLED: "01x0111",
    DriveState.QUICK_STOP_ACTIVE: "00x0111",
    DriveState.FAULT_REACTION_ACTIVE: "0xx1111",
    DriveState.FAULT: "0xx1000",
}


def matches(word: int, pattern: str) -> bool:
    return all(bit == "x" or word >> place & 1 == int(bit) for place, bit in enumerate(reversed(pattern)))


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-039")
def test_every_statusword_shows_at_most_one_state():
    """For all 65536 words the decoded state is the one whose pattern matches; patterns exclude each other."""
    for word in range(0x10000):
        states = [state for state, pattern in PATTERNS.items() if matches(word, pattern)]
        assert len(states) <= 1
        if states:
            assert decode_state(word) is states[0]
        else:
            assert decode_state(word) in (DriveState.FAULT, DriveState.NOT_READY_TO_SWITCH_ON)
            assert (decode_state(word) is DriveState.FAULT) == bool(word & 8)


def test_state_bits_are_decoded_to_their_state():
    """What a drive shows for a state is read as that state."""
    for state in DriveState:
        assert decode_state(state.bits) is state
        assert DriveState.decode(state.bits | 0x9690) is state
        mask, value = STATE_MASKS[state]
        assert state.bits & mask == value


@pytest.mark.requirement("C402-018", "C402-019", "C402-021", "C402-022", "C402-024", "C402-025")
@pytest.mark.parametrize(
    ("pattern", "command"),
    [
        ("0xxx x110", Command.SHUTDOWN),
        ("0xxx 0111", Command.SWITCH_ON),
        ("0xxx xx0x", Command.DISABLE_VOLTAGE),
        ("0xxx x01x", Command.QUICK_STOP),
        ("0xxx 1111", Command.ENABLE_OPERATION),
        ("1xxx xxxx", Command.FAULT_RESET),
    ],
)
def test_commands_by_pattern(pattern, command):
    """Every controlword that matches a command's pattern is decoded as that command, and no other is."""
    pattern = pattern.replace(" ", "")
    for word in range(0x400):
        assert (decode_command(word) is command) == matches(word, pattern)


def test_command_values_are_their_own_command():
    """The usual controlword of each command is decoded as the command."""
    for command in Command:
        assert decode_command(command) is command


@pytest.mark.requirement("C402-078", "C402-084", "C402-085", "C402-275")
def test_modes_and_6502h():
    """The bits of 6502h of all modes but cst with angle make 3EFh."""
    assert (Mode.PROFILE_POSITION, Mode.HOMING, Mode.CYCLIC_SYNC_POSITION, Mode.CYCLIC_SYNC_VELOCITY) == (
        1,
        6,
        8,
        9,
    )
    assert sum(mode.supported_bit for mode in Mode if mode != Mode.CYCLIC_SYNC_TORQUE_ANGLE) == 0x3EF
    assert [mode.short for mode in Mode] == [
        "none",
        "pp",
        "vl",
        "pv",
        "tq",
        "hm",
        "ip",
        "csp",
        "csv",
        "cst",
        "cstca",
    ]


@pytest.mark.requirement("C402-032", "C402-036", "C402-040", "C402-041", "C402-043", "C402-045")
def test_bit_numbers():
    """The named bits have the numbers of the profile."""
    assert [Controlword.FAULT_RESET, Controlword.HALT, Controlword.NEW_SETPOINT, Controlword.RELATIVE] == [
        0x80,
        0x100,
        0x10,
        0x40,
    ]
    assert [
        Statusword.VOLTAGE_ENABLED,
        Statusword.WARNING,
        Statusword.REMOTE,
        Statusword.TARGET_REACHED,
        Statusword.INTERNAL_LIMIT,
        Statusword.FOLLOWING_ERROR,
    ] == [0x10, 0x80, 0x200, 0x400, 0x800, 0x2000]


@pytest.mark.requirement("C402-306", "C301-123", "C301-130")
@pytest.mark.parametrize(
    ("code", "text"),
    [
        (0x8611, "following error"),
        (0x8130, "life guarding or heartbeat error"),
        (0x8250, "RPDO timeout"),
        (0x7121, "motor blocked"),
        (0x630F, "data record 15"),
        (0x2315, "continuous overcurrent"),
        (0x3299, "DC link voltage"),
        (0x2F00, "current"),
        (0xFF80, "manufacturer-specific"),
        (0xB000, "unknown error"),
    ],
)
def test_emcy_texts(code, text):
    """A code has its text, an unknown one that of its group."""
    assert emcy_text(code) == text


def test_texts_are_written_for_every_code():
    """No code in the table is without a text or out of range."""
    assert all(0 <= code <= 0xFFFF and text for code, text in EMCY_TEXTS.items())
    assert len(EMCY_TEXTS) > 190


@pytest.mark.parametrize(
    ("word", "text"),
    [
        (0x0237, "Operation enabled"),
        (0x0288, "Fault, warning, no voltage"),
        (0x0A50, "Switch on disabled, internal limit"),
    ],
)
def test_statusword_in_words(word, text):
    """State and remarkable bits are named."""
    assert describe_statusword(word) == text


def test_controlword_in_words():
    """Command and halt are named."""
    assert describe_controlword(0x000F) == "enable operation"
    assert describe_controlword(0x010F) == "enable operation, halt"
    assert describe_controlword(0x0080) == "fault reset"
