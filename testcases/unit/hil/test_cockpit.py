"""The cockpit over its WebSocket: who gets in, what is refused, time control, and axes that stop."""

from __future__ import annotations

import math
import struct
import time
from contextlib import suppress

import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus

from hil._commands._cockpit_measurement import latencies, missing
from hil.bench import load_bench
from hil.cli import main
from hil.cockpit.machine import Machine
from hil.cockpit.messages import RateLimit
from hil.cockpit.operator import Control
from hil.cockpit.panes.scope import ScopePane, Subscribe
from testcases.cockpit_fuzz import fuzz
from testcases.cockpit_rig import PATIENCE_S, TOKEN, served
from testcases.slow_link import SlowLink

pytestmark = pytest.mark.exhaustive


@pytest.fixture(scope="module")
def cockpit():
    with served() as one:
        yield one


@pytest.fixture
def operator(cockpit):
    with cockpit.page() as one:
        one.live()
        one.do("control.take")
        one.do("bench.reset")
        one.until(lambda: one.state["time_s"] and not one.state["axis"]["axis1"]["enabled"], "reset")
        yield one


def enable(one) -> None:
    one.do("time.run", speed=5.0)
    one.command("axis1", "take")
    one.command("axis1", "enable")
    one.until(lambda: one.state["axis"]["axis1"]["enabled"], "enabled")


def position(one) -> float:
    return one.state["axis"]["axis1"]["position"]


def velocity(one) -> float:
    return one.state["axis"]["axis1"]["velocity"]


def test_way_in(cockpit, subtests):
    """The token opens the cockpit once; without its cookie, from another host or origin nothing is served."""
    status, headers, _ = cockpit.http("GET", "/")
    policy = headers["content-security-policy"]
    assert status == 200
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    assert "http" not in policy
    cookie = cockpit.http("POST", "/enter", TOKEN)[1]["set-cookie"]
    assert "HttpOnly" in cookie
    assert "SameSite=Strict" in cookie
    assert TOKEN not in cookie
    for path in ("/page/app.js", "/page/views/axis.js", "/page/cockpit.css", "/uplot.js", "/uplot.css"):
        with subtests.test(path):
            assert cockpit.http("GET", path)[0] == 200
    with subtests.test("wrong token"):
        assert cockpit.http("POST", "/enter", TOKEN + "x")[0] == 403
        assert cockpit.http("GET", "/enter")[0] == 401
        assert cockpit.http("POST", "/enter", "x" * 2000)[0] == 413
    for cookie in (None, cockpit.cookie + "x"):
        with (
            subtests.test(f"socket with cookie {cookie}"),
            cockpit.connect(cookie=cookie) as socket,
            pytest.raises(ConnectionClosed) as end,
        ):
            socket.recv()
        assert end.value.rcvd.code == 4401
    foreign = f"evil.example:{cockpit.port}"
    for name, header in (
        ("host", foreign),
        ("origin", f"http://{foreign}"),
        ("origin", "http://127.0.0.1:9"),
    ):
        with subtests.test(f"{name} {header}"):
            assert cockpit.http("POST", "/enter", TOKEN, **{name: header})[0] == 403
            with pytest.raises(InvalidStatus):
                cockpit.connect(**{name: header})
    with subtests.test("no origin"), pytest.raises(InvalidStatus):
        cockpit.connect(origin=None)


