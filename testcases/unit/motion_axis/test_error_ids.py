"""Every `ErrorID` that the runtime gives: one instruction with one wrong input or in one forbidden state
(TA-028, §0.2).
"""

from __future__ import annotations

import re
from collections.abc import Callable
from math import nan
from pathlib import Path
from typing import Any

import pytest

import motion
from motion.s7.alarms import error_ids, error_text
from motion.s7.axis import jobs
from motion.s7.instructions import MC_MoveAbsolute, MC_Power
from testcases.catalogue import each, requirements_in
from testcases.unit.motion_axis.conftest import Rig, TorquePort

ROOT = Path(__file__).parents[3]
Provoke = Callable[[Rig], Any]


def call(method: str, *values: Any, **inputs: Any) -> Provoke:
    """Start an instruction of the axis."""
    return lambda rig: getattr(rig.axis, method)(*values, **inputs)


def after(*before: Provoke, then: Provoke) -> Provoke:
    """Bring about a state by other instructions, two cycles each."""

    def provoke(rig: Rig) -> Any:
        for one in before:
            one(rig)
            rig.cycles(2)
        return then(rig)

    return provoke


def alarmed(rig: Rig) -> Any:
    rig.axis.object.alarms.raise_alarm(421)
    rig.cycles(2)
    return rig.axis.move_velocity(10.0)


def on_a_speed_axis(rig: Rig) -> Any:
    other = Rig(speed=True).enabled()
    job = other.axis.run(MC_MoveAbsolute(other.axis.object, Execute=True))
    other.cycles(2)
    return job


def power(**inputs: Any) -> Provoke:
    def provoke(rig: Rig) -> Any:
        rig.axis.power_instance.set(**inputs)
        return rig.axis.power_instance

    return provoke


def second_power(rig: Rig) -> Any:
    return rig.axis.run(MC_Power(rig.axis.object, Enable=False))


def while_restarting(rig: Rig) -> Any:
    rig.axis.power(False)
    rig.until(rig.axis.power_instance.off)
    rig.axis.reset(restart=True)
    rig.cycles(2)
    return rig.axis.move_velocity(10.0)


def disabled(rig: Rig) -> Any:
    rig.axis.power(False)
    rig.until(rig.axis.power_instance.off)
    return rig.axis.move_velocity(10.0)


def queue(rig: Rig) -> Any:
    for _ in range(9):
        rig.axis.move_relative(5.0, BufferMode=1)
        rig.cycles(1)
    return rig.axis.move_relative(5.0, BufferMode=1)


def wrong_restart(rig: Rig) -> Any:
    rig.axis.power(False)
    rig.until(rig.axis.power_instance.off)
    rig.axis.variables.write_start("Mechanics.LeadScrew", 0.0)
    reset = rig.axis.reset(restart=True)
    rig.until(reset.error)
    return reset


def without_value(rig: Rig) -> Any:
    rig.axis.power(False)
    rig.until(rig.axis.power_instance.off)
    rig.port.link = False
    rig.cycles(2)
    return rig.axis.home(0.0)


def without_position_control(rig: Rig) -> Any:
    rig.axis.move_velocity(50.0, PositionControlled=False)
    rig.cycles(2)
    return rig.axis.torque_limiting(1.0, mode=1)


ABSOLUTE = {"Sensor[1].Type": 1}
TORQUE = {"Actor.DriveParameter.ReferenceTorque": 4.0}

