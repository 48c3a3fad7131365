"""What a part of the bench offers so that faults can act on it: one small protocol per seam.

A part need not serve all of them. A kind of fault names the protocol that it needs; a part that lacks
a member of it refuses the kind with `UnsupportedFaultError`, and the test is blocked. That holds for
the emulated parts, for stand-ins of parts in another process, and for drives and benches of your own.

Forces are in N (Nm on a rotary axis), lengths in m (rad), times in s, unless the name of a parameter
says otherwise.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol, TypeGuard, TypeVar

from typing_extensions import get_protocol_members

from fieldbus.errors import UnsupportedFaultError

if TYPE_CHECKING:
    from fieldbus.can.frame import CanFrame
    from fieldbus.can.hooks import FrameHook
    from fieldbus.modbus.hooks import Change
    from fieldbus.modbus.serial_line import SerialListener
    from fieldbus.profidrive.telegrams import Telegram
    from hil.record import Vocabulary

T = TypeVar("T")

Undo = Callable[[], None]
"""Takes back what the call that returned it has done."""


class Part(Protocol):
    """Anything on a bench that has a name."""

    @property
    def name(self) -> str:
        """Name on the bench."""


def members(seam: type) -> tuple[str, ...]:
    """Return the names that a part has to offer for a seam, in the order of their definition."""
    wanted = get_protocol_members(seam)
    ordered = [name for base in reversed(seam.__mro__) for name in vars(base) if name in wanted]
    return tuple(dict.fromkeys([*ordered, *sorted(wanted)]))


def missing(part: object, seam: type) -> tuple[str, ...]:
    """Return which members of a seam a part does not offer."""
    return tuple(name for name in members(seam) if not _has(part, seam, name))


def _has(part: object, seam: type, name: str) -> bool:
    return callable(getattr(part, name, None)) if _is_method(seam, name) else hasattr(part, name)


def _is_method(seam: type, name: str) -> bool:
    return any(callable(vars(base).get(name)) for base in seam.__mro__)


def offers(part: object, seam: type[T]) -> TypeGuard[T]:
    """Return whether a part offers all members of a seam."""
    return not missing(part, seam)


def require(part: Part, seam: type[T], kind: str) -> T:
    """Return a part as what a kind of fault needs.

    Raises:
        UnsupportedFaultError: It lacks a member; the message names the first one.

    """
    if offers(part, seam):
        return part
    name = missing(part, seam)[0]
    call = "()" if _is_method(seam, name) else ""
    raise UnsupportedFaultError(f"{kind} cannot be injected: {part.name} offers no {name}{call}")


# -- drives ----------------------------------------------------------------------------------------------


class TripsOnFaults(Protocol):
    """A drive that can be made to trip."""

    def raise_fault(self, emcy_code: int, /, *, persistent: bool = False) -> None:
        """Trip with an EMCY code, or the number of a fault."""


class KeepsFaultCauses(Protocol):
    """A drive that can be made to trip, and whose cause of a fault can last."""

    def raise_fault(self, emcy_code: int, /, *, persistent: bool = False) -> None:
        """Trip with an EMCY code, or the number of a fault; a persistent cause refuses the fault reset."""

    def clear_fault_cause(self, emcy_code: int | None = None, /) -> None:
        """End the cause of a persistent fault, or of all of them."""


class HasSafeTorqueOff(Protocol):
    """A drive with STO."""

    def set_sto(self, active: bool, /) -> None:
        """Activate or release safe torque off."""


class HasSafeStop1(Protocol):
    """A drive with SS1."""

    def set_ss1(self, active: bool, /) -> None:
        """Activate or release safe stop 1."""


class HasInterlock(Protocol):
    """A drive with an interlock input."""

    def open_interlock(self, opened: bool, /) -> None:
        """Open or close the interlock."""


class HasSupply(Protocol):
    """A node or a station with a control supply."""

    def power_off(self) -> None:
        """Switch everything off at once, without a last message."""

    def power_on(self) -> None:
        """Start again, with boot-up."""


class SendsHeartbeat(Protocol):
    """A CANopen node with a heartbeat."""

    def stop_heartbeat(self, stopped: bool, /) -> None:
        """Suppress the heartbeat, or produce it again."""


class DelaysHeartbeat(Protocol):
    """A CANopen node whose heartbeat can be late."""

    def delay_heartbeat(self, delay_s: float, /) -> None:
        """Send every heartbeat this much late; 0 = in time."""


class HasMains(Protocol):
    """A drive that is supplied by the mains."""

    def disconnect_mains(self, missing: bool, /) -> None:
        """Disconnect the mains, or connect them again."""


class HasMainsVoltage(Protocol):
    """A drive whose mains voltage can dip."""

    def set_mains_voltage_share(self, share: float, /) -> None:
        """Set the mains voltage to a share of the rated one, above 0; 1 = all of it."""


class HasMainsPhases(Protocol):
    """A drive with three phases."""

    def disconnect_phase(self, missing: bool, /) -> None:
        """Disconnect one phase of the mains, or connect it again."""


class HasDcLink(Protocol):
    """A drive whose DC link voltage can be held."""

    def set_dc_link_voltage(self, voltage_V: float, /) -> None:
        """Hold the DC link at a voltage, V."""

    def restore_dc_link(self) -> None:
        """End it: the mains and the motor determine the voltage."""


class HasBrakeChopper(Protocol):
    """A drive with a brake chopper."""

    def disable_chopper(self, broken: bool, /) -> None:
        """Keep the brake chopper from conducting, or let it work again."""


class HasTemperatureSensors(Protocol):
    """A drive with temperature sensors."""

    def force_temperature(self, part: str, celsius: float | None, /) -> None:
        """Override the sensor of `motor` or `power_stage`, degC; None = the true temperature."""


class LimitsTorque(Protocol):
    """A drive whose torque can be limited."""

    def limit_torque(self, share: float | None, /) -> None:
        """Limit the torque to a share of the rated one; None = no limit."""


class HasHoldingBrake(Protocol):
    """A drive with a holding brake that can be stuck."""

    def set_brake_stuck(self, closed: bool | None, /) -> None:
        """Make the brake stuck closed or open; None = it works again."""


class HasWearingBrake(Protocol):
    """A drive with a holding brake that can slip."""

    def set_brake_torque_share(self, share: float, /) -> None:
        """Set the torque of the closed brake to a share of its own; 1 = as new."""


class HasRamps(Protocol):
    """A drive with ramps of its own."""

    def scale_ramps(self, share: float, /) -> None:
        """Set the slope of all ramps to a share of the configured one; 1 = as configured."""


class HasLocalControl(Protocol):
    """A drive that can be operated locally."""

    def set_local_control(self, active: bool, /) -> None:
        """Take the control away from the bus, or give it back."""


class MakesTransitions(Protocol):
    """A drive with a state machine."""

    def refuse_transitions(self, *numbers: int) -> None:
        """Refuse these transitions by command; none = refuse nothing."""


class CanDisableItself(Protocol):
    """A drive that can leave its operating state by itself."""

    def force_switch_on_disabled(self) -> None:
        """Change to *Switch on disabled* without a command and without a fault."""


class ShowsWarnings(Protocol):
    """A drive with a warning bit."""

    def force_warning(self, active: bool, /) -> None:
        """Show a warning without a cause, or end it."""


class ShowsStatusword(Protocol):
    """A drive whose status word can stand still."""

    def freeze_statusword(self, frozen: bool, /) -> None:
        """Hold the status word, or let it follow the state again."""


class ShowsStatuswordBits(Protocol):
    """A drive whose status word can be overridden."""

    def override_statusword_bits(self, set_bits: int, clear_bits: int, /) -> None:
        """Show bits as 1 and as 0, whatever the state; 0 and 0 end it."""


class ShowsTargetReached(Protocol):
    """A drive with a *target reached* bit."""

    def toggle_target_reached(self, period_s: float | None, /) -> None:
        """Toggle bit 10 with a period; None = it follows the motion again."""


class ShowsMode(Protocol):
    """A drive with a mode display."""

    def override_mode_display(self, number: int | None, /) -> None:
        """Show another mode of operation; None = the true one."""


class RestartsNode(Protocol):
    """A node that can restart during operation."""

    def reset_node(self, boot_s: float, /) -> None:
        """Restart: silence for so long, then boot-up."""


class AbortsSdo(Protocol):
    """A node with an SDO server that can abort."""

    def abort_sdo(self, code: int | None, index: int = 0, /) -> None:
        """Abort accesses to an index (0 = every one) with a code; None = serve them again."""


class AnswersSdo(Protocol):
    """A node with an SDO server that can be silent."""

    def suppress_sdo_responses(self, silent: bool, /) -> None:
        """Leave SDO requests without a response, or answer again."""


class SendsEmcy(Protocol):
    """A node that sends EMCYs."""

    def repeat_emcy(self, code: int | None, period_s: float = 0.001, /) -> None:
        """Send an EMCY again and again without any change of state; None = end."""


class HasClock(Protocol):
    """A node with a clock of its own."""

    def set_clock_drift(self, ppm: float, /) -> None:
        """Let the clock run fast (> 0) or slow; 0 = as fast as the others."""


class HasUnsteadyClock(Protocol):
    """A node whose cycles can begin late."""

    def set_clock_jitter(self, longest_ns: int, /) -> None:
        """Begin every cycle late by a random time of up to so many ns; 0 = in time."""


# -- safety functions of a PROFIdrive axis -----------------------------------------------------------------


class HasSafeStop2(Protocol):
    """A drive with SS2."""

    def set_ss2(self, active: bool, /) -> None:
        """Select or deselect safe stop 2."""


class HasSafeOperatingStop(Protocol):
    """A drive with SOS."""

    def set_sos(self, active: bool, /) -> None:
        """Select or deselect safe operating stop."""


class HasSafeBrakeControl(Protocol):
    """A drive with SBC."""

    def set_sbc(self, active: bool, /) -> None:
        """Select or deselect safe brake control."""


class HasSafelyLimitedSpeed(Protocol):
    """A drive with SLS."""

    def set_sls(self, level: int | None, /) -> None:
        """Select a level of safely limited speed; None = deselect."""


class HasSafeDirection(Protocol):
    """A drive with SDI."""

    def set_sdi(self, direction: int | None, /) -> None:
        """Select safe direction with the permitted one, 1 or -1; None = deselect."""


class HasSafelyLimitedPosition(Protocol):
    """A drive with SLP."""

    def set_slp(self, number: int | None, /) -> None:
        """Select a range of safely limited position; None = deselect."""


class AcknowledgesSafety(Protocol):
    """A drive with safety messages."""

    def acknowledge_safety(self) -> None:
        """Acknowledge the safety messages."""


# -- switches and mechanics ------------------------------------------------------------------------------


class HasInputs(Protocol):
    """A drive with digital inputs."""

    def force_input(self, name: str, state: bool | None, /) -> None:
        """Override `negative_limit`, `positive_limit`, `home`, `probe1` or `probe2`; None ends it."""


class HasInputPolarity(Protocol):
    """A drive whose inputs can be inverted."""

    def invert_input(self, name: str, inverted: bool, /) -> None:
        """Invert an input, or end it."""


class HasLimitSwitches(Protocol):
    """A drive with two limit switches."""

    def swap_limit_switches(self, swapped: bool, /) -> None:
        """Exchange the wires of the limit switches, or end it."""


class HasShaft(Protocol):
    """A drive whose load can be blocked."""

    def jam(self, active: bool, /) -> None:
        """Block the load, or release it."""


class HasLoad(Protocol):
    """A drive with a load."""

    def set_load_force(self, newton: float, /) -> None:
        """Set the external force on the load; 0 = none."""


class HasGuides(Protocol):
    """A drive whose load has friction."""

    def set_added_friction(self, force: float, /) -> None:
        """Set the dry friction that is added at the load; 0 = as new."""


class HasCoupling(Protocol):
    """A drive whose coupling can slip."""

    def slip_coupling(self, revolutions: float, /) -> None:
        """Displace the load by so many revolutions of the motor."""


class HasBreakableCoupling(Protocol):
    """A drive whose coupling can break."""

    def break_coupling(self, motor_share: float, /) -> None:
        """Part motor and load for good; the motor keeps a share of the inertia."""


class HasBacklash(Protocol):
    """A drive with play between motor and load."""

    def set_added_backlash(self, backlash: float, growth_s: float = 0.0, /) -> None:
        """Let the play grow by so much within a time; 0 = as built."""


# -- encoders --------------------------------------------------------------------------------------------


class HasEncoder(Protocol):
    """An encoder, or a drive with one, whose value can stand still."""

    def freeze_encoder(self, frozen: bool, /) -> None:
        """Hold the reported position, or let it follow the shaft again."""


class HasJumpingEncoder(Protocol):
    """An encoder whose value can jump."""

    def jump_encoder(self, increments: int, /) -> None:
        """Displace the reported position."""


class HasNoisyEncoder(Protocol):
    """An encoder whose value can be noisy."""

    def set_encoder_noise(self, increments: int, /) -> None:
        """Disturb every sample by up to so many increments; 0 = off."""


class HasReversibleEncoder(Protocol):
    """An encoder that can count the other way."""

    def reverse_encoder(self, reversed_direction: bool, /) -> None:
        """Count the other way from the present position on, or end it."""


class HasLossyEncoder(Protocol):
    """An encoder that can miss steps."""

    def lose_encoder_steps(self, every: int, /) -> None:
        """Miss one of so many steps; 0 = none."""


class HasIndex(Protocol):
    """An encoder with an index (zero mark)."""

    def suppress_index(self, missing: bool, /) -> None:
        """Suppress the index, or let it come again."""


class HasDriftingEncoder(Protocol):
    """An encoder whose value can drift."""

    def set_encoder_drift(self, increments_per_s: float, /) -> None:
        """Let the reported position drift; 0 = no further."""


class HasScaledEncoder(Protocol):
    """An encoder with a scale."""

    def set_encoder_scale(self, factor: float, /) -> None:
        """Count so many times the motion; 1 = right."""


class HasEncoderWire(Protocol):
    """An encoder with a wire."""

    def break_encoder_wire(self, broken: bool, /) -> None:
        """Break the wire of the encoder, or repair it."""


class ReportsEncoderErrors(Protocol):
    """An encoder with a PROFIdrive interface."""

    def set_encoder_error(self, code: int, active: bool, /) -> None:
        """Begin or end the cause of an error of Gx_XIST2."""


class HasPreset(Protocol):
    """An encoder with a preset."""

    def preset_encoder(self, value: int, /) -> None:
        """Write a preset, steps."""


class HasRange(Protocol):
    """An encoder with a range of positions."""

    def move_near_overflow(self, margin: int, /) -> None:
        """Place the position so many steps before the upper (> 0) or lower end of its range."""


class ReportsAlarms(Protocol):
    """An encoder with alarms (6503h)."""

    def set_alarm(self, bit: int, active: bool, /) -> None:
        """Begin or end the cause of an alarm."""


class ReportsWarnings(Protocol):
    """An encoder with warnings (6505h)."""

    def set_warning(self, bit: int, active: bool, /) -> None:
        """Begin or end the cause of a warning."""


class SendsCyclically(Protocol):
    """An encoder with a cyclic timer."""

    def force_cycle_time(self, period_ms: int | None, /) -> None:
        """Override the cycle of TPDO1; 0 = never, None = as configured."""


# -- terminals and pulse modules -------------------------------------------------------------------------


class HasReadySignal(Protocol):
    """A drive with a ready signal at a terminal."""

    def force_ready(self, level: bool | None, /) -> None:
        """Override the ready signal; None ends it."""


class HasPulseOutputs(Protocol):
    """A pulse module."""

    def short_outputs(self, present: bool, channel: int = 0, /) -> None:
        """Begin or end a short circuit at the outputs of a channel."""


class HasLoadSupply(Protocol):
    """A pulse module with a load supply."""

    def disconnect_load_supply(self, missing: bool, /) -> None:
        """Disconnect the load supply of the outputs, or connect it again."""


class IsPluggedIn(Protocol):
    """A pulse module in a station."""

    def unplug_module(self, failed: bool, /) -> None:
        """Pull the module out of its station, or plug it in again."""


class HasEncoderFeedback(Protocol):
    """A pulse module with encoder feedback."""

    def report_encoder_error(self, code: int, present: bool, /) -> None:
        """Begin or end the cause of an error of the encoder feedback."""


class HasStepperMotor(Protocol):
    """A drive with a stepper motor."""

    def lose_steps(self, periods: int, /) -> None:
        """Let the shaft lag behind by whole electrical periods; negative: ahead."""


# -- CAN segments ----------------------------------------------------------------------------------------


class CanPort(Part, Protocol):
    """A node on a virtual segment, with the seams of its CAN controller."""

    detached: bool
    receive_delay_ns: int
    tx_buffers: int
    auto_recovery: bool

    def set_acknowledge(self, acknowledges: bool, /) -> None:
        """Acknowledge frames, or do not."""

    def set_bitrate(self, bitrate: int | None, /) -> None:
        """Work at another bit rate; None = that of the segment."""

    def set_overload_frames(self, count: int, /) -> None:
        """Ask for so many overload frames behind every frame."""

    def set_error_counters(self, *, tec: int | None = None, rec: int | None = None) -> None:
        """Set the error counters."""

    def recover(self) -> None:
        """Begin to recover from bus-off."""


class FrameSegment(Part, Protocol):
    """A CAN segment on which frames can be hit, virtual or live."""

    def add_hook(self, hook: FrameHook, /) -> Undo:
        """Ask a hook about every frame."""

    def inject(self, frame: CanFrame, sender: str = "fault") -> None:
        """Put a frame on the wire."""


class BusSegment(FrameSegment, Protocol):
    """A CAN segment with a bit rate, virtual or live."""

    @property
    def bitrate(self) -> int | None:
        """Bit rate, bit/s; None: not known."""

    def withdraw(self, sender: str, /) -> None:
        """Take back what a foreign node still wants to send."""


class SegmentWithNodes(FrameSegment, Protocol):
    """A CAN segment that knows its nodes by name."""

    @property
    def ports(self) -> Sequence[Part]:
        """Nodes on the segment."""


class VirtualSegment(BusSegment, Protocol):
    """A CAN segment in virtual time, with the seams of the wire."""

    @property
    def bitrate(self) -> int:
        """Bit rate, bit/s."""

    @property
    def ports(self) -> Sequence[CanPort]:
        """Nodes on the segment."""

    def flip_bit(self, nodes: Iterable[str] | None = None, /) -> None:
        """Invert the present bit, for some nodes or all."""

    def hold_level(self, level: int | None, /) -> None:
        """Hold the bus at a level, 0 dominant; None ends it."""

    def cut(self, nodes: Iterable[str], /) -> Undo:
        """Break the cable between these nodes and the others."""

    def injected(self, sender: str, /) -> int:
        """Return how many frames of a foreign node wait."""


class LiveSegment(BusSegment, Protocol):
    """A CAN segment on an adapter."""

    @property
    def sides(self) -> Sequence[Part]:
        """Its adapter, or the two of a bridge."""


class BridgedSegment(BusSegment, Protocol):
    """A live CAN segment that may be a bridge between two adapters."""

    @property
    def sides(self) -> Sequence[Part]:
        """Its adapter, or the two of a bridge."""

    @property
    def bridged(self) -> bool:
        """Whether it is one."""

    def cut(self) -> Undo:
        """Part the two sides."""


class KernelRule(Protocol):
    """A rule that the gateway of the kernel carries out."""

    @property
    def hits(self) -> int | None:
        """Frames changed, known after `withdraw`."""

    def withdraw(self) -> None:
        """End it."""


class KernelGateway(Protocol):
    """The gateway of the kernel between two adapters."""

    def check_free(self, sender: str = "") -> list[str]:
        """Raise `UnsupportedFaultError` if frames of a side are treated already."""

    def treat(self, can_id: int, mask: int, *, sender: str = "", data: bytes | None = None) -> KernelRule:
        """Drop or replace the frames of an identifier."""


class SegmentWithKernelGateway(FrameSegment, Protocol):
    """A live CAN segment whose bridge may be the kernel."""

    @property
    def kernel(self) -> KernelGateway | None:
        """The gateway; None if the bench passes the frames on."""


# -- Modbus ----------------------------------------------------------------------------------------------


class TcpCable(Protocol):
    """A virtual connection."""

    cut: bool


class SerialPort(Protocol):
    """A device on a virtual line."""

    def send(self, data: bytes, /) -> None:
        """Put bytes on the line."""


class SerialWire(Protocol):
    """A virtual line."""

    @property
    def busy(self) -> bool:
        """Whether something is being sent."""

    def attach(self, name: str, listener: SerialListener, /) -> SerialPort:
        """Connect a device."""


class ModbusSegment(Part, Protocol):
    """A network or a serial line."""

    @property
    def kind(self) -> str:
        """`modbus_tcp` or `modbus_rtu`."""

    @property
    def server_names(self) -> tuple[str, ...]:
        """Names of the drives and stations that answer here."""

    def add_hook(self, hook: Callable[[str, bytes, int], Change | None], /) -> Undo:
        """Ask a hook about every transmission."""

    def link(self, name: str | None = None, /) -> object:
        """Return the connection to a drive (`TcpCable`), or the line (`SerialWire`)."""


class ModbusServer(Protocol):
    """The server of a drive or a station."""

    exception_hook: Callable[[int, bytes], int] | None


class ModbusDevice(Protocol):
    """A drive or a station with a Modbus server."""

    @property
    def server(self) -> ModbusServer:
        """Its server."""


# -- telegrams -------------------------------------------------------------------------------------------


class TelegramPort(Part, Protocol):
    """Where the telegrams of a PROFIdrive drive pass: the controller's port to it, or the drive itself."""

    setpoint_seam: Callable[[bytes], bytes | None] | None
    """Filter of what goes to the drive."""
    actual_seam: Callable[[bytes], bytes | None] | None
    """Filter of what comes from it."""

    @property
    def telegram(self) -> Telegram:
        """Layout of both directions."""


