"""What the models of the bench file say of themselves: keys, types, choices, ranges, units."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from inspect import get_annotations
from types import UnionType
from typing import Annotated, Final, Literal, TypeGuard, Union, get_args, get_origin, get_type_hints

from annotated_types import Ge, Gt, Le, Lt, MaxLen, MinLen, Unit
from pydantic import BaseModel, Discriminator, Tag
from pydantic.fields import FieldInfo
from typing_extensions import Doc

CHOOSING: Final = ("profile", "kind", "controller", "type")
"""Keys that choose the model of a table."""
_UNITS: Final[Mapping[str, str]] = {
    "_n_per_m_s": "N per m/s",
    "_n_per_m": "N/m",
    "_kgm2": "kg m²",
    "_mm_s": "mm/s",
    "_mm": "mm",
    "_um": "µm",
    "_ms": "ms",
    "_us": "µs",
    "_s": "s",
    "_rpm": "rpm",
    "_nm": "Nm",
    "_kg": "kg",
    "_n": "N",
    "_v": "V",
    "_uf": "µF",
    "_w": "W",
    "_ohm": "ohm",
    "_c": "°C",
    "_k": "K",
    "_percent": "%",
    "_deg": "degrees",
    "_hz": "Hz",
    "_bits": "bit",
}
"""Units by the end of the key."""


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


def settings_of(hint: object) -> list[type]:
    """Return the models of a table that are the settings of a device."""
    return [one for one in alternatives(hint) if isinstance(one, type) and _is_settings(one)]


def _is_settings(kind: type) -> bool:
    return is_dataclass(kind) and not issubclass(kind, BaseModel)


def model_of(hint: object) -> type | None:
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


@cache
def hints_of(model: type) -> Mapping[str, object]:
    """Return the type hints of the keys of a table, in the order of `keys_of`."""
    hints = get_type_hints(model, include_extras=True)
    return {key: hints[key] for key in keys_of(model)}


def keys_of(model: type | None) -> tuple[str, ...]:
    """Return the keys of a table: first those of its place in the bench file, then those of the device."""
    if model is None:
        return ()
    if not issubclass(model, BaseModel):
        names = [one.name for one in fields(model)]  # type: ignore[arg-type]  # a dataclass
        return tuple(sorted(names, key=lambda name: name not in CHOOSING))
    tables = [base for base in model.__mro__ if issubclass(base, BaseModel)]
    own = {key for base in tables for key in get_annotations(base)}
    return tuple(sorted(model.model_fields, key=lambda key: key not in own))


def choices_of(model: type, key: str) -> tuple[str | int, ...]:
    """Return the literals that a key may have; nothing for a key of another type."""
    if key not in keys_of(model):
        return ()
    literals = [one for one in alternatives(hints_of(model)[key]) if get_args(one) and not is_table(one)]
    return tuple(choice for one in literals for choice in get_args(one) if isinstance(choice, str | int))


def _marks(hint: object) -> Iterator[object]:
    """Yield what annotations say of a type: limits, lengths, unit."""
    if get_origin(hint) is Annotated:
        inner, *marks = get_args(hint)
        for mark in marks:
            yield from mark.metadata if isinstance(mark, FieldInfo) else (mark,)
        yield from _marks(inner)
    elif get_origin(hint) is not Literal and get_origin(hint) not in (dict, tuple):
        for one in get_args(hint):
            yield from _marks(one)


def doc_of(hint: object) -> str:
    """Return what an annotation says of the meaning of a key; nothing where there is none."""
    return next((" ".join(mark.documentation.split()) for mark in _marks(hint) if isinstance(mark, Doc)), "")


def unit_of(key: str, hint: object) -> str:
    """Return the unit of a key; nothing where there is none."""
    for mark in _marks(hint):
        if isinstance(mark, Unit):
            return mark.unit
    for inner in get_args(hint) if get_origin(hint) is tuple else ():
        found = unit_of("", inner)
        if found:
            return found
    return next((unit for end, unit in _UNITS.items() if key.endswith(end)), "")


def range_of(hint: object) -> str:
    """Return which values a type permits, in words."""
    kinds = [one for one in alternatives(hint) if one is not type(None)]
    choices = [choice for one in kinds if get_origin(one) is Literal for choice in get_args(one)]
    if choices:
        return ", ".join(f"`{one}`" if isinstance(one, str) else str(one) for one in choices)
    if any(is_table(one) for one in kinds):
        return "table"
    origin = get_origin(kinds[0])
    if origin is dict:
        return "table"
    if origin is tuple:
        return _range_of_list(hint, kinds[0])
    if len(kinds) == 1 and kinds[0] in (int, float):
        return _range_of_number(hint, whole=kinds[0] is int)
    words = {bool: "`true`, `false`", str: "text", int: "number", float: "number"}
    return " or ".join(dict.fromkeys(words.get(one, "") for one in kinds if isinstance(one, type)))


def _range_of_list(hint: object, kind: object) -> str:
    inner = get_args(kind)
    if is_table(inner[0]):
        return "tables"
    if inner[1:] != (Ellipsis,):
        one = range_of(inner[0])
        return f"{len(inner)} values" if one == "any" else f"{len(inner)} values, each {one}"
    marks = list(_marks(hint))
    low = next((mark.min_length for mark in marks if isinstance(mark, MinLen)), 0)
    high = next((mark.max_length for mark in marks if isinstance(mark, MaxLen)), None)
    number = "" if high is None else f"{low} to {high} " if low else f"up to {high} "
    one = range_of(inner[0])
    if get_origin(inner[0]) is tuple:
        return f"{number}lists of {one}"
    return f"{number}texts" if one == "text" else f"{number}values, each {one}"


def _range_of_number(hint: object, *, whole: bool) -> str:
    low = high = above = below = None
    for mark in _marks(hint):
        if isinstance(mark, Ge):
            low = mark.ge
        elif isinstance(mark, Gt):
            above = mark.gt
        elif isinstance(mark, Le):
            high = mark.le
        elif isinstance(mark, Lt):
            below = mark.lt
    if above is not None:
        text = f"above {_number(above)}" + ("" if high is None else f" to {_number(high)}")
    elif low is not None:
        text = f"{_number(low)} to {_number(high)}" if high is not None else f"{_number(low)} or more"
    else:
        text = "any" if high is None else f"up to {_number(high)}"
    if below is not None:
        text += f", below {_number(below)}"
    return f"{text}, whole" if whole and text != "any" else "whole" if whole else text


def _number(value: object) -> str:
    return f"{value:.12g}"
