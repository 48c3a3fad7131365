"""`hil diag`: the pages of a bench, and of a case at a given time."""

import json

import pytest

from hil._commands._moment import at_moment
from hil.bench import load_bench
from hil.campaign import Token
from hil.campaign._evidence import build_alarms
from hil.cli import main
from hil.faults import Injector
from testcases.unit.hil.test_hil_profidrive import bench, enabled

CAMPAIGN = "testcases.campaigns.stop_modes:CAMPAIGN"


def call(capsys, *arguments):
    code = main([str(argument) for argument in arguments])
    captured = capsys.readouterr()
    return code, captured.out, captured.err


@pytest.mark.exhaustive
def test_a_fresh_bench(capsys):
    """Every axis with its pages; text for a person, JSON for a program."""
    code, out, _ = call(capsys, "diag", "profidrive")
    assert code == 0
    assert "[x] communication with the drive" in out
    assert "ZSW2" in out
    assert "controller  RUN\n\ndiagnostics buffer\n    1 " in out
    code, out, _ = call(capsys, "diag", "profidrive", "--json", "--after", "0.5")
    content = json.loads(out)
    assert code == 0
    assert content["axes"][0]["axis status"]["enabled"] is False
    assert content["axes"][0]["telegram"]["STW1"].startswith("047Eh")
    assert content["controller"]["state"] == "RUN"
    assert content["controller"]["diagnostics buffer"][-1]["source"] == "drive1"


@pytest.mark.exhaustive
def test_from_the_instant_of_a_case_or_a_program_it_goes_on():
    """The bench stands at the instant, in the middle of what the case does, and can be led from there."""

    def look(bench, what):
        axis, before = bench.axis(), (bench.now_s, what)
        assert axis.state.name == "MOTION"
        job = axis.halt()
        bench.wait_until(job.done, timeout=2.0)
        return before

    case = Token("stop-modes/power-0/constant", seed=1, campaign=CAMPAIGN).encode()
    assert at_moment(case, look, at_s=0.4) == (
        0.4,
        "stop-modes/power-0/constant on reference axis at 0.400 s",
    )
    steps = [{"do": "power_on"}, {"wait": 0.2}, {"do": "move_velocity", "velocity": 50}, {"wait": 2.0}]
    program = Token("fuzz/1", seed=1, program=steps).encode()
    assert at_moment(program, look, at_s=1.5) == (1.5, "fuzz/1 on reference axis at 1.500 s")


@pytest.mark.exhaustive
def test_a_case_at_a_time(capsys):
    """The case is repeated up to the time: the axis is in motion there, and stands at the end."""
    case = "stop-modes/halt/constant"
    token = Token(case=case, seed=1, campaign=CAMPAIGN).encode()
    code, out, _ = call(capsys, "diag", "--token", token, "--at", "0.9", "--json")
    assert code == 0
    axis = json.loads(out)["axes"][0]
    assert axis["state"] in {"MOTION", "HALTING"}
    assert axis["axis status"]["enabled"] is True
    code, out, _ = call(capsys, "diag", "--token", token, "--json")
    assert json.loads(out)["axes"][0]["motion status"]["standstill"] is True


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("arguments", "reported"),
    [
        (["nowhere.toml"], "nowhere.toml"),
        (["reference", "--axis", "y"], "axis1"),
        (["--token", "nonsense"], "token"),
        (["--token", "TOKEN", "--at", "0.0001"], "ready only after"),
        (["--token", "TOKEN", "--at", "900"], "already"),
        (["--token", "GONE"], "no case"),
    ],
)
def test_what_cannot_be_shown_is_reported(capsys, arguments, reported):
    """Exit code 2 and a message that names it."""
    tokens = {
        "TOKEN": Token(case="stop-modes/halt/constant", seed=1, campaign=CAMPAIGN).encode(),
        "GONE": Token(case="stop-modes/none", seed=1, campaign=CAMPAIGN).encode(),
    }
    code, _, err = call(capsys, "diag", *[tokens.get(one, one) for one in arguments])
    assert code == 2
    assert reported in err


@pytest.mark.requirement("DIA-109", "VAR-089")
def test_a_warning_of_the_drive():
    """It shows in ZSW1 and nowhere else: no alarm, no bit of `WarningWord`."""
    with bench() as machine:
        axis = enabled(machine)
        Injector(machine).inject("drive.warning", duration_s=0.2)
        machine.run_for(0.1)
        assert axis.diagnosis().telegram["ZSW1"] >> 7 & 1
        assert (axis.var("WarningWord"), axis.var("ErrorWord"), axis.diagnosis().alarms) == (0, 0, ())
        assert axis.var("StatusWord.X0") is True


