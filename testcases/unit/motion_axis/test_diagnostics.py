"""The pages of the diagnosis: every indication TRUE where it should be and FALSE elsewhere (section 4)."""

from __future__ import annotations

import json

import pytest

from motion.s7.diagnostics import diagnose, pages
from testcases.catalogue import each, requirements_in
from testcases.unit.motion_axis.conftest import TorquePort


def raise_alarm(rig, number):
    rig.axis.object.alarms.raise_alarm(number)
    rig.cycles(2)


def resting(rig):
    rig.enabled()
    rig.run(0.5)


def moving(rig):
    rig.travelling(100.0)


def accelerating(rig):
    rig.enabled()
    rig.axis.move_velocity(300.0)
    rig.run(0.1)


def braking(rig):
    rig.travelling(300.0)
    rig.axis.halt()
    rig.run(0.1)


def jogging(rig):
    rig.enabled()
    rig.axis.jog(100.0)
    rig.run(0.3)


def positioning(rig):
    rig.enabled()
    rig.axis.move_relative(100.0)
    rig.run(0.3)


def stopping(rig):
    rig.travelling(100.0)
    rig.axis.stop(3)
    rig.cycles(3)


def superimposed(rig):
    rig.travelling(100.0)
    rig.axis.move_superimposed(200.0)
    rig.run(0.2)


def halting_superimposed(rig):
    superimposed(rig)
    rig.axis.halt_superimposed()
    rig.cycles(2)


def speed_control(rig):
    rig.enabled(start_mode=0)


def homed(rig):
    rig.enabled()
    rig.axis.home(0.0)
    rig.cycles(2)


def limited(rig):
    rig.enabled()
    rig.axis.move_velocity(9999.0)
    rig.cycles(2)


def start_value_changed(rig):
    rig.axis.object.variables.write_start("Mechanics.LeadScrew", 20.0)
    rig.cycles(1)


def negative_switch(rig):
    rig.enabled()
    rig.port.switches = 1
    rig.cycles(2)


def positive_switch(rig):
    rig.enabled()
    rig.port.switches = 2
    rig.cycles(2)


def restarting(rig):
    rig.axis.reset(restart=True)
    rig.cycles(2)


def homing(rig):
    rig.enabled()
    rig.axis.home(0.0, mode=3)
    rig.run(0.3)


SWITCHES = {"PositionLimits_HW.Active": True}
SOFT = {
    "PositionLimits_SW.Active": True,
    "PositionLimits_SW.MinPosition": -10.0,
    "PositionLimits_SW.MaxPosition": 10.0,
}


def beyond(position):
    def scenario(rig):
        rig.enabled()
        rig.axis.home(position)
        rig.cycles(2)

    return scenario


def alarm(number):
    def scenario(rig):
        rig.enabled()
        raise_alarm(rig, number)

    return scenario


# page, indication, identifiers, scenario in which it is TRUE, start values
TRUE_WHEN = [
    ("axis status", "enabled", ["DIA-002", "DIA-028"], resting, {}),
    ("axis status", "error", ["DIA-003", "DIA-031"], alarm(321), {}),
    ("axis status", "restart active", ["DIA-004", "DIA-032"], restarting, {}),
    ("motion status", "homing job", ["DIA-044"], homing, {}),
    ("warnings", "configuration", ["DIA-016", "DIA-054"], alarm(110), {}),
    ("warnings", "job rejected", ["DIA-017", "DIA-055"], alarm(322), {}),
    ("warnings", "adaption", ["VAR-084"], alarm(111), {}),
    ("warnings", "following error", ["MON-015"], alarm(522), {}),
    ("errors", "system", ["DIA-019", "DIA-057"], alarm(201), {}),
    ("errors", "I/O", ["DIA-024", "DIA-063"], alarm(401), {}),
    ("errors", "adaption", ["DIA-071"], alarm(102), {}),
    ("axis status", "drive ready", ["DIA-006", "DIA-034"], resting, {}),
    ("axis status", "restart required", ["DIA-007", "DIA-038"], start_value_changed, {}),
    ("axis status", "position-controlled mode", ["DIA-029"], resting, {}),
    ("axis status", "homed", ["DIA-030"], homed, {}),
    ("limit switches", "negative software limit switch", ["DIA-039"], beyond(-11.0), SOFT),
    ("limit switches", "positive software limit switch", ["DIA-040"], beyond(11.0), SOFT),
    ("limit switches", "negative hardware limit switch", ["DIA-041"], negative_switch, SWITCHES),
    ("limit switches", "positive hardware limit switch", ["DIA-042"], positive_switch, SWITCHES),
    ("motion status", "done", ["DIA-008", "DIA-043"], resting, {}),
    ("motion status", "jog", ["DIA-009", "DIA-045"], jogging, {}),
    ("motion status", "velocity setpoint", ["DIA-010", "DIA-046"], moving, {}),
    ("motion status", "constant velocity", ["DIA-011", "DIA-048"], moving, {}),
    ("motion status", "accelerating", ["DIA-012", "DIA-050"], accelerating, {}),
    ("motion status", "decelerating", ["DIA-013", "DIA-050"], braking, {}),
    ("motion status", "stop job active", ["DIA-015", "DIA-052"], stopping, {}),
    ("motion status", "positioning job", ["DIA-047"], positioning, {}),
    ("motion status", "standstill", ["DIA-049"], resting, {}),
    ("motion status", "superimposed motion", ["DIA-053"], superimposed, {}),
    ("motion status", "superimposed motion is halted", ["DIA-053"], halting_superimposed, {}),
    ("warnings", "dynamic limit", ["DIA-018", "DIA-056"], limited, {}),
    ("errors", "configuration", ["DIA-020", "DIA-058"], alarm(107), {}),
    ("errors", "user program", ["DIA-021", "DIA-059"], alarm(304), {}),
    ("errors", "job rejected", ["DIA-025", "DIA-064"], alarm(321), {}),
    ("errors", "drive", ["DIA-022", "DIA-060"], alarm(421), {}),
    ("errors", "encoder", ["DIA-061"], alarm(411), {}),
    ("errors", "software limit switch", ["DIA-069"], alarm(533), {}),
    ("errors", "hardware limit switch", ["DIA-070"], alarm(531), {}),
    ("errors", "following error", ["DIA-068"], alarm(521), {}),
    ("errors", "positioning", ["DIA-066"], alarm(541), {}),
    ("errors", "homing", ["DIA-065"], alarm(341), {}),
    ("errors", "data exchange", ["DIA-023", "DIA-062"], alarm(431), {}),
]  # fmt: skip