class TelegramDevice(Part, Protocol):
    """An emulated device that makes its PROFIdrive telegrams itself."""

    def transmit(self) -> bytes | None:
        """Return the telegram to the controller; None: none is sent."""


# -- I/O stations ----------------------------------------------------------------------------------------


class IoStation(Part, Protocol):
    """An I/O station."""

    def power_off(self) -> None:
        """Switch the supply off."""

    def power_on(self) -> None:
        """Switch it on."""

    def check_channel(self, kind: str, number: int) -> None:
        """Raise `ConfigurationError` if there is no such channel."""

    def hold(self, kind: str, number: int, value: float | None) -> None:
        """Hold a channel at a value; None ends it."""

    def break_wire(self, kind: str, number: int, broken: bool) -> None:
        """Break the wire of a channel, or repair it."""

    def rewire(self, kind: str, pairs: Sequence[tuple[int, int]]) -> None:
        """Exchange the wires of pairs of channels, one pair after the other; none = as built."""

    def disturb(
        self, kind: str, number: int, *, offset: float = 0.0, gain: float = 1.0, noise: float = 0.0
    ) -> None:
        """Falsify an analog channel; without values it is right again."""


# -- controller ------------------------------------------------------------------------------------------


class ControllerState(Protocol):
    """Operating state of a controller."""

    @property
    def value(self) -> str:
        """Its name: `RUN`, `STOP`, `power off`, ..."""


