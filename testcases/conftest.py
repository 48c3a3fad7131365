"""What all tests share: Hypothesis profiles, the quick selection, the real CAN interface, no silent skips.

Plain `pytest` runs the quick selection on all processors: no test with the mark `exhaustive`, and the
first parameter set of every parametrised test. `pytest PATH` runs every test of a path, `pytest testcases`
every test that needs nothing but Python.

Environment variables:
    HYPOTHESIS_PROFILE: `dev` (default; new examples in every run), `ci` (the same examples in every run) or
        `nightly` (many new examples).
    HIL_VCAN, HIL_VCAN_2: Names of the SocketCAN interfaces for tests with the mark `vcan`; default
        vcan0, vcan1.
    HIL_CORE: `pure` (default here) or `compiled`: what the tests run (`fieldbus.core_build`). Tests replace
        methods and look at code, so that they are for ordinary Python; `tox -e compiled` runs some of them.
    HIL_NO_SKIPS: Not empty: a skipped test counts as failed. For places where everything is known to be
        installed.
"""

import gc
import os
import re
import socket
import sys
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

os.environ.setdefault("HIL_CORE", "pure")  # before anything of the product is imported

import hil
from hil.fuzz._provider import BACKEND

ROOT = Path(__file__).resolve().parents[1]

# Stateful programs take long on a loaded machine: a deadline would measure the machine.
settings.register_profile("dev", deadline=None, print_blob=True)
# Hypothesis mixes constants of the modules that happen to be loaded into its examples; the provider of the
# program search does not, so that examples depend on the test alone.
settings.register_profile(
    "ci",
    deadline=None,
    max_examples=30,  # they are the same in every run; new ones are for `dev` and `nightly`
    derandomize=True,
    backend=BACKEND,
    suppress_health_check=[HealthCheck.too_slow],
)
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


MADE_BY_A_BENCH = 2_000
"""Objects that a test has made and not freed, from which on there may be a bench among them."""
ELSEWHERE = ("browser", "peers", "realtime", "vcan")
"""Marks of tests that need more than Python and processor time; they have their own environments."""
OWN_CHOICE = ("exhaustive", *ELSEWHERE)
_FILE_MARKS = re.compile(r"^pytestmark = .*", re.MULTILINE)


@pytest.hookimpl(tryfirst=True)  # before xdist reads its options
def pytest_cmdline_main(config: pytest.Config) -> None:
    """Without paths, use all processors; without `-m` and `-k` too, take the quick selection.

    Runs in every worker of xdist as well, which reads the command line itself.
    """
    option = config.option
    if config.args_source is not pytest.Config.ArgsSource.TESTPATHS:
        return
    option.benchmark_disable = True
    if option.markexpr in config.getini("addopts") and not option.keyword:
        option.markexpr += " and not exhaustive"
    alone = hasattr(config, "workerinput") or option.collectonly or option.usepdb
    if config.pluginmanager.hasplugin("xdist") and option.numprocesses is None and not alone:
        option.numprocesses, option.dist = "auto", "load"


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """Collect without garbage collection: it would take a third of the time and find nothing.

    Afterwards it runs seldom: with Python's own threshold it takes a tenth of the time of the tests.
    """
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.set_threshold(50_000, 20)
        gc.enable()


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """One worker more than processors: tests that start a process or a server wait for it."""
    return (os.cpu_count() or 1) + 1


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_protocol():
    """Free the benches of a test behind it: webs of references that would stay, with thresholds as high as
    these, until a worker has 2 GB.
    """
    try:
        return (yield)
    finally:
        fresh, survived, _ = gc.get_count()
        if survived or fresh > MADE_BY_A_BENCH:
            gc.collect(1)


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Do not import a test file none of whose tests can be selected.

    Importing all of them takes half a minute. With `-m "... not NAME"` these are the files with
    `pytestmark = pytest.mark.NAME`; with `-m NAME`, the files without the word.
    """
    if collection_path.suffix != ".py" or str(collection_path) in config.args:
        return None
    selection = config.option.markexpr
    excluded = re.findall(r"\bnot (\w+)", selection)
    text = collection_path.read_text(encoding="utf-8")
    if selection.isidentifier() and selection != "exhaustive":
        return True if selection not in f"{collection_path} {text}" else None
    marked = " ".join(_FILE_MARKS.findall(text))
    return True if any(f"mark.{name}" in marked for name in excluded) else None


@pytest.hookimpl(tryfirst=True)  # before pytest selects by marks
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Give the mark `exhaustive` to all parameter sets of a test but the first.

    A test some of whose sets have the mark already makes its own choice.
    """
    by_test: dict[tuple[object, str], list[pytest.Item]] = {}
    for item in items:
        by_test.setdefault((item.parent, getattr(item, "originalname", item.name)), []).append(item)
    for sets in by_test.values():
        if not any(item.get_closest_marker(name) for name in OWN_CHOICE for item in sets):
            for item in sets[1:]:
                item.add_marker(pytest.mark.exhaustive)


@pytest.fixture(scope="session")
def vcan_channel() -> str:
    """Name of a SocketCAN interface that works; the test fails, and is never skipped, where there is none."""
    return working_interface(os.environ.get("HIL_VCAN") or "vcan0")


@pytest.fixture(scope="session")
def far_channel(vcan_channel) -> str:
    """Name of a second SocketCAN interface, not connected to the first."""
    return working_interface(os.environ.get("HIL_VCAN_2") or "vcan1")


def working_interface(interface: str) -> str:
    """Return `interface`, or fail when no CAN socket can be opened on it."""
    try:
        with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as probe:
            probe.bind((interface,))
    except OSError as error:
        pytest.fail(
            f"no SocketCAN interface {interface}: {error.strerror or error}. "
            "Run these tests through `tox -e vcan` or `hil vcan --count 2 -- pytest -m vcan`.",
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
