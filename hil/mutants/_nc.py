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
        f"{_AXIS}._take_enable",
        "self.raise_error(NO_CONTROLLER_ENABLE)",
        "self.motion.abort(CommandState.ABORTED, NO_ERROR)",
        ids=("NC-733",),
        likely=("stop-modes/power-0/constant@nc",),
    ),
    _defect(
        "nc-feed-enables-swapped",
        "The feed enable of the other direction counts",
        f"{_AXIS}._watch_feed",
        "error_id = NO_FEED_PLUS if velocity > 0.0 else NO_FEED_MINUS",
        "error_id = NO_FEED_MINUS if velocity > 0.0 else NO_FEED_PLUS",
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
)
