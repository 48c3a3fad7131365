"""Process images of NC axes: what every variable is linked to, and what it holds on a running bench."""

from struct import unpack

import pytest

from motion.nc.process_image import (
    COE,
    DRIVE_IN,
    DRIVE_OUT,
    ENCODER_IN,
    ENCODER_OUT,
    PROFIDRIVE,
    SOE,
    ProcessImage,
    signed,
)
from testcases.unit.hil.test_nc_drives import _bench
from testcases.unit.motion_nc.nc_rig import Rig

pytestmark = pytest.mark.exhaustive

_LINKS = {
    # row: (image, variable, bits, SoE, CoE, PROFIdrive)
    381: (ENCODER_IN, "nDataIn1", 32, "S-0-0051", "6064h", "G1_XIST1"),
    382: (ENCODER_IN, "nDataIn2", 32, None, None, "G1_XIST2"),
    383: (ENCODER_IN, "nState1", 8, None, None, "G1_ZSW low"),
    384: (ENCODER_IN, "nState2", 8, None, None, "G1_ZSW high"),
    385: (ENCODER_IN, "nState3", 8, None, None, None),
    386: (ENCODER_IN, "nState4", 8, None, None, None),
    387: (ENCODER_IN, "nDataIn3", 32, "S-0-0130", "60BAh", None),
    388: (ENCODER_IN, "nDataIn4", 32, "S-0-0131", "60BBh", None),
    389: (ENCODER_IN, "nDataIn5", 32, "S-0-0132", "60BCh", None),
    390: (ENCODER_IN, "nDataIn6", 32, "S-0-0133", "60BDh", None),
    391: (ENCODER_IN, "nState5", 8, "S-0-0409", "60B9h low", None),
    392: (ENCODER_IN, "nState6", 8, "S-0-0410", "60B9h high", None),
    393: (ENCODER_IN, "nState7", 8, "S-0-0411", None, None),
    394: (ENCODER_IN, "nState8", 8, "S-0-0412", None, None),
    395: (ENCODER_IN, "nDcInputTime", 32, None, None, None),
    396: (ENCODER_IN, "nDataIn7", 32, "S-0-0040", "606Ch", None),
    397: (ENCODER_OUT, "nDataOut1", 32, None, None, None),
    398: (ENCODER_OUT, "nDataOut2", 32, None, None, "XERR"),
    399: (ENCODER_OUT, "nCtrl1", 8, None, None, "G1_STW low"),
    400: (ENCODER_OUT, "nCtrl2", 8, None, None, "G1_STW high"),
    402: (ENCODER_OUT, "nCtrl5", 8, "S-0-0405 low", "60B8h low", None),
    403: (ENCODER_OUT, "nCtrl6", 8, "S-0-0406 low", "60B8h high", None),
    404: (DRIVE_IN, "nDataIn1", 32, "S-0-0189", "60F4h", None),
    406: (DRIVE_IN, "nState1", 8, "S-0-0135 low", "6041h low", "ZSW1 low"),
    407: (DRIVE_IN, "nState2", 8, "S-0-0135 high", "6041h high", "ZSW2 low"),
    409: (DRIVE_IN, "nState4", 8, None, None, None),
    410: (DRIVE_IN, "nDataIn3", 32, "S-0-0084", "6077h", None),
    412: (DRIVE_IN, "nState5", 8, None, "6061h", None),
    414: (DRIVE_IN, "nState8", 8, None, None, None),
    415: (DRIVE_IN, "nDcOutputTime", 32, None, None, None),
    416: (DRIVE_OUT, "nDataOut1", 32, "S-0-0047", "607Ah", "KPC"),
    417: (DRIVE_OUT, "nDataOut2", 32, "S-0-0036", "60FFh", "NSOLL_B"),
    418: (DRIVE_OUT, "nCtrl1", 8, "S-0-0134 low", "6040h low", "STW1 low"),
    419: (DRIVE_OUT, "nCtrl2", 8, "S-0-0134 high", "6040h high", "STW2 low"),
    420: (DRIVE_OUT, "nCtrl3", 8, None, None, None),
    422: (DRIVE_OUT, "nDataOut3", 32, "S-0-0081", "60B2h", None),
    423: (DRIVE_OUT, "nDataOut4", 32, "S-0-0080", "6071h", None),
    424: (DRIVE_OUT, "nDataOut5", 32, "S-0-0485", "60C9h", None),
    425: (DRIVE_OUT, "nDataOut6", 32, "S-0-0484", "60C8h", None),
    426: (DRIVE_OUT, "nCtrl5", 8, None, "6060h", None),
}
_RESERVED = {
    385: (ENCODER_IN, ("nState3",)),
    401: (ENCODER_OUT, ("nCtrl3", "nCtrl4", *(f"nDataOut{n}" for n in range(3, 7)), "nCtrl7", "nCtrl8")),
    405: (DRIVE_IN, ("nDataIn2",)),
    408: (DRIVE_IN, ("nState3",)),
    411: (DRIVE_IN, ("nDataIn4", "nDataIn5", "nDataIn6")),
    413: (DRIVE_IN, ("nState6", "nState7")),
    421: (DRIVE_OUT, ("nCtrl4", "nCtrl6", "nCtrl7", "nCtrl8")),
}
_SUBSTITUTES = (
    (ENCODER_IN, "nDataIn7", ("606Ch", "6044h")),
    (DRIVE_OUT, "nDataOut1", ("607Ah", "6062h")),
    (DRIVE_OUT, "nDataOut2", ("60FFh", "606Bh", "6042h")),
    (DRIVE_OUT, "nDataOut4", ("6071h", "6074h")),
)


