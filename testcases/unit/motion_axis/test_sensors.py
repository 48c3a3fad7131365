"""`MC_SetSensor`: the encoder in position control, positions that are taken along, steps that are
smoothed.
"""

from __future__ import annotations

import pytest

from fieldbus.errors import ConfigurationError
from motion.drives.encoder import EncoderPort
from motion.drives.simulated import SimulatedDrivePort
from motion.s7.axis import PositioningAxis
from motion.s7.instructions import MC_SetSensor
from testcases.rigs import ControllerRig
from testcases.unit.motion_axis.conftest import REFERENCE

MS = 1_000_000
FULL = 131072


class Coupled(EncoderPort):
    """An encoder on the shaft of the motor, by a given number of increments ahead of it."""

    __slots__ = ("_motor", "ahead", "dead")

    def __init__(self, motor, ahead=0):
        super().__init__()
        self._motor = motor
        self.ahead = ahead
        self.dead = False
        self.link_ok = True

    def read(self):
        self.link_ok = not self.dead
        self.encoder_increments = self._motor.encoder_increments + self.ahead


@pytest.mark.exhaustive
@pytest.mark.requirement("DIA-036", "DIA-095")
def test_the_page_shows_the_operative_encoder():
    """Its number changes with `MC_SetSensor`; the diagnosis lists it among the values."""
    rig = Rig()
    rig.axis.power()
    rig.cycles(20)
    shown = []
    for sensor in (1, 2, 1):
        rig.axis.set_sensor(sensor)
        rig.cycles(3)
        shown.append(
            (rig.axis.var("OperativeSensor"), rig.axis.diagnosis().pages["values"]["operative encoder"])
        )
    assert shown == [(1, 1), (2, 2), (1, 1)]


class Rig(ControllerRig):
    """An axis with the motor encoder and one or two more on the same shaft."""

    def __init__(self, *, ahead=(0.4,), types=(0, 1), **variables):
        super().__init__()
        self.port = SimulatedDrivePort(cycle_s=0.004)
        self.others = [Coupled(self.port, round(mm / 10.0 * FULL)) for mm in ahead]
        settings = dict(REFERENCE)
        for number, kind in enumerate(types, start=1):
            settings[f"Sensor[{number}].Type"] = kind
            settings[f"Sensor[{number}].Parameter.StepsPerRevolution"] = FULL
            settings[f"Sensor[{number}].Parameter.FineResolutionXist1"] = 0
        settings |= {path.replace("__", "."): value for path, value in variables.items()}
        axis = PositioningAxis(
            "axis1",
            self.port,
            cycle_ns=4 * MS,
            history=self.history,
            variables=settings,
            delay_s=0.004,
            encoders=[self.port, *self.others],
        )
        self.control_axis(axis)
        self.runtime.start()
        self.cycles(3)

    def enabled(self):
        self.until(self.axis.power().status)
        return self

    def shown(self, number):
        return self.axis.var(f"StatusSensor[{number}].Position")

    def switch(self, sensor, mode=0, reference=1):
        job = self.axis.set_sensor(sensor, mode=mode, reference=reference)
        self.until(job.ended)
        return job


