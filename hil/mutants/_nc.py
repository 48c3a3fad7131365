"""Defects of NC axes: enables, error reaction, monitoring, limits, homing, interface."""

from __future__ import annotations

from functools import partial
from typing import Final

from hil.mutants._mutant import Mutant, defect

_AXIS: Final = "motion.nc.axis:NcAxis"
_MONITORING: Final = "motion.nc.monitoring:Monitoring"
_HOMING: Final = "motion.nc.homing:Homing"
_MOTION: Final = "motion.nc.motion:Motion"
_DEVICE: Final = "motion.nc.device:PortDevice"

_defect = partial(defect, area="nc")

MUTANTS: Final[tuple[Mutant, ...]] = (
    # -- errors --
    _defect(
        "nc-error-forgotten",
        "An error aborts the commands and is forgotten at once",
        f"{_AXIS}.raise_error",
        "        self.motion.abort(CommandState.ERROR, error_id)\n",
        "        self.motion.abort(CommandState.ERROR, error_id)\n        self.error_id = 0\n",
        ids=("NC-148",),
        likely=("fault-reactions/drive-fault/3210/constant@nc",),
    ),
    _defect(
        "nc-reset-does-not-acknowledge",
        "MC_Reset clears the error of the axis and not the fault of the drive",
        f"{_AXIS}.reset",
        "self._reset = max(1, round(_RESET_S / self.cycle_s))",
        "self._reset = 0",
        ids=("NC-377",),
        likely=("fault-reactions/drive-fault/2310/standstill@nc",),
    ),
    _defect(
        "nc-invalid-data-for-ever",
        "Invalid data are borne for ever",
        f"{_AXIS}._supervise_device",
        "self._invalid += 1",
        "self._invalid = 1",
        ids=("NC-427",),
        likely=("fault-reactions/actual-values-lost/constant@nc",),
    ),
    _defect(
        "nc-invalid-data-at-once",
        "The first cycle with invalid data is an error",
        f"{_AXIS}._supervise_device",
        "if self._invalid > self.invalid_cycles:",
        "if self._invalid:",
        ids=("NC-427",),
        likely=("telegram-faults/very-late@nc",),
    ),
    _defect(
        "nc-drive-off-with-invalid-data",
        "The drive is switched off as soon as its data are invalid",
        f"{_DEVICE}.read",
        "            self.ready = False\n",
        "            self.ready = self._on = False\n",
        ids=("NC-427",),
        likely=("telegram-faults/very-late@nc",),
    ),
    # -- enables --
    _defect(
        "nc-enable-lost-silently",
        "Losing the controller enable in motion is no error",
        f"{_AXIS}.cycle",
        "self.raise_error(NO_CONTROLLER_ENABLE)",
        "self.motion.abort(CommandState.ABORTED, NO_ERROR)",
        ids=("NC-733",),
        likely=("stop-modes/power-0/constant@nc",),
    ),
    _defect(
        "nc-feed-enables-swapped",
        "The feed enable of the other direction counts",
        f"{_AXIS}._watch_feed",
        "missing = self._feed_missing(velocity)",
        "missing = self._feed_missing(-velocity)",
        ids=("NC-029",),
        likely=("limits/braking/positive/constant@nc",),
    ),
    # -- monitoring --
    _defect(
        "nc-lag-without-filter",
        "The position lag is an error in the first cycle above its maximum",
        f"{_MONITORING}.watch_lag",
        "over = self._lagging * self._cycle_s > self._lag_time.value * (1.0 + _SLACK)",
        "over = True",
        ids=("NC-136",),
        likely=("monitoring/jam/20@nc", "monitoring/jam/50@nc"),
    ),
    _defect(
        "nc-lag-of-one-sign",
        "Only a positive position lag is monitored",
        f"{_MONITORING}.watch_lag",
        "-limit <= error <= limit",
        "error <= limit",
        ids=("NC-004", "NC-135"),
        likely=("monitoring/jam/-300@nc",),
    ),
    _defect(
        "nc-lag-always-watched",
        "The position lag is monitored although that is switched off",
        f"{_MONITORING}.watch_lag",
        "if not self._lag_on.value or ",
        "if ",
        ids=("NC-134",),
        likely=("monitoring/unwatched/switched-off@nc",),
    ),
    # -- limits and motion --
    _defect(
        "nc-runs-past-the-limit",
        "A motion without target does not stop at its software limit",
        f"{_MOTION}.limit_ahead",
        "        if self.limits_off:\n            return None\n",
        "        return None\n",
        ids=("NC-130",),
        likely=("limits/software/positive/constant/current@nc",),
    ),
    _defect(
        "nc-limit-passed-unseen",
        "A software limit that is passed in positive direction is no error",
        f"{_AXIS}._limit_passed",
        "velocity > 0.0 and self._high_on.value",
        "velocity > 0.0 and self._low_on.value > 1.0 and self._high_on.value",
        ids=("NC-744",),
        likely=("limits/software/positive/passed/moved/braking@nc",),
    ),
    # -- homing --
    _defect(
        "nc-home-where-it-stands",
        "The home position is given to the place where the axis stands, not to the sync event",
        f"{_HOMING}._take_reference",
        "self._shift(self._home - self._sync)",
        "self._shift(self._home - self._encoder.uncorrected)",
        ids=("NC-313",),
        likely=("homing/cam/positive/above@nc",),
    ),
    _defect(
        "nc-searches-the-cam-the-other-way",
        "The direction of the search for the cam is that of the sync search",
        f"{_HOMING}.step",
        "self._go(-1.0 if self._invert_cam.value else 1.0, self._towards.value)",
        "self._go(self._sync_direction, self._towards.value)",
        ids=("NC-307",),
        likely=("homing/cam/positive/above@nc",),
    ),
    _defect(
        "nc-homed-after-abort",
        "A sequence that is aborted leaves the axis homed",
        f"{_HOMING}.abort",
        "        self.error_id = error_id\n",
        "        self.error_id = error_id\n        self._encoder.homed = True\n",
        ids=("NC-314",),
        likely=("homing/aborted/stop/approach@nc", "homing/encoder-lost/cam@nc"),
    ),
    _defect(
        "nc-position-set-with-a-step",
        "Another position of the present place moves the actual position alone",
        f"{_AXIS}.shift",
        "        self.motion.shift(offset)\n",
        "",
        ids=("NC-242",),
        likely=("homing/direct/0@nc", "homing/direct/1@nc"),
    ),
    # -- motions, coupling, external setpoints, interface --
    _defect(
        "nc-override-without-effect",
        "The override does not change the velocity",
        f"{_MOTION}._velocity",
        "override = self.override",
        "override = 1.0",
        ids=("NC-168", "NC-169"),
        likely=("nc-axes/ramp/override",),
    ),
    _defect(
        "nc-blends-with-the-wrong-velocity",
        "A target is passed with the higher velocity where the lower one is asked for",
        f"{_MOTION}._blend",
        "BufferMode.BlendingLow: min(",
        "BufferMode.BlendingLow: max(",
        ids=("NC-726",),
        likely=("nc-axes/buffer/blendinglow",),
    ),
    _defect(
        "nc-modulo-the-other-way",
        "A modulo motion in negative direction goes the positive way",
        "motion.nc.modulo:modulo_distance",
        "sign = 1.0 if direction == Direction.POSITIVE else -1.0",
        "sign = 1.0",
        ids=("NC-713",),
        likely=("nc-axes/modulo/negative-90.0", "nc-axes/modulo/negative-30.0"),
    ),
    _defect(
        "nc-gear-with-the-wrong-sign",
        "A slave takes the magnitude of its ratio",
        "motion.nc.coupling:Coupling.couple",
        "self.ratio = ratio",
        "self.ratio = abs(ratio)",
        ids=("NC-244",),
        likely=("nc-axes/gear/-0.5",),
    ),
    _defect(
        "nc-master-without-its-slave",
        "An error of a slave does not reach its master",
        f"{_AXIS}._spread_error",
        "coupling.master.raise_error(CONSEQUENTIAL)",
        "pass",
        ids=("NC-211",),
        likely=("nc-axes/gear-error",),
    ),
    _defect(
        "nc-external-generator-locks-nothing",
        "A motion is accepted while external setpoints are active",
        f"{_AXIS}._refused",
        "if self.external.enabled and not self._allow_external.value:",
        "if False:",
        ids=("NC-575",),
        likely=("nc-axes/external",),
    ),
    _defect(
        "nc-watchdog-asleep",
        "The watchdog of the interface never acts",
        "motion.nc.tasks:AxisLink.to_nc",
        "if self._stale > cycles:",
        "if False:",
        ids=("NC-015", "NC-017"),
        likely=("nc-axes/plc-stops",),
    ),
    _defect(
        "nc-stop-locks-nothing",
        "MC_Stop does not keep the axis from other commands",
        f"{_AXIS}._refused",
        "if motion.locked or self.fast_stop.active:",
        "if self.fast_stop.active:",
        ids=("NC-741",),
        likely=("nc-axes/stop/stop",),
    ),
    _defect(
        "nc-jogs-with-the-other-velocity",
        "Jogging slowly has the fast velocity",
        "motion.nc.blocks:MC_Jog._start",
        'velocity = cell("axis.manual_velocity_slow").value',
        'velocity = cell("axis.manual_velocity_fast").value',
        ids=("NC-104",),
        likely=("nc-axes/jog/slow-forward",),
    ),
)
