"""The axis as a whole: state bits, ramps, setpoint channel, faults and acknowledgement, from the telegrams
alone.
"""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from emulators.drive.profidrive import AxisState, DriveSettings, Off, ProfidriveConfig
from emulators.drive.profidrive.faults import catalogue as numbers
from fieldbus.errors import ConfigurationError
from fieldbus.profidrive import ZSW1, from_n2, from_n4, to_n2, to_n4
from fieldbus.profidrive.telegrams import WITH_750
from testcases.unit.emulators_profidrive.profidrive_rig import READY, RUN, SYNCHRONISED, Rig

S1, S2, S3, S4, S5A, S5B = (getattr(AxisState, name) for name in ("S1", "S2", "S3", "S4", "S5A", "S5B"))
OFF1, OFF2, OFF3 = 0x047E, 0x047D, 0x047B
NO_RAMP, FROZEN, NO_SETPOINT, NO_ENABLE = RUN & ~0x10, RUN & ~0x20, RUN & ~0x40, RUN & ~0x08
TELEGRAMS = sorted(WITH_750)


def reference(**changes):
    """Return the reference axis with other settings, or other values of the configuration."""
    config = ProfidriveConfig.reference()
    settings = {
        name: changes.pop(name) for name in list(changes) if name in DriveSettings.__dataclass_fields__
    }
    return replace(config, settings=replace(config.settings, **settings), **changes)


# -- states and their bits -----------------------------------------------------------------------------

PATTERNS = [
    ("PD-098", [], S2, 0x0001),
    ("PD-100", [(RUN, 1)], S3, 0x0003),
    ("PD-103", [(RUN, 2)], S4, 0x0007),
    ("PD-104", [(RUN, 2), (OFF2, 1)], S1, 0x0040),
    ("PD-105", [(RUN, 200), (OFF3, 1)], S5B, 0x0003),
    ("PD-106", [(RUN, 200), (OFF1, 1)], S5A, 0x0003),
    ("PD-107", [(RUN, 2), (NO_ENABLE, 1)], S3, 0x0003),
    ("PD-109", [(RUN, 200), (OFF1, 5), (OFF3 & ~1, 1)], S5B, 0x0003),
    ("PD-111", [(RUN, 200), (OFF1, 5), (RUN, 1)], S4, 0x0007),
    ("PD-113", [(RUN, 200), (OFF3, 5), (RUN, 1)], S5B, 0x0003),
]


@pytest.mark.requirement(
    "PD-060", "PD-061", "PD-062", "PD-064", "PD-065", "PD-066", *{row[0] for row in PATTERNS}
)
@pytest.mark.parametrize(("words", "state", "pattern"), [row[1:] for row in PATTERNS])
def test_every_state_shows_its_pattern(words, state, pattern):
    """A sequence of control words leads a turning axis into the state of the table, and ZSW1 & 0047h shows
    it.
    """
    rig = Rig()
    rig.cycle(READY, count=SYNCHRONISED)
    for word, count in words:
        rig.cycle(word, count=count, **rig.speed(600.0))

    assert rig.drive.state is state
    zsw1 = rig.actual["ZSW1"]
    assert zsw1 & 0x47 == pattern
    off = words[-1][0] if words else READY
    assert bool(zsw1 & ZSW1.NO_OFF2) is bool(off & 2)
    assert bool(zsw1 & ZSW1.NO_OFF3) is (bool(off & 4) and state is not S5B)


@pytest.mark.requirement("PD-081", "PD-096", "PD-097")
def test_the_axis_waits_for_control_by_plc():
    """With the first telegram ZSW1.9 is set and ZSW1.6 stays until bit 10 comes; before it ZSW1 is 0."""
    rig = Rig()
    rig.drive.cycle()
    assert rig.drive.telegram.actual.decode(rig.drive.transmit())["ZSW1"] == 0

    waiting = rig.cycle(READY & ~0x400, count=60)["ZSW1"]
    assert waiting & 0x0247 == 0x0240
    assert rig.cycle(READY, count=2)["ZSW1"] & 0x0247 == 0x0201


