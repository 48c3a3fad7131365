"""Logs as recorders of machines write them: frames of other kinds, headers, gaps, silence, another bench.
What they do not tell is blocked.
"""

import math
import re

import can
import pytest

from fieldbus.can.export import write_log
from hil.bench import load_bench
from hil.errors import CannotRunError
from hil.expect import (
    disabled,
    event,
    happens,
    never_happens,
    no_motion_after,
    run_checkers,
    standstill,
    state_at,
    stays_within,
    value_at,
)
from hil.logs import read_bus_log, trace_of_log
from hil.record import Trace
from reports.model import Verdict

TRIP = event("drive.fault", "drive1")
EPOCH_S = 946_684_800
WORDS = {
    "trip": happens(TRIP),
    "rest": standstill(by=TRIP.plus(0.5)),
    "place": no_motion_after(TRIP.plus(0.5)),
    "fault": state_at("drive1", TRIP.plus(0.5), "Fault"),
    "heartbeat": never_happens(event("heartbeat.lost")),
    "moving": value_at("axis1.actual_velocity", TRIP.plus(-0.05), 200.0, tolerance=1.0),
    "off": disabled(by=TRIP.plus(0.5), axis=""),
}


@pytest.fixture(scope="module")
def frames():
    """The drive of the reference bench trips in motion at 0.54 s."""
    with load_bench("reference").build() as bench:
        power = bench.axis().power()
        assert bench.run_until(power.status, 2.0)
        bench.axis().move_velocity(200.0)
        bench.run_for(0.5)
        bench.drive().raise_fault(0x2310)
        bench.run_for(1.0)
        return bench.trace().raw_frames("can0")


@pytest.fixture(scope="module")
def lines(frames, tmp_path_factory):
    return write_log(frames, tmp_path_factory.mktemp("odd") / "bus.log").read_text().splitlines()


def decode(path, bench="reference"):
    return trace_of_log(read_bus_log(path), load_bench(bench))


def written(tmp_path, lines, name="machine.log"):
    path = tmp_path / name
    path.write_text("\n".join(lines) + "\n")
    return path


def verdicts(trace):
    return {name: word.evaluate(trace)[0].verdict.value for name, word in WORDS.items()}


def blocked(*names):
    return {name: "blocked" if name in names else "passed" for name in WORDS}


def time_of(line):
    return float(line[1 : line.index(")")]) - EPOCH_S


@pytest.mark.exhaustive
def test_frames_of_other_kinds_are_left_aside(lines, tmp_path):
    """FD, remote, extended and error frames, raw DLCs, a node of somebody else, the name of a vcan, marks of
    direction.
    """
    mixed = []
    others = (
        "123##311223344",
        "705#R1",
        "20000080#0000000000000000",
        "00000085#2310110000000000",
        "00000705#00",
        "186#3702000000000000",
        "123#1122334455667788_E",
    )
    for number, line in enumerate(lines):
        stamp, _, frame = line.split()
        mixed.append(f"{stamp} vcan3 {frame} R")
        if number % 20 == 3:
            mixed.append(f"{stamp} vcan3 {others[number // 20 % len(others)]} T")
    log = decode(written(tmp_path, mixed))
    assert verdicts(log.trace) == blocked()
    assert re.match(r"\d+ CAN FD frames are shown, not judged", log.notes[0])
    assert "not in the bench file: node 6" in log.notes[1]
    assert {entry.source for entry in log.trace.select(kind="can.bus_error")} == {"can0"}
    assert not list(log.trace.select(kind="log."))
    raw = {(frame.fd, frame.dlc) for _, _, frame, _ in log.trace.raw_frames("can0") if frame.can_id == 0x123}
    assert raw == {(False, 14), (True, 4)}


@pytest.mark.exhaustive
def test_a_log_may_begin_in_the_middle_of_motion(lines, tmp_path):
    """What was before its first frame is not known, what came later is judged."""
    late = [line for line in lines if time_of(line) > 0.51]
    log = decode(written(tmp_path, late)).trace
    assert verdicts(log) == blocked("moving")
    assert (
        value_at("axis1.actual_velocity", 0.53, 200.0, tolerance=1.0).evaluate(log)[0].verdict
        is Verdict.PASSED
    )


