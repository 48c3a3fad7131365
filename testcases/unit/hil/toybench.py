"""A tiny but real bench for the tests of the orchestrator: virtual time, a real CAN medium, one axis that
moves.

Controller and drive meet on the bus only. `defect` plants a mistake, so that checkers and fuzzer have
something to find.
"""

from __future__ import annotations

import hashlib
import struct
from functools import cache

from numpy.random import SeedSequence, default_rng

from fieldbus.can import CanMedium
from fieldbus.can.frame import CanFrame
from fieldbus.clock import MS, VirtualScheduler, seconds_to_ns
from fieldbus.errors import ConfigurationError
from fieldbus.history import History
from hil.record import Recorder

CYCLE_NS = 4 * MS
NODE = 5
STATUS = {
    "SWITCH_ON_DISABLED": 0x0250,
    "READY_TO_SWITCH_ON": 0x0231,
    "SWITCHED_ON": 0x0233,
    "OPERATION_ENABLED": 0x0237,
    "QUICK_STOP_ACTIVE": 0x0217,
    "FAULT_REACTION_ACTIVE": 0x021F,
    "FAULT": 0x0218,
}
STATES = (
    "DISABLED",
    "ENABLING",
    "STANDSTILL",
    "MOTION",
    "HALTING",
    "STOPPING",
    "DISABLING_RAMP",
    "DISABLING_COAST",
    "ALARM_RAMP",
    "ALARM_DRIVE_STOP",
    "ALARM_DISABLED",
)


