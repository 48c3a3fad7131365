"""Controllers: operating states and what each keeps, a leading axis of another controller, transfer of drive
parameters, optimisation of the position controller.
"""

from __future__ import annotations

from math import e, pi
from typing import Any, Final

import numpy as np

from hil.bench import BenchFile, load_bench
from hil.campaign import Campaign, CaseContext
from motion.s7.commissioning import Optimisation, TestStep
from motion.s7.controller import ControllerError, OperatingState
from testcases.campaigns.support import equal

_HERE: Final = "testcases.campaigns.controllers"
CELL: Final = BenchFile(
    "cell",
    """
[bench]
name = "cell"
kind = "virtual"
cycle_ms = 4

[segment.can0]
kind = "can"

[controller.plc2]
phase_us = 500

[drive.leader_drive]
profile = "cia402"
segment = "can0"
node_id = 1

[drive.follower_drive]
profile = "profidrive"
telegram = 105
segment = "can0"
node_id = 2

[axis.leader]
drive = "leader_drive"

[axis.leader.variables]
"Modulo.Enable" = true
"Modulo.Length" = 70.0

[proxy.line]
axis = "leader"
plc = "plc2"
variables = { "Parameter.ToleranceTimeExternalLeadingValueInvalid" = 0.02 }

[axis.follower]
type = "synchronous"
plc = "plc2"
drive = "follower_drive"
leading = ["line"]
""",
)
_ABSOLUTE: Final = {"Sensor[1].Type": 1, "Sensor[1].Parameter.DeterminableRevolutions": 4096}
_TWO: Final = {
    "Actor.DataAdaption": 1,
    "Sensor[1].DataAdaption": 1,
    "Actor.DriveParameter.ReferenceSpeed": 1000.0,
    "Actor.DriveParameter.ReferenceTorque": 9.0,
    "Actor.DriveParameter.MaxSpeed": 500.0,
    "Sensor[1].Parameter.StepsPerRevolution": 100,
    "Sensor[1].Parameter.FineResolutionXist1": 3,
}
ADAPTED: Final[BenchFile] = load_bench("profidrive").configured(
    {
        "axis": {"axis1": {"variables": _TWO}},
        "drive": {"drive1": {"profidrive": {"reference_speed_rpm": 4000.0, "reference_torque_nm": 3.5}}},
    }
)
"""A bench whose controller has wrong numbers of its drive, and reads the right ones."""
SERVO: Final[BenchFile] = load_bench("profidrive").configured(
    {
        "axis": {
            "axis1": {
                "variables": {
                    "Actor.DataAdaption": 1,
                    "Sensor[1].DataAdaption": 1,
                    "PositionControl.EnableDSC": True,
                    "Actor.LoadInertia": 1.0,
                }
            }
        }
    }
)
STATES: Final = Campaign("operating states", tags=("controller",), bench="reference")
PROXIES: Final = Campaign("leading axis proxy", tags=("synchronous",), bench=f"{_HERE}:CELL")
ADAPTION: Final = Campaign("drive parameters", tags=("profidrive",), bench=f"{_HERE}:ADAPTED")
INERTIA: Final = Campaign("inertias", tags=("profidrive",), bench=f"{_HERE}:SERVO")
OPTIMISATION: Final = Campaign("optimisation", tags=("control",), bench="reference")


# -- operating states --------------------------------------------------------------------------------------


def _running(ctx: CaseContext) -> None:
    ctx.wait_until(lambda: ctx.bench.controller.state is OperatingState.RUN, 5.0, "RUN")
    ctx.run_for(0.05)


def _off(ctx: CaseContext, axis: Any) -> None:
    ctx.wait_until(lambda: axis.object.state.name in ("DISABLED", "ALARM_DISABLED"), 3.0, "the axis is off")
    ctx.run_for(0.05)


_EVENTS: Final = ("run_stop_run", "restart", "download", "power_cycle", "memory_reset", "factory_reset")


