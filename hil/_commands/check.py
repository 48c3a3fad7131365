"""`hil check`: is a bench file good, and does the bench come up?"""

from __future__ import annotations

import time

from hil._commands.terminal import console, print_json, quiet_stdout
from hil.campaign import load_bench_file


def check_bench(reference: str, *, build: bool, as_json: bool) -> int:
    """Validate, bring up, tell; returns the exit code. What is wrong is raised as an error with exit code
    2.
    """
    with quiet_stdout(as_json):
        bench_file = load_bench_file(reference)
        kind = str(getattr(bench_file, "kind", "virtual"))
        facts: dict[str, object] = {
            "bench": bench_file.name,
            "kind": kind,
            "digest": bench_file.digest,
            "built": False,
        }
        config = getattr(bench_file, "config", None)
        personalities = {
            name: drive.personality
            for name, drive in getattr(config, "drive", {}).items()
            if getattr(drive, "personality", "standard") != "standard"
        }
        if personalities:
            facts["personalities"] = [f"{name}: {one}" for name, one in personalities.items()]
        if build and kind == "virtual":
            started = time.perf_counter()
            with bench_file.build(seed=0) as bench:
                facts["built"] = True
                facts["ready_after_s"] = bench.scheduler.now / 1e9  # all that the protocol of a bench has
                for part in ("axis_names", "drive_names", "encoder_names", "device_names", "segment_names"):
                    facts[part.removesuffix("_names")] = list(getattr(bench, part, ()))
                networks = [bench.network(name) for name in getattr(bench, "network_names", ())]
                nodes = [node for network in networks for node in network.nodes.values()]
                facts["nodes"] = (
                    [node.describe() for node in nodes]
                    if as_json
                    else [f"{node.name} (node {node.node_id}) {node.boot_state.value}" for node in nodes]
                )
                ports = [bench.axis(name).port for name in getattr(bench, "axis_names", ())]
                on_modbus = [port for port in ports if hasattr(port, "unit")]
                if on_modbus:
                    facts["modbus"] = (
                        [port.describe() for port in on_modbus]
                        if as_json
                        else [f"{port.name} (unit {port.unit}) {port.stage.value}" for port in on_modbus]
                    )
                facts["signals"] = len(bench.trace().names())
            facts["wall_s"] = round(time.perf_counter() - started, 3)
    if as_json:
        print_json(facts)
    else:
        out = console()
        out.print(f"{bench_file.name}: good", style="bold green", markup=False)
        for key, value in facts.items():
            shown = ", ".join(map(str, value)) if isinstance(value, list) else value
            out.print(f"  {key}: {shown}", markup=False)
    return 0
