"""Checks of a configuration by the annotations of its fields.

A configuration is a frozen dataclass in the units of the keys of a bench file, whose table it is at the same
time. The annotations of its fields are the one description of what is allowed: they are checked here for
users of Python, by the bench file when it is read, and shown by editors and in the documentation.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import fields
from types import UnionType
from typing import Annotated, Any, Final, Literal, NamedTuple, Union, get_args, get_origin, get_type_hints

from annotated_types import Ge, Gt, Le, Lt, MaxLen, MinLen

from fieldbus.errors import ConfigurationError

BENCH_FILE_TABLE: Final[dict[str, Any]] = {"extra": "forbid", "allow_inf_nan": False}
"""For `__pydantic_config__` of a configuration: unknown keys are errors, and so is what is not finite."""


Positive = Annotated[float, Gt(0.0)]
NotNegative = Annotated[float, Ge(0.0)]


class _Rule(NamedTuple):
    """What is allowed for a field."""

    field: str
    allows: Callable[[Any], bool]
    text: str


_FOUND: Final[dict[type[Any], tuple[_Rule, ...]]] = {}
"""Rules of the configurations that have been checked before."""


def check_fields(config: Any, where: str) -> None:
    """Check a configuration by the annotations of its fields: ranges of numbers, and literals.

    Args:
        config: A dataclass.
        where: What it configures, for the message.

    Raises:
        ConfigurationError: A value is out of its range, or not finite.

    """
    for rule in _rules(type(config)):
        value = getattr(config, rule.field)
        if not rule.allows(value):
            raise ConfigurationError(f"{where} {rule.field}", value, rule.text)


def _rules(kind: type[Any]) -> tuple[_Rule, ...]:
    found = _FOUND.get(kind)
    if found is None:
        hints = get_type_hints(kind, include_extras=True)
        found = tuple(rule for one in fields(kind) for rule in _rules_of(one.name, hints[one.name]))
        _FOUND[kind] = found
    return found


def _rules_of(field: str, hint: Any) -> tuple[_Rule, ...]:
    allowed = _allowed(hint)
    return () if allowed is None else (_Rule(field, *allowed),)


def _allowed(hint: Any) -> tuple[Callable[[Any], bool], str] | None:
    """Return the check of a type and what it allows in words; None: there is nothing to check."""
    marks: tuple[Any, ...] = ()
    optional = False
    while True:
        if get_origin(hint) is Annotated:
            hint, *more = get_args(hint)
            marks = (*more, *marks)
        elif get_origin(hint) in (Union, UnionType) and type(None) in get_args(hint):
            optional = True
            (hint,) = (one for one in get_args(hint) if one is not type(None))
        else:
            break
    if get_origin(hint) is Literal:
        choices = get_args(hint)
        return lambda value: value in choices or (optional and value is None), ", ".join(map(str, choices))
    if get_origin(hint) is tuple:
        return _allowed_list(get_args(hint), marks)
    if hint not in (int, float):
        return None
    limits = [one for one in marks if isinstance(one, (Ge, Gt, Le, Lt))]

    def allows(value: Any) -> bool:
        if value is None:
            return optional
        return math.isfinite(value) and all(_keeps(limit, value) for limit in limits)

    return allows, " and ".join(["a finite number", *map(_text, limits)])


def _allowed_list(inner: tuple[Any, ...], marks: tuple[Any, ...]) -> tuple[Callable[[Any], bool], str] | None:
    one = _allowed(inner[0])
    if one is None:
        return None
    each, text = one
    repeated = inner[1:] == (Ellipsis,)
    low = next((mark.min_length for mark in marks if isinstance(mark, MinLen)), 0)
    high = next((mark.max_length for mark in marks if isinstance(mark, MaxLen)), math.inf)
    if not repeated:
        low, high = len(inner), len(inner)
    count = f"{low}" if low == high else f"{low} or more" if high == math.inf else f"{low} to {high}"
    return (
        lambda values: low <= len(values) <= high and all(map(each, values)),
        f"{count} values, each {text}",
    )


def _text(limit: Ge | Gt | Le | Lt) -> str:
    if isinstance(limit, Ge):
        return f">= {limit.ge}"
    if isinstance(limit, Gt):
        return f"> {limit.gt}"
    return f"<= {limit.le}" if isinstance(limit, Le) else f"< {limit.lt}"


def _keeps(limit: Ge | Gt | Le | Lt, value: Any) -> bool:
    if isinstance(limit, Ge):
        return bool(value >= limit.ge)
    if isinstance(limit, Gt):
        return bool(value > limit.gt)
    return bool(value <= limit.le) if isinstance(limit, Le) else bool(value < limit.lt)
