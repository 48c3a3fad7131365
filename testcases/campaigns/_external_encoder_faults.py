"""Cases of `external_encoder`: encoders that fail, vanish, lie or wrap, and a controller that stops."""

from __future__ import annotations

from typing import Any, Final

from hil.campaign import Campaign, CaseContext
from hil.expect import happens, no_alarm, status_word_bit
from hil.record import event
from testcases.campaigns._external_encoder import KINDS, Part, halt, move, travel
from testcases.campaigns._reactions import cycles
from testcases.campaigns.support import acknowledge, axis_name, drive_name, enable, grace_s, settle_s

CASES: Final = Campaign("external encoder", tags=("encoder", "fault"), bench="reference")

_HOME: Final = 90.0


def _homed(ctx: CaseContext, encoder: str) -> Part:
    """Return the object, homed directly and enabled, with the load on its way."""
    part = Part(ctx, encoder)
    part.object.home(_HOME, mode=7 if part.kind.absolute else 13)
    part.power()
    travel(ctx, 100.0)
    return part


def _axis_goes_on(ctx: CaseContext, since: float) -> None:
    """Expect the axis to know nothing of it."""
    ctx.expect(
        no_alarm(since=since, axis=axis_name(ctx)).named("the axis goes on"),
        happens(event("job.in_velocity", axis_name(ctx))),
    )
    ctx.measure("velocity of the load", ctx.axis.var("ActualVelocity"), "mm/s", low=98.0, high=102.0)


def _recovers(ctx: CaseContext, part: Part, *, homed: bool) -> None:
    """Acknowledge; the object is enabled again without an edge, and shows the load again, homed or not."""
    ctx.expect(status_word_bit(0, False, at=ctx.now_s, axis=part.name).named("disabled by its alarm"))
    part.acknowledge()
    ctx.wait_until(
        lambda: bool(part.object.var("StatusWord.X0")), 2.0, "the object is enabled again without an edge"
    )
    ctx.measure("StatusSensor.State", part.object.var("StatusSensor.State"), low=2, high=2)
    ctx.measure("ErrorWord", part.object.var("ErrorWord"), low=0, high=0)
    ctx.expect(
        status_word_bit(5, homed, at=ctx.now_s, axis=part.name).named(
            "homed" if homed else "not homed any more"
        )
    )
    halt(ctx)
    place, load = part.position, part.load_mm
    move(ctx, -30.0)
    moved = part.kind.unit_per_mm * (part.load_mm - load)
    ctx.measure("deviation after a motion", abs(part.position - place - moved), high=part.tolerance())


@CASES.product(
    "error-code/{encoder}/{code}",
    parameters={"encoder": ("wheel", "scale"), "code": ("0001", "0002", "0F01")},
    title="{encoder} reports error {code}h",
    tags=("telegram",),
    requirements=("TA-013", "DIA-085", "HOM-179", "PD-012"),
)
def error_code(ctx: CaseContext, encoder: str, code: str) -> None:
    """Gx_ZSW bit 15: alarm 411, ErrorWord.X5, no valid value; repaired and acknowledged it counts on, an
    incremental one not homed.
    """
    part = _homed(ctx, encoder)
    since = ctx.now_s
    ctx.inject("encoder.error", part.device, code=int(code, 16), duration_s=0.2)
    ctx.run_for(0.1)
    ctx.expect(
        part.alarmed(411, since=since, within_s=cycles(ctx, 4)).covers("TA-013"),
        status_word_bit(5, True, at=ctx.now_s, axis=part.name, word="error_word").covers("DIA-085"),
        status_word_bit(1, True, at=ctx.now_s, axis=part.name).covers("DIA-074"),
    )
    ctx.measure(
        "StatusSensor.State", part.object.var("StatusSensor.State"), high=1, requirements=("DIA-076",)
    )
    _axis_goes_on(ctx, since)
    ctx.run_for(0.6)
    _recovers(ctx, part, homed=part.kind.absolute)


