"""Synchronous jobs: every running one under every new one, cell by cell of the specification."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from hil.bench import BenchFile, load_bench
from hil.campaign import Campaign, CaseContext
from testcases.campaigns._instruction_outputs import Outputs, Watched
from testcases.campaigns._synchronous import BENCH, Machine, machine
from testcases.campaigns._synchronous_table import LEAVING, RUNNING, SHIFTS, Pair, pairs

WITH_LINE: Final[BenchFile] = load_bench(BENCH).configured(
    {"cam": {"straight": {"interpolation": "linear", "points": [[0.0, 0.0], [2000.0, 1100.0]]}}}
)
"""The bench of synchronous operation with a cam of constant slope."""
CAMPAIGN: Final = Campaign(
    "synchronous jobs",
    tags=("synchronous", "overriding"),
    bench="testcases.campaigns.synchronous_jobs:WITH_LINE",
)
_LEADING: Final = 61.0
"""Velocity of the leading axis, mm/s."""
_FAR: Final = 1500.0
"""Way that no pair of jobs comes to, mm."""
_EMERGENCY: Final = 4000.0
"""Greatest deceleration of the axes of the bench, mm/s2."""
_QUICK: Final = {"Acceleration": 1900.0, "Deceleration": 1700.0, "Jerk": 0.0}


class _Stage:
    """A leading axis that moves on and on, and a follower that pairs of jobs are started on."""

    def __init__(self, ctx: CaseContext) -> None:
        self.ctx = ctx
        self.here: Machine = machine(ctx)
        self.axis = self.here.follower
        self.leader = self.here.leader
        self.outputs = Outputs(ctx)
        self.additive: Any = None
        ctx.wait_until(self.here.lead(_LEADING, **_QUICK).in_velocity, 2.0, "the leading axis moves")

    def back(self) -> None:
        """End whatever runs and make the present place 0 again."""
        axis, ctx = self.axis, self.ctx
        if self.additive is not None:
            self.additive.set(Enable=False)
            self.additive = None
        if axis.var("StatusWord.X1"):
            ctx.run_for(0.2)
            ctx.wait_until(axis.reset().done, 2.0, "the alarm is acknowledged")
            ctx.wait_until(axis.power_instance.status, 3.0, "the axis is enabled again")
        stop = self.outputs.watch(axis.stop(0))
        self.outputs.until(stop, "done", 3.0, "MC_Stop has ended what ran")
        self.outputs.release()
        if axis.var("StatusWord.X28"):
            ctx.wait_until(axis.move_relative(0.1).done, 2.0, "the axis is position-controlled again")
        ctx.wait_until(axis.home(0.0).done, 1.0, "the place is 0")

    # -- jobs ------------------------------------------------------------------------------------------------

    def synchronous(self, job: str) -> Watched:
        """Start a gear or cam and wait until the axis is synchronous."""
        watched = self.outputs.watch(self.start(job, near=True))
        self.outputs.until(watched, "success", 3.0, "the axis is synchronous")
        return watched

    def run(self, running: str, new: str, *, early: bool) -> Watched:
        """Start a running job; `early`: an entry is not synchronous yet when the new job comes."""
        if running in SHIFTS:
            self.synchronous("gear-in-pos")
            return self._called(self.start(running, near=False))
        if running in LEAVING:
            self.synchronous("cam-in" if running.startswith("cam") else "gear-in-pos")
            return self._called(self.leave(running, soft=True))
        if running == "additive":
            if new in SHIFTS or new in LEAVING:
                self.synchronous("cam-in" if new.startswith("cam") else "gear-in-pos")
            self.additive = self.start(running, near=False)
            return self._called(self.additive)
        needs_it = new in SHIFTS or new in LEAVING
        if running.endswith("-waiting") or (early and not needs_it):
            return self._called(self.start(running, near=False))
        return self.synchronous(running)

    def _called(self, instance: Any) -> Watched:
        watched = self.outputs.watch(instance)
        self.outputs.calls(5)
        return watched

    def leave(self, job: str, *, soft: bool) -> Any:
        """Leave the leading value so softly that it lasts, or to a place that the axis comes to at once; or
        wait for a place far away.
        """
        axis = self.axis
        velocity, braking = axis.var("Velocity"), 60.0 if soft else 900.0
        place = axis.var("Position") + velocity * (0.5 * velocity / braking + 1.5 * 0.004)
        start = axis.cam_out if job.startswith("cam") else axis.gear_out
        far = _FAR if job.endswith("-waiting") else 0.0
        return start(place + far, SyncProfileReference=0, Deceleration=braking, Jerk=0.0)

    def start(self, job: str, *, near: bool) -> Any:
        """Start a job; `near`: one that synchronises does so within a few cycles."""
        axis, leader = self.axis, self.leader
        x, y = leader.var("Position"), axis.var("Position")
        way = 4.0 if near else 90.0
        entry = {"SyncProfileReference": 4, "MasterStartDistance": way}
        dynamics = _QUICK if near else {"Acceleration": 110.0, "Deceleration": 90.0, "Jerk": 0.0}
        cam = self.ctx.bench.cam("straight")
        if job in LEAVING:
            return self.leave(job, soft=False)
        makers: dict[str, Callable[[], Any]] = {
            "gear-in": lambda: axis.gear_in(leader, 3, 2, **dynamics),
            "gear-in-velocity": lambda: axis.gear_in_velocity(
                leader, 4, 3, PositionControlled=True, **dynamics
            ),
            "gear-in-velocity-free": lambda: axis.gear_in_velocity(leader, 4, 3, **dynamics),
            "gear-in-pos-waiting": lambda: axis.gear_in_pos(
                leader, x + _FAR, y, 3, 2, MasterStartDistance=9.0
            ),
            "gear-in-pos": lambda: axis.gear_in_pos(leader, x, y, 3, 2, **entry),
            "cam-in-waiting": lambda: axis.cam_in(
                leader, cam, MasterOffset=x + _FAR, MasterStartDistance=9.0
            ),
            "cam-in": lambda: axis.cam_in(leader, cam, MasterOffset=x - 1.0, SlaveOffset=y, **entry),
            "additive": lambda: axis.leading_value_additive(0.0),
            "homing-3": lambda: axis.home(3.0, mode=3),
            "homing-5": lambda: axis.home(mode=5),
            "halt": lambda: axis.halt(Deceleration=300.0, Jerk=0.0),
            "halt-basic": lambda: axis.halt(Mode=1, Deceleration=300.0, Jerk=0.0),
            "absolute": lambda: axis.move_absolute(y - 71.0, Velocity=83.0, **_QUICK),
            "relative": lambda: axis.move_relative(-43.0, Velocity=57.0, **_QUICK),
            "absolute-buffered": lambda: axis.move_absolute(y - 71.0, Velocity=83.0, BufferMode=1),
            "relative-buffered": lambda: axis.move_relative(43.0, Velocity=57.0, BufferMode=1),
            "velocity": lambda: axis.move_velocity(-53.0, **_QUICK),
            "jog": lambda: axis.jog(47.0, backward=True, **_QUICK),
            "stop": lambda: axis.stop(0),
            "superimposed": lambda: axis.move_superimposed(21.0, VelocityDiff=17.0),
            "halt-superimposed": axis.halt_superimposed,
            "motion-in-velocity": lambda: axis.motion_in_velocity(axis.var("Velocity")),
            "motion-in-position": lambda: axis.motion_in_position(y, Velocity=axis.var("Velocity")),
            "motion-in-superimposed": lambda: axis.motion_in_superimposed(0.0),
            "phasing-absolute": lambda: axis.phasing_absolute(7.0, ProfileReference=1, PhasingDistance=_FAR),
            "phasing-relative": lambda: axis.phasing_relative(8.0, ProfileReference=1, PhasingDistance=_FAR),
            "offset-absolute": lambda: axis.offset_absolute(5.0, _FAR),
            "offset-relative": lambda: axis.offset_relative(6.0, _FAR),
        }
        return makers[job]()


def _identifiers(running: str) -> tuple[str, ...]:
    return tuple(dict.fromkeys(pair.identifier for pair in pairs(running)))


@CAMPAIGN.product(
    "over/{running}",
    parameters={"running": RUNNING},
    title="every new job over {running}",
    requirements=_identifiers,
)
def over(ctx: CaseContext, running: str) -> None:
    """Each new job does to the running one what the table says, and becomes itself what the table says."""
    stage = _Stage(ctx)
    for number, pair in enumerate(pairs(running)):
        _try(stage, running, pair, early=number % 2 == 1, held=number % 4 < 2)
        stage.back()


def _try(on: _Stage, running: str, pair: Pair, *, early: bool, held: bool) -> None:
    ctx, outputs = on.ctx, on.outputs
    words = f"{pair.new} over {running}"
    ctx.do(words)
    first = on.run(running, pair.new, early=early)
    ctx.require(first.last.busy, f"{running} is busy when {pair.new} comes")
    if not held and "Execute" in first.instance.inputs:
        first.lower()
        outputs.calls(1)
    velocity = on.axis.var("Velocity")
    made = on.start(pair.new, near=not early)
    if pair.new == "additive":
        on.additive = made
    second = outputs.watch(made)
    outputs.calls(4)
    aborted = any(_ended(first, number) for number in range(-4, 0))
    ctx.measure(
        f"{words}: the running job shows {' / '.join(call.text for call in first.calls[-4:])}",
        float(aborted is pair.aborts and not any(call.error for call in first.calls[-4:])),
        low=1.0,
        requirements=(pair.identifier, pair.words),
    )
    _new_one(ctx, words, second, pair)
    if pair.fate == "T" and pair.aborts:
        step = abs(on.axis.var("Velocity") - velocity)
        ctx.measure(
            f"{words}: change of the velocity setpoint",
            step,
            "mm/s",
            high=_EMERGENCY * 6 * ctx.bench.cycle_ns * 1e-9,
            requirements=("OVR-008",),
        )


def _ended(watched: Watched, number: int) -> bool:
    """Return whether a call shows that another job has ended this one: `MC_LeadingValueAdditive` shows it by
    `Busy` alone.
    """
    call = watched.calls[number]
    if "Execute" in watched.instance.inputs:
        return call.aborted
    return call.level and not call.busy and not call.error


def _new_one(ctx: CaseContext, words: str, one: Watched, pair: Pair) -> None:
    """Judge what has become of the new job."""
    last = one.last
    starts = any(getattr(one.instance, name, False) for name in ("StartSync", "StartSyncOut"))
    good = {
        "T": (last.busy and last.active is not False) or last.done,
        "P": last.busy or last.done,
        "W": last.busy and not last.active and not starts and not last.success,
        "R": one.calls[0].error and pair.error_id in {0, last.error_id},
        "D": any(call.done for call in one.calls),
    }[pair.fate]
    ctx.measure(
        f"{words}: the new job shows {last.text}", float(good), low=1.0, requirements=(pair.identifier,)
    )
