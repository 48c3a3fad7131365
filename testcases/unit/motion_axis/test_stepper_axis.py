"""An axis on a pulse module with a stepper drive: steps of the control word, stops, encoder errors, what a
pulse counter cannot see.
"""

from __future__ import annotations

import pytest

from emulators.drive.machine import NO_SWITCHES, LinearAxisConfig, SwitchesConfig
from emulators.drive.profidrive.statemachine import AxisState
from emulators.drive.pto_settings import PtoSettings
from emulators.drive.stepper import StepperDriveConfig
from emulators.drive.stepper_can import StepperCanDrive
from emulators.drive.stepper_can_config import StepperNodeConfig
from emulators.io.tm_pto import PtoConfig
from fieldbus.can import CanMedium
from fieldbus.canopen.master import CanopenMaster
from fieldbus.clock import MS
from fieldbus.errors import ConfigurationError
from motion.drives.profidrive_can import ProfidriveCanConfig
from motion.drives.tm_pto import pto_words, pulse_module_port
from motion.s7.axis import PositioningAxis
from testcases.rigs import ControllerRig
from testcases.unit.motion_axis.conftest import REFERENCE

pytestmark = pytest.mark.exhaustive

CYCLE_NS = 4 * MS
INCREMENTS = 2000
MACHINE = {
    "motor_inertia_kgm2": 3e-5,
    "screw_inertia_kgm2": 1e-5,
    "load_mass_kg": 5.0,
    "negative_stop_mm": None,
    "positive_stop_mm": None,
}


class Rig(ControllerRig):
    """One axis, a CAN segment, a pulse module with motor and machine."""

    def __init__(
        self, *, standard=False, variables=None, machine=None, switches=NO_SWITCHES, settings=None, **channel
    ):
        super().__init__()
        scheduler = self.scheduler
        self.segment = CanMedium(scheduler, name="can0", history=self.history)
        channel = {"increments": INCREMENTS, "ramp_stop_ms": 100, "quick_stop_ms": 500, **channel}
        own = {"use_ed": False, "use_dr": False, **(settings or {})}
        own["variant"] = "standard" if standard else "device"
        config = StepperDriveConfig(
            channel=PtoConfig(settings=PtoSettings(**own), **channel),
            mechanics=LinearAxisConfig(**MACHINE | (machine or {})),
            switches=switches,
        )
        self.drive = StepperCanDrive(
            scheduler,
            self.segment,
            StepperNodeConfig(node_id=5, drive=config),
            name="drive1",
            history=self.history,
        )
        self.channel = self.drive.drive.channel
        self.master = CanopenMaster(
            scheduler, self.segment, name="controller", node_id=127, history=self.history
        )
        words = pto_words(variant="standard" if standard else "device")
        self.port = pulse_module_port(
            self.master,
            ProfidriveCanConfig(cycle_ns=CYCLE_NS, node_id=5, words=words),
            name="drive1",
            history=self.history,
        )
        start = REFERENCE | {
            "Sensor[1].Parameter.StepsPerRevolution": channel["increments"],
            "StandstillSignal.VelocityThreshold": 15000.0 / channel["increments"],
            "PositionControl.ControlDifferenceQuantization.Mode": 1,
        }
        self.technology = PositioningAxis(
            "axis1",
            self.port,
            cycle_ns=CYCLE_NS,
            variables=start | (variables or {}),
            history=self.history,
            delay_s=0.006,
        )
        self.control_axis(self.technology)
        self.words = []
        self.drive.power_on()
        self.port.node.boot()
        self.until(lambda: self.port.node.started)
        self.master.start_sync(CYCLE_NS, 0)
        self.master.produce_heartbeat(100 * MS)
        self.runtime.start()
        self.until(lambda: self.technology.communication_ok)
        self.runtime.after_cycle.append(self._note)

    def _note(self):
        word = int(self.drive.drive.trace_row()[9])
        if not self.words or self.words[-1][0] != word:
            self.words.append((word, self.channel.state))

    def travelling(self, velocity=300.0):
        self.power = self.axis.power()
        self.until(self.power.status)
        self.job = self.axis.move_velocity(velocity, Deceleration=1000.0, Jerk=10000.0)
        self.until(self.job.in_velocity)
        self.run(0.1)
        self.words.clear()
        self._note()
        return self

    @property
    def position(self):
        """True position of the load, mm."""
        return self.drive.mechanics.position * 1000.0

    @property
    def shown(self):
        return self.technology.feedback.position


