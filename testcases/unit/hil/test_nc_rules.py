"""Always-on rules about NC axes: each passes on a sound run, and fails when signals contradict each other."""

import numpy as np
import pytest

from hil.campaign import load_bench_file
from hil.expect import run_checkers
from hil.expect._nc_rules import NC_RULES, check_nc_axes
from hil.mutants import Edit, Mutant, seeded
from hil.record import Trace, TraceGroup
from motion.nc.library import COMMANDS
from reports.model import Verdict

COLUMNS = (
    "set_velocity",
    "output",
    "error_code",
    "state_dword",
    "op_mode_dword",
    "set_position",
    "set_acceleration",
    "actual_position",
    "following_error",
)
TIMES = np.arange(10, dtype=np.int64) * 2_000_000


def trace(**changed):
    """Return ten cycles: standing, moving forward, in error, reset; `changed` replaces columns."""
    moving = np.array([0, 0, 1, 1, 1, 0, 0, 0, 0, 0])
    error = np.array([0, 0, 0, 0, 0, 1, 1, 1, 0, 0])
    columns = {
        "set_velocity": 50.0 * moving,
        "output": 0.1 * moving,
        "error_code": 0x4550 * error,
        "state_dword": (1 - error) + 4 * (1 - moving) + (512 + 256) * moving + (error.astype(np.int64) << 31),
        "op_mode_dword": np.arange(250, 260) % 256 << 24,
        "set_position": np.array([0.0, 0.0, 0.05, 0.15, 0.25, 0.25, 0.25, 0.25, 0.25, 0.25]),
        "set_acceleration": 25_000.0 * (np.arange(10) == 2),
        "actual_position": np.array([0.0, -0.01, -0.01, 0.05, 0.15, 0.25, 0.25, 0.25, 0.25, 0.25]),
        "following_error": np.array([0.0, 0.01, 0.06, 0.1, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0]),
    }
    columns |= changed
    values = np.column_stack([columns[name] for name in COLUMNS]).astype(float)
    group = TraceGroup("x", tuple((name, "") for name in COLUMNS), {}, TIMES, values)
    return Trace([group], events=(), constants={"x.cycle_s": 0.002}, end_ns=int(TIMES[-1]), vocabulary=None)


def verdicts(found):
    """Return the names of the rules that fail."""
    return verdicts_of(found, "x")


def verdicts_of(found, axis):
    """Return the names of the rules that fail on an axis."""
    checks = check_nc_axes(found)
    return [check.name.removesuffix(f" of {axis}") for check in checks if check.verdict is Verdict.FAILED]


def at(index, value, column):
    """Return a column of the sound run with another value in one cycle."""
    sound = trace()[f"x.{column}"].values.copy()
    sound[index] = value
    return {column: sound}


def test_a_sound_run_breaks_no_rule():
    """Every rule judges the axis and holds, and they are among those that judge every case."""
    assert verdicts(trace()) == []
    names = {check.name for check in run_checkers(trace())}
    with_drive = {"speed setpoint of the drive of x"}
    assert {f"{rule.name} of x" for rule in NC_RULES} - with_drive <= names


@pytest.mark.parametrize(
    ("changed", "broken"),
    [
        ({"error_code": np.zeros(10)}, "error code and status"),
        (at(6, 0.2, "output"), "shut down in error"),
        (at(6, 1.0, "set_velocity"), "shut down in error"),
        (at(6, 1.0, "set_velocity"), "no motion without enable"),
        (at(3, -50.0, "set_velocity"), "direction of motion"),
        (at(1, 3.0, "set_velocity"), "NotMoving"),
        (at(4, 1 + 256, "state_dword"), "direction is shown"),
        (at(4, 0, "op_mode_dword"), "cycle counter"),
        (at(3, -0.1, "following_error"), "position lag"),
        (at(3, 0.17, "set_position"), "set position"),
        (at(3, 0.05, "set_position"), "set position"),
        (at(2, 0.0, "set_acceleration"), "set velocity"),
    ],
)
def test_what_breaks_a_rule(changed, broken):
    """A column that contradicts the others is noticed by its rule."""
    assert broken in verdicts(trace(**changed))


SENT = Mutant(
    "velocity-in-error",
    "nc",
    "An axis in error sends a velocity",
    (
        Edit(
            "motion.nc.axis:NcAxis._send",
            "outputs.velocity = outputs.torque = outputs.acceleration = 0.0",
            "outputs.velocity = outputs.torque = outputs.acceleration = 1.0",
        ),
    ),
)


@pytest.mark.exhaustive
def test_what_the_drive_gets_is_the_output():
    """A speed on the bus without an output is noticed; without the defect nothing is."""

    def failed():
        with load_bench_file("nc-axes:reference").build(seed=1) as bench:
            axis = bench.axis()
            axis.power()
            bench.run_for(0.4)
            axis.run(COMMANDS["MC_MoveRelative"](axis.ref, Execute=True, Distance=20.0, Velocity=100.0))
            bench.run_for(0.6)
            axis.power().set(Enable=False)
            bench.run_for(0.1)
            return verdicts_of(bench.trace(), bench.nc_axis_names[0])

    assert failed() == []
    with seeded(SENT, set()):
        assert "speed setpoint of the drive" in failed()


def test_a_reset_may_be_one_cycle_ahead():
    """MC_Reset clears the code behind the image of its cycle; two cycles are a contradiction."""
    code = trace()["x.error_code"].values.copy()
    code[7] = 0
    assert "error code and status" not in verdicts(trace(error_code=code))
    code[6] = 0
    assert "error code and status" in verdicts(trace(error_code=code))
