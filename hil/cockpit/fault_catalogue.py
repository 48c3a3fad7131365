"""The kinds of faults for one bench: what they may hit, their parameters, and what this bench cannot do."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from fieldbus.errors import ConfigurationError, HilError, UnsupportedFaultError
from hil.faults import CATALOGUE, TRIGGERS, ArmedFault, Fault, FaultType, Injector
from hil.faults._kind import TargetKind

if TYPE_CHECKING:
    from hil.bench.bench import Bench
    from reports.json_types import JsonObject

_PARTS: Final[dict[TargetKind, str]] = {
    "segment": "segment",
    "drive": "emulated drive",
    "axis": "axis",
    "switch": "emulated drive",
    "mechanics": "emulated drive",
    "encoder": "emulated drive or encoder",
    "station": "I/O station",
    "controller": "controller",
    "cam": "cam",
    "proxy": "leading-axis proxy",
}
"""What each kind of target is the name of."""


def targets(bench: Bench, kind: FaultType) -> tuple[str, ...]:
    """Return the names of what a kind of fault may hit on a bench; that of the controller is empty."""
    drives = bench.drive_names
    encoders = (*bench.encoder_names, *bench.second_encoder_names)
    by_kind: dict[TargetKind, Sequence[str]] = {
        "segment": bench.segment_names,
        "drive": drives,
        "axis": (*bench.axis_names, *bench.nc_axis_names),
        "switch": drives,
        "mechanics": drives,
        "encoder": (*drives, *encoders),
        "station": bench.station_names,
        "controller": ("",),
        "cam": bench.cam_names,
        "proxy": bench.proxy_names,
    }
    return tuple(by_kind[kind.target])


def why_not(bench: Bench, kind: FaultType, target: str) -> str:
    """Return why a bench cannot inject a fault into a target; empty: it can, with the right parameters.

    The fault is made as it would be to be armed, and not armed.
    """
    parameters = dict(kind.example.get("parameters", {}))
    try:
        ArmedFault(Injector(bench), Fault(kind.name, target, parameters=parameters), 0)
    except UnsupportedFaultError as error:
        return str(error).removeprefix(f"{kind.name} cannot be injected: ")
    except ConfigurationError as error:
        # The values of the example are for its bench; a part that is of another sort is of this one.
        return "" if ".parameters" in error.where else str(error)
    except HilError as error:
        return str(error)
    return ""


def describe(bench: Bench) -> list[JsonObject]:
    """Return all kinds of faults for a bench, in the order of the handbook.

    `targets` are the names that may be hit; `reason` says why none can be, else it is empty.
    """
    found: list[JsonObject] = []
    for kind in CATALOGUE:
        names = targets(bench, kind)
        reasons = [why_not(bench, kind, name) for name in names]
        good = [name for name, reason in zip(names, reasons, strict=True) if not reason]
        reason = "" if good else next(iter(reasons), f"this bench has no {_PARTS[kind.target]}")
        plain = kind.to_dict()
        found.append(
            {
                "name": kind.name,
                "family": kind.seam[0].upper() + kind.seam[1:],
                "summary": kind.summary,
                "remark": kind.remark,
                "target": kind.target,
                "targets": good,
                "reason": reason,
                "lasting": kind.lasting,
                "counted": kind.counted,
                "parameters": [
                    {**shown, "allowed": one.allowed}
                    for shown, one in zip(_listed(plain["parameters"]), kind.parameters, strict=True)
                ],
            }
        )
    return found


def _listed(value: object) -> list[JsonObject]:
    assert isinstance(value, list)  # as `FaultType.to_dict` makes it
    return value


def triggers() -> list[JsonObject]:
    """Return the forms of triggers, for a choice."""
    return [{"when": when, "summary": form.summary, "live": form.live} for when, form in TRIGGERS.items()]


def stand(armed: ArmedFault, waiting: str) -> JsonObject:
    """Return how an armed fault stands.

    Args:
        armed: The fault.
        waiting: What came in place of its trigger; empty: it has come, or nobody has looked.

    """
    fault = armed.fault
    ends = f"until {fault.until}" if fault.until is not None else ""
    if fault.duration_s is not None:
        ends = f"for {fault.duration_s:g} s"
    return {
        "number": armed.number,
        "kind": fault.kind,
        "target": armed.target,
        "parameters": dict(fault.parameters),
        "stands": armed.stands,
        "trigger": str(fault.trigger),
        "ends": ends,
        "applications": armed.applications,
        "applied_s": None if armed.applied_ns is None else armed.applied_ns * 1e-9,
        "removed_s": None if armed.removed_ns is None else armed.removed_ns * 1e-9,
        "waiting": "" if armed.over or armed.active else waiting,
    }
