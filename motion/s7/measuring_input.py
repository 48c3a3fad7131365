"""Measuring input technology object: positions of an axis or an external encoder at the edges of an input of
the device (OVR section 3.3, CFG-199, CFG-200).

The device latches the position by itself, so that neither the bus cycle nor the time of reading it out
matters.
"""

from __future__ import annotations

from itertools import count
from typing import TYPE_CHECKING, ClassVar, Final

from fieldbus.errors import ConfigurationError
from motion.s7.alarms import AlarmEngine
from motion.s7.axis.jobs import ERROR_ALARM, ERROR_STATE, NO_ERROR, Job, JobClass
from motion.s7.axis.state import AxisState
from motion.s7.axis.technology_object import Reset
from motion.s7.data._variables import UnknownVariableError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from fieldbus.history import History
    from motion.drives.mark import MarkSearch
    from motion.kernel.feedback import Feedback
    from motion.kernel.modulo import Modulo
    from motion.s7.axis import ExternalEncoder, TechnologyAxis

ERROR_HOMING: Final = 0x80A3
"""A homing job and a measuring job want the same encoder (MC-006, OVR-003)."""
ALARM_RANGE: Final = 752
ALARM_ONE_PER_ENCODER: Final = 753
ALARM_DEVICE: Final = 754
ALARM_ABORTED: Final = 755
_CYCLIC_NOT_POSSIBLE: Final = 2
"""Cause of alarm 755."""
CENTRAL: Final = 1
TELEGRAM: Final = 2
"""`Parameter.MeasuringInputType`: an input of the control unit, or of the axis by its telegram."""
INACTIVE, WAITING, OCCURRED, FAILED = range(4)
"""`Status`."""
RISING, FALLING, BOTH, RISING_FIRST, FALLING_FIRST = range(5)
"""`Mode` of `MC_MeasuringInput`; of `MC_MeasuringInputCyclic` the first three."""
_RISES, _FALLS = 0, 1
LATENCY_CYCLES: Final = 8
"""Cycles until an edge that a device has latched is known at the latest: by the handshake of the telegram.
So long an edge at the end of the range may be on its way when the axis has left it.
"""


class MeasuredObject:
    """What a measuring input needs of the axis or external encoder that it measures.

    Args:
        name: Its name.
        feedback: Returns the encoder in use.
        modulo: Returns the modulo range.
        homing: Returns whether active or passive homing runs.

    """

    def __init__(
        self,
        name: str,
        feedback: Callable[[], Feedback],
        modulo: Callable[[], Modulo],
        homing: Callable[[], bool],
    ) -> None:
        self.name = name
        self.feedback = feedback
        self.modulo = modulo
        self.homing = homing


def measured_object(owner: TechnologyAxis | ExternalEncoder) -> MeasuredObject:
    """Return what a measuring input needs of an axis or an external encoder."""
    return MeasuredObject(
        owner.name,
        lambda: owner.feedback,
        lambda: owner.modulo,
        lambda: any(one.busy for one in owner.homings),
    )


class Measurement:
    """What a measuring job is to find.

    Args:
        mode: `Mode` of its instruction.
        window: Start and end of the measuring range, position unit; None: everywhere.
        cyclic: It goes on until it is aborted.

    """

    def __init__(self, mode: int, window: tuple[float, float] | None, *, cyclic: bool) -> None:
        self.mode = mode
        self.window = window
        self.cyclic = cyclic
        self.values: list[float] = []
        """Measured positions of a measurement that ends, position unit."""
        self.last = [0.0, 0.0]
        """`MeasuredValue1` and `MeasuredValue2` so far."""
        self.counts = [0, 0]
        """How often they have been measured."""
        self.inside = False
        """The measured object has been within the range."""
        self.outside = 0
        """Cycles since it has left the range."""
        self.edge = _FALLS if mode in (FALLING, FALLING_FIRST) else _RISES
        """Edge that is waited for: 0 rising, 1 falling."""

    @property
    def complete(self) -> bool:
        """Whether everything has been found."""
        if self.cyclic:
            return False
        return len(self.values) == (1 if self.mode in (RISING, FALLING) else 2)

    def take(self, position: float) -> int:
        """Take a measured position over; returns in which place it stands, 0 or 1."""
        place = len(self.values)  # 0, while it is cyclic
        if self.cyclic and self.mode == BOTH:
            place = self.edge
        self.last[place] = position
        self.counts[place] += 1
        if not self.cyclic:
            self.values.append(position)
        return place

    def look_on(self) -> None:
        """Wait for the next edge: of two kinds they come in turn."""
        if self.mode not in (RISING, FALLING):
            self.edge = 1 - self.edge

    def permits(self, position: float, modulo: Modulo) -> bool:
        """Return whether a position lies in the measuring range.

        Without a modulo range the order of both ends does not matter; with one the range goes from the first
        to the second in positive direction.
        """
        if self.window is None:
            return True
        start, end = self.window
        if not modulo.enabled:
            return min(start, end) <= position <= max(start, end)
        place = modulo.wrap(position)
        start, end = modulo.wrap(start), modulo.wrap(end)
        return start <= place <= end if start <= end else place >= start or place <= end


