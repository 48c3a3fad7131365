"""The campaigns that ship with the product, and their short names."""

from __future__ import annotations

import difflib
import importlib
import inspect
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from hil.errors import CannotRunError

PACKAGE: Final = "testcases.campaigns"
"""The package that the shipped campaigns and matrix files are in."""
VOCABULARY: Final = f"{PACKAGE}.vocabulary:VOCABULARY"
"""The vocabulary of the shipped matrix files."""


@dataclass(frozen=True)
class ShippedCampaign:
    """A campaign module or matrix file of the product."""

    name: str
    """Short name, and name of the module or of the matrix file without `.toml`."""
    matrix: bool = False
    """Whether it is a matrix file."""
    demo: bool = False
    """Whether `hil demo` runs it."""
    seeding: tuple[str, ...] = ()
    """Benches on which its cases judge seeded defects (`hil mutants`); `own`: the bench of each case;
    `pairwise`: a configuration for each case; `nc`: the bench of each case with axes of an NC; `nc-pairwise`:
    a configuration for each case that has no numbers of its bench, with axes of an NC.
    """

    @property
    def reference(self) -> str:
        """What finds it in any process: `package.module`, or `package:matrix.toml`."""
        return f"{PACKAGE}:{self.name}.toml" if self.matrix else f"{PACKAGE}.{self.name}"

    @property
    def summary(self) -> str:
        """First sentence of its documentation; this imports a module."""
        if not self.matrix:
            text = inspect.getdoc(importlib.import_module(self.reference)) or ""
            return " ".join(text.partition("\n\n")[0].split()).rstrip(".")
        (folder,) = importlib.import_module(PACKAGE).__path__
        first = (Path(folder) / f"{self.name}.toml").read_text(encoding="utf-8").partition("\n")[0]
        return first.lstrip("# ").rstrip(".")


_BOTH: Final = ("reference", "profidrive")
_WITH_NC: Final = (*_BOTH, "nc")

