"""CANopen stacks: heartbeats, NMT, PDOs, bus-off."""

from __future__ import annotations

from typing import Final

from hil.museum import FieldError, Source
from testcases.museum._seeds import made

_AREA: Final = "CANopen"
_REPOSITORY: Final = "https://github.com/CANopenNode/CANopenNode"
_RECEIVE: Final = "fieldbus.canopen.pdo:ReceivePdo"

ENTRIES: Final[tuple[FieldError, ...]] = (
    FieldError(
        name="no-restart-after-bus-off",
        title="A node that has gone bus-off stays silent until somebody switches it off and on",
        area=_AREA,
        sources=(
            Source(
                "CANopenNode/CanOpenSTM32, issue 128",
                "https://github.com/CANopenNode/CanOpenSTM32/issues/128",
            ),
            Source("rtlabs-com/c-open, pull request 34", "https://github.com/rtlabs-com/c-open/pull/34"),
        ),
        happened=(
            "A CAN controller of a microcontroller family leaves bus-off only when the software clears a "
            "bit. The driver of the stack did not, and the node never came back. Another stack got an "
            "attempt of its own after a set time, for drivers that do not recover by themselves."
        ),
        on_the_bus=(
            "The last frame of the node is followed by nothing: no heartbeat, no EMCY, no boot-up, no answer."
        ),
        found_by=(
            "Short the bus lines for a second at the node that matters. It has to be back, with an EMCY "
            "8140h, without anybody's help."
        ),
        campaign="communication_loss",
        case="communication-loss/cia402/can/velocity/standstill/bus-off",
        bench="reference",
        defect=made(
            "no-restart-after-bus-off",
            "bus",
            "A node does not begin its recovery from bus-off",
            (
                "fieldbus.can.section:BusSection.recover",
                "self.errors.begin_recovery(port)",
                "return",
            ),
        ),
    ),
    FieldError(
        name="locked-in-pre-operational",
        title="A node that has lost its master cannot be started again",
        area=_AREA,
        sources=(Source("CANopenNode/CANopenNode, issue 26", f"{_REPOSITORY}/issues/26"),),
        happened=(
            "A node went to Pre-operational when the heartbeat of the master stopped. NMT start was refused "
            "from then on, because the error register still showed the communication error: only a reset of "
            "the node helped."
        ),
        on_the_bus="NMT start (01h) is sent again and again; the heartbeat of the node keeps showing 7Fh.",
        found_by=(
            "Stop the master for longer than the consumer heartbeat time and start it again. All nodes have "
            "to be Operational without a reset."
        ),
        campaign="canopen_services",
        case="canopen-services/error-behaviour/0",
        defect=made(
            "locked-in-pre-operational",
            "bus",
            "NMT start is ignored while 1001h shows an error",
            (
                "fieldbus.canopen.slave:CanopenSlave._on_nmt",
                "            self._enter(target)\n",
                (
                    "            if target != NmtState.OPERATIONAL or not self.errors.register:\n"
                    "                self._enter(target)\n"
                ),
            ),
        ),
    ),
    FieldError(
        name="never-heard-never-missed",
        title="A heartbeat that has never come is never missed",
        area=_AREA,
        sources=(Source("CANopenNode/CANopenNode, issue 362", f"{_REPOSITORY}/issues/362"),),
        happened=(
            "Monitoring began with the first heartbeat. A device that was reset because of a failure and "
            "did not send a single one afterwards was watched by nobody. The standard lets the consumer "
            "begin so; an application that relies on the monitoring has to begin it itself."
        ),
        on_the_bus="Boot-up and PDOs of the node, but no heartbeat, and the master carries on.",
        found_by=(
            "Set the producer heartbeat time of a node to 0 behind the back of the master, or start a node "
            "that hangs after its boot-up. The master has to say so within the heartbeat time."
        ),
        campaign="cia402_drive",
        case="cia402-drive/heartbeat-never-comes",
        defect=made(
            "never-heard-never-missed",
            "bus",
            "The controller watches a heartbeat from its first frame on only",
            (
                "fieldbus.canopen.supervision:HeartbeatWatch.expect",
                "if self._timer is None and not self.lost:",
                "if self._timer is not None and not self.lost:",
            ),
        ),
    ),
    FieldError(
        name="error-outlives-heartbeat",
        title="The heartbeat is back, and the consumer still reports it as missing",
        area=_AREA,
        sources=(
            Source("CANopenNode/CANopenNode, issue 631", f"{_REPOSITORY}/issues/631"),
            Source("CANopenNode/CANopenNode, issue 632", f"{_REPOSITORY}/issues/632"),
        ),
        happened=(
            "After a short circuit of the bus, or when one of several monitored nodes had been off, the "
            "communication error of the consumer stayed, although all heartbeats of running nodes were "
            "there again."
        ),
        on_the_bus="EMCY 8130h, then heartbeats, and no EMCY 0000h; 1001h stays at 11h.",
        found_by=(
            "Interrupt one heartbeat and restore it. Error register and EMCY have to show that it is over."
        ),
        campaign="canopen_services",
        case="canopen-services/heartbeat-consumer/120-0",
        defect=made(
            "error-outlives-heartbeat",
            "bus",
            "A heartbeat that is back does not end the error of its loss",
            (
                "fieldbus.canopen.error_control:ErrorControl.heartbeat",
                "        if self._lost:\n",
                "        if self._lost and state == 0:\n",
            ),
        ),
    ),
    FieldError(
        name="toggle-bit-taken-for-state",
        title="The toggle bit of node guarding is taken for a part of the state, and the master crashes",
        area=_AREA,
        sources=(
            Source(
                "canopen-python/canopen, issue 150", "https://github.com/canopen-python/canopen/issues/150"
            ),
        ),
        happened=(
            "A node answered with FFh: Pre-operational with bit 7 set. The master looked up 255 among the "
            "states and ended with an exception."
        ),
        on_the_bus="Every second answer under 700h + node has bit 7 set, as the standard wants it.",
        found_by=(
            "Use node guarding for more than one cycle, or a node that sets bit 7: the first answer alone "
            "has it 0."
        ),
        campaign="node_guarding",
        case="node-guarding/in-time",
        defect=made(
            "toggle-bit-taken-for-state",
            "bus",
            "The state of a guarded node has the toggle bit in it",
            (
                "fieldbus.canopen.supervision:NodeGuard.receive",
                "state = data[0] & 0x7F",
                "state = data[0]",
            ),
            ("fieldbus.canopen.node:RemoteNode._on_error_control", "if state in _NAMES:", "if state:"),
        ),
    ),
    FieldError(
        name="synchronous-setpoint-lost",
        title="A synchronous RPDO is forgotten when the task runs before the next SYNC",
        area=_AREA,
        sources=(Source("CANopenNode/CANopenNode, issue 23", f"{_REPOSITORY}/issues/23"),),
        happened=(
            "The PDO task ran every millisecond and cleared the flag of new data each time, SYNC or not. "
            "With a SYNC every 10 ms nine of ten setpoints were lost, depending on when they came."
        ),
        on_the_bus=(
            "All frames are there; the actuator does not do what they say, now and then, without an error."
        ),
        found_by=(
            "Send setpoints at every phase of the SYNC cycle, not only right behind it, and read the mapped "
            "object after the next SYNC."
        ),
        campaign="canopen_services",
        case="canopen-services/rpdo/sync",
        defect=made(
            "synchronous-setpoint-lost",
            "bus",
            "A synchronous RPDO that comes later than 1 ms after SYNC is lost",
            (
                f"{_RECEIVE}.on_sync_frame",
                "        self.pending = data\n",
                (
                    "        if self._cycle.sync_ns >= 0 and time_ns - self._cycle.sync_ns > 1_000_000:\n"
                    "            return\n        self.pending = data\n"
                ),
            ),
        ),
    ),
    FieldError(
        name="synchronous-setpoint-at-once",
        title="A synchronous RPDO takes effect when it arrives, without SYNC",
        area=_AREA,
        sources=(
            Source(
                "canopen-python/canopen, issue 400", "https://github.com/canopen-python/canopen/issues/400"
            ),
        ),
        happened=(
            "The outputs of a drive changed when the RPDO came, although its transmission type read 1. "
            "Several axes that are to start together start one after the other."
        ),
        on_the_bus=(
            "The reaction follows the RPDO, not the SYNC behind it: a difference that a trace with times "
            "shows."
        ),
        found_by="Send the RPDO and hold SYNC back. Nothing may change.",
        campaign="canopen_services",
        case="canopen-services/rpdo/sync",
        defect=made(
            "synchronous-setpoint-at-once",
            "bus",
            "The transmission type of an RPDO has no effect",
            (
                f"{_RECEIVE}.handler",
                "return self.on_sync_frame if self.synchronous else self.on_event_frame",
                "return self.on_event_frame",
            ),
        ),
    ),
    FieldError(
        name="wrong-length-without-register",
        title="An RPDO of the wrong length is reported by EMCY, but the error register stays clear",
        area=_AREA,
        sources=(
            Source("CANopenNode/CANopenNode, pull request 628", f"{_REPOSITORY}/pull/628"),
            Source("CANopenNode/CANopenNode, pull request 590", f"{_REPOSITORY}/pull/590"),
        ),
        happened=(
            "The stack counted the wrong length as information only. A conformance test, which reads the "
            "communication bit of 1001h, failed; so would a master that looks at the register."
        ),
        on_the_bus="EMCY 8210h with a register that lacks bit 4.",
        found_by="Send an RPDO one byte short and read 1001h.",
        campaign="canopen_services",
        case="canopen-services/rpdo/length-5",
        defect=made(
            "wrong-length-without-register",
            "bus",
            "Errors 82xxh set no communication bit in 1001h",
            (
                "fieldbus.canopen.emcy:register_bits",
                "if group in (0x81, 0x82):",
                "if group == 0x81:",
            ),
        ),
    ),
    FieldError(
        name="node-not-set-up-after-power-cut",
        title="After a power cut the drive is there again, and nobody sets it up",
        area=_AREA,
        sources=(
            Source(
                "ros-industrial/ros_canopen, issue 337",
                "https://github.com/ros-industrial/ros_canopen/issues/337",
            ),
        ),
        happened=(
            "An emergency switch cut the power of the motors. When it was back, shutdown and initialisation "
            "of the driver worked only sometimes: at other times it ended with a time-out of an SDO, to "
            "1800h:1."
        ),
        on_the_bus="Boot-up of the node, then no SDO to it, or one that comes too early and is not repeated.",
        found_by=(
            "Cut and restore the power of a drive twenty times with different pauses. Every time the "
            "boot-up message has to start the whole configuration, and an incremental axis has to lose its "
            "home position."
        ),
        campaign="fault_reactions",
        case="fault-reactions/node-off/constant",
        bench="reference",
        defect=made(
            "node-not-set-up-after-power-cut",
            "bus",
            "A boot-up message in operation is ignored",
            (
                "fieldbus.canopen.node:RemoteNode._on_error_control",
                "            self._booted_up()\n",
                "            return\n",
            ),
        ),
    ),
)
