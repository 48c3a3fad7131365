"""Make `parameters.json` of this package from the catalogue of the specification.

    python -m motion.nc.data._generate nc_parameters.yaml

Needed by developers only, together with PyYAML; the product reads the JSON file.
"""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from typing import Any, Final

import yaml

_OTHER_DEFAULTS: Final[dict[str, Any]] = {
    "task.watchdog_cycles": 10,
    "task.cycle_exceed_monitoring": True,
    "task.retain_data": "None",
    "task.symbol_names_fixed": True,
    "axis.axis_type": "Standard (Mapping via Encoder and Drive)",
    "enc.time_comp_mode": "OFF",
    "drv.time_comp_mode": "OFF",
}
"""Defaults of this product where the source shows none (section 23 of the specification, no. 20 for the
watchdog); every other one is 0, FALSE or the first choice.
"""
_PREFIX: Final = {"axis": "axis", "encoder": "enc", "drive": "drv", "controller": "ctrl"}
"""Prefix of the keys of a component."""
_ZEROS: Final[dict[str, Any]] = {"bool": False, "float": 0.0, "uint32": 0, "string": ""}


_MAGNITUDES: Final = (
    "reference_velocity", "maximum_acceleration", "maximum_deceleration", "default_acceleration",
    "default_deceleration", "default_jerk", "homing_velocity_towards_cam", "homing_velocity_off_cam",
    "manual_velocity_fast", "manual_velocity_slow", "fast_acceleration", "fast_deceleration", "fast_jerk",
    "rapid_traverse_velocity",
)  # fmt: skip
"""Dynamic parameters of axes that are magnitudes (NC-089)."""


def _limits(text: str | None) -> tuple[float | None, float | None, bool]:
    """Return lower and upper limit of a range in words, and whether the lower one is excluded."""
    if text is None:
        return None, None, False
    if found := re.fullmatch(r"(-?[\d.]+) \.\. (-?[\d.]+)", text):
        return float(found[1]), float(found[2]), False
    if found := re.fullmatch(r"(>=?) ([\d.]+)", text):
        return float(found[2]), None, found[1] == ">"
    return (0.0, None, False) if text.startswith((">= 0", "0 ")) else (None, None, False)


def _parameter(entry: dict[str, Any]) -> dict[str, Any]:
    kind, key = entry["type"], entry["key"]
    default = entry["default"]
    if default is None:
        default = _OTHER_DEFAULTS.get(key, entry["enum"][0] if kind == "enum" else _ZEROS.get(kind))
    low, high, above = _limits(entry["range"])
    if key.removeprefix("axis.") in _MAGNITUDES:
        low = 0.0
    choices = entry["enum"] or []
    if key == "enc.type":
        choices = [choices[0], "Hardware encoder"]
    row = {
        "key": key,
        "name": entry["name"],
        "component": entry["component"],
        "group": entry["group"],
        "type": kind,
        "unit": entry["unit"] or "",
        "default": default,
        "choices": choices,
        "min": low,
        "max": high,
        "above": above,
        "effect": entry["effect"],
        "requirement": entry["requirement"],
        "aliases": [
            f"{_PREFIX[place.split(' ')[0].rstrip(':')]}.{key.split('.')[1]}"
            for place in entry.get("also_in") or []
        ],
    }
    if entry.get("controller_types"):
        row["controller_types"] = entry["controller_types"]
    return row


def main() -> None:
    """Write the data file."""
    catalogue = yaml.safe_load(Path(sys.argv[1]).read_text(encoding="utf-8"))
    rows = [_parameter(entry) for entry in catalogue["parameters"]]
    types = catalogue["controller_types"]
    rows.append(
        _parameter(
            {
                "key": "ctrl.type",
                "name": "Type (NC-Controller)",
                "component": "controller",
                "group": "NC-Controller",
                "type": "enum",
                "unit": None,
                "default": types[0],
                "enum": types,
                "range": None,
                "effect": "Selects the control law and with it the parameters that the controller has.",
                "requirement": "",
            }
        )
    )
    text = "[\n" + ",\n".join(json.dumps(row, ensure_ascii=False) for row in rows) + "\n]\n"
    Path(__file__).with_name("parameters.json").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
