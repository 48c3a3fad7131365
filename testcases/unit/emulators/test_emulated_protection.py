"""Monitors of the drive: windows with a time, motor temperature, DC link."""

from __future__ import annotations

import pytest

from emulators.drive import DcLink, SupplyConfig, ThermalModel, WindowTimer
from fieldbus.errors import ConfigurationError


def test_window_timer_needs_the_whole_time():
    """The condition has to hold without a break for the time."""
    timer = WindowTimer(0.005)
    results = [timer.update(True, 0.001) for _ in range(7)]
    assert results == [False] * 5 + [True] * 2
    assert not timer.update(False, 0.001)
    assert not timer.update(True, 0.001)
    assert WindowTimer().update(True, 0.001)


def test_thermal_model_bears_rated_torque_and_trips_on_overload():
    """Rated torque runs for ever; three times rated torque trips after -T ln(1 - trip/9)."""
    model = ThermalModel(rated_torque_Nm=2.0, time_constant_s=10.0)
    assert not any(model.update(2.0, 0.001) for _ in range(100_000))
    model.utilisation = 0.0
    steps = 0
    while not model.update(-6.0, 0.001):
        steps += 1
    assert steps * 0.001 == pytest.approx(1.2397, rel=1e-2)


def test_dc_link_thresholds():
    """Voltages below and above the thresholds are different faults."""
    link = DcLink()
    assert (link.low, link.high) == (False, False)
    link.voltage_V = 100.0
    assert link.low
    link.voltage_V = 900.0
    assert link.high


def test_impossible_values_are_refused():
    """Torque, time and thresholds are checked."""
    with pytest.raises(ConfigurationError):
        ThermalModel(rated_torque_Nm=0.0)
    with pytest.raises(ConfigurationError):
        ThermalModel(rated_torque_Nm=1.0, time_constant_s=0.0)
    with pytest.raises(ConfigurationError):
        SupplyConfig(undervoltage_v=600.0)
