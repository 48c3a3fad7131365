"""Compile the modules of the cyclic path with mypyc into a package of extension modules.

    python compile_core.py FOLDER [--optimise N] [--jobs N] [--work FOLDER]

`FOLDER/motion_hil_core` gets what `fieldbus.core_build` looks for. `./run compile` calls this for .venv, and
the build of a wheel with `HIL_COMPILE=1` does (`hatch_build.py`). The sources stay ordinary Python, which
always runs as it is; `core.toml` says what is compiled. Needs mypy, setuptools and a C compiler. C files and
object files are kept in the working folder, so that a change within functions compiles a few of them again.
`CC=tcc` in the environment takes seconds in place of minutes: what it makes gives the same results, but is a
third as fast as what gcc makes.
"""

from __future__ import annotations

import argparse
import ast
import hashlib
import json
import os
import shlex
import shutil
import subprocess
import sys
import sysconfig
import time
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, Final, NamedTuple

ROOT = Path(__file__).resolve().parent
PACKAGE = "motion_hil_core"
PACKAGES = ("fieldbus", "emulators", "motion")
"""Packages whose classes make a closed group with those that are compiled."""


_WORDS_OF_C = frozenset(
    f"__{word}"
    for word in (
        "alignof", "asm", "attribute", "complex", "const", "imag", "inline", "label", "real", "restrict",
        "signed", "thread", "typeof", "volatile",
    )
)  # fmt: skip


class CoreError(Exception):
    """What `core.toml` says cannot be compiled; the message says why."""


# ---------------------------------------------------------------------------------------- what is compiled


def settings() -> dict[str, Any]:
    """Return the content of `core.toml`."""
    return tomllib.loads((ROOT / "core.toml").read_text(encoding="utf-8"))


class Classes:
    """Who inherits from whom in the product, by module, and what they name; read from the sources, nothing is
    imported.
    """

    def __init__(self) -> None:
        self.files = {
            _module_of(path): path for name in PACKAGES for path in sorted((ROOT / name).rglob("*.py"))
        }
        self._trees = trees = {
            name: ast.parse(path.read_text(encoding="utf-8")) for name, path in self.files.items()
        }
        self._classes = {
            name: {node.name: node for node in tree.body if isinstance(node, ast.ClassDef)}
            for name, tree in trees.items()
        }
        self._imports = {name: dict(_imports(tree)) for name, tree in trees.items()}
        self.bases: dict[str, dict[str, str]] = {name: {} for name in self.files}
        """Module -> module of a base -> `Class(Base)`, the first of each."""
        self.heirs: dict[str, dict[str, str]] = {name: {} for name in self.files}
        """Module -> module of an heir -> `Class(Base)`."""
        for name, classes in self._classes.items():
            for one in classes.values():
                self._note(name, one)

    def words_of_c(self, name: str) -> list[str]:
        """Return the attributes that a module uses and that, with the underscore which mypyc puts in front of
        them, are words of C.
        """
        path = self.files[name].relative_to(ROOT).as_posix()
        return [
            f"{path}:{node.lineno}: {node.attr}"
            for node in ast.walk(self._trees[name])
            if isinstance(node, ast.Attribute) and f"_{node.attr}" in _WORDS_OF_C
        ]

    def _note(self, name: str, node: ast.ClassDef) -> None:
        for base in node.bases:
            plain = base.value if isinstance(base, ast.Subscript) else base
            if not isinstance(plain, ast.Name):
                continue
            home = self._home(name, plain.id)
            if home is not None and home != name:
                self.bases[name].setdefault(home, f"{node.name}({plain.id})")
                self.heirs[home].setdefault(name, f"{node.name}({plain.id})")

    def _home(self, module: str, name: str) -> str | None:
        """Return the module that defines a class which `module` knows by a name."""
        for _ in range(9):  # through packages that export it again
            if name in self._classes.get(module, {}):
                return module
            if name not in self._imports.get(module, {}):
                return None
            module, name = self._imports[module][name]
        return None


