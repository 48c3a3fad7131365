"""An axis on a drive with an analog setpoint: enabling, the four ways to disable, alarms, what is not
wired.
"""

from __future__ import annotations

import itertools
from dataclasses import fields

import pytest

from emulators.drive.analog import AnalogDrive, AnalogState
from emulators.drive.analog_config import AnalogConfig, AnalogSettings
from emulators.drive.machine import NO_SWITCHES, EncoderConfig, LinearAxisConfig
from emulators.io import AnalogOutput, CounterInput, DigitalInput, DigitalOutput, ModbusIoStation
from fieldbus.clock import MS, S
from fieldbus.errors import ConfigurationError
from fieldbus.modbus import TcpClient, TcpLink, TcpStation
from motion.drives.analog import AnalogPort, AnalogPortConfig
from motion.drives.station import StationInputs, StationLink
from motion.s7.axis import PositioningAxis, SpeedAxis
from testcases.rigs import ControllerRig
from testcases.unit.motion_axis.conftest import REFERENCE, SPEED

CYCLE_NS = 4 * MS
INCREMENTS = 131072
SETTINGS = frozenset(one.name for one in fields(AnalogSettings))


class Rig(ControllerRig):
    """One axis, a station behind TCP, an analog drive at its terminals."""

    def __init__(self, *, speed=False, enable=True, ready=True, variables=None, **drive):
        super().__init__()
        scheduler = self.scheduler
        settings = {key: drive.pop(key) for key in SETTINGS & set(drive)}
        drive.setdefault("switches", NO_SWITCHES)
        drive.setdefault("mechanics", LinearAxisConfig(negative_stop_mm=None, positive_stop_mm=None))
        self.drive = AnalogDrive(
            scheduler,
            AnalogConfig(
                analog=AnalogSettings(**settings),
                encoder=EncoderConfig(counts_per_revolution=INCREMENTS),
                **drive,
            ),
            name="drive1",
            history=self.history,
        )
        ready_input = DigitalInput(scheduler, filter_ms=0.0)
        self.drive.on_ready.append(ready_input.set)
        self.station = ModbusIoStation(
            scheduler,
            digital_inputs=[ready_input, DigitalInput(scheduler, 0.0), DigitalInput(scheduler, 0.0)],
            digital_outputs=[DigitalOutput(self.drive.set_enable)],
            analog_outputs=[AnalogOutput(on_change=self.drive.set_voltage)],
            counters=[CounterInput(lambda: self.drive.encoder.increments)],
            watchdog_ms=20.0,
            name="io",
            history=self.history,
        )
        self.net = TcpLink(scheduler)
        TcpStation(scheduler, self.net, self.station.server)
        client = TcpClient(
            scheduler, lambda handler: self.net.connect("plc", handler), timeout_ns=20 * MS, retries=0
        )
        self.link = StationLink(client, self.station.image, name="io", history=self.history)
        config = AnalogPortConfig(
            cycle_ns=CYCLE_NS,
            enable=0 if enable else None,
            ready=0 if ready else None,
            counter=None if speed else 0,
        )
        self.port = AnalogPort(self.link, config, name="drive1", history=self.history)
        kind, start = (SpeedAxis, SPEED) if speed else (PositioningAxis, REFERENCE)
        constant = (
            {}
            if speed
            else {"DynamicAxisModel.VelocityTimeConstant": 0.002, "PositionLimits_HW.Active": True}
        )
        self.technology = kind(
            "axis1",
            self.port,
            cycle_ns=CYCLE_NS,
            variables=start | constant | (variables or {}),
            history=self.history,
            delay_s=0.006,
        )
        if not speed:
            self.technology.station_inputs = StationInputs(
                self.link, {"negative_limit": 1, "positive_limit": 2}
            )
        self.control_axis(self.technology)
        self.runtime.after_cycle.append(self.link.exchange)
        self.rows = []
        self.runtime.after_cycle.append(self._note)
        self.drive.power_on()
        self.runtime.start()
        self.run(0.1)

    def _note(self):
        axis = self.technology
        self.rows.append(
            (
                self.scheduler.now / S,
                self.drive.voltage,
                self.drive.enabled,
                self.drive.ready,
                axis.states.facts.enabled,
                axis.in_operation,
                axis.motion.gen.v,
                axis.enabling.busy,
            )
        )

    def travelling(self, velocity=300.0):
        self.power = self.axis.power()
        self.until(self.power.status)
        self.job = self.axis.move_velocity(velocity, Deceleration=1000.0, Jerk=10000.0)
        self.until(self.job.in_velocity)
        self.run(0.1)
        self.rows.clear()
        self.start = self.scheduler.now / S
        return self

    @property
    def mm_s(self):
        return self.drive.mechanics.velocity * 1000.0

    def first(self, predicate):
        """Return the time since `start` of the first row for which something holds."""
        return next(row[0] for row in self.rows if predicate(row)) - self.start


