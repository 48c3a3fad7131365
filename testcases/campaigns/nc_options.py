"""Options of NC axes: control laws, outputs, encoder values, retained positions, images, loads of tasks."""

from __future__ import annotations

import struct
from math import inf
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from hil.bench import BenchFile
from hil.campaign import Campaign, CaseContext
from motion.nc.coordinated import MC_Default, MC_Maximum, coordinated_dynamics
from motion.nc.retain import RetainDataError
from motion.nc.tables import Table
from testcases.campaigns.nc_axes import BENCH as NC_AXES
from testcases.campaigns.nc_axes import axis, until
from testcases.campaigns.support import equal, same_column

Numbers = NDArray[np.float64]

_LAWS: Final[dict[str, dict[str, Any]]] = {
    "p": {"ctrl.pos_kv": 21.0},
    "two": {
        "ctrl.type": "Position controller with two P constants (with Ka)", "ctrl.pos_kv_standstill": 31.0,
        "ctrl.pos_kv_moving": 11.0, "ctrl.pos_vdyn": 0.4, "ctrl.ka": 0.013, "ctrl.pos_dead_band": 0.02,
    },
    "pid": {
        "ctrl.type": "Position controller PID (with Ka)", "ctrl.pos_kv": 17.0, "ctrl.pos_ti_tn": 0.21,
        "ctrl.pos_tv": 0.03, "ctrl.pos_td": 0.05, "ctrl.pos_i_limit": 0.02, "ctrl.pos_d_limit": 0.015,
        "ctrl.ka": 0.01,
    },
}  # fmt: skip
_SHARED: Final[dict[str, Any]] = {
    "ctrl.velocity_precontrol_weight": 0.83, "axis.reference_velocity": 500.0,
    "axis.maximum_velocity": 450.0, "axis.position_lag_monitoring": False,
    "axis.maximum_acceleration": 1000.0, "axis.maximum_deceleration": 800.0,
}  # fmt: skip
_OUTPUTS: Final[dict[str, dict[str, Any]]] = {
    "delayed": {"ctrl.pos_kv": 5.0, "drv.output_delay_velocity": 0.006},
    "limited": {"ctrl.pos_kv": 5.0, "drv.output_limit_max": 0.11, "drv.output_limit_min": -0.07},
    "drifting": {"ctrl.pos_kv": 5.0, "drv.drift_compensation": 1.7},
    "ratio": {"ctrl.pos_kv": 5.0, "drv.output_ratio": 0.8},
    "filtered": {"ctrl.pos_kv": 5.0, "enc.filter_time_position": 0.02, "enc.filter_time_velocity": 0.05},
    "compensated": {
        "ctrl.pos_kv": 5.0, "enc.time_comp_mode": "ON (with velocity)", "enc.time_comp_cycles": 3.0,
        "enc.time_comp_additional": 500.0,
    },
}  # fmt: skip


def _axes(rows: dict[str, dict[str, Any]]) -> dict[str, Any]:
    return {
        name: {"controller": "nc", "parameters": {**_SHARED, **parameters}}
        for name, parameters in rows.items()
    }


def _bench(name: str, axes: dict[str, Any]) -> BenchFile:
    plain = BenchFile(
        name,
        f'[bench]\nname = "{name}"\nkind = "virtual"\ncycle_ms = 2\n[segment.can0]\nbitrate = 1_000_000\n'
        '[drive.motor]\nsegment = "can0"\nnode_id = 5\n',
    )
    return plain.configured({"axis": axes})


LAWS: Final = _bench("nc control laws", _axes(_LAWS))
OUTPUTS: Final = _bench("nc outputs", _axes(_OUTPUTS))
_HERE: Final = "testcases.campaigns.nc_options"
OF_LAWS: Final = Campaign("nc control laws", tags=("nc",), controller="nc", bench=f"{_HERE}:LAWS")
OF_OUTPUTS: Final = Campaign("nc outputs", tags=("nc",), controller="nc", bench=f"{_HERE}:OUTPUTS")
_CYCLE_S: Final = 0.002
_WEIGHT, _FULL = 0.83, 500.0


