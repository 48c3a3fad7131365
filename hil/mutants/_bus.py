"""Defects of CAN, CANopen and Modbus, on either side."""

from __future__ import annotations

from functools import partial
from typing import Final

from hil.mutants._mutant import Mutant, defect

_ERROR_CONTROL: Final = "fieldbus.canopen.error_control:ErrorControl"
_SUPERVISION: Final = "fieldbus.canopen.supervision:HeartbeatWatch"
_TCP: Final = "fieldbus.modbus.tcp_client:TcpClient"
_RTU: Final = "fieldbus.modbus.rtu_client:RtuClient"

_defect = partial(defect, area="bus")

MUTANTS: Final[tuple[Mutant, ...]] = (
    _defect(
        "no-boot-up",
        "The node sends no boot-up message",
        f"{_ERROR_CONTROL}.enter_state",
        'self._send(CanFrame(self._can_id, b"\\0"))',
        "self._state = state",
        ids=("C301-022",),
        likely=("drive-faults/reset/*@reference",),
    ),
    _defect(
        "heartbeat-with-the-old-state",
        "The heartbeat shows Operational whatever the NMT state is",
        f"{_ERROR_CONTROL}._produce",
        "bytes((self._state,))",
        "bytes((5,))",
        ids=("C301-023",),
        likely=("fault-reactions/nmt-02/standstill@reference",),
    ),
    _defect(
        "heartbeat-consumer-starts-never",
        "The drive does not watch the heartbeat of its controller",
        f"{_ERROR_CONTROL}.heartbeat",
        "watch.feed(time_ns)",
        "watch.stop()",
        ids=("C301-027", "C402-077"),
        likely=("fault-reactions/controller-heartbeat-lost/*@reference",),
    ),
    _defect(
        "heartbeat-loss-tolerated",
        "A missing heartbeat of the drive is tolerated ten times as long",
        f"{_SUPERVISION}._due",
        "due = self._last_ns + self._timeout_ns",
        "due = self._last_ns + 10 * self._timeout_ns",
        ids=("C301-027",),
        likely=("fault-reactions/heartbeat-lost/*@reference",),
    ),
    _defect(
        "rpdo-latched-again",
        "A synchronous RPDO takes effect at every SYNC, even without a new one",
        "fieldbus.canopen.pdo_engine:PdoEngine.latch",
        "pdo.pending = None\n",
        "pdo.pending = data\n",
        ids=("C301-035", "C402-077"),
        likely=("fault-reactions/setpoints-lost/*@reference",),
    ),
    _defect(
        "node-hears-all-nmt",
        "A node obeys NMT commands that are meant for another node",
        "fieldbus.canopen.slave:CanopenSlave._on_nmt",
        "data[1] not in (0, self.node_id)",
        "data[1] > 127",
        ids=("C301-016",),
        likely=("cia402-drive/nmt-of-others/02",),
    ),
    _defect(
        "nmt-stop-ignored",
        "NMT stop leaves a node Operational",
        "fieldbus.canopen.slave:CanopenSlave._on_nmt",
        "if target is not None:",
        "if target is not None and target != NmtState.STOPPED:",
        ids=("C301-017",),
        likely=("fault-reactions/nmt-02/*@reference",),
    ),
    _defect(
        "emcy-clear-missing",
        "The end of an error is not reported by an EMCY 0000h",
        "fieldbus.canopen.emcy:EmcyProducer.clear",
        "self._queue_frame(0, bytes(5))",
        "self._not_before_ns = 0",
        ids=("C301-109",),
        likely=("drive-faults/trip/motor-hot/standstill@reference",),
    ),
    _defect(
        "transaction-ignored",
        "The Modbus client takes any response for the request that is under way",
        f"{_TCP}.received",
        "found = self._under_way.pop(number, None)",
        "found = self._under_way.pop(next(iter(self._under_way), number), None)",
        ids=("MODB-039",),
        likely=("modbus-faults/wrong-transaction/*",),
    ),
    _defect(
        "unit-ignored",
        "A Modbus response of another unit is taken",
        "fieldbus.modbus.client:Job.decode",
        "if unit != self.unit:",
        "if unit > 247:",
        ids=("MODB-040",),
        likely=("modbus-faults/wrong-unit/*", "modbus-line-faults/wrong-unit/*"),
    ),
    _defect(
        "crc-ignored",
        "A damaged response on a Modbus line is taken",
        f"{_RTU}._frame",
        "content = None if damaged else unwrap_rtu(frame)",
        "content = (frame[0], frame[1:-2])",
        ids=("MODB-006", "MODB-008"),
        likely=("modbus-line-faults/wrong-crc/*", "modbus-line-faults/noisy"),
    ),
)
