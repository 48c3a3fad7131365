"""What a bench consists of, by name, and the words for what passes on its buses."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from fieldbus.can.frame import CanFrame
from fieldbus.errors import ConfigurationError
from hil.errors import UnsupportedFaultError
from motion.s7.call_log import CallLog

if TYPE_CHECKING:
    from fieldbus.canopen.master import CanopenMaster
    from fieldbus.canopen.node import RemoteNode
    from fieldbus.modbus import ModbusFrame
    from hil.bench._ports import Port
    from hil.bench.config import BenchConfig
    from hil.bench.encoders import EncoderNodes
    from hil.bench.modbus_words import ModbusWords
    from hil.bench.words import BenchWords
    from motion.drives.profidrive_encoder import ProfidriveEncoderPort
    from motion.s7.handles import AxisHandle, EncoderHandle
    from motion.s7.runtime import Runtime

MASTER_NODE: Final = 127
"""Node-ID of the controller."""


class BenchParts:
    """Base of `Bench`, which fills the tables below while it is built; see there."""

    config: BenchConfig
    runtime: Runtime
    _segments: dict[str, Any]
    _masters: dict[str, CanopenMaster]
    _drives: dict[str, Any]
    _encoders: dict[str, Any]
    _second_encoders: dict[str, Any]
    _devices: dict[str, Any]
    _stations: dict[str, Any]
    _encoder_nodes: EncoderNodes | None
    _ports: dict[str, Port]
    _axes: dict[str, AxisHandle]
    _external_encoders: dict[str, EncoderHandle]
    _words: dict[str | None, BenchWords]
    _modbus_words: ModbusWords | None = None

    def _part(self, kind: str, parts: dict[str, Any], name: str | None) -> Any:
        if name is None:
            if not parts:
                raise ConfigurationError("bench", kind, f"this bench has no {kind}")
            return next(iter(parts.values()))
        if name not in parts:
            raise ConfigurationError(f"bench {kind}", name, ", ".join(parts) or f"this bench has no {kind}")
        return parts[name]

    def axis(self, name: str | None = None) -> AxisHandle:
        """Return an axis by name, or the first one."""
        part: AxisHandle = self._part("axis", self._axes, name)
        return part

    def external_encoder(self, name: str | None = None) -> EncoderHandle:
        """Return an external encoder (technology object) by name, or the first one."""
        part: EncoderHandle = self._part("external encoder", self._external_encoders, name)
        return part

    def drive(self, name: str | None = None) -> Any:
        """Return a drive (or its proxy) by name, or the first one.

        Raises:
            ConfigurationError: There is no such drive.
            UnsupportedFaultError: The drive is physical and has no fault interface (verdict: blocked).

        """
        wanted = name or next(iter(self.config.drive), None)
        section = None if wanted is None else self.config.drive.get(wanted)
        if section is not None and section.device == "physical":
            raise UnsupportedFaultError(f"{wanted} is a physical drive: it offers no fault interface")
        return self._part("drive", self._drives, name)

    def encoder(self, name: str | None = None) -> Any:
        """Return an encoder that is a device of its own (or its proxy) by name, or the first one.

        `drive1.encoder2` is the second encoder of a drive.

        Raises:
            ConfigurationError: There is no such encoder.
            UnsupportedFaultError: The encoder is physical and has no fault interface (verdict: blocked).

        """
        if name in self._second_encoders:
            return self._second_encoders[name]
        wanted = name or next(iter(self.config.encoder), None)
        section = None if wanted is None else self.config.encoder.get(wanted)
        if section is not None and section.device == "physical":
            raise UnsupportedFaultError(f"{wanted} is a physical encoder: it offers no fault interface")
        return self._part("encoder", self._encoders, name)

    def encoder_port(self, name: str | None = None) -> ProfidriveEncoderPort:
        """Return the controller's port to a PROFIdrive encoder with a node of its own, by name, or to the
        first one.

        Raises:
            ConfigurationError: There is no such encoder that the bench leads.

        """
        ports = {} if self._encoder_nodes is None else self._encoder_nodes.ports
        port: ProfidriveEncoderPort = self._part("PROFIdrive encoder", ports, name)
        return port

    def device(self, name: str | None = None) -> Any:
        """Return an emulated device that is nothing but its EDS (or its proxy) by name, or the first one.

        Raises:
            ConfigurationError: There is no such device.

        """
        return self._part("device", self._devices, name)

    def station(self, name: str | None = None) -> Any:
        """Return an emulated I/O station by name, or the first one: `bench.station("io").input(3)` is a
        channel.

        Raises:
            ConfigurationError: There is no such station.

        """
        return self._part("station", self._stations, name)

    @property
    def station_names(self) -> tuple[str, ...]:
        """Names of the I/O stations."""
        return tuple(self._stations)

    def segment(self, name: str | None = None) -> Any:
        """Return a segment by name, or the first one."""
        return self._part("segment", self._segments, name)

    def record_calls(self) -> CallLog:
        """Record the outputs of every instruction instance in every call from now on (MC-566).

        `log.of(job)` are its calls: number, application cycle, time, outputs. Outputs of a single call are
        not missed.
        """
        return CallLog(self.runtime)

    def network(self, name: str | None = None) -> CanopenMaster:
        """Return the controller's CANopen services on a segment, by its name, or on the first one.

        `bench.network().nodes` are the drives as nodes: state, identity, EMCYs (`RemoteNode`).
        """
        part: CanopenMaster = self._part("CAN segment", self._masters, name)
        return part

    def node(self, drive_name: str | None = None) -> RemoteNode:
        """Return a drive or an encoder as its controller sees it, by name; default: the drive of the first
        axis.
        """
        if self._encoder_nodes is not None and drive_name in self._encoder_nodes.nodes:
            return self._encoder_nodes.nodes[drive_name]
        port: Port = self._part("drive with an axis", self._ports, drive_name)
        node: RemoteNode | None = getattr(port, "node", None)
        if node is None:
            raise ConfigurationError("bench node", port.name, "a drive on CAN; this one is on Modbus")
        return node

    def port(self, drive_name: str | None = None) -> Any:
        """Return the port by which an axis of the bench leads a drive, by the name of the drive, or the first
        one.
        """
        return self._part("drive with an axis", self._ports, drive_name)

    @property
    def axis_names(self) -> tuple[str, ...]:
        """Names of the axes."""
        return tuple(self._axes)

    @property
    def external_encoder_names(self) -> tuple[str, ...]:
        """Names of the external encoders (technology objects)."""
        return tuple(self._external_encoders)

    @property
    def drive_names(self) -> tuple[str, ...]:
        """Names of the drives that have a fault interface."""
        return tuple(self._drives)

    @property
    def profiles(self) -> frozenset[str]:
        """Profiles of the drives: `cia402`, `profidrive`."""
        return frozenset(section.profile for section in self.config.drive.values())

    @property
    def encoder_names(self) -> tuple[str, ...]:
        """Names of the encoders that are devices of their own."""
        return tuple(self.config.encoder)

    @property
    def second_encoder_names(self) -> tuple[str, ...]:
        """Names of the second encoders of drives."""
        return tuple(self._second_encoders)

    @property
    def device_names(self) -> tuple[str, ...]:
        """Names of the emulated devices that are nothing but their EDS."""
        return tuple(self._devices)

    @property
    def segment_names(self) -> tuple[str, ...]:
        """Names of the segments."""
        return tuple(self._segments)

    def drive_of(self, axis_name: str | None = None) -> str:
        """Return the name of the drive that moves an axis."""
        name = axis_name or next(iter(self.config.axis))
        return self.config.axis[name].drive

    def cob_ids(self, drive_name: str) -> dict[str, int]:
        """Return the identifiers that a drive, an encoder or a device uses, by name; a CiA 406 encoder has no
        RPDOs.

        Raises:
            ConfigurationError: There is no such node.

        """
        config = self.config
        nodes: dict[str, Any] = {**config.drive, **config.encoder, **config.device}
        if drive_name not in nodes:
            raise ConfigurationError("drive", drive_name, ", ".join(nodes) or "no nodes")
        if config.segment[nodes[drive_name].segment].on_modbus:
            raise ConfigurationError("drive", drive_name, "a node on CAN; this one is on Modbus")
        encoder = config.encoder.get(drive_name)
        node = nodes[drive_name].node_id
        ids = {
            "nmt": 0,
            "sync": 0x80,
            "emcy": 0x80 + node,
            "heartbeat": 0x700 + node,
            "sdo_rx": 0x600 + node,
            "sdo_tx": 0x580 + node,
            "controller_heartbeat": 0x700 + MASTER_NODE,
        }
        for number in range(1, 5):
            ids[f"tpdo{number}"] = 0x080 + 0x100 * number + node
            if encoder is None or (encoder.profile == "profidrive" and number == 1):
                ids[f"rpdo{number}"] = 0x100 + 0x100 * number + node
        return ids

    def nodes_on(self, segment: str) -> tuple[str, ...]:
        """Return the names of the drives, encoders and devices on a segment, in this order."""
        config = self.config
        nodes: dict[str, Any] = {**config.drive, **config.encoder, **config.device}
        return tuple(name for name, section in nodes.items() if section.segment == segment)

    @property
    def component_names(self) -> tuple[str, ...]:
        """Names of everything that tells its state in the history."""
        config = self.config
        own = (
            config.axis,
            config.external_encoder,
            config.drive,
            config.encoder,
            config.device,
            config.station,
            config.segment,
        )
        return (*(name for table in own for name in table), "controller", "adapter")

    @property
    def network_names(self) -> tuple[str, ...]:
        """Names of the CAN segments."""
        return tuple(self._masters)

    def decode(self, frame: CanFrame | ModbusFrame, *, segment: str | None = None) -> str:
        """Return the meaning of a frame in words, by the mapping that the bench, or without axes somebody,
        has written.

        Args:
            frame: The frame.
            segment: Where it was, for a bench with several segments whose nodes have equal node-IDs; None
                = anywhere.

        Raises:
            ConfigurationError: There is no such segment.

        """
        if not isinstance(frame, CanFrame):
            if self._modbus_words is None:
                from hil.bench.modbus_words import ModbusWords

                self._modbus_words = ModbusWords(self.config)
            return self._modbus_words.decode(frame, segment=segment)
        words = self._words.get(segment)
        if words is None:
            from hil.bench._ports import can_ports
            from hil.bench.drives import build_decoder
            from hil.bench.words import BenchWords

            names = list(self._masters) if segment is None else [segment]
            places = [self.segment(name) for name in names]
            logs = [] if self._axes else [place.log for place in places]
            words = self._words[segment] = BenchWords(
                lambda: build_decoder(self.config, can_ports(self._ports), segment=segment), logs
            )
        return words.decode(frame)
