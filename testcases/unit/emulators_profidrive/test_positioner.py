"""Basic positioner on the true mechanics: blocks, MDI, set-up, jog, homing, limits, and every bit that tells
of them.
"""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from emulators.drive import ServoCore
from emulators.drive.positioner_config import PositionerSettings, TraversingBlock
from emulators.drive.profidrive.positioner.positioner import Mode, Positioner, Refused, Words
from emulators.encoder import IncrementalEncoder
from emulators.mechanics import LinearAxisMechanics
from fieldbus.errors import ConfigurationError
from fieldbus.profidrive.words import POS_STW1, POS_STW2, POS_ZSW1, POS_ZSW2, STW1, ZSW1

STEP_S = 0.00025
CYCLE_S = 0.004
READY = STW1.NO_REJECT_TASK | STW1.NO_INTERMEDIATE_STOP
GO = READY | STW1.ACTIVATE_TASK
MDI = POS_STW1.MDI | POS_STW1.ABSOLUTE
RELATIVE = int(POS_STW1.MDI)
SETUP = POS_STW1.MDI | POS_STW1.SETUP


class Axis:
    """A slide with 10 mm per revolution: one LU is a micrometre; 1000 LU/min are 1/60 mm/s."""

    def __init__(self, **options):
        self.mechanics = LinearAxisMechanics(
            lead_screw_m=0.01,
            motor_inertia_kgm2=2e-4,
            screw_inertia_kgm2=0.5e-4,
            load_mass_kg=40.0,
            coulomb_friction=30.0,
            viscous_friction=30.0,
        )
        self.core = ServoCore(mechanics=self.mechanics, encoder=IncrementalEncoder(), period_s=STEP_S)
        self.core.set_torque_limits(6.0, 6.0)
        self.positioner = Positioner(self.core, PositionerSettings(**options))
        self.core.enable_pulses()
        self.fastest = 0.0
        self.words = Words(stw1=READY, velocity=6_000)

    def run(self, seconds, cams=lambda position: {}, **changes):
        """Let the bus cycle run with changed words; record the greatest speed, mm/s."""
        self.words = self.words._replace(**changes)
        for _ in range(round(seconds / CYCLE_S)):
            self.positioner.step(self.words, **cams(self.position))
            for _ in range(round(CYCLE_S / STEP_S)):
                self.core.step()
            self.fastest = max(self.fastest, abs(self.mechanics.velocity) * 1e3)
        return self

    def home(self):
        """Set the reference point here."""
        self.run(0.02, pos_stw2=self.words.pos_stw2 | POS_STW2.SET_REFERENCE_POINT)
        return self.run(0.02, pos_stw2=self.words.pos_stw2 & ~POS_STW2.SET_REFERENCE_POINT)

    def go(self, seconds, **changes):
        """Give the edge that activates a task."""
        self.run(CYCLE_S, stw1=READY, **changes)
        return self.run(seconds, stw1=GO)

    @property
    def position(self):
        """Place of the slide, LU of the machine."""
        return self.mechanics.position * 1e6

    def shows(self, mask):
        """Return bits of ZSW1."""
        return self.positioner.zsw1 & mask

    def shows_2(self, mask):
        """Return bits of POS_ZSW2."""
        return self.positioner.pos_zsw2 & mask


def rows(**options):
    """Return settings with blocks 1, 2, ..."""
    return {"block": tuple(TraversingBlock(number=n, **one) for n, one in enumerate(options["blocks"], 1))}


# -------------------------------------------------------------------------------------------------------- MDI


