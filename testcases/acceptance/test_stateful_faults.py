"""Motion commands and faults in any order on one axis, behind CiA 402 and behind PROFIdrive."""

from __future__ import annotations

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import precondition, rule

from testcases.acceptance.motion_machine import MotionUnderFaults

pytestmark = pytest.mark.exhaustive


class Cia402UnderFaults(MotionUnderFaults):
    """An axis on a CiA 402 drive."""

    bench = "reference"

    @precondition(lambda self: self.faults < 2)
    @rule(code=st.sampled_from([0x2310, 0x3210, 0x7305, 0x8611]))
    def drive_fault(self, code):
        self.fault("drive.fault", "drive1", code=code)

    @precondition(lambda self: self.faults < 2)
    @rule(kind=st.sampled_from(["drive.sto", "drive.power_off", "drive.heartbeat_loss", "mechanics.jam"]))
    def broken_device(self, kind):
        self.fault(kind, "drive1", duration_s=0.5)

    @precondition(lambda self: self.faults < 2)
    @rule(message=st.sampled_from(["tpdo1", "rpdo1", "sync"]), count=st.sampled_from([1, 2, 5, 50]))
    def lost_frames(self, message, count):
        self.fault("frame.drop", "can0", count=count, message=message)


class ProfidriveUnderFaults(MotionUnderFaults):
    """An axis behind a PROFIdrive telegram: the words of the telegram may lie, come late or not at all."""

    bench = "profidrive"

    @precondition(lambda self: self.faults < 2)
    @rule(code=st.sampled_from([7900, 7802, 30001, 30002, 30005]))
    def drive_fault(self, code):
        self.fault("drive.fault", "drive1", code=code)

    @precondition(lambda self: self.faults < 2)
    @rule(
        kind=st.sampled_from(
            ["drive.sto", "drive.ss1", "drive.power_off", "safety.ss2", "safety.sos", "mechanics.jam"]
        )
    )
    def broken_device(self, kind):
        self.fault(kind, "drive1", duration_s=0.5)

    @precondition(lambda self: self.faults < 2)
    @rule(
        signal=st.sampled_from(
            ["STW1.0", "STW1.1", "STW1.2", "STW1.3", "STW1.4", "ZSW1.1", "ZSW1.2", "ZSW1.3", "ZSW1.9"]
        ),
        cycles=st.sampled_from([1, 5, 50]),
    )
    def wrong_bit(self, signal, cycles):
        self.fault("telegram.flip", "drive1", count=cycles, signal=signal)

    @precondition(lambda self: self.faults < 2)
    @rule(
        kind=st.sampled_from(
            ["telegram.lost", "telegram.freeze", "telegram.control_lost", "telegram.sign_of_life"]
        ),
        direction=st.sampled_from(["actual", "setpoint"]),
        cycles=st.sampled_from([1, 3, 50]),
    )
    def disturbed_telegram(self, kind, direction, cycles):
        self.fault(kind, "drive1", count=cycles, direction=direction)

    @precondition(lambda self: self.faults < 2)
    @rule(direction=st.sampled_from(["actual", "setpoint"]), cycles=st.integers(1, 4))
    def late_telegram(self, direction, cycles):
        self.fault("telegram.late", "drive1", duration_s=0.3, direction=direction, cycles=cycles)


Cia402UnderFaults.TestCase.settings = settings(max_examples=25, stateful_step_count=12)
ProfidriveUnderFaults.TestCase.settings = settings(max_examples=20, stateful_step_count=12)
TestCia402UnderFaults = pytest.mark.requirement("STP-514", "MC-071", "STP-331", "STP-346")(
    Cia402UnderFaults.TestCase
)
TestProfidriveUnderFaults = pytest.mark.requirement("STP-514", "MC-071", "STP-331", "PD-104")(
    ProfidriveUnderFaults.TestCase
)
