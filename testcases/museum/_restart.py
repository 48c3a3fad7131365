"""Stops that do not stop, and machines that move when they are switched on again."""

from __future__ import annotations

from typing import Final

from hil.museum import FieldError, Source
from testcases.museum._seeds import known, made

_AREA: Final = "stop and restart"
_AXIS: Final = "motion.s7.axis.axis:TechnologyAxis"
_SERVO: Final = "motion.kernel.servo_axis:ServoAxis"

ENTRIES: Final[tuple[FieldError, ...]] = (
    FieldError(
        name="enabled-again-after-emergency-stop",
        title="The driver switches the servos on again after an emergency stop, without acknowledgement",
        area=_AREA,
        sources=(
            Source(
                "ros-industrial/motoman, issue 154", "https://github.com/ros-industrial/motoman/issues/154"
            ),
            Source("aliasrobotics/RVD, issue 643", "https://github.com/aliasrobotics/RVD/issues/643"),
        ),
        happened=(
            "A robot was stopped by the emergency stop of its pendant. When the button had been released, "
            "the next trajectory from the network switched the servos on and moved the arm; nobody had "
            "acknowledged anything."
        ),
        on_the_bus=(
            "The control word goes back to *operate* while the alarm is still pending; no reset comes "
            "before it."
        ),
        found_by=(
            "Press and release the emergency stop in motion, then give the next command from the automatic "
            "side only. The axis has to stay disabled until somebody acknowledges."
        ),
        campaign="stop_modes",
        case="stop-modes/reaction-2/constant",
        bench="reference",
        defect=known("enabled-again-before-acknowledgement"),
    ),
    FieldError(
        name="trajectory-outlives-emergency-stop",
        title="The rest of the trajectory is executed when the emergency stop is released",
        area=_AREA,
        sources=(
            Source(
                "UniversalRobots/Universal_Robots_ROS_Driver, issue 68",
                "https://github.com/UniversalRobots/Universal_Robots_ROS_Driver/issues/68",
            ),
        ),
        happened=(
            "An arm was stopped by the emergency stop in the middle of a trajectory. The goal stayed alive "
            "in the driver; after the release the arm went through what was left of it at the highest "
            "velocity."
        ),
        on_the_bus=(
            "A motion job stays busy while an alarm is pending; setpoints come again as soon as it is gone."
        ),
        found_by=(
            "Break every motion command by every stop there is, and look at the command, not at the "
            "machine: it has to end with an error. A command that is still busy moves the machine later."
        ),
        campaign="stop_modes",
        case="stop-modes/reaction-1/constant",
        bench="reference",
        defect=known("jobs-run-on-under-alarm"),
    ),
    FieldError(
        name="old-goal-after-enabling",
        title="When it is enabled again, the axis goes back to where it was before",
        area=_AREA,
        sources=(
            Source(
                "RethinkRobotics/baxter_interface, issue 65",
                "https://github.com/RethinkRobotics/baxter_interface/issues/65",
            ),
            Source(
                "pollen-robotics/reachy_mini, issue 1136",
                "https://github.com/pollen-robotics/reachy_mini/issues/1136",
            ),
        ),
        happened=(
            "The arms of a robot had sunk while it was switched off. Enabled again, they shot back to the "
            "last goal in the shortest possible time: the position controller had kept its setpoint."
        ),
        on_the_bus=(
            "The first setpoint after *Operation enabled* is not the actual position; the velocity goes to "
            "its limit in the first cycle, or the following error trips at once, each time the axis is "
            "enabled."
        ),
        found_by=(
            "Switch off, move the axis by hand or let it coast, switch on. The setpoint has to be the "
            "actual position in the first cycle."
        ),
        campaign="fault_reactions",
        case="fault-reactions/drive-fault/2310/constant",
        bench="reference",
        defect=made(
            "old-goal-after-enabling",
            "axis",
            "A disabled axis keeps its setpoint, and is enabled with it",
            (
                "motion.s7.axis.enabling:EnableControl._arrive",
                (
                    "servo.basic.set_state(position, 0.0)\n            if servo.has_position:\n"
                    "                servo.controller.reset(position)\n"
                ),
                (
                    "servo.basic.set_state(servo.basic.s, 0.0)\n            if servo.has_position:\n"
                    "                servo.controller.reset(servo.basic.s)\n"
                ),
            ),
            (
                f"{_AXIS}.cycle",
                "                servo.basic.set_state(tracked, 0.0)\n",
                "                pass\n",
            ),
        ),
    ),
    FieldError(
        name="cancelled-motion-still-moves",
        title="A stop begins at the setpoint of the motion that it ends, not at the machine",
        area=_AREA,
        sources=(
            Source(
                "UniversalRobots/Universal_Robots_ROS_Driver, issue 274",
                "https://github.com/UniversalRobots/Universal_Robots_ROS_Driver/issues/274",
            ),
        ),
        happened=(
            "A trajectory was cancelled during a protective stop, to hold the place where the arm stood. "
            "The desired state was still a point of the cancelled trajectory, so the arm moved there "
            "quickly when it was resumed."
        ),
        on_the_bus=(
            "The first setpoint of the stop lies ahead of the actual position by the whole following error."
        ),
        found_by=(
            "Stop while the axis lags: load it, or limit its torque, so that setpoint and machine are "
            "apart. An emergency ramp has to begin with actual position and actual velocity."
        ),
        campaign="fault_reactions",
        case="fault-reactions/emergency-from-actual-values",
        bench="reference",
        defect=known("emergency-ramp-from-setpoint"),
    ),
    FieldError(
        name="outputs-stop-at-a-fault",
        title="After a fault the controller sends no new setpoints, and the drives keep the last one",
        area=_AREA,
        sources=(
            Source(
                "project-march/hardware-interface, pull request 233",
                "https://github.com/project-march/hardware-interface/pull/233",
            ),
            Source("project-march/march, issue 285", "https://github.com/project-march/march/issues/285"),
        ),
        happened=(
            "When one of the eight drives of an exoskeleton tripped, the master stopped calculating but "
            "left the bus running. The seven others kept the effort of the last cycle for 0.45 s, until "
            "their watchdogs stopped them."
        ),
        on_the_bus=(
            "Setpoint frames stay away, or repeat one value, from the moment of the fault, while SYNC goes "
            "on. The stop is that of the drive's watchdog, not the ramp that was configured."
        ),
        found_by=(
            "Trip one drive of several in motion and measure what the others do. The setpoint has to ramp "
            "down from the first cycle after the fault."
        ),
        campaign="stop_modes",
        case="stop-modes/reaction-1/constant",
        bench="reference",
        defect=made(
            "outputs-stop-at-a-fault",
            "axis",
            "While an alarm is pending no telegram is sent",
            (
                f"{_AXIS}.write_outputs",
                "        servo = self.servo\n",
                "        if self.engine.error_word:\n            return\n        servo = self.servo\n",
            ),
        ),
    ),
    FieldError(
        name="lost-drive-is-only-a-warning",
        title="A drive that has left the bus is reported and otherwise ignored",
        area=_AREA,
        sources=(
            Source(
                "project-march/hardware-interface, pull request 98",
                "https://github.com/project-march/hardware-interface/pull/98",
            ),
            Source(
                "ICube-Robotics/ethercat_driver_ros2, issue 123",
                "https://github.com/ICube-Robotics/ethercat_driver_ros2/issues/123",
            ),
        ),
        happened=(
            "A master ended itself when a slave left the bus. Because that happened often, the error was "
            "made a warning: the master went on. Another one said nothing at all when a device was missing "
            "from the start."
        ),
        on_the_bus=(
            "The actual position stands still in the controller while the setpoint goes on. If the drive "
            "still gets setpoints, the machine runs, and the position controller drives it faster and "
            "faster."
        ),
        found_by=(
            "Take the actual values away for a second, with the setpoints left on the bus: frames dropped, "
            "not the plug pulled. The axis has to be disabled within the configured cycles."
        ),
        campaign="fault_reactions",
        case="fault-reactions/actual-values-lost/constant",
        bench="reference",
        defect=made(
            "lost-drive-is-only-a-warning",
            "axis",
            "Missing actual values are borne for ever",
            ("motion.drives._link:LinkedPort._judge", "self._link_age += 1", "self._link_age += 0"),
        ),
    ),
    FieldError(
        name="creeps-while-inactive",
        title="An axis at rest creeps away, because its setpoint follows the noise of its encoder",
        area=_AREA,
        sources=(
            Source(
                "ICube-Robotics/ethercat_driver_ros2, issue 75",
                "https://github.com/ICube-Robotics/ethercat_driver_ros2/issues/75",
            ),
            Source(
                "ICube-Robotics/ethercat_driver_ros2, issue 179",
                "https://github.com/ICube-Robotics/ethercat_driver_ros2/issues/179",
            ),
        ),
        happened=(
            "Drives in csp were enabled before a controller was active. In every cycle the driver took the "
            "actual position as the next target: with noise and gravity the joints moved slowly, one up to "
            "its end stop."
        ),
        on_the_bus="The target position changes by single increments although no motion has been commanded.",
        found_by=(
            "Log the target of an axis that is enabled and has nothing to do, for a minute, with its load. "
            "It has to be one number."
        ),
        campaign="axis_signals",
        case="axis-signals/standstill",
        bench="reference",
        defect=made(
            "creeps-while-inactive",
            "axis",
            "At rest the setpoint is the actual position of every cycle",
            (
                f"{_SERVO}.close_loop",
                "controller = self.controller\n",
                (
                    "controller = self.controller\n        if v == 0.0 and self.at_rest:\n"
                    "            self.basic.set_state(self.feedback.position, 0.0)\n"
                    "            s = self.feedback.position\n"
                ),
            ),
        ),
    ),
    FieldError(
        name="manual-mode-outlives-connection",
        title="Manual operation from a PC stays in force when the connection to the PC is lost",
        area=_AREA,
        sources=(
            Source(
                "Lenze application knowledge base, 201800280 (i950 before V01.03.07)",
                "https://www.lenze.com/en-de/go/akb/201800280/1",
            ),
        ),
        happened=(
            "A servo inverter was jogged from the commissioning tool when the connection broke. The mode of "
            "operation stayed on manual: the controller no longer had a say, and the next enable moved the "
            "axis with the last manual setpoints, without travel limits."
        ),
        on_the_bus=(
            "The mode display does not go back after the time-out; control words of the controller have no "
            "effect."
        ),
        found_by=(
            "Jog from the tool and pull the cable of the PC. The axis has to stop, give control back, and "
            "start with the setpoints of the controller."
        ),
        campaign="commissioning",
        case="commissioning/connection-lost/relative",
        bench="reference",
        defect=known("life-sign-unwatched"),
    ),
)
