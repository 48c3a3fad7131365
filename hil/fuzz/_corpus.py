"""The programs of earlier searches that reached something new, as files that a search begins with."""

from __future__ import annotations

from pathlib import Path

from hil.errors import CannotRunError
from hil.fuzz._files import file_name, program_in, program_text, read_json, write_files
from hil.fuzz._program import Program


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
        self.programs = tuple(program_in(file, read_json(file)) for file in sorted(folder.glob("*.json")))
        """What was there, in the order of the file names."""

    def keep(self, program: Program) -> None:
        """Write a program down, unless it is there."""
        name = file_name(program)
        if not (self._folder / name).exists():
            write_files(self._folder, {name: f"{program_text(program)}\n"})
