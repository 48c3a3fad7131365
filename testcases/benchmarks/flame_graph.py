"""Where a moving bench spends its processor time, as a flame graph.

    python -m testcases.benchmarks.flame_graph [NAME] [--seconds S] [-o FILE]      ordinary Python, sampled
    perf script | python -m testcases.benchmarks.flame_graph --perf - -o FILE      compiled, sampled by perf

`NAME` is one of the `sim_factor_...` of `hil benchmark`. A timer of the process's own processor time takes
the stack of Python every millisecond, so that other work on the machine changes nothing. Samples of
`perf record -g` are shown in the same way; their functions have names when the core was compiled with
`--symbols`.

The file is an SVG: a box is as wide as its share of all samples, what it calls is below it, and pointing at
it shows name and share. Colours are areas. Python notices the timer at the next call or turn of a loop, so
that samples of a short function may count for the one after it.
"""

from __future__ import annotations

import argparse
import re
import signal
import sys
import tomllib
from collections.abc import Iterable, Iterator
from functools import cache
from html import escape
from pathlib import Path
from types import FrameType
from typing import Final

from fieldbus import core_build
from hil._commands._measurements import MovingBench, moving_benches

ROOT: Final = Path(__file__).resolve().parents[2]
INTERVAL_S: Final = 0.001
LEAST: Final = 0.004
"""Share below which a box is left out."""
WIDTH: Final = 1200
ROW: Final = 17
FONT: Final = 'font-family="monospace" font-size="10"'
AREAS: Final = (
    ("fieldbus/can/", "CAN: arbitration, timing, frames, ports", "#d95f02"),
    ("fieldbus/canopen/", "CANopen: PDOs, SYNC", "#e6ab02"),
    ("fieldbus/profidrive/", "PROFIdrive telegrams", "#ffd92f"),
    ("fieldbus/modbus/", "Modbus", "#e5c494"),
    ("fieldbus/", "scheduler, clock of the node", "#7570b3"),
    ("emulators/drive/core", "servo, mechanics, encoder", "#66a61e"),
    ("emulators/mechanics/", "servo, mechanics, encoder", "#66a61e"),
    ("emulators/encoder/", "servo, mechanics, encoder", "#66a61e"),
    ("emulators/", "drive: state machine, modes, protection", "#1b9e77"),
    ("motion/s7/instructions/", "instructions, program", "#e7298a"),
    ("motion/s7/program", "instructions, program", "#e7298a"),
    ("motion/", "motion: axis, control, monitoring, ports", "#80b1d3"),
    ("hil/", "recorder, bench", "#a6761d"),
)
OTHER: Final = ("Python and its library", "#bbbbbb")


class Node:
    """A function in its stack, with the samples in it and in what it calls."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.samples = 0
        self.own = 0
        self.called: dict[str, Node] = {}

    def add(self, stack: Iterable[str]) -> None:
        """Count a sample; outermost function first."""
        node = self
        node.samples += 1
        for name in stack:
            node = node.called.setdefault(name, Node(name))
            node.samples += 1
        node.own += 1


def area_of(name: str) -> tuple[str, str]:
    """Return area and colour of a function: `motion/s7/axis/axis.py: PositioningAxis.cycle`."""
    for begin, area, colour in AREAS:
        if name.startswith(begin):
            return area, colour
    return OTHER


def sampled(name: str, seconds: float) -> Node:
    """Return the stacks of a moving bench, from the scheduler's loop on, over `seconds` of processor time."""
    root = Node("")
    stacks: list[list[str]] = []

    def take(_number: int, frame: FrameType | None) -> None:
        stack: list[str] = []
        while frame is not None and frame.f_code.co_name not in {"_run", "run_until"}:
            code = frame.f_code
            path = Path(code.co_filename)
            place = path.relative_to(ROOT).as_posix() if path.is_relative_to(ROOT) else path.stem
            stack.append(f"{place}: {code.co_qualname}")
            frame = frame.f_back
        if frame is not None:
            stacks.append(stack[::-1] or ["fieldbus/clock.py: VirtualScheduler._run"])

    moving = MovingBench(moving_benches()[name])
    with moving.bench:
        moving.advance(0.5)
        before = signal.signal(signal.SIGPROF, take)
        signal.setitimer(signal.ITIMER_PROF, INTERVAL_S, INTERVAL_S)
        try:
            while len(stacks) < seconds / INTERVAL_S:
                moving.advance(0.05)
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0.0)
            signal.signal(signal.SIGPROF, before)
    for stack in stacks:
        root.add(stack)
    return root


_COMPILED = re.compile(r"CPy(?:Def|Py)_(\w+)")
"""A function of the compiled core, or its wrapper: `CPyDef_section___BusSection____end_of_frame`. It begins
with as many of the last words of its module's name as make it the only one.
"""


@cache
def _modules() -> dict[str, list[str]]:
    """Return the modules of the core by the ends of their names."""
    content = tomllib.loads((ROOT / "core.toml").read_text(encoding="utf-8"))
    ends: dict[str, list[str]] = {}
    for module in content["modules"]:
        words = module.split(".")
        for begin in range(len(words)):
            ends.setdefault("___".join(words[begin:]), []).append("/".join(words))
    return ends


