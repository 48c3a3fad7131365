"""A cable break: the virtual segment in two parts that each live on, until the cable is mended."""
# ruff: noqa: SLF001 - the two parts are of one class and hand their nodes over to each other

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, cast

from fieldbus.can.bitwise import BitwiseSegment
from fieldbus.can.controller import Controller
from fieldbus.can.port import MediumPort
from fieldbus.clock import Scheduler
from fieldbus.errors import BusError
from fieldbus.history import History

if TYPE_CHECKING:
    from fieldbus.can.medium import CanMedium


class DivisibleSegment(BitwiseSegment):
    """Base of `CanMedium`; see there."""

    def __init__(
        self, scheduler: Scheduler, *, bitrate: int, name: str, history: History | None, keep_log: bool
    ) -> None:
        super().__init__(scheduler, bitrate=bitrate, name=name, history=history, keep_log=keep_log)
        self._far_sides: list[DivisibleSegment] = []

    def _far_side(self) -> DivisibleSegment:
        """Return an empty segment that shares log, events and hooks with this one."""
        raise NotImplementedError

    @property
    def ports(self) -> tuple[MediumPort, ...]:
        """The attached nodes in the order in which they came, those behind a break at the end."""
        return (*self._nodes, *(port for side in self._far_sides for port in side._nodes))

    def port(self, name: str) -> MediumPort:
        """Return the node `name`.

        Raises:
            BusError: There is none; the message lists the names.

        """
        for port in self.ports:
            if port.name == name:
                return port
        known = ", ".join(port.name for port in self.ports) or "none"
        raise BusError(f"no node {name!r} on {self.name}; nodes: {known}")

    def cut(self, names: Iterable[str]) -> Callable[[], None]:
        """Break the cable: the nodes `names` go on among themselves, and so do the others (CANP-078).

        Frames of both sides are in the one log. Injected frames reach the near side only.

        Returns:
            The function that mends the cable; harmless to repeat. What is on the wire on the two sides then
            collides.

        Raises:
            BusError: No such node, or it is behind another break.

        """
        ports = [self.port(name) for name in dict.fromkeys(names)]
        for port in ports:
            if port not in self._nodes:
                raise BusError(f"{port.name} is cut off from {self.name} already")
        far = self._far_side()
        if self._entry is not None or self._bitwise:
            self._follow_bitwise()
        far._sequence = self._sequence
        far._free_ns = self._free_ns
        far._quiet_since_ns = self._quiet_since_ns
        self._far_sides.append(far)
        if self._bitwise:
            far._join_grid(self._grid_ns, self._bit)
        self._hand_over(ports, far)
        if far._bitwise:
            far._next_bit()

        def mend() -> None:
            if far in self._far_sides:
                self._far_sides.remove(far)
                self._rejoin(far)

        return mend

    def _rejoin(self, far: DivisibleSegment) -> None:
        self._sequence = far._sequence = max(self._sequence, far._sequence)
        busy = self._entry is not None or self._bitwise or far._entry is not None or far._bitwise
        if busy or max(self._free_ns, far._free_ns) > self.scheduler.now:
            self._follow_bitwise()
            far._follow_bitwise()
        far._hand_over(list(far._nodes), self)
        far._retire()

    def _hand_over(self, ports: list[MediumPort], other: DivisibleSegment) -> None:
        """Move `ports` with their controllers to the segment `other`."""
        moved: list[Controller] = [one for one in self._controllers if one.port in ports]
        for controller in moved:
            if controller.entry is not None:
                other._on_wire = (controller.port.name, controller.entry[3])
            self._controllers.remove(controller)
            controller.host = other
            other._controllers.append(controller)
        for port in ports:
            self._nodes.remove(port)
            self._ports.remove(port)
            self._backlog -= len(port.queue)
            other._nodes.append(port)
            other._ports.append(port)
            other._backlog += len(port.queue)
            port.medium = cast("CanMedium", other)
            if port.recovery_timer is not None and not other._bitwise:
                other._await_recovery(port)
            elif other._bitwise and port not in [one.port for one in other._controllers] and port.online:
                other._add_controller(port)
        for side in (self, other):
            side.ports_changed()
            if not side._bitwise and side._backlog:
                side._arbitrate(max(side._free_ns, side.scheduler.now))

    def _retire(self) -> None:
        """Be a far side no more."""
        self._bitwise = self._asleep = False
        self._deciding = True  # nothing starts here any more
        self._disarm()

    def _hooks_changed(self) -> None:
        super()._hooks_changed()
        for side in self._far_sides:
            side._hook_entries = self._hook_entries
            side._hooks_changed()
