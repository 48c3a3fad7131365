"""DC link of a drive: mains rectifier, capacitor, braking energy and brake chopper.

The capacitor is an energy store. Mains keep it at the rectified voltage; the motor takes energy out and,
while it brakes, puts it back. The rectifier lets nothing back into the mains, so that braking raises the
voltage until the chopper burns it. The model is advanced in steps of some milliseconds with closed formulas,
so that it is stable at any step.
"""

from __future__ import annotations

import math

from emulators.drive.supply_config import SupplyConfig


class DcLink:
    """Voltage of the DC link.

    Args:
        config: The supply.

    """

    def __init__(self, config: SupplyConfig | None = None) -> None:
        self.config = SupplyConfig() if config is None else config
        self._capacitance_F = self.config.capacitance_uf * 1e-6
        self._charging_time_s = self.config.charging_time_ms / 1000.0
        self.voltage_V = self.config.nominal_v
        """Present voltage, V."""
        self.mains_on = True
        self.mains_share = 1.0
        """What there is of the voltage of the mains: less than 1 in a brown-out."""
        self.phase_missing = False
        """One phase of the mains is missing: the rectifier charges at half the pace."""
        self.forced_V: float | None = None
        """Voltage held from outside, V; None: the model runs."""
        self.chopper_failed = False
        """The chopper does not conduct any more."""
        self.chopper_load = 0.0
        """Thermal utilisation of the brake resistor, 1 = its continuous power."""
        self.chopper_overloaded = False
        """The resistor got too hot: the chopper is switched off until the utilisation is below 0.8."""
        self.chopper_power_W = 0.0
        """Mean power in the brake resistor in the last step, W."""
        self.chopping = False

    @property
    def mains_V(self) -> float:
        """Voltage to which the mains charge the DC link, V."""
        return self.config.nominal_v * self.mains_share

    @property
    def low(self) -> bool:
        """Whether there is too little voltage."""
        return self.voltage_V < self.config.undervoltage_v

    @property
    def high(self) -> bool:
        """Whether there is too much voltage."""
        return self.voltage_V > self.config.overvoltage_v

    @property
    def settled(self) -> bool:
        """Whether nothing changes as long as the motor takes no power."""
        return (
            self.mains_on
            and self.forced_V is None
            and self.voltage_V == self.mains_V
            and not self.chopper_load
        )

    def restart(self) -> None:
        """Be charged or empty, as after switching on; the brake resistor keeps its heat."""
        self.voltage_V = self._resting_voltage()
        self.chopping = False

    def force(self, voltage_V: float | None) -> None:
        """Hold the voltage at a value, V, or let it go: it is then what the mains make of it."""
        self.forced_V = voltage_V
        self.voltage_V = self._resting_voltage() if voltage_V is None else voltage_V

    def update(self, power_W: float, dt_s: float) -> None:
        """Advance by `dt_s`.

        Args:
            power_W: Mean electrical power of the motor, W; negative while it brakes.
            dt_s: s, > 0.

        """
        config = self.config
        if self.forced_V is not None:
            self._cool(0.0, dt_s)
            return
        voltage = self.voltage_V
        nominal = self.mains_V
        if self.mains_on and voltage <= nominal and power_W >= 0.0:
            # Under load the rectifier lags behind; at rest it ends exactly at its voltage.
            charging = self._charging_time_s * (2.0 if self.phase_missing else 1.0)
            target = max(nominal - power_W * charging / (self._capacitance_F * nominal), 0.0)
            voltage = target + (voltage - target) * math.exp(-dt_s / charging)
            if abs(voltage - target) < 1e-3:
                voltage = target
        else:
            energy = 0.5 * self._capacitance_F * voltage * voltage - (power_W + config.standby_w) * dt_s
            voltage = math.sqrt(max(2.0 * energy / self._capacitance_F, 0.0))
            if self.mains_on and voltage < nominal:
                voltage = nominal
        burnt = 0.0
        if voltage >= config.chopper_on_v:
            self.chopping = True
        if self.chopping:
            if self.chopper_failed or self.chopper_overloaded or voltage <= config.chopper_off_v:
                self.chopping = False
            else:
                after = voltage * math.exp(-dt_s / (config.chopper_ohm * self._capacitance_F))
                if after <= config.chopper_off_v:
                    after = config.chopper_off_v
                    self.chopping = False
                burnt = 0.5 * self._capacitance_F * (voltage * voltage - after * after) / dt_s
                voltage = after
        self.voltage_V = voltage
        self._cool(burnt, dt_s)

    def _cool(self, burnt: float, dt_s: float) -> None:
        config = self.config
        self.chopper_power_W = burnt
        if not burnt and not self.chopper_load:
            return
        load = burnt / config.chopper_rated_w
        utilisation = load + (self.chopper_load - load) * math.exp(-dt_s / config.chopper_time_constant_s)
        self.chopper_load = utilisation if utilisation > 1e-6 else 0.0
        if utilisation > 1.0:
            self.chopper_overloaded = True
        elif utilisation < 0.8:
            self.chopper_overloaded = False

    def _resting_voltage(self) -> float:
        return self.mains_V if self.mains_on else 0.0
