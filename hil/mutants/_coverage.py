"""What cases come to without any defect, kept from run to run: a case is measured again only when something
that it comes to has changed.
"""

from __future__ import annotations

import ast
import base64
import hashlib
import importlib
import inspect
import json
import sys
import zlib
from collections.abc import Iterable, Mapping
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, Final

from hil.campaign import load_bench_file
from hil.errors import CannotRunError
from hil.mutants._marks import Place, product_modules, source_digest
from hil.mutants._mutant import PACKAGES
from hil.mutants._plan import Judge

PRODUCT: Final = "product"


def scope_of(modules: Iterable[str]) -> frozenset[str]:
    """Return what has to be marked for defects in modules: the whole product, or modules of others."""
    return frozenset(PRODUCT if name.partition(".")[0] in PACKAGES else name for name in modules)


def modules_in(scope: AbstractSet[str]) -> list[str]:
    """Return the modules of a scope."""
    return sorted({*(scope - {PRODUCT}), *(product_modules() if PRODUCT in scope else ())})


@dataclass(frozen=True)
class Covered:
    """A case without any defect."""

    verdict: str
    seconds: float
    marks: Mapping[str, bytes]
    """Marks that it passes, by module, eight to a byte; modules that it does not come to are left out."""
    trace: str = ""
    """Digest of its trace; empty: it has none."""

    def comes_to(self, places: Iterable[Place]) -> bool:
        """Return whether it comes to one of these places."""
        return any(
            bits[place.mark >> 3] & (1 << (place.mark & 7))
            for place in places
            if (bits := self.marks.get(place.module)) is not None
        )


class MarkNumbers:
    """Marks of all modules as bits of one number."""

    def __init__(self) -> None:
        self._places: dict[str, tuple[int, int]] = {}
        self._size = 0

    def _place(self, module: str, size: int) -> tuple[int, int]:
        """Return where the marks of a module begin, byte, and how many bytes they are."""
        place = self._places.get(module)
        if place is None:
            place = self._places[module] = self._size, size
            self._size += size
        return place

    def of(self, covered: Covered) -> int:
        """Return the marks that a case passes."""
        parts = [(self._place(name, len(bits))[0], bits) for name, bits in covered.marks.items()]
        whole = bytearray(self._size)
        for first, bits in parts:
            whole[first : first + len(bits)] = bits
        return int.from_bytes(whole, "little")

    def part(self, module: str, passed: int) -> int:
        """Return the marks of one module out of those of all."""
        first, size = self._places.get(module, (0, 0))
        return passed >> 8 * first & (1 << 8 * size) - 1

    def modules(self, names: Iterable[str]) -> int:
        """Return all marks of modules; of one that no case comes to there are none."""
        found = 0
        for name in names:
            first, size = self._places.get(name, (0, 0))
            found |= ((1 << 8 * size) - 1) << 8 * first
        return found


@dataclass
class Coverage:
    """What is known of cases, and the file that keeps it.

    A record counts as long as the sources of the campaign, the bench, and all modules of the product that the
    case came to are the same.
    """

    file: Path | None = None
    """None: nothing is kept."""
    _known: dict[str, dict[str, Any]] = field(default_factory=dict)

    @classmethod
    def of(cls, file: Path | None) -> Coverage:
        """Read what a file keeps; one that does not exist keeps nothing.

        Raises:
            CannotRunError: It is something else.

        """
        known: dict[str, dict[str, Any]] = {}
        try:
            text = file.read_text(encoding="utf-8") if file is not None and file.exists() else ""
            # The last line of a run that was killed may have no end.
            for record in map(json.loads, text.split("\n")[:-1]):
                known[record["case"]] = record
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise CannotRunError(f"{file} keeps no coverage of cases: {error}; delete it") from error
        return cls(file, known)

    def get(self, judge: Judge, seed: int, scope: AbstractSet[str]) -> Covered | None:
        """Return what is known of a case; None: nothing that still counts, or not all of the scope."""
        record = self._known.get(_key(judge, seed))
        if record is None or record["sources"] != _sources(judge) or not scope <= set(record["scope"]):
            return None
        modules = json.loads(zlib.decompress(base64.b64decode(record["modules"])))
        if any(source_digest(name) != digest for name, (digest, _) in modules.items()):
            return None
        marks = {name: bytes.fromhex(bits) for name, (_, bits) in modules.items()}
        return Covered(record["verdict"], record["seconds"], marks, record.get("trace", ""))

    def keep(self, judge: Judge, seed: int, scope: AbstractSet[str], found: Covered) -> None:
        """Keep what is known of a case."""
        if self.file is None:
            return
        modules = {name: (source_digest(name), bits.hex()) for name, bits in found.marks.items()}
        key = _key(judge, seed)
        record = {
            "case": key,
            "sources": _sources(judge),
            "scope": sorted(scope),
            "verdict": found.verdict,
            "seconds": round(found.seconds, 3),
            "trace": found.trace,
            "modules": base64.b64encode(zlib.compress(json.dumps(modules).encode())).decode(),
        }
        self._known[key] = record
        self.file.parent.mkdir(parents=True, exist_ok=True)
        with self.file.open("a", encoding="utf-8") as file:
            file.write(json.dumps(record) + "\n")


def _key(judge: Judge, seed: int) -> str:
    return f"{judge.campaign} {judge.name} {seed}"


def _sources(judge: Judge) -> str:
    """Return a digest of the campaign and of the bench of a case."""
    return _campaign_digest(judge.campaign) + _bench_digest(judge.bench)


@cache
def _bench_digest(bench: str) -> str:
    return hashlib.sha256(load_bench_file(bench or None).text.encode()).hexdigest()[:8]


def _campaign_digest(reference: str) -> str:
    """Return a digest of a campaign: of its file, or of its module and of what that imports from its
    package.
    """
    where, _, file = reference.rpartition(":")
    for one in (reference, where, file):
        if one.endswith((".py", ".toml")) and Path(one).is_file():
            return hashlib.sha256(Path(one).read_bytes()).hexdigest()[:12]
    return _package_digest(reference)


@cache
def _package_digest(reference: str) -> str:
    where, _, name = reference.rpartition(":")
    texts: list[str] = []
    if name.endswith(".toml"):
        (folder,) = importlib.import_module(where).__path__
        texts.append((Path(folder) / name).read_text(encoding="utf-8"))
        modules = sorted(one for one in sys.modules if one.startswith(f"{where}."))
    else:
        modules = sorted(_imported(where, set()))
    texts += [inspect.getsource(importlib.import_module(module)) for module in modules]
    return hashlib.sha256("\0".join(texts).encode()).hexdigest()[:12]


def _imported(module: str, found: set[str]) -> set[str]:
    """Return a module and those that it imports from its top package, at whatever depth."""
    found.add(module)
    package = module.partition(".")[0]
    for node in ast.walk(ast.parse(inspect.getsource(importlib.import_module(module)))):
        names = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        for name in names:
            if name.partition(".")[0] == package and name in sys.modules and name not in found:
                _imported(name, found)
    return found
