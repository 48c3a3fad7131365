"""Components of NC axes by their formulas: absolute encoders and their ranges, valve characteristics, torque
and acceleration outputs, automatic offset, coupled axes, corrections, auxiliary axes of a path, tasks.
"""

from __future__ import annotations

from itertools import pairwise
from math import floor, pi
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from hil.bench import BenchFile
from hil.campaign import Campaign, CaseContext
from motion.nc.blocks import HomingMode, MC_ReadApplicationRequest
from motion.nc.correction_blocks import DisableMode, MC_AbortSuperposition
from motion.nc.interpolation import ORIGINAL, REDUCED_BEYOND, InterpolationGroup
from motion.nc.tables import Table
from testcases.campaigns.nc_axes import axis, until
from testcases.campaigns.support import column, equal, later, same_column

_HERE: Final = "testcases.campaigns.nc_components"
_CYCLE_S: Final = 0.002
Numbers = NDArray[np.float64]


def _bench(name: str, axes: dict[str, dict[str, Any]]) -> BenchFile:
    """Return a bench of simulated axes."""
    text = (
        f'[bench]\nname = "{name}"\nkind = "virtual"\ncycle_ms = 2\n[segment.can0]\nbitrate = 1_000_000\n'
        '[drive.motor]\nsegment = "can0"\nnode_id = 5\n[nc.parameters]\n"task.watchdog_cycles" = 3\n'
    )
    tables = {key: {"controller": "nc", "parameters": values} for key, values in axes.items()}
    return BenchFile(name, text).configured({"axis": tables})


# -- encoders ------------------------------------------------------------------------------------------------

_STEP_MM: Final = 0.01
_TURN, _SPAN = 1024, 8192
"""Increments of a turn, and of the whole range."""
_MULTI: Final = "ABSOLUTE MULTITURN RANGE (with single overflow)"
_SINGLE: Final = "ABSOLUTE SINGLETURN RANGE (with single overflow)"
_PLACES: Final[dict[str, dict[str, Any]]] = {
    # span 81.92 mm, turn 10.24 mm; the count of a simulated axis begins at 0
    "multi": {"system": _MULTI, "bias": 7.5, "low": 300.0, "high": 381.0},
    "edge": {"system": _MULTI, "bias": 0.0, "low": 81.92, "high": 160.0},
    "below": {"system": _MULTI, "bias": 3.0, "low": -70.0, "high": -10.0},
    "inverted": {"system": _MULTI, "bias": -1.5, "low": 20.0, "high": 95.0, "invert": True},
    "single": {"system": _SINGLE, "bias": 0.5, "low": 52.0, "high": 62.0},
    "nowhere": {"system": _SINGLE, "bias": 0.0, "low": 1.0, "high": 9.0},
    "wide": {"system": _SINGLE, "bias": 0.0, "low": 1.0, "high": 11.3},
    "open": {"system": _MULTI, "bias": 0.0, "low": 5.0, "high": None},
    "absolute": {"system": "ABSOLUTE", "bias": 11.0, "low": None, "high": None},
}  # fmt: skip
"""Absolute encoders, and between which positions their axes are."""


def _encoder(row: dict[str, Any]) -> dict[str, Any]:
    values = {
        "ctrl.pos_kv": 5.0,
        "axis.position_lag_monitoring": False,
        "enc.reference_system": row["system"],
        "enc.position_bias": row["bias"],
        "enc.scaling_numerator": _STEP_MM,
        "enc.encoder_mask": _SPAN - 1,
        "enc.encoder_sub_mask": _TURN - 1,
        "enc.invert_counting_direction": row.get("invert", False),
        "axis.soft_limit_min_enable": row["low"] is not None,
        "axis.soft_limit_max_enable": row["high"] is not None,
    }
    values |= {f"axis.soft_limit_{end}": row[name] or 0.0 for end, name in (("min", "low"), ("max", "high"))}
    return values


ENCODERS: Final = _bench("nc encoders", {name: _encoder(row) for name, row in _PLACES.items()})
OF_ENCODERS: Final = Campaign("nc encoders", tags=("nc",), controller="nc", bench=f"{_HERE}:ENCODERS")
INITIALISATION: Final = 0x4465


def _place(row: dict[str, Any]) -> float | None:
    """Return the position between the ends of the range with a count of 0 (NC-271, NC-274); None: there is
    none.
    """
    length = _STEP_MM * (_TURN if row["system"] == _SINGLE else _SPAN)
    low, high, bias = row["low"], row["high"], row["bias"]
    if row["system"] == "ABSOLUTE":
        return float(bias)
    if low is None or high is None or not high - low < length:
        return None
    place = bias + floor((high - bias) / length + 1e-9) * length
    return None if place < low - 1e-9 else float(place)


@OF_ENCODERS.case("ranges", requirements=("NC-268", "NC-271", "NC-274"))
def ranges(ctx: CaseContext) -> None:
    """With the count 0 an axis is at the one place of its range that the encoder can mean; without such a
    place it has an error and is not homed.
    """
    ctx.run_for(0.01)
    for name, row in _PLACES.items():
        one = ctx.bench.axis(name, controller="nc")
        place = _place(row)
        wanted = row["bias"] if place is None else place
        equal(ctx, f"position of {name}", one.position, wanted, "NC-271", within=1e-9)
        equal(ctx, f"homed: {name}", one.homed, place is not None, "NC-271")
        equal(ctx, f"error of {name}", one.error_id, INITIALISATION if place is None else 0, "NC-274")


