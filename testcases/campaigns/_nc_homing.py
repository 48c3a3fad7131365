"""What the cases of `homing` are on axes of an NC: its sequence towards the cam, off it, and to the sync
event.
"""

from __future__ import annotations

from typing import Any, Final

from hil.campaign import CaseContext, Counterpart, NotApplicable
from hil.expect import axis_error, no_axis_error, stays_within, value_at
from hil.faults import on_event
from motion.nc.blocks import HomingMode
from motion.nc.interface import State
from testcases.campaigns._homing import (
    APPROACH,
    HOME,
    HOMING,
    SIGN,
    Machine,
    machine,
    never_in_a_stop,
)
from testcases.campaigns._nc import (
    ENCODER,
    LAG,
    NO_ENABLE,
    Table,
    at_rest,
    axis_name,
    axis_of,
    bring_into,
    code_at,
    enable,
    need_cycle_of,
)
from testcases.campaigns._reactions import cycles
from testcases.campaigns.support import drive_name, settle_s

HARDWARE: Final = "Hardware Sync (Feedback reference pulse)"
HOME_SWITCH: Final = "Digital Input 3"
TO_CAM: Final = 2
WAITS_FOR_SYNC: Final = 5
"""`HomingState`: the cam is searched for; the sync event is searched for."""
FILTER_S: Final = 0.0064
"""Filter time of an input of the drive, s."""


def prepare(ctx: CaseContext, mark: str, *, direction: str, start: str) -> Machine:
    """Configure the sequence, and bring the load to its start; returns the geometry."""
    places, axis = machine(ctx), axis_of(ctx)
    for key, value in (
        ("enc.reference_mode", HARDWARE if mark == "cam" else "Default"),
        ("enc.homing_sensor_source", HOME_SWITCH),
        ("enc.homing_invert_cam_search", start != "below"),
        ("enc.homing_invert_sync_search", direction == "negative"),
        ("axis.homing_velocity_towards_cam", APPROACH),
        ("axis.homing_velocity_off_cam", HOMING),
    ):
        axis.write_parameter(key, value)
    low, high = places.cam
    place = {"above": high + 60.0, "below": low - 15.0, "on": 0.5 * (low + high)}[start]
    enable(ctx)
    begin = ctx.bench.config.drive[drive_name(ctx)].mechanics.start_position_mm
    ctx.do(f"MC_MoveRelative to {place:g} mm of the machine")
    move = axis.move_relative(place - begin, Velocity=400.0)
    ctx.wait_until(move.done, 10.0, "the load is at the start of the homing")
    return places


def begin(ctx: CaseContext) -> Any:
    """Start the sequence; returns its block."""
    ctx.do(f"MC_Home MC_DefaultHoming, Position {HOME:g} mm")
    return axis_of(ctx).home(HOME)


def homed(ctx: CaseContext) -> bool:
    """Return `Homed` in the process image."""
    return bool(axis_of(ctx).ref.NcToPlc.StateDWord & State.HOMED)


def homed_at(ctx: CaseContext, block: Any, places: Machine, mark: str, expected: float) -> None:
    """Expect the axis homed: the sync event at `expected` mm of the machine has the home position."""
    axis, name = axis_of(ctx), axis_name(ctx)
    ctx.measure("Done of MC_Home", float(block.Done), low=1.0)
    ctx.measure("Homed", float(homed(ctx)), low=1.0)
    # An input is read and filtered while the axis goes on; a zero mark is latched where it is.
    late_s = 0.0 if mark == "cam" else FILTER_S + 3.0 * ctx.bench.cycle_ns * 1e-9
    machine_mm = float(ctx.trace()[f"{drive_name(ctx)}.position"].values[-1]) * 1000.0
    found = machine_mm - (axis.position - HOME)
    allowed = HOMING * late_s + 2.0 * places.increment + 0.02
    ctx.measure(
        "place of the home position on the machine",
        found,
        "mm",
        low=expected - allowed,
        high=expected + allowed,
        requirements=("NC-313",),
    )
    ctx.expect(no_axis_error(axis=name))
    never_in_a_stop(ctx, places)


