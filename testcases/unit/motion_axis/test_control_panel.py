"""The axis control panel: master control, life-sign, slider, jobs (§6.2 to §6.8)."""

from __future__ import annotations

from itertools import pairwise

import pytest

from fieldbus.errors import ConfigurationError
from motion.s7.axis import AxisState
from motion.s7.commissioning import CommissioningError
from motion.s7.controller import OperatingState
from testcases.unit.motion_axis.conftest import CYCLE

X0_ENABLE, X4_PANEL, X6_DONE, X8_POSITIONING, X9_JOG = 1 << 0, 1 << 4, 1 << 6, 1 << 8, 1 << 9


@pytest.fixture
def panel(rig):
    rig.cycles(5)
    panel = rig.axis.control_panel(monitoring_s=1.0)
    panel.take_control()
    rig.cycles(2)
    return panel


def enabled(rig, panel):
    panel.enable()
    rig.until(lambda: panel.enabled)
    return panel


def jogging(rig, panel):
    """Jog with 200 mm/s."""
    enabled(rig, panel)
    panel.velocity = 200.0
    panel.acceleration = 1000.0
    panel.jog()
    rig.run(1.0)


def stops(rig, deceleration):
    """Return whether the setpoint came to rest with at most `deceleration`, and at one instant with about
    that.
    """
    velocities = rig.column("velocity_setpoint")
    steepest = max(a - b for a, b in pairwise(velocities)) / CYCLE
    return velocities[-1] == 0.0 and steepest == pytest.approx(deceleration, rel=0.02)


# -- master control
# ---------------------------------------------------------------------------------------------------


@pytest.mark.requirement(
    "COM-023", "COM-009", "DIA-005", "DIA-033", "DIA-108", "VAR-032", "COM-011", "COM-070"
)
def test_taking_and_returning_control(rig, panel):
    """X4 while the panel has the axis, never X6; enabled by the panel; off before it is given back."""
    assert panel.active
    assert rig.axis.status_word & X4_PANEL
    assert not rig.axis.status_word & X6_DONE
    enabled(rig, panel)
    assert rig.axis.status_word & X0_ENABLE
    rig.run(0.2)
    assert not rig.axis.status_word & X6_DONE
    panel.release()
    rig.until(lambda: not panel.active)
    assert rig.axis.state is AxisState.DISABLED
    rig.cycles(2)
    assert not rig.axis.status_word & X4_PANEL
    assert rig.axis.status_word & X6_DONE
    assert [entry.data["what"] for entry in rig.events("panel.control")] == ["taken", "returned"]


@pytest.mark.requirement("COM-022", "COM-006", "COM-052")
def test_control_is_refused(rig):
    """The user program has it enabled; the controller is not in RUN; another panel has it."""
    rig.enabled()
    panel = rig.axis.control_panel()
    with pytest.raises(CommissioningError, match="user program has it enabled"):
        panel.take_control()
    rig.axis.power(False)
    rig.until(rig.axis.power_instance.off)
    rig.runtime.controller.stop()
    rig.cycles(3)
    with pytest.raises(CommissioningError, match="the controller is in STOP"):
        panel.take_control()
    rig.runtime.controller.run()
    rig.until(lambda: rig.runtime.controller.state is OperatingState.RUN)
    rig.run(0.1)
    panel.take_control()
    other = rig.axis.control_panel()
    with pytest.raises(CommissioningError, match="another panel"):
        other.take_control()


