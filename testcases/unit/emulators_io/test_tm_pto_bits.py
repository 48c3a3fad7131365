"""TM PTO: every terminal, every bit of the words, the list of error codes, and what is decided where the
sources differ.
"""

from __future__ import annotations

from itertools import pairwise
from typing import get_args

import pytest

from emulators.drive.profidrive.statemachine import AxisState
from emulators.drive.pto_settings import Signals
from emulators.encoder.profidrive._abilities import EncoderState
from fieldbus.clock import MS, S
from fieldbus.profidrive import pto_telegram, telegram
from testcases.campaigns._pto_rig import RUN, S1, S2, S3, S4, S5A, S5B, SEQUENCE, Rig, channel_of

ACKNOWLEDGE = 0x8000
MAXIMUM = 0x4000


def moving(share=1.0, **config):
    """Return a rig in S4 at a share of 10 kHz."""
    config.setdefault("ramp_stop_ms", 1)
    rig = Rig(**config)
    rig.start(round(MAXIMUM * share), seconds=0.1)
    return rig


# -- terminals -----------------------------------------------------------------------------------------


@pytest.mark.exhaustive
@pytest.mark.requirement("PTO-001")
@pytest.mark.parametrize("kind", get_args(Signals))
@pytest.mark.parametrize("direction", [1, -1])
def test_pulse_outputs(kind, direction):
    """Both terminals carry pulses and direction, up and down, or two tracks, of as many periods as the count
    says.
    """
    rig = moving(0.01 * direction, signals=kind)
    generator = rig.channel.generator
    edges = {0: 0, 1: 0}
    before = generator.levels(kind)
    begin = rig.count
    for _ in range(40_000):  # 25 us each: 400 samples per pulse of 100 Hz
        rig.scheduler.run_for(25_000)
        generator.advance(rig.scheduler.now)
        now = generator.levels(kind)
        for terminal in (0, 1):
            edges[terminal] += now[terminal] and not before[terminal]
        before = now
    pulses = abs(rig.count - begin)
    assert pulses == pytest.approx(100, abs=1)
    forward = direction > 0
    if kind == "pulse_direction":
        assert edges[0] == pytest.approx(pulses, abs=1)
        assert (edges[1], before[1]) == (0, not forward)
    elif kind == "up_down":
        assert edges[not forward] == pytest.approx(pulses, abs=1)
        assert edges[forward] == 0
    else:
        periods = pulses / (4 if kind == "ab_fourfold" else 1)
        assert edges[0] == pytest.approx(periods, abs=1)
        assert edges[1] == pytest.approx(periods, abs=1)


