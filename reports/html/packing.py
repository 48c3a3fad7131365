"""The data of cases as the page holds them, deflated; those of a large run become files by several processes.

The helpers are interpreters of their own that get cases over a pipe. A forked process would take
along locks and sockets of a live bench, and `multiprocessing` would run the program of the
caller once more in each of them.
"""

from __future__ import annotations

import base64
import gc
import json
import pickle
import subprocess
import sys
import zlib
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, suppress
from pathlib import Path
from queue import SimpleQueue
from types import MappingProxyType
from typing import IO, Any, Final, NamedTuple, Self, cast

from reports.html.payload import case_payload
from reports.model import CaseResult, Earlier
from reports.naming import naming
from reports.processors import processors

_PORTION: Final = 32
"""Cases that a helper gets at once."""
_MOST: Final = 8
"""Helpers at most: the disk is busy with fewer."""


class Order(NamedTuple):
    """Cases that become files of a folder."""

    folder: Path
    key: str
    points: int
    first: int
    """Number of the first of them in the run."""
    cases: Sequence[CaseResult]
    passes: Mapping[str, Earlier] = {}
    """See `case_text`."""


def packed(value: object) -> str:
    """Return JSON, deflated, in base 64: a quarter of its size, and nothing in it can end a `script` element.

    The page unpacks it with `DecompressionStream`.
    """
    text = json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return base64.b64encode(zlib.compress(text.encode("utf-8", "replace"), 9)).decode("ascii")


def unpacked(text: str) -> Any:
    """Return what `packed` was given."""
    return json.loads(zlib.decompress(base64.b64decode(text)))


def case_text(case: CaseResult, points: int, passes: Mapping[str, Earlier] = MappingProxyType({})) -> str:
    """Return the packed data of a case.

    Args:
        case: The case.
        points: See `case_payload`.
        passes: Earlier runs by identifier.

    """
    payload = case_payload(case, points=points)
    log = payload.pop("log")
    parts = {"log": packed(log) if log else "", "passed": passes.get(case.identifier)}
    return packed({**payload, **parts})


def write_text(folder: Path, key: str, place: int, text: str) -> None:
    """Write the file of a case."""
    path = folder / f"{place}.js"
    with naming(path):
        path.write_bytes(f'hilData("{key}",{place},"{text}");\n'.encode("ascii"))


def pack_files(order: Order, *, processes: int | None = None) -> None:
    """Write the file of each case.

    Args:
        order: All cases.
        processes: Number of helpers; default: one for every processor that this process may use. With
            fewer than two, and for few cases, there are none.

    """
    number = min(processors() if processes is None else processes, _MOST, len(order.cases) // _PORTION)
    portions = [
        order._replace(
            first=order.first + start,
            cases=(mine := order.cases[start : start + _PORTION]),
            passes={
                case.identifier: order.passes[case.identifier]
                for case in (mine if order.passes else ())
                if case.identifier in order.passes
            },
        )
        for start in range(0, len(order.cases), _PORTION)
    ]
    with ExitStack() as stack:
        helpers: SimpleQueue[_Helper | None] = SimpleQueue()
        for _ in range(number if number > 1 else 0):
            helpers.put(stack.enter_context(_Helper()))

        def pack(portion: Order) -> bool:
            helper = helpers.get()
            done = helper is not None and helper.pack(portion)
            helpers.put(helper if done else None)
            return done

        if number > 1:
            threads = stack.enter_context(ThreadPoolExecutor(number))
            left = [
                portion
                for portion, done in zip(portions, threads.map(pack, portions), strict=True)
                if not done
            ]
        else:
            left = portions
        for portion in left:
            _pack(portion)


def serve() -> None:
    """Be a helper: pack what comes on the standard input until it ends."""
    gc.disable()
    orders, answers = sys.stdin.buffer, sys.stdout.buffer
    while True:
        try:
            order = cast("Order", pickle.load(orders))  # noqa: S301 - from the process that started this one
        except EOFError:
            return
        _pack(order)
        answers.write(b".")
        answers.flush()


def _pack(order: Order) -> None:
    for place, case in enumerate(order.cases, start=order.first):
        write_text(order.folder, order.key, place, case_text(case, order.points, order.passes))


class _Helper:
    """An interpreter that packs cases; one that fails is not asked again, and what it had is done here, where
    errors are reported.
    """

    def __init__(self) -> None:
        program = f"import sys; sys.path[:] = {sys.path!r}; from reports.html.packing import serve; serve()"
        self._process = subprocess.Popen(  # noqa: S603 - our own interpreter and program
            [sys.executable, "-c", program],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            start_new_session=True,  # Ctrl-C is meant for the command; a helper ends with its input
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for stream in (self._process.stdin, self._process.stdout):
            with suppress(OSError):  # what could not be sent to a helper that has died
                cast("IO[bytes]", stream).close()
        self._process.wait()

    def pack(self, order: Order) -> bool:
        """Write the files of some cases; return whether that went well."""
        orders, answers = cast("IO[bytes]", self._process.stdin), cast("IO[bytes]", self._process.stdout)
        try:
            pickle.dump(order, orders, pickle.HIGHEST_PROTOCOL)
            orders.flush()
            return answers.read(1) == b"."
        except (OSError, pickle.PicklingError, TypeError, AttributeError):
            return False
