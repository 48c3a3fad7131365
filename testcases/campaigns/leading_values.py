"""Leading values: setpoints, actual values, external encoders and their faults; leading axes that stand, turn
round, wrap, or are not position-controlled.
"""

from __future__ import annotations

from math import copysign
from typing import Any, Final

from hil.bench import BenchFile, load_bench
from hil.campaign import Campaign, CaseContext
from hil.expect import alarm, follows, happens, no_alarm, standstill
from hil.record import event
from testcases.campaigns._synchronous import (
    BENCH,
    DISTANCE,
    FOLLOWER,
    LAST,
    LEADER,
    MATERIAL,
    SPEED,
    Machine,
    applied,
    bring,
    machine,
)

ACTUAL: Final[BenchFile] = load_bench(BENCH).configured(
    {"axis": {FOLLOWER: {"coupling": {LEADER: "actual"}}}}
)
"""The bench whose first follower takes the actual value of the leading axis."""
_MODULO: Final = {
    "Modulo.Enable": True, "Modulo.StartValue": 0.0, "Modulo.Length": 40.0,
}  # fmt: skip
MODULO: Final[BenchFile] = load_bench(BENCH).configured({"axis": {LEADER: {"variables": _MODULO}}})
"""The bench whose leading axis counts from 0 to 40 mm, again and again."""
PROXY: Final = "line"
"""The leading-axis proxy of the second controller."""
_TOLERANCE_S: Final = 0.02
"""Time for which the proxy bridges an outage, s."""
ACROSS: Final[BenchFile] = load_bench(BENCH).configured(
    {
        "controller": {"plc2": {"phase_us": 1000}},
        "proxy": {
            PROXY: {
                "axis": LEADER,
                "plc": "plc2",
                "variables": {"Parameter.ToleranceTimeExternalLeadingValueInvalid": _TOLERANCE_S},
            }
        },
        "axis": {FOLLOWER: {"plc": "plc2", "leading": [PROXY]}, LAST: {"leading": [LEADER]}},
    }
)
"""The bench whose first follower belongs to a second controller, behind a proxy."""
_HERE: Final = "testcases.campaigns.leading_values"

CAMPAIGN: Final = Campaign("leading values", tags=("synchronous",), bench=BENCH)
COUPLINGS: Final = Campaign("leading actual values", tags=("synchronous",), bench=f"{_HERE}:ACTUAL")
RANGES: Final = Campaign("leading modulo values", tags=("synchronous",), bench=f"{_HERE}:MODULO")
PROXIES: Final = Campaign(
    "leading values across controllers", tags=("synchronous", "fault"), bench=f"{_HERE}:ACROSS"
)


def _behind_material(ctx: CaseContext) -> tuple[Machine, Any, Any]:
    """Let the follower be in gear 1:1 behind the external encoder; returns machine, encoder and job."""
    here = machine(ctx)
    material = ctx.bench.external_encoder(MATERIAL)
    ctx.wait_until(material.power().status, 3.0, "the external encoder is enabled")
    here.lead()
    ctx.run_for(0.3)
    ctx.do("MC_GearIn 1:1 behind the external encoder")
    job = here.follower.gear_in(material, 1, 1)
    ctx.wait_until(job.in_gear, 3.0, "the axis is in gear")
    ctx.run_for(0.2)
    return here, material, job


@CAMPAIGN.case("external-encoder", title="An external encoder leads", requirements=("SYN-020",))
def external_encoder(ctx: CaseContext) -> None:
    """The follower moves as the material does, through changes of its velocity and at standstill."""
    here, _, job = _behind_material(ctx)
    begin = ctx.now_s
    here.lead(150.0)
    ctx.run_for(0.5)
    here.leader.halt()
    ctx.run_for(0.6)
    ctx.measure("InGear", float(job.InGear), low=1.0)
    ctx.expect(
        # The extrapolation overshoots by the time of a change of acceleration.
        follows(FOLLOWER, f"{LEADER}.actual_position", 1.0, since=begin, tolerance=1.0),
        no_alarm(),
    )
    ctx.expect(standstill(by=ctx.now_s - 0.1, axis=FOLLOWER))