# ErrorID, requirement, what brings it about, whether the job that runs meanwhile goes on, start values, port
TABLE: list[tuple[int, str, Provoke, bool, dict[str, Any], type[TorquePort] | None]] = [
    (0x8001, "MC-002", alarmed, False, {}, None),
    (0x8002, "MC-007", on_a_speed_axis, True, {}, None),
    (0x8003, "MC-007", call("move_velocity", nan), True, {}, None),
    (0x8004, "MC-007", call("move_velocity", 10.0, Acceleration=0.0), True, {}, None),
    (0x8005, "MC-007", call("move_velocity", 10.0, Deceleration=0.0), True, {}, None),
    (0x8006, "MC-007", call("move_velocity", 10.0, Jerk=nan), True, {}, None),
    (0x8007, "MC-003", call("move_velocity", 10.0, Direction=7), True, {}, None),
    (0x8008, "MC-007", call("move_relative", nan), True, {}, None),
    (0x8009, "MC-007", call("move_absolute", nan), True, {}, None),
    (0x800A, "MC-007", call("halt", Mode=7), True, {}, None),
    (0x800B, "MC-007", power(StopMode=7), True, {}, None),
    (0x800C, "MC-608", second_power, True, {}, None),
    (0x800D, "MC-008", while_restarting, False, {}, None),
    (0x800E, "MC-009", call("reset", restart=True), True, {}, None),
    (0x800F, "MC-010", disabled, False, {}, None),
    (0x800F, "MC-010", after(call("stop", 3), then=call("move_velocity", 10.0)), False, {}, None),
    (0x8010, "MC-011", call("home", 0.0, mode=7), True, {}, None),
    (0x8011, "MC-011", call("home", 0.0, mode=13), True, ABSOLUTE, None),
    (0x8014, "MC-012", queue, True, {}, None),
    (0x8015, "MC-609", wrong_restart, False, {}, None),
    (0x8016, "MC-013", without_value, False, {}, None),
    (0x8043, "MC-610", call("torque_limiting", nan), True, TORQUE, TorquePort),
    (0x8044, "MC-611", call("torque_limiting", 1.0), True, TORQUE, None),
    (
        0x8045,
        "MC-612",
        after(
            call("torque_limiting", 1.0, mode=1), then=call("move_velocity", 10.0, PositionControlled=False)
        ),
        True,
        TORQUE,
        TorquePort,
    ),
    (0x804A, "MC-615", call("torque_additive", 2.0e12), True, TORQUE, TorquePort),
    (0x804B, "MC-615", call("torque_range", 2.0e12, -1.0), True, TORQUE, TorquePort),
    (0x804C, "MC-615", call("torque_range", 1.0, -2.0e12), True, TORQUE, TorquePort),
    (0x804D, "MC-615", call("torque_range", -1.0, 1.0), True, TORQUE, TorquePort),
    (
        0x804E,
        "MC-616",
        after(call("torque_limiting", 1.0), then=call("torque_range", 1.0, -1.0)),
        True,
        TORQUE,
        TorquePort,
    ),
    (0x804F, "MC-617", call("torque_additive", 1.0), True, TORQUE, None),
    (0x8050, "MC-618", call("set_sensor", 3), True, {}, None),
    (0x8051, "MC-618", call("set_sensor", 1, mode=3, reference=4), True, {}, None),
    (0x8055, "MC-619", call("set_axis_stw", STW1=1, STW1BitMask=1), True, {}, TorquePort),
    (0x805A, "MC-620", call("write_parameter", 999, 0), True, {}, None),
    (
        0x805B,
        "MC-621",
        call("write_parameter", 1000, True),
        True,
        {"PositionLimits_HW.MinSwitchAddress.DbNumber": 7},
        None,
    ),
    (0x805C, "MC-620", call("write_parameter", 1000, "on"), True, {}, None),
    (0x805D, "MC-620", call("write_parameter", 1010, 0.001), True, {}, None),
    (0x8071, "MC-622", without_position_control, True, TORQUE, TorquePort),
    (0x8074, "MC-623", after(call("home", 0.0, mode=8), then=call("set_sensor", 1)), True, {}, None),
    (0x8FFF, "MC-628", call("write_parameter", 1020, 2), True, {}, None),
]
ELSEWHERE = {
    0x8017: "testcases/unit/motion_axis/test_gear_in.py",
    0x8018: "testcases/unit/motion_axis/test_gear_in.py",
    0x8019: "testcases/unit/motion_axis/test_gear_in.py",
    0x80A3: "testcases/unit/motion_axis/test_measuring_input.py",
    **dict.fromkeys(
        (0x8026, 0x8034, 0x8035, 0x8036, 0x8079), "testcases/unit/motion_axis/test_gear_in_pos.py"
    ),
    **dict.fromkeys((0x8037, 0x8077, 0x8078, 0x80A1), "testcases/unit/motion_axis/test_gear_out.py"),
    **dict.fromkeys((0x8027, 0x808B, 0x80AD), "testcases/unit/motion_axis/test_cam_in.py"),
    **dict.fromkeys(
        (
            0x8070,
            0x8075,
            0x8080,
            0x8081,
            0x8082,
            0x8083,
            0x8084,
            0x808A,
            0x808C,
            0x80A8,
            0x80A9,
        ),
        "testcases/unit/motion_axis/test_shifts.py",
    ),
    0x8076: "testcases/unit/motion_axis/test_synchronous_simulation.py",
    0x8012: "testcases/unit/motion_axis/test_control_panel.py",
    0x8013: "testcases/unit/motion_axis/test_control_panel.py",
    0x8046: "testcases/unit/hil/test_torque_instructions.py",
    0x8047: "testcases/unit/hil/test_torque_instructions.py",
    **dict.fromkeys(
        (0x80EB, 0x80EC, 0x80ED, 0x80EE, 0x80EF), "testcases/unit/motion_axis/test_memory_card.py"
    ),
    **dict.fromkeys(
        (
            0x8021,
            0x8022,
            0x8023,
            0x8024,
            0x8062,
            0x8063,
            0x8064,
            0x8065,
            0x8066,
            0x80AA,
            0x80AB,
            0x80AC,
            0x80E1,
            0x80E2,
            0x80E3,
            0x80E4,
            0x80E5,
            0x80E6,
            0x80E7,
            0x80E8,
            0x80E9,
            0x80EA,
        ),
        "testcases/unit/motion_cams/test_cam_objects.py",
    ),
}
"""Those that need a control panel, a stop in the way or a memory card, and where they are brought about."""


