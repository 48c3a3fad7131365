"""Channels of I/O stations, the pulse generator and formats of PROFIdrive encoders by themselves, against
plain models.
"""

from __future__ import annotations

import math
import random
from functools import partial
from typing import Final

import numpy as np

from emulators.encoder.profidrive import EncoderFormat
from emulators.encoder.profidrive.format import fitted_format, p979
from emulators.io._channels import AnalogInput, AnalogOutput, CounterInput, DigitalInput, DigitalOutput
from emulators.io.tm_pto.pulses import PulseGenerator
from fieldbus.clock import VirtualScheduler
from hil.campaign import Campaign, CaseContext
from testcases.campaigns.device_settings import refused
from testcases.campaigns.support import equal, same

CAMPAIGN: Final = Campaign(
    "io parts", controller="", tags=("telegram",), bench="testcases.campaigns.can_bus:BENCH"
)
MS: Final = 1_000_000


# -- channels ------------------------------------------------------------------------------------------------


@CAMPAIGN.case("digital", requirements=("LIM-026",))
def digital(ctx: CaseContext) -> None:
    """A level counts after the filter time and not before, a shorter one never; stuck and broken go before
    it.
    """
    for filter_ms in (0.0, 3.2):
        clock = VirtualScheduler()
        made = DigitalInput(clock, filter_ms)
        wait = round(filter_ms * MS)
        for level in (True, False):
            made.set(level)
            same(ctx, "raw", made.raw, level)
            same(
                ctx,
                f"{filter_ms} ms: at once",
                made.value,
                level is (not filter_ms) if level else bool(filter_ms),
            )
            clock.run_for(max(0, wait - 1))
            same(
                ctx,
                f"{filter_ms} ms: just before",
                made.value,
                level if not filter_ms else not level,
                "LIM-026",
            )
            clock.run_for(1)
            same(ctx, f"{filter_ms} ms: then", made.value, level, "LIM-026")
        if filter_ms:
            made.set(True)
            clock.run_for(wait - 1)
            made.set(False)
            clock.run_for(1)
            made.set(True)
            clock.run_for(wait - 1)
            same(ctx, "a pulse that is too short, and again", made.value, False, "LIM-026")
            made.set(False)
            clock.run_for(2 * wait)
            same(ctx, "nothing of it", made.value, False, "LIM-026")
        made.set(True)
        clock.run_for(wait)
        for name, act, level in (
            ("broken", partial(made.break_wire, True), False),
            ("repaired", partial(made.break_wire, False), True),
            ("stuck at 0", partial(made.hold, False), False),
            ("stuck at 1", partial(made.hold, True), True),
            ("stuck and broken", partial(made.break_wire, True), True),
            ("broken alone", partial(made.hold, None), False),
            ("whole", partial(made.break_wire, False), True),
        ):
            act()
            clock.run_for(wait)
            same(ctx, name, (made.level, made.value), (level, level))
    for ms, fits in ((-0.1, 0), (0.0, 1), (1000.0, 1), (1000.1, 0)):
        equal(ctx, f"filter of {ms} ms", not refused(lambda m=ms: DigitalInput(VirtualScheduler(), m)), fits)
    told: list[bool] = []
    out = DigitalOutput(told.append)
    same(ctx, "substitute", (out.substitute, DigitalOutput(substitute=None).substitute), (False, None))
    for act, level in (
        (partial(out.set, True), True),
        (partial(out.break_wire, True), False),
        (partial(out.hold, True), False),
        (partial(out.break_wire, False), True),
        (partial(out.set, False), True),
        (partial(out.hold, None), False),
    ):
        act()
        same(ctx, "end of the wire", out.level, level)
    same(ctx, "each change once", told, [True, False, True, False])


