"""Faults of Modbus networks and lines, and what an axis makes of them that leads its drive over them."""

from __future__ import annotations

from typing import Any, Final

from hil.bench import BenchFile, load_bench
from hil.campaign import Campaign, CaseContext
from hil.expect import alarm, happens, never_happens, no_alarm, value_at
from hil.record import event
from testcases.campaigns._profiles import encoder_increments_per_revolution
from testcases.campaigns._reactions import cycles, disabled_by_alarm, recovers, stopped_for_good
from testcases.campaigns._telegram_support import APPLIED, goes_on
from testcases.campaigns.support import (
    axis_name,
    bring_into,
    drive_name,
    enable,
    permitted_error_mm,
    quick_stop,
    settle_s,
)

CAMPAIGN: Final = Campaign("modbus faults", tags=("fault", "modbus"), bench="profidrive_tcp")
LINE: Final = Campaign("modbus line faults", tags=("fault", "modbus"), bench="profidrive_rtu")
"""The same for a serial line, and what only a line has."""
MONITORING_S: Final = 0.08
UNWATCHED: Final = BenchFile(
    "Modbus without sign of life",
    load_bench("profidrive_tcp").text
    + f"""
[drive.drive1.profidrive]
sign_of_life = false
setpoint_monitoring_ms = {MONITORING_S * 1000.0:g}
""",
)
MONITORED: Final = Campaign(
    "modbus monitoring", tags=("fault", "modbus"), bench="testcases.campaigns.modbus_faults:UNWATCHED"
)
"""What the monitoring of process data (p2040) does alone, where no sign of life is watched."""

ENDS: Final = ("constant", "standstill")
LOST: Final[dict[str, tuple[str, dict[str, Any], tuple[str, ...]]]] = {
    "no-answer": ("modbus.drop", {}, ("MODB-041",)),
    "no-request": ("modbus.drop", {"direction": "request"}, ("MODB-041",)),
    "slow": ("modbus.delay", {"delay_s": 0.2}, ("MODB-041",)),
    "wrong-unit": ("modbus.unit", {"unit": 77}, ("MODB-040",)),
}
"""Ways in which answers stay away on any link."""
LOST_TCP: Final = {
    **LOST,
    "wrong-transaction": ("modbus.transaction", {}, ("MODB-039",)),
    "cut": ("modbus.cut", {}, ("MODB-042",)),
    "resets": ("modbus.reset", {}, ("MODB-042",)),
    "truncated": ("modbus.truncate", {"length": 5}, ("MODB-038",)),
}
LOST_RTU: Final = {
    **LOST,
    "wrong-crc": ("modbus.crc", {}, ("MODB-006", "MODB-008")),
    "request-with-wrong-crc": ("modbus.crc", {"direction": "request"}, ("MODB-008", "PD-290")),
    "truncated": ("modbus.truncate", {"length": 3}, ("MODB-008",)),
    "broadcast": ("modbus.broadcast", {}, ("MODB-007", "PD-290")),
}
EXCEPTIONS: Final = (1, 2, 3, 4, 5, 6, 7, 8, 10, 11)


def grace(ctx: CaseContext) -> int:
    """Return after how many cycles without an answer the axis must report it: its grace, the time-out, the
    next question.
    """
    return int(ctx.bench.config.bench.grace_cycles) + 4


def linked_again(ctx: CaseContext) -> None:
    """Wait until the drive is in service again and both have counted their signs of life."""
    port = ctx.bench.port(drive_name(ctx))
    ctx.wait_until(lambda: port.link_ok, 5.0, "the drive is in service again")
    ctx.run_for(0.2)


def lost_for_good(
    ctx: CaseContext, kind: str, parameters: dict[str, Any], identifiers: tuple[str, ...]
) -> None:
    """Take the answers away: 431 with reaction 4, the drive stops by its own monitoring or by what it still
    hears.
    """
    fault = ctx.inject(kind, **parameters)
    ctx.run_for(2.0 + settle_s(ctx))
    ended = ctx.now_s
    ctx.expect(
        alarm(431, reaction=4, since=APPLIED, within_s=cycles(ctx, grace(ctx)), axis=axis_name(ctx)).covers(
            "STP-574", *identifiers
        ),
        value_at(f"{axis_name(ctx)}.communication_ok", ended, 0.0, tolerance=0.0),
    )
    stopped_for_good(ctx, ended)
    disabled_by_alarm(ctx, ended)
    fault.remove()
    linked_again(ctx)
    recovers(ctx)