def _happen(ctx: CaseContext, axis: Any, event: str) -> None:
    ctx.do(event.replace("_", " "))
    controller = ctx.bench.controller
    if event == "restart":
        axis.power(False)
        _off(ctx, axis)
        ctx.wait_until(axis.reset(restart=True).done, 3.0, "the restart is done")
        ctx.run_for(0.05)
        return
    if event == "power_cycle":
        controller.power_off()
        ctx.run_for(0.2)
        controller.power_on()
    else:
        controller.stop()
        _off(ctx, axis)
        if event == "download":
            controller.download(axis.name)
        elif event != "run_stop_run":
            getattr(controller, event)()
        controller.run()
    _running(ctx)


@STATES.product(
    "kept/{event}",
    parameters={"event": _EVENTS},
    title="What is kept: {event}",
    requirements=("VAR-227", "MC-606", "CTL-106"),
)
def kept(ctx: CaseContext, event: str) -> None:
    """Assigned values and the homed state outlast RUN-STOP-RUN alone; start values outlast everything; the
    axis can be enabled and moves afterwards.
    """
    axis = ctx.axis
    before = axis.var("PositionControl.Kv")
    ctx.wait_until(axis.power().status, 3.0, "the axis is enabled")
    ctx.wait_until(axis.home(37.0).done, 1.0, "the axis is homed")
    axis.write("Override.Velocity", 35.0)
    axis.write("PositionControl.Kv", 13.0)
    same = event == "run_stop_run"
    if not same:  # it would be put into force by a restart of the object
        axis.object.variables.write_start("Actor.RemoveEnableReaction", 3)
    ctx.run_for(0.1)
    _happen(ctx, axis, event)
    equal(ctx, "override", axis.var("Override.Velocity"), 35.0 if same else 100.0, "VAR-227")
    equal(ctx, "gain", axis.var("PositionControl.Kv"), 13.0 if same else before, "CTL-106")
    if not same:
        equal(ctx, "start value", axis.var("Actor.RemoveEnableReaction"), 3, "VAR-229")
    equal(ctx, "homed", axis.var("StatusWord.X5"), same, "HOM-183")
    if same:
        equal(ctx, "position", axis.var("ActualPosition"), 37.0, "CFG-294", within=0.02)
    elif event in ("power_cycle", "memory_reset", "factory_reset"):
        equal(ctx, "position", axis.var("ActualPosition"), 0.0, "CFG-294", within=0.05)
    # A drive that has missed its controller is in fault.
    ctx.wait_until(axis.reset().done, 2.0, "axis and drive are acknowledged")
    axis.power(False)
    ctx.run_for(0.05)
    ctx.wait_until(axis.power().status, 5.0, "the axis is enabled again")
    begin = axis.var("ActualPosition")
    ctx.wait_until(axis.move_relative(11.0, Velocity=100.0).done, 4.0, "the axis has moved")
    equal(ctx, "way", axis.var("ActualPosition") - begin, 11.0, within=0.15)


@STATES.product(
    "stop/{reaction}",
    parameters=[
        {"reaction": 1, "word": 0x047E},
        {"reaction": 3, "word": 0x047C},
        {"reaction": 5, "word": 0x047A},
        {"reaction": 7, "word": 0x047B},
    ],
    title="STOP in motion, drive stop {reaction}",
    requirements=("MC-629", "STP-506"),
)
def stopped(ctx: CaseContext, reaction: int, word: int) -> None:
    """The job is aborted without alarm, the control word is that of the drive stop, the program does not run
    and outputs are zero in the end.
    """
    axis = ctx.axis
    axis.object.variables.write_start("Actor.RemoveEnableReaction", reaction)
    ctx.wait_until(axis.reset(restart=True).done, 3.0, "the start value counts")
    ctx.wait_until(axis.power().status, 3.0, "the axis is enabled")
    job = axis.move_velocity(200.0)
    ctx.wait_until(job.in_velocity, 3.0, "the velocity is there")
    since = ctx.now_s
    ctx.bench.controller.stop()
    ctx.run_for(0.008)
    trace = ctx.trace()
    words = trace[f"{axis.name}.stw1"]
    sent = [int(value) for value in words.values[words.time_s > since]]
    equal(ctx, f"control words {[hex(one) for one in sent]}", sent[0] & 0x047F, word, "STP-506")
    _off(ctx, axis)
    equal(ctx, "alarm", axis.var("ErrorDetail.Number"), 0, "MC-629")
    events = [one for one in ctx.trace().events if one.kind == "job.aborted" and one.data["job"] == job.name]
    equal(ctx, "the job was aborted once", len(events), 1, "MC-629")
    equal(ctx, "state", ctx.bench.controller.state is OperatingState.STOP, 1)
    ctx.run_for(1.0)
    equal(ctx, "control word at last", int(ctx.trace()[f"{axis.name}.stw1"].values[-1]), 0, "MC-632")
    equal(ctx, "velocity", axis.var("ActualVelocity"), 0.0, within=2.0)


