"""Root of every exception that this product raises on purpose."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Final, Self

_FEW_KEYS: Final = 12
"""Keys of a table up to which all of them are listed in addition to the one that was meant."""


class HilError(Exception):
    """Base of all exceptions of the product; catching it catches nothing of third parties."""


class ConfigurationError(HilError):
    """A value given by the user cannot be used.

    The message names where the value stands, the value, and what is allowed.

    Args:
        where: File, key path or parameter name.
        value: The offending value as given.
        allowed: What would have been accepted, in words.
        problem: What is wrong with the value, where it is more than that it is not allowed.

    """

    def __init__(self, where: str, value: object, allowed: str, *, problem: str = "is not allowed") -> None:
        super().__init__(f"{where}: {value!r} {problem}; allowed: {allowed}")
        self.where = where
        self.value = value
        self.allowed = allowed

    def within(self, place: str) -> Self:
        """Return the same error with a place in front of its message: `bench.toml`, `drive.x_drive`."""
        error = type(self).__new__(type(self), f"{place}: {self}")
        error.__dict__.update(self.__dict__)
        return error


class CombinedConfigurationError(ConfigurationError):
    """Several values given by the user cannot be used; the message has a line for each.

    Args:
        errors: What is wrong with each of them.

    """

    def __init__(self, errors: Sequence[ConfigurationError]) -> None:
        super(ConfigurationError, self).__init__("\n".join(map(str, errors)))
        self._errors = tuple(errors)
        self.where = errors[0].where
        self.value = errors[0].value
        self.allowed = errors[0].allowed

    def within(self, place: str) -> Self:
        """Return the same errors with a place in front of each message."""
        return type(self)([error.within(place) for error in self._errors])


class ErrorCollector:
    """Keeps the configuration errors of independent parts, so that the user sees all of them at once."""

    def __init__(self) -> None:
        self._errors: list[ConfigurationError] = []

    @contextmanager
    def located(self, place: str) -> Iterator[None]:
        """Keep the `ConfigurationError` that ends the block, with a place in front of its message."""
        try:
            yield
        except ConfigurationError as error:
            self._errors.append(error.within(place))

    def check(self) -> None:
        """Raise what was kept, if anything.

        Raises:
            ConfigurationError: At least one part cannot be configured.

        """
        if self._errors:
            raise self._errors[0] if len(self._errors) == 1 else CombinedConfigurationError(self._errors)


class UnknownNameError(ConfigurationError):
    """A name given by the user is not a known one.

    The message names similar ones, or all of them.

    Args:
        where: File, key path or parameter name; empty: the name itself is the place.
        name: The name as given.
        what: What it should name: `a kind of fault`.
        known: All known names.
        listed_by: Command that lists them, where they are too many for a message.
        more: What else could be done.

    """

    def __init__(
        self,
        where: str,
        name: object,
        what: str,
        known: Iterable[str],
        *,
        listed_by: str = "",
        more: str = "",
    ) -> None:
        names = list(known)
        every = f"`{listed_by}` lists them" if listed_by else f"allowed: {', '.join(names) or 'none'}"
        text = similar_names(str(name), names) or every
        text += f"; {more}" if more else ""
        super(ConfigurationError, self).__init__(
            f"{where}: {name!r} is not {what}; {text}" if where else f"{name}: this is not {what}; {text}"
        )
        self.where = where or str(name)
        self.value = name
        self.allowed = text


class UnknownKeyError(ConfigurationError):
    """A table given by the user has a key that it cannot have.

    Args:
        where: File and key path.
        key: The key as given.
        known: All keys of the table.

    """

    def __init__(self, where: str, key: str, known: Iterable[str]) -> None:
        self.allowed = unknown_key(key, known)
        super(ConfigurationError, self).__init__(f"{where}: {self.allowed}")
        self.where = where
        self.value = key


class MissingValueError(ConfigurationError):
    """A value that the user has to give is missing.

    Args:
        where: File, key path or parameter name.
        allowed: What would be accepted, in words.

    """

    def __init__(self, where: str, allowed: str) -> None:
        super(ConfigurationError, self).__init__(f"{where} is missing; allowed: {allowed}")
        self.where = where
        self.value = None
        self.allowed = allowed


def similar_names(name: str, known: Iterable[str], most: int = 3) -> str:
    """Return `similar: ...` with the nearest names, capital letters aside; empty: none is near."""
    by_lower: dict[str, list[str]] = {}
    for one in dict.fromkeys(known):
        by_lower.setdefault(one.lower(), []).append(one)
    near = difflib.get_close_matches(name.lower(), by_lower, n=most)
    return f"similar: {', '.join(one for key in near for one in by_lower[key])}" if near else ""


def unknown_key(key: str, known: Iterable[str]) -> str:
    """Return what a message says of a key that a table cannot have: the nearest one, and all if they are
    few.
    """
    names = list(known)
    every = f"allowed: {', '.join(names)}"
    near = difflib.get_close_matches(key, names, n=1)
    if not near:
        return f"unknown key; {every}"
    return f"unknown key; did you mean {near[0]}?" + (f" {every}" if len(names) <= _FEW_KEYS else "")


class UnknownAttributeError(AttributeError):
    """An object has no attribute of this name.

    The message, which is made only when somebody reads it, says what to use instead, or names similar ones.

    Args:
        owners: The object, and others whose attributes it has as well.
        attribute: The name as given.
        what: How the message calls the object; empty: by its class.
        instead: What to use instead, where that is known.

    """

    def __init__(self, *owners: object, attribute: str, what: str = "", instead: str = "") -> None:
        super().__init__(attribute, name=attribute, obj=owners[0])
        self._owners = owners
        self._attribute = attribute
        self._what = what or type(owners[0]).__name__
        self._instead = instead

    def __str__(self) -> str:
        public = [one for owner in self._owners for one in dir(owner) if not one.startswith("_")]
        hint = f"use {self._instead}" if self._instead else similar_names(self._attribute, public)
        return f"{self._what} has no {self._attribute!r}" + (f"; {hint}" if hint else "")


@contextmanager
def located(place: str) -> Iterator[None]:
    """Put a place in front of the message of a `ConfigurationError` that passes."""
    try:
        yield
    except ConfigurationError as error:
        raise error.within(place) from error.__cause__


class SchedulerError(HilError):
    """Misuse of a scheduler, such as an event in the past."""


class BusError(HilError):
    """A bus or one of its ports cannot do what was asked."""


class UnsupportedFaultError(HilError):
    """The present bench cannot inject this fault; the message says why (verdict: blocked)."""
