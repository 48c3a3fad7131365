"""TM PTO: reference mark, measurement, parking, errors, stop of the controller, faults of supply and outputs;
the stepper motor.
"""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from emulators.encoder.profidrive import EncoderState
from emulators.io.tm_pto import PtoConfig, StepperConfig, StepperMotor
from fieldbus.clock import MS
from fieldbus.errors import ConfigurationError
from fieldbus.profidrive import ENCODER_ERRORS
from testcases.campaigns._pto_rig import RUN, S1, S4, SEQUENCE, Rig

SEARCH, READ_1, READ_2 = 0x0011, 0x0021, 0x0022
MEASURE, MEASURE_BOTH = 0x0080, 0x0093
PARK, ACKNOWLEDGE = 0x4000, 0x8000
FAST = {"use_rs": True, "use_mi": True, "ramp_stop_ms": 1, "input_delay_ms": 0.004}


def running(**config):
    """Return a rig with 10 kHz in positive direction."""
    rig = Rig(**{**FAST, **config})
    rig.start(0x4000, seconds=0.02)
    assert rig.hertz == 10_000
    return rig


def press(rig, terminal, level, count):
    """Bring a level to a terminal at the instant at which a pulse comes."""
    rig.channel.at_count(count, lambda: rig.channel.drive_input(terminal, level))


@pytest.mark.requirement(
    "PTO-076", "PTO-106", "PTO-109", "PTO-125", "PTO-126", "PTO-168", "PTO-170", "PTO-304"
)
def test_reference_mark():
    """The count at the edge of RS is shown, not that of the next cycle; a second edge changes nothing."""
    rig = running()
    rig(g1=SEARCH)
    assert rig.got["G1_ZSW"] == 0x0001
    press(rig, "RS", True, 1234)
    press(rig, "RS", False, 1300)
    press(rig, "RS", True, 1350)
    rig(seconds=0.2)
    assert rig.got["G1_ZSW"] == 0
    assert rig.got["G1_XIST2"] == 0
    assert rig.count > 1350
    rig(g1=0)
    rig(g1=READ_1)
    assert (rig.got["G1_ZSW"], rig.got["G1_XIST2"]) == (0x0010, 1234)
    rig(g1=0)
    assert (rig.got["G1_ZSW"], rig.got["G1_XIST2"]) == (0, 0)


@pytest.mark.requirement("PTO-169", "PTO-015", "PTO-171", "PTO-175")
def test_edge_of_the_reference_switch():
    """Only the configured edge counts; cancelled and unread searches give no value and no error."""
    rig = running(rs_rising=False)
    rig(g1=SEARCH)
    press(rig, "RS", True, rig.count + 50)
    rig(cycles=5)
    assert rig.got["G1_ZSW"] == 0x0001
    press(rig, "RS", False, 1000)
    rig(cycles=40)
    rig(g1=0)
    assert rig(g1=READ_1) is S4
    assert rig.got["G1_XIST2"] == 1000
    rig(g1=0)
    rig(g1=SEARCH)
    rig(g1=0x0031)
    assert rig.got["G1_ZSW"] == 0
    rig(g1=READ_1)
    assert (rig.got["G1_ZSW"], rig.got["G1_XIST2"]) == (0, 0)


@pytest.mark.requirement("PTO-076", "PTO-077", "PTO-110", "PTO-177", "PTO-178", "PTO-112", "PTO-119")
def test_measurement():
    """Rising edge at 500, falling at 650: each function reads its own; the level of MI shows in the mode of
    measurement only.
    """
    rig = running()
    rig(g1=MEASURE_BOTH)
    assert rig.got["G1_ZSW"] == 0x0003
    press(rig, "MI", True, 500)
    press(rig, "MI", False, 650)
    while rig.count < 600:
        rig()
    assert rig.got["G1_ZSW"] == 0x0102
    rig(g1=0x00A1)
    assert (rig.got["G1_ZSW"] & 0x0010, rig.got["G1_XIST2"]) == (
        0x0010,
        500,
    )  # the other one goes on (PTO-183)
    rig(seconds=0.05)
    rig(g1=0x00A2)
    assert (rig.got["G1_ZSW"], rig.got["G1_XIST2"]) == (0x0020, 650)
    rig(g1=MEASURE)
    rig.channel.drive_input("MI", True)
    rig()
    assert rig.got["G1_ZSW"] == 0x0100
    rig(g1=0)
    assert rig.got["G1_ZSW"] == 0


