"""Cams as a program sees them: laws of motion by their characteristic values, gaps, reading, copying."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from math import asin, nan, pi, sin, sqrt
from typing import Any, Final

from hil.bench import BenchFile
from hil.campaign import Campaign, CaseContext
from motion.kernel.cams import End, Point, Segment, transition
from motion.kernel.cams.elements import inverse_sine, polynomial, sine
from testcases.campaigns.support import equal

_LAWS: Final[dict[str, tuple[float, float, float, float]]] = {
    # greatest velocity, acceleration, deceleration, value at a quarter of the way (VDI 2143)
    "straight_line": (1.0, 0.0, 0.0, 0.25),
    "quadratic_parabola": (2.0, 4.0, 4.0, 0.125),
    "simple_sine": (pi / 2, pi**2 / 2, pi**2 / 2, 0.146447),
    "polynomial_3": (1.5, 6.0, 6.0, 0.15625),
    "polynomial": (1.875, 10.0 / sqrt(3.0), 10.0 / sqrt(3.0), 0.103516),
    "polynomial_4567": (2.1875, 7.513188, 7.513188, 0.070557),
    "inclined_sine": (2.0, 2.0 * pi, 2.0 * pi, 0.090845),
    "modified_sine": (1.759603, 5.527957, 5.527957, 0.117178),
    "modified_trapezoid": (2.0, 4.888124, 4.888124, 0.104480),
    "double_harmonic": (2.040524, 5.551652, 9.869604, 0.021447),
    "harmonic_combination": (1.66663, 4.88514, 5.64087, 0.100949),
}
_NEAR: Final = {"polynomial_4567": (1.5e-3, 0.025), "double_harmonic": (1e-3, 0.2)}
"""How near the values and the share of the accelerations come, of laws that segments only approach."""
_START, _END, _LOW, _HIGH = 30.0, 110.0, 12.0, -8.0
"""Leading and following values of every law: a way of -20 over 80."""
_WAY: Final = _HIGH - _LOW
_LENGTH: Final = _END - _START
_SKETCH: Final = ((0.0, 2.0), (10.0, 9.0), (25.0, -4.0), (30.0, 6.0), (50.0, 2.0))
_ENDS: Final = {
    "straight_line": f"start_velocity = {_WAY / _LENGTH}\nend_velocity = {_WAY / _LENGTH}\n",
    "harmonic_combination": "end_reversal = true\n",
    "double_harmonic": "end_reversal = true\napproximation = 200\n",
}
"""What the ends of a transition need besides its law."""
_BENCH_LAWS: Final = "\n".join(
    f'[cam.{law}]\n[[cam.{law}.transitions]]\nlaw = "{law}"\nstart = [{_START}, {_LOW}]\n'
    f"end = [{_END}, {_HIGH}]\n{_ENDS.get(law, '')}"
    for law in _LAWS
)
_GAPS: Final = "\n".join(
    f'[cam.{mode}{end}]\ninterpolation = "{mode}"\nboundary = "{boundary}"\n'
    f"points = {[list(one) for one in _SKETCH]}\n"
    for mode in ("linear", "cubic", "bezier")
    for end, boundary in (("", "none"), ("_cyclic", "equal_velocity"))
)
BENCH: Final = BenchFile(
    "cams",
    f"""
[bench]
name = "cams"
kind = "virtual"
cycle_ms = 4

[segment.can0]
bitrate = 1_000_000

[drive.drive1]
segment = "can0"
node_id = 5

[axis.axis1]
drive = "drive1"

{_BENCH_LAWS}
{_GAPS}

[cam.mixed]
interpolation = "linear"
points = [[0.0, 1.0], [10.0, 3.0], [25.0, 50.0], [60.0, 4.0], [60.0, 7.0]]

[[cam.mixed.segments]]
start = 20.0
end = 40.0
a = [5.0, 0.5, -0.02]
sine_amplitude = 1.5
sine_period = 0.3
sine_phase = 0.2

