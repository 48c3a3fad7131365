"""Encoder interface Gx_STW, Gx_ZSW, Gx_XIST1, Gx_XIST2 as a state machine (PD-141
to PD-187, PTO-211 to PTO-250).

Knows no telegram and no bus. Positions that come in are increments of the encoder model, which the model and
its switches give to the instant; so a latched value is exact whatever the bus cycle is.
"""

from __future__ import annotations

from typing import Final

from emulators.encoder.profidrive._abilities import EncoderAbilities, EncoderState
from emulators.encoder.profidrive._counting import Counting, PositionSource, signed32
from emulators.encoder.profidrive.format import EncoderFormat
from fieldbus.errors import ConfigurationError
from fieldbus.profidrive.words import COMMAND_SHIFT, ENCODER_ERRORS, FUNCTION_MASK, G_STW, G_ZSW

PARKING_NS: Final = 100_000_000
"""Parking is shown for at least this long (PD-168)."""
NONE, ACTIVATE, READ, CANCEL = 0, 1, 2, 3
COMMAND_NOT_SUPPORTED: Final = 0x0F01
SIGN_OF_LIFE_FAILED: Final = 0x0F02


SD1, SD2, SD3, SD4, SD5, SD7, SD10, SD11, SD12 = EncoderState
_ABORTED: Final = {SD5: 0x0004, SD4: 0x0005, SD10: 0x0006, SD11: 0x0007}
"""Error with which a function ends that cannot continue (PD-178 to PD-181)."""
_ABORTED_IN: Final = {code: state for state, code in _ABORTED.items()}
_ABSOLUTE_SHOWN: Final = frozenset({SD1, SD5, SD7, SD10})
_LEVELS_SHOWN: Final = frozenset({SD1, SD10, SD11})
_COMMAND: Final = 7 << COMMAND_SHIFT


