"""The emulated drive with an analog setpoint: scaling, enable, ready output, its own stop, what can break."""

from __future__ import annotations

from dataclasses import fields

import pytest
from hypothesis import given
from hypothesis import strategies as st

from emulators.drive.analog import AnalogDrive, AnalogState
from emulators.drive.analog_config import AnalogConfig, AnalogSettings
from emulators.drive.machine import NO_SWITCHES, BrakeConfig, LinearAxisConfig, SwitchesConfig
from fieldbus.clock import MS, S
from fieldbus.errors import ConfigurationError, UnsupportedFaultError
from testcases.rigs import VirtualRig

RPM = 2 * 3.141592653589793 / 60


SETTINGS = frozenset(one.name for one in fields(AnalogSettings))


def config_of(**keys):
    """Return the configuration of a drive with the given keys, its own and those of its table `analog`."""
    settings = AnalogSettings(**{key: keys.pop(key) for key in SETTINGS & set(keys)})
    return AnalogConfig(analog=settings, **keys)


class Rig(VirtualRig):
    def __init__(self, *, power=True, **options):
        super().__init__()
        options.setdefault("switches", NO_SWITCHES)
        options.setdefault("mechanics", LinearAxisConfig(negative_stop_mm=None, positive_stop_mm=None))
        self.drive = AnalogDrive(self.scheduler, config_of(**options), name="drive1", history=self.history)
        self.ready = []
        self.drive.on_ready.append(lambda level: self.ready.append((self.scheduler.now, level)))
        if power:
            self.drive.power_on()

    @property
    def rpm(self):
        return self.drive.mechanics.motor_speed / RPM

    def start(self, volts=0.0, seconds=0.3):
        self.drive.set_enable(True)
        self.drive.set_voltage(volts)
        self.run(seconds)


@pytest.mark.requirement("CFG-395", "CFG-396", "STP-539")
@pytest.mark.parametrize(
    ("volts", "rpm"),
    [(5.0, 1500.0), (-10.0, -3000.0), (11.7, 3510.0), (13.0, 3510.0), (-13.0, -3510.0), (0.0, 0.0)],
)
def test_speed_by_voltage(volts, rpm):
    """10 V is the reference speed; up to 117 % count, a higher voltage is limited."""
    rig = Rig(max_speed_rpm=4000.0)
    rig.start(volts, 1.0)
    assert rig.rpm == pytest.approx(rpm, abs=0.1)


@pytest.mark.requirement("CFG-396")
def test_the_drive_permits_less():
    """The over-range counts as far as the drive permits it: its maximum speed."""
    rig = Rig(max_speed_rpm=3000.0)
    rig.start(11.7, 1.0)
    assert rig.rpm == pytest.approx(3000.0, abs=0.1)


def test_offset_dead_zone_and_polarity():
    """A drift of the input moves a standing axis, a dead zone hides it, a wrong polarity turns it round."""
    assert config_of(offset_v=0.05).speed_rpm(0.0) == pytest.approx(15.0)
    assert config_of(offset_v=0.05, dead_zone_v=0.1).speed_rpm(0.0) == 0.0
    assert config_of(inverted=True).speed_rpm(5.0) == pytest.approx(-1500.0)
    rig = Rig(offset_v=0.05)
    rig.start(0.0, 1.0)
    assert rig.rpm == pytest.approx(15.0, abs=0.1)


@pytest.mark.requirement("CFG-389", "STP-539")
@pytest.mark.parametrize("delay", [0.0, 0.05])
def test_ready_follows_the_enable(delay):
    """Ready: the power section is on and the setpoint is accepted, no sooner."""
    rig = Rig(ready_delay_ms=delay * 1000.0)
    rig.drive.set_voltage(5.0)
    rig.run(0.1)
    assert (rig.rpm, rig.ready) == (0.0, [])
    begin = rig.scheduler.now
    rig.drive.set_enable(True)
    rig.run(delay / 2)
    if delay:
        assert not rig.drive.ready
        assert rig.rpm == 0.0
    rig.run(0.3)
    assert rig.ready == [(begin + round(delay * S), True)]
    assert rig.rpm == pytest.approx(1500.0, abs=0.1)