@pytest.mark.requirement("PTO-181", "PTO-183")
def test_cancelled_measurement():
    """Command 3 drops what was latched."""
    rig = running()
    rig(g1=MEASURE_BOTH)
    press(rig, "MI", True, rig.count + 20)
    rig(cycles=5)
    rig(g1=0x00B3)
    rig(g1=0x00A1)
    assert rig.got["G1_ZSW"] & 0x00FF == 0


@pytest.mark.requirement("PTO-182", "PTO-016")
@pytest.mark.parametrize(("delay_ms", "behind"), [(12.8, 128), (0.1, 1), (1.6, 16), (20.0, 200)])
def test_input_delay(delay_ms, behind):
    """The latched position lies behind the edge by what comes within the filter's delay."""
    rig = running(input_delay_ms=delay_ms)
    rig(g1=SEARCH)
    press(rig, "RS", True, 1000)
    rig(seconds=0.2)
    rig(g1=0)
    rig(g1=READ_1)
    assert rig.got["G1_XIST2"] == 1000 + behind


@pytest.mark.requirement("PTO-304")
def test_bounce():
    """Bounces shorter than the filter are none; the edge counts when the level has stood."""
    rig = running(input_delay_ms=3.2)
    rig(g1=SEARCH)
    for count in range(1000, 1100, 20):
        press(rig, "RS", True, count)
        press(rig, "RS", False, count + 10)
    press(rig, "RS", True, 1100)
    rig(seconds=0.2)
    rig(g1=0)
    rig(g1=READ_1)
    assert rig.got["G1_XIST2"] == 1132


# -- errors --------------------------------------------------------------------------------------------


def idle(_):
    """Nothing runs."""


def searching(rig):
    rig(g1=SEARCH)


def mark_shown(rig):
    searching(rig)
    press(rig, "RS", True, rig.count + 20)
    rig(cycles=4)
    rig(g1=0)
    rig(g1=READ_1)


def measuring(rig):
    rig(g1=MEASURE_BOTH)


def value_shown(rig):
    measuring(rig)
    press(rig, "MI", True, rig.count + 20)
    rig(cycles=4)
    rig(g1=0x00A1)


ERRORS = [  # identifiers, phase, G1_STW, code
    (("PTO-131", "PTO-300"), idle, 0x0012, 4),
    (("PTO-078", "PTO-131"), idle, 0x0014, 4),
    (("PTO-079", "PTO-131"), idle, 0x0018, 4),
    (("PTO-130", "PTO-078"), idle, 0x0094, 6),
    (("PTO-130", "PTO-079"), idle, 0x0098, 6),
    (("PTO-128", "PTO-083"), idle, 0x0800, 0xF01),
    (("PTO-128", "PTO-084"), idle, 0x1000, 0xF01),
    (("PTO-129", "PTO-085", "PTO-133"), idle, 0x2000, 8),
    *((("PTO-176", "PTO-300"), idle, command << 4, 0xF01) for command in (4, 5, 6, 7)),
    (("PTO-172", "PTO-191"), searching, 0x0013, 4),
    (("PTO-172",), searching, 0x0015, 4),
    (("PTO-172",), searching, 0x0019, 4),
    (("PTO-173", "PTO-301"), searching, 0x0091, 4),
    (("PTO-174", "PTO-301", "PTO-192"), mark_shown, 0x00A1, 5),
    (("PTO-179", "PTO-193"), measuring, 0x0097, 6),
    (("PTO-179",), measuring, 0x009B, 6),
    (("PTO-179", "PTO-301"), measuring, 0x0013, 6),
    (("PTO-180", "PTO-301", "PTO-194"), value_shown, 0x0021, 7),
]


@pytest.mark.requirement(*sorted({one for row in ERRORS for one in row[0]}), "PTO-198", "PTO-199", "PTO-203")
@pytest.mark.parametrize("row", ERRORS, ids=lambda row: f"{row[0][0]}-{row[1].__name__}-{row[2]:04X}")
def test_error(row):
    """What is not supported and what contradicts a running function: the code of the list; the pulses go
    on.
    """
    _, phase, word, code = row
    rig = running()
    phase(rig)
    rig(g1=word)
    assert (rig.got["G1_ZSW"], rig.got["G1_XIST2"]) == (0x8000, code)
    assert rig.channel.state is S4
    assert rig.hertz == 10_000
    rig(g1=0, cycles=5)
    assert rig.code == code
    rig(g1=ACKNOWLEDGE)
    assert (rig.got["G1_ZSW"], rig.got["G1_XIST2"]) == (0x0800, 0)
    rig(g1=0)
    assert (rig.got["G1_ZSW"], rig.got["G1_XIST2"]) == (0, 0)


