"""Cases of `commissioning`: what an operator does at the panel, what is refused to him, and what he leaves
behind.
"""

from __future__ import annotations

from typing import Any, Final

from hil.campaign import Campaign, CaseContext
from hil.expect import (
    event_order,
    happens,
    job_output,
    never_happens,
    no_alarm,
    state_at,
    status_word_bit,
    value_at,
)
from hil.record import event
from motion.s7.commissioning import Optimisation, TestStep
from testcases.campaigns._commissioning import JOG, Operator, at_rest, greatest_deceleration
from testcases.campaigns._homing import configure, machine
from testcases.campaigns.support import axis_name, enable, settle_s

CASES: Final = Campaign("commissioning", tags=("panel",), bench="reference")


@CASES.product(
    "session/{direction}",
    parameters={"direction": ("forward", "backward")},
    title="a session at the panel, {direction}",
    requirements=(
        "COM-009",
        "COM-010",
        "COM-011",
        "COM-023",
        "COM-036",
        "COM-037",
        "COM-043",
        "COM-048",
        "COM-049",
        "COM-050",
        "COM-070",
    ),
)
def session(ctx: CaseContext, direction: str) -> None:
    """Take over, enable, jog, release the slider, move, set the position, move to a place, disable, hand
    back.
    """
    sign = 1.0 if direction == "forward" else -1.0
    operator = Operator(ctx).take()
    panel, axis, name = operator.panel, ctx.axis, axis_name(ctx)
    since = ctx.now_s
    start = float(axis.var("ActualPosition"))
    ctx.expect(operator.has_control(at=since), status_word_bit(6, False, at=since, axis=name))
    operator.jog(sign * 100.0)
    ctx.measure(
        "way of the jog",
        sign * (axis.var("ActualPosition") - start),
        "mm",
        low=1.0,
        requirements=("COM-010",),
    )
    ctx.do("the slider is released")
    panel.slide(0.0)
    ctx.run_for(0.4 + settle_s(ctx))
    ctx.expect(at_rest(ctx))
    place = float(axis.var("ActualPosition"))
    move = panel.move_relative(25.0, 100.0 * sign)
    ctx.wait_until(move.done, 5.0, "the distance is travelled")
    ctx.measure(
        "distance", axis.var("ActualPosition") - place, "mm", low=sign * 25.0 - 0.1, high=sign * 25.0 + 0.1
    )
    panel.set_position(7.0)
    ctx.run_for(0.1)
    ctx.expect(status_word_bit(5, True, at=ctx.now_s, axis=name).covers("COM-043"))
    absolute = panel.move_absolute(7.0 + sign * 10.0)
    ctx.wait_until(absolute.done, 5.0, "the place is reached")
    ctx.expect(
        value_at(f"{name}.actual_position", ctx.now_s, 7.0 + sign * 10.0, tolerance=0.1).covers("COM-050")
    )
    panel.disable()
    ctx.wait_until(lambda: not panel.enabled, 3.0, "the axis is disabled")
    ctx.expect(operator.has_control(at=ctx.now_s))
    operator.give_back()
    ctx.expect(
        operator.has_control(at=ctx.now_s, control=False),
        state_at(name, ctx.now_s, "DISABLED"),
        event_order(
            [event("panel.control", name, what="taken"), event("panel.control", name, what="returned")]
        ),
        no_alarm(since=since, axis=name),
    )


@CASES.product(
    "refused/{why}",
    parameters={"why": ("enabled", "moving", "stop", "another-panel", "enabling", "disabling")},
    title="master control is refused: {why}",
    requirements=("COM-022",),
)
def refused(ctx: CaseContext, why: str) -> None:
    """Enabled by the program, controller not in RUN, another panel: reported in words, and nothing changes
    on the axis.
    """
    operator = Operator(ctx)
    name = axis_name(ctx)
    if why in ("enabled", "moving", "disabling"):
        enable(ctx)
        if why != "enabled":
            ctx.axis.move_velocity(50.0)
            ctx.run_for(0.3)
        if why == "disabling":
            ctx.axis.power(False, stop_mode=2)
            ctx.run_for(0.008)
        text = "the user program has it enabled"
    elif why == "enabling":
        ctx.axis.power()
        ctx.run_for(0.008)
        text = "the user program has it enabled"
    elif why == "stop":
        ctx.inject("controller.stop", duration_s=0.5)
        ctx.run_for(0.2)
        text = "not in RUN"
    else:
        Operator(ctx).take()
        text = "another panel has master control"
    operator.refused(operator.panel.take_control, text)
    operator.refused(operator.panel.enable, "does not have master control")
    operator.refused(lambda: operator.panel.jog(50.0), "does not have master control")
    ctx.run_for(0.1)
    ctx.expect(operator.has_control(at=ctx.now_s, control=why == "another-panel"))
    if why == "moving":
        ctx.expect(
            value_at(f"{name}.velocity_setpoint", ctx.now_s, 50.0, tolerance=1e-6).named("the motion goes on")
        )
    ctx.measure("panel without control", float(operator.panel.active), high=0.0)


