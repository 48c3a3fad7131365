"""Further functions of the basic positioner in the drive: tracking, passive homing, modulo, blocks that do
not move, monitoring, parameters.
"""

from __future__ import annotations

from dataclasses import replace

import pytest

from emulators.drive.positioner_config import TraversingBlock
from emulators.drive.profidrive import AxisState, DriveParameters
from fieldbus.errors import ConfigurationError
from fieldbus.profidrive.errors import ParameterAccessError
from fieldbus.profidrive.words import POS_STW1, POS_STW2, POS_ZSW1, POS_ZSW2, STW1, ZSW1
from testcases.unit.emulators_profidrive.profidrive_rig import Rig
from testcases.unit.emulators_profidrive.test_position_mode import GO, MDI, READY, RUN, PositionRig

MOVE = TraversingBlock(number=1, position=10_000, velocity=6_000, continuation="continue with stop")


def ready(rig):
    """Enable the axis and set its reference point."""
    rig.enable_axis()
    rig.home()
    return rig


# --------------------------------------------------------------------------------------------------- tracking


@pytest.mark.exhaustive
@pytest.mark.requirement("PD-089", "PD-091")
def test_tracking_lets_the_demand_follow_the_axis():
    """The task ends; a push moves the demand too, so that nothing is made good afterwards; tasks wait for its
    end.
    """
    rig = ready(PositionRig())
    rig.go(0.3, POS_STW1=MDI, MDI_TARPOS=60_000, MDI_VELOCITY=6_000)
    answer = rig.run(GO, 0.5, POS_STW2=POS_STW2.TRACKING)
    assert answer["POS_ZSW2"] & (POS_ZSW2.TRACKING | POS_ZSW2.COMMAND_ACTIVE) == POS_ZSW2.TRACKING
    assert answer["ZSW1"] & ZSW1.STANDSTILL
    rig.drive.mechanics.apply_force(700.0)
    rig.run(RUN, 0.5)
    rig.drive.mechanics.apply_force(0.0)
    rig.go(0.3, POS_STW1=MDI)
    pushed = rig.place_um
    assert not rig.actual["ZSW1"] & ZSW1.TASK_ACKNOWLEDGED
    rig.run(RUN, 0.5, POS_STW2=0)
    assert not rig.actual["POS_ZSW2"] & POS_ZSW2.TRACKING
    assert rig.place_um == pytest.approx(pushed, abs=30)


@pytest.mark.requirement("PD-091")
def test_without_pulses_the_demand_follows():
    """POS_ZSW2 bit 0 as long as the drive is not enabled."""
    rig = PositionRig()
    rig.run(READY)
    assert rig.actual["POS_ZSW2"] & POS_ZSW2.TRACKING
    rig.run(RUN)
    assert not rig.actual["POS_ZSW2"] & POS_ZSW2.TRACKING


# --------------------------------------------------------------------------------------------- passive homing


def with_probe(**positioner):
    """Return an axis with probe 1 from 30 mm to 40 mm of the travel, probe 2 from 50 mm on."""
    rig = PositionRig(**positioner)
    switches = replace(rig.config.switches, probe1_from_mm=30.0, probe1_to_mm=40.0, probe2_from_mm=50.0)
    Rig.__init__(rig, replace(rig.config, switches=switches))
    return rig


@pytest.mark.requirement("PD-055", "PD-071", "PD-089", "PD-090")
@pytest.mark.parametrize(
    ("bits", "edge_um"),
    [(0, 30_000), (POS_STW2.PROBE_FALLING, 40_000), (POS_STW2.PROBE_2, 50_000)],
)
def test_passive_homing_takes_the_place_of_a_probe_edge(bits, edge_um):
    """The axis goes on with its task; the place of the chosen edge becomes p2599; bit 12 of POS_ZSW1 until
    then.
    """
    rig = with_probe(reference_position=100_000)
    rig.enable_axis()
    rig.run(RUN | STW1.START_HOMING, POS_STW2=POS_STW2.PASSIVE_HOMING | bits)
    rig.signals.update(POS_STW1=POS_STW1.MDI, MDI_TARPOS=70_000, MDI_VELOCITY=6_000)
    rig.run(RUN | STW1.START_HOMING)
    answer = rig.run(GO | STW1.START_HOMING, 0.2)
    assert answer["POS_ZSW1"] == POS_ZSW1.FLYING_HOMING | POS_ZSW1.MDI
    assert not answer["ZSW1"] & ZSW1.HOME_POSITION_SET
    answer = rig.run(GO | STW1.START_HOMING, 1.0)
    assert answer["POS_ZSW1"] == POS_ZSW1.MDI
    assert rig.place_um == pytest.approx(70_000, abs=20)
    assert answer["ZSW1"] & ZSW1.HOME_POSITION_SET
    assert answer["XIST_A"] - rig.place_um == pytest.approx(100_000 - edge_um, abs=3)


