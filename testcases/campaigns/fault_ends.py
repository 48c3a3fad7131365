"""Every fault of a drive, its switches, machine and encoder, and of encoders with a node of their own: it
shows while it acts, and leaves nothing behind.

Nothing is said about how it shows. A motion with the fault differs in something from the same motion without
it; when the fault is over and acknowledged, the axis moves as it did before. Faults and parts come from the
catalogue of faults and the devices of the bench.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, Final

import numpy as np

from fieldbus.errors import UnsupportedFaultError
from hil.bench import BenchFile, load_bench
from hil.campaign import Campaign, CaseContext
from hil.errors import BlockedError
from hil.faults import CATALOGUE
from testcases.campaigns._twice import Span, back, compare, enable, once, settle
from testcases.campaigns.own_axis import Own, own
from testcases.campaigns.support import drive_name, equal

_BRAKE: Final = """
[drive.drive1.brake]
torque_nm = 6.0
opening_time_ms = 24.0
closing_time_ms = 36.0
"""
EQUIPPED: Final = BenchFile(
    "equipped axis",
    load_bench("reference").text
    + _BRAKE
    + """
[drive.drive1.safety]
interlock = "quick_stop"
ss1_time_ms = 300.0
""",
)
"""The reference axis with a holding brake and an interlock."""
GUARDED: Final = BenchFile(
    "guarded axis",
    load_bench("profidrive").text
    + _BRAKE
    + """
[drive.drive1.safety]
ss1_time_ms = 300.0
ss2_time_ms = 350.0
sos_delay_ms = 50.0
sls_limits_mm_s = [60.0]
sls_delay_ms = 20.0
sdi_delay_ms = 20.0
slp_ranges_mm = [[-590.0, -10.0]]
slp_delay_ms = 20.0
""",
)
"""A PROFIdrive axis with a holding brake and safety functions."""
SHAFTS: Final = BenchFile(
    "encoders on shafts",
    """
[bench]
name = "encoders on shafts"
kind = "virtual"
cycle_ms = 4

[segment.can0]
bitrate = 1_000_000

[encoder.turns]
segment = "can0"
node_id = 21
type = "multi_turn"
steps_per_revolution = 4096
cyclic_timer_ms = 20
heartbeat_ms = 50

[encoder.scale]
segment = "can0"
node_id = 22
type = "incremental_linear"

