"""Words of a matrix: faults, each with the alarm and the reaction that the specification gives it, behind
every profile.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from hil.campaign import CaseContext
from testcases.campaigns import modbus_faults
from testcases.campaigns._profiles import encoder_increments_per_revolution
from testcases.campaigns._reactions import cycles, detection_s
from testcases.campaigns.drive_faults import TRIPS
from testcases.campaigns.support import (
    drive_name,
    drive_setting,
    following_error_s,
    grace_s,
    permitted_error_mm,
)

Options = Mapping[str, Any] | Callable[[CaseContext], Mapping[str, Any]]
Seconds = Callable[[CaseContext], float]

CAN: Final = ("can", "can-1ms")
MODBUS: Final = ("modbus-tcp", "modbus-rtu")
FIELDBUSES: Final = CAN + MODBUS
"""Transports of a drive with a state machine of its own."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultWord:
    """A fault and what the specification makes of it."""

    words: str
    kind: str
    target: str = "drive"
    """`drive`, or empty: the first segment, the controller."""
    options: Options = field(default_factory=dict)
    alarm: tuple[int, int] | None = (421, 4)
    """Number and reaction; None: it leaves the motion alone."""
    profidrive: tuple[int, int] | None = None
    """The same of a PROFIdrive drive, where it is another one."""
    within: Seconds | None = None
    """How soon the alarm comes; None: it only has to come."""
    lasts: Seconds | None = None
    """How long the fault stays; None: until the machine is at rest, or what `options` say."""
    after_s: float = 3.0
    """How long the machine takes at most until it is at rest, s."""
    transports: tuple[str, ...] = FIELDBUSES
    drives: tuple[str, ...] = ("cia402", "profidrive")
    moving: bool = False
    """It shows only while the axis moves well."""
    recovers: bool = True
    """Without the cause one `MC_Reset` makes the axis usable again."""
    controller: bool = False
    """It takes the controller: nothing is said of alarms, the machine has to stand and nothing may start by
    itself.
    """
    requirements: tuple[str, ...] = ()


def _soon(number: float, more_s: float = 0.0) -> Seconds:
    return lambda ctx: cycles(ctx, number) + more_s


def _consumer(ctx: CaseContext) -> float:
    return float(drive_setting(ctx, "consumer_heartbeat_ms")) * 1e-3


def _for(seconds: float) -> Seconds:
    return lambda _ctx: seconds


def _beyond_grace(ctx: CaseContext) -> float:
    return grace_s(ctx) + 0.5


def _node(ctx: CaseContext) -> dict[str, Any]:
    return {"node": drive_name(ctx)}


def _nmt(command: str) -> Callable[[CaseContext], dict[str, Any]]:
    def options(ctx: CaseContext) -> dict[str, Any]:
        node = drive_setting(ctx, "node_id")
        return {"can_id": 0, "data": f"{command}{node:02X}", "count": 1}

    return options


def _jump(sign: int) -> Callable[[CaseContext], dict[str, Any]]:
    def options(ctx: CaseContext) -> dict[str, Any]:
        lead_mm = ctx.bench.config.drive[drive_name(ctx)].mechanics.lead_screw_mm
        turns = max(1, math.ceil(1.5 * permitted_error_mm(ctx) / lead_mm))
        return {"increments": sign * turns * encoder_increments_per_revolution(ctx)}

    return options


def _increments(share: float) -> Callable[[CaseContext], dict[str, Any]]:
    return lambda ctx: {"increments": round(share * encoder_increments_per_revolution(ctx))}


def _lost(words: str, kind: str, **more: Any) -> FaultWord:
    """Return a fault that takes the cyclic data away: 431 within the grace, the axis is disabled."""
    given: dict[str, Any] = {
        "alarm": (431, 4),
        "within": grace_s,
        "lasts": _beyond_grace,
        "after_s": 2.0,
        "requirements": ("TA-020", "STP-574"),
        "transports": CAN,
        "target": "",
    }
    return FaultWord(words=words, kind=kind, **{**given, **more})


