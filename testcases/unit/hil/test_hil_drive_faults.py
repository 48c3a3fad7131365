"""Every kind of fault in the drive does what the catalogue says, and is undone when it is removed."""

from __future__ import annotations

from itertools import pairwise

import pytest

from fieldbus.cia402 import DriveState as S
from fieldbus.errors import ConfigurationError, UnsupportedFaultError
from hil.bench import BenchFile, load_bench
from hil.faults import CATALOGUE, Fault, Injector

TABLES = """
[drive.drive1.brake]
torque_nm = 5.0

[drive.drive1.safety]
interlock = "inhibit"
"""


@pytest.fixture
def bench():
    text = load_bench("reference").text.replace("[axis.axis1]\n", f"{TABLES}\n[axis.axis1]\n")
    with BenchFile("own.toml", text).build(seed=7) as bench:
        yield bench


class Rig:
    """The bench with its axis enabled, and short words for what the tests look at."""

    def __init__(self, bench):
        self.bench = bench
        self.axis = bench.axis()
        self.drive = bench.drive()
        self.faults = Injector(bench)
        self.armed = None
        self.power = self.axis.power()
        assert bench.run_until(self.power.status, timeout=2.0)

    def move(self, velocity=100.0):
        self.axis.move_velocity(velocity)
        self.run(0.5)

    def run(self, seconds):
        self.bench.run_for(seconds)

    def inject(self, kind, **parameters):
        self.armed = self.faults.inject(kind, "drive1", **parameters)

    def remove(self):
        self.armed.remove()

    def warnings(self):
        return self.drive.peek(0x2100)

    def status(self):
        return self.drive.slave.values[0x604100]

    def frames(self, name, since):
        wanted = self.bench.cob_ids("drive1")[name]
        return [entry for entry in list(self.bench.segment().log)[since:] if entry[2].can_id == wanted]

    def mark(self):
        return len(self.bench.segment().log)

    def emcy_codes(self):
        return [event.data["code"] for event in self.bench.history.events if event.kind == "emcy.raised"]

    def speed(self):
        return abs(self.drive.mechanics.velocity) * 1000.0


@pytest.fixture
def rig(bench):
    return Rig(bench)


TESTED = {}


def of_kind(kind):
    """Mark the test of a fault kind."""

    def mark(test):
        TESTED[kind] = test
        return pytest.mark.requirement("C402-311" if kind.startswith("drive.") else "C402-312")(test)

    return mark


# -- safety and supply
# -----------------------------------------------------------------------------------------------------


@of_kind("drive.ss1")
def test_ss1(rig):
    """Quick stop, then safe torque off; released the drive can be enabled again."""
    rig.move()
    rig.inject("drive.ss1")
    rig.run(0.01)
    assert rig.drive.state is S.QUICK_STOP_ACTIVE
    rig.run(0.6)
    assert rig.drive.sto_active
    assert rig.speed() == 0.0
    rig.remove()
    assert not rig.drive.sto_active


@of_kind("drive.interlock")
def test_interlock(rig):
    """60FDh bit 3 falls and the torque goes; closed again the drive is free."""
    rig.move()
    assert rig.drive.inputs & 8
    rig.inject("drive.interlock")
    assert not rig.drive.inputs & 8
    assert rig.drive.core.torque == 0.0
    assert rig.drive.machine.inhibited
    rig.remove()
    assert rig.drive.inputs & 8
    assert not rig.drive.machine.inhibited


@pytest.mark.exhaustive
@of_kind("drive.mains_off")
def test_mains_off(rig):
    """The DC link runs empty: warning, then 3220h; the mains return and charge it."""
    rig.inject("drive.mains_off")
    rig.run(0.1)
    assert rig.status() & 0x80
    rig.run(4.0)
    assert rig.emcy_codes() == [0x3220]
    assert rig.drive.dc_link.voltage_V < 400.0
    rig.remove()
    rig.run(0.1)
    assert rig.drive.dc_link.voltage_V == pytest.approx(560.0, abs=0.1)
    assert not rig.status() & 0x80
    rig.axis.reset()
    assert rig.bench.run_until(rig.power.status, timeout=2.0)


