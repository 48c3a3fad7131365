"""The page about the protection of the drive says what the code does."""

import re
from pathlib import Path

from emulators.drive.cia402 import RULES, DriveWarning
from emulators.drive.cia402.faults.rules import Reaction, Reset
from emulators.drive.cia402.objects.protection import protection_objects
from fieldbus.canopen.object_table import TYPE_NAMES, VAR

PAGE = Path(__file__).resolve().parents[3] / "docs" / "reference" / "drive-protection.md"
TEXT = PAGE.read_text(encoding="utf-8")


def rows(heading):
    """Return the cells of the tables below a heading."""
    part = re.split(r"^## ", TEXT.partition(f"\n## {heading}\n")[2], maxsplit=1, flags=re.MULTILINE)[0]
    return [
        [cell.strip().strip("`") for cell in line.strip("|").split("|")]
        for line in part.splitlines()
        if line.startswith("| ")
    ][1:]


def test_every_warning_is_listed():
    """Bit and words of every warning, in order."""
    assert [(row[0], row[1]) for row in rows("Warnings")] == [
        (str(one.value.bit_length() - 1), one.text) for one in DriveWarning
    ]


def test_every_manufacturer_object_is_listed():
    """Index, sub-indices, type and access of every object."""
    expected = []
    for row in protection_objects():
        members = {sub: item for sub, item in row.items.items() if sub or row.kind == VAR}
        alike = len(members) > 4
        for sub, item in members.items():
            name = f"{row.index:04X}h" + (
                "" if row.kind == VAR else f":1..{max(members)}" if alike else f":{sub}"
            )
            if (name, f"{TYPE_NAMES[item.data_type]} {item.access}") not in expected:
                expected.append((name, f"{TYPE_NAMES[item.data_type]} {item.access}"))
    assert [(row[0], row[1]) for row in rows("Manufacturer objects")] == expected


def test_every_fault_rule_is_listed():
    """Code, text, error register, torque and reset of every code of the profile, and of the two of this
    drive.
    """
    listed = {int(row[0].rstrip("h"), 16): row[1:] for row in rows("Faults")}
    assert set(listed) == set(RULES) | {0xFF80, 0xFF81}
    for code, rule in RULES.items():
        assert listed[code] == [
            rule.text,
            f"{rule.register:02X}h",
            "coasts" if rule.reaction is Reaction.COAST else "brakes",
            "restart" if rule.reset is Reset.RESTART else "edge",
        ]