@pytest.mark.requirement("PTO-002", "PTO-003", "PTO-298")
def test_enable_and_ready_terminals():
    """ED follows the state machine; DR low keeps the channel out of S4, a drop leads out, one within the
    filter does not.
    """
    rig = Rig(use_ed=True, use_dr=True, ramp_stop_ms=1, input_delay_ms=0.8)
    levels = []
    for word in SEQUENCE:
        rig(word)
        levels.append(rig.channel.ed)
    assert levels == [False, False, False, True]
    assert rig(seconds=0.2) is S3
    assert rig.hertz == 0
    rig.channel.drive_input("DR", True)
    assert rig(nsoll=MAXIMUM) is S4
    rig(seconds=0.1)
    rig.channel.drive_input("DR", False)
    rig.scheduler.run_for(MS // 2)
    rig.channel.drive_input("DR", True)
    rig()
    assert (rig.channel.state, rig.hertz) == (S4, 10_000)
    rig.channel.drive_input("DR", False)
    rig()
    assert (rig.channel.state, rig.hertz) == (S3, 0)
    assert not rig.zsw1 & 0x0004


@pytest.mark.requirement("PTO-004", "PTO-005", "PTO-011", "PTO-081", "PTO-107")
@pytest.mark.parametrize(
    ("terminal", "level", "words", "active", "shown"),
    [
        ("RS", True, (0x0011, 0x0001, 0x0021), 0x0001, 0x0010),
        ("MI", True, (0x0091, 0x0081, 0x00A1), 0x0001, 0x0010),
        ("MI", False, (0x0092, 0x0082, 0x00A2), 0x0002, 0x0020),
    ],
)
def test_capture_terminals(terminal, level, words, active, shown):
    """The mode chooses the terminal, the function its edge; the position is in pulses, without fine
    resolution.
    """
    rig = moving(use_rs=True, use_mi=True, input_delay_ms=0.004)
    rig.channel.drive_input(terminal, not level)
    rig()
    rig(g1=words[0])
    assert rig.got["G1_ZSW"] & 0x000F == active
    at = rig.count + 61
    rig.channel.at_count(at, lambda: rig.channel.drive_input(terminal, level))
    rig(cycles=3)
    assert rig.got["G1_ZSW"] & 0x000F == 0
    rig(g1=words[1])
    rig(g1=words[2])
    assert rig.got["G1_ZSW"] & 0x00F0 == shown
    assert rig.got["G1_XIST2"] == at  # 4 us of filter are less than a pulse
    assert rig.got["G1_XIST1"] == rig.count


# -- STW1 ----------------------------------------------------------------------------------------------

WITHDRAWN = [  # identifiers, bit, state one cycle later, frequency then, share of the ramp, state at the end, ED at the end  # noqa: E501
    (("PTO-045",), 0, S5A, True, 1.0, S2, False),
    (("PTO-047",), 2, S5B, True, 0.5, S1, False),
    (("PTO-048",), 3, S3, False, 0.0, S3, False),
    (("PTO-049",), 4, S4, False, 0.0, S4, True),
    (("PTO-051",), 6, S4, True, 1.0, S4, True),
    (("PTO-054",), 10, S1, False, 0.0, S1, False),
]


@pytest.mark.requirement(*(one for row in WITHDRAWN for one in row[0]), "PTO-297")
@pytest.mark.parametrize("share", [0.25, 0.5, 1.0, 2.0])
@pytest.mark.parametrize("row", WITHDRAWN, ids=lambda row: f"bit{row[1]}")
def test_a_bit_is_withdrawn(row, share):
    """At 25, 50, 100 and 200 % of the reference speed: state, ramp time, ED and end state are those of the
    bit.
    """
    _, bit, state, pulses, ramp, end, enabled = row
    rig = Rig(use_ed=True, ramp_stop_ms=2000, quick_stop_ms=1000, maximum_speed=6000.0)
    rig.start(min(0x7FFF, round(MAXIMUM * share)), seconds=2.2)
    full = rig.hertz
    assert full == pytest.approx(10_000 * share, rel=1e-4)
    assert rig(RUN & ~(1 << bit)) is state
    assert bool(rig.hertz) is pulses
    began = rig.scheduler.now
    while rig.hertz:
        assert rig.channel.ed
        rig()
    assert (rig.scheduler.now - began) / S == pytest.approx(ramp * share, abs=0.005)
    rig()
    assert (rig.channel.state, rig.channel.ed) == (end, enabled)
    assert rig.got["NIST_A"] == 0


@pytest.mark.requirement("PTO-052")
def test_fault_is_acknowledged_by_an_edge():
    """Bit 7 acknowledges with its rising edge only: one that stands since before does not."""
    rig = Rig()
    rig.start()
    rig.module.short_circuit(0, True)
    rig(RUN | 0x80)
    rig.module.short_circuit(0, False)
    rig(RUN | 0x80, cycles=3)
    assert rig.zsw1 & 0x0008
    rig(RUN)
    assert rig.zsw1 & 0x0008
    rig(RUN | 0x80)
    assert not rig.zsw1 & 0x0008


@pytest.mark.requirement("PTO-132")
@pytest.mark.parametrize("bit", [5, 8, 9, 11, 12, 13, 14, 15])
def test_bits_without_meaning(bit):
    """STW1 5, 8, 9 and 11 to 15 change nothing in any state."""
    plain, other = Rig(ramp_stop_ms=1), Rig(ramp_stop_ms=1)
    for word in (*SEQUENCE, RUN, 0x045E, 0x0456, 0x0457, RUN, 0x045B, 0x0456):
        plain(word, nsoll=0x1000, cycles=3)
        other(word | 1 << bit, nsoll=0x1000, cycles=3)
        assert plain.got == other.got
        assert plain.channel.state is other.channel.state


# -- STW2, G1_STW --------------------------------------------------------------------------------------


@pytest.mark.requirement("PTO-038")
def test_sign_of_life_of_the_standard_variant():
    """Of STW2 the bits 12 to 15 are the sign of life, the others are not evaluated; ZSW2 is 0."""
    rig = moving(variant="standard")
    rig.stw2 = 0x0FFF
    rig(cycles=20)
    assert (rig.code, rig.got["ZSW2"], rig.channel.state) == (0, 0, S4)
    for sign in range(1, 31):
        rig.stw2 = ((sign - 1) % 15 + 1) << 12 | sign & 0x0FFF
        rig()
        assert rig.code == 0
    rig(cycles=2)
    assert rig.code == 0xF02


@pytest.mark.requirement("PTO-127", "PTO-283", "PTO-196", "PTO-261")
def test_sign_of_life_that_is_not_zero():
    """Left at 0 nothing is watched; a value that stands is a failure with F02h, and S4 goes on."""
    rig = moving()
    rig(cycles=20)
    assert rig.code == 0
    rig.stw2 = 0x5000
    rig(cycles=3)
    assert rig.code == 0xF02
    assert rig.channel.state is S4
    assert rig.hertz == 10_000


COMMANDS = [(0, 0), (1, 0x0001), (2, 0), (3, 0), (4, None), (5, None), (6, None), (7, None)]


@pytest.mark.requirement("PTO-080", "PTO-196", "PTO-260")
@pytest.mark.parametrize(("command", "active"), COMMANDS)
def test_commands(command, active):
    """Bit 4 is the lowest of the number: 1 activates, 0, 2 and 3 do not, 4 to 7 end with F01h."""
    rig = moving(use_rs=True)
    rig(g1=0x0001 | command << 4)
    if active is None:
        assert (rig.got["G1_ZSW"], rig.got["G1_XIST2"]) == (0x8000, 0xF01)
    else:
        assert (rig.got["G1_ZSW"], rig.got["G1_XIST2"]) == (active, 0)
    rig(g1=0x0031)
    assert active is None or rig.got["G1_ZSW"] == 0


@pytest.mark.requirement("PTO-082")
@pytest.mark.parametrize("bit", [8, 9, 10])
def test_reserved_bits_of_the_encoder_word(bit):
    """G1_STW 8 to 10 change nothing, alone or with a search."""
    plain, other = moving(use_rs=True), moving(use_rs=True)
    for word in (0, 0x0011, 0x0011, 0x0031, 0x0091, 0):
        plain(g1=word)
        other(g1=word | 1 << bit)
        assert plain.got == other.got


@pytest.mark.requirement("PTO-087", "PTO-115", "PTO-118", "PTO-195", "PTO-258")
def test_error_and_its_acknowledgement():
    """Bit 15 with the code in G1_XIST2; bit 11 while it is acknowledged; all gone when the bit goes back."""
    rig = moving()
    rig(g1=0x2000)
    assert (rig.got["G1_ZSW"], rig.got["G1_XIST2"]) == (0x8000, 8)
    rig(g1=0, cycles=10)
    assert (rig.got["G1_ZSW"], rig.got["G1_XIST2"]) == (0x8000, 8)
    rig(g1=ACKNOWLEDGE, cycles=3)
    assert (rig.got["G1_ZSW"], rig.got["G1_XIST2"]) == (0x0800, 0)
    rig(g1=0)
    assert (rig.got["G1_ZSW"], rig.got["G1_XIST2"]) == (0, 0)


# -- ZSW1, NIST_A --------------------------------------------------------------------------------------

BITS = {
    "PTO-088": 0,
    "PTO-089": 1,
    "PTO-090": 2,
    "PTO-092": 4,
    "PTO-093": 5,
    "PTO-094": 6,
    "PTO-096": 8,
    "PTO-097": 9,
}
STEPS = [  # control word, bits 0, 1, 2, 4, 5, 6, 8, 9
    (0x0450, (0, 0, 0, 0, 0, 1, 0, 1)),
    (0x0454, (0, 0, 0, 0, 1, 1, 0, 1)),
    (0x0452, (0, 0, 0, 1, 0, 1, 0, 1)),
    (0x0456, (1, 0, 0, 1, 1, 0, 0, 1)),
    (0x0457, (1, 1, 0, 1, 1, 0, 0, 1)),
    (0x045F, (1, 1, 1, 1, 1, 0, 1, 1)),
    (0x0457, (1, 1, 0, 1, 1, 0, 0, 1)),
    (0x0456, (1, 0, 0, 1, 1, 0, 0, 1)),
]


@pytest.mark.requirement(*BITS, "PTO-095", "PTO-099")
def test_status_bits():
    """Each bit of ZSW1 in each state; 7 and 11 to 15 are 0 always, also in a fault."""
    rig = Rig()
    for word, bits in STEPS:
        rig(word)
        assert tuple(rig.zsw1 >> bit & 1 for bit in BITS.values()) == bits, f"{word:04X}"
        assert not rig.zsw1 & 0xF880
    rig.module.short_circuit(0, True)
    rig()
    assert rig.zsw1 & 0xF888 == 0x0008
    rig.module.supply(False)
    rig()
    assert not rig.zsw1 & 0x0200


@pytest.mark.requirement("PTO-098", "PTO-103", "PTO-288")
@pytest.mark.parametrize("direction", [1, -1])
def test_actual_speed(direction):
    """NIST_A follows the ramp, which is that of the stop, with its sign; bit 10 at the maximum and at rest
    only.
    """
    rig = Rig(ramp_stop_ms=1000, maximum_speed=1500.0)
    rig.start()
    assert rig.zsw1 & 0x0400
    rig(nsoll=MAXIMUM * direction)
    began = rig.scheduler.now
    values = []
    for _ in range(250):
        rig()
        share = (rig.scheduler.now - began) / S
        assert rig.got["NIST_A"] == pytest.approx(direction * 0x2000 * min(1.0, share), abs=1)
        assert bool(rig.zsw1 & 0x0400) is (share >= 1.0)
        values.append(rig.got["NIST_A"])
    assert values[-1] == direction * 0x2000
    assert all(abs(one) <= abs(other) for one, other in pairwise(values))
    rig(0x0457)
    assert rig.got["NIST_A"] == 0
    assert rig.zsw1 & 0x0400


@pytest.mark.requirement("PTO-142")
def test_power_on():
    """From power-on: S1, control requested, no parking, a count that is good, without any frame."""
    rig = Rig(start_value=77)
    rig(quiet=True)
    assert rig.channel.state is S1
    assert rig.zsw1 & 0x0240 == 0x0240
    assert (rig.got["G1_ZSW"], rig.got["G1_XIST1"]) == (0, 77)


@pytest.mark.requirement("PTO-206", "PTO-295")
def test_bus_interruption_is_a_stop_of_the_controller():
    """After an interruption longer than the watchdog all is as after a stop; the control word that is still
    there does not start.
    """
    stopped, cut = moving(use_ed=True), moving(use_ed=True)
    stopped.module.stop_controller(True)
    stopped()
    cut(cycles=3, quiet=True)
    assert {**stopped.got, "G1_XIST1": 0} == {**cut.got, "G1_XIST1": 0}
    for rig in (stopped, cut):
        assert (rig.channel.state, rig.hertz, rig.channel.ed) == (S1, 0, False)
        rig.module.stop_controller(False)
        assert rig(RUN, cycles=5) is S1
        rig.module.supply(False)
        rig()
        assert not rig.zsw1 & 0x0200
        rig.module.supply(True)
        rig.start()


# -- error codes ---------------------------------------------------------------------------------------


@pytest.mark.requirement("PTO-221")
def test_states_of_the_encoder_interface():
    """SD6, SD8 and SD9 do not exist."""
    assert [state.name for state in EncoderState] == [
        "SD1",
        "SD2",
        "SD3",
        "SD4",
        "SD5",
        "SD7",
        "SD10",
        "SD11",
        "SD12",
    ]


PRODUCED = {  # identifier: code, how
    "PTO-251": (0x0001, "short", ()),
    "PTO-253": (0x0003, "strict", (0x4000,)),
    "PTO-254": (0x0004, "", (0x0011, 0x0091)),
    "PTO-255": (0x0005, "mark", (0x0091,)),
    "PTO-256": (0x0006, "", (0x0091, 0x0011)),
    "PTO-257": (0x0007, "value", (0x0021,)),
    "PTO-258": (0x0008, "", (0x2000,)),
    "PTO-260": (0x0F01, "", (0x0040,)),
}


@pytest.mark.requirement(*PRODUCED, "PTO-282")
@pytest.mark.parametrize("row", PRODUCED.values(), ids=PRODUCED)
def test_codes_of_the_module(row):
    """The codes that the module uses come for what they stand for; 3 in the strict variant only."""
    code, how, words = row
    rig = moving(use_rs=True, use_mi=True, strict_parking=how == "strict")
    if how == "short":
        rig.module.short_circuit(0, True)
        rig()
    elif how in ("mark", "value"):
        mode = 0x80 if how == "value" else 0
        rig(g1=mode | 0x11)
        rig.channel.drive_input("MI" if mode else "RS", True)
        rig(cycles=2)
        rig(g1=mode | 0x01)
        rig(g1=mode | 0x21)
        assert rig.got["G1_ZSW"] & 0x10
    for word in words:
        rig(g1=word)
    assert rig.code == code
    if how == "strict":
        lenient = moving()
        lenient(g1=0x4000)
        assert (lenient.got["G1_ZSW"], lenient.got["G1_XIST1"]) == (0x4000, 0)


@pytest.mark.exhaustive
@pytest.mark.requirement("PTO-252", "PTO-259", "PTO-262", "PTO-263")
def test_codes_that_the_module_never_uses():
    """Whatever the control word of the encoder is, in whatever phase: 2, 0Ah, F04h and codes from 1001h on
    never come.
    """
    seen = set()
    for first in (0x0000, 0x0011, 0x0091, 0x0021, 0x00A1, 0x4000):
        for bit in range(16):
            rig = Rig(use_rs=True, use_mi=True)
            rig(g1=first)
            rig.channel.drive_input("RS", True)
            rig.channel.drive_input("MI", True)
            rig(g1=first | 1 << bit)
            rig.stw2 = 0x1000
            rig(g1=1 << bit, cycles=3)
            seen.add(rig.code)
    assert seen <= {0, 1, 3, 4, 5, 6, 7, 8, 0xF01, 0xF02}
    assert {4, 6, 8, 0xF01, 0xF02} <= seen


# -- what is decided where sources differ --------------------------------------------------------------


@pytest.mark.requirement("PTO-135", "PTO-281", "PTO-290")
def test_two_variants_side_by_side():
    """The setpoint has 16 bits on the device and 32 in the standard telegram; both run in one module,
    independently.
    """
    device, standard = pto_telegram().setpoint, telegram(3).setpoint
    assert (device.length, standard.length) == (8, 10)
    rig = Rig(ramp_stop_ms=1, other=channel_of(variant="standard", ramp_stop_ms=1))
    for word in (*SEQUENCE, RUN, RUN):
        rig.module.receive(
            1, standard.encode({"STW1": word, "NSOLL_B": -0x1000_0000, "STW2": 0, "G1_STW": 0})
        )
        rig(word, nsoll=0x2000)
    assert rig.hertz == 5000
    assert rig.second.generator.frequency == -2500
    for word in (0x0457, 0x045F):
        rig.module.receive(1, standard.encode({"STW1": word, "NSOLL_B": 0, "STW2": 0, "G1_STW": 0}))
        rig()
        assert rig.channel.state is S4
    assert rig.hertz == 5000


@pytest.mark.requirement("PTO-284", "PTO-299")
def test_ends_of_the_setpoint():
    """7FFFh is 199.9939 %, 8000h -200 %; a sign that changes in every cycle never gets through the pause."""
    rig = moving(maximum_speed=6000.0)
    for nsoll, percent in ((0x7FFF, 199.99390), (-0x8000, -200.0), (1, 0.0061035), (-1, -0.0061035)):
        rig(nsoll=nsoll, cycles=10)
        assert rig.channel.speed_rpm / 30.0 == pytest.approx(percent, rel=1e-5)
        assert rig.got["NIST_A"] == nsoll
    rig = moving(0.0, reversal_pause_ms=4, ramp_stop_ms=1)
    for sign in [1, -1] * 20:
        before = rig.count
        rig(nsoll=sign * MAXIMUM)
        assert rig.count >= before  # it brakes, and is turned back before the pause is over
    assert rig.count > 100
    limited = moving(maximum_speed=3000.0)
    limited(nsoll=0x7FFF, cycles=5)
    assert (limited.hertz, limited.got["NIST_A"], bool(limited.zsw1 & 0x0400)) == (10_000, MAXIMUM, True)


@pytest.mark.requirement("PTO-287")
def test_ready_is_lost_in_operation():
    """Without DR the channel waits in S3 and goes on by itself when DR is back."""
    rig = Rig(use_dr=True, ramp_stop_ms=1)
    rig.channel.drive_input("DR", True)
    rig.scheduler.run_for(MS)
    rig.start(MAXIMUM, seconds=0.1)
    rig.channel.drive_input("DR", False)
    assert rig() is S3
    assert rig(cycles=50) is S3
    rig.channel.drive_input("DR", True)
    assert rig() is S4
    rig(cycles=3)
    assert rig.hertz == 10_000


@pytest.mark.requirement("PTO-289")
@pytest.mark.parametrize(("word", "ramp_ms"), [(0x045E, 100), (0x045B, 50)])
def test_when_the_enable_falls(word, ramp_ms):
    """ED stays high as long as a pulse comes, and is low in the cycle in which the speed has reached 0."""
    rig = Rig(use_ed=True, ramp_stop_ms=100, quick_stop_ms=50)
    rig.start(MAXIMUM, seconds=0.2)
    rig(word)
    for _ in range(ramp_ms // 4 + 3):
        assert rig.channel.ed is (rig.channel.state in {S5A, S5B})
        if rig.channel.state not in {S5A, S5B}:
            break
        assert rig.hertz > 0 or rig.channel.ed
        rig()
    assert not rig.channel.ed
    assert rig.hertz == 0
    assert rig.channel.state is (AxisState.S2 if word == 0x045E else AxisState.S1)


@pytest.mark.requirement("PTO-307")
@pytest.mark.parametrize("near", [0x7FFF_FFF0, 0xFFFF_FFF0])
@pytest.mark.parametrize("direction", [1, -1])
def test_count_near_its_ends(near, direction):
    """Around 2^31 and 2^32 the differences of G1_XIST1 modulo 2^32 are those of the pulses."""
    rig = moving(0.0, start_value=near)
    last, total = rig.got["G1_XIST1"], 0
    rig(nsoll=direction * 0x0100)
    for _ in range(200):
        rig()
        step = (rig.got["G1_XIST1"] - last + 0x8000_0000) % 0x1_0000_0000 - 0x8000_0000
        last = rig.got["G1_XIST1"]
        total += step
        assert abs(step) <= 1
        assert total == rig.count
    assert total * direction > 100
