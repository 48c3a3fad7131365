"""What `hil check` says of mistakes in a bench file, as a user reads it."""

from pathlib import Path

import pytest

from hil.bench.drive_config import servo_eds
from hil.cli import main

BENCH = """
[bench]
name = "cell"

[segment.can0]

[drive.x_drive]
segment = "can0"
node_id = 5

[axis.x]
drive = "x_drive"

[axis.x.variables]
"Mechanics.LeadScrew" = 10.0
"""
LEAD = '"Mechanics.LeadScrew" = 10.0'


@pytest.fixture
def said(tmp_path, capsys):
    """Return a function that gives the lines about a bench file in which `old` stands as `new`."""

    def check(old, new):
        path = tmp_path / "bench.toml"
        assert old in BENCH
        path.write_text(BENCH.replace(old, new))
        assert main(["check", str(path)]) == 2
        text = capsys.readouterr().err
        return text.removeprefix("hil: ").replace(f"{tmp_path}/", "").splitlines()

    return check


MISTAKES = [
    (
        LEAD,
        '"Homing.ApproachDirectoin" = false',
        'axis.x.variables."Homing.ApproachDirectoin": this is not a variable of PositioningAxis; similar: ',
    ),
    (
        LEAD,
        '"DynamicLimits.MaxVelocity" = -3.0',
        'axis.x.variables."DynamicLimits.MaxVelocity": -3.0 is not allowed; allowed: LREAL, 0 to 1e+12 mm/s',
    ),
    (
        LEAD,
        "DynamicLimits.MaxVelocity = 3.0",
        'axis.x.variables.DynamicLimits: quote the path: "DynamicLimits.MaxVelocity" = 3.0',
    ),
    (
        LEAD,
        "PositionLimits_HW.Active = true",
        'axis.x.variables.PositionLimits_HW: quote the path: "PositionLimits_HW.Active" = true',
    ),
    (
        'drive = "x_drive"\n',
        'drive = "x_drive"\ntype = "speed"\n',
        "axis.x.variables: a speed axis has no Mechanics.LeadScrew: these are variables",
    ),
    (LEAD, "Sensor[1].Type = 1", '(at line 15, column 7); quote the path: "Sensor[1].Type"'),
    (LEAD, '"StatusWord" = 1', "axis.x: StatusWord: 1 is not allowed; allowed: no value"),
    (
        LEAD,
        '"PositionControl.Kv" = 0.0',
        "axis.x: PositionControl.Kv: 0.0 is not allowed; allowed: above 0 1/s",
    ),
    ("node_id = 5", "nodeid = 5", "drive.x_drive.nodeid: unknown key; did you mean node_id?"),
    ("node_id = 5", "node_id = -5", "drive.x_drive.node_id: -5 is not allowed; allowed: 1 to 126, whole"),
    ("node_id = 5", "node_id = 5.5", "drive.x_drive.node_id: 5.5 is not allowed; allowed: 1 to 126, whole"),
    ('name = "cell"', 'name = ""', "bench.name: '' is not allowed; allowed: a text that is not empty"),
    (
        "node_id = 5",
        'node_id = 5\neds = "missing.eds"',
        "drive.x_drive: eds: 'missing.eds' cannot be read (No such file or directory)",
    ),
]
COMMAS = [
    (
        LEAD,
        '"Mechanics.LeadScrew" = 10,5',
        'line 15: "Mechanics.LeadScrew": 10,5 is not allowed; allowed: a number with ',
    ),
    (
        LEAD,
        '"Mechanics.LeadScrew" = "10,5"',
        "'10,5' is not allowed; allowed: a number, true or false: 10.5, without q",
    ),
    (
        "node_id = 5",
        "node_id = 5\noff3_ramp_s = 0,5",
        "line 10: off3_ramp_s: 0,5 is not allowed; allowed: a number with a ",
    ),
    (
        "node_id = 5",
        'node_id = "5"',
        "drive.x_drive.node_id: '5' is not allowed; allowed: a number: 5, without quotes",
    ),
    (
        "node_id = 5",
        "node_id = 5\nmechanics = { lead_screw_mm = 10.0, load_mass_kg = 2,5 }",
        "line 10: load_mass_kg: 2,5 is not allowed; allowed: a number with a decimal point: load",
    ),
]
EVERYTHING = """
[bench]
name = "cell"

[segment.can0]

[segment.net0]
kind = "modbus_tcp"

[drive.a]
segment = "can0"
node_id = 500

[drive.b]
segment = "can1"
node_id = 2

[drive.c]
segment = "can0"
node_id = 3
eds = "missing.eds"

[drive.d]
segment = "net0"
node_id = 4

[drive.e]
segment = "can0"
node_id = 3

[drive.f]
profile = "analog"
segment = "net0"

[station.io]
segment = "net0"
analog_outputs = ["f.setpoint", "q.setpoint"]

[encoder.k]
segment = "can0"
node_id = 9
on = "a"

[axis.u]
drive = "a"
encoders = ["nobody"]

[axis.v]
drive = "z"

[axis.w]
drive = "c"

[axis.w.ramp_times]
slow = 3.0

[axis.x]
drive = "e"
encoders = []

[axis.y]
drive = "f"

[external_encoder.l]
encoder = "m"
"""
ALL_AT_ONCE = [
    "drive.a.node_id: 500 is not allowed; allowed: 1 to 126, whole",
    "drive.b.segment: 'can1' is not a segment; there are: can0, net0",
    "station.io.analog_outputs[1]: 'q' is not a drive; there are: b, c, d, e, f, a",
    "axis.v.drive: 'z' is not a drive; there are: b, c, d, e, f, a",
    "external_encoder.l.encoder: 'm' is not an encoder; there are: k",
    "drive.d.profile: ",
    "axis.x.encoders: a positioning axis needs an encoder",
    "drive.e.node_id: 3 is already taken by drive.c",
    "drive.c: eds: ",
    "axis.w: ramp_times.slow: 3.0 is not allowed",
]
"""Mistakes of `EVERYTHING`; nothing is said of what refers to tables with a mistake."""
TABLES = [
    (
        '[bench]\nname = "cell"\n',
        "",
        ["the table [bench] is missing; the smallest one:", "[bench]", 'name = "my bench"'],
    ),
    ("[segment.can0]", "", ["the table [segment.NAME] is missing; the smallest one:", "[segment.can0]"]),
    (
        "[segment.can0]",
        "[segment]",
        ["segment: the table is empty; allowed: one table [segment.NAME] or more"],
    ),
    (
        "[axis.x.variables]",
        "[axis]\ny = 5\n[axis.x.variables]",
        ["axis.y: 5 is not allowed; allowed: a table [axis.y]"],
    ),
    (
        BENCH,
        'drive = 3\n[bench]\nname = "cell"\n[segment.can0]\n',
        ["drive: 3 is not allowed; allowed: tables [drive.NAME]"],
    ),
    (
        BENCH[BENCH.index("[drive.x_drive]") :],
        "[drive]\nx_drive = 5\n",
        ["drive.x_drive: 5 is not allowed; allowed: a table [drive.x_drive]"],
    ),
    (
        "[drive.x_drive]",
        "[drive.x_drive.mechanics]\nload_mass_kg = 2.0\n[drives.x_drive]",
        [
            "drives: unknown key; did you mean drive?",
            "drive.x_drive.segment: the key",
            "drive.x_drive.node_id: the key",
        ],
    ),
]


