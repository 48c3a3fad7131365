"""A recording that goes to disk is the same as one in memory, takes flat memory, and leaves no files."""

from __future__ import annotations

import gc
import pickle
import resource
import tempfile
from pathlib import Path

import pytest

from fieldbus.can.frame import CanFrame
from fieldbus.clock import MS, VirtualScheduler
from fieldbus.growing_log import GrowingLog
from fieldbus.history import History
from hil import Injector, load_bench
from hil.bench.bench import Bench
from hil.errors import RecordingError
from hil.expect import run_checkers
from hil.expect.rules import judge
from hil.record import CarriedRecording, Carrier, Recorder, Trace, first_difference
from hil.record._recorder import ROWS_PER_CHUNK
from reports.model import Verdict


def _two_segments():
    config = load_bench("fast").config
    [segment], [drive], [axis] = (list(one.values()) for one in (config.segment, config.drive, config.axis))
    return config.model_copy(
        update={
            "segment": {"can0": segment, "can1": segment},
            "drive": {
                "a": drive.model_copy(update={"segment": "can1"}),
                "b": drive.model_copy(update={"segment": "can0"}),
            },
            "axis": {
                "x": axis.model_copy(update={"drive": "a"}),
                "y": axis.model_copy(update={"drive": "b"}),
            },
        }
    )


def _two_on_modbus():
    config = load_bench("profidrive_tcp").config
    [name], [drive], [axis] = (
        list(one) for one in (config.drive, config.drive.values(), config.axis.values())
    )
    return config.model_copy(
        update={
            "bench": config.bench.model_copy(update={"cycle_ms": 2}),
            "drive": {name: drive, "second": drive},
            "axis": {
                "x": axis.model_copy(update={"drive": name}),
                "y": axis.model_copy(update={"drive": "second"}),
            },
        }
    )


BENCHES = {"one": lambda: load_bench("fast").config, "two segments": _two_segments, "Modbus": _two_on_modbus}


def run(config, *, store_ms=0, seconds=1.5):
    """Return the trace of a bench with a fault, whose recording goes to disk every `store_ms`."""
    bench = Bench(config, seed=3)
    with bench:
        if store_ms:
            bench.scheduler.every(store_ms * MS, lambda: bench.recorder.store(frames_kept=7, events_kept=2))
        axes = [bench.axis(name) for name in bench.axis_names]
        for axis in axes:
            axis.power()
        bench.run_for(0.4)
        on_can = bool(bench.network_names)
        kind, target = (
            ("can.no_ack", bench.segment_names[0]) if on_can else ("drive.power_off", bench.drive_names[0])
        )
        Injector(bench).inject(kind, target=target, duration_s=0.01 if on_can else None)
        bench.run_for(seconds - 0.4)
        return bench.trace()


def test_trace_is_the_same_on_disk(subtests, tmp_path):
    """Signals, events, frames of several buses and the digest do not depend on where the recording is."""
    for name, config in BENCHES.items():
        with subtests.test(name):
            held, stored = run(config()), run(config(), store_ms=100)
            assert isinstance(stored.events, GrowingLog)
            assert stored.events.stored
            for bus in stored.buses:
                assert isinstance(stored.raw_frames(bus), GrowingLog)
            assert stored.digest() == held.digest()
            assert first_difference(held, stored) is None
            assert tuple(stored.events) == held.events
            assert list(stored.iter_frames()) == list(held.frames)
            part, whole = (one.window(0.35, 0.9).digest() for one in (stored, held))
            assert part == whole
            assert Trace.load(stored.save(tmp_path / name)[0]).digest() == held.digest()