# -- control laws and outputs --------------------------------------------------------------------------------


class _Rows:
    """What is recorded of an axis, cycle by cycle."""

    def __init__(self, ctx: CaseContext, name: str) -> None:
        trace = ctx.trace()

        def values(column: str) -> Numbers:
            return np.asarray(trace[f"{name}.{column}"].values, dtype=np.float64)

        self.set, self.velocity, self.acceleration = map(
            values, ("set_position", "set_velocity", "set_acceleration")
        )
        self.actual, self.speed, self.error = map(
            values, ("actual_position", "actual_velocity", "following_error")
        )
        self.output, self.data = values("output"), values("output_data")

    def plain(self, gain: float) -> Numbers:
        """Return the output of precontrol and gain, mm/s."""
        return _WEIGHT * self.velocity + gain * self.error


def _travel(ctx: CaseContext, rows: dict[str, dict[str, Any]]) -> dict[str, _Rows]:
    """Let all axes move to and fro; returns what is recorded of each."""
    axes = [axis(ctx, name) for name in rows]
    inputs = {"Velocity": 230.0, "Acceleration": 900.0, "Deceleration": 700.0, "Jerk": 20_000.0}
    for way in (61.0, -47.0):
        moves = [one.move_relative(way, **inputs) for one in axes]
        until(ctx, lambda moves=moves: all(one.Done for one in moves), "all motions are done")
        ctx.run_for(0.1)
    return {name: _Rows(ctx, name) for name in rows}


def _pid(rows: _Rows) -> Numbers:
    """Return the output of the PID controller by its equations, cycle by cycle, mm/s."""
    law = _LAWS["pid"]
    kv, tn, tv, td = (law[f"ctrl.pos_{name}"] for name in ("kv", "ti_tn", "tv", "td"))
    most, bound = law["ctrl.pos_i_limit"] * _FULL, law["ctrl.pos_d_limit"] * _FULL
    integral = derivative = last = 0.0
    found = []
    for velocity, acceleration, error in zip(rows.velocity, rows.acceleration, rows.error, strict=True):
        derivative = (td * derivative + kv * tv * (error - last)) / (td + _CYCLE_S)
        last = error
        shown = min(max(derivative, -bound), bound)
        total = kv * error + integral + shown
        if not (abs(total) >= 0.5 * _FULL and total * error > 0.0):
            integral = min(max(integral + kv * error * _CYCLE_S / tn, -most), most)
        found.append(_WEIGHT * velocity + law["ctrl.ka"] * acceleration + kv * error + integral + shown)
    return np.array(found)


@OF_LAWS.case("laws", requirements=("NC-527", "NC-529", "NC-531", "NC-532"))
def laws(ctx: CaseContext) -> None:
    """In every cycle the output is that of the control law: precontrol, gains, dead band, integral and
    derivative parts with their limits.
    """
    found = _travel(ctx, _LAWS)
    same_column(ctx, "output of the P controller", found["p"].data, found["p"].plain(21.0))
    two, law = found["two"], _LAWS["two"]
    share = np.minimum(np.abs(two.velocity) / _FULL / law["ctrl.pos_vdyn"], 1.0)
    gain = 31.0 + (11.0 - 31.0) * share
    error = np.where(np.abs(two.error) <= law["ctrl.pos_dead_band"], 0.0, two.error)
    wanted = _WEIGHT * two.velocity + law["ctrl.ka"] * two.acceleration + gain * error
    same_column(ctx, "output with two gains", two.data, wanted)
    pid = found["pid"]
    enabled = int(np.flatnonzero(pid.velocity)[0])
    wanted = _pid(pid)
    same_column(ctx, "output of the PID controller", pid.data[enabled:], wanted[enabled:])
    for name, rows in found.items():
        same_column(ctx, f"share of full scale of {name}", rows.output * _FULL, rows.data, within=1e-9)


