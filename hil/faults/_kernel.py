"""Faults of frames on a bridge of the kernel: what its gateway can do at all."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final

from fieldbus.errors import UnsupportedFaultError
from hil.faults._action import Action, refuse_unless_supported
from hil.faults._fault import Fault, parse_payload
from hil.faults._frames import selected_identifier
from hil.protocols import Bench

if TYPE_CHECKING:
    from fieldbus.can.kernel_bridge import KernelBridge, KernelTreatment

_KINDS: Final = ("frame.drop", "frame.replace")
_NEUTRAL: Final = {"first": 1, "every": 1, "probability": 1.0}


class KernelFrameAction(Action):
    """Drop or replace the selected frames by a rule of the kernel.

    Args:
        bench: The bench.
        fault: What to do.
        note: Called at the end with the number of frames hit and their identifier, where the kernel
            counts them.

    Raises:
        UnsupportedFaultError: The kernel cannot do that; the message says what it lacks.

    """

    __slots__ = ("_bridge", "_can_id", "_data", "_mask", "_note", "_sender", "_treatment")

    def __init__(self, bench: Bench, fault: Fault, note: Callable[[int, int], None]) -> None:
        segment: Any = bench.segment(fault.target or None)
        refuse_unless_supported(bench, fault, segment)
        where = f"{fault.kind} cannot be injected by the gateway of the kernel: it"
        if fault.kind not in _KINDS:
            raise UnsupportedFaultError(
                f'{where} only passes on, drops and changes; set gateway = "bench" at the bridge of '
                f"{segment.name}"
            )
        if fault.count is not None:
            raise UnsupportedFaultError(f"{where} does not count frames; give an end in place of count")
        for name, neutral in _NEUTRAL.items():
            if fault.value(name) != neutral:
                raise UnsupportedFaultError(
                    f"{where} treats all frames of an identifier alike: {name} is not possible"
                )
        super().__init__(str(segment.name), self._begin, self._finish)
        self._bridge: KernelBridge = segment.kernel
        self._can_id, self._mask = selected_identifier(bench, fault, segment.name)
        self._sender: str = fault.value("sender")
        self._data = (
            parse_payload("frame.replace.parameters.data", fault.value("data"))
            if fault.kind == "frame.replace"
            else None
        )
        self._bridge.check_free(self._sender)
        self._note = note
        self._treatment: KernelTreatment | None = None

    def _begin(self) -> None:
        self._treatment = self._bridge.treat(self._can_id, self._mask, sender=self._sender, data=self._data)

    def _finish(self) -> None:
        if self._treatment is not None:
            self._treatment.withdraw()
            if self._treatment.hits:
                self._note(self._treatment.hits, self._can_id)
            self._treatment = None
