"""Direct homing: the coordinate system shifts, nothing moves (HOM-139 to HOM-167;
modulo axes CFG-112 to CFG-123).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, Protocol

if TYPE_CHECKING:
    from fieldbus.history import History
    from motion.kernel.feedback import Feedback
    from motion.kernel.modulo import Modulo
    from motion.s7.variables import VariableStore

_ADJUSTS: Final = (6, 7, 13)
_FOR_ALL: Final = (0, 1, 11, 12)
"""Modes whose offset all encoders of an axis get, so that they do not drift apart (HOM-001, HOM-002)."""


class Homing(Protocol):
    """An active or passive homing under way."""

    @property
    def busy(self) -> bool:
        """Whether its job has not ended yet."""

    def step(self) -> None:
        """Advance by one application cycle."""


class HomingObject(Protocol):
    """A technology object with a position: axis or external encoder."""

    homed: bool
    """Positions are those of the machine."""
    homings: list[Homing]
    """What is under way."""
    name: str
    history: History | None
    variables: VariableStore

    @property
    def modulo(self) -> Modulo:
        """The modulo range."""

    @property
    def operative_sensor(self) -> int:
        """Number of the operative encoder."""

    @property
    def simulated(self) -> bool:
        """Whether there is no device."""

    @property
    def feedback(self) -> Feedback:
        """The operative encoder."""

    @property
    def sensors(self) -> tuple[Feedback, ...]:
        """All encoders."""

    @property
    def incremental(self) -> bool:
        """Whether the operative encoder is an incremental one."""

    @property
    def sensor_valid(self) -> bool:
        """Whether its value is valid."""

    def sensor_path(self, number: int) -> str:
        """Return where its variables begin."""

    def homing_switch(self, path: str) -> bool:
        """Return whether the digital input has the level of `path.SwitchLevel`."""

    def shift_setpoints(self, offset: float) -> None:
        """Let everything but the encoders follow a shift of the coordinate system."""

    def ends_passive_homing(self) -> int | None:
        """Return why passive homing cannot continue: an ErrorID, 0 = it is aborted, None = it can."""

    def alarm(self, number: int) -> None:
        """Raise a technology alarm."""


def home_directly(
    owner: HomingObject, mode: int, position: float, sensor: int = 0, *, setpoint: float = 0.0
) -> None:
    """Carry out a direct homing.

    On a modulo axis the new place is reached over the shortest distance, which decides what becomes of the
    counter; with mode 7 the counter is 0.

    Args:
        owner: Axis or external encoder.
        mode: 0 absolute, 1 relative, 6 and 7 as 1 and 0 for an absolute encoder, 11 and 12 set the
            position setpoint, 13 as 0 for an incremental encoder.
        position: Position in the axis unit.
        sensor: Encoder for modes 6, 7, 13; 0 = the operative one.
        setpoint: Position setpoint, for modes 11 and 12.

    """
    number = sensor or owner.operative_sensor
    feedback = owner.sensors[number - 1] if mode in _ADJUSTS else owner.feedback
    modulo = owner.modulo
    if mode in (0, 7, 13):
        offset = position - feedback.position
    elif mode in (1, 6, 12):
        offset = position
    else:
        offset = position - setpoint
    if modulo.enabled:
        offset = modulo.wrap(position) - feedback.position if mode == 7 else modulo.shortest(offset)
    if feedback is not owner.feedback:
        feedback.shift(offset)
    else:
        relate(owner, offset, all_sensors=mode in _FOR_ALL)
        owner.homed = True
    if mode in _ADJUSTS:
        owner.variables.set_internal(f"Status{owner.sensor_path(number)}.Adjusted", 1)
    if mode in (6, 7):
        feedback.keep_offset()
    if owner.history is not None:
        owner.history.emit(owner.name, "axis.homed", mode=mode, offset=offset, position=position)


def relate(owner: HomingObject, offset: float, *, all_sensors: bool = False) -> None:
    """Let positions grow by `offset`, setpoints and actual values alike.

    Args:
        owner: Axis or external encoder.
        offset: Axis unit.
        all_sensors: Those of encoders that are not operative, too.

    """
    for feedback in owner.sensors:
        if all_sensors or feedback is owner.feedback:
            feedback.shift(offset)
    owner.shift_setpoints(offset)


def take_relation(owner: HomingObject, *, mode: int, offset: float, mark: float) -> None:
    """The homing mark has been evaluated: homed, adjusted, and kept for an absolute encoder without a kept
    offset (HOM-087).

    Args:
        owner: Axis or external encoder.
        mode: `MC_Home.Mode`.
        offset: By how much positions have grown, axis unit.
        mark: Position of the mark since then, axis unit.

    """
    owner.homed = True
    adjusted = f"Status{owner.sensor_path(owner.operative_sensor)}.Adjusted"
    if not owner.incremental and owner.variables.read(adjusted) == 0:
        owner.feedback.keep_offset()
    owner.variables.set_internal(adjusted, 1)
    if owner.history is not None:
        owner.history.emit(owner.name, "axis.homed", mode=mode, offset=offset, mark=mark)
