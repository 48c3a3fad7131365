"""The kinds of events that a bench writes into its log, and their meaning: a trigger on any other kind would
never fire.
"""

from __future__ import annotations

from collections.abc import Iterable
from types import MappingProxyType
from typing import Final

from fieldbus.errors import UnknownNameError
from hil.record._select import kind_matches

EVENT_KINDS: Final = MappingProxyType(
    {
        "adapter.overrun": "an adapter has lost frames",
        "adapter.state": "an adapter is opened, closed, or its bus state has changed",
        "alarm.acknowledged": "a technology alarm is acknowledged",
        "alarm.cleared": "a technology alarm is gone",
        "alarm.detail": "the text of a pending alarm is completed, as soon as the cause is known in detail",
        "alarm.gone": "the cause of a technology alarm that is still pending has gone",
        "alarm.raised": "a technology alarm is raised",
        "axis.adaption": "the transfer of parameters of a part has another state",
        "axis.doubt": "the configuration of an axis is permitted, but hardly meant",
        "axis.emergency_stop": "an NC axis is stopped for an emergency, on a ramp or without output",
        "axis.error": "an NC axis has an error",
        "axis.fast_stop": "an NC axis is stopped by its fast axis stop",
        "axis.feed_missing": "an NC axis has no feed enable in the direction in which it is to move",
        "axis.homed": "the axis is homed, or no longer",
        "axis.position_set": "the coordinate system of an NC axis moves: a position is set, or it is homed",
        "axis.reset": "the error of an NC axis is reset",
        "axis.follows": "a synchronous job takes over: leading object, gear or cam",
        "axis.sensor": "another encoder controls the position",
        "axis.setpoint_step": "an external setpoint of an NC axis steps further than its maximum velocity",
        "axis.state": "the axis changes its state",
        "axis.torque_limit": "MC_TorqueLimiting gives another torque limit at the motor, or takes it back",
        "axis.torque_range": "MC_TorqueRange gives other torque limits at the motor, or takes them back",
        "axis.wired": "an axis of the bench has got its drive",
        "can.bus_error": "a node has found an error on the wire",
        "can.given_up": "a frame is not sent again",
        "can.ignored": "an adapter has ignored what a remote side sent",
        "can.overload": "a node asks for a pause",
        "can.overrun": "a transmit queue is full",
        "can.status": "a node changes its error state",
        "command.refused": "an NC axis refuses a command",
        "controller.encoder_data_refused": "adjustment data on the memory card do not fit",
        "controller.encoder_data_restored": "adjustments of absolute encoders are restored from the "
        "memory card",
        "controller.encoder_data_saved": "adjustments of absolute encoders are saved to the memory card",
        "controller.initialised": "technology objects of the controller have got their start values: memory "
        "reset, download",
        "controller.state": "the controller changes its operating state",
        "drive.brake_test": "the safe brake test of a PROFIdrive axis has ended",
        "drive.communication_lost": "a PROFIdrive axis has lost its controller",
        "drive.connection_lost": "a CiA 402 drive has lost its controller",
        "drive.fault": "the drive has tripped",
        "drive.fault_acknowledged": "the faults of a PROFIdrive axis are acknowledged",
        "drive.fault_cleared": "the faults of a CiA 402 drive are acknowledged",
        "drive.homing": "the homing of the drive begins, ends, or fails",
        "drive.in_step": "a stepper motor is caught by its pulses again",
        "drive.inputs": "digital inputs of the drive change",
        "drive.limit_refused": "the drive does not take the torque limit of MC_TorqueLimiting",
        "drive.nmt": "the drive changes its NMT state",
        "drive.out_of_step": "a stepper motor has fallen out of step",
        "drive.outputs": "digital outputs of the drive change",
        "drive.probe": "a touch probe has latched a position",
        "drive.ready": "the ready output of an analog drive changes",
        "drive.safety": "S_ZSW1B of a PROFIdrive axis changes",
        "drive.safety_message": "a safety function of a PROFIdrive axis is violated",
        "drive.slipped": "the shaft of a stepper motor has slipped by whole periods",
        "drive.state": "the drive changes its state",
        "drive.sync_jitter": "SYNC comes too early or too late",
        "drive.warning": "warnings of the drive change",
        "drive.zero_mark": "the encoder interface takes an external zero mark, or that of the encoder again",
        "emcy.cleared": "a node takes an error back",
        "emcy.raised": "a node reports an error",
        "emcy.received": "the controller has received an EMCY",
        "encoder.alarm": "alarms of an encoder change",
        "encoder.cams": "cams of an encoder change",
        "encoder.error": "the error of a PROFIdrive encoder changes",
        "encoder.preset": "a preset is written",
        "encoder.warning": "warnings of an encoder change",
        "envelope.action": "an operator action of a stop envelope is given to an axis",
        "fault.applied": "an injected fault acts",
        "fault.armed": "a fault waits for its trigger",
        "fault.disarmed": "a fault has ended before its trigger came",
        "fault.hit": "a fault has hit a frame",
        "fault.removed": "an injected fault is taken back",
        "fault.skipped": "the trigger of a fault has come while the fault acts already",
        "fault.waiting": "the recording ends while a fault still waits for its trigger",
        "guarding.back": "the node is guarded again",
        "guarding.lost": "the guarding of a node has failed",
        "heartbeat.back": "a heartbeat is there again",
        "heartbeat.lost": "a heartbeat is missing",
        "homing.phase": "active homing goes on with another part of its motion",
        "homing.started": "active homing begins its motion, or passive homing begins to wait for its mark",
        "cam.interpolated": "a cam has a function from now on",
        "drive.brake": "the brake of a drive with two speeds is applied or released",
        "drive.illegal_terminals": "terminals of a drive with two speeds contradict each other",
        "job.aborted": "CommandAborted",
        "job.active": "the job is in control",
        "job.done": "Done",
        "job.error": "Error",
        "job.synchronous": "InGear comes",
        "job.in_velocity": "InVelocity comes",
        "job.leaves_velocity": "InVelocity goes",
        "job.started": "a job is accepted",
        "link.down": "the controller has lost the cyclic data of a drive",
        "link.heartbeat_lost": "the controller misses the heartbeat of a drive",
        "link.nmt_state": "a drive shows another NMT state",
        "link.in_service": "a drive on Modbus answers and is led from now on",
        "link.node_lost": "a drive is lost to its controller",
        "link.request_failed": "a request to a drive on Modbus has failed, the first of a row",
        "link.up": "the cyclic data of a drive are there",
        "log.heard": "a node, an axis or a segment is there again in a bus log",
        "log.silent": "nothing is known of a node, an axis or a segment from here on in a bus log",
        "lss.bitrate": "LSS sets a bit rate",
        "lss.node_id": "LSS sets a node-ID",
        "nc.cycle_exceeded": "a cycle of a task of the NC took longer than its cycle time",
        "nc.message": "the NC shows a message to the operator",
        "nc.retain_data": "an NC starts without retain data: they are missing or corrupt",
        "nc.start_aborted": "an NC does not start, because it has to load retain data",
        "nc.warning": "the configuration of an NC axis is permitted, but not advisable",
        "nmt.state": "a node changes its NMT state",
        "node.boot": "the controller begins to take a node into service",
        "node.booted": "a node is in service",
        "node.bootup": "a node has sent its boot-up frame",
        "node.configured": "a node has its parameters",
        "node.refused": "a node has refused a parameter, and what was done instead",
        "node.failed": "a node could not be taken into service",
        "node.lost": "the controller has lost a node",
        "panel.control": "a control panel takes an axis from the user program, or gives it back",
        "plc.halted": "an exception of the arithmetic has halted the PLC of an NC",
        "power.disable": "MC_Power.Enable falls",
        "power.status": "MC_Power.Status changes",
        "power.waits": "MC_Power waits for something before it can enable",
        "program.error": "a variable was accessed wrongly",
        "program.write": "a variable was written",
        "rpdo.timeout": "an RPDO is overdue",
        "station.down": "the controller has lost an I/O station",
        "station.power": "the supply of an I/O station comes or goes",
        "station.substituted": "an I/O station puts out its substitute values",
        "station.up": "an I/O station answers the controller",
        "storage.failed": "parameters could not be stored",
    }
)
"""Kind -> meaning."""


def check_event_kind(where: str, kind: str, *, others: Iterable[str] = ()) -> None:
    """Refuse a kind, or a family with a trailing dot, of which no event can come.

    Args:
        where: What names it, for the message.
        kind: `alarm.raised`, or `alarm.`.
        others: Kinds of user-defined parts: `History.declare`, and those in the log already.

    Raises:
        UnknownNameError: No part emits it; the message has similar kinds, and how to declare one.

    """
    known = {*EVENT_KINDS, *others}
    if any(kind_matches(kind, one) for one in known):
        return
    family = kind.split(".", maxsplit=1)[0]
    same = [one for one in sorted(known) if one.split(".")[0] == family]
    own = f"kinds of parts of your own: history.declare({kind!r})"
    raise UnknownNameError(where, kind, "a kind of event", same or sorted(known), more=own)
