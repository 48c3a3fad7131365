"""Results of earlier runs in a small database (SQLite), and nothing else of them: verdicts, times, a few
numbers a case.

The file is made when the first run is recorded. Several processes may record at the same time; one waits for
the other.
"""

from __future__ import annotations

import hashlib
import json
import sqlite3
from collections.abc import Iterable
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

from reports.errors import ReportError
from reports.measures import Measure, measures
from reports.model import RunResult, Verdict
from reports.summary import run_digest
from reports.text import headline, run_state

HISTORY_FILE: Final = "history.sqlite"
"""Name of the history in a report folder."""
_FORMAT: Final = 2
_APPLICATION: Final = 0x48494C31
WAIT_S: Final = 30.0
"""How long to wait for another process that holds the file, s."""
_SCHEMA: Final = """
CREATE TABLE run (
  number INTEGER PRIMARY KEY AUTOINCREMENT, started TEXT NOT NULL, title TEXT NOT NULL, seed TEXT NOT NULL,
  bench TEXT NOT NULL, bench_digest TEXT NOT NULL, version TEXT NOT NULL, state TEXT NOT NULL, interrupted INTEGER NOT NULL,
  passed INTEGER NOT NULL, failed INTEGER NOT NULL, blocked INTEGER NOT NULL, errors INTEGER NOT NULL,
  simulated_s REAL NOT NULL, wall_s REAL NOT NULL, trace_digest TEXT NOT NULL, environment TEXT NOT NULL);
CREATE TABLE name (number INTEGER PRIMARY KEY, text TEXT NOT NULL UNIQUE);
CREATE TABLE result (
  run INTEGER NOT NULL REFERENCES run ON DELETE CASCADE, name INTEGER NOT NULL REFERENCES name, verdict TEXT NOT NULL,
  headline TEXT NOT NULL, token TEXT NOT NULL, simulated_s REAL NOT NULL, wall_s REAL NOT NULL, trace_digest TEXT NOT NULL,
  source TEXT NOT NULL DEFAULT '',
  PRIMARY KEY (run, name)) WITHOUT ROWID;
CREATE INDEX result_of_case ON result (name, run);
CREATE TABLE measure (
  run INTEGER NOT NULL REFERENCES run ON DELETE CASCADE, name INTEGER NOT NULL REFERENCES name,
  what INTEGER NOT NULL REFERENCES name, value REAL NOT NULL, unit TEXT NOT NULL, tolerance REAL NOT NULL,
  PRIMARY KEY (run, name, what)) WITHOUT ROWID;
"""  # noqa: E501

_RESULTS: Final = (
    "SELECT run, text, verdict, headline, token, simulated_s, wall_s, trace_digest, source FROM result"
    " JOIN name ON name.number = result.name"
)


class HistoryError(ReportError):
    """A history cannot be read or written; the message names the file."""


@dataclass(frozen=True)
class PastRun:
    """A recorded run."""

    number: int
    """Counts from 1 in its history."""
    started: str
    title: str
    seed: str
    bench: str
    bench_digest: str
    version: str
    """Of the product, as the environment of the run names it; may be empty."""
    state: str
    interrupted: bool | int
    passed: int
    failed: int
    blocked: int
    errors: int
    simulated_s: float
    wall_s: float
    trace_digest: str

    @property
    def cases(self) -> int:
        """Number of cases."""
        return self.passed + self.failed + self.blocked + self.errors


@dataclass
class PastCase:
    """A case of a recorded run."""

    run: int
    identifier: str
    verdict: Verdict
    headline: str
    token: str
    simulated_s: float
    wall_s: float
    trace_digest: str
    source: str = ""
    """Digest of its source; empty where it is not known."""
    measures: dict[str, Measure] = field(default_factory=dict)
    """By name; filled by `History.cases` alone."""

    @property
    def bad(self) -> bool:
        """Failed or broke."""
        return self.verdict in {Verdict.FAILED, Verdict.ERROR}