@pytest.mark.requirement("PTO-273", "PTO-155")
def test_enabling_step_by_step():
    """0450h, 0456h, 0457h, 045Fh, each when the module has answered the one before."""
    rig = Rig(settings={"use_ed": True, "use_dr": True, "ready_delay_ms": 200.0})
    rig.run(0.02)
    words = [frame.data[:2].hex() for _, _, frame, _ in rig.segment.log if frame.can_id == 0x205]
    assert words[:2] == ["5004", "5604"]
    assert rig.channel.state is AxisState.S2
    rig.words.clear()
    power = rig.axis.power()
    rig.until(power.status)
    assert [(f"{word:04X}", state.name) for word, state in rig.words] == [
        ("0456", "S2"),
        ("0457", "S3"),
        ("045F", "S3"),
    ]
    assert rig.channel.state is AxisState.S4
    assert rig.channel.ed


@pytest.mark.requirement("PTO-274")
@pytest.mark.parametrize(
    ("mode", "words", "end"),
    [
        (0, ["045F", "045E", "0456"], "S2"),
        (1, ["045F", "045B", "0450", "0456"], "S2"),
        (2, ["045F", "045E", "0456"], "S2"),
        (3, ["045F", "045C", "0454"], "S1"),
    ],
)
def test_disabling(mode, words, end):
    """OFF1, OFF3 or OFF2 by StopMode, with enable operation as long as a stop ramp runs."""
    rig = Rig().travelling()
    rig.axis.power(False, stop_mode=mode)
    rig.run(1.5)
    assert [f"{word:04X}" for word, _ in rig.words] == words
    assert rig.channel.state.name == end
    assert rig.drive.mechanics.velocity == 0.0
    assert (rig.power.Status, rig.power.Busy) == (False, False)


@pytest.mark.requirement("PTO-267", "PTO-272", "PTO-281", "CFG-377", "CFG-206")
@pytest.mark.parametrize("standard", [False, True])
def test_positioning(standard):
    """Telegram 3 leads the axis, the pulse counter is its encoder: 2000 increments per 10 mm make 0.005 mm
    each.
    """
    rig = Rig(standard=standard)
    assert rig.technology.mechanics.increment == pytest.approx(0.005)
    power = rig.axis.power()
    rig.until(power.status)
    job = rig.axis.move_relative(123.4, Velocity=300.0)
    rig.until(job.done)
    rig.run(0.3)
    assert rig.position == pytest.approx(123.4, abs=0.006)
    assert rig.shown == pytest.approx(rig.position, abs=1e-6)
    assert rig.channel.generator.count == pytest.approx(123.4 / 0.005, abs=1)
    assert rig.drive.drive.motor.lost == 0
    frames = [frame for _, _, frame, _ in rig.segment.log if frame.can_id == 0x305]
    assert bool(frames) is standard  # ten bytes need a second PDO


@pytest.mark.requirement("PTO-272")
def test_a_pulse_is_the_resolution():
    """200 increments per revolution and 10 mm give 0.05 mm: an axis stands on whole pulses."""
    rig = Rig(increments=200)
    assert rig.technology.mechanics.increment == pytest.approx(0.05)
    power = rig.axis.power()
    rig.until(power.status)
    job = rig.axis.move_relative(10.02, Velocity=100.0)
    rig.until(job.done)
    rig.run(0.5)
    assert rig.position / 0.05 == pytest.approx(round(rig.position / 0.05), abs=1e-6)
    assert rig.position == pytest.approx(10.02, abs=0.06)


