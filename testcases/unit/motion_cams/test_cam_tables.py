"""`[cam.NAME]` of a bench file, and cams of a bench."""

import pytest

from hil.bench import Bench, load_bench
from hil.bench.bench_file import BenchFileError, parse

BENCH = """
[bench]
name = "cell"
[segment.can0]
[drive.x_drive]
segment = "can0"
node_id = 5
[axis.x]
drive = "x_drive"
[cam.knife]
"""
KNIFE = """
points = [[0.0, 0.0], [90.0, 20.0], [120, 30]]
boundary = "equal_velocity"
[[cam.knife.transitions]]
law = "modified_sine"
start = [200.0, 50.0]
end = [360.0, 0.0]
[[cam.knife.segments]]
start = 400.0
end = 410.0
a = [1.0, 2.0]
sine_amplitude = 0.5
sine_period = 0.1
[cam.knife.variables]
"ValidPoint[3]" = false
"""


@pytest.mark.exhaustive
def test_a_cam_of_a_bench_file_is_there_and_waits_for_its_interpolation(tmp_path):
    """With points of table and file, segments, laws and other variables; the program interpolates it."""
    (tmp_path / "more.csv").write_text("leading;following\n# a comment\n\n150.0;40.0\n 160 ; 41.5\n")
    path = tmp_path / "bench.toml"
    path.write_text(BENCH + 'points_file = "more.csv"' + KNIFE)
    with Bench(load_bench(str(path)).config, seed=1) as bench:
        cam = bench.cam("knife")
        assert bench.cam_names == ("knife",)
        assert bench.cam().name == "knife"
        assert [cam.var(f"ValidPoint[{number}]") for number in range(1, 7)] == [1, 1, 0, 1, 1, 0]
        assert [cam.var(f"Point[{number}].x") for number in (1, 2, 4, 5)] == [0.0, 90.0, 150.0, 160.0]
        assert [cam.var(f"StatusCam.NumberOfValid{one}") for one in ("Points", "Segments")] == [4, 4]
        assert cam.var("InterpolationSettings.InterpolationMode") == 1
        assert cam.var("InterpolationSettings.BoundaryConditions") == 1
        assert (cam.var("Segment[1].a1"), cam.var("Segment[1].sineAmplitude")) == (2.0, 0.5)
        assert cam.var("StatusWord") == 0
        bench.run_until(cam.interpolate().done, timeout=1.0)
        assert cam.var("StatusWord.X5")
        assert cam.curve.evaluate(280.0)[0] == pytest.approx(25.0)
        assert cam.curve.evaluate(405.0)[0] > 11.0
        with pytest.raises(Exception, match="nife"):
            bench.cam("nife")


MISTAKES = {
    "points = [[0.0, 0.0], [90.0, 20.0, 3.0]]": "cam.knife.points.1: .*a pair, leading and following value",
    'points = [[0.0, "0,5"]]': r"cam.knife.points.0: .*pair of numbers.*0\.5",
    "points = 3": "cam.knife.points: 3 .*pairs of leading and following value",
    "points = [[1.0, 1.0]]": "a single point makes no cam",
    "points = [[1.0, 2e12], [2.0, 1.0]]": "2000000000000",
    'interpolation = "spline"': "'linear', 'cubic' or 'bezier'",
    'kindd = "TO_Cam"': "did you mean kind",
    'points_file = "nope.csv"': "points_file: .*nope.csv: No such file",
    '[[cam.knife.transitions]]\nlaw = "cycloid"\nstart = [0.0, 0.0]\nend = [1.0, 1.0]': "inclined_sine",
    '[[cam.knife.transitions]]\nlaw = "double_harmonic"\nstart = [0.0, 0.0]\nend = [1.0, 1.0]':
        "double_harmonic is for RU, UR, not for RR",
    "[[cam.knife.segments]]\nstart = 3.0\nend = 1.0": "end must be above start = 3",
    '[cam.knife.variables]\n"Point[1001].x" = 3.0': "Point.1001..x: .*similar: Point",
    '[cam.knife.variables]\n"InterpolationSettings.InterpolationMode" = 3': r"0 \(LINEAR\)",
    '[cam.knife.variables]\n"StatusWord" = 3': "not read only",
}  # fmt: skip


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes_in_a_cam_are_named_with_what_is_allowed(mistake):
    """Table, key, value, and what is allowed or meant."""
    with pytest.raises(BenchFileError, match=MISTAKES[mistake]):
        parse(BENCH + mistake, "bench.toml")


