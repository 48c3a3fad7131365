"""Bits at a time, settling, an axis that is disabled, a stop by its mode: each passes, and fails by the
smallest amount.
"""

import numpy as np
import pytest

from fieldbus.errors import ConfigurationError
from hil.bench import load_bench
from hil.expect import describe, disabled, event, settles_within, stop, telegram_bits, value_at
from hil.record import Trace, TraceGroup
from reports.model import Verdict

CYCLE_NS = 4_000_000


def recorded(component, **columns):
    """Return a trace of 1 s with columns of a component as functions of time in cycles."""
    cycles = np.arange(251)
    values = np.array([[float(function(int(n))) for function in columns.values()] for n in cycles])
    names = tuple((name, "mm" if "position" in name else "") for name in columns)
    group = TraceGroup(component, names, {}, cycles.astype(np.int64) * CYCLE_NS, values)
    return Trace([group], end_ns=250 * CYCLE_NS)


def one(expectation, trace):
    (check,) = expectation.evaluate(trace)
    return check


def verdict(expectation, trace):
    return one(expectation, trace).verdict


def test_telegram_bits_are_there_in_time_and_stay():
    """Ones and zeros have to hold at an instant, within a time, and for a time; a cycle too late or too short
    fails.
    """
    trace = recorded("drive1", zsw1=lambda n: 0x07 if 50 <= n < 75 else 0x43)
    at = 0.16
    assert (
        verdict(telegram_bits("drive1.zsw1", ones=0x04, zeros=0x40, at=at, within_s=0.04), trace)
        is Verdict.PASSED
    )
    late = one(telegram_bits("drive1.zsw1", ones=0x04, zeros=0x40, at=at, within_s=0.039), trace)
    assert late.verdict is Verdict.FAILED
    assert late.observed == "16#0043: wrong are X2, X6"
    assert late.expected == "X2 = 1, X6 = 0 within 0.039 s of 0.16 s"
    assert verdict(telegram_bits("drive1.zsw1", ones=0x04, at=0.2), trace) is Verdict.PASSED
    assert verdict(telegram_bits("drive1.zsw1", ones=0x04, at=0.196), trace) is Verdict.FAILED
    assert verdict(telegram_bits("drive1.zsw1", zeros=0x40, at=0.2, for_s=0.1), trace) is Verdict.PASSED
    short = one(telegram_bits("drive1.zsw1", zeros=0x40, at=0.2, for_s=0.101), trace)
    assert short.verdict is Verdict.FAILED
    assert short.time_s == pytest.approx(0.3)
    assert "1 ms under the limit" in describe(short)
    for masks in ({}, {"ones": 1, "zeros": 3}, {"ones": -1}, {"ones": 1 << 32}):
        with pytest.raises(ConfigurationError, match="masks of up to 32 bits"):
            telegram_bits("drive1.zsw1", at=0.0, **masks)


def test_a_value_settles_within_a_time_and_stays():
    """The last sample outside of the band counts, at the edge of band and time to the sample."""
    trace = recorded("axis1", position=lambda n: 10.0 if n >= 30 else (10.5 if n == 25 else 0.0))
    settled = settles_within("axis1.position", 10.0, tolerance=0.0, within_s=0.12)
    assert verdict(settled, trace) is Verdict.PASSED
    late = one(settles_within("axis1.position", 10.0, tolerance=0.0, within_s=0.119), trace)
    assert late.verdict is Verdict.FAILED
    assert "1 ms over the limit" in describe(late)
    assert (
        verdict(settles_within("axis1.position", 10.2, tolerance=0.2, within_s=0.2), trace) is Verdict.PASSED
    )
    never = one(settles_within("axis1.position", 10.2, tolerance=0.199, within_s=0.2), trace)
    assert never.verdict is Verdict.FAILED
    assert never.signal == "axis1.position"
    assert never.low == pytest.approx(10.001)
    again = recorded("axis1", position=lambda n: 0.0 if n == 249 else 10.0)
    assert (
        verdict(settles_within("axis1.position", 10.0, tolerance=1.0, within_s=0.5), again) is Verdict.FAILED
    )
    assert (
        verdict(settles_within("axis1.position", 10.0, tolerance=1.0, within_s=0.5, until=0.9), again)
        is Verdict.PASSED
    )
    beyond = one(settles_within("axis1.position", 10.0, tolerance=0.0, within_s=0.5, since=0.8), trace)
    assert beyond.verdict is Verdict.FAILED, "half of the time was not recorded"
    assert "recorded is only" in beyond.observed


