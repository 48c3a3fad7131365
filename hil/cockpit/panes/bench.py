"""The bench as a picture: controller, segments, devices, axes; its event log; its file, opened or edited."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from functools import cache
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

from pydantic import Field

from fieldbus.can.medium import CanMedium
from fieldbus.errors import HilError
from hil.bench import EMBEDDED, BenchFile, load_bench
from hil.cockpit.messages import Message, MessageError
from hil.cockpit.pane import Handler, Pane

if TYPE_CHECKING:
    from collections.abc import Iterable

    from fieldbus.history import Event
    from hil.bench.bench import Bench
    from hil.cockpit.client import Client
    from hil.cockpit.machine import Machine

_MOST_EVENTS: Final = 200
"""Events that go to the pages at once; of more only the last ones, with the number of those left out."""
_MOST_FILES: Final = 200
_MOST_FOLDERS: Final = 500
_DEEPEST: Final = 3
_LOAD_SHARE: Final = 0.2
"""Share of the newest load in the one that is shown."""


class ResetBench(Message):
    """Close the bench and bring it up anew."""

    kind: Literal["bench.reset"]


class OpenBench(Message):
    """Close the bench and bring up another one: an embedded name, or a file below the working folder."""

    kind: Literal["bench.open"]
    source: Annotated[str, Field(min_length=1, max_length=300)]


class StartText(Message):
    """Close the bench and bring up one of an edited text."""

    kind: Literal["bench.start_text"]
    text: Annotated[str, Field(max_length=200_000)]


class CheckText(Message):
    """Say what is wrong with a text of a bench file."""

    operates = False
    aside = True
    kind: Literal["bench.check"]
    text: Annotated[str, Field(max_length=200_000)]


class ShowText(Message):
    """Return the text of the bench file."""

    operates = False
    aside = True
    kind: Literal["bench.text"]


class ShowSchema(Message):
    """Return the JSON Schema of bench files, which has the help for every key."""

    operates = False
    aside = True
    kind: Literal["bench.schema"]


class ListBenches(Message):
    """Return what can be opened."""

    operates = False
    aside = True
    kind: Literal["bench.list"]


class ListEvents(Message):
    """Return the last events."""

    operates = False
    kind: Literal["bench.events"]
    most: Annotated[int, Field(ge=1, le=5000)] = 200


class BenchPane(Pane):
    """The bench as a whole.

    Args:
        machine: Has the bench.
        folder: Bench files below it may be opened.

    """

    name = "bench"

    def __init__(self, machine: Machine, folder: Path) -> None:
        self._machine = machine
        self._folder = folder.resolve()
        self._bench: Bench | None = None
        self._seen = 0
        self._loads: dict[str, float] = {}
        self._readers: dict[str, Callable[[], float | None]] = {}
        self._states: dict[str, tuple[Callable[[], float | None], Mapping[int, str]]] = {}

    @property
    def handlers(self) -> Mapping[type[Message], Handler]:
        """What it takes."""
        return {
            ResetBench: lambda _, __: self._machine.open(self._machine.bench_file),
            OpenBench: self._open,
            StartText: self._start_text,
            CheckText: self._check,
            ShowText: lambda _, __: self._machine.bench_file.text,
            ShowSchema: lambda _, __: _schema(),
            ListBenches: lambda _, __: {"embedded": EMBEDDED, "files": self._files()},
            ListEvents: self._events,
        }

    # -- another bench
    # -------------------------------------------------------------------------------------------

    def _files(self) -> list[str]:
        """Return the bench files of the folder, without looking through a whole disk."""
        found: list[str] = []
        for parent, folders, files in islice(os.walk(self._folder), _MOST_FOLDERS):
            place = Path(parent).relative_to(self._folder)
            deep = len(place.parts) >= _DEEPEST
            folders[:] = [] if deep else sorted(one for one in folders if not one.startswith("."))
            found += [(place / one).as_posix() for one in sorted(files) if one.endswith(".toml")]
            if len(found) >= _MOST_FILES:
                break
        return found[:_MOST_FILES]

    def _open(self, message: OpenBench, _: Client) -> None:
        source = message.source
        if source not in EMBEDDED:
            path = (self._folder / source).resolve()
            if path.suffix != ".toml" or not path.is_relative_to(self._folder):
                raise MessageError("source: an embedded bench, or a file *.toml below the working folder")
            source = str(path)
        self._machine.open(load_bench(source))

    def _start_text(self, message: StartText, _: Client) -> None:
        self._machine.open(BenchFile(self._machine.bench_file.source, message.text))

    def _check(self, message: CheckText, _: Client) -> str:
        try:
            BenchFile(self._machine.bench_file.source, message.text)
        except HilError as error:
            return str(error)
        return ""

    # -- what there is
    # -------------------------------------------------------------------------------------------

    def begin(self, bench: Bench) -> None:
        """Take up a bench."""
        self._bench = bench
        self._seen = len(bench.history.events)
        self._loads = {}
        self._readers = {
            name: bench.recorder.reader(f"{name}.load")
            for name in bench.segment_names
            if bench.recorder.has_signal(f"{name}.load")
        }
        self._states = {
            group.name: (group.reader("state"), group.enums["state"])
            for group in bench.recorder.groups
            if "state" in group.enums and group.name not in bench.config.axis
        }

    def end(self) -> None:
        """Let go of it."""
        self._bench = None
        self._readers, self._states = {}, {}

    def pulse(self, now_s: float) -> None:  # noqa: ARG002 - the load of every slice counts
        """Smooth the loads, and tell of new events."""
        for name, read in self._readers.items():
            load = read()
            if load is not None:
                before = self._loads.get(name, load)
                self._loads[name] = before + _LOAD_SHARE * (load - before)
        bench = self._bench
        if bench is None:
            return
        events = bench.history.events
        new = len(events) - self._seen
        if new < 0:  # the recording has been forgotten
            new = len(events)
            self._seen = 0
        if new:
            shown = events[max(self._seen, len(events) - _MOST_EVENTS) :]
            self._seen = len(events)
            self._machine.broadcast(
                {"kind": "events", "left_out": new - len(shown), "events": _as_json(shown)}
            )

    def _events(self, message: ListEvents, _: Client) -> list[list[Any]]:
        return _as_json(self._machine.the_bench().history.events[-message.most :])

    def description(self) -> object:
        """Return segments with what hangs on them, and which axis each drive moves."""
        bench = self._bench
        if bench is None:
            return None
        config = bench.config
        moved = {table.drive: name for name, table in config.axis.items() if table.drive}
        return {
            "cycle_ms": config.bench.cycle_ms,
            "controllers": ["controller", *bench.controllers],
            "segments": [
                {
                    "name": name,
                    "kind": table.kind,
                    "bitrate": getattr(table, "bitrate", None),
                    "devices": [_device(bench, one, moved) for one in bench.nodes_on(name)],
                }
                for name, table in config.segment.items()
            ],
            "axes": [_axis(name, table) for name, table in config.axis.items()],
        }

    def state(self) -> object:
        """Return loads, error counters and states."""
        bench = self._bench
        if bench is None:
            return None
        segments = {}
        for name in bench.segment_names:
            segment = bench.segment(name)
            segments[name] = {
                "load": self._loads.get(name),
                "ports": [[port.name, port.state.value, port.tec, port.rec] for port in segment.ports]
                if isinstance(segment, CanMedium)
                else [],
            }
        return {
            "controller": bench.controller.state.value,
            "segments": segments,
            "devices": {name: self._device_state(name) for name in self._states},
            "nodes": {
                node.name: node.boot_state.value
                for network in bench.network_names
                for node in bench.network(network).nodes.values()
            },
        }

    def _device_state(self, name: str) -> str | None:
        read, texts = self._states[name]
        value = read()
        return None if value is None else texts.get(int(value), f"{value:g}")


def _device(bench: Bench, name: str, moved: Mapping[str, str]) -> dict[str, object]:
    config = bench.config
    for kind, tables in (
        ("drive", config.drive),
        ("encoder", config.encoder),
        ("station", config.station),
        ("device", config.device),
    ):
        if name in tables:
            table: Any = tables[name]
            return {
                "name": name,
                "kind": kind,
                "profile": getattr(table, "profile", ""),
                "physical": getattr(table, "device", "") == "physical",
                "address": getattr(table, "node_id", None) or getattr(table, "unit", None),
                "axis": moved.get(name),
            }
    return {"name": name, "kind": "device", "profile": "", "physical": False, "address": None, "axis": None}


def _axis(name: str, table: Any) -> dict[str, object]:
    return {
        "name": name,
        "drive": getattr(table, "drive", None),
        "leading": list(getattr(table, "leading", None) or ()),
    }


def _as_json(events: Iterable[Event]) -> list[list[Any]]:
    return [[event.time_ns / 1e9, event.source, event.kind, event.data] for event in events]


@cache
def _schema() -> object:
    from hil.bench.schema import json_schema

    return json_schema()
