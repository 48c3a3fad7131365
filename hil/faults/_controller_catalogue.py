"""The catalogue: faults of the controller itself."""

from __future__ import annotations

from typing import Final

from hil.faults._parameters import FaultType, Parameter

CONTROLLER_FAULTS: Final[tuple[FaultType, ...]] = (
    FaultType(
        "controller.stop",
        "The controller goes to STOP, and to RUN at the end: a warm restart",
        "controller",
        "operating state",
        remark="afterwards nothing is enabled; the instances of the program begin anew",
        example={"kind": "controller.stop", "duration_s": 1.0},
    ),
    FaultType(
        "controller.breakpoint",
        "The program meets a breakpoint: MC_Servo overflows, STOP, the technology objects are restarted; "
        "RUN at the end",
        "controller",
        "operating state",
        example={"kind": "controller.breakpoint", "duration_s": 1.0},
    ),
    FaultType(
        "controller.power_off",
        "The supply of the controller is cut; at the end it starts anew",
        "controller",
        "supply",
        remark="its buses fall silent; the drives are taken into service again afterwards",
        example={"kind": "controller.power_off", "duration_s": 0.5},
    ),
    FaultType(
        "controller.overrun",
        "MC_Servo or MC_Interpolator takes long; too long ends in STOP, which lasts longer than the fault",
        "controller",
        "execution level",
        (
            Parameter(
                "level", "text", "Level that takes long", default="servo", choices=("servo", "interpolator")
            ),
            Parameter("time_ms", "float", "Time that every call takes", "ms", 0.0, 1000.0, required=True),
        ),
        remark="outputs come later by the time of MC_Servo; setpoints are missing while MC_Interpolator "
        "is late",
        example={
            "kind": "controller.overrun",
            "duration_s": 0.1,
            "parameters": {"level": "interpolator", "time_ms": 5.0},
        },
    ),
    FaultType(
        "controller.stall",
        "All levels hang, and the controller does not notice: no inputs, no telegrams; SYNC and "
        "heartbeat go on",
        "controller",
        "execution level",
        example={"kind": "controller.stall", "duration_s": 0.2},
    ),
)
