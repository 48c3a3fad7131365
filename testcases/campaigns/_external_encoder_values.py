"""Cases of `external_encoder`: what its values say of the machine, and homing without a mark."""

from __future__ import annotations

from typing import Final

from hil.campaign import Campaign, CaseContext
from hil.expect import happens, job_output, status_word_bit
from hil.record import event
from testcases.campaigns._external_encoder import KINDS, Part, halt, move, travel
from testcases.campaigns._reactions import cycles, waited_for_standstill
from testcases.campaigns.support import enable

CASES: Final = Campaign("external encoder", tags=("encoder",), bench="reference")

_SIGN: Final = {"forward": 1.0, "backward": -1.0}


@CASES.product(
    "follows/{encoder}/{direction}",
    parameters={"encoder": tuple(KINDS), "direction": tuple(_SIGN)},
    title="{encoder} while the load goes {direction}",
    requirements=("CFG-016", "CFG-018", "CFG-198", "CFG-094", "VAR-025", "DIA-076", "DIA-081"),
)
def follows(ctx: CaseContext, encoder: str, direction: str) -> None:
    """Position and velocity are those of the load, scaled; the modulo wraps and counts; X7 tells whether it
    stands.
    """
    part = Part(ctx, encoder)
    part.power()
    since = ctx.now_s
    ctx.run_for(0.1)
    ctx.expect(status_word_bit(7, True, at=ctx.now_s, axis=part.name).covers("DIA-081"))
    place, load = part.position, part.load_mm
    velocity = _SIGN[direction] * 200.0
    travel(ctx, velocity)
    scale = part.kind.unit_per_mm
    ctx.measure(
        "velocity",
        part.object.var("ActualVelocity"),
        low=scale * (velocity - 4.0),
        high=scale * (velocity + 4.0),
    )
    ctx.measure(
        "deviation in motion",
        abs(part.position - place - scale * (part.load_mm - load)),
        high=part.tolerance(velocity),
    )
    ctx.expect(status_word_bit(7, False, at=ctx.now_s, axis=part.name).covers("DIA-081"))
    ctx.run_for(0.9)
    stopping = ctx.now_s
    halt(ctx)
    read = part.object.variables.read
    dwell = float(read("StandstillSignal.MinDwellTime"))
    ctx.measure(
        "time below the threshold before X7",
        waited_for_standstill(
            ctx,
            part.name,
            f"{part.name}.velocity",
            float(read("StandstillSignal.VelocityThreshold")),
            since_s=stopping,
        ),
        "s",
        low=dwell,
        high=dwell + cycles(ctx, 2),
        requirements=("DIA-081",),
    )
    ctx.measure("travel", abs(part.load_mm - load), "mm", low=150.0)
    ctx.measure(
        "deviation at rest", abs(part.position - place - scale * (part.load_mm - load)), high=part.tolerance()
    )
    ctx.measure("StatusSensor.State", part.object.var("StatusSensor.State"), low=2, high=2)
    if part.kind.modulo:
        ctx.measure(
            "position in the range", part.object.var("ActualPosition"), low=0.0, high=part.kind.modulo - 1e-9
        )
        ctx.measure("whole turns", abs(part.object.var("ActualModuloCycle")), low=1)
    ctx.expect(part.no_alarm(since=since), status_word_bit(7, True, at=ctx.now_s, axis=part.name))


_HOMING: Final = {
    0: (True, True, 0), 1: (True, True, 0), 6: (False, True, 1), 7: (False, True, 1), 11: (True, True, 0),
    12: (True, True, 0), 13: (True, False, 1),
}  # fmt: skip
"""Mode -> permitted with an incremental encoder, with an absolute one, `Adjusted` afterwards (HOM-017 to
HOM-020).
"""
_RELATIVE: Final = (1, 6, 12)


