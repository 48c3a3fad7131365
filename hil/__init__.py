"""Hardware-in-the-loop benches for motion control: benches, faults, traces, expectations, campaigns.

What tests use is here; `hil.expect` has the expectations, `hil.errors` the errors, `hil.testing` helpers.
The names are loaded when they are first used, so that importing the package costs nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fieldbus.canopen.node import RemoteNode as Node
    from hil.bench import BenchFile, load_bench
    from hil.bench.bench import Bench
    from hil.campaign import Campaign, Case, CaseContext, Runner, RunOptions, Token
    from hil.errors import BlockedError, ConfigurationError, ExpectationFailedError, UnsupportedFaultError
    from hil.expect import Expectation
    from hil.faults import CATALOGUE, ArmedFault, Fault, Injector
    from hil.protocols import Device, Drive, Encoder
    from hil.record import EventSelector, Recorder, Signal, Trace, event
    from hil.testing import CurrentTrace, NewBench
    from motion.s7.cam_handle import CamHandle as Cam
    from motion.s7.handles import AxisHandle as Axis
    from motion.s7.handles import EncoderHandle as ExternalEncoder
    from motion.s7.instructions import Instruction as Job

__all__ = [
    "CATALOGUE",
    "ArmedFault",
    "Axis",
    "Bench",
    "BenchFile",
    "BlockedError",
    "Cam",
    "Campaign",
    "Case",
    "CaseContext",
    "ConfigurationError",
    "CurrentTrace",
    "Device",
    "Drive",
    "Encoder",
    "EventSelector",
    "Expectation",
    "ExpectationFailedError",
    "ExternalEncoder",
    "Fault",
    "Injector",
    "Job",
    "NewBench",
    "Node",
    "Recorder",
    "RunOptions",
    "Runner",
    "Signal",
    "Token",
    "Trace",
    "UnsupportedFaultError",
    "event",
    "load_bench",
]

if not TYPE_CHECKING:
    _PLACES = {
        "Axis": ("motion.s7.handles", "AxisHandle"),
        "Bench": ("hil.bench.bench", "Bench"),
        "Cam": ("motion.s7.cam_handle", "CamHandle"),
        "CATALOGUE": ("hil.faults", "CATALOGUE"),
        "CurrentTrace": ("hil.testing", "CurrentTrace"),
        "NewBench": ("hil.testing", "NewBench"),
        "Expectation": ("hil.expect", "Expectation"),
        "ExternalEncoder": ("motion.s7.handles", "EncoderHandle"),
        "Job": ("motion.s7.instructions", "Instruction"),
        "Node": ("fieldbus.canopen.node", "RemoteNode"),
        **dict.fromkeys(("BenchFile", "load_bench"), ("hil.bench", "")),
        **dict.fromkeys(
            ("Campaign", "Case", "CaseContext", "RunOptions", "Runner", "Token"), ("hil.campaign", "")
        ),
        **dict.fromkeys(
            ("BlockedError", "ConfigurationError", "ExpectationFailedError", "UnsupportedFaultError"),
            ("hil.errors", ""),
        ),
        **dict.fromkeys(("ArmedFault", "Fault", "Injector"), ("hil.faults", "")),
        **dict.fromkeys(("Device", "Drive", "Encoder"), ("hil.protocols", "")),
        **dict.fromkeys(("EventSelector", "Recorder", "Signal", "Trace", "event"), ("hil.record", "")),
    }

    def __getattr__(name: str) -> object:
        """Load a name when it is first used."""
        if name not in _PLACES:
            from fieldbus.errors import similar_names

            similar = similar_names(name, __all__)
            raise AttributeError(f"module 'hil' has no {name!r}" + (f"; {similar}" if similar else ""))
        module, other = _PLACES[name]
        return getattr(import_module(module), other or name)
