"""The PROFIdrive encoder as a device: telegrams 81 to 84, sign of life, faults; rotary and linear."""

from __future__ import annotations

import math
from dataclasses import fields

import pytest
from hypothesis import given
from hypothesis import strategies as st

from emulators.encoder import Mounting
from emulators.encoder.profidrive import EncoderAbilities, EncoderFormat
from emulators.encoder.profidrive.device import ProfidriveEncoder, ProfidriveEncoderConfig
from emulators.encoder.profidrive.settings import ProfidriveEncoderSettings
from emulators.mechanics import DrivenShaft, SwitchModel
from fieldbus.clock import MS, VirtualScheduler
from fieldbus.errors import ConfigurationError
from fieldbus.profidrive import telegram

CYCLE = 2 * MS
CONTROL, ACKNOWLEDGE_FAULT = 0x0400, 0x0080
ACKNOWLEDGE = 0x8000
MULTI_TURN = EncoderFormat(periods=4096, revolutions=256, shift_xist1=2, shift_xist2=0, wide=True)
INCREMENTAL = EncoderFormat(periods=1024, interpolation_bits=2, shift_xist1=11)
SCALE = EncoderFormat(periods=50_000, grid_nm=20_000, interpolation_bits=4, shift_xist1=6)  # 1 m, 1.25 um

SETTINGS = {one.name for one in fields(ProfidriveEncoderSettings)}


class Rig:
    """A device on a driven shaft, and a controller that talks to it once per cycle."""

    def __init__(self, form=MULTI_TURN, *, place=0.0, probes=(), marks=(), on=True, **config):
        settings = {"sign_of_life": False}
        settings |= {key: config.pop(key) for key in SETTINGS & config.keys()}
        self.scheduler = VirtualScheduler()
        self.shaft = DrivenShaft(self.scheduler, position=place)
        self.device = ProfidriveEncoder(
            self.scheduler,
            ProfidriveEncoderConfig(form=form, settings=ProfidriveEncoderSettings(**settings), **config),
            Mounting(lambda: self.shaft.position),
            probes=probes,
            marks=marks,
        )
        self.telegram = telegram(self.device.config.settings.telegram)
        self.sign = 0
        self.got = {}
        if on:
            self.device.power_on()

    def __call__(self, g1_stw=0, *, stw2=CONTROL, cycles=1, sign=False):
        for _ in range(cycles):
            self.scheduler.run_for(CYCLE)
            if sign:
                self.sign = self.sign % 15 + 1
            word = stw2 | self.sign << 12
            self.device.receive(self.telegram.setpoint.encode({"STW2_ENC": word, "G1_STW": g1_stw}))
            self.device.cycle()
            self.got = self.telegram.actual.decode(self.device.transmit())
        return self.got


@pytest.mark.requirement("PD-010", "PD-011", "PD-012", "PD-013", "PD-035")
@pytest.mark.parametrize("number", [81, 82, 83, 84])
def test_telegram(number):
    """Each telegram carries position, absolute value and speed of the shaft as its layout says."""
    rig = Rig(telegram=number, place=math.pi)
    rig.shaft.turn(1500.0 * math.tau / 60.0)
    got = rig(0x2000, cycles=10)
    turned = 25.0 * 10 * 0.002
    assert got["G1_ZSW"] == 0x2000
    assert got["ZSW2_ENC"] == 0x0200
    assert got["G1_XIST2"] == round((0.5 + turned) * 4096)
    if number == 84:
        assert got["G1_XIST3"] == round(turned * 4096) * 4
    else:
        assert got["G1_XIST1"] == round(turned * 4096) * 4
    if number == 82:
        assert got["NIST_A"] == pytest.approx(0x2000, abs=1)
    elif number > 82:
        assert got["NIST_B"] == pytest.approx(0x2000_0000, rel=1e-6)


@pytest.mark.requirement("PD-036")
def test_speed_is_held_at_the_end():
    """Above 200 % the speed stays at the end of its format."""
    rig = Rig(telegram=82)
    rig.shaft.turn(-7000.0 * math.tau / 60.0)
    assert rig(cycles=3)["NIST_A"] == -0x8000


