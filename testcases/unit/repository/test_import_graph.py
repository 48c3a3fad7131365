"""No import circle between the modules of the product, and no base class with a single subclass."""

from __future__ import annotations

import ast
from collections import defaultdict
from functools import cache
from pathlib import Path
from typing import Final

import pytest

ROOT: Final = Path(__file__).parents[3]
PACKAGES: Final = ("fieldbus", "emulators", "motion", "hil", "reports")

# Base classes that rightly have one subclass, with the reason. Exceptions are exempt: users catch the base.
SINGLE_SUBCLASS: Final = {
    "reports.model.Signal": "what is stored; `hil` adds the questions to it, `reports` does without `hil`",
}


@cache
def modules() -> dict[str, Path]:
    """Return the files of the product by module name."""
    found = {}
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            parts = path.relative_to(ROOT).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


@cache
def trees() -> dict[str, ast.Module]:
    """Return the syntax trees of the product by module name."""
    return {module: ast.parse(path.read_text(encoding="utf-8")) for module, path in modules().items()}


def source_of(module: str, node: ast.ImportFrom) -> str:
    """Return the absolute name behind `from`."""
    if not node.level:
        return node.module or ""
    package = module if modules()[module].name == "__init__.py" else module.rpartition(".")[0]
    for _ in range(node.level - 1):
        package = package.rpartition(".")[0]
    return f"{package}.{node.module}" if node.module else package


def imported(module: str, tree: ast.Module) -> set[str]:
    """Return the product modules that a module imports: also for types alone, and within functions."""
    known = modules()
    found: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            source = source_of(module, node)
            for alias in node.names:
                name = f"{source}.{alias.name}"
                found.add(name if name in known else source)
    return {name for name in found if name in known and name != module}


@cache
def circles() -> list[list[str]]:
    """Return the sets of modules that import each other (strongly connected components, after Tarjan)."""
    graph = {module: sorted(imported(module, tree)) for module, tree in trees().items()}
    number: dict[str, int] = {}
    lowest: dict[str, int] = {}
    open_modules: list[str] = []
    found: list[list[str]] = []

    def visit(module: str) -> None:
        number[module] = lowest[module] = len(number)
        open_modules.append(module)
        for other in graph[module]:
            if other not in number:
                visit(other)
            if other in open_modules:
                lowest[module] = min(lowest[module], lowest[other])
        if lowest[module] == number[module]:
            place = open_modules.index(module)
            circle = open_modules[place:]
            del open_modules[place:]
            if len(circle) > 1:
                found.append(sorted(circle))

    for module in graph:
        if module not in number:
            visit(module)
    return found


@cache
def names(module: str) -> dict[str, str]:
    """Return what the names in a module stand for: classes of its own, and what it imports."""
    found: dict[str, str] = {}
    for node in ast.walk(trees()[module]):
        if isinstance(node, ast.ClassDef):
            found[node.name] = f"{module}.{node.name}"
        elif isinstance(node, ast.ImportFrom):
            source = source_of(module, node)
            found.update({alias.asname or alias.name: f"{source}.{alias.name}" for alias in node.names})
    return found


def definition(name: str) -> str | None:
    """Return where a class is defined that a package may re-export; None: it is not of the product."""
    module, _, short = name.rpartition(".")
    if module not in modules():
        return None
    place = names(module).get(short)
    return place if place is None or place == name else definition(place)


def base_name(module: str, base: ast.expr) -> str | None:
    """Return the full name of a base class; None: it is not of the product."""
    if isinstance(base, ast.Subscript):
        base = base.value
    if isinstance(base, ast.Name):
        return definition(f"{module}.{base.id}")
    if isinstance(base, ast.Attribute) and isinstance(base.value, ast.Name):
        return definition(f"{names(module).get(base.value.id, '')}.{base.attr}")
    return None


def subclasses() -> dict[str, set[str]]:
    """Return the product classes that have subclasses in the product, with these."""
    found: dict[str, set[str]] = defaultdict(set)
    for module, tree in trees().items():
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef):
                for base in node.bases:
                    name = base_name(module, base)
                    if name is not None:
                        found[name].add(f"{module}.{node.name}")
    return found


@pytest.mark.exhaustive
def test_no_modules_import_each_other_in_a_circle() -> None:
    """No module imports itself through others; imports for types and within functions count."""
    assert circles() == []


@pytest.mark.exhaustive
def test_no_base_class_has_one_subclass() -> None:
    """What one class inherits alone is a part of it, or the same class."""
    single = {
        base: next(iter(children))
        for base, children in subclasses().items()
        if len(children) == 1 and not base.endswith(("Error", "Failure"))
    }
    new = {base: child for base, child in single.items() if base not in SINGLE_SUBCLASS}
    assert not new, f"a base class with one subclass: {new}"
    gone = set(SINGLE_SUBCLASS) - set(single)
    assert not gone, f"no longer with one subclass, take off the list: {sorted(gone)}"


def test_the_graph_counts_every_kind_of_import() -> None:
    """Imports of submodules from their package, imports for types and imports within functions are edges."""
    source = (
        "from fieldbus import clock\n"
        "from typing import TYPE_CHECKING\n"
        "if TYPE_CHECKING:\n"
        "    from fieldbus.history import History\n"
        "def load():\n"
        "    import fieldbus.errors\n"
        "    from .can import frame\n"
    )
    assert imported("fieldbus", ast.parse(source)) == {
        "fieldbus.clock",
        "fieldbus.history",
        "fieldbus.errors",
        "fieldbus.can.frame",
    }
