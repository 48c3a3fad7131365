"""The variables of a technology object: paths, access classes, start values and values in effect.

Every variable has a start value in load memory and a value in effect (VAR-216). What may write it and when a
write takes effect follows from its access class: DIR, CAL, RES or RON (section 1 of the variable guide).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from math import isnan
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from fieldbus.errors import ConfigurationError, UnknownNameError, similar_names
from motion.kernel.cell import Cell
from motion.s7.data._variables import (
    ParameterError,
    UnknownVariableError,
    Variable,
    VariableAccessError,
    VariableError,
    elements,
    object_types,
    parameters_of,
    paths_of,
    variables_of,
)
from motion.s7.units import UnitFactors, unit_factors

if TYPE_CHECKING:
    from fieldbus.history import History

__all__ = [
    "ParameterError",
    "StoredVariable",
    "UnknownVariableError",
    "Variable",
    "VariableAccessError",
    "VariableError",
    "VariableStore",
    "Violation",
    "elements",
    "object_types",
    "refused_values",
    "variables_of",
]

ERROR_PARAMETER_NUMBER: Final = 0x805A
ERROR_PARAMETER_TYPE: Final = 0x805C
ERROR_PARAMETER_VALUE: Final = 0x8FFF

_BIT: Final = re.compile(r"(.+)\.%?X(\d+)$")
_WORDS: Final = ("DWORD", "WORD")
_NO_FACTORS: Final = UnitFactors()
"""The units of the user program are those of the runtime."""


class Violation(NamedTuple):
    """A start value that prevents a restart (alarm 101)."""

    path: str
    value: float
    allowed: str

    def __str__(self) -> str:
        return f"{self.path} = {self.value}; allowed: {self.allowed}"


class StoredVariable:
    """A variable in the store: start value, value in effect, and what an assignment waits to become.

    Everything but `cell` is in the units of the user program.
    """

    __slots__ = ("cell", "factor", "path", "shown", "start", "variable", "written")

    def __init__(self, path: str, variable: Variable | None, value: float) -> None:
        self.path = path
        self.variable = variable
        """Definition; None for a parameter of `MC_WriteParameter` that is no variable."""
        self.cell: Cell[float] = Cell(value)
        """Value in effect, in the unit of the runtime (`motion.s7.units`)."""
        self.factor = 1.0
        """What one unit of the user program is in the unit of the runtime."""
        self.shown = value
        """Value in effect, in the unit of the user program; counts where `factor` is not 1."""
        self.start = value
        """Start value in load memory."""
        self.written: float | None = None
        """Value that takes effect with the next `VariableStore.latch`; None without."""

    def put(self, given: float) -> None:
        """Put a value in the unit of the user program into force."""
        self.shown = given
        self.cell.value = given if self.factor == 1.0 else given * self.factor

    @property
    def given(self) -> float:
        """Value in effect in the unit of the user program."""
        return self.cell.value if self.factor == 1.0 else self.shown


def _first_what_rules(values: Mapping[str, object]) -> list[str]:
    """Return the paths, first what rules ranges and units of the others."""
    return sorted(values, key=lambda path: not path.startswith(("Properties.MotionType", "Units.")))


def refused_values(object_type: str, values: Mapping[str, object]) -> list[ConfigurationError]:
    """Return what is wrong with the start values of a configuration, each by itself; empty: nothing.

    Args:
        object_type: `SpeedAxis`, `PositioningAxis`, `SynchronousAxis` or `ExternalEncoder`.
        values: Values by path.

    """
    store = VariableStore(object_type)
    found = []
    for path in _first_what_rules(values):
        error = store.refusal(path, values[path])
        if error is None:
            store.put_configured(path, values[path])
        else:
            found.append(error)
    return found


class VariableStore:
    """All variables of one technology object.

    Paths are those of the technology data block, with array elements (`Sensor[1].Type`) and bits
    (`StatusWord.X7`, `StatusWord.%X7`).

    Args:
        object_type: `SpeedAxis`, `PositioningAxis`, `SynchronousAxis` or `ExternalEncoder`.
        start_values: Configuration: values by path, in place of the initial ones.
        sensors: Number of encoders that exist, 1 to 4 (VAR-027); for axes with an array of them.
        name: Source of history events.
        history: Log for refused assignments.
        on_programming_error: Called with path and value of an assignment that starts OB 121.

    Raises:
        ConfigurationError: Unknown object type or path, or a value out of its type or range.

    """

    def __init__(
        self,
        object_type: str,
        start_values: Mapping[str, object] | None = None,
        *,
        sensors: int = 1,
        name: str = "",
        history: History | None = None,
        on_programming_error: Callable[[str, object], None] | None = None,
    ) -> None:
        self.object_type = object_type
        self.online_start_values_changed = False
        """Whether restart-relevant start values wait for a restart (`StatusWord.X3`)."""
        self.on_start_value: Callable[[str], None] | None = None
        """Called with the path of a start value that has been written."""
        self._name = name or object_type
        self._history = history
        self._on_programming_error = on_programming_error
        self._variables: dict[str, StoredVariable] = {}
        variables = self._variables
        for path, variable in paths_of(object_type):
            variables[path] = StoredVariable(path, variable, variable.initial)
        self._parameters = parameters_of(object_type)
        self._parameter_cells = {
            number: StoredVariable(parameter.name, None, parameter.default)
            for number, parameter in self._parameters.items()
            if parameter.variable is None
        }
        self._stale: dict[str, StoredVariable] = {}
        self.pending: list[StoredVariable] = []
        """DIR values that are assigned and not in force yet (VAR-001)."""
        self._motion = variables.get("Properties.MotionType", StoredVariable("", None, 0))
        for number in range(1, 5):
            existent = variables.get(f"Sensor[{number}].Existent")
            if existent is not None:
                existent.cell.value = existent.start = number <= sensors
        if start_values:
            self._configure(start_values)
        self.factors = (
            unit_factors(
                self.read_int,
                speed_axis=object_type == "SpeedAxis",
                encoder=object_type == "ExternalEncoder",
            )
            if "Units.VelocityUnit" in variables
            else _NO_FACTORS
        )
        """What the units of the user program are within the runtime (CFG-072)."""
        if self.factors != _NO_FACTORS:
            for stored in variables.values():
                factor = self.factors.of(stored.variable.unit) if stored.variable is not None else 1.0
                if factor != 1.0:
                    stored.factor = factor
                    stored.put(stored.cell.value)

    # -- reading
    # ----------------------------------------------------------------------------------------------

    def bind(self, path: str) -> Cell[Any]:
        """Return the stored of a variable, to read its `value` in every cycle without a look-up by name.

        That value is in the unit of the runtime; `read` returns the one that a user program sees (CFG-072).

        Raises:
            UnknownVariableError: There is no such variable; bits have no stored of their own.

        """
        return self._stored(path).cell

    def read(self, path: str) -> int | float:
        """Return the value of a variable or bit as a user program reads it.

        An assigned DIR value is read back at once, before it takes effect (VAR-002).

        Raises:
            UnknownVariableError: There is no such variable.

        """
        stored = self._variables.get(path)
        if stored is None:
            word, bit = self._bit(path)
            return bool(int(word.cell.value) >> bit & 1)
        return stored.given if stored.written is None else stored.written

    def read_int(self, path: str) -> int:
        """Return what `read` does, of an integer variable."""
        return int(self.read(path))

    def read_bool(self, path: str) -> bool:
        """Return what `read` does, of a BOOL variable or a bit."""
        return bool(self.read(path))

    def start_value(self, path: str) -> float:
        """Return the start value of a variable in load memory."""
        return self._stored(path).start

    def describe(self, path: str) -> Variable:
        """Return the definition of a variable: type, access class, unit, range, names of values and bits."""
        variable = self._stored(path).variable
        assert variable is not None  # cells without one cannot be reached by a path
        return variable

    def unit(self, path: str) -> str:
        """Return the unit of a variable in the units configured for the object,
        such as `mm/s`; empty without.
        """
        token = self.describe(path).unit
        if token in ("velocity", "torque", "force", "mass", "inertia"):
            return self._unit(token.capitalize())
        length = self._unit("Length") or "1"
        return {
            "position": length,
            "acceleration": f"{length}/s2",
            "jerk": f"{length}/s3",
            "position/revolution": f"{length}/rev",
            "inertia_or_mass": f"{self._unit('Inertia')} or {self._unit('Mass')}",
            "time": "s",
            "percent": "%",
        }.get(token, token)

    def paths(self, access: str | None = None) -> Iterator[str]:
        """Return all paths in the order of the data block, or those of one access class."""
        for path, stored in self._variables.items():
            variable = stored.variable
            if access is None or (variable is not None and variable.access == access):
                yield path

    def parameter(self, number: int) -> StoredVariable:
        """Return a restart-relevant parameter of `MC_WriteParameter`: 1010 T_i, 1011 T_o, 1012
        T_DC in s.
        """
        return self._parameter_cells[number]

    @property
    def _motion_type(self) -> int:
        return int(self._motion.cell.value)

    def _stored(self, path: str) -> StoredVariable:
        found = self._variables.get(path)
        return self._miss(path) if found is None else found

    # -- writing by the user program
    # --------------------------------------------------------------------------

    def write(self, path: str, value: object) -> None:
        """Assign a variable as a user program does.

        DIR takes effect with the next `latch`, CAL at once for every reader at the call of an
        instruction. An LREAL outside its range becomes the nearest bound, silently; any other value outside
        its range is dropped and starts OB 121 (VAR-015).

        Raises:
            UnknownVariableError: There is no such variable.
            VariableAccessError: The variable is restart-relevant or read only (VAR-009).
            VariableError: The value has the wrong type.

        """
        stored = self._variables.get(path)
        if stored is None:
            stored, _ = self._bit(path)
            variable = stored.variable
            if variable is not None and variable.access in ("DIR", "CAL"):
                raise VariableAccessError(f"{path}: single bits of {stored.path} cannot be assigned")
        variable = stored.variable
        assert variable is not None  # as in `describe`
        access = variable.access
        if access == "RES":
            raise VariableAccessError(
                f"{path} is restart-relevant (RES): write its start value in load memory (write_start), "
                "then restart the technology object (MC_Reset with Restart = TRUE)"
            )
        if access == "RON":
            raise VariableAccessError(f"{path} is read only (RON)")
        converted = variable.convert(path, value)
        if not variable.permits(converted, self._motion_type):
            if variable.data_type != "LREAL" or isnan(converted):
                self._programming_error(path, value)
                return
            low, high = variable.limits(self._motion_type)
            assert low is not None  # without a range every number but NaN is permitted
            assert high is not None
            converted = low if converted < low else high
        self._log_write(stored, converted)
        if access == "CAL":
            stored.put(converted)
            return
        if stored.written is None:
            self.pending.append(stored)
        stored.written = converted

    def write_start(self, path: str, value: object) -> None:
        """Write a start value in load memory (`WRIT_DBL`); it takes effect with the next restart (VAR-005).

        A value outside its range is kept and reported by `restart` (VAR-018).

        Raises:
            UnknownVariableError: There is no such variable.
            VariableAccessError: The variable is read only.
            VariableError: The value has the wrong type.

        """
        stored = self._stored(path)
        variable = self.describe(path)
        if variable.access == "RON":
            raise VariableAccessError(f"{path} is read only (RON)")
        stored.start = variable.convert(path, value)
        self._log_write(stored, stored.start, start=True)
        if variable.access == "RES":
            self._mark(stored)
        if self.on_start_value is not None:
            self.on_start_value(path)

    def write_parameter(self, number: int, value: object) -> None:
        """Write a parameter as `MC_WriteParameter` does.

        1000 and 1020 change their variable at once, until the next restart (VAR-010, VAR-013); 1010 to 1012
        take effect with a restart and outlast further ones (VAR-011, VAR-012).

        Raises:
            ParameterError: Carries the ErrorID of the rejection.

        """
        parameter = self._parameters.get(number)
        if parameter is None:
            allowed = ", ".join(map(str, self._parameters))
            raise ParameterError(
                f"parameter {number} does not exist; there are {allowed}", ERROR_PARAMETER_NUMBER
            )
        if parameter.variable is None:
            if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 <= value < 1e12:
                raise ParameterError(
                    f"{parameter.name} takes a time in s, not {value!r}", ERROR_PARAMETER_TYPE
                )
            stored = self._parameter_cells[number]
            stored.start = float(value)
            self._mark(stored)
            return
        stored = self._stored(parameter.variable)
        variable = self.describe(parameter.variable)
        if variable.data_type == "BOOL" and not isinstance(value, bool):
            raise ParameterError(f"{parameter.variable} takes a BOOL, not {value!r}", ERROR_PARAMETER_TYPE)
        try:
            converted = variable.convert(parameter.variable, value)
        except VariableError as error:
            raise ParameterError(str(error), ERROR_PARAMETER_TYPE) from error
        if not variable.permits(converted, self._motion_type):
            raise ParameterError(
                f"{parameter.variable} cannot become {value!r}; allowed: "
                f"{variable.allowed(self._motion_type)}",
                ERROR_PARAMETER_VALUE,
            )
        self._log_write(stored, converted)
        stored.put(converted)

    # -- the runtime's side
    # -----------------------------------------------------------------------------------

    def latch(self) -> bool:
        """Put assigned DIR values into force; the axis calls it at the start of MC_Servo (VAR-001).

        Returns:
            Whether there were any.

        """
        if not self.pending:
            return False
        for stored in self.pending:
            if stored.written is not None:
                stored.put(stored.written)
            stored.written = None
        self.pending.clear()
        return True

    def set_internal(self, path: str, value: float) -> None:
        """Set the value in effect of any variable or bit, without access class and range: for the runtime
        itself, in its units.
        """
        stored = self._variables.get(path)
        if stored is not None:
            stored.cell.value = value
            if stored.factor != 1.0:
                stored.shown = value / stored.factor
            return
        stored, bit = self._bit(path)
        word = int(stored.cell.value)
        stored.cell.value = word | 1 << bit if value else word & ~(1 << bit)

    def preset(self, path: str, value: float) -> None:
        """Set start value and value in effect of any variable: a download of what
        the device says, not of the user.
        """
        stored = self._stored(path)
        stored.start = value
        stored.put(value)

    def violations(self) -> tuple[Violation, ...]:
        """Return the start values that are not permitted, so that a restart ends with alarm 101."""
        motion_type = self._motion_type
        found = []
        for path, stored in self._variables.items():
            variable = stored.variable
            if (
                variable is not None
                and variable.access != "RON"
                and not variable.permits(stored.start, motion_type)
            ):
                found.append(Violation(path, stored.start, variable.allowed(motion_type)))
        return tuple(found)

    def restart(self) -> tuple[Violation, ...]:
        """Put all start values into force together (VAR-006, VAR-227); RON variables keep their values.

        Returns:
            Nothing when it is done. Otherwise the start values that are not permitted (alarm 101); then no
            variable has changed, and `online_start_values_changed` stays.

        """
        violations = self.violations()
        if violations:
            return violations
        for stored in self._variables.values():
            if stored.variable is not None and stored.variable.access != "RON":
                stored.put(stored.start)
                stored.written = None
        for stored in self._parameter_cells.values():
            stored.cell.value = stored.start
        self.pending.clear()
        self._stale.clear()
        self.online_start_values_changed = False
        return ()

    def power_cycle(self) -> tuple[Violation, ...]:
        """Restart after power off and on: what `MC_WriteParameter` wrote is lost, too (VAR-012, VAR-227)."""
        for number, stored in self._parameter_cells.items():
            stored.start = self._parameters[number].default
        return self.restart()

    def load(self, values: Mapping[str, object]) -> Callable[[], None]:
        """Load start values of any access class, as a download does; they take effect with `power_cycle`.

        Returns:
            The function that takes them back.

        Raises:
            ConfigurationError: A variable does not exist, or a value is out of its type or range; then
                nothing is loaded.

        """
        before = {
            stored: (stored.start, stored.cell.value)
            for path in values
            if (stored := self._variables.get(path))
        }

        def take_back() -> None:
            for stored, (start, value) in before.items():
                stored.start, stored.cell.value = start, value

        try:
            self._configure(values)
        except ConfigurationError:
            take_back()
            raise
        return take_back

    # -- inside
    # -----------------------------------------------------------------------------------------------

    def _configure(self, values: Mapping[str, object]) -> None:
        """Load start values of any access class, as a download does; first what rules
        ranges and units of the others.
        """
        for path in _first_what_rules(values):
            error = self.refusal(path, values[path])
            if error is not None:
                raise error
            self.put_configured(path, values[path])

    def put_configured(self, path: str, value: object) -> None:
        """Put a start value of the configuration, which nothing speaks against, into force."""
        stored = self._variables[path]
        stored.start = self.describe(path).convert(path, value)
        stored.put(stored.start)

    def refusal(self, path: str, value: object) -> ConfigurationError | None:
        """Return what is wrong with a start value of the configuration; None: nothing."""
        if path not in self._variables:
            return UnknownNameError(
                "", path, f"a variable of {self.object_type}", self._variables, listed_by="hil variables"
            )
        variable = self.describe(path)
        motion_type = self._motion_type
        try:
            if variable.permits(variable.convert(path, value), motion_type):
                return None
        except VariableError:
            pass
        allowed = f"{variable.data_type}, {variable.allowed(motion_type)} {self.unit(path)}"
        return ConfigurationError(path, value, allowed.rstrip())

    def _mark(self, stored: StoredVariable) -> None:
        """Keep account of start values that differ from the values in effect."""
        if stored.start == stored.given:
            self._stale.pop(stored.path, None)
        else:
            self._stale[stored.path] = stored
        self.online_start_values_changed = bool(self._stale)

    def _log_write(self, stored: StoredVariable, value: float, *, start: bool = False) -> None:
        """Record an assignment; `start`: of a start value, which waits for a restart."""
        if self._history is None:
            return
        details: dict[str, float | str] = {"variable": stored.path, "value": value}
        if stored.factor != 1.0:
            details["in_runtime_unit"] = value * stored.factor
        if start:
            details["start"] = True
        self._history.emit(self._name, "program.write", **details)

    def _programming_error(self, path: str, value: object) -> None:
        """Record an assignment that the controller answers with OB 121."""
        if self._history is not None:
            self._history.emit(self._name, "program.error", ob=121, path=path, value=repr(value))
        if self._on_programming_error is not None:
            self._on_programming_error(path, value)

    def _bit(self, path: str) -> tuple[StoredVariable, int]:
        """Return word and number of the bit named `path`."""
        found = _BIT.match(path)
        stored = self._variables.get(found[1]) if found else None
        if found is None or stored is None:
            return self._miss(path), 0
        variable = stored.variable
        bit = int(found[2])
        bits = 16 if variable is not None and variable.data_type == "WORD" else 32
        if variable is None or variable.data_type not in _WORDS or bit >= bits:
            raise UnknownVariableError(f"{path}: {found[1]} has no bit {bit}")
        return stored, bit

    def _miss(self, path: str) -> StoredVariable:
        raise UnknownVariableError(f"{self.object_type} has no variable {path!r}{self._similar(path)}")

    def _similar(self, path: str) -> str:
        near = similar_names(path, self._variables)
        return f"; {near}" if near else ""

    def _unit(self, quantity: str) -> str:
        """Return the name of the unit configured for `quantity`; empty where the object has none."""
        stored = self._variables.get(f"Units.{quantity}Unit")
        if stored is None or stored.variable is None:
            return ""
        return stored.variable.enum.get(int(stored.cell.value), "").removesuffix(" (6 decimals)")
