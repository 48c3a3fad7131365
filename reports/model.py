"""The result model: what a run leaves behind. Written by the orchestrator, read by every report.

All times are seconds from the start of the case. Everything here is plain data: it serialises to JSON and
back (`reports.store`), with the columns of `Signal` in a compressed NumPy archive.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from reports.cams import CamDrawing
from reports.homing import HomingDrawing

Scalar = str | int | float | bool | None


class Verdict(StrEnum):
    """Outcome of a case or of a single check."""

    PASSED = "passed"
    FAILED = "failed"
    BLOCKED = "blocked"
    """The bench was not as the case needs it (a fault that this bench cannot inject, for example)."""
    ERROR = "error"
    """The harness itself failed."""


@dataclass
class Step:
    """One line of the story of a case."""

    time_s: float
    kind: str
    """`do` (an instruction was given), `inject`, `observe` (something happened), `expect` (a check was made).
    """
    text: str
    detail: dict[str, Scalar] = field(default_factory=dict)


@dataclass
class Check:
    """One expectation, evaluated on the recorded trace."""

    name: str
    verdict: Verdict
    expected: str
    observed: str
    time_s: float | None = None
    """Where to look in the trace."""
    value: float | None = None
    unit: str = ""
    low: float | None = None
    high: float | None = None
    requirements: list[str] = field(default_factory=list)
    signal: str = ""
    """Name of the signal that `value`, `low` and `high` are levels of; the plot draws the limits over it."""
    since_s: float | None = None
    """Start of the judged interval, for example the injection from which a reaction time counts."""
    sentence: str = ""
    """What came of it, in one sentence with the allowed value: `Alarm 421 came 4 ms after the fault (allowed:
    12 ms)`. Empty: the reports make one of `expected` and `observed` (`reports.text.check_sentence`).
    """
    rule: bool = False
    """It is a rule that holds in every run, not an expectation of this case."""


@dataclass(eq=False)
class Signal:
    """One recorded column. Equal to another when name, unit, texts and every
    sample (NaN included) are equal.
    """

    name: str
    """`component.signal`, for example `axis1.actual_position`."""
    unit: str
    time_s: NDArray[np.float64]
    values: NDArray[np.float64]
    enum: dict[int, str] = field(default_factory=dict)
    """Texts of the values of a state signal; empty for a quantity."""

    __hash__ = None  # type: ignore[assignment]  # mutable; `object` declares a method

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Signal):
            return NotImplemented
        return (
            (self.name, self.unit, self.enum) == (other.name, other.unit, other.enum)
            and np.array_equal(self.time_s, other.time_s)
            and np.array_equal(self.values, other.values, equal_nan=True)
        )


@dataclass(slots=True)
class Message:
    """One bus frame, decoded."""

    time_s: float
    bus: str
    identifier: int
    data: str
    """Payload as hexadecimal text, `R` followed by the length for a remote frame."""
    sender: str
    text: str
    """Meaning, for example `RPDO1 drive1: Controlword 000Fh, Target velocity 1 800 000`."""
    error: str = ""
    """Empty, or what went wrong with the frame (dropped by fault, CRC error, no acknowledge)."""
    protocol: str = "can"
    """`can`, `modbus_tcp` or `modbus_rtu`; over Modbus `identifier` is the unit."""


@dataclass
class AlarmRecord:
    """A technology alarm."""

    time_s: float
    axis: str
    number: int
    reaction: int
    text: str
    cleared_s: float | None = None
    gone_s: float | None = None
    """When its cause went; None where it lasted, or was an event."""


@dataclass
class FaultRecord:
    """A fault as it was injected."""

    kind: str
    target: str
    armed_s: float
    applied_s: float | None
    removed_s: float | None
    parameters: dict[str, Scalar] = field(default_factory=dict)
    trigger: str = ""
    axis_state: str = ""
    """State of the axis at application: for the coverage matrix."""


@dataclass
class Reaction:
    """What an axis made of the fault or stop of a case, measured on the trace: what two makes of controllers
    are compared by.
    """

    cause: str
    """Fault or stop, in words."""
    begin_s: float
    """When it came."""
    axis: str
    drive: str
    velocity: float
    """Velocity of the machine at that time, mm/s."""
    code: str = ""
    """Alarm or error code, with its text; empty: none came."""
    response: str = ""
    """What the controller did by itself: `reaction 4 (remove enable)`, `shut down`."""
    delay_s: float | None = None
    """From the cause to the alarm or error; None: there was none."""
    stop_s: float | None = None
    """From the cause until the machine stood; None: it moved on, or stood already."""
    distance: float | None = None
    """Way of the machine in that time, mm."""
    go_on: str = ""
    """What it took to move again; empty: it was not tried."""


@dataclass
class CaseResult:
    """Everything known of one executed case."""

    identifier: str
    """Stable name, unique in the run, for example `stop-modes/mc-power-0/constant`."""
    title: str
    verdict: Verdict
    message: str = ""
    """Why it failed, was blocked or broke; empty when passed."""
    group: str = ""
    tags: list[str] = field(default_factory=list)
    requirements: list[str] = field(default_factory=list)
    seed: int = 0
    token: str = ""
    """Text that `hil replay` takes to repeat this case."""
    simulated_s: float = 0.0
    wall_s: float = 0.0
    trace_digest: str = ""
    story: Sequence[Step] = field(default_factory=list)
    checks: list[Check] = field(default_factory=list)
    alarms: list[AlarmRecord] = field(default_factory=list)
    faults: list[FaultRecord] = field(default_factory=list)
    messages: Sequence[Message] = field(default_factory=list)
    signals: Sequence[Signal] = field(default_factory=list)
    homings: list[HomingDrawing] = field(default_factory=list)
    """Active and passive homings, each as a drawing."""
    cams: list[CamDrawing] = field(default_factory=list)
    """Cams that are interpolated at the end, each as a drawing."""
    files: dict[str, str] = field(default_factory=dict)
    """Evidence files: bus logs and the like; name to path relative to the report."""
    source: str = ""
    """Digest of the source of the case: one that was edited is neither fixed nor flaky; may be empty."""
    traceback: str = ""
    """Where in the code of the test it failed, as the test runner shows it; may be empty."""
    controller: str = ""
    """Make of the controller where the user asked for it: `s7` or `nc`; empty: that of the bench."""
    reaction: Reaction | None = None
    """What the axis made of the fault or stop, where the user asked for makes of controllers."""
    looked_at: list[str] = field(default_factory=list)
    """Signals, variables and bits of words that the case or a check has looked at, sorted."""
    not_looked_at: list[str] = field(default_factory=list)
    """Those that nobody has looked at, sorted."""
    configuration: dict[str, str] = field(default_factory=dict)
    """Values by name of the factor of the configuration that it ran on; empty: a bench of its own."""


class Earlier(NamedTuple):
    """An earlier run of a case, whose curves the page can lay under those of now."""

    label: str
    """What the page calls it."""
    curves: str
    """Packed by `reports.html.packing.packed`."""


@dataclass
class RequirementInfo:
    """An identifier of the specification."""

    identifier: str
    title: str
    section: str
    document: str
    own: bool = False
    """It comes from a catalogue of the user, and leads the report."""


PRODUCT_DIGEST: Final = "SHA-256 of the product"
"""Key of the environment of a run: over the files of the product that has run."""


@dataclass
class RunResult:
    """A whole run."""

    title: str
    seed: int
    bench_name: str
    bench_text: str
    """The bench file as used."""
    environment: dict[str, str]
    """Versions and machine facts."""
    started: str
    """Wall-clock start, ISO 8601."""
    cases: list[CaseResult] = field(default_factory=list)
    requirements: list[RequirementInfo] = field(default_factory=list)
    """Catalogue for the matrix; may be empty."""
    interrupted: bool = False
    fault_catalogue: list[str] = field(default_factory=list)
    """Fault kinds that the product knows, so that the coverage shows those never injected; may be empty."""
    planned: list[str] = field(default_factory=list)
    """Identifiers of all cases of the whole campaign, in order; of a shard also
    those of the others; may be empty.
    """
    shard: str = ""
    """`2/4`: this run is the second of four parts of the campaign; empty: it is all of it."""

    def count(self, verdict: Verdict) -> int:
        """Return the number of cases with `verdict`."""
        return sum(case.verdict is verdict for case in self.cases)
