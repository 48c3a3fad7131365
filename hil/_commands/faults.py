"""`hil faults`: the catalogue and the triggers, for people and machines."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hil._commands.terminal import print_json
from hil.faults import CATALOGUE, ENVIRONMENTS, TRIGGERS
from hil.faults._parameters import Parameter


def _parameter(parameter: Parameter) -> str:
    default = (
        "required"
        if parameter.required
        else f"default {parameter.default!r}"
        if parameter.default is not None
        else "optional"
    )
    return f"{parameter.name} ({parameter.allowed}; {default}): {parameter.summary}"


def example_call(example: Mapping[str, Any]) -> str:
    """Return the example of a kind as a call of the injector."""
    arguments = [repr(example["kind"])]
    if example.get("target"):
        arguments.append(repr(example["target"]))
    options = {key: example[key] for key in ("duration_s", "count") if key in example}
    arguments += [f"{name}={value!r}" for name, value in {**options, **example.get("parameters", {})}.items()]
    return f"faults.inject({', '.join(arguments)})".replace("'", '"')


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
        print(f"      example: {example_call(entry.example)}")  # noqa: T201 - the answer
        for where in ENVIRONMENTS:
            if entry.injectable(where):
                print(f"      not on {where}: {entry.injectable(where)}")  # noqa: T201 - the answer
    print("\ntriggers (when = ...):")  # noqa: T201 - the answer
    for when, (summary, live) in TRIGGERS.items():
        print(f"    {when}: {summary} [{live}]")  # noqa: T201 - the answer
    return 0