def test_messages_are_checked(operator, subtests):
    """What is no message of a known kind with fields in range is refused with its place; the page stays."""
    for text, place in (
        ("{", "message"),
        ("[]", "message"),
        ("null", "message"),
        ('{"kind":"nothing"}', "message"),
        ('{"kind":"axis.jog","axis":"axis1","slider":101}', "slider"),
        ('{"kind":"axis.jog","axis":"axis1","slider":"5"}', "slider"),
        ('{"kind":"axis.jog","axis":"axis1","slider":NaN}', "slider"),
        ('{"kind":"axis.jog","axis":"axis1"}', "slider"),
        ('{"kind":"time.step","cycles":1,"more":1}', "more"),
        ('{"kind":"time.step","cycles":1e9}', "cycles"),
        ('{"kind":"bench.open","source":"../../etc/passwd"}', "source"),
        ('{"kind":"axis.command","axis":"axis1","command":"wait","values":[3600]}', "command"),
        ('{"kind":"axis.command","axis":"axis1","command":"jog","values":[100]}', "command"),
        ('{"kind":"axis.command","axis":"axis9","command":"stop"}', "axis"),
        ('{"kind":"axis.command","axis":"axis1","command":"rel","values":[]}', "values"),
        ('{"kind":"scope.subscribe","signals":["axis1.nothing"],"number":1}', "signals"),
        ("[" * 50_000, "message"),
    ):
        with subtests.test(text[:60]):
            operator.send(text)
            reply = operator.reply()
            assert not reply["ok"]
            assert place in reply["error"]
    assert operator.do("bench.list")["embedded"]


def test_too_many_messages_end_the_connection():
    """A page that sends faster than the bound is put out."""
    with served(rate=lambda: RateLimit(10.0, 20.0)) as cockpit, cockpit.page() as one:
        for _ in range(40):
            with suppress(ConnectionClosed):  # it has been put out already
                one.send('{"kind":"life"}')
        one.until(lambda: one.code == 4429, "put out")


@pytest.mark.realtime
def test_one_operates_and_others_watch(cockpit, operator):
    """Only the page in control operates, a second one gets control when it is released, and may stop."""
    with cockpit.page() as other:
        assert "take control" in other.refused("axis.command", axis="axis1", command="enable", values=[])
        assert "has control" in other.refused("control.take")
        enable(operator)
        operator.command("axis1", "rel", 400.0)
        operator.until(lambda: velocity(operator) > 10.0, "moves")
        other.do("axis.stop_all")
        operator.until(lambda: velocity(operator) == 0.0, "stopped by who watches")
        assert 0.0 < position(operator) < 390.0
        operator.do("control.release")
        other.until(lambda: other.state["operator"] is None, "released")
        other.until(lambda: other.state["axis"]["axis1"]["master"] == "program", "given back")
        other.do("control.take")
        assert other.state["axis"]["axis1"]["alarms"] == []


@pytest.mark.realtime
@pytest.mark.parametrize("way", ["closed", "silent", "hidden"])
def test_jog_ends_with_the_operator(cockpit, way):
    """A jog ends when its page is closed, gives no sign of life or is hidden; without a sign of life the
    axis is disabled and given back with alarm 204.
    """
    with cockpit.page() as watcher, cockpit.page() as one:
        one.live()
        one.do("control.take")
        one.do("bench.reset")
        enable(one)
        one.do("axis.jog", axis="axis1", slider=50.0)
        watcher.until(lambda: velocity(watcher) > 5.0, "jogs")
        if way == "closed":
            one.hush()
            one.socket.close()
        elif way == "silent":
            one.hush()
            watcher.until(lambda: velocity(watcher) == 0.0, "stopped")
            assert "sign of life" in one.refused("axis.jog", axis="axis1", slider=50.0)
            watcher.until(lambda: watcher.state["away"], "the pages see that")
        else:
            one.do("axis.away")
        watcher.until(lambda: velocity(watcher) == 0.0, "stopped")
        if way == "hidden":
            assert watcher.state["axis"]["axis1"]["enabled"]
            return
        watcher.until(lambda: watcher.state["axis"]["axis1"]["master"] == "program", "given back")
        watcher.until(lambda: watcher.state["axis"]["axis1"]["alarms"][0]["number"] == 204, "alarm")
        assert not watcher.state["axis"]["axis1"]["enabled"]


NC_BENCH = """
[bench]
name = "feeder"
cycle_ms = 2

[segment.can0]

[drive.motor]
segment = "can0"
node_id = 5

[axis.x]
controller = "nc"
drive = "motor"
"""


