"""`hil panel` on an NC axis: keys, fields, online view."""

import io

import pytest

from fieldbus.errors import ConfigurationError
from hil._commands.panel import run_panel
from hil.campaign import load_bench_file
from hil.panel import NcPanelSession

pytestmark = pytest.mark.exhaustive


@pytest.fixture
def panel():
    """A panel on the reference axis as an NC axis, enabled."""
    with load_bench_file("nc-axes:reference").build(seed=0) as bench:
        shown = []
        session = NcPanelSession(bench.axis(controller="nc"), time=bench, write=shown.append)
        session.bench, session.axis, session.shown = bench, bench.axis(controller="nc"), shown

        def give(*lines):
            for line in lines:
                session.execute(line)
                session.let_pass()

        session.give = give
        give("enable")
        bench.wait_until(lambda: session.axis.operational, 1.0)
        yield session
        session.close()
        assert not session.axis.operational


@pytest.mark.requirement("NC-232", "NC-233", "NC-234", "NC-235")
def test_keys_move_while_they_are_held(panel):
    """F1 to F4 move with the manual velocities, as long as they are held."""
    panel.axis.write_parameter("axis.manual_velocity_fast", 250.0)
    panel.axis.write_parameter("axis.manual_velocity_slow", 60.0)
    for key, velocity in (("f1", -250.0), ("f2", -60.0), ("f3", 60.0), ("f4", 250.0)):
        panel.give(key, "wait 0.6")
        assert panel.axis.object.motion.v == pytest.approx(velocity)
        panel.give("release", "wait 0.8")
        assert panel.axis.object.motion.v == 0.0
    panel.give("f3 0.2", "wait 0.5")
    assert panel.axis.object.motion.v == 0.0
    assert panel.notes() == []


@pytest.mark.requirement("NC-229", "NC-236", "NC-237", "NC-238")
def test_start_stop_reset(panel):
    """F5 starts to the fields, as often as it is pressed; F6 stops; only enabled directions move; F8
    resets.
    """
    for target in (30.0, -10.0):
        panel.give(f"target {target}", "velocity 200", "f5", "wait 1")
        assert panel.axis.position == pytest.approx(target, abs=0.1)
    panel.give("target 200", "f5", "wait 0.3", "f6", "wait 0.5")
    assert panel.axis.object.motion.v == 0.0
    assert panel.axis.position < 150.0
    panel.give("set 1 0 1", "f5")
    assert "0x4358" in panel.notes()[0]
    panel.give("set 1 1 1 50", "f5", "wait 0.4")
    assert panel.axis.object.motion.v == pytest.approx(100.0)
    panel.bench.drive().raise_fault(0x2310)
    panel.give("wait 0.5")
    assert "0x4650" in panel.notes()[0]
    panel.give("f8", "wait 0.5")
    assert panel.axis.operational
    assert panel.notes() == []


@pytest.mark.requirement("NC-239")
def test_calibration(panel):
    """F9 homes with the parameters of the axis, and the cam of the PLC."""
    panel.axis.write_parameter("enc.home_position", 77.0)
    panel.give("f9", "wait 0.3", "cam 1", "wait 0.5", "cam 0", "wait 1")
    assert panel.axis.homed
    assert "Calibrated" in panel.prompt()
    assert panel.axis.position == pytest.approx(77.0, abs=2.0)


@pytest.mark.requirement("NC-072", "NC-073", "NC-074")
def test_the_online_view(panel):
    """The view shows the fields of the dialog; its options change what is shown and not the image."""
    panel.give("f3", "wait 0.5", "status")
    view = dict(line.strip().split("  ", 1) for line in panel.shown)
    assert view["Status (log.)"].strip() == "Ready, Has Job, Moving Fw"
    assert view["Enabling"].strip() == "Controller, Feed Fw, Feed Bw"
    assert float(view["Setpoint Velocity"].split()[0]) == pytest.approx(100.0)
    assert float(view["Total / Control Output"].split()[0]) == pytest.approx(20.0, abs=1.0)
    assert "(" in panel.shown[2]
    panel.give("release", "wait 0.5", "position 400")
    panel.axis.write_parameter("axis.display_position_um", True)
    panel.axis.write_parameter("axis.display_modulo", True)
    panel.axis.write_parameter("axis.display_velocity_mm_min", True)
    panel.give("f3", "wait 0.5")
    position, velocity, _ = panel.values()
    modulo = (panel.axis.ref.NcToPlc.ActPos % 360.0) * 1000.0
    assert position == f"position {modulo:.1f} umm"
    assert float(velocity.split()[1]) == pytest.approx(6000.0, rel=0.05)
    assert panel.axis.ref.NcToPlc.ActPos > 400.0
    assert panel.axis.ref.NcToPlc.ActVelo == pytest.approx(100.0, abs=2.0)


def test_wrong_lines(panel):
    """Unknown commands and values that are not allowed are refused with what is."""
    for line, words in (
        ("f7", "f5"),
        ("enable 101", "0 to 100"),
        ("set 1 2 0", "0 or 1"),
        ("jerk -1", "0 or more"),
        ("target x", "numbers"),
        ("wait 1e9", "3600"),
    ):
        with pytest.raises(ConfigurationError, match=words):
            panel.execute(line)


def test_a_script(capsys):
    """`hil panel` takes lines for an NC axis from a script, and ends with the first wrong one."""
    code = run_panel(
        "nc-axes:reference",
        axis="",
        monitoring_s=2.0,
        plot=None,
        stdin=io.StringIO("enable\nf3 0.2\nstatus\nf7\n"),
    )
    said = capsys.readouterr()
    assert code == 1
    assert "Status (phys.)" in said.out
    assert "line 4" in said.err
