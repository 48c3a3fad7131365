"""Coverage: fault against reaction, fault against state, requirement against case."""

from __future__ import annotations

import numpy as np

from reports import (
    AlarmRecord,
    CaseResult,
    Check,
    FaultRecord,
    RequirementInfo,
    RunResult,
    Signal,
    Verdict,
    fault_reaction_matrix,
    fault_state_matrix,
    prefix_totals,
    requirement_matrix,
)
from reports.coverage import not_looked_at, value_pairs


def make(*cases: CaseResult, **more) -> RunResult:
    return RunResult("t", 1, "b", "", {}, "", list(cases), **more)


def fault(kind="encoder.freeze", applied: float | None = 1.0, state="MOTION") -> FaultRecord:
    return FaultRecord(kind, "drive1", 0.0, applied, None, axis_state=state)


def alarm(time=1.01, number=521, reaction=4) -> AlarmRecord:
    return AlarmRecord(time, "axis1", number, reaction, "")


def test_reaction_is_that_of_the_alarms_after_the_fault():
    """An alarm before the application is not the reaction; without one the fault had none."""
    matrix = fault_reaction_matrix(
        make(
            CaseResult("after", "", Verdict.PASSED, faults=[fault()], alarms=[alarm()]),
            CaseResult("before", "", Verdict.FAILED, faults=[fault()], alarms=[alarm(time=0.99)]),
        )
    )
    assert matrix.cell("encoder.freeze", "remove enable").cases == ["after"]
    assert matrix.cell("encoder.freeze", "remove enable").notes == ["521"]
    assert matrix.cell("encoder.freeze", "no alarm").cases == ["before"]
    assert matrix.cell("encoder.freeze", "no alarm").verdict is Verdict.FAILED


def test_alarm_belongs_to_the_latest_fault_before_it():
    """With two faults in a case each gets the alarms up to the next one."""
    case = CaseResult(
        "c",
        "",
        Verdict.PASSED,
        faults=[fault("a", 1.0), fault("b", 2.0)],
        alarms=[alarm(1.5, 431, 3), alarm(2.5)],
    )
    matrix = fault_reaction_matrix(make(case))
    assert matrix.cell("a", "emergency stop ramp").notes == ["431"]
    assert matrix.cell("b", "remove enable").notes == ["521"]
    assert matrix.tried == 2


def test_untried_faults_reactions_and_states_stay_visible():
    """Rows come from the catalogue, states from the state signal, so that gaps show."""
    signal = Signal(
        "axis1.state", "", np.arange(2.0), np.zeros(2), {0: "DISABLED", 3: "STANDSTILL", 4: "MOTION"}
    )
    other = Signal("drive1.state", "", np.arange(2.0), np.zeros(2), {0: "Fault"})
    run = make(
        CaseResult("c", "", Verdict.PASSED, faults=[fault()], signals=[signal, other]),
        fault_catalogue=["can.drop"],
    )
    states = fault_state_matrix(run)
    assert states.rows == ["can.drop", "encoder.freeze"]
    assert states.columns == ["DISABLED", "STANDSTILL", "MOTION"]
    assert (states.tried, states.possible) == (1, 6)
    assert not states.cell("can.drop", "MOTION").cases
    assert "stop, maximum dynamics" in fault_reaction_matrix(run).columns


def test_fault_that_was_not_injected_is_no_coverage():
    """A blocked fault has a column of its own and counts neither as tried nor as possible."""
    run = make(
        CaseResult("c", "", Verdict.BLOCKED, faults=[fault(applied=None)]),
        CaseResult("d", "", Verdict.PASSED, faults=[fault()]),
    )
    for matrix in (fault_reaction_matrix(run), fault_state_matrix(run)):
        assert matrix.columns[-1] == "not injected"
        assert matrix.cell("encoder.freeze", "not injected").verdict is Verdict.BLOCKED
        assert matrix.tried == 1
        assert matrix.possible == len(matrix.columns) - 1


