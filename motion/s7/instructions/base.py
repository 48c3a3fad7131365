"""Edge and level semantics that all `MC_` instructions share (sections 1.3 and 1.4 of
the instruction specification).

An instance is called once per application cycle, like in a controller program. Its inputs are attributes with
the names of the standard; a call may set them: `move(Execute=True, Position=100.0)`. Outputs are attributes
too and change only in a call (MC-075).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, ClassVar, Final

from typing_extensions import override

from fieldbus.errors import ConfigurationError, UnknownAttributeError, UnknownNameError
from motion.kernel.execute_input import ExecuteInput
from motion.s7.axis.jobs import ERROR_CONTROL_PANEL, ERROR_REFERENCE, NO_ERROR, Job, JobState
from motion.s7.compatibility import check_instruction, level_of
from motion.s7.instructions.texts import begun_text, ended_text, error_id_text, instance_text

if TYPE_CHECKING:
    from motion.s7.axis.axis import TechnologyAxis

_ACTIVE: Final = JobState.ACTIVE
_STARTERS: Final = frozenset(("Execute", "Enable", "JogForward", "JogBackward"))
_WITHOUT_MOTION: Final = ("ExternalEncoder", "Cam", "LeadingAxisProxy", "MeasuringInput")
DEFAULT = -1.0
"""Input value that selects the dynamic default of the technology object (MC-086 to MC-089)."""


class Instruction:
    """Base of all instances.

    Args:
        axis: Technology object at the input `Axis`.
        name: Instance name in the history; default the instruction's name and a number.
        **inputs: Start values of inputs.

    Raises:
        ConfigurationError: An input does not exist, or not on this controller; the controller does not
            have the instruction (CFG-062); or the object is an external encoder or a cam, which the
            instruction does not know (CFG-061).

    """

    instruction: ClassVar[str] = ""
    inputs: ClassVar[dict[str, float]] = {}
    """Names and defaults of the inputs."""
    object_types: ClassVar[tuple[str, ...]] = ("SpeedAxis", "PositioningAxis")
    Execute = ExecuteInput()
    """Edge input of those that have one."""
    execute_level: bool = False
    on_execute_fall: Callable[[], object] | None = None
    master: object | None = None
    """The control panel that the instance belongs to; None = to the user program."""

    def __init__(self, axis: TechnologyAxis, *, name: str | None = None, **inputs: float) -> None:
        if axis.object_type in _WITHOUT_MOTION and self._wrong_object(axis):
            raise ConfigurationError(
                f"{self.instruction}.Axis", axis.name, f"one of {', '.join(self.object_types)}"
            )
        self.axis = axis
        self.level = level_of(axis.cpu)
        check_instruction(self.level, self.instruction)
        self._absent = self.level.absent_inputs(self.instruction)
        self.name = name or axis.instance_name(self.instruction)
        self.Busy = False
        self.Error = False
        self.ErrorID = NO_ERROR
        for key, value in self.inputs.items():
            setattr(self, key, value)
        self.set(**inputs)

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> object:
            """Name outputs and inputs that are similar to one that the instruction does not have."""
            raise UnknownAttributeError(self, attribute=name, what=self.instruction)

    def set(self, **inputs: float) -> None:
        """Assign inputs; they act at the next call.

        Raises:
            ConfigurationError: The instruction does not have the input. What is no value for it is an error
                of the instruction, with its ErrorID, at the next call.

        """
        for key, value in inputs.items():
            if key not in self.inputs:
                raise UnknownNameError(self.instruction, key, "an input", self.inputs)
            if key in self._absent:
                self._refuse(key, value)
            setattr(self, key, value)

    def warm_restart(self) -> None:
        """Start again after a warm restart of the controller: nothing is started, outputs and
        memory are as at the beginning.

        The inputs that start something fall to FALSE; the others, which a
        program gives with every call, stay.
        """
        kept = {
            key: getattr(self, key) for key in self.inputs if key not in _STARTERS and key not in self._absent
        }
        type(self).__init__(self, self.axis, name=self.name, **kept)  # as a new one, in the same place

    def _refuse(self, key: str, value: object) -> None:
        own = self.level
        allowed = ", ".join(one for one in self.inputs if one not in self._absent)
        raise ConfigurationError(
            f"{self.instruction}.{key}",
            value,
            f"one of the inputs that technology version {own.version} of the {own.name} has: {allowed}",
        )

    @property
    def dormant(self) -> bool:
        """Whether calls change nothing until `Execute` falls, so that a
        runtime need not call the instance.
        """
        return False

    @property
    def entry(self) -> Callable[[], None]:
        """What a program calls: the same as the instance without inputs."""
        return self._call

    def __call__(self, **inputs: float) -> None:
        """Call the instance once."""
        if inputs:
            self.set(**inputs)
        self._call()

    def _call(self) -> None:
        raise NotImplementedError

    def _refused(self) -> int:
        """Return why the instance may not give jobs to its object: another type (16#8002), or a control panel
        has it (16#8012).
        """
        if self._wrong_object():
            return ERROR_REFERENCE
        return NO_ERROR if self.axis.master is self.master else ERROR_CONTROL_PANEL

    def _wrong_object(self, axis: TechnologyAxis | None = None) -> bool:
        return not any(kind in self.object_types for kind in (axis or self.axis).kinds)

    def _log_rejection(self, error_id: int) -> None:
        history = self.axis.history
        if history is not None:
            history.emit(
                self.axis.name, "job.error", job=self.name, instruction=self.instruction, error_id=error_id
            )

    def summary(self) -> str:
        """Return the instance, how it stands, and why: `MC_Home_1 of z ended with
        16#8001: alarm 521 at 0.378 s`.
        """
        return f"{instance_text(self.name, self.axis.name)} {self._standing()}"

    def __repr__(self) -> str:
        return f"<{self.summary()}>"

    def _standing(self) -> str:
        """Return how the instance stands, as the rest of a sentence about it."""
        if self.Error:
            alarms = [alarm.number for alarm in self.axis.engine.pending if alarm.reaction]
            return f"shows {error_id_text(self.ErrorID, alarms)}"
        return "is busy" if self.Busy else "is not busy"

    # -- outputs as predicates, for `run_until`
    # ---------------------------------------------------------------

    def busy(self) -> bool:
        """Return `Busy`."""
        return self.Busy

    def error(self) -> bool:
        """Return `Error`."""
        return self.Error


class ExecuteInstruction(Instruction):
    """Started by a rising edge of `Execute`; ends in exactly one of Done,
    CommandAborted, Error (MC-052 to MC-070).
    """

    follows_state: ClassVar[bool] = False
    """Its outputs depend on the state of the job alone."""

    def __init__(self, axis: TechnologyAxis, *, name: str | None = None, **inputs: float) -> None:
        self.Execute = False
        self.Done = False
        self.CommandAborted = False
        self._job: Job | None = None
        self._shown: JobState | None = None
        """State of the job that the outputs show."""
        self._last_execute = False
        self._terminal = False
        super().__init__(axis, name=name, **inputs)

    def _start(self) -> Job | int:
        """Return the accepted job, or the ErrorID of the rejection."""
        raise NotImplementedError

    def _call(self) -> None:
        execute = self.execute_level
        rising = execute and not self._last_execute
        falling = self._last_execute and not execute
        self._last_execute = execute
        if rising:
            self._begin()
            return
        if falling:
            self._released()
        if self._terminal:
            if not execute:
                self._clear()
        else:
            job = self._job
            if job is not None and not (self.follows_state and job.state is self._shown):
                self._shown = job.state
                self._show(job)

    def _begin(self) -> None:
        for key in self._absent:
            if getattr(self, key) != self.inputs[key]:
                self._refuse(key, getattr(self, key))
        self._clear()
        outcome = self._refused() or self._start()
        if isinstance(outcome, Job):
            self._job = outcome
            self._show(outcome)
            return
        self.Error = True
        self.ErrorID = outcome
        self._terminal = True
        self._log_rejection(outcome)

    def _clear(self) -> None:
        self.Busy = self.Done = self.CommandAborted = self.Error = False
        self.ErrorID = NO_ERROR
        self._terminal = False
        self._job = self._shown = None

    def _released(self) -> None:
        """Hook: falling edge of `Execute`; it never cancels a job (MC-064)."""

    def _show(self, job: Job) -> None:
        state = job.state
        if state <= _ACTIVE:
            self.Busy = True
            return
        self.Busy = False
        self._terminal = True
        if state is JobState.DONE:
            self.Done = True
        elif state is JobState.ABORTED:
            self.CommandAborted = True
        else:
            self.Error = True
            self.ErrorID = job.error_id

    @override
    def _standing(self) -> str:
        history, name = self.axis.history, self.name
        if self._terminal:
            return ended_text(history, name, self.axis.name, self.ErrorID)
        if self.Busy:
            return begun_text(history, name)
        return "has not been called yet" if self.Execute and not self._last_execute else "is not started"

    @property
    @override
    def dormant(self) -> bool:
        # The outputs of an ended job are held while Execute is TRUE.
        return self._terminal and bool(self.Execute) and self._last_execute

    def done(self) -> bool:
        """Return `Done`."""
        return self.Done

    def aborted(self) -> bool:
        """Return `CommandAborted`."""
        return self.CommandAborted

    def ended(self) -> bool:
        """Return whether the job has ended, one way or another."""
        return self._terminal
