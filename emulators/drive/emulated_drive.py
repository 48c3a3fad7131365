"""What every emulated drive has: a name, a machine, perhaps a motor with encoder and brake, perhaps a supply.

The methods are what a test can do to these parts, the same for every profile (C402-311, C402-312).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Protocol

from emulators.drive.drive_train import DriveTrain
from emulators.drive.inputs import LIMIT_SWITCHES, DigitalInputs
from emulators.drive.power_stage import PowerStage
from emulators.mechanics import SwitchModel
from emulators.repetition import Repetition
from fieldbus.clock import Scheduler
from fieldbus.errors import ConfigurationError, UnsupportedFaultError
from fieldbus.history import History, Scalar
from fieldbus.node_clock import own_clock


class Travel(Protocol):
    """The part of a machine that every drive moves, whatever its motor."""

    def jam(self, jammed: bool) -> None:
        """Block the shaft, or release it."""

    def apply_force(self, force: float) -> None:
        """Set the force from outside on the load, N or Nm."""

    def set_stops(self, lower: float | None, upper: float | None) -> None:
        """Place or remove (None) the end stops, m or rad."""


def _fault_text(data: Mapping[str, Scalar]) -> str:
    """Return a fault event in words: its text has the number, or the number stands alone."""
    code, number = data.get("code"), data.get("number")
    name = f"fault {code:04X}h" if isinstance(code, int) else f"fault {number}"
    return f"{name}: {data['text']}" if data.get("text") else name


class EmulatedDrive:
    """A drive with a machine that has switches and end stops.

    Args:
        scheduler: Clock of the drive.
        name: Name in the history and in messages.
        history: Event log; None for none.
        travel: Machine.
        switches: Switches on the travel, by input name.
        digital_inputs: Inputs that the switches are wired to.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        *,
        name: str,
        history: History | None,
        travel: Travel,
        switches: Mapping[str, SwitchModel],
        digital_inputs: DigitalInputs,
    ) -> None:
        self.scheduler = scheduler
        self.name = name
        self._history = history
        self._travel = travel
        self.switches = switches
        self.digital_inputs = digital_inputs

    @property
    def now_ns(self) -> int:
        """Present time of the drive's clock, ns."""
        return self.scheduler.now

    @property
    def inputs(self) -> int:
        """Digital inputs as in 60FDh: bit 0 negative limit switch, 1 positive limit switch, 2 home switch, 3
        interlock closed, 16 probe 1, 17 probe 2; 1 = actuated.
        """
        return self.digital_inputs.value

    def emit(self, kind: str, **data: str | float | bool) -> None:
        """Write an event of this drive into the log, if there is one."""
        if self._history is not None:
            self._history.emit(self.name, kind, **data)

    def __repr__(self) -> str:
        state, faults = "", list[str]()
        for entry in self._history.events if self._history is not None else ():
            if entry.source != self.name:
                continue
            if entry.kind == "drive.state":
                state = f" {entry.data.get('to')}"
            elif entry.kind == "drive.fault":
                faults.append(_fault_text(entry.data))
            elif entry.kind == "drive.fault_cleared":
                faults.clear()
        text = f", {', '.join(faults)}" if faults else ""
        return f"<{type(self).__name__} {self.name}{state}{text} ({self.now_ns * 1e-9:.3f} s)>"

    # -- machine -----------------------------------------------------------------------------------------

    def jam(self, jammed: bool) -> None:
        """Block the shaft, or release it."""
        self._travel.jam(jammed)

    def set_load_force(self, force: float) -> None:
        """Set the external force on the load, N (Nm on a rotary axis)."""
        self._travel.apply_force(force)

    def set_stops(self, lower: float | None, upper: float | None) -> None:
        """Move or remove (None) the end stops, m or rad."""
        self._travel.set_stops(lower, upper)

    # -- switches ----------------------------------------------------------------------------------------

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
        """Exchange the wires of the two limit switches, or restore them.

        Raises:
            UnsupportedFaultError: The machine does not have both.

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

    # -- clock -------------------------------------------------------------------------------------------

    def set_clock_drift(self, ppm: float) -> None:
        """Let the clock of the drive run fast (positive) or slow, ppm; 0 = at the pace of the bench.

        Raises:
            UnsupportedFaultError: The drive has no clock of its own.

        """
        own_clock(self.scheduler, self.name).drift(ppm)

    def set_clock_jitter(self, longest_ns: int) -> None:
        """Let the cycles of the drive begin late by up to so many ns; 0 = on time again.

        Raises:
            UnsupportedFaultError: The drive has no clock of its own.

        """
        own_clock(self.scheduler, self.name).jitter(longest_ns)


class ServoDrive(EmulatedDrive):
    """A drive with a servo motor, its encoder and its brake.

    Args:
        scheduler: Clock of the drive.
        name: Name in the history and in messages.
        history: Event log; None for none.
        train: Motor, machine and servo core.
        control_period_ns: Control period, ns; an encoder drift advances once per period.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        *,
        name: str,
        history: History | None,
        train: DriveTrain,
        control_period_ns: int,
    ) -> None:
        super().__init__(
            scheduler,
            name=name,
            history=history,
            travel=train.mechanics,
            switches=train.switches,
            digital_inputs=train.digital_inputs,
        )
        self.train = train
        self.core = train.core
        self.encoder = train.encoder
        self.mechanics = train.mechanics
        self._control_period_ns = control_period_ns
        self._drift = Repetition(scheduler)
        self._drift_rest = 0.0

    # -- encoder -----------------------------------------------------------------------------------------

    def freeze_encoder(self, frozen: bool) -> None:
        """Let the encoder value stand still, or follow the shaft again."""
        self.encoder.freeze(frozen)

    def jump_encoder(self, increments: int) -> None:
        """Shift the encoder value by increments, as a slipped coupling does."""
        self.encoder.jump(increments)

    def set_encoder_noise(self, increments: int) -> None:
        """Disturb the encoder value by -increments..+increments; 0 = off."""
        self.encoder.set_noise(increments)

    def reverse_encoder(self, reversed_direction: bool) -> None:
        """Count in the opposite direction from the present position on; a control loop on it runs away."""
        self.encoder.reverse(reversed_direction)

    def lose_encoder_steps(self, every: int) -> None:
        """Miss one of `every` increments of the motion; 0 = none from now on."""
        self.encoder.lose_steps(every)

    def suppress_index(self, missing: bool) -> None:
        """Suppress the zero mark of the encoder, or show it again."""
        self.encoder.zero_mark_present = not missing

    def set_encoder_scale(self, factor: float) -> None:
        """Let the encoder count `factor` times the motion of the shaft; 1 = correct again."""
        self.encoder.scale(factor)

    def set_encoder_drift(self, increments_per_s: float) -> None:
        """Let the encoder value drift away from the shaft; 0 = no further."""
        self._drift.stop()
        self._drift_rest = 0.0
        if not increments_per_s:
            return
        step = increments_per_s * self._control_period_ns / 1e9

        def drift() -> None:
            self._drift_rest += step
            whole = math.trunc(self._drift_rest)
            if whole:
                self._drift_rest -= whole
                self.encoder.jump(whole)

        self._drift.start(self._control_period_ns, drift)

    # -- coupling and guides -----------------------------------------------------------------------------

    def set_added_friction(self, force: float) -> None:
        """Add dry friction at the load, N or Nm; 0 = as built."""
        self.mechanics.set_added_friction(force)

    def slip_coupling(self, revolutions: float) -> None:
        """Let the load slip by so many revolutions of the motor; the motor encoder does not notice."""
        counts = round(revolutions * self.encoder.counts_per_revolution)
        # Whole increments, so that the encoder sees nothing at all.
        angle = counts * self.encoder.radians_per_increment
        if self.mechanics.slip(angle * self.mechanics.ratio):
            self.encoder.jump(-counts)

    def break_coupling(self, motor_share: float) -> None:
        """Separate motor and load for good; see `AxisMechanics.break_coupling`."""
        self.mechanics.break_coupling(motor_share)

    def set_added_backlash(self, backlash: float, growth_s: float = 0.0) -> None:
        """Let the play between motor and load grow by `backlash`, m or rad, within a time, s."""
        self.mechanics.set_added_backlash(backlash, growth_s)

    # -- brake -------------------------------------------------------------------------------------------

    def set_brake_stuck(self, closed: bool | None) -> None:
        """Let the brake stick closed or open; None = it works again.

        Raises:
            UnsupportedFaultError: There is no brake.

        """
        self._need_brake()
        self.core.brake.set_stuck(closed)

    def set_brake_torque_share(self, share: float) -> None:
        """Let the closed brake hold with this share of its torque; 1 = as built.

        Raises:
            UnsupportedFaultError: There is no brake.

        """
        self._need_brake()
        self.core.brake.set_torque_share(share)

    def _need_brake(self) -> None:
        if not self.core.brake.fitted:
            raise UnsupportedFaultError(f"{self.name}: there is no brake (brake.torque_nm)")


