"""What few programs use of an axis: measuring inputs, torque data, free bits of control words, simulation."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final

import numpy as np

from hil.bench import BenchFile, load_bench
from hil.campaign import Campaign, CaseContext
from hil.expect import no_alarm
from testcases.campaigns._instruction_outputs import Outputs, Watched
from testcases.campaigns._reactions import cycles
from testcases.campaigns.support import axis_name, drive_name, enable, equal

_HERE: Final = "testcases.campaigns.axis_options"

# -- measuring inputs ---------------------------------------------------------------------------------------

EDGES: Final = (21.3, 34.7, 48.2)
"""Where the probe rises, falls, and the second one rises, mm."""
_TABLES: Final = f"""
[drive.drive1.switches]
probe1_from_mm = {EDGES[0]}
probe1_to_mm = {EDGES[1]}
probe2_from_mm = {EDGES[2]}

[measuring_input.own]
of = "axis1"

[measuring_input.central]
of = "axis1"
kind = "central"
"""


def _measuring() -> BenchFile:
    text = load_bench("reference").text
    head, _, rest = text.partition("[drive.drive1.switches]\n")
    # What the reference bench says of its cam is not needed here.
    rest = rest[rest.index("[axis.axis1]") :]
    return BenchFile("measuring inputs", f"{head}{rest}{_TABLES}")


PROBES: Final = _measuring()
MEASURING: Final = Campaign("measuring inputs", tags=("axis", "measuring"), bench=f"{_HERE}:PROBES")
RISING, FALLING = EDGES[0], EDGES[1]
_MODES: Final[dict[int, tuple[float, ...]]] = {
    0: (RISING,),
    1: (FALLING,),
    2: (RISING, FALLING),
    3: (RISING, FALLING),
    4: (FALLING, FALLING),
}
"""Edges that a way to and fro over the probe has to give, by `Mode`; with 4 the rising one comes on the way
back, at the place where the probe falls on the way there."""


def _start(ctx: CaseContext) -> tuple[Outputs, float]:
    """Enable the axis; returns what samples outputs, and the position of the machine's zero, mm."""
    enable(ctx)
    place = float(ctx.trace()[f"{drive_name(ctx)}.position"].values[-1]) * 1000.0
    return Outputs(ctx), float(ctx.axis.var("ActualPosition")) - place


def _travel(ctx: CaseContext, target: float, velocity: float = 143.7) -> None:
    way = target - float(ctx.axis.var("Position"))
    move = ctx.axis.move_relative(way, Velocity=velocity)
    ctx.wait_until(move.done, 5.0, f"the axis is at {target:.4g} mm")


@MEASURING.product(
    "once/{which}/{mode}",
    parameters={"which": ("own", "central"), "mode": tuple(_MODES)},
    title="MC_MeasuringInput Mode {mode} at the {which} input",
    requirements=("CFG-200", "CFG-131"),
)
def once(ctx: CaseContext, which: str, mode: int) -> None:
    """The place of each edge is measured, whatever the cycle; then the job is done and measures no more."""
    outputs, zero = _start(ctx)
    job = outputs.watch(ctx.bench.measuring_input(which).measure(mode))
    _travel(ctx, zero + 60.0)
    _travel(ctx, zero)
    places = [job.instance.MeasuredValue1 - zero, job.instance.MeasuredValue2 - zero]
    for number, (place, wanted) in enumerate(zip(places, _MODES[mode], strict=False), 1):
        equal(ctx, f"MeasuredValue{number}", place, wanted, "CFG-200", within=0.02)
    equal(ctx, "Done", job.last.done, 1.0)
    measured = job.instance.MeasuredValue1
    _travel(ctx, zero + 60.0)
    equal(ctx, "MeasuredValue1 afterwards", job.instance.MeasuredValue1, measured)
    outputs.release()
    ctx.expect(no_alarm(axis=axis_name(ctx)))