def test_trace_is_the_same_after_a_journey(subtests):
    """A recording that was packed in two parts and pickled has signals, events, frames, digest and checks of
    the trace that the bench itself gives: with frames in error, remote frames, 29 bits and CAN FD, too, and
    with a group and a number that came later.
    """
    for name, config in BENCHES.items():
        with subtests.test(name), Bench(config(), seed=3) as bench:
            carrier = Carrier(bench.recorder, bench.vocabulary)
            axes = [bench.axis(one) for one in bench.axis_names]
            powers = [axis.power() for axis in axes]
            bench.run_for(0.2)
            carrier.pack()
            assert all(power.Status for power in powers)
            late = bench.recorder.add_group("late", [("value", "mm")], lambda: (1.5,))
            bench.recorder.set_constant("late.number", 2.0)
            late.sample()
            if bench.network_names:
                segment = bench.segment(bench.segment_names[0])
                port = segment.attach("visitor", lambda frame, time_ns: None)
                for frame in (
                    CanFrame(0x1234567, b"ab", extended=True),
                    CanFrame(0x701, remote=True, dlc=8),
                    CanFrame(0x7A1),
                ):
                    port.send(frame)
                bench.run_for(0.01)
                Injector(bench).inject("can.no_ack", target=bench.segment_names[0], duration_s=0.01)
            jobs = [axis.move_relative(1.0) for axis in axes]
            bench.run_for(0.5)
            assert all(job.Done or job.Error for job in jobs)
            recording: CarriedRecording = pickle.loads(pickle.dumps(carrier.recording(bench.scheduler.now)))
            ours, theirs = bench.trace(), carrier.trace(recording)
            assert theirs.digest() == ours.digest()
            assert first_difference(ours, theirs) is None
            assert list(theirs.iter_frames()) == list(ours.frames)
            assert run_checkers(theirs) == run_checkers(ours)
            assert theirs.constants == ours.constants
            if bench.network_names:
                seen = {(frame.extended, frame.remote, bool(frame.error)) for frame in theirs.frames}
                assert seen >= {(True, False, False), (False, True, False), (False, False, True)}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Return the folder of temporary files."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path


def open_files(folder):
    """Return how many files of a folder this process has open, those without a name included."""
    links = list(Path("/proc/self/fd").iterdir())
    return sum(one.is_symlink() and one.readlink().is_relative_to(folder) for one in links)


class Rig:
    """A recorder with one group of two columns, a bus and events; the memory is full after 1 MB."""

    def __init__(self):
        self.scheduler = VirtualScheduler()
        self.history = History(self.scheduler)
        self.recorder = Recorder(self.history, self.scheduler, memory_mb=1)
        self.number = 0
        self.group = self.recorder.add_group("g", [("n", "mm"), ("half", "")], self._row)
        self.log = []
        self.recorder.add_bus("can0", self.log, drop=lambda count: self.log.__delitem__(slice(count)))
        self.most = 0

    def _row(self):
        return float(self.number), self.number / 2

    def sample(self, count):
        for _ in range(count):
            self.scheduler.run_for(MS)
            self.group.sample()
            self.number += 1
            self.most = max(self.most, self.recorder.memory)


def test_memory_stays_below_its_limit(folder):
    """Beyond the limit everything is on disk but the newest, and is read back as it was."""
    rig = Rig()
    rig.sample(60_000)
    assert 24 * 60_000 > 1_000_000 > rig.most > 900_000
    signal = rig.recorder.trace()["g.half"]
    assert signal.values.tolist() == [number / 2 for number in range(60_000)]
    assert signal.values.flags.c_contiguous  # a column lies in one piece
    assert not signal.values.flags.writeable
    rig.sample(5)
    assert len(signal) == 60_000
    assert rig.recorder.trace()["g.n"].values[-6:].tolist() == [float(n) for n in range(59_999, 60_005)]


def test_newest_rows_and_what_is_kept_are_known_wherever_they_are(folder):
    """Reader, rows from a number on, and forgetting work across disk, full buffers and the present one."""
    rig = Rig()
    read = rig.recorder.reader("g.half")
    rig.sample(ROWS_PER_CHUNK)
    rig.recorder.store()
    assert read() == (ROWS_PER_CHUNK - 1) / 2
    rig.sample(2 * ROWS_PER_CHUNK + 3)
    rows = rig.group.rows
    assert rows == 3 * ROWS_PER_CHUNK + 3
    for first in (0, 1, ROWS_PER_CHUNK - 1, ROWS_PER_CHUNK + 1, 2 * ROWS_PER_CHUNK, rows - 2, rows, rows + 9):
        assert rig.group.content_from(first) == rig.group.content()[24 * first :]
    rig.recorder.store()
    rig.group.forget(ROWS_PER_CHUNK + 10)
    assert rig.group.rows == rows
    assert rig.group.first_row == rows - 3 - 2 * ROWS_PER_CHUNK
    assert rig.recorder.trace()["g.n"].values[0] == rig.group.first_row
    rig.sample(ROWS_PER_CHUNK)
    rig.group.forget()
    assert (
        rig.group.first_row == rig.group.rows - 6 - 0 or rig.group.rows - rig.group.first_row < ROWS_PER_CHUNK
    )
    assert rig.recorder.trace()["g.n"].values[-1] == rig.group.rows - 1
    rig.recorder.forget()
    assert len(rig.recorder.frames("can0")) == len(rig.history.events) == 0


