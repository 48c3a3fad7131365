"""Objects of CiA 402 at the PROFIdrive axis, by SDO: what they show, what they take, what they refuse."""

from __future__ import annotations

from dataclasses import replace

import pytest

from emulators.drive.profidrive import AxisState, ProfidriveCanDrive, ProfidriveConfig, ProfidriveNodeConfig
from fieldbus.can import CanFrame, CanMedium
from fieldbus.canopen.abort import SdoAbort
from fieldbus.canopen.nmt import NmtCommand
from fieldbus.clock import MS, VirtualScheduler

READY, RUN = 0x047E, 0x047F


class Node:
    """A drive on CAN that is led by SDO alone; operating mode 1, ramps of a second."""

    def __init__(self, telegram=1):
        self.scheduler = VirtualScheduler()
        segment = CanMedium(self.scheduler, name="can0")
        config = ProfidriveConfig.reference(telegram=telegram, operating_mode=1)
        config = replace(config, isochronous=False)
        self.drive = ProfidriveCanDrive(
            self.scheduler, segment, ProfidriveNodeConfig(node_id=9, drive=config), name="drive"
        )
        self.store = self.drive.slave.store
        self.drive.power_on()
        self.drive.drive.settings.setpoint_monitoring_ms = 0.0
        self.scheduler.run_for(10 * MS)
        segment.attach("controller", lambda frame, time_ns: None).send(
            CanFrame(0, bytes((NmtCommand.START, 9)))
        )
        self.scheduler.run_for(10 * MS)

    def read(self, index, sub=0):
        data = self.store.read(index, sub)
        entry = self.store.foreign.entry(index, sub)
        return int.from_bytes(data, "little", signed=entry.signed)

    def write(self, index, value, sub=0):
        size = self.store.foreign.entry(index, sub).bits // 8
        self.store.write(index, sub, value.to_bytes(size, "little", signed=value < 0))
        self.scheduler.run_for(20 * MS)

    def turn(self, rpm):
        self.write(0x6040, READY)
        self.write(0x60FF, rpm)
        self.write(0x6040, RUN)
        self.scheduler.run_for(2000 * MS)


@pytest.mark.exhaustive
@pytest.mark.requirement("PD-342")
def test_control_word_and_target_velocity_lead_the_axis():
    """6040h and 60FFh are STW1 and the setpoint, 6041h is ZSW1, 606Ch the speed; all of them in rpm and the
    bits of the profile.
    """
    node = Node()
    node.turn(-900)
    assert node.drive.state is AxisState.S4
    assert node.drive.core.speed_rpm == pytest.approx(-900.0, abs=1.0)
    assert node.read(0x6040) == RUN
    assert node.read(0x6041) == node.drive.drive.words.zsw1()
    assert node.read(0x60FF) == pytest.approx(-900, abs=1)
    assert node.read(0x606C) == node.read(0x6069) == round(node.drive.core.speed_rpm)
    assert node.read(0x606B) == pytest.approx(-900, abs=2)
    assert node.read(0x6063) == node.drive.drive.g1_words[1]
    assert node.read(0x6074) == pytest.approx(node.drive.core.torque_demand / 2.0 * 1000.0, abs=2)
    node.write(0x6040, READY)
    node.scheduler.run_for(2000 * MS)
    assert node.drive.state is AxisState.S2


@pytest.mark.exhaustive
@pytest.mark.requirement("PD-342")
def test_settings_are_parameters():
    """6072h is p1520, 6083h to 6085h are p1082 by p1120, p1121, p1135, 6094h is p8798 and scales every
    velocity.
    """
    node = Node()
    value = node.drive.parameters.store.value
    assert node.read(0x6072) == 3000
    node.write(0x6072, 1500)
    assert value(1520) == pytest.approx(3.0)
    for index, number, rpm_per_s, seconds in (
        (0x6083, 1120, 6000, 0.5),
        (0x6084, 1121, 1500, 2.0),
        (0x6085, 1135, 12000, 0.25),
    ):
        node.write(index, rpm_per_s)
        assert value(number) == pytest.approx(seconds)
        assert node.read(index) == rpm_per_s
        with pytest.raises(SdoAbort):
            node.write(index, 0)
    node.drive.parameters.store.write(1120, 0.0)
    assert node.read(0x6083) == 0xFFFFFFFF
    node.turn(600)
    node.write(0x6094, 10, 1)
    assert node.read(0x606C) == pytest.approx(6000, abs=10)
    assert node.read(0x60FF) == pytest.approx(6000, abs=2)
    node.write(0x6094, 5, 2)
    assert node.read(0x606C) == pytest.approx(1200, abs=2)
    assert (value(8798, 0), value(8798, 1)) == (10, 5)
    with pytest.raises(SdoAbort):
        node.write(0x6094, 0, 2)


@pytest.mark.requirement("PD-342")
def test_what_is_fixed():
    """The mode is that of the telegram; what can only be one thing takes nothing else; 6504h names the
    maker.
    """
    node = Node()
    assert (node.read(0x6060), node.read(0x6061), node.read(0x6502)) == (3, 3, 4)
    assert node.store.read(0x6007, 0) == b"\3\0"
    assert node.store.read(0x6504, 0) == b"SIEMENS"
    for index, right, wrong in ((0x6060, 3, 1), (0x605D, 1, 2), (0x6086, 0, 3)):
        node.write(index, right)
        with pytest.raises(SdoAbort):
            node.write(index, wrong)
    for index in (0x6041, 0x6061, 0x6063, 0x606C, 0x6071, 0x6074, 0x6502):
        with pytest.raises(SdoAbort):
            node.store.write(index, 0, b"\0\0")
    with pytest.raises(SdoAbort):
        node.store.read(0x6040, 1)
    with pytest.raises(SdoAbort):
        node.store.read(0x607A, 0)
    display = int(node.drive.parameters.store.value(2))
    assert node.store.read(0x2002, 0) == display.to_bytes(2, "little")  # parameters are behind them as before


@pytest.mark.requirement("PD-342")
def test_a_wide_setpoint():
    """With a telegram that has NSOLL_B the target goes there."""
    node = Node(telegram=2)
    node.write(0x60FF, 1234)
    names = node.drive.drive.telegram.setpoint.names
    assert "NSOLL_B" in names
    assert node.read(0x60FF) == 0  # without control by PLC nothing is taken over
    node.write(0x6040, READY)
    node.write(0x60FF, 1234)
    assert node.read(0x60FF) == 1234
