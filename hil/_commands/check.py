"""`hil check`: is a bench file good, do its tables agree, and what is pending after the start?"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Final, TypedDict, TypeGuard

from fieldbus.errors import UnknownNameError
from hil._commands.terminal import console, print_json, quiet_stdout
from hil.bench import BenchFile
from hil.bench.drive_config import Cia402DriveTable
from hil.campaign import load_bench_file
from hil.protocols import kind_of
from motion.drives.profidrive_modbus import ProfidriveModbusPort

if TYPE_CHECKING:
    from hil.bench.bench import Bench
    from hil.bench.config import BenchConfig
    from hil.bench.rules import Finding

SETTLING_S: Final = 1.0
"""How long the bench runs before it is asked what is pending."""


def check_bench(reference: str, *, build: bool, as_json: bool, ignored: Sequence[str] = ()) -> int:
    """Validate, compare, bring up, tell; returns the exit code: 1 when something was found.

    Args:
        reference: Bench file, embedded name or object.
        build: Also bring a virtual bench up and let it run for a second.
        as_json: As JSON.
        ignored: Names of rules that do not count.

    Raises:
        ConfigurationError: The bench file is wrong, or there is no such rule.

    """
    with quiet_stdout(as_json):
        bench_file = load_bench_file(reference)
        kind = kind_of(bench_file)
        own = bench_file if isinstance(bench_file, BenchFile) else None
        config = None if own is None else own.config
        facts: dict[str, object] = {
            "bench": bench_file.name,
            "kind": kind,
            "digest": bench_file.digest,
            "built": False,
        }
        found = _findings(config, reference if own is None else own.source, ignored)
        personalities = {
            name: drive.personality
            for name, drive in ({} if config is None else config.drive).items()
            if isinstance(drive, Cia402DriveTable) and drive.personality != "standard"
        }
        if personalities:
            facts["personalities"] = [f"{name}: {one}" for name, one in personalities.items()]
        writes = [] if config is None else list(_writes(config))
        if writes:
            facts["physical"] = writes
        pending: list[_Pending] = []
        if build and kind == "virtual":
            started = time.perf_counter()
            with bench_file.build(seed=0) as bench:
                facts |= _parts(bench, as_json=as_json)
                bench.run_for(SETTLING_S)
                pending = _pending(bench, config, found, ignored)
            facts["wall_s"] = round(time.perf_counter() - started, 3)
    good = not found and not pending
    if as_json:
        print_json({**facts, "good": good, "findings": [one.to_dict() for one in found], "pending": pending})
    else:
        _tell(facts, found, pending)
    return 0 if good else 1


def _writes(config: BenchConfig) -> Iterator[str]:
    """Yield what the controller does at the start with every physical drive that it would set up."""
    for name, drive in config.can_drives.items():
        if drive.device == "physical" and any(axis.drive == name for axis in config.axis.values()):
            yield f"{name}: " + (
                "PDOs and parameters are written at every start (commission = true)"
                if drive.commission
                else "nothing is written; it has to be set up already (hil commission)"
            )


def _findings(config: BenchConfig | None, source: str, ignored: Sequence[str]) -> list[Finding]:
    from hil.bench import BenchFileError
    from hil.bench._agreement import contents
    from hil.bench.rules import RULES, findings

    names = [rule.name for rule in RULES]
    for name in ignored:
        if name not in names:
            raise UnknownNameError("--ignore", name, "a rule", names)
    if config is None:
        return []  # an object of the user's own has no tables
    if mistakes := contents(config):
        raise BenchFileError(source, "\n".join(f"{source}: {text}" for text in mistakes))
    return [one for one in findings(config) if one.rule.name not in ignored]


def _parts(bench: Bench, *, as_json: bool) -> dict[str, object]:
    """Return what is on a bench that has come up."""
    facts: dict[str, object] = {"built": True}
    facts["ready_after_s"] = bench.scheduler.now / 1e9  # all that the protocol of a bench has
    if not _is_whole(bench):
        return facts | {"signals": len(bench.trace().names())}
    facts |= {
        "axis": list(bench.axis_names),
        "drive": list(bench.drive_names),
        "encoder": list(bench.encoder_names),
        "device": list(bench.device_names),
        "segment": list(bench.segment_names),
    }
    networks = [bench.network(name) for name in bench.network_names]
    nodes = [node for network in networks for node in network.nodes.values()]
    facts["nodes"] = (
        [node.describe() for node in nodes]
        if as_json
        else [f"{node.name} (node {node.node_id}) {node.boot_state.value}" for node in nodes]
    )
    ports = [bench.axis(name).port for name in bench.axis_names]
    on_modbus = [port for port in ports if isinstance(port, ProfidriveModbusPort)]
    if on_modbus:
        facts["modbus"] = (
            [port.describe() for port in on_modbus]
            if as_json
            else [f"{port.name} (unit {port.unit}) {port.stage.value}" for port in on_modbus]
        )
    facts["signals"] = len(bench.trace().names())
    return facts


class _Pending(TypedDict):
    """An alarm that is pending after the start."""

    axis: str
    alarm: int
    reaction: int
    text: str
    rules: list[str]
    keys: list[str]


def _is_whole(bench: object) -> TypeGuard[Bench]:
    from hil.bench.bench import Bench

    return isinstance(bench, Bench)


def _pending(
    bench: Bench, config: BenchConfig | None, found: Sequence[Finding], ignored: Sequence[str]
) -> list[_Pending]:
    """Return the alarms that are pending on axes and external encoders, but those of ignored rules."""
    from hil.bench.rules import KEYS_OF_ALARMS, RULES

    if not _is_whole(bench):
        return []
    objects = [(name, bench.axis(name).object.engine) for name in bench.axis_names]
    objects += [(name, bench.external_encoder(name).object.engine) for name in bench.external_encoder_names]
    unimportant = {rule.alarm for rule in RULES if rule.name in ignored}
    pending: list[_Pending] = []
    for name, engine in objects:
        drive = config.axis[name].drive if config is not None and name in config.axis else ""
        for alarm in engine.pending:
            if alarm.number in unimportant:
                continue
            rules = [one.rule.name for one in found if one.axis == name and one.rule.alarm == alarm.number]
            known = KEYS_OF_ALARMS.get(alarm.number, ()) if drive else ()
            keys = [key.format(axis=name, drive=drive) for key in known]
            pending.append(
                {
                    "axis": name,
                    "alarm": alarm.number,
                    "reaction": alarm.reaction,
                    "text": alarm.text or alarm.entry.text,
                    "rules": rules,
                    "keys": [] if rules else keys,
                }
            )
    return pending


def _tell(facts: Mapping[str, object], found: Sequence[Finding], pending: Sequence[_Pending]) -> None:
    out = console()

    def say(text: str, style: str | None = None) -> None:
        out.print(text, style=style, markup=False, soft_wrap=True)

    problems = len(found) + len(pending)
    if problems:
        say(f"{facts['bench']}: {problems} {'problem' if problems == 1 else 'problems'}", "bold red")
    else:
        say(f"{facts['bench']}: good", "bold green")
    for one in found:
        alarm = f": alarm {one.rule.alarm}" if one.rule.alarm else ""
        say(f"  {one.axis}: {one.sentence}; {one.rule.otherwise}{alarm} ({one.rule.name})")
        say(f"    change {' or '.join(one.keys)}", "dim")
    for entry in pending:
        say(f"  {entry['axis']}: alarm {entry['alarm']} is pending after the start: {entry['text']}")
        if entry["rules"]:
            say(f"    because of {', '.join(entry['rules'])}", "dim")
        elif entry["keys"]:
            say(f"    change {' or '.join(entry['keys'])}", "dim")
    for key, value in facts.items():
        shown = ", ".join(map(str, value)) if isinstance(value, list) else value
        say(f"  {key}: {shown}")
