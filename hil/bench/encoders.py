"""What the controller does for the encoders of a bench file: ports, NMT, supervision."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Final

from fieldbus.canopen.node_setup import NodeSetup
from hil.bench.encoder_config import Cia406Table, ProfidriveEncoderTable
from hil.faults import ENCODER_FAULT_METHODS

if TYPE_CHECKING:
    from fieldbus.canopen.master import CanopenMaster
    from fieldbus.canopen.node import RemoteNode
    from fieldbus.history import History
    from hil.bench.config import BenchConfig
    from motion.drives.cia406 import Cia406Port
    from motion.drives.profidrive_encoder import ProfidriveEncoderPort

_PROFILE: Final = 406
_HEARTBEATS: Final = 3
"""Periods without a heartbeat after which an encoder counts as lost."""

ENCODER_METHODS: Final = ENCODER_FAULT_METHODS | {
    "turn_shaft",
    "place_shaft",
    "freeze_sign_of_life",
    "set_clock_jitter",
}
"""Methods of an encoder that may be called through the pipe to another process."""


def build_encoder_ports(
    masters: Mapping[str, CanopenMaster], config: BenchConfig, history: History
) -> dict[str, Cia406Port]:
    """Return a port to every CiA 406 encoder that an axis or an external encoder reads."""
    from motion.drives.cia406 import Cia406Port, Cia406PortConfig

    used = config.used_encoders
    ports = {}
    for name, section in config.encoder.items():
        if name not in used or not isinstance(section, Cia406Table):
            continue
        settings = Cia406PortConfig(
            node_id=section.node_id,
            range_steps=section.config().raw_range,
            absolute_encoder=section.absolute,
            grace_cycles=config.bench.grace_cycles,
        )
        ports[name] = Cia406Port(masters[section.segment], settings, name=name, history=history)
    return ports


class EncoderNodes:
    """The encoders that the controller leads, as nodes of its network: checked, started, started again.

    Encoders on a segment that somebody else leads are left to him. Nothing is written to them. A PROFIdrive
    encoder has a port, which exchanges its telegram in every cycle.

    Args:
        masters: CANopen services of the controller, by segment.
        config: The bench file.
        ports: Technology objects that depend on encoders, by the name of the encoder.
        history: Log of the ports.

    """

    def __init__(
        self,
        masters: Mapping[str, CanopenMaster],
        config: BenchConfig,
        ports: Mapping[str, Cia406Port] | None = None,
        history: History | None = None,
    ) -> None:
        users = ports or {}
        self._sections = {
            name: section for name, section in config.encoder.items() if config.leads(section.segment)
        }
        self.nodes: dict[str, RemoteNode] = {}
        self.ports: dict[str, ProfidriveEncoderPort] = {}
        for name, section in self._sections.items():
            master = masters[section.segment]
            setup = NodeSetup(
                section.node_id,
                name,
                device_profile=_PROFILE if isinstance(section, Cia406Table) else None,
                # The period of a physical one is not known.
                heartbeat_timeout_ms=_HEARTBEATS * section.heartbeat_ms
                if section.device == "emulated"
                else 0,
            )
            if isinstance(section, ProfidriveEncoderTable):
                self.ports[name] = port = _port(master, setup, section, config, history)
                self.nodes[name] = port.node
            else:
                self.nodes[name] = master.add_node(setup, users.get(name))

    def start(self) -> None:
        """Begin to take all of them into service."""
        for node in self.nodes.values():
            node.boot()

    @property
    def settled(self) -> bool:
        """Whether every encoder has been started, or there is a reason why not."""
        return all(node.started or node.failure is not None for node in self.nodes.values())

    def check(self) -> None:
        """Raise what stands against one that answers.

        Raises:
            BootFailure: It is no encoder, or does not let itself be read.

        """
        for node in self.nodes.values():
            if node.failure is not None and not node.failure.silent:
                raise node.failure

    @property
    def missing(self) -> list[str]:
        """Encoders that are not in service; one without heartbeat cannot be missed."""
        return [
            name
            for name, section in self._sections.items()
            if (section.heartbeat_ms and not self.nodes[name].in_service)
            or (name in self.ports and section.device == "emulated" and not self.ports[name].link_ok)
        ]


def _port(
    master: CanopenMaster,
    setup: NodeSetup,
    section: ProfidriveEncoderTable,
    config: BenchConfig,
    history: History | None,
) -> ProfidriveEncoderPort:
    from motion.drives.profidrive_encoder import EncoderPortConfig, ProfidriveEncoderPort

    own = section.profidrive
    words = EncoderPortConfig(
        telegram=own.telegram,
        sign_of_life=own.sign_of_life,
        grace_cycles=config.bench.grace_cycles,
        absolute_encoder=section.absolute,
        reference_speed=section.reference_speed,
        acknowledges_errors=setup.name in config.used_encoders,
    )
    return ProfidriveEncoderPort(master, setup, words, history=history)
