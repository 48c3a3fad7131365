"""The leading-axis proxy: leads axes of its controller with the value of an axis of another one (SYN-072,
SYN-073, SYN-392 to SYN-402).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, ClassVar, Final

from typing_extensions import override

from motion.kernel.modulo import NO_MODULO, Modulo
from motion.s7.alarms import AlarmEngine
from motion.s7.axis.state import AxisState
from motion.s7.axis.technology_object import Live, TechnologyObject, in_its_units, live_alarms
from motion.s7.proxy.telegram import BAD_SIGN, LENGTH, LeadingTelegram
from motion.s7.variables import VariableStore

if TYPE_CHECKING:
    from fieldbus.history import History
    from motion.kernel.leading_value import Value
    from motion.s7.axis.configuration import Problem
    from motion.s7.proxy.link import LeadingValueLink

ALARM_CONFIGURATION: Final = 114
ALARM_INVALID: Final = 900
ALARM_TRANSMISSION: Final = 901
ALARM_ACCURACY: Final = 902
ALARM_MODULO_CHANGED: Final = 903
_CYCLES: Final = 2
"""Application cycles by which a leading value is late (SYN-072)."""
_DEPTH: Final = 64
"""Values that are kept for an interpolation."""
_SIGNS: Final = 1 << 16
_LONGEST_GAP: Final = 255
"""Telegrams in a row that may be missing; more is an error of the sign of life."""
_STANDS: Final = 1e-6
CONTROL, ERROR, RESTART_ACTIVE, ONLINE, VALID, MODULO, LEADER_CONTROL = (1 << bit for bit in range(7))
"""Bits of `StatusWord` (SYN-400)."""


class _NoEnabling:
    """`MC_Power` does not know a proxy: it works as soon as it is configured."""

    start_mode = 1
    enable = False
    enabled = False
    busy = False
    alarmed = False

    def call(self, *, enable: bool, start_mode: int, stop_mode: int) -> tuple[bool, bool, bool]:
        """There is nothing to enable."""
        del enable, start_mode, stop_mode
        return False, False, False


class LeadingAxisProxy(TechnologyObject):
    """`TO_LeadingAxisProxy` behind a way from another controller.

    A value arrives two application cycles after it has been calculated, and is then extrapolated or
    interpolated by `StatusExternalLeadingValue.AdjustmentTime`: two cycles, less the delay of the local
    followers of the leading axis, plus `Parameter.LocalLeadingValueDelayTime`. So all followers get the same
    value at the same time. A leading axis whose output is not enabled is alarm 114 (SYN-304). An outage is
    bridged with the last velocity for
    `Parameter.ToleranceTimeExternalLeadingValueInvalid`; then alarm 900 makes the leading value invalid, and
    followers stop with alarm 601.

    Args:
        name: Name in history and trace.
        link: The way of the telegrams.
        cycle_ns: Application cycle, ns.
        variables: Start values by their original path.
        history: Event log, or None.

    Raises:
        ConfigurationError: A variable does not exist, or its value is out of range.

    """

    object_type: ClassVar[str] = "LeadingAxisProxy"
    kinds: ClassVar[tuple[str, ...]] = ("LeadingAxisProxy",)
    trace_columns: tuple[tuple[str, str], ...] = (
        ("position", ""),
        ("velocity", ""),
        ("status_word", ""),
        ("error_word", ""),
    )
    trace_enums: ClassVar[dict[str, dict[int, str]]] = {}
    homed = False
    """It has no home position."""

    def __init__(
        self,
        name: str,
        link: LeadingValueLink,
        *,
        cycle_ns: int,
        variables: Mapping[str, object] | None = None,
        history: History | None = None,
    ) -> None:
        store = VariableStore(self.object_type, dict(variables or {}), name=name, history=history)
        super().__init__(
            name, store, AlarmEngine(name, object_type=self.object_type, history=history), history
        )
        self.link = link
        """The way of the telegrams."""
        self.cycle_s = cycle_ns * 1e-9
        self._state = AxisState.DISABLED
        self._enabling = _NoEnabling()
        self._tolerance = store.bind("Parameter.ToleranceTimeExternalLeadingValueInvalid")
        self._delay = store.bind("Parameter.LocalLeadingValueDelayTime")
        self._begin()
        self._live = self._readers = in_its_units(self._live_variables(), store)

    def _begin(self) -> None:
        self._arrived: bytes | None = None
        self._sign: int | None = None
        self._outage = 0.0
        self._modulo = NO_MODULO
        self._raw: Value | None = None
        self._past: deque[Value] = deque(maxlen=_DEPTH)
        self._leader_delay = 0.0
        self._leader_controls = False
        self._valid = False
        self._value: Value = (0.0, 0.0, 0.0)
        if not self.link.enabled:
            self.engine.raise_alarm(
                ALARM_CONFIGURATION, text=f"{self.link.output} of the leading axis is FALSE"
            )

    @property
    @override
    def local_delay_s(self) -> float:
        """`Parameter.LocalLeadingValueDelayTime`, s (SYN-397)."""
        return float(self._delay.value)

    # -- what it gives to followers

    @property
    def adjustment_s(self) -> float:
        """`StatusExternalLeadingValue.AdjustmentTime`, s (SYN-392)."""
        return _CYCLES * self.cycle_s - self._leader_delay + self.local_delay_s

    @override
    def leading_by(self, coupling: str) -> Callable[[], Value]:
        """Return the adapted leading value, whatever the type of coupling."""
        return lambda: self._value

    @override
    def gives_value(self) -> bool:
        return self._valid and not self.leading_defective and self._state is not AxisState.RESTARTING

    @property
    @override
    def leading_modulo(self) -> Modulo:
        return self._modulo

    @property
    @override
    def stands(self) -> bool:
        return abs(self._value[1]) < _STANDS

    # -- cycle

    def cycle(self) -> None:
        """Take the leading value for this application cycle over."""
        if self._state is not AxisState.RESTARTING:
            self.variables.latch()
        self.engine.update()
        if self._resets:
            self._step_resets()
        data, self._arrived = self._arrived, self.link.received
        telegram = None if data is None or len(data) != LENGTH else self._fresh(data)
        raw = self._raw
        if telegram is not None:
            place = telegram.position
            if raw is not None:
                place = self._continued(raw[0] + raw[1] * self.cycle_s, place)
            raw = (place, telegram.velocity, telegram.acceleration)
            self._outage = 0.0
            self._leader_delay = telegram.delay_us * 1e-6
            self._leader_controls = telegram.control
        else:
            self._outage += self.cycle_s
            if raw is not None:
                raw = (raw[0] + raw[1] * self.cycle_s, raw[1], 0.0)
        self._raw = raw
        if raw is None:
            return
        if self._outage > self._tolerance.value + 1e-9:
            if self._valid:
                self.engine.raise_alarm(ALARM_INVALID)
            self._valid = False
            return
        self._past.append(raw)
        self._valid = not self.engine.reaction
        if self._valid:
            self._value = self._adjusted()

    def _fresh(self, data: bytes) -> LeadingTelegram | None:
        """Return the content of a telegram that is new, makes sense and is valid; alarms 901 and 903."""
        telegram = LeadingTelegram.decode(data)
        sign = telegram.sign_of_life
        if sign == self._sign:
            return None
        before, self._sign = self._sign, sign
        fault = telegram.fault()
        if not fault and before is not None and (sign - before) % _SIGNS > _LONGEST_GAP:
            fault = BAD_SIGN
        if fault:
            self.engine.raise_alarm(ALARM_TRANSMISSION, info=fault)
            self._valid = False
            return None
        if not telegram.valid:
            return None
        modulo = self._modulo
        length = modulo.length if modulo.enabled else 0.0
        if telegram.modulo_length != length or (length and telegram.modulo_start != modulo.start):
            if self._raw is not None:
                self.engine.raise_alarm(ALARM_MODULO_CHANGED)
                self._valid = False
                return None
            self._modulo = Modulo(telegram.modulo_length, telegram.modulo_start)
        return telegram

    def _continued(self, expected: float, place: float) -> float:
        """Return a place in the modulo range as the position nearest to `expected`."""
        modulo = self._modulo
        if not modulo.enabled:
            return place
        return place + round((expected - place) / modulo.length) * modulo.length

    def _adjusted(self) -> Value:
        """Return the value of this cycle, extrapolated or interpolated by the adjustment time."""
        time = self.adjustment_s
        past = self._past
        if time >= 0.0:
            position, velocity, acceleration = past[-1]
            return (
                position + time * (velocity + 0.5 * acceleration * time),
                velocity + acceleration * time,
                acceleration,
            )
        cycles = -time / self.cycle_s
        whole = int(cycles + 1e-9)
        rest = max(0.0, cycles - whole)
        newest = len(past) - 1 - whole
        if newest < 1:
            if whole >= _DEPTH - 1:
                self.engine.raise_alarm(ALARM_ACCURACY)
            return past[0]
        after, before = past[newest], past[newest - 1]
        position, velocity, acceleration = (
            b + (a - b) * (1.0 - rest) for a, b in zip(after, before, strict=True)
        )
        return position, velocity, acceleration

    # -- what the kinds of object do each in their way

    @property
    @override
    def state(self) -> AxisState:
        return self._state

    @property
    @override
    def enabling(self) -> _NoEnabling:
        return self._enabling

    @property
    @override
    def simulated(self) -> bool:
        return False

    @property
    @override
    def restart_refused(self) -> bool:
        return False

    @override
    def check(self, *, start: bool) -> list[Problem]:
        return []

    @override
    def apply_configuration(self, *, powered_off: bool = False) -> None:
        self._begin()

    @override
    def forget_encoders(self) -> None:
        pass  # it has none

    @override
    def hold_back(self) -> None:
        self._state = AxisState.RESTARTING

    @override
    def release(self) -> None:
        self._state = AxisState.DISABLED

    @override
    def acknowledge(self, age: int) -> bool:
        self.engine.acknowledge()
        self.engine.update()
        return True

    @override
    def switch_outputs(self, on: bool) -> None:
        pass  # it has no drive

    @override
    def clear_alarms(self) -> None:
        self.engine.restart()

    @override
    def _abort_jobs(self) -> None:
        pass  # it has no jobs

    @override
    def _end_functions(self) -> None:
        pass  # nor functions

    @override
    def _withdraw_enable(self) -> None:
        pass  # nor an enable

    @override
    def _power_down(self) -> None:
        self.release()
        self._show_restart(False)
        self.engine.power_down()

    # -- what it shows

    def status_word(self) -> int:
        """Return `StatusWord` (SYN-400)."""
        restarting = self._state is AxisState.RESTARTING
        word = RESTART_ACTIVE if restarting else CONTROL
        if self.engine.error_word:
            word |= ERROR
        if self.variables.online_start_values_changed:
            word |= ONLINE
        if self.gives_value():
            word |= VALID
        if self._modulo.enabled:
            word |= MODULO
        if self._leader_controls:
            word |= LEADER_CONTROL
        return word

    def _live_variables(self) -> Live:
        external = "StatusExternalLeadingValue."
        return live_alarms(self.engine) | {
            "Position": lambda: self._modulo.wrap(self._value[0]),
            "Velocity": lambda: self._value[1],
            "Acceleration": lambda: self._value[2],
            f"{external}ModuloLength": lambda: self._modulo.length if self._modulo.enabled else 0.0,
            f"{external}ModuloStartValue": lambda: self._modulo.start if self._modulo.enabled else 0.0,
            f"{external}AdjustmentTime": lambda: self.adjustment_s,
            "StatusWord": self.status_word,
        }

    def trace_row(self) -> tuple[float, ...]:
        """Return the values of `trace_columns` for the present cycle."""
        return self._value[0], self._value[1], self.status_word(), self.engine.error_word
