"""The state machine of enabling and stopping, and which stop supersedes which (sections 9 and 10 of the
stopping specification).
"""

from __future__ import annotations

import pytest

from motion.s7.axis import AxisState
from testcases.catalogue import each, requirements_in

S = AxisState
ALARM = {1: 533, 2: 104, 3: 321, 4: 421, 5: 550}
"""One alarm for every reaction; 533 keeps the axis enabled at its end."""


def alarm(rig, reaction):
    rig.axis.object.alarms.raise_alarm(ALARM[reaction], reaction=reaction)


def state(rig):
    return rig.axis.object.state


def reach(rig, wanted):
    """Bring the axis into a state; returns what the caller may need."""
    extra = {}
    if wanted is S.DISABLED:
        rig.run(0.1)
    elif wanted is S.ENABLING:
        rig.axis.power()
        rig.until(lambda: state(rig) is S.ENABLING)
        rig.port.link = True
    elif wanted is S.ENABLE_RAMP:
        rig.travelling(300.0)
        rig.axis.power(False, stop_mode=3)
        rig.until(rig.axis.power_instance.off)
        rig.axis.power(True)
        rig.until(lambda: state(rig) is S.ENABLE_RAMP)
    elif wanted is S.STANDSTILL:
        rig.enabled()
        rig.cycles(5)
    elif wanted is S.MOTION:
        rig.travelling(300.0)
    elif wanted is S.HALTING:
        rig.travelling(300.0)
        extra["job"] = rig.axis.halt()
        rig.cycles(5)
    elif wanted is S.STOPPING:
        rig.travelling(300.0)
        extra["job"] = rig.axis.stop(2)
        rig.cycles(5)
    elif wanted is S.STOP_HOLD:
        rig.travelling(300.0)
        extra["job"] = rig.axis.stop(2)
        rig.until(extra["job"].done)
    elif wanted is S.ALARM_RAMP:
        rig.travelling(300.0)
        alarm(rig, 2)
        rig.cycles(3)
    elif wanted is S.ALARM_STANDSTILL:
        rig.travelling(300.0)
        alarm(rig, 1)
        rig.until(lambda: state(rig) is S.ALARM_STANDSTILL)
    elif wanted is S.ALARM_DRIVE_STOP:
        rig.travelling(300.0)
        alarm(rig, 4)
        rig.cycles(3)
    elif wanted is S.ALARM_DISABLED:
        rig.travelling(300.0)
        alarm(rig, 4)
        rig.until(lambda: state(rig) is S.ALARM_DISABLED)
    elif wanted is S.TRACKING:
        rig.travelling(300.0)
        alarm(rig, 5)
        rig.cycles(3)
    elif wanted in (S.DISABLING_RAMP, S.DISABLING_QUICK, S.DISABLING_COAST):
        rig.travelling(300.0)
        rig.axis.power(
            False, stop_mode={S.DISABLING_RAMP: 0, S.DISABLING_QUICK: 1, S.DISABLING_COAST: 3}[wanted]
        )
        rig.until(lambda: state(rig) is wanted)
        rig.cycles(0 if wanted is S.DISABLING_COAST else 3)
    elif wanted is S.RESTARTING:
        rig.run(0.1)
        rig.axis.reset(restart=True)
        rig.cycles(2)
    assert state(rig) is wanted
    return extra


# state, identifier, X0, X1, Status, Busy, STW1, ErrorID of a motion job (0 = accepted)
OUTPUTS = [
    (S.DISABLED, "STP-446", 0, 0, 0, 0, 0x047E, 0x800F),
    (S.ENABLING, "STP-447", 0, 0, 0, 1, None, 0x800F),
    (S.ENABLE_RAMP, "STP-448", 1, 0, 1, 1, 0x047F, 0),
    (S.STANDSTILL, "STP-449", 1, 0, 1, 1, 0x047F, 0),
    (S.MOTION, "STP-450", 1, 0, 1, 1, 0x047F, 0),
    (S.HALTING, "STP-451", 1, 0, 1, 1, 0x047F, 0),
    (S.STOPPING, "STP-452", 1, 0, 1, 1, 0x047F, 0x800F),
    (S.STOP_HOLD, "STP-453", 1, 0, 1, 1, 0x047F, 0x800F),
    (S.ALARM_RAMP, "STP-454", 1, 1, 1, 1, 0x047F, 0x8001),
    (S.ALARM_STANDSTILL, "STP-597", 1, 1, 1, 1, 0x047F, 0x8001),
    (S.ALARM_DRIVE_STOP, "STP-455", 0, 1, 0, 1, 0x047B, 0x8001),
    (S.ALARM_DISABLED, "STP-456", 0, 1, 0, 1, None, 0x8001),
    (S.DISABLING_RAMP, "STP-457", 1, 0, 1, 1, 0x047F, 0x800F),
    (S.DISABLING_QUICK, "STP-458", 1, 0, 1, 1, 0x047B, 0x800F),
    (S.DISABLING_COAST, "STP-459", 1, 0, 1, 1, None, 0x800F),
    (S.TRACKING, "STP-460", 0, 1, 0, 1, 0x047F, 0x8001),
    (S.RESTARTING, "STP-461", 0, 0, 0, 0, 0x047E, 0x800D),
]  # fmt: skip


