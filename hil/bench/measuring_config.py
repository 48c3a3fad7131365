"""`[measuring_input.NAME]` of a bench file: a measuring input technology object."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from hil.bench._table import Table


class MeasuringInputTable(Table, frozen=True):
    """`[measuring_input.NAME]`: a measuring input of the drive of an axis, or of an encoder:
    `bench.measuring_input("NAME")`.
    """

    of: str
    """Axis or external encoder whose positions it measures."""
    probe: Literal[1, 2] = 1
    """Probe input of the device (`Parameter.PROFIdriveProbeNumber`)."""
    kind: Literal["telegram", "central"] = "telegram"
    """`Parameter.MeasuringInputType` 2 or 1: by the telegram of the axis, which measures once only, or by a
    central probe, which measures cyclically, too. The device latches the position in either case.
    """
    correction_ms: Annotated[float, Field(ge=-1000.0, le=1000.0)] = 0.0
    """How much later than its edge the signal comes (`Parameter.CorrectionTime`)."""
