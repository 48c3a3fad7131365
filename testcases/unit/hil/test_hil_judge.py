"""Recorded bus logs are judged as the live case is: same signals, same events, same verdicts, and errors that
say what is wrong.
"""

import json
import shutil
import subprocess
from pathlib import Path

import can
import pytest

from fieldbus.can.export import write_log
from fieldbus.can.frame import CanFrame
from hil.bench import load_bench
from hil.cli import main
from hil.errors import CannotRunError
from hil.expect import (
    alarm,
    always,
    event,
    event_order,
    happens,
    never_happens,
    no_alarm,
    no_motion_after,
    run_checkers,
    standstill,
    state_at,
    status_word_bit,
    value_at,
    word_sequence,
)
from hil.faults import Injector
from hil.logs import read_bus_log, trace_of_log
from reports.html.packing import unpacked
from reports.model import Verdict

pytestmark = pytest.mark.exhaustive

TRIP = event("drive.fault", "drive1")


@pytest.fixture(scope="module")
def case():
    """The trace of a case on the reference bench: the drive trips in motion."""
    return run_case("reference", lambda bench: Injector(bench).inject("drive.fault", code=0x2310))


def run_case(name, disturb):
    with load_bench(name).build() as bench:
        axis = bench.axis()
        power = axis.power()
        assert bench.run_until(power.status, 2.0)
        axis.move_velocity(200.0)
        bench.run_for(0.5)
        disturb(bench)
        bench.run_for(1.0)
        return bench.trace()


@pytest.fixture(scope="module")
def log_file(case, tmp_path_factory):
    """Its frames as a candump log, as the evidence of a case has them."""
    return write_log(case.raw_frames("can0"), tmp_path_factory.mktemp("log") / "bus.log")


@pytest.fixture(scope="module")
def recorded(log_file):
    """The same log, decoded."""
    return decode(log_file).trace


def decode(path, bench="reference", **options):
    return trace_of_log(read_bus_log(path), load_bench(bench), **options)


BUS_ONLY = [
    happens(TRIP, within_s=1.0),
    happens(event("drive.fault", code=0x2310)),
    happens(event("emcy.raised", "drive1", code=0x2310)),
    never_happens(event("emcy.raised", code=0x3210)),
    never_happens(event("heartbeat.lost")),
    never_happens(event("drive.state", to="Quick stop active")),
    event_order(
        [
            event("drive.state", "drive1", to="Operation enabled"),
            TRIP,
            event("drive.state", "drive1", to="Fault"),
        ]
    ),
    state_at("drive1", TRIP.plus(-0.1), "Operation enabled"),
    state_at("drive1", TRIP.plus(0.9), "Fault"),
    standstill(by=TRIP.plus(0.5)),
    no_motion_after(TRIP.plus(0.5)),
    value_at("axis1.actual_velocity", TRIP.plus(-0.1), 200.0, tolerance=1.0),
    value_at("drive1.error_code", TRIP.plus(0.1), 0x2310, tolerance=0.0),
    word_sequence("drive1.controlword", [0x0007, 0x000F], until=TRIP, exact=False),
    status_word_bit(3, True, at=TRIP.plus(0.02), axis="drive1", word="statusword"),
]
WRONG = [
    happens(event("drive.fault", code=0x2320)),
    never_happens(event("emcy.raised", code=0x2310)),
    event_order([event("drive.state", "drive1", to="Fault"), TRIP]),
    state_at("drive1", TRIP.plus(0.9), "Operation enabled"),
    standstill(by=TRIP.plus(0.05)),
    no_motion_after(TRIP),
    value_at("axis1.actual_velocity", TRIP.plus(-0.1), 190.0, tolerance=1.0),
    status_word_bit(3, False, at=TRIP.plus(0.02), axis="drive1", word="statusword"),
]


@pytest.mark.parametrize(
    ("expectation", "verdict"),
    [(one, Verdict.PASSED) for one in BUS_ONLY] + [(one, Verdict.FAILED) for one in WRONG],
    ids=lambda value: getattr(value, "title", str(value)),
)
def test_the_log_of_a_case_gets_the_verdict_of_the_case(case, recorded, expectation, verdict):
    """What needs the bus alone is judged the same on the trace and on the frames of it."""
    assert [check.verdict for check in expectation.evaluate(case)] == [verdict]
    assert [check.verdict for check in expectation.evaluate(recorded)] == [verdict]