@pytest.mark.parametrize(
    ("wanted", "x0", "x1", "status", "busy", "stw1", "error"),
    [
        pytest.param(row[0], *row[2:], id=row[0].name, marks=pytest.mark.requirement(row[1]))
        for row in OUTPUTS
    ],
)
def test_outputs_of_a_state(make_rig, wanted, x0, x1, status, busy, stw1, error):
    """X0, X1, Status, Busy, STW1, and what happens to a motion job, as printed."""
    rig = make_rig(variables={"Actor.RemoveEnableReaction": 7})
    reach(rig, wanted)
    power = rig.axis.power_instance
    word = rig.axis.var("StatusWord")
    assert (word & 1, word >> 1 & 1, int(power.Status), int(power.Busy)) == (x0, x1, status, busy)
    if stw1 is not None:
        assert rig.axis.object.stw1_sent == stw1
    job = rig.axis.move_velocity(250.0)
    rig.cycles(1)
    assert job.ErrorID == error
    assert job.Busy is (error == 0)


def enabled_states():
    return [S.ENABLE_RAMP, S.STANDSTILL, S.MOTION, S.HALTING, S.STOPPING, S.STOP_HOLD]


# identifier, from, event, to (None: the same)
TRANSITIONS = [
    ("STP-462", S.DISABLED, "enable", S.ENABLING),
    ("STP-466", S.ENABLING, "disable 0", S.DISABLED),
    ("STP-467", S.ENABLING, "reaction 4", S.ALARM_DRIVE_STOP),
    ("STP-469", S.STANDSTILL, "job", S.MOTION),
    ("STP-469", S.HALTING, "job", S.MOTION),
    ("STP-469", S.ENABLE_RAMP, "job", S.MOTION),
    ("STP-471", S.MOTION, "job", S.MOTION),
    ("STP-472", S.MOTION, "halt", S.HALTING),
    ("STP-474", S.MOTION, "stop 2", S.STOPPING),
    ("STP-474", S.STANDSTILL, "stop 2", S.STOPPING),
    ("STP-474", S.HALTING, "stop 2", S.STOPPING),
    ("STP-474", S.ENABLE_RAMP, "stop 2", S.STOPPING),
    ("STP-475", S.STOPPING, "stop 2", S.STOPPING),
    ("STP-475", S.STOPPING, "stop 0", S.STOPPING),
    ("STP-478", S.STOP_HOLD, "release", S.STANDSTILL),
    ("STP-479", S.STOPPING, "reaction 3", S.ALARM_RAMP),
    ("STP-479", S.STOPPING, "reaction 4", S.ALARM_DRIVE_STOP),
    ("STP-480", S.STOPPING, "reaction 1", S.STOPPING),
    ("STP-482", S.STANDSTILL, "reaction 2", S.ALARM_RAMP),
    ("STP-482", S.MOTION, "reaction 1", S.ALARM_RAMP),
    ("STP-482", S.HALTING, "reaction 3", S.ALARM_RAMP),
    ("STP-482", S.ENABLE_RAMP, "reaction 3", S.ALARM_RAMP),
    ("STP-483", S.ALARM_RAMP, "reaction 3", S.ALARM_RAMP),
    ("STP-484", S.ALARM_RAMP, "stop 0", S.ALARM_RAMP),
    *[("STP-487", one, "reaction 4", S.ALARM_DRIVE_STOP) for one in enabled_states()],
    ("STP-487", S.DISABLING_RAMP, "reaction 4", S.ALARM_DRIVE_STOP),
    ("STP-487", S.ALARM_RAMP, "reaction 4", S.ALARM_DRIVE_STOP),
    ("STP-492", S.ALARM_DRIVE_STOP, "disable 0", S.ALARM_DRIVE_STOP),
    *[("STP-496", one, "reaction 5", S.TRACKING) for one in enabled_states()],
    *[("STP-498", one, "disable 0", S.DISABLING_RAMP) for one in enabled_states()],
    *[("STP-498", one, "disable 2", S.DISABLING_RAMP) for one in enabled_states()],
    *[("STP-499", one, "disable 1", S.DISABLING_QUICK) for one in enabled_states()],
    *[("STP-500", one, "disable 3", S.DISABLING_COAST) for one in enabled_states()],
    ("STP-502", S.DISABLING_RAMP, "enable", S.DISABLING_RAMP),
    ("STP-502", S.DISABLING_QUICK, "enable", S.DISABLING_QUICK),
    ("STP-504", S.DISABLED, "restart", S.RESTARTING),
    ("STP-599", S.ALARM_STANDSTILL, "reaction 4", S.ALARM_DRIVE_STOP),
    ("STP-599", S.ALARM_STANDSTILL, "disable 1", S.DISABLING_QUICK),
]  # fmt: skip


