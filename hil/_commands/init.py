"""`hil init`: a bench file and a test for axes of one's own, which pass at once."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from fieldbus.errors import ConfigurationError, UnknownNameError
from hil._commands.terminal import console
from hil.bench.bench_file import parse
from hil.errors import CannotRunError

BENCH: Final = "bench.toml"
TEST: Final = "test_bench.py"
BUSES: Final = {
    "cia402": ("can",),
    "profidrive": ("can", "modbus_tcp", "modbus_rtu"),
    "analog": ("modbus_tcp",),
    "tm_pto": ("can",),
}
"""Buses of each profile of a drive; the first one is the default."""
_DRIVES: Final = {
    "cia402": "servo drive with CiA 402 on CANopen",
    "profidrive": "servo drive with PROFIdrive telegram 105",
    "analog": "drive with an analog setpoint at an I/O station",
    "tm_pto": "stepper motor behind a pulse module",
}
_SEGMENTS: Final = {"can": "can0", "modbus_tcp": "net0"}
_INCREMENTS: Final = {"cia402": 131072, "profidrive": 2048, "analog": 131072, "tm_pto": 2000}
_NAME: Final = re.compile(r"[A-Za-z]\w*", re.ASCII)


@dataclass(frozen=True, slots=True)
class AxisWish:
    """An axis as the user wants it."""

    name: str
    drive: str = "cia402"
    bus: str = "can"
    number: int = 1
    """Its place among the axes, from 1."""

    @property
    def segment(self) -> str:
        """Segment of its drive; a serial line for each drive with Modbus RTU."""
        return _SEGMENTS.get(self.bus, f"{self.name}_line")

    @property
    def node_id(self) -> int:
        """CANopen node-ID of its drive."""
        return self.number

    @property
    def increments(self) -> int:
        """Resolution of the encoder of its drive."""
        return _INCREMENTS[self.drive]


def parse_axis(text: str, number: int) -> AxisWish:
    """Read `NAME`, `NAME=DRIVE` or `NAME=DRIVE/BUS`.

    Raises:
        ConfigurationError: There is no such drive or bus, or the name is none.

    """
    name, _, kind = text.partition("=")
    drive, slash, bus = kind.partition("/")
    drive = drive or "cia402"
    if not _NAME.fullmatch(name):
        raise ConfigurationError(
            "--axis", text, "NAME, NAME=DRIVE or NAME=DRIVE/BUS, for example z=profidrive/modbus_tcp"
        )
    if drive not in BUSES:
        raise UnknownNameError(f"--axis {text}", drive, "a profile of a drive", BUSES)
    if slash and bus not in BUSES[drive]:
        raise UnknownNameError(f"--axis {text}", bus, f"a bus of {drive}", BUSES[drive])
    return AxisWish(name, drive, bus or BUSES[drive][0], number)


def ask(answer: Callable[[str, str], str]) -> list[AxisWish]:
    """Ask for the axes.

    Args:
        answer: Shows a question with its default, and returns what the user says.

    """
    wishes: list[AxisWish] = []
    names = answer("Names of the axes, separated by blanks", "x")
    for number, name in enumerate(names.replace(",", " ").split(), start=1):
        drive = answer(f"Drive of {name} ({', '.join(BUSES)})", "cia402")
        bus = ""
        if len(BUSES.get(drive, ())) > 1:
            bus = "/" + answer(f"Bus of the drive of {name} ({', '.join(BUSES[drive])})", BUSES[drive][0])
        wishes.append(parse_axis(f"{name}={drive}{bus}", number))
    return wishes


def init_bench(folder: Path, axes: Sequence[str]) -> int:
    """Write bench file and test; returns the exit code.

    Args:
        folder: Where they go; it is made if it is not there.
        axes: What `parse_axis` reads; empty: the user is asked, or gets an axis x where nobody can answer.

    Raises:
        CannotRunError: One of the files is there already, or cannot be written.
        ConfigurationError: An axis is wrong, or two have one name.

    """
    bench_file, test_file = folder / BENCH, folder / TEST
    for path in (bench_file, test_file):
        if path.exists():
            raise CannotRunError(f"{path} is there already; hil init overwrites nothing: name another folder")
    if axes or not sys.stdin.isatty():
        wishes = [parse_axis(text, number) for number, text in enumerate(axes or ("x",), start=1)]
    else:
        import typer

        wishes = ask(lambda question, default: str(typer.prompt(question, default=default, err=True)))
    names = [wish.name for wish in wishes]
    for name in names:
        if names.count(name) > 1:
            raise ConfigurationError("--axis", name, "each name once")
    texts = {bench_file: _rendered("bench.toml", wishes), test_file: _rendered("test_bench.py", wishes)}
    parse(texts[bench_file], BENCH)  # two things may have got one name
    for path, text in texts.items():
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with path.open("x", encoding="utf-8") as file:
                file.write(text)
        except OSError as error:
            raise CannotRunError(f"{path}: {error.strerror}") from error
    out = console()
    for path in texts:
        out.print(f"written: {path}", markup=False, soft_wrap=True)
    out.print(f"next: hil check {bench_file}; pytest {test_file}", markup=False, soft_wrap=True)
    return 0


def _rendered(name: str, wishes: Sequence[AxisWish]) -> str:
    from importlib.resources import files

    from jinja2 import Environment, StrictUndefined

    slow = any(wish.bus == "modbus_rtu" for wish in wishes)
    environment = Environment(  # noqa: S701 - TOML and Python, no HTML
        trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True, undefined=StrictUndefined
    )
    template = environment.from_string(
        (files("hil") / "data" / "init" / f"{name}.jinja").read_text(encoding="utf-8")
    )
    kinds = {wish.segment: wish.bus for wish in wishes}
    names = f"axis {wishes[0].name}" if len(wishes) == 1 else f"axes {', '.join(one.name for one in wishes)}"
    return template.render(
        names=names[0].upper() + names[1:] if name == BENCH else names,
        title=f"my {names}",
        bench_file=BENCH,
        test_file=TEST,
        cycle_ms=24 if slow else 4,
        segments=[{"name": segment, "kind": kind} for segment, kind in kinds.items()],
        axes=wishes,
        # A serial line takes long for a cycle: position control is softer by as much.
        kv=5.0 if slow else 20.0,
        following_min=10.0 if slow else 2.0,
        following_max=20.0 if slow else 10.0,
        alarm_s=0.1 if slow else 0.03,
    )