def _harmless(words: str, kind: str, **more: Any) -> FaultWord:
    given: dict[str, Any] = {"alarm": None, "after_s": 0.5, "transports": CAN, "target": ""}
    return FaultWord(words=words, kind=kind, **{**given, **more})


COMMUNICATION: Final[dict[str, FaultWord]] = {
    "actual-values-lost": _lost("actual values lost", "frame.drop", options={"message": "tpdo1"}),
    "setpoints-lost": _lost(
        "setpoints lost",
        "frame.drop",
        options={"message": "rpdo1"},
        alarm=(550, 5),
        profidrive=(431, 4),
        within=None,
        lasts=_for(1.2),
        moving=True,
        recovers=False,
        requirements=("STP-561", "PD-132"),
    ),
    "unplugged": _lost("drive unplugged", "can.unplug", options=_node),
    "bus-off": _lost("bus-off of the drive", "can.bus_off", options=_node),
    "short-circuit": _lost("bus held dominant", "can.stuck_dominant"),
    "babbling-node": _lost("a babbling node", "can.babble", options={"can_id": 1}),
    "nmt-stop": _lost(
        "NMT stop by a foreign node",
        "frame.inject",
        options=_nmt("02"),
        lasts=None,
        recovers=False,
        requirements=("C301-016", "C301-020"),
    ),
    "nmt-pre-operational": _lost(
        "NMT pre-operational by a foreign node",
        "frame.inject",
        options=_nmt("80"),
        lasts=None,
        recovers=False,
        requirements=("C301-016", "C301-020"),
    ),
    "heartbeat-lost": _lost(
        "heartbeat of the drive lost",
        "drive.heartbeat_loss",
        target="drive",
        within=lambda ctx: _consumer(ctx) + cycles(ctx, 2),
        lasts=lambda ctx: _consumer(ctx) + 0.6,
        requirements=("TA-020", "C301-026"),
    ),
    "controller-heartbeat-lost": _lost(
        "heartbeat of the controller lost",
        "frame.drop",
        options={"message": "controller_heartbeat"},
        within=None,
        lasts=lambda ctx: _consumer(ctx) + 0.5,
        recovers=False,
        requirements=("C301-026", "C402-077"),
    ),
    "two-actual-values-lost": _harmless(
        "two actual values lost", "frame.drop", options={"message": "tpdo1", "count": 2}
    ),
    "two-setpoints-late": _harmless(
        "two setpoints late",
        "frame.delay",
        options=lambda ctx: {"message": "rpdo1", "count": 2, "delay_s": ctx.bench.cycle_ns * 0.2e-9},
    ),
    "corrupted-frames": _harmless(
        "bit errors on the wire",
        "frame.corrupt",
        options={"message": "tpdo1", "count": 10, "attempts": 2},
        requirements=("CANP-030", "CANP-042"),
    ),
    "duplicated-frames": _harmless(
        "actual values twice", "frame.duplicate", options={"message": "tpdo1", "count": 10}
    ),
    "loaded-bus": _harmless("a loaded bus", "can.load", options={"load_percent": 15.0}, lasts=_for(0.2)),
    "overload-frames": _harmless(
        "overload frames", "can.overload", options=lambda ctx: {**_node(ctx), "frames": 1}, lasts=_for(0.2)
    ),
}


def _modbus(table: Mapping[str, Any], transport: str) -> dict[str, FaultWord]:
    return {
        f"{transport.partition('-')[2]}-{name}": FaultWord(
            words=f"{name.replace('-', ' ')} over {transport}",
            kind=kind,
            target="",
            options=options,
            alarm=(431, 4),
            within=lambda ctx: cycles(ctx, modbus_faults.grace(ctx)),
            lasts=_for(2.0),
            after_s=2.0,
            transports=(transport,),
            drives=("profidrive",),
            requirements=("STP-574", *identifiers),
        )
        for name, (kind, options, identifiers) in table.items()
    }