def sequence_case(ctx: CaseContext, mark: str, direction: str, start: str, pulses: int = 0) -> None:
    """The NC looks for its cam, leaves it, and takes the sync event as its home position."""
    places = prepare(ctx, mark, direction=direction, start=start)
    drive = drive_name(ctx)
    bounces = (
        ctx.inject(
            "switch.bounce", drive, trigger=on_event("drive.inputs", drive), input="home", pulses=pulses
        )
        if pulses
        else None
    )
    block = begin(ctx)
    if bounces is not None:
        ctx.run_for(1.0)
        bounces.remove()
    ctx.wait_until(block.ended, 60.0, "the homing ends")
    ctx.run_for(0.3 + settle_s(ctx))
    sign = SIGN[direction]
    left = places.leaves_cam(sign)
    homed_at(ctx, block, places, mark, places.next_mark(left, sign) if mark == "cam" else left)


def not_homed(ctx: CaseContext, block: Any, *, error_id: int) -> None:
    """Expect the block ended, the axis not homed, and no homing any more."""
    ctx.measure("Homed", float(homed(ctx)), high=0.0)
    busy = bool(axis_of(ctx).ref.NcToPlc.StateDWord & State.HOMING_BUSY)
    ctx.measure("HomingBusy", float(busy), high=0.0)
    if error_id:
        ctx.measure("ErrorID of MC_Home", float(block.ErrorID), low=error_id, high=error_id)
    else:
        ctx.measure("CommandAborted of MC_Home", float(block.CommandAborted), low=1.0)


def aborted_case(ctx: CaseContext, by: str, part: str) -> None:
    """Another command takes over: the sequence is aborted and the axis not homed."""
    prepare(ctx, "cam", direction="negative", start="above")
    axis = axis_of(ctx)
    block = begin(ctx)
    state = TO_CAM if part == "approach" else WAITS_FOR_SYNC
    ctx.wait_until(lambda: axis.ref.NcToPlc.HomingState == state, 20.0, f"the homing is in its part {part}")
    ctx.run_for(0.02)
    ctx.do(by)
    if by == "halt":
        axis.halt()
    elif by == "stop":
        axis.stop()
    elif by == "motion":
        axis.move_relative(40.0, Velocity=100.0)
    else:
        axis.power(False)
    ctx.run_for(2.0 + settle_s(ctx))
    error_id = NO_ENABLE if by == "disabling" else 0
    not_homed(ctx, block, error_id=error_id)
    code_at(ctx, ctx.now_s, error_id)


def encoder_lost_case(ctx: CaseContext, mark: str) -> None:
    """The encoder fails on the way: 0x4464, the sequence ends with it, and the axis is not homed."""
    prepare(ctx, mark, direction="positive", start="above")
    block = begin(ctx)
    ctx.run_for(0.2)
    ctx.inject("encoder.wire_break", drive_name(ctx))
    since = ctx.now_s
    ctx.run_for(3.0 + settle_s(ctx))
    not_homed(ctx, block, error_id=ENCODER)
    ctx.expect(axis_error(ENCODER, since=since - 0.01, within_s=0.1, axis=axis_name(ctx)).covers("NC-745"))
    at_rest(ctx, ctx.now_s)


def no_cam_case(ctx: CaseContext) -> None:
    """A cam that is never seen is searched for until the end stop: the position lag shuts the axis down."""
    prepare(ctx, "cam", direction="positive", start="above")
    ctx.inject("switch.stuck", drive_name(ctx), input="home", state=False)
    block = begin(ctx)
    ctx.run_for(6.0 + settle_s(ctx))
    not_homed(ctx, block, error_id=LAG)
    ctx.expect(axis_error(LAG, axis=axis_name(ctx)).covers("NC-730"))
    at_rest(ctx, ctx.now_s)


def endless_case(ctx: CaseContext, kind: str, options: dict[str, Any]) -> None:
    """Without a sync event the sequence goes on; MC_Stop ends it, and the axis is not homed."""
    prepare(ctx, "cam", direction="positive", start="above")
    ctx.inject(kind, drive_name(ctx), **options)
    block = begin(ctx)
    ctx.run_for(8.0)
    ctx.measure("Busy of MC_Home", float(block.Busy), low=1.0)
    axis, name = axis_of(ctx), axis_name(ctx)
    ctx.expect(value_at(f"{name}.set_velocity", ctx.now_s, HOMING, tolerance=1e-6))
    ctx.do("MC_Stop")
    stop = axis.stop()
    ctx.wait_until(stop.done, 2.0, "the axis stands")
    ctx.run_for(0.1)
    not_homed(ctx, block, error_id=0)
    ctx.expect(no_axis_error(axis=name))


