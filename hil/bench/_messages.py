"""Messages about mistakes in a bench file: file, key, value, what is allowed, the nearest right name."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from difflib import get_close_matches
from types import UnionType
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    Final,
    NamedTuple,
    TypeGuard,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

from pydantic import BaseModel, Discriminator, Tag

if TYPE_CHECKING:
    from pydantic import ValidationError
    from pydantic_core import ErrorDetails

_UNKNOWN: Final = ("extra_forbidden", "unexpected_keyword_argument")
CHOOSING: Final = ("profile", "kind", "type")
"""Keys that choose the model of a table."""
_MISSING: Final = ("missing", "missing_keyword_only_argument")


class Place(NamedTuple):
    """A place in a bench file, and the models that are responsible for it."""

    path: tuple[str, ...]
    """Keys and names."""
    table: type | None
    """Model of the table that holds the last key."""
    others: tuple[type, ...]
    """Models of the same table under another profile, kind or type."""


def messages(root: type[BaseModel], source: str, error: ValidationError) -> str:
    """Return a line for every mistake.

    Args:
        root: Model of the whole file.
        source: Name of the file.
        error: What the validation says.

    """
    return "\n".join(_line(root, source, problem) for problem in error.errors())


def _line(root: type[BaseModel], source: str, problem: ErrorDetails) -> str:
    location = problem["loc"]
    if location[-1:] == ("[key]",):
        location = location[:-2]  # a wrong key of a dictionary is its value to the reader
    place = _place(root, location)
    where = ".".join((f"{source}: {place.path[0]}", *place.path[1:])) if place.path else source
    text = problem["msg"].removeprefix("Value error, ")
    context = problem.get("ctx", {})
    value = problem["input"]
    if problem["type"] in _UNKNOWN and place.table is not None:
        return f"{where}: {_unknown(place, str(problem['loc'][-1]))}"
    if problem["type"] in _MISSING:
        return f"{where}: the key is missing"
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
    return f"{where}: {value!r} is not allowed; {text}"


def _unknown(place: Place, key: str) -> str:
    having = dict.fromkeys(_label(one) for one in place.others if key in keys_of(one))
    if having and place.table is not None:
        return f"{_label(place.table)} has none; it is a key of {', '.join(having)}"
    allowed = list(keys_of(place.table))
    near = get_close_matches(key, allowed, n=1)
    return f"unknown key; allowed: {', '.join(allowed)}" + (f"; similar: {near[0]}" if near else "")


def _choices(place: Place) -> str:
    """Return what a key that chooses the model may be, in all models with the same profile."""
    key = place.path[-1]
    if key not in CHOOSING or not place.others or place.table is None:
        return ""
    profile = choices_of(place.table, "profile")
    models = [place.table, *(one for one in place.others if choices_of(one, "profile") == profile)]
    return ", ".join(dict.fromkeys(repr(choice) for one in models for choice in choices_of(one, key)))


def _wrong_tag(root: type[BaseModel], location: tuple[int | str, ...], value: Any) -> str:
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
        model = _model(hint)
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
                inside = _model(hint)
                others = [one for one in siblings if one is not inside]
        else:
            hint = _inner(hint, part)
    return Place(tuple(path), table, tuple(others))


def _hint_at(root: type[BaseModel], location: tuple[int | str, ...]) -> object:
    hint: object = root
    for part in location:
        tagged = tagged_of(hint)
        model = _model(hint)
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


def alternatives(hint: object) -> Iterator[object]:
    """Yield the members of a union, without annotations."""
    if get_origin(hint) is Annotated:
        yield from alternatives(get_args(hint)[0])
    elif get_origin(hint) in (Union, UnionType):
        for one in get_args(hint):
            yield from alternatives(one)
    else:
        yield hint


def is_table(hint: object) -> TypeGuard[type]:
    """Whether a type is the model of a table."""
    return isinstance(hint, type) and (issubclass(hint, BaseModel) or is_dataclass(hint))


def variants_of(hint: object) -> list[type]:
    """Return the models of a table: one, or those of a union."""
    return [one for one in alternatives(hint) if is_table(one)]


def _model(hint: object) -> type | None:
    variants = variants_of(hint)
    return variants[0] if len(variants) == 1 else None


def tagged_of(hint: object) -> dict[str, type]:
    """Return the models of a discriminated union by their tags."""
    if get_origin(hint) is not Annotated:
        return {}
    inner, *marks = get_args(hint)
    if not any(isinstance(one, Discriminator) for one in marks):
        return {}
    return {
        mark.tag: get_args(one)[0]
        for one in get_args(inner)
        for mark in get_args(one)[1:]
        if isinstance(mark, Tag)
    }


def hints_of(model: type) -> dict[str, object]:
    """Return the type hints of the keys of a table, in their order."""
    hints = get_type_hints(model, include_extras=True)
    return {key: hints[key] for key in keys_of(model)}


def keys_of(model: type | None) -> tuple[str, ...]:
    """Return the keys of a table, in their order."""
    if model is None:
        return ()
    if issubclass(model, BaseModel):
        return tuple(model.model_fields)
    return tuple(one.name for one in fields(model))  # type: ignore[arg-type]  # a dataclass


def choices_of(model: type, key: str) -> tuple[Any, ...]:
    """Return the literals that a key may have; nothing for a key of another type."""
    if key not in keys_of(model):
        return ()
    literals = [one for one in alternatives(hints_of(model)[key]) if get_args(one) and not is_table(one)]
    return tuple(choice for one in literals for choice in get_args(one) if isinstance(choice, str | int))
