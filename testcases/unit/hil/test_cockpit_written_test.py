"""A session of the cockpit saved as a test: readable, green as it is, red with a defect."""

import inspect
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from hil import CurrentTrace, Injector, faults
from hil.bench.makes import with_nc_axes
from hil.campaign import Runner, RunOptions, find_campaigns, load_bench_file, select_cases
from hil.cockpit.axes import axis_desks
from hil.cockpit.code_text import trigger_call
from hil.cockpit.matrix_text import write_matrix
from hil.cockpit.session import Session
from hil.cockpit.steps import Command, Inject, SetInputs, TakeBack, WriteVariable, panel_steps
from hil.cockpit.written_test import save_text, write_test
from hil.errors import CannotRunError, ExpectationFailedError
from hil.expect import REFERENCE_AXIS
from hil.faults import TRIGGERS, Fault, position
from hil.mutants import CATALOGUE, seeded
from reports.model import Verdict

pytestmark = pytest.mark.exhaustive


def recorded(session, name="reference"):
    """Return what is saved of a session."""
    return session.recorded(load_bench_file(name))


def call(text, name="reference", seed=5, file=None):
    """Call the test function of a module with the fixtures that the plugin gives it."""
    module = {"__name__": "written"}
    exec(compile(text, "written.py", "exec"), module)
    function = next(one for key, one in module.items() if key.startswith("test_"))
    with (file or load_bench_file(name)).build(seed=seed) as bench:
        given = {
            "bench": bench,
            "axis": bench.axis(),
            "trace": CurrentTrace(bench),
            "faults": Injector(bench),
        }
        function(**{key: given[key] for key in inspect.signature(function).parameters})


def trip():
    """Return the test of a session: homed, stopped by its enable, stopped by a drive fault, acknowledged."""
    file = load_bench_file("reference")
    with file.build(seed=0) as bench:
        session = Session(bench)
        for step, seconds in [
            (Command("axis1", "power"), 1.0),
            (Command("axis1", "home", {"position": 0.0}), 1.0),
            (Command("axis1", "move_velocity", {"velocity": 200.0}), 0.4567),
            (Command("axis1", "power", {"enable": False, "stop_mode": 0}), 1.5),
            (Command("axis1", "power"), 1.0),
            (Command("axis1", "move_velocity", {"velocity": 100.0}), 0.5),
            (Inject(Fault("drive.fault", "drive1", parameters={"code": 0x2310})), 1.5),
            (Command("axis1", "reset"), 1.0),
            (Command("axis1", "move_absolute", {"position": 0.0, "Velocity": 300.0}), 1.5),
        ]:
            session.do(step)
            bench.run_for(seconds)
        return write_test(recorded(session), name="Trip, of the drive", bench="reference")


@pytest.fixture(scope="module")
def written():
    """The test of the session `trip`."""
    return trip()


def test_a_session_becomes_a_readable_test(written):
    """Waits for jobs in place of the pauses of a person; alarm with time, stop, travel, state, place and ends
    of jobs are expected; the text is the same every time, and formatted.
    """
    text = written.text
    for line in (
        '@pytest.mark.hil_bench("reference")',
        "def test_trip_of_the_drive(bench, axis, faults, trace):",
        "    power = axis.power()",
        "    bench.wait_until(power.status, timeout=1.0)",
        "    homing = axis.home(0.0)",
        "    axis.power(False, stop_mode=0)",
        '    begin = event("power.disable", "axis1")',
        '        stop(begin, "emergency"),',
        '    faults.inject("drive.fault", "drive1", code=0x2310)',
        '    hit = event("fault.applied")',
        '        state_at("axis1", bench.now_s, "ALARM_DISABLED"),',
        "    assert travel2.ErrorID == 0x8001",
        "    trace.check_rules()",
    ):
        assert f"\n{line}\n" in text
    assert "alarm(421, reaction=4, since=hit, within_s=" in text
    assert "assert stopped.distance == pytest.approx(" in text
    assert '"axis1.actual_position", bench.now_s, 0.0, tolerance=' in text
    assert written.notes == ()
    assert trip().text == text
    for command in (["format", "--check", "--line-length", "88"], ["check", "--select", "E,F,I"]):
        done = subprocess.run(
            [sys.executable, "-m", "ruff", command[0], "--isolated", "-", *command[1:]],
            input=text,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stdout


@pytest.mark.parametrize("defect", ["", "stop-modes-0-and-2-swapped", "reaction-4-ends-jobs-late"])
def test_the_written_test_is_green_and_red_with_a_defect(written, defect):
    """It passes on the product as it is, and fails when a defect is planted that the session came by."""
    if not defect:
        call(written.text)
        return
    mutant = CATALOGUE[defect]
    with seeded(mutant, set()), pytest.raises((AssertionError, ExpectationFailedError)):
        call(written.text)


def test_pytest_runs_what_was_saved(written, tmp_path):
    """The file is a test of pytest; a second one of the same name does not replace it."""
    file, second = (save_text(written.text, tmp_path, "trip") for _ in range(2))
    assert (file.name, second.name) == ("test_trip.py", "test_trip_2.py")
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(file)],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert "1 passed" in done.stdout


