"""`hil eds`: the EDS or DCF of an emulated device of a bench."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from hil._commands.emulate import config_of
from hil.errors import CannotRunError

if TYPE_CHECKING:
    from fieldbus.canopen.slave import CanopenSlave
    from hil.bench.config import BenchConfig


def write_eds(reference: str, name: str, *, dcf: bool, output: Path | None) -> int:
    """Write the file of one device as it is after its boot-up; returns the exit code.

    Args:
        reference: Bench file or embedded name.
        name: Drive or other device of it; empty = the first one.
        dcf: Write a DCF: with node-ID, bit rate and values.
        output: Where to; None = standard output.

    Raises:
        CannotRunError: There is no such emulated device, or the file cannot be written.
        ConfigurationError: The bench file or the EDS of the device is wrong.

    """
    config = config_of(reference)
    devices = [name for name, table in config.nodes.items() if table.device == "emulated"]
    if not devices:
        raise CannotRunError(f"the bench {config.bench.name!r} has no emulated CANopen device")
    wanted = name or devices[0]
    if wanted not in devices:
        there = ", ".join(devices)
        raise CannotRunError(
            f"{wanted!r} is no emulated CANopen device of the bench {config.bench.name!r}; there are: {there}"
        )
    text = _text(config, wanted, dcf=dcf, file_name="" if output is None else output.name)
    if output is None:
        sys.stdout.write(text)
        return 0
    try:
        output.write_text(text, encoding="utf-8")
    except OSError as error:
        raise CannotRunError(f"{output}: cannot be written ({error.strerror})") from error
    return 0


class _Node(Protocol):
    """A device with a CANopen node."""

    @property
    def slave(self) -> CanopenSlave:
        """Its node."""

    def power_on(self) -> None:
        """Switch the supply on."""


def _text(config: BenchConfig, name: str, *, dcf: bool, file_name: str) -> str:
    """Bring the device up alone on a segment of its own and return its file."""
    from fieldbus.can import CanMedium
    from fieldbus.canopen.eds_export import device_eds
    from fieldbus.clock import S, VirtualScheduler
    from fieldbus.history import History
    from hil.bench._site import DeviceSite
    from hil.bench.emulated import named_rng
    from hil.bench.segment_config import CanTable

    scheduler = VirtualScheduler()
    history = History(scheduler)
    segments: dict[str, CanMedium] = {}
    for segment, described in config.segment.items():
        if not isinstance(described, CanTable):
            continue
        segments[segment] = CanMedium(scheduler, bitrate=described.bitrate, name=segment, history=history)
        segments[segment].attach("listener", lambda _frame, _time: None)  # acknowledges

    def site(part: str) -> DeviceSite:
        return DeviceSite(
            name=part,
            bench=config.bench,
            scheduler=scheduler,
            segments=segments,
            history=history,
            rng=named_rng(0, part),
        )

    if name in config.encoder:
        encoder = config.encoder[name]
        machine = None if encoder.on is None else config.drive[encoder.on].build(site(encoder.on)).mechanics
        device: _Node = encoder.build(site(name), machine, config.lead_mm(encoder))
    else:
        device = {**config.can_drives, **config.device}[name].build(site(name))
    device.power_on()
    scheduler.run_for(S)
    bus = segments[config.nodes[name].segment]
    return device_eds(device.slave, dcf=dcf, file_name=file_name, bitrate=bus.bitrate)