@MEASURING.product(
    "range/{which}",
    parameters=[
        {"which": "inside", "first": 15.0, "last": 30.0, "found": True},
        {"which": "border", "first": 21.4, "last": 30.0, "found": False},
        {"which": "outside", "first": 22.0, "last": 33.0, "found": False},
    ],
    title="an edge {which} the measuring range",
)
def in_range(ctx: CaseContext, which: str, first: float, last: float, found: bool) -> None:
    """With a measuring range only edges in it count; left without an edge, the job ends with 16#8001."""
    del which
    outputs, zero = _start(ctx)
    one = ctx.bench.measuring_input("own")
    job = outputs.watch(
        one.measure(0, MeasuringRange=True, StartPosition=zero + first, EndPosition=zero + last)
    )
    _travel(ctx, zero + 55.0)
    equal(ctx, "Done", job.last.done, found)
    equal(ctx, "ErrorID", job.last.error_id, 0.0 if found else 0x8001)
    if found:
        equal(ctx, "MeasuredValue1", job.instance.MeasuredValue1 - zero, RISING, within=0.02)
    outputs.release()


@MEASURING.product(
    "cyclic/{mode}",
    parameters={"mode": (0, 1, 2)},
    title="MC_MeasuringInputCyclic Mode {mode}, three times over the probe",
    requirements=("OVR-003",),
)
def cyclic(ctx: CaseContext, mode: int) -> None:
    """Every edge is measured and counted until the job is aborted."""
    outputs, zero = _start(ctx)
    central = ctx.bench.measuring_input("central")
    job = outputs.watch(central.measure_cyclic(mode))
    for target in (60.0, 0.0, 60.0):
        _travel(ctx, zero + target)
    # Each way over the probe has one edge of either direction.
    shown = job.instance
    counted = shown.MeasuredValue1Counter + shown.MeasuredValue2Counter
    equal(ctx, "edges counted", counted, 6.0 if mode == 2 else 3.0)
    equal(ctx, "Busy", job.last.busy, 1.0)
    abort = outputs.watch(central.abort())
    outputs.calls(6)
    equal(ctx, "CommandAborted", job.last.aborted, 1.0)
    equal(ctx, "Done of MC_AbortMeasuringInput", abort.last.done, 1.0)
    outputs.release()


@MEASURING.case("refused", requirements=("MC-006", "OVR-003", "OVR-119", "SYN-284", "SYN-285"))
def refused(ctx: CaseContext) -> None:
    """A wrong mode is 16#800A; a homing ends a measuring job with 16#80A3, a set position does not."""
    outputs, _ = _start(ctx)
    own, central = ctx.bench.measuring_input("own"), ctx.bench.measuring_input("central")
    for mode in (5, -1):
        one = outputs.watch(own.measure(mode))
        outputs.calls(3)
        equal(ctx, f"Mode {mode}: ErrorID", one.last.error_id, 0x800A, "MC-007")
    one = outputs.watch(central.measure_cyclic(3))
    outputs.calls(3)
    equal(ctx, "cyclic Mode 3: ErrorID", one.last.error_id, 0x800A, "MC-007")
    outputs.release()
    job = outputs.watch(own.measure(0))
    outputs.calls(3)
    outputs.watch(ctx.axis.home(0.0))
    outputs.calls(4)
    equal(ctx, "Busy beside a set position", job.last.busy, 1.0, "SYN-285")
    outputs.watch(ctx.axis.home(0.0, mode=2))
    outputs.calls(4)
    equal(ctx, "ErrorID with a homing", job.last.error_id, 0x80A3, "MC-006", "SYN-284")
    ctx.axis.home(mode=9)
    outputs.release()


# -- torque data and free bits -------------------------------------------------------------------------------