@CAMPAIGN.case("encoder/frozen", title="The leading encoder is frozen")
def frozen(ctx: CaseContext) -> None:
    """The leading value stands, and the follower with it, in gear, though the material runs on."""
    here, _, job = _behind_material(ctx)
    ctx.inject("encoder.freeze", "scale")
    ctx.run_for(0.5)
    ctx.measure("InGear", float(job.InGear), low=1.0)
    ctx.expect(no_alarm(since=applied()), standstill(by=ctx.now_s - 0.2, axis=FOLLOWER))
    ctx.measure("velocity of the leading axis", here.leader.var("Velocity"), "mm/s", low=SPEED, high=SPEED)


@CAMPAIGN.case("encoder/back", title="A frozen leading encoder comes back", requirements=("SYN-307",))
def back(ctx: CaseContext) -> None:
    """The leading value jumps, the follower cannot, and says so with alarm 521; it stays where it stops."""
    _, _, job = _behind_material(ctx)
    ctx.inject("encoder.freeze", "scale", duration_s=0.3)
    ctx.run_for(1.0)
    ctx.expect(alarm(521, reaction=4, since=event("fault.removed"), axis=FOLLOWER).covers("SYN-307"))
    ctx.measure(f"ErrorID of {job.name}", job.ErrorID, low=0x8001, high=0x8001)
    ctx.expect(standstill(by=ctx.now_s - 0.2, axis=FOLLOWER))


@CAMPAIGN.case("encoder/jump", title="The leading encoder jumps", requirements=("SYN-307",))
def jump(ctx: CaseContext) -> None:
    """A step of 20 mm of the leading value is more than the follower permits: alarm 521."""
    _, _, job = _behind_material(ctx)
    ctx.inject("encoder.jump", "scale", increments=20_000)
    ctx.run_for(0.5)
    ctx.expect(alarm(521, reaction=4, since=applied(), axis=FOLLOWER).covers("SYN-307"))
    ctx.measure(f"ErrorID of {job.name}", job.ErrorID, low=0x8001, high=0x8001)


@CAMPAIGN.case("encoder/noise", title="The leading encoder is noisy")
def noise(ctx: CaseContext) -> None:
    """Noise of 8 um leaves the follower in gear and within a tenth of a millimetre of the material."""
    _, _, job = _behind_material(ctx)
    begin = ctx.now_s
    ctx.inject("encoder.noise", "scale", increments=8)
    ctx.run_for(1.0)
    ctx.measure("InGear", float(job.InGear), low=1.0)
    ctx.expect(
        no_alarm(since=applied()),
        follows(FOLLOWER, f"{LEADER}.actual_position", 1.0, since=begin, tolerance=0.3),
    )


@CAMPAIGN.case("encoder/backwards", title="The leading encoder counts backwards")
def backwards(ctx: CaseContext) -> None:
    """The follower turns round with its leading value, in gear: nobody can know better."""
    _, _, job = _behind_material(ctx)
    ctx.inject("encoder.reverse", "scale")
    ctx.run_for(0.5)
    ctx.measure("InGear", float(job.InGear), low=1.0)
    ctx.measure("velocity", job.axis.var("Velocity"), "mm/s", low=-SPEED - 1.0, high=-SPEED + 1.0)


@CAMPAIGN.product(
    "encoder/lost/{kind}",
    parameters={"kind": ("encoder.power_off", "encoder.alarm", "encoder.heartbeat_loss")},
    title="The leading encoder is lost: {kind}",
    requirements=("SYN-294",),
)
def encoder_lost(ctx: CaseContext, kind: str) -> None:
    """Without a valid leading value alarm 601 stops the follower with maximum dynamics."""
    _, _, job = _behind_material(ctx)
    ctx.inject(kind, "scale", duration_s=0.5)
    ctx.run_for(1.5)
    ctx.expect(
        happens(event("alarm.raised", MATERIAL), since=applied()),
        alarm(601, reaction=2, since=applied(), axis=FOLLOWER).covers("SYN-294"),
        standstill(by=ctx.now_s - 0.2, axis=FOLLOWER),
    )
    ctx.measure(f"ErrorID of {job.name}", job.ErrorID, low=0x8001, high=0x8001)


