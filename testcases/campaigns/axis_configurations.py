"""Axes that no other campaign has: virtual ones, simulated ones with filters, torque precontrol, linear
motors; and configurations that contradict themselves.
"""

from __future__ import annotations

from math import exp, tau
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from hil.bench import BenchFile, load_bench
from hil.campaign import Campaign, CaseContext
from testcases.campaigns._reactions import cycles
from testcases.campaigns.support import axis_name, column, equal, later, restart, same_column

_HERE: Final = "testcases.campaigns.axis_configurations"
_REFERENCE: Final = load_bench("reference")
_CYCLE_S: Final = 0.004
Numbers = NDArray[np.float64]


def _axis(values: dict[str, Any]) -> dict[str, Any]:
    """Return the table of an axis with the dynamics of the reference axis, and more variables."""
    own = {
        "Mechanics.LeadScrew": 10.0, "DynamicLimits.MaxVelocity": 500.0, "DynamicLimits.Velocity": 500.0,
        "DynamicLimits.MaxAcceleration": 2000.0, "DynamicLimits.MaxDeceleration": 2000.0,
        "DynamicLimits.MaxJerk": 20000.0, "DynamicDefaults.Velocity": 100.0,
        "DynamicDefaults.Acceleration": 1000.0, "DynamicDefaults.Deceleration": 900.0,
        "DynamicDefaults.Jerk": 10000.0, "DynamicDefaults.EmergencyDeceleration": 4000.0,
        "PositioningMonitoring.Window": 0.1, "PositioningMonitoring.MinDwellTime": 0.01,
        "Sensor[1].Parameter.StepsPerRevolution": 4096, "Sensor[1].Parameter.FineResolutionXist1": 0,
    }  # fmt: skip
    return {"type": "positioning", "variables": own | values}


_VIRTUAL: Final[dict[str, Any]] = {"VirtualAxis.Mode": 1}
_SIMULATED: Final[dict[str, Any]] = {"Simulation.Mode": 1, "PositionControl.Kv": 20.0}
_FILTER: Final = "SetpointFilter.DynamicFilter"
_AXES: Final[dict[str, dict[str, Any]]] = {
    "plain": _VIRTUAL,
    "averaged": _VIRTUAL | {f"{_FILTER}.Mode": 2, f"{_FILTER}.T1": 0.013, f"{_FILTER}.Tt": 0.006},
    "lagging": _VIRTUAL | {f"{_FILTER}.Mode": 1, f"{_FILTER}.T1": 0.010, f"{_FILTER}.T2": 0.024},
    "absolute": _VIRTUAL | {"Sensor[1].Type": 1, "StatusSensor[1].AbsEncoderOffset": 3.5},
    "inches": _VIRTUAL | {"Units.LengthUnit": 1019, "Units.VelocityUnit": 1066, "Mechanics.LeadScrew": 0.4},
    "delayed": _SIMULATED | {f"{_FILTER}.Mode": 2, f"{_FILTER}.T1": 0.016, f"{_FILTER}.T2": 0.008},
    "uncontrolled": _SIMULATED,
}


def _bench(name: str, axes: dict[str, dict[str, Any]]) -> BenchFile:
    """Return a bench of virtual axes, and of simulated ones, whose drives are not used."""
    text = f'[bench]\nname = "{name}"\nkind = "virtual"\ncycle_ms = 4\n[segment.can0]\nbitrate = 1_000_000\n'
    tables = {one: _axis(values) for one, values in axes.items()}
    for number, (one, values) in enumerate(axes.items(), 2):
        if "VirtualAxis.Mode" not in values:
            text += (
                f'[drive.of_{one}]\nsegment = "can0"\nnode_id = {number}\nincrements_per_revolution = 4096\n'
            )
            tables[one]["drive"] = f"of_{one}"
    return BenchFile(name, text).configured({"axis": tables})


AXES: Final = _bench("axes without drives", _AXES)
OF_AXES: Final = Campaign("virtual axes", tags=("axis",), bench=f"{_HERE}:AXES")


