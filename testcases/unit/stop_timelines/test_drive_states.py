"""Bits of STW1 and ZSW1, states and transitions of a PROFIdrive drive, led word by word over the bus (section
8.1).
"""

from __future__ import annotations

import pytest

from fieldbus.profidrive import to_n4
from hil.bench.bench import Bench
from hil.bench.bench_file import parse
from hil.faults import Injector
from testcases.unit.stop_timelines.telegram_record import CYCLE_S, ZSW1_MASK

TEXT = """
[bench]
name = "a drive without an axis"
kind = "virtual"
cycle_ms = 4
[segment.can0]
bitrate = 1_000_000
[drive.drive1]
profile = "profidrive"
telegram = 3
segment = "can0"
node_id = 5
max_speed_rpm = 3000.0
off1_ramp_s = 1.0
off3_ramp_s = 0.5
{brake}
[drive.drive1.profidrive]
operating_mode = {mode}
{more}
"""
BRAKE = "[drive.drive1.brake]\ntorque_nm = 0.5\n"
IDLE, OPERATE, ON_ONLY = 0x047E, 0x047F, 0x0477
OFF2, OFF3, OFF2_OFF1, ALL_OFF = 0x047D, 0x047B, 0x047C, 0x0478
WAY = {"S1": [0x0478], "S2": [ALL_OFF, IDLE], "S3": [ALL_OFF, IDLE, ON_ONLY], "S4": [ALL_OFF, IDLE, OPERATE]}


class Led:
    """A drive and its telegrams."""

    def __init__(self, mode=3, more="", brake=""):
        self.bench = Bench(parse(TEXT.format(mode=mode, more=more, brake=brake), "drive.toml"), seed=1)
        self.master = self.bench.telegram()
        self.drive = self.bench.drive()
        self.send(ALL_OFF, cycles=20)  # until the drive has followed the sign of life (PD-131)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.bench.close()

    def send(self, *words, cycles=4, rpm=0.0):
        for word in words:
            self.master.send(STW1=word, NSOLL_B=to_n4(rpm / 3000.0))
            self.bench.run_for(CYCLE_S * cycles)

    def reach(self, state, rpm=1500.0):
        """Lead the drive into a state; in S4 and S5 it turns."""
        if state in WAY:
            self.send(*WAY[state])
            if state == "S4":
                self.send(OPERATE, rpm=rpm, cycles=250)
                assert self.rpm == pytest.approx(rpm, abs=2.0)
        else:
            self.reach("S4", rpm)
            self.send(IDLE if state == "S5 OFF1" else OFF3, cycles=10)
        assert self.state == state[:2]
        return self

    @property
    def zsw1(self):
        return self.master["ZSW1"] & ZSW1_MASK

    @property
    def state(self):
        return self.drive.state.text[:2]

    @property
    def rpm(self):
        return self.drive.mechanics.motor_speed * 30.0 / 3.141592653589793

    @property
    def pulses(self):
        return self.drive.core.enabled