@CAMPAIGN.product(
    "{what}/{phase}",
    parameters={"what": tuple(LOST_TCP), "phase": ENDS},
    title="{what} on the network, from {phase}",
    tags=("{phase}",),
    requirements=lambda what, phase: ("STP-574", "PD-349", *LOST_TCP[what][2]),
)
def lost_on_a_network(ctx: CaseContext, what: str, phase: str) -> None:
    """Answers that do not come, or are not those that were asked for: 431, a stop, recovery."""
    enable(ctx)
    bring_into(ctx, phase)
    lost_for_good(ctx, *LOST_TCP[what])


@LINE.product(
    "{what}/{phase}",
    parameters={"what": tuple(LOST_RTU), "phase": ENDS},
    title="{what} on the line, from {phase}",
    tags=("{phase}",),
    requirements=lambda what, phase: ("STP-574", "PD-349", *LOST_RTU[what][2]),
)
def lost_on_a_line(ctx: CaseContext, what: str, phase: str) -> None:
    """Frames with a wrong CRC, for somebody else, or for all are not answered: 431, a stop, recovery."""
    enable(ctx)
    bring_into(ctx, phase)
    lost_for_good(ctx, *LOST_RTU[what])


def exceptions(ctx: CaseContext, code: int) -> None:
    """The drive refuses every request: to an axis it is lost as one that says nothing."""
    enable(ctx)
    bring_into(ctx, "constant")
    lost_for_good(ctx, "modbus.exception", {"code": code}, ("MODB-032",))
    ctx.expect(
        happens(event("link.request_failed", drive_name(ctx), exception=code), since=APPLIED).covers("PD-349")
    )


for _campaign in (CAMPAIGN, LINE):
    _campaign.product(
        "exception-{code}",
        parameters={"code": EXCEPTIONS},
        title="every request is answered with exception {code}",
        requirements=("MODB-032", "PD-349", "STP-574"),
    )(exceptions)

HARMLESS: Final[dict[str, tuple[str, dict[str, Any]]]] = {
    "two-lost": ("modbus.drop", {"count": 2, "function": 3}),
    "one-exception": ("modbus.exception", {"count": 1, "code": 6, "function": 16}),
    "a-little-late": ("modbus.delay", {"count": 50, "delay_s": 0.0005}),
}
HARMLESS_TCP: Final = {
    **HARMLESS,
    "merged": ("modbus.merge", {"count": 1, "function": 3}),
    "one-transaction": ("modbus.transaction", {"count": 1}),
    "one-reset": ("modbus.reset", {"count": 1}),
}
HARMLESS_RTU: Final = {
    **HARMLESS,
    "one-crc": ("modbus.crc", {"count": 1}),
    "one-noise": ("modbus.noise", {"period_s": 2.0}),
}


def harmless(ctx: CaseContext, kind: str, options: dict[str, Any]) -> None:
    """What is over within the grace of the axis leaves the motion alone."""
    enable(ctx)
    bring_into(ctx, "constant")
    fault = ctx.inject(kind, **options)
    ctx.run_for(0.5)
    fault.remove()
    ctx.run_for(0.3)
    ctx.expect(no_alarm(axis=axis_name(ctx), besides=(522,)).covers("STP-574"))
    goes_on(ctx)


@CAMPAIGN.product(
    "harmless/{what}",
    parameters={"what": tuple(HARMLESS_TCP)},
    title="{what} on the network does not stop the axis",
    requirements=("STP-574", "MODB-038", "MODB-039"),
)
def harmless_on_a_network(ctx: CaseContext, what: str) -> None:
    """Two missing answers, one refusal, frames in one segment, a wrong identifier: within the grace."""
    harmless(ctx, *HARMLESS_TCP[what])


@LINE.product(
    "harmless/{what}",
    parameters={"what": tuple(HARMLESS_RTU)},
    title="{what} on the line does not stop the axis",
    requirements=("STP-574", "MODB-008"),
)
def harmless_on_a_line(ctx: CaseContext, what: str) -> None:
    """Two missing answers, one refusal, a wrong CRC, a disturbance now and then: within the grace."""
    harmless(ctx, *HARMLESS_RTU[what])


