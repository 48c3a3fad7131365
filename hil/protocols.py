"""What the orchestrator needs of a bench, of its parts and of a bench file.

The concrete bench (`hil.bench.Bench`) satisfies these protocols; so may a bench that you write.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Set as AbstractSet
from types import TracebackType
from typing import TYPE_CHECKING, Any, Protocol, Self, TypeVar, runtime_checkable

from fieldbus.clock import Scheduler
from fieldbus.history import History

if TYPE_CHECKING:
    from numpy.random import Generator

    from hil.record import Recorder, Trace

BuiltBench_co = TypeVar("BuiltBench_co", covariant=True)


class Drive(Protocol):
    """A drive: emulated in this process, or a stand-in for one in the drive process.

    These are the methods that every drive has. A drive of a profile has more; `isinstance(drive,
    CiA402Drive)` tells a type checker so.
    """

    @property
    def name(self) -> str:
        """Name of the drive."""

    def power_on(self) -> None:
        """Switch the supply on, with boot-up."""

    def power_off(self) -> None:
        """Switch the supply off: the node leaves the bus without a frame."""

    def raise_fault(self, code: int, /, *, persistent: bool = False) -> None:
        """Trip with a fault code (of CiA 402 an EMCY code); a persistent cause refuses the fault reset."""

    def clear_fault_cause(self, code: int | None = None, /) -> None:
        """Withdraw the cause of a persistent fault, or of all of them."""

    def force_input(self, name: str, state: bool | None, /) -> None:
        """Override the input `negative_limit`, `positive_limit`, `home`, `probe1` or
        `probe2`; None ends the override.
        """

    def invert_input(self, name: str, inverted: bool, /) -> None:
        """Invert an input."""

    def swap_limit_switches(self, swapped: bool, /) -> None:
        """Swap the wires of both limit switches."""

    def jam(self, jammed: bool, /) -> None:
        """Block the mechanics."""

    def set_load_force(self, force: float, /) -> None:
        """Set the external force at the load, N."""

    def set_clock_drift(self, ppm: float, /) -> None:
        """Let the clock of the node run fast (positive) or slow, parts per million; 0 ends it."""

    def set_clock_jitter(self, longest_ns: int, /) -> None:
        """Delay the events of the node by random times up to `longest_ns`; 0 ends it."""


class Encoder(Protocol):
    """An encoder with a node of its own, or the second encoder of a drive; see `Drive`."""

    @property
    def name(self) -> str:
        """Name of the encoder."""

    def freeze_encoder(self, frozen: bool, /) -> None:
        """Hold the reported position."""

    def jump_encoder(self, increments: int, /) -> None:
        """Displace the reported position."""

    def set_encoder_noise(self, increments: int, /) -> None:
        """Disturb the reported position; 0 ends it."""

    def reverse_encoder(self, reversed_direction: bool, /) -> None:
        """Count in the opposite direction."""

    def lose_encoder_steps(self, every: int, /) -> None:
        """Miss one of so many steps; 0 ends it."""

    def suppress_index(self, missing: bool, /) -> None:
        """Suppress the zero mark."""


class Device(Protocol):
    """A device that is made of its EDS alone; see `Drive`."""

    @property
    def name(self) -> str:
        """Name of the device."""

    def power_on(self) -> None:
        """Switch the supply on, with boot-up."""

    def power_off(self) -> None:
        """Switch the supply off: the node leaves the bus without a frame."""

    def stop_heartbeat(self, stopped: bool, /) -> None:
        """Suppress the heartbeat, or produce it again."""

    def get(self, index: int, sub: int = 0, /) -> Any:
        """Return the present value of an entry: a number, a text or bytes, by its data type."""

    def set(self, index: int, sub: int, value: Any, /) -> None:
        """Set a value as the device's own process would; access rights and limits do not matter."""


@runtime_checkable
class Bench(Protocol):
    """A wired bench: one scheduler, one history, drives, axes, segments."""

    @property
    def scheduler(self) -> Scheduler:
        """Time of the bench."""

    @property
    def history(self) -> History:
        """Event log."""

    @property
    def recorder(self) -> Recorder:
        """Samples signals."""

    @property
    def kind(self) -> str:
        """`virtual` or `live`."""

    @property
    def seed(self) -> int:
        """Seed of every random stream."""

    def axis(self, name: str | None = None) -> Any:
        """Return an axis; without a name the only or first one."""

    def drive(self, name: str | None = None) -> Any:
        """Return a drive; without a name the only or first one."""

    def segment(self, name: str | None = None) -> Any:
        """Return a segment; without a name the only or first one."""

    def on_cycle(self, callback: Callable[[], object]) -> Callable[[], None]:
        """Call `callback` once per application cycle; returns the function that ends it."""

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
        """Return the meaning of a frame."""

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
class DescribedBench(Protocol):
    """A bench that says in words how it stands."""

    def summary(self) -> str:
        """Return the axes with their states and pending alarms."""

    def unmet_wait(self) -> str:
        """Return why the last `run_until` gave up; empty when it did not, or time has passed since."""


@runtime_checkable
class VariableBench(Protocol):
    """A bench whose technology objects have variables and words of bits that a case may read."""

    def outputs(self, looked_at: AbstractSet[str]) -> tuple[frozenset[str], frozenset[str]]:
        """Return which outputs of the technology objects somebody has read, and which nobody has.

        Args:
            looked_at: Names of the signals, and of the bits of recorded words, that were looked at in the
                trace.

        """


@runtime_checkable
class ProfiledBench(Protocol):
    """A bench that knows the profiles of its drives."""

    @property
    def profiles(self) -> frozenset[str]:
        """Profiles of the drives."""


@runtime_checkable
class TimedBench(Protocol):
    """A bench in real time, which may be late."""

    @property
    def lateness_s(self) -> float:
        """By how much it was late at worst, s."""

    @property
    def allowed_lateness_s(self) -> float:
        """How late it may be, s."""


@runtime_checkable
class KnownKind(Protocol):
    """A bench file that tells the kind of its bench."""

    @property
    def kind(self) -> str:
        """`virtual` or `live`."""


def kind_of(bench_file: object) -> str:
    """Return the kind of the bench of a bench file: `virtual` where it does not tell."""
    return bench_file.kind if isinstance(bench_file, KnownKind) else "virtual"


@runtime_checkable
class BenchFile(Protocol[BuiltBench_co]):
    """A validated bench description that builds fresh benches, of a type that satisfies `Bench`."""

    @property
    def name(self) -> str:
        """Name that the description gives to the bench."""

    @property
    def text(self) -> str:
        """The description as it is in the file."""

    @property
    def digest(self) -> str:
        """SHA-256 of the description, hexadecimal."""

    def build(self, *, seed: int) -> BuiltBench_co:
        """Return a fresh bench."""