MODBUS_FAULTS: Final[dict[str, FaultWord]] = {
    **_modbus(modbus_faults.LOST_TCP, "modbus-tcp"),
    **_modbus(modbus_faults.LOST_RTU, "modbus-rtu"),
    **{
        f"exception-{code}": FaultWord(
            words=f"exception {code}",
            kind="modbus.exception",
            target="",
            options={"code": code},
            alarm=(431, 4),
            within=lambda ctx: cycles(ctx, modbus_faults.grace(ctx)),
            lasts=_for(2.0),
            after_s=2.0,
            transports=MODBUS,
            drives=("profidrive",),
            requirements=("MODB-032", "STP-574"),
        )
        for code in (1, 2, 3, 4)
    },
    "two-answers-lost": _harmless(
        "two answers lost",
        "modbus.drop",
        options={"count": 2, "function": 3},
        transports=MODBUS,
        drives=("profidrive",),
    ),
}

ENCODER: Final[dict[str, FaultWord]] = {
    "encoder-fault": FaultWord(
        words="encoder fault of the drive",
        kind="drive.fault",
        options={"code": 0x7305},
        alarm=(411, 4),
        within=_soon(4),
        after_s=4.0,
        recovers=False,
        requirements=("TA-020",),
        transports=CAN,
    ),
    "encoder-wire": FaultWord(
        words="wire of the encoder broken",
        kind="encoder.wire_break",
        alarm=(411, 4),
        within=_soon(6, 0.02),
        after_s=4.0,
        requirements=("STP-559",),
        transports=CAN,
    ),
    "encoder-frozen": FaultWord(
        words="encoder frozen",
        kind="encoder.freeze",
        alarm=(521, 4),
        within=following_error_s,
        lasts=_for(2.0),
        after_s=4.0,
        moving=True,
        recovers=False,
        requirements=("MON-040",),
        transports=CAN,
    ),
    "encoder-jump": FaultWord(
        words="encoder jumps forwards",
        kind="encoder.jump",
        options=_jump(1),
        alarm=(521, 4),
        within=_soon(4),
        recovers=False,
        requirements=("MON-040",),
        transports=CAN,
    ),
    "encoder-jump-back": FaultWord(
        words="encoder jumps backwards",
        kind="encoder.jump",
        options=_jump(-1),
        alarm=(521, 4),
        within=_soon(4),
        recovers=False,
        requirements=("MON-040",),
        transports=CAN,
    ),
    "encoder-small-jump": _harmless(
        "encoder jumps a little",
        "encoder.jump",
        target="drive",
        options=_increments(0.038),
        requirements=("MON-040",),
    ),
    "encoder-noise": _harmless(
        "encoder noise", "encoder.noise", target="drive", options=_increments(0.0005), lasts=_for(0.3)
    ),
}

DRIVE: Final[dict[str, FaultWord]] = {
    **{
        f"trip-{code}": FaultWord(
            words=f"drive fault {code}h",
            kind="drive.fault",
            options={"code": int(code, 16)},
            within=_soon(4),
            requirements=("STP-559", "STP-252"),
        )
        for code in ("2310", "8611", "3210")
    },
    "safe-torque-off": FaultWord(
        words="safe torque off", kind="drive.sto", within=_soon(4), after_s=3.5, requirements=("STP-560",)
    ),
    **{
        name: FaultWord(
            words=name.replace("-", " "),
            kind=kind,
            options=options,
            alarm=(number, 4),
            within=_soon(6, 0.02),
            after_s=4.0,
            requirements=("STP-559",),
            transports=CAN,
        )
        for name, (kind, options, _code, number) in TRIPS.items()
        if name in {"motor-hot", "stage-hot"}
    },
    "withdrawn": FaultWord(
        words="the drive leaves operation by itself",
        kind="drive.switch_on_disabled",
        within=_soon(6),
        after_s=4.0,
        drives=("cia402",),
        transports=CAN,
        requirements=("STP-560", "STP-608"),
    ),
}

