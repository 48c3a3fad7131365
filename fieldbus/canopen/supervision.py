"""Whether a node is alive, seen by the controller: heartbeat consumer and node guarding
(CiA 301; C301-023 to C301-030).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from fieldbus.canopen.nmt import NmtState
from fieldbus.clock import Scheduler, Timer

_UNKNOWN: Final = -1


class HeartbeatWatch:
    """One watched node; its timer is entered once per timeout, not once per heartbeat.

    Monitoring starts with the first heartbeat (C301-026), or with `expect`. A boot-up or a
    change of state is reported as such, never as a loss (C301-027); after a boot-up monitoring
    waits for the first heartbeat again.

    Args:
        scheduler: Time.
        timeout_ns: Longest silence, ns.
        on_lost: Called once per loss.
        on_back: Called with the first frame after a loss, before `on_state`.
        on_state: Called with the new state when it changes (0 = boot-up), and with the first after a loss.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        timeout_ns: int,
        *,
        on_lost: Callable[[], object],
        on_back: Callable[[], object],
        on_state: Callable[[int], object] | None = None,
    ) -> None:
        self._scheduler = scheduler
        self._timeout_ns = timeout_ns
        self._on_lost = on_lost
        self._on_back = on_back
        self._on_state = on_state
        self._timer: Timer | None = None
        self._last_ns = 0
        self.lost = False
        """Whether the heartbeat is missing."""
        self.state = _UNKNOWN
        """Last state reported; -1 = none since the start or the last loss."""

    def receive(self, data: bytes, time_ns: int) -> None:
        """Take a frame of the node's error control."""
        if len(data) != 1:
            return
        state = data[0] & 0x7F
        if state == NmtState.INITIALISING:
            self.stop()
        else:
            self._last_ns = time_ns
            if self._timer is None:
                self._arm(time_ns + self._timeout_ns)
        if self.lost:
            self.lost = False
            self._on_back()
        if state != self.state:
            self.state = state
            if self._on_state is not None:
                self._on_state(state)

    def expect(self) -> None:
        """Start monitoring now if it has not begun: the node has been configured to send heartbeats."""
        if self._timer is None and not self.lost:
            self._last_ns = self._scheduler.now
            self._arm(self._last_ns + self._timeout_ns)

    def stop(self) -> None:
        """Suspend monitoring until the next heartbeat."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _arm(self, due_ns: int) -> None:
        self._timer = self._scheduler.at(max(due_ns, self._scheduler.now), self._due)

    def _due(self) -> None:
        self._timer = None
        due = self._last_ns + self._timeout_ns
        if due > self._scheduler.now:
            self._arm(due)
            return
        self.lost = True
        self.state = _UNKNOWN
        self._on_lost()


class NodeGuard:
    """Guards a node that sends no heartbeat: asks by remote frames and checks the
    answers (C301-028 to C301-030).

    The first answer after a boot-up has toggle bit 0, and it changes with every answer. One without the
    change counts as none: it may come from a node that has restarted. When no right answer has come within
    the life time (guard time times factor) the node is lost; polling continues, and the first answer after
    that sets the toggle bit expected from then on.

    Args:
        scheduler: Time.
        ask: Sends the remote frame.
        guard_time_ns: Period of the questions, ns.
        life_time_factor: Periods without a right answer after which the node is lost.
        on_lost: Called once per loss, with the reason.
        on_back: Called with the first answer after a loss, before `on_state`.
        on_state: Called with the new state when it changes, and with the first after a loss.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        ask: Callable[[], object],
        *,
        guard_time_ns: int,
        life_time_factor: int,
        on_lost: Callable[[str], object],
        on_back: Callable[[], object],
        on_state: Callable[[int], object] | None = None,
    ) -> None:
        self._scheduler = scheduler
        self._ask = ask
        self._period_ns = guard_time_ns
        self._life_ns = guard_time_ns * life_time_factor
        self._on_lost = on_lost
        self._on_back = on_back
        self._on_state = on_state
        self._timer: Timer | None = None
        self._answered_ns = 0  # when the last question was asked that got a right answer
        self._asked_ns = 0
        self._toggle = 0
        self._wrong = False
        self.lost = False
        """Whether the answers are missing."""
        self.state = _UNKNOWN
        """Last state reported; -1 = none since the start or the last loss."""
        self.toggle_errors = 0
        """Answers whose toggle bit had not changed."""

    @property
    def running(self) -> bool:
        """Whether questions are asked."""
        return self._timer is not None

    def start(self) -> None:
        """Ask now and every guard time; harmless to repeat."""
        if self._timer is None:
            self._answered_ns = self._scheduler.now
            self._wrong = False
            self._question()

    def stop(self) -> None:
        """Stop asking."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def restarted(self) -> None:
        """Note that the node has restarted: its next answer has toggle bit 0."""
        self._toggle = 0
        self._answered_ns = self._scheduler.now
        self.lost = False
        self.state = _UNKNOWN

    def receive(self, data: bytes, _time_ns: int) -> None:
        """Take a frame of the node's error control; boot-ups are the owner's."""
        if len(data) != 1 or data[0] == 0:
            return
        toggle = data[0] & 0x80
        if toggle != self._toggle and not self.lost:
            self.toggle_errors += 1
            self._wrong = True
            return
        self._toggle = toggle ^ 0x80
        self._wrong = False
        self._answered_ns = self._asked_ns
        if self.lost:
            self.lost = False
            self._on_back()
        state = data[0] & 0x7F
        if state != self.state:
            self.state = state
            if self._on_state is not None:
                self._on_state(state)

    def _question(self) -> None:
        now = self._scheduler.now
        self._timer = self._scheduler.after(self._period_ns, self._question)
        if not self.lost and now - self._answered_ns >= self._life_ns:
            self.lost = True
            self.state = _UNKNOWN
            self._on_lost("toggle bit" if self._wrong else "no answer")
        self._asked_ns = now
        self._ask()
