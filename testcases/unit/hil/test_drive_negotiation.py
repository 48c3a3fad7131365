"""Drives that are not as their EDS says: a refused write, what is tried next; mappings that a user wants."""

import json
import math

import pytest

from fieldbus.errors import ConfigurationError, HilError
from hil.bench import BenchFile
from hil.cli import main
from hil.expect import run_checkers
from motion.drives.cia402_plan import MODES
from reports.model import Verdict
from testcases.campaigns._drives_of_eds import COUNTS, bench_of, built, drive_eds, plan_of

pytestmark = pytest.mark.exhaustive

NOT_MAPPABLE = 0x06040041
PERSONALITY = 'name = "refuses"\nsummary = "Refuses what its EDS promises."\n[refusals]\n'


def refusing_bench(folder, refusals, **options):
    """Return the bench file of a drive that refuses entries although its EDS lets them be written."""
    (folder / "refuses.toml").write_text(
        PERSONALITY + "".join(f'"{entry}" = {code}\n' for entry, code in refusals.items())
    )
    return bench_of(folder, drive_eds(**options), 'personality = "refuses.toml"\n')


def moved(bench):
    """Enable the axis and move it; return the way of the motor in revolutions."""
    axis, drive = bench.axis(), bench.drive()
    power = axis.power()
    assert bench.run_until(lambda: bool(power.Status), 2.0)
    before = drive.mechanics.motor_angle
    job = axis.move_relative(10.0)
    assert bench.run_until(job.done, 5.0)
    bench.run_for(0.2)
    assert axis.var("ActualPosition") == pytest.approx(10.0, abs=0.05)
    return (drive.mechanics.motor_angle - before) / math.tau


def refused(bench):
    """Return object and remedy of everything that a drive has refused."""
    return [
        (event.data["object"], event.data["instead"])
        for event in bench.trace().events
        if event.kind == "node.refused"
    ]


def feed_constant(feed):
    text = "[6092]\nParameterName=Feed\nObjectType=9\nSubNumber=3\n\n"
    for sub, default in enumerate((2, feed, 1)):
        text += (
            f"[6092sub{sub}]\nParameterName=Feed {sub}\nDataType={7 if sub else 5}\nAccessType=rw\n"
            f"PDOMapping=0\nDefaultValue={default}\n\n"
        )
    return text


def test_a_drive_with_which_nothing_works_is_refused_with_what_was_tried(tmp_path):
    """The message has the object, the reason of the drive, and why every other way is closed."""
    refusals = {f"{record:X}:2": NOT_MAPPABLE for record in range(0x1600, 0x1604)}
    with pytest.raises(
        HilError, match=r"1600h:2 = .* not mappable.*nothing else is possible.*pv: 60FFh cannot"
    ):
        refusing_bench(tmp_path, refusals).build()


def test_a_refused_drive_is_not_negotiated_with_twice(tmp_path):
    """A drive that restarts gets at once what it has taken before."""
    with built(refusing_bench(tmp_path, {"1A00:3": NOT_MAPPABLE})) as bench:
        drive = bench.drive()
        drive.power_off()
        bench.run_for(0.5)
        drive.power_on()
        bench.run_for(1.0)
        assert bench.node("d").in_service
        assert len(refused(bench)) == 1


def test_identifiers_that_cannot_be_written_stay_and_the_mapping_is_set(tmp_path):
    """A PDO whose COB-ID is read-only is mapped all the same, without being made invalid."""
    file = bench_of(tmp_path, drive_eds(fixed_ids=(0x1400, 0x1800), records={0x1600: (0x60400010,)}))
    with built(file) as bench:
        assert moved(bench) == pytest.approx(1.0, abs=0.003)
        assert not refused(bench)


def test_a_drive_that_starts_itself_does_not_take_the_commissioning_for_a_fault(tmp_path):
    """6007h = 1 and a drive that enters Operational by itself: it is set up without a fault."""
    more = "[1F80]\nParameterName=Startup\nDataType=7\nAccessType=rw\nPDOMapping=0\nDefaultValue=0\n\n"
    with built(bench_of(tmp_path, drive_eds(changed={0x6007: 1}, more=more))) as bench:
        assert not [event for event in bench.trace().events if event.kind == "drive.fault"]
        assert moved(bench) == pytest.approx(1.0, abs=0.003)
        assert bench.drive().slave.values[0x600700] == 3


def test_a_drive_without_6007h_that_starts_itself_is_taken_into_service(tmp_path):
    """Nothing keeps it from taking the commissioning for a fault, which is acknowledged then."""
    more = "[1F80]\nParameterName=Startup\nDataType=7\nAccessType=rw\nPDOMapping=0\nDefaultValue=0\n\n"
    with built(bench_of(tmp_path, drive_eds(without=(0x6007,), more=more))) as bench:
        assert [event.kind for event in bench.trace().events if event.kind == "drive.fault"]
        assert moved(bench) == pytest.approx(1.0, abs=0.003)
        assert all(check.verdict is Verdict.PASSED for check in run_checkers(bench.trace()))