@pytest.mark.realtime
def test_nc_axis(tmp_path):
    """An NC axis is jogged as long as the key is held, moves to its target and is stopped; without a sign of
    life it stops and loses its enables.
    """
    (tmp_path / "bench.toml").write_text(NC_BENCH)
    with (
        served(str(tmp_path / "bench.toml")) as cockpit,
        cockpit.page() as watcher,
        cockpit.page() as one,
    ):
        one.live()
        one.do("control.take")
        assert "command" in one.refused("axis.command", axis="x", command="f4", values=[3600.0])
        axis = lambda: watcher.state["axis"]["x"]  # noqa: E731 - read anew each time
        one.command("x", "enable")
        watcher.until(lambda: axis()["enabled"], "enabled")
        one.do("axis.jog", axis="x", slider=30.0)
        watcher.until(lambda: axis()["velocity"] > 50.0, "jogs")
        one.do("axis.jog", axis="x", slider=0.0)
        watcher.until(lambda: abs(axis()["velocity"]) < 0.01, "let go")
        one.command("x", "target", 500.0)
        one.command("x", "f5")
        watcher.until(lambda: axis()["velocity"] > 50.0, "moves")
        watcher.do("axis.stop_all")
        watcher.until(lambda: abs(axis()["velocity"]) < 0.01, "stopped")
        assert axis()["position"] < 450.0
        one.do("axis.jog", axis="x", slider=-30.0)
        watcher.until(lambda: axis()["velocity"] < -50.0, "jogs back")
        one.hush()
        watcher.until(lambda: abs(axis()["velocity"]) < 0.01, "stops without a sign of life")
        watcher.until(lambda: not axis()["enabled"], "enables are taken away")


@pytest.mark.realtime
def test_acknowledging_does_not_energise(operator):
    """After an alarm that disables the axis, acknowledging leaves it off until it is enabled again."""
    enable(operator)
    operator.do("bench.check", text="")
    operator.hush()
    operator.until(lambda: operator.state["axis"]["axis1"]["alarms"], "alarm 204")
    operator.send('{"kind":"life"}')
    operator.do("control.take")
    operator.command("axis1", "take")
    operator.command("axis1", "ack")
    operator.until(lambda: not operator.state["axis"]["axis1"]["alarms"], "acknowledged")
    before = operator.state["time_s"]
    operator.until(lambda: operator.state["time_s"] > before + 0.2, "some time")
    assert not operator.state["axis"]["axis1"]["enabled"]


def test_time_control(operator):
    """A pause holds bench time, a step is one bus cycle, and a run ends when its condition holds."""
    operator.do("time.pause")
    operator.until(lambda: not operator.state["time"]["running"], "pause")
    operator.do("time.step", cycles=1)
    operator.until(lambda: operator.state["time_s"] * 1000 % 4 == 0, "on a cycle")
    before = operator.state["time_s"]
    operator.do("time.step", cycles=3)
    operator.until(lambda: operator.state["time_s"] != before, "stepped")
    assert operator.state["time_s"] == pytest.approx(before + 0.012)
    operator.do("time.until_time", time_s=before + 0.5)
    operator.until(lambda: operator.state["time"]["met"], "reached")
    assert operator.state["time_s"] == pytest.approx(before + 0.5)
    assert "later" in operator.refused("time.until_time", time_s=before)
    operator.do("time.until_event", event="axis.state", source="axis1")
    operator.command("axis1", "take")
    operator.command("axis1", "enable")
    operator.until(lambda: "axis.state" in operator.state["time"]["met"], "event")
    assert not operator.state["time"]["running"]


def test_samples(operator):
    """Every sample of the subscribed signals comes, once and in order; frames say their layout."""
    operator.samples.clear()
    operator.do("time.run", speed=20.0)
    layout = operator.do(
        "scope.subscribe", signals=["axis1.actual_position", "drive1.torque", "axis1.state"], number=7
    )
    assert layout == [["axis1.actual_position", "axis1.state"], ["drive1.torque"]]
    operator.until(lambda: len(operator.samples) > 20, "frames")
    times = {0: [], 1: []}
    for frame in operator.samples:
        kind, flags, number, rows, group, columns = struct.unpack_from("<BBHIII", frame)
        assert (kind, flags, number) == (1, 0, 7)
        assert columns == len(layout[group])
        assert len(frame) == 16 + 8 * rows * (1 + columns)
        times[group].append(np.frombuffer(frame, "<f8", rows, 16))
    for found in times.values():
        assert np.allclose(np.diff(np.concatenate(found)), 0.004)


