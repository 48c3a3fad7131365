"""The control unit: telegrams 390 to 394, inputs and outputs, probes with time stamps, sign of life,
faults.
"""

from __future__ import annotations

import pytest

from emulators.drive.profidrive.control_unit import TELEGRAMS, ControlUnit
from fieldbus.clock import US
from fieldbus.errors import ConfigurationError
from fieldbus.profidrive import describe_word
from fieldbus.profidrive.sign_of_life import next_sign
from testcases.campaigns._control_unit_rig import ACKNOWLEDGE, CONTROL, PING, Rig


@pytest.mark.requirement(
    "PD-021",
    "PD-022",
    "PD-023",
    "PD-024",
    "PD-025",
    "CFG-238",
    "CFG-239",
    "CFG-240",
    "CFG-215",
    "CFG-216",
    "CFG-217",
)
@pytest.mark.parametrize("number", TELEGRAMS)
def test_inputs_and_outputs_of_every_telegram(number):
    """Outputs follow A_DIGITAL, inputs show in E_DIGITAL; the second words where the telegram has them; 2, 6
    or 8 probes.
    """
    rig = Rig(number)
    names = rig.layout.setpoint.names
    rig.unit.set_input(3, True)
    rig.unit.set_input(17, True)
    rig.unit.analog_input = -1234
    answer = rig.cycle(A_DIGITAL=0x8001, **({"A_DIGITAL_1": 0x0007} if "A_DIGITAL_1" in names else {}))
    assert rig.unit.outputs == 0x8001 | (0x0007_0000 if "A_DIGITAL_1" in names else 0)
    assert answer["E_DIGITAL"] == 0x0008
    assert answer.get("E_DIGITAL_1", 2) == 0x0002
    assert answer.get("E_ANALOG", -1234) == -1234
    assert rig.unit.probes == {390: 0, 391: 2, 392: 6, 393: 8, 394: 0}[number]
    rig.unit.set_input(3, False)
    assert rig.cycle()["E_DIGITAL"] == 0


@pytest.mark.requirement("PD-094", "PD-095")
@pytest.mark.parametrize("probe", [1, 2])
def test_time_stamps(probe):
    """An awaited edge 1.5 ms behind the beginning of the cycle is 6000 ticks of 0.25 us in the next answer,
    and then 0 again.
    """
    rig = Rig()
    falling, rising = 1 << (probe - 1), 1 << (probe + 7)
    rig.cycle(MT_STW=falling | rising)
    unit, scheduler = rig.unit, rig.scheduler
    unit.cycle()
    scheduler.run_for(1500 * US)
    unit.probe_edge(probe, True)
    scheduler.run_for(500 * US)
    unit.probe_edge(probe, False)
    unit.probe_edge(probe, True)  # only the first edge of a cycle counts
    scheduler.run_for(2000 * US)
    answer = rig.cycle(MT_STW=falling)
    assert (answer[f"MT{probe}_ZS_S"], answer[f"MT{probe}_ZS_F"]) == (6000, 8000)
    assert answer["MT_ZSW"] == falling
    other = 3 - probe
    assert (answer[f"MT{other}_ZS_S"], answer[f"MT{other}_ZS_F"]) == (0, 0)
    unit.probe_edge(probe, False)
    unit.probe_edge(probe, True)  # not awaited any more
    answer = rig.cycle(MT_STW=falling)
    assert answer[f"MT{probe}_ZS_S"] == 0
    assert answer[f"MT{probe}_ZS_F"] > 0
    assert rig.cycle(MT_STW=falling)[f"MT{probe}_ZS_F"] == 0


@pytest.mark.requirement("PD-093")
def test_status_word():
    """Fault, alarm and synchronised time in bits 3, 7 and 8; acknowledged with the edge of bit 7, the ping is
    the edge of bit 0.
    """
    rig = Rig()
    assert rig.cycle()["CU_ZSW1"] & 0x0FFF == 0
    rig.unit.raise_fault(1000)
    rig.unit.warnings.add(2000)
    assert rig.cycle()["CU_ZSW1"] & 0x0FFF == 0x0088
    assert rig.cycle(CONTROL | ACKNOWLEDGE)["CU_ZSW1"] & 0x0FFF == 0x0080
    rig.unit.raise_fault(1000)
    assert rig.cycle(CONTROL | ACKNOWLEDGE)["CU_ZSW1"] & 0x0008
    rig.unit.warnings.clear()
    assert rig.cycle(CONTROL | PING)["CU_ZSW1"] & 0x0FFF == 0x0108
    assert describe_word("CU_STW1", 0x5401) == "5401h CLOCK_PING CONTROL_BY_PLC sign of life 5"


@pytest.mark.requirement("PD-093", "CFG-615")
def test_sign_of_life():
    """The unit answers when the controller counts, and faults when it stops; without clock there is none."""
    rig = Rig()
    first = rig.cycle(count=40)["CU_ZSW1"] >> 12
    assert rig.cycle()["CU_ZSW1"] >> 12 == next_sign(first)
    rig.counts = False
    assert rig.cycle(count=3)["CU_ZSW1"] & 0x0008
    assert rig.unit.faults.present[0].number == 1912
    assert Rig(isochronous=False).cycle(count=40)["CU_ZSW1"] == 0


@pytest.mark.requirement("PD-093")
def test_without_control_by_plc_outputs_stay():
    """Bit 10 = 0: outputs are not taken over, wrong lengths neither."""
    rig = Rig()
    rig.cycle(A_DIGITAL=0x0005)
    rig.cycle(0, A_DIGITAL=0x0000)
    assert rig.unit.outputs == 0x0005
    assert not rig.unit.receive(b"123")
    assert rig.unit.refused == 1
    with pytest.raises(ConfigurationError, match=r"1\.\.2"):
        rig.unit.probe_edge(3, True)
    with pytest.raises(ConfigurationError, match="390, 391"):
        ControlUnit(rig.scheduler, number=395)
