"""Encoders of their own on a bench: external encoders as technology objects, second encoders of an axis."""

from __future__ import annotations

import pytest

from fieldbus.errors import ConfigurationError
from hil.bench import load_bench
from hil.bench.bench import Bench
from hil.bench.bench_file import BenchFileError, parse, read
from hil.bench.units import variables_in_units

ENCODER = """
[encoder.enc1]
segment = "can0"
node_id = 20
type = "{kind}"
{place}

[external_encoder.ext1]
encoder = "enc1"
{variables}
"""
SHAFT = "[encoder.enc1.shaft]\nspeed_rpm = 60.0"
DIRECT = """
[encoder.scale]
segment = "can0"
node_id = 20
type = "absolute_linear"
measuring_step_um = 1.0
on = "drive1"
mounting = "load"
"""


def bench(extra, name="reference", **changes):
    text = read(name)[1]
    for old, new in changes.items():
        text = text.replace(old, new)
    return Bench(parse(text + extra, "bench.toml"), seed=1)


def both_encoders(**changes):
    """Return a bench whose axis has the motor encoder and a scale at the load."""
    return bench(
        DIRECT, **{'drive = "drive1"\n': 'drive = "drive1"\nencoders = ["drive1", "scale"]\n', **changes}
    )


class TestExternalEncoder:
    """`[external_encoder.NAME]`."""

    @pytest.mark.exhaustive
    @pytest.mark.requirement("CFG-016", "CFG-018", "CFG-071", "CFG-530", "VAR-025")
    def test_rotary(self):
        """A shaft with 60 rpm behind a multi-turn encoder: 360 degrees per second, modulo range and counter
        included.
        """
        settings = '[external_encoder.ext1.variables]\n"Properties.MotionType" = 1\n"Modulo.Enable" = true\n"Modulo.Length" = 360.0'  # noqa: E501
        with bench(ENCODER.format(kind="multi_turn", place=SHAFT, variables=settings)) as machine:
            machine.run_for(1.0)
            encoder = machine.external_encoder("ext1")
            assert encoder.var("StatusSensor.State") == 2
            assert encoder.var("Sensor.Type") == 1
            assert encoder.var("ActualVelocity") == pytest.approx(360.0, abs=12.0)
            before, cycle = encoder.var("ActualPosition"), encoder.var("ActualModuloCycle")
            machine.run_for(2.25)
            after = encoder.var("ActualPosition") + 360.0 * (encoder.var("ActualModuloCycle") - cycle)
            assert after - before == pytest.approx(810.0, abs=2.0)
            assert 0.0 <= encoder.var("ActualPosition") < 360.0
            assert encoder.var("StatusWord.X7") is False

    @pytest.mark.requirement(
        "CFG-042", "CFG-041", "CFG-053", "VAR-109", "VAR-110", "CFG-272", "HOM-018", "HOM-022"
    )
    def test_instructions(self):
        """Homing without motion, acknowledging and restarting; homing with motion and times of a data block
        are refused.
        """
        with bench(ENCODER.format(kind="multi_turn", place="", variables="")) as machine:
            encoder = machine.external_encoder()
            assert machine.run_until(encoder.home(77.0, mode=7).done, 1.0)
            machine.run_for(0.05)
            assert encoder.var("ActualPosition") == pytest.approx(77.0)
            assert encoder.var("StatusWord.X5") is True
            refused = encoder.home(5.0, mode=3)
            machine.run_for(0.02)
            assert refused.ErrorID == 0x800A
            assert machine.run_until(encoder.home(80.0, mode=11).done, 1.0)
            assert machine.run_until(encoder.home(-3.0, mode=12).done, 1.0)
            machine.run_for(0.05)
            assert encoder.var("ActualPosition") == pytest.approx(77.0)
            assert machine.run_until(encoder.reset(restart=True).done, 1.0)
            machine.run_for(0.05)
            assert encoder.var("ActualPosition") == pytest.approx(77.0)
            assert encoder.var("StatusWord.X5") is True
            time = encoder.write_parameter(1010, 0.001)
            machine.run_for(0.02)
            assert time.ErrorID == 0x805D

    @pytest.mark.exhaustive
    @pytest.mark.requirement("VAR-095", "VAR-075", "VAR-077")
    def test_alarms(self):
        """An alarm of the encoder is 411, a lost encoder 431; both with reaction 10, gone after the
        acknowledgement.
        """
        with bench(ENCODER.format(kind="multi_turn", place="", variables="")) as machine:
            encoder = machine.external_encoder()
            device = machine.encoder("enc1")
            assert machine.run_until(encoder.power().status, 1.0)
            device.set_alarm(0, True)
            machine.run_for(0.1)
            assert (encoder.var("ErrorDetail.Number"), encoder.var("ErrorDetail.Reaction")) == (411, 10)
            assert encoder.var("ErrorWord.X5") is True
            device.set_alarm(0, False)
            machine.run_for(0.1)
            machine.run_until(encoder.reset().done, 1.0)
            assert encoder.var("ErrorWord") == 0
            device.power_off()
            machine.run_for(0.5)
            assert encoder.var("ErrorDetail.Number") == 431
            assert encoder.var("StatusSensor.State") == 0
            assert encoder.var("ErrorWord.X7") is True
            device.power_on()
            machine.run_for(2.0)
            machine.run_until(encoder.reset().done, 1.0)
            assert (encoder.var("ErrorWord"), encoder.var("StatusSensor.State")) == (0, 2)

    @pytest.mark.exhaustive
    def test_is_recorded(self):
        """Position and velocity are signals of the trace."""
        with bench(ENCODER.format(kind="multi_turn", place=SHAFT, variables="")) as machine:
            machine.run_for(1.0)
            assert machine.trace()["ext1.velocity"].values[-1] == pytest.approx(10.0, abs=0.5)

    @pytest.mark.parametrize(
        ("extra", "message"),
        [
            (
                ENCODER.format(kind="multi_turn", place="", variables="").replace(
                    'encoder = "enc1"', 'encoder = "enc2"'
                ),
                "external_encoder.ext1.encoder: 'enc2' is not an encoder; there are: enc1",
            ),
            (
                ENCODER.format(kind="multi_turn", place="", variables="").replace(
                    "external_encoder.ext1", "external_encoder.axis1"
                ),
                "external_encoder.axis1: an axis has this name already",
            ),
            (
                ENCODER.format(kind="multi_turn", place="", variables="").replace(
                    'encoder = "enc1"', 'encoder = "enc1"\ndrive = "drive9"'
                ),
                "external_encoder.ext1.drive: 'drive9' is not the drive of an axis; there are: drive1",
            ),
        ],
    )
    def test_mistakes(self, extra, message):
        """What leads nowhere is refused with what there is."""
        with pytest.raises(BenchFileError, match=message.replace(".", r"\.")):
            parse(read("reference")[1] + extra, "bench.toml")