POWER: Final[dict[str, FaultWord]] = {
    "supply-lost": _lost(
        "supply of the drive lost, and back",
        "drive.power_off",
        target="drive",
        lasts=lambda ctx: grace_s(ctx) + 2.4,
        after_s=3.4,
        requirements=("TA-020", "STP-397"),
    ),
    "supply-lost-for-good": _lost(
        "supply of the drive lost for good",
        "drive.power_off",
        target="drive",
        lasts=_for(60.0),
        after_s=3.4,
        recovers=False,
        requirements=("TA-020",),
    ),
    "supply-dip": _lost(
        "supply of the drive dips",
        "drive.power_off",
        target="drive",
        lasts=_for(0.05),
        after_s=3.4,
        requirements=("TA-020",),
    ),
    "node-restart": _lost(
        "the drive restarts",
        "drive.reset",
        target="drive",
        options=lambda ctx: {"boot_s": grace_s(ctx) + 0.5},
        lasts=None,
        after_s=4.0,
        requirements=("TA-020", "C402-310"),
    ),
    "dc-link-missing": FaultWord(
        words="DC link missing",
        kind="drive.dc_link",
        options={"voltage_V": 0.0},
        within=_soon(6, 0.02),
        after_s=4.0,
        requirements=("STP-559", "C402-300"),
        transports=CAN,
    ),
    "dc-link-too-high": FaultWord(
        words="DC link too high",
        kind="drive.dc_link",
        options={"voltage_V": 900.0},
        within=_soon(6, 0.02),
        after_s=4.0,
        requirements=("STP-559", "C402-300"),
        transports=CAN,
    ),
    "brown-out": FaultWord(
        words="DC link below its threshold for 50 ms",
        kind="drive.dc_link",
        options={"voltage_V": 200.0},
        within=_soon(6, 0.02),
        lasts=_for(0.05),
        after_s=4.0,
        requirements=("STP-559", "C402-300"),
        transports=CAN,
    ),
    "mains-dip": _harmless("mains away for 20 ms", "drive.mains_off", target="drive", lasts=_for(0.02)),
    "phase-dip": _harmless("a phase away for 20 ms", "drive.phase_loss", target="drive", lasts=_for(0.02)),
    "controller-off": FaultWord(
        words="supply of the controller lost, and back",
        kind="controller.power_off",
        target="",
        alarm=None,
        lasts=_for(1.0),
        after_s=2.0,
        controller=True,
        requirements=("MC-630",),
        transports=CAN,
    ),
    "controller-stop": FaultWord(
        words="STOP of the controller, and RUN",
        kind="controller.stop",
        target="",
        alarm=None,
        lasts=_for(1.0),
        after_s=2.0,
        controller=True,
        requirements=("MC-629", "STP-506"),
        transports=CAN,
    ),
}

MACHINE: Final[dict[str, FaultWord]] = {
    "jam": FaultWord(
        words="mechanics jammed",
        kind="mechanics.jam",
        alarm=(521, 4),
        within=following_error_s,
        after_s=1.5,
        moving=True,
        requirements=("MON-040", "STP-348"),
        transports=CAN,
    ),
    "load-step": _harmless(
        "a load step",
        "mechanics.load_step",
        target="drive",
        options={"force_N": -400.0},
        lasts=_for(0.3),
        requirements=("MON-040",),
    ),
    "limit-switch": FaultWord(
        words="limit switch pressed",
        kind="switch.press",
        options={"input": "positive_limit"},
        alarm=(531, 3),
        within=lambda ctx: detection_s(ctx, 3),
        after_s=1.2,
        recovers=False,
        requirements=("LIM-034", "STP-589"),
        transports=CAN,
    ),
}

FAULTS: Final[dict[str, FaultWord]] = {
    **COMMUNICATION, **MODBUS_FAULTS, **ENCODER, **DRIVE, **POWER, **MACHINE
}  # fmt: skip