[[cam.mixed.segments]]
start = 35.0
end = 45.0
a = [2.0, 0.1]

[cam.blank]
""",
)
CAMPAIGN: Final = Campaign("cams", tags=("cam",), bench="testcases.campaigns.cams:BENCH")
_CHANGED, _INTERPOLATED, _ERROR = 1 << 4, 1 << 5, 1 << 1


def ready(ctx: CaseContext, name: str) -> Any:
    """Interpolate a cam and return it."""
    cam = ctx.bench.cam(name)
    job = cam.interpolate()
    ctx.wait_until(job.done, 2.0, f"{name} is interpolated")
    word = int(cam.var("StatusWord"))
    equal(
        ctx, "interpolated, not changed, no error", word & (_CHANGED | _INTERPOLATED | _ERROR), _INTERPOLATED
    )
    return cam


def read(
    ctx: CaseContext, cam: Any, places: list[float], **inputs: float
) -> list[tuple[float, float, float]]:
    """Read following value and derivatives at leading values, one cycle each."""
    job = cam.following_value_cyclic(places[0], **inputs)
    found = []
    for place in places:
        job.set(LeadingValue=place)
        ctx.run_for(0.004)
        if not job.Valid:
            equal(ctx, f"ErrorID of the value at {place}", job.ErrorID, 0)
        found.append((job.Value, job.FirstDerivative, job.SecondDerivative))
    job.set(Enable=False)
    ctx.run_for(0.004)
    return found


def grid(low: float, high: float, number: int) -> list[float]:
    """Return places at equal distances, both ends included."""
    return [low + (high - low) * at / (number - 1) for at in range(number)]


@CAMPAIGN.product(
    "law/{law}",
    parameters={"law": tuple(_LAWS)},
    title="Law of motion {law}",
    requirements=("CAM-104",),
)
def law_of_motion(ctx: CaseContext, law: str) -> None:
    """Ends, characteristic values and a quarter of the way are those of VDI 2143; every derivative is one."""
    cam = ready(ctx, law)
    number = 161
    places = grid(_START, _END, number)
    rows = read(ctx, cam, places)
    velocity, acceleration, deceleration, quarter = _LAWS[law]
    near, share = _NEAR.get(law, (3e-4, 0.012))
    equal(ctx, "start", rows[0][0], _LOW, "CAM-186", within=1e-6)
    equal(ctx, "end", rows[-1][0], _HIGH, "CAM-186", within=1e-6)
    equal(ctx, "a quarter", (rows[number // 4][0] - _LOW) / _WAY, quarter, "CAM-188", within=near)
    slopes = [row[1] * _LENGTH / _WAY for row in rows]
    bends = [row[2] * _LENGTH**2 / _WAY for row in rows]
    equal(ctx, "greatest velocity", max(slopes), velocity, "CAM-162", within=0.005 * velocity)
    equal(
        ctx, "greatest acceleration", max(bends), acceleration, "CAM-163", within=share * acceleration + 1e-9
    )
    equal(
        ctx, "greatest deceleration", -min(bends), deceleration, "CAM-164", within=share * deceleration + 1e-9
    )
    step = places[1] - places[0]
    wrong = max(abs((b[0] - a[0]) / step - 0.5 * (a[1] + b[1])) for a, b in pairwise(rows))
    ctx.measure("velocity off the difference of the values", wrong, high=0.01 * abs(_WAY / _LENGTH) * 2.0)
    smooth = law not in ("quadratic_parabola", "straight_line", "double_harmonic")
    if smooth:
        off = max(abs((b[1] - a[1]) / step - 0.5 * (a[2] + b[2])) for a, b in pairwise(rows))
        ctx.measure("acceleration off that of the velocities", off, high=0.05 * abs(_WAY) / _LENGTH**2 * 6.0)
    if acceleration == deceleration:
        mirrored = max(abs(a[0] + b[0] - _LOW - _HIGH) for a, b in zip(rows, reversed(rows), strict=True))
        equal(ctx, "distance from the point reflection", mirrored, 0.0, within=1e-6)


@CAMPAIGN.product(
    "gaps/{mode}{end}",
    parameters={"mode": ("linear", "cubic", "bezier"), "end": ("", "_cyclic")},
    title="Interpolation {mode}{end}",
    requirements=("CAM-022",),
)
def gaps(ctx: CaseContext, mode: str, end: str) -> None:
    """Lines and splines pass through the points, Bezier curves stay between them; slopes are continuous."""
    cam = ready(ctx, f"{mode}{end}")
    equal(ctx, "first leading value", cam.var("StatusCam.StartLeadingValue"), 0.0)
    equal(ctx, "last leading value", cam.var("StatusCam.EndLeadingValue"), 50.0)
    equal(ctx, "valid points", cam.var("StatusCam.NumberOfValidPoints"), 5)
    rows = read(ctx, cam, [x for x, _ in _SKETCH])
    for (x, y), row in zip(_SKETCH, rows, strict=True):
        if mode != "bezier" or x in (0.0, 50.0):
            equal(ctx, f"value at {x}", row[0], y, "CAM-022", within=1e-6)
    places = grid(0.0, 50.0, 201)
    rows = read(ctx, cam, places)
    step = places[1]
    if mode == "linear":
        for (x0, y0), (x1, y1) in pairwise(_SKETCH):
            (middle,) = read(ctx, cam, [0.3 * x0 + 0.7 * x1])
            equal(ctx, f"line from {x0}", middle[0], 0.3 * y0 + 0.7 * y1, "CAM-022", within=1e-9)
            equal(ctx, f"slope from {x0}", middle[1], (y1 - y0) / (x1 - x0), within=1e-9)
        return
    jump = max(abs(b[1] - a[1]) for a, b in pairwise(rows))
    ctx.measure(
        "greatest change of the slope in a step", jump, high=1.3 * step * max(abs(r[2]) for r in rows)
    )
    if mode == "bezier":
        low, high = min(y for _, y in _SKETCH), max(y for _, y in _SKETCH)
        outside = max(max(row[0] - high, low - row[0]) for row in rows)
        ctx.measure("beyond its points", outside, high=1e-9, requirements=("CAM-022",))
    elif end:
        equal(ctx, "slope at the end", rows[-1][1], rows[0][1], "CAM-022", within=1e-6)
        equal(ctx, "second derivative at the end", rows[-1][2], rows[0][2], within=1e-6)
    else:
        equal(ctx, "second derivative at the start", rows[0][2], 0.0, "CAM-022", within=1e-6)
        equal(ctx, "second derivative at the end", rows[-1][2], 0.0, "CAM-022", within=1e-6)
    wrong = max(abs((b[0] - a[0]) / step - 0.5 * (a[1] + b[1])) for a, b in pairwise(rows))
    ctx.measure("slope off the difference of the values", wrong, high=0.03)


@CAMPAIGN.case("mixed", requirements=("CAM-020", "CAM-021"))
def mixed(ctx: CaseContext) -> None:
    """A segment is its formula; points in it do not count; of two the later segment and the last point do."""
    cam = ready(ctx, "mixed")
    for x in (20.0, 27.0, 34.9):
        s = x - 20.0
        wanted = 5.0 + 0.5 * s - 0.02 * s * s + 1.5 * sin(0.3 * s + 0.2)
        (row,) = read(ctx, cam, [x])
        equal(ctx, f"formula at {x}", row[0], wanted, "CAM-020", within=1e-9)
    (row,) = read(ctx, cam, [41.0])
    equal(ctx, "the later segment", row[0], 2.0 + 0.1 * 6.0, "CAM-021", within=1e-9)
    (row,) = read(ctx, cam, [52.5])
    equal(ctx, "line to the last of two points", row[0], 0.5 * (3.0 + 7.0), within=1e-9)
    (row,) = read(ctx, cam, [4.0])
    equal(ctx, "line before the segment", row[0], 1.0 + 0.4 * 2.0, within=1e-9)
    equal(ctx, "valid points", cam.var("StatusCam.NumberOfValidPoints"), 5)
    equal(ctx, "valid segments", cam.var("StatusCam.NumberOfValidSegments"), 2)


@CAMPAIGN.product(
    "scaled/{master}:{slave}",
    parameters={"master": (2.0, -0.5), "slave": (3.0, -1.5)},
    title="Values scaled by {master} and {slave}",
    requirements=("CAM-226", "CAM-227", "CAM-228", "CAM-229"),
)
def scaled(ctx: CaseContext, master: float, slave: float) -> None:
    """Values and derivatives follow from the scaling; the way back finds the place again."""
    cam = ready(ctx, "polynomial")
    inputs = {"MasterScaling": master, "SlaveScaling": slave, "MasterOffset": 7.0, "SlaveOffset": -3.0}
    for x in (40.0, 66.0, 101.0):
        (plain,) = read(ctx, cam, [x])
        (row,) = read(ctx, cam, [x * master + 7.0], **inputs)
        equal(ctx, f"value at {x}", row[0], plain[0] * slave - 3.0, "CAM-229", within=1e-9)
        equal(ctx, f"slope at {x}", row[1], plain[1] * slave / master, "CAM-228", within=1e-9)
        equal(ctx, f"bend at {x}", row[2], plain[2] * slave / master**2, "CAM-228", within=1e-9)
        job = cam.leading_value(row[0], x * master + 7.0, **inputs)
        ctx.wait_until(job.done, 1.0, "the leading value is there")
        equal(ctx, f"leading value of {row[0]:g}", job.Value, x * master + 7.0, "CAM-226", within=1e-5)


@CAMPAIGN.case("leading-value", requirements=("CAM-057", "CAM-061", "CAM-066"))
def leading_value(ctx: CaseContext) -> None:
    """Of several places that in the direction asked for, or the nearest; one that is not there is refused."""
    cam = ready(ctx, "linear")
    for wanted, approach, direction, place in (
        (4.0, 12.0, 1, 10.0 + 15.0 * 5.0 / 13.0),
        (4.0, 12.0, 2, 20.0 / 7.0),
        (4.0, 12.0, 3, 10.0 + 15.0 * 5.0 / 13.0),
        (4.0, 49.0, 3, 40.0),
    ):
        job = cam.leading_value(wanted, approach, ApproachDirection=direction)
        ctx.wait_until(job.ended, 1.0, "the search is over")
        equal(ctx, f"place of {wanted} from {approach}, direction {direction}", job.Value, place, within=1e-6)
    for error_id, value, inputs in (
        (0x8063, 9.01, {}),
        (0x8063, nan, {}),
        (0x8066, 8.9, {"ApproachLeadingValue": 45.0, "ApproachDirection": 1}),
        (0x8065, 4.0, {"ApproachDirection": 0}),
        (0x8065, 4.0, {"ApproachDirection": 4}),
        (0x8062, 4.0, {"ApproachLeadingValue": 2e12}),
        (0x8023, 4.0, {"MasterScaling": 0.0}),
        (0x8021, 4.0, {"MasterOffset": nan}),
        (0x8022, 4.0, {"SlaveOffset": 1e13}),
        (0x8024, 4.0, {"SlaveScaling": nan}),
    ):
        given = dict(inputs)
        job = cam.leading_value(value, given.pop("ApproachLeadingValue", 0.0), **given)
        ctx.wait_until(job.ended, 1.0, "the search is over")
        equal(ctx, f"ErrorID of {value} with {inputs}", job.ErrorID, error_id, "CAM-061")
    for place, error_id in ((0.0, 0), (50.0, 0), (-0.001, 0x8064), (50.001, 0x8064)):
        job = cam.following_value(place)
        ctx.wait_until(job.ended, 1.0, "the value is there")
        equal(ctx, f"ErrorID of the value at {place}", job.ErrorID, error_id, "CAM-075")


@CAMPAIGN.product("copy/mode-{mode}", parameters={"mode": (0, 1)}, title="MC_CopyCamData, mode {mode}")
def copy(ctx: CaseContext, mode: int) -> None:
    """What is copied is valid, and what was valid before only in mode 1; it acts with the interpolation."""
    cam = ready(ctx, "linear")
    (before,) = read(ctx, cam, [12.0])
    job = cam.copy([(11.0, 40.0), (13.0, 44.0), (17.0, 41.0)], Mode=mode, StartPointCam=7)
    ctx.run_for(0.004)
    equal(ctx, "Busy", job.Busy, 1, "CAM-080")
    ctx.wait_until(job.done, 1.0, "the copy is done")
    valid = [number for number in range(1, 12) if cam.var(f"ValidPoint[{number}]")]
    wanted = [7, 8, 9] if mode == 0 else [1, 2, 3, 4, 5, 7, 8, 9]
    equal(ctx, f"valid points {valid}", valid == wanted, 1, "CAM-081")
    equal(ctx, "shown as changed", int(cam.var("StatusWord")) & _CHANGED, _CHANGED, "CAM-025")
    equal(ctx, "value before the interpolation", read(ctx, cam, [12.0])[0][0], before[0], "CAM-093")
    ready(ctx, "linear")
    equal(ctx, "value behind it", read(ctx, cam, [12.0])[0][0], 42.0, "CAM-093", within=1e-9)
    equal(ctx, "number of points", cam.var("StatusCam.NumberOfValidPoints"), len(wanted))
    for inputs, error_id in (
        ({"StartPointCam": 0}, 0x80E1),
        ({"StartPointCam": 1000}, 0x80E5),
        ({"StartPointCam": 1001}, 0x80E1),
        ({"NumberOfPoints": 4}, 0x80E5),
        ({"StartPointArray": 0}, 0x80E3),
        ({"Mode": 2}, 0x800A),
    ):
        job = cam.copy([(1.0, 1.0), (2.0, 2.0), (3.0, 3.0)], **inputs)
        ctx.wait_until(job.ended, 1.0, "the copy is over")
        equal(ctx, f"ErrorID with {inputs}", job.ErrorID, error_id, "CAM-082")
    pieces = [Segment(x, x + 1.0, (1.0 + x, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)) for x in (100.0, 101.0)]
    for inputs, error_id in (({"StartSegmentCam": 50}, 0x80E6), ({"StartSegmentCam": 51}, 0x80E2)):
        job = cam.copy(segments=pieces, **inputs)
        ctx.wait_until(job.ended, 1.0, "the copy is over")
        equal(ctx, f"ErrorID with {inputs}", job.ErrorID, error_id, "CAM-094")
    job = cam.copy(segments=pieces, Mode=1, StartSegmentCam=49)
    ctx.wait_until(job.done, 1.0, "the copy is done")
    equal(ctx, "the second segment", cam.var("Segment[50].a0"), 102.0, "CAM-090")
    equal(ctx, "it is valid", cam.var("ValidSegment[50]"), 1, "CAM-090")


@CAMPAIGN.case("no-cam", requirements=("CAM-023", "CAM-026"))
def no_cam(ctx: CaseContext) -> None:
    """Without elements, or with a single one, there is no function; a restart takes all back."""
    cam = ctx.bench.cam("blank")
    job = cam.following_value(1.0)
    ctx.wait_until(job.ended, 1.0, "the value is read")
    equal(ctx, "ErrorID without function", job.ErrorID, 0x8064, "CAM-076")
    for points, error_id in (((), 0x80AA), (((1.0, 2.0),), 0x80AC), (((1.0, 2.0), (3.0, 8.0)), 0)):
        for number, (x, y) in enumerate(points, 3):
            cam.write_point(number, x, y)
        job = cam.interpolate()
        ctx.wait_until(job.ended, 1.0, "the interpolation is over")
        equal(ctx, f"ErrorID with {len(points)} points", job.ErrorID, error_id, "CAM-023")
    equal(ctx, "value", read(ctx, cam, [2.0])[0][0], 5.0, within=1e-9)
    cam.write("Point[4].y", 20.0)
    equal(ctx, "shown as changed", int(cam.var("StatusWord")) & _CHANGED, _CHANGED, "CAM-025")
    equal(ctx, "value as before", read(ctx, cam, [2.0])[0][0], 5.0, "CAM-025", within=1e-9)
    cam.shift_following_values(2.5)
    equal(ctx, "value of the point", cam.var("Point[4].y"), 22.5)
    job = cam.reset(restart=True)
    ctx.wait_until(job.done, 1.0, "the cam has restarted")
    equal(ctx, "not interpolated", int(cam.var("StatusWord")) & _INTERPOLATED, 0, "CAM-026")
    equal(ctx, "point of the project", cam.var("ValidPoint[4]"), 0, "CAM-026")


_TASKS: Final[dict[str, dict[str, Any]]] = {
    "straight-line": {"law": "straight_line", "ends": (7.0 / 44.0, None, 7.0 / 44.0, None)},
    "parabola": {"law": "quadratic_parabola"},
    "parabola-turning": {"law": "quadratic_parabola", "lam": 0.37},
    "parabola-slopes": {"law": "quadratic_parabola", "ends": (0.2, None, 1.3, None), "lam": 0.41},
    "sine": {"law": "simple_sine", "lam": 0.62},
    "polynomial": {"law": "polynomial", "ends": (0.7, 0.03, -0.4, -0.05)},
    "polynomial-turning": {"law": "polynomial", "ends": (0.5, 0.02, 0.3, -0.03), "lam": 0.45},
    "polynomial-acceleration": {"law": "polynomial", "ca": 7.5},
    "polynomial-back": {"law": "polynomial", "ends": (0.3, None, 0.0, None), "high": 12.0},
    "inclined-sine": {"law": "inclined_sine", "lam": 0.43},
    "inclined-sine-deceleration": {"law": "inclined_sine", "ca_star": 7.4},
    "modified-sine": {"law": "modified_sine", "ends": (0.3, None, 0.8, None), "lam": 0.56},
    "modified-sine-rest": {"law": "modified_sine", "ends": (None, None, 0.8, None)},
    "trapezoid": {"law": "modified_trapezoid", "lam": 0.44},
    "trapezoid-reversal": {"law": "modified_trapezoid", "turns": (False, True)},
    "trapezoid-from-reversal": {"law": "modified_trapezoid", "turns": (True, False), "lam": 0.42},
    "harmonic": {"law": "harmonic_combination", "turns": (False, True), "ends": (0.4, None, None, None)},
    "harmonic-back": {
        "law": "harmonic_combination",
        "turns": (True, False),
        "ends": (None, None, 0.35, None),
    },
    "sine-line": {"law": "sine_straight_line", "turns": (True, True), "share": 0.6, "lam": 0.45},
    "sine-alone": {"law": "sine_straight_line", "turns": (True, True), "share": 1.0},
    "seventh-order": {"law": "polynomial_4567"},
    "cubic": {"law": "polynomial_3"},
}
"""Laws with slopes and bends at their ends, reversals, turning points and greatest accelerations."""


@CAMPAIGN.product(
    "task/{name}",
    parameters={"name": tuple(_TASKS)},
    title="Transition {name}",
    requirements=("CAM-104", "CAM-161"),
)
def task(ctx: CaseContext, name: str) -> None:
    """What a law makes of its ends is copied to a cam: value, slope and bend at the ends are those asked
    for, each derivative is that of the one before, and the turning point is where it shall be.
    """
    given = dict(_TASKS[name])
    law, ends, high = given.pop("law"), given.pop("ends", (None,) * 4), given.pop("high", 19.0)
    turns = given.pop("turns", (False, False))
    start = End(3.0, 12.0, ends[0] or 0.0, ends[1], turns[0])
    end = End(47.0, high, ends[2] or 0.0, ends[3], turns[1])
    elements = transition(law, start, end, **given)
    cam = ctx.bench.cam("blank")
    job = cam.copy([(one.x, one.y) for one in elements.points], segments=list(elements.segments))
    ctx.wait_until(job.ended, 1.0, "the copy is over")
    equal(ctx, "ErrorID of the copy", job.ErrorID, 0)
    ready(ctx, "blank")
    number = 89
    rows = read(ctx, cam, grid(3.0, 47.0, number))
    equal(ctx, "value at the start", rows[0][0], 12.0, "CAM-186", within=1e-6)
    equal(ctx, "value at the end", rows[-1][0], high, "CAM-186", within=1e-6)
    equal(ctx, "slope at the start", rows[0][1], ends[0] or 0.0, within=1e-6)
    equal(ctx, "slope at the end", rows[-1][1], ends[2] or 0.0, within=1e-6)
    for words, wanted, row in (("start", ends[1], rows[0]), ("end", ends[3], rows[-1])):
        if wanted is not None:
            equal(ctx, f"bend at the {words}", row[2], wanted, within=1e-6)
    step = 0.5
    for order, words in enumerate(("slope", "bend")):
        rises = [(b[order] - a[order]) / step for a, b in pairwise(rows)]
        between = [0.5 * (a[order + 1] + b[order + 1]) for a, b in pairwise(rows)]
        scale = max(map(abs, between)) + 1e-6
        # Laws with steps of the acceleration have them inside of a single step.
        wrong = sorted(abs(rise - mean) / scale for rise, mean in zip(rises, between, strict=True))
        ctx.measure(f"{words} off the difference below it", wrong[-5], high=0.02)
    if "lam" in given and law == "polynomial":
        (middle,) = read(ctx, cam, [3.0 + 44.0 * given["lam"]])
        equal(ctx, "bend at the turning point", middle[2], 0.0, "CAM-161", within=1e-6)
    elif "lam" in given and ends == (None,) * 4 and law != "sine_straight_line":
        # The bend changes its sign where the acceleration ends.
        bends = [row[2] * (high - 12.0) for row in rows[1:-1]]
        signs = [at for at, (a, b) in enumerate(pairwise(bends), 1) if a > 1e-9 >= b]
        ctx.measure("changes from acceleration to deceleration", len(signs), low=1.0, high=1.0)
        equal(ctx, "turning point", signs[0] / (number - 1), given["lam"], "CAM-161", within=0.03)
    _found_again(ctx, cam, rows, grid(3.0, 47.0, number))
    for key, sign in (("ca", 1.0), ("ca_star", -1.0)):
        if key in given:
            most = max(sign * row[2] for row in rows) * 44.0**2 / (high - 12.0)
            equal(ctx, key, most, given[key], "CAM-161", within=0.02 * given[key])


def _found_again(
    ctx: CaseContext, cam: Any, rows: list[tuple[float, float, float]], places: list[float]
) -> None:
    """Look for leading values of following values; expect those of the curve that was read, in the
    direction asked for.
    """
    values = [row[0] for row in rows]
    low, high, near = min(values), max(values), 21.0
    for share in (0.27, 0.61, 0.88):
        level = low + share * (high - low)
        crossed = [
            x + (level - a) / (b - a) * (places[1] - places[0])
            for x, a, b in zip(places, values, values[1:], strict=False)
            if (a - level) * (b - level) < 0.0
        ]
        for direction in (1, 2, 3):
            ahead = [x for x in crossed if direction == 3 or (x >= near if direction == 1 else x <= near)]
            job = cam.leading_value(level, near, ApproachDirection=direction)
            ctx.wait_until(job.ended, 1.0, "the search is over")
            words = f"{level:.4g} from {near:g} in direction {direction}"
            if not ahead:
                equal(ctx, f"ErrorID of {words}", job.ErrorID, 0x8066, "CAM-066")
                continue
            wanted = min(ahead, key=lambda x: abs(x - near))
            equal(ctx, f"place of {words}", job.Value, wanted, "CAM-057", within=0.05)


@CAMPAIGN.case("cyclic-errors", requirements=("CAM-233", "CAM-235", "CAM-227"))
def cyclic_errors(ctx: CaseContext) -> None:
    """A value outside of the cam ends the reading with 16#8064, until another edge of Enable; wrong
    scalings have their ErrorIDs; outputs are zero without Enable.
    """
    cam = ready(ctx, "linear")
    job = cam.following_value_cyclic(4.0)
    ctx.run_for(0.008)
    equal(ctx, "Valid, Busy", job.Valid + job.Busy, 2)
    for place, valid in ((50.0, 1), (50.001, 0), (20.0, 0)):
        job.set(LeadingValue=place)
        ctx.run_for(0.008)
        equal(ctx, f"Valid at {place}", job.Valid, valid, "CAM-235")
        equal(ctx, f"Error at {place}", job.Error, not valid, "CAM-235")
        equal(ctx, f"ErrorID at {place}", job.ErrorID, 0 if valid else 0x8064, "CAM-235")
    job.set(Enable=False)
    ctx.run_for(0.008)
    equal(ctx, "outputs without Enable", job.Valid + job.Error + job.ErrorID + job.Busy, 0)
    job.set(Enable=True)
    ctx.run_for(0.008)
    equal(ctx, "Valid behind another edge", job.Valid, 1, "CAM-235")
    for inputs, error_id in (
        ({"MasterScaling": 0.0}, 0x8023),
        ({"MasterOffset": nan}, 0x8021),
        ({"SlaveOffset": nan}, 0x8022),
        ({"SlaveScaling": nan}, 0x8024),
    ):
        wrong = cam.following_value_cyclic(4.0, **inputs)
        ctx.run_for(0.008)
        equal(ctx, f"ErrorID with {inputs}", wrong.ErrorID, error_id, "CAM-227")


@CAMPAIGN.case("elements", requirements=("CAM-020", "CAM-029", "CAM-030"))
def element_kinds(ctx: CaseContext) -> None:
    """Sines, polynomials up to the seventh order, inverse sines and groups of points are their formulas in
    the cam.
    """
    coefficients = (1.0, -0.4, 0.05, 0.02, -0.003, 1e-4, -2e-6, 1e-7)

    def power(x: float) -> float:
        return sum(one * (x - 2.0) ** order for order, one in enumerate(coefficients))

    cases: list[tuple[str, Any, Callable[[float], float], float, float, float]] = [
        (
            "sine",
            sine(2.0, 14.0, offset=3.0, amplitude=2.5, rate=0.4, phase=0.3),
            lambda x: 3.0 + 2.5 * sin(0.4 * (x - 2.0) + 0.3),
            2.0,
            14.0,
            1e-9,
        ),
        ("seventh order", polynomial(2.0, 14.0, coefficients), power, 2.0, 14.0, 2e-3),
        (
            "sixth order",
            polynomial(2.0, 14.0, coefficients[:7]),
            lambda x: power(x) - coefficients[7] * (x - 2.0) ** 7,
            2.0,
            14.0,
            1e-9,
        ),
        (
            "inverse sine",
            inverse_sine(Point(2.0, 1.0), Point(14.0, 9.0), first=-0.8, last=0.6, approximation=200),
            lambda x: (
                1.0 + 8.0 * (asin(-0.8 + 1.4 * (x - 2.0) / 12.0) - asin(-0.8)) / (asin(0.6) - asin(-0.8))
            ),
            2.0,
            14.0,
            1e-4,
        ),
    ]
    for name, elements, law, low, high, within in cases:
        cam = ctx.bench.cam("blank")
        job = cam.copy([(one.x, one.y) for one in elements.points], segments=list(elements.segments))
        ctx.wait_until(job.ended, 1.0, "the copy is over")
        ready(ctx, "blank")
        places = grid(low, high, 25)
        rows = read(ctx, cam, places)
        wrong = max(abs(row[0] - law(x)) for row, x in zip(rows, places, strict=True))
        ctx.measure(f"{name}: off its formula", wrong, high=within, requirements=("CAM-020",))