@pytest.mark.requirement("CFG-378", "CFG-385", "PTO-268")
@pytest.mark.parametrize("mode", [0, 1])
def test_hunting_around_the_target(mode):
    """Between two pulses an axis without quantisation goes to and fro; with it the motor rests."""
    rig = Rig(increments=200, variables={"PositionControl.ControlDifferenceQuantization.Mode": mode})
    power = rig.axis.power()
    rig.until(power.status)
    rig.axis.move_relative(10.02, Velocity=100.0)
    rig.run(2.0)
    counts = set()
    rig.scheduler.every(MS, lambda: counts.add(rig.channel.generator.count))
    rig.run(10.0)
    assert len(counts) == (2 if mode == 0 else 1)


@pytest.mark.requirement("PTO-166")
@pytest.mark.parametrize(("ramp_ms", "alarm"), [(100, 0), (5000, 521)])
def test_two_ramps_on_top_of_each_other(ramp_ms, alarm):
    """A module with a long ramp of its own lags behind the ramps of the axis until the following error is too
    large.
    """
    rig = Rig(ramp_stop_ms=ramp_ms)
    power = rig.axis.power()
    rig.until(power.status)
    rig.axis.move_velocity(300.0)
    rig.run(1.0)
    assert rig.axis.var("ErrorDetail.Number") == alarm


@pytest.mark.requirement("PTO-275", "PTO-276", "PTO-189")
def test_short_circuit_at_an_output():
    """A drive error and an encoder error with code 1; `MC_Reset` acknowledges both, and the axis works
    again.
    """
    rig = Rig().travelling()
    rig.drive.short_outputs(True, 1)
    rig.run(0.05)
    raised = {event.data["number"]: event.data for event in rig.history.select(kind="alarm.raised")}
    assert {411, 421} <= set(raised)
    assert "0001h" in str(raised[411]["text"])
    assert rig.channel.state is AxisState.S1
    rig.drive.short_outputs(False, 1)
    rig.words.clear()
    rig.axis.reset()
    rig.run(0.5)
    assert any(word & 0x80 for word, _ in rig.words)
    assert not rig.axis.var("StatusWord.X1")
    assert rig.power.Status


@pytest.mark.requirement("PTO-276")
def test_encoder_error():
    """G1_ZSW.15 raises the alarm of the encoder with the code of G1_XIST2."""
    rig = Rig().travelling()
    rig.drive.report_encoder_error(0x0001, True)
    rig.run(0.05)
    events = [event.data for event in rig.history.select(kind="alarm.raised") if event.data["number"] == 411]
    assert "0001h" in str(events[0]["text"])
    rig.drive.report_encoder_error(0x0001, False)
    rig.run(0.5)
    rig.axis.reset()
    rig.run(0.5)
    assert rig.power.Status
    with pytest.raises(ConfigurationError):
        rig.drive.report_encoder_error(0x7777, True)


@pytest.mark.requirement("PTO-277", "PTO-209")
def test_supply_of_the_outputs():
    """Without the load supply the module parks its encoder and asks for no control: no valid actual value,
    alarms, then all back.
    """
    rig = Rig().travelling()
    rig.drive.disconnect_load_supply(True)
    rig.run(0.05)
    assert rig.axis.var("StatusSensor[1].State") == 0
    assert not rig.axis.var("StatusDrive.CommunicationOK")
    assert rig.axis.var("StatusWord.X1")
    rig.drive.disconnect_load_supply(False)
    rig.run(0.3)
    rig.axis.reset()
    rig.run(0.5)
    assert rig.power.Status
    assert rig.axis.var("StatusSensor[1].State") == 2


@pytest.mark.requirement("PTO-280", "PTO-310")
@pytest.mark.parametrize("how", ["jam", "slip", "overload"])
def test_a_motor_out_of_step_is_not_noticed(how):
    """G1_XIST1 goes on counting: no alarm, and the load is not where the axis believes."""
    rig = Rig().travelling(100.0)
    if how == "jam":
        rig.drive.jam(True)
    elif how == "slip":
        rig.drive.lose_steps(5)
    else:
        rig.drive.set_load_force(-3000.0)
    rig.run(0.5)
    assert rig.axis.var("ErrorDetail.Number") == 0
    assert rig.shown - rig.position > 0.7
    if how != "slip":
        assert rig.shown - rig.position > 40.0
        assert rig.drive.mechanics.velocity == 0.0
    kinds = [event.kind for event in rig.history.events]
    assert ("drive.slipped" if how == "slip" else "drive.out_of_step") in kinds


