"""The controller takes drives as their EDS says: fewer PDOs, fixed mappings, other modes, other units."""

import json
import math
import re

import pytest

import hil
from fieldbus.canopen.dictionary import entries_of
from fieldbus.canopen.eds import load_dictionary
from fieldbus.errors import ConfigurationError
from hil.bench import BenchFile
from hil.cli import main
from motion.drives.cia402_plan import MODES, STANDARD
from testcases.campaigns._drives_of_eds import NODE, bench_of, built, drive_eds, plan_of

pytestmark = pytest.mark.exhaustive

PDO1 = (0x60400010, 0x60FF0020, 0x60600008)
STATUS_POSITION = (0x60410010, 0x60640020)
CASES = {
    "everything": ({}, "csv", ()),
    "no third TPDO": ({"count": 2}, "csv", ("603Fh",)),
    "one PDO of each direction": ({"count": 1}, "csv", ("606Ch", "60FDh", "603Fh")),
    "no optional objects": (
        {"without": (0x606C, 0x6077, 0x60FD, 0x603F)}, "csv", ("606Ch", "6077h", "60FDh", "603Fh"),
    ),
    "fixed PDOs that suffice": (
        {
            "fixed": (0x1400, 0x1800, 0x1801),
            "records": {0x1600: PDO1, 0x1A00: STATUS_POSITION, 0x1A01: (0x606C0020, 0x60770010)},
        },
        "csv",
        ("RPDO1 is used", "TPDO1 is used", "TPDO2 is used"),
    ),
    "fixed PDOs in another order": (
        {
            "fixed": (0x1400, 0x1401, 0x1800, 0x1801),
            "records": {0x1600: (0x60400010,), 0x1601: (0x607A0020, 0x60FF0020), 0x1A00: (0x60410010,),
                        0x1A01: (0x606C0020, 0x60640020)},
        },
        "csv",
        ("RPDO1 is used", "RPDO2 is used"),
    ),
    "no cyclic mode": ({"changed": {0x6502: "0x2F"}}, "pv", ("mode pv",)),
    "no csv": ({"changed": {0x6502: "0xEF"}}, "csp", ("mode csp",)),
    "only csp": ({"changed": {0x6502: "0xA0"}}, "csp", ("mode csp",)),
    "only ip": ({"changed": {0x6502: "0x60"}}, "ip", ("mode ip",)),
    "no velocity unit": ({"without": (0x60A9,)}, "csv", ("60A9h",)),
    "fixed velocity unit": ({"read_only": (0x60A9,)}, "csv", ("60A9h",)),
    "fixed encoder resolution": ({"read_only": (0x608F,)}, "csv", ()),
    "no heartbeat": ({"without": (0x1017,)}, "csv", ("1017h cannot be written: node guarding",)),
    "a quick stop without a ramp": (
        {"more": "[605A]\nParameterName=Stop\nDataType=3\nAccessType=ro\nPDOMapping=0\nDefaultValue=0\n"},
        "csv",
        ("605Ah is 0 and cannot be written: with OFF3 (quick stop) the drive coasts",),
    ),
    "a limited acceleration": (
        {
            "changed": {0x6502: "0xA0"},
            "more": "[60C5]\nParameterName=A\nDataType=7\nAccessType=rw\nDefaultValue=5000000\n",
        },
        "csp",
        ("mode csp: 60C5h is 5000000 units: steeper ramps lag behind",),
    ),
    "no interpolation time": ({"without": (0x60C2,)}, "csv", ("60C2h",)),
}  # fmt: skip


REAL_POSITION = "[6064]\nParameterName=Position\nDataType=8\nAccessType=ro\nPDOMapping=1\n"