def test_faults_with_triggers_and_an_end(tmp_path):
    """A trigger is written as a person writes it; a fault that is taken back and inputs that are set refer to
    the step that made them; an axis of several gets its name.
    """
    with load_bench_file("synchronous").build(seed=0) as bench:
        first, second = bench.axis_names[:2]
        session = Session(bench)
        for name in (first, second):
            session.do(Command(name, "power"))
        bench.run_for(0.2)
        session.do(WriteVariable(first, "Override.Velocity", 50.0))
        armed = Inject(
            Fault(
                "mechanics.jam", bench.drive_of(first), trigger=position(5.0, axis=first, direction="rising")
            )
        )
        session.do(armed)
        session.do(Command(second, "jog", {"velocity": 10.0}))
        bench.run_for(0.3)
        session.do(SetInputs(4, {"JogForward": False}))
        bench.run_for(0.3)
        session.do(TakeBack(3))
        bench.run_for(0.1)
        text = write_test(recorded(session, "synchronous"), bench="synchronous").text
    call(text, "synchronous")
    assert f'trigger=position(5.0, axis="{first}", direction="rising")' in text
    assert "    jogging.set(JogForward=False)" in text
    assert "    fault.remove()" in text
    assert f'    {first} = bench.axis("{first}")' in text


def test_triggers_are_written_as_the_calls_that_make_them():
    """Every form of a trigger, evaluated, is the trigger again."""
    forms = {
        "immediately()": faults.immediately(),
        "after(0.5)": faults.after(0.5),
        "at(2.25)": faults.at(2.25),
        'signal("drive1.torque", 1.5)': faults.signal("drive1.torque", 1.5),
        'position(100.0, direction="rising")': position(100.0, direction="rising"),
        'velocity(45.0, axis="x")': faults.velocity(45.0, axis="x"),
        'state("drive1", "FAULT")': faults.state("drive1", "FAULT"),
        'on_event("alarm.raised", "axis1", nth=2, number=421)': faults.on_event(
            "alarm.raised", "axis1", nth=2, number=421
        ),
        "frame(0x185, number=3)": faults.frame(0x185, number=3),
        'condition("axis1.zsw1", ones=0x0404)': faults.condition("axis1.zsw1", ones=0x404),
        "every(0.2)": faults.every(0.2),
        "sequence(after(1.0), after(0.5))": faults.sequence(faults.after(1.0), faults.after(0.5)),
        "any_of(at(1.0), after(0.5))": faults.any_of(faults.at(1.0), faults.after(0.5)),
        "chance(every(0.1), 0.25)": faults.chance(faults.every(0.1), 0.25),
    }
    for text, trigger in forms.items():
        assert trigger_call(trigger).text() == text
        assert eval(text, vars(faults)) == trigger
    kinds = {trigger.to_dict()["when"] for trigger in forms.values()}
    assert kinds == set(TRIGGERS) - {"position", "velocity"}


def by_hand(file):
    """Return the session of an operator who enables an NC axis at half speed, jogs it, moves it to a target,
    stops it, moves it back and sets its position.
    """
    with file.build(seed=0) as bench:
        (desk,) = axis_desks(bench, Path()).values()
        session = Session(bench)
        recorder = desk.recorder(session)

        def wait(cycles):
            for _ in range(cycles):
                bench.run_for(0.02)
                desk.beat()
                recorder.look()

        def do(name, *values):
            before = session.now_ns
            desk.execute(name, list(values))
            recorder.command(name, values, before)

        def jog(slider):
            before = session.now_ns
            desk.jog(slider)
            recorder.jog(slider, before)

        do("enable", 50.0)
        wait(30)
        for slider, cycles in ((30.0, 20), (0.0, 30)):
            jog(slider)
            wait(cycles)
        do("target", 250.0)
        do("velocity", 400.0)
        do("f5")
        wait(20)
        do("f6")
        wait(40)
        do("target", 10.0)
        do("f5")
        wait(120)
        do("position", 0.0)
        wait(5)
        return session.recorded(file)