def test_end_stop():
    """At an end stop the shaft stands, whatever the pulses do; back from it the count has lost what was
    missed.
    """
    rig = Rig(machine={"positive_stop_mm": 50.0}).travelling(100.0)
    rig.run(1.0)
    assert rig.position == pytest.approx(50.0, abs=0.01)
    assert rig.shown > 80.0
    rig.axis.move_velocity(-50.0)
    rig.run(1.5)
    assert rig.position < 45.0
    assert rig.shown - rig.position > 30.0


def test_switches_of_the_machine():
    """Home is wired to RS and the limit switches to the inputs of the node: the axis stops at one."""
    switches = SwitchesConfig(
        negative_limit_mm=None, positive_limit_mm=60.0, home_from_mm=20.0, home_to_mm=30.0, hysteresis_mm=0.0
    )
    rig = Rig(
        switches=switches,
        settings={"use_rs": True},
        variables={"PositionLimits_HW.Active": True},
    )
    power = rig.axis.power()
    rig.until(power.status)
    rig.axis.move_velocity(100.0)
    rig.run(1.5)
    assert rig.axis.var("ErrorDetail.Number") == 531
    seen = [event.data["inputs"] for event in rig.history.select(kind="drive.inputs")]
    assert seen == [4, 0, 2]
    rig.drive.force_input("home", True)
    rig.run(0.01)
    assert rig.port.inputs == 6


@pytest.mark.requirement("PTO-206", "PTO-204", "PTO-295")
@pytest.mark.parametrize("how", ["sync", "module", "power"])
def test_the_controller_or_the_module_is_gone(how):
    """Without SYNC the module stops by its watchdog; a module that is pulled sends zeros; without supply
    there is no link.
    """
    rig = Rig().travelling()
    if how == "sync":
        rig.master.close()
    elif how == "module":
        rig.drive.unplug_module(True)
    else:
        rig.drive.power_off()
    rig.run(0.4)
    assert rig.drive.mechanics.velocity == 0.0
    assert rig.channel.state is AxisState.S1
    if how != "sync":
        assert rig.axis.var("StatusWord.X1")
        (rig.drive.unplug_module(False) if how == "module" else rig.drive.power_on())
        rig.until(lambda: rig.technology.communication_ok)
        rig.run(0.5)
        rig.axis.reset()
        rig.run(0.5)
        assert rig.power.Status


def test_what_the_module_lacks_is_refused():
    """Another telegram, a torque telegram, a sign of life, an unknown variant."""
    for wrong in ({"telegram": 5}, {"torque_telegram": True}, {"sign_of_life": True}, {"variant": "own"}):
        with pytest.raises(ConfigurationError):
            pto_words(**wrong)
    for wrong in ({"node_id": 0}, {"boot_time_ms": -1.0}, {"cycle_ns": 0}):
        with pytest.raises(ConfigurationError):
            StepperNodeConfig(**wrong)
    with pytest.raises(ConfigurationError, match="servo_period_ns"):
        StepperDriveConfig(servo_period_ns=0)
    for key, wrong in (("ready_delay_ms", -1.0), ("full_steps", 3), ("full_steps", 6)):
        with pytest.raises(ConfigurationError, match=key):
            StepperDriveConfig(channel=PtoConfig(settings=PtoSettings(**{key: wrong})))


@pytest.mark.requirement("PTO-271")
def test_bits_that_the_axis_does_not_use():
    """`MC_SetAxisSTW` brings free bits of STW1 to the module, which does not evaluate them."""
    rig = Rig().travelling()
    speed = rig.drive.mechanics.velocity
    job = rig.axis.set_axis_stw(STW1=0x1800, STW1BitMask=0x1800)
    rig.run(0.1)
    assert job.Done
    assert rig.words[-1][0] & 0x1800 == 0x1800
    assert rig.channel.state is AxisState.S4
    assert rig.drive.mechanics.velocity == pytest.approx(speed, rel=0.001)