class ToyDrive:
    """CiA 402 drive that follows its velocity at once, coasts with friction and brakes with ramps. Units: m,
    m/s.
    """

    trace_columns = (
        ("position", "m"), ("velocity", "m/s"), ("torque", "Nm"), ("controlword", ""), ("statusword", ""),
        ("error_code", ""), ("inputs", ""),
    )  # fmt: skip

    def __init__(self, scheduler, segment, history, *, name="drive1", defect=""):
        self.scheduler, self.history, self.name, self.defect = scheduler, history, name, defect
        self.position = self.velocity = self.target = self.force = 0.0
        self.state = "SWITCH_ON_DISABLED"
        self.controlword = 0
        self.error_code = 0
        self.cause = self.sto = self.jammed = self.silent = False
        self.offset = 0
        self.frozen = None
        self.forced = dict.fromkeys(("negative_limit", "positive_limit", "home", "probe1", "probe2"))
        self.inputs = 0
        self.port = segment.attach(name, self._receive)
        scheduler.every(MS, self._step)
        scheduler.every(100 * MS, self._heartbeat)

    def trace_row(self):
        return (
            self.position,
            self.velocity,
            0.0,
            self.controlword,
            STATUS[self.state],
            self.error_code,
            self.inputs,
        )

    def _go(self, state):
        if state != self.state:
            old, self.state = self.state, state
            self.history.emit(self.name, "drive.state", **{"from": old, "to": state})

    def _receive(self, frame, _time):
        if frame.can_id == 0x80:
            self._answer()
        elif frame.can_id == 0x200 + NODE and len(frame.data) == 6:
            word, speed = struct.unpack("<Hi", frame.data)
            rising = word & 0x80 and not self.controlword & 0x80
            self.controlword, self.target = word, speed * 1e-6
            self._command(word, rising)

    def _command(self, word, reset):
        state = self.state
        if state == "FAULT":
            if reset and not self.cause:
                self.error_code = 0
                self._go("SWITCH_ON_DISABLED")
            return
        if state in ("FAULT_REACTION_ACTIVE", "QUICK_STOP_ACTIVE"):
            return
        if not word & 2:
            self._go("SWITCH_ON_DISABLED")
        elif not word & 4:
            self._go("QUICK_STOP_ACTIVE" if state == "OPERATION_ENABLED" else "SWITCH_ON_DISABLED")
        elif word & 15 == 6 and not self.sto:
            self._go("READY_TO_SWITCH_ON")
        elif word & 15 == 15:
            if state == "READY_TO_SWITCH_ON":
                self._go("SWITCHED_ON")
            elif state == "SWITCHED_ON":
                self._go("OPERATION_ENABLED")

    def _brake(self, rate):
        step = rate * 0.001
        self.velocity = (
            0.0 if abs(self.velocity) <= step else self.velocity - (step if self.velocity > 0 else -step)
        )

    def _step(self):
        state = self.state
        if state == "OPERATION_ENABLED":
            self.velocity = self.target
        elif state in ("QUICK_STOP_ACTIVE", "FAULT_REACTION_ACTIVE"):
            self._brake(1.0)
            if self.velocity == 0.0:
                self._go("FAULT" if state == "FAULT_REACTION_ACTIVE" else "SWITCH_ON_DISABLED")
        elif self.defect == "creeps_without_torque" and self.scheduler.now > 50 * MS:
            self.velocity = 0.02
        else:
            self._brake(0.5)
            self.velocity += self.force * 1e-4
        if self.jammed:
            self.velocity = 0.0
        self.position += self.velocity * 0.001
        self.inputs = sum(
            bit
            for name, bit in (("negative_limit", 1), ("positive_limit", 2), ("home", 4))
            if self.forced[name]
        )

    def _answer(self):
        increments = round(self.position * 1e6) + self.offset
        if self.frozen is not None:
            increments = self.frozen
        self.port.send(
            CanFrame(
                0x180 + NODE, struct.pack("<Hi", STATUS[self.state] | self.inputs << 14 & 0xC000, increments)
            )
        )

    def _heartbeat(self):
        if not self.silent:
            self.port.send(CanFrame(0x700 + NODE, b"\x05"))

    def raise_fault(self, emcy_code, *, persistent=False):
        self.error_code, self.cause = emcy_code, persistent
        self.history.emit(self.name, "drive.fault", code=emcy_code, text=f"fault {emcy_code:04X}h")
        self.port.send(CanFrame(0x80 + NODE, struct.pack("<HB5x", emcy_code, 1)))
        if self.state in ("OPERATION_ENABLED", "QUICK_STOP_ACTIVE"):
            self._go("FAULT_REACTION_ACTIVE")
        elif self.state != "FAULT_REACTION_ACTIVE":
            self._go("FAULT_REACTION_ACTIVE")
            self._go("FAULT")

    def clear_fault_cause(self, emcy_code=None):
        self.cause = False

    def set_sto(self, active):
        self.sto = active
        if active and self.state not in ("FAULT", "FAULT_REACTION_ACTIVE"):
            self._go("SWITCH_ON_DISABLED")

    def freeze_encoder(self, frozen):
        self.frozen = round(self.position * 1e6) + self.offset if frozen else None

    def jump_encoder(self, increments):
        self.offset += increments

    def suppress_index(self, missing):
        pass

    def invert_input(self, name, inverted):
        pass

    def swap_limit_switches(self, swapped):
        pass

    def jam(self, active):
        self.jammed = active

    def set_load_force(self, newton):
        self.force = newton

    def force_input(self, name, state):
        if name not in self.forced:
            raise ConfigurationError("input", name, ", ".join(self.forced))
        self.forced[name] = state
        self.history.emit(self.name, "drive.input", input=name, state=state)

    def stop_heartbeat(self, stopped):
        self.silent = stopped

    def power_off(self):
        self.port.online = False
        self._go("NOT_READY_TO_SWITCH_ON")
        self._go("SWITCH_ON_DISABLED")

    def power_on(self):
        self.port.online = True
        self.controlword = 0
        self.port.send(CanFrame(0x700 + NODE, b"\x00"))