@pytest.mark.requirement("STP-540", "STP-322")
@pytest.mark.parametrize("ramp_s", [0.5, 0.25])
def test_own_ramp(ramp_s):
    """Without the enable the drive brakes on its own ramp, whatever the voltage says: from 1800 rpm 0.6 of
    the ramp time.
    """
    rig = Rig(off3_ramp_s=ramp_s)
    rig.start(6.0)
    start, place = rig.scheduler.now, rig.drive.mechanics.position
    rig.drive.set_enable(False)
    assert rig.drive.state is AnalogState.STOPPING
    rig.drive.set_voltage(-10.0)
    assert rig.scheduler.run_until(lambda: rig.drive.state is AnalogState.STANDBY, 2 * S)
    assert (rig.scheduler.now - start) / S == pytest.approx(0.6 * ramp_s, abs=0.012)
    assert rig.drive.mechanics.position - place == pytest.approx(0.3 * 0.6 * ramp_s / 2, abs=0.002)
    rig.run(0.2)
    assert rig.rpm == 0.0
    assert rig.drive.core.torque == 0.0


@pytest.mark.requirement("STP-540")
def test_coast():
    """A drive that coasts has no torque from the falling enable on, and mechanics alone stop it."""
    rig = Rig(stop="coast")
    rig.start(6.0)
    rig.drive.set_enable(False)
    assert rig.drive.state is AnalogState.STANDBY
    rig.run(0.1)
    assert rig.drive.core.torque == 0.0
    assert 1000.0 < rig.rpm < 1800.0
    rig.run(3.0)
    assert rig.rpm == 0.0


@pytest.mark.requirement("STP-539", "STP-310", "STP-323")
@pytest.mark.parametrize("stop", ["ramp", "coast"])
@pytest.mark.parametrize("falls", ["enable", "standstill", "never"])
def test_when_ready_falls(stop, falls):
    """Ready falls with the enable, at standstill, or never, as the manufacturer likes."""
    rig = Rig(stop=stop, ready_falls=falls)
    rig.start(6.0)
    begin = rig.scheduler.now
    rig.drive.set_enable(False)
    assert rig.drive.ready is (falls != "enable")
    rig.run(0.1)
    assert rig.drive.ready is (falls != "enable")
    rig.run(4.0)
    assert rig.drive.ready is (falls == "never")
    if falls == "standstill":
        assert rig.ready[-1][0] - begin > 0.25 * S


@pytest.mark.requirement("STP-062", "CFG-388")
def test_without_enable_input():
    """A drive without an enable input follows the voltage as long as it is on."""
    rig = Rig(enable_input=False)
    rig.drive.set_voltage(6.0)
    rig.run(0.3)
    assert rig.rpm == pytest.approx(1800.0, abs=0.1)
    rig.drive.set_enable(True)
    rig.drive.set_enable(False)
    rig.run(0.1)
    assert rig.rpm == pytest.approx(1800.0, abs=0.1)
    rig.drive.power_off()
    rig.run(0.1)
    assert rig.drive.core.torque == 0.0
    assert not rig.drive.ready


@pytest.mark.requirement("STP-539")
def test_ready_drops_by_itself():
    """The ready output can be forced; the motor does not care."""
    rig = Rig()
    rig.start(6.0)
    rig.drive.force_ready(False)
    rig.run(0.1)
    assert not rig.drive.ready
    assert rig.rpm == pytest.approx(1800.0, abs=0.1)
    rig.drive.force_ready(None)
    assert [level for _, level in rig.ready] == [True, False, True]


def test_a_fault_waits_for_a_new_enable():
    """A trip takes torque and ready; it goes when the enable has been away once, and its cause too."""
    rig = Rig()
    rig.start(6.0)
    rig.drive.raise_fault(0x2310, persistent=True)
    assert (rig.drive.state, rig.drive.ready, rig.drive.fault_number) == (AnalogState.FAULT, False, 0x2310)
    rig.run(0.01)
    assert rig.drive.core.torque == 0.0
    rig.drive.set_enable(False)
    rig.drive.set_enable(True)
    assert rig.drive.state is AnalogState.FAULT
    rig.drive.clear_fault_cause()
    assert rig.drive.state is AnalogState.FAULT
    rig.drive.set_enable(False)
    assert rig.drive.state is AnalogState.STANDBY
    rig.drive.set_enable(True)
    assert rig.drive.state is AnalogState.OPERATION
    assert rig.drive.fault_number == 0
    events = [event.data["number"] for event in rig.history.select(kind="drive.fault")]
    assert events == [0x2310]