@pytest.mark.requirement("PD-051", "PD-070", "PD-072", "PD-088", "PD-090")
def test_mdi_absolute():
    """The edge starts it, bit 12 acknowledges as long as the edge's bit stands, bit 10 comes with the
    target.
    """
    axis = Axis().home()
    assert axis.shows(ZSW1.HOME_POSITION_SET)
    axis.run(CYCLE_S, pos_stw1=MDI, target=50_000)
    assert axis.positioner.mode is Mode.NONE
    axis.go(0.1)
    assert axis.shows(ZSW1.TASK_ACKNOWLEDGED)
    assert not axis.shows(ZSW1.TARGET_REACHED | ZSW1.STANDSTILL)
    assert axis.positioner.pos_zsw1 == POS_ZSW1.MDI
    assert axis.shows_2(POS_ZSW2.FORWARD | POS_ZSW2.BACKWARD) == POS_ZSW2.FORWARD
    assert axis.shows_2(POS_ZSW2.COMMAND_ACTIVE)
    axis.run(0.1, stw1=READY)
    assert not axis.shows(ZSW1.TASK_ACKNOWLEDGED)
    axis.run(1.0)
    assert axis.position == pytest.approx(50_000, abs=20)
    assert axis.shows(ZSW1.TARGET_REACHED)
    assert axis.shows(ZSW1.STANDSTILL)
    assert axis.shows_2(POS_ZSW2.SETPOINT_STANDS)
    assert not axis.shows_2(POS_ZSW2.COMMAND_ACTIVE)
    assert axis.fastest == pytest.approx(100.0, rel=0.01)


@pytest.mark.requirement("PD-074", "PD-075")
def test_acceleration_bits():
    """Bit 14 while the speed grows, bit 15 while it falls, none at constant speed."""
    axis = Axis().home().go(0.06, pos_stw1=MDI, target=50_000)
    assert axis.shows(ZSW1.ACCELERATING | ZSW1.DECELERATING) == ZSW1.ACCELERATING
    axis.run(0.2)
    assert axis.shows(ZSW1.ACCELERATING | ZSW1.DECELERATING) == 0
    axis.run(0.28)
    assert axis.shows(ZSW1.ACCELERATING | ZSW1.DECELERATING) == ZSW1.DECELERATING


@pytest.mark.requirement("PD-088")
def test_mdi_relative_adds_up():
    """Twice the same way, also without a home position; and back."""
    axis = Axis()
    for expected, way in ((10_000, 10_000), (20_000, 10_000), (15_000, -5_000)):
        axis.go(0.8, pos_stw1=RELATIVE, target=way)
        assert axis.position == pytest.approx(expected, abs=20)
        assert axis.shows(ZSW1.TARGET_REACHED)


@pytest.mark.requirement("PD-088")
def test_continuous_take_over():
    """With bit 12 a new target counts at once and without an edge; without it, only with one."""
    axis = Axis().home().go(0.2, pos_stw1=MDI, target=50_000)
    axis.run(1.0, target=20_000)
    assert axis.position == pytest.approx(50_000, abs=20)
    axis.run(0.2, pos_stw1=MDI | POS_STW1.CONTINUOUS, target=100_000)
    axis.run(1.6, target=30_000)
    assert axis.position == pytest.approx(30_000, abs=20)


@pytest.mark.requirement("PD-088", "PD-090")
def test_set_up():
    """By direction bits, at the velocity of the telegram, until neither or both are set."""
    axis = Axis().go(0.6, pos_stw1=SETUP | POS_STW1.POSITIVE)
    assert axis.mechanics.velocity == pytest.approx(0.1, rel=0.01)
    assert axis.positioner.pos_zsw1 == POS_ZSW1.SETUP
    assert not axis.shows(ZSW1.TARGET_REACHED)
    axis.run(0.6, pos_stw1=SETUP | POS_STW1.NEGATIVE)
    assert axis.mechanics.velocity == pytest.approx(-0.1, rel=0.01)
    assert axis.shows_2(POS_ZSW2.BACKWARD)
    axis.run(0.4, pos_stw1=SETUP | POS_STW1.POSITIVE | POS_STW1.NEGATIVE)
    assert axis.shows(ZSW1.STANDSTILL)