@pytest.mark.requirement("PD-125", "PD-126", "PD-131")
def test_s2_waits_for_the_sign_of_life():
    """Without the controller's counter an isochronous axis stays in S1 and sends none; with it both
    follow.
    """
    rig = Rig()
    rig.sends_sign = False
    assert rig.cycle(READY, count=60)["ZSW1"] & 0x47 == 0x40
    assert rig.actual["ZSW2"] >> 12 == 0

    rig.sends_sign = True
    rig.cycle(READY, count=SYNCHRONISED)
    assert rig.drive.state is S2
    before = rig.actual["ZSW2"] >> 12
    assert rig.cycle(READY)["ZSW2"] >> 12 == before % 15 + 1


@pytest.mark.requirement("PD-130", "CFG-190")
def test_telegram_1_needs_no_sign_of_life():
    """The telegram without STW2 works without clock and sign of life, and cannot be made isochronous."""
    rig = Rig(replace(ProfidriveConfig.reference(), telegram=1))
    rig.cycle(READY, count=2)
    rig.cycle(RUN, count=2)
    assert rig.drive.state is S4
    with pytest.raises(ConfigurationError, match="isochronous"):
        ProfidriveConfig(telegram=1, isochronous=True)


@pytest.mark.requirement("PD-076")
def test_a_frame_without_control_by_plc_is_not_taken_over():
    """With bit 10 = 0 control word and setpoint stay those of before, but the sign of life is followed
    (PD-077).
    """
    rig = Rig()
    rig.turn(600.0)

    rig.cycle(OFF2 & ~0x400, count=50, **rig.speed(-900.0))

    assert rig.drive.state is S4
    assert rig.drive.core.speed_rpm == pytest.approx(600.0, abs=0.5)
    assert not rig.drive.faults.present


@pytest.mark.requirement("PD-348")
@pytest.mark.parametrize("torque", [False, True])
@pytest.mark.parametrize("number", TELEGRAMS)
def test_every_telegram_of_the_axis_turns_the_motor(number, torque):
    """Each telegram, with and without its supplement 750, enables the drive and sets and shows its speed."""
    rig = Rig(replace(ProfidriveConfig.reference(), telegram=number, torque_telegram=torque))
    rig.turn(600.0)

    share = from_n4(rig.actual["NIST_B"]) if "NIST_B" in rig.actual else from_n2(rig.actual["NIST_A"])
    assert share == pytest.approx(0.2, abs=0.001)
    assert rig.actual["ZSW1"] & 0x47 == 0x07


@pytest.mark.requirement("PD-029")
def test_a_free_telegram_turns_the_motor():
    """A layout of one's own works as long as STW1 and ZSW1 come first."""
    config = ProfidriveConfig(
        telegram=999,
        free_setpoint=("STW1", "NSOLL_A", "STW2"),
        free_actual=("ZSW1", "ZSW2", "NIST_A", "FAULT_CODE"),
    )
    rig = Rig(config)
    rig.turn(600.0)
    assert from_n2(rig.actual["NIST_A"]) == pytest.approx(0.2, abs=0.001)
    rig.drive.raise_fault(numbers.EXTERNAL)
    assert rig.cycle(RUN)["FAULT_CODE"] == numbers.EXTERNAL


@pytest.mark.requirement("PD-030")
def test_a_frame_of_a_wrong_length_is_not_taken_over():
    """Frames that are too short or too long are counted; the values of before stay, and then F01910 stops the
    axis.
    """
    rig = Rig(reference(sign_of_life_tolerance=65535))
    rig.turn(600.0)
    for length in (0, 19, 21, 64):
        rig.drive.receive(bytes(length))
    assert rig.drive.rejected == 4

    rig.scheduler.run_for(90_000_000)
    assert not rig.drive.faults.present
    rig.scheduler.run_for(20_000_000)
    assert rig.drive.faults.number == numbers.SETPOINT_TIMEOUT
    assert rig.drive.state is S5B


# -- ramps ---------------------------------------------------------------------------------------------


