"""Programs that ask devices, give instructions to objects that are no axes, and give inputs by name."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from hypothesis import given, seed, settings

from fieldbus.errors import ConfigurationError
from hil.campaign import load_bench_file
from hil.fuzz import Do, Program, Wait, run_program
from hil.fuzz._device_jobs import DEVICE_JOBS
from hil.fuzz._machines import Machine, axes_of
from hil.fuzz._provider import BACKEND
from hil.fuzz._strategies import UNCHANGED

LED = "testcases.campaigns._led_servo:BENCH"
SIGNALS = "testcases.campaigns.profidrive_positioner:BENCH"
NETWORK, LINE = "profidrive_tcp", "profidrive_rtu"
PROBES = "testcases.campaigns.axis_options:PROBES"
MODE, CONTROL = 0x6060, 0x6040


def _sdo(index: int, data: str) -> Do:
    return Do("sdo_write", {"device": "drive1", "index": index, "data": data})


def _steps(reference: str, number: int = 60) -> Iterator[Do]:
    """Draw programs for a bench, and yield their instructions."""
    with load_bench_file(reference).build(seed=0) as bench:
        strategy = Machine.of(bench, axes_of(bench)).programs(12, UNCHANGED)
    drawn: list[Program] = []

    @seed(1)
    @settings(max_examples=number, database=None, deadline=None, backend=BACKEND)
    @given(program=strategy)
    def gather(program: Program) -> None:
        assert Program.from_json(program.to_json()) == program
        drawn.append(program)

    gather()
    return (step for program in drawn for step in program.steps if isinstance(step, Do))


@pytest.mark.exhaustive
def test_everything_that_devices_can_be_asked_is_drawn() -> None:
    """Over some benches each kind of request turns up, to devices of either kind of bus."""
    asked = {step.job for reference in (LED, SIGNALS, NETWORK) for step in _steps(reference)}
    assert set(DEVICE_JOBS) - asked <= {"parameter_write"}


def test_a_line_with_the_drive_of_an_axis_has_no_time_for_other_requests() -> None:
    """Parameters are read by the controller in its turn; requests of others would make its cycle late."""
    asked = {step.job for step in _steps(LINE)}
    assert "modbus" not in asked
    assert "parameter_read" in asked


@pytest.mark.exhaustive
def test_objects_and_variables_and_inputs_are_drawn() -> None:
    """Measuring inputs get their instructions, variables are assigned, inputs are given by their names."""
    drawn = list(_steps(PROBES))
    assert {"measuring_input", "abort_measuring_input", "assign", "let_go"} <= {step.job for step in drawn}
    given_inputs = {name for step in drawn for name in step.parameters}
    assert {"Acceleration", "Direction", "PositionControlled", "MeasuringRange"} <= given_inputs


def test_a_program_leads_a_drive_without_an_axis() -> None:
    """By its objects: enabled by 6040h, it turns in profile velocity mode."""
    steps = [
        Do("nmt", {"device": "drive1", "command": "START"}),
        _sdo(MODE, "03"),
        _sdo(CONTROL, "0600"),
        _sdo(CONTROL, "0700"),
        _sdo(CONTROL, "0f00"),
        Wait(0.2),
        _sdo(0x60FF, "40420f00"),
        Do("sdo_read", {"device": "drive1", "index": 0x6041}),
    ]
    outcome = run_program(Program(tuple(steps)), load_bench_file(LED))
    assert outcome.violation is None
    assert outcome.skipped == []
    assert abs(outcome.trace["drive1.motor_speed"].values[-1]) > 1.0


def test_a_program_sets_signals_of_a_telegram() -> None:
    """A PROFIdrive drive without an axis comes into operation by STW1."""
    steps = [
        Do("signal", {"device": "drive1", "name": "STW1", "value": 0x047E}),
        Wait(0.2),
        Do("signal", {"device": "drive1", "name": "STW1", "value": 0x047F}),
        Wait(0.3),
    ]
    outcome = run_program(Program(tuple(steps)), load_bench_file(SIGNALS))
    assert outcome.violation is None
    assert int(outcome.trace["drive1.drive_zsw1"].values[-1]) & 1 << 2


def test_inputs_go_to_the_instruction_in_the_unit_of_the_axis() -> None:
    """The deceleration of a step is the one with which the axis brakes; an unknown input is refused."""
    steps = (
        Do("power_on"),
        Wait(0.3),
        Do("move_velocity", {"velocity": 100.0, "Acceleration": 400.0, "Jerk": 0.0}),
        Wait(0.4),
        Do("halt", {"Deceleration": 250.0, "Jerk": 0.0}),
    )
    trace = run_program(Program(steps), load_bench_file("reference")).trace
    acceleration = trace["axis1.acceleration_setpoint"].values
    assert (acceleration.max(), acceleration.min()) == (400.0, -250.0)
    with pytest.raises(ConfigurationError, match="Decceleration"):
        Do("halt", {"Decceleration": 250.0})


def test_a_request_to_nobody_is_left_out() -> None:
    """A device that is not there, or is no node, cannot be asked: the step is skipped and told."""
    steps = (
        Do("sdo_read", {"device": "nobody", "index": 0x1000}),
        Do("modbus", {"device": "drive1", "function": 3}),
    )
    outcome = run_program(Program(steps), load_bench_file("analog"))
    assert len(outcome.skipped) == 2
