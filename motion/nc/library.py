"""The blocks of the PLC library for NC axes by name, as their modules define them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from motion.nc import blocks, correction_blocks, parameter_blocks, probe_blocks
from motion.nc.blocks import Block

if TYPE_CHECKING:
    from collections.abc import Mapping
    from types import ModuleType


def _of(*modules: ModuleType) -> dict[str, type[Block]]:
    """Return the blocks that modules define, by name, in their order."""
    found: dict[str, type[Block]] = {}
    for module in modules:
        for one in vars(module).values():
            if isinstance(one, type) and issubclass(one, Block) and one.block:
                found[one.block] = one
    return found


BLOCKS: Final[Mapping[str, type[Block]]] = _of(blocks, correction_blocks, probe_blocks, parameter_blocks)
"""Every block."""
COMMANDS: Final[Mapping[str, type[Block]]] = {
    name: one for name, one in _of(blocks, correction_blocks).items() if not name.startswith("MC_Read")
}
"""Those that do something with the axis."""
