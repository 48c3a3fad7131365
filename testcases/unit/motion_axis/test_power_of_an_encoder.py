"""`MC_Power` of an external encoder: validated and enabled, without drive and stop (section 2.1 of the
specification).
"""

from __future__ import annotations

import pytest

from motion.drives.simulated import SimulatedDrivePort
from motion.s7.axis import ExternalEncoder
from motion.s7.instructions import MC_Power
from testcases.rigs import ControllerRig

MS = 1_000_000


class Rig(ControllerRig):
    """An external encoder on a port that the test sets."""

    def __init__(self):
        super().__init__()
        self.port = SimulatedDrivePort(cycle_s=0.004)
        external = ExternalEncoder("ext1", self.port, cycle_ns=4 * MS, history=self.history)
        self.control_encoder(external)
        self.runtime.start()


@pytest.fixture
def rig():
    return Rig()


@pytest.mark.requirement("MC-037", "MC-134", "MC-159", "STP-035", "STP-027", "G2-010", "G2-019", "DIA-072")
@pytest.mark.parametrize("modes", [{}, {"StartMode": 0}, {"StartMode": 7}, {"StopMode": 9}])
def test_enabled_without_a_handshake(rig, modes):
    """Valid value and communication: Status and X0 follow Enable at once, whatever StartMode and StopMode
    say.
    """
    rig.cycles(5)
    assert rig.encoder.var("StatusWord.X0") is False
    power = rig.encoder.run(MC_Power(rig.encoder.object, **modes))
    power.set(Enable=True)
    rig.cycles(2)
    assert (power.Status, power.Busy, power.Error, power.ErrorID) == (True, True, False, 0)
    assert rig.encoder.var("StatusWord.X0") is True
    power.set(Enable=False)
    rig.cycles(1)
    assert (power.Status, power.Busy) == (False, False)
    assert rig.encoder.var("StatusWord.X0") is False


@pytest.mark.requirement("MC-159", "MC-128", "MC-130", "MC-591")
def test_enabling_waits_for_a_valid_value(rig):
    """Without communication, alarm 108 acknowledged: Busy without Status; the value comes, Status too."""
    rig.port.link = False
    power = rig.encoder.power()
    rig.cycles(10)
    rig.encoder.reset()
    rig.cycles(10)
    assert rig.encoder.var("StatusSensor.State") != 2
    assert (power.Status, power.Busy, power.Error) == (False, True, False)
    rig.port.link = True
    rig.cycles(20)
    assert rig.encoder.var("StatusSensor.State") == 2
    assert power.Status


@pytest.mark.requirement("STP-021", "CFG-620", "STP-015")
def test_enable_before_the_encoder_has_joined(rig):
    """108 once, with the reaction of an external encoder; acknowledged it does not come again, and the value
    enables.
    """
    rig.port.link = False
    power = rig.encoder.power()
    rig.cycles(10)
    assert [one.data["number"] for one in rig.history.select(kind="alarm.raised")] == [108]
    assert (rig.encoder.var("ErrorDetail.Reaction"), rig.encoder.var("ErrorWord")) == (10, 1 << 1)
    rig.encoder.reset()
    rig.cycles(10)
    assert len(list(rig.history.select(kind="alarm.raised"))) == 1
    assert (power.Busy, power.Status) == (True, False)
    rig.port.link = True
    rig.cycles(3)
    assert power.Status


@pytest.mark.requirement("MC-117", "MC-157", "VAR-095", "G2-017")
def test_an_alarm_disables_until_it_is_acknowledged(rig):
    """Reaction 10: Status FALSE, Error 16#8001, Busy stays; after MC_Reset enabled again without an edge."""
    power = rig.encoder.power()
    rig.cycles(5)
    rig.port.link = False
    rig.cycles(2)
    assert rig.encoder.var("ErrorDetail.Reaction") == 10
    assert (power.Status, power.Busy, power.ErrorID) == (False, True, 0x8001)
    rig.port.link = True
    rig.cycles(20)
    assert not power.Status
    rig.encoder.reset()
    rig.cycles(5)
    assert (power.Status, power.Error) == (True, False)


@pytest.mark.requirement("MC-170", "MC-009", "MC-181")
def test_an_enabled_encoder_is_not_restarted(rig):
    """Restart needs Enable FALSE: 16#800E and warning 322 before, Done after; not enabled while it is
    restarted.
    """
    rig.encoder.power()
    rig.cycles(5)
    refused = rig.encoder.reset(restart=True)
    rig.cycles(2)
    assert refused.ErrorID == 0x800E
    assert rig.encoder.var("WarningWord.X3")
    power = rig.encoder.power(False)
    rig.cycles(2)
    reset = rig.encoder.reset(restart=True)
    rig.cycles(1)
    power.set(Enable=True)
    rig.cycles(2)
    assert rig.encoder.var("StatusWord.X2")
    assert not power.Status
    rig.cycles(10)
    assert reset.Done
    assert power.Status


@pytest.mark.requirement("MC-160", "MC-608")
def test_one_instance_rules_the_encoder(rig):
    """A second instance: 16#800C without effect."""
    rig.encoder.power()
    rig.cycles(5)
    second = rig.encoder.run(MC_Power(rig.encoder.object, Enable=False))
    rig.cycles(3)
    assert second.ErrorID == 0x800C
    assert rig.encoder.var("StatusWord.X0") is True
