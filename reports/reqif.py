"""Requirements with their verdicts as ReqIF, which tools for requirements exchange (OMG ReqIF 1.2)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

from reports.coverage import RequirementRow
from reports.errors import ReportError

if TYPE_CHECKING:
    from reqif.models.reqif_spec_object import ReqIFSpecObject

_ATTRIBUTES: Final[Mapping[str, Callable[[RequirementRow], str]]] = {
    "ReqIF.ForeignID": lambda row: row.identifier,
    "ReqIF.Name": lambda row: row.title,
    "Section": lambda row: f"{row.document}: {row.section}" if row.document else row.section,
    "Verdict": lambda row: row.verdict.value if row.verdict else "not tested",
    "Cases": lambda row: "; ".join(f"{case}: {verdict.value}" for case, verdict in row.cases),
}
"""Name of an attribute, and what it is of a requirement."""
_STRING, _TYPE, _SPECIFICATION = "string", "requirement-with-verdict", "specification"


def write_reqif(rows: Sequence[RequirementRow], path: Path, *, title: str, time: str, tool: str) -> Path:
    """Write requirements in their order, each with clause, section, verdict and cases.

    Args:
        rows: The requirements.
        path: File to write.
        title: Of the file and its specification.
        time: Time of the run, ISO 8601 with a time zone: the last change of every object.
        tool: Name and version of the tool.

    Raises:
        ReportError: The library for ReqIF is not installed.

    """
    try:
        from reqif.models import reqif_data_type as types
        from reqif.models.reqif_core_content import ReqIFCoreContent
        from reqif.models.reqif_namespace_info import ReqIFNamespaceInfo
        from reqif.models.reqif_req_if_content import ReqIFReqIFContent
        from reqif.models.reqif_reqif_header import ReqIFReqIFHeader
        from reqif.models.reqif_spec_hierarchy import ReqIFSpecHierarchy
        from reqif.models.reqif_spec_object_type import ReqIFSpecObjectType, SpecAttributeDefinition
        from reqif.models.reqif_specification import ReqIFSpecification
        from reqif.models.reqif_specification_type import ReqIFSpecificationType
        from reqif.models.reqif_types import SpecObjectAttributeType
        from reqif.object_lookup import ReqIFObjectLookup
        from reqif.reqif_bundle import ReqIFBundle
        from reqif.unparser import ReqIFUnparser
    except ImportError:
        raise ReportError("ReqIF needs a library: pip install 'motion-hil[reqif]'") from None
    definitions = [
        SpecAttributeDefinition(
            SpecObjectAttributeType.STRING,
            _identifier("attribute", name),
            _STRING,
            last_change=time,
            long_name=name,
        )
        for name in _ATTRIBUTES
    ]
    specification = ReqIFSpecification(
        _SPECIFICATION,
        last_change=time,
        long_name=title,
        specification_type=f"{_SPECIFICATION}-type",
        children=[
            ReqIFSpecHierarchy(
                identifier=_identifier("place", row.identifier),
                spec_object=_identifier("requirement", row.identifier),
                level=1,
                last_change=time,
                editable=None,
                is_table_internal=None,
            )
            for row in rows
        ],
    )
    content = ReqIFReqIFContent(
        data_types=[
            types.ReqIFDataTypeDefinitionString(
                _STRING, last_change=time, long_name="Text", max_length="100000"
            )
        ],
        spec_types=[
            ReqIFSpecObjectType(
                _TYPE,
                last_change=time,
                long_name="Requirement with verdict",
                attribute_definitions=definitions,
            ),
            ReqIFSpecificationType(
                f"{_SPECIFICATION}-type", last_change=time, long_name="Specification", is_self_closed=True
            ),
        ],
        spec_objects=[_object(row, time) for row in rows],
        spec_relations=[],
        specifications=[specification],
    )
    bundle = ReqIFBundle(
        namespace_info=ReqIFNamespaceInfo.create_default(),
        req_if_header=ReqIFReqIFHeader(
            identifier="motion-hil-qualification",
            comment="Verdicts of one run; see the page beside it for what is not claimed.",
            creation_time=time,
            req_if_tool_id=tool,
            req_if_version="1.0",
            source_tool_id=tool,
            title=title,
        ),
        core_content=ReqIFCoreContent(content),
        tool_extensions_tag_exists=False,
        lookup=ReqIFObjectLookup({}, {}, {}, {}),
        exceptions=[],
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(ReqIFUnparser.unparse(bundle), encoding="utf-8")
    return path


def _object(row: RequirementRow, time: str) -> ReqIFSpecObject:
    from reqif.models.reqif_spec_object import ReqIFSpecObject, SpecObjectAttribute
    from reqif.models.reqif_types import SpecObjectAttributeType

    return ReqIFSpecObject(
        _identifier("requirement", row.identifier),
        [
            SpecObjectAttribute(SpecObjectAttributeType.STRING, _identifier("attribute", name), text)
            for name, value in _ATTRIBUTES.items()
            if (text := value(row))
        ],
        _TYPE,
        last_change=time,
    )


def _identifier(kind: str, name: str) -> str:
    """Return a name as XML takes it for an identifier: letters, digits and a few signs."""
    return f"{kind}-" + "".join(
        sign if sign.isascii() and (sign.isalnum() or sign in "._-") else f"_{ord(sign):x}" for sign in name
    )
