"""Loading benches by reference: a file, an embedded name, or a Python object of the user."""

from __future__ import annotations

import importlib
import re
from typing import TYPE_CHECKING

from hil.bench.makes import NC_BENCH, with_nc_axes
from hil.configurations.factors import CONFIGURATION
from hil.errors import CannotRunError
from hil.protocols import BenchFile
from motion_hil import explain

if TYPE_CHECKING:
    from hil.bench.bench import Bench

_OBJECT = re.compile(r"[A-Za-z_][\w.]*:[A-Za-z_]\w*")


def load_bench_file(reference: str | None) -> BenchFile[Bench]:
    """Return the bench that `reference` names.

    Args:
        reference: Path of a bench file, name of an embedded bench, `package.module:NAME` of an object
            that satisfies `hil.protocols.BenchFile`, `configuration:NAME`, any of these after `nc-axes:` for
            the same bench with axes of an NC, or empty for the embedded default.

    Raises:
        ConfigurationError: The file does not exist or is wrong.
        CannotRunError: The Python object is not there or is no bench file.

    """
    if reference and reference.startswith(NC_BENCH):
        return with_nc_axes(load_bench_file(reference.removeprefix(NC_BENCH)), reference)
    if reference and _OBJECT.fullmatch(reference):
        module_name, _, name = reference.partition(":")
        try:
            found: object = getattr(importlib.import_module(module_name), name)
        except (ImportError, AttributeError) as error:
            raise CannotRunError(f"bench {reference!r}: {explain(error) or error}") from error
        if not isinstance(found, BenchFile):
            raise CannotRunError(
                f"bench {reference!r} is no bench file: it lacks build(), name, text or digest"
            )
        return found
    if reference and reference.startswith(CONFIGURATION):
        from hil.configurations import Configuration

        return Configuration.of(reference).bench_file()
    from hil.bench import load_bench

    return load_bench(reference or None)