def happen(rig, event, extra):
    kind, _, value = event.partition(" ")
    if kind == "enable":
        rig.axis.power(True)
    elif kind == "disable":
        rig.axis.power(False, stop_mode=int(value))
    elif kind == "reaction":
        alarm(rig, int(value))
    elif kind == "stop":
        return rig.axis.stop(int(value))
    elif kind == "halt":
        rig.axis.halt()
    elif kind == "job":
        rig.axis.move_velocity(150.0)
    elif kind == "release":
        extra["job"].set(Execute=False)
    elif kind == "restart":
        rig.axis.reset(restart=True)
    return None


TRANSITION_CASES = [
    pytest.param(
        start,
        event,
        end,
        id=f"{start.name}-{event.replace(' ', '_')}",
        marks=pytest.mark.requirement(identifier),
    )
    for identifier, start, event, end in TRANSITIONS
]


def check_transition(make_rig, start, event, end):
    rig = make_rig(variables={"Actor.RemoveEnableReaction": 7})
    extra = reach(rig, start)
    passed = []
    rig.runtime.after_cycle.append(lambda: passed.append(state(rig)))
    happen(rig, event, extra)
    passed.append(state(rig))
    rig.cycles(2)
    # A drive that is off already has nothing to stop: it is through these states at once.
    assert end in passed if end in (S.ALARM_DRIVE_STOP, S.DISABLING_COAST) else state(rig) is end
    if event.startswith(("disable", "stop")) and "job" in extra and extra["job"] is not None:
        assert extra["job"].CommandAborted or extra["job"].Done


@pytest.mark.exhaustive
@requirements_in(TRANSITION_CASES)
def test_transition(make_rig, subtests):
    """The event leads to the printed state; where jobs are disabled or stopped away they end."""
    for label, values in each(TRANSITION_CASES):
        with subtests.test(label):
            check_transition(make_rig, *values)


@pytest.mark.parametrize(
    ("start", "end"),
    [
        pytest.param(S.ENABLING, S.STANDSTILL, marks=pytest.mark.requirement("STP-463")),
        pytest.param(S.ENABLE_RAMP, S.STANDSTILL, marks=pytest.mark.requirement("STP-468", "STP-464")),
        pytest.param(S.HALTING, S.STANDSTILL, marks=pytest.mark.requirement("STP-473")),
        pytest.param(S.STOPPING, S.STOP_HOLD, marks=pytest.mark.requirement("STP-476")),
        pytest.param(S.ALARM_RAMP, S.ALARM_DISABLED, marks=pytest.mark.requirement("STP-485")),
        pytest.param(S.ALARM_DRIVE_STOP, S.ALARM_DISABLED, marks=pytest.mark.requirement("STP-488")),
        pytest.param(S.DISABLING_RAMP, S.DISABLED, marks=pytest.mark.requirement("STP-501")),
        pytest.param(S.DISABLING_QUICK, S.DISABLED, marks=pytest.mark.requirement("STP-501")),
        pytest.param(S.DISABLING_COAST, S.DISABLED, marks=pytest.mark.requirement("STP-501")),
        pytest.param(S.RESTARTING, S.DISABLED, marks=pytest.mark.requirement("STP-505")),
    ],
)
def test_state_that_ends_by_itself(rig, start, end):
    """What time alone does: ramps end, the drive switches off, the restart is through."""
    reach(rig, start)
    seen = [state(rig)]
    rig.runtime.after_cycle.append(lambda: seen.append(state(rig)))
    rig.run(5.0)
    order = [one for index, one in enumerate(seen) if index == 0 or one is not seen[index - 1]]
    assert order == [start, end]
    if end in (S.DISABLED, S.ALARM_DISABLED):
        assert not rig.axis.power_instance.Status


