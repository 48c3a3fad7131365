"""Programs that a search has once found, kept as the cases of a campaign."""

from __future__ import annotations

import functools
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from fieldbus.errors import ConfigurationError
from hil.campaign import Campaign, Case
from hil.errors import CannotRunError
from hil.fuzz._program import Program
from hil.fuzz._run import check_program

if TYPE_CHECKING:
    from hil.campaign import Token

MODULE: Final = "regressions.py"
"""The campaign in a folder of kept programs."""
_CAMPAIGN: Final = '''"""Programs that a search has once found something with; `hil keep` puts further ones beside this file."""

from pathlib import Path

from hil.fuzz import regressions

CAMPAIGN = regressions(Path(__file__).parent)
'''
_KEYS: Final = {"title": str, "bench": str, "seed": int, "program": list}


def regressions(folder: Path, title: str = "regressions") -> Campaign:
    """Return a campaign with a case for each kept program of a folder.

    Each case runs its program with the seed that it was found with, and all invariants of a search have to hold.

    Args:
        folder: Where `hil keep` has put them, as files with the ending `.json`.
        title: Of the campaign.

    Raises:
        CannotRunError: A file is no kept program; the message says which, and what is wrong in it.

    """
    campaign = Campaign(title, tags=["regression"])
    for file in sorted(folder.glob("*.json")):
        content, program = _read(file)
        campaign.add(
            Case(
                identifier=f"{title}/{file.stem}",
                title=content["title"],
                group=title,
                function=functools.partial(check_program, program=program),
                tags=campaign.tags,
                bench=content["bench"],
                seed=content["seed"],
            )
        )
    return campaign


def _read(file: Path) -> tuple[dict[str, Any], Program]:
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, json.JSONDecodeError) as error:
        raise CannotRunError(f"{file} cannot be read: {error}") from error
    wanted = ", ".join(_KEYS)
    if not isinstance(content, dict) or set(content) != set(_KEYS):
        raise CannotRunError(f"{file} is no kept program: it has to be an object with {wanted}")
    for key, kind in _KEYS.items():
        if not isinstance(content[key], kind) or isinstance(content[key], bool):
            raise CannotRunError(f"{file}: {key} is {content[key]!r}, but has to be of type {kind.__name__}")
    try:
        return content, Program.from_json(content["program"])
    except ConfigurationError as error:
        raise CannotRunError(f"{file}: {error}") from error


def keep_program(token: Token, folder: Path, title: str) -> Path:
    """Write the program of a token into a folder, with the campaign that runs it, and return its file.

    Args:
        token: Of a program.
        folder: Where to; it is made when it is not there.
        title: What the program has found.

    Raises:
        CannotRunError: The token is that of a case, which is in a campaign already; or nothing can be written there.

    """
    if token.program is None:
        raise CannotRunError(
            f"the token is that of case {token.case!r} of {token.campaign}, which is kept there"
        )
    program = Program.from_json(token.program)
    name = f"{program.name.rpartition('/')[2]}.json"
    lines = ",\n".join(f"  {json.dumps(step)}" for step in program.to_json())
    head = "".join(
        f" {json.dumps(key)}: {json.dumps(value)},\n"
        for key, value in (("title", title), ("bench", token.bench), ("seed", token.seed))
    )
    file = folder / name
    try:
        folder.mkdir(parents=True, exist_ok=True)
        file.write_text(f'{{\n{head} "program": [\n{lines}\n ]\n}}\n', encoding="utf-8")
        if not (folder / MODULE).exists():
            (folder / MODULE).write_text(_CAMPAIGN, encoding="utf-8")
    except OSError as error:
        raise CannotRunError(f"the program cannot be kept in {folder}: {error}") from error
    return file