def test_saved_samples(operator):
    """What is held of signals between two times is saved in the working folder, and replaces nothing."""
    operator.do("time.until_time", time_s=1.0)
    operator.until(lambda: operator.state["time"]["met"], "recorded")
    window = {
        "signals": ["axis1.actual_position", "axis1.state", "drive1.torque"],
        "from_s": 0.5,
        "to_s": 0.9,
    }
    assert operator.do("scope.hold", **window) == 101
    path = operator.do("scope.save", name="held.npz")
    with np.load(path) as saved:
        assert saved["axis1.time_s"][[0, -1]].tolist() == pytest.approx([0.5, 0.9], abs=0.004)
        assert len(saved["axis1.actual_position"]) == len(saved["axis1.time_s"])
        assert set(saved) == {f"axis1.{one}" for one in ("time_ns", "time_s", "actual_position", "state")} | {
            f"drive1.{one}" for one in ("time_ns", "time_s", "torque")
        }
    assert "already" in operator.refused("scope.save", name="held.npz")
    assert "name" in operator.refused("scope.save", name="../held.npz")


def test_another_bench(operator):
    """A text with a mistake is explained and leaves the bench as it is; a right one is brought up."""
    text = operator.do("bench.text")
    wrong = text.replace("node_id = 5", "node_id = 500")
    assert "node_id" in operator.do("bench.check", text=wrong)
    assert "node_id" in operator.refused("bench.start_text", text=wrong)
    assert operator.state["axis"]["axis1"]
    operator.do("bench.start_text", text=text.replace('name = "reference axis"', 'name = "other"'))
    operator.until(lambda: operator.description["name"] == "other", "other bench")
    operator.do("bench.open", source="reference")


def test_drawn_messages():
    """Drawn messages, right and wrong, are all answered, and the cockpit goes on: a sample of
    `python -m testcases.cockpit_fuzz`.
    """
    counts = fuzz(200, seed=1)
    assert counts["carried out"] > 25
    assert counts["refused"] > 25


def wait_for(condition) -> None:
    end_s = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end_s
        time.sleep(0.01)


class SlowPage:
    """Takes what a page gets, and reads nothing while it is busy."""

    busy = False

    def __init__(self):
        self.frames = []

    def send(self, content):
        self.frames.append(content)


def test_gaps_are_marked(tmp_path):
    """A page that cannot follow gets the newest rows when it can again, and the frame says that some are
    missing; one that lags a little misses nothing.
    """
    pane, page = ScopePane(tmp_path, most_behind=300), SlowPage()
    with load_bench("reference").build() as bench:
        pane.begin(bench)
        message = Subscribe(kind="scope.subscribe", signals=["axis1.actual_position"], number=1)
        pane.handlers[Subscribe](message, page)
        found = []
        for now_s, seconds, busy in (
            (1.0, 0.4, False),
            (2.0, 0.8, True),
            (3.0, 0.2, False),
            (4.0, 4.0, True),
            (5.0, 0.2, False),
        ):
            page.busy = busy
            bench.run_for(seconds)
            pane.pulse(now_s)
        for frame in page.frames:
            _, flags, _, rows, _, _ = struct.unpack_from("<BBHIII", frame)
            found.append((flags, rows))
        pane.end()
    assert found == [(0, 100), (0, 250), (1, 300)]
    lost = np.frombuffer(page.frames[2], "<f8", 1, 16)[0] - np.frombuffer(page.frames[1], "<f8", 250, 16)[-1]
    assert lost == pytest.approx(0.004 * (1050 - 300 + 1))


