"""A made-up run that looks like a real one: for the tests of the reports and for looking at a report.

Nothing here runs a bench; the curves are formulas of `testcases.sample_signals`.
"""

from __future__ import annotations

import hashlib

import numpy as np

from reports.model import (
    AlarmRecord,
    CaseResult,
    Check,
    FaultRecord,
    Message,
    RequirementInfo,
    RunResult,
    Signal,
    Step,
    Verdict,
)
from testcases.sample_signals import Plan, make_messages, make_signals

ERRORS = {
    521: "Following error above the permitted value",
    531: "Hardware limit switch reached, or retraction impossible",
    533: "Software limit switch exceeded",
    421: "Drive enable not possible, or error controlling the drive state machine",
    431: "Communication with the drive is disturbed",
    411: "Encoder of the axis reports an error",
    412: "Range of the encoder value exceeded",
    541: "Positioning monitoring error",
}
DECELERATIONS = {0: 4000.0, 1: 1000.0, 2: 2000.0, 3: 4000.0, 4: 1000.0}


def _plans() -> list[Plan]:
    plans: list[Plan] = []

    def add(
        group: str, name: str, title: str, fault: str, target: str, alarm: int, reaction: int, **more: object
    ) -> None:
        plan = Plan(
            group,
            name,
            title,
            fault,
            target,
            alarm,
            reaction,
            ERRORS.get(alarm, ""),
            delay_ms=float(more.pop("delay", 8.0)),
            limit_ms=float(more.pop("limit", 20.0)),
            deceleration=DECELERATIONS[reaction],
            requirements=list(more.pop("req", ())),
            **more,
        )
        plans.append(plan)

    travel = {0: 11.25, 1: 45.0, 2: 22.5, 3: 11.25, 4: 45.0}
    for mode, (reaction, name) in enumerate(
        ((3, "emergency ramp"), (4, "immediate stop"), (2, "maximum dynamics"), (1, "coast"))
    ):
        for phase in ("accelerating", "constant", "stationary"):
            add(
                "stop-modes",
                f"mc-power-{mode}/{phase}",
                f"MC_Power StopMode {mode} while {phase}: {name}",
                "controller.enable_removed",
                "axis1",
                0,
                reaction,
                req=[f"STP-{8 + mode:03d}", "STP-498"],
                speed={"accelerating": 180.0, "constant": 300.0, "stationary": 0.0}[phase],
                distance_low=0.0,
                distance_high=travel[reaction] * 1.4,
                tags=("stop", phase),
            )
    for number, reaction, fault, target in (
        (521, 4, "mechanics.jam", "drive1"),
        (521, 4, "encoder.freeze", "drive1"),
        (531, 4, "switch.positive_limit", "drive1"),
        (533, 3, "mechanics.load_force", "drive1"),
        (411, 4, "encoder.jump", "drive1"),
        (421, 4, "drive.sto", "drive1"),
    ):
        for state in ("MOTION", "HALTING"):
            add(
                "alarm-reactions",
                f"alarm-{number}/{fault}/{state.lower()}",
                f"{fault} in {state}: alarm {number}, reaction {reaction}",
                fault,
                target,
                number,
                reaction,
                req=["STP-343", "TA-012"],
                tags=("alarm", state.lower()),
                delay=6.0 + number % 7,
            )
    for fault in (
        "can.drop",
        "can.delay",
        "can.corrupt",
        "can.duplicate",
        "can.bus_off",
        "canopen.heartbeat_stop",
    ):
        for count in (1, 8):
            heavy = count == 8 and fault in {"can.drop", "can.bus_off", "canopen.heartbeat_stop"}
            add(
                "bus-faults",
                f"{fault}/tpdo1/x{count}",
                f"{fault} of TPDO1, {count} frame{'s' * (count > 1)}",
                fault,
                "can0:0x181",
                431 if heavy else 0,
                4 if heavy else 0,
                req=["C301-044", "C402-091"],
                tags=("bus", "soft" if count == 1 else "hard"),
                limit=40.0,
                delay=32.0 if heavy else 0.0,
                lasting_ms=count * 4.0,
            )
    for index in range(9):
        add(
            "fuzz",
            f"seed-{4100 + 17 * index}",
            f"Random faults, script {index + 1} of 9",
            "can.drop" if index % 2 else "drive.emcy",
            "drive1",
            431 if index % 3 else 421,
            4,
            req=[],
            tags=("fuzz",),
            delay=9.0 + index,
            fault_s=0.62 + 0.037 * index,
        )

    def change(name: str, **values: object) -> None:
        plan = next(plan for plan in plans if plan.name == name)
        for key, value in values.items():
            setattr(plan, key, value)

    change("alarm-521/encoder.freeze/motion", verdict=Verdict.FAILED, delay_ms=48.0)
    change("mc-power-1/constant", verdict=Verdict.FAILED, deceleration=640.0)
    change("alarm-531/switch.positive_limit/motion", verdict=Verdict.FAILED, creep=True)
    change("can.bus_off/tpdo1/x8", verdict=Verdict.FAILED, alarm=0, reaction=0)
    change(
        "can.corrupt/tpdo1/x8",
        verdict=Verdict.BLOCKED,
        message="can.corrupt cannot be injected: the adapter of can0 (socketcan, can0) cannot send error "
        "frames",
    )
    change(
        "can.corrupt/tpdo1/x1",
        verdict=Verdict.BLOCKED,
        message="can.corrupt cannot be injected: the adapter of can0 (socketcan, can0) cannot send error "
        "frames",
    )
    change(
        "seed-4185",
        verdict=Verdict.ERROR,
        message="SchedulerError: event at 1204000000 ns is in the past (now 1204250000 ns)\n\nTraceback "
        "(most recent call last):\n  ...",
    )
    return plans


