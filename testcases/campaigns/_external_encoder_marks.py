"""Cases of `external_encoder`: passive homing on zero marks and on a digital input, and what ends it without
a mark.
"""

from __future__ import annotations

from math import ceil, floor
from typing import Any, Final

from hil.campaign import Campaign, CaseContext
from hil.expect import job_output, never_happens, status_word_bit
from hil.record import event
from testcases.campaigns._external_encoder import Part, halt, move
from testcases.campaigns._homing import CAM, INPUT, ZERO_MARK, Machine, machine
from testcases.campaigns.support import axis_name, drive_name, enable

CASES: Final = Campaign("external encoder", tags=("encoder", "homing"), bench="reference")

_SIGN: Final = {"positive": 1, "negative": -1}
_SPEED: Final = 50.0
_POSITION: Final = 120.0
_CONFIGURED: Final = 240.0
_PITCH: Final = 100.0
"""Travel from one zero mark of the wheel to the next; there is one where the load is at 0, mm."""


def _prepare(
    ctx: CaseContext, mark: int, direction: str, *, side: bool = True, encoder: str = "wheel"
) -> Part:
    """Configure passive homing, home directly, and enable."""
    part = Part(ctx, encoder)
    part.object.variables.write_start("Sensor.PassiveHoming.Mode", mark)
    ctx.wait_until(part.object.reset(restart=True).done, 2.0, "the object is restarted")
    part.object.write("Sensor.PassiveHoming.Direction", int(direction == "negative"))
    part.object.write("Sensor.PassiveHoming.SideInput", side)
    part.object.write("Homing.HomePosition", _CONFIGURED)
    ctx.run_for(0.05)
    part.power()
    part.object.home(0.0, mode=13)
    ctx.run_for(0.05)
    return part


def _go_to(ctx: CaseContext, place: float) -> None:
    """Bring the load to a place of the machine, mm."""
    enable(ctx)
    start = float(ctx.bench.config.drive[drive_name(ctx)].mechanics.start_position_mm)
    move(ctx, place - start, 400.0)


def _homed_at(ctx: CaseContext, part: Part, job: Any, place: float, *, mode: int, allowed_mm: float) -> None:
    """Expect the object homed where the load was at `place`, mm, at the position of its mode."""
    at_mark = _CONFIGURED if mode == 10 else _POSITION
    scale = part.kind.unit_per_mm
    expected = (at_mark + scale * (part.load_mm - place)) % part.kind.modulo
    shown = part.object.var("ActualPosition")
    away = (shown - expected + 0.5 * part.kind.modulo) % part.kind.modulo - 0.5 * part.kind.modulo
    ctx.measure(
        "distance from the mark",
        abs(away) / scale,
        "mm",
        high=allowed_mm,
        requirements=("HOM-066" if allowed_mm < 0.1 else "HOM-067",),
    )
    ctx.measure("ReferenceMarkPosition", job.ReferenceMarkPosition, low=at_mark, high=at_mark)
    ctx.measure("Adjusted", part.object.var("StatusSensor.Adjusted"), low=1)
    ctx.expect(
        job_output(job.name, "Done").covers("HOM-125"),
        status_word_bit(5, True, at=ctx.now_s, axis=part.name).covers("HOM-125"),
        status_word_bit(11, False, at=ctx.now_s, axis=part.name).covers("DIA-080"),
    )


def _pass_by(ctx: CaseContext, part: Part, job: Any, sign: int) -> None:
    ctx.axis.move_velocity(sign * _SPEED, Acceleration=1000.0, Deceleration=1000.0, Jerk=0.0)
    ctx.wait_until(job.done, 8.0, "the mark is noticed")
    halt(ctx)
    del part


@CASES.product(
    "zero-mark/{direction}/{mode}",
    parameters={"direction": tuple(_SIGN), "mode": (2, 8, 10)},
    title="the zero mark of the wheel in {direction} direction, Mode {mode}",
    requirements=("HOM-016", "HOM-123", "HOM-124", "HOM-125", "HOM-126", "DIA-080"),
)
def zero_mark(ctx: CaseContext, direction: str, mode: int) -> None:
    """Exact to an increment while the load moves on; Modes 8 and 10 reset the homed state, Mode 2 keeps
    it.
    """
    sign = _SIGN[direction]
    part = _prepare(ctx, ZERO_MARK, direction)
    _go_to(ctx, -30.0 * sign)
    since = ctx.now_s
    ctx.do(f"MC_Home Mode {mode} on {part.name}")
    job = part.object.home(_POSITION, mode=mode)
    ctx.run_for(0.05)
    ctx.expect(
        status_word_bit(5, mode == 2, at=ctx.now_s, axis=part.name).covers("HOM-126"),
        status_word_bit(11, True, at=ctx.now_s, axis=part.name).covers("DIA-080"),
    )
    ctx.do("the load goes the other way, which means nothing")
    move(ctx, -10.0 * sign)
    ctx.measure("Busy", float(job.Busy), low=1.0, requirements=("HOM-124",))
    _pass_by(ctx, part, job, sign)
    _homed_at(ctx, part, job, 0.0, mode=mode, allowed_mm=3.0 * part.kind.resolution / part.kind.unit_per_mm)
    ctx.expect(part.no_alarm(since=since), never_happens(event("alarm.raised", axis_name(ctx)), since=since))


def _allowed_mm(ctx: CaseContext, places: Machine) -> float:
    """Return the way in the time of an input: two cycles and its filter (HOM-067), and how exactly the bench
    knows the edge, mm.
    """
    filter_s = ctx.bench.config.input_filter_s(axis_name(ctx), "home")
    return _SPEED * (2.0 * ctx.bench.cycle_ns * 1e-9 + filter_s) + 2.0 * places.increment


