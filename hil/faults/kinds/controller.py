"""Faults of the controller itself: its operating state, its supply, its execution levels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Final

from fieldbus.clock import MS
from fieldbus.errors import ConfigurationError
from hil.faults._kind import Action, Family, FaultType, Injection
from hil.faults._overrides import shared
from hil.faults._parameters import Parameter
from hil.faults.seams import (
    BenchWithController,
    BenchWithNc,
    BenchWithNcAxes,
    ProgrammedController,
    ProgramOfNc,
    offers,
)

_NAME: Final = "controller"


@dataclass
class HeldController:
    """What the faults of a controller hold at present: they may overlap, and it is free when the last
    one ends.
    """

    controller: ProgrammedController
    stops: int = 0
    cuts: int = 0
    stalls: int = 0
    times: dict[str, list[int]] = field(default_factory=lambda: {"servo": [], "interpolator": []})
    """By level: the time without faults, then that of every fault, ns."""

    def stop(self) -> None:
        """Go to STOP."""
        self.stops += 1
        self.controller.stop("fault")

    def breakpoint(self) -> bool:
        """Meet a breakpoint; returns whether the program runs, for else it meets none."""
        if self.controller.state.value != "RUN":
            return False
        self.stops += 1
        self.controller.breakpoint()
        return True

    def resume(self) -> None:
        """End one of the stops."""
        self.stops -= 1
        if not self.stops and self.controller.state.value != "power off":
            self.controller.run()

    def cut(self) -> None:
        """Cut the supply."""
        self.cuts += 1
        self.controller.power_off()

    def supply(self) -> None:
        """End one of the cuts."""
        self.cuts -= 1
        if self.cuts:
            return
        self.controller.power_on()
        if self.stops:
            self.controller.stop("fault")

    def stall(self, stalled: bool) -> None:
        """Let all levels hang, or end one of the stalls."""
        self.stalls += 1 if stalled else -1
        self.controller.levels.stall(self.stalls > 0)

    def take(self, level: str, time_ns: int) -> None:
        """Let a level take long."""
        times = self.times[level]
        if not times:
            servo_ns, interpolator_ns = self.controller.levels.computing_time
            times.append(servo_ns if level == "servo" else interpolator_ns)
        times.append(time_ns)
        self._set_time(level)

    def take_no_longer(self, level: str, time_ns: int) -> None:
        """Let it take as long as before, or as another fault wants it."""
        times = self.times[level]
        times.remove(time_ns)
        self._set_time(level)
        if len(times) == 1:
            times.clear()

    def _set_time(self, level: str) -> None:
        if level == "servo":
            self.controller.levels.set_computing_time(servo_ns=self.times[level][-1])
        else:
            self.controller.levels.set_computing_time(interpolator_ns=self.times[level][-1])


@dataclass
class HeldPlc:
    """The faults that stop the PLC of an NC: it runs when the last one ends."""

    nc: ProgramOfNc
    stops: int = 0

    def stop(self) -> None:
        """Stop the PLC."""
        self.stops += 1
        self.nc.plc_running = False

    def resume(self) -> None:
        """End one of the stops."""
        self.stops -= 1
        self.nc.plc_running = not self.stops


@dataclass(frozen=True)
class AtController:
    """The effect of a kind on the controller of the bench.

    Args:
        make: Returns the action, given what the faults of this controller hold.
        stops_plc: On axes of an NC it stops their PLC; otherwise an NC does not have it.

    """

    make: Callable[[Injection, HeldController], Action]
    stops_plc: bool = False
    needs: None = None

    def __call__(self, injection: Injection) -> Action:
        """Return the action of one fault."""
        bench = injection.bench
        if injection.target not in ("", _NAME):
            raise ConfigurationError(
                f"{injection.kind.name}: target", injection.target, f"{_NAME}, or nothing"
            )
        if offers(bench, BenchWithNcAxes) and bench.nc_axis_names and offers(bench, BenchWithNc):
            return self._at_nc(injection, bench)
        if not offers(bench, BenchWithController) or not bench.axis_names:
            injection.refuse("the controller of this bench is outside of it")
        controller = bench.controller
        injection.check_environment(controller)
        return self.make(injection, shared(injection.bench, _NAME, lambda: HeldController(controller)))

    def _at_nc(self, injection: Injection, bench: BenchWithNc) -> Action:
        if not self.stops_plc:
            injection.refuse("the controller of this bench is an NC, of which only the PLC can be stopped")
        if offers(bench, BenchWithController) and bench.axis_names:
            injection.refuse("this bench has two controllers, technology objects and an NC")
        nc = bench.nc
        held = shared(injection.bench, _NAME, lambda: HeldPlc(nc))
        return Action(_NAME, held.stop, held.resume)


def _stop(_injection: Injection, held: HeldController) -> Action:
    return Action(_NAME, held.stop, held.resume)


def _breakpoint(_injection: Injection, held: HeldController) -> Action:
    met: list[bool] = []

    def remove() -> None:
        if met.pop():
            held.resume()

    return Action(_NAME, lambda: met.append(held.breakpoint()), remove)


def _power_off(_injection: Injection, held: HeldController) -> Action:
    return Action(_NAME, held.cut, held.supply)


def _overrun(injection: Injection, held: HeldController) -> Action:
    level, time_ns = injection.values.text("level"), round(injection.values.number("time_ms") * MS)
    return Action(_NAME, lambda: held.take(level, time_ns), lambda: held.take_no_longer(level, time_ns))


def _stall(_injection: Injection, held: HeldController) -> Action:
    return Action(_NAME, lambda: held.stall(True), lambda: held.stall(False))


# -- kinds -----------------------------------------------------------------------------------------------
_kind: Final = partial(FaultType, target="controller")

FAMILY: Final = Family(
    kinds=(
        _kind(
            "controller.stop",
            "The controller goes to STOP, and to RUN at the end: a warm restart",
            AtController(_stop, stops_plc=True),
            seam="operating state",
            remark="afterwards nothing is enabled; the instances of the program start from the beginning",
            example={"duration_s": 1.0},
            text="""
            The controller goes to STOP: every technology object is disabled with the effect of reaction
            4, its jobs end with `CommandAborted`, the drive stops as `Actor.RemoveEnableReaction` says,
            and then gets zeros; the outputs of I/O stations are off at once. The end of the fault is a
            warm restart: STARTUP, RUN, nothing enabled, all instances as at the beginning. A PROFIdrive
            axis has missed the sign of life meanwhile and shows F01912, which `MC_Reset` acknowledges. On
            a bench with axes of an NC it is the PLC that stops, while the NC runs on: what it has written
            last counts until the watchdog of the interface takes all enables away.
            The target is `controller`, or none.
            """,
        ),
        _kind(
            "controller.breakpoint",
            (
                "The program meets a breakpoint: MC_Servo overflows, STOP, the technology objects are "
                "restarted; RUN at the end"
            ),
            AtController(_breakpoint),
            seam="operating state",
            example={"duration_s": 1.0},
            text="""
            The user program meets a breakpoint while axes move: `MC_Servo` overflows, the controller goes
            to STOP, and every technology object is restarted, so that axes with incremental encoders have
            to be homed again. At the end of the fault RUN.
            """,
        ),
        _kind(
            "controller.power_off",
            "The supply of the controller is cut; at the end it starts again",
            AtController(_power_off),
            seam="supply",
            remark="its buses fall silent; the drives are taken into service again afterwards",
            example={"duration_s": 0.5},
            text="""
            The supply of the controller is cut: from one instant to the next it sends nothing and
            acknowledges nothing, and what is not retentive is gone. The drives stop by themselves. At the
            end of the fault it starts again, takes the drives into service again, and goes to RUN.
            """,
        ),
        _kind(
            "controller.overrun",
            (
                "A call of MC_Servo or MC_Interpolator takes long; too long ends in STOP, which outlasts "
                "the fault"
            ),
            AtController(_overrun),
            seam="execution level",
            parameters=(
                Parameter(
                    "level",
                    "text",
                    "Level that takes long",
                    default="servo",
                    choices=("servo", "interpolator"),
                ),
                Parameter(
                    "time_ms",
                    "float",
                    "Time that every call takes",
                    unit="ms",
                    minimum=0.0,
                    maximum=1000.0,
                    required=True,
                ),
            ),
            remark=(
                "outputs come later by the time of MC_Servo; setpoints are missing while MC_Interpolator "
                "is late"
            ),
            example={"duration_s": 0.1, "parameters": {"level": "interpolator", "time_ms": 5.0}},
            text="""
            `MC_Servo` or `MC_Interpolator` takes long. The outputs of `MC_Servo` come later by its time;
            longer than its cycle, it ends in STOP. An interpolator that is not ready when `MC_Servo`
            wants its setpoints lets the axis stay at the last one: three times in a row are tolerated,
            the fourth is STOP, and so is a second call of `MC_Servo` in one run (MC-636, MC-637). A STOP
            lasts: the end of the fault only ends the computing time. Every overflow is an entry of the
            diagnostics buffer.
            """,
        ),
        _kind(
            "controller.stall",
            (
                "All levels hang, and the controller does not notice: no inputs, no telegrams; SYNC and "
                "heartbeat go on"
            ),
            AtController(_stall),
            seam="execution level",
            example={"duration_s": 0.2},
            text="""
            All levels hang, and the controller does not notice: nothing is read, calculated or sent,
            while SYNC and heartbeat go on. This is what firmware without monitoring would do. At the end
            everything resumes where it was.
            """,
        ),
    ),
)
