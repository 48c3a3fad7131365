"""The hands of a program for an axis of an NC: they call its blocks."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, Final

from fieldbus.errors import ConfigurationError
from hil.fuzz._nc_jobs import NC_JOBS, PACKET, RELEASE, WRITE
from motion.nc.blocks import MC_GearIn, MC_Power
from motion.nc.library import COMMANDS

if TYPE_CHECKING:
    from collections.abc import Callable

    from hil.fuzz._invariants import NamedJob
    from hil.fuzz._program import Do
    from motion.nc.axis_ref import AxisRef
    from motion.nc.blocks import Block
    from motion.nc.handles import NcAxisHandle
    from motion.nc.parameters import Value

_LEVELS: Final = ("Execute", "Enable", "JogForward", "JogBackwards")
"""Inputs that are taken away to release a block."""


class NcHands:
    """Calls the blocks of an NC axis; keeps the instances that are released later.

    Args:
        axis: The axis.
        master: Returns the `AXIS_REF` of another axis by name.
        watch: Takes every instance whose outputs are to be looked at.

    """

    def __init__(
        self,
        axis: NcAxisHandle,
        *,
        master: Callable[[str], AxisRef],
        watch: Callable[[NamedJob], object],
    ) -> None:
        self._axis = axis
        self._master = master
        self._watch = watch
        self._held: dict[str, Block] = {}

    def do(self, step: Do) -> None:
        """Call a block, release one, or write a parameter or a packet of external setpoints.

        Raises:
            ConfigurationError: It is no instruction for an NC axis, or a parameter cannot have its value.

        """
        axis, given = self._axis, step.parameters
        if step.job not in NC_JOBS:
            raise ConfigurationError(f"step {step.job}", axis.name, "a technology object")
        if step.job == WRITE:
            axis.write_parameter(step.text("key"), _value(step.text("value")))
        elif step.job == PACKET:
            packet = axis.ref.PlcToNc
            packet.ExtSetPos, packet.ExtSetVelo = step.value("position"), step.value("velocity")
            packet.ExtSetDirection = int(step.value("direction"))
        elif step.job == RELEASE:
            held = self._held.pop(step.text("block"), None)
            if held is not None:
                held.set(**{key: False for key in _LEVELS if key in held.inputs})
        elif step.job == MC_Power.block:
            inputs: dict[str, Any] = {**MC_Power.inputs, **given}
            axis.power().set(**inputs)
        else:
            self._call(step.job, dict(given))

    def _call(self, name: str, inputs: dict[str, Any]) -> None:
        block = COMMANDS[name]
        if name == MC_GearIn.block:
            inputs["Master"] = self._master(inputs["Master"])
        if "Execute" in block.inputs:
            inputs["Execute"] = True
        instance = self._axis.run(block(self._axis.ref, **inputs))
        self._held[name] = instance
        self._watch(instance)


def _value(text: str) -> Value:
    """Return a value as the parameters take it: a number or a flag, else the text itself."""
    try:
        value = json.loads(text)
    except ValueError:
        return text
    return value if isinstance(value, bool | int | float) else text
