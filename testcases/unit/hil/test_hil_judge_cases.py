"""Shipped cases, judged live and on the log of their bus: what the bus carries gets the same verdict, nothing
else passes.
"""

from pathlib import Path

import numpy as np
import pytest

from fieldbus.can.export import write_log
from hil.campaign import CaseContext, load_bench_file
from hil.campaign._discover import find_campaigns
from hil.campaign._execute import _call
from hil.expect import (
    disabled,
    event,
    event_order,
    happens,
    never_happens,
    no_motion_after,
    settles_within,
    standstill,
    state_at,
    stays_within,
    telegram_bits,
    value_at,
    word_sequence,
)
from hil.logs import read_bus_log, trace_of_log
from reports.model import Verdict
from reports.text import margin
from testcases import campaigns

pytestmark = pytest.mark.exhaustive

CASES = [
    ("stop_modes", "stop-modes/power-3/accelerating"),
    ("stop_modes", "stop-modes/reaction-1/decelerating"),
    ("stop_modes", "stop-modes/stop-0/decelerating"),
    ("stop_modes", "stop-modes/stop-2/constant"),
    ("fault_reactions", "fault-reactions/drive-fault/8611/constant"),
    ("fault_reactions", "fault-reactions/drive-fault/8611/standstill"),
    ("fault_reactions", "fault-reactions/safe-torque-off/accelerating"),
    ("fault_reactions", "fault-reactions/heartbeat-lost/standstill"),
    ("cia402_drive", "cia402-drive/nmt-of-others/81"),
    ("cia402_drive", "cia402-drive/sync-lost/standstill"),
    ("drive_faults", "drive-faults/acknowledge-held"),
    ("drive_faults", "drive-faults/transition-refused"),
    ("holding_brake", "holding-brake/closes/power-1"),
    ("homing", "homing/zero-mark/negative/above"),
    ("limits", "limits/disabling/positive/standstill"),
    ("monitoring", "monitoring/disturbed/push"),
    ("motion_in", "motion-in/overridden/velocity/jog"),
    ("alarm_reactions.toml", "alarm-reactions/cia402/can-1ms/jog/starting/load-step"),
    ("stops_on_stops.toml", "stops-on-stops/profidrive/can/jog-backward/accelerating/stop-0/power-1"),
    ("power_faults.toml", "power-faults/profidrive/absolute/accelerating/mains-dip"),
]
RESOLUTION = {"actual_velocity": 0.05, "actual_speed": 0.05, "speed_output": 0.05, "actual_torque": 0.003}
"""What the bus resolves: mm/s, rpm, Nm."""


def run(campaign, identifier):
    folder = Path(campaigns.__file__).parent
    reference = str(folder / campaign) if campaign.endswith(".toml") else f"testcases.campaigns.{campaign}"
    (found,) = find_campaigns([reference])
    case = found.campaign[identifier]
    bench_file = load_bench_file(case.bench or "reference")
    with bench_file.build(seed=1) as bench:
        context = CaseContext(bench, seed=1)
        assert _call(case, context) == (Verdict.PASSED, "")
        return bench_file, context.trace(), context.expectations


def about_events(trace, end_s):
    changes = [entry for entry in trace.select(source="drive1", kind="drive.state") if entry.time_ns > 0]
    states = [event("drive.state", "drive1", to=entry.data["to"]) for entry in changes]
    if changes:
        last_s = changes[-1].time_ns * 1e-9
        yield event_order(states)
        yield (
            event_order([*states, states[0]], since=last_s + 0.001)
            if last_s < end_s - 0.01
            else event_order(states)
        )
        yield happens(states[-1], since=0.03, within_s=last_s - 0.03 + 0.006)
        yield from (state_at("drive1", entry.time_ns * 1e-9 + 0.0055, entry.data["to"]) for entry in changes)
    for kind in ("drive.fault", "emcy.raised", "heartbeat.lost", "node.bootup", "drive.fault_cleared"):
        yield never_happens(event(kind), until=end_s)
        yield happens(event(kind), until=end_s)