def test_signals_of_a_log_are_those_of_the_case(case, recorded):
    """Actual values of the axis are the same numbers as those that the controller calculated."""
    log = recorded
    for name in ("actual_position", "actual_velocity", "actual_speed", "actual_torque"):
        for time_s in (0.3, 0.55, 0.6, 1.2):
            mine, own = log[f"axis1.{name}"].at(time_s), case[f"axis1.{name}"].at(time_s)
            assert mine == pytest.approx(own, abs=1e-9), (name, time_s)


def test_what_the_controller_keeps_to_itself_is_blocked(recorded):
    """Alarms and jobs are not on the bus: such a check is blocked with the reason, a misspelt name is an
    error.
    """
    log = recorded
    for expectation in (alarm(421), no_alarm(), value_at("axis1.following_error", 0.5, 0.0, tolerance=1.0)):
        (check,) = expectation.evaluate(log)
        assert check.verdict is Verdict.BLOCKED
        assert "the log bus.log does not hold" in check.observed
    assert never_happens(event("drive.falt")).evaluate(log)[0].verdict is Verdict.ERROR


def test_the_rules_judge_a_log_too(log_file):
    """The transitions of the drive are judged from its status words."""
    names = {check.name: check.verdict for check in run_checkers(decode(log_file).trace)}
    assert names["state transitions of drive1"] is Verdict.PASSED


def test_a_profidrive_telegram_is_read_as_words_and_states(tmp_path):
    """STW1, ZSW1, speeds and the general state machine come from the words of the telegram."""
    trace = run_case("profidrive", lambda bench: bench.axis().power(False, stop_mode=0))
    log = decode(write_log(trace.raw_frames("can0"), tmp_path / "pd.log"), "profidrive").trace
    stop = event("drive.state", "drive1", to="S2 ready for switching on", nth=2)
    for expectation in (
        event_order([event("drive.state", to="S4 operation"), event("drive.state", to="S5 ramp stop"), stop]),
        standstill(by=stop),
        status_word_bit(0, False, at=0.9, axis="axis1", word="stw1"),
    ):
        for recording in (trace, log):
            (check,) = expectation.evaluate(recording)
            assert check.verdict is Verdict.PASSED, check
    for name in ("actual_position", "actual_velocity", "actual_speed"):
        assert log[f"axis1.{name}"].at(0.5) == pytest.approx(trace[f"axis1.{name}"].at(0.5), abs=1e-9)


@pytest.mark.parametrize("name", ["fast", "speed", "stepper"])
def test_logs_of_other_benches_are_read(name, tmp_path):
    """Another cycle, an axis without position, a pulse module with a telegram that says little: what frames
    tell is the same as live.
    """
    with load_bench(name).build() as bench:
        bench.axis().power()
        bench.run_for(0.3)
        trace = bench.trace()
    log = decode(write_log(trace.raw_frames("can0"), tmp_path / "bus.log"), name)
    assert log.notes == []
    shared = [one for one in log.trace.names() if one.startswith("axis1.") and one in trace]
    assert bool(shared) is (name != "stepper")
    for one in shared:
        assert log.trace[one].at(0.29) == pytest.approx(trace[one].at(0.29), abs=1e-3), one


def test_a_live_bench_file_reads_a_log_without_its_bus(log_file):
    """Nothing of a live bench is opened: its nodes and gears are enough."""
    assert TRIP.find(decode(log_file, "live").trace.events) is not None
    with pytest.raises(CannotRunError, match="has no CAN segment"):
        decode(log_file, "profidrive_tcp")


# -- formats
# ----------------------------------------------------------------------------------------------------------


def digest_of(trace):
    return [(entry.kind, entry.source, dict(entry.data)) for entry in trace.events]


