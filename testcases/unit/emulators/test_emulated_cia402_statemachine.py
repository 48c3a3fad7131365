"""Power drive system state machine: every state against every command and event."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from emulators.drive.cia402 import Action, PowerStateMachine, StopOption
from fieldbus.cia402 import DriveState as S

COMMANDS = {
    "shutdown": 0x06,
    "switch_on": 0x07,
    "enable": 0x0F,
    "quick_stop": 0x02,
    "disable_voltage": 0x00,
}


def machine_in(state: S, **options: int) -> tuple[PowerStateMachine, list[tuple[int, S, S]]]:
    """Return a machine that has been led into a state, and the list of its further transitions."""
    log: list[tuple[int, S, S]] = []
    machine = PowerStateMachine(lambda number, old, new: log.append((number, old, new)))
    for name, value in options.items():
        setattr(machine.options, name, value)
    machine.start()
    if state is not S.NOT_READY_TO_SWITCH_ON:
        machine.initialised()
    path = {
        S.READY_TO_SWITCH_ON: (0x06,),
        S.SWITCHED_ON: (0x06, 0x07),
        S.OPERATION_ENABLED: (0x06, 0x07, 0x0F),
        S.QUICK_STOP_ACTIVE: (0x06, 0x07, 0x0F, 0x02),
        S.FAULT_REACTION_ACTIVE: (0x06, 0x07, 0x0F),
    }.get(state, ())
    for word in path:
        if machine.control(word) is Action.POWER_ON:
            machine.power_is_on()
    if state in (S.FAULT, S.FAULT_REACTION_ACTIVE):
        machine.fault()
    assert machine.state is state
    log.clear()
    return machine, log


# What a command does: transitions made at once and the state afterwards; default option codes.
TABLE = {
    (S.NOT_READY_TO_SWITCH_ON, "shutdown"): ([], S.NOT_READY_TO_SWITCH_ON),
    (S.NOT_READY_TO_SWITCH_ON, "switch_on"): ([], S.NOT_READY_TO_SWITCH_ON),
    (S.NOT_READY_TO_SWITCH_ON, "enable"): ([], S.NOT_READY_TO_SWITCH_ON),
    (S.NOT_READY_TO_SWITCH_ON, "quick_stop"): ([], S.NOT_READY_TO_SWITCH_ON),
    (S.NOT_READY_TO_SWITCH_ON, "disable_voltage"): ([], S.NOT_READY_TO_SWITCH_ON),
    (S.SWITCH_ON_DISABLED, "shutdown"): ([2], S.READY_TO_SWITCH_ON),
    (S.SWITCH_ON_DISABLED, "switch_on"): ([], S.SWITCH_ON_DISABLED),
    (S.SWITCH_ON_DISABLED, "enable"): ([], S.SWITCH_ON_DISABLED),
    (S.SWITCH_ON_DISABLED, "quick_stop"): ([], S.SWITCH_ON_DISABLED),
    (S.SWITCH_ON_DISABLED, "disable_voltage"): ([], S.SWITCH_ON_DISABLED),
    (S.READY_TO_SWITCH_ON, "shutdown"): ([], S.READY_TO_SWITCH_ON),
    (S.READY_TO_SWITCH_ON, "switch_on"): ([3], S.SWITCHED_ON),
    (S.READY_TO_SWITCH_ON, "enable"): ([3], S.SWITCHED_ON),
    (S.READY_TO_SWITCH_ON, "quick_stop"): ([7], S.SWITCH_ON_DISABLED),
    (S.READY_TO_SWITCH_ON, "disable_voltage"): ([7], S.SWITCH_ON_DISABLED),
    (S.SWITCHED_ON, "shutdown"): ([6], S.READY_TO_SWITCH_ON),
    (S.SWITCHED_ON, "switch_on"): ([], S.SWITCHED_ON),
    (S.SWITCHED_ON, "enable"): ([4], S.OPERATION_ENABLED),
    (S.SWITCHED_ON, "quick_stop"): ([10], S.SWITCH_ON_DISABLED),
    (S.SWITCHED_ON, "disable_voltage"): ([10], S.SWITCH_ON_DISABLED),
    (S.OPERATION_ENABLED, "shutdown"): ([8], S.READY_TO_SWITCH_ON),
    (S.OPERATION_ENABLED, "switch_on"): ([], S.OPERATION_ENABLED),  # ramps first: 605Ch = 1
    (S.OPERATION_ENABLED, "enable"): ([], S.OPERATION_ENABLED),
    (S.OPERATION_ENABLED, "quick_stop"): ([11], S.QUICK_STOP_ACTIVE),
    (S.OPERATION_ENABLED, "disable_voltage"): ([9], S.SWITCH_ON_DISABLED),
    (S.QUICK_STOP_ACTIVE, "shutdown"): ([], S.QUICK_STOP_ACTIVE),
    (S.QUICK_STOP_ACTIVE, "switch_on"): ([], S.QUICK_STOP_ACTIVE),
    (S.QUICK_STOP_ACTIVE, "enable"): ([], S.QUICK_STOP_ACTIVE),
    (S.QUICK_STOP_ACTIVE, "quick_stop"): ([], S.QUICK_STOP_ACTIVE),
    (S.QUICK_STOP_ACTIVE, "disable_voltage"): ([12], S.SWITCH_ON_DISABLED),
    (S.FAULT_REACTION_ACTIVE, "shutdown"): ([], S.FAULT_REACTION_ACTIVE),
    (S.FAULT_REACTION_ACTIVE, "switch_on"): ([], S.FAULT_REACTION_ACTIVE),
    (S.FAULT_REACTION_ACTIVE, "enable"): ([], S.FAULT_REACTION_ACTIVE),
    (S.FAULT_REACTION_ACTIVE, "quick_stop"): ([], S.FAULT_REACTION_ACTIVE),
    (S.FAULT_REACTION_ACTIVE, "disable_voltage"): ([], S.FAULT_REACTION_ACTIVE),
    (S.FAULT, "shutdown"): ([], S.FAULT),
    (S.FAULT, "switch_on"): ([], S.FAULT),
    (S.FAULT, "enable"): ([], S.FAULT),
    (S.FAULT, "quick_stop"): ([], S.FAULT),
    (S.FAULT, "disable_voltage"): ([], S.FAULT),
}


@pytest.mark.requirement(
    "C402-003",
    "C402-004",
    "C402-005",
    "C402-007",
    "C402-008",
    "C402-009",
    "C402-010",
    "C402-011",
    "C402-012",
    "C402-026",
    "C402-018",
    "C402-019",
    "C402-021",
    "C402-022",
    "C402-024",
)
@pytest.mark.parametrize(("state", "command"), list(TABLE), ids=lambda value: getattr(value, "name", value))
def test_every_command_in_every_state(state: S, command: str):
    """Each command makes the one transition of the table, and is ignored where none is listed."""
    machine, log = machine_in(state)
    action = machine.control(COMMANDS[command])
    if action is Action.POWER_ON:
        machine.power_is_on()
    transitions, expected = TABLE[state, command]
    assert ([number for number, _, _ in log], machine.state) == (transitions, expected)


def test_the_table_is_complete():
    """The table has a cell for every state and command."""
    assert set(TABLE) == {(state, command) for state in S for command in COMMANDS}


@pytest.mark.requirement("C402-001", "C402-002")
def test_power_on_and_initialisation():
    """Transitions 0 and 1: Not ready, then by itself Switch on disabled; torque off."""
    log = []
    machine = PowerStateMachine(lambda number, old, new: log.append(number))
    assert machine.start() is Action.OFF
    assert machine.state is S.NOT_READY_TO_SWITCH_ON
    machine.initialised()
    assert (machine.state, log) == (S.SWITCH_ON_DISABLED, [0, 1])


@pytest.mark.parametrize(
    ("state", "bits"),
    [
        (S.NOT_READY_TO_SWITCH_ON, "x0xx0000"),
        (S.SWITCH_ON_DISABLED, "x1xx0000"),
        (S.READY_TO_SWITCH_ON, "x01x0001"),
        (S.SWITCHED_ON, "x01x0011"),
        (S.OPERATION_ENABLED, "x01x0111"),
        (S.QUICK_STOP_ACTIVE, "x00x0111"),
        (S.FAULT_REACTION_ACTIVE, "x0xx1111"),
        (S.FAULT, "x0xx1000"),
    ],
)
@pytest.mark.requirement("C402-039")
def test_status_bits(state: S, bits: str):
    """Bits 6, 5, 3..0 of the status word show the state as the profile's mask says."""
    machine, _ = machine_in(state)
    for place, expected in enumerate(reversed(bits)):
        if expected != "x":
            assert machine.status_bits >> place & 1 == int(expected), place