@pytest.mark.exhaustive
@of_kind("drive.brown_out")
@pytest.mark.parametrize(("left", "volts", "codes"), [(80.0, 448.0, []), (50.0, None, [0x3220])])
def test_brown_out(rig, left, volts, codes):
    """The DC link sinks to what is left of the mains: above 400 V the drive goes on, below it trips; then the
    link is full again.
    """
    rig.inject("drive.brown_out", mains_percent=left)
    rig.run(6.0)
    assert rig.emcy_codes() == codes
    if volts is not None:
        assert rig.drive.dc_link.voltage_V == pytest.approx(volts, abs=0.5)
        assert rig.drive.state is S.OPERATION_ENABLED
    else:
        assert 280.0 <= rig.drive.dc_link.voltage_V < 400.0
    rig.remove()
    rig.run(0.1)
    assert rig.drive.dc_link.voltage_V == pytest.approx(560.0, abs=0.1)


@pytest.mark.exhaustive
@of_kind("drive.phase_loss")
def test_phase_loss(rig):
    """A warning at once, 3130h after half a second in operation."""
    rig.inject("drive.phase_loss")
    rig.run(0.45)
    assert (rig.status() & 0x80, rig.emcy_codes()) == (0x80, [])
    rig.run(0.2)
    assert rig.emcy_codes() == [0x3130]
    rig.remove()
    rig.run(0.1)
    assert rig.warnings() == 0


@of_kind("drive.dc_link")
@pytest.mark.parametrize(("voltage", "code"), [(0.0, 0x3220), (900.0, 0x3210)])
def test_dc_link(rig, voltage, code):
    """Missing: bit 4 falls and 3220h; too high: 3210h; the voltage is normal again afterwards."""
    rig.inject("drive.dc_link", voltage_V=voltage)
    rig.run(0.02)
    assert rig.emcy_codes() == [code]
    assert bool(rig.status() & 0x10) is (voltage > 0.0)
    assert rig.drive.peek(0x6079) == voltage * 1000
    rig.remove()
    rig.run(0.02)
    assert rig.drive.peek(0x6079) == 560_000
    assert rig.status() & 0x10


@pytest.mark.exhaustive
@of_kind("drive.chopper_failure")
def test_chopper_failure(rig):
    """A load that drives the motor: the chopper holds the DC link, broken it does not."""
    rig.drive.dc_link.voltage_V = 719.0
    rig.move(-400.0)
    rig.bench.drive().set_load_force(-2500.0)
    rig.run(0.2)
    assert rig.emcy_codes() == []
    assert rig.drive.dc_link.voltage_V < 725.0
    rig.inject("drive.chopper_failure")
    rig.run(0.3)
    assert 0x3210 in rig.emcy_codes()
    rig.remove()
    assert not rig.drive.dc_link.chopper_failed


@of_kind("drive.overtemperature")
@pytest.mark.parametrize(("part", "code"), [("motor", 0x4310), ("power_stage", 0x4210)])
def test_overtemperature(rig, part, code):
    """The sensor shows 150 degrees: warning and fault; afterwards it shows the truth."""
    rig.inject("drive.overtemperature", part=part, temperature_C=150.0)
    rig.run(0.02)
    assert rig.emcy_codes() == [code]
    assert rig.status() & 0x80
    rig.remove()
    rig.run(0.02)
    assert rig.warnings() == 0


# -- torque, ramps, brake
# ----------------------------------------------------------------------------------------------------


@pytest.mark.exhaustive
@of_kind("drive.torque_limit")
def test_torque_limit(rig):
    """A fifth of the rated torque is less than the acceleration needs; bit 11 tells; then all of it is there
    again.
    """
    rig.inject("drive.torque_limit", share=0.2)
    rig.axis.move_velocity(100.0)
    rig.run(0.05)
    assert abs(rig.drive.core.torque) <= 0.4 + 1e-9
    assert rig.status() & 0x800
    rig.remove()
    rig.run(1.0)
    assert not rig.status() & 0x800


@pytest.mark.exhaustive
@of_kind("drive.slow_ramp")
def test_slow_ramp(rig):
    """OFF3 takes twice as long with half the slope, and as long as before once the fault is gone."""
    times = []
    for faulty in (False, True, False):
        rig.bench.run_until(rig.power.status, timeout=2.0)
        rig.move(200.0)
        if faulty:
            rig.inject("drive.slow_ramp", share=0.5)
        start = rig.bench.now_s
        rig.power.set(Enable=False, StopMode=1)
        rig.bench.run_until(lambda: rig.speed() < 0.5, timeout=2.0)
        times.append(rig.bench.now_s - start)
        if faulty:
            rig.remove()
        rig.run(0.5)
        rig.power.set(Enable=True)
    assert times[1] == pytest.approx(2.0 * times[0], rel=0.1)
    assert times[2] == pytest.approx(times[0], rel=0.05)


