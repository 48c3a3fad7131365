"""A PROFIdrive axis with the simplest controller: one telegram per bus cycle, with the sign of life."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from emulators.drive.profidrive import AxisState, ProfidriveConfig, ProfidriveDrive
from fieldbus.clock import MS, VirtualScheduler
from fieldbus.history import History
from fieldbus.profidrive import to_n4
from fieldbus.profidrive.sign_of_life import next_sign

READY = 0x047E
RUN = 0x047F
SYNCHRONISED = 40
"""Cycles after which the sign of life is synchronous in both directions."""


class Rig:
    """The drive, and `cycle` that plays the controller for a bus cycle."""

    def __init__(self, config: ProfidriveConfig | None = None, *, power: bool = True) -> None:
        self.scheduler = VirtualScheduler()
        self.history = History(self.scheduler)
        config = ProfidriveConfig.reference() if config is None else config
        # Tests of speed turn for long: the travel has no ends.
        self.config = replace(
            config, mechanics=replace(config.mechanics, negative_stop_mm=None, positive_stop_mm=None)
        )
        self.drive = ProfidriveDrive(self.scheduler, self.config, name="drive", history=self.history)
        self.sign = 0
        self.sends_sign = True
        self.actual: dict[str, int] = {}
        if power:
            self.drive.power_on()

    def cycle(self, stw1: int, *, count: int = 1, **signals: int) -> dict[str, int]:
        """Send a telegram in each of `count` bus cycles; returns the last answer."""
        names = self.drive.telegram.setpoint.names
        for _ in range(count):
            values: dict[str, Any] = dict(signals)
            if "STW2" in names:
                if self.sends_sign:
                    self.sign = next_sign(self.sign)
                values["STW2"] = self.sign << 12 | values.get("STW2", 0)
            if "M_LIMIT_POS" in names:
                values = {"M_LIMIT_POS": 0x7FFF, "M_LIMIT_NEG": -0x8000, **values}
            self.drive.receive(self.drive.telegram.setpoint.encode({"STW1": stw1, **values}))
            self.drive.cycle()
            self.actual = self.drive.telegram.actual.decode(self.drive.transmit())
            self.scheduler.run_for(self.config.cycle_ns)
        return self.actual

    def speed(self, rpm: float) -> dict[str, int]:
        """Return the setpoint signal for a speed."""
        share = rpm / self.drive.settings.reference_speed_rpm
        if "NSOLL_B" in self.drive.telegram.setpoint.names:
            return {"NSOLL_B": to_n4(share)}
        return {"NSOLL_A": to_n4(share) >> 16}

    def enable(self) -> None:
        """Bring the drive into operation."""
        self.cycle(READY, count=SYNCHRONISED)
        self.cycle(RUN, count=3)
        assert self.drive.state is AxisState.S4

    def turn(self, rpm: float) -> None:
        """Turn at a speed, after the ramp if there is one."""
        self.enable()
        self.cycle(RUN, count=400, **self.speed(rpm))
        assert abs(self.drive.core.speed_rpm - rpm) < 0.5

    def time_until(self, stw1: int, *states: AxisState, timeout_ms: int = 5000, **signals: int) -> float:
        """Send a control word until a state is reached; returns the time, s."""
        started = self.scheduler.now
        while self.drive.state not in states:
            assert self.scheduler.now - started < timeout_ms * MS, self.drive.state
            self.cycle(stw1, **signals)
        return (self.scheduler.now - started) / 1e9
