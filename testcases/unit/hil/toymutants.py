"""A product of a few lines, a campaign for it, and defects of every fate: for the tests of defect seeding."""

import os
import signal

from hil.campaign import Campaign
from hil.mutants import Edit, Mutant

BENCH = "testcases.unit.hil.toybench:BENCH"
CAMPAIGN = Campaign("toy product", bench=BENCH)
RED = Campaign("red", bench=BENCH)
BORDERS = Campaign("borders", bench=BENCH)


class Brake:
    """A product."""

    def __init__(self):
        self.closed = True

    @property
    def holds(self):
        """Whether it holds."""
        return self.closed

    @staticmethod
    def slope(velocity, time_s):
        """Return a deceleration."""
        return velocity / time_s

    def open(self):
        """Open it."""
        self.closed = False
        log = [name for name in ("open",) if not self.closed]
        return len(log)


class SafeBrake(Brake):
    """A product with a base."""

    def open(self):
        """Open it, once."""
        if not self.closed:
            return 0
        else:  # noqa: RET505 - an `else` with a change in it is what is tried
            return super().open()


def count(steps):
    """Count steps."""
    done = 0
    while done < steps:
        done += 1
    return done


def scaled(factor):
    """Return a function with a variable from outside."""

    def scale(value):
        return value * factor

    return scale


twice = scaled(2)


def hour():
    """Return minutes."""
    return 60


def never_called():
    """Do what no case asks for."""
    return 1


@CAMPAIGN.case("brake")
def brake(ctx):
    """A brake opens."""
    one = SafeBrake()
    ctx.measure("opened", one.open(), low=1, high=1)
    ctx.measure("opened again", one.open(), low=0, high=0)
    ctx.measure("holds", one.holds, low=0, high=0)


@CAMPAIGN.case("slope")
def slope(ctx):
    """A deceleration is right."""
    ctx.measure("slope", Brake.slope(4.0, 2.0), low=2.0, high=2.0)
    ctx.run_for(hour() / 1000.0)


@CAMPAIGN.case("count")
def counting(ctx):
    """Steps are counted."""
    ctx.measure("steps", count(3), low=3, high=3)
    ctx.measure("twice", twice(3), low=6, high=6)


@RED.case("red")
def red(ctx):
    """A case that fails without any defect."""
    ctx.measure("slope", Brake.slope(4.0, 2.0), low=3.0)


def is_fast(speed):
    """Return whether a speed is high."""
    return speed > 4.0


@BORDERS.case("far")
def far(ctx):
    """A speed far from the border, and a brake: the case that comes to the most."""
    SafeBrake().open()
    ctx.measure("fast", is_fast(5.0), low=1, high=1)


@BORDERS.case("near")
def near(ctx):
    """The border itself."""
    ctx.measure("fast", is_fast(4.0), low=0, high=0)


def kill():
    """End this process as a defect in native code does."""
    os.kill(os.getpid(), signal.SIGKILL)


def deaf():
    """Hang, deaf to the limit that a case sets itself."""
    signal.signal(signal.SIGPROF, signal.SIG_IGN)
    while True:
        pass


def mutant(name, target, old, new, **more):
    return Mutant(
        name, "machine", f"the defect {name}", (Edit(f"{__name__}:{target}", old, new),), ("STP-559",), **more
    )


CAUGHT = mutant(
    "slope-inverted", "Brake.slope", "velocity / time_s", "time_s / velocity", likely=("toy-product/slope",)
)
STAYS_CLOSED = mutant("stays-closed", "Brake.open", "self.closed = False", "self.closed = True")
BRANCH = mutant("branch", "SafeBrake.open", "return super().open()", "return super().open() + 1")
PROPERTY = mutant("property", "Brake.holds", "return self.closed", "return not self.closed")
CLOSURE = mutant("closure", "twice", "value * factor", "value + factor")
RAISES = mutant("raises", "count", "done += 1", "done += missing")
SURVIVES = mutant("survives", "Brake.open", '("open",)', '("opened",)')
SHOWN = mutant("shown", "hour", "60", "61")
EXPLAINED = mutant(
    "explained", "Brake.open", '("open",)', '("opens",)', explained="what is logged is nobody's business"
)
HANGS = mutant("hangs", "count", "done += 1", "done += 0", likely=("toy-product/count",))
DEAF = mutant("deaf", "count", "done += 1", "deaf()", likely=("toy-product/count",))
CRASHES = mutant("crashes", "count", "done += 1", "kill()", likely=("toy-product/count",))
UNREACHED = mutant("unreached", "never_called", "return 1", "return 2")
BORDER = mutant("border", "is_fast", "speed > 4.0", "speed >= 4.0")
NO_BORDER = mutant("no-border", "is_fast", "speed > 4.0", "speed > 4.0 or speed == 3.0")
CHANGED = mutant("changed", "count", "done += 7", "done += 8")

MUTANTS = [CAUGHT, STAYS_CLOSED, BRANCH, PROPERTY, CLOSURE, RAISES]
FATES = [CAUGHT, SURVIVES, EXPLAINED, HANGS, DEAF, CRASHES, UNREACHED]
SURVIVORS = [SURVIVES, SHOWN]
FEW = [CAUGHT, STAYS_CLOSED, SURVIVES]
AT_BORDERS = [BORDER, NO_BORDER]
CHANGED_ONES = [CHANGED]
NO_LIST = CAUGHT