@CAMPAIGN.product(
    "reversal/{phase}",
    parameters={"phase": ("waiting", "synchronising", "synchronous", "desynchronising")},
    title="The leading axis turns round: {phase}",
    requirements=("SYN-312",),
)
def reversal(ctx: CaseContext, phase: str) -> None:
    """On the way to or from the synchronous position it is alarm 608, before and in between it is none."""
    here = machine(ctx)
    job = bring(ctx, here, "gear-in-pos", phase)
    since = ctx.now_s
    here.lead(-SPEED, Acceleration=2000.0, Deceleration=2000.0, Jerk=0.0)
    ctx.run_for(0.4)
    if phase in ("synchronising", "desynchronising"):
        ctx.expect(alarm(608, reaction=2, since=since, axis=FOLLOWER).covers("SYN-312"))
        ctx.measure(f"ErrorID of {job.name}", job.ErrorID, low=0x8001, high=0x8001)
    else:
        ctx.expect(no_alarm(since=since).covers("SYN-312"))
        ctx.measure(f"{job.name} goes on", float(job.Busy), low=1.0)


@CAMPAIGN.product(
    "standing/{phase}",
    parameters={"phase": ("waiting", "synchronising", "synchronous", "desynchronising")},
    title="The leading axis stands for a while: {phase}",
    requirements=("SYN-210",),
)
def standing(ctx: CaseContext, phase: str) -> None:
    """The follower stands as well, without an alarm, and everything goes on with the leading axis."""
    here = machine(ctx)
    job = bring(ctx, here, "gear-in-pos", phase)
    ctx.wait_until(here.leader.halt(Deceleration=2000.0, Jerk=0.0).done, 2.0, "the leading axis stands")
    ctx.run_for(0.3)
    ctx.expect(standstill(by=ctx.now_s - 0.1, until=ctx.now_s, axis=FOLLOWER), no_alarm())
    ctx.measure(f"{job.name} is busy", float(job.Busy), low=1.0)
    here.lead()
    if phase == "desynchronising":
        ctx.wait_until(job.done, 3.0, "the axis is desynchronised")
        return
    ctx.wait_until(lambda: job.InSync, 3.0, "the axis is synchronous")
    ctx.run_for(0.1)
    off = here.position(here.follower) - 20.0 - 0.5 * (here.position(here.leader) - 100.0)
    ctx.measure("position off that of the gear", abs(off), "mm", high=1e-6)


@RANGES.product(
    "modulo/{function}",
    parameters={"function": ("gear-in", "gear-in-pos", "cam-in")},
    title="The leading value passes the edge of its modulo range",
    requirements=("SYN-024",),
)
def modulo(ctx: CaseContext, function: str) -> None:
    """The follower sees a continuous leading value: its velocity is that of the ratio in every cycle."""
    here = machine(ctx)
    if function == "gear-in-pos":
        job = here.follower.gear_in_pos(here.leader, 10.0, 5.0, 1, 2, MasterStartDistance=DISTANCE)
    elif function == "cam-in":
        job = here.follower.cam_in(
            here.leader, ctx.bench.cam("step"), MasterScaling=0.4, ApplicationMode=2, SyncProfileReference=2
        )
    else:
        job = here.follower.gear_in(here.leader, 1, 2)
    here.lead()
    ctx.wait_until(lambda: getattr(job, "InSync", False) or getattr(job, "InGear", False), 3.0, "synchronous")
    ctx.run_for(0.3)
    before, fastest, turns = here.position(here.follower), 0.0, 0.0
    last = here.position(here.leader)
    for _ in range(250):
        ctx.run_for(0.004)
        now, x = here.position(here.follower), here.position(here.leader)
        fastest, before = max(fastest, abs(now - before)), now
        turns, last = turns + float(x < last), x
    ctx.measure("edges passed", turns, low=2.0, high=3.0)
    # The cam moves by 1.76 * 40 / 32 of the leading value at most (modified sine), the gear by a half.
    most = 0.4 * (1.76 * 40.0 / 32.0 if function == "cam-in" else 0.5)
    ctx.measure(
        "greatest step of a cycle", fastest, "mm", low=0.9 * most, high=1.01 * most, requirements=("SYN-024",)
    )


