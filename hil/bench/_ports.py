"""The controller's ports to the drives of a bench file, as profile and bus want them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from fieldbus.clock import MS
from motion.drives.cia402 import Cia402Port, Cia402PortConfig
from motion.drives.profidrive import TelegramConfig
from motion.drives.profidrive_can import ProfidriveCanConfig, ProfidriveCanPort

if TYPE_CHECKING:
    from fieldbus.canopen.master import CanopenMaster
    from fieldbus.clock import Scheduler
    from fieldbus.history import History
    from hil.bench.config import BenchConfig
    from hil.bench.drive_config import DriveSection
    from hil.bench.modbus_links import ModbusSegment
    from motion.drives.analog import AnalogPort
    from motion.drives.profidrive_modbus import ProfidriveModbusPort

    CanPort = Cia402Port | ProfidriveCanPort
    Port = CanPort | ProfidriveModbusPort | AnalogPort


def _link(config: BenchConfig, drive: DriveSection) -> dict[str, Any]:
    """Return what holds for a drive on any bus."""
    return {
        "cycle_ns": config.bench.cycle_ms * MS,
        "absolute_encoder": drive.encoder == "absolute",
        "grace_cycles": config.bench.grace_cycles,
        "optional": drive.optional,
    }


def _node(drive: DriveSection) -> dict[str, Any]:
    """Return what holds for a drive of any profile on CANopen."""
    return {
        "node_id": drive.node_id,
        "heartbeat_ms": drive.heartbeat_ms,
        "consumer_heartbeat_ms": drive.consumer_heartbeat_ms,
        "guard_time_ms": drive.guard_time_ms,
        "life_time_factor": drive.life_time_factor,
        "vendor_id": drive.vendor_id,
        "product_code": drive.product_code,
        "revision": drive.revision,
        "serial": drive.serial,
        "store": drive.device == "emulated" if drive.store_parameters is None else drive.store_parameters,
    }


def _telegram(config: BenchConfig, drive: DriveSection) -> TelegramConfig:
    own = drive.profidrive
    return TelegramConfig(
        telegram=drive.telegram,
        torque_telegram=own.torque_telegram,
        safety_telegram=own.safety_telegram,
        reference_speed_rpm=own.reference_speed_rpm,
        reference_torque_nm=own.reference_torque_nm,
        sign_of_life=config.counts_life(drive),
        isochronous=not config.segment[drive.segment].on_modbus,
    )


def build_can_port(config: BenchConfig, name: str, master: CanopenMaster, *, history: History) -> CanPort:
    """Return the port to a drive on CAN."""
    drive = config.drive[name]
    common = {**_link(config, drive), **_node(drive)}
    if drive.profile in ("tm_pto", "tm41"):
        from motion.drives.tm_pto import PtoWords, TmPtoConfig, TmPtoPort

        signal_output = drive.profile == "tm41"
        words = PtoWords(
            variant="standard" if signal_output else drive.tm_pto.variant,
            reference_speed_rpm=drive.max_speed_rpm if signal_output else drive.tm_pto.reference_speed_rpm,
        )
        return TmPtoPort(master, TmPtoConfig(words=words, **common), name=name, history=history)
    if drive.profile == "profidrive":
        can = ProfidriveCanConfig(words=_telegram(config, drive), **common)
        return ProfidriveCanPort(master, can, name=name, history=history)
    own = Cia402PortConfig(
        rated_torque_nm=drive.rated_torque_nm,
        increments_per_revolution=drive.increments_per_revolution,
        off1_deceleration_rpm_s=drive.max_speed_rpm / drive.off1_ramp_s,
        off3_deceleration_rpm_s=drive.max_speed_rpm / drive.off3_ramp_s,
        **common,
    )
    return Cia402Port(master, own, name=name, history=history)


def build_modbus_port(
    config: BenchConfig, name: str, segment: ModbusSegment, scheduler: Scheduler, *, history: History
) -> ProfidriveModbusPort:
    """Return the port to a drive on Modbus."""
    from hil.bench.modbus_config import combines, registers_of
    from motion.drives.profidrive_modbus import ProfidriveModbusConfig, ProfidriveModbusPort

    drive = config.drive[name]
    own = ProfidriveModbusConfig(
        unit=drive.unit,
        registers=registers_of(drive),
        words=_telegram(config, drive),
        monitoring_ms=round(drive.profidrive.setpoint_monitoring_ms),
        combined=combines(drive, config.segment[drive.segment]),
        request_ns=segment.request_ns(),
        **_link(config, drive),
    )
    port = ProfidriveModbusPort(scheduler, segment.client(name), own, name=name, history=history)
    segment.watch(port)
    return port


def can_ports(ports: Mapping[str, Port]) -> dict[str, CanPort]:
    """Return the ports to drives on CAN."""
    return {name: port for name, port in ports.items() if isinstance(port, (Cia402Port, ProfidriveCanPort))}
