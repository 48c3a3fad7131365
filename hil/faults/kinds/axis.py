"""Faults of a technology object: alarms that the controller raises by itself (STP-551)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from fieldbus.errors import HilError, UnsupportedFaultError
from hil.faults import seams
from hil.faults._kind import Action, Custom, Family, FaultType, Injection, find_axis, override_action
from hil.faults._parameters import Parameter


def _raise_alarm(injection: Injection) -> Action:
    """Return the action that raises a technology alarm.

    Raises:
        UnsupportedFaultError: The object cannot have this alarm, or not with this reaction.

    """
    axis = find_axis(injection)
    if not seams.offers(axis, seams.HasAlarms):
        injection.refuse(f"{axis.name} offers no alarms")
    name, alarms, values = axis.name, axis.alarms, injection.values
    number, reaction = values.integer("number"), values.optional_integer("reaction")
    if seams.offers(alarms, seams.HasAlarmRules):
        try:
            alarms.engine.check(number, reaction)
        except HilError as error:
            raise UnsupportedFaultError(f"{injection.kind.name} cannot be injected: {error}") from error
    if not values.flag("persistent"):

        def apply() -> None:
            alarms.raise_alarm(number, reaction=reaction)

        return Action(name, apply)
    if not seams.offers(alarms, seams.KeepsAlarmCauses):
        injection.refuse(f"{name} offers no {seams.missing(alarms, seams.KeepsAlarmCauses)[0]}()")
    keeping = alarms
    override = injection.override(
        (name, "cause", number),
        reaction,
        lambda reactions: keeping.set_cause(number, True, reaction=reactions[-1]),
        lambda: keeping.set_cause(number, False),
        effective=lambda reactions: (reactions[-1],),
    )
    return override_action(name, override)


def _gives_no_value(injection: Injection) -> Action:
    """Return the action that makes the leading value of an axis invalid."""
    axis = find_axis(injection)
    leading = axis.object if hasattr(axis, "object") else axis
    if not seams.offers(leading, seams.GivesLeadingValue):
        injection.refuse(f"{axis.name} leads no axes")

    def operate(_: Sequence[bool]) -> None:
        leading.leading_defective = True

    def restore() -> None:
        leading.leading_defective = False

    return override_action(axis.name, injection.override((axis.name, "leading"), True, operate, restore))


def _opens_position_control(injection: Injection) -> Action:
    """Return the action that opens position control of an axis, and closes it again: the job that has control
    is planned again from where the axis is then.
    """
    axis = find_axis(injection)
    if not seams.offers(axis, seams.ControlsPosition):
        injection.refuse(f"{axis.name} has no position control")
    motion = axis.motion

    def close() -> None:
        motion.set_position_control(True)
        motion.replan()

    return Action(axis.name, lambda: motion.set_position_control(False), close)


# -- kinds -----------------------------------------------------------------------------------------------

FAMILY: Final = Family(
    kinds=(
        FaultType(
            "axis.alarm",
            "The controller raises a technology alarm by itself",
            Custom(_raise_alarm),
            seam="alarm engine of the axis",
            target="axis",
            parameters=(
                Parameter("number", "int", "Number of the alarm", minimum=101, maximum=999, required=True),
                Parameter(
                    "reaction", "int", "Reaction 0..5; not given: the one of the alarm", minimum=0, maximum=5
                ),
                Parameter(
                    "persistent",
                    "bool",
                    "The cause stays until the fault is removed: acknowledging does not help",
                    default=False,
                ),
            ),
            example={"target": "axis1", "parameters": {"number": 521, "reaction": 4}},
            text="""
        The controller raises a technology alarm by itself. For tests of reactions without a cause in the
        machine.
        """,
        ),
        FaultType(
            "axis.no_leading_value",
            "The axis gives no leading value: it is defective as a leading object",
            Custom(_gives_no_value),
            seam="leading value of the axis",
            target="axis",
            fuzzed=False,
            example={"target": "axis1", "duration_s": 0.2},
            text="""
        Axes that follow it get alarm 601, and no job that names it starts; the axis itself goes on as it did.
        On an axis that leads nobody it does nothing.
        """,
        ),
        FaultType(
            "axis.position_control_off",
            "The axis leaves position control, and closes it again at the end",
            Custom(_opens_position_control),
            seam="position control of the axis",
            target="axis",
            fuzzed=False,
            example={"target": "axis1", "duration_s": 0.2},
            text="""
        As by a job with `PositionControlled` FALSE: the setpoint has no positions any more. An axis that
        synchronises to it, or leaves it, ends with alarm 603; one that is synchronous steps to what its
        function makes of the leading position 0 (SYN-026). At the end a job goes on from where the axis is.
        """,
        ),
    ),
)
