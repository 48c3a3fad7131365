"""A CANopen device of any kind, made of its EDS: `CanopenDevice`."""

from __future__ import annotations

from emulators.station._device import CanopenDevice

__all__ = ["CanopenDevice"]
