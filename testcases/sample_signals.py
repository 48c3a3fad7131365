"""Signals and bus messages of a made-up axis: a few formulas, 300 mm/s, a fault, a reaction with its own
ramp.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reports.model import Message, Signal, Verdict

AXIS_STATES = dict(
    enumerate(
        (
            "DISABLED",
            "ENABLING",
            "ENABLE_RAMP",
            "STANDSTILL",
            "MOTION",
            "HALTING",
            "STOPPING",
            "STOP_HOLD",
            "ALARM_RAMP",
            "ALARM_STANDSTILL",
            "ALARM_DRIVE_STOP",
            "ALARM_DISABLED",
            "DISABLING_RAMP",
            "DISABLING_QUICK",
            "DISABLING_COAST",
            "TRACKING",
            "RESTARTING",
        )
    )
)
DRIVE_STATES = {
    0: "Not ready",
    1: "Switch on disabled",
    2: "Ready to switch on",
    3: "Switched on",
    4: "Operation enabled",
    5: "Quick stop active",
    6: "Fault reaction",
    7: "Fault",
}
STATUSWORDS = (0x0200, 0x0250, 0x0231, 0x0233, 0x0637, 0x0617, 0x021F, 0x0218)


@dataclass
class Plan:
    """What happens in one made-up case."""

    group: str
    name: str
    title: str
    fault: str
    target: str
    alarm: int
    reaction: int
    alarm_text: str
    delay_ms: float
    limit_ms: float
    deceleration: float
    requirements: list[str]
    verdict: Verdict = Verdict.PASSED
    speed: float = 300.0
    fault_s: float = 0.8
    tags: tuple[str, ...] = ()
    lasting_ms: float | None = 60.0
    distance_low: float = 0.0
    distance_high: float = 60.0
    message: str = ""
    creep: bool = False


def make_signals(plan: Plan, samples: int, rng: np.random.Generator) -> tuple[list[Signal], dict[str, float]]:
    time = np.arange(samples) * (1.5 / samples) + 0.00005
    step = 1.5 / samples
    injected = plan.verdict is not Verdict.BLOCKED
    alarm_at = plan.fault_s + plan.delay_ms / 1000 if plan.alarm and injected else np.inf
    stop_at = alarm_at if plan.alarm else (plan.fault_s if plan.fault.startswith("controller") else np.inf)
    velocity = np.zeros(samples)
    state = np.zeros(samples)
    drive = np.full(samples, 1.0)
    v = 0.0
    rest_at = np.inf
    for i, t in enumerate(time):
        if t < 0.06:
            state[i], drive[i] = 0, 1
        elif t < 0.14:
            state[i], drive[i] = 1, 2 + (t > 0.09) + (t > 0.12)
        elif t >= stop_at:
            v = max(0.0, v - plan.deceleration * step)
            if v == 0.0:
                rest_at = min(rest_at, t)
            hard = plan.reaction == 4
            state[i] = (
                (11 if v == 0 else (10 if hard else 8))
                if plan.alarm
                else (0 if v == 0 else (13 if hard else 12))
            )
            drive[i] = 1 if v == 0 else (5 if hard else 4)
            if plan.fault in {"drive.sto", "drive.emcy"}:
                drive[i] = 7 if v == 0 else 6
        else:
            target = plan.speed if 0.2 < t < 1.3 else 0.0
            v += float(np.clip(target - v, -1000 * step, 1000 * step))
            state[i], drive[i] = (4 if v > 0 else 3), 4
    velocity[:] = [0.0] * samples
    v = 0.0
    for i, t in enumerate(time):
        if t >= stop_at:
            v = max(0.0, v - plan.deceleration * step)
        elif t >= 0.14:
            target = plan.speed if 0.2 < t < 1.3 else 0.0
            v += float(np.clip(target - v, -1000 * step, 1000 * step))
        velocity[i] = v
    lag = np.convolve(np.concatenate([np.zeros(8), velocity]), np.ones(9) / 9, mode="valid")
    actual_v = lag + rng.normal(0, 0.35, samples) * (lag > 0)
    setpoint = np.cumsum(velocity) * step
    actual = np.cumsum(lag) * step
    if injected and plan.fault in {"encoder.freeze", "mechanics.jam"}:
        held = (time >= plan.fault_s) & (time < plan.fault_s + (plan.lasting_ms or 60) / 1000)
        frozen = np.interp(plan.fault_s, time, actual)
        after = time >= plan.fault_s + (plan.lasting_ms or 60) / 1000
        actual[held] = frozen
        if plan.fault == "mechanics.jam":
            actual[after] -= actual[after][0] - frozen if after.any() else 0
            actual_v[held] = 0
    if plan.creep:
        late = time >= rest_at
        actual_v[late] += 4.5
        actual[late] += 4.5 * (time[late] - rest_at)
    acceleration = np.gradient(velocity, step)
    torque = acceleration / 1000 * 1.9 + (lag > 0) * 0.62 + rng.normal(0, 0.03, samples)
    error = setpoint - actual
    alarm = np.where(time >= alarm_at, plan.alarm, 0.0)
    moving = lag > 0
    enabled = (state >= 2) & (state != 11)
    status = enabled * 1 + (alarm > 0) * 2 + (~moving) * 0x80 + moving * 0x8000
    names: list[tuple[str, str, np.ndarray, dict[int, str]]] = [
        ("axis1.state", "", state, AXIS_STATES),
        ("axis1.position_setpoint", "mm", setpoint, {}),
        ("axis1.actual_position", "mm", actual, {}),
        ("axis1.velocity_setpoint", "mm/s", velocity, {}),
        ("axis1.actual_velocity", "mm/s", actual_v, {}),
        ("axis1.acceleration_setpoint", "mm/s2", acceleration, {}),
        ("axis1.following_error", "mm", error, {}),
        ("axis1.actual_speed", "rpm", actual_v * 6, {}),
        ("axis1.speed_output", "rpm", velocity * 6, {}),
        ("axis1.actual_torque", "Nm", torque, {}),
        ("axis1.status_word", "", status.astype(float), {}),
        ("axis1.error_word", "", (alarm > 0) * 4.0, {}),
        ("axis1.alarm_number", "", alarm, {}),
        ("axis1.power_status", "", enabled * 1.0, {}),
        ("axis1.communication_ok", "", np.ones(samples), {}),
        ("drive1.state", "", drive, DRIVE_STATES),
        ("drive1.position", "m", actual / 1000, {}),
        ("drive1.motor_speed", "rpm", actual_v * 6, {}),
        ("drive1.torque", "Nm", torque, {}),
        ("drive1.torque_demand", "Nm", acceleration / 1000 * 1.9 + moving * 0.6, {}),
        ("drive1.encoder_increments", "inc", np.rint(actual * 13107.2), {}),
        (
            "drive1.controlword",
            "",
            np.where(drive == 4, 0x0F, np.where(drive == 5, 0x02, 0x06)).astype(float),
            {},
        ),
        ("drive1.statusword", "", np.array([STATUSWORDS[int(value)] for value in drive], dtype=float), {}),
        ("drive1.brake_closed", "", (drive < 4) * 1.0, {}),
        ("drive1.error_code", "", np.where(drive >= 6, 0x8611, 0.0), {}),
    ]
    signals = [
        Signal(name, unit, time, np.asarray(values, dtype=np.float64), enum)
        for name, unit, values, enum in names
    ]
    facts = {"alarm_at": float(alarm_at), "stop_at": float(stop_at), "rest_at": float(rest_at)}
    facts["travel"] = float(
        np.interp(min(rest_at, 1.499), time, actual) - np.interp(min(stop_at, 1.499), time, actual)
    )
    facts["peak"] = float(np.abs(error).max())
    return signals, facts


def make_messages(plan: Plan, signals: list[Signal]) -> list[Message]:
    by_name = {signal.name: signal for signal in signals}
    time = by_name["axis1.state"].time_s
    found: list[Message] = []
    dropped = plan.fault == "can.drop" and plan.verdict is not Verdict.BLOCKED
    for k in range(int(1.5 / 0.004)):
        t = k * 0.004
        i = min(len(time) - 1, int(t / 1.5 * len(time)))
        control, status = (
            int(by_name["drive1.controlword"].values[i]),
            int(by_name["drive1.statusword"].values[i]),
        )
        speed, position = (
            int(by_name["axis1.speed_output"].values[i] * 1000),
            int(by_name["drive1.encoder_increments"].values[i]),
        )
        permille = int(by_name["axis1.actual_torque"].values[i] / 4.8 * 1000)
        hit = dropped and plan.fault_s <= t < plan.fault_s + (plan.lasting_ms or 4) / 1000
        found.append(Message(t + 47e-6, "can0", 0x80, "", "controller", "SYNC"))
        found.append(
            Message(
                t + 178e-6,
                "can0",
                0x181,
                (
                    status.to_bytes(2, "little")
                    + position.to_bytes(4, "little", signed=True)
                    + permille.to_bytes(2, "little", signed=True)
                ).hex(),
                "drive1",
                f"TPDO1 drive1: Statusword {status:04X}h, Position {position:,}, Torque {permille} ‰".replace(
                    ",", " ", 0
                ),
                "dropped by fault can.drop" if hit else "",
            )
        )
        found.append(
            Message(
                t + 2e-3 + 120e-6,
                "can0",
                0x201,
                (control.to_bytes(2, "little") + speed.to_bytes(4, "little", signed=True) + b"\x09").hex(),
                "controller",
                f"RPDO1 drive1: Controlword {control:04X}h, Target velocity {speed:,}, Mode csv",
            )
        )
    if plan.fault in {"drive.emcy", "drive.sto"}:
        found.append(
            Message(
                plan.fault_s + 0.0004,
                "can0",
                0x81,
                "1186010000000000",
                "drive1",
                "EMCY drive1: 8611h following error, register 01h",
            )
        )
    if plan.fault == "can.delay":
        found.append(
            Message(
                plan.fault_s + 0.0011,
                "can0",
                0x181,
                "",
                "drive1",
                "TPDO1 drive1",
                "CRC error, error frame, retransmitted",
            )
        )
    return sorted(found, key=lambda message: message.time_s)