@CAMPAIGN.case("analog", requirements=("CFG-394",))
def analog(ctx: CaseContext) -> None:
    """27648 is the end of the range; overrange, overflow and underflow are where they are, with and without a
    sign; smoothing is of first order; what is wrong with a channel acts and ends.
    """
    clock = VirtualScheduler()
    volts = AnalogInput(clock, 0.0, 10.0, bipolar=True)
    current = AnalogInput(clock, 4.0, 20.0, wire_break_below=3.6)
    for made, rows in (
        (
            volts,
            (
                *((0.0, 0), (10.0, 27648), (-10.0, -27648), (5.0, 13824), (11.7589, 32511), (11.7592, 32767)),
                *((-11.7592, -32512), (-11.7597, -32768), (1e9, 32767), (-1e9, -32768)),
            ),
        ),
        (
            current,
            (
                (4.0, 0),
                (20.0, 27648),
                (12.0, 13824),
                (3.7, -518),
                (3.6, -691),
                (3.59, 32767),
                (22.815, 32767),
            ),
        ),
    ):
        for value, word in rows:
            made.set(value)
            same(ctx, f"word of {value}", made.word, word, "CFG-394")
    plain = AnalogInput(clock, 0.0, 10.0)
    for value, word in ((-1.7592, -4864), (-1.7597, -32768)):
        plain.set(value)
        same(ctx, f"word of {value} without a sign", plain.word, word, "CFG-394")
    same(ctx, "wire", (current.wire_broken, volts.wire_broken), (False, False))
    current.set(3.5)
    same(ctx, "wire broken", current.wire_broken, True)
    current.set(8.0)
    current.disturbance.broken = True
    same(ctx, "cut", (current.wire_broken, current.value, current.word), (True, 0.0, 32767))
    current.disturbance.broken = False
    smooth = AnalogInput(clock, 0.0, 10.0, smoothing_ms=20.0)
    value = 0.0
    for target, wait_ms in ((8.0, 10.0), (8.0, 15.0), (-2.0, 7.0), (5.0, 100.0)):
        smooth.set(target)
        clock.run_for(round(wait_ms * MS))
        value = target + (value - target) * math.exp(-wait_ms / 20.0)
        equal(ctx, f"smoothed towards {target}", smooth.smoothed, value, within=1e-9)
    wrong = smooth.disturbance
    wrong.gain, wrong.offset = 1.5, -0.25
    equal(ctx, "gain and offset", smooth.value, value * 1.5 - 0.25, within=1e-9)
    wrong.stuck = 3.0
    equal(ctx, "stuck", smooth.value, 3.0)
    wrong.broken = True
    equal(ctx, "broken goes before stuck", smooth.value, 0.0)
    for name, bad in (("low and high", {"low": 1.0, "high": 1.0}), ("smoothing", {"smoothing_ms": -1.0})):
        said = refused(lambda b=bad: AnalogInput(clock, **b))
        equal(ctx, f"{bad} is refused", name in said, 1)
    equal(ctx, "no number", bool(refused(lambda: plain.set(math.nan))), 1)
    noisy = AnalogInput(clock, rng=np.random.default_rng(1))
    noisy.set(5.0)
    noisy.disturbance.set_noise(0.5)
    seen = [noisy.value for _ in range(400)]
    equal(ctx, "noise, mean", sum(seen) / 400, 5.0, within=0.06)
    equal(ctx, "noise, greatest", max(abs(one - 5.0) for one in seen), 0.475, within=0.025)
    told: list[float] = []
    out = AnalogOutput(-10.0, 10.0, on_change=told.append, substitute=None)
    for word, value in (
        (27648, 10.0),
        (0, -10.0),
        (-27648, -30.0),
        (32767, None),
        (-32768, None),
        (13824, 0.0),
    ):
        out.set(word)
        if value is None:
            limit = 32511 if word > 0 else -32512
            value = -10.0 + 20.0 * limit / 27648  # noqa: PLW2901
        equal(ctx, f"output of {word}", out.value, value, "CFG-394", within=1e-9)
    same(ctx, "told with every new word", len(told), 6)
    out.set(13824)
    same(ctx, "not with the same", len(told), 6)
    out.disturbance.stuck = 7.0
    out.refresh()
    same(ctx, "end of the wire", told[-1], 7.0)
    equal(ctx, "output range", bool(refused(AnalogOutput, low=1.0, high=1.0)), 1)