@pytest.mark.exhaustive
@pytest.mark.requirement("TA-011", "DIA-110", "DIA-111")
def test_coming_going_and_acknowledging_of_an_alarm():
    """The log of alarms has the times at which the alarm came, its cause went and it was cleared; the words
    change with them.
    """
    with load_bench("reference").build(seed=1) as machine:
        axis = enabled(machine)
        Injector(machine).inject("drive.power_off", duration_s=0.2)
        machine.run_for(2.0)
        axis.reset()
        machine.run_for(1.0)
        trace = machine.trace()
        lost = next(one for one in build_alarms(trace) if one.number == 431)
        assert lost.time_s < lost.gone_s < lost.cleared_s
        assert lost.gone_s - lost.time_s > 0.19
        logs = {
            name: trace[f"axis1.{name}"].changes()
            for name in ("error_word", "alarm_number", "alarm_reaction", "warning_word", "status_word2")
        }
        times = [
            pytest.approx(time, abs=0.0041)
            for time in (logs["error_word"][0][0], lost.time_s, lost.cleared_s)
        ]
        assert logs["error_word"] == list(zip(times, [0, 1 << 7, 0], strict=True))
        assert logs["alarm_number"] == list(zip(times, [0, 431, 0], strict=True))
        assert logs["alarm_reaction"] == list(zip(times, [0, 4, 0], strict=True))
        assert [len(logs[name]) for name in ("warning_word", "status_word2")] == [1, 1]
        # Every row is one snapshot: X1 and the error word never disagree, nor do number and word.
        words = [trace[f"axis1.{name}"].values for name in ("status_word", "error_word", "alarm_number")]
        assert all(
            bool(int(status) >> 1 & 1) == bool(error) == bool(shown)
            for status, error, shown in zip(*words, strict=True)
        )


@pytest.mark.exhaustive
@pytest.mark.requirement("DIA-100", "DIA-101")
def test_telegram_of_the_drive():
    """Sent and received words are those of the wire: control and status words, setpoint, actual speed,
    encoder.
    """
    with bench() as machine:
        axis = enabled(machine)
        axis.move_velocity(250.0)
        machine.run_for(1.0)
        words = axis.diagnosis().telegram
        slave = machine.drive().slave
        assert words["NSOLL_B"] >> 16 & 0xFFFF == slave.get(0x5801) & 0xFFFF
        assert words["ZSW1"] == axis.object.port.zsw1
        assert words["NIST_B"] / 0x4000_0000 * 3000.0 == pytest.approx(1500.0, abs=1.0)
        assert words["G1_XIST1"] == axis.object.port.encoder_increments
        assert {"ZSW2", "G1_ZSW", "G1_XIST2"} <= set(words)


def test_a_cia_402_drive_shows_the_words_that_the_axis_speaks():
    """Behind CiA 402 the axis still speaks control and status words."""
    with load_bench("reference").build(seed=1) as machine:
        assert set(machine.axis().diagnosis().telegram) == {"STW1", "ZSW1"}


@pytest.mark.exhaustive
def test_external_encoders_and_encoders_of_an_axis(capsys, tmp_path):
    """`hil diag` shows external encoders behind the axes, or the one that is asked for; `Sensor[2]` has a
    telegram of its own.
    """
    text = load_bench("reference").text
    scale = (
        '[encoder.scale]\nsegment = "can0"\nnode_id = 21\nprofile = "profidrive"\ntype = "absolute_linear"\n'
    )
    extra = (
        f'{scale}measuring_step_um = 20.0\non = "drive1"\nmounting = "load"\n'
        '[encoder.wheel]\nsegment = "can0"\nnode_id = 20\nprofile = "profidrive"\n'
        '[external_encoder.ext]\nencoder = "wheel"\n'
    )
    file = tmp_path / "bench.toml"
    file.write_text(text.replace("[axis.axis1]\n", '[axis.axis1]\nencoders = ["drive1", "scale"]\n') + extra)
    code, out, err = call(capsys, "diag", str(file), "--json", "--after", "0.1")
    assert code == 0, err
    axis, external = json.loads(out)["axes"]
    assert {"Sensor[2].G1_ZSW", "Sensor[2].G1_XIST1", "Sensor[2].G1_XIST2"} <= set(axis["telegram"])
    assert axis["values"]["operative encoder"] == 1
    assert (external["axis"], external["encoder status"]["encoder values valid"]) == ("ext", 2)
    code, out, _ = call(capsys, "diag", str(file), "--axis", "ext")
    assert code == 0
    assert out.count("ExternalEncoder") == 1
    assert "PositioningAxis" not in out


@pytest.mark.exhaustive
def test_accelerations_of_a_speed_axis_are_shown_in_its_speed_too(capsys):
    """They count revolutions in seconds; next to rpm the same acceleration in rpm per second is shown."""
    _, out, _ = call(capsys, "diag", "speed")
    assert "maximum acceleration: 200 1/s2 (12000 1/min per s)" in out
    assert "maximum jerk: 2000 1/s3 (120000 1/min per s²)" in out


@pytest.mark.exhaustive
def test_the_number_of_a_drive_fault_is_in_the_alarm_on_every_bus(subtests):
    """Over Modbus it is read after the alarm and completes its text; a second fault has its own number."""
    for name, shown in (
        ("reference", "drive fault {code:04X}h"),
        ("profidrive", "drive fault {code}"),
        ("profidrive_tcp", "drive fault {code}"),
    ):
        with subtests.test(name), load_bench(name).build() as machine:
            axis, faults = machine.axis(), Injector(machine)
            texts = []
            for code in (0x2310, 0x3210):
                power = axis.power()
                axis.reset()
                assert machine.run_until(power.status, timeout=3.0)
                faults.inject("drive.fault", code=code)
                machine.run_for(0.1)
                (pending,) = axis.object.engine.pending
                assert pending.text.endswith(": " + shown.format(code=axis.port.drive_fault_code))
                assert build_alarms(machine.trace())[-1].text == pending.text
                texts.append(pending.text)
                power.set(Enable=False)
                machine.run_for(0.1)
            assert texts[0] != texts[1]
            (*_, last) = [
                one for one in machine.history.events if one.kind.startswith("alarm.") and "text" in one.data
            ]
            assert last.data["text"] == texts[1]
