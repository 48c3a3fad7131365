"""Stations with digital and analog inputs and outputs."""

from __future__ import annotations

from emulators.io._channels import AnalogInput, AnalogOutput, DigitalInput, DigitalOutput
from emulators.io._station import ModbusIoStation

__all__ = ["AnalogInput", "AnalogOutput", "DigitalInput", "DigitalOutput", "ModbusIoStation"]
