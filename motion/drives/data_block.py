"""A data block with the telegrams of several axes and encoders (CFG-257 to CFG-259)."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Final, TypeAlias

from fieldbus.errors import ConfigurationError
from fieldbus.profidrive import TelegramError, telegram
from motion.drives.telegram_block import TelegramBlock

if TYPE_CHECKING:
    from collections.abc import Sequence

Declaration: TypeAlias = "str | Mapping[str, Declaration]"

_ARRAY: Final = re.compile(r"Array\[(\d+)\.\.(\d+)\] of (PD_TEL\w+)")
_STRUCTURE: Final = re.compile(r"PD_TEL(\d+)")
_LARGEST_ARRAY: Final = 1000
_ALLOWED: Final = "PD_TELx with Input and Output, Array[a..b] of PD_TELx, or a structure of them"


class DataBlock:
    """Structures `PD_TELx` by their path: `block["axis1"]`,
    `block["encoders[1]"]`, `block["machine.torque"]`.

    Args:
        name: Its name, for messages.
        declarations: Data type by name: `PD_TEL105`, `Array[0..3] of PD_TEL83`, or a mapping for a
            structure or a PLC data type.
        only_in_load_memory: Attribute "only store in load memory".
        write_protected: Attribute "data block write-protected in the device".
        optimized: Attribute "optimized block access".
        technology_version: Version of the technology; from 4.0 on the access may be optimized.

    Raises:
        ConfigurationError: An attribute is set that has to be off, or a data type is none of these.

    """

    def __init__(
        self,
        name: str,
        declarations: Mapping[str, Declaration],
        *,
        only_in_load_memory: bool = False,
        write_protected: bool = False,
        optimized: bool = False,
        technology_version: float = 9.0,
    ) -> None:
        self.name = name
        off = {"only_in_load_memory": only_in_load_memory, "write_protected": write_protected}
        if technology_version < 4.0:
            off["optimized"] = optimized
        for attribute, value in off.items():
            if value:
                raise ConfigurationError(
                    f"{name}.{attribute}", value, "False: the axis reads and writes the block (CFG-259)"
                )
        self._blocks = dict(self._declare(declarations, ""))

    def _declare(
        self, declarations: Mapping[str, Declaration], prefix: str
    ) -> Iterator[tuple[str, TelegramBlock]]:
        for key, kind in declarations.items():
            path = f"{prefix}{key}"
            if not isinstance(kind, str):
                yield from self._declare(kind, f"{path}.")
                continue
            array = _ARRAY.fullmatch(kind)
            if array is None:
                yield path, self._block(path, kind)
                continue
            low, high = int(array[1]), int(array[2])
            if not low <= high < low + _LARGEST_ARRAY:
                raise ConfigurationError(f"{self.name}.{path}", kind, f"1 to {_LARGEST_ARRAY} elements")
            for number in range(low, high + 1):
                yield f"{path}[{number}]", self._block(path, array[3])

    def _block(self, path: str, kind: str) -> TelegramBlock:
        found = _STRUCTURE.fullmatch(kind)
        if found is None:
            raise ConfigurationError(f"{self.name}.{path}", kind, _ALLOWED)
        try:
            return TelegramBlock(telegram(int(found[1])))
        except TelegramError as error:
            raise ConfigurationError(f"{self.name}.{path}", kind, str(error)) from None

    def __getitem__(self, path: str) -> TelegramBlock:
        """Return the structure at a path.

        Raises:
            ConfigurationError: There is none.

        """
        block = self._blocks.get(path)
        if block is None:
            raise ConfigurationError(self.name, path, ", ".join(self._blocks) or "nothing is declared")
        return block

    def __iter__(self) -> Iterator[str]:
        return iter(self._blocks)


class JoinedBlocks:
    """The structure of a drive telegram and that of its supplement 750, in the order of the words (CFG-405).

    Args:
        main: `PD_TELx` of the drive telegram.
        torque: `PD_TEL750`.

    """

    def __init__(self, main: TelegramBlock, torque: TelegramBlock) -> None:
        self._main = main
        self._torque = torque

    @property
    def names(self) -> tuple[str, ...]:
        """Signals of `Input` and `Output`."""
        main, torque = self._main, self._torque
        return (*main.Input, *torque.Input, *main.Output, *torque.Output)

    def receive(self, answer: Sequence[int]) -> tuple[int, ...]:
        """Run `pre_servo` of both over what has arrived; return what the axis sees in this cycle."""
        split = len(self._main.Input)
        return self._main.receive(answer[:split]) + self._torque.receive(answer[split:])

    def send(self, row: Iterable[int]) -> tuple[int, ...]:
        """Run `post_servo` of both over what the axis outputs; return what is sent in this cycle."""
        words = tuple(row)
        split = len(self._main.Output)
        return self._main.send(words[:split]) + self._torque.send(words[split:])

    def suspend(self, on: bool) -> None:
        """Stop running the programs, or continue."""
        self._main.suspend(on)
        self._torque.suspend(on)
