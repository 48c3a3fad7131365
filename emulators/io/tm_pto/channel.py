"""A channel of the TM PTO: a drive with an encoder in telegram 3 (PTO-001 to PTO-210). Takes and gives
frames; knows no bus.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from emulators.drive.profidrive.statemachine import AxisState, GeneralStateMachine, Off
from emulators.encoder._encoder import ZeroMarkListener
from emulators.encoder.profidrive import EncoderAbilities, EncoderFormat, EncoderInterface
from emulators.encoder.profidrive.interface import SIGN_OF_LIFE_FAILED
from emulators.io.tm_pto.config import FREQUENCY_MIN_HZ, SIGNS_UNMONITORED, PtoConfig
from emulators.io.tm_pto.pulses import PulseGenerator
from emulators.io.tm_pto.stepper import StepperMotor
from fieldbus.clock import MS, Scheduler, Timer
from fieldbus.errors import ConfigurationError
from fieldbus.profidrive import N2_ONE, N4_ONE, STW1, ZSW1, ZSW2_ENC, pto_telegram, telegram, to_n2, to_n4
from fieldbus.profidrive.sign_of_life import next_sign
from fieldbus.profidrive.words import SIGN_OF_LIFE_SHIFT

OUTPUT_ERROR: Final = 0x0001
_STOPPING: Final = frozenset({AxisState.S4, AxisState.S5A, AxisState.S5B})
TRACE_COLUMNS: Final = (
    ("state", ""),
    ("stw1", ""),
    ("zsw1", ""),
    ("setpoint_rpm", "rpm"),
    ("speed_rpm", "rpm"),
    ("g1_stw", ""),
    ("g1_zsw", ""),
    ("ed", ""),
    ("count", "increments"),
)


class InputTerminal:
    """A digital input with its filter (PTO-016): a level counts when it has stood for the whole delay.

    Args:
        scheduler: Time of the bench.
        delay_ms: Input delay.
        on_edge: Called at the end of the delay, with the new level.

    """

    def __init__(self, scheduler: Scheduler, delay_ms: float, on_edge: Callable[[bool], None]) -> None:
        self._scheduler = scheduler
        self._delay = round(delay_ms * MS)
        self._on_edge = on_edge
        self._raw = False
        self._timer: Timer | None = None
        self.level = False
        """Level behind the filter."""

    def drive(self, level: bool) -> None:
        """Bring a level to the terminal, now."""
        if level is self._raw:
            return
        self._raw = level
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if level is not self.level:
            self._timer = self._scheduler.after(self._delay, self._settle)

    def _settle(self) -> None:
        self._timer = None
        self.level = self._raw
        self._on_edge(self.level)


class _PulseCounter:
    """The position of the encoder interface: what the generator has output."""

    def __init__(self, generator: PulseGenerator, increments: int) -> None:
        self._generator = generator
        self.counts_per_revolution = increments

    @property
    def increments(self) -> int:
        return self._generator.count

    def watch_zero_mark(self, listener: ZeroMarkListener) -> None:
        """Do nothing: the reference mark comes from terminal RS."""

    def unwatch_zero_mark(self, listener: ZeroMarkListener) -> None:
        """Do nothing."""


class PtoChannel:
    """One channel. Per bus cycle: `receive` with the frame that has come, if one has,
    then `cycle`, then `transmit`.

    Args:
        scheduler: Time of the bench.
        config: The channel.
        watchdog_cycles: Cycles without a frame after which the channel reacts as to a stop of the
            controller, >= 1 (PTO-206).

    Raises:
        ConfigurationError: The watchdog is out of its range.

    """

    def __init__(self, scheduler: Scheduler, config: PtoConfig, *, watchdog_cycles: int = 3) -> None:
        if watchdog_cycles < 1:
            raise ConfigurationError("pulse channel watchdog_cycles", watchdog_cycles, "1 or more")
        self._scheduler = scheduler
        self.config: Final = config
        self._watchdog = watchdog_cycles
        self._telegram = telegram(3) if config.settings.standard else pto_telegram()
        self.generator: Final = PulseGenerator(pause_ns=config.settings.reversal_pause_ms * MS)
        self.generator.advance(scheduler.now)
        self._machine = GeneralStateMachine()
        self._machine.state = AxisState.S1  # it does not wait for control by PLC first (PTO-142)
        self.interface: Final = EncoderInterface(
            _PulseCounter(self.generator, config.increments),
            EncoderFormat(
                periods=config.increments,
                shift_xist1=0,
                shift_xist2=0,
                start_value=config.start_value,
            ),
            EncoderAbilities(
                reference_marks=int(config.settings.use_rs),
                measuring=2 if config.settings.use_mi else 0,
                home=False,
                parking=not config.settings.strict_parking,
            ),
        )
        """The encoder interface; its faults can be brought about there."""
        self.motor: StepperMotor | None = None
        """What the pulses turn, if anything."""
        self._dr = InputTerminal(scheduler, config.settings.input_delay_ms, self._on_dr)
        self._dr_dropped = False
        self._rs = InputTerminal(scheduler, config.settings.input_delay_ms, self._on_rs)
        self._mi = InputTerminal(scheduler, config.settings.input_delay_ms, self._on_mi)
        self._count_actions: list[tuple[int, Callable[[], None]]] = []
        self._count_timer: Timer | None = None
        self._supply = True
        self._short = False
        self._stopped = False
        self._cyclic = False
        self._missed = 0
        self._pending: bytes | None = None
        self._stw1 = self._stw2 = self._g1_stw = 0
        self._setpoint = 0.0
        self._last_sign = 0
        self._sign_errors = 0
        self._signs_running = False
        self.ed = False
        """Level of terminal ED."""
        self.fault = False
        """Whether the error of a digital output is there or not yet acknowledged (ZSW1.3)."""
        self.refused = 0
        """Frames of a wrong length since construction."""
        self._zsw1 = self._zsw = 0
        self._frame = self._build(self.interface.words())

    # -- bus -------------------------------------------------------------------------------------------

    @property
    def state(self) -> AxisState:
        """State of the drive; S5 are the stop ramps, which the controller sees as S4 (PTO-264)."""
        return self._machine.state

    def receive(self, frame: bytes) -> bool:
        """Take a frame for the next cycle; return False when its length is wrong: it is a
        configuration error (PTO-039).
        """
        if len(frame) != self._telegram.setpoint.length:
            self.refused += 1
            return False
        self._pending = frame
        self._cyclic = True
        return True

    def transmit(self) -> bytes:
        """Return the frame of the last cycle."""
        return self._frame

    def cycle(self) -> None:
        """Go on to now, evaluate what was received and build what is sent: once per bus cycle."""
        now = self._scheduler.now
        self.generator.advance(now)
        if self._pending is not None:
            self._missed = 0
            if not self._stopped:
                self._take_over(self._pending)
            self._pending = None
        elif self._cyclic:
            self._missed += 1
            if self._missed == self._watchdog:
                self._withdraw()
        self._step(now)
        if self.motor is not None:
            self.motor.follow()
        self._frame = self._build(self.interface.step(self._g1_stw, now))

    # -- what happens outside --------------------------------------------------------------------------

    def drive_input(self, terminal: str, level: bool) -> None:
        """Bring a level to `DR`, `RS` or `MI`, now.

        Raises:
            ConfigurationError: There is no such terminal.

        """
        terminals = {"DR": self._dr, "RS": self._rs, "MI": self._mi}
        if terminal not in terminals:
            raise ConfigurationError("input terminal", terminal, ", ".join(terminals))
        terminals[terminal].drive(level)

    def at_count(self, count: int, action: Callable[[], None]) -> None:
        """Call `action` at the instant at which the generator's count reaches
        `count`, once, now if it stands there.
        """
        self._count_actions.append((count, action))
        self.generator.advance(self._scheduler.now)
        self._expect_counts()

    def stop_controller(self, stopped: bool) -> None:
        """The controller goes to STOP: setpoint 0, S1, functions end with their error (PTO-204); or back to
        RUN (PTO-205).
        """
        if stopped and not self._stopped:
            self._withdraw()
        self._stopped = stopped

    def restart(self) -> None:
        """Begin as after power-on: S1, no telegram has come, the count shown starts again."""
        self._halt()
        self._machine = GeneralStateMachine()
        self._machine.state = AxisState.S1
        self._stw1 = self._stw2 = self._g1_stw = 0
        self._setpoint = 0.0
        self._last_sign = self._sign_errors = self._missed = 0
        self._signs_running = self._cyclic = self._dr_dropped = False
        self._pending = None
        self.fault = self._short
        self.interface.power_on()
        self._frame = self._build(self.interface.words())

    def supply(self, present: bool) -> None:
        """Take the load supply away, or bring it back (PTO-209)."""
        self._supply = present
        if not present:
            self._halt()

    def output_error(self, present: bool) -> None:
        """Short circuit or overload of a digital output begins or ends (PTO-207)."""
        self._short = present
        if present:
            self.fault = True
            self.interface.set_error(OUTPUT_ERROR)
            self._halt()
        else:
            self.interface.clear_error(OUTPUT_ERROR)

    def trace_row(self) -> tuple[float, ...]:
        """Return the present values of `TRACE_COLUMNS`; the state as 1 to 5."""
        state = self.state
        number = {AxisState.S1: 1, AxisState.S2: 2, AxisState.S3: 3, AxisState.S4: 4}.get(state, 5)
        return (
            number,
            self._stw1,
            self._zsw1,
            self._setpoint * self.config.settings.reference_speed_rpm,
            self.speed_rpm,
            self._g1_stw,
            self._zsw,
            self.ed,
            self.generator.count,
        )

    @property
    def speed_rpm(self) -> float:
        """Present speed of the pulses, rpm, with its sign."""
        return self.generator.frequency * 60.0 / self.config.increments

    # -- inside ----------------------------------------------------------------------------------------

    def _take_over(self, frame: bytes) -> None:
        before = self._stw1
        stw1, setpoint, self._stw2, self._g1_stw = self._telegram.setpoint.unpack(frame)
        one = N4_ONE if self.config.settings.standard else N2_ONE
        if stw1 & STW1.CONTROL_BY_PLC:
            self._stw1 = stw1
            self._setpoint = setpoint / one
            if stw1 & ~before & STW1.ACKNOWLEDGE and not self._short:
                self.fault = False
        else:
            self._stw1 = before & ~STW1.CONTROL_BY_PLC
        self._supervise(self._stw2 >> SIGN_OF_LIFE_SHIFT)

    def _supervise(self, sign: int) -> None:
        """Count errors of the sign of life in a row, once the controller has shown one (PTO-074, PTO-075)."""
        if not self._signs_running:
            self._signs_running = sign != 0
        elif sign == next_sign(self._last_sign):
            self._sign_errors = 0
        else:
            self._sign_errors += 1
            if self._sign_errors > self.config.sign_tolerance != SIGNS_UNMONITORED:
                self._sign_errors = 0
                self.interface.report(SIGN_OF_LIFE_FAILED)
        self._last_sign = sign

    def _withdraw(self) -> None:
        """Forget the controller's words: it has stopped, or is not heard any more."""
        self._stw1 = self._g1_stw = 0
        self._setpoint = 0.0
        self._signs_running = False
        self._sign_errors = 0
        self.interface.abort()
        self._halt()

    def _halt(self) -> None:
        """Stop the pulses between two cycles; the state follows with the next one."""
        self.generator.halt(self._scheduler.now)
        self.ed = False
        self._expect_counts()

    def _step(self, now: int) -> None:
        config = self.config
        machine = self._machine
        generator = self.generator
        stw1 = self._stw1
        off = Off.NONE
        if self.fault or self._short or not self._supply or not stw1 & STW1.CONTROL_BY_PLC:
            off = Off.OFF2
        ready = self._dr.level or not config.settings.use_dr
        machine.step(stw1, off=off, standstill=generator.frequency == 0.0, ready=ready)
        dropped, self._dr_dropped = self._dr_dropped or not ready, False
        if machine.state in _STOPPING and dropped:
            # Without the power stage there is no ramp: S4 waits for it in S3, a stop has ended (PTO-148).
            generator.halt(now)
            if machine.state is AxisState.S4:
                machine.state = AxisState.S3
        state = machine.state
        full = config.frequency(config.maximum_speed)
        ramp = full * 1000.0 / config.ramp_stop_ms
        if state is AxisState.S4 and stw1 & STW1.RAMP_ENABLE:
            wanted = (
                config.frequency(self._setpoint * config.settings.reference_speed_rpm)
                if stw1 & STW1.SETPOINT_ENABLE
                else 0.0
            )
            generator.steer(now, min(full, max(-full, wanted)), ramp)
        elif state is AxisState.S5A:
            generator.steer(now, 0.0, ramp)
        elif state is AxisState.S5B:
            generator.steer(now, 0.0, full * 1000.0 / config.quick_stop_ms)
        else:
            generator.halt(now)
        if self._count_actions:
            self._expect_counts()
        enabled = state in _STOPPING or (state is AxisState.S3 and bool(stw1 & STW1.ENABLE_OPERATION))
        self.ed = config.settings.use_ed and enabled
        # A position that the outputs do not follow is none: parking is shown as long (PTO-188).
        self.interface.valid = self._supply and not self._short

    def _build(self, words: tuple[int, int, int]) -> bytes:
        config = self.config
        generator = self.generator
        state = self.state
        stw1 = self._stw1
        zsw1 = state.bits
        if state in {AxisState.S5A, AxisState.S5B}:
            zsw1 = AxisState.S4.bits
        if self.fault:
            zsw1 |= ZSW1.FAULT
        if stw1 & STW1.NO_OFF2 and stw1 & STW1.CONTROL_BY_PLC and self._supply:
            zsw1 |= ZSW1.NO_OFF2
        if stw1 & STW1.NO_OFF3 and state is not AxisState.S5B:
            zsw1 |= ZSW1.NO_OFF3
        if state is AxisState.S4:
            zsw1 |= ZSW1.DEVIATION_IN_TOLERANCE
        if self._supply:
            zsw1 |= ZSW1.CONTROL_REQUESTED
        frequency = abs(generator.frequency)
        if frequency < FREQUENCY_MIN_HZ or frequency >= config.frequency(config.maximum_speed):
            zsw1 |= ZSW1.SPEED_REACHED
        self._zsw1 = zsw1
        self._zsw, xist1, xist2 = words
        share = self.speed_rpm / config.settings.reference_speed_rpm
        if config.settings.standard:
            return self._telegram.actual.pack(zsw1, to_n4(share), 0, self._zsw, xist1, xist2)
        requested = ZSW2_ENC.CONTROL_REQUESTED if self._supply else 0
        return self._telegram.actual.pack(zsw1, to_n2(share), requested, self._zsw, xist1, xist2)

    # -- terminals -------------------------------------------------------------------------------------

    def _on_dr(self, level: bool) -> None:
        if not level and self.config.settings.use_dr and self._machine.state in _STOPPING:
            self._dr_dropped = True
            self.generator.halt(self._scheduler.now)
            self._expect_counts()

    def _on_rs(self, level: bool) -> None:
        if self.config.settings.use_rs and level is self.config.rs_rising:
            self.generator.advance(self._scheduler.now)
            self.interface.reference_mark(1, self.generator.count)

    def _on_mi(self, level: bool) -> None:
        if self.config.settings.use_mi:
            self.generator.advance(self._scheduler.now)
            self.interface.probe_edge(1, level, self.generator.count)

    def _expect_counts(self) -> None:
        """Have the next awaited count come at its time, as things are commanded now."""
        if self._count_timer is not None:
            self._count_timer.cancel()
            self._count_timer = None
        times = [
            due for count, _ in self._count_actions if (due := self.generator.time_of(count)) is not None
        ]
        if times:
            now = self._scheduler.now
            self._count_timer = self._scheduler.after(max(0, min(times) - now), self._count_reached)

    def _count_reached(self) -> None:
        now = self._scheduler.now
        due = [
            one
            for one in self._count_actions
            if (time := self.generator.time_of(one[0])) is not None and time <= now
        ]
        self.generator.advance(now)
        self._count_actions = [one for one in self._count_actions if one not in due]
        for _, action in due:
            action()
        self._count_timer = None
        self._expect_counts()
