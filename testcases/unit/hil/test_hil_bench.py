"""The bench as a whole: names, what a physical drive offers, buses that are not there."""

from __future__ import annotations

import pytest

from fieldbus.clock import MS, S
from hil.bench import BenchFile, BenchFileError, load_bench
from hil.bench.bench_file import parse, read
from hil.errors import BlockedError, ConfigurationError, UnsupportedFaultError
from hil.faults import after, at, position, velocity
from motion.s7.instructions import MC_SaveAbsoluteEncoderData
from testcases.catalogue import each

LIVE = """
[bench]
name = "own"
kind = "live"

[segment.can0]
interface = "{interface}"
channel = "{channel}"

[drive.drive1]
segment = "can0"
node_id = 5
device = "physical"

[axis.axis1]
drive = "drive1"
"""

VIRTUAL = """
[bench]
name = "own"

[segment.can0]

[drive.{drive}]
segment = "can0"
node_id = 5

[axis.{axis}]
drive = {drive}
"""


@pytest.mark.parametrize(
    ("drive", "axis", "part"),
    [('"x"', '"x"', "axis.x"), ('"a.b"', '"x"', "a.b"), ('"x"', '"a.b"', "a.b"), ('" "', '"x"', "not empty")],
)
def test_names_that_signals_cannot_carry(drive, axis, part):
    """A name with a dot, an empty one, or one for two parts is refused with its key when the file is read."""
    with pytest.raises(BenchFileError, match=part.replace(".", r"\.")):
        BenchFile("own.toml", VIRTUAL.format(drive=drive, axis=axis))


def test_bus_that_is_not_there_blocks():
    """The interface of a live bench that cannot be opened is a reason to block, not an error of the case."""
    bench = BenchFile("own.toml", LIVE.format(interface="socketcan", channel="nocan7"))
    with pytest.raises(BlockedError, match="nocan7"):
        bench.build()


def test_released_drive_switches_off():
    """What a live bench sends last disables the drive within two cycles."""
    with load_bench("reference").build() as bench:
        power = bench.axis().power()
        assert bench.scheduler.run_until(power.status, 2 * S)
        bench.release_drives()
        bench.scheduler.run_for(5 * MS)
        assert bench.trace()["drive1.state"].text_at(bench.scheduler.now / S) == "Switch on disabled"


def test_physical_drive_has_no_fault_interface():
    """Asking for the drive of a bench on which it is physical ends a case as blocked."""
    text = LIVE.format(interface="virtual", channel="physical drive")
    with BenchFile("own.toml", text[: text.index("[axis")]).build() as bench:
        for name in (None, "drive1"):
            with pytest.raises(UnsupportedFaultError, match="physical"):
                bench.drive(name)


def check_trigger_argument_that_is_no_usable_number(value, make):
    with pytest.raises(ConfigurationError, match=make.__name__):
        make(value)


def test_trigger_argument_that_is_no_usable_number(subtests):
    """A trigger says at once which argument is wrong and what is allowed."""
    for label, values in each(
        [None, "", "5", [], float("inf"), float("nan"), 10**400], [at, after, position, velocity]
    ):
        with subtests.test(label):
            check_trigger_argument_that_is_no_usable_number(*values)


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("lines", "allowed"), [("time_s = 0.15", 0.15), ("time_s = 0.15\nlateness_s = 0.016", 0.016), ("", 0.0)]
)
def test_lateness_that_is_allowed(lines, allowed):
    """How late a machine may be before a failure says nothing about what was tested; by default the tolerance
    of times.
    """
    text = VIRTUAL.format(drive='"d"', axis='"a"') + f"\n[tolerance]\n{lines}\n"
    with BenchFile("own.toml", text).build() as bench:
        assert bench.allowed_lateness_s == allowed
        assert bench.lateness_s == 0.0


@pytest.mark.requirement("VAR-015")
@pytest.mark.parametrize("value", ['"20.0"', '"yes"', "[1.0]", "2026-01-01"])
def test_a_start_value_is_no_text(value):
    """Quotes around a number or a truth value make no start value of it: the file is refused in one line."""
    line = '"PositionControl.Kv" = 20.0'
    text = load_bench("reference").text
    assert line in text
    with pytest.raises(BenchFileError) as caught:
        parse(text.replace(line, f'"PositionControl.Kv" = {value}'), "bench.toml")
    message = str(caught.value)
    assert message.startswith('bench.toml: axis.axis1.variables."PositionControl.Kv": ')
    assert "is not allowed; allowed: a number, true or false" in message
    assert "\n" not in message


@pytest.mark.parametrize(
    ("before", "after", "allowed"),
    [
        ("cycle_ms = 4", 'cycle_ms = "4"', "a number"),
        ("node_id = 5", "node_id = true", "a number"),
        ("node_id = 5", 'node_id = 5\ncsv_interpolation = "yes"', "true or false"),
        ("node_id = 5", "node_id = 5\ncsv_interpolation = 1", "true or false"),
        ('name = "reference axis"', "name = 5", "a text"),
    ],
)
def test_a_value_of_another_type(before, after, allowed):
    """A number in quotes, a truth value for a number, a word for a truth value: refused, and not taken for
    what they look like.
    """
    text = load_bench("reference").text
    assert before in text
    with pytest.raises(BenchFileError) as caught:
        parse(text.replace(before, after, 1), "bench.toml")
    assert f"is not allowed; allowed: {allowed}" in str(caught.value)


@pytest.mark.requirement("HOM-158", "HOM-160", "MC-472")
def test_memory_card_of_the_bench_file(tmp_path):
    """What one bench saves, the next one restores: the axis is homed where it was, and the log tells."""
    text = read("reference")[1].replace("cycle_ms = 4", 'cycle_ms = 4\nmemory_card = "card"')
    text = text.replace("[drive.drive1]", '[drive.drive1]\nencoder = "absolute"')
    text = text.replace("[axis.axis1.variables]", '[axis.axis1.variables]\n"Sensor[1].Type" = 1')
    file = tmp_path / "bench.toml"
    file.write_text(text)
    with load_bench(file).build(seed=1) as bench:
        axis = bench.axis()
        assert bench.run_until(axis.power().status, 2.0)
        assert bench.run_until(axis.home(77.0, mode=7).done, 2.0)
        save = MC_SaveAbsoluteEncoderData(bench.runtime, Execute=True)
        bench.runtime.call(save)
        assert bench.run_until(save.done, 1.0)
    assert (tmp_path / "card" / "UserFiles" / "AbsEncoderData.dat").exists()
    with load_bench(file).build(seed=1) as bench:
        assert bench.axis().var("StatusWord.X5")
        assert bench.axis().var("ActualPosition") == pytest.approx(77.0, abs=0.05)
        assert list(bench.history.select(kind="controller.encoder_data_restored"))
