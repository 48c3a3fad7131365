"""`hil personalities`: how emulated drives can differ from the profile, for people and machines."""

from __future__ import annotations

from dataclasses import asdict, fields
from typing import Any

from emulators.drive.cia402.personality import Personality, load_personality, personality_names
from emulators.drive.cia402.quirks import Quirks
from hil._commands.terminal import print_json


def _described(personality: Personality) -> dict[str, Any]:
    standard = asdict(Quirks())
    return {
        "name": personality.name,
        "summary": personality.summary,
        "quirks": {
            one.name: getattr(personality.quirks, one.name)
            for one in fields(Quirks)
            if getattr(personality.quirks, one.name) != standard[one.name]
        },
        "drive": dict(personality.drive),
        "objects": {f"{index:04X}:{sub}": value for (index, sub), value in personality.objects.items()},
        "emcy": {
            f"{code:04X}": {"code": sent.code, "register": sent.register, "data": sent.data.hex()}
            for code, sent in personality.emcy.items()
        },
        "sources": dict(personality.sources),
    }


def show_personalities(files: list[str], *, as_json: bool) -> int:
    """Print the personalities that come with the product, or those in files; returns the exit code."""
    described = [_described(load_personality(one)) for one in files or personality_names()]
    if as_json:
        print_json(described)
        return 0
    for one in described:
        print(f"{one['name']}: {one['summary']}")  # noqa: T201 - the answer
        for kind in ("quirks", "drive"):
            for name, value in one[kind].items():
                print(f"    {name} = {value!r}")  # noqa: T201 - the answer
        for kind, what in (("objects", "defaults of objects"), ("emcy", "EMCY codes")):
            if one[kind]:
                print(f"    {what}: {', '.join(one[kind])}")  # noqa: T201 - the answer
        for name, text in one["sources"].items():
            print(f"      {name}: {text}")  # noqa: T201 - the answer
    return 0
