"""A data block with the telegrams of an axis, its torque data and an encoder (CFG section 13)."""

from __future__ import annotations

import pytest

from fieldbus.errors import ConfigurationError
from hil.bench.bench import Bench
from hil.bench.bench_file import parse, read
from motion.drives.data_block import DataBlock

ENCODER = """
[encoder.enc]
segment = "can0"
node_id = 20
profile = "profidrive"
type = "multi_turn"
[encoder.enc.profidrive]
telegram = 83
[encoder.enc.shaft]
speed_rpm = 60.0

[external_encoder.ext]
encoder = "enc"
[external_encoder.ext.variables]
"Properties.MotionType" = 1
"""
DECLARED = {
    "slide": "PD_TEL105",
    "encoders": "Array[0..2] of PD_TEL83",
    "machine": {"torque": "PD_TEL750"},
    "spare": "PD_TEL3",
}


def machine():
    text = read("profidrive")[1].replace(
        'drive = "drive1"\n', 'drive = "drive1"\nconnection = "data_block"\n', 1
    )
    text = text.replace(
        "[axis.axis1]\n", "[drive.drive1.profidrive]\ntorque_telegram = true\n\n[axis.axis1]\n", 1
    )
    return Bench(parse(text + ENCODER, "bench.toml"), seed=1)


@pytest.mark.exhaustive
@pytest.mark.requirement("CFG-258", "CFG-255", "CFG-256", "CFG-289", "CFG-405")
def test_one_block_for_axis_torque_and_encoder():
    """A structure, an element of an array and one within a structure: each holds the words of its own
    telegram.
    """
    block = DataBlock("DB1", DECLARED)
    assert list(block) == ["slide", "encoders[0]", "encoders[1]", "encoders[2]", "machine.torque", "spare"]
    with machine() as bench:
        axis = bench.axis()
        axis.port.connect_block(block["slide"], block["machine.torque"])
        encoder = bench.external_encoder("ext")
        encoder.object.port.connect_block(block["encoders[1]"])
        bench.run_for(0.2)
        assert not axis.var("StatusDrive.CommunicationOK")
        assert encoder.var("StatusSensor.State") != 2
        for path in ("slide", "machine.torque", "encoders[1]"):
            block[path].pass_through()
        power = axis.power()
        assert bench.run_until(power.status, 2.0)
        axis.torque_additive(0.5)
        assert bench.run_until(axis.move_relative(20.0).done, 5.0)
        assert bench.drive().mechanics.position == pytest.approx(0.020, abs=2e-4)
        assert set(block["slide"].Output) == {"STW1", "NSOLL_B", "STW2", "MOMRED", "G1_STW", "XERR", "KPC"}
        assert block["machine.torque"].Output["M_ADD1"] == 0x1000
        assert bench.drive().core.torque_offset == pytest.approx(0.5)
        before = encoder.var("ActualPosition")
        bench.run_for(1.0)
        assert encoder.var("ActualPosition") - before == pytest.approx(360.0, abs=1.0)
        assert block["encoders[1]"].Input["G1_XIST1"] != 0
        assert set(block["encoders[0]"].Input.values()) == {0}

        def swallow(one):
            one.copy_output()
            one.sent["M_ADD1"] = 0

        block["machine.torque"].post_servo = swallow
        bench.run_for(0.05)
        assert bench.drive().core.torque_offset == 0.0


@pytest.mark.parametrize(
    ("declared", "attributes", "message"),
    [
        pytest.param(
            {"a": "PD_TEL3_IN"},
            {},
            "PD_TEL3_IN.* is not allowed; allowed: PD_TELx with Input and Output",
            marks=pytest.mark.requirement("CFG-257"),
            id="input alone",
        ),
        pytest.param(
            {"a": {"b": "Array[0..1] of PD_TEL3_OUT"}},
            {},
            "PD_TEL3_OUT",
            marks=pytest.mark.requirement("CFG-257"),
            id="output alone",
        ),
        pytest.param(
            {"a": "INT"}, {}, "PD_TELx", marks=pytest.mark.requirement("CFG-255"), id="something else"
        ),
        pytest.param(
            {"a": "PD_TEL77"},
            {},
            "there is no telegram 77",
            marks=pytest.mark.requirement("CFG-255"),
            id="no telegram",
        ),
        pytest.param(
            {"a": "Array[3..1] of PD_TEL3"},
            {},
            "elements",
            marks=pytest.mark.requirement("CFG-258"),
            id="empty array",
        ),
        pytest.param(
            {"a": "PD_TEL3"},
            {"only_in_load_memory": True},
            "only_in_load_memory",
            marks=pytest.mark.requirement("CFG-259"),
            id="load memory",
        ),
        pytest.param(
            {"a": "PD_TEL3"},
            {"write_protected": True},
            "write_protected",
            marks=pytest.mark.requirement("CFG-259"),
            id="write-protected",
        ),
        pytest.param(
            {"a": "PD_TEL3"},
            {"optimized": True, "technology_version": 3.0},
            "optimized",
            marks=pytest.mark.requirement("CFG-259"),
            id="optimized below 4.0",
        ),
    ],
)
def test_refused(declared, attributes, message):
    """What a block cannot be is said with the reason."""
    with pytest.raises(ConfigurationError, match=message):
        DataBlock("DB1", declared, **attributes)


@pytest.mark.requirement("CFG-259")
def test_optimized_access_is_allowed_from_version_4_on():
    """Before, the axis could not find the words."""
    assert list(DataBlock("DB1", {"a": "PD_TEL3"}, optimized=True)) == ["a"]


@pytest.mark.requirement("CFG-255", "CFG-405")
def test_structure_of_another_telegram():
    """A structure has to be that of the telegram, with the torque data in their own one or in none."""
    block = DataBlock("DB1", DECLARED)
    with machine() as bench:
        port = bench.axis().port
        with pytest.raises(ConfigurationError, match="PD_TEL105, the telegram of the drive"):
            port.connect_block(block["spare"], block["machine.torque"])
        with pytest.raises(ConfigurationError, match="together with PD_TEL750"):
            port.connect_block(block["slide"])
        with pytest.raises(ConfigurationError, match="PD_TEL750"):
            port.connect_block(block["slide"], block["spare"])
        with pytest.raises(ConfigurationError, match="PD_TEL83, the telegram of the encoder"):
            bench.external_encoder("ext").object.port.connect_block(block["slide"])
        with pytest.raises(ConfigurationError, match=r"encoders\[2\]"):
            block["encoders[3]"]