REFERENCE_NM: Final = 2.0
TORQUE_BENCH: Final = load_bench("profidrive").configured(
    {
        "drive": {"drive1": {"telegram": 105, "profidrive": {"torque_telegram": True}}},
        "axis": {"axis1": {"variables": {"Actor.DriveParameter.ReferenceTorque": REFERENCE_NM}}},
    }
)
TORQUE: Final = Campaign("torque data", tags=("axis", "torque"), bench=f"{_HERE}:TORQUE_BENCH")
Make = Callable[[Any], Any]
_WRONG: Final[tuple[tuple[str, Make, int, str], ...]] = (
    ("additive above", lambda axis: axis.torque_additive(1.1e12), 0x804A, "MC-515"),
    ("additive below", lambda axis: axis.torque_additive(-1.1e12), 0x804A, "MC-515"),
    ("additive NaN", lambda axis: axis.torque_additive(math.nan), 0x804A, "MC-515"),
    ("upper above", lambda axis: axis.torque_range(1.1e12, 0.0), 0x804B, "MC-525"),
    ("lower below", lambda axis: axis.torque_range(1.0, -1.1e12), 0x804C, "MC-526"),
    ("upper equal to lower", lambda axis: axis.torque_range(1.0, 1.0), 0x804D, "MC-615"),
    ("upper below lower", lambda axis: axis.torque_range(-1.0, 1.0), 0x804D, "MC-615"),
    ("mode 2", lambda axis: axis.torque_limiting(1.0, mode=2), 0x800A, "MC-007"),
)


@TORQUE.case("values", requirements=("MC-515", "MC-525", "MC-526", "MC-615", "MC-085"))
def torque_values(ctx: CaseContext) -> None:
    """What is not permitted is refused with its own ErrorID until `Enable` falls; the border is taken."""
    enable(ctx)
    outputs = Outputs(ctx)
    for name, make, error_id, requirement in _WRONG:
        one = outputs.watch(make(ctx.axis))
        outputs.calls(4)
        equal(ctx, f"{name}: ErrorID", one.last.error_id, error_id, requirement)
        outputs.release()
    for make in (lambda axis: axis.torque_additive(0.0), lambda axis: axis.torque_range(1.0e12, -1.0e12)):
        one = outputs.watch(make(ctx.axis))
        outputs.calls(4)
        equal(ctx, f"{one.instance.name}: Busy at the border", one.last.busy, 1.0, "MC-082")
        outputs.release()


@TORQUE.product(
    "range/{sign}",
    parameters={"sign": (1, -1)},
    title="MC_TorqueRange, the motor pulls in direction {sign}",
    requirements=("MC-525", "MC-526", "MC-528", "MC-529", "MC-530"),
    without=("MON-016", "MON-040"),  # neither position nor following error is monitored meanwhile
)
def torque_range(ctx: CaseContext, sign: int) -> None:
    """The torque of the drive stays between both limits, each in its direction, and is free again after
    `Enable` has fallen.
    """
    enable(ctx)
    outputs, drive = Outputs(ctx), drive_name(ctx)
    high, low = 0.105 * REFERENCE_NM, -0.065 * REFERENCE_NM
    job = outputs.watch(ctx.axis.torque_range(high, low))
    outputs.calls(4)
    equal(ctx, "CommandTorqueRangeActive", ctx.axis.var("StatusTorqueData.CommandTorqueRangeActive"), 1.0)
    since = ctx.now_s
    ctx.axis.move_velocity(300.0 * sign, Acceleration=2000.0, Jerk=0.0)
    ctx.run_for(0.25)
    torque = ctx.trace()[f"{drive}.torque"]
    during = torque.values[torque.time_s > since]
    slack = 0.01 * REFERENCE_NM
    ctx.measure("greatest torque", float(during.max()), "Nm", high=high + slack, requirements=("MC-525",))
    ctx.measure("least torque", float(during.min()), "Nm", low=low - slack, requirements=("MC-526",))
    reached = float(during.max()) > high - slack if sign > 0 else float(during.min()) < low + slack
    equal(ctx, "the limit of the direction is reached", reached, 1.0, "MC-528")
    ctx.axis.halt(Deceleration=200.0, Jerk=0.0)
    ctx.run_for(2.5)  # what it is behind is made up with the torque that there is
    job.lower()
    outputs.calls(4)
    equal(ctx, "CommandTorqueRangeActive", ctx.axis.var("StatusTorqueData.CommandTorqueRangeActive"), 0.0)
    since = ctx.now_s
    ctx.axis.move_velocity(300.0 * sign, Acceleration=2000.0, Jerk=0.0)
    ctx.run_for(0.2)
    torque = ctx.trace()[f"{drive}.torque"]
    after = float((sign * torque.values[torque.time_s > since]).max())
    limit = high if sign > 0 else -low
    ctx.measure("torque without the range", after, "Nm", low=limit + slack, requirements=("MC-529",))
    outputs.release()


