"""I/O stations, analog drives and pulse modules of a bench file: what they are made of, their wires, the
controller's side.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from fieldbus.clock import MS, US
from hil.bench.io_config import LIMITS, SWITCHES, station_of

if TYPE_CHECKING:
    from numpy.random import Generator

    from emulators.drive.analog import AnalogDrive
    from emulators.drive.stepper import StepperDriveConfig
    from emulators.drive.stepper_can import StepperCanDrive
    from emulators.io import DigitalInput, ModbusIoStation
    from fieldbus.clock import Scheduler
    from fieldbus.history import History
    from hil.bench.config import BenchConfig
    from hil.bench.drive_config import DriveSection
    from hil.bench.modbus_links import ModbusSegment
    from motion.drives.analog import AnalogPort
    from motion.drives.station import StationInputs, StationLink


class WiredStation:
    """An emulated station for a Modbus segment: it can be put on a network or a line.

    Args:
        scheduler: Time of the bench.
        station: The station.
        processing_ns: From a request to its response, ns.

    """

    def __init__(self, scheduler: Scheduler, station: ModbusIoStation, *, processing_ns: int) -> None:
        self._scheduler = scheduler
        self.station = station
        self._processing_ns = processing_ns

    def listen(self, network: Any) -> None:
        """Answer on a network."""
        from fieldbus.modbus import TcpStation

        TcpStation(self._scheduler, network, self.station.server, processing_ns=self._processing_ns)

    def attach(self, line: Any) -> None:
        """Answer on a serial line."""
        from fieldbus.modbus import RtuStation

        RtuStation(
            self._scheduler,
            line,
            self.station.server,
            name=self.station.name,
            processing_ns=self._processing_ns,
        )


def build_station(
    scheduler: Scheduler,
    config: BenchConfig,
    name: str,
    *,
    drives: Mapping[str, Any],
    history: History,
    rng: Generator,
) -> WiredStation:
    """Return station `name`, wired to the drives."""
    from emulators.io import (
        AnalogInput,
        AnalogOutput,
        CounterInput,
        DigitalInput,
        DigitalOutput,
        ModbusIoStation,
    )

    section = config.station[name]

    def input_of(wire: str) -> DigitalInput:
        channel = DigitalInput(scheduler, filter_ms=section.input_filter_ms)
        drive, _, terminal = wire.partition(".")
        if terminal == "ready":
            drives[drive].on_ready.append(channel.set)
        elif terminal:
            _follow_switch(drives[drive], terminal, channel.set)
        return channel

    def at(wire: str, method: str) -> Any:
        return getattr(drives[wire.partition(".")[0]], method) if wire else None

    def counter_of(wire: str) -> CounterInput:
        if not wire:
            return CounterInput()
        drive = drives[wire.partition(".")[0]]
        if hasattr(drive, "emitted_count"):
            return CounterInput(drive.emitted_count)
        encoder = drive.core.encoder
        return CounterInput(lambda: encoder.increments)

    station = ModbusIoStation(
        scheduler,
        digital_inputs=[input_of(wire) for wire in section.digital_inputs],
        digital_outputs=[DigitalOutput(at(wire, "set_enable")) for wire in section.digital_outputs],
        analog_inputs=[
            AnalogInput(scheduler, 0.0, 10.0, bipolar=True, rng=rng) for _ in range(section.analog_inputs)
        ],
        analog_outputs=[
            AnalogOutput(0.0, 10.0, on_change=at(wire, "set_voltage"), rng=rng)
            for wire in section.analog_outputs
        ],
        counters=[counter_of(wire) for wire in section.counters],
        unit=section.unit,
        watchdog_ms=section.watchdog_ms,
        name=name,
        history=history,
    )
    return WiredStation(scheduler, station, processing_ns=round(section.processing_ms * MS))


def _follow_switch(drive: Any, switch: str, tell: Callable[[bool], object]) -> None:
    """Let a channel have the level that the input of a drive has, whatever becomes of it there."""
    inputs = drive.digital_inputs
    bit = 1 << SWITCH_BITS[switch]
    before = inputs.on_change

    def changed(old: int) -> None:
        before(old)
        tell(bool(inputs.value & bit))

    inputs.on_change = changed


SWITCH_BITS = dict(zip(SWITCHES, (0, 1, 2, 16, 17), strict=True))


def build_analog_drive(
    scheduler: Scheduler,
    config: BenchConfig,
    name: str,
    machine: dict[str, Any],
    *,
    history: History,
    rng: Generator,
) -> AnalogDrive:
    """Return the emulated analog drive `name`, still switched off; `machine` is what a drive of any profile
    has.
    """
    from emulators.drive.analog import AnalogDrive
    from emulators.drive.analog_config import AnalogConfig

    section = config.drive[name]
    own = section.analog
    drive = AnalogConfig(
        **{
            key: machine[key]
            for key in ("mechanics", "encoder", "brake", "tuning", "rated_torque_Nm", "input_filter_s")
        },
        servo_period_ns=config.bench.servo_period_us * US,
        reference_speed_rpm=own.reference_speed_rpm,
        max_speed_rpm=section.max_speed_rpm,
        offset_V=own.offset_v,
        dead_zone_V=own.dead_zone_v,
        inverted=own.inverted,
        enable_input=own.enable_input,
        ready_delay_s=own.ready_delay_ms / 1000.0,
        stop=own.stop,
        stop_ramp_s=section.off3_ramp_s,
        ready_falls=own.ready_falls,
    )
    return AnalogDrive(scheduler, drive, name=name, history=history, rng=rng)


def stepper_config(
    section: DriveSection, *, servo_period_us: int, mechanics: Any = None
) -> StepperDriveConfig:
    """Return module, motor and machine of a drive with `profile = "tm_pto"`.

    Raises:
        ConfigurationError: The values do not fit together.

    """
    from emulators.drive.stepper import StepperDriveConfig, signal_output_config
    from emulators.io.tm_pto import PtoConfig, SignalType

    if section.profile == "tm41":
        return signal_output_config(
            section.increments_per_revolution, section.max_speed_rpm, servo_period_ns=servo_period_us * US
        )
    own = section.tm_pto
    channel = PtoConfig(
        signal_type=SignalType[own.signals.upper()],
        reversal_pause_ms=own.reversal_pause_ms,
        increments=section.increments_per_revolution,
        reference_speed=own.reference_speed_rpm,
        maximum_speed=section.max_speed_rpm,
        ramp_stop_ms=max(1, round(section.off1_ramp_s * 1000.0)),
        quick_stop_ms=max(1, round(section.off3_ramp_s * 1000.0)),
        use_ed=own.use_ed,
        use_dr=own.use_dr,
        use_rs=own.use_rs,
        use_mi=own.use_mi,
        input_delay_ms=own.input_delay_ms,
        standard=own.variant == "standard",
        strict_parking=own.strict_parking,
    )
    return StepperDriveConfig(
        channel=channel,
        **({} if mechanics is None else {"mechanics": mechanics}),
        full_steps=own.full_steps,
        holding_torque_Nm=section.rated_torque_nm,
        corner_hz=own.corner_hz,
        start_stop_hz=own.start_stop_hz,
        ready_delay_s=own.ready_delay_ms / 1000.0,
        watchdog_cycles=own.watchdog_cycles,
        servo_period_ns=servo_period_us * US,
    )


def build_stepper(
    scheduler: Scheduler, segment: Any, config: BenchConfig, name: str, mechanics: Any, *, history: History
) -> StepperCanDrive:
    """Return the emulated pulse module `name` with its motor, still switched off."""
    from emulators.drive.stepper_can import StepperCanDrive, StepperNodeConfig

    section = config.drive[name]
    node = StepperNodeConfig(
        node_id=section.node_id,
        drive=stepper_config(section, servo_period_us=config.bench.servo_period_us, mechanics=mechanics),
        cycle_ns=config.bench.cycle_ms * MS,
        boot_time_s=section.boot_time_ms / 1000.0,
    )
    return StepperCanDrive(scheduler, segment, node, name=name, history=history)


# -- the controller's side
# -------------------------------------------------------------------------------------------


def build_link(
    config: BenchConfig, name: str, station: ModbusIoStation, segment: ModbusSegment, *, history: History
) -> StationLink:
    """Return the controller's side of a station."""
    from motion.drives.station import StationLink

    return StationLink(
        segment.client(name),
        station.image,
        unit=config.station[name].unit,
        grace_cycles=config.bench.grace_cycles,
        name=name,
        history=history,
    )


