"""Object dictionaries and frame decoder of a bench file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Final

from hil.bench.drive_config import CanDriveTable, ProfidriveCanTable, servo_eds
from hil.bench.signal_texts import signal_words

if TYPE_CHECKING:
    import canopen

    from fieldbus.canopen.decode import FrameDecoder
    from hil.bench.config import BenchConfig
    from hil.bench.device_config import DeviceTable
    from hil.bench.drive_ports import CanPort
    from hil.bench.encoder_config import EncoderTable

_RECEIVE_WORDS: Final = 0x5800
"""Object of the first free process data word to a PROFIdrive axis (PD-341)."""
_SEND_WORDS: Final = 0x5810
"""Object of the first free process data word from it."""


def object_dictionary(eds: str | None = None) -> canopen.ObjectDictionary:
    """Return the object dictionary of an EDS, by default of the servo drive's; shared, read-only."""
    from fieldbus.canopen.eds import shared_dictionary

    return shared_dictionary(servo_eds() if eds is None else eds, node_id=1)


def build_decoder(
    config: BenchConfig, ports: Mapping[str, CanPort], *, segment: str | None = None
) -> FrameDecoder:
    """Return a decoder that knows names, dictionary and commissioned mapping of every node.

    Args:
        config: The bench file.
        ports: Ports to the drives on CAN, whose mapping is known.
        segment: Segment of the nodes; None: all of them.

    """
    from fieldbus.canopen.decode import FrameDecoder

    nodes: dict[str, CanDriveTable | EncoderTable | DeviceTable] = {
        name: table
        for name, table in config.nodes.items()
        if not config.segment[table.segment].on_modbus and segment in (None, table.segment)
    }
    decoder = FrameDecoder(
        {**{table.node_id: name for name, table in nodes.items()}, 127: "controller"},
        {table.node_id: table.dictionary() for table in nodes.values()},
    )
    for name, port in ports.items():
        if name in nodes:
            decoder.set_mapping(
                port.node_id, {(index, sub): value for index, sub, value in port.parameters()}
            )
    for name, table in nodes.items():
        if isinstance(table, ProfidriveCanTable):
            telegram = getattr(ports.get(name), "telegram", None) or table.named_telegram()[0]
            for first, layout in ((_RECEIVE_WORDS, telegram.setpoint), (_SEND_WORDS, telegram.actual)):
                words = signal_words(table, layout)
                decoder.set_words(table.node_id, first, layout.words, words.describe)
    return decoder
