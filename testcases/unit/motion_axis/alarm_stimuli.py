"""How each technology alarm of an axis is brought about here: one stimulus per number and cause, with the end
of its cause.

A stimulus gets a rig whose axis moves at 100 mm/s, or a fresh one where the alarm belongs to the start. It
does what brings the alarm about and returns what takes the cause away.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from math import tau
from typing import Any

from motion.drives.simulated import DriveStage
from testcases.unit.motion_axis.conftest import Rig

Undo = Callable[[], object]
LEAD_MM = 10.0


def nothing() -> None:
    """The cause was an event, and is gone."""


@dataclass(frozen=True)
class Stimulus:
    """One alarm and one of its causes.

    Args:
        number: The alarm.
        act: Brings it about; returns what takes the cause away.
        info: Supplementary value expected: the number of the cause in the catalogue; 0 where the text
            says more.
        fresh: Whether the axis has not been enabled before.
        reaction: The reaction, where the configuration decides; None: the usual one.
        variables: Start values of the axis.
        within_s: Time until the alarm is pending.

    """

    number: int
    act: Callable[[Rig], Undo]
    info: int = 0
    fresh: bool = False
    reaction: int | None = None
    variables: dict[str, Any] = field(default_factory=dict)
    within_s: float = 1.0

    @property
    def name(self) -> str:
        """Number and cause."""
        return f"{self.number}-{self.info}" + (f"-reaction{self.reaction}" if self.reaction else "")


def port(**attributes: Any) -> Callable[[Rig], Undo]:
    """Set attributes of the simulated drive; the end of the cause sets them back."""

    def act(rig: Rig) -> Undo:
        before = {name: getattr(rig.port, name) for name in attributes}

        def put(values: dict[str, Any]) -> None:
            for name, value in values.items():
                setattr(rig.port, name, value)

        put(attributes)
        return lambda: put(before)

    return act


def before_start(**attributes: Any) -> Callable[[Rig], Undo]:
    """The same, and then enable the axis for the first time."""

    def act(rig: Rig) -> Undo:
        undo = port(**attributes)(rig)
        rig.cycles(2)
        rig.axis.power()
        return undo

    return act


def variable(**values: float) -> Callable[[Rig], Undo]:
    """Write variables (`__` for a dot) and give a job that meets them; the end of the cause writes the old
    values back.
    """

    def act(rig: Rig) -> Undo:
        paths = {name.replace("__", "."): value for name, value in values.items()}
        before = {path: rig.axis.var(path) for path in paths}

        def put(what: dict[str, float]) -> None:
            for path, value in what.items():
                rig.axis.write(path, value)
            rig.cycles(2)

        put(paths)
        rig.axis.move_velocity(50.0)
        return lambda: put(before)

    return act


def job(method: str = "move_velocity", *values: float, **inputs: float) -> Callable[[Rig], Undo]:
    """Start another job."""

    def act(rig: Rig) -> Undo:
        getattr(rig.axis, method)(*values, **inputs)
        return nothing

    return act


def jump(mm: float) -> Callable[[Rig], Undo]:
    """Let the motor stand ahead of where it should be."""

    def act(rig: Rig) -> Undo:
        rig.port.turn(mm / LEAD_MM * tau)
        return nothing

    return act


def place_at(position: float, direction: float) -> Callable[[Rig], Undo]:
    """Shift the coordinates of the axis so that it is just inside of `position`, and travel on in
    `direction`.
    """

    def act(rig: Rig) -> Undo:
        start = position - direction
        inwards = rig.axis.move_velocity(-20.0 * direction)
        rig.until(inwards.in_velocity)
        rig.axis.home(1.0e12 * direction)
        rig.cycles(2)
        while abs(start - rig.axis.var("ActualPosition")) > 1.0:
            step = start - rig.axis.var("ActualPosition")
            rig.axis.home(max(-1.0e12, min(1.0e12, step)), mode=1)
            rig.cycles(2)
        rig.axis.move_velocity(20.0 * direction)
        return lambda: rig.axis.home(0.0)

    return act


def restart_with(path: str, value: Any) -> Callable[[Rig], Undo]:
    """Disable, write a start value that does not fit, restart; the end of the cause writes the old one."""

    def act(rig: Rig) -> Undo:
        before = rig.axis.variables.start_value(path)
        rig.axis.variables.write_start(path, value)
        rig.axis.reset(restart=True)
        return lambda: rig.axis.variables.write_start(path, before)

    return act


def homed(then: Callable[[Rig], Undo]) -> Callable[[Rig], Undo]:
    """Set the position to 0 before: software limit switches act on a homed axis."""

    def act(rig: Rig) -> Undo:
        rig.axis.home(0.0)
        rig.cycles(2)
        return then(rig)

    return act


def backwards(then: Callable[[Rig], Undo]) -> Callable[[Rig], Undo]:
    """Let the axis move in negative direction before."""

    def act(rig: Rig) -> Undo:
        rig.job = rig.axis.move_velocity(-100.0)
        rig.until(rig.job.in_velocity)
        return then(rig)

    return act


def beyond(position: float) -> Callable[[Rig], Undo]:
    """Take setpoints from outside that jump to `position`."""

    def act(rig: Rig) -> Undo:
        given = rig.axis.motion_in_position(rig.axis.var("Position"))
        rig.cycles(2)
        rig.feed(given, [{"Position": position}])
        return nothing

    return act


def no_mark(rig: Rig) -> Undo:
    """Home actively between two limit switches with nothing else between them."""
    rig.axis.home(0.0, mode=3)
    rig.run(0.5)
    rig.port.switches = 2
    rig.run(0.5)
    rig.port.switches = 0
    rig.run(0.5)
    rig.port.switches = 1
    return lambda: setattr(rig.port, "switches", 0)


def lost_panel(rig: Rig) -> Undo:
    """Move the axis from a control panel that then gives no more signs of life."""
    rig.cycles(5)
    panel = rig.axis.control_panel(alive=False)
    panel.take_control()
    panel.enable()
    rig.until(lambda: panel.enabled)
    panel.jog(50.0)
    rig.run(0.5)
    return nothing


def without_marks(rig: Rig) -> Undo:
    """Home actively on a zero mark that the drive cannot find."""
    undo = port(mark=None)(rig)
    rig.axis.home(0.0, mode=3)
    return undo


def standing_still(rig: Rig) -> Undo:
    """Enable the axis and start a job."""
    rig.enabled()
    rig.axis.move_velocity(50.0)
    return nothing


def refused_restart(rig: Rig) -> Undo:
    """Ask for a restart of an enabled axis."""
    rig.axis.reset(restart=True)
    return nothing


def short_of(distance: float, mm: float, *, before: float = 0.0) -> Callable[[Rig], Undo]:
    """Position exactly, and move the motor by `mm` when the setpoint has ended, or by `before` millimetres
    earlier.
    """

    def act(rig: Rig) -> Undo:
        moved = rig.axis.move_relative(distance)
        rig.until(moved.busy)
        if before:
            rig.until(lambda: rig.axis.var("StatusPositioning.Distance") < before)
        else:
            rig.until(lambda: rig.axis.motion.gen.done)
            rig.cycles(2)
        jump(mm)(rig)
        return nothing

    return act


def start_value_later(path: str, value: object) -> Callable[[Rig], Undo]:
    """Do nothing: the configuration is the cause, until `path` becomes `value` in load memory."""
    return lambda rig: lambda: rig.axis.variables.write_start(path, value)


def variable_as_switch(end: str) -> dict[str, Any]:
    """Return start values with a bit of a data block as limit switch, `Min` or `Max`, that is watched from
    the start on.
    """
    place = f"PositionLimits_HW.{end}SwitchAddress"
    return HARD | {f"{place}.RID": 0x0200_0001, f"{place}.Area": 0x84, f"{place}.DbNumber": 7}


NO_LIMIT = {"FollowingError.EnableMonitoring": False}
SOFT = {
    "PositionLimits_SW.Active": True,
    "PositionLimits_SW.MinPosition": -1.0e4,
    "PositionLimits_SW.MaxPosition": 1.0e4,
}
HARD = {"PositionLimits_HW.Active": True}
TIGHT = {
    "PositioningMonitoring.Window": 0.01,
    "FollowingError.MinValue": 50.0,
    "FollowingError.MaxValue": 90.0,
}
REACHED = {"PositionLimits_SW.MaxPosition": 150.0, "PositionLimits_SW.LimitReachedBehavior": 1}
EXCEEDED = {"PositionLimits_SW.MaxPosition": 150.0, "PositionLimits_SW.LimitExceededBehavior": 1}
SHORT_RANGE = {"Modulo.Enable": True, "Modulo.Length": 0.8}

STIMULI = [
    Stimulus(101, restart_with("Mechanics.LeadScrew", 0.0), fresh=True),
    Stimulus(
        104,
        homed(variable(PositionLimits_SW__MinPosition=20.0, PositionLimits_SW__MaxPosition=10.0)),
        variables=SOFT,
    ),
    Stimulus(106, before_start(link=False), info=2, fresh=True),
    Stimulus(108, before_start(sensor_fault=True), info=2, fresh=True),
    Stimulus(
        109,
        start_value_later("PositionLimits_HW.Active", False),
        info=1,
        fresh=True,
        variables=variable_as_switch("Min"),
    ),
    Stimulus(
        109,
        start_value_later("PositionLimits_HW.Active", False),
        info=2,
        fresh=True,
        variables=variable_as_switch("Max"),
    ),
    Stimulus(110, lambda _: nothing, info=1, fresh=True, variables={"Actor.DriveParameter.MaxSpeed": 7000.0}),
    Stimulus(204, lost_panel, info=1, fresh=True, within_s=4.0),
    Stimulus(304, standing_still, info=1, fresh=True, variables={"DynamicLimits.MaxVelocity": 0.0}),
    Stimulus(305, variable(DynamicLimits__MaxAcceleration=0.0), info=1),
    Stimulus(305, variable(DynamicLimits__MaxDeceleration=0.0), info=2),
    Stimulus(306, variable(DynamicLimits__MaxJerk=0.0), info=1),
    Stimulus(307, place_at(9.0e12, 1.0), info=2, variables=NO_LIMIT),
    Stimulus(307, place_at(-9.0e12, -1.0), info=1, variables=NO_LIMIT),
    Stimulus(308, place_at(9.1e12, 1.0), info=2, variables=NO_LIMIT),
    Stimulus(308, place_at(-9.1e12, -1.0), info=1, variables=NO_LIMIT),
    Stimulus(321, job("move_absolute", 10.0)),
    Stimulus(322, refused_restart),
    Stimulus(341, job("home", 0.0, mode=3), variables={"Homing.ApproachVelocity": 0.0}),
    Stimulus(342, no_mark, variables={"Sensor[1].ActiveHoming.Mode": 2, "Homing.AutoReversal": True} | HARD),
    Stimulus(343, without_marks),
    Stimulus(411, port(sensor_fault=True), info=1),
    Stimulus(411, port(sensor_fault=True, sensor_code=0x0002), info=5),
    Stimulus(411, port(sensor_fault=True, sensor_code=0x000A), info=4),
    Stimulus(412, job("move_velocity", 240.0), info=3, variables=SHORT_RANGE),
    Stimulus(421, port(fault=True), info=1),
    Stimulus(421, port(stage=DriveStage.S1), info=3),
    Stimulus(431, port(link=False), info=1),
    Stimulus(501, job("move_velocity", 600.0)),
    Stimulus(502, job("move_velocity", 50.0, Acceleration=9000.0), info=1),
    Stimulus(502, job("move_velocity", 50.0, Deceleration=9000.0), info=2),
    Stimulus(503, job("move_velocity", 50.0, Jerk=90000.0)),
    Stimulus(
        504, job("move_velocity", 400.0), variables=NO_LIMIT | {"Actor.DriveParameter.MaxSpeed": 2000.0}
    ),
    Stimulus(521, jump(20.0)),
    Stimulus(522, jump(3.3)),
    Stimulus(531, port(switches=2), info=1, variables=HARD),
    Stimulus(531, backwards(port(switches=1)), info=2, variables=HARD),
    Stimulus(531, port(switches=1), info=4, variables=HARD),
    Stimulus(531, port(switches=3), info=5, variables=HARD),
    Stimulus(
        531, port(switches=2), info=1, variables=HARD | {"PositionLimits_HW.ApproachBehavior": 1}, reaction=3
    ),
    Stimulus(
        533,
        homed(job("move_velocity", 200.0)),
        info=2,
        variables=SOFT | {"PositionLimits_SW.MaxPosition": 150.0},
        reaction=2,
    ),
    Stimulus(533, homed(job("move_velocity", 200.0)), info=2, variables=SOFT | REACHED, reaction=1),
    Stimulus(
        533,
        homed(job("move_velocity", -200.0)),
        info=1,
        variables=SOFT | {"PositionLimits_SW.MinPosition": -90.0},
    ),
    Stimulus(
        534,
        homed(beyond(-160.0)),
        info=1,
        variables=SOFT | NO_LIMIT | {"PositionLimits_SW.MinPosition": -150.0},
    ),
    Stimulus(
        534,
        homed(beyond(160.0)),
        info=2,
        variables=SOFT | NO_LIMIT | {"PositionLimits_SW.MaxPosition": 150.0},
    ),
    Stimulus(534, homed(beyond(160.0)), info=2, variables=SOFT | NO_LIMIT | EXCEEDED, reaction=3),
    Stimulus(
        541,
        short_of(10.0, 1.0),
        info=2,
        variables=TIGHT | {"PositioningMonitoring.MinDwellTime": 0.1},
        within_s=2.0,
    ),
    Stimulus(
        541,
        short_of(10.0, 1.0, before=0.05),
        info=1,
        variables=TIGHT | {"PositioningMonitoring.ToleranceTime": 0.0},
        within_s=2.0,
    ),
    Stimulus(550, port(autonomous_stop=True)),
    Stimulus(551, lambda _: nothing, fresh=True, variables={"Actor.DriveParameter.MaxSpeed": 2000.0}),
]

ELSEWHERE = {
    102: "testcases/unit/motion_axis/test_adaption.py",
    103: "testcases/unit/motion_axis/test_adaption.py",
    111: "testcases/unit/motion_axis/test_adaption.py",
    112: "testcases/unit/motion_axis/test_adaption.py",
    552: "testcases/unit/motion_axis/test_adaption.py",
    401: "testcases/unit/hil/test_bench_io.py",
    542: "testcases/unit/hil/test_torque_instructions.py",
    601: "testcases/unit/motion_axis/test_gear_in.py",
    603: "testcases/unit/motion_axis/test_gear_in.py",
    608: "testcases/unit/motion_axis/test_gear_in.py",
    612: "testcases/unit/motion_axis/test_cam_in.py",
    **dict.fromkeys((114, 900, 901, 902, 903), "testcases/unit/motion_axis/test_leading_axis_proxy.py"),
    **dict.fromkeys((752, 753, 754, 755), "testcases/unit/motion_axis/test_measuring_input.py"),
}
"""Alarms that need a drive with parameters, a station or a stop in the way, and where they are brought about.
"""