def _module_of(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


def _imports(tree: ast.Module) -> Iterator[tuple[str, tuple[str, str]]]:
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module:
            for one in node.names:
                yield one.asname or one.name, (node.module, one.name)


def compiled_modules() -> list[str]:
    """Return the names of the modules that are compiled.

    They are those of `core.toml`, and all whose classes inherit from theirs or the other way round, because a
    compiled class and an ordinary one do not fit into one family.

    Raises:
        CoreError: A module does not exist, is said to be ordinary as well, has an heir that has to stay
            ordinary, or an attribute that is a word of C.

    """
    content = settings()
    ordinary: Mapping[str, str] = content["ordinary"]
    classes = Classes()
    outside = [name for name in content["modules"] if name.split(".")[0] not in PACKAGES]
    for name in (*content["modules"], *ordinary):
        if name not in classes.files and not (ROOT / _file_of(name)).is_file():
            raise CoreError(f"core.toml: there is no module {name}")
    found: set[str] = set(content["modules"]) - set(outside)
    both = sorted(found & set(ordinary))
    if both:
        raise CoreError(f"core.toml: {', '.join(both)}: both compiled and ordinary")
    waiting = sorted(found)
    while waiting:
        name = waiting.pop()
        for other in (*classes.bases[name], *classes.heirs[name]):
            if other not in found and other not in ordinary:
                found.add(other)
                waiting.append(other)
    for name in sorted(found):
        for heir, how in classes.heirs[name].items():
            if heir not in found:
                raise CoreError(f"core.toml: {heir} is ordinary, and its {how} inherits from compiled {name}")
    words = [one for name in sorted(found) for one in classes.words_of_c(name)]
    if words:
        raise CoreError(f"words of C, with the underscore that mypyc adds: {', '.join(words)}")
    return sorted([*found, *outside])


def _file_of(name: str) -> str:
    return name.replace(".", "/") + ".py"


# -------------------------------------------------------------------------------------------- compiling


def compile_core(
    target: Path, work: Path, *, optimise: str, jobs: int, shipped: bool = False, symbols: bool = False
) -> list[str]:
    """Compile, put the package into `target`, and return the names of the modules.

    Args:
        target: Gets the folder `motion_hil_core`.
        work: For C files and object files.
        optimise: Level of the C compiler, 0..3.
        jobs: C files that are compiled at the same time.
        shipped: The sources come with it and do not change, as in a wheel: they are not compared.
        symbols: Functions keep their names, for a profiler.

    Raises:
        CoreError: It is not possible.

    """
    modules = compiled_modules()
    before = _sources()
    extensions = _generated(modules, [digest for _, digest in before.values()], work)
    folder = work / PACKAGE  # in place of the present one when it is whole
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    (folder / "__init__.py").write_text('"""The compiled core of motion-hil."""\n', encoding="utf-8")
    build = _Build(folder, work, optimise, jobs, symbols=symbols)
    for extension in extensions:
        build.extension(extension)
    build.prune()
    manifest = {
        "modules": [one.name for one in extensions],
        "sources": {} if shipped else before,
        "python": _suffix(),
    }
    (folder / "manifest.json").write_text(json.dumps(manifest, indent=1), encoding="utf-8")
    shutil.rmtree(target / PACKAGE, ignore_errors=True)
    shutil.copytree(folder, target / PACKAGE)
    return modules


_NOT_OURS = frozenset(("-Werror", "-O0", "-O1", "-O2", "-O3"))


class _Extension(NamedTuple):
    """An extension module that mypyc has written, or a library that several share."""

    name: str
    sources: list[str]
    flags: list[str]
    include: list[str]
    """Folders of headers: those of mypyc itself relative to it."""


def _generated(modules: Sequence[str], digests: Sequence[str], work: Path) -> list[_Extension]:
    """Return what mypyc makes of the modules; of sources that have not changed it makes nothing again.

    Raises:
        CoreError: mypy or setuptools is missing.

    """
    try:
        from mypy.version import __version__ as version
        from mypyc.build import include_dir, mypycify
    except ImportError as error:
        raise CoreError(f"mypy and setuptools are needed: {error}") from None
    key = hashlib.sha256(json.dumps([version, _suffix(), str(work), modules, digests]).encode()).hexdigest()
    stamp = work / "generated.json"
    if stamp.exists():
        known = json.loads(stamp.read_text(encoding="utf-8"))
        if known["key"] == key:
            return [_Extension(*one) for one in known["extensions"]]
        stamp.unlink()
    work.mkdir(parents=True, exist_ok=True)
    os.chdir(ROOT)  # names of modules come from paths
    made = mypycify(
        ["--config-file", str(ROOT / "pyproject.toml"), "--follow-imports=silent", *map(_file_of, modules)],
        debug_level="0",
        multi_file=True,
        target_dir=str(work),
        group_name=PACKAGE,
    )
    own = include_dir()
    extensions = [
        _Extension(
            one.name,
            list(one.sources),
            # What a compiler warns of in generated code helps nobody.
            [flag for flag in one.extra_compile_args if flag.startswith("-") and flag not in _NOT_OURS],
            [os.path.relpath(path, own) if path.startswith(own) else path for path in one.include_dirs],
        )
        for one in made
    ]
    stamp.write_text(json.dumps({"key": key, "extensions": extensions}), encoding="utf-8")
    return extensions


def _suffix() -> str:
    return str(sysconfig.get_config_var("EXT_SUFFIX"))


def _sources() -> dict[str, tuple[int, str]]:
    """Return time and digest of every source that a compiled module may have taken a constant from."""
    paths = [path for name in PACKAGES for path in sorted((ROOT / name).rglob("*.py"))]
    paths += [ROOT / _file_of(name) for name in settings()["modules"] if name.split(".")[0] not in PACKAGES]
    return {
        path.relative_to(ROOT).as_posix(): (
            path.stat().st_mtime_ns,
            hashlib.sha256(path.read_bytes()).hexdigest(),
        )
        for path in paths
    }


_BUILDS_KEPT: Final = 3
"""Builds whose object files stay: two compilers, and the state before a change."""


class _Build:
    """Compiles and links; an object file that was made from the same text is taken again."""

    def __init__(self, folder: Path, work: Path, optimise: str, jobs: int, *, symbols: bool) -> None:
        from mypyc.build import include_dir

        self._folder = folder
        self._objects = work / "objects"
        self._objects.mkdir(exist_ok=True)
        self._used: set[Path] = set()
        self._compiler = shlex.split(os.environ.get("CC") or str(sysconfig.get_config_var("CC") or "cc"))
        self._optimise = [f"-O{optimise}"]
        only_macros = "tcc" in Path(self._compiler[0]).name  # it knows no other flags
        self._optimise += [flag for flag in settings()["flags"] if flag.startswith("-D") or not only_macros]
        self._headers_of_mypyc = include_dir()
        self._headers = hashlib.sha256(
            b"".join(path.read_bytes() for path in sorted(work.glob("*.h")))
        ).hexdigest()
        self._jobs = jobs
        self._strip = () if symbols else ("-s",)

    def extension(self, extension: _Extension) -> None:
        """Make one extension module."""
        include = [str(Path(self._headers_of_mypyc, path)) for path in extension.include]
        flags = [
            *self._optimise,
            *extension.flags,
            *(f"-I{path}" for path in (sysconfig.get_paths()["include"], *include)),
        ]
        with ThreadPoolExecutor(self._jobs) as pool:
            objects = list(pool.map(lambda source: self._object(source, flags), extension.sources))
        file = self._folder / f"{extension.name.replace('.', '/')}{_suffix()}"
        file.parent.mkdir(parents=True, exist_ok=True)
        self._run([*self._compiler, "-shared", *self._strip, "-o", str(file), *objects])

    def _object(self, source: str, flags: Sequence[str]) -> str:
        text = Path(source).read_bytes()
        made_with = " ".join([*self._compiler, *(flag for flag in flags if not flag.startswith("-I"))])
        key = hashlib.sha256(text + f"{self._headers} {_suffix()} {made_with}".encode()).hexdigest()[:24]
        file = self._objects / f"{key}.o"
        self._used.add(file)
        if file.exists():
            file.touch()
        else:
            partial = file.with_suffix(".part")
            self._run([*self._compiler, "-fPIC", "-c", *flags, "-o", str(partial), source])
            partial.rename(file)
        return str(file)

    def prune(self) -> None:
        """Remove object files that neither this build nor the last ones before it needed."""
        kept = sorted(self._objects.glob("*.o"), key=lambda file: file.stat().st_mtime_ns, reverse=True)
        for file in kept[_BUILDS_KEPT * len(self._used) :]:
            file.unlink()

    @staticmethod
    def _run(command: list[str]) -> None:
        done = subprocess.run(command, check=False, capture_output=True, text=True)
        if done.returncode:
            raise CoreError(f"{' '.join(command)}\n{done.stdout}{done.stderr}")


def main() -> int:
    """Run the command line and return the exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--optimise", default=settings()["optimise"], help="level of the C compiler, 0..3")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="C files at the same time")
    parser.add_argument("--symbols", action="store_true", help="keep the names of functions, for a profiler")
    parser.add_argument("--work", type=Path, default=ROOT / ".cache" / "core", help="folder for C files")
    arguments = parser.parse_args()
    started = time.monotonic()
    try:
        modules = compile_core(
            arguments.folder.resolve(),
            arguments.work.resolve(),
            optimise=str(arguments.optimise),
            jobs=arguments.jobs,
            symbols=arguments.symbols,
        )
    except CoreError as error:
        print(f"compile_core: {error}", file=sys.stderr)
        return 1
    used = os.times()
    print(
        f"compiled {len(modules)} modules in {time.monotonic() - started:.0f} s, "
        f"{used.user + used.children_user:.0f} s of processor time"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