@STATES.case("refused", requirements=("MC-629",))
def refused(ctx: CaseContext) -> None:
    """What needs STOP is refused in RUN; a command that changes nothing is not an error."""
    controller = ctx.bench.controller
    for command in (controller.memory_reset, controller.factory_reset, lambda: controller.download("axis1")):
        code = 0
        try:
            command()
        except ControllerError:
            code = 1
        equal(ctx, "refused in RUN", code, 1)
    equal(ctx, "still in RUN", controller.state is OperatingState.RUN, 1)
    diagnosis = controller.diagnosis()
    equal(ctx, "the diagnosis has entries", bool(diagnosis.buffer if hasattr(diagnosis, "buffer") else 1), 1)


@STATES.case("download", requirements=("MC-606",))
def download(ctx: CaseContext) -> None:
    """New start values of a download count from the next RUN on; a wrong one is refused."""
    axis, controller = ctx.axis, ctx.bench.controller
    controller.stop()
    _off(ctx, axis)
    code = 0
    try:
        controller.download(axis.name, {"DynamicLimits.MaxVelocity": -5.0})
    except Exception as error:  # noqa: BLE001 - whatever refuses it, the case says what it was
        ctx.do(f"refused: {error}")
        code = 1
    equal(ctx, "a wrong start value is refused", code, 1)
    controller.download(axis.name, {"DynamicDefaults.Velocity": 61.0, "PositionControl.Kv": 17.0})
    controller.run()
    _running(ctx)
    equal(ctx, "velocity", axis.var("DynamicDefaults.Velocity"), 61.0, "MC-606")
    equal(ctx, "gain", axis.var("PositionControl.Kv"), 17.0, "MC-606")
    ctx.wait_until(axis.power().status, 5.0, "the axis is enabled")
    job = axis.move_relative(30.0)
    ctx.run_for(0.3)
    equal(ctx, "velocity of a job with the default", axis.var("Velocity"), 61.0, "MC-606", within=1e-6)
    ctx.wait_until(job.done, 3.0, "the axis has moved")


# -- leading-axis proxy ------------------------------------------------------------------------------------


def _geared(ctx: CaseContext, ratio: tuple[int, int] = (1, 1)) -> tuple[Any, Any, Any]:
    leader, follower = ctx.bench.axis("leader"), ctx.bench.axis("follower")
    for axis in (leader, follower):
        ctx.wait_until(axis.power().status, 3.0, f"{axis.name} is enabled")
    ctx.wait_until(leader.move_velocity(50.0).in_velocity, 3.0, "the leading axis moves")
    job = follower.gear_in(ctx.bench.proxy("line"), *ratio)
    ctx.wait_until(job.in_gear, 3.0, "the follower is in gear")
    ctx.run_for(0.2)
    return leader, follower, job


@PROXIES.product(
    "gear/{numerator}",
    parameters={"numerator": (1, 2, -1)},
    title="In gear {numerator}:1 behind an axis of another controller",
    requirements=("SYN-357", "SYN-073"),
)
def proxied(ctx: CaseContext, numerator: int) -> None:
    """The follower goes with its ratio in its own cycles, through the modulo range of the leading axis."""
    leader, follower, job = _geared(ctx, (numerator, 1))
    since = ctx.now_s
    ctx.run_for(2.0)
    trace = ctx.trace()
    y = trace["follower.position_setpoint"]
    rows = y.time_s > since
    speeds = np.diff(y.values[rows]) / 0.004
    equal(ctx, "slowest", float(speeds.min()), 50.0 * numerator, "SYN-357", within=1e-3)
    equal(ctx, "fastest", float(speeds.max()), 50.0 * numerator, "SYN-357", within=1e-3)
    phases = {round(time * 1e3 % 4.0, 3) for time in y.time_s[rows]}
    equal(ctx, f"phase of its cycles {phases}", phases == {0.5}, 1, "SYN-073")
    leader.halt()
    ctx.run_for(1.0)
    equal(ctx, "velocity of the follower at the end", follower.var("Velocity"), 0.0, within=1e-6)
    equal(ctx, "InGear", job.InGear, 1)