@pytest.mark.requirement("C402-009", "C402-059", "C402-060")
def test_shutdown_option():
    """605Bh: 0 coasts into Ready at once; 1 ramps in Operation enabled and goes to Ready at standstill."""
    machine, log = machine_in(S.OPERATION_ENABLED, shutdown=0)
    assert machine.control(0x06) is Action.OFF
    assert machine.state is S.READY_TO_SWITCH_ON
    machine, log = machine_in(S.OPERATION_ENABLED, shutdown=1)
    assert machine.control(0x06) is Action.STOP
    assert machine.stop_option is StopOption.SLOW_DOWN
    assert (machine.state, machine.follows_commands, machine.ramping_down) == (
        S.OPERATION_ENABLED,
        False,
        True,
    )
    assert machine.stop_finished() is Action.OFF
    assert (machine.state, [entry[0] for entry in log]) == (S.READY_TO_SWITCH_ON, [8])


@pytest.mark.requirement("C402-006", "C402-023", "C402-061", "C402-062")
def test_disable_operation_option():
    """605Ch: 0 coasts into Switched on at once, 1 ramps first."""
    machine, _ = machine_in(S.OPERATION_ENABLED, disable_operation=0)
    assert machine.control(0x07) is Action.OFF
    assert machine.state is S.SWITCHED_ON
    machine, log = machine_in(S.OPERATION_ENABLED, disable_operation=1)
    assert machine.control(0x07) is Action.STOP
    assert machine.stop_finished() is Action.OFF
    assert (machine.state, [entry[0] for entry in log]) == (S.SWITCHED_ON, [5])


