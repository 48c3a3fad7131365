"""What the cockpit costs and how quickly it shows, for `hil benchmark`: a page in Chromium on this machine.

The bench, its server and the page are those of `hil cockpit`. Times are of the one clock of the machine,
taken in the thread of the bench at the end of each cycle, and in the page behind the painting of a frame.
"""

from __future__ import annotations

import json
import secrets
import socket
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from hil._commands._chromium import ChromiumPage, chromium, find_chromium
from hil._commands._measurements import Figure
from hil.errors import CannotRunError

if TYPE_CHECKING:
    from hil.bench import BenchFile
    from hil.bench.bench import Bench

_CLICKS: Final = 30
_SIGNALS: Final = ("position_setpoint", "actual_position", "velocity_setpoint", "actual_velocity")
_WINDOW_S: Final = 5
"""Window of the scope: 5,000 points of each signal at a cycle of 1 ms."""
_LIVE: Final = {
    'interface = "socketcan"\nchannel = "vcan0"': 'interface = "udp_multicast"\nchannel = "239.74.163.2"\n'
    "options = {{ port = {port}, hop_limit = 0 }}",
    "cycle_ms = 20": "cycle_ms = 1",
    "servo_period_us = 2000": "servo_period_us = 1000",
    "grace_cycles = 12": "grace_cycles = 1000",
    "missing_setpoints = 15": "missing_setpoints = 0",
}
"""What changes in the embedded live bench: its bus is the loopback, its cycle 1 ms; lateness is no fault."""
_LOG: Final = """
const log = (window.drawn = []);
window.pressed = [];
const wall = () => (performance.timeOrigin + performance.now()) / 1000;
addEventListener("drawn", (event) => {
  const begun = event.detail.begun / 1000 + performance.timeOrigin / 1000;
  const channel = new MessageChannel();  // its message comes behind the painting of this frame
  channel.port1.onmessage = () => { log.push([event.detail.end, begun, wall()]); channel.port1.close(); };
  channel.port2.postMessage(0);
});
addEventListener("pointerdown", () => window.pressed.push(wall()), true);
"""


def missing() -> str:
    """Return why the cockpit cannot be measured here; empty: it can."""
    if any(find_spec(name) is None for name in ("starlette", "uvicorn", "websockets")):
        return "the extra cockpit is not installed"
    return "" if find_chromium() else "Chromium is not installed"


def cockpit_figures(seconds: float) -> list[Figure]:
    """Measure the cockpit.

    Args:
        seconds: Time of each measurement, s.

    Raises:
        CannotRunError: A page does not come up.

    """
    program = find_chromium()
    if program is None:
        raise CannotRunError("Chromium is not installed")
    return [*_page_figures(program, seconds), *_live_figures(program, seconds)]


class Stamps:
    """When each cycle ended on the clock of the machine, and when a setpoint was there.

    Args:
        bench: Its cycles are watched.

    """

    def __init__(self, bench: Bench) -> None:
        self.bench_s: list[float] = []
        self.wall_s: list[float] = []
        self.moved_s: list[float] = []
        """When the velocity setpoint of the first axis became other than 0."""
        self.moves = False
        """Whether there is a velocity setpoint now."""
        self._scheduler = bench.scheduler
        self._velocity = bench.recorder.reader(f"{bench.axis_names[0]}.velocity_setpoint")
        bench.on_cycle(self._take)

    def _take(self) -> None:
        wall_s = time.time()
        self.bench_s.append(self._scheduler.now * 1e-9)
        self.wall_s.append(wall_s)
        moves = bool(self._velocity())
        if moves and not self.moves:
            self.moved_s.append(wall_s)
        self.moves = moves

    def clear(self) -> None:
        """Forget what was."""
        self.bench_s, self.wall_s, self.moved_s = [], [], []


