"""The status double word bit by bit, `AXIS_REF`, axis states, blocks that read, and error codes."""

import pytest

from fieldbus.errors import ConfigurationError
from motion.drives.mark import IdealMarkSearch
from motion.nc.blocks import MC_Halt, MC_MoveAbsolute, MC_Power, MC_Reset, MC_Stop
from motion.nc.errors import error_codes
from motion.nc.interface import STATUS_BITS
from motion.nc.parameter_blocks import (
    AxisParameter,
    MC_ReadActualPosition,
    MC_ReadActualVelocity,
    MC_ReadAxisError,
    MC_ReadBoolParameter,
    MC_ReadParameter,
    MC_ReadParameterSet,
    MC_ReadStatus,
    MC_WriteBoolParameter,
    MC_WriteParameter,
)
from motion.nc.probe_blocks import MC_AbortTrigger
from motion.nc.touch_probe import ProbeSource
from testcases.unit.motion_nc.nc_rig import Plant, Rig

pytestmark = pytest.mark.exhaustive

_NAMES = {
    440: ("Operational", 0),
    441: ("Homed", 1),
    442: ("NotMoving", 2),
    443: ("InPositionArea", 3),
    444: ("InTargetPosition", 4),
    447: ("HasBeenStopped", 7),
    448: ("HasJob", 8),
    449: ("PositiveDirection", 9),
    450: ("NegativeDirection", 10),
    451: ("HomingBusy", 11),
    452: ("ConstantVelocity", 12),
    453: ("Compensating", 13),
    454: ("ExtSetPointGenEnabled", 14),
    456: ("ExternalLatchValid", 16),
    457: ("NewTargetPos", 17),
    459: ("ContinuousMotion", 19),
    460: ("ControlLoopClosed", 20),
    464: ("CmdBuffered", 24),
    466: ("SoftLimitMinExceeded", 26),
    467: ("SoftLimitMaxExceeded", 27),
    468: ("DriveDeviceError", 28),
    469: ("MotionCommandsLocked", 29),
    470: ("IoDataInvalid", 30),
    471: ("Error", 31),
}


class _Watch:
    """Looks which bits of the status double word have been seen TRUE and FALSE."""

    def __init__(self, rig):
        self.rig = rig

    def __call__(self, **expected):
        self.rig.cycles()
        self.rig.ref.ReadStatus()
        word = self.rig.ref.NcToPlc.StateDWord
        for name, value in expected.items():
            assert bool(word & STATUS_BITS[name]) is value, name
            assert getattr(self.rig.ref.Status, name) is value, name