@pytest.mark.requirement("STP-465")
@pytest.mark.parametrize("velocity_mode", [False, True])
def test_enabling_a_moving_axis_without_a_ramp(make_rig, velocity_mode):
    """StartMode 0, or VelocityModePowerOn: velocity setpoint 0 as a step, no ramp state."""
    rig = make_rig(variables={"PositionControl.VelocityModePowerOn": 1} if velocity_mode else {})
    rig.travelling(300.0)
    rig.axis.power(False, stop_mode=3)
    rig.until(rig.axis.power_instance.off)
    rig.axis.power(True, start_mode=1 if velocity_mode else 0)
    rig.until(lambda: state(rig) is not S.DISABLED and state(rig) is not S.ENABLING)
    assert state(rig) is S.STANDSTILL
    assert rig.column("velocity_setpoint")[-1] == 0.0


@pytest.mark.requirement("STP-477")
def test_stop_that_was_released_ends_in_standstill(rig):
    """Execute FALSE before the end: no hold."""
    extra = reach(rig, S.STOPPING)
    extra["job"].set(Execute=False)
    rig.until(lambda: state(rig) is not S.STOPPING)
    assert state(rig) is S.STANDSTILL


@pytest.mark.requirement("STP-480", "STP-481")
@pytest.mark.parametrize("start", [S.STOPPING, S.STOP_HOLD])
def test_weaker_alarm_during_a_stop_disables_at_standstill(rig, start):
    """The stop ends as it is; then the alarm switches the drive off."""
    reach(rig, start)
    alarm(rig, 2)
    rig.until(lambda: state(rig) is S.ALARM_DISABLED)
    assert rig.column("velocity_setpoint")[-1] == 0.0


@pytest.mark.requirement("STP-486")
def test_alarm_ramp_that_was_acknowledged_ends_in_standstill(rig):
    """Acknowledged before zero, the axis stays enabled."""
    reach(rig, S.ALARM_RAMP)
    rig.until(rig.axis.reset().done)
    assert state(rig) is S.ALARM_RAMP
    rig.until(lambda: state(rig) is not S.ALARM_RAMP)
    assert state(rig) is S.STANDSTILL


@pytest.mark.parametrize(
    ("reaction", "interrupts"),
    [
        pytest.param(1, True, marks=pytest.mark.requirement("STP-489")),
        pytest.param(7, False, marks=pytest.mark.requirement("STP-490")),
        pytest.param(5, False, marks=pytest.mark.requirement("STP-490")),
        pytest.param(3, False, marks=pytest.mark.requirement("STP-490")),
    ],
)
def test_acknowledging_while_the_drive_stops(make_rig, reaction, interrupts):
    """OFF1 is interrupted by the acknowledgement; OFF2 and OFF3 end first."""
    rig = make_rig(variables={"Actor.RemoveEnableReaction": reaction})
    reach(rig, S.ALARM_DRIVE_STOP)
    rig.axis.reset()
    rig.until(lambda: rig.axis.power_instance.Status)
    slowest = min(rig.column("actual_velocity")[-40:])
    assert (slowest > 50.0) is interrupts


@pytest.mark.requirement("STP-491")
@pytest.mark.parametrize("reaction", [1, 3, 5])
def test_disabling_while_the_drive_stops(make_rig, reaction):
    """Enable FALSE with a value other than 16#7: OFF2, whatever StopMode says, and disabled with Busy FALSE
    at the end.
    """
    rig = make_rig(variables={"Actor.RemoveEnableReaction": reaction})
    reach(rig, S.ALARM_DRIVE_STOP)
    power = rig.axis.power(False, stop_mode=0)
    rig.cycles(2)
    assert rig.axis.object.stw1_sent == 0x047C
    rig.until(lambda: state(rig) is S.ALARM_DISABLED)
    rig.cycles(1)
    assert not power.Busy