@OF_ENCODERS.product(
    "overflow/{name}-{side}",
    parameters=[
        {"name": name, "side": "up" if way > 0 else "down", "way": way, "allowed": allowed, "code": code}
        for name, way, allowed, code in (
            ("multi", 1, 1, 0x4451),
            ("multi", -1, 1, 0x4450),
            ("inverted", 1, 1, 0x4450),
            ("single", -1, 1, 0x4450),
            ("single", 1, 1, 0x4451),
            ("absolute", 1, 0, 0x4451),
            ("absolute", -1, 0, 0x4450),
        )
    ],
    title="The count of {name} passes its end on the way {side}",
    requirements=("NC-271", "NC-274"),
)
def overflow(ctx: CaseContext, name: str, side: str, way: int, allowed: int, code: int) -> None:
    """An absolute count may pass the end of its range once, where its reference system says so, and the
    position goes on; beyond that the axis has an error.
    """
    del side
    one = ctx.bench.axis(name, controller="nc")
    ctx.run_for(0.01)
    for end in ("min", "max"):
        one.write_parameter(f"axis.soft_limit_{end}_enable", False)
    ctx.wait_until(one.power().status, 2.0, f"{name} is enabled")
    begin = one.position
    length = _STEP_MM * (_TURN if _PLACES[name]["system"] == _SINGLE else _SPAN)
    # The simulated count goes around zero, that of a turn begins at zero; with an overflow it may go through
    # its whole range once more. The sign of the position is the other one of an inverted encoder.
    counts = -way if _PLACES[name].get("invert") else way
    below = 0.0 if _PLACES[name]["system"] == _SINGLE else 0.5 * length
    free = length * allowed + (length - below if counts > 0 else below)
    moved = one.move_relative(way * (free - 3.0 * _STEP_MM), Velocity=400.0, Jerk=1e6)
    if free:
        until(ctx, moved.done)
        equal(ctx, "error before the end", one.error_id, 0, "NC-271")
        travelled = one.position - begin
        equal(ctx, "way", travelled, way * (free - 3.0 * _STEP_MM), "NC-271", within=0.02)
    one.move_relative(way * 9.0 * _STEP_MM, Velocity=400.0)
    ctx.run_for(0.3)
    equal(ctx, "error behind the end", one.error_id, code, "NC-274")


# -- outputs -------------------------------------------------------------------------------------------------

_WEIGHT, _FULL, _KV = 0.83, 500.0, 6.0
_PLAIN: Final[dict[str, Any]] = {
    "ctrl.pos_kv": _KV, "ctrl.velocity_precontrol_weight": _WEIGHT, "axis.reference_velocity": _FULL,
    "axis.maximum_velocity": 450.0, "axis.position_lag_monitoring": False,
    "axis.maximum_acceleration": 1000.0, "axis.maximum_deceleration": 800.0,
}  # fmt: skip
_VALVE: Final = ((-1.0, -0.9), (-0.4, -0.5), (-0.05, -0.2), (0.02, 0.15), (0.3, 0.4), (0.8, 0.95))
_OUTPUTS: Final[dict[str, dict[str, Any]]] = {
    "valve": {"drv.valve_offset": 0.03},
    "spline": {"drv.valve_offset": -0.02, "drv.valve_interpolation": "SPLINE"},
    "inverted": {
        "drv.invert_motor_polarity": True, "drv.output_limit_max": 0.3, "drv.output_limit_min": -0.2,
    },
    "torque": {
        "drv.output_scaling_torque": 2.5, "drv.output_delay_torque": 0.004,
        "drv.output_scaling_acceleration": -0.5, "drv.output_delay_acceleration": 0.006,
    },
    "accelerating": {"enc.encoder_mode": "POSVELOACC", "enc.filter_time_acceleration": 0.03},
    "still": {"enc.encoder_mode": "POS"},
}  # fmt: skip
OUTPUTS: Final = _bench("nc drives", {name: {**_PLAIN, **row} for name, row in _OUTPUTS.items()})
OF_OUTPUTS: Final = Campaign("nc drive outputs", tags=("nc",), controller="nc", bench=f"{_HERE}:OUTPUTS")


@OF_OUTPUTS.case(
    "characteristics", requirements=("NC-340", "NC-349", "NC-350", "NC-351", "NC-352", "NC-353", "NC-371")
)
def characteristics(ctx: CaseContext) -> None:
    """Valve characteristic with its offset, limits and polarity change the share of full scale; torque and
    acceleration go out scaled and delayed; actual velocity and acceleration are as the encoder mode says.
    """
    table = Table("valve", _VALVE)
    number = ctx.bench.nc.tables.add(table)
    for name in ("valve", "spline"):
        ctx.bench.axis(name, controller="nc").write_parameter("drv.valve_table_id", number)
    axes = {name: axis(ctx, name) for name in _OUTPUTS}
    rows: list[tuple[float, float, float, float, float]] = []
    torque = axes["torque"]

    def look() -> None:
        image = torque.object.outputs
        torque.ref.PlcToNc.ExtTorque = float(len(rows) % 97) - 30.0
        rows.append(
            (torque.ref.PlcToNc.ExtTorque, image.torque, image.acceleration, torque.object.motion.a, 0.0)
        )

    end = ctx.bench.on_cycle(look)
    inputs = {"Velocity": 230.0, "Acceleration": 900.0, "Deceleration": 700.0, "Jerk": 20_000.0}
    for way in (41.0, -37.0):
        moves = [one.move_relative(way, **inputs) for one in axes.values()]
        until(ctx, lambda moves=moves: all(one.Done for one in moves), "all motions are done")
        ctx.run_for(0.05)
    end()

    def plain(name: str) -> Numbers:
        total = _WEIGHT * column(ctx, f"{name}.set_velocity") + _KV * column(ctx, f"{name}.following_error")
        return total / _FULL

    enabled = int(np.flatnonzero(column(ctx, "valve.set_velocity"))[0])
    for name, interpolation in (("valve", 0), ("spline", 1)):
        offset = _OUTPUTS[name]["drv.valve_offset"]
        wanted = [min(max(table.value(x, interpolation) + offset, -1.0), 1.0) for x in plain(name)]
        found = column(ctx, f"{name}.output")
        same_column(ctx, f"output of {name}", found[enabled:], wanted[enabled:], "NC-353", "NC-371")
    found = column(ctx, "inverted.output")
    same_column(ctx, "inverted output", found, -np.clip(plain("inverted"), -0.2, 0.3), "NC-340")
    given, sent, acceleration, motion, _ = (np.array(one) for one in zip(*rows, strict=True))
    # What is written after a cycle acts in the next one, and is sent two cycles behind that.
    same_column(ctx, "torque", sent[5:], 2.5 * later(given, 3)[5:], "NC-349", "NC-350")
    same_column(ctx, "acceleration", acceleration[5:], -0.5 * later(motion, 3)[5:], "NC-351", "NC-352")
    velocity = np.diff(column(ctx, "accelerating.actual_position"), prepend=0.0) / _CYCLE_S
    share, last = _CYCLE_S / (_CYCLE_S + 0.03), 0.0
    for change in np.diff(velocity, prepend=0.0) / _CYCLE_S:
        last = share * float(change) + (1.0 - share) * last
    image = axes["accelerating"].ref.NcToPlc
    equal(ctx, "actual acceleration", image.ActAcc, last, within=1e-3 + 0.01 * abs(last))
    still = column(ctx, "still.actual_velocity")
    equal(ctx, "actual velocity without one", float(np.abs(still).max()), 0.0)
    refused = 0
    try:
        axes["valve"].write_parameter("drv.valve_table_id", 0)
    except Exception as error:  # noqa: BLE001 - whatever refuses it, the story says what it was
        ctx.do(f"refused: {error}")
        refused = 1
    equal(ctx, "another table while the axis is enabled is refused", refused, 1, "NC-371")
    axes["valve"].power(False)
    ctx.run_for(0.05)
    before = axes["valve"].read_parameter("drv.valve_table_id")
    for wrong in (number + 7,):
        try:
            axes["valve"].write_parameter("drv.valve_table_id", wrong)
        except Exception as error:  # noqa: BLE001 - see above
            ctx.do(f"refused: {error}")
    equal(ctx, "a table that there is not", axes["valve"].read_parameter("drv.valve_table_id"), before)


