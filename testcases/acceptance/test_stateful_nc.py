"""Commands, enables, parameters and faults of an NC axis in any order: the rules that judge every case hold,
and the axis comes back.
"""

import math

import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from hil.campaign import load_bench_file
from hil.expect import run_checkers
from hil.faults import Injector
from motion.nc.blocks import HomingMode, JogMode
from motion.nc.commands import BufferMode
from reports.model import Verdict

pytestmark = pytest.mark.exhaustive

FAULTS = (
    ("drive.fault", {"code": 0x2310}),
    ("drive.fault", {"code": 0x3210}),
    ("drive.sto", {}),
    ("mechanics.jam", {}),
    ("mechanics.load_step", {"force_N": -300.0}),
    ("encoder.jump", {"increments": 4000}),
    ("encoder.jump", {"increments": 200_000}),
)
BUS = (("frame.drop", {"message": "tpdo1", "count": 3}), ("frame.drop", {"message": "tpdo1", "count": 12}))
VELOCITIES = st.sampled_from([-20.0, 0.0, 1e-3, 40.0, 200.0, 500.0, 500.1])
POSITIONS = st.sampled_from([-60.0, -0.001, 0.0, 25.0, 80.0, 150.0])


class NcAxisUnderFire(RuleBasedStateMachine):
    """An NC axis with software limits on the reference machine."""

    @initialize()
    def begin(self):
        """Bring the bench up."""
        self.bench = load_bench_file("nc-axes:reference").build(seed=0).__enter__()
        self.axis = self.bench.axis(controller="nc")
        for end, value in (("min", -120.0), ("max", 120.0)):
            self.axis.write_parameter(f"axis.soft_limit_{end}", value)
            self.axis.write_parameter(f"axis.soft_limit_{end}_enable", True)
        self.faults = Injector(self.bench)
        self.injected = []
        self.blocks = []
        self.axis.power()
        self.pass_time(60)

    @rule(cycles=st.sampled_from([1, 2, 7, 40, 150]))
    def pass_time(self, cycles):
        """Let cycles pass."""
        self.bench.run_for(cycles * self.bench.cycle_ns * 1e-9)

    @rule(
        on=st.booleans(),
        forward=st.booleans(),
        backward=st.booleans(),
        override=st.sampled_from([0.0, 30.0, 100.0]),
    )
    def power(self, on, forward, backward, override):
        """Set enables and override."""
        self.axis.power(on, positive=forward, negative=backward, override=override)

    @rule(position=POSITIONS, velocity=VELOCITIES, mode=st.sampled_from(list(BufferMode)))
    def move(self, position, velocity, mode):
        """Move to a position."""
        self.blocks.append(self.axis.move_absolute(position, Velocity=velocity, BufferMode=mode))

    @rule(velocity=VELOCITIES)
    def endless(self, velocity):
        """Move on and on."""
        self.blocks.append(self.axis.move_velocity(velocity))

    @rule(backwards=st.booleans(), mode=st.sampled_from(list(JogMode)))
    def jog(self, backwards, mode):
        """Jog for some cycles."""
        block = self.axis.jog(mode, backwards=backwards, Velocity=50.0, Position=3.0)
        self.pass_time(20)
        block.set(JogForward=False, JogBackwards=False)

    @rule(locks=st.booleans())
    def brake(self, locks):
        """Stop or halt, and unlock a stop."""
        block = self.axis.stop() if locks else self.axis.halt()
        self.pass_time(10)
        block.set(Execute=False)

    @rule()
    def reset(self):
        """Reset the error."""
        self.axis.reset()
        self.pass_time(5)

    @rule(position=POSITIONS, relative=st.booleans())
    def place(self, position, relative):
        """Give the present place another position."""
        if relative:
            self.axis.set_position(position, relative=True)
        else:
            self.axis.home(position, mode=HomingMode.MC_Direct)
        self.pass_time(2)

    @rule(fault=st.sampled_from(FAULTS + BUS))
    def inject(self, fault):
        """Break something."""
        kind, options = fault
        target = "can0" if fault in BUS else "drive1"
        self.injected.append(self.faults.inject(kind, target, **options))

    @precondition(lambda self: getattr(self, "injected", None))
    @rule()
    def repair(self):
        """Take the faults back."""
        while self.injected:
            self.injected.pop().remove()

    @rule(lag=st.sampled_from([0.5, 5.0, 10.0]), gain=st.sampled_from([5.0, 20.0]))
    def tune(self, lag, gain):
        """Change parameters while the axis runs."""
        self.axis.write_parameter("axis.position_lag_max", lag)
        self.axis.write_parameter("ctrl.pos_kv", gain)

    @invariant()
    def says_what_it_is(self):
        """Every block has ended in at most one way, and numbers are numbers."""
        if not hasattr(self, "axis"):
            return
        for block in self.blocks:
            assert sum(map(bool, (block.Done, block.CommandAborted, block.Error))) <= 1, block
            assert bool(block.ErrorID) == bool(block.Error), block
        image = self.axis.ref.NcToPlc
        assert all(map(math.isfinite, (image.SetPos, image.SetVelo, image.ActPos, image.PosDiff)))
        assert abs(image.SetVelo) <= 500.0 * (1.0 + 1e-6)

    def teardown(self):
        """Judge the trace by the rules of every case; without faults the axis comes back by a reset."""
        if not hasattr(self, "bench"):
            return
        try:
            self.repair()
            self.axis.power(False)
            self.pass_time(400)
            self.axis.reset()
            self.pass_time(100)
            self.axis.power()
            self.pass_time(100)
            failed = [
                check for check in run_checkers(self.bench.trace()) if check.verdict is not Verdict.PASSED
            ]
            assert failed == [], [(check.name, check.observed) for check in failed]
            assert self.axis.operational, self.axis
        finally:
            self.bench.__exit__(None, None, None)


NcAxisUnderFire.TestCase.settings = settings(
    max_examples=8,
    stateful_step_count=15,
    deadline=None,
    suppress_health_check=list(HealthCheck),
    derandomize=True,
)
TestNcAxisUnderFire = NcAxisUnderFire.TestCase