@pytest.mark.parametrize("suffix", [".asc", ".blf", ".pcap", ".pcapng"])
def test_formats_say_the_same(case, log_file, tmp_path, suffix):
    """The same frames as ASC and BLF are the same events, at the same times within a microsecond."""
    other = decode(write_log(case.raw_frames("can0"), tmp_path / f"bus{suffix}")).trace
    first = decode(log_file).trace
    assert digest_of(other) == digest_of(first)
    for mine, own in zip(other.events, first.events, strict=True):
        assert abs(mine.time_ns - own.time_ns) <= 1500
    assert standstill(by=TRIP.plus(0.5)).evaluate(other)[0].verdict is Verdict.PASSED


def test_a_log_by_the_writer_of_python_can(case, tmp_path):
    """A BLF file that python-can has written by itself, with times of today, counts from its first frame."""
    path = tmp_path / "machine.blf"
    with can.BLFWriter(path) as writer:
        for time_ns, _, frame, _ in case.raw_frames("can0"):
            writer(
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
    for expectation in BUS_ONLY:
        if not any(isinstance(getattr(expectation, key, None), float) for key in ("since", "at")):
            assert expectation.evaluate(log)[0].verdict is Verdict.PASSED, expectation.title


@pytest.mark.skipif(shutil.which("log2asc") is None, reason="can-utils are not installed")
def test_a_log_by_can_utils(log_file, tmp_path):
    """An ASC file made by log2asc of can-utils is read, and judged the same."""
    path = tmp_path / "peer.asc"
    command = ["log2asc", "-I", str(log_file), "-O", str(path), "can0"]
    subprocess.run(command, check=True, capture_output=True)
    log = decode(path).trace
    assert digest_of(log) == digest_of(decode(log_file).trace)
    assert no_motion_after(TRIP.plus(0.5)).evaluate(log)[0].verdict is Verdict.PASSED


# -- a manipulated frame
# ----------------------------------------------------------------------------------------------


def test_one_manipulated_frame_fails_at_its_place(case, tmp_path):
    """A single status word that shows the fault gone makes the check fail at the time of that frame, not
    elsewhere.
    """
    frames = list(case.raw_frames("can0"))
    trip_ns = next(case.select(kind="drive.fault")).time_ns
    place = next(
        index
        for index, (time_ns, _, frame, _) in enumerate(frames)
        if time_ns > trip_ns + 600_000_000 and frame.can_id == 0x185
    )
    time_ns, sender, frame, error = frames[place]
    frames[place] = (time_ns, sender, CanFrame(0x185, b"\x27\x02" + bytes(frame.data[2:])), error)
    log = decode(write_log(frames, tmp_path / "wrong.log")).trace
    judged = always(
        "statusword shows a fault",
        lambda word: word.astype(int) & 8 != 0,
        "drive1.statusword",
        since=TRIP.plus(0.4),
    )
    (check,) = judged.evaluate(log)
    assert check.verdict is Verdict.FAILED
    assert check.time_s == pytest.approx(time_ns * 1e-9, abs=1e-6)
    (rule,) = [one for one in run_checkers(log) if one.name == "state transitions of drive1"]
    assert rule.verdict is Verdict.FAILED, "from Fault there is no way to Operation enabled"
    assert rule.time_s == pytest.approx(time_ns * 1e-9, abs=1e-6)
    assert judged.evaluate(decode(write_log(case.raw_frames("can0"), tmp_path / "right.log")).trace)[
        0
    ].verdict is (Verdict.PASSED)


def test_a_position_that_moved_on_the_bus_fails(case, tmp_path):
    """Actual positions displaced in the frames are motion after the stop."""
    frames = []
    trip_ns = next(case.select(kind="drive.fault")).time_ns
    for time_ns, sender, frame, error in case.raw_frames("can0"):
        changed = frame
        if time_ns > trip_ns + 700_000_000 and frame.can_id == 0x185:
            data = bytearray(frame.data)
            data[2:6] = (int.from_bytes(data[2:6], "little", signed=True) + 2000).to_bytes(
                4, "little", signed=True
            )
            changed = CanFrame(0x185, bytes(data))
        frames.append((time_ns, sender, changed, error))
    log = decode(write_log(frames, tmp_path / "moved.log")).trace
    (check,) = no_motion_after(TRIP.plus(0.5)).evaluate(log)
    assert check.verdict is Verdict.FAILED
    assert check.value == pytest.approx(2000 / 131072 * 10.0, abs=1e-6)


# -- what is wrong with a log
# -----------------------------------------------------------------------------------------


def changed(tmp_path, log_file, change):
    path = tmp_path / "changed.log"
    lines = log_file.read_text().splitlines(keepends=True)
    path.write_text("".join(change(lines)))
    return path


def other_nodes(lines):
    text = "".join(lines)
    for service in ("18", "28", "38", "20", "70", "08", "58", "60"):
        text = text.replace(f" {service}5#", f" {service}6#")
    return [text]


def swapped(lines):
    lines[100], lines[200] = lines[200], lines[100]
    return lines


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda lines: [], "is empty"),
        (lambda lines: ["\n"], "holds no CAN frame"),
        (lambda lines: lines[:3], "too short"),
        (swapped, r"timestamps go backwards: frame 10\d"),
        (lambda lines: [*lines[:500], lines[500][:25]], "line 501.*cut off"),
        (lambda lines: [*lines[:500], lines[500][:-2]], "line 501.*cut off"),
        (lambda lines: [*lines[:5], "hello\n", *lines[5:]], "line 6.*no line of a candump log"),
        (other_nodes, r"none of the nodes.*drive1 \(node 5\).*node 6 \("),
    ],
)
def test_a_log_that_cannot_be_judged_says_why(log_file, tmp_path, change, words):
    """Empty, short, cut off, out of order, of other nodes: the message names the place."""
    with pytest.raises(CannotRunError, match=words):
        decode(changed(tmp_path, log_file, change))