THE_INSTRUCTION_SAYS_IT_CASES = [
    pytest.param(
        value,
        *rest,
        id=f"{value:04X}-{at}",
        marks=pytest.mark.requirement(row, "TA-028", "TA-010", "MC-014"),
    )
    for at, (value, row, *rest) in enumerate(TABLE)
]


def check_the_instruction_says_it(value, provoke, goes_on, variables, port):
    rig = Rig(variables=variables, port=port() if port else None).enabled()
    rig.until(rig.axis.home(0.0).done)
    running = rig.axis.move_velocity(50.0)
    rig.until(running.in_velocity)
    one = provoke(rig)
    rig.cycles(3)
    assert (one.Error, f"{one.ErrorID:04X}") == (True, f"{value:04X}")
    assert getattr(one, "Done", False) is False
    if goes_on:
        assert one.Busy is (value == 0x800B)  # MC_Power goes on ruling the axis
        assert rig.axis.var("Velocity") == pytest.approx(50.0)
        assert rig.axis.var("ErrorWord") == 0
    assert error_text(value).startswith(f"16#{value:04X}: ")


@pytest.mark.exhaustive
@requirements_in(THE_INSTRUCTION_SAYS_IT_CASES)
def test_the_instruction_says_it(subtests):
    """`Error` with this ErrorID and without `Busy`; the job that runs meanwhile is not touched, unless it is
    the state that is wrong.
    """
    for label, values in each(THE_INSTRUCTION_SAYS_IT_CASES):
        with subtests.test(label):
            check_the_instruction_says_it(*values)


def given_in_the_code() -> set[int]:
    """Return the error identifiers that the sources of the runtime name."""
    text = "".join(path.read_text() for path in Path(motion.__file__).parent.rglob("*.py"))
    return {int(number, 16) for number in re.findall(r"^ERROR_\w+: Final = 0x(8\w{3})$", text, re.MULTILINE)}


def test_every_error_id_is_brought_about():
    """Whatever the sources name is in the list of the system and has a test; add new ones to the table
    above.
    """
    here = {value for value, *_ in TABLE}
    assert given_in_the_code() == here | set(ELSEWHERE)
    assert here | set(ELSEWHERE) <= set(error_ids())
    for value, place in ELSEWHERE.items():
        assert f"{value:X}" in (ROOT / place).read_text()


def test_the_constants_are_one_table():
    """Ascending, and no value under two names."""
    values = [value for name, value in vars(jobs).items() if name.startswith("ERROR_")]
    assert values == sorted(set(values))


def test_the_manual_lists_them():
    """The manual has every ErrorID of the axis with the words of the system, and says which are given."""
    rows = re.findall(
        r"^\| 16#(8\w{3}) \| (.*?) \| (.*?) \|$",
        (ROOT / "docs/reference/alarms.md").read_text(),
        re.MULTILINE,
    )
    found = {int(value, 16): (text, who) for value, text, who in rows}
    assert {value: text for value, (text, _) in found.items()} == {
        value: error_ids()[value].text for value in found
    }
    given = {value for value, (_, who) in found.items() if not who.startswith("- ")}
    assert given == {value for value, *_ in TABLE} | set(ELSEWHERE)
    scope = {value for value in error_ids() if 0x8001 <= value <= 0x8016 or 0x8043 <= value <= 0x805D}
    assert scope <= set(found)