@cache
def _compiled(symbol: str) -> str:
    """Return file and name of a function of the compiled core; empty: it is none."""
    found = _COMPILED.search(symbol)
    if found is None:
        return ""
    words = found[1].split("___")
    for end in range(len(words) - 1, 0, -1):
        modules = _modules().get("___".join(words[:end]), [])
        if len(modules) == 1:
            name = re.sub(r"__\w+_obj$", "", words[end])  # a function within a function
            inner = ".".join(one for one in words[end + 1 :] if one != "__call__" and one)
            return f"{modules[0]}.py: {name}{'.' * bool(inner)}{inner}"
    return ""


def read_perf(lines: Iterable[str]) -> Node:
    """Return the stacks of `perf script`; functions outside of the core count for what has called them."""
    root = Node("")
    for frames in _stacks(lines):
        names = [name for name in map(_compiled, reversed(frames)) if name]
        for place, name in enumerate(names):
            if name.endswith("VirtualScheduler._run"):
                inner = zip(names[place + 1 :], names[place:-1], strict=True)  # a wrapper has the same name
                root.add([one for one, before in inner if one != before] or [name])
                break
    return root


def _stacks(lines: Iterable[str]) -> Iterator[list[str]]:
    frames: list[str] = []
    for line in lines:
        text = line.strip()
        if not text and frames:
            yield frames
            frames = []
        elif line[:1].isspace() and text:
            frames.append(text)
    if frames:
        yield frames


def areas(root: Node) -> dict[str, float]:
    """Return the share of each area: the samples in its own functions, and in Python's library for them."""
    shares: dict[str, float] = {}

    def walk(node: Node, area: str) -> None:
        own = area_of(node.name)[0]
        if own != OTHER[0]:
            area = own
        shares[area] = shares.get(area, 0.0) + node.own / root.samples
        for one in node.called.values():
            walk(one, area)

    for one in root.called.values():
        walk(one, OTHER[0])
    return dict(sorted(shares.items(), key=lambda item: -item[1]))


def drawn(root: Node, title: str) -> str:
    """Return the flame graph as SVG."""
    boxes: list[str] = []
    deepest = 0

    def draw(node: Node, left: float, depth: int) -> None:
        nonlocal deepest
        share = node.samples / root.samples
        if share < LEAST:
            return
        deepest = max(deepest, depth)
        width = share * WIDTH
        name = node.name.rpartition(": ")[2]
        shown = escape(name if len(name) * 6.2 < width else name.rpartition(".")[2])
        area, colour = area_of(node.name)
        fits = len(shown) * 6.2 < width
        text = f'<text x="{left + 2:.1f}" y="{depth * ROW + 12}">{shown}</text>' if fits else ""
        boxes.append(
            f"<g><title>{escape(node.name)}, {100.0 * share:.1f} %, {escape(area)}</title>"
            f'<rect x="{left:.1f}" y="{depth * ROW}" width="{width - 0.4:.1f}" height="{ROW - 1}" '
            f'fill="{colour}"/>{text}</g>'
        )
        for one in sorted(node.called.values(), key=lambda one: -one.samples):
            draw(one, left, depth + 1)
            left += one.samples / root.samples * WIDTH

    left = 0.0
    for one in sorted(root.called.values(), key=lambda one: -one.samples):
        draw(one, left, 4)
        left += one.samples / root.samples * WIDTH
    height = (deepest + 1) * ROW
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" {FONT}>',
        f'<rect width="{WIDTH}" height="{height}" fill="#ffffff"/>',
        f'<text x="2" y="12" font-size="12">{escape(title)}</text>',
        *_legend(areas(root)),
    )
    return "\n".join((*head, *boxes, "</svg>", ""))


def _legend(shares: dict[str, float]) -> Iterator[str]:
    colours = {OTHER[0]: OTHER[1]} | {area: colour for _, area, colour in AREAS}
    for place, (area, share) in enumerate(shares.items()):
        left, top = place % 4 * WIDTH // 4, (1 + place // 4) * ROW
        yield f'<rect x="{left}" y="{top}" width="12" height="{ROW - 3}" fill="{colours[area]}"/>'
        yield f'<text x="{left + 16}" y="{top + 11}">{escape(area)} {100.0 * share:.0f} %</text>'


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    known = list(moving_benches())
    parser.add_argument(
        "name", nargs="?", default=known[0], choices=known, metavar="NAME", help=", ".join(known)
    )
    parser.add_argument("--seconds", type=float, default=10.0, help="processor time, default 10 s")
    parser.add_argument("--perf", metavar="FILE", help="output of `perf script`; -: standard input")
    parser.add_argument("-o", "--output", type=Path, default=Path("flame.svg"), metavar="FILE")
    arguments = parser.parse_args()
    if arguments.perf is None:
        core_build.restart_pure()
        root, core = sampled(arguments.name, arguments.seconds), "pure"
    elif arguments.perf == "-":
        root, core = read_perf(sys.stdin), "compiled"
    else:
        with Path(arguments.perf).open(encoding="utf-8") as file:
            root, core = read_perf(file), "compiled"
    if not root.samples:
        parser.error("there are no samples of the scheduler's loop")
    arguments.output.write_text(
        drawn(root, f"{arguments.name}, {core}, {root.samples} samples"), encoding="utf-8"
    )
    for area, share in areas(root).items():
        print(f"{100.0 * share:5.1f} %  {area}")


if __name__ == "__main__":
    main()
