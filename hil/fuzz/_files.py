"""Programs in files: JSON with a step in every line, under a name that the content decides."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

from fieldbus.errors import ConfigurationError
from hil.errors import CannotRunError
from hil.fuzz._program import Program


def file_name(program: Program) -> str:
    """Return the name of the file of a program; the same program has the same, so nothing is kept twice."""
    return f"{program.name.rpartition('/')[2]}.json"


def read_json(file: Path) -> object:
    """Return the content of a file.

    Raises:
        CannotRunError: It cannot be read; the message says which, and why.

    """
    try:
        content: object = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, json.JSONDecodeError) as error:
        raise CannotRunError(f"{file} cannot be read as a program: {error}") from error
    return content


def program_in(file: Path, content: object) -> Program:
    """Return the program that was read from a file.

    Raises:
        CannotRunError: It is none; the message says in which file, and what is wrong in it.

    """
    try:
        return Program.from_json(content)
    except ConfigurationError as error:
        raise CannotRunError(f"{file} is no program: {error}") from error


def program_text(program: Program, indent: str = "") -> str:
    """Return a program as JSON, a line per step."""
    lines = ",\n".join(f"{indent} {json.dumps(step)}" for step in program.to_json())
    return f"[\n{lines}\n{indent}]"


def write_files(folder: Path, files: Mapping[str, str]) -> None:
    """Write texts to files of a folder, which is made when it is not there. A reader never sees half of one.

    Raises:
        CannotRunError: Nothing can be written there.

    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in files.items():
            partial = folder / f".{name}.part"
            partial.write_text(text, encoding="utf-8")
            partial.replace(folder / name)
    except OSError as error:
        raise CannotRunError(f"the program cannot be kept in {folder}: {error}") from error
