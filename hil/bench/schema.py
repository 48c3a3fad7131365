"""JSON Schema of the bench file, and the tables of its keys in the documentation: both come from the models.

`hil schema` prints the schema. `python -m hil.bench.schema docs/reference/bench-file.md` writes the tables of
keys between the comments `<!-- keys: HEADING -->` and `<!-- end of keys -->` of a page.
"""

from __future__ import annotations

import ast
import inspect
import re
import sys
import textwrap
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, Field, fields
from functools import cache
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple, get_args, get_origin

from pydantic import BaseModel
from pydantic_core import PydanticUndefined

from hil.bench._models import (
    CHOOSING,
    alternatives,
    doc_of,
    hints_of,
    is_table,
    range_of,
    tagged_of,
    unit_of,
    variants_of,
)
from hil.bench.config import BenchConfig

DIALECT: Final = "https://json-schema.org/draft/2020-12/schema"


# -- what the models say of a key --------------------------------------------------------------------------


@cache
def descriptions(model: type) -> dict[str, str]:
    """Return what the docstrings below the fields of a model say, those of its bases included."""
    found: dict[str, str] = {}
    for base in reversed(model.__mro__):
        if base.__module__ == "builtins" or not is_table(base) or base is BaseModel:
            continue
        body = ast.parse(textwrap.dedent(inspect.getsource(base))).body[0]
        assert isinstance(body, ast.ClassDef)
        for statement, following in zip(body.body, body.body[1:], strict=False):
            if (
                isinstance(statement, ast.AnnAssign)
                and isinstance(statement.target, ast.Name)
                and isinstance(following, ast.Expr)
                and isinstance(following.value, ast.Constant)
                and isinstance(following.value.value, str)
            ):
                found[statement.target.id] = " ".join(following.value.value.split())
    return found


def defaults(model: type) -> dict[str, object]:
    """Return the defaults of the keys of a table; `PydanticUndefined` for a key that is required."""
    if issubclass(model, BaseModel):
        return {
            key: field.get_default(call_default_factory=True) for key, field in model.model_fields.items()
        }
    return {one.name: _default_of(one) for one in fields(model)}  # type: ignore[arg-type]  # a dataclass


def _default_of(key: Field[Any]) -> object:
    if key.default_factory is not MISSING:
        return key.default_factory()
    return PydanticUndefined if key.default is MISSING else key.default


def _default(value: object) -> str:
    if value is PydanticUndefined:
        return "required"
    if value is None:
        return "none"
    if value == {}:
        return "empty"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return str(list(value))
    if isinstance(value, float) and 0.0 < value < 0.0001:
        return f"{value:.7f}".rstrip("0")
    return f"`{value}`" if isinstance(value, str) else str(value)


# -- JSON Schema -------------------------------------------------------------------------------------------


def models(root: type = BenchConfig) -> dict[str, type]:
    """Return the models of all tables by their name in the schema."""
    found = {root.__name__: root}
    for hint in hints_of(root).values():
        for model in _tables_in(hint):
            if model.__name__ not in found:
                found |= models(model)
    return found


