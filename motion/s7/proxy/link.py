"""The way of leading values from one controller to another, with the disturbances of a test."""

from __future__ import annotations

from typing import TYPE_CHECKING

from motion.s7.proxy.telegram import LeadingTelegram

if TYPE_CHECKING:
    from collections.abc import Callable

    from fieldbus.clock import Scheduler
    from motion.s7.axis import TechnologyAxis

_SIGNS = 1 << 16


class LeadingValueLink:
    """Sends the leading value of an axis in every application cycle of its controller.

    Args:
        scheduler: Time.
        axis: Leading axis.
        interface: Its interface, 1 to 32: nothing is sent while
            `CrossPlcSynchronousOperation.Interface[n].EnableLeadingValueOutput` is FALSE (SYN-071).
        delay_ns: Time that a telegram takes, ns.

    """

    def __init__(
        self, scheduler: Scheduler, axis: TechnologyAxis, *, interface: int = 1, delay_ns: int = 0
    ) -> None:
        self._scheduler = scheduler
        self._axis = axis
        read = axis.variables.bind
        across = "CrossPlcSynchronousOperation."
        self.output = f"{across}Interface[{interface}].EnableLeadingValueOutput"
        """Variable of the leading axis that lets it send."""
        self._enabled = read(self.output)
        self._local_delay = read(f"{across}LocalLeadingValueDelayTime")
        self.delay_ns = delay_ns
        """Time that a telegram takes, ns; telegrams under way keep theirs."""
        self.lost = False
        """Telegrams are lost."""
        self.disturb: Callable[[LeadingTelegram], None] | None = None
        """Changes each telegram before it is sent; None: nobody does."""
        self.received: bytes | None = None
        """Telegram that has arrived last; None: none yet."""
        self._sign = 0

    @property
    def enabled(self) -> bool:
        """Whether the leading axis sends its value."""
        return bool(self._enabled.value)

    def send(self) -> None:
        """Send the value of this cycle; called when the leading axis has been calculated."""
        if not self._enabled.value:
            return
        axis = self._axis
        position, velocity, acceleration = axis.servo.leading_setpoint()
        modulo = axis.servo.modulo
        self._sign = (self._sign + 1) % _SIGNS
        telegram = LeadingTelegram(
            modulo.wrap(position),
            velocity,
            acceleration,
            self._sign,
            round(self._local_delay.value * 1e6),
            modulo.start if modulo.enabled else 0.0,
            modulo.length if modulo.enabled else 0.0,
            valid=axis.gives_value(),
            control=axis.servo.controlled,
        )
        if self.disturb is not None:
            self.disturb(telegram)
        if self.lost:
            return
        data = telegram.encode()
        if self.delay_ns:
            self._scheduler.after(self.delay_ns, lambda: self._arrive(data))
        else:
            self._arrive(data)

    def _arrive(self, data: bytes) -> None:
        self.received = data
