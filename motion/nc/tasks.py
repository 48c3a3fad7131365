"""Tasks of the NC: SAF, SVB and PLC, the exchange between them, its watchdog (sections 4.1, 4.2, 5, 24.1)."""

from __future__ import annotations

from collections import deque
from copy import copy
from typing import TYPE_CHECKING, Final

from fieldbus.errors import ConfigurationError
from motion.kernel.execute_input import Dormant
from motion.nc.axis_ref import AxisRef
from motion.nc.blocks import Block, ExecuteBlock
from motion.nc.parameters import ParameterSet
from motion.nc.process_image import ProcessImage
from motion.nc.retain import (
    LOAD_STORE,
    NONE,
    STORE_ONLY,
    RetainDataError,
    RetainStore,
    StartAbortedError,
)
from motion.nc.tables import TableSpace

if TYPE_CHECKING:
    from collections.abc import Callable

    from fieldbus.clock import Scheduler, Timer
    from fieldbus.history import History
    from motion.kernel.cell import Cell
    from motion.nc.axis import NcAxis
    from motion.nc.encoder import Retained
    from motion.nc.interpolation import InterpolationGroup
    from motion.nc.project import Project

NAME: Final = "nc"
"""Name of the NC in the event log."""
_SVB_NS: Final = 10_000_000
"""Cycle of the SVB task, ns, unless it is given (NC-056)."""
_SECONDS: Final = 1e-9
_LOADS: Final = 1000


class AxisLink:
    """Transfer of the cyclic interface of one axis, and its watchdog (NC-015 to NC-022).

    Args:
        ref: The instance of the PLC, which knows its axis.
        watchdog: Cycles of the PLC without fresh data after which a structure is cleared; 0 for never.
        plc_cycles: SAF cycles in a cycle of the PLC.

    """

    def __init__(self, ref: AxisRef, watchdog: Cell[float], plc_cycles: int) -> None:
        self.ref = ref
        self._watchdog = watchdog
        self._plc_cycles = plc_cycles
        self.connected = True
        """The axis is linked to the PLC; False: nothing is transferred, and what is written to the axis stays
        (NC-013).
        """
        self.to_plc_stalled = False
        """A fault: the transfer from the NC to the PLC does not run."""
        self._count = -1
        self._stale = 0
        self._stale_to_plc = 0

    def to_nc(self) -> None:
        """Take over what the PLC has written since the last cycle."""
        if not self.connected:
            return
        written = self.ref.PlcToNc
        if written.PlcCycleCount != self._count:
            self._count = written.PlcCycleCount
            self._stale = 0
            self.ref.axis.plc_to_nc.take(written)
            return
        cycles = int(self._watchdog.value) * self._plc_cycles
        if cycles and self._stale <= cycles:
            self._stale += 1
            if self._stale > cycles:
                self.ref.axis.plc_to_nc.clear()

    def to_plc(self) -> None:
        """Bring the image of the NC to the PLC."""
        if not self.connected:
            return
        if not self.to_plc_stalled:
            self._stale_to_plc = 0
            self.ref.image = self.ref.axis.nc_to_plc
            return
        if self._stale_to_plc == 0:
            self.ref.image = copy(self.ref.axis.nc_to_plc)
        self._stale_to_plc += 1
        cycles = int(self._watchdog.value) * self._plc_cycles
        if cycles and self._stale_to_plc > cycles:
            self.ref.clear()


