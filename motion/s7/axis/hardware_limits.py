"""Hardware limit switches: where they are read, what they mean, and when the axis may move on (LIM sections
1.3 to 1.8).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Final

from motion.drives.port import INPUT_NEGATIVE_LIMIT, INPUT_POSITIVE_LIMIT
from motion.s7.axis.state import AxisState
from motion.s7.data_blocks import BitAddress

if TYPE_CHECKING:
    from motion.kernel.cell import Cell
    from motion.kernel.servo_axis import ServoAxis
    from motion.s7.axis.alarms import AxisAlarms
    from motion.s7.axis.motion import MotionControl
    from motion.s7.axis.state import AxisStates
    from motion.s7.data_blocks import DataBlocks
    from motion.s7.variables import VariableStore

ALARM_INPUT_CONFIGURATION: Final = 109
ALARM_HARDWARE: Final = 531

_APPROACHED: Final = {1: 1, -1: 2}
"""Cause of alarm 531 by the direction of the switch."""
_BLOCKED_DIRECTION: Final = 3
_REVERSED: Final = 4
_BOTH: Final = 5
_ENCODER: Final = 6
"""Causes 4 to 6 allow no retraction (LIM-053, LIM-061, LIM-062)."""
_INPUT_CAUSE: Final = {-1: 1, 1: 2}
"""Cause of alarm 109 by the direction of the switch."""
_TRAVERSABLE: Final = 1


class HardwareSwitch:
    """One hardware limit switch.

    Args:
        direction: +1 for the positive one.
        mask: Its bit among the inputs of the port.
        level: `MinSwitchLevel` or `MaxSwitchLevel`.
        address: Cells of `RID`, `Area`, `DbNumber`, `Offset` of the variable that
            is read in place of the input.

    """

    def __init__(self, direction: int, mask: int, level: Cell[bool], address: tuple[Cell[int], ...]) -> None:
        self.direction = direction
        self.mask = mask
        self.level = level
        self._address = address
        self.begin()

    def begin(self) -> None:
        """Begin without having been met."""
        self.active = False
        """StatusWord.X17 or X18."""
        self.trip: float | None = None
        """Position at which a traversable switch was met."""
        self.met = False
        """It has been active during the present active homing."""
        self.is_variable = self.address.given
        """It is a variable, and no input."""
        self._read: Callable[[], bool] | None = None

    @property
    def address(self) -> BitAddress:
        """Where the variable is that is read in place of an input; not `given` for an input."""
        return BitAddress(*(cell.value for cell in self._address))

    @property
    def name(self) -> str:
        """Where it is configured."""
        return f"PositionLimits_HW.{'Max' if self.direction > 0 else 'Min'}SwitchAddress"

    def level_of_variable(self, blocks: DataBlocks) -> bool:
        """Return what the variable says; where there is none the switch is not met."""
        if self._read is None:
            if blocks.problem(self.address):
                return not self.level.value
            self._read = blocks.reader(self.address)
        return self._read()


class HardwareLimits:
    """The hardware limit switches of one axis.

    They are inputs of the drive (60FDh) or of an I/O station, as the bench wires
    them, or bits in a data block.

    Args:
        store: Variables of the axis.
        servo: The axis in the kernel.
        states: State of the axis.
        alarms: Its alarms.
        motion: Its jobs.
        data_blocks: Returns the global data blocks of the controller.

    """

    def __init__(
        self,
        store: VariableStore,
        *,
        servo: ServoAxis,
        states: AxisStates,
        alarms: AxisAlarms,
        motion: MotionControl,
        data_blocks: Callable[[], DataBlocks],
    ) -> None:
        self._servo = servo
        self._states = states
        self._alarms = alarms
        self._motion = motion
        self._data_blocks = data_blocks
        bind = store.bind
        self._hw_active = bind("PositionLimits_HW.Active")
        self._mode = bind("PositionLimits_HW.Mode")
        self._behaviour = bind("PositionLimits_HW.ApproachBehavior")

        def switch(direction: int, name: str, mask: int) -> HardwareSwitch:
            place = f"PositionLimits_HW.{name}Switch"
            address = tuple(bind(f"{place}Address.{part}") for part in ("RID", "Area", "DbNumber", "Offset"))
            return HardwareSwitch(direction, mask, bind(f"{place}Level"), address)

        self.negative = switch(-1, "Min", INPUT_NEGATIVE_LIMIT)
        self.positive = switch(+1, "Max", INPUT_POSITIVE_LIMIT)
        self._switches = (self.negative, self.positive)
        self.in_servo = True
        """The switches are read in the servo cycle (`PIP OB Servo`); else with the
        call of the program (LIM-025).
        """
        self.begin()

    def begin(self) -> None:
        """Begin with the switches that are configured now, none of them met."""
        for switch in self._switches:
            switch.begin()
        self._variables = any(one.is_variable for one in self._switches)
        self._all_variables = all(one.is_variable for one in self._switches)
        self._image: int | None = None
        self.reversing = False
        """Active homing turns round at the switches: they are shown, and there is no alarm (HOM-109)."""
        self._leaving: HardwareSwitch | None = None
        """Switch that active homing leaves after it has found its mark next to it."""
        self._given_before: float | None = None
        """Position setpoint of the cycle before, while setpoints come from the user program."""
        self._barred = 0
        """Cause of alarm 531 that allows no retraction, 0 without one."""

    # -- where they are
    # ---------------------------------------------------------------------------------------

    def check_addresses(self) -> None:
        """Raise 109 where a switch that is a variable is watched from the start on; that has to wait for the
        program (LIM-070).
        """
        if not self._hw_active.value or self._servo.simulated:
            return
        for switch in self._switches:
            if switch.is_variable:
                self._alarms.raise_alarm(
                    ALARM_INPUT_CONFIGURATION,
                    info=_INPUT_CAUSE[switch.direction],
                    text="a variable as switch needs Active = FALSE in the configuration, and parameter "
                    "1000 later",
                )

    def address_problem(self) -> str:
        """Return why a switch cannot be read at the address of its variable; empty if all can (LIM-072)."""
        blocks = self._data_blocks()
        for switch in self._switches:
            problem = blocks.problem(switch.address) if switch.is_variable else ""
            if problem:
                return f"{switch.name}: {problem}"
        return ""

    def update_image(self) -> None:
        """Take the inputs over as the process image of the program that begins now (LIM-025)."""
        self._image = self._servo.port.inputs

    def _inputs(self) -> int:
        """Return the levels of both switches as bits of the inputs, wherever they are read."""
        image = self._image
        inputs = self._servo.port.inputs if self.in_servo or image is None else image
        if self._variables:
            for switch in self._switches:
                if switch.is_variable:
                    on = switch.level_of_variable(self._data_blocks())
                    inputs = inputs | switch.mask if on else inputs & ~switch.mask
        return inputs

    # -- what they mean
    # ---------------------------------------------------------------------------------------

    def check_hardware(self) -> None:
        """Evaluate both switches; runs before the setpoint of the cycle."""
        if not self._hw_active.value or self._servo.simulated:
            if self.negative.active or self.positive.active:
                for switch in self._switches:
                    switch.active = False
                    switch.trip = None
                self._barred = 0
            return
        velocity = self._commanded_velocity()
        if not self._servo.port.link_ok and not self._all_variables:
            return  # the levels of a drive that is lost mean nothing
        inputs = self._inputs()
        met = None
        for switch in self._switches:
            on = (inputs & switch.mask != 0) is (switch.level.value != 0)
            if self.reversing:
                self._turn_at(switch, on, inputs, velocity)
            elif switch is self._leaving:
                switch.active = on
                if not on:
                    self._leaving = None
            elif on and not switch.active and met is None:
                met = switch  # behind the other one, which may be left in this very cycle
            elif on or switch.active:
                self._evaluate(switch, on, inputs, velocity)
        if met is not None:
            self._evaluate(met, True, inputs, velocity)

    def _commanded_velocity(self) -> float:
        """Return where the setpoints go: positions of a user program come without a velocity,
        so the difference of positions decides.
        """
        total = self._servo.total
        velocity = total.v
        if not self._motion.given:
            self._given_before = None
            return velocity
        before, self._given_before = self._given_before, total.s
        if velocity == 0.0 and before is not None:
            return (total.s - before) / self._servo.interpolator_s
        return velocity

    def begin_reversal(self) -> None:
        """Active homing turns round at the switches from now on."""
        inputs = self._inputs()
        self.reversing = True
        for switch in self._switches:
            switch.met = (inputs & switch.mask != 0) is (switch.level.value != 0)

    def _turn_at(self, switch: HardwareSwitch, on: bool, inputs: int, velocity: float) -> None:
        """Show a switch at which active homing turns round; one that says the wrong side stops the axis as in
        any other motion.
        """
        if on and not switch.active:
            away = velocity * switch.direction < 0.0
            if (away and not switch.met) or self._both_on(inputs):
                self.end_reversal()
                self._evaluate(switch, on, inputs, velocity)
                return
            switch.met = True
        switch.active = on

    def mark_found(self, direction: int) -> None:
        """Watch the switches again, but for one that is active still and from which the motion to the home
        position leads away.

        Args:
            direction: Of that motion, 1 or -1.

        """
        if not self.reversing:
            return
        leaving = next((one for one in self._switches if one.active and one.direction != direction), None)
        self.end_reversal()
        if leaving is not None:
            leaving.active = True
            self._leaving = leaving

    def end_reversal(self) -> None:
        """Watch the switches again from the next cycle on; one that is still active
        then raises its alarm (HOM-115).
        """
        if self.reversing or self._leaving is not None:
            self.reversing = False
            self._leaving = None
            self.negative.active = self.positive.active = False

    def _evaluate(self, switch: HardwareSwitch, on: bool, inputs: int, velocity: float) -> None:
        if not switch.active:
            switch.active = True
            if self._mode.value == _TRAVERSABLE:
                switch.trip = self._servo.feedback.position
            if (self.negative.active and self.positive.active) or self._both_on(inputs):
                self._barred = _BOTH
            elif self._states.state is AxisState.MOTION and velocity * switch.direction < 0.0:
                self._barred = _REVERSED  # met on the way to the other one
            self._alarm(self._barred or _APPROACHED[switch.direction])
            return
        if not on:
            beyond = (
                switch.trip is not None
                and (self._servo.feedback.position - switch.trip) * switch.direction >= 0.0
            )
            if not beyond:
                switch.active = False
                switch.trip = None
                self._barred = 0
                return
        if switch.trip is not None and self._barred != _ENCODER and not self._servo.sensor_valid:
            self._barred = _ENCODER  # nobody knows when it is back inside
            self._alarm(_ENCODER)
            return
        # Acknowledged, still active, and commanded further outwards: the alarm comes again (LIM-049,
        # LIM-059). Where nobody can say which way is outwards it comes again in both directions.
        if self._states.state is AxisState.MOTION and not self._alarms.blocking:
            outwards = velocity * switch.direction
            if outwards > 0.0 or (self._barred and outwards != 0.0):
                self._alarm(self._barred or _BLOCKED_DIRECTION)

    def _both_on(self, inputs: int) -> bool:
        return all((inputs & one.mask != 0) is (one.level.value != 0) for one in self._switches)

    def _alarm(self, cause: int) -> None:
        traversable = self._mode.value == _TRAVERSABLE
        keeps_enabled = not traversable and self._behaviour.value == 1
        self._alarms.raise_alarm(
            ALARM_HARDWARE,
            reaction=3 if keeps_enabled else 4,
            info=cause,
            restart=cause == _ENCODER or (traversable and cause in (_REVERSED, _BOTH)),
        )

    def shift_places(self, offset: float) -> None:
        """Let the places of traversable switches follow a shift of the coordinate system (LIM-051)."""
        self._given_before = None
        for switch in self._switches:
            if switch.trip is not None:
                switch.trip += offset