_PROGRAM: Final = ("power", "halt", "stop", "move_velocity", "jog", "home", "motion_in_velocity", "reset")


@CASES.product(
    "program/{instruction}",
    parameters={"instruction": _PROGRAM},
    title="the user program gives {instruction} while the panel has the axis",
    tags=("program",),
    requirements=("COM-025", "COM-075"),
)
def program(ctx: CaseContext, instruction: str) -> None:
    """16#8012, and the axis jogs on."""
    operator = Operator(ctx).take()
    jog = operator.jog()
    since = ctx.now_s
    make: dict[str, Any] = {
        "move_velocity": lambda: ctx.axis.move_velocity(-50.0),
        "jog": lambda: ctx.axis.jog(10.0),
        "motion_in_velocity": lambda: ctx.axis.motion_in_velocity(0.0),
        "power": lambda: ctx.axis.power(True),
    }
    job = make.get(instruction, getattr(ctx.axis, instruction))()
    ctx.run_for(0.3)
    ctx.measure("ErrorID", job.ErrorID, low=0x8012, high=0x8012, requirements=("COM-025",))
    ctx.measure("Error", float(job.Error), low=1.0)
    ctx.measure("the jog goes on", float(jog.Busy), low=1.0)
    name = axis_name(ctx)
    ctx.expect(
        never_happens(event("job.aborted", name), since=since, until=ctx.now_s),
        value_at(f"{name}.velocity_setpoint", ctx.now_s, JOG, tolerance=1e-6).covers("COM-025"),
    )
    operator.give_back()


@CASES.product(
    "slider/{percent}",
    parameters={"percent": (1, 37, 100, -37)},
    title="slider at {percent} %",
    requirements=("COM-035", "COM-040", "COM-041", "COM-076"),
)
def slider(ctx: CaseContext, percent: int) -> None:
    """Velocity x slider x adjustment; the slider stays as override afterwards, and the program runs with
    that.
    """
    operator = Operator(ctx).take()
    panel, name = operator.panel, axis_name(ctx)
    panel.velocity, panel.acceleration, panel.jerk = 100.0, 1000.0, 0.0
    panel.adjust = 50.0
    panel.jog(percent)
    ctx.run_for(0.4)
    ctx.expect(
        value_at(f"{name}.velocity_setpoint", ctx.now_s, 0.5 * percent, tolerance=1e-6).covers(
            "COM-035", "COM-040"
        )
    )
    operator.give_back()
    ctx.measure(
        "Override.Velocity",
        ctx.axis.var("Override.Velocity"),
        "%",
        low=abs(percent),
        high=abs(percent),
        requirements=("COM-041", "COM-076"),
    )
    enable(ctx)
    ctx.axis.move_velocity(100.0)
    ctx.run_for(0.5)
    ctx.expect(
        value_at(f"{name}.velocity_setpoint", ctx.now_s, abs(percent), tolerance=1e-6).covers("COM-041")
    )


