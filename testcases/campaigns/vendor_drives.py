"""Drives with the EDS of a manufacturer: what a bench takes from the file, in its units, what the bench file
changes, and what of the file is an object of the drive or plain storage.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from emulators.drive.cia402 import CiA402Drive, DriveConfig
from emulators.drive.cia402.eds import EDS
from emulators.drive.cia402.vendor_eds import VendorEds
from fieldbus.can import CanMedium
from fieldbus.clock import VirtualScheduler
from fieldbus.errors import ConfigurationError
from hil.campaign import Campaign, CaseContext
from testcases.campaigns._servo_rig import Servo
from testcases.campaigns.device_settings import refused
from testcases.campaigns.support import equal

CAMPAIGN: Final = Campaign(
    "vendor drives", controller="", tags=("drive", "cia402"), bench="testcases.campaigns.can_bus:BENCH"
)
Changes = dict[str, dict[str, str] | None]


@contextmanager
def eds(changes: Changes, more: str = "", *, brief: bool = False) -> Iterator[Path]:
    """Yield the path of an EDS: that of the product with other values.

    Args:
        changes: Keys of sections; None takes a section away.
        more: Text of further sections.
        brief: Only the objects that say what motor, encoder and speed are.

    """
    parts = re.split(r"(?m)^(?=\[)", EDS.text())
    found = {part[1 : part.index("]")]: part for part in parts if part.startswith("[")}
    if brief:
        found = {
            name: part
            for name, part in found.items()
            if not re.match("[0-9A-F]{4}", name) or name[:4] in BRIEF
        }
    for section, values in changes.items():
        if values is None:
            for name in [one for one in found if one == section or one.startswith(f"{section}sub")]:
                del found[name]
            continue
        text = found[section]
        for key, value in values.items():
            line = f"{key}={value}"
            text, count = re.subn(rf"(?m)^{key}=.*$", line, text)
            if not count:
                text = text.rstrip("\n") + f"\n{line}\n\n"
        found[section] = text
    with TemporaryDirectory() as folder:
        path = Path(folder) / "vendor.eds"
        path.write_text("".join(found.values()) + more, encoding="utf-8")
        yield path


BRIEF: Final = (
    *("1000", "6040", "6041", "60C2", "608B", "608C", "608F", "6092", "60A9", "6072", "6073"),
    *("6075", "6076", "607F", "6080", "6083", "6084", "6085", "609A", "6099"),
)
"""Objects that say what motor, encoder and speed are."""


def value(number: str | int) -> dict[str, str]:
    """Return the change of a default; empty: the file leaves it open."""
    return {"DefaultValue": str(number)}


def variable(index: str, data_type: str, default: str | int) -> str:
    """Return the text of one more variable."""
    return (
        f"\n[{index}]\nParameterName=Of the maker {index}\nObjectType=0x7\nDataType={data_type}\n"
        f"AccessType=rw\nDefaultValue={default}\nPDOMapping=0\n"
    )


OPEN: Final[Changes] = {
    **{name: value("") for name in ("6076", "607F", "6080", "6084", "6085", "6083", "609A", "6072", "6073")},
    **{
        name: value("")
        for name in ("608Fsub1", "608Fsub2", "6092sub1", "6092sub2", "60A9", "60C2sub1", "6075")
    },
}
"""A file that says nothing of the drive."""
RPM: Final = 0xFDB44700
"""60A9h: 10^-3 rpm."""
KEYS: Final[tuple[tuple[Changes, dict[str, float]], ...]] = (
    ({}, {}),
    ({"6076": value(1500)}, {"rated_torque_nm": 1.5}),
    ({"608Fsub1": value(20_000), "608Fsub2": value(4)}, {"increments_per_revolution": 5000}),
    ({"608Fsub1": value(20_001), "608Fsub2": value(4)}, {}),
    ({"608Fsub1": value(4)}, {"increments_per_revolution": 4}),
    ({"608Fsub1": value(3)}, {}),
    ({"608Fsub1": value(1 << 24)}, {"increments_per_revolution": 1 << 24}),
    ({"608Fsub1": value((1 << 24) + 1)}, {}),
    ({"6080": value(2500)}, {"max_speed_rpm": 2500.0}),
    ({"6080": value(1)}, {"max_speed_rpm": 1.0}),
    ({"6080": value(200_000)}, {"max_speed_rpm": 200_000.0}),
    ({"6080": value(200_001)}, {}),
    ({"6080": value(0)}, {}),
    ({"60A9": value(RPM), "607F": value(2_000_000), "6080": value(2500)}, {"max_speed_rpm": 2000.0}),
    ({"60A9": value(RPM), "607F": value(2_700_000), "6080": value(2500)}, {"max_speed_rpm": 2500.0}),
    (
        {"60A9": value(RPM), "6080": value(2000), "6084": value(4_000_000), "6085": value(8_000_000)},
        {"max_speed_rpm": 2000.0, "off1_ramp_s": 0.5, "off3_ramp_s": 0.25},
    ),
    (
        {"60A9": value(RPM), "6080": value(2000), "6084": value(2_000), "6085": value(1_999)},
        {"max_speed_rpm": 2000.0, "off1_ramp_s": 1000.0},
    ),
    (
        {"60A9": value(RPM), "6080": value(2000), "6084": value(2_000_000_000), "6085": value(2_000_100_000)},
        {"max_speed_rpm": 2000.0, "off1_ramp_s": 0.001},
    ),
    ({"607F": value(1500)}, {"max_speed_rpm": 1500.0}),
    # 608Bh and 608Ch say the unit of velocity as they did before 60A9h: 10^1 rpm, 10^-1 revolutions per s.
    ({"607F": value(150), "608B": value(1), "608C": value(0xA4)}, {"max_speed_rpm": 1500.0}),
    ({"607F": value(150), "608B": value(-1), "608C": value(0xA3)}, {"max_speed_rpm": 900.0}),
)
"""What a file says, and the keys of a drive that follow from it."""


@CAMPAIGN.case("keys", requirements=("C402-167",))
def keys(ctx: CaseContext) -> None:
    """What a file says of motor, encoder, speed and ramps, in its own units; 0 and nonsense leave it open."""
    for changes, wanted in KEYS:
        with eds(OPEN | changes, brief=True) as path:
            found = dict(VendorEds(path).bench_keys())
        name = ", ".join(f"{key} {one and one['DefaultValue']}" for key, one in changes.items())
        equal(ctx, f"{name}: keys {sorted(found)}", sorted(found) == sorted(wanted), 1)
        for key in set(found) & set(wanted):
            equal(ctx, f"{name}: {key}", found[key], wanted[key], within=1e-6 * wanted[key])
    with eds({"6072": value(2500), "6073": value(2000), "6075": value(4200), "6076": value(700)}) as path:
        vendor = VendorEds(path)
        equal(ctx, "torque, permille", vendor.max_torque_permille or 0, 2000)
        equal(ctx, "current, A", vendor.rated_current_A or 0.0, 4.2, within=1e-9)
        equal(ctx, "torque, Nm", vendor.rated_torque_nm or 0.0, 0.7, within=1e-9)
        equal(ctx, "unit of velocity, rpm", vendor.velocity_unit_rpm, 1.0, within=1e-9)
        shown = VendorEds(path, shown={0x607600: 900, 0x607500: 1000})
        equal(
            ctx, "what the drive shows goes before the file", shown.rated_torque_nm or 0.0, 0.9, within=1e-9
        )
    with eds(OPEN) as path:
        vendor = VendorEds(path)
        left_open = (vendor.max_torque_permille, vendor.rated_current_A, vendor.rated_torque_nm)
        equal(ctx, "nothing is said", left_open == (None, None, None), 1)


WANTED: Final = {
    "max_speed_rpm": 2000.0,
    "off1_ramp_s": 0.5,
    "off3_ramp_s": 0.2,
    "rated_torque_nm": 3.0,
    "increments_per_revolution": 8000,
    "cycle_ms": 4,
}


@CAMPAIGN.case("changed", requirements=("C402-167",))
def changed(ctx: CaseContext) -> None:
    """What the bench file has goes before the file of the maker, what neither has follows from the defaults;
    what exceeds the limits of an object is refused under its key.
    """
    units = {"60A9": value(RPM)}
    speed, ramp, quick = 2_000_000, 4_000_000, 10_000_000
    by_key = {
        "max_speed_rpm": {(0x607F, 0): speed, (0x6080, 0): 2000, (0x6099, 1): 133_333, (0x6099, 2): 13_333},
        "off1_ramp_s": {(0x6083, 0): ramp, (0x6084, 0): ramp, (0x609A, 0): ramp},
        "off3_ramp_s": {(0x6085, 0): quick},
        "rated_torque_nm": {(0x6076, 0): 3000},
        "increments_per_revolution": {(0x608F, 1): 8000, (0x608F, 2): 1},
    }
    with eds(OPEN | units) as path:
        vendor = VendorEds(path, increments_per_revolution=8000)
        found = dict(vendor.objects(WANTED, frozenset()))
    opened = by_key["off1_ramp_s"] | by_key["off3_ramp_s"] | by_key["rated_torque_nm"]
    opened |= by_key["increments_per_revolution"] | {(0x607F, 0): speed, (0x6080, 0): 2000}
    opened |= {(0x6092, 1): 8000, (0x6092, 2): 1, (0x60C2, 1): 4, (0x60C2, 2): -3}
    for place, wanted in opened.items():
        equal(ctx, f"left open: {place[0]:04X}h:{place[1]}", found.get(place, -1), wanted)
    with eds(units) as path:
        vendor = VendorEds(path)
        nothing = dict(vendor.objects(WANTED, frozenset()))
        for key, objects in by_key.items():
            taken = dict(vendor.objects(WANTED, frozenset({key})))
            for place, wanted in objects.items():
                equal(ctx, f"{key}: {place[0]:04X}h:{place[1]}", taken.get(place, -1), wanted)
            others = [one for one in taken if one not in objects and taken[one] != nothing.get(one)]
            equal(ctx, f"{key}: other objects {others}", len(others), 0)
        for place in ((0x6076, 0), (0x6080, 0), (0x6085, 0), (0x608F, 1)):
            equal(ctx, f"{place[0]:04X}h of the file stays", place in nothing, 0)
    limits = {"LowLimit": "0x64", "HighLimit": "0x7D0"}
    with eds(units | {"6080": value(1000) | limits}) as path:
        vendor = VendorEds(path)
        for rpm, fits in ((2000.0, True), (2001.0, False), (100.0, True), (99.0, False)):
            said = refused(
                vendor.objects, wanted=WANTED | {"max_speed_rpm": rpm}, written=frozenset({"max_speed_rpm"})
            )
            equal(ctx, f"{rpm} rpm: {said!r}", not said, fits)
            equal(ctx, "the key is named", fits or said.startswith("max_speed_rpm"), 1)
    with eds(units | {"6085": {"DataType": "0x0006"}}) as path:
        said = refused(VendorEds(path).objects, wanted=WANTED, written=frozenset({"off3_ramp_s"}))
        equal(ctx, f"too much for its type: {said!r}", "65535" in said, 1)


@CAMPAIGN.case("objects", requirements=("C301-085",))
def objects(ctx: CaseContext) -> None:
    """Objects of the profile with their length in the file and the sign of the profile; what is of another
    kind, and what the maker has put where the product has something else, is plain storage; the drive works
    without.
    """
    changes: Changes = {
        "6077": {"DataType": "0x0006"},
        "6085": {"DataType": "0x0006", "DefaultValue": "60000"},
        "6086": {"DataType": "0x0008", "DefaultValue": "0"},
        "2010sub1": {"ParameterName": "Something else", "DefaultValue": "7"},
        "6087": None,
        "6083": value(0),
    }
    with eds(changes, variable("5EE0", "0x0007", 77)) as path:
        rig = Servo(ctx, replace(DriveConfig.reference(), eds=path, objects={(0x607F, 0): 3000}))
        drive = rig.drive
        notes = " ".join(drive.node.notes)
        for text in ("6085h:0: 16 bits, 32 in the profile", "6086h:0: data type 0008h, 0003h in the profile"):
            equal(ctx, f"{text!r} is said", text in notes, 1)
        rig.shows(0x6085, 60_000)
        rig.shows(0x5EE0, 77)
        rig.equal("what the maker has is stored", rig.write(0x5EE0, 78), 0)
        rig.shows(0x5EE0, 78)
        rig.shows(0x2010, 7, sub=1)
        rig.equal("what the file lacks is not on the bus", rig.write(0x6087, 5), 0x06020000)
        rig.configure({0x6083: 100_000, 0x6084: 100_000, 0x6071: 0})
        rig.enable(3)
        rig.write(0x60FF, 300)
        rig.run(0.1)
        rig.equal("speed in the unit of the file, rpm", rig.rpm, 300.0, within=2.0)
        rig.control(0x02, 0.02)
        rig.equal("quick stop with 16 bits", rig.rpm, 0.0, within=3.0)
        rig.control(0x00)
        rig.enable(10)
        rig.write(0x6071, -200)
        rig.run(0.003)
        rig.shows(0x6077, -200, within=1)
        rig.control(0x00)
        # 2010h:1 of the maker is no threshold: the hard stop has that of the product.
        rig.write(0x2010, 0, 1)
        rig.write(0x6098, -3)
        rig.enable(6)
        rig.control(0x1F, 0.02)
        rig.bits(0x2000, 0)
        rig.control(0x00)
    for missing, text in (("6041", "has no object 6041h"), ("6040", "has no object 6040h")):
        with eds({missing: None}) as path:
            said = _problem(path)
            equal(ctx, f"without {missing}h: {said!r}", text in said, 1)
    with eds({"6041": {"DataType": "0x0008"}}) as path:
        said = _problem(path)
        equal(ctx, f"6041h as a real number: {said!r}", "no whole number" in said, 1)
    with eds({}) as path:
        said = refused(
            lambda: Servo(ctx, replace(DriveConfig.reference(), eds=path, objects={(0x5FFE, 0): 1}))
        )
        equal(ctx, f"an object that there is not: {said!r}", said.startswith("objects"), 1)


def _problem(path: Path) -> str:

    scheduler = VirtualScheduler()
    try:
        CiA402Drive(scheduler, CanMedium(scheduler), replace(DriveConfig.reference(), eds=path), name="servo")
    except ConfigurationError as error:
        return str(error)
    return ""