def _enabled(ctx: CaseContext, name: str, **inputs: Any) -> Any:
    one = ctx.bench.axis(name)
    ctx.wait_until(one.power(**inputs).status, 1.0, f"{name} is enabled")
    return one


def _averaged(values: Numbers, time_s: float) -> Numbers:
    """Return a moving average over a time (CTL-075)."""
    whole, rest = divmod(time_s / _CYCLE_S + 1e-9, 1.0)
    rest = rest if rest > 1e-6 else 0.0
    total = sum(later(values, at) for at in range(int(whole) + 1)) + rest * later(values, int(whole) + 1)
    return np.asarray(total / (whole + 1.0 + rest))


def _dead(values: Numbers, time_s: float) -> Numbers:
    whole, rest = divmod(time_s / _CYCLE_S, 1.0)
    first, second = later(values, int(whole)), later(values, int(whole) + 1)
    return first + (second - first) * rest


def _lagging(values: Numbers, time_s: float) -> Numbers:
    """Return values behind a filter of the first order, exact for ramps (CTL-073)."""
    found, last, before = [], float(values[0]), float(values[0])
    for value in values:
        step = float(value) - before
        before = float(value)
        target = before - step / _CYCLE_S * time_s
        last = target + (last + step - target) * exp(-_CYCLE_S / time_s)
        found.append(last)
    return np.array(found)


def _move(ctx: CaseContext, axes: list[Any]) -> None:
    """Let axes go to and fro, with a job that supersedes another one, and with new coordinates on the way."""
    inputs = {"Velocity": 130.0, "Acceleration": 1700.0, "Deceleration": 1300.0, "Jerk": 0.0}
    for one in axes:
        one.move_relative(21.0, **inputs)
    ctx.run_for(0.1)
    jobs = [one.move_relative(-9.0, **inputs | {"Velocity": 70.0}) for one in axes]
    ctx.wait_until(lambda: all(job.Done for job in jobs), 3.0, "all axes are there")
    ctx.run_for(0.1)


@OF_AXES.case("follow", requirements=("CFG-138", "CFG-151", "CFG-152", "CTL-060", "CTL-073", "CTL-075"))
def follow(ctx: CaseContext) -> None:
    """Actual values of a virtual axis are its setpoints of two cycles before, behind its dynamic filter where
    it has one, whatever its unit is; a homing moves both by the same.
    """
    names = ("plain", "averaged", "lagging", "inches")
    axes = [_enabled(ctx, name) for name in names]
    ctx.run_for(0.02)
    accelerations: list[tuple[float, float]] = []
    plain = axes[0]
    end = ctx.bench.on_cycle(
        lambda: accelerations.append(
            (float(plain.var("Acceleration")), float(plain.var("ActualAcceleration")))
        )
    )
    _move(ctx, axes)
    end()
    filters = {
        "plain": lambda values: values,
        "averaged": lambda values: _dead(_averaged(values, 0.013), 0.006),
        "lagging": lambda values: _lagging(_lagging(values, 0.010), 0.024),
        "inches": lambda values: values,
    }
    for name in names:
        for what in ("position", "velocity"):
            wanted = filters[name](column(ctx, f"{name}.{what}_setpoint"))
            found = column(ctx, f"{name}.actual_{what}")
            same_column(
                ctx, f"actual {what} of {name}", found[2:], later(wanted, 2)[2:], "CFG-152", "CTL-075",
                ranges=100.0,
            )  # fmt: skip
    given, shown = (np.array(one) for one in zip(*accelerations, strict=True))
    same_column(ctx, "ActualAcceleration", shown[3:], later(given, 2)[3:], "CFG-142", ranges=100.0)
    for one, name in zip(axes, names, strict=True):
        one.move_velocity(40.0)
        ctx.run_for(0.6)
        before = float(one.var("ActualPosition")) - float(one.var("Position"))
        place = float(one.var("ActualPosition"))
        ctx.wait_until(one.home(1000.0).done, 0.1, f"{name} is homed")
        ctx.run_for(cycles(ctx, 2))
        lag = float(one.var("ActualPosition")) - float(one.var("Position"))
        equal(ctx, f"lag of {name} after the homing", lag, before, "CFG-152", within=1e-6)
        moved = float(one.var("ActualPosition")) - 1000.0
        ctx.measure(f"position of {name} after the homing", moved, low=0.0, high=40.0 * 0.03)
        equal(ctx, f"X5 of {name}", one.var("StatusWord.X5"), 1.0)
        one.halt()
        del place


