"""What the controller says: the setpoints and control words in effect (PD-030, PD-076)."""

from __future__ import annotations

from fieldbus.profidrive import Layout


class ProcessData:
    """Setpoints of the last telegram with control by PLC, and when telegrams came.

    Args:
        layout: Signals of the telegram from the controller.

    """

    def __init__(self, layout: Layout) -> None:
        self._places = {name: at for at, name in enumerate(layout.names)}
        self.row: tuple[int, ...] = (0,) * (len(layout.names) + 1)
        """Signals of the last telegram that was taken over, and a 0 for those that it does not have."""
        speed = "NSOLL_B" if "NSOLL_B" in self._places else "NSOLL_A"
        self.control_places = (self.place(speed), self.place("XERR"), self.place("KPC"), self.place("M_ADD1"))
        """Places of speed setpoint, position deviation, gain and additive torque in `row`."""
        self.stw1 = 0
        """That of the last frame with control by PLC, and bit 10 of the last frame (PD-076)."""
        self.stw2 = 0
        self.g1_stw = 0
        self.controlled_cyclically = False
        """Valid cyclic data have come since power-on (PD-081)."""
        self.cycle_at_ns = 0
        """Time of the last bus cycle."""
        self.received_at_ns = 0
        """Time of the last process data (PD-292)."""

    def place(self, name: str) -> int:
        """Return where a signal is in `row`; -1, the place of the 0, if the telegram does not have it."""
        return self._places.get(name, -1)

    def restart(self) -> None:
        """Begin as after power-on: no telegram has come yet."""
        self.stw1 = self.stw2 = self.g1_stw = 0
        self.controlled_cyclically = False
        self.row = (0,) * len(self.row)