def test_a_shutdown_ramp_can_be_taken_back():
    """Enable operation during the ramp of Shutdown or Disable operation continues the operation."""
    for word in (0x06, 0x07):
        machine, log = machine_in(S.OPERATION_ENABLED, shutdown=1)
        machine.control(word)
        assert machine.control(0x0F) is Action.CONTINUE
        assert (machine.follows_commands, log) == (True, [])
        assert machine.stop_finished() is Action.NOTHING


def test_stronger_commands_break_into_a_shutdown_ramp():
    """During a shutdown ramp Quick stop and Disable voltage still act."""
    machine, _ = machine_in(S.OPERATION_ENABLED, shutdown=1)
    machine.control(0x06)
    assert machine.control(0x02) is Action.STOP
    assert machine.state is S.QUICK_STOP_ACTIVE
    machine, _ = machine_in(S.OPERATION_ENABLED, shutdown=1)
    machine.control(0x06)
    assert machine.control(0x00) is Action.OFF
    assert machine.state is S.SWITCH_ON_DISABLED


@pytest.mark.requirement(
    "C402-012", "C402-013", "C402-053", "C402-054", "C402-055", "C402-056", "C402-057", "C402-058"
)
@pytest.mark.parametrize("option", range(9))
def test_quick_stop_option(option: int):
    """605Ah: 0 coasts, 1..4 stop and leave by transition 12, 5..8 stop the same way and stay."""
    machine, log = machine_in(S.OPERATION_ENABLED, quick_stop=option)
    action = machine.control(0x02)
    if option == 0:
        assert action is Action.OFF
        assert [entry[0] for entry in log] == [11, 12]
        return
    assert action is Action.STOP
    assert machine.stop_option == (option if option <= 4 else option - 4)
    assert machine.state is S.QUICK_STOP_ACTIVE
    finished = machine.stop_finished()
    if option <= 4:
        assert (finished, machine.state) == (Action.OFF, S.SWITCH_ON_DISABLED)
        assert [entry[0] for entry in log] == [11, 12]
    else:
        assert (finished, machine.state) == (Action.NOTHING, S.QUICK_STOP_ACTIVE)
        assert not machine.ramping_down


@pytest.mark.requirement("C402-017")
@pytest.mark.parametrize("option", range(1, 9))
def test_enable_operation_out_of_quick_stop(option: int):
    """Transition 16 only with 605Ah = 5..8 and only after the stop has finished."""
    machine, log = machine_in(S.OPERATION_ENABLED, quick_stop=option)
    machine.control(0x02)
    assert machine.control(0x0F) is Action.NOTHING
    assert machine.state is S.QUICK_STOP_ACTIVE
    machine.stop_finished()
    action = machine.control(0x0F)
    if option >= 5:
        assert (action, machine.state, log[-1][0]) == (Action.CONTINUE, S.OPERATION_ENABLED, 16)
    else:
        assert machine.state is S.SWITCH_ON_DISABLED


