"""The parameters of a drive object: values, hooks of the device, access rules, saving (PD-233 to PD-285).
Knows no bus.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Final

from emulators.drive.profidrive.parameters.definitions import (
    ParameterDefinition,
    WriteRule,
    factory_definitions,
)
from fieldbus.profidrive import TypeCode
from fieldbus.profidrive.errors import ParameterAccessError
from fieldbus.profidrive.requests import ParameterError, Refusal

LIST_LENGTH: Final = 117
"""Elements of PNU 980 to 999: what one answer of words holds."""
ALL_LISTS: Final = range(980, 990)
CHANGED_LISTS: Final = range(990, 1000)

_NOT_IN_COMMISSIONING: Final = 0x6B
_PULSES_ENABLED: Final = 0x77
_BELOW: Final = 0xC8
_ABOVE: Final = 0xC9

Reader = Callable[[int], int | float]
"""Returns the present value of an element; gets its sub-index."""
Writer = Callable[[int, int | float], None]
"""Takes a value for an element; raises `ParameterAccessError` to refuse it with its error number."""


class ParameterStore:
    """Parameters of one drive object.

    The device connects itself by `readers` and `writers`; parameters without hooks keep their values here.

    Args:
        definitions: The parameters; None = those of the emulated drive.

    """

    def __init__(self, definitions: Iterable[ParameterDefinition] | None = None) -> None:
        self._definitions: dict[int, ParameterDefinition] = {}
        self._values: dict[int, list[int | float]] = {}
        self._saved: dict[int, tuple[int | float, ...]] | None = None
        self._numbers: tuple[int, ...] | None = None
        self.readers: Final[dict[int, Reader]] = {}
        """Parameters whose value the device computes."""
        self.writers: Final[dict[int, Writer]] = {}
        """Parameters of which the device takes note."""
        self.limits: Final[dict[int, Callable[[], tuple[float, float]]]] = {}
        """Limits in effect that are narrower than those of the definition; refused with C8h and C9h (PD-231).
        """
        self.locked: Final[set[int]] = set()
        """Parameters that can only be read for the time being, such as PNU 922 set by
        the bus configuration (PD-235).
        """
        self.refusals: Final[dict[int, int]] = {}
        """Parameters whose every access is refused with this number: 65h deactivated, or what a fault
        injection wants.
        """
        self.switching_on_inhibited: Callable[[], bool] = lambda: True
        """Whether the axis is in S1."""
        self.pulses_enabled: Callable[[], bool] = lambda: False
        """Whether the motor has torque."""
        for definition in factory_definitions() if definitions is None else definitions:
            self.define(definition)
        for number in (*ALL_LISTS, *CHANGED_LISTS):
            self.define(_list_definition(number))

    # -- what there is ---------------------------------------------------------------------------------

    def define(self, definition: ParameterDefinition) -> None:
        """Add a parameter, or put another definition in its place; it has its factory value."""
        self._definitions[definition.number] = definition
        self._values[definition.number] = list(definition.defaults)
        self._numbers = None

    def definition(self, number: int) -> ParameterDefinition | None:
        """Return a parameter; None if there is none of this number."""
        return self._definitions.get(number)

    def numbers(self) -> tuple[int, ...]:
        """Return the numbers of all parameters, ascending (PD-256)."""
        if self._numbers is None:
            self._numbers = tuple(sorted(self._definitions))
        return self._numbers

    def changed(self) -> tuple[int, ...]:
        """Return the numbers of parameters that differ from the factory setting, ascending (PD-257)."""
        return tuple(number for number in self.numbers() if self.is_changed(number))

    def is_changed(self, number: int) -> bool:
        """Return whether a parameter that is saved differs from its factory setting."""
        definition = self._definitions[number]
        if not self._is_setting(definition):
            return False
        return self.values(number, 0, definition.elements) != definition.defaults

    # -- the device's side -----------------------------------------------------------------------------

    def value(self, number: int, sub_index: int = 0) -> int | float:
        """Return the present value of an element, as its data type can show it.

        Raises:
            ParameterAccessError: There is no such parameter or element, or its value is not available.

        """
        return self.values(number, sub_index, 1)[0]

    def values(self, number: int, start: int, count: int) -> tuple[int | float, ...]:
        """Return the present values of several elements, as their data type can show them.

        Raises:
            ParameterAccessError: There is no such parameter or element, or its value is not available.

        """
        definition = self._found(number, start)
        self._found(number, start + count - 1)
        if number in ALL_LISTS or number in CHANGED_LISTS:
            return self._list(number)[start : start + count]
        reader = self.readers.get(number)
        if reader is None:
            return tuple(self._values[number][start : start + count])
        return tuple(definition.fitted(reader(at)) for at in range(start, start + count))

    def text(self, number: int) -> str:
        """Return a string, which is an array of bytes (PD-209)."""
        definition = self._found(number, 0)
        raw = bytes(int(value) for value in self.values(number, 0, definition.elements))
        return raw.rstrip(b"\0").decode("latin-1")

    def set(self, number: int, value: float, sub_index: int = 0) -> None:
        """Set the value of an element from inside the drive: no access rule counts, and no writer is called.

        Raises:
            ParameterAccessError: There is no such parameter or element.

        """
        definition = self._found(number, sub_index)
        self._values[number][sub_index] = definition.fitted(value)

    def set_text(self, number: int, text: str) -> None:
        """Set a string from inside the drive; what is too long is cut."""
        size = self._found(number, 0).elements
        for at, byte in enumerate(text.encode("latin-1", "replace")[:size].ljust(size, b"\0")):
            self.set(number, byte, at)

    # -- writing from outside --------------------------------------------------------------------------

    def check_value(self, number: int, sub_index: int, value: float) -> Refusal | None:
        """Return why a value may not be written for what it is; None if it may
        (PD-212, PD-222, PD-216, PD-231).
        """
        definition = self._definitions[number]
        low, high = definition.limits
        if not low <= value <= high:
            return Refusal(ParameterError.LIMIT, sub_index)
        if definition.values and value not in definition.values:
            return Refusal(ParameterError.VALUE, sub_index)
        if definition.write is WriteRule.RESET and value != 0:
            return Refusal(ParameterError.RESET_ONLY, sub_index)
        in_force = self.limits.get(number)
        if in_force is not None:
            low, high = in_force()
            if value < low:
                return Refusal(_BELOW)
            if value > high:
                return Refusal(_ABOVE)
        return None

    def check_state(self, number: int) -> Refusal | None:
        """Return why a parameter may not be written at present; None if it may (PD-219, PD-221, PD-231)."""
        if number != 927 and 927 in self._definitions and not self.value(927):
            return Refusal(ParameterError.NO_CONTROL)
        rule = self._definitions[number].write
        if rule is WriteRule.INHIBITED and not self.switching_on_inhibited():
            return Refusal(ParameterError.OPERATING_STATE)
        if rule is WriteRule.PULSES_OFF and self.pulses_enabled():
            return Refusal(_PULSES_ENABLED)
        if rule is WriteRule.COMMISSIONING and not self.commissioning:
            return Refusal(_NOT_IN_COMMISSIONING)
        return None

    @property
    def commissioning(self) -> bool:
        """Whether the device or the drive is in commissioning (p0009, p0010)."""
        return any(number in self._definitions and self.value(number) for number in (9, 10))

    def is_writable(self, number: int) -> bool:
        """Return whether a parameter can be written in any state."""
        return self._definitions[number].write is not WriteRule.NEVER and number not in self.locked

    def put(self, number: int, sub_index: int, value: float) -> None:
        """Write an element that `check_value` and `check_state` have let pass; the device takes note of it.

        Raises:
            ParameterAccessError: The device refuses it; nothing has changed.

        """
        definition = self._found(number, sub_index)
        fitted = definition.fitted(value)
        writer = self.writers.get(number)
        if writer is not None:
            writer(sub_index, fitted)
        self._values[number][sub_index] = fitted

    def write(self, number: int, value: float, sub_index: int = 0) -> None:
        """Write one element by all rules, as the bus does.

        Raises:
            ParameterAccessError: It is refused; `error` is the number.

        """
        self._found(number, sub_index)
        if number in self.refusals:
            raise ParameterAccessError(f"parameter {number}", self.refusals[number])
        if not self.is_writable(number):
            raise ParameterAccessError(f"parameter {number} cannot be changed", ParameterError.READ_ONLY)
        refusal = self.check_value(number, sub_index, value) or self.check_state(number)
        if refusal is not None:
            raise ParameterAccessError(f"parameter {number}: {refusal.text}", refusal.error)
        self.put(number, sub_index, value)

    # -- saving ----------------------------------------------------------------------------------------

    def save(self) -> None:
        """Keep all settings over power-off (PNU 971)."""
        self._saved = {
            number: self.values(number, 0, definition.elements)
            for number, definition in self._definitions.items()
            if self._is_setting(definition)
        }

    @property
    def saved(self) -> dict[str, list[int | float]]:
        """What is saved, as JSON can hold it: values by parameter number."""
        return {str(number): list(values) for number, values in (self._saved or {}).items()}

    @saved.setter
    def saved(self, values: Mapping[str, Sequence[int | float]]) -> None:
        known = {int(number): tuple(row) for number, row in values.items() if number.isdecimal()}
        self._saved = {
            number: row
            for number, row in known.items()
            if number in self._definitions and len(row) == self._definitions[number].elements
        }

    def load(self) -> None:
        """Take the settings that were saved last; without any the factory settings.
        What is not saved returns to its default.
        """
        self._take(self._saved or {})

    def factory_reset(self) -> None:
        """Take the factory settings (p0970 = 1). What was saved stays saved."""
        self._take({})

    def _take(self, wanted: dict[int, tuple[int | float, ...]]) -> None:
        for number, definition in self._definitions.items():
            if number in self.locked or definition.write is WriteRule.NEVER:
                continue
            row = wanted.get(number, definition.defaults)
            if row == self.values(number, 0, definition.elements):
                continue  # what is as it should be is left alone
            for at, value in enumerate(row):
                if not definition.save:
                    self._values[number][at] = value
                    continue
                try:
                    self.put(number, at, value)
                except ParameterAccessError:
                    continue  # the machine does not take it: what is in effect stays

    # -- inside ----------------------------------------------------------------------------------------

    def _found(self, number: int, sub_index: int) -> ParameterDefinition:
        definition = self._definitions.get(number)
        if definition is None:
            raise ParameterAccessError(f"there is no parameter {number}", ParameterError.NUMBER)
        if not 0 <= sub_index < definition.elements:
            raise ParameterAccessError(
                f"{definition.name} has no element {sub_index}", ParameterError.SUB_INDEX
            )
        return definition

    @staticmethod
    def _is_setting(definition: ParameterDefinition) -> bool:
        return definition.save and definition.write not in {WriteRule.NEVER, WriteRule.RESET}

    def _list(self, number: int) -> tuple[int, ...]:
        """Return one of the parameters that list parameters; its last element
        leads to the next list.
        """
        lists, numbers = (
            (ALL_LISTS, self.numbers()) if number in ALL_LISTS else (CHANGED_LISTS, self.changed())
        )
        length = LIST_LENGTH - 1
        start = (number - lists.start) * length
        page = numbers[start : start + length]
        more = len(numbers) > start + length and number + 1 in lists
        return (*page, *(0,) * (length - len(page)), number + 1 if more else 0)


def _list_definition(number: int) -> ParameterDefinition:
    return ParameterDefinition(
        number=number,
        type=TypeCode.UNSIGNED16,
        text="all parameters" if number in ALL_LISTS else "changed param.",
        size=LIST_LENGTH,
        defaults=(0,) * LIST_LENGTH,
        save=False,
    )