class TestSecondEncoder:
    """A scale at the load next to the motor encoder."""

    @pytest.mark.requirement("CFG-314", "CFG-315", "CFG-318", "CFG-284", "VAR-108", "VAR-027", "CFG-524")
    def test_both_are_read(self):
        """Both encoders show the same travel; exactly one controls."""
        with both_encoders() as machine:
            axis = machine.axis()
            assert machine.run_until(axis.power().status, 2.0)
            start = [axis.var(f"StatusSensor[{n}].Position") for n in (1, 2)]
            assert machine.run_until(axis.move_relative(50.0).done, 5.0)
            travel = [axis.var(f"StatusSensor[{n}].Position") - start[n - 1] for n in (1, 2)]
            assert travel == pytest.approx([50.0, 50.0], abs=0.05)
            assert [axis.var(f"StatusSensor[{n}].Control") for n in (1, 2)] == [True, False]
            assert axis.var("OperativeSensor") == 1
            assert [axis.var(f"Sensor[{n}].Existent") for n in (1, 2, 3)] == [True, True, False]
            assert axis.var("Sensor[2].Type") == 1

    @pytest.mark.exhaustive
    @pytest.mark.requirement("CFG-319", "CFG-603")
    def test_the_other_one_may_fail(self):
        """The encoder that does not control may fail: the axis goes on, and its status alone tells."""
        with both_encoders() as machine:
            axis = machine.axis()
            assert machine.run_until(axis.power().status, 2.0)
            axis.move_velocity(20.0)
            machine.run_for(0.5)
            machine.encoder("scale").power_off()
            machine.run_for(1.0)
            assert axis.var("StatusSensor[2].State") == 0
            assert axis.var("StatusSensor[2].CommunicationOK") is False
            assert axis.var("ErrorWord") == 0
            assert axis.var("ActualVelocity") == pytest.approx(20.0, abs=1.0)

    @pytest.mark.exhaustive
    @pytest.mark.requirement("CFG-604", "CFG-322", "CFG-321", "CFG-325", "VAR-202", "MC-377", "MC-390")
    def test_the_controlling_one_must_not_fail(self):
        """Switched to the scale in motion, the axis stays homed and goes on; without the scale it is disabled
        with 431.
        """
        with both_encoders() as machine:
            axis = machine.axis()
            assert machine.run_until(axis.power().status, 2.0)
            assert machine.run_until(axis.home(0.0).done, 1.0)
            axis.move_velocity(20.0)
            machine.run_for(0.5)
            before = axis.var("ActualPosition")
            assert machine.run_until(axis.set_sensor(2).done, 1.0)
            machine.run_for(0.1)
            assert axis.var("ActualPosition") == pytest.approx(before + 2.0, abs=0.3)
            assert (axis.var("OperativeSensor"), axis.var("StatusWord.X5")) == (2, True)
            machine.encoder("scale").power_off()
            machine.run_for(1.0)
            assert axis.var("ErrorDetail.Number") == 431
            assert axis.var("StatusWord.X0") is False

    @pytest.mark.parametrize(
        ("changes", "message"),
        [
            (
                {'encoders = ["drive1", "scale"]': 'encoders = ["drive1", "other"]'},
                "'other' is neither its drive nor an encoder",
            ),
            (
                {'encoders = ["drive1", "scale"]': 'encoders = ["scale", "scale"]'},
                "an encoder is listed twice",
            ),
            ({'type = "positioning"': 'type = "speed"'}, "a speed axis has no encoder"),
            ({"cycle_ms = 4": 'cycle_ms = 4\ncpu = "S7-1500"'}, 'need bench.cpu = "S7-1500T"'),
            (
                {'drive = "drive1"\nencoders': 'drive = "drive1"\nconnection = "data_block"\nencoders'},
                "'data_block' holds a telegram",
            ),
        ],
    )
    @pytest.mark.requirement("CFG-177", "CFG-174")
    def test_mistakes(self, changes, message):
        """Encoders that cannot be are refused with the reason."""
        text = read("reference")[1].replace(
            'drive = "drive1"\n', 'drive = "drive1"\nencoders = ["drive1", "scale"]\n'
        )
        for old, new in changes.items():
            assert old in text
            text = text.replace(old, new)
        with pytest.raises(BenchFileError, match=message):
            parse(text + DIRECT, "bench.toml")


