"""Messages of the page: what each may hold, and the text of answers.

Every message is one JSON object with `kind`; the kinds of all panes are one discriminated union, and what
does not fit it is refused with a sentence that says what and where.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from functools import reduce
from operator import or_
from typing import Annotated, Any, ClassVar, Final

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from fieldbus.errors import HilError

LARGEST_BYTES: Final = 256 * 1024
"""Longest message of a page, bytes; a bench file that is edited goes in one."""
RATE_PER_S: Final = 200.0
"""Messages that a page may send per second in the long run."""
BURST: Final = 400.0
"""Messages that it may send at once."""
_LONGEST_SHOWN: Final = 40


class MessageError(HilError):
    """A message of the page cannot be used; the text says why."""


class Message(BaseModel):
    """A message of the page. A subclass gives `kind` a literal, and its fields their ranges."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=True)

    operates: ClassVar[bool] = True
    """Whether only the operator who has control may send it; others may only watch."""

    aside: ClassVar[bool] = False
    """Whether another thread carries it out, because it takes long and does not touch the bench."""

    id: Annotated[int, Field(ge=0, le=2**53 - 1)] = 0
    """Number of the request; the reply carries it, too."""


class MessageReader:
    """Reads the messages of the given kinds.

    Args:
        kinds: Classes of messages, each with a literal `kind` of its own.

    """

    def __init__(self, kinds: Iterable[type[Message]]) -> None:
        union: Any = reduce(or_, kinds)
        self._adapter: TypeAdapter[Message] = TypeAdapter(Annotated[union, Field(discriminator="kind")])

    def read(self, text: str) -> Message:
        """Return the message of a text.

        Raises:
            MessageError: It is no JSON object of a known kind, or a field is missing, unknown or out of
                range.

        """
        try:
            return self._adapter.validate_json(text)
        except ValidationError as error:
            first = error.errors(include_url=False, include_context=False, include_input=False)[0]
            # The first part of the place is the kind, which the page knows, or what it sent in its place.
            place = ".".join(str(part)[:_LONGEST_SHOWN] for part in first["loc"][1:])
            raise MessageError(f"{place or 'message'}: {first['msg'][:400]}") from None
        except RecursionError:
            raise MessageError("message: nested too deeply") from None


class RateLimit:
    """Counts the messages of one page: `RATE_PER_S` in the long run, `BURST` at once.

    Args:
        per_s: Messages per second.
        burst: Messages at once.

    """

    def __init__(self, per_s: float = RATE_PER_S, burst: float = BURST) -> None:
        self._per_s = per_s
        self._burst = burst
        self._left = burst
        self._at_s = 0.0

    def allows(self, now_s: float) -> bool:
        """Return whether one more message may come at this time, s."""
        self._left = min(self._burst, self._left + (now_s - self._at_s) * self._per_s)
        self._at_s = now_s
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True


def encoded(document: object) -> str:
    """Return a document for the page as text; numbers that JSON does not have become null."""
    try:
        return json.dumps(document, separators=(",", ":"), allow_nan=False)
    except ValueError:
        return json.dumps(_finite(document), separators=(",", ":"))


def _finite(value: Any) -> Any:
    if isinstance(value, float):
        return value if value - value == 0.0 else None
    if isinstance(value, dict):
        return {key: _finite(one) for key, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(one) for one in value]
    return value
