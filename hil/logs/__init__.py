"""Recorded bus logs as traces: what a real machine has left behind, judged by
the same expectations as a case.

`read_bus_log` reads a file, `trace_of_log` decodes it with the object dictionaries, PDO mappings and
telegrams of a bench.
"""

from __future__ import annotations

from hil.logs._files import BENCH_EPOCH_NS, BusLog, read_bus_log
from hil.logs._trace import LogTrace, trace_of_log

__all__ = ["BENCH_EPOCH_NS", "BusLog", "LogTrace", "read_bus_log", "trace_of_log"]
