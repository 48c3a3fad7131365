"""`hil check`: the rules that tables of a bench file have to keep, and what is pending after the start."""

import importlib
import json
import pkgutil
import re
from pathlib import Path

import pytest

from hil.bench import EMBEDDED, BenchFile, load_bench
from hil.bench.rules import RULES, findings
from hil.cli import main
from testcases import campaigns

PAGE = Path(__file__).resolve().parents[3] / "docs/reference/bench-file.md"

BENCH = """
[bench]
name = "cell"

[segment.can0]

[segment.net0]
kind = "modbus_tcp"

[drive.x_drive]
segment = "can0"
node_id = 5

[drive.y_drive]
profile = "profidrive"
telegram = 105
segment = "net0"

[axis.x]
drive = "x_drive"

[axis.y]
drive = "y_drive"
"""
WATCHED = '\n[axis.x.variables]\n"PositionLimits_HW.Active" = true\n"DynamicLimits.MaxVelocity" = 200.0\n'

TRIPPED = {
    "switch-level": WATCHED + '"PositionLimits_HW.MinSwitchLevel" = false\n',
    "switch-supervision": "\n[drive.x_drive.switches]\npositive_limit_mm = 300.0\n",
    "switch-place": WATCHED + "[drive.x_drive.switches]\npositive_limit_mm = 620.0\n",
    "start-position": WATCHED + "[drive.x_drive.mechanics]\nstart_position_mm = 560.0\n",
    "stop-distance": WATCHED.replace("200.0", "500.0"),
    "reversal-distance": WATCHED + '"Homing.AutoReversal" = true\n',
    "encoder-resolution": '\n[axis.y.variables]\n"Sensor[1].Parameter.StepsPerRevolution" = 2048\n',
    "lead-screw": '\n[axis.x.variables]\n"Mechanics.LeadScrew" = 20.0\n',
    "direction": '\n[axis.x.variables]\n"Sensor[1].InverseDirection" = true\n',
    "maximum-velocity": '\n[axis.x.variables]\n"DynamicLimits.MaxVelocity" = 501.0\n',
    "drive-torque": "\n[drive.x_drive.mechanics]\nload_mass_kg = 4000.0\n",
    "drive-speed": "\n[drive.y_drive.profidrive]\nreference_speed_rpm = 3000.0\n",
    "reference-speed": '\n[axis.y.variables]\n"Actor.DriveParameter.ReferenceSpeed" = 2000.0\n',
}


@pytest.fixture
def bench_file(tmp_path):
    """Return a function that writes the bench with more tables and gives the file."""

    def write(more="", old="", new=""):
        path = tmp_path / "bench.toml"
        path.write_text(BENCH.replace(old, new) + more)
        return path

    return write


def test_shipped_benches_keep_every_rule(subtests):
    """No bench that ships with the product is complained about."""
    for name in EMBEDDED:
        with subtests.test(name):
            assert findings(load_bench(name).config) == []