def _tables_in(hint: object) -> Iterator[type]:
    for one in alternatives(hint):
        if is_table(one):
            yield one
        elif get_origin(one) is not Literal:
            for inner in get_args(one):
                yield from _tables_in(inner)


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema of the bench file, draft 2020-12."""
    schema = BenchConfig.model_json_schema()
    tables = models()
    _describe(schema, BenchConfig)
    for name, definition in schema["$defs"].items():
        _describe(definition, tables[name])
    return {"$schema": DIALECT, **schema, "title": "Bench file of motion-hil"}


def _describe(definition: dict[str, Any], model: type) -> None:
    """Give a table and its keys their descriptions and units."""
    definition["title"] = getattr(model, "label", "") or model.__name__
    definition["description"] = _summary(model)
    hints = hints_of(model)
    for key, described in definition.get("properties", {}).items():
        unit = unit_of(key, hints[key])
        described["title"] = f"{key}, {unit}" if unit else key
        text = (
            descriptions(model).get(key)
            or doc_of(hints[key])
            or next((_summary(one) for one in _tables_in(hints[key])), "")
        )
        if text:
            described["description"] = text
        if unit:
            described["x-unit"] = unit
        if any(variants_of(hints[key])):
            described.pop("default", None)  # a table that is left out has the defaults of its keys


def _summary(model: type) -> str:
    return re.sub(r"^`\[+.*?\]+`(?: with [^:]*)?: ", "", " ".join((model.__doc__ or "").split()))


# -- documentation -----------------------------------------------------------------------------------------


class _Row(NamedTuple):
    unit: str
    range: str
    default: str
    meaning: str


def headings() -> dict[str, dict[str, type]]:
    """Return every table of the bench file: its heading, and its models by the tag of a union."""
    return dict(_headings(BenchConfig, ""))


def _headings(model: type, path: str) -> Iterator[tuple[str, dict[str, type]]]:
    found: dict[str, dict[str, type]] = {}
    for key, hint in hints_of(model).items():
        by_name = get_origin(next(alternatives(hint))) is dict
        inner = get_args(next(alternatives(hint)))[1] if by_name else hint
        tables = list(_tables_in(inner))
        if not tables:
            continue
        heading = f"{path}.{key}".lstrip(".") + (".NAME" if by_name else "")
        found.setdefault(heading, {}).update(tagged_of(inner) or {"": tables[0]})
    for heading, tags in found.items():
        yield heading, tags
        merged: dict[str, dict[str, type]] = {}
        for outer, table in tags.items():
            for inner_heading, inner_tags in _headings(table, heading):
                named = {tag or outer: one for tag, one in inner_tags.items()}
                merged.setdefault(inner_heading, {}).update(named)
        yield from merged.items()


def key_table(tags: Mapping[str, type]) -> str:
    """Return the Markdown table of the keys of a table; with several models a column says which of them have
    a key.

    Args:
        tags: Models by their tag.

    """
    rows: dict[str, dict[_Row, list[str]]] = {}
    for tag, model in tags.items():
        for key, hint in hints_of(model).items():
            kinds = list(_tables_in(hint))
            if kinds and get_origin(next(alternatives(hint))) is not tuple:
                continue  # a table of its own
            row = _Row(
                unit_of(key, hint),
                range_of(hint),
                _default(defaults(model)[key]),
                (descriptions(model).get(key) or doc_of(hint)).rstrip("."),
            )
            rows.setdefault(key, {}).setdefault(row, []).append(tag)
    several = len(set(tags.values())) > 1
    columns = ["key", *(["with"] if several else []), "unit", "range", "default", "meaning"]
    lines = [f"| {' | '.join(columns)} |", f"|{'---|' * len(columns)}"]
    for key, variants in rows.items():
        for row, having in (_joined(variants) if key in CHOOSING else variants).items():
            every = len(having) == len(tags)
            which = [_ALL if every else ", ".join(having).replace(*_ON_ANY_BUS)] if several else []
            lines.append(f"| {' | '.join((f'`{key}`', *which, *row))} |".replace("  |", " |"))
    return "\n".join(lines)


def _joined(variants: Mapping[_Row, list[str]]) -> dict[_Row, list[str]]:
    """Return one row for a key that chooses the model: the choices of all of them."""
    choices = ", ".join(dict.fromkeys(one for row in variants for one in row.range.split(", ")))
    default = next((row.default for row in variants if row.default != "required"), "required")
    meaning = next((row.meaning for row in variants if row.meaning), "")
    return {_Row("", choices, default, meaning): [tag for having in variants.values() for tag in having]}


_ALL: Final = "all"
_ON_ANY_BUS: Final = ("profidrive on CAN, profidrive on Modbus", "profidrive")
_BLOCK: Final = re.compile(r"(<!-- keys: (\S+) -->\n).*?(<!-- end of keys -->)", re.DOTALL)


def with_key_tables(page: str) -> str:
    """Return a page with present tables of keys."""
    tables = headings()
    return _BLOCK.sub(lambda found: f"{found[1]}{key_table(tables[found[2]])}\n{found[3]}", page)


if __name__ == "__main__":
    for name in sys.argv[1:]:
        path = Path(name)
        path.write_text(with_key_tables(path.read_text(encoding="utf-8")), encoding="utf-8")
