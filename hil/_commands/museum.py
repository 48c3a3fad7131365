"""`hil museum`: published defects of real products, and which shipped case catches each."""

from __future__ import annotations

from collections.abc import Sequence

from hil._commands.terminal import console, print_json, quiet_stdout
from hil.errors import CannotRunError
from hil.museum import FieldError, Judgement, field_error_page, judge_entry, load_museum, select_entries


def show_museum(words: Sequence[str], *, as_json: bool) -> int:
    """List the entries, show one, or run them; returns the exit code.

    Args:
        words: `list` or nothing, `show` and a name, or `run` and any number of names.
        as_json: As JSON on standard output.

    Raises:
        CannotRunError: The words are others.
        UnknownNameError: There is no such entry.

    """
    museum = load_museum()
    match list(words):
        case [] | ["list"]:
            _list(list(museum.values()), as_json=as_json)
            return 0
        case ["show", name]:
            (entry,) = select_entries(museum, [name])
            if as_json:
                print_json(_plain(entry))
            else:
                print(field_error_page(entry), end="")  # noqa: T201 - the answer
            return 0
        case ["run", *names]:
            return _run(select_entries(museum, names), as_json=as_json)
        case _:
            raise CannotRunError(
                f"hil museum {' '.join(words)!r} is not allowed; allowed: list, show NAME, run [NAMES]..."
            )


def _plain(entry: FieldError) -> dict[str, object]:
    return {
        "name": entry.name,
        "area": entry.area,
        "title": entry.title,
        "sources": [{"who": one.who, "url": one.url} for one in entry.sources],
        "happened": entry.happened,
        "on_the_bus": entry.on_the_bus,
        "found_by": entry.found_by,
        "campaign": entry.campaign,
        "case": entry.judged_by,
    }


def _list(entries: Sequence[FieldError], *, as_json: bool) -> None:
    if as_json:
        print_json([_plain(entry) for entry in entries])
        return
    for entry in entries:
        print(f"{entry.name}  [{entry.area}; {entry.sources[0].who}]")  # noqa: T201 - the answer
        print(f"    {entry.title}")  # noqa: T201 - the answer


def _run(entries: Sequence[FieldError], *, as_json: bool) -> int:
    judged = []
    with quiet_stdout(as_json):
        for number, entry in enumerate(entries, 1):
            found = judge_entry(entry)
            judged.append(found)
            _tell(found, number, len(entries))
    missed = [one for one in judged if not one.caught]
    if as_json:
        print_json([one.as_dict() for one in judged])
    console().print(
        f"{len(judged) - len(missed)} of {len(judged)} caught in {sum(one.seconds for one in judged):.1f} s",
        style="bold red" if missed else "bold green",
        markup=False,
    )
    return 1 if missed else 0


def _tell(found: Judgement, number: int, total: int) -> None:
    out = console()
    status = "caught" if found.caught else "NOT CAUGHT"
    out.print(
        f"[{number:{len(str(total))}}/{total}] {status} {found.entry.name}: {found.entry.judged_by} "
        f"{found.defective}, {found.clean} without the defect",
        style="green" if found.caught else "bold red",
        markup=False,
    )
    for sentence in found.noticed:
        out.print(f"    {sentence}", style="dim", markup=False)
    if not found.reached:
        out.print("    the case does not come to the defect", style="dim", markup=False)
