"""Stations with digital and analog inputs and outputs, and counters."""

from __future__ import annotations

from emulators.io._channels import (
    AnalogInput,
    AnalogOutput,
    CounterInput,
    DigitalInput,
    DigitalOutput,
    Disturbance,
)
from emulators.io._station import ModbusIoStation

__all__ = [
    "AnalogInput",
    "AnalogOutput",
    "CounterInput",
    "DigitalInput",
    "DigitalOutput",
    "Disturbance",
    "ModbusIoStation",
]
