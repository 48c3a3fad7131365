"""In pytest: packages of a user's project that have the import names of ours are named in one sentence."""

from __future__ import annotations

from collections.abc import Generator

import pytest

from motion_hil import explain, hidden


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_load_initial_conftests() -> Generator[None, None, None]:
    """Say it in place of the traceback of a conftest.py."""
    try:
        yield
    except Exception as error:
        if text := explain(error):
            raise pytest.UsageError(text) from error
        raise


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_make_collect_report() -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    """Say it in place of the traceback of a test module."""
    report = yield
    call: object = getattr(report, "call", None)
    if report.failed and isinstance(call, pytest.CallInfo) and call.excinfo is not None:
        report.longrepr = explain(call.excinfo.value) or report.longrepr
    return report


@pytest.hookimpl(tryfirst=True)
def pytest_runtestloop(session: pytest.Session) -> None:
    """Say it once, before the tests, where one of them has a bench or a report is wanted at the end."""
    benches = any(
        isinstance(item, pytest.Function) and "hil_bench_file" in item.fixturenames for item in session.items
    )
    if (benches or session.config.getoption("--hil-report")) and (text := hidden()):
        raise pytest.UsageError(text)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_sessionfinish() -> Generator[None]:
    """Say it in place of the traceback of a report that cannot be written."""
    try:
        yield
    except Exception as error:
        if text := explain(error):
            raise pytest.UsageError(text) from error
        raise


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_makereport(
    call: pytest.CallInfo[None],
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Say it in place of the traceback of a fixture or test."""
    report = yield
    if report.failed and call.excinfo is not None:
        report.longrepr = explain(call.excinfo.value) or report.longrepr
    return report