@TORQUE.case("additive", requirements=("MC-514", "MC-517", "MC-521", "MC-519"))
def torque_additive(ctx: CaseContext) -> None:
    """An additional torque acts at once, follows its input, and steps to zero when `Enable` falls."""
    enable(ctx)
    outputs = Outputs(ctx)
    job = outputs.watch(ctx.axis.torque_additive(0.3))
    for value in (0.3, -0.45):
        job.instance.set(Value=value)
        outputs.calls(3)
        equal(
            ctx, "TotalTorqueAdditive", ctx.axis.var("StatusTorqueData.TotalTorqueAdditive"), value, "MC-517"
        )
        moving = outputs.watch(ctx.axis.move_relative(5.0))
        ctx.run_for(0.3)
        equal(ctx, "a job runs beside it", moving.last.busy or moving.last.done, 1.0, "MC-519")
    job.lower()
    outputs.calls(3)
    equal(ctx, "TotalTorqueAdditive", ctx.axis.var("StatusTorqueData.TotalTorqueAdditive"), 0.0, "MC-521")
    outputs.release()


def _sent(ctx: CaseContext, column: str) -> float:
    """Return what the drive has got of a signal last, 4000h as 1."""
    word = int(ctx.trace()[f"{drive_name(ctx)}.{column}"].values[-1]) & 0xFFFF
    return (word - 0x10000 if word >= 0x8000 else word) / 0x4000


POUND_FOOT: Final = 0.45359237 * 9.80665 * 0.3048
"""lbf ft, Nm."""
IN_POUND_FEET: Final = TORQUE_BENCH.configured(
    {
        "axis": {
            "axis1": {
                "variables": {
                    "Units.TorqueUnit": 1530,
                    "Actor.DriveParameter.ReferenceTorque": REFERENCE_NM / POUND_FOOT,
                }
            }
        }
    }
)
OTHER_UNIT: Final = Campaign(
    "torque in another unit", tags=("axis", "torque"), bench=f"{_HERE}:IN_POUND_FEET"
)


@OTHER_UNIT.case("sent", requirements=("CFG-083", "MC-515", "MC-525", "MC-526"))
def torque_in_another_unit(ctx: CaseContext) -> None:
    """What the program gives in lbf ft reaches the drive as its share of the reference torque in Nm."""
    enable(ctx)
    outputs = Outputs(ctx)
    full = REFERENCE_NM / POUND_FOOT
    for share in (0.25, -0.125):
        job = outputs.watch(ctx.axis.torque_additive(share * full))
        outputs.calls(6)
        equal(ctx, f"M_ADD for {share:g}", _sent(ctx, "m_add"), share, "MC-515", within=1e-3)
        total = ctx.axis.var("StatusTorqueData.TotalTorqueAdditive")
        equal(ctx, "TotalTorqueAdditive, lbf ft", total, share * full, "CFG-083", within=1e-6)
        job.lower()
        outputs.calls(6)
        outputs.release()


