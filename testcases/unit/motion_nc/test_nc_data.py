"""Parameters and error codes as data; the cyclic interface byte for byte."""

from pathlib import Path
from struct import calcsize, pack, unpack_from

import pytest

from fieldbus.errors import ConfigurationError
from motion.nc.errors import error_codes, error_text
from motion.nc.interface import NC_TO_PLC_SIZE, PLC_TO_NC_SIZE, STATUS_BITS, NcToPlc, PlcToNc
from motion.nc.pages import with_tables
from motion.nc.parameters import ParameterSet, catalogue

PAGE = Path(__file__).resolve().parents[3] / "docs/reference/nc-axis.md"


def test_catalogue(subtests):
    """Every parameter has a default that it accepts, and refuses what is beyond its range or of another
    type.
    """
    assert len(catalogue()) == 168
    for key, one in catalogue().items():
        with subtests.test(key):
            assert one.check(one.default) == one.default
            wrong = {"bool": 1, "enum": "no such text", "string": 5, "float": "5", "uint32": 0.5}[one.type]
            with pytest.raises(ConfigurationError, match=key):
                one.check(wrong)
            if one.type in {"float", "uint32"}:
                for beyond in (
                    None if one.min is None else one.min - 1.0,
                    None if one.max is None else one.max + 1e-9,
                ):
                    if beyond is not None:
                        with pytest.raises(ConfigurationError, match=key):
                            one.check(beyond)
                if one.above:
                    with pytest.raises(ConfigurationError, match=key):
                        one.check(one.min)
                with pytest.raises(ConfigurationError, match=key):
                    one.check(float("nan"))


@pytest.mark.requirement("NC-003")
def test_refused_values():
    """A wrong value is refused when the parameters are made; a refused write leaves the value untouched."""
    with pytest.raises(ConfigurationError, match=r"drv\.output_ratio"):
        ParameterSet({"drv.output_ratio": 1.1})
    with pytest.raises(ConfigurationError, match=r"enc\.encoder_mode"):
        ParameterSet({"enc.encoder_mode": "POSITION"})
    parameters = ParameterSet({"drv.output_limit_max": 0.5, "enc.encoder_mode": "POS"})
    for key, value in (
        ("drv.output_limit_max", 1.5),
        ("enc.encoder_mode", "VELO"),
        ("axis.maximum_velocity", 2200.1),
    ):
        with pytest.raises(ConfigurationError):
            parameters.write(key, value)
    assert parameters.read("drv.output_limit_max") == 0.5
    assert parameters.read("enc.encoder_mode") == "POS"
    assert parameters.read("axis.maximum_velocity") == 2000.0
    parameters.write("axis.maximum_velocity", 2200.0)
    assert parameters.read("axis.maximum_velocity") == 2200.0


@pytest.mark.requirement("NC-128")
def test_limits_under_axis_and_encoder(subtests):
    """Software limits show the same value under the axis and under its encoder, whichever was set."""
    parameters = ParameterSet({"enc.soft_limit_min": -3.0, "axis.soft_limit_max": 4.0})
    for name, value in (
        ("soft_limit_min", -3.0),
        ("soft_limit_max", 4.0),
        ("soft_limit_min_enable", False),
        ("soft_limit_max_enable", False),
    ):
        with subtests.test(name):
            assert parameters.read(f"axis.{name}") == parameters.read(f"enc.{name}") == value
            other = not value if isinstance(value, bool) else value + 1.0
            parameters.write(f"enc.{name}", other)
            assert parameters.read(f"axis.{name}") == other
            parameters.write(f"axis.{name}", value)
            assert parameters.read(f"enc.{name}") == value


@pytest.mark.requirement("NC-026", "NC-090")
def test_warnings():
    """Missing monitoring and a default above its maximum are warnings, and no errors."""
    texts = "\n".join(ParameterSet().warnings())
    assert "axis.soft_limit_min_enable" in texts
    assert "axis.soft_limit_max_enable" in texts
    assert "position_lag" not in texts
    assert "default" not in texts
    texts = "\n".join(
        ParameterSet(
            {
                "axis.position_lag_monitoring": False,
                "axis.default_acceleration": 16000.0,
                "axis.default_deceleration": 15000.1,
                "axis.soft_limit_min_enable": True,
                "axis.soft_limit_max_enable": True,
            }
        ).warnings()
    )
    assert "axis.position_lag_monitoring" in texts
    assert "axis.default_acceleration" in texts
    assert "axis.default_deceleration" in texts
    assert "soft_limit" not in texts


def test_error_codes(subtests):
    """Every error code has a cause and a remedy; numbers and their decimal form belong together."""
    decimal = {0x4550: 17744, 0x435C: 17244, 0x435D: 17245, 0x42EF: 17135, 0x4460: 17504, 0x4B07: 19207}
    for code, number in decimal.items():
        assert code == number
        assert code in error_codes()
    for code, one in error_codes().items():
        with subtests.test(hex(code)):
            assert one.condition.endswith(".")
            assert one.remedy.endswith(".")
            assert one.name in error_text(code)