INDICATION_IS_TRUE_WHEN_IT_SHOULD_BE_CASES = [
    pytest.param(
        page,
        name,
        scenario,
        start,
        id=f"{page}-{name}".replace(" ", "_"),
        marks=pytest.mark.requirement(*ids),
    )
    for page, name, ids, scenario, start in TRUE_WHEN
]


def check_indication_is_true_when_it_should_be(make_rig, page, name, scenario, start):
    rig = make_rig(variables=start)
    rig.run(0.1)
    before = diagnose(rig.axis.object).pages[page][name]
    assert before is (name in ("done", "standstill", "constant velocity"))
    scenario(rig)
    assert diagnose(rig.axis.object).pages[page][name] is True


@pytest.mark.exhaustive
@requirements_in(INDICATION_IS_TRUE_WHEN_IT_SHOULD_BE_CASES)
def test_indication_is_true_when_it_should_be(make_rig, subtests):
    """FALSE on a fresh axis (TRUE where rest is what it indicates), TRUE in its situation."""
    for label, values in each(INDICATION_IS_TRUE_WHEN_IT_SHOULD_BE_CASES):
        with subtests.test(label):
            check_indication_is_true_when_it_should_be(make_rig, *values)


@pytest.mark.parametrize(
    ("speed", "mode"),
    [
        pytest.param(True, "Simulation.Mode", marks=pytest.mark.requirement("DIA-001")),
        pytest.param(False, "Simulation.Mode", marks=pytest.mark.requirement("DIA-027")),
        pytest.param(True, "VirtualAxis.Mode", marks=pytest.mark.requirement("DIA-001")),
        pytest.param(False, "VirtualAxis.Mode", marks=pytest.mark.requirement("DIA-027")),
    ],
)
def test_simulation(make_rig, speed, mode):
    """X25 of a simulated and of a virtual axis, whether enabled or not; nothing goes to the drive."""
    rig = make_rig(speed=speed, variables={mode: 1})
    rig.cycles(2)
    assert diagnose(rig.axis.object).pages["axis status"]["simulation active"] is True
    rig.enabled()
    rig.axis.move_velocity(100.0)
    rig.run(0.5)
    assert diagnose(rig.axis.object).words["StatusWord"] >> 25 & 1
    assert rig.port.written[1] == 0.0


@pytest.mark.parametrize(
    "speed",
    [
        pytest.param(True, marks=pytest.mark.requirement("DIA-014")),
        pytest.param(False, marks=pytest.mark.requirement("DIA-051")),
    ],
)
def test_torque_limit(make_rig, speed):
    """X27 while a limit is commanded and the drive says that it is reached."""
    rig = make_rig(speed=speed, port=TorquePort()).enabled()
    rig.axis.torque_limiting(0.5)
    rig.cycles(3)
    assert diagnose(rig.axis.object).pages["motion status"]["torque limit active"] is False
    rig.port.torque_limit_reached = True
    rig.cycles(3)
    found = diagnose(rig.axis.object)
    assert found.pages["motion status"]["torque limit active"] is True
    assert found.words["StatusWord"] >> 27 & 1