def latencies(
    bench_s: Sequence[float], wall_s: Sequence[float], drawn: Sequence[Sequence[float]]
) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Return how long each sample took to the first frame that shows it, s.

    Args:
        bench_s: Times of the samples, in order, s.
        wall_s: When each was taken, s.
        drawn: Of each frame the newest sample, when it was begun, and when it was painted, s.

    """
    frames = np.asarray(drawn, dtype=np.float64).reshape(-1, 3)
    times, walls = np.asarray(bench_s), np.asarray(wall_s)
    first = np.searchsorted(frames[:, 0], times - 1e-7)
    # What was there before the first frame, and what no frame shows any more, is not counted.
    shown = (first > 0) & (first < len(frames))
    found: np.ndarray[tuple[int], np.dtype[np.float64]] = frames[first[shown], 2] - walls[shown]
    return found


@contextmanager
def _cockpit(file: BenchFile) -> Iterator[tuple[str, str, Callable[[], Stamps]]]:
    """Serve a cockpit; gives origin, token, and the stamps of its bench, when that is up."""
    from hil.cockpit.assembly import cockpit
    from hil.cockpit.pane import Pane
    from hil.cockpit.server import http_server

    made: list[Stamps] = []
    up = threading.Event()

    class Watching(Pane):
        """Takes the stamps of the bench that is up."""

        name = "measurement"

        def begin(self, bench: Bench) -> None:
            made.append(Stamps(bench))
            up.set()

    def stamps() -> Stamps:
        if not up.wait(60.0):
            raise CannotRunError(f"the bench {file.name} does not come up")
        return made[0]

    token = secrets.token_urlsafe(24)
    with tempfile.TemporaryDirectory() as work, socket.create_server(("127.0.0.1", 0)) as listening:
        host = f"127.0.0.1:{listening.getsockname()[1]}"
        port = int(listening.getsockname()[1])
        app = cockpit(file, token=token, port=port, hosts=[host], folder=Path(work), further=[Watching()])
        server = http_server(app)
        thread = threading.Thread(target=lambda: server.run(sockets=[listening]), daemon=True)
        thread.start()
        try:
            yield f"http://{host}", token, stamps
        finally:
            server.should_exit = True
            thread.join(30.0)


def _enter(page: ChromiumPage, origin: str, token: str, file: BenchFile, axis: str) -> None:
    """Open the page with the scope that is measured, and take control."""
    channels = json.dumps([{"name": f"{axis}.{one}"} for one in _SIGNALS])
    stored = f"localStorage.setItem({json.dumps(f'scope {file.source}')}, {json.dumps(channels)});"
    page.open(f"{origin}/#token={token}", before=f"{_LOG}if (location.protocol === 'http:') {stored}")
    page.until("document.documentElement?.dataset.bench === 'up'", "the bench")
    _press(page, "Take control", "header")


def _press(page: ChromiumPage, words: str, within: str) -> None:
    button = (
        f"[...document.querySelectorAll({json.dumps(within + ' button')})]"
        f".find((one) => one.textContent === {json.dumps(words)} && !one.disabled)"
    )
    page.until(button, f"the button {words}")
    page.js(f"{button}.click()")


def _page_figures(program: str, seconds: float) -> list[Figure]:
    """Measure a page on a virtual bench with a cycle of 1 ms in real time."""
    from hil.bench import load_bench

    file = load_bench("fast")
    with _cockpit(file) as (origin, token, stamps_of), chromium(program) as page:
        stamps = stamps_of()
        axis = next(iter(file.config.axis))
        alone = _processor(seconds)
        _enter(page, origin, token, file, axis)
        page.js("document.getElementById('tab-axis').click()")
        _press(page, "Enable", "#view-axis")
        page.until("document.querySelector('#view-axis .badge').textContent === 'standstill'", "the axis")
        clicks = [_click(page, stamps) for _ in range(_CLICKS)]
        page.js("document.getElementById('tab-scope').click()")
        page.js(
            "{const one = document.querySelector('#view-scope select'); one.value = "
            f"'{_WINDOW_S}'; one.dispatchEvent(new Event('change'))}}"
        )
        time.sleep(_WINDOW_S)
        stamps.clear()
        page.js("window.drawn.length = 0")
        watched = _processor(seconds)
        drawn = page.js("window.drawn")
        shown = 1000.0 * latencies(stamps.bench_s, stamps.wall_s, drawn)
    if not len(shown):
        raise CannotRunError("the scope has drawn nothing")
    frames = 1000.0 * np.array([painted - begun for _, begun, painted in drawn])
    return [
        *_spread("cockpit_click_to_setpoint", 1000.0 * np.array(clicks)),
        *_spread("cockpit_sample_to_pixel", shown),
        Figure("cockpit_redraws_4x5000_points", len(drawn) / seconds, "frames/s"),
        Figure("cockpit_redraw_4x5000_points", float(np.median(frames)), "ms"),
        Figure("cockpit_processor", alone, "ms/s"),
        Figure("cockpit_processor_watched", watched, "ms/s"),
    ]


def _processor(seconds: float) -> float:
    """Return the processor time of server and bench in a second, ms."""
    begun_s = time.process_time()
    time.sleep(seconds)
    return 1000.0 * (time.process_time() - begun_s) / seconds


def _click(page: ChromiumPage, stamps: Stamps) -> float:
    """Hold the jog key for a moment; returns the time from the press to the first setpoint, s."""
    place = page.js(
        "(() => { const one = document.querySelector('[aria-label=\"Jog forward\"]'); "
        "one.scrollIntoView({block: 'center'}); const box = one.getBoundingClientRect(); "
        "window.pressed.length = 0; return [box.x + box.width / 2, box.y + box.height / 2]; })()"
    )
    stamps.clear()
    page.mouse("mousePressed", *place)
    _wait(lambda: stamps.moved_s, "a jog in the page moves nothing")
    page.mouse("mouseReleased", *place)
    _wait(lambda: not stamps.moves, "a jog does not end")
    return float(stamps.moved_s[0] - page.js("window.pressed")[0])


def _wait(condition: Callable[[], object], otherwise: str) -> None:
    end_s = time.monotonic() + 10.0
    while not condition():
        if time.monotonic() > end_s:
            raise CannotRunError(otherwise)
        time.sleep(0.01)


def _live_figures(program: str, seconds: float) -> list[Figure]:
    """Measure the cycles of a live bench at 1 ms, without and with a page that watches its scope."""
    from hil.bench import BenchFile, load_bench

    text = load_bench("live").text
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("", 0))
        port = int(probe.getsockname()[1])
    for old, new in _LIVE.items():
        if text.count(old) != 1:
            raise CannotRunError(f"the embedded live bench has no single {old!r}")
        text = text.replace(old, new.format(port=port))
    file = BenchFile("live at 1 ms", text)
    with _cockpit(file) as (origin, token, stamps_of):
        stamps = stamps_of()
        alone = _jitter(stamps, seconds)
        with chromium(program) as page:
            _enter(page, origin, token, file, next(iter(file.config.axis)))
            page.js("document.getElementById('tab-scope').click()")
            page.until("window.drawn.length > 10", "the scope")
            watched = _jitter(stamps, seconds)
    return [
        Figure("cockpit_live_1ms_jitter_p99", alone, "ms"),
        Figure("cockpit_live_1ms_jitter_watched_p99", watched, "ms"),
    ]


def _jitter(stamps: Stamps, seconds: float) -> float:
    """Return the 99th percentile of how far a cycle of 1 ms is from 1 ms behind the one before, ms."""
    time.sleep(1.0)
    stamps.clear()
    time.sleep(seconds)
    return float(np.percentile(np.abs(1000.0 * np.diff(np.array(stamps.wall_s)) - 1.0), 99))


def _spread(name: str, values_ms: np.ndarray[tuple[int], np.dtype[np.float64]]) -> list[Figure]:
    median, high = np.percentile(values_ms, [50, 99])
    return [Figure(f"{name}_median", float(median), "ms"), Figure(f"{name}_p99", float(high), "ms")]