class ExecutionLevels(Protocol):
    """MC_Servo and MC_Interpolator."""

    @property
    def computing_time(self) -> tuple[int, int]:
        """Time of a call of MC_Servo and of MC_Interpolator, ns."""

    def set_computing_time(self, *, servo_ns: int | None = None, interpolator_ns: int | None = None) -> None:
        """Set the time that a call takes, ns."""

    def stall(self, stalled: bool) -> None:
        """Call nothing any more, or continue."""


class ProgrammedController(Protocol):
    """The controller of the bench."""

    @property
    def state(self) -> ControllerState:
        """Its operating state."""

    @property
    def levels(self) -> ExecutionLevels:
        """Its execution levels."""

    def stop(self, reason: str = "by command") -> None:
        """Go to STOP."""

    def run(self) -> None:
        """Go to RUN by a warm restart."""

    def breakpoint(self) -> None:
        """Meet a breakpoint."""

    def power_off(self) -> None:
        """Cut the supply."""

    def power_on(self) -> None:
        """Start again."""


class WritableCam(Protocol):
    """A cam of the controller, as its program writes it."""

    def shift_following_values(self, shift: float) -> None:
        """Add to the following values of all valid points and segments."""

    def interpolate(self) -> object:
        """Start `MC_InterpolateCam`."""