@OF_OUTPUTS.case("outputs", requirements=("NC-283", "NC-286", "NC-516", "NC-520"))
def outputs(ctx: CaseContext) -> None:
    """Delay, limits, drift and ratio change the output, filters and dead-time compensation the actual
    value, each by its formula and nothing else.
    """
    found = _travel(ctx, _OUTPUTS)
    plain = {name: rows.plain(5.0) for name, rows in found.items()}
    limited = np.clip(plain["limited"], -0.07 * _FULL, 0.11 * _FULL)
    same_column(ctx, "limited output", found["limited"].data, limited)
    drifting = found["drifting"]
    on = int(np.flatnonzero(drifting.velocity)[0])
    same_column(ctx, "output with drift", drifting.data[on:], plain["drifting"][on:] + 1.7)
    ratio = found["ratio"]
    same_column(ctx, "output with ratio", ratio.output * _FULL, 0.8 * plain["ratio"])
    for name in ("filtered", "compensated"):
        same_column(ctx, f"output, {name}", found[name].data, plain[name])
    # A simulated axis is where its set position was a cycle before.
    filtered, compensated = found["filtered"], found["compensated"]
    raw = np.concatenate((filtered.set[:1], filtered.set[:-1]))
    speed = np.concatenate(([0.0], np.diff(raw))) / _CYCLE_S
    same_column(ctx, "filtered position", filtered.actual, _pt1(raw, 0.02), "NC-283", within=1e-3)
    same_column(ctx, "filtered velocity", filtered.speed, _pt1(speed, 0.05), "NC-283", within=0.1)
    raw = np.concatenate((compensated.set[:1], compensated.set[:-1]))
    speed = np.concatenate(([0.0], np.diff(raw))) / _CYCLE_S
    wanted = raw + speed * (3.0 * _CYCLE_S + 0.0005)
    same_column(ctx, "compensated position", compensated.actual, wanted, "NC-286", within=5e-3)
    delayed, wanted = found["delayed"].data, plain["delayed"]
    same_column(ctx, "delayed output", delayed[100:], _pt1(wanted, 0.006)[100:], within=0.5)


def _pt1(values: Numbers, time_s: float) -> Numbers:
    """Return values behind a filter of the first order (NC-283)."""
    share = _CYCLE_S / (_CYCLE_S + time_s)
    found, last = [], float(values[0])
    for value in values:
        last = share * float(value) + (1.0 - share) * last
        found.append(last)
    return np.array(found)


# -- retained positions, images, loads -----------------------------------------------------------------------

KEPT: Final[BenchFile] = NC_AXES.configured(
    {
        "nc": {"parameters": {"task.retain_data": "Load (if available)/Store"}},
        "axis": {
            "x": {
                "parameters": {
                    "axis.data_persistence": True,
                    "enc.reference_system": "INCREMENTAL (singleturn absolute)",
                }
            }
        },
    }
)
"""The bench of the NC axes, one of which keeps its position."""
OF_TASKS: Final = Campaign("nc tasks", tags=("nc",), controller="nc", bench=f"{_HERE}:KEPT")
_IMAGE: Final = struct.Struct("<II4B4I4BiI")
_ENCODER, _DRIVE = ("encoder.inputs", "encoder.outputs"), ("drive.inputs", "drive.outputs")


