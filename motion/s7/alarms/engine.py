"""Pending technology alarms of one object: words, error detail, acknowledging, restart."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

from motion.s7.alarms.catalogue import AlarmEntry, AlarmError, alarm, severity

if TYPE_CHECKING:
    from fieldbus.history import History

_CLASS_RANK = {"R": 2, "F": 1, "W": 0}


class PendingAlarm:
    """A technology alarm that has been raised and not yet cleared."""

    __slots__ = ("entry", "info", "number", "reaction", "restart", "sequence", "text")

    def __init__(  # noqa: PLR0917 - made by the engine only
        self, entry: AlarmEntry, reaction: int, info: int, text: str, restart: bool, sequence: int
    ) -> None:
        self.entry = entry
        self.number = entry.number
        self.reaction = reaction
        """`ErrorDetail.Reaction` of this occurrence."""
        self.info = info
        """Supplementary value; 0 without."""
        self.text = text
        self.restart = restart
        """Whether only a restart clears it."""
        self.sequence = sequence
        """Order of raising."""

    def __repr__(self) -> str:
        return f"<PendingAlarm {self.number} reaction {self.reaction} info {self.info}: {self.text}>"

    @property
    def priority(self) -> tuple[int, int, int]:
        """Sort key of `ErrorDetail`: effect, then class, then the earlier one;
        the largest is shown (TA-004).
        """
        return severity(self.reaction), _CLASS_RANK[self.entry.alarm_class], -self.sequence

    @property
    def stays_enabled(self) -> bool:
        """Whether the axis stays enabled after the ramp of this reaction (STP-589 to STP-591)."""
        return self.reaction in self.entry.stays_enabled


class DiagnosticEntry(NamedTuple):
    """One entry of the diagnostic buffer."""

    time_ns: int
    """Time of the history; 0 without one."""
    number: int
    reaction: int
    info: int
    text: str


class _Cause(NamedTuple):
    """A cause that is present, with what the alarm is raised with."""

    reaction: int | None
    info: int
    text: str
    restart: bool | None


class AlarmEngine:
    """The technology alarms of one technology object.

    It decides what is pending and what the data block shows. What an alarm does to the object is left to
    `on_alarm`, which is called at the moment of raising, after the words have changed.

    Args:
        name: Source of history events.
        object_type: Type of the technology object; it decides which alarms are
            possible and the reaction shown.
        history: Log for `alarm.raised`, `alarm.detail` (its text is completed), `alarm.gone` (a cause held by
            `set_cause` has ended, the alarm is still pending), `alarm.acknowledged` and `alarm.cleared`.
        on_alarm: Called with every new alarm, and with a pending one whose reaction became stronger.

    """

    def __init__(
        self,
        name: str,
        *,
        object_type: str = "PositioningAxis",
        history: History | None = None,
        on_alarm: Callable[[PendingAlarm], None] | None = None,
    ) -> None:
        self._name = name
        self._object_type = object_type
        self._history = history
        self._on_alarm = on_alarm
        self._pending: dict[int, PendingAlarm] = {}
        self._causes: dict[int, _Cause] = {}
        self._waiting = False
        self._sequence = 0
        self.error_word = 0
        """`ErrorWord`: bits of the pending alarms of class F and R (VAR-085)."""
        self.warning_word = 0
        """`WarningWord`: bits of the pending alarms of class W."""
        self.number = 0
        """`ErrorDetail.Number`: the pending alarm of the highest priority, 0 without (TA-003)."""
        self.reaction = 0
        """`ErrorDetail.Reaction`."""
        self.diagnostic_buffer: list[DiagnosticEntry] = []
        """Alarms that the system records in its diagnostic buffer, in the order of raising (TA-011)."""

    # -- state
    # ------------------------------------------------------------------------------------------------

    @property
    def error(self) -> bool:
        """`StatusWord.X1`: an alarm of class F or R is pending (VAR-029)."""
        return self.error_word != 0

    @property
    def pending(self) -> tuple[PendingAlarm, ...]:
        """The pending alarms in the order of raising."""
        return tuple(self._pending.values())

    @property
    def highest(self) -> PendingAlarm | None:
        """The pending alarm that `ErrorDetail` shows; None without."""
        return self._pending[self.number] if self.number else None

    def is_pending(self, number: int) -> bool:
        """Return whether alarm `number` is pending."""
        return number in self._pending

    def cause_active(self, number: int) -> bool:
        """Return whether the cause of alarm `number` is held by `set_cause`."""
        return number in self._causes

    # -- raising
    # ----------------------------------------------------------------------------------------------

    def raise_alarm(
        self,
        number: int,
        *,
        reaction: int | None = None,
        info: int = 0,
        text: str = "",
        restart: bool | None = None,
    ) -> PendingAlarm:
        """Raise an alarm; one that is pending already changes only if `reaction` is stronger than before.

        Args:
            number: Number in the catalogue.
            reaction: One of the alarm's reactions, for those that depend on the configuration; None takes
                the usual.
            info: Supplementary value; it numbers the causes of the catalogue from 1 (TA-013).
            text: Detail in place of the cause from the catalogue.
            restart: Whether only a restart clears it, for an alarm where that depends on the cause (531).

        Raises:
            AlarmError: Unknown alarm, not one of this object type, or a reaction that it does not have.

        """
        pending = self._pending.get(number)
        if pending is not None and (reaction is None or severity(reaction) <= severity(pending.reaction)):
            return pending
        entry = alarm(number)
        reaction = self._check(entry, reaction, restart)
        full = f"{entry.text}: {text}" if text else entry.describe(info)
        self._sequence += 1
        clear_by_restart = bool(entry.restart if entry.restart is not None else restart)
        sequence = self._sequence if pending is None else pending.sequence
        raised = self._pending[number] = PendingAlarm(entry, reaction, info, full, clear_by_restart, sequence)
        self._refresh()
        if self._history is not None:
            self._history.emit(
                self._name,
                "alarm.raised",
                number=number,
                reaction=reaction,
                text=full,
                info=info,
                alarm_class=entry.alarm_class,
            )
        if entry.diagnostic_buffer:
            time_ns = self._history.events[-1].time_ns if self._history is not None else 0
            self.diagnostic_buffer.append(DiagnosticEntry(time_ns, number, reaction, info, full))
        if self._on_alarm is not None:
            self._on_alarm(raised)
        return raised

    def set_cause(
        self,
        number: int,
        active: bool,
        *,
        reaction: int | None = None,
        info: int = 0,
        text: str = "",
        restart: bool | None = None,
    ) -> None:
        """Say whether the cause of an alarm is present; cheap to call in every cycle.

        A cause raises its alarm, and again after each acknowledgement while it lasts (TA-007). When it goes,
        the alarm stays until it is acknowledged.

        Raises:
            AlarmError: As `raise_alarm`.

        """
        if not active:
            if number in self._causes:
                del self._causes[number]
                if self._history is not None and number in self._pending:
                    self._history.emit(self._name, "alarm.gone", number=number)
            return
        if number in self._causes and number in self._pending:
            return
        self._causes[number] = _Cause(reaction, info, text, restart)
        self.raise_alarm(number, reaction=reaction, info=info, text=text, restart=restart)

    def add_detail(self, number: int, text: str) -> None:
        """Complete the text of a pending alarm whose cause lasts, with what was not known when it was raised.

        Args:
            number: Number of the alarm; one that is not pending stays as it is.
            text: Detail in place of the one of before.

        """
        cause = self._causes.get(number)
        if cause is not None:
            self._causes[number] = cause._replace(text=text)
        pending = self._pending.get(number)
        if pending is None:
            return
        pending.text = f"{pending.entry.text}: {text}"
        if self._history is not None:
            self._history.emit(self._name, "alarm.detail", number=number, text=pending.text)

    def update(self) -> None:
        """Raise the alarms again that have been acknowledged although their
        cause is present; once per cycle.
        """
        if not self._waiting:
            return
        self._waiting = False
        for number, cause in tuple(self._causes.items()):
            if number not in self._pending:
                self.raise_alarm(number, **cause._asdict())

    # -- clearing
    # ---------------------------------------------------------------------------------------------

    def acknowledge(self) -> tuple[int, ...]:
        """Clear all alarms but those that need a restart (`MC_Reset`; TA-007, TA-008).

        Returns:
            Numbers of the alarms that stay pending.

        """
        return self._clear([number for number, alarm in self._pending.items() if not alarm.restart])

    def restart(self) -> tuple[int, ...]:
        """Clear all alarms (`MC_Reset` with `Restart` = TRUE; STP-079); returns an
        empty tuple, as `acknowledge`.
        """
        return self._clear(list(self._pending))

    def power_down(self) -> None:
        """Forget all alarms and what caused them, as a controller without supply does."""
        self._causes.clear()
        self._clear(list(self._pending))

    def _clear(self, numbers: list[int]) -> tuple[int, ...]:
        history = self._history
        if history is not None and self._pending:
            history.emit(self._name, "alarm.acknowledged", pending=len(self._pending), cleared=len(numbers))
        for number in numbers:
            del self._pending[number]
        self._refresh()
        if history is not None:
            for number in numbers:
                history.emit(self._name, "alarm.cleared", number=number)
        self._waiting = bool(self._causes)
        return tuple(self._pending)

    def check(self, number: int, reaction: int | None = None) -> None:
        """Refuse what `raise_alarm` would refuse.

        Raises:
            AlarmError: Unknown alarm, not one of this object type, or a reaction that it does not have.

        """
        self._check(alarm(number), reaction, None)

    # -- inside
    # -----------------------------------------------------------------------------------------------

    def _check(self, entry: AlarmEntry, reaction: int | None, restart: bool | None) -> int:
        """Return the reaction to use; refuse what the catalogue does not provide for."""
        object_type = self._object_type
        if object_type not in entry.applies_to:
            raise AlarmError(
                f"alarm {entry.number} cannot occur on {object_type}, only on {', '.join(entry.applies_to)}"
            )
        if restart is not None and entry.restart is not None and restart is not entry.restart:
            raise AlarmError(f"alarm {entry.number} has a fixed way of clearing it")
        usual = entry.reaction_of(object_type)
        if reaction is None or reaction == usual:
            return usual
        if reaction not in entry.reactions or usual != entry.reactions[0]:
            allowed = entry.reactions if usual == entry.reactions[0] else (usual,)
            raise AlarmError(
                f"alarm {entry.number} has no reaction {reaction}; it has {', '.join(map(str, allowed))}"
            )
        return reaction

    def _refresh(self) -> None:
        """Derive words and detail from the pending alarms."""
        errors = warnings = 0
        first: PendingAlarm | None = None
        for pending in self._pending.values():
            entry = pending.entry
            if entry.error_bit is not None:
                errors |= 1 << entry.error_bit
            if entry.warning_bit is not None:
                warnings |= 1 << entry.warning_bit
            if first is None or pending.priority > first.priority:
                first = pending
        self.error_word = errors
        self.warning_word = warnings
        self.number = first.number if first is not None else 0
        self.reaction = first.reaction if first is not None else 0