class BenchWithCams(Protocol):
    """A bench whose controller has cams."""

    @property
    def cam_names(self) -> tuple[str, ...]:
        """Their names."""

    def cam(self, name: str) -> WritableCam:
        """Return a cam by its name."""


class LeadingTelegram(Protocol):
    """A leading value on its way to another controller."""

    valid: bool


class LeadingWay(Protocol):
    """The way of leading values from one controller to another."""

    delay_ns: int
    lost: bool
    disturb: Callable[[Any], None] | None


class WithLeadingWay(Protocol):
    """A leading-axis proxy."""

    @property
    def link(self) -> LeadingWay:
        """The way of its telegrams."""


class BenchWithProxies(Protocol):
    """A bench with leading-axis proxies."""

    @property
    def proxy_names(self) -> tuple[str, ...]:
        """Their names."""

    def proxy(self, name: str) -> WithLeadingWay:
        """Return a proxy by its name."""


class DriftingClock(Protocol):
    """The clock of a controller."""

    def drift(self, ppm: float) -> None:
        """Run fast or slow by so many parts per million from now on."""


class BenchWithControllerClocks(Protocol):
    """A bench with more than one controller."""

    @property
    def controller_clocks(self) -> Mapping[str, DriftingClock]:
        """Clocks of the controllers beside that of `[bench]`, by name."""


