"""What the campaigns about synchronous operation share: the machine of the bench `synchronous`, and bringing
a follower into a phase of a synchronous job.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from hil.campaign import CaseContext
from hil.errors import BlockedError
from hil.expect import alarm, no_alarm, standstill, status_word_bit
from hil.record import EventSelector, event

BENCH: Final = "synchronous"
LEADER, FOLLOWER, LAST = "leader", "follower_a", "follower_b"
"""The axes of the bench: the last one may follow both others."""
MATERIAL: Final = "material"
"""The external encoder on the machine of the leading axis."""
SPEED: Final = 100.0
"""Velocity of the leading axis, mm/s."""
DISTANCE: Final = 40.0
"""Way of the leading value over which the axis synchronises and desynchronises, mm."""
SYNCHRONISING, SYNCHRONOUS, DESYNCHRONISING = (0, 21), (0, 22), (2, 1)
"""Bits of the phases: 0 for `StatusWord`, 2 for `StatusWord2`, and the number (SYN-047, SYN-048)."""

PHASES: Final = {
    "waiting": "while the job waits for its leading value",
    "synchronising": "while the axis synchronises",
    "synchronous": "while the axis is synchronous",
    "desynchronising": "while the axis leaves its leading value",
}
FUNCTIONS: Final = {
    "gear-in": "MC_GearIn 1:2",
    "gear-in-pos": "MC_GearInPos 1:2",
    "gear-in-velocity": "MC_GearInVelocity 1:2",
    "cam-in": "MC_CamIn",
}
WAITING: Final = ("gear-in-pos", "cam-in")
"""Functions that wait for their leading value; the others synchronise at once and leave by no place."""
OUTPUT: Final = {
    "gear-in": "InGear",
    "gear-in-pos": "InSync",
    "gear-in-velocity": "InSync",
    "cam-in": "InSync",
}


@dataclass
class Machine:
    """The axes of the bench, enabled and homed."""

    ctx: CaseContext
    leader: Any
    follower: Any

    def lead(self, velocity: float = SPEED, **inputs: Any) -> Any:
        """Let the leading axis move; returns its job."""
        self.ctx.do(f"MC_MoveVelocity {velocity:g} mm/s on the leading axis")
        return self.leader.move_velocity(velocity, **inputs)

    def follow(self, function: str, leader: Any = None, *, at: float = 100.0, **inputs: Any) -> Any:
        """Start a synchronous job of the follower; with a synchronous position at `at` where there is one."""
        ctx, follower = self.ctx, self.follower
        leader = self.leader if leader is None else leader
        ctx.do(f"{FUNCTIONS[function]} behind {leader.name}")
        match function:
            case "gear-in":
                return follower.gear_in(leader, 1, 2, **inputs)
            case "gear-in-velocity":
                return follower.gear_in_velocity(leader, 1, 2, PositionControlled=True, **inputs)
            case "gear-in-pos":
                return follower.gear_in_pos(leader, at, 20.0, 1, 2, MasterStartDistance=DISTANCE, **inputs)
        return follower.cam_in(
            leader,
            ctx.bench.cam("swing"),
            MasterOffset=at - 50.0,
            MasterSyncPosition=50.0,
            MasterStartDistance=DISTANCE,
            ApplicationMode=1,
            **inputs,
        )

    def position(self, axis: Any) -> float:
        """Return the setpoint of an axis, its unit."""
        return float(axis.var("Position"))


def machine(ctx: CaseContext, *, interpolated: bool = True) -> Machine:
    """Return the machine with all axes enabled and homed at 0, and both cams interpolated.

    Raises:
        BlockedError: The bench has no such axes.

    """
    for name in (LEADER, FOLLOWER, LAST):
        if name not in ctx.bench.axis_names:
            raise BlockedError(f"the case needs the axes of the bench {BENCH}: there is no {name}")
    axes = [ctx.bench.axis(name) for name in (LEADER, FOLLOWER, LAST)]
    powers = [axis.power() for axis in axes]
    ctx.wait_until(lambda: all(power.Status for power in powers), 3.0, "all axes are enabled")
    homes = [axis.home(0.0) for axis in axes]
    cams = [ctx.bench.cam(name).interpolate() for name in ctx.bench.cam_names] if interpolated else []
    ctx.wait_until(
        lambda: all(job.Done for job in (*homes, *cams)), 1.0, "all are homed, the cams interpolated"
    )
    ctx.run_for(0.02)
    return Machine(ctx, axes[0], axes[1])


def bring(ctx: CaseContext, here: Machine, function: str, phase: str) -> Any:
    """Bring the follower into a phase of a function behind a leading axis at constant velocity; returns the
    job of the phase.

    Raises:
        BlockedError: The function has no such phase.

    """
    if phase in ("waiting", "desynchronising") and function not in WAITING:
        raise BlockedError(f"{FUNCTIONS[function]} has no phase {phase!r}")
    if phase == "synchronising" and function not in WAITING:
        ctx.wait_until(here.lead().in_velocity, 2.0, "the leading axis has its velocity")
        job = here.follow(function, Acceleration=200.0, Jerk=0.0)
        ctx.run_for(0.1)
        _expect_phase(ctx, here, SYNCHRONISING)
        return job
    job = here.follow(function)
    here.lead()
    if phase == "waiting":
        ctx.run_for(0.3)
        ctx.measure(f"{job.name} waits", float(job.Busy and not job.StartSync), low=1.0)
        return job
    if phase == "synchronising":
        ctx.wait_until(lambda: job.StartSync, 3.0, "synchronising begins")
        ctx.run_for(0.1)
        _expect_phase(ctx, here, SYNCHRONISING)
        return job
    ctx.wait_until(lambda: getattr(job, OUTPUT[function]), 3.0, "the axis is synchronous")
    ctx.run_for(0.1)
    if phase == "synchronous":
        _expect_phase(ctx, here, SYNCHRONOUS)
        return job
    leave = here.follower.cam_out if function == "cam-in" else here.follower.gear_out
    place = 10.0 if function == "cam-in" else here.position(here.follower) + 40.0
    ctx.do(f"leave to {place:g} mm")
    out = leave(place, MasterStopDistance=DISTANCE)
    ctx.wait_until(lambda: out.StartSyncOut, 3.0, "desynchronising begins")
    ctx.run_for(0.1)
    _expect_phase(ctx, here, DESYNCHRONISING)
    return out


def _expect_phase(ctx: CaseContext, here: Machine, bit: tuple[int, int]) -> None:
    """Expect the bit of a phase now (SYN-047, SYN-048)."""
    word = "status_word2" if bit[0] else "status_word"
    ctx.expect(status_word_bit(bit[1], True, at=ctx.now_s, axis=here.follower.name, word=word))


def stays_in_gear(ctx: CaseContext, here: Machine, ratio: float, name: str) -> Callable[[], None]:
    """Note where both axes are; the function returned measures what the follower is off the ratio since."""
    x, y = here.position(here.leader), here.position(here.follower)

    def judge() -> None:
        moved, followed = here.position(here.leader) - x, here.position(here.follower) - y
        ctx.measure(name, abs(followed - ratio * moved), "mm", high=1e-6)

    return judge


def lost(
    ctx: CaseContext, here: Machine, job: Any, *, number: int, reaction: int, since: EventSelector
) -> None:
    """Expect the follower to have lost its synchronism by an alarm, not to come back by itself, and the
    leading axis to go on (SYN-295, SYN-303).
    """
    name = here.follower.name
    ctx.expect(alarm(number, reaction=reaction, since=since, axis=name).covers("SYN-295"))
    ctx.measure(f"ErrorID of {job.name}", job.ErrorID, low=0x8001, high=0x8001, requirements=("SYN-295",))
    ctx.expect(
        status_word_bit(22, False, at=ctx.now_s, axis=name).covers("SYN-303"),
        no_alarm(since=since, axis=here.leader.name),
        standstill(by=ctx.now_s - 0.2, axis=name),
    )
    ctx.measure("velocity of the leading axis", here.leader.var("Velocity"), "mm/s", low=SPEED, high=SPEED)


def applied() -> EventSelector:
    """Return the moment of the fault."""
    return event("fault.applied")
