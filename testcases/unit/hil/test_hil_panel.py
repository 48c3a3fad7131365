"""`hil panel` with a script, and the commissioning sequence of an axis on a bench with an emulated drive
(§6.1).
"""

from __future__ import annotations

import io

import pytest

from hil._commands.panel import run_panel
from hil.cli import main
from motion.s7.commissioning import precautions
from motion.s7.controller import OperatingState
from testcases.unit.hil.test_hil_profidrive import bench

NO_GAIN = 1e-6
"""As good as none: the axis does not take 0 (VAR-178)."""
KV, KPC = "PositionControl.Kv", "PositionControl.Kpc"


def script(capsys, tmp_path, text, name="profidrive", **options):
    options.setdefault("axis", "")
    code = run_panel(name, monitoring_s=2.0, plot=tmp_path / "plot.html", stdin=io.StringIO(text), **options)
    captured = capsys.readouterr()
    # what `jog` says of itself stands between the states
    lines = [line for line in captured.out.splitlines() if not line.startswith("jogs ")]
    return code, lines, captured.err


@pytest.mark.exhaustive
@pytest.mark.requirement("COM-073", "COM-009", "COM-010", "COM-011", "COM-036")
def test_a_script(capsys, tmp_path):
    """Take, enable, jog, release the slider, give back; every line is answered with the state."""
    code, lines, _ = script(
        capsys,
        tmp_path,
        "take\nenable\nwait 0.5\nvelocity 40\njog 50\nwait 1.0\nslide 0\nwait 0.5\nrel -5\nwait "
        "1\nrelease\nwait 1\n",
    )
    assert code == 0
    assert "panel  standstill" in lines[2]
    assert "velocity 20" in lines[5]
    assert "velocity 20" not in lines[7]
    assert float(lines[9].split("position ")[1].split()[0]) == pytest.approx(
        float(lines[7].split("position ")[1].split()[0]) - 5.0, abs=0.01
    )
    assert "program  disabled" in lines[-1]


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-033")
def test_a_piped_session_in_plain_lines(capsys, tmp_path):
    """No prompt, no escape sequences; units and following error in every state; jog says how long it goes on;
    an error is shown in words until it is acknowledged, and the axis then stays off until it is enabled.
    """
    text = (
        "take\nenable\nwait 0.5\njog -50\nslide 0\nwait 0.5\nabs 5\nack\nwait 1\nenable\nwait 0.5\nslide 0\n"
    )
    code = run_panel(
        "profidrive", axis="", monitoring_s=2.0, plot=tmp_path / "plot.html", stdin=io.StringIO(text)
    )
    out = capsys.readouterr().out
    lines = [line.partition(" s  ")[2] or line for line in out.splitlines()]
    assert (code, "\x1b" in out, ">" in out) == (0, False, False)
    assert lines[2] == (
        "panel  standstill  position 0 mm  velocity 0 mm/s  following error 0 mm  limit switches free"
    )
    assert lines[3] == (
        "jogs backward at 25 mm/s until `slide 0` or `stop`; `slide S` changes velocity and direction"
    )
    assert lines[4].endswith("jogs at slider -50 % until `slide 0`")
    assert lines[5].endswith("limit switches free")
    assert lines[7].endswith(
        "MC_MoveAbsolute failed, alarm 321: Absolute positioning requested but axis not homed"
    )
    assert lines[8] == "the alarm has disabled the axis: it stays off until `enable`"
    assert [line.partition("  position")[0] for line in lines[9:11]] == ["panel  disabled"] * 2
    assert lines[10].endswith("limit switches free")
    assert lines[12].startswith("panel  standstill")


@pytest.mark.exhaustive
def test_the_error_of_a_job_without_an_alarm(capsys, tmp_path):
    """It is shown in words until the next command that does something."""
    text = "take\nenable\nwait 0.5\nadjust-encoder 5\nwait 0.1\nslide 0\n"
    _, lines, _ = script(capsys, tmp_path, text)
    assert "MC_Home failed, 16#" in lines[3]
    assert lines[4].endswith(lines[3].partition("MC_Home")[2])
    assert lines[5].endswith("limit switches free")


@pytest.mark.parametrize(
    ("text", "reported"),
    [
        ("enable\n", "does not have master control"),
        ("fly\n", "one of take, release"),
        ("take\nvelocity fast\n", "numbers: V"),
        ("take\nrel\n", "values of rel"),
        ("take\nenable\nwait 0.5\nslide 130\n", "-100 to 100 %"),
    ],
)
def test_a_line_that_cannot_be_carried_out(capsys, tmp_path, text, reported):
    """The script ends with exit code 1, and says why."""
    code, _, err = script(capsys, tmp_path, text)
    assert code == 1
    assert reported in " ".join(err.split())