@OF_AXES.case("absolute", requirements=("CFG-153", "CFG-154", "CFG-155"))
def absolute(ctx: CaseContext) -> None:
    """A virtual axis with an absolute encoder begins at 240 increments and its offset, and is where it was
    after a restart; with an incremental one it begins at 0 each time.
    """
    ctx.run_for(0.02)
    begins = 240.0 / 4096.0 * 10.0 + 3.5
    equal(ctx, "position at the start", ctx.bench.axis("absolute").var("ActualPosition"), begins, "CFG-154")
    equal(ctx, "incremental at the start", ctx.bench.axis("plain").var("ActualPosition"), 0.0, "CFG-155")
    for name, kept in (("absolute", True), ("plain", False)):
        one = _enabled(ctx, name)
        ctx.wait_until(one.move_relative(12.5).done, 2.0, "moved")
        ctx.run_for(0.05)
        one.power(False)
        ctx.run_for(0.05)
        before = float(one.var("ActualPosition"))
        ctx.wait_until(one.reset(restart=True).done, 2.0, "restarted")
        ctx.run_for(0.02)
        wanted = before if kept else 0.0
        equal(ctx, f"{name} after a restart", one.var("ActualPosition"), wanted, "CFG-155", within=1e-9)
        moved = _enabled(ctx, name).move_relative(-2.0)
        ctx.wait_until(moved.done, 2.0, "it moves on from there")
        ctx.run_for(0.05)
        equal(ctx, f"{name} at its end", one.var("ActualPosition"), wanted - 2.0, within=1e-6)
    one = ctx.bench.axis("absolute")
    ctx.wait_until(one.home(77.0, mode=7).done, 1.0, "the encoder is adjusted")
    offset = float(one.var("StatusSensor[1].AbsEncoderOffset"))
    equal(ctx, "position after the adjustment", one.var("ActualPosition"), 77.0, within=1e-6)
    equal(ctx, "offset", offset, 3.5 + 77.0 - (begins + 12.5 - 2.0), within=1e-6)


@OF_AXES.case("delayed", requirements=("CFG-161", "CFG-166", "CTL-060", "CTL-077"))
def delayed(ctx: CaseContext) -> None:
    """A simulated axis is behind its setpoint by half of both averages, the loop and a cycle; its coordinates
    may change on the way without a step of the lag.
    """
    one = _enabled(ctx, "delayed")
    constant = float(one.variables.read("DynamicAxisModel.VelocityTimeConstant"))
    precontrolled = float(one.variables.read("PositionControl.Kpc")) > 0.0
    behind_s = 0.5 * (0.016 + 0.008) + (2.0 * _CYCLE_S + constant if precontrolled else _CYCLE_S + 1.0 / 20.0)
    job = one.move_velocity(110.0, Acceleration=1500.0, Jerk=0.0)
    ctx.wait_until(job.in_velocity, 2.0, "constant")
    ctx.run_for(0.4)
    for place in (None, 500.0):
        if place is not None:
            ctx.wait_until(one.home(place).done, 0.2, "homed on the way")
            ctx.run_for(cycles(ctx, 1))
        lag = float(one.var("Position")) - float(one.var("ActualPosition"))
        equal(ctx, "lag", lag, 110.0 * behind_s, "CFG-166", "CTL-077", within=110.0 * _CYCLE_S * 1.01)
    first = column(ctx, "delayed.position_setpoint") - column(ctx, "delayed.actual_position")
    ctx.measure("change of the lag with new coordinates", float(np.ptp(first[-8:])), high=1e-3)


