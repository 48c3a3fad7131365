"""The invariants of section 9.2 in every cycle of every timeline; each record is checked against them when it
is made, too.
"""

from __future__ import annotations

import pytest

from testcases.catalogue import each, requirements_in
from testcases.unit.stop_timelines.invariants import RULES
from testcases.unit.stop_timelines.test_alarm_ramps import ALARMS, alarmed
from testcases.unit.stop_timelines.test_halt_and_stop import halted, stopped
from testcases.unit.stop_timelines.test_power_timelines import disabled
from testcases.unit.stop_timelines.test_remove_enable import VALUES, removed

RECORDS = {
    **{f"StopMode {mode}": (disabled, mode) for mode in (0, 1, 2, 3)},
    **{f"16#{value}": (removed, value) for value in VALUES},
    **{name: (alarmed, name) for name in ALARMS},
    "MC_Halt": (halted,),
    **{f"MC_Stop {mode}": (stopped, mode) for mode in (0, 2, 3)},
}


RULE_RULE = [pytest.param(rule, marks=pytest.mark.requirement(rule)) for rule in RULES]


def check_rule(name, rule):
    make, *arguments = RECORDS[name]
    rows = make(*arguments).rows
    assert len(rows) > 200
    assert list(RULES[rule](rows[2:])) == []


@pytest.mark.exhaustive
@requirements_in(RECORDS, RULE_RULE)
def test_rule(subtests):
    """No cycle violates it."""
    for label, values in each(RECORDS, RULE_RULE):
        with subtests.test(label):
            check_rule(*values)


# For every rule a change of one cycle that violates it.
BROKEN = {
    "STP-507": {"status": True, "busy": False},
    "STP-508": {"status": False, "busy": False, "enable": True},
    "STP-509": {"enable": True, "busy": False},
    "STP-510": {"stw1": 0x047F, "zsw1": 0x0270},
    "STP-511": {"axis_state": "ALARM_RAMP", "setpoint": 100.0, "acceleration": -1000.0, "stw1": 0x047E},
    "STP-512": {"x": 0x3000},
    "STP-513": {"x": 0x0002, "alarmed": False},
    "STP-514": {"reaction": 3, "jobs": {"job": {"Busy": True, "instruction": "MC_MoveJog"}}},
    "STP-289": {"stw1": 0x0476},
    "STP-030": {"x": 0x0001, "status": False},
}


@pytest.mark.parametrize("rule", RULES)
def test_rule_finds_a_violation(rule):
    """A rule that nothing could violate would prove nothing."""
    rows = [*disabled(1).rows[-3:]]
    assert list(RULES[rule](rows)) == []
    broken = type(rows[-1])(
        **{name: getattr(rows[-1], name) for name in type(rows[-1]).__slots__} | BROKEN[rule]
    )
    assert list(RULES[rule]([*rows, broken])) == [broken]