def test_a_frame_lost_here_and_there_changes_nothing(lines, tmp_path):
    """Values hold over a frame that the recorder has lost."""
    assert (
        verdicts(decode(written(tmp_path, [line for n, line in enumerate(lines) if n % 7])).trace)
        == blocked()
    )


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("begin_s", "end_s", "pattern", "unknown", "reason"),
    [
        (1.2, 1.3, ".", ("rest", "place", "heartbeat", "off"), "process data 185h stayed away"),
        (0.3, 0.45, ".", ("heartbeat",), "nothing was recorded"),
        (1.2, 9.0, " (185|285|085|585)#", ("rest", "place", "off"), "process data 185h stayed away"),
        (1.2, 1.4, " 185#", ("rest", "place", "off"), "process data 185h stayed away"),
    ],
)
def test_a_gap_is_no_rest(lines, tmp_path, begin_s, end_s, pattern, unknown, reason):
    """Where nothing came nothing is known: neither that the axis stood nor that a heartbeat was lost."""
    gap = [line for line in lines if not (begin_s < time_of(line) < end_s and re.search(pattern, line))]
    log = decode(written(tmp_path, gap)).trace
    assert verdicts(log) == blocked(*unknown)
    check = WORDS[unknown[0]].evaluate(log)[0]
    assert reason in check.observed
    assert begin_s - 0.01 < check.time_s < begin_s + 0.01 or check.time_s > begin_s
    velocity = log["axis1.actual_velocity"]
    assert not ((velocity.time_s > begin_s + 0.005) & (velocity.time_s < min(end_s, 1.5) - 0.005)).any()


def test_a_node_that_falls_silent_is_not_known(lines, tmp_path):
    """Its heartbeat is lost, and what was last heard of it is not what it does now."""
    silent = [
        line for line in lines if time_of(line) < 1.1 or not re.search(r" (185|285|705|585|085)#", line)
    ]
    found = verdicts(decode(written(tmp_path, silent)).trace)
    assert found == {**blocked("rest", "place", "off"), "heartbeat": "failed"}


def test_a_clock_that_jumps_back_names_both_frames(lines, tmp_path):
    """The log is not judged; the message says which frames, when, and what can be done."""
    back = [*lines[:900], *(line.replace("(9466848", "(9466847") for line in lines[900:])]
    with pytest.raises(
        CannotRunError, match=r"frame 901 of the file, on can0, is at -99\..* frame 900 .*logs of their own"
    ):
        read_bus_log(written(tmp_path, back))


@pytest.mark.parametrize("bench", ["profidrive", "stepper"])
def test_the_bench_file_of_another_machine_proves_nothing(lines, tmp_path, bench):
    """Process data that the bench file does not map are no absence of faults: blocked, with the reason, and a
    note or a word why.
    """
    log = decode(written(tmp_path, lines), bench)
    for expectation in (
        happens(TRIP),
        never_happens(event("drive.fault")),
        state_at("drive1", 1.0, "S4 operation"),
        disabled(by=1.0, axis=""),
    ):
        (check,) = expectation.evaluate(log.trace)
        assert check.verdict is Verdict.BLOCKED, check
    assert any("sends no process data that the bench file maps" in note for note in log.notes) is (
        bench == "profidrive"
    )


@pytest.mark.exhaustive
def test_process_data_of_another_length_are_not_judged(lines, tmp_path):
    """Shorter or longer process data than the mapping known are blocked while they come, never decoded by
    it; the note says which mapping that is.
    """
    unmapped = [line for line in lines if " 605#" not in line and " 585#" not in line]
    for change, length in ((r" 185#\1", 2), (r" 185#\g<1>0011223344", 7)):
        short = [re.sub(r" 185#(....).*", change, line) for line in unmapped]
        log = decode(written(tmp_path, short))
        note = f"drive1: process data 185h are not judged where they have {length} bytes"
        assert note in " ".join(log.notes)
        assert "8 by the mapping of the bench file" in " ".join(log.notes)
        assert set(verdicts(log.trace).values()) <= {"passed", "blocked"}
        assert {"rest", "place", "off"} <= {k for k, v in verdicts(log.trace).items() if v == "blocked"}
        assert not list(log.trace.select(kind="drive.state"))


