"""What technology objects show before anything has happened: straight after power-on, after a restart, after
a power cycle of the controller.

Every output of every object is read, each bit of its words too, whatever the bench has: axes, external
encoders, leading axis proxies. The table of variables says what a new object shows; what is different on a
machine that is ready is listed here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, Final

from hil.campaign import Campaign, CaseContext
from testcases.campaigns.own_axis import own

_READY: Final = {"CommunicationOK": 1.0, "State": 2.0, "Control": 1.0, "AdaptionState": 3.0}
"""Of a drive or encoder that is ready: telegrams arrive, the value is valid, nothing is to be transferred."""
_AXIS_BITS: Final = frozenset({6, 12})
"""`StatusWord`: no job is left to be done, the velocity is constant."""
_STANDSTILL: Final = 7
_HOMED: Final = 5
_NOT_CONTROLLED: Final = 28
_SHOWN: Final = ("Status", "Error", "Warning")
Object = Any
"""Handle of a technology object."""

CAMPAIGN: Final = Campaign("initial states", tags=("axis", "states"), bench="reference", needs={})
SPEED_AXIS: Final = Campaign("initial states of a speed axis", tags=("axis", "states"), bench="speed")
ANALOG: Final = Campaign("initial states behind an analog drive", tags=("axis", "states"), bench="analog")
SYNCHRONOUS: Final = Campaign(
    "initial states of a synchronous machine", tags=("axis", "states"), bench="synchronous"
)
PROXY: Final = Campaign(
    "initial states of two controllers", tags=("states",), bench="testcases.campaigns.leading_values:ACROSS"
)


def objects_of(ctx: CaseContext) -> dict[str, Object]:
    """Return the technology objects of the bench by name."""
    bench = ctx.bench
    found: dict[str, Object] = {name: bench.axis(name) for name in bench.axis_names}
    found |= {name: bench.external_encoder(name) for name in bench.external_encoder_names}
    return found | {name: bench.proxy(name) for name in bench.proxy_names}


def outputs_of(one: Object) -> Iterator[tuple[str, float]]:
    """Yield every output of an object, words by their bits, and what the table of variables says of a new
    object.
    """
    for path in one.variables.paths("RON"):
        if "." in path and not path.startswith(_SHOWN):
            continue  # of the configuration
        definition = one.variables.describe(path)
        if definition.data_type == "DWORD":
            yield from ((f"{path}.X{bit}", 0.0) for bit in definition.bits)
        else:
            yield path, float(definition.initial)


def ready(ctx: CaseContext, name: str, one: Object) -> dict[str, float]:
    """Return the outputs of an object that is ready and at rest, as far as they differ from the table."""
    if name in ctx.bench.proxy_names:
        return {"StatusWord.X0": 1.0, "StatusWord.X4": 1.0, "Position": float(one.var("Position"))}
    encoders = 1 if name in ctx.bench.external_encoder_names else len(one.object.sensors)
    axis = name in ctx.bench.axis_names
    bits = set(_AXIS_BITS) if axis else {6}
    shown: dict[str, float] = {}
    if axis:
        shown |= {"StatusDrive.CommunicationOK": 1.0, "StatusDrive.AdaptionState": 3.0}
    for number in range(1, encoders + 1):
        prefix = f"StatusSensor[{number}]." if axis else "StatusSensor."
        values = _READY if number == 1 else _READY | {"Control": 0.0}
        shown |= {f"{prefix}{path}": value for path, value in values.items()}
    if encoders:
        bits.add(_STANDSTILL)
        if axis:
            bits.add(_NOT_CONTROLLED)
    return shown | {f"StatusWord.X{bit}": 1.0 for bit in bits}


def _positions(one: Object) -> dict[str, float]:
    """Return what an object with an absolute encoder shows beyond that: where it is, and what it knows."""
    paths = set(one.variables.paths("RON"))
    if "ActualPosition" not in paths:
        return {}
    here = float(one.var("ActualPosition"))
    known = [path for path in paths if path.endswith(".Adjusted") and one.var(path)]
    shown = {
        path: here
        for path in (
            "Position",
            "ActualPosition",
            "StatusServo.BalancedPosition",
            "StatusServo.PositionAfterDynamicFilter",
            "StatusProvidedLeadingValue.DelayedLeadingValue.Position",
            "StatusExtrapolation.FilteredPosition",
            "StatusExtrapolation.ExtrapolatedPosition",
        )
        if path in paths
    }
    first = "StatusSensor[1]" if "StatusSensor[1].Position" in paths else "StatusSensor"
    shown |= {f"{first}.Position": here, **dict.fromkeys(known, 1.0)}
    if f"{first}.Adjusted" in known:
        shown[f"StatusWord.X{_HOMED}"] = 1.0
    if "StatusPositioning.Distance" in paths:
        whole = here + float(one.var("ActualModuloCycle")) * float(one.var("Modulo.Length"))
        shown["StatusPositioning.Distance"] = -whole
        limits = [float(one.var(f"PositionLimits_SW.{end}Position")) for end in ("Min", "Max")]
        if one.var("PositionLimits_SW.Active") and f"StatusWord.X{_HOMED}" in shown:
            shown |= {"StatusWord.X15": here <= limits[0], "StatusWord.X16": here >= limits[1]}
    return shown


_MEASURED: Final = (
    "Extrapolation",
    "StatusPositioning.SetpointExecutionTime",
    "AbsEncoderOffset",
    "ActualModuloCycle",
    "ModuloCycle",
    "StatusExternalLeadingValue.",
)
"""Outputs that come from the configuration, and are no state."""


def _expect_initial(ctx: CaseContext, *, besides: tuple[str, ...] = ()) -> None:
    """Expect all outputs to be those of an object to which nothing has happened."""
    for name, one in objects_of(ctx).items():
        wanted = ready(ctx, name, one)
        places = _positions(one)
        slack = 1e-6 + 4.0 * max(
            (abs(s.scale.increment) for s in getattr(one.object, "sensors", ())), default=0
        )
        wrong = []
        for path, initial in outputs_of(one):
            value = float(one.var(path))
            if any(path.endswith(end) or path.startswith(end) for end in (*_MEASURED, *besides)):
                continue
            expected = places.get(path, wanted.get(path, initial))
            if abs(value - expected) > (slack if path in places else 0.0):
                wrong.append(f"{path} is {value:g}, not {expected:g}")
        ctx.measure(
            f"outputs of {name} that are not as at the beginning{''.join(f'; {text}' for text in wrong)}",
            len(wrong),
            high=0.0,
            requirements=("VAR-003",),
        )


def _stir(ctx: CaseContext) -> None:
    """Let something happen to every axis, and leave it disabled: motion, homing, limits, an alarm."""
    for name in ctx.bench.axis_names:
        axis = ctx.bench.axis(name)
        ctx.wait_until(axis.power().status, 5.0, f"{name} is enabled")
        fast = 0.2 * float(axis.var("DynamicLimits.MaxVelocity"))
        if axis.object.has_position:
            ctx.wait_until(axis.home(own(ctx).still * 7.0).done, 3.0, f"{name} is homed")
            axis.move_relative(own(ctx).still * 100.0, Velocity=fast)
            ctx.run_for(0.06)
            axis.move_superimposed(own(ctx).still * 30.0, VelocityDiff=0.1 * fast)
            ctx.run_for(0.04)
        axis.move_velocity(-fast)
        ctx.run_for(0.1)
        ctx.inject("axis.alarm", name, number=307 if axis.object.has_position else 421)
    ctx.run_for(0.4)
    for name in ctx.bench.axis_names:
        ctx.bench.axis(name).power(False)
    ctx.run_for(0.3)


def power_on(ctx: CaseContext) -> None:
    """What objects show when the bench is ready."""
    ctx.run_for(0.1)
    _expect_initial(ctx)


def restarted(ctx: CaseContext) -> None:
    """After a restart nothing is left of what happened: but for the operating mode, which stays."""
    _stir(ctx)
    for name in ctx.bench.axis_names:
        ctx.wait_until(ctx.bench.axis(name).reset(restart=True).done, 5.0, f"{name} has restarted")
    ctx.run_for(0.1)
    _expect_initial(ctx, besides=(f"StatusWord.X{_NOT_CONTROLLED}",))


def power_cycle(ctx: CaseContext) -> None:
    """After a power cycle of the controller everything is as it was when the bench came up."""
    _stir(ctx)
    controller = ctx.bench.controller
    controller.power_off()
    ctx.run_for(0.1)
    controller.power_on()
    ctx.wait_until(lambda: controller.state.name == "RUN", 10.0, "the controller runs")
    ctx.run_for(0.5)
    for name in ctx.bench.axis_names:  # a drive may have missed its controller
        ctx.wait_until(ctx.bench.axis(name).reset().done, 5.0, f"{name} is acknowledged")
    ctx.run_for(0.2)
    _expect_initial(ctx)


_CASES: Final[dict[str, Callable[[CaseContext], None]]] = {
    "power-on": power_on,
    "restart": restarted,
    "power-cycle": power_cycle,
}
for _campaign, _names in (
    (CAMPAIGN, ("power-on", "restart", "power-cycle")),
    (SPEED_AXIS, ("power-on", "restart", "power-cycle")),
    (ANALOG, ("power-on", "restart")),
    (SYNCHRONOUS, ("power-on", "restart")),
    (PROXY, ("power-on",)),
):
    for _name in _names:
        _campaign.case(_name)(_CASES[_name])
