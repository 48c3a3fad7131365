"""What a log is read by: the nodes, mappings and scales of the bench file, taken from a bench of the same
make in virtual time.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from hil.bench import BenchFile as OwnBenchFile
from hil.bench.drive_config import CanDriveTable, Cia402DriveTable, ProfidriveCanTable
from hil.bench.segment_config import CanTable
from hil.errors import CannotRunError
from hil.record import Vocabulary

if TYPE_CHECKING:
    from fieldbus.canopen.decode import FrameDecoder
    from fieldbus.profidrive import Telegram
    from hil.bench.bench import Bench
    from hil.bench.config import BenchConfig
    from hil.protocols import BenchFile


@dataclass(frozen=True)
class AxisFacts:
    """How the process data of a drive become actual values of its axis."""

    name: str
    increment: float
    """Axis units per raw increment; 0 where the drive does not bring the position."""
    unit: str
    """Unit of the position."""
    unit_per_rpm: float


@dataclass(frozen=True)
class NodeFacts:
    """A node of the bench."""

    name: str
    node_id: int
    segment: str
    profile: str
    """`cia402`, `profidrive`; others have no process data that are known here."""
    consumer_heartbeat_ns: int = 0
    rated_torque_nm: float = 0.0
    reference_speed_rpm: float = 0.0
    telegram: Telegram | None = None
    axis: AxisFacts | None = None
    enums: dict[str, dict[int, str]] = field(default_factory=dict)


@dataclass(frozen=True)
class BenchFacts:
    """Everything of a bench that a log is read by."""

    name: str
    text: str
    segments: dict[str, tuple[str, ...]]
    """CAN segments and the names under which a log may hold them."""
    nodes: tuple[NodeFacts, ...]
    vocabulary: Vocabulary
    signals: tuple[str, ...]
    """What a bench in operation records."""
    constants: dict[str, float]
    decoder: Callable[[str], FrameDecoder]
    """Makes a decoder of a segment that has heard nothing yet."""


def facts_of(bench_file: BenchFile[Bench]) -> BenchFacts:
    """Return the facts of a bench file; a live one is read as if all of it were emulated.

    Raises:
        CannotRunError: It is no bench file with segments, or has no CAN segment.

    """
    if not isinstance(bench_file, OwnBenchFile):
        raise CannotRunError(
            f"bench {bench_file.name!r} is an object of your own; a log is read by a bench file"
        )
    config = bench_file.config
    segments = {
        name: (name, *([section.channel] if section.channel else []))
        for name, section in config.segment.items()
        if isinstance(section, CanTable)
    }
    if not segments:
        raise CannotRunError(
            f"bench {bench_file.name!r} has no CAN segment, and a log of frames holds no other"
        )
    twin = _emulated(config)
    from hil.bench.bench import Bench
    from hil.bench.drives import build_decoder

    with Bench(twin) as bench:
        nodes = tuple(_nodes(bench, twin))
        vocabulary = bench.vocabulary
        trace = bench.trace()
        held = dict(bench.ports.can)

    def decoder(segment: str) -> FrameDecoder:
        return build_decoder(twin, held, segment=segment)

    return BenchFacts(
        bench_file.name,
        bench_file.text,
        segments,
        nodes,
        vocabulary,
        tuple(trace.names()),
        trace.constants,
        decoder,
    )


def _emulated(config: BenchConfig) -> BenchConfig:
    """Return the same bench in virtual time with nothing but emulated devices."""
    if config.bench.kind == "virtual":
        return config
    return config.model_copy(
        update={
            "bench": config.bench.model_copy(update={"kind": "virtual"}),
            "segment": {name: one.in_virtual_time() for name, one in config.segment.items()},
            "drive": {n: one.model_copy(update={"device": "emulated"}) for n, one in config.drive.items()},
            "encoder": {
                n: one.model_copy(update={"device": "emulated"}) for n, one in config.encoder.items()
            },
        }
    )


def _nodes(bench: Bench, config: BenchConfig) -> list[NodeFacts]:
    found = []
    columns = {group.name: group for group in bench.recorder.groups}
    for name, drive in config.drive.items():
        if not isinstance(drive, CanDriveTable):
            continue
        axis = next((one for one, section in config.axis.items() if section.drive == name), None)
        telegram = drive.named_telegram()[0] if isinstance(drive, ProfidriveCanTable) else None
        if axis is not None and telegram is not None:
            telegram = bench.ports.telegram_port(name).telegram
        found.append(
            NodeFacts(
                name,
                drive.node_id,
                drive.segment,
                drive.profile,
                consumer_heartbeat_ns=drive.consumer_heartbeat_ms * 1_000_000 if drive.heartbeat_ms else 0,
                rated_torque_nm=drive.rated_torque_nm if isinstance(drive, Cia402DriveTable) else 0.0,
                reference_speed_rpm=drive.reference_speed_rpm,
                telegram=telegram,
                axis=None if axis is None else _axis(bench, config, axis, name),
                enums=columns[name].enums,
            )
        )
    for name, node in config.nodes.items():
        if name not in config.drive:
            found.append(NodeFacts(name, node.node_id, node.segment, "other"))
    return found


def _axis(bench: Bench, config: BenchConfig, name: str, drive: str) -> AxisFacts:
    axis = bench.axis(name).object
    named = config.encoders_of_axis(name)
    own = named is None or (named and named[0] == drive)
    unit = next((unit for column, unit in axis.trace_columns if column == "actual_position"), "mm")
    increment = axis.mechanics.increment if own else 0.0
    return AxisFacts(name, increment, unit, 1.0 / axis.mechanics.rpm_per_unit)
