"""Faults of the machine at a drive: switches, touch probes, load, coupling."""

from __future__ import annotations

from functools import partial
from typing import Final

from fieldbus.clock import seconds_to_ns
from hil.faults import seams
from hil.faults._kind import (
    Action,
    Custom,
    Family,
    FaultType,
    Held,
    Injection,
    Once,
    Summed,
    bouncing,
    check_intervals,
    find_drive,
    override_action,
    toggled,
)
from hil.faults._overrides import Override
from hil.faults._parameters import Environment, Parameter

_INPUTS: Final = ("negative_limit", "positive_limit", "home", "probe1", "probe2")


def _input(injection: Injection, level: bool) -> tuple[str, Override[bool]]:
    """Return the name of the drive, and the override of the input that is meant; all kinds of switches
    share it.
    """
    found = find_drive(injection)
    drive, name = injection.require(found, seams.HasInputs), injection.values.text("input")
    return found.name, injection.override(
        (found.name, "input", name),
        level,
        lambda levels: drive.force_input(name, levels[-1]),
        lambda: drive.force_input(name, None),
    )


def _press(injection: Injection) -> Action:
    return override_action(*_input(injection, level=True))


def _stick(injection: Injection) -> Action:
    return override_action(*_input(injection, injection.values.flag("state")))


def _bounce(injection: Injection) -> Action:
    final = injection.values.flag("state")
    target, level = _input(injection, final)
    return bouncing(injection, target, level, final)


def _pulse(injection: Injection) -> Action:
    target, level = _input(injection, level=True)
    width_ns = seconds_to_ns(injection.values.number("width_s"))

    def apply() -> None:
        level.apply()
        injection.bench.scheduler.after(width_ns, level.remove)

    return Action(target, apply)


# -- kinds -----------------------------------------------------------------------------------------------

_REFUSED: Final[dict[Environment, str]] = {
    "hardware": "a physical drive has no seam for this; it would need switched I/O or a test adapter on the "
    "machine"
}
_switch_kind: Final = partial(FaultType, seam="switch", target="switch", refused=_REFUSED)
_mechanics_kind: Final = partial(FaultType, seam="mechanics", target="mechanics", refused=_REFUSED)