def test_page_is_current():
    """The tables of the page are those of the data."""
    page = PAGE.read_text(encoding="utf-8")
    assert with_tables(page) == page


@pytest.mark.requirement(*(f"NC-{number}" for number in range(430, 440)))
def test_plc_to_nc_image(subtests):
    """Every member of PlcToNc stands at its byte, and comes back from the image."""
    places = {
        "ControlDWord": (0, "I", 0x107),
        "Override": (4, "I", 1_000_000),
        "AxisModeRequest": (8, "I", 3),
        "AxisModeDWord": (12, "I", 4),
        "AxisModeLReal": (16, "d", 5.5),
        "PositionCorrection": (24, "d", -0.25),
        "ExtSetPos": (32, "d", 10.5),
        "ExtSetVelo": (40, "d", 11.5),
        "ExtSetAcc": (48, "d", 12.5),
        "ExtSetDirection": (56, "i", -1),
        "ExtControllerOutput": (64, "d", 13.5),
        "GearRatio1": (72, "d", 1.0),
        "GearRatio2": (80, "d", 2.0),
        "GearRatio3": (88, "d", 3.0),
        "GearRatio4": (96, "d", 4.0),
        "MapState": (104, "B", 1),
        "PlcCycleControl": (105, "B", 2),
        "PlcCycleCount": (106, "B", 200),
        "ExtTorque": (112, "d", 7.5),
    }
    assert PLC_TO_NC_SIZE == 128
    for name, (place, form, value) in places.items():
        with subtests.test(name):
            written = PlcToNc()
            setattr(written, name, value)
            image = bytearray(128)
            image[place : place + calcsize(form)] = pack(f"<{form}", value)
            assert written.pack() == bytes(image)
            read = PlcToNc()
            read.unpack(bytes(image))
            assert getattr(read, name) == value
            other = PlcToNc()
            other.take(written)
            assert other.pack() == bytes(image)
            other.clear()
            assert other.pack() == bytes(128)


def test_nc_to_plc_image(subtests):
    """Every member of NcToPlc stands at its byte."""
    places = {
        "StateDWord": (0, "I"),
        "ErrorCode": (4, "I"),
        "AxisState": (8, "I"),
        "AxisModeConfirmation": (12, "I"),
        "HomingState": (16, "I"),
        "CoupleState": (20, "I"),
        "SvbEntries": (24, "I"),
        "SafEntries": (28, "I"),
        "AxisId": (32, "I"),
        "OpModeDWord": (36, "I"),
        "ActPos": (40, "d"),
        "ActVelo": (64, "d"),
        "PosDiff": (72, "d"),
        "SetPos": (80, "d"),
        "SetVelo": (88, "d"),
        "SetAcc": (96, "d"),
        "TargetPos": (104, "d"),
        "CmdNo": (124, "H"),
        "CmdState": (126, "H"),
        "SetTorque": (136, "d"),
        "ActTorque": (144, "d"),
        "TouchProbeCounter": (164, "I"),
        "ActTorqueDerivative": (192, "d"),
        "ActPosWithoutPosCorrection": (224, "d"),
        "ActAcc": (232, "d"),
    }
    assert NC_TO_PLC_SIZE == 256
    for name, (place, form) in places.items():
        with subtests.test(name):
            image = NcToPlc()
            value = 7.5 if form == "d" else 7
            setattr(image, name, value)
            expected = bytearray(256)
            expected[place : place + calcsize(form)] = pack(f"<{form}", value)
            assert image.pack() == bytes(expected)
    with subtests.test("modulo"):
        image = NcToPlc()
        image.ActPos, image.SetPos, image.modulo_factor = -10.0, 725.5, 360.0
        packed = image.pack()
        assert unpack_from("<d", packed, 48) + unpack_from("<i", packed, 60) == (350.0, -1)
        assert unpack_from("<d", packed, 112) + unpack_from("<i", packed, 120) == (5.5, 2)


def test_status_bits():
    """The names of the status are the bits of the double word."""
    numbers = {name: int(bit).bit_length() - 1 for name, bit in STATUS_BITS.items()}
    assert numbers == {
        "Operational": 0, "Homed": 1, "NotMoving": 2, "InPositionArea": 3, "InTargetPosition": 4,
        "Protected": 5, "ErrorPropagationDelayed": 6, "HasBeenStopped": 7, "HasJob": 8,
        "PositiveDirection": 9,
        "NegativeDirection": 10,
        "HomingBusy": 11, "ConstantVelocity": 12, "Compensating": 13,
        "ExtSetPointGenEnabled": 14, "ExternalLatchValid": 16, "NewTargetPos": 17, "ContinuousMotion": 19,
        "ControlLoopClosed": 20, "CamTableQueued": 21, "CamDataQueued": 22, "CamScalingPending": 23,
        "CmdBuffered": 24, "PTPmode": 25, "SoftLimitMinExceeded": 26, "SoftLimitMaxExceeded": 27,
        "DriveDeviceError": 28, "MotionCommandsLocked": 29, "IoDataInvalid": 30, "Error": 31,
    }  # fmt: skip
