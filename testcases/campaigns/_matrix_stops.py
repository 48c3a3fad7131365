"""Words of a matrix: a stop, and a second one on top of it; what is expected says the superseding matrix."""

from __future__ import annotations

from typing import Any, Final

from fieldbus.errors import ConfigurationError
from hil.campaign import CaseContext
from hil.expect import happens, job_output, never_happens, standstill, state_at, value_at
from hil.record import event
from testcases.campaigns._reactions import cycles, machine_at_rest
from testcases.campaigns._superseding import cell
from testcases.campaigns.stop_modes import STOPS, braking_of, expectation, give, ramp_begins, ramp_of
from testcases.campaigns.support import (
    axis_name,
    settle_s,
)

BETWEEN_S: Final = 0.04
"""Time between the two stops, s: every ramp of the first from 300 mm/s is still on its way."""
KEEPS_ENABLED: Final = "reaction-1"
"""Its alarm is 533, which leaves the axis enabled (STP-590)."""


def _row(stop: str) -> str:
    # Reaction 4 is made as 16#7 says, the default.
    return "alarm-7" if stop == "reaction-4" else stop.replace("reaction-", "alarm-")


def verdict(first: str, second: str) -> tuple[tuple[str, ...], str]:
    """Return the identifiers and the letter of a pair: N, A, P, E, W as in the superseding matrix; `-` where
    there is none.
    """
    if first == second or (first.startswith("power") and second.startswith("power")):
        return (), "-"
    if second == "halt":
        # A motion job like every other: rejected while a stop is on its way.
        return ("STP-578",), "E"
    if first == "halt":
        return ("STP-254",), "N"
    identifier, letter = cell(_row(first), second.replace("reaction-", "alarm-"))
    return (identifier,), letter


def end_of(first: str, second: str, letter: str) -> str:
    """Return the state in which a pair ends (STP-430, 443, 480, 485, 501, 503, 597)."""
    stops = (first, second)
    alarms = [stop for stop in stops if stop.startswith("reaction")]
    powers = [stop for stop in stops if stop.startswith("power")]
    if alarms:
        if powers:
            return "ALARM_DISABLED"
        return "ALARM_STANDSTILL" if alarms == [KEEPS_ENABLED] else "ALARM_DISABLED"
    if powers:
        return "DISABLED"
    return str(STOPS[second if letter == "N" else first]["end"])


def superseded(ctx: CaseContext, first: str, second: str, job: Any) -> None:
    """Give two stops, one shortly behind the other, and expect the one that wins to make its ramp, and the
    end of both.
    """
    identifiers, letter = verdict(first, second)
    axis = axis_name(ctx)
    before = ctx.now_s
    one = give(ctx, first)
    ctx.run_for(BETWEEN_S)
    between = ctx.now_s
    other = give(ctx, second)
    coasts = "power-3" in {first, second}
    ctx.run_for((4.0 if coasts else 1.5) + settle_s(ctx))
    ended = ctx.now_s
    ctx.expect(
        state_at(axis, ended, end_of(first, second, letter)).covers(*identifiers),
        standstill(by=ended - 0.2, axis=axis, until=ended),
    )
    machine_at_rest(ctx, ended)
    if job is not None:
        failed = first.startswith("reaction")
        ctx.expect(
            job_output(
                job.name, "Error" if failed else "CommandAborted", since=before, within_s=cycles(ctx, 3)
            )
        )
    _outputs(ctx, first, second, letter, one, other, before)
    winner, since = (second, between) if letter == "N" else (first, before)
    _makes_its_ramp(ctx, winner, first, since, identifiers)
    if letter in "AE" and STOPS[first]["state"] != STOPS[second]["state"]:
        ctx.expect(
            never_happens(event("axis.state", axis, to=STOPS[second]["state"]), since=between).covers(
                *identifiers
            )
        )


def _outputs(
    ctx: CaseContext, first: str, second: str, letter: str, one: Any, other: Any, before: float
) -> None:
    """Expect of `MC_Stop` and `MC_Halt` how they end: done, superseded, or turned away."""
    if first.startswith("stop"):
        ctx.expect(
            job_output(one.name, "CommandAborted" if letter == "N" else "Done", since=before).covers(
                "STP-436"
            )
        )
        if second.startswith("reaction"):
            ctx.expect(never_happens(event("job.error", job=one.name)).covers("STP-437"))
    if second.startswith("stop"):
        output = {"N": "Done", "A": "CommandAborted", "E": "Error"}[letter]
        ctx.expect(
            job_output(other.name, output, since=before).covers("STP-438" if letter == "N" else "STP-436")
        )
    if second == "halt":
        ctx.expect(job_output(other.name, "Error", since=before).covers("STP-578"))
    if "power" in first + second:
        ctx.expect(value_at(f"{axis_name(ctx)}.power_status", ctx.now_s, 0.0, tolerance=0.0))


def _makes_its_ramp(
    ctx: CaseContext, winner: str, first: str, since_s: float, identifiers: tuple[str, ...]
) -> None:
    kind = STOPS[winner]["ramp"]
    if kind == "coast":
        return  # nobody brakes
    if winner != first and STOPS[first]["state"] in {STOPS[winner]["state"], "ALARM_RAMP"} and kind != "off3":
        return  # the ramp changes within the same state (STP-484): the log does not tell when
    since = ramp_begins(ctx, winner)
    if ctx.trace().instant(since) is None:
        ctx.expect(happens(since, since=since_s).covers(*identifiers))
        return
    try:
        expected = expectation(ctx, winner, "", since, running=braking_of(ctx, first))
    except ConfigurationError:
        # The first ramp brakes harder than the second one may: no formula says how the one becomes the other.
        return
    ctx.expect(ramp_of(ctx, winner, since, expected).covers(*identifiers))
