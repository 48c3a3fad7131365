"""A drive with an analog setpoint, terminal by terminal: scaling, enable, ready output in each form, its own
stop, faults, supply.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from math import pi
from typing import Any, Final

from emulators.drive.analog import AnalogDrive, AnalogState
from emulators.drive.analog_config import AnalogConfig, AnalogSettings
from emulators.drive.machine import NO_SWITCHES, BrakeConfig, LinearAxisConfig, SwitchesConfig
from hil.campaign import Campaign, CaseContext
from testcases.campaigns.support import equal

CAMPAIGN: Final = Campaign(
    "analog drive", controller="", tags=("drive",), bench="testcases.campaigns.can_bus:BENCH"
)
STANDBY, OPERATION, STOPPING, FAULT = (
    AnalogState.STANDBY,
    AnalogState.OPERATION,
    AnalogState.STOPPING,
    AnalogState.FAULT,
)
TOP: Final = 3000.0
"""Speed at 10 V, rpm."""
RAMP_S: Final = 0.4


class Wired:
    """A drive whose terminals the case has in its hands.

    Args:
        ctx: The case.
        options: Of the drive, those of its table `analog` among them.

    """

    def __init__(self, ctx: CaseContext, **options: Any) -> None:
        self.ctx = ctx
        segment: Any = ctx.bench.segment("can0")
        own = {one.name for one in fields(AnalogSettings)} & options.keys()
        settings = AnalogSettings(**{key: options.pop(key) for key in own})
        machine: dict[str, Any] = {
            "coulomb_friction_n": 0.0,
            "viscous_friction_n_per_m_s": 0.0,
            "negative_stop_mm": None,
            "positive_stop_mm": None,
        }
        defaults = {"switches": NO_SWITCHES, "mechanics": LinearAxisConfig(**machine), "off3_ramp_s": RAMP_S}
        config = AnalogConfig(analog=settings, **{**defaults, **options})
        self.drive = AnalogDrive(segment.scheduler, config, name="analog")
        self.ready: list[tuple[float, bool]] = []
        self.drive.on_ready.append(lambda level: self.ready.append((ctx.now_s, level)))
        self.drive.power_on()

    @property
    def rpm(self) -> float:
        """Speed of the motor."""
        return float(self.drive.mechanics.motor_speed) * 30.0 / pi

    def start(self, volts: float, seconds: float = 0.3) -> None:
        """Enable it with a voltage."""
        self.drive.set_enable(True)
        self.drive.set_voltage(volts)
        self.ctx.run_for(seconds)

    def turns(self, rpm: float, *ids: str, within: float = 0.5) -> None:
        """Expect a speed."""
        equal(self.ctx, "speed", self.rpm, rpm, *ids, within=within)

    def is_in(self, state: AnalogState, *ids: str) -> None:
        """Expect a state."""
        found = self.drive.state
        equal(self.ctx, f"state is {state.name} (it is {found.name})", found is state, 1, *ids)


@CAMPAIGN.case("scaling", requirements=("CFG-395", "CFG-396", "STP-539"))
def scaling(ctx: CaseContext) -> None:
    """10 V is the reference speed, 117 % count at most, and the maximum speed of the drive; offset, dead
    zone, polarity and a characteristic change it.
    """
    rig = Wired(ctx, max_speed_rpm=4000.0)
    for volts, rpm in (
        (5.0, 1500.0),
        (-10.0, -3000.0),
        (11.7, 3510.0),
        (13.0, 3510.0),
        (-13.0, -3510.0),
        (0.0, 0.0),
    ):
        rig.start(volts, 1.2)
        rig.turns(rpm, "CFG-395")
    rig = Wired(ctx, max_speed_rpm=3000.0)
    rig.start(11.7, 1.2)
    rig.turns(3000.0, "CFG-396")
    for options, volts, rpm in (
        ({"offset_v": 0.05}, 0.0, 15.0),
        ({"offset_v": -0.2}, 1.0, 240.0),
        ({"offset_v": 0.05, "dead_zone_v": 0.1}, 0.0, 0.0),
        ({"dead_zone_v": 0.1}, -0.09, 0.0),
        ({"inverted": True}, 5.0, -1500.0),
        ({"reference_speed_rpm": 1000.0}, 5.0, 500.0),
    ):
        rig = Wired(ctx, **options)
        rig.start(volts, 0.8)
        rig.turns(rpm, "CFG-395")


@CAMPAIGN.case("ready", requirements=("CFG-389", "STP-539"))
def ready(ctx: CaseContext) -> None:
    """Ready comes with its delay after the enable, and no motion before it; it falls with the enable, at
    standstill, or never.
    """
    for delay_ms in (0.0, 50.0):
        rig = Wired(ctx, ready_delay_ms=delay_ms)
        rig.drive.set_voltage(5.0)
        ctx.run_for(0.1)
        rig.turns(0.0, "CFG-389")
        begun = ctx.now_s
        rig.drive.set_enable(True)
        ctx.run_for(0.045)
        equal(ctx, "ready", rig.drive.ready, delay_ms == 0.0, "STP-539")
        if delay_ms:
            rig.turns(0.0, "STP-539")
        ctx.run_for(0.3)
        equal(ctx, "delay, s", rig.ready[0][0] - begun, delay_ms / 1000.0, "STP-539", within=1e-6)
        rig.turns(1500.0, "STP-539")
    for stop in ("ramp", "coast"):
        for falls in ("enable", "standstill", "never"):
            rig = Wired(ctx, stop=stop, ready_falls=falls)
            rig.start(3.0)
            rig.drive.set_enable(False)
            ctx.run_for(0.05)
            equal(ctx, f"ready with {falls}, {stop}", rig.drive.ready, falls != "enable", "STP-539")
            ctx.run_for(0.5)
            if stop == "ramp":
                equal(ctx, "ready at standstill", rig.drive.ready, falls == "never", "STP-539")


@CAMPAIGN.case("stops", requirements=("STP-322", "STP-540"))
def stops(ctx: CaseContext) -> None:
    """Without the enable it brakes on its ramp, whatever the voltage says, or coasts; the enable in between
    goes on from there.
    """
    for volts in (6.0, -9.0):
        rig = Wired(ctx)
        rig.start(volts)
        before = rig.rpm
        rig.drive.set_enable(False)
        rig.is_in(STOPPING, "STP-540")
        rig.drive.set_voltage(-volts)
        ctx.run_for(0.1)
        left = abs(volts) / 10 * TOP - TOP / RAMP_S * 0.1
        rig.turns(left if volts > 0 else -left, "STP-540", within=TOP / RAMP_S * 0.006)
        ctx.run_for(abs(before) / TOP * RAMP_S - 0.1 + 0.03)
        rig.is_in(STANDBY, "STP-540")
        rig.turns(0.0, "STP-322")
        equal(ctx, "torque", rig.drive.core.torque, 0.0, "STP-540")
    rig = Wired(ctx, stop="coast")
    rig.start(6.0)
    rig.drive.set_enable(False)
    rig.is_in(STANDBY, "STP-540")
    ctx.run_for(0.2)
    rig.turns(1800.0, "STP-540", within=5.0)
    equal(ctx, "torque", rig.drive.core.torque, 0.0, "STP-540")
    rig = Wired(ctx)
    rig.start(6.0)
    rig.drive.set_enable(False)
    ctx.run_for(0.1)
    equal(ctx, "speed in between", 500.0 < rig.rpm < 1500.0, 1, "STP-540")
    rig.drive.set_enable(True)
    rig.is_in(OPERATION, "STP-540")
    ctx.run_for(0.3)
    rig.turns(1800.0, "STP-540")
    rig = Wired(ctx)
    rig.start(6.0)
    rig.drive.scale_ramps(0.5)
    rig.drive.set_enable(False)
    ctx.run_for(0.1)
    rig.turns(1800.0 - TOP / RAMP_S * 0.05, within=TOP / RAMP_S * 0.006)


@CAMPAIGN.case("always-on", requirements=("CFG-388", "STP-062"))
def always_on(ctx: CaseContext) -> None:
    """Without an enable input it follows the voltage as long as it has its supply."""
    rig = Wired(ctx, enable_input=False)
    rig.drive.set_voltage(6.0)
    ctx.run_for(0.3)
    rig.turns(1800.0, "CFG-388")
    rig.drive.set_enable(True)
    rig.drive.set_enable(False)
    ctx.run_for(0.1)
    rig.turns(1800.0, "CFG-388")
    rig.drive.power_off()
    ctx.run_for(0.01)
    equal(ctx, "torque, ready", rig.drive.core.torque + rig.drive.ready, 0.0, "STP-062")


@CAMPAIGN.case("faults", requirements=("STP-539",))
def faults(ctx: CaseContext) -> None:
    """A trip takes torque and ready until its cause is gone and the enable has been away; so do safe torque
    off, the supply and the encoder. A forced ready moves nothing.
    """
    rig = Wired(ctx)
    rig.start(6.0)
    for level in (False, None):
        rig.drive.force_ready(level)
        ctx.run_for(0.05)
        equal(ctx, "ready", rig.drive.ready, level is None, "STP-539")
        rig.turns(1800.0, "STP-539")
    rig.drive.raise_fault(0x2310, persistent=True)
    rig.is_in(FAULT)
    equal(ctx, "number", rig.drive.fault_number, 0x2310)
    equal(ctx, "ready", rig.drive.ready, 0, "STP-539")
    ctx.run_for(0.01)
    equal(ctx, "torque", rig.drive.core.torque, 0.0)
    steps: tuple[tuple[Callable[[], object], AnalogState], ...] = (
        (lambda: rig.drive.set_enable(False), FAULT),
        (lambda: rig.drive.set_enable(True), FAULT),
        (rig.drive.clear_fault_cause, FAULT),
        (lambda: rig.drive.set_enable(False), STANDBY),
        (lambda: rig.drive.set_enable(True), OPERATION),
    )
    for act, state in steps:
        act()
        rig.is_in(state)
    equal(ctx, "number", rig.drive.fault_number, 0)
    rig.drive.raise_fault(0x4310)
    rig.is_in(FAULT)
    rig.drive.set_enable(False)
    rig.is_in(STANDBY)
    pairs: tuple[tuple[Callable[[], object], Callable[[], object]], ...] = (
        (lambda: rig.drive.set_sto(True), lambda: rig.drive.set_sto(False)),
        (rig.drive.power_off, rig.drive.power_on),
    )
    for off, on in pairs:
        rig.drive.set_enable(False)
        rig.start(6.0)
        off()
        ctx.run_for(0.01)
        equal(ctx, "torque, ready", rig.drive.core.torque + rig.drive.ready, 0.0)
        on()
        ctx.run_for(0.1)
        rig.is_in(STANDBY)
        rig.drive.set_enable(False)
        rig.drive.set_enable(True)
        rig.is_in(OPERATION)
    rig.drive.break_encoder_wire(True)
    rig.is_in(FAULT)
    rig.drive.break_encoder_wire(False)
    rig.drive.set_enable(False)
    rig.is_in(STANDBY)


@CAMPAIGN.case("machine")
def machine(ctx: CaseContext) -> None:
    """Switches are told when they are passed, the brake closes without torque, a limit of the torque slows
    the axis.
    """
    switches = SwitchesConfig(
        negative_limit_mm=None, positive_limit_mm=50.0, home_mm=None, hysteresis_mm=0.0, input_filter_ms=0.0
    )
    rig = Wired(ctx, switches=switches, brake=BrakeConfig(torque_nm=3.0))
    seen: list[int] = []
    places: list[float] = []

    def note(inputs: int) -> None:
        seen.append(inputs)
        places.append(rig.drive.mechanics.position * 1000.0)

    rig.drive.on_inputs.append(note)
    closed = rig.drive.trace_columns.index(("brake_closed", ""))
    equal(ctx, "brake is closed", rig.drive.trace_row()[closed], 1)
    rig.start(5.0, 0.1)
    equal(ctx, "brake is closed", rig.drive.trace_row()[closed], 0)
    ctx.wait_until(lambda: seen, 2.0, "the switch is passed")
    equal(ctx, f"inputs {seen}", seen == [2], 1)
    equal(ctx, "place, mm", places[0], 50.0, within=0.3)
    rig.drive.set_voltage(-5.0)
    ctx.wait_until(lambda: len(seen) > 1, 2.0, "the switch is left")
    equal(ctx, f"inputs {seen}", seen == [2, 0], 1)
    rig.drive.set_enable(False)
    ctx.run_for(RAMP_S)
    equal(ctx, "brake is closed", rig.drive.trace_row()[closed], 1)
    for share, slower in ((0.05, True), (None, False)):
        rig = Wired(ctx)
        rig.drive.limit_torque(share)
        rig.start(10.0, 0.05)
        equal(ctx, "acceleration is limited", rig.rpm < 0.2 * TOP, slower)