@pytest.mark.requirement("C402-014", "C402-015")
@pytest.mark.parametrize("state", [state for state in S if state not in (S.FAULT, S.FAULT_REACTION_ACTIVE)])
def test_fault_from_every_state(state: S):
    """Transition 13 from any state; without torque 14 follows at once, with torque after the stop of
    605Eh.
    """
    machine, log = machine_in(state)
    action = machine.fault()
    assert log[0][0] == 13
    if state in (S.OPERATION_ENABLED, S.QUICK_STOP_ACTIVE):
        assert (action, machine.state) == (Action.STOP, S.FAULT_REACTION_ACTIVE)
        assert machine.stop_finished() is Action.OFF
    assert machine.state is S.FAULT
    assert [entry[0] for entry in log] == [13, 14]


@pytest.mark.requirement("C402-067", "C402-068", "C402-069", "C402-070", "C402-071")
@pytest.mark.parametrize("option", range(5))
def test_fault_reaction_option(option: int):
    """605Eh: 0 switches off at once, 1..4 choose the ramp."""
    machine, _ = machine_in(S.OPERATION_ENABLED, fault_reaction=option)
    action = machine.fault()
    if option == 0:
        assert (action, machine.state) == (Action.OFF, S.FAULT)
    else:
        assert (action, machine.stop_option) == (Action.STOP, option)


def test_fault_without_means_to_brake():
    """A fault of the power stage ends the torque at once, also in the middle of a fault reaction."""
    machine, _ = machine_in(S.OPERATION_ENABLED)
    assert machine.fault(can_brake=False) is Action.OFF
    assert machine.state is S.FAULT
    machine, _ = machine_in(S.FAULT_REACTION_ACTIVE)
    assert machine.fault() is Action.NOTHING
    assert machine.state is S.FAULT_REACTION_ACTIVE
    assert machine.fault(can_brake=False) is Action.OFF
    assert machine.state is S.FAULT


@pytest.mark.requirement("C402-016", "C402-025", "C402-028")
def test_fault_reset_needs_an_edge_and_a_gone_cause():
    """Only bit 7 0 -> 1 resets, only without cause; held at 1 it does not reset the next fault."""
    machine, log = machine_in(S.FAULT)
    machine.fault_present = True
    assert machine.control(0x80) is Action.NOTHING
    machine.fault_present = False
    assert machine.control(0x80) is Action.NOTHING  # still the same edge
    assert machine.state is S.FAULT
    machine.control(0x00)
    assert machine.control(0x80) is Action.FAULT_RESET
    assert (machine.state, log[-1][0]) == (S.SWITCH_ON_DISABLED, 15)
    machine.fault()
    assert machine.state is S.FAULT
    machine.control(0x80)
    assert machine.state is S.FAULT
    machine.control(0x06)
    assert machine.state is S.FAULT
    machine.control(0x86)
    assert machine.state is S.SWITCH_ON_DISABLED


@pytest.mark.requirement("C402-028")
def test_other_commands_wait_until_bit_7_is_gone():
    """While bit 7 is 1 the other command bits of the word do nothing."""
    machine, _ = machine_in(S.SWITCH_ON_DISABLED)
    machine.control(0x86)
    assert machine.state is S.SWITCH_ON_DISABLED
    machine.control(0x06)
    assert machine.state is S.READY_TO_SWITCH_ON


@pytest.mark.requirement("C402-020", "C402-027")
def test_enable_operation_in_ready_passes_switched_on():
    """000Fh in Ready: transition 3, and 4 only after the status word has been seen in Switched on."""
    machine, log = machine_in(S.READY_TO_SWITCH_ON)
    assert machine.control(0x0F) is Action.POWER_ON
    machine.power_is_on()
    assert machine.state is S.SWITCHED_ON
    assert machine.cycle() is Action.NOTHING
    machine.status_seen = True
    assert machine.cycle() is Action.ENABLE
    assert [entry[0] for entry in log] == [3, 4]


def test_withdrawn_command_cancels_the_waiting_transition():
    """Shutdown while the high-level power comes up keeps the drive in Ready."""
    machine, log = machine_in(S.READY_TO_SWITCH_ON)
    machine.control(0x0F)
    machine.control(0x06)
    machine.power_is_on()
    assert (machine.state, log) == (S.READY_TO_SWITCH_ON, [])
    machine.control(0x0F)
    machine.control(0x07)
    machine.power_is_on()
    machine.status_seen = True
    assert machine.cycle() is Action.NOTHING
    assert machine.state is S.SWITCHED_ON


