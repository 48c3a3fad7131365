"""The injector: arms faults on a bench, watches their triggers, applies and
removes them, and logs all of it.
"""

from __future__ import annotations

from itertools import count
from typing import Final
from weakref import WeakSet

from fieldbus.clock import seconds_to_ns
from fieldbus.errors import HilError
from hil.faults._axis import about_axis
from hil.faults._fault import Fault
from hil.faults._kind import Action, Injection
from hil.faults._parameters import Scalar
from hil.faults._trigger import Immediately, OnFrame, Trigger, as_trigger
from hil.faults._waiting import why_not_fired
from hil.faults._watch import Stop, check_names, watch
from hil.protocols import Bench
from hil.record import EventSelector


class ArmedFault:
    """A fault on a bench: waiting for its trigger, applied, or over."""

    def __init__(self, injector: Injector, fault: Fault, number: int) -> None:
        self.fault = fault
        self.number = number
        """1, 2, ... in the order of arming; the history events carry it."""
        self.armed_ns = injector.bench.scheduler.now
        self.applied_ns: int | None = None
        """First application, ns."""
        self.removed_ns: int | None = None
        """Last removal, ns; equals the application for a fault that is over at once."""
        self.applications = 0
        self.active = False
        """Whether it is applied at this moment."""
        self.over = False
        """Whether it will not be applied again."""
        self._bench = injector.bench
        self._pending = False
        self._ends: list[Stop] = []
        self._trigger: Trigger = as_trigger(fault.trigger)
        """With the axis that it is about, once it is armed."""
        self._stop_trigger: Stop | None = None
        self._limit = fault.count if fault.count is not None and not fault.entry.counted else 1
        self._action = self._make_action()
        self.target = self._action.target

    def _make_action(self) -> Action:
        fault, entry = self.fault, self.fault.entry
        injection = Injection(
            bench=self._bench,
            kind=entry,
            target=fault.target,
            values=fault.values,
            count=fault.count,
            has_end=fault.duration_s is not None or fault.until is not None,
            stream=f"fault{self.number}",
            ended=self._end,
            report_hit=self._report_hit,
        )
        return entry.effect(injection)

    def arm(self) -> None:
        """Begin to watch the trigger."""
        trigger = self._trigger = self._about_axis(self.fault.trigger)
        if self.fault.until is not None:
            check_names(self._bench, self._about_axis(self.fault.until), "until")
        self._emit("fault.armed", trigger=str(self.fault.trigger), **self.fault.parameters)
        if self._action.apply_at_frame is not None and isinstance(trigger, OnFrame):
            # The n-th frame must itself be hit, so the hook of the fault counts.
            self._stop_trigger = self._action.apply_at_frame(trigger, self._apply)
            return
        stop = watch(self._bench, trigger, self._fired, f"fault{self.number}.trigger")
        if self.over or self.applications >= self._limit:
            stop()
        else:
            self._stop_trigger = stop

    def _about_axis(self, trigger: Trigger | EventSelector) -> Trigger:
        drive = self.fault.parameters.get("drive")
        return about_axis(self._bench, as_trigger(trigger), self.target, str(drive or ""))

    def _fired(self) -> None:
        """Apply outside of the component that caused the trigger, at the same instant."""
        if self.over:
            return
        if self.active or self._pending:
            self._emit("fault.skipped", applications=self.applications)
            return
        if self._bench.scheduler.running:
            self._pending = True
            self._bench.scheduler.at(self._bench.scheduler.now, self._apply)
        else:
            self._apply()

    def _apply(self) -> None:
        self._pending = False
        if self.over or self.active:
            return
        now = self._bench.scheduler.now
        if self.applied_ns is None:
            self.applied_ns = now
        self.applications += 1
        last = self.applications >= self._limit
        self.active = True
        details = {"momentary": True} if self._action.remove is None else {}
        self._emit("fault.applied", **self.fault.parameters, **details)
        try:
            self._action.apply()
        except HilError:
            # Refused when its trigger came: nothing has to be taken back.
            self.active = False
            self._finish()
            raise
        if self._has_ended():
            return
        if self._action.remove is None:
            self.active = False
            self.removed_ns = now
            if last:
                self._finish()
            return
        if last:
            self._stop_watching()
        if self.fault.duration_s is not None:
            self._ends.append(
                self._bench.scheduler.after(seconds_to_ns(self.fault.duration_s), self._end).cancel
            )
        if self.fault.until is not None:
            until = self._about_axis(self.fault.until)
            stop = watch(self._bench, until, self._until, f"fault{self.number}.until")
            if self._has_ended():
                stop()
            else:
                self._ends.append(stop)

    def _has_ended(self) -> bool:
        return not self.active

    def _until(self) -> None:
        if self._bench.scheduler.running:
            self._bench.scheduler.at(self._bench.scheduler.now, self._end)
        else:
            self._end()

    def _report_hit(self, hit: int, **data: Scalar) -> None:
        """Log a frame or telegram that is hit: it may leave no other mark."""
        self._emit("fault.hit", hit=hit, **data)

    def _end(self) -> None:
        if not self.active:
            return
        self.active = False
        self.removed_ns = self._bench.scheduler.now
        for stop in self._ends:
            stop()
        self._ends = []
        if self._action.remove is not None:
            self._action.remove()
        self._emit("fault.removed")
        if self.applications >= self._limit:
            self._finish()

    def _finish(self) -> None:
        self.over = True
        self._stop_watching()

    def _stop_watching(self) -> None:
        if self._stop_trigger is not None:
            self._stop_trigger()
            self._stop_trigger = None

    def remove(self) -> None:
        """End the fault now; one that still waits for its trigger is disarmed. Harmless when it is over."""
        if self.over:
            return
        was_active = self.active
        self._end()
        if not self.over:
            self._finish()
        if not was_active and self.applied_ns is None:
            self._emit("fault.disarmed")

    def note_waiting(self) -> None:
        """Log that the fault waits for its trigger, if it does: it has never
        come, or fewer times than wanted.
        """
        if not self.over and not self.active:
            summary = self.waiting_summary()
            reason = {"reason": summary} if summary else {}
            self._emit(
                "fault.waiting",
                applications=self.applications,
                trigger=str(self.fault.trigger),
                **reason,
            )

    def waiting_summary(self) -> str:
        """Return what came in place of the trigger, `velocity of x peaked at 0, asked 45 mm/s`; empty once it
        has fired, or is not watched any more.
        """
        if self.over or self.active or self.applications or self._stop_trigger is None:
            return ""
        return why_not_fired(self._bench, self._trigger, self.armed_ns)

    def _emit(self, kind: str, **data: Scalar) -> None:
        self._bench.history.emit(self.target, kind, fault=self.fault.kind, injection=self.number, **data)

    @property
    def stands(self) -> str:
        """`armed`, `active` or `over`."""
        return "active" if self.active else "over" if self.over else "armed"

    def __repr__(self) -> str:
        return f"<ArmedFault {self.number} {self.fault} {self.stands}>"


