"""Which outputs of axes a run has read: variables and bits of words."""

from __future__ import annotations

from hil.bench import load_bench
from hil.expect.rules import judge


def test_what_was_read_and_what_was_not():
    """A variable and a bit are read by their path, a bit by a rule as well; the rest of the axis is unread,
    and what belongs to the configuration is no output.
    """
    with load_bench("reference").build(seed=1) as bench:
        axis = bench.axis()
        axis.var("ActualVelocity")
        axis.var("StatusWord.X5")
        axis.var("ErrorWord")
        bench.run_for(0.1)
        read, unread = bench.outputs(frozenset())
        assert read == {"axis1.ActualVelocity", "axis1.StatusWord.X5"}
        assert {"axis1.StatusWord.X7", "axis1.ErrorWord.X8", "axis1.StatusServo.ControlDifference"} <= unread
        assert not any("Interface" in one or "Limits" in one for one in read | unread)
        trace = bench.trace()
        judge(trace)
        by_rules, left = bench.outputs(trace.looked_at)
        assert {"axis1.StatusWord.X7", "axis1.ErrorWord.X8"} <= by_rules
        assert by_rules | left == read | unread