class ToyJob:
    """One instruction instance."""

    def __init__(self, axis, instruction, **inputs):
        axis.jobs += 1
        self.axis, self.instruction, self.name = axis, instruction, f"{axis.name}.{instruction}_{axis.jobs}"
        self.Busy = self.Done = self.Error = self.CommandAborted = False
        self.ErrorID = 0
        self.inputs = inputs

    def _emit(self, kind):
        self.axis.history.emit(
            self.axis.name, kind, job=self.name, instruction=self.instruction, error_id=self.ErrorID
        )

    def start(self):
        self.Busy = True
        self._emit("job.started")
        self._emit("job.active")
        return self

    def end(self, output, error_id=0):
        self.Busy = False
        setattr(self, output, True)
        self.ErrorID = error_id
        self._emit({"Done": "job.done", "Error": "job.error", "CommandAborted": "job.aborted"}[output])
        return self

    def set(self, **inputs):
        self.inputs.update(inputs)
        self.axis.inputs_changed(self)

    def done(self):
        return self.Done

    def ended(self):
        return self.Done or self.Error or self.CommandAborted


class ToyAlarms:
    """Raises alarms by hand."""

    def __init__(self, axis):
        self.axis, self.causes = axis, {}

    def raise_alarm(self, number, *, reaction=None, info=0):
        self.axis.alarm(number, 4 if reaction is None else reaction, f"alarm {number}")

    def set_cause(self, number, active, *, reaction=None, info=0):
        if active:
            self.causes[number] = reaction
            self.raise_alarm(number, reaction=reaction)
        else:
            self.causes.pop(number, None)


