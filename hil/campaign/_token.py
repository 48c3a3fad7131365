"""Replay tokens: everything needed to repeat a case, in one line of text."""

from __future__ import annotations

import base64
import binascii
import json
import zlib
from dataclasses import asdict, dataclass, field, fields
from typing import TYPE_CHECKING, Final

from hil.errors import TokenError

if TYPE_CHECKING:
    from reports.json_types import JsonObject

PREFIX: Final = "HIL1-"
PYTEST: Final = "pytest"
"""What the campaign of a token begins with that repeats a test of pytest; behind the colon is its file."""
_MAX_CONTENT: Final = 4_000_000
"""Bytes after decompression; a longer one is no token of ours."""


@dataclass(frozen=True)
class Token:
    """What a token says."""

    case: str
    """Identifier of the case."""
    seed: int
    """Seed of the case itself."""
    campaign: str = ""
    """`module:NAME` or `path.py:NAME`; empty for a fuzz program and for a branch of an envelope."""
    bench: str = ""
    """Bench as given by the user; empty for the embedded one."""
    bench_digest: str = ""
    """SHA-256 of the bench file, to notice that it has changed."""
    program: list[JsonObject] | None = field(default=None)
    """Steps of a fuzz program."""
    branch: JsonObject | None = None
    """Branch of a stop envelope (`hil.envelope.Envelope.token`)."""
    example: str = ""
    """Example of Hypothesis with which a test of pytest begins: version and blob of `@reproduce_failure`."""

    @property
    def test_file(self) -> str:
        """File of the test of pytest that it repeats; empty: it repeats a case."""
        kind, sign, file = self.campaign.partition(":")
        return file if sign and kind == PYTEST else ""

    def encode(self) -> str:
        """Return the token text."""
        content = {key: value for key, value in asdict(self).items() if value not in ("", None)}
        packed = zlib.compress(json.dumps(content, sort_keys=True, separators=(",", ":")).encode(), 9)
        return PREFIX + base64.urlsafe_b64encode(packed).decode("ascii").rstrip("=")

    @classmethod
    def decode(cls, text: str) -> Token:
        """Read a token.

        Raises:
            TokenError: The text is no token, or was cut or changed.

        """
        text = "".join(text.split())
        if not text.startswith(PREFIX):
            raise TokenError(f"{text[:20]!r} is no replay token: it does not begin with {PREFIX}")
        body = text[len(PREFIX) :]
        try:
            packed = base64.b64decode(body + "=" * (-len(body) % 4), altchars=b"-_", validate=True)
            unpacker = zlib.decompressobj()
            raw = unpacker.decompress(packed, _MAX_CONTENT)
            if not unpacker.eof or unpacker.unused_data:
                raise TokenError("the replay token is cut off or too long")
            content = json.loads(raw)
        except (binascii.Error, zlib.error, ValueError):
            raise TokenError(
                "the replay token is damaged: copy it whole, from the report or the terminal"
            ) from None
        return cls._from_content(content)

    @classmethod
    def _from_content(cls, content: object) -> Token:
        kinds = {
            "case": str,
            "seed": int,
            "campaign": str,
            "bench": str,
            "bench_digest": str,
            "program": list,
            "branch": dict,
            "example": str,
        }
        if not isinstance(content, dict) or not {"case", "seed"} <= set(content):
            raise TokenError("the replay token lacks the case or the seed")
        known = {item.name for item in fields(cls)}
        for key, value in content.items():
            if key not in known:
                raise TokenError(f"the replay token holds {key!r}, which this version does not know")
            if not isinstance(value, kinds[key]) or isinstance(value, bool):
                raise TokenError(f"the replay token is damaged: {key} is {value!r}")
        return cls(**content)
