"""Pictures of cams on the page of a case."""

import xml.etree.ElementTree as ET

import pytest

from hil.bench import load_bench
from hil.bench.bench_file import parse
from hil.bench.cam_drawings import cam_drawings
from reports import CaseResult, Verdict
from reports.codec import case_from_plain, case_to_plain
from reports.html.curves import Panel, markup, picture
from reports.html.payload import case_payload

CAMS = """
[cam.knife]
interpolation = "linear"
points = [[0.0, 0.0], [90.0, 20.0], [360.0, -10.0]]
[cam.waiting]
points = [[0.0, 0.0], [90.0, 20.0]]
"""


def elements(node):
    return [node, *(inner for child in node[2] if isinstance(child, list) for inner in elements(child))]


@pytest.mark.exhaustive
def test_cams_of_a_bench_are_drawn_when_they_are_interpolated():
    """Function and derivatives over the whole range, its points, and how it stands; stored and read again."""
    from hil.bench import Bench

    with Bench(parse(load_bench("reference").text + CAMS, "bench.toml"), seed=1) as bench:
        assert cam_drawings(bench) == []
        bench.run_until(bench.cam("knife").interpolate().done, timeout=1.0)
        drawings = cam_drawings(bench)
        bench.cam("knife").write("Point[2].y", 30.0)
        changed = cam_drawings(bench)
    assert cam_drawings(object()) == []
    (one,) = drawings
    assert (one.name, one.text) == ("knife", "3 points, 0 segments, interpolated from 0 to 360")
    assert (one.x[0], one.x[-1], one.y[0], one.y[-1]) == (0.0, 360.0, 0.0, -10.0)
    assert one.y[45] == pytest.approx(10.0)
    assert (one.first[0], one.second[7]) == (pytest.approx(20.0 / 90.0), 0.0)
    assert one.points == [[0.0, 0.0], [90.0, 20.0], [360.0, -10.0]]
    assert changed[0].points == []
    case = CaseResult("c", "", Verdict.PASSED, cams=drawings)
    assert case_from_plain(case_to_plain(case)).cams == drawings
    (shown,) = case_payload(case, points=100)["cams"]
    assert shown["title"] == "Cam knife"
    assert "following value \N{MINUS SIGN}10 to 20" in shown["alt"]
    tags = [node[0] for node in elements(shown["svg"])]
    assert (tags.count("polyline"), tags.count("circle"), tags.count("rect")) == (3, 3, 3)


def test_pictures_are_to_scale_and_texts_are_escaped():
    """The line touches both sides of its panel; a constant quantity is drawn in the middle; markup is SVG."""
    node = picture(
        [0.0, 5.0, 10.0], [Panel("<up>", [0.0, 1.0, 4.0]), Panel("level", [0.0] * 3)], label="x & y"
    )
    root = ET.fromstring(markup(node))
    lines = [one.attrib["points"].split() for one in root.iter("polyline")]
    frames = [
        {key: float(one.attrib[key]) for key in ("x", "y", "width", "height")} for one in root.iter("rect")
    ]
    first = [tuple(map(float, one.split(","))) for one in lines[0]]
    left, top = frames[0]["x"], frames[0]["y"]
    width, height = frames[0]["width"], frames[0]["height"]
    assert first == [(left, top + height), (left + width / 2, top + height * 3 / 4), (left + width, top)]
    level = {float(one.split(",")[1]) for one in lines[1]}
    assert level == {frames[1]["y"] + frames[1]["height"] / 2}
    texts = [one.text for one in root.iter("text")]
    assert "<up>" in texts
    assert "x & y" in texts
