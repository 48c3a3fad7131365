"""The trace: signals, comparison, digest, storage."""

import numpy as np
import pytest

from fieldbus.can.frame import CanFrame
from fieldbus.errors import ConfigurationError
from fieldbus.history import Event
from hil.errors import RecordingError
from hil.record import Signal, Trace, TraceGroup, event, first_difference

MS = 1_000_000


def make_trace(*, values=((1.0, 2.0), (3.0, 4.0), (5.0, 6.0)), step=MS, events=None, frames=None, column="b"):
    times = np.arange(len(values), dtype=np.int64) * step
    group = TraceGroup(
        "axis1",
        (("a", "mm"), (column, "")),
        {column: {2: "TWO", 4: "FOUR"}},
        times,
        np.array(values, dtype=float),
    )
    if events is None:
        events = [
            Event(0, "axis1", "axis.state", {"from": "DISABLED", "to": "ENABLING"}),
            Event(MS, "axis1", "alarm.raised", {"number": 421, "reaction": 4}),
            Event(2 * MS, "axis1", "alarm.raised", {"number": 431, "reaction": 4}),
        ]
    if frames is None:
        frames = {
            "can0": [
                (500, "drive1", CanFrame(0x181, b"\x01\x02"), ""),
                (900, "plc", CanFrame(0x80), "dropped"),
            ]
        }
    return Trace([group], events=events, frames=frames, constants={"axis1.max": 5.0}, end_ns=2 * MS)


def ramp_signal():
    times = np.arange(6) * 0.1
    return Signal("s", "mm/s", times, np.array([10.0, 10.0, 5.0, 0.0, 0.0, 0.0]), {0: "REST", 10: "FULL"})


# -- signals
# ---------------------------------------------------------------------------------------------------------


def test_a_signal_holds_its_last_value():
    """`at` is the last sample not later than the time; before all samples it is the first."""
    signal = ramp_signal()
    assert [signal.at(t) for t in (-1.0, 0.0, 0.19, 0.2, 9.0)] == [10.0, 10.0, 10.0, 5.0, 0.0]
    assert signal.text_at(0.0) == "FULL"
    assert signal.text_at(0.2) == "5"


def test_at_is_exact_at_sample_times_in_nanoseconds():
    """Times that are whole nanoseconds as float64 seconds find their own sample, not the one before."""
    times_ns = np.arange(1, 2000, dtype=np.int64) * 4 * MS
    signal = Signal("s", "", times_ns * 1e-9, times_ns.astype(float))
    for time_ns in (4 * MS, 12 * MS, 4000 * MS, 7992 * MS):
        assert signal.at(time_ns * 1e-9) == time_ns
        assert signal.at(time_ns / 1e9) == time_ns


def test_crossings_are_interpolated_and_directed():
    """A crossing lies between its samples; direction tells rising from falling."""
    signal = ramp_signal()
    assert signal.crossings(7.5, "falling") == pytest.approx([0.15])
    assert signal.crossings(7.5, "rising") == []
    assert signal.first_crossing(2.5, after_s=0.1) == pytest.approx(0.25)
    assert signal.first_crossing(2.5, after_s=0.26) is None
    with pytest.raises(ConfigurationError, match="rising, falling, any"):
        signal.crossings(1.0, "up")


def test_settling_counts_from_the_last_excursion():
    """A signal has settled only when it never leaves the limit again."""
    signal = Signal("s", "", np.arange(5) * 1.0, np.array([0.0, 3.0, 0.0, 2.0, 0.0]))
    assert signal.settles(1.0) == 4.0
    assert signal.settles(3.0) == 0.0
    assert signal.settles(-1.0) is None
    assert signal.settles(2.5, after_s=1.5) == 2.0


def test_not_a_number_never_settles():
    """A value that is not a number is no rest."""
    assert Signal("s", "", np.array([0.0, 1.0]), np.array([0.0, np.nan])).settles(1.0) is None


def test_a_missing_signal_names_what_there_is():
    """Asking for a signal that was not recorded lists the signals of that component."""
    with pytest.raises(RecordingError, match=r"axis1\.a, axis1\.b"):
        make_trace()["axis1.c"]
    assert "axis1.c" not in make_trace()
    assert "axis1.a" in make_trace()


def test_components_are_found_by_their_columns():
    """Axes and drives are distinguished by the columns they have."""
    assert make_trace().components_with("a", "b") == ["axis1"]
    assert make_trace().components_with("a", "x") == []


# -- selecting events
# -----------------------------------------------------------------------------------------------


def test_selectors_choose_by_kind_source_details_and_number():
    """The n-th match counts from the start or, negative, from the end; an offset moves the instant."""
    trace = make_trace()
    assert trace.instant(event("alarm.raised")) == pytest.approx(0.001)
    assert trace.instant(event("alarm.raised", nth=-1)) == pytest.approx(0.002)
    assert trace.instant(event("alarm.", "axis1", nth=2).plus(0.5)) == pytest.approx(0.502)
    assert trace.instant(event("axis.state", to="ENABLING")) == 0.0
    assert trace.instant(event("axis.state", to="MOTION")) is None
    assert trace.instant(event("alarm.raised", "axis2")) is None
    assert trace.instant(event("alarm.raised", absent=None)) is None
    assert trace.instant(0.25) == 0.25