def test_a_drive_that_cannot_be_used_is_named(tmp_path):
    """A bench that does not come up says which drive sends nothing."""
    silent = (
        'name = "silent"\nsummary = "s"\n[quirks]\nsilent_until_ready = true\n[drive]\nself_test_s = 60.0\n'
    )
    (tmp_path / "silent.toml").write_text(silent)
    with pytest.raises(HilError, match=r"not ready within 5 s: no cyclic data from d$"):
        bench_of(tmp_path, drive_eds(), 'personality = "silent.toml"\n').build()


@pytest.mark.parametrize(
    ("options", "keys"),
    [
        (
            {
                "changed": {0x60A9: "0x00B50300", 0x607F: 400_000, 0x6084: 4_000_000, 0x6085: 4_000_000},
                "read_only": (0x60A9,),
            },
            "",
        ),
        ({"changed": {0x607F: 5000}, "limits": {0x60FF: (-5000, 5000)}}, ""),
        ({"encoder": (3000, 18)}, f"increments_per_revolution = {COUNTS}\n"),
        (
            {"encoder": (3000, 18), "more": feed_constant(1000), "read_only": (0x608F,)},
            f"increments_per_revolution = {COUNTS}\n",
        ),
        ({"encoder": (1, 1)}, f"increments_per_revolution = {COUNTS}\n"),
        (
            {"more": "[6065]\nParameterName=W\nDataType=7\nAccessType=rw\nPDOMapping=0\nDefaultValue=0\n\n"},
            "",
        ),
    ],
    ids=[
        "velocity in increments",
        "limits of 60FFh",
        "no whole increments",
        "no whole increments, own unit",
        "encoder left open",
        "window 0",
    ],
)
def test_units_and_limits_of_vendors(tmp_path, options, keys):
    """What a vendor's file says in its own units, or leaves open, leads to the right motion."""
    with built(bench_of(tmp_path, drive_eds(**options), keys)) as bench:
        assert moved(bench) == pytest.approx(1.0, abs=0.003)
        wrong = [check for check in run_checkers(bench.trace()) if check.verdict is not Verdict.PASSED]
        assert not wrong


def test_texts_of_a_vendor_are_his(tmp_path):
    """6503h and 6504h without a default are empty, and not those of the product."""
    texts = "".join(
        f"[{index:04X}]\nParameterName=Text\nDataType=9\nAccessType=ro\nPDOMapping=0\n{default}\n\n"
        for index, default in ((0x6503, ""), (0x6504, "DefaultValue=Maker"), (0x6505, "DefaultValue="))
    )
    with built(bench_of(tmp_path, drive_eds(more=texts))) as bench:
        values = bench.drive().slave.values
        assert [values[index << 8] for index in (0x6503, 0x6504, 0x6505)] == ["", "Maker", ""]


def test_profile_velocity_accelerates_as_the_axis_wants(tmp_path):
    """In pv a slow acceleration that the drive has by default does not hold the axis back."""
    slow = drive_eds(changed={0x6502: "0x24", 0x6083: 300})
    with built(bench_of(tmp_path, slow)) as bench:
        assert bench.config.drive["d"].plan().mode == MODES["pv"]
        power = bench.axis().power()
        assert bench.run_until(lambda: bool(power.Status), 2.0)
        job = bench.axis().move_velocity(100.0, Acceleration=800.0)
        assert bench.run_until(lambda: job.InVelocity, 1.0)
        bench.run_for(0.05)
        assert bench.axis().var("ActualVelocity") == pytest.approx(100.0, rel=0.05)


# -- own mappings
# -----------------------------------------------------------------------------------------------------


def pdo_keys(**tables):
    return "[drive.d.pdo]\n" + "".join(f"{name} = {list(objects)!r}\n" for name, objects in tables.items())


def test_a_mapping_of_the_user_is_set_up_and_used(tmp_path):
    """PDOs carry what `[drive.NAME.pdo]` says; the others of that direction are off."""
    keys = pdo_keys(
        rpdo2=("6060h", "6040h", "60FFh"), tpdo3=("6064h", "6041h"), tpdo1=("606Ch",), tpdo4=("603Fh",)
    )
    file = bench_of(tmp_path, drive_eds(), keys)
    plan = plan_of(file)
    assert [use.cob_id for use in plan.receive] == [0x305]
    assert plan.receive[0].entries == (0x60600008, 0x60400010, 0x60FF0020)
    assert {use.cob_id: use.entries for use in plan.transmit} == {
        0x185: (0x606C0020,), 0x385: (0x60640020, 0x60410010), 0x485: (0x603F0010,),
    }  # fmt: skip
    assert {(one.number, one.kind) for one in plan.setups if one.transmit and one.entries} == {
        (1, 1), (3, 1), (4, 255),
    }  # fmt: skip
    assert any("6077h" in note for note in plan.notes)
    with built(file) as bench:
        assert moved(bench) == pytest.approx(1.0, abs=0.003)
        frames = bench.trace().frames
    ids = {frame.can_id for frame in frames}
    assert {one for one in ids if one & 0x7F == 5 and 0x180 <= one < 0x580} == {
        0x185, 0x305, 0x385, 0x485,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("tables", "options", "message"),
    [
        ({"rpdo1": ("6040h", "60FFh"), "rpdo5": ("6060h",)}, {}, "rpdo5"),
        ({"rpdo1": ("6040", "60FFh")}, {}, "'6040' is no object"),
        ({"tpdo1": ("6041h", "6041h")}, {}, "6041h stands there twice"),
    ],
)
def test_a_mapping_that_is_not_possible_is_refused_with_the_reason(tmp_path, tables, options, message):
    """What the EDS does not allow is a mistake of the bench file."""
    with pytest.raises(ConfigurationError, match=message):
        _ = bench_of(tmp_path, drive_eds(**options), pdo_keys(**tables)).config