FAMILY: Final = Family(
    kinds=(
        _switch_kind(
            "switch.press",
            "A limit switch, the home switch or a probe is actuated",
            Custom(_press, needs=seams.HasInputs),
            parameters=(Parameter("input", "text", "Which switch", required=True, choices=_INPUTS),),
            example={"target": "drive1", "parameters": {"input": "positive_limit"}},
            text="""
            A limit switch, the home switch or a touch probe is actuated, wherever the axis is.
            """,
        ),
        _switch_kind(
            "switch.stuck",
            "A switch no longer follows the mechanics",
            Custom(_stick, needs=seams.HasInputs),
            parameters=(
                Parameter("input", "text", "Which switch", required=True, choices=_INPUTS),
                Parameter("state", "bool", "State that it is stuck in", default=False),
            ),
            example={"target": "drive1", "parameters": {"input": "home", "state": False}},
        ),
        _switch_kind(
            "switch.bounce",
            "A switch bounces, with intervals from the seeded stream, and ends actuated or free",
            Custom(_bounce, needs=seams.HasInputs),
            parameters=(
                Parameter("input", "text", "Which switch", required=True, choices=_INPUTS),
                Parameter("pulses", "int", "Number of pulses", minimum=1, maximum=1000, default=5),
                Parameter(
                    "shortest_s",
                    "float",
                    "Shortest interval between edges",
                    unit="s",
                    minimum=1e-05,
                    maximum=1.0,
                    default=0.0002,
                ),
                Parameter(
                    "longest_s",
                    "float",
                    "Longest interval between edges",
                    unit="s",
                    minimum=1e-05,
                    maximum=1.0,
                    default=0.003,
                ),
                Parameter(
                    "state", "bool", "State after bouncing, held until the fault is removed", default=True
                ),
            ),
            example={"target": "drive1", "parameters": {"input": "home", "pulses": 8}},
            check_values=check_intervals,
            text="""
            A switch bounces, with intervals from the seeded stream, and then stays actuated or free until
            the fault is removed.
            """,
        ),
        _switch_kind(
            "switch.inverted",
            "A switch reports the opposite of what the load does, as one that is wired the wrong way",
            Held(
                seams.HasInputPolarity,
                lambda drive, p: drive.invert_input(p.text("input"), True),
                lambda drive, p: drive.invert_input(p.text("input"), False),
                per=("input",),
            ),
            parameters=(Parameter("input", "text", "Which switch", required=True, choices=_INPUTS),),
            example={"target": "drive1", "parameters": {"input": "home"}},
        ),
        _switch_kind(
            "switch.swapped",
            "The wires of the two limit switches are exchanged",
            toggled(seams.HasLimitSwitches, lambda drive, active: drive.swap_limit_switches(active)),
            example={"target": "drive1"},
            text="""
            The wires of the two limit switches are exchanged; the machine has to have both.
            """,
        ),
        _switch_kind(
            "probe.pulse",
            "A touch probe input is actuated for a moment, at any time between two cycles",
            Custom(_pulse, needs=seams.HasInputs),
            parameters=(
                Parameter("input", "text", "Which probe", required=True, choices=("probe1", "probe2")),
                Parameter(
                    "width_s", "float", "How long", unit="s", minimum=1e-06, maximum=10.0, default=0.001
                ),
            ),
            lasting=False,
            remark="on a live bench the width is that of the pipe to the drive process",
            example={"target": "drive1", "parameters": {"input": "probe1", "width_s": 0.0005}},
            text="""
            A touch probe input is actuated for a moment. The drive latches the position of the very
            instant, which may lie anywhere between two cycles: `trigger=at(1.0001234)`. On a live bench
            the pulse travels through the pipe to the drive process.
            """,
        ),
        _mechanics_kind(
            "mechanics.jam",
            "The load is blocked at its present position",
            toggled(seams.HasShaft, lambda drive, active: drive.jam(active)),
            example={"target": "drive1", "duration_s": 0.2},
        ),
        _mechanics_kind(
            "mechanics.load_step",
            "An external force acts on the load",
            Summed(seams.HasLoad, "force_N", lambda drive, force: drive.set_load_force(force)),
            parameters=(
                Parameter(
                    "force_N",
                    "float",
                    "Force along the axis, signed",
                    unit="N",
                    minimum=-1000000.0,
                    maximum=1000000.0,
                    required=True,
                ),
            ),
            example={"target": "drive1", "duration_s": 0.5, "parameters": {"force_N": 400.0}},
        ),
        _mechanics_kind(
            "mechanics.friction",
            "Dry friction at the load grows: a guide or bearing goes bad",
            Summed(seams.HasGuides, "force_N", lambda drive, force: drive.set_added_friction(force)),
            parameters=(
                Parameter(
                    "force_N",
                    "float",
                    "Friction that is added; Nm on a rotary axis",
                    unit="N",
                    minimum=0.0,
                    maximum=1000000.0,
                    required=True,
                ),
            ),
            example={"target": "drive1", "duration_s": 0.5, "parameters": {"force_N": 250.0}},
            text="""
            Dry friction at the load grows: a guide or bearing goes bad. At the end it is as new.
            """,
        ),
        _mechanics_kind(
            "mechanics.slip",
            "The coupling slips: the load is displaced, and the motor encoder sees nothing of it",
            Once(seams.HasCoupling, lambda drive, p: drive.slip_coupling(p.number("revolutions"))),
            parameters=(
                Parameter(
                    "revolutions",
                    "float",
                    "Revolutions of the motor by which the load slips, signed",
                    unit="rev",
                    minimum=-1000.0,
                    maximum=1000.0,
                    required=True,
                ),
            ),
            lasting=False,
            example={"target": "drive1", "parameters": {"revolutions": -0.5}},
            fuzzed=False,
            text="""
            The coupling slips: the load is displaced, and the motor encoder sees nothing of it; an
            encoder at the load does. The zero mark of the motor encoder goes with the load.
            """,
        ),
        _mechanics_kind(
            "mechanics.backlash",
            (
                "Play between motor and load grows: an encoder at the motor sees nothing of it, one at "
                "the load does"
            ),
            Held(
                seams.HasBacklash,
                lambda drive, p: drive.set_added_backlash(
                    p.number("backlash_mm") / 1000.0, p.number("growth_s")
                ),
                lambda drive, _: drive.set_added_backlash(0.0),
            ),
            parameters=(
                Parameter(
                    "backlash_mm",
                    "float",
                    "Play that is added, from one side to the other",
                    unit="mm",
                    minimum=0.0,
                    maximum=100.0,
                    required=True,
                ),
                Parameter(
                    "growth_s",
                    "float",
                    "Time within which it grows, evenly; 0: at once",
                    unit="s",
                    minimum=0.0,
                    maximum=36000.0,
                    default=0.0,
                ),
            ),
            remark="at the end the load is pulled to where the motor is",
            example={"target": "drive1", "duration_s": 0.5, "parameters": {"backlash_mm": 0.5}},
            fuzzed=False,
            text="""
            The play between motor and load grows, on top of the `backlash_mm` of the bench file, at once
            or evenly within `growth_s`. An encoder at the motor sees nothing of it: the load misses its
            position by the play, without an alarm. An encoder at the load does: in control it drives the
            motor through the play at every reversal, which uses the permitted following error up, and may
            never come to rest. At the end the load is pulled to where the motor is.
            """,
        ),
        _mechanics_kind(
            "mechanics.coupling_break",
            "The coupling breaks for good: the motor turns alone, the load coasts or falls",
            Once(seams.HasBreakableCoupling, lambda drive, p: drive.break_coupling(p.number("motor_share"))),
            parameters=(
                Parameter(
                    "motor_share",
                    "float",
                    "Share of the whole inertia that stays with the motor",
                    minimum=0.01,
                    maximum=0.99,
                    default=0.3,
                ),
            ),
            lasting=False,
            example={"target": "drive1", "parameters": {"motor_share": 0.3}},
            fuzzed=False,
            text="""
            The coupling breaks for good: the motor turns alone, the load coasts or, with gravity, falls;
            a brake at the motor does not hold it. It is over the moment it is applied, and nothing
            repairs it in the same case.
            """,
        ),
    ),
)
