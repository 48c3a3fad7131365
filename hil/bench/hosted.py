"""The devices of a `DriveHost` as a bench for faults: what `hil emulate` has of one, without a controller."""

from __future__ import annotations

from collections.abc import Callable
from types import TracebackType
from typing import TYPE_CHECKING, Any, NoReturn, Self

from fieldbus.clock import MS
from hil.bench.emulated import named_rng
from hil.bench.names import cob_ids, named, nodes_on
from hil.errors import UnsupportedFaultError

if TYPE_CHECKING:
    from numpy.random import Generator

    from fieldbus.can.live import LiveSegment
    from fieldbus.clock import Scheduler
    from fieldbus.history import History
    from hil.bench.config import BenchConfig
    from hil.bench.drive_host import DriveHost
    from hil.record import Recorder, Trace


class HostedBench:
    """The devices of a host and the buses to somebody else's controller (`hil.protocols.Bench`).

    Args:
        config: The bench file.
        host: The devices, on live buses.
        seed: Seed of random streams.

    """

    kind = "live"

    def __init__(self, config: BenchConfig, host: DriveHost, *, seed: int) -> None:
        self.config = config
        self.seed = seed
        self._host = host

    @property
    def scheduler(self) -> Scheduler:
        """Time of the devices."""
        return self._host.scheduler

    @property
    def history(self) -> History:
        """Event log; without a record it keeps nothing."""
        return self._host.history

    @property
    def recorder(self) -> Recorder:
        """Samples signals; without a record none."""
        return self._host.recorder

    @property
    def drive_names(self) -> tuple[str, ...]:
        """Names of the drives."""
        return tuple(self._host.devices.drives)

    @property
    def encoder_names(self) -> tuple[str, ...]:
        """Names of the encoders with a node of their own."""
        return tuple(self._host.devices.encoders)

    @property
    def segment_names(self) -> tuple[str, ...]:
        """Names of the CAN segments."""
        return tuple(self._host.segments)

    @property
    def axis_names(self) -> tuple[str, ...]:
        """No axis: the controller is somebody else's."""
        return ()

    def axis(self, name: str | None = None) -> NoReturn:
        """Refuse: there is no axis.

        Raises:
            UnsupportedFaultError: Always.

        """
        raise UnsupportedFaultError(
            f"axis {name or ''}: the controller is somebody else's, not of this process"
        )

    def drive(self, name: str | None = None) -> Any:
        """Return an emulated drive, without a name the first one.

        Raises:
            ConfigurationError: There is no such drive.

        """
        return named("drive", self._host.devices.drives, name)

    def encoder(self, name: str | None = None) -> Any:
        """Return an emulated encoder, without a name the first one.

        Raises:
            ConfigurationError: There is no such encoder.

        """
        return named("encoder", self._host.devices.encoders, name)

    def segment(self, name: str | None = None) -> LiveSegment:
        """Return a CAN segment, without a name the first one.

        Raises:
            ConfigurationError: There is no such segment.

        """
        return named("CAN segment", self._host.segments, name)

    def nodes_on(self, segment: str) -> tuple[str, ...]:
        """Return the names of the nodes on a segment."""
        return nodes_on(self.config, segment)

    def cob_ids(self, drive_name: str) -> dict[str, int]:
        """Return the identifiers that a node uses, by name."""
        return cob_ids(self.config, drive_name)

    def on_cycle(self, callback: Callable[[], object]) -> Callable[[], None]:
        """Call `callback` once per bus cycle; returns the function that ends it."""
        return self.scheduler.every(self.config.bench.cycle_ms * MS, callback).cancel

    def run_for(self, seconds: float) -> None:
        """Let time pass."""
        self._host.run_until(lambda: False, seconds)

    def run_until(self, predicate: Callable[[], object], timeout: float) -> bool:
        """Run until `predicate` is true or `timeout` seconds have passed; returns whether it became true."""
        return self._host.run_until(predicate, timeout)

    def rng(self, name: str) -> Generator:
        """Return the random stream of component `name`."""
        return named_rng(self.seed, name)

    def decode(self, frame: Any) -> str:
        """Return the meaning of a frame."""
        return repr(frame)

    def trace(self) -> Trace:
        """Return what has been recorded so far."""
        return self.recorder.trace()

    def close(self) -> None:
        """Do nothing: the host closes its buses itself."""

    def __enter__(self) -> Self:
        """Use as a context manager."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Do nothing, as `close`."""
