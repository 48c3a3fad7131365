"""Drive parameters as objects of a CANopen dictionary (PD-343), and the abort codes for refused ones."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

from fieldbus.canopen.abort import AbortCode, SdoAbort
from fieldbus.canopen.dictionary import Entry, Value
from fieldbus.errors import ConfigurationError
from fieldbus.profidrive import TypeCode
from fieldbus.profidrive.errors import ParameterAccessError
from fieldbus.profidrive.requests import ParameterError

if TYPE_CHECKING:
    from emulators.drive.profidrive.parameters.definitions import ParameterDefinition
    from emulators.drive.profidrive.parameters.store import ParameterStore

FIRST_INDEX: Final = 0x2000
OFFSETS: Final = (0, 10_000, 20_000, 30_000)
"""By p8630[2]."""
WINDOW: Final = 10_000
"""Parameters that can be seen at a time: 2000h to 470Fh."""
PAGE: Final = 256
"""Elements that can be seen at a time."""

ABORT_CODES: Final = MappingProxyType(
    {
        ParameterError.NUMBER: 0x06020000,
        ParameterError.READ_ONLY: 0x06010002,
        ParameterError.LIMIT: 0x06090030,
        ParameterError.SUB_INDEX: 0x06090011,
        ParameterError.NO_ARRAY: 0x06090011,
        ParameterError.TYPE: 0x06070010,
        ParameterError.RESET_ONLY: 0x06090030,
        ParameterError.NO_CONTROL: 0x08000021,
        ParameterError.OPERATING_STATE: 0x08000022,
        ParameterError.VALUE: 0x06090030,
        0x6B: 0x08000022,
        0x77: 0x08000022,
        0xC8: 0x06090032,
        0xC9: 0x06090031,
    }
)
"""Abort code of CiA 301 by error number of the parameter; any other is 08000000h."""
GENERAL_ERROR: Final = 0x08000000


def abort_code(error: int) -> int:
    """Return the abort code of an error number."""
    return ABORT_CODES.get(error, GENERAL_ERROR)


@dataclass(frozen=True)
class ParameterWindow:
    """What p8630 lets be seen of the parameters.

    Args:
        enabled: p8630[0] = 1; otherwise no parameter is an object.
        page: p8630[1], 0..255: element of sub-index 0 is 256 * page.
        offset: p8630[2], 0..3: parameter of index 2000h.

    Raises:
        ConfigurationError: A value is out of its range.

    """

    enabled: bool = True
    page: int = 0
    offset: int = 0

    def __post_init__(self) -> None:
        if not 0 <= self.page <= 0xFF:
            raise ConfigurationError("p8630[1]", self.page, "0..255")
        if not 0 <= self.offset < len(OFFSETS):
            raise ConfigurationError("p8630[2]", self.offset, "0..3")

    def parameter(self, index: int, sub_index: int) -> tuple[int, int] | None:
        """Return parameter number and element of an object; None for an object that is no parameter."""
        if not self.enabled or not 0 <= index - FIRST_INDEX < WINDOW or not 0 <= sub_index <= 0xFF:
            return None
        number = index - FIRST_INDEX + OFFSETS[self.offset]
        return (number, PAGE * self.page + sub_index) if number else None

    def object(self, number: int, element: int = 0) -> tuple[int, int] | None:
        """Return index and sub-index of an element; None where it cannot be seen through this window."""
        place, sub_index = number - OFFSETS[self.offset], element - PAGE * self.page
        if not self.enabled or number <= 0 or not 0 <= place < WINDOW or not 0 <= sub_index <= 0xFF:
            return None
        return FIRST_INDEX + place, sub_index


_WINDOW: Final = 8630
"""The parameter that moves the window; it is an object itself, whatever it says."""
_DATA_TYPES: Final = {
    TypeCode.N2: 0x03,
    TypeCode.N4: 0x04,
    TypeCode.V2: 0x06,
    TypeCode.OCTET_STRING: 0x05,
    TypeCode.VISIBLE_STRING: 0x05,
}
"""CiA 301 data type where its code differs from that of the profile; strings are arrays of bytes (PD-209)."""


class ParameterObjects:
    """The parameters as objects in addition to those of the dictionary, through the window
    of p8630; see `ForeignObjects`.

    Args:
        store: The parameters; p8630 is among them.

    """

    def __init__(self, store: ParameterStore) -> None:
        self._store = store

    @property
    def window(self) -> ParameterWindow:
        """What the window of p8630 shows at present; an offset without parameters shows nothing."""
        enabled, page, offset = (int(value) for value in self._store.values(_WINDOW, 0, 3))
        known = offset < len(OFFSETS)
        return ParameterWindow(enabled=enabled == 1 and known, page=page, offset=offset if known else 0)

    def _place(self, index: int, sub: int) -> tuple[int, int] | None:
        if index == FIRST_INDEX + _WINDOW:
            return _WINDOW, sub
        return self.window.parameter(index, sub)

    def entry(self, index: int, sub: int) -> Entry | None:
        """Return a parameter that the window shows as an object; None: there is none."""
        place = self._place(index, sub)
        definition = None if place is None else self._store.definition(place[0])
        if place is None or definition is None:
            return None
        if place[1] >= definition.elements:
            raise SdoAbort(AbortCode.NO_SUB_INDEX)
        return Entry(
            _variable(definition, index, sub, writable=self._store.is_writable(place[0])),
            node_id=0,
            name=definition.name,
        )

    def read(self, entry: Entry) -> Value:
        """Return the present value of the parameter."""
        number, element = self._found(entry)
        refused = self._store.refusals.get(number)
        if refused is not None:
            raise SdoAbort(abort_code(refused))
        try:
            return self._store.value(number, element)
        except ParameterAccessError as error:
            raise SdoAbort(abort_code(error.error)) from None

    def write(self, entry: Entry, value: Value) -> None:
        """Write the parameter by all its rules."""
        number, element = self._found(entry)
        assert isinstance(value, (int, float))
        try:
            self._store.write(number, value, element)
        except ParameterAccessError as error:
            raise SdoAbort(abort_code(error.error)) from None

    def _found(self, entry: Entry) -> tuple[int, int]:
        place = self._place(entry.index, entry.sub)
        if place is None:  # the window has moved since the transfer began
            raise SdoAbort(AbortCode.NO_OBJECT)
        return place


def _variable(definition: ParameterDefinition, index: int, sub: int, *, writable: bool) -> object:
    from canopen.objectdictionary import ODVariable

    variable = ODVariable(definition.name, index, sub)
    variable.data_type = _DATA_TYPES.get(definition.type, int(definition.type))
    variable.access_type = "rw" if writable else "ro"
    variable.pdo_mappable = False
    return variable