def _variable(image, name):
    return next(one for one in image if one.name == name)


@pytest.mark.requirement(*(f"NC-{row}" for row in (*_LINKS, *_RESERVED)))
def test_links(subtests):
    """Every variable has its size and is linked to its object of each protocol; reserved ones to none."""
    for row, (image, name, bits, *links) in _LINKS.items():
        with subtests.test(row, name=name):
            one = _variable(image, name)
            assert one.bits == bits
            for protocol, link in zip((SOE, COE, PROFIDRIVE), links, strict=True):
                every = {part.split(" ")[0] for part in one.objects(protocol)}
                assert one.linked(protocol, every) == link
                assert one.linked(protocol, ()) is None
    for row, (image, names) in _RESERVED.items():
        for name in names:
            with subtests.test(row, name=name):
                one = _variable(image, name)
                assert one.meaning == "reserved"
                assert not one.soe + one.coe + one.profidrive


@pytest.mark.requirement("NC-396", "NC-416", "NC-417", "NC-423")
def test_substitutes(subtests):
    """Where the drive does not have an object, the next one of the list takes its place."""
    for image, name, order in _SUBSTITUTES:
        with subtests.test(name):
            one = _variable(image, name)
            for missing in range(len(order)):
                assert one.linked(COE, order[missing:]) == order[missing]