@TORQUE.case("exclusive", requirements=("MC-533", "MC-616", "MC-414", "OVR-108", "OVR-109", "OVR-110"))
def torque_exclusive(ctx: CaseContext) -> None:
    """Range and limiting exclude each other; `MC_Stop` refuses all three; an alarm leaves them active."""
    enable(ctx)
    outputs, axis = Outputs(ctx), ctx.axis
    for first, second in (("range", "limiting"), ("limiting", "range")):
        makers: dict[str, Callable[[], Any]] = {
            "range": lambda: axis.torque_range(1.0, -1.0),
            "limiting": lambda: axis.torque_limiting(1.0),
        }
        one = outputs.watch(makers[first]())
        outputs.calls(3)
        two = outputs.watch(makers[second]())
        outputs.calls(3)
        equal(ctx, f"{first} goes on", one.last.busy, 1.0, "MC-533")
        equal(ctx, f"{second}: ErrorID", two.last.error_id, 0x804E, "MC-616")
        if first == "limiting":
            equal(ctx, "StatusWord.X26", axis.var("StatusWord.X26"), 1.0, "MC-113")
        outputs.release()
    equal(ctx, "StatusWord.X26", axis.var("StatusWord.X26"), 0.0, "MC-113")
    stop = outputs.watch(axis.stop(0))
    outputs.until(stop, "done", 2.0, "MC_Stop is done")
    for job in (axis.torque_range(1.0, -1.0), axis.torque_additive(1.0), axis.torque_limiting(1.0)):
        one = outputs.watch(job)
        outputs.calls(3)
        equal(ctx, f"{one.instance.name} with MC_Stop: ErrorID", one.last.error_id, 0x800F, "MC-414")
    outputs.release()
    additive = outputs.watch(axis.torque_additive(0.1))
    outputs.calls(3)
    ctx.inject("axis.alarm", axis_name(ctx), number=104)
    ctx.run_for(0.1)
    equal(ctx, "additional torque after an alarm", additive.last.busy, 1.0, "MC-124")
    outputs.release()


def _bits(ctx: CaseContext, job: Watched, outputs: Outputs) -> int:
    outputs.until(job, "done", 2.0, "the bits are written")
    ctx.run_for(cycles(ctx, 3))
    return int(ctx.trace()[f"{axis_name(ctx)}.stw1"].values[-1])


@TORQUE.case("control-words", requirements=("MC-442", "MC-443", "MC-444", "MC-619", "G2-032", "G2-033"))
def control_words(ctx: CaseContext) -> None:
    """Free bits of STW1 are set and kept, one instance after the other, until another one or a restart takes
    them back; a mask with a bit of the axis is 16#8055 and changes nothing.
    """
    enable(ctx)
    outputs, axis = Outputs(ctx), ctx.axis
    before = int(ctx.trace()[f"{axis_name(ctx)}.stw1"].values[-1])
    one = _bits(ctx, outputs.watch(axis.set_axis_stw(STW1=0x1000, STW1BitMask=0x1000)), outputs)
    equal(ctx, "STW1 with bit 12", one, before | 0x1000, "MC-442", "G2-043")
    two = _bits(ctx, outputs.watch(axis.set_axis_stw(STW1=0x0200, STW1BitMask=0x0200)), outputs)
    equal(ctx, "STW1 with bits 9 and 12", two, before | 0x1200, "MC-442")
    for name in ("STW1BitMask", "STW2BitMask"):
        for bit in range(16):
            permitted = (0xFB00 if name == "STW1BitMask" else 0x0FFF) >> bit & 1
            if permitted:
                continue
            wrong = outputs.watch(axis.set_axis_stw(**{name: 1 << bit}))
            outputs.calls(2)
            equal(ctx, f"{name} bit {bit}: ErrorID", wrong.last.error_id, 0x8055, "MC-443", "MC-619")
    kept = int(ctx.trace()[f"{axis_name(ctx)}.stw1"].values[-1])
    equal(ctx, "STW1 after wrong masks", kept, before | 0x1200, "MC-443")
    back = _bits(ctx, outputs.watch(axis.set_axis_stw(STW1=0x0000, STW1BitMask=0x1000)), outputs)
    equal(ctx, "STW1 with bit 9", back, before | 0x0200, "G2-044")
    outputs.release()
    axis.power(False)
    ctx.wait_until(lambda: not axis.power_instance.Busy, 5.0, "the axis is disabled")
    ctx.wait_until(axis.reset(restart=True).done, 5.0, "the axis is restarted")
    ctx.wait_until(axis.power().status, 5.0, "the axis is enabled")
    ctx.run_for(cycles(ctx, 3))
    equal(
        ctx, "STW1 after a restart", float(ctx.trace()[f"{axis_name(ctx)}.stw1"].values[-1]), before, "MC-444"
    )


# -- simulation ---------------------------------------------------------------------------------------------