@pytest.mark.requirement("MC-571", "PD-110", "PD-113", "PD-116")
@pytest.mark.parametrize("rpm", [300.0, -1500.0, 2900.0])
@pytest.mark.parametrize(
    ("word", "share_s", "end"), [(OFF1, 1.0, S2), (OFF3, 0.5, S1), (OFF1 & ~0x10, 0.5, S2)]
)
def test_stops_take_the_time_of_the_ramp(word, share_s, end, rpm):
    """OFF1 takes p1121 * |n| / p1082, OFF3 and OFF1 without ramp generator p1135 * |n| / p1082; then S2 or
    S1.
    """
    rig = Rig()
    rig.turn(rpm)

    elapsed = rig.time_until(word, end, **rig.speed(rpm))

    assert elapsed == pytest.approx(share_s * abs(rpm) / 3000.0, abs=0.012)
    assert not rig.drive.core.enabled


@pytest.mark.requirement("PD-116")
def test_braking_starts_from_the_actual_speed():
    """An axis that cannot follow its setpoint brakes from where it is, not from where it should be."""
    rig = Rig()
    rig.turn(1500.0)
    rig.drive.mechanics.jam(True)
    rig.cycle(RUN, count=20, **rig.speed(1500.0))
    assert abs(rig.drive.core.speed_rpm) < 50.0

    assert rig.time_until(OFF1, S2) < 0.05


@pytest.mark.requirement("MC-571", "PD-104", "PD-107")
@pytest.mark.parametrize("word", [OFF2, NO_ENABLE])
def test_off2_and_disable_coast(word):
    """OFF2 and bit 3 = 0 take the pulses away at once; friction alone slows the axis down."""
    rig = Rig()
    rig.turn(1500.0)
    rig.cycle(word)
    assert not rig.drive.core.enabled
    assert rig.drive.core.torque == 0.0
    assert rig.drive.core.speed_rpm > 1400.0


@pytest.mark.exhaustive
@pytest.mark.requirement("PD-119")
def test_ramp_generator_of_mode_1():
    """Mode 1: ramps up with p1120, freezes with bit 5 = 0, ramps down with p1121 on bit 6 = 0 and with p1135
    on bit 4 = 0.
    """
    rig = Rig(reference(operating_mode=1, ramp_up_s=2.0))
    rig.enable()
    cycles = 100  # 0.4 s
    rig.cycle(RUN, count=cycles, **rig.speed(1500.0))
    assert rig.drive.core.speed_rpm == pytest.approx(0.4 / 2.0 * 3000.0, abs=15.0)

    frozen = rig.drive.core.precontrol_velocity
    rig.cycle(FROZEN, count=50, **rig.speed(1500.0))
    assert rig.drive.core.precontrol_velocity == pytest.approx(frozen, rel=0.02)

    rig.cycle(RUN, count=400, **rig.speed(1500.0))
    assert rig.drive.core.speed_rpm == pytest.approx(1500.0, abs=0.5)
    rig.cycle(NO_SETPOINT, count=50, **rig.speed(1500.0))
    assert rig.drive.core.speed_rpm == pytest.approx(1500.0 - 0.2 * 3000.0, abs=15.0)

    rig.cycle(RUN, count=400, **rig.speed(1500.0))
    rig.cycle(NO_RAMP, count=25, **rig.speed(1500.0))
    assert rig.drive.core.speed_rpm == pytest.approx(1500.0 - 0.1 * 6000.0, abs=30.0)
    assert rig.drive.state is S4


@pytest.mark.requirement("PD-120")
def test_reduced_channel_of_mode_3():
    """Mode 3: the setpoint passes without ramp, bit 5 has no effect, bit 6 = 0 ramps down, bit 4 = 0 is zero
    at once.
    """
    rig = Rig()
    rig.enable()
    rig.cycle(RUN, count=5, **rig.speed(300.0))
    assert rig.drive.core.precontrol_velocity * 30.0 / math.pi == pytest.approx(300.0, abs=0.1)
    rig.cycle(FROZEN, count=3, **rig.speed(600.0))
    assert rig.drive.core.precontrol_velocity * 30.0 / math.pi == pytest.approx(600.0, abs=0.1)
    rig.cycle(NO_SETPOINT, count=25, **rig.speed(600.0))
    assert rig.drive.core.precontrol_velocity * 30.0 / math.pi == pytest.approx(300.0, abs=15.0)
    rig.cycle(NO_RAMP, **rig.speed(600.0))
    assert rig.drive.core.precontrol_velocity == 0.0