@OF_AXES.case("speed", requirements=("CFG-161", "CFG-164", "MC-128"))
def speed(ctx: CaseContext) -> None:
    """A simulated axis that is not position-controlled moves by its speed setpoint, and shows it."""
    one = _enabled(ctx, "uncontrolled", start_mode=0)
    job = one.move_velocity(-60.0, PositionControlled=False, Acceleration=1000.0, Jerk=0.0)
    ctx.wait_until(job.in_velocity, 2.0, "constant")
    ctx.run_for(0.1)
    equal(ctx, "X28", one.var("StatusWord.X28"), 1.0)
    begun, at = float(one.var("ActualPosition")), ctx.now_s
    ctx.run_for(0.2)
    equal(
        ctx, "way", float(one.var("ActualPosition")) - begun, -60.0 * (ctx.now_s - at), "CFG-161", within=0.3
    )
    equal(ctx, "ActualVelocity", one.var("ActualVelocity"), -60.0, within=0.5)
    equal(ctx, "ActualSpeed", one.var("ActualSpeed"), -60.0 / 10.0 * 60.0, within=3.0)
    one.halt()
    ctx.run_for(0.2)
    at_rest = float(one.var("ActualPosition"))
    ctx.run_for(0.1)
    equal(ctx, "it stands", one.var("ActualPosition"), at_rest, within=1e-9)


# -- torque precontrol ---------------------------------------------------------------------------------------

_PROFIDRIVE: Final = load_bench("profidrive")
_INERTIA: Final = {
    "Actor.DriveParameter.MotorInertia": 3e-4, "Actor.LoadInertia": 25.0, "TorquePreControl.Mode": 1,
    "TorquePreControl.Scale": 80.0, "Actor.DriveParameter.ReferenceTorque": 40.0,
    "DynamicAxisModel.CurrentTimeConstant": 0.006,
}  # fmt: skip
PRECONTROL: Final[BenchFile] = _PROFIDRIVE.configured(
    {
        "drive": {"drive1": {"telegram": 105, "profidrive": {"torque_telegram": True}}},
        "axis": {"axis1": {"variables": _INERTIA}},
    }
)
OF_PRECONTROL: Final = Campaign("torque precontrol", tags=("axis", "torque"), bench=f"{_HERE}:PRECONTROL")


@OF_PRECONTROL.case("torque", requirements=("CTL-050", "CTL-051", "CTL-052", "CTL-055", "CTL-056", "CTL-059"))
def precontrol(ctx: CaseContext) -> None:
    """The additional torque is that of the inertias at the acceleration of the setpoint, in its share, beside
    that of MC_TorqueAdditive; switched off, or without position control, none is added.
    """
    one = ctx.axis
    ctx.wait_until(one.power().status, 3.0, "the axis is enabled")
    lead = float(one.variables.read("Mechanics.LeadScrew"))
    alpha = tau / lead
    # A rotary bench would have degrees; this one has a screw: mass and lead give the inertia at the motor.
    inertia = 3e-4 + 25.0 * (lead * 1e-3 / tau) ** 2
    rows: list[tuple[float, float]] = []

    def look() -> None:
        shown = float(one.var("StatusTorqueData.TotalTorqueAdditive"))
        rows.append((float(one.var("Acceleration")), shown))

    def travels(scale: float, *, added: float = 0.0, **inputs: Any) -> None:
        rows.clear()
        end = ctx.bench.on_cycle(look)
        job = one.move_velocity(120.0, Acceleration=900.0, Jerk=9000.0, **inputs)
        ctx.wait_until(job.in_velocity, 3.0, "constant")
        job = one.move_velocity(-50.0, Acceleration=1100.0, Deceleration=700.0, Jerk=9000.0, **inputs)
        ctx.wait_until(job.in_velocity, 3.0, "constant in the other direction")
        end()
        acceleration, torque = (np.array(column) for column in zip(*rows, strict=True))
        wanted = 0.01 * scale * inertia * alpha * acceleration + added
        off = float(np.abs(torque[2:] - wanted[2:]).max())
        step = float(np.abs(np.diff(wanted)).max()) if scale else 0.0
        ctx.measure(
            f"torque with {scale:g} %, off its formula",
            off,
            "Nm",
            high=1e-9 + step,
            requirements=("CTL-051",),
        )
        ctx.measure("range of the torque", float(np.ptp(torque)), low=0.9 * float(np.ptp(wanted)))

    travels(80.0)
    one.write("TorquePreControl.Scale", 150.0)
    travels(150.0)
    job = one.torque_additive(0.25)
    ctx.run_for(cycles(ctx, 2))
    travels(150.0, added=0.25)
    job.set(Enable=False)
    one.write("TorquePreControl.Scale", 0.0)
    ctx.run_for(cycles(ctx, 3))
    travels(0.0)
    one.write("TorquePreControl.Scale", 100.0)
    travels(0.0, PositionControlled=False)