@pytest.mark.requirement(*(f"NC-{row}" for row in _NAMES), "NC-429", "NC-474", "NC-009")
def test_status_bits():
    """Every bit has its place and its name, and shows its state and nothing else."""
    for name, bit in _NAMES.values():
        assert STATUS_BITS[name] == 1 << bit
    rig = Rig(axis__soft_limit_min=-100.0, axis__soft_limit_max=400.0)
    watch = _Watch(rig)
    watch(
        Operational=False,
        NotMoving=True,
        ControlLoopClosed=False,
        HasJob=False,
        Error=False,
        PTPmode=True,
        Homed=False,
        HasBeenStopped=False,
    )
    rig.enabled()
    watch(Operational=True, ControlLoopClosed=True, NotMoving=True, HasJob=False)
    move = rig.handle.move_absolute(300.0, Velocity=100.0)
    follow = rig.handle.move_absolute(350.0, Velocity=100.0, BufferMode=1)
    rig.cycles(1)
    watch(NewTargetPos=True, HasJob=True, NotMoving=False, PositiveDirection=True, CmdBuffered=True)
    watch(NewTargetPos=False, ConstantVelocity=False, ContinuousMotion=False, NegativeDirection=False)
    rig.cycles(400)
    watch(ConstantVelocity=True, InPositionArea=False, InTargetPosition=False)
    rig.until(move.done)
    watch(CmdBuffered=False, HasJob=True)
    rig.until(follow.done)
    watch(
        InPositionArea=True,
        InTargetPosition=True,
        HasJob=False,
        NotMoving=True,
        PositiveDirection=False,
        ConstantVelocity=False,
    )
    rig.handle.move_velocity(-50.0)
    rig.cycles(300)
    watch(ContinuousMotion=True, NegativeDirection=True, PositiveDirection=False, NewTargetPos=False)
    stop = rig.handle.stop()
    rig.cycles(2)
    watch(HasBeenStopped=True, MotionCommandsLocked=True, ContinuousMotion=False)
    rig.until(stop.done)
    stop.set(Execute=False)
    rig.cycles(2)
    watch(MotionCommandsLocked=False, HasBeenStopped=True, NotMoving=True)
    for side, name, by in (("min", "SoftLimitMinExceeded", 0.1), ("max", "SoftLimitMaxExceeded", -0.1)):
        watch(**{name: False})
        rig.handle.write_parameter(f"axis.soft_limit_{side}", rig.axis.position + by)
        watch(**{name: False})
        rig.handle.write_parameter(f"axis.soft_limit_{side}_enable", True)
        watch(**{name: True})
        rig.handle.write_parameter(f"axis.soft_limit_{side}_enable", False)
    rig.handle.home(5.0)
    rig.cycles(10)
    watch(HomingBusy=True, Homed=False)
    rig.until(rig.handle.stop().done)
    watch(HomingBusy=False, Homed=False)
    rig = Rig().enabled()
    watch = _Watch(rig)
    rig.handle.home(5.0, mode=1)
    rig.cycles()
    watch(Homed=True)
    rig.handle.external_enable(0.0)
    watch(ExtSetPointGenEnabled=False)
    watch(ExtSetPointGenEnabled=True)
    rig.handle.external_disable()
    rig.cycles(2)
    watch(ExtSetPointGenEnabled=False)
    sup = rig.handle.move_superimposed(1.0, 10.0)
    rig.cycles(2)
    watch(Compensating=True, NotMoving=False)
    rig.until(sup.done)
    watch(Compensating=False, NotMoving=True)
    rig.device.valid = False
    watch(IoDataInvalid=True, Error=False)
    rig.device.valid = True
    watch(IoDataInvalid=False)
    rig.device.fault = True
    watch(DriveDeviceError=True, Error=True, Operational=False, ControlLoopClosed=False)
    assert rig.ref.Status.ErrorID == 0x4650


@pytest.mark.requirement("NC-455", "NC-458")
def test_pending_mode_and_missed_target():
    """Bit 15: a requested mode is not confirmed yet; bit 18: the target was given up, until the next one."""
    rig = Rig().enabled()

    def bit(number):
        return bool(rig.axis.nc_to_plc.StateDWord & 1 << number)

    rig.ref.PlcToNc.AxisModeRequest = 7
    rig.cycles()
    seen = bit(15)
    rig.cycles()
    assert seen or bit(15)
    rig.cycles()
    assert not bit(15)
    assert rig.axis.nc_to_plc.AxisModeConfirmation == 7
    move = rig.handle.move_absolute(100.0, Velocity=50.0)
    rig.cycles(100)
    assert not bit(18)
    rig.until(rig.handle.halt().done)
    rig.cycles()
    assert move.CommandAborted
    assert bit(18)
    move = rig.handle.move_absolute(30.0, Velocity=50.0)
    rig.cycles(3)
    assert not bit(18)
    rig.until(move.done)
    assert not bit(18)
    rig.handle.move_velocity(20.0)
    rig.cycles(50)
    rig.until(rig.handle.halt().done)
    rig.cycles()
    assert not bit(18)


class _Latched(Plant):
    """A drive whose searches are passed by its shaft."""

    def __init__(self, scaling):
        super().__init__(scaling)
        self.searches = {
            source: IdealMarkSearch(*places)
            for source, places in ((1, (100_000, 200_000)), (2, (50_000,)), (3, (60_000,)))
        }

    def read(self):
        before = self.raw
        super().read()
        for search in self.searches.values():
            search.pass_by(before, self.raw)


