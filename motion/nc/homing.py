"""Homing guided by the NC: search for the reference cam, way off it, search for the sync event (section
13).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from motion.nc.commands import ENDLESS, STOP, Command, CommandState
from motion.nc.device import HARDWARE_SYNC
from motion.nc.errors import BLOCK_MODE, NO_ERROR

if TYPE_CHECKING:
    from collections.abc import Callable

    from motion.drives.mark import MarkSearch
    from motion.nc.device import Device
    from motion.nc.encoder import Encoder
    from motion.nc.interface import PlcToNc
    from motion.nc.motion import Motion
    from motion.nc.parameters import ParameterSet

DEFAULT: Final = 0
LATCH_POSITIVE: Final = 2
LATCH_NEGATIVE: Final = 3
SOFTWARE_SYNC: Final = 4
APPLICATION: Final = 5
"""Index of the texts of `enc.reference_mode`."""
_CAM: Final = 0x20
_AT_REST: Final = 0
_TO_CAM: Final = 1
_WAIT_FOR_CAM: Final = 2
_WAIT_FOR_REST: Final = 3
_OFF_CAM: Final = 4
_WAIT_FOR_SYNC: Final = 5
_STOPPING: Final = 6
"""`HomingState`."""


class Homing:
    """The homing sequence of an axis.

    Args:
        parameters: Parameters of the axis.
        motion: Its setpoints.
        encoder: Its encoder.
        device: Its hardware.
        inputs: `PlcToNc` with the cam of the PLC.
        submit: Gives a motion command to the axis; returns the error code that refuses it.
        shift: Moves the coordinate system of the axis.

    """

    def __init__(
        self,
        parameters: ParameterSet,
        *,
        motion: Motion,
        encoder: Encoder,
        device: Device,
        inputs: PlcToNc,
        submit: Callable[[Command], int],
        shift: Callable[[float], None],
    ) -> None:
        cell = parameters.cell
        self._motion = motion
        self._encoder = encoder
        self._device = device
        self._inputs = inputs
        self._submit = submit
        self._shift = shift
        self._towards = cell("axis.homing_velocity_towards_cam")
        self._off = cell("axis.homing_velocity_off_cam")
        self._acceleration = cell("axis.default_acceleration")
        self._deceleration = cell("axis.default_deceleration")
        self._jerk = cell("axis.default_jerk")
        self._invert_cam = cell("enc.homing_invert_cam_search")
        self._invert_sync = cell("enc.homing_invert_sync_search")
        self._mode = cell("enc.reference_mode")
        self._source = cell("enc.homing_sensor_source")
        self._direct = parameters.read("drv.type") in {"MDP_703", "MDP_733"}
        self._command: Command | None = None
        self.waiting = False
        """The sequence waits for the SVB task."""
        self._search: MarkSearch | None = None
        self._home = 0.0
        self._sync = 0.0
        self._cam_fell = 0.0
        self._turns = 0
        self.state = _AT_REST
        self.busy = False
        self.done = False
        self.error_id = NO_ERROR
        """Why the last sequence did not reach its end; 0 when it was stopped, or is there."""
        self.application_request = False
        """The PLC is asked to home the axis (`NcApplicationRequest`, NC-325)."""
        self.latch_difference = 0.0
        """Way from the falling edge of the cam to the sync event, position unit (NC-297)."""

    @property
    def cam(self) -> bool:
        """Whether the reference cam is reached, from the source that is selected (NC-328, NC-329)."""
        source = int(self._source.value)
        if source:
            if source <= 2 and self._direct:
                return self._device.direct_inputs >> (source - 1) & 1 != 0
            return self._device.digital_inputs >> (source - 1) & 1 != 0
        return self._inputs.ControlDWord & _CAM != 0

    def request(self) -> None:
        """Take note that a sequence will start with the next cycle of the SVB task."""
        self.done, self.error_id = False, NO_ERROR
        self.waiting = True

    def start(self, home_position: float) -> int:
        """Begin; the sync event will have the position `home_position`.

        Returns:
            An error code, 0 for none; it is `error_id` as well.

        """
        self.waiting = False
        self.error_id = refused = self._start(home_position)
        return refused

    def _start(self, home_position: float) -> int:
        mode = int(self._mode.value)
        self.done = False
        self._search = None
        if mode == APPLICATION:
            self.application_request = True
            return NO_ERROR
        if mode in {HARDWARE_SYNC, LATCH_POSITIVE, LATCH_NEGATIVE}:
            self._search = self._device.search(mode)
            if self._search is None:
                return BLOCK_MODE
        self._home = home_position
        self._encoder.homed = False
        self._motion.limits_off = True
        self.busy = True
        self._command = None
        self.state = _TO_CAM
        return NO_ERROR

    @property
    def _sync_direction(self) -> float:
        return -1.0 if self._invert_sync.value else 1.0

    def _go(self, direction: float, velocity: float) -> None:
        command = self._command = Command(
            ENDLESS,
            velocity=velocity,
            acceleration=self._acceleration.value,
            deceleration=self._deceleration.value,
            jerk=self._jerk.value,
            target=direction,
        )
        refused = self._submit(command)
        if refused:
            self.abort(refused)

    def _stop(self) -> None:
        deceleration = self._deceleration.value
        command = self._command = Command(
            STOP, acceleration=deceleration, deceleration=deceleration, jerk=self._jerk.value
        )
        self._submit(command)

    def abort(self, error_id: int = NO_ERROR) -> None:
        """End without a reference (NC-314)."""
        if self._search is not None:
            self._search.cancel()
        self.busy = False
        self.state = _AT_REST
        self.error_id = error_id
        self._motion.limits_off = False

    def complete(self) -> None:
        """Take note that the position has a reference now, for example by `MC_SetPosition` of a PLC."""
        self._encoder.homed = True
        self.application_request = False

    def step(self) -> None:
        """Run one cycle, in front of the setpoint."""
        command = self._command
        if command is not None and command.state in {CommandState.ABORTED, CommandState.ERROR}:
            self.abort(command.error_id)
            return
        cam, state = self.cam, self.state
        rests = command is None or command.state is CommandState.DONE
        if state == _TO_CAM:
            # On the cam already, the search for it is skipped (NC-312).
            self.state = _WAIT_FOR_REST if cam else _WAIT_FOR_CAM
            if not cam:
                self._go(-1.0 if self._invert_cam.value else 1.0, self._towards.value)
        elif state == _WAIT_FOR_CAM:
            if cam:
                self.state = _WAIT_FOR_REST
                self._stop()
        elif state == _WAIT_FOR_REST:
            if rests:
                self.state = _OFF_CAM
                self._go(self._sync_direction, self._off.value)
        elif state == _OFF_CAM:
            if not cam:
                self._cam_fell = self._encoder.uncorrected
                self._leave_cam()
        elif state == _WAIT_FOR_SYNC:
            self._look_for_sync()
        elif state == _STOPPING and rests:
            self._take_reference()

    def _leave_cam(self) -> None:
        if int(self._mode.value) == DEFAULT:
            self._found(self._encoder.uncorrected)
            return
        if self._search is not None:
            self._search.start()
        self._turns = self._turn()
        self.state = _WAIT_FOR_SYNC

    def _turn(self) -> int:
        """Return in which turn of the motor the count stands (NC-324)."""
        return self._encoder.soft_increments // self._encoder.turn

    def _look_for_sync(self) -> None:
        search, encoder = self._search, self._encoder
        if search is not None:
            if search.found:
                self._found(encoder.position_of(search.value))
            elif search.failed:
                search.start()
            return
        turn = self._turn()
        if turn != self._turns:
            wrapped = max(turn, self._turns) * encoder.turn
            self._found(encoder.uncorrected + (wrapped - encoder.soft_increments) * encoder.scaling)

    def _found(self, position: float) -> None:
        self._sync = position
        self.latch_difference = position - self._cam_fell
        self._stop()
        self.state = _STOPPING

    def _take_reference(self) -> None:
        self._shift(self._home - self._sync)
        self._encoder.homed = True
        self.state = _AT_REST
        self.busy = False
        self.done = True
        self._motion.limits_off = False
