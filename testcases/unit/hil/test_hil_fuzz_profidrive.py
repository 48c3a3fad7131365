"""Fuzzing a PROFIdrive bench: kinds in reach, a search that finds nothing, and planted defects that it does
find.
"""

from __future__ import annotations

import pytest
from hypothesis import given, seed, settings

from emulators.drive.profidrive.operation import Operation
from emulators.drive.profidrive.statemachine import Action, AxisState, GeneralStateMachine
from hil.bench import load_bench
from hil.faults import Fault
from hil.fuzz import Break, Do, Program, Wait, fault_kinds, programs, run_program, search
from hil.fuzz._provider import BACKEND
from hil.fuzz._telegram_strategies import TELEGRAM_KINDS

pytestmark = pytest.mark.exhaustive


@pytest.fixture(scope="module")
def bench_file():
    return load_bench("profidrive")


def moving(*faults):
    """Return a program that moves, and then lets faults come one after the other."""
    steps = [Do("power_on"), Wait(0.3), Do("move_velocity", {"velocity": 200.0}), Wait(0.4)]
    for fault in faults:
        steps += [Break(fault), Wait(0.2)]
    return Program((*steps, Do("reset"), Wait(0.3)))


def test_a_search_reaches_every_kind_of_a_profidrive_axis(bench_file):
    """Telegram kinds are drawn where an axis is led by a telegram, and nowhere else."""
    with bench_file.build() as bench:
        kinds = fault_kinds(bench)
        strategy = programs(kinds, bench.cob_ids("drive1"))
    assert set(TELEGRAM_KINDS) <= set(kinds)
    with load_bench("reference").build() as bench:
        assert not [kind for kind in fault_kinds(bench) if kind.startswith("telegram.")]
    reached = set()

    @seed(1)
    @settings(max_examples=400, database=None, backend=BACKEND)
    @given(program=strategy)
    def gather(program):
        reached.update(step.fault.kind for step in program.steps if isinstance(step, Break))

    gather()
    assert reached == set(kinds)


def test_a_search_finds_nothing(bench_file):
    """Programs of jobs and faults, commands of the drive among them, break no invariant and no rule."""
    report = search(bench_file, cases=25, seed=5)
    assert (report.cases, report.failure) == (25, None)


@pytest.mark.parametrize(
    ("name", "own", "foreign"),
    [
        ("profidrive_tcp", "modbus.reset", "modbus.crc"),
        ("profidrive_rtu", "modbus.noise", "modbus.transaction"),
    ],
)
def test_a_bench_on_modbus_is_searched_with_the_faults_of_its_segment(name, own, foreign):
    """Frames of CAN are out of reach there, those of the own kind of segment are drawn; a short search finds
    nothing.
    """
    file = load_bench(name)
    with file.build() as bench:
        kinds = fault_kinds(bench)
    assert own in kinds
    assert foreign not in kinds
    assert not [kind for kind in kinds if kind.startswith(("frame.", "can."))]
    assert search(file, cases=8, seed=2).failure is None


OFF3_FOR_A_MOMENT = Fault("telegram.flip", count=3, parameters={"signal": "STW1.2"})
OFF2_FOR_A_MOMENT = Fault("telegram.flip", count=5, parameters={"signal": "STW1.1"})


@pytest.mark.requirement("PD-113")
def test_a_quick_stop_that_can_be_taken_back_is_found(bench_file, monkeypatch):
    """A planted defect: the drive goes on when OFF3 goes away during its quick stop."""
    step = GeneralStateMachine.step

    def defective(self, stw1, **options):
        if self.state is AxisState.S5B and stw1 & 0x000F == 0x000F and not options.get("off"):
            self.state = AxisState.S4
            return Action.CONTINUE
        return step(self, stw1, **options)

    program = moving(OFF3_FOR_A_MOMENT)
    assert run_program(program, bench_file).violation is None
    monkeypatch.setattr(GeneralStateMachine, "step", defective)
    found = run_program(program, bench_file).violation
    assert found.invariant == "general state machine of drive1"
    assert "S5b to S4" in found.text


@pytest.mark.requirement("PD-104")
def test_pulses_that_stay_after_off2_are_found(bench_file, monkeypatch):
    """A planted defect: OFF2 is made a quick stop, so that the pulses stay."""
    step = GeneralStateMachine.step

    def defective(self, stw1, **options):
        return step(self, stw1 | 0x0002 if self.state is AxisState.S4 else stw1, **options)

    program = moving(OFF2_FOR_A_MOMENT)
    assert run_program(program, bench_file).violation is None
    monkeypatch.setattr(GeneralStateMachine, "step", defective)
    assert run_program(program, bench_file).violation.invariant == "OFF2 of drive1"


@pytest.mark.requirement("PD-078")
def test_a_fault_that_acknowledges_itself_is_found(bench_file, monkeypatch):
    """A planted defect: the drive forgets its fault without an edge of STW1.7."""
    program = moving(Fault("drive.fault", parameters={"code": 0x2310}))
    assert run_program(program, bench_file).violation is None
    act = Operation.act
    calls = []

    def defective(self):
        act(self)
        if self._faults.present:
            calls.append(self)
            if len(calls) > 20:
                self._faults.acknowledge()

    monkeypatch.setattr(Operation, "act", defective)
    assert run_program(program, bench_file).violation.invariant == "acknowledging of drive1"
