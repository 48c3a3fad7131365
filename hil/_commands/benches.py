"""`hil benches`: the benches that ship with the product, and what is in them."""

from __future__ import annotations

from collections.abc import Sequence

from fieldbus.errors import UnknownNameError
from hil._commands.terminal import print_json
from hil.bench import EMBEDDED
from hil.bench.bench_file import parse, read
from hil.bench.makes import NC_BENCH
from hil.campaign import load_bench_file
from hil.configurations import CONFIGURATION, Configuration
from hil.errors import CannotRunError


def show_benches(words: Sequence[str], *, as_json: bool) -> int:
    """List the benches, or print one; returns the exit code.

    Args:
        words: `list` or nothing, or `show` and a name, the reference of a configuration, or a bench that is
            to have axes of an NC.
        as_json: As JSON: names and titles, or the content.

    Raises:
        CannotRunError: The words are others.
        UnknownNameError: There is no such bench.

    """
    match list(words):
        case [] | ["list"]:
            rows = [(name, parse(read(name)[1], name).bench.name) for name in EMBEDDED]
            if as_json:
                print_json([{"name": name, "title": title} for name, title in rows])
            else:
                for name, title in rows:
                    print(f"{name:16} {title}")  # noqa: T201 - the answer
        case ["show", name]:
            text = _text(name)
            if as_json:
                print_json({"name": name, "text": text})
            else:
                print(text, end="")  # noqa: T201 - the answer
        case _:
            raise CannotRunError(f"hil benches {' '.join(words)!r} is not allowed; allowed: list, show NAME")
    return 0


def _text(name: str) -> str:
    if name.startswith(NC_BENCH):
        return load_bench_file(name).text
    if name in EMBEDDED:
        return read(name)[1]
    if name.startswith(CONFIGURATION):
        return Configuration.of(name).text()
    raise UnknownNameError("hil benches show", name, "a bench of the product", EMBEDDED)
