"""Every variable that can be written is read by the runtime, or stands in the table of those that are kept
without effect.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from motion.s7.axis import PositioningAxis, SpeedAxis
from motion.s7.axis.external_encoder import ExternalEncoder
from motion.s7.data._variables import variables_of
from motion.s7.instructions import MC_Home, MC_MoveRelative, MC_MoveVelocity, MC_Power, MC_TorqueLimiting
from motion.s7.variables import VariableStore
from testcases.unit.motion_axis.conftest import REFERENCE, SPEED, TorquePort

pytestmark = pytest.mark.exhaustive

DOCUMENT = Path(__file__).parents[3] / "docs" / "reference" / "axis-configuration.md"
CONFIGURATIONS = {
    "SpeedAxis": [SPEED, SPEED | {"TorqueLimiting.LimitBase": 1}],
    "PositioningAxis": [
        REFERENCE | extra
        for extra in (
            {"PositionControl.ControlDifferenceQuantization.Mode": 2, "Sensor[1].ActiveHoming.Mode": 2},
            {
                "TorquePreControl.Mode": 1,
                "SetpointFilter.DynamicFilter.Mode": 1,
                "Sensor[1].Type": 1,
                "Actor.LoadInertia": 1.0,
                "TorqueLimiting.LimitBase": 1,
            },
            {
                "Sensor[1].MountingMode": 2,
                "PositionLimits_SW.Active": True,
                "PositionLimits_SW.LimitReachedBehavior": 1,
            },
            {
                "Actor.MotorType": 1,
                "Sensor[1].System": 0,
                "Sensor[1].DataAdaption": 1,
                "Actor.DataAdaption": 1,
                "TorquePreControl.Mode": 1,
            },
            {"PositionLimits_HW.Active": True, "Modulo.Enable": True, "Sensor[1].ActualVelocityMode": 1},
            {"Simulation.Mode": 1},
        )
    ],
    "ExternalEncoder": [
        {},
        {"Sensor.System": 0},
        {"Sensor.Type": 1, "Sensor.DataAdaption": 1},
        {"Sensor.ActualVelocityMode": 1},
    ],
}


class Port(TorquePort):
    """A drive that takes torques, and answers requests for parameters."""

    __slots__ = ()

    def __init__(self) -> None:
        super().__init__()
        self.has_torque_reduction = self.has_parameters = True

    def limit_torque(self, share):
        """Take no notice."""

    def read_parameter(self, number, index, answer):
        """Answer every request with a value that fits."""
        answer(3000.0 if number == 2000 else 0.0, "")


def exercise(kind, variables):
    """Let one object do what reads variables: be enabled, home in every way, move, be limited."""
    port = Port()
    cls = {"SpeedAxis": SpeedAxis, "PositioningAxis": PositioningAxis, "ExternalEncoder": ExternalEncoder}[
        kind
    ]
    thing = cls("object1", port, cycle_ns=4_000_000, variables=variables)
    program = [MC_Power(thing, Enable=True)]
    if kind != "SpeedAxis":
        program += [MC_Home(thing, Execute=False, Mode=mode) for mode in (0, 2, 3, 5, 6, 7, 8, 10)]
    if kind != "ExternalEncoder":
        program += [
            MC_MoveVelocity(thing, Velocity=5.0),
            MC_TorqueLimiting(thing, Limit=-1.0),
        ]
    if kind == "PositioningAxis":
        program.append(MC_MoveRelative(thing, Distance=1.0))
    for cycle in range(1000):
        thing.cycle()
        for number, instance in enumerate(program[1:]):
            if cycle == 40 + 90 * number:
                instance.set(**{"Enable" if isinstance(instance, MC_TorqueLimiting) else "Execute": True})
        for instance in program:
            instance()
    thing.make_reset(restart=True)
    for path in thing._live:
        thing.var(path)


def documented():
    """Return the paths of the table, by object type; `*` stands for what follows."""
    section = (
        DOCUMENT.read_text(encoding="utf-8").partition("## Kept without effect")[2].partition("\n## ")[0]
    )
    rows = re.findall(r"^\| (`[^|]+`) \| ([^|]+) \|", section, flags=re.MULTILINE)
    return {
        (kind, path)
        for cell, kinds in rows
        for path in re.findall(r"`([^`]+)`", cell)
        for kind in kinds.split(", ")
    }


@pytest.mark.requirement("VAR-216")
def test_every_variable_acts_or_is_listed(monkeypatch):
    """The table names what nobody reads, completely and nothing else."""
    seen = set()
    for name in ("bind", "read", "start_value"):
        original = getattr(VariableStore, name)

        def recorded(self, path, original=original):
            seen.add((self.object_type, re.sub(r"\[\d+\]", "[n]", path)))
            return original(self, path)

        monkeypatch.setattr(VariableStore, name, recorded)
    for kind, configurations in CONFIGURATIONS.items():
        for variables in configurations:
            exercise(kind, variables)
    unread = {
        (kind, path)
        for kind in CONFIGURATIONS
        for variable in variables_of(kind)
        if variable.access != "RON"
        for path in [re.sub(r"\[[\d.]+\]", "[n]", variable.path)]
        if (kind, path) not in seen
    }
    assert unread == documented()