@pytest.mark.requirement("PD-039", "PD-040")
@pytest.mark.parametrize(
    ("override", "velocity", "reached_mm_s"),
    [
        (0x4000, 6_000, 100.0),
        (0x2000, 6_000, 50.0),
        (0x7FFF, 6_000, 200.0),
        (0x4000, 60_000, 500.0),
        (0x7FFF, 20_000, 500.0),
    ],
)
def test_override_and_maximum_velocity(override, velocity, reached_mm_s):
    """4000h is 100 %; the maximum velocity holds in any case, and POS_ZSW2 bit 1 says so."""
    axis = Axis().go(0.7, pos_stw1=SETUP | POS_STW1.POSITIVE, override=override, velocity=velocity)
    assert axis.mechanics.velocity * 1e3 == pytest.approx(reached_mm_s, rel=0.01)
    assert bool(axis.shows_2(POS_ZSW2.VELOCITY_LIMITED)) is (reached_mm_s == 500.0)


@pytest.mark.requirement("PD-039")
@pytest.mark.parametrize("override", [0, -1, -0x8000])
def test_override_zero_stops_and_goes_on(override):
    """The task is kept."""
    axis = Axis().home().go(0.2, pos_stw1=MDI, target=50_000)
    axis.run(0.3, override=override)
    assert axis.shows(ZSW1.STANDSTILL)
    assert not axis.shows(ZSW1.TARGET_REACHED)
    axis.run(1.0, override=0x4000)
    assert axis.position == pytest.approx(50_000, abs=20)


@pytest.mark.requirement("PD-040")
def test_acceleration_override():
    """MDI_ACC 2000h is half the maximum: half the speed after the same time."""
    full = Axis().go(0.06, pos_stw1=SETUP | POS_STW1.POSITIVE, velocity=30_000)
    half = Axis().go(0.06, pos_stw1=SETUP | POS_STW1.POSITIVE, velocity=30_000, acceleration=0x2000)
    assert half.core.precontrol_velocity == pytest.approx(full.core.precontrol_velocity / 2)


# ------------------------------------------------------------------------------------ interruption, rejection


@pytest.mark.requirement("PD-050")
def test_intermediate_stop():
    """The axis stands, the task is kept and goes on without an edge."""
    axis = Axis().home().go(0.2, pos_stw1=MDI, target=50_000)
    axis.run(0.3, stw1=GO & ~STW1.NO_INTERMEDIATE_STOP)
    assert axis.shows(ZSW1.STANDSTILL)
    assert axis.shows_2(POS_ZSW2.COMMAND_ACTIVE)
    assert 10_000 < axis.position < 40_000
    axis.run(1.0, stw1=GO)
    assert axis.position == pytest.approx(50_000, abs=20)


@pytest.mark.requirement("PD-049")
def test_rejection():
    """The axis brakes with the maximum deceleration, the task is gone, and setting the bit again starts
    nothing.
    """
    axis = Axis().home().go(0.3, pos_stw1=MDI, target=300_000, deceleration=0x0400)
    start = axis.position
    axis.run(0.2, stw1=GO & ~STW1.NO_REJECT_TASK)
    assert axis.shows(ZSW1.STANDSTILL)
    assert axis.position - start == pytest.approx(5_000, rel=0.15)  # v^2 / 2a at 100 mm/s and 1 m/s^2
    stopped = axis.position
    axis.run(0.5, stw1=GO)
    assert axis.position == pytest.approx(stopped, abs=2)
    assert not axis.shows(ZSW1.TARGET_REACHED)
    assert axis.positioner.mode is Mode.NONE


def test_the_target_bit_in_an_intermediate_stop():
    """Drives that show bit 10 at rest show it in an intermediate stop too, from standstill on, until the task
    goes on.
    """
    for option in (False, True):
        axis = Axis(rest_is_reached=option).home().go(0.2, pos_stw1=MDI, target=50_000)
        axis.run(CYCLE_S, stw1=GO & ~STW1.NO_INTERMEDIATE_STOP)
        assert not axis.shows(ZSW1.TARGET_REACHED)
        axis.run(0.5)
        assert bool(axis.shows(ZSW1.TARGET_REACHED)) is option
        axis.run(CYCLE_S, stw1=GO)
        assert not axis.shows(ZSW1.TARGET_REACHED)
        axis.run(1.0)
        assert axis.position == pytest.approx(50_000, abs=20)