@COUPLINGS.case(
    "actual/pushed",
    title="A disabled leading axis is pushed, coupling of actual values",
    requirements=("SYN-027",),
)
def pushed(ctx: CaseContext) -> None:
    """The follower stays synchronous behind the actual value, and goes where the leading axis is pushed."""
    here = machine(ctx)
    job = here.follower.gear_in(here.leader, 1, 1)
    here.lead(50.0)
    ctx.wait_until(job.in_gear, 3.0, "the axis is in gear")
    here.leader.power(False)
    ctx.run_for(0.6)
    begin, place = ctx.now_s, here.position(here.follower)
    ctx.inject("mechanics.load_step", "leader_drive", force_N=60.0, duration_s=0.5)
    ctx.run_for(0.5)
    ctx.measure("InGear", float(job.InGear), low=1.0, requirements=("SYN-027",))
    ctx.measure("way of the follower", here.position(here.follower) - place, "mm", low=1.0)
    ctx.expect(
        follows(FOLLOWER, LEADER, 1.0, since=begin, tolerance=1.0).covers("SYN-027"), no_alarm(axis=FOLLOWER)
    )


@CAMPAIGN.case(
    "not-controlled", title="The leading axis is not position-controlled", requirements=("SYN-025",)
)
def not_controlled(ctx: CaseContext) -> None:
    """Behind setpoints it is alarm 603, and the follower is disabled."""
    here = machine(ctx)
    here.lead(PositionControlled=False)
    ctx.run_for(0.3)
    since = ctx.do("MC_GearIn behind an axis without position control")
    job = here.follower.gear_in(here.leader, 1, 1)
    ctx.run_for(0.2)
    ctx.expect(alarm(603, reaction=4, since=since, axis=FOLLOWER).covers("SYN-025"))
    ctx.measure(f"ErrorID of {job.name}", job.ErrorID, low=0x8001, high=0x8001)


@CAMPAIGN.case(
    "not-interconnected", title="An axis that is no possible leading axis", requirements=("SYN-310",)
)
def not_interconnected(ctx: CaseContext) -> None:
    """The last follower may follow the first, not the other way round: alarm 601."""
    here = machine(ctx)
    since = ctx.do("MC_GearIn behind an axis that is not interconnected")
    job = here.follower.gear_in(ctx.bench.axis("follower_b"), 1, 1)
    ctx.run_for(0.2)
    ctx.expect(alarm(601, reaction=2, since=since, axis=FOLLOWER).covers("SYN-310"))
    ctx.measure(f"ErrorID of {job.name}", job.ErrorID, low=0x8001, high=0x8001)


# -- across controllers
# --------------------------------------------------------------------------------------------


def _behind_proxy(ctx: CaseContext, phase: str = "synchronous") -> tuple[Machine, Any]:
    """Bring the follower into a phase behind the proxy, at constant velocity; returns machine and job."""
    here = machine(ctx)
    line = ctx.bench.proxy(PROXY)
    job = here.follow("gear-in-pos", line)
    here.lead()
    if phase == "waiting":
        ctx.run_for(0.3)
        return here, job
    ctx.wait_until(lambda: job.StartSync or job.InSync, 3.0, "synchronising begins")
    ctx.run_for(0.1)
    if phase == "synchronising":
        return here, job
    ctx.wait_until(job.in_sync, 3.0, "the axis is synchronous")
    ctx.run_for(0.1)
    if phase == "synchronous":
        return here, job
    out = here.follower.gear_out(here.position(here.follower) + 40.0, MasterStopDistance=DISTANCE)
    ctx.wait_until(lambda: out.StartSyncOut, 3.0, "desynchronising begins")
    ctx.run_for(0.1)
    return here, out