@pytest.mark.requirement("STP-492")
def test_disabling_during_off3(make_rig):
    """With 16#7 the OFF3 ramp goes on to standstill, then ALARM_DISABLED with Busy FALSE."""
    rig = make_rig(variables={"Actor.RemoveEnableReaction": 7})
    reach(rig, S.ALARM_DRIVE_STOP)
    power = rig.axis.power(False, stop_mode=3)
    rig.cycles(2)
    assert rig.axis.object.stw1_sent == 0x047B
    rig.until(lambda: state(rig) is S.ALARM_DISABLED)
    assert rig.column("actual_velocity")[-1] == pytest.approx(0.0, abs=1.0)
    rig.cycles(1)
    assert not power.Busy


@pytest.mark.parametrize(
    ("enable", "end"),
    [
        pytest.param(True, S.STANDSTILL, marks=pytest.mark.requirement("STP-493")),
        pytest.param(False, S.DISABLED, marks=pytest.mark.requirement("STP-494")),
    ],
)
def test_acknowledging_a_disabled_axis(rig, enable, end):
    """With Enable the axis comes back by itself, without it stays off."""
    reach(rig, S.ALARM_DISABLED)
    rig.axis.power(enable)
    rig.cycles(2)
    rig.until(rig.axis.reset().done)
    rig.run(0.3)
    assert state(rig) is end


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-495")
def test_fatal_alarm_holds_until_restart(rig):
    """Class R: acknowledging does not help, the restart needs Enable FALSE, and then it does."""
    rig.enabled()
    rig.axis.object.alarms.raise_alarm(105)
    rig.run(2.0)
    rig.axis.reset()
    rig.run(0.1)
    assert state(rig) is S.ALARM_DISABLED
    refused = rig.axis.reset(restart=True)
    rig.cycles(2)
    assert refused.ErrorID == 0x800E
    rig.axis.power(False)
    rig.cycles(3)
    rig.until(rig.axis.reset(restart=True).done)
    assert state(rig) is S.DISABLED


@pytest.mark.requirement("STP-497")
def test_tracking_ends_with_the_acknowledgement(rig):
    """The drive operates, Enable is TRUE: standstill or the ramp of a moving axis, without switching off."""
    reach(rig, S.TRACKING)
    rig.axis.reset()
    rig.until(lambda: state(rig) is not S.TRACKING)
    assert state(rig) in (S.STANDSTILL, S.ENABLE_RAMP)
    assert rig.axis.object.stw1_sent == 0x047F


@pytest.mark.requirement("STP-502")
def test_enable_during_the_disabling_is_remembered(rig):
    """After the drive has been off the axis is enabled again."""
    reach(rig, S.DISABLING_RAMP)
    rig.axis.power(True)
    seen = []
    rig.runtime.after_cycle.append(lambda: seen.append(state(rig)))
    rig.run(2.0)
    order = [one for index, one in enumerate(seen) if index == 0 or one is not seen[index - 1]]
    assert order[-2:] == [S.ENABLING, S.STANDSTILL]
    assert order[0] is S.DISABLING_RAMP


# -- section 10
# ------------------------------------------------------------------------------------------------------------

MATRIX = """
STP-516 stop 3      N N N P N N N N N N N
STP-517 stop 2      A N N P P N N N N N N
STP-518 stop 0      A A N P P P N N N N N
STP-519 reaction 1  A N N P N N N N N N N
STP-520 reaction 2  A A N P P N N N N A N
STP-521 reaction 3  A A A P P P N A N A N
STP-522 reaction 4  A A A P P P P 2 2 2 2
STP-523 reaction 4' A A A P P P P W W W W
STP-524 disable 0   E E E P P P N - - - -
STP-525 disable 2   E E E P P N N - - - -
STP-526 disable 1   E E E P P P R - - - -
STP-526 disable 3   E E E P P P P - - - -
"""
COLUMNS = ("stop 3", "stop 2", "stop 0", "reaction 1", "reaction 2", "reaction 3", "reaction 4",
           "disable 0", "disable 1", "disable 2", "disable 3")  # fmt: skip
