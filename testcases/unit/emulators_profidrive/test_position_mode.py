"""The positioner behind the telegrams 7, 9, 110, 111 and 112 of the drive: state machine, words, faults,
exclusiveness.
"""

from __future__ import annotations

from dataclasses import replace

import pytest

from emulators.drive.positioner_config import PositionerSettings, TraversingBlock
from emulators.drive.profidrive import AxisState, DriveSettings, ProfidriveConfig
from emulators.drive.profidrive.config import POSITION_TELEGRAMS
from fieldbus.errors import ConfigurationError
from fieldbus.profidrive.words import MELDW, POS_STW1, POS_STW2, POS_ZSW1, POS_ZSW2, STW1, ZSW1
from testcases.unit.emulators_profidrive.profidrive_rig import Rig

READY = 0x047E | STW1.NO_REJECT_TASK | STW1.NO_INTERMEDIATE_STOP
READY &= ~STW1.ACTIVATE_TASK
RUN = READY | STW1.ON
GO = RUN | STW1.ACTIVATE_TASK
MDI = POS_STW1.MDI | POS_STW1.ABSOLUTE
FULL = {"OVERRIDE": 0x4000, "MDI_ACC": 0x4000, "MDI_DEC": 0x4000}


class PositionRig(Rig):
    """A slide with 10 mm per revolution: one LU is a micrometre, 6000 (1000 LU/min) are 100 mm/s."""

    def __init__(self, telegram=111, *, quick_stop_s=0.5, **positioner):
        config = ProfidriveConfig.reference()
        config = replace(
            config,
            telegram=telegram,
            settings=DriveSettings(operating_mode=2, ramp_down_s=1.0, quick_stop_s=quick_stop_s),
            positioner=PositionerSettings(**positioner),
        )
        super().__init__(config)
        self.signals = {
            name: value for name, value in FULL.items() if name in self.drive.telegram.setpoint.names
        }

    def run(self, stw1, seconds=0.02, **signals):
        """Let the controller send these signals on; returns the last answer."""
        self.signals.update(signals)
        return self.cycle(stw1, count=max(1, round(seconds * 1e9 / self.config.cycle_ns)), **self.signals)

    def enable_axis(self):
        """Bring the drive into operation and make the present position the reference point."""
        self.run(READY)
        self.run(RUN)
        assert self.drive.state is AxisState.S4
        return self

    def home(self):
        """Set the reference point here, through the telegram."""
        name = "POS_STW2" if "POS_STW2" in self.signals_known else "POS_STW"
        before = self.signals.get(name, 0)
        answer = self.run(RUN, **{name: before | POS_STW2.SET_REFERENCE_POINT})
        assert answer.get("POS_ZSW1", POS_ZSW1.HOMING) & POS_ZSW1.HOMING
        return self.run(RUN, **{name: before})

    @property
    def signals_known(self):
        """Names of the setpoint signals."""
        return self.drive.telegram.setpoint.names

    def go(self, seconds, **signals):
        """Give the edge that activates a task, and let it run."""
        self.run(RUN, **signals)
        return self.run(GO, seconds)

    @property
    def place_um(self):
        """Place of the slide in the machine."""
        return self.drive.mechanics.position * 1e6


@pytest.mark.requirement("PD-019", "PD-051", "PD-070", "PD-071", "PD-072", "PD-073", "PD-088", "PD-090")
def test_telegram_111_moves_to_a_position():
    """Enable, reference point, MDI absolute: acknowledged, on the way, reached; the words of every step."""
    rig = PositionRig()
    rig.enable_axis()
    assert rig.home()["ZSW1"] & ZSW1.HOME_POSITION_SET
    answer = rig.go(0.2, POS_STW1=MDI, MDI_TARPOS=50_000, MDI_VELOCITY=6_000)
    assert answer["ZSW1"] & ZSW1.TASK_ACKNOWLEDGED
    assert not answer["ZSW1"] & (ZSW1.TARGET_REACHED | ZSW1.STANDSTILL)
    assert answer["POS_ZSW1"] == POS_ZSW1.MDI
    assert answer["POS_ZSW2"] & POS_ZSW2.FORWARD
    assert answer["POS_ZSW2"] & POS_ZSW2.COMMAND_ACTIVE
    assert answer["NIST_B"] / 0x4000_0000 * 3000 == pytest.approx(600.0, rel=0.02)
    answer = rig.run(GO, 0.6)
    assert answer["XIST_A"] == pytest.approx(50_000, abs=5)
    assert rig.place_um == pytest.approx(50_000, abs=20)
    assert answer["ZSW1"] & 0x0047 == 0x0007
    assert answer["ZSW1"] & (ZSW1.TARGET_REACHED | ZSW1.STANDSTILL) == ZSW1.TARGET_REACHED | ZSW1.STANDSTILL
    assert answer["MELDW"] & (MELDW.CONTROLLER_ENABLED | MELDW.PULSES_ENABLED)
    assert (answer["FAULT_CODE"], answer["WARN_CODE"]) == (0, 0)
    assert not rig.run(RUN)["ZSW1"] & ZSW1.TASK_ACKNOWLEDGED