SIMULATED_BENCH: Final = load_bench("reference").configured(
    {"axis": {"axis1": {"variables": {"Simulation.Mode": 1}}}}
)
SIMULATED: Final = Campaign("simulated axis", tags=("axis", "simulation"), bench=f"{_HERE}:SIMULATED_BENCH")


@SIMULATED.case("moves", requirements=("DIA-027", "MC-432", "CFG-161", "CFG-165", "CFG-166"))
def simulated_moves(ctx: CaseContext) -> None:
    """Jobs run and end without the drive: actual values are those of the setpoint, and the machine rests."""
    axis, outputs, name = ctx.axis, Outputs(ctx), axis_name(ctx)
    ctx.wait_until(axis.power().status, 5.0, "the axis is enabled")
    machine = float(ctx.trace()[f"{drive_name(ctx)}.position"].values[-1])
    ctx.wait_until(axis.home(0.0).done, 2.0, "the axis is homed")
    for target in (63.0, -17.5):
        job = outputs.watch(axis.move_absolute(target, Velocity=270.0))
        outputs.until(job, "done", 5.0, "the job is done")
        equal(ctx, "Position", axis.var("Position"), target, "MC-256", within=1e-6)
        equal(ctx, "ActualPosition", axis.var("ActualPosition"), target, "MC-261", within=0.1)
        outputs.release()
    travelling = outputs.watch(axis.move_velocity(210.0))
    outputs.until(travelling, "success", 3.0, "the velocity is reached")
    ctx.run_for(0.3)
    equal(ctx, "ActualVelocity", axis.var("ActualVelocity"), 210.0, "DIA-097", within=2.0)
    own_s = 2.0 * ctx.bench.cycle_ns * 1e-9 + float(axis.var("DynamicAxisModel.VelocityTimeConstant"))
    behind = float(axis.var("Position")) - float(axis.var("ActualPosition"))
    equal(
        ctx, "actual position behind the setpoint", behind, 210.0 * own_s, "CFG-161", "CFG-166", within=0.02
    )
    equal(ctx, "StatusWord.X25", axis.var("StatusWord.X25"), 1.0, "DIA-027")
    stop = outputs.watch(axis.stop(0))
    outputs.until(stop, "done", 3.0, "the axis stands")
    refused = outputs.watch(axis.set_axis_stw(STW1=0x0100, STW1BitMask=0x0100))
    outputs.calls(4)
    equal(ctx, "MC_SetAxisSTW: Error", refused.last.error, 1.0, "MC-432")
    outputs.release()
    axis.power(False, stop_mode=1)
    ctx.wait_until(lambda: not axis.power_instance.Busy, 5.0, "the axis is disabled")
    moved = float(np.abs(ctx.trace()[f"{drive_name(ctx)}.position"].values - machine).max())
    ctx.measure("way of the machine", moved, "m", high=1e-6, requirements=("DIA-027",))
    ctx.expect(no_alarm(axis=name))


@SIMULATED.case("alarms", requirements=("MC-117", "MC-118", "MC-119", "MC-120"))
def simulated_alarms(ctx: CaseContext) -> None:
    """Alarms stop and disable a simulated axis as a real one."""
    axis, outputs = ctx.axis, Outputs(ctx)
    for number, reaction in ((533, 1), (307, 2), (321, 3), (421, 4)):
        ctx.wait_until(axis.power().status, 5.0, "the axis is enabled")
        job = outputs.watch(axis.move_velocity(180.0))
        outputs.until(job, "success", 3.0, "the velocity is reached")
        ctx.inject("axis.alarm", axis_name(ctx), number=number, reaction=reaction)
        outputs.calls(4)
        equal(ctx, f"reaction {reaction}: ErrorID", job.last.error_id, 0x8001, "MC-117")
        ctx.run_for(1.5)
        equal(ctx, f"reaction {reaction}: velocity", axis.var("Velocity"), 0.0, "MC-118", within=1e-9)
        outputs.release()
        ctx.wait_until(axis.reset().done, 5.0, "the alarm is acknowledged")
