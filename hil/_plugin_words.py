"""What pytest says of a failed test with a bench: why, in one sentence, and no frames of the library."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Final

import _pytest
import pluggy
import pytest

from fieldbus.errors import HilError
from hil._plugin_tests import FIXTURES
from motion_hil import PACKAGES

if TYPE_CHECKING:
    from hil.protocols import Bench

_ROOT: Final = Path(__file__).resolve().parents[1]
_OWN: Final = tuple(str(_ROOT / name) + "/" for name in PACKAGES if name != "testcases")
_INTERNAL: Final = tuple(str(Path(str(one.__file__)).parent) + os.sep for one in (_pytest, pluggy))
"""Where pytest calls fixtures from."""
_BARE: Final = re.compile(r"assert (not )?(True|False|None|0)$")
_WHERE: Final = re.compile(r"^ \+  where (.*)$", re.MULTILINE)
_REPRODUCE: Final = re.compile(r"@reproduce_failure\('([^']+)', (b'[^']*'|b\"[^\"]*\")\)")


def explain(error: BaseException, *, wait: str, statement: str, waiting: list[str]) -> None:
    """Put the reason in front of the message of a failed assertion.

    Args:
        error: What the test has raised; it is changed.
        wait: Why the last `run_until` gave up; empty: it did not.
        statement: The line of the test that has raised it.
        waiting: Faults whose trigger has not fired, a line each.

    """
    for one in _leaves(error):
        if not isinstance(one, AssertionError) or getattr(one, "_hil_explained", False):
            continue
        text = str(one.args[0]) if one.args else ""
        first, _, rest = text.partition("\n")
        reason = ""
        if (
            wait
            and wait not in first
            and ("run_until(" in text or "run_until(" in statement or _BARE.match(text))
        ):
            reason = wait
        elif _BARE.match(first) and (found := _WHERE.search(text)):
            reason = found[1]
        if reason:
            plain = not first or first.startswith("assert ")
            text = f"{reason}\n{text}" if plain else f"{first}: {reason}" + (f"\n{rest}" if rest else "")
        text = "\n".join([text.rstrip("\n"), *(line for line in waiting if line not in text)])
        one.args = (text, *one.args[1:])
        one._hil_explained = True  # type: ignore[attr-defined]  # noqa: SLF001 - hooks may come twice


def last_statement(excinfo: pytest.ExceptionInfo[BaseException]) -> str:
    """Return the line that has raised an error; empty where its code has no source, such as that of a
    generated `__init__`.
    """
    if not excinfo.traceback or excinfo.traceback[-1].frame.code.fullsource is None:
        return ""
    return str(excinfo.traceback[-1].statement)


def note_waiting(bench: Bench, waiting: list[str]) -> None:
    """Say in the checks that counted from a fault which has not come why it has not."""
    from hil.testing import CurrentTrace
    from reports.model import Verdict

    for current in CurrentTrace.all_of(bench) if waiting else ():
        for check in current.checks:
            if check.verdict is not Verdict.PASSED and "'fault.applied" in check.observed:
                shown = "; ".join(waiting)
                check.observed = f"{check.observed}; {shown}"
                check.sentence = f"{check.sentence}; {shown}" if check.sentence else ""


def explain_health_check(error: BaseException) -> None:
    """Say what takes the place of a fixture that Hypothesis refuses."""
    if type(error).__name__ != "FailedHealthCheck" or not error.args:
        return
    text = str(error.args[0])
    found = re.search(r"function-scoped fixture '(\w+)'", text)
    if found is not None and found[1] in FIXTURES:
        shown = (
            f"{found[1]} is one bench for all examples: take the fixture new_bench and build a bench in "
            "every example, bench = new_bench()"
        )
        error.args = (f"{shown}\n{text}",)


def without_internals(excinfo: pytest.ExceptionInfo[BaseException]) -> pytest.ExceptionInfo[BaseException]:
    """Return an error of ours that no line of the test has raised, such as a wrong bench file in the fixture
    `bench`, as its message alone; any other as it is.
    """
    error = excinfo.value
    if not isinstance(error, HilError) or any(
        not one.tb_frame.f_code.co_filename.startswith((*_OWN, *_INTERNAL)) for one in _frames(excinfo.tb)
    ):
        return excinfo
    plain = pytest.fail.Exception(str(error), pytrace=False)
    return pytest.ExceptionInfo.from_exception(plain.with_traceback(excinfo.tb))


def without_own_frames(excinfo: pytest.ExceptionInfo[BaseException]) -> pytest.ExceptionInfo[BaseException]:
    """Return what a test has raised without the frames of the library, where the error is one of the test and
    not ours.
    """
    error = excinfo.value
    frames = list(_frames(excinfo.tb))
    kept = [one for one in frames if not one.tb_frame.f_code.co_filename.startswith(_OWN)]
    ours = frames[-1] is not kept[-1] if kept else True
    if not kept or len(kept) == len(frames) or (ours and not isinstance(error, (HilError, AssertionError))):
        return excinfo
    chain: TracebackType | None = None
    for one in reversed(kept):
        chain = TracebackType(chain, one.tb_frame, one.tb_lasti, one.tb_lineno)
    return pytest.ExceptionInfo.from_exception(error.with_traceback(chain))


def _frames(traceback: TracebackType | None) -> Iterator[TracebackType]:
    while traceback is not None:
        yield traceback
        traceback = traceback.tb_next


def crash_text(error: BaseException) -> str:
    """Return what an exception says, as the message of a case: its text, notes, and those of its group."""
    parts = []
    for one in _leaves(error):
        text = str(one)
        if not isinstance(one, AssertionError) and not isinstance(one, HilError):
            text = f"{type(one).__name__}: {text}" if text else type(one).__name__
        parts.append("\n".join([text or type(one).__name__, *_notes(one)]))
    return "\n\n".join(parts)


def _notes(error: BaseException) -> list[str]:
    return error.__notes__ if hasattr(error, "__notes__") else []


def example_of(error: BaseException) -> str:
    """Return what `@reproduce_failure` takes to repeat an example of Hypothesis, `VERSION BLOB`; empty where
    it is not reported.
    """
    for one in _leaves(error):
        for note in _notes(one):
            if found := _REPRODUCE.search(note):
                return f"{found[1]} {found[2][2:-1]}"
    return ""


def _leaves(error: BaseException) -> Iterator[BaseException]:
    if isinstance(error, BaseExceptionGroup):
        for one in error.exceptions:
            yield from _leaves(one)
    else:
        yield error
