"""Drives that take a command for another one, and brakes at the wrong moment."""

from __future__ import annotations

from typing import Final

from hil.museum import FieldError, Source
from testcases.museum._seeds import known, made

_AREA: Final = "drive and brake"
_FUNCTION: Final = "emulators.drive.cia402.function:DriveFunction"

ENTRIES: Final[tuple[FieldError, ...]] = (
    FieldError(
        name="halt-is-a-quick-stop",
        title="Halt is executed as a quick stop",
        area=_AREA,
        sources=(
            Source(
                "ros-industrial/ros2_canopen, issue 260",
                "https://github.com/ros-industrial/ros2_canopen/issues/260",
            ),
        ),
        happened=(
            "The service *halt* of a CiA 402 driver did not set bit 8 of the control word but withdrew bit "
            "2. The axes braked with the ramp for emergencies, and had left Operation enabled afterwards."
        ),
        on_the_bus=(
            "The slope is that of 6085h in place of 6084h; with the driver's form of it, 6040h shows 0002h."
        ),
        found_by=(
            "Give the ramps of halt and quick stop values that are not alike before the first test. With "
            "equal ramps nobody sees which one runs."
        ),
        campaign="cia402_modes",
        case="cia402-modes/option/halt-1-pv",
        defect=made(
            "halt-is-a-quick-stop",
            "cia402",
            "Halt brakes with the quick stop ramp whatever 605Dh says",
            (
                f"{_FUNCTION}._stop_for_halt",
                "self.mode.stop(self.axis.halt_option)",
                "self.mode.stop(StopOption.QUICK_STOP)",
            ),
        ),
    ),
    FieldError(
        name="first-target-is-zero",
        title="In csp the drive jumps to position 0 when it is enabled",
        area=_AREA,
        sources=(
            Source(
                "ICube-Robotics/ethercat_driver_ros2, issue 125",
                "https://github.com/ICube-Robotics/ethercat_driver_ros2/issues/125",
            ),
        ),
        happened=(
            "A servo that was not at 0 jerked when the controller was started: the first target position "
            "that reached it was 0, before the controller had read where the axis was."
        ),
        on_the_bus="607Ah is 0 in the cycle in which the drive reaches Operation enabled, and 6064h is not.",
        found_by=(
            "Never commission at position 0. Move the axis away by hand, start the controller, and look at "
            "the first target; a drive should refuse to follow a target that it has never been given."
        ),
        campaign="cia402_modes",
        case="cia402-modes/first-target",
        defective_bench="testcases.museum.benches:UNPRIMED",
    ),
    FieldError(
        name="reset-bit-stays-set",
        title="The fault reset is held high, so that it works once or not at all",
        area=_AREA,
        sources=(
            Source(
                "ICube-Robotics/ethercat_driver_ros2, issue 76",
                "https://github.com/ICube-Robotics/ethercat_driver_ros2/issues/76",
            ),
            Source(
                "pcdshub/lcls-twincat-motion, issue 202",
                "https://github.com/pcdshub/lcls-twincat-motion/issues/202",
            ),
            Source(
                "ros-industrial/ros_canopen, pull request 138",
                "https://github.com/ros-industrial/ros_canopen/pull/138",
            ),
        ),
        happened=(
            "Drivers wrote 0080h while the drive showed a fault. When the first attempt came too early the "
            "bit stayed set, there was no further edge, and the drive could not be reset without a power "
            "cycle."
        ),
        on_the_bus="6040h stays at 0080h and 6041h at xx08h.",
        found_by=(
            "Acknowledge while the cause is still there, then take the cause away and acknowledge again. "
            "Every acknowledgement needs its own rising edge."
        ),
        campaign="drive_faults",
        case="drive-faults/acknowledge-held",
        bench="reference",
        defect=made(
            "reset-bit-stays-set",
            "axis",
            "Bit 7 of the control word is set as long as the drive shows a fault",
            (
                "motion.drives.cia402:Cia402Port._control",
                "if stw1 & _ACKNOWLEDGE:\n",
                "if stw1 & _ACKNOWLEDGE or self._statusword & 0x0008:\n",
            ),
        ),
    ),
    FieldError(
        name="brake-follows-the-command",
        title="The holding brake opens with the command to enable, whether or not the drive has torque",
        area=_AREA,
        sources=(
            Source("epics-modules/ecmc, issue 55", "https://github.com/epics-modules/ecmc/issues/55"),
            Source(
                "pcdshub/lcls-twincat-motion, issue 52",
                "https://github.com/pcdshub/lcls-twincat-motion/issues/52",
            ),
        ),
        happened=(
            "The brake output was led by the command and not by the state of the drive. On one stage the "
            "brake let go before the motor held, and the stage slipped; with a drive that lost its enable "
            "the brake stayed open."
        ),
        on_the_bus=(
            "The brake is open in Ready to switch on or Switched on; the position changes without torque."
        ),
        found_by=(
            "Test with the real load hanging, and refuse the enable: pull the safe-torque-off connector, "
            "then command the axis on and off. The load has to stay where it is."
        ),
        campaign="holding_brake",
        case="holding-brake/closes/power-0",
        defect=made(
            "brake-follows-the-command",
            "cia402",
            "The brake opens with the command Shutdown already",
            (
                f"{_FUNCTION}.control",
                "self.execute(machine.control(word))",
                (
                    "self.execute(machine.control(word))\n        if word & 0x06 == 0x06:\n            "
                    "self.axis.core.brake.open()"
                ),
            ),
        ),
    ),
    FieldError(
        name="torque-gone-before-brake-holds",
        title="The drive switches off before the brake has closed, and the load drops",
        area=_AREA,
        sources=(
            Source(
                "ExcessiveOverkill/universal-IRC-1, issue 2",
                "https://github.com/ExcessiveOverkill/universal-IRC-1/issues/2",
            ),
            Source("Duet3D/RepRapFirmware, issue 677", "https://github.com/Duet3D/RepRapFirmware/issues/677"),
        ),
        happened=(
            "A robot arm dropped a little at every switch-off: the drives lost their torque while the "
            "brakes were still on their way. Brake and drive need an order in time, not one signal."
        ),
        on_the_bus="Torque 0 while the brake is not closed yet; a few millimetres of motion behind it.",
        found_by=(
            "Measure the position over a switch-off with the load on. What the encoder shows between torque "
            "off and brake closed is free fall."
        ),
        campaign="holding_brake",
        case="holding-brake/closes/power-0",
        defect=known("pulses-go-before-brake-closed"),
    ),
    FieldError(
        name="motor-runs-without-its-master",
        title="Nothing watches the master: in velocity mode the motor turns on without it",
        area=_AREA,
        sources=(
            Source(
                "ros-industrial/ros_canopen, issue 367",
                "https://github.com/ros-industrial/ros_canopen/issues/367",
            ),
        ),
        happened=(
            "A user asked whether the consumer heartbeat of the drive could be left out. The maintainer's "
            "answer: a motor in velocity mode then goes on turning when the master dies, and that this had "
            "happened."
        ),
        on_the_bus="The heartbeat of the master stops, no EMCY 8130h follows, the actual velocity stays.",
        found_by=(
            "Kill the master in motion, by its process, not by its stop button. The drive has to stop by "
            "itself within the consumer heartbeat time."
        ),
        campaign="fault_reactions",
        case="fault-reactions/controller-heartbeat-lost/constant",
        bench="reference",
        defect=known("heartbeat-consumer-starts-never"),
    ),
)
