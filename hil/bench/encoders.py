"""Encoders of a bench file: the emulated devices, and what their controller does for them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import cache
from typing import TYPE_CHECKING, Any, Final

from fieldbus.canopen.node_setup import NodeSetup
from fieldbus.clock import MS
from fieldbus.node_clock import NodeClock
from hil.bench._profidrive_encoder import coupling, profidrive_encoder_config
from hil.faults import ENCODER_FAULT_METHODS

if TYPE_CHECKING:
    import canopen
    from numpy.random import Generator

    from emulators.encoder import Mounting
    from emulators.encoder.cia406 import CiA406Encoder, EncoderDeviceConfig
    from emulators.encoder.profidrive.can import ProfidriveCanEncoder
    from emulators.mechanics import DrivenShaft
    from fieldbus.canopen.master import CanopenMaster
    from fieldbus.canopen.node import RemoteNode
    from fieldbus.clock import Scheduler
    from fieldbus.history import History
    from hil.bench.config import BenchConfig
    from hil.bench.encoder_config import EncoderSection
    from motion.drives.cia406 import Cia406Port
    from motion.drives.profidrive_encoder import ProfidriveEncoderPort

_RPM: Final = 2.0 * math.pi / 60.0
_PROFILE: Final = 406
_HEARTBEATS: Final = 3
"""Periods without a heartbeat after which an encoder counts as lost."""
_SENSOR_SHARE: Final = 0.25
"""The second sensor of a multi-sensor device sits a quarter of the scale behind the first."""

ENCODER_METHODS: Final = ENCODER_FAULT_METHODS | {
    "turn_shaft",
    "place_shaft",
    "freeze_sign_of_life",
    "set_clock_jitter",
}
"""Methods of an encoder that may be called through the pipe to another process."""


@cache
def encoder_dictionary(kind: str, profile: str = "cia406") -> canopen.ObjectDictionary:
    """Return the object dictionary of an encoder type of the bench file; treat it as read-only."""
    if profile == "profidrive":
        from emulators.encoder.profidrive._eds import profidrive_encoder_dictionary

        return profidrive_encoder_dictionary()
    from emulators.encoder.cia406 import EncoderType, family_of
    from emulators.encoder.cia406 import encoder_dictionary as dictionary

    return dictionary(family_of(EncoderType[kind.upper()]))


def encoder_config(section: EncoderSection) -> EncoderDeviceConfig:
    """Return the configuration of the emulated encoder that a section describes.

    Raises:
        ConfigurationError: Resolution and range do not fit together.

    """
    from emulators.encoder.cia406 import EncoderDeviceConfig, EncoderType

    length_m = section.length_mm / 1000.0
    speed = section.max_speed_mm_s if section.linear else section.max_speed_rpm
    scale = 1.0 / 1000.0 if section.linear else _RPM
    return EncoderDeviceConfig(
        node_id=section.node_id,
        kind=EncoderType[section.type.upper()],
        steps_per_revolution=section.steps_per_revolution,
        revolutions=section.revolutions,
        measuring_step_nm=round(section.measuring_step_um * 1000.0),
        length_m=length_m,
        sensor_places_m=(0.0, _SENSOR_SHARE * length_m),
        max_speed=None if speed is None else speed * scale,
        objects={(0x1800, 5): section.cyclic_timer_ms, (0x1017, 0): section.heartbeat_ms},
    )


def build_encoder(
    scheduler: Scheduler,
    segments: Mapping[str, Any],
    config: BenchConfig,
    name: str,
    *,
    drives: Mapping[str, Any],
    history: History,
    rng: Generator,
) -> CiA406Encoder | ProfidriveCanEncoder:
    """Return the emulated encoder `name`, still switched off, on the machine of a drive or a shaft of its
    own.
    """
    from emulators.encoder.cia406 import CiA406Encoder

    section = config.encoder[name]
    mounting, shaft = _mounting(scheduler, config, section, drives)
    scheduler = NodeClock(scheduler, lambda: rng.spawn(1)[0])
    if section.profile == "profidrive":
        from emulators.encoder.profidrive.can import ProfidriveCanEncoder

        return ProfidriveCanEncoder(
            scheduler,
            segments[section.segment],
            profidrive_encoder_config(section, config.bench.cycle_ms * MS),
            mounting,
            name=name,
            history=history,
            rng=rng,
            shaft=shaft,
        )
    return CiA406Encoder(
        scheduler,
        segments[section.segment],
        encoder_config(section),
        mounting,
        name=name,
        history=history,
        rng=rng,
        shaft=shaft,
    )


def _mounting(
    scheduler: Scheduler, config: BenchConfig, section: EncoderSection, drives: Mapping[str, Any]
) -> tuple[Mounting, DrivenShaft | None]:
    from emulators.encoder import Mounting

    at_load = section.on is not None and section.mounting == "load"
    lead_mm = config.drive[section.on].mechanics.lead_screw_mm if section.on is not None and at_load else None
    ratio, offset, backlash = coupling(section, lead_mm)
    shaft: DrivenShaft | None = None
    source: Callable[[], float]
    if section.on is None:
        shaft = own = _own_shaft(scheduler, section)

        def source() -> float:
            return own.position
    else:
        mechanics = drives[section.on].mechanics
        if section.mounting == "motor":

            def source() -> float:
                return float(mechanics.motor_angle)
        else:

            def source() -> float:
                return float(mechanics.position)

    return Mounting(source, ratio=ratio, offset=offset, backlash=backlash), shaft


def _own_shaft(scheduler: Scheduler, section: EncoderSection) -> DrivenShaft:
    from emulators.mechanics import DrivenShaft

    shaft = DrivenShaft(scheduler)
    motion = section.shaft
    scale = 1.0 / 1000.0 if section.linear else _RPM
    if motion.profile is not None:
        shaft.follow([(time_s, speed * scale) for time_s, speed in motion.profile], repeat=motion.repeat)
    else:
        shaft.turn(scale * (motion.speed_mm_s if section.linear else motion.speed_rpm))
    return shaft


def used_encoders(config: BenchConfig) -> set[str]:
    """Return the names of the encoders that an axis or an external encoder reads."""
    used = {one.encoder for one in config.external_encoder.values()}
    used.update(name for axis in config.axis.values() for name in axis.encoders or ())
    return used


def build_encoder_ports(
    masters: Mapping[str, CanopenMaster], config: BenchConfig, history: History
) -> dict[str, Cia406Port]:
    """Return a port to every CiA 406 encoder that an axis or an external encoder reads."""
    from motion.drives.cia406 import Cia406Port, Cia406PortConfig

    used = used_encoders(config)
    ports = {}
    for name, section in config.encoder.items():
        if name not in used or section.profile != "cia406":
            continue
        device = encoder_config(section)
        settings = Cia406PortConfig(
            node_id=section.node_id,
            range_steps=device.raw_range,
            absolute_encoder="incremental" not in section.type,
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
                device_profile=_PROFILE if section.profile == "cia406" else None,
                # The period of a physical one is not known.
                heartbeat_timeout_ms=_HEARTBEATS * section.heartbeat_ms
                if section.device == "emulated"
                else 0,
            )
            if section.profile == "profidrive":
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
    section: EncoderSection,
    config: BenchConfig,
    history: History | None,
) -> ProfidriveEncoderPort:
    from motion.drives.profidrive_encoder import EncoderPortConfig, ProfidriveEncoderPort

    own = section.profidrive
    words = EncoderPortConfig(
        telegram=own.telegram,
        sign_of_life=own.sign_of_life,
        grace_cycles=config.bench.grace_cycles,
        absolute_encoder=not section.type.startswith("incremental"),
        reference_speed=own.reference_speed * (0.06 if section.linear else 1.0),
        acknowledges_errors=setup.name in used_encoders(config),
    )
    return ProfidriveEncoderPort(master, setup, words, history=history)
