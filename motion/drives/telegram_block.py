"""A telegram in a data block: a user program stands between process image and axis (CFG section 13).

In one application cycle: the words of the drive arrive, `pre_servo` (`MC_PreServo`) copies and edits them
into `Input`, the axis calculates and fills `Output`, `post_servo` (`MC_PostServo`) copies and edits that into
the words that are sent. Without a program nothing passes: `Input` keeps its initial values, and the drive
gets zeros (CFG-254).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

from fieldbus.profidrive.sign_of_life import next_sign
from fieldbus.profidrive.words import SIGN_OF_LIFE_SHIFT

if TYPE_CHECKING:
    from fieldbus.profidrive import Telegram

_SIGN_MASK = 0xF << SIGN_OF_LIFE_SHIFT

Program = Callable[["TelegramBlock"], object]


class TelegramBlock:
    """`PD_TELx` with `Input` and `Output`, both as the axis sees them: actual values in, setpoints out
    (CFG-255, CFG-256).

    Signals go by their names: `block.Input["ZSW1"]`, `block.Output["NSOLL_B"]`; numbers as in the telegram,
    those of signed signals with their sign.
    """

    def __init__(self, telegram: Telegram) -> None:
        self.name = f"PD_TEL{telegram.number}"
        self.Input: dict[str, int] = dict.fromkeys(telegram.actual.names, 0)
        self.Output: dict[str, int] = dict.fromkeys(telegram.setpoint.names, 0)
        self.received: dict[str, int] = dict(self.Input)
        """Words that have arrived from the drive."""
        self.sent: dict[str, int] = dict(self.Output)
        """Words that go to the drive."""
        self.pre_servo: Program | None = None
        self.post_servo: Program | None = None
        self._sign = 0
        self._suspended: tuple[Program | None, Program | None] | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Signals of `Input` and `Output`."""
        return (*self.Input, *self.Output)

    def suspend(self, suspended: bool) -> None:
        """Stop running the programs, as a controller in STOP does, or continue: meanwhile `Input` stands, and
        zeros are sent.
        """
        if suspended and self._suspended is None:
            self._suspended = self.pre_servo, self.post_servo
            self.pre_servo = self.post_servo = None
            self.sent = dict.fromkeys(self.sent, 0)
        elif not suspended and self._suspended is not None:
            self.pre_servo, self.post_servo = self._suspended
            self._suspended = None

    def pass_through(self, *, sign_of_life: bool = True) -> None:
        """Let programs copy everything, as a direct connection does, with or without the
        sign of life of the controller.
        """
        self.pre_servo = TelegramBlock.copy_input
        self.post_servo = TelegramBlock.copy_output_alive if sign_of_life else TelegramBlock.copy_output

    def copy_input(self) -> None:
        """Copy what has arrived to `Input`: what a program in `MC_PreServo` does at least."""
        self.Input.update(self.received)

    def copy_output(self) -> None:
        """Copy `Output` to what is sent: what a program in `MC_PostServo` does at least."""
        self.sent.update(self.Output)

    def copy_output_alive(self) -> None:
        """Copy `Output` and let the sign of life in STW2 count, which is the task
        of the program here (CFG-260).
        """
        self.copy_output()
        for word in ("STW2", "STW2_ENC"):
            if word in self.sent:
                self._sign = next_sign(self._sign)
                self.sent[word] = self.sent[word] & ~_SIGN_MASK | self._sign << SIGN_OF_LIFE_SHIFT

    def receive(self, answer: Iterable[int]) -> tuple[int, ...]:
        """Run `pre_servo` over what has arrived; return what the axis is to see in this cycle (CFG-253)."""
        self.received.update(zip(self.received, answer, strict=True))
        if self.pre_servo is not None:
            self.pre_servo(self)
        return tuple(self.Input.values())

    def send(self, row: Iterable[int]) -> tuple[int, ...]:
        """Run `post_servo` over what the axis outputs; return what is sent in this cycle (CFG-253)."""
        self.Output.update(zip(self.Output, row, strict=True))
        if self.post_servo is not None:
            self.post_servo(self)
        return tuple(self.sent.values())