# ----------------------------------------------------------------------------------------------------- modulo


@pytest.mark.requirement("PD-092")
@pytest.mark.parametrize(
    ("direction", "way"),
    [(0, 5_000), (POS_STW1.POSITIVE, 5_000), (POS_STW1.NEGATIVE, -25_000)],
)
def test_a_modulo_axis_takes_the_direction_that_is_wanted(direction, way):
    """Within p2576 = 30 000 LU from 28 000 to 3000: the shorter way, or the one of POS_STW1 bits 9 and 10."""
    rig = PositionRig(modulo_range=30_000.0, reference_position=28_000)
    ready(rig)
    answer = rig.go(1.2, POS_STW1=MDI | direction, MDI_TARPOS=3_000, MDI_VELOCITY=6_000)
    assert answer["ZSW1"] & ZSW1.TARGET_REACHED
    assert answer["XIST_A"] == pytest.approx(3_000, abs=5)
    assert rig.place_um == pytest.approx(way, abs=20)


@pytest.mark.requirement("PD-092")
@pytest.mark.parametrize(("mdi_mod", "way"), [(1, 5_000), (3, 5_000), (5, -25_000)])
def test_mdi_mod_tells_the_direction(mdi_mod, way):
    """Bit 0 absolute, bit 1 positive, bit 2 negative."""
    rig = PositionRig(110, modulo_range=30_000.0, reference_position=28_000)
    ready(rig)
    rig.go(1.2, SATZANW=0x8000, MDI_MOD=mdi_mod, MDI_TARPOS=3_000, MDI_VELOCITY=6_000)
    assert rig.place_um == pytest.approx(way, abs=20)


def test_a_target_outside_of_the_modulo_range_is_refused():
    """A warning, and no motion."""
    rig = ready(PositionRig(modulo_range=30_000.0))
    answer = rig.go(0.2, POS_STW1=MDI, MDI_TARPOS=30_000, MDI_VELOCITY=6_000)
    assert answer["WARN_CODE"] == 7471


# ----------------------------------------------------------------------------------------------------- blocks


@pytest.mark.requirement("PD-086", "PD-091")
def test_blocks_that_do_not_move():
    """Wait, outputs, jump: the direct outputs show in POS_ZSW2 bits 10 and 11, and stay."""
    rig = PositionRig(
        block=(
            MOVE,
            TraversingBlock(number=2, task="set output", parameter=3, continuation="continue with stop"),
            TraversingBlock(number=3, task="wait", parameter=200, continuation="continue with stop"),
            TraversingBlock(number=4, task="reset output", parameter=1, continuation="continue with stop"),
            TraversingBlock(number=5, task="goto", parameter=7),
            TraversingBlock(number=7, position=0, velocity=6_000),
        )
    )
    ready(rig)
    rig.run(RUN, POS_STW1=1)
    seen = {}
    for cycle in range(300):
        answer = rig.run(GO, 0.004)
        block = answer["POS_ZSW1"] & 0x7F
        seen.setdefault(block, cycle)
        outputs = answer["POS_ZSW2"] >> 10 & 3
        assert outputs == {1: 0, 2: 0, 3: 3, 4: 3, 5: 2, 7: 2}.get(block, 0), block
    assert list(seen) == [1, 2, 3, 4, 5, 7]
    assert (seen[4] - seen[3]) * 0.004 == pytest.approx(0.2, abs=0.008)
    assert answer["ZSW1"] & ZSW1.TARGET_REACHED
    assert rig.place_um == pytest.approx(0, abs=20)


@pytest.mark.parametrize(
    ("blocks", "number"),
    [
        ((TraversingBlock(number=1, task="goto", parameter=9),), 7468),
        ((replace(MOVE, task="relative"),), 7465),
    ],
)
def test_what_cannot_follow_is_a_warning(blocks, number):
    """A jump to nowhere, a successor that there is not."""
    rig = ready(PositionRig(block=blocks))
    assert rig.go(0.6, POS_STW1=1)["WARN_CODE"] == number


