"""Modbus segments and their drives in the bench file: every mistake is named."""

from __future__ import annotations

import pytest

from hil.bench import load_bench
from hil.bench.bench_file import BenchFileError, parse, read

LIVE = {'kind = "virtual"': 'kind = "live"', "latency_us = 100\n": ""}


def check(name, changes):
    """Parse an embedded bench with other texts in some places."""
    text = read(name)[1]
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new)
    return parse(text, "own.toml")


@pytest.mark.requirement("PD-289", "PD-198", "MODB-007")
@pytest.mark.parametrize(
    ("name", "changes", "message"),
    [
        (
            "profidrive_tcp",
            {"telegram = 105": "telegram = 103"},
            r"drive\.drive1\.map: telegram 103: '15 words of actual_values'",
        ),
        ("profidrive_tcp", {'"sinamics_g120"': '"nobodys"'}, "drive.drive1.map: register map: 'nobodys'"),
        (
            "profidrive_tcp",
            {'profile = "profidrive"\ntelegram = 105\n': ""},
            r'map: a drive with profile = "cia402" has none; it is a key of .* without node_id \(on Modbus\)',
        ),
        (
            "profidrive_tcp",
            {'map = "': 'node_id = 5\nmap = "'},
            r'map: a drive with profile = "profidrive" and node_id \(on CAN\) has none; .* \(on Modbus\)',
        ),
        (
            "profidrive_tcp",
            {'map = "': 'heartbeat_ms = 0\nmap = "'},
            r"heartbeat_ms: a drive .* \(on Modbus\) has none; it is a key of .*cia402",
        ),
        (
            "profidrive_tcp",
            {'map = "': 'port = 502\nmap = "'},
            "port: only a drive on a live network has one",
        ),
        (
            "profidrive_tcp",
            {"latency_us = 100": "bitrate = 500_000"},
            'bitrate: a segment of kind = "modbus_tcp" has none',
        ),
        (
            "profidrive_tcp",
            {"latency_us = 100": "baud = 9600"},
            'it is a key of a segment of kind = "modbus_rtu"',
        ),
        (
            "profidrive_tcp",
            {"latency_us = 100": "connections = 0"},
            "connections",
        ),
        (
            "profidrive_tcp",
            {'kind = "modbus_tcp"': 'kind = "modbus_ascii"'},
            "net0.kind: 'modbus_ascii' is not allowed; allowed: 'can', 'modbus_tcp', 'modbus_rtu'",
        ),
        (
            "profidrive_tcp",
            {"[axis.axis1.variables]": '[axis.axis1.variables]\n"PositionControl.EnableDSC" = true'},
            "needs the clock of the bus",
        ),
        (
            "profidrive_tcp",
            {"off1_ramp_s = 1.0": "off1_ramp_s = 1.0\nprofidrive = { torque_telegram = true }"},
            "telegram 105 with 750",
        ),
        ("profidrive_rtu", {"unit = 5": "unit = 0"}, "unit: 0 is not allowed; allowed: 1..247"),
        ("profidrive_rtu", {"unit = 5": "unit = 248"}, "unit: 248 is not allowed; allowed: 1..247"),
        (
            "profidrive_rtu",
            {"115_200": "19_200"},
            (
                r"baud: at 19200 the requests of every bus cycle take \d+\.\d ms, longer than "
                r"bench.cycle_ms = 24"
            ),
        ),
        ("profidrive_rtu", {"115_200": "115_200\nlatency_us = 5"}, "latency_us: a segment of kind"),
        ("reference", {"node_id = 5": ""}, "drive.drive1.node_id: the key is missing"),
        (
            "reference",
            {"node_id = 5": "node_id = 5\nunit = 7"},
            r'unit: a drive with profile = "cia402" has none; it is a key of .* \(on Modbus\)',
        ),
        (
            "reference",
            {"node_id = 5": 'node_id = 5\nmap = "festo"'},
            "map: a drive with profile = .cia402. has none",
        ),
        (
            "profidrive_tcp",
            {**LIVE, '"net0"\nmap': '"net0"\ndevice = "physical"\nmap'},
            "port: the key is missing; it is a physical drive",
        ),
        (
            "profidrive_rtu",
            {'"virtual"': '"live"', "unit = 5": 'unit = 5\ndevice = "physical"'},
            "path: the key is missing; drive.drive1 is a physical drive",
        ),
        (
            "profidrive_rtu",
            {'"virtual"': '"live"', "115_200": '115_200\npath = "/dev/ttyS9"'},
            "it comes with a pseudo-terminal of its own",
        ),
        ("profidrive_tcp", {'"virtual"': '"live"'}, "latency_us: a live network has its own"),
    ],
)
def test_mistakes_are_named(name, changes, message):
    """The message has the key, the value and what is allowed."""
    if "latency_us: a live" in message:
        changes = {**changes, "latency_us = 100": "latency_us = 200"}
    with pytest.raises(BenchFileError, match=message):
        check(name, changes)