class GivesLeadingValue(Protocol):
    """A technology object that may lead others."""

    leading_defective: bool


class ControlsPosition(Protocol):
    """An axis whose position control can be opened."""

    @property
    def name(self) -> str:
        """Its name."""

    @property
    def motion(self) -> PositionControlled:
        """Its motion."""


class PositionControlled(Protocol):
    """The motion of an axis."""

    def set_position_control(self, on: bool) -> None:
        """Close or open position control."""

    def replan(self) -> None:
        """Plan the job in control again from the present setpoints."""


class RaisesAlarms(Protocol):
    """The alarms of a technology object."""

    def raise_alarm(self, number: int, *, reaction: int | None = None) -> object:
        """Raise an alarm."""


class KeepsAlarmCauses(Protocol):
    """The alarms of a technology object, with lasting causes."""

    def set_cause(self, number: int, active: bool, *, reaction: int | None = None) -> object:
        """Begin or end the cause of an alarm."""


class AlarmRules(Protocol):
    """Rules of the alarms that a technology object can have."""

    def check(self, number: int, reaction: int | None) -> None:
        """Raise `HilError` for an alarm, or a reaction, that it cannot have."""


class HasAlarmRules(Protocol):
    """Alarms with rules."""

    @property
    def engine(self) -> AlarmRules:
        """Its rules."""