@CASES.product(
    "input/{direction}/{side}",
    parameters={"direction": tuple(_SIGN), "side": ("positive", "negative")},
    title="the {side} edge of the digital input in {direction} direction",
    requirements=("HOM-016", "HOM-061", "HOM-062", "HOM-067", "HOM-130"),
)
def digital_input(ctx: CaseContext, direction: str, side: str) -> None:
    """The edge of that side is the mark, within the way of cycle and filter."""
    places, sign = machine(ctx), _SIGN[direction]
    part = _prepare(ctx, INPUT, direction, side=side == "positive")
    _go_to(ctx, places.cam[0] - 12.0 if sign > 0 else places.cam[1] + 12.0)
    since = ctx.now_s
    ctx.do(f"MC_Home Mode 8 on {part.name}")
    job = part.object.home(_POSITION, mode=8)
    _pass_by(ctx, part, job, sign)
    _homed_at(
        ctx, part, job, places.edge(sign, side == "positive"), mode=8, allowed_mm=_allowed_mm(ctx, places)
    )
    ctx.expect(part.no_alarm(since=since))


@CASES.case("cam-and-zero-mark", requirements=("HOM-016", "HOM-068", "HOM-127"))
def cam_and_zero_mark(ctx: CaseContext) -> None:
    """Marks before the cam mean nothing; the first one after it has been left is taken."""
    places = machine(ctx)
    part = _prepare(ctx, CAM, "positive")
    _go_to(ctx, places.cam[0] - 10.0)
    job = part.object.home(_POSITION, mode=8)
    _pass_by(ctx, part, job, 1)
    expected = ceil(places.leaves_cam(1) / _PITCH) * _PITCH
    _homed_at(ctx, part, job, expected, mode=8, allowed_mm=3.0 * part.kind.resolution / part.kind.unit_per_mm)
    ctx.measure("mark", expected, "mm", low=floor(places.cam[1]), high=places.cam[1] + _PITCH)


@CASES.product(
    "ended/{by}",
    parameters={"by": ("mode-9", "another", "disabled", "alarm", "link", "restart-refused", "direct")},
    title="passive homing of an external encoder is met by {by}",
    requirements=("HOM-134", "HOM-135", "HOM-136", "HOM-137", "HOM-138"),
)
def ended(ctx: CaseContext, by: str) -> None:
    """Mode 9, another passive homing and disabling abort it, an alarm ends it with 16#8001; direct homing and
    a refused restart do not.
    """
    part = _prepare(ctx, ZERO_MARK, "positive")
    job = part.object.home(_POSITION, mode=8)
    ctx.run_for(0.3)
    ctx.measure("Busy", float(job.Busy), low=1.0, requirements=("HOM-137",))
    since = ctx.now_s
    ctx.do(by)
    other: Any = None
    if by == "mode-9":
        other = part.object.home(0.0, mode=9)
    elif by == "another":
        other = part.object.home(0.0, mode=10)
    elif by == "disabled":
        part.object.power(False)
    elif by == "alarm":
        ctx.inject("encoder.error", part.device, code=0x0001, duration_s=0.1)
    elif by == "link":
        ctx.inject("encoder.power_off", part.device, duration_s=0.2)
    elif by == "restart-refused":
        other = part.object.reset(restart=True)
    else:
        other = part.object.home(5.0, mode=0)
    ctx.run_for(0.3)
    if by in ("mode-9", "another", "disabled"):
        ctx.expect(job_output(job.name, "CommandAborted", since=since).covers("HOM-134", "HOM-136"))
    elif by in ("alarm", "link"):
        ctx.expect(
            job_output(job.name, "Error", since=since, error_id=0x8001),
            part.alarmed(411 if by == "alarm" else 431, since=since),
        )
    else:
        ctx.measure("Busy", float(job.Busy), low=1.0)
    if by == "mode-9":
        ctx.expect(job_output(other.name, "Done", since=since).covers("HOM-134"))
    goes_on = by in ("another", "restart-refused", "direct")
    ctx.expect(status_word_bit(11, goes_on, at=ctx.now_s, axis=part.name).covers("DIA-080"))


@CASES.product(
    "not-started/{why}",
    parameters={"why": ("disabled", "alarm", "no-value", "no-mark-drum", "no-mark-tape")},
    title="passive homing that cannot start: {why}",
    requirements=("HOM-023", "HOM-024", "HOM-138"),
)
def not_started(ctx: CaseContext, why: str) -> None:
    """Not enabled 16#800F, an alarm 16#8001, no valid value 16#8016, an encoder whose bus brings no mark
    411.
    """
    if why.startswith("no-mark"):
        part = Part(ctx, why.rpartition("-")[2])
        part.power()
    else:
        part = _prepare(ctx, ZERO_MARK, "positive")
    since = ctx.now_s
    if why == "disabled":
        part.object.power(False)
    elif why == "alarm":
        ctx.inject("encoder.error", part.device, code=0x0001, duration_s=0.05)
        ctx.run_for(0.1)
        ctx.run_until(lambda: part.object.var("StatusSensor.State") == 2, 1.0)
    elif why == "no-value":
        ctx.inject("encoder.power_off", part.device, duration_s=0.5)
        ctx.run_for(0.1)
    ctx.run_for(0.05)
    job = part.object.home(_POSITION, mode=8)
    ctx.run_for(0.1)
    error_id = {"disabled": 0x800F, "no-value": 0x8016}.get(why, 0x8001)
    ctx.expect(
        part.refused(job, error_id, since=since).covers("HOM-023", "HOM-024", "HOM-138"),
        status_word_bit(11, False, at=ctx.now_s, axis=part.name),
    )
    if why.startswith("no-mark"):
        ctx.expect(part.alarmed(411, since=since))
