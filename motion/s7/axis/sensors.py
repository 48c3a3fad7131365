"""Several encoders on one axis: which one controls, and what one takes over from another (CFG section 16,
`MC_SetSensor`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from motion.s7.axis.axis import PositioningAxis

SWITCH_BUMPLESS: Final = 0
SWITCH_AS_IT_IS: Final = 1
TRANSFER: Final = 2
TRANSFER_FROM: Final = 3


def set_sensor(axis: PositioningAxis, number: int, mode: int, reference: int) -> None:
    """Switch to an encoder, or transfer a position to it.

    Args:
        axis: The axis.
        number: Encoder to switch to, or to transfer to, 1 to 4.
        mode: 0 switch and transfer the position of the axis, 1 switch without a transfer, 2 transfer the
            position of the axis without a switch, 3 transfer that of `reference`.
        reference: Encoder whose position is transferred with mode 3.

    """
    target = axis.sensors[number - 1]
    present = axis.feedback
    if mode == TRANSFER_FROM:
        target.transfer(axis.sensors[reference - 1].position)
        return
    if mode in (SWITCH_BUMPLESS, TRANSFER):
        target.transfer(present.position)
    if mode == TRANSFER or target is present:
        return
    step = target.position - present.position
    axis.take_sensor(number)
    present.discard_correction()
    axis.limits.shift_places(step)
    controlled = axis.facts.controlled and axis.motion.position_controlled
    if step and controlled:
        axis.controller.absorb(step)
    if axis.history is not None:
        axis.history.emit(axis.name, "axis.sensor", sensor=number, step=step)
