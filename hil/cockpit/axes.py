"""An axis as an operator has it, of either make: what is shown, what may be done, and the sign of life."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Protocol

from fieldbus.errors import HilError
from hil.cockpit.messages import MessageError
from hil.cockpit.nc_recording import NcRecorder, jog_key
from hil.cockpit.recording import S7Recorder
from hil.panel import NcPanelSession, PanelSession, parse
from motion.nc.errors import error_text
from motion.s7.axis.state import ENABLED

if TYPE_CHECKING:
    from hil.bench.bench import Bench
    from hil.cockpit.recording import AxisRecorder, StepLog
    from motion.nc.handles import NcAxisHandle
    from motion.s7.handles import AxisHandle

MONITORING_S: Final = 2.0
"""Bench time without a sign of life after which an axis is stopped, disabled and given back, s (COM-024)."""
_ELSEWHERE: Final = frozenset(
    {"axis", "wait", "help", "quit", "status", "optimise", "jog", "f1", "f2", "f3", "f4"}
)
"""Commands that the cockpit has other ways for, as a jog is held, or that would keep it waiting."""
_REACTIONS: Final = {
    0: "no reaction",
    1: "stop with the dynamics of the job",
    2: "stop with the maximum dynamics",
    3: "stop with the emergency ramp",
    4: "the enable is removed",
    5: "setpoints follow the actual values",
}
_RESTART: Final = "Remove the cause, then restart the technology object."
_ACKNOWLEDGE: Final = "Remove the cause, then acknowledge."
_ENABLE_AGAIN: Final = "Remove the cause, acknowledge, then enable the axis again."
_WARNING: Final = "A warning: the axis goes on. Acknowledge it."


class AxisDesk(Protocol):
    """What the cockpit needs of an axis."""

    @property
    def commands(self) -> Mapping[str, tuple[str, str]]:
        """Name -> names of its values (optional ones in brackets), what it does in words."""

    def description(self) -> dict[str, Any]:
        """Return what does not change: kind, units, limits."""

    def state(self) -> dict[str, Any]:
        """Return state, values, alarms and notes."""

    def execute(self, name: str, values: list[str | float]) -> str:
        """Carry out a command; returns what it says.

        Raises:
            HilError: What the panel says to it.

        """

    def jog(self, percent: float) -> None:
        """Jog as long as it is held; 0: let go."""

    def beat(self) -> None:
        """Give a sign of life."""

    def stop(self) -> None:
        """Stop as fast as the dynamics allow; harmless where nothing moves by the panel."""

    def watch(self) -> bool:
        """Look whether the sign of life has failed for too long; returns whether that disabled the axis."""

    def release(self) -> None:
        """Give the axis back, without waiting for it."""

    def close(self) -> None:
        """Give the axis back and wait for it."""

    def recorder(self, log: StepLog) -> AxisRecorder:
        """Return what records the commands of this axis as steps."""


class _Answers:
    """What a session says to a command."""

    def __init__(self) -> None:
        self._lines: list[str] = []

    def add(self, text: str) -> None:
        self._lines.append(text)

    def take(self) -> str:
        text = "\n".join(self._lines)
        self._lines.clear()
        return text


def _execute(session: PanelSession | NcPanelSession, name: str, values: list[str | float]) -> None:
    if name in _ELSEWHERE:
        raise MessageError(f"command {name}: not in the cockpit")
    # By the way of a line, which checks names and numbers.
    line = " ".join([name, *(one if isinstance(one, str) else repr(one) for one in values)])
    if parse(line, session.commands) is None:
        raise MessageError("command: none is given")
    session.execute(line)


def _offered(session: PanelSession | NcPanelSession) -> dict[str, tuple[str, str]]:
    return {
        name: (usage, text) for name, (usage, text, _) in session.commands.items() if name not in _ELSEWHERE
    }


def axis_desks(bench: Bench, folder: Path) -> dict[str, AxisDesk]:
    """Return all axes of a bench by their names.

    Args:
        bench: A bench that has been brought up.
        folder: Where pages are written.

    """
    nc = bench.nc_axis_names
    return {
        name: _nc_desk(bench, name) if name in nc else _s7_desk(bench, name, folder)
        for name in bench.config.axis
    }


def _s7_desk(bench: Bench, name: str, folder: Path) -> S7Desk:
    answers = _Answers()
    session = PanelSession(
        bench,
        name,
        monitoring_s=MONITORING_S,
        plot=folder / "hil-optimisation.html",
        write=answers.add,
        advise=answers.add,
        alive=False,
    )
    torque = bench.recorder.reader(f"{name}.actual_torque")
    return S7Desk(bench.axis(name), session, answers.take, torque, bench.cam_names)


def _nc_desk(bench: Bench, name: str) -> NcDesk:
    answers, axis = _Answers(), bench.axis(name, controller="nc")
    session = NcPanelSession(axis, time=bench, write=answers.add)
    return NcDesk(axis, session, answers.take, lambda: bench.now_s)


class S7Desk:
    """An S7 axis.

    Args:
        axis: The axis.
        session: Carries its commands out.
        answer: Returns what the session has said since the last call.
        torque: Returns its actual torque, Nm; None where there is none.
        cams: Names of the cams that it may follow by.

    """

    def __init__(
        self,
        axis: AxisHandle,
        session: PanelSession,
        answer: Callable[[], str],
        torque: Callable[[], float | None],
        cams: Sequence[str],
    ) -> None:
        self._cams = list(cams)
        self._axis = axis
        self._session = session
        self._answer = answer
        self._panel = session.panel
        self._torque = torque
        self.commands = _offered(session)
        self._units = {what: session.unit(what) for what in ("Length", "Velocity", "Acceleration", "Jerk")}
        self._leaders = [one.name for one in axis.object.leading_objects]
        self._read: Callable[[str], Any] = axis.var

    def description(self) -> dict[str, Any]:
        """Return what does not change."""
        axis, read = self._axis, self._read
        position = axis.has_position
        limits: dict[str, Any] = {
            "velocity": read("DynamicLimits.MaxVelocity"),
            "acceleration": read("DynamicLimits.MaxAcceleration"),
            "deceleration": read("DynamicLimits.MaxDeceleration"),
            "jerk": read("DynamicLimits.MaxJerk"),
        }
        with suppress(HilError):  # a virtual axis has no drive
            limits["torque"] = read("Actor.DriveParameter.ReferenceTorque")
        if position:
            limits["following_error"] = read("FollowingError.MaxValue")
            if axis.object.modulo.enabled:
                limits["position"] = [0.0, axis.object.modulo.length]
            elif read("PositionLimits_SW.Active"):
                limits["position"] = [
                    read("PositionLimits_SW.MinPosition"),
                    read("PositionLimits_SW.MaxPosition"),
                ]
        return {
            "make": "s7",
            "type": type(axis.object).__name__,
            "position": position,
            "units": {name.lower(): unit for name, unit in self._units.items()},
            "limits": limits,
            "leaders": self._leaders,
            "cams": self._cams if self._leaders else [],
            "commands": self.commands,
        }

    def state(self) -> dict[str, Any]:
        """Return what changes."""
        axis, panel, session, read = self._axis, self._panel, self._session, self._read
        found: dict[str, Any] = {
            "state": axis.state.name.lower().replace("_", " "),
            "enabled": axis.state in ENABLED,
            "master": "panel" if panel.active else "program",
            "velocity": read("ActualVelocity") if axis.has_position else read("ActualSpeed"),
            "velocity_setpoint": read("Velocity"),
            "torque": self._torque(),
            "alarms": [
                {
                    "number": one.number,
                    "class": one.entry.alarm_class,
                    "text": one.text,
                    "reaction": _REACTIONS.get(one.reaction, f"reaction {one.reaction}"),
                    "causes": list(one.entry.causes),
                    "remedy": _remedy(one.entry.alarm_class, one.restart, one.stays_enabled),
                }
                for one in reversed(axis.alarms.engine.pending)
            ],
            "notes": session.notes(),
            "slider": panel.slider,
            "dynamics": {
                name: getattr(panel, name) for name in ("velocity", "acceleration", "deceleration", "jerk")
            },
            "job": getattr(panel.job, "instruction", None)
            if panel.job is not None and panel.job.Busy
            else None,
        }
        if axis.has_position:
            found |= {
                "homed": axis.homed,
                "position": read("ActualPosition"),
                "position_setpoint": read("Position"),
                "following_error": read("StatusPositioning.FollowingError"),
                "switches": {
                    text: bool(axis.var(path))
                    for text, path in (
                        ("hardware -", "StatusWord.X17"),
                        ("hardware +", "StatusWord.X18"),
                        ("software -", "StatusWord.X15"),
                        ("software +", "StatusWord.X16"),
                    )
                },
            }
            job = axis.object.motion.synchronous_job
            if job is not None:
                found["synchronous"] = (
                    f"{job.instruction}, {'synchronous' if job.synchronous else 'synchronises'}"
                )
                leader = axis.object.leader
                found["leader"] = None if leader is None else leader.name
        return found

    def execute(self, name: str, values: list[str | float]) -> str:
        """Carry out a command."""
        _execute(self._session, name, values)
        return self._answer()

    def jog(self, percent: float) -> None:
        """Jog, or let go."""
        if percent:
            self._session.execute(f"jog {percent!r}")
            self._answer()
        elif self._panel.active:
            self._panel.slide(0.0)

    def beat(self) -> None:
        """Give a sign of life."""
        self._panel.heartbeat()

    def stop(self) -> None:
        """Stop with the greatest deceleration (COM-029)."""
        if self._panel.active:
            try:
                self._panel.look_away()
            except HilError:
                return  # it is being given back, which has stopped it

    def watch(self) -> bool:
        """Return False: the panel watches its sign of life by itself."""
        return False

    def release(self) -> None:
        """Give the axis back."""
        self._panel.release()

    def close(self) -> None:
        """Give the axis back and wait for it."""
        self._panel.keep_alive(MONITORING_S / 5)
        self._session.close()

    def recorder(self, log: StepLog) -> AxisRecorder:
        """Return what records the commands of this axis as steps."""
        return S7Recorder(self._axis, self._panel, log)


def _remedy(alarm_class: str, restart: bool, stays_enabled: bool) -> str:
    if restart or alarm_class == "R":
        return _RESTART
    if alarm_class == "W":
        return _WARNING
    return _ACKNOWLEDGE if stays_enabled else _ENABLE_AGAIN


class NcDesk:
    """An NC axis. It has no sign of life of its own, so that the rule of the panel is kept here.

    Args:
        axis: The axis.
        session: Carries its commands out.
        answer: Returns what the session has said since the last call.
        now_s: Returns bench time, s.

    """

    def __init__(
        self,
        axis: NcAxisHandle,
        session: NcPanelSession,
        answer: Callable[[], str],
        now_s: Callable[[], float],
    ) -> None:
        self._axis = axis
        self._session = session
        self._answer = answer
        self._now_s = now_s
        self.commands = _offered(session)
        self._beat_s = now_s()
        self._jogs = 0.0

    def _number(self, key: str) -> float:
        return float(self._axis.read_parameter(key))

    def description(self) -> dict[str, Any]:
        """Return what does not change."""
        view = self._axis.online.view()
        unit = view.position_unit
        read = self._axis.read_parameter
        limits: dict[str, Any] = {"velocity": self._number("axis.maximum_velocity")}
        if read("axis.soft_limit_min_enable") and read("axis.soft_limit_max_enable"):
            limits["position"] = [self._number("axis.soft_limit_min"), self._number("axis.soft_limit_max")]
        if read("axis.position_lag_monitoring"):
            limits["following_error"] = self._number("axis.position_lag_max")
        return {
            "make": "nc",
            "type": "NcAxis",
            "position": True,
            "units": {
                "length": unit,
                "velocity": view.velocity_unit,
                "acceleration": f"{unit}/s2",
                "jerk": f"{unit}/s3",
            },
            "limits": limits,
            "leaders": [],
            "commands": self.commands,
        }

    def state(self) -> dict[str, Any]:
        """Return what changes."""
        view = self._axis.online.view()
        error = self._axis.error_id
        words = (
            (view.ready, "ready"),
            (view.has_job, "has job"),
            (view.moving_fw, "moving forward"),
            (view.moving_bw, "moving backward"),
            (view.not_moving, "not moving"),
        )
        return {
            "state": ", ".join(text for flag, text in words if flag),
            "enabled": view.ready,
            "master": "panel",
            "homed": view.calibrated,
            "position": view.actual_position,
            "position_setpoint": view.setpoint_position,
            "velocity": view.actual_velocity,
            "velocity_setpoint": view.setpoint_velocity,
            "following_error": view.lag_distance,
            "torque": None,
            "output": view.total_output,
            "override": view.override,
            "switches": {},
            "alarms": [
                {
                    "number": error,
                    "class": "F",
                    "text": error_text(error),
                    "reaction": "the axis is stopped",
                    "causes": [],
                    "remedy": "Remove the cause, then reset the axis.",
                }
            ]
            if error
            else [],
            "notes": self._session.notes(),
            "slider": self._jogs,
            "dynamics": {},
            "job": "job" if view.has_job else None,
        }

    def execute(self, name: str, values: list[str | float]) -> str:
        """Carry out a command."""
        self.beat()
        _execute(self._session, name, values)
        return self._answer()

    def jog(self, percent: float) -> None:
        """Hold one of the keys F1 to F4: above half of the slider the fast ones (NC-232 to NC-235)."""
        self.beat()
        self._jogs = percent
        if not percent:
            self._session.execute("release")
            return
        self._session.execute(jog_key(percent))

    def beat(self) -> None:
        """Give a sign of life."""
        self._beat_s = self._now_s()

    def stop(self) -> None:
        """Stop, if it is in operation."""
        self._jogs = 0.0
        if self._axis.operational:
            self._session.execute("f6")

    def watch(self) -> bool:
        """Take the enables away when no sign of life has come for the monitoring time."""
        late = self._axis.operational and self._now_s() - self._beat_s > MONITORING_S
        if late:
            self.release()
        return late

    def release(self) -> None:
        """Take the enables away."""
        self._jogs = 0.0
        self._session.execute("disable")

    def close(self) -> None:
        """Stop, and take the enables away."""
        self._session.close()

    def recorder(self, log: StepLog) -> AxisRecorder:
        """Return what records the commands of this axis as steps."""
        return NcRecorder(self._axis, self._session, log)