def about_values(trace, end_s):
    for column, tolerance in RESOLUTION.items():
        name = f"axis1.{column}"
        signal = trace[name]
        for share in (0.3, 0.45, 0.6, 0.9):
            at = int(share * len(signal))
            yield value_at(
                name,
                float(signal.time_s[at]) + 0.0005,
                float(signal.values[at]),
                tolerance=tolerance + abs(signal.values[at]) * 1e-6,
            )
        begin_s = float(signal.time_s[len(signal) // 4])
        part = signal.between(begin_s, end_s).values
        yield stays_within(
            name, low=part.min() - tolerance, high=part.max() + tolerance, since=begin_s, until=end_s
        )
        if np.ptp(part) > 10 * tolerance:
            yield stays_within(name, high=part.max() - 4 * tolerance, since=begin_s, until=end_s)
    rest_s = trace["axis1.actual_velocity"].between(0.0, end_s).settles(1.0)
    if rest_s is not None and rest_s < end_s - 0.1:
        yield standstill(by=rest_s + 0.004, until=end_s)
        yield settles_within(
            "axis1.actual_velocity", 0.0, tolerance=1.0, within_s=rest_s + 0.006, until=end_s
        )
        yield disabled(by=end_s - 0.05, until=end_s, axis="")
        if rest_s > 0.3:
            yield standstill(by=rest_s - 0.02, until=end_s)
            yield no_motion_after(rest_s + 0.05, until=end_s)


def about_words(trace, end_s):
    word = "drive1.statusword" if "drive1.statusword" in trace else "drive1.drive_zsw1"
    signal = trace[word]
    for share in (0.3, 0.6, 0.95):
        at = int(share * len(signal))
        ones = int(signal.values[at]) & 0x6F
        yield telegram_bits(word, ones=ones, zeros=0x6F & ~ones, at=float(signal.time_s[at]) + 0.005)
    last = int(signal.values[-1]) & 0x6F
    yield word_sequence(word, [last], mask=0x6F, since=end_s - 0.02, until=end_s)
    yield word_sequence(word, [last ^ 0x20], mask=0x6F, since=end_s - 0.02, until=end_s)


@pytest.mark.parametrize(
    ("number", "campaign", "identifier"),
    [(n, *case) for n, case in enumerate(CASES)],
    ids=[one for _, one in CASES],
)
def test_a_case_and_its_log_get_the_same_verdicts(number, campaign, identifier, tmp_path):
    """Passed stays passed, failed stays failed, within what the bus resolves; the rest is blocked, with the
    reason.
    """
    bench_file, trace, own = run(campaign, identifier)
    path = write_log(trace.raw_frames("can0"), tmp_path / f"bus{('.log', '.asc', '.blf')[number % 3]}")
    log = trace_of_log(read_bus_log(path), bench_file).trace
    end_s = trace.end_s - 0.006
    same = 0
    for expectation in (
        *about_events(trace, end_s),
        *about_values(trace, end_s),
        *about_words(trace, end_s),
        *own,
    ):
        live, reported = expectation.evaluate(trace), expectation.evaluate(log)
        if [check.verdict for check in live] == [check.verdict for check in reported]:
            same += 1
            if live[0].value is not None and reported[0].value is not None:
                one, other = margin(live[0]), margin(reported[0])
                mine, theirs = (
                    (live[0].value, reported[0].value) if one is None or other is None else (one, other)
                )
                allowed = 0.006 if live[0].unit == "s" else 0.05 + abs(live[0].value) * 1e-3
                assert abs(mine - theirs) <= allowed, (expectation.wanted, live[0], reported[0])
            continue
        unlike = [
            check for one, check in zip(live, reported, strict=False) if one.verdict is not check.verdict
        ]
        assert all(check.verdict is Verdict.BLOCKED for check in unlike), (expectation.wanted, live, reported)
        assert all(
            any(
                word in check.observed
                for word in (
                    "not tell",
                    "not hold",
                    "not known",
                    "ends at",
                    "may have been",
                    "no value",
                    "may give torque",
                )
            )
            for check in unlike
        ), reported
    assert same >= 25, same
