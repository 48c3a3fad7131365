"""What a bench with axes of an NC shows over ADS: process images, status, blocks and parameters as
symbols.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Final

from fieldbus.ads import (
    NC_PORT,
    PLC_PORT,
    SYSTEM_PORT,
    AdsError,
    AdsState,
    Area,
    Member,
    Memory,
    Port,
    Structure,
    Symbol,
    size_of,
    variable,
)
from fieldbus.errors import ConfigurationError
from motion.nc.blocks import MC_Power
from motion.nc.interface import (
    NC_TO_PLC,
    NC_TO_PLC_SIZE,
    PLC_TO_NC,
    PLC_TO_NC_SIZE,
    STATUS_BITS,
    PlcToNc,
)
from motion.nc.library import COMMANDS
from motion.nc.parameters import catalogue
from motion.nc.symbols import symbol_prefix

if TYPE_CHECKING:
    from motion.nc.blocks import Block
    from motion.nc.handles import NcAxisHandle
    from motion.nc.tasks import NcRuntime

BLOCKS: Final[Mapping[str, type[Block]]] = {
    name.removeprefix("MC_"): one
    for name, one in COMMANDS.items()
    if one is MC_Power or not {"Master", "Enable"} & one.inputs.keys()
}
"""Instances that the PLC calls for every axis: they need no other one, and do nothing by themselves."""
_OUTPUTS: Final = ("Status", "Done", "Busy", "Active", "InVelocity", "CommandAborted", "Error", "ErrorID")
_TYPES: Final = {"bool": "BOOL", "uint32": "UDINT", "float": "LREAL", "enum": "DINT"}
"""Type of a parameter -> type of its symbol."""


def ads_ports(nc: NcRuntime, axes: Mapping[str, NcAxisHandle]) -> dict[int, Port]:
    """Return what an NC and its PLC have over ADS.

    The PLC gets instances of the blocks for every axis, which only its symbols command.

    Args:
        nc: The NC.
        axes: Its axes, by name.

    """
    plc, online = Memory(), Memory()
    for name, axis in axes.items():
        _images(plc, f"GVL.{name}", axis)
        for block, kind in BLOCKS.items():
            _block(plc, f"MAIN.{name}_{block}", axis.run(kind(axis.ref)))
        prefix = symbol_prefix(axis.object)
        if prefix is not None:
            _states(online, prefix, axis)
            _parameters(online, prefix, axis)
    return {
        PLC_PORT: Port(
            plc, lambda: AdsState.RUN if nc.plc_running else AdsState.STOP, _control(nc), "Plc30 App"
        ),
        NC_PORT: Port(online, lambda: AdsState.RUN, _refuse, "TCNC"),
        SYSTEM_PORT: Port(Memory(), lambda: AdsState.RUN, _refuse, "TwinCAT System"),
    }


def _control(nc: NcRuntime) -> Callable[[int], int]:
    def control(state: int) -> int:
        if state not in (AdsState.RUN, AdsState.STOP):
            return AdsError.INVALID_STATE
        nc.plc_running = state == AdsState.RUN
        return 0

    return control


def _refuse(state: int) -> int:
    return 0 if state == AdsState.RUN else AdsError.SERVICE_NOT_SUPPORTED


def _images(memory: Memory, name: str, axis: NcAxisHandle) -> None:
    ref = axis.ref
    for kind, size, listed in (
        ("PLCTONC_AXIS_REF", PLC_TO_NC_SIZE, PLC_TO_NC),
        ("NCTOPLC_AXIS_REF", NC_TO_PLC_SIZE, NC_TO_PLC),
    ):
        memory.declare(Structure(kind, size, tuple(Member(*one) for one in listed)))

    def write(image: bytes) -> int:
        given = PlcToNc()
        given.unpack(image)
        if not all(math.isfinite(getattr(given, name)) for name, _, _ in PLC_TO_NC):
            return AdsError.INVALID_DATA
        ref.PlcToNc.unpack(image)
        return 0

    def image() -> bytes:
        return ref.NcToPlc.pack()  # another object in every cycle

    for part, kind, members, area in (
        ("PlcToNc", "PLCTONC_AXIS_REF", PLC_TO_NC, Area(PLC_TO_NC_SIZE, ref.PlcToNc.pack, write)),
        ("NcToPlc", "NCTOPLC_AXIS_REF", NC_TO_PLC, Area(NC_TO_PLC_SIZE, image)),
    ):
        offset = memory.add(area)
        memory.name(Symbol(f"{name}.{part}", kind, offset, area.size))
        for member, type_name, place in members:
            memory.name(Symbol(f"{name}.{part}.{member}", type_name, offset + place, size_of(type_name)))
    for member, bit in STATUS_BITS.items():
        variable(memory, f"{name}.Status.{member}", "BOOL", _bit(axis, int(bit)))


def _bit(axis: NcAxisHandle, bit: int) -> Callable[[], float]:
    return lambda: axis.ref.NcToPlc.StateDWord & bit != 0


def _block(memory: Memory, name: str, block: Any) -> None:
    for key, default in block.inputs.items():
        type_name = "BOOL" if isinstance(default, bool) else "LREAL" if isinstance(default, float) else "DINT"
        variable(
            memory, f"{name}.{key}", type_name, _getter(block, key), _setter(block, key), comment="input"
        )
    for key in _OUTPUTS:
        if hasattr(block, key):
            variable(memory, f"{name}.{key}", "UDINT" if key == "ErrorID" else "BOOL", _getter(block, key))


def _getter(block: Any, key: str) -> Callable[[], float]:
    return lambda: getattr(block, key)


def _setter(block: Any, key: str) -> Callable[[float], int]:
    def set_(value: float) -> int:
        if not math.isfinite(value):
            return AdsError.INVALID_DATA
        block.set(**{key: value})
        return 0

    return set_


def _states(memory: Memory, name: str, axis: NcAxisHandle) -> None:
    for member, type_name, _ in NC_TO_PLC:
        variable(memory, f"{name}.{member}", type_name, _state(axis, member))


def _state(axis: NcAxisHandle, member: str) -> Callable[[], float]:
    return lambda: float(getattr(axis.object.nc_to_plc, member))


def _parameters(memory: Memory, name: str, axis: NcAxisHandle) -> None:
    for key, one in catalogue().items():
        type_name = _TYPES.get(one.type)
        if type_name is None:
            continue
        choices = one.choices if one.type == "enum" else ()
        variable(
            memory,
            f"{name}.{key}",
            type_name,
            _parameter_getter(axis, key, whole=type_name in ("DINT", "UDINT")),
            _parameter_setter(axis, key, choices),
            comment=one.name,
        )


def _parameter_getter(axis: NcAxisHandle, key: str, *, whole: bool) -> Callable[[], float]:
    # An activation of the configuration makes other parameters.
    def get() -> float:
        value = axis.object.parameters.cell(key).value
        return int(value) if whole else value

    return get


def _parameter_setter(axis: NcAxisHandle, key: str, choices: tuple[str, ...]) -> Callable[[float], int]:
    def set_(value: float) -> int:
        if choices and not 0 <= value < len(choices):
            return AdsError.INVALID_DATA
        try:
            axis.write_parameter(key, choices[int(value)] if choices else value)
        except ConfigurationError:
            return AdsError.INVALID_DATA
        return 0

    return set_