@pytest.mark.requirement("PD-172", "PD-171")
def test_power_cycle():
    """An absolute encoder knows its place again, an incremental one begins at 0; nothing is sent without
    supply.
    """
    for form, first, second in ((MULTI_TURN, 2048, 3072), (INCREMENTAL, 0, 0)):
        rig = Rig(form, place=math.pi)
        word = 0x2000 if form.absolute else 0
        rig.shaft.place(1.5 * math.pi)
        assert rig(word)["G1_XIST1"] == (form.periods << form.shift_xist1) // 4
        assert rig.got["G1_XIST2"] == second
        rig.shaft.place(math.pi)
        rig.device.power_off()
        assert rig.device.transmit() is None
        assert not rig.device.receive(bytes(4))
        rig.device.cycle()
        rig.device.power_on()
        assert rig(word)["G1_XIST1"] == 0
        assert rig.got["G1_XIST2"] == first


@pytest.mark.requirement("PD-190")
def test_linear_encoder():
    """A scale counts grid lines and fine bits; its reference mark is latched at its place."""
    rig = Rig(SCALE, zero_mark=12_345 << 4, place=0.2, reference_speed=1000.0, telegram=82)
    rig.shaft.turn(0.5)
    rig(0x0011)
    rig(0x0011, cycles=50)
    assert rig.got["NIST_A"] == pytest.approx(0x2000, abs=1)
    rig(0)
    got = rig(0x0021)
    assert got["G1_ZSW"] == 0x0010
    way_m = 12_345 * 20e-6 - 0.2
    assert got["G1_XIST2"] == round(way_m / 20e-6 * 16) * 4
    assert got["G1_XIST1"] == pytest.approx((rig.shaft.position - 0.2) / 20e-6 * 64, abs=4)


@pytest.mark.requirement("PD-143", "PD-173")
def test_probe_and_cam_between_two_cycles():
    """A workpiece and a cam that are passed within one cycle are latched where their edges are."""
    probe = SwitchModel(low=1.00, high=1.05)
    cam = SwitchModel(low=1.02, high=2.0)
    rig = Rig(
        EncoderFormat(periods=10_000, shift_xist1=0, revolutions=0),
        probes=(probe,),
        marks=(cam,),
        abilities=EncoderAbilities(reference_marks=2),
    )
    rig.shaft.turn(100.0)
    rig(0x0093, cycles=8)
    assert rig.got["G1_ZSW"] == 0
    increments = 10_000 / math.tau
    for function, place in ((1, 1.00), (2, 1.05)):
        rig(0x00A0 | function)
        assert rig.got["G1_ZSW"] == function << 4
        assert rig.got["G1_XIST2"] == round(place * increments)
    rig(0x0080)
    rig.shaft.place(0.0)
    rig(0x0012, cycles=2)
    rig.shaft.turn(100.0)
    rig(0x0012, cycles=8)
    rig(0)
    rig(0x0022)
    assert rig.got["G1_XIST2"] == round(1.02 * increments)


@pytest.mark.requirement("PD-084", "PD-076")
def test_control_by_plc():
    """Without control by PLC the encoder control word is not taken over; in compatibility mode it is."""
    for compatible, state in ((False, 0), (True, 0x4000)):
        rig = Rig(compatible=compatible)
        assert rig(0x4000, stw2=0)["G1_ZSW"] == state
        assert rig(0x4000)["G1_ZSW"] == 0x4000
        rig(0, stw2=0, cycles=60)
        assert rig.got["G1_ZSW"] == (0x4000 if not compatible else 0)


@pytest.mark.requirement("PD-084", "PD-133", "PD-137")
def test_faults_of_the_device():
    """An encoder error is a fault of the device, acknowledged by an edge of STW2_ENC.7; a lasting one opens a
    new situation.
    """
    rig = Rig()
    rig.device.interface.set_error(0x1001)
    assert rig()["G1_XIST2"] == 0x1001
    assert rig.got["ZSW2_ENC"] == 0x0208
    assert [message.number for message in rig.device.faults.present] == [0x1001]
    rig(stw2=CONTROL | ACKNOWLEDGE_FAULT)
    assert rig.got["ZSW2_ENC"] == 0x0208
    assert rig.device.faults.situations == 2
    rig.device.interface.clear_error(0x1001)
    rig(ACKNOWLEDGE, stw2=CONTROL | ACKNOWLEDGE_FAULT)
    assert rig.got["ZSW2_ENC"] == 0x0208  # no edge
    rig(0)
    rig(0, stw2=CONTROL | ACKNOWLEDGE_FAULT)
    assert rig.got == {"ZSW2_ENC": 0x0200, "G1_ZSW": 0, "G1_XIST1": 0, "G1_XIST2": 0}
    rig.device.warnings.add(7)
    assert rig()["ZSW2_ENC"] == 0x0280


