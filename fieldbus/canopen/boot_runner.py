"""Runs a boot script over the SDO client of its node, one transfer after the other, without waiting."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from fieldbus.canopen.boot import BootFailure, Script

if TYPE_CHECKING:
    from fieldbus.canopen.sdo_client import SdoClient, SdoJob


class BootRunner:
    """Runs one script at a time.

    Args:
        sdo: Client of the node.
        on_done: Called when a script has come to its end.
        on_failure: Called with the reason when it has not.

    """

    __slots__ = ("_job", "_on_done", "_on_failure", "_script", "_sdo")

    def __init__(
        self, sdo: SdoClient, on_done: Callable[[], object], on_failure: Callable[[BootFailure], object]
    ) -> None:
        self._sdo = sdo
        self._on_done = on_done
        self._on_failure = on_failure
        self._script: Script | None = None
        self._job: SdoJob | None = None

    @property
    def running(self) -> bool:
        """Whether a script is under way."""
        return self._script is not None

    def run(self, script: Script) -> None:
        """Begin a script; one that is under way is given up."""
        self.cancel()
        self._script = script
        self._advance(None)

    def cancel(self) -> None:
        """Give up what is under way; nobody is called."""
        self._script = None
        if self._job is not None:
            self._job.cancel()
            self._job = None

    def _advance(self, job: SdoJob | None) -> None:
        script = self._script
        self._job = None
        if script is None:
            return
        try:
            index, sub, data = script.send(job)  # type: ignore[arg-type]  # None starts a generator
        except StopIteration:
            self._script = None
            self._on_done()
        except BootFailure as failure:
            self._script = None
            self._on_failure(failure)
        else:
            sdo = self._sdo
            if data is None:
                self._job = sdo.upload(index, sub, self._advance)
            else:
                self._job = sdo.download(index, sub, data, self._advance)
