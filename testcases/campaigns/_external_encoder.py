"""What the cases of `external_encoder` share: benches with external encoders, the machine behind them, alarms
and recovery.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

from hil.bench import BenchFile, load_bench
from hil.campaign import CaseContext
from hil.expect import Expectation, alarm, job_output, no_alarm
from testcases.campaigns.support import drive_name, enable, settle_s

_ENCODERS: Final = """
[encoder.wheel]
segment = "can0"
node_id = 20
profile = "profidrive"
on = "drive1"
mounting = "load"
type = "incremental_rotary"
steps_per_revolution = 1024
mm_per_revolution = 100.0

[encoder.wheel.profidrive]
telegram = 83
fine_xist1_bits = 8
reference_speed = 600.0

[encoder.scale]
segment = "can0"
node_id = 21
profile = "profidrive"
on = "drive1"
mounting = "load"
type = "absolute_linear"
measuring_step_um = 20.0

[encoder.scale.profidrive]
telegram = 81

[encoder.drum]
segment = "can0"
node_id = 22
on = "drive1"
mounting = "load"
type = "multi_turn"
steps_per_revolution = 8192
mm_per_revolution = 100.0

[encoder.tape]
segment = "can0"
node_id = 23
on = "drive1"
mounting = "load"
type = "incremental_linear"
measuring_step_um = 1.0

[external_encoder.wheel_object]
encoder = "wheel"
drive = "drive1"

[external_encoder.wheel_object.variables]
"Properties.MotionType" = 1
"Modulo.Enable" = true
"Modulo.Length" = 360.0

[external_encoder.scale_object]
encoder = "scale"

[external_encoder.drum_object]
encoder = "drum"

[external_encoder.drum_object.variables]
"Properties.MotionType" = 1

[external_encoder.tape_object]
encoder = "tape"
"""


def bench_with_encoders(name: str) -> BenchFile:
    """Return an embedded bench with four external encoders on the load of its axis."""
    return BenchFile(f"{name} with external encoders", load_bench(name).text + _ENCODERS)


@dataclass(frozen=True)
class Kind:
    """One encoder of the bench."""

    profile: str
    absolute: bool
    unit_per_mm: float
    """Unit of the object per millimetre of the load."""
    resolution: float
    """One increment, unit of the object."""
    modulo: float = 0.0


KINDS: Final = {
    "wheel": Kind("profidrive", False, 3.6, 360.0 / 1024 / 256, modulo=360.0),
    "scale": Kind("profidrive", True, 1.0, 0.02),
    "drum": Kind("cia406", True, 3.6, 360.0 / 8192),
    "tape": Kind("cia406", False, 1.0, 0.001),
}


class Part:
    """One external encoder of the bench: its object, its device, and the load that both are on.

    Raises:
        BlockedError: The bench has no such external encoder.

    """

    def __init__(self, ctx: CaseContext, name: str) -> None:
        self.device = name
        self.name = f"{name}_object"
        self.kind = KINDS[name]
        ctx.require(
            self.name in ctx.bench.external_encoder_names,
            "external encoders, as the benches REFERENCE and PROFIDRIVE of "
            "testcases.campaigns.external_encoder have them",
        )
        self._ctx = ctx
        self.object: Any = ctx.bench.external_encoder(self.name)

    @property
    def load_mm(self) -> float:
        """Place of the load by the true mechanics, mm."""
        return 1000.0 * float(self._ctx.bench.drive(drive_name(self._ctx)).mechanics.position)

    @property
    def position(self) -> float:
        """`ActualPosition` without the modulo, unit of the object."""
        whole = self.kind.modulo * self.object.var("ActualModuloCycle") if self.kind.modulo else 0.0
        return float(self.object.var("ActualPosition") + whole)

    def power(self) -> Any:
        """Enable the object and wait for it; returns the instance."""
        self._ctx.do(f"MC_Power Enable = TRUE on {self.name}")
        power = self.object.power()
        self._ctx.wait_until(power.status, 2.0, f"{self.name} is enabled")
        return power

    def acknowledge(self) -> None:
        """Acknowledge its alarms and wait for it."""
        self._ctx.do(f"MC_Reset on {self.name}")
        self._ctx.wait_until(self.object.reset().done, 2.0, "the alarms are acknowledged")
        self._ctx.run_for(0.05)

    def tolerance(self, velocity: float = 0.0) -> float:
        """Return how far the position may lie from the load, unit of the object: increments, and the way of
        one cycle.
        """
        cycle = float(self._ctx.bench.cycle_ns) * 1e-9
        return 2.0 * self.kind.resolution + 1.2 * abs(velocity) * cycle * self.kind.unit_per_mm + 1e-6

    def alarmed(self, number: int, *, since: Any, within_s: float | None = None) -> Expectation:
        """Expect an alarm of this object with the only reaction that it has (DIA-088)."""
        return alarm(number, reaction=10, since=since, within_s=within_s, axis=self.name).covers("DIA-088")

    def no_alarm(self, *, since: float) -> Expectation:
        """Expect none."""
        return no_alarm(since=since, axis=self.name)

    def refused(self, job: Any, error_id: int, *, since: float) -> Expectation:
        """Expect a job rejected."""
        self._ctx.measure(f"ErrorID of {job.name}", job.ErrorID, low=error_id, high=error_id)
        return job_output(job.name, "Error", since=since, error_id=error_id)


def travel(ctx: CaseContext, velocity: float) -> Any:
    """Enable the axis, which moves the load, and travel; returns the job."""
    enable(ctx)
    ctx.do(f"MC_MoveVelocity {velocity:g} mm/s: the load moves")
    job = ctx.axis.move_velocity(velocity, Acceleration=1000.0, Deceleration=1000.0, Jerk=0.0)
    ctx.wait_until(job.in_velocity, 5.0, "the load moves with constant velocity")
    ctx.run_for(0.05)
    return job


def halt(ctx: CaseContext) -> None:
    """Let the load come to rest."""
    ctx.wait_until(ctx.axis.halt(Deceleration=1000.0, Jerk=0.0).done, 5.0, "the load stands")
    ctx.run_for(0.1 + settle_s(ctx))


def move(ctx: CaseContext, distance: float, velocity: float = 100.0, *, deceleration: float = 1000.0) -> None:
    """Move the load and wait until it stands, mm."""
    job = ctx.axis.move_relative(
        distance, Velocity=velocity, Acceleration=1000.0, Deceleration=deceleration, Jerk=0.0
    )
    ctx.wait_until(job.done, 10.0, f"the load has moved by {distance:g} mm")
    ctx.run_for(0.1 + settle_s(ctx))