@CAMPAIGN.case("counter")
def counter(ctx: CaseContext) -> None:
    """A counter of 32 bits follows its encoder, wraps, is set, connected elsewhere, held, and goes on."""
    place = [0, 5000]
    made = CounterInput()
    same(ctx, "nothing connected", made.count, 0)
    made.connect(lambda: place[0])
    place[0] = 70
    same(ctx, "counts", made.count, 70)
    made.set(-30)
    place[0] += 10
    same(ctx, "set", made.count, -20)
    made.connect(lambda: place[1])
    same(ctx, "another encoder: no jump", made.count, -20)
    place[1] += 7
    same(ctx, "counts on", made.count, -13)
    for name in ("hold", "break_wire"):
        act = getattr(made, name)
        before = made.count
        act(True)
        place[1] += 500
        same(ctx, f"{name}: stands", made.count, before)
        act(False)
        same(ctx, f"{name} ends: goes on from there", made.count, before)
        place[1] += 3
        same(ctx, "counts on", made.count, before + 3)
    made.hold(True)
    made.break_wire(True)
    made.hold(False)
    place[1] += 9
    before = made.count
    made.break_wire(False)
    same(ctx, "held by either", made.count, before)
    made.set(2**31 - 2)
    place[1] += 1
    same(ctx, "greatest", made.count, 2**31 - 1)
    place[1] += 1
    same(ctx, "wraps", made.count, -(2**31))
    made.restart()
    same(ctx, "restarted", made.count, 0)


# -- pulses ----------------------------------------------------------------------------------------------