def direct_case(ctx: CaseContext, relative: bool) -> None:
    """The present place gets another position while the axis moves: no step of the velocity, the motion goes
    on.
    """
    need_cycle_of(ctx, 0.008, "its following error still settles")
    axis, name = axis_of(ctx), axis_name(ctx)
    enable(ctx)
    bring_into(ctx, "constant", velocity=100.0)
    before = ctx.now_s
    position, lag = axis.position, axis.object.following_error
    if relative:
        ctx.do("MC_SetPosition Mode = TRUE, Position 500 mm")
        block: Any = axis.set_position(500.0, relative=True)
    else:
        ctx.do("MC_Home MC_Direct, Position 500 mm")
        block = axis.home(500.0, mode=HomingMode.MC_Direct)
    ctx.wait_until(block.done, 1.0, "the position is set")
    expected = 500.0 + (position if relative else 0.0)
    way = 100.0 * cycles(ctx, 12)
    ctx.measure(
        "position", axis.position, "mm", low=expected - 0.1, high=expected + way, requirements=("NC-242",)
    )
    ctx.run_for(0.3)
    ctx.expect(
        no_axis_error(axis=name),
        stays_within(f"{name}.set_velocity", low=100.0 - 1e-6, high=100.0 + 1e-6, since=before).covers(
            "NC-242"
        ),
        value_at(f"{name}.following_error", before + cycles(ctx, 4), lag, tolerance=0.2).covers("NC-242"),
    )


NO_REVERSAL: Final = NotApplicable("the sequence of the NC does not turn round at limit switches")
NO_PASSIVE: Final = NotApplicable("the NC does not home on the fly: a touch probe of the PLC does")
NOT_WITHOUT_CAM: Final = NotApplicable("the sequence of the NC always looks for its cam first")


def _input(direction: str, side: str, start: str) -> Counterpart | NotApplicable:
    if direction != side:
        return NotApplicable(
            "the NC takes the edge at which it leaves the cam, not the one at which it meets it"
        )
    return Counterpart(sequence_case, {"mark": "input", "direction": direction, "start": start}, ("NC-313",))


def _aborted(by: str, part: str) -> Counterpart | NotApplicable:
    if part == "back":
        return NotApplicable("the sequence of the NC has no way back to its mark")
    return Counterpart(aborted_case, {"by": by, "part": part})


def _endless(kind: str, options: dict[str, Any]) -> Any:
    return lambda **_: Counterpart(endless_case, {"kind": kind, "options": options})


def _bounces(mark: str, pulses: str) -> Counterpart:
    parameters = {"mark": mark, "direction": "positive", "start": "above", "pulses": int(pulses)}
    return Counterpart(sequence_case, parameters, ("NC-313",))


HOMING_CASES: Final = Table(
    {
        "cam/*": lambda direction, start: Counterpart(
            sequence_case, {"mark": "cam", "direction": direction, "start": start}, ("NC-313",)
        ),
        "input/*": _input,
        "zero-mark/*": NOT_WITHOUT_CAM,
        "no-zero-mark/*": NOT_WITHOUT_CAM,
        "*/with": NO_REVERSAL,
        "no-zero-mark-behind-cam/without": _endless("encoder.index_missing", {}),
        "cam-stuck-actuated/without": _endless("switch.stuck", {"input": "home", "state": True}),
        "cam-stuck-free/without": lambda **_: Counterpart(no_cam_case, {}, ("NC-730",)),
        "input-stuck-*": NotApplicable(
            "the cam of the NC is one input, whatever its sync event: cam-stuck has it"
        ),
        "cam-bounces/*": _bounces,
        "encoder-lost/zero-mark": NOT_WITHOUT_CAM,
        "encoder-lost/*": lambda mark: Counterpart(encoder_lost_case, {"mark": mark}, ("NC-745",)),
        "encoder-lost": NO_PASSIVE,
        "homed-encoder-lost": NotApplicable(
            "what a fault of its encoder does to Homed is not said for the NC"
        ),
        "limit-after-reversal": NO_REVERSAL,
        "reversal/*": NO_REVERSAL,
        "limit/*": NO_REVERSAL,
        "search-fails/*": NotApplicable("the NC starts a failed search for its mark again"),
        "aborted/*": _aborted,
        "direct/0": lambda mode: Counterpart(direct_case, {"relative": False}, ("NC-242",)),
        "direct/1": lambda mode: Counterpart(direct_case, {"relative": True}, ("NC-242",)),
        "direct/*": NotApplicable("the NC gives a position to the present place only"),
        "on-the-fly/*": NO_PASSIVE,
        "wrong-direction": NO_PASSIVE,
    }
)