@PROXIES.product(
    "outage/{cycles}",
    parameters={"cycles": (3, 4, 8, 30)},
    title="The leading value is lost for {cycles} cycles",
    requirements=("SYN-358",),
)
def outage(ctx: CaseContext, cycles: int) -> None:
    """A short outage is bridged; one beyond the tolerance time is alarm 900 of the proxy and 601 of the axis;
    both can be acknowledged when the value is back.
    """
    leader, follower, job = _geared(ctx)
    line = ctx.bench.proxy("line")
    line.link.lost = True
    ctx.run_for(0.004 * cycles)
    line.link.lost = False
    ctx.run_for(1.0)
    lost = cycles > 6
    equal(ctx, "InGear", job.InGear, not lost, "SYN-358")
    equal(ctx, "alarm of the proxy", line.var("ErrorDetail.Number"), 900 if lost else 0, "SYN-358")
    equal(ctx, "alarm of the axis", follower.var("ErrorDetail.Number"), 601 if lost else 0, "SYN-358")
    equal(ctx, "velocity of the leading axis", leader.var("Velocity"), 50.0, within=1e-6)
    equal(ctx, "velocity of the follower", follower.var("Velocity"), 0.0 if lost else 50.0, within=1e-3)
    if lost:
        for one in (line, follower):
            ctx.wait_until(one.reset().done, 1.0, "it is acknowledged")
        ctx.run_for(0.3)
        again = follower.gear_in(line)
        ctx.wait_until(again.in_gear, 3.0, "the follower is in gear again")
        equal(ctx, "alarm of the proxy", line.var("ErrorDetail.Number"), 0)


@PROXIES.case("stop", requirements=("SYN-357",))
def one_stops(ctx: CaseContext) -> None:
    """STOP of the second controller disables its axis alone."""
    leader, follower, _ = _geared(ctx)
    ctx.bench.controllers["plc2"].stop()
    ctx.run_for(1.0)
    equal(ctx, "plc2", ctx.bench.controllers["plc2"].state is OperatingState.STOP, 1)
    equal(ctx, "the first controller", ctx.bench.controller.state is OperatingState.RUN, 1)
    equal(ctx, "follower enabled", follower.var("StatusWord.X0"), 0)
    equal(ctx, "leader enabled", leader.var("StatusWord.X0"), 1)
    equal(ctx, "velocity of the leader", leader.var("Velocity"), 50.0, within=1e-6)


# -- parameters of the drive -------------------------------------------------------------------------------


def _settled(ctx: CaseContext) -> tuple[float, float]:
    paths = ("StatusDrive.AdaptionState", "StatusSensor[1].AdaptionState")
    ctx.wait_until(lambda: all(ctx.axis.var(path) >= 2 for path in paths), 3.0, "the transfer is over")
    return ctx.axis.var(paths[0]), ctx.axis.var(paths[1])