@OF_PRECONTROL.case("behind", requirements=("CTL-017", "CTL-055"))
def behind(ctx: CaseContext) -> None:
    """With precontrol of the torque position and velocity wait for the current loop, without it not."""
    one, name = ctx.axis, axis_name(ctx)
    lags = []
    for mode in (1, 0):
        restart(ctx, {"TorquePreControl.Mode": mode})
        ctx.wait_until(one.power().status, 3.0, "the axis is enabled")
        job = one.move_velocity(100.0)
        ctx.wait_until(job.in_velocity, 3.0, "constant")
        ctx.run_for(0.4)
        setpoint, actual = (
            column(ctx, f"{name}.{kind}") for kind in ("position_setpoint", "actual_position")
        )
        lags.append(float((setpoint - actual)[-40:].mean()))
        ctx.wait_until(one.halt().done, 3.0, "it stands")
        one.power(False)
        ctx.run_for(0.3)
    equal(ctx, "lag by the current loop", lags[0] - lags[1], 100.0 * 0.006, "CTL-055", within=0.02)


# -- what does not fit together ------------------------------------------------------------------------------

OF_WRONG: Final = Campaign("contradictions", tags=("axis", "variables"), bench="reference")
_WRONG: Final[tuple[tuple[dict[str, Any], str, dict[str, Any], str], ...]] = (
    ({"Sensor[1].System": 0}, "Sensor[1].MountingMode", {}, "CFG-513"),
    (
        {"Actor.MotorType": 1, "Sensor[1].MountingMode": 1}, "Sensor[1].MountingMode",
        {"Sensor[1].MountingMode": 2}, "CFG-523",
    ),
    (
        {"Actor.MotorType": 1, "Sensor[1].System": 0, "Sensor[1].MountingMode": 2}, "Sensor[1].MountingMode",
        {"Sensor[1].MountingMode": 0}, "CFG-523",
    ),
    ({"Sensor[1].Backlash.Enable": True, "Sensor[1].MountingMode": 1}, "Sensor[1].Backlash.Enable",
     {"Sensor[1].MountingMode": 0}, "CFG-522"),
    ({"PositionControl.EnableDSC": True}, "PositionControl.EnableDSC", {}, "CFG-221"),
    ({"PositionControl.InitialOperativeSensor": 2}, "PositionControl.InitialOperativeSensor", {}, "CFG-316"),
    ({"PositionControl.Kv": 0.0}, "PositionControl.Kv", {"PositionControl.Kv": 1e-3}, "VAR-178"),
    ({"Actor.DriveParameter.ReferenceSpeed": 0.0}, "Actor.DriveParameter.ReferenceSpeed",
     {"Actor.DriveParameter.ReferenceSpeed": 1500.0}, "VAR-130"),
    (
        {"Sensor[1].Parameter.StepsPerRevolution": 8388608, "Sensor[1].Parameter.FineResolutionXist1": 10},
        "Sensor[1].Parameter.FineResolutionXist1", {"Sensor[1].Parameter.FineResolutionXist1": 9}, "CFG-618",
    ),
    (
        {"Clamping.PositionTolerance": 5.0, "Clamping.FollowingErrorDeviation": 5.0},
        "Clamping.PositionTolerance", {"Clamping.PositionTolerance": 4.999}, "STP-164",
    ),
)  # fmt: skip
"""Start values that contradict each other, the variable that is named, and what makes them fit."""