@CASES.product(
    "cancelled/{job}",
    parameters={"job": ("relative", "absolute", "homing")},
    title="the slider is released during {job}",
    requirements=("COM-036", "COM-049", "COM-050"),
)
def cancelled(ctx: CaseContext, job: str) -> None:
    """The job is cancelled, the axis stops with the deceleration of the panel, and stays enabled."""
    if job == "homing":
        configure(ctx, {"Sensor[1].ActiveHoming.Mode": 2}, Sensor__ActiveHoming__Direction=0)
    operator = Operator(ctx).take()
    panel = operator.panel
    panel.set_position(0.0)
    ctx.run_for(0.05)
    panel.velocity = 100.0
    since = ctx.now_s
    running = {
        "relative": lambda: panel.move_relative(200.0),
        "absolute": lambda: panel.move_absolute(200.0),
        "homing": lambda: panel.home(0.0),
    }[job]()
    ctx.run_for(0.6)
    ctx.measure("velocity", ctx.axis.var("Velocity"), "mm/s", low=50.0)
    panel.slide(0.0)
    ctx.run_for(0.6 + settle_s(ctx))
    name = axis_name(ctx)
    ctx.expect(
        job_output(running.name, "CommandAborted", since=since).covers("COM-036"),
        state_at(name, ctx.now_s, "STANDSTILL"),
        at_rest(ctx),
        no_alarm(since=since, axis=name),
    )
    operator.give_back()


@CASES.case("active-homing", tags=("homing",), requirements=("COM-042", "COM-016", "HOM-032"))
def active_homing(ctx: CaseContext) -> None:
    """MC_Home Mode 3 as configured, at the entered home position, with the dynamics of the panel."""
    places = machine(ctx)
    configure(ctx, {"Sensor[1].ActiveHoming.Mode": 0}, Sensor__ActiveHoming__Direction=0)
    operator = Operator(ctx).take()
    panel, name = operator.panel, axis_name(ctx)
    panel.acceleration, panel.deceleration, panel.jerk = 300.0, 300.0, 0.0
    since = ctx.now_s
    job = panel.home(555.0)
    ctx.wait_until(job.done, 20.0, "the axis is homed")
    ctx.run_for(0.2 + settle_s(ctx))
    slopes = abs(ctx.trace()[f"{name}.velocity_setpoint"].between(since, ctx.now_s).derivative().values)
    ctx.measure(
        "greatest acceleration",
        float(slopes.max()),
        "mm/s2",
        low=299.0,
        high=301.0,
        requirements=("COM-042",),
    )
    ctx.expect(
        happens(event("axis.homed", name, mode=3), since=since).covers("COM-042"),
        value_at(f"{name}.actual_position", ctx.now_s, 555.0, tolerance=0.1).covers("COM-042"),
        status_word_bit(5, True, at=ctx.now_s, axis=name),
    )
    mark = places.next_mark(1000.0 * float(ctx.drive.mechanics.position) - 30.0, 1)
    ctx.measure("first mark", mark, "mm", low=places.limits[0], high=places.limits[1])
    operator.give_back()


@CASES.product(
    "not-enabled/{what}",
    parameters={"what": ("jog", "relative", "absolute", "home", "set", "adjust")},
    title="{what} without the enable",
    requirements=("COM-042", "COM-043", "COM-047"),
)
def not_enabled(ctx: CaseContext, what: str) -> None:
    """Everything that needs the enable in the panel is refused in words; nothing moves."""
    operator = Operator(ctx)
    panel = operator.panel
    panel.take_control()
    ctx.run_for(0.05)
    act = {
        "jog": panel.jog,
        "relative": lambda: panel.move_relative(5.0),
        "absolute": lambda: panel.move_absolute(5.0),
        "home": panel.home,
        "set": lambda: panel.set_position(0.0),
        "adjust": lambda: panel.adjust_encoder(1.0),
    }[what]
    operator.refused(act, "it is not enabled in the panel")
    ctx.run_for(0.1)
    ctx.expect(never_happens(event("job.started", axis_name(ctx))), at_rest(ctx))
    operator.give_back()


@CASES.case("adjustment-of-an-incremental-encoder", requirements=("COM-044", "HOM-021"))
def adjustment(ctx: CaseContext) -> None:
    """The encoder of the drive is an incremental one: 16#8010, and the position stays."""
    operator = Operator(ctx).take()
    place = float(ctx.axis.var("ActualPosition"))
    for relative in (False, True):
        job = operator.panel.adjust_encoder(5.0, relative=relative)
        ctx.run_for(0.05)
        ctx.measure("ErrorID", job.ErrorID, low=0x8010, high=0x8010)
    ctx.measure("position", ctx.axis.var("ActualPosition"), "mm", low=place - 0.01, high=place + 0.01)
    operator.give_back()


