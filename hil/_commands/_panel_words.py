"""Lines of a panel: a command and its numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from fieldbus.errors import ConfigurationError

Commands = Mapping[str, tuple[str, str, Callable[..., object]]]
"""Name -> names of its numbers (optional ones in brackets), what it does in words, what does it."""


def parse(text: str, commands: Commands) -> tuple[str, list[float]] | None:
    """Return the command of a line and its numbers; None: the line is empty or a comment.

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
        return name, [float(value) for value in values]
    except ValueError as error:
        raise ConfigurationError(f"values of {name}", " ".join(values), f"numbers: {usage}") from error


def help_lines(commands: Commands) -> list[str]:
    """Return a line for each command."""
    return [f"  {name + ' ' + usage:24} {text}" for name, (usage, text, _) in commands.items()]