# -- coupled axes --------------------------------------------------------------------------------------------

_SLAVES: Final[dict[str, dict[str, Any]]] = {
    "lead": {},
    "delayed": {"axis.error_propagation_mode": "DELAYED", "axis.error_propagation_delay": 0.1},
    "following": {"axis.couple_slave_to_actual": True, "axis.couple_velocity_window": 1e6},
    "staying": {},
    "refusing": {"axis.allow_commands_slave": False},
    "limited": {"axis.maximum_velocity": 100.0},
}
SLAVES: Final = _bench("nc slaves", {name: {**_PLAIN, **row} for name, row in _SLAVES.items()})
OF_SLAVES: Final = Campaign("nc slaves", tags=("nc",), controller="nc", bench=f"{_HERE}:SLAVES")


def _coupled(ctx: CaseContext, name: str, ratio: float = 1.0) -> tuple[Any, Any]:
    """Return a slave, and its master at 60 mm/s."""
    lead, slave = axis(ctx, "lead"), axis(ctx, name)
    until(ctx, slave.gear_in(lead, ratio).in_gear, "the axes are coupled")
    until(ctx, lead.move_velocity(60.0, Jerk=1e6).in_velocity, "the velocity is reached")
    return slave, lead


@OF_SLAVES.case("delayed-error", requirements=("NC-197", "NC-198", "NC-446"))
def delayed_error(ctx: CaseContext) -> None:
    """An error of a slave reaches its master after the delay, not before; a slave that leaves meanwhile keeps
    it for itself.
    """
    for leaves in (False, True):
        slave, lead = _coupled(ctx, "delayed")
        since = ctx.now_s
        slave.object.raise_error(0x4550)
        ctx.run_for(0.05)
        equal(ctx, "ErrorPropagationDelayed", slave.ref.NcToPlc.StateDWord >> 6 & 1, 1, "NC-446")
        equal(ctx, "velocity of the master", lead.ref.NcToPlc.SetVelo, 60.0, "NC-198", within=1e-6)
        if leaves:
            slave.gear_out()
            ctx.run_for(0.2)
            equal(ctx, "error of the master", lead.error_id, 0, "NC-198")
            equal(ctx, "ErrorPropagationDelayed", slave.ref.NcToPlc.StateDWord >> 6 & 1, 0, "NC-446")
        else:
            ctx.wait_until(lambda lead=lead: lead.error_id, 0.2, "the error reaches the master")
            equal(ctx, "delay", ctx.now_s - since, 0.1, "NC-198", within=2 * _CYCLE_S)
            equal(ctx, "error of the master", lead.error_id, 0x43A0, "NC-197")
            ctx.run_for(0.01)
            slave.gear_out()
            for one in (lead, slave):
                until(ctx, one.reset().done)
        until(ctx, lead.halt().done)


@OF_SLAVES.case("delayed-error/again", requirements=("NC-197", "NC-198"))
def delayed_error_again(ctx: CaseContext) -> None:
    """An error that is acknowledged before the delay is over does not count for the next one."""
    slave, lead = _coupled(ctx, "delayed")
    for number, wait_s in ((1, 0.06), (2, 0.07)):
        slave.object.raise_error(0x4550)
        ctx.run_for(wait_s)
        equal(ctx, f"error of the master during error {number}", lead.error_id, 0, "NC-198")
        until(ctx, slave.reset().done)
        ctx.run_for(0.02)
        equal(ctx, "ErrorPropagationDelayed", slave.ref.NcToPlc.StateDWord >> 6 & 1, 0)
        equal(ctx, "CoupleState", slave.ref.NcToPlc.CoupleState, 3)
    since = ctx.now_s
    slave.object.raise_error(0x4550)
    ctx.wait_until(lambda: lead.error_id, 0.2, "the error reaches the master")
    equal(ctx, "delay", ctx.now_s - since, 0.1, "NC-198", within=2 * _CYCLE_S)


