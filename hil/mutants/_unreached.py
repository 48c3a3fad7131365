"""Which statements of the product no case comes to."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from hil.mutants._marks import marked
from hil.mutants._mechanical import live_code, modules_of_package, packages_of
from hil.mutants._seeding import Seeder


@dataclass(frozen=True)
class ModuleReach:
    """How much of a module the cases come to."""

    module: str
    statements: int
    """Statements of its functions; those of code that no virtual bench runs are left out."""
    unreached: tuple[int, ...]
    """First lines of the statements that no case comes to."""

    def as_dict(self) -> dict[str, object]:
        """Return it as plain data."""
        return {"module": self.module, "statements": self.statements, "unreached": list(self.unreached)}


def reach(seeder: Seeder, areas: Sequence[str]) -> list[ModuleReach]:
    """Measure the cases of a seeder, as far as they are not known; return the modules of the areas that have
    statements, those with the most unreached ones first.

    Raises:
        CannotRunError: An area is no package or module of the product.

    """
    modules = [name for package in packages_of(areas) for name in modules_of_package(package, areas)]
    passed = seeder.come_to(modules)
    found = [one for name in modules if (one := _reach_of(name, passed)) is not None]
    return sorted(found, key=lambda one: (-len(one.unreached), one.module))


def _reach_of(module: str, passed: Mapping[str, int]) -> ModuleReach | None:
    known = marked(module)
    if known is None:
        return None
    left_out = [
        known.classes[path]
        for name in live_code()
        if (path := name.partition(":")[2]) and name.partition(":")[0] == module
    ]
    lines = {
        line: mark for line, mark in known.by_line.items() if not any(line in where for where in left_out)
    }
    if not lines:
        return None
    unreached = sorted(line for line, mark in lines.items() if not passed[module] >> mark & 1)
    return ModuleReach(module, len(lines), tuple(unreached))


def line_ranges(reach_of: ModuleReach) -> str:
    """Return the unreached lines, joined where no reached statement is between them: `12, 40-46`."""
    known = marked(reach_of.module)
    order = sorted(known.by_line) if known is not None else []
    place = {line: at for at, line in enumerate(order)}
    return ", ".join(
        f"{first}" if first == last else f"{first}-{last}" for first, last in _runs(reach_of.unreached, place)
    )


def _runs(lines: Sequence[int], place: Mapping[int, int]) -> Iterator[tuple[int, int]]:
    first = last = None
    for line in lines:
        if last is not None and place[line] == place[last] + 1:
            last = line
            continue
        if first is not None and last is not None:
            yield first, last
        first = last = line
    if first is not None and last is not None:
        yield first, last
