"""`[controller.NAME]` and `[proxy.NAME]` of a bench file: more than one controller on a bench."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from hil.bench._table import Table
from hil.bench.axis_config import StartValues, check_variables
from hil.bench.bench_config import Cpu


class ControllerTable(Table, frozen=True):
    """`[controller.NAME]`: one more controller beside that of `[bench]`, with the same cycles.

    It has the axes that name it (`plc`), its own user program and operating state. The buses stay those of
    the first controller; cams and external encoders, too.
    """

    cpu: Cpu = "S7-1500T"
    """Kind of controller, as in `[bench]`."""
    phase_us: Annotated[int, Field(ge=0)] | None = None
    """Instant within the bus cycle at which its application cycle runs, below `cycle_ms`; none: that of the
    first controller.
    """


class ProxyTable(Table, frozen=True):
    """`[proxy.NAME]`: a leading-axis proxy, with which an axis of one controller leads axes of another one:
    `bench.proxy("NAME")`.

    The axes that follow have its name in `leading`. Its leading axis sends a telegram in every cycle.
    """

    axis: str
    """Leading axis, of another controller."""
    plc: str | None = None
    """Controller that has the proxy, of `[controller.NAME]`; none: that of `[bench]`."""
    interface: Annotated[int, Field(ge=1, le=32)] = 1
    """Number of the output of the leading axis, `CrossPlcSynchronousOperation.Interface[n]`, whose
    `EnableLeadingValueOutput` is TRUE where the bench file does not say it.
    """
    delay_us: Annotated[int, Field(ge=1)] = 1000
    """Time that a telegram takes; more than `cycle_ms` is more than the proxy makes up for."""
    variables: StartValues = {}
    """Start values of the technology object, by original path."""

    @model_validator(mode="after")
    def _has_what_it_says(self) -> ProxyTable:
        check_variables("LeadingAxisProxy", self.variables)
        return self