class HasAlarms(Part, Protocol):
    """An axis that raises alarms."""

    @property
    def alarms(self) -> RaisesAlarms:
        """Its alarms."""


# -- what a bench may have -------------------------------------------------------------------------------


class Physical(Protocol):
    """A part that may be hardware."""

    physical: bool


class BenchWithEncoders(Protocol):
    """A bench with encoders that are devices of their own."""

    @property
    def encoder_names(self) -> tuple[str, ...]:
        """Their names."""

    def encoder(self, name: str | None = None, /) -> Part:
        """Return one, or the first one."""


class BenchWithSecondEncoders(Protocol):
    """A bench on which drives may have a second encoder."""

    @property
    def second_encoder_names(self) -> tuple[str, ...]:
        """Their names: `drive1.encoder2`."""


class BenchWithStations(Protocol):
    """A bench with I/O stations."""

    @property
    def station_names(self) -> tuple[str, ...]:
        """Their names."""

    def station(self, name: str | None = None, /) -> IoStation:
        """Return one, or the first one."""


class BenchWithController(Protocol):
    """A bench that is the controller of its axes."""

    @property
    def axis_names(self) -> tuple[str, ...]:
        """Names of the axes."""

    @property
    def controller(self) -> ProgrammedController:
        """The controller."""