def test_a_velocity_below_zero():
    """A task with a negative velocity stands, or moves with its absolute value, as the drive is set."""
    for option, travels in (("zero", False), ("absolute", True)):
        axis = Axis(negative_velocity=option, rest_is_reached=True).home()
        axis.go(1.0, pos_stw1=MDI, target=5_000, velocity=-6_000)
        assert axis.position == pytest.approx(5_000 if travels else 0, abs=40)
        assert bool(axis.shows(ZSW1.TARGET_REACHED)) is travels


def test_homing_on_the_spot():
    """`home_here`: the start bit sets the reference point where the axis stands; homing shows as active while
    the bit is 1.
    """
    axis = Axis(home_here=True, reference_position=700)
    axis.run(0.1, stw1=READY | STW1.START_HOMING)
    assert axis.shows(ZSW1.HOME_POSITION_SET)
    assert axis.positioner.pos_zsw1 & POS_ZSW1.HOMING
    assert axis.positioner.position == pytest.approx(700, abs=2)
    axis.run(0.1, stw1=READY)
    assert not axis.positioner.pos_zsw1 & POS_ZSW1.HOMING
    assert axis.fastest < 0.1


@pytest.mark.requirement("PD-070")
def test_the_target_bit_of_an_axis_that_rests():
    """Some drives show bit 10 whenever the axis stands without a task: after homing, jog, a rejection; others
    do not.
    """
    for option in (False, True):
        axis = Axis(rest_is_reached=option)
        axis.home()
        assert bool(axis.shows(ZSW1.TARGET_REACHED)) is option
        axis.go(0.2, pos_stw1=MDI, target=50_000)
        assert not axis.shows(ZSW1.TARGET_REACHED)
        axis.run(CYCLE_S, stw1=READY & ~STW1.NO_REJECT_TASK)
        assert not axis.shows(ZSW1.TARGET_REACHED)  # it brakes
        axis.run(1.0)
        assert bool(axis.shows(ZSW1.TARGET_REACHED)) is option
        axis.run(0.1, stw1=READY | STW1.JOG_1)
        assert not axis.shows(ZSW1.TARGET_REACHED)
        axis.run(1.0, stw1=READY)
        assert bool(axis.shows(ZSW1.TARGET_REACHED)) is option


@pytest.mark.requirement("PD-049", "PD-051")
def test_an_edge_while_rejecting_is_lost():
    """The edge needs bit 4."""
    axis = Axis().home().run(CYCLE_S, stw1=0, pos_stw1=MDI, target=50_000)
    axis.run(0.1, stw1=STW1.ACTIVATE_TASK | STW1.NO_INTERMEDIATE_STOP)
    axis.run(0.3, stw1=GO)
    assert abs(axis.position) < 20
    assert not axis.shows(ZSW1.TASK_ACKNOWLEDGED)


def test_pulse_inhibit_ends_the_task():
    """After the pulses were taken away nothing moves without a new edge."""
    axis = Axis().home().go(0.1, pos_stw1=MDI, target=50_000)
    axis.core.inhibit_pulses()
    axis.run(1.5)
    assert axis.shows(ZSW1.STANDSTILL)
    axis.core.enable_pulses()
    stopped = axis.position
    axis.run(0.5)
    assert axis.position == pytest.approx(stopped, abs=5)
    axis.go(1.0)
    assert axis.position == pytest.approx(50_000, abs=20)


def test_a_stop_of_the_drive_in_between_is_made_good():
    """A ramp stop that was taken back leaves the task to go on."""
    axis = Axis().home().go(0.2, pos_stw1=MDI, target=50_000)
    axis.core.stop(1e4)
    for _ in range(400):
        axis.core.step()
    axis.run(1.5)
    assert axis.position == pytest.approx(50_000, abs=20)


# ----------------------------------------------------------------------------------------------------- blocks