def _expect_lost(ctx: CaseContext, here: Machine, job: Any, number: int) -> None:
    """Expect an alarm of the proxy, 601 at its follower, which stands then, and the leading axis to go on."""
    ctx.expect(
        alarm(number, reaction=13, since=applied(), axis=PROXY).covers("SYN-314"),
        alarm(601, reaction=2, since=applied(), axis=FOLLOWER).covers("SYN-073"),
        no_alarm(since=applied(), axis=LEADER),
    )
    speed = abs(here.follower.var("ActualVelocity"))
    ctx.measure("velocity of the follower", speed, "mm/s", high=1.0, requirements=("SYN-073",))
    ctx.measure(f"ErrorID of {job.name}", job.ErrorID, low=0x8001, high=0x8001, requirements=("SYN-073",))
    ctx.measure("velocity of the leading axis", here.leader.var("Velocity"), "mm/s", low=SPEED, high=SPEED)


@PROXIES.product(
    "outage/{fault}/{phase}",
    parameters={
        "fault": ("lost", "invalid"),
        "phase": ("waiting", "synchronising", "synchronous", "desynchronising"),
    },
    title="No valid telegrams for long ({fault}), {phase}",
    requirements=("SYN-073", "SYN-314", "SYN-357"),
)
def outage(ctx: CaseContext, fault: str, phase: str) -> None:
    """Alarm 900 after the tolerance time, 601 at the follower in whatever phase it is; acknowledged, it
    follows again.
    """
    here, job = _behind_proxy(ctx, phase)
    ctx.inject(f"proxy.{fault}", PROXY, duration_s=0.5)
    ctx.run_for(0.8)
    _expect_lost(ctx, here, job, 900)
    line = ctx.bench.proxy(PROXY)
    for one in (line, here.follower):
        ctx.wait_until(one.reset().done, 1.0, f"{one.name} is acknowledged")
    ctx.run_for(0.02)
    ctx.wait_until(here.follower.gear_in(line, 1, 2).in_gear, 3.0, "the axis is in gear again")


@PROXIES.product(
    "bridged/{fault}",
    parameters={"fault": ("lost", "invalid")},
    title="Telegrams are missing for less than the tolerance time ({fault})",
    requirements=("SYN-073",),
)
def bridged(ctx: CaseContext, fault: str) -> None:
    """The follower goes on with the last velocity, and is where it has to be afterwards."""
    here, job = _behind_proxy(ctx)
    off = here.position(here.follower) - 0.5 * here.position(here.leader)
    ctx.inject(f"proxy.{fault}", PROXY, duration_s=_TOLERANCE_S - 0.008)
    ctx.run_for(0.3)
    now = here.position(here.follower) - 0.5 * here.position(here.leader)
    ctx.measure("off the gear", abs(now - off), "mm", high=1e-6, requirements=("SYN-073",))
    ctx.measure("InSync", float(job.InSync), low=1.0)
    ctx.expect(no_alarm(since=applied()))


@PROXIES.product(
    "corrupt/{field}",
    parameters={
        "field": ("version", "modulo_start", "modulo_length", "position", "velocity", "acceleration")
    },
    title="Field {field} of the telegrams makes no sense",
    requirements=("SYN-466", "SYN-479"),
)
def corrupt(ctx: CaseContext, field: str) -> None:
    """Alarm 901 at once, with the number of the field."""
    here, job = _behind_proxy(ctx)
    ctx.inject("proxy.corrupt", PROXY, duration_s=0.1, field=field)
    ctx.run_for(0.8)
    _expect_lost(ctx, here, job, 901)


@PROXIES.case("late", title="Telegrams come 8 ms later", requirements=("SYN-392",))
def late(ctx: CaseContext) -> None:
    """The proxy does not know: the follower is behind by the way of two cycles, as long as it lasts."""
    here, job = _behind_proxy(ctx)
    off = here.position(here.follower) - 0.5 * here.position(here.leader)
    armed = ctx.inject("proxy.late", PROXY, delay_ms=8.0)
    ctx.run_for(0.3)
    behind = off - (here.position(here.follower) - 0.5 * here.position(here.leader))
    way = 0.5 * SPEED * 0.008
    ctx.measure("behind the gear", behind, "mm", low=way - 1e-6, high=way + 1e-6, requirements=("SYN-392",))
    armed.remove()
    ctx.run_for(0.3)
    now = here.position(here.follower) - 0.5 * here.position(here.leader)
    ctx.measure("off the gear afterwards", abs(now - off), "mm", high=1e-6)
    ctx.measure("InSync", float(job.InSync), low=1.0)
    ctx.expect(no_alarm(since=applied()))


