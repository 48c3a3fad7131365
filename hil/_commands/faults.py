"""`hil faults`: the catalogue and the triggers, for people and machines."""

from __future__ import annotations

from hil._commands.terminal import print_json
from hil.faults import CATALOGUE, ENVIRONMENTS, TRIGGERS, Parameter


def _parameter(parameter: Parameter) -> str:
    default = (
        "required"
        if parameter.required
        else f"default {parameter.default!r}"
        if parameter.default is not None
        else "optional"
    )
    return f"{parameter.name} ({parameter.allowed}; {default}): {parameter.summary}"


def show_faults(*, as_json: bool) -> int:
    """Print the catalogue; returns the exit code."""
    if as_json:
        print_json([entry.to_dict() for entry in CATALOGUE])
        return 0
    for entry in CATALOGUE:
        places = [where for where in ENVIRONMENTS if not entry.injectable(where)]
        print(f"{entry.name}  [{entry.target}, at the {entry.seam}; {', '.join(places)}]")  # noqa: T201 - the answer
        print(f"    {entry.summary}")  # noqa: T201 - the answer
        for parameter in entry.parameters:
            print(f"      {_parameter(parameter)}")  # noqa: T201 - the answer
        print(f"      example: {entry.example_call}")  # noqa: T201 - the answer
        for where in ENVIRONMENTS:
            if entry.injectable(where):
                print(f"      not on {where}: {entry.injectable(where)}")  # noqa: T201 - the answer
    print("\ntriggers (when = ...):")  # noqa: T201 - the answer
    for when, form in TRIGGERS.items():
        print(f"    {when}: {form.summary} [{form.live}]")  # noqa: T201 - the answer
    return 0
