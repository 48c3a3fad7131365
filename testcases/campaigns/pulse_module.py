"""A pulse module (TM PTO) word by word: its states and ramps, terminals, captures, errors with their codes,
sign of life, its four forms of pulses.
"""

from __future__ import annotations

from typing import Any, Final

from hil.campaign import Campaign, CaseContext
from testcases.campaigns._pto_rig import RUN, S1, S2, S3, S4, S5A, S5B, SEQUENCE, Rig
from testcases.campaigns.support import equal, same

CAMPAIGN: Final = Campaign(
    "pulse module", controller="", tags=("telegram",), bench="testcases.campaigns.can_bus:BENCH"
)
MAXIMUM: Final = 0x4000
ACKNOWLEDGE: Final = 0x8000


def moving(share: float = 1.0, **config: Any) -> Rig:
    """Return a module in S4 at a share of 10 kHz."""
    config.setdefault("ramp_stop_ms", 1)
    rig = Rig(**config)
    rig.start(round(MAXIMUM * share), seconds=0.1)
    return rig


@CAMPAIGN.case("pulses", requirements=("PTO-001",))
def pulses(ctx: CaseContext) -> None:
    """Both terminals carry as many edges as the count says, in each form and direction."""
    for kind in ("pulse_direction", "up_down", "ab", "ab_fourfold"):
        for direction in (1, -1):
            rig = moving(0.02 * direction, signals=kind)
            generator = rig.channel.generator
            edges = {0: 0, 1: 0}
            before, begin = generator.levels(kind), rig.count
            for _ in range(4_000):
                rig.scheduler.run_for(25_000)
                generator.advance(rig.scheduler.now)
                now = generator.levels(kind)
                for terminal in (0, 1):
                    edges[terminal] += now[terminal] and not before[terminal]
                before = now
            counted = rig.count - begin
            equal(ctx, f"pulses of {kind}", counted, direction * 20, "PTO-001", within=1)
            if kind == "pulse_direction":
                wanted, level = (abs(counted), 0), direction < 0
                equal(ctx, "level of the direction", before[1], level, "PTO-001")
            elif kind == "up_down":
                wanted = (abs(counted), 0) if direction > 0 else (0, abs(counted))
            else:
                wanted = (abs(counted) / (4 if kind == "ab_fourfold" else 1),) * 2
            for terminal in (0, 1):
                equal(
                    ctx,
                    f"edges of terminal {terminal}",
                    edges[terminal],
                    wanted[terminal],
                    "PTO-001",
                    within=1,
                )


@CAMPAIGN.case("terminals", requirements=("PTO-002", "PTO-003"))
def terminals(ctx: CaseContext) -> None:
    """ED follows the states; DR keeps the channel out of S4 while it is low, and leads out of it, if it lasts
    longer than the filter.
    """
    rig = Rig(use_ed=True, use_dr=True, ramp_stop_ms=1, input_delay_ms=0.8)
    levels = []
    for word in SEQUENCE:
        rig(word)
        levels.append(rig.channel.ed)
    same(ctx, "ED", levels, [False, False, False, True], "PTO-002")
    same(ctx, "state without DR", rig(seconds=0.2), S3, "PTO-003")
    equal(ctx, "frequency", rig.hertz, 0, "PTO-003")
    rig.channel.drive_input("DR", True)
    same(ctx, "state with DR", rig(nsoll=MAXIMUM), S4, "PTO-003")
    rig(seconds=0.1)
    for low_us, stays in ((700, True), (900, False)):
        rig.channel.drive_input("DR", False)
        rig.scheduler.run_for(low_us * 1000)
        rig.channel.drive_input("DR", True)
        rig()
        same(ctx, f"state after {low_us} us", rig.channel.state is S4, stays, "PTO-003")
    equal(ctx, "ZSW1 bit 2 follows", bool(rig.zsw1 & 4), rig.channel.state is S4)


CAPTURES: Final = (
    ("RS", True, (0x0011, 0x0001, 0x0021), 0x0001, 0x0010),
    ("MI", True, (0x0091, 0x0081, 0x00A1), 0x0001, 0x0010),
    ("MI", False, (0x0092, 0x0082, 0x00A2), 0x0002, 0x0020),
)


@CAMPAIGN.case("captures", requirements=("PTO-004", "PTO-005", "PTO-011", "PTO-081"))
def captures(ctx: CaseContext) -> None:
    """The mode chooses the terminal, the function its edge; the value is the pulse count of the edge."""
    for direction in (1, -1):
        for terminal, level, words, active, shown in CAPTURES:
            rig = moving(direction, use_rs=True, use_mi=True, input_delay_ms=0.004)
            rig.channel.drive_input(terminal, not level)
            rig()
            rig(g1=words[0])
            equal(ctx, f"active at {terminal}", rig.got["G1_ZSW"] & 0x000F, active, "PTO-081")
            place = rig.count + 61 * direction
            rig.channel.at_count(place, lambda rig=rig, t=terminal, v=level: rig.channel.drive_input(t, v))
            rig(cycles=3)
            equal(ctx, "active afterwards", rig.got["G1_ZSW"] & 0x000F, 0, "PTO-081")
            rig(g1=words[1])
            rig(g1=words[2])
            equal(ctx, "shown", rig.got["G1_ZSW"] & 0x00F0, shown, "PTO-081")
            value = rig.got["G1_XIST2"]
            value -= (value >= 1 << 31) << 32
            equal(ctx, "value", value, place, "PTO-011")
            rig(g1=0)
            equal(ctx, "G1_ZSW in the end", rig.got["G1_ZSW"] & 0xFF, 0, "PTO-081")