@PROXIES.product(
    "drift/{sense}",
    parameters={"sense": ("fast", "slow")},
    title="The clock of the second controller runs {sense}, by 0.5 %",
)
def drift(ctx: CaseContext, sense: str) -> None:
    """Its cycle slides along that of the leading controller, through more than a whole one: the follower is
    never off by more than the way of a cycle, and nobody stops.
    """
    _, job = _behind_proxy(ctx)
    begin = ctx.now_s
    ctx.inject("controller.clock_drift", "plc2", drift_ppm=5000.0 if sense == "fast" else -5000.0)
    ctx.run_for(1.5)
    ctx.measure("InSync", float(job.InSync), low=1.0)
    ctx.expect(
        no_alarm(since=applied()),
        follows(FOLLOWER, LEADER, 0.5, since=begin, tolerance=0.5 * SPEED * 0.004 * 2.5),
    )


@PROXIES.case("leader-fails", title="The encoder of the leading axis fails", requirements=("SYN-073",))
def leader_fails(ctx: CaseContext) -> None:
    """Its cycles on the bus are lost: the telegrams say that the value is none, and the follower stops."""
    _, job = _behind_proxy(ctx)
    ctx.inject("can.unplug", node="leader_drive", duration_s=0.4)
    ctx.run_for(1.0)
    ctx.expect(
        alarm(900, reaction=13, since=applied(), axis=PROXY).covers("SYN-314"),
        alarm(601, reaction=2, since=applied(), axis=FOLLOWER).covers("SYN-073"),
        standstill(by=ctx.now_s - 0.2, axis=FOLLOWER),
    )
    ctx.measure(f"ErrorID of {job.name}", job.ErrorID, low=0x8001, high=0x8001)


@PROXIES.product(
    "defective/{phase}",
    parameters={"phase": ("synchronising", "synchronous")},
    title="The leading axis gives no value, {phase}",
    requirements=("SYN-310", "SYN-358"),
)
def defective(ctx: CaseContext, phase: str) -> None:
    """It goes on by itself, but leads no more: 900 at the proxy, 601 at the follower."""
    here, job = _behind_proxy(ctx, phase)
    ctx.inject("axis.no_leading_value", LEADER, duration_s=0.5)
    ctx.run_for(0.8)
    _expect_lost(ctx, here, job, 900)


@CAMPAIGN.product(
    "no-value/{phase}",
    parameters={"phase": ("waiting", "synchronising", "synchronous", "desynchronising")},
    title="The leading axis gives no value, {phase}",
    requirements=("SYN-310", "SYN-358"),
)
def no_value(ctx: CaseContext, phase: str) -> None:
    """Alarm 601 at the follower in whatever phase, which stands then; the leading axis goes on."""
    here = machine(ctx)
    job = bring(ctx, here, "gear-in-pos", phase)
    ctx.inject("axis.no_leading_value", LEADER, duration_s=0.5)
    ctx.run_for(0.8)
    ctx.expect(
        alarm(601, reaction=2, since=applied(), axis=FOLLOWER).covers("SYN-310"),
        no_alarm(since=applied(), axis=LEADER),
        standstill(by=ctx.now_s - 0.2, axis=FOLLOWER),
    )
    ctx.measure(f"ErrorID of {job.name}", job.ErrorID, low=0x8001, high=0x8001)


@CAMPAIGN.product(
    "control-off/{phase}",
    parameters={"phase": ("synchronising", "desynchronising")},
    title="The leading axis leaves position control, {phase}",
    requirements=("SYN-311", "SYN-358"),
)
def control_off(ctx: CaseContext, phase: str) -> None:
    """Alarm 603 at the follower, which is disabled."""
    here = machine(ctx)
    job = bring(ctx, here, "gear-in-pos", phase)
    ctx.inject("axis.position_control_off", LEADER, duration_s=0.5)
    ctx.run_for(0.8)
    ctx.expect(
        alarm(603, reaction=4, since=applied(), axis=FOLLOWER).covers("SYN-311"),
        no_alarm(since=applied(), axis=LEADER),
    )
    ctx.measure(f"ErrorID of {job.name}", job.ErrorID, low=0x8001, high=0x8001)