class History:
    """The history in a file; a context manager.

    Args:
        path: The file; it need not exist yet.
        create: Whether a missing file is made; else it is an error.

    Raises:
        HistoryError: The file is missing, no history, or of another version.

    """

    def __init__(self, path: str | Path, *, create: bool = False) -> None:
        self.path = Path(path)
        if not create and not self.path.is_file():
            raise HistoryError(f"{self.path}: no history here; `hil run` makes one")
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._base = sqlite3.connect(self.path, timeout=WAIT_S, isolation_level=None)
        except (OSError, sqlite3.Error) as error:
            raise HistoryError(f"{self.path}: cannot be opened: {error}") from error
        try:
            self._prepare()
        except sqlite3.Error as error:
            self._base.close()
            raise HistoryError(f"{self.path}: {_database_error(error, 'not a history')}") from error
        except HistoryError:
            self._base.close()
            raise

    def _prepare(self) -> None:
        base = self._base
        base.execute("PRAGMA foreign_keys = ON")
        found = (_number(base, "PRAGMA application_id"), _number(base, "PRAGMA user_version"))
        if found == (_APPLICATION, _FORMAT):
            return
        with _Transaction(base):
            # Another process may have made it since.
            found = (_number(base, "PRAGMA application_id"), _number(base, "PRAGMA user_version"))
            if found == (0, 0) and not _number(base, "SELECT count(*) FROM sqlite_master"):
                for statement in _SCHEMA.split(";\n"):
                    if statement.strip():
                        base.execute(statement)
                base.execute(f"PRAGMA application_id = {_APPLICATION}")
                base.execute(f"PRAGMA user_version = {_FORMAT}")
            elif found == (_APPLICATION, 1):
                base.execute("ALTER TABLE result ADD COLUMN source TEXT NOT NULL DEFAULT ''")
                base.execute(f"PRAGMA user_version = {_FORMAT}")
            elif found != (_APPLICATION, _FORMAT):
                raise HistoryError(
                    f"{self.path}: not a history of format {_FORMAT}; name another file, or take this "
                    f"one away"
                )

    def close(self) -> None:
        """Close the file; again does nothing."""
        self._base.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def record(self, run: RunResult) -> int:
        """Add a run and return its number.

        A run that continues with an interrupted one takes its place: same start, seed and bench.

        Raises:
            HistoryError: The file cannot be written.

        """
        try:
            with _Transaction(self._base):
                return self._record(run)
        except sqlite3.Error as error:
            raise HistoryError(f"{self.path}: {_database_error(error, 'cannot be written')}") from error

    def _ask(self, query: str, values: Iterable[object] = ()) -> list[Any]:
        """Return the rows of a question.

        Raises:
            HistoryError: The file is damaged, or held by another process.

        """
        try:
            return self._base.execute(query, tuple(values)).fetchall()
        except sqlite3.Error as error:
            raise HistoryError(f"{self.path}: {_database_error(error, 'cannot be read')}") from error

    def _record(self, run: RunResult) -> int:
        base = self._base
        identity = (run.started, str(run.seed), _digest(run.bench_text))
        for (old,) in base.execute(
            "SELECT number FROM run WHERE started = ? AND seed = ? AND bench_digest = ? AND interrupted AND "
            "started <> ''",
            identity,
        ).fetchall():
            base.execute("DELETE FROM run WHERE number = ?", (old,))
        values = (
            run.started,
            storable_text(run.title),
            str(run.seed),
            storable_text(run.bench_name),
            _digest(run.bench_text),
            storable_text(run.environment.get("motion-hil", "")),
            run_state(run),
            run.interrupted,
            *_counts(run),
            _finite(sum(case.simulated_s for case in run.cases)),
            _finite(sum(case.wall_s for case in run.cases)),
            run_digest(run),
            json.dumps(run.environment),
        )
        number = base.execute(
            "INSERT INTO run (started, title, seed, bench, bench_digest, version, state, interrupted, "
            "passed, failed, blocked,"
            " errors, simulated_s, wall_s, trace_digest, environment) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, "
            "?, ?, ?, ?, ?, ?)",
            values,
        ).lastrowid
        assert number is not None
        names = _Names(base)
        for case in run.cases:
            name = names[storable_text(case.identifier)]
            base.execute(
                "INSERT OR REPLACE INTO result VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)",
                (
                    number,
                    name,
                    case.verdict.value,
                    storable_text(headline(case)),
                    storable_text(case.token),
                    _finite(case.simulated_s),
                    _finite(case.wall_s),
                    storable_text(case.trace_digest),
                    storable_text(case.source),
                ),
            )
            base.executemany(
                "INSERT OR REPLACE INTO measure VALUES (?, ?, ?, ?, ?, ?)",
                [
                    (
                        number,
                        name,
                        names[storable_text(one.name)],
                        one.value,
                        storable_text(one.unit),
                        one.tolerance,
                    )
                    for one in measures(case)
                ],
            )
        return number

    def runs(self, limit: int = 0) -> list[PastRun]:
        """Return the runs, newest first: the last `limit` of them, or all."""
        rows = self._ask(
            "SELECT number, started, title, seed, bench, bench_digest, version, state, interrupted, passed, "
            "failed, blocked,"
            " errors, simulated_s, wall_s, trace_digest FROM run ORDER BY number DESC LIMIT ?",
            (limit or -1,),
        )
        return [PastRun(*row) for row in rows]

    def number_of(self, run: RunResult) -> int | None:
        """Return the number under which a run was recorded; None if it was not,
        or has no start to know it by.
        """
        if not run.started:
            return None
        ((number,),) = self._ask(
            "SELECT max(number) FROM run WHERE started = ? AND seed = ? AND bench_digest = ? AND "
            "trace_digest = ?"
            " AND title = ? AND interrupted = ? AND passed = ? AND failed = ? AND blocked = ? AND errors = ?",
            (
                run.started,
                str(run.seed),
                _digest(run.bench_text),
                run_digest(run),
                storable_text(run.title),
                run.interrupted,
                *_counts(run),
            ),
        )
        return None if number is None else int(number)

    def find(self, reference: str) -> PastRun:
        """Return the run that a person names: its number, `last`, or `last-2` for the one two before it.

        Raises:
            HistoryError: There is no such run.

        """
        runs = self.runs()
        if reference.startswith("last"):
            back = reference.removeprefix("last").removeprefix("-") or "0"
            if back.isdigit() and int(back) < len(runs):
                return runs[int(back)]
        for run in runs:
            if str(run.number) == reference:
                return run
        known = f"1 to {runs[0].number}" if runs else "none, the history is empty"
        raise HistoryError(
            f"{self.path}: no run {reference!r}; allowed: last, last-1 and so on, or a number ({known})"
        )

    def cases(self, run: int) -> dict[str, PastCase]:
        """Return the cases of a run with their numbers, in the order of their names."""
        found = {case.identifier: case for case in self._cases(" WHERE run = ? ORDER BY text", (run,))}
        rows = self._ask(
            "SELECT cases.text, whats.text, value, unit, tolerance FROM measure JOIN name AS cases ON "
            "cases.number = name"
            " JOIN name AS whats ON whats.number = what WHERE run = ?",
            (run,),
        )
        for identifier, what, value, unit, tolerance in rows:
            if identifier in found:
                found[identifier].measures[what] = Measure(what, value, unit, tolerance)
        return found

    def past(self, identifier: str) -> list[PastCase]:
        """Return all results of a case, newest first."""
        return self._cases(" WHERE text = ? ORDER BY run DESC", (storable_text(identifier),))

    def before(self, run: int, depth: int = 10) -> dict[str, list[PastCase]]:
        """Return the earlier results of the cases of a run, newest first, at most `depth` of each."""
        rows = self._cases(
            " WHERE run < ? AND name IN (SELECT name FROM result WHERE run = ?) AND run >= ("
            " SELECT min(number) FROM (SELECT number FROM run WHERE number < ? ORDER BY number DESC LIMIT ?))"
            " ORDER BY run DESC",
            (run, run, run, depth * 5),
        )
        found: dict[str, list[PastCase]] = {}
        for case in rows:
            past = found.setdefault(case.identifier, [])
            if len(past) < depth:
                past.append(case)
        return found

    def _cases(self, query: str, values: Iterable[object]) -> list[PastCase]:
        try:
            return [
                PastCase(run, text, Verdict(verdict), *rest)
                for run, text, verdict, *rest in self._ask(_RESULTS + query, values)
            ]
        except ValueError as error:
            raise HistoryError(f"{self.path}: cannot be read: {error}") from error

    def prune(self, keep: int) -> int:
        """Delete all but the last `keep` runs; return how many went.

        Raises:
            ValueError: `keep` is below 1.
            HistoryError: The file cannot be written.

        """
        if keep < 1:
            raise ValueError(f"keep: {keep} is not allowed; allowed: 1 and more")
        old = [run.number for run in self.runs()[keep:]]
        try:
            with _Transaction(self._base):
                self._base.executemany("DELETE FROM run WHERE number = ?", [(number,) for number in old])
                self._base.execute(
                    "DELETE FROM name WHERE number NOT IN (SELECT name FROM result UNION SELECT what FROM "
                    "measure)"
                )
            self._base.execute("VACUUM")
        except sqlite3.Error as error:
            raise HistoryError(f"{self.path}: cannot be written: {error}") from error
        return len(old)