@pytest.mark.parametrize(
    ("column", "off", "on"),
    [("statusword", 0x0250, 0x0237), ("drive_zsw2", 0x0000, 0x0400), ("drive_zsw1", 0x0231, 0x0237)],
)
def test_disabled_means_no_enable_and_no_torque(column, off, on):
    """From the reference on neither the axis shows an enable nor its drive that it could give torque, in any
    sample.
    """
    axis = recorded("axis1", power_status=lambda n: n < 50)
    drive = recorded("drive1", **{column: lambda n: on if n < 51 else off})
    trace = Trace([*axis.groups, *drive.groups], end_ns=axis.end_ns)
    assert [check.verdict for check in disabled(by=0.204).evaluate(trace)] == [Verdict.PASSED, Verdict.PASSED]
    early = disabled(by=0.2).evaluate(trace)
    assert [check.verdict for check in early] == [Verdict.PASSED, Verdict.FAILED]
    assert early[1].time_s == pytest.approx(0.2)
    assert [check.verdict for check in disabled(by=0.196, drive="").evaluate(trace)] == [Verdict.FAILED]
    with pytest.raises(ConfigurationError):
        disabled(by=0.0, axis="", drive="")


def test_a_question_behind_the_end_of_the_trace_fails():
    """What was not recorded was not seen: an interval that begins after the end proves nothing."""
    trace = recorded("axis1", position=lambda n: 1.0)
    check = one(value_at("axis1.position", 1.004, 1.0, tolerance=0.0), trace)
    assert check.verdict is Verdict.FAILED
    assert "the recording ends at 1.000000 s" in check.observed
    assert verdict(value_at("axis1.position", 1.0, 1.0, tolerance=0.0), trace) is Verdict.PASSED


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-239", "STP-241", "STP-553")
@pytest.mark.parametrize(
    ("stop_mode", "mode", "other"), [(0, "emergency", "maximum"), (2, "maximum", "emergency")]
)
def test_a_stop_is_judged_by_its_mode(stop_mode, mode, other):
    """Ramp time and travel follow from the limits of the axis; the ramp of another mode fails in both."""
    with load_bench("reference").build() as bench:
        axis = bench.axis()
        power = axis.power()
        assert bench.run_until(power.status, 2.0)
        axis.move_velocity(300.0)
        bench.run_for(0.8)
        axis.power(False, stop_mode=stop_mode)
        bench.run_for(0.5)
        trace = bench.trace()
    since = event("axis.state", "axis1", to="DISABLING_RAMP")
    checks = stop(since, mode).covers("STP-239").evaluate(trace)
    assert [check.verdict for check in checks] == [Verdict.PASSED] * 3, checks
    assert all(check.requirements == ["STP-239"] for check in checks)
    wrong = {check.name.rpartition(": ")[2]: check.verdict for check in stop(since, other).evaluate(trace)}
    assert wrong == {"ramp time": Verdict.FAILED, "travel": Verdict.FAILED, "ramp made by": Verdict.PASSED}
    with pytest.raises(ConfigurationError, match="emergency, maximum, default"):
        stop(since, "hard")
    bare = Trace(trace.groups, events=trace.events, end_ns=trace.end_ns)
    assert stop(since, mode).evaluate(bare)[0].verdict is Verdict.ERROR
