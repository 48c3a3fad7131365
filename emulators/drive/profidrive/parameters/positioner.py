"""The parameters of the positioner (p2506 to p2691), connected to it; what is written acts at once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from emulators.drive.positioner_config import (
    BlockTask,
    Continuation,
    TraversingBlock,
)
from emulators.drive.profidrive.parameters.definitions import ParameterDefinition, load_definitions
from fieldbus.errors import ConfigurationError
from fieldbus.profidrive.errors import ParameterAccessError
from fieldbus.profidrive.requests import ParameterError

if TYPE_CHECKING:
    from emulators.drive.profidrive.modes.position import PositionMode
    from emulators.drive.profidrive.parameters.store import ParameterStore

_FIELDS: Final = {
    2506: "lu_per_revolution",
    2542: "standstill_window",
    2543: "standstill_time_ms",
    2544: "window",
    2545: "positioning_time_ms",
    2546: "following_tolerance",
    2568: "limit_cams_on",
    2571: "max_velocity",
    2572: "max_acceleration",
    2573: "max_deceleration",
    2582: "software_limits_on",
    2599: "reference_position",
    2600: "reference_offset",
    2604: "search_negative",
    2605: "cam_velocity",
    2606: "max_cam_distance",
    2607: "has_cam",
    2608: "mark_velocity",
    2609: "max_mark_distance",
    2611: "approach_velocity",
    2690: "mdi_target",
    2691: "mdi_velocity",
}
_PAIRS: Final = {
    2547: ("position_cams", 0),
    2548: ("position_cams", 1),
    2580: ("software_limits", 0),
    2581: ("software_limits", 1),
    2585: ("jog_velocities", 0),
    2586: ("jog_velocities", 1),
    2587: ("jog_increments", 0),
    2588: ("jog_increments", 1),
}
_SWITCHES: Final = frozenset({2568, 2582, 2604, 2607})
_MODULO_RANGE, _MODULO = 2576, 2577

_BLOCKS: Final = range(2616, 2624)
"""Number, position, velocity, acceleration, deceleration, task, parameter, mode."""
_TASKS: Final[Mapping[int, BlockTask]] = {
    3: "endless positive", 4: "endless negative", 5: "wait", 6: "goto",
    7: "set output", 8: "reset output",
}  # fmt: skip
"""p2621; 1 is a positioning, of the kind in p2623."""
_CONTINUATIONS: Final[tuple[Continuation, ...]] = (
    "end",
    "continue with stop",
    "continue flying",
    "continue external",
)
"""By bits 4 to 7 of p2623; bits 8 to 11 are 0 absolute, 1 relative."""


@cache
def positioner_definitions() -> tuple[ParameterDefinition, ...]:
    """Return the parameters of the positioner, read once."""
    return load_definitions(Path(__file__).with_name("positioner_parameters.toml"))


def connect_positioner(store: ParameterStore, mode: PositionMode) -> None:
    """Add the parameters of the positioner, and connect them.

    Args:
        store: The parameters.
        mode: Position mode of the axis.

    """
    for definition in positioner_definitions():
        store.define(definition)
    operating_mode = store.definition(930)
    if operating_mode is not None:
        store.define(replace(operating_mode, values=frozenset({2}), defaults=(2,)))
    _PositionerParameters(store, mode)


class _PositionerParameters:
    def __init__(self, store: ParameterStore, mode: PositionMode) -> None:
        self._store = store
        self._axis = axis = mode.positioner
        for number, name in _FIELDS.items():
            store.readers[number] = lambda _, name=name: getattr(axis.settings, name)  # type: ignore[misc]
            store.writers[number] = lambda _, value, number=number, name=name: self._take(  # type: ignore[misc]
                {name: bool(value) if number in _SWITCHES else value}
            )
        for number, (name, at) in _PAIRS.items():
            store.readers[number] = lambda _, name=name, at=at: getattr(axis.settings, name)[at]  # type: ignore[misc]
            store.writers[number] = lambda _, value, name=name, at=at: self._take(  # type: ignore[misc]
                {
                    name: (value, getattr(axis.settings, name)[1])
                    if at == 0
                    else (getattr(axis.settings, name)[0], value)
                }
            )
        if axis.settings.modulo_range:
            store.set(_MODULO_RANGE, axis.settings.modulo_range)
            store.set(_MODULO, 1)
        for number in (_MODULO_RANGE, _MODULO):
            store.writers[number] = lambda _, value, number=number: self._take_modulo({number: value})  # type: ignore[misc]
        for at, block in enumerate(axis.settings.block):
            for number, element in zip(_BLOCKS, _row_of(block), strict=True):
                store.set(number, element, at)
        for number in _BLOCKS:
            store.writers[number] = lambda at, value, number=number: self._take_block(number, at, value)  # type: ignore[misc]
        shown = {
            2521: lambda _: axis.position,
            2556: lambda _: axis.demand,
            2563: lambda _: axis.motion.following_error,
            2683: lambda _: axis.pos_zsw2,
        }
        store.readers.update(shown)

    def _take(self, changes: Mapping[str, Any]) -> None:
        try:
            self._axis.apply(replace(self._axis.settings, **changes))
        except ConfigurationError as error:
            raise ParameterAccessError(str(error), ParameterError.VALUE) from None

    def _take_modulo(self, changes: Mapping[int, float]) -> None:
        on = changes.get(_MODULO, self._store.value(_MODULO))
        length = changes.get(_MODULO_RANGE, self._store.value(_MODULO_RANGE))
        self._take({"modulo_range": float(length) if on else 0.0})

    def _take_block(self, number: int, at: int, value: float) -> None:
        """Build the table again; a row that contradicts itself cannot be started."""
        columns = [list(self._store.values(one, 0, 64)) for one in _BLOCKS]
        columns[number - _BLOCKS.start][at] = value
        blocks: dict[int, TraversingBlock] = {}
        broken: set[int] = set()
        for row in zip(*columns, strict=True):
            block_number = int(row[0])
            if block_number < 0:
                continue
            if block_number in blocks or block_number in broken:
                raise ParameterAccessError(f"block {block_number} stands twice", ParameterError.VALUE)
            try:
                blocks[block_number] = _block_of(row)
            except ConfigurationError:
                broken.add(block_number)
        self._axis.blocks.broken = frozenset(broken)
        self._take({"block": tuple(blocks[one] for one in sorted(blocks))})


def _block_of(row: tuple[int | float, ...]) -> TraversingBlock:
    number, position, velocity, acceleration, deceleration, task, parameter, mode = row
    kind, follows = int(mode) >> 8, int(mode) >> 4 & 0xF
    if kind > 1 or follows >= len(_CONTINUATIONS):
        raise ConfigurationError("p2623", int(mode), "0h to 30h, 100h to 130h")
    return TraversingBlock(
        number=int(number),
        task=_TASKS.get(int(task), "relative" if kind else "absolute"),
        position=int(position),
        velocity=float(velocity),
        acceleration_percent=float(acceleration),
        deceleration_percent=float(deceleration),
        continuation=_CONTINUATIONS[follows],
        parameter=int(parameter),
    )


def _row_of(block: TraversingBlock) -> tuple[float, ...]:
    task = next((one for one, kind in _TASKS.items() if kind == block.task), 1)
    mode = _CONTINUATIONS.index(block.continuation) << 4 | (block.task == "relative") << 8
    return (
        block.number,
        block.position,
        block.velocity,
        block.acceleration_percent,
        block.deceleration_percent,
        task,
        block.parameter,
        mode,
    )