@pytest.mark.requirement("STP-059", "STP-060", "CFG-391", "MC-143", "VAR-138")
def test_enabling_waits_for_the_ready_signal():
    """Enable sets the output; Status and InOperation come with the ready signal, and only then a setpoint."""
    rig = Rig(ready_delay_ms=200.0)
    rig.rows.clear()
    power = rig.axis.power()
    rig.run(0.1)
    assert rig.drive.enabled
    assert not power.Status
    assert power.Busy
    assert not rig.axis.var("StatusDrive.InOperation")
    assert rig.drive.voltage == 0.0
    rig.run(0.15)
    assert power.Status
    assert rig.axis.var("StatusDrive.InOperation")
    job = rig.axis.move_velocity(100.0)
    rig.until(job.in_velocity)
    rig.run(0.1)
    assert rig.drive.voltage == pytest.approx(2.0, abs=0.05)
    assert rig.axis.var("ActualSpeed") == 0.0


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-060", "CFG-391")
def test_without_the_ready_signal_the_axis_stays_disabled():
    """With the ready input active and no signal the axis is never enabled."""
    rig = Rig()
    rig.drive.force_ready(False)
    power = rig.axis.power()
    rig.run(3.0)
    assert rig.drive.enabled
    assert (power.Status, power.Busy, power.Error) == (False, True, False)


@pytest.mark.requirement("STP-061", "CFG-390", "STP-058")
@pytest.mark.parametrize(("enable", "ready"), [(True, False), (False, False), (False, True)])
def test_terminals_are_independent(enable, ready):
    """Without a ready input Status comes with the enable; without an enable output the drive has to be on by
    itself.
    """
    rig = Rig(enable=enable, ready=ready, enable_input=enable)
    power = rig.axis.power()
    rig.run(0.05)
    assert power.Status
    assert rig.drive.enabled is enable
    rig.axis.move_velocity(100.0)
    rig.run(1.0)
    assert rig.mm_s == pytest.approx(100.0, abs=0.5)


@pytest.mark.requirement("CFG-395", "CFG-396", "CFG-397", "VAR-130", "CFG-386", "CFG-394")
@pytest.mark.parametrize(
    ("rpm", "word"), [(1500.0, 13824), (-3000.0, -27648), (3510.0, 32348), (4000.0, 32348), (-4000.0, -32348)]
)
def test_scaling(rpm, word):
    """100 % is the reference speed and 27648; the output is limited to 117 %."""
    rig = Rig(ready=False)
    rig.runtime.stop()
    rig.port.write(0x047F, 0.0)
    rig.port.read()
    rig.port.write(0x047F, rpm)
    rig.link.exchange()
    rig.run(0.01)
    assert rig.station.analog_output(0).word == word
    assert rig.drive.voltage == pytest.approx(word / 2764.8)