@pytest.mark.requirement(
    "NC-379", "NC-381", "NC-397", "NC-404", "NC-406", "NC-407", "NC-410", "NC-416", "NC-418"
)
def test_images_of_a_cia402_axis():
    """In csp: positions, following error, torque, and both bytes of control and status word are on the wire
    what they are in the images.
    """
    with _bench(axis='interface = "position"', drv__input_scaling_torque=0.1) as bench:
        x = bench.axis("x")
        assert set(x.image.links(DRIVE_OUT)) >= {"nDataOut1", "nCtrl1", "nCtrl2", "nCtrl5"}
        bench.wait_until(x.power().status, 1.0)
        x.move_velocity(150.0)
        bench.run_for(0.4)
        drive = bench.drive("motor")
        encoder, into, out = x.image.encoder_inputs(), x.image.drive_inputs(), x.image.drive_outputs()
        assert signed(encoder["nDataIn1"], 32) == x.object.encoder.hard_increments
        assert abs(drive.slave.get(0x6064, 0) - signed(encoder["nDataIn1"], 32)) < 131072 * 150 / 10 * 0.01
        assert x.image.encoder_outputs()["nDataOut1"] == encoder["nDataIn1"]
        status = into["nState1"] | into["nState2"] << 8
        assert status == drive.slave.get(0x6041, 0)
        assert into["nState1"] & 0x6F == 0x27
        assert signed(into["nDataIn1"], 32) > 0
        assert into["nState4"] == encoder["nState4"] == 0
        control = out["nCtrl1"] | out["nCtrl2"] << 8
        assert control == drive.slave.get(0x6040, 0) == 0x0F
        assert out["nCtrl5"] == drive.slave.get(0x6060, 0) == 8
        assert signed(out["nDataOut1"], 32) == x.object.outputs.position
        assert out["nCtrl3"] == 0x80  # the NC has no velocity output
        packed = x.image.pack_drive_outputs()
        assert len(packed) == 40
        assert unpack("<II4B", packed[:12]) == (
            out["nDataOut1"],
            out.get("nDataOut2", 0),
            out["nCtrl1"],
            out["nCtrl2"],
            out["nCtrl3"],
            0,
        )
        assert unpack("<I", x.image.pack_encoder_inputs()[:4])[0] == encoder["nDataIn1"]


@pytest.mark.requirement(
    "NC-381", "NC-383", "NC-398", "NC-399", "NC-406", "NC-416", "NC-417", "NC-418", "NC-756"
)
def test_images_of_a_profidrive_axis():
    """Telegram 5: G1_XIST1, G1_ZSW, ZSW1, STW1, NSOLL_B, XERR and KPC are the variables of the images."""
    drive = 'profile = "profidrive"\ntelegram = 5'
    with _bench(drive=drive, axis='interface = "position"') as bench:
        x = bench.axis("x")
        bench.wait_until(x.power().status, 1.0)
        x.move_velocity(100.0)
        bench.run_for(0.3)
        words = x.object.device.words
        assert x.image.links(DRIVE_OUT)["nDataOut2"] == "NSOLL_B"
        encoder, out = x.image.encoder_inputs(), x.image.drive_outputs()
        assert encoder["nDataIn1"] == words["G1_XIST1"] & 0xFFFFFFFF
        assert encoder["nState1"] == words["G1_ZSW"] & 0xFF
        assert x.image.encoder_outputs()["nDataOut2"] == words["XERR"]
        assert x.image.encoder_outputs()["nCtrl1"] == words["G1_STW"] & 0xFF
        assert x.image.drive_inputs()["nState1"] == words["ZSW1"] & 0xFF
        assert out["nCtrl1"] == words["STW1"] & 0xFF
        assert out["nDataOut2"] == words["NSOLL_B"] & 0xFFFFFFFF


@pytest.mark.requirement("NC-380", "NC-123", "NC-386", "NC-409", "NC-414", "NC-395", "NC-415")
def test_states_of_the_fieldbus():
    """Bit 0 of nState4 is invalid data, bit 7 of the drive's the fast axis stop; neither disturbs the other;
    inputs and time stamps have their places, and 16 bit numbers their sign.
    """
    rig = Rig(axis__fast_axis_stop_signal_type="High Active").enabled()
    image = ProcessImage(rig.axis)
    rig.until(rig.handle.move_velocity(50.0).in_velocity)
    rig.device.valid = False
    rig.cycles(2)
    assert image.drive_inputs()["nState4"] == 0x01
    assert image.encoder_inputs()["nState4"] == 0x00
    assert rig.generator.v == 50.0
    rig.device.valid, rig.device.fast_stop = True, True
    rig.cycles(2)
    assert image.drive_inputs()["nState4"] == 0x80
    assert not rig.status("IoDataInvalid")
    assert rig.status("HasBeenStopped")
    rig.device.digital_inputs, rig.device.input_age, rig.device.output_lead = 0xA5, 0.0005, -0.0002
    assert image.drive_inputs()["nState8"] == 0xA5
    assert unpack("<i", image.pack_encoder_inputs()[32:36])[0] == 500_000
    assert unpack("<i", image.pack_drive_inputs()[32:36])[0] == -200_000
    assert [signed(one, 16) for one in (0x7FFF, 0x8000, 0xFFFF)] == [32767, -32768, -1]


