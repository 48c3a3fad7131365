"""Technology alarms of an axis: which are pending, and what that means for it."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Final

from motion.s7.alarms import AlarmEngine, PendingAlarm

if TYPE_CHECKING:
    from fieldbus.history import History

ALARM_RANGE_REACHED: Final = 307
ALARM_RANGE_EXCEEDED: Final = 308
ALARM_ACTUAL_VALUE: Final = 412
ALARM_FOLLOWING_ERROR: Final = 521
ALARM_FOLLOWING_ERROR_WARNING: Final = 522
ALARM_POSITIONING: Final = 541
ALARM_ADDRESS: Final = 401
INPUT_ADDRESS: Final = 2
"""Cause of 401, as the catalogue numbers them (TA-013)."""


class AxisAlarms:
    """The pending alarms of one axis and what they mean for it.

    `blocking`, `disabling` and `stop_severity` are kept up to date, so that the cycle reads plain attributes.

    Args:
        name: Name of the axis.
        object_type: Type of the technology object.
        history: Event log, or None.

    """

    def __init__(self, name: str, object_type: str, history: History | None) -> None:
        self.engine = AlarmEngine(name, object_type=object_type, history=history, on_alarm=self._on_alarm)
        self.on_reaction: Callable[[int], object] | None = None
        """Called with the reaction of every new alarm that has one."""
        self.blocking = False
        """An alarm with a reaction is pending: motion jobs are refused (MC-123)."""
        self.disabling = False
        """A pending alarm disables the axis at the end of its ramp."""
        self.stop_severity = 0
        """Highest reaction 1..4 that is pending, 0 for none."""
        self._warned: set[int] = set()

    def refresh(self) -> None:
        """Derive the summary flags from the pending alarms."""
        blocking = disabling = False
        severity = 0
        for entry in self.engine.pending:
            reaction = entry.reaction
            if reaction == 0:
                continue
            blocking = True
            severity = max(severity, min(reaction, 4))
            if not entry.stays_enabled:
                disabling = True
        self.blocking = blocking
        self.disabling = disabling
        self.stop_severity = severity

    def raise_alarm(
        self,
        number: int,
        *,
        reaction: int | None = None,
        info: int = 0,
        text: str = "",
        restart: bool | None = None,
    ) -> None:
        """Raise alarm `number`; `reaction` and `restart` for those of which they
        depend on configuration or cause.
        """
        self.engine.raise_alarm(number, reaction=reaction, info=info, text=text, restart=restart)

    def set_cause(
        self, number: int, active: bool, *, reaction: int | None = None, info: int = 0, text: str = ""
    ) -> None:
        """Say whether the cause of alarm `number` is present; while it is, acknowledging does not help."""
        self.engine.set_cause(number, active, reaction=reaction, info=info, text=text)

    def add_detail(self, number: int, text: str) -> None:
        """Complete the text of a pending alarm with what was not known when it was raised."""
        self.engine.add_detail(number, text)

    def warn(self, number: int, info: int = 0) -> None:
        """Raise a warning once until it is acknowledged; cheap to call every cycle."""
        if number not in self._warned:
            self._warned.add(number)
            self.engine.raise_alarm(number, info=info)

    def watch_inputs(self, readable: bool, *, expected: bool) -> None:
        """Raise 401 while the switches of an axis in operation cannot be read; a lost drive
        has an alarm of its own (TA-020).

        Args:
            readable: The switches can be read.
            expected: The drive is in operation, and not lost.

        """
        engine = self.engine
        held = engine.cause_active(ALARM_ADDRESS)
        if held or not readable:
            engine.set_cause(ALARM_ADDRESS, not readable and (held or expected), info=INPUT_ADDRESS)

    def acknowledge(self) -> None:
        """Clear what can be cleared (`MC_Reset`); causes still present raise their
        alarm again at once (STP-072).

        So there is no cycle in which the words of the object know nothing of a fault that lasts.
        """
        self._warned.clear()
        self.engine.acknowledge()
        self.engine.update()
        self.refresh()

    def restart(self) -> None:
        """Clear everything whose cause is gone, fatal alarms included."""
        self._warned.clear()
        self.engine.restart()
        self.refresh()

    def power_down(self) -> None:
        """Forget all alarms and their causes."""
        self._warned.clear()
        self.engine.power_down()
        self.refresh()

    def _on_alarm(self, entry: PendingAlarm) -> None:
        self.refresh()
        if entry.reaction and self.on_reaction is not None:
            self.on_reaction(entry.reaction)


class MonitoringAlarms:
    """The alarms of what monitoring finds.

    Args:
        alarms: The alarms of the axis.

    """

    def __init__(self, alarms: AxisAlarms) -> None:
        self._alarms = alarms

    def following_error(self) -> None:
        """Raise 521."""
        self._alarms.raise_alarm(ALARM_FOLLOWING_ERROR)

    def following_error_near(self) -> None:
        """Raise 522, once until it is acknowledged."""
        self._alarms.warn(ALARM_FOLLOWING_ERROR_WARNING)

    def not_positioned(self, *, left: bool) -> None:
        """Raise 541."""
        self._alarms.raise_alarm(ALARM_POSITIONING, info=2 if left else 1)

    def end_of_range(self, *, positive: bool, exceeded: bool) -> None:
        """Raise 307 or 308."""
        number = ALARM_RANGE_EXCEEDED if exceeded else ALARM_RANGE_REACHED
        self._alarms.raise_alarm(number, info=2 if positive else 1)

    def implausible_velocity(self) -> None:
        """Raise 412."""
        self._alarms.raise_alarm(ALARM_ACTUAL_VALUE, info=3)