def test_another_mapping_for_a_time(lines, tmp_path):
    """What is decoded before and after a time of misfits is judged; a mapping that is written in the log is
    known, and the note says so.
    """
    short = [
        re.sub(r" 185#(....).*", r" 185#\1", line) if 1.2 < time_of(line) < 1.3 else line for line in lines
    ]
    log = decode(written(tmp_path, short))
    assert "8 by the mapping that the log shows being written" in " ".join(log.notes)
    assert verdicts(log.trace) == blocked("rest", "place", "off")
    check = WORDS["rest"].evaluate(log.trace)[0]
    assert "its process data 185h have 2 bytes, 8 by the mapping known" in check.observed
    (silence,) = log.trace.silences("drive1")
    assert silence[:2] == pytest.approx((1.2, 1.3), abs=0.01)


@pytest.mark.exhaustive
def test_the_zero_of_a_position_is_not_on_the_bus(lines, tmp_path):
    """Homing is the affair of the controller: a position cannot be compared with a number, a displacement
    can.
    """
    log = decode(written(tmp_path, lines)).trace
    for expectation in (
        value_at("axis1.actual_position", 0.5, 80.0, tolerance=1e9),
        stays_within("axis1.actual_position", low=-1e9),
    ):
        (check,) = expectation.evaluate(log)
        assert check.verdict is Verdict.BLOCKED
        assert "where the zero of axis1.actual_position is" in check.observed
    log.save(tmp_path / "trace")
    again = Trace.load(tmp_path / "trace")
    assert again.digest() == log.digest(), "packed frames have the digest of the same frames one by one"
    assert verdicts(again) == verdicts(log) == blocked()
    assert (
        value_at("axis1.actual_position", 0.5, 80.0, tolerance=1e9).evaluate(again)[0].verdict
        is Verdict.BLOCKED
    )


def test_a_state_between_two_syncs_is_not_denied(lines, tmp_path):
    """A trip in motion shows *Fault* with the next SYNC: *Fault reaction active* before it may have been,
    other states were not.
    """
    log = decode(written(tmp_path, [line for line in lines if not re.search(r" 185#.F", line)])).trace
    hidden = event("drive.state", "drive1", to="Fault reaction active")
    for expectation in (happens(hidden), never_happens(hidden)):
        assert expectation.evaluate(log)[0].verdict is Verdict.BLOCKED
    quick = never_happens(event("drive.state", "drive1", to="Quick stop active"), until=0.5)
    assert quick.evaluate(log)[0].verdict is Verdict.PASSED


def test_the_rules_pass_on_a_good_log(lines, tmp_path):
    """Nothing that the log does not hold makes a rule fail."""
    assert {check.verdict for check in run_checkers(decode(written(tmp_path, lines)).trace)} == {
        Verdict.PASSED
    }


# -- other formats
# ----------------------------------------------------------------------------------------------------

BEGIN = "Begin Triggerblock Thu Sep 27 10:16:32.000 am 2022"
HEADERS = {
    "absolute": [
        "date Thu Sep 27 10:16:32.000 am 2022",
        "base hex  timestamps absolute",
        "internal events logged",
        "// version 9.0.0",
        BEGIN,
        "   0.000000 Start of measurement",
    ],
    "without events": ["date Mi Mär 3 10:16:32 2022", "base hex  timestamps absolute"],
    "relative": [
        "date Thu Sep 27 10:16:32.000 am 2022",
        "base hex  timestamps relative",
        "no internal events logged",
        BEGIN,
    ],
    "decimal": [
        "date Thu Sep 27 22:16:32 2022",
        "base dec  timestamps absolute",
        "no internal events logged",
    ],
    "none": [],
}