@pytest.mark.exhaustive
def test_the_end_of_the_input_gives_the_axis_back(capsys, tmp_path, monkeypatch):
    """A script that ends in the middle of a motion stops the axis; the command itself reads standard
    input.
    """
    monkeypatch.setattr(
        "sys.stdin", io.StringIO("take\nenable\nwait 0.5\njog\nwait 0.5\nhelp\nstatus\nquit\n")
    )
    assert main(["panel", "profidrive", "--plot", str(tmp_path / "plot.html")]) == 0
    out = capsys.readouterr().out
    assert "optimise D V A [TOL]" in out
    assert "[x] communication with the drive" in out


@pytest.mark.exhaustive
@pytest.mark.requirement("COM-055", "COM-058", "COM-067")
def test_optimisation_with_a_plot(capsys, tmp_path):
    """A recommended gain and a page with every attempt, on a drive with inertia, filters and quantised
    words.
    """
    code, lines, err = script(
        capsys, tmp_path, "take\nenable\nwait 0.5\noptimise 5 60 1000 0.05\nrelease\nwait 1\n"
    )
    assert code == 0, err
    recommended = next(line for line in lines if line.startswith("recommended"))
    assert float(recommended.split("Kv = ")[1].split(",")[0]) > 10.0
    page = (tmp_path / "plot.html").read_text(encoding="utf-8")
    assert "Position controller of" in page
    assert "plotly" in page


@pytest.mark.exhaustive
@pytest.mark.requirement(
    "COM-001",
    "COM-002",
    "COM-003",
    "COM-004",
    "COM-005",
    "COM-006",
    "COM-007",
    "COM-009",
    "COM-010",
    "COM-012",
    "COM-015",
    "COM-016",
    "COM-019",
)
def test_the_commissioning_sequence():
    """The steps of §6.1 on a good machine: without gain the axis is held by precontrol alone, moves true to
    scale, and is handed over.
    """
    with bench() as machine:
        axis, controller = machine.axis(), machine.controller
        controller.stop()
        machine.run_until(lambda: controller.state is OperatingState.STOP, timeout=2.0)
        machine.run_for(0.5)
        controller.download(axis.name, {KV: NO_GAIN, KPC: 100.0})
        controller.run()
        machine.run_until(lambda: controller.state is OperatingState.RUN, timeout=5.0)
        machine.run_for(0.5)
        assert axis.alarms.engine.number == 0
        panel = axis.control_panel()
        panel.take_control()
        panel.enable()
        machine.run_until(lambda: panel.enabled, timeout=2.0)
        start, true_start = axis.var("ActualPosition"), 1000.0 * machine.drive().mechanics.position
        panel.velocity = 20.0
        panel.jog()
        machine.run_for(2.0)
        assert axis.var("Velocity") == pytest.approx(20.0)
        assert axis.var("ActualVelocity") == pytest.approx(20.0, rel=0.02)  # the reference speed is right
        assert axis.speed_output_rpm == pytest.approx(20.0 * 60.0 / 10.0)  # precontrol alone
        panel.slide(0.0)
        machine.run_for(0.5)
        moved = axis.var("ActualPosition") - start
        assert moved > 0.0
        assert moved == pytest.approx(1000.0 * machine.drive().mechanics.position - true_start, abs=0.01)
        panel.set_position(0.0)
        machine.run_for(0.1)
        assert axis.var("StatusWord.X5")
        panel.release()
        machine.run_until(lambda: not panel.active, timeout=5.0)
        power = axis.power()
        machine.run_until(power.status, timeout=2.0)


@pytest.mark.exhaustive
@pytest.mark.requirement("COM-012", "COM-015", "COM-077", "COM-010")
@pytest.mark.parametrize(
    ("variables", "direction", "scale", "velocity"),
    [
        ({}, 1.0, 1.0, 1.0),
        ({"Sensor[1].InverseDirection": True}, -1.0, 1.0, -1.0),
        ({"Mechanics.LeadScrew": 20.0}, 1.0, 2.0, 1.0),
        ({"Actor.DriveParameter.ReferenceSpeed": 6000.0}, 1.0, 1.0, 0.5),
    ],
)
def test_what_is_wrong_shows(variables, direction, scale, velocity):
    """An inverted encoder, a wrong pitch, a wrong reference speed: direction, scale, or velocity do not
    fit.
    """
    own = {KV: NO_GAIN, "FollowingError.EnableMonitoring": False, "PositioningMonitoring.Window": 1000.0}
    with bench(variables=own | variables) as machine:
        axis = machine.axis()
        panel = axis.control_panel()
        panel.take_control()
        panel.enable()
        machine.run_until(lambda: panel.enabled, timeout=2.0)
        start, true_start = axis.var("ActualPosition"), 1000.0 * machine.drive().mechanics.position
        panel.velocity = 20.0
        panel.jog()
        machine.run_for(2.0)
        seen = axis.var("ActualPosition") - start
        true = 1000.0 * machine.drive().mechanics.position - true_start
        assert seen * direction > 0.0
        assert abs(seen / true) == pytest.approx(scale, rel=0.01)
        assert axis.var("ActualVelocity") == pytest.approx(20.0 * velocity, rel=0.03)
        panel.release()
        machine.run_until(lambda: not panel.active, timeout=5.0)


