"""From a log to a trace: frames are decoded by the mapping in effect, which writes of SDOs in the log itself
may change.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Final

from fieldbus.can.frame import CanFrame
from fieldbus.canopen.nmt import COB_ERROR_CONTROL, COB_SDO_CLIENT, COB_SDO_SERVER, NmtState
from fieldbus.clock import S
from fieldbus.history import Event, Scalar
from hil.errors import CannotRunError
from hil.logs._facts import BenchFacts, facts_of
from hil.logs._files import BusLog
from hil.logs._nodes import LogNode, node_of
from hil.record import PackedFrames, Trace, TraceGroup

if TYPE_CHECKING:
    from fieldbus.canopen.decode import FrameDecoder
    from hil.bench.bench import Bench
    from hil.protocols import BenchFile
    from hil.record import BusFrame

LOG_KINDS: Final = (
    "drive.state",
    "drive.fault",
    "drive.fault_cleared",
    "drive.inputs",
    "drive.nmt",
    "nmt.state",
    "node.bootup",
    "emcy.",
    "heartbeat.lost",
    "can.bus_error",
    "log.",
)
"""Events that frames tell of."""
_SHORTEST_NS: Final = S // 100
_SHORTEST_GAP_NS: Final = S // 20
_GAP_PERIODS: Final = 10
"""A time without any frame, in periods of SYNC, that is a gap of the recording."""
_CONTROLLER: Final = 127
_STEPS: Final = 1001
"""Distances of SYNCs from which the usual one is taken."""
_CONTROLWORD: Final = 0x604000
_WRITES_CONTROLWORD: Final = bytes.fromhex("2b406000")
"""Begin of an expedited SDO write of 6040h."""
_FROM_NODES: Final = (0x180, 0x280, 0x380, 0x480, COB_SDO_SERVER, COB_ERROR_CONTROL)
"""Services whose frames come from nodes."""


@dataclass(frozen=True)
class LogTrace:
    """A decoded log."""

    trace: Trace
    decode: Callable[[BusFrame], str]
    notes: list[str] = field(default_factory=list)
    """What a reader of the verdict should know: nodes that nobody knows, frames left out."""
    bench_name: str = ""
    bench_text: str = ""


def trace_of_log(
    log: BusLog, bench_file: BenchFile[Bench], *, channels: Mapping[str, str] | None = None
) -> LogTrace:
    """Return the trace of a log, with the signals, words, states and faults that its frames show.

    Args:
        log: The log.
        bench_file: The bench that was recorded; of a live one only its nodes count.
        channels: Segment of the bench -> channel of the log, where the names do not tell it.

    Raises:
        CannotRunError: No channel of the log belongs to the bench, none of its nodes sends, or the log is
            too short.

    """
    facts = facts_of(bench_file)
    pairs = _pair(log, facts, channels or {})
    if log.end_ns - min(entries.first_ns for entries in log.channels.values()) < _SHORTEST_NS:
        raise CannotRunError(
            f"{log.path} is too short: {log.frames} frames within less than {_SHORTEST_NS / S:g} s"
        )
    events: list[Event] = []

    def emit(time_ns: int, source: str, kind: str, /, **data: Scalar) -> None:
        events.append(Event(time_ns, source, kind, data))

    reading = _Reading(facts, emit)
    notes = []
    if log.fd_frames:
        notes.append(f"{log.fd_frames} CAN FD frames are shown, not judged: CANopen has classical frames")
    for segment, channel in pairs.items():
        unknown = reading.read(segment, log.channels[channel])
        if unknown:
            listed = ", ".join(f"node {node} ({count} frames)" for node, count in sorted(unknown.items()))
            notes.append(f"on {channel}, not in the bench file: {listed}")
    silent = [node.facts for node in reading.nodes if not node.seen and node.facts.segment in pairs]
    if len(silent) == sum(node.facts.segment in pairs for node in reading.nodes):
        silent_names = ", ".join(f"{one.name} (node {one.node_id})" for one in silent)
        raise CannotRunError(
            f"{log.path}: none of the nodes of bench {facts.name!r} sends in this log: {silent_names}; "
            f"{notes[-1] if notes else 'there is no other either'}"
        )
    notes += reading.notes
    notes += [
        f"{node.facts.name} (node {node.facts.node_id}) sends no process data that the bench file maps: "
        f"nothing is known of its states and values"
        for node in reading.nodes
        if node.seen and node.speechless and node.facts.segment in pairs
    ]
    notes += [f"{one.name} (node {one.node_id}) sends nothing in this log" for one in silent]
    groups = reading.groups()
    names = {f"{group.name}.{column}" for group in groups for column, _ in group.columns}
    vocabulary = replace(
        facts.vocabulary,
        kinds=LOG_KINDS,
        absent=tuple(name for name in facts.signals if name not in names),
        relative=tuple(f"{one.axis.name}.actual_position" for one in facts.nodes if one.axis is not None),
        values={**facts.vocabulary.values, **_states(facts)},
        origin=f"the log {log.path.name}",
    )
    events.sort(key=lambda event: event.time_ns)
    trace = Trace(
        groups,
        events=events,
        frames={segment: log.channels[channel] for segment, channel in pairs.items()},
        constants={**facts.constants, **reading.constants},
        end_ns=log.end_ns,
        vocabulary=vocabulary,
    )
    return LogTrace(trace, reading.decode, notes, facts.name, facts.text)


def _states(facts: BenchFacts) -> dict[str, tuple[Scalar, ...]]:
    """Return the states of the nodes, whether the log shows them or not."""
    found: dict[str, tuple[Scalar, ...]] = {}
    network = tuple(state.name for state in NmtState)
    for node in facts.nodes:
        states = tuple(node.enums.get("state", {}).values())
        found[f"{node.name}.state:to"] = (*states, *network)
        found["drive.state:to"] = tuple(dict.fromkeys((*found.get("drive.state:to", ()), *states)))
    return found


def _pair(log: BusLog, facts: BenchFacts, given: Mapping[str, str]) -> dict[str, str]:
    """Return segment -> channel of the log."""
    there = ", ".join(channel or "(unnamed)" for channel in log.channels)
    pairs: dict[str, str] = {}
    for segment, channel in given.items():
        if segment not in facts.segments:
            raise CannotRunError(
                f"--channel {segment}={channel}: bench {facts.name!r} has no such CAN segment; it has: "
                f"{', '.join(facts.segments)}"
            )
        if channel not in log.channels:
            raise CannotRunError(
                f"--channel {segment}={channel}: {log.path} has no such channel; it has: {there}"
            )
        pairs[segment] = channel
    for segment, names in facts.segments.items():
        if segment not in pairs:
            found = next((name for name in names if name in log.channels), None)
            if found is not None:
                pairs[segment] = found
    if not pairs and len(facts.segments) == len(log.channels) == 1:
        pairs[next(iter(facts.segments))] = next(iter(log.channels))
    if not pairs:
        raise CannotRunError(
            f"{log.path} has the channels {there}; bench {facts.name!r} has the CAN segments "
            f"{', '.join(facts.segments)}: say which is which with --channel SEGMENT=CHANNEL"
        )
    return pairs


class _Bus:
    """A channel of the log: SYNC, and pauses in which frames have been lost to the recorder."""

    def __init__(self, segment: str, nodes: list[LogNode], emit: Callable[..., None]) -> None:
        self._segment = segment
        self._nodes = nodes
        self._emit = emit
        self.sync_ns: int | None = None
        self.last_ns = 0
        self._steps = array("q")
        self.period_ns = 0
        """Shortest distance of two SYNCs; 0 before the second."""
        self._pause: tuple[int, int] | None = None

    def sync(self, time_ns: int) -> None:
        """Take a SYNC: where it ran before a pause and runs on behind it, the bus
        was not silent, but not recorded.
        """
        before = self.sync_ns
        if self._pause is not None and before is not None:
            from_ns, to_ns = self._pause
            near_ns = 2 * self.period_ns
            if from_ns - before <= near_ns and time_ns - to_ns <= near_ns:
                self._emit(from_ns, self._segment, "log.silent", reason="nothing was recorded", values=False)
                self._emit(to_ns, self._segment, "log.heard", values=False)
                for node in self._nodes:
                    node.excuse(from_ns, to_ns, "nothing was recorded")
            self._pause = None
        elif before is not None and time_ns > before:
            step_ns = time_ns - before
            if len(self._steps) < _STEPS:
                self._steps.append(step_ns)
            self.period_ns = min(self.period_ns, step_ns) if self.period_ns else step_ns
        self.sync_ns = time_ns

    @property
    def cycle_ns(self) -> int:
        """Usual distance of two SYNCs; 0 before the second."""
        return sorted(self._steps)[len(self._steps) // 2] if self._steps else 0

    def pause(self, time_ns: int) -> None:
        """Take a time without any frame that ends now."""
        if self.period_ns and time_ns - self.last_ns > _GAP_PERIODS * self.period_ns:
            self._pause = (self.last_ns, time_ns)


class _Reading:
    """Reads the frames of all segments of a bench."""

    def __init__(self, facts: BenchFacts, emit: Callable[..., None]) -> None:
        self._facts = facts
        self._emit = emit
        self.nodes: list[LogNode] = [node_of(one, emit) for one in facts.nodes]
        self._words: dict[str, FrameDecoder] = {}
        self.notes: list[str] = []
        self.constants: dict[str, float] = {}
        """What the log tells beyond its signals."""

    def read(self, segment: str, log: PackedFrames) -> dict[int, int]:
        """Read a channel; returns nodes that the bench does not have, with the number of their frames."""
        decoder = self._facts.decoder(segment)
        self._words[segment] = decoder
        here = {node.facts.node_id: node for node in self.nodes if node.facts.segment == segment}
        bus = _Bus(segment, list(here.values()), self._emit)
        unknown: dict[int, int] = {}
        misfits: dict[tuple[int, int, int, bool], int] = {}
        for node in here.values():
            node.begin(log.first_ns)
        for time_ns, _, frame, error in log:
            if time_ns - bus.last_ns > _SHORTEST_GAP_NS:
                bus.pause(time_ns)
            bus.last_ns = time_ns
            if error:
                self._emit(time_ns, segment, "can.bus_error", code=error)
                continue
            if frame.extended or frame.fd:
                continue
            can_id = frame.can_id
            if can_id == decoder.sync_id:
                bus.sync(time_ns)
                continue
            found = decoder.mapped(frame)
            if found is not None and found[0] in here:
                node = here[found[0]]
                service = can_id & 0x780
                sent = service in (0x180, 0x280, 0x380, 0x480) or service not in (0x200, 0x300, 0x400, 0x500)
                length, wanted = len(frame.data), decoder.mapped_length(can_id)
                if length != wanted:
                    key = (can_id, length, wanted, decoder.mapping_seen(can_id))
                    misfits[key] = misfits.get(key, 0) + 1
                    node.misfit(time_ns, can_id, length, wanted, sync_ns=bus.sync_ns, sent=sent)
                    continue
                node.fits(time_ns, can_id)
                node.process_data(time_ns, found[1], can_id, sync_ns=bus.sync_ns, sent=sent)
                continue
            node_id = decoder.emcy_node(can_id)
            if node_id in here:
                if not frame.remote:
                    here[node_id].emergency(time_ns, frame.data)
                continue
            service, node_id = can_id & 0x780, can_id & 0x7F
            if service == COB_ERROR_CONTROL and node_id in here and not frame.remote:
                here[node_id].error_control(time_ns, frame.data)
            elif service == COB_SDO_SERVER and node_id in here:
                here[node_id].heard(time_ns)
            elif (
                service == COB_SDO_CLIENT
                and frame.data[:4] == _WRITES_CONTROLWORD
                and node_id in here
                and here[node_id].facts.profile == "cia402"
            ):
                word = int.from_bytes(frame.data[4:6], "little")
                here[node_id].process_data(
                    time_ns, [(_CONTROLWORD, word)], can_id, sync_ns=bus.sync_ns, sent=False
                )
            elif service in _FROM_NODES and node_id not in (0, _CONTROLLER, *here) and not frame.remote:
                unknown[node_id] = unknown.get(node_id, 0) + 1
            decoder.observe(frame)
        for node in here.values():
            node.end(log.last_ns)
            if bus.cycle_ns:
                self.constants[f"{node.facts.name}.sync_period_s"] = bus.cycle_ns / S
        self._compare(segment, misfits, here)
        return unknown

    def _compare(
        self, segment: str, misfits: Mapping[tuple[int, int, int, bool], int], here: Mapping[int, LogNode]
    ) -> None:
        """Note process data of another length than by the mapping known: the sign of another mapping, or of
        another bench.
        """
        decoder = self._words[segment]
        for (can_id, length, wanted, seen), count in sorted(misfits.items()):
            owner = here.get(decoder.pdo_ids.get(can_id, 0))
            name = "a node" if owner is None else owner.facts.name
            whose = "that the log shows being written" if seen else "of the bench file"
            self.notes.append(
                f"{name}: process data {can_id:03X}h are not judged where they have {length} bytes ({count} "
                f"frames): {wanted} by the mapping {whose}"
            )

    def decode(self, frame: BusFrame) -> str:
        """Return a frame in words, by the mapping at the end of the log."""
        assert isinstance(frame, CanFrame)  # a log holds no other
        return next(iter(self._words.values())).decode(frame)

    def groups(self) -> list[TraceGroup]:
        """Return the recorded rows of nodes and axes, the axes first."""
        tables = [node.axis for node in self.nodes if node.axis is not None]
        made = [table.group() for table in (*tables, *(node.table for node in self.nodes))]
        return [group for group in made if group is not None]
