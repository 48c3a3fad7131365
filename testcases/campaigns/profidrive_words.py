"""The general state machine of a PROFIdrive drive, led by control words that no axis would send."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from fieldbus.errors import ConfigurationError
from fieldbus.profidrive.words import STW1
from hil.bench.telegram_master import TelegramMaster
from hil.campaign import Campaign, CaseContext
from hil.errors import BlockedError
from hil.expect import always, happens, never_happens, state_at, value_at
from hil.record import event

CAMPAIGN: Final = Campaign(
    "profidrive words", tags=("telegram",), bench="testcases.campaigns._led_drive:BENCH"
)

DRIVE: Final = "drive1"
OFF: Final = int(STW1.NO_OFF2 | STW1.NO_OFF3 | STW1.ENABLE_OPERATION) | 0x0470
"""OFF1, all else in order: enable operation, ramp generator, control by PLC."""
RUN: Final = OFF | int(STW1.ON)
SPEED: Final = 0x1000_0000
"""A quarter of the reference speed, N4."""
STEP_S: Final = 0.1
S1, S2, S4 = "S1 switching on inhibited", "S2 ready for switching on", "S4 operation"


def leading(ctx: CaseContext) -> TelegramMaster:
    """Return the master of the telegram of the drive.

    Raises:
        BlockedError: The bench has no drive that a case can lead by its telegram.

    """
    try:
        return ctx.bench.telegram(DRIVE)
    except ConfigurationError as error:
        raise BlockedError(f"the case leads a PROFIdrive drive by its telegram: {error}") from None


def send(ctx: CaseContext, text: str, **signals: int) -> float:
    """Send words from now on, let the drive act, and return when that was, s."""
    ctx.do(text, **signals)
    before = ctx.now_s
    leading(ctx).send(**signals)
    ctx.run_for(STEP_S)
    return before


def operate(ctx: CaseContext, nsoll: int = 0) -> None:
    """Bring the drive into operation."""
    send(ctx, "OFF1", STW1=OFF)
    send(ctx, "ON", STW1=RUN, NSOLL_B=nsoll)
    ctx.run_for(1.0)
    ctx.check(state_at(DRIVE, ctx.now_s, S4))


def word(text: str, name: str, mask: int, value: int, **when: Any) -> Any:
    """Expect bits of a recorded word of the drive."""
    return always(text, lambda bits: (bits.astype(np.int64) & mask) == value, f"{DRIVE}.{name}", **when)


@CAMPAIGN.case("on-needs-an-edge", requirements=("PD-098",))
def on_needs_an_edge(ctx: CaseContext) -> None:
    """After OFF2 the drive stays in S1 as long as ON stays set; OFF1 leads to S2, ON then to operation."""
    operate(ctx)
    send(ctx, "OFF2", STW1=RUN & ~int(STW1.NO_OFF2))
    begun = send(ctx, "no OFF2 any more, ON still set", STW1=RUN)
    ctx.expect(
        never_happens(event("drive.state", DRIVE), since=begun, until=ctx.now_s).covers("PD-098"),
        state_at(DRIVE, ctx.now_s, S1),
    )
    send(ctx, "OFF1", STW1=OFF)
    ctx.check(state_at(DRIVE, ctx.now_s, S2))
    operate(ctx)


@CAMPAIGN.case("fault-locks-on", requirements=("PD-115",))
def fault_locks_on(ctx: CaseContext) -> None:
    """Acknowledging a fault with ON still set does not start the drive: ON needs a new edge."""
    operate(ctx)
    # Following error: it brakes by OFF1, which leads to S2 and not to S1.
    ctx.inject("drive.fault", DRIVE, code=0x8611)
    ctx.run_for(1.0)
    begun = send(ctx, "acknowledge", STW1=RUN | int(STW1.ACKNOWLEDGE))
    send(ctx, "ON still set", STW1=RUN)
    ctx.expect(
        happens(event("drive.fault_acknowledged", DRIVE), since=begun),
        never_happens(event("drive.state", DRIVE, to=S4), since=begun, until=ctx.now_s).covers("PD-115"),
    )
    operate(ctx)


@CAMPAIGN.case("off3-is-kept", requirements=("PD-113",))
def off3_is_kept(ctx: CaseContext) -> None:
    """A quick stop cannot be taken back: OFF3 that is there for two cycles ends in S1."""
    operate(ctx, SPEED)
    begun = ctx.now_s
    ctx.do("OFF3 for two cycles")
    master = leading(ctx)
    master.send(STW1=RUN & ~int(STW1.NO_OFF3), NSOLL_B=SPEED)
    ctx.run_for(0.008)
    master.send(STW1=RUN, NSOLL_B=SPEED)
    ctx.run_for(1.0)
    ctx.expect(
        never_happens(event("drive.state", DRIVE, to=S4), since=begun).covers("PD-113"),
        state_at(DRIVE, ctx.now_s, S1),
        value_at(f"{DRIVE}.velocity", ctx.now_s, 0.0, tolerance=1e-6),
    )


@CAMPAIGN.case("off1-is-taken-back", requirements=("PD-111",))
def off1_is_taken_back(ctx: CaseContext) -> None:
    """ON during the ramp of OFF1 leads back to operation, and to the setpoint."""
    operate(ctx, SPEED)
    speed = f"{DRIVE}.motor_speed"
    full = float(ctx.trace()[speed].values[-1])
    send(ctx, "OFF1", STW1=OFF, NSOLL_B=SPEED)
    ctx.check(state_at(DRIVE, ctx.now_s, "S5 ramp stop"))
    back = send(ctx, "ON", STW1=RUN, NSOLL_B=SPEED)
    ctx.run_for(1.0)
    ctx.expect(
        happens(event("drive.state", DRIVE, to=S4), since=back, within_s=0.02).covers("PD-111"),
        value_at(speed, ctx.now_s, full, tolerance=0.01 * abs(full)),
    )


@CAMPAIGN.case("pulses", requirements=("PD-083",))
def pulses(ctx: CaseContext) -> None:
    """ZSW2 bit 10 shows pulses in operation only, not while the drive is merely switched on."""
    send(ctx, "OFF1", STW1=OFF)
    begun = ctx.now_s - STEP_S / 2
    send(ctx, "ON without enable operation", STW1=RUN & ~int(STW1.ENABLE_OPERATION))
    ctx.expect(word("no pulses in S2 and S3", "drive_zsw2", 0x0400, 0, since=begun, until=ctx.now_s))
    send(ctx, "enable operation", STW1=RUN)
    ctx.expect(
        word("pulses in S4", "drive_zsw2", 0x0400, 0x0400, since=ctx.now_s - STEP_S / 2).covers("PD-083")
    )


@CAMPAIGN.case("sync-lost", requirements=("PD-030",))
def sync_lost(ctx: CaseContext) -> None:
    """Without the clock of the bus an isochronous drive stops by itself, and tells it once the clock is
    back.
    """
    operate(ctx, SPEED)
    ctx.inject("frame.drop", "can0", can_id=0x080, duration_s=0.5)
    ctx.run_for(2.0)
    ctx.expect(
        happens(event("drive.fault", DRIVE), since=event("fault.applied"), within_s=0.05),
        value_at(f"{DRIVE}.velocity", ctx.now_s, 0.0, tolerance=1e-6),
    )