@ADAPTION.case("taken-over", requirements=("CFG-346", "CFG-353", "VAR-150"))
def taken_over(ctx: CaseContext) -> None:
    """The numbers of the drive replace those of the project; the axis moves as far as it shall, also when the
    drive was switched off and on.
    """
    axis = ctx.axis
    equal(ctx, "both are transferred", _settled(ctx) == (2, 2), 1, "VAR-150")
    for path, wanted in (
        ("Actor.DriveParameter.ReferenceSpeed", 4000.0),
        ("Actor.DriveParameter.ReferenceTorque", 3.5),
        ("Actor.DriveParameter.MaxSpeed", 3000.0),
        ("Sensor[1].Parameter.StepsPerRevolution", 2048),
        ("Sensor[1].Parameter.FineResolutionXist1", 11),
        ("Sensor[1].Parameter.DeterminableRevolutions", 0),
    ):
        equal(ctx, path, axis.var(path), wanted, "CFG-346", within=1e-3)
    drive = ctx.bench.drive_of(axis.name)
    for _ in range(2):
        if axis.var("WarningWord"):
            axis.reset()
            ctx.run_for(0.05)
        ctx.wait_until(axis.power().status, 3.0, "the axis is enabled")
        begun = float(ctx.trace()[f"{drive}.position"].values[-1])
        ctx.wait_until(axis.move_relative(40.0).done, 5.0, "the axis has moved")
        ctx.run_for(0.2)
        way = float(ctx.trace()[f"{drive}.position"].values[-1]) - begun
        equal(ctx, "way of the machine, mm", way * 1000.0, 40.0, "CFG-353", within=0.05)
        off = ctx.inject("drive.power_off", drive)
        ctx.run_for(0.5)
        equal(ctx, "state without drive", axis.var("StatusDrive.AdaptionState"), 0, "CFG-345")
        off.remove()
        ctx.run_for(1.0)
        equal(ctx, "both are transferred again", _settled(ctx) == (2, 2), 1, "CFG-345")
        axis.reset()
        axis.power(False)
        ctx.run_for(0.3)


@INERTIA.case("taken-over", requirements=("CFG-580", "CFG-575"))
def inertias(ctx: CaseContext) -> None:
    """With dynamic servo control the inertias of motor and load are those of the machine."""
    axis = ctx.axis
    equal(ctx, "both are transferred", _settled(ctx) == (2, 2), 1)
    parts = ctx.bench.drive(ctx.bench.drive_of(axis.name)).drive.config.mechanics
    motor, load = axis.var("Actor.DriveParameter.MotorInertia"), axis.var("Actor.LoadInertia")
    equal(ctx, "motor", motor, parts.motor_inertia_kgm2, "CFG-580", within=1e-8)
    wanted = parts.load_mass_kg + parts.screw_inertia_kgm2 * (2.0 * pi / 0.010) ** 2
    equal(ctx, "load", load, wanted, "CFG-575", within=1e-4 * wanted)


# -- optimisation ------------------------------------------------------------------------------------------


@OPTIMISATION.case("gain", requirements=("COM-055", "COM-060", "COM-067"))
def gain(ctx: CaseContext) -> None:
    """The gain that is recommended does not overshoot, twice as much does; it is 1/(e T) of the dead time."""
    panel = ctx.axis.control_panel()
    panel.take_control()
    panel.enable()
    ctx.wait_until(lambda: panel.enabled, 3.0, "the panel has enabled the axis")
    bench = ctx.bench

    def wait(condition: Any, seconds: float) -> bool:
        return bool(bench.run_until(condition, timeout=seconds))

    step = TestStep(distance=5.0, velocity=60.0, acceleration=1000.0)
    routine = Optimisation(panel, bench.runtime, wait, step)
    found = routine.run()
    best = 1.0 / (e * bench.port(bench.drive_of()).delay_ns * 1e-9)
    equal(ctx, "gain", found.kv / 0.9, best, "COM-060", within=0.1 * best)
    equal(ctx, "precontrol", found.kpc, 100.0, "COM-062")
    equal(ctx, "the last attempt was good", found.attempts[-1].good, 1, "COM-065")
    equal(ctx, "gain of the last attempt", found.attempts[-1].kv, found.kv, "COM-067")
    equal(ctx, "the gain is good once more", routine.attempt(found.kv, 0.0, 0.0).good, 1, "COM-063")
    twice = routine.attempt(2.0 * found.kv, 0.0, 0.0)
    equal(ctx, "twice as much is not", twice.good, 0, "COM-063")
    ctx.measure("overshoot of twice as much", twice.overshoot, low=found.attempts[0].tolerance)
    ctx.measure("greatest overshoot", max(one.overshoot for one in found.attempts), high=0.5)