class EncoderInterface:
    """One encoder towards its controller. Call `step` once per bus cycle, after the encoder has been sampled.

    Args:
        encoder: The model. The zero mark is taken from it.
        form: Formats of the values; also what P979 tells.
        abilities: What the interface can do.

    Raises:
        ConfigurationError: The encoder does not count as the format says.

    """

    def __init__(
        self,
        encoder: PositionSource,
        form: EncoderFormat,
        abilities: EncoderAbilities = EncoderAbilities(),  # noqa: B008 - frozen
    ) -> None:
        self.form: Final = form
        self.abilities: Final = abilities
        self._encoder = encoder
        self._counting = Counting(encoder, form)
        self._marks = (1 << abilities.reference_marks) - 1
        self._measures = (1 << abilities.measuring) - 1
        # Without an absolute value and without a counter that moves there is nothing that a home position
        # could change.
        self._home = abilities.home and (form.absolute or abilities.preset_counter)
        self._faults: dict[int, None] = {}
        self.external_mark = False
        """Another signal takes the place of the encoder's zero mark; its source calls `reference_mark`.
        """
        self._watching = False
        self.home_steps = 0
        """Home position to set, or by which to shift: lines or steps."""
        self.power_on()

    def power_on(self) -> None:
        """Start again, after the encoder has been switched on; injected faults and the home position stay."""
        self.state = SD1
        self.valid = 0x0001 not in self._faults
        """Whether Gx_XIST1 can be trusted; set to False while the supply or the
        logic of the encoder is not there.
        """
        self._levels = 0
        self._event = 0
        self._code = 0
        self._parked_ns = 0
        self._last_mark: int | None = None
        self._drop()
        self._counting.power_on()
        self._xist1 = self._counting.xist1()
        if self.abilities.zero_mark_tolerance is not None:
            self._watch(True)

    # -- what the controller sees ----------------------------------------------------------------------------

    def step(self, stw: int, now_ns: int) -> tuple[int, int, int]:
        """Evaluate the control word of this bus cycle; at most one transition.

        Args:
            stw: Gx_STW, 0..FFFFh.
            now_ns: Present time.

        Returns:
            Gx_ZSW (0..FFFFh), Gx_XIST1 and Gx_XIST2 (signed 32-bit).

        """
        if not (stw or self.state is not SD1 or self._event or self._faults) and self.valid:
            # Nothing is asked for and nothing is wrong: the usual case.
            self._asked = 0
            self._xist1 = xist1 = self._counting.xist1()
            return self._running, xist1, 0
        self._transition(stw, now_ns)
        self._asked = stw & FUNCTION_MASK if stw & _COMMAND == ACTIVATE << COMMAND_SHIFT else 0
        return self._words(stw)

    def words(self) -> tuple[int, int, int]:
        """Return the words before the first control word has come (PD-150, PD-170)."""
        return self._words(G_STW.ABSOLUTE_CYCLICALLY if self.abilities.absolute_at_start else 0)

    @property
    def xist3(self) -> int:
        """Counter of 64 bits for telegram 84, signed; 0 while parking."""
        return 0 if self.state is SD12 else self._counting.xist3()

    @property
    def error(self) -> int:
        """Error code that is shown, 0: none."""
        return self._code if self.state in {SD2, SD3} else 0

    # -- what happens at the encoder -------------------------------------------------------------------

    def reference_mark(self, number: int, increments: int) -> None:
        """Latch the position of a reference mark (1..4), increments of the model;
        the zero mark comes by itself.
        """
        if self.state is SD5:
            self._latch(1 << (number - 1), increments)

    def probe_edge(self, number: int, rising: bool, increments: int) -> None:
        """Take an edge of probe 1 or 2 at a position, increments of the model; one that is not awaited
        changes the level only.
        """
        level = 1 << (number - 1)
        self._levels = self._levels | level if rising else self._levels & ~level
        if self.state in {SD10, SD11}:
            self._latch(1 << (2 * number - 2 + (not rising)), increments)

    def report(self, code: int) -> None:
        """Let an error happen once: its cause is gone at once, its code stays until it is acknowledged.

        Raises:
            ConfigurationError: There is no such code.

        """
        self._event = self._event or _known(code)

    def abort(self) -> None:
        """End a function that runs, or a value that is shown, with its error 0004h to 0007h: the controller
        has stopped.
        """
        self._event = self._event or _ABORTED.get(self.state, 0)

    def set_error(self, code: int) -> None:
        """Bring about the lasting cause of an error.

        0003h makes parking fail, 0004h to 0007h abort the function that they belong to, 0008h and 000Ah the
        transmission of the absolute value; all others come at once. With 0001h Gx_XIST1 is not valid.

        Raises:
            ConfigurationError: There is no such code.

        """
        self._faults[_known(code)] = None
        if code == 0x0001:
            self.valid = False

    def clear_error(self, code: int) -> None:
        """Take the cause of an error away; with 0001h Gx_XIST1 is valid
        again. Harmless if it was not there.
        """
        if code in self._faults:
            del self._faults[code]
            if code == 0x0001:
                self.valid = True

    # -- state machine ---------------------------------------------------------------------------------------

    def _transition(self, stw: int, now_ns: int) -> None:
        state = self.state
        park = bool(stw & G_STW.PARK) and self.abilities.parking and 0x0003 not in self._faults
        if state is SD12:
            self._event = 0
            if not park and self.valid and now_ns - self._parked_ns >= PARKING_NS:
                self.state = SD1
            return
        if park:
            self._park(now_ns)
            return
        cause = self._cause(stw)
        if state is SD3:
            self._event = 0  # the first code stays (PTO-201)
            cause = self._cause(stw)
            if stw & G_STW.ACKNOWLEDGE:
                if self.valid:
                    self.state = SD2
                    self._code = cause
            elif not cause and not self.valid:
                self._park(now_ns)
        elif state is SD2:
            self._code = cause
            if not stw & G_STW.ACKNOWLEDGE:
                if not cause:
                    if self.valid:
                        self.state = SD1
                    else:
                        self._park(now_ns)
                elif self.valid:
                    self._fault(cause)
        elif cause:
            self._fault(cause)
        elif not self.valid:
            self._park(now_ns)
        else:
            self._operate(stw)

    def _operate(self, stw: int) -> None:
        """Go on in normal operation: there is neither parking nor an error."""
        state = self.state
        command = (stw & _COMMAND) >> COMMAND_SHIFT
        functions = stw & FUNCTION_MASK
        measure = bool(stw & G_STW.MEASURE)
        if state is SD1:
            if stw & G_STW.SET_HOME:
                self._counting.set_home(
                    self.home_steps,
                    relative=bool(stw & G_STW.SHIFT_HOME),
                    with_counter=self.abilities.preset_counter,
                )
                self.state = SD7
            elif command == ACTIVATE and functions:
                self._activate(functions, measure)
                self.state = SD10 if measure else SD5
            elif command == READ and self._show(functions, measure):
                self.state = SD11 if measure else SD4
        elif state is SD7:
            if not stw & G_STW.SET_HOME:
                self.state = SD1
        elif state is SD4:
            if command == NONE:
                self.state = SD1
            elif measure:
                self._fault(_ABORTED[state])
        elif command == CANCEL:
            self._drop()
            self.state = SD1
        elif command == NONE and not self._running:
            self.state = SD1
        elif measure is (state is SD5):
            self._fault(_ABORTED[state])
        elif state is SD10:
            if command == ACTIVATE:
                self._activate(functions & ~self._asked, measure)
            elif command == READ and self._show(functions, measure):
                self.state = SD11
        elif state is SD11:
            if command == READ:
                self._show(functions, measure)
            elif command == NONE or functions:
                self._activate(functions if command == ACTIVATE else 0, measure)
                self.state = SD10

    def _cause(self, stw: int) -> int:
        """Return the code of an error whose cause is there now, 0: none."""
        if self._event:
            return self._event
        for code in self._faults:
            if code in _ABORTED_IN:
                applies = self.state is _ABORTED_IN[code]
            elif code in {0x0008, 0x000A}:
                applies = bool(stw & G_STW.ABSOLUTE_CYCLICALLY)
            elif code == 0x0003:
                applies = bool(stw & G_STW.PARK)
            else:
                applies = True
            if applies:
                return code
        command = (stw & _COMMAND) >> COMMAND_SHIFT
        if command > CANCEL:
            return COMMAND_NOT_SUPPORTED
        if stw & (G_STW.SET_HOME | G_STW.SHIFT_HOME) and not self._home:
            return COMMAND_NOT_SUPPORTED
        if stw & G_STW.ABSOLUTE_CYCLICALLY and not self.form.absolute:
            return 0x0008
        if stw & G_STW.PARK and not self.abilities.parking:
            return 0x0003
        if command == ACTIVATE or self.state in {SD5, SD10}:
            measure = stw & G_STW.MEASURE
            if stw & FUNCTION_MASK & ~(self._measures if measure else self._marks):
                return _ABORTED.get(self.state, 0x0006 if measure else 0x0004)
        return 0

    def _park(self, now_ns: int) -> None:
        self._drop()
        self._event = 0
        self._parked_ns = now_ns
        self.state = SD12

    def _fault(self, code: int) -> None:
        self._drop()
        self._event = 0
        self._code = code
        self.state = SD3

    # -- functions -------------------------------------------------------------------------------------

    def _activate(self, functions: int, measure: bool) -> None:
        """Start functions; what they have found before is forgotten (PTO-249)."""
        if not functions:
            return
        self._running |= functions
        for bit in (1, 2, 4, 8):
            if functions & bit:
                self._values.pop((measure, bit), None)
        if functions & 1 and not measure:
            self._watch(True)

    def _latch(self, function: int, increments: int) -> None:
        if self._running & function:
            self._running &= ~function
            self._values[self.state is not SD5, function] = self._counting.in_xist1(increments)

    def _show(self, functions: int, measure: bool) -> bool:
        """Choose the value of the lowest function asked for; return whether one was found."""
        for bit in (1, 2, 4, 8):
            if functions & bit and (measure, bit) in self._values:
                self._shown = bit << 4
                self._value = self._values[measure, bit]
                return True
        return False

    def _drop(self) -> None:
        """Stop all functions and forget what they have found."""
        self._running = 0
        self._asked = 0
        self._shown = 0
        self._value = 0
        self._values: dict[tuple[bool, int], int] = {}
        if self.abilities.zero_mark_tolerance is None:
            self._watch(False)

    def _watch(self, watching: bool) -> None:
        if watching is not self._watching:
            self._watching = watching
            if watching:
                self._encoder.watch_zero_mark(self._on_zero_mark)
            else:
                self._encoder.unwatch_zero_mark(self._on_zero_mark)

    def _on_zero_mark(self, increments: int, _before: float, _at: float, _after: float) -> None:
        if not self.external_mark:
            self.reference_mark(1, increments)
        tolerance = self.abilities.zero_mark_tolerance
        if tolerance is None:
            if not (self._running & 1 and self.state is SD5):
                self._watch(False)
            return
        if self._last_mark is not None:
            counts = self.form.counts
            apart = (increments - self._last_mark) % counts
            if min(apart, counts - apart) > tolerance:
                self.report(0x0002)
        self._last_mark = increments

    # -- words -----------------------------------------------------------------------------------------

    def _words(self, stw: int) -> tuple[int, int, int]:
        state = self.state
        if state is SD12:
            return G_ZSW.PARKING, 0, 0
        if self.valid:
            self._xist1 = self._counting.xist1()
        if state is SD3:
            return G_ZSW.ERROR, self._xist1, signed32(self._code)
        if state is SD2:
            zsw = G_ZSW.ACKNOWLEDGING | G_ZSW.ERROR if self._code else int(G_ZSW.ACKNOWLEDGING)
            return zsw, self._xist1, signed32(self._code)
        zsw = self._running
        xist2 = 0
        if state is SD4 or state is SD11:
            zsw |= self._shown
            xist2 = self._value
        elif state is SD7:
            zsw |= G_ZSW.HOME_SET
        if self._levels and stw & G_STW.MEASURE and state in _LEVELS_SHOWN:
            zsw |= self._levels << 8
        if stw & G_STW.ABSOLUTE_CYCLICALLY and self.form.absolute and state in _ABSOLUTE_SHOWN:
            zsw |= G_ZSW.ABSOLUTE_CYCLICALLY
            xist2 = self._counting.xist2()
        return zsw, self._xist1, xist2


def _known(code: int) -> int:
    if code not in ENCODER_ERRORS:
        allowed = ", ".join(f"{one:04X}h" for one in ENCODER_ERRORS)
        raise ConfigurationError("encoder error", f"{code:04X}h", f"one of {allowed}")
    return code