@pytest.mark.requirement("PD-018", "PD-086", "PD-087", "PD-092")
def test_telegram_110():
    """SATZANW and MDI_MOD in place of POS_STW1, POS_STW and POS_ZSW in place of the second words."""
    rig = PositionRig(110)
    rig.enable_axis()
    rig.home()
    answer = rig.go(0.3, SATZANW=0x8000, MDI_MOD=1, MDI_TARPOS=-50_000, MDI_VELOCITY=6_000)
    assert answer["AKTSATZ"] == 0x8000
    assert answer["POS_ZSW"] & POS_ZSW2.BACKWARD
    answer = rig.run(GO, 0.6)
    assert answer["XIST_A"] == pytest.approx(-50_000, abs=5)
    rig.go(0.6, MDI_MOD=0, MDI_TARPOS=10_000)
    assert rig.place_um == pytest.approx(-40_000, abs=20)


@pytest.mark.requirement("PD-008", "PD-040")
def test_telegram_9():
    """MDI by SATZANW; acceleration and deceleration as shares of p2572 and p2573."""
    rig = PositionRig(9, max_acceleration=1_000.0)
    rig.enable_axis()
    rig.go(0.1, SATZANW=0x8000, MDI_TARPOS=100_000, MDI_VELOCITY=30_000, MDI_ACC=0x1000, MDI_DEC=0x1000)
    # 25 % of 1000 * 1000 LU/s^2 for 0.1 s: 25 mm/s
    assert rig.drive.mechanics.velocity == pytest.approx(0.025, rel=0.1)
    answer = rig.run(GO, 2.0)
    assert answer["XIST_A"] == pytest.approx(100_000, abs=5)


@pytest.mark.requirement("PD-007", "PD-086", "PD-087")
def test_telegram_7():
    """Blocks by number, and nothing else: two words."""
    rig = PositionRig(
        7, block=(TraversingBlock(number=3, position=20_000, velocity=6_000),), reference_position=5_000
    )
    rig.enable_axis()
    rig.drive.mode.positioner.set_reference_point()
    answer = rig.go(0.1, SATZANW=3)
    assert answer["AKTSATZ"] == 3
    answer = rig.run(GO, 0.6)
    assert answer["ZSW1"] & ZSW1.TARGET_REACHED
    assert rig.place_um == pytest.approx(15_000, abs=20)


@pytest.mark.requirement("PD-020")
def test_telegram_112():
    """Physical units in 32 bits: acceleration and deceleration in 1000 LU/s^2, actual velocity in 1000
    LU/min.
    """
    rig = PositionRig(112, max_acceleration=1_000.0)
    rig.enable_axis()
    rig.run(RUN, OVERRIDE=0x4000, MDI_ACC_32=250, MDI_DEC_32=500)
    rig.go(0.1, POS_STW1=POS_STW1.MDI, MDI_TARPOS=100_000, MDI_VELOCITY=6_000)
    assert rig.drive.mechanics.velocity == pytest.approx(0.025, rel=0.1)
    answer = rig.run(GO, 0.5)
    assert answer["VIST_A"] == pytest.approx(6_000, rel=0.02)
    answer = rig.run(GO, 1.5)
    assert answer["XIST_A"] == pytest.approx(100_000, abs=5)


@pytest.mark.requirement("PD-039")
@pytest.mark.parametrize(("override", "mm_s"), [(0x2000, 50.0), (0x7FFF, 200.0), (0, 0.0), (-1, 0.0)])
def test_override(override, mm_s):
    """4000h is 100 %, up to just below 200 %; what is negative counts as 0 and keeps the task."""
    rig = PositionRig()
    rig.enable_axis()
    setup = POS_STW1.MDI | POS_STW1.SETUP | POS_STW1.POSITIVE
    answer = rig.go(0.5, POS_STW1=setup, MDI_VELOCITY=6_000, OVERRIDE=override)
    assert rig.drive.mechanics.velocity * 1e3 == pytest.approx(mm_s, rel=0.02, abs=0.1)
    assert answer["POS_ZSW1"] == POS_ZSW1.SETUP