@of_kind("drive.brake_stuck")
@pytest.mark.parametrize("closed", [True, False])
def test_brake_stuck(rig, closed):
    """Stuck closed the axis does not move; stuck open the brake holds nothing when the drive is off."""
    if closed:
        rig.drive.limit_torque(1.0)
    rig.inject("drive.brake_stuck", closed=closed)
    if closed:
        rig.axis.move_velocity(100.0)
        rig.run(0.2)
        assert rig.drive.mechanics.position == 0.0
    else:
        rig.power.set(Enable=False)
        rig.run(0.5)
        assert rig.drive.core.brake.closed
    held = rig.drive.core.brake.holding_torque_Nm
    assert held == (5.0 if closed else 0.0)
    rig.remove()
    brake = rig.drive.core.brake
    assert brake.holding_torque_Nm == (5.0 if brake.closed else 0.0)


@of_kind("drive.brake_slip")
def test_brake_slip(rig):
    """A worn brake holds with a share of its torque."""
    rig.power.set(Enable=False)
    rig.run(0.5)
    rig.inject("drive.brake_slip", share=0.1)
    assert rig.drive.core.brake.holding_torque_Nm == pytest.approx(0.5)
    rig.drive.set_load_force(800.0)
    rig.run(0.2)
    assert rig.drive.mechanics.position > 0.01
    rig.remove()
    assert rig.drive.core.brake.holding_torque_Nm == 5.0


# -- state machine
# -----------------------------------------------------------------------------------------------------------


@of_kind("drive.local_control")
def test_local_control(rig):
    """Bit 9 falls and control words count no more; the axis raises 421."""
    rig.inject("drive.local_control")
    rig.run(0.05)
    assert not rig.status() & 0x200
    assert any(event.kind == "alarm.raised" for event in rig.bench.history.events)
    rig.remove()
    assert rig.status() & 0x200


@pytest.mark.exhaustive
@of_kind("drive.refuse_transition")
def test_refuse_transition(rig):
    """The drive stops at Switched on although 000Fh is there, and goes on once the fault is gone."""
    rig.power.set(Enable=False)
    rig.run(0.5)
    rig.inject("drive.refuse_transition", transition=4)
    rig.power.set(Enable=True)
    rig.run(1.0)
    assert rig.drive.state is S.SWITCHED_ON
    rig.remove()
    assert rig.bench.run_until(rig.power.status, timeout=1.0)


def test_only_transitions_by_command_can_be_refused():
    """What happens by itself cannot be refused; the message lists the rest."""
    with pytest.raises(ConfigurationError, match="2, 3, 4, 15, 16"):
        Fault("drive.refuse_transition", parameters={"transition": 9})


@of_kind("drive.switch_on_disabled")
def test_switch_on_disabled(rig):
    """The drive falls out of operation by itself: coasting, no EMCY."""
    rig.move()
    rig.inject("drive.switch_on_disabled")
    assert (rig.drive.state, rig.drive.core.torque) == (S.SWITCH_ON_DISABLED, 0.0)
    rig.run(0.1)
    assert rig.emcy_codes() == []
    assert rig.armed.over


# -- status word
# ------------------------------------------------------------------------------------------------------------


@of_kind("drive.warning")
def test_warning(rig):
    """Bit 7 without a change of state; the motion goes on."""
    rig.move()
    rig.inject("drive.warning")
    rig.run(0.05)
    assert rig.status() & 0x80
    assert rig.drive.state is S.OPERATION_ENABLED
    rig.remove()
    assert not rig.status() & 0x80


@of_kind("drive.statusword_stuck")
def test_statusword_stuck(rig):
    """The word stays at operation enabled although the drive has tripped, and then shows the truth."""
    before = rig.status()
    rig.inject("drive.statusword_stuck")
    rig.drive.raise_fault(0x4310)
    rig.run(0.1)
    assert rig.status() == before
    rig.remove()
    assert rig.status() & 8


@of_kind("drive.statusword_bits")
def test_statusword_bits(rig):
    """Single bits lie, the rest goes on telling the truth."""
    before = rig.status()
    rig.inject("drive.statusword_bits", set=0x4000, clear=0x0200)
    assert rig.status() == before & ~0x0200 | 0x4000
    rig.remove()
    assert rig.status() == before