def two(name, **second):
    """Return a bench file with a second drive like the first one."""
    text = read(name)[1]
    drive = text[text.index("[drive.drive1]") : text.index("[axis.axis1]")]
    other = drive.replace("drive1", "drive2")
    for old, new in second.items():
        other = other.replace(f"{old} = 5", f"{old} = {new}")
    return text.replace("[axis.axis1]\n", other + "[axis.axis1]\n", 1)


def test_a_unit_is_taken_once_on_a_line():
    """Two drives of a line have two units; over TCP, where every drive has a connection of its own, they may
    be equal.
    """
    with pytest.raises(BenchFileError, match=r"drive\.drive2\.unit: 5 is already taken by drive\.drive1"):
        parse(two("profidrive_rtu"), "own.toml")
    assert parse(two("profidrive_rtu", unit=6), "own.toml").drive["drive2"].unit == 6
    assert set(parse(two("profidrive_tcp"), "own.toml").drive) == {"drive1", "drive2"}


def test_an_address_is_taken_once_on_a_live_network():
    """Host and port of a live network are those of one drive."""
    text = two("profidrive_tcp")
    for old, new in {**LIVE, 'kind = "modbus_tcp"': 'kind = "modbus_tcp"\nport = 1502'}.items():
        text = text.replace(old, new)
    with pytest.raises(
        BenchFileError, match=r"drive2\.port: 127\.0\.0\.1:1502 is already taken by drive\.drive1"
    ):
        parse(text, "own.toml")
    head, tail = text.split("[drive.drive2]")
    assert parse(f"{head}[drive.drive2]\nport = 1503{tail}", "own.toml").drive["drive2"].port == 1503


@pytest.mark.parametrize(("table", "key"), [("encoder", 'type = "multi_turn"'), ("device", 'eds = "x.eds"')])
def test_what_speaks_can_only_is_refused(table, key):
    """Encoders with a node and devices made of an EDS are on CAN."""
    text = read("profidrive_tcp")[1] + f'\n[{table}.other]\nsegment = "net0"\nnode_id = 7\n{key}\n'
    with pytest.raises(BenchFileError, match=f"{table}.other.segment: 'net0' is of kind"):
        parse(text, "own.toml")


def test_a_map_next_to_the_bench_file_is_found_and_part_of_its_digest(tmp_path):
    """A register map of one's own counts like the text of the bench file."""
    bench = read("profidrive_tcp")[1].replace('"sinamics_g120"', '"own.toml"')
    bench = bench.replace('PositionLimits_HW.Active" = true', 'PositionLimits_HW.Active" = false')
    words = 'name = "own"\n' + "".join(
        f'[[block]]\nregister = {at}\ncount = 10\nhook = "{hook}"\n'
        for at, hook in ((0, "setpoints"), (20, "actual_values"))
    )
    (tmp_path / "bench.toml").write_text(bench)
    (tmp_path / "own.toml").write_text(words)
    first = load_bench(tmp_path / "bench.toml")
    assert first.config.drive["drive1"].map == str(tmp_path / "own.toml")
    (tmp_path / "own.toml").write_text(words + "# another one\n")
    assert load_bench(tmp_path / "bench.toml").digest != first.digest


@pytest.mark.parametrize("name", ["profidrive_tcp", "profidrive_rtu"])
def test_a_bench_file_that_names_every_key_is_no_mistake(name):
    """Keys of other segments with their defaults change nothing: a whole configuration can be read back."""
    config = load_bench(name).config
    assert type(config).model_validate(config.model_dump(mode="json")) == config