@pytest.mark.requirement("PTO-200", "PTO-309")
def test_acknowledging_a_standing_cause():
    """With the request for an absolute value still there, the same error comes back after the
    acknowledgement.
    """
    rig = running()
    rig(g1=0x2000)
    rig(g1=0xA000, cycles=3)
    assert (rig.got["G1_ZSW"], rig.got["G1_XIST2"]) == (0x8800, 8)
    rig(g1=0x2000)
    assert (rig.got["G1_ZSW"], rig.got["G1_XIST2"]) == (0x8000, 8)


@pytest.mark.requirement("PTO-014")
def test_terminals_that_are_not_used():
    """Without RS there is no search, without MI no measurement; an unknown terminal is refused."""
    rig = running(use_rs=False, use_mi=False)
    rig(g1=SEARCH)
    assert rig.code == 4
    other = running(use_rs=False, use_mi=False)
    other(g1=0x0091)
    assert other.code == 6
    with pytest.raises(ConfigurationError, match="DR, RS, MI"):
        rig.channel.drive_input("XY", True)


@pytest.mark.requirement("PTO-086", "PTO-184", "PTO-185", "PTO-186", "PTO-187", "PTO-117")
def test_parking():
    """Parking hides the feedback only: pulses and count go on, and it lasts 100 ms at least."""
    rig = running()
    rig(g1=SEARCH)
    before = rig.count
    rig(g1=PARK)
    assert (rig.got["G1_ZSW"], rig.got["G1_XIST1"], rig.got["G1_XIST2"]) == (0x4000, 0, 0)
    rig(g1=0, cycles=24)
    assert rig.got["G1_ZSW"] == 0x4000
    rig()
    assert rig.got["G1_ZSW"] == 0
    assert rig.hertz == 10_000
    assert rig.got["G1_XIST1"] == rig.count == before + 26 * 40


@pytest.mark.requirement("PTO-134", "PTO-190", "PTO-296")
def test_strict_parking():
    """The strict variant answers a parking request with 3."""
    rig = running(strict_parking=True)
    rig(g1=PARK)
    assert rig.code == 3
    assert rig.got["G1_XIST1"] == rig.count


@pytest.mark.requirement(
    "PTO-070", "PTO-074", "PTO-075", "PTO-104", "PTO-105", "PTO-197", "PTO-303", "PTO-136"
)
@pytest.mark.parametrize(("tolerance", "failing"), [(1, 2), (5, 6), (65_535, None)])
def test_sign_of_life(tolerance, failing):
    """0 is never supervised; a counter that has once shown itself has to go on; the module itself sends 0."""
    rig = running(sign_tolerance=tolerance)
    rig(cycles=50)
    assert rig.code == 0
    for sign in range(1, 40):
        rig.stw2 = ((sign - 1) % 15 + 1) << 12
        rig()
        assert rig.code == 0
        assert rig.got["ZSW2_ENC"] == 0x0200
    for wrong in range(1, 12):
        rig()
        assert rig.code == (0xF02 if failing is not None and wrong >= failing else 0)
    assert rig.channel.state is S4


# -- stop of the controller, supply, outputs -----------------------------------------------------------


@pytest.mark.requirement(
    "PTO-204", "PTO-205", "PTO-302", "PTO-019", "PTO-154", "PTO-173", "PTO-174", "PTO-179", "PTO-180"
)
@pytest.mark.parametrize(
    ("phase", "code"), [(idle, 0), (searching, 4), (mark_shown, 5), (measuring, 6), (value_shown, 7)]
)
@pytest.mark.parametrize("how", ["stop", "bus"])
def test_controller_is_gone(phase, code, how):
    """STOP, or no frame for the watchdog's time: S1, no pulses, ED low, functions end with their codes; then
    the sequence again.
    """
    rig = running(use_ed=True)
    phase(rig)
    if how == "stop":
        rig.module.stop_controller(True)
        rig()
    else:
        rig(cycles=2, quiet=True)
        assert rig.channel.state is S4
        assert rig.hertz == 10_000
        rig(quiet=True)
    assert rig.channel.state is S1
    assert rig.hertz == 0
    assert not rig.channel.ed
    assert rig.code == code
    rig.module.stop_controller(False)
    assert rig(RUN, g1=0, cycles=5) is S1
    rig.start()


