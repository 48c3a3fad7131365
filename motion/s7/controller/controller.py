"""Operating states of the controller and the ways between them (MC-629 to MC-633, STP-506, VAR-229)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Final

from fieldbus.clock import MS, S
from fieldbus.errors import ConfigurationError, HilError
from motion.s7.controller.diagnosis import ControllerDiagnosis
from motion.s7.controller.diagnostics_buffer import DiagnosticsBuffer
from motion.s7.controller.levels import ExecutionLevels
from motion.s7.controller.states import OperatingState

if TYPE_CHECKING:
    from fieldbus.history import History
    from motion.kernel.task import Task
    from motion.s7.axis import ExternalEncoder, TechnologyAxis
    from motion.s7.axis.technology_object import TechnologyObject
    from motion.s7.cams import Cam
    from motion.s7.data_blocks import DataBlocks
    from motion.s7.measuring_input import MeasuringInput
    from motion.s7.program import Program

_SOURCE: Final = "controller"
_STARTUP_NS: Final = 100 * MS
"""How long the start-up program takes at least."""
_PERIPHERY_NS: Final = 5 * S
"""How long STARTUP waits for devices after power-on; the program then runs without those that are missing."""


class ControllerError(HilError):
    """The controller cannot do that in its present operating state."""


class Controller:
    """The CPU around a runtime: `bench.controller`.

    A controller is in RUN from the start of its runtime. `stop`, `run`, `power_off` and the others return at
    once; what takes time continues with the cycle: `bench.run_until(lambda: bench.controller.state is
    OperatingState.STOP, timeout=2.0)`.

    Args:
        task: Its cycle and technology objects.
        program: Its user program.
        levels: Its execution levels.
        data_blocks: Global data blocks of the user program; they lose their values with the supply and at a
            memory reset.
        history: Event log, or None.
        cams: Its cams.
        proxies: Its leading-axis proxies.
        measuring_inputs: Its measuring inputs.

    """

    def __init__(
        self,
        task: Task[TechnologyAxis, ExternalEncoder],
        program: Program,
        levels: ExecutionLevels,
        data_blocks: DataBlocks,
        history: History | None,
        *,
        cams: Sequence[Cam] = (),
        proxies: Sequence[TechnologyObject] = (),
        measuring_inputs: Sequence[MeasuringInput] = (),
    ) -> None:
        self._cams = cams
        self._proxies = proxies
        self._measuring_inputs = measuring_inputs
        self._task = task
        self._program = program
        self.data_blocks = data_blocks
        """Global data blocks of the user program; they lose their values with
        the supply and at a memory reset.
        """
        self._history = history
        levels.belong_to(self)
        self.levels = levels
        """Blocks of the user around `MC_Servo` and `MC_Interpolator`, and how long they take."""
        self.state = OperatingState.RUN
        """The present operating state."""
        self.diagnostics_buffer = DiagnosticsBuffer(task.scheduler)
        """What has happened to the controller and its technology objects."""
        if history is not None:
            self.diagnostics_buffer.follow(history)
        self.startup_program: list[Callable[[], object]] = []
        """Called once in STARTUP, in this order (OB 100)."""
        self.on_outputs: list[Callable[[bool], object]] = []
        """Called when the process outputs are switched on (True) or off (False),
        for what is no drive of an axis.
        """
        self.on_power: list[Callable[[bool], object]] = []
        """Called when the supply comes (True) or goes (False), for what the controller has on its buses."""
        self.on_warm_restart: Callable[[], object] = _always
        """Called when the instances of the program have started again."""
        self.periphery_ready: Callable[[], bool] = _always
        """Whether all devices answer; STARTUP after power-on waits for it."""
        self._has_run = True
        """Whether it has been in RUN since power-on: before that no inputs are
        read (CFG-290, CFG-291, CFG-295).
        """
        self._stopping: list[TechnologyObject | Cam | MeasuringInput] = []
        self._restarts: list[TechnologyObject | Cam | MeasuringInput] = []
        self._initialising: list[TechnologyObject | Cam | MeasuringInput] = []
        self._run_wanted = False
        self._startup_ends_ns = 0
        self._startup_limit_ns = 0

    @property
    def _objects(self) -> list[TechnologyObject | Cam | MeasuringInput]:
        return [
            *self._proxies,
            *self._task.encoders,
            *self._task.axes,
            *self._cams,
            *self._measuring_inputs,
        ]

    def diagnosis(self, newest: int = 20) -> ControllerDiagnosis:
        """Return what the controller says about itself now: `print(bench.controller.diagnosis().text())`.

        Args:
            newest: Entries of the diagnostics buffer that are wanted at most.

        """
        return ControllerDiagnosis(self.state.value, self.diagnostics_buffer.entries[-newest:])

    # -- commands
    # ---------------------------------------------------------------------------------------------

    def stop(self, reason: str = "by command") -> None:
        """Go to STOP; harmless in STOP.

        Every technology object is disabled with the effect of reaction 4: its jobs end with `CommandAborted`,
        and its drive stops as `Actor.RemoveEnableReaction` says. When it is off its process outputs are
        switched off; those of stations at once. An object whose start values have changed is restarted
        (MC-629, STP-506).

        Args:
            reason: For log and diagnostics buffer.

        """
        self._run_wanted = False
        if self.state in (OperatingState.RUN, OperatingState.STARTUP):
            self._soon(lambda: self._stop(reason, restart_all=False))

    def breakpoint(self) -> None:
        """Let the user program meet a breakpoint: `MC_Servo` overflows, STOP; every technology object is
        restarted (MC-633).
        """
        if self.state is not OperatingState.RUN:
            raise ControllerError(f"a breakpoint needs RUN, not {self.state.value}")
        self.diagnostics_buffer.append(_SOURCE, "overflow of MC_Servo: breakpoint reached (HOLD)")
        self._soon(lambda: self._stop("breakpoint", restart_all=True))

    def run(self) -> None:
        """Go to RUN by a warm restart, as soon as every technology object is at rest; harmless in RUN.

        On the way, in STARTUP, `startup_program` runs and motion jobs are rejected with 16#800D. All
        instances of instructions begin again: `Execute`, `Enable` and jog inputs FALSE, outputs and memory as
        at the beginning; other inputs stay. In RUN the technology objects are initialised one after the
        other, one per cycle (MC-631).

        Raises:
            ControllerError: There is no supply.

        """
        if self.state is OperatingState.POWER_OFF:
            raise ControllerError("RUN needs supply: power_on()")
        if self.state is OperatingState.STOP:
            self._run_wanted = True

    def power_off(self) -> None:
        """Cut the supply: the controller is gone from one instant to the next, and its buses fall silent."""
        if self.state is not OperatingState.POWER_OFF:
            self._soon(self._power_off)

    def _power_off(self) -> None:
        if self.state is OperatingState.POWER_OFF:
            return
        self._enter(OperatingState.POWER_OFF, "supply lost")
        self.diagnostics_buffer.lose_power()
        self._run_wanted = False
        self._has_run = False
        self._stopping, self._restarts, self._initialising = [], [], []
        self.data_blocks.clear()
        for one in self._objects:
            one.power_down()
            one.switch_outputs(False)
        for notify in self.on_power:
            notify(False)

    def power_on(self, *, run: bool = True) -> None:
        """Switch the supply on: all technology objects are initialised from load memory (MC-630).

        Args:
            run: Whether the controller continues to RUN by itself; otherwise it stays in STOP.

        """
        if self.state is not OperatingState.POWER_OFF:
            return
        self._enter(OperatingState.STOP, "supply on")
        for notify in self.on_outputs:
            notify(False)
        for notify in self.on_power:
            notify(True)
        self._startup_limit_ns = self._task.scheduler.now + _PERIPHERY_NS
        self._run_wanted = run

    def memory_reset(self) -> None:
        """Delete the work memory and initialise all technology objects from load memory; absolute encoders
        stay adjusted (HOM-184).

        Raises:
            ControllerError: The controller is not in STOP, or an axis is not at rest yet.

        """
        self._need_rest("memory reset")
        self._tell("memory reset")
        self.data_blocks.clear()
        for one in self._objects:
            one.power_down()

    def factory_reset(self) -> None:
        """Reset to factory settings and load the same project again: adjustments of absolute encoders are
        lost (HOM-187).

        Raises:
            ControllerError: As `memory_reset`.

        """
        self._need_rest("factory reset")
        self._tell("reset to factory settings")
        self.data_blocks.clear()
        for one in self._objects:
            one.forget_adjustment()
            one.forget_encoders()
            one.power_down()

    def download(self, name: str, values: Mapping[str, object] | None = None) -> None:
        """Load a technology object with changed start values, of any access class (VAR-014, CFG-127).

        Args:
            name: The technology object.
            values: Start values by their original path; the others stay. None: as it is.

        Raises:
            ConfigurationError: There is no such object or variable, a value is out of range, or values do
                not fit together; then nothing has changed.
            ControllerError: As `memory_reset`.

        """
        found = {one.name: one for one in self._objects}
        if name not in found:
            raise ConfigurationError("download", name, ", ".join(found) or "no technology objects")
        self._need_rest("download")
        found[name].download(values or {})
        self._tell(f"technology object {name} loaded")

    def load_project(self, *, upgraded: bool = False) -> None:
        """Load all technology objects again, as with a project of another name, or with an
        upgraded version of the same one.

        Another project knows nothing of the adjustment of an absolute encoder; an upgraded one keeps it
        (HOM-188, HOM-189).

        Args:
            upgraded: The project is the same one in a newer version.

        Raises:
            ControllerError: As `memory_reset`.

        """
        self._need_rest("download of a project")
        self._tell("upgraded project loaded" if upgraded else "another project loaded")
        self.data_blocks.clear()
        for one in self._objects:
            if upgraded:
                one.download({})
                continue
            one.forget_adjustment()
            one.forget_encoders()
            one.power_down()

    def _need_rest(self, what: str) -> None:
        if self.state is not OperatingState.STOP:
            raise ControllerError(f"a {what} needs STOP, not {self.state.value}")
        moving = [one.name for one in self._objects if not one.resting]
        if moving:
            raise ControllerError(f"a {what} needs technology objects at rest; not yet: {', '.join(moving)}")

    # -- ways
    # -------------------------------------------------------------------------------------------------

    def _enter(self, state: OperatingState, reason: str) -> None:
        old, self.state = self.state, state
        text = f"{old.value} -> {state.value}"
        self.diagnostics_buffer.append(_SOURCE, f"{text}: {reason}" if reason else text)
        history = self._history
        if history is not None:
            history.emit(
                _SOURCE, "controller.state", **{"from": old.value, "to": state.value, "reason": reason}
            )
        self.levels.reset()
        self.renew_cycle()

    def renew_cycle(self) -> None:
        """Let the runtime call what the present state and the settings of the levels want in every cycle."""
        entry: Callable[[], None] | None
        if self.state is OperatingState.POWER_OFF:
            entry = self._cycle_without_supply
        elif self.state is not OperatingState.RUN:
            entry = self._cycle_without_program
        elif self._initialising:
            entry = self._cycle_initialising
        else:
            entry = None if self.levels.plain else self.levels.cycle
        self._task.enter(entry)

    def _run_entry(self) -> Callable[[], None]:
        return self._task.cycle if self.levels.plain else self.levels.cycle

    def report(self, text: str) -> None:
        """Enter something about the controller itself into the diagnostics buffer."""
        self.diagnostics_buffer.append(_SOURCE, text)

    def overflow(self, what: str) -> None:
        """Go to STOP because a level has not ended in time (MC-636, MC-637)."""
        self.report(f"overflow: {what}")
        self._soon(lambda: self._stop(f"overflow: {what}", restart_all=False))
        self._task.end_cycle()

    def _tell(self, what: str) -> None:
        self.diagnostics_buffer.append(_SOURCE, what)
        if self._history is not None:
            self._history.emit(_SOURCE, "controller.initialised", what=what)

    def _soon(self, work: Callable[[], None]) -> None:
        """Do it now, or as soon as what runs in this instant has ended: nothing is
        stopped halfway through a cycle.
        """
        scheduler = self._task.scheduler
        if scheduler.running:
            scheduler.at(scheduler.now, work)
        else:
            work()

    def _stop(self, reason: str, *, restart_all: bool) -> None:
        if self.state not in (OperatingState.RUN, OperatingState.STARTUP):
            return
        self._enter(OperatingState.STOP, reason)
        everything = self._objects
        self._restarts = [
            one for one in everything if restart_all or one.variables.online_start_values_changed
        ]
        for one in self._initialising:
            one.release()
        self._initialising = []
        for one in everything:
            one.disable()
        self._stopping = list(everything)
        for notify in self.on_outputs:
            notify(False)

    def _advance_stop(self) -> None:
        """Switch off, and restart, what has come to rest; then begin STARTUP if that is wanted."""
        if self._stopping:
            for one in [one for one in self._stopping if one.resting]:
                self._stopping.remove(one)
                one.switch_outputs(False)
                if one in self._restarts:
                    self._restarts.remove(one)
                    one.make_reset(restart=True)
                    self._stopping.append(one)  # at rest again when that is done
            return
        if self._run_wanted and (
            self.periphery_ready() or self._task.scheduler.now >= self._startup_limit_ns
        ):
            self._begin_startup()

    def _begin_startup(self) -> None:
        task = self._task
        self._run_wanted = False
        self._enter(OperatingState.STARTUP, "warm restart")
        self._has_run = True
        self._initialising = self._objects
        for one in self._initialising:
            one.hold_back()
        self._program.restart()
        self.on_warm_restart()
        self._startup_ends_ns = task.scheduler.now + _STARTUP_NS
        for called in self.startup_program:
            called()

    def _begin_run(self) -> None:
        self._enter(OperatingState.RUN, "")
        for notify in self.on_outputs:
            notify(True)
        self.renew_cycle()

    # -- cycle
    # ------------------------------------------------------------------------------------------------

    def _cycle_without_program(self) -> None:
        """One application cycle in STOP and STARTUP: inputs and technology data continue (MC-632)."""
        task = self._task
        if self._has_run:
            self.levels.cycle_objects()
        if self.state is OperatingState.STOP:
            self._advance_stop()
        elif task.scheduler.now >= self._startup_ends_ns:
            self._begin_run()
        task.end_cycle()

    def _cycle_initialising(self) -> None:
        """One application cycle in RUN while technology objects are still being initialised."""
        one = self._initialising.pop(0)
        one.release()
        one.switch_outputs(True)
        if not self._initialising:
            self.renew_cycle()
        self._run_entry()()

    def _cycle_without_supply(self) -> None:
        self._task.end_cycle()


def _always() -> bool:
    return True
