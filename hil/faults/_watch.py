"""Evaluation of triggers on a bench. A watch costs nothing once it is stopped."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

from fieldbus.clock import seconds_to_ns
from fieldbus.errors import ConfigurationError, UnsupportedFaultError
from fieldbus.history import Event
from hil.errors import NotRecordedError, RecordingError
from hil.faults._trigger import (
    AnyOf,
    AtTime,
    ByChance,
    Every,
    Immediately,
    InCondition,
    InSequence,
    InState,
    OnEvent,
    OnFrame,
    SignalCrossing,
    Trigger,
    parse_pattern,
)
from hil.faults.seams import (
    BenchWithAxes,
    BenchWithComponents,
    BenchWithNodes,
    BenchWithVocabulary,
    FrameSegment,
    offers,
)
from hil.protocols import Bench
from hil.record import (
    EventSelector,
    Vocabulary,
    check_event_kind,
    check_selector,
    check_state,
    kind_matches,
    similar_signals,
)

if TYPE_CHECKING:
    from fieldbus.can.frame import CanFrame
    from fieldbus.clock import Timer
    from hil.record._recorder import Group

Stop = Callable[[], None]


def _nothing() -> None:
    """Nothing to stop."""


def watch(bench: Bench, trigger: Trigger, fire: Callable[[], None], stream: str = "trigger") -> Stop:
    """Call `fire` every time `trigger` happens, until the returned function is called.

    `fire` is called from inside the component that caused the trigger: it must only take note or enter work
    on the scheduler. `stream` names the random stream of triggers by chance.

    Raises:
        UnsupportedFaultError: A live bench does not learn in time of what the trigger waits for.
        ConfigurationError: The trigger names something that the bench does not have, or a time in the past.

    """
    if isinstance(trigger, Immediately):
        fire()
        return _nothing
    if isinstance(trigger, AtTime):
        return _watch_time(bench, trigger, fire)
    if isinstance(trigger, SignalCrossing):
        return _watch_signal(bench, trigger, fire)
    if isinstance(trigger, InState):
        return _watch_state(bench, trigger, fire)
    if isinstance(trigger, OnEvent):
        return _watch_event(bench, trigger, fire)
    if isinstance(trigger, OnFrame):
        return _watch_frame(bench, trigger, fire)
    if isinstance(trigger, InCondition):
        return _watch_condition(bench, trigger, fire)
    if isinstance(trigger, Every):
        return _watch_every(bench, trigger, fire)
    if isinstance(trigger, InSequence):
        return _Sequence(bench, trigger, fire, stream).stop
    if isinstance(trigger, AnyOf):
        return _watch_any(bench, trigger, fire, stream)
    return _watch_chance(bench, trigger, fire, stream)


def check_kind(bench: Bench, trigger: Trigger, where: str = "trigger") -> None:
    """Refuse a trigger on a kind of event that does not exist: it would never fire.

    Raises:
        ConfigurationError: There is no such kind; the message names the known ones.

    """
    if isinstance(trigger, OnEvent):
        kind = trigger.selector.kind
    elif isinstance(trigger, InState) and trigger.kind:
        kind = trigger.kind
    else:
        return
    heard = {entry.kind for entry in bench.history.events}
    check_event_kind(f"{where}.kind", kind, others=heard | bench.history.declared)


def check_names(bench: Bench, trigger: Trigger, where: str = "trigger") -> None:
    """Refuse a trigger on an event or state that cannot come: it would never fire.

    Jobs are not looked at, because their instance may be made later.

    Raises:
        ConfigurationError: There is no such kind, component, state or detail; the message names what
            there is.

    """
    check_kind(bench, trigger, where)
    _refuse_late_events(bench, trigger)
    vocabulary: Vocabulary | None = bench.vocabulary if offers(bench, BenchWithVocabulary) else None
    if vocabulary is None:
        return
    known = _RunningBench(bench.history.events, bench.recorder.groups, vocabulary)
    try:
        if isinstance(trigger, OnEvent):
            selector = trigger.selector
            data = {key: value for key, value in selector.data.items() if key != "job"}
            check_selector(known, EventSelector(selector.kind, selector.source, data=data))
        elif isinstance(trigger, InState):
            check_state(known, trigger.component, trigger.state, trigger.kind)
    except (RecordingError, NotRecordedError) as error:
        raise ConfigurationError(where, str(trigger), f"what the bench reports: {error}") from None


_DRIVE_PROCESS = ("drive.", "encoder.", "emcy.raised", "emcy.cleared", "nmt.state", "rpdo.timeout")
"""Events of emulated devices."""
_CONTROLLER_OWN = ("drive.limit_refused",)


def _refuse_late_events(bench: Bench, trigger: Trigger) -> None:
    """Refuse a trigger on an event that a live bench learns of at its end only, from the process of
    the drives.

    Raises:
        UnsupportedFaultError: The trigger would never fire; the message says what may take its place.

    """
    if bench.kind != "live":
        return
    if isinstance(trigger, OnEvent):
        kind = trigger.selector.kind
    elif isinstance(trigger, InState):
        axes = bench.axis_names if offers(bench, BenchWithAxes) else ()
        kind = trigger.kind or ("axis.state" if trigger.component in axes else "drive.state")
        if trigger.component == "controller":
            return
    else:
        return
    remote = any(kind_matches(one, kind) or kind_matches(kind, one) for one in _DRIVE_PROCESS)
    if (
        remote
        and kind not in _CONTROLLER_OWN
        and not any(entry.kind == kind for entry in bench.history.events)
    ):
        raise UnsupportedFaultError(
            f"trigger '{trigger}' cannot be used on a live bench: {kind} happens in the process of the "
            "drives, and the bench learns of it at its end. Wait for an event of the controller (link.*, "
            "axis.*, alarm.*, emcy.received), a signal or a frame"
        )


class _RunningBench(NamedTuple):
    """A bench that still runs, as the place where names are looked up."""

    events: Sequence[Event]
    groups: Sequence[Group]
    vocabulary: Vocabulary | None


def _watch_time(bench: Bench, trigger: AtTime, fire: Callable[[], None]) -> Stop:
    scheduler = bench.scheduler
    due = seconds_to_ns(trigger.time_s) + (scheduler.now if trigger.relative else 0)
    if due < scheduler.now:
        raise ConfigurationError(
            "trigger.time_s",
            trigger.time_s,
            f"a time from now on; the bench is at {scheduler.now * 1e-9:g} s",
        )
    return scheduler.at(due, fire).cancel


def _signal(bench: Bench, signal: str) -> str:
    """Return the name of a recorded signal; without a component that of the first axis.

    Raises:
        ConfigurationError: It is not recorded; the message names similar ones.

    """
    name = signal if "." in signal else f"{bench.axis().name}.{signal}"
    if not bench.recorder.has_signal(name):
        known = [f"{group.name}.{column}" for group in bench.recorder.groups for column, _ in group.columns]
        raise ConfigurationError(
            "trigger.signal", name, f"a recorded signal of this bench{similar_signals(name, known)}"
        )
    return name


def _watch_signal(bench: Bench, trigger: SignalCrossing, fire: Callable[[], None]) -> Stop:
    read = bench.recorder.reader(_signal(bench, trigger.signal))
    level = trigger.value
    rising = trigger.direction != "falling"
    falling = trigger.direction != "rising"
    previous = read()

    def look() -> None:
        nonlocal previous
        value = read()
        if value is None:
            return
        before = previous
        previous = value
        if before is not None and (
            (rising and before < level <= value) or (falling and before > level >= value)
        ):
            fire()

    return bench.on_cycle(look)


def _watch_state(bench: Bench, trigger: InState, fire: Callable[[], None]) -> Stop:
    check_kind(bench, trigger)
    names = bench.component_names if offers(bench, BenchWithComponents) else ()
    heard = (entry.source for entry in bench.history.events)  # a test may have attached more
    if names and trigger.component not in names and trigger.component not in heard:
        raise ConfigurationError("trigger.component", trigger.component, ", ".join(names))

    def look(entry: Event) -> None:
        if (
            entry.source == trigger.component
            and trigger.applies(entry.kind)
            and entry.data.get("to") == trigger.state
        ):
            fire()

    check_names(bench, trigger)
    stop = bench.history.listen(look)
    seen: set[str] = set()
    for entry in reversed(bench.history.events):
        if entry.source == trigger.component and trigger.applies(entry.kind) and entry.kind not in seen:
            seen.add(entry.kind)
            if entry.data.get("to") == trigger.state:
                fire()
                break
    return stop


def _watch_event(bench: Bench, trigger: OnEvent, fire: Callable[[], None]) -> Stop:
    selector = trigger.selector
    check_names(bench, trigger)
    delay_ns = seconds_to_ns(selector.offset_s)
    seen = 0
    timers: list[Timer] = []

    def look(entry: Event) -> None:
        nonlocal seen
        if not selector.matches(entry):
            return
        seen += 1
        if seen < selector.nth:
            return
        if delay_ns:
            timers.append(bench.scheduler.after(delay_ns, fire))
        else:
            fire()

    stop_listening = bench.history.listen(look)

    def stop() -> None:
        stop_listening()
        for timer in timers:
            timer.cancel()

    return stop


def frame_matcher(bench: Bench, trigger: OnFrame, segment: str) -> Callable[[CanFrame], bool]:
    """Return the function that is true from the n-th matching frame on this segment on."""
    wanted = (
        trigger.can_id
        if trigger.can_id is not None
        else message_id(bench, trigger.drive, trigger.message, segment)
    )
    mask = trigger.mask
    pattern = parse_pattern(trigger.data)
    places = [(at, byte) for at, byte in enumerate(pattern) if byte is not None]
    seen = 0

    def count(frame: CanFrame) -> bool:
        nonlocal seen
        if (frame.can_id ^ wanted) & mask:
            return False
        data = frame.data
        if len(data) < len(pattern) or any(data[at] != byte for at, byte in places):
            return False
        seen += 1
        return seen >= trigger.number

    return count


def _watch_frame(bench: Bench, trigger: OnFrame, fire: Callable[[], None]) -> Stop:
    segment: FrameSegment = bench.segment(trigger.segment or None)
    matches = frame_matcher(bench, trigger, segment.name)

    def look(frame: CanFrame, sender: str, time_ns: int) -> None:  # noqa: ARG001 - signature of a hook
        if matches(frame):
            fire()

    return segment.add_hook(look)


def message_id(bench: Bench, drive: str, message: str, segment: str) -> int:
    """Return the identifier of a named message of a node on a segment; without a name the first drive there.

    Raises:
        ConfigurationError: There is no such node on the segment, or it has no such message.

    """
    there = bench.nodes_on(segment) if offers(bench, BenchWithNodes) else None
    name = drive or bench.drive().name
    if there and not drive and name not in there:
        name = there[0]
    known = bench.cob_ids(name)
    if there is not None and name not in there:
        raise ConfigurationError("drive", name, f"{', '.join(there) or 'no node'} (nodes on {segment})")
    if message not in known:
        raise ConfigurationError("message", message, f"{', '.join(known)} (messages of {name})")
    return known[message]


# -- triggers made of triggers --------------------------------------------------------------------------


def _watch_any(bench: Bench, trigger: AnyOf, fire: Callable[[], None], stream: str) -> Stop:
    stops = [watch(bench, part, fire, f"{stream}.{number}") for number, part in enumerate(trigger.parts)]

    def stop_all() -> None:
        for stop in stops:
            stop()

    return stop_all


def _watch_chance(bench: Bench, trigger: ByChance, fire: Callable[[], None], stream: str) -> Stop:
    rng = bench.rng(f"{stream}.chance")

    def draw() -> None:
        if rng.random() < trigger.probability:
            fire()

    return watch(bench, trigger.part, draw, stream)


def _watch_condition(bench: Bench, trigger: InCondition, fire: Callable[[], None]) -> Stop:
    read = bench.recorder.reader(_signal(bench, trigger.signal))
    held = False

    def look() -> None:
        nonlocal held
        value = read()
        before, held = held, value is not None and trigger.holds(value)
        if held and not before:
            fire()

    stop = bench.on_cycle(look)
    look()
    return stop


def _watch_every(bench: Bench, trigger: Every, fire: Callable[[], None]) -> Stop:
    scheduler = bench.scheduler
    period_ns = max(seconds_to_ns(trigger.period_s), 1)
    timers: list[Timer] = []

    def come() -> None:
        timers[0] = scheduler.after(period_ns, come)
        fire()

    first_s = trigger.period_s if trigger.first_s is None else trigger.first_s
    timers.append(scheduler.after(seconds_to_ns(first_s), come))
    return lambda: timers[0].cancel()  # noqa: PLW0108 - the timer of the moment, not the first one


class _Sequence:
    """Watches one part after the other; when the last has fired it begins again with the first."""

    def __init__(self, bench: Bench, trigger: InSequence, fire: Callable[[], None], stream: str) -> None:
        self._bench = bench
        self._parts = trigger.parts
        self._fire = fire
        self._stream = stream
        self._stage = 0
        self._stop: Stop | None = None
        self._ended = False
        self._pending: Timer | None = None
        for part in self._parts[1:]:
            # A later part that names what the bench does not have must not be found out in the middle of a
            # run.
            watch(bench, part, lambda: None, stream)()
        self._begin()

    def _begin(self) -> None:
        self._pending = None
        if self._ended:
            return
        stage = self._stage
        stop = watch(self._bench, self._parts[stage], lambda: self._fired(stage), f"{self._stream}.{stage}")
        if self._stage != stage or self._ended:
            stop()  # it has fired already
        else:
            self._stop = stop

    def _fired(self, stage: int) -> None:
        """Go on at the same instant, outside of the component that has fired."""
        if self._ended or stage != self._stage:
            return
        if self._stop is not None:
            self._stop()
            self._stop = None
        self._stage = (stage + 1) % len(self._parts)
        first = self._parts[0]
        once = isinstance(first, Immediately) or (isinstance(first, AtTime) and not first.relative)
        again = self._stage != 0 or not once
        if again:
            scheduler = self._bench.scheduler
            self._pending = scheduler.at(scheduler.now, self._begin)
        if self._stage == 0:
            self._fire()

    def stop(self) -> None:
        """Wait no longer."""
        self._ended = True
        if self._pending is not None:
            self._pending.cancel()
        if self._stop is not None:
            self._stop()
            self._stop = None