def test_a_binary_log_that_was_cut_off_says_so(case, tmp_path):
    """A BLF file without its end is refused, and so is a file that is none."""
    path = write_log(case.raw_frames("can0"), tmp_path / "bus.blf")
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(CannotRunError, match="cannot be read as a CAN log"):
        decode(path)
    path.write_bytes(b"something else")
    with pytest.raises(CannotRunError, match="cannot be read as a CAN log"):
        decode(path)
    with pytest.raises(CannotRunError, match="no such file"):
        decode(tmp_path / "absent.log")


def test_channels_are_named(log_file, tmp_path):
    """A single channel needs no name; of several the one of the segment is taken, or the one that is
    given.
    """
    two = changed(
        tmp_path,
        log_file,
        lambda lines: [
            x for line in lines for x in (line.replace("can0", "vcan7"), line.replace("can0", "vcan8"))
        ],
    )
    with pytest.raises(CannotRunError, match=r"channels vcan7, vcan8.*--channel SEGMENT=CHANNEL"):
        decode(two)
    with pytest.raises(CannotRunError, match="no such channel"):
        decode(two, channels={"can0": "vcan9"})
    with pytest.raises(CannotRunError, match="no such CAN segment"):
        decode(two, channels={"can9": "vcan7"})
    assert digest_of(decode(two, channels={"can0": "vcan8"}).trace) == digest_of(decode(log_file).trace)
    one = changed(tmp_path, log_file, lambda lines: [line.replace("can0", "slcan0") for line in lines])
    assert digest_of(decode(one).trace) == digest_of(decode(log_file).trace)


def test_a_question_about_the_time_after_the_log_is_blocked(recorded):
    """A log that ended too early answers nothing about what came later."""
    log = recorded
    for expectation in (standstill(by=9.0), state_at("drive1", 9.0, "Fault"), never_happens(TRIP, since=9.0)):
        (check,) = expectation.evaluate(log)
        assert check.verdict is Verdict.BLOCKED
        assert "the recording ends at" in check.observed