@pytest.mark.requirement("PD-086", "PD-087", "PD-088", "PD-090")
def test_blocks_follow_each_other():
    """Continued with stop, flying and to the end; the block in work is shown."""
    axis = Axis(
        **rows(
            blocks=[
                {"position": 20_000, "velocity": 6_000, "continuation": "continue with stop"},
                {
                    "task": "relative",
                    "position": 30_000,
                    "velocity": 9_000,
                    "continuation": "continue flying",
                },
                {"position": 80_000, "velocity": 3_000},
            ]
        )
    ).home()
    seen, speeds = [], {}
    axis.go(CYCLE_S, pos_stw1=1)
    for _ in range(500):
        axis.run(CYCLE_S)
        number = axis.positioner.pos_zsw1 & 0x7F
        if not seen or seen[-1] != number:
            seen.append(number)
            speeds[number] = axis.mechanics.velocity * 1e3
        assert axis.positioner.aktsatz == number
    assert seen == [1, 2, 3]
    assert axis.positioner.pos_zsw1 & POS_ZSW1.BLOCKS
    assert axis.position == pytest.approx(80_000, abs=20)
    assert axis.shows(ZSW1.TARGET_REACHED)
    assert speeds[2] < 5.0  # with stop
    assert speeds[3] == pytest.approx(50.0, rel=0.05)  # flying: at the lower speed of the two


@pytest.mark.requirement("PD-057")
def test_external_block_change():
    """The edge of bit 13 changes on the way; without it the axis waits at the target."""
    blocks = [
        {"task": "endless positive", "velocity": 6_000, "continuation": "continue external"},
        {"position": -20_000, "velocity": 6_000, "continuation": "continue external"},
        {"position": 5_000, "velocity": 6_000},
    ]
    axis = Axis(**rows(blocks=blocks)).home().go(0.5, pos_stw1=1)
    assert axis.mechanics.velocity == pytest.approx(0.1, rel=0.01)
    axis.run(1.5, stw1=GO | STW1.EXTERNAL_BLOCK_CHANGE)
    assert axis.position == pytest.approx(-20_000, abs=20)
    assert axis.positioner.aktsatz == 2
    axis.run(0.1, stw1=GO)
    axis.run(1.0, stw1=GO | STW1.EXTERNAL_BLOCK_CHANGE)
    assert axis.position == pytest.approx(5_000, abs=20)


@pytest.mark.requirement("PD-086", "PD-092")
@pytest.mark.parametrize(
    ("satzanw", "mdi_mod", "pos_stw1"),
    [(0x0005, 0, 5), (0x8000, 0, 0x8000), (0x8000, 1, 0x8100), (0xFFFF, 1, 0x817F)],
)
def test_satzanw(satzanw, mdi_mod, pos_stw1):
    """Block number and MDI; absolute by MDI_MOD."""
    assert Positioner.words_of_satzanw(satzanw, mdi_mod) == pos_stw1


# -------------------------------------------------------------------------------------------------------- jog


@pytest.mark.requirement("PD-053", "PD-089", "PD-090")
@pytest.mark.parametrize(("bit", "sign"), [(STW1.JOG_1, -1), (STW1.JOG_2, 1)])
def test_jog(bit, sign):
    """As long as the bit stands."""
    axis = Axis().run(0.3, stw1=READY | bit)
    assert axis.mechanics.velocity * 1e3 == pytest.approx(sign * 5.0, rel=0.02)
    assert axis.positioner.pos_zsw1 == POS_ZSW1.JOG
    axis.run(0.2, stw1=READY)
    assert axis.shows(ZSW1.STANDSTILL)
    assert axis.positioner.pos_zsw1 == 0


@pytest.mark.requirement("PD-053")
def test_both_jog_bits_stand():
    """A contradiction stops the axis."""
    axis = Axis().run(0.3, stw1=READY | STW1.JOG_1).run(0.2, stw1=READY | STW1.JOG_1 | STW1.JOG_2)
    assert axis.shows(ZSW1.STANDSTILL)


