"""Tables of the bench file for the inside of a drive, and the controller of the bench on every
personality.
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from emulators.drive.cia402 import DriveConfig, personality_names
from hil._commands.personalities import show_personalities
from hil.bench import BenchFile, BenchFileError, load_bench
from hil.cli import main

BENCH = """
[bench]
name = "own"

[segment.can0]

[drive.d]
segment = "can0"
node_id = 5
{keys}

[axis.a]
drive = "d"
"""


def configured(keys: str, source: str = "own.toml") -> DriveConfig:
    config = BenchFile(source, BENCH.format(keys=keys)).config
    return config.drive["d"].config(config.bench)


@pytest.mark.parametrize(
    ("keys", "read", "value"),
    [
        ("[drive.d.brake]\ntorque_nm = 3.0", lambda c: c.brake.torque_nm, 3.0),
        ("[drive.d.brake]\nopening_time_ms = 50", lambda c: c.brake.opening_time_ms, 50),
        ("[drive.d.brake]\nclosing_time_ms = 30", lambda c: c.brake.closing_time_ms, 30),
        ("[drive.d.mechanics]\ngravity_n = -400", lambda c: c.mechanics.gravity_n, -400.0),
        ("[drive.d.mechanics]\nstatic_friction_n = 60", lambda c: c.mechanics.static_friction_n, 60.0),
        (
            (
                "[drive.d.supply]\nnominal_v = 320\nundervoltage_v = 200\novervoltage_v = 420\nchopper_off_v = "  # noqa: E501
                "380\nchopper_on_v = 400"
            ),
            lambda c: (
                c.supply.nominal_v,
                c.supply.undervoltage_v,
                c.supply.overvoltage_v,
                c.supply.chopper_off_v,
                c.supply.chopper_on_v,
            ),
            (320.0, 200.0, 420.0, 380.0, 400.0),
        ),
        (
            "[drive.d.supply]\ncapacitance_uf = 1000\nstandby_w = 5",
            lambda c: (c.supply.capacitance_uf, c.supply.standby_w),
            (1000.0, 5.0),
        ),
        (
            "[drive.d.supply]\nchopper_ohm = 60\nchopper_rated_w = 50",
            lambda c: (c.supply.chopper_ohm, c.supply.chopper_rated_w),
            (60.0, 50.0),
        ),
        ("[drive.d.supply]\nphase_loss_time_ms = 100", lambda c: c.supply.phase_loss_time_s, 0.1),
        ('[drive.d.thermal]\noverload = "limit"', lambda c: c.thermal.overload, "limit"),
        ("[drive.d.thermal]\ni2t_time_constant_s = 10", lambda c: c.thermal.i2t_time_constant_s, 10.0),
        (
            "[drive.d.thermal]\nstage_overload = 1.5\nstage_overload_time_s = 3",
            lambda c: (c.thermal.stage_overload, c.thermal.stage_overload_time_s),
            (1.5, 3.0),
        ),
        (
            "[drive.d.thermal]\nambient_c = 40\nmotor_loss_w = 10",
            lambda c: (c.thermal.ambient_c, c.thermal.motor_loss_w),
            (40.0, 10.0),
        ),
        (
            (
                "[drive.d.thermal]\nmotor_rise_k = 60\nmotor_time_constant_s = 300\nmotor_warning_c = "
                "100\nmotor_fault_c = 110"
            ),
            lambda c: (
                c.thermal.motor_rise_k,
                c.thermal.motor_time_constant_s,
                c.thermal.motor_warning_c,
                c.thermal.motor_fault_c,
            ),
            (60.0, 300.0, 100.0, 110.0),
        ),
        (
            (
                "[drive.d.thermal]\nstage_rise_k = 20\nstage_time_constant_s = 30\nstage_warning_c = "
                "70\nstage_fault_c = 80"
            ),
            lambda c: (
                c.thermal.stage_rise_k,
                c.thermal.stage_time_constant_s,
                c.thermal.stage_warning_c,
                c.thermal.stage_fault_c,
            ),
            (20.0, 30.0, 70.0, 80.0),
        ),
        (
            '[drive.d.safety]\nsto = "fault"\ninterlock = "quick_stop"',
            lambda c: (c.safety.sto, c.safety.interlock),
            ("fault", "quick_stop"),
        ),
        (
            "[drive.d.safety]\nss1_time_ms = 250\nss1_monitored = false",
            lambda c: (c.safety.ss1_time_s, c.safety.ss1_monitored),
            (0.25, False),
        ),
        ('following_error = "status"', lambda c: c.following_error, "status"),
        ("csv_interpolation = false", lambda c: c.csv_interpolation, False),
        ("power_on_delay_ms = 200", lambda c: c.power_on_delay_ms, 200.0),
        ("boot_time_ms = 300", lambda c: c.boot_time_ms, 300.0),
        ("blocked_time_ms = 100", lambda c: c.blocked_time_ms, 100.0),
        (
            'personality = "single-setpoint-servo"',
            lambda c: (c.personality, c.quirks.single_setpoint),
            ("single-setpoint-servo", True),
        ),
    ],
)
def test_every_key_reaches_the_drive(keys, read, value):
    """What the bench file says is what the emulated drive is built with."""
    assert read(configured(keys)) == value
    assert read(configured("")) != value


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ("off3_ramp_s = 0.0001", r"drive\.d\.off3_ramp_s: 0\.0001 is not allowed; .*0\.001"),
        ("off1_ramp_s = 1e6", r"drive\.d\.off1_ramp_s: 1000000\.0 is not allowed; .*1000"),
        (
            "max_speed_rpm = 150000\noff3_ramp_s = 0.01",
            r"off3_ramp_s: 0\.01 s from 150000 rpm is steeper than 6084h .*at least 0\.0349 s",
        ),
        ("max_speed_rpm = 1e9", r"max_speed_rpm: .*200000"),
        ("rated_torque_nm = 0.0", r"rated_torque_nm: .*0\.001"),
        ("velocity_time_constant_ms = 1e9", r"velocity_time_constant_ms: .*1000"),
        (
            "[drive.d.brake]\ntorque_nm = -1",
            r"drive\.d\.brake\.torque_nm: -1 is not allowed; allowed: 0 to 100000",
        ),
        ("[drive.d.brake]\nopening_time_ms = 6000", r"opening_time_ms: .*5000"),
        (
            "[drive.d.brake]\nopening_time_ms = inf",
            r"opening_time_ms: inf is not allowed; allowed: 0 to 5000",
        ),
        (
            "[drive.d.brake]\ntorque = 1",
            r"drive\.d\.brake\.torque: unknown key; did you mean torque_nm\? allowed: torque_nm",
        ),
        (
            "[drive.d.mechanics]\nstatic_friction_n = 10",
            r"static_friction_n: 10\.0 is not allowed; allowed: at least coulomb_friction_n = 30",
        ),
        ("[drive.d.mechanics]\ngravity_n = nan", r"gravity_n: .*finite"),
        ("[drive.d.supply]\nundervoltage_v = 600", r"drive\.d\.supply: .*DC link.*undervoltage < nominal"),
        ("[drive.d.supply]\nchopper_on_v = 800", r"drive\.d\.supply: .*chopper on <= overvoltage"),
        ("[drive.d.thermal]\nmotor_warning_c = 150", r"drive\.d\.thermal: .*ambient < warning < fault"),
        (
            '[drive.d.thermal]\noverload = "ignore"',
            r"overload: 'ignore' is not allowed; allowed: 'fault' or 'limit'",
        ),
        (
            '[drive.d.safety]\ninterlock = "open"',
            r"interlock: 'open' is not allowed; allowed: 'none', 'inhibit'",
        ),
        ("[drive.d.safety]\nss1_time_ms = 0", r"ss1_time_ms: 0 is not allowed"),
        ('personality = "acme"', r"drive\.d\.personality: 'acme' is not allowed; .*standard"),
        ('personality = "missing.toml"', r"drive\.d\.personality: .*readable file"),
    ],
)
def test_wrong_values_are_refused_with_what_is_allowed(keys, message):
    """Range, order and spelling are checked when the file is read; the message names the key."""
    with pytest.raises(BenchFileError, match=message):
        BenchFile("own.toml", BENCH.format(keys=keys))


@pytest.mark.exhaustive
def test_a_personality_of_your_own_is_next_to_the_bench_file(tmp_path, monkeypatch, capsys):
    """A relative path starts at the bench file, from wherever the command runs; another process finds it
    again.
    """
    folder = tmp_path / "benches"
    folder.mkdir()
    (folder / "mine.toml").write_text(
        'name = "mine"\nsummary = "Of our own."\n[quirks]\nskips_switched_on = true\n', encoding="utf-8"
    )
    (folder / "bench.toml").write_text(BENCH.format(keys='personality = "mine.toml"'), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    bench_file = load_bench(folder / "bench.toml")
    assert bench_file.config.drive["d"].config(bench_file.config.bench).quirks.skips_switched_on
    again = type(bench_file.config).model_validate(bench_file.config.model_dump(mode="json"))
    assert Path(again.drive["d"].personality) == folder / "mine.toml"
    assert main(["check", str(folder / "bench.toml"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["personalities"] == [f"d: {folder / 'mine.toml'}"]
    shutil.rmtree(folder)


@pytest.mark.exhaustive
def test_personalities_are_listed(tmp_path, capsys):
    """The command shows all of them for people and programs, or files that are named."""
    assert show_personalities([], as_json=True) == 0
    listed = json.loads(capsys.readouterr().out)
    assert tuple(one["name"] for one in listed) == personality_names()
    assert main(["personalities"]) == 0
    text = capsys.readouterr().out
    for name in personality_names():
        assert f"{name}: " in text
    own = tmp_path / "own.toml"
    own.write_text('name = "own"\nsummary = "x."\n[emcy.8611]\ncode = 65300\n', encoding="utf-8")
    assert main(["personalities", str(own), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)[0]["emcy"] == {
        "8611": {"code": 65300, "register": None, "data": ""}
    }
    own.write_text("name = 3\n", encoding="utf-8")
    assert main(["personalities", str(own)]) == 2
    assert "name" in capsys.readouterr().err


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", personality_names())
def test_the_controller_drives_every_personality(name):
    """Enable, move, stop, fault, MC_Reset, move again with the axis of the reference bench, whatever the
    drive's quirks.
    """
    text = load_bench("reference").text.replace("node_id = 5", f'node_id = 5\npersonality = "{name}"')
    with BenchFile("own.toml", text).build(seed=1) as bench:
        axis = bench.axis()
        assert bench.drive().config.personality == name
        power = axis.power()
        assert bench.run_until(power.status, timeout=3.0)
        axis.home(0.0)
        move = axis.move_absolute(20.0, Velocity=200.0)
        assert bench.run_until(move.done, timeout=2.0)
        axis.move_velocity(100.0)
        bench.run_for(0.3)
        halt = axis.halt()
        assert bench.run_until(halt.done, timeout=2.0)
        bench.drive().raise_fault(0x8611)
        bench.run_for(0.2)
        assert not power.status()
        assert any(
            event.kind == "alarm.raised" and event.data["number"] == 421 for event in bench.history.events
        )
        axis.reset()
        assert bench.run_until(power.status, timeout=3.0)
        back = axis.move_absolute(0.0, Velocity=200.0)
        assert bench.run_until(back.done, timeout=2.0)
        assert bench.drive().mechanics.position == pytest.approx(0.0, abs=1e-4)


def test_the_bench_file_wins_over_the_personality():
    """The sign of the home offset that the file states itself counts, also in the process of a live bench."""
    keys = 'personality = "auto-retry-inverter"'
    stated = keys + '\n[drive.d.homing]\noffset = "profile"'
    for text, expected in ((keys, "vendor"), (stated, "profile")):
        config = BenchFile("own.toml", BENCH.format(keys=text)).config
        sent = type(config).model_validate(config.model_dump(mode="json", exclude_unset=True))
        assert config.drive["d"].config(config.bench).homing.offset == expected
        assert sent.drive["d"].config(sent.bench).homing.offset == expected
