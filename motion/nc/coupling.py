"""Linear coupling of a slave to a master, and how errors reach the other (sections 4.6, 10.2, 10.3)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, Protocol

from motion.nc.errors import NO_ERROR, VELOCITY_LAG

if TYPE_CHECKING:
    from motion.nc.encoder import Encoder
    from motion.nc.motion import Motion
    from motion.nc.parameters import ParameterSet

_DELAYED: Final = 1
_SLACK: Final = 1e-9


class CoupledAxis(Protocol):
    """An axis as its coupling partners see it."""

    motion: Motion
    encoder: Encoder
    coupling: Coupling
    following_error: float

    @property
    def closed(self) -> bool:
        """Whether it is controlled."""

    def raise_error(self, error_id: int) -> None:
        """Put it into error."""


class Coupling:
    """What an axis is to others: single, master, slave, or both.

    Args:
        parameters: Parameters of the axis.
        motion: Its setpoints.
        cycle_s: Its cycle, s.

    """

    def __init__(self, parameters: ParameterSet, motion: Motion, *, cycle_s: float) -> None:
        cell = parameters.cell
        self._motion = motion
        self._cycle_s = cycle_s
        self._mode = cell("axis.error_propagation_mode")
        self._delay = cell("axis.error_propagation_delay")
        self._to_actual = cell("axis.couple_slave_to_actual")
        self._window = cell("axis.couple_velocity_window")
        self._window_time = cell("axis.couple_velocity_window_filter")
        self._kcp = cell("ctrl.kcp")
        self._start = 0.0
        self._master_start = 0.0
        self._failed_cycles = 0
        self._outside = 0
        self.master: CoupledAxis | None = None
        """Axis that leads; None: no slave."""
        self.slaves: list[CoupledAxis] = []
        """Axes that follow."""
        self.ratio = 1.0
        """Way of the slave for a unit of the master (Coupling Factor)."""
        self.delaying = False
        """An error waits to reach the master (`ErrorPropagationDelayed`)."""

    @property
    def state(self) -> int:
        """`CoupleState`: 0 single, 1 master, 2 master and slave, 3 slave (NC-473)."""
        if self.master is None:
            return 1 if self.slaves else 0
        return 2 if self.slaves else 3

    def couple(self, own: CoupledAxis, master: CoupledAxis, ratio: float) -> None:
        """Become a slave of `master`, from the present positions on."""
        self.leave(own)
        self.master = master
        master.coupling.slaves.append(own)
        self._outside = self._failed_cycles = 0
        self.ratio = ratio
        self._rebase(master)

    def set_ratio(self, ratio: float) -> None:
        """Change the ratio while coupled, from the present positions on."""
        self.ratio = ratio
        if self.master is not None:
            self._rebase(self.master)

    def _rebase(self, master: CoupledAxis) -> None:
        self._start = self._motion.s
        self._master_start = master.motion.s

    def shift(self, offset: float) -> None:
        """Follow the master at another distance, position unit: a superposed motion has ended."""
        self._start += offset

    def master_shifted(self, offset: float) -> None:
        """Take note that the coordinate system of the master moves; the slave does not."""
        self._master_start += offset

    def leave(self, own: CoupledAxis) -> None:
        """Be a slave no more."""
        if self.master is not None:
            self.master.coupling.slaves.remove(own)
            self.master = None
        self.delaying = False

    def step(self, velocity: float) -> int:
        """Form the setpoint from that of the master; returns an error code, 0 for none.

        Args:
            velocity: Actual velocity of the slave, position unit/s.

        """
        master = self.master
        if master is None:
            return NO_ERROR
        leading = master.motion
        if not master.closed:
            if not self._to_actual.value:
                self._motion.generator.set_state(self._motion.s, 0.0)
                self._rebase(master)
                return NO_ERROR
            deviation = master.encoder.velocity * self.ratio - velocity
            if abs(deviation) <= self._window.value:
                self._outside = 0
            else:
                self._outside += 1
                if self._outside * self._cycle_s > self._window_time.value * (1.0 + _SLACK):
                    return VELOCITY_LAG
        ratio = self.ratio
        self._motion.generator.set_state(
            self._start + ratio * (leading.s - self._master_start), ratio * leading.v, ratio * leading.a
        )
        return NO_ERROR

    def correction(self, following_error: float) -> float:
        """Return what reduces the difference of the following errors, position unit/s (NC-553)."""
        master = self.master
        if master is None:
            return 0.0
        return self._kcp.value * (following_error - self.ratio * master.following_error)

    def error_for_master(self, *, error: bool) -> bool:
        """Count a cycle with an error of the slave; returns whether it reaches the master now (NC-197,
        NC-198).
        """
        if not error or self.master is None:
            self._failed_cycles = 0
            self.delaying = False
            return False
        if int(self._mode.value) != _DELAYED:
            return True
        self.delaying = True
        reached = self._failed_cycles * self._cycle_s >= self._delay.value * (1.0 - _SLACK)
        self._failed_cycles += 1
        return reached
