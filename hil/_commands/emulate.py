"""`hil emulate`: the drives of a bench on a live bus."""

from __future__ import annotations

import signal
from types import FrameType
from typing import Any

from hil._commands.terminal import console
from hil.campaign import load_bench_file
from hil.errors import CannotRunError


def emulate_bench(reference: str, *, interface: str, channel: str, seed: int, duration_s: float) -> int:
    """Run the emulated drives until Ctrl-C, SIGTERM or the end of `duration_s`; returns the exit code."""
    bench_file: Any = load_bench_file(reference)
    config = getattr(bench_file, "config", None)
    if config is None:
        raise CannotRunError(
            f"the bench {bench_file.name!r} is no bench file: its drives cannot be emulated alone"
        )
    emulated = {name: section for name, section in config.drive.items() if section.device == "emulated"}
    if not emulated:
        raise CannotRunError(f"the bench {bench_file.name!r} has no emulated drive")
    from hil.bench.remote import DriveHost

    ended = False

    def end(number: int, frame: FrameType | None) -> None:  # noqa: ARG001 - signature of a signal handler
        nonlocal ended
        ended = True

    host = DriveHost(config, interface=interface, channel=channel, seed=seed)
    out = console()
    handlers = {number: signal.signal(number, end) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        for name, section in emulated.items():
            out.print(
                f"{name}: {section.profile}, node {section.node_id}, on {interface} {channel}", markup=False
            )
        out.print("running; end with Ctrl-C", style="dim", markup=False)
        if duration_s > 0:
            host.run_until(lambda: ended, duration_s)
        while duration_s <= 0 and not ended:
            # A signal does not wake the scheduler, so that it is asked for often enough.
            host.run_until(lambda: ended, 0.2)
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        host.close()
    return 0