_LIVING: Final[WeakSet[Injector]] = WeakSet()
_NUMBERS: Final = count(1)


class Injector:
    """Arms faults on a bench.

    Args:
        bench: Any bench that satisfies `hil.protocols.Bench`.

    """

    def __init__(self, bench: Bench) -> None:
        self.bench = bench
        self.armed: list[ArmedFault] = []
        """All faults armed so far, also those that are over."""
        self.number = next(_NUMBERS)
        """1, 2, ... in the order of making, over all benches."""
        _LIVING.add(self)

    def arm(self, fault: Fault) -> ArmedFault:
        """Arm a fault.

        Raises:
            UnsupportedFaultError: This bench cannot inject it; the message says why.
            ConfigurationError: It names a part, message or signal that the bench does not have.

        """
        armed = ArmedFault(self, fault, len(self.armed) + 1)
        self.armed.append(armed)
        try:
            armed.arm()
        except HilError:
            self.armed.remove(armed)
            raise
        return armed

    def inject(
        self,
        kind: str,
        target: str = "",
        *,
        trigger: Trigger | EventSelector | None = None,
        until: Trigger | EventSelector | None = None,
        duration_s: float | None = None,
        count: int | None = None,
        **parameters: Scalar,
    ) -> ArmedFault:
        """Arm a fault given by its fields; without a trigger it is applied at once."""
        return self.arm(
            Fault(
                kind,
                target,
                trigger if trigger is not None else Immediately(),
                until,
                duration_s,
                count,
                parameters,
            )
        )

    @staticmethod
    def all_of(bench: Bench) -> list[Injector]:
        """Return the injectors of a bench that are still in use, in the order in which they were made."""
        return sorted((one for one in _LIVING if one.bench is bench), key=lambda one: one.number)

    def waiting_summary(self) -> list[str]:
        """Return a line for every fault whose trigger has not fired: `drive.fault on x_drive: armed, never
        fired: velocity of x peaked at 0, asked 45 mm/s`.
        """
        summary = [(armed, armed.waiting_summary()) for armed in self.armed]
        return [
            f"{armed.fault.kind} on {armed.target}: armed, never fired: {reason}"
            for armed, reason in summary
            if reason
        ]

    def __repr__(self) -> str:
        faults = ", ".join(f"{armed.fault.kind} on {armed.target} {armed.stands}" for armed in self.armed)
        return f"<Injector of {faults or 'no fault'}>"

    def note_waiting(self) -> None:
        """Log every fault that waits for its trigger still, as at the end of a recording."""
        for armed in self.armed:
            armed.note_waiting()

    def remove_all(self) -> None:
        """End every fault, newest first; one that cannot be ended does not stop the others.

        Raises:
            HilError: The error of the first one that cannot be ended.

        """
        errors = []
        for armed in reversed(self.armed):
            try:
                armed.remove()
            except HilError as error:
                errors.append(error)
        if errors:
            raise errors[0]