@OF_TASKS.case("retained", requirements=("NC-049", "NC-052", "NC-054", "NC-205"))
def retained(ctx: CaseContext) -> None:
    """A stop stores the positions of the axes that keep theirs; data that are missing, shortened or
    changed are not read; a system that loses its power stores nothing.
    """
    nc = ctx.bench.nc
    x, y = axis(ctx, "x"), axis(ctx, "y")
    for one in (x, y):
        until(ctx, one.set_position(113.0).done)
    until(ctx, x.move_absolute(120.0, Velocity=100.0).done)
    ctx.run_for(0.2)
    position, raw = x.object.encoder.uncorrected, x.object.encoder.hard_increments
    nc.stop()
    stored = nc.retain.read()
    equal(ctx, f"axes that are stored {sorted(stored)}", sorted(stored) == ["x"], 1, "NC-205")
    equal(ctx, "stored position", stored["x"].position, position, "NC-049", within=1e-9)
    equal(ctx, "stored count", stored["x"].raw, raw, "NC-049")
    equal(ctx, "running", nc.running, 0)
    good = nc.retain.content
    changed = good.replace(b"1", b"2")
    for content, reason in ((None, "missing"), (good[:-5], "corrupt"), (changed, "corrupt")):
        nc.retain.content = content
        try:
            nc.retain.read()
            said = ""
        except RetainDataError as error:
            said = str(error)
        equal(ctx, f"said of {reason} data: {said}", reason in said, 1, "NC-052")
    nc.lose_power()
    nc.stop()
    equal(ctx, "stored without power", nc.retain.content == changed, 1, "NC-054")


@OF_TASKS.product(
    "load/{task}", parameters={"task": ("saf", "svb")}, title="A cycle of {task} takes too long"
)
def load(ctx: CaseContext, task: str) -> None:
    """Half a cycle is a load; more than a whole one is an exceeded cycle, told once, and the motion goes
    on.
    """
    nc = ctx.bench.nc
    one = axis(ctx)
    motion = one.move_absolute(60.0, Velocity=100.0, Acceleration=1200.0, Deceleration=800.0, Jerk=20_000.0)
    ctx.run_for(0.1)
    watched = getattr(nc, task)
    for share, exceeded in ((0.5, 0), (1.0, 0), (1.75, 1)):
        watched.take(share * watched.cycle_ns * 1e-9)
        ctx.run_for(0.06)
        equal(ctx, f"load of {task}", watched.load, share, "NC-024", within=1e-9)
        equal(ctx, "cycles exceeded", watched.exceeds, exceeded, "NC-023")
    other = nc.svb if task == "saf" else nc.saf
    equal(ctx, "cycles of the other task exceeded", other.exceeds + len(other.over_time), 0, "NC-023")
    told = [event for event in ctx.trace().events if event.kind == "nc.cycle_exceeded"]
    equal(ctx, "told", len(told), 1, "NC-023")
    until(ctx, motion.done)
    watched.reset()
    equal(ctx, "counter behind a reset", watched.exceeds, 0)


@OF_TASKS.case("image", requirements=("NC-042", "NC-381", "NC-398", "NC-406", "NC-420"))
def image(ctx: CaseContext) -> None:
    """The process images of both profiles hold the words of their drive: count, control and status word,
    velocity with its sign, and the direction of motion.
    """
    nc = ctx.bench.nc
    axes = [axis(ctx, name) for name in "xy"]
    for sign in (1.0, -1.0):
        moves = [one.move_velocity(sign * 70.0) for one in axes]
        until(ctx, lambda moves=moves: all(one.InVelocity for one in moves), "both have their velocity")
        ctx.run_for(0.05)
        found = {name: _IMAGE.unpack(content) for name, content in nc.image().items()}
        equal(ctx, "images", len(found), 8, "NC-042")
        for one in axes:
            name, words = one.name, one.object.device.words
            encoder_in, encoder_out = (found[f"{name}.{part}"] for part in _ENCODER)
            drive_in, drive_out = (found[f"{name}.{part}"] for part in _DRIVE)
            raw = one.object.device.raw & 0xFFFFFFFF
            equal(ctx, f"count of {name}", encoder_in[0], raw, "NC-381")
            equal(ctx, f"copied count of {name}", encoder_out[0], raw, "NC-398")
            coe = "6041h" in words
            status, control = ("6041h", "6040h") if coe else ("ZSW1", "STW1")
            equal(ctx, f"status of {name}", drive_in[2], words[status] & 0xFF, "NC-406")
            high = words[status] >> 8 & 0xFF if coe else words["ZSW2"] & 0xFF
            equal(ctx, f"second status of {name}", drive_in[3], high, "NC-406")
            equal(ctx, f"fieldbus of {name}", encoder_in[5] | drive_in[5], 0)
            equal(ctx, f"control of {name}", drive_out[2], words[control] & 0xFF)
            equal(ctx, f"direction of {name}", drive_out[4], 0x42 if sign > 0.0 else 0x41, "NC-420")
            velocity = drive_out[1] - (1 << 32 if drive_out[1] >> 31 else 0)
            ctx.measure(f"velocity output of {name}", sign * velocity, low=100.0)


