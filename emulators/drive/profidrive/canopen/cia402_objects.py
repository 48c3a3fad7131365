"""Objects of CiA 402 as a PROFIdrive axis on CANopen shows them: other names for its
words and parameters (PD-342).

Velocities are in rpm times 6094h, torques in thousandths of the rated torque. SDO alone reaches the objects;
PDOs carry the telegram. Control word and target velocity change their signal in the telegram that came last.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Final, NamedTuple

from emulators.drive.core import RPM
from emulators.drive.profidrive.canopen.sdo_parameters import abort_code
from fieldbus.canopen.abort import AbortCode, SdoAbort
from fieldbus.canopen.dictionary import Entry, Value
from fieldbus.profidrive.errors import ParameterAccessError
from fieldbus.profidrive.formats import from_n2, from_n4, to_n2, to_n4

if TYPE_CHECKING:
    from emulators.drive.profidrive.drive import ProfidriveDrive
    from emulators.drive.profidrive.parameters.store import ParameterStore
    from fieldbus.canopen.store import ForeignObjects

_I8, _I16, _I32, _U16, _U32, _STRING = 0x02, 0x03, 0x04, 0x06, 0x07, 0x09
_POSITION, _VELOCITY = 1, 3
_THOUSAND: Final = 1000.0
_MANUFACTURER: Final = "SIEMENS"
_FACTOR: Final = 8798


class _Row(NamedTuple):
    name: str
    data_type: int
    get: Callable[[], Value]
    put: Callable[[float], None] | None = None


class Cia402Objects:
    """The objects, and behind them other ones.

    Args:
        drive: The axis.
        store: Its parameters.
        behind: Who is asked for any other object.

    """

    def __init__(self, drive: ProfidriveDrive, store: ParameterStore, behind: ForeignObjects) -> None:
        self._drive = drive
        self._store = store
        self._behind = behind
        core = drive.core
        rated = drive.config.rated_torque_nm
        mode = _POSITION if drive.config.positions else _VELOCITY

        def share(torque_Nm: float) -> int:
            return round(torque_Nm / rated * _THOUSAND)

        def only(value: int) -> Callable[[float], None]:
            def check(wanted: float) -> None:
                if wanted != value:
                    raise SdoAbort(AbortCode.VALUE)

            return check

        def parameter(number: int, sub_index: int = 0) -> Callable[[], Value]:
            return lambda: store.value(number, sub_index)

        def element(sub_index: int) -> _Row:
            put = lambda value: self._write(_FACTOR, value, sub_index)  # noqa: E731
            return _Row("velocity encoder factor", _U32, parameter(_FACTOR, sub_index), put)

        self._rows: dict[tuple[int, int], _Row] = {
            (0x6040, 0): _Row(
                "control word", _U16, lambda: drive.stw1, lambda value: self._command("STW1", int(value))
            ),
            (0x6041, 0): _Row("status word", _U16, drive.words.zsw1),
            (0x605D, 0): _Row("halt option code", _I16, lambda: 1, only(1)),
            (0x6060, 0): _Row("modes of operation", _I8, lambda: mode, only(mode)),
            (0x6061, 0): _Row("modes of operation display", _I8, lambda: mode),
            (0x6063, 0): _Row("position actual internal value", _I32, lambda: drive.g1_words[1]),
            (0x6069, 0): _Row("velocity sensor actual value", _I32, lambda: self._shown(core.speed_rpm)),
            (0x606B, 0): _Row("velocity demand value", _I32, lambda: self._shown(core.velocity_demand / RPM)),
            (0x606C, 0): _Row("velocity actual value", _I32, lambda: self._shown(core.speed_rpm)),
            (0x6071, 0): _Row("target torque", _I16, lambda: 0),
            (0x6072, 0): _Row(
                "max torque",
                _U16,
                lambda: share(float(store.value(1520))),
                lambda value: self._write(1520, value * rated / _THOUSAND),
            ),
            (0x6074, 0): _Row("torque demand", _I16, lambda: share(core.torque_demand)),
            (0x6083, 0): self._ramp("profile acceleration", 1120),
            (0x6084, 0): self._ramp("profile deceleration", 1121),
            (0x6085, 0): self._ramp("quick stop deceleration", 1135),
            (0x6086, 0): _Row("motion profile type", _I16, lambda: 0, only(0)),
            (0x6094, 0): _Row("velocity encoder factor", 0x05, lambda: 2),
            (0x6094, 1): element(0),
            (0x6094, 2): element(1),
            (0x60FF, 0): _Row("target velocity", _I32, self._target, self._take_target),
            (0x6502, 0): _Row("supported drive modes", _U32, lambda: 1 << mode - 1),
            (0x6504, 0): _Row("drive manufacturer", _STRING, lambda: _MANUFACTURER),
        }

    # -- as the dictionary sees it ---------------------------------------------------------------------

    def entry(self, index: int, sub: int) -> Entry | None:
        """Return an object of CiA 402, or one of those behind; None: there is none."""
        from canopen.objectdictionary import ODVariable

        row = self._rows.get((index, sub))
        if row is None:
            if (index, 0) in self._rows:
                raise SdoAbort(AbortCode.NO_SUB_INDEX)
            return self._behind.entry(index, sub)
        variable = ODVariable(row.name, index, sub)
        variable.data_type = row.data_type
        variable.access_type = "ro" if row.put is None else "rw"
        variable.pdo_mappable = False
        return Entry(variable, node_id=0, name=row.name)

    def read(self, entry: Entry) -> Value:
        """Return the present value."""
        row = self._rows.get((entry.index, entry.sub))
        return self._behind.read(entry) if row is None else row.get()

    def write(self, entry: Entry, value: Value) -> None:
        """Take a written value."""
        row = self._rows.get((entry.index, entry.sub))
        if row is None:
            self._behind.write(entry, value)
            return
        assert row.put is not None
        assert isinstance(value, (int, float))
        row.put(value)

    # -- what is behind --------------------------------------------------------------------------------

    @property
    def _factor(self) -> float:
        numerator, denominator = self._store.values(_FACTOR, 0, 2)
        return float(numerator) / float(denominator)

    def _shown(self, rpm: float) -> int:
        return min(max(round(rpm * self._factor), -(1 << 31)), (1 << 31) - 1)

    def _write(self, number: int, value: float, sub_index: int = 0) -> None:
        try:
            self._store.write(number, value, sub_index)
        except ParameterAccessError as error:
            raise SdoAbort(abort_code(error.error)) from None

    def _ramp(self, name: str, number: int) -> _Row:
        """Return a ramp: p1082 by the time of the parameter; a ramp without time is the steepest one."""
        store = self._store

        def get() -> int:
            time_s = float(store.value(number))
            slope = float(store.value(1082)) * self._factor / time_s if time_s else float(1 << 32)
            return min(round(slope), (1 << 32) - 1)

        def put(value: float) -> None:
            if not value:
                raise SdoAbort(AbortCode.VALUE)
            self._write(number, float(store.value(1082)) * self._factor / value)

        return _Row(name, _U32, get, put)

    def _command(self, name: str, value: int) -> None:
        drive = self._drive
        layout = drive.telegram.setpoint
        if name not in layout.names:
            raise SdoAbort(AbortCode.NO_OBJECT)
        row = list(drive.row[: len(layout.names)])
        row[0] = drive.stw1
        row[layout.names.index(name)] = value
        drive.receive(layout.pack(*row))

    def _signal(self) -> str:
        names = self._drive.telegram.setpoint.names
        return "NSOLL_B" if "NSOLL_B" in names else "NSOLL_A"

    def _target(self) -> int:
        name = self._signal()
        names = self._drive.telegram.setpoint.names
        if name not in names:
            return 0
        raw = self._drive.row[names.index(name)]
        part = from_n4(raw) if name == "NSOLL_B" else from_n2(raw)
        return self._shown(part * float(self._store.value(2000)))

    def _take_target(self, value: float) -> None:
        name = self._signal()
        part = value / self._factor / float(self._store.value(2000))
        self._command(name, to_n4(part) if name == "NSOLL_B" else to_n2(part))
