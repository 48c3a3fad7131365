"""Limit switches that are bits of a data block, and not inputs (LIM section 1.8)."""

from __future__ import annotations

import pytest

from fieldbus.errors import ConfigurationError
from motion.s7.controller import OperatingState
from motion.s7.data_blocks import BitAddress, DataBlocks, GlobalDataBlock

PLACE = "PositionLimits_HW.{}SwitchAddress.{}"
NUMBER = 7


def wired(make_rig, *, size=16, optimized=False, **variables):
    """A rig whose switches are DB7.DBX4.0 and DBX4.1, with the monitoring off, as it has to be at the
    start.
    """
    rig = make_rig(variables={"PositionLimits_HW.ApproachBehavior": 1} | variables)
    rig.block = rig.runtime.data_blocks.add(NUMBER, size, optimized=optimized)
    rig.axis.set_limit_variables(BitAddress.of_bit(NUMBER, 4, 0), BitAddress.of_bit(NUMBER, 4, 1))
    return rig


def restart(rig):
    reset = rig.axis.reset(restart=True)
    rig.until(lambda: reset.Done or reset.Error)
    rig.cycles(2)


def monitor(rig, on=True):
    job = rig.axis.write_parameter(1000, on)
    rig.cycles(3)
    return job


def raised(rig, number=531):
    return [one.data["info"] for one in rig.events("alarm.raised") if one.data["number"] == number]


@pytest.mark.requirement("LIM-016", "LIM-069", "LIM-071", "VAR-023")
def test_addresses_by_their_parts(make_rig):
    """Byte 4, bits 0 and 1: offsets 32 and 33; eight start values, in force after the restart and not
    before.
    """
    rig = wired(make_rig)
    start, read = rig.axis.variables.start_value, rig.axis.variables.read
    expected = {"RID": 0x0200_0001, "Area": 0x84, "DbNumber": 7}
    for name, offset in (("Min", 32), ("Max", 33)):
        for part, value in (expected | {"Offset": offset}).items():
            assert start(PLACE.format(name, part)) == value
            assert read(PLACE.format(name, part)) == 0
    assert rig.axis.status_word & 0 == 0
    rig.cycles(1)
    assert rig.axis.var("StatusWord.X3")  # restart-relevant values wait
    restart(rig)
    assert [read(PLACE.format("Max", part)) for part in (*expected, "Offset")] == [*expected.values(), 33]
    assert not rig.axis.var("StatusWord.X3")


@pytest.mark.requirement("LIM-069", "LIM-065", "LIM-023")
@pytest.mark.parametrize(("bit", "word_bit", "info"), [(0, 17, 2), (1, 18, 1)])
def test_a_bit_is_a_switch(make_rig, bit, word_bit, info):
    """Set by the program, the bit stops the axis as an input does; the inputs of the drive mean nothing any
    more.
    """
    rig = wired(make_rig)
    restart(rig)
    assert monitor(rig).Done
    rig.enabled()
    job = rig.axis.move_velocity(-100.0 if bit == 0 else 100.0)
    rig.until(job.in_velocity)
    rig.port.switches = 3
    rig.run(0.05)
    assert not raised(rig)
    rig.block.set_bit(4, bit, True)
    rig.cycles(2)
    assert raised(rig) == [info]
    assert rig.axis.var(f"StatusWord.X{word_bit}")
    assert job.ErrorID == 0x8001
    rig.run(0.3)
    rig.until(rig.axis.reset().done)
    rig.block.set_bit(4, bit, False)
    rig.cycles(2)
    assert not rig.axis.var(f"StatusWord.X{word_bit}")


@pytest.mark.requirement("LIM-069")
def test_one_of_two(make_rig):
    """The negative switch a variable, the positive one an input; a level that is active low holds for the
    variable too.
    """
    rig = make_rig(variables={"PositionLimits_HW.MinSwitchLevel": False})
    block = rig.runtime.data_blocks.add(NUMBER, 2)
    block.set_bit(0, 3, True)
    rig.axis.set_limit_variables(negative=BitAddress.of_bit(NUMBER, 0, 3))
    restart(rig)
    assert monitor(rig).Done
    assert not raised(rig)
    rig.port.switches = 2
    rig.cycles(2)
    assert raised(rig) == [1]
    rig.port.switches = 0
    rig.cycles(2)
    rig.until(rig.axis.reset().done)
    block.set_bit(0, 3, False)
    rig.cycles(2)
    assert raised(rig) == [1, 2]