@pytest.mark.requirement("COM-025", "MC-004", "COM-075", "COM-034")
@pytest.mark.parametrize(
    "start",
    [
        lambda axis: axis.move_relative(1.0),
        lambda axis: axis.move_velocity(1.0),
        lambda axis: axis.halt(),
        lambda axis: axis.stop(),
        lambda axis: axis.home(0.0),
        lambda axis: axis.reset(),
        lambda axis: axis.jog(1.0),
        lambda axis: axis.motion_in_velocity(1.0),
        lambda axis: axis.torque_limiting(1.0),
        lambda axis: axis.move_superimposed(1.0),
        lambda axis: axis.write_parameter(1000, False),
        lambda axis: axis.set_axis_stw(),
    ],
)
def test_the_user_program_has_no_effect(rig, panel, start):
    """Every job of the program ends with 16#8012, whatever the panel does."""
    enabled(rig, panel)
    panel.jog(50.0)
    rig.run(0.3)
    moving = rig.axis.var("Velocity")
    job = start(rig.axis)
    rig.cycles(3)
    assert (job.Error, job.ErrorID, job.Busy) == (True, 0x8012, False)
    assert rig.axis.var("Velocity") == moving


@pytest.mark.requirement("COM-025", "COM-072", "COM-019")
def test_enable_of_the_user_program(rig, panel):
    """MC_Power: 16#8012 during panel control, no effect; afterwards it takes a new rising edge."""
    enabled(rig, panel)
    power = rig.axis.power()
    rig.cycles(3)
    assert (power.Error, power.ErrorID, power.Status) == (True, 0x8012, False)
    panel.release()
    rig.until(lambda: not panel.active)
    rig.run(0.3)
    assert not power.Status
    assert not power.Error
    assert not rig.axis.status_word & X0_ENABLE
    power.set(Enable=False)
    rig.cycles()
    power.set(Enable=True)
    rig.until(power.status)


@pytest.mark.requirement("CFG-065")
def test_an_external_encoder_has_no_panel(rig):
    """Refused when the panel is made."""
    from motion.drives.simulated import SimulatedDrivePort
    from motion.s7.axis import ExternalEncoder
    from motion.s7.commissioning import ControlPanel

    encoder = ExternalEncoder("encoder1", SimulatedDrivePort(cycle_s=CYCLE), cycle_ns=4_000_000)
    with pytest.raises(ConfigurationError, match="a speed, positioning or synchronous axis"):
        ControlPanel(rig.runtime, encoder)


# -- life sign and attention
# ---------------------------------------------------------------------------------------------


@pytest.mark.requirement("COM-031", "COM-034", "COM-024", "MC-005", "COM-074", "COM-032")
def test_a_lost_connection(rig, panel):
    """The axis goes on for the monitoring time, stops with the greatest deceleration, is returned; the panel
    shows 16#8013.
    """
    jogging(rig, panel)
    panel.disconnect()
    rig.run(0.7)
    assert rig.axis.var("Velocity") == pytest.approx(200.0)
    rig.run(0.8)
    assert stops(rig, 2000.0)
    assert not panel.active
    assert panel.error_id == 0x8013
    assert "no sign of life" in panel.message
    with pytest.raises(CommissioningError, match="does not have master control"):
        panel.jog()


@pytest.mark.requirement("COM-074", "COM-024")
@pytest.mark.parametrize(("share", "kept"), [(0.5, True), (0.9, True), (1.1, False), (5.0, False)])
def test_late_signs_of_life(rig, panel, share, kept):
    """A period below the monitoring time keeps control, one above it loses it."""
    enabled(rig, panel)
    panel.jog(50.0)
    panel.keep_alive(share * 1.0)
    rig.run(6.0)
    assert panel.active is kept
    assert panel.error_id == (0 if kept else 0x8013)
    assert (rig.axis.var("Velocity") > 0.0) is kept


@pytest.mark.requirement("COM-029", "COM-030", "COM-028")
def test_looking_away(rig, panel):
    """Stop with the greatest deceleration; control and enable are kept, the slider is back at zero."""
    jogging(rig, panel)
    panel.look_away()
    rig.run(1.0)
    assert stops(rig, 2000.0)
    assert panel.active
    assert panel.enabled
    assert panel.slider == 0.0
    panel.jog(20.0)
    rig.run(0.5)
    assert rig.axis.var("Velocity") == pytest.approx(40.0)