@pytest.mark.requirement("PD-268")
def test_the_setpoint_is_limited_to_p1082():
    """A setpoint above p1082 counts as p1082, in both directions."""
    rig = Rig(reference(max_speed_rpm=1000.0))
    rig.enable()
    for rpm in (2500.0, -2500.0):
        rig.cycle(RUN, count=200, **rig.speed(rpm))
        assert rig.drive.core.speed_rpm == pytest.approx(math.copysign(1000.0, rpm), abs=0.5)


@pytest.mark.requirement("PD-122")
def test_jogging_starts_from_s2_and_ends_there():
    """Jog 1 and jog 2 turn with p1058 and p1059 without ON; both together turn nothing and warn."""
    rig = Rig()
    ready = READY & ~0x70
    rig.cycle(READY, count=SYNCHRONISED)
    for bit, rpm in ((0x100, 150.0), (0x200, -150.0)):
        rig.cycle(ready | bit, count=100)
        assert rig.drive.state is S4
        assert rig.drive.core.speed_rpm == pytest.approx(rpm, abs=0.5)
        rig.time_until(ready, S2)
    rig.cycle(ready | 0x300, count=20)
    assert rig.drive.state is S2
    assert rig.actual["ZSW1"] & ZSW1.WARNING
    assert not rig.cycle(ready, count=2)["ZSW1"] & ZSW1.WARNING


# -- faults --------------------------------------------------------------------------------------------


@pytest.mark.requirement("PD-115", "PD-133")
@pytest.mark.parametrize(
    ("reaction", "braking", "end", "share_s"),
    [(Off.OFF1, S5A, S2, 1.0), (Off.OFF3, S5B, S1, 0.5), (Off.OFF2, S1, S1, 0.0)],
)
def test_a_fault_stops_as_its_reaction_says_and_needs_a_new_on(reaction, braking, end, share_s):
    """A fault acts as its OFF; after acknowledging with ON still set nothing moves: a new edge of ON is
    needed.
    """
    rig = Rig()
    rig.turn(900.0)
    rig.drive.raise_fault(numbers.EXTERNAL, value=7, reaction=reaction)
    assert rig.drive.state is braking
    assert rig.cycle(RUN, **rig.speed(900.0))["ZSW1"] & ZSW1.FAULT
    assert rig.time_until(RUN, end, **rig.speed(900.0)) == pytest.approx(share_s * 0.3, abs=0.012)

    rig.cycle(RUN | 0x80)
    assert not rig.cycle(RUN, count=10)["ZSW1"] & ZSW1.FAULT
    assert rig.drive.state is end
    rig.cycle(READY, count=2)
    rig.cycle(RUN, count=2)
    assert rig.drive.state is S4


@pytest.mark.requirement("PD-052", "PD-078")
def test_acknowledging_takes_an_edge_with_control_by_plc():
    """A bit that stands, or comes without bit 10, acknowledges nothing; the edge with bit 10 does."""
    rig = Rig()
    rig.cycle(READY | 0x80, count=SYNCHRONISED)
    rig.drive.raise_fault(numbers.EXTERNAL)
    assert rig.cycle(READY | 0x80, count=3)["ZSW1"] & ZSW1.FAULT
    rig.cycle(READY)
    assert rig.cycle((READY | 0x80) & ~0x400, count=3)["ZSW1"] & ZSW1.FAULT
    assert not rig.cycle(READY | 0x80)["ZSW1"] & ZSW1.FAULT