class _Transaction:
    """All or nothing, with the right to write from the beginning."""

    def __init__(self, base: sqlite3.Connection) -> None:
        self._base = base

    def __enter__(self) -> None:
        self._base.execute("BEGIN IMMEDIATE")

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._base.execute("COMMIT" if kind is None else "ROLLBACK")


class _Names:
    """Texts that many rows share, by number."""

    def __init__(self, base: sqlite3.Connection) -> None:
        self._base = base
        self._known: dict[str, int] = {
            text: number for number, text in base.execute("SELECT number, text FROM name")
        }

    def __getitem__(self, text: str) -> int:
        if text not in self._known:
            number = self._base.execute("INSERT INTO name (text) VALUES (?)", (text,)).lastrowid
            assert number is not None
            self._known[text] = number
        return self._known[text]


def _counts(run: RunResult) -> list[int]:
    return [
        run.count(verdict) for verdict in (Verdict.PASSED, Verdict.FAILED, Verdict.BLOCKED, Verdict.ERROR)
    ]


def _database_error(error: sqlite3.Error, what: str) -> str:
    """Return what is wrong with a file."""
    if getattr(error, "sqlite_errorname", "").startswith("SQLITE_BUSY"):
        return f"another process has held it for {WAIT_S:g} s: {error}"
    return f"{what}: {error}"


def _number(base: sqlite3.Connection, query: str) -> int:
    with closing(base.execute(query)) as answer:
        return int(answer.fetchone()[0])


def storable_text(value: str) -> str:
    """Return text that the database can hold: a lone surrogate has no UTF-8."""
    return value.encode("utf-8", "replace").decode("utf-8")


def _finite(value: float) -> float:
    return value if abs(value) < float("inf") else 0.0  # NaN too: it compares false


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8", "replace")).hexdigest()