@pytest.mark.exhaustive
def test_a_table_that_is_missing_or_no_table_is_shown_as_it_is_written(said, subtests):
    """The message has the head of the table, and where it is missing the smallest example; unknown tables
    come first.
    """
    for old, new, messages in TABLES:
        with subtests.test(new):
            lines = said(old, new)
            assert len(lines) == len(messages)
            for line, message in zip(lines, messages, strict=True):
                assert message in line


@pytest.mark.exhaustive
def test_a_mistake_is_reported_with_file_key_and_what_is_allowed(said, subtests):
    """One line blames the key or the value, whichever is wrong, and names the nearest right one."""
    for old, new, message in MISTAKES:
        with subtests.test(new):
            lines = said(old, new)
            assert len(lines) == 1
            assert lines[0].startswith("bench.toml: ")
            assert message in lines[0]


@pytest.mark.exhaustive
def test_an_eds_of_another_device_is_named_with_file_and_drive(said, tmp_path):
    """An EDS without the status word is none of a drive: bench file, drive, EDS and object are named."""
    lines = Path(servo_eds()).read_text(encoding="latin-1").splitlines()
    own = [line.replace("6041", "9999") for line in lines if line != "9999"]
    (tmp_path / "box.eds").write_text("\n".join(own), encoding="latin-1")
    (line,) = said("node_id = 5", 'node_id = 5\neds = "box.eds"')
    assert line.startswith(
        "bench.toml: drive.x_drive: eds: 'box.eds' has no object 6041h; allowed: an EDS of a CiA"
    )


def test_mistakes_of_all_tables_are_shown_at_once(said):
    """Wrong values, names that do not exist, tables that do not fit and files that are missing come in one
    answer; a table that refers to a wrong one adds no line.
    """
    lines = said(BENCH, EVERYTHING)
    assert len(lines) == len(ALL_AT_ONCE), lines
    for line, start in zip(lines, ALL_AT_ONCE, strict=True):
        assert line.startswith(f"bench.toml: {start}")


@pytest.mark.exhaustive
def test_variables_that_do_not_fit_are_shown_for_every_axis(said):
    """What shows only when the axes are built is shown for all of them."""
    second = (
        '\n[drive.y_drive]\nsegment = "can0"\nnode_id = 6\n[axis.y]\ndrive = "y_drive"\n[axis.y.variables]\n'
    )
    gain = '"PositionControl.Kv" = 0.0'
    lines = said(LEAD, f"{gain}{second}{gain}")
    assert [line.partition(": PositionControl.Kv: 0.0")[0] for line in lines] == [
        "bench.toml: axis.x",
        "bench.toml: axis.y",
    ]


@pytest.mark.exhaustive
def test_numbers_with_a_decimal_comma_or_in_quotes_are_corrected(said, subtests):
    """The message has file, line or place, key, and the number as TOML writes it."""
    for old, new, message in COMMAS:
        with subtests.test(new):
            (line,) = said(old, new)
            assert line.startswith("bench.toml: ")
            assert message in line