@pytest.mark.requirement("COM-033")
def test_a_dialog_over_the_panel(rig, panel):
    """Stop with the greatest deceleration, and control goes back."""
    jogging(rig, panel)
    panel.cover()
    rig.run(1.0)
    assert stops(rig, 2000.0)
    assert not panel.active
    assert panel.error_id == 0


@pytest.mark.requirement("COM-031", "MC-629")
def test_the_controller_takes_the_axis(rig, panel):
    """STOP ends master control."""
    enabled(rig, panel)
    panel.jog()
    rig.run(0.5)
    rig.runtime.controller.stop()
    rig.run(2.0)
    assert not panel.active
    assert rig.axis.state is AxisState.DISABLED


# -- operator controls
# ------------------------------------------------------------------------------------------------


@pytest.mark.requirement("COM-038")
def test_defaults(panel):
    """Velocity and acceleration 10 % of the limits, deceleration and jerk 100 %."""
    assert (panel.velocity, panel.acceleration, panel.deceleration, panel.jerk) == (
        50.0,
        200.0,
        2000.0,
        20000.0,
    )
    assert panel.adjust == 100.0


@pytest.mark.requirement("COM-035", "COM-036", "COM-040", "COM-048", "COM-010", "DIA-009", "COM-014")
def test_slider_and_adjustment(rig, panel):
    """Velocity x slider x adjustment; left is backward; released the axis stops with the deceleration of the
    panel.
    """
    enabled(rig, panel)
    panel.velocity = 100.0
    panel.deceleration = 500.0
    panel.adjust = 50.0
    panel.jog(100.0)
    rig.run(1.0)
    assert rig.axis.var("Velocity") == pytest.approx(50.0)
    assert rig.axis.status_word & X9_JOG
    panel.slide(37.0)
    rig.run(1.0)
    assert rig.axis.var("Velocity") == pytest.approx(18.5)
    panel.slide(-100.0)
    rig.run(1.0)
    assert rig.axis.var("Velocity") == pytest.approx(-50.0)
    rows = len(rig.rows)
    panel.slide(0.0)
    rig.run(1.0)
    velocities = rig.column("velocity_setpoint")[rows:]
    steepest = max(b - a for a, b in pairwise(velocities)) / CYCLE
    assert velocities[-1] == 0.0
    assert steepest == pytest.approx(500.0, rel=0.05)
    assert panel.enabled


@pytest.mark.requirement("COM-039", "DIA-090")
def test_limits_of_the_axis_hold(rig, panel):
    """Values above the dynamic limits act as these, without a warning, and the configuration keeps its
    own.
    """
    enabled(rig, panel)
    panel.velocity = 9000.0
    panel.acceleration = panel.deceleration = 1e6
    panel.adjust = 200.0
    panel.jog()
    rig.run(1.0)
    assert rig.axis.var("Velocity") == pytest.approx(500.0)
    numbers = [entry.data["number"] for entry in rig.events("alarm.raised")]
    assert not {501, 502, 503} & set(numbers)
    assert rig.axis.var("DynamicLimits.MaxVelocity") == 500.0
    assert rig.axis.var("DynamicDefaults.Velocity") == 100.0


@pytest.mark.requirement("COM-041", "COM-076")
def test_the_slider_stays_as_override(rig, panel):
    """At 37 %, whatever the adjustment: Override.Velocity is 37 afterwards, and a program runs with that."""
    enabled(rig, panel)
    panel.adjust = 150.0
    panel.jog(-37.0)
    rig.run(0.5)
    panel.slide(0.0)
    panel.release()
    rig.until(lambda: not panel.active)
    rig.cycles(2)
    assert rig.axis.var("Override.Velocity") == 37.0
    rig.enabled()
    rig.axis.move_velocity(100.0)
    rig.run(1.0)
    assert rig.axis.var("Velocity") == pytest.approx(37.0)


