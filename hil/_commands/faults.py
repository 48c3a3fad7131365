"""`hil faults`: the catalogue and the triggers, for people and machines."""

from __future__ import annotations

import fnmatch

from hil._commands.terminal import print_json
from hil.faults import CATALOGUE, ENVIRONMENTS, TRIGGERS, FaultType, Parameter, fault_type


def _parameter(parameter: Parameter) -> str:
    default = (
        "required"
        if parameter.required
        else f"default {parameter.default!r}"
        if parameter.default is not None
        else "optional"
    )
    return f"{parameter.name} ({parameter.allowed}; {default}): {parameter.summary}"


def _matching(name: str) -> list[FaultType]:
    """Return the kinds that a name, a family or a pattern stands for.

    Raises:
        UnknownNameError: There is none.

    """
    pattern = f"{name}*" if name.endswith(".") else name
    found = [entry for entry in CATALOGUE if fnmatch.fnmatchcase(entry.name, pattern)]
    if not found:
        families = dict.fromkeys(f"{entry.name.partition('.')[0]}." for entry in CATALOGUE)
        if f"{name}." in families:
            return _matching(f"{name}.")
        found = [entry for entry in CATALOGUE if name in entry.name]
    if not found:
        fault_type(name)  # says which ones are similar
    return found


def show_faults(name: str = "", *, as_json: bool) -> int:
    """Print the catalogue, or the kinds of a name; returns the exit code.

    Args:
        name: `frame.drop`, a family (`frame`), or a pattern with `*`; empty: all of them.
        as_json: As JSON.

    Raises:
        UnknownNameError: There is no such kind.

    """
    entries = _matching(name) if name else CATALOGUE
    if as_json:
        print_json([entry.to_dict() for entry in entries])
        return 0
    for entry in entries:
        places = [where for where in ENVIRONMENTS if not entry.injectable(where)]
        print(f"{entry.name}  [{entry.target}, at the {entry.seam}; {', '.join(places)}]")  # noqa: T201 - the answer
        print(f"    {entry.summary}")  # noqa: T201 - the answer
        for parameter in entry.parameters:
            print(f"      {_parameter(parameter)}")  # noqa: T201 - the answer
        print(f"      example: {entry.example_call}")  # noqa: T201 - the answer
        for where in ENVIRONMENTS:
            if entry.injectable(where):
                print(f"      not on {where}: {entry.injectable(where)}")  # noqa: T201 - the answer
    if name:
        return 0
    print("\ntriggers (when = ...):")  # noqa: T201 - the answer
    for when, form in TRIGGERS.items():
        print(f"    {when}: {form.summary} [{form.live}]")  # noqa: T201 - the answer
    return 0
