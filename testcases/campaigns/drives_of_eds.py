"""Drives that are as their EDS says, or not: modes and PDOs that the controller plans, writes that are
refused, mappings that a user asks for.
"""

from __future__ import annotations

import math
import tempfile
from pathlib import Path
from typing import Any, Final

import numpy as np

from hil.campaign import Campaign, CaseContext
from motion.drives.cia402_plan import MODES
from testcases.campaigns._drives_of_eds import bench_of, drive_eds, plan_of
from testcases.campaigns.support import equal

CAMPAIGN: Final = Campaign("drives of an EDS", tags=("drive", "cia402"), bench="reference")
_READ_ONLY, _NO_OBJECT, _NO_SUB_INDEX = 0x06010002, 0x06020000, 0x06090011
_NOT_MAPPABLE, _TOO_LONG = 0x06040041, 0x06040042
_PDO1: Final = (0x60400010, 0x60FF0020, 0x60600008)
_STATUS_POSITION: Final = (0x60410010, 0x60640020)
_FEED: Final = "".join(
    f"[6092{f'sub{sub}' if sub >= 0 else ''}]\nParameterName=Feed\n"
    + ("ObjectType=9\nSubNumber=3\n\n" if sub < 0 else
       f"DataType={7 if sub else 5}\nAccessType=rw\nPDOMapping=0\nDefaultValue={(2, 360, 1)[sub]}\n\n")
    for sub in (-1, 0, 1, 2)
)  # fmt: skip

PLANS: Final[dict[str, tuple[dict[str, Any], str, tuple[str, ...]]]] = {
    "usual": ({}, "csv", ()),
    "fixed PDOs": (
        {
            "fixed": (0x1400, 0x1800, 0x1801),
            "records": {0x1600: _PDO1, 0x1A00: _STATUS_POSITION, 0x1A01: (0x606C0020, 0x60770010)},
        },
        "csv",
        ("RPDO1 is used", "TPDO1 is used", "TPDO2 is used"),
    ),
    "fixed PDOs in another order": (
        {
            "fixed": (0x1400, 0x1401, 0x1800, 0x1801),
            "records": {0x1600: (0x60400010,), 0x1601: (0x607A0020, 0x60FF0020), 0x1A00: (0x60410010,),
                        0x1A01: (0x606C0020, 0x60640020)},
        },
        "csv",
        ("RPDO1 is used", "RPDO2 is used"),
    ),
    "no cyclic mode": ({"changed": {0x6502: "0x2F"}}, "pv", ("mode pv",)),
    "no cyclic mode, fixed ramps": (
        {"changed": {0x6502: "0x2F"}, "read_only": (0x6083, 0x6084)}, "pv", ("6084h",),
    ),
    "no cyclic mode, limited ramps": (
        {"changed": {0x6502: "0x2F"}, "limits": {0x6083: (0, 4000000), 0x6084: (0, 4000000)}}, "pv",
        ("6083h is at most 4000000",),
    ),
    "only csp": ({"changed": {0x6502: "0xA0"}}, "csp", ("mode csp",)),
    "only ip": ({"changed": {0x6502: "0x60"}}, "ip", ("mode ip",)),
    "no velocity unit": ({"without": (0x60A9,)}, "csv", ("60A9h",)),
    "no heartbeat": ({"without": (0x1017,)}, "csv", ("1017h cannot be written: node guarding",)),
}  # fmt: skip
REFUSED: Final[dict[str, tuple[dict[str, int], str, dict[str, str]]]] = {
    "a torque that cannot be mapped": ({"1A00:3": _NOT_MAPPABLE}, "", {"1A00h:3": "6077h cannot be mapped"}),
    "a first TPDO that cannot be changed": (
        {"1A00:0": _TOO_LONG}, "", {"1A00h:0": "TPDO 285h carries 6041h, 6064h, 6077h"},
    ),
    "a third TPDO that cannot be changed": (
        {"1A02:0": _READ_ONLY}, "", {"1A02h:0": "TPDO 485h carries 603Fh, 1001h"},
    ),
    "a velocity unit": ({"60A9:0": _READ_ONLY}, "", {"60A9h:0": "velocities in units of 1 rpm"}),
    "a feed constant": ({"6092:1": _READ_ONLY}, _FEED, {"6092h:1": "left as it is"}),
    "a heartbeat": ({"1017:0": _NO_OBJECT}, "", {"1017h:0": "1017h cannot be written: node guarding"}),
    "a missing sub-index": ({"60C2:2": _NO_SUB_INDEX}, "", {}),
    "an identifier": (
        {"1400:1": _READ_ONLY}, "",
        {"1400h:1": "left as it is", "1600h:0": "RPDO 305h carries 6040h, 60FFh, 6060h"},
    ),
    "a mode": ({"6060:0": 0x08000022}, "", {"6060h:0": "left as it is"}),
    "a transmission type": ({"1800:2": _READ_ONLY}, "", {"1800h:2": "left as it is"}),
}  # fmt: skip
"""Entries that a drive refuses, what its EDS has besides, and what the controller does in place of each."""
MAPPINGS: Final[dict[str, tuple[dict[str, tuple[str, ...]], dict[str, Any], str]]] = {
    "another order": (
        {"rpdo2": ("6060h", "6040h", "60FFh"), "tpdo3": ("6064h", "6041h"), "tpdo1": ("606Ch",),
         "tpdo4": ("603Fh",)},
        {}, "",
    ),
    "too long": ({"tpdo1": ("6041h", "6064h", "606Ch")}, {}, "3 objects of 80 bits"),
    "as long as it can be": ({"tpdo1": ("6064h", "6041h", "6077h")}, {}, ""),
    "no such object": ({"tpdo1": ("6041h", "6066h")}, {}, "an object of the drive"),
    "not received": ({"rpdo1": ("6040h", "6041h")}, {"read_only": (0x6041,)}, "RPDO can carry"),
    "not sent": ({"rpdo1": ("6040h", "607Fh")}, {}, "what the controller sends: 6040h"),
    "no such PDO": ({"tpdo3": ("6041h", "6064h")}, {"count": 2}, "a PDO of the drive: TPDO1, TPDO2"),
    "too little": ({"tpdo1": ("6041h",)}, {}, "no PDO carries 6064h"),
    "not mappable": (
        {"tpdo1": ("6041h", "6064h")},
        {"fixed": (0x1800,), "records": {0x1A00: (0x60410010,)}}, "does not let TPDO1 be mapped",
    ),
    "the same as it is": (
        {"tpdo1": ("6041h", "6064h"), "rpdo1": ("6040h", "60FFh", "6060h")},
        {"fixed": (0x1400, 0x1800), "records": {0x1600: _PDO1, 0x1A00: _STATUS_POSITION}}, "",
    ),
}  # fmt: skip
"""PDOs that a user asks for, options of the EDS, and why that is refused; empty: it is taken."""