@pytest.mark.parametrize(
    ("change", "allowed"),
    [
        (lambda panel: setattr(panel, "adjust", 0.5), "1 to 200 %"),
        (lambda panel: setattr(panel, "adjust", 201.0), "1 to 200 %"),
        (lambda panel: panel.slide(101.0), "-100 to 100 %"),
        (lambda panel: panel.keep_alive(0.0), "above 0 s"),
    ],
)
@pytest.mark.requirement("COM-040", "COM-036")
def test_values_out_of_range(panel, change, allowed):
    """What, where, and what is allowed."""
    with pytest.raises(ConfigurationError, match=allowed):
        change(panel)


@pytest.mark.requirement("COM-047", "COM-036")
def test_motion_needs_the_enable(rig, panel):
    """Not enabled in the panel: refused in words; absolute positioning needs a homed axis, as ever."""
    for start in (panel.jog, lambda: panel.move_relative(1.0), lambda: panel.move_absolute(1.0), panel.home):
        with pytest.raises(CommissioningError, match="not enabled in the panel"):
            start()
    enabled(rig, panel)
    job = panel.move_absolute(5.0)
    rig.cycles(3)
    assert (job.Error, job.ErrorID) == (True, 0x8001)


# -- jobs
# ------------------------------------------------------------------------------------------------------------


@pytest.mark.requirement("COM-049", "COM-037", "DIA-047")
@pytest.mark.parametrize(
    ("distance", "slider", "end"), [(20.0, 100.0, 20.0), (-20.0, 50.0, -20.0), (20.0, -100.0, -20.0)]
)
def test_relative_positioning(rig, panel, distance, slider, end):
    """The distance with its sign; a slider on the left goes the other way; it ends by itself."""
    enabled(rig, panel)
    job = panel.move_relative(distance, slider)
    rig.run(0.2)
    assert rig.axis.status_word & X8_POSITIONING
    rig.until(job.done)
    assert rig.axis.var("Position") == pytest.approx(end)


@pytest.mark.requirement("COM-050", "COM-036", "COM-043")
def test_absolute_positioning(rig, panel):
    """To the target; released on the way the job is cancelled, and a new one goes on."""
    enabled(rig, panel)
    rig.until(panel.set_position(100.0).done)
    assert rig.axis.var("Position") == pytest.approx(100.0)
    assert rig.axis.var("StatusWord.X5")
    job = panel.move_absolute(130.0, 50.0)
    rig.run(0.4)
    assert rig.axis.var("Velocity") == pytest.approx(25.0)
    panel.slide(0.0)
    rig.run(0.5)
    assert job.CommandAborted
    assert rig.axis.var("Velocity") == 0.0
    assert rig.axis.var("Position") < 130.0
    rig.until(panel.move_absolute(130.0).done)
    assert rig.axis.var("Position") == pytest.approx(130.0)


@pytest.mark.requirement("COM-051")
@pytest.mark.parametrize(("slider", "way"), [(100.0, 30.0), (-100.0, -330.0)])
def test_absolute_positioning_on_a_modulo_axis(make_rig, slider, way):
    """Right forward, left backward; a target outside of the range is converted into it."""
    rig = make_rig(variables={"Modulo.Enable": True, "Modulo.Length": 360.0, "Modulo.StartValue": 0.0})
    rig.cycles(5)
    panel = rig.axis.control_panel()
    panel.take_control()
    enabled(rig, panel)
    rig.until(panel.set_position(350.0).done)
    panel.velocity = 400.0
    panel.acceleration = 2000.0
    first = rig.column("position_setpoint")[-1]
    rig.until(panel.move_absolute(360.0 + 20.0, slider).done)
    assert rig.axis.var("Position") == pytest.approx(20.0)
    assert rig.column("position_setpoint")[-1] - first == pytest.approx(way)