class ToyAxis:
    """Axis of the controller: trapezoidal velocity, jobs, one alarm at a time. Units: mm, mm/s."""

    trace_columns = (
        ("position_setpoint", "mm"),
        ("velocity_setpoint", "mm/s"),
        ("actual_position", "mm"),
        ("actual_velocity", "mm/s"),
        ("status_word", ""),
        ("error_word", ""),
        ("alarm_number", ""),
        ("alarm_reaction", ""),
        ("state", ""),
        ("stw1", ""),
        ("zsw1", ""),
        ("power_status", ""),
        ("power_busy", ""),
    )
    ACCELERATION, EMERGENCY = 1000.0, 4000.0

    def __init__(self, scheduler, segment, history, *, name="axis1", defect=""):
        self.scheduler, self.history, self.name, self.defect = scheduler, history, name, defect
        self.state = "DISABLED"
        self.jobs = 0
        self.alarm_number = self.alarm_reaction = 0
        self.setpoint = self.position = self.actual = self.actual_velocity = self.velocity = self.goal = (
            self.target
        ) = 0.0
        self.status, self.stw1 = 0, 0x0006
        self.positioning = False
        self.enable = self.stop_held = False
        self.job = self.power_job = self.reset_edge = None
        self.heard_ns = 0
        self.changed_state = False
        self.alarms = ToyAlarms(self)
        self.port = segment.attach("controller", self._receive)
        scheduler.every(CYCLE_NS, lambda: self.port.send(CanFrame(0x80)), priority=-10)

    def trace_row(self):
        on = self.state not in ("DISABLED", "ENABLING", "ALARM_DRIVE_STOP", "ALARM_DISABLED")
        braking = self.state in ("HALTING", "STOPPING", "DISABLING_RAMP", "ALARM_RAMP") and self.velocity
        word = on | bool(self.alarm_number) << 1 | (not self.velocity) << 12 | bool(braking) << 14
        stw1 = {0x000F: 0x047F, 0x0002: 0x047B, 0x0000: 0x047C}.get(self.stw1, 0x047E)
        return (
            self.setpoint,
            self.velocity,
            self.actual,
            self.actual_velocity,
            word,
            0x10 if self.alarm_number else 0,
            self.alarm_number,
            self.alarm_reaction,
            STATES.index(self.state),
            stw1,
            0x0237 if self.status & 0x6F == 0x27 else 0x0231,
            on,
            on or self.state != "DISABLED",
        )

    def _receive(self, frame, time_ns):
        if frame.can_id == 0x180 + NODE and len(frame.data) == 6:
            self.heard_ns = time_ns
            word, increments = struct.unpack("<Hi", frame.data)
            position = increments * 1e-3
            self.actual_velocity = (position - self.actual) / (CYCLE_NS * 1e-9)
            self.actual, self.status = position, word & 0x3FFF

    def _go(self, state):
        if state != self.state:
            old, self.state = self.state, state
            self.history.emit(self.name, "axis.state", **{"from": old, "to": state})

    def alarm(self, number, reaction, text):
        if self.alarm_number:
            return
        self.alarm_number, self.alarm_reaction = number, reaction
        self.history.emit(self.name, "alarm.raised", number=number, reaction=reaction, text=text, info=0)
        self._end_job("Error", 0x8001)
        if self.state == "DISABLED":
            return
        if reaction == 4 and self.defect != "ignores_alarms":
            self.velocity = self.goal = 0.0
            self._go("ALARM_DRIVE_STOP")
            self.stw1 = 0x0002
        elif 1 <= reaction <= 3:
            self.goal = 0.0
            self._go("ALARM_RAMP")

    def _end_job(self, output, error_id=0):
        if self.job is not None:
            job, self.job = self.job, None
            job.end(output, error_id)
            if self.defect == "done_and_error" and output == "Error":
                job.end("Done")

    def cycle(self):
        now = self.scheduler.now
        operating = self.status & 0x6F == 0x27
        state = self.state
        if state != "DISABLED" and now - self.heard_ns > 3 * CYCLE_NS:
            self.alarm(431, 4, "drive failed")
        if self.status & 0x4F in (0x08, 0x0F) and state != "DISABLED":
            self.alarm(421, 4, "drive fault")
        elif (
            state in ("STANDSTILL", "MOTION", "HALTING", "STOPPING", "ALARM_RAMP", "DISABLING_RAMP")
            and not operating
        ):
            self.alarm(421, 4, "drive has shut down")
        state = self.state
        if state == "ENABLING":
            self.setpoint = self.actual
            self.stw1 = 0x000F if self.status & 0x6F in (0x21, 0x23, 0x27) else 0x0006
            if operating:
                self._go("STANDSTILL")
        elif state in ("MOTION", "HALTING", "STOPPING", "DISABLING_RAMP", "ALARM_RAMP"):
            self._move(state)
        elif (
            state in ("ALARM_DRIVE_STOP", "DISABLING_COAST")
            and not operating
            and abs(self.actual_velocity) < 0.5
        ):
            if state == "ALARM_DRIVE_STOP":
                self._go("ALARM_DISABLED")
            else:
                self._go("DISABLED")
                self.stw1 = 0x0006
        self._reset()
        self.port.send(CanFrame(0x200 + NODE, struct.pack("<Hi", self.stw1, round(self.velocity * 1000))))

    def _move(self, state):
        rate = self.EMERGENCY if state in ("DISABLING_RAMP", "ALARM_RAMP", "STOPPING") else self.ACCELERATION
        step = rate * CYCLE_NS * 1e-9
        if self.positioning and state == "MOTION":
            rest = self.target - self.actual
            reach = (2 * self.ACCELERATION * abs(rest)) ** 0.5
            self.goal = max(-reach, min(reach, self.speed if rest > 0 else -self.speed))
            if abs(rest) < 0.05:
                self.goal = self.velocity = 0.0
                self._go("STANDSTILL")
                self._end_job("Done")
                return
        self.velocity += max(-step, min(step, self.goal - self.velocity))
        self.setpoint += self.velocity * CYCLE_NS * 1e-9
        if self.velocity == self.goal == 0.0 and state != "MOTION":
            if state == "HALTING":
                self._go("STANDSTILL")
                self._end_job("Done")
            elif state == "STOPPING":
                self._end_job("Done")
                if not self.stop_held:
                    self._go("STANDSTILL")
            elif state == "DISABLING_RAMP":
                self.stw1 = 0x0006
                self._go("DISABLED")
            else:
                self.stw1 = 0x0006
                self._go("ALARM_DISABLED")

    def _reset(self):
        if self.reset_edge is None:
            return
        job = self.reset_edge
        if self.stw1 & 0x80 == 0 and self.status & 0x4F == 0x08:
            self.stw1 = 0x0080
            job.waited = 0
            return
        job.waited = getattr(job, "waited", 0) + 1
        if self.status & 0x4F == 0x08 and job.waited < 4:
            return
        self.reset_edge = None
        self.stw1 = 0x0006 if self.stw1 & 0x80 or self.state == "ALARM_DISABLED" else self.stw1
        if self.alarm_number and self.alarm_number not in self.alarms.causes and self.status & 0x4F != 0x08:
            number, self.alarm_number, self.alarm_reaction = self.alarm_number, 0, 0
            self.history.emit(self.name, "alarm.cleared", number=number)
            if self.state in ("ALARM_DISABLED", "ALARM_DRIVE_STOP"):
                self._go("ENABLING" if self.enable else "DISABLED")
        job.end("Done")

    # -- instructions
    # -------------------------------------------------------------------------------------------

    def power(self, enable=True, *, start_mode=1, stop_mode=0):
        self.enable = enable
        if enable and self.state == "DISABLED" and not self.alarm_number:
            self._go("ENABLING")
        elif not enable and self.state not in ("DISABLED", "ALARM_DRIVE_STOP", "ALARM_DISABLED"):
            self._end_job("CommandAborted")
            self.goal = 0.0
            if stop_mode in (1, 3):
                self.velocity = 0.0
                self.stw1 = 0x0000 if stop_mode == 3 else 0x0002
                self._go("DISABLING_COAST")
            else:
                self._go("DISABLING_RAMP")
        if self.power_job is None:
            self.power_job = ToyJob(self, "MC_Power")
        return self.power_job

    def reset(self, *, restart=False):
        self.reset_edge = ToyJob(self, "MC_Reset").start()
        return self.reset_edge

    def home(self, position=0.0, *, mode=0):
        return ToyJob(self, "MC_Home").start().end("Done")

    def _begin(self, job, state):
        if self.alarm_number or self.state not in ("STANDSTILL", "MOTION", "HALTING"):
            return job.end("Error", 0x8001 if self.alarm_number else 0x800F)
        self._end_job("CommandAborted")
        self.job = job.start()
        self._go(state)
        return job

    def move_absolute(self, position, *, Velocity=-1.0, **_inputs):
        job = self._begin(ToyJob(self, "MC_MoveAbsolute"), "MOTION")
        if job.Busy:
            self.positioning, self.target = True, position
            self.speed = 100.0 if Velocity < 0 else Velocity
        return job

    def move_relative(self, distance, *, Velocity=-1.0, **_inputs):
        return self.move_absolute(self.actual + distance, Velocity=Velocity)

    def move_velocity(self, velocity, **_inputs):
        job = self._begin(ToyJob(self, "MC_MoveVelocity"), "MOTION")
        if job.Busy:
            self.positioning, self.goal = False, velocity
        return job

    def jog(self, velocity=100.0, *, backward=False):
        job = self._begin(ToyJob(self, "MC_MoveJog"), "MOTION")
        if job.Busy:
            self.positioning, self.goal = False, -velocity if backward else velocity
        return job

    def inputs_changed(self, job):
        if job.instruction == "MC_MoveJog" and job is self.job:
            self.goal = 0.0
            self._go("HALTING")
        elif job.instruction == "MC_Stop" and not job.inputs.get("Execute", True):
            self.stop_held = False
            if self.state == "STOPPING" and not self.velocity:
                self._go("STANDSTILL")

    def halt(self):
        job = self._begin(ToyJob(self, "MC_Halt"), "HALTING")
        if job.Busy:
            self.goal = 0.0
        return job

    def stop(self, mode=0):
        job = self._begin(ToyJob(self, "MC_Stop", Execute=True), "STOPPING")
        if job.Busy:
            self.goal, self.stop_held = 0.0, True
        return job