@pytest.mark.parametrize(
    ("words", "state", "zsw1", "brake_closed"),
    [
        pytest.param(
            [OFF2_OFF1, OPERATE], "S1", 0x0270, True, id="S1", marks=pytest.mark.requirement("STP-268")
        ),
        pytest.param([OFF2_OFF1], "S1", 0x0260, True, id="S1 OFF2", marks=pytest.mark.requirement("STP-268")),
        pytest.param([0x047A], "S1", 0x0250, True, id="S1 OFF3", marks=pytest.mark.requirement("STP-268")),
        pytest.param(
            [ALL_OFF], "S1", 0x0240, True, id="S1 OFF2 OFF3", marks=pytest.mark.requirement("STP-268")
        ),
        pytest.param(WAY["S2"], "S2", 0x0231, True, id="S2", marks=pytest.mark.requirement("STP-269")),
        pytest.param(WAY["S3"], "S3", 0x0233, None, id="S3", marks=pytest.mark.requirement("STP-270")),
        pytest.param(WAY["S4"], "S4", 0x0237, False, id="S4", marks=pytest.mark.requirement("STP-271")),
    ],
)
def test_states_and_their_status_word(words, state, zsw1, brake_closed):
    """Every state shows its bits; the brake is closed below S3 and open in S4."""
    with Led(brake=BRAKE) as led:
        led.send(*words)
        assert (led.state, f"{led.zsw1:04X}") == (state, f"{zsw1:04X}")
        if brake_closed is not None:
            assert led.drive.core.brake.closed is brake_closed


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-272")
@pytest.mark.parametrize(("word", "zsw1"), [(IDLE, 0x0233), (OFF3, 0x0213)])
def test_status_word_of_a_ramp(word, zsw1):
    """S5: pulses are on while the drive brakes on its own; bit 5 tells the quick stop."""
    with Led().reach("S4") as led:
        led.send(word, cycles=10, rpm=1500.0)
        assert (led.state, led.pulses, f"{led.zsw1:04X}") == ("S5", True, f"{zsw1:04X}")
        assert led.rpm < 1450.0


TRANSITIONS = [
    ("STP-273", "S1", IDLE, "S2", False),
    ("STP-273", "S1", OPERATE, "S1", False),
    ("STP-274", "S2", ON_ONLY, "S3", False),
    ("STP-275", "S2", OFF2_OFF1, "S1", False),
    ("STP-275", "S2", 0x047A, "S1", False),
    ("STP-275", "S3", 0x0475, "S1", False),
    ("STP-275", "S3", 0x0473, "S1", False),
    ("STP-276", "S3", 0x0476, "S2", False),
    ("STP-277", "S3", OPERATE, "S4", True),
    ("STP-278", "S4", ON_ONLY, "S3", False),
    ("STP-279", "S4", IDLE, "S5", True),
    ("STP-280", "S4", OFF3, "S5", True),
    ("STP-280", "S5 OFF1", 0x047A, "S5", True),
    ("STP-281", "S3", 0x0475, "S1", False),
    ("STP-281", "S4", OFF2, "S1", False),
    ("STP-281", "S5 OFF1", OFF2_OFF1, "S1", False),
    ("STP-281", "S5 OFF3", 0x0479, "S1", False),
    ("STP-282", "S5 OFF1", OPERATE, "S4", True),
    ("STP-283", "S5 OFF3", OPERATE, "S5", True),
    ("STP-284", "S5 OFF1", 0x0476, "S2", False),
    ("STP-285", "S5 OFF3", 0x0473, "S1", False),
]  # fmt: skip


