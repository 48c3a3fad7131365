"""Faults of a technology object: alarms that the controller raises by itself (STP-551)."""

from __future__ import annotations

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
    ),
)