WITHDRAWN: Final = (
    ("PTO-045", 0, S5A, True, 1.0, S2, False),
    ("PTO-047", 2, S5B, True, 0.5, S1, False),
    ("PTO-048", 3, S3, False, 0.0, S3, False),
    ("PTO-049", 4, S4, False, 0.0, S4, True),
    ("PTO-051", 6, S4, True, 1.0, S4, True),
    ("PTO-054", 10, S1, False, 0.0, S1, False),
)
"""Identifier, bit of STW1, state one cycle later, pulses then, share of the ramp, state and ED in the end."""


@CAMPAIGN.case("stops", requirements=tuple(row[0] for row in WITHDRAWN))
def stops(ctx: CaseContext) -> None:
    """Without each of its bits the channel stops as the bit says: state, ramp, enable."""
    for direction in (1, -1):
        for identifier, bit, state, goes_on, ramp, end, enabled in WITHDRAWN:
            rig = Rig(use_ed=True, ramp_stop_ms=400, quick_stop_ms=200)
            rig.start(round(MAXIMUM * 0.5) * direction, seconds=0.4)
            equal(ctx, "frequency", rig.hertz, 5_000 * direction, "PTO-297", within=1)
            same(ctx, f"state without bit {bit}", rig(RUN & ~(1 << bit)), state, identifier)
            equal(ctx, "pulses", bool(rig.hertz), goes_on, identifier)
            began = rig.scheduler.now
            while rig.hertz and rig.scheduler.now - began < 10**9:
                rig()
            took = (rig.scheduler.now - began) / 1e9
            equal(ctx, "time of the ramp, s", took, ramp * 0.4 * 0.5, identifier, within=0.006)
            rig()
            same(
                ctx,
                "state and ED in the end",
                (rig.channel.state, rig.channel.ed),
                (end, enabled),
                identifier,
            )


@CAMPAIGN.case("meaningless", requirements=("PTO-082", "PTO-132"))
def meaningless(ctx: CaseContext) -> None:
    """STW1 5, 8, 9, 11 to 15 and G1_STW 8 to 10 change nothing in any state."""
    for bit in (5, 8, 9, 11, 12, 13, 14, 15):
        plain, other = Rig(ramp_stop_ms=1), Rig(ramp_stop_ms=1)
        for word in (*SEQUENCE, RUN, 0x045E, 0x0456, 0x0457, RUN, 0x045B, 0x0456):
            plain(word, nsoll=0x1000, cycles=3)
            other(word | 1 << bit, nsoll=0x1000, cycles=3)
            same(ctx, f"words with bit {bit} of STW1", other.got, plain.got, "PTO-132")
    for bit in (8, 9, 10):
        plain, other = moving(use_rs=True), moving(use_rs=True)
        for word in (0, 0x0011, 0x0011, 0x0031, 0x0091, 0):
            plain(g1=word)
            other(g1=word | 1 << bit)
            same(ctx, f"words with bit {bit} of G1_STW", other.got, plain.got, "PTO-082")


@CAMPAIGN.case(
    "errors", requirements=("PTO-052", "PTO-080", "PTO-087", "PTO-115", "PTO-118", "PTO-195", "PTO-196")
)
def errors(ctx: CaseContext) -> None:
    """Unknown commands, an absolute value, a short circuit: code, acknowledgement, and its edge."""
    for command, active in ((0, 0), (1, 1), (2, 0), (3, 0), (4, -1), (5, -1), (6, -1), (7, -1)):
        rig = moving(use_rs=True)
        rig(g1=0x0001 | command << 4)
        wanted = (0x8000, 0xF01) if active < 0 else (active, 0)
        same(ctx, f"command {command}", (rig.got["G1_ZSW"], rig.got["G1_XIST2"]), wanted, "PTO-080")
        if active == 1:
            rig(g1=0x0031)
            equal(ctx, "G1_ZSW after a cancellation", rig.got["G1_ZSW"], 0, "PTO-080")
    rig = moving()
    for word, wanted in (
        (0x2000, (0x8000, 8)),
        (0, (0x8000, 8)),
        (ACKNOWLEDGE, (0x0800, 0)),
        (0, (0, 0)),
        (0x4000, (0x4000, 0)),
    ):
        rig(g1=word, cycles=3)
        same(ctx, f"G1 with {word:04X}h", (rig.got["G1_ZSW"], rig.got["G1_XIST2"]), wanted, "PTO-087")
    rig = Rig()
    rig.start()
    rig.module.short_circuit(0, True)
    rig(RUN | 0x80)
    equal(ctx, "fault", rig.zsw1 & 8, 8, "PTO-052")
    rig.module.short_circuit(0, False)
    for word, fault in ((RUN | 0x80, 8), (RUN, 8), (RUN | 0x80, 0)):
        rig(word, cycles=3)
        equal(ctx, f"fault with {word:04X}h", rig.zsw1 & 8, fault, "PTO-052")