@pytest.mark.requirement("PD-049", "PD-050")
@pytest.mark.parametrize("bit", [STW1.NO_INTERMEDIATE_STOP, STW1.NO_REJECT_TASK])
def test_intermediate_stop_keeps_the_task_and_rejection_ends_it(bit):
    """Both brake; after the one the axis goes on to its target, after the other it stays."""
    rig = PositionRig()
    rig.enable_axis()
    rig.home()
    rig.go(0.3, POS_STW1=MDI, MDI_TARPOS=60_000, MDI_VELOCITY=6_000)
    answer = rig.run(GO & ~bit, 0.4)
    assert answer["ZSW1"] & ZSW1.STANDSTILL
    assert answer["ZSW1"] & 0x0007 == 7
    stopped = rig.place_um
    rig.run(GO, 1.0)
    target = 60_000 if bit == STW1.NO_INTERMEDIATE_STOP else stopped
    assert rig.place_um == pytest.approx(target, abs=20)


@pytest.mark.exhaustive
@pytest.mark.requirement("PD-106", "PD-111", "PD-116")
def test_off1_brakes_with_its_ramp_and_can_be_taken_back():
    """S5 brakes with p1121, not with the task; ON in between goes on to the target."""
    rig = PositionRig()
    rig.enable_axis()
    rig.home()
    rig.go(0.6, POS_STW1=MDI, MDI_TARPOS=300_000, MDI_VELOCITY=30_000)
    before = rig.drive.core.speed_rpm
    assert before == pytest.approx(3000, rel=0.05)
    rig.run(GO & ~STW1.ON, 0.1)
    assert rig.drive.state is AxisState.S5A
    assert rig.drive.core.speed_rpm == pytest.approx(before - 300.0, rel=0.05)
    rig.run(GO, 2.0)
    assert rig.place_um == pytest.approx(300_000, abs=20)
    rig.go(0.3, MDI_TARPOS=0)
    assert rig.time_until(READY, AxisState.S2, **rig.signals) < 1.1
    stopped = rig.place_um
    rig.run(RUN, 0.3)
    assert rig.place_um == pytest.approx(stopped, abs=5)


@pytest.mark.requirement("PD-043", "PD-067")
@pytest.mark.parametrize(
    ("signals", "number"),
    [
        ({"POS_STW1": MDI, "MDI_TARPOS": 50_000}, 7461),
        ({"POS_STW1": 9}, 7462),
    ],
)
def test_a_refused_task_is_a_warning(signals, number):
    """WARN_CODE shows it as long as the request stands; there is neither acknowledgement nor motion nor
    fault.
    """
    rig = PositionRig()
    rig.enable_axis()
    answer = rig.go(0.3, MDI_VELOCITY=6_000, **signals)
    assert (answer["WARN_CODE"], answer["FAULT_CODE"]) == (number, 0)
    assert answer["ZSW1"] & (ZSW1.WARNING | ZSW1.FAULT | ZSW1.TASK_ACKNOWLEDGED) == ZSW1.WARNING
    assert abs(rig.place_um) < 5
    answer = rig.run(RUN)
    assert answer["WARN_CODE"] == 0
    assert not answer["ZSW1"] & ZSW1.WARNING


def test_a_refused_task_can_be_a_fault():
    """With `refused_task = "fault"` the drive trips under the number of the warning, brakes with OFF1, and
    can be acknowledged.
    """
    rig = PositionRig(refused_task="fault")
    rig.enable_axis()
    answer = rig.go(0.3, MDI_VELOCITY=6_000, POS_STW1=9)
    assert (answer["WARN_CODE"], answer["FAULT_CODE"]) == (0, 7462)
    assert answer["ZSW1"] & (ZSW1.WARNING | ZSW1.FAULT | ZSW1.TASK_ACKNOWLEDGED) == ZSW1.FAULT
    assert rig.drive.state is not AxisState.S4
    answer = rig.run(READY | 0x80, 0.1)
    assert not answer["ZSW1"] & ZSW1.FAULT


@pytest.mark.requirement("PD-089", "PD-091")
def test_software_limits():
    """A target beyond them is refused with a warning; set-up ends at them and says so."""
    rig = PositionRig(software_limits=(-20_000, 20_000))
    rig.enable_axis()
    rig.home()
    answer = rig.go(
        0.2, POS_STW1=MDI, POS_STW2=POS_STW2.SOFTWARE_LIMITS, MDI_TARPOS=20_001, MDI_VELOCITY=6_000
    )
    assert answer["WARN_CODE"] == 7470
    answer = rig.go(0.8, POS_STW1=POS_STW1.MDI | POS_STW1.SETUP | POS_STW1.NEGATIVE)
    assert answer["POS_ZSW2"] & POS_ZSW2.SOFTWARE_LIMIT_MINUS
    assert rig.place_um == pytest.approx(-20_000, abs=20)


