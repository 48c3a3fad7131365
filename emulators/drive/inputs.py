"""Digital inputs of the drive: the switches as 60FDh shows them (C402-139, C402-168)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Final

from emulators.drive.machine import INPUT_BITS, PROBE_INPUTS
from emulators.mechanics import SwitchModel
from fieldbus.clock import Scheduler, Timer, seconds_to_ns

LIMIT_SWITCHES: Final = ("negative_limit", "positive_limit")


class DigitalInputs:
    """Reads switches, filtered, into the bits of 60FDh.

    A change shows at the servo instant behind it, or when it has lasted for the filter time. Probe inputs
    have no filter: every edge of theirs goes to `on_probe` at once.

    Args:
        scheduler: Time of the filter.
        switches: Switches by input name.
        filter_s: Returns the filter time of an input by its name, s; 0 = none.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        switches: Mapping[str, SwitchModel],
        *,
        filter_s: Callable[[str], float],
    ) -> None:
        self._scheduler = scheduler
        self._filters_ns = {1 << INPUT_BITS[name]: seconds_to_ns(filter_s(name)) for name in switches}
        self._switches = {1 << INPUT_BITS[name]: switch for name, switch in switches.items()}
        self._timers: dict[int, Timer] = {}
        self._followers: dict[int, list[Callable[[bool], object]]] = {}
        self._levels = 0
        self.fitted = sum(self._switches)
        """Bits that a switch is wired to."""
        self.swapped = False
        """The wires of the limit switches are exchanged."""
        self.value = 0
        """60FDh; what is not wired is 0."""
        self.on_change: Callable[[int], None] = _nothing
        """Called with the value before, after every change."""
        self.on_probe: Callable[[int, SwitchModel], None] = _no_probe
        """Called with the number of the probe, 1 or 2, at every edge of its input,
        within the step of the machine.
        """
        for bit, switch in self._switches.items():
            switch.on_change = partial(self._changed, bit)
        for number, name in enumerate(PROBE_INPUTS, 1):
            if name in switches:
                switches[name].on_change = partial(self._probe_changed, 1 << INPUT_BITS[name], number)

    def read(self) -> None:
        """Take the present states over, unfiltered, as at power-on."""
        for timer in self._timers.values():
            timer.cancel()
        self._set(self._levels + sum(bit for bit, switch in self._switches.items() if switch.state))

    def set_level(self, bit: int, active: bool) -> None:
        """Set an input that is no switch on the travel, `bit` as it shows in 60FDh."""
        self._levels = self._levels | bit if active else self._levels & ~bit
        self._set(self.value | bit if active else self.value & ~bit)

    def follow(self, name: str, follower: Callable[[bool], object]) -> None:
        """Bring the level of a switch to another input, too, as it is in front of the filter of this one:
        now and after every change.

        Args:
            name: Input that the switch is wired to.
            follower: Called with the level.

        """
        bit = 1 << INPUT_BITS[name]
        self._followers.setdefault(bit, []).append(follower)
        if bit in self._switches:
            follower(self._switches[bit].state)

    def swap_limits(self, swapped: bool) -> None:
        """Exchange the wires of the two limit switches, which both have to be
        fitted, or put them right again.
        """
        if swapped is self.swapped:
            return
        self.swapped = swapped
        first, second = (1 << INPUT_BITS[name] for name in LIMIT_SWITCHES)
        switches = self._switches
        switches[first], switches[second] = switches[second], switches[first]
        for bit in (first, second):
            switches[bit].on_change = partial(self._changed, bit)
            self._changed(bit)

    def _changed(self, bit: int) -> None:
        for follower in self._followers.get(bit, ()):
            follower(self._switches[bit].state)
        filter_ns = self._filters_ns[bit]
        if not filter_ns:
            self._take(bit)
            return
        timer = self._timers.get(bit)
        if timer is not None:
            timer.cancel()
        if self._switches[bit].state is not bool(self.value & bit):
            self._timers[bit] = self._scheduler.after(filter_ns, partial(self._take, bit))

    def _probe_changed(self, bit: int, number: int) -> None:
        self.on_probe(number, self._switches[bit])
        self._changed(bit)

    def _take(self, bit: int) -> None:
        self._set(self.value | bit if self._switches[bit].state else self.value & ~bit)

    def _set(self, value: int) -> None:
        before = self.value
        if value != before:
            self.value = value
            self.on_change(before)


def _nothing(_before: int) -> None:
    pass


def _no_probe(_number: int, _switch: SwitchModel) -> None:
    pass