def test_slow_network():
    """Over a connection that is too slow a jog stops because what the operator sees is old, although every
    sign of life comes in time, and the axis is given back with alarm 204; what waits on the server stays
    small, the page goes on where the connection is better again, and the scope marks the gap.
    """
    with (
        served() as cockpit,
        cockpit.page() as watcher,
        SlowLink(cockpit.port) as link,
        cockpit.page(link.port) as one,
    ):
        axis = lambda: watcher.state["axis"]["axis1"]  # noqa: E731 - the state changes
        one.live()
        one.do("control.take")
        enable(one)
        signals = [signal["name"] for signal in one.description["panes"]["scope"]][:40]
        one.do("scope.subscribe", signals=signals, number=1)
        one.do("time.run", speed=1.0)
        link.delay_s = 0.05
        one.do("axis.jog", axis="axis1", slider=20.0)
        watcher.until(lambda: axis()["velocity"] > 5.0, "jogs")
        link.down = 10_000.0  # an eighth of what the signals need
        watcher.until(lambda: axis()["velocity"] == 0.0, "stops")
        assert watcher.state["operator"] == "page 2"
        assert watcher.do("session.steps")[-1]["text"].startswith("axis1: halt")
        one.send('{"kind":"time.run","speed":8.0}')
        begun_s = watcher.state["time_s"]
        watcher.until(lambda: watcher.state["time_s"] > begun_s + 30.0, "time passes")
        assert [alarm["number"] for alarm in axis()["alarms"]] == [204]
        assert (axis()["master"], one.code) == ("program", None)
        before = len(one.samples)
        link.down, link.delay_s = math.inf, 0.0
        one.until(lambda: watcher.state["time_s"] - one.state["time_s"] < 3.0, "the page is up to date")
        gaps = [number for number, frame in enumerate(one.samples) if frame[1] & 1]
    assert len({one.samples[number][8:12] for number in gaps}) == len(gaps) > 0  # each group once
    assert sum(map(len, one.samples[before : gaps[0]])) < 700_000  # on the server, in the system, on the way


def test_a_full_disk_stops_time():
    """Where the disk has no room for the recording a virtual bench stands still and says why; Run goes on."""
    room = [10**8]
    machine = Machine(load_bench("reference"), Control(), room=lambda: room[0])
    machine.start()
    try:
        wait_for(lambda: machine.pace is not None and machine.pace.held)
        assert "less than 1 GB left" in machine.pace.held
        assert not machine.pace.running
        room[0] = 10**10
        machine.pace.run()
        assert machine.pace.held == ""
    finally:
        machine.stop()


def test_figures_of_the_page(monkeypatch):
    """A sample counts until the first frame that shows it is painted; what is not installed is the reason for
    no figures.
    """
    drawn = [(0.9, 10.0, 10.01), (1.1, 10.2, 10.25), (1.1, 10.3, 10.35), (1.3, 10.4, 10.5)]
    found = latencies([0.9, 1.0, 1.1, 1.2, 1.4], [9.9, 10.0, 10.1, 10.2, 10.4], drawn)
    assert found == pytest.approx([0.25, 0.15, 0.3])
    monkeypatch.setenv("PATH", "")
    assert missing() == "Chromium is not installed"


def test_command_refuses(tmp_path, monkeypatch, capsys, subtests):
    """A host beyond the loopback needs a token file that its owner alone may read; a missing package and a
    missing bench are said in one sentence.
    """
    token = tmp_path / "token"
    token.write_text("0123456789abcdef\n")
    for name, arguments, words in (
        ("no token file", ["--host", "0.0.0.0"], "--token-file"),
        ("readable by others", ["--host", "0.0.0.0", "--token-file", str(token)], "chmod 600"),
        ("no bench", ["nowhere.toml"], "nowhere.toml"),
    ):
        with subtests.test(name):
            assert main(["cockpit", *arguments]) == 2
            assert words in capsys.readouterr().err
    monkeypatch.setattr("hil._commands.cockpit.find_spec", lambda _: None)
    assert main(["cockpit"]) == 2
    assert "pip install 'motion-hil[cockpit]'" in capsys.readouterr().err
