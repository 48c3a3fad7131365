"""`[bench]` and `[tolerance]` of a bench file."""

from __future__ import annotations

from typing import Annotated, Literal

from annotated_types import Unit
from pydantic import Field, model_validator

from emulators.checked_fields import NotNegative
from fieldbus.clock import MS, US
from hil.bench._table import Cycles, Table
from hil.record import MEMORY_MB

Cpu = Literal["S7-1500", "S7-1500T", "S7-1200 G2", "S7-1500T V8", "S7-1500T V7", "S7-1500 V8", "S7-1500 V7"]
"""Controllers, as `motion.s7.compatibility.LEVELS` names them."""


class BenchTable(Table, frozen=True):
    """`[bench]`: what is common to the whole bench."""

    name: str = Field(min_length=1)
    """Name in reports."""
    kind: Literal["virtual", "live"] = "virtual"
    """Virtual time in one process, or real time on python-can interfaces."""
    cycle_ms: Annotated[int, Field(ge=1, le=255)] = 4
    """Bus cycle, cycle of `MC_Servo` and SYNC period."""
    interpolator_ms: Annotated[int, Field(ge=1, le=255)] | None = None
    """Cycle of `MC_Interpolator` with the user program: a multiple of `cycle_ms`, at most 32; none:
    `cycle_ms`. In between `MC_Servo` goes to the setpoint in `cycle_ms` steps.
    """
    servo_priority: Annotated[int, Field(ge=17, le=26)] = 26
    """Priority of `MC_Servo` and the blocks around it, above `interpolator_priority`."""
    interpolator_priority: Annotated[int, Field(ge=16, le=25)] = 24
    """Priority of `MC_Interpolator` and the block before it."""
    servo_period_us: Annotated[int, Field(ge=50, le=5000)] = 250
    """Control cycle of the emulated drives; has to divide the bus cycle."""
    cpu: Cpu = "S7-1500T"
    """Controller whose technology objects the axes are: the T has up to four encoders per axis,
    `MC_SetSensor`, the MotionIn instructions, cams and all of synchronous operation; the G2 has technology
    version V8.0, without `MC_Halt.Mode`, `BufferMode`, `Active` and parameter 1020 of `MC_WriteParameter`.
    `V8` and `V7` behind a name are earlier technology versions than V9.0.
    """
    program_cycles: Cycles = 1
    """From one call of the user program, so of every instruction instance, to the next; axes and drives keep
    to `cycle_ms`.
    """
    grace_cycles: Cycles = 3
    """Cycles without actual values after which an axis reports its drive as lost (alarm 431)."""
    recording_memory_mb: Annotated[int, Field(ge=8, le=1_000_000), Unit("MB")] = MEMORY_MB
    """Memory of the recording, MB, about. One that grows beyond it goes on in temporary files (in the folder
    of `TMPDIR`), as long as the disk has room; they vanish with the bench. The trace is the same.
    """
    memory_card: str | None = None
    """Folder that is the memory card of the controller, relative to the bench file:
    `MC_SaveAbsoluteEncoderData` writes `UserFiles/AbsEncoderData.dat` there; the next start of the bench
    restores the adjustment of the same encoders and renames the file to `.bak`. A run then depends on the
    one before it.
    """

    @model_validator(mode="after")
    def _cycles_fit(self) -> BenchTable:
        if self.cycle_ms * 1000 % self.servo_period_us:
            raise ValueError("servo_period_us must divide the bus cycle")
        if self.interpolator_ms is not None and self.interpolator_ms != self.cycle_ms:
            if self.interpolator_ms % self.cycle_ms:
                raise ValueError(f"interpolator_ms must be a multiple of cycle_ms = {self.cycle_ms}")
            if self.interpolator_ms > 32:
                raise ValueError("interpolator_ms must be 32 at most, where it is not cycle_ms")
        if self.servo_priority <= self.interpolator_priority:
            raise ValueError(
                f"servo_priority must be above interpolator_priority = {self.interpolator_priority}"
            )
        return self

    @property
    def live(self) -> bool:
        """Whether the bench runs in real time."""
        return self.kind == "live"

    @property
    def cycle_ns(self) -> int:
        """Bus cycle, ns."""
        return self.cycle_ms * MS

    @property
    def servo_period_ns(self) -> int:
        """Control cycle of the emulated drives, ns."""
        return self.servo_period_us * US

    @property
    def control_period_ns(self) -> int:
        """Cycle of what is slower than the control loop in the emulated drives, ns."""
        return max(1 * MS, self.servo_period_ns)


class ToleranceTable(Table, frozen=True):
    """`[tolerance]`: how far a measurement on this bench may lie from the number of the specification."""

    cycles: Annotated[NotNegative, Unit("cycles")] = 2.0
    """On times; distances get the travel of that time."""
    time_s: NotNegative = 0.0
    """On top of times."""
    distance_mm: NotNegative = 0.0
    """On top of distances."""
    lateness_s: NotNegative | None = None
    """Lateness up to which measurements on a live bench mean something; none: `time_s`. In this time an axis
    must not travel further than `distance_mm`.
    """