class TestModes:
    """What becomes of the position."""

    @pytest.mark.requirement("CFG-330", "CFG-325", "MC-385", "CFG-321", "VAR-202", "CFG-314")
    def test_switch_with_the_position(self):
        """Encoder 1 shows 100.0, encoder 2 100.4: mode 0 leaves 100.0 where it is, and nothing moves."""
        rig = Rig().enabled()
        rig.until(rig.axis.home(100.0).done)
        rig.axis.object.sensors[1].transfer(100.4)
        rig.cycles(2)
        assert (rig.shown(1), rig.shown(2)) == (pytest.approx(100.0), pytest.approx(100.4))
        before = rig.port.encoder_increments
        assert rig.switch(2).Done
        rig.cycles(100)
        assert rig.axis.var("ActualPosition") == pytest.approx(100.0)
        assert rig.shown(2) == pytest.approx(100.0)
        assert rig.port.encoder_increments == before
        assert (rig.axis.var("OperativeSensor"), rig.axis.var("StatusSensor[2].Control")) == (2, True)
        assert rig.axis.var("StatusWord.X5") is True

    @pytest.mark.requirement("CFG-330", "CFG-326", "MC-386")
    def test_switch_as_it_is(self):
        """Mode 1: the actual position steps to 100.4, and the axis moves back to 100.0."""
        rig = Rig().enabled()
        rig.until(rig.axis.home(100.0).done)
        rig.axis.object.sensors[1].transfer(100.4)
        before = rig.port.encoder_increments
        rig.switch(2, mode=1)
        rig.cycles(1)
        assert rig.axis.var("ActualPosition") == pytest.approx(100.4, abs=0.05)
        rig.cycles(250)
        assert rig.axis.var("ActualPosition") == pytest.approx(100.0, abs=0.001)
        assert rig.port.encoder_increments - before == pytest.approx(-0.04 * FULL, abs=20)

    @pytest.mark.requirement("CFG-329", "VAR-181", "MC-386")
    def test_smoothing(self):
        """With a time constant of 0.1 s the step reaches the speed setpoint slowly; without one at once."""
        fastest = []
        for constant in (0.0, 0.1):
            rig = Rig(PositionControl__SmoothingTimeByChangeDifference=constant).enabled()
            rig.until(rig.axis.home(100.0).done)
            rig.axis.object.sensors[1].transfer(100.4)
            speeds = []
            rig.runtime.after_cycle.append(
                lambda rig=rig, speeds=speeds: speeds.append(abs(rig.axis.speed_output_rpm))
            )
            rig.switch(2, mode=1)
            rig.cycles(400)
            fastest.append(max(speeds))
            assert rig.axis.var("ActualPosition") == pytest.approx(100.0, abs=0.002)
        assert fastest[0] == pytest.approx(20.0 * 0.4 * 6.0, rel=0.05)
        assert fastest[1] < 0.3 * fastest[0]

    @pytest.mark.requirement("CFG-327", "CFG-331", "MC-387")
    def test_transfer_then_switch(self):
        """Mode 2 switches nothing; mode 1 afterwards makes no step."""
        rig = Rig().enabled()
        rig.until(rig.axis.home(60.0).done)
        rig.switch(2, mode=2)
        assert (rig.axis.var("OperativeSensor"), rig.shown(2)) == (1, pytest.approx(60.0))
        rig.switch(2, mode=1)
        rig.cycles(1)
        assert rig.axis.var("ActualPosition") == pytest.approx(60.0)
        assert rig.axis.var("OperativeSensor") == 2

    @pytest.mark.requirement("CFG-328", "CFG-324", "MC-388", "MC-382")
    def test_transfer_from_another(self):
        """Mode 3 gives encoder 2 the position of encoder 3."""
        rig = Rig(ahead=(0.4, 7.0), types=(0, 0, 1))
        rig.switch(2, mode=3, reference=3)
        assert rig.shown(2) == pytest.approx(rig.shown(3), abs=0.001)
        assert rig.shown(2) == pytest.approx(7.0, abs=0.001)
        assert rig.axis.var("OperativeSensor") == 1

    @pytest.mark.requirement("CFG-332", "CFG-333", "MC-389")
    def test_correction_of_an_absolute_encoder(self):
        """What was transferred to an absolute encoder is discarded when it is left: 110.0 again, the offset
        untouched.
        """
        rig = Rig(ahead=(50.0,)).enabled()
        rig.until(rig.axis.home(60.0).done)
        assert rig.shown(2) == pytest.approx(110.0, abs=0.001)
        rig.switch(2, mode=2)
        assert rig.shown(2) == pytest.approx(60.0)
        rig.switch(2, mode=1)
        rig.switch(1, mode=1)
        assert rig.shown(2) == pytest.approx(110.0, abs=0.001)
        assert rig.axis.var("StatusSensor[2].AbsEncoderOffset") == 0.0