def test_lines_of_a_points_file_that_are_no_points_are_refused(tmp_path):
    """With the number of the line."""
    path = tmp_path / "points.csv"
    for text in ("0,1\n5;3;2\n", "0;1\n5,5;3\n", "x;y\n1;2\nend\n"):
        path.write_text(text)
        with pytest.raises(BenchFileError, match=r"points.csv, line [23]: .*two numbers"):
            parse(BENCH + f'points_file = "{path}"', "bench.toml")


def test_example_of_the_page_is_a_cam(tmp_path):
    """As it stands there, with a file of points."""
    import re
    from pathlib import Path

    page = Path(__file__).resolve().parents[3] / "docs/reference/cams.md"
    example = re.search(r"```toml\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)[1]
    (tmp_path / "more.csv").write_text("100.0,25.0\n")
    path = tmp_path / "bench.toml"
    path.write_text(BENCH.replace("[cam.knife]", example))
    table = load_bench(str(path)).config.cam["knife"]
    assert (len(table.elements().points), len(table.elements().segments)) == (3, 4)


def test_other_controllers_have_no_cams():
    """Nor their instructions; the message says which has them."""
    text = BENCH.replace('name = "cell"', 'name = "cell"\ncpu = "S7-1500"')
    with pytest.raises(
        BenchFileError, match=r'cam.knife: an S7-1500 has no cams; set bench.cpu = "S7-1500T"'
    ):
        parse(text, "bench.toml")
    with pytest.raises(BenchFileError, match="has this name already"):
        parse(BENCH.replace("[cam.knife]", "[cam.x]"), "bench.toml")


@pytest.mark.exhaustive
@pytest.mark.requirement("CAM-052", "CAM-054", "CAM-067", "CAM-078", "CAM-101")
def test_jobs_of_axes_and_of_cams_leave_each_other_alone():
    """A long interpolation, and reading and copying, while an axis moves, is halted and stopped: nothing is
    aborted by the other side, and the axis is not late.
    """
    rows = "".join(f"[{x}.0, {x % 7}.0]," for x in range(6000))
    text = BENCH.replace("[cam.knife]", f'[cam.knife]\nkind = "TO_Cam_10k"\npoints = [{rows}]')
    with Bench(parse(text, "bench.toml"), seed=1) as bench:
        axis, cam = bench.axis("x"), bench.cam("knife")
        power = axis.power()
        bench.run_until(lambda: power.Status, timeout=1.0)
        first = cam.interpolate()
        move = axis.move_velocity(20.0)
        bench.run_for(0.02)
        assert (first.Busy, move.Busy, move.CommandAborted) == (True, True, False)
        bench.run_until(first.done, timeout=1.0)
        bench.run_until(lambda: move.InVelocity, timeout=2.0)
        start, begun = axis.var("Position"), bench.now_s
        jobs = [
            cam.leading_value(3.0, 100.0),
            cam.following_value(5.0),
            cam.copy([(1.0, 1.0)] * 5000, Mode=1),
        ]
        bench.run_for(0.008)
        assert not move.CommandAborted
        assert axis.var("Position") - start == pytest.approx(20.0 * (bench.now_s - begun), abs=1e-9)
        halt = axis.halt()
        bench.run_until(lambda: not any(job.Busy for job in jobs), timeout=1.0)
        assert [(job.Done, job.CommandAborted) for job in jobs] == [(True, False)] * 3
        again = cam.interpolate()
        bench.run_for(0.008)
        stop = axis.stop(mode=3)
        bench.run_until(again.done, timeout=1.0)
        assert (again.Done, halt.Error, stop.Error) == (True, False, False)