@CASES.product(
    "homing/{mode}/{encoder}",
    parameters=[
        {"mode": mode, "encoder": encoder}
        for mode in _HOMING
        for encoder in (("wheel", "scale", "drum", "tape") if mode in (0, 7, 13) else ("tape", "drum"))
    ],
    title="MC_Home Mode {mode} on {encoder}",
    tags=("homing",),
    requirements=("HOM-017", "HOM-018", "HOM-019", "HOM-020", "HOM-021", "HOM-139", "HOM-149", "HOM-163"),
)
def homing(ctx: CaseContext, mode: int, encoder: str) -> None:
    """Permitted modes set or shift the position at once, the others are refused and change nothing; disabled
    or not.
    """
    part = Part(ctx, encoder)
    ctx.run_for(0.1)
    since = ctx.now_s
    before = part.position
    incremental, absolute, adjusted = _HOMING[mode]
    job = part.object.home(77.0, mode=mode)
    ctx.run_for(0.05)
    if not (absolute if part.kind.absolute else incremental):
        ctx.expect(part.refused(job, 0x8011 if part.kind.absolute else 0x8010, since=since).covers("HOM-021"))
        ctx.measure("position", part.position, low=before - 1e-9, high=before + 1e-9)
        return
    expected = before + 77.0 if mode in _RELATIVE else 77.0
    shown = part.object.var("ActualPosition")
    wrapped = expected % part.kind.modulo if part.kind.modulo else expected
    ctx.measure(
        "position",
        shown,
        low=wrapped - 1e-6,
        high=wrapped + 1e-6,
        requirements=("HOM-139", "HOM-149", "HOM-163"),
    )
    ctx.measure("Adjusted", part.object.var("StatusSensor.Adjusted"), low=adjusted, high=adjusted)
    ctx.expect(
        job_output(job.name, "Done", since=since),
        happens(event("axis.homed", part.name), since=since),
        status_word_bit(5, True, at=ctx.now_s, axis=part.name).covers("DIA-073"),
        part.no_alarm(since=since),
    )
    enable(ctx)
    moved = part.load_mm
    move(ctx, 30.0)
    ctx.measure(
        "deviation after a motion",
        abs(part.object.var("ActualPosition") - wrapped - part.kind.unit_per_mm * (part.load_mm - moved)),
        high=part.tolerance(),
    )


@CASES.product(
    "refused/{mode}",
    parameters={"mode": (3, 4, 5, 14, -1)},
    title="MC_Home Mode {mode}, which an external encoder does not have",
    tags=("homing",),
    requirements=("HOM-015", "HOM-022", "HOM-005"),
)
def refused(ctx: CaseContext, mode: int) -> None:
    """16#800A, on an enabled object too; the homed state stays as it is."""
    part = Part(ctx, "tape")
    part.power()
    part.object.home(5.0)
    ctx.run_for(0.05)
    since = ctx.now_s
    job = part.object.home(0.0, mode=mode)
    ctx.run_for(0.05)
    ctx.expect(
        part.refused(job, 0x800A, since=since).covers("HOM-022"),
        status_word_bit(5, True, at=ctx.now_s, axis=part.name),
        part.no_alarm(since=since),
    )


@CASES.product(
    "position-out-of-range/{value}",
    parameters={"value": ("nan", "inf", "2e12")},
    title="MC_Home with Position = {value}",
    tags=("homing",),
    requirements=("MC-076",),
)
def position_out_of_range(ctx: CaseContext, value: str) -> None:
    """16#8009, and the position stays."""
    part = Part(ctx, "tape")
    ctx.run_for(0.05)
    since, before = ctx.now_s, part.position
    job = part.object.home(float(value))
    ctx.run_for(0.05)
    ctx.expect(part.refused(job, 0x8009, since=since))
    ctx.measure("position", part.position, low=before, high=before)


@CASES.product(
    "restart/{encoder}",
    parameters={"encoder": tuple(KINDS)},
    title="restart of the technology object of {encoder}",
    requirements=("DIA-075", "VAR-007", "MC-170", "CFG-115"),
)
def restart(ctx: CaseContext, encoder: str) -> None:
    """Refused while enabled (16#800E); disabled it is done, an adjusted absolute encoder keeps its position,
    an incremental one is not homed.
    """
    part = Part(ctx, encoder)
    power = part.power()
    mode = 7 if part.kind.absolute else 13
    part.object.home(55.0, mode=mode)
    ctx.run_for(0.05)
    since = ctx.now_s
    refused_job = part.object.reset(restart=True)
    ctx.run_for(0.1)
    ctx.expect(part.refused(refused_job, 0x800E, since=since).covers("MC-170"))
    power.set(Enable=False)
    ctx.run_for(0.02)
    part.acknowledge()
    done = part.object.reset(restart=True)
    ctx.wait_until(done.done, 2.0, "the object is restarted")
    ctx.run_for(0.1)
    ctx.expect(status_word_bit(5, part.kind.absolute, at=ctx.now_s, axis=part.name).covers("CFG-115"))
    if part.kind.absolute:
        ctx.measure("position", part.position, low=55.0 - 1e-6, high=55.0 + 1e-6)
    ctx.measure("StatusSensor.State", part.object.var("StatusSensor.State"), low=2, high=2)
    part.power()