def test_safe_torque_off_and_supply():
    """After safe torque off, and after the supply was away, the motor starts with a new edge of the enable
    only.
    """
    rig = Rig()
    for off, on in (
        (lambda: rig.drive.set_sto(True), lambda: rig.drive.set_sto(False)),
        (rig.drive.power_off, rig.drive.power_on),
    ):
        rig.drive.set_enable(False)
        rig.start(6.0)
        off()
        rig.run(0.01)
        assert (rig.drive.core.torque, rig.drive.ready) == (0.0, False)
        on()
        rig.run(0.1)
        assert rig.drive.state is AnalogState.STANDBY
        rig.drive.set_enable(False)
        rig.drive.set_enable(True)
        assert rig.drive.state is AnalogState.OPERATION


def test_enable_again_while_it_brakes():
    """The enable during the drive's ramp goes on from the present speed."""
    rig = Rig()
    rig.start(6.0)
    rig.drive.set_enable(False)
    rig.run(0.15)
    before = rig.rpm
    rig.drive.set_enable(True)
    assert rig.drive.state is AnalogState.OPERATION
    rig.run(0.3)
    assert 500.0 < before < 1500.0
    assert rig.rpm == pytest.approx(1800.0, abs=0.1)


def test_machine_switches_brake_and_faults():
    """Switches are reported, a brake closes without torque, and machine faults act as with every drive."""
    switches = SwitchesConfig(negative_limit_mm=None, positive_limit_mm=50.0, home_mm=None, hysteresis_mm=0.0)
    rig = Rig(switches=switches, brake=BrakeConfig(torque_nm=3.0), off3_ramp_s=0.1)
    seen = []
    rig.drive.on_inputs.append(seen.append)
    assert rig.drive.trace_row()[rig.drive.trace_columns.index(("brake_closed", ""))]
    rig.start(10.0, 0.5)
    assert seen == [2]
    rig.drive.limit_torque(0.0)
    rig.run(0.2)
    assert rig.rpm < 2990.0
    rig.drive.limit_torque(None)
    rig.drive.scale_ramps(0.5)
    rig.run(0.2)
    begin = rig.scheduler.now
    rig.drive.set_enable(False)
    rig.scheduler.run_until(lambda: rig.drive.state is AnalogState.STANDBY, S)
    assert (rig.scheduler.now - begin) / S == pytest.approx(0.2, abs=0.01)
    rig.drive.break_encoder_wire(True)
    assert rig.drive.state is AnalogState.FAULT
    rig.drive.break_encoder_wire(False)
    assert rig.drive.state is AnalogState.STANDBY
    with pytest.raises(UnsupportedFaultError):
        rig.drive.force_input("home", True)


def test_bad_settings_are_refused():
    """What cannot be says what is allowed."""
    for key, value in {
        "reference_speed_rpm": 0.0,
        "off3_ramp_s": 0.0,
        "dead_zone_v": -1.0,
        "offset_v": float("nan"),
        "stop": "never",
        "ready_falls": "late",
        "servo_period_ns": 0,
    }.items():
        with pytest.raises(ConfigurationError, match=key):
            config_of(**{key: value})
    rig = Rig()
    for call in (lambda: rig.drive.set_voltage(float("inf")), lambda: rig.drive.raise_fault(0)):
        with pytest.raises(ConfigurationError):
            call()


_STEPS = st.lists(
    st.tuples(st.sampled_from(["enable", "voltage", "sto", "power", "fault", "wait"]), st.booleans()),
    max_size=30,
)


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-540", "CFG-389")
@given(_STEPS, st.sampled_from(["ramp", "coast"]), st.sampled_from(["enable", "standstill", "never"]))
def test_torque_only_when_allowed(steps, stop, falls):
    """Whatever happens in whatever order: torque only with the enable or on the stop ramp, ready rises only
    in operation.
    """
    rig = Rig(stop=stop, ready_falls=falls, ready_delay_ms=2.0)
    drive = rig.drive
    for what, on in steps:
        if what == "enable":
            drive.set_enable(on)
        elif what == "voltage":
            drive.set_voltage(8.0 if on else -3.0)
        elif what == "sto":
            drive.set_sto(on)
        elif what == "power":
            (drive.power_on if on else drive.power_off)()
        elif what == "fault":
            drive.raise_fault(0x1000)
        before = drive.ready
        rig.scheduler.run_for(3 * MS)
        if not before and drive.ready:
            assert drive.state is AnalogState.OPERATION
        led = drive.state in {AnalogState.STARTING, AnalogState.OPERATION}
        assert drive.core.enabled is (led or drive.state is AnalogState.STOPPING)
        assert not led or drive.enabled