def test_a_session_with_an_nc_axis_becomes_a_test():
    """Keys, fields and enables of an NC axis are calls of its blocks; the test is green, and red with defects
    of override, jog and stop that the session came by.
    """
    file = with_nc_axes(load_bench_file("reference"), "reference")
    written = write_test(by_hand(file), bench="nc.toml")
    assert written.notes == ()
    for line in (
        "from motion.nc.blocks import JogMode",
        "    power = axis.power(override=50.0)",
        "    jogging = axis.jog(mode=JogMode.MC_JOGMODE_STANDARD_SLOW)",
        "    jogging.set(JogForward=False, JogBackwards=False)",
        "    move = axis.move_absolute(250.0, Velocity=400.0)",
        "    begin = bench.now_s",
        "    stopping = axis.stop()",
        "    bench.wait_until(stopping.done, timeout=1.0)",
        "    stopping.set(Execute=False)",
        "    assert move.CommandAborted",
        "    setting = axis.set_position(0.0)",
    ):
        assert f"\n{line}\n" in written.text
    assert "assert stopped.distance == pytest.approx(" in written.text
    assert "#" not in written.text.replace("  # mm", "")  # nothing is left to be written by hand
    call(written.text, file=file)
    for defect in ("nc-override-without-effect", "nc-jogs-with-the-other-velocity"):
        with seeded(CATALOGUE[defect], set()), pytest.raises((AssertionError, ExpectationFailedError)):
            call(written.text, file=file)


def test_a_cam_that_is_engaged_by_hand_becomes_a_test():
    """What an axis may follow is described, what it follows is shown, and the test of the session
    interpolates the cam, engages it, and comes to the same place.
    """
    file = load_bench_file("synchronous")
    with file.build(seed=0) as bench:
        desks = axis_desks(bench, Path())
        session = Session(bench)
        recorders = {name: desk.recorder(session) for name, desk in desks.items()}

        def do(axis, name, *values, cycles=5):
            before = session.now_ns
            desks[axis].execute(name, list(values))
            recorders[axis].command(name, values, before)
            for _ in range(cycles):
                bench.run_for(0.02)
                for desk in desks.values():
                    desk.beat()

        for axis in ("leader", "follower_a"):
            do(axis, "take")
            do(axis, "enable", cycles=15)
            do(axis, "set", 0.0)
        do("follower_a", "cam", "leader", "swing")
        do("leader", "rel", 20.0, cycles=50)
        found = desks["follower_a"].description()
        assert (found["leaders"], found["cams"]) == (["leader", "material"], ["swing", "step"])
        state = desks["follower_a"].state()
        assert (state["leader"], state["synchronous"]) == ("leader", "MC_CamIn, synchronous")
        place = state["position"]
        written = write_test(session.recorded(file), bench="synchronous")
    assert written.notes == ()
    assert place > 1.0
    assert '\n    bench.cam("swing").interpolate()\n    bench.run_for(' in written.text
    assert "follower_a.cam_in(" in written.text
    call(written.text, "synchronous")


def test_what_is_no_session_is_refused():
    """Nothing done is no test, and a session that cannot be repeated says why."""
    with load_bench_file("reference").build(seed=0) as bench:
        session = Session(bench)
        with pytest.raises(CannotRunError, match="nothing was done"):
            write_test(recorded(session))
        with pytest.raises(CannotRunError, match="has 0 steps besides"):
            write_matrix(recorded(session), bench="reference")


def test_a_job_and_its_stop_become_a_matrix(tmp_path):
    """Job, moment and stop are words of a matrix, whose case runs green."""
    with load_bench_file("reference").build(seed=0) as bench:
        session = Session(bench)
        for step, seconds in [
            (Command("axis1", "power"), 0.2),
            (Command("axis1", "move_velocity", {"velocity": -300.0}), 0.5),
            (Command("axis1", "stop", {"mode": 2}), 0.5),
        ]:
            session.do(step)
            bench.run_for(seconds)
        text = write_matrix(recorded(session), bench="reference", title="my stop")
    assert tomllib.loads(text)["factors"] == {
        "bench": ["reference"],
        "job": ["velocity-backward"],
        "moment": ["constant"],
        "stop": ["stop-2"],
    }
    (tmp_path / "my.toml").write_text(text)
    run = Runner(select_cases(find_campaigns([str(tmp_path / "my.toml")])), RunOptions()).run()
    assert [case.verdict for case in run.cases] == [Verdict.PASSED]


def test_commands_of_the_panel_become_those_of_a_program():
    """What a panel does has the same jobs with the same dynamics in a program."""
    with load_bench_file("reference").build(seed=0) as bench:
        panel = bench.axis().control_panel()
        panel.take_control()
        panel.velocity = 80.0
        steps = panel_steps(panel, "move_absolute", 40.0, 50.0)
        session = Session(bench)
        panel.release()
        bench.run_for(0.1)
        for step in (*panel_steps(panel, "enable"), *panel_steps(panel, "set_position")):
            session.do(step)
            bench.run_for(0.2)
        job = session.do(steps[0])
        bench.run_for(2.0)
        assert job.Done
        assert (job.Velocity, job.Deceleration) == (40.0, REFERENCE_AXIS.maximum_deceleration)
        assert bench.axis().var("ActualPosition") == pytest.approx(40.0, abs=0.1)