@pytest.mark.exhaustive
@of_kind("drive.target_toggle")
def test_target_toggle(rig):
    """Bit 10 changes every 20 ms while nothing moves."""
    rig.inject("drive.target_toggle", period_s=0.02)
    bits = []
    for _ in range(8):
        bits.append(rig.status() >> 10 & 1)
        rig.run(0.02)
    assert bits == [1, 0] * 4
    assert rig.speed() == 0.0
    rig.remove()
    rig.run(0.1)
    assert not rig.status() & 0x400


@of_kind("drive.mode_display")
def test_mode_display(rig):
    """6061h lies, the mode in force stays."""
    rig.inject("drive.mode_display", mode=1)
    assert (rig.drive.peek(0x6061), rig.drive.mode.number) == (1, 9)
    rig.remove()
    assert rig.drive.peek(0x6061) == 9


# -- services
# ------------------------------------------------------------------------------------------------------------


@pytest.mark.exhaustive
@of_kind("drive.reset")
def test_reset(rig):
    """Silence, boot-up frame after the time, and the axis notices the lost link; afterwards it can be enabled
    again.
    """
    rig.move()
    mark = rig.mark()
    rig.inject("drive.reset", boot_s=0.1)
    rig.run(0.09)
    assert rig.frames("tpdo1", mark) == []
    rig.run(0.5)
    assert rig.frames("heartbeat", mark)[0][2].data == b"\x00"
    assert any(
        event.kind == "alarm.raised" and event.data["number"] == 431 for event in rig.bench.history.events
    )
    rig.run(1.0)
    rig.axis.reset()
    assert rig.bench.run_until(rig.power.status, timeout=3.0)


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-310")
@of_kind("drive.heartbeat_late")
def test_heartbeat_late(rig):
    """Heartbeats come 50 ms later than every 100 ms, and in time again afterwards."""
    rig.run(0.3)

    def gaps():
        mark = rig.mark()
        rig.run(1.0)
        times = [entry[0] for entry in rig.frames("heartbeat", mark)]
        return [(after - before) / 1e6 for before, after in pairwise(times)]

    assert gaps() == pytest.approx([100.0] * 9, abs=1.0)
    rig.inject("drive.heartbeat_late", delay_s=0.05)
    rig.run(0.2)
    assert gaps() == pytest.approx([150.0] * 6, abs=1.0)
    rig.remove()
    rig.run(0.2)
    assert gaps() == pytest.approx([100.0] * 9, abs=1.0)


def _sdo(rig, index):
    """Upload by frames; return the answer, None when there is none."""
    from fieldbus.can.frame import CanFrame

    mark = rig.mark()
    rig.bench.segment().inject(
        CanFrame(0x605, b"\x40" + index.to_bytes(2, "little") + bytes(5)), sender="tool"
    )
    rig.run(0.01)
    answers = rig.frames("sdo_tx", mark)
    return answers[0][2].data if answers else None


@pytest.mark.requirement("C402-310")
@of_kind("drive.sdo_abort")
def test_sdo_abort(rig):
    """One index is refused with the chosen code, others are served; index 0 means every one."""
    rig.inject("drive.sdo_abort", code=0x06010000, index=0x6060)
    assert _sdo(rig, 0x6060) == bytes.fromhex("8060600000000106")
    assert _sdo(rig, 0x6061)[0] != 0x80
    rig.remove()
    assert _sdo(rig, 0x6060)[0] != 0x80
    rig.inject("drive.sdo_abort", code=0x08000022)
    assert _sdo(rig, 0x6061) == bytes.fromhex("8061600022000008")


@pytest.mark.requirement("C402-310")
@of_kind("drive.sdo_timeout")
def test_sdo_timeout(rig):
    """No answer at all while it lasts."""
    rig.inject("drive.sdo_timeout")
    assert _sdo(rig, 0x6061) is None
    rig.remove()
    assert _sdo(rig, 0x6061) is not None


@pytest.mark.requirement("C402-310")
@of_kind("drive.emcy_storm")
def test_emcy_storm(rig):
    """An EMCY every 2 ms, no change of state, and EMCY 0000h at the end."""
    mark = rig.mark()
    rig.inject("drive.emcy_storm", code=0xFF00, period_s=0.002)
    rig.run(0.1)
    data = [entry[2].data for entry in rig.frames("emcy", mark)]
    assert len(data) == pytest.approx(50, abs=2)
    assert set(data) == {bytes.fromhex("00ff810000000000")}
    assert rig.drive.state is S.OPERATION_ENABLED
    rig.run(0.001)
    mark = rig.mark()
    rig.remove()
    rig.run(0.1)
    assert [entry[2].data[:3] for entry in rig.frames("emcy", mark)] == [b"\0\0\0"]