@pytest.mark.parametrize(
    ("start", "word", "state", "pulses"),
    [
        pytest.param(
            start, word, state, pulses, id=f"{start}-{word:04X}", marks=pytest.mark.requirement(identifier)
        )
        for identifier, start, word, state, pulses in TRANSITIONS
    ],
)
def test_transition(start, word, state, pulses):
    """The word leads from the state into the next; where the pulses go the motor coasts."""
    with Led().reach(start) as led:
        led.send(word, rpm=1500.0)
        assert (led.state, led.pulses) == (state, pulses)
        if not pulses:
            assert led.drive.core.torque == 0.0
        if start == "S5 OFF1" and word == 0x047A:
            assert led.zsw1 == 0x0213  # now a quick stop


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("word", "seconds", "state", "zsw1"),
    [
        pytest.param(
            IDLE,
            0.5,
            "S2",
            0x0231,
            marks=pytest.mark.requirement("STP-258", "STP-284", "STP-358", "STP-360", "STP-361"),
        ),
        pytest.param(
            OFF3,
            0.25,
            "S1",
            0x0250,
            marks=pytest.mark.requirement("STP-260", "STP-285", "STP-358", "STP-360", "STP-361"),
        ),
    ],
)
def test_ramp_of_the_drive(word, seconds, state, zsw1):
    """From 1500 of 3000 rpm the ramp takes half its time (p1121 = 1.0 s, p1135 = 0.5 s); then pulses off, S2
    or S1.
    """
    with Led().reach("S4") as led:
        started = led.bench.now_s
        led.master.send(STW1=word)
        assert led.bench.run_until(lambda: not led.pulses, 2.0)
        assert led.bench.now_s - started == pytest.approx(seconds, abs=3 * CYCLE_S)
        led.send(word)
        assert (led.state, led.zsw1) == (state, zsw1)


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-259", "STP-261", "STP-358", "STP-360", "STP-361")
@pytest.mark.parametrize(("word", "state"), [(OFF2, "S1"), (ON_ONLY, "S3")])
def test_coasting(word, state):
    """STW1.1 = 0 or STW1.3 = 0: no torque at once, only friction brakes."""
    with Led().reach("S4") as led:
        led.send(word, cycles=2, rpm=1500.0)
        assert (led.state, led.drive.core.torque) == (state, 0.0)
        before = led.rpm
        led.send(word, cycles=25, rpm=1500.0)
        assert before - 200.0 < led.rpm < before


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("start", "word", "interrupted"),
    [
        pytest.param("S5 OFF1", IDLE, True, id="OFF1", marks=pytest.mark.requirement("STP-282", "STP-359")),
        pytest.param("S5 OFF3", OFF3, False, id="OFF3", marks=pytest.mark.requirement("STP-283", "STP-359")),
        pytest.param("S4", OFF2, False, id="OFF2", marks=pytest.mark.requirement("STP-286", "STP-359")),
    ],
)
def test_what_can_be_interrupted(start, word, interrupted):
    """Given back at once, ON ends an OFF1 ramp; a quick stop goes on to standstill; after OFF2 the drive
    waits for ON = 0.
    """
    with Led().reach(start) as led:
        led.send(word, cycles=2)
        led.send(OPERATE, rpm=1500.0, cycles=150)
        assert (led.state == "S4") is interrupted
        assert (led.rpm > 1400.0) is interrupted
        if not interrupted:
            assert led.state == "S1"
            led.send(IDLE, OPERATE)
            assert led.state == "S4"


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("word", "low", "high"),
    [
        pytest.param(0x046F, -1.0, 1.0, id="bit 4: output 0", marks=pytest.mark.requirement("STP-262")),
        pytest.param(0x045F, 598.0, 602.0, id="bit 5: frozen", marks=pytest.mark.requirement("STP-263")),
        pytest.param(0x043F, -1.0, 1.0, id="bit 6: setpoint 0", marks=pytest.mark.requirement("STP-264")),
    ],
)
def test_bits_of_the_ramp_generator(word, low, high):
    """Mode 1, a new setpoint of 900 rpm: the drive stays in S4 and its ramp generator does what the bit
    says.
    """
    with Led(mode=1, more="ramp_up_s = 1.0").reach("S4", 600.0) as led:
        led.send(word, rpm=900.0, cycles=150)
        assert (led.state, led.zsw1) == ("S4", 0x0237)
        assert low <= led.rpm <= high
        led.send(OPERATE, rpm=900.0, cycles=125)
        assert led.rpm == pytest.approx(900.0, abs=2.0)


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-265")
def test_acknowledging_is_an_edge():
    """The fault stays while bit 7 is only held, and goes with its rising edge."""
    with Led().reach("S4") as led:
        Injector(led.bench).inject("drive.fault", "drive1", code=0x2310)
        led.send(OPERATE)
        assert led.master["ZSW1"] & 0x0008
        led.send(IDLE, cycles=200)
        assert led.master["ZSW1"] & 0x0008
        led.send(IDLE | 0x0080)
        assert not led.master["ZSW1"] & 0x0008


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-267")
def test_without_control_by_plc_the_telegram_is_ignored():
    """Bit 10 = 0: neither OFF2 nor a new setpoint arrives."""
    with Led().reach("S4") as led:
        led.send(OFF2 & ~0x0400, rpm=300.0, cycles=50)
        assert led.state == "S4"
        assert led.rpm == pytest.approx(1500.0, abs=2.0)
