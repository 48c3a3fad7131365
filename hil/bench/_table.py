"""What every table of the bench file has: unknown keys and values of another type are errors."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import UnionType
from typing import Annotated, ClassVar, Final, Union, get_args, get_origin

from annotated_types import Unit
from pydantic import (
    BaseModel,
    Field,
    ValidationError,
    ValidationInfo,
    ValidatorFunctionWrapHandler,
    field_validator,
)
from pydantic_core import InitErrorDetails, PydanticCustomError

from fieldbus.errors import ConfigurationError
from fieldbus.toml_text import number_hint
from hil.bench._models import hints_of, settings_of

_SCALARS: Final[Mapping[type, str]] = {
    bool: "true or false",
    int: "a number",
    float: "a number",
    str: "a text",
}

WHOLE_SENTENCE: Final = "whole_sentence"
"""Type of a mistake whose text says everything: its value is not what is wrong."""

Word = Annotated[int, Field(ge=0, le=0xFFFFFFFF)]
RampTime = Annotated[float, Field(ge=0.001, le=1000.0)]
Time_ms = Annotated[float, Field(ge=0.0, le=5000.0)]
Cycles = Annotated[int, Field(ge=1, le=1000), Unit("cycles")]
NodeId = Annotated[int, Field(ge=1, le=126)]
Port = Annotated[int, Field(ge=0, le=65535)]


class Table(BaseModel, extra="forbid", frozen=True, allow_inf_nan=False, defer_build=True):
    """A table of the bench file, immutable."""

    label: ClassVar[str] = ""
    """How messages call this table among those that stand in the same place: `a
    drive with profile = "cia402"`.
    """

    @field_validator("*", mode="wrap")
    @classmethod
    def _as_written(
        cls, value: object, validate: ValidatorFunctionWrapHandler, info: ValidationInfo
    ) -> object:
        problems = list(_of_another_type(cls.model_fields[str(info.field_name)].annotation, value, ()))
        if problems:
            raise ValidationError.from_exception_data(cls.__name__, problems)
        return refused_by_part(value, validate)


def refused_by_part(value: object, validate: ValidatorFunctionWrapHandler) -> object:
    """Return the validated value; what a part refuses when it is built is a mistake of its table."""
    try:
        checked: object = validate(value)
    except ConfigurationError as error:
        raise ValueError(str(error)) from None
    return checked


def sentence(text: str, place: tuple[str | int, ...], value: object) -> InitErrorDetails:
    """Return a mistake at a place within a table, whose message is the text alone."""
    error = PydanticCustomError(WHOLE_SENTENCE, "{text}", {"text": text})
    return InitErrorDetails(type=error, loc=place, input=value)


def _of_another_type(hint: object, value: object, path: tuple[str | int, ...]) -> Iterator[InitErrorDetails]:
    """Yield an error for a text where a number is expected and the like; a model checks its own fields."""
    tables = settings_of(hint)
    if tables:
        for key, one in value.items() if isinstance(value, Mapping) else ():
            found = next((hints_of(table)[key] for table in tables if key in hints_of(table)), None)
            yield from _of_another_type(found, one, (*path, key))
        return
    if get_origin(hint) is tuple and isinstance(value, (list, tuple)):
        inner = get_args(hint)
        repeated = len(inner) == 2 and inner[1] is Ellipsis
        for at, one in enumerate(value if repeated else value[: len(inner)]):
            yield from _of_another_type(inner[0] if repeated else inner[at], one, (*path, at))
        return
    kinds, given = _scalars(hint), type(value)
    numbers = {int, float}
    if kinds and given in _SCALARS and given not in kinds and not (given in numbers and kinds & numbers):
        allowed = " or ".join(sorted({_SCALARS[one] for one in kinds}))
        if kinds & numbers:
            allowed += number_hint(value)
        error = PydanticCustomError("another_type", "allowed: {allowed}", {"allowed": allowed})
        yield InitErrorDetails(type=error, loc=path, input=value)


def _scalars(hint: object) -> set[type]:
    """Return which of bool, int, float and str a type hint permits; nothing for a choice of literals, which
    is strict by itself.
    """
    if isinstance(hint, type):
        return {hint} & _SCALARS.keys()
    if get_origin(hint) not in (Union, UnionType, Annotated):
        return set()
    return set().union(*map(_scalars, get_args(hint)))
