"""A PROFIdrive axis by itself with the simplest controller, a telegram per bus cycle with its sign of life:
any configuration of the emulator, without a bench file.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final

from emulators.drive.machine import LinearAxisConfig, SwitchesConfig
from emulators.drive.positioner_config import PositionerSettings
from emulators.drive.profidrive import (
    AxisState,
    DriveParameters,
    DriveSettings,
    ProfidriveConfig,
    ProfidriveDrive,
)
from fieldbus.clock import VirtualScheduler
from fieldbus.history import History
from fieldbus.profidrive.errors import ParameterAccessError
from fieldbus.profidrive.sign_of_life import next_sign
from fieldbus.profidrive.words import STW1
from hil.campaign import CaseContext
from testcases.campaigns.support import equal

OFF: Final = 0x047E
ON: Final = 0x047F
POS_OFF: Final = 0x040E | int(STW1.NO_REJECT_TASK | STW1.NO_INTERMEDIATE_STOP)
POS_ON: Final = POS_OFF | 1
GO: Final = POS_ON | int(STW1.ACTIVATE_TASK)
FULL: Final = {"OVERRIDE": 0x4000, "MDI_ACC": 0x4000, "MDI_DEC": 0x4000}
CYCLE_S: Final = 0.004


class PdAxis:
    """The drive, and what is expected of it.

    Args:
        ctx: The case.
        config: The drive; None: the reference axis with telegram 105.

    """

    def __init__(self, ctx: CaseContext, config: ProfidriveConfig | None = None) -> None:
        self.ctx = ctx
        self.scheduler = VirtualScheduler()
        self.history = History(self.scheduler)
        self.drive = ProfidriveDrive(
            self.scheduler,
            ProfidriveConfig.reference() if config is None else config,
            name="axis",
            history=self.history,
        )
        self.parameters = DriveParameters(self.drive)
        self.sign = 0
        self.signals: dict[str, int] = {}
        self.got: dict[str, int] = {}
        self.drive.power_on()

    def run(self, stw1: int, seconds: float = 0.02, **signals: int) -> dict[str, int]:
        """Send signals from now on, and let time pass; returns the last answer."""
        self.signals.update(signals)
        names = self.drive.telegram.setpoint.names
        for _ in range(max(1, round(seconds / CYCLE_S))):
            values: dict[str, Any] = {name: one for name, one in self.signals.items() if name in names}
            if "STW2" in names:
                self.sign = next_sign(self.sign)
                values["STW2"] = self.sign << 12 | values.get("STW2", 0) & 0xFFF
            self.drive.receive(self.drive.telegram.setpoint.encode({"STW1": stw1, **values}))
            self.drive.cycle()
            self.got = self.drive.telegram.actual.decode(self.drive.transmit())
            self.scheduler.run_for(round(CYCLE_S * 1e9))
        return self.got

    def enable(self) -> None:
        """Bring it into operation."""
        self.run(OFF, 0.16)
        self.run(ON)
        self.equal("in operation", self.drive.state is AxisState.S4, 1)

    @property
    def rpm(self) -> float:
        """Speed of the motor."""
        return float(self.drive.core.speed_rpm)

    @property
    def lu(self) -> float:
        """Place of the machine, um: LU of the reference axis."""
        return float(self.drive.mechanics.position) * 1e6

    def parameter(self, name: str | int, sub_index: int = 0) -> float:
        """Return a parameter."""
        return float(self.parameters.read(name, sub_index))

    def write(self, name: str | int, value: float, sub_index: int = 0) -> int:
        """Write a parameter and return the error number; 0: it was taken."""
        try:
            self.parameters.write(name, value, sub_index)
        except ParameterAccessError as error:
            return int(error.error) or -1
        return 0

    def equal(self, what: str, found: float, wanted: float, *ids: str, within: float = 0.0) -> None:
        """Expect a number."""
        equal(self.ctx, what, found, wanted, *ids, within=within)

    def shows(self, signal: str, mask: int, wanted: int, *ids: str) -> None:
        """Expect bits of a signal now."""
        self.equal(f"{signal} & {mask:04X}h", self.got[signal] & mask, wanted, *ids)


def axis_config(**changes: Any) -> ProfidriveConfig:
    """Return the reference axis without friction, end stops and limit switches."""
    free = LinearAxisConfig(
        coulomb_friction_n=0.0, viscous_friction_n_per_m_s=0.0, negative_stop_mm=None, positive_stop_mm=None
    )
    switches = SwitchesConfig(negative_limit_mm=None, positive_limit_mm=None, input_filter_ms=0.0)
    return replace(ProfidriveConfig.reference(), **{"mechanics": free, "switches": switches, **changes})


class Positioned(PdAxis):
    """A drive with the basic positioner.

    Args:
        ctx: The case.
        telegram: 7, 9, 110 or 111.
        changes: Of the configuration.
        settings: Of the positioner.

    """

    def __init__(
        self,
        ctx: CaseContext,
        telegram: int = 111,
        *,
        changes: dict[str, Any] | None = None,
        **settings: Any,
    ) -> None:
        super().__init__(
            ctx,
            axis_config(
                telegram=telegram,
                settings=DriveSettings(operating_mode=2, ramp_down_s=1.0, quick_stop_s=0.5),
                positioner=PositionerSettings(**settings),
                **(changes or {}),
            ),
        )
        self.signals.update(FULL)
        self.run(POS_OFF)
        self.run(POS_ON)
        self.equal("in operation", self.drive.state is AxisState.S4, 1)

    def go(self, seconds: float, **signals: int) -> dict[str, int]:
        """Give the edge that starts a task."""
        self.run(POS_ON, **signals)
        return self.run(GO, seconds)

    def acknowledge(self) -> None:
        """Acknowledge faults and switch on again."""
        self.run(POS_OFF | int(STW1.ACKNOWLEDGE), 0.04)
        self.run(POS_OFF, 0.04)
        self.run(POS_ON, 0.04)
