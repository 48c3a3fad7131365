"""General state machine of a PROFIdrive axis: S1 to S5 (PD-096 to PD-118). Knows neither motor nor bus."""

from __future__ import annotations

from enum import Enum, IntFlag
from typing import Final

from fieldbus.profidrive.words import STW1


class AxisState(Enum):
    """States, with the bits 0, 1, 2 and 6 of ZSW1 that show them."""

    IDLE = ("waiting for control by PLC", 0x0040)
    S1 = ("S1 switching on inhibited", 0x0040)
    S2 = ("S2 ready for switching on", 0x0001)
    S3 = ("S3 switched on", 0x0003)
    S4 = ("S4 operation", 0x0007)
    S5A = ("S5 ramp stop", 0x0003)
    S5B = ("S5 quick stop", 0x0003)

    def __init__(self, text: str, bits: int) -> None:
        self.number = len(type(self).__members__)
        """Number in the trace."""
        self.text = text
        """Name for log and trace."""
        self.bits = bits
        """ZSW1 & 0047h."""


class Off(IntFlag):
    """Stop commands that do not come from the control word: reactions of
    faults, safety functions (PD-115).
    """

    NONE = 0
    OFF1 = 1
    OFF2 = 2
    OFF3 = 4


# Plain integers: operations on flags cost ten times as much.
_OFF1 = int(Off.OFF1)
_OFF2 = int(Off.OFF2)
_OFF3 = int(Off.OFF3)


class Action(Enum):
    """What a transition asks of the drive."""

    NOTHING = "nothing"
    ENABLE = "enable"
    """Pulses on, follow the setpoint."""
    INHIBIT = "inhibit"
    """Pulses off at once: coast."""
    RAMP_STOP = "ramp stop"
    """Brake with the ramp-down rate, from the actual speed."""
    QUICK_STOP = "quick stop"
    """Brake with the quick-stop rate, from the actual speed."""
    CONTINUE = "continue"
    """The ramp stop is taken back: follow the setpoint again."""


# Names of the module, because in every bus cycle an attribute of an enumeration would cost more than what is
# done with it.
_S4: Final = AxisState.S4
_NOTHING: Final = Action.NOTHING
_RUN: Final = int(STW1.ON | STW1.NO_OFF2 | STW1.NO_OFF3 | STW1.ENABLE_OPERATION)


class GeneralStateMachine:
    """One transition per step at most; OFF2 goes before OFF3, OFF1 and disable operation (PD-114)."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Begin as after power-on (PD-096)."""
        self._enter(AxisState.IDLE)

    @property
    def enabled(self) -> bool:
        """Whether the motor has torque."""
        return self.state in {AxisState.S4, AxisState.S5A, AxisState.S5B}

    def step(
        self,
        stw1: int,
        *,
        off: int = 0,
        standstill: bool,
        ready: bool = True,
        synchronised: bool = True,
    ) -> Action:
        """Evaluate a control word.

        Args:
            stw1: Control word in effect: the last one with control by PLC.
            off: Stop commands of faults and safety functions, bits of `Off`.
            standstill: The axis stands (ends S5).
            ready: The power stage can be enabled: DC link, drive ready, no delay running (PD-103).
            synchronised: The sign of life allows S2 (PD-131).

        """
        if self.state is _S4 and stw1 & _RUN == _RUN and not off:
            return _NOTHING
        on = bool(stw1 & STW1.ON) and not off & _OFF1
        no_off2 = bool(stw1 & STW1.NO_OFF2) and not off & _OFF2
        no_off3 = bool(stw1 & STW1.NO_OFF3) and not off & _OFF3
        operate = bool(stw1 & STW1.ENABLE_OPERATION)
        state = self.state
        if state is AxisState.S4:
            if not no_off2:
                return self._to(AxisState.S1, Action.INHIBIT)
            if not no_off3:
                return self._to(AxisState.S5B, Action.QUICK_STOP)
            if not on:
                return self._to(AxisState.S5A, Action.RAMP_STOP)
            if not operate:
                return self._to(AxisState.S3, Action.INHIBIT)
        elif state is AxisState.S5A:
            if not no_off2:
                return self._to(AxisState.S1, Action.INHIBIT)
            if not no_off3:
                return self._to(AxisState.S5B, Action.QUICK_STOP)
            if standstill or not operate:
                return self._to(AxisState.S2, Action.INHIBIT)
            if on:
                return self._to(AxisState.S4, Action.CONTINUE)
        elif state is AxisState.S5B:
            if not no_off2 or standstill or not operate:
                return self._to(AxisState.S1, Action.INHIBIT)
        elif state is AxisState.S3:
            if not (no_off2 and no_off3):
                return self._to(AxisState.S1)
            if not on:
                return self._to(AxisState.S2)
            if operate and ready:
                return self._to(AxisState.S4, Action.ENABLE)
        elif state is AxisState.S2:
            if not (no_off2 and no_off3):
                return self._to(AxisState.S1)
            if on:
                return self._to(AxisState.S3)
        elif state is AxisState.S1:
            # ON has to be taken away first: the raw bit counts, not what a fault makes of it (PD-098,
            # PD-115).
            if not stw1 & STW1.ON and no_off2 and no_off3 and not off and synchronised:
                return self._to(AxisState.S2)
        elif stw1 & STW1.CONTROL_BY_PLC:
            return self._to(AxisState.S1)
        return Action.NOTHING

    def _to(self, state: AxisState, action: Action = Action.NOTHING) -> Action:
        self._enter(state)
        return action

    def _enter(self, state: AxisState) -> None:
        self.state = state
        # At hand for the status words of every cycle.
        self.number: int = state.number
        """Number of the state in the trace."""
        self.bits: int = state.bits
        """ZSW1 & 0047h of the state."""


__all__ = ["Action", "AxisState", "GeneralStateMachine", "Off"]
