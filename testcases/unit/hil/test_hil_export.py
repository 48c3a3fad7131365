"""Signals and frames go to the formats of other tools, and their own readers give back the same."""

import csv
import json
import re

import can
import numpy as np
import pytest

from fieldbus.can.frame import CanFrame
from fieldbus.errors import ConfigurationError
from hil.cli import main
from hil.errors import RecordingError
from hil.record import Trace, TraceGroup
from hil.record.export import write_signals

MS = 1_000_000


@pytest.fixture(scope="module")
def trace():
    """Two components that were sampled at different times, with numbers that are hard to write, and a bus."""
    times = np.array([0, 4 * MS, 8 * MS + 1], dtype=np.int64)
    values = np.array([[0.1, 1.0], [1 / 3, 2.0], [-1e-17, np.nan]])
    axis = TraceGroup(
        "axis1", (("position", "mm"), ("state", "")), {"state": {1: "STANDSTILL", 2: "MOTION"}}, times, values
    )
    drive = TraceGroup("drive1", (("torque", "Nm"),), {}, times[:2] + MS, np.array([[5.5], [6.25]]))
    frames = {
        "can0": [
            (500_000, "drive1", CanFrame(0x181, b"\x01\x02\x03"), ""),
            (1_000_000, "plc", CanFrame(0x80), ""),
            (2_000_000, "plc", CanFrame(0x18FF0001, bytes(8), extended=True), ""),
        ]
    }
    return Trace([axis, drive], frames=frames, end_ns=9 * MS)


def test_csv_gives_back_every_bit(trace, tmp_path):
    """A row per instant of any component; what was not sampled then is empty, and floats read back are
    equal.
    """
    path = write_signals(trace, tmp_path / "t.csv")
    with path.open(newline="") as stream:
        rows = list(csv.reader(stream))
    assert rows[0] == ["time_s", "axis1.position [mm]", "axis1.state", "drive1.torque [Nm]"]
    assert [row[0] for row in rows[1:]] == [
        "0.000000000",
        "0.001000000",
        "0.004000000",
        "0.005000000",
        "0.008000001",
    ]
    assert [row[1] for row in rows[1:]] == ["0.1", "", repr(1 / 3), "", "-1e-17"]
    assert [float(row[1]) for row in rows[1:] if row[1]] == trace["axis1.position"].values.tolist()
    assert [row[3] for row in rows[1:]] == ["", "5.5", "", "6.25", ""]


def test_npz_is_read_by_numpy_alone(trace, tmp_path):
    """Arrays by signal name with their times, whole nanoseconds among them."""
    with np.load(write_signals(trace, tmp_path / "t.npz", ["axis1.position"]), allow_pickle=False) as archive:
        assert sorted(archive) == ["axis1.position", "axis1.time_ns", "axis1.time_s"]
        assert np.array_equal(archive["axis1.position"], trace["axis1.position"].values)
        assert archive["axis1.time_ns"].tolist() == [0, 4 * MS, 8 * MS + 1]


def test_mdf4_without_its_package_says_what_to_install(trace, tmp_path, monkeypatch):
    """The extra is named where asammdf is missing."""
    monkeypatch.setitem(__import__("sys").modules, "asammdf", None)
    with pytest.raises(Exception, match=re.escape("motion-hil[mdf]")):
        write_signals(trace, tmp_path / "t.mf4")


def test_what_cannot_be_written_is_refused(trace, tmp_path):
    """Another suffix, a signal that is not there."""
    with pytest.raises(ConfigurationError, match=r"\.mf4, \.csv, \.npz"):
        write_signals(trace, tmp_path / "t.xlsx")
    with pytest.raises(RecordingError, match=r"axis1\.position"):
        write_signals(trace, tmp_path / "t.csv", ["axis1.positon"])


@pytest.mark.exhaustive
@pytest.mark.parametrize("suffix", [".log", ".asc", ".blf"])
def test_the_command_writes_frames_for_python_can(trace, tmp_path, capsys, suffix):
    """The reader of python-can gives back identifiers, data, kinds and times of the frames."""
    trace.save(tmp_path / "trace")
    path = tmp_path / f"bus{suffix}"
    assert main(["export", str(tmp_path / "trace.npz"), "--output", str(path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"file": str(path), "frames": 3}
    with can.LogReader(path) as reader:
        messages = list(reader)
    assert [(m.arbitration_id, bytes(m.data), m.is_extended_id) for m in messages] == [
        (frame.can_id, bytes(frame.data), frame.extended) for _, _, frame, _ in trace.raw_frames("can0")
    ]
    begun = messages[0].timestamp
    assert [m.timestamp - begun for m in messages] == pytest.approx([0.0, 0.0005, 0.0015], abs=2e-6)


@pytest.mark.exhaustive
def test_the_command_writes_chosen_signals(trace, tmp_path, capsys):
    """Names may have a wildcard; what fits nothing is refused with what there is."""
    trace.save(tmp_path / "trace")
    source, output = str(tmp_path / "trace.npz"), str(tmp_path / "out" / "s.csv")
    assert main(["export", source, "-o", output, "--signal", "axis1.*", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["signals"] == 2
    for wrong, words in (
        (["-o", output, "--signal", "axis9.*"], "fits no signal"),
        (["-o", str(tmp_path / "s.xlsx")], "allowed are .mf4"),
        (["-o", source], "would be lost"),
        (["-o", str(tmp_path / "b.log"), "--bus", "can7"], "CAN segments can0"),
        (["-o", str(tmp_path / "b.log"), "--signal", "axis1.*"], "frames of a segment"),
        (["-o", output, "--bus", "can0"], "holds signals"),
    ):
        assert main(["export", source, *wrong]) == 2
        assert words in capsys.readouterr().err
    assert main(["export", str(tmp_path / "absent.npz"), "-o", output]) == 2