@pytest.mark.exhaustive
@pytest.mark.requirement("PD-089", "PD-090", "PD-043")
def test_limit_cams_are_the_limit_switches():
    """The axis stops on the switch with F07492 and its quick stop; it can only leave in the other
    direction.
    """
    rig = PositionRig(quick_stop_s=0.1)
    rig.enable_axis()
    setup = POS_STW1.MDI | POS_STW1.SETUP
    rig.run(RUN, POS_STW2=POS_STW2.LIMIT_CAMS, MDI_VELOCITY=30_000)
    rig.go(1.6, POS_STW1=setup | POS_STW1.POSITIVE)
    answer = rig.actual
    assert answer["FAULT_CODE"] == 7492
    assert answer["POS_ZSW1"] & POS_ZSW1.PLUS_CAM
    assert rig.drive.state is AxisState.S1
    assert 550_000 < rig.place_um < 600_000
    for direction, number in ((POS_STW1.POSITIVE, 7492), (POS_STW1.NEGATIVE, 0)):
        rig.run(READY | STW1.ACKNOWLEDGE, POS_STW1=setup | direction)
        rig.enable_axis()
        stood = rig.place_um
        answer = rig.go(0.3)
        assert answer["FAULT_CODE"] == number
        assert (rig.place_um < stood - 1000) is (direction == POS_STW1.NEGATIVE)
        assert rig.place_um < stood + 10


@pytest.mark.requirement("PD-068")
def test_a_following_error_is_a_fault():
    """A slide that is held leaves its demand behind by more than p2546: ZSW1 bit 8 goes, F07452 with OFF1."""
    rig = PositionRig(following_tolerance=1_000.0)
    rig.enable_axis()
    assert rig.actual["ZSW1"] & ZSW1.DEVIATION_IN_TOLERANCE
    rig.drive.mechanics.jam(True)
    answer = rig.go(1.0, POS_STW1=POS_STW1.MDI, MDI_TARPOS=50_000, MDI_VELOCITY=6_000)
    assert answer["FAULT_CODE"] == 7452
    assert not rig.drive.core.enabled


@pytest.mark.exhaustive
@pytest.mark.requirement("PD-055", "PD-071", "PD-089")
def test_homing_on_the_home_switch():
    """Without a bit for the cam in the telegram the home switch of the machine is the cam; p2604 tells the
    direction.
    """
    rig = PositionRig(
        search_negative=True, cam_velocity=6_000.0, mark_velocity=3_000.0, reference_position=1_000
    )
    rig.enable_axis()
    rig.run(RUN | STW1.START_HOMING, 0.5)
    assert rig.actual["POS_ZSW1"] == POS_ZSW1.HOMING
    for _ in range(80):
        if rig.run(RUN | STW1.START_HOMING, 0.1)["ZSW1"] & ZSW1.HOME_POSITION_SET:
            break
    rig.run(RUN)
    assert rig.actual["XIST_A"] == pytest.approx(1_000, abs=20)
    assert rig.place_um == pytest.approx(-490_000, abs=20)


def test_power_off_forgets_the_home_position_of_an_incremental_encoder():
    """An absolute encoder keeps it."""
    for kind, homed in (("incremental", False), ("absolute", True)):
        rig = PositionRig()
        config = replace(
            rig.config, encoder=replace(rig.config.encoder, kind=kind), fine_resolution_bits=7, fine_xist2=7
        )
        Rig.__init__(rig, config)
        rig.enable_axis()
        rig.home()
        assert rig.run(RUN)["ZSW1"] & ZSW1.HOME_POSITION_SET
        rig.drive.power_off()
        rig.drive.power_on()
        rig.enable_axis()
        assert bool(rig.actual["ZSW1"] & ZSW1.HOME_POSITION_SET) is homed


@pytest.mark.requirement("PD-032", "PD-121")
@pytest.mark.parametrize(("telegram", "mode"), [(111, 3), (7, 1), (105, 2), (1, 2)])
def test_speed_and_position_exclude_each_other(telegram, mode):
    """A telegram of the positioner goes with operating mode 2, and no other does."""
    with pytest.raises(ConfigurationError, match="930"):
        ProfidriveConfig(telegram=telegram, settings=DriveSettings(operating_mode=mode))


@pytest.mark.parametrize("telegram", POSITION_TELEGRAMS)
def test_a_positioning_telegram_needs_no_sign_of_life(telegram):
    """The controller of a positioner is no clock: STW2 may be 0; isochronous operation can be asked for."""
    rig = PositionRig(telegram)
    rig.sends_sign = False
    rig.enable_axis()
    assert not rig.drive.isochronous
