"""Jobs that shift the leading or the following value of a synchronous job: `MC_Phasing...`, `MC_Offset...`
(sections 7.4 and 7.5 of the specification of synchronous operation).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from motion.s7.axis.jobs import ERROR_LEADING_REVERSED, NO_ERROR, JobState

if TYPE_CHECKING:
    from fieldbus.history import History
    from motion.kernel.synchronous import Shift, Shifting
    from motion.s7.axis.jobs import Job

PHASING: Final = "MC_Phasing"
"""How the names of instructions begin that shift the leading value; the others shift the following value."""


class ShiftJobs:
    """The job that shifts a value of the synchronous job in control; one at a time (SYN-186).

    Args:
        name: Name of the axis.
        history: Event log, or None.

    """

    def __init__(self, name: str, history: History | None) -> None:
        self._name = name
        self._history = history
        self.job: Job | None = None
        """The job that shifts, or waits for its leading value; None without one."""
        self._shift: Shift | None = None

    @property
    def phases(self) -> bool:
        """Whether the job is one of the leading value."""
        return self.job is not None and self.job.instruction.startswith(PHASING)

    @property
    def waits(self) -> bool:
        """Whether the job waits for the start position or direction of the leading value."""
        return self.job is not None and self.job.state is JobState.WAITING

    def submit(self, job: Job, shift: Shift, motion: Shifting | None) -> None:
        """Let `job` move `shift`; None: it is there already. A job that runs is aborted."""
        self.end()
        job.start(self._name, self._history)
        if motion is None:
            job.activate()
            job.finish()
            return
        self.job, self._shift = job, shift
        shift.motion = motion
        if motion.begun:
            job.activate()

    def cancel(self, job: Job, *, phasing: bool) -> None:
        """Abort what waits, not what shifts already; `job` is done with it (SYN-425, SYN-432)."""
        job.start(self._name, self._history)
        job.activate()
        if self.waits and self.phases is phasing:
            self.end()
        job.finish()

    def end(self, error_id: int = NO_ERROR) -> None:
        """End the job that runs, with CommandAborted or an error; the shift stays where it is."""
        job, shift = self.job, self._shift
        self.job = self._shift = None
        if shift is not None:
            shift.end()
        if job is None:
            return
        if error_id:
            job.fail(error_id)
        else:
            job.abort()

    def step(self) -> None:
        """Take over what has become of the shift in this cycle."""
        job, shift = self.job, self._shift
        if job is None or shift is None or shift.motion is None:
            return
        motion = shift.motion
        if motion.begun and job.state is JobState.WAITING:
            job.activate()
        if motion.done:
            self.job = self._shift = None
            shift.end()
            job.finish()
        elif motion.reversed:
            self.end(ERROR_LEADING_REVERSED)