@pytest.mark.exhaustive
def test_position_control():
    """A positioning ends in its window; what it follows behind is the time constant of the drive times the
    velocity.
    """
    rig = Rig()
    power = rig.axis.power()
    rig.until(power.status)
    job = rig.axis.move_relative(200.0, Velocity=300.0)
    errors = []
    rig.runtime.after_cycle.append(
        lambda: errors.append(abs(rig.technology.servo.controller.following_error))
    )
    rig.until(job.done, 5.0)
    assert rig.drive.mechanics.position * 1000.0 == pytest.approx(200.0, abs=0.1)
    assert max(errors) == pytest.approx(300.0 * 0.002, abs=0.05)
    rig.run(0.5)
    assert rig.drive.mechanics.position * 1000.0 == pytest.approx(200.0, abs=0.02)


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-297", "STP-308", "STP-309", "STP-310", "STP-330", "MC-153", "CFG-393")
@pytest.mark.parametrize("falls", ["enable", "standstill", "never"])
@pytest.mark.parametrize(("mode", "ramp_s"), [(0, 0.075), (2, 0.25)])
def test_disabling_with_a_ramp(mode, ramp_s, falls):
    """The analog output follows the ramp with the enable set; at setpoint zero the enable falls, then Status,
    whatever ready does.
    """
    rig = Rig(ready_falls=falls).travelling()
    rig.axis.power(False, stop_mode=mode)
    rig.run(0.6)
    enable_falls = rig.first(lambda row: not row[2])
    assert enable_falls == pytest.approx(ramp_s, abs=0.013)
    on_the_ramp = [row for row in rig.rows if row[2]]
    assert all(row[4] for row in on_the_ramp)
    assert all(later[1] <= earlier[1] + 0.2 for earlier, later in itertools.pairwise(on_the_ramp))
    assert on_the_ramp[-1][1] == pytest.approx(0.0, abs=0.35)
    assert rig.first(lambda row: not row[4]) >= enable_falls - 0.005
    assert rig.first(lambda row: not row[7]) <= enable_falls + 0.017
    assert rig.job.CommandAborted
    assert rig.mm_s == 0.0
    assert rig.drive.ready is (falls == "never")


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-321", "STP-322", "STP-323")
@pytest.mark.parametrize("falls", ["enable", "standstill", "never"])
@pytest.mark.parametrize("ramp_s", [0.5, 0.25])
def test_quick_stop(ramp_s, falls):
    """Output 0.0 and enable FALSE at once, the drive brakes on its own ramp, Status falls when the axis
    stands.
    """
    rig = Rig(off3_ramp_s=ramp_s, ready_falls=falls).travelling()
    rig.axis.power(False, stop_mode=1)
    rig.run(1.0)
    assert rig.first(lambda row: not row[2]) < 0.013
    assert rig.first(lambda row: row[1] == 0.0) < 0.013
    braking = 0.6 * ramp_s
    assert rig.first(lambda row: not row[4]) == pytest.approx(braking, abs=0.03)
    assert rig.first(lambda row: not row[7]) == pytest.approx(braking, abs=0.03)
    assert rig.job.CommandAborted
    assert rig.mm_s == 0.0


@pytest.mark.requirement("STP-332", "STP-341", "MC-151")
def test_coasting():
    """Enable and output fall at once, Status in the next cycles, while the axis still turns."""
    rig = Rig(stop="coast").travelling()
    rig.axis.power(False, stop_mode=3)
    rig.run(0.1)
    assert rig.first(lambda row: not row[2]) < 0.013
    assert rig.first(lambda row: row[1] == 0.0) < 0.013
    assert rig.first(lambda row: not row[4]) < 0.017
    assert 150.0 < rig.mm_s < 300.0
    assert rig.job.CommandAborted


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-377", "STP-378", "STP-379", "STP-380")
@pytest.mark.parametrize("falls", ["enable", "never"])
@pytest.mark.parametrize("reaction", [1, 3, 5, 7])
def test_remove_enable(reaction, falls):
    """Reaction 4: output 0.0, enable FALSE, Status FALSE, Busy TRUE; the drive's ramp whatever
    `RemoveEnableReaction`; acknowledged, it starts again.
    """
    rig = Rig(ready_falls=falls, variables={"Actor.RemoveEnableReaction": reaction}).travelling()
    rig.axis.alarms.raise_alarm(521, reaction=4)
    rig.run(0.05)
    assert (rig.drive.enabled, rig.drive.voltage) == (False, 0.0)
    assert (rig.power.Status, rig.power.Busy) == (False, True)
    assert rig.axis.var("ErrorDetail.Reaction") == 4
    assert rig.drive.state is AnalogState.STOPPING
    rig.run(1.0)
    assert rig.mm_s == 0.0
    assert rig.power.Busy
    rig.axis.reset()
    rig.run(0.1)
    assert rig.drive.enabled
    assert rig.power.Status


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-398", "STP-399", "STP-401")
def test_alarm_ramp():
    """Reaction 3: the output follows the ramp with the enable set; at zero the enable falls, Status FALSE,
    Busy TRUE.
    """
    rig = Rig().travelling()
    rig.axis.alarms.raise_alarm(304, reaction=3)
    rig.run(0.5)
    assert rig.first(lambda row: not row[2]) == pytest.approx(0.075, abs=0.013)
    assert rig.first(lambda row: not row[4]) == pytest.approx(0.08, abs=0.02)
    assert (rig.power.Status, rig.power.Busy) == (False, True)
    rig.axis.reset()
    rig.run(0.1)
    assert rig.power.Status


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-562", "CFG-392", "CFG-608", "STP-060")
def test_ready_is_lost():
    """An enabled axis whose ready signal disappears is disabled with alarm 421 and reaction 4."""
    rig = Rig().travelling()
    rig.drive.force_ready(False)
    rig.run(0.05)
    assert rig.axis.var("ErrorDetail.Number") == 421
    assert rig.axis.var("ErrorDetail.Reaction") == 4
    assert rig.axis.var("ErrorWord.X4")
    assert not rig.drive.enabled
    rig.run(1.0)
    assert rig.mm_s == 0.0


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-563", "CFG-393")
def test_ready_that_never_falls_does_not_hold_up():
    """Disabling is complete although the ready signal stays."""
    rig = Rig(ready_falls="never").travelling()
    rig.axis.power(False)
    rig.run(0.5)
    assert rig.drive.ready
    assert not rig.axis.var("StatusWord.X0")
    assert (rig.power.Status, rig.power.Busy) == (False, False)


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-062", "CFG-388", "CFG-609", "CFG-387")
def test_without_an_enable_output_the_drive_goes_on():
    """No enable output: after a coast the drive is not disabled; it holds the voltage, which is 0, with its
    torque.
    """
    rig = Rig(enable=False, ready=False, enable_input=False, offset_v=0.02).travelling()
    rig.axis.alarms.raise_alarm(521, reaction=4)
    rig.run(1.0)
    assert not rig.power.Status
    assert rig.drive.state is AnalogState.OPERATION
    assert rig.drive.core.enabled
    assert rig.mm_s == pytest.approx(1.0, abs=0.05)  # the drift goes on


