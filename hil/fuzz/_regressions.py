"""Programs that a search has once found, kept as the cases of a campaign."""

from __future__ import annotations

import functools
import json
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

from hil.campaign import Campaign, Case, load_bench_file
from hil.errors import CannotRunError
from hil.fuzz._files import file_name, program_in, program_text, read_json, write_files
from hil.fuzz._program import Program
from hil.fuzz._run import check_program

if TYPE_CHECKING:
    from hil.campaign import Token

MODULE: Final = "regressions.py"
"""The campaign in a folder of kept programs."""
CAMPAIGN_TEXT: Final = '''"""Programs that a search has once found something with; `hil keep` puts further ones next to this file."""

from pathlib import Path

from hil.fuzz import regressions

CAMPAIGN = regressions(Path(__file__).parent)
'''  # noqa: E501
_KEYS: Final = {"title": str, "bench": str, "seed": int, "program": list}


def regressions(folder: Path, title: str = "regressions", *, complete: bool = True) -> Campaign:
    """Return a campaign with a case for each kept program of a folder.

    Each case runs its program with the seed that it was found with, and all invariants of a search have to
    hold. The bench of a program that was found on a configuration of its own is a file next to it.

    Args:
        folder: Where `hil keep` has put them, as files with the ending `.json`.
        title: Of the campaign.
        complete: Whether a step that a bench cannot do blocks its case; otherwise it is left out.

    Raises:
        CannotRunError: A file is no kept program; the message says which, and what is wrong in it.

    """
    campaign = Campaign(title, tags=["regression"])
    for file in sorted(folder.glob("*.json")):
        kept = _read(file)
        path = folder / kept.bench
        campaign.add(
            Case(
                identifier=f"{title}/{file.stem}",
                title=kept.title,
                group=title,
                function=functools.partial(check_program, program=kept.program, complete=complete),
                tags=campaign.tags,
                bench=str(path) if path.is_file() else kept.bench,
                seed=kept.seed,
            )
        )
    return campaign


class _Kept(NamedTuple):
    """A program that was kept."""

    title: str
    bench: str
    seed: int
    program: Program


def _read(file: Path) -> _Kept:
    content = read_json(file)
    wanted = ", ".join(_KEYS)
    if not isinstance(content, dict) or set(content) != set(_KEYS):
        raise CannotRunError(f"{file} is no kept program: it has to be an object with {wanted}")
    for key, kind in _KEYS.items():
        if not isinstance(content[key], kind) or isinstance(content[key], bool):
            raise CannotRunError(f"{file}: {key} is {content[key]!r}, but has to be of type {kind.__name__}")
    program = program_in(file, content["program"])
    if program.configuration:
        raise CannotRunError(f"{file}: program has a configuration, but a kept one stands in a bench file")
    title, bench, seed = content["title"], content["bench"], content["seed"]
    assert isinstance(title, str)  # these three are checked above
    assert isinstance(bench, str)
    assert isinstance(seed, int)
    return _Kept(title, bench, seed, program)


def keep_program(token: Token, folder: Path, title: str) -> Path:
    """Write the program of a token into a folder, with the campaign that runs it, and return its file.

    A configuration of the program becomes a bench file next to it: what the program was found on stays,
    whatever becomes of the bench that it was made of.

    Args:
        token: Of a program.
        folder: Where to; it is made when it is not there.
        title: What the program has found.

    Raises:
        CannotRunError: The token is that of a case, which is in a campaign already; or nothing can be
            written there.
        ConfigurationError: The configuration of the program is refused for its bench.

    """
    if token.program is None:
        raise CannotRunError(
            f"the token is that of case {token.case!r} of {token.campaign}, which is kept there"
        )
    program = Program.from_json(token.program)
    name = file_name(program)
    files: dict[str, str] = {}
    bench = token.bench
    if program.configuration:
        bench = f"{Path(name).stem}.toml"
        files[bench] = program.configuration.applied_to(load_bench_file(token.bench or None)).text
        program = Program(program.steps)
    head = "".join(
        f" {json.dumps(key)}: {json.dumps(value)},\n"
        for key, value in (("title", title), ("bench", bench), ("seed", token.seed))
    )
    files[name] = f'{{\n{head} "program": {program_text(program, " ")}\n}}\n'
    if not (folder / MODULE).exists():
        files[MODULE] = CAMPAIGN_TEXT
    write_files(folder, files)
    return folder / name