@pytest.mark.requirement("PD-134", "PD-135", "PD-137")
def test_a_lasting_cause_opens_a_new_situation():
    """Acknowledging moves the situation into the history; what lasts is entered again at once."""
    rig = Rig()
    rig.cycle(READY, count=SYNCHRONISED)
    rig.drive.raise_fault(numbers.EXTERNAL, persistent=True)
    rig.drive.raise_fault(numbers.OVERCURRENT)
    rig.cycle(READY | 0x80)
    assert rig.actual["ZSW1"] & ZSW1.FAULT
    buffer = rig.drive.faults.buffer
    assert [buffer.entry(index).number if buffer.entry(index) else 0 for index in (0, 1, 8, 9)] == [
        numbers.EXTERNAL,
        0,
        numbers.EXTERNAL,
        numbers.OVERCURRENT,
    ]
    assert buffer.counter == 4  # two messages, an acknowledgement, a message

    rig.drive.clear_fault_cause(numbers.EXTERNAL)
    rig.cycle(READY)
    assert not rig.cycle(READY | 0x80)["ZSW1"] & ZSW1.FAULT


@pytest.mark.requirement("PD-127", "PD-128", "PD-129", "PD-350")
@pytest.mark.parametrize(("tolerance", "wrong"), [(1, 2), (5, 6), (65535, None)])
def test_sign_of_life_faults_after_the_tolerated_cycles(tolerance, wrong):
    """The counter that stands still is fault F01912 with OFF1 in the cycle after the tolerated ones; 65535
    tolerates all.
    """
    rig = Rig(reference(sign_of_life_tolerance=tolerance))
    rig.turn(300.0)
    rig.sends_sign = False
    cycles = 0
    while not rig.drive.faults.present and cycles < 40:
        rig.cycle(RUN, **rig.speed(300.0))
        cycles += 1

    assert cycles == (40 if wrong is None else wrong)
    if wrong is not None:
        assert rig.drive.faults.number == numbers.SIGN_OF_LIFE
        assert rig.drive.state is S5A
        assert rig.cycle(RUN)["G1_XIST2"] == 0x0F02


@pytest.mark.requirement("PD-123")
def test_a_clock_that_stops_is_a_fault():
    """An isochronous drive whose bus cycles stay away stops by itself with OFF1."""
    rig = Rig()
    rig.turn(300.0)
    rig.scheduler.run_for(30_000_000)
    assert rig.drive.faults.number == numbers.CLOCK_FAILURE
    assert rig.drive.state is S5A


def test_safe_torque_off_is_no_fault():
    """STO takes the torque at once and inhibits switching on, with a warning and without a fault."""
    rig = Rig()
    rig.turn(900.0)
    rig.drive.safety.set_sto(True)
    assert not rig.drive.core.enabled
    word = rig.cycle(RUN)["ZSW1"]
    assert word & 0x00CF == 0x00C0
    assert rig.cycle(READY, count=3)["ZSW1"] & 0x40
    rig.drive.safety.set_sto(False)
    rig.cycle(READY, count=2)
    rig.cycle(RUN, count=2)
    assert rig.drive.state is S4


def test_safe_stop_1_brakes_and_then_takes_the_torque():
    """SS1 brakes with the ramp of OFF3; safe torque off follows at standstill."""
    rig = Rig()
    rig.turn(900.0)
    rig.drive.safety.set_ss1(True)
    assert rig.drive.state is S5B
    assert rig.time_until(RUN, S1) == pytest.approx(0.15, abs=0.012)
    rig.cycle(RUN)
    assert rig.drive.safety.torque_off
    assert not rig.drive.faults.present


# -- further words -------------------------------------------------------------------------------------


@pytest.mark.requirement("PD-079", "PD-068")
def test_speed_deviation_counts_after_its_time():
    """ZSW1.8 is 1 while the deviation is small or has not lasted for the whole time; a blocked shaft ends
    it.
    """
    rig = Rig(reference(deviation_rpm=90.0, deviation_time_s=0.02))
    rig.turn(600.0)
    assert rig.actual["ZSW1"] & ZSW1.DEVIATION_IN_TOLERANCE
    rig.drive.mechanics.jam(True)
    outside = [
        bool(rig.cycle(RUN, **rig.speed(600.0))["ZSW1"] & ZSW1.DEVIATION_IN_TOLERANCE) for _ in range(10)
    ]
    assert outside.index(False) in (5, 6, 7)
    rig.drive.mechanics.jam(False)
    assert rig.cycle(RUN, count=100, **rig.speed(600.0))["ZSW1"] & ZSW1.DEVIATION_IN_TOLERANCE


