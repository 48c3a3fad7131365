"""`hil commission`: what the controller sets up in the CiA 402 drives of a bench, and doing it."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Final

from fieldbus.errors import HilError
from hil._commands.emulate import config_of
from hil._commands.terminal import console, print_json
from hil.bench.drive_config import Cia402DriveTable
from hil.errors import CannotRunError

if TYPE_CHECKING:
    from fieldbus.canopen.dictionary import Entry
    from fieldbus.canopen.node_setup import NodeSetup
    from hil.bench.config import BenchConfig

_FEATURES: Final = (
    ("torque limit", 0x607200, "6072h"),
    ("touch probe", 0x60B800, "60B8h"),
    ("homing by the drive", 0x609800, "6098h"),
    ("storing of parameters", 0x101001, "1010h:1"),
)
"""What an axis has only if the drive has an object: name, key, object."""


@dataclass(frozen=True)
class Commissioning:
    """What is set up in one drive."""

    drive: str
    node_id: int
    mode: str
    pdos: list[str] = field(default_factory=list)
    writes: list[str] = field(default_factory=list)
    """Objects that get another value than the default of the EDS."""
    agreeing: int = 0
    """Objects whose default is the wanted value already."""
    lost: list[str] = field(default_factory=list)
    """What is lost against a drive that has everything."""
    refused: list[str] = field(default_factory=list)
    """What the drive has refused when it was written, and what was done instead."""
    result: str = ""
    """What writing has led to; empty: nothing was written."""
    good: bool = True


def commission(reference: str, *, write: bool, as_json: bool) -> int:
    """Show what the controller sets up in every CiA 402 drive; returns the exit code: 1 if a drive refuses.

    Args:
        reference: Bench file or embedded name.
        write: Also start the bench, which does it; on a live bench this writes to real drives.
        as_json: As JSON.

    Raises:
        CannotRunError: The bench has no CiA 402 drive with an axis.
        ConfigurationError: The bench file or an EDS is wrong.

    """
    config = config_of(reference)
    led = set(config.moved_drives)
    drives = {
        name: table
        for name, table in config.can_drives.items()
        if isinstance(table, Cia402DriveTable) and name in led
    }
    if not drives:
        raise CannotRunError(f"the bench {config.bench.name!r} has no CiA 402 drive with an axis")
    results, refused = _written(reference, drives) if write else ({}, {})
    found = [
        _of_drive(config, name, table, results.get(name, ""), refused.get(name, []))
        for name, table in drives.items()
    ]
    if as_json:
        print_json({"bench": config.bench.name, "written": write, "drives": [asdict(one) for one in found]})
    else:
        _tell(found, write=write)
    return 0 if all(one.good for one in found) else 1


def _of_drive(
    config: BenchConfig, name: str, table: Cia402DriveTable, result: str, refused: list[str]
) -> Commissioning:
    from fieldbus.canopen.dictionary import entries_of
    from motion.drives.cia402_plan import MODES

    setup = _setup(config, name, table)
    plan = table.plan()
    entries = entries_of(table.dictionary(), table.node_id)
    writes: list[str] = []
    agreeing = 0
    for index, sub, value, size in setup.parameters:
        entry = entries.get(index << 8 | sub)
        wanted = value & (1 << 8 * size) - 1
        default = _pattern(entry, size)
        if default == wanted:
            agreeing += 1
        else:
            before = "" if default is None else f"{default:0{2 * size}X}h -> "
            writes.append(f"{index:04X}h:{sub}: {before}{wanted:0{2 * size}X}h")
    lost = list(plan.notes)
    lost += [f"no {what}: {text} is missing" for what, key, text in _FEATURES if key not in entries]
    return Commissioning(
        name,
        table.node_id,
        next(one for one, code in MODES.items() if code == plan.mode),
        [
            f"{'T' if pdo.transmit else 'R'}PDO{pdo.number} {pdo.cob_id:03X}h: "
            + ", ".join(
                f"{raw >> 16:04X}h" + (f":{sub}" if (sub := raw >> 8 & 0xFF) else "") for raw in pdo.entries
            )
            for pdo in setup.pdos
            if pdo.entries
        ],
        writes,
        agreeing,
        lost,
        refused,
        result,
        not result or result.startswith("commissioned"),
    )


def _pattern(entry: Entry | None, size: int) -> int | None:
    """Return the default of a whole number as it is on the bus; None: the EDS gives none."""
    if entry is None or not entry.integer or not entry.given:
        return None
    return int(entry.default) & (1 << 8 * size) - 1


def _setup(config: BenchConfig, name: str, table: Cia402DriveTable) -> NodeSetup:
    """Return what the controller's port sets up; nothing is sent."""
    from fieldbus.can import CanMedium
    from fieldbus.canopen.master import CanopenMaster
    from fieldbus.clock import VirtualScheduler
    from fieldbus.history import History
    from hil.bench._port_site import PortSite

    scheduler = VirtualScheduler()
    history = History(scheduler)
    medium = CanMedium(scheduler, name=table.segment, history=history)
    port = table.build_port(
        PortSite(
            name=name,
            bench=config.bench,
            scheduler=scheduler,
            history=history,
            masters={table.segment: CanopenMaster(scheduler, medium)},
            modbus={},
            stations={},
            links={},
            variables={},
        )
    )
    return port.node.setup


def _written(
    reference: str, drives: dict[str, Cia402DriveTable]
) -> tuple[dict[str, str], dict[str, list[str]]]:
    """Start the bench, which commissions its drives; return outcome and refusals by drive."""
    from hil.bench import BenchFile
    from hil.campaign import load_bench_file

    file = load_bench_file(reference)
    assert isinstance(file, BenchFile)  # it has tables of drives
    allowed = {name: {"commission": True} for name in drives}
    try:
        with file.configured({"drive": allowed}).build(seed=0) as bench:
            events = bench.trace().events
    except HilError as error:
        return dict.fromkeys(drives, " ".join(str(error).split())), {}
    written = {
        str(event.data["name"]): event.data["written"] for event in events if event.kind == "node.configured"
    }
    refused: dict[str, list[str]] = {}
    for event in events:
        if event.kind == "node.refused":
            data = event.data
            refused.setdefault(str(data["name"]), []).append(
                f"{data['object']} = {data['value']}: {data['reason']}; {data['instead']}"
            )
    return {name: f"commissioned, {written.get(name, 0)} objects written" for name in drives}, refused


def _tell(found: list[Commissioning], *, write: bool) -> None:
    out = console()

    def say(text: str) -> None:
        out.print(text, markup=False, highlight=False, soft_wrap=True)

    for one in found:
        say(f"{one.drive} (node {one.node_id}): mode {one.mode}")
        for title, texts in (
            ("PDO", one.pdos),
            ("write", one.writes),
            ("lost", one.lost),
            ("refused", one.refused),
        ):
            for text in texts:
                say(f"    {title}: {text}")
        say(f"    {one.agreeing} more objects have the wanted value by default")
        if one.result:
            say(f"    {one.result}")
    if not write:
        say("nothing was written; --write starts the bench, which does it")
