"""The drawing of every way of homing, made from the trace, against stored golden ones
(`homing_drawings.json`).

`HIL_GOLDEN=write` writes the file again from the PROFIdrive bench; read the difference before it is
committed.
"""

from __future__ import annotations

import itertools
import json
import math
import os
import re
from pathlib import Path

import pytest

from hil.testing import homing_drawings
from reports.homing import HomingDrawing
from reports.html.homing import drawing_payload
from testcases.unit.hil.homing_bench import STEEP, Machine, homing_bench

pytestmark = pytest.mark.exhaustive

GOLDEN = Path(__file__).with_name("homing_drawings.json")
ACTIVE, PASSIVE = "Sensor[1].ActiveHoming.", "Sensor[1].PassiveHoming."
ZERO_MARK, CAM, INPUT = range(3)
NEGATIVE, POSITIVE_SIDE, BACKWARDS = (
    {ACTIVE + "Direction": 1},
    {ACTIVE + "SideInput": True},
    {"Homing.ApproachDirection": True},
)
REVERSAL = {
    "Homing.AutoReversal": True,
    "PositionLimits_HW.Active": True,
    "PositionLimits_HW.ApproachBehavior": 1,
}


def active(mark, *variables, start=0.0, mode=3, **parts):
    own = {ACTIVE + "Mode": mark, ACTIVE + "HomePositionOffset": 5.0}
    for one in variables:
        own |= one
    return {"variables": own, "mechanics": {"start_position_mm": start}} | parts, mode, ""


def passive(mark, mode, direction=0, start=0.0):
    own = {
        PASSIVE + "Mode": mark,
        PASSIVE + "Direction": direction,
        PASSIVE + "SideInput": True,
        "Homing.HomePosition": 700.0,
    }
    return {"variables": own, "mechanics": {"start_position_mm": start}}, mode, "pass"


WAYS = {
    "zero mark, positive": active(ZERO_MARK),
    "zero mark, negative, configured position": active(
        ZERO_MARK, NEGATIVE, {"Homing.HomePosition": 250.0}, mode=5
    ),
    "zero mark, from the other end": active(
        ZERO_MARK, REVERSAL, start=547.0, switches={"negative_limit_mm": 480.0}
    ),
    "cam, approach and homing positive": active(CAM),
    "cam, approach positive, homing negative": active(CAM, NEGATIVE),
    "cam, approach negative, homing positive": active(CAM, BACKWARDS, start=250.0),
    "cam, begins on it": active(CAM, start=110.0),
    "cam, turned round at the limit switch": active(CAM, REVERSAL, BACKWARDS, start=-480.0),
    "input, negative side, homing positive": active(INPUT),
    "input, positive side, homing positive": active(INPUT, POSITIVE_SIDE),
    "input, positive side, homing negative": active(INPUT, NEGATIVE, POSITIVE_SIDE),
    "input, negative side, homing negative": active(INPUT, NEGATIVE),
    "input, turned round at the limit switch": active(INPUT, REVERSAL, BACKWARDS, start=-480.0),
    "limit switch as the mark": active(
        INPUT, REVERSAL, BACKWARDS, POSITIVE_SIDE, start=-480.0, axis={"homing_input": "negative_limit"}
    ),
    "no cam": active(CAM, REVERSAL, start=450.0, switches={"home_from_mm": 800.0, "home_to_mm": 810.0}),
    "halted on the way": (*active(CAM)[:2], "halt"),
    "passive, zero mark": passive(ZERO_MARK, 2),
    "passive, cam": passive(CAM, 8, start=80.0),
    "passive, input, negative": passive(INPUT, 10, 1, start=150.0),
}
ALSO_CIA402 = (
    "zero mark, positive", "cam, approach positive, homing negative", "cam, turned round at the limit switch",
    "input, negative side, homing positive", "passive, cam",
)  # fmt: skip


def drawn(way, bench_name="profidrive"):
    """Carry out a way of homing and return its drawing."""
    parts, mode, what = WAYS[way]
    parts = parts | {"variables": STEEP | parts["variables"]}
    with homing_bench(bench_name, **parts) as bench:
        run = Machine(bench)
        job = run.axis.home(0.0, mode=mode)
        if what == "pass":
            direction = -1.0 if parts["variables"][PASSIVE + "Direction"] else 1.0
            run.axis.move_velocity(direction * 50.0)
            run.until(job.done)
            run.run(0.3)
        elif what == "halt":
            run.run(0.5)
            run.axis.halt()
            run.run(0.5)
        else:
            run.until(job.ended, 30.0)
            run.run(0.5)
        (drawing,) = homing_drawings(bench.trace())
    return drawing


def close(found, golden, tolerance, speed=2):
    """Return whether two values of JSON are equal but for positions (floats) and velocities (integers) within
    a tolerance.
    """
    if isinstance(golden, dict):
        return found.keys() == golden.keys() and all(
            close(found[key], golden[key], tolerance, speed) for key in golden
        )
    if isinstance(golden, list):
        return len(found) == len(golden) and all(
            close(a, b, tolerance, speed) for a, b in zip(found, golden, strict=True)
        )
    if isinstance(golden, float):
        return isinstance(found, float) and abs(found - golden) <= tolerance
    return found == golden or (
        isinstance(golden, int) and isinstance(found, int) and abs(found - golden) <= speed
    )