@OF_WRONG.case("refused", requirements=("CFG-618", "VAR-018"))
def wrong(ctx: CaseContext) -> None:
    """What contradicts itself ends a restart with alarm 101, which names the variable, and changes nothing;
    what just fits is taken.
    """
    axis, name = ctx.axis, axis_name(ctx)
    ctx.run_for(0.02)
    for start, path, fitting, requirement in _WRONG:
        own = {one: axis.variables.read(one) for one in {*start, *fitting}}
        for one, value in start.items():
            axis.variables.write_start(one, value)
        since = ctx.now_s
        reset = axis.reset(restart=True)
        ctx.run_for(0.04)
        what = ", ".join(f"{one} = {value}" for one, value in start.items())
        equal(ctx, f"{what}: alarm", axis.var("ErrorDetail.Number"), 101.0, requirement)
        equal(ctx, f"{what}: Done", reset.Done, 0.0, requirement)
        raised = [
            one for one in ctx.trace().select(source=name, kind="alarm.raised") if one.time_ns * 1e-9 > since
        ]
        named = float(any(path in str(one.data.get("text")) for one in raised))
        equal(ctx, f"{what}: {path} is named", named, 1.0, requirement)
        kept = float(all(axis.variables.read(one) == value for one, value in own.items()))
        equal(ctx, f"{what}: values in force", kept, 1.0, "VAR-018")
        if fitting:
            for one, value in fitting.items():
                axis.variables.write_start(one, value)
            reset = axis.reset(restart=True)
            ctx.run_for(0.04)
            shown = axis.var("ErrorDetail.Number")
            equal(ctx, f"{what} with {fitting}: alarm", shown == 101.0, 0.0, requirement)
        for one, value in own.items():
            axis.variables.write_start(one, value)
        ctx.wait_until(axis.reset(restart=True).done, 1.0, "a restart with the former values")


@OF_WRONG.case("limited", requirements=("CFG-622", "CFG-629", "VAR-131", "STP-126"))
def limited(ctx: CaseContext) -> None:
    """A greatest speed beyond twice the reference works as twice, with warning 110 and no reaction; values
    that hardly can be meant are doubted in words.
    """
    axis, name = ctx.axis, axis_name(ctx)
    reference = float(axis.variables.read("Actor.DriveParameter.ReferenceSpeed"))
    for share, warned in ((2.0, 0.0), (2.001, 1.0)):
        restart(ctx, {"Actor.DriveParameter.MaxSpeed": share * reference})
        ctx.run_for(cycles(ctx, 2))
        equal(ctx, f"X1 with {share} times the reference", axis.var("WarningWord.X1"), warned, "CFG-622")
        equal(ctx, "ErrorWord", axis.var("ErrorWord"), 0.0, "CFG-629")
    for share, doubted in ((1.0, 0), (0.9, 1)):
        limit = float(axis.variables.read("DynamicLimits.MaxDeceleration"))
        before = len(list(ctx.trace().select(source=name, kind="axis.doubt")))
        restart(ctx, {"DynamicDefaults.EmergencyDeceleration": share * limit})
        said = list(ctx.trace().select(source=name, kind="axis.doubt"))[before:]
        text = " ".join(str(one.data["text"]) for one in said)
        words = "DynamicDefaults.EmergencyDeceleration"
        equal(ctx, f"{share} of the limit is doubted", words in text, doubted, "STP-126")


