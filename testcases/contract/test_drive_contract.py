"""What an axis may rely on at every port, whatever profile and bus carry it.

The axis of the bench is put aside; the test itself reads and writes the port once per cycle, as the axis
does.
"""

from __future__ import annotations

import pytest

from hil.bench import load_bench
from hil.bench.bench import Bench
from hil.faults import Injector
from motion.drives.port import (
    INPUT_POSITIVE_LIMIT,
    STW1,
    STW1_ALL_OFF,
    STW1_IDLE,
    STW1_OFF2_OFF1,
    STW1_OFF3,
    STW1_OPERATE,
    ZSW1,
)

BENCHES = ("reference", "profidrive", "profidrive_tcp", "profidrive_rtu")
STATE = int(ZSW1.READY_TO_SWITCH_ON | ZSW1.READY | ZSW1.OPERATION_ENABLED | ZSW1.SWITCHING_ON_INHIBITED)
S1, S2, S3, S4 = 0x40, 0x01, 0x03, 0x07


class Rig:
    """A port and who uses it."""

    def __init__(self, machine):
        self.machine = machine
        self.port = machine.axis().port
        self.stw1 = STW1_IDLE
        self.speed = 0.0
        machine.runtime.stop()
        cycle = machine.cycle_ns
        self.cycle_s = cycle / 1e9
        self.timer = machine.scheduler.every(cycle, self._cycle, phase_ns=cycle // 2)

    def _cycle(self):
        self.port.read()
        self.port.write(self.stw1, self.speed)

    @property
    def state(self):
        return self.port.zsw1 & STATE

    def shows(self, state, cycles=50):
        """Say whether the port shows a state within some bus cycles."""
        return self.until(lambda: self.state == state, cycles)

    def until(self, condition, cycles=50):
        """Say whether something holds within some bus cycles."""
        return self.machine.run_until(condition, cycles * self.cycle_s)

    def wait(self, cycles=12):
        """Let bus cycles pass."""
        self.machine.run_for(cycles * self.cycle_s)

    def operate(self, speed=0.0):
        """Bring the drive into operation."""
        assert self.shows(S2)
        self.stw1 = STW1_OPERATE
        assert self.shows(S4)
        self.speed = speed
        if speed:
            assert self.machine.run_until(
                lambda: abs(self.port.actual_speed_rpm - speed) < 0.01 * abs(speed), 3.0
            )


@pytest.fixture(params=BENCHES)
def rig(request):
    """Return a port of every kind, its drive idle."""
    with Bench(load_bench(request.param).config, seed=1) as machine:
        yield Rig(machine)


def test_it_rests_ready_and_operates_on_command(rig):
    """16#047E is S2, 16#047F leads to S4, and back again."""
    rig.operate()
    assert rig.port.link_ok
    assert not rig.port.zsw1 & ZSW1.FAULT
    rig.stw1 = STW1_IDLE
    assert rig.shows(S2)


@pytest.mark.parametrize("speed", [600.0, -1500.0])
def test_speed_and_encoder_follow_the_setpoint(rig, speed):
    """The setpoint in rpm comes back as actual speed in rpm, and the count moves by revolutions times
    increments.
    """
    rig.operate(speed)
    drive = next(iter(rig.machine.config.drive.values()))
    fine = drive.profidrive.fine_resolution_bits if drive.profile == "profidrive" else 0
    before = rig.port.encoder_increments
    rig.wait(20)
    turned = (rig.port.encoder_increments - before + (1 << 31)) % (1 << 32) - (1 << 31)
    assert turned == pytest.approx(
        speed / 60.0 * 20 * rig.cycle_s * (drive.increments_per_revolution << fine), rel=0.01
    )


@pytest.mark.parametrize(
    ("word", "braking", "end", "seconds"),
    [(STW1_IDLE, S3, S2, 0.5), (STW1_OFF3, S3, S1, 0.25)],
    ids=["OFF1", "OFF3"],
)
def test_the_drive_brakes_by_itself(rig, word, braking, end, seconds):
    """OFF1 and OFF3 show S5 (as S3) while the drive brakes with its own ramp, and end in S2 and S1."""
    rig.operate(1500.0)
    rig.stw1 = word
    started = rig.machine.now_s
    assert rig.shows(braking, 4)
    assert rig.shows(end, 500)
    assert rig.machine.now_s - started == pytest.approx(seconds, abs=5 * rig.cycle_s)
    assert abs(rig.port.actual_speed_rpm) < 15.0


def test_off2_lets_it_coast(rig):
    """OFF2 is S1 at once, and nobody brakes."""
    rig.operate(1500.0)
    rig.stw1 = STW1_OFF2_OFF1
    assert rig.shows(S1, 4)
    assert rig.port.actual_speed_rpm > 1000.0


def test_off2_and_off3_are_shown_as_pending(rig):
    """ZSW1 bits 4 and 5 are 0 as long as the controller withdraws them, 1 otherwise."""
    rig.operate()
    assert rig.port.zsw1 & 0x30 == 0x30
    rig.stw1 = STW1_ALL_OFF
    rig.wait()
    assert rig.port.zsw1 & 0x30 == 0
    rig.stw1 = STW1_IDLE
    assert rig.shows(S2)


def test_a_fault_has_a_number_until_the_edge_of_the_acknowledgement(rig):
    """ZSW1 bit 3 and the number come with the fault; an edge of STW1 bit 7 ends both."""
    rig.operate()
    Injector(rig.machine).inject("drive.fault", code=0x4310)
    assert rig.until(lambda: rig.port.zsw1 & ZSW1.FAULT)
    rig.wait()
    assert rig.port.drive_fault_code
    assert not rig.port.sensor_fault
    rig.stw1 = STW1_IDLE
    rig.wait()
    assert rig.port.zsw1 & ZSW1.FAULT
    rig.stw1 = STW1_IDLE | STW1.ACKNOWLEDGE
    assert rig.until(lambda: not rig.port.zsw1 & ZSW1.FAULT)
    assert rig.port.drive_fault_code == 0
    rig.stw1 = STW1_IDLE
    assert rig.shows(S2)


@pytest.mark.exhaustive
def test_without_supply_there_is_no_link_and_the_count_has_lost_its_reference(rig):
    """A drive without supply: no link, ZSW1 = 0; when it is back an incremental count has started again."""
    rig.operate()
    rig.stw1 = STW1_IDLE
    restarts = rig.port.encoder_restarts
    Injector(rig.machine).inject("drive.power_off", duration_s=0.5)
    assert rig.machine.run_until(lambda: not rig.port.link_ok, 0.4)
    assert rig.port.zsw1 == 0
    assert rig.machine.run_until(lambda: rig.port.link_ok, 3.0)
    assert rig.port.encoder_restarts > restarts
    assert rig.shows(S2)
    kinds = [event.kind for event in rig.machine.history.events if event.source == rig.port.name]
    assert kinds.index("link.down") < len(kinds) - 1 - kinds[::-1].index("link.up")


def test_a_pressed_switch_is_an_input(rig):
    """The switches at the drive are bits of the inputs."""
    assert not rig.port.inputs & INPUT_POSITIVE_LIMIT
    Injector(rig.machine).inject("switch.stuck", input="positive_limit", state=True)
    assert rig.until(lambda: rig.port.inputs & INPUT_POSITIVE_LIMIT)


@pytest.mark.exhaustive
def test_release_disables_the_drive(rig):
    """The last telegram switches off a drive that nobody leads any more."""
    rig.operate(600.0)
    rig.timer.cancel()
    rig.machine.release_drives()
    rig.wait()
    assert not rig.machine.drive().core.enabled