@pytest.mark.requirement("MIN-008")
def test_what_is_recommended_is_reported(capsys, tmp_path):
    """Taking the axis tells which limit switches and monitorings are off; nothing of it is demanded."""
    code, _, err = script(capsys, tmp_path, "take\n", name="reference")
    assert code == 0
    assert "software limit switches (PositionLimits_SW.Active)" in err
    assert "hardware limit switches" not in err
    with bench(
        variables={
            "PositionLimits_HW.Active": False,
            "PositionLimits_SW.Active": True,
            "FollowingError.EnableMonitoring": False,
        }
    ) as machine:
        axis = machine.axis()
        assert precautions(axis.object) == (
            "hardware limit switches (PositionLimits_HW.Active)",
            "monitoring of the following error (FollowingError.EnableMonitoring)",
            "software limit switches act when the axis is homed (StatusWord.X5)",
        )
        axis.home(0.0)
        machine.run_for(0.05)
        assert len(precautions(axis.object)) == 2


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", ["fast", "speed", "profidrive_tcp", "profidrive_rtu", "analog", "stepper"])
def test_a_script_on_every_bench(capsys, tmp_path, name):
    """Take, enable, jog, stop, give back, whatever the drive and its bus; a line that does not fit to it is
    reported with its number.
    """
    code, lines, err = script(
        capsys,
        tmp_path,
        "take\nenable\nwait 1\nvelocity 20\njog -100\nwait 0.5\nstop\nwait 0.5\nrelease\nwait 1.5\n",
        name=name,
    )
    assert code == 0, err
    assert "velocity -2" in lines[5] or "velocity -19" in lines[5]
    assert "panel  standstill" in lines[7]
    assert "program  disabled" in lines[-1]
    code, _, err = script(capsys, tmp_path, "take\n\nset 5\n", name=name)
    assert code == 1
    assert "line 3: " in err
    assert "not enabled in the panel" in err


@pytest.mark.exhaustive
def test_a_follower_is_geared_by_hand(capsys, tmp_path):
    """Commands go to one axis after the other; the follower keeps the ratio, is shifted, and leaves at a
    position; both axes are given back.
    """
    text = (
        "take\nenable\nwait 0.5\naxis follower_a\ntake\nenable\nwait 0.5\nset 0\ngear leader 1 2\n"
        "axis leader\nvelocity 100\njog 50\nwait 0.6\naxis follower_a\nphase 4\nwait 0.6\n"
        "gear-out 60 20\nwait 2\naxis leader\nslide 0\nwait 0.5\n"
    )
    code, lines, _ = script(capsys, tmp_path, text, "synchronous", axis="leader")
    assert code == 0
    geared = next(line for line in lines if "synchronous (MC_GearIn)" in line and "velocity 25" in line)
    assert "follower_a  panel  motion" in geared
    (at_rest,) = [line for line in lines if "follower_a  panel  standstill  position 60" in line]
    assert "velocity 0 mm/s" in at_rest
    assert "synchronous" not in at_rest
    assert ["program  disabled" in line for line in lines[-2:]] == [True, True]


@pytest.mark.parametrize(
    ("line", "text"),
    [
        ("gear ledaer", "leading object: 'ledaer' is not allowed; allowed: one of leader, material"),
        ("gear leader one", "values of gear: 'leader one' is not allowed; allowed: numbers: LEADER [N] [D]"),
        ("cam leader swim", "cam: 'swim' is not allowed; allowed: one of swing, step"),
        ("axis follower", "'follower'"),
    ],
)
def test_mistakes_in_commands_for_followers(capsys, tmp_path, line, text):
    """A leading object, cam or axis that does not exist is refused with those that do."""
    code, _, errors = script(capsys, tmp_path, f"{line}\n", "synchronous", axis="follower_a")
    assert code == 1
    assert text in errors
