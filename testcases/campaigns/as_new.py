"""After a power cycle a drive is as it was delivered: all that it shows of itself, part by part, but for
place, heat, times and histories.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from emulators.drive.machine import BrakeConfig
from emulators.drive.positioner_config import TraversingBlock
from hil.campaign import Campaign, CaseContext
from testcases.campaigns._axis_rig import GO, OFF, ON, POS_OFF, PdAxis, Positioned, axis_config
from testcases.campaigns._servo_rig import REV, Servo
from testcases.campaigns.support import equal

CAMPAIGN: Final = Campaign(
    "as new", controller="", tags=("drive",), bench="testcases.campaigns.can_bus:BENCH"
)
PLACES: Final = (
    *("angle", "offset", "increments", "motor_angle", "position", "position_ahead", "position_command"),
    *("position_demand", "motor_speed", "velocity", "speed_rpm", "standing", "actual_position", "xist3"),
    *("g1_words", "sent_angle", "demand", "internal_increments", "commanded_position", "demand_position"),
    *("demand_increments", "step_start", "edge", "machine_position"),
)
"""Where it stands, and how it turns on: the machine is no part of the drive."""
LASTING: Final = (
    *("calm_high", "calm_low", "calm_speed", "drawn_J", "returned_J", "rise_now_K", "temperature_C", "dt_s"),
    *("now_ns", "operating_ms", "cycle_at_ns", "received_at_ns", "counter", "situations", "worst_ns"),
    *("failures", "rejected", "missed"),
)
"""Heat, energy, times and histories; and what several steps at once may rely on."""
UNUSED: Final = (
    *("profile.done", "profile.raw_done", "profile.target", "channel.target", "machine.stop_option"),
    *("mechanics.factors", "brake.worn"),
)
"""What is set before it is used, and what belongs to the machine."""


def shown(thing: Any, depth: int = 5) -> dict[str, object]:
    """Return all plain values that a part and the parts in it show, by their names."""
    found: dict[str, object] = {}
    seen: set[int] = set()

    def look(part: Any, path: str, depth: int) -> None:
        if id(part) in seen:
            return
        seen.add(id(part))
        for name in dir(part):
            if name.startswith("_") or name in PLACES or name in LASTING:
                continue
            try:
                value = getattr(part, name)
            except (NotImplementedError, AttributeError):
                continue
            where = f"{path}.{name}"
            if isinstance(value, (bool, int, float, str)) or value is None:
                found[where] = value
            elif isinstance(value, (tuple, list, set, frozenset, bytes)):
                if all(isinstance(one, (bool, int, float, str)) for one in value):
                    found[where] = sorted(map(str, value)) if isinstance(value, (set, frozenset)) else value
            elif type(value).__module__.startswith("emulators.") and depth:
                look(value, where, depth - 1)

    look(thing, "", depth)
    return {where: value for where, value in found.items() if not where.endswith(UNUSED)}


def same(ctx: CaseContext, new: Any, old: Any, *ids: str) -> None:
    """Expect that two drives show the same."""
    first, second = shown(new), shown(old)
    equal(ctx, f"{len(first)} values are compared", len(first) > 200, 1)
    other = [
        f"{where[1:]} is {second.get(where)!r}, not {value!r}"
        for where, value in first.items()
        if second.get(where) != value and not _close(value, second.get(where))
    ]
    equal(ctx, f"what is not as new: {'; '.join(other[:6]) or 'nothing'}", len(other), 0, *ids)


def _close(one: object, other: object) -> bool:
    return isinstance(one, float) and isinstance(other, float) and abs(one - other) < 1e-6


def _speeds(rig: Servo) -> None:
    for mode, index, value in ((3, 0x60FF, 400_000), (9, 0x60FF, -300_000), (2, 0x6042, 200)):
        rig.enable(mode, 0x7F if mode == 2 else 0x0F)
        rig.write(index, value)
        rig.run(0.1)


def _positions(rig: Servo) -> None:
    rig.enable(1)
    rig.write(0x607A, 2 * REV)
    rig.control(0x1F, 0.1)
    rig.control(0x2F)
    rig.write(0x607A, -REV)
    rig.control(0x3F, 0.05)
    rig.control(0x10F, 0.05)
    rig.enable(8)
    rig.write(0x607A, rig.read(0x6064) + 2000)
    rig.run(0.05)


def _torques(rig: Servo) -> None:
    for mode in (4, 10):
        rig.enable(mode)
        rig.write(0x6071, 200)
        rig.write(0x60B2, 50)
        rig.run(0.03)


def _homing(rig: Servo) -> None:
    rig.configure({0x607C: 500, 0x6098: 37})
    rig.enable(6)
    rig.control(0x1F, 0.02)
    rig.configure({(0x2010, 1): 100, 0x6098: -3})
    rig.control(0x0F)
    rig.control(0x1F, 0.05)


def _probes(rig: Servo) -> None:
    rig.configure({0x60B8: 0x1311})
    _speeds(rig)


def _faults(rig: Servo) -> None:
    rig.enable(3)
    rig.write(0x60FF, 300_000)
    rig.run(0.05)
    rig.drive.raise_fault(0x2310)
    rig.run(0.05)
    rig.drive.raise_fault(0x9000, persistent=True)
    rig.run(0.05)
    rig.drive.clear_fault_cause()
    rig.control(0x80)
    rig.control(0x00)


def _safety(rig: Servo) -> None:
    _speeds(rig)
    rig.drive.set_ss1(True)
    rig.run(0.05)
    rig.drive.set_ss1(False)
    rig.drive.set_sto(True)
    rig.run(0.02)
    rig.drive.set_sto(False)
    rig.drive.set_local_control(True)
    rig.control(0x0F)
    rig.drive.set_local_control(False)
    rig.drive.force_switch_on_disabled()


PROGRAMS: Final[dict[str, Callable[[Servo], None]]] = {
    "speeds": _speeds,
    "positions": _positions,
    "torques": _torques,
    "homing": _homing,
    "probes": _probes,
    "faults": _faults,
    "safety": _safety,
}


@CAMPAIGN.product(
    "servo/{program}",
    parameters={"program": tuple(PROGRAMS)},
    title="a CiA 402 drive after {program} and a power cycle",
    requirements=("C301-018",),
)
def servo(ctx: CaseContext, program: str) -> None:
    """Whatever it has done: after a power cycle it is as new, its objects too."""
    new, old = Servo(ctx), Servo(ctx)
    PROGRAMS[program](old)
    old.drive.power_off()
    old.run(0.5)
    old.drive.power_on()
    old.run(0.002)
    same(ctx, new.drive, old.drive, "C301-018")


def _words(axis: PdAxis) -> None:
    axis.enable()
    for rpm, word in ((900, ON), (-600, ON & ~0x20), (-600, ON & ~0x10), (300, ON), (300, ON & ~0x40)):
        axis.run(word, 0.15, NSOLL_B=round(rpm / 3000 * 0x4000_0000))
    axis.run(ON & ~0x04, 0.1)


def _trips(axis: PdAxis) -> None:
    axis.enable()
    axis.run(ON, 0.2, NSOLL_B=0x0800_0000)
    axis.drive.raise_fault(30001)
    axis.run(ON, 0.1)
    axis.run(OFF | 0x80, 0.05)
    axis.drive.raise_fault(30005, persistent=True)
    axis.run(OFF, 0.05)
    axis.drive.clear_fault_cause()
    axis.run(OFF | 0x80, 0.05)
    axis.run(OFF, 0.05)


def _stops(axis: PdAxis) -> None:
    axis.enable()
    axis.run(ON, 0.2, NSOLL_B=0x0800_0000)
    for name in ("set_ss1", "set_sto"):
        getattr(axis.drive.safety, name)(True)
        axis.run(ON, 0.2)
        getattr(axis.drive.safety, name)(False)
        axis.run(OFF, 0.1)


WORDS: Final[dict[str, Callable[[PdAxis], None]]] = {"words": _words, "trips": _trips, "stops": _stops}


@CAMPAIGN.product(
    "axis/{program}",
    parameters={"program": tuple(WORDS)},
    title="a PROFIdrive axis after {program} and a power cycle",
    requirements=("PD-103",),
)
def axis(ctx: CaseContext, program: str) -> None:
    """Whatever it has done: after a power cycle it is as new."""
    brake = BrakeConfig(torque_nm=3.0, opening_time_ms=20.0, closing_time_ms=30.0)
    new, old = PdAxis(ctx, axis_config(brake=brake)), PdAxis(ctx, axis_config(brake=brake))
    WORDS[program](old)
    old.drive.power_off()
    old.run(OFF, 1.2, NSOLL_B=0)
    old.drive.power_on()
    same(ctx, new.drive, old.drive, "PD-103")


@CAMPAIGN.case("positioner", requirements=("PD-103",))
def positioner(ctx: CaseContext) -> None:
    """Tasks, blocks, a home position, a refused task: after a power cycle it is as new."""
    blocks = (
        TraversingBlock(number=1, task="set output", parameter=3, continuation="continue flying"),
        TraversingBlock(number=2, position=9_000, velocity=6_000, continuation="continue external"),
    )
    made = [Positioned(ctx, block=blocks, software_limits=(-50_000, 60_000)) for _ in range(2)]
    new, old = made
    old.run(0x0C0F, POS_STW2=2)
    old.run(0x0C0F, POS_STW2=0)
    old.go(0.3, POS_STW1=1)
    old.go(0.1, POS_STW1=0x8100, MDI_TARPOS=90_000)
    old.go(0.1, POS_STW1=0x8100, MDI_TARPOS=20_000, MDI_VELOCITY=6_000)
    old.run(GO & ~0x20, 0.1)
    old.run(GO, 0.1, STW2=0x100)
    for one in made:
        one.drive.power_off()
        one.run(POS_OFF, 1.0)
        one.drive.power_on()
    same(ctx, new.drive, old.drive, "PD-103")