@pytest.mark.parametrize(
    "arguments",
    [{"kind": ""}, {"kind": "x", "nth": 0}, {"kind": "x", "nth": True}, {"kind": "x", "nth": 1.5}],
)
def test_impossible_selectors_are_refused(arguments):
    """An empty kind and a place 0 in the order select nothing and are mistakes."""
    with pytest.raises(ConfigurationError):
        event(**arguments)


def test_a_window_keeps_both_ends():
    """What lies at the borders of a window belongs to it."""
    part = make_trace().window(0.001, 0.002)
    assert part["axis1.a"].values.tolist() == [3.0, 5.0]
    assert [entry.time_ns for entry in part.events] == [MS, 2 * MS]
    assert part.frames == ()


# -- digest and comparison
# -----------------------------------------------------------------------------------------


def test_the_digest_is_the_same_everywhere():
    """The digest of a fixed trace is a fixed text: it depends on no machine, version or hash seed."""
    assert make_trace().digest() == make_trace().digest()
    assert make_trace().digest() == "1265f807595d21012654ae6e1b25bff701b3d5a5ef5bad80695fc7cef362fed7"


@pytest.mark.parametrize(
    ("change", "subject"),
    [
        ({"values": ((1.0, 2.0), (3.0, 4.000000000000001), (5.0, 6.0))}, "signal axis1.b"),
        ({"values": ((1.0, 2.0), (3.0, 4.0))}, "number of samples of axis1"),
        ({"values": ((-0.0, 2.0), (3.0, 4.0), (5.0, 6.0))}, "signal axis1.a"),
        ({"step": MS + 1}, "sample time of axis1"),
        ({"column": "c"}, "columns of axis1"),
        ({"events": []}, "event axis.state of axis1"),
        ({"frames": {"can0": [(500, "drive1", CanFrame(0x181, b"\x01\x03"), "")]}}, "frame on can0"),
        ({"frames": {"can0": []}}, "frame on can0"),
    ],
)
def test_every_difference_changes_the_digest_and_is_named(change, subject):
    """One bit in a sample, a time, an event, a frame or a name: the digest differs and the difference is
    found.
    """
    left, right = make_trace(), make_trace(**change)
    assert left.digest() != right.digest()
    difference = first_difference(left, right)
    assert difference is not None
    assert difference.subject == subject
    assert difference.left != difference.right


def test_equal_traces_have_no_difference():
    """Two equal recordings are equal, not-a-number included."""
    nan = ((1.0, np.nan), (3.0, 4.0))
    assert first_difference(make_trace(values=nan), make_trace(values=nan)) is None


def test_the_earliest_difference_is_reported():
    """Of several differences the earliest one is named."""
    right = make_trace(
        values=((1.0, 2.0), (3.0, 4.0), (5.0, 7.0)),
        events=[
            Event(0, "axis1", "axis.state", {"from": "DISABLED", "to": "ENABLING"}),
            Event(MS, "axis1", "alarm.raised", {"number": 422, "reaction": 4}),
        ],
    )
    difference = first_difference(make_trace(), right)
    assert difference.subject == "event alarm.raised of axis1"
    assert difference.time_s == pytest.approx(0.001)
    assert "421" in difference.left
    assert "422" in difference.right


# -- storage
# --------------------------------------------------------------------------------------------------------


def test_a_saved_trace_comes_back_equal(tmp_path):
    """Columns, enums, events, frames and constants survive saving; the digest proves it."""
    trace = make_trace()
    archive, document = trace.save(tmp_path / "deep" / "trace")
    again = Trace.load(archive)

    assert again.digest() == trace.digest()
    assert first_difference(again, trace) is None
    assert again["axis1.b"].text_at(0.0) == "TWO"
    assert again.constants == trace.constants
    assert again.end_ns == trace.end_ns
    assert Trace.load(document).frames == trace.frames


def test_saving_twice_gives_the_same_bytes(tmp_path):
    """The files of equal traces are equal, byte for byte."""
    first = make_trace().save(tmp_path / "one")
    second = make_trace().save(tmp_path / "two")
    assert [path.read_bytes() for path in first] == [path.read_bytes() for path in second]


def test_files_that_do_not_belong_together_are_refused(tmp_path):
    """The columns of another trace are noticed by the digest."""
    make_trace().save(tmp_path / "one")
    other, _ = make_trace(values=((9.0, 9.0),)).save(tmp_path / "two")
    other.replace(tmp_path / "one.npz")
    with pytest.raises(RecordingError, match="do not belong together"):
        Trace.load(tmp_path / "one")


@pytest.mark.parametrize("damage", [b"", b"{", b"[]", b'{"format": 99}'])
def test_damaged_files_are_refused(tmp_path, damage):
    """A missing, cut or foreign file is an error that names it, never a crash."""
    _, document = make_trace().save(tmp_path / "one")
    document.write_bytes(damage)
    with pytest.raises(RecordingError, match="one"):
        Trace.load(tmp_path / "one")
    with pytest.raises(RecordingError, match="nowhere"):
        Trace.load(tmp_path / "nowhere")