def test_a_loop_of_jumps_ends_nowhere_and_can_be_rejected():
    """One block per cycle: the drive goes on living."""
    rig = ready(PositionRig(block=(TraversingBlock(number=1, task="goto", parameter=1),)))
    assert rig.go(0.2, POS_STW1=1)["POS_ZSW1"] == POS_ZSW1.BLOCKS | 1
    assert rig.run(GO & ~STW1.NO_REJECT_TASK)["POS_ZSW1"] == 0


@pytest.mark.parametrize(("task", "parameter"), [("wait", -1), ("goto", 64), ("set output", 0)])
def test_wrong_parameters_of_blocks_are_refused(task, parameter):
    """The message names the task."""
    with pytest.raises(ConfigurationError, match=task):
        TraversingBlock(number=1, task=task, parameter=parameter)


# ------------------------------------------------------------------------------------------------- monitoring


@pytest.mark.parametrize(
    ("settings", "number"),
    [
        ({"max_cam_distance": 20_000.0}, 7458),
        ({"has_cam": False, "max_mark_distance": 5_000.0}, 7459),
    ],
)
def test_homing_that_finds_nothing_is_a_fault(settings, number):
    """No cam within p2606, no zero mark within p2609: a fault that stops the axis; it is not homed."""
    rig = PositionRig(cam_velocity=6_000.0, mark_velocity=6_000.0, **settings)
    rig.enable_axis()
    answer = rig.run(RUN | STW1.START_HOMING, 0.8)
    assert answer["FAULT_CODE"] == number
    assert not answer["ZSW1"] & ZSW1.HOME_POSITION_SET
    assert rig.drive.state is not AxisState.S4


def test_a_cam_without_end_is_a_fault():
    """F07460 when backing off the cam goes on for longer than p2606."""
    rig = PositionRig(max_cam_distance=20_000.0, mark_velocity=6_000.0)
    rig.enable_axis()
    answer = rig.run(RUN | STW1.START_HOMING, 0.5, POS_STW2=POS_STW2.REFERENCE_CAM)
    assert answer["FAULT_CODE"] == 7460


@pytest.mark.parametrize(("force", "number"), [(30.0, 0), (3_900.0, 7450)])
def test_an_axis_that_is_pushed_from_its_place_is_a_fault(force, number):
    """F07450 after p2543 out of p2542; what the axis resists is none."""
    rig = ready(PositionRig(following_tolerance=1e9))
    rig.drive.mechanics.apply_force(force)
    answer = rig.run(RUN, 0.3)
    assert answer["FAULT_CODE"] == number


def test_an_axis_that_does_not_get_into_its_window_is_a_fault():
    """F07451 when the demand has been at the target for p2545."""
    rig = ready(PositionRig(following_tolerance=1e9, standstill_time_ms=0.0, positioning_time_ms=100.0))
    rig.go(0.3, POS_STW1=POS_STW1.MDI, MDI_TARPOS=50_000, MDI_VELOCITY=6_000)
    rig.drive.mechanics.jam(True)
    assert rig.run(GO, 0.25)["FAULT_CODE"] == 0
    assert rig.run(GO, 0.2)["FAULT_CODE"] == 7451


# ------------------------------------------------------------------------------------------------- parameters


@pytest.mark.requirement("PD-040", "PD-239")
def test_parameters_of_the_positioner_act_at_once():
    """Maximum acceleration, software limits, jog speed, reference point: in the units of the parameter
    list.
    """
    rig = PositionRig()
    parameters = DriveParameters(rig.drive)
    assert parameters.read("p0930") == 2
    assert parameters.read("p2571") == 30_000
    parameters.write("p2599", 5_000)
    ready(rig)
    assert parameters.read("r2521") == pytest.approx(5_000, abs=2)
    parameters.write("p2586", 3_000)
    rig.run(RUN | STW1.JOG_2, 0.3)
    assert rig.drive.mechanics.velocity == pytest.approx(0.05, rel=0.02)
    rig.run(RUN, 0.3)
    parameters.write("p2581", 20_000)
    parameters.write("p2582", 1)
    assert rig.go(0.1, POS_STW1=MDI, MDI_TARPOS=20_001, MDI_VELOCITY=600)["WARN_CODE"] == 7470
    parameters.write("p2572", 100)
    rig.go(0.2, POS_STW1=MDI, MDI_TARPOS=0, MDI_VELOCITY=6_000)
    assert abs(rig.drive.mechanics.velocity) == pytest.approx(0.02, rel=0.1)
    with pytest.raises(ParameterAccessError) as refused:
        parameters.write("p2580", 30_000)
    assert refused.value.error == 0x14
    with pytest.raises(ParameterAccessError) as refused:
        parameters.write("p2577", 1)
    assert refused.value.error == 0x77


