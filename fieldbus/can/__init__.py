"""CAN: frames, segments in virtual time and in real time, python-can at the edges.

What is imported here does not import python-can. The modules that do, and cost its import time, are
`fieldbus.can.interface` (python-can programs on a segment), `fieldbus.can.live` (a python-can bus as a
segment) and `fieldbus.can.export` (log files).
"""

from fieldbus.can.bitstream import BitError
from fieldbus.can.confinement import ErrorCode, NodeState
from fieldbus.can.frame import CanFrame, FrameReceiver
from fieldbus.can.frame_log import LogEntry
from fieldbus.can.hooks import FrameHook, HookResult
from fieldbus.can.medium import CanMedium
from fieldbus.can.port import MediumPort
from fieldbus.can.registry import find_segment, register_segment
from fieldbus.can.segment import CanPort, CanSegment
from fieldbus.can.timing import arbitration_key, frame_bits, frame_time_ns, worst_case_bits

__all__ = [
    "BitError",
    "CanFrame",
    "CanMedium",
    "CanPort",
    "CanSegment",
    "ErrorCode",
    "FrameHook",
    "FrameReceiver",
    "HookResult",
    "LogEntry",
    "MediumPort",
    "NodeState",
    "arbitration_key",
    "find_segment",
    "frame_bits",
    "frame_time_ns",
    "register_segment",
    "worst_case_bits",
]
