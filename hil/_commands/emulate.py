"""`hil emulate`: the drives of a bench on a live bus."""

from __future__ import annotations

import math
import signal
import sys
from collections.abc import Mapping
from types import FrameType
from typing import TYPE_CHECKING, Any, Final

from fieldbus.errors import ConfigurationError
from hil._commands.terminal import console
from hil.campaign import load_bench_file
from hil.errors import CannotRunError

if TYPE_CHECKING:
    from fieldbus.history import Event
    from hil.bench.config import DriveSection

_BOOT_TIMEOUT_S: Final = 10.0
_SLICE_S: Final = 0.2
"""How long the scheduler runs until it is asked again: a signal does not wake it."""

_TOLD: Final = (
    "drive.nmt",
    "drive.state",
    "drive.fault",
    "drive.fault_cleared",
    "drive.connection_lost",
    "can.status",
)
"""Events that are of interest to somebody who watches."""


def emulate_bench(reference: str, *, interface: str, channel: str, seed: int, duration_s: float) -> int:
    """Run the emulated drives until Ctrl-C, SIGTERM or the end of `duration_s`; returns the exit code.

    What is of interest goes to standard error, a line each; the line that begins with "ready" comes when the
    drives are on the bus.

    Args:
        reference: Bench file or embedded name; a live bench or a virtual one.
        interface: python-can interface for all segments.
        channel: Its channel.
        seed: Seed of the drives' random streams.
        duration_s: 0: until the end is asked for.

    Raises:
        CannotRunError: The bench has no emulated drive, or drives that cannot share one bus.
        ConfigurationError: The bench file or the duration is wrong.
        BusError: The bus cannot be opened.

    """
    if not 0.0 <= duration_s < math.inf:
        raise ConfigurationError("--for", duration_s, "a number of seconds, 0 or more")
    config = _config_of(reference)
    emulated = {name: section for name, section in config.drive.items() if section.device == "emulated"}
    if not emulated:
        raise CannotRunError(f"the bench {config.bench.name!r} has no emulated drive")
    _check_nodes(emulated, f"{interface} {channel}")
    ended = False

    def end(number: int, frame: FrameType | None) -> None:  # noqa: ARG001 - signature of a signal handler
        nonlocal ended
        ended = True

    handlers = {number: signal.signal(number, end) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        from hil.bench.remote import DriveHost

        host = DriveHost(config, interface=interface, channel=channel, seed=seed, record=False)
        try:
            host.run_until(lambda: ended or host.booted, _BOOT_TIMEOUT_S)
            out = console()
            for name, section in emulated.items():
                out.print(
                    f"{name}: {section.profile}, node {section.node_id}, on {interface} {channel}",
                    markup=False,
                )
            out.print("ready; end with Ctrl-C", style="dim", markup=False)
            silence = host.history.listen(_tell)
            left_s = duration_s or math.inf
            while left_s > 0.0 and not ended:
                host.run_until(lambda: ended, min(left_s, _SLICE_S))
                left_s -= _SLICE_S
            silence()
        finally:
            host.close()
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
    return 0


def _config_of(reference: str) -> Any:
    """Return the description of the bench.

    Raises:
        CannotRunError: It has none that could be read: it is somebody's Python object.

    """
    bench_file: Any = load_bench_file(reference)
    config = getattr(bench_file, "config", None)
    if config is None:
        raise CannotRunError(
            f"the bench {bench_file.name!r} is no bench file: its drives cannot be emulated alone"
        )
    return config


def _check_nodes(drives: Mapping[str, DriveSection], where: str) -> None:
    """Refuse drives of different segments that would have the same node-ID on the one bus."""
    owners: dict[int, str] = {}
    for name, section in drives.items():
        other = owners.setdefault(section.node_id, name)
        if other != name:
            raise CannotRunError(
                f"{other} and {name} are both node {section.node_id}: on different segments of the bench they may be, "
                f"but {where} is one bus"
            )


def _tell(event: Event) -> None:
    if event.kind not in _TOLD:
        return
    data = dict(event.data)
    code = data.get("code")
    if isinstance(code, int):
        data["code"] = f"{code:04X}h"
    change = f"{data.pop('from')} -> {data.pop('to')}" if "from" in data else ""
    rest = ", ".join(f"{key} {value}" for key, value in data.items() if value not in ("", None))
    text = ", ".join(part for part in (change, rest) if part)
    sys.stderr.write(f"{event.time_ns * 1e-9:10.3f} s  {event.source}  {event.kind}  {text}\n")