SEVERITY = {
    "stop 3": 1,
    "stop 2": 2,
    "stop 0": 3,
    "reaction 1": 1,
    "reaction 2": 2,
    "reaction 3": 3,
    "disable 0": 3,
    "disable 2": 2,
}


def cells():
    for line in MATRIX.strip().splitlines():
        identifier, active = line[:7], line[8:20].strip()
        for column, what in zip(COLUMNS, line[20:].split(), strict=True):
            if what != "-":
                yield pytest.param(
                    active,
                    column,
                    what,
                    id=f"{active}-{column}".replace(" ", "_"),
                    marks=pytest.mark.requirement(identifier),
                )


def expected_severity(active, new, what):
    return SEVERITY.get(new if what == "N" else active)


CELL_OF_THE_SUPERSEDING_MATRIX_CASES = list(cells())


def check_cell_of_the_superseding_matrix(make_rig, active, new, what):
    rig = make_rig(
        variables={
            "Actor.RemoveEnableReaction": 7 if active.endswith("'") else 1 if active == "reaction 4" else 5
        }
    )
    rig.travelling(300.0)
    first = happen(rig, active.rstrip("'"), {})
    rig.cycles(3)
    before, words_before = state(rig), rig.axis.object.stw1_sent
    second = happen(rig, new, {})
    rig.cycles(3)
    severity = rig.axis.object.motion.severity
    if what == "E":
        assert (second.Error, second.Busy) == (True, False)
        assert state(rig) is before
    elif new.startswith("stop") and what == "A":
        assert second.CommandAborted
        assert not second.Error
        assert state(rig) is before
        if active in SEVERITY:
            assert severity == SEVERITY[active]
    elif new.startswith("stop"):
        assert second.Busy
        assert severity == SEVERITY[new]
        if first is not None:
            assert first.CommandAborted
    elif new == "reaction 4" and what == "N":
        assert state(rig) is S.ALARM_DRIVE_STOP
        if first is not None:
            assert first.CommandAborted
    elif what == "R":
        assert not rig.axis.object.stw1_sent & 0x4 or not rig.axis.object.stw1_sent & 0x1
        rig.until(lambda: state(rig) is S.ALARM_DISABLED)
    elif new.startswith("reaction") and what == "P":
        assert rig.axis.var("ErrorDetail.Number")
        assert state(rig) in {before, S.ALARM_DRIVE_STOP, S.ALARM_DISABLED}
        if active in SEVERITY:
            assert severity == SEVERITY[active]
        if first is not None:
            assert first.Busy
        else:
            assert rig.axis.object.stw1_sent in (words_before, 0x0478, 0x047A, 0x047C, 0x047E)
        # Reaction 1 belongs to an alarm that leaves the axis enabled, unless something else has disabled it.
        keeps = new == "reaction 1" and active in {"stop 3", "stop 2", "stop 0", "reaction 1"}
        rig.until(lambda: state(rig) is (S.ALARM_STANDSTILL if keeps else S.ALARM_DISABLED), 20.0)
    elif new.startswith("reaction"):
        assert severity == SEVERITY[new]
        if first is not None:
            assert first.CommandAborted
    elif what == "2":
        assert rig.axis.object.stw1_sent == 0x047C
    elif what == "W":
        assert rig.axis.object.stw1_sent == 0x047B
        rig.until(lambda: state(rig) is S.ALARM_DISABLED)
    elif new == "disable 1":
        assert state(rig) is S.DISABLING_QUICK
    elif new == "disable 3":
        assert rig.axis.object.stw1_sent == 0x047C
    else:
        assert severity == expected_severity(active, new, what) or severity == max(
            SEVERITY[active], SEVERITY[new]
        )
        assert not rig.axis.power_instance.Enable
        if first is not None:
            assert first.CommandAborted
        rig.until(rig.axis.power_instance.off)


@pytest.mark.exhaustive
@requirements_in(CELL_OF_THE_SUPERSEDING_MATRIX_CASES)
def test_cell_of_the_superseding_matrix(make_rig, subtests):
    """Every cell: who brakes, what the MC_Stop shows, how it ends."""
    for label, values in each(CELL_OF_THE_SUPERSEDING_MATRIX_CASES):
        with subtests.test(label):
            check_cell_of_the_superseding_matrix(make_rig, *values)