@OF_TASKS.case("tables", requirements=("NC-371", "NC-096", "NC-097", "NC-098", "NC-099"))
def tables(ctx: CaseContext) -> None:
    """A table is linear between its points, has their values at them and the outer ones outside; coordinated
    motions keep to the maxima of their axis, and refuse what is not above 0.
    """
    space = ctx.bench.nc.tables
    table = Table("valve", [(-1.0, -0.8), (0.0, 0.1), (0.5, 0.7)])
    number = space.add(table)
    equal(ctx, "id", space.add(Table("cam", [(0.0, 1.0), (2.0, 5.0)])), number + 1)
    equal(ctx, "of its kind", space.get(number, "valve") is table and space.get(number, "cam") is None, 1)
    for x, y in ((-1.0, -0.8), (-0.5, -0.35), (0.0, 0.1), (0.25, 0.4), (0.5, 0.7), (-3.0, -0.8), (9.0, 0.7)):
        equal(ctx, f"value at {x}", table.value(x), y, "NC-371", within=1e-12)
    for x, y in table.points:
        equal(ctx, f"spline at {x}", table.value(x, 1), y, within=1e-9)
    space.remove(number)
    equal(ctx, "removed", space.get(number, "valve") is None, 1)
    parameters = ctx.bench.axis("x", controller="nc").object.parameters
    read = ctx.bench.axis("x", controller="nc").read_parameter
    names = ("maximum_velocity", "maximum_acceleration", "maximum_deceleration", "default_acceleration")
    fastest, up, down, usual = (float(read(f"axis.{name}")) for name in names)
    slow, jerk = (float(read(f"axis.default_{name}")) for name in ("deceleration", "jerk"))
    for given, wanted in (
        ((MC_Maximum, MC_Maximum, MC_Maximum, MC_Default), (fastest, up, down, jerk)),
        ((fastest, MC_Default, MC_Default, inf), (fastest, min(usual, up), min(slow, down), 0.0)),
        ((10.0, 20.0, 30.0, 40.0), (10.0, 20.0, 30.0, 40.0)),
        ((0.0, 20.0, 30.0, 40.0), 0x4359), ((1.01 * fastest, 20.0, 30.0, 40.0), 0x4359),
        ((10.0, 0.0, 30.0, 40.0), 0x4B06), ((10.0, 20.0, 0.0, 40.0), 0x4B06),
        ((10.0, 1.01 * up, 30.0, 40.0), 0x4B06), ((10.0, 20.0, 1.01 * down, 40.0), 0x4B06),
        ((10.0, 20.0, 30.0, 0.0), 0x4B06),
    ):  # fmt: skip
        velocity, acceleration, deceleration, limit = given
        found = coordinated_dynamics(
            parameters, velocity=velocity, acceleration=acceleration, deceleration=deceleration, jerk=limit
        )
        equal(ctx, f"{given}: {found}", found == wanted, 1, "NC-097")
    ctx.run_for(0.02)