def test_limit_switches_at_the_station():
    """Switches of the station are those of the axis: the positive one stops it with alarm 531, a lost station
    reads 0.
    """
    rig = Rig().travelling()
    rig.station.input(2).set(True)
    rig.run(0.05)
    assert rig.axis.var("ErrorDetail.Number") == 531
    assert rig.axis.var("StatusWord.X18")
    rig.station.input(2).set(False)
    rig.station.input(1).set(True)
    rig.run(0.05)
    assert rig.technology.port.inputs == 1


@pytest.mark.exhaustive
def test_the_station_is_lost():
    """No answer for three cycles: alarm 431, and the watchdog of the station takes enable and voltage
    away.
    """
    rig = Rig().travelling()
    rig.net.cut = True
    rig.run(0.05)
    assert rig.axis.var("ErrorDetail.Number") == 431
    assert not rig.axis.var("StatusDrive.CommunicationOK")
    assert (rig.drive.enabled, rig.drive.voltage) == (False, 0.0)
    rig.run(0.5)
    assert rig.mm_s == 0.0
    rig.net.cut = False
    rig.run(0.5)
    rig.axis.reset()
    rig.run(0.2)
    assert rig.power.Status
    kinds = [event.kind for event in rig.history.events if event.source == "io"]
    assert kinds.count("station.down") == 1
    assert kinds.count("station.up") == 2


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-323", "CFG-398")
def test_speed_axis_without_encoder():
    """A speed axis needs no encoder: its speed is 0.0, and after a quick stop Status falls in the next
    cycles.
    """
    rig = Rig(speed=True)
    power = rig.axis.power()
    rig.until(power.status)
    rig.axis.move_velocity(1500.0)
    rig.run(1.0)
    assert rig.drive.mechanics.motor_speed == pytest.approx(1500.0 * 0.10471975511965977, rel=1e-3)
    assert rig.axis.var("ActualSpeed") == 0.0
    rig.rows.clear()
    rig.start = rig.scheduler.now / S
    rig.axis.power(False, stop_mode=1)
    rig.run(0.1)
    assert rig.first(lambda row: not row[4]) < 0.03
    assert rig.drive.mechanics.motor_speed > 0.0


def test_wrong_wires_are_refused():
    """Channels and switches that do not exist say what there is."""
    rig = Rig()
    for config in ({"setpoint": 1}, {"enable": 3}, {"ready": 9}, {"counter": 1}):
        with pytest.raises(ConfigurationError):
            AnalogPort(rig.link, AnalogPortConfig(cycle_ns=CYCLE_NS, **config))
    with pytest.raises(ConfigurationError):
        AnalogPortConfig(cycle_ns=CYCLE_NS, reference_speed_rpm=0.0)
    for channels in ({"door": 0}, {"home": 3}):
        with pytest.raises(ConfigurationError):
            StationInputs(rig.link, channels)
