"""A machine that gives motion commands and faults in any order: the invariants hold, a failure shrinks to a
program that replays.

The machine decides what to do next from what it has done so far (a stop is released only after it was given,
a fault is removed only after it was injected); the finished program runs on a fresh bench with all invariants
watched in every cycle, and its token stands in the message of a failure.
"""

from __future__ import annotations

from typing import ClassVar

from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from hil.bench import load_bench
from hil.faults import Fault
from hil.fuzz import Break, Do, Program, Wait, program_token, run_program

LONGEST = 14

velocities = st.sampled_from([-450.0, -300.0, -20.0, 20.0, 100.0, 300.0, 450.0])


class MotionUnderFaults(RuleBasedStateMachine):
    """Builds a program step by step."""

    bench: ClassVar[str]
    """Name of an embedded bench."""

    def __init__(self) -> None:
        super().__init__()
        self.steps = [Do("power_on"), Wait(0.1), Do("home")]
        self.stopped = False
        self.jogging = False
        self.faults = 0

    def add(self, step) -> None:
        if len(self.steps) < LONGEST:
            self.steps.append(step)

    @rule(seconds=st.sampled_from([0.004, 0.02, 0.1, 0.4, 1.0]))
    def wait(self, seconds):
        self.add(Wait(seconds))

    @rule(mode=st.sampled_from([0, 1, 2, 3]))
    def power_off(self, mode):
        self.add(Do("power_off", {"stop_mode": mode}))

    @rule()
    def power_on(self):
        self.add(Do("power_on"))

    @rule()
    def reset(self):
        self.add(Do("reset"))

    @rule(velocity=velocities)
    def move_velocity(self, velocity):
        self.add(Do("move_velocity", {"velocity": velocity}))

    @rule(
        distance=st.sampled_from([-60.0, -1.0, 0.0, 1.0, 60.0]),
        velocity=st.sampled_from([10.0, 100.0, 500.0]),
    )
    def move_relative(self, distance, velocity):
        self.add(Do("move_relative", {"distance": distance, "velocity": velocity}))

    @rule(position=st.sampled_from([-80.0, 0.0, 80.0]))
    def move_absolute(self, position):
        self.add(Do("move_absolute", {"position": position}))

    @rule(backward=st.booleans())
    def jog(self, backward):
        self.jogging = True
        self.add(Do("jog", {"velocity": 150.0, "backward": backward}))

    @precondition(lambda self: self.jogging)
    @rule()
    def jog_release(self):
        self.add(Do("jog_release"))

    @rule()
    def halt(self):
        self.add(Do("halt"))

    @rule(mode=st.sampled_from([0, 2, 3]))
    def stop(self, mode):
        self.stopped = True
        self.add(Do("stop", {"mode": mode}))

    @precondition(lambda self: self.stopped)
    @rule()
    def stop_release(self):
        self.add(Do("stop_release"))

    @precondition(lambda self: self.faults < 2)
    @rule(name=st.sampled_from(["negative_limit", "positive_limit"]))
    def limit_switch(self, name):
        self.fault("switch.press", "drive1", input=name, duration_s=0.5)

    @precondition(lambda self: self.faults < 2)
    @rule(number_and_reaction=st.sampled_from([(533, 1), (104, 2), (304, 3), (521, 4), (550, 5)]))
    def alarm(self, number_and_reaction):
        number, reaction = number_and_reaction
        self.fault("axis.alarm", "axis1", number=number, reaction=reaction)

    @precondition(lambda self: self.faults > 0)
    @rule()
    def remove_faults(self):
        self.add(Do("remove_faults"))

    def fault(self, kind, target, *, duration_s=None, count=None, **parameters):
        self.faults += 1
        self.add(Break(Fault(kind, target, duration_s=duration_s, count=count, parameters=parameters)))

    @invariant()
    def steps_are_bounded(self):
        assert len(self.steps) <= LONGEST

    def teardown(self):
        program = Program(tuple(self.steps))
        bench = load_bench(self.bench)
        outcome = run_program(program, bench, seed=1)
        token = program_token(program, seed=1, bench=self.bench, bench_digest=bench.digest)
        assert outcome.skipped == []
        assert outcome.violation is None, (
            f"{outcome.violation}\n{program}\nrepeat it with: hil replay {token}"
        )
