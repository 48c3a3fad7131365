"""The axis that a trigger is about, where it names none."""

from __future__ import annotations

from dataclasses import replace

from hil.errors import NotNamedError
from hil.faults._trigger import AnyOf, ByChance, InCondition, InSequence, SignalCrossing, Trigger
from hil.faults.seams import BenchWithAxes, BenchWithDrivesOfAxes, offers
from hil.protocols import Bench


def about_axis(bench: Bench, trigger: Trigger, *targets: str) -> Trigger:
    """Return a trigger whose signals all have a component.

    A signal without one is that of the axis that is the target of the fault, or of the axis of the drive
    that is, or of the only axis.

    Args:
        bench: The bench.
        trigger: As given.
        targets: What the fault is about: its target, and the drives that its parameters name.

    Raises:
        NotNamedError: There are several axes, and the fault is about none of them.

    """
    if isinstance(trigger, SignalCrossing | InCondition):
        return _of_axis(bench, trigger, targets)
    if isinstance(trigger, (InSequence, AnyOf)):
        return replace(trigger, parts=tuple(about_axis(bench, part, *targets) for part in trigger.parts))
    if isinstance(trigger, ByChance):
        return replace(trigger, part=about_axis(bench, trigger.part, *targets))
    return trigger


def _of_axis(
    bench: Bench, trigger: SignalCrossing | InCondition, targets: tuple[str, ...]
) -> SignalCrossing | InCondition:
    if "." in trigger.signal:
        return trigger
    return replace(trigger, signal=f"{_axis(bench, trigger, targets)}.{trigger.signal}")


def _axis(bench: Bench, trigger: SignalCrossing | InCondition, targets: tuple[str, ...]) -> str:
    names = bench.axis_names if offers(bench, BenchWithAxes) else ()
    if len(names) < 2:
        only: str = bench.axis().name
        return only
    drives = {bench.drive_of(name): name for name in names} if offers(bench, BenchWithDrivesOfAxes) else {}
    for target in targets:
        if target in names:
            return target
        drive = target.partition(".")[0]  # the drive of a second encoder
        if drive in drives:
            return drives[drive]
    raise NotNamedError(f"trigger '{trigger}'", "axis", names)