@pytest.mark.requirement("PD-089")
def test_incremental_jog():
    """One increment per edge; letting go early stops early."""
    axis = Axis()
    for expected in (1_000, 2_000):
        axis.run(0.6, stw1=READY | STW1.JOG_2, pos_stw2=POS_STW2.INCREMENTAL_JOG)
        assert axis.position == pytest.approx(expected, abs=10)
        axis.run(0.1, stw1=READY)
    axis.run(0.1, stw1=READY | STW1.JOG_1).run(0.3, stw1=READY)
    assert 1_100 < axis.position < 1_900


# ----------------------------------------------------------------------------------------------------- homing


@pytest.mark.requirement("PD-055", "PD-071", "PD-089", "PD-090")
@pytest.mark.parametrize(("sign", "start_on_cam"), [(1, False), (-1, False), (1, True)])
def test_homing_on_cam_and_zero_mark(sign, start_on_cam):
    """To the cam, back off it, next zero mark, reference point: its place does not depend on the start."""
    axis = Axis(reference_position=7_000, reference_offset=1_500, cam_velocity=3_000)
    edge = -5_000 if start_on_cam else 23_000
    search = 0 if sign > 0 else POS_STW2.SEARCH_NEGATIVE

    def on_cam():
        return axis.position * sign >= edge

    axis.run(CYCLE_S, stw1=READY)
    for _ in range(1_500):
        axis.run(
            CYCLE_S,
            stw1=READY | STW1.START_HOMING,
            pos_stw2=search | (POS_STW2.REFERENCE_CAM if on_cam() else 0),
        )
        if axis.positioner.homed:
            break
        assert axis.positioner.pos_zsw1 == POS_ZSW1.HOMING
    axis.run(0.1)
    assert axis.shows(ZSW1.HOME_POSITION_SET)
    # The next mark off the cam: marks stand every 10 000 LU.
    mark = -10_000 if start_on_cam else 20_000 * sign
    assert axis.position == pytest.approx(mark + 1_500, abs=20)
    assert axis.positioner.position == pytest.approx(7_000, abs=20)
    assert axis.positioner.pos_zsw1 == 0


@pytest.mark.requirement("PD-055", "PD-071")
def test_homing_without_cam_and_interrupted():
    """Without cam the next mark in the search direction; taking the bit away stops, and there is no home
    position.
    """
    axis = Axis(has_cam=False)
    axis.run(0.5, stw1=READY | STW1.START_HOMING)
    axis.run(0.3, stw1=READY)
    assert axis.shows(ZSW1.STANDSTILL)
    assert not axis.shows(ZSW1.HOME_POSITION_SET)
    assert 1_000 < axis.position < 9_000
    axis.run(3.0, stw1=READY | STW1.START_HOMING)
    assert axis.shows(ZSW1.HOME_POSITION_SET)
    assert axis.position == pytest.approx(10_000, abs=20)


@pytest.mark.requirement("PD-089", "PD-071")
def test_set_reference_point():
    """The present position gets the reference position; nothing moves, not even after a task."""
    axis = Axis(reference_position=100_000).go(0.6, pos_stw1=RELATIVE, target=10_000).home()
    assert axis.positioner.position == pytest.approx(100_000, abs=2)
    axis.run(0.3)
    assert axis.position == pytest.approx(10_000, abs=20)


# ----------------------------------------------------------------------------------------------------- limits


@pytest.mark.requirement("PD-089", "PD-091")
@pytest.mark.parametrize(
    ("target", "refused"), [(50_001, Refused.TARGET_ABOVE_LIMIT), (-30_001, Refused.TARGET_BELOW_LIMIT)]
)
def test_a_target_beyond_the_software_limits_is_refused(target, refused):
    """Without acknowledgement and without a motion; with the limits off it is accepted."""
    axis = Axis(software_limits=(-30_000, 50_000)).home()
    axis.go(0.3, pos_stw1=MDI, pos_stw2=int(POS_STW2.SOFTWARE_LIMITS), target=target)
    assert axis.positioner.refused is refused
    assert not axis.shows(ZSW1.TASK_ACKNOWLEDGED)
    assert abs(axis.position) < 20
    axis.go(1.5, pos_stw2=0)
    assert axis.positioner.refused is None
    assert axis.position == pytest.approx(target, abs=20)


