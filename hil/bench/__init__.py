"""The bench: from the bench file to wired axes, drives and buses."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tomli_w

from fieldbus.errors import located
from hil._built import announce
from hil.bench.bench_file import EMBEDDED, BenchFileError, digest, parse, read
from hil.bench.config import BenchConfig

if TYPE_CHECKING:
    from hil.bench.bench import Bench

__all__ = ["EMBEDDED", "Bench", "BenchConfig", "BenchFile", "BenchFileError", "load_bench", "merged"]

if not TYPE_CHECKING:

    def __getattr__(name: str) -> object:
        """Load the bench when it is first used: it brings controller, buses and devices along."""
        if name != "Bench":
            raise AttributeError(f"module 'hil.bench' has no attribute {name!r}")
        from hil.bench.bench import Bench

        return Bench


class BenchFile:
    """A validated bench description that builds fresh benches.

    Args:
        source: File name or name of an embedded bench.
        text: Content.

    Raises:
        BenchFileError: The content is not usable.

    """

    def __init__(self, source: str, text: str) -> None:
        self.source = source
        self.text = text
        self.config: BenchConfig = parse(text, source)
        self.digest = digest(text, self.config)

    @property
    def name(self) -> str:
        """Name that the file gives to the bench."""
        return self.config.bench.name

    @property
    def kind(self) -> str:
        """`virtual` or `live`."""
        return self.config.bench.kind

    def configured(self, tables: Mapping[str, Any]) -> BenchFile:
        """Return this bench with changed tables.

        Args:
            tables: Changes: tables are merged, every other value replaces the value of the file.

        Raises:
            BenchFileError: The result is not usable.

        """
        return BenchFile(self.source, tomli_w.dumps(merged(tomllib.loads(self.text), tables)))

    def build(self, *, seed: int = 0) -> Bench:
        """Return a fresh, started bench.

        Raises:
            ConfigurationError: A file that the bench needs is missing or wrong,
                or values do not fit together.
            BlockedError: A bus or a drive is not there.

        """
        from hil.bench.bench import Bench

        with located(self.source):
            bench = Bench(self.config, seed=seed)
        announce(bench, self)
        return bench


def merged(base: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return `base` with `changes`: tables are merged, every other value is replaced."""
    result = dict(base)
    for key, value in changes.items():
        below = result.get(key)
        tables = isinstance(value, Mapping) and isinstance(below, Mapping)
        result[key] = merged(below, value) if tables and below else value
    return result


def load_bench(path: str | Path | None = None) -> BenchFile:
    """Load and validate a bench file; a name of `EMBEDDED` or None stands for a
    bench that ships with the product.

    Raises:
        BenchFileError: No such file, or its content is not usable.

    """
    source, text = read(path)
    return BenchFile(source, text)
