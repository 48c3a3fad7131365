"""The recorder: what is sampled arrives complete, in order and bit for bit."""

import math

import pytest

from fieldbus.clock import MS, VirtualScheduler
from fieldbus.errors import ConfigurationError
from fieldbus.history import History
from hil.errors import RecordingError
from hil.record import Recorder
from hil.record._recorder import ROWS_PER_CHUNK


@pytest.fixture
def scheduler():
    return VirtualScheduler()


@pytest.fixture
def recorder(scheduler):
    return Recorder(History(scheduler), scheduler)


def test_rows_survive_the_change_of_buffers(scheduler, recorder):
    """Every row is kept with its time, also over the boundary of a buffer."""
    count = ROWS_PER_CHUNK + 3
    group = recorder.add_group("axis1", [("a", "mm"), ("b", "")], lambda: (scheduler.now * 1e-6, -0.5))
    scheduler.every(MS, group.sample)
    scheduler.run_for((count - 1) * MS)

    signal = recorder.trace()["axis1.a"]
    assert len(signal) == count == group.rows
    assert signal.values.tolist() == [float(i) for i in range(count)]
    assert signal.time_s[-1] == pytest.approx((count - 1) * 1e-3, abs=1e-12)
    assert signal.unit == "mm"
    assert set(recorder.trace()["axis1.b"].values.tolist()) == {-0.5}


def test_reader_gives_the_newest_value_at_any_moment(recorder):
    """The reader shows the last sample, before the first one nothing, and right after a change of buffers the
    last still.
    """
    value = 0.0
    group = recorder.add_group("g", [("x", ""), ("y", "")], lambda: (1.0, value))
    read = recorder.reader("g.y")
    assert read() is None

    for number in range(ROWS_PER_CHUNK):
        value = float(number)
        group.sample()
    assert read() == ROWS_PER_CHUNK - 1
    value = -1.0
    recorder.sample("g")
    assert read() == -1.0


def test_integers_and_truth_values_become_numbers(recorder):
    """A row may hold what a device has at hand: integers and truth values are stored as their number."""
    group = recorder.add_group("g", [("word", ""), ("flag", "")], lambda: (0xFFFFFFFF, True))
    group.sample()

    assert recorder.trace()["g.word"].values[0] == 0xFFFFFFFF
    assert recorder.trace()["g.flag"].values[0] == 1.0


@pytest.mark.parametrize("row", [(1.0,), (1.0, 2.0, 3.0), (1.0, "x")])
def test_a_wrong_row_is_refused_by_name(recorder, row):
    """A row function that returns something else than one number per column is an error that names the
    group.
    """
    group = recorder.add_group("drive1", [("a", ""), ("b", "")], lambda: row)
    with pytest.raises(RecordingError, match=r"'drive1'.*2 numbers"):
        group.sample()


@pytest.mark.parametrize(
    ("name", "columns", "enums"),
    [
        ("a.b", [("x", "")], {}),
        ("", [("x", "")], {}),
        ("g", [], {}),
        ("g", [("x", ""), ("x", "")], {}),
        ("g", [("x", "")], {"y": {0: "zero"}}),
    ],
)
def test_bad_groups_are_refused(recorder, name, columns, enums):
    """Names without dots, columns once each, enums of existing columns: everything else is refused."""
    with pytest.raises(ConfigurationError):
        recorder.add_group(name, columns, lambda: (0.0,), enums=enums)


def test_a_group_name_is_taken_once(recorder):
    """Two groups of one name would mix their signals."""
    recorder.add_group("g", [("x", "")], lambda: (0.0,))
    with pytest.raises(ConfigurationError, match="new name"):
        recorder.add_group("g", [("x", "")], lambda: (0.0,))


def test_a_trace_is_a_snapshot(recorder):
    """What is recorded later does not change a trace, and nobody can write into it."""
    value = 1.0
    group = recorder.add_group("g", [("x", "")], lambda: (value,))
    group.sample()
    before = recorder.trace()
    group.sample()
    recorder.history.emit("bench", "bench.note")

    assert len(before["g.x"]) == 1
    assert before.events == ()
    with pytest.raises(ValueError, match="read-only"):
        before["g.x"].values[0] = 2.0


def test_not_a_number_has_one_bit_pattern(scheduler):
    """A not-a-number enters the digest in one form, whatever its sign and payload."""
    digests = []
    for value in (math.nan, -math.nan):
        recorder = Recorder(History(scheduler), scheduler)
        recorder.add_group("g", [("x", "")], lambda value=value: (value,)).sample()
        digests.append(recorder.trace().digest())
    assert digests[0] == digests[1]