@CASES.product(
    "limits/{value}",
    parameters={"value": ("velocity", "acceleration", "deceleration")},
    title="{value} beyond the dynamic limit of the axis",
    requirements=("COM-039",),
)
def limits(ctx: CaseContext, value: str) -> None:
    """It acts as the limit, without a warning, and the configuration keeps its own."""
    operator = Operator(ctx).take()
    panel, axis, name = operator.panel, ctx.axis, axis_name(ctx)
    path = {
        "velocity": "DynamicLimits.MaxVelocity",
        "acceleration": "DynamicLimits.MaxAcceleration",
        "deceleration": "DynamicLimits.MaxDeceleration",
    }[value]
    before = axis.variables.read(path)
    panel.velocity, panel.acceleration, panel.jerk = 100.0, 1000.0, 0.0
    setattr(panel, value, 10.0 * before)
    since = ctx.now_s
    panel.move_relative(160.0)
    ctx.run_for(2.0)
    signal = ctx.trace()[f"{name}.velocity_setpoint"].between(since, ctx.now_s)
    if value == "velocity":
        seen = float(abs(signal.values).max())
        ctx.measure("highest velocity", seen, "mm/s", high=before + 1e-6)
    else:
        slopes = signal.derivative().values
        seen = float(slopes.max() if value == "acceleration" else -slopes.min())
        ctx.measure(f"greatest {value}", seen, "mm/s2", high=before * 1.001)
    ctx.measure("the value of the configuration", axis.variables.read(path), low=before, high=before)
    ctx.expect(no_alarm(since=since, axis=name))
    operator.give_back()


@CASES.product(
    "tried-values/{how}",
    parameters={"how": ("released", "lost", "covered", "stop", "supply")},
    title="values that were tried, and control that goes: {how}",
    requirements=("COM-071",),
)
def tried_values(ctx: CaseContext, how: str) -> None:
    """What was tried in the panel is taken back whichever way control goes."""
    operator = Operator(ctx).take()
    axis = ctx.axis
    paths = {"PositionControl.Kv": 33.0, "PositionControl.Kpc": 50.0, "FollowingError.MaxValue": 99.0}
    before = {path: axis.variables.read(path) for path in paths}
    for path, value in paths.items():
        operator.panel.try_value(path, value)
    ctx.run_for(0.05)
    ctx.measure("Kv while it is tried", axis.variables.read("PositionControl.Kv"), low=33.0, high=33.0)
    if how == "released":
        operator.give_back()
    elif how == "lost":
        operator.panel.disconnect()
        ctx.run_for(1.0)
    elif how == "covered":
        operator.panel.cover()
        ctx.run_for(0.5)
    else:
        ctx.inject("controller.stop" if how == "stop" else "controller.power_off", duration_s=0.5)
        ctx.run_for(1.5)
    ctx.measure("panel without control", float(operator.panel.active), high=0.0)
    for path, value in before.items():
        ctx.measure(path, axis.variables.read(path), low=value, high=value, requirements=("COM-071",))


@CASES.case("configuration-changed", requirements=("COM-026",))
def configuration_changed(ctx: CaseContext) -> None:
    """A start value that changes while the panel has the axis acts after control has been returned, the
    object restarted, and control taken again.
    """
    operator = Operator(ctx).take()
    axis, name = ctx.axis, axis_name(ctx)
    limit = axis.variables.read("DynamicLimits.MaxVelocity")
    axis.variables.write_start("DynamicLimits.MaxVelocity", 0.5 * limit)
    ctx.run_for(0.05)
    reset = axis.reset(restart=True)
    ctx.run_for(0.1)
    ctx.measure("ErrorID of MC_Reset", reset.ErrorID, low=0x8012, high=0x8012)
    ctx.expect(status_word_bit(3, True, at=ctx.now_s, axis=name).named("restart required"))
    operator.panel.velocity = 0.8 * limit
    operator.panel.acceleration, operator.panel.jerk = 2000.0, 0.0
    operator.panel.jog()
    ctx.run_for(0.35)
    ctx.expect(
        value_at(f"{name}.velocity_setpoint", ctx.now_s, 0.8 * limit, tolerance=1e-6).covers("COM-026")
    )
    operator.give_back()
    ctx.wait_until(axis.reset(restart=True).done, 5.0, "the object is restarted")
    operator.take()
    operator.panel.velocity = 0.8 * limit
    operator.panel.jog(-100.0)
    ctx.run_for(0.35)
    ctx.expect(
        value_at(f"{name}.velocity_setpoint", ctx.now_s, -0.5 * limit, tolerance=1e-6).covers("COM-026")
    )
    operator.give_back()


