"""Fuzz programs for NC axes: blocks, parameters and packets as instructions, configurations, findings."""

from __future__ import annotations

import hypothesis
import pytest

from fieldbus.errors import ConfigurationError
from hil.bench import load_bench
from hil.campaign import load_bench_file
from hil.faults import Fault
from hil.fuzz import Break, Configuration, Do, Program, Wait, configurations, job_names, run_program, search
from hil.fuzz._configuration import bench_file_of
from hil.fuzz._nc_jobs import NC_JOBS, ONLINE
from hil.fuzz._program import participants
from hil.fuzz._strategies import preamble_of
from motion.nc.axis import NcAxis
from motion.nc.parameters import catalogue
from testcases.campaigns.nc_axes import BENCH as TWO

pytestmark = pytest.mark.exhaustive

BENCH = load_bench_file("nc-axes:reference")
ON = Do("MC_Power", dict.fromkeys(("Enable", "Enable_Positive", "Enable_Negative"), True))
EVERYTHING = [
    Do("MC_MoveAbsolute", {"Position": 40.0, "Velocity": 200.0, "Jerk": 20_000.0}),
    Do("MC_MoveRelative", {"Distance": -20.0, "Velocity": 100.0, "BufferMode": "BlendingHigh"}),
    Do("write_parameter", {"key": "axis.velocity_override_type", "value": "Original (iterated)"}),
    Do("write_parameter", {"key": "ctrl.pos_kv", "value": "12.5"}),
    Do("MC_MoveSuperImposed", {"Distance": 5.0, "VelocityDiff": 40.0}),
    Wait(1.0),
    Do("MC_Jog", {"JogForward": True, "Mode": "MC_JOGMODE_STANDARD_SLOW"}),
    Do("release", {"block": "MC_Jog"}),
    Wait(0.5),
    Do("MC_Stop"),
    Do("release", {"block": "MC_Stop"}),
    Wait(0.5),
    Do("MC_SetPosition", {"Position": 5.0, "Mode": True}),
    Do("MC_ExtSetPointGenEnable", {"Position": 0.0, "PositionType": 2.0}),
    Do("external_setpoint", {"position": 0.1, "velocity": 0.0, "direction": 1}),
    Wait(0.1),
    Do("MC_ExtSetPointGenDisable"),
    Do("MC_Home", {"HomingMode": "MC_DefaultHoming", "bCalibrationCam": True}),
    Do("MC_Power", {"Enable": True, "Enable_Positive": True, "Override": 30.0}),
    Do("MC_Reset"),
]


def test_a_program_calls_the_blocks_of_an_nc_axis():
    """Every instruction acts and holds all rules, as text and JSON too; those of the other make are left
    out.
    """
    program = Program((ON, Wait(0.1), *EVERYTHING))
    assert Program.from_json(program.to_json()) == program
    assert "MC_MoveRelative Distance = -20 mm, Velocity = 100 mm/s, BufferMode = BlendingHigh" in str(program)
    outcome = run_program(program, BENCH, seed=1)
    assert outcome.violation is None
    assert outcome.skipped == []
    words = {int(word) for word in outcome.trace["axis1.state_dword"].values}
    for bit in (8, 11, 13, 14, 19, 24, 29):  # job, homing, superposed, external, endless, buffered, locked
        assert any(word >> bit & 1 for word in words), bit
    other = run_program(Program((Do("power_on"), Wait(0.1))), BENCH, seed=1)
    assert other.skipped == ["power_on: step power_on: 'axis1' is not allowed; allowed: a technology object"]
    here = run_program(Program((ON,)), load_bench("reference"), seed=1)
    assert here.skipped
    assert "an axis of an NC" in here.skipped[0]


def test_instructions_are_checked():
    """An unknown input, one out of its choices and a parameter that there is not are refused by name."""
    for content, words in (
        ({"do": "MC_MoveAbsolute", "Place": 1.0}, "Place"),
        ({"do": "MC_MoveAbsolute", "BufferMode": "Later"}, "BlendingHigh"),
        ({"do": "release", "block": "MC_Power2"}, "MC_Power"),
        ({"do": "write_parameter", "key": "ctrl.kv", "value": "1"}, "ctrl.pos_kv"),
    ):
        with pytest.raises(ConfigurationError, match=words):
            Program.from_json([content])
    for key, values in ONLINE.items():
        for value in values:
            assert catalogue()[key].check(value) == value