def _moves(ctx: CaseContext, bench: Any, what: str, *, shows_speed: bool = True) -> None:
    """Let the axis go a turn and back; expect the motor to have gone it, and the axis to show it."""
    axis, drive = bench.axis(), bench.drive()
    power = axis.power()
    equal(ctx, f"{what}: enabled", bench.run_until(lambda: bool(power.Status), 2.0), 1.0)
    for way in (10.0, -6.0):
        begun, angle = float(axis.var("ActualPosition")), drive.mechanics.motor_angle
        equal(ctx, f"{what}: done", bench.run_until(axis.move_relative(way).done, 5.0), 1.0)
        bench.run_for(0.2)
        moved = float(axis.var("ActualPosition")) - begun
        equal(ctx, f"{what}: way of {way}", moved, way, within=0.05)
        turns = (drive.mechanics.motor_angle - angle) / math.tau
        equal(ctx, f"{what}: turns of {way}", turns, way / 10.0, within=0.004)
    job = axis.move_velocity(60.0)
    equal(ctx, f"{what}: the velocity is reached", bench.run_until(job.in_velocity, 3.0), 1.0)
    bench.run_for(0.2)
    # An encoder with 360 units of a turn shows steps of 7 mm/s in a cycle.
    shown = np.asarray(bench.trace()["a.actual_velocity"].values[-40:], dtype=np.float64)
    equal(ctx, f"{what}: velocity", float(shown.mean()), 60.0, within=1.0)
    if shows_speed:
        equal(ctx, f"{what}: speed", axis.var("ActualSpeed"), 360.0, within=8.0)
    axis.power(False, stop_mode=2)
    bench.run_for(0.4)
    equal(ctx, f"{what}: off", axis.var("StatusWord.X0"), 0.0)
    equal(ctx, f"{what}: alarms", axis.var("ErrorWord"), 0.0)


