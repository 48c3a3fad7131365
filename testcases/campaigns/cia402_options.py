"""What a CiA 402 drive can be configured to do: limit switches, safety inputs, times of switching on and of
the brake, jitter of SYNC, slippage; ways on rotary axes, relative targets, limits, feed-forwards; in every
mode.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final

from emulators.drive.cia402 import DriveConfig
from emulators.drive.machine import BrakeConfig, LinearAxisConfig, SafetyConfig, SwitchesConfig
from hil.campaign import Campaign, CaseContext
from testcases.campaigns._servo_rig import REV, Servo
from testcases.campaigns.support import equal

CAMPAIGN: Final = Campaign(
    "cia402 options", controller="", tags=("drive", "cia402"), bench="testcases.campaigns.can_bus:BENCH"
)
RANGE, STATE, CROSSED = 0x06090030, 0x08000022, 0x06090036
SLOPES: Final = {
    0x6083: 60_000_000,
    0x6084: 20_000_000,
    0x6085: 40_000_000,
    0x6081: 1_200_000,
    (0x6048, 1): 60_000,
    (0x6049, 1): 20_000,
    (0x604A, 1): 40_000,
}
"""Slopes of speeding up, slowing down and the quick stop, 10^-3 rpm/s; of vl in rpm/s."""
UP, DOWN, QUICK = 60_000, 20_000, 40_000
SPEED: Final = 900


def _config(**fields: Any) -> DriveConfig:
    free = LinearAxisConfig(coulomb_friction_n=0.0, viscous_friction_n_per_m_s=0.0)
    switches = SwitchesConfig(negative_limit_mm=-40.0, positive_limit_mm=40.0, input_filter_ms=0.0)
    made = DriveConfig.reference()
    return replace(made, mechanics=free, switches=switches, **fields)


def turning(rig: Servo, mode: int, rpm: int) -> None:
    """Let the drive turn with a speed in a mode."""
    rig.enable(mode, 0x7F if mode == 2 else 0x0F)
    if mode == 1:
        rig.configure({0x6081: abs(rpm) * 1000, 0x607A: 400 * REV if rpm > 0 else -400 * REV})
        rig.control(0x1F)
    elif mode == 2:
        rig.write(0x6042, rpm)
    elif mode in (3, 9):
        rig.write(0x60FF, rpm * 1000)
    rig.run(abs(rpm) / UP + 0.02)
    rig.equal(f"speed in mode {mode}, rpm", rig.rpm, rpm, within=2.0)


# -- limit switches -----------------------------------------------------------------------------------------


@CAMPAIGN.product(
    "limit-switch/{mode}",
    parameters={"mode": (1, 2, 3)},
    title="a limit switch in mode {mode}",
    requirements=("C402-161",),
)
def limit_switch(ctx: CaseContext, mode: int) -> None:
    """It stops with 6085h, shows bit 11 and stays in operation; out of it there is a way, into it none. Or it
    is a fault, or nothing.
    """
    for sign in (1, -1):
        rig = Servo(ctx, _config(), SLOPES)
        turning(rig, mode, sign * SPEED)
        bit = 2 if sign > 0 else 1
        waited = 0.0
        while not rig.read(0x60FD) & bit and waited < 2.0:
            rig.run(0.001)
            waited += 0.001
        rig.equal("the switch is met", rig.read(0x60FD) & 3, bit)
        rig.run(0.004)
        begun = rig.rpm
        rig.run(0.005)
        rig.equal("slope, rpm/s", (begun - rig.rpm) / 0.005 * sign, QUICK, "C402-161", within=0.03 * QUICK)
        rig.bits(0x6F, 0x27, "C402-161")
        rig.run(SPEED / QUICK)
        rig.equal("it stands, rpm", rig.rpm, 0.0, "C402-161", within=2.0)
        rig.bits(0x800, 0x800, "C402-161")
        place = rig.turns
        # Further into the switch it does not go, out of it it does.
        _again(rig, mode, sign * 300)
        rig.equal("no way into the switch", rig.turns, place, "C402-161", within=0.01)
        _again(rig, mode, -sign * 300)
        rig.equal("a way out of it, rpm", rig.rpm, -sign * 300, "C402-161", within=3.0)
        rig.run(0.3)
        rig.equal("it has left the switch", rig.read(0x60FD) & 3, 0)
        rig.bits(0x800, 0, "C402-161")
    for reaction in ("fault", "none"):
        rig = Servo(ctx, _config(limit_switch_reaction=reaction), SLOPES)
        turning(rig, mode, SPEED)
        rig.run(0.35)
        rig.equal("beyond the switch", rig.read(0x60FD) & 2, 2)
        rig.equal(f"{reaction}: fault", rig.read(0x603F), 0x8612 if reaction == "fault" else 0, "C402-161")
        rig.bits(0x08, 0x08 if reaction == "fault" else 0)


def _again(rig: Servo, mode: int, rpm: int) -> None:
    if mode == 1:
        rig.configure({0x6081: abs(rpm) * 1000, 0x607A: 400 * REV if rpm > 0 else -400 * REV})
        rig.control(0x2F)
        rig.control(0x3F)
    elif mode == 2:
        rig.write(0x6042, rpm)
    else:
        rig.write(0x60FF, rpm * 1000)
    rig.run(0.1)


# -- safety inputs ------------------------------------------------------------------------------------------


@CAMPAIGN.product(
    "interlock/{reaction}",
    parameters={"reaction": ("none", "inhibit", "quick_stop", "fault")},
    title="the interlock opens: {reaction}",
    requirements=("C402-168",),
)
def interlock(ctx: CaseContext, reaction: str) -> None:
    """In operation and before; the input shows it, and it can be enabled again when it is closed."""
    rig = Servo(ctx, _config(safety=SafetyConfig(interlock=reaction)), SLOPES)
    if reaction == "none":
        rig.equal("not wired", rig.read(0x60FD) & 8, 0)
        return
    rig.equal("closed", rig.read(0x60FD) & 8, 8, "C402-168")
    turning(rig, 3, SPEED)
    rig.drive.open_interlock(True)
    rig.run(0.005)
    rig.equal("open", rig.read(0x60FD) & 8, 0, "C402-168")
    state = {"inhibit": 0x40, "quick_stop": 0x07, "fault": 0x0F}[reaction]
    rig.bits(0x6F if reaction != "inhibit" else 0x4F, state, "C402-168")
    rig.run(0.2)
    coasts = reaction == "inhibit"
    rig.equal("speed, rpm", rig.rpm, SPEED if coasts else 0.0, "C402-168", within=3.0)
    rig.equal("fault", rig.read(0x603F), 0x9000 if reaction == "fault" else 0, "C402-168")
    rig.control(0x06)
    rig.control(0x80)
    rig.control(0x06)
    rig.control(0x07)
    rig.equal("not enabled while it is open", rig.read(0x6041) & 0x6F == 0x27, 0, "C402-168")
    rig.drive.open_interlock(False)
    rig.run(0.01)
    rig.equal("closed again", rig.read(0x60FD) & 8, 8)
    rig.control(0x00)
    rig.control(0x80)
    rig.control(0x00)
    rig.write(0x60FF, 0)
    rig.enable(3)


@CAMPAIGN.product(
    "safe-stop/{monitored}",
    parameters={"monitored": (True, False)},
    title="safe stop 1 and safe torque off, monitored: {monitored}",
    requirements=("C402-030",),
)
def safe_stop(ctx: CaseContext, monitored: bool) -> None:
    """SS1 brakes with the quick stop; torque is off at standstill, or when its time is over; STO takes it at
    once, as a command or as a fault; none of them can be enabled.
    """
    for seconds in (0.05, 0.2):
        safety = SafetyConfig(ss1_time_ms=seconds * 1000, ss1_monitored=monitored)
        rig = Servo(ctx, _config(safety=safety), SLOPES)
        turning(rig, 3, SPEED)
        rig.drive.set_ss1(True)
        rig.drive.set_ss1(True)
        rig.run(0.01)
        rig.equal("brakes, rpm", rig.rpm, SPEED - 0.01 * QUICK, "C402-030", within=30.0)
        braking = SPEED / QUICK
        rig.run(braking - 0.01 + 0.01)
        rig.equal("at standstill, rpm", rig.rpm, 0.0, within=2.0)
        rig.equal("torque off at standstill", rig.drive.safety.torque_off, monitored, "C402-030")
        rig.run(seconds - braking + 0.005)
        rig.equal("torque off", rig.drive.safety.torque_off, 1, "C402-030")
        rig.equal("no fault", rig.read(0x603F), 0)
        rig.bits(0x4F, 0x40, "C402-030")
        rig.control(0x06)
        rig.bits(0x4F, 0x40, "C402-030")
        rig.drive.set_ss1(False)
        rig.run(0.005)
        rig.equal("released", rig.drive.safety.torque_off, 0, "C402-030")
        rig.control(0x00)
        rig.write(0x60FF, 0)
        rig.enable(3)
    # Too slow: the time is over before it stands.
    rig = Servo(ctx, _config(safety=SafetyConfig(ss1_time_ms=15.0, ss1_monitored=monitored)), SLOPES)
    turning(rig, 3, SPEED)
    rig.drive.set_ss1(True)
    rig.run(0.016)
    rig.equal("torque off", rig.drive.safety.torque_off, 1, "C402-030")
    rig.equal("fault", rig.read(0x603F), 0xFF81 if monitored else 0, "C402-030")
    rig.equal("at rest it is safe at once", _ss1_at_rest(ctx, monitored), 1)
    for kind in ("command", "fault"):
        safety = SafetyConfig(sto="fault" if kind == "fault" else "inhibit")
        rig = Servo(ctx, _config(safety=safety), SLOPES)
        turning(rig, 3, SPEED)
        rig.drive.set_sto(True)
        rig.run(0.01)
        rig.equal("coasts, rpm", rig.rpm, SPEED, "C402-030", within=1.0)
        rig.bits(0x4F, 0x08 if kind == "fault" else 0x40, "C402-030")
        rig.control(0x00)
        rig.control(0x80)
        rig.control(0x06)
        rig.equal("not ready", rig.read(0x6041) & 0x6F == 0x21, 0, "C402-030")
        rig.drive.set_sto(False)
        rig.run(0.005)
        rig.control(0x00)
        rig.control(0x80)
        rig.control(0x06)
        rig.bits(0x6F, 0x21, "C402-030")


def _ss1_at_rest(ctx: CaseContext, monitored: bool) -> bool:
    rig = Servo(ctx, _config(safety=SafetyConfig(ss1_time_ms=500.0, ss1_monitored=monitored)))
    rig.drive.set_ss1(True)
    rig.run(0.003)
    return rig.drive.safety.torque_off


# -- times ---------------------------------------------------------------------------------------------------


@CAMPAIGN.case("times", requirements=("C402-173", "C402-102"))
def times(ctx: CaseContext) -> None:
    """Transition 3 takes its time; set-points wait for the brake, what comes meanwhile is done behind it; a
    ramp to zero holds the load until the brake is closed.
    """
    brake = BrakeConfig(torque_nm=3.0, opening_time_ms=30.0, closing_time_ms=50.0)
    rig = Servo(ctx, _config(power_on_delay_ms=40.0, brake=brake), SLOPES)
    rig.write(0x6060, 1)
    rig.control(0x06)
    rig.control(0x07, 0.038)
    rig.bits(0x6F, 0x21, "C402-173")
    rig.run(0.003)
    rig.bits(0x6F, 0x23, "C402-173")
    rig.control(0x06)
    rig.control(0x07, 0.02)
    rig.control(0x06, 0.03)
    rig.bits(0x6F, 0x21, "C402-173")
    rig.control(0x07, 0.045)
    rig.write(0x607A, REV)
    rig.control(0x0F, 0.005)
    rig.bits(0x6F, 0x27)
    rig.control(0x1F, 0.02)
    rig.equal("brake closed", rig.drive.core.brake.closed, 1, "C402-173")
    rig.bits(0x1000, 0, "C402-102")
    rig.run(0.008)
    rig.equal("brake open", rig.drive.core.brake.closed, 0, "C402-173")
    rig.bits(0x1000, 0x1000, "C402-173")
    rig.until(0x400, 0x400, 2.0, "the set-point that came early is reached")
    rig.shows(0x6064, REV, within=8)
    rig.control(0x07, 0.04)
    rig.bits(0x6F, 0x27, "C402-173")
    rig.equal("holding until the brake is closed", rig.drive.core.enabled, 1, "C402-173")
    rig.run(0.015)
    rig.bits(0x6F, 0x23, "C402-173")
    rig.equal("brake closed", rig.drive.core.brake.closed, 1, "C402-173")
    rig.equal("no torque", rig.drive.core.enabled, 0)
    # With a halt that is set already it is enabled and stands.
    rig.control(0x10F, 0.05)
    rig.bits(0x6F, 0x27)
    rig.write(0x607A, 2 * REV)
    rig.control(0x11F, 0.05)
    rig.equal("halted, rpm", rig.rpm, 0.0, within=1.0)
    rig.control(0x00)
    fast = Servo(ctx, _config(power_on_delay_ms=0.0), SLOPES)
    fast.enable(3)


@CAMPAIGN.product(
    "sync-jitter/{reaction}",
    parameters={"reaction": ("fault", "warning", "none")},
    title="SYNC comes early and late: {reaction}",
    requirements=("CANP-071", "C301-037"),
)
def sync_jitter(ctx: CaseContext, reaction: str) -> None:
    """Up to its tolerance it is nothing, beyond it the drive reacts as to a loss; only while set-points
    count.
    """
    for early in (True, False):
        rig = Servo(
            ctx, replace(_config(), sync_jitter_percent=10.0, sync_loss=reaction, missing_setpoints=0), SLOPES
        )
        rig.configure({(0x60C2, 1): 4})
        rig.master.nmt(1, rig.drive.config.node_id)
        rig.run(0.002)

        def sync(ms: float, rig: Servo = rig) -> None:
            rig.run(ms / 1000.0)
            rig.master.send(0x80, b"")

        sync(4.0)
        sync(2.0)
        rig.equal("not in operation: nothing", len(rig.events("drive.sync_jitter")), 0)
        rig.write(0x6060, 9)
        for word in (0x06, 0x07, 0x0F):
            rig.write(0x6040, word)
            sync(4.0)
        sync(4.0)
        for ms in (4.0, 3.65, 4.35, 4.0):
            sync(ms)
        rig.run(0.001)
        rig.equal("within the tolerance", len(rig.events("drive.sync_jitter")), 0, "CANP-071")
        sync(3.0 - 0.5 if early else 3.0 + 0.5)
        rig.run(0.001)
        found = rig.events("drive.sync_jitter")
        rig.equal("beyond it", len(found), 1, "CANP-071")
        if found:
            rig.equal("deviation, us", found[0].data["deviation_us"], 500.0, "CANP-071", within=30.0)
            rig.equal("period, us", found[0].data["period_us"], 4000.0, "CANP-071", within=1.0)
        rig.equal("operation", rig.read(0x6041) & 0x6F == 0x27, reaction != "fault", "C301-037")
        rig.equal("EMCY", bool(rig.emcys), reaction != "none", "C301-037")


@CAMPAIGN.case("slippage", requirements=("C402-097", "C402-159"))
def slippage(ctx: CaseContext) -> None:
    """Bit 13 of pv while the speed is further from its demand than 60F8h; a fault where it is wanted."""
    for reaction in ("status", "fault"):
        for sign in (1, -1):
            rig = Servo(ctx, _config(slippage_reaction=reaction), SLOPES)
            turning(rig, 3, sign * 300)
            rig.write(0x60F8, 20_000)
            rig.run(0.003)
            rig.bits(0x2000, 0, "C402-097")
            core = rig.drive.core
            for push, shown in ((0.2, 0), (0.9, 1)):
                # By a push the speed gives way by push * time constant / inertia: 54 rpm per Nm.
                core.mechanics.apply_force(-sign * push / core.mechanics.ratio)
                rig.run(0.005)
                slip = abs(rig.read(0x606B) - rig.read(0x606C))
                rig.equal("slip beyond 60F8h", slip > 20_000, shown)
                rig.equal(
                    "bit 13",
                    bool(rig.read(0x6041) & 0x2000),
                    shown if reaction == "status" else 0,
                    "C402-097",
                )
                if reaction == "fault":
                    rig.equal("fault", rig.read(0x603F), 0x8400 if shown else 0, "C402-159")
                core.mechanics.apply_force(0.0)
                rig.run(0.1)


# -- ways ----------------------------------------------------------------------------------------------------

TURN: Final = 3 * REV
ROTARY: Final = {(0x607B, 1): 0, (0x607B, 2): TURN - 1}


def _way(option: int, start: int, target: int) -> int:
    """Return the way that C402-094 asks for, increments."""
    way = target - start
    if option == 1:
        return -((start - target) % TURN)
    if option == 2:
        return way % TURN
    if option == 3:
        return (way + TURN // 2) % TURN - TURN // 2
    return way


@CAMPAIGN.product(
    "rotary/{option}",
    parameters={"option": (0, 1, 2, 3)},
    title="ways on a rotary axis, option {option} of 60F2h",
    requirements=("C402-094", "C402-164"),
)
def rotary(ctx: CaseContext, option: int) -> None:
    """Absolute targets by the way of the option, relative ones over several turns; positions stay in the
    range.
    """
    config = replace(_config(), switches=SwitchesConfig(negative_limit_mm=None, positive_limit_mm=None))
    rig = Servo(ctx, config, SLOPES | ROTARY | {0x6081: 3_000_000, 0x6084: 60_000_000})
    rig.write(0x60F2, option << 6)
    rig.enable(1)
    start = 0
    place = rig.turns
    for target in (REV // 2, 2 * REV + 500, 100, TURN - 1, 7, TURN // 2 + 7, TURN // 2 + 6, REV, REV):
        rig.write(0x607A, target)
        rig.control(0x0F)
        rig.control(0x1F)
        rig.until(0x400, 0x400, 2.0, f"{target} is reached")
        rig.run(0.02)
        rig.shows(0x6064, target, "C402-094", within=8)
        way = _way(option, start, target)
        if abs(abs(way) - TURN / 2) > 10:  # there both ways are equally short
            rig.equal(f"way to {target}", (rig.turns - place) * REV, way, "C402-094", within=16)
        start, place = target, rig.turns
    for way in (5 * REV, -4 * REV - 300):
        rig.control(0x4F)
        rig.write(0x607A, way)
        rig.control(0x5F)
        rig.until(0x400, 0x400, 2.0, "a way over several turns")
        rig.run(0.02)
        rig.equal(f"way {way}", (rig.turns - place) * REV, way, "C402-164", within=16)
        start = (start + way) % TURN
        rig.shows(0x6064, start, "C402-164", within=8)
        place = rig.turns
    rig.control(0x0F)
    for target, code in ((0, 0), (TURN - 1, 0), (TURN, RANGE), (-1, RANGE)):
        rig.refuses(0x607A, target, code, "C402-164") if code else rig.write(0x607A, target)
        rig.bits(0x80, 0x80 if code else 0)
    rig.refuses(0x607B, TURN, STATE, sub=2)
    rig.control(0x06)
    rig.refuses(0x607B, TURN, CROSSED, sub=1)
    rig.refuses(0x607B, -1, CROSSED, sub=2)


@CAMPAIGN.product(
    "relative/{origin}",
    parameters={"origin": (0, 1, 2)},
    title="a relative target in motion, origin {origin} of 60F2h",
    requirements=("C402-093",),
)
def relative(ctx: CaseContext, origin: int) -> None:
    """From the last target, from the demand, or from the actual position."""
    for sign in (1, -1):
        config = replace(_config(), switches=SwitchesConfig(negative_limit_mm=None, positive_limit_mm=None))
        rig = Servo(ctx, config, SLOPES | {0x60F2: origin, 0x6065: 0xFFFFFFFF})
        rig.enable(1)
        rig.write(0x607A, sign * 3 * REV)
        rig.control(0x1F, 0.1)
        rig.control(0x2F)
        rig.write(0x607A, sign * REV)
        # A push separates demand and actual position.
        mechanics = rig.drive.core.mechanics
        mechanics.apply_force(-sign * 900.0)
        rig.run(0.01)
        demand, actual = rig.read(0x6062), rig.read(0x6064)
        rig.equal("apart", abs(demand - actual) > 300, 1)
        rig.control(0x7F, 0.001)
        mechanics.apply_force(0.0)
        rig.until(0x400, 0x400, 2.0, "the target is reached")
        rig.run(0.05)
        begins = {0: sign * 3 * REV, 1: demand, 2: actual}[origin]
        # The demand goes on until the control word is looked at.
        rig.shows(0x6064, begins + sign * REV, "C402-093", within=12 if origin == 0 else 150)
        if origin:
            continue
        rig.control(0x4F)
        rig.control(0x5F)
        rig.until(0x400, 0x400, 2.0, "once more")
        rig.run(0.05)
        rig.shows(0x6064, begins + sign * 2 * REV, "C402-093", within=12)


@CAMPAIGN.case("software-limits", requirements=("C402-140", "C402-162", "C402-163"))
def software_limits(ctx: CaseContext) -> None:
    """They hold after homing only, with the home offset; targets are clamped and bit 11 says so, in pp and
    csp.
    """
    low, high, offset = -2 * REV, REV, 5000
    limits = {(0x607D, 1): low, (0x607D, 2): high}
    rig = Servo(ctx, _config(), SLOPES | limits)
    rig.refuses(0x607D, low - 1, CROSSED, sub=2)
    rig.refuses(0x607D, high + 1, CROSSED, sub=1)

    def to(target: int, word: int = 0x1F) -> None:
        rig.write(0x607A, target)
        rig.control(word & ~0x10)
        rig.control(word)
        rig.until(0x400, 0x400, 2.0, f"{target}: it has stopped")
        rig.run(0.02)

    rig.enable(1)
    to(high + 3000)
    rig.shows(0x6064, high + 3000, "C402-140", within=8)
    rig.bits(0x800, 0)
    to(0)
    rig.configure({0x607C: offset, 0x6098: 37})
    rig.control(0x0F)
    rig.write(0x6060, 6)
    rig.run(0.002)
    rig.control(0x1F, 0.01)
    rig.bits(0x3400, 0x1400)
    rig.shows(0x6064, -offset, within=2)
    rig.control(0x0F)
    rig.write(0x6060, 1)
    rig.run(0.002)
    for target, ends in (
        (high + 3000, high - offset),
        (low - offset - 3000, low - offset),
        (high - offset, high - offset),
        (high - offset - 1, high - offset - 1),
    ):
        to(target)
        rig.shows(0x6064, ends, "C402-162", within=8)
        rig.bits(0x800, 0x800 if ends != target else 0, "C402-163")
    to(5000, 0x5F)
    rig.shows(0x6064, high - offset, "C402-162", within=8)
    rig.bits(0x800, 0x800, "C402-163")
    to(-5000, 0x5F)
    rig.bits(0x800, 0, "C402-163")
    rig.control(0x0F)
    rig.configure({(0x607D, 1): -(2**31), (0x607D, 2): 2**31 - 1})
    to(high + 4000)
    rig.shows(0x6064, high + 4000, "C402-162", within=8)


@CAMPAIGN.case("speed-limits", requirements=("C402-257", "C402-045", "C402-165"))
def speed_limits(ctx: CaseContext) -> None:
    """60C8h, 60C9h, 607Fh and 6080h limit each direction for itself, turned round with the polarity."""
    for polarity in (0, 0x40):
        rig = Servo(ctx, _config(), SLOPES | {(0x60C8, 0): -300_000, 0x60C9: 500_000, 0x607E: polarity})
        rig.enable(3)
        for wanted, found in ((400, 400), (500, 500), (800, 500), (-300, -300), (-301, -300), (-900, -300)):
            rig.write(0x60FF, wanted * 1000)
            rig.run(0.09)
            rig.shows(0x606C, found * 1000, "C402-257", within=2500)
            rig.equal("true speed", rig.rpm, -found if polarity else found, "C402-165", within=2.5)
            rig.bits(0x800, 0x800 if wanted != found else 0, "C402-045")
        rig.write(0x60FF, 0)
        rig.run(0.1)
        rig.control(0x06)
    rig = Servo(ctx, _config(), SLOPES | {0x6080: 450, 0x607F: 700_000})
    for mode in (3, 9):
        rig.write(0x60FF, 0)
        rig.enable(mode)
        for wanted, found in ((449, 449), (460, 450), (-900, -450)):
            rig.write(0x60FF, wanted * 1000)
            rig.run(0.1)
            rig.equal(f"mode {mode}: speed", rig.rpm, found, "C402-257", within=2.0)
        rig.write(0x60FF, 0)
        rig.run(0.1)
        rig.control(0x06)


@CAMPAIGN.case("torque-limits", requirements=("C402-098", "C402-165"))
def torque_limits(ctx: CaseContext) -> None:
    """6072h, 6073h, 60E0h and 60E1h, each direction for itself and with the polarity of the torque."""
    for polarity in (0, 0x20):
        for limits in ({0x60E0: 400, 0x60E1: 250}, {0x6072: 300}, {0x6073: 350, 0x60E1: 100}):
            rig = Servo(ctx, _config(), SLOPES | limits | {0x607E: polarity, 0x6087: 10_000_000})
            top = min(limits.get(0x6072, 3000), limits.get(0x6073, 3000))
            high, low = min(top, limits.get(0x60E0, top)), min(top, limits.get(0x60E1, top))
            rig.enable(4)
            for wanted in (high - 1, high + 1, 900, -low + 1, -low - 1, -900, 0):
                rig.write(0x6071, wanted)
                rig.run(0.003)
                found = max(min(wanted, high), -low)
                rig.shows(0x6077, found, "C402-098", within=1)
                true = rig.drive.core.torque / 2.0 * 1000
                rig.equal("true torque", true, -found if polarity else found, "C402-165", within=1.5)
                rig.bits(0x800, 0x800 if found != wanted else 0, "C402-045")
            rig.control(0x00)


@CAMPAIGN.case("accelerations", requirements=("C402-075", "C402-096"))
def accelerations(ctx: CaseContext) -> None:
    """60C5h and 60C6h limit the slopes; a slope of 0 is that limit, for stops too; without both it is at
    once.
    """
    for objects, up, down, quick in (
        ({0x60C5: 30_000_000, 0x60C6: 10_000_000}, 30_000, 10_000, 40_000),
        ({0x6083: 0, 0x6084: 0, 0x60C5: 25_000_000, 0x60C6: 15_000_000}, 25_000, 15_000, 40_000),
        ({0x6085: 0, 0x60C6: 12_000_000}, 60_000, 12_000, 12_000),
    ):
        rig = Servo(ctx, _config(), SLOPES | objects)
        for sign in (1, -1):
            rig.write(0x60FF, 0)
            rig.enable(3)
            for target, slope in ((sign * SPEED, up), (0, down)):
                begun = rig.rpm
                rig.write(0x60FF, target * 1000)
                rig.run(0.003)
                first = rig.rpm
                rig.run(0.008)
                rig.equal(
                    "slope, rpm/s", abs(rig.rpm - first) / 0.008, slope, "C402-075", within=0.02 * slope
                )
                rig.run(abs(target - begun) / slope)
            rig.write(0x60FF, sign * SPEED * 1000)
            rig.run(SPEED / up + 0.02)
            rig.write(0x605A, 2)
            rig.control(0x02, 0.003)
            first = rig.rpm
            rig.run(0.008)
            rig.equal(
                "quick stop, rpm/s", abs(rig.rpm - first) / 0.008, quick, "C402-075", within=0.02 * quick
            )
            rig.run(0.2)
            rig.control(0x00)
    rig = Servo(ctx, _config(), SLOPES | {0x6083: 0, 0x60C5: 0})
    rig.enable(3)
    rig.write(0x60FF, 200_000)
    rig.run(0.008)
    equal(ctx, "at once, rpm", rig.rpm, 200.0, within=20.0)