@pytest.mark.requirement("COM-044", "COM-045", "COM-046", "HOM-032")
@pytest.mark.parametrize(("relative", "end"), [(False, 50.0), (True, 62.0)])
def test_adjustment_of_an_absolute_encoder(make_rig, relative, end):
    """Absolute: the position becomes the value (Mode 7); relative: it moves by it (Mode 6)."""
    rig = make_rig(variables={"Sensor[1].Type": 1, "Sensor[1].Parameter.DeterminableRevolutions": 4096})
    rig.cycles(5)
    panel = rig.axis.control_panel()
    panel.take_control()
    enabled(rig, panel)
    rig.until(panel.set_position(12.0).done)
    assert rig.events("axis.homed")[-1].data["mode"] == 0
    rig.until(panel.adjust_encoder(50.0, relative=relative).done)
    assert rig.events("axis.homed")[-1].data["mode"] == (6 if relative else 7)
    assert rig.axis.var("ActualPosition") == pytest.approx(end, abs=1e-3)
    assert rig.axis.var("StatusSensor[1].Adjusted") == 1


@pytest.mark.requirement("COM-007", "COM-008")
def test_alarms_are_acknowledged_from_the_panel(make_rig):
    """A limit switch that is actuated: 531 each time; acknowledged, the axis is there again."""
    rig = make_rig(variables={"PositionLimits_HW.Active": True})
    rig.cycles(5)
    panel = rig.axis.control_panel()
    panel.take_control()
    for switch in (1, 2):
        enabled(rig, panel)
        rig.port.switches = switch
        rig.run(0.3)
        assert rig.axis.var("ErrorDetail.Number") == 531
        rig.port.switches = 0
        rig.run(0.1)
        panel.acknowledge()
        rig.run(0.3)
        assert rig.axis.var("ErrorDetail.Number") == 0


@pytest.mark.requirement("STP-033", "STP-381")
def test_an_acknowledgement_switches_nothing_on(rig, panel):
    """An alarm that has disabled the axis, acknowledged while the drive brakes, is gone when the drive is
    off; the axis stays off until it is enabled again.
    """
    enabled(rig, panel)
    panel.jog()
    rig.run(0.3)
    rig.axis.alarms.raise_alarm(421)
    rig.until(lambda: rig.axis.state.name == "ALARM_DRIVE_STOP")
    panel.acknowledge()
    rig.cycles(2)
    assert (panel.acknowledging, rig.axis.var("ErrorDetail.Number")) == (True, 421)
    rig.until(lambda: not rig.axis.alarms.engine.number)
    rig.run(1.0)
    assert (panel.enabled, rig.axis.state.name) == (False, "DISABLED")
    assert [entry.data["to"] for entry in rig.events("axis.state")].count("ENABLING") == 1
    enabled(rig, panel)


@pytest.mark.requirement("COM-071")
def test_values_that_are_tried_are_taken_back(rig, panel):
    """A gain that is tried in the panel acts at once and is gone when control is returned."""
    panel.try_value("PositionControl.Kv", 33.0)
    panel.try_value("PositionControl.Kv", 35.0)
    rig.cycles(2)
    assert rig.axis.var("PositionControl.Kv") == 35.0
    panel.release()
    rig.until(lambda: not panel.active)
    rig.cycles(2)
    assert rig.axis.var("PositionControl.Kv") == 20.0


@pytest.mark.requirement("COM-035", "COM-048")
def test_a_speed_axis(make_rig):
    """It jogs like the others."""
    rig = make_rig(speed=True)
    rig.cycles(5)
    panel = rig.axis.control_panel()
    panel.take_control()
    enabled(rig, panel)
    panel.jog(-50.0)
    rig.run(1.0)
    assert rig.axis.var("Velocity") == pytest.approx(-150.0)


@pytest.mark.requirement("COM-071")
def test_values_that_are_tried_when_the_controller_stops(rig, panel):
    """In STOP no program runs: releasing takes back what was tried."""
    panel.take_control()
    rig.cycles(2)
    before = rig.axis.var("PositionControl.Kv")
    panel.try_value("PositionControl.Kv", before + 7.0)
    rig.runtime.controller.stop()
    rig.run(0.5)
    assert not panel.active
    panel.release()
    rig.cycles(2)
    assert rig.axis.var("PositionControl.Kv") == before