@pytest.mark.requirement("LIM-070")
def test_not_watched_from_the_start(make_rig):
    """Active TRUE in the configuration: 109 with reaction 4; MC_Reset alone does not help, a restart with
    Active FALSE does.
    """
    rig = wired(make_rig, **{"PositionLimits_HW.Active": True})
    restart(rig)
    engine = rig.axis.alarms.engine
    assert raised(rig, 109)[-1] in (1, 2)
    assert (engine.number, engine.reaction) == (109, 4)
    assert rig.axis.state.name == "ALARM_DISABLED"
    power = rig.axis.power()
    rig.run(0.2)
    assert not power.Status
    reset = rig.axis.reset()
    rig.until(reset.error)
    assert reset.ErrorID == 0x8015
    assert engine.is_pending(109)
    power.set(Enable=False)
    rig.run(0.1)
    rig.axis.variables.write_start("PositionLimits_HW.Active", False)
    restart(rig)
    assert engine.pending == ()
    assert monitor(rig).Done


BROKEN = {
    "there is no such data block": {"DbNumber": 8},
    "DB7 ends there": {"Offset": 128},
    "RID = 16#02000002": {"RID": 0x0200_0002},
    "Area = 16#81": {"Area": 0x81},
}


@pytest.mark.requirement("LIM-072", "MC-621")
@pytest.mark.parametrize("reason", [*BROKEN, "optimized"])
def test_an_address_that_leads_nowhere(make_rig, reason):
    """1000 = TRUE ends with 16#805B, and the monitoring stays off; 1000 = FALSE and other values of it are as
    always.
    """
    rig = wired(make_rig, optimized=reason == "optimized")
    for part, value in BROKEN.get(reason, {}).items():
        rig.axis.variables.write_start(PLACE.format("Max", part), value)
    restart(rig)
    assert reason in rig.axis.position.hardware.address_problem()
    assert (monitor(rig).Error, monitor(rig).ErrorID) == (True, 0x805B)
    assert rig.axis.var("PositionLimits_HW.Active") is False
    assert monitor(rig, False).Done
    assert monitor(rig, "on").ErrorID == 0x805C
    wrong = rig.axis.write_parameter(1001, True)
    rig.cycles(2)
    assert wrong.ErrorID == 0x805A


@pytest.mark.requirement("LIM-067", "LIM-070")
def test_power_off(make_rig):
    """The block begins at zero, the monitoring is off as configured, and can be switched on again."""
    rig = wired(make_rig)
    restart(rig)
    rig.block.set_bit(4, 1, True)
    monitor(rig)
    assert raised(rig) == [1]
    controller = rig.runtime.controller
    controller.power_off()
    rig.run(0.1)
    controller.power_on()
    rig.until(lambda: controller.state is OperatingState.RUN, 10.0)
    rig.run(0.1)
    assert not rig.block.bit(4, 1)
    assert rig.axis.var("PositionLimits_HW.Active") is False
    assert monitor(rig).Done
    assert raised(rig) == [1]


@pytest.mark.requirement("LIM-040")
def test_a_variable_needs_no_drive(make_rig):
    """The link to the drive is lost: its inputs say nothing, the variables do."""
    rig = wired(make_rig)
    restart(rig)
    monitor(rig)
    rig.port.link = False
    rig.run(0.1)
    rig.block.set_bit(4, 0, True)
    rig.cycles(2)
    assert raised(rig) == [2]


def test_data_blocks():
    """Numbers, sizes and bits are checked, with what is allowed."""
    blocks = DataBlocks()
    blocks.add(1, 4).set_bit(3, 7, True)
    assert blocks[1].data == b"\0\0\0\x80"
    for act, message in (
        (lambda: blocks.add(1, 4), "one that is not taken: 1"),
        (lambda: blocks[2], "allowed: 1"),
        (lambda: GlobalDataBlock(0, 4), "1 to 59999"),
        (lambda: GlobalDataBlock(3, 0), "1 to 65536 bytes"),
        (lambda: blocks[1].set_bit(4, 0, True), "byte 0 to 3, bit 0 to 7"),
        (lambda: BitAddress.of_bit(1, 0, 8), "0 to 7"),
        (lambda: BitAddress.of_bit(0, 0, 0), "1 to 59999"),
    ):
        with pytest.raises(ConfigurationError, match=message):
            act()