ENCODER2 = """
[drive.drive1.encoder2]
type = "absolute_linear"
measuring_step_um = 20.0
"""


def second_encoder(telegram=6, *, named="", variables="", cpu="S7-1500T"):
    """Return the text of the PROFIdrive bench whose drive has a scale at its second encoder input."""
    text = read("profidrive")[1].replace("telegram = 105", f"telegram = {telegram}")
    text = text.replace("cycle_ms = 4", f'cycle_ms = 4\ncpu = "{cpu}"')
    if named:
        text = text.replace('drive = "drive1"\n', f'drive = "drive1"\nencoders = [{named}]\n', 1)
    return text.replace("[axis.axis1.variables]\n", f"[axis.axis1.variables]\n{variables}\n") + ENCODER2


class TestSecondOfTheTelegram:
    """G2 of telegrams 4, 6, 103 and 106."""

    @pytest.mark.requirement("CFG-281", "CFG-282", "CFG-283")
    @pytest.mark.parametrize(
        ("telegram", "cpu", "count"),
        [
            (6, "S7-1500T", 2),
            (106, "S7-1500T", 2),
            (6, "S7-1500", 1),
            (4, "S7-1500T", 1),
            (103, "S7-1500T", 1),
        ],
    )
    def test_connected_by_itself(self, telegram, cpu, count):
        """Both encoders of 6 and 106 are connected by themselves on a T; of the others the first one."""
        with Bench(parse(second_encoder(telegram, cpu=cpu), "bench.toml"), seed=1) as machine:
            axis = machine.axis()
            assert [axis.var(f"Sensor[{n}].Existent") for n in (1, 2)] == [True, count == 2]

    @pytest.mark.exhaustive
    @pytest.mark.requirement("CFG-285", "CFG-284", "VAR-151", "CFG-315")
    @pytest.mark.parametrize("telegram", [4, 6, 103, 106])
    def test_travel(self, telegram):
        """Named or not, the scale shows the travel of the load, as encoder 2 of its telegram."""
        text = second_encoder(telegram, named='"drive1", "drive1.encoder2"')
        with Bench(parse(text, "bench.toml"), seed=1) as machine:
            axis = machine.axis()
            assert (axis.var("Sensor[1].Interface.Number"), axis.var("Sensor[2].Interface.Number")) == (1, 2)
            assert machine.run_until(axis.power().status, 2.0)
            start = axis.var("StatusSensor[2].Position")
            assert machine.run_until(axis.move_relative(40.0).done, 5.0)
            assert axis.var("StatusSensor[2].Position") - start == pytest.approx(40.0, abs=0.05)
            assert machine.run_until(axis.set_sensor(2).done, 1.0)
            assert machine.run_until(axis.move_relative(-15.0).done, 5.0)
            assert axis.var("ErrorWord") == 0

    @pytest.mark.exhaustive
    @pytest.mark.requirement("CFG-339", "VAR-151")
    def test_speed_is_that_of_the_first(self):
        """With the velocity of the telegram encoder 2 shows that of encoder 1, and the position of its
        own.
        """
        variables = '"Sensor[2].ActualVelocityMode" = 1'
        with Bench(parse(second_encoder(variables=variables), "bench.toml"), seed=1) as machine:
            axis = machine.axis()
            assert machine.run_until(axis.power().status, 2.0)
            axis.move_velocity(60.0)
            machine.run_for(1.0)
            machine.encoder("drive1.encoder2").freeze_encoder(True)
            frozen = axis.var("StatusSensor[2].Position")
            machine.run_for(0.5)
            assert axis.var("StatusSensor[2].Velocity") == pytest.approx(60.0, abs=1.0)
            assert axis.var("StatusSensor[2].Position") == pytest.approx(frozen, abs=1.0)

    @pytest.mark.requirement("CFG-368", "CFG-370", "CFG-372", "CFG-346")
    def test_transfer(self):
        """Its format is transferred from p0979[11] to [15]."""
        variables = '"Sensor[2].DataAdaption" = 1\n"Sensor[2].Parameter.Resolution" = 0.5'
        with Bench(parse(second_encoder(variables=variables), "bench.toml"), seed=1) as machine:
            axis = machine.axis()
            assert machine.run_until(lambda: axis.var("StatusSensor[2].AdaptionState") >= 2, 2.0)
            assert axis.var("StatusSensor[2].AdaptionState") == 2
            assert axis.var("Sensor[2].Parameter.Resolution") == pytest.approx(0.02)
            assert axis.var("Sensor[2].System") == 0

    @pytest.mark.requirement("CFG-285")
    def test_mistakes(self):
        """A second encoder that the telegram does not carry is refused, and so is a number that is not the
        connection's.
        """
        with pytest.raises(
            BenchFileError, match=r"needs encoder2 of 'drive1' and one of its telegrams 4, 6, 103, 106"
        ):
            parse(second_encoder(3, named='"drive1", "drive1.encoder2"'), "bench.toml")
        text = second_encoder(variables='"Sensor[2].Interface.Number" = 1')
        with pytest.raises(
            ConfigurationError, match=r"Sensor\[2\].Interface.Number: 1 is not allowed; allowed: 2"
        ):
            Bench(parse(text, "bench.toml"), seed=1)