@pytest.mark.requirement("PD-070", "PD-080")
@pytest.mark.parametrize("rpm", [99.0, 101.0, -99.0, -101.0])
def test_speed_comparison(rpm):
    """ZSW1.10 is 1 when the speed is at least the comparison value, in both directions."""
    rig = Rig(reference(comparison_speed_rpm=100.0))
    rig.turn(rpm)
    assert bool(rig.actual["ZSW1"] & ZSW1.SPEED_REACHED) is (abs(rpm) > 100.0)


@pytest.mark.requirement("PD-037")
@pytest.mark.parametrize(("momred", "left"), [(0, 1.0), (0x2000, 0.5), (0x4000, 0.0), (0x7FFF, 0.0)])
def test_momred_reduces_the_torque_limit(momred, left):
    """MOMRED takes its share from both torque limits."""
    rig = Rig()
    rig.enable()
    rig.cycle(RUN, MOMRED=momred)
    assert rig.drive.torque_limit_Nm == pytest.approx(6.0 * left)


@pytest.mark.requirement("MC-574", "PD-027", "PD-038", "CFG-407")
def test_telegram_750_adds_and_limits_torque_and_shows_it():
    """M_ADD1 acts on top, the limits cut, M_ACT shows what there is; 4000h is p2003."""
    rig = Rig(replace(ProfidriveConfig.reference(), torque_telegram=True))
    rig.enable()
    rig.cycle(RUN, count=5, M_ADD1=to_n2(0.25))
    assert rig.drive.core.torque_offset == pytest.approx(0.5)

    rig.cycle(RUN, count=20, M_LIMIT_POS=to_n2(0.2), M_LIMIT_NEG=to_n2(-0.1), **rig.speed(3000.0))
    assert from_n2(rig.actual["M_ACT"]) == pytest.approx(0.2, abs=0.001)
    assert not rig.actual["ZSW1"] & ZSW1.TORQUE_LIMIT_NOT_REACHED
    rig.cycle(RUN, count=20, M_LIMIT_POS=to_n2(0.2), M_LIMIT_NEG=to_n2(-0.1), **rig.speed(-3000.0))
    assert from_n2(rig.actual["M_ACT"]) == pytest.approx(-0.1, abs=0.001)


@pytest.mark.exhaustive
@pytest.mark.requirement("PD-171")
def test_g1_xist1_counts_with_fine_resolution():
    """G1_XIST1 advances by 2048 * 2^11 increments per revolution, wraps, and goes on through all states."""
    rig = Rig()
    rig.turn(600.0)
    before, now = rig.actual["G1_XIST1"], rig.scheduler.now
    rig.cycle(RUN, count=250, **rig.speed(600.0))
    turns = 600.0 / 60.0 * (rig.scheduler.now - now) / 1e9
    assert (rig.actual["G1_XIST1"] - before) % 2**32 == pytest.approx(turns * 2**22, rel=1e-3)
    before = rig.actual["G1_XIST1"]
    rig.cycle(OFF2, count=10)
    assert 0 < (rig.actual["G1_XIST1"] - before) % 2**32 < 2**22


# -- dynamic servo control -----------------------------------------------------------------------------


@pytest.mark.requirement("CTL-031", "PD-195", "PD-196", "PD-041", "PD-042")
@pytest.mark.parametrize("kpc", [10_000, 50_000])
def test_dsc_closes_the_position_loop_in_the_drive(kpc):
    """With a fixed XERR the axis goes that far from where it was: the drive subtracts what it has moved
    since.
    """
    config = ProfidriveConfig.reference()
    rig = Rig(replace(config, interpolation=False))
    rig.enable()
    rig.cycle(RUN, KPC=kpc)
    sent = rig.actual["G1_XIST1"]
    goal = sent + 2**21  # half a revolution
    for _ in range(300):
        rig.cycle(RUN, KPC=kpc, XERR=goal - rig.actual["G1_XIST1"])
    assert rig.drive.channel.dsc
    assert abs(rig.actual["G1_XIST1"] - goal) < 2**22 / 2000