def test_case_counts_once_per_cell_and_the_gravest_verdict_rules():
    """Repeated faults of one kind do not multiply a case."""
    run = make(
        CaseResult("a", "", Verdict.PASSED, faults=[fault(applied=1.0), fault(applied=2.0)]),
        CaseResult("b", "", Verdict.ERROR, faults=[fault()]),
    )
    cell = fault_state_matrix(run).cell("encoder.freeze", "MOTION")
    assert cell.cases == ["a", "b"]
    assert (cell.verdict, cell.count(Verdict.PASSED), cell.count(Verdict.ERROR)) == (Verdict.ERROR, 1, 1)


def test_check_speaks_for_its_requirement_and_case_for_the_rest():
    """A failed case leaves a requirement green whose own check passed, and no other."""
    case = CaseResult("c", "", Verdict.FAILED, requirements=["STP-001", "STP-002"])
    case.checks = [
        Check("a", Verdict.PASSED, "", "", requirements=["STP-001", "STP-003"]),
        Check("b", Verdict.FAILED, "", "", requirements=["STP-003"]),
    ]
    rows = {row.identifier: row.verdict for row in requirement_matrix(make(case))}
    assert rows == {"STP-001": Verdict.PASSED, "STP-002": Verdict.FAILED, "STP-003": Verdict.FAILED}


def test_one_failing_case_makes_a_requirement_fail():
    """The gravest verdict of all cases is that of the requirement; blocked is not passed."""
    run = make(
        CaseResult("a", "", Verdict.PASSED, requirements=["X-1", "X-2"]),
        CaseResult("b", "", Verdict.FAILED, requirements=["X-1"]),
        CaseResult("c", "", Verdict.BLOCKED, requirements=["X-2"]),
    )
    rows = {row.identifier: row for row in requirement_matrix(run)}
    assert rows["X-1"].verdict is Verdict.FAILED
    assert rows["X-1"].cases == [("a", Verdict.PASSED), ("b", Verdict.FAILED)]
    assert rows["X-2"].verdict is Verdict.BLOCKED


def test_totals_per_family_add_up():
    """Untested, unknown and tested requirements are distinguished, family by family."""
    run = make(
        CaseResult("a", "", Verdict.PASSED, requirements=["STP-001", "C402-9"]),
        CaseResult("b", "", Verdict.ERROR, requirements=["STP-002"]),
        requirements=[RequirementInfo(f"STP-00{number}", "", "", "") for number in (1, 2, 3)],
    )
    rows = requirement_matrix(run)
    assert [(row.identifier, row.known) for row in rows] == [
        ("STP-001", True),
        ("STP-002", True),
        ("STP-003", True),
        ("C402-9", False),
    ]
    c402, stp = prefix_totals(rows)
    assert (stp.prefix, stp.known, stp.passed, stp.failed, stp.untested, stp.orphaned) == (
        "STP",
        3,
        1,
        1,
        1,
        0,
    )
    assert (c402.prefix, c402.known, c402.passed, c402.orphaned) == ("C402", 0, 1, 1)


def test_what_nobody_has_looked_at_is_what_no_case_has():
    """A signal that one case has looked at is not unread, whatever the others did."""
    run = make(
        CaseResult("a", "A", Verdict.PASSED, looked_at=["x.v"], not_looked_at=["x.s", "d.torque"]),
        CaseResult("b", "B", Verdict.FAILED, looked_at=["x.s"], not_looked_at=["x.v", "d.inputs"]),
    )
    assert not_looked_at(run) == ["d.inputs", "d.torque"]
    assert not_looked_at(make()) == []


def test_pairs_of_values_are_those_of_judged_cases():
    """Every two values of different factors count once; a blocked case adds to those that are missed."""
    run = make(
        CaseResult("a", "A", Verdict.PASSED, configuration={"bus": "can", "unit": "mm", "jerk": "none"}),
        CaseResult("b", "B", Verdict.FAILED, configuration={"bus": "can", "unit": "in", "jerk": "none"}),
        CaseResult("c", "C", Verdict.BLOCKED, configuration={"bus": "can", "unit": "um", "jerk": "none"}),
    )
    assert value_pairs(run) == (5, 2)
    assert value_pairs(make()) == (0, 0)
