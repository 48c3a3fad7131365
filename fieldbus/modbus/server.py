"""The server: a request PDU in, a response PDU out. No bytes of a line, no time, no threads."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from typing import Final

from fieldbus.errors import ConfigurationError
from fieldbus.modbus import _pymodbus as library
from fieldbus.modbus.codes import (
    LIMITS,
    WRITING,
    Diagnostic,
    ExceptionCode,
    Function,
)
from fieldbus.modbus.pdu import Request, Response, decode_request, encode_response, is_well_formed
from fieldbus.modbus.registers import Area, NoAnswer, RegisterMap

_F: Final = Function
_X: Final = ExceptionCode
_AREAS: Final[dict[int, Area]] = {
    _F.READ_COILS: Area.COILS,
    _F.READ_DISCRETE_INPUTS: Area.DISCRETE_INPUTS,
    _F.READ_HOLDING_REGISTERS: Area.HOLDING_REGISTERS,
    _F.READ_INPUT_REGISTERS: Area.INPUT_REGISTERS,
    _F.WRITE_SINGLE_COIL: Area.COILS,
    _F.WRITE_MULTIPLE_COILS: Area.COILS,
    _F.WRITE_SINGLE_REGISTER: Area.HOLDING_REGISTERS,
    _F.WRITE_MULTIPLE_REGISTERS: Area.HOLDING_REGISTERS,
}
_READS: Final = frozenset(function for function in _AREAS if function <= _F.READ_INPUT_REGISTERS)
SERVED: Final = frozenset(map(int, Function))
"""Function codes that are known at all."""
_BASIC, _REGULAR, _EXTENDED, _SPECIFIC = 1, 2, 3, 4
_GROUP_ENDS: Final = {_BASIC: 0x03, _REGULAR: 0x80, _EXTENDED: 0x100}

ExceptionHook = Callable[[int, bytes], int]
"""Called with unit and PDU of a request; returns the exception code to answer with, or 0."""


class ModbusServer:
    """A device that answers requests.

    Args:
        registers: What it shows.
        unit: Its address, 1..247; None answers every unit but never a broadcast of a serial line (MODB-040).
        functions: Function codes that it knows; default all of `Function`.
        limits: Largest quantities that differ from the standard's, by function (PD-287).
        identification: Objects of function 43/14 by number; 0, 1 and 2 (vendor, product code, revision) are
            mandatory. None: the function is unknown.

    """

    def __init__(
        self,
        registers: RegisterMap,
        *,
        unit: int | None = 1,
        functions: Collection[int] = tuple(Function),
        limits: Mapping[int, int] | None = None,
        identification: Mapping[int, bytes] | None = None,
    ) -> None:
        if unit is not None and not 1 <= unit <= 247:
            raise ConfigurationError("unit", unit, "1..247, or None for any")
        for function in functions:
            if function not in SERVED:
                raise ConfigurationError("functions", function, ", ".join(str(int(one)) for one in Function))
        for function, count in (limits or {}).items():
            highest = LIMITS.get(function, 0)
            if not 1 <= count <= highest:
                raise ConfigurationError(f"limits, function {function}", count, f"1..{highest}")
        self.registers = registers
        self.unit = unit
        self.functions = frozenset(functions)
        self.limits: dict[int, int] = {**LIMITS, **(limits or {})}
        self.identification = dict(sorted((identification or {}).items()))
        if identification is not None:
            self._check_identification()
        else:
            self.functions -= {_F.ENCAPSULATED_INTERFACE}
        self.powered = True
        """Whether the device has its supply; without it every request stays unanswered."""
        self.exception_hook: ExceptionHook | None = None
        """For faults: asked for every request with a known function before it is carried out."""
        self.powered = True
        """Whether the device has its supply; without it nothing is answered."""
        self.listen_only = False
        """Whether the device keeps silent until communications are restarted (MODB-016)."""
        self.restarts = 0
        """How often communications were restarted."""
        self._clear()

    def _check_identification(self) -> None:
        for number, value in self.identification.items():
            if not 0 <= number <= 255 or 0x07 <= number < 0x80:
                raise ConfigurationError("identification, object", number, "0..6, 128..255")
            if len(value) > 244:
                raise ConfigurationError(f"identification, object {number}", value, "at most 244 bytes")
        for number in (0, 1, 2):
            if number not in self.identification:
                raise ConfigurationError(
                    "identification", sorted(self.identification), f"object {number} too"
                )

    def _clear(self) -> None:
        self.bus_messages = 0
        self.bus_errors = 0
        self.exceptions = 0
        self.server_messages = 0
        self.no_responses = 0
        self.negative_acknowledges = 0
        self.busy = 0
        self.character_overruns = 0

    def addresses(self, unit: int) -> bool:
        """Return whether a unit is this device."""
        return self.unit is None or unit == self.unit

    def respond(
        self, pdu: bytes, *, serial: bool = False, broadcast: bool = False, unit: int = 1
    ) -> bytes | None:
        """Carry out a request and return the response, None where there is none.

        The order of the checks is that of MODB-032: function, quantity and structure, addresses, execution.

        Args:
            pdu: Function code and data, any bytes.
            serial: Whether it came over a serial line, where alone function 08 exists.
            broadcast: Whether it is for everybody; it is then carried out in silence (MODB-035).
            unit: Unit as received, for the exception hook.

        """
        if not pdu or not self.powered:
            return None
        self.server_messages += 1
        function = pdu[0]
        if broadcast:
            self.no_responses += 1
            if function in WRITING and not self.listen_only:
                self._answer(pdu, serial, unit)
            return None
        if self.listen_only:
            self.no_responses += 1
            if serial and function == _F.DIAGNOSTICS and pdu[1:3] == b"\x00\x01" and len(pdu) == 5:
                self._restart()
            return None
        request, response = self._answer(pdu, serial, unit)
        if response is None:
            self.no_responses += 1
            return None
        if isinstance(response, bytes):
            return response
        if response.exception:
            self.exceptions += 1
            if response.exception == _X.SERVER_DEVICE_BUSY:
                self.busy += 1
            elif response.exception == _X.NEGATIVE_ACKNOWLEDGE:
                self.negative_acknowledges += 1
            return library.exception_response(function & 0x7F, response.exception)
        return encode_response(request, response)

    def _answer(self, pdu: bytes, serial: bool, unit: int) -> tuple[Request, Response | bytes | None]:
        function = pdu[0]
        request = Request(function)
        if function not in self.functions or (function == _F.DIAGNOSTICS and not serial):
            return request, Response(function, exception=_X.ILLEGAL_FUNCTION)
        if not is_well_formed(pdu, self.limits):
            return request, Response(function, exception=_X.ILLEGAL_DATA_VALUE)
        if self.exception_hook is not None:
            code = self.exception_hook(unit, pdu)
            if code:
                return request, Response(function, exception=code)
        request = decode_request(pdu)
        try:
            return request, self._execute(request)
        except NoAnswer:
            return request, None

    def _execute(self, request: Request) -> Response | bytes | None:
        function = request.function
        registers = self.registers
        if function in _READS:
            return _read(function, registers.read(_AREAS[function], request.address, request.quantity))
        if function in WRITING:
            refused = registers.write(_AREAS[function], request.address, request.values)
            return Response(function, exception=refused or 0)
        if function == _F.DIAGNOSTICS:
            return self._diagnose(request)
        if function == _F.ENCAPSULATED_INTERFACE:
            return self._identify(request)
        holding = Area.HOLDING_REGISTERS
        if function == _F.MASK_WRITE_REGISTER:
            present = registers.read(holding, request.address, 1)
            if isinstance(present, ExceptionCode):
                return Response(function, exception=present)
            value = present[0] & request.and_mask | request.or_mask & ~request.and_mask & 0xFFFF
            return Response(function, exception=registers.write(holding, request.address, (value,)) or 0)
        # Both ranges are checked before anything is written; then writing comes first (MODB-020).
        if not registers.exists(holding, request.address, request.quantity):
            return Response(function, exception=_X.ILLEGAL_DATA_ADDRESS)
        refused = registers.write(holding, request.write_address, request.values)
        if refused is not None:
            return Response(function, exception=refused)
        return _read(function, registers.read(holding, request.address, request.quantity))

    # ------------------------------------------------------------------------------- function 08, diagnostics

    def _restart(self) -> None:
        self.listen_only = False
        self.restarts += 1
        self._clear()

    def _diagnose(self, request: Request) -> Response | None:
        function, code, data = request.function, request.code, request.data
        if code == Diagnostic.QUERY_DATA:
            return Response(function, data=data)
        if code == Diagnostic.RESTART_COMMUNICATIONS:
            if data not in (b"\x00\x00", b"\xff\x00"):
                return Response(function, exception=_X.ILLEGAL_DATA_VALUE)
            self._restart()
            return Response(function, data=data)
        if code not in Diagnostic._value2member_map_:
            return Response(function, exception=_X.ILLEGAL_FUNCTION)
        if data != b"\x00\x00":
            return Response(function, exception=_X.ILLEGAL_DATA_VALUE)
        if code == Diagnostic.LISTEN_ONLY:
            self.listen_only = True
            return None
        if code == Diagnostic.CLEAR_COUNTERS:
            self._clear()
            return Response(function, data=data)
        return Response(function, data=(self._counter(code) & 0xFFFF).to_bytes(2, "big"))

    def _counter(self, code: int) -> int:
        """Return a diagnostic counter; 0 for one that is not kept."""
        counters = {
            Diagnostic.BUS_MESSAGES: self.bus_messages,
            Diagnostic.BUS_ERRORS: self.bus_errors,
            Diagnostic.EXCEPTIONS: self.exceptions,
            Diagnostic.SERVER_MESSAGES: self.server_messages,
            Diagnostic.NO_RESPONSES: self.no_responses,
            Diagnostic.NEGATIVE_ACKNOWLEDGES: self.negative_acknowledges,
            Diagnostic.BUSY: self.busy,
            Diagnostic.CHARACTER_OVERRUNS: self.character_overruns,
        }
        return counters.get(Diagnostic(code), 0)

    # ------------------------------------------------------------------ function 43/14, device identification

    def _identify(self, request: Request) -> Response | bytes:
        function, code, first = request.function, request.code, request.object_id
        objects = self.identification
        if code == -1:  # another type of encapsulated interface
            return Response(function, exception=_X.ILLEGAL_FUNCTION)
        extended = any(number >= 0x80 for number in objects)
        conformity = 0x80 | (_EXTENDED if extended else _REGULAR if len(objects) > 3 else _BASIC)
        if code == _SPECIFIC:
            if first not in objects:
                return Response(function, exception=_X.ILLEGAL_DATA_ADDRESS)
            return library.identification_response(code, conformity, {first: objects[first]})
        if code not in _GROUP_ENDS:
            return Response(function, exception=_X.ILLEGAL_DATA_VALUE)
        group = {number: value for number, value in objects.items() if number < _GROUP_ENDS[code]}
        if first not in group:
            first = 0  # the stream restarts at an object that does not exist
        return library.identification_response(
            code, conformity, {number: value for number, value in group.items() if number >= first}
        )


def _read(function: int, found: tuple[int, ...] | ExceptionCode) -> Response:
    if isinstance(found, ExceptionCode):
        return Response(function, exception=found)
    return Response(function, found)