def test_a_lost_heartbeat_shows_as_on_the_bench(log_file, tmp_path):
    """Where the node falls silent the heartbeat is lost after the consumer time of the bench file."""
    silent = changed(
        tmp_path,
        log_file,
        lambda lines: [line for number, line in enumerate(lines) if number < 400 or "705#" not in line],
    )
    log = decode(silent).trace
    (lost,) = log.select(kind="heartbeat.lost")
    last = max(t for t, _, f, _ in log.raw_frames("can0") if f.can_id == 0x705)
    consumer_ms = load_bench("reference").config.drive["drive1"].consumer_heartbeat_ms
    assert lost.time_ns == last + consumer_ms * 1_000_000
    assert never_happens(event("heartbeat.lost")).evaluate(log)[0].verdict is Verdict.FAILED


# -- the command
# ------------------------------------------------------------------------------------------------------

FILE = """
from hil.expect import alarm, event, happens, standstill
TRIP = event("drive.fault", "drive1")
EXPECTATIONS = {
    "trip": [happens(TRIP), standstill(by=TRIP.plus(%s))],
    %s
}
"""


@pytest.mark.parametrize(
    ("by", "more", "code", "verdicts"),
    [
        ("0.5", "", 0, ["passed"]),
        ("0.05", "", 1, ["failed"]),
        ("0.5", '"alarms": [alarm(421)],', 0, ["passed", "blocked"]),
        ("0.5", '"slip": [happens(event("drive.falt"))],', 1, ["passed", "error"]),
    ],
)
def test_the_command_judges_and_reports(log_file, tmp_path, capsys, by, more, code, verdicts):
    """Exit code, JSON and report are those of a run; the page shows plots and decoded frames."""
    file = tmp_path / f"expect_{by.replace('.', '_')}_{len(more)}.py"
    file.write_text(FILE % (by, more))
    report = tmp_path / "report"
    assert main(["judge", str(log_file), "--expect", str(file), "--report", str(report), "--json"]) == code
    answer = json.loads(capsys.readouterr().out)
    assert [case["verdict"] for case in answer["cases"]] == verdicts
    assert "are judged: state transitions of drive1" in answer["notes"][-1]
    assert Path(answer["trace"]) == report / "trace.npz"
    assert main(["export", answer["trace"], "--output", str(tmp_path / "again.log")]) == 0
    assert read_bus_log(tmp_path / "again.log").frames == read_bus_log(log_file).frames
    page = (report / "report.html").read_text()
    packed_cases = page.split('id="data-case-')[1:]
    data = [unpacked(one.partition(">")[2].partition("<")[0]) for one in packed_cases]
    assert "axis1.actual_velocity" in json.dumps(data)
    if "failed" in verdicts:
        (check,) = [one for one in answer["cases"][0]["checks"] if one["verdict"] == "failed"]
        assert check["time_s"] == pytest.approx(0.7, abs=0.2)
        assert check["sentence"].endswith(" s (allowed: 1 mm/s)")
        assert check["margin"] == pytest.approx(check["high"] - abs(check["value"]))
        assert "TPDO1 drive1: Statusword" in json.dumps(data)


def test_the_command_judges_a_saved_trace(case, tmp_path, capsys):
    """The evidence of a case is judged again, alarms included, without any bench file."""
    case.save(tmp_path / "trace")
    file = tmp_path / "alarms.py"
    file.write_text(
        "from hil.expect import alarm\ndef expectations(trace):\n    return [alarm(421, reaction=4)]\n"
    )
    arguments = ["judge", str(tmp_path / "trace.npz"), "-e", str(file), "-r", str(tmp_path / "r"), "--json"]
    assert main(arguments) == 0
    assert json.loads(capsys.readouterr().out)["passed"] == 1


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "does not exist"),
        ("x = 1\n", "does not say what to expect"),
        ("EXPECTATIONS = []\n", "not empty"),
        ("EXPECTATIONS = [1]\n", "no expectation of hil.expect"),
        ("EXPECTATIONS = {}\n", "empty"),
        ("import nothing_like_this\n", "cannot be imported"),
    ],
)
def test_a_file_without_expectations_is_refused(log_file, tmp_path, capsys, content, words):
    """The command could not run, and says what the file has to hold."""
    file = tmp_path / f"file_{abs(hash(content))}.py"
    if content is not None:
        file.write_text(content)
    assert main(["judge", str(log_file), "-e", str(file), "-r", str(tmp_path / "r")]) == 2
    assert words in capsys.readouterr().err