@pytest.mark.requirement("PTO-207", "PTO-208", "PTO-202", "PTO-091", "PTO-189", "PTO-305", "PTO-018")
def test_short_circuit():
    """An error of an output stops both channels with 1; removed and acknowledged on both ways, they can be
    enabled again.
    """
    rig = running(diagnostics=True)
    rig.module.short_circuit(1, True)
    rig()
    assert rig.channel.state is rig.second.state is S1
    assert (rig.got["G1_ZSW"], rig.got["G1_XIST2"]) == (0x8000, 1)
    assert rig.zsw1 & 0x0008
    assert rig.second.fault
    assert rig.hertz == 0
    rig(0x04D6, g1=ACKNOWLEDGE)
    assert rig.zsw1 & 0x0008
    assert rig.got["G1_ZSW"] & 0x8000
    rig(0x0456, g1=0)
    rig.module.short_circuit(1, False)
    rig(cycles=3)
    assert rig.zsw1 & 0x0048 == 0x0048
    assert rig.code == 1
    rig(0x04D6)
    assert not rig.zsw1 & 0x0008
    assert rig.code == 1
    rig(0x0456, g1=ACKNOWLEDGE)
    rig(g1=0)
    assert rig.got["G1_ZSW"] == 0
    rig(0x0450)
    rig.start()
    assert rig.module.diagnostics == []  # the channel with the short circuit has them off
    rig.module.short_circuit(0, True)
    assert [(number, text) for _, number, text in rig.module.diagnostics] == [
        (0, "error at a digital output")
    ]


@pytest.mark.requirement("PTO-209", "PTO-188", "PTO-100", "PTO-306")
def test_supply():
    """Without supply: outputs off, parking, no request for control; both revert, the count is kept."""
    rig = running(diagnostics=True, use_ed=True)
    rig.module.supply(False)
    before = rig.count
    assert not rig.channel.ed
    rig()
    assert rig.channel.state is S1
    assert (rig.got["G1_ZSW"], rig.got["G1_XIST1"], rig.zsw1 & 0x0200) == (0x4000, 0, 0)
    assert [text for _, _, text in rig.module.diagnostics] == ["load supply is missing"]
    rig.module.supply(True)
    rig(0x0450, seconds=0.2)
    assert (rig.got["G1_ZSW"], rig.got["G1_XIST1"], rig.zsw1 & 0x0200) == (0, before, 0x0200)
    rig.start()


@pytest.mark.requirement("PTO-210", "PTO-308")
def test_module_fault_and_wrong_frames():
    """A module that is gone sends zeros that are bad; frames of a wrong length count as lost."""
    rig = running()
    rig.module.failed = True
    assert rig.module.transmit(0) == (bytes(16), False)
    assert not rig.module.receive(0, rig.frame())
    rig.module.failed = False
    for _ in range(2):
        rig.scheduler.run_for(4 * MS)
        rig.module.receive(0, bytes(7))
        rig.module.cycle()
    assert rig.channel.state is S4
    rig.scheduler.run_for(4 * MS)
    rig.module.receive(0, bytes(7))
    rig.module.cycle()
    assert rig.channel.state is S1


# -- everything at random ------------------------------------------------------------------------------

WORDS = st.builds(
    lambda functions, command, measure, rest: functions | command << 4 | measure << 7 | rest,
    st.integers(0, 15),
    st.integers(0, 4),
    st.integers(0, 1),
    st.sampled_from([0, 0, 0, 0x0800, 0x1000, 0x2000, PARK, ACKNOWLEDGE]),
)
EVENTS = st.sampled_from([None, None, "RS", "MI", "short", "supply", "stop", "quiet"])


