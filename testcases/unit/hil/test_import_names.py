"""Projects that have a package with the name of one of ours: one sentence names both files and the remedy."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import motion_hil

pytestmark = pytest.mark.exhaustive

ROOT = Path(__file__).resolve().parents[3]
SITE = Path(motion_hil.__file__).parent
COMMAND = ("-c", "import sys; from motion_hil import main; sys.exit(main())")
PYTEST = ("-m", "pytest", "-p", "no:cacheprovider", "--color=no")


@pytest.fixture
def project(tmp_path) -> Path:
    """A folder for a user's project; next to it the metadata of this version, whatever is installed."""
    points = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["entry-points"][
        "pytest11"
    ]
    info = tmp_path / "site" / "motion_hil-0.1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: motion-hil\nVersion: 0.1.0\n")
    lines = [f"{name} = {value}\n" for name, value in points.items()]
    (info / "entry_points.txt").write_text("[pytest11]\n" + "".join(lines))
    folder = tmp_path / "project"
    folder.mkdir()
    return folder


def package(project: Path, name: str) -> Path:
    """Add a package to the project that knows nothing of us."""
    (project / name).mkdir()
    (project / name / "cell.py").write_text("PITCH_MM = 5.0\n")
    file = project / name / "__init__.py"
    file.write_text("")
    return file


def run(project: Path, *arguments: object, first: bool) -> subprocess.CompletedProcess[str]:
    """Run a program in the project, whose folder comes first or last on the path."""
    places = [project.parent / "site", SITE]
    places = [project, *places] if first else places
    return subprocess.run(
        [sys.executable, "-P", *map(str, arguments)],
        cwd=project,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(map(str, places)), "PYTEST_ADDOPTS": ""},
        capture_output=True,
        text=True,
        check=False,
    )


def sentence(first: Path, second: Path, name: str) -> str:
    """Return the sentence for two files, the first of which hides the second."""
    ours = " of motion-hil"
    hides = f"{first}{ours} hides {second}" if first.is_relative_to(SITE) else f"{first} hides {second}{ours}"
    return (
        f"{hides}, because both are imported as {name!r}: rename yours, or move it into a package of your "
        f"own (my_machine.{name})"
    )


def ours(name: str) -> Path:
    return SITE / name / "__init__.py"


@pytest.mark.parametrize("name", ["fieldbus", "motion", "hil"])
def test_the_command_names_a_package_that_hides_ours(project, name):
    """Whatever the command, it ends with 2 and the sentence, and nothing else."""
    theirs = package(project, name)
    done = run(project, *COMMAND, "check", "reference", first=True)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == f"hil: {sentence(theirs, ours(name), name)}\n"


def test_a_module_hides_as_a_package_does(project):
    """A single file of the name is named too; a folder without Python files hides nothing."""
    (project / "reports").mkdir()
    assert run(project, *COMMAND, "run", "stop_modes", "-k", "halt/standstill", first=True).returncode == 0
    (project / "motion.py").write_text("")
    done = run(project, *COMMAND, "faults", first=True)
    assert done.stderr == f"hil: {sentence(project / 'motion.py', ours('motion'), 'motion')}\n"


def test_the_command_names_campaigns_that_are_hidden(project):
    """A package `testcases` hides the shipped campaigns only: other commands run."""
    theirs = package(project, "testcases")
    assert run(project, *COMMAND, "faults", first=True).returncode == 0
    done = run(project, *COMMAND, "run", "stop_modes", first=True)
    assert done.returncode == 2
    assert sentence(theirs, SITE / "testcases" / "__init__.py", "testcases") in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("name", "line"),
    [("motion", "from {} import cell"), ("reports", "import {}.cell"), ("testcases", "import {}.cell")],
)
def test_the_command_names_a_package_that_ours_hides(project, name, line):
    """A campaign that imports a package of its project gets ours: both files are named."""
    theirs = package(project, name)
    (project / "our_stops.py").write_text(
        f"from hil import Campaign\n{line.format(name)}\nC = Campaign('c')\n"
    )
    done = run(project, *COMMAND, "run", "our_stops.py", first=False)
    assert done.returncode == 2
    assert done.stderr == f"hil: our_stops.py cannot be imported: {sentence(ours(name), theirs, name)}\n"


@pytest.mark.parametrize(
    ("place", "name"),
    [
        ("conftest.py", "fieldbus"),
        ("test_machine.py", "motion"),
        ("fixture", "fieldbus"),
        ("report", "reports"),
    ],
)
def test_pytest_names_a_package_that_hides_ours(project, place, name):
    """In conftest.py, a test module, a fixture, or for a report: the sentence instead of a traceback."""
    theirs = package(project, name)
    test = "def test_a(bench): pass\n" if place == "fixture" else "def test_a(): pass\n"
    (project / "test_machine.py").write_text(test)
    if place.endswith(".py"):
        (project / place).write_text(f"import hil.testing\nimport hil.bench\n{test}")
    more = ["--hil-report", "rep"] if place == "report" else []
    done = run(project, *PYTEST, *more, first=True)
    reported = done.stdout + done.stderr
    assert done.returncode in {1, 2, 4}
    assert sentence(theirs, ours(name), name) in reported
    assert "Traceback" not in reported
    assert "ModuleNotFoundError" not in reported


def test_pytest_names_a_package_that_hides_the_plugin(project):
    """A package `hil` hides the plugin itself; without the plugin the tests of the project run."""
    theirs = package(project, "hil")
    (project / "test_machine.py").write_text("def test_a(): pass\n")
    done = run(project, *PYTEST, first=True)
    assert done.returncode == 4
    assert sentence(theirs, ours("hil"), "hil") in done.stderr
    assert "pytest -p no:hil" in done.stderr
    assert run(project, *PYTEST, "-p", "no:hil", first=True).returncode == 0


def test_pytest_names_a_package_that_ours_hides(project):
    """A test module that imports a package of its project gets ours: both files are named."""
    theirs = package(project, "motion")
    (project / "tests").mkdir()
    (project / "tests" / "test_machine.py").write_text("from motion import cell\ndef test_a(): pass\n")
    done = run(project, *PYTEST, "tests", first=False)
    assert done.returncode == 2
    assert sentence(ours("motion"), theirs, "motion") in done.stdout
    assert "Traceback" not in done.stdout


def test_projects_that_need_no_bench_are_left_alone(project):
    """A project with packages of our names whose tests use nothing of ours runs as without us."""
    for name in ("motion", "reports", "testcases"):
        package(project, name)
    (project / "test_machine.py").write_text(
        "import motion.cell, reports.cell, testcases.cell\ndef test_a(): assert motion.cell.PITCH_MM == 5.0\n"
    )
    done = run(project, *PYTEST, first=True)
    assert done.returncode == 0, done.stdout
    assert re.search(r"1 passed", done.stdout)