class ToyBench:
    """Satisfies `hil.protocols.Bench`."""

    kind = "virtual"

    def __init__(self, seed=0, defect=""):
        self.seed = seed
        self.scheduler = VirtualScheduler()
        self.history = History(self.scheduler)
        self.recorder = Recorder(self.history, self.scheduler)
        self.medium = CanMedium(self.scheduler, name="can0", history=self.history)
        self.toy_drive = ToyDrive(self.scheduler, self.medium, self.history, defect=defect)
        self.toy_axis = ToyAxis(self.scheduler, self.medium, self.history, defect=defect)
        self.recorder.add_bus("can0", self.medium.log)
        axis = self.toy_axis
        self._groups = [
            self.recorder.add_group(
                "axis1", axis.trace_columns, axis.trace_row, enums={"state": dict(enumerate(STATES))}
            ),
            self.recorder.add_group("drive1", self.toy_drive.trace_columns, self.toy_drive.trace_row),
        ]
        for name, value in (
            ("max_acceleration", 1000.0),
            ("max_deceleration", 1000.0),
            ("emergency_deceleration", 4000.0),
        ):
            self.recorder.set_constant(f"axis1.{name}", value)
        self._callbacks = []
        self.scheduler.every(CYCLE_NS, self._cycle, phase_ns=CYCLE_NS // 2)
        if defect == "not_repeatable":
            ToyBench.builds = getattr(ToyBench, "builds", 0) + 1
            self.scheduler.at(
                70 * MS, lambda: self.history.emit("bench", "bench.noise", builds=ToyBench.builds)
            )

    def _cycle(self):
        self.toy_axis.cycle()
        for group in self._groups:
            group.sample()
        for callback in self._callbacks:
            callback()

    def _named(self, part, name):
        if name not in (None, part.name):
            raise ConfigurationError("name", name, part.name)
        return part

    def axis(self, name=None):
        return self._named(self.toy_axis, name)

    def drive(self, name=None):
        return self._named(self.toy_drive, name)

    def segment(self, name=None):
        return self._named(self.medium, name)

    def on_cycle(self, callback):
        self._callbacks = [*self._callbacks, callback]

        def remove():
            self._callbacks = [one for one in self._callbacks if one is not callback]

        return remove

    def run_for(self, seconds):
        self.scheduler.run_for(seconds_to_ns(seconds))

    def run_until(self, predicate, timeout):
        return self.scheduler.run_until(predicate, seconds_to_ns(timeout))

    def rng(self, name):
        return default_rng(SeedSequence([self.seed, *name.encode()]))

    def cob_ids(self, drive_name):
        self.drive(drive_name)
        return {
            "sync": 0x80,
            "emcy": 0x80 + NODE,
            "tpdo1": 0x180 + NODE,
            "rpdo1": 0x200 + NODE,
            "heartbeat": 0x700 + NODE,
        }

    def decode(self, frame):
        names = {identifier: name for name, identifier in self.cob_ids("drive1").items()}
        return f"{names.get(frame.can_id, 'unknown')} {frame.data.hex()}"

    def trace(self):
        return self.recorder.trace()

    def close(self):
        pass

    def __enter__(self):
        return self

    def __exit__(self, *exception):
        self.close()


class ToyBenchFile:
    """Satisfies `hil.protocols.BenchFile`."""

    def __init__(self, defect=""):
        self.defect = defect
        self.name = "toy bench"
        self.text = f'[bench]\nname = "toy bench"\ndefect = "{defect}"\n'
        self.digest = hashlib.sha256(self.text.encode()).hexdigest()

    def build(self, *, seed):
        return ToyBench(seed, self.defect)


BENCH = ToyBenchFile()
CREEPING = ToyBenchFile("creeps_without_torque")
DEAF = ToyBenchFile("ignores_alarms")
DOUBLE = ToyBenchFile("done_and_error")
NOISY = ToyBenchFile("not_repeatable")


@cache
def found_defect():
    """Return the report of a search that finds and shrinks the defect of `DOUBLE`, for several tests."""
    from hil.fuzz import search  # most users of this bench search nothing

    return search(DOUBLE, cases=100, longest=8, seed=2, bench=f"{__name__}:DOUBLE")