# -- extrapolation -------------------------------------------------------------------------------------------

_CYCLE_S: Final = 0.004
_DELAY_S: Final = 0.0094
"""Delay of the setpoint that local followers get, no whole number of cycles."""
DIFFERENT: Final[BenchFile] = load_bench(BENCH).configured(
    {
        "axis": {
            LEADER: {
                "variables": {
                    "Extrapolation.Settings.SystemDefinedExtrapolation": 0,
                    "Extrapolation.Settings.ExtrapolatedVelocityMode": 1,
                    "CrossPlcSynchronousOperation.LocalLeadingValueDelayTime": _DELAY_S,
                }
            },
            FOLLOWER: {"coupling": {LEADER: "actual"}},
        }
    }
)
"""The bench whose leading axis gives a delayed setpoint, and a velocity by differences."""
USUAL_VALUES: Final = Campaign("extrapolated values", tags=("synchronous",), bench=f"{_HERE}:ACTUAL")
OTHER_VALUES: Final = Campaign("differentiated values", tags=("synchronous",), bench=f"{_HERE}:DIFFERENT")
_EXTRAPOLATION: Final[tuple[dict[str, float], ...]] = (
    {"FollowingAxisDependentTime": 0.011},
    {"PositionFilter.T1": 0.02, "PositionFilter.T2": 0.007, "FollowingAxisDependentTime": 0.005},
    {"VelocityFilter.T1": 0.03, "VelocityFilter.T2": 0.012},
    {"VelocityTolerance.Range": 9.0, "PositionFilter.T2": 0.013},
    {"Hysteresis.Value": 0.7, "FollowingAxisDependentTime": 0.003},
    {
        "VelocityFilter.T1": 0.01,
        "PositionFilter.T1": 0.006,
        "VelocityTolerance.Range": 4.0,
        "Hysteresis.Value": 0.2,
    },
)
"""Filters, tolerance, hysteresis and times, one set after the other."""


class _LowPass:
    """Two low-passes in series, by backward differences."""

    def __init__(self, value: float) -> None:
        self.first = self.second = value

    def step(self, value: float, t1: float, t2: float) -> float:
        self.first += (value - self.first) * _CYCLE_S / (t1 + _CYCLE_S)
        self.second += (self.first - self.second) * _CYCLE_S / (t2 + _CYCLE_S)
        return self.second


def _extrapolated(ctx: CaseContext, *, system: bool, differences: bool) -> None:
    """Compare the extrapolated value of the leading axis with its formula in every cycle."""
    here = machine(ctx)
    leader = here.leader
    base = float(leader.var("Extrapolation.LeadingAxisDependentTime"))
    ctx.measure(
        "time of the leading axis", base, "s", low=_CYCLE_S, high=4.0 * _CYCLE_S, requirements=("SYN-052",)
    )
    names = sorted({name for row in _EXTRAPOLATION for name in row})
    for row in _EXTRAPOLATION:
        words = ", ".join(f"{name} {value:g}" for name, value in row.items())
        ctx.do(words)
        for name in names:
            leader.write(f"Extrapolation.{name}", 0.0)
        ctx.run_for(0.02)
        for name in names:
            leader.write(f"Extrapolation.{name}", row.get(name, 0.0))
        worst = _compared(ctx, here, row, base, system=system, differences=differences)
        for text, value, identifier in zip(
            ("filtered position", "filtered velocity", "extrapolated position", "extrapolated velocity"),
            worst, ("VAR-189", "SYN-064", "SYN-066", "SYN-067"), strict=True,
        ):  # fmt: skip
            ctx.measure(f"{words}: {text} off its formula", value, high=1e-4, requirements=(identifier,))