@CAMPAIGN.product(
    "planned/{name}",
    parameters={"name": tuple(PLANS)},
    title="A drive with {name}",
    requirements=("C402-101", "C402-198"),
)
def planned(ctx: CaseContext, name: str) -> None:
    """The controller leads the drive in the mode and by the PDOs that its EDS allows, and says what that
    costs.
    """
    options, mode, notes = PLANS[name]
    with tempfile.TemporaryDirectory() as folder:
        file = bench_of(Path(folder), drive_eds(**options))
        plan = plan_of(file)
        equal(ctx, "mode", plan.mode, MODES[mode])
        text = " ".join(plan.notes)
        for note in notes:
            equal(ctx, f"{note!r} is said in {text!r}", note in text, 1.0)
        with file.build(seed=1) as bench:
            _moves(ctx, bench, name)
            drive = bench.drive()
            drive.power_off()
            bench.run_for(0.5)
            drive.power_on()
            bench.run_for(1.5)
            bench.wait_until(bench.axis().reset().done, 3.0)
            _moves(ctx, bench, f"{name}, after its supply was off")


@CAMPAIGN.product(
    "refused/{name}",
    parameters={"name": tuple(REFUSED)},
    title="A drive that refuses {name}",
    requirements=("C301-061",),
)
def refused(ctx: CaseContext, name: str) -> None:
    """A write that is refused although the EDS allows it leads to another plan, which is told once; the axis
    moves.
    """
    refusals, more, remedies = REFUSED[name]
    with tempfile.TemporaryDirectory() as folder:
        entries = "".join(f'"{entry}" = {code}\n' for entry, code in refusals.items())
        text = f'name = "refuses"\nsummary = "Refuses what its EDS promises."\n[refusals]\n{entries}'
        (Path(folder) / "refuses.toml").write_text(text)
        file = bench_of(Path(folder), drive_eds(more=more), 'personality = "refuses.toml"\n')
        with file.build(seed=1) as bench:
            _moves(ctx, bench, name)
            told = [event.data for event in bench.trace().events if event.kind == "node.refused"]
            found = {str(data["object"]): str(data["instead"]) for data in told}
            ctx.do(f"refused: {found}")
            for entry, remedy in remedies.items():
                equal(ctx, f"{entry}: {remedy}", remedy in found.get(entry, ""), 1.0)
            if remedies:
                equal(ctx, "nothing else is refused", found.keys() == remedies.keys(), 1.0)
            drive = bench.drive()
            drive.power_off()
            bench.run_for(0.5)
            drive.power_on()
            bench.run_for(1.0)
            again = [event for event in bench.trace().events if event.kind == "node.refused"]
            equal(ctx, "told once", len(again), len(told))


@CAMPAIGN.product(
    "mapped/{name}",
    parameters={"name": tuple(MAPPINGS)},
    title="PDOs that a user asks for: {name}",
    requirements=("C301-047",),
)
def mapped(ctx: CaseContext, name: str) -> None:
    """A mapping that is possible is set up and used, another one is refused with its reason."""
    tables, options, reason = MAPPINGS[name]
    keys = "[drive.d.pdo]\n" + "".join(f"{one} = {list(objects)!r}\n" for one, objects in tables.items())
    with tempfile.TemporaryDirectory() as folder:
        said = ""
        try:
            file = bench_of(Path(folder), drive_eds(**options), keys)
            plan = plan_of(file)
        except Exception as error:  # noqa: BLE001 - whatever refuses it, the story says what it was
            said = str(error)
        equal(ctx, f"{reason!r} is said in {said!r}", reason in said and bool(said) is bool(reason), 1.0)
        if reason:
            return
        sent = {use.cob_id: [raw >> 16 for raw in use.entries] for use in (*plan.transmit, *plan.receive)}
        for one, objects in tables.items():
            base = 0x180 if one[0] == "t" else 0x200
            cob_id = base + 0x100 * (int(one[-1]) - 1) + 5
            wanted = [int(text[:4], 16) for text in objects]
            equal(ctx, f"{one} carries {objects}", sent.get(cob_id) == wanted, 1.0)
        with file.build(seed=1) as bench:
            speeds = any(0x606C in objects for objects in sent.values())
            _moves(ctx, bench, name, shows_speed=speeds)
            ids = {frame.can_id for frame in bench.trace().frames}
            lost = [f"{cob_id:X}" for cob_id in sent if cob_id not in ids and 0x603F not in sent[cob_id]]
            equal(ctx, f"PDOs that never came: {lost}", len(lost), 0.0)
