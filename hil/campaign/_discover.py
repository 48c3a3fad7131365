"""Finding campaigns: in Python files, matrix files, directories and modules."""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import pkgutil
import sys
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType

from hil.campaign._case import Campaign, Case
from hil.campaign._shipped import PACKAGE, expand_short_name, similar_short_name
from hil.errors import CampaignNotFoundError, CannotRunError
from motion_hil import explain

_matrices: dict[Path, Campaign] = {}
_SKIPPED = ("test_", "_", "conftest", "setup")


@dataclass(frozen=True)
class Found:
    """A campaign and how to find it again, in another process or from a token."""

    campaign: Campaign
    reference: str
    """`package.module:NAME`, `path/to/file.py:NAME`, `path/to/matrix.toml` or `package:matrix.toml`."""


@dataclass(frozen=True)
class Selected:
    """A case to be run."""

    case: Case
    campaign: str
    """Reference of its campaign."""
    configuration: Mapping[str, str] = field(default_factory=dict)
    """Values by name of the factor of the configuration that it runs on; empty: it runs on its own bench."""


def _not_importable(what: str, error: Exception) -> CannotRunError:
    return CannotRunError(
        f"{what} cannot be imported: {explain(error) or f'{type(error).__name__}: {error}'}"
    )


def import_file(path: Path) -> ModuleType:
    """Import a Python file that need not belong to a package.

    Raises:
        CannotRunError: The file raises while it is imported.

    """
    resolved = path.resolve()
    name = f"hil_campaign_{resolved.stem}_{hashlib.sha256(str(resolved).encode()).hexdigest()[:12]}"
    if name in sys.modules:
        return sys.modules[name]
    spec = importlib.util.spec_from_file_location(name, resolved)
    if spec is None or spec.loader is None:
        raise CampaignNotFoundError(str(path), "it is no Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    # Helpers in the folder of the file are importable, as they are for a script.
    if str(resolved.parent) not in sys.path:
        sys.path.append(str(resolved.parent))
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        del sys.modules[name]
        raise _not_importable(str(path), error) from error
    return module


def _campaigns_of(module: ModuleType, prefix: str) -> list[Found]:
    return [
        Found(value, f"{prefix}:{name}")
        for name, value in vars(module).items()
        if isinstance(value, Campaign)
    ]


def _in_file(path: Path) -> list[Found]:
    return _campaigns_of(import_file(path), str(path))


def matrix_campaign(path: Path) -> Campaign:
    """Return the campaign of a matrix file, read once per process."""
    resolved = path.resolve()
    if resolved not in _matrices:
        from hil.matrix import load_matrix  # knows campaigns, and is not needed where there is no matrix

        _matrices[resolved] = load_matrix(path)
    return _matrices[resolved]


def is_matrix(path: Path) -> bool:
    """Return whether a TOML file is a matrix: it has factors."""
    return any(line.strip() == "[factors]" for line in path.read_text("utf-8", errors="replace").splitlines())


def _in_matrix(path: Path) -> list[Found]:
    return [Found(matrix_campaign(path), str(path))]


def _in_directory(path: Path) -> list[Found]:
    found: list[Found] = []
    for file in sorted([*path.rglob("*.py"), *path.rglob("*.toml")]):
        if file.name.startswith(_SKIPPED) or any(part.startswith(".") for part in file.parts):
            continue
        if file.suffix == ".toml":
            if is_matrix(file):
                found.extend(_in_matrix(file))
            continue
        # Only files that speak of campaigns are imported: importing runs them.
        if "Campaign(" in file.read_text(encoding="utf-8", errors="replace"):
            found.extend(_in_file(file))
    return found


def _import_module(name: str) -> ModuleType:
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        missing = error.name or ""
        if (name == missing or name.startswith(missing + ".")) and not explain(error):
            raise CampaignNotFoundError(name, _why_missing(name)) from None
        raise _not_importable(name, error) from error
    except Exception as error:
        raise _not_importable(name, error) from error


def _why_missing(name: str) -> str:
    if name.startswith(PACKAGE.partition(".")[0] + ".") and not name.startswith(PACKAGE):
        return "the tests of motion-hil are not installed with it; run this in a checkout of its source"
    return f"there is no such file, directory or module{similar_short_name(name)}"


def _in_module(name: str) -> list[Found]:
    module = _import_module(name)
    found = _campaigns_of(module, name)
    if hasattr(module, "__path__"):
        for folder in module.__path__:
            files = [file for file in sorted(Path(folder).glob("*.toml")) if is_matrix(file)]
            found.extend(Found(matrix_campaign(file), f"{name}:{file.name}") for file in files)
        for info in pkgutil.walk_packages(module.__path__, prefix=f"{name}."):
            if not info.name.rpartition(".")[2].startswith(_SKIPPED):
                found.extend(_campaigns_of(_import_module(info.name), info.name))
    return found


def find_campaigns(references: Sequence[str]) -> list[Found]:
    """Return the campaigns at paths, in modules and of short names, in order, each once.

    Args:
        references: Short names of shipped campaigns, Python files, matrix files, directories, modules.

    Raises:
        CampaignNotFoundError: A reference leads to no campaign.
        CannotRunError: A file or module cannot be imported, or a short name is the name of a file here too.

    """
    if not references:
        raise CannotRunError(
            "nothing to run: give short names of shipped campaigns, or files, directories or modules"
        )
    found: dict[int, Found] = {}
    for reference in map(expand_short_name, references):
        path = Path(reference)
        if path.is_dir():
            here, reason = _in_directory(path), "no file in it defines a Campaign"
        elif path.is_file():
            if path.suffix not in {".py", ".toml"}:
                raise CampaignNotFoundError(reference, "it is no Python file and no matrix (TOML)")
            if path.suffix == ".toml" and _is_bench(path):
                raise CannotRunError(
                    f"{reference} is a bench file, no campaign: check it with `hil check {reference}`, run a "
                    f"campaign on it with `hil run stop_modes --bench {reference}`, or your tests with "
                    f"`pytest --hil-bench {reference}`"
                )
            here, reason = (
                _in_matrix(path) if path.suffix == ".toml" else _in_file(path),
                "it defines no Campaign"
                + (f"; tests of pytest run by `pytest {reference}`" if path.name.startswith("test_") else ""),
            )
        elif reference.endswith(".toml") and ":" in reference:
            here, reason = [Found(_packaged(reference), reference)], ""
        elif path.suffix in {".py", ".toml"} or "/" in reference or not _is_dotted(reference):
            raise CampaignNotFoundError(reference, "there is no such file or directory")
        else:
            here, reason = _in_module(reference), "it defines no Campaign"
        if not here:
            raise CampaignNotFoundError(reference, reason)
        for entry in here:
            found.setdefault(id(entry.campaign), entry)
    return list(found.values())


def _is_bench(path: Path) -> bool:
    """Return whether a TOML file is a bench file: a matrix has `[[bench]]`, and no segments."""
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False  # whoever reads it as a matrix says what is wrong
    return isinstance(content.get("bench"), dict) and "segment" in content


def _is_dotted(text: str) -> bool:
    return all(part.isidentifier() for part in text.split("."))


def _packaged(reference: str) -> Campaign:
    """Return the campaign of a matrix in a package, `package:matrix.toml`."""
    package, _, name = reference.partition(":")
    for folder in getattr(_import_module(package), "__path__", ()):
        if (Path(folder) / name).is_file():
            return matrix_campaign(Path(folder) / name)
    raise CampaignNotFoundError(reference, f"the package {package} has no {name}")


def load_campaign(reference: str) -> Campaign:
    """Return the campaign that a `Found.reference` names.

    Raises:
        CampaignNotFoundError: It is not there any more.

    """
    where, separator, name = reference.rpartition(":")
    if name.endswith(".toml"):
        if separator:
            return _packaged(reference)
        if not Path(reference).is_file():
            raise CampaignNotFoundError(reference, "there is no such file")
        return matrix_campaign(Path(reference))
    if not separator:
        raise CampaignNotFoundError(reference, "it names no module and attribute")
    if where.endswith(".py"):
        path = Path(where)
        if not path.is_file():
            raise CampaignNotFoundError(reference, "there is no such file")
        module = import_file(path)
    else:
        module = _import_module(where)
    campaign = getattr(module, name, None)
    if not isinstance(campaign, Campaign):
        raise CampaignNotFoundError(reference, f"{where} defines no Campaign {name}")
    return campaign


def select_cases(
    found: Iterable[Found], *, pattern: str = "", tags: Sequence[str] = (), identifiers: Sequence[str] = ()
) -> list[Selected]:
    """Return the cases to run, in order.

    Args:
        found: Campaigns.
        pattern: Only cases with this text in identifier or title (upper and lower case are the same).
        tags: Only cases with all of these tags.
        identifiers: Only these cases.

    Raises:
        CannotRunError: Two cases share an identifier, a named one is unknown, or nothing is left.

    """
    selected: dict[str, Selected] = {}
    for entry in found:
        for case in entry.campaign.cases:
            if case.identifier in selected:
                raise CannotRunError(
                    f"the case {case.identifier!r} is defined twice: in "
                    f"{selected[case.identifier].campaign} and in "
                    f"{entry.reference}"
                )
            selected[case.identifier] = Selected(case, entry.reference)
    for identifier in identifiers:
        if identifier not in selected:
            raise CannotRunError(f"there is no case {identifier!r}; there are {len(selected)} others")
    wanted = [
        item
        for item in selected.values()
        if (not identifiers or item.case.identifier in identifiers)
        and pattern.lower() in f"{item.case.identifier} {item.case.title}".lower()
        and set(tags) <= set(item.case.tags)
    ]
    if not wanted:
        raise CannotRunError(f"none of {len(selected)} cases fits the selection")
    return wanted
