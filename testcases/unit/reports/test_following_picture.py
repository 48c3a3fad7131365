"""What the page of a case shows of axes that follow others: the picture over the leading position, phases,
one panel with leading and following value, the error of the function.
"""

from __future__ import annotations

import numpy as np
import pytest

from hil.bench import load_bench
from hil.campaign._evidence import build_signals
from reports.html.curves import markup
from reports.html.following import following_payloads
from reports.html.signals import arrange
from reports.model import Signal


def signals(axis: str, phase: list[float], leading: list[float], following: list[float]) -> list[Signal]:
    """Return what is recorded of an axis that is everywhere 0.5 mm behind its function."""
    times = np.arange(len(phase), dtype=float)
    columns = {
        "sync_phase": phase,
        "leading_position": leading,
        "function_position": following,
        "actual_position": [one - 0.5 for one in following],
    }
    units = {"sync_phase": "", "leading_position": ""}
    return [
        Signal(f"{axis}.{name}", units.get(name, "mm"), times, np.array(values, dtype=float), {})
        for name, values in columns.items()
    ]


def test_a_picture_has_a_line_for_every_phase():
    """Phases follow each other in colours of their own, the actual position lies behind them."""
    nan = float("nan")
    recorded = signals(
        "a",
        [0, 1, 1, 2, 2, 3, 3, 4, 0],
        [nan, 0, 10, 20, 30, 40, 50, 60, nan],
        [0, 0, 0, 1, 4, 10, 15, 18, 18],
    )
    (payload,) = following_payloads(recorded)
    drawn = markup(payload["svg"])
    for number in (1, 2, 3, 4):
        assert f'class="follow-{number}"' in drawn
    assert 'class="follow-actual"' in drawn
    assert "follow-5" not in drawn
    assert payload["alt"] == (
        "Position of a over the leading one, 0 to 60: waiting, synchronising, synchronous, desynchronising; "
        "following position \N{MINUS SIGN}0.5 to 18 mm"
    )


@pytest.mark.parametrize(
    "recorded",
    [
        signals("a", [0, 0, 0], [float("nan")] * 3, [0, 1, 2]),
        signals("a", [3, 3, 3], [7, 7, 7], [1, 1, 1]),
        signals("a", [3, 3, 3], [1, 2, 3], [1, 1, 1])[:3],
        [],
    ],
    ids=["follows nothing", "the leading axis stands", "a signal is missing", "nothing recorded"],
)
def test_no_picture_without_a_leading_value_that_moves(recorded):
    """An axis that follows nothing, or nothing that moves, has no picture."""
    assert following_payloads(recorded) == []


def test_leading_and_following_value_share_a_panel():
    """Whatever the unit of the leading object; the page shows it at first sight."""
    panels, _ = arrange(signals("a", [3, 3, 3], [1, 2, 3], [1, 4, 9]))
    (shared,) = [panel for panel in panels if panel.title == "Leading and following value"]
    assert {signal.name for signal in shared.signals} == {"a.leading_position", "a.function_position"}
    assert shared.shown


@pytest.mark.exhaustive
def test_the_error_of_the_function_leaves_out_the_transport_delay():
    """It is that between the actual position and the function of the setpoint that can have been reached, and
    only while the axis is synchronous.
    """
    with load_bench("synchronous").build(seed=1) as bench:
        leader, follower = bench.axis("leader"), bench.axis("follower_a")
        for axis in (leader, follower):
            bench.wait_until(axis.power().status, 3.0)
        leader.move_velocity(200.0)
        bench.wait_until(follower.gear_in(leader, 2, 1).in_gear, 3.0)
        bench.run_for(0.5)
        trace = bench.trace()
    found = {signal.name: signal for signal in build_signals(trace)}
    error = found["follower_a.function_error"]
    assert "follower_b.function_error" not in found
    phase = trace["follower_a.sync_phase"]
    known = np.isfinite(error.values)
    assert known.any()
    assert (np.round(phase.values[known]) == 3).all()
    # At 400 mm/s the delay of two cycles is 3.2 mm.
    assert np.abs(error.values[known][-50:]).max() < 0.15
    assert np.abs(found["follower_a.function_position"].values - found["follower_a.actual_position"].values)[
        -1
    ] == pytest.approx(3.2, abs=0.3)