@pytest.mark.requirement("C402-030")
def test_internal_disable_voltage():
    """Safe torque off: every state with or towards torque falls to Switch on disabled, a fault stays one."""
    for state, transitions in (
        (S.SWITCH_ON_DISABLED, []),
        (S.READY_TO_SWITCH_ON, [7]),
        (S.SWITCHED_ON, [10]),
        (S.OPERATION_ENABLED, [9]),
        (S.QUICK_STOP_ACTIVE, [12]),
    ):
        machine, log = machine_in(state)
        machine.disable_voltage()
        assert (machine.state, [entry[0] for entry in log]) == (S.SWITCH_ON_DISABLED, transitions)
    machine, log = machine_in(S.FAULT_REACTION_ACTIVE)
    assert machine.disable_voltage() is Action.OFF
    assert machine.state is S.FAULT
    machine, log = machine_in(S.SWITCH_ON_DISABLED)
    machine.inhibited = True
    machine.control(0x06)
    assert machine.state is S.SWITCH_ON_DISABLED


def test_no_switch_on_without_power():
    """Transition 3 needs the high-level supply."""
    machine, log = machine_in(S.READY_TO_SWITCH_ON)
    machine.power_available = False
    assert machine.control(0x07) is Action.NOTHING
    assert log == []


@pytest.mark.requirement("C402-043")
def test_local_control_ignores_control_words():
    """Without remote control no word has an effect."""
    machine, log = machine_in(S.SWITCHED_ON)
    machine.remote = False
    for word in COMMANDS.values():
        machine.control(word)
    assert log == []


@pytest.mark.parametrize(
    ("number", "state", "word"),
    [
        (2, S.SWITCH_ON_DISABLED, 0x06),
        (3, S.READY_TO_SWITCH_ON, 0x07),
        (4, S.SWITCHED_ON, 0x0F),
        (15, S.FAULT, 0x80),
    ],
)
def test_refused_transitions(number: int, state: S, word: int):
    """A transition that a test refuses is not made, and made again afterwards."""
    machine, _ = machine_in(state)
    machine.refused = frozenset({number})
    machine.control(word)
    assert machine.state is state
    machine.refused = frozenset()
    machine.control(0x00 if word == 0x80 else 0x07 if word == 0x0F else 0x06)
    if machine.control(word) is Action.POWER_ON:
        machine.power_is_on()
    assert machine.state is not state


EVENTS = (
    "fault",
    "hard_fault",
    "stop_finished",
    "power_is_on",
    "disable_voltage",
    "quick_stop_event",
    "cycle",
)
ALLOWED = {
    (0, None, 0), (1, 0, 1), (2, 1, 2), (3, 2, 3), (4, 3, 4), (5, 4, 3), (6, 3, 2), (7, 2, 1), (8, 4, 2),
    (9, 4, 1), (10, 3, 1), (11, 4, 5), (12, 5, 1), (14, 6, 7), (15, 7, 1), (16, 5, 4),
}  # fmt: skip


@pytest.mark.exhaustive
@settings(deadline=None)
@given(
    st.lists(st.one_of(st.integers(0, 0xFFFF), st.sampled_from(EVENTS)), max_size=60),
    st.tuples(st.integers(0, 8), st.integers(0, 1), st.integers(0, 1), st.integers(0, 4)),
)
def test_only_transitions_of_the_profile_are_ever_made(
    inputs: list[int | str], options: tuple[int, int, int, int]
):
    """Whatever words and events come in whatever order, each transition joins the states that the profile
    joins.
    """
    log: list[tuple[int, S, S]] = []
    machine = PowerStateMachine(lambda number, old, new: log.append((number, old, new)))
    codes = machine.options
    codes.quick_stop, codes.shutdown, codes.disable_operation, codes.fault_reaction = options
    machine.start()
    machine.initialised()
    for item in inputs:
        count = len(log)
        if isinstance(item, int):
            machine.control(item)
            made = [number for number, _, _ in log[count:]]
            assert len(made) <= 1 or made == [11, 12]
        elif item == "fault":
            machine.fault()
        elif item == "hard_fault":
            machine.fault(can_brake=False)
        elif item == "quick_stop_event":
            machine.quick_stop()
        else:
            getattr(machine, item)()
        machine.status_seen = True
    for number, old, new in log[1:]:
        assert number == 13 or (number, int(old), int(new)) in ALLOWED
