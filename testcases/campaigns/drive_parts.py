"""Encoders and drives with two speeds by themselves: what is counted, marks, each fault and its end,
terminals.

An encoder is compared with a count of the shaft of its own.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from emulators.drive.machine import LinearAxisConfig, SwitchesConfig
from emulators.drive.two_speed import TwoSpeedDrive
from emulators.drive.two_speed_config import TwoSpeedConfig, TwoSpeedSettings
from emulators.encoder import AbsoluteEncoder, IncrementalEncoder
from fieldbus.clock import VirtualScheduler
from fieldbus.history import History
from hil.campaign import Campaign, CaseContext
from testcases.campaigns.device_settings import refused
from testcases.campaigns.support import equal

CAMPAIGN: Final = Campaign(
    "drive parts", controller="", tags=("drive", "encoder"), bench="testcases.campaigns.can_bus:BENCH"
)
COUNTS: Final = 1000
MARK: Final = 137
INCREMENT: Final = math.tau / COUNTS


def near(ctx: CaseContext, what: str, found: float, wanted: float, *ids: str, within: float = 1e-9) -> None:
    """Expect a number."""
    equal(ctx, what, found, wanted, *ids, within=within)


def turn(encoder: Any, begin: float, end: float, steps: int = 40) -> float:
    """Turn the shaft from an angle to another, rad; returns the end."""
    for step in range(1, steps + 1):
        encoder.sample(begin + (end - begin) * step / steps)
    return end


# -- encoders ------------------------------------------------------------------------------------------------


@CAMPAIGN.product(
    "encoder/{way}",
    parameters=[{"way": "forward", "reversed_": False}, {"way": "reversed", "reversed_": True}],
    title="an encoder, {way}: counts, mark, faults",
    requirements=("STP-550",),
)
def encoder(ctx: CaseContext, way: str, reversed_: bool) -> None:
    """It counts the way of its shaft to either side; what a fault has made of the count stays, and nothing
    else.
    """
    del way
    sign = -1 if reversed_ else 1
    made = IncrementalEncoder(
        counts_per_revolution=COUNTS, reversed_direction=reversed_, zero_mark_counts=MARK
    )
    made.power_on(1.0)
    equal(ctx, "at power-on", made.increments, 0)
    place = 1.0
    for end in (1.0 + 30.4 * INCREMENT, 1.0 + 30.6 * INCREMENT, -5.0, 12.0):
        place = turn(made, place, end)
        near(
            ctx,
            f"counts at {end:.4g}",
            made.increments,
            sign * (end - 1.0) / INCREMENT,
            "STP-550",
            within=1.001,
        )
        near(ctx, "angle", made.angle, sign * (end - 1.0), "STP-550", within=INCREMENT)
        equal(ctx, "count of an angle", made.increments_at(end), made.increments)
    # Each fault makes a difference, and leaves what it has counted.
    before = made.increments
    made.freeze(True)
    place = turn(made, place, 14.0)
    equal(ctx, "frozen", (made.frozen, made.increments) == (True, before), 1)
    equal(ctx, "frozen for another angle", made.increments_at(99.0), before)
    made.freeze(False)
    place = turn(made, place, 14.0)
    near(ctx, "as if nothing had been", made.increments, before + sign * 2.0 / INCREMENT, within=1.001)
    before = made.increments
    made.jump(77)
    equal(ctx, "jump", made.increments, before + 77)
    for factor in (1.5, 0.5):
        before = made.increments
        made.scale(factor)
        place = turn(made, place, place + 3.0)
        near(ctx, f"scale {factor}", made.increments - before, sign * factor * 3.0 / INCREMENT, within=1.001)
        ahead = made.increments_at(place + 1.0) - made.increments
        near(ctx, "of an angle ahead", ahead, sign * factor / INCREMENT, within=1.001)
        made.scale(1.0)
        near(
            ctx,
            "what was counted stays",
            made.increments - before,
            sign * factor * 3.0 / INCREMENT,
            within=1.001,
        )
        place = turn(made, place, place - 2.0)
        near(
            ctx,
            "then rightly",
            made.increments - before,
            sign * (factor * 3.0 - 2.0) / INCREMENT,
            within=2.001,
        )
    before = made.increments
    made.reverse(not reversed_)
    equal(ctx, "turned round: no jump", made.increments, before)
    place = turn(made, place, place + 1.0)
    near(ctx, "counts the other way", made.increments - before, -sign / INCREMENT, within=1.001)
    made.reverse(reversed_)
    place = turn(made, place, place + 1.0)
    near(ctx, "and back", made.increments - before, 0, within=1.001)
    before = made.increments
    made.lose_steps(4)
    place = turn(made, place, place + 200 * INCREMENT, 200)
    near(ctx, "every fourth is lost", made.increments - before, sign * 150, within=1.001)
    made.lose_steps(0)
    place = turn(made, place, place - 200 * INCREMENT, 200)
    near(ctx, "what was missed stays missed", made.increments - before, -sign * 50, within=1.001)
    for name, wrong in (
        ("scale", 0.0),
        ("scale", math.inf),
        ("lose_steps", 1),
        ("lose_steps", -2),
        ("set_noise", -1),
    ):
        said = refused(lambda n=name, w=wrong: getattr(made, n)(w))
        equal(ctx, f"{name} {wrong} is refused", bool(said), 1)
    equal(ctx, "no noise without a generator", bool(refused(lambda: made.set_noise(3))), 1)
    noisy = IncrementalEncoder(counts_per_revolution=COUNTS, rng=np.random.default_rng(3))
    noisy.power_on(0.0)
    noisy.set_noise(3)
    seen = {noisy.sample(0.0) and noisy.increments for _ in range(200)}
    equal(ctx, f"noise of three increments: {sorted(seen)}", seen == set(range(-3, 4)), 1)
    noisy.set_noise(0)
    noisy.sample(0.0)
    equal(ctx, "no noise", noisy.increments, 0)
    for low, fits in ((3, 0), (4, 1)):
        equal(ctx, f"{low} counts", not refused(IncrementalEncoder, counts_per_revolution=low), fits)
    for mark, fits in ((-1, 0), (0, 1), (COUNTS - 1, 1), (COUNTS, 0)):
        said = refused(IncrementalEncoder, counts_per_revolution=COUNTS, zero_mark_counts=mark)
        equal(ctx, f"mark at {mark}", not said, fits)


@CAMPAIGN.case("zero-mark", requirements=("C402-139",))
def zero_mark(ctx: CaseContext) -> None:
    """Armed it latches the next mark in either direction, once, to the increment; others hear of each one."""
    for reversed_ in (False, True):
        sign = -1 if reversed_ else 1
        made = IncrementalEncoder(
            counts_per_revolution=COUNTS, reversed_direction=reversed_, zero_mark_counts=MARK
        )
        start = sign * 0.25 * math.tau
        made.power_on(start)
        zero = round(sign * start / INCREMENT)
        heard: list[tuple[int, float]] = []

        def listen(latched: int, before: float, mark: float, after: float, heard: Any = heard) -> None:
            heard.append((latched, mark))
            inside = min(before, after) <= mark <= max(before, after)
            equal(ctx, "the mark lies on the way", inside, 1)

        place = start
        for end, turns in ((3.5, 3), (2.5, 3), (-1.5, -1)):
            made.arm_zero_mark()
            equal(ctx, "nothing yet", made.latched_increments is None, 1)
            made.watch_zero_mark(listen)
            made.watch_zero_mark(listen)
            heard.clear()
            target = sign * end * math.tau
            forward = sign * (target - place) > 0
            begun = sign * place / math.tau
            place = turn(made, place, target, 200)
            share = MARK / COUNTS
            first = math.floor(begun - share) + 1 if forward else math.ceil(begun - share) - 1
            wanted = first * COUNTS + MARK - zero
            equal(ctx, f"to {end}: latched", made.latched_increments or 0, wanted, "C402-139")
            count = abs(math.floor(end - share) - math.floor(begun - share))
            equal(ctx, f"to {end}: marks heard", len(heard), count, "C402-139")
            if heard:
                equal(ctx, "the first one heard", heard[0][0], wanted)
                near(ctx, "where it is", sign * heard[0][1] / INCREMENT, first * COUNTS + MARK, within=1e-6)
            made.unwatch_zero_mark(listen)
            del turns
        made.arm_zero_mark()
        made.arm_zero_mark(False)
        made.zero_mark_present = True
        place = turn(made, place, place + math.tau)
        equal(ctx, "not armed: nothing", made.latched_increments is None, 1)
        made.arm_zero_mark()
        made.zero_mark_present = False
        place = turn(made, place, place + 2 * math.tau)
        equal(ctx, "no mark: nothing", made.latched_increments is None, 1)
        made.zero_mark_present = True
        place = turn(made, place, place + math.tau)
        equal(ctx, "there again", made.latched_increments is None, 0)


@CAMPAIGN.case("absolute", requirements=("C402-198",))
def absolute(ctx: CaseContext) -> None:
    """The value at power-on is the place within its turns, around zero; it counts on beyond them."""
    turns = 8
    span = turns * COUNTS
    for mounting in (0, 300, -2500):
        for place in (0.0, 1.3, 3.9, 4.1, -3.9, -4.1, 11.7):
            made = AbsoluteEncoder(turns=turns, mounting_offset=mounting, counts_per_revolution=COUNTS)
            made.power_on(place * math.tau)
            raw = round(place * COUNTS) + mounting
            wanted = (raw + span // 2) % span - span // 2
            equal(ctx, f"{place} turns, {mounting}: at power-on", made.increments, wanted, "C402-198")
            equal(ctx, "absolute value", made.absolute_value, raw % span, "C402-198")
            turn(made, place * math.tau, (place + 5.0) * math.tau, 100)
            equal(ctx, "counts on", made.increments, wanted + 5 * COUNTS, "C402-198")
            made.jump(40)
            made.power_on(place * math.tau)
            again = (raw + 40 + span // 2) % span - span // 2
            equal(ctx, "a jump outlasts a power cycle", made.increments, again)
    equal(ctx, "turns", AbsoluteEncoder(turns=turns).turns, turns)
    for count, fits in ((0, 0), (1, 1), (65_536, 1), (65_537, 0)):
        equal(ctx, f"{count} turns", not refused(AbsoluteEncoder, turns=count), fits)


# -- a drive with two speeds ---------------------------------------------------------------------------------

TERMINALS: Final = {
    "contactors": {
        ("plus_high",): (1, True),
        ("plus_low",): (1, False),
        ("minus_low",): (-1, False),
        ("minus_high",): (-1, True),
        (): (0, False),
        ("plus_high", "plus_low"): None,
        ("plus_low", "minus_low"): None,
        ("minus_high", "plus_high"): None,
    },
    "inverter": {
        ("direction_plus", "velo_high"): (1, True),
        ("direction_plus", "velo_low"): (1, False),
        ("direction_minus", "velo_low"): (-1, False),
        ("direction_minus", "velo_high"): (-1, True),
        ("direction_plus",): (0, False),
        ("velo_high",): (0, False),
        (): (0, False),
        ("direction_plus", "direction_minus"): None,
        ("direction_minus", "velo_low", "velo_high"): None,
    },
}
"""Terminals that are on, and what they ask for: direction, fast; None: they contradict each other."""
FAST, SLOW = 900.0, 200.0


class _Motor:
    """A drive with two speeds, and its terminals."""

    def __init__(self, ctx: CaseContext, control: str) -> None:
        self.ctx = ctx
        self.scheduler = VirtualScheduler()
        self.history = History(self.scheduler)
        free = LinearAxisConfig(
            coulomb_friction_n=0.0,
            viscous_friction_n_per_m_s=0.0,
            negative_stop_mm=None,
            positive_stop_mm=None,
        )
        settings = TwoSpeedSettings(
            control=control,  # type: ignore[arg-type]
            fast_rpm=FAST,
            slow_rpm=SLOW,
            time_constant_s=0.04,
            coasting_s=0.2,
            braking_s=0.01,
            brake_delay_ms=30.0,
        )
        config = TwoSpeedConfig(
            two_speed=settings, mechanics=free, switches=SwitchesConfig(input_filter_ms=0.0)
        )
        self.drive = TwoSpeedDrive(self.scheduler, config, name="motor", history=self.history)

    def run(self, seconds: float) -> None:
        self.scheduler.run_for(round(seconds * 1e9))

    def set(self, *on: str, brake: bool = False) -> None:
        for name in self.drive.terminals:
            if name != "brake" and name not in on:
                self.drive.set_terminal(name, False)
        for name in on:
            self.drive.set_terminal(name, True)
        self.drive.set_terminal("brake", brake)

    @property
    def rpm(self) -> float:
        return float(self.drive.core.speed_rpm)

    def equal(self, what: str, found: float, wanted: float, *ids: str, within: float = 0.0) -> None:
        equal(self.ctx, what, found, wanted, *ids, within=within)

    def shows(self, state: str) -> None:
        found = self.drive.state.value
        self.equal(f"state is {state} (it is {found})", found == state, 1)


@CAMPAIGN.product(
    "two-speed/{control}",
    parameters={"control": tuple(TERMINALS)},
    title="a drive with two speeds, {control}",
)
def two_speed(ctx: CaseContext, control: str) -> None:
    """Each combination of terminals, its speed and time; what contradicts itself trips until all are off;
    brake, supply, faults.
    """
    motor = _Motor(ctx, control)
    drive = motor.drive
    motor.run(0.01)
    motor.shows("Off")
    drive.power_on()
    drive.power_on()
    motor.run(0.01)
    motor.shows("Braked")
    for on, wanted in TERMINALS[control].items():
        motor.set(*on)
        motor.run(0.06)
        if wanted is None:
            motor.shows("Fault")
            motor.equal("number of the fault", drive.fault_number, 0x9001)
            motor.set(*on[:1])
            motor.run(0.01)
            motor.shows("Fault" if control == "contactors" else drive.state.value)
            motor.set()
            motor.run(0.01)
            motor.shows("Coasting")
            motor.equal("no fault", drive.fault_number, 0)
            continue
        direction, fast = wanted
        motor.run(0.5)
        speed = direction * (FAST if fast else SLOW)
        if direction:
            motor.equal(f"speed of {on}", motor.rpm, speed, within=1.0)
            motor.shows("Fast" if fast else "Slow")
        else:
            motor.shows("Coasting")
        motor.set()
        motor.run(2.0)
        motor.equal("coasted down, rpm", motor.rpm, 0.0, within=1.0)
    illegal = drive.illegal
    motor.equal("contradictions", illegal > 1, 1)
    # Time constants: of a speed, of coasting, of braking; the brake acts after its delay.
    fast = next(on for on, wanted in TERMINALS[control].items() if wanted == (1, True))
    motor.set(*fast)
    motor.run(0.04)
    motor.equal("one time constant", motor.rpm, FAST * (1 - math.exp(-1)), within=0.03 * FAST)
    motor.run(0.5)
    motor.set()
    motor.run(0.2)
    motor.equal("one of coasting", motor.rpm, FAST * math.exp(-1), within=0.02 * FAST)
    motor.set(*fast)
    motor.run(0.5)
    motor.set(brake=True)
    motor.run(0.028)
    motor.equal("brake not yet applied", drive.braked, 0)
    motor.run(0.003)
    motor.equal("brake applied", drive.braked, 1)
    motor.shows("Braked")
    begun = motor.rpm
    motor.run(0.01)
    motor.equal("one of braking", motor.rpm, begun * math.exp(-1), within=0.06 * begun)
    motor.set(*fast, brake=True)
    motor.run(0.3)
    motor.equal("held by the brake", motor.rpm, 0.0, within=1.0)
    motor.set(*fast)
    motor.run(0.02)
    motor.set(*fast, brake=True)
    motor.run(0.05)
    motor.equal("released for less than its delay", drive.braked, 1)
    motor.set(*fast)
    motor.run(0.5)
    motor.equal("released", motor.rpm, FAST, within=1.0)
    _faults(motor, fast)


def _faults(motor: _Motor, fast: tuple[str, ...]) -> None:
    """A fault lets it coast until all terminals are off and its cause is gone; so does the supply."""
    drive = motor.drive
    drive.raise_fault(0x1234, persistent=True)
    motor.run(0.02)
    motor.shows("Fault")
    motor.equal("number", drive.fault_number, 0x1234)
    motor.equal("coasting, rpm", motor.rpm, FAST * math.exp(-0.1), within=0.03 * FAST)
    motor.set()
    motor.run(0.01)
    motor.shows("Fault")
    drive.clear_fault_cause(0x9999)
    motor.run(0.01)
    motor.shows("Fault")
    drive.clear_fault_cause(0x1234)
    motor.run(0.01)
    motor.shows("Coasting")
    motor.equal("no number", drive.fault_number, 0)
    drive.raise_fault()
    motor.equal("a fault of any kind", drive.fault_number, 0x9000)
    drive.clear_fault_cause()
    motor.run(0.01)
    motor.shows("Coasting")
    for code, fits in ((0, 0), (1, 1), (0xFFFF, 1), (0x1_0000, 0)):
        said = refused(lambda c=code: drive.raise_fault(c))
        motor.equal(f"fault {code}", not said, fits)
    drive.clear_fault_cause()
    motor.set(*fast)
    motor.run(0.3)
    drive.power_off()
    drive.power_off()
    motor.shows("Off")
    motor.equal("the brake applies at once", drive.braked, 1)
    motor.run(0.2)
    motor.equal("it stands, rpm", motor.rpm, 0.0, within=1.0)
    motor.set()
    motor.run(0.05)
    motor.equal("without supply the brake stays", drive.braked, 1)
    motor.shows("Off")
    drive.power_on()
    motor.run(0.01)
    motor.equal("with supply it is released", drive.braked, 0)
    motor.shows("Coasting")
    motor.equal("no such terminal", bool(refused(lambda: drive.set_terminal("left", True))), 1)
    row = dict(zip([name for name, _ in drive.trace_columns], drive.trace_row(), strict=True))
    motor.equal("terminals of the trace", row["terminals"], 0)
    motor.set(*fast)
    row = dict(zip([name for name, _ in drive.trace_columns], drive.trace_row(), strict=True))
    names = list(drive.terminals)
    motor.equal("bits of the terminals", row["terminals"], sum(1 << names.index(name) for name in fast))
    motor.equal("increments of the trace", row["encoder_increments"], drive.core.encoder.increments)