def corrupted(ctx: CaseContext, what: str) -> None:
    """A frame that is right, with a register that is not: the axis believes it, and its monitoring says
    so.
    """
    enable(ctx)
    bring_into(ctx, "constant")
    if what == "fault":
        ctx.inject("modbus.corrupt", function=3, register=0, mask=0x0008, duration_s=0.3)
        number, within = 421, cycles(ctx, 4)
    else:
        # The high word of G1_XIST1: the least of its bits that is more than the permitted following error,
        # and some.
        per_mm = (
            encoder_increments_per_revolution(ctx)
            / ctx.bench.config.drive[drive_name(ctx)].mechanics.lead_screw_mm
        )
        bit = int(2.0 * permitted_error_mm(ctx) * per_mm).bit_length() - 16
        ctx.inject("modbus.corrupt", function=3, register=6, mask=1 << bit, duration_s=0.3)
        number, within = 521, cycles(ctx, 4)
    ctx.run_for(2.5 + settle_s(ctx))
    ctx.expect(
        alarm(number, reaction=4, since=APPLIED, within_s=within, axis=axis_name(ctx)).covers(
            "PD-349", "MODB-033"
        )
    )
    stopped_for_good(ctx, ctx.now_s)


for _campaign in (CAMPAIGN, LINE):
    _campaign.product(
        "register/{what}",
        parameters={"what": ("fault", "position")},
        title="the register of the {what} is corrupt",
        requirements=("PD-349", "MODB-033"),
    )(corrupted)


def setpoints_lost(ctx: CaseContext) -> None:
    """Writing alone fails: the drive misses the sign of life and brakes by itself; its own goes, which the
    axis sees.
    """
    enable(ctx)
    bring_into(ctx, "constant")
    fault = ctx.inject("modbus.drop", direction="request", function=16)
    ctx.run_for(2.0 + settle_s(ctx))
    drive = drive_name(ctx)
    ctx.expect(
        happens(
            event("drive.fault", drive, text="sign of life of the controller failed"),
            since=APPLIED,
            within_s=cycles(ctx, 4),
        ).covers("PD-129"),
        happens(event("drive.state", drive, to="S5 ramp stop"), since=APPLIED).covers("PD-129"),
        alarm(431, reaction=4, since=APPLIED, within_s=cycles(ctx, grace(ctx)), axis=axis_name(ctx)).covers(
            "STP-574"
        ),
    )
    stopped_for_good(ctx, ctx.now_s)
    fault.remove()
    linked_again(ctx)
    recovers(ctx)


for _campaign in (CAMPAIGN, LINE):
    _campaign.case("setpoints-lost", requirements=("PD-129", "STP-574"))(setpoints_lost)


@MONITORED.product(
    "{what}",
    parameters={"what": ("every-request", "writing-alone")},
    title="{what} fails, and nobody watches a sign of life",
    requirements=("PD-292",),
)
def unwatched(ctx: CaseContext, what: str) -> None:
    """Without any access to process data the drive makes a quick stop after the monitoring time; reading
    alone keeps it going.
    """
    enable(ctx)
    bring_into(ctx, "constant")
    drive, silent = drive_name(ctx), what == "every-request"
    timed_out = event("drive.fault", drive, text="setpoints timed out")
    fault = ctx.inject("modbus.drop", direction="request", **({} if silent else {"function": 16}))
    ctx.run_for(1.0 + settle_s(ctx))
    if silent:
        # The last access was up to a cycle before, the drive looks once per cycle.
        slack = cycles(ctx, 2)
        early = (ctx.trace().instant(APPLIED) or 0.0) + MONITORING_S - slack
        ctx.expect(
            happens(timed_out, since=APPLIED, within_s=MONITORING_S + slack).covers("PD-292"),
            never_happens(timed_out, until=early).covers("PD-292"),
            happens(quick_stop(ctx), since=timed_out, within_s=slack).covers("PD-292"),
        )
        stopped_for_good(ctx, ctx.now_s)
    else:
        ctx.expect(never_happens(timed_out).covers("PD-292"))
    fault.remove()


@LINE.case("noisy", requirements=("MODB-008", "PD-290"))
def noisy(ctx: CaseContext) -> None:
    """Much noise on the line: whatever it makes of the cycle, the axis says so and stands, or goes on;
    nothing breaks.
    """
    enable(ctx)
    bring_into(ctx, "constant")
    fault = ctx.inject("modbus.noise", period_s=0.004, bytes=5)
    ctx.run_for(2.0)
    ctx.expect(alarm(431, reaction=4, since=APPLIED, axis=axis_name(ctx)).covers("MODB-008"))
    fault.remove()
    linked_again(ctx)
    ctx.run_for(1.5 + settle_s(ctx))
    stopped_for_good(ctx, ctx.now_s)
    recovers(ctx)
