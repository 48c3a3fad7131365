"""What the cases of `fault_reactions`, `drive_faults` and `telegram_faults` are on axes of an NC."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

from hil.campaign import CaseContext, Counterpart, NotApplicable
from hil.expect import axis_error, happens, no_axis_error, stays_within, value_at
from hil.record import event
from testcases.campaigns._nc import (
    DATA_INVALID,
    ENCODER,
    INVALID_CYCLES,
    LAG,
    LIFE_COUNTER,
    NO_ENABLE,
    NOT_READY,
    Fault,
    Reaction,
    Row,
    Table,
    after,
    at_rest,
    axis_name,
    axis_of,
    bring_into,
    code_at,
    enable,
    fault_case,
    moves_again,
    need_encoder,
    reset,
)
from testcases.campaigns._profiles import encoder_increments_per_revolution, enters
from testcases.campaigns._reactions import cycles
from testcases.campaigns._telegram_actual import HARMLESS as HARMLESS_TELEGRAMS
from testcases.campaigns._telegram_actual import LIES
from testcases.campaigns._telegram_setpoint import OFFS, SILENCES
from testcases.campaigns.drive_faults import HARMLESS, TRIPS
from testcases.campaigns.support import drive_name, drive_setting, settle_s

TRIPPED: Final = Reaction(NOT_READY, ("NC-749",))
LOST: Final = Reaction(
    DATA_INVALID, (), within_cycles=3 + INVALID_CYCLES + 2, by_profile={"analog": NOT_READY}
)
"""The port bears three cycles without data before it calls them invalid."""
BLIND: Final = Reaction(ENCODER, ("NC-745",), needs_encoder=True, by_profile={"analog": NOT_READY})
TOO_FAR: Final = Reaction(LAG, ("NC-148", "NC-730"), within_cycles=4, within_s=0.02)
"""Behind the time in which the following error grows the filter time counts, 20 ms."""
BY_ITSELF: Final = {"profidrive": NOT_READY}
"""A drive that watches speed and torque of its motor trips before the NC."""
NOTHING: Final = Reaction(0)
BORNE: Final = Fault("", NOTHING, lasts_s=0.3, watched_s=0.5)

NO_REACTIONS: Final = NotApplicable(
    "an NC axis has no alarms with reactions to choose from: every error of it shuts it down"
)
NO_HELD_RESET: Final = NotApplicable(
    "MC_Reset of the NC sends edges for 0.2 s; no bit is held until the drive answers"
)


def _drop(message: str) -> dict[str, Any]:
    return {"message": message}


def _jump(turns: int) -> Any:
    return lambda ctx: {"increments": turns * encoder_increments_per_revolution(ctx)}


def _nmt(command: str) -> Any:
    return lambda ctx: {"can_id": 0, "data": f"{command}{drive_setting(ctx, 'node_id'):02X}", "count": 1}


def _heartbeat(ctx: CaseContext) -> Mapping[str, Any]:
    return {"duration_s": drive_setting(ctx, "consumer_heartbeat_ms") * 1e-3 + 0.6}


def _drive_fault(code: str, phase: str) -> Counterpart:
    fault = Fault("drive.fault", TRIPPED, {"code": int(code, 16)}, watched_s=3.0)
    return Counterpart(fault_case, {"fault": fault, "phase": phase}, TRIPPED.requirements)


def plc_stop_case(ctx: CaseContext, phase: str) -> None:
    """The PLC stops: after the cycles of the watchdog its enables count as taken away, and a moving axis is
    in error; its fresh data resume nothing.
    """
    axis, name = axis_of(ctx), axis_name(ctx)
    enable(ctx)
    running = bring_into(ctx, phase)
    watchdog = int(axis.read_parameter("task.watchdog_cycles"))
    fault = ctx.inject("controller.stop")
    ctx.run_for(4.0 + settle_s(ctx))
    ended = ctx.now_s
    applied = event("fault.applied")
    ctx.expect(
        axis_error(NO_ENABLE, since=applied, within_s=cycles(ctx, watchdog + 3), axis=name).covers(
            "NC-017", "NC-733"
        ),
        no_axis_error(until=applied.plus(cycles(ctx, watchdog - 1)), axis=name).covers("NC-015"),
    )
    code_at(ctx, ended, NO_ENABLE)
    at_rest(ctx, ended)
    fault.remove()
    ctx.run_for(cycles(ctx, 5))
    code_at(ctx, ctx.now_s, NO_ENABLE)
    ctx.measure("ErrorID of the running block", float(running.ErrorID), low=NO_ENABLE, high=NO_ENABLE)
    reset(ctx)
    moves_again(ctx)


FAULT_REACTIONS: Final = Table(
    {
        "drive-fault/*": _drive_fault,
        "encoder-fault/*": Fault("drive.fault", BLIND, {"code": 0x7305}, watched_s=4.0),
        "safe-torque-off/*": Fault("drive.sto", TRIPPED, watched_s=3.5),
        "actual-values-lost/*": Fault(
            "frame.drop", LOST, _drop("tpdo1"), on_bus=True, lasts_s=0.6, watched_s=1.6
        ),
        "two-actual-values-lost": Fault(
            "frame.drop", NOTHING, {"message": "tpdo1", "count": 2}, on_bus=True, watched_s=0.5
        ),
        "setpoints-lost/*": Fault(
            "frame.drop",
            Reaction(NOT_READY, ("NC-749",), within_cycles=6, by_profile={"profidrive": LIFE_COUNTER}),
            _drop("rpdo1"),
            on_bus=True,
            lasts_s=1.2,
            watched_s=2.2,
        ),
        "corrupted-frames": Fault(
            "frame.corrupt",
            NOTHING,
            {"message": "tpdo1", "count": 10, "attempts": 2},
            on_bus=True,
            watched_s=0.5,
        ),
        "delayed-actual-values": Fault(
            "frame.delay",
            NOTHING,
            lambda ctx: {"message": "tpdo1", "delay_s": ctx.bench.cycle_ns * 0.75e-9},
            on_bus=True,
            lasts_s=0.2,
            watched_s=0.5,
        ),
        "node-off/*": Fault("drive.power_off", LOST, lasts_s=2.4, watched_s=3.4),
        "heartbeat-lost/*": Fault(
            "drive.heartbeat_loss",
            Reaction(DATA_INVALID, (), within_s=0.5),
            _heartbeat,
            watched_s=2.0,
        ),
        "controller-heartbeat-lost/*": Fault(
            "frame.drop",
            Reaction(DATA_INVALID, (), within_s=0.5),
            lambda ctx: {"message": "controller_heartbeat", **_heartbeat(ctx)},
            on_bus=True,
            watched_s=2.0,
        ),
        "nmt-02/*": Fault("frame.inject", LOST, _nmt("02"), on_bus=True, watched_s=1.5),
        "nmt-80/*": Fault("frame.inject", LOST, _nmt("80"), on_bus=True, watched_s=1.5),
        "controller-stop/*": lambda phase: Counterpart(plc_stop_case, {"phase": phase}, ("NC-017", "NC-022")),
        "controller-power-off/*": NotApplicable("the bench has no supply of an NC that could be cut"),
        "controller-overrun/*": NotApplicable(
            "an overrun of a task of the NC is reported and moves nothing (NC-023)"
        ),
        "controller-stall": NotApplicable("the bench cannot let the tasks of an NC hang"),
        "precedence/*": NO_REACTIONS,
        "emergency-from-actual-values": NO_REACTIONS,
        "limit-switch-stuck": Fault(
            "switch.stuck",
            Reaction(LAG, TOO_FAR.requirements, within_s=3.0, needs_encoder=True),
            {"input": "positive_limit", "state": False},
            watched_s=4.0,
        ),
        "limit-switch*": NotApplicable(
            "an NC axis has no limit switches of its own: a PLC program takes a feed enable away "
            "(campaign limits)"
        ),
        "jam/*": Fault(
            "mechanics.jam",
            Reaction(LAG, TOO_FAR.requirements, within_s=0.1, needs_encoder=True),
            watched_s=1.5,
        ),
        "load-step": Fault("mechanics.load_step", NOTHING, {"force_N": -400.0}, lasts_s=0.3, watched_s=0.8),
        "overload": Fault(
            "mechanics.load_step",
            Reaction(LAG, TOO_FAR.requirements, within_s=0.17, needs_encoder=True, by_profile=BY_ITSELF),
            {"force_N": -8000.0},
            lasts_s=0.15,
            watched_s=5.0,
        ),
        "encoder-frozen/*": Fault(
            "encoder.freeze",
            Reaction(LAG, (*TOO_FAR.requirements, "NC-769"), within_s=0.1, stands=False),
            lasts_s=2.0,
            watched_s=4.0,
        ),
        "encoder-jump/-*": Fault("encoder.jump", TOO_FAR, _jump(-2), watched_s=4.0),
        "encoder-jump/*": Fault("encoder.jump", replace(TOO_FAR, by_profile=BY_ITSELF), _jump(2)),
        "small-encoder-jump": Fault(
            "encoder.jump",
            NOTHING,
            lambda ctx: {"increments": round(0.038 * encoder_increments_per_revolution(ctx))},
            watched_s=0.5,
        ),
    }
)


def _trip(what: str, phase: str) -> Counterpart:
    kind, parameters, _, number = TRIPS[what]
    reaction = BLIND if number == 411 else TRIPPED
    reaction = replace(reaction, within_cycles=6, within_s=0.02)
    fault = Fault(kind, reaction, parameters, watched_s=4.0)
    return Counterpart(fault_case, {"fault": fault, "phase": phase}, reaction.requirements)


def _harmless(what: str) -> Counterpart:
    kind, parameters = HARMLESS[what]
    fault = Fault(kind, NOTHING, parameters, lasts_s=0.3, watched_s=0.5)
    return Counterpart(fault_case, {"fault": fault, "phase": "constant"})


def _blocked_before_enabling(ctx: CaseContext, kind: str, options: Mapping[str, Any]) -> None:
    """Whatever keeps the drive off keeps the axis off; without it `MC_Power` enables it, after a reset where
    the drive has tripped.
    """
    axis = axis_of(ctx)
    fault = ctx.inject(kind, drive_name(ctx), **options)
    before = ctx.now_s
    ctx.do("MC_Power Enable = TRUE")
    power = axis.power()
    ctx.run_for(0.5 + settle_s(ctx))
    ctx.measure("MC_Power.Status meanwhile", float(power.Status), low=0.0, high=0.0)
    ctx.expect(
        value_at(f"{axis_name(ctx)}.set_velocity", ctx.now_s, 0.0, tolerance=0.0),
        happens(enters(ctx, "operating"), since=before).covers("NC-749").named("it operates at last"),
    )
    refused = axis.move_relative(20.0, Velocity=100.0)
    ctx.run_for(cycles(ctx, 3))
    ctx.measure("a command meanwhile is refused", float(refused.Error), low=1.0)
    fault.remove()
    ctx.run_for(0.2)
    if axis.error_id:
        reset(ctx)
    moves_again(ctx)


def _mains_off(ctx: CaseContext) -> None:
    """Without mains the drive trips when its DC link is empty, and the axis with it."""
    enable(ctx)
    fault = ctx.inject("drive.mains_off", drive_name(ctx))
    ctx.run_for(4.0 + settle_s(ctx))
    ctx.expect(axis_error(NOT_READY, since=event("fault.applied"), within_s=4.0, axis=axis_name(ctx)))
    at_rest(ctx, ctx.now_s)
    fault.remove()
    ctx.run_for(0.5)
    reset(ctx)
    moves_again(ctx)


def _jam_comes_free(ctx: CaseContext) -> None:
    """A jam that comes free behind the shutdown sets nothing in motion."""
    need_encoder(ctx)
    enable(ctx)
    bring_into(ctx, "constant")
    jam = ctx.inject("mechanics.jam", drive_name(ctx))
    ctx.wait_until(lambda: axis_of(ctx).error_id, 2.0, "the position lag has become too large")
    ctx.run_for(cycles(ctx, 5))
    freed = ctx.now_s
    place_m = float(ctx.trace()[f"{drive_name(ctx)}.position"].values[-1])
    jam.remove()
    ctx.run_for(1.5 + settle_s(ctx))
    ctx.expect(
        axis_error(LAG, axis=axis_name(ctx)).covers("NC-148"),
        stays_within(
            f"{drive_name(ctx)}.position", low=place_m - 0.001, high=place_m + 0.001, since=freed
        ).named("the machine stays where it was jammed"),
    )


def _case(function: Any, *requirements: str, **parameters: Any) -> Row:
    return lambda **_: Counterpart(function, parameters, requirements)


DRIVE_FAULTS: Final = Table(
    {
        "trip/*": _trip,
        "acknowledge-held": NO_HELD_RESET,
        "mains-off": _case(_mains_off),
        "withdrawn/*": Fault(
            "drive.switch_on_disabled", after(Fault("", TRIPPED), within_cycles=6).reaction, watched_s=4.0
        ),
        "safe-stop-1/*": Fault("drive.ss1", Reaction(NOT_READY, TRIPPED.requirements, within_s=1.0)),
        "sto-before-enabling": _case(_blocked_before_enabling, "NC-749", kind="drive.sto", options={}),
        "no-dc-link-before-enabling": _case(
            _blocked_before_enabling, "NC-749", kind="drive.dc_link", options={"voltage_V": 0.0}
        ),
        "transition-refused": _case(
            _blocked_before_enabling, "NC-749", kind="drive.refuse_transition", options={"transition": 4}
        ),
        "jam-comes-free": _case(_jam_comes_free, "NC-148"),
        "weak-quick-stop": NotApplicable(
            "MC_Power of the NC has no stop mode that leaves the ramp to the quick stop of the drive"
        ),
        "harmless/*": _harmless,
        "reset/*": Fault("drive.reset", LOST, {"boot_s": 0.6}, watched_s=4.5),
    }
)


# -- telegrams -----------------------------------------------------------------------------------------------

SIGN_OF_LIFE: Final = Reaction(LIFE_COUNTER, ("NC-750",), within_cycles=3 + 4 + INVALID_CYCLES)
"""The port bears three wrong values (PD-132)."""
STUCK: Final = 4.0


def _sign(**options: Any) -> Fault:
    return Fault("telegram.sign_of_life", SIGN_OF_LIFE, {"direction": "actual", **options})


def _lie(what: str, phase: str) -> Counterpart:
    reported, number, _ = LIES[what]
    reaction = {421: TRIPPED, 411: BLIND}[number]
    if what == "control":
        reaction = Reaction(DATA_INVALID, (), within_cycles=INVALID_CYCLES + 3)
    fault = Fault("telegram.stuck", reaction, reported, watched_s=STUCK)
    return Counterpart(fault_case, {"fault": fault, "phase": phase}, reaction.requirements)


def _silence(how: str, phase: str) -> Counterpart:
    kind, options = SILENCES[how]
    # The drive brakes, and takes its own sign of life away.
    reaction = SIGN_OF_LIFE
    return Counterpart(
        fault_case, {"fault": Fault(kind, reaction, options), "phase": phase}, reaction.requirements
    )


def _withdrawn(how: str, phase: str) -> Counterpart:
    signal = OFFS[how][0]
    fault = Fault(
        "telegram.flip",
        Reaction(NOT_READY, TRIPPED.requirements, within_cycles=5),
        {"signal": signal},
        watched_s=4.0,
    )
    return Counterpart(fault_case, {"fault": fault, "phase": phase}, TRIPPED.requirements)


def _harmless_telegram(what: str) -> Counterpart:
    kind, parameters = HARMLESS_TELEGRAMS[what]
    fault = Fault(kind, NOTHING, parameters, lasts_s=0.3, watched_s=0.5)
    return Counterpart(fault_case, {"fault": fault, "phase": "constant"})


def _borne(times: int, how: str, step: int = 0) -> Fault:
    options = {"direction": "actual", "how": how, "count": times}
    return Fault(
        "telegram.sign_of_life", NOTHING, {**options, "step": step} if step else options, watched_s=0.3
    )


def _speed(what: str) -> Counterpart:
    kind, options = {
        "halved": ("telegram.scale", {"signal": "NSOLL_B", "factor": 0.5}),
        "swapped": ("telegram.swap", {"signal": "PZD2", "other": "PZD3", "direction": "setpoint"}),
        "stuck": ("telegram.stuck", {"signal": "NSOLL_B", "value": 0}),
    }[what]
    reaction = Reaction(LAG, TOO_FAR.requirements, within_s=0.4)
    return Counterpart(
        fault_case,
        {"fault": Fault(kind, reaction, options, lasts_s=0.5), "phase": "constant"},
        reaction.requirements,
    )


TELEGRAM_FAULTS: Final = Table(
    {
        "sign-of-life/*": _sign(how="freeze"),
        "sign-of-life-jumps/1": _borne(1, "jump", 6),
        "sign-of-life-jumps/2": _borne(2, "jump", 6),
        "sign-of-life-jumps/3": _borne(3, "jump", 6),
        "sign-of-life-stands/2": _borne(2, "freeze"),
        "sign-of-life-stands/3": NotApplicable(
            "the port and the NC together bear more wrong values than this case sends; sign-of-life has "
            "the error"
        ),
        "lie/*": _lie,
        "autonomous/*": Fault("telegram.bits", TRIPPED, {"signal": "ZSW1", "clear": 0x0024}),
        "control-requested-lost": Fault(
            "telegram.control_lost",
            Reaction(DATA_INVALID, (), within_cycles=INVALID_CYCLES + 3),
            {"direction": "actual"},
        ),
        "stale/*": Fault(
            "telegram.freeze",
            Reaction(LAG, (*TOO_FAR.requirements, "NC-769"), within_s=0.1),
            {"direction": "actual", "sign_of_life": "counts"},
            watched_s=3.0,
        ),
        "frozen/*": Fault("telegram.freeze", SIGN_OF_LIFE, {"direction": "actual"}),
        "wrong-length/*": lambda words: Counterpart(
            fault_case,
            {"fault": Fault("telegram.length", LOST, {"words": words}), "phase": "constant"},
            LOST.requirements,
        ),
        "late/*": lambda number: Counterpart(
            fault_case,
            {
                "fault": Fault("telegram.late", NOTHING, {"cycles": number}, lasts_s=0.2, watched_s=0.5),
                "phase": "constant",
            },
        ),
        # Actual values of long ago are seen by the position lag before they are missed for too long.
        "very-late": Fault(
            "telegram.late",
            Reaction(LAG, TOO_FAR.requirements, within_s=3.0),
            lambda ctx: {"cycles": ctx.bench.config.bench.grace_cycles + 2},
            watched_s=4.0,
        ),
        "position-jumps/*": lambda turns: Counterpart(
            fault_case,
            {
                "fault": Fault(
                    "telegram.offset",
                    TOO_FAR,
                    lambda ctx: {
                        "signal": "G1_XIST1",
                        "counts": turns * encoder_increments_per_revolution(ctx),
                    },
                ),
                "phase": "constant",
            },
            TOO_FAR.requirements,
        ),
        "position-displaced-a-little": Fault(
            "telegram.offset",
            NOTHING,
            lambda ctx: {
                "signal": "G1_XIST1",
                "counts": round(0.05 * encoder_increments_per_revolution(ctx)),
            },
            lasts_s=0.3,
            watched_s=0.6,
        ),
        "harmless/*": _harmless_telegram,
        "controller-*": _silence,
        "two-wrong-signs": NotApplicable(
            "what the drive tolerates of its controller is no matter of its make"
        ),
        "one-wrong-sign": NotApplicable(
            "what the drive tolerates of its controller is no matter of its make"
        ),
        "withdrawn-*": _withdrawn,
        "speed-slightly-wrong": Fault(
            "telegram.scale", NOTHING, {"signal": "NSOLL_B", "factor": 0.95}, lasts_s=0.3, watched_s=0.6
        ),
        "speed-*": _speed,
        "never-off": NotApplicable("MC_Power of the NC has no output that waits for the drive to be off"),
        "operation-comes-late": _case(
            _blocked_before_enabling,
            "NC-749",
            kind="telegram.stuck",
            options={"signal": "ZSW1.2", "value": 0},
        ),
        "operation-withdrawn-in-quick-stop": NotApplicable("an NC axis gives no quick stop to its drive"),
        "control-given-away*": NotApplicable(
            "the NC has no case of its own for STW1.10: the drive alone decides"
        ),
        "reset-unheard/*": NO_HELD_RESET,
        "torque-reduced": Fault(
            "telegram.stuck",
            Reaction(LAG, TOO_FAR.requirements, within_s=0.5),
            {"signal": "MOMRED", "value": 0x4000},
            lasts_s=0.5,
        ),
        "ramp-*": NotApplicable("bits of the ramp-function generator are a matter of the drive alone"),
        "enabled-in-spite/*": NotApplicable("an NC axis does not watch that its drive goes off"),
    }
)
