"""What ports over a bus share: whether the drive is in service, and how long its
actual values have stayed away.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from fieldbus.errors import ConfigurationError
from motion.drives.port import DrivePort

if TYPE_CHECKING:
    from fieldbus.history import History

GRACE_CYCLES: Final = 3
"""Cycles without an actual value after which the link counts as lost."""


@dataclass(frozen=True, kw_only=True)
class LinkConfig:
    """What holds for a drive on any bus.

    Args:
        cycle_ns: Bus cycle, ns; a whole number of milliseconds.
        absolute_encoder: The encoder keeps its position over power-off.
        grace_cycles: Cycles without data until the link counts as lost.
        optional: The bench is ready without this drive.

    Raises:
        ConfigurationError: The cycle is out of range.

    """

    cycle_ns: int
    absolute_encoder: bool = False
    grace_cycles: int = GRACE_CYCLES
    optional: bool = False

    def __post_init__(self) -> None:
        if self.cycle_ns <= 0 or self.cycle_ns % 1_000_000:
            raise ConfigurationError("cycle", f"{self.cycle_ns} ns", "a whole number of milliseconds")


class LinkedPort(DrivePort):
    """A port whose drive can be lost and come back.

    Args:
        config: What holds for the drive on any bus.
        name: Name of the drive in the history.
        history: Log for link and drive events; None for none.

    """

    __slots__ = ("_cycle_ns", "_grace", "_history", "_in_service", "_link_age", "name", "optional")

    def __init__(self, config: LinkConfig, *, name: str, history: History | None) -> None:
        super().__init__()
        self.name = name
        self.absolute_encoder = config.absolute_encoder
        self.optional = config.optional
        self._history = history
        self._cycle_ns = config.cycle_ns
        self._grace = self._link_age = config.grace_cycles
        self._in_service = False

    @property
    def delay_ns(self) -> int:
        """Time from a setpoint to the actual value that it makes, as the axis sees it, without the lag of the
        drive, ns.
        """
        return 2 * self._cycle_ns

    def drive_restarted(self) -> None:
        """Take note that the drive has started again: an incremental count has lost its reference."""
        self.encoder_restarts += 1

    def enter_service(self) -> None:
        """Take note that from now on cyclic data mean what they should."""
        self._in_service = True

    def leave_service(self) -> None:
        """Take note that the drive is lost: the link is down until it is in service
        again and sends something new.
        """
        self._in_service = False
        self._link_age = self._grace

    def power_down(self) -> None:
        """Forget the drive, as a controller without supply does; nothing is logged."""
        self.leave_service()
        self.link_ok = False
        self.zsw1 = 0

    def emit(self, kind: str, **data: str | float | bool) -> None:
        """Write an event of this drive into the log, if there is one."""
        if self._history is not None:
            self._history.emit(self.name, kind, **data)

    def _judge(self, fresh: bool, valid: bool = True) -> bool:
        """Say once per cycle whether there is a link.

        Args:
            fresh: Actual values have come since the last cycle.
            valid: They count; False ends the link at once.

        """
        if fresh:
            self._link_age = 0 if valid else self._grace
        elif self._link_age < self._grace:
            self._link_age += 1
        alive = self._link_age < self._grace and self._in_service
        if alive is not self.link_ok:
            self.link_ok = alive
            self.emit("link.up" if alive else "link.down")
        if not alive:
            self.zsw1 = 0
        return alive