def build_analog_port(
    config: BenchConfig, name: str, links: Mapping[str, StationLink], *, history: History
) -> AnalogPort:
    """Return the port to an analog drive, by the wires of its station."""
    from motion.drives.analog import AnalogPort, AnalogPortConfig

    drive = config.drive[name]
    place = station_of(config, name) or ""
    station = config.station[place]
    axis = next(section for section in config.axis.values() if section.drive == name)
    enable = station.wire("digital_outputs", f"{name}.enable")
    ready = station.wire("digital_inputs", f"{name}.ready")
    own = AnalogPortConfig(
        cycle_ns=config.bench.cycle_ms * MS,
        grace_cycles=config.bench.grace_cycles,
        optional=drive.optional,
        reference_speed_rpm=float(
            axis.variables.get("Actor.DriveParameter.ReferenceSpeed", drive.analog.reference_speed_rpm)
        ),
        setpoint=station.analog_outputs.index(f"{name}.setpoint"),
        enable=enable if axis.variables.get("Actor.Interface.EnableDriveOutput", True) else None,
        ready=ready if axis.variables.get("Actor.Interface.DriveReadyInput", True) else None,
        counter=station.wire("counters", f"{name}.encoder"),
    )
    return AnalogPort(links[place], own, name=name, history=history)


def wired_variables(config: BenchConfig, axis: str) -> dict[str, Any]:
    """Return the variables of an axis that follow from the wires of its analog drive."""
    section = config.axis[axis]
    if config.drive[section.drive].profile != "analog":
        return {}
    station = config.station[station_of(config, section.drive) or ""]
    return {
        "Actor.Type": 0,
        "Actor.Interface.EnableDriveOutput": station.wire("digital_outputs", f"{section.drive}.enable")
        is not None,
        "Actor.Interface.DriveReadyInput": station.wire("digital_inputs", f"{section.drive}.ready")
        is not None,
    }


def axis_inputs(config: BenchConfig, axis: str, links: Mapping[str, StationLink]) -> StationInputs | None:
    """Return the switches of an axis that are wired to a station; None: those at its drive count."""
    from motion.drives.station import StationInputs

    section = config.axis[axis]
    place = section.inputs
    if place is None and config.drive[section.drive].profile == "analog":
        place = station_of(config, section.drive)
    if place is None:
        return None
    station = config.station[place]
    wires = {one: station.wire("digital_inputs", f"{section.drive}.{one}") for one in LIMITS}
    channels = {one: number for one, number in wires.items() if number is not None}
    return StationInputs(links[place], channels) if channels else None