def test_the_bench_of_the_handbook_keeps_every_rule():
    """What a user copies from the page about bench files works."""
    text = re.findall(r"```toml\n(# bench\.toml\n.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)[0]
    assert findings(BenchFile("bench.toml", text).config) == []


@pytest.mark.exhaustive
def test_benches_of_the_shipped_campaigns_keep_every_rule(subtests):
    """No bench on which a shipped campaign runs is complained about."""
    seen = set()
    for module in pkgutil.walk_packages(campaigns.__path__, "testcases.campaigns."):
        for name, value in vars(importlib.import_module(module.name)).items():
            if isinstance(value, BenchFile) and value.digest not in seen:
                seen.add(value.digest)
                with subtests.test(f"{module.name}:{name}"):
                    assert findings(value.config) == []
    assert len(seen) > 5


@pytest.mark.exhaustive
def test_every_rule_has_a_bench_that_breaks_it(bench_file, subtests):
    """Each rule, and only that one, speaks of a bench that breaks it, and names keys that can be changed."""
    assert findings(load_bench(bench_file()).config) == []
    assert list(TRIPPED) == [rule.name for rule in RULES]
    for name, more in TRIPPED.items():
        slower = "max_speed_rpm = 2000.0\n" if name == "drive-speed" else ""
        with subtests.test(name):
            file = load_bench(bench_file(more, "telegram = 105\n", f"telegram = 105\n{slower}"))
            found = findings(file.config)
            assert {one.rule.name for one in found} == {name}
            for key in found[0].keys:
                table, part, *_ = key.split(".")
                assert part in file.config.model_dump()[table]


@pytest.mark.exhaustive
def test_the_level_of_limit_switches_follows_their_contacts(bench_file):
    """Without levels of its own an axis reads normally open and closed switches as they are wired."""
    for closed in ("false", "true"):
        more = f"{WATCHED}\n[drive.x_drive.switches]\nnormally_closed = {closed}\n"
        with load_bench(bench_file(more)).build() as bench:
            bench.run_for(0.1)
            axis = bench.axis("x")
            assert axis.var("PositionLimits_HW.MinSwitchLevel") is (closed == "false")
            assert axis.var("PositionLimits_HW.MaxSwitchLevel") is (closed == "false")
            assert axis.var("ErrorDetail.Number") == 0


@pytest.mark.exhaustive
@pytest.mark.parametrize("axis", ["x", "y"])
def test_the_resolution_of_an_axis_follows_the_encoder_of_its_drive(bench_file, axis):
    """An axis without a resolution of its own travels as far as the load does, on CAN and on Modbus."""
    more = "\n[drive.x_drive.mechanics]\nstart_position_mm = 0.0\n"
    with load_bench(bench_file(more)).build() as bench:
        handle = bench.axis(axis)
        assert bench.run_until(handle.power().status, timeout=2.0)
        assert bench.run_until(handle.move_relative(20.0).done, timeout=5.0)
        bench.run_for(0.2)
        assert bench.trace()[f"{bench.drive_of(axis)}.position"].values[-1] == pytest.approx(0.02, abs=5e-5)


def test_the_filter_that_counts_decides_how_far_an_axis_goes_behind_a_switch(subtests):
    """300 mm/s are 0.3 mm/ms: the filter is that of the input at which a switch counts."""
    station = """
[segment.net1]
kind = "modbus_tcp"
[station.io]
segment = "net1"
digital_inputs = ["x_drive.negative_limit", "x_drive.positive_limit"]
"""
    fast = WATCHED.replace("200.0", "300.0")
    at_io = (BENCH + station).replace('drive = "x_drive"', 'drive = "x_drive"\ninputs = "io"')
    switches = "[drive.x_drive.switches]\n"
    cases = {
        "6.4 ms, as without a key": (BENCH, "", []),
        "20 ms at one of them": (BENCH, switches + "positive_limit_filter_ms = 20.0\n", ["positive"]),
        "20 ms at both": (BENCH, switches + "input_filter_ms = 20.0\n", ["negative", "positive"]),
        "a station of 6.4 ms": (at_io, switches + "input_filter_ms = 20.0\n", []),
        "a station of 20 ms": (
            at_io.replace("digital", "input_filter_ms = 20.0\ndigital"),
            "",
            ["negative", "positive"],
        ),
        "a channel of 20 ms": (
            at_io.replace("digital", "input_filters_ms = [20.0, 0.1]\ndigital"),
            "",
            ["negative"],
        ),
    }
    for name, (bench, more, sides) in cases.items():
        with subtests.test(name):
            config = BenchFile("bench.toml", bench + fast + more).config
            found = [one.sentence for one in findings(config) if one.rule.name == "stop-distance"]
            assert [side for side in ("negative", "positive") if any(side in one for one in found)] == sides


@pytest.mark.exhaustive
def test_check_says_what_to_change_and_ends_with_1(bench_file, capsys):
    """A bench that cannot work is reported with axis, sentence, alarm and keys, on the terminal and as
    JSON.
    """
    path = str(bench_file(TRIPPED["switch-level"]))
    assert main(["check", path]) == 1
    shown = capsys.readouterr().err
    assert "cell: 2 problems" in shown
    assert "x: PositionLimits_HW.MinSwitchLevel = FALSE, but the limit switches of x_drive are norm" in shown
    assert 'change axis.x.variables."PositionLimits_HW.MinSwitchLevel" or ' in shown
    assert "x: alarm 531 is pending after the start" in shown
    assert main(["check", path, "--json"]) == 1
    result = json.loads(capsys.readouterr().out)
    assert result["good"] is False
    assert [one["rule"] for one in result["findings"]] == ["switch-level"]
    assert [(one["axis"], one["alarm"], one["rules"]) for one in result["pending"]] == [
        ("x", 531, ["switch-level"])
    ]
    assert main(["check", path, "--no-build"]) == 1
    assert main(["check", path, "--ignore", "switch-level"]) == 0
    assert main(["check", path, "--ignore", "switch-levle"]) == 2
    assert "similar: switch-level" in capsys.readouterr().err


@pytest.mark.exhaustive
def test_an_alarm_that_no_rule_foresees_is_reported_with_its_keys(bench_file, capsys):
    """Software limits that contradict each other are alarm 104 after the start."""
    more = (
        '\n[axis.x.variables]\n"PositionLimits_SW.Active" = true\n"PositionLimits_SW.MinPosition" = 10.0\n'
        '"PositionLimits_SW.MaxPosition" = -10.0\n'
    )
    assert main(["check", str(bench_file(more)), "--json"]) == 1
    (alarm,) = json.loads(capsys.readouterr().out)["pending"]
    assert alarm["alarm"] == 104
    assert 'axis.x.variables."PositionLimits_SW.MinPosition"' in alarm["keys"]


@pytest.mark.exhaustive
def test_external_encoders_are_asked_for_alarms_too(capsys):
    """A bench with an external encoder is good when nothing is pending on it."""
    assert main(["check", "testcases.campaigns.external_encoder:REFERENCE", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["good"] is True
    assert result["encoder"]
