"""Whether the core runs compiled or as ordinary Python, and where its compiled modules are.

The modules of the cyclic path can be compiled (`./run compile`). What is compiled lies in a package of its
own, `motion_hil_core`, never beside the sources: these stay what everybody reads, edits, measures and imports
where there is nothing else. An importer of this module takes the place of the ordinary one for the compiled
modules; `fieldbus`, `emulators`, `motion` and `hil` install it before anything of theirs is imported.

The environment variable `HIL_CORE` decides:

    HIL_CORE=auto       the default: compiled if there is a core that fits the sources, otherwise pure
    HIL_CORE=pure       ordinary Python. For whatever replaces methods or looks at code: the seeded defects of
                        `hil mutants` and coverage set it themselves
    HIL_CORE=compiled   compiled, or nothing is imported at all

A compiled core that was made from other sources is not used, because nobody would know what ran. Outside of
`compiled` the program goes on with ordinary Python and says so on standard error.
"""

from __future__ import annotations

import hashlib
import importlib.util
import json
import os
import sys
from collections.abc import Mapping, Sequence
from importlib.machinery import EXTENSION_SUFFIXES, ModuleSpec, PathFinder
from pathlib import Path
from types import ModuleType
from typing import Final

VARIABLE: Final = "HIL_CORE"
AUTO: Final = "auto"
PURE: Final = "pure"
COMPILED: Final = "compiled"
PACKAGE: Final = "motion_hil_core"
"""Import name of the compiled modules."""
MANIFEST: Final = "manifest.json"
"""In the package: `modules`, the names that are compiled; `sources`, path, time and digest of every file that
they were made from; `python`, the suffix of extension modules.
"""
_ROOT: Final = Path(__file__).resolve().parents[1]


class CoreFinder:
    """Finds the compiled modules; `sys.meta_path` has it in front of the ordinary finder.

    Args:
        folder: That of `motion_hil_core`.
        modules: Names of what is compiled.

    """

    def __init__(self, folder: Path, modules: Sequence[str]) -> None:
        suffix = EXTENSION_SUFFIXES[0]
        self._files = {name: str(folder / f"{name.replace('.', '/')}{suffix}") for name in modules}

    def find_spec(
        self,
        name: str,
        path: Sequence[str] | None = None,  # noqa: ARG002 - how importers are called
        target: ModuleType | None = None,  # noqa: ARG002 - the same
    ) -> ModuleSpec | None:
        """Return where a compiled module is; None for any other module."""
        file = self._files.get(name)
        return None if file is None else importlib.util.spec_from_file_location(name, file)


class _State:
    """What runs, and why."""

    kind = PURE
    reason = "no compiled core is installed"


def kind() -> str:
    """Return `compiled` or `pure`: what this process runs."""
    return _State.kind


def described() -> str:
    """Return what this process runs and why: `pure (no compiled core is installed)`."""
    return f"{_State.kind} ({_State.reason})"


def install() -> None:
    """Put the compiled core in place, as `HIL_CORE` says.

    Raises:
        ImportError: `HIL_CORE` has another value than its three, or is `compiled` and there is no compiled
            core that fits the sources.

    """
    wanted = os.environ.get(VARIABLE) or AUTO
    if wanted not in (AUTO, PURE, COMPILED):
        raise ImportError(f"environment variable {VARIABLE}: {wanted!r} is not one of auto, pure, compiled")
    if wanted == PURE:
        _State.reason = f"{VARIABLE}=pure"
        return
    found = PathFinder.find_spec(PACKAGE)
    if found is None or not found.submodule_search_locations:
        if wanted == COMPILED:
            raise ImportError(f"{VARIABLE}=compiled, and {_State.reason}; ./run compile makes one")
        return
    folder = Path(found.submodule_search_locations[0])
    manifest = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
    wrong = _wrong(manifest)
    if wrong:
        _State.reason = wrong
        if wanted == COMPILED:
            raise ImportError(f"{VARIABLE}=compiled, and {wrong}; ./run compile builds it again")
        print(f"motion-hil: running pure: {wrong}; ./run compile builds it again", file=sys.stderr)  # noqa: T201
        return
    sys.meta_path.insert(0, CoreFinder(folder, manifest["modules"]))
    _State.kind = COMPILED
    _State.reason = f"{len(manifest['modules'])} modules of {folder}"


def restart_pure() -> None:
    """Start this program again as ordinary Python if it runs compiled; for what replaces code."""
    if _State.kind == COMPILED:
        os.environ[VARIABLE] = PURE
        os.execv(sys.executable, sys.orig_argv)  # noqa: S606 - the same program


def _wrong(manifest: Mapping[str, object]) -> str:
    """Return why a compiled core cannot be used; empty: it can."""
    if manifest["python"] != EXTENSION_SUFFIXES[0]:
        return f"the compiled core is for {manifest['python']}, this Python takes {EXTENSION_SUFFIXES[0]}"
    sources = manifest["sources"]
    assert isinstance(sources, dict)
    for name, (time_ns, digest) in sources.items():
        file = _ROOT / name
        try:
            if file.stat().st_mtime_ns != time_ns and source_digest(file) != digest:
                return f"the compiled core was made from another {name}"
        except FileNotFoundError:
            return f"the compiled core was made with {name}, which is not there"
    return ""


def source_digest(file: Path) -> str:
    """Return the digest of a source by which a change is noticed."""
    return hashlib.sha256(file.read_bytes()).hexdigest()