@OF_SLAVES.case("master-off", requirements=("NC-199", "NC-200", "NC-213"))
def master_off(ctx: CaseContext) -> None:
    """Behind a master that is switched off a slave stays where it is, or follows the actual value where its
    parameter says so; when the master is controlled again nothing has jumped.
    """
    for name in ("staying", "following"):
        slave, lead = _coupled(ctx, name, 2.0)
        until(ctx, lead.halt(Jerk=1e6).done)
        lead.power(False)
        ctx.run_for(0.02)
        before, place = slave.ref.NcToPlc.SetPos, lead.position
        # A simulated axis that is switched off moves when its coordinates do.
        until(ctx, lead.set_position(place + 5.0).done)
        ctx.run_for(0.05)
        way = slave.ref.NcToPlc.SetPos - before
        equal(ctx, f"way of {name} with the coordinates of the master", way, 0.0, "NC-199", within=1e-6)
        ctx.wait_until(lead.power().status, 1.0, "the master is enabled")
        ctx.run_for(0.02)
        equal(ctx, f"{name} has not moved", slave.ref.NcToPlc.SetPos, before, "NC-213", within=1e-6)
        until(ctx, lead.move_relative(-4.0, Velocity=100.0).done)
        ctx.run_for(0.02)
        equal(ctx, f"way of {name}", slave.ref.NcToPlc.SetPos - before, -8.0, "NC-200", within=1e-6)
        until(ctx, slave.gear_out().done)


@OF_SLAVES.case("commands", requirements=("NC-036", "NC-202", "NC-214", "NC-215"))
def commands(ctx: CaseContext) -> None:
    """A command to a slave ends the coupling where it is allowed, and is refused elsewhere; the ratio changes
    without a jump; no axis follows itself.
    """
    slave, lead = _coupled(ctx, "refusing")
    refused = slave.move_absolute(10.0, Velocity=50.0)
    ctx.run_for(0.01)
    equal(ctx, "ErrorID", refused.ErrorID, 0x4B05, "NC-214")
    equal(ctx, "CoupleState", slave.ref.NcToPlc.CoupleState, 3, "NC-214")
    place = slave.ref.NcToPlc.SetPos
    for ratio, code in ((3.0, 0), (0.0, 0x4B06)):
        again = slave.gear_in(lead, ratio)
        ctx.run_for(0.01)
        equal(ctx, f"ratio {ratio}: ErrorID", again.ErrorID, code)
        equal(ctx, f"ratio {ratio}: velocity", slave.ref.NcToPlc.SetVelo, 180.0, "NC-036", within=1e-6)
    equal(ctx, "place of the slave", slave.ref.NcToPlc.SetPos, place, within=0.03 * 180.0)
    for leader in (slave, lead):
        circle = lead.gear_in(leader)
        ctx.run_for(0.01)
        equal(ctx, f"a circle with {leader.name}: ErrorID", circle.ErrorID, 0x4B06)
    other = axis(ctx, "staying")
    until(ctx, other.gear_in(lead, -1.0).in_gear, "a second slave")
    move = other.move_relative(3.0, Velocity=50.0, Jerk=1e6)
    ctx.run_for(0.01)
    equal(ctx, "CoupleState after a command", other.ref.NcToPlc.CoupleState, 0, "NC-202", "NC-215")
    until(ctx, move.done)
    equal(ctx, "ErrorID of the command", move.ErrorID, 0, "NC-202")
    equal(ctx, "CoupleState of the master", lead.ref.NcToPlc.CoupleState, 1)


@OF_SLAVES.case("leaves-too-fast", requirements=("NC-036", "NC-095"))
def leaves_too_fast(ctx: CaseContext) -> None:
    """A slave that is faster than its own maximum, or gets faster, ends at the maximum; its acceleration goes
    on without a step.
    """
    slave, lead = _coupled(ctx, "limited", 3.0)
    equal(ctx, "velocity of the slave", slave.ref.NcToPlc.SetVelo, 180.0, within=1e-6)
    until(ctx, slave.gear_out().done)
    ctx.run_for(0.6)
    equal(ctx, "velocity at the end", slave.ref.NcToPlc.SetVelo, 100.0, "NC-095", within=1e-6)
    until(ctx, slave.halt(Jerk=1e6).done)
    until(ctx, lead.halt(Jerk=1e6).done)
    until(ctx, slave.gear_in(lead, 1.0).in_gear, "the axes are coupled again")
    lead.move_velocity(400.0, Acceleration=900.0, Jerk=1e6)
    ctx.wait_until(lambda: slave.ref.NcToPlc.SetVelo > 85.0, 1.0, "the slave is nearly at its maximum")
    until(ctx, slave.gear_out().done)
    left = float(slave.ref.NcToPlc.SetVelo)
    ctx.run_for(0.5)
    velocity = column(ctx, "limited.set_velocity")[-300:]
    ctx.measure(
        "greatest velocity", float(velocity.max()), "mm/s", high=100.0 + 1e-6, requirements=("NC-095",)
    )
    equal(ctx, "velocity at the end", float(velocity[-1]), left, "NC-036", within=3 * 900.0 * _CYCLE_S)


@OF_SLAVES.case("superposed", requirements=("NC-032",))
def superposed(ctx: CaseContext) -> None:
    """A motion on top of a coupling adds its way, is held by an override of 0, and ends by
    MC_AbortSuperposition with its way so far; the coupling goes on.
    """
    slave, lead = _coupled(ctx, "staying")
    off = slave.ref.NcToPlc.SetPos - lead.ref.NcToPlc.SetPos
    until(ctx, slave.move_superimposed(6.0, 30.0).done, "the superposed motion is done")
    ctx.run_for(0.01)
    difference = slave.ref.NcToPlc.SetPos - lead.ref.NcToPlc.SetPos - off
    equal(ctx, "way on top", difference, 6.0, "NC-032", within=1e-6)
    moving = slave.move_superimposed(-20.0, 30.0)
    ctx.run_for(0.2)
    slave.power(override=0.0)
    ctx.run_for(0.5)
    equal(ctx, "Busy, not Done, with an override of 0", moving.Busy - moving.Done, 1, "NC-032")
    held = slave.ref.NcToPlc.SetPos - lead.ref.NcToPlc.SetPos - off
    ctx.run_for(0.1)
    equal(ctx, "held", slave.ref.NcToPlc.SetPos - lead.ref.NcToPlc.SetPos - off, held, within=1e-6)
    ctx.measure("on its way", held, low=-13.9, high=5.9)
    end = slave.run(MC_AbortSuperposition(slave.ref, Execute=True))
    ctx.run_for(0.01)
    equal(ctx, "Done of MC_AbortSuperposition", end.Done, 1)
    slave.power(override=100.0)
    ctx.run_for(0.3)
    equal(ctx, "its way stays", slave.ref.NcToPlc.SetPos - lead.ref.NcToPlc.SetPos - off, held, within=1e-6)
    equal(ctx, "CoupleState", slave.ref.NcToPlc.CoupleState, 3)
    end.set(Execute=False)
    ctx.run_for(0.01)
    equal(ctx, "Done afterwards", end.Done, 0)
    wrong = slave.move_superimposed(1.0, 0.0)
    ctx.run_for(0.01)
    equal(ctx, "ErrorID without a velocity", wrong.ErrorID, 0x4359)


