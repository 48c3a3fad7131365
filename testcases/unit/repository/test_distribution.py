"""The distribution: what is in the checkout is in the wheel, and the wheel can be built from the source
archive.
"""

import email
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
PACKAGES = PROJECT["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"]


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


@pytest.mark.parametrize("package", PACKAGES)
def test_every_file_of_a_package_is_in_the_wheel(wheel, package):
    """Code, object dictionaries, catalogues, templates, type marker: whatever lies in a package is shipped
    with it.
    """
    expected = files_of(package)
    assert expected
    assert sorted(expected - set(wheel.namelist())) == []


@pytest.mark.parametrize("package", [name for name in PACKAGES if name != "testcases"])
def test_packages_are_marked_as_typed(wheel, package):
    """The type hints are part of the interface (PEP 561)."""
    assert f"{package}/py.typed" in wheel.namelist()


def test_nothing_but_the_packages_is_installed(wheel):
    """The wheel puts nothing else at the top level of site-packages."""
    assert {name.split("/")[0] for name in wheel.namelist() if ".dist-info" not in name} == set(PACKAGES)


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


def test_source_archive_has_what_a_build_needs(tmp_path):
    """The source archive has all packages, their tests and the files that the set-up reads."""
    with tarfile.open(built(SdistBuilder, tmp_path)) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    expected = {"pyproject.toml", "README.md", "LICENSE", "tox.ini", "run"}.union(*map(files_of, PACKAGES))
    assert sorted(expected - names) == []