def test_a_defect_of_the_axis_is_found(monkeypatch):
    """An axis that takes no note of the error of its drive breaks a rule, and the search shrinks the program
    to what matters.
    """
    monkeypatch.setattr(NcAxis, "raise_error", lambda self, error_id: setattr(self, "error_id", error_id))
    program = Program((ON, Wait(0.1), Do("MC_MoveVelocity", {"Velocity": 100.0}), Wait(0.4)))
    assert run_program(program, BENCH, seed=1).violation is None
    broken = Program((*program.steps, Break(Fault("drive.fault", parameters={"code": 0x2310}))))
    assert run_program(broken, BENCH, seed=1).violation is not None
    found = search(BENCH, cases=3, seed=1, parents=[broken])
    assert found.failure is not None
    assert len(found.failure.program.steps) < len(broken.steps)


def test_two_axes_are_coupled():
    """Programs for several NC axes enable all of them and couple them; an error of one reaches the other."""
    with TWO.build(seed=1) as bench:
        axes = participants(bench, 2)
        assert job_names(bench.axis()) == axes[0].jobs
    assert [one.leaders for one in axes] == [("y",), ("x",)]
    program = Program(
        (
            *preamble_of(axes, axes[0].jobs),
            Do("MC_GearIn", {"Master": "x", "RatioNumerator": -1.0}, "y"),
            Do("MC_MoveAbsolute", {"Position": 20.0, "Velocity": 100.0}, "x"),
            Wait(0.3),
            Break(Fault("drive.fault", "motor", parameters={"code": 0x2310})),
            Wait(0.1),
        )
    )
    outcome = run_program(program, TWO, seed=1)
    assert outcome.violation is None
    assert outcome.trace["y.error_code"].values[-1] == 0x43A0


def test_searches_over_configurations_are_silent(subtests):
    """Programs on changed bench files reach states and errors and break nothing; every part of a
    configuration is drawn and is a bench that comes up.
    """
    found = search(BENCH, cases=5, seed=2, configurations=True)
    assert found.failure is None, found.failure
    assert found.refused == 0
    assert {"axis", "fault", "configuration"} <= {situation[0] for situation in found.reached}
    drawn: dict[str, Configuration] = {}

    @hypothesis.settings(max_examples=150, database=None, derandomize=True, deadline=None)
    @hypothesis.given(configurations(bench_file_of(BENCH).config))
    def draw(configuration):
        for name, part in configuration.parts.items():
            drawn.setdefault(name, Configuration({name: part}))

    draw()
    assert {"limits", "divider", "controller", "homing", "interface", "cycle", "watchdog"} <= set(drawn)
    for name, configuration in drawn.items():
        with subtests.test(name), configuration.applied_to(BENCH).build(seed=0) as bench:
            axis = bench.axis(controller="nc")
            bench.wait_until(axis.power().status, 1.0, name)


def test_every_block_has_its_inputs():
    """The parameters of an instruction are the inputs of its block, without Execute, which a call sets."""
    for name, parameters in NC_JOBS.items():
        names = [one.name for one in parameters]
        assert "Execute" not in names, name
        assert len(set(names)) == len(names), name


def test_what_was_found_on_nc_axes_stays_corrected(subtests):
    """A new position, and actual values that do not come while the machine is pushed, break no rule."""
    for steps in (
        [Wait(0.3), Do("MC_SetPosition", {"Position": 5.0})],
        [
            Break(Fault("drive.heartbeat_loss", duration_s=0.4)),
            Break(Fault("mechanics.load_step", duration_s=0.3, parameters={"force_N": 400.0})),
        ],
    ):
        with subtests.test(str(steps[-1])):
            assert run_program(Program((ON, *steps)), BENCH, seed=22).violation is None