OF_BLOCK: Final = Campaign(
    "times of a data block", tags=("axis", "variables"), bench="testcases.campaigns.controller_data:BLOCK"
)


@OF_BLOCK.case("written", requirements=("CFG-269", "CFG-272", "VAR-011", "VAR-012"))
def times(ctx: CaseContext) -> None:
    """T_i, T_o and T_DC can be written where the telegram goes through a data block; each acts from the next
    restart on, and one of more than 0.1 s is doubted in words.
    """
    axis, name = ctx.axis, axis_name(ctx)
    ctx.run_for(0.02)
    own = {number: axis.object.variables.parameter(number).cell.value for number in (1010, 1011, 1012)}
    for number in (1010, 1011, 1012):
        for time_s, doubted in ((0.1, 0), (0.101, 1)):
            written = axis.write_parameter(number, time_s)
            ctx.wait_until(written.done, 0.2, "the time is written")
            now = axis.object.variables.parameter(number).cell.value
            equal(ctx, f"{number} before the restart", now, own[number], "VAR-011")
            before = len(list(ctx.trace().select(source=name, kind="axis.doubt")))
            restart(ctx, {})
            own[number] = axis.object.variables.parameter(number).cell.value
            equal(ctx, f"{number} after the restart", own[number], time_s, "VAR-011")
            said = list(ctx.trace().select(source=name, kind="axis.doubt"))[before:]
            text = " ".join(str(one.data["text"]) for one in said)
            equal(ctx, f"{number} = {time_s} s is doubted", str(number) in text, doubted, "CFG-269")
        restart(ctx, {})
        kept = axis.object.variables.parameter(number).cell.value
        equal(ctx, f"{number} after another restart", kept, 0.101, "VAR-012")
        ctx.wait_until(axis.write_parameter(number, 0.0).done, 0.2, "the time is taken back")
        restart(ctx, {})
        own[number] = 0.0
    for wrong, value, code in (
        (1010, True, 0x805C), (1010, -1e-9, 0x805C), (1013, 1.0, 0x805A), (1020.5, 1.0, 0x805A),
        (1000, 1, 0x805C), (1020, 77, 0x8FFF),
    ):  # fmt: skip
        refused = axis.write_parameter(wrong, value)
        ctx.run_for(cycles(ctx, 2))
        equal(ctx, f"parameter {wrong} = {value}: ErrorID", refused.ErrorID, code, "MC-007")