@CAMPAIGN.product(
    "pulses/{pause_ms}",
    parameters={"pause_ms": (0.0, 1.5)},
    title="a pulse generator, pause of {pause_ms} ms",
    requirements=("PTO-001", "PTO-167"),
)
def pulses(ctx: CaseContext, pause_ms: float) -> None:
    """Count and frequency are those of ramps in small steps, with a pause at each reversal; when a count
    comes is said before it does.
    """
    draw = random.Random(5)
    pause = round(pause_ms * MS)
    made = PulseGenerator(pause_ns=pause)
    step = 20_000
    now, frequency, way, target, slope = 0, 0.0, 0.0, 0.0, 1.0
    rest_until, direction, still = 0, 0, 0
    wrong: list[str] = []
    for _ in range(60):
        if draw.random() < 0.8:
            target = draw.choice((0.0, 0.05, -0.09, 0.2, 700.0, -900.0, 2500.0, -2500.0, 1200.0))
            slope = draw.choice((5_000.0, 40_000.0, 300_000.0))
            made.steer(now, target, slope)
            target = 0.0 if abs(target) < 0.1 else target
            rest_until = 0
        else:
            made.halt(now)
            frequency = target = 0.0
            still = now
            rest_until = 0
        goal = made.count + draw.choice((-3, 2, 5))
        due = made.time_of(goal)
        length = draw.choice((3, 11, 29)) * MS
        met = 0
        for _ in range(length // step):
            turn = math.copysign(1.0, target) if target else 0.0
            before = frequency
            if frequency * turn <= 0.0 and target:
                if frequency:
                    change = math.copysign(min(abs(frequency), slope * step / 1e9), -frequency)
                    frequency += change
                    if not frequency:
                        still = now + step
                elif direction != -turn or now - still >= pause:
                    frequency = turn * min(abs(target), slope * step / 1e9)
            elif frequency != target:
                gap = target - frequency
                frequency += math.copysign(min(abs(gap), slope * step / 1e9), gap)
                if not frequency:
                    still = now + step
            moved = 0.5 * (before + frequency) * step / 1e9
            way += moved
            direction = math.copysign(1.0, moved) if moved else direction
            now += step
            made.advance(now)
            if made.count == goal and not met:
                met = now
            if (
                abs(made.count - way) > 1.6
                or abs(made.frequency - frequency) > 2.1 * slope * step / 1e9 + 0.2
            ):
                wrong.append(f"{now}: {made.count}, {made.frequency:.1f}, not {way:.2f}, {frequency:.1f}")
                way, frequency = float(made.count), made.frequency
        if met and made.frequency:
            equal(ctx, "when the count comes, ns", due or 0, met - step / 2, "PTO-001", within=step)
        way += 0.2 * (made.count - way)
    equal(ctx, f"instants that differ: {wrong[:2]}", len(wrong), 0, "PTO-001", within=6)
    del rest_until
    slow = PulseGenerator()
    slow.steer(0, 0.0999, 1e6)
    slow.advance(10**12)
    same(ctx, "below 0.1 Hz there is nothing", slow.count, 0)
    slow.steer(10**12, 0.1, 1e6)
    slow.advance(10**12 + 21 * 10**9)
    same(ctx, "from 0.1 Hz on there is", slow.count, 2)
    same(ctx, "a count behind it never comes", slow.time_of(-5), None)
    same(ctx, "the present one is there", slow.time_of(2), 10**12 + 21 * 10**9)


# -- formats ---------------------------------------------------------------------------------------------


@CAMPAIGN.case("formats", requirements=("PD-174", "PD-188"))
def formats(ctx: CaseContext) -> None:
    """Resolutions of both profiles and those that fit by themselves, and P979 of up to three encoders."""
    old = EncoderFormat.profile_4_0(periods=8192, revolutions=4096)
    same(ctx, "4.0: shifts", (old.shift_xist1, old.shift_xist2), (32 - 25, 0), "PD-174")
    same(
        ctx, "4.0", (old.absolute, old.load_absolute, old.steps, old.counts), (True, True, 8192 * 4096, 8192)
    )
    new = EncoderFormat.profile_4_1(periods=8192, revolutions=4096)
    same(ctx, "4.1: shifts", (new.shift_xist1, new.shift_xist2), (0, 0), "PD-174")
    same(ctx, "4.1 without turns", EncoderFormat.profile_4_1(periods=100, revolutions=0).load_absolute, False)
    equal(ctx, "32 bits fit", not refused(EncoderFormat.profile_4_0, periods=1 << 16, revolutions=1 << 16), 1)
    equal(
        ctx,
        "33 bits do not",
        bool(refused(EncoderFormat.profile_4_0, periods=1 << 17, revolutions=1 << 16)),
        1,
    )
    for periods, turns, shifts in (
        (2048, 4096, (11, 9)),
        (2048, 0, (11, 9)),
        (1 << 20, 4096, (11, 0)),
        ((1 << 20) + 1, 4096, (10, None)),
        (1 << 25, 1, (6, 7)),
        (1, 0, (11, 9)),
    ):
        if shifts[1] is None:
            equal(ctx, f"{periods} x {turns}", bool(refused(fitted_format, periods=periods, turns=turns)), 1)
            continue
        one = fitted_format(periods, turns)
        same(ctx, f"{periods} x {turns}", (one.shift_xist1, one.shift_xist2), shifts)
        same(ctx, "absolute", (one.absolute, one.load_absolute), (turns > 0, turns > 0))
    given = fitted_format(100, 2, fine_xist1=3, fine_xist2=1, counter_bits=16, wide=True)
    found = (given.shift_xist1, given.shift_xist2, given.counter_bits, given.wide, given.counts)
    same(ctx, "as given", found, (3, 1, 16, True, 800))
    scale = fitted_format(5000, 1, grid_nm=20_000)
    row = p979(given, scale)
    same(ctx, "P979, head", (len(row), row[0] >> 12, row[0] >> 8 & 0xF), (31, 5, 2), "PD-188")
    same(ctx, "P979, first", row[2:6], (100, 3, 1, 2), "PD-188")
    same(ctx, "P979, scale", (row[11] & 1, row[12], row[15]), (1, 20_000, 1), "PD-188")
    same(ctx, "P979, kinds", (row[1] >> 31, row[1] & 1, row[1] >> 1 & 1), (1, 0, 1), "PD-188")
    same(ctx, "P979, nothing behind", row[21:], (0,) * 10, "PD-188")
    for count, fits in ((0, 0), (1, 1), (3, 1), (4, 0)):
        equal(ctx, f"P979 of {count} encoders", not refused(lambda c=count: p979(*[given] * c)), fits)
    for name, low, high in (
        ("periods", 1, 1 << 31),
        ("interpolation_bits", 0, 31),
        ("shift_xist1", 0, 31),
        ("revolutions", 0, 65_536),
        ("counter_bits", 8, 32),
    ):
        base = {"periods": 2, "shift_xist2": 0}
        for value, fits in ((low - 1, 0), (low, 1), (high, 1), (high + 1, 0)):
            equal(ctx, f"{name} = {value}", not refused(EncoderFormat, **(base | {name: value})), fits)