def test_frames_and_events_come_back_as_they_were(folder):
    """Every kind of frame, with sender and error, and details of events keep their values and types."""
    rig = Rig()
    frames = [
        CanFrame(0x123, b"\x01\x02"),
        CanFrame(0x1ABCDEF0, b"", extended=True),
        CanFrame(0x7FF, remote=True, dlc=8),
        CanFrame(0x10, bytes(range(48)), fd=True, brs=True),
        CanFrame(0x11, bytes(12), fd=True, esi=True),
        CanFrame(0x12, bytes(8), dlc=15),
    ]
    entries = [(7 * n, "me" if n % 2 else "you", one, "" if n % 3 else "ACK") for n, one in enumerate(frames)]
    rig.log += entries
    details = {"a": 1, "b": 1.0, "c": True, "d": None, "e": "x"}
    rig.history.emit("part", "a.kind", **details)
    rig.recorder.store(frames_kept=1, events_kept=0)
    rig.log += entries
    rig.history.emit("part", "b.kind")
    assert rig.recorder.frame_count == 12
    assert list(rig.recorder.frames("can0")) == entries + entries
    assert rig.recorder.frames("can0")[4:8] == (entries + entries)[4:8]
    trace = rig.recorder.trace()
    rig.recorder.store(frames_kept=0, events_kept=0)
    rig.history.emit("part", "c.kind")
    assert list(trace.raw_frames("can0")) == entries + entries
    assert [entry.kind for entry in trace.events] == ["a.kind", "b.kind"]
    assert [entry.kind for entry in reversed(rig.history.events)] == ["c.kind", "b.kind", "a.kind"]
    found = trace.events[0].data
    assert found == details
    assert [type(value) for value in found.values()] == [type(value) for value in details.values()]


def test_temporary_files_have_no_name_and_end_with_the_recording(folder):
    """Nothing is left behind, however the process ends; what is open ends with the last view of it."""
    rig = Rig()
    rig.log += [(1, "me", CanFrame(1), "")] * 10
    rig.sample(ROWS_PER_CHUNK)
    rig.recorder.store(frames_kept=0)
    signal = rig.recorder.trace()["g.n"]
    assert open_files(folder)
    assert list(folder.iterdir()) == []
    del rig
    assert signal.values[-1] == ROWS_PER_CHUNK - 1
    del signal
    gc.collect()
    assert open_files(folder) == 0


def test_full_disk_is_said(folder):
    """What cannot be written is an error that names the folder and what to do."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    rig = Rig()
    rig.sample(ROWS_PER_CHUNK)
    rig.recorder.store()
    rig.sample(ROWS_PER_CHUNK)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, before[1]))
    try:
        with pytest.raises(
            RecordingError, match=r"temporary file in .*: File too large; TMPDIR .*_memory_mb"
        ):
            rig.recorder.store()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_rules_judge_a_long_trace_in_pieces(subtests):
    """Rules find the same at the same time whether they look at the whole trace or at pieces of it."""
    with load_bench("fast").build() as bench:
        bench.axis().power()
        bench.run_for(0.3)
        bench.axis().home(0.0)
        bench.run_for(0.8)
        job = bench.axis().move_absolute(20.0)
        bench.wait_until(job.done, 2.0)  # an event behind the last sample
        trace = bench.trace()
    axis = next(group for group in trace.groups if group.name == "axis1")
    number = [name for name, _ in axis.columns].index("actual_position")
    values = axis.values.copy()
    values[1250:, number] += 5.0
    jump = Trace(
        [axis._replace(values=values) if group is axis else group for group in trace.groups],
        events=trace.events,
        frames={bus: trace.raw_frames(bus) for bus in trace.buses},
        constants=trace.constants,
        end_ns=trace.end_ns,
        vocabulary=trace.vocabulary,
    )
    for name, one in (("as it is", trace), ("with a jump", jump)):
        with subtests.test(name):
            whole, parts = (
                {check.name: (check.verdict, check.time_s) for check in judge(one, longest=longest)}
                for longest in (10_000, 600)
            )
            assert parts == whole
            failed = [verdict for verdict, _ in whole.values() if verdict is Verdict.FAILED]
            assert bool(failed) is (one is jump)
