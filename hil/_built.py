"""Who hears of every bench that a bench file builds: the pytest plugin, and `hil diag` of a test."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

if TYPE_CHECKING:
    from hil.protocols import Bench, BenchFile

Listener = Callable[["Bench", "BenchFile[Bench]"], object]

_listeners: list[Listener] = []
_files: WeakKeyDictionary[Bench, BenchFile[Bench]] = WeakKeyDictionary()


def listen(listener: Listener) -> Callable[[], None]:
    """Call `listener` with every bench as soon as it is built, and with its bench file; returns the function
    that ends it.
    """
    _listeners.append(listener)

    def end() -> None:
        if listener in _listeners:
            _listeners.remove(listener)

    return end


def announce(bench: Bench, bench_file: BenchFile[Bench]) -> None:
    """Tell of a bench that has been built."""
    _files[bench] = bench_file
    for listener in tuple(_listeners):
        listener(bench, bench_file)


def file_of(thing: object) -> tuple[Bench, BenchFile[Bench]] | None:
    """Return a bench with its bench file; None for what is no bench that a bench file has built."""
    for bench, bench_file in _files.items():
        if bench is thing:
            return bench, bench_file
    return None