def make_case(plan: Plan, index: int, *, samples: int = 1500) -> CaseResult:
    """Return one case of the made-up run."""
    rng = np.random.default_rng([20260113, index])
    blocked, broken = plan.verdict is Verdict.BLOCKED, plan.verdict is Verdict.ERROR
    case = CaseResult(
        identifier=f"{plan.group}/{plan.name}",
        title=plan.title,
        verdict=plan.verdict,
        message=plan.message,
        group=plan.group,
        tags=list(plan.tags),
        requirements=plan.requirements,
        seed=20260113 + index,
        token=f"h1.{hashlib.sha256(plan.name.encode()).hexdigest()[:24]}",
        simulated_s=0.0 if blocked else 1.5,
        wall_s=0.002 if blocked else 0.071 + 0.0007 * index,
        trace_digest="" if blocked else hashlib.sha256(f"trace {plan.name}".encode()).hexdigest(),
    )
    end = plan.fault_s + plan.lasting_ms / 1000 if plan.lasting_ms else None
    state = "HALTING" if "halting" in plan.tags else ("STANDSTILL" if plan.speed == 0 else "MOTION")
    case.faults = [
        FaultRecord(
            plan.fault,
            plan.target,
            0.2,
            None if blocked else plan.fault_s,
            None if blocked else end,
            {"count": 8, "duration_ms": plan.lasting_ms} if plan.lasting_ms else {},
            f"time >= {plan.fault_s:g} s",
            "" if blocked else state,
        )
    ]
    if blocked:
        case.story = [
            Step(0.0, "do", "Bench prepared", {"bench": "desk.toml"}),
            Step(0.0, "observe", plan.message),
        ]
        return case
    signals, facts = make_signals(plan, samples, rng)
    case.signals = signals
    case.messages = make_messages(plan, signals)
    case.files = {"bus log": f"evidence/{plan.name}/can0.log", "trace": f"evidence/{plan.name}/trace.npz"}
    alarm_at, stop_at, rest_at = facts["alarm_at"], facts["stop_at"], facts["rest_at"]
    story = [
        Step(0.0, "do", "Drive and axis switched on"),
        Step(0.06, "do", "MC_Power: Enable", {"StartMode": 1, "StopMode": 0}),
        Step(0.14, "observe", "Axis enabled, drive in Operation enabled"),
        Step(0.2, "do", f"MC_MoveVelocity {plan.speed:g} mm/s", {"Acceleration": 1000.0, "Jerk": 10000.0}),
        Step(0.2 + plan.speed / 1000, "observe", "InVelocity"),
        Step(plan.fault_s, "inject", f"{plan.fault} on {plan.target}", dict(case.faults[0].parameters)),
    ]
    if plan.alarm:
        case.alarms.append(AlarmRecord(alarm_at, "axis1", plan.alarm, plan.reaction, plan.alarm_text, None))
        story.append(
            Step(alarm_at, "observe", f"Alarm {plan.alarm}, reaction {plan.reaction}: {plan.alarm_text}")
        )
        delay = (alarm_at - plan.fault_s) * 1000
        late = delay > plan.limit_ms
        case.checks.append(
            Check(
                f"alarm {plan.alarm}",
                Verdict.FAILED if late else Verdict.PASSED,
                f"within {plan.limit_ms:g} ms",
                f"came after {delay:g} ms",
                alarm_at,
                delay,
                "ms",
                None,
                plan.limit_ms,
                plan.requirements[:1],
                since_s=plan.fault_s,
            )
        )
        case.checks.append(
            Check(
                "reaction",
                Verdict.PASSED,
                f"reaction {plan.reaction} (remove enable)",
                f"reaction {plan.reaction}",
                alarm_at,
            )
        )
    elif plan.name == "can.bus_off/tpdo1/x8":
        case.checks.append(
            Check(
                "alarm 431",
                Verdict.FAILED,
                "within 40 ms",
                "never came",
                plan.fault_s + 0.04,
                None,
                "ms",
                None,
                40.0,
                ["COM-031"],
                since_s=plan.fault_s,
            )
        )
    if np.isfinite(rest_at):
        story.append(Step(rest_at, "observe", "Axis at rest"))
        travel = facts["travel"]
        far = travel > plan.distance_high
        case.checks.append(
            Check(
                "stop distance",
                Verdict.FAILED if far else Verdict.PASSED,
                f"at most {plan.distance_high:g} mm",
                f"{travel:.2f} mm",
                rest_at,
                travel,
                "mm",
                plan.distance_low,
                plan.distance_high,
                plan.requirements[:1],
                since_s=stop_at,
            )
        )
        ramp = (rest_at - stop_at) * 1000
        nominal = plan.speed / DECELERATIONS[plan.reaction] * 1000
        off = abs(ramp - nominal) > 25
        case.checks.append(
            Check(
                "ramp time",
                Verdict.FAILED if off else Verdict.PASSED,
                f"{nominal:g} ms ± 25 ms",
                f"{ramp:.1f} ms",
                rest_at,
                ramp,
                "ms",
                nominal - 25,
                nominal + 25,
                since_s=stop_at,
            )
        )
        rest = 4.5 if plan.creep else 0.0
        case.checks.append(
            Check(
                "standstill velocity",
                Verdict.FAILED if plan.creep else Verdict.PASSED,
                "never above 1 mm/s after the stop",
                f"{rest:g} mm/s" + (" 12 ms after standstill" if plan.creep else ""),
                rest_at + 0.012,
                rest,
                "mm/s",
                -1.0,
                1.0,
                ["STP-361"],
                signal="axis1.actual_velocity",
                since_s=rest_at,
            )
        )
    if not plan.alarm:
        case.checks.append(
            Check(
                "following error",
                Verdict.PASSED,
                "stays below 10 mm",
                f"peak {facts['peak']:.3f} mm",
                0.45,
                facts["peak"],
                "mm",
                -10.0,
                10.0,
                signal="axis1.following_error",
                since_s=0.2,
            )
        )
    story += [
        Step(check.time_s or 0.0, "expect", f"{check.name}: {check.expected}", {"observed": check.observed})
        for check in case.checks
    ]
    case.story = sorted(story, key=lambda step: step.time_s)
    if broken:
        case.checks = case.checks[:1]
    return case