def test_a_mapping_without_an_eds_is_that_of_the_drive_of_the_product(tmp_path):
    """`[drive.NAME.pdo]` goes without an EDS as well."""
    keys = pdo_keys(rpdo1=("6040h", "60FFh", "6060h"), tpdo2=("6041h", "6064h"))
    file = bench_of(tmp_path, drive_eds(), keys)
    text = file.text.replace('eds = "plan.eds"\n', f"increments_per_revolution = {COUNTS}\n")
    with built(type(file)(file.source, text)) as bench:
        assert moved(bench) == pytest.approx(1.0, abs=0.003)


# -- physical drives
# -----------------------------------------------------------------------------------------------------


def physical(keys=""):
    return BenchFile(
        "live.toml",
        '[bench]\nname = "live"\nkind = "live"\n[segment.can0]\ninterface = "virtual"\nchannel = "x"\n'
        f'[drive.d]\nsegment = "can0"\nnode_id = 5\ndevice = "physical"\n{keys}[axis.a]\ndrive = "d"\n',
    )


@pytest.mark.parametrize(("keys", "written"), [("", False), ("commission = true\n", True)])
def test_a_physical_drive_is_written_only_if_the_bench_file_says_so(tmp_path, capsys, keys, written):
    """Without `commission = true` the drive is compared; `hil check` says which of the two happens."""
    (tmp_path / "live.toml").write_text(physical(keys).text)
    assert main(["check", str(tmp_path / "live.toml"), "--json"]) == 0
    (said,) = json.loads(capsys.readouterr().out)["physical"]
    assert ("written at every start" in said) is written
    config = physical(keys).config
    assert config.drive["d"].port_arguments(config.bench)["commission"] is written


# -- torque limit and touch probe
# -----------------------------------------------------------------------------------------------------


def probes(position=0):
    text = ""
    for index, kind in ((0x60B8, 6), (0x60B9, 6), (0x60BA, 4)):
        text += (
            f"[{index:04X}]\nParameterName=Probe {index:04X}\nDataType={kind}\nAccessType=rw\n"
            f"PDOMapping=0\nDefaultValue={position}\n\n"
        )
    return text


@pytest.mark.parametrize("mode", ["csv", "csp", "pv"])
def test_touch_probe_finds_the_zero_mark_in_every_mode_and_unit(tmp_path, mode):
    """Homing by the zero mark uses 60B8h whatever the mode; 60BAh is in units of the drive."""
    more = probes() + feed_constant(1000).replace("AccessType=rw", "AccessType=ro")
    file = bench_of(tmp_path, drive_eds(more=more), f'mode = "{mode}"\nindex_increments = 1000\n')
    text = file.text + '"Sensor[1].ActiveHoming.Mode" = 0\n"Homing.ApproachVelocity" = 20.0\n'
    with built(type(file)(file.source, text)) as bench:
        axis, drive = bench.axis(), bench.drive()
        plan = bench.config.drive["d"].plan()
        assert (plan.mode, plan.increments_per_unit) == (MODES[mode], 4.0)
        power = axis.power()
        assert bench.run_until(lambda: bool(power.Status), 2.0)
        job = axis.home(0.0, mode=3)
        assert bench.run_until(lambda: job.Done or job.Error, 20.0)
        assert job.Done
        at_mark = drive.mechanics.motor_angle / math.tau * 10.0 - axis.var("ActualPosition")
        assert at_mark % 10.0 == pytest.approx(2.5, abs=0.02)


def test_a_drive_without_a_torque_limit_does_not_offer_one(tmp_path):
    """MC_TorqueReduction is refused at once where 6072h is missing, and works where it is."""
    limit = "[6072]\nParameterName=Max\nDataType=6\nAccessType=rw\nPDOMapping=0\nDefaultValue=3000\n\n"
    found = []
    for more in ("", limit):
        with built(bench_of(tmp_path, drive_eds(more=more), 'mode = "csp"\n')) as bench:
            power = bench.axis().power()
            assert bench.run_until(lambda power=power: bool(power.Status), 2.0)
            job = bench.axis().torque_limiting(limit=0.5)
            bench.run_for(0.1)
            found.append((bool(job.Error), bench.drive().slave.values[0x607200]))
    assert found[0][0]
    assert not found[1][0]
    assert found[1][1] == 250
