"""`[nc]`: what the axes with `controller = "nc"` have in common."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from annotated_types import Unit
from pydantic import Field, ValidationError, model_validator

from fieldbus.clock import MS
from fieldbus.errors import ConfigurationError
from hil.bench._table import Table, sentence
from hil.bench.nc_axis_config import ParameterValue
from motion.nc.parameters import ParameterSet, check_parameter
from motion.nc.project import Licence
from motion.nc.retain import RetainStore
from motion.nc.tables import Table as NcTableOfPoints
from motion.nc.tables import TableSpace


class ValveTable(Table, frozen=True):
    """`[nc.valve_table.NAME]`: a valve characteristic."""

    points: tuple[tuple[float, float], ...]
    """Share of the velocity of full scale and share of the output, one after the other, the first rising."""


class NcTable(Table, frozen=True):
    """`[nc]`: what the axes with `controller = "nc"` have in common."""

    licence: str = "TF5020"
    """TF5000 has 10 axes, TF5010 25, TF5020 255."""
    additional_axes: Annotated[int, Field(ge=0)] = 0
    """Axes on top of those that the licence includes."""
    svb_ms: Annotated[float, Field(gt=0.0), Unit("ms")] | None = None
    """Cycle of the SVB task, rounded up to bus cycles; none: 10 ms."""
    retain_file: str | None = None
    """File of the retain data (`task.retain_data`), relative to the bench file; none: they last as long as
    the bench. A run depends on the one before it then.
    """
    parameters: dict[str, ParameterValue] = {}
    """Parameters of the tasks by key (`task.`), in quotes ([NC axes](nc-axis.md))."""
    valve_table: dict[str, ValveTable] = {}
    """Valve characteristics by their id, a number of 1 or more, for `drv.valve_table_id`."""

    @model_validator(mode="after")
    def _possible(self) -> NcTable:
        problems = []
        for key, value in self.parameters.items():
            try:
                check_parameter(key, value, of_task=True)
            except ConfigurationError as error:
                problems.append(sentence(str(error).removeprefix(f"{key}: "), ("parameters", key), value))
        if problems:
            raise ValidationError.from_exception_data("NcTable", problems)
        try:
            self.build_licence()
            self.add_tables(TableSpace())
        except ConfigurationError as error:
            raise ValueError(str(error)) from None
        return self

    def build_licence(self) -> Licence:
        """Return the licence.

        Raises:
            ConfigurationError: There is no such licence.

        """
        return Licence(self.licence, self.additional_axes)

    def build_retain(self) -> RetainStore:
        """Return where positions are kept."""
        return RetainStore(None if self.retain_file is None else Path(self.retain_file))

    def build_parameters(self) -> ParameterSet:
        """Return the parameters of the tasks."""
        return ParameterSet(self.parameters)

    @property
    def svb_ns(self) -> int | None:
        """Cycle of the SVB task, ns; None: the default."""
        return None if self.svb_ms is None else round(self.svb_ms * MS)

    def add_tables(self, tables: TableSpace) -> None:
        """Store the valve characteristics.

        Raises:
            ConfigurationError: An id is no number, or the points do not fit.

        """
        for name, one in self.valve_table.items():
            if not name.isdecimal():
                raise ConfigurationError("nc.valve_table", name, "a number of 1 or more")
            tables.add(NcTableOfPoints("valve", one.points), int(name))