class TaskLoad:
    """How long the cycles of a task take, and what happens when one takes too long (NC-023 to NC-025).

    A cycle of virtual time takes no time by itself: `take` says how long the next one takes.

    Args:
        name: SAF or SVB.
        cycle_ns: Cycle of the task, ns.
        monitoring: Whether an overrun is reported.
        scheduler: Time.
        history: Event log, or None.

    """

    def __init__(
        self,
        name: str,
        cycle_ns: int,
        *,
        monitoring: Cell[float],
        scheduler: Scheduler,
        history: History | None,
    ) -> None:
        self.name = name
        self.cycle_ns = cycle_ns
        self._monitoring = monitoring
        self._scheduler = scheduler
        self._history = history
        self._next = 0
        self._busy = 0
        self.idle = True
        """The cycles take no time: there is nothing to look at."""
        self.exceeds = 0
        """Cycles that took longer than the cycle time, since the start or `reset`."""
        self.over_time: deque[tuple[int, float]] = deque(maxlen=_LOADS)
        """Time, ns, and load of the last cycles that took time; 1.0 is the whole cycle."""

    @property
    def load(self) -> float:
        """Load of the last cycle that took time; 0.0 when none did."""
        return self.over_time[-1][1] if self.over_time else 0.0

    def reset(self) -> None:
        """Count exceeded cycles from 0 again."""
        self.exceeds = 0

    def take(self, seconds: float) -> None:
        """Let the next cycle take a time, s.

        Raises:
            ConfigurationError: It is negative.

        """
        if not seconds >= 0.0:
            raise ConfigurationError(f"{self.name} task, time of a cycle", seconds, "0 s or more")
        self._next = round(seconds / _SECONDS)
        self.idle = False

    def begin(self) -> bool:
        """Return whether the task begins a cycle now; False: it is still busy with the one before."""
        if self._busy:
            self._busy -= 1
            self.idle = self._busy == 0 and self._next == 0
            return False
        taken, self._next = self._next, 0
        if taken:
            load = taken / self.cycle_ns
            self.over_time.append((self._scheduler.now, load))
            if taken > self.cycle_ns:
                self._busy = -(-taken // self.cycle_ns) - 1
                if self._monitoring.value:
                    self.exceeds += 1
                    self._report(load)
        self.idle = self._busy == 0
        return True

    def _report(self, load: float) -> None:
        if self._history is not None:
            self._history.emit(NAME, "nc.cycle_exceeded", task=self.name, load=load, exceeds=self.exceeds)
            self._history.emit(NAME, "nc.message", text=f"{self.name} task: cycle exceeded, load {load:.0%}")


class NcRuntime:
    """An NC with its axes, and a PLC that calls blocks.

    Order within an instant: inputs, ADS commands (high priority), SAF with outputs, ADS commands (low
    priority), SVB, PLC (NC-753).

    Args:
        scheduler: Time.
        cycle_ns: Cycle of the SAF task, ns.
        phase_ns: Instant within the cycle, ns; default half a cycle, between two SYNC.
        plc_cycles: SAF cycles from one call of the PLC program to the next.
        svb_ns: Cycle of the SVB task, ns, rounded up to whole SAF cycles; None: 10 ms.
        parameters: Parameters of the tasks; None: the defaults.
        retain: Where positions are kept over a restart; None: in memory.
        history: Event log, or None.

    Raises:
        ConfigurationError: The cycle of the SVB task is shorter than that of the SAF task, or `plc_cycles`
            is less than 1.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        *,
        cycle_ns: int,
        phase_ns: int | None = None,
        plc_cycles: int = 1,
        svb_ns: int | None = None,
        parameters: ParameterSet | None = None,
        retain: RetainStore | None = None,
        history: History | None = None,
    ) -> None:
        self.scheduler = scheduler
        self.cycle_ns = cycle_ns
        self.history = history
        self.plc_cycles = plc_cycles
        if svb_ns is not None and svb_ns < cycle_ns:
            raise ConfigurationError("SVB task, cycle", f"{svb_ns} ns", f"at least that of SAF, {cycle_ns}")
        if plc_cycles < 1:
            raise ConfigurationError("plc_cycles", plc_cycles, "1 or more")
        self.svb_cycles = -(-(svb_ns or max(_SVB_NS, cycle_ns)) // cycle_ns)
        """SAF cycles in a cycle of the SVB task."""
        self.parameters = parameters or ParameterSet()
        """Parameters of the tasks."""
        self.retain = retain or RetainStore()
        """Positions that are kept over a restart."""
        self.tables = TableSpace()
        """Cams and valve characteristics."""
        cell = self.parameters.cell
        self._watchdog = cell("task.watchdog_cycles")
        self._retain_mode = cell("task.retain_data")
        monitoring = cell("task.cycle_exceed_monitoring")
        self.saf = TaskLoad("SAF", cycle_ns, monitoring=monitoring, scheduler=scheduler, history=history)
        """Load and exceeded cycles of the SAF task."""
        self.svb = TaskLoad(
            "SVB",
            cycle_ns * self.svb_cycles,
            monitoring=monitoring,
            scheduler=scheduler,
            history=history,
        )
        """Load and exceeded cycles of the SVB task."""
        self.axes: list[NcAxis] = []
        """Axes that are executed, in the order in which they were added."""
        self._refs: list[AxisRef] = []
        self.links: dict[str, AxisLink] = {}
        """Transfers by name of the axis."""
        self.groups: list[InterpolationGroup] = []
        """Interpolation groups, which are executed in front of the axes."""
        self.program: list[Callable[[], object]] = []
        """What the PLC calls in every cycle, in this order."""
        self._entries: list[Callable[[], object]] = []
        """The same, as it is called."""
        self._functions = False
        """There are functions among them, which may look at a plant; blocks know axes only."""
        self._dormant: Dormant[ExecuteBlock] = Dormant()
        self.plc_running = True
        """False: the PLC is stopped, hangs or has been halted by an exception (NC-765)."""
        self._cyclic = _Saf(self, cell("task.ads_high_priority"))
        self._phase_ns = cycle_ns // 2 if phase_ns is None else phase_ns
        self._timer: Timer | None = None
        self.cycles = 0
        """Cycles of the SAF task so far."""
        self.after_cycle: list[Callable[[], object]] = []
        """Called at the end of every cycle."""
        self.running = False
        """Whether the tasks cycle."""
        self.project: Project | None = None
        """Its axes with their offline parameters; None: they were added one by one."""

    def add(self, axis: NcAxis) -> AxisRef:
        """Take an axis into the NC; returns its `AXIS_REF`."""
        ref = AxisRef(axis)
        self.connect(ref)
        return ref

    def connect(self, ref: AxisRef) -> None:
        """Take the axis of an `AXIS_REF` into the NC, after those that are there."""
        axis = ref.axis
        if not axis.disabled:
            self.axes.append(axis)
        ref.plc_cycle_s = self.cycle_ns * self.plc_cycles * _SECONDS
        self._refs.append(ref)
        link = self.links[axis.name] = AxisLink(ref, self._watchdog, self.plc_cycles)
        self._cyclic.take(axis, link)

    def clear(self) -> None:
        """Let go of all axes; the program stays."""
        self.axes.clear()
        self.links.clear()
        self._refs.clear()
        self._cyclic.clear()

    def call(self, instance: Callable[[], object]) -> None:
        """Call `instance` in every cycle of the PLC from the next one on.

        Blocks that have ended, and whose outputs are only held, are not called until their `Execute` falls.
        """
        active: list[Callable[[], object]] = []
        for one in self.program:
            if isinstance(one, ExecuteBlock) and one.dormant:
                self._dormant.add(one)
            else:
                active.append(one)
        self._schedule([*active, instance])

    def _schedule(self, program: list[Callable[[], object]]) -> None:
        """Call these from the next cycle of the PLC on."""
        self.program = program
        self._entries = [one.entry if isinstance(one, Block) else one for one in program]
        self._functions = not all(isinstance(one, Block) for one in program)

    def image(self) -> dict[str, bytes]:
        """Return the process image of the SAF task: inputs and outputs of encoder and drive of every axis
        (NC-042).
        """
        found: dict[str, bytes] = {}
        for axis in self.axes:
            image = ProcessImage(axis)
            found[f"{axis.name}.encoder.inputs"] = image.pack_encoder_inputs()
            found[f"{axis.name}.encoder.outputs"] = image.pack_encoder_outputs()
            if not axis.encoder_only:
                found[f"{axis.name}.drive.inputs"] = image.pack_drive_inputs()
                found[f"{axis.name}.drive.outputs"] = image.pack_drive_outputs()
        return found

    def post(self, command: Callable[[], object]) -> None:
        """Execute a command of an ADS device once: at the start of the next SAF cycle with high priority, at
        its end without, so that it acts a cycle later (NC-047).
        """
        self._cyclic.posted.append(command)

    # -- start and stop

    def start(self) -> None:
        """Load retain data as their mode says, and begin to cycle (NC-049 to NC-053).

        Raises:
            StartAbortedError: Mode Load/Store, and there are none that can be used.

        """
        if self.running:
            return
        retained = self._load()
        for axis in self.axes:
            axis.retained = retained.get(axis.name) if axis.persistent else None
        self.running = True
        self._timer = timer = self.scheduler.every(self.cycle_ns, self._cycle, phase_ns=self._phase_ns)
        timer.apart = True  # as the task of another controller: axes have their devices on a bus

    def stop(self) -> None:
        """End the cycle, and store retain data as their mode says."""
        if not self.running:
            return
        self.lose_power()
        if int(self._retain_mode.value) != NONE:
            self.retain.write(
                {axis.name: axis.encoder.retain() for axis in self.axes if axis.persistent and axis.located}
            )

    def lose_power(self) -> None:
        """End the cycle without a word: nothing is stored (NC-054)."""
        self.running = False
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _cycle(self) -> None:
        """Run one cycle: the tasks of the NC, the PLC where it is due, what looks on."""
        self.cycles = cycles = self.cycles + 1
        self._cyclic.cycle()
        if cycles % self.plc_cycles == 0:
            self._call_plc()
        if self.after_cycle:
            self.scheduler.catch_up()
            for callback in tuple(self.after_cycle):
                callback()

    def _load(self) -> dict[str, Retained]:
        mode = int(self._retain_mode.value)
        if mode in {NONE, STORE_ONLY}:
            return {}
        try:
            return self.retain.read()
        except RetainDataError as error:
            if mode == LOAD_STORE:
                self._emit("nc.start_aborted", reason=str(error))
                raise StartAbortedError(
                    f"{error}; a first start needs task.retain_data = 'Load (if available)/Store'"
                ) from None
            self._emit("nc.retain_data", reason=str(error))
            return {}

    def _emit(self, kind: str, **data: str | float | bool) -> None:
        if self.history is not None:
            self.history.emit(NAME, kind, **data)

    # -- the PLC

    def _call_plc(self) -> None:
        if not self.plc_running:
            return
        for ref in self._refs:
            written = ref.PlcToNc
            written.PlcCycleCount = (written.PlcCycleCount + 1) & 0xFF
        if self._dormant.fallen:
            self._wake()
        if self._functions:
            self.scheduler.catch_up()
        try:
            for entry in self._entries:
                entry()
        except ArithmeticError as error:
            # As on the machine: an exception of the arithmetic halts the PLC, the NC goes on (NC-019).
            self.plc_running = False
            self._emit("plc.halted", reason=f"{type(error).__name__}: {error}")

    def _wake(self) -> None:
        """Call those again that were not called and whose `Execute` has fallen, in front of the others."""
        self._schedule([*self._dormant.take_fallen(), *self.program])


class _Saf:
    """The SAF task with every axis in its cycles (NC-046, NC-075, NC-076), and the SVB task behind it."""

    def __init__(self, runtime: NcRuntime, high_priority: Cell[float]) -> None:
        self._runtime = runtime
        self._high_priority = high_priority
        self._pairs: list[tuple[NcAxis, AxisLink]] = []
        self._count = 0
        self.posted: list[Callable[[], object]] = []

    def take(self, axis: NcAxis, link: AxisLink) -> None:
        """Execute an axis in every cycle that is its own."""
        if not axis.disabled:
            self._pairs.append((axis, link))

    def clear(self) -> None:
        """Forget all axes."""
        self._pairs.clear()

    def cycle(self) -> None:
        """Run one cycle."""
        runtime = self._runtime
        count = self._count
        self._count = count + 1
        if runtime.saf.idle or runtime.saf.begin():
            self._saf(count)
        if count % runtime.svb_cycles == 0 and (runtime.svb.idle or runtime.svb.begin()):
            for axis, _ in self._pairs:
                if axis.prepared:
                    axis.prepare()

    def _saf(self, count: int) -> None:
        pairs = self._pairs
        for axis, _ in pairs:
            axis.device.read()
        high = self.posted and self._high_priority.value
        if high:
            self._execute()
        for group in self._runtime.groups:
            group.step()
        for axis, link in pairs:
            link.to_nc()
            if count % axis.divider == axis.phase:
                axis.cycle()
            else:
                axis.repeat_outputs()
            if link.to_plc_stalled or link.ref.image is not axis.nc_to_plc:
                link.to_plc()
        if self.posted and not high:
            self._execute()

    def _execute(self) -> None:
        posted, self.posted = self.posted, []
        self._runtime.scheduler.catch_up()  # they come from anywhere
        for command in posted:
            command()
