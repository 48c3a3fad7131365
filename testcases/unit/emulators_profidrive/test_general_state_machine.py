"""The general state machine: every row of the transition table, and nothing but them."""

from __future__ import annotations

import itertools

import pytest

from emulators.drive.profidrive.statemachine import Action, AxisState, GeneralStateMachine, Off
from fieldbus.profidrive import STW1

IDLE, S1, S2, S3, S4, S5A, S5B = AxisState
CONTROLLED = STW1.CONTROL_BY_PLC
READY = CONTROLLED | STW1.NO_OFF2 | STW1.NO_OFF3  # 0406h
ON = READY | STW1.ON
RUN = ON | STW1.ENABLE_OPERATION

# Row of the table: identifier, from, control word, standstill, to, action.
ROWS = [
    ("PD-097", IDLE, CONTROLLED, True, S1, Action.NOTHING),
    ("PD-098", S1, READY, True, S2, Action.NOTHING),
    ("PD-099", S2, READY & ~STW1.NO_OFF2, True, S1, Action.NOTHING),
    ("PD-099", S2, READY & ~STW1.NO_OFF3, True, S1, Action.NOTHING),
    ("PD-100", S2, ON, True, S3, Action.NOTHING),
    ("PD-101", S3, ON & ~STW1.NO_OFF2, True, S1, Action.NOTHING),
    ("PD-101", S3, ON & ~STW1.NO_OFF3, True, S1, Action.NOTHING),
    ("PD-102", S3, READY, True, S2, Action.NOTHING),
    ("PD-103", S3, RUN, True, S4, Action.ENABLE),
    ("PD-104", S4, RUN & ~STW1.NO_OFF2, False, S1, Action.INHIBIT),
    ("PD-105", S4, RUN & ~STW1.NO_OFF3, False, S5B, Action.QUICK_STOP),
    ("PD-106", S4, RUN & ~STW1.ON, False, S5A, Action.RAMP_STOP),
    ("PD-107", S4, ON, False, S3, Action.INHIBIT),
    ("PD-108", S5A, RUN & ~(STW1.ON | STW1.NO_OFF2), False, S1, Action.INHIBIT),
    ("PD-109", S5A, RUN & ~(STW1.ON | STW1.NO_OFF3), False, S5B, Action.QUICK_STOP),
    ("PD-110", S5A, RUN & ~STW1.ON, True, S2, Action.INHIBIT),
    ("PD-110", S5A, READY, False, S2, Action.INHIBIT),
    ("PD-111", S5A, RUN, False, S4, Action.CONTINUE),
    ("PD-112", S5B, RUN & ~STW1.NO_OFF2, False, S1, Action.INHIBIT),
    ("PD-113", S5B, RUN & ~STW1.NO_OFF3, True, S1, Action.INHIBIT),
    ("PD-113", S5B, ON & ~STW1.NO_OFF3, False, S1, Action.INHIBIT),
    ("PD-113", S5B, RUN, False, S5B, Action.NOTHING),
]
PATHS = {
    S1: [CONTROLLED],
    S2: [READY],
    S3: [ON],
    S4: [RUN],
    S5A: [RUN & ~STW1.ON],
    S5B: [RUN & ~STW1.NO_OFF3],
}
ORDER = [S1, S2, S3, S4]


def machine_in(state):
    """Return a machine that was led into a state by control words alone."""
    machine = GeneralStateMachine()
    steps = ORDER[: ORDER.index(state) + 1] if state in ORDER else [] if state is IDLE else [*ORDER, state]
    for step in steps:
        machine.step(PATHS[step][0], standstill=False)
    assert machine.state is state
    return machine


@pytest.mark.requirement("MC-569", "STP-527", *sorted({row[0] for row in ROWS}), "PD-350")
@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row[0]}-{row[1].name}-{row[2]:04X}-{row[4].name}")
def test_row(row):
    """The condition leads from the state into the next one, with the action that the table names."""
    _, before, word, standstill, after, action = row
    machine = machine_in(before)
    assert machine.step(word, standstill=standstill) is action
    assert machine.state is after


@pytest.mark.requirement("PD-113", "PD-114")
def test_every_word_in_every_state():
    """Any combination of the five bits leads only where the table allows, by priority OFF2, OFF3, OFF1,
    disable.
    """
    allowed = {(before, after) for _, before, _, _, after, _ in ROWS}
    for before in AxisState:
        for bits in itertools.product((0, 1), repeat=5):
            word = sum(bit << place for bit, place in zip(bits, (0, 1, 2, 3, 10), strict=True))
            for standstill in (False, True):
                machine = machine_in(before)
                machine.step(word, standstill=standstill)
                assert machine.state is before or (before, machine.state) in allowed
                if before is S4 and not word & STW1.NO_OFF2:
                    assert machine.state is S1
                elif before is S4 and not word & STW1.NO_OFF3:
                    assert machine.state is S5B


@pytest.mark.requirement("PD-114")
def test_one_transition_a_step():
    """With everything commanded at once the axis goes through every state, one a cycle; ON must be new."""
    machine = GeneralStateMachine()
    assert [
        machine.step(word, standstill=True) and machine.state
        for word in (CONTROLLED, RUN, RUN, READY, RUN, RUN, RUN)
    ] == [
        S1,
        S1,
        S1,
        S2,
        S3,
        S4,
        S4,
    ]


@pytest.mark.requirement("PD-115")
@pytest.mark.parametrize(
    ("off", "path"), [(Off.OFF1, [S5A, S2]), (Off.OFF2, [S1, S1]), (Off.OFF3, [S5B, S1])]
)
def test_faults_act_as_their_reaction(off, path):
    """A fault stops as OFF1, OFF2 or OFF3 would, and holds the axis off while the control word still commands
    ON.
    """
    machine = machine_in(S4)
    states = []
    for standstill in (False, True):
        machine.step(RUN, off=off, standstill=standstill)
        states.append(machine.state)
    assert states == path
    for _ in range(5):
        machine.step(RUN, off=off, standstill=True)
        assert machine.state in (S1, S2)
    # Acknowledged, an axis in S1 waits for a new edge of ON; so does one that OFF1 has left in S2.
    if machine.state is S1:
        machine.step(RUN, standstill=True)
        assert machine.state is S1
        machine.step(READY, standstill=True)
        assert machine.state is S2


@pytest.mark.requirement("PD-103", "PD-131")
def test_not_ready_and_not_synchronised():
    """S4 waits for the power stage, S2 for the sign of life."""
    machine = machine_in(S3)
    assert machine.step(RUN, standstill=True, ready=False) is Action.NOTHING
    assert machine.state is S3
    machine = machine_in(S1)
    machine.step(READY, standstill=True, synchronised=False)
    assert machine.state is S1


@pytest.mark.requirement("PD-117")
def test_enable_order_of_a_controller():
    """047Eh leads to S2, 047Fh to S4 in two more cycles."""
    machine = GeneralStateMachine()
    for _ in range(2):
        machine.step(0x047E, standstill=True)
    assert machine.state is S2
    for _ in range(2):
        machine.step(0x047F, standstill=True)
    assert machine.state is S4


@pytest.mark.parametrize(
    ("state", "bits"),
    [(S1, 0x40), (S2, 0x01), (S3, 0x03), (S4, 0x07), (S5A, 0x03), (S5B, 0x03), (IDLE, 0x40)],
)
def test_bits_of_the_states(state, bits):
    """ZSW1 & 0047h of every state."""
    assert state.bits == bits