SHIPPED: Final = (
    ShippedCampaign(
        "stop_modes", demo=True, seeding=(*_WITH_NC, "analog", "stepper", "pairwise", "nc-pairwise")
    ),
    ShippedCampaign("fault_reactions", demo=True, seeding=_WITH_NC),
    ShippedCampaign("drive_faults", demo=True, seeding=_WITH_NC),
    ShippedCampaign("telegram_faults", demo=True, seeding=("profidrive", "nc")),
    ShippedCampaign("axis_faults", seeding=_BOTH),
    ShippedCampaign("homing", seeding=_WITH_NC),
    ShippedCampaign("axis_signals", seeding=("reference",)),
    ShippedCampaign("holding_brake", seeding=("own",)),
    ShippedCampaign("cia402_drive", seeding=("own",)),
    ShippedCampaign("cia402_modes", seeding=("own",)),
    ShippedCampaign("cia402_details", seeding=("own",)),
    ShippedCampaign("cia402_homing", seeding=("own",)),
    ShippedCampaign("cia402_options", seeding=("own",)),
    ShippedCampaign("vendor_drives", seeding=("own",)),
    ShippedCampaign("personalities", seeding=("own",)),
    ShippedCampaign("drives_of_eds", seeding=("own",)),
    ShippedCampaign("canopen_services", seeding=("own",)),
    ShippedCampaign("canopen_device", seeding=("own",)),
    ShippedCampaign("device_objects", seeding=("own",)),
    ShippedCampaign("device_again", seeding=("own",)),
    ShippedCampaign("as_new", seeding=("own",)),
    ShippedCampaign("machine_law", seeding=("own",)),
    ShippedCampaign("machine_parts", seeding=("own",)),
    ShippedCampaign("servo_core", seeding=("own",)),
    ShippedCampaign("drive_parts", seeding=("own",)),
    ShippedCampaign("io_parts", seeding=("own",)),
    ShippedCampaign("device_settings", seeding=("own",)),
    ShippedCampaign("canopen_master", seeding=("own",)),
    ShippedCampaign("fault_ends", seeding=("own", f"{PACKAGE}.fault_ends:GUARDED", "analog", "stepper")),
    ShippedCampaign("fault_effects", seeding=("own",)),
    ShippedCampaign("eds_files", seeding=("own",)),
    ShippedCampaign("time_and_logs", seeding=("own",)),
    ShippedCampaign("bus_parts", seeding=("own",)),
    ShippedCampaign("can_bus", seeding=("own",)),
    ShippedCampaign("can_traffic", seeding=("own",)),
    ShippedCampaign("can_adapter", seeding=("own",)),
    ShippedCampaign("ads_device", seeding=("own",)),
    ShippedCampaign("analog_drive", seeding=("own",)),
    ShippedCampaign("bus_log", seeding=("own",)),
    ShippedCampaign("node_guarding", seeding=("own",)),
    ShippedCampaign("nc_axes", seeding=("own",)),
    ShippedCampaign("nc_machines", seeding=("own",)),
    ShippedCampaign("nc_options", seeding=("own",)),
    ShippedCampaign("nc_components", seeding=("own",)),
    ShippedCampaign("nc_situations", seeding=("own",)),
    ShippedCampaign("nc_drives", seeding=("own",)),
    ShippedCampaign("profidrive_words", seeding=("own",)),
    ShippedCampaign("profidrive_positioner", seeding=("own",)),
    ShippedCampaign("profidrive_speed", seeding=("own",)),
    ShippedCampaign("profidrive_parameters", seeding=("own",)),
    ShippedCampaign("profidrive_options", seeding=("own",)),
    ShippedCampaign("profidrive_facts", seeding=("own",)),
    ShippedCampaign("parameter_access", seeding=("own",)),
    ShippedCampaign("profidrive_channels", seeding=("own",)),
    ShippedCampaign("profidrive_safety", seeding=("own",)),
    ShippedCampaign("pulse_module", seeding=("own",)),
    ShippedCampaign("control_unit", seeding=("own",)),
    ShippedCampaign("modbus_faults", seeding=("own",)),
    ShippedCampaign("modbus_stations", seeding=("own",)),
    ShippedCampaign("modbus_services", seeding=("own",)),
    ShippedCampaign("axis_motion", seeding=("own", "pairwise")),
    ShippedCampaign("modulo_axis", seeding=("own",)),
    ShippedCampaign("repeated", seeding=(*_BOTH, "pairwise")),
    ShippedCampaign("initial_states", seeding=("own", "pairwise")),
    ShippedCampaign("limits", seeding=("reference", "analog", "nc")),
    ShippedCampaign("monitoring", seeding=("reference", "nc")),
    ShippedCampaign("control", seeding=("profidrive",)),
    ShippedCampaign("instructions", seeding=("own",)),
    ShippedCampaign("job_dynamics", seeding=("own", "pairwise")),
    ShippedCampaign("instruction_makes", seeding=("own",)),
    ShippedCampaign("axis_options", seeding=("own",)),
    ShippedCampaign("axis_services", seeding=("own",)),
    ShippedCampaign("axis_borders", seeding=("own", "pairwise")),
    ShippedCampaign("axis_values", seeding=("own",)),
    ShippedCampaign("axis_configurations", seeding=("own",)),
    ShippedCampaign("limits_in_motion", seeding=("own", "pairwise")),
    ShippedCampaign("job_queue", seeding=("own",)),
    ShippedCampaign("rare_jobs", seeding=("own",)),
    ShippedCampaign("object_lifecycles", seeding=("own",)),
    ShippedCampaign("stops_meet", seeding=("own",)),
    ShippedCampaign("drive_parameters", seeding=("own",)),
    ShippedCampaign("library", seeding=("own",)),
    ShippedCampaign("homing_anywhere", seeding=("own", "pairwise")),
    ShippedCampaign("measuring_inputs", seeding=("own",)),
    ShippedCampaign("motion_in", seeding=("reference",)),
    ShippedCampaign("encoders", seeding=("own",)),
    ShippedCampaign("encoder_states", seeding=("own",)),
    ShippedCampaign("external_encoder", seeding=(f"{PACKAGE}.external_encoder:REFERENCE",)),
    ShippedCampaign("commissioning", seeding=("reference",)),
    ShippedCampaign("gearing", seeding=("own",)),
    ShippedCampaign("controllers", seeding=("own",)),
    ShippedCampaign("controller_data", seeding=("own",)),
    ShippedCampaign("cams", seeding=("own",)),
    ShippedCampaign("camming", seeding=("own",)),
    ShippedCampaign("leading_values", seeding=("own",)),
    ShippedCampaign("synchronising", seeding=("own",)),
    ShippedCampaign("synchronous_jobs", seeding=("own",)),
    ShippedCampaign("stops_of_jobs", matrix=True),
    ShippedCampaign("stops_on_stops", matrix=True),
    ShippedCampaign("faults_in_stops", matrix=True),
    ShippedCampaign("alarm_reactions", matrix=True),
    ShippedCampaign("communication_loss", matrix=True),
    ShippedCampaign("power_faults", matrix=True),
    ShippedCampaign("encoder_faults", matrix=True),
    ShippedCampaign("synchronous_faults", matrix=True),
)
"""All of them; `hil run` lists them in this order."""

_BY_NAME: Final = {campaign.name: campaign for campaign in SHIPPED}


def references(campaigns: Iterable[ShippedCampaign]) -> list[str]:
    """Return what `find_campaigns` takes for these."""
    return [campaign.reference for campaign in campaigns]


def expand_short_name(reference: str) -> str:
    """Return the reference that a short name stands for; any other reference is returned unchanged.

    Raises:
        CannotRunError: A file or folder here has the same name, so that either could be meant.

    """
    shipped = _BY_NAME.get(reference)
    if shipped is None:
        return reference
    for here in (Path(reference), Path(f"{reference}.py"), Path(f"{reference}.toml")):
        if here.exists():
            raise CannotRunError(
                f"{reference!r} could be the shipped campaign or {here} in this folder: give "
                f"{shipped.reference} or ./{here}"
            )
    return shipped.reference


def similar_short_name(reference: str) -> str:
    """Return a hint at the shipped campaign with the most similar name; empty: none is similar."""
    near = difflib.get_close_matches(reference.replace("-", "_").lower(), _BY_NAME, n=1)
    return f" (did you mean {near[0]!r}?)" if near else ""
