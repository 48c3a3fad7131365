"""Messages about mistakes in a bench file: file, key, value, what is allowed, the nearest right name."""

from __future__ import annotations

import re
from collections.abc import Mapping
from difflib import get_close_matches
from typing import TYPE_CHECKING, Final, NamedTuple, get_args, get_origin

from fieldbus.errors import unknown_key
from hil.bench._models import (
    CHOOSING,
    alternatives,
    choices_of,
    hints_of,
    keys_of,
    model_of,
    range_of,
    tagged_of,
    variants_of,
)
from hil.bench._table import WHOLE_SENTENCE

if TYPE_CHECKING:
    from pydantic import BaseModel, ValidationError
    from pydantic_core import ErrorDetails

_UNKNOWN: Final = ("extra_forbidden", "unexpected_keyword_argument")
_MISSING: Final = ("missing", "missing_keyword_only_argument")


_OUT_OF_RANGE: Final = (
    "greater_than",
    "greater_than_equal",
    "less_than",
    "less_than_equal",
    "finite_number",
    "int_from_float",
)
_NO_TABLE: Final = (
    "dict_type",
    "model_type",
    "model_attributes_type",
    "dataclass_type",
    "union_tag_not_found",
)
"""A value that stands where a table belongs."""
_SMALLEST: Final = {
    "bench": ("[bench]", '[bench]\nname = "my bench"'),
    "segment": ("[segment.NAME]", "[segment.can0]"),
}
"""Tables that every bench file has: what the message calls them, and the smallest example."""


class Place(NamedTuple):
    """A place in a bench file, and the models that are responsible for it."""

    path: tuple[str, ...]
    """Keys and names."""
    table: type | None
    """Model of the table that holds the last key."""
    others: tuple[type, ...]
    """Models of the same table under another profile, kind or type."""


def messages(root: type[BaseModel], source: str, error: ValidationError) -> list[str]:
    """Return a line for every mistake.

    Args:
        root: Model of the whole file.
        source: Name of the file.
        error: What the validation says.

    """
    # An unknown table often is why others are incomplete.
    problems = sorted(error.errors(), key=lambda problem: problem["type"] not in _UNKNOWN)
    meant = {_meant(root, problem) for problem in problems if problem["type"] in _UNKNOWN}
    return [
        _line(root, source, problem)
        for problem in problems
        if problem["type"] not in _MISSING or problem["loc"] not in meant
    ]


def _meant(root: type[BaseModel], problem: ErrorDetails) -> tuple[int | str, ...]:
    """Return where a misspelt key would have been right, so that it is not called missing too."""
    *table, key = problem["loc"]
    return (*table, _nearest(_place(root, problem["loc"]), str(key)))


def shown_key(key: str) -> str:
    """Return a key as TOML writes it: in quotes if it has a dot or another special character."""
    return key if re.fullmatch(r"[\w-]+", key, re.ASCII) else f'"{key}"'


def _line(root: type[BaseModel], source: str, problem: ErrorDetails) -> str:
    location = problem["loc"]
    if location[-1:] == ("[key]",):
        location = location[:-2]  # a wrong key of a dictionary is its value to the reader
    place = _place(root, location)
    path = ".".join(map(shown_key, place.path))
    where = f"{source}: {path}" if path else source
    text = problem["msg"].removeprefix("Value error, ")
    context = problem.get("ctx", {})
    value = problem["input"]
    if problem["type"] == WHOLE_SENTENCE:
        return f"{where}: {text}"
    if problem["type"] in _UNKNOWN and place.table is not None:
        return f"{where}: {_unknown(place, str(problem['loc'][-1]))}"
    if problem["type"] in _MISSING:
        if path in _SMALLEST:
            table, example = _SMALLEST[path]
            shown = example.replace("\n", "\n    ")
            return f"{source}: the table {table} is missing; the smallest one:\n    {shown}"
        return f"{where}: the key is missing"
    if problem["type"] in _NO_TABLE:
        return f"{where}: {value!r} is not allowed; allowed: {_table_at(root, location, path)}"
    if problem["type"] == "too_short" and path in _SMALLEST:
        return f"{where}: the table is empty; allowed: one table {_SMALLEST[path][0]} or more"
    if problem["type"] == "union_tag_invalid":
        return where + _wrong_tag(root, problem["loc"], value)
    if "expected" in context:
        return f"{where}: {value!r} is not allowed; allowed: {_choices(place) or context['expected']}"
    if not place.path:
        return f"{where}: {text}"
    if isinstance(value, Mapping):  # the table as a whole: the text may name its key
        key = re.match(r"\w*", text)
        tables = variants_of(_hint_at(root, problem["loc"]))
        names_key = key is not None and any(key[0] in keys_of(one) for one in tables)
        return f"{where}{'.' if names_key else ': '}{text}"
    if problem["type"] in _OUT_OF_RANGE:
        allowed = range_of(_hint_at(root, problem["loc"]))
        text = f"allowed: {'a finite number' if allowed == 'any' else allowed}"
    elif problem["type"] == "string_too_short":
        text = "allowed: a text that is not empty"
    return f"{where}: {value!r} is not allowed; {text}"