@pytest.mark.parametrize("case", CASES)
def test_a_drive_is_commissioned_moved_and_stopped(tmp_path, case):
    """The plan takes what the EDS has and says what is lost; the axis is enabled, moves and stops."""
    options, mode, notes = CASES[case]
    file = bench_of(tmp_path, drive_eds(**options))
    plan = plan_of(file)
    assert plan.mode == MODES[mode]
    for note in notes:
        assert any(note in text for text in plan.notes), (note, plan.notes)
    assert bool(notes) == bool(plan.notes), plan.notes
    with file.build() as bench:
        axis, drive = bench.axis(), bench.drive()
        power = axis.power()
        assert bench.run_until(lambda: bool(power.Status), 2.0)
        before = drive.mechanics.motor_angle
        job = axis.move_relative(10.0)
        assert bench.run_until(job.done, 5.0)
        bench.run_for(0.2)
        assert drive.mechanics.motor_angle - before == pytest.approx(2.0 * math.pi, abs=0.02)
        assert axis.var("ActualPosition") == pytest.approx(10.0, abs=0.05)
        axis.move_velocity(50.0)
        bench.run_for(1.0)
        assert axis.var("ActualVelocity") == pytest.approx(50.0, rel=0.1)
        axis.power(False)
        bench.run_for(2.0)
        assert drive.core.velocity == pytest.approx(0.0, abs=0.01)
        assert not drive.core.enabled


def test_node_guarding_watches_a_drive_without_heartbeat(tmp_path):
    """A drive that has no 1017h and falls silent is noticed all the same."""
    with bench_of(tmp_path, drive_eds(without=(0x1017,))).build() as bench:
        power = bench.axis().power()
        assert bench.run_until(lambda: bool(power.Status), 2.0)
        bench.drive().power_off()
        bench.run_for(1.0)
        assert not power.Status
        assert any(event.kind == "link.node_lost" for event in bench.trace().events)


@pytest.mark.parametrize(
    ("options", "keys", "message"),
    [
        ({"count": 0}, "", "csv: no PDO carries 6040h, 60FFh, 6041h, 6064h"),
        ({"changed": {0x6502: "0x21"}}, "", "csv: 6502h = 00000021h does not have it.*ip: 6502h"),
        ({"changed": {0x6502: "0x2F"}}, 'mode = "csv"\n', "csv: 6502h = 0000002Fh does not have it"),
        ({"without": (0x6064,)}, "", "csv: 6064h does not exist"),
        (
            {"without": (0x6064,), "more": REAL_POSITION},
            "",
            "csv: 6064h is no whole number",
        ),
        (
            {"fixed": (0x1400,), "records": {0x1600: (0x60400010,)}, "count": 1},
            "",
            "csv: no PDO carries 60FFh",
        ),
    ],
)
def test_a_drive_that_no_mode_can_command_is_refused(tmp_path, options, keys, message):
    """The message names every mode with what it lacks."""
    with pytest.raises(ConfigurationError, match=message):
        bench_of(tmp_path, drive_eds(**options), keys).build()


def test_the_mode_can_be_chosen(tmp_path):
    """A mode that the bench file names goes before the best one."""
    assert plan_of(bench_of(tmp_path, drive_eds(), 'mode = "csp"\n')).mode == MODES["csp"]


def test_without_an_eds_the_plan_is_the_standard_one():
    """Drives of the product and drives whose EDS is not known are used as before."""
    file = BenchFile(
        "x.toml", '[bench]\nname = "x"\n[segment.can0]\n[drive.d]\nsegment = "can0"\nnode_id = 5\n'
    )
    assert plan_of(file) is STANDARD


def test_nothing_is_written_that_the_drive_does_not_take(tmp_path):
    """What the controller writes is writable in the EDS; what it lacks is not asked for."""
    options = {"read_only": (0x60A9, 0x608F), "without": (0x1017, 0x6007)}
    with bench_of(tmp_path, drive_eds(**options)).build() as bench:
        (configured,) = [event for event in bench.trace().events if event.kind == "node.configured"]
        entries = entries_of(load_dictionary(tmp_path / "plan.eds"), NODE)
        frames = [frame for frame in bench.trace().frames if frame.can_id == 0x600 + NODE]
    assert configured
    downloads = [frame.data for frame in frames if frame.data and frame.data[0] & 0xE0 == 0x20]
    assert downloads
    for data in downloads:
        entry = entries[int.from_bytes(data[1:3], "little") << 8 | data[3]]
        assert entry.writable
        assert 4 - (data[0] >> 2 & 3) == entry.size