@pytest.mark.exhaustive
@pytest.mark.requirement("PTO-313", "PTO-108", "PTO-111", "PTO-113", "PTO-114", "PTO-116")
@given(
    st.lists(
        st.tuples(st.sampled_from([*SEQUENCE, RUN]), WORDS, EVENTS, st.booleans(), st.integers(1, 30)),
        max_size=30,
    )
)
def test_any_encoder_words(steps):
    """Never a function bit with parking; an error code exactly with bit 15; bits that the module has not are
    0.
    """
    rig = Rig(**FAST)
    rig.start(0x4000)
    for word, g1, event, on, cycles in steps:
        if event in {"RS", "MI"}:
            rig.channel.drive_input(event, on)
        elif event == "short":
            rig.module.short_circuit(0, on)
        elif event == "supply":
            rig.module.supply(on)
        elif event == "stop":
            rig.module.stop_controller(on)
        for _ in range(cycles):
            rig(word, g1=g1, quiet=event == "quiet")
            zsw, xist2 = rig.got["G1_ZSW"], rig.got["G1_XIST2"]
            assert zsw & 0x36CC == 0
            if zsw & PARK:
                assert zsw == PARK
                assert rig.got["G1_XIST1"] == xist2 == 0
            state = rig.channel.interface.state
            if zsw & 0x8000:
                assert xist2 in ENCODER_ERRORS
            elif state not in {EncoderState.SD4, EncoderState.SD11}:
                assert xist2 == 0


# -- the motor behind it -------------------------------------------------------------------------------


def with_motor(**config):
    rig = Rig(ramp_stop_ms=500)
    rig.channel.motor = StepperMotor(rig.channel.generator, StepperConfig(**config))
    return rig


@pytest.mark.requirement("PTO-293")
def test_motor_follows():
    """Within its torque the shaft stands where the pulses say."""
    rig = with_motor()
    rig.start(0x4000, seconds=2)
    rig(0x045E, seconds=1)
    assert rig.channel.motor.lost == 0
    assert rig.channel.motor.angle == pytest.approx(rig.count / 200 * math.tau)


@pytest.mark.requirement("PTO-293", "PTO-280", "PTO-310")
def test_overload_loses_steps():
    """Overloaded, the shaft stops and the pulse counter knows nothing; it is caught again whole periods away,
    below the start frequency.
    """
    rig = with_motor()
    motor = rig.channel.motor
    rig.start(0x4000, seconds=1)
    motor.load_torque = 0.5  # at 10 kHz the motor has 1 Nm * 2 kHz / 10 kHz
    rig()
    assert motor.stalled
    stood, count = motor.angle, rig.count
    rig(seconds=0.1)
    assert motor.angle == stood
    assert rig.count == count + 1000
    assert rig.got["G1_ZSW"] == 0
    assert rig.zsw1 & 0x000F == 0x0007
    motor.load_torque = 0.0
    rig(seconds=0.1)
    assert motor.stalled  # too fast to be caught
    rig(nsoll=0, seconds=1)
    assert not motor.stalled
    assert motor.lost > 2000
    assert motor.lost % 4 == 0
    assert motor.angle == pytest.approx((rig.count - motor.lost) / 200 * math.tau)
    lost = motor.lost
    rig(nsoll=0x0400, seconds=1)
    assert motor.lost == lost


@pytest.mark.requirement("PTO-293")
@pytest.mark.parametrize(("inertia", "stalls"), [(3e-5, False), (3e-3, True)])
def test_acceleration_needs_torque(inertia, stalls):
    """6000 rpm/s is 628 rad/s2: a hundredfold inertia needs 1.9 Nm of 1 Nm."""
    rig = with_motor(inertia=inertia)
    rig.start(0x4000, seconds=0.1)
    assert rig.channel.motor.stalled is stalls


@pytest.mark.parametrize(
    "wrong",
    [
        {"holding_torque": 0.0},
        {"inertia": -1.0},
        {"friction": -0.1},
        {"full_steps": 198},
        {"increments": 300},
    ],
    ids=lambda wrong: next(iter(wrong)),
)
def test_motor_configuration_is_checked(wrong):
    """A motor that cannot be is refused by the name of the value."""
    with pytest.raises(ConfigurationError, match=next(iter(wrong))):
        StepperConfig(**wrong)


@pytest.mark.requirement("PTO-294")
def test_trace_row():
    """The row of the trace holds state, words, setpoint and actual speed, ED and count."""
    rig = running(use_ed=True)
    rig(g1=SEARCH)
    assert rig.channel.trace_row() == (4, RUN, rig.zsw1, 3000.0, 3000.0, SEARCH, 1, True, rig.count)
    assert PtoConfig().frequency(-3000) == -10_000
