"""What the orchestrator needs of a bench, of its parts and of a bench file.

The concrete bench (`hil.bench`) satisfies these protocols; so may a bench of one's own.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import TracebackType
from typing import TYPE_CHECKING, Any, Protocol, Self, runtime_checkable

from fieldbus.clock import Scheduler
from fieldbus.history import History

if TYPE_CHECKING:
    from numpy.random import Generator

    from fieldbus.can.frame import CanFrame, CanPort, FrameReceiver
    from hil.record import Recorder, Trace


class Job(Protocol):
    """One instruction instance, with the output names of the standard."""

    name: str
    Busy: bool
    Error: bool
    ErrorID: int

    def set(self, **inputs: Any) -> None:
        """Assign inputs; they act at the next call."""


class ExecuteJob(Job, Protocol):
    """An instance that is started by an edge of `Execute`."""

    Done: bool
    CommandAborted: bool


class Axis(Protocol):
    """An axis of the controller, with the instructions as methods that make one instance each.

    Units: mm, mm/s (degrees for a rotary axis). Further inputs of an instruction may be given by their
        own names.
    """

    name: str

    def power(self, enable: bool = True, *, start_mode: int = 1, stop_mode: int = 0) -> Job:
        """Set the inputs of the axis' only `MC_Power`."""

    def reset(self, *, restart: bool = False) -> ExecuteJob:
        """Acknowledge alarms or restart the technology object."""

    def home(self, position: float = 0.0, *, mode: int = 0) -> ExecuteJob:
        """Home the axis."""

    def move_absolute(self, position: float, **inputs: Any) -> ExecuteJob:
        """Move to `position`."""

    def move_relative(self, distance: float, **inputs: Any) -> ExecuteJob:
        """Move by `distance`."""

    def move_velocity(self, velocity: float, **inputs: Any) -> ExecuteJob:
        """Move with `velocity` until told otherwise."""

    def jog(self, velocity: float = 100.0, *, backward: bool = False, **inputs: Any) -> Job:
        """Jog; end it with `set(JogForward=False, JogBackward=False)`."""

    def halt(self, **inputs: Any) -> ExecuteJob:
        """Bring the axis to rest; new jobs are allowed."""

    def stop(self, mode: int = 0, **inputs: Any) -> ExecuteJob:
        """Stop with `mode` 0, 2 or 3 and block new jobs until `set(Execute=False)`."""


class Drive(Protocol):
    """A drive as the faults see it: emulated here, or a proxy of one in another process."""

    name: str

    def raise_fault(self, emcy_code: int, *, persistent: bool = False) -> None:
        """Trip with an EMCY code; a persistent cause refuses the fault reset."""

    def clear_fault_cause(self, emcy_code: int | None = None) -> None:
        """Withdraw the cause of a persistent fault, or of all of them."""

    def set_sto(self, active: bool) -> None:
        """Open or close the safe-torque-off input."""

    def freeze_encoder(self, frozen: bool) -> None:
        """Hold the reported position."""

    def jump_encoder(self, increments: int) -> None:
        """Displace the reported position."""

    def suppress_index(self, missing: bool) -> None:
        """Let the zero mark of the encoder never come."""

    def jam(self, active: bool) -> None:
        """Block the mechanics."""

    def set_load_force(self, newton: float) -> None:
        """Set the external force at the load, N."""

    def force_input(self, name: str, state: bool | None) -> None:
        """Override the input `negative_limit`, `positive_limit`, `home`, `probe1` or `probe2`; None ends the
        override.
        """

    def stop_heartbeat(self, stopped: bool) -> None:
        """Suppress the heartbeat, or produce it again."""

    def power_off(self) -> None:
        """Take the node off the bus without a word."""

    def power_on(self) -> None:
        """Start the node again, with boot-up."""