def test_commission_shows_the_plan_and_does_it(tmp_path, capsys):
    """`hil commission` shows mode, PDOs, what is written and what is lost; `--write` does it."""
    file = bench_of(tmp_path, drive_eds(count=2, changed={0x6502: "0x2F"}, without=(0x1017,)))
    (tmp_path / "bench.toml").write_text(file.text)
    assert main(["commission", file.source, "--json"]) == 0
    (drive,) = json.loads(capsys.readouterr().out)["drives"]
    assert (drive["drive"], drive["node_id"], drive["mode"], drive["result"]) == ("d", NODE, "pv", "")
    assert drive["pdos"] == [
        "RPDO1 205h: 6040h, 60FFh, 6060h",
        "TPDO1 185h: 6041h, 6064h, 6077h",
        "TPDO2 285h: 606Ch, 60FDh",
    ]
    assert "60A9h:0: 00B44700h -> FDB44700h" in drive["writes"]
    assert "100Ch:0: 0000h -> 0064h" in drive["writes"]
    assert any(text.startswith("mode pv") for text in drive["lost"])
    assert "no touch probe: 60B8h is missing" in drive["lost"]
    assert main(["commission", file.source, "--write"]) == 0
    assert re.search(r"commissioned, [1-9]\d* objects written", capsys.readouterr().err)


def test_commission_needs_a_drive_with_an_axis(capsys):
    """A bench without one is refused, with its name."""
    assert main(["commission", "profidrive"]) == 2
    assert "no CiA 402 drive with an axis" in capsys.readouterr().err


def test_profile_velocity_brakes_as_the_axis_wants(tmp_path):
    """In pv the axis brakes with its own values, and by OFF1 within its time, whatever 6084h was before."""
    slow = bench_of(tmp_path, drive_eds(changed={0x6502: "0x24", 0x6084: 300}), "off1_ramp_s = 8.0\n")
    file = BenchFile(slow.source, f'{slow.text}"Actor.RemoveEnableReaction" = 1\n')
    with built(file) as bench:
        axis, drive = bench.axis(), bench.drive()
        power = axis.power()
        assert bench.run_until(lambda: bool(power.Status), 2.0)
        job = axis.move_velocity(200.0)
        assert bench.run_until(lambda: job.InVelocity, 2.0)
        job = axis.halt()
        assert bench.run_until(job.done, 1.5)
        job = axis.move_velocity(200.0)
        assert bench.run_until(lambda: job.InVelocity, 2.0)
        bench.run_for(0.1)
        share = drive.core.velocity * 60.0 / math.tau / bench.config.drive["d"].max_speed_rpm
        assert share > 0.2
        hil.Injector(bench).inject("axis.alarm", "a", number=521, reaction=4)
        begin_s = bench.scheduler.now / 1e9
        assert bench.run_until(lambda: not drive.core.enabled, 6.0)
        assert bench.scheduler.now / 1e9 - begin_s == pytest.approx(8.0 * share, abs=0.05)


@pytest.mark.parametrize(
    ("options", "note"),
    [
        ({}, "OFF1 is a ramp of the controller"),
        (
            {"read_only": (0x6084,)},
            "6084h cannot be written: the drive keeps its deceleration, also with OFF1",
        ),
        ({"without": (0x6083,)}, "6083h cannot be written: the drive keeps its acceleration"),
    ],
)
def test_the_costs_of_profile_velocity_are_said(tmp_path, options, note):
    """The plan says what pv does to the ramps of the axis, and which of them the drive keeps."""
    plan = plan_of(bench_of(tmp_path, drive_eds(changed={0x6502: "0x24"}, **options)))
    assert any(note in text for text in plan.notes), plan.notes
