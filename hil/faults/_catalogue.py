"""All kinds of faults, in the order of the handbook."""

from __future__ import annotations

from typing import Final

from fieldbus.errors import UnknownNameError
from hil.faults._kind import Family, FaultType
from hil.faults.kinds import (
    axis,
    cam,
    can,
    controller,
    drive,
    encoder,
    frame,
    io,
    machine,
    modbus,
    proxy,
    safety,
    telegram,
)
from hil.faults.seams import members

FAMILIES: Final[tuple[Family, ...]] = (
    frame.FAMILY,
    can.FAMILY,
    drive.FAMILY,
    safety.FAMILY,
    telegram.FAMILY,
    modbus.FAMILY,
    machine.FAMILY,
    encoder.FAMILY,
    encoder.OWN_DEVICES,
    io.FAMILY,
    controller.FAMILY,
    axis.FAMILY,
    cam.FAMILY,
    proxy.FAMILY,
)
CATALOGUE: Final[tuple[FaultType, ...]] = tuple(kind for family in FAMILIES for kind in family.kinds)

_BY_NAME: Final = {entry.name: entry for entry in CATALOGUE}


def fault_type(name: str) -> FaultType:
    """Return the definition of a kind of fault.

    Raises:
        UnknownNameError: No such kind; the message proposes near ones.

    """
    entry = _BY_NAME.get(name)
    if entry is None:
        raise UnknownNameError("fault.kind", name, "a kind of fault", _BY_NAME, listed_by="hil faults")
    return entry


def _methods(*targets: str) -> frozenset[str]:
    return frozenset(
        name
        for entry in CATALOGUE
        if entry.target in targets and entry.effect.needs is not None
        for name in members(entry.effect.needs)
    )


DRIVE_METHODS: Final = _methods("drive", "switch", "mechanics", "encoder")
"""Methods of a drive that faults call, the motor encoder included: what the process of the drives may
be asked.
"""
ENCODER_FAULT_METHODS: Final = _methods("encoder")
"""Methods of an encoder that faults call."""