class ProgramOfNc(Protocol):
    """An NC whose PLC can be stopped."""

    plc_running: bool
    """Whether the PLC calls its program."""


class BenchWithNcAxes(Protocol):
    """A bench that tells its axes of an NC."""

    @property
    def nc_axis_names(self) -> tuple[str, ...]:
        """Names of the axes."""


class BenchWithNc(Protocol):
    """A bench that is the NC of axes."""

    @property
    def nc(self) -> ProgramOfNc:
        """The NC."""


class BenchWithPorts(Protocol):
    """A bench that shows the ports of its axes."""

    def port(self, drive_name: str | None = None, /) -> Part:
        """Return the port of an axis, by the name of its drive."""


class BenchWithSegments(Protocol):
    """A bench that knows the names of its segments."""

    @property
    def segment_names(self) -> tuple[str, ...]:
        """Their names."""


class BenchWithNodes(Protocol):
    """A bench that knows the nodes on its segments."""

    def nodes_on(self, segment: str, /) -> tuple[str, ...]:
        """Return the names of the nodes on a segment."""


class BenchWithComponents(Protocol):
    """A bench that knows who reports a state."""

    @property
    def component_names(self) -> tuple[str, ...]:
        """Their names."""


class BenchWithAxes(Protocol):
    """A bench that knows the names of its axes."""

    @property
    def axis_names(self) -> tuple[str, ...]:
        """Their names."""


class BenchWithDrives(Protocol):
    """A bench that knows the names of its drives."""

    @property
    def drive_names(self) -> tuple[str, ...]:
        """Their names."""


class BenchWithDrivesOfAxes(Protocol):
    """A bench that knows which drive moves an axis."""

    def drive_of(self, axis_name: str | None = None, /) -> str:
        """Return the name of the drive of an axis."""


class BenchWithVocabulary(Protocol):
    """A bench that knows the texts of its events."""

    @property
    def vocabulary(self) -> Vocabulary:
        """Kinds, sources and texts."""
