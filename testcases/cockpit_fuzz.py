"""Drawn messages for the WebSocket of the cockpit: `python -m testcases.cockpit_fuzz --messages 100000`.

Most are of a known kind with fields that are right, wrong, missing or too many; some are no message at all.
Every one that can be answered has to get one reply, with a sentence in place of a programming error; the
server and its bench have to go on, and an axis has to be operable afterwards.
"""

from __future__ import annotations

import argparse
import json
import random
import re
import sys
import time
from collections import Counter
from typing import Any

from websockets.exceptions import ConnectionClosed

from hil.cockpit.messages import Message, RateLimit
from testcases.cockpit_rig import Page, served

_RARE = ("bench.reset", "bench.open", "bench.start_text", "bench.schema", "session.write")
"""Kinds that bring a bench up or whose answer is long, which takes most of a second."""
_RARE_SHARE = 0.0005
_OWN_ERROR = re.compile(r"^[A-Z]\w*(Error|Exception): ")
"""What a programming error becomes."""
_WORDS = (
    *("axis1", "drive1", "alarm.raised", "reference", "enable", "rel", "abs", "home", "take", "ack", "jog"),
    *("stop", "release", "", "x" * 500, "../../etc/passwd", "\u0000", "\u202e"),
)
_NO_MESSAGES = ("", "{", "null", "[]", "1e999", '"text"', "{}", "[" * 3000, '{"kind":1}', "\ufeff{}")
_AT_ONCE = 50
_LONG = 300_000


class Draw:
    """Draws messages.

    Args:
        seed: The same seed draws the same messages.
        signals: Names that recorded signals have.

    """

    def __init__(self, seed: int, signals: list[str]) -> None:
        self.rng = random.Random(seed)
        self._words = [
            *signals,
            "axis1",
            "drive1",
            "alarm.raised",
            "reference",
            "enable",
            "rel",
            "abs",
            "home",
        ]
        self._words += [
            "take",
            "ack",
            "jog",
            "stop",
            "release",
            "",
            "x" * 500,
            "../../etc/passwd",
            "\u0000",
            "é\u202e",
        ]
        self._schemas = {
            schema["properties"]["kind"]["const"]: schema
            for schema in (kind.model_json_schema() for kind in Message.__subclasses__())
        }
        self._common = [kind for kind in self._schemas if kind not in _RARE]

    def text(self) -> str | bytes:
        """Return the next message."""
        rng = self.rng
        chance = rng.random()
        if chance < 0.0005:
            return rng.randbytes(rng.randrange(50))
        if chance < 0.03:
            return rng.choice(
                ["", "{", "null", "[]", "1e999", '"text"', "{}", "[" * 3000, '{"kind":1}', "\ufeff{}"]
            )
        if chance < 0.0301:
            return " " * _LONG
        kind = rng.choice(_RARE if rng.random() < _RARE_SHARE else self._common)
        message = self._object(self._schemas[kind], self._schemas[kind])
        message["id"] = rng.randrange(1, 2**31)
        text = json.dumps(message)
        if rng.random() < 0.02:
            place = rng.randrange(len(text))
            text = text[:place] + chr(rng.randrange(32, 127)) + text[place + 1 :]
        return text

    def _object(self, schema: dict[str, Any], root: dict[str, Any]) -> dict[str, Any]:
        rng = self.rng
        found = {}
        for name, one in schema["properties"].items():
            if name == "id" or rng.random() < 0.03:
                continue
            found[name] = self._anything() if rng.random() < 0.05 else self._value(one, root)
        if rng.random() < 0.02:
            found[rng.choice(self._words)] = self._anything()
        return found

    def _value(self, schema: dict[str, Any], root: dict[str, Any]) -> Any:
        rng = self.rng
        if "$ref" in schema:
            schema = root["$defs"][schema["$ref"].rpartition("/")[2]]
        if "const" in schema:
            return schema["const"]
        if "enum" in schema:
            return rng.choice(schema["enum"])
        if "anyOf" in schema:
            return self._value(rng.choice(schema["anyOf"]), root)
        kind = schema.get("type")
        if kind in ("number", "integer"):
            low = schema.get("minimum", schema.get("exclusiveMinimum", -1000.0))
            high = schema.get("maximum", schema.get("exclusiveMaximum", 1000.0))
            drawn = rng.choice([low, high, 0, low - 1, high + 1, rng.uniform(low, min(high, low + 100.0))])
            return int(drawn) if kind == "integer" and rng.random() < 0.9 else drawn
        if kind == "boolean":
            return rng.random() < 0.5
        if kind == "array":
            return [
                self._value(schema.get("items", {}), root) for _ in range(rng.choice([0, 1, 2, 3, 9, 70]))
            ]
        if kind == "object":
            return {rng.choice(self._words): self._anything() for _ in range(rng.randrange(3))}
        return rng.choice(self._words)

    def _anything(self) -> Any:
        return self.rng.choice(
            [None, True, -1, 0, 1e308, float("nan"), float("inf"), 2**70, "", "x", [], [[]], {}, {"a": {}}]
        )


