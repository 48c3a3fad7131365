"""The parameters of a `ProfidriveDrive`, connected to what they stand for
(PD-133 to PD-138, PD-233 to PD-285).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from typing import Final

from emulators.drive.core import RPM
from emulators.drive.profidrive.drive import ProfidriveDrive
from emulators.drive.profidrive.faults.catalogue import CATALOGUE, DriveWarning
from emulators.drive.profidrive.modes.position import PositionMode
from emulators.drive.profidrive.parameters.definitions import ParameterDefinition
from emulators.drive.profidrive.parameters.positioner import connect_positioner
from emulators.drive.profidrive.parameters.profile import (
    Identification,
    ParameterMemory,
    connect_faults,
    connect_warnings,
    identify,
    show_telegram,
)
from emulators.drive.profidrive.parameters.server import ParameterServer
from emulators.drive.profidrive.parameters.store import ParameterStore, Reader, Writer
from emulators.drive.profidrive.parameters.terminals import Terminals
from emulators.drive.profidrive.parameters.zero_mark import ZeroMarkSource
from emulators.drive.profidrive.statemachine import AxisState
from emulators.encoder.profidrive import p979
from fieldbus.errors import ConfigurationError
from fieldbus.profidrive.errors import ParameterAccessError
from fieldbus.profidrive.requests import ParameterError
from fieldbus.profidrive.words import STW1

_SETTINGS: Final = {
    930: "operating_mode",
    925: "sign_of_life_tolerance",
    1082: "max_speed_rpm",
    1120: "ramp_up_s",
    1121: "ramp_down_s",
    1135: "quick_stop_s",
    1047: "motor_potentiometer_s",
    1409: "speed_control_extended",
    1544: "momred_evaluation_percent",
    2000: "reference_speed_rpm",
    2003: "reference_torque_nm",
    2040: "setpoint_monitoring_ms",
    2194: "torque_threshold_percent",
}
"""Parameters that are a setting of the drive, in the same unit."""
_PAIRS: Final = {
    1058: ("jog_rpm", 0, 1.0), 1059: ("jog_rpm", 1, 1.0), 1083: ("speed_limits_rpm", 0, 1.0),
    1086: ("speed_limits_rpm", 1, -1.0), 1130: ("rounding_s", 0, 1.0), 1131: ("rounding_s", 1, 1.0),
    1136: ("quick_rounding_s", 0, 1.0), 1137: ("quick_rounding_s", 1, 1.0),
}  # fmt: skip
"""Parameters that are one of a pair of settings, with the sign that the setting has."""
_SWITCHES: Final = {
    1035: ("motor_potentiometer", 0x082AFC0D), 1036: ("motor_potentiometer", 0x082AFC0E),
    1113: ("inverted_by_bit", 0x082AFC0B), 1134: ("rounding_breaks_off", 1),
}  # fmt: skip
"""Parameters that switch something on, with the value that does."""
_WHOLE: Final = frozenset({925, 930, 1409})
_LIMIT_SOURCES: Final = {1522: (0, 0x05F0FC00, 1.0), 1523: (1, 0x05F1FC00, -1.0)}
"""Connectors of the torque limits: which limit, the connection to p1520 or
p1521, sign of the values that fit.
"""
_FIXED_VALUES: Final = 0x0B56FC00
"""Connector of r2902[0]; the next elements follow (STP-153, STP-154)."""


_PER_1000_MIN: Final = 60.0 / 1000.0
"""1/s in 1000/min."""
_NAME: Final = re.compile(r"[rp]?(\d{1,5})", re.IGNORECASE)


def parameter_number(parameter: int | str) -> int:
    """Return the number of a parameter given as number or name.

    Raises:
        ConfigurationError: It is no name.

    """
    if isinstance(parameter, int):
        return parameter
    found = _NAME.fullmatch(parameter)
    if found is None:
        raise ConfigurationError("parameter", parameter, "a number, or r or p and a number, as in p1121")
    return int(found[1])


class DriveParameters:
    """Parameters of an axis: `server` answers requests, `store` holds the values.

    Settings that are written act at once. The configuration of the drive counts as saved.

    Args:
        drive: The axis.
        identification: What it says it is.
        definitions: Its parameters; None = those of the emulated drive.

    """

    def __init__(
        self,
        drive: ProfidriveDrive,
        *,
        identification: Identification | None = None,
        definitions: Iterable[ParameterDefinition] | None = None,
    ) -> None:
        who = Identification() if identification is None else identification
        self.drive = drive
        self.store = store = ParameterStore(definitions)
        self.server = ParameterServer({who.object_id: store}, multi=who.multi)
        store.pulses_enabled = lambda: drive.core.enabled
        store.switching_on_inhibited = lambda: drive.state in {AxisState.IDLE, AxisState.S1}
        identify(store, who)
        if store.definition(61000) is not None:
            store.set_text(61000, drive.name)
        show_telegram(store, drive.telegram)
        catalogue = {row.number: (row.emcy, row.text) for row in CATALOGUE.values()}
        connect_faults(store, drive.faults.buffer, catalogue, cleared=self._cleared)
        connect_warnings(store, [int(one) for one in DriveWarning], lambda: tuple(drive.faults.warnings))
        self._connect_settings()
        self._connect_display()
        self._show_machine()
        if isinstance(drive.mode, PositionMode):
            connect_positioner(store, drive.mode)
        self.terminals = Terminals(
            store,
            drive.settings,
            core=drive.core,
            power=drive.power,
            torque=drive.torque,
            inputs=drive.digital_inputs,
            rated_torque_Nm=drive.config.rated_torque_nm,
        )
        """Digital and analog terminals."""
        ZeroMarkSource(drive.encoder_words, drive.mechanics, drive.probe_latch, drive.emit, store)
        self.memory = ParameterMemory(store, self._restart)
        store.save()

    # -- for a test ------------------------------------------------------------------------------------

    def request(self, data: bytes) -> bytes:
        """Return the answer to a request of base mode parameter access, as a bus
        would bring it (PD-199 to PD-231).
        """
        return self.server.request(data)

    def read(self, parameter: int | str, sub_index: int = 0) -> int | float:
        """Return the present value of a parameter.

        Args:
            parameter: Number, or name as in a parameter list: p1121, r0002.
            sub_index: Element of an array.

        Raises:
            ParameterAccessError: There is no such parameter or element, or reading is refused; `error` is
                the number.
            ConfigurationError: The name is none.

        """
        number = parameter_number(parameter)
        if number in self.store.refusals:
            raise ParameterAccessError(f"parameter {number}", self.store.refusals[number])
        return self.store.value(number, sub_index)

    def write(self, parameter: int | str, value: float, sub_index: int = 0) -> None:
        """Write a parameter by all rules, as a bus does.

        Args:
            parameter: Number, or name as in a parameter list.
            value: In the unit of the parameter list.
            sub_index: Element of an array.

        Raises:
            ParameterAccessError: It is refused; `error` is the number.
            ConfigurationError: The name is none.

        """
        self.store.write(parameter_number(parameter), value, sub_index)

    # -- life ------------------------------------------------------------------------------------------

    def power_on(self) -> None:
        """Begin with what is saved; what was written since then is lost."""
        self.memory.reset = 0
        self.store.load()

    # -- settings --------------------------------------------------------------------------------------

    def _connect_settings(self) -> None:
        store = self.store
        for number, name in _SETTINGS.items():
            store.readers[number] = self._reader(name)
            store.writers[number] = self._writer(name, whole=number in _WHOLE)
        for number, (pair, at, sign) in _PAIRS.items():
            store.readers[number] = self._pair_reader(pair, at, sign)
            store.writers[number] = self._pair_writer(pair, at, sign)
        for number, (name, on) in _SWITCHES.items():
            store.readers[number] = self._switch_reader(name, on)
            store.writers[number] = lambda _, value, name=name: self._take(name, bool(value))  # type: ignore[misc]
        for at, (number, sign) in enumerate(((1520, 1.0), (1521, -1.0))):
            store.readers[number] = self._pair_reader("torque_limits_Nm", at, sign)
            store.writers[number] = self._pair_writer("torque_limits_Nm", at, sign, positive=True)
        for number in _LIMIT_SOURCES:
            store.readers[number] = self._source_reader(number)
            store.writers[number] = self._source_writer(number)
        self._connect_standstill_and_brake()
        # What the machine is made of is no setting.
        store.set(418, self.drive.config.fine_resolution_bits)
        store.set(419, self.drive.config.fine_xist2)
        store.locked.update((418, 419, 115))
        for at in range(2):
            store.set(115, self.drive.config.servo_period_ns / 1e3, at)

    def _reader(self, name: str) -> Reader:
        settings = self.drive.settings
        return lambda _: float(getattr(settings, name))

    def _writer(self, name: str, *, whole: bool) -> Writer:
        return lambda _, value: self._take(name, int(value) if whole else value)

    def _switch_reader(self, name: str, on: int) -> Reader:
        settings = self.drive.settings
        return lambda _: on if getattr(settings, name) else 0

    def _pair_reader(self, name: str, at: int, sign: float) -> Reader:
        settings = self.drive.settings
        return lambda _: sign * float(getattr(settings, name)[at])

    def _pair_writer(self, name: str, at: int, sign: float, *, positive: bool = False) -> Writer:
        def write(_sub_index: int, value: float) -> None:
            if positive and sign * value < 0.0:
                raise ParameterAccessError("a limit beyond zero is not possible", ParameterError.LIMIT)
            pair = list(getattr(self.drive.settings, name))
            pair[at] = sign * value
            self._take(name, tuple(pair))

        return write

    def _source_reader(self, number: int) -> Reader:
        at, own, sign = _LIMIT_SOURCES[number]
        settings, fixed = self.drive.settings, self._fixed_values

        def read(_sub_index: int) -> float:
            share = settings.torque_limits_percent[at]
            return own if share is None else _FIXED_VALUES + fixed().index(sign * share)

        return read

    def _source_writer(self, number: int) -> Writer:
        at, own, sign = _LIMIT_SOURCES[number]

        def write(_sub_index: int, value: float) -> None:
            pair = list(self.drive.settings.torque_limits_percent)
            pair[at] = None if value == own else sign * self._fixed_values()[int(value) - _FIXED_VALUES]
            self._take("torque_limits_percent", tuple(pair))

        return write

    def _fixed_values(self) -> list[float]:
        return [float(self.store.value(2902, at)) for at in range(15)]

    def _connect_standstill_and_brake(self) -> None:
        """Connect what the servo core knows of its standstill, and the times of the brake (STP-528)."""
        store, core = self.store, self.drive.core
        brake = core.brake
        places: dict[int, tuple[object, str, float]] = {
            1216: (brake, "opening_time_s", 1e-3),
            1217: (brake, "closing_time_s", 1e-3),
            1226: (core, "standstill_speed", RPM),
            1227: (core, "standstill_timeout_s", 1.0),
        }
        for number, (part, name, unit) in places.items():
            store.readers[number], store.writers[number] = _attribute(part, name, unit)

    def _take(self, name: str, value: object) -> None:
        setattr(self.drive.settings, name, value)
        self.drive.refresh()

    # -- what the drive shows --------------------------------------------------------------------------

    def _connect_display(self) -> None:
        drive, store = self.drive, self.store
        core, settings = drive.core, drive.settings

        def frequency() -> float:
            return core.speed_rpm * float(store.value(310)) / max(float(store.value(311)), 1e-9)

        shown: dict[int, Callable[[], float]] = {
            2: self._operating_display,
            51: lambda: drive.data_sets.active,
            1050: lambda: drive.channel.potentiometer / RPM,
            20: lambda: drive.channel.target / RPM if core.enabled else 0.0,
            21: lambda: core.speed_rpm,
            22: lambda: core.speed_rpm,
            24: frequency,
            26: lambda: drive.power.dc_link.voltage_V,
            27: lambda: abs(core.torque) / drive.config.rated_torque_nm * float(store.value(305)),
            31: lambda: core.torque,
            32: lambda: core.torque * core.velocity * 1e-3,
            898: lambda: drive.stw1,
            899: drive.words.zsw1,
            967: lambda: drive.stw1,
            968: drive.words.zsw1,
            5276: lambda: 0.25 / core.tuning.velocity_time_constant_s * _PER_1000_MIN,
            5277: lambda: core.tuning.velocity_time_constant_s * 1e3,
            2004: lambda: settings.reference_torque_nm * settings.reference_speed_rpm * RPM * 1e-3,
        }
        for number, get in shown.items():
            store.readers[number] = _computed(get)

    def _operating_display(self) -> int:
        """Return r0002 (PD-259)."""
        drive = self.drive
        stw1, state = drive.stw1, drive.state
        if not drive.powered:
            return 70
        if self.store.commissioning:
            return 46
        if state in {AxisState.S5A, AxisState.S5B}:
            return 18 if state is AxisState.S5A else 17
        if state is AxisState.S4:
            if not stw1 & STW1.RAMP_ENABLE:
                return 13
            if not stw1 & STW1.RAMP_RELEASE:
                return 12
            return 0 if stw1 & STW1.SETPOINT_ENABLE else 10
        if drive.faults.present:
            return 45
        if drive.safety.torque_off:
            return 44
        if state is AxisState.S3:
            return 21
        if not stw1 & STW1.NO_OFF2:
            return 42
        if not stw1 & STW1.NO_OFF3:
            return 43
        return 31 if state is AxisState.S2 else 41

    def _show_machine(self) -> None:
        """Show the formats of the encoders, and the inertias as the
        identification of the drive would find them.
        """
        machine = self.drive.config.mechanics
        for number, inertia in ((341, machine.motor_inertia_kgm2), (1498, machine.load_at_motor_kgm2)):
            if self.store.definition(number) is not None:
                self.store.set(number, inertia)
        for at, value in enumerate(p979(*self.drive.config.encoder_formats)):
            self.store.set(979, value, at)

    # -- what parameters cause -------------------------------------------------------------------------

    def _cleared(self) -> None:
        """Take the reactions back too, as an acknowledgement does (PD-136)."""
        self.drive.faults.off = 0
        self.drive.act()

    def _restart(self) -> None:
        self.drive.power_off()
        self.drive.power_on()


def _attribute(part: object, name: str, unit: float) -> tuple[Reader, Writer]:
    """Return how an attribute is read and written as a parameter of which 1 is worth `unit`."""
    return lambda _: float(getattr(part, name)) / unit, lambda _, value: setattr(part, name, value * unit)


def _computed(get: Callable[[], float]) -> Reader:
    return lambda _: get()