@pytest.mark.requirement("PD-123", "PD-126", "PD-127", "PD-129", "PD-185")
def test_sign_of_life():
    """The encoder follows the controller's counter, shows its own, and reports 0F02h when the counter
    stands.
    """
    rig = Rig(sign_of_life=True, sign_of_life_tolerance=2)
    rig(cycles=40, sign=True)
    before = rig.got["ZSW2_ENC"] >> 12
    rig(sign=True)
    assert rig.got["ZSW2_ENC"] >> 12 == before % 15 + 1
    rig(cycles=2)
    assert rig.got["G1_ZSW"] == 0
    rig()
    assert rig.got["G1_ZSW"] == 0x8000
    assert rig.got["G1_XIST2"] == 0x0F02
    assert rig.got["ZSW2_ENC"] == 0x0208
    rig(ACKNOWLEDGE, cycles=1, sign=True)
    rig(0, cycles=40, sign=True)
    assert rig.got["G1_ZSW"] == 0
    assert rig.got["ZSW2_ENC"] >> 12


@pytest.mark.requirement("PD-130")
def test_no_sign_of_life_without_isochronous_mode():
    """In non-isochronous operation the counter is neither evaluated nor sent."""
    rig = Rig()
    rig(cycles=40, sign=True)
    rig(cycles=40)
    assert rig.got == {"ZSW2_ENC": 0x0200, "G1_ZSW": 0, "G1_XIST1": 0, "G1_XIST2": 0}


@pytest.mark.requirement("PD-030", "PD-081")
def test_wrong_length():
    """A frame of another length is refused and counted; control is requested with the first good one only."""
    rig = Rig()
    for wrong in (b"", bytes(3), bytes(5), bytes(100)):
        assert not rig.device.receive(wrong)
    rig.device.cycle()
    assert rig.telegram.actual.decode(rig.device.transmit())["ZSW2_ENC"] == 0
    assert rig.device.refused == 4
    assert rig()["ZSW2_ENC"] == 0x0200


@pytest.mark.exhaustive
@given(st.lists(st.binary(min_size=0, max_size=6) | st.binary(min_size=4, max_size=4), max_size=40))
def test_any_frames(frames):
    """Whatever comes, a frame of the right length goes out, and parking brings the encoder back."""
    rig = Rig(sign_of_life=True)
    rig.shaft.turn(50.0)
    for frame in frames:
        rig.scheduler.run_for(CYCLE)
        rig.device.receive(frame)
        rig.device.cycle()
        assert len(rig.device.transmit()) == rig.telegram.actual.length
    rig(0x4000)
    assert rig.got["G1_ZSW"] == 0x4000
    rig(0, cycles=60)
    assert rig.got["G1_ZSW"] & 0xD8FF == 0


@pytest.mark.requirement("PD-255")
def test_p979_of_the_device():
    """P979 comes from the configuration of the device."""
    assert Rig().device.p979[:6] == (0x5112, 0xC000_0004, 4096, 2, 0, 256)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"telegram": 3}, "81, 82, 83, 84"),
        ({"telegram": 84, "form": INCREMENTAL}, "wide"),
        ({"reference_speed": 0.0}, "reference_speed"),
        ({"mounting_offset": 5, "form": INCREMENTAL}, "mounting_offset"),
        ({"sign_of_life_tolerance": 70000}, "sign_of_life_tolerance"),
        ({"factor": 0}, "factor"),
        ({"zero_mark": 4096}, "zero_mark"),
        ({"probes": (SwitchModel.unreached(),) * 3}, "probes"),
        ({"marks": (SwitchModel.unreached(),)}, "marks"),
    ],
)
def test_configuration_is_checked(wrong, message):
    """What does not fit together is refused with its name."""
    with pytest.raises(ConfigurationError, match=message):
        Rig(**wrong)
