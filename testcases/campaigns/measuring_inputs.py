"""Measuring inputs at the probes of a drive: which edges count, where they are, and how a measurement ends.

A workpiece lies on the way of the axis. What a measurement finds is computed from its ends and the way that
the axis goes, whatever the mode, the direction and the place at which it begins.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any, Final

from hil.bench import BenchFile, load_bench
from hil.campaign import Campaign, CaseContext
from hil.expect import no_alarm
from testcases.campaigns._reactions import cycles
from testcases.campaigns.support import axis_name, drive_name, enable, equal

_HERE: Final = "testcases.campaigns.measuring_inputs"
FROM_MM: Final = 20.0
TO_MM: Final = 27.0
BEYOND_MM: Final = 35.0
CORRECTION_MS: Final = 7.0
SPEED: Final = 110.0
RISES: Final = True
FALLS: Final = False


def _bench(name: str) -> BenchFile:
    return load_bench(name).configured(
        {
            "drive": {"drive1": {"switches": {"probe1_from_mm": FROM_MM, "probe1_to_mm": TO_MM}}},
            "measuring_input": {
                "mark": {"of": "axis1"},
                "central": {"of": "axis1", "kind": "central"},
                "late": {"of": "axis1", "kind": "central", "correction_ms": CORRECTION_MS},
            },
        }
    )


REFERENCE: Final = _bench("reference")
PROFIDRIVE: Final = _bench("profidrive")
CAMPAIGN: Final = Campaign("measured workpieces", tags=("measuring",), bench=f"{_HERE}:REFERENCE")
OF_PROFIDRIVE: Final = Campaign(
    "measured workpieces behind PROFIdrive", tags=("measuring",), bench=f"{_HERE}:PROFIDRIVE"
)


def edges_of(places: tuple[float, ...]) -> list[tuple[bool, float]]:
    """Return the edges that a way over some places meets, in order: whether it rises, and where, mm."""
    found = []
    for here, there in pairwise(places):
        ends = [(end, (end == FROM_MM) == (there > here)) for end in (FROM_MM, TO_MM)]
        passed = [(rises, end) for end, rises in ends if min(here, there) < end < max(here, there)]
        found += passed if there > here else passed[::-1]
    return found


def measured(mode: int, places: tuple[float, ...]) -> tuple[list[float], bool]:
    """Return what `MC_MeasuringInput` finds on a way, mm, and whether it is done at its end."""
    wanted = {0: [RISES], 1: [FALLS], 3: [RISES, FALLS], 4: [FALLS, RISES]}.get(mode)
    many = 2 if wanted is None else len(wanted)
    values: list[float] = []
    for rises, place in edges_of(places):
        if len(values) < many and (wanted is None or rises is wanted[len(values)]):
            values.append(place)
    return values, len(values) == many


class _Stage:
    """An enabled axis whose positions are those of the machine."""

    def __init__(self, ctx: CaseContext) -> None:
        self.ctx = ctx
        enable(ctx)
        machine = float(ctx.trace()[f"{drive_name(ctx)}.position"].values[-1]) * 1000.0
        ctx.wait_until(ctx.axis.home(machine).done, 2.0, "positions are those of the machine")

    def go(self, place: float, speed: float = SPEED) -> None:
        """Go to a place, mm."""
        dynamics = {"Acceleration": 2000.0, "Deceleration": 2000.0, "Jerk": 0.0}
        job = self.ctx.axis.move_absolute(place, Velocity=speed, **dynamics)
        self.ctx.wait_until(job.done, 2.0, f"the axis is at {place:g} mm")

    def input(self, name: str = "mark") -> Any:
        """Return a measuring input."""
        return self.ctx.bench.measuring_input(name)


def _near(ctx: CaseContext, what: str, value: float, wanted: float, *ids: str) -> None:
    equal(ctx, what, value, wanted, *ids, within=0.02)


def _found(job: Any) -> list[float]:
    return [float(job.MeasuredValue1), float(job.MeasuredValue2)]


_WAYS: Final = {
    "before": (0.0, BEYOND_MM, 0.0),
    "within": (24.0, BEYOND_MM, 0.0),
    "behind": (BEYOND_MM, 0.0, BEYOND_MM),
}


def edges(ctx: CaseContext, start: str) -> None:
    """Each mode takes its edges there and back, to the increment, and is done with the last one."""
    stage, places = _Stage(ctx), _WAYS[start]
    one = stage.input()
    for mode in range(5):
        stage.go(places[0])
        job = one.measure(mode)
        ctx.run_for(cycles(ctx, 6))
        equal(ctx, f"mode {mode}: Status while it waits", one.var("Status"), 1.0)
        equal(ctx, f"mode {mode}: Busy while it waits", job.Busy, 1.0)
        equal(ctx, f"mode {mode}: InputState", one.var("InputState"), float(FROM_MM < places[0] < TO_MM))
        values: list[float] = []
        for place in places[1:]:
            stage.go(place)
        ctx.run_for(cycles(ctx, 2))
        values, done = measured(mode, places)
        equal(ctx, f"mode {mode}: Done", job.Done, float(done), "MC-053")
        equal(ctx, f"mode {mode}: Status in the end", one.var("Status"), 2.0 if values else 1.0)
        for number, value in enumerate(values, 1):
            _near(ctx, f"mode {mode}: MeasuredValue{number}", _found(job)[number - 1], value, "CFG-200")
            _near(ctx, f"mode {mode}: the same in the data block", _block(one, number), value)
        equal(
            ctx, f"mode {mode}: values that are not measured", sum(map(bool, _found(job)[len(values) :])), 0.0
        )
        if not done:
            ended = one.abort()
            ctx.run_for(cycles(ctx, 2))
            equal(ctx, f"mode {mode}: aborted", job.CommandAborted and ended.Done, 1.0)
    ctx.expect(no_alarm(axis=axis_name(ctx)))


def _block(one: Any, number: int) -> float:
    return float(one.var(f"MeasuredValues.MeasuredValue{number}"))


def cyclic(ctx: CaseContext) -> None:
    """Every edge of the mode is measured and counted, until the job is aborted."""
    stage = _Stage(ctx)
    one = stage.input("central")
    before = [one.var(f"MeasuredValues.MeasuredValue{number}Counter") for number in (1, 2)]
    all_counts = [0, 0]
    for mode in (0, 1, 2):
        stage.go(0.0)
        job = one.measure_cyclic(mode)
        ctx.run_for(cycles(ctx, 6))
        places = (0.0, BEYOND_MM, 0.0, 24.0)
        for place in places[1:]:
            stage.go(place)
        ctx.run_for(cycles(ctx, 3))
        taken = [(r, p) for r, p in edges_of(places) if mode == 2 or r is (mode == 0)]
        columns = [[p for r, p in taken if mode < 2 or r], [p for r, p in taken if mode == 2 and not r]]
        for number, column in enumerate(columns, 1):
            count = float(getattr(job, f"MeasuredValue{number}Counter"))
            equal(ctx, f"mode {mode}: MeasuredValue{number}Counter", count, len(column))
            last = column[-1] if column else 0.0
            _near(ctx, f"mode {mode}: MeasuredValue{number}", _found(job)[number - 1], last)
            all_counts[number - 1] += len(column)
            shown = one.var(f"MeasuredValues.MeasuredValue{number}Counter") - before[number - 1]
            equal(ctx, f"mode {mode}: counter {number} of the data block", shown, all_counts[number - 1])
        equal(ctx, f"mode {mode}: lost edges", job.LostEdgeCounter1 + job.LostEdgeCounter2, 0.0)
        equal(ctx, f"mode {mode}: Busy", job.Busy and not job.Done, 1.0)
        one.abort()
        ctx.run_for(cycles(ctx, 2))
        equal(ctx, f"mode {mode}: CommandAborted", job.CommandAborted, 1.0)
        equal(ctx, f"mode {mode}: Status after the abort", one.var("Status"), 0.0)
        stage.go(0.0)
    ctx.expect(no_alarm(axis=axis_name(ctx)))


def window(ctx: CaseContext) -> None:
    """Only edges within the range count, whichever end is named first; an axis that leaves it without one
    ends the job.
    """
    stage = _Stage(ctx)
    one = stage.input()
    for start, end, values in (
        (FROM_MM + 0.1, TO_MM + 0.1, [TO_MM]),
        (TO_MM + 0.1, FROM_MM + 0.1, [TO_MM]),
        (FROM_MM - 0.1, TO_MM - 0.1, [FROM_MM]),
        (FROM_MM - 2.0, FROM_MM + 0.1, [FROM_MM]),
    ):
        stage.go(0.0)
        job = one.measure(2, MeasuringRange=True, StartPosition=start, EndPosition=end)
        stage.go(BEYOND_MM)
        ctx.run_for(cycles(ctx, 2))
        name = f"from {start:g} to {end:g}"
        _near(ctx, f"{name}: MeasuredValue1", job.MeasuredValue1, values[0])
        equal(ctx, f"{name}: ErrorID of a range that is left too early", job.ErrorID, 0x8001)
        equal(ctx, f"{name}: alarm", one.var("ErrorDetail.Number"), 752.0)
        equal(ctx, f"{name}: Status", one.var("Status"), 3.0)
        equal(ctx, f"{name}: StatusWord.X1", one.var("StatusWord.X1"), 1.0)
        ctx.wait_until(one.reset().done, 2.0, "the alarm is acknowledged")
        equal(ctx, f"{name}: ErrorWord afterwards", one.var("ErrorWord"), 0.0)
    stage.go(0.0)
    job = one.measure(3, MeasuringRange=True, StartPosition=FROM_MM - 1.0, EndPosition=TO_MM + 1.0)
    stage.go(BEYOND_MM)
    ctx.run_for(cycles(ctx, 2))
    equal(ctx, "Done with both ends within the range", job.Done, 1.0)
    for number, value in enumerate((FROM_MM, TO_MM)):
        _near(ctx, f"MeasuredValue{number + 1} within the range", _found(job)[number], value)


def correction(ctx: CaseContext) -> None:
    """A signal that comes later than its edge is moved back by the way of that time, in either direction."""
    stage = _Stage(ctx)
    one = stage.input("late")
    for begin, end, place in ((0.0, 50.0, FROM_MM), (50.0, 0.0, TO_MM)):
        stage.go(begin)
        job = one.measure(0)
        for_speed = ctx.axis.move_velocity(SPEED if end > begin else -SPEED, Acceleration=2000.0, Jerk=0.0)
        ctx.wait_until(job.done, 2.0, "the edge is measured")
        equal(ctx, "constant velocity", for_speed.InVelocity, 1.0)
        way = SPEED * CORRECTION_MS * 1e-3 * (1.0 if end > begin else -1.0)
        equal(ctx, f"from {begin:g}: MeasuredValue1", job.MeasuredValue1, place - way, within=0.1)
        ctx.wait_until(ctx.axis.halt().done, 2.0, "the axis stands")


def ends(ctx: CaseContext) -> None:
    """What ends a measurement, and what refuses one, with its ErrorID."""
    stage = _Stage(ctx)
    one, central = stage.input(), stage.input("central")
    for name, refused in (
        ("mode 5", one.measure(5)),
        ("mode -1", one.measure(-1)),
        ("cyclic mode 3", central.measure_cyclic(3)),
    ):
        ctx.run_for(cycles(ctx, 2))
        equal(ctx, f"{name}: ErrorID", refused.ErrorID, 0x800A, "MC-007")
    wrong = one.measure(0, MeasuringRange=True, StartPosition=float("nan"), EndPosition=1.0)
    ctx.run_for(cycles(ctx, 2))
    equal(ctx, "range without a number: ErrorID", wrong.ErrorID, 0x8009)
    first, second = one.measure(0), None
    ctx.run_for(cycles(ctx, 2))
    second = one.measure(1)
    ctx.run_for(cycles(ctx, 2))
    equal(ctx, "a second job: the first is aborted", first.CommandAborted, 1.0, "OVR-043")
    equal(ctx, "the second measures", second.Busy, 1.0, "OVR-043")
    cyclic_one = one.measure_cyclic(0)
    ctx.run_for(cycles(ctx, 2))
    equal(ctx, "cyclic by telegram: ErrorID", cyclic_one.ErrorID, 0x8001)
    equal(ctx, "cyclic by telegram: alarm", one.var("ErrorDetail.Number"), 755.0)
    restart = one.reset(restart=True)
    ctx.run_for(cycles(ctx, 1))
    equal(ctx, "StatusWord.X2 while it restarts", one.var("StatusWord.X2"), 1.0)
    late = one.measure(0)
    ctx.wait_until(restart.done, 2.0, "the measuring input has restarted")
    equal(ctx, "a job during the restart: ErrorID", late.ErrorID, 0x800D)
    equal(ctx, "the running job: ErrorID", second.ErrorID, 0x800D, "MC-638")
    for path in ("Status", "ErrorWord", "ErrorDetail.Number", "MeasuredValues.MeasuredValue1"):
        equal(ctx, f"{path} after the restart", one.var(path), 0.0)
    equal(ctx, "StatusWord after the restart", one.var("StatusWord"), 0x21)
    running = one.measure(0)
    ctx.run_for(cycles(ctx, 2))
    home = ctx.axis.home(0.0, mode=2)
    ctx.run_for(cycles(ctx, 3))
    equal(ctx, "passive homing: ErrorID", running.ErrorID, 0x80A3, "OVR-041", "SYN-284")
    equal(ctx, "passive homing: Status", one.var("Status"), 3.0)
    late = one.measure(0)
    ctx.run_for(cycles(ctx, 2))
    equal(ctx, "while it is homed: ErrorID", late.ErrorID, 0x80A3, "OVR-041")
    home.set(Execute=False)
    ctx.axis.power(False)
    ctx.run_for(0.3)
    running = one.measure(0)
    ctx.run_for(cycles(ctx, 2))
    equal(ctx, "disabled: Busy", running.Busy, 1.0)
    ctx.bench.controller.stop()
    ctx.run_for(0.5)
    equal(ctx, "Status in STOP of the controller", one.var("Status"), 0.0)


for _campaign in (CAMPAIGN, OF_PROFIDRIVE):
    _campaign.product(
        "edges/{start}",
        parameters={"start": tuple(_WAYS)},
        title="all modes, beginning {start} the workpiece",
        requirements=("CFG-200",),
    )(edges)
    _campaign.case("cyclic", requirements=("CFG-200",))(cyclic)
    _campaign.case("window")(window)
    _campaign.case("correction")(correction)
    _campaign.case("ends", requirements=("OVR-041", "OVR-043", "SYN-284", "MC-638"))(ends)
