"""Make the data files of this package from the catalogues of the specification.

    python -m motion.s7.data._generate to_variables.yaml technology-alarms.yaml

Needed by developers only, together with PyYAML; the product reads the JSON files.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final

import yaml

_STAYS_ENABLED: Final = {531: [3], 533: [1, 2], 534: [3]}
"""Reactions after whose ramp the axis stays enabled (STP-589 to STP-591)."""
_AXIS: Final = "TO"
_DOCUMENTS: Final = {"S1": "vendor help V8", "S2": "function manual V9.0"}


def _bit(text: str | None) -> tuple[int | None, str]:
    """Return number and name of a bit written `X5 SensorFault`."""
    if text is None:
        return None, ""
    found = re.match(r"X(\d+) ?(\w*)$", text)
    if found is None:
        raise ValueError(f"cannot read the bit {text!r}")
    return int(found[1]), found[2]


_POSITION_RANGE: Final = (-1e12, 1e12)
_SYNCHRONOUS: Final = (
    (
        "FunctionState",
        "DINT",
        "",
        "0 none, 1 MC_GearIn, 2 MC_GearInPos, 3 MC_CamIn, 4 MC_GearOut, 5 MC_CamOut, 6 MC_GearInVelocity.",
    ),
    (
        "WaitingFunctionState",
        "DINT",
        "",
        "Job that waits: 0 none, 2 MC_GearInPos, 3 MC_CamIn, 4 MC_GearOut, 5 MC_CamOut.",
    ),
    ("ActualCam", "DB_ANY", "", "Number of the data block of the cam in use; 0 without camming."),
    (
        "ActualMaster",
        "DB_ANY",
        "",
        "Number of the data block of the leading object in use; 0 without synchronous operation.",
    ),
    *(
        (name, "LREAL", "", f"{meaning} of the cam in use; computed where the job computes it.")
        for name, meaning in (
            ("MasterOffset", "Shift of the leading values"),
            ("MasterScaling", "Factor of the leading values"),
            ("SlaveOffset", "Shift of the following values"),
            ("SlaveScaling", "Factor of the following values"),
        )
    ),
    ("Offset", "LREAL", "position", "Offset of the following value, the shift of a cam included."),
    *(
        (f"{part}.{quantity}", "LREAL", quantity.lower(), f"{meaning}: {quantity.lower()}.")
        for part, meaning in (
            ("EffectiveLeadingValue", "Effective leading value"),
            ("FunctionFollowingValue", "Following value of the synchronous function"),
        )
        for quantity in ("Position", "Velocity", "Acceleration")
    ),
    ("PhaseShift", "LREAL", "position", "Shift of the leading value by MC_Phasing..."),
    (
        "FunctionLeadingValue.Position",
        "LREAL",
        "position",
        "Leading position of the function: effective leading value and phase shift.",
    ),
)
"""Variables of `StatusSynchronizedMotion` that the catalogue of axis functions does not have (SYN-034 to
SYN-041): name, data type, kind of unit, meaning.
"""


_PROXY_BITS: Final = {
    "0": "Control", "1": "Error", "2": "RestartActive", "3": "OnlineStartValuesChanged",
    "4": "LeadingValueValid", "5": "LeadingValueModulo", "6": "LeadingAxisControl",
}  # fmt: skip
_PROXY_WORDS: Final = {
    "0": "System", "1": "Config", "2": "User", "3": "CommandNotAccepted", "7": "Communication",
}  # fmt: skip
_LONGEST_DELAY: Final = 1e9
_PROXY: Final = (
    (["Position", "LREAL", "RON", "position", 0.0, None, None], "Leading position for the local followers."),
    (["Velocity", "LREAL", "RON", "velocity", 0.0, None, None], "Leading velocity for the local followers."),
    (
        ["Acceleration", "LREAL", "RON", "acceleration", 0.0, None, None],
        "Leading acceleration for the local followers.",
    ),
    (["Interface.AddressIn", "VREF", "RON", "address", 0, 0, 65535], "Input address of the telegram."),
    (
        ["Parameter.LocalLeadingValueDelayTime", "LREAL", "DIR", "time", 0.0, 0.0, _LONGEST_DELAY],
        "Delay of the local follower that gives the leading value to a further controller.",
    ),
    (
        ["Parameter.ToleranceTimeExternalLeadingValueInvalid", "LREAL", "DIR", "time", 0.0, 0.0, 1e12],
        "Time without a valid external leading value until the alarm.",
    ),
    (
        ["StatusExternalLeadingValue.ModuloLength", "LREAL", "RON", "position", 0.0, 0.0, 1e12],
        "Modulo length of the external leading value.",
    ),
    (
        ["StatusExternalLeadingValue.ModuloStartValue", "LREAL", "RON", "position", 0.0, *_POSITION_RANGE],
        "Modulo start value of the external leading value.",
    ),
    (
        ["StatusExternalLeadingValue.AdjustmentTime", "LREAL", "RON", "time", 0.0, *_POSITION_RANGE],
        "Above 0 the external leading value is extrapolated by this time, below 0 interpolated.",
    ),
    (["StatusWord", "DWORD", "RON", "", 0, None, None, {"bits": _PROXY_BITS}], "Status."),
    (["ErrorWord", "DWORD", "RON", "", 0, None, None, {"bits": _PROXY_WORDS}], "Errors."),
    (["WarningWord", "DWORD", "RON", "", 0, None, None, {"bits": _PROXY_WORDS}], "Warnings."),
    (["ErrorDetail.Number", "UDINT", "RON", "", 0, None, None], "Number of the alarm."),
    (
        ["ErrorDetail.Reaction", "DINT", "RON", "", 0, None, None],
        "Its reaction: 0 none, 13 the leading value becomes invalid.",
    ),
)
"""Variables of the leading-axis proxy, which the catalogue of axis functions does not have (SYN-395 to
SYN-402), with their meaning.
"""


def _synchronous_rows() -> list[list[Any]]:
    return [
        [
            f"StatusSynchronizedMotion.{name}",
            data_type,
            "RON",
            unit,
            *((0.0, *_POSITION_RANGE) if data_type == "LREAL" else (0, None, None)),
        ]
        for name, data_type, unit, _ in _SYNCHRONOUS
    ]


def _synchronous_texts() -> list[list[Any]]:
    return [[f"StatusSynchronizedMotion.{name}", text] for name, _, _, text in _SYNCHRONOUS]


def _variable(entry: dict[str, Any]) -> list[Any]:
    """Return path, data type, access, unit, initial value, minimum, maximum and,
    where there is more, the rest.
    """
    limits = entry.get("range") or {"min": None, "max": None}
    unit = entry["unit"]
    row: list[Any] = [
        entry["path"],
        entry["data_type"],
        entry["access"],
        "" if unit == "none" else unit,
        entry["initial"]["value"],
        limits["min"],
        limits["max"],
    ]
    more: dict[str, Any] = {}
    if entry["kind"] == "enum":
        more["enum"] = {
            str(value["value"]): value["name"]
            for value in entry["enum"]
            if not str(value["name"]).startswith("INVALID")
        }
    if entry["kind"] == "bitword":
        more["bits"] = {str(bit["bit"]): bit["name"] for bit in entry["bits"] if bit["name"]}
    variants = entry.get("range_variants")
    if variants:
        more["variants"] = {variant["when"]: [variant["min"], variant["max"]] for variant in variants}
    if entry["initial"]["basis"] == "source":
        more["vendor"] = 1
    return [*row, more] if more else row


def _texts(entry: dict[str, Any]) -> list[Any]:
    """Return path and meaning of a variable and, where it has two values, what FALSE and TRUE mean."""
    row: list[Any] = [entry["path"], (entry["description"] or "").strip()]
    if entry["kind"] == "bool" and entry.get("enum"):
        row.append([value["meaning"] for value in sorted(entry["enum"], key=lambda one: one["value"])])
    return row


def variable_texts(source: dict[str, Any]) -> dict[str, Any]:
    """Return the content of `variable_texts.json`."""
    texts = {
        name: [
            _texts(variable)
            for section in entry["sections"]
            for variable in section["variables"]
            if variable["kind"] != "struct"
        ]
        for name, entry in source["objects"].items()
    }
    texts["SynchronousAxis"] += _synchronous_texts()
    texts["LeadingAxisProxy"] = [[row[0], text] for row, text in _PROXY]
    return texts


_ADDRESS_PARTS: Final = {
    "RID": ("DWORD", (1 << 32) - 1),
    "Area": ("BYTE", (1 << 8) - 1),
    "DbNumber": ("UINT", (1 << 16) - 1),
    "Offset": ("UDINT", (1 << 32) - 1),
}
"""Parts of a `VREF` that are written one by one (LIM-071), with their type and greatest value."""


def _rows(entry: dict[str, Any]) -> list[list[Any]]:
    """Return the rows of a variable: one, or those of its parts where it is
    an address that can be written.
    """
    row = _variable(entry)
    if entry["data_type"] != "VREF" or entry["access"] == "RON":
        return [row]
    return [
        [f"{row[0]}.{part}", kind, row[2], row[3], 0, 0, high]
        for part, (kind, high) in _ADDRESS_PARTS.items()
    ]


def variables(source: dict[str, Any]) -> dict[str, Any]:
    """Return the content of `to_variables.json`."""
    objects = {}
    for name, entry in source["objects"].items():
        rows = [
            row
            for section in entry["sections"]
            for variable in section["variables"]
            if variable["kind"] != "struct"
            for row in _rows(variable)
        ]
        if name == "SynchronousAxis":
            rows += _synchronous_rows()
        objects[name] = {"inherits": entry["inherits"], "variables": rows}
    objects["LeadingAxisProxy"] = {"inherits": None, "variables": [row for row, _ in _PROXY]}
    parameters = [
        {
            "number": entry["parameter_number"],
            "variable": entry["variable"],
            "name": entry["name"],
            "data_type": entry["data_type"],
            "default": entry["default"],
            "objects": entry["objects"],
        }
        for entry in source["write_parameter"]
    ]
    return {"objects": objects, "parameters": parameters}


def _causes(texts: Iterable[str]) -> list[str]:
    """Return the causes, each complete in itself: the source continues one with `... p1520` in the next."""
    complete: list[str] = []
    head = ""
    for text in texts:
        text = re.sub(r"^\d+: ", "", text)  # noqa: PLW2901 - the number of a cause is its place in the list
        if text.startswith("... "):
            complete.append(f"{head}: {text[4:]}")
        else:
            complete.append(text)
            head = text.split(":")[0]
    return complete


def _alarm(entry: dict[str, Any]) -> dict[str, Any]:
    error_bit, error_name = _bit(entry["error_word_bit"])
    warning_bit, warning_name = _bit(entry["warning_word_bit"])
    codes = [reaction["code"] for reaction in entry["reactions"] if reaction["for"].startswith(_AXIS)]
    by_type = {reaction["for"]: reaction["code"] for reaction in entry["reactions"]}
    by_type = {kind: code for kind, code in by_type.items() if not kind.startswith(_AXIS)}
    shown = {other["for"]: other["code"] for other in entry.get("reaction_code_shown_by_non_axis_to", ())}
    restart = entry["restart_required"]
    made: dict[str, Any] = {
        "number": entry["number"],
        "name": entry["name"],
        "text": entry["text"],
        "class": entry["alarm_class"],
        "reactions": codes,
        "restart": restart if isinstance(restart, bool) else None,
        "diagnostic_buffer": entry["diagnostic_buffer"],
        "error_bit": error_bit,
        "warning_bit": warning_bit,
        "bit_name": error_name or warning_name,
        "applies_to": entry["applies_to"],
        "source": ", ".join(_DOCUMENTS[key] for key in entry["source"].split(", ")),
    }
    if by_type or shown:
        made["other_reactions"] = by_type | shown
    if entry["number"] in _STAYS_ENABLED:
        made["stays_enabled"] = _STAYS_ENABLED[entry["number"]]
    causes = _causes(cause["cause"] for cause in entry.get("causes", ()))
    if causes:
        made["causes"] = causes
    return made


def alarms(source: dict[str, Any]) -> dict[str, Any]:
    """Return the content of `technology_alarms.json`."""
    return {
        "alarms": [_alarm(entry) for entry in source["technology_alarms"]],
        "error_ids": [
            {"value": entry["value"], "text": entry["meaning"], "parameters": entry.get("parameters", [])}
            for entry in source["error_ids"]
        ],
    }


def _write(path: Path, content: dict[str, Any]) -> None:
    """Write `content` with one line per row, so that a change of the data is
    readable as a change of lines.
    """
    text = json.dumps(content, ensure_ascii=False, separators=(",", ":"))
    text = re.sub(
        r'(?<=[\]}]),(?=\["[A-Z][^"]*","|\{"(?:number|value)":|"[A-Z]\w+":\{"inherits)', ",\n", text
    )
    path.write_text(text + "\n", encoding="utf-8")


def main() -> None:
    """Read the two catalogues named on the command line and write the data files."""
    if len(sys.argv) != 3:
        raise SystemExit(__doc__)
    folder = Path(__file__).parent
    made = (
        (("to_variables", variables), ("variable_texts", variable_texts)),
        (("technology_alarms", alarms),),
    )
    for files, path in zip(made, sys.argv[1:], strict=True):
        source = yaml.safe_load(Path(path).read_text(encoding="utf-8"))
        for name, convert in files:
            _write(folder / f"{name}.json", convert(source))


if __name__ == "__main__":
    main()