def _table_at(root: type[BaseModel], location: tuple[int | str, ...], path: str) -> str:
    """Return which table belongs to a place, as its head is written: `a table [drive.drive1]`."""
    hint = _hint_at(root, location)
    of_tables = model_of(hint) is None and variants_of(_inner(hint, "NAME"))
    return f"tables [{path}.NAME]" if of_tables else f"a table [{path}]"


def _unknown(place: Place, key: str) -> str:
    having = dict.fromkeys(_label(one) for one in place.others if key in keys_of(one))
    if having and place.table is not None:
        return f"{_label(place.table)} has none; it is a key of {', '.join(having)}"
    return unknown_key(key, keys_of(place.table))


def _nearest(place: Place, key: str) -> str:
    """Return the key of the table that was meant; empty: none is near."""
    return next(iter(get_close_matches(key, keys_of(place.table), n=1)), "")


def _choices(place: Place) -> str:
    """Return what a key that chooses the model may be, in all models with the same profile."""
    key = place.path[-1]
    if key not in CHOOSING or not place.others or place.table is None:
        return ""
    profile = choices_of(place.table, "profile")
    models = [place.table, *(one for one in place.others if choices_of(one, "profile") == profile)]
    return ", ".join(dict.fromkeys(repr(choice) for one in models for choice in choices_of(one, key)))


def _wrong_tag(root: type[BaseModel], location: tuple[int | str, ...], value: object) -> str:
    """Return the message about a table for which there is no model: one of its choosing keys is wrong."""
    variants = variants_of(_hint_at(root, location))
    for key in CHOOSING:
        allowed = [choice for one in variants for choice in choices_of(one, key)]
        if isinstance(value, Mapping) and key in value and allowed and value[key] not in allowed:
            choices = ", ".join(map(repr, dict.fromkeys(allowed)))
            return f".{key}: {value[key]!r} is not allowed; allowed: {choices}"
    return f": {value!r} is not allowed; allowed: a table"


def _label(model: type) -> str:
    return getattr(model, "label", "") or f"a table {model.__name__}"


def _place(root: type[BaseModel], location: tuple[int | str, ...]) -> Place:
    """Return where a mistake is; tags of unions are no part of the path."""
    hint: object = root
    table: type | None = root
    others: list[type] = []
    path: list[str] = []
    siblings: list[type] = []
    for at, part in enumerate(location):
        variants = variants_of(hint)
        tagged = tagged_of(hint)
        if part in tagged:
            chosen = tagged[str(part)]
            siblings = [one for one in variants if one is not chosen]
            hint, table, others = chosen, chosen, siblings
            continue
        path.append(str(part))
        model = model_of(hint)
        if model is not None:
            table = model
            if at < len(location) - 1:  # the same table within the siblings
                siblings = [
                    inner
                    for one in siblings
                    if part in keys_of(one)
                    for inner in variants_of(hints_of(one)[str(part)])
                ]
                hint = hints_of(model).get(str(part))
                inside = model_of(hint)
                others = [one for one in siblings if one is not inside]
        else:
            hint = _inner(hint, part)
    return Place(tuple(path), table, tuple(others))


def _hint_at(root: type[BaseModel], location: tuple[int | str, ...]) -> object:
    hint: object = root
    for part in location:
        tagged = tagged_of(hint)
        model = model_of(hint)
        if part in tagged:
            hint = tagged[str(part)]
        elif model is not None:
            hint = hints_of(model).get(str(part))
        else:
            hint = _inner(hint, part)
    return hint


def _inner(hint: object, part: int | str) -> object:
    """Return the hint of what a dictionary or list holds."""
    for one in alternatives(hint):
        arguments = get_args(one)
        if get_origin(one) is dict:
            return arguments[1]
        if get_origin(one) is tuple and isinstance(part, int):
            return arguments[0] if arguments[1:] == (Ellipsis,) else arguments[min(part, len(arguments) - 1)]
    return None
