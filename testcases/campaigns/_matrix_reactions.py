"""What a matrix expects of a fault: the alarm with its reaction, the end of the job, rest, and recovery."""

from __future__ import annotations

from typing import Any

from hil.campaign import CaseContext
from hil.expect import alarm, job_output, never_happens, no_alarm, state_at, value_at
from hil.record import event
from testcases.campaigns._matrix_faults import CAN, MODBUS, FaultWord
from testcases.campaigns._profiles import profile_of
from testcases.campaigns._reactions import (
    cycles,
    disabled_by_alarm,
    machine_at_rest,
    recovers,
    stopped_for_good,
)
from testcases.campaigns.stop_modes import STOPS, give
from testcases.campaigns.support import axis_name, drive_name, settle_s

INTO_THE_STOP_S = 0.04
"""Time after the beginning of a stop at which the fault comes, s."""


def expected_alarm(ctx: CaseContext, word: FaultWord) -> tuple[int, int] | None:
    """Return number and reaction of the alarm of a fault behind the drive of the bench."""
    if word.profidrive is not None and profile_of(ctx) == "profidrive":
        return word.profidrive
    return word.alarm


def _need_its_bus(ctx: CaseContext, word: FaultWord) -> None:
    """Block the case on a bench without the kind of bus that the fault belongs to."""
    if word.target:
        return
    kind = str(next(iter(ctx.bench.config.segment.values())).kind)
    on_modbus = kind.startswith("modbus")
    if set(word.transports) <= set(CAN):
        ctx.require(not on_modbus or word.controller, f"a fault of CAN, and its first segment is {kind}")
    elif set(word.transports) <= set(MODBUS):
        ctx.require(on_modbus, f"a fault of Modbus, and its first segment is {kind}")


def _inject(ctx: CaseContext, word: FaultWord) -> tuple[Any, float]:
    _need_its_bus(ctx, word)
    options = dict(word.options(ctx) if callable(word.options) else word.options)
    duration_s = 0.0 if word.lasts is None else word.lasts(ctx)
    if duration_s:
        options["duration_s"] = duration_s
    target = drive_name(ctx) if word.target == "drive" else word.target
    return ctx.inject(word.kind, target, **options), min(duration_s, 5.0)


def fault_in_motion(ctx: CaseContext, word: FaultWord, moment: str, job: Any) -> None:
    """Inject a fault in a moment of a job (None at standstill), and expect what the specification makes of
    it.
    """
    axis = axis_name(ctx)
    before = ctx.now_s
    fault, lasts_s = _inject(ctx, word)
    ctx.run_for(max(word.after_s, lasts_s) + 0.5 + settle_s(ctx))
    ended = ctx.now_s
    if word.controller:
        machine_at_rest(ctx, ended)
        ctx.expect(
            value_at(f"{axis}.power_status", ended, 0.0, tolerance=0.0).named("nothing starts by itself")
        )
        return
    expected = expected_alarm(ctx, word)
    if expected is None:
        ctx.expect(
            no_alarm(axis=axis, besides=(522,), until=ended).covers(*word.requirements),
            never_happens(event("job.error", axis)),
        )
        return
    _reacts(ctx, word, expected, before, ended)
    # A job that is arriving may be done before the alarm comes.
    if job is not None and moment != "arriving" and expected[1] in {1, 2, 3, 4} and word.within is not None:
        ctx.expect(
            job_output(
                job.name, "Error", since=before, error_id=0x8001, within_s=word.within(ctx) + cycles(ctx, 2)
            ).covers("STP-252")
        )
    if expected[1] == 4:
        disabled_by_alarm(ctx, ended)
    elif expected[0] == 531:
        ctx.expect(state_at(axis, ended, "ALARM_STANDSTILL").covers("STP-589"))
    fault.remove()
    if word.recovers:
        ctx.run_for(1.0)
        recovers(ctx)


def _reacts(
    ctx: CaseContext, word: FaultWord, expected: tuple[int, int], injected: float, ended: float
) -> None:
    number, reaction = expected
    limit = {} if word.within is None else {"within_s": word.within(ctx)}
    ctx.expect(
        alarm(number, reaction=reaction, since=injected, axis=axis_name(ctx), **limit).covers(
            *word.requirements
        )
    )
    if reaction:
        stopped_for_good(ctx, ended)


def fault_in_stop(ctx: CaseContext, word: FaultWord, stop: str) -> None:
    """Inject a fault while a stop is on its way, and expect its alarm on top of the stop, rest, and the end
    of both.
    """
    axis = axis_name(ctx)
    give(ctx, stop)
    ctx.run_for(INTO_THE_STOP_S)
    injected = ctx.now_s
    fault, lasts_s = _inject(ctx, word)
    ctx.run_for(max(word.after_s, lasts_s, 4.0 if stop == "power-3" else 1.5) + 0.5 + settle_s(ctx))
    ended = ctx.now_s
    machine_at_rest(ctx, ended)
    disabled = stop.startswith("power")
    expected = expected_alarm(ctx, word)
    if STOPS[stop]["ramp"] in {"off3", "coast"}:
        # The drive has been commanded to stop, or let go by itself, and is no longer asked how it does:
        # nothing may start again.
        ctx.expect(
            value_at(f"{axis}.power_status", ended, 0.0, tolerance=0.0).covers(*STOPS[stop]["ids"]),
            value_at(f"{axis}.power_busy", ended, 0.0 if disabled else 1.0, tolerance=0.0),
        )
    elif expected is not None:
        _reacts(ctx, word, expected, injected, ended)
        ctx.expect(
            state_at(axis, ended, "ALARM_DISABLED").covers("STP-487" if expected[1] == 4 else "STP-503"),
            value_at(f"{axis}.power_status", ended, 0.0, tolerance=0.0),
            value_at(f"{axis}.power_busy", ended, 0.0 if disabled else 1.0, tolerance=0.0),
        )
    fault.remove()
