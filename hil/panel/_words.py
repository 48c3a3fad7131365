"""Lines of a panel: a command and its values."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from fieldbus.errors import ConfigurationError

Commands = Mapping[str, tuple[str, str, Callable[..., object]]]
"""Name -> names of its values (optional ones in brackets), what it does in words, what does it."""


NAMES: Final = ("NAME", "LEADER", "CAM")
"""Values that are names; all others are numbers."""


def parse(text: str, commands: Commands) -> tuple[str, list[str | float]] | None:
    """Return the command of a line and its values; None: the line is empty or a comment.

    Raises:
        ConfigurationError: There is no such command, or its values are no numbers, too few or too many.

    """
    words = text.partition("#")[0].split()
    if not words:
        return None
    name, *values = words
    if name not in commands:
        raise ConfigurationError("command", name, f"one of {', '.join(commands)}")
    usage = commands[name][0]
    most = len(usage.split())
    least = len([one for one in usage.split() if not one.startswith("[")])
    if not least <= len(values) <= most:
        raise ConfigurationError(f"values of {name}", " ".join(values), usage or "none")
    try:
        return name, [
            value if kind in NAMES else float(value)
            for kind, value in zip(usage.split(), values, strict=False)
        ]
    except ValueError as error:
        raise ConfigurationError(f"values of {name}", " ".join(values), f"numbers: {usage}") from error


def help_lines(commands: Commands) -> list[str]:
    """Return a line for each command."""
    return [f"  {name + ' ' + usage:24} {text}" for name, (usage, text, _) in commands.items()]