@pytest.mark.requirement("PD-086")
def test_blocks_are_written_as_parameters():
    """p2616 to p2623, row by row; a row that contradicts itself is a warning when it is started."""
    rig = PositionRig(block=(replace(MOVE, number=5),))
    parameters = DriveParameters(rig.drive)
    assert [parameters.read(number, 0) for number in range(2616, 2624)] == [
        5,
        10_000,
        6_000,
        100,
        100,
        1,
        0,
        0x10,
    ]
    parameters.write("p2616", 6, 1)
    parameters.write("p2617", 30_000, 1)
    parameters.write("p2618", 6_000, 1)
    parameters.write("p2616", 7, 2)
    parameters.write("p2621", 3, 2)
    parameters.write("p2623", 0x10, 2)
    with pytest.raises(ParameterAccessError):
        parameters.write("p2616", 5, 3)
    ready(rig)
    rig.go(1.2, POS_STW1=5)
    assert rig.place_um == pytest.approx(30_000, abs=20)
    assert rig.go(0.1, POS_STW1=7)["WARN_CODE"] == 7464


def test_a_speed_axis_has_no_parameters_of_the_positioner():
    """The function module is not there: error 00h."""
    parameters = DriveParameters(Rig().drive)
    with pytest.raises(ParameterAccessError) as refused:
        parameters.read("p2571")
    assert refused.value.error == 0x00


# ------------------------------------------------------------------------------------------------- fixed stop


@pytest.mark.exhaustive
@pytest.mark.requirement("PD-082", "PD-091")
def test_travel_to_a_fixed_stop():
    """With STW2 bit 8 the axis presses with the clamping torque where it is held up, and the task is done; no
    fault.
    """
    rig = ready(PositionRig(clamping_torque_nm=1.0))
    rig.run(RUN, POS_STW1=POS_STW1.MDI, MDI_TARPOS=100_000, MDI_VELOCITY=1_800, STW2=0x0100)
    answer = rig.run(GO, 0.5)
    assert answer["POS_ZSW2"] & 0x7000 == POS_ZSW2.TRAVEL_TO_FIXED_STOP
    rig.drive.mechanics.jam(True)
    answer = rig.run(GO, 0.5)
    reached = POS_ZSW2.FIXED_STOP_REACHED | POS_ZSW2.CLAMPING_TORQUE_REACHED | POS_ZSW2.TRAVEL_TO_FIXED_STOP
    assert answer["POS_ZSW2"] & 0x7000 == reached
    assert not answer["POS_ZSW2"] & POS_ZSW2.COMMAND_ACTIVE
    assert answer["ZSW1"] & ZSW1.TARGET_REACHED
    assert rig.drive.core.torque == pytest.approx(1.0, abs=0.01)
    assert answer["FAULT_CODE"] == 0
    stood = rig.place_um
    rig.drive.mechanics.jam(False)
    answer = rig.run(RUN, 0.5, STW2=0)
    assert answer["POS_ZSW2"] & 0x7000 == 0
    assert answer["FAULT_CODE"] == 0
    assert rig.place_um == pytest.approx(stood, abs=1_500)
    assert rig.drive.torque_limit_Nm == 6.0
    rig.go(1.5, MDI_TARPOS=-10_000, MDI_VELOCITY=6_000)
    assert rig.actual["ZSW1"] & ZSW1.TARGET_REACHED


@pytest.mark.requirement("PD-091")
def test_a_target_before_the_fixed_stop_ends_the_motion():
    """Without anything in the way the task ends at its target, and bit 12 stays 0."""
    rig = ready(PositionRig(clamping_torque_nm=2.0))
    rig.run(RUN, POS_STW1=POS_STW1.MDI, MDI_TARPOS=10_000, MDI_VELOCITY=1_800, STW2=0x0100)
    answer = rig.run(GO, 1.0)
    assert answer["ZSW1"] & ZSW1.TARGET_REACHED
    assert answer["POS_ZSW2"] & 0x7000 == POS_ZSW2.TRAVEL_TO_FIXED_STOP
    assert rig.place_um == pytest.approx(10_000, abs=20)
