"""`hil personalities`: how emulated drives can differ from the profile, for people and machines."""

from __future__ import annotations

from dataclasses import asdict
from typing import TypedDict

from emulators.drive.cia402.personality import Personality, load_personality, personality_names
from emulators.drive.cia402.quirks import Quirks
from hil._commands.terminal import print_json
from reports.json_types import JsonObject


class _Described(TypedDict):
    """A personality as JSON values."""

    name: str
    summary: str
    quirks: JsonObject
    drive: JsonObject
    objects: JsonObject
    emcy: JsonObject
    sources: JsonObject


def _described(personality: Personality) -> _Described:
    standard, own = asdict(Quirks()), asdict(personality.quirks)
    return {
        "name": personality.name,
        "summary": personality.summary,
        "quirks": {name: value for name, value in own.items() if value != standard[name]},
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
        for name, value in (*one["quirks"].items(), *one["drive"].items()):
            print(f"    {name} = {value!r}")  # noqa: T201 - the answer
        for what, there in (("defaults of objects", one["objects"]), ("EMCY codes", one["emcy"])):
            if there:
                print(f"    {what}: {', '.join(there)}")  # noqa: T201 - the answer
        for name, text in one["sources"].items():
            print(f"      {name}: {text}")  # noqa: T201 - the answer
    return 0