@pytest.mark.requirement("CTL-031", "PD-195")
def test_dsc_demand_is_that_of_the_formula():
    """In the servo step after the take-over n = NSOLL_B + KPC * (XERR - (XIST now - XIST sent))."""
    config = replace(ProfidriveConfig.reference(), interpolation=False)
    rig = Rig(config)
    rig.turn(300.0)
    drive = rig.drive
    per_increment = 2.0 * math.pi / 2**22
    rig.cycle(RUN, KPC=20_000, **rig.speed(300.0))
    sent = drive.channel.sent_angle
    drive.receive(
        drive.telegram.setpoint.encode(
            {
                "STW1": RUN,
                "STW2": (rig.sign % 15 + 1) << 12,
                "NSOLL_B": to_n4(0.1),
                "XERR": 40_000,
                "KPC": 20_000,
            }
        )
    )
    drive.cycle()
    for _ in range(4):
        rig.scheduler.run_for(config.servo_period_ns)
        demand = 300.0 * math.pi / 30.0 + 20.0 * (40_000 * per_increment - (drive.core.position - sent))
        assert drive.core.velocity_demand == pytest.approx(demand, rel=1e-6)


@pytest.mark.requirement("PD-198")
def test_dsc_without_clock_is_refused_with_a_warning():
    """An axis that is not isochronous takes KPC as 0 and warns."""
    rig = Rig(replace(ProfidriveConfig.reference(telegram=5), isochronous=False))
    rig.cycle(READY, count=3)
    rig.cycle(RUN, count=20, KPC=20_000, XERR=100_000)
    assert not rig.drive.channel.dsc
    assert rig.actual["ZSW1"] & ZSW1.WARNING
    assert abs(rig.drive.core.speed_rpm) < 0.1
    assert not rig.cycle(RUN, count=2)["ZSW1"] & ZSW1.WARNING


@pytest.mark.requirement("PD-347", "PD-076")
def test_what_happens_in_which_order_within_a_cycle():
    """Telegram, sign of life, state machine, encoder, setpoint channel, and the answer behind all of them: in
    one cycle.
    """
    rig = Rig(ProfidriveConfig.reference(telegram=5))
    rig.cycle(READY, count=SYNCHRONISED)
    drive = rig.drive
    drive.settings.sign_of_life_tolerance = 0
    drive.refresh()

    # The sign of life is evaluated before the state machine acts on the same telegram: it does not switch on.
    rig.sign += 3
    rig.cycle(RUN)
    assert drive.faults.number == numbers.SIGN_OF_LIFE
    assert drive.state is not AxisState.S4
    assert rig.actual["ZSW1"] & 8  # and the answer of this cycle tells of it

    # Without control by PLC the telegram is not taken over, but its sign of life is evaluated.
    rig = Rig(ProfidriveConfig.reference(telegram=5))
    rig.cycle(READY, count=SYNCHRONISED)
    drive = rig.drive
    rig.cycle(RUN & ~0x0400, count=3)
    assert drive.state is AxisState.S2
    assert drive.faults.number == 0
    rig.cycle(READY, count=2)

    # State machine, then encoder, then setpoint channel: all see the telegram in the cycle in which it came.
    while drive.state is not AxisState.S4:
        rig.cycle(RUN, **rig.speed(100.0))
    assert rig.actual["ZSW1"] & 4
    assert drive.channel.target != 0.0
    assert not rig.actual["G1_ZSW"] & 0x8000
    rig.cycle(RUN, **rig.speed(100.0), G1_STW=0x2000)  # an absolute value, which this encoder has not
    assert rig.actual["G1_ZSW"] & 0x8000

    # What a stop command takes away is gone in the answer of the same cycle.
    rig.cycle(RUN & ~0x0002, **rig.speed(100.0))
    assert not rig.actual["ZSW1"] & 7
    assert not drive.core.enabled
