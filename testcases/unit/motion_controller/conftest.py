"""The reference axis of the axis tests, with its controller."""

from __future__ import annotations

from math import tau

import pytest

from fieldbus.clock import S
from motion.s7.controller import OperatingState
from testcases.unit.motion_axis.conftest import Rig
from testcases.unit.motion_axis.test_sensors import Rig as EncoderRig


class Controlled:
    """What leads the controller of a rig through its operating states."""

    @property
    def controller(self):
        return self.runtime.controller

    def reach(self, state: OperatingState, timeout: float = 5.0):
        assert self.scheduler.run_until(lambda: self.controller.state is state, round(timeout * S))
        return self

    def stopped(self):
        """In STOP, with every drive off."""
        self.controller.stop()
        self.until(lambda: self.axis.object.state.name in {"DISABLED", "ALARM_DISABLED"})
        self.cycles(8)  # whatever is restarted, too
        return self

    def running(self):
        """Back in RUN, everything initialised."""
        self.controller.run()
        self.reach(OperatingState.RUN)
        self.cycles(3)
        return self

    def power_cycled(self, off_s: float = 0.1):
        self.controller.power_off()
        self.scheduler.run_for(round(off_s * S))
        self.controller.power_on()
        self.reach(OperatingState.RUN)
        self.cycles(3)
        return self

    def turn(self, revolutions: float) -> None:
        """Turn the shaft of the motor by hand."""
        self.port.turn(revolutions * tau)

    def reported(self, words: str) -> list[str]:
        return [entry.text for entry in self.controller.diagnostics_buffer.find(words)]


class ControllerRig(Controlled, Rig):
    """The reference axis on a simulated drive."""


class TwoEncoderRig(Controlled, EncoderRig):
    """An axis with a second encoder on the same shaft."""


@pytest.fixture
def make_two_encoders():
    return TwoEncoderRig


@pytest.fixture
def rig():
    return ControllerRig()


@pytest.fixture
def make_rig():
    return ControllerRig