@pytest.mark.parametrize("unit", [1013, 1010, 1019])
def test_the_lines_of_a_scale_are_taken_over_in_the_unit_of_the_object(unit):
    """An axis in m, mm or inches, and an external encoder next to it, measure the way that the slide goes."""
    size_m = {1013: 0.001, 1010: 1.0, 1019: 0.0254}[unit]
    file = load_bench("reference")
    axis = variables_in_units(file.config.axis["axis1"], unit, {1013: 1062, 1010: 1061, 1019: 1066}[unit])
    scale = {"segment": "can0", "type": "incremental_linear", "on": "drive1", "mounting": "load"}
    tables = {
        "encoder": {name: scale | {"node_id": node} for name, node in (("scale", 20), ("second", 21))},
        "axis": {"axis1": {"encoders": ["scale"], "variables": axis}},
        "external_encoder": {
            "ext1": {"encoder": "second", "variables": {"Units.LengthUnit": unit}},
        },
    }
    with file.configured(tables).build(seed=1) as bench:
        axis1, ext1 = bench.axis(), bench.external_encoder()
        assert bench.run_until(axis1.power().status, 2.0)
        begun = ext1.var("ActualPosition")
        assert bench.run_until(axis1.move_relative(0.04 / size_m).done, 3.0)
        moved_m = bench.trace()["drive1.position"].values[-1]
        assert moved_m == pytest.approx(0.04, abs=2e-4)
        assert (ext1.var("ActualPosition") - begun) * size_m == pytest.approx(moved_m, abs=5e-6)