@pytest.mark.requirement("NC-382", "NC-456")
def test_touch_probe():
    """The position of an edge is recorded, within a window if wanted; bit 16 shows it; the wait can be
    aborted.
    """
    rig = Rig(device=_Latched).enabled()
    probes = [rig.handle.touch_probe(source) for source in (ProbeSource.LATCH_POSITIVE,)]
    rig.cycles(2)
    assert probes[0].Busy
    assert not rig.status("ExternalLatchValid")
    rig.until(rig.handle.move_absolute(15.0, Velocity=33.0).done)
    assert probes[0].Done
    assert probes[0].RecordedPosition == pytest.approx(5.0)
    assert rig.status("ExternalLatchValid")
    probe = rig.handle.touch_probe(
        ProbeSource.ZERO_MARK, WindowOnly=True, FirstPosition=15.0, LastPosition=25.0
    )
    rig.cycles(2)
    assert not rig.status("ExternalLatchValid")
    rig.until(rig.handle.move_absolute(5.0, Velocity=33.0).done)
    assert probe.Busy  # the mark at 10 mm does not count
    rig.until(rig.handle.move_absolute(25.0, Velocity=33.0).done)
    assert probe.RecordedPosition == pytest.approx(20.0)
    assert rig.ref.NcToPlc.TouchProbeCounter == 2
    probe = rig.handle.touch_probe(ProbeSource.LATCH_NEGATIVE)
    rig.cycles(2)
    rig.handle.run(MC_AbortTrigger(rig.ref, Execute=True))
    rig.cycles(2)
    assert probe.CommandAborted
    refused = rig.handle.touch_probe(9)
    rig.cycles(2)
    assert refused.ErrorID == 0x4B06
    plain = Rig().enabled()
    refused = plain.handle.touch_probe()
    plain.cycles(2)
    assert refused.ErrorID == 0x4B04


@pytest.mark.requirement("NC-477", "NC-004")
def test_status_is_informative():
    """Blocks work though nobody calls ReadStatus, and Status stays as it was; PosDiff is set minus actual."""
    rig = Rig(ctrl__velocity_precontrol_weight=0.5).enabled()
    rig.until(rig.handle.move_absolute(20.0, Velocity=100.0).done)
    assert rig.ref.Status.StateDWord == 0
    rig.handle.move_velocity(100.0)
    rig.cycles(300)
    image = rig.ref.NcToPlc
    assert image.PosDiff > 1.0
    assert image.PosDiff == pytest.approx(image.SetPos - image.ActPos)
    rig.handle.move_velocity(-100.0)
    rig.cycles(600)
    assert rig.ref.NcToPlc.PosDiff < -1.0


@pytest.mark.requirement("NC-727", "NC-725", "NC-726", "NC-733", "NC-752")
def test_outputs_of_blocks():
    """The blocks have Done or Status, Busy, Active, Error and ErrorID, and all but Power and Reset
    CommandAborted; a reset clears the error.
    """
    rig = Rig().enabled()
    for block, done, aborts in (
        (MC_Power, "Status", False),
        (MC_Reset, "Done", True),
        (MC_Stop, "Done", True),
        (MC_Halt, "Done", True),
        (MC_MoveAbsolute, "Done", True),
    ):
        one = block(rig.ref)
        for name in (done, "Busy", "Error", "ErrorID"):
            assert getattr(one, name) in (False, 0)
        if aborts:
            assert one.Active is False
    move = rig.handle.move_absolute(50.0, Velocity=80.0, BufferMode=1)
    rig.cycles(2)
    assert (move.Busy, move.Active, move.Done, move.Error) == (True, True, False, False)
    rig.axis.raise_error(0x4550)
    rig.cycles(2)
    assert (move.Busy, move.Active, move.Error, move.ErrorID) == (False, False, True, 0x4550)
    reset = rig.handle.reset()
    rig.until(reset.done)
    assert rig.handle.error_id == 0
    for code in range(0x4B00, 0x4B08):
        assert error_codes()[code].reaction == "block"


