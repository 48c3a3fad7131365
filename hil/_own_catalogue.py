"""Catalogues of requirements of the user's own: CSV, or ReqIF as tools for requirements exchange it."""

from __future__ import annotations

import csv
import html
import io
import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

from hil.errors import CannotRunError

if TYPE_CHECKING:
    from reqif.models.reqif_spec_object import ReqIFSpecObject
    from reqif.models.reqif_specification import ReqIFSpecHierarchy
    from reqif.reqif_bundle import ReqIFBundle

_COLUMNS: Final = {
    "identifier": ("identifier", "id", "requirement", "key"),
    "title": ("title", "name", "summary", "text"),
    "section": ("section", "chapter", "group"),
}
"""Names that a column of a CSV file may have, capital letters aside."""
_ATTRIBUTES: Final = {
    "identifier": ("ReqIF.ForeignID", "Identifier", "ID", "Object Identifier"),
    "title": ("ReqIF.Name", "Name", "Title", "Summary", "ReqIF.ChapterName", "ReqIF.Text", "Text"),
}
"""Names of attributes of a ReqIF object, the first one that has a value counts."""
_HEADING: Final = "ReqIF.ChapterName"


class OwnRequirement(NamedTuple):
    """A requirement of the user."""

    identifier: str
    title: str
    section: str


def load_catalogue(path: Path) -> list[OwnRequirement]:
    """Return the requirements of a file, in its order.

    Args:
        path: `*.csv` with a line of column names (identifier, title, section), or `*.reqif`.

    Raises:
        CannotRunError: The file cannot be read, has no identifiers, or one twice; the message names file and
            line or object.

    """
    suffix = path.suffix.lower()
    if suffix not in {".csv", ".reqif"}:
        raise CannotRunError(f"{path}: a catalogue of requirements is a file *.csv or *.reqif")
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise CannotRunError(f"{path}: cannot be read ({error.strerror})") from error
    except UnicodeDecodeError:
        raise CannotRunError(f"{path}: this is not UTF-8 text") from None
    seen: dict[str, str] = {}
    found = []
    for place, entry in _of_csv(path, text) if suffix == ".csv" else _of_reqif(path, text):
        if not entry.identifier:
            raise CannotRunError(f"{path}: {place}: the identifier is empty")
        if entry.identifier in seen:
            raise CannotRunError(
                f"{path}: {place}: {entry.identifier!r} is in {seen[entry.identifier]} already"
            )
        seen[entry.identifier] = place
        found.append(entry)
    if not found:
        raise CannotRunError(f"{path}: there is no requirement in it")
    return found


def _of_csv(path: Path, text: str) -> Iterator[tuple[str, OwnRequirement]]:
    head = text.partition("\n")[0]
    delimiter = max(",;\t", key=head.count)
    rows = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter)
    names = [name.strip().lower() for name in next(rows, [])]
    columns: dict[str, int] = {}
    for what, allowed in _COLUMNS.items():
        column = next((names.index(one) for one in allowed if one in names), None)
        if column is not None:
            columns[what] = column
    if "identifier" not in columns:
        raise CannotRunError(
            f"{path}: line 1: no column has the identifiers; allowed: {', '.join(_COLUMNS['identifier'])} in "
            "the first line"
        )
    try:
        for row in rows:
            if any(cell.strip() for cell in row):
                values = {what: row[at].strip() if at < len(row) else "" for what, at in columns.items()}
                yield (
                    f"line {rows.line_num}",
                    OwnRequirement(values["identifier"], values.get("title", ""), values.get("section", "")),
                )
    except csv.Error as error:
        raise CannotRunError(f"{path}: line {rows.line_num}: {error}") from error


def _of_reqif(path: Path, text: str) -> Iterator[tuple[str, OwnRequirement]]:
    try:
        from reqif.parser import ReqIFParser
    except ImportError:
        raise CannotRunError(f"{path}: ReqIF needs a library: pip install 'motion-hil[reqif]'") from None
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise CannotRunError(f"{path}: a ReqIF file has no document type and no entities")
    try:
        bundle = ReqIFParser.parse_from_string(text)
    except Exception as error:  # the library reports a wrong file with errors of several kinds
        raise CannotRunError(f"{path}: this is no ReqIF file: {error or type(error).__name__}") from error
    return _objects(bundle)


def _objects(bundle: ReqIFBundle) -> Iterator[tuple[str, OwnRequirement]]:
    """Yield the objects in the order of the specifications; headings become sections."""
    core = bundle.core_content
    content = None if core is None else core.req_if_content
    if content is None:
        return
    names = {
        definition.identifier: definition.long_name or definition.identifier
        for kind in content.spec_types or ()
        for definition in getattr(kind, "attribute_definitions", None) or ()
    }
    by_id = {one.identifier: one for one in content.spec_objects or ()}
    listed: set[str] = set()
    for specification in content.specifications or ():
        yield from _below(specification.children or (), "", by_id, names, listed)
    for one in by_id.values():
        if one.identifier not in listed:
            yield f"object {one.identifier}", _requirement(one, names, "")


def _below(
    nodes: list[ReqIFSpecHierarchy] | tuple[()],
    section: str,
    by_id: dict[str, ReqIFSpecObject],
    names: dict[str, str],
    listed: set[str],
) -> Iterator[tuple[str, OwnRequirement]]:
    for node in nodes:
        one = by_id.get(node.spec_object)
        inner = section
        if one is not None and one.identifier not in listed:
            listed.add(one.identifier)
            values = _values(one, names)
            if _HEADING in values and node.children:
                inner = values[_HEADING]
            else:
                yield f"object {one.identifier}", _requirement(one, names, section)
        yield from _below(node.children or (), inner, by_id, names, listed)


def _values(one: ReqIFSpecObject, names: dict[str, str]) -> dict[str, str]:
    """Return the texts of an object by the name of the attribute; without mark-up."""
    found = {}
    for attribute in one.attributes:
        value = attribute.value if isinstance(attribute.value, str) else ""
        text = html.unescape(re.sub(r"<[^>]*>", " ", value))
        if text.strip():
            found[names.get(attribute.definition_ref, attribute.definition_ref)] = " ".join(text.split())
    return found


def _requirement(one: ReqIFSpecObject, names: dict[str, str], section: str) -> OwnRequirement:
    values = _values(one, names)
    own = next((values[name] for name in _ATTRIBUTES["identifier"] if name in values), one.identifier)
    title = next((values[name] for name in _ATTRIBUTES["title"] if name in values), one.long_name or "")
    return OwnRequirement(own, title, section)