@CASES.product(
    "backlash/{encoder}/{play}",
    parameters={"encoder": ("scale", "drum"), "play": (0.4, 2.0)},
    title="{encoder} sees a backlash of {play} mm grow",
    tags=("mechanics",),
)
def backlash(ctx: CaseContext, encoder: str, play: float) -> None:
    """The axis measures at its motor and knows nothing of the play; what measures the load misses it at every
    reversal.
    """
    part = _homed(ctx, encoder)
    halt(ctx)
    since = ctx.now_s
    ctx.inject("mechanics.backlash", drive_name(ctx), backlash_mm=play, growth_s=0.2)
    ctx.run_for(0.3)
    # As gently as the friction of the load would stop it by itself, so that it stays at the flank that pushes
    # it.
    for distance, missed in ((10.0, None), (-10.0, play), (-5.0, 0.0), (10.0, play)):
        shown, axis = part.position, ctx.axis.var("ActualPosition")
        move(ctx, distance, 50.0, deceleration=400.0)
        ctx.measure(
            "way of the axis",
            ctx.axis.var("ActualPosition") - axis,
            "mm",
            low=distance - 0.1,
            high=distance + 0.1,
        )
        if missed is not None:
            way = part.kind.unit_per_mm * (abs(distance) - missed)
            ctx.measure(
                "way of the load",
                abs(part.position - shown),
                low=way - part.tolerance() - 0.1 * part.kind.unit_per_mm,
                high=way + part.tolerance() + 0.1 * part.kind.unit_per_mm,
            )
    ctx.expect(
        no_alarm(since=since, axis=axis_name(ctx)).named("the axis knows nothing of it"),
        part.no_alarm(since=since),
    )


@CASES.product(
    "alarm-bit/{encoder}/{alarm}",
    parameters={"encoder": ("drum", "tape"), "alarm": ("position_error",)},
    title="{encoder} has the alarm {alarm}",
    tags=("cia406",),
    requirements=("DIA-085", "HOM-179"),
)
def alarm_bit(ctx: CaseContext, encoder: str, alarm: str) -> None:
    """6503h: alarm 411 of its object while it lasts, and until it is acknowledged."""
    part = _homed(ctx, encoder)
    since = ctx.now_s
    ctx.inject("encoder.alarm", part.device, alarm=alarm, duration_s=0.2)
    ctx.run_for(0.15)
    ctx.expect(
        part.alarmed(411, since=since, within_s=0.1),
        status_word_bit(5, True, at=ctx.now_s, axis=part.name, word="error_word").covers("DIA-085"),
    )
    _axis_goes_on(ctx, since)
    ctx.run_for(0.4)
    _recovers(ctx, part, homed=part.kind.absolute)


@CASES.product(
    "supply/{encoder}",
    parameters={"encoder": tuple(KINDS)},
    title="{encoder} loses its supply",
    requirements=("DIA-086", "TA-013", "TA-020", "HOM-179"),
)
def supply(ctx: CaseContext, encoder: str) -> None:
    """Alarm 431 within the grace of three cycles, ErrorWord.X7; back, an absolute encoder is where the load
    is, an incremental one not homed.
    """
    part = _homed(ctx, encoder)
    since = ctx.now_s
    place, load = part.position, part.load_mm
    ctx.inject("encoder.power_off", part.device, duration_s=0.3)
    ctx.run_for(0.2)
    ctx.expect(
        part.alarmed(431, since=since, within_s=grace_s(ctx) + cycles(ctx, 1)).covers("TA-020"),
        status_word_bit(7, True, at=ctx.now_s, axis=part.name, word="error_word").covers("DIA-086"),
    )
    ctx.measure("CommunicationOK", float(part.object.var("StatusSensor.CommunicationOK")), high=0.0)
    _axis_goes_on(ctx, since)
    ctx.run_for(1.2)
    if part.kind.absolute:
        moved = part.kind.unit_per_mm * (part.load_mm - load)
        ctx.measure(
            "deviation after the loss", abs(part.position - place - moved), high=2.0 * part.tolerance(100.0)
        )
    _recovers(ctx, part, homed=part.kind.absolute)


