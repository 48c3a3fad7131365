"""The programs of earlier searches that reached something new, as files that a search begins with."""

from __future__ import annotations

import json
from pathlib import Path

from fieldbus.errors import ConfigurationError
from hil.errors import CannotRunError
from hil.fuzz._program import Program


def read_program(file: Path) -> Program:
    """Read a program from a file with its steps as JSON.

    Raises:
        CannotRunError: The file cannot be read or holds no program; the message says which, and what is wrong in it.

    """
    try:
        return Program.from_json(json.loads(file.read_text(encoding="utf-8")))
    except (OSError, UnicodeDecodeError, json.JSONDecodeError) as error:
        raise CannotRunError(f"{file} cannot be read as a program: {error}") from error
    except ConfigurationError as error:
        raise CannotRunError(f"{file} is no program: {error}") from error


def write_program(program: Program, file: Path) -> None:
    """Write a program to a file, a line per step. A reader never sees half of it."""
    lines = ",\n".join(f" {json.dumps(step)}" for step in program.to_json())
    partial = file.with_name(f".{file.name}.part")
    partial.write_text(f"[\n{lines}\n]\n", encoding="utf-8")
    partial.replace(file)


def file_name(program: Program) -> str:
    """Return the name of the file of a program: its content decides, so nothing is kept twice."""
    return f"{program.name.rpartition('/')[2]}.json"


class Corpus:
    """A folder with a file for each program.

    Args:
        folder: The folder; it is made when the first program is kept.

    Raises:
        CannotRunError: The folder is a file, or a file in it is no program.

    """

    def __init__(self, folder: Path) -> None:
        if folder.exists() and not folder.is_dir():
            raise CannotRunError(f"{folder} is no folder")
        self._folder = folder
        self.programs = tuple(read_program(file) for file in sorted(folder.glob("*.json")))
        """What was there, in the order of the file names."""

    def keep(self, program: Program) -> None:
        """Write a program down, unless it is there."""
        file = self._folder / file_name(program)
        if file.exists():
            return
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            write_program(program, file)
        except OSError as error:
            raise CannotRunError(f"the program cannot be kept in {self._folder}: {error}") from error