# -- corrections, modes, emergency ---------------------------------------------------------------------------

_SINGLES: Final[dict[str, dict[str, Any]]] = {
    "corrected": {"axis.position_correction": True},
    "plain": {},
    "slow": {"axis.cycle_divider": 4, "axis.cycle_modulo": 3},
    "noisy": {"enc.simulation_noise": 1.0, "enc.filter_time_velocity": 0.0},
}
SINGLES: Final = _bench("nc singles", {name: {**_PLAIN, **row} for name, row in _SINGLES.items()})
OF_SINGLES: Final = Campaign("nc single axes", tags=("nc",), controller="nc", bench=f"{_HERE}:SINGLES")


@OF_SINGLES.case("backlash", requirements=("NC-599", "NC-600", "NC-601", "NC-602", "NC-604", "NC-605"))
def backlash(ctx: CaseContext) -> None:
    """With a ramp the compensation changes with its velocity and is active meanwhile; switched off it stays
    or goes to 0; without position correction blocks are refused.
    """
    one = axis(ctx, "corrected")
    block = one.compensate_backlash(0.8, Ramp=10.0)
    until(ctx, one.move_relative(-4.0, Velocity=100.0).done)
    ctx.run_for(0.3)
    equal(ctx, "correction", one.ref.PlcToNc.PositionCorrection, 0.8, "NC-600", within=1e-9)
    for mode, left in ((DisableMode.DisableModeHold, 0.8), (DisableMode.DisableModeReset, 0.0)):
        block.set(Enable=False, DisableMode=mode)
        since = ctx.now_s
        ctx.run_for(0.02)
        equal(ctx, f"Active, {mode.name}", block.Active, mode is DisableMode.DisableModeReset, "NC-604")
        equal(ctx, "Enabled", block.Enabled, 0)
        if block.Active:
            until(ctx, lambda: not block.Active, "the correction has gone")
            equal(ctx, "time of the ramp", ctx.now_s - since, 0.08, "NC-602", within=3 * _CYCLE_S)
        ctx.run_for(0.1)
        left_over = one.ref.PlcToNc.PositionCorrection
        equal(ctx, f"correction, {mode.name}", left_over, left, "NC-605", within=1e-9)
        block.set(Enable=True)
        until(ctx, one.move_relative(-2.0, Velocity=100.0).done)
        ctx.run_for(0.2)
    plain = axis(ctx, "plain")
    for refused in (plain.compensate_backlash(0.5), plain.correct_position(0.5)):
        ctx.run_for(0.01)
        equal(ctx, f"{refused.block}: ErrorID", refused.ErrorID, 0x4B04, "NC-599")
        equal(ctx, f"{refused.block}: Busy", refused.Busy and not refused.Error, 0)
        equal(ctx, "correction", plain.ref.PlcToNc.PositionCorrection, 0.0)
        refused.set(Enable=False)


@OF_SINGLES.product(
    "emergency/{how}", parameters={"how": ("ramp", "at-once", "led")}, title="Emergency stop, {how}"
)
def emergency(ctx: CaseContext, how: str) -> None:
    """On the ramp of the fast axis stop, the axis locked until a reset; or without output at once, as a
    coupled axis always.
    """
    one = axis(ctx, "plain")
    for key, value in (("deceleration", 700.0), ("jerk", 50_000.0)):
        one.write_parameter(f"axis.fast_{key}", value)
    moving: Any
    if how == "led":
        lead = axis(ctx, "corrected")
        until(ctx, one.gear_in(lead).in_gear, "coupled")
        moving = lead.move_velocity(90.0, Jerk=1e6)
    else:
        moving = one.move_velocity(90.0, Jerk=1e6)
    until(ctx, moving.in_velocity, "the velocity is reached")
    one.emergency_stop(ramp=how != "at-once")
    ctx.run_for(0.25)
    equal(ctx, "set velocity", one.ref.NcToPlc.SetVelo, 0.0, "NC-011", within=1e-9)
    braking = float(column(ctx, "plain.set_acceleration").min())
    if how == "ramp":
        equal(ctx, "deceleration", braking, -700.0, "NC-011", within=7.0)
        equal(ctx, "error", one.error_id, 0, "NC-011")
        refused = one.move_relative(1.0, Velocity=10.0)
        ctx.run_for(0.01)
        equal(ctx, "ErrorID while locked", refused.ErrorID, 0x42EF, "NC-011")
    else:
        equal(ctx, "error", one.error_id, 0x4B00, "NC-011")
    said = [event for event in ctx.trace().events if event.kind == "axis.emergency_stop"]
    wanted = "zero output" if how == "at-once" else "ramp"
    equal(ctx, "said", [event.data["reaction"] for event in said] == [wanted], 1, "NC-011")
    if how == "led":
        one.gear_out()
        until(ctx, lead.reset().done)
    until(ctx, one.reset().done)
    if how != "led":
        ctx.wait_until(lambda: one.operational, 1.0, "operational")
        until(ctx, one.move_relative(1.0, Velocity=10.0).done)