def text(value):
    """Return JSON with one line for every innermost list, in which a difference can be read."""
    lines = json.dumps(value, indent=1)
    return re.sub(r"\[[^][{}]*\]", lambda found: " ".join(found.group().split()), lines)


@pytest.mark.requirement(
    "HOM-089",
    "HOM-090",
    "HOM-091",
    "HOM-096",
    "HOM-098",
    "HOM-102",
    "HOM-104",
    "HOM-105",
    "HOM-108",
    "HOM-113",
    "HOM-127",
)
@pytest.mark.parametrize("way", WAYS)
def test_golden(way):
    """Phases, directions, velocities, edges and places are those of the golden drawing."""
    found = json.loads(text(drawn(way).summary()))
    golden = json.loads(GOLDEN.read_text("utf-8")) if GOLDEN.exists() else {}
    if os.environ.get("HIL_GOLDEN") == "write":
        golden = {name: golden[name] for name in WAYS if name in golden} | {way: found}
        GOLDEN.write_text(text({name: golden[name] for name in WAYS if name in golden}) + "\n", "utf-8")
    assert close(found, golden[way], 0.15), text(found)


@pytest.mark.parametrize("way", ALSO_CIA402)
def test_same_drawing_over_cia402(way):
    """A drive of the other profile makes the same drawing, but for the way of two cycles, on which a zero
    mark may lie.
    """
    found = json.loads(text(drawn(way, "reference").summary()))
    golden = json.loads(GOLDEN.read_text("utf-8"))[way]
    for drawing in (found, golden):
        drawing["lanes"].pop("zero mark", None)
    assert close(found, golden, 200.0 * 0.008 + 0.1, 8), text(found)


@pytest.mark.requirement("HOM-092", "HOM-094", "HOM-103")
@pytest.mark.parametrize(
    ("way", "cam", "mark", "end"),
    [
        ("cam, approach and homing positive", (100.0, 120.0), 123.0, 128.0),
        ("cam, approach positive, homing negative", (100.0, 120.0), 93.0, 98.0),
        ("input, positive side, homing positive", (100.0, 120.0), 120.0, 125.0),
    ],
)
def test_published_examples(way, cam, mark, end):
    """The drawing shows cam, mark and home position where the published examples have them."""
    drawing = drawn(way)
    (bar,) = drawing.lanes[0].bars
    assert [place + end for place in bar] == pytest.approx(cam, abs=0.3)
    assert (drawing.mark + end, drawing.home) == (pytest.approx(mark), pytest.approx(0.0, abs=0.01))


def test_further_zero_marks_are_those_of_the_encoder():
    """The marks that were passed without effect are drawn, one per revolution; with an external zero mark
    there are none.
    """
    marks = {lane.name: lane.bars for lane in drawn("cam, approach and homing positive").lanes}["zero mark"]
    assert sorted(place + 128.0 for place, _ in marks) == pytest.approx(
        [3.0 + 10.0 * turn for turn in range(13)]
    )
    with homing_bench(variables=STEEP, switches={"probe1_from_mm": 20.0, "probe1_to_mm": 22.0}) as bench:
        bench.drive().parameters.write("p0495", 1)
        Machine(bench).done(100.0)
        (drawing,) = homing_drawings(bench.trace())
    assert [lane.bars for lane in drawing.lanes] == [[[100.0, 100.0]]]


@pytest.mark.parametrize("way", ["cam, turned round at the limit switch", "no cam", "passive, cam"])
def test_the_picture_stays_in_its_frame(way):
    """Every number of a step is in the picture, apart from the others, and inside of the plot."""
    found = drawn(way)
    payload = drawing_payload(found)

    def nodes(node):
        yield node
        for child in node[2]:
            if not isinstance(child, str):
                yield from nodes(child)

    badges = [node[1] for node in nodes(payload["svg"]) if node[1].get("class") == "hn"]
    assert len(badges) == len([row for row in payload["rows"] if row[0]])
    for one, other in itertools.combinations(badges, 2):
        assert math.dist((one["cx"], one["cy"]), (other["cx"], other["cy"])) > 2.0 * one["r"]
    assert all(92.0 <= badge["cx"] <= 940.0 and 46.0 <= badge["cy"] <= 300.0 for badge in badges)


def test_direct_homing_has_no_drawing():
    """Nothing moves, nothing is looked for."""
    with homing_bench(variables=STEEP) as bench:
        Machine(bench).done(100.0, mode=0)
        assert homing_drawings(bench.trace()) == []


def test_drawing_survives_json():
    """What a run keeps is what it was."""
    drawing = drawn("cam, begins on it")
    assert HomingDrawing.from_plain(json.loads(json.dumps(drawing.to_plain()))) == drawing
