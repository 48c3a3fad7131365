"""Faults at the machine of a drive, at its power stage and at its CANopen node, the same for every profile
(C402-311, C402-312).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from emulators.drive.inputs import LIMIT_SWITCHES
from emulators.encoder import EncoderFaults
from fieldbus.clock import seconds_to_ns
from fieldbus.errors import ConfigurationError, UnsupportedFaultError
from fieldbus.node_clock import OwnClock

if TYPE_CHECKING:
    from emulators.drive.core import ServoCore
    from emulators.drive.inputs import DigitalInputs
    from emulators.drive.power_stage import PowerStage
    from emulators.mechanics import AxisMechanics, SwitchModel
    from fieldbus.canopen.slave import CanopenSlave
    from fieldbus.clock import Scheduler, Timer


class TravelFaults(OwnClock):
    """What a test can do to switches, end stops and load of a drive.

    The drive has the attributes named here.
    """

    __slots__ = ()

    if TYPE_CHECKING:
        name: str
        mechanics: Any
        switches: dict[str, SwitchModel]
        digital_inputs: DigitalInputs

    def jam(self, jammed: bool) -> None:
        """Block the shaft, or release it."""
        self.mechanics.jam(jammed)

    def set_load_force(self, force: float) -> None:
        """Set the force (N; Nm on a rotary axis) from outside on the load."""
        self.mechanics.apply_force(force)

    def set_stops(self, lower: float | None, upper: float | None) -> None:
        """Move or remove (None) the end stops, m or rad."""
        self.mechanics.set_stops(lower, upper)

    def force_input(self, name: str, state: bool | None) -> None:
        """Force an input: `negative_limit`, `positive_limit`, `home`, `probe1`, `probe2`; None = the switch
        works again.

        Raises:
            UnsupportedFaultError: The machine has no such switch.

        """
        self._switch(name).forced = state

    def invert_input(self, name: str, inverted: bool) -> None:
        """Set the polarity of a switch.

        Raises:
            UnsupportedFaultError: The machine has no such switch.

        """
        switch = self._switch(name)
        switch.inverted = inverted is not switch.normally_closed

    def swap_limit_switches(self, swapped: bool) -> None:
        """Exchange the wires of the two limit switches, or put them right again.

        Raises:
            UnsupportedFaultError: The machine has not both.

        """
        for name in LIMIT_SWITCHES:
            self._switch(name)
        self.digital_inputs.swap_limits(swapped)

    def _switch(self, name: str) -> SwitchModel:
        switch = self.switches.get(name)
        if switch is None:
            fitted = ", ".join(self.switches) or "none"
            raise UnsupportedFaultError(f"{self.name}: there is no switch {name!r}; fitted: {fitted}")
        return switch


class MachineFaults(TravelFaults, EncoderFaults):
    """What a test can do to motor, encoder, brake, switches and load of a drive.

    The drive has the attributes named here, and slots for `_drift_rest` and `_drift_timer`.
    """

    __slots__ = ()

    if TYPE_CHECKING:
        scheduler: Scheduler
        core: ServoCore
        mechanics: AxisMechanics
        config: Any
        _drift_rest: float
        _drift_timer: Timer | None

    # -- encoder ---------------------------------------------------------------------------------------

    def suppress_index(self, missing: bool) -> None:
        """Let the zero mark of the encoder never come, or come again."""
        self.encoder.zero_mark_present = not missing

    def set_encoder_scale(self, factor: float) -> None:
        """Let the encoder count so many times what the shaft moves; 1 = rightly again."""
        self.encoder.scale(factor)

    def set_encoder_drift(self, increments_per_s: float) -> None:
        """Let the encoder value drift away from the shaft; 0 = no further."""
        cancel(self, "_drift_timer")
        self._drift_rest = 0.0  # type: ignore[misc]  # a slot of the drive
        if not increments_per_s:
            return
        period_ns = self.config.control_period_ns
        step = increments_per_s * period_ns / 1e9

        def drift() -> None:
            self._drift_rest += step  # type: ignore[misc]  # a slot of the drive
            whole = math.trunc(self._drift_rest)
            if whole:
                self._drift_rest -= whole  # type: ignore[misc]  # a slot of the drive
                self.encoder.jump(whole)
            self._drift_timer = self.scheduler.after(period_ns, drift)  # type: ignore[misc]  # a slot of the drive

        drift()

    # -- coupling and guides ---------------------------------------------------------------------------

    def set_added_friction(self, force: float) -> None:
        """Add dry friction at the load, N or Nm; 0 = as new."""
        self.mechanics.set_added_friction(force)

    def slip_coupling(self, revolutions: float) -> None:
        """Let the load slip by so many revolutions of the motor, which itself turns on: its encoder sees
        nothing.
        """
        counts = round(revolutions * self.encoder.counts_per_revolution)
        # Whole increments, so that the encoder sees nothing at all.
        angle = counts * self.encoder.radians_per_increment
        if self.mechanics.slip(angle * self.mechanics.ratio):
            self.encoder.jump(-counts)

    def break_coupling(self, motor_share: float) -> None:
        """Part motor and load for good; see `AxisMechanics.break_coupling`."""
        self.mechanics.break_coupling(motor_share)

    def set_added_backlash(self, backlash: float, growth_s: float = 0.0) -> None:
        """Let the play between motor and load grow by `backlash`, m or rad, within a time; 0 = as it was
        built.
        """
        self.mechanics.set_added_backlash(backlash, growth_s)

    # -- brake -----------------------------------------------------------------------------------------

    def set_brake_stuck(self, closed: bool | None) -> None:
        """Let the brake be stuck closed or open; None = it works again.

        Raises:
            UnsupportedFaultError: There is no brake.

        """
        self._need_brake()
        self.core.brake.set_stuck(closed)

    def set_brake_torque_share(self, share: float) -> None:
        """Let the closed brake hold with this share of its torque; 1 = as new.

        Raises:
            UnsupportedFaultError: There is no brake.

        """
        self._need_brake()
        self.core.brake.set_torque_share(share)

    def _need_brake(self) -> None:
        if not self.core.brake.fitted:
            raise UnsupportedFaultError(f"{self.name}: there is no brake (brake.torque_nm)")


class PowerFaults:
    """What a test can do to the supply and the temperatures of a drive. The drive has the attributes named
    here.
    """

    __slots__ = ()

    if TYPE_CHECKING:

        @property
        def power(self) -> PowerStage:
            """Models of heat and supply."""

        def _link_changed(self) -> None:
            """Evaluate the DC link again."""

    def set_dc_link_voltage(self, voltage_V: float) -> None:
        """Hold the DC link voltage, V; below and above its thresholds the drive reacts (C402-029)."""
        self.power.dc_link.force(voltage_V)
        self._link_changed()

    def restore_dc_link(self) -> None:
        """Let the DC link be what the mains make of it."""
        self.power.dc_link.force(None)
        self._link_changed()

    def disconnect_mains(self, missing: bool) -> None:
        """Take the mains away, or give them back; the DC link lives on its charge and on braking energy."""
        self.power.dc_link.mains_on = not missing
        self._link_changed()

    def set_mains_voltage_share(self, share: float) -> None:
        """Let the mains have this share of their voltage, above 0; 1 = all of it."""
        self.power.dc_link.mains_share = share
        self._link_changed()

    def disconnect_phase(self, missing: bool) -> None:
        """Take one phase of the mains away, or give it back."""
        self.power.dc_link.phase_missing = missing
        self._link_changed()

    def disable_chopper(self, broken: bool) -> None:
        """Let the brake chopper conduct no more, or work again."""
        self.power.dc_link.chopper_failed = broken

    def force_temperature(self, part: str, celsius: float | None) -> None:
        """Let the sensor of `motor` or `power_stage` show a temperature, degC; None = the true one.

        Raises:
            ConfigurationError: There is no such part.

        """
        nodes = {"motor": self.power.motor, "power_stage": self.power.stage}
        if part not in nodes:
            raise ConfigurationError("part", part, ", ".join(nodes))
        nodes[part].forced_C = celsius


class NodeFaults:
    """What a test can do to the CANopen services of a drive.

    The drive has the attributes named here, and slots for `_repeated_emcy` and `_emcy_timer`.
    """

    __slots__ = ()

    if TYPE_CHECKING:
        scheduler: Scheduler
        slave: CanopenSlave
        _repeated_emcy: int
        _emcy_timer: Timer | None

        def power_on(self) -> None:
            """Switch the control supply on."""

        def power_off(self) -> None:
            """Switch everything off at once."""

    def stop_heartbeat(self, stopped: bool) -> None:
        """Keep the heartbeat back, or send it again."""
        self.slave.error_control.silent = stopped

    def delay_heartbeat(self, delay_s: float) -> None:
        """Let every heartbeat come this much later than its period says, s; 0 = in time again."""
        self.slave.error_control.lateness_ns = seconds_to_ns(delay_s)

    def reset_node(self, boot_s: float) -> None:
        """Restart as after a dip of the supply: silence for `boot_s`, then boot-up; the motor coasts."""
        self.power_off()
        self.scheduler.after(seconds_to_ns(boot_s), self.power_on)

    def abort_sdo(self, code: int | None, index: int = 0) -> None:
        """Abort every SDO access (to `index`, 0 = any) with `code`; None = serve it again."""
        self.slave.sdo.refusal = None if code is None else (index, code)

    def suppress_sdo_responses(self, silent: bool) -> None:
        """Leave SDO requests unanswered, or answer again."""
        self.slave.sdo.silent = silent

    def repeat_emcy(self, code: int | None, period_s: float = 0.001) -> None:
        """Send an EMCY every `period_s` without any state change; None = end, with EMCY 0000h."""
        cancel(self, "_emcy_timer")
        if code is None:
            self.slave.emcy_clear(self._repeated_emcy)
            return
        self._repeated_emcy = code  # type: ignore[misc]  # a slot of the drive

        def repeat() -> None:
            self.slave.emcy(code, repeat=True)
            self._emcy_timer = self.scheduler.after(seconds_to_ns(period_s), repeat)  # type: ignore[misc]  # a slot of the drive

        repeat()


def cancel(owner: object, name: str) -> None:
    """Cancel the timer in a slot, if there is one, and forget it."""
    timer: Timer | None = getattr(owner, name, None)
    if timer is not None:
        timer.cancel()
        setattr(owner, name, None)
