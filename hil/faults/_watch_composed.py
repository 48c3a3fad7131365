"""Evaluation of triggers that are made of triggers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from fieldbus.clock import seconds_to_ns
from fieldbus.errors import ConfigurationError
from hil.faults._compose import AnyOf, ByChance, Every, InCondition, InSequence
from hil.faults._trigger import AtTime, ComposedTrigger, Immediately, Trigger
from hil.protocols import Bench

Stop = Callable[[], None]
Watch = Callable[[Bench, Trigger, Callable[[], None], str], Stop]


def watch_composed(
    bench: Bench, trigger: ComposedTrigger, fire: Callable[[], None], stream: str, watch: Watch
) -> Stop:
    """Call `fire` every time `trigger` happens, until the returned function is called.

    Args:
        bench: The bench.
        trigger: What is waited for.
        fire: As of `hil.faults._watch.watch`.
        stream: Name of the random stream.
        watch: Watches any trigger, also a part of this one.

    """
    if isinstance(trigger, InCondition):
        return _watch_condition(bench, trigger, fire)
    if isinstance(trigger, Every):
        return _watch_every(bench, trigger, fire)
    if isinstance(trigger, InSequence):
        return _Sequence(bench, trigger, fire, stream, watch).stop
    if isinstance(trigger, AnyOf):
        stops = [watch(bench, part, fire, f"{stream}.{number}") for number, part in enumerate(trigger.parts)]

        def stop_all() -> None:
            for stop in stops:
                stop()

        return stop_all
    assert isinstance(trigger, ByChance)
    rng = bench.rng(f"{stream}.chance")

    def draw() -> None:
        if rng.random() < trigger.probability:
            fire()

    return watch(bench, trigger.part, draw, stream)


def _watch_condition(bench: Bench, trigger: InCondition, fire: Callable[[], None]) -> Stop:
    name = trigger.signal if "." in trigger.signal else f"{bench.axis().name}.{trigger.signal}"
    if not bench.recorder.has_signal(name):
        raise ConfigurationError("trigger.signal", name, "a recorded signal of this bench")
    read = bench.recorder.reader(name)
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
    timers: list[Any] = []

    def come() -> None:
        timers[0] = scheduler.after(period_ns, come)
        fire()

    first_s = trigger.period_s if trigger.first_s is None else trigger.first_s
    timers.append(scheduler.after(seconds_to_ns(first_s), come))
    return lambda: timers[0].cancel()  # noqa: PLW0108 - the timer of the moment, not the first one


class _Sequence:
    """Watches one part after the other; when the last has fired it begins again with the first."""

    def __init__(
        self, bench: Bench, trigger: InSequence, fire: Callable[[], None], stream: str, watch: Watch
    ) -> None:
        self._bench = bench
        self._parts = trigger.parts
        self._fire = fire
        self._stream = stream
        self._watch = watch
        self._stage = 0
        self._stop: Stop | None = None
        self._ended = False
        self._pending: Any = None
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
        stop = self._watch(
            self._bench, self._parts[stage], lambda: self._fired(stage), f"{self._stream}.{stage}"
        )
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