@pytest.mark.requirement("DIA-035", "DIA-037")
def test_encoder(rig):
    """`State` is 2 with a value and 0 without; `Adjusted` tells of an adjustment, not of a position that was
    set.
    """
    rig.enabled()
    status = diagnose(rig.axis.object).pages["axis status"]
    assert (status["encoder values valid"], status["encoder homed"]) == (2, 0)
    rig.until(rig.axis.home(5.0).done)
    assert diagnose(rig.axis.object).pages["axis status"]["encoder homed"] == 0
    rig.until(rig.axis.home(5.0, mode=13).done)
    assert diagnose(rig.axis.object).pages["axis status"]["encoder homed"] == 1
    rig.port.link = False
    rig.cycles(2)
    assert diagnose(rig.axis.object).pages["axis status"]["encoder values valid"] == 0


@pytest.mark.requirement("DIA-106")
def test_an_enabled_axis_at_rest():
    """Done, constant velocity and standstill; no command bit."""
    from testcases.unit.motion_axis.conftest import Rig

    rig = Rig()
    resting(rig)
    word = diagnose(rig.axis.object).words["StatusWord"]
    assert word >> 6 & 1
    assert word >> 12 & 1
    assert word >> 7 & 1
    assert word >> 8 & 0xF == 0


@pytest.mark.requirement("DIA-103", "DIA-104")
def test_error_bit_detail_and_pending_alarms_agree(rig):
    """With an alarm: X1, an ErrorWord bit, ErrorDetail of the alarm of highest priority; a warning alone sets
    no X1.
    """
    rig.enabled()
    raise_alarm(rig, 501)
    found = diagnose(rig.axis.object)
    assert found.words["WarningWord"]
    assert not found.words["ErrorWord"]
    assert not found.pages["axis status"]["error"]
    raise_alarm(rig, 321)
    raise_alarm(rig, 421)
    found = diagnose(rig.axis.object)
    assert found.pages["axis status"]["error"]
    assert found.words["ErrorWord"]
    assert found.alarms[0]["number"] == rig.axis.var("ErrorDetail.Number")
    assert found.alarms[0]["reaction"] == rig.axis.var("ErrorDetail.Reaction")
    assert {entry["number"] for entry in found.alarms} >= {321, 421, 501}


@pytest.mark.requirement("DIA-105")
@pytest.mark.parametrize(
    "scenario", [resting, moving, accelerating, braking, positioning, superimposed, jogging]
)
def test_at_most_one_of_the_three_motion_bits(rig, scenario):
    """Accelerating, decelerating and constant velocity exclude each other in every cycle."""
    scenario(rig)
    for word in rig.column("status_word"):
        assert sum(int(word) >> bit & 1 for bit in (12, 13, 14)) <= 1


@pytest.mark.requirement(
    "DIA-092", "DIA-093", "DIA-094", "DIA-096", "DIA-097", "DIA-098", "DIA-090", "DIA-099"
)
def test_values_are_those_of_the_variables(rig):
    """Setpoints, actual values, limits and override of the page are the variables of the object."""
    positioning(rig)
    values = diagnose(rig.axis.object).pages["values"]
    assert values["target position"] == pytest.approx(100.0)
    assert values["velocity setpoint"] == pytest.approx(100.0)
    assert values["position setpoint"] == rig.column("position_setpoint")[-1]
    assert values["actual position"] == rig.column("actual_position")[-1]
    assert values["actual velocity"] == rig.column("actual_velocity")[-1]
    assert values["following error"] == rig.column("following_error")[-1]
    assert values["velocity override"] == 100.0
    assert (values["maximum velocity"], values["maximum jerk"]) == (500.0, 20000.0)


@pytest.mark.requirement("DIA-089", "DIA-091")
def test_a_speed_axis_has_pages_of_its_own(make_rig):
    """No limit switches, no position; speed setpoint and actual speed."""
    rig = make_rig(speed=True)
    rig.enabled()
    job = rig.axis.move_velocity(600.0)
    rig.until(job.in_velocity)
    rig.cycles(2)
    found = diagnose(rig.axis.object)
    assert "limit switches" not in found.pages
    assert "homed" not in found.pages["axis status"]
    assert found.pages["values"]["speed setpoint"] == pytest.approx(600.0)
    assert found.pages["values"]["actual speed"] == pytest.approx(600.0)


def test_dump_is_json_and_text(rig):
    """as_dict goes through JSON; the text shows every page and the words of the telegram with their bits."""
    moving(rig)
    found = rig.axis.diagnosis()
    content = json.loads(json.dumps(found.as_dict()))
    assert content["axis"] == "axis1"
    assert content["job"].startswith("MC_MoveVelocity")
    text = found.text()
    for title in pages(has_position=True):
        assert f"\n{title}\n" in text
    assert "\naxis status\n  [x] enabled\n  [x] drive ready\n" in text, "what is set comes first"
    assert "\n  not set: simulation active, error, restart active, " in text
    assert "      encoder values valid: 2 (valid)\n" in text
    assert "      maximum velocity: 500 mm/s\n" in text
    assert content["units"]["maximum jerk"] == "mm/s3"
    assert "CONTROL_BY_PLC" in text