@CASES.product(
    "frames-lost/{encoder}/{number}",
    parameters={"encoder": ("wheel", "tape"), "number": ("few", "many")},
    title="{number} values of {encoder} are lost on the bus",
    tags=("bus",),
    requirements=("TA-020", "DIA-086"),
)
def frames_lost(ctx: CaseContext, encoder: str, number: str) -> None:
    """Two lost values lie within the grace, and the position goes on as if nothing had been; more of them are
    alarm 431.
    """
    part = _homed(ctx, encoder)
    since = ctx.now_s
    place, load = part.position, part.load_mm
    messages = ("tpdo1", "tpdo2") if part.kind.profile == "cia406" else ("tpdo1",)
    cycle = ctx.bench.cycle_ns * 1e-9
    lost_s = 2.0 * cycle if number == "few" else grace_s(ctx) + 0.1
    for message in messages:
        ctx.inject("frame.drop", "can0", drive=part.device, message=message, duration_s=lost_s)
    ctx.run_for(lost_s + 0.1)
    if number == "few":
        ctx.expect(part.no_alarm(since=since))
        moved = part.kind.unit_per_mm * (part.load_mm - load)
        ctx.measure("deviation", abs(part.position - place - moved), high=2.0 * part.tolerance(100.0))
        return
    ctx.expect(part.alarmed(431, since=since, within_s=grace_s(ctx) + cycles(ctx, 2)).covers("TA-020"))
    _axis_goes_on(ctx, since)
    ctx.run_for(0.6)
    # Nothing was counted wrong meanwhile: the count itself goes on in the encoder.
    _recovers(ctx, part, homed=True)
    ctx.measure(
        "homed position",
        abs(part.position - place - part.kind.unit_per_mm * (part.load_mm - load)),
        high=2.0 * part.tolerance(100.0),
    )


@CASES.case("sign-of-life", tags=("telegram",), requirements=("TA-013",))
def sign_of_life(ctx: CaseContext) -> None:
    """The counter of the wheel stands still: alarm 431 after the tolerated values; it counts again:
    acknowledged.
    """
    part = _homed(ctx, "wheel")
    since = ctx.now_s
    part_device: Any = ctx.bench.encoder("wheel")
    ctx.do("the sign of life of the wheel stands still")
    part_device.freeze_sign_of_life(True)
    ctx.run_for(0.1)
    ctx.expect(part.alarmed(431, since=since, within_s=cycles(ctx, 6)))
    part_device.freeze_sign_of_life(False)
    ctx.run_for(0.5)
    _axis_goes_on(ctx, since)
    part.acknowledge()
    ctx.measure("StatusSensor.State", part.object.var("StatusSensor.State"), low=2, high=2)


_LIES: Final[dict[str, tuple[str, dict[str, Any]]]] = {
    "freezes": ("encoder.freeze", {}),
    "reversed": ("encoder.reverse", {}),
    "noise": ("encoder.noise", {"increments": 3}),
    "jumps": ("encoder.jump", {"increments": 5000}),
}