@OF_SINGLES.case("divider", requirements=("NC-075", "NC-076"))
def divider(ctx: CaseContext) -> None:
    """An axis with a divider is executed in every fourth cycle, in its own one; its motion takes its time."""
    one = axis(ctx, "slow")
    since = ctx.now_s
    until(
        ctx, one.move_relative(30.0, Velocity=100.0, Acceleration=1000.0, Deceleration=1000.0, Jerk=1e6).done
    )
    equal(ctx, "time of the motion", ctx.now_s - since, 0.3 + 0.1, within=0.045)
    changes = np.flatnonzero(np.diff(column(ctx, "slow.set_position")))
    steps = {int(b - a) for a, b in pairwise(changes[:-1])}
    equal(ctx, f"cycles from one to the next {sorted(steps)}", steps == {4}, 1, "NC-075")
    counts = ctx.trace()["slow.set_position"].time_s[changes + 1] / _CYCLE_S
    equal(ctx, "in cycles of one phase", len({round(float(at)) % 4 for at in counts}), 1, "NC-076")


@OF_SINGLES.case("noise", requirements=("NC-288",))
def noise(ctx: CaseContext) -> None:
    """The noise of a simulated encoder moves the actual position to both sides by its level, from cycle to
    cycle.
    """
    one = ctx.bench.axis("noisy", controller="nc")
    ctx.run_for(0.4)
    found = column(ctx, "noisy.actual_position")[10:]
    ctx.measure("highest", float(found.max()), low=0.4, high=1.0 + 1e-6)
    ctx.measure("lowest", float(found.min()), low=-1.0 - 1e-6, high=-0.4)
    ctx.measure("mean", float(found.mean()), low=-0.2, high=0.2)
    equal(ctx, "error", one.error_id, 0)


@OF_SINGLES.case("homing-requests", requirements=("NC-298",))
def homing_requests(ctx: CaseContext) -> None:
    """The calibration flag and requests to the program: where the program homes, the NC asks it."""
    one = axis(ctx, "plain")
    asked = one.run(MC_ReadApplicationRequest(one.ref, Enable=True))
    ctx.run_for(0.01)
    equal(ctx, "Valid", asked.Valid, 1)
    equal(ctx, "no request", asked.ApplicationRequestType, 0)
    for mode in (HomingMode.MC_ForceCalibration, HomingMode.MC_ResetCalibration):
        until(ctx, one.home(mode=mode).done)
        ctx.run_for(0.01)
        equal(ctx, mode.name, one.homed, mode is HomingMode.MC_ForceCalibration)
    asked.set(Enable=False)
    ctx.run_for(0.01)
    equal(ctx, "Valid without Enable", asked.Valid, 0)


@OF_SINGLES.case("mode-requests")
def mode_requests(ctx: CaseContext) -> None:
    """A request for another mode of the axis is confirmed in a cycle, and shown for one cycle."""
    one = axis(ctx, "plain")
    shown: list[int] = []
    end = ctx.bench.on_cycle(lambda: shown.append(one.ref.NcToPlc.StateDWord >> 15 & 1))
    one.ref.PlcToNc.AxisModeRequest = 7
    ctx.run_for(0.02)
    end()
    equal(ctx, "confirmed", one.ref.NcToPlc.AxisModeConfirmation, 7)
    equal(ctx, "cycles in which it is shown", sum(shown), 1)


@OF_SINGLES.case("stalled", requirements=("NC-020", "NC-438"))
def stalled(ctx: CaseContext) -> None:
    """When the image to the program is not renewed it stays, and is cleared after the watchdog; the axis goes
    on.
    """
    one = axis(ctx, "plain")
    link = ctx.bench.nc.links["plain"]
    until(ctx, one.move_velocity(40.0, Jerk=1e6).in_velocity, "the velocity is reached")
    link.to_plc_stalled = True
    ctx.run_for(3 * _CYCLE_S)
    held = one.ref.NcToPlc.SetPos
    ctx.measure("position that is held", held, low=0.1)
    equal(ctx, "velocity that is held", one.ref.NcToPlc.SetVelo, 40.0, "NC-020", within=1e-6)
    ctx.run_for(2 * _CYCLE_S)
    equal(ctx, "position after the watchdog", one.ref.NcToPlc.SetPos, 0.0, "NC-020")
    equal(ctx, "status after the watchdog", one.ref.NcToPlc.StateDWord, 0, "NC-020")
    ctx.measure("the axis goes on", one.object.motion.v, low=39.999)
    link.to_plc_stalled = False
    ctx.run_for(_CYCLE_S)
    equal(ctx, "velocity shown again", one.ref.NcToPlc.SetVelo, 40.0, within=1e-6)


@OF_SINGLES.case("program-error", requirements=("NC-019",))
def program_error(ctx: CaseContext) -> None:
    """An exception of the arithmetic halts the program; the NC goes on, and its watchdog stops the axis."""
    one = axis(ctx, "plain")
    until(ctx, one.move_velocity(40.0, Jerk=1e6).in_velocity, "the velocity is reached")
    nc = ctx.bench.nc
    zero = 0.0

    def divide() -> None:
        1.0 / zero

    nc.call(divide)
    ctx.run_for(2 * _CYCLE_S)
    equal(ctx, "the program runs", nc.plc_running, 0, "NC-019")
    equal(ctx, "told", len([e for e in ctx.trace().events if e.kind == "plc.halted"]), 1, "NC-019")
    equal(ctx, "the axis moves", one.object.motion.v, 40.0, "NC-019", within=1e-6)
    ctx.run_for(0.2)
    equal(ctx, "operational after the watchdog", one.object.operational, 0, "NC-438")


# -- paths ---------------------------------------------------------------------------------------------------