@pytest.mark.requirement("NC-419", "NC-420", "NC-428", "NC-424", "NC-425")
def test_direction_bytes():
    """nCtrl2 has the direction of the set velocity, nCtrl3 that of the total output: 42h plus, 41h minus, 80h
    stand; velocity limits are in increments.
    """
    rig = Rig(ctrl__pos_kv=20.0, axis__position_lag_max=100.0).enabled()
    image = ProcessImage(rig.axis)

    def directions():
        out = image.drive_outputs()
        return out["nCtrl2"], out["nCtrl3"]

    assert directions() == (0x80, 0x80)
    for velocity, byte in ((10.0, 0x42), (-10.0, 0x41)):
        rig.until(rig.handle.move_velocity(velocity).in_velocity)
        rig.cycles(50)
        assert directions() == (byte, byte)
    rig.until(rig.handle.move_velocity(10.0).in_velocity)
    rig.cycles(50)
    rig.device.position += 2.0  # the controller share is about -40
    rig.cycles(2)
    assert rig.axis.drive.control < -30.0
    assert directions() == (0x42, 0x41)
    out = image.drive_outputs()
    assert signed(out["nDataOut5"], 32) == 20_000_000
    assert signed(out["nDataOut6"], 32) == -20_000_000


@pytest.mark.requirement("NC-416", "NC-417", "NC-422", "NC-423")
def test_velocity_outputs_by_drive_type(subtests):
    """Analog types carry the share of full scale, digital ones increments per second times the factor;
    Universal has the sign in the first and the magnitude in the second variable.
    """
    for kind, first, second in (
        ("M2400_DAC1", round(-0.05 * 32767), round(-0.05 * 32767)),
        ("SERCOS", -1_100_000 * 6, -1_100_000 * 6),
        ("UNIVERSAL", round(-0.05 * 32767), round(0.05 * 32767)),
    ):
        with subtests.test(kind):
            rig = Rig(
                drv__type=kind,
                ctrl__pos_kv=0.0,
                axis__position_lag_monitoring=False,
                drv__output_scaling_acceleration=0.5,
                drv__output_scaling_torque=2.0,
            ).enabled()
            rig.until(rig.handle.move_velocity(-110.0).in_velocity)
            rig.ref.PlcToNc.ExtTorque = 4.0
            rig.cycles(3)
            out = ProcessImage(rig.axis).drive_outputs()
            assert signed(out["nDataOut1"], 32) == first
            assert signed(out["nDataOut2"], 32) == second
            assert out["nDataOut4"] == 8
            assert out["nDataOut3"] == 0
            rig.handle.move_velocity(-500.0, Acceleration=1000.0, Jerk=1e7)
            rig.cycles(5)
            assert signed(ProcessImage(rig.axis).drive_outputs()["nDataOut3"], 32) == -500


@pytest.mark.requirement("NC-755")
def test_objects_of_the_emulated_drive(subtests):
    """The emulated CiA 402 drive has every object that an image may be linked to, substitutes included."""
    with _bench() as bench:
        entries = bench.drive("motor").slave.store.entries
        for one in (*ENCODER_IN, *ENCODER_OUT, *DRIVE_IN, *DRIVE_OUT):
            for name in one.coe:
                with subtests.test(name):
                    assert int(name[:4], 16) << 8 in entries