CATALOGUE = [
    "can.bus_off",
    "can.corrupt",
    "can.delay",
    "can.drop",
    "can.duplicate",
    "can.inject",
    "canopen.heartbeat_stop",
    "canopen.sdo_abort",
    "controller.enable_removed",
    "controller.task_overrun",
    "drive.emcy",
    "drive.sto",
    "encoder.freeze",
    "encoder.jump",
    "mechanics.backlash",
    "mechanics.jam",
    "mechanics.load_force",
    "switch.negative_limit",
    "switch.positive_limit",
]


def sample_run(*, samples: int = 1500) -> RunResult:
    """Return 45 cases: 38 passed, 4 failed, 2 blocked, 1 error."""
    run = RunResult(
        title="Stop modes and alarm reactions",
        seed=20260113,
        bench_name="desk",
        bench_text=(
            '[bench]\nname = "desk"\nmode = "virtual"\nseed = 20260113\n\n[bus.can0]\nkind = "can"\nbitrate '
            "= 1_000_000\n\n"
            '[drive.drive1]\nbus = "can0"\nnode = 1\nprofile = "cia402"\nmode = "csv"\ndevice = '
            '"emulated"\n\n'
            '[axis.axis1]\ndrive = "drive1"\nkind = "positioning"\nlead_screw_mm = 10.0\nmax_velocity_mm_s '
            "= 500.0\n"
        ),
        environment={
            "motion-hil": "0.1.0",
            "commit": "ff71c75",
            "python": "3.11.7",
            "numpy": "2.4.6",
            "canopen": "2.4.1",
            "python-can": "4.6.1",
            "machine": "x86_64, 2 cores",
            "system": "Linux 6.1.0 (Debian 12)",
        },
        started="2026-01-13T09:41:07+01:00",
        fault_catalogue=CATALOGUE,
    )
    run.cases = [make_case(plan, index, samples=samples) for index, plan in enumerate(_plans())]
    used = {identifier for case in run.cases for identifier in case.requirements} | {"COM-031", "STP-361"}
    for prefix, count, document in (
        ("STP", 40, "s7-enable-motion-stop"),
        ("C402", 100, "cia402"),
        ("C301", 50, "cia301"),
        ("COM", 35, "communication"),
    ):
        for number in range(1, count + 1):
            identifier = f"{prefix}-{number:03d}"
            run.requirements.append(
                RequirementInfo(
                    identifier, f"Rule {number} of {document}", f"{1 + number // 10}.{number % 10}", document
                )
            )
    for identifier in sorted(used - {info.identifier for info in run.requirements} - {"STP-498"}):
        run.requirements.append(
            RequirementInfo(identifier, f"Rule {identifier}", "9.2", "s7-enable-motion-stop")
        )
    return run