@CASES.product(
    "lies/{encoder}/{how}",
    parameters={"encoder": ("wheel", "tape"), "how": tuple(_LIES)},
    title="{encoder}: {how}",
    requirements=("CFG-016", "CFG-018"),
)
def lies(ctx: CaseContext, encoder: str, how: str) -> None:
    """What nobody can notice is shown as it is, without an alarm: a position that stands, runs back,
    trembles, or is off by the jump.
    """
    part = _homed(ctx, encoder)
    since = ctx.now_s
    kind, parameters = _LIES[how]
    place, load = part.position, part.load_mm
    lasting = {} if how == "jumps" else {"duration_s": 0.2}
    ctx.inject(kind, part.device, **lasting, **parameters)
    ctx.run_for(0.1)
    middle, middle_load = part.position, part.load_mm
    ctx.run_for(0.08)
    scale = part.kind.unit_per_mm
    shown, moved = part.position - middle, scale * (part.load_mm - middle_load)
    allowed = part.tolerance(100.0) + 8.0 * part.kind.resolution
    if how == "freezes":
        ctx.measure("travel shown", abs(shown), high=1e-9)
    elif how == "reversed":
        ctx.measure("travel shown and its negative", abs(shown + moved), high=allowed)
    else:
        ctx.measure("deviation of the travel", abs(shown - moved), high=allowed)
    if how == "jumps":
        off = middle - place - scale * (middle_load - load)
        jump = 5000 * part.kind.resolution
        ctx.measure("distance of the jump", abs(off), low=jump - allowed, high=jump + allowed)
    ctx.run_for(0.3)
    ctx.expect(part.no_alarm(since=since))
    _axis_goes_on(ctx, since)


@CASES.product(
    "overflow/{encoder}",
    parameters={"encoder": ("drum",)},
    title="{encoder} passes the end of its range",
    requirements=("CFG-018",),
)
def overflow(ctx: CaseContext, encoder: str) -> None:
    """The value wraps at the end of 6002h; the position of the object goes on without a jump."""
    part = Part(ctx, encoder)
    part.power()
    travel(ctx, 100.0)
    ctx.inject("encoder.overflow", part.device, margin=2000)
    ctx.run_for(0.02)
    place, load = part.position, part.load_mm
    ctx.run_for(0.5)
    moved = part.kind.unit_per_mm * (part.load_mm - load)
    ctx.measure(
        "deviation over the end of the range",
        abs(part.position - place - moved),
        high=2.0 * part.tolerance(100.0),
    )


# -- the controller
# -----------------------------------------------------------------------------------------------------


@CASES.product(
    "controller/{what}/{encoder}",
    parameters=[
        *({"what": "power_off", "encoder": encoder} for encoder in KINDS),
        *({"what": what, "encoder": encoder} for what in ("stop", "stall") for encoder in ("wheel", "drum")),
    ],
    title="controller.{what} with {encoder}",
    tags=("controller",),
    requirements=("HOM-166", "HOM-153", "MC-629", "MC-630", "VAR-025"),
)
def controller(ctx: CaseContext, what: str, encoder: str) -> None:
    """Nothing is enabled by itself afterwards; an adjusted absolute encoder is where the load is, an
    incremental one after power-off not homed.
    """
    part = Part(ctx, encoder)
    part.object.home(_HOME, mode=7 if part.kind.absolute else 13)
    part.power()
    enable(ctx)
    move(ctx, 10.0)
    place, load = part.position, part.load_mm
    seconds = 0.6 + settle_s(ctx)
    ctx.inject(f"controller.{what}", duration_s=seconds)
    ctx.run_for(seconds + 1.5)
    if what == "stall":
        # A controller that hangs has not stopped: what was enabled is, unless an alarm of its link has taken
        # that away.
        acknowledge(ctx)
        part.acknowledge()
        ctx.run_for(0.2)
    else:
        ctx.expect(
            status_word_bit(0, False, at=ctx.now_s, axis=part.name).named("nothing is enabled by itself")
        )
        part.acknowledge()
        part.power()
    # A PROFIdrive encoder misses the sign of life of a controller that hangs: an error, with which its count
    # is not to be relied on.
    missed = what == "stall" and part.kind.profile == "profidrive"
    kept = part.kind.absolute or not (missed or what == "power_off")
    ctx.measure("StatusSensor.State", part.object.var("StatusSensor.State"), low=2, high=2)
    ctx.expect(
        status_word_bit(5, kept, at=ctx.now_s, axis=part.name).named(
            "homed" if kept else "not homed any more"
        )
    )
    if kept:
        moved = part.kind.unit_per_mm * (part.load_mm - load)
        ctx.measure("deviation", abs(part.position - place - moved), high=part.tolerance())
