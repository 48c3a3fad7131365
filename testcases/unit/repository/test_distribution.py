"""The distribution: what is in the checkout is in the wheel, and the wheel can be built from the source
archive.
"""

import email
import json
import os
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from configparser import ConfigParser
from pathlib import Path

import pytest
from hatchling.builders.sdist import SdistBuilder
from hatchling.builders.wheel import WheelBuilder

ROOT = Path(__file__).resolve().parents[3]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
PRODUCT = ("fieldbus", "emulators", "motion", "hil", "reports")
SHIPPED = (*PRODUCT, "testcases/campaigns", "testcases/museum")


def built(builder, directory: Path) -> Path:
    (path,) = builder(str(ROOT)).build(directory=str(directory), versions=["standard"])
    return Path(path)


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> zipfile.ZipFile:
    with zipfile.ZipFile(built(WheelBuilder, tmp_path_factory.mktemp("wheel"))) as archive:
        yield archive


def files_of(package: str) -> set[str]:
    """Return the files of a package in the checkout, without what running it leaves behind."""
    return {
        path.relative_to(ROOT).as_posix()
        for path in (ROOT / package).rglob("*")
        if path.is_file()
        and path.suffix != ".pyc"
        and not any(part == "__pycache__" or part.startswith(".") for part in path.relative_to(ROOT).parts)
    }


@pytest.mark.exhaustive
@pytest.mark.parametrize("package", SHIPPED)
def test_every_file_of_a_package_is_in_the_wheel(wheel, package):
    """Code, object dictionaries, catalogues, templates, type marker: whatever lies in a package is shipped
    with it.
    """
    expected = files_of(package)
    assert expected
    assert sorted(expected - set(wheel.namelist())) == []


@pytest.mark.exhaustive
@pytest.mark.parametrize("package", PRODUCT)
def test_packages_are_marked_as_typed(wheel, package):
    """The type hints are part of the interface (PEP 561)."""
    assert f"{package}/py.typed" in wheel.namelist()


@pytest.mark.exhaustive
def test_nothing_but_the_packages_is_installed(wheel):
    """The wheel has the product, its campaigns and its museum; the tests stay in the source."""
    files = {name for name in wheel.namelist() if ".dist-info" not in name}
    assert {name.split("/")[0] for name in files} == {"motion_hil.py", *PRODUCT, "testcases"}
    folders = ("testcases/campaigns/", "testcases/museum/")
    others = [name for name in files if name.startswith("testcases/") and not name.startswith(folders)]
    assert others == ["testcases/__init__.py"]


def test_wheel_works_on_every_platform(wheel):
    """The product is pure Python."""
    (name,) = [name for name in wheel.namelist() if name.endswith(".dist-info/WHEEL")]
    assert email.message_from_bytes(wheel.read(name))["Tag"] == "py3-none-any"


def test_entry_points_lead_to_files(wheel):
    """The commands and plugins named in the metadata exist."""
    (name,) = [name for name in wheel.namelist() if name.endswith("entry_points.txt")]
    points = ConfigParser()
    points.read_string(wheel.read(name).decode())
    assert {"console_scripts", "can.interface", "pytest11"} <= set(points.sections())
    modules = [value.partition(":")[0] for section in points.values() for value in section.values()]
    missing = [
        module
        for module in modules
        if not {f"{module.replace('.', '/')}.py", f"{module.replace('.', '/')}/__init__.py"}
        & set(wheel.namelist())
    ]
    assert missing == []


def test_licence_and_readme_go_along(wheel):
    """Whoever has only the wheel has the licence and the description."""
    assert any(name.endswith(".dist-info/licenses/LICENSE") for name in wheel.namelist())
    (name,) = [name for name in wheel.namelist() if name.endswith(".dist-info/METADATA")]
    metadata = email.message_from_bytes(wheel.read(name))
    assert metadata["License-Expression"] == PROJECT["project"]["license"]
    assert metadata.get_payload().strip() == (ROOT / "README.md").read_text(encoding="utf-8").strip()


@pytest.mark.exhaustive
def test_source_archive_has_what_a_build_needs(tmp_path):
    """The source archive has all packages, their tests and the files that the set-up reads."""
    with tarfile.open(built(SdistBuilder, tmp_path)) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    expected = {"pyproject.toml", "README.md", "LICENSE", "tox.ini", "run"}.union(
        *map(files_of, (*PRODUCT, "testcases"))
    )
    assert sorted(expected - names) == []


@pytest.mark.exhaustive
def test_shipped_campaigns_run_from_the_wheel_alone(wheel, tmp_path):
    """With the wheel alone, campaigns are found by short name, cases run, and defects are seeded."""
    wheel.extractall(tmp_path / "site")

    def hil(*arguments: str) -> subprocess.CompletedProcess[str]:
        program = "import sys; from hil.cli import main; sys.exit(main())"
        return subprocess.run(
            [sys.executable, "-c", program, *arguments],
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": str(tmp_path / "site")},
            capture_output=True,
            text=True,
            check=False,
        )

    listed = hil("run", "stop_modes", "encoder_faults", "--list", "--json")
    assert listed.returncode == 0, listed.stderr
    campaigns = {entry["campaign"] for entry in json.loads(listed.stdout)}
    assert campaigns == {"testcases.campaigns.stop_modes:CAMPAIGN", "testcases.campaigns:encoder_faults.toml"}
    ran = hil("run", "stop_modes", "-k", "stop-modes/halt/standstill", "--json")
    assert json.loads(ran.stdout)["passed"] == 1, ran.stderr
    tests = hil("run", "testcases.unit.hil.toycampaign")
    assert tests.returncode == 2
    assert "run this in a checkout of its source" in tests.stderr
    seeded = hil("mutants", "gear-ratio-twice", "--campaign", "axis_signals@reference", "--json")
    assert [defect["status"] for defect in json.loads(seeded.stdout)] == ["caught"], seeded.stderr