@CASES.case("hand-over-to-a-program-that-wants-it", tags=("program",), requirements=("COM-072",))
def hand_over(ctx: CaseContext) -> None:
    """MC_Power.Enable is TRUE when control comes back: enabled only after a new rising edge."""
    operator = Operator(ctx).take()
    power = ctx.axis.power(True)
    ctx.run_for(0.1)
    operator.give_back()
    ctx.run_for(0.5)
    name = axis_name(ctx)
    ctx.expect(state_at(name, ctx.now_s, "DISABLED").covers("COM-072"))
    power.set(Enable=False)
    ctx.run_for(0.02)
    power.set(Enable=True)
    ctx.wait_until(power.status, 5.0, "the axis is enabled after a new edge")


@CASES.case("optimisation", requirements=("COM-055", "COM-060", "COM-062", "COM-063", "COM-065", "COM-071"))
def optimisation(ctx: CaseContext) -> None:
    """A gain with which nothing overshoots, found from the panel; the axis keeps its own until it is
    downloaded.
    """
    operator = Operator(ctx).take()
    own = ctx.axis.variables.read("PositionControl.Kv")
    routine = Optimisation(
        operator.panel,
        ctx.bench.runtime,
        ctx.bench.run_until,
        TestStep(distance=3.0, velocity=60.0, acceleration=1000.0),
    )
    found = routine.run()
    ctx.observe(f"recommended: {found.start_values}")
    ctx.measure("recommended gain", found.kv, "1/s", low=35.0, high=50.0, requirements=("COM-065",))
    best = max(one.kv for one in found.attempts if one.good and one.kpc == 0.0)
    ctx.measure(
        "recommended gain, of the greatest one without overshoot",
        found.kv / best,
        low=0.9 - 1e-9,
        high=0.9 + 1e-9,
        requirements=("COM-062",),
    )
    ctx.measure("overshoot with it", found.attempts[-1].overshoot, "mm", high=found.attempts[-1].tolerance)
    operator.give_back()
    ctx.measure(
        "gain of the axis",
        ctx.axis.variables.read("PositionControl.Kv"),
        "1/s",
        low=own,
        high=own,
        requirements=("COM-071",),
    )


@CASES.product(
    "operator/{what}/{motion}",
    parameters={"what": ("looks-away", "covered"), "motion": ("jog", "relative", "standstill")},
    title="the operator {what} during {motion}",
    requirements=("COM-029", "COM-030", "COM-033", "COM-034"),
)
def attention(ctx: CaseContext, what: str, motion: str) -> None:
    """Stop with the greatest deceleration; looking away keeps control and enable, a dialog over the panel
    gives control back.
    """
    operator = Operator(ctx).take()
    name = axis_name(ctx)
    if motion == "jog":
        operator.jog()
    elif motion == "relative":
        operator.panel.velocity, operator.panel.acceleration, operator.panel.jerk = JOG, 1000.0, 0.0
        operator.panel.move_relative(400.0)
        ctx.run_for(0.5)
    since = ctx.now_s
    ctx.do(what)
    (operator.panel.look_away if what == "looks-away" else operator.panel.cover)()
    ctx.run_for(0.8 + settle_s(ctx))
    kept = what == "looks-away"
    if motion != "standstill":
        ctx.expect(
            greatest_deceleration(ctx, event("axis.state", name, to="HALTING" if kept else "DISABLING_RAMP"))
        )
    ctx.expect(
        operator.has_control(at=ctx.now_s, control=kept), at_rest(ctx), no_alarm(since=since, axis=name)
    )
    if kept:
        ctx.measure("enabled", float(operator.panel.enabled), low=1.0)
        operator.give_back()
    else:
        ctx.expect(operator.returned(since=since, within_s=0.6).covers("COM-033"))