HOSTILE = (
    "</script><script>window.pwned=1</script>",
    "<img src=x onerror=window.pwned=1>",
    "\"'><svg onload=window.pwned=1>",
    "{{ 7*7 }}{% raw %}${window.pwned=1}`",
    "<!--<script>",
    "]]>&lt;&amp;",
    "nul\x00bell\x07escape\x1b[31m",
    "line\u2028separator\u2029 \u202egnirts",
    "lone \ud800 surrogate \ufffe",
    "javascript:window.pwned=1",
    "µ Ω 轴 🚨 ‰",
)


def hostile_run() -> RunResult:
    """Return a run whose every text is an attempt to break out of HTML, JavaScript, JSON or XML."""
    run = RunResult(
        title=HOSTILE[0],
        seed=1,
        bench_name=HOSTILE[1],
        bench_text="\n".join(HOSTILE),
        environment={text: text for text in HOSTILE},
        started=HOSTILE[2],
        fault_catalogue=list(HOSTILE),
    )
    time = np.linspace(0, 1, 50)
    for index, text in enumerate(HOSTILE):
        run.requirements.append(RequirementInfo(text, text, text, text))
        run.cases.append(
            CaseResult(
                identifier=text,
                title=text,
                verdict=list(Verdict)[index % 4],
                message=text,
                group=text,
                tags=[text, "x"],
                requirements=[text],
                seed=index,
                token=text,
                trace_digest=text,
                story=[Step(0.1, text, text, {text: text}), Step(0.2, "inject", text)],
                checks=[
                    Check(
                        text,
                        Verdict.FAILED,
                        text,
                        text,
                        0.5,
                        float("nan"),
                        text,
                        float("-inf"),
                        1.0,
                        [text],
                        signal=text,
                    )
                ],
                alarms=[AlarmRecord(0.5, text, 1, 99, text)],
                faults=[FaultRecord(text, text, 0.1, 0.2, float("inf"), {text: text}, text, text)],
                messages=[Message(0.3, text, 0x123, text, text, text, text)],
                signals=[
                    Signal(text, text, time, np.sin(time)),
                    Signal(text + ".state", "", time, np.round(time), {0: text, 1: text}),
                    Signal(text + ".gaps", "mm", time, np.where(time > 0.5, np.nan, time)),
                ],
                files={text: text},
            )
        )
    return run