_PATH: Final[dict[str, dict[str, Any]]] = {
    "x": {"axis.rapid_traverse_velocity": 300.0},
    "v": {"axis.rapid_traverse_velocity": 220.0, "axis.velo_jump_factor": 2.0},
    "w": {"axis.rapid_traverse_velocity": 25.0, "axis.tolerance_ball_aux": 1.5},
    "q": {"axis.rapid_traverse_velocity": 400.0, "axis.velo_jump_factor": 3.0},
}
PATHS: Final = _bench("nc paths", {name: {**_PLAIN, **row} for name, row in _PATH.items()})
OF_PATHS: Final = Campaign("nc paths", tags=("nc",), controller="nc", bench=f"{_HERE}:PATHS")


def _group(ctx: CaseContext, auxiliary: str = "") -> InterpolationGroup:
    """Return a group of x and v, with auxiliary axes."""
    axes = {name: axis(ctx, name) for name in ("x", "v", *auxiliary)}
    made = InterpolationGroup(
        [axes[name].object for name in "xv"],
        auxiliary=[axes[name].object for name in auxiliary],
        cycle_s=_CYCLE_S,
        acceleration=1100.0,
        deceleration=700.0,
        jerk=60_000.0,
    )
    ctx.bench.nc.groups.append(made)
    return made


def _travel(ctx: CaseContext, made: InterpolationGroup, names: str) -> list[tuple[float, ...]]:
    """Start a group; return positions, then velocities of axes in every cycle until it ends."""
    equal(ctx, "error code of the start", made.start(), 0)
    since = ctx.now_s
    ctx.wait_until(lambda: not made.running, 20.0, "the path is over")
    trace = ctx.trace()
    rows = trace["x.set_position"].time_s > since - 1e-9
    columns = [f"{name}.set_{what}" for what in ("position", "velocity") for name in names]
    return list(zip(*(trace[name].values[rows].tolist() for name in columns), strict=True))


@OF_PATHS.case("auxiliary", requirements=("NC-176", "NC-190"))
def auxiliary(ctx: CaseContext) -> None:
    """Auxiliary axes go along with the path: straight between the ends of the moves, smooth within their
    ball, and slow enough where one has a corner without ball; the feed is that of the path.
    """
    made = _group(ctx, "wq")
    made.g1(90.0, x=40.0, v=0.0, w=8.0, q=3.0)
    made.g1(90.0, x=80.0, v=0.0, w=2.0, q=9.0)
    made.g1(70.0, x=80.0, v=30.0, w=2.0, q=9.0)
    path = _travel(ctx, made, "xvwq")
    equal(ctx, "greatest path velocity", max(one[4] for one in path), 90.0, within=0.01)
    ends = [path[-1][number] for number in range(4)]
    equal(
        ctx,
        f"ends {ends}",
        max(abs(a - b) for a, b in zip(ends, (80, 30, 2, 9), strict=True)),
        0,
        within=1e-6,
    )
    # w has slopes of 0.2, -0.15 and 0, and balls of 1.5 mm around its knots: 7.5 and 10 mm of the path.
    knots = ((40.0, 8.0, 0.2, -0.35, 7.5), (80.0, 2.0, -0.15, 0.15, 10.0))
    worst = [0.0, 0.0]
    for x, v, w, q, *_ in path:
        way = x + v
        wanted = 0.2 * way if way <= 40.0 else 8.0 - 0.15 * (way - 40.0) if way <= 80.0 else 2.0
        for at, place, slope, change, wide in knots:
            if abs(way - at) < wide:
                u = (way - at + wide) / (2.0 * wide)
                wanted = place + slope * (way - at) + change * 2.0 * wide * (u**3 - 0.5 * u**4)
        straight = 0.075 * way if way <= 40.0 else 3.0 + 0.15 * (way - 40.0) if way <= 80.0 else 9.0
        worst = [max(worst[0], abs(w - wanted)), max(worst[1], abs(q - straight))]
    equal(ctx, "w off its track", worst[0], 0.0, "NC-176", within=1e-6)
    equal(ctx, "q off its track", worst[1], 0.0, "NC-176", within=1e-6)
    at_knot = min(path, key=lambda one: abs(one[0] - 40.0))
    # The slope of q changes by 0.075 there, and its step may be 3 times 800 mm/s2 in a cycle.
    most = 3.0 * 800.0 * _CYCLE_S / 0.075
    ctx.measure("velocity at the corner of q", at_knot[4], "mm/s", low=0.7 * most, high=most + 2.0)
    steps = max(abs(b[6] - a[6]) for a, b in pairwise(path) if abs(a[0] - 40.0) < 7.5)
    ctx.measure("change of the velocity of w in a cycle", steps, "mm/s", high=1.5, requirements=("NC-176",))


@OF_PATHS.case("rapid", requirements=("NC-176", "NC-178", "NC-179"))
def rapid(ctx: CaseContext) -> None:
    """G0 waits for the slowest axis, auxiliary ones too; a move of these alone is refused."""
    made = _group(ctx, "w")
    made.g0(x=60.0, w=10.0)
    equal(ctx, "rapid", made.rapid, 1)
    path = _travel(ctx, made, "xvw")
    # w needs 10 mm with 25 mm/s: x has 60 mm in that time
    equal(ctx, "greatest velocity of x", max(one[3] for one in path), 150.0, "NC-179", within=1e-3)
    equal(ctx, "greatest velocity of w", max(one[5] for one in path), 25.0, "NC-179", within=1e-3)
    refused = 0
    try:
        made.g1(50.0, w=20.0)
    except Exception as error:  # noqa: BLE001 - whatever refuses it, the story says what it was
        ctx.do(f"refused: {error}")
        refused = 1
    equal(ctx, "auxiliary axes alone are refused", refused, 1, "NC-176")


