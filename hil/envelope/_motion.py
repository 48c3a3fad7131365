"""What moves in an envelope: test code that can be found again by name, so that a branch travels to another
process, and a replay token repeats it.
"""

from __future__ import annotations

import importlib.util
import inspect
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Final

from fieldbus.errors import UnknownNameError
from hil.envelope._actions import first_axis
from hil.errors import CannotRunError

if TYPE_CHECKING:
    from hil.bench.bench import Bench

Body = Callable[["Bench"], object]
"""Test code: it gets the bench, and may wait on it."""
Reference = dict[str, str | float]
"""How test code is found again; empty: it cannot be."""
_SETTLED_S: Final = 0.05


@dataclass(frozen=True)
class Motion:
    """A motion with what goes before it.

    Args:
        name: In results.
        body: It is copied at the cycles of this.
        before: Brings the bench to the start of it; None: nothing.
        reference: How both are found again.

    """

    name: str
    body: Body
    before: Body | None
    reference: Reference


def motion_of(body: Body, before: Body | None = None, name: str = "") -> Motion:
    """Return functions as a motion. They are found again if they stand at the top level of one file."""
    called = getattr(body, "__name__", "motion")
    file = _file_of(body)
    reference: Reference = {}
    if file and (before is None or _file_of(before) == file):
        reference = {"file": file, "motion": called}
        if before is not None:
            reference["before"] = str(getattr(before, "__name__", ""))
    return Motion(name or called, body, before, reference)


def _file_of(function: Body) -> str:
    name, qualified = getattr(function, "__name__", ""), getattr(function, "__qualname__", "")
    if not name or name != qualified or name == "<lambda>":
        return ""
    try:
        path = Path(inspect.getsourcefile(function) or "")
    except TypeError:
        return ""
    if not path.is_file():
        return ""
    here = Path.cwd()
    return str(path.relative_to(here)) if path.is_relative_to(here) else str(path)


def own_motion(reference: str) -> Motion:
    """Return the motion in a file, `FILE.py` or `FILE.py:NAME`, with its function `before` if it has one.

    Raises:
        CannotRunError: There is no such file, or it cannot be imported.
        UnknownNameError: It has no such function.

    """
    path, _, name = reference.partition(":")
    module = _imported(path)
    before = "before" if callable(getattr(module, "before", None)) else ""
    return _of_module(module, path, name or "motion", before)


def move_absolute(axis: str, to: float, velocity: float) -> Motion:
    """Return the motion of most: enable, set to zero; then `MC_MoveAbsolute`.

    Args:
        axis: Name; empty: the first one of the bench.
        to: Position, unit of the axis.
        velocity: Unit of the axis per second.

    """

    def before(bench: Bench) -> None:
        name = axis or first_axis(bench)
        if bench.config.axis[name].controller == "nc":
            nc = bench.axis(name, controller="nc")
            bench.wait_until(nc.power().status, 5.0, f"{name} is enabled")
            nc.set_position(0.0)
            bench.run_for(_SETTLED_S)
            return
        handle = bench.axis(name)
        bench.wait_until(handle.power().status, 5.0, f"{name} is enabled")
        bench.wait_until(handle.home(0.0, mode=0).done, 1.0, f"{name} is homed")

    def move(bench: Bench) -> None:
        name = axis or first_axis(bench)
        if bench.config.axis[name].controller == "nc":
            done = bench.axis(name, controller="nc").move_absolute(to, Velocity=velocity).done
        else:
            done = bench.axis(name).move_absolute(to, Velocity=velocity).done
        bench.wait_until(done, 60.0, f"{name} is at {to:g}")

    return Motion(
        f"MC_MoveAbsolute to {to:g} at {velocity:g}/s",
        move,
        before,
        {"axis": axis, "to": to, "velocity": velocity},
    )


def motion_from(reference: Mapping[str, str | float]) -> Motion:
    """Return the motion that a reference names.

    Raises:
        CannotRunError: It names none, or its file cannot be imported.
        UnknownNameError: Its file has no such function.

    """
    if "file" in reference:
        path = str(reference["file"])
        return _of_module(
            _imported(path), path, str(reference.get("motion", "")), str(reference.get("before", ""))
        )
    try:
        return move_absolute(str(reference["axis"]), float(reference["to"]), float(reference["velocity"]))
    except (KeyError, ValueError) as error:
        raise CannotRunError(f"{dict(reference)!r} names no motion") from error


def _imported(path: str) -> ModuleType:
    file = Path(path)
    spec = importlib.util.spec_from_file_location(f"hil_envelope_{file.stem}", file)
    if spec is None or spec.loader is None or not file.is_file():
        raise CannotRunError(f"{path}: no Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise CannotRunError(f"{path} cannot be imported: {type(error).__name__}: {error}") from error
    return module


def _of_module(module: ModuleType, path: str, name: str, before: str) -> Motion:
    found: list[Body] = []
    for wanted in (name, before):
        function = getattr(module, wanted, None) if wanted else None
        if wanted and not callable(function):
            functions = [
                one for one, value in vars(module).items() if callable(value) and not one.startswith("_")
            ]
            raise UnknownNameError(path, wanted, "a function", functions)
        if callable(function):
            found.append(function)
    reference: Reference = {"file": path, "motion": name}
    if before:
        reference["before"] = before
    return Motion(f"{Path(path).name}:{name}", found[0], found[1] if before else None, reference)
