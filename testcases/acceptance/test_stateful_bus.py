"""A bus with three drives: nodes are lost, reset, commanded by somebody else, and the bus is disturbed, in
any order.

Whatever happened, the others' motion is their own business, and once all causes are gone every axis can be
enabled and moved
again: nothing stays behind.
"""

from __future__ import annotations

import re

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from hil.bench import load_bench
from hil.bench.bench import Bench
from hil.bench.bench_file import parse
from hil.expect import run_checkers
from hil.faults import Injector
from reports.model import Verdict

pytestmark = pytest.mark.exhaustive

DRIVES = ("drive1", "drive2", "drive3")
AXES = ("axis1", "axis2", "axis3")


def three_drives() -> str:
    """Return the reference bench with two more drives and axes."""
    text = load_bench("reference").text
    head, parts = text[: text.index("[drive.drive1]")], text[text.index("[drive.drive1]") :]
    for number in (1, 2, 3):
        own = parts.replace("drive1", f"drive{number}").replace("axis1", f"axis{number}")
        head += re.sub(r"node_id = \d+", f"node_id = {4 + number}", own)
    return head


FILE = parse(three_drives(), "three drives")

drives = st.sampled_from(DRIVES)
axes = st.sampled_from(AXES)


class BusUnderFaults(RuleBasedStateMachine):
    """Acts on a running bench step by step."""

    def __init__(self) -> None:
        super().__init__()
        self.bench = Bench(FILE, seed=1)
        self.faults = Injector(self.bench)
        self.broken = 0
        for name in AXES:
            self.bench.axis(name).power()
        self.bench.run_for(0.3)

    def teardown(self) -> None:
        with self.bench:
            self.calm()

    @rule(seconds=st.sampled_from([0.002, 0.02, 0.1, 0.4]))
    def wait(self, seconds):
        self.bench.run_for(seconds)

    @rule(name=axes, velocity=st.sampled_from([-100.0, 20.0, 300.0]))
    def move(self, name, velocity):
        self.bench.axis(name).move_velocity(velocity)

    @rule(name=axes, enable=st.booleans())
    def power(self, name, enable):
        self.bench.axis(name).power(enable)

    @rule(name=axes)
    def reset(self, name):
        self.bench.axis(name).reset()

    @precondition(lambda self: self.broken < 4)
    @rule(
        name=drives,
        kind=st.sampled_from(["drive.power_off", "drive.heartbeat_loss", "drive.sto", "drive.reset"]),
        seconds=st.sampled_from([0.01, 0.1, 0.6]),
    )
    def lose(self, name, kind, seconds):
        self.broken += 1
        self.faults.inject(kind, name, duration_s=None if kind == "drive.reset" else seconds)

    @precondition(lambda self: self.broken < 4)
    @rule(
        data=st.sampled_from(["80", "02", "81", "82", "01"]),
        node=st.sampled_from([0, 5, 6, 7]),
    )
    def foreign_command(self, data, node):
        self.broken += 1
        self.faults.inject("frame.inject", "can0", count=1, can_id=0, data=f"{data}{node:02x}")

    @precondition(lambda self: self.broken < 4)
    @rule(
        kind=st.sampled_from(["frame.drop", "frame.corrupt"]),
        message=st.sampled_from(["tpdo1", "rpdo1", "heartbeat", "sync", "sdo_tx"]),
        name=drives,
        count=st.sampled_from([1, 3, 40]),
    )
    def disturb(self, kind, message, name, count):
        self.broken += 1
        can_id = 0x80 if message == "sync" else self.bench.cob_ids(name)[message]
        self.faults.inject(kind, "can0", count=count, can_id=can_id)

    @invariant()
    def undisturbed_axes_have_no_alarm(self):
        """As long as nothing was broken, nothing is wrong."""
        if not self.broken:
            assert all(not self.bench.axis(name).var("StatusWord.X1") for name in AXES)

    def calm(self) -> None:
        """Take all faults back: every axis comes into service, and moves."""
        self.faults.remove_all()
        for name in AXES:
            self.bench.axis(name).power(False)
        self.bench.run_for(2.0)
        for name in AXES:
            axis = self.bench.axis(name)
            assert self.bench.run_until(lambda axis=axis: axis.object.port.link_ok, 5.0), f"{name}: no link"
            done = axis.reset()
            assert self.bench.run_until(done.done, 5.0), f"{name}: MC_Reset {done}"
            assert self.bench.run_until(axis.power().status, 5.0), f"{name}: {axis.diagnosis()}"
            job = axis.move_velocity(50.0)
            assert self.bench.run_until(job.in_velocity, 2.0), f"{name}: {axis.diagnosis()}"
        failed = [check for check in run_checkers(self.bench.trace()) if check.verdict is not Verdict.PASSED]
        assert failed == []


BusUnderFaults.TestCase.settings = settings(max_examples=15, stateful_step_count=12, deadline=None)
TestBusUnderFaults = pytest.mark.requirement("STP-514", "STP-331", "C301-001")(BusUnderFaults.TestCase)