@pytest.mark.requirement("NC-737")
def test_movement_below_an_increment():
    """A way smaller than an encoder increment is 0x435A, one of an increment is moved, 0 is done at once."""
    rig = Rig().enabled()
    refused = rig.handle.move_relative(0.00009, Velocity=10.0)
    rig.cycles(2)
    assert refused.ErrorID == 0x435A
    for way in (0.0001, -0.0001, 0.0):
        rig.until(rig.handle.move_relative(way, Velocity=10.0).done)


@pytest.mark.requirement("NC-740", "NC-748", "NC-744")
def test_further_codes():
    """0x42E2 and 0x42E3 of external setpoints; 0x4462 and 0x4463 when the set position passes a limit."""
    rig = Rig().enabled()
    refused = rig.handle.external_disable()
    rig.cycles(2)
    assert refused.ErrorID == 0x42E3
    rig.handle.external_enable(0.0)
    rig.cycles(2)
    refused = rig.handle.move_absolute(5.0, Velocity=10.0)
    rig.cycles(2)
    assert refused.ErrorID == 0x42E2
    for side, sign, code in (("min", -1.0, 0x4462), ("max", 1.0, 0x4463)):
        rig = Rig(**{f"axis__soft_limit_{side}": sign * 500.0}).enabled()
        rig.handle.write_parameter(f"axis.soft_limit_{side}_enable", True)
        rig.handle.move_absolute(sign * 400.0, Velocity=100.0)
        rig.cycles(300)
        rig.handle.write_parameter(f"axis.soft_limit_{side}", sign * 1.0)
        rig.cycles(3)
        assert rig.handle.error_id == code
        assert rig.device.velocity == 0.0
        assert rig.status("Error")
    master = Rig()
    slave = Rig(
        with_=master,
        axis__couple_slave_to_actual=True,
        axis__position_lag_monitoring=False,
    ).enabled()
    master.enabled()
    slave.handle.gear_in(master.handle, 1.0)
    master.cycles(2)
    master.handle.power(False)
    master.cycles(2)
    slave.device.frozen = True
    for _ in range(40):
        master.device.position += 0.2
        master.cycles()
    assert slave.handle.error_id == 0x4551


@pytest.mark.requirement("NC-149")
def test_pushed_at_standstill():
    """An axis that is pushed away while it stands is shut down like a moving one."""
    rig = Rig(ctrl__pos_kv=0.0).enabled()
    rig.until(rig.handle.move_absolute(20.0, Velocity=100.0).done)
    rig.device.position += 5.5
    rig.cycles(10)
    assert rig.handle.error_id == 0
    rig.cycles(2)
    assert rig.handle.error_id == 0x4550


@pytest.mark.requirement("NC-147")
def test_magnitude_of_the_lag(subtests):
    """The lag is set minus actual position; its magnitude counts, for a time above the filter time."""
    for push in (5.2, -5.2):
        for hold, code in ((10, 0), (12, 0x4550)):
            with subtests.test(push=push, hold=hold):
                rig = Rig(ctrl__pos_kv=0.0).enabled()
                rig.device.position = push
                rig.cycles(2)
                assert rig.axis.following_error == pytest.approx(-push)
                rig.cycles(hold - 2)
                rig.device.position = 0.0
                rig.cycles(5)
                assert rig.handle.error_id == code


# -- parameter blocks