@pytest.mark.requirement("PD-089", "PD-091")
@pytest.mark.parametrize(
    ("direction", "limit", "bit"),
    [
        (POS_STW1.POSITIVE, 50_000, POS_ZSW2.SOFTWARE_LIMIT_PLUS),
        (POS_STW1.NEGATIVE, -30_000, POS_ZSW2.SOFTWARE_LIMIT_MINUS),
    ],
)
def test_set_up_ends_at_the_software_limit(direction, limit, bit):
    """It brakes in time; the bit of the limit comes on."""
    axis = Axis(software_limits=(-30_000, 50_000)).home()
    axis.go(1.2, pos_stw1=SETUP | direction, pos_stw2=int(POS_STW2.SOFTWARE_LIMITS))
    assert axis.position == pytest.approx(limit, abs=20)
    assert axis.shows_2(POS_ZSW2.SOFTWARE_LIMIT_PLUS | POS_ZSW2.SOFTWARE_LIMIT_MINUS) == bit


def test_without_home_position_there_is_no_absolute_task():
    """Nor are there software limits."""
    axis = Axis(software_limits=(-1_000, 1_000)).go(0.2, pos_stw1=MDI, target=500)
    assert axis.positioner.refused is Refused.NOT_HOMED
    axis.go(0.8, pos_stw1=RELATIVE, target=5_000, pos_stw2=int(POS_STW2.SOFTWARE_LIMITS))
    assert axis.position == pytest.approx(5_000, abs=20)


def test_a_block_that_does_not_exist_is_refused():
    """And one without a successor ends the run of blocks."""
    axis = Axis(
        **rows(blocks=[{"task": "relative", "position": 2_000, "continuation": "continue with stop"}])
    )
    axis.go(0.1, pos_stw1=9)
    assert axis.positioner.refused is Refused.NO_SUCH_BLOCK
    axis.go(1.0, pos_stw1=1)
    assert axis.position == pytest.approx(2_000, abs=20)
    assert axis.positioner.refused is Refused.NO_SUCCESSOR


@pytest.mark.requirement("PD-089", "PD-090")
def test_limit_cams():
    """A cam stops the motion into it; out of it the axis can go."""
    axis = Axis()
    cams = lambda position: {"plus_cam": position > 20_000}  # noqa: E731
    axis.run(CYCLE_S, cams, pos_stw1=SETUP | POS_STW1.POSITIVE, pos_stw2=int(POS_STW2.LIMIT_CAMS))
    axis.run(0.8, cams, stw1=GO)
    assert axis.positioner.refused is Refused.PLUS_CAM
    assert axis.positioner.pos_zsw1 & POS_ZSW1.PLUS_CAM
    assert 20_000 < axis.position < 26_000
    axis.run(CYCLE_S, cams, stw1=READY).run(0.3, cams, stw1=GO)
    assert axis.shows(ZSW1.STANDSTILL)
    axis.run(CYCLE_S, cams, stw1=READY, pos_stw1=SETUP | POS_STW1.NEGATIVE).run(0.8, cams, stw1=GO)
    assert axis.position < 10_000
    assert axis.positioner.refused is None


@pytest.mark.requirement("PD-091")
def test_position_cams():
    """Bits 8 and 9: position at or below the cam."""
    axis = Axis(position_cams=(5_000, -5_000)).home()
    assert axis.shows_2(POS_ZSW2.CAM_1 | POS_ZSW2.CAM_2) == POS_ZSW2.CAM_1
    axis.go(0.6, pos_stw1=MDI, target=6_000)
    assert axis.shows_2(POS_ZSW2.CAM_1 | POS_ZSW2.CAM_2) == 0
    axis.go(0.6, target=-6_000)
    assert axis.shows_2(POS_ZSW2.CAM_1 | POS_ZSW2.CAM_2) == POS_ZSW2.CAM_1 | POS_ZSW2.CAM_2


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ({"lu_per_revolution": 0}, "lu_per_revolution"),
        ({"software_limits": (5, 5)}, "software_limits"),
        ({"jog_velocities": (0.0, 1.0)}, "jog"),
        ({"block": (TraversingBlock(number=1), TraversingBlock(number=1))}, "block"),
    ],
)
def test_wrong_settings_are_refused(options, named):
    """The message names the setting."""
    with pytest.raises(ConfigurationError, match=named):
        PositionerSettings(**options)