@OF_PATHS.product(
    "override/{kind}-{percent}",
    parameters=[
        {"kind": kind, "percent": percent, "fast": fast, "slow": slow}
        for kind, percent, fast, slow in (
            ("original", 50, 60.0, 20.0), ("original", 130, 120.0, 40.0),
            ("beyond", 50, 60.0, 20.0), ("beyond", 150, 180.0, 60.0), ("beyond", 400, 300.0, 160.0),
        )
    ],
    title="Override {percent} % of a path, type {kind}",
    requirements=("NC-170", "NC-171", "NC-172"),
)  # fmt: skip
def override(ctx: CaseContext, kind: str, percent: int, fast: float, slow: float) -> None:
    """The override scales the velocities of the path; above 100 % with one type alone, up to the rapid
    traverse.
    """
    made = _group(ctx)
    made.override_type = ORIGINAL if kind == "original" else REDUCED_BEYOND
    made.override = percent / 100.0
    made.g1(120.0, x=150.0, v=0.0)
    made.g1(40.0, x=190.0, v=0.0)
    path = _travel(ctx, made, "xv")
    equal(ctx, "on the first part", max(one[2] for one in path if one[0] < 140.0), fast, "NC-170", within=0.5)
    equal(
        ctx, "on the second part", max(one[2] for one in path if 165.0 < one[0] < 178.0), slow, "NC-172",
        within=0.5,
    )  # fmt: skip


@OF_PATHS.case("held", requirements=("NC-170",))
def held(ctx: CaseContext) -> None:
    """An override of 0 brakes on the path with its deceleration, and the group waits; it goes on to the end
    with another one. A group that does not begin where its axes are, or with an axis that is busy, does not
    start.
    """
    made = _group(ctx)
    made.g1(100.0, x=60.0, v=30.0)
    equal(ctx, "error code of the start", made.start(), 0)
    ctx.run_for(0.25)
    made.override = 0.0
    since = ctx.now_s
    ctx.run_for(0.3)
    place = ctx.bench.axis("x", controller="nc").ref.NcToPlc.SetPos
    ctx.run_for(0.1)
    one = ctx.bench.axis("x", controller="nc")
    equal(ctx, "it stands", one.ref.NcToPlc.SetPos, place, "NC-170", within=1e-9)
    equal(ctx, "the group waits", made.running, 1, "NC-170")
    trace = ctx.trace()
    moving = trace["x.set_velocity"].time_s[trace["x.set_velocity"].values > 1e-9]
    ctx.measure(
        "time of braking", float(moving[-1]) - since, "s", low=100.0 / 700.0, high=100.0 / 700.0 + 0.03
    )
    made.override = 1.0
    ctx.wait_until(lambda: not made.running, 5.0, "the path is over")
    equal(ctx, "end", one.ref.NcToPlc.SetPos, 60.0, within=1e-6)
    made.g1(50.0, x=70.0)
    until(ctx, one.move_relative(1.0, Velocity=50.0).done)
    equal(ctx, "error code of a start elsewhere", made.start(), 0x4B06)
    again = _group(ctx)
    again.g1(50.0, x=90.0)
    v = ctx.bench.axis("v", controller="nc")
    busy = v.move_velocity(1.0)
    ctx.run_for(0.02)
    again_busy = InterpolationGroup(
        [one.object, v.object], cycle_s=_CYCLE_S, acceleration=500.0, deceleration=500.0, jerk=10_000.0
    )
    again_busy.g1(50.0, x=90.0)
    equal(ctx, "error code with a busy axis", again_busy.start(), 0x4B05)
    equal(ctx, "x is free", one.ref.NcToPlc.StateDWord >> 25 & 1, 1)
    del busy
    until(ctx, one.move_relative(1.0, Velocity=50.0).done)


# -- a motor with an observer --------------------------------------------------------------------------------

OBSERVER: Final = BenchFile(
    "nc observer",
    """
[bench]
name = "nc observer"
kind = "virtual"
cycle_ms = 2
[segment.can0]
bitrate = 1_000_000
[drive.motor]
segment = "can0"
node_id = 5
[axis.x]
controller = "nc"
drive = "motor"
interface = "torque"
[axis.x.parameters]
"ctrl.type" = "Position P and velocity PI controller with Observer (Torque)"
"ctrl.pos_kv" = 15.0
"ctrl.velo_kv" = 0.5
"ctrl.velo_tn" = 0.05
"ctrl.velo_i_limit" = 1.0
"ctrl.obs_mode" = "LUENBERGER"
"ctrl.obs_kt" = 0.02
"ctrl.obs_jm" = 30.0
"ctrl.obs_f0" = 40.0
"ctrl.obs_kc" = 0.9
"ctrl.obs_filter_t" = 0.003
"drv.input_scaling_torque" = 1.0
"axis.position_lag_max" = 20.0
""",
)
OF_OBSERVER: Final = Campaign("nc observer", tags=("nc",), controller="nc", bench=f"{_HERE}:OBSERVER")


@OF_OBSERVER.case("estimates", requirements=("NC-541", "NC-543", "NC-544", "NC-545", "NC-547", "NC-548"))
def estimates(ctx: CaseContext) -> None:
    """The loop uses the velocity of the model, which torque and measured position move by the equations of
    the observer.
    """
    one = axis(ctx)
    rows: list[tuple[float, float, float]] = []
    loop = one.object.velocity_controller

    def look() -> None:
        rows.append((one.position, one.object.drive.actual_torque, loop.velocity))

    end = ctx.bench.on_cycle(look)
    begin = loop.observer.position, loop.observer.estimate, loop.observer.velocity
    until(ctx, one.move_absolute(30.0, Velocity=120.0).done)
    end()
    position, estimate, velocity = begin
    pole = 1.0 / (1.0 + 2.0 * pi * 40.0 * _CYCLE_S)
    gain = 0.02 / (30.0 * 1e-4) / loop.observer.motor_rad
    wanted = []
    for measured, torque, _ in rows:
        position, estimate = position + estimate * _CYCLE_S, estimate + gain * torque * _CYCLE_S
        error = 0.9 * (measured - position)
        position += (1.0 - pole * pole) * error
        estimate += (1.0 - pole) ** 2 / _CYCLE_S * error
        velocity += _CYCLE_S / (_CYCLE_S + 0.003) * (estimate - velocity)
        wanted.append(velocity)
    same_column(ctx, "velocity of the observer", [row[2] for row in rows], wanted, "NC-548", within=1e-3)
    ctx.run_for(0.3)
    equal(ctx, "end", one.position, 30.0, within=0.2)