[encoder.words]
segment = "can0"
node_id = 24
profile = "profidrive"
type = "multi_turn"
steps_per_revolution = 4096
""",
)
"""Encoders on shafts of their own."""
CAMPAIGN: Final = Campaign(
    "fault ends", tags=("fault", "drive"), bench="testcases.campaigns.fault_ends:EQUIPPED"
)
PARTS: Final = ("drive", "switch", "mechanics", "encoder")
OF_NODES: Final = (
    *("encoder.preset", "encoder.overflow", "encoder.alarm", "encoder.warning", "encoder.cycle"),
    *("encoder.clock_drift", "encoder.power_off", "encoder.heartbeat_loss"),
)
"""Faults that are tried at encoders with a node of their own, or in `pulse_module`."""
"""What a fault of a drive may hit."""
FOR_GOOD: Final = ("mechanics.coupling_break", "encoder.reverse", "drive.clock_jitter")
"""What nothing takes back, what runs away, and what leaves no two motions alike."""
UNSEEN: Final = {
    "encoder.index_missing": "a search for the zero mark",
    "switch.inverted": "a home switch",
    "safety.acknowledge": "an acknowledgement that waits",
}
"""Faults that this motion does not show, and what they need."""
PARAMETERS: Final[Mapping[str, Mapping[str, Any]]] = {
    "drive.brake_stuck": {"closed": True},
    "drive.statusword_bits": {"set": 0x0080},
    "drive.sdo_abort": {"code": 0x06010000},
    "drive.clock_drift": {"drift_ppm": 20_000.0},
    "switch.inverted": {"input": "positive_limit"},
    "switch.stuck": {"input": "positive_limit", "state": True},
    "switch.bounce": {"input": "positive_limit", "pulses": 8},
    "encoder.noise": {"increments": 64},
}
"""Parameters that are not those of the example in the handbook."""
KINDS: Final = tuple(
    kind.name
    for kind in CATALOGUE
    if kind.target in PARTS
    and kind.name not in (*FOR_GOOD, *UNSEEN, *OF_NODES)
    and not kind.name.startswith("telegram.")
)
ACTS_S: Final = 0.65
"""How long a fault acts that does not end by itself."""


def _motion(ctx: CaseContext, axis: Any, values: Own, fault: Callable[[], Any] | None) -> None:
    """Move, turn round, disable and enable; a fault acts from the constant velocity on."""
    axis.move_velocity(values.given(values.speed(0.3)))
    ctx.run_for(0.3)
    acting = None if fault is None else fault()
    ctx.run_for(0.1)
    _ask(ctx)
    axis.move_velocity(values.given(-values.speed(0.25)))
    ctx.run_for(0.3)
    axis.power(False)
    ctx.run_for(0.15)
    axis.power()
    ctx.run_for(ACTS_S - 0.55)
    if acting is not None:
        acting.remove()
    ctx.run_for(0.25)
    axis.power(False)
    ctx.run_for(0.4)


def _ask(ctx: CaseContext) -> None:
    """Read an object of a drive on CAN, and wait for nothing."""
    section = ctx.bench.config.drive[drive_name(ctx)]
    node = getattr(section, "node_id", None)
    if node is not None:
        ctx.bench.network(section.segment).sdo(node).upload(0x1018, 1)


def _travel(ctx: CaseContext, axis: Any, values: Own) -> None:
    """There with a job that is superseded, back, halted, and disabled on the way."""
    dynamics = values.dynamics().inputs
    axis.move_relative(values.way(0.31), Velocity=values.given(values.speed(0.45)), **dynamics)
    ctx.run_for(0.3)
    axis.move_velocity(values.given(-values.speed(0.35)), **dynamics)
    ctx.run_for(0.45)
    axis.power(False, stop_mode=1)
    ctx.run_for(0.8)
    enable(ctx, axis)


def _recovered(ctx: CaseContext, axis: Any, kind: str) -> None:
    """Acknowledge, a safety function by its own input, until the axis can be enabled.

    Raises:
        ExpectationFailedError: It never can.

    """
    ctx.run_for(1.0)
    for _ in range(6):
        if kind.startswith("safety."):
            ctx.inject("safety.acknowledge", drive_name(ctx))
        axis.reset()
        ctx.run_for(0.5)
        power = axis.power()
        if ctx.run_until(power.status, 1.0):
            return
        axis.power(False)
        ctx.run_for(0.1)
    enable(ctx, axis)


RELATIVE: Final = ("position", "increments", "raw_value", "offset", "xist")
"""What columns are called that are compared from where they stood at the beginning."""


def _shown(ctx: CaseContext, spans: list[Span], of: str = "", *, over: bool = False) -> str:
    """Return what differs first between two motions that began with the same phase; empty: nothing.

    Args:
        ctx: The case.
        spans: Begin and end of both.
        of: The component that is looked at, and its frames and events; empty: all.
        over: The fault is over: a count may overflow at another place, a heartbeat have another phase.

    """
    trace = ctx.trace()
    for group in trace.groups:
        for column, _ in group.columns if of in ("", group.name) else ():
            if column == "sign_of_life":
                continue
            name = f"{group.name}.{column}"
            first, second = (
                trace[name].between(begin * 1e-9 - 1e-9, end * 1e-9 - 1e-9).values for begin, end in spans
            )
            count = min(len(first), len(second))
            if not count:
                continue
            counts = any(part in column for part in RELATIVE)
            if counts:
                first, second = (_way(one) if over else one - one[0] for one in (first, second))
            off = float(np.max(np.abs(first[:count] - second[:count])))
            if off > 1e-3 * float(np.max(np.abs(first[:count]))) + (3.0 if of and counts else 1e-9):
                return name
    node = ctx.bench.config.encoder[of].node_id if of else 0
    told: list[tuple[int, int]] = []
    for begin, end in spans:
        frames = sum(
            begin <= one.time_ns < end and (not of or one.can_id & 0x7F == node) for one in trace.frames
        )
        events = sum(
            begin <= one.time_ns < end and not one.kind.startswith("fault.") and of in ("", one.source)
            for one in trace.events
        )
        told.append((frames, events))
    if abs(told[0][0] - told[1][0]) > 2 * over:
        return "frames"
    return "" if told[0][1] == told[1][1] else "events"


def _way(counts: Any) -> Any:
    """Return counts from where they stood at the beginning, without their overflows."""
    steps = np.diff(counts, prepend=counts[0])
    before, behind = np.roll(steps, 1), np.roll(steps, -1)
    beside = np.where(np.abs(before) > np.abs(behind), before, behind)
    return np.cumsum(np.where(np.abs(steps) < LEAP, steps, beside))


LEAP: Final = 5000.0
"""Counts that no motion makes in a cycle."""


@CAMPAIGN.product("{kind}", parameters={"kind": KINDS}, title="{kind} shows, ends, and leaves nothing behind")
def ends(ctx: CaseContext, kind: str) -> None:
    """A motion with the fault is another one; what the axis does afterwards is what it did before."""
    axis, values = ctx.axis, own(ctx)
    definition = next(one for one in CATALOGUE if one.name == kind)
    parameters = dict(PARAMETERS.get(kind, definition.example.get("parameters", {})))
    if kind == "drive.fault" and ctx.bench.config.drive[drive_name(ctx)].profile != "cia402":
        parameters = {"code": 30001}
    if "input" in parameters and not _has_input(ctx, parameters["input"]):
        raise BlockedError(f"the drive has no switch {parameters['input']}")

    def fault() -> Any:
        return ctx.inject(kind, drive_name(ctx), **parameters)

    enable(ctx, axis)
    settle(ctx)
    start = axis.var("ActualPosition") if axis.object.has_position else 0.0
    travels = [once(ctx, axis, values, _travel)]
    motions = []
    for one in (None, fault):
        _back(ctx, axis, start, values)
        motions.append(once(ctx, axis, values, partial(_motion, fault=one)))
        _recovered(ctx, axis, kind if one is fault else "")
    what = _shown(ctx, motions)
    equal(ctx, f"{kind} shows{f' in {what}' if what else ''}", float(bool(what)), 1)
    _back(ctx, axis, start, values)
    travels.append(once(ctx, axis, values, _travel))
    compare(ctx, axis, values, travels, ways=True)


def _back(ctx: CaseContext, axis: Any, start: float, values: Own) -> None:
    if axis.object.has_position:
        back(ctx, axis, start, values)


def _has_input(ctx: CaseContext, name: str) -> bool:
    drive: Any = ctx.drive
    return name in getattr(drive, "switches", {})


# -- encoders with a node of their own ---------------------------------------------------------------------

OF_ENCODERS: Final = Campaign(
    "encoder fault ends",
    controller="",
    tags=("fault", "encoder"),
    bench="testcases.campaigns.fault_ends:SHAFTS",
)
OF_SHAFTS: Final = tuple(
    kind.name
    for kind in CATALOGUE
    if kind.target == "encoder" and kind.name not in ("encoder.index_missing", "encoder.clock_drift")
)
KEPT: Final = ("encoder.error", "encoder.wire_break")
"""Faults that an encoder shows until they are acknowledged."""
GRID_NS: Final = 200_000_000
"""A multiple of all cycles, those of heartbeats too."""


@OF_ENCODERS.product("{kind}", parameters={"kind": OF_SHAFTS}, title="{kind} of each encoder shows and ends")
def encoder_ends(ctx: CaseContext, kind: str) -> None:
    """A turn of the shaft with the fault looks another way, and afterwards it looks as it did before."""
    definition = next(one for one in CATALOGUE if one.name == kind)
    parameters = dict(PARAMETERS.get(kind, definition.example.get("parameters", {})))
    found = 0
    ctx.run_for(0.1)
    for name, section in ctx.bench.config.encoder.items():
        if section.on is not None or section.device != "emulated":
            continue
        device: Any = ctx.bench.encoder(name)
        # Ten counts in a cycle: noise of one shows, and no overflow comes near.
        speed = 0.05 if section.linear else 4.0

        def turn(faulty: bool, device: Any = device, speed: float = speed, name: str = name) -> Span:
            ctx.run_for((-round(ctx.now_s * 1e9) % GRID_NS) * 1e-9)
            begin = round(ctx.now_s * 1e9)
            device.turn_shaft(speed)
            ctx.run_for(0.02)
            fault = ctx.inject(kind, name, **parameters) if faulty else None
            ctx.run_for(0.16)
            if fault is not None and definition.lasting:
                fault.remove()
            ctx.run_for(0.1)
            device.turn_shaft(-speed)
            ctx.run_for(0.28)
            device.turn_shaft(0.0)
            ctx.run_for(0.02)
            return begin, round(ctx.now_s * 1e9)

        first = turn(faulty=False)
        try:
            faulty = turn(faulty=True)
        except UnsupportedFaultError:
            device.turn_shaft(0.0)
            continue
        found += 1
        what = _shown(ctx, [first, faulty], name)
        equal(ctx, f"{kind} of {name} shows{f' in {what}' if what else ''}", float(bool(what)), 1)
        ctx.run_for(0.3)
        what = "" if kind in KEPT else _shown(ctx, [first, turn(faulty=False)], name, over=True)
        equal(ctx, f"{kind} of {name} has ended{f', but for {what}' if what else ''}", float(bool(what)), 0)
    if not found:
        raise BlockedError(f"no encoder of this bench has {kind}")