def test_an_endless_block_cannot_wait_for_its_target():
    """Nor can an override be 0, or a number be above 63."""
    with pytest.raises(ConfigurationError, match="continuation"):
        TraversingBlock(number=1, task="endless positive", continuation="continue with stop")
    with pytest.raises(ConfigurationError, match="acceleration"):
        TraversingBlock(number=1, acceleration_percent=0)
    with pytest.raises(ConfigurationError, match="number"):
        TraversingBlock(number=64)


def test_a_rejection_makes_a_stop_in_progress_steeper():
    """The intermediate stop brakes as the task says, here with 5 % of the maximum; the rejection that follows
    with all of it.
    """
    axis = Axis().home().go(0.4, pos_stw1=MDI, target=500_000, deceleration=0x4000 // 20)
    axis.run(0.1, stw1=GO & ~STW1.NO_INTERMEDIATE_STOP)
    assert axis.mechanics.velocity > 0.09
    axis.run(0.2, stw1=0)
    assert axis.shows_2(POS_ZSW2.SETPOINT_STANDS)


WORD = st.sampled_from([0, 1, 0x2000, 0x4000, 0x7FFF, -1, -0x8000])
INT32 = st.sampled_from([0, 1, 20_000, -20_000, 0x7FFF_FFFF, -0x8000_0000])
ANY = st.tuples(
    st.sampled_from([READY, GO, GO | STW1.START_HOMING, READY | STW1.JOG_1, READY | STW1.JOG_2, 0])
    | st.integers(0, 0xFFFF),
    st.sampled_from([1, 2, 9, int(MDI), RELATIVE, SETUP | POS_STW1.POSITIVE]) | st.integers(0, 0xFFFF),
    st.sampled_from([0, int(POS_STW2.SOFTWARE_LIMITS), int(POS_STW2.SET_REFERENCE_POINT)])
    | st.integers(0, 0xFFFF),
    WORD,
    INT32,
    INT32,
    WORD,
    WORD,
    st.integers(1, 20),
    st.booleans(),
    st.booleans(),
)


@pytest.mark.exhaustive
@settings(max_examples=150, derandomize=True, deadline=None)
@given(st.lists(ANY, min_size=1, max_size=10))
def test_any_words_are_lived_with(course):
    """Whatever comes: finite demands within the maximum velocity; then a rejection ends in standstill and a
    task works.
    """
    axis = Axis(
        software_limits=(-100_000, 100_000),
        **rows(
            blocks=[
                {"task": "relative", "position": 9_000, "continuation": "continue flying"},
                {"task": "endless negative", "continuation": "continue external"},
            ]
        ),
    )
    fastest = 0.5 / 0.01 * 6.2832
    for *values, cycles, minus_cam, plus_cam in course:
        for _ in range(cycles):
            axis.positioner.step(Words(*values), minus_cam=minus_cam, plus_cam=plus_cam)
            for _ in range(16):
                axis.core.step()
            assert abs(axis.core.precontrol_velocity) <= fastest * 1.001
            assert all(
                0 <= word <= 0xFFFF
                for word in (axis.positioner.zsw1, axis.positioner.pos_zsw1, axis.positioner.pos_zsw2)
            )
    axis.run(1.0, stw1=0, pos_stw1=0, pos_stw2=0)
    assert axis.shows_2(POS_ZSW2.SETPOINT_STANDS)
    start = axis.position
    axis.go(0.6, pos_stw1=RELATIVE, target=10_000, override=0x4000)
    assert axis.shows(ZSW1.TARGET_REACHED)
    assert axis.position == pytest.approx(start + 10_000, abs=60)
