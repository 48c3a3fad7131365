"""Benches on which every kind of fault of the catalogue can be seen, and what has to go on there for it to be
seen.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

from fieldbus.can import CanFrame
from hil.bench import BenchFile, load_bench
from hil.faults import FaultType, Injector
from hil.record._trace import event_json

ENCODER = """
[encoder.encoder1]
segment = "can0"
node_id = 20
on = "drive1"
offset_deg = 36000.0
cyclic_timer_ms = 10
"""
SERVO = """
[drive.drive1.brake]
torque_nm = 5.0

[drive.drive1.safety]
interlock = "inhibit"

[drive.drive1.supply]
chopper_on_v = 566.0
chopper_off_v = 563.0
"""
SAFETY = """
[drive.drive1.profidrive]
safety_telegram = 701

[drive.drive1.safety]
ss1_time_ms = 1000.0
ss2_time_ms = 1000.0
sls_limits_mm_s = [50.0]
sls_delay_ms = 20.0
slp_ranges_mm = [[-100.0, 0.0]]
"""


def _file(name: str, tables: str = "") -> BenchFile:
    return BenchFile(
        f"{name}.toml", load_bench(name).text.replace("[axis.axis1]\n", f"{tables}\n[axis.axis1]\n")
    )


FILES: dict[str, Callable[[], BenchFile]] = {
    "servo": lambda: _file("reference", SERVO + ENCODER),
    "hanging": lambda: _file("reference", SERVO + "\n[drive.drive1.mechanics]\ngravity_n = -400.0\n"),
    "small link": lambda: _file("reference", "\n[drive.drive1.supply]\ncapacitance_uf = 50.0\n"),
    "home": lambda: _file("reference", "\n[drive.drive1.mechanics]\nstart_position_mm = -510.0\n"),
    "profidrive": lambda: _file("profidrive", SAFETY),
    "tcp": lambda: _file("profidrive_tcp"),
    "rtu": lambda: _file("profidrive_rtu"),
    "analog": lambda: _file("analog"),
    "stepper": lambda: _file("stepper"),
    "cam": lambda: _file("reference", "\n[cam.knife]\npoints = [[0.0, 0.0], [90.0, 20.0]]\n"),
    "proxy": lambda: _file(
        "reference", '\n[controller.plc2]\n\n[proxy.line]\naxis = "axis1"\nplc = "plc2"\n'
    ),
}


@cache
def bench_file(name: str) -> BenchFile:
    """Return one of the bench files, read once."""
    return FILES[name]()


@dataclass(frozen=True)
class Situation:
    """What goes on while a kind of fault acts."""

    bench: str = "servo"
    before: str = "moving"
    """`moving`, `standing` (enabled), `disabled`, `violated` (a safety limit)."""
    meanwhile: str = ""
    """What is done while the fault acts: disable, enable, push, press, crowd; or SDO requests, hexadecimal.
    """
    acts_s: float = 0.15
    """How long it acts."""
    velocity: float = 100.0
    """mm/s."""


DEFAULTS = {
    "safety.": "profidrive",
    "telegram.": "profidrive",
    "modbus.": "tcp",
    "io.": "analog",
    "terminal.": "analog",
    "pto.": "stepper",
    "cam.": "cam",
    "proxy.": "proxy",
}
SITUATIONS = {
    "axis.no_leading_value": Situation("proxy"),
    "controller.clock_drift": Situation("proxy", acts_s=0.5),
    "can.transmit_overrun": Situation(meanwhile="crowd"),
    "drive.brake_slip": Situation("hanging", "disabled"),
    "drive.brake_stuck": Situation("hanging", "disabled", "enable"),
    "drive.brown_out": Situation("small link", velocity=400.0, acts_s=0.4),
    "drive.chopper_failure": Situation(meanwhile="push", velocity=400.0, acts_s=0.3),
    "drive.slow_ramp": Situation(meanwhile="disable"),
    "drive.statusword_stuck": Situation(meanwhile="disable"),
    "drive.refuse_transition": Situation(before="disabled", meanwhile="enable"),
    "drive.heartbeat_late": Situation(acts_s=0.5),
    "drive.mode_display": Situation(meanwhile="4061600000000000"),
    "drive.sdo_abort": Situation(meanwhile="4060600000000000"),
    "drive.sdo_timeout": Situation(meanwhile="4060600000000000"),
    "safety.acknowledge": Situation("profidrive", "violated"),
    "encoder.error": Situation("profidrive"),
    # A probe on the index, then the question what it has seen.
    "encoder.index_missing": Situation(meanwhile="2bb8600015000000 40b9600000000000", acts_s=0.3),
    "switch.stuck": Situation("home"),
    "switch.swapped": Situation(before="standing", meanwhile="press"),
    "io.stuck": Situation("analog", meanwhile="disable"),
    "io.swapped": Situation("analog", meanwhile="press"),
    "modbus.crc": Situation("rtu"),
    "modbus.noise": Situation("rtu"),
    "modbus.broadcast": Situation("rtu"),
}


def situation_of(entry: FaultType) -> Situation:
    """Return where a kind is seen."""
    family = entry.name[: entry.name.index(".") + 1]
    return SITUATIONS.get(entry.name, Situation(DEFAULTS.get(family, "servo")))


class Stage:
    """A bench in a situation."""

    def __init__(self, situation: Situation, seed: int = 11) -> None:
        self.situation = situation
        self.bench: Any = bench_file(situation.bench).build(seed=seed)
        self.faults = Injector(self.bench)
        self.axis = self.bench.axis()
        self.power = self.axis.power(situation.before != "disabled")
        if situation.before == "disabled":
            self.bench.run_for(0.1)
            return
        assert self.bench.run_until(self.power.status, 3.0)
        if situation.before != "standing":
            self.axis.move_velocity(situation.velocity)
            self.bench.run_for(0.05 + situation.velocity / 1000.0)
        if situation.before == "violated":
            self.bench.drive().set_slp(1)
            self.bench.run_for(0.2)
            self.bench.drive().set_slp(None)
            self.bench.run_for(0.1)

    def act(self) -> None:
        """Let pass what goes on while the fault acts."""
        meanwhile = self.situation.meanwhile
        if meanwhile and meanwhile[0].isdigit():
            pause = self.situation.acts_s / (1 + meanwhile.count(" "))
            for request in meanwhile.split():
                self.bench.segment().inject(CanFrame(0x605, bytes.fromhex(request)), sender="tool")
                self.bench.run_for(pause)
            return
        getattr(self, f"_{meanwhile or 'nothing'}")()
        self.bench.run_for(self.situation.acts_s)

    def _nothing(self) -> None:
        """Go on."""

    def _disable(self) -> None:
        self.power.set(Enable=False)

    def _enable(self) -> None:
        self.power.set(Enable=True)

    def _push(self) -> None:
        """Let the load drive the motor, which then feeds the DC link."""
        self.bench.drive().set_load_force(2500.0)

    def _press(self) -> None:
        self.bench.drive().force_input("positive_limit", True)

    def _crowd(self) -> None:
        """Let the drive want to send more than one frame at once."""
        (port,) = (port for port in self.bench.segment().ports if port.name == "drive1")
        for number in range(4):
            port.send(CanFrame(0x710 + number))

    def recover(self) -> str:
        """Do what an operator does when the cause is gone, and move by 5 mm; returns what goes wrong then, or
        nothing.
        """
        bench, axis = self.bench, self.axis
        drive = bench.drive()
        if self.situation.meanwhile == "press":
            drive.force_input("positive_limit", None)
        if self.situation.meanwhile == "push":
            drive.set_load_force(0.0)
        if bench.controller.state.value != "RUN":
            bench.controller.run()
        bench.run_for(0.05)
        bench.run_until(lambda: axis.port.link_ok, 3.0)  # supplies come back, nodes boot
        self.power.set(Enable=False)
        bench.run_for(0.1)
        bench.run_until(lambda: abs(drive.mechanics.velocity) < 1e-4, 3.0)
        if self.situation.bench == "profidrive":
            drive.acknowledge_safety()
        for _ in range(2):
            reset = axis.reset()
            bench.run_until(lambda job=reset: job.Done or job.Error, 2.0)
        self.power.set(Enable=True)
        if not bench.run_until(self.power.status, 3.0):
            return "the axis cannot be enabled"
        bench.run_for(0.1)
        begin, shown = drive.mechanics.position, axis.var("ActualPosition")
        job = axis.move_relative(5.0)
        if not bench.run_until(lambda: job.Done or job.Error or job.CommandAborted, 3.0) or not job.Done:
            return f"the axis does not move: {job}"
        moved = (drive.mechanics.position - begin) * 1000.0, axis.var("ActualPosition") - shown
        return "" if all(abs(way - 5.0) < 0.1 for way in moved) else f"moved by {moved} instead of 5 mm"

    def print(self) -> str:
        """Return a digest of everything recorded, except the events of the faults themselves."""
        trace = self.bench.trace()
        sha = hashlib.sha256()
        for group in trace.groups:
            sha.update(group.name.encode())
            sha.update(group.values.tobytes())
        for event in trace.events:
            if not event.kind.startswith("fault."):
                sha.update(event_json(event).encode())
        for frame in trace.frames:
            sha.update(frame.canonical())
        return sha.hexdigest()

    def close(self) -> None:
        """Let the bench go."""
        self.bench.close()


@cache
def undisturbed(situation: Situation) -> str:
    """Return the digest of a situation without any fault."""
    stage = Stage(situation)
    stage.act()
    result = stage.print()
    stage.close()
    return result