def fuzz(messages: int, *, seed: int, bench: str = "reference") -> Counter[str]:
    """Send drawn messages; returns how many were carried out, refused and unanswerable, and how often the
    connection had to be opened anew.

    Raises:
        AssertionError: A reply is missing or tells of a programming error, or the cockpit does not go on.

    """
    counts: Counter[str] = Counter()
    with served(bench, rate=lambda: RateLimit(1e9, 1e9)) as cockpit:
        with cockpit.page() as page:
            signals = [one["name"] for one in page.description["panes"]["scope"]][:12]
        draw = Draw(seed, signals)
        while counts["sent"] < messages:
            with cockpit.page() as page:
                counts["connections"] += 1
                page.live()
                page.do("control.take") if page.state.get("operator") is None else None
                _send(page, draw, messages, counts)
        _works(cockpit)
    return counts


def _send(page: Page, draw: Draw, messages: int, counts: Counter[str]) -> None:
    """Send messages until there were enough, or one of them has ended the connection, as it has to."""
    while counts["sent"] < messages:
        expected = 0
        ends = False
        for _ in range(min(_AT_ONCE, messages - counts["sent"])):
            text = draw.text()
            counts["sent"] += 1
            ends = isinstance(text, bytes) or len(text) > _LONG // 2
            try:
                page.socket.send(text)
            except ConnectionClosed:
                ends = True
            if ends:
                break
            expected += '"kind": "life"' not in text
        if ends:
            page.until(lambda: page.code is not None, "the connection is ended")
            counts["ended"] += 1
            return
        for _ in range(expected):
            reply = page.reply()
            if reply["ok"]:
                counts["carried out"] += 1
                continue
            counts["refused"] += 1
            assert not _OWN_ERROR.match(reply["error"]), reply


def _works(cockpit: Any) -> None:
    """Check that an axis can be operated."""
    with cockpit.page() as page:
        page.live()
        page.until(lambda: page.state["operator"] is None, "control is free")
        page.do("control.take")
        page.do("bench.open", source="reference")
        page.do("time.run", speed=10.0)
        page.command("axis1", "take")
        page.command("axis1", "enable")
        page.until(lambda: page.state["axis"]["axis1"]["enabled"], "enabled")
        page.do("axis.jog", axis="axis1", slider=50.0)
        page.until(lambda: page.state["axis"]["axis1"]["velocity"] > 5.0, "jogs")
        page.do("axis.jog", axis="axis1", slider=0.0)
        page.until(lambda: page.state["axis"]["axis1"]["velocity"] == 0.0, "stopped")


def main() -> int:
    """Run the command."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--messages", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    begun = time.monotonic()
    counts = fuzz(arguments.messages, seed=arguments.seed)
    spent = time.monotonic() - begun
    print(f"{', '.join(f'{count} {what}' for what, count in counts.items())}; {spent:.0f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