@pytest.mark.requirement("C402-310", "C301-127")
@pytest.mark.parametrize(("length", "code"), [(3, 0x8210), (8, 0x8220)])
def test_frame_length(rig, length, code):
    """RPDO1 (7 bytes) too short is EMCY 8210h and not processed, too long is 8220h and processed
    (C301-054).
    """
    Injector(rig.bench).inject("frame.length", count=1, message="rpdo1", length=length)
    rig.run(0.1)
    assert rig.emcy_codes() == [code]


# -- encoder
# ------------------------------------------------------------------------------------------------------------


@pytest.mark.exhaustive
@of_kind("encoder.drift")
def test_encoder_drift(rig):
    """5000 increments per second while it lasts; then it stays displaced."""
    rig.power.set(Enable=False)
    rig.run(0.5)
    before = rig.drive.encoder.increments
    rig.inject("encoder.drift", increments_per_s=-5000.0)
    rig.run(1.0)
    assert rig.drive.encoder.increments - before == pytest.approx(-5000, abs=10)
    rig.remove()
    after = rig.drive.encoder.increments
    rig.run(0.5)
    assert rig.drive.encoder.increments == after


@of_kind("encoder.scale")
def test_encoder_scale(rig):
    """An encoder that counts nine tenths: the axis believes that it has moved 20 mm, the load has moved a
    ninth more, for good.
    """
    rig.run(0.1)
    begun = rig.drive.mechanics.position
    rig.inject("encoder.scale", factor=0.9)
    assert rig.bench.run_until(rig.axis.move_relative(20.0, Velocity=200.0).done, timeout=2.0)
    assert (rig.drive.mechanics.position - begun) * 1e3 == pytest.approx(20.0 / 0.9, abs=0.05)
    shown = rig.drive.encoder.increments
    rig.remove()
    rig.run(0.05)
    assert rig.drive.encoder.increments == pytest.approx(shown, abs=40)
    begun = rig.drive.mechanics.position
    assert rig.bench.run_until(rig.axis.move_relative(-10.0).done, timeout=2.0)
    assert (begun - rig.drive.mechanics.position) * 1e3 == pytest.approx(10.0, abs=0.05)


@pytest.mark.exhaustive
@of_kind("encoder.wire_break")
def test_encoder_wire_break(rig):
    """Value frozen, 7305h, coasting, no reset before it is repaired; the reference of an incremental encoder
    is lost.
    """
    rig.drive.axis.homed = True
    rig.move()
    rig.inject("encoder.wire_break")
    frozen = rig.drive.encoder.increments
    rig.run(0.2)
    assert (rig.drive.state, rig.drive.core.torque) == (S.FAULT, 0.0)
    assert rig.emcy_codes() == [0x7305]
    assert rig.drive.encoder.increments == frozen
    rig.axis.reset()
    rig.run(0.3)
    assert rig.drive.state is S.FAULT
    rig.remove()
    assert not rig.drive.axis.homed
    rig.run(3.0)
    rig.axis.reset()
    assert rig.bench.run_until(rig.power.status, timeout=3.0)


# -- all kinds
# ------------------------------------------------------------------------------------------------------------

ELSEWHERE = {
    "drive.fault",
    "drive.sto",
    "drive.power_off",
    "drive.heartbeat_loss",
    "drive.clock_drift",
    "drive.clock_jitter",
}
"""Kinds whose effect the shipped campaigns, the tests of the injector and those of clocks show."""


def test_every_kind_of_the_drive_has_its_test():
    """A new kind in the catalogue needs a test that it does what it says."""
    kinds = {entry.name for entry in CATALOGUE if entry.name.startswith("drive.")}
    assert kinds | {"encoder.drift", "encoder.wire_break", "encoder.scale"} == set(TESTED) | ELSEWHERE


@pytest.mark.parametrize("kind", ["drive.brake_stuck", "drive.brake_slip", "drive.interlock"])
def test_what_is_not_fitted_cannot_fail(kind):
    """Without a brake, or without an interlock, the fault is refused with the reason."""
    with load_bench("reference").build(seed=1) as bench:
        entry = next(entry for entry in CATALOGUE if entry.name == kind)
        fault = Fault(kind, parameters=entry.example.get("parameters", {}))
        with pytest.raises(UnsupportedFaultError, match=r"there is no brake|no interlock is wired"):
            Injector(bench).arm(fault)