class TestConditions:
    """When it is possible, and what it answers otherwise."""

    @pytest.mark.requirement("OVR-106", "CFG-322", "CFG-617", "MC-377", "MC-392")
    def test_disabled_and_in_motion(self):
        """It works on a disabled axis and in motion, where the running job goes on."""
        rig = Rig()
        assert rig.switch(2).Done
        rig.enabled()
        move = rig.axis.move_velocity(50.0)
        rig.until(move.in_velocity)
        assert rig.switch(1).Done
        rig.cycles(20)
        assert move.in_velocity()
        assert rig.axis.var("ErrorWord") == 0

    @pytest.mark.requirement("CFG-323", "CFG-617", "MC-376")
    def test_restart_active(self):
        """While the object restarts it is refused with 16#800D."""
        rig = Rig()
        rig.axis.reset(restart=True)
        rig.cycles(2)
        assert rig.switch(2).ErrorID == 0x800D

    @pytest.mark.requirement("MC-380", "MC-381", "MC-382", "MC-391")
    @pytest.mark.parametrize(
        ("sensor", "mode", "reference", "error"),
        [(0, 0, 1, 0x8050), (5, 0, 1, 0x8050), (3, 0, 1, 0x8050), (2, 4, 1, 0x800A), (2, 3, 4, 0x8051)],
    )
    def test_inputs(self, sensor, mode, reference, error):
        """Encoders that do not exist and modes that there are not."""
        assert Rig().switch(sensor, mode, reference).ErrorID == error

    @pytest.mark.requirement("MC-391")
    def test_target_not_valid(self):
        """An encoder without a valid value is not switched to; the old one stays."""
        rig = Rig().enabled()
        rig.others[0].dead = True
        rig.cycles(2)
        assert rig.switch(2).ErrorID == 0x8016
        assert rig.axis.var("OperativeSensor") == 1

    @pytest.mark.requirement("CFG-062")
    def test_needs_the_t(self):
        """An S7-1500 without T has no such instruction."""
        axis = PositioningAxis("a", SimulatedDrivePort(cycle_s=0.001), cycle_ns=MS, cpu="S7-1500")
        with pytest.raises(ConfigurationError, match="cpu S7-1500T"):
            MC_SetSensor(axis)

    @pytest.mark.requirement("CFG-316", "VAR-182")
    def test_encoder_at_power_on(self):
        """`InitialOperativeSensor` controls after the start and after every restart."""
        rig = Rig(PositionControl__InitialOperativeSensor=2)
        assert rig.axis.var("OperativeSensor") == 2
        rig.switch(1)
        assert rig.axis.var("OperativeSensor") == 1
        rig.until(rig.axis.reset(restart=True).done)
        assert rig.axis.var("OperativeSensor") == 2

    @pytest.mark.requirement("CFG-320")
    def test_homing_takes_the_operative_one(self):
        """Adjusting an incremental encoder without a number sets the one in control and leaves the other one
        alone.
        """
        rig = Rig(types=(0, 0))
        rig.switch(2)
        rig.until(rig.axis.home(33.0, mode=13).done)
        rig.cycles(1)
        assert (rig.shown(1), rig.shown(2)) == (pytest.approx(0.0), pytest.approx(33.0))

    @pytest.mark.requirement("CFG-334", "CFG-160")
    def test_simulated(self):
        """All encoders of a simulated axis are simulated."""
        rig = Rig(Simulation__Mode=1, ahead=(0.0,), types=(0, 0)).enabled()
        rig.until(rig.axis.move_relative(20.0).done)
        assert (rig.shown(1), rig.shown(2)) == (pytest.approx(20.0, abs=0.01), pytest.approx(20.0, abs=0.01))

    @pytest.mark.requirement("CFG-384", "CFG-380", "VAR-183")
    def test_quantum_of_the_encoder(self):
        """The quantum of the control difference is the resolution of whichever encoder controls."""
        rig = Rig(PositionControl__ControlDifferenceQuantization__Mode=1, types=(0, 0))
        rig.axis.variables.write_start("Sensor[2].Parameter.StepsPerRevolution", 1000)
        rig.until(rig.axis.reset(restart=True).done)
        rig.cycles(2)
        assert rig.axis.servo.controller.quantum == pytest.approx(10.0 / FULL)
        rig.switch(2)
        assert rig.axis.servo.controller.quantum == pytest.approx(0.01)