@OF_WRONG.case(
    "built",
    requirements=(
        "CFG-012",
        "CFG-068",
        "CFG-069",
        "CFG-080",
        "CFG-090",
        "CFG-091",
        "CFG-175",
        "CFG-178",
        "CFG-285",
        "CFG-299",
        "SYN-071",
        "VAR-009",
    ),
)
def built(ctx: CaseContext) -> None:
    """A bench whose axis contradicts itself is not built, and says which variable it is; one that just fits
    is.
    """
    rotary, fine = {"Properties.MotionType": 1}, {"Units.LengthUnit": 1536}
    output = "CrossPlcSynchronousOperation.Interface[{}].EnableLeadingValueOutput"
    for variables, bench, path in (
        (rotary | {"Actor.MotorType": 1, "Sensor[1].MountingMode": 2}, {}, "Actor.MotorType"),
        (rotary | {"Sensor[1].System": 0, "Sensor[1].MountingMode": 1}, {}, "Sensor[1].System"),
        (rotary | {"Units.LengthUnit": 1013, "Units.VelocityUnit": 1062}, {}, "Units.LengthUnit"),
        ({"Units.LengthUnit": 1005, "Units.VelocityUnit": 1521}, {}, "Units.LengthUnit"),
        ({"Units.VelocityUnit": 1521}, {}, "Units.VelocityUnit"),
        (fine | {"DynamicLimits.MaxVelocity": 1.000001e9}, {}, "DynamicLimits.MaxVelocity"),
        (fine | {"PositionLimits_SW.MaxPosition": 1.000001e9}, {}, "PositionLimits_SW.MaxPosition"),
        ({"Sensor[1].Type": 2}, {}, "Sensor[1].Parameter.DeterminableRevolutions"),
        ({"Sensor[1].Interface.Number": 2}, {}, "Sensor[1].Interface.Number"),
        ({"Sensor[2].Existent": True}, {}, "Sensor[2].Existent"),
        ({"Sensor[1].Existent": False}, {}, "Sensor[1].Existent"),
        ({"Actor.Type": 0}, {}, "Actor.Type"),
        ({"StatusWord": 1}, {}, "StatusWord"),
        ({"ActualPosition": 5.0}, {}, "ActualPosition"),
        ({output.format(9): True}, {"bench": {"cpu": "S7-1500T V8"}}, output.format(9)),
        ({"Simulation.Mode": 1, "PositionControl.InitialOperativeSensor": 2}, {}, "InitialOperativeSensor"),
        ({"PositionControl.Kv": 0.0, "Sensor[1].System": 0}, {}, "Sensor[1].MountingMode"),
    ):  # fmt: skip
        changed = {"axis": {"axis1": {"variables": variables}}, **bench}
        said = ""
        try:
            _REFERENCE.configured(changed).build(seed=1).close()
        except Exception as error:  # noqa: BLE001 - whatever refuses it, the story says what it was
            said = str(error)
        ctx.do(f"{variables}: {said[:200]}")
        equal(ctx, f"{variables}: {path} is named", path in said, 1.0)
    fits = _REFERENCE.configured(
        {"axis": {"axis1": {"variables": {output.format(8): True}}}, "bench": {"cpu": "S7-1500T V8"}}
    )
    with fits.build(seed=1) as bench:
        equal(ctx, "eight outputs of a leading value", len(bench.axis_names), 1.0, "SYN-071")


# -- linear motors -------------------------------------------------------------------------------------------

_LINEAR: Final = {
    "Actor.MotorType": 1, "Sensor[1].System": 0, "Sensor[1].Parameter.Resolution": 0.002,
    "Sensor[1].MountingMode": 0, "Actor.LinearMotorDriveParameter.ReferenceVelocity": 60.0,
    "Actor.LinearMotorDriveParameter.MaxVelocity": 60.0,
    "Actor.LinearMotorDriveParameter.ReferenceForce": 200.0,
}  # fmt: skip
LINEAR: Final = _bench("linear motors", {"carriage": _SIMULATED | _LINEAR, "led": _VIRTUAL | _LINEAR})
OF_LINEAR: Final = Campaign("linear motors", tags=("axis",), bench=f"{_HERE}:LINEAR")


@OF_LINEAR.case("travels", requirements=("CFG-027", "CFG-523", "DIA-098"))
def linear(ctx: CaseContext) -> None:
    """An axis with a linear motor moves as any other; its speed is that of the motor in m/min."""
    for name in ("carriage", "led"):
        one = _enabled(ctx, name)
        job = one.move_velocity(150.0, Acceleration=1500.0, Jerk=0.0)
        ctx.wait_until(job.in_velocity, 2.0, "constant")
        ctx.run_for(0.3)
        equal(ctx, f"ActualVelocity of {name}", one.var("ActualVelocity"), 150.0, within=0.1)
        if name == "carriage":
            equal(ctx, "speed of the motor, m/min", one.object.speed_output_rpm, 9.0, "CFG-027", within=0.05)
        ctx.wait_until(one.halt().done, 2.0, "it stands")
        begun = float(one.var("ActualPosition"))
        ctx.wait_until(one.move_relative(-30.0).done, 3.0, "it has moved")
        ctx.run_for(0.3)
        equal(ctx, f"way of {name}", float(one.var("ActualPosition")) - begun, -30.0, within=0.01)
