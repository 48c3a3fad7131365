"""One run in a folder at a time."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from hil.errors import CannotRunError

try:
    import fcntl
except ImportError:  # not a POSIX system
    fcntl = None  # type: ignore[assignment]


@contextmanager
def only_run_in(directory: Path) -> Iterator[None]:
    """Hold a folder, which is made where it is missing, for one run.

    The lock is the system's and lies on the folder itself: it leaves nothing behind, and ends with the
    process, however that ends. Where the system has no such locks, on some network drives for example,
    nothing is held.

    Raises:
        CannotRunError: Another run is going on in the folder, or it cannot be made.

    """
    try:
        directory.mkdir(parents=True, exist_ok=True)
        handle = os.open(directory, os.O_RDONLY) if fcntl is not None else -1
    except OSError as error:
        raise CannotRunError(
            f"{directory}: no folder for a report can be made here: {error.strerror}"
        ) from error
    if handle < 0:
        yield
        return
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            if error.errno in {errno.EWOULDBLOCK, errno.EACCES}:
                raise CannotRunError(
                    f"{directory}: another run is going on in this folder; wait for its end, or give "
                    f"another one (--report)"
                ) from None
        yield
    finally:
        os.close(handle)
