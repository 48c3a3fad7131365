"""What a run has covered: faults against reactions, faults against axis states, requirements against cases.

An empty cell is a finding too: a combination that nobody has tried. Rows and columns therefore hold
everything that is known (the fault catalogue, every state of a state signal), not only what happened.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import Final

from reports.model import CaseResult, FaultRecord, RunResult, Verdict
from reports.store import StoredSignals
from reports.text import reaction_name

NO_ALARM: Final = "no alarm"
NOT_INJECTED: Final = "not injected"
UNKNOWN_STATE: Final = "unknown"
NO_FAULT: Final = "no fault"
NO_STOP: Final = "no stop command"
_STOPPED: Final = re.compile(
    r"MC_Power Enable = FALSE(, StopMode (?P<power>\d+))?|MC_Stop( Mode (?P<stop>\d+))?\b|MC_Halt\b"
)
"""The instructions that end a motion, as stories tell them."""

_AXIS_STATE: Final = re.compile(r"(?P<axis>\S+): [A-Z_]+ -> (?P<state>[A-Z_]+)")
"""A change of state of an axis, as stories tell it; drives write their states in lower case."""

_GRAVITY: Final = (Verdict.FAILED, Verdict.ERROR, Verdict.BLOCKED, Verdict.PASSED)


def worst(verdicts: list[Verdict]) -> Verdict | None:
    """Return the worst verdict (failed, error, blocked, passed); None for an empty list."""
    return next((verdict for verdict in _GRAVITY if verdict in verdicts), None)


@dataclass
class Cell:
    """One combination of a coverage matrix."""

    verdicts: list[Verdict] = field(default_factory=list)
    cases: list[str] = field(default_factory=list)
    """Identifiers, in case order, each once."""
    notes: list[str] = field(default_factory=list)
    """Alarm numbers seen, each once, ascending."""

    def add(self, case: CaseResult, notes: list[str]) -> None:
        """Count a case once, with its verdict; a case is added before the next one begins."""
        if self.cases[-1:] != [case.identifier]:
            self.cases.append(case.identifier)
            self.verdicts.append(case.verdict)
        self.notes = sorted({*self.notes, *notes}, key=lambda note: (len(note), note))

    def count(self, verdict: Verdict) -> int:
        """Return the number of cases with `verdict`."""
        return self.verdicts.count(verdict)

    @property
    def verdict(self) -> Verdict | None:
        """The worst verdict of the cell; None when empty."""
        return worst(self.verdicts)


@dataclass
class Matrix:
    """A coverage matrix; a missing cell was never tried."""

    rows: list[str]
    columns: list[str]
    cells: dict[tuple[str, str], Cell]

    def cell(self, row: str, column: str) -> Cell:
        """Return a cell, an empty one where nothing was tried."""
        return self.cells.get((row, column)) or Cell()

    @property
    def tried(self) -> int:
        """Number of combinations with at least one case, without the faults that could not be injected."""
        return sum(column != NOT_INJECTED for _row, column in self.cells)

    @property
    def possible(self) -> int:
        """Number of combinations that could have been tried."""
        return len(self.rows) * sum(column != NOT_INJECTED for column in self.columns)


def reactions_to(case: CaseResult, fault: FaultRecord) -> dict[str, list[str]]:
    """Return the reactions of the axes from the application of a fault until the next one of the same case.

    Returns:
        Name of the reaction (`NO_ALARM`, `NOT_INJECTED`) to the alarm numbers that had it.

    """
    applied = fault.applied_s
    if applied is None:
        return {NOT_INJECTED: []}
    later = [
        other.applied_s for other in case.faults if other.applied_s is not None and other.applied_s > applied
    ]
    end = min(later, default=float("inf"))
    found: dict[str, list[str]] = {}
    for alarm in case.alarms:
        if applied <= alarm.time_s < end:
            found.setdefault(reaction_name(alarm.reaction), []).append(str(alarm.number))
    return found or {NO_ALARM: []}


def state_of(fault: FaultRecord) -> str:
    """Return the axis state in which a fault was applied; `NOT_INJECTED` when it was not."""
    if fault.applied_s is None:
        return NOT_INJECTED
    return fault.axis_state or UNKNOWN_STATE


def stop_modes(case: CaseResult) -> list[str]:
    """Return how the axes were stopped, from the instructions in the story of a case, each once.

    Returns:
        `MC_Power StopMode 2`, `MC_Stop Mode 3`, `MC_Halt` and the like; `NO_STOP` alone where nobody stopped
        them.

    """
    found: dict[str, None] = {}
    for step in case.story:
        if step.kind != "do":
            continue
        if match := _STOPPED.search(step.text):
            power, stop = match["power"], match["stop"]
            found.setdefault(
                f"MC_Power StopMode {power}"
                if power
                else f"MC_Stop Mode {stop}"
                if stop
                else match[0].split()[0]
            )
    return list(found) or [NO_STOP]


def stop_reactions(case: CaseResult) -> list[str]:
    """Return what the axes did when they were commanded to stop: the states that they went through until the
    next instruction, `disabling ramp, disabled`, each chain once.
    """
    stops: list[dict[str, list[str]]] = []
    watched = False
    for step in case.story:
        if step.kind == "do":
            watched = bool(_STOPPED.search(step.text))
            if watched:
                stops.append({})
        elif watched and (match := _AXIS_STATE.fullmatch(step.text)):
            stops[-1].setdefault(match["axis"], []).append(match["state"].lower().replace("_", " "))
    return list(dict.fromkeys(", ".join(states) for stop in stops for states in stop.values()))


def fault_kinds(run: RunResult) -> list[str]:
    """Return all fault kinds of the catalogue and of the run, sorted."""
    return sorted({*run.fault_catalogue, *(fault.kind for case in run.cases for fault in case.faults)})


def fault_reaction_matrix(run: RunResult) -> Matrix:
    """Return fault kind against the reaction that followed."""
    cells: dict[tuple[str, str], Cell] = {}
    columns: set[str] = set()
    for case in run.cases:
        for fault in case.faults:
            for reaction, numbers in reactions_to(case, fault).items():
                columns.add(reaction)
                cells.setdefault((fault.kind, reaction), Cell()).add(case, numbers)
    known = [
        NO_ALARM,
        *(reaction_name(code) for code in range(6)),
        *(reaction_name(code) for code in range(6, 16)),
    ]
    always = {NO_ALARM, *(reaction_name(code) for code in range(1, 6))}
    ordered = [name for name in known if name in columns or name in always]
    ordered += sorted(columns - {*known, NOT_INJECTED})
    ordered += [NOT_INJECTED] if NOT_INJECTED in columns else []
    return Matrix(fault_kinds(run), ordered, cells)


def fault_state_matrix(run: RunResult) -> Matrix:
    """Return fault kind against the axis state at its application."""
    cells: dict[tuple[str, str], Cell] = {}
    seen: dict[str, None] = {}
    for case in run.cases:
        for fault in case.faults:
            state = state_of(fault)
            seen.setdefault(state)
            cells.setdefault((fault.kind, state), Cell()).add(case, [])
    special = {UNKNOWN_STATE, NOT_INJECTED}
    named = set(seen) - special
    ordered: dict[str, None] = {}
    for case in run.cases:
        for texts in _texts(case) if named else []:
            if named.intersection(texts.values()):
                ordered.update(dict.fromkeys(text for _value, text in sorted(texts.items())))
    ordered.update(dict.fromkeys(sorted(named - set(ordered))))
    columns = [*ordered, *(name for name in (UNKNOWN_STATE, NOT_INJECTED) if name in seen)]
    return Matrix(fault_kinds(run), columns, cells)


def _texts(case: CaseResult) -> list[dict[int, str]]:
    """Return the texts of the states of a case without reading samples from the disk."""
    signals = case.signals
    return signals.texts if isinstance(signals, StoredSignals) else [signal.enum for signal in signals]


def fault_stop_matrix(run: RunResult) -> Matrix:
    """Return fault kind (`NO_FAULT` for cases without one) against the way in which the axes were
    commanded to stop.
    """
    cells: dict[tuple[str, str], Cell] = {}
    columns: set[str] = set()
    for case in run.cases:
        for mode in stop_modes(case):
            columns.add(mode)
            for kind in dict.fromkeys(fault.kind for fault in case.faults) or [NO_FAULT]:
                notes = [str(alarm.number) for alarm in case.alarms]
                cells.setdefault((kind, mode), Cell()).add(case, notes)
    always = [
        *(f"MC_Power StopMode {mode}" for mode in range(4)),
        *(f"MC_Stop Mode {mode}" for mode in (0, 2, 3)),
    ]
    ordered = sorted({*always, "MC_Halt", *(columns - {NO_STOP})}) + [NO_STOP] * (NO_STOP in columns)
    return Matrix([NO_FAULT, *fault_kinds(run)], ordered, cells)


def not_looked_at(run: RunResult) -> list[str]:
    """Return the recorded signals that no case and no check of a run has looked at, sorted: the run does not
    notice what goes wrong in them.
    """
    seen = {name for case in run.cases for name in case.looked_at}
    return sorted({name for case in run.cases for name in case.not_looked_at} - seen)


def value_pairs(run: RunResult) -> tuple[int, int]:
    """Return how many pairs of values of two factors the configurations of the judged cases have, and how
    many more only cases have that were blocked or broke.
    """
    judged: set[tuple[tuple[str, str], tuple[str, str]]] = set()
    every: set[tuple[tuple[str, str], tuple[str, str]]] = set()
    for case in run.cases:
        pairs = set(combinations(sorted(case.configuration.items()), 2))
        every |= pairs
        if case.verdict in (Verdict.PASSED, Verdict.FAILED):
            judged |= pairs
    return len(judged), len(every - judged)


def with_stop(run: RunResult, mode: str) -> RunResult:
    """Return a run with just those cases in which the axes were commanded to stop in this way."""
    return replace(run, cases=[case for case in run.cases if mode in stop_modes(case)])


@dataclass
class RequirementRow:
    """A requirement and what the run says about it."""

    identifier: str
    title: str
    section: str
    document: str
    known: bool
    """False for an identifier that a case names but the catalogue does not hold."""
    cases: list[tuple[str, Verdict]]
    """Case and its verdict for this requirement, in case order."""
    own: bool = False
    """It comes from a catalogue of the user."""

    @property
    def verdict(self) -> Verdict | None:
        """The worst verdict; None when no case has the requirement."""
        return worst([verdict for _case, verdict in self.cases])


@dataclass
class PrefixTotal:
    """Totals of the requirements of one family, for example `STP`."""

    prefix: str
    known: int = 0
    passed: int = 0
    failed: int = 0
    """Failed or error."""
    blocked: int = 0
    untested: int = 0
    orphaned: int = 0
    """Named by a case, not in the catalogue; counted under its verdict as well."""
    own: bool = False
    """The family comes from a catalogue of the user."""

    @property
    def touched(self) -> bool:
        """Whether a case names one of them, or the user does."""
        return self.own or bool(self.passed or self.failed or self.blocked)


def family_of(identifier: str) -> str:
    """Return the family of an identifier: what stands before its number, `STP` of `STP-303`, `R` of `R12`."""
    return identifier.rpartition("-")[0] or identifier.rstrip("0123456789").rstrip("._ ") or identifier


def requirement_matrix(run: RunResult) -> list[RequirementRow]:
    """Return every requirement of the catalogue and of the cases.

    A check that names a requirement covers it; a case covers those that it names and none of its
    checks does. The order is that of the catalogue, then unknown identifiers sorted.
    """
    found: dict[str, list[tuple[str, Verdict]]] = {}
    for case in run.cases:
        by_check: dict[str, list[Verdict]] = {}
        for check in case.checks:
            for identifier in check.requirements:
                by_check.setdefault(identifier, []).append(check.verdict)
        for identifier in dict.fromkeys([*case.requirements, *by_check]):
            verdict = worst(by_check.get(identifier, [])) or case.verdict
            found.setdefault(identifier, []).append((case.identifier, verdict))
    rows = [
        RequirementRow(
            info.identifier,
            info.title,
            info.section,
            info.document,
            True,
            found.pop(info.identifier, []),
            info.own,
        )
        for info in {info.identifier: info for info in run.requirements}.values()
    ]
    rows += [RequirementRow(identifier, "", "", "", False, found[identifier]) for identifier in sorted(found)]
    return rows


def prefix_totals(rows: list[RequirementRow]) -> list[PrefixTotal]:
    """Return totals per family, sorted by their names; those of the user first."""
    totals: dict[tuple[bool, str], PrefixTotal] = {}
    for row in rows:
        prefix = family_of(row.identifier)
        total = totals.setdefault((row.own, prefix), PrefixTotal(prefix, own=row.own))
        total.known += row.known
        total.orphaned += not row.known
        match row.verdict:
            case None:
                total.untested += 1
            case Verdict.PASSED:
                total.passed += 1
            case Verdict.BLOCKED:
                total.blocked += 1
            case Verdict.FAILED | Verdict.ERROR:
                total.failed += 1
    return sorted(totals.values(), key=lambda total: (not total.own, total.prefix))