@CAMPAIGN.case("captures/again", requirements=("PTO-249",))
def captured_again(ctx: CaseContext) -> None:
    """A function that is started again forgets the value that it has found and that nobody has read."""
    for direction in (1, -1):
        rig = moving(0.2 * direction, use_mi=True, input_delay_ms=0.004)
        rig.channel.drive_input("MI", False)
        rig(cycles=2)
        for latched in (True, False):
            rig(g1=0x0091, cycles=2)
            equal(ctx, "active", rig.got["G1_ZSW"] & 0x000F, 1, "PTO-249")
            if latched:
                rig.channel.drive_input("MI", True)
                rig(cycles=3)
                equal(ctx, "active behind the edge", rig.got["G1_ZSW"] & 0x000F, 0, "PTO-249")
                rig.channel.drive_input("MI", False)
                rig(g1=0x0081, cycles=2)
        rig(g1=0x0081, cycles=2)
        rig(g1=0x00A1, cycles=2)
        equal(ctx, "values shown", rig.got["G1_ZSW"] & 0x00F0, 0, "PTO-249")


@CAMPAIGN.case("sign-of-life", requirements=("PTO-038", "PTO-127", "PTO-196"))
def sign_of_life(ctx: CaseContext) -> None:
    """Left at 0 it is not watched; from then on it has to count 1 to 15; a telegram that stays away stops the
    channel.
    """
    rig = moving()
    rig(cycles=20)
    equal(ctx, "code at 0", rig.code, 0, "PTO-127")
    for sign in range(1, 33):
        rig.stw2 = ((sign - 1) % 15 + 1) << 12
        rig()
        equal(ctx, "code while it counts", rig.code, 0, "PTO-038")
    # Errors that do not come one after the other are tolerated, however many there are.
    for sign in range(3, 13):
        for _ in range(2):
            rig.stw2 = sign << 12
            rig()
            equal(ctx, "code with every second one wrong", rig.code, 0, "PTO-127")
    rig(cycles=3)
    equal(ctx, "code when it stands", rig.code, 0xF02, "PTO-127")
    same(ctx, "state and frequency", (rig.channel.state, round(rig.hertz)), (S4, 10_000), "PTO-127")
    for cycles, stops in ((2, False), (8, True)):
        rig = moving(watchdog_cycles=3)
        rig(cycles=cycles, quiet=True)
        equal(ctx, f"stops after {cycles} cycles without telegrams", rig.channel.state is not S4, stops)


@CAMPAIGN.case("speed", requirements=("PTO-297", "PTO-298"))
def speed(ctx: CaseContext) -> None:
    """The frequency follows the setpoint within its ramp; NIST_A and the count show it, both ways."""
    for share in (0.25, 1.0, 1.5, -0.5, -1.0):
        rig = Rig(ramp_stop_ms=200, maximum_speed=6000.0)
        rig.start(round(MAXIMUM * share), seconds=0.6)
        equal(ctx, f"frequency at {share}", rig.hertz, 10_000 * share, "PTO-297", within=2)
        value = rig.got["NIST_A"]
        value -= (value >= 0x8000) << 16
        equal(ctx, "NIST_A", value, MAXIMUM * share, "PTO-297", within=4)
        before = rig.count
        rig(seconds=0.2)
        equal(ctx, "pulses in 0.2 s", rig.count - before, 2_000 * share, "PTO-297", within=2)
        counted = rig.got["G1_XIST1"]
        counted -= (counted >= 1 << 31) << 32
        equal(ctx, "G1_XIST1", counted, rig.count, "PTO-011", within=abs(45 * share) + 1)


@CAMPAIGN.case("cut-off-on-a-ramp")
def cut_off(ctx: CaseContext) -> None:
    """OFF2 in the middle of a ramp ends the pulses at once and for good: up, down, to the other side."""
    for direction in (1, -1):
        for first, second in ((0.5, None), (0.8, 0.2), (0.5, -0.5)):
            rig = Rig(ramp_stop_ms=400)
            rig.start(round(MAXIMUM * first) * direction, seconds=0.06)
            if second is not None:
                rig(nsoll=round(MAXIMUM * second) * direction, seconds=0.12)
            moved = rig.hertz
            equal(ctx, "moves before OFF2", moved != 0.0, 1)
            rig(RUN & ~2)
            counted = rig.count
            rig(cycles=30)
            equal(ctx, "frequency after OFF2, Hz", rig.hertz, 0.0, "PTO-291")
            equal(ctx, "pulses after OFF2", rig.count - counted, 0.0, "PTO-291")