def _compared(
    ctx: CaseContext, here: Machine, row: dict[str, float], base: float, *, system: bool, differences: bool
) -> list[float]:
    """Return the greatest deviations of one set of values, while the leading axis turns round."""
    leader = here.leader

    def get(name: str) -> float:
        return row.get(name, 0.0)

    t1, t2 = (get(f"PositionFilter.T{one}") for one in (1, 2))
    v1, v2 = (get(f"VelocityFilter.T{one}") for one in (1, 2))
    width, back = get("VelocityTolerance.Range"), get("Hysteresis.Value")
    time_s = get("FollowingAxisDependentTime") + (base + t1 + t2 if system else 0.0)
    # It stands: everything is settled at the present value.
    ctx.run_for(0.3)
    place, speed = _LowPass(leader.var("ActualPosition")), _LowPass(leader.var("ActualVelocity"))
    band = speed.second
    held = last = place.second + band * time_s
    sense = 0.0
    worst = [0.0] * 4
    for number in range(75):
        if number in {0, 25, 50}:
            here.lead((60.0, -45.0, 0.0)[number // 25], Acceleration=1900.0, Deceleration=1700.0, Jerk=0.0)
        ctx.run_for(_CYCLE_S)
        position, velocity = leader.var("ActualPosition"), leader.var("ActualVelocity")
        filtered = place.step(position, t1 if system else 0.0, t2 if system else 0.0)
        smooth = speed.step(velocity, v1, v2)
        if abs(smooth - band) > 0.5 * width:
            band = smooth - copysign(0.5 * width, smooth - band)
        wanted = filtered + band * time_s
        change = wanted - held
        if change and (change * sense >= 0.0 or abs(change) >= back):
            sense, held = copysign(1.0, change), wanted
        faster = (held - last) / _CYCLE_S if differences else band
        last = held
        names = ("FilteredPosition", "FilteredVelocity", "ExtrapolatedPosition", "ExtrapolatedVelocity")
        shown = [leader.var(f"StatusExtrapolation.{name}") for name in names]
        for at, (value, one) in enumerate(zip((filtered, band, held, faster), shown, strict=True)):
            # Before it has moved, the direction of the last change is not known.
            if at < 2 or number >= 20:
                worst[at] = max(worst[at], abs(value - one))
    return worst


@USUAL_VALUES.case("formula", requirements=("SYN-052", "SYN-064", "SYN-066"))
def extrapolated(ctx: CaseContext) -> None:
    """Filters, tolerance band, hysteresis and times make of the actual value what followers get, in each
    cycle.
    """
    _extrapolated(ctx, system=True, differences=False)


@OTHER_VALUES.case("formula", requirements=("SYN-065", "SYN-067"))
def differentiated(ctx: CaseContext) -> None:
    """Without the times of the leading axis its position is not filtered; the velocity is the change of the
    extrapolated position.
    """
    _extrapolated(ctx, system=False, differences=True)


@OTHER_VALUES.case("delayed", requirements=("SYN-070", "SYN-051"))
def delayed(ctx: CaseContext) -> None:
    """The delayed setpoint is that of the delay ago, between two cycles too."""
    here = machine(ctx)
    here.lead(80.0, Acceleration=900.0, Jerk=0.0)
    given, worst = [], [0.0, 0.0]
    for _ in range(60):
        ctx.run_for(_CYCLE_S)
        given.append((here.position(here.leader), here.leader.var("Velocity")))
        if len(given) < 5:
            continue
        rest = _DELAY_S / _CYCLE_S - 2.0
        older, newer = given[-4], given[-3]
        wanted = [new + (old - new) * rest for old, new in zip(older, newer, strict=True)]
        prefix = "StatusProvidedLeadingValue.DelayedLeadingValue."
        shown = [here.leader.var(f"{prefix}{name}") for name in ("Position", "Velocity")]
        worst = [max(a, abs(b - c)) for a, b, c in zip(worst, wanted, shown, strict=True)]
    ctx.measure("delayed position off its formula", worst[0], "mm", high=1e-6, requirements=("SYN-070",))
    ctx.measure("delayed velocity off its formula", worst[1], "mm/s", high=1e-6, requirements=("SYN-070",))
