"""The page about the modes of the emulated drive says what the code does."""

from __future__ import annotations

import re
from pathlib import Path

from emulators.drive.cia402.objects.table import all_objects
from fieldbus.cia402 import MODE_NAMES

PAGE = Path(__file__).resolve().parents[3] / "docs" / "reference" / "drive-modes.md"
TEXT = PAGE.read_text(encoding="utf-8")
OBJECTS = {row.index: row for row in all_objects()}


def test_the_table_has_every_mode_of_6502h():
    """Numbers and short names are those of the supported modes, in order."""
    rows = [
        (int(number), name)
        for number, name in re.findall(r"^\| (\d+) \| (\w+) \| [^|]*\|", TEXT, re.MULTILINE)
    ]
    supported = int(OBJECTS[0x6502].items[0].default or 0)
    assert f"{supported:X}h" in TEXT
    expected = [
        (number, name) for number, name in MODE_NAMES.items() if number and supported >> number - 1 & 1
    ]
    assert [row for row in rows if row[1] in MODE_NAMES.values()] == expected


def test_objects_that_are_named_exist():
    """Every object of the page is in the object table."""
    named = {int(index, 16) for index in re.findall(r"\b(60[0-9A-F]{2}|65[0-9A-F]{2})h", TEXT)}
    assert len(named) > 30
    assert named <= set(OBJECTS)
