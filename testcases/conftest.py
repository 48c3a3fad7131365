"""What all tests share: Hypothesis profiles, the real CAN interface, and the ban on silent skips.

Environment variables:
    HYPOTHESIS_PROFILE: `dev` (default; new examples in every run), `ci` (the same examples in every run) or
        `nightly` (many new examples).
    HIL_VCAN, HIL_VCAN_FAR: Names of the SocketCAN interfaces for tests with the mark `vcan`; default
        vcan0, vcan0b.
    HIL_NO_SKIPS: Not empty: a skipped test counts as failed. For places where everything is known to be
        installed.
"""

import os
import socket
import sys
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

import hil

ROOT = Path(__file__).resolve().parents[1]

# Stateful programs take long on a loaded machine: a deadline would measure the machine.
settings.register_profile("dev", deadline=None, print_blob=True)
settings.register_profile("ci", deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile(
    "nightly", deadline=None, max_examples=2000, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE") or "dev")


@pytest.fixture(scope="session", autouse=True)
def helpers_of_the_checkout(tmp_path_factory):
    """Processes that tests start find `testcases` in the checkout, also where the wheel is installed.

    The wheel has the campaigns of `testcases` only. A folder with nothing but a link to the checkout's
    `testcases` comes first on the path; all other packages still come from the wheel.
    """
    if Path(hil.__file__).resolve().parents[1] == ROOT:
        yield
        return
    folder = tmp_path_factory.mktemp("checkout")
    (folder / "testcases").symlink_to(ROOT / "testcases", target_is_directory=True)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "path", [str(folder), *sys.path])
        patch.setenv("PYTHONPATH", str(folder), prepend=os.pathsep)
        yield


@pytest.fixture(scope="session")
def vcan_channel() -> str:
    """Name of a SocketCAN interface that works; the test fails, and is never skipped, where there is none."""
    return working_interface(os.environ.get("HIL_VCAN") or "vcan0")


@pytest.fixture(scope="session")
def far_channel(vcan_channel) -> str:
    """Name of a second SocketCAN interface, not connected to the first."""
    return working_interface(os.environ.get("HIL_VCAN_FAR") or f"{vcan_channel}b")


def working_interface(interface: str) -> str:
    """Return `interface`, or fail when no CAN socket can be opened on it."""
    try:
        with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as probe:
            probe.bind((interface,))
    except OSError as error:
        pytest.fail(
            f"no SocketCAN interface {interface}: {error.strerror or error}. "
            "Run these tests through `tox -e vcan` or `python testcases/vcan/run.py -- pytest -m vcan`.",
            pytrace=False,
        )
    return interface


def _fail_instead_of_skip(report):
    if report.skipped and not hasattr(report, "wasxfail") and os.environ.get("HIL_NO_SKIPS"):
        reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else report.longrepr
        report.outcome = "failed"
        report.longrepr = f"HIL_NO_SKIPS is set, but this was skipped. {reason}"
    return report


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport():
    return _fail_instead_of_skip((yield))


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report():
    return _fail_instead_of_skip((yield))
