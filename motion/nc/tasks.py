"""Tasks of the NC: SAF and PLC, the exchange between them, its watchdog (sections 4.1, 5, 24.1)."""

from __future__ import annotations

from copy import copy
from typing import TYPE_CHECKING

from motion.kernel.task import Task
from motion.nc.axis_ref import AxisRef

if TYPE_CHECKING:
    from collections.abc import Callable

    from fieldbus.clock import Scheduler
    from fieldbus.history import History
    from motion.nc.axis import NcAxis


class AxisLink:
    """Transfer of the cyclic interface of one axis, and its watchdog (NC-015 to NC-022).

    Args:
        axis: The axis, with the images on the side of the NC.
        ref: The instance of the PLC.
        watchdog: Cycles without fresh data after which a structure is cleared; 0 for never.

    """

    def __init__(self, axis: NcAxis, ref: AxisRef, watchdog: int) -> None:
        self.axis = axis
        self.ref = ref
        self.watchdog = watchdog
        self.to_plc_stalled = False
        """A fault: the transfer from the NC to the PLC does not run."""
        self._count = -1
        self._stale = 0
        self._stale_to_plc = 0

    def to_nc(self) -> None:
        """Take over what the PLC has written since the last cycle."""
        written = self.ref.PlcToNc
        if written.PlcCycleCount != self._count:
            self._count = written.PlcCycleCount
            self._stale = 0
            self.axis.plc_to_nc.take(written)
            return
        if self.watchdog and self._stale <= self.watchdog:
            self._stale += 1
            if self._stale > self.watchdog:
                self.axis.plc_to_nc.clear()

    def to_plc(self) -> None:
        """Bring the image of the NC to the PLC."""
        if not self.to_plc_stalled:
            self._stale_to_plc = 0
            self.ref.image = self.axis.nc_to_plc
            return
        if self._stale_to_plc == 0:
            self.ref.image = copy(self.axis.nc_to_plc)
        self._stale_to_plc += 1
        if self.watchdog and self._stale_to_plc > self.watchdog:
            self.ref.clear()


class NcRuntime:
    """An NC with its axes, and a PLC that calls blocks.

    Order within an instant: inputs, SAF, outputs, PLC (NC-753).

    Args:
        scheduler: Time.
        cycle_ns: Cycle of the SAF task, ns.
        phase_ns: Instant within the cycle, ns; default half a cycle, between two SYNC.
        plc_cycles: SAF cycles from one call of the PLC program to the next.
        history: Event log, or None.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        *,
        cycle_ns: int,
        phase_ns: int | None = None,
        plc_cycles: int = 1,
        history: History | None = None,
    ) -> None:
        self.scheduler = scheduler
        self.cycle_ns = cycle_ns
        self.history = history
        self.plc_cycles = plc_cycles
        self.axes: list[NcAxis] = []
        self.links: dict[str, AxisLink] = {}
        self.program: list[Callable[[], object]] = []
        """What the PLC calls in every cycle, in this order."""
        self.plc_running = True
        """False: the PLC is stopped, hangs or has been halted by an exception (NC-765)."""
        self.task: Task[_Saf, _NoEncoder] = Task(
            scheduler,
            cycle_ns=cycle_ns,
            phase_ns=cycle_ns // 2 if phase_ns is None else phase_ns,
            program=self._call_plc,
            program_cycles=plc_cycles,
        )
        self.task.axes.append(_Saf(self))
        self.after_cycle = self.task.after_cycle

    def add(self, axis: NcAxis) -> AxisRef:
        """Take an axis into the SAF task; returns its `AXIS_REF`."""
        ref = AxisRef(axis)
        self.axes.append(axis)
        watchdog = int(axis.parameters.cell("task.watchdog_cycles").value) * self.plc_cycles
        self.links[axis.name] = AxisLink(axis, ref, watchdog)
        return ref

    def call(self, instance: Callable[[], object]) -> None:
        """Call `instance` in every cycle of the PLC from the next one on."""
        self.program.append(instance)

    @property
    def cycles(self) -> int:
        """Cycles of the SAF task so far."""
        return self.task.cycles

    def start(self) -> None:
        """Begin to cycle."""
        self.task.start()

    def stop(self) -> None:
        """End the cycle."""
        self.task.stop()

    def _call_plc(self) -> None:
        if not self.plc_running:
            return
        for link in self.links.values():
            link.ref.PlcToNc.PlcCycleCount = (link.ref.PlcToNc.PlcCycleCount + 1) & 0xFF
        for instance in self.program:
            instance()


class _NoEncoder:
    """The NC has no encoders outside of its axes."""

    def cycle(self) -> None:
        """Do nothing."""

    def finish_cycle(self) -> None:
        """Do nothing."""


class _Saf:
    """The SAF task: every axis in its cycles (NC-046, NC-075, NC-076)."""

    def __init__(self, runtime: NcRuntime) -> None:
        self._runtime = runtime
        self._count = 0

    def cycle(self) -> None:
        """Run one cycle."""
        runtime = self._runtime
        links = runtime.links
        for axis in runtime.axes:
            axis.read_inputs()
        count = self._count
        self._count = count + 1
        for axis in runtime.axes:
            link = links[axis.name]
            link.to_nc()
            if count % axis.divider == axis.phase:
                axis.cycle()
            else:
                axis.repeat_outputs()
            link.to_plc()

    def servo_cycle(self) -> None:
        """Run one cycle: the NC has no other."""
        self.cycle()