class Encoder(Protocol):
    """An encoder with a node of its own as the faults see it: emulated here, or a proxy of one in another
    process.
    """

    name: str

    def freeze_encoder(self, frozen: bool) -> None:
        """Hold the reported position."""

    def jump_encoder(self, increments: int) -> None:
        """Displace the reported position."""

    def set_encoder_noise(self, increments: int) -> None:
        """Disturb the reported position; 0 ends it."""

    def reverse_encoder(self, reversed_direction: bool) -> None:
        """Count the other way round."""

    def lose_encoder_steps(self, every: int) -> None:
        """Miss one of so many steps; 0 ends it."""

    def preset_encoder(self, value: int) -> None:
        """Write a preset."""

    def move_near_overflow(self, margin: int) -> None:
        """Place the position before an end of its range."""

    def set_alarm(self, bit: int, active: bool) -> None:
        """Bring about the cause of an alarm, a bit of 6503h, or end it."""

    def set_warning(self, bit: int, active: bool) -> None:
        """Bring about the cause of a warning, a bit of 6505h, or end it."""

    def force_cycle_time(self, period_ms: int | None) -> None:
        """Send TPDO1 with a wrong cycle; None ends it."""

    def stop_heartbeat(self, stopped: bool) -> None:
        """Suppress the heartbeat, or produce it again."""

    def power_off(self) -> None:
        """Take the node off the bus without a word."""

    def power_on(self) -> None:
        """Start the node again, with boot-up."""

    def turn_shaft(self, speed: float, ramp_s: float = 0.0) -> None:
        """Turn the encoder's own shaft, rad/s or m/s."""

    def place_shaft(self, position: float) -> None:
        """Put the encoder's own shaft at rest, rad or m."""


class FaultSegment(Protocol):
    """A CAN segment with the seams for frame faults."""

    name: str
    scheduler: Scheduler

    def attach(self, name: str, receive: FrameReceiver) -> CanPort:
        """Connect a node."""

    def add_hook(self, hook: Callable[[CanFrame, str, int], Any]) -> Callable[[], None]:
        """Call `hook(frame, sender, time_ns)` before a frame goes on the wire; returns the remover."""

    def inject(self, frame: CanFrame, sender: str = "fault") -> None:
        """Put a frame on the wire."""


@runtime_checkable
class Bench(Protocol):
    """A wired bench: one scheduler, one history, drives, axes, segments."""

    scheduler: Scheduler
    history: History
    recorder: Recorder
    kind: str
    """`virtual` or `live`."""
    seed: int

    def axis(self, name: str | None = None) -> Any:
        """Return an axis (`Axis`); without a name the only or first one."""

    def drive(self, name: str | None = None) -> Any:
        """Return a drive (`Drive`); without a name the only or first one."""

    def segment(self, name: str | None = None) -> Any:
        """Return a CAN segment (`FaultSegment`); without a name the only or first one."""

    def on_cycle(self, callback: Callable[[], object]) -> Callable[[], None]:
        """Call `callback` once per application cycle; returns the remover."""

    def run_for(self, seconds: float) -> None:
        """Let `seconds` of the bench's time pass."""

    def run_until(self, predicate: Callable[[], object], timeout: float) -> bool:
        """Run until `predicate` is true or `timeout` seconds have passed; returns whether it became true."""

    def rng(self, name: str) -> Generator:
        """Return the seeded random stream of component `name`."""

    def cob_ids(self, drive_name: str) -> dict[str, int]:
        """Return the identifiers of a drive, or of an encoder, by name: `rpdo1`, `tpdo1`, `sync`, `emcy`,
        `heartbeat`, `sdo_rx`, `sdo_tx`.
        """

    def decode(self, frame: Any) -> str:
        """Return the meaning of a frame in words."""

    def trace(self) -> Trace:
        """Return what has been recorded so far."""

    def close(self) -> None:
        """Release everything."""

    def __enter__(self) -> Self:
        """Use as a context manager."""

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the bench."""


@runtime_checkable
class BenchFile(Protocol):
    """A validated bench description that builds fresh benches."""

    name: str
    text: str
    """The description as it stands in the file."""
    digest: str
    """SHA-256 of the description, hexadecimal."""

    def build(self, *, seed: int) -> Any:
        """Return a fresh `Bench`."""


class BenchLoader(Protocol):
    """`hil.bench.load_bench`: None or an empty path means the embedded bench."""

    def __call__(self, path: str | None) -> BenchFile:
        """Load and validate; raises `ConfigurationError`."""


Constants = Mapping[str, float]
"""Facts of the bench that a judge of the trace needs, by `component.fact`: `axis1.max_deceleration`."""