def test_parameter_blocks():
    """Parameters are read and written by number; flags and numbers have blocks of their own; a refused value
    leaves the parameter as it is.
    """
    rig = Rig().enabled()
    run = rig.handle.run
    values = {
        AxisParameter.SWLimitPos: "axis.soft_limit_max",
        AxisParameter.SWLimitNeg: "axis.soft_limit_min",
        AxisParameter.MaxPositionLag: "axis.position_lag_max",
        AxisParameter.MaxVelocityAppl: "axis.maximum_velocity",
        AxisParameter.MaxVelocitySystem: "axis.reference_velocity",
        AxisParameter.MaxAccelerationAppl: "axis.default_acceleration",
        AxisParameter.MaxDecelerationSystem: "axis.maximum_deceleration",
    }
    for number, key in values.items():
        read = run(MC_ReadParameter(rig.ref, Enable=True, ParameterNumber=number))
        write = run(
            MC_WriteParameter(
                rig.ref, Execute=True, ParameterNumber=number, Value=rig.handle.read_parameter(key) + 1.0
            )
        )
        before = rig.handle.read_parameter(key)
        rig.cycles(2)
        assert write.Done
        assert rig.handle.read_parameter(key) == read.Value == before + 1.0
    flag = run(MC_ReadBoolParameter(rig.ref, Enable=True, ParameterNumber=AxisParameter.EnableLimitPos))
    run(
        MC_WriteBoolParameter(
            rig.ref, Execute=True, ParameterNumber=AxisParameter.EnablePosLagMonitoring, Value=False
        )
    )
    rig.cycles(2)
    assert flag.Valid
    assert flag.Value is False
    assert rig.handle.read_parameter("axis.position_lag_monitoring") is False
    for block in (
        MC_WriteParameter(rig.ref, Execute=True, ParameterNumber=AxisParameter.MaxVelocityAppl, Value=-1.0),
        MC_WriteParameter(rig.ref, Execute=True, ParameterNumber=AxisParameter.EnableLimitPos, Value=1.0),
        MC_WriteBoolParameter(rig.ref, Execute=True, ParameterNumber=AxisParameter.SWLimitPos, Value=True),
        MC_WriteParameter(rig.ref, Execute=True, ParameterNumber=AxisParameter.ActualVelocity, Value=1.0),
        MC_ReadParameter(rig.ref, Enable=True, ParameterNumber=AxisParameter.EnableLimitPos),
        MC_ReadBoolParameter(rig.ref, Enable=True, ParameterNumber=4711),
    ):
        run(block)
        rig.cycles(2)
        assert block.ErrorID == 0x4B06, block
    assert rig.handle.read_parameter("axis.maximum_velocity") == 2001.0
    every = run(MC_ReadParameterSet(rig.ref, Enable=True))
    rig.cycles(2)
    assert every.Parameter["ctrl.pos_kv"] == 20.0
    assert len(every.Parameter) == 168


def test_reading_blocks():
    """Position, velocity and error are those of the last transfer; MC_ReadStatus has one state at a time."""
    rig = Rig()
    run = rig.handle.run
    position, velocity = (
        run(block(rig.ref, Enable=True)) for block in (MC_ReadActualPosition, MC_ReadActualVelocity)
    )
    error, status = run(MC_ReadAxisError(rig.ref, Enable=True)), run(MC_ReadStatus(rig.ref, Enable=True))
    names = (
        "ErrorStop", "Disabled", "Stopping", "StandStill", "DiscreteMotion", "ContinuousMotion",
        "SynchronizedMotion", "Homing",
    )  # fmt: skip

    def state():
        rig.cycles(2)
        found = [name for name in names if getattr(status, name)]
        assert len(found) == 1, found
        return found[0]

    assert state() == "Disabled"
    rig.enabled()
    assert state() == "StandStill"
    rig.handle.move_absolute(500.0, Velocity=100.0)
    assert state() == "DiscreteMotion"
    assert status.Accelerating
    rig.cycles(300)
    assert velocity.ActualVelocity == pytest.approx(100.0, rel=0.01)
    assert position.Position == rig.ref.NcToPlc.ActPos
    assert status.ConstantVelocity
    rig.handle.move_velocity(50.0)
    assert state() == "ContinuousMotion"
    stop = rig.handle.stop()
    assert state() == "Stopping"
    rig.until(stop.done)
    stop.set(Execute=False)
    assert state() == "StandStill"
    rig.handle.home()
    rig.cycles(10)
    assert state() == "Homing"
    rig.axis.raise_error(0x4464)
    assert state() == "ErrorStop"
    assert error.AxisErrorID == 0x4464
    with pytest.raises(ConfigurationError, match="Enable"):
        MC_ReadStatus(rig.ref, Enabled=True)