class _NoStartValues:
    """What a measuring input has in load memory that a program could change."""

    online_start_values_changed = False


class MeasuringInput:
    """`TO_MeasuringInput` at a probe of the device that an axis or an external encoder reads.

    Args:
        name: Name in history and bench.
        measured: The object whose positions are measured.
        probe: Input of the device, 1 or 2 (`Parameter.PROFIdriveProbeNumber`).
        kind: `CENTRAL`, or `TELEGRAM`, which measures once only.
        correction_ms: `Parameter.CorrectionTime`: how much later than the edge the input sees it, ms.
        aborts_for_homing: Homing ends a job with `CommandAborted`, as in V7, not with 16#80A3.
        cpu: Controller that it belongs to.
        history: Event log, or None.

    Raises:
        ConfigurationError: There is no such input or kind.

    """

    object_type: ClassVar[str] = "MeasuringInput"
    kinds: ClassVar[tuple[str, ...]] = ("MeasuringInput",)
    master: object | None = None
    """No control panel can have a measuring input."""
    variables = _NoStartValues()
    """It has no start values that change at run time."""
    restart_refused = False
    """It can be restarted at any time."""

    def __init__(
        self,
        name: str,
        measured: MeasuredObject,
        *,
        probe: int = 1,
        kind: int = TELEGRAM,
        correction_ms: float = 0.0,
        aborts_for_homing: bool = False,
        cpu: str,
        history: History | None = None,
    ) -> None:
        if probe not in (1, 2):
            raise ConfigurationError(f"measuring input {name}: probe", probe, "1 or 2")
        if kind not in (CENTRAL, TELEGRAM):
            raise ConfigurationError(f"measuring input {name}: kind", kind, f"{CENTRAL} or {TELEGRAM}")
        self.name = name
        self.cpu = cpu
        self.history = history
        self.db_number = 0
        """Number of the data block; 0 before a runtime has it."""
        self.engine = AlarmEngine(name, object_type=self.object_type, history=history)
        """Pending alarms."""
        self._measured = measured
        self._probe = probe
        self._kind = kind
        self._correction_ms = correction_ms
        self._aborts_for_homing = aborts_for_homing
        self._job: Job | None = None
        self._measurement: Measurement | None = None
        self._search: MarkSearch | None = None
        self._status = INACTIVE
        self._values = [0.0, 0.0]
        self._counts = [0, 0]
        self._resets: list[Reset] = []
        self._restarting = False
        self._instances: dict[str, Iterator[int]] = {}

    def instance_name(self, instruction: str) -> str:
        """Return the name of one more instance of an instruction: `mark.MC_MeasuringInput_1`."""
        numbers = self._instances.setdefault(instruction, count(1))
        return f"{self.name}.{instruction}_{next(numbers)}"

    # -- jobs

    def refuses(self) -> int:
        """Return why it takes no job: being initialised, or an alarm; 0: it takes them."""
        if self._restarting:
            return ERROR_STATE
        return ERROR_ALARM if self.engine.reaction else NO_ERROR

    def start(self, instruction: str, name: str, measurement: Measurement) -> Job | int:
        """Start to measure; returns the job, or an ErrorID. A job that runs is aborted (OVR-043)."""
        refused = self.refuses()
        if refused:
            return refused
        if self._measured.homing():
            return ERROR_HOMING
        if measurement.cyclic and self._kind == TELEGRAM:
            self.engine.raise_alarm(ALARM_ABORTED, info=_CYCLIC_NOT_POSSIBLE)
            return ERROR_ALARM
        probes = self._measured.feedback().source.probes
        if len(probes) < self._probe:
            self.engine.raise_alarm(ALARM_DEVICE, text=f"{self._measured.name} has no input {self._probe}")
            return ERROR_ALARM
        if any(one.searching and one is not self._search for pair in probes for one in pair):
            self.engine.raise_alarm(ALARM_ONE_PER_ENCODER)
            return ERROR_ALARM
        self.abort()
        job = Job(JobClass.NONE, instruction=instruction, name=name)
        job.start(self.name, self.history)
        job.activate()
        self._job, self._measurement = job, measurement
        self._status = WAITING
        if measurement.mode == BOTH and self._measured.feedback().source.probe_level(self._probe):
            measurement.edge = _FALLS  # the next one, of an input that is active
        self._look_for(measurement.edge)
        return job

    def _begin_with_the_other(self, measurement: Measurement, search: MarkSearch) -> None:
        """Wait for the falling edge in place of the rising one if the device says, once it searches, that the
        input was active before: a telegram shows its level only from then on (PD-143).
        """
        if measurement.mode != BOTH or measurement.edge != _RISES or any(measurement.counts):
            return
        if search.confirmed and self._measured.feedback().source.probe_level(self._probe):
            search.cancel()
            measurement.edge = _FALLS
            self._look_for(measurement.edge)

    def _look_for(self, edge: int) -> None:
        search = self._measured.feedback().source.probes[self._probe - 1][edge]
        self._search = search
        search.start()

    def abort(self) -> None:
        """End the running job with `CommandAborted`; harmless without one."""
        job = self._end(INACTIVE)
        if job is not None:
            job.abort()

    def end_for_homing(self) -> None:
        """End the running job, because a homing job starts on the same encoder: with 16#80A3, in V7 with
        `CommandAborted` (OVR-041, SYN-284).
        """
        job = self._end(INACTIVE if self._aborts_for_homing else FAILED)
        if job is not None:
            if self._aborts_for_homing:
                job.abort()
            else:
                job.fail(ERROR_HOMING)

    @property
    def measurement(self) -> Measurement | None:
        """The running measurement; None without one."""
        return self._measurement

    def _end(self, status: int) -> Job | None:
        job, self._job = self._job, None
        if job is None:
            return None
        if self._search is not None:
            self._search.cancel()
            self._search = None
        self._measurement = None
        self._status = status
        return job

    def cycle(self) -> None:
        """Run one application cycle, after the axes."""
        if self._job is not None:
            self._step()
        if self._resets:
            for reset in self._resets:
                reset.step()
            self._resets = [reset for reset in self._resets if not reset.done]

    def _step(self) -> None:
        measurement, search = self._measurement, self._search
        assert measurement is not None and search is not None  # noqa: PT018 - every job has both
        feedback, modulo = self._measured.feedback(), self._measured.modulo()
        if search.failed:
            job = self._end(FAILED)
            self.engine.raise_alarm(ALARM_ABORTED, info=1)
            if job is not None:
                job.fail(ERROR_ALARM)
            return
        if search.found:
            position = feedback.position + feedback.ahead(search.value)
            position += feedback.velocity * -self._correction_ms * 1e-3
            self._take(measurement, position, modulo)
            return
        self._begin_with_the_other(measurement, search)
        if measurement.window is not None and not measurement.cyclic:
            if measurement.permits(feedback.position, modulo):
                measurement.inside = True
                measurement.outside = 0
            elif measurement.inside:
                measurement.outside += 1
                if measurement.outside <= LATENCY_CYCLES:
                    return
                job = self._end(FAILED)
                self.engine.raise_alarm(ALARM_RANGE)
                if job is not None:
                    job.fail(ERROR_ALARM)

    def _take(self, measurement: Measurement, position: float, modulo: Modulo) -> None:
        """Take an edge over; look for the next one, or end the job."""
        if measurement.permits(position, modulo):
            place = measurement.take(modulo.wrap(position))
            self._values[place] = measurement.last[place]
            self._counts[place] += 1
            self._status = OCCURRED
            if measurement.complete:
                job = self._end(OCCURRED)
                if job is not None:
                    job.finish()
                return
        measurement.look_on()
        self._look_for(measurement.edge)

    # -- variables under their original paths

    @property
    def status_word(self) -> int:
        """`StatusWord`."""
        word = 0 if self._restarting else 1
        if self.engine.error_word:
            word |= 1 << 1
        if self._restarting:
            word |= 1 << 2
        if self._measured.feedback().source.link_ok:
            word |= 1 << 5
        return word

    def var(self, path: str) -> float:
        """Return a variable of the technology data block by its original path; bits as `StatusWord.X5`.

        Raises:
            UnknownVariableError: There is no such variable.

        """
        word, _, bit = path.rpartition(".")
        if word in ("StatusWord", "ErrorWord", "WarningWord") and bit[:1] == "X" and bit[1:].isdigit():
            return bool(int(self.var(word)) >> int(bit[1:]) & 1)
        engine = self.engine
        found: Callable[[], float] | None = {
            "Status": lambda: self._status,
            "StatusWord": lambda: self.status_word,
            "ErrorWord": lambda: engine.error_word,
            "WarningWord": lambda: engine.warning_word,
            "ErrorDetail.Number": lambda: engine.number,
            "ErrorDetail.Reaction": lambda: engine.reaction,
            "InputState": lambda: bool(self._measured.feedback().source.probe_level(self._probe)),
            "Parameter.MeasuringInputType": lambda: self._kind,
            "Parameter.PROFIdriveProbeNumber": lambda: self._probe,
            "Parameter.CorrectionTime": lambda: self._correction_ms,
            "MeasuredValues.MeasuredValue1": lambda: self._values[0],
            "MeasuredValues.MeasuredValue2": lambda: self._values[1],
            "MeasuredValues.MeasuredValue1Counter": lambda: self._counts[0],
            "MeasuredValues.MeasuredValue2Counter": lambda: self._counts[1],
            "MeasuredValues.LostEdgeCounter1": lambda: 0,
            "MeasuredValues.LostEdgeCounter2": lambda: 0,
        }.get(path)
        if found is None:
            raise UnknownVariableError(f"{self.name}: a measuring input has no variable {path!r}")
        value: float = found()
        return value

    # -- acknowledging, restart, operating states of the controller

    @property
    def state(self) -> AxisState:
        """`RESTARTING` while it is being initialised, otherwise `DISABLED`: it is not enabled."""
        return AxisState.RESTARTING if self._restarting else AxisState.DISABLED

    def refuse_restart(self) -> None:
        """Do nothing: it never refuses one."""

    def make_reset(self, *, restart: bool) -> Reset:
        """Return an execution of `MC_Reset`; the cycle carries it out."""
        reset = Reset(self, restart=restart)
        self._resets.append(reset)
        return reset

    def begin_restart(self) -> None:
        """Begin to be initialised: jobs end with 16#800D (MC-638)."""
        self._fail_job()
        self._restarting = True

    def finish_restart(self) -> None:
        """Begin as at the start."""
        self.engine.restart()
        self._forget()
        self._restarting = False

    def acknowledge(self, age: int) -> bool:
        """Acknowledge the alarms, in the first cycle of the instruction."""
        del age
        self.engine.acknowledge()
        return True

    def _fail_job(self) -> None:
        job = self._end(INACTIVE)
        if job is not None:
            job.fail(ERROR_STATE)

    def _forget(self) -> None:
        self._values, self._counts = [0.0, 0.0], [0, 0]
        self._status = INACTIVE

    @property
    def resting(self) -> bool:
        """Whether nothing is under way that the controller has to wait for."""
        return not self._resets

    def disable(self) -> None:
        """End the job, since the controller goes to STOP."""
        self._fail_job()

    def hold_back(self) -> None:
        """Refuse jobs with 16#800D until `release`."""
        self._restarting = True

    def release(self) -> None:
        """End an initialisation: from now on it takes jobs."""
        self._restarting = False

    def power_down(self) -> None:
        """Lose everything."""
        self._fail_job()
        self._resets = []
        self._restarting = False
        self.engine.power_down()
        self._forget()

    def download(self, values: Mapping[str, object]) -> None:
        """Begin as at the start.

        Raises:
            ConfigurationError: There are values: all of them are those of the project.

        """
        if values:
            raise ConfigurationError(f"measuring input {self.name}", next(iter(values)), "no start values")
        self._fail_job()
        self.engine.restart()
        self._forget()

    def switch_outputs(self, on: bool) -> None:
        """Do nothing: it has no outputs."""

    def forget_adjustment(self, *, only_incremental: bool = False) -> None:
        """Do nothing: it has no encoders."""

    def forget_encoders(self) -> None:
        """Do nothing: it has no encoders."""