class MainsDrive(ServoDrive):
    """A servo drive whose power stage is fed from the mains.

    A profile checks the DC link in `check_dc_link`.

    Args:
        scheduler: Clock of the drive.
        name: Name in the history and in messages.
        history: Event log; None for none.
        train: Motor, machine and servo core.
        power: Power stage.
        control_period_ns: Control period, ns.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        *,
        name: str,
        history: History | None,
        train: DriveTrain,
        power: PowerStage,
        control_period_ns: int,
    ) -> None:
        super().__init__(
            scheduler, name=name, history=history, train=train, control_period_ns=control_period_ns
        )
        self.power = power
        """Models of heat and supply."""

    def check_dc_link(self) -> None:
        """React to a change of the DC link or of the mains at once."""
        raise NotImplementedError

    def set_dc_link_voltage(self, voltage_V: float) -> None:
        """Hold the DC link voltage, V; below and above its thresholds the drive reacts (C402-029)."""
        self.power.dc_link.force(voltage_V)
        self.check_dc_link()

    def restore_dc_link(self) -> None:
        """Let the DC link follow the mains again."""
        self.power.dc_link.force(None)
        self.check_dc_link()

    def disconnect_mains(self, missing: bool) -> None:
        """Switch the mains off, or on; the DC link lives on its charge and on braking energy."""
        self.power.dc_link.mains_on = not missing
        self.check_dc_link()

    def set_mains_voltage_share(self, share: float) -> None:
        """Let the mains have this share of their voltage, above 0; 1 = all of it."""
        self.power.dc_link.mains_share = share
        self.check_dc_link()

    def disconnect_phase(self, missing: bool) -> None:
        """Take one phase of the mains away, or give it back."""
        self.power.dc_link.phase_missing = missing
        self.check_dc_link()

    def disable_chopper(self, broken: bool) -> None:
        """Let the brake chopper fail, or work again."""
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