def asc(frames, header, *, relative=False, decimal=False):
    """Return an ASC file as Vector tools write it, with statistics and error frames between the others."""
    rows, last_ns = list(header), 0

    def stamp(time_ns):
        nonlocal last_ns
        shown_ns, last_ns = (time_ns - last_ns if relative else time_ns), time_ns
        return f"   {shown_ns // 1_000_000_000}.{shown_ns % 1_000_000_000:09d}"

    for number, (time_ns, _, frame, _) in enumerate(frames):
        if number % 40 == 5:
            rows.append(f"{stamp(time_ns)} 1  Statistic: D 0 R 0 XD 0 XR 0 E 0 O 0 B 0.00%")
        if number % 200 == 6:
            rows.append(
                f"{stamp(time_ns)} 1  ErrorFrame Flags = 0x2 CodeExt = 0x20a2 Code = 0x82 ID = 0 DLC = 0 "
                f"Position = 5"
            )
        shown = [str(byte) if decimal else f"{byte:02X}" for byte in frame.data]
        kind = "r" if frame.remote else f"d {len(frame.data)} {' '.join(shown)}"
        identifier = str(frame.can_id) if decimal else f"{frame.can_id:X}"
        rows.append(
            f"{stamp(time_ns)} 1  {identifier:15} Rx   {kind}  Length = 240000 BitCount = 124 ID = "
            f"{frame.can_id}"
        )
    return ("\r\n".join(rows) + "\r\n").encode("cp1252")


@pytest.mark.exhaustive
@pytest.mark.parametrize("header", HEADERS)
def test_asc_files_of_all_kinds(frames, tmp_path, header):
    """Times since the last event, decimal numbers, a header with little or none of it, code pages: the same
    frames at the same times.
    """
    path = tmp_path / "machine.asc"
    path.write_bytes(asc(frames, HEADERS[header], relative=header == "relative", decimal=header == "decimal"))
    log = decode(path)
    assert verdicts(log.trace) == blocked()
    mine = [(time_ns, frame) for time_ns, _, frame, error in log.trace.raw_frames("can0") if not error]
    assert [frame for _, frame in mine] == [frame for _, _, frame, _ in frames]
    assert all(abs(time_ns - own[0]) <= 1 for (time_ns, _), own in zip(mine, frames, strict=True))


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    "writer",
    [can.BLFWriter, can.ASCWriter, can.TRCWriter, can.CanutilsLogWriter],
    ids=lambda one: one.__name__,
)
def test_what_the_writers_of_python_can_make(frames, tmp_path, writer):
    """Logs with times of today count from their first frame."""
    suffix = {can.BLFWriter: "blf", can.ASCWriter: "asc", can.TRCWriter: "trc", can.CanutilsLogWriter: "log"}[
        writer
    ]
    path = tmp_path / f"machine.{suffix}"
    with writer(path) as stream:
        for time_ns, _, frame, _ in frames:
            stream(
                can.Message(
                    timestamp=1_790_000_000.0 + time_ns * 1e-9,
                    arbitration_id=frame.can_id,
                    data=frame.data,
                    is_extended_id=False,
                    is_remote_frame=frame.remote,
                    dlc=frame.dlc,
                    channel=0,
                )
            )
    log = decode(path).trace
    assert verdicts(log) == blocked()
    trip = TRIP.find(log.events)
    assert trip is not None
    assert math.isclose(trip.time_ns * 1e-9, 0.542, abs_tol=0.005)


def test_without_a_status_word_no_state_is_known(lines, tmp_path):
    """A log that lacks the status word, but not the values: what is expected of states and faults is blocked,
    what is expected of values is judged.
    """
    trace = decode(written(tmp_path, [line for line in lines if " 185#" not in line])).trace
    for expectation, verdict in (
        (never_happens(TRIP), Verdict.BLOCKED),
        (happens(event("drive.state", "drive1")), Verdict.BLOCKED),
        (never_happens(event("heartbeat.lost")), Verdict.PASSED),
        (value_at("axis1.speed_output", 0.5, 1200.0, tolerance=30.0), Verdict.PASSED),
    ):
        check = expectation.evaluate(trace)[0]
        assert check.verdict is verdict, check.sentence


@pytest.mark.parametrize("line", ["  can0  185   [2]  37 02", " (1735689600.1)  vcan0  12345678   [0]"])
def test_what_candump_shows_on_the_screen_is_no_log(tmp_path, line):
    """The message says how candump writes a log."""
    with pytest.raises(CannotRunError, match="record with candump -L"):
        read_bus_log(written(tmp_path, [line]))
